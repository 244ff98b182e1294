/** Plots of signals over time that grow while the simulation runs. */

import uPlot from "uplot";
import { button, color, element } from "../../src/dom";
import { text } from "../../src/format";
import { lineKey } from "../../src/panel";
import { darkMode, fill, unitText } from "./dom";
import type { Model } from "./model";
import { check } from "./panels/controls";
import type { Column } from "./protocol";
import type { Trace, Traces } from "./traces";

const HEIGHT = 190;
/** Maximum number of points in a line; if there are more rows, some rows are skipped. */
const POINTS = 1600;
/** Longest time span that is shown, s. If a run is longer, the plots show its last part. */
const WINDOW = 40;
/** Minimum time between two drawings, ms. */
const PERIOD = 90;
const CURSOR = "lab";
const PREFERRED = ["body.roll", "vehicle.lateral_acceleration", "vehicle.yaw_rate", "vehicle.load_transfer_ratio", "vehicle.speed", "vehicle.sideslip", "body.heave", "body.pitch"];

/** Branches are dashed. */
const dashesOf = (trace: Trace): number[] => (trace.isOwn || trace.key === "twin" ? [] : [5, 3]);

class LivePlot {
  readonly element = element("div", { className: "plot" });
  readonly #select = element("select");
  readonly #description = element("span", { className: "plot-note" });
  readonly #readout = element("p", { className: "plot-readout" });
  readonly #body = element("div", { className: "plot-body", role: "img" });
  readonly #now = element("div", { className: "now", hidden: true });
  #plot: uPlot | null = null;
  /** The visitor's own run is the last trace, so it is drawn on top. */
  #traces: Trace[] = [];
  #numbers: HTMLElement[] = [];
  #range: [number, number] = [0, 1];

  constructor(
    readonly model: Model,
    readonly traces: Traces,
    number: number,
    public signal: string,
    onRemove: () => void,
  ) {
    this.#select.setAttribute("aria-label", `Signal of plot ${number}`);
    this.#select.onchange = () => {
      this.signal = this.#select.value;
      this.rebuild();
    };
    const remove = button("×", onRemove, `Remove plot ${number}`);
    remove.className = "plain";
    this.element.append(element("div", { className: "plot-head" }, this.#select, remove), this.#description, this.#readout, this.#body);
    new ResizeObserver(() => this.#resize()).observe(this.#body);
  }

  get #column(): Column | undefined {
    const columns = this.model.opened?.systems.flatMap((system) => system.columns) ?? [];
    return columns.find(({ name }) => name === this.signal);
  }

  setSignals(columns: Column[]): void {
    const group = (name: string) => name.replace(/^.*:/, "").split(".")[0]!.replaceAll("_", " ");
    fill(this.#select, columns.map(({ name }) => ({ value: name, title: name, group: group(name) })), this.signal);
  }

  /** Makes a new plot. This is necessary if the signal, the lines or the theme change. */
  rebuild(): void {
    const column = this.#column;
    const width = this.#body.clientWidth;
    this.#plot?.destroy();
    this.#plot = null;
    this.#description.textContent = this.#description.title = column?.description ?? "";
    this.#body.setAttribute("aria-label", `${this.signal} over time`);
    if (column === undefined || width === 0) return;
    this.#traces = this.traces.shown.slice().reverse();
    const unit = unitText(column.display.unit);
    this.#writeKeys(unit);
    // Colors are read once, because reading one computes the style of the page.
    const [muted, grid] = [color("muted"), color("grid")];
    const font = `11px ${getComputedStyle(document.body).fontFamily}`;
    const axis = { stroke: muted, grid: { stroke: grid, width: 1 }, ticks: { show: false }, font };
    this.#plot = new uPlot(
      {
        width,
        height: HEIGHT,
        legend: { show: false },
        padding: [8, 20, 0, 0],
        scales: { x: { time: false, range: () => this.#range }, y: { range: (_, low, high) => this.#room(low, high) } },
        series: [
          {},
          ...this.#traces.map((trace) => ({
            stroke: color(trace.color),
            width: trace.isOwn ? 1.8 : 1,
            dash: dashesOf(trace),
            points: { show: false },
          })),
        ],
        axes: [
          { ...axis, size: 24, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : `${text(tick, 6)} s`)) },
          { ...axis, size: 50, label: unit, labelSize: unit === "" ? 0 : 14, labelFont: font, labelGap: 0, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : text(tick, 5))) },
        ],
        cursor: { sync: { key: CURSOR, setSeries: false }, drag: { x: false, y: false }, points: { size: 6 }, y: false },
        hooks: { setCursor: [() => this.read()] },
      },
      [[0], ...this.#traces.map(() => [null])] as uPlot.AlignedData,
      this.#body,
    );
    this.#plot.over.append(this.#now);
    this.#plot.over.addEventListener("click", () => {
      const left = this.#plot?.cursor.left ?? -1;
      if (left >= 0) this.model.scrub(this.#plot!.posToVal(left, "x"));
    });
    this.update();
  }

  #room(low: number | null, high: number | null): [number, number] {
    const [bottom, top] = [low ?? 0, high ?? 0];
    const size = Math.max(Math.abs(bottom), Math.abs(top));
    // A constant value gets a range around it that is wide enough to hide rounding errors.
    const room = top - bottom > 1e-6 * size && size > 1e-9 ? 0.08 * (top - bottom) : size > 1e-9 ? 0.05 * size : 1;
    return [bottom - room, top + room];
  }

  #resize(): void {
    const width = this.#body.clientWidth;
    if (width === 0) return;
    if (this.#plot === null) this.rebuild();
    else if (this.#plot.width !== width) this.#plot.setSize({ width, height: HEIGHT });
    this.mark();
  }

  update(): void {
    const { opened, recordings } = this.model;
    const plot = this.#plot;
    const column = this.#column;
    if (plot === null || opened === null || column === undefined) return;
    const ends = this.#traces.map(({ system, branch }) => recordings[system]?.end(branch) ?? 0);
    const end = Math.max(0, ...ends);
    const whole = Math.min(opened.stop, Math.max(end, opened.stop <= WINDOW ? opened.stop : 10));
    const to = whole <= WINDOW ? whole : Math.max(WINDOW, Math.min(this.model.time + 0.1 * WINDOW, whole));
    this.#range = [Math.max(0, to - WINDOW), to];
    const step = opened.rowStep;
    const [first, last] = [Math.floor(this.#range[0] / step), Math.min(Math.ceil(this.#range[1] / step), Math.round(end / step))];
    const stride = Math.max(1, Math.ceil((last - first + 1) / POINTS));
    // Each drawing uses the same rows, so the line does not change its shape when it grows.
    const begin = first - (first % stride);
    const times: number[] = [];
    for (let index = begin; index <= last; index += stride) times.push(index * step);
    const values = this.#traces.map(({ system, branch }) => {
      const recording = recordings[system];
      return recording === undefined ? times.map(() => null) : recording.values(branch, recording.column(this.signal), begin, last, stride, column.display.factor);
    });
    plot.setData([times, ...values] as uPlot.AlignedData);
    this.mark();
    this.read();
  }

  mark(): void {
    const plot = this.#plot;
    if (plot === null) return;
    const left = plot.valToPos(this.model.time, "x");
    // Avoids layout properties, which would make the browser compute the layout for each plot.
    this.#now.hidden = !(left >= 0 && left <= plot.bbox.width / devicePixelRatio);
    this.#now.style.transform = `translateX(${left}px)`;
  }

  /** Writes the values at the cursor, or at the time shown. */
  read(): void {
    const column = this.#column;
    const plot = this.#plot;
    const { opened, recordings } = this.model;
    if (column === undefined || plot === null || opened === null) return;
    const left = plot.cursor.left ?? -1;
    const time = left >= 0 ? plot.posToVal(left, "x") : this.model.time;
    this.#traces.forEach((trace, i) => {
      const recording = recordings[trace.system];
      const index = Math.round(time / opened.rowStep);
      const value = recording?.values(trace.branch, recording.column(this.signal), index, index, 1, column.display.factor)[0] ?? null;
      const written = value === null ? "–" : text(value, 4);
      const number = this.#numbers[i]!;
      if (number.textContent !== written) number.textContent = written;
    });
  }

  /** Writes the legend with the numbers. */
  #writeKeys(unit: string): void {
    this.#numbers = this.#traces.map(() => element("b"));
    const entries = this.#traces.map((trace, i) => {
      return element("span", { title: trace.title }, lineKey(`var(--${trace.color})`, dashesOf(trace)), this.#numbers[i]!);
    });
    this.#readout.replaceChildren(...entries.reverse(), element("span", { textContent: unit }));
  }

  dispose(): void {
    this.#plot?.destroy();
    this.element.remove();
  }
}

export class Plots {
  #plots: LivePlot[] = [];
  #number = 0;
  #drawn = 0;
  #isStale = false;

  constructor(
    readonly model: Model,
    readonly traces: Traces,
    readonly root: HTMLElement,
    tools: HTMLElement,
    readonly switches: HTMLElement,
  ) {
    tools.append(button("Add a plot", () => this.#add(this.#unused())));
    model.on("opened", () => this.#open());
    model.on("rows", () => (this.#isStale = true));
    model.on("branch", () => this.retrace());
    model.on("clock", () => (this.#isStale = true));
    darkMode.addEventListener("change", () => this.retrace());
  }

  get #columns(): Column[] {
    const found = new Map<string, Column>();
    for (const system of this.model.opened?.systems ?? []) for (const column of system.columns) if (!found.has(column.name)) found.set(column.name, column);
    return [...found.values()];
  }

  #unused(): string {
    const names = this.#columns.map(({ name }) => name);
    const used = this.#plots.map(({ signal }) => signal);
    return [...PREFERRED.filter((name) => names.includes(name)), ...names].find((name) => !used.includes(name)) ?? names[0] ?? "";
  }

  #add(signal: string): void {
    const plot: LivePlot = new LivePlot(this.model, this.traces, ++this.#number, signal, () => {
      plot.dispose();
      this.#plots = this.#plots.filter((one) => one !== plot);
      (this.#plots[0]?.element.querySelector("select") ?? this.root.closest("section")?.querySelector<HTMLElement>("button"))?.focus();
    });
    this.#plots.push(plot);
    this.root.append(plot.element);
    plot.setSignals(this.#columns);
    plot.rebuild();
  }

  /** Keeps the chosen signals that the new system has. */
  #open(): void {
    const columns = this.#columns;
    const names = columns.map(({ name }) => name);
    if (this.#plots.length === 0) {
      for (const signal of [...PREFERRED.filter((name) => names.includes(name)), ...names].slice(0, 4)) this.#add(signal);
    }
    for (const plot of this.#plots) {
      if (!names.includes(plot.signal)) plot.signal = this.#unused();
      plot.setSignals(columns);
    }
    this.retrace();
  }

  /** Makes new plots after the lines have changed. */
  retrace(): void {
    const boxes = this.traces.all.map((trace) => {
      const box = check(trace.title, !this.traces.hidden.has(trace.key), (isOn) => {
        if (isOn) this.traces.hidden.delete(trace.key);
        else this.traces.hidden.add(trace.key);
        for (const plot of this.#plots) plot.rebuild();
      });
      box.lastElementChild!.before(lineKey(`var(--${trace.color})`, dashesOf(trace)));
      return box;
    });
    this.switches.replaceChildren(...boxes);
    for (const plot of this.#plots) plot.rebuild();
  }

  frame(now: number): void {
    if (this.#isStale && now > this.#drawn + PERIOD) {
      this.#isStale = false;
      this.#drawn = now;
      for (const plot of this.#plots) plot.update();
    } else if (this.model.playing) for (const plot of this.#plots) plot.mark();
  }
}
