/** Play, pause, rate, and the slider of time. */

import { button, element } from "../../../src/dom";
import { field, fill } from "../dom";
import type { Model } from "../model";

const RATES = [0.1, 0.25, 0.5, 1, 2, 5, 20];

export class Transport {
  readonly #play: HTMLButtonElement;
  readonly #slider = element("input", { type: "range", min: "0", step: "any", value: "0", className: "time", "aria-label": "Time; moving it back rewinds the simulation" });
  readonly #text = element("output", { className: "clock" });
  #shown = "";
  #isDragged = false;

  constructor(
    readonly model: Model,
    root: HTMLElement,
    readonly restart: () => void,
  ) {
    this.#play = button("Play", () => (model.playing ? model.pause() : void model.play()));
    Object.assign(this.#play, { className: "primary", disabled: true });
    const rate = element("select", { onchange: () => model.setRate(Number(rate.value)) });
    fill(rate, [...RATES.map((rate) => ({ value: String(rate), title: `${rate}×` })), { value: "Infinity", title: "As fast as possible" }], "1");
    this.#slider.oninput = () => {
      this.#isDragged = true;
      model.scrub(this.#slider.valueAsNumber);
    };
    this.#slider.onchange = () => (this.#isDragged = false);
    this.#slider.onkeydown = (event) => this.#key(event);
    root.append(this.#play, button("Restart", restart), element("div", { className: "timeline" }, this.#slider, this.#text), field("Speed", rate));
    model.on("opened", () => {
      this.#play.disabled = false;
      this.#shown = "";
    });
  }

  /** Moves the time by keyboard in steps of 0.1 s or 1 s, because the slider itself has no steps (`step="any"`). */
  #key(event: KeyboardEvent): void {
    const steps: Record<string, number> = { ArrowLeft: -0.1, ArrowDown: -0.1, ArrowRight: 0.1, ArrowUp: 0.1, PageDown: -1, PageUp: 1, Home: -Infinity, End: Infinity };
    const step = steps[event.key];
    if (step === undefined) return;
    event.preventDefault();
    this.model.scrub(this.model.time + step);
  }

  frame(): void {
    const { opened, time, playing, isFinished } = this.model;
    if (opened === null) return;
    const shown = `${time.toFixed(2)} ${playing} ${opened.stop} ${this.model.end.toFixed(1)}`;
    if (shown === this.#shown) return;
    this.#shown = shown;
    const title = playing ? "Pause" : isFinished ? "Replay" : "Play";
    if (this.#play.textContent !== title) this.#play.textContent = title;
    // The end of a free drive is far away, so the slider's range grows with the simulated time.
    const length = Math.min(opened.stop, Math.max(20, 1.25 * this.model.end));
    this.#slider.max = String(opened.stop <= 60 ? opened.stop : length);
    if (!this.#isDragged) this.#slider.value = String(time);
    this.#slider.style.setProperty("--done", `${(100 * this.model.end) / Number(this.#slider.max)}%`);
    this.#slider.setAttribute("aria-valuetext", `${time.toFixed(1)} seconds`);
    this.#text.textContent = `${time.toFixed(2)} s`;
  }
}
