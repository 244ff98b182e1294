/** The switches above the figures: cases, seeds, units. */

import { group, toggle } from "./controls";
import type { PageData } from "./page-data";
import { DASHES, lineKey } from "./panel";
import type { State } from "./state";

/** More seeds than this have one list instead of a switch each. */
const FEW_SEEDS = 12;

function put<T>(set: Set<T>, value: T, on: boolean): void {
  if (on) set.add(value);
  else set.delete(value);
}

function seedToggle(seed: number, state: State): HTMLElement {
  return toggle(String(seed), `seed ${seed}`, state.seeds.has(seed), (on) => state.change(() => put(state.seeds, seed, on)));
}

/** A list to choose one seed of many from, or none. */
function seedList(seeds: number[], state: State): HTMLElement {
  const list = document.createElement("select");
  list.setAttribute("aria-label", "Seed");
  list.append(new Option("none", ""), ...seeds.map((seed) => new Option(String(seed), String(seed))));
  list.value = String([...state.seeds][0] ?? "");
  list.addEventListener("change", () => {
    state.change(() => {
      state.seeds.clear();
      if (list.value !== "") state.seeds.add(Number(list.value));
    });
  });
  return list;
}

/** A bar with switches of the cases of one figure, or of those of the page; empty if there is nothing to switch. */
export function caseSwitches(data: PageData, state: State, title: string, figure?: string): HTMLElement {
  const bar = document.createElement("div");
  bar.className = "switches";
  const lines = data.figures.flatMap((one) => one.panels.flatMap((panel) => panel.lines));
  const cases = data.cases.filter((one) => one.figure === figure && lines.some((line) => line.case === one.name));
  const toggles = cases.map((one) => {
    const element = toggle(one.title, one.title, true, (on) => state.change(() => put(state.cases, one.name, on)));
    element.prepend(lineKey(`var(--series-${one.color})`, DASHES[one.dash] ?? []));
    return element;
  });
  if (toggles.length > 1) bar.append(group(title, toggles));
  return bar;
}

/** The bar of switches of the page. */
export function switches(data: PageData, state: State): HTMLElement {
  const bar = caseSwitches(data, state, "Cases");
  const lines = data.figures.flatMap((figure) => figure.panels.flatMap((panel) => panel.lines));
  const seeds = data.seeds.filter((seed) => lines.some((line) => line.seed === seed));
  if (seeds.length > 1) {
    const mean = toggle("mean ± deviation", "mean ± deviation over the seeds", state.mean, (on) => state.change(() => (state.mean = on)));
    const all = seeds.length <= FEW_SEEDS ? seeds.map((seed) => seedToggle(seed, state)) : [seedList(seeds, state)];
    bar.append(group("Seeds", [...(lines.some((line) => line.kind === "mean") ? [mean] : []), ...all]));
    if (seeds.length < data.seeds.length) {
      const rest = document.createElement("small");
      rest.textContent = `The page has ${seeds.length} of ${data.seeds.length} seeds one by one; mean and deviation are of all.`;
      bar.append(rest);
    }
  }
  if (data.figures.some((figure) => figure.panels.some((panel) => panel.y.units.length > 1))) {
    bar.append(group("Units", [toggle("SI", "SI base units", state.base, (on) => state.change(() => (state.base = on)))]));
  }
  return bar;
}
