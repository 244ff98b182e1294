/** The page of a sweep over two parameters in a browser. Reference: the table beside it. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import type { BrowserContextOptions } from "playwright-core";
import { Results, hover, number } from "./browser";

const folder = process.env["CHASSIS_FMU_SWEEP"] ?? "../results/sweep";
const results = new Results(folder);
const open = (options?: BrowserContextOptions) => results.open(options);

/** The numbers of a metric by point, such as `speed_30_steering_angle_0p5`. */
function numbers(metric: string): Map<string, number> {
  const lines = readFileSync(`${folder}/table.csv`, "utf8").trim().split("\n").slice(1);
  const rows = lines.filter((line) => line.startsWith(`${metric},`)).map((line) => line.split(/,(?=(?:[^"]*"[^"]*")*[^"]*$)/));
  return new Map(rows.map((row) => [row[5]!, Number(row[7])]));
}

test("a table of more than 40 rows can be shown as matrices of both parameters", async () => {
  const page = await open();
  assert.ok((await page.locator("table.headline tbody tr").count()) > 40);
  const matrix = page.locator("table.matrix").first();
  assert.ok(!(await matrix.isVisible()));
  await page.getByRole("button", { name: "Matrix of the points and cases" }).click();
  assert.ok(await matrix.isVisible());
  assert.ok(!(await page.locator("table.headline").isVisible()));
  const expected = numbers("yaw_rate");
  const columns = await matrix.locator("thead th").allInnerTexts();
  const rows = await matrix.locator("tbody th").allInnerTexts();
  assert.equal(columns.length * rows.length, expected.size);
  for (const [i, row] of rows.entries()) {
    for (const [j, column] of columns.entries()) {
      const shown = number(await matrix.locator("tbody tr").nth(i).locator("td").nth(j).innerText());
      const name = `speed_${Number.parseFloat(column)}_steering_angle_${String(Number.parseFloat(row)).replace(".", "p")}`;
      // Tolerance: four digits.
      assert.ok(Math.abs(shown - expected.get(name)!) <= 1e-3 * Math.abs(shown), `${name} ${shown} ${expected.get(name)}`);
    }
  }
});

test("the keyboard goes from cell to cell of a heat map", async () => {
  const page = await open();
  const plot = page.locator("#map .plot").first();
  const expected = numbers("yaw_rate");
  assert.match(await plot.locator(".plot-readout").innerText(), /Yaw rate, final/);
  await plot.locator(".plot-body").focus();
  await page.keyboard.press("Home");
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press("ArrowUp");
  const entry = plot.locator(".plot-readout span");
  assert.equal(await entry.getAttribute("data-x"), "50");
  assert.equal(Number(await entry.getAttribute("data-y")), 1);
  const shown = number(await entry.locator("b").innerText());
  const value = expected.get("speed_50_steering_angle_1")!;
  // Tolerance: 16 bits of the range, and at least four digits.
  assert.ok(Math.abs(shown - value) < 1e-3 * value, `${shown} ${value}`);
});

test("the mouse finds the cell below it", async () => {
  const page = await open();
  const plot = page.locator("#map .plot").first();
  await hover(plot);
  const entry = plot.locator(".plot-readout span");
  const [x, y] = [Number(await entry.getAttribute("data-x")), Number(await entry.getAttribute("data-y"))];
  const box = (await plot.locator(".heat-mark").boundingBox())!;
  const over = (await plot.locator(".u-over").boundingBox())!;
  const [across, up] = [over.x + over.width / 2, over.y + over.height / 2];
  // The middle can be on a border between cells, which are rounded to whole pixels.
  assert.ok(box.x - 1 <= across && across <= box.x + box.width + 1, `${box.x} ${box.width} ${across}`);
  assert.ok(box.y - 1 <= up && up <= box.y + box.height + 1, `${box.y} ${box.height} ${up}`);
  const value = numbers("yaw_rate").get(`speed_${x}_steering_angle_${String(Number(y.toFixed(6))).replace(".", "p")}`)!;
  assert.ok(Math.abs(number(await entry.locator("b").innerText()) - value) < 1e-3 * value);
});

test("print and pages without JavaScript show the picture of the heat map", async () => {
  const plain = await open({ javaScriptEnabled: false });
  assert.ok(await plain.locator("#map > svg").isVisible());
});

results.testLayouts("sweep");
results.testSilence();
