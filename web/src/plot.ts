/** A pair of axes: lines over a common abscissa, with a cursor, a readout, zoom and pan. */

import uPlot from "uplot";
import { digits, numbers } from "./data";
import { color } from "./dom";
import { axisTitle, convert, measured, revert, text, withRoom } from "./format";
import type { Line, PageData, Panel } from "./page-data";
import { type Range, type Values, Frame, axisStyle } from "./panel";
import { CLOSE, isReadable, samples } from "./recording";
import type { State } from "./state";
import { ticks } from "./ticks";

const AXIS_WIDTH = 62;
/** A line whose total variation exceeds this many times its range is drawn thin, because it is noise. */
const NOISY = 20;
/** Step of the cursor with the keyboard, px. */
const STEP = 4;

interface Drawn {
  line: Line;
  x: Values;
  y: Values;
  spread: Values | null;
  digits: number;
  noisy: boolean;
  /** True if all recorded samples have been loaded, or if they are not available. */
  isFull: boolean;
  series: number;
}

function isNoisy(values: Values): boolean {
  const known = values.filter((value) => value !== null);
  let way = 0;
  for (let i = 1; i < known.length; i++) way += Math.abs(known[i]! - known[i - 1]!);
  const range = known.reduce((m, v) => Math.max(m, v), -Infinity) - known.reduce((m, v) => Math.min(m, v), Infinity);
  return way > NOISY * range;
}

/** Returns the index of the existing value nearest to a row. */
function nearest(values: ArrayLike<number | null | undefined>, xs: ArrayLike<number>, row: number, x: number): number | null {
  const exists = (i: number) => values[i] !== null && values[i] !== undefined;
  let [low, high] = [row, row];
  while (low >= 0 && !exists(low)) low--;
  while (high < values.length && !exists(high)) high++;
  if (low < 0) return high < values.length ? high : null;
  if (high >= values.length) return low;
  return Math.abs(xs[low]! - x) <= Math.abs(xs[high]! - x) ? low : high;
}

export class Plot extends Frame {
  protected readonly ownHeight = 240;
  readonly #lines: Drawn[];

  constructor(data: PageData, panel: Panel, state: State, words: Uint16Array) {
    super(data, panel, state, words);
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
    if (panel.x.title === "Time" && this.#xUnit.name === "s") state.watch((time) => this.#follow(time));
  }

  /** Moves the cursor to a time, s; null removes it. */
  #follow(time: number | null): void {
    const plot = this.plot;
    if (plot === null) return;
    const [min, max] = this.range;
    const left = time === null || time < min || time > max ? -10 : plot.valToPos(time, "x");
    // This change is not published, because the other plots get the time themselves.
    const set = plot.setCursor as (at: { left: number; top: number }, fire: boolean, publish: boolean) => void;
    set({ left, top: left < 0 ? -10 : plot.bbox.height / devicePixelRatio / 2 }, true, false);
  }

  get #xUnit() {
    return this.panel.x.units[0];
  }

  /** The display unit of a line, which is that of its axis. */
  #yUnit(line: Line | null = null) {
    return this.unitOf((line?.right === true ? this.panel.right : undefined) ?? this.panel.y);
  }

  override zoom(range: Range | null): void {
    super.zoom(range);
    const [min, max] = range ?? this.full;
    if (isReadable && max - min <= CLOSE * (this.full[1] - this.full[0])) void this.#refine();
  }

  /** Replaces the samples in the page by all recorded samples. */
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
    this.draw();
  }

  protected build(): void {
    const shown = this.#lines.filter((drawn) => this.state.shows(drawn.line));
    const tables: uPlot.AlignedData[] = [];
    const series: uPlot.Series[] = [{}];
    const bands: uPlot.Band[] = [];
    const add = (line: Line, x: Values, y: Values, options: uPlot.Series): number => {
      const unit = this.#yUnit(line);
      tables.push([x.map((value) => convert(value ?? NaN, this.#xUnit)), y.map((value) => (value === null ? null : convert(value, unit)))]);
      const scale = line.right === true ? "right" : "y";
      return series.push({ spanGaps: true, points: { show: false }, scale, ...options }) - 1;
    };
    const mixed = shown.some((drawn) => drawn.line.kind === "mean");
    for (const drawn of shown) {
      const stroke = () => this.stroke(drawn.line);
      if (drawn.spread !== null) {
        const spread = drawn.spread;
        const edge = (sign: number) =>
          add(drawn.line, drawn.x, drawn.y.map((value, i) => (value === null ? null : value + sign * (spread[i] ?? 0))), { width: 0 });
        bands.push({ series: [edge(1), edge(-1)], fill: () => `${this.stroke(drawn.line)}33` });
      }
      const thin = drawn.noisy || (mixed && drawn.line.kind === "run");
      drawn.series = add(drawn.line, drawn.x, drawn.y, {
        stroke,
        width: thin ? 0.7 : 1.6,
        dash: [...this.dash(drawn.line)],
        ...(drawn.line.steps === true ? { paths: uPlot.paths.stepped!({ align: 1 }) } : {}),
        ...(drawn.line.apart === true ? { paths: () => null } : {}),
        points: {
          show: drawn.line.marks === true || drawn.line.apart === true,
          size: 7,
          fill: drawn.line.kind === "paper" ? () => color("card") : stroke,
        },
      });
    }
    this.plot?.destroy();
    // If all cases are off, uPlot still needs a range for the abscissa (above 0 on a logarithmic axis) and a line.
    if (!shown.some((drawn) => drawn.line.right !== true)) {
      const across = tables[0]?.[0] ?? (this.panel.x.log ? [1, 10] : [0, 1]);
      tables.push([across, Array.from(across, () => null)]);
      series.push({ scale: "y", width: 0, points: { show: false } });
    }
    const joined = uPlot.join(tables);
    const xs = joined[0];
    const limits = this.panel.x.range;
    const ends: Range = [xs[0] ?? 0, xs[xs.length - 1] ?? 1];
    // A single point needs room on both sides.
    if (ends[0] === ends[1]) [ends[0], ends[1]] = this.panel.x.log ? [ends[0] / 2, ends[1] * 2] : [ends[0] - 1, ends[1] + 1];
    this.full = limits === null ? [...ends] : [limits[0], limits[1]];
    const axis = axisStyle();
    const log = this.panel.y.log;
    const right = this.panel.right;
    const vertical = (of: Panel["y"], name: string): uPlot.Axis => ({ ...axis, label: axisTitle(of, this.unitOf(of)), labelSize: 18, size: AXIS_WIDTH - 18, scale: name, ...ticks(of) });
    this.plot = new uPlot(
      {
        width: this.body.clientWidth,
        height: this.height,
        series,
        bands,
        legend: { show: false },
        padding: [10, 12, 0, 0],
        scales: {
          x: { time: false, distr: this.panel.x.log ? 3 : 1, range: (_, min, max) => [min, max] },
          y: { distr: log ? 3 : 1, range: (_, min, max) => this.#yRange(min, max) },
          ...(right === undefined ? {} : { right: { range: (_, min, max) => withRoom(min ?? 0, max ?? 1, false) } }),
        },
        axes: [
          { ...axis, label: axisTitle(this.panel.x, this.#xUnit), labelSize: 20, size: 32, ...ticks(this.panel.x) },
          vertical(this.panel.y, "y"),
          ...(right === undefined ? [] : [{ ...vertical(right, "right"), side: 1, grid: { show: false } }]),
        ],
        cursor: {
          ...this.mouse,
          sync: { key: `${this.panel.x.title} (${this.#xUnit.name})`, setSeries: false, scales: ["x", null] },
          points: { size: 7 },
          dataIdx: (plot, number, row, x) => nearest(plot.data[number]!, plot.data[0], row, x),
        },
        hooks: {
          setCursor: [() => this.read()],
          setSelect: [(plot) => this.select(plot)],
          draw: [(plot) => this.#drawn(plot)],
        },
      },
      joined,
      this.body,
    );
  }

  protected move(to: -1 | 1 | "start" | "end"): void {
    const plot = this.plot;
    if (plot === null) return;
    const width = plot.bbox.width / devicePixelRatio;
    const left = plot.cursor.left !== undefined && plot.cursor.left >= 0 ? plot.cursor.left : width / 2;
    const wanted = to === "start" ? 0 : to === "end" ? width : left + STEP * to;
    plot.setCursor({ left: Math.max(0, Math.min(width, wanted)), top: plot.bbox.height / devicePixelRatio / 2 });
  }

  #yRange(min: number | null, max: number | null): Range {
    const fixed = this.panel.y.range;
    if (fixed !== null) {
      const [low, high] = fixed.map((end) => convert(revert(end, this.panel.y.units[0]), this.#yUnit())) as Range;
      // Shares get some room, because points can be at 0 or at 1.
      const room = low === 0 && high === 1 ? 0.03 : 0;
      return [low - room, high + room];
    }
    let [low, high] = [min ?? NaN, max ?? NaN];
    if (this.panel.y.log) return withRoom(low, high, true);
    for (const level of this.panel.levels) {
      const value = convert(revert(level.value, this.panel.y.units[0]), this.#yUnit());
      [low, high] = [Math.min(low, value), Math.max(high, value)];
    }
    if (this.panel.y.zero) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
    const [bottom, top] = withRoom(low, high, false);
    return [this.panel.y.zero && low === 0 ? 0 : bottom, this.panel.y.zero && high === 0 ? 0 : top];
  }

  #drawn(plot: uPlot): void {
    this.#levels(plot);
    const { min, max } = plot.scales["y"]!;
    this.element.dataset["vertical"] = `${min} ${max}`;
  }

  #levels(plot: uPlot): void {
    const { ctx, bbox } = plot;
    const [card, ink, size] = [color("card"), color("ink"), 11 * devicePixelRatio];
    /** Right ends of the titles, and their heights. */
    const taken: [number, number][] = [];
    ctx.save();
    ctx.strokeStyle = ink;
    ctx.lineWidth = devicePixelRatio;
    ctx.setLineDash([5 * devicePixelRatio, 3 * devicePixelRatio]);
    ctx.font = `${size}px ${getComputedStyle(document.body).fontFamily}`;
    ctx.textAlign = "left";
    ctx.textBaseline = "bottom";
    for (const level of this.panel.levels) {
      const y = plot.valToPos(convert(revert(level.value, this.panel.y.units[0]), this.#yUnit()), "y", true);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
      // Keeps the title readable on top of lines, and next to the title of a nearby level.
      const width = ctx.measureText(level.title).width;
      const left = Math.max(bbox.left, ...taken.filter(([, other]) => Math.abs(other - y) < 1.5 * size).map(([end]) => end)) + size / 2;
      taken.push([left + width, y]);
      ctx.globalAlpha = 0.8;
      ctx.fillStyle = card;
      ctx.fillRect(left - size / 4, y - 1.3 * size, width + size / 2, 1.2 * size);
      ctx.globalAlpha = 1;
      ctx.fillStyle = ink;
      ctx.fillText(level.title, left, y - size / 5);
    }
    ctx.restore();
  }

  protected read(): void {
    const plot = this.plot;
    if (plot === null) return;
    const row = plot.cursor.idx;
    const at = row === null || row === undefined || (plot.cursor.left ?? -1) < 0 ? null : row;
    const entries: (string | Node)[] = [];
    if (at !== null) entries.push(`${this.panel.x.title} ${text(plot.data[0][at]!, 6)} ${this.#xUnit.name}`);
    for (const drawn of this.#lines) {
      if (drawn.line.title === "" || !this.state.shows(drawn.line)) continue;
      const entry = this.entry(drawn.line);
      const unit = this.#yUnit(drawn.line);
      const index = at === null ? null : plot.cursor.idxs?.[drawn.series];
      const value = index === null || index === undefined ? null : plot.data[drawn.series]?.[index];
      if (value !== null && value !== undefined) {
        entry.dataset["x"] = String(plot.data[0][index!]);
        entry.append(...measured(value, drawn.digits, unit));
        const spread = drawn.spread === null || index === undefined ? null : this.#spreadAt(drawn, plot.data[0][index!]!);
        if (spread !== null) entry.append(` ± ${text(spread * unit.factor, 3)}`);
      }
      entries.push(entry);
    }
    this.readout.replaceChildren(...entries);
  }

  #spreadAt(drawn: Drawn, x: number): number | null {
    const index = drawn.x.findIndex((value) => value !== null && convert(value, this.#xUnit) === x);
    return drawn.spread?.[index] ?? null;
  }
}
