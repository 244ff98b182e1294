/** Numbers and units as text. */

import type { Axis, Unit } from "./page-data";

/** A number with so many significant digits, with a true minus sign and without zeros at the end. */
export function text(value: number, digits: number): string {
  if (value === 0) return "0";
  const size = Math.abs(value);
  const plain =
    size >= 1e-4 && size < 1e7
      ? String(Number(value.toPrecision(digits)))
      : value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e");
  return plain.replaceAll("-", "−");
}

/** A number in a cell of a heat map: of as many significant digits as in the other cells, zeros at the end too. */
export function cell(value: number): string {
  const plain = value.toPrecision(3);
  return value === 0 || Math.abs(value) < 1e-4 || plain.includes("e") ? text(value, 3) : plain.replace("-", "−");
}

/** The title of an axis with its unit. */
export function axisTitle(axis: Axis, unit: Unit): string {
  if (axis.title === "") return unit.name;
  return unit.name === "" ? axis.title : `${axis.title} (${unit.name})`;
}

/** A value in a unit. */
export function convert(value: number, unit: Unit): number {
  return value * unit.factor + unit.offset;
}

/** What a value in a unit is in the unit of the data. */
export function revert(value: number, unit: Unit): number {
  return (value - unit.offset) / unit.factor;
}
