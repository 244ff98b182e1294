/** Numbers beside axes. */

import type uPlot from "uplot";
import { text } from "./format";
import type { Axis } from "./page-data";

/** Returns multiples of powers of ten within a range. */
export function logTicks(low: number, high: number): number[] {
  const decades = Math.log10(high / low);
  const factors = decades > 3 ? [1] : decades > 0.8 ? [1, 2, 5] : [1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9];
  const [first, last] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
  const every = Math.ceil(decades / 8);
  const powers = Array.from({ length: last - first + 1 }, (_, i) => first + i).filter((power) => every < 2 || power % every === 0);
  return powers.flatMap((power) => factors.map((factor) => Number(`${factor}e${power}`))).filter((tick) => tick >= low && tick <= high);
}

export function ticks({ log }: Axis): Pick<uPlot.Axis, "values" | "splits" | "filter"> {
  const values = (_: uPlot, splits: number[]) => splits.map((tick) => text(tick, 6));
  return log ? { values, splits: (_plot, _axis, low, high) => logTicks(low, high), filter: (_plot, splits) => splits } : { values };
}
