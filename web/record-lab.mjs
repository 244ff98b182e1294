// Records the view of the lab as an animated picture (WebP) for the README, in headless Chromium.
//
//   node record-lab.mjs --out FILE [--link '#…'] [--from 0] [--to 6] [--width 760] [--away 0]
//
// The run is simulated first; frames are taken from its saved rows, so the speed of this machine does not matter. Pillow, which
// scripts/setup installs, makes the animation.
import { execFileSync } from "node:child_process";
import { mkdtempSync, rmSync, statSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";
import { parseArgs } from "node:util";
import { chromium } from "playwright-core";

const { values: options } = parseArgs({
  options: {
    out: { type: "string" },
    link: { type: "string", default: "" },
    from: { type: "string", default: "0" },
    to: { type: "string", default: "6" },
    width: { type: "string", default: "760" },
    away: { type: "string", default: "0" },
  },
});
if (options.out === undefined) throw new Error("usage: node record-lab.mjs --out FILE");
const RATE = 12;
const ANIMATE = `import sys
from PIL import Image
out, width, *paths = sys.argv[1:]
frames = [Image.open(path).convert("RGB") for path in paths]
size = (int(width), 2 * round(frames[0].height * int(width) / frames[0].width / 2))
first, *others = [frame.resize(size, Image.Resampling.LANCZOS) for frame in frames]
first.save(out, "WebP", save_all=True, append_images=others, duration=${Math.round(1000 / RATE)}, quality=72)`;

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--enable-unsafe-swiftshader", "--use-gl=angle", "--use-angle=swiftshader"],
});
const page = await (await browser.newContext({ viewport: { width: 1400, height: 900 }, colorScheme: "light" })).newPage();
await page.goto(pathToFileURL(resolve("../target/lab/index.html")).href + options.link);
await page.waitForSelector('body[data-state="open"]');
await page.getByLabel("Speed", { exact: true }).first().selectOption("Infinity");
await page.getByLabel("Camera").selectOption("chase");
await page.getByLabel("Body motion").selectOption("1");
for (let i = 0; i < Number(options.away); i++) await page.getByRole("button", { name: "Farther away" }).click();
const [from, to] = [Number(options.from), Number(options.to)];
await page.waitForFunction((to) => Number.parseFloat(document.querySelector(".clock").textContent) >= to, to, { timeout: 120_000 });

const folder = mkdtempSync(join(tmpdir(), "lab-"));
const frames = [];
for (let i = 0; from + i / RATE <= to; i++) {
  await page.locator(".time").evaluate((slider, time) => {
    slider.value = String(time);
    slider.dispatchEvent(new Event("input"));
  }, from + i / RATE);
  // The page draws in the next frame.
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  frames.push(join(folder, `${i}.png`));
  await page.locator("#view").screenshot({ path: frames.at(-1) });
}
await browser.close();
execFileSync("../.venv/bin/python", ["-c", ANIMATE, options.out, options.width, ...frames], { stdio: "inherit" });
rmSync(folder, { recursive: true });
console.log(`${options.out}: ${frames.length} frames, ${Math.round(statSync(options.out).size / 1000)} kB`);
