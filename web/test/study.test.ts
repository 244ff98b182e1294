/** The page of a study in a browser. Reference: the tables on the page, which do not depend on the code of the plots. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import type { BrowserContextOptions } from "playwright-core";
import { Results, hover } from "./browser";

const results = new Results(process.env["CHASSIS_FMU_STUDY"] ?? "../results/robust_rescue_vehicle");
const open = (options?: BrowserContextOptions) => results.open(options);

test("the page is one file of at most 1.5 MB", () => {
  assert.ok(readFileSync(`${results.folder}/index.html`).length <= 1.5e6);
});

test("each recorded run has a color, a switch and the values of its factors", async () => {
  const page = await open();
  const switches = page.locator("#histories .switches button");
  const count = await switches.count();
  assert.ok(count > 2);
  for (const text of await switches.allInnerTexts()) assert.match(text, /, sample \d+: mass [\d.]+ kg, friction [\d.]+, speed [\d.]+ km\/h$/);
  const keys = page.locator("#histories .plot").first().locator(".plot-readout > span");
  const strokes = () => keys.locator("svg").evaluateAll((all) => all.map((one) => getComputedStyle(one).stroke));
  assert.equal(new Set(await strokes()).size, count);
  await switches.first().click();
  assert.equal(await keys.count(), count - 1);
});

test("a distribution ends at the largest number of the table", async () => {
  const page = await open();
  const section = page.locator("section", { has: page.locator("#roll_rms_distribution") });
  const rows = section.locator("table").first().locator("tbody tr");
  const largest = (await rows.locator("td:last-child").allInnerTexts()).map(Number);
  assert.equal(largest.length, 2);
  const plot = page.locator("#roll_rms_distribution .plot").first();
  await hover(plot);
  await plot.locator(".plot-body").focus();
  await page.keyboard.press("End");
  const shown = Number((await plot.locator(".plot-readout b").first().innerText()).replace("−", "-"));
  // Tolerance: four decimals in the table, 16 bits of the range and four digits in the readout.
  assert.ok(largest.some((value) => Math.abs(shown - value) < 1e-4), `${shown} ${largest.join(" ")}`);
});

test("verdicts, effects and time histories are on the page", async () => {
  const page = await open();
  const verdicts = await page.locator("section", { hasText: "Requirements" }).first().locator("tbody .badge").allInnerTexts();
  assert.equal(verdicts.length, 2);
  for (const verdict of verdicts) assert.match(verdict, /Passed|Failed/);
  assert.ok((await page.locator(".effect").count()) > 0);
  assert.ok((await page.locator("#histories .plot").count()) > 0);
});

results.testLayouts("study");
results.testSilence();
