/** The view with its controls, numbers and legend. */

import { button, element } from "../../src/dom";
import { text } from "../../src/format";
import { byId, field, fill, unitText } from "./dom";
import type { Model } from "./model";
import { check } from "./panels/controls";
import { CAMERAS, type Camera, View } from "./scene/view";
import { shapeOf } from "./shape";
import type { Traces } from "./traces";

/** Numbers in front of the view, each with its possible signals and its title. */
const NUMBERS: [signals: string[], title: string][] = [
  [["vehicle.speed", "driver.speed"], "speed"],
  [["vehicle.lateral_acceleration"], "lateral"],
  [["body.roll"], "roll"],
  [["vehicle.load_transfer_ratio"], "load transfer"],
];
const FACTORS = [1, 2, 3, 5];
/** Time between two drawings while the simulation runs as fast as possible, s. */
const FAST_PERIOD = 0.15;

export class Stage {
  readonly #view: View | null;
  readonly #cover = byId("cover");
  readonly #hud = byId("hud");
  readonly #legend = byId("legend");
  readonly #beside = element("select");
  #besideKey = "";
  #hudText = "";
  #seconds = 0;

  constructor(
    readonly model: Model,
    readonly traces: Traces,
    /** Called when the comparison in the view changes. */
    readonly onBeside: () => void,
  ) {
    let view: View | null = null;
    try {
      view = new View(byId<HTMLCanvasElement>("canvas"));
    } catch {
      this.#cover.textContent = "This browser does not support WebGL, so the vehicle cannot be shown. The simulation, the plots and the metrics work without it.";
      byId("view").classList.add("is-missing");
    }
    this.#view = view;
    if (view !== null) this.#addTools(view);
    model.on("opened", () => this.#open());
    model.on("branch", () => this.#listBeside());
  }

  #addTools(view: View): void {
    const camera = element("select", { onchange: () => view.setCamera(camera.value as Camera) });
    fill(camera, Object.entries(CAMERAS).map(([value, { title }]) => ({ value, title })), "chase");
    const scale = () => {
      view.factor = Number(motion.value);
      this.#hudText = "";
    };
    const motion = element("select", { onchange: scale });
    fill(motion, FACTORS.map((factor) => ({ value: String(factor), title: factor === 1 ? "As it is" : `${factor}× larger` })), "1");
    this.#beside.onchange = () => {
      this.traces.beside = this.#beside.value;
      this.#showBeside();
      this.onBeside();
    };
    const zoom = [button("+", () => view.zoom(1 / 1.2), "Nearer"), button("−", () => view.zoom(1.2), "Farther away")];
    byId("view-tools").append(
      field("Camera", camera),
      element("div", { className: "zoom row" }, ...zoom),
      field("Beside it", this.#beside),
      field("Body motion", motion),
      element(
        "div",
        { className: "checks" },
        check("Tire forces", true, (isOn) => {
          view.showsArrows = isOn;
          this.#showLegend();
        }),
        check("Open body", false, (isOn) => (view.isOpenBody = isOn)),
      ),
    );
  }

  #open(): void {
    const { opened, recordings } = this.model;
    if (opened === null || recordings[0] === undefined) return;
    this.#hudText = "";
    this.#besideKey = "";
    if (this.#view === null) return;
    this.#cover.hidden = true;
    this.#view.open(opened);
    const vehicle = this.model.vehicle(recordings[0].info.vehicle);
    if (vehicle !== undefined) this.#view.setVehicle(recordings[0], shapeOf(vehicle));
    this.#listBeside();
  }

  #listBeside(): void {
    const options = this.traces.all.filter(({ isOwn }) => !isOwn).map(({ key, title }) => ({ value: key, title }));
    if (!options.some(({ value }) => value === this.traces.beside)) this.traces.beside = options[0]?.value ?? "";
    fill(this.#beside, [...options, { value: "", title: "Nothing" }], this.traces.beside);
    this.#showBeside();
  }

  #showBeside(): void {
    const trace = this.traces.besideTrace;
    const recording = trace === null ? null : (this.model.recordings[trace.system] ?? null);
    const key = trace === null ? "" : `${trace.key} ${trace.system}`;
    if (key !== this.#besideKey || trace === null) {
      const vehicle = recording === null ? undefined : this.model.vehicle(recording.info.vehicle);
      this.#view?.setOther(recording, vehicle === undefined ? null : shapeOf(vehicle));
      this.#besideKey = key;
    }
    this.#view?.redraw();
    this.#showLegend();
  }

  #showLegend(): void {
    const entry = (className: string, title: string) => element("span", {}, element("i", { className }), title);
    const trace = this.traces.besideTrace;
    const entries: HTMLElement[] = [];
    if (trace !== null) entries.push(entry("ghost", `transparent: ${trace.title}`));
    const columns = this.model.recordings[0];
    const has = (group: string) => columns?.info.columns.some(({ name }) => name.includes(`${group}.`)) ?? false;
    if (this.#view?.showsArrows === true) {
      if (has("tire_load")) entries.push(entry("force load", "tire load"));
      if (has("tire_lateral_force")) entries.push(entry("force lateral", "lateral"));
      if (has("tire_longitudinal_force")) entries.push(entry("force longitudinal", "longitudinal"));
    }
    this.#legend.replaceChildren(...entries);
  }

  #showNumbers(): void {
    const recording = this.model.recordings[0];
    if (recording === undefined) return;
    const values = NUMBERS.flatMap(([signals, title]) => {
      const column = recording.column(...signals);
      const value = recording.at(this.model.branch, column, this.model.time);
      const display = recording.info.columns[column]?.display;
      if (display === undefined || Number.isNaN(value)) return [];
      // A fixed number of digits keeps the text from jumping.
      const number = (value * display.factor).toFixed(Math.abs(display.factor) > 3 ? 1 : 2).replace(/^-(0\.?0*)$/, "$1").replace("-", "−");
      return [[title, number, unitText(display.unit)] as const];
    });
    const written = JSON.stringify(values);
    if (written === this.#hudText) return;
    this.#hudText = written;
    this.#hud.replaceChildren(...values.map(([title, number, unit]) => element("div", {}, element("b", { textContent: number }), element("small", { textContent: unit === "" ? title : `${unit} ${title}` }))));
    const sentence = values.map(([title, number, unit]) => `${title} ${number} ${unit}`).join(", ");
    const factor = this.#view?.factor ?? 1;
    byId("canvas").setAttribute("aria-label", `The vehicle at ${text(Number(this.model.time.toFixed(1)), 4)} s: ${sentence}${factor > 1 ? `; motion shown ${factor} times larger` : ""}`);
  }

  frame(seconds: number): void {
    const { model } = this;
    if (model.opened === null) return;
    this.#seconds += seconds;
    // At the highest rate, the simulation needs the processor, so frames are drawn rarely.
    const isFast = model.playing && model.rate === Infinity;
    if (isFast && this.#seconds < FAST_PERIOD) return;
    const other = this.traces.besideTrace?.branch ?? model.branch;
    this.#view?.draw(model.time, model.branch, other, this.#seconds, model.playing && !isFast);
    this.#seconds = 0;
    this.#showNumbers();
  }
}
