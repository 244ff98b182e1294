/** The ground: a grid, the path of the maneuver, cones, and the tracks of the vehicles. */

import {
  BufferAttribute,
  BufferGeometry,
  Color,
  ConeGeometry,
  DoubleSide,
  Group,
  InstancedMesh,
  Line,
  LineBasicMaterial,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  PlaneGeometry,
  ShaderMaterial,
  ShadowMaterial,
} from "three";
import { color } from "../../../src/dom";
import type { Opened } from "../protocol";

const SIZE = 500;
/** Cones of a section, on each side. */
const CONES = 5;
const CONE_HEIGHT = 0.55;

/** Grid lines every 2 m and 10 m, which fade with distance and do not flicker. */
const vertex = /* glsl */ `
varying vec3 place;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  place = world.xyz;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;
const fragment = /* glsl */ `
uniform vec3 ground;
uniform vec3 line;
uniform vec3 far;
uniform vec2 middle;
varying vec3 place;
float lines(float spacing, float width) {
  vec2 at = place.xy / spacing;
  vec2 change = fwidth(at);
  vec2 distance = abs(fract(at - 0.5) - 0.5);
  vec2 drawn = 1.0 - smoothstep(width * change, (width + 1.0) * change, distance);
  // Lines that are closer together than pixels are averaged.
  drawn *= clamp(0.25 / max(change, vec2(1e-6)), 0.0, 1.0);
  return max(drawn.x, drawn.y);
}
void main() {
  float away = length(place.xy - middle);
  float small = lines(2.0, 0.35) * (1.0 - smoothstep(15.0, 55.0, away));
  float large = lines(10.0, 0.6);
  vec3 color = mix(ground, line, max(0.38 * small, 0.85 * large));
  gl_FragColor = vec4(mix(color, far, smoothstep(25.0, 130.0, away)), 1.0);
  #include <colorspace_fragment>
}`;

/** Names of the grid's colors in the page's style. */
const COLORS = { ground: "ground", line: "ground-line", far: "sky" };

function ribbon(points: [number, number][], width: number, dash: number): BufferGeometry {
  const positions: number[] = [];
  let way = 0;
  for (let i = 1; i < points.length; i++) {
    const [[x0, y0], [x1, y1]] = [points[i - 1]!, points[i]!];
    const length = Math.hypot(x1 - x0, y1 - y0);
    if (length === 0) continue;
    const [tx, ty] = [(x1 - x0) / length, (y1 - y0) / length];
    const [nx, ny] = [(-ty * width) / 2, (tx * width) / 2];
    // The parts of the segment that belong to a dash.
    let from = 0;
    while (from < length) {
      const phase = (way + from) % (2 * dash);
      const to = Math.min(length, from + (phase < dash ? dash - phase : 2 * dash - phase) + 1e-6);
      if (phase < dash) {
        const [ax, ay, bx, by] = [x0 + tx * from, y0 + ty * from, x0 + tx * to, y0 + ty * to];
        positions.push(ax + nx, ay + ny, 0, ax - nx, ay - ny, 0, bx - nx, by - ny, 0, ax + nx, ay + ny, 0, bx - nx, by - ny, 0, bx + nx, by + ny, 0);
      }
      from = to;
    }
    way += length;
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(positions), 3));
  return geometry;
}

/** The track that a vehicle leaves. */
class Trail {
  static readonly #POINTS = 3000;
  readonly line: Line<BufferGeometry, LineBasicMaterial>;
  readonly #positions = new BufferAttribute(new Float32Array(3 * Trail.#POINTS), 3);

  constructor() {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", this.#positions);
    this.line = new Line(geometry, new LineBasicMaterial());
    this.line.frustumCulled = false;
  }

  show(point: (share: number) => [number, number], count: number): void {
    const points = Math.min(Trail.#POINTS, count);
    for (let i = 0; i < points; i++) {
      const [x, y] = point(points > 1 ? i / (points - 1) : 0);
      this.#positions.setXYZ(i, x, y, 0.02);
    }
    this.#positions.needsUpdate = true;
    this.line.geometry.setDrawRange(0, points);
  }
}

export class Ground {
  readonly root = new Group();
  readonly #grid: ShaderMaterial;
  readonly #shadow = new ShadowMaterial({ opacity: 0.28 });
  readonly #following = new Group();
  readonly #course = new Group();
  /** The tracks of the vehicle and of the vehicle beside it. */
  readonly trails = [new Trail(), new Trail()] as const;

  constructor() {
    this.#grid = new ShaderMaterial({
      vertexShader: vertex,
      fragmentShader: fragment,
      uniforms: { ground: { value: new Color() }, line: { value: new Color() }, far: { value: new Color() }, middle: { value: [0, 0] } },
    });
    const plane = new PlaneGeometry(SIZE, SIZE);
    const grid = new Mesh(plane, this.#grid);
    grid.renderOrder = -2;
    const shade = new Mesh(plane, this.#shadow);
    shade.receiveShadow = true;
    shade.position.z = 0.004;
    shade.renderOrder = -1;
    this.#following.add(grid, shade);
    this.root.add(this.#following, this.#course, ...this.trails.map(({ line }) => line));
  }

  /** Reads the colors of the page's style. */
  recolor(): void {
    for (const [name, of] of Object.entries(COLORS)) (this.#grid.uniforms[name]!.value as Color).set(color(of));
    this.trails[0].line.material.color.set(color("own"));
    this.trails[1].line.material.color.set(color("twin"));
  }

  open(opened: Opened): void {
    for (const child of [...this.#course.children]) {
      child.removeFromParent();
      if (child instanceof Mesh) {
        (child.geometry as BufferGeometry).dispose();
        (child.material as MeshBasicMaterial).dispose();
      }
    }
    if (opened.path.length > 1) {
      const path = new Mesh(ribbon(opened.path, 0.16, 2), new MeshBasicMaterial({ color: color("path"), side: DoubleSide }));
      path.position.z = 0.012;
      this.#course.add(path);
    }
    if (opened.cones.length > 0) {
      const cone = new ConeGeometry(0.17, CONE_HEIGHT, 18).rotateX(Math.PI / 2).translate(0, 0, CONE_HEIGHT / 2);
      const cones = new InstancedMesh(cone, new MeshStandardMaterial({ color: 0xe8722a, roughness: 0.7 }), 2 * CONES * opened.cones.length);
      const matrix = new Matrix4();
      opened.cones.forEach(([begin, end, right, left], section) => {
        for (let i = 0; i < CONES; i++) {
          const x = begin + ((end - begin) * i) / (CONES - 1);
          cones.setMatrixAt(2 * (CONES * section + i), matrix.makeTranslation(x, right, 0));
          cones.setMatrixAt(2 * (CONES * section + i) + 1, matrix.makeTranslation(x, left, 0));
        }
      });
      cones.frustumCulled = false;
      cones.castShadow = true;
      this.#course.add(cones);
    }
    for (const trail of this.trails) trail.show(() => [0, 0], 0);
  }

  /** Moves the ground with the vehicle, so it appears endless. */
  follow(x: number, y: number): void {
    this.#following.position.set(x, y, 0);
    this.#grid.uniforms["middle"]!.value = [x, y];
  }
}
