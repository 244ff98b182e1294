/** Shared code for tests of the lab: a browser, its pages, and access to the state that a page shows. */

import assert from "node:assert/strict";
import { mkdirSync } from "node:fs";
import { after, before } from "node:test";
import { pathToFileURL } from "node:url";
import { resolve } from "node:path";
import { type Browser, type BrowserContextOptions, type Page, chromium } from "playwright-core";

const CHROMIUM = process.env["CHROMIUM"] ?? "/usr/bin/chromium";
const SCREENSHOTS = resolve("../target/lab/screenshots");
/** Longest time for opening a system on a busy machine, ms. */
export const PATIENCE = 60_000;

export class Lab {
  /** Unexpected console messages and requests of pages. */
  readonly faults: string[] = [];
  readonly #url: string;
  #browser: Browser | null = null;

  constructor(
    readonly folder: string,
    args: string[] = [],
  ) {
    this.#url = pathToFileURL(resolve(folder, "index.html")).href;
    before(async () => {
      // The software renderer provides WebGL without a graphics card.
      const webgl = ["--enable-unsafe-swiftshader", "--use-gl=angle", "--use-angle=swiftshader"];
      this.#browser = await chromium.launch({ executablePath: CHROMIUM, args: ["--no-sandbox", ...(args.length > 0 ? args : webgl)] });
    });
    after(() => this.#browser?.close());
  }

  get url(): string {
    return this.#url;
  }

  async page(options: BrowserContextOptions = {}): Promise<Page> {
    assert.ok(this.#browser !== null);
    const page = await (await this.#browser.newContext({ viewport: { width: 1400, height: 900 }, ...options })).newPage();
    page.on("console", (message) => ["error", "warning"].includes(message.type()) && !/GPU stall|WebGL|GroupMarkerNotSet/.test(message.text()) && this.faults.push(message.text()));
    page.on("pageerror", (error) => this.faults.push(String(error)));
    const folder = this.#url.replace(/index\.html$/, "");
    page.on("request", (request) => /^(blob|data):/.test(request.url()) || request.url().startsWith(folder) || this.faults.push(`request of ${request.url()}`));
    return page;
  }

  /** Opens a page, and waits until its system is open. */
  async open(options: BrowserContextOptions = {}, hash = ""): Promise<Page> {
    const page = await this.page(options);
    await page.goto(this.#url + hash);
    await page.waitForSelector('body[data-state="open"]', { timeout: PATIENCE });
    return page;
  }

  async close(page: Page): Promise<void> {
    await page.context().close();
  }
}

/** The time shown, s. */
export async function clock(page: Page): Promise<number> {
  return Number.parseFloat(await page.locator(".clock").innerText());
}

/** Waits until a time is shown. */
export async function runTo(page: Page, time: number): Promise<void> {
  await page.waitForFunction((time) => Number.parseFloat(document.querySelector(".clock")?.textContent ?? "") >= time, time, { timeout: PATIENCE });
}

/** Performs an action that opens a system, and waits for it; returns the system's title. */
export async function opening(page: Page, action: () => Promise<unknown>): Promise<string> {
  await page.evaluate(() => (document.getElementById("status")!.textContent = ""));
  await action();
  await page.waitForFunction(() => document.getElementById("status")!.textContent !== "", null, { timeout: PATIENCE });
  return page.locator("#title").innerText();
}

export const setup = (page: Page, label: string) => page.locator("#setup").getByLabel(label, { exact: true });

export const titles = (page: Page, label: string): Promise<string[]> => setup(page, label).locator("option").evaluateAll((all) => all.map((one) => (one as HTMLOptionElement).value));

/** The setup in the link of the page. */
export async function link(page: Page): Promise<{ system: Record<string, unknown>; values: Record<string, number> }> {
  const text = await page.getByLabel("Link to this setup").inputValue();
  return JSON.parse(Buffer.from(text.split("#setup=")[1]!, "base64url").toString());
}

/** Takes a screenshot of the view, and asserts that it is not blank. */
export async function picture(page: Page, name: string): Promise<void> {
  mkdirSync(SCREENSHOTS, { recursive: true });
  const image = await page.locator("#view").screenshot({ path: `${SCREENSHOTS}/${name}.png` });
  const colors = await page.evaluate(async (base64) => {
    const image = new Image();
    image.src = `data:image/png;base64,${base64}`;
    await image.decode();
    const canvas = new OffscreenCanvas(image.width, image.height);
    const context = canvas.getContext("2d")!;
    context.drawImage(image, 0, 0);
    const { data } = context.getImageData(0, 0, image.width, image.height);
    const found = new Set<number>();
    for (let i = 0; i < data.length; i += 4) found.add((data[i]! >> 3) * 1024 + (data[i + 1]! >> 3) * 32 + (data[i + 2]! >> 3));
    return found.size;
  }, image.toString("base64"));
  // The sky and the ground alone have a few dozen colors.
  assert.ok(colors > 100, `${name}: ${colors} colors`);
}

export async function screenshot(page: Page, name: string): Promise<void> {
  mkdirSync(SCREENSHOTS, { recursive: true });
  await page.screenshot({ path: `${SCREENSHOTS}/${name}.png` });
}

