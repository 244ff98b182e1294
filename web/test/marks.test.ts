/** Many seeds, and marks of printed numbers, in a browser. References: the scenario, the table and the recorded signals. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import type { BrowserContextOptions } from "playwright-core";
import { Results, hover, number } from "./browser";

const folder = process.env["CHASSIS_FMU_MARKS"] ?? "../results/marks";
const results = new Results(folder);
const open = (options?: BrowserContextOptions) => results.open(options);

test("marks show the printed numbers beside ours", async () => {
  const page = await open();
  const plot = page.locator("#over_speed .plot");
  const entries = plot.locator(".plot-readout span");
  const printed = entries.filter({ hasText: "paper" });
  assert.equal(await printed.count(), 1);
  await plot.locator(".plot-body").focus();
  const [, ...lines] = readFileSync(`${folder}/table.csv`, "utf8").trim().split("\n");
  const rows = lines.map((line) => line.split(/,(?=(?:[^"]*"[^"]*")*[^"]*$)/));
  assert.equal(rows.length, 2);
  for (const [i, key] of ["Home", "End"].entries()) {
    await page.keyboard.press(key);
    const [ours, paper] = [Number(rows[i]![7]), Number(rows[i]![11])];
    // Both ends of a column are stored exactly, and shown with at least four digits.
    assert.ok(Math.abs(number(await printed.locator("b").innerText()) - paper) < 1e-3 * paper);
    assert.ok(Math.abs(number(await entries.first().locator("b").innerText()) - ours) < 1e-3 * ours);
  }
});

test("marks are squares of the color of the card with the color of their case around", async () => {
  const page = await open();
  const plot = page.locator("#over_speed .plot");
  await plot.scrollIntoViewIfNeeded();
  // The first mark is at the left end of the plot, at 4.187 on the vertical axis.
  const [low, high] = (await plot.getAttribute("data-vertical"))!.split(" ").map(Number);
  const colors = await plot.evaluate(
    (element, share) => {
      const canvas = element.querySelector("canvas")!;
      const [canvasBox, over] = [canvas.getBoundingClientRect(), element.querySelector(".u-over")!.getBoundingClientRect()];
      const ratio = canvas.width / canvasBox.width;
      const [x, y] = [over.left - canvasBox.left, over.top - canvasBox.top + over.height * share];
      const context = canvas.getContext("2d")!;
      const at = (dx: number) => [...context.getImageData(Math.round((x + dx) * ratio), Math.round(y * ratio), 1, 1).data];
      return { inside: at(0), around: Array.from({ length: 8 }, (_, i) => at(i)) };
    },
    1 - (4.187 - low!) / (high! - low!),
  );
  assert.deepEqual(colors.inside, [255, 255, 255, 255]);
  // #0072b2, the first color of the palette, around the center of the mark.
  assert.ok(colors.around.some(([red, green, blue]) => red! < 90 && green! > 80 && green! < 160 && blue! > 150), JSON.stringify(colors));
});

test("any of many seeds is shown by a list", async () => {
  const page = await open();
  const list = page.locator('select[aria-label="Seed"]');
  assert.equal(await list.locator("option").count(), 15);
  const plot = page.locator("#response .plot").first();
  await list.selectOption("13");
  await hover(plot);
  const entry = plot.locator(".plot-readout span").first();
  assert.match(await entry.innerText(), /seed 13/);
  const time = Number(await entry.getAttribute("data-x"));
  const { names, rows } = results.recording("car_speed_50_13");
  const row = rows.find((values) => Math.abs(values[0]! - time) < 1e-9);
  assert.ok(row !== undefined, `no row at ${time} s`);
  const expected = (row[names.indexOf("vehicle.yaw_rate")]! * 180) / Math.PI;
  // Tolerance: 16 bits of some degrees per second, and at least four digits.
  assert.ok(Math.abs(number(await entry.locator("b").innerText()) - expected) < 1e-3 * Math.abs(expected) + 1e-4);
  await list.selectOption("");
  assert.equal(await plot.locator(".plot-readout span").count(), 0);
});

test("the page has at most 1 MB", () => {
  assert.ok(readFileSync(`${folder}/index.html`).length <= 1e6);
});

results.testLayouts("marks");
results.testSilence();
