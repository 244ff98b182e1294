/** Elements of the page. */

type Children = (Node | string)[];

/** An element with properties and children. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Partial<Omit<HTMLElementTagNameMap[K], "style">> = {},
  ...children: Children
): HTMLElementTagNameMap[K] {
  const result = Object.assign(document.createElement(tag), properties);
  result.append(...children);
  return result;
}

/** The element of the page's HTML with an id. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`the page has no #${id}`);
  return found as T;
}

export interface Option {
  value: string;
  title: string;
  /** Title of its group; empty for none. */
  group?: string;
}

/** Replaces the options of a select, in the groups of their first appearance. */
export function fill(select: HTMLSelectElement, options: Option[], value: string): void {
  const groups = new Map<string, HTMLElement>();
  select.replaceChildren();
  for (const option of options) {
    const entry = element("option", { value: option.value, textContent: option.title });
    const name = option.group ?? "";
    if (name === "") {
      select.append(entry);
      continue;
    }
    let group = groups.get(name);
    if (group === undefined) {
      group = element("optgroup", { label: name });
      groups.set(name, group);
      select.append(group);
    }
    group.append(entry);
  }
  select.value = value;
}

let fields = 0;

/** A label above a control. */
export function field(title: string, control: HTMLElement): HTMLElement {
  if (control.id === "") control.id = `field-${++fields}`;
  return element("div", { className: "field" }, element("label", { textContent: title, htmlFor: control.id }), control);
}

/** Whether a key press belongs to a control, not to the vehicle. */
export function isControl(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.closest("input, select, textarea, button, a, summary, [role=tab]") !== null;
}

/** A unit as it is shown: numbers without a dimension have none. */
export const unitText = (unit: string): string =>
  unit === "1" ? "" : unit.replaceAll(/([A-Za-z)])2/g, "$1²").replaceAll(/([A-Za-z)])3/g, "$1³").replaceAll(".", "·");

/** A file for the visitor. */
export function download(name: string, content: Uint8Array): void {
  const url = URL.createObjectURL(new Blob([content as Uint8Array<ArrayBuffer>]));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** A color of the page's style. */
export function color(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

export const darkMode = matchMedia("(prefers-color-scheme: dark)");
export const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");
