/** Sliders for tunable parameters and inputs, which act while the simulation runs. */

import { button, element } from "../../../src/dom";
import { isFound, note } from "../dom";
import type { Model } from "../model";
import type { Adjustable } from "../protocol";
import { type Slider, slider } from "./controls";

/** With more sliders than this, there is a search field. */
const MANY = 8;
/** Important values, whose sliders are below the view. */
const QUICK = /:(road_friction(\..*)?|tire\.friction|driver\.speed)$/;

export class AdjustPanel {
  readonly #sliders = new Map<string, Slider>();
  readonly #search = element("input", { type: "search", placeholder: "Find a value", "aria-label": "Find a value by its name", oninput: () => this.#filter() });
  readonly #list = element("div", { className: "sliders" });
  readonly #reset = button("Reset", () => this.#resetAll());

  constructor(
    readonly model: Model,
    readonly root: HTMLElement,
    tools: HTMLElement,
    /** Place of the friction and of a prescribed speed, below the view. */
    readonly quick: HTMLElement,
  ) {
    this.#reset.title = "Sets all values to their start values";
    tools.append(this.#reset);
    root.append(this.#search, this.#list);
    model.on("opened", () => this.#open());
    model.on("value", () => (this.#reset.disabled = this.model.changed.size === 0));
  }

  /** Adjustables of the first system. Values that only the second system has cannot be changed. */
  get #adjustables(): Adjustable[] {
    return this.model.opened?.systems[0]?.adjustables ?? [];
  }

  #open(): void {
    this.#sliders.clear();
    this.#list.replaceChildren();
    this.quick.replaceChildren();
    const components = new Map<string, Adjustable[]>();
    for (const adjustable of this.#adjustables) {
      if (QUICK.test(adjustable.id)) {
        this.quick.append(this.#slider(adjustable));
        continue;
      }
      const component = adjustable.id.split(":")[0]!;
      const list = components.get(component) ?? [];
      list.push(adjustable);
      components.set(component, list);
    }
    const fmus = new Map(this.model.opened?.systems[0]?.components.map(({ name, fmu }) => [name, fmu]));
    for (const [component, adjustables] of components) {
      const head = element("summary", {}, element("b", {}, fmus.get(component) ?? component), element("small", {}, ` ${adjustables.length}`));
      const open = this.#list.childElementCount === 0;
      this.#list.append(element("details", { open }, head, ...adjustables.map((adjustable) => this.#slider(adjustable))));
    }
    const count = this.#adjustables.length;
    if (count === 0) this.#list.append(note("This system has no values that can be changed while it runs."));
    this.#search.hidden = count <= MANY;
    this.#reset.hidden = count === 0;
    this.#reset.disabled = this.model.changed.size === 0;
    this.#filter();
  }

  #slider(adjustable: Adjustable): HTMLElement {
    const one = slider(adjustable, this.model.changed.get(adjustable.id) ?? adjustable.value, (value) => this.model.set(adjustable.id, value));
    one.root.dataset["id"] = adjustable.id;
    this.#sliders.set(adjustable.id, one);
    return one.root;
  }

  #filter(): void {
    const search = this.#search.hidden ? "" : this.#search.value.trim();
    for (const group of this.#list.querySelectorAll("details")) {
      let count = 0;
      for (const label of group.querySelectorAll<HTMLElement>(".slider")) {
        label.hidden = !isFound(search, `${label.dataset["id"]} ${label.textContent}`);
        if (!label.hidden) count += 1;
      }
      group.hidden = count === 0;
      if (search !== "") group.open = count > 0;
    }
  }

  #resetAll(): void {
    for (const adjustable of this.#adjustables) {
      if (!this.model.changed.has(adjustable.id)) continue;
      this.model.set(adjustable.id, adjustable.value);
      this.#sliders.get(adjustable.id)?.set(adjustable.value);
    }
    this.model.changed.clear();
    this.#reset.disabled = true;
  }
}
