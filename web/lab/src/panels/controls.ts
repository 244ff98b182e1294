/** Controls that several panels use. */

import { text } from "../../../src/format";
import { element, unitText } from "../dom";
import type { Adjustable } from "../protocol";

/** Steps of a slider over its range. */
const STEPS = 200;

/** A number of a slider as text with its unit. */
export function quantity({ display }: Pick<Adjustable, "display">, value: number): string {
  const unit = unitText(display.unit);
  return `${text(value * display.factor, 4)}${unit === "" ? "" : ` ${unit}`}`;
}

export interface Slider {
  root: HTMLElement;
  input: HTMLInputElement;
  set: (value: number) => void;
}

/** A slider with its value; `onInput` is called while it moves, `onChange` when it stays. */
export function slider(adjustable: Adjustable, value: number, onInput: (value: number) => void, onChange: (value: number) => void = () => {}): Slider {
  const { min, max } = adjustable;
  const input = element("input", { type: "range" });
  // Positions instead of values: the step of a range input rounds values to its grid, and limits have many digits.
  const toPosition = (value: number) => (max > min ? Math.round((STEPS * (value - min)) / (max - min)) : 0);
  const toValue = () => min + ((max - min) * input.valueAsNumber) / STEPS;
  input.min = "0";
  input.max = String(STEPS);
  input.step = "1";
  // The label would name the output, which comes first.
  input.setAttribute("aria-label", adjustable.title);
  const output = element("output");
  const show = (value: number) => {
    output.textContent = quantity(adjustable, value);
    input.setAttribute("aria-valuetext", output.textContent);
  };
  const set = (value: number) => {
    input.value = String(toPosition(value));
    show(value);
  };
  set(value);
  input.addEventListener("input", () => {
    show(toValue());
    onInput(toValue());
  });
  input.addEventListener("change", () => onChange(toValue()));
  const root = element("label", { className: "slider" }, element("span", { textContent: adjustable.title }), output, input);
  return { root, input, set };
}

export function check(title: string, isOn: boolean, change: (isOn: boolean) => void): HTMLLabelElement {
  const box = element("input", { type: "checkbox", checked: isOn });
  box.addEventListener("change", () => change(box.checked));
  return element("label", { className: "check" }, box, element("span", { textContent: title }));
}

export function button(title: string, action: () => void, className = ""): HTMLButtonElement {
  const result = element("button", { type: "button", textContent: title, className });
  result.addEventListener("click", action);
  return result;
}
