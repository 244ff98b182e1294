/** Base of all panels: title, readout, container of the plot, and line colors. */

import uPlot from "uplot";
import { color, element } from "./dom";
import { axisTitle } from "./format";
import type { Axis, Line, PageData, Panel } from "./page-data";
import type { State } from "./state";
import { ticks } from "./ticks";

export const DASHES: readonly (readonly number[])[] = [[], [8, 4], [2, 4]];
const DOT = '<circle cx="12" cy="5" r="3.5"/>';
const CROSS = '<path d="m8.5 1.5 7 7m-7 0 7-7"/>';
/** Height of the abscissa's title and numbers, px. */
const ACROSS = 66;

export type Values = (number | null)[];
export type Range = [number, number];

/** Makes the legend symbol of a line. If `dashes` is null, the symbol is only the mark. */
export function lineKey(stroke: string, dashes: readonly number[] | null, mark = "", fill = stroke): Element {
  const key = element("span");
  key.innerHTML = `<svg class="plot-key" viewBox="0 0 24 10" aria-hidden="true">${dashes === null ? "" : `<path d="M0 5h24" stroke-dasharray="${dashes.join(" ")}"/>`}${mark}</svg>`;
  const svg = key.firstElementChild as SVGElement;
  Object.assign(svg.style, { stroke, fill });
  return svg;
}

export function axisStyle(): uPlot.Axis {
  const font = `12px ${getComputedStyle(document.body).fontFamily}`;
  return { stroke: () => color("muted"), grid: { stroke: () => color("grid"), width: 1 }, ticks: { show: false }, font, labelFont: font };
}

function widthOf(title: string): number {
  const context = element("canvas").getContext("2d")!;
  context.font = axisStyle().font as string;
  return context.measureText(title).width;
}

export abstract class Frame {
  readonly element: HTMLElement;
  protected readonly readout = element("p", { className: "plot-readout" });
  protected readonly body: HTMLElement;
  protected plot: uPlot | null = null;
  protected full: Range = [0, 1];
  /** Called when the user zooms or pans; null for the full range. */
  onZoom: (range: Range | null) => void = () => {};

  constructor(
    protected readonly data: PageData,
    protected readonly panel: Panel,
    protected readonly state: State,
    protected readonly words: Uint16Array,
    /** Description for screen readers: kind of plot, and function of the arrow keys. */
    about = "plot with a cursor. Arrow keys move the cursor",
  ) {
    const title = `${panel.title}${panel.note === "" ? "" : `, ${panel.note}`}`;
    const label = `${title}: ${about}, plus and minus zoom, Escape shows everything.`;
    this.body = element("div", { className: "plot-body", tabIndex: 0, role: "img", "aria-label": label, onkeydown: (event) => this.#key(event) });
    const head = element("p", { className: "plot-title" }, element("b", {}, panel.title), element("span", {}, panel.note));
    this.element = element("div", { className: "plot" }, head, this.readout, this.body);
    new ResizeObserver(() => this.#resize()).observe(this.body);
    state.listen(() => this.draw());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /** Redraws the panel, after a switch or the theme has changed. */
  protected draw(): void {
    if (this.body.clientWidth === 0) return;
    const kept = this.chosen;
    this.build();
    this.zoom(kept);
    this.read();
  }

  /** Makes the plot, and sets `full`. */
  protected abstract build(): void;

  /** Writes the values at the cursor; without a cursor, the legend. */
  protected abstract read(): void;

  /** Moves the cursor by a keyboard step, backward or forward, or to one of the ends. */
  protected abstract move(to: -1 | 1 | "start" | "end"): void;

  /** Moves the cursor up or down by a keyboard step; returns false if the plot does not support it. */
  protected rise(_by: -1 | 1): boolean {
    return false;
  }

  /** Shows a range of the abscissa; null for the full range. */
  zoom(range: Range | null): void {
    const [min, max] = range ?? this.full;
    this.plot?.setScale("x", { min, max });
    this.note([min, max], range !== null);
  }

  /** Default height of this kind of plot, px. */
  protected abstract readonly ownHeight: number;

  /** Height of the plot, px, sufficient for the titles of its vertical axes. */
  protected get height(): number {
    const axes = [this.panel.y, ...(this.panel.right === undefined ? [] : [this.panel.right])];
    const titles = axes.flatMap((axis) => axis.units.map((unit) => axisTitle(axis, unit)));
    return Math.max(this.ownHeight, ...titles.map((title) => widthOf(title) + ACROSS));
  }

  /** The range of the abscissa that is shown. */
  get range(): Range {
    const x = this.plot?.scales["x"];
    return [x?.min ?? this.full[0], x?.max ?? this.full[1]];
  }

  get isLog(): boolean {
    return this.panel.x.log;
  }

  protected unitOf(axis: Axis) {
    return (this.state.base ? axis.units[1] : undefined) ?? axis.units[0];
  }

  protected stroke(line: Line): string {
    const found = this.data.cases.find((one) => one.name === line.case);
    return found === undefined || line.kind === "reference" ? color("ink") : color(`series-${found.color}`);
  }

  protected dash(line: Line): readonly number[] {
    if (line.right === true) return [1.5, 2.5];
    if (line.kind === "reference") return [3, 3];
    if (line.kind === "paper") return [5, 4];
    return DASHES[this.data.cases.find((one) => one.name === line.case)?.dash ?? 0] ?? [];
  }

  /** The legend entry of a line: symbol and title. A readout appends values to it. */
  protected entry(line: Line): HTMLSpanElement {
    const mark = line.crosses === true ? CROSS : line.marks === true || line.apart === true ? DOT : "";
    const stroke = this.stroke(line);
    return element("span", {}, lineKey(stroke, line.apart === true ? null : this.dash(line), mark, line.kind === "paper" ? color("card") : stroke), line.title);
  }

  /** Announces the range of the abscissa that is shown. */
  protected note([min, max]: Range, isZoomed: boolean): void {
    this.element.dataset["zoomed"] = String(isZoomed);
    this.element.dataset["range"] = `${min} ${max}`;
  }

  /** The range that the user has chosen; null for the full range. */
  protected get chosen(): Range | null {
    return this.element.dataset["zoomed"] === "true" ? this.range : null;
  }

  /** Mouse actions: a drag zooms, a drag with Shift pans. */
  protected get mouse(): Pick<uPlot.Cursor, "drag" | "bind"> {
    return {
      drag: { x: true, y: false, setScale: false },
      bind: { mousedown: (plot, _target, handler) => (event) => (event.shiftKey ? this.#pan(plot, event) : handler(event)) },
    };
  }

  /** Zooms to the range that was dragged over. */
  protected select(plot: uPlot): void {
    const { left, width } = plot.select;
    if (width < 4) return;
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.onZoom([plot.posToVal(left, "x"), plot.posToVal(left + width, "x")]);
  }

  #resize(): void {
    const width = this.body.clientWidth;
    if (width === 0) return;
    if (this.plot === null) this.draw();
    else if (this.plot.width !== width) {
      this.plot.setSize({ width, height: this.height });
      this.resized();
    }
  }

  protected resized(): void {}

  #pan(plot: uPlot, start: MouseEvent): null {
    const range = this.range;
    const width = plot.bbox.width / devicePixelRatio;
    const move = (event: MouseEvent) => {
      const share = (start.clientX - event.clientX) / width;
      this.onZoom(shifted(range, share, this.isLog));
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
    const plot = this.plot;
    if (plot === null || event.ctrlKey || event.metaKey || event.altKey) return;
    const range = this.range;
    const left = plot.cursor.left ?? -1;
    const at = left >= 0 ? plot.posToVal(left, "x") : null;
    const scale = (factor: number) => this.onZoom(scaled(range, factor, this.isLog ? null : at));
    const actions: Record<string, () => boolean | void> = {
      ArrowLeft: () => (event.shiftKey ? this.onZoom(shifted(range, -0.25, this.isLog)) : this.move(-1)),
      ArrowRight: () => (event.shiftKey ? this.onZoom(shifted(range, 0.25, this.isLog)) : this.move(1)),
      ArrowUp: () => this.rise(1),
      ArrowDown: () => this.rise(-1),
      Home: () => this.move("start"),
      End: () => this.move("end"),
      "+": () => scale(0.5),
      "=": () => scale(0.5),
      "-": () => scale(2),
      Escape: () => this.onZoom(null),
    };
    const action = actions[event.key];
    if (action !== undefined && action() !== false) event.preventDefault();
  }
}

/** A panel whose lines have no common abscissa; each series has its own paint function. */
export abstract class Plane extends Frame {
  protected abstract find(plot: uPlot): void;

  /** Makes the plot; each series has a paint function and its coordinates. */
  protected make(series: { paint: (plot: uPlot) => void; points: [number[], number[]] }[], vertical: Range, across: uPlot.Axis = {}, up: uPlot.Axis = {}): uPlot {
    this.plot?.destroy();
    const { x, y } = this.panel;
    const axis = (of: Axis) => ({ ...axisStyle(), label: axisTitle(of, this.unitOf(of)), ...ticks(of) });
    const scale = (of: Axis, range: Range) => ({ time: false, auto: false, distr: of.log ? 3 : 1, range });
    const facets = [{ scale: "x", auto: false }, { scale: "y", auto: false }];
    const paths = (paint: (plot: uPlot) => void) => (plot: uPlot) => {
      const { ctx, bbox } = plot;
      ctx.save();
      ctx.beginPath();
      ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
      ctx.clip();
      paint(plot);
      ctx.restore();
      return null;
    };
    const options = {
      mode: 2,
      width: this.body.clientWidth,
      height: this.height,
      series: [null, ...series.map(({ paint }) => ({ facets, paths: paths(paint) }))],
      legend: { show: false },
      padding: [10, 12, 0, 0],
      scales: { x: scale(x, this.full), y: scale(y, vertical) },
      axes: [{ ...axis(x), scale: "x", labelSize: 20, size: 32, ...across }, { ...axis(y), scale: "y", labelSize: 18, size: 44, ...up }],
      cursor: { ...this.mouse, x: false, y: false, points: { show: false }, dataIdx: () => null },
      hooks: { setCursor: [(plot: uPlot) => this.find(plot)], setSelect: [(plot: uPlot) => this.select(plot)] },
    } as unknown as uPlot.Options;
    return (this.plot = new uPlot(options, [null, ...series.map(({ points }) => points)] as unknown as uPlot.AlignedData, this.body));
  }
}

/** Scales a range by a factor about a point; null stands for the middle of the range. */
export function scaled([min, max]: Range, factor: number, at: number | null): Range {
  if (at === null && min > 0) {
    const middle = Math.sqrt(min * max);
    const half = (max / min) ** (factor / 2);
    return [middle / half, middle * half];
  }
  const point = at ?? (min + max) / 2;
  return [point - (point - min) * factor, point + (max - point) * factor];
}

/** Shifts a range by a share of its width. */
export function shifted([min, max]: Range, share: number, log: boolean): Range {
  if (log && min > 0) {
    const factor = (max / min) ** share;
    return [min * factor, max * factor];
  }
  const shift = share * (max - min);
  return [min + shift, max + shift];
}
