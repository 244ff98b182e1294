/** Position and orientation of a vehicle and its wheels at a time, from signals. Missing signals are zero. */

import type { Recording } from "../recording";
import type { Shape } from "../shape";

export interface WheelPose {
  /** Height above static equilibrium, m. */
  height: number;
  steer: number;
  spin: number;
  /** Forces on the vehicle in the wheel's frame, N; `null` if there is no signal. */
  load: number | null;
  lateral: number | null;
  longitudinal: number | null;
}

/** Signals of the body's position and orientation. */
const BODY = { x: "vehicle.position_x", y: "vehicle.position_y", yaw: "vehicle.yaw", heave: "body.heave", roll: "body.roll", pitch: "body.pitch" };

export interface Pose extends Record<keyof typeof BODY, number> {
  wheels: WheelPose[];
  /** Height and pitch of the left and the right walking beam. */
  beams: [number, number][];
}

export class PoseReader {
  readonly #body: [name: string, column: number][];
  readonly #wheels: (Record<keyof WheelPose, number> & { share: number })[];
  readonly #beams: [number, number][];

  constructor(
    readonly recording: Recording,
    shape: Shape,
  ) {
    const column = (...names: string[]) => recording.column(...names);
    this.#body = Object.entries(BODY).map(([name, signal]) => [name, column(signal)]);
    this.#wheels = shape.wheels.map(({ place, axle, side, share }, i) => {
      // A half car has one wheel on each side.
      const half = side > 0 ? "l" : "r";
      return {
        height: column(`wheel_height.${place}`, `wheel_height.${half}`),
        steer: axle === "front" ? column("steer.front", "driver.steer") : column(`steer.${axle}`),
        spin: recording.spinColumn(i),
        load: column(`tire_load.${place}`, `tire_load.${half}`),
        lateral: column(`tire_lateral_force.${place}`),
        longitudinal: column(`tire_longitudinal_force.${place}`),
        share,
      };
    });
    this.#beams = ["l", "r"].map((side) => [column(`beam_height.${side}`, `wheel_height.${side}`), column(`beam_pitch.${side}`)]);
  }

  read(branch: number, time: number): Pose {
    const scaled = (value: number | null, factor: number) => (value === null ? null : factor * value);
    const get = (column: number): number | null => {
      const value = this.recording.at(branch, column, time);
      return Number.isFinite(value) ? value : null;
    };
    const body = Object.fromEntries(this.#body.map(([name, column]) => [name, get(column) ?? 0])) as Record<keyof typeof BODY, number>;
    return {
      ...body,
      wheels: this.#wheels.map((wheel) => ({
        height: get(wheel.height) ?? 0,
        steer: get(wheel.steer) ?? 0,
        spin: get(wheel.spin) ?? 0,
        load: scaled(get(wheel.load), wheel.share),
        lateral: get(wheel.lateral),
        longitudinal: get(wheel.longitudinal),
      })),
      beams: this.#beams.map(([height, angle]) => [get(height) ?? 0, get(angle) ?? 0]),
    };
  }
}
