/** The runs in the plots and the view: the visitor's run, its twin, and older branches. */

import type { Model } from "./model";

export interface Trace {
  /** Identifier that does not change, so the switches of the legend can refer to it. */
  key: string;
  title: string;
  system: number;
  branch: number;
  /** Name of the color in the page's style. */
  color: string;
  isOwn: boolean;
}

/** Maximum number of branches that are drawn: the latest ones. */
const BRANCHES = 4;

export class Traces {
  readonly hidden = new Set<string>();
  /** Key of the trace that the view shows for comparison; empty for none. */
  beside = "twin";

  constructor(readonly model: Model) {
    model.on("opened", () => {
      this.beside = this.all.some(({ key }) => key === "twin") ? "twin" : "";
      this.hidden.clear();
    });
  }

  get all(): Trace[] {
    const { opened, branch, branches } = this.model;
    const traces: Trace[] = [];
    if (opened === null) return traces;
    traces.push({ key: "own", title: this.model.titleOf(0), system: 0, branch, color: "own", isOwn: true });
    if (opened.systems.length > 1) traces.push({ key: "twin", title: this.model.titleOf(1), system: 1, branch, color: "twin", isOwn: false });
    branches
      .filter(({ id }) => id !== branch)
      .slice(-BRANCHES)
      .forEach(({ id }) => {
        const next = branches[branches.findIndex((one) => one.id === id) + 1];
        const left = next === undefined ? "" : `, left at ${next.from.toFixed(1)} s`;
        traces.push({ key: `branch ${id}`, title: `Branch ${id + 1}${left}`, system: 0, branch: id, color: `branch-${id % BRANCHES}`, isOwn: false });
      });
    return traces;
  }

  get shown(): Trace[] {
    return this.all.filter(({ key }) => !this.hidden.has(key));
  }

  get besideTrace(): Trace | null {
    return this.all.find(({ key, isOwn }) => !isOwn && key === this.beside) ?? null;
  }
}
