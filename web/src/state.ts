/** State of the page's switches, which applies to all figures. */

import type { Line, PageData } from "./page-data";

export class State {
  readonly cases = new Set<string>();
  readonly seeds = new Set<number>();
  /** Whether the means over the seeds are shown, with their spread. */
  mean: boolean;
  base = false;
  readonly #listeners: (() => void)[] = [];
  readonly #watchers: ((time: number | null, source: object) => void)[] = [];

  constructor(data: PageData) {
    for (const one of data.cases) this.cases.add(one.name);
    const first = data.seeds[0];
    this.mean = first === undefined;
    if (first !== undefined) this.seeds.add(first);
  }

  listen(listener: () => void): void {
    this.#listeners.push(listener);
  }

  change(what: () => void): void {
    what();
    for (const listener of this.#listeners) listener();
  }

  /** Calls a function with the time (s) of the cursor in a plot without a time axis, `source`; null when the cursor is removed. */
  watch(watcher: (time: number | null, source: object) => void): void {
    this.#watchers.push(watcher);
  }

  /** Reports the time of the cursor in a plot without a time axis to the watchers. */
  point(time: number | null, source: object): void {
    for (const watcher of this.#watchers) watcher(time, source);
  }

  shows(line: Line): boolean {
    if (line.case !== null && !this.cases.has(line.case)) return false;
    if (line.kind === "mean") return this.mean;
    return line.seed === null || this.seeds.has(line.seed);
  }
}
