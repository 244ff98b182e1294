/** Documentation and variables of the system's FMUs. */

import { element } from "../../../src/dom";
import { label } from "../../../src/table";
import { field, fill, isFound, note, region } from "../dom";
import { isOurs, part, summary } from "../library";
import type { Model } from "../model";
import type { VariableInfo } from "../protocol";

/** Elements that are allowed in the documentation of an FMU. All others are removed, because the HTML comes from a file. */
const ALLOWED = new Set("A B BLOCKQUOTE BR CODE DD DIV DL DT EM H1 H2 H3 H4 H5 H6 HR I IMG LI OL P PRE SPAN STRONG SUB SUP TABLE TBODY TD TH THEAD TR UL".split(" "));

/** Returns the documentation of an FMU without scripts, styles and links to missing files. */
function cleaned(html: string, picture: string): HTMLElement {
  const { body } = new DOMParser().parseFromString(html, "text/html");
  for (const one of [...body.querySelectorAll("*")]) {
    if (!ALLOWED.has(one.tagName)) {
      one.remove();
      continue;
    }
    const [target, alternative] = [one.getAttribute("href") ?? "", one.getAttribute("alt") ?? ""];
    for (const { name } of [...one.attributes]) if (!["colspan", "rowspan", "class"].includes(name)) one.removeAttribute(name);
    if (one.tagName === "A" && /^https:/.test(target)) one.setAttribute("href", target);
    if (one.tagName === "PRE") one.setAttribute("tabindex", "0");
    if (one.tagName !== "IMG") continue;
    if (picture === "") one.remove();
    else one.replaceWith(element("img", { src: `data:image/png;base64,${picture}`, alt: alternative, loading: "lazy" }));
  }
  // Headings are moved to lower levels, below the headings of the page.
  const result = element("div", { className: "documentation" });
  for (const child of [...body.childNodes]) result.append(document.adoptNode(child));
  for (const heading of result.querySelectorAll("h1, h2, h3, h4")) {
    const level = Math.min(6, Number(heading.tagName[1]) + 2);
    heading.replaceWith(element(`h${level}` as "h3", {}, ...heading.childNodes));
  }
  for (const table of result.querySelectorAll("table")) {
    const scroll = element("div", { className: "scroll", tabIndex: 0 });
    table.replaceWith(scroll);
    scroll.append(table);
    label(table);
  }
  return result;
}

export class ReaderPanel {
  readonly #select = element("select");
  readonly #part = element("select");
  readonly #search = element("input", { type: "search", placeholder: "Find a variable", "aria-label": "Find a variable by its name or description", oninput: () => this.#showVariables() });
  readonly #body = element("div");
  #variables: VariableInfo[] = [];
  #order = 0;

  constructor(
    readonly model: Model,
    root: HTMLElement,
    tools: HTMLElement,
  ) {
    fill(this.#part, [{ value: "documentation", title: "Documentation and equations" }, { value: "variables", title: "Variables" }], "documentation");
    this.#select.onchange = this.#part.onchange = () => void this.#show();
    tools.append(field("FMU", this.#select), field("Show", this.#part));
    root.append(this.#search, this.#body);
    model.on("opened", () => this.#open());
  }

  #open(): void {
    const systems = this.model.opened?.systems ?? [];
    const fmus = [...new Set(systems.flatMap(({ components }) => components.map(({ fmu }) => fmu)))];
    const kept = fmus.includes(this.#select.value) ? this.#select.value : (fmus.find((fmu) => fmu === systems[0]?.vehicle) ?? fmus[0] ?? "");
    const isSame = kept === this.#select.value && this.#body.childElementCount > 0;
    fill(this.#select, fmus.map((fmu) => ({ value: fmu, title: fmu })), kept);
    if (!isSame) void this.#show();
  }

  async #show(): Promise<void> {
    const order = ++this.#order;
    const fmu = this.#select.value;
    if (fmu === "") return;
    const isVariables = this.#part.value === "variables" || !isOurs(fmu);
    this.#search.hidden = !isVariables;
    try {
      if (isVariables) {
        const variables = await this.model.describe(fmu);
        if (order !== this.#order) return;
        this.#variables = variables;
        this.#showVariables();
      } else {
        const { html, picture } = await part(fmu, "documentation");
        if (order !== this.#order) return;
        this.#body.replaceChildren(html === "" ? note(`${fmu} has no documentation.`) : region(`Documentation of ${fmu}`, "text", cleaned(html, picture)));
      }
    } catch (error) {
      if (order === this.#order) this.#body.replaceChildren(note((error as Error).message));
    }
  }

  #showVariables(): void {
    const found = this.#variables.filter(({ name, description, causality }) => isFound(this.#search.value, `${name} ${description} ${causality}`));
    const head = ["Name", "Causality", "Start", "Unit", "Description"].map((title) => element("th", { scope: "col", textContent: title }));
    const rows = found.map(({ name, causality, start, unit, description }) =>
      element("tr", {}, element("th", { scope: "row" }, element("code", { textContent: name })), ...[causality, start, unit, description].map((text) => element("td", { textContent: text }))),
    );
    const table = element("table", {}, element("thead", {}, element("tr", {}, ...head)), element("tbody", {}, ...rows));
    label(table);
    const about = isOurs(this.#select.value) ? "" : `${summary(this.#select.value)} `;
    this.#body.replaceChildren(note(`${about}${found.length} of ${this.#variables.length} variables`), region("Variables", "scroll variables", table));
  }
}
