/** Curves in a plane: a signal over another signal, a track from above, scatter plots. */

import uPlot from "uplot";
import { digits, numbers } from "./data";
import { element } from "./dom";
import { convert, measured, withRoom } from "./format";
import type { Axis, Line, PageData, Panel } from "./page-data";
import { type Range, type Values, Plane } from "./panel";
import { CLOSE, isReadable, samples } from "./recording";
import type { State } from "./state";

/** Key of the cursor that plots over time share. */
const TIME = "Time (s)";
const HEIGHT = 340;
/** Free space around the curves, as a share of their extent. */
const ROOM = 0.05;
const MARK = 3.5;
/** In scatter plots with more points than this, the points are translucent, which shows their density. */
const OPAQUE = 40;
const LEAST_OPAQUE = 0.25;
/** Range of the height of a map, px. Within this range, the content of the map determines the height. */
const MAP: Range = [120, 420];
/** Width of the numbers and titles beside a map, px. */
const BESIDE = 74;

interface Drawn {
  line: Line;
  /** Points in the displayed units. */
  xs: number[];
  ys: number[];
  /** Indices of points after a gap, which are not joined to the previous point. */
  begins: Set<number>;
  /** Times of the points, s; empty if the points have no times. */
  times: number[];
  digits: [number, number];
}

function extent(values: number[]): Range {
  return [values.reduce((m, v) => Math.min(m, v), Infinity), values.reduce((m, v) => Math.max(m, v), -Infinity)];
}

export class Curve extends Plane {
  #drawn: Drawn[] = [];
  /** All recorded samples of lines that were loaded; null if they are not available. */
  readonly #recorded = new Map<Line, { x: Values; y: Values; times: number[] } | null>();
  /** The index of the point at the cursor, for each line. */
  #at = new Map<Drawn, number>();
  /** Whether the cursor was set in this plot, not in another plot. */
  #isOwn = false;
  #marks = new Map<Drawn, HTMLElement>();

  constructor(data: PageData, panel: Panel, state: State, words: Uint16Array) {
    super(data, panel, state, words);
    this.element.classList.toggle("is-map", this.#isMap);
    // Receives the cursor of plots over time, as a member of uPlot's sync group.
    const follower = { pub: (_: string, plot: uPlot, x: number) => this.#follow(x < 0 ? null : plot.posToVal(x, "x")) };
    uPlot.sync(TIME).sub(follower as unknown as uPlot);
    state.watch((time, source) => {
      if (source !== this) this.#follow(time);
    });
  }

  protected get ownHeight(): number {
    if (!this.#isMap) return HEIGHT;
    const [[left, right], [low, high]] = [this.full, this.#room(this.panel.y, this.#drawn.flatMap(({ ys }) => ys))];
    const wanted = ((this.body.clientWidth - BESIDE) * (high - low)) / (right - left);
    return Math.round(Math.max(MAP[0], Math.min(MAP[1], wanted + 56)));
  }

  /** The range of an axis: a fixed range, or the range of the values. */
  #room(axis: Axis, values: number[]): Range {
    return axis.range === null ? withRoom(...extent(values), axis.log, ROOM) : [axis.range[0], axis.range[1]];
  }

  get #isMap(): boolean {
    return this.panel.kind === "map";
  }

  protected build(): void {
    const [across, up] = [this.unitOf(this.panel.x), this.unitOf(this.panel.y)];
    this.#drawn = this.panel.lines
      .filter((line) => this.state.shows(line))
      .map((line) => {
        const recorded = this.#recorded.get(line) ?? null;
        const { x, y } = recorded ?? { x: numbers(this.words, line.x), y: numbers(this.words, line.y) };
        const known = x.map((value, i) => value !== null && y[i] !== null && y[i] !== undefined);
        const times = recorded?.times ?? (line.t === undefined ? [] : numbers(this.words, line.t));
        const begins = new Set<number>();
        let count = 0;
        known.forEach((here, i) => {
          if (here && known[i - 1] !== true) begins.add(count);
          if (here) count += 1;
        });
        return {
          line,
          times: times.filter((_, i) => known[i]).map((time) => time ?? NaN),
          xs: x.filter((_, i) => known[i]).map((value) => convert(value!, across)),
          ys: y.filter((_, i) => known[i]).map((value) => convert(value!, up)),
          begins,
          digits: recorded === null ? [digits(line.x), digits(line.y)] : [6, 6],
        };
      });
    this.full = this.#room(this.panel.x, this.#drawn.flatMap(({ xs }) => xs));
    this.#at.clear();
    this.#isOwn = false;
    const series = this.#drawn.map((drawn) => ({ paint: (plot: uPlot) => this.#paint(plot, drawn), points: [drawn.xs, drawn.ys] as [number[], number[]] }));
    // uPlot needs a series even if all cases are off.
    const { over } = this.make(series.length === 0 ? [{ paint: () => {}, points: [[], []] }] : series, [1, 10]);
    this.#marks = new Map(this.#drawn.map((drawn) => [drawn, element("div", { className: "plot-mark" })]));
    over.append(...this.#marks.values());
  }

  protected override resized(): void {
    this.zoom(this.chosen);
  }

  override zoom(range: Range | null): void {
    const plot = this.plot;
    if (plot === null) return;
    let [min, max] = range ?? this.full;
    const inside = this.#drawn.flatMap(({ xs, ys }) => ys.filter((_, i) => xs[i]! >= min && xs[i]! <= max));
    let [low, high] = this.#room(this.panel.y, inside);
    if (this.#isMap) {
      const shape = plot.bbox.height / plot.bbox.width;
      const height = (max - min) * shape;
      // A zoomed range stays; the full range is extended on one of the axes.
      if (range === null && high - low > height) {
        const half = (high - low) / shape / 2;
        [min, max] = [(min + max) / 2 - half, (min + max) / 2 + half];
      } else {
        [low, high] = [(low + high - height) / 2, (low + high + height) / 2];
      }
    }
    plot.batch(() => {
      plot.setScale("x", { min, max });
      plot.setScale("y", { min: low, max: high });
    });
    this.note([min, max], range !== null);
    this.element.dataset["vertical"] = `${low} ${high}`;
    this.#place();
    if (isReadable && max - min <= CLOSE * (this.full[1] - this.full[0])) void this.#refine();
  }

  /** Replaces the samples in the page by all recorded samples in the same time range. */
  async #refine(): Promise<void> {
    const coarse = this.#drawn.map((drawn) => drawn.line).filter((line) => !this.#recorded.has(line));
    const found = coarse.map(async (line) => {
      this.#recorded.set(line, null);
      const { file, signal, over, t } = line;
      if (file === undefined || signal === undefined || over === undefined || t === undefined) return false;
      const [across, up] = await Promise.all([samples(file, over), samples(file, signal)]);
      if (across === null || up === null) return false;
      const [begin, end] = extent(numbers(this.words, t).filter((time) => time !== null));
      const inside = (_: number, i: number) => up.times[i]! >= begin && up.times[i]! <= end;
      this.#recorded.set(line, { x: across.values.filter(inside), y: up.values.filter(inside), times: up.times.filter(inside) });
      return true;
    });
    if (!(await Promise.all(found)).includes(true)) return;
    this.element.dataset["resolution"] = "full";
    this.draw();
  }

  #paint(plot: uPlot, drawn: Drawn): void {
    const { ctx } = plot;
    const { line, xs, begins } = drawn;
    ctx.strokeStyle = ctx.fillStyle = this.stroke(line);
    ctx.lineWidth = 1.6 * devicePixelRatio;
    ctx.lineJoin = "round";
    ctx.setLineDash([...this.dash(line)].map((length) => length * devicePixelRatio));
    const at = (i: number): [number, number] => [plot.valToPos(xs[i]!, "x", true), plot.valToPos(drawn.ys[i]!, "y", true)];
    if (line.apart !== true) {
      ctx.beginPath();
      xs.forEach((_, i) => (begins.has(i) ? ctx.moveTo(...at(i)) : ctx.lineTo(...at(i))));
      ctx.stroke();
    }
    if (line.marks === true || line.apart === true) {
      ctx.setLineDash([]);
      if (line.apart === true) ctx.globalAlpha = Math.max(LEAST_OPAQUE, Math.min(1, OPAQUE / xs.length));
      const size = MARK * devicePixelRatio;
      xs.forEach((_, i) => {
        const [x, y] = at(i);
        ctx.beginPath();
        if (line.crosses === true) {
          for (const sign of [-1, 1]) {
            ctx.moveTo(x - size, y - sign * size);
            ctx.lineTo(x + size, y + sign * size);
          }
          ctx.stroke();
        } else {
          ctx.arc(x, y, size, 0, 2 * Math.PI);
          ctx.fill();
        }
      });
    }
  }

  protected find(plot: uPlot): void {
    const { left = -1, top = -1 } = plot.cursor;
    let [found, least]: [[Drawn, number] | null, number] = [null, Infinity];
    if (left >= 0 && top >= 0) {
      for (const drawn of this.#drawn) {
        drawn.xs.forEach((x, i) => {
          const distance = Math.hypot(plot.valToPos(x, "x") - left, plot.valToPos(drawn.ys[i]!, "y") - top);
          if (distance < least) [found, least] = [[drawn, i], distance];
        });
      }
    }
    this.#point(found);
  }

  /** Moves the cursor to a point of a line, and passes its time to the plots over time. */
  #point(found: [Drawn, number] | null): void {
    const wasOwn = this.#isOwn;
    this.#isOwn = found !== null;
    if (found === null && !wasOwn) return;
    const time = found === null ? null : found[0].times[found[1]];
    this.#at = new Map(found === null ? [] : [found]);
    this.state.point(time === undefined || Number.isNaN(time) ? null : time, this);
    this.read();
  }

  /** Moves the cursor to the points at a time, s; null removes it. */
  #follow(time: number | null): void {
    this.#isOwn = false;
    this.#at.clear();
    for (const drawn of time === null ? [] : this.#drawn) {
      let nearest = -1;
      drawn.times.forEach((at, i) => {
        if (nearest < 0 || Math.abs(at - time!) < Math.abs(drawn.times[nearest]! - time!)) nearest = i;
      });
      if (nearest >= 0) this.#at.set(drawn, nearest);
    }
    this.read();
  }

  protected move(to: -1 | 1 | "start" | "end"): void {
    const [drawn, index] = [...this.#at][0] ?? [this.#drawn[0], 0];
    if (drawn === undefined) return;
    const last = drawn.xs.length - 1;
    // A curve takes about 200 key presses.
    const step = Math.max(1, Math.round(last / 200));
    const wanted = to === "start" ? 0 : to === "end" ? last : index + step * to;
    this.#point([drawn, Math.max(0, Math.min(last, wanted))]);
  }

  #place(): void {
    const plot = this.plot;
    if (plot === null) return;
    for (const [drawn, mark] of this.#marks) {
      const i = this.#at.get(drawn);
      mark.hidden = i === undefined;
      if (i === undefined) continue;
      mark.style.left = `${plot.valToPos(drawn.xs[i]!, "x")}px`;
      mark.style.top = `${plot.valToPos(drawn.ys[i]!, "y")}px`;
      mark.style.background = this.stroke(drawn.line);
    }
  }

  protected read(): void {
    this.#place();
    const named = this.#drawn.filter((drawn) => drawn.line.title !== "" || this.#at.has(drawn));
    const entries = named.map((drawn) => {
      const entry = this.entry(drawn.line);
      const i = this.#at.get(drawn);
      if (i === undefined) return entry;
      entry.dataset["x"] = String(drawn.xs[i]);
      entry.append(...measured(drawn.xs[i]!, drawn.digits[0], this.unitOf(this.panel.x)), ",");
      entry.append(...measured(drawn.ys[i]!, drawn.digits[1], this.unitOf(this.panel.y)));
      return entry;
    });
    this.readout.replaceChildren(...entries);
  }
}
