/** A figure: its panels instead of the static picture, which stays for print. */

import { button } from "./controls";
import { Curve } from "./curve";
import { Heat } from "./heat";
import type { Figure, PageData } from "./page-data";
import { type Range, type View, scaled, shifted } from "./panel";
import { Plot } from "./plot";
import type { State } from "./state";
import { caseSwitches } from "./switches";

/** Makes a figure interactive. `place` is the element with the static picture. */
export function enhance(place: HTMLElement, figure: Figure, data: PageData, state: State, words: Uint16Array): void {
  const view = (panel: Figure["panels"][number]): View => {
    if (panel.kind === "heat") return new Heat(data, panel, state, words);
    return new (panel.kind === "curve" || panel.kind === "map" ? Curve : Plot)(data, panel, state, words);
  };
  const plots = figure.panels.map(view);
  // All panels show the same part of the abscissa.
  const zoom = (range: Range | null) => {
    for (const plot of plots) plot.zoom(range);
  };
  for (const plot of plots) plot.onZoom = zoom;
  const first = plots[0];
  if (first === undefined) return;
  const buttons = document.createElement("div");
  buttons.className = "plot-buttons";
  buttons.append(
    button("+", "Zoom in", () => zoom(scaled(first.range, 0.5, null))),
    button("−", "Zoom out", () => zoom(scaled(first.range, 2, null))),
    button("‹", "Move left", () => zoom(shifted(first.range, -0.25, first.isLog))),
    button("›", "Move right", () => zoom(shifted(first.range, 0.25, first.isLog))),
    button("Show all", "Show all", () => zoom(null)),
  );
  const panels = document.createElement("div");
  panels.className = plots.length > 1 ? "plots several" : "plots";
  panels.append(...plots.map((plot) => plot.element));
  const interactive = document.createElement("div");
  interactive.className = "interactive";
  interactive.append(caseSwitches(data, state, "Runs", figure.name), buttons, panels);
  place.append(interactive);
  place.classList.add("is-interactive");
}
