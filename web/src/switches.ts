/** The switches above the figures: cases, seeds, units. */

import { element, group, toggle } from "./dom";
import type { PageData } from "./page-data";
import { DASHES, lineKey } from "./panel";
import type { State } from "./state";

/** With more seeds than this, a list replaces the switches. */
const FEW_SEEDS = 12;

function put<T>(set: Set<T>, value: T, on: boolean): void {
  if (on) set.add(value);
  else set.delete(value);
}

function seedToggle(seed: number, state: State): HTMLElement {
  return toggle(String(seed), `seed ${seed}`, state.seeds.has(seed), (on) => state.change(() => put(state.seeds, seed, on)));
}

/** Makes a list to choose one seed or none. */
function seedList(seeds: number[], state: State): HTMLElement {
  const change = () => {
    state.seeds.clear();
    if (list.value !== "") state.seeds.add(Number(list.value));
  };
  const options = [new Option("none", ""), ...seeds.map((seed) => new Option(String(seed), String(seed)))];
  const list = element("select", { "aria-label": "Seed", onchange: () => state.change(change) }, ...options);
  list.value = String([...state.seeds][0] ?? "");
  return list;
}

/** Makes a bar with switches for the cases of a figure or of the page; empty if there is nothing to switch. */
export function caseSwitches(data: PageData, state: State, title: string, figure?: string): HTMLElement {
  const lines = data.figures.flatMap((one) => one.panels.flatMap((panel) => panel.lines));
  const cases = data.cases.filter((one) => one.figure === figure && lines.some((line) => line.case === one.name));
  const toggles = cases.map((one) => {
    const result = toggle(one.title, one.title, true, (on) => state.change(() => put(state.cases, one.name, on)));
    result.prepend(lineKey(`var(--series-${one.color})`, DASHES[one.dash] ?? []));
    return result;
  });
  return element("div", { className: "switches" }, ...(toggles.length > 1 ? [group(title, toggles)] : []));
}

export function switches(data: PageData, state: State): HTMLElement {
  const bar = caseSwitches(data, state, "Cases");
  const lines = data.figures.flatMap((figure) => figure.panels.flatMap((panel) => panel.lines));
  const seeds = data.seeds.filter((seed) => lines.some((line) => line.seed === seed));
  if (seeds.length > 1) {
    const mean = toggle("mean ± deviation", "mean ± deviation over the seeds", state.mean, (on) => state.change(() => (state.mean = on)));
    const all = seeds.length <= FEW_SEEDS ? seeds.map((seed) => seedToggle(seed, state)) : [seedList(seeds, state)];
    bar.append(group("Seeds", [...(lines.some((line) => line.kind === "mean") ? [mean] : []), ...all]));
    if (seeds.length < data.seeds.length) {
      bar.append(element("small", {}, `The page contains the single runs of ${seeds.length} of ${data.seeds.length} seeds; mean and deviation use all.`));
    }
  }
  if (data.figures.some((figure) => figure.panels.some((panel) => panel.y.units.length > 1))) {
    bar.append(group("Units", [toggle("SI", "SI base units", state.base, (on) => state.change(() => (state.base = on)))]));
  }
  return bar;
}
