/** Dimensions for drawing a vehicle, from the parameters of its FMU. */

import type { Vehicle } from "./protocol";
import { wheelPlaces } from "./recording";

export interface Wheel {
  /** fl, fr, ml, mr, rl, rr */
  place: string;
  axle: "front" | "middle" | "rear";
  /** 1: left, -1: right. */
  side: 1 | -1;
  x: number;
  y: number;
  /** Number of tires side by side. */
  count: number;
  /** Share of the wheel in the load signal. In a half car, the signal is the load of a side, which the axles share according to their distances. */
  share: number;
}

export interface Shape {
  /** A half car models a cross section: it has one wheel mass and one strut on each side. */
  kind: "rescue" | "truck" | "car" | "half car";
  wheels: Wheel[];
  radius: number;
  /** Width of one tire, m. */
  width: number;
  track: number;
  /** Positions of the foremost and the rearmost axle, m. */
  front: number;
  rear: number;
  /** Height of the roll axis, m. */
  rollAxis: number;
  /** Walking beams, or bars that connect the wheels of a side: middle and length, m; `null` if there are none. */
  beam: { x: number; length: number; z: number } | null;
  /** Static load of a wheel, which determines the scale of force arrows, N. */
  load: number;
}

export function shapeOf(vehicle: Vehicle): Shape {
  const get = (...names: string[]): number | undefined => names.map((name) => vehicle.parameters[name]).find((value) => value !== undefined);
  const places = wheelPlaces(vehicle);
  const half = get("geometry.half_track.left");
  const track = get("geometry.track") ?? (half === undefined ? 1.6 : half + (get("geometry.half_track.right") ?? half));
  const mass = get("vehicle.mass", "body.mass") ?? 1500;
  const hasThreeAxles = places.includes("ml");
  const isLarge = hasThreeAxles || mass > 5000;
  const front = get("geometry.cg_to_front_axle") ?? 1.3;
  const spacing = get("geometry.middle_to_rear_axle") ?? 1.4;
  const trunnion = get("geometry.cg_to_rear_suspension");
  const middle = trunnion === undefined ? front - (get("geometry.front_to_middle_axle") ?? 3) : spacing / 2 - trunnion;
  const rear = hasThreeAxles ? middle - spacing : -(get("geometry.cg_to_rear_axle") ?? 1.4);
  const radius = get("wheel.radius", "geometry.wheel_center_height") ?? (isLarge ? 0.52 : 0.31);
  const isHalf = vehicle.outputs.includes("wheel_height.l");
  const axles = { f: "front", m: "middle", r: "rear" } as const;
  const wheels = places.map((place): Wheel => {
    const axle = axles[place[0] as "f" | "m" | "r"];
    const side = place[1] === "l" ? 1 : -1;
    const share = isHalf ? (axle === "front" ? -rear : front) / (front - rear) : 1;
    return { place, axle, side, x: { front, middle, rear }[axle], y: (side * track) / 2, count: get(`tire.count.${axle}`) ?? 1, share };
  });
  const height = get("geometry.cg_height") ?? (isLarge ? 1.2 : 0.55);
  return {
    kind: isHalf ? "half car" : !isLarge ? "car" : trunnion === undefined ? "rescue" : "truck",
    wheels,
    radius,
    width: isLarge ? 0.32 : 0.2,
    track,
    front,
    rear,
    rollAxis: get("geometry.roll_center_height") ?? height - (get("geometry.body_cg_to_roll_axis") ?? height / 2),
    beam: isHalf ? { x: (front + rear) / 2, length: front - rear, z: radius } : trunnion === undefined ? null : { x: -trunnion, length: spacing, z: radius },
    load: (mass * 9.81) / Math.max(4, wheels.length),
  };
}
