/** A vehicle in the scene: solid, or transparent for comparison. */

import {
  type BufferGeometry,
  Color,
  EdgesGeometry,
  Group,
  LineBasicMaterial,
  LineSegments,
  type Material,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
} from "three";
import type { Shape } from "../shape";
import { type Finish, type Parts, beamParts, bodyParts, strutParts, wheelParts } from "./body";
import type { Pose } from "./pose";

const PAINT: Record<Shape["kind"], [paint: number, second: number]> = {
  rescue: [0xc2312b, 0xa32722],
  truck: [0x2f6f9f, 0x285a80],
  car: [0x2a7f86, 0x23666c],
  "half car": [0x2a7f86, 0x23666c],
};
const FINISH: Record<Exclude<Finish, "paint" | "second">, [color: number, roughness: number, metalness: number]> = {
  glass: [0x18222c, 0.15, 0.3],
  dark: [0x22272d, 0.85, 0],
  metal: [0xb4bcc4, 0.45, 0.25],
  white: [0xf2f4f6, 0.5, 0],
  red: [0xd8362f, 0.5, 0],
  blue: [0x2f7fe0, 0.4, 0],
};
/** Color of a wheel without load. */
const LIFTED = new Color(0xe0483e);

export class VehicleModel {
  readonly root = new Group();
  readonly #body = new Group();
  readonly #wheels: { carrier: Group; spinner: Group; strut: Group; beam: boolean }[] = [];
  readonly #beams: Group[] = [];
  readonly #geometries: BufferGeometry[] = [];
  readonly #materials = new Map<string, Material>();
  readonly #solid: MeshStandardMaterial[] = [];
  readonly #tires: MeshStandardMaterial[] = [];

  constructor(
    readonly shape: Shape,
    readonly isTwin: boolean,
    twinColor: string,
  ) {
    const pivot = shape.rollAxis;
    this.root.rotation.order = "ZYX";
    this.#body.rotation.order = "ZYX";
    const inside = new Group();
    inside.position.z = -pivot;
    this.#body.add(inside);
    this.root.add(this.#body);
    this.#put(inside, bodyParts(shape), twinColor, true);
    for (const { x, y, count } of shape.wheels) {
      const [carrier, spinner, strut] = [new Group(), new Group(), new Group()];
      this.#put(spinner, wheelParts(shape, count), twinColor, false);
      carrier.add(spinner);
      carrier.position.set(x, y, shape.radius);
      this.root.add(carrier);
      if (!isTwin) this.#put(strut, strutParts(shape), twinColor, false);
      this.root.add(strut);
      this.#wheels.push({ carrier, spinner, strut, beam: shape.beam !== null && x < 0 });
    }
    const { beam } = shape;
    if (beam !== null) {
      for (const side of [1, -1]) {
        const group = new Group();
        this.#put(group, beamParts(beam.length), twinColor, false);
        const inset = shape.kind === "half car" ? 0.5 * shape.width + 0.18 : 0.42;
        group.position.set(beam.x, side * (shape.track / 2 - inset), beam.z);
        this.#beams.push(group);
        this.root.add(group);
      }
    }
  }

  #put(parent: Group, parts: Parts, twinColor: string, isBody: boolean): void {
    for (const [finish, geometry] of Object.entries(parts) as [Finish, BufferGeometry][]) {
      this.#geometries.push(geometry);
      if (this.isTwin) this.#putTransparent(parent, geometry, twinColor, isBody);
      else {
        const material = this.#paint(finish, isBody);
        const mesh = new Mesh(geometry, material);
        mesh.castShadow = true;
        if (finish === "dark" && !isBody) this.#tires.push(material);
        parent.add(mesh);
      }
    }
  }

  #paint(finish: Finish, isBody: boolean): MeshStandardMaterial {
    const [color, roughness, metalness] =
      finish === "paint" ? [PAINT[this.shape.kind][0], 0.42, 0.05] : finish === "second" ? [PAINT[this.shape.kind][1], 0.5, 0.05] : FINISH[finish];
    // Wheels have separate materials, because the color shows the load.
    return this.#material(isBody ? finish : `${finish} ${this.#wheels.length}`, () => {
      const material = new MeshStandardMaterial({ color, roughness, metalness });
      if (isBody) this.#solid.push(material);
      return material;
    });
  }

  /** The material with a key, made on first use. */
  #material<T extends Material>(key: string, make: () => T): T {
    const material = (this.#materials.get(key) as T | undefined) ?? make();
    this.#materials.set(key, material);
    return material;
  }

  /** Adds a transparent part. Its depth is drawn first, which hides the surfaces behind its foremost surface. */
  #putTransparent(parent: Group, geometry: BufferGeometry, color: string, isBody: boolean): void {
    // Where both vehicles coincide, the transparent one is behind.
    const offset = { polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 2 };
    const depth = new Mesh(geometry, this.#material("depth", () => new MeshBasicMaterial({ colorWrite: false, ...offset })));
    depth.renderOrder = 2;
    const fill = new Mesh(
      geometry,
      this.#material("fill", () => new MeshStandardMaterial({ color, transparent: true, opacity: 0.3, depthWrite: false, roughness: 0.9, ...offset })),
    );
    fill.renderOrder = 3;
    parent.add(depth, fill);
    if (!isBody) return;
    const edges = new EdgesGeometry(geometry, 32);
    this.#geometries.push(edges);
    const lines = new LineSegments(edges, this.#material("edges", () => new LineBasicMaterial({ color, transparent: true, opacity: 0.45 })));
    lines.renderOrder = 4;
    parent.add(lines);
  }

  /** Makes the body transparent, to show suspension and wheels. */
  set isOpen(open: boolean) {
    for (const material of this.#solid) {
      material.transparent = open;
      material.opacity = open ? 0.22 : 1;
      material.depthWrite = !open;
    }
  }

  /** Moves all parts to their poses. Motion of the body and the wheels is magnified by a factor. */
  show(pose: Pose, factor: number): void {
    const { shape } = this;
    this.root.position.set(pose.x, pose.y, 0);
    this.root.rotation.z = pose.yaw;
    this.#body.position.z = shape.rollAxis + factor * pose.heave;
    this.#body.rotation.set(factor * pose.roll, factor * pose.pitch, 0, "ZYX");
    pose.wheels.forEach((wheel, i) => {
      const parts = this.#wheels[i];
      const place = shape.wheels[i];
      if (parts === undefined || place === undefined) return;
      const { carrier, spinner, strut, beam } = parts;
      carrier.position.z = shape.radius + factor * wheel.height;
      carrier.rotation.z = wheel.steer;
      spinner.rotation.y = wheel.spin % (2 * Math.PI);
      const tire = this.#tires[i];
      if (tire !== undefined) {
        const isLifted = wheel.load !== null && wheel.load < 0.001 * shape.load;
        tire.emissive = LIFTED;
        tire.emissiveIntensity = isLifted ? 0.7 : 0;
      }
      // The strut connects the wheel to the body above it; the position on the body is exact for small angles only.
      const y = place.y - place.side * (0.5 * shape.width * place.count + 0.18);
      const attached = factor * (pose.heave - place.x * pose.pitch + place.y * pose.roll);
      const top = (shape.kind === "half car" ? 1.9 : shape.kind === "car" ? 2.3 : 2.2) * shape.radius + attached;
      strut.visible = !beam;
      strut.position.set(shape.kind === "half car" ? 0 : place.x, y, carrier.position.z);
      strut.scale.z = Math.max(0.05, top - carrier.position.z);
    });
    pose.beams.forEach(([height, pitch], i) => {
      const beam = this.#beams[i];
      if (beam === undefined || shape.beam === null) return;
      beam.position.z = shape.beam.z + factor * height;
      beam.rotation.y = factor * pitch;
    });
  }

  dispose(): void {
    this.root.removeFromParent();
    for (const geometry of this.#geometries) geometry.dispose();
    for (const material of this.#materials.values()) material.dispose();
  }
}
