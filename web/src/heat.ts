/** Heat maps: a value as a function of two other values, shown as colored cells. */

import uPlot from "uplot";
import { digits, numbers } from "./data";
import { element } from "./dom";
import { axisTitle, cell, convert, measured, text } from "./format";
import type { Axis, Line, PageData, Panel } from "./page-data";
import { type Range, Plane } from "./panel";
import type { State } from "./state";

/** Minimum width and height of a cell with a number in it, px. */
const ROOM: readonly [number, number] = [46, 20];
/** If a row has at most this many cells, each of them has a tick. */
const MOST_TICKS = 12;
/** Viridis, a color map that is readable with color blindness, from low to high; the static picture uses it, too. */
const COLORS: readonly (readonly [number, number, number])[] = [
  [68, 1, 84],
  [59, 82, 139],
  [33, 145, 140],
  [94, 201, 98],
  [253, 231, 37],
];

function colorAt(share: number): [number, number, number] {
  const place = Math.max(0, Math.min(1, share)) * (COLORS.length - 1);
  const low = Math.min(COLORS.length - 2, Math.floor(place));
  return [0, 1, 2].map((i) => Math.round(COLORS[low]![i]! + (place - low) * (COLORS[low + 1]![i]! - COLORS[low]![i]!))) as [number, number, number];
}

function css([red, green, blue]: readonly [number, number, number]): string {
  return `rgb(${red}, ${green}, ${blue})`;
}

/** Whether black text is more readable on a color than white text. */
function isLight([red, green, blue]: readonly [number, number, number]): boolean {
  return 0.299 * red + 0.587 * green + 0.114 * blue > 128;
}

/** Returns the borders between cells with rising `centers`: arithmetic means, on a logarithmic axis geometric means. */
function borders(centers: number[], log: boolean): number[] {
  const there = (value: number) => (log ? Math.log10(value) : value);
  const back = (value: number) => (log ? 10 ** value : value);
  const at = centers.map(there);
  if (at.length === 1) return [back(at[0]! - 0.5), back(at[0]! + 0.5)];
  const inner = at.slice(1).map((value, i) => (value + at[i]!) / 2);
  const last = at.length - 1;
  return [2 * at[0]! - inner[0]!, ...inner, 2 * at[last]! - inner[last - 1]!].map(back);
}

export class Heat extends Plane {
  protected readonly ownHeight = 340;
  readonly #line: Line;
  /** Centers of the cells in the displayed units, and values by row and column. */
  #xs: number[] = [];
  #ys: number[] = [];
  #values: (number | null)[][] = [];
  #borders: [number[], number[]] = [[], []];
  #limits: Range = [0, 1];
  /** Column and row of the cell at the cursor. */
  #at: [number, number] | null = null;
  readonly #mark = element("div", { className: "heat-mark" });

  constructor(data: PageData, panel: Panel, state: State, words: Uint16Array) {
    super(data, panel, state, words, "heat map with a cursor. Arrow keys go from cell to cell");
    this.#line = panel.lines[0];
  }

  get #z(): Axis {
    return this.panel.z ?? this.panel.y;
  }

  #cells(): void {
    const [x, y] = [numbers(this.words, this.#line.x), numbers(this.words, this.#line.y)];
    const z = this.#line.z === undefined ? [] : numbers(this.words, this.#line.z);
    const rising = (values: (number | null)[]) => [...new Set(values.filter((value) => value !== null))].sort((a, b) => a - b);
    const [across, up] = [rising(x), rising(y)];
    const values: (number | null)[][] = up.map(() => across.map(() => null));
    const unit = this.unitOf(this.#z);
    z.forEach((value, i) => {
      const row = values[up.indexOf(y[i]!)];
      if (row !== undefined && value !== null) row[across.indexOf(x[i]!)] = convert(value, unit);
    });
    this.#xs = across.map((value) => convert(value, this.unitOf(this.panel.x)));
    this.#ys = up.map((value) => convert(value, this.unitOf(this.panel.y)));
    this.#values = values;
    this.#borders = [borders(this.#xs, this.panel.x.log), borders(this.#ys, this.panel.y.log)];
    const known = values.flat().filter((value) => value !== null);
    const fixed = this.#z.range;
    this.#limits = fixed === null ? [Math.min(...known), Math.max(...known)] : [fixed[0], fixed[1]];
  }

  protected build(): void {
    this.#cells();
    const [across, up] = this.#borders;
    this.full = [across[0] ?? 0, across.at(-1) ?? 1];
    const vertical: Range = [up[0] ?? 0, up.at(-1) ?? 1];
    const atCells = (centers: number[]) => ({ grid: { show: false }, ...(centers.length <= MOST_TICKS ? { splits: () => centers } : {}) });
    const series = [{ paint: (plot: uPlot) => this.#paint(plot), points: [this.#xs, this.#xs] as [number[], number[]] }];
    this.make(series, vertical, atCells(this.#xs), atCells(this.#ys)).over.append(this.#mark);
    this.element.dataset["vertical"] = `${vertical[0]} ${vertical[1]}`;
  }

  protected override resized(): void {
    this.read();
  }

  override zoom(range: Range | null): void {
    super.zoom(range);
    this.read();
  }

  #share(value: number): number {
    const [low, high] = this.#limits;
    return high > low ? (value - low) / (high - low) : 0.5;
  }

  #paint(plot: uPlot): void {
    const { ctx } = plot;
    const ratio = devicePixelRatio;
    ctx.font = `${11 * ratio}px ${getComputedStyle(document.body).fontFamily}`;
    ctx.textAlign = "center";
    ctx.textBaseline = "middle";
    const across = this.#borders[0].map((value) => Math.round(plot.valToPos(value, "x", true)));
    const up = this.#borders[1].map((value) => Math.round(plot.valToPos(value, "y", true)));
    this.#values.forEach((row, i) =>
      row.forEach((value, j) => {
        if (value === null) return;
        const [left, right, bottom, top] = [across[j]!, across[j + 1]!, up[i]!, up[i + 1]!];
        const color = colorAt(this.#share(value));
        ctx.fillStyle = css(color);
        ctx.fillRect(left, top, right - left, bottom - top);
        if (right - left >= ROOM[0] * ratio && bottom - top >= ROOM[1] * ratio) {
          ctx.fillStyle = isLight(color) ? "#000" : "#fff";
          ctx.fillText(cell(value), (left + right) / 2, (top + bottom) / 2);
        }
      }),
    );
  }

  protected find(plot: uPlot): void {
    const { left = -1, top = -1 } = plot.cursor;
    const inside = (value: number, of: number[]) => of.findIndex((border, i) => value >= border && value <= (of[i + 1] ?? -Infinity));
    const at: [number, number] =
      left < 0 || top < 0 ? [-1, -1] : [inside(plot.posToVal(left, "x"), this.#borders[0]), inside(plot.posToVal(top, "y"), this.#borders[1])];
    this.#at = at[0] < 0 || at[1] < 0 ? null : at;
    this.read();
  }

  #go([across, up]: readonly [number, number]): void {
    const inside = (value: number, count: number) => Math.max(0, Math.min(count - 1, value));
    this.#at = [inside(across, this.#xs.length), inside(up, this.#ys.length)];
    this.read();
  }

  protected move(to: -1 | 1 | "start" | "end"): void {
    const [column, row] = this.#at ?? [typeof to === "number" ? -to : 0, 0];
    this.#go([to === "start" ? 0 : to === "end" ? this.#xs.length - 1 : column + to, row]);
  }

  protected override rise(by: -1 | 1): boolean {
    const [column, row] = this.#at ?? [0, -by];
    this.#go([column, row + by]);
    return true;
  }

  /** Writes the cell at the cursor; without a cursor, the color scale. */
  protected read(): void {
    const plot = this.plot;
    if (plot === null) return;
    const at = this.#at;
    this.#mark.hidden = at === null;
    const unit = this.unitOf(this.#z);
    const size = this.#line.z === undefined ? 4 : digits(this.#line.z);
    if (at === null) {
      const bar = element("i", { className: "heat-bar" });
      bar.style.background = `linear-gradient(to right, ${COLORS.map(css).join(", ")})`;
      const [low, high] = this.#limits;
      const key = element("span", { className: "heat-key" }, text(low, 4), bar, text(high, 4));
      this.readout.replaceChildren(axisTitle(this.#z, unit), key);
      return;
    }
    const [column, row] = at;
    const [across, up] = this.#borders;
    const [left, right] = [column, column + 1].map((i) => plot.valToPos(across[i]!, "x")) as Range;
    const [bottom, top] = [row, row + 1].map((i) => plot.valToPos(up[i]!, "y")) as Range;
    Object.assign(this.#mark.style, { left: `${left}px`, top: `${top}px`, width: `${right - left}px`, height: `${bottom - top}px` });
    const value = this.#values[row]?.[column] ?? null;
    const name = (axis: Axis, place: number) => {
      const of = this.unitOf(axis);
      return `${axis.title} ${text(place, 4)}${of.name === "" ? "" : ` ${of.name}`}`;
    };
    const [x, y] = [this.#xs[column]!, this.#ys[row]!];
    const number = value === null ? [" ", element("b", {}, "–")] : measured(value, size, unit);
    this.readout.replaceChildren(element("span", { "data-x": String(x), "data-y": String(y) }, `${name(this.panel.x, x)}, ${name(this.panel.y, y)}:`, ...number));
  }
}
