/** What tests of pages share: a browser, the page of a scenario, its recorded signals, and the rules of accessibility. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before } from "node:test";
import { pathToFileURL } from "node:url";
import axe from "axe-core";
import { type Browser, type BrowserContextOptions, type Locator, type Page, chromium } from "playwright-core";

const CHROMIUM = process.env["CHROMIUM"] ?? "/usr/bin/chromium";

/** The results of a scenario in a browser. */
export class Results {
  /** What pages wrote to the console or asked for, which they should not. */
  readonly faults: string[] = [];
  readonly #url: string;
  #browser: Browser | null = null;

  constructor(readonly folder: string) {
    this.#url = pathToFileURL(`${folder}/index.html`).href;
    before(async () => {
      this.#browser = await chromium.launch({ executablePath: CHROMIUM, args: ["--no-sandbox"] });
    });
    after(() => this.#browser?.close());
  }

  get browser(): Browser {
    assert.ok(this.#browser !== null);
    return this.#browser;
  }

  async open(options: BrowserContextOptions = {}): Promise<Page> {
    const page = await (await this.browser.newContext({ viewport: { width: 1400, height: 900 }, ...options })).newPage();
    page.on("console", (message) => message.type() === "error" && this.faults.push(message.text()));
    page.on("pageerror", (error) => this.faults.push(String(error)));
    page.on("request", (request) => request.url() === this.#url || this.faults.push(`request of ${request.url()}`));
    await page.goto(this.#url);
    if (options.javaScriptEnabled !== false) await page.waitForSelector(".plot canvas");
    return page;
  }

  /** The recorded signals of a run. */
  recording(run: string): { names: string[]; rows: number[][] } {
    const [head, ...lines] = readFileSync(`${this.folder}/runs/${run}.csv`, "utf8").trim().split("\n");
    return { names: head!.split(","), rows: lines.map((line) => line.split(",").map(Number)) };
  }
}

/** Puts the cursor in the middle of a plot. */
export async function hover(plot: Locator): Promise<void> {
  const over = plot.locator(".u-over");
  await over.scrollIntoViewIfNeeded();
  await over.hover();
}

export function range(text: string | null): [number, number] {
  const [min, max] = (text ?? "").split(" ").map(Number);
  assert.ok(min !== undefined && max !== undefined && min < max, text ?? "no range");
  return [min, max];
}

/** Asserts that nothing is wider than the page, and that it has no serious violation of accessibility. */
export async function assertAccessible(page: Page): Promise<void> {
  const [scroll, inner] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  assert.ok(scroll! <= inner!, `${scroll} px wide`);
  await page.evaluate(axe.source);
  const found = await page.evaluate(async () => {
    // Without preload: it requests style sheets.
    const { violations } = await (window as unknown as { axe: typeof axe }).axe.run({ preload: false });
    return violations
      .filter((one) => one.impact === "serious" || one.impact === "critical")
      .map((one) => `${one.id}: ${one.help}: ${one.nodes.map((node) => node.html).slice(0, 3).join(" ")}`);
  });
  assert.deepEqual(found, []);
}
