/**
 * A test double of the engine: it speaks the protocol without a simulation, so that tests can cause what the real engine does not do on demand. The
 * vehicle `Mock` moves by sine functions; its controller `Endless` never returns from 1 s on, `Broken` fails at 1 s.
 */

import type { Adjustable, Catalog, Column, Event, Opened, Request, Response, Setup } from "../../lab/src/protocol";

const STEP = 0.01;
const STOP = 12;
const DEG = { unit: "deg", factor: 180 / Math.PI };
const PLACES = ["fl", "fr", "ml", "mr", "rl", "rr"];
const adjustable = (id: string, title: string, unit: string, min: number, max: number, value: number): Adjustable => ({ id, title, unit, min, max, value, display: { unit: unit === "m/s" ? "km/h" : unit, factor: unit === "m/s" ? 3.6 : 1 } });

const parameters = {
  "vehicle.mass": 36000, "geometry.cg_to_front_axle": 2.52, "geometry.front_to_middle_axle": 2.95, "geometry.middle_to_rear_axle": 1.65,
  "geometry.track": 2.55, "geometry.body_cg_to_roll_axis": 1,
};
const column = (name: string, unit = "", display = { unit, factor: 1 }): Column => ({ name, description: `Signal ${name}`, unit, display });
const columns: Column[] = [
  column("vehicle.speed", "m/s", { unit: "km/h", factor: 3.6 }), column("vehicle.position_x", "m"), column("vehicle.position_y", "m"), column("vehicle.yaw", "rad", DEG),
  column("vehicle.yaw_rate", "rad/s", { unit: "deg/s", factor: DEG.factor }), column("vehicle.lateral_acceleration", "m/s2"), column("vehicle.load_transfer_ratio"),
  column("body.roll", "rad", DEG), column("body.pitch", "rad", DEG), column("body.heave", "m"), column("steer.front", "rad", DEG), column("steer.rear", "rad", DEG),
  ...PLACES.flatMap((place) => [column(`wheel_height.${place}`, "m"), column(`tire_load.${place}`, "N"), column(`tire_lateral_force.${place}`, "N")]),
];

const catalog: Catalog = {
  vehicles: [{
    fmu: "RescueVehicle", title: "Three-axle vehicle", base: [], defaults: ["Steady"], parameters, outputs: columns.map(({ name }) => name), maneuvers: ["weave", "free"],
    controllers: [
      { fmu: "Steady", title: "Reduces roll", needs: [], excludes: ["Endless"] },
      { fmu: "Helper", title: "Needs Steady", needs: ["Steady"], excludes: [] },
      { fmu: "Endless", title: "Does not return from a step at 1 s", needs: [], excludes: ["Steady"] },
      { fmu: "Broken", title: "Fails at 1 s", needs: [], excludes: [] },
    ],
  }],
  maneuvers: [
    { id: "weave", title: "Weave", kind: "bench", values: [adjustable("speed", "Speed", "m/s", 5, 30, 20)] },
    { id: "free", title: "Free drive", kind: "free", values: [adjustable("speed", "Speed", "m/s", 5, 30, 20)] },
  ],
  roads: [{ id: "flat", title: "Flat" }],
  scenarios: [{ id: "demo", title: "A demonstration", vehicle: "RescueVehicle", cases: [{ id: "none", title: "No control" }, { id: "all", title: "All controllers" }], seeds: [1, 2] }],
};

let setup: Setup | null = null;
let [time, rate, branch, branches, isBehind] = [0, 0, 0, 0, false];
let gain = 1;
let steer = 0;
let hasFailed = false;

const post = (message: Response | Event) => self.postMessage(message);
const has = (name: string) => setup?.system.kind === "free" && setup.system.controllers.includes(name);

function row(time: number, system: number): number[] {
  const share = (system === 0 && !(setup?.system.kind === "free" && setup.system.controllers.length === 0) ? 0.55 : 1) * gain;
  const w = 2 * Math.PI * 0.3;
  const [s, c] = [Math.sin(w * time), Math.cos(w * time)];
  const speed = 20;
  const load = 36000 * 9.81 / 6;
  const wheels = PLACES.flatMap((place) => {
    const side = place[1] === "l" ? 1 : -1;
    return [0.02 * share * side * s, Math.max(0, load * (1 - 0.9 * share * side * s)), load * 0.35 * s * (1 - 0.5 * side * s)];
  });
  return [time, speed, speed * time, 3 * (1 - c) * share + steer, 0.1 * s * share, 0.19 * c * share, 4 * s, 0.9 * s * share, 0.08 * s * share, 0.01 * c, 0.01 * s, 0.06 * s, -0.02 * s * share, ...wheels];
}

function send(from: number, count: number): void {
  for (const system of [0, 1]) {
    if (system === 0 && hasFailed) continue;
    const rows = Array.from({ length: count }, (_, i) => row((from + i) * STEP, system)).flat();
    post({ kind: "rows", system, branch, count, data: Float64Array.from(rows) });
  }
}

const info = (title: string) => ({
  title, vehicle: "RescueVehicle", components: [{ name: "vehicle", fmu: "RescueVehicle" }], columns,
  adjustables: [adjustable("vehicle:driver.speed", "Speed", "m/s", 0, 30, 20), adjustable("vehicle:tire.friction", "Friction", "", 0.1, 1, 0.7)],
});

function open(next: Setup): Opened {
  [setup, time, rate, branch, branches, isBehind, gain, steer, hasFailed] = [next, 0, 0, 0, 0, false, 1, 0, false];
  const path = Array.from({ length: 300 }, (_, i) => [i, 3 * (1 - Math.cos(2 * Math.PI * 0.3 * i / 20))] as [number, number]);
  return { step: 0.001, stop: STOP, rowStep: STEP, systems: [info("RescueVehicle with controllers"), info("Without controllers")], path, cones: [[20, 40, -2, 2], [60, 80, 4, 8]], origin: [{ fmu: "RescueVehicle", version: "0", guid: "{0}" }] };
}

setInterval(() => {
  if (rate === 0 || setup === null) return;
  if (isBehind) {
    isBehind = false;
    branch = ++branches;
    post({ kind: "branch", branch, from: time });
  }
  const wanted = Math.min(STOP, time + Math.min(rate, 50) * 0.03);
  const [first, last] = [Math.round(time / STEP) + 1, Math.round(wanted / STEP)];
  if (wanted > 1 && has("Endless")) for (;;);
  if (wanted > 1 && has("Broken") && !hasFailed) {
    hasFailed = true;
    post({ kind: "failed", system: 0, time: 1, component: "Broken", message: "division by zero" });
  }
  if (last >= first) send(first, last - first + 1);
  time = wanted;
  if (time >= STOP) rate = 0;
  post({ kind: "clock", time, rate, playing: rate > 0 });
}, 30);

self.addEventListener("message", ({ data }: MessageEvent<Request>) => {
  switch (data.kind) {
    case "start": return post({ kind: "started", id: data.id, catalog });
    case "add": return post({ kind: "added", id: data.id });
    case "drop": return post({ kind: "error", id: data.id, message: `${data.name} has no binary for WebAssembly.`, help: "Pack it with --platforms wasm32." });
    case "open":
      post({ kind: "opened", id: data.id, opened: open(data.setup) });
      return send(0, 1);
    case "play": rate = data.rate; return;
    case "seek":
      time = data.time;
      isBehind = true;
      return post({ kind: "sought", id: data.id, time });
    case "set": if (data.adjustable.endsWith("friction")) gain = 0.7 / data.value; return;
    case "drive": steer = data.driving.steer; return;
    case "metrics": return post({ kind: "metrics", id: data.id, metrics: [{ id: "roll", title: "Greatest roll", unit: "deg", definition: "Greatest absolute value of the roll angle.", values: [2.5, 4.6], reason: "", verdict: "pass" }] });
    case "csv": case "ssp": return post({ kind: "file", id: data.id, name: `run.${data.kind}`, bytes: new TextEncoder().encode("time\n") });
    case "describe": return post({ kind: "described", id: data.id, variables: [{ name: "body.roll", causality: "output", unit: "rad", start: "", description: "Roll angle" }] });
  }
});
