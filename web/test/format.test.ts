/** Numbers as text. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { cell } from "../src/format";

test("cells of a heat map have as many digits as each other", () => {
  const found = [86, 86.3, 100, -0.5, 0.0237, 0, 12345, 0.00001234].map(cell);
  assert.deepEqual(found, ["86.0", "86.3", "100", "−0.500", "0.0237", "0", "12300", "1.23e−5"]);
});
