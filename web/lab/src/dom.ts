/** Helpers for HTML elements. */

import { element } from "../../src/dom";

/** Returns an element of index.html by its id. */
export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (found === null) throw new Error(`the page has no #${id}`);
  return found as T;
}

interface Choice {
  value: string;
  title: string;
  /** Title of the option's group; empty if it is in no group. */
  group?: string;
}

/** Replaces the options of a select. Groups are in the order of their first option. */
export function fill(select: HTMLSelectElement, options: Choice[], value: string): void {
  const groups = new Map<string, HTMLElement>([["", select]]);
  select.replaceChildren();
  for (const { value, title, group: name = "" } of options) {
    const group = groups.get(name) ?? element("optgroup", { label: name });
    if (!groups.has(name)) select.append(group);
    groups.set(name, group);
    group.append(new Option(title, value));
  }
  select.value = value;
}

let fields = 0;

/** Makes a control with a label above it. */
export function field(title: string, control: HTMLElement): HTMLElement {
  if (control.id === "") control.id = `field-${++fields}`;
  return element("div", { className: "field" }, element("label", { textContent: title, htmlFor: control.id }), control);
}

/** Whether a key press is meant for a control of the page, not for the vehicle. */
export function isControl(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.closest("input, select, textarea, button, a, summary, [role=tab]") !== null;
}

/** Formats a unit; empty for a dimensionless number. */
export const unitText = (unit: string): string =>
  unit === "1" ? "" : unit.replaceAll(/([A-Za-z)])2/g, "$1²").replaceAll(/([A-Za-z)])3/g, "$1³").replaceAll(".", "·");

/** Whether a text contains all words of a search. */
export function isFound(search: string, text: string): boolean {
  return search.toLowerCase().split(/\s+/).every((word) => text.toLowerCase().includes(word));
}

export function download(name: string, content: Uint8Array): void {
  const url = URL.createObjectURL(new Blob([content as Uint8Array<ArrayBuffer>]));
  element("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

/** Makes a scrollable region with a label for screen readers. */
export function region(label: string, className: string, content: HTMLElement): HTMLElement {
  return element("div", { className, tabIndex: 0, role: "region", "aria-label": label }, content);
}

export const note = (text: string): HTMLElement => element("p", { className: "note" }, text);

export const darkMode = matchMedia("(prefers-color-scheme: dark)");
export const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");
