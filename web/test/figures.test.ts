/** Figures of every kind in a browser, on the page of figures.toml. References: the recorded signals and the table beside the page. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import type { BrowserContextOptions, Locator } from "playwright-core";
import { Results, hover, number, range } from "./browser";

const results = new Results(process.env["CHASSIS_FMU_FIGURES"] ?? "../results/figures");
const open = (options?: BrowserContextOptions) => results.open(options);

/** The cells of a CSV line; quoted titles can contain commas. */
function cells(line: string): string[] {
  return line.split(/,(?=(?:[^"]*"[^"]*")*[^"]*$)/);
}

/** Coordinates that a readout shows. */
async function coordinates(plot: Locator): Promise<[number, number]> {
  const texts = await plot.locator(".plot-readout b").allInnerTexts();
  assert.equal(texts.length, 2, texts.join(" "));
  return [number(texts[0]!), number(texts[1]!)];
}

test("the cursor on a curve is at a recorded point", async () => {
  const page = await open();
  const plot = page.locator("#path .plot").first();
  await hover(plot);
  const [x, y] = await coordinates(plot);
  const found = ["slow_1", "fast_1"].some((run) => {
    const { names, rows } = results.recording(run);
    const [across, up] = ["vehicle.position_x", "vehicle.position_y"].map((name) => names.indexOf(name));
    // Tolerance: 16 bits of the ranges, up to 140 m and 10 m, and at least four digits.
    return rows.some((row) => Math.abs(row[across!]! - x) < 0.02 && Math.abs(row[up!]! - y) < 2e-3);
  });
  assert.ok(found, `${x} ${y}`);
});

test("the cursor in plots over time is on curves, too", async () => {
  const page = await open();
  await hover(page.locator("#response .plot").first());
  const time = Number(await page.locator("#response .plot-readout span").first().getAttribute("data-x"));
  const readout = page.locator("#path .plot-readout span");
  for (const [i, run] of ["slow_1", "fast_1"].entries()) {
    const { names, rows } = results.recording(run);
    // The page contains about every second sample; at up to 14 m/s, a sample is 2 cm of the path.
    const row = rows.find((values) => Math.abs(values[0]! - time) < 1e-9)!;
    const x = Number(await readout.nth(i).getAttribute("data-x"));
    assert.ok(Math.abs(x - row[names.indexOf("vehicle.position_x")]!) < 0.3, `${run} ${x}`);
  }
  assert.equal(await page.locator("#path .plot-mark:visible").count(), 2);
});

test("the cursor on a curve is in plots over time, too", async () => {
  const page = await open();
  const plot = page.locator("#path .plot").first();
  await plot.locator(".plot-body").focus();
  await page.keyboard.press("Home");
  for (let i = 0; i < 100; i++) await page.keyboard.press("ArrowRight");
  const x = Number(await plot.locator(".plot-readout span[data-x]").getAttribute("data-x"));
  const readouts = await page.locator("#response .plot-readout").allInnerTexts();
  const times = readouts.map((text) => Number(/^Time ([\d.]+) s/.exec(text)?.[1]));
  assert.ok(times.length > 1 && times.every((time) => time === times[0]), readouts.join("\n"));
  const { names, rows } = results.recording("slow_1");
  const row = rows.find((values) => Math.abs(values[0]! - times[0]!) < 1e-9)!;
  // In plots over time, the nearest sample is at most a few samples away; a sample is 8 cm of the path.
  assert.ok(Math.abs(row[names.indexOf("vehicle.position_x")]! - x) < 0.5, `${x} at ${times[0]} s`);
  // Other curves follow the cursor, and all remove it when the mouse leaves.
  assert.ok((await page.locator("#hysteresis .plot-mark:visible").count()) > 0);
  await hover(plot);
  await page.mouse.move(2, 2);
  assert.equal(await page.locator("#hysteresis .plot-mark:visible").count(), 0);
});

test("on a web server a closer look at a curve reads the recorded signals", async () => {
  const { page, close } = await results.serve();
  const figure = page.locator("#path");
  for (let i = 0; i < 3; i++) await figure.getByRole("button", { name: "Zoom in" }).click();
  await figure.locator('.plot[data-resolution="full"]').waitFor();
  const plot = figure.locator(".plot").first();
  await hover(plot);
  const [x, y] = await coordinates(plot);
  const points = ["slow_1", "fast_1"].flatMap((run) => {
    const { names, rows } = results.recording(run);
    const [across, up] = ["vehicle.position_x", "vehicle.position_y"].map((name) => names.indexOf(name));
    return rows.map((row) => [row[across!]!, row[up!]!] as const);
  });
  // Tolerance: six digits of up to 140 m and 10 m.
  assert.ok(points.some(([across, up]) => Math.abs(across - x) < 1e-3 && Math.abs(up - y) < 1e-4), `${x} ${y}`);
  await close();
});

test("the keyboard goes along a curve", async () => {
  const page = await open();
  const plot = page.locator("#path .plot").first();
  await plot.locator(".plot-body").focus();
  await page.keyboard.press("Home");
  // The path begins at the origin, within 16 bits of 140 m.
  assert.ok(Math.hypot(...(await coordinates(plot))) < 0.01);
  await page.keyboard.press("End");
  const [end] = await coordinates(plot);
  await page.keyboard.press("ArrowLeft");
  const [before] = await coordinates(plot);
  assert.ok(before < end, `${before} ${end}`);
});

test("a map has the same scale on both axes, also when zoomed", async () => {
  const page = await open();
  const figure = page.locator("#path");
  const plot = figure.locator(".plot").first();
  const scale = async () => {
    const over = (await plot.locator(".u-over").boundingBox())!;
    const [min, max] = range(await plot.getAttribute("data-range"));
    const [low, high] = range(await plot.getAttribute("data-vertical"));
    return [over.width / (max - min), over.height / (high - low)] as const;
  };
  const [across, up] = await scale();
  assert.ok(Math.abs(across / up - 1) < 0.01, `${across} ${up}`);
  await figure.getByRole("button", { name: "Zoom in" }).click();
  const [closer, higher] = await scale();
  assert.ok(Math.abs(closer / higher - 1) < 0.01 && closer > 1.9 * across, `${closer} ${higher}`);
});

test("a line over the axis on the right is shown in its unit", async () => {
  const page = await open();
  const plot = page.locator("#response .plot").first();
  await hover(plot);
  const entries = plot.locator(".plot-readout span");
  const steer = entries.filter({ hasText: "driver.steer" }).first();
  const time = Number(await steer.getAttribute("data-x"));
  const { names, rows } = results.recording("slow_1");
  const row = rows.find((values) => Math.abs(values[0]! - time) < 1e-9);
  assert.ok(row !== undefined, `no row at ${time} s`);
  const expected = (row[names.indexOf("driver.steer")]! * 180) / Math.PI;
  // Tolerance: 16 bits of an amplitude of 2.3 degrees, and four digits.
  assert.ok(Math.abs(number(await steer.locator("b").innerText()) - expected) < 1e-3);
  assert.match(await steer.innerText(), / (°|deg)$/);
});

test("panels on the same scale have the same range, in both units", async () => {
  const page = await open();
  const ranges = () => page.locator("#apart .plot").evaluateAll((all) => all.map((one) => (one as HTMLElement).dataset["vertical"]));
  const [first, second] = await ranges();
  assert.ok(first !== undefined && first === second, `${first} ${second}`);
  await page.locator('[aria-label^="SI"]').click();
  const [radians] = await ranges();
  const [high, before] = [range(radians!)[1], range(first)[1]];
  assert.ok(Math.abs((high * 180) / Math.PI / before - 1) < 1e-9, `${high} ${before}`);
});

test("a transfer function has gain, phase and coherence", async () => {
  const page = await open();
  const titles = await page.locator("#frequency_response .plot-title b").allInnerTexts();
  assert.deepEqual(titles.map((title) => title.split(": ").at(-1)), ["gain", "phase", "coherence"]);
});

test("scatter plots and distributions show the numbers of the runs", async () => {
  const page = await open();
  const [head, ...rows] = readFileSync(`${results.folder}/table.csv`, "utf8").trim().split("\n").map(cells);
  const mean = (metric: string, name: string) => {
    const row = rows.find((row) => row[0] === metric && row[4] === name)!;
    return Number(row[head!.indexOf("ours")]);
  };
  for (const [figure, axis] of [["#distribution", "x"], ["#scatter", "y"]] as const) {
    const plot = page.locator(`${figure} .plot`).first();
    // Visits all four seeds of the first case with the keyboard.
    await plot.locator(".plot-body").focus();
    await page.keyboard.press("Home");
    const seen = new Map<string, number>();
    for (let i = 0; i < 400; i++) {
      const entry = plot.locator(".plot-readout span").first();
      const x = await entry.getAttribute("data-x");
      if (x !== null) seen.set(x, number(await entry.locator("b").innerText()));
      await page.keyboard.press("ArrowRight");
    }
    const values = axis === "x" ? [...seen.keys()].map(Number) : [...seen.values()];
    assert.equal(values.length, 4, values.join(" "));
    const average = values.reduce((sum, value) => sum + value, 0) / 4;
    // Tolerance: the table has six digits, the page four.
    assert.ok(Math.abs(average / mean("roll_peak", "slow") - 1) < 1e-3, `${figure} ${average}`);
  }
});

test("requirements and definitions are on the page", async () => {
  const page = await open();
  const verdicts = await page.locator(".verdicts li").allInnerTexts();
  assert.deepEqual(verdicts.map((text) => text.split(/\s/)[0]), ["Passed", "Passed", "Failed"]);
  const definition = page.locator(".definition").first();
  assert.ok(!(await definition.locator("small").isVisible()));
  await definition.locator("summary").click();
  assert.match(await definition.innerText(), /largest magnitude of x: body\.roll.*1 001 rows/s);
});

results.testLayouts("figures");
results.testSilence();
