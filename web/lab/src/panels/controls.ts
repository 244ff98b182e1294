/** Controls that several panels use. */

import { element } from "../../../src/dom";
import { text } from "../../../src/format";
import { unitText } from "../dom";
import type { Adjustable } from "../protocol";

/** Steps of a slider over its range. */
const STEPS = 200;

export interface Slider {
  root: HTMLElement;
  input: HTMLInputElement;
  set: (value: number) => void;
}

/** Makes a slider that shows its value. `onInput` is called while it moves, `onChange` after the movement. */
export function slider(adjustable: Adjustable, value: number, onInput: (value: number) => void, onChange: (value: number) => void = () => {}): Slider {
  const { min, max, display, title } = adjustable;
  // The input has positions instead of values, because a range input rounds values to its step, and limits can have
  // many digits.
  const toPosition = (value: number) => (max > min ? Math.round((STEPS * (value - min)) / (max - min)) : 0);
  const toValue = () => min + ((max - min) * input.valueAsNumber) / STEPS;
  // Without aria-label, the label would belong to the output, which precedes the input.
  const input = element("input", { type: "range", min: "0", max: String(STEPS), step: "1", "aria-label": title, onchange: () => onChange(toValue()) });
  const output = element("output");
  const show = (value: number) => {
    output.textContent = `${text(value * display.factor, 4)} ${unitText(display.unit)}`.trim();
    input.setAttribute("aria-valuetext", output.textContent);
  };
  const set = (value: number) => {
    input.value = String(toPosition(value));
    show(value);
  };
  set(value);
  input.oninput = () => {
    show(toValue());
    onInput(toValue());
  };
  return { root: element("label", { className: "slider" }, element("span", {}, title), output, input), input, set };
}

export function check(title: string, isOn: boolean, change: (isOn: boolean) => void): HTMLLabelElement {
  const box = element("input", { type: "checkbox", checked: isOn, onchange: () => change(box.checked) });
  return element("label", { className: "check" }, box, element("span", {}, title));
}
