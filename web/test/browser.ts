/** Shared code for tests of pages: a browser, the page of a scenario, its recorded signals, and accessibility rules. */

import assert from "node:assert/strict";
import { mkdirSync, readFileSync } from "node:fs";
import { createServer } from "node:http";
import type { AddressInfo } from "node:net";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import axe from "axe-core";
import { type Browser, type BrowserContextOptions, type Locator, type Page, chromium } from "playwright-core";

/** Folder for screenshots of the pages. */
const SCREENSHOTS = "../target/screenshots";
const CHROMIUM = process.env["CHROMIUM"] ?? "/usr/bin/chromium";

/** The results of a scenario in a browser. */
export class Results {
  /** Unexpected console messages and requests of pages. */
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

  /** Opens the page on a local web server, which also provides the recorded signals. */
  async serve(): Promise<{ page: Page; close: () => Promise<void> }> {
    const server = createServer((request, response) => {
      const path = decodeURIComponent((request.url ?? "/").slice(1));
      response.setHeader("Content-Type", path.endsWith(".html") ? "text/html" : "text/csv");
      // Browsers also request an icon.
      response.end(path === "favicon.ico" ? "" : readFileSync(`${this.folder}/${path}`));
    });
    await new Promise<void>((done) => server.listen(0, "127.0.0.1", done));
    const { port } = server.address() as AddressInfo;
    const page = await (await this.browser.newContext({ viewport: { width: 1400, height: 900 } })).newPage();
    await page.goto(`http://127.0.0.1:${port}/index.html`);
    const close = async () => {
      await page.close();
      server.closeAllConnections();
      server.close();
    };
    return { page, close };
  }

  /**
   * Tests that nothing is wider than the page, that it has no serious accessibility violation and is not blank, on a desktop and on a
   * phone, light and dark. Screenshots are written to target/screenshots for visual inspection.
   */
  testLayouts(name: string): void {
    for (const width of [400, 1400]) {
      for (const colorScheme of ["light", "dark"] as const) {
        test(`layout, accessibility and picture, ${width} px, ${colorScheme}`, async () => {
          const page = await this.open({ viewport: { width, height: 900 }, colorScheme });
          await assertAccessible(page);
          // On a phone, tables are lists of cards, which must fit into the width. Only the picture of a system scrolls.
          await page.locator("details").evaluateAll((all) => all.forEach((one) => one.setAttribute("open", "")));
          const wide = await page.locator(".scroll:not(.system):visible").evaluateAll((all) => all.filter((one) => one.scrollWidth > one.clientWidth + 1).map((one) => one.firstElementChild!.className));
          if (width === 400) assert.deepEqual(wide, []);
          await screenshot(page, `${name}-${width}-${colorScheme}`);
        });
      }
    }
  }

  /** Tests, after all other tests, that no page wrote an error or made a request. */
  testSilence(): void {
    test("no page writes an error or asks for anything", () => {
      assert.deepEqual(this.faults, []);
    });
  }

  /** The recorded signals of a run. */
  recording(run: string): { names: string[]; rows: number[][] } {
    const [head, ...lines] = readFileSync(`${this.folder}/runs/${run}.csv`, "utf8").trim().split("\n");
    return { names: head!.split(","), rows: lines.map((line) => line.split(",").map(Number)) };
  }
}

/** Takes a screenshot of the whole page, and asserts that no part of it is blank. */
async function screenshot(page: Page, name: string): Promise<void> {
  mkdirSync(SCREENSHOTS, { recursive: true });
  const picture = await page.screenshot({ path: `${SCREENSHOTS}/${name}.png`, fullPage: true });
  const reader = await page.context().newPage();
  // Counts the colors of every fifth pixel, in strips with half the height of the window.
  const colors = await reader.evaluate(async (source) => {
    const image = new Image();
    image.src = source;
    await image.decode();
    const canvas = document.createElement("canvas");
    const strip = 450;
    [canvas.width, canvas.height] = [image.width, strip];
    const context = canvas.getContext("2d", { willReadFrequently: true })!;
    const found: number[] = [];
    for (let top = 0; top + strip <= image.height; top += strip) {
      context.drawImage(image, 0, -top);
      const pixels = new Uint32Array(context.getImageData(0, 0, canvas.width, strip).data.buffer);
      found.push(new Set(pixels.filter((_, i) => i % 5 === 0)).size);
    }
    return found;
  }, `data:image/png;base64,${picture.toString("base64")}`);
  await reader.close();
  assert.ok(colors.length > 0);
  // Antialiased text alone has more shades than this. A blank strip has one color, or a few if it contains the borders of a section.
  colors.forEach((count, i) => assert.ok(count > 8, `${name}: ${count} colors from ${450 * i} px on`));
}

/** Replaces the clipboard; returns a function for the texts that the page has copied. */
export async function catchCopies(page: Page): Promise<() => Promise<string[]>> {
  await page.evaluate(() => {
    Object.defineProperty(navigator, "clipboard", {
      value: { writeText: (text: string) => void (document.documentElement.dataset["copied"] = text) },
    });
  });
  return async () => (await page.locator("html").getAttribute("data-copied"))!.trim().split("\n");
}

/** Parses a number as formatted in pages. */
export { numberIn as number } from "../src/table";

/** Moves the mouse to the middle of a plot. */
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

/** Asserts that nothing is wider than the page, and that it has no serious accessibility violation. */
export async function assertAccessible(page: Page): Promise<void> {
  const [scroll, inner] = await page.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  assert.ok(scroll! <= inner!, `${scroll} px wide`);
  await page.evaluate(axe.source);
  const found = await page.evaluate(async () => {
    // Without preload, which would request style sheets.
    const { violations } = await (window as unknown as { axe: typeof axe }).axe.run({ preload: false });
    return violations
      .filter((one) => one.impact === "serious" || one.impact === "critical")
      .map((one) => `${one.id}: ${one.help}: ${one.nodes.map((node) => node.html).slice(0, 3).join(" ")}`);
  });
  assert.deepEqual(found, []);
}
