// Records the view of the lab as an animated picture (WebP) for the README, in headless Chromium.
//
//   node record-lab.mjs --out FILE [--link '#…'] [--from 0] [--to 6] [--width 760] [--away 0]
//
// The run is simulated first; frames are taken from its saved rows, so the speed of this machine does not matter.
import { writeFileSync } from "node:fs";
import { resolve } from "node:path";
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
const QUALITY = 0.72;

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

const frames = [];
let size = { width: 0, height: 0 };
for (let i = 0; from + i / RATE <= to; i++) {
  await page.locator(".time").evaluate((slider, time) => {
    slider.value = String(time);
    slider.dispatchEvent(new Event("input"));
  }, from + i / RATE);
  // The page draws in the next frame.
  await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
  const image = (await page.locator("#view").screenshot()).toString("base64");
  const frame = await page.evaluate(
    async ([base64, width, quality]) => {
      const image = new Image();
      image.src = `data:image/png;base64,${base64}`;
      await image.decode();
      const height = 2 * Math.round((image.height * width) / image.width / 2);
      const canvas = Object.assign(document.createElement("canvas"), { width, height });
      const context = canvas.getContext("2d", { alpha: false });
      context.imageSmoothingQuality = "high";
      context.drawImage(image, 0, 0, width, height);
      return { width, height, data: canvas.toDataURL("image/webp", quality).split(",")[1] };
    },
    [image, Number(options.width), QUALITY],
  );
  size = frame;
  frames.push(Buffer.from(frame.data, "base64"));
}
await browser.close();

/** A chunk of a RIFF file. */
function chunk(name, ...parts) {
  const body = Buffer.concat(parts);
  const head = Buffer.alloc(8);
  head.write(name, "latin1");
  head.writeUInt32LE(body.length, 4);
  return Buffer.concat([head, body, Buffer.alloc(body.length % 2)]);
}
const number = (value, bytes) => {
  const result = Buffer.alloc(bytes);
  result.writeUIntLE(value, 0, bytes);
  return result;
};
/** The compressed picture in a WebP file: its chunk `VP8 `. */
function picture(file) {
  for (let at = 12; at < file.length; ) {
    const length = file.readUInt32LE(at + 4);
    if (file.toString("latin1", at, at + 4) === "VP8 ") return file.subarray(at, at + 8 + length + (length % 2));
    at += 8 + length + (length % 2);
  }
  throw new Error("the browser made a picture that is not lossy WebP");
}
const dimensions = Buffer.concat([number(size.width - 1, 3), number(size.height - 1, 3)]);
const animated = frames.map((file) => chunk("ANMF", number(0, 6), dimensions, number(Math.round(1000 / RATE), 3), number(0, 1), picture(file)));
const file = chunk("RIFF", Buffer.from("WEBP"), chunk("VP8X", number(2, 4), dimensions), chunk("ANIM", number(0xffffffff, 4), number(0, 2)), ...animated);
writeFileSync(options.out, file);
console.log(`${options.out}: ${frames.length} frames, ${Math.round(file.length / 1000)} kB`);
