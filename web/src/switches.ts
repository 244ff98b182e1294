/** The switches above the figures: cases, seeds, units. */

import { group, toggle } from "./controls";
import type { PageData } from "./page-data";
import type { State } from "./state";

/** More seeds than this have one list instead of a switch each. */
const FEW_SEEDS = 12;

function put<T>(set: Set<T>, value: T, on: boolean): void {
  if (on) set.add(value);
  else set.delete(value);
}

/** The bar of switches; empty if there is nothing to switch. */
export function switches(data: PageData, state: State): HTMLElement {
  const bar = document.createElement("div");
  bar.className = "switches";
  const lines = data.figures.flatMap((figure) => figure.panels.flatMap((panel) => panel.lines));
  const cases = data.cases.filter((one) => lines.some((line) => line.case === one.name));
  if (cases.length > 1) {
    const toggles = cases.map((one) => {
      const element = toggle(one.title, one.title, true, (on) => state.change(() => put(state.cases, one.name, on)));
      const key = document.createElement("i");
      key.className = "plot-key";
      key.style.background = `var(--series-${one.color})`;
      element.prepend(key);
      return element;
    });
    bar.append(group("Cases", toggles));
  }
  const seeds = data.seeds.filter((seed) => lines.some((line) => line.seed === seed));
  if (seeds.length > 1) {
    const mean = toggle("mean ± deviation", "mean ± deviation over the seeds", state.mean, (on) => state.change(() => (state.mean = on)));
    const one = (seed: number) =>
      toggle(String(seed), `seed ${seed}`, state.seeds.has(seed), (on) => state.change(() => put(state.seeds, seed, on)));
    bar.append(group("Seeds", [...(lines.some((line) => line.kind === "mean") ? [mean] : []), ...seeds.slice(0, FEW_SEEDS).map(one)]));
  }
  if (data.figures.some((figure) => figure.panels.some((panel) => panel.y.units.length > 1))) {
    bar.append(group("Units", [toggle("SI", "SI base units", state.base, (on) => state.change(() => (state.base = on)))]));
  }
  return bar;
}
