/** What all panels have in common: title, readout, the place of the plot, and the colors of lines. */

import uPlot from "uplot";
import { numbers } from "./data";
import { axisTitle } from "./format";
import type { Line, PageData, Panel } from "./page-data";
import type { State } from "./state";

export const DASHES: readonly (readonly number[])[] = [[], [8, 4], [2, 4]];
/** Marks of a key. */
const DOT = '<circle cx="12" cy="5" r="3.5"/>';
const CROSS = '<path d="m8.5 1.5 7 7m-7 0 7-7"/>';
/** Height of the title and the numbers of the abscissa, px. */
const ACROSS = 66;

export type Values = (number | null)[];
export type Range = [number, number];

/** A panel as the buttons of a figure and the other panels see it. */
export interface View {
  readonly element: HTMLElement;
  /** The part of the abscissa that is shown. */
  readonly range: Range;
  /** Whether the abscissa is logarithmic. */
  readonly isLog: boolean;
  /** Shows a part of the abscissa; null: all of it. */
  zoom(range: Range | null): void;
  /** Told when the user zooms or pans; null: everything is to be shown. */
  onZoom: (range: Range | null) => void;
}

/** A color of the page. */
export function color(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

/** What a line looks like; without dashes (null) only its mark. */
export function lineKey(stroke: string, dashes: readonly number[] | null, mark = "", fill = stroke): Element {
  const key = document.createElement("span");
  key.innerHTML = `<svg class="plot-key" viewBox="0 0 24 10" aria-hidden="true">${dashes === null ? "" : `<path d="M0 5h24" stroke-dasharray="${dashes.join(" ")}"/>`}${mark}</svg>`;
  const svg = key.firstElementChild as SVGElement;
  Object.assign(svg.style, { stroke, fill });
  return svg;
}

/** What the axes of all plots look like. */
export function axisStyle(): uPlot.Axis {
  const font = `12px ${getComputedStyle(document.body).fontFamily}`;
  return { stroke: () => color("muted"), grid: { stroke: () => color("grid"), width: 1 }, ticks: { show: false }, font, labelFont: font };
}

/** Width of a text on an axis, px. */
function widthOf(title: string): number {
  const context = document.createElement("canvas").getContext("2d")!;
  context.font = axisStyle().font as string;
  return context.measureText(title).width;
}

export abstract class Frame implements View {
  readonly element = document.createElement("div");
  protected readonly readout = document.createElement("p");
  protected readonly body = document.createElement("div");
  protected plot: uPlot | null = null;
  protected full: Range = [0, 1];
  onZoom: (range: Range | null) => void = () => {};

  constructor(
    protected readonly data: PageData,
    protected readonly panel: Panel,
    protected readonly state: State,
  ) {
    this.element.className = "plot";
    const head = document.createElement("p");
    head.className = "plot-title";
    const title = document.createElement("b");
    title.textContent = panel.title;
    const note = document.createElement("span");
    note.textContent = panel.note;
    head.append(title, note);
    this.readout.className = "plot-readout";
    this.body.className = "plot-body";
    this.body.tabIndex = 0;
    this.body.setAttribute("role", "img");
    this.body.setAttribute("aria-label", `${panel.title}${panel.note === "" ? "" : `, ${panel.note}`}: plot with a cursor. Arrow keys move the cursor, plus and minus zoom, Escape shows everything.`);
    this.body.addEventListener("keydown", (event) => this.#key(event));
    this.element.append(head, this.readout, this.body);
    new ResizeObserver(() => this.#resize()).observe(this.body);
    state.listen(() => this.draw());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  /** Draws everything anew: after a switch, in another theme. */
  protected abstract draw(): void;

  /** Moves the cursor by a step of the keyboard: backward or forward, or to one of the ends. */
  protected abstract move(to: -1 | 1 | "start" | "end"): void;

  /** Moves the cursor up or down by a step of the keyboard; false: this plot has no such steps. */
  protected rise(_by: -1 | 1): boolean {
    return false;
  }

  abstract zoom(range: Range | null): void;

  /** Height that the kind of plot has, px. */
  protected abstract get ownHeight(): number;

  /** Height of the plot, px: the titles of its vertical axes are whole. */
  protected get height(): number {
    const axes = [this.panel.y, ...(this.panel.right === undefined ? [] : [this.panel.right])];
    const titles = axes.flatMap((axis) => axis.units.map((unit) => axisTitle(axis, unit)));
    return Math.max(this.ownHeight, ...titles.map((title) => widthOf(title) + ACROSS));
  }

  get range(): Range {
    const x = this.plot?.scales["x"];
    return [x?.min ?? this.full[0], x?.max ?? this.full[1]];
  }

  get isLog(): boolean {
    return this.panel.x.log;
  }

  protected unitOf(axis: Panel["x"]) {
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

  /** The key of a line, with its dashes and marks, and its title, to which a readout appends values. */
  protected entry(line: Line): HTMLSpanElement {
    const entry = document.createElement("span");
    const mark = line.crosses === true ? CROSS : line.marks === true || line.apart === true ? DOT : "";
    const stroke = this.stroke(line);
    entry.append(lineKey(stroke, line.apart === true ? null : this.dash(line), mark, line.kind === "paper" ? color("card") : stroke), line.title);
    return entry;
  }

  /** Tells which part of the abscissa is shown. */
  protected note([min, max]: Range, isZoomed: boolean): void {
    this.element.dataset["zoomed"] = String(isZoomed);
    this.element.dataset["range"] = `${min} ${max}`;
  }

  /** The part that the user has chosen; null: all of it. */
  protected get chosen(): Range | null {
    return this.element.dataset["zoomed"] === "true" ? this.range : null;
  }

  /** What makes a plot follow the mouse: a drag zooms, one with Shift pans. */
  protected get mouse(): Pick<uPlot.Cursor, "drag" | "bind"> {
    return {
      drag: { x: true, y: false, setScale: false },
      bind: { mousedown: (plot, _target, handler) => (event) => (event.shiftKey ? this.#pan(plot, event) : handler(event)) },
    };
  }

  /** Zooms to what was dragged over. */
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

  /** Called after the width has changed. */
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

/** Both coordinates of a line, in the units of the data. */
export function coordinates(words: Uint16Array, line: Line): { x: Values; y: Values } {
  return { x: numbers(words, line.x), y: numbers(words, line.y) };
}

/** A range that is wider by a factor and keeps its place about a point; null: about its middle. */
export function scaled([min, max]: Range, factor: number, at: number | null): Range {
  if (at === null && min > 0) {
    const middle = Math.sqrt(min * max);
    const half = (max / min) ** (factor / 2);
    return [middle / half, middle * half];
  }
  const point = at ?? (min + max) / 2;
  return [point - (point - min) * factor, point + (max - point) * factor];
}

/** A range moved by a share of its width. */
export function shifted([min, max]: Range, share: number, log: boolean): Range {
  if (log && min > 0) {
    const factor = (max / min) ** share;
    return [min * factor, max * factor];
  }
  const shift = share * (max - min);
  return [min + shift, max + shift];
}
