/** The page of a linear model in a browser. Reference: the table of modes on the page, which does not depend on the code of the plots. */

import assert from "node:assert/strict";
import { test } from "node:test";
import type { BrowserContextOptions } from "playwright-core";
import { Results, catchCopies, hover, number, range } from "./browser";

const results = new Results(process.env["CHASSIS_FMU_LINEARIZE"] ?? "../results/linearize");
const open = (options?: BrowserContextOptions) => results.open(options);

test("the modes are sorted by a click and copied", async () => {
  const page = await open();
  const table = page.locator("table.results");
  const frequencies = async () => (await table.locator("tbody td:nth-child(2)").allInnerTexts()).map(number);
  const given = await frequencies();
  assert.ok(given.length > 3);
  await table.getByRole("button", { name: "Frequency (Hz)" }).click();
  assert.deepEqual(await frequencies(), [...given].sort((a, b) => a - b));
  // A pole at 0 has a dash instead of a damping ratio, which is sorted after the numbers in both directions.
  const damping = async () => (await table.locator("tbody td:nth-child(3)").allInnerTexts()).map(number);
  for (const direction of [1, -1]) {
    await table.getByRole("button", { name: "Damping" }).click();
    const values = await damping();
    const known = values.filter((value) => !Number.isNaN(value));
    assert.ok(known.length < values.length);
    assert.deepEqual(values.slice(0, known.length), known);
    assert.deepEqual(known, [...known].sort((a, b) => direction * (a - b)));
  }
  const copied = await catchCopies(page);
  await page.getByRole("button", { name: "Copy the table as CSV" }).click();
  const lines = await copied();
  assert.equal(lines[0], "Pole (1/s),Frequency (Hz),Damping,Time constant (s)");
  assert.equal(lines.length, given.length + 1);
  for (const line of lines) assert.equal(line.split(",").length, 4);
});

test("the cursor in the plane of poles is at a pole of the table", async () => {
  const page = await open();
  const real = (await page.locator("table.results tbody td:first-child").allInnerTexts()).map(number);
  const plot = page.locator("#poles .plot");
  await plot.locator(".plot-body").focus();
  await page.keyboard.press("Home");
  const shown = number(await plot.locator(".plot-readout b").first().innerText());
  // Tolerance: 16 bits of the range of all poles.
  const extent = Math.max(...real.map(Math.abs));
  assert.ok(real.some((value) => Math.abs(value - shown) < 1e-4 * extent), `${shown} ${real.join(" ")}`);
});

test("poles are crosses, on the plot and in its key", async () => {
  const page = await open();
  const key = page.locator("#poles .plot-key");
  assert.equal(await key.locator("path").count(), 1);
  assert.equal(await key.locator("circle").count(), 0);
  // In the other figures, legend symbols are lines.
  assert.equal(await page.locator("#bode_1 .plot-key path[stroke-dasharray]").count(), 2);
});

test("gain and phase have one cursor and one range", async () => {
  const page = await open();
  const plots = page.locator("#bode_1 .plot");
  await hover(plots.first());
  const texts = await plots.locator(".plot-readout").allInnerTexts();
  assert.equal(texts.length, 2);
  for (const text of texts) assert.match(text, /^Frequency [\d.]+ Hz/);
  await page.locator("#bode_1").getByRole("button", { name: "Zoom in" }).click();
  const [gain, phase] = await plots.evaluateAll((all) => all.map((one) => (one as HTMLElement).dataset["range"]));
  assert.equal(gain, phase);
  range(gain!);
});

results.testLayouts("linearize");
results.testSilence();
