/** Numbers and units as text. */

import { element } from "./dom";
import type { Axis, Unit } from "./page-data";

const RAISED: Record<string, string> = Object.fromEntries([..."-0123456789"].map((sign, i) => [sign, "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"[i]!]));

/** Formats a number with up to `digits` significant digits, with a typographic minus sign and without trailing zeros. */
export function text(value: number, digits: number): string {
  if (value === 0) return "0";
  const size = Math.abs(value);
  const plain =
    size >= 1e-4 && size < 1e7
      ? String(Number(value.toPrecision(digits)))
      : value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace(/e\+?(-?\d+)/, (_, power: string) => `×10${[...power].map((sign) => RAISED[sign]).join("")}`);
  return plain.replaceAll("-", "−");
}

/** Formats a number in a cell of a heat map, with the same number of significant digits in all cells, including trailing zeros. */
export function cell(value: number): string {
  const plain = value.toPrecision(3);
  return value === 0 || Math.abs(value) < 1e-4 || plain.includes("e") ? text(value, 3) : plain.replace("-", "−");
}

/** Formats a value in a readout: a space, the number in bold, its unit. */
export function measured(value: number, digits: number, unit: Unit): (string | Node)[] {
  return [" ", element("b", {}, text(value, digits)), unit.name === "" ? "" : ` ${unit.name}`];
}

export function axisTitle(axis: Axis, unit: Unit): string {
  return `${axis.title} (${unit.name === "" ? "–" : unit.name})`;
}

/** Returns a range with free space on both sides; on a logarithmic axis, the space is a ratio. */
export function withRoom(low: number, high: number, log: boolean, share = 0.06): [number, number] {
  if (!(low <= high)) return log ? [1, 10] : [0, 1];
  if (log) return low < high ? [low * (low / high) ** share, high * (high / low) ** share] : [low / 2, high * 2];
  const room = high > low ? share * (high - low) : Math.abs(high) || 1;
  return [low - room, high + room];
}

/** Converts a value from the unit of the data to a display unit. */
export function convert(value: number, unit: Unit): number {
  return value * unit.factor + unit.offset;
}

/** Converts a value from a display unit to the unit of the data. */
export function revert(value: number, unit: Unit): number {
  return (value - unit.offset) / unit.factor;
}
