/** Helpers for HTML elements and colors. */

type Attributes = { [name: `aria-${string}` | `data-${string}`]: string; role?: string };

export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  properties: Partial<Omit<HTMLElementTagNameMap[K], "style" | "role">> & Attributes = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const result = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name === "role" || name.includes("-")) result.setAttribute(name, value as string);
    else Object.assign(result, { [name]: value });
  }
  result.append(...children);
  return result;
}

/** Makes a button. `label`, for screen readers and as a tooltip, must contain `text`. */
export function button(text: string, action: () => void, label = text): HTMLButtonElement {
  const hint = label === text ? {} : { "aria-label": label, title: label };
  return element("button", { type: "button", textContent: text, onclick: action, ...hint });
}

export function toggle(text: string, label: string, on: boolean, change: (on: boolean) => void): HTMLButtonElement {
  const result = button(text, () => {
    const now = result.getAttribute("aria-pressed") !== "true";
    result.setAttribute("aria-pressed", String(now));
    change(now);
  }, label);
  result.setAttribute("aria-pressed", String(on));
  return result;
}

export function group(title: string, controls: HTMLElement[]): HTMLElement {
  return element("div", { className: "group", role: "group", "aria-label": title }, element("span", {}, title), ...controls);
}

export function color(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}
