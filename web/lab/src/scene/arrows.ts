/** Arrows for the tire forces: load, lateral and longitudinal force of each wheel. */

import { ConeGeometry, CylinderGeometry, Color, InstancedMesh, Group, Matrix4, MeshBasicMaterial, Quaternion, Vector3 } from "three";
import { color } from "../../../src/dom";
import type { Shape } from "../shape";
import type { Pose } from "./pose";

/** Names of the colors in the page's style. */
const COLORS = ["force-load", "force-lateral", "force-longitudinal"];
/** Length of the arrow of a static wheel load, in wheel radii. */
const SCALE = 1.9;
const X = new Vector3(1, 0, 0);

export class Arrows {
  readonly root = new Group();
  readonly #shafts: InstancedMesh;
  readonly #heads: InstancedMesh;
  readonly #matrix = new Matrix4();
  readonly #turn = new Quaternion();

  constructor(readonly shape: Shape) {
    const count = 3 * shape.wheels.length;
    const size = shape.kind === "car" ? 0.022 : 0.04;
    const shaft = new CylinderGeometry(size, size, 1, 10).rotateZ(-Math.PI / 2).translate(0.5, 0, 0);
    const head = new ConeGeometry(2.6 * size, 6 * size, 14).rotateZ(-Math.PI / 2).translate(-3 * size, 0, 0);
    this.#shafts = new InstancedMesh(shaft, new MeshBasicMaterial(), count);
    this.#heads = new InstancedMesh(head, new MeshBasicMaterial(), count);
    const palette = COLORS.map((name) => new Color(color(name)));
    for (let i = 0; i < count; i++) for (const mesh of [this.#shafts, this.#heads]) mesh.setColorAt(i, palette[i % 3]!);
    for (const mesh of [this.#shafts, this.#heads]) {
      mesh.frustumCulled = false;
      this.root.add(mesh);
    }
  }

  show(pose: Pose): void {
    this.root.position.set(pose.x, pose.y, 0);
    this.root.rotation.z = pose.yaw;
    const { shape } = this;
    const scale = (SCALE * shape.radius) / shape.load;
    pose.wheels.forEach((wheel, i) => {
      const place = shape.wheels[i]!;
      // Arrows are beside the wheel, where the vehicle does not hide them.
      const y = place.y + place.side * (0.5 * place.count * shape.width + 0.16);
      const foot = new Vector3(place.x, y, 0.04);
      const turned = (x: number, across: number) => new Vector3(x * Math.cos(wheel.steer) - across * Math.sin(wheel.steer), x * Math.sin(wheel.steer) + across * Math.cos(wheel.steer), 0);
      this.#place(3 * i, foot, new Vector3(0, 0, scale * (wheel.load ?? 0)));
      const lateral = turned(0, scale * (wheel.lateral ?? 0));
      // The arrow of a force toward the vehicle ends at the wheel instead of starting there, to stay visible.
      this.#place(3 * i + 1, lateral.y * place.side < 0 ? foot.clone().sub(lateral) : foot, lateral);
      this.#place(3 * i + 2, foot, turned(scale * (wheel.longitudinal ?? 0), 0));
    });
    for (const mesh of [this.#shafts, this.#heads]) mesh.instanceMatrix.needsUpdate = true;
  }

  #place(index: number, from: Vector3, vector: Vector3): void {
    const length = vector.length();
    if (!(length > 0.03)) {
      this.#matrix.makeScale(0, 0, 0);
      this.#shafts.setMatrixAt(index, this.#matrix);
      this.#heads.setMatrixAt(index, this.#matrix);
      return;
    }
    this.#turn.setFromUnitVectors(X, vector.clone().divideScalar(length));
    this.#shafts.setMatrixAt(index, this.#matrix.compose(from, this.#turn, new Vector3(Math.max(0.001, length - 0.1), 1, 1)));
    const head = Math.min(1, length / 0.3);
    this.#heads.setMatrixAt(index, this.#matrix.compose(from.clone().add(vector), this.#turn, new Vector3(head, head, head)));
  }

  dispose(): void {
    this.root.removeFromParent();
    for (const mesh of [this.#shafts, this.#heads]) {
      mesh.geometry.dispose();
      (mesh.material as MeshBasicMaterial).dispose();
      mesh.dispose();
    }
  }
}
