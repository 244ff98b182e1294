/** The page of a scenario in a browser. References: the recorded signals beside the page, and the rules of accessibility. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { describe, test } from "node:test";
import type { BrowserContextOptions, Locator } from "playwright-core";
import { Results, catchCopies, hover, range } from "./browser";

const results = new Results(process.env["CHASSIS_FMU_PAGE"] ?? "../results/rescue_vehicle_step_steer");
const open = (options?: BrowserContextOptions) => results.open(options);
const recording = (run: string) => results.recording(run);

test("the page is one file of at most 1 MB", () => {
  assert.ok(readFileSync(`${results.folder}/index.html`).length <= 1e6);
});

describe("figures", () => {
  test("the readout shows the recorded value", async () => {
    const page = await open();
    const plot = page.locator("#figure_6a .plot").first();
    await hover(plot);
    const entry = plot.locator(".plot-readout span").first();
    const shown = Number((await entry.locator("b").innerText()).replace("−", "-"));
    const time = Number(await entry.getAttribute("data-x"));
    const { names, rows } = recording("individual_1");
    const column = names.indexOf("body.roll");
    const row = rows.find((values) => Math.abs(values[0]! - time) < 1e-9);
    assert.ok(row !== undefined && column > 0, `no row at ${time} s`);
    const degrees = rows.map((values) => (values[column]! * 180) / Math.PI);
    const span = Math.max(...degrees) - Math.min(...degrees);
    // The value is rounded to 16 bits, and then to the remaining digits, which are at least four in the middle of this run.
    const expected = (row[column]! * 180) / Math.PI;
    assert.ok(Math.abs(shown - expected) <= span / 65534 + 5e-4 * Math.abs(expected), `${shown} ${expected}`);
  });

  test("one cursor is in all plots over time", async () => {
    const page = await open();
    await hover(page.locator("#figure_6a .plot").first());
    const texts = await page.locator(".plot-readout").evaluateAll((all) => all.map((one) => one.textContent ?? ""));
    const inside = texts.filter((text) => /^Time [\d.]+ s/.test(text));
    assert.ok(inside.length > 3, texts.join("\n"));
  });

  test("switches hide cases, seeds and units", async () => {
    const page = await open();
    const plot = page.locator("#figure_6a .plot").first();
    const lines = () => plot.locator(".plot-readout span").allInnerTexts();
    const all = await lines();
    const first = page.locator('[aria-label="Cases"] button').first();
    await first.click();
    assert.equal(await first.getAttribute("aria-pressed"), "false");
    assert.equal((await lines()).length, all.length - 1);
    await first.click();
    assert.deepEqual(await lines(), all);
    await page.locator('[aria-label="seed 2"]').click();
    assert.equal((await lines()).length, 2 * all.length);
    await page.locator('[aria-label^="mean"]').click();
    assert.ok((await lines()).some((line) => line.includes("mean of")));
    await page.locator('[aria-label^="SI"]').click();
    await hover(plot);
    assert.match((await lines())[0]!, / rad$/);
  });

  test("buttons and the mouse zoom and pan", async () => {
    const page = await open();
    const plot = page.locator("#figure_6a .plot").first();
    const shown = async () => range(await plot.getAttribute("data-range"));
    const press = (name: string) => page.locator("#figure_6a").getByRole("button", { name }).click();
    const all = await shown();
    await press("Zoom in");
    const half = await shown();
    assert.ok(Math.abs(half[1] - half[0] - (all[1] - all[0]) / 2) < 1e-9);
    await press("Move right");
    assert.ok((await shown())[0] > half[0]);
    await press("Show all");
    assert.deepEqual(await shown(), all);
    const over = plot.locator(".u-over");
    await over.scrollIntoViewIfNeeded();
    const box = (await over.boundingBox())!;
    await page.mouse.move(box.x + 0.25 * box.width, box.y + 20);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.5 * box.width, box.y + 40, { steps: 4 });
    await page.mouse.up();
    const dragged = await shown();
    const expected = [0.25, 0.5].map((share) => all[0] + share * (all[1] - all[0]));
    // Positions are whole pixels.
    const pixel = (all[1] - all[0]) / box.width;
    dragged.forEach((end, i) => assert.ok(Math.abs(end - expected[i]!) <= 2 * pixel, `${dragged} ${expected}`));
  });

  test("the keyboard moves the cursor and zooms", async () => {
    const page = await open();
    const plot = page.locator("#figure_6a .plot").first();
    await plot.locator(".plot-body").focus();
    await page.keyboard.press("Home");
    for (let i = 0; i < 10; i++) await page.keyboard.press("ArrowRight");
    assert.match((await plot.locator(".plot-readout").textContent()) ?? "", /^Time [\d.]+ s/);
    const all = range(await plot.getAttribute("data-range"));
    await page.keyboard.press("+");
    const half = range(await plot.getAttribute("data-range"));
    assert.ok(Math.abs(half[1] - half[0] - (all[1] - all[0]) / 2) < 1e-9);
    await page.keyboard.press("Escape");
    assert.deepEqual(range(await plot.getAttribute("data-range")), all);
  });

  test("on a web server a closer look reads the recorded signals", async () => {
    const { page, close } = await results.serve();
    const figure = page.locator("#figure_6c");
    for (let i = 0; i < 4; i++) await figure.getByRole("button", { name: "Zoom in" }).click();
    await figure.locator('.plot[data-resolution="full"]').waitFor();
    await hover(figure.locator(".plot").first());
    const entry = figure.locator(".plot-readout span").first();
    const { names, rows } = recording("individual_1");
    const time = Number(await entry.getAttribute("data-x"));
    const row = rows.find((values) => values[0] === time);
    assert.ok(row !== undefined, `no row at ${time} s`);
    const shown = Number((await entry.locator("b").innerText()).replace("−", "-"));
    const factor = /°|deg/.test((await entry.textContent()) ?? "") ? 180 / Math.PI : 1;
    const expected = row[names.indexOf("body.roll_acceleration")]! * factor;
    // Tolerance: six digits.
    assert.ok(Math.abs(shown - expected) <= 5e-6 * Math.abs(expected), `${shown} ${expected}`);
    await close();
  });

  test("print and pages without JavaScript show the pictures", async () => {
    const page = await open();
    await page.emulateMedia({ media: "print" });
    assert.ok(await page.locator("#figure_6a > svg").isVisible());
    assert.ok(!(await page.locator("#figure_6a .plot").first().isVisible()));
    const plain = await open({ javaScriptEnabled: false });
    assert.ok(await plain.locator("#figure_6a > svg").isVisible());
  });

  test("colors follow the theme", async () => {
    const page = await open();
    const color = () => page.locator("#figure_6a .plot-key").first().evaluate((key) => getComputedStyle(key).stroke);
    const light = await color();
    await page.emulateMedia({ colorScheme: "dark" });
    await page.waitForFunction((before) => getComputedStyle(document.querySelector("#figure_6a .plot-key")!).stroke !== before, light);
  });
});

describe("the table of numbers", () => {
  test("a click on a title sorts within the groups", async () => {
    const page = await open();
    const table = page.locator("table.headline");
    const groups = await table.locator("tbody").count();
    await table.getByRole("button", { name: "Ours" }).click();
    for (let i = 0; i < groups; i++) {
      const body = table.locator("tbody").nth(i);
      assert.equal(await body.locator("tr").first().locator("th").count(), 1);
      const texts = await body.locator("td.strong").allInnerTexts();
      const values = texts.map((text) => Number.parseFloat(text.replace("−", "-")));
      assert.deepEqual(values, [...values].sort((a, b) => a - b));
    }
    await table.getByRole("button", { name: "Ours" }).click();
    assert.equal(await table.locator('th[aria-sort="descending"]').count(), 1);
  });

  test("copies have a row for each row of the table", async () => {
    const page = await open();
    const copied = await catchCopies(page);
    const rows = await page.locator("table.headline tbody tr").count();
    await page.getByRole("button", { name: "Copy the table as CSV" }).click();
    const csv = await copied();
    assert.equal(csv.length, rows + 1);
    assert.match(csv[0]!, /^Metric,Case,/);
    assert.ok(csv[2]!.startsWith(csv[1]!.split(",Individual")[0]!), csv.slice(0, 3).join("\n"));
    await page.getByRole("button", { name: "Copy the table as Markdown" }).click();
    assert.equal((await copied()).length, rows + 2);
  });
});

test("a long table can be shown as a matrix of points and cases", async () => {
  const code = readFileSync("../python/chassis_fmu/web/page.js", "utf8");
  const style = readFileSync("../python/chassis_fmu/web/page.css", "utf8");
  const points = Array.from({ length: 21 }, (_, i) => i);
  const row = (point: number, name: string, first: boolean) =>
    `<tr>${first && point === 0 ? '<th rowspan="42">Speed</th>' : ""}<td class="point" data-text="${point} km/h">${first ? `${point} km/h` : ""}</td>` +
    `<td class="case">${name}</td><td class="strong">${(point - 10) * (first ? 1 : 2)}</td></tr>`;
  const rows = points.map((point) => row(point, "A", true) + row(point, "B", false)).join("");
  const page = await (await results.browser.newContext()).newPage();
  await page.setContent(
    `<style>${style}</style><table class="headline"><thead><tr><th>Metric</th><th>Point</th><th>Case</th><th>Ours</th></tr></thead>` +
      `<tbody>${rows}</tbody></table><script>${code}</script>`,
  );
  const matrix = page.locator("table.matrix");
  assert.ok(!(await matrix.isVisible()));
  await page.getByRole("button", { name: "Matrix of the points and cases" }).click();
  assert.ok(await matrix.isVisible());
  assert.ok(!(await page.locator("table.headline").isVisible()));
  assert.deepEqual(await matrix.locator("thead th").allInnerTexts(), ["A", "B"]);
  assert.deepEqual(await matrix.locator("tbody tr").nth(20).locator("th, td").allInnerTexts(), ["20 km/h", "10", "20"]);
  const share = (cell: Locator) => cell.evaluate((element) => (element as HTMLElement).style.getPropertyValue("--share"));
  assert.equal(await share(matrix.locator("tbody tr").nth(0).locator("td").nth(1)), "0%");
  assert.equal(await share(matrix.locator("tbody tr").nth(20).locator("td").nth(1)), "55%");
  await page.getByRole("button", { name: "Matrix of the points and cases" }).click();
  await page.getByRole("button", { name: "Ours" }).click();
  // The title of a point, which is omitted if it repeats the row above, appears after sorting.
  assert.deepEqual(await page.locator("table.headline tbody tr").first().locator("td").allInnerTexts(), ["0 km/h", "B", "-20"]);
});

results.testLayouts("scenario");
results.testSilence();
