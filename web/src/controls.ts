/** Buttons and switches. */

/** A button that does something. The label, for screen readers and as a hint, contains the text. */
export function button(text: string, label: string, action: () => void): HTMLButtonElement {
  const element = document.createElement("button");
  element.type = "button";
  element.textContent = text;
  if (label !== text) {
    element.setAttribute("aria-label", label);
    element.title = label;
  }
  element.addEventListener("click", action);
  return element;
}

/** A button that is on or off. */
export function toggle(text: string, label: string, on: boolean, change: (on: boolean) => void): HTMLButtonElement {
  const element = button(text, label, () => {
    const now = element.getAttribute("aria-pressed") !== "true";
    element.setAttribute("aria-pressed", String(now));
    change(now);
  });
  element.setAttribute("aria-pressed", String(on));
  return element;
}

/** Controls that belong together, with a title. */
export function group(title: string, controls: HTMLElement[]): HTMLElement {
  const element = document.createElement("div");
  element.className = "group";
  element.setAttribute("role", "group");
  element.setAttribute("aria-label", title);
  const name = document.createElement("span");
  name.textContent = title;
  element.append(name, ...controls);
  return element;
}
