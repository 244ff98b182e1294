/** Dimensions for drawing a vehicle. */

import assert from "node:assert/strict";
import { test } from "node:test";
import type { Vehicle } from "../lab/src/protocol";
import { shapeOf } from "../lab/src/shape";

const vehicle = (outputs: string[]): Vehicle => ({
  fmu: "",
  title: "",
  controllers: [],
  defaults: [],
  parameters: { "geometry.cg_to_front_axle": 1.2, "geometry.cg_to_rear_axle": 1.8 },
  outputs,
  maneuvers: [],
});

// Because the moments about the center of gravity are in balance, the nearer axle carries more.
test("the levers of the axles divide the load of a side of a half car", () => {
  const shares = shapeOf(vehicle(["vehicle.yaw", "wheel_height.l"])).wheels.map(({ place, share }) => [place, share]);
  const expected = [["fl", 0.6], ["fr", 0.6], ["rl", 0.4], ["rr", 0.4]] as const;
  assert.deepEqual(shares.map(([place]) => place), expected.map(([place]) => place));
  expected.forEach(([place, share], i) => assert.ok(Math.abs((shares[i]?.[1] as number) - share) < 1e-15, place));
  assert.deepEqual(shapeOf(vehicle(["tire_load.fl", "tire_load.rr"])).wheels.map(({ share }) => share), [1, 1]);
});
