/** Failures that the real engine does not cause on demand, with a mock engine. */

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { before, test } from "node:test";
import { Lab, PATIENCE, clock, link, opening, runTo } from "./browser";

const FOLDER = "../target/lab-test";
const lab = new Lab(FOLDER);
before(() => {
  const input = process.env["CHASSIS_FMU_LAB_BUILD"] ?? "../target/lab-build";
  execFileSync(process.execPath, ["build-lab.mjs", "--in", input, "--out", FOLDER, "--worker", "test/lab/mock-engine.ts"]);
});

test("a worker that does not return is ended, and the component is named", async () => {
  const page = await lab.open();
  await page.locator("#setup fieldset summary").click();
  await opening(page, () => page.getByLabel("Endless").click());
  await page.locator(".message.error").waitFor({ timeout: 15_000 });
  assert.match(await page.locator(".message.error").innerText(), /Endless did not return from a call after 0\.9\d s/);
  // The system is open again without the FMU.
  await page.waitForFunction(() => !(document.querySelector('[data-key="controller Endless"]') as HTMLInputElement).checked);
  assert.deepEqual((await link(page)).system["controllers"], []);
  await page.getByRole("button", { name: "Play", exact: true }).click();
  await runTo(page, 0.5);
  assert.deepEqual(lab.faults, []);
});

test("a failed component is named, and the twin goes on", async () => {
  const page = await lab.open();
  await page.locator("#setup fieldset summary").click();
  await opening(page, () => page.getByLabel("Broken").click());
  await page.locator(".message.error").waitFor();
  assert.match(await page.locator(".message.error").innerText(), /Broken failed at 1\.000 s: division by zero/);
  const time = await clock(page);
  await runTo(page, time + 0.5);
  assert.deepEqual(lab.faults, []);
});

test("numbers are provisional until the end, and again after a rewind from a rollover", async () => {
  const page = await lab.open();
  await page.locator("#setup fieldset summary").click();
  await opening(page, () => page.getByLabel("Rollover").click());
  // Each check is a single query, because the run continues.
  const provisional = page.locator("#metrics:not(:has(.badge))").filter({ hasText: /Provisional: \d\.\d s of at most 12\.0 s/ });
  const final = page.locator("#metrics:has(.badge.pass)").filter({ hasNotText: "Provisional" });
  await provisional.waitFor({ timeout: PATIENCE });
  // The run ends when both systems have failed, long before the end of the maneuver.
  await final.waitFor({ timeout: PATIENCE });
  await page.getByRole("slider", { name: /^Time/ }).focus();
  await page.keyboard.press("Home");
  await page.getByRole("button", { name: "Play", exact: true }).click();
  await provisional.waitFor({ timeout: PATIENCE });
  await final.waitFor({ timeout: PATIENCE });
  assert.deepEqual(lab.faults, []);
});

test("a refused file is named with what to do", async () => {
  const page = await lab.open();
  await page.locator("#fmu-file").setInputFiles({ name: "Native.fmu", mimeType: "application/zip", buffer: Buffer.from("PK") });
  await page.locator(".message.error").waitFor();
  assert.match(await page.locator(".message.error").innerText(), /Native\.fmu has no binary for WebAssembly\. Pack it/);
  assert.deepEqual(lab.faults, []);
});
