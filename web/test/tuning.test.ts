/** The page of a tuning study in a browser. Reference: `summary.json` beside it. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import type { BrowserContextOptions } from "playwright-core";
import { Results, catchCopies, hover, number } from "./browser";

interface Summary {
  terms: { signal: string }[];
  methods: { title: string; evaluations: number; best: { objective: number } | null }[];
}

const folder = process.env["CHASSIS_FMU_TUNING"] ?? "../results/rescue_vehicle_roll_weights";
const results = new Results(folder);
const open = (options?: BrowserContextOptions) => results.open(options);
const summary = JSON.parse(readFileSync(`${folder}/summary.json`, "utf8")) as Summary;

test("the curves end at the best objectives of the summary", async () => {
  const page = await open();
  const plot = page.locator("#convergence .plot");
  await hover(plot);
  await plot.locator(".plot-body").focus();
  await page.keyboard.press("End");
  const shown = (await plot.locator(".plot-readout b").allInnerTexts()).map(number);
  const best = summary.methods.map((method) => method.best!.objective);
  assert.equal(shown.length, best.length);
  // Tolerance: 16 bits of the range, and at least four digits.
  best.forEach((value, i) => assert.ok(Math.abs(shown[i]! - value) < 1e-3 * value, `${shown[i]} ${value}`));
});

test("methods are sorted by their objective, and copied", async () => {
  const page = await open();
  const section = page.locator("section", { has: page.getByRole("heading", { name: "Methods" }) });
  const table = section.locator("table");
  await table.getByRole("button", { name: "Objective" }).click();
  const copied = await catchCopies(page);
  await section.getByRole("button", { name: "Copy the table as Markdown" }).click();
  const lines = await copied();
  assert.equal(lines.length, summary.methods.length + 2);
  const columns = new Set(lines.map((line) => line.split("|").length));
  assert.equal(columns.size, 1, lines.join("\n"));
});

test("each term of the objective has its definition", async () => {
  const page = await open();
  const definitions = page.locator(".definition");
  assert.equal(await definitions.count(), summary.terms.length);
  const first = definitions.first();
  assert.ok(!(await first.locator("small").isVisible()));
  await first.locator("summary").click();
  assert.match(await first.innerText(), /mean of the squares, where x is plant:body\.roll.*rows/s);
});

test("a narrow screen has a list with the titles of the columns", async () => {
  const page = await open({ viewport: { width: 400, height: 900 } });
  const section = page.locator("section", { has: page.getByRole("heading", { name: "Methods" }) });
  const cell = section.locator("tbody td").first();
  assert.equal(await cell.evaluate((element) => getComputedStyle(element, "::before").content), '"Objective"');
  const body = section.locator("tbody").first();
  await section.locator("select").selectOption({ label: "Evaluations, falling" });
  assert.ok(await body.isVisible());
  assert.ok(!(await section.locator("thead").isVisible()));
});

results.testLayouts("tuning");
results.testSilence();
