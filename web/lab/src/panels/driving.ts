/** Driving with arrow keys, a gamepad, or sliders. */

import { button, element } from "../../../src/dom";
import { isControl, note } from "../dom";
import type { Model } from "../model";
import type { Driving } from "../protocol";

/** Time from straight ahead to full lock, and from full lock to straight ahead, s. */
const STEER_TIME = 0.9;
const RETURN_TIME = 0.5;
/** Time from a released to a fully pressed pedal, s. */
const PEDAL_TIME = 0.35;
/** Smallest change that is sent to the worker. */
const CHANGE = 1e-3;
/** Dead zone of a gamepad's sticks, as a share of their range. */
const DEAD_ZONE = 0.08;

const KEYS: Record<string, "left" | "right" | "throttle" | "brake"> = {
  ArrowLeft: "left", a: "left", ArrowRight: "right", d: "right", ArrowUp: "throttle", w: "throttle", ArrowDown: "brake", s: "brake",
};

function towards(value: number, wanted: number, step: number): number {
  return value < wanted ? Math.min(wanted, value + step) : Math.max(wanted, value - step);
}

export class DrivingPanel {
  readonly #pressed = new Set<string>();
  readonly #sliders: Record<keyof Driving, HTMLInputElement>;
  #driving: Driving = { steer: 0, throttle: 0, brake: 0 };
  #sent: Driving = { steer: 0, throttle: 0, brake: 0 };
  /** Whether keys or a gamepad control the vehicle. Otherwise the sliders keep their positions. */
  #hasKeys = false;
  #isActive = false;

  constructor(
    readonly model: Model,
    readonly root: HTMLElement,
  ) {
    const range = (title: string, min: number) => {
      const input = element("input", { type: "range", min: String(min), max: "1", step: "0.01", value: "0" });
      return [input, element("label", { className: "slider" }, element("span", {}, title), input)] as const;
    };
    const [steer, steerLabel] = range("Steering: right to left", -1);
    const [throttle, throttleLabel] = range("Accelerator", 0);
    const [brake, brakeLabel] = range("Brake", 0);
    // Moving the slider to the left steers to the left, which is the positive direction.
    steer.classList.add("mirrored");
    this.#sliders = { steer, throttle, brake };
    for (const [name, input] of Object.entries(this.#sliders) as [keyof Driving, HTMLInputElement][]) {
      input.oninput = () => {
        this.#hasKeys = false;
        this.#driving = { ...this.#driving, [name]: input.valueAsNumber };
      };
    }
    const center = button("Straight ahead, no pedal", () => {
      this.#hasKeys = false;
      this.#driving = { steer: 0, throttle: 0, brake: 0 };
    });
    root.append(
      element("h2", { id: "driving-title", textContent: "You drive" }),
      note("Arrow keys or W A S D, a gamepad, or these sliders."),
      element("div", { className: "driving-controls" }, steerLabel, throttleLabel, brakeLabel, center),
    );
    window.addEventListener("keydown", (event) => this.#key(event, true));
    window.addEventListener("keyup", (event) => this.#key(event, false));
    window.addEventListener("blur", () => this.#pressed.clear());
    model.on("opened", () => this.#open());
  }

  #open(): void {
    const { setup, catalog } = this.model;
    const system = setup?.system;
    this.#isActive = system?.kind === "free" && catalog?.maneuvers.find(({ id }) => id === system.maneuver)?.kind === "free";
    this.root.hidden = !this.#isActive;
    this.#driving = this.#sent = { steer: 0, throttle: 0, brake: 0 };
    this.#hasKeys = false;
    this.#show();
  }

  #key(event: KeyboardEvent, isDown: boolean): void {
    const action = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (action === undefined) return;
    if (!isDown) {
      this.#pressed.delete(action);
      return;
    }
    if (!this.#isActive || event.ctrlKey || event.metaKey || event.altKey) return;
    const { target } = event;
    // These keys have no effect on buttons, so they steer even if a button has the focus.
    if (isControl(target) && !(target instanceof HTMLButtonElement)) return;
    event.preventDefault();
    this.#pressed.add(action);
    this.#hasKeys = true;
  }

  /** The commands of a gamepad that is in use; `null` if there is none. */
  #gamepad(): Driving | null {
    for (const pad of navigator.getGamepads()) {
      if (pad === null || !pad.connected) continue;
      const axis = pad.axes[0] ?? 0;
      const driving = {
        steer: Math.abs(axis) < DEAD_ZONE ? 0 : -Math.sign(axis) * ((Math.abs(axis) - DEAD_ZONE) / (1 - DEAD_ZONE)) ** 1.5,
        throttle: pad.buttons[7]?.value ?? 0,
        brake: pad.buttons[6]?.value ?? 0,
      };
      if (Object.values(driving).some((value) => value !== 0)) return driving;
    }
    return null;
  }

  frame(seconds: number): void {
    if (!this.#isActive) return;
    const pad = this.#gamepad();
    if (pad !== null) {
      this.#driving = pad;
      this.#hasKeys = true;
    } else if (this.#hasKeys) {
      const has = (name: string) => (this.#pressed.has(name) ? 1 : 0);
      const wanted = has("left") - has("right");
      const { steer, throttle, brake } = this.#driving;
      const isReturning = wanted === 0 || Math.sign(wanted) !== Math.sign(steer);
      this.#driving = {
        steer: towards(steer, wanted, seconds / (isReturning ? RETURN_TIME : STEER_TIME)),
        throttle: towards(throttle, has("throttle"), seconds / PEDAL_TIME),
        brake: towards(brake, has("brake"), seconds / PEDAL_TIME),
      };
    }
    const hasChanged = (Object.keys(this.#driving) as (keyof Driving)[]).some((name) => Math.abs(this.#driving[name] - this.#sent[name]) > CHANGE);
    if (!hasChanged) return;
    this.#sent = { ...this.#driving };
    this.model.drive(this.#sent);
    this.#show();
  }

  #show(): void {
    for (const name of ["steer", "throttle", "brake"] as const) this.#sliders[name].value = String(this.#driving[name]);
  }
}
