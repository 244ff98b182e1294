/** The view: renderer, light, camera, the vehicle and its comparison. */

import { DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { color } from "../../../src/dom";
import { darkMode, reducedMotion } from "../dom";
import type { Opened } from "../protocol";
import type { Recording } from "../recording";
import type { Shape } from "../shape";
import { Arrows } from "./arrows";
import { Ground } from "./ground";
import { PoseReader } from "./pose";
import { VehicleModel } from "./vehicle";

/** Camera positions relative to the vehicle, in the vehicle's frame, in vehicle lengths. */
export const CAMERAS = {
  chase: { title: "Behind", offset: [-1.75, 0.75, 0.52] },
  rear: { title: "Rear", offset: [-2, 0, 0.2] },
  front: { title: "Front", offset: [1.75, -0.9, 0.42] },
  side: { title: "Side", offset: [0, -1.9, 0.26] },
  above: { title: "Above", offset: [-0.02, 0, 3.6] },
} as const;
export type Camera = keyof typeof CAMERAS;

/** Time constant of the camera's rotation with the vehicle, s. */
const TURN_TIME = 0.6;
/** Minimum time between two drawings of the tracks, ms. */
const TRAIL_PERIOD = 200;

/** Quality levels, best first: maximum pixel ratio, and whether there are shadows. */
const QUALITY = [
  { pixels: 2, shadows: true },
  { pixels: 1, shadows: true },
  { pixels: 0.75, shadows: false },
] as const;
/** If the mean duration of FRAMES frames exceeds this, s, the quality is lowered. */
const SLOW_FRAME = 0.055;
const FRAMES = 20;

interface Subject {
  model: VehicleModel;
  reader: PoseReader;
}

export class View {
  readonly #renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera(36, 16 / 9, 0.3, 600);
  readonly #controls: OrbitControls;
  readonly #light = new DirectionalLight(0xffffff, 2.1);
  readonly #sky = new HemisphereLight(0xffffff, 0x9aa3ad, 1.5);
  /** Light from the camera, which keeps visible sides from being black. */
  readonly #fill = new DirectionalLight(0xffffff, 0.8);
  readonly #ground = new Ground();
  #own: Subject | null = null;
  #other: Subject | null = null;
  #arrows: Arrows | null = null;
  #heading: number | null = null;
  #kind: Camera = "chase";
  #trailAt = 0;
  /** Whether something has changed since the last drawing. */
  #isStale = true;
  #last = "";
  /** Magnification of the motion of body and wheels. */
  factor = 1;
  #quality = 0;
  #frames = 0;
  #seconds = 0;
  showsArrows = true;
  #isOpenBody = false;
  /** Objects whose shaders are being compiled; nothing is drawn until then. */
  #compiling = 0;

  /** Throws without WebGL. */
  constructor(readonly canvas: HTMLCanvasElement) {
    this.#renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.#renderer.shadowMap.enabled = true;
    // Checking for shader errors would wait for the compiler.
    this.#renderer.debug.checkShaderErrors = false;
    this.#camera.up.set(0, 0, 1);
    this.#light.castShadow = true;
    this.#light.shadow.mapSize.set(1024, 1024);
    Object.assign(this.#light.shadow.camera, { left: -8, right: 8, top: 8, bottom: -8, near: 1, far: 40 });
    this.#light.shadow.radius = 6;
    this.#scene.add(this.#ground.root, this.#light, this.#light.target, this.#sky, this.#fill, this.#fill.target);
    this.#controls = new OrbitControls(this.#camera, canvas);
    this.#controls.enablePan = false;
    // The mouse wheel scrolls the page.
    this.#controls.enableZoom = false;
    this.#controls.maxPolarAngle = 0.495 * Math.PI;
    this.#controls.addEventListener("change", () => (this.#isStale = true));
    canvas.style.touchAction = "pan-y";
    new ResizeObserver(() => this.#resize()).observe(canvas.parentElement!);
    darkMode.addEventListener("change", () => this.#recolor());
    this.#recolor();
    this.#resize();
  }

  #recolor(): void {
    this.#renderer.setClearColor(color("sky"));
    this.#ground.recolor();
    this.#light.intensity = darkMode.matches ? 1.5 : 1.8;
    this.#sky.intensity = darkMode.matches ? 1.0 : 1.6;
    this.#fill.intensity = darkMode.matches ? 0.8 : 1.1;
    this.redraw();
  }

  #resize(): void {
    const { clientWidth, clientHeight } = this.canvas.parentElement!;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.#renderer.setPixelRatio(Math.min(devicePixelRatio, QUALITY[this.#quality]!.pixels));
    this.#renderer.setSize(clientWidth, clientHeight, false);
    this.#camera.aspect = clientWidth / clientHeight;
    // In a narrow view, the camera has a wider angle, to show the whole vehicle.
    this.#camera.fov = this.#camera.aspect > 1.4 ? 36 : 46;
    this.#camera.updateProjectionMatrix();
    this.#isStale = true;
  }

  /** Requests a new drawing, even if the time does not change. */
  redraw(): void {
    this.#last = "";
    this.#isStale = true;
  }

  open(opened: Opened): void {
    this.#ground.open(opened);
    this.#heading = null;
    this.redraw();
  }

  setVehicle(recording: Recording, shape: Shape): void {
    this.#own?.model.dispose();
    this.#arrows?.dispose();
    const model = new VehicleModel(shape, false, "");
    model.isOpen = this.#isOpenBody;
    this.#arrows = new Arrows(shape);
    this.#scene.add(model.root, this.#arrows.root);
    this.#own = { model, reader: new PoseReader(recording, shape) };
    this.setCamera(this.#kind);
    this.#compile();
  }

  /** Shows another run for comparison; `null` removes it. */
  setOther(recording: Recording | null, shape: Shape | null): void {
    this.#other?.model.dispose();
    this.#other = null;
    if (recording !== null && shape !== null) {
      const model = new VehicleModel(shape, true, color("twin"));
      this.#scene.add(model.root);
      this.#other = { model, reader: new PoseReader(recording, shape) };
      this.#compile();
    }
    this.redraw();
  }

  /** Compiles shaders in the background. Otherwise the page would block when it draws. */
  #compile(): void {
    this.#compiling += 1;
    const end = () => {
      this.#compiling -= 1;
      this.redraw();
    };
    this.#renderer.compileAsync(this.#scene, this.#camera).then(end, end);
  }

  set isOpenBody(open: boolean) {
    this.#isOpenBody = open;
    if (this.#own !== null) this.#own.model.isOpen = open;
    this.redraw();
  }

  setCamera(kind: Camera): void {
    this.#kind = kind;
    const shape = this.#own?.model.shape;
    const length = shape === undefined ? 7 : shape.front - shape.rear + (shape.kind === "car" ? 1.7 : 2.8);
    const offset = new Vector3(...CAMERAS[kind].offset).multiplyScalar(length);
    offset.applyAxisAngle(this.#camera.up, this.#heading ?? 0);
    this.#camera.position.copy(this.#controls.target).add(offset);
    this.#controls.update();
    this.redraw();
  }

  zoom(factor: number): void {
    const offset = this.#camera.position.clone().sub(this.#controls.target);
    const distance = Math.min(80, Math.max(3, offset.length() * factor));
    this.#camera.position.copy(this.#controls.target).add(offset.setLength(distance));
    this.redraw();
  }

  /** Draws the vehicles at a time, each on its branch. `adapts`: whether slow frames lower the quality. */
  draw(time: number, branch: number, otherBranch: number, seconds: number, adapts: boolean): void {
    const own = this.#own;
    if (own === null || this.#compiling > 0) return;
    const key = `${time} ${branch} ${otherBranch} ${this.factor} ${this.showsArrows}`;
    if (key === this.#last && !this.#isStale) return;
    this.#last = key;
    const pose = own.reader.read(branch, time);
    own.model.show(pose, this.factor);
    if (this.#arrows !== null) {
      this.#arrows.root.visible = this.showsArrows;
      this.#arrows.show(pose);
    }
    this.#other?.model.show(this.#other.reader.read(otherBranch, time), this.factor);
    this.#follow(pose.x, pose.y, pose.yaw, seconds, own.model.shape);
    this.#drawTrails(time, branch, otherBranch);
    this.#renderer.render(this.#scene, this.#camera);
    this.#isStale = this.#isTurning(pose.yaw);
    if (adapts) this.#adapt(seconds);
  }

  #adapt(seconds: number): void {
    this.#frames += 1;
    this.#seconds += seconds;
    if (this.#frames < FRAMES) return;
    const isSlow = this.#seconds > FRAMES * SLOW_FRAME;
    this.#frames = this.#seconds = 0;
    if (!isSlow || this.#quality === QUALITY.length - 1) return;
    this.#quality += 1;
    this.#light.castShadow = QUALITY[this.#quality]!.shadows;
    this.#resize();
  }

  #isTurning(yaw: number): boolean {
    return !reducedMotion.matches && this.#heading !== null && Math.abs(yaw - this.#heading) > 1e-3;
  }

  #follow(x: number, y: number, yaw: number, seconds: number, shape: Shape): void {
    const target = new Vector3(x + ((shape.front + shape.rear) / 2) * Math.cos(yaw), y + ((shape.front + shape.rear) / 2) * Math.sin(yaw), shape.kind === "car" ? 0.6 : 1.15);
    const offset = this.#camera.position.clone().sub(this.#controls.target);
    if (this.#heading === null) {
      offset.applyAxisAngle(this.#camera.up, yaw);
      this.#heading = yaw;
    } else if (!reducedMotion.matches) {
      const turn = (yaw - this.#heading) * (1 - Math.exp(-seconds / TURN_TIME));
      offset.applyAxisAngle(this.#camera.up, turn);
      this.#heading += turn;
    }
    this.#controls.target.copy(target);
    this.#camera.position.copy(target).add(offset);
    this.#camera.lookAt(target);
    this.#ground.follow(x, y);
    this.#light.target.position.copy(target);
    this.#light.position.copy(target).add(new Vector3(-4, 5, 17));
    this.#fill.target.position.copy(target);
    this.#fill.position.copy(this.#camera.position);
  }

  #drawTrails(time: number, branch: number, otherBranch: number): void {
    const now = performance.now();
    if (now < this.#trailAt + TRAIL_PERIOD && !this.#isStale) return;
    this.#trailAt = now;
    const draw = (trail: Ground["trails"][number], subject: Subject | null, branch: number) => {
      if (subject === null) return trail.show(() => [0, 0], 0);
      const { recording } = subject.reader;
      const [x, y] = [recording.column("vehicle.position_x"), recording.column("vehicle.position_y")];
      const count = x < 0 || y < 0 ? 0 : Math.ceil(time / Math.max(0.05, recording.rowStep));
      trail.show((share) => [recording.at(branch, x, share * time), recording.at(branch, y, share * time)], count);
    };
    draw(this.#ground.trails[0], this.#own, branch);
    draw(this.#ground.trails[1], this.#other, otherBranch);
  }
}
