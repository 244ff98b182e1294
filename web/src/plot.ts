/** One pair of axes: lines over a common abscissa, with a cursor, a readout, zoom and pan. */

import uPlot from "uplot";
import { digits, numbers } from "./data";
import { axisTitle, convert, revert, text } from "./format";
import type { Line, PageData, Panel } from "./page-data";
import { isReadable, samples } from "./recording";
import type { State } from "./state";

const DASHES = [[], [8, 4], [2, 4]];
const HEIGHT = 240;
const AXIS_WIDTH = 62;
/** In less than this share of the abscissa, lines are drawn from the recorded signals. */
const CLOSE = 0.5;
/** A line whose way up and down is longer than this many times its height is noise and drawn thin. */
const NOISY = 20;

type Values = (number | null)[];

interface Drawn {
  line: Line;
  x: Values;
  y: Values;
  spread: Values | null;
  digits: number;
  noisy: boolean;
  /** Whether all recorded samples are there, or cannot be had. */
  isFull: boolean;
  /** Number of its series in uPlot. */
  series: number;
}

function color(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

function isNoisy(values: Values): boolean {
  const known = values.filter((value) => value !== null);
  let way = 0;
  for (let i = 1; i < known.length; i++) way += Math.abs(known[i]! - known[i - 1]!);
  const range = known.reduce((m, v) => Math.max(m, v), -Infinity) - known.reduce((m, v) => Math.min(m, v), Infinity);
  return way > NOISY * range;
}

/** Index of the value that is nearest to a row and exists. */
function nearest(values: ArrayLike<number | null | undefined>, xs: ArrayLike<number>, row: number, x: number): number | null {
  const exists = (i: number) => values[i] !== null && values[i] !== undefined;
  let [low, high] = [row, row];
  while (low >= 0 && !exists(low)) low--;
  while (high < values.length && !exists(high)) high++;
  if (low < 0) return high < values.length ? high : null;
  if (high >= values.length) return low;
  return Math.abs(xs[low]! - x) <= Math.abs(xs[high]! - x) ? low : high;
}

export class Plot {
  readonly element = document.createElement("div");
  readonly #readout = document.createElement("p");
  readonly #body = document.createElement("div");
  readonly #lines: Drawn[];
  #plot: uPlot | null = null;
  #full: [number, number] = [0, 1];
  /** Told when the user zooms or pans; null: everything is to be shown. */
  onZoom: (range: [number, number] | null) => void = () => {};

  constructor(
    private readonly data: PageData,
    private readonly panel: Panel,
    private readonly state: State,
    words: Uint16Array,
  ) {
    this.#lines = panel.lines.map((line) => {
      const y = numbers(words, line.y);
      return {
        line,
        x: numbers(words, line.x),
        y,
        spread: line.spread === undefined ? null : numbers(words, line.spread),
        digits: digits(line.y),
        noisy: isNoisy(y),
        isFull: false,
        series: 0,
      };
    });
    this.element.className = "plot";
    const head = document.createElement("p");
    head.className = "plot-title";
    const title = document.createElement("b");
    title.textContent = panel.title;
    const note = document.createElement("span");
    note.textContent = panel.note;
    head.append(title, note);
    this.#readout.className = "plot-readout";
    this.#body.className = "plot-body";
    this.#body.tabIndex = 0;
    this.#body.setAttribute("role", "img");
    this.#body.setAttribute("aria-label", `${panel.title}${panel.note === "" ? "" : `, ${panel.note}`}: plot with a cursor. Arrow keys move the cursor, plus and minus zoom, Escape shows everything.`);
    this.#body.addEventListener("keydown", (event) => this.#key(event));
    this.element.append(head, this.#readout, this.#body);
    new ResizeObserver(() => this.#resize()).observe(this.#body);
    state.listen(() => this.#draw());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#draw());
  }

  get #xUnit() {
    return this.panel.x.units[0];
  }

  get #yUnit() {
    const units = this.panel.y.units;
    return (this.state.base ? units[1] : undefined) ?? units[0];
  }

  /** Shows a part of the abscissa; null: all of it. */
  zoom(range: [number, number] | null): void {
    const [min, max] = range ?? this.#full;
    this.#plot?.setScale("x", { min, max });
    this.element.dataset["zoomed"] = String(range !== null);
    this.element.dataset["range"] = `${min} ${max}`;
    if (isReadable && max - min <= CLOSE * (this.#full[1] - this.#full[0])) void this.#refine();
  }

  /** Replaces the samples of the page by all that were recorded. */
  async #refine(): Promise<void> {
    const coarse = this.#lines.filter((drawn) => !drawn.isFull && this.state.shows(drawn.line));
    const found = coarse.map(async (drawn) => {
      const { file, signal } = drawn.line;
      drawn.isFull = true;
      const all = file === undefined || signal === undefined ? null : await samples(file, signal);
      if (all === null) return false;
      [drawn.x, drawn.y, drawn.digits] = [all.times, all.values, 6];
      return true;
    });
    if (!(await Promise.all(found)).includes(true)) return;
    this.element.dataset["resolution"] = "full";
    this.#draw();
  }

  /** The part of the abscissa that is shown. */
  get range(): [number, number] {
    const x = this.#plot?.scales["x"];
    return [x?.min ?? this.#full[0], x?.max ?? this.#full[1]];
  }

  #resize(): void {
    const width = this.#body.clientWidth;
    if (width === 0) return;
    if (this.#plot === null) this.#draw();
    else if (this.#plot.width !== width) this.#plot.setSize({ width, height: HEIGHT });
  }

  #stroke(drawn: Drawn): string {
    const found = this.data.cases.find((one) => one.name === drawn.line.case);
    return found === undefined || drawn.line.kind === "reference" ? color("ink") : color(`series-${found.color}`);
  }

  #dash(drawn: Drawn): number[] {
    if (drawn.line.kind === "reference") return [3, 3];
    if (drawn.line.kind === "paper") return [5, 4];
    return DASHES[this.data.cases.find((one) => one.name === drawn.line.case)?.dash ?? 0] ?? [];
  }

  /** Draws everything anew: after a switch, in another theme. */
  #draw(): void {
    const width = this.#body.clientWidth;
    if (width === 0) return;
    const kept = this.element.dataset["zoomed"] === "true" ? this.range : null;
    const unit = this.#yUnit;
    const shown = this.#lines.filter((drawn) => this.state.shows(drawn.line));
    const tables: uPlot.AlignedData[] = [];
    const series: uPlot.Series[] = [{}];
    const bands: uPlot.Band[] = [];
    const add = (x: Values, y: Values, options: uPlot.Series): number => {
      tables.push([x.map((value) => convert(value ?? NaN, this.#xUnit)), y.map((value) => (value === null ? null : convert(value, unit)))]);
      return series.push({ spanGaps: true, points: { show: false }, ...options }) - 1;
    };
    const mixed = shown.some((drawn) => drawn.line.kind === "mean");
    for (const drawn of shown) {
      const stroke = () => this.#stroke(drawn);
      if (drawn.spread !== null) {
        const spread = drawn.spread;
        const edge = (sign: number) =>
          add(drawn.x, drawn.y.map((value, i) => (value === null ? null : value + sign * (spread[i] ?? 0))), { width: 0 });
        bands.push({ series: [edge(1), edge(-1)], fill: () => `${this.#stroke(drawn)}33` });
      }
      const thin = drawn.noisy || (mixed && drawn.line.kind === "run");
      drawn.series = add(drawn.x, drawn.y, {
        stroke,
        width: thin ? 0.7 : 1.6,
        dash: this.#dash(drawn),
        ...(drawn.line.steps === true ? { paths: uPlot.paths.stepped!({ align: 1 }) } : {}),
        points: {
          show: drawn.line.marks === true,
          size: 7,
          fill: drawn.line.kind === "paper" ? () => color("card") : stroke,
        },
      });
    }
    this.#plot?.destroy();
    if (tables.length === 0) tables.push([[0], [null]]);
    const joined = uPlot.join(tables);
    const xs = joined[0];
    const limits = this.panel.x.range;
    const ends = [xs[0] ?? 0, xs[xs.length - 1] ?? 1] as const;
    this.#full = limits === null ? [...ends] : [limits[0], limits[1]];
    const font = `12px ${getComputedStyle(document.body).fontFamily}`;
    const axis = { stroke: () => color("muted"), grid: { stroke: () => color("grid"), width: 1 }, ticks: { show: false }, font, labelFont: font };
    const log = this.panel.y.log;
    this.#plot = new uPlot(
      {
        width,
        height: HEIGHT,
        series,
        bands,
        legend: { show: false },
        padding: [10, 12, 0, 0],
        scales: {
          x: { time: false, distr: this.panel.x.log ? 3 : 1, range: (_, min, max) => [min, max] },
          y: { distr: log ? 3 : 1, range: (_, min, max) => this.#yRange(min, max) },
        },
        axes: [
          { ...axis, label: axisTitle(this.panel.x, this.#xUnit), labelSize: 20, size: 32 },
          { ...axis, label: unit.name, labelSize: 18, size: AXIS_WIDTH - 18, values: (_, ticks) => ticks.map((tick) => (tick === null ? "" : text(tick, 6))) },
        ],
        cursor: {
          sync: { key: `${this.panel.x.title} (${this.#xUnit.name})`, setSeries: false, scales: ["x", null] },
          drag: { x: true, y: false, setScale: false },
          points: { size: 7 },
          dataIdx: (plot, number, row, x) => nearest(plot.data[number]!, plot.data[0], row, x),
          bind: { mousedown: (plot, _target, handler) => (event) => (event.shiftKey ? this.#pan(plot, event) : handler(event)) },
        },
        hooks: {
          setCursor: [() => this.#read()],
          setSelect: [(plot) => this.#select(plot)],
          draw: [(plot) => this.#levels(plot)],
        },
      },
      joined,
      this.#body,
    );
    this.zoom(kept);
    this.#read();
  }

  #yRange(min: number | null, max: number | null): [number, number] {
    const fixed = this.panel.y.range;
    if (fixed !== null) return [fixed[0], fixed[1]];
    if (this.panel.y.log) {
      // Whole decades.
      return min === null || max === null || min <= 0 ? [0.1, 10] : [10 ** Math.floor(Math.log10(min)), 10 ** Math.ceil(Math.log10(max))];
    }
    let [low, high] = [min ?? 0, max ?? 1];
    for (const level of this.panel.levels) {
      const value = convert(revert(level.value, this.panel.y.units[0]), this.#yUnit);
      [low, high] = [Math.min(low, value), Math.max(high, value)];
    }
    if (this.panel.y.zero) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
    const room = high > low ? 0.06 * (high - low) : Math.abs(high) || 1;
    return [this.panel.y.zero && low === 0 ? 0 : low - room, this.panel.y.zero && high === 0 ? 0 : high + room];
  }

  /** Draws the levels with their titles. */
  #levels(plot: uPlot): void {
    const { ctx, bbox } = plot;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = color("ink");
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([5 * devicePixelRatio, 3 * devicePixelRatio]);
    ctx.font = `${11 * devicePixelRatio}px ${getComputedStyle(document.body).fontFamily}`;
    for (const level of this.panel.levels) {
      const y = plot.valToPos(convert(revert(level.value, this.panel.y.units[0]), this.#yUnit), "y", true);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
      ctx.fillText(level.title, bbox.left + 5 * devicePixelRatio, y - 4 * devicePixelRatio);
    }
    ctx.restore();
  }

  /** Writes the values at the cursor, or the keys of the lines without one. */
  #read(): void {
    const plot = this.#plot;
    if (plot === null) return;
    const row = plot.cursor.idx;
    const at = row === null || row === undefined || (plot.cursor.left ?? -1) < 0 ? null : row;
    const unit = this.#yUnit;
    const entries: (string | Node)[] = [];
    if (at !== null) entries.push(`${this.panel.x.title} ${text(plot.data[0][at]!, 6)} ${this.#xUnit.name}`);
    for (const drawn of this.#lines) {
      if (!this.state.shows(drawn.line)) continue;
      const entry = document.createElement("span");
      const key = document.createElement("i");
      key.className = "plot-key";
      key.style.background = this.#stroke(drawn);
      entry.append(key, drawn.line.title);
      const index = at === null ? null : plot.cursor.idxs?.[drawn.series];
      const value = index === null || index === undefined ? null : plot.data[drawn.series]?.[index];
      if (value !== null && value !== undefined) {
        entry.dataset["x"] = String(plot.data[0][index!]);
        const number = document.createElement("b");
        number.textContent = text(value, drawn.digits);
        entry.append(" ", number, unit.name === "" ? "" : ` ${unit.name}`);
        const spread = drawn.spread === null || index === undefined ? null : this.#spreadAt(drawn, plot.data[0][index!]!);
        if (spread !== null) entry.append(` ± ${text(spread * unit.factor, 3)}`);
      }
      entries.push(entry);
    }
    this.#readout.replaceChildren(...entries);
  }

  #spreadAt(drawn: Drawn, x: number): number | null {
    const index = drawn.x.findIndex((value) => value !== null && convert(value, this.#xUnit) === x);
    return drawn.spread?.[index] ?? null;
  }

  #select(plot: uPlot): void {
    const { left, width } = plot.select;
    if (width < 4) return;
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.onZoom([plot.posToVal(left, "x"), plot.posToVal(left + width, "x")]);
  }

  #pan(plot: uPlot, start: MouseEvent): null {
    const range = this.range;
    const width = plot.bbox.width / devicePixelRatio;
    const move = (event: MouseEvent) => {
      const share = (start.clientX - event.clientX) / width;
      this.onZoom(shifted(range, share, this.panel.x.log));
    };
    const end = () => {
      document.removeEventListener("mousemove", move);
      document.removeEventListener("mouseup", end);
    };
    document.addEventListener("mousemove", move);
    document.addEventListener("mouseup", end);
    return null;
  }

  #key(event: KeyboardEvent): void {
    const plot = this.#plot;
    if (plot === null || event.ctrlKey || event.metaKey || event.altKey) return;
    const [min, max] = this.range;
    const width = plot.bbox.width / devicePixelRatio;
    const left = plot.cursor.left !== undefined && plot.cursor.left >= 0 ? plot.cursor.left : width / 2;
    const moveTo = (to: number) => plot.setCursor({ left: Math.max(0, Math.min(width, to)), top: plot.bbox.height / devicePixelRatio / 2 });
    const scale = (factor: number) => this.onZoom(scaled([min, max], factor, this.panel.x.log ? null : plot.posToVal(left, "x")));
    const actions: Record<string, () => void> = {
      ArrowLeft: () => (event.shiftKey ? this.onZoom(shifted([min, max], -0.25, this.panel.x.log)) : moveTo(left - 4)),
      ArrowRight: () => (event.shiftKey ? this.onZoom(shifted([min, max], 0.25, this.panel.x.log)) : moveTo(left + 4)),
      Home: () => moveTo(0),
      End: () => moveTo(width),
      "+": () => scale(0.5),
      "=": () => scale(0.5),
      "-": () => scale(2),
      Escape: () => this.onZoom(null),
    };
    const action = actions[event.key];
    if (action === undefined) return;
    event.preventDefault();
    action();
  }

  /** Whether the abscissa is logarithmic. */
  get isLog(): boolean {
    return this.panel.x.log;
  }
}

/** A range that is wider by a factor and keeps its place about a point; null: about its middle. */
export function scaled([min, max]: [number, number], factor: number, at: number | null): [number, number] {
  if (at === null && min > 0) {
    const middle = Math.sqrt(min * max);
    const half = (max / min) ** (factor / 2);
    return [middle / half, middle * half];
  }
  const point = at ?? (min + max) / 2;
  return [point - (point - min) * factor, point + (max - point) * factor];
}

/** A range moved by a share of its width. */
export function shifted([min, max]: [number, number], share: number, log: boolean): [number, number] {
  if (log && min > 0) {
    const factor = (max / min) ** share;
    return [min * factor, max * factor];
  }
  const shift = share * (max - min);
  return [min + shift, max + shift];
}
