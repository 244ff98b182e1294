// Formats messages of FMUs, which are printf formats with arguments.
import type { Memory } from "./memory";

/** Formats a message; `rest` is the address of the arguments. */
export function formatted(memory: Memory, format: number, rest: number): string {
  let at = rest;
  const word = (): number => {
    const value = memory.word(at);
    at += 4;
    return value;
  };
  const double = (): number => {
    at = (at + 7) & ~7;
    const value = memory.now.doubles[at >>> 3] ?? Number.NaN;
    at += 8;
    return value;
  };
  const long = (): bigint => {
    at = (at + 7) & ~7;
    const [low, high] = [word(), word()];
    return BigInt.asIntN(64, (BigInt(high) << 32n) | BigInt(low));
  };
  return memory.text(format).replace(/%[-+ #0]*(\*|\d+)?(?:\.(\*|\d+))?(hh|h|ll|l|z|j|t)?([%a-zA-Z])/g, (_, width, precision, size, kind) => {
    if (kind === "%") return "%";
    if (width === "*") word();
    const digits = precision === "*" ? word() : precision === undefined ? 6 : Number(precision);
    switch (kind) {
      case "s":
        return memory.text(word());
      case "c":
        return String.fromCharCode(word());
      case "d":
      case "i":
        return size === "ll" || size === "j" ? String(long()) : String(word() | 0);
      case "u":
        return size === "ll" || size === "j" ? String(BigInt.asUintN(64, long())) : String(word());
      case "x":
      case "X":
      case "p":
        return word().toString(16);
      case "f":
      case "F":
        return double().toFixed(Math.min(digits, 100));
      case "e":
      case "E":
        return double().toExponential(Math.min(digits, 100));
      case "g":
      case "G":
        return String(Number(double().toPrecision(Math.min(Math.max(digits, 1), 100))));
      default:
        return "";
    }
  });
}
