/** Geometries of vehicle bodies and wheels, built from the dimensions of the vehicle. Axes as in ISO 8855, origin on the ground. */

import { BoxGeometry, type BufferGeometry, CylinderGeometry, ExtrudeGeometry, Shape as Outline } from "three";
import { RoundedBoxGeometry } from "three/examples/jsm/geometries/RoundedBoxGeometry.js";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { Shape } from "../shape";

export type Finish = "paint" | "second" | "glass" | "dark" | "metal" | "white" | "red" | "blue";
export type Parts = Partial<Record<Finish, BufferGeometry>>;

type Point = [x: number, z: number];

/** Collects parts, and merges parts with the same finish to reduce draw calls. */
class Kit {
  readonly #parts = new Map<Finish, BufferGeometry[]>();

  add(finish: Finish, geometry: BufferGeometry): void {
    const plain = geometry.index === null ? geometry : geometry.toNonIndexed();
    plain.deleteAttribute("uv");
    const list = this.#parts.get(finish) ?? [];
    list.push(plain);
    this.#parts.set(finish, list);
  }

  box(finish: Finish, from: [number, number, number], to: [number, number, number], bevel = 0): void {
    const size = to.map((end, i) => Math.abs(end - from[i]!)) as [number, number, number];
    const geometry = bevel > 0 ? new RoundedBoxGeometry(...size, 2, bevel) : new BoxGeometry(...size);
    this.add(finish, geometry.translate((from[0] + to[0]) / 2, (from[1] + to[1]) / 2, (from[2] + to[2]) / 2));
  }

  /** Adds a box and its mirror image on the other side. */
  boxes(finish: Finish, from: [number, number, number], to: [number, number, number], bevel = 0): void {
    this.box(finish, from, to, bevel);
    this.box(finish, [from[0], -from[1], from[2]], [to[0], -to[1], to[2]], bevel);
  }

  /** Adds a side view, extruded to a width. */
  side(finish: Finish, outline: Outline, width: number, bevel = 0.05): void {
    const geometry = new ExtrudeGeometry(outline, {
      depth: width - 2 * bevel,
      bevelEnabled: bevel > 0,
      bevelThickness: bevel,
      bevelSize: bevel,
      bevelOffset: -bevel,
      bevelSegments: 2,
      curveSegments: 16,
    });
    this.add(finish, geometry.rotateX(Math.PI / 2).translate(0, width / 2 - bevel, 0));
  }

  get parts(): Parts {
    return Object.fromEntries([...this.#parts].map(([finish, list]) => [finish, mergeGeometries(list)!]));
  }
}

function polygon(points: Point[]): Outline {
  const outline = new Outline();
  points.forEach(([x, z], i) => (i === 0 ? outline.moveTo(x, z) : outline.lineTo(x, z)));
  outline.closePath();
  return outline;
}

/** Makes a side view with wheel arches in its lower edge; `top` is the upper edge from the front to the rear. */
function arched(bottom: number, top: Point[], arches: number[], center: number, radius: number): Outline {
  const outline = new Outline();
  const half = Math.sqrt(Math.max(0, radius ** 2 - (center - bottom) ** 2));
  const angle = Math.asin(Math.min(1, (center - bottom) / radius));
  outline.moveTo(top[top.length - 1]![0], bottom);
  for (const x of [...arches].sort((a, b) => a - b)) {
    outline.lineTo(x - half, bottom);
    outline.absarc(x, center, radius, Math.PI + angle, -angle, true);
  }
  outline.lineTo(top[0]![0], bottom);
  for (const [x, z] of top) outline.lineTo(x, z);
  outline.closePath();
  return outline;
}

const axlesOf = (shape: Shape): number[] => [...new Set(shape.wheels.map(({ x }) => x))];

function lamps(kit: Kit, front: number, rear: number, y: number, z: number, size: number): void {
  kit.boxes("white", [front - 0.02, y - 1.6 * size, z], [front + 0.03, y, z + 0.8 * size], 0.02);
  kit.boxes("red", [rear - 0.03, y - 1.2 * size, z], [rear + 0.02, y, z + 0.8 * size], 0.02);
}

function rescue(kit: Kit, shape: Shape): void {
  const { front, rear, radius } = shape;
  const width = shape.track + 1.1 * shape.width;
  const side = width / 2;
  const [nose, tail] = [front + 1.4, rear - 1.45];
  const [sill, belt, roof] = [0.62, 1.42, 3.05];
  const wall = front - 0.85;
  kit.side("dark", polygon([[tail + 0.3, 0.75], [nose - 0.6, 0.75], [nose - 0.6, 1.1], [tail + 0.3, 1.1]]), 0.95, 0.02);
  kit.side("second", arched(sill, [[nose, sill + 0.1], [nose, belt], [tail, belt], [tail, sill]], axlesOf(shape), radius, radius + 0.17), width);
  // Cab with a sloping windshield, then the body behind it.
  kit.side("paint", polygon([[nose - 0.02, belt - 0.04], [nose - 0.05, belt + 0.35], [nose - 0.38, roof - 0.12], [nose - 0.55, roof], [wall + 0.06, roof], [wall + 0.06, belt - 0.04]]), width - 0.06, 0.07);
  kit.side("paint", polygon([[wall, belt - 0.04], [wall, roof + 0.12], [tail, roof + 0.12], [tail, belt - 0.04]]), width, 0.07);
  kit.box("white", [wall - 0.06, -side - 0.006, belt + 0.02], [tail + 0.06, side + 0.006, belt + 0.2]);
  // Windows.
  kit.side("glass", polygon([[nose - 0.03, belt + 0.42], [nose - 0.31, roof - 0.26], [nose - 0.34, roof - 0.26], [nose - 0.1, belt + 0.42]]), width - 0.36, 0.01);
  kit.side("glass", polygon([[nose - 0.28, belt + 0.45], [nose - 0.55, roof - 0.28], [wall + 0.35, roof - 0.28], [wall + 0.35, belt + 0.45]]), width - 0.04, 0.01);
  // Shutters of the equipment lockers.
  const length = (wall - tail - 0.5) / 3;
  for (let i = 0; i < 3; i++) {
    const x = wall - 0.2 - i * (length + 0.05);
    kit.boxes("metal", [x, side - 0.01, belt + 0.32], [x - length, side + 0.012, roof - 0.1]);
  }
  kit.box("metal", [tail - 0.012, -0.75, belt + 0.32], [tail + 0.02, 0.75, roof - 0.1]);
  kit.box("blue", [nose - 0.95, -0.85, roof], [nose - 0.7, 0.85, roof + 0.16], 0.05);
  kit.boxes("blue", [tail + 0.1, side - 0.35, roof + 0.12], [tail + 0.3, side - 0.1, roof + 0.26], 0.04);
  kit.box("dark", [nose - 0.05, -side + 0.12, sill + 0.02], [nose + 0.09, side - 0.12, sill + 0.32], 0.05);
  kit.boxes("dark", [nose - 0.25, side - 0.02, belt + 0.55], [nose - 0.1, side + 0.2, belt + 0.95], 0.04);
  lamps(kit, nose, tail, side - 0.14, sill + 0.42, 0.24);
}

function truck(kit: Kit, shape: Shape): void {
  const { front, rear, radius } = shape;
  const width = Math.max(2.4, shape.track + 0.6);
  const side = width / 2;
  const [nose, tail] = [front + 1.35, rear - 0.95];
  const [belt, roof] = [1.5, 2.95];
  const wall = front - 0.75;
  const floor = 2 * radius + 0.34;
  kit.side("dark", polygon([[tail, 0.82], [nose - 0.3, 0.82], [nose - 0.3, 1.08], [tail, 1.08]]), 0.86, 0.02);
  kit.side("second", arched(0.5, [[nose, 0.55], [nose, belt - 0.25], [wall, belt - 0.25], [wall, 1.0]], [front], radius, radius + 0.17), width - 0.1);
  kit.side("paint", polygon([[nose, belt - 0.3], [nose - 0.04, belt + 0.2], [nose - 0.28, roof - 0.1], [nose - 0.42, roof], [wall, roof], [wall, belt - 0.3]]), width - 0.1, 0.08);
  kit.side("glass", polygon([[nose - 0.015, belt + 0.28], [nose - 0.22, roof - 0.24], [nose - 0.26, roof - 0.24], [nose - 0.08, belt + 0.28]]), width - 0.4, 0.01);
  kit.side("glass", polygon([[nose - 0.25, belt + 0.32], [nose - 0.44, roof - 0.26], [wall + 0.42, roof - 0.26], [wall + 0.42, belt + 0.32]]), width - 0.08, 0.01);
  kit.boxes("dark", [nose - 0.2, side - 0.06, belt + 0.35], [nose - 0.06, side + 0.16, belt + 0.85], 0.04);
  kit.box("dark", [nose - 0.04, -side + 0.15, 0.52], [nose + 0.08, side - 0.15, 0.86], 0.05);
  // Load bed with ribs.
  const head = wall - 0.2;
  kit.side("metal", polygon([[head, floor], [head, floor + 1.28], [tail - 0.05, floor + 1.28], [tail + 0.12, floor]]), width, 0.04);
  kit.box("dark", [head - 0.08, -side + 0.1, floor + 1.2], [tail + 0.05, side - 0.1, floor + 1.29]);
  const ribs = 5;
  for (let i = 0; i <= ribs; i++) {
    const x = head - 0.12 - (i * (head - tail - 0.3)) / ribs;
    kit.boxes("second", [x - 0.05, side - 0.01, floor + 0.04], [x + 0.05, side + 0.05, floor + 1.24]);
  }
  kit.box("second", [wall - 0.05, -side, floor + 1.35], [wall - 0.3, side, floor + 1.47], 0.03);
  // Fuel tank.
  kit.add("metal", new CylinderGeometry(0.28, 0.28, 1.1, 20).rotateZ(Math.PI / 2).translate((front - 0.8 + shape.beam!.x + 1.4) / 2, side - 0.36, 0.75));
  lamps(kit, nose, tail, side - 0.2, 0.95, 0.22);
}

function car(kit: Kit, shape: Shape): void {
  const { front, rear, radius } = shape;
  const width = shape.track + 1.15 * shape.width;
  const side = width / 2;
  const [nose, tail] = [front + 0.82, rear - 0.86];
  const [sill, hood, belt, roof] = [0.2, 0.78, 0.92, 1.42];
  const base = front - 0.3;
  const deck = rear + 0.02;
  const top: Point[] = [[nose - 0.04, 0.3], [nose, 0.52], [nose - 0.16, hood - 0.06], [base, belt - 0.02], [deck, belt + 0.03], [tail + 0.12, belt - 0.02], [tail, 0.6], [tail + 0.05, 0.28]];
  kit.side("paint", arched(sill, top, axlesOf(shape), radius, radius + 0.075), width, 0.07);
  // Greenhouse: glass, narrower than the body, under a painted roof.
  const glass: Point[] = [[base + 0.06, belt - 0.06], [base - 0.62, roof - 0.03], [deck + 0.42, roof - 0.03], [deck - 0.36, belt - 0.04]];
  kit.side("glass", polygon(glass), width - 0.26, 0.06);
  kit.side("paint", polygon([[base - 0.52, roof - 0.07], [base - 0.74, roof], [deck + 0.58, roof], [deck + 0.3, roof - 0.07]]), width - 0.3, 0.03);
  const pillar = (x: number, lean: number) => kit.side("paint", polygon([[x, belt - 0.05], [x + lean, roof - 0.04], [x + lean - 0.09, roof - 0.04], [x - 0.11, belt - 0.05]]), width - 0.245, 0.06);
  pillar((base + deck) / 2 - 0.12, 0);
  kit.side("dark", polygon([[nose + 0.015, 0.3], [nose + 0.015, 0.44], [nose - 0.1, 0.44], [nose - 0.1, 0.3]]), width - 0.5, 0.02);
  kit.boxes("dark", [base - 0.28, side - 0.1, belt - 0.02], [base - 0.1, side + 0.1, belt + 0.12], 0.04);
  lamps(kit, nose - 0.06, tail + 0.01, side - 0.14, 0.58, 0.2);
  kit.box("dark", [nose - 0.5, -side + 0.3, sill - 0.02], [tail + 0.5, side - 0.3, sill + 0.12]);
}

/** Builds a half car: a cross section at the center of mass, on a frame. */
function halfCar(kit: Kit, shape: Shape): void {
  const { front, rear } = shape;
  const side = shape.track / 2 - 0.6 * shape.width;
  kit.box("second", [front, -0.3, 0.42], [rear, 0.3, 0.52], 0.03);
  kit.box("paint", [0.2, -side, 0.4], [-0.2, side, 0.92], 0.05);
  kit.box("glass", [0.16, -side + 0.12, 0.9], [-0.16, side - 0.12, 1.36], 0.05);
  kit.box("paint", [0.19, -side + 0.16, 1.34], [-0.19, side - 0.16, 1.42], 0.03);
  // An arrow that points forward.
  kit.add("white", new ExtrudeGeometry(polygon([[front - 0.05, 0], [front - 0.5, 0.22], [front - 0.5, -0.22]]), { depth: 0.02, bevelEnabled: false }).translate(0, 0, 0.52));
}

export function bodyParts(shape: Shape): Parts {
  const kit = new Kit();
  ({ rescue, truck, car, "half car": halfCar })[shape.kind](kit, shape);
  return kit.parts;
}

/** Builds a wheel at the origin with its axis along y. The rim has spokes, which make the rotation visible. */
export function wheelParts(shape: Shape, count: number): Parts {
  const kit = new Kit();
  const { radius, width } = shape;
  const rim = 0.62 * radius;
  for (let i = 0; i < count; i++) {
    const y = (i - (count - 1) / 2) * (width + 0.04);
    const shoulder = Math.min(0.05, 0.15 * width);
    kit.add("dark", new CylinderGeometry(radius, radius, width - 2 * shoulder, 36).translate(0, y, 0));
    for (const side of [1, -1]) {
      const [one, other] = side > 0 ? [0.9 * radius, radius] : [radius, 0.9 * radius];
      kit.add("dark", new CylinderGeometry(one, other, shoulder, 36).translate(0, y + side * (width / 2 - shoulder / 2), 0));
    }
  }
  const outer = (count * width + (count - 1) * 0.04) / 2;
  kit.add("metal", new CylinderGeometry(rim, rim, 2 * outer + 0.012, 28, 1));
  kit.add("dark", new CylinderGeometry(0.86 * rim, 0.86 * rim, 2 * outer + 0.02, 28, 1));
  for (let i = 0; i < 5; i++) {
    kit.add("metal", new BoxGeometry(0.17 * rim, 2 * outer + 0.04, 0.9 * rim).translate(0, 0, 0.45 * rim).rotateY((i * 2 * Math.PI) / 5));
  }
  kit.add("metal", new CylinderGeometry(0.24 * rim, 0.24 * rim, 2 * outer + 0.06, 20));
  return kit.parts;
}

/** Builds a strut of length 1, upwards from the origin. */
export function strutParts(shape: Shape): Parts {
  const kit = new Kit();
  const size = shape.kind === "rescue" || shape.kind === "truck" ? 1 : 0.6;
  kit.add("metal", new CylinderGeometry(0.035 * size, 0.035 * size, 1, 12).rotateX(Math.PI / 2).translate(0, 0, 0.5));
  const coils = 7;
  for (let i = 0; i < coils; i++) {
    kit.add("blue", new CylinderGeometry(0.09 * size, 0.09 * size, 0.05, 16).rotateX(Math.PI / 2).rotateY(0.12).translate(0, 0, 0.2 + (i * 0.7) / coils));
  }
  return kit.parts;
}

/** Builds a walking beam with its middle at the origin. */
export function beamParts(length: number): Parts {
  const kit = new Kit();
  const half = length / 2;
  kit.side("metal", polygon([[half, -0.07], [half, 0.07], [0.2, 0.15], [-0.2, 0.15], [-half, 0.07], [-half, -0.07], [0, -0.1]]), 0.14, 0.02);
  kit.add("dark", new CylinderGeometry(0.1, 0.1, 0.2, 20));
  return kit.parts;
}
