/** Figures: interactive panels replace the static picture, which is kept for printing. */

import { Curve } from "./curve";
import { button, element } from "./dom";
import { Heat } from "./heat";
import type { Figure, PageData, Panel } from "./page-data";
import { type Frame, type Range, scaled, shifted } from "./panel";
import { Plot } from "./plot";
import type { State } from "./state";
import { caseSwitches } from "./switches";

const KINDS: Record<string, new (data: PageData, panel: Panel, state: State, words: Uint16Array) => Frame> = { heat: Heat, curve: Curve, map: Curve };

/** Makes a figure interactive. `place` is the element with the static picture. */
export function enhance(place: HTMLElement, figure: Figure, data: PageData, state: State, words: Uint16Array): void {
  const plots = figure.panels.map((panel) => new (KINDS[panel.kind ?? ""] ?? Plot)(data, panel, state, words));
  // All panels show the same part of the abscissa.
  const zoom = (range: Range | null) => {
    for (const plot of plots) plot.zoom(range);
  };
  for (const plot of plots) plot.onZoom = zoom;
  const first = plots[0];
  if (first === undefined) return;
  const buttons = [
    button("+", () => zoom(scaled(first.range, 0.5, null)), "Zoom in"),
    button("−", () => zoom(scaled(first.range, 2, null)), "Zoom out"),
    button("‹", () => zoom(shifted(first.range, -0.25, first.isLog)), "Move left"),
    button("›", () => zoom(shifted(first.range, 0.25, first.isLog)), "Move right"),
    button("Show all", () => zoom(null)),
  ];
  const panels = element("div", { className: plots.length > 1 ? "plots several" : "plots" }, ...plots.map((plot) => plot.element));
  const switches = caseSwitches(data, state, "Runs", figure.name);
  place.append(element("div", { className: "interactive" }, switches, element("div", { className: "plot-buttons" }, ...buttons), panels));
  place.classList.add("is-interactive");
}
