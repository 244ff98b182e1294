/** Formatting of numbers. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { cell, withRoom } from "../src/format";
import { logTicks } from "../src/ticks";

test("cells of a heat map have as many digits as each other", () => {
  const found = [86, 86.3, 100, -0.5, 0.0237, 0, 12345, 0.00001234].map(cell);
  assert.deepEqual(found, ["86.0", "86.3", "100", "−0.500", "0.0237", "0", "12300", "1.23×10⁻⁵"]);
});

test("logarithmic axes have round numbers, and no empty decades", () => {
  assert.deepEqual(logTicks(0.19, 0.9), [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9]);
  assert.deepEqual(logTicks(0.3, 40), [0.5, 1, 2, 5, 10, 20]);
  assert.deepEqual(logTicks(3e-5, 2e3), [1e-4, 1e-3, 0.01, 0.1, 1, 10, 100, 1000]);
  const [low, high] = withRoom(2, 30, true);
  assert.ok(low > 1.5 && low < 2 && high > 30 && high < 40, `${low} ${high}`);
});
