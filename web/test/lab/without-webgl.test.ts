/** The lab in a browser without WebGL. */

import assert from "node:assert/strict";
import { test } from "node:test";
import { assertAccessible } from "../browser";
import { Lab, runTo, screenshot } from "./browser";

const lab = new Lab(process.env["CHASSIS_FMU_LAB"] ?? "../target/lab", ["--disable-3d-apis"]);

test("a message takes the place of the view, and the plots go on", async () => {
  const page = await lab.open();
  await runTo(page, 0.5);
  assert.match(await page.locator("#cover").innerText(), /WebGL/);
  assert.equal(await page.locator(".plot canvas").count(), 4);
  await page.locator(".plot select").first().selectOption("vehicle.position_x");
  const value = page.locator(".plot-readout b").first();
  const before = await value.innerText();
  await runTo(page, 1.5);
  assert.notEqual(await value.innerText(), before);
  await assertAccessible(page);
  await screenshot(page, "without-webgl");
  assert.deepEqual(lab.faults, []);
});
