/** The metrics of the run, updated while it runs. */

import { element } from "../../../src/dom";
import { text } from "../../../src/format";
import { label } from "../../../src/table";
import { note, region, unitText } from "../dom";
import type { Model } from "../model";
import type { Metric } from "../protocol";

/** Time between two updates while the simulation runs, ms. */
const PERIOD = 1000;
/** Angles are shown in degrees, as in the plots. */
const DEGREES: Record<string, string> = { rad: "deg", "rad/s": "deg/s" };
const VERDICTS = { pass: "✓ pass", fail: "× fail", info: "information" } as const;

function valueText(value: number | boolean | null, factor: number): string {
  if (typeof value === "boolean") return value ? "yes" : "no";
  return value === null ? "–" : text(value * factor, 4);
}

export class MetricsPanel {
  #isWaiting = false;
  #asked = 0;
  #order = 0;
  #isStale = false;
  #shown = "";

  constructor(
    readonly model: Model,
    readonly root: HTMLElement,
  ) {
    this.root.append(note("Metrics appear when the simulation runs."));
    model.on("opened", () => {
      this.#order += 1;
      this.#isWaiting = false;
      this.#isStale = true;
      this.#asked = 0;
    });
    model.on("rows", () => (this.#isStale = true));
    model.on("failed", () => (this.#isStale = true));
  }

  frame(now: number): void {
    if (this.#isWaiting || !this.#isStale || this.model.opened === null) return;
    if (this.model.playing && now < this.#asked + PERIOD) return;
    this.#asked = now;
    this.#isStale = false;
    void this.#ask(this.#order);
  }

  async #ask(order: number): Promise<void> {
    this.#isWaiting = true;
    try {
      const metrics = await this.model.metrics();
      if (order === this.#order) this.#show(metrics);
    } catch (error) {
      if (order === this.#order) this.root.replaceChildren(note(`Metrics cannot be computed: ${(error as Error).message}`));
    } finally {
      if (order === this.#order) this.#isWaiting = false;
    }
  }

  #show(metrics: Metric[]): void {
    const titles = (this.model.opened?.systems ?? []).map((_, i) => this.model.titleOf(i));
    const { opened, end } = this.model;
    // Before the end, metrics can still change: an overshoot can grow, and a course can still be completed.
    const isProvisional = opened !== null && !this.model.hasEnded;
    const remark = isProvisional ? `Provisional: ${end.toFixed(1)} s of at most ${opened.stop.toFixed(1)} s. Verdicts appear at the end.` : "";
    const shown = JSON.stringify([titles, metrics, remark]);
    if (shown === this.#shown) return;
    this.#shown = shown;
    if (metrics.length === 0) {
      this.root.replaceChildren(note("This maneuver has no metrics."));
      return;
    }
    const cell = (title: string, className = "") => element("th", { scope: "col", textContent: title, className });
    const hasVerdicts = !isProvisional && metrics.some(({ verdict }) => verdict !== null);
    const head = element("tr", {}, cell("Metric"), ...titles.map((title) => cell(title, "number")), cell("Unit"), ...(hasVerdicts ? [cell("Verdict")] : []));
    const rows = metrics.map((metric) => {
      const name = element("th", { scope: "row" }, metric.title);
      if (metric.definition !== "") name.append(element("small", { textContent: metric.definition }));
      const factor = DEGREES[metric.unit] === undefined ? 1 : 180 / Math.PI;
      const values = titles.map((_, i) => {
        const value = metric.values[i] ?? null;
        const result = element("td", { className: isProvisional ? "number provisional" : "number", textContent: valueText(value, factor) });
        if (value === null && metric.reason !== "") result.append(element("small", { textContent: metric.reason }));
        return result;
      });
      const badge = metric.verdict === null ? "" : element("span", { className: `badge ${metric.verdict}` }, VERDICTS[metric.verdict]);
      const unit = element("td", { className: "unit" }, unitText(DEGREES[metric.unit] ?? metric.unit));
      return element("tr", {}, name, ...values, unit, ...(hasVerdicts ? [element("td", {}, badge)] : []));
    });
    const table = element("table", { className: "metrics" }, element("thead", {}, head), element("tbody", {}, ...rows));
    const scroll = region("Metrics", "scroll", table);
    // Keeps the scroll position of the table.
    const left = this.root.querySelector(".scroll")?.scrollLeft ?? 0;
    const hadFocus = this.root.contains(document.activeElement);
    this.root.replaceChildren(...(remark === "" ? [] : [note(remark)]), scroll);
    scroll.scrollLeft = left;
    label(table);
    if (hadFocus) scroll.focus({ preventScroll: true });
  }
}
