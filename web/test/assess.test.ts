/** The page of an assessment in a browser. Reference: `assessment.json` beside it. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import type { BrowserContextOptions } from "playwright-core";
import type { PageData } from "../src/page-data";
import { Results, catchCopies, hover, range } from "./browser";

interface Row {
  title: string;
  verdict: string;
  definition: string;
}

const folder = process.env["CHASSIS_FMU_ASSESSMENT"] ?? "../results/assess_EspCar";
const results = new Results(folder);
const open = (options?: BrowserContextOptions) => results.open(options);
const assessment = JSON.parse(readFileSync(`${folder}/assessment.json`, "utf8")) as {
  metrics: Row[];
  runs: { id: string; system: string; parameters: Record<string, number>; metrics: { entry_speed: number; first_hit: [number, number] | null } }[];
  tracks: Record<string, [number, number, number, number][]>;
};

test("every metric has a row with its verdict and its definition", async () => {
  const page = await open();
  const rows = page.locator(".metrics tbody tr:not(.group)");
  assert.equal(await rows.count(), assessment.metrics.length);
  const failed = assessment.metrics.filter((row) => row.verdict === "fail").length;
  assert.ok(failed > 0);
  assert.equal(await page.locator(".metrics .badge", { hasText: /^Failed$/ }).count(), failed);
  const first = rows.first().locator("details");
  const definition = first.locator("p");
  assert.equal(await definition.isVisible(), false);
  await first.locator("summary").click();
  assert.equal(await definition.innerText(), assessment.metrics[0]!.definition);
});

test("metrics are sorted within their maneuver, and copied with its name", async () => {
  const page = await open();
  const table = page.locator(".metrics").first();
  const groups = table.locator("tbody");
  const titles = await groups.locator("tr.group th").allInnerTexts();
  await table.getByRole("button", { name: "Metric" }).click();
  for (const [i, title] of titles.entries()) {
    const rows = groups.nth(i).locator("tr");
    assert.equal(await rows.first().innerText(), title);
    const names = await rows.locator("summary").allInnerTexts();
    assert.deepEqual(names, [...names].sort((a, b) => a.localeCompare(b, "en", { numeric: true })));
  }
  const copied = await catchCopies(page);
  await page.getByRole("button", { name: "Copy the table as CSV" }).first().click();
  const [head, ...lines] = await copied();
  assert.match(head!, /^Maneuver,Metric,/);
  assert.equal(lines.length, await groups.locator("tr:not(.group)").count());
  assert.ok(lines[0]!.startsWith(titles[0]!));
});

test("the seeds of the roads are among what is needed to repeat it", async () => {
  const page = await open();
  const seeds = new Set(assessment.runs.map((run) => run.parameters["seed"]).filter((seed) => seed !== undefined));
  assert.ok(seeds.size > 1);
  const shown = page.locator("dt", { hasText: "Seeds of the roads" }).locator("+ dd");
  assert.equal(await shown.innerText(), [...seeds].join(", "));
});

test("a place of the track is found by the mouse", async () => {
  const page = await open();
  const plot = page.locator("#iso3888_2 .plot").first();
  assert.match(await plot.locator(".plot-title").innerText(), /^Highest speed passed\s+[\d.]+ km\/h, Without controllers$/);
  await hover(plot);
  // The legend lists cones, path, the vehicle, its footprints and the smallest margin. The readout shows the coordinates of the nearest of them.
  assert.equal(await plot.locator(".plot-readout > span").count(), 5);
  assert.equal(await plot.locator(".plot-readout b").count(), 2);
});

test("footprints are to scale, and the cone that was hit first is marked at the edge of its section", async () => {
  const page = await open();
  const failed = page.locator("#iso3888_2 .plot", { hasText: "Lowest speed failed" }).first();
  await failed.scrollIntoViewIfNeeded();
  const over = (await failed.locator(".u-over").boundingBox())!;
  const [[left, right], [low, high]] = [range(await failed.getAttribute("data-range")), range(await failed.getAttribute("data-vertical"))];
  assert.ok(Math.abs(over.width / (right - left) / (over.height / (high - low)) - 1) < 0.02);
  const speed = Number.parseFloat(await failed.locator(".plot-title span").innerText());
  const run = assessment.runs.find((one) => one.system === "without" && one.id.startsWith("iso3888_2.") && Math.abs(one.metrics.entry_speed * 3.6 - speed) < 0.06)!;
  const [begin, end, ...edges] = assessment.tracks["iso3888_2"]![run.metrics.first_hit![1]! - 1]!;
  // The cross is on an edge of the section, between its ends.
  assert.equal(await failed.locator(".plot-readout span", { hasText: "first cone hit" }).count(), 1);
  const data = await page.locator("#page-data").textContent();
  const figure = (JSON.parse(data!) as PageData).figures.find(({ name }) => name === "iso3888_2")!;
  const cross = figure.panels.find(({ title }) => title === "Lowest speed failed")!.lines.find(({ crosses }) => crosses === true)!;
  assert.ok(cross.x.first >= begin! && cross.x.first <= end!, `${cross.x.first}`);
  assert.ok(edges.includes(cross.y.first), `${cross.y.first}`);
});

test("one of many lines has a key", async () => {
  const page = await open();
  const keys = page.locator("#sine_with_dwell .plot").first().locator(".plot-readout > span");
  assert.deepEqual(await keys.allInnerTexts(), [
    "Without controllers",
    "largest steering wheel angle",
    "end of steering, 1 s, 1.75 s later",
  ]);
});

results.testLayouts("assessment");
test("all cases can be off, and on again", async () => {
  const page = await open();
  for (const plot of await page.locator(".plot").all()) await plot.scrollIntoViewIfNeeded();
  const cases = page.locator('[aria-label="Cases"] button');
  const lines = () => page.locator(".plot-readout span").allInnerTexts();
  const all = await lines();
  for (let turn = 0; turn < 2; turn++) {
    for (let i = 0; i < (await cases.count()); i++) {
      await cases.nth(i).click();
      // Plots are redrawn after the click.
      await page.evaluate(() => new Promise((resume) => requestAnimationFrame(resume)));
    }
    if (turn === 0) assert.ok((await lines()).length < all.length / 2);
  }
  assert.deepEqual(await lines(), all);
});

results.testSilence();
