/** The lab in a browser, with the engine and all FMUs. `scripts/lab` builds it. */

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { describe, test } from "node:test";
import type { Page } from "playwright-core";
import { assertAccessible } from "../browser";
import { after, ENDLESS_LOOP, fmu, module } from "../engine/foreign";
import { Lab, PATIENCE, clock, link, opening, picture, runTo, screenshot, setup, titles } from "./browser";

const FOLDER = process.env["CHASSIS_FMU_LAB"] ?? "../target/lab";
const FMUS = process.env["CHASSIS_FMU_LAB_FMUS"] ?? "../target/lab-build/fmus";
const lab = new Lab(FOLDER);
const VEHICLES = ["RescueVehicle", "HeavyVehicle", "EspCar", "HydroPneumaticHalfCar", "BicycleCar"];

const faults = () => assert.deepEqual(lab.faults.splice(0), []);

/** The numbers beside a plot, which are the values of its lines at the time shown. */
async function readout(page: Page, plot: number): Promise<number[]> {
  const texts = await page.locator(".plot").nth(plot).locator(".plot-readout b").allInnerTexts();
  return texts.map((text) => Number(text.replace("−", "-")));
}

/** Waits until `holds` accepts the numbers beside a plot, because a busy machine draws late. Returns these numbers, or the last ones. */
async function readoutOnce(page: Page, plot: number, holds: (numbers: number[]) => boolean): Promise<number[]> {
  for (const end = Date.now() + PATIENCE; Date.now() < end && !holds(await readout(page, plot)); ) await frames(page, 2);
  return readout(page, plot);
}

/** Waits for a number of frames. */
async function frames(page: Page, count: number): Promise<void> {
  await page.evaluate(async (count) => {
    for (let frame = 0; frame < count; frame++) await new Promise(requestAnimationFrame);
  }, count);
}

async function drop(page: Page, name: string, content: Buffer): Promise<void> {
  const transfer = await page.evaluateHandle(
    ([name, base64]) => {
      const bytes = Uint8Array.from(atob(base64!), (char) => char.charCodeAt(0));
      const transfer = new DataTransfer();
      transfer.items.add(new File([bytes], name!));
      return transfer;
    },
    [name, content.toString("base64")] as const,
  );
  for (const kind of ["dragover", "drop"]) await page.dispatchEvent("body", kind, { dataTransfer: transfer });
}

describe("start", () => {
  test("the rescue vehicle runs with its controllers beside its twin", async () => {
    const begin = performance.now();
    const page = await lab.open();
    console.log(`open after ${Math.round(performance.now() - begin)} ms`);
    assert.equal(await setup(page, "Vehicle").inputValue(), "RescueVehicle");
    assert.ok((await page.locator("#setup .controllers input:checked").count()) >= 3);
    await runTo(page, 1);
    assert.equal(await page.locator("#traces label").count(), 2);
    await picture(page, "start");
    await lab.close(page);
    faults();
  });

  test("the simulation waits for those who asked for less motion", async () => {
    const page = await lab.open({ reducedMotion: "reduce" });
    // If the simulation were running, the time shown would change in each frame.
    await frames(page, 40);
    assert.equal(await clock(page), 0);
    await page.getByRole("button", { name: "Play", exact: true }).click();
    await runTo(page, 0.3);
    await lab.close(page);
    faults();
  });

  test("it is faster than real time", async () => {
    const page = await lab.open();
    await page.getByLabel("Speed", { exact: true }).first().selectOption("Infinity");
    const [begin, from] = [performance.now(), await clock(page)];
    await page.getByRole("button", { name: "Replay" }).waitFor({ timeout: 60_000 });
    const [seconds, simulated] = [(performance.now() - begin) / 1000, (await clock(page)) - from];
    console.log(`${simulated.toFixed(1)} s in ${seconds.toFixed(2)} s: ${(simulated / seconds).toFixed(1)} times real time, view and plots included`);
    await lab.close(page);
    faults();
  });
});

describe("systems", () => {
  for (const vehicle of VEHICLES) {
    test(`${vehicle} runs, with each of its controllers`, async () => {
      const page = await lab.open();
      if (vehicle !== "RescueVehicle") {
        const title = await opening(page, () => setup(page, "Vehicle").selectOption(vehicle));
        assert.match(title, new RegExp(vehicle));
      }
      await runTo(page, 1);
      await page.getByRole("button", { name: "Pause" }).click();
      await picture(page, vehicle);
      // Some controllers are in a list that is initially closed.
      const more = page.locator("#setup fieldset summary");
      if (await more.isVisible()) await more.click();
      const boxes = page.locator("#setup .controllers input");
      const names = await boxes.evaluateAll((all) => all.map((one) => (one as HTMLElement).dataset["key"]!));
      for (const name of names) {
        const box = page.locator(`#setup input[data-key="${name}"]`);
        const was = await box.isChecked();
        await opening(page, () => box.click());
        assert.equal(await box.isChecked(), !was, name);
        await runTo(page, 0.2);
        const { system } = await link(page);
        assert.equal((system["controllers"] as string[]).includes(name.replace("controller ", "")), !was);
      }
      assert.equal(await page.locator(".message.error").count(), 0, (await page.locator(".message").allInnerTexts()).join());
      await lab.close(page);
      faults();
    });
  }

  test("maneuvers and roads can be chosen", async () => {
    const page = await lab.open();
    for (const label of ["Maneuver", "Road"]) {
      for (const value of await titles(page, label)) {
        if ((await setup(page, label).inputValue()) === value) continue;
        await opening(page, () => setup(page, label).selectOption(value));
        await runTo(page, 0.2);
      }
    }
    assert.equal(await page.locator(".message.error").count(), 0, (await page.locator(".message").allInnerTexts()).join());
    await lab.close(page);
    faults();
  });

  test("a scenario of the library runs with another case beside it", async () => {
    const page = await lab.open();
    await opening(page, () => setup(page, "Simulate").selectOption("scenario"));
    await opening(page, () => setup(page, "Scenario").selectOption("rescue_vehicle_step_steer"));
    await runTo(page, 1);
    assert.equal(await page.locator("#traces label").count(), 2);
    await page.locator("#metrics table").waitFor();
    await lab.close(page);
    faults();
  });
});

describe("while it runs", () => {
  test("rewinding and another value make a branch", async () => {
    const page = await lab.open();
    await runTo(page, 2.5);
    await page.getByRole("button", { name: "Pause" }).click();
    const time = page.getByRole("slider", { name: /^Time/ });
    await time.focus();
    await page.keyboard.press("Home");
    await page.keyboard.press("PageUp");
    await page.waitForFunction(() => document.querySelector(".clock")!.textContent === "1.00 s");
    // The first slider; any value of the system would do.
    const slider = page.locator("#adjust .slider input").first();
    await slider.focus();
    await page.keyboard.press("Home");
    await page.getByRole("button", { name: "Play", exact: true }).click();
    await runTo(page, 2.4);
    await page.locator("#traces label").nth(2).waitFor();
    assert.match(await page.locator("#traces label").nth(2).innerText(), /Branch 1/);
    assert.equal((await readout(page, 0)).length, 3);
    assert.equal(Object.keys((await link(page)).values).length, 1);
    await page.getByLabel("Beside it").selectOption({ label: await page.locator("#traces label").nth(2).innerText() });
    await picture(page, "branches");
    await lab.close(page);
    faults();
  });

  test("rewinding without a change gives the same run", async () => {
    const page = await lab.open();
    await runTo(page, 2.5);
    await page.getByRole("button", { name: "Pause" }).click();
    const time = page.getByRole("slider", { name: /^Time/ });
    await time.focus();
    await page.keyboard.press("Home");
    await page.keyboard.press("PageUp");
    await page.getByRole("button", { name: "Play", exact: true }).click();
    await runTo(page, 2.4);
    await page.getByRole("button", { name: "Pause" }).click();
    await time.focus();
    await page.keyboard.press("Home");
    for (let i = 0; i < 2; i++) await page.keyboard.press("PageUp");
    for (const plot of [0, 1, 2, 3]) {
      const [own, , branch] = await readoutOnce(page, plot, ([own, , branch]) => own !== undefined && own === branch);
      assert.ok(own !== undefined);
      assert.equal(own, branch);
    }
    await lab.close(page);
    faults();
  });

  test("the vehicle is driven by keys", async () => {
    const page = await lab.open();
    await opening(page, () => setup(page, "Maneuver").selectOption("free"));
    await page.locator("#driving").waitFor();
    await runTo(page, 0.5);
    await page.locator("#title").click();
    await page.keyboard.down("ArrowLeft");
    // Steering takes wall-clock time.
    await page.waitForFunction(() => document.querySelector<HTMLInputElement>("#driving .mirrored")!.valueAsNumber > 0.9);
    await runTo(page, (await clock(page)) + 1.5);
    await page.keyboard.up("ArrowLeft");
    const yaw = page.locator(".plot").first();
    await yaw.locator("select").selectOption("vehicle.yaw");
    const [left] = await readoutOnce(page, 0, ([left]) => left! > 1);
    assert.ok(left! > 1, `yaw angle ${left} deg`);
    await picture(page, "driving");
    await lab.close(page);
    faults();
  });

  test("the vehicle is driven by a gamepad", async () => {
    const page = await lab.page();
    await page.addInitScript(() => {
      const buttons = Array.from({ length: 16 }, () => ({ value: 0 }));
      Object.assign(navigator, { getGamepads: () => [{ connected: true, axes: [0.9, 0], buttons }] });
    });
    await page.goto(lab.url);
    await page.waitForSelector('body[data-state="open"]', { timeout: 60_000 });
    await opening(page, () => setup(page, "Maneuver").selectOption("free"));
    await runTo(page, 2);
    await page.locator(".plot select").first().selectOption("vehicle.yaw");
    const [right] = await readoutOnce(page, 0, ([right]) => right! < -1);
    assert.ok(right! < -1, `yaw angle ${right} deg`);
    await lab.close(page);
    faults();
  });

  test("metrics, files and descriptions", async () => {
    const page = await lab.open();
    await runTo(page, 1);
    await page.locator("#metrics table").waitFor({ timeout: 20_000 });
    for (const [button, ending] of [["CSV", ".csv"], ["CSV of the twin", ".csv"], ["SSP", "_wasm32.ssp"]] as const) {
      const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: button, exact: true }).click()]);
      assert.ok(download.suggestedFilename().endsWith(ending), download.suggestedFilename());
      const content = readFileSync(await download.path());
      assert.ok(content.length > 100);
      if (ending === ".csv") {
        const [vehicle, ...with_] = download.suggestedFilename().split(/_with(?:out)?_/);
        assert.equal(vehicle, "RescueVehicle");
        assert.match(with_[0]!, button === "CSV" ? /DualSlidingModeSteering.*_iso3888_1\.csv$/ : /^control_iso3888_1\.csv$/);
        const [head] = content.toString("utf8").split("\n");
        assert.match(head!, /^time,/);
        // Only a controller writes this signal, so the twin's file does not contain it.
        assert.equal(head!.split(",").includes("weight.integrated"), button === "CSV", head);
      }
      else assert.equal(content.toString("latin1", 0, 2), "PK");
    }
    await page.locator(".documentation h3, .documentation h4").first().waitFor();
    await page.getByLabel("Show", { exact: true }).selectOption("variables");
    await page.locator(".variables tbody tr").first().waitFor();
    await page.getByLabel("Find a variable by its name or description").fill("body.roll");
    assert.match(await page.locator(".variables tbody tr").first().innerText(), /body\.roll/);
    await lab.close(page);
    faults();
  });
});

describe("FMUs of the visitor", () => {
  test("a controller takes the place of another one", async () => {
    const page = await lab.open();
    const title = await opening(page, () => drop(page, "MySteering.fmu", readFileSync(`${FMUS}/DualSlidingModeSteering.fmu`)));
    assert.ok(title.length > 0);
    const { system } = await link(page);
    const controllers = system["controllers"] as string[];
    assert.ok(controllers.includes("MySteering"));
    // The name of the model differs from the file name.
    assert.match(await page.locator(".message").last().innerText(), /MySteering is part of the system\.\s+DualSlidingModeSteering: Multi-ax\w+ steering/);
    assert.match(await page.locator('#setup li:has([data-key="controller MySteering"])').innerText(), /DualSlidingModeSteering: Multi-ax\w+ steering/);
    assert.ok(!controllers.includes("DualSlidingModeSteering"));
    await runTo(page, 0.5);
    await lab.close(page);
    faults();
  });

  test("what is not an FMU is refused by name, and the system goes on", async () => {
    const page = await lab.open();
    await runTo(page, 0.2);
    await drop(page, "Broken.fmu", Buffer.from("this is not an archive"));
    const message = page.locator(".message.error").first();
    await message.waitFor();
    assert.match(await message.innerText(), /Broken/);
    const time = await clock(page);
    await runTo(page, time + 0.3);
    await lab.close(page);
    faults();
  });

  test("a panic is shown, and the twin goes on", async () => {
    const page = await lab.open();
    await opening(page, () => setup(page, "Vehicle").selectOption("EspCar"));
    await opening(page, () => drop(page, "PanickingController.fmu", readFileSync(`${FMUS}/../tests/PanickingController.fmu`)));
    const message = page.locator(".message.error").first();
    await message.waitFor();
    assert.match(await message.innerText(), /panicking_controller[^]*index out of bounds: the len is 4 but the index is 4/);
    await runTo(page, (await clock(page)) + 0.3);
    await lab.close(page);
    faults();
  });

  test("an endless loop is ended, and its FMU is left out", async () => {
    const page = await lab.open();
    await opening(page, () => setup(page, "Vehicle").selectOption("EspCar"));
    await drop(page, "Endless.fmu", Buffer.from(fmu("Endless", module({ fmi2DoStep: after(100, ENDLESS_LOOP) }))));
    const message = page.locator(".message.error").first();
    await message.waitFor({ timeout: PATIENCE });
    assert.match(await message.innerText(), /[Ee]ndless did not return from a call/);
    // The system is open again without the FMU.
    await page.waitForFunction(() => document.querySelector('[data-key="controller Endless"]') === null, null, { timeout: PATIENCE });
    assert.ok(!((await link(page)).system["controllers"] as string[]).includes("Endless"));
    await page.getByRole("button", { name: "Play", exact: true }).click();
    await runTo(page, 0.5);
    await lab.close(page);
    faults();
  });

  test("a file input does the same", async () => {
    const page = await lab.open();
    await opening(page, () => page.locator("#fmu-file").setInputFiles({ name: "Other.fmu", mimeType: "application/zip", buffer: readFileSync(`${FMUS}/DualSlidingModeSteering.fmu`) }));
    assert.ok(((await link(page)).system["controllers"] as string[]).includes("Other"));
    await lab.close(page);
    faults();
  });
});

describe("links", () => {
  test("a link opens the setup that it was made from", async () => {
    const page = await lab.open();
    await opening(page, () => setup(page, "Vehicle").selectOption("EspCar"));
    await opening(page, () => page.getByRole("button", { name: "None", exact: true }).click());
    await page.locator("#adjust .slider input").first().focus();
    await page.keyboard.press("ArrowRight");
    const url = await page.getByLabel("Link to this setup").inputValue();
    const before = await link(page);
    assert.equal(Object.keys(before.values).length, 1);
    const other = await lab.page();
    await other.goto(url);
    await other.waitForSelector('body[data-state="open"]');
    assert.deepEqual(await link(other), before);
    assert.equal(await setup(other, "Vehicle").inputValue(), "EspCar");
    await lab.close(page);
    await lab.close(other);
    faults();
  });

  test("a link to a system with a dropped FMU opens when that FMU is dropped, too", async () => {
    const page = await lab.open();
    const steering = readFileSync(`${FMUS}/DualSlidingModeSteering.fmu`);
    await opening(page, () => drop(page, "MySteering.fmu", steering));
    const url = await page.getByLabel("Link to this setup").inputValue();
    const expected = await link(page);
    const other = await lab.page();
    await other.goto(url);
    await other.waitForSelector('body[data-state="open"]', { timeout: PATIENCE });
    assert.match(await other.locator(".message.error").innerText(), /MySteering, which the link does not contain\. Drop MySteering\.fmu/);
    assert.deepEqual((await link(other)).system["vehicle"], expected.system["vehicle"]);
    await opening(other, () => drop(other, "MySteering.fmu", steering));
    assert.deepEqual(await link(other), expected);
    await lab.close(page);
    await lab.close(other);
    faults();
  });

  test("sliders have the names of what they move", async () => {
    const page = await lab.open();
    assert.ok((await page.getByRole("slider", { name: /speed/i }).count()) > 0);
    await lab.close(page);
    faults();
  });

  test("a short link opens a case of a scenario", async () => {
    const page = await lab.open({}, "#scenario=rescue_vehicle_step_steer&seed=2");
    const { system } = await link(page);
    assert.equal(system["scenario"], "rescue_vehicle_step_steer");
    assert.equal(system["seed"], 2);
    await lab.close(page);
    faults();
  });

  test("an unusable link is reported", async () => {
    const page = await lab.open({}, "#scenario=nowhere");
    assert.match(await page.locator(".message.error").innerText(), /nowhere/);
    await lab.close(page);
    faults();
  });
});

describe("everyone", () => {
  for (const width of [1400, 400]) {
    for (const colorScheme of ["light", "dark"] as const) {
      test(`no violation of accessibility at ${width} px in the ${colorScheme} scheme`, async () => {
        const page = await lab.open({ viewport: { width, height: width > 1000 ? 900 : 800 }, colorScheme });
        await runTo(page, 1.5);
        await page.getByRole("button", { name: "Pause" }).click();
        await page.locator("#metrics table").waitFor({ timeout: 20_000 });
        await assertAccessible(page);
        await page.getByLabel("Show", { exact: true }).selectOption("variables");
        await page.locator(".variables tbody tr").first().waitFor();
        await assertAccessible(page);
        await page.evaluate(() => scrollTo(0, 0));
        await screenshot(page, `${width}-${colorScheme}`);
        await picture(page, `view-${width}-${colorScheme}`);
        await lab.close(page);
        faults();
      });
    }
  }

  test("on a phone the view stays while sliders move, and speed and friction are on the first screen", async () => {
    const page = await lab.open({ viewport: { width: 400, height: 800 } });
    for (const name of ["Speed", "road_friction"]) {
      const box = (await page.getByRole("slider", { name, exact: true }).boundingBox())!;
      assert.ok(box.y + box.height <= 800, `${name} at ${box.y} px`);
    }
    const slider = page.locator("#adjust .slider input").first();
    await slider.scrollIntoViewIfNeeded();
    await page.evaluate(() => document.querySelector("#adjust .slider")!.scrollIntoView({ block: "center" }));
    const [view, input] = [(await page.locator("#view").boundingBox())!, (await slider.boundingBox())!];
    assert.ok(view.y > -2 && view.y + view.height <= input.y && input.y < 800, `view from ${view.y} to ${view.y + view.height}, slider at ${input.y}`);
    const table = page.locator("#metrics .scroll");
    await table.waitFor({ timeout: 20_000 });
    assert.ok(await table.evaluate((one) => one.scrollWidth <= one.clientWidth));
    assert.ok((await page.locator("#metrics td[data-label]").count()) > 0);
    await lab.close(page);
    faults();
  });

  test("the keyboard alone reaches everything", async () => {
    const page = await lab.open();
    await runTo(page, 0.3);
    await page.keyboard.press("Space");
    await page.getByRole("button", { name: "Play", exact: true }).waitFor();
    // One cycle through the page reaches every control, and each shows that it has the focus.
    const reached = new Set<string>();
    const expected = await page.evaluate(() => {
      const all = [...document.querySelectorAll<HTMLElement>("button, select, input, summary")].filter((one) => one.checkVisibility() && !one.matches(":disabled"));
      all.forEach((one, i) => (one.dataset["test"] = String(i)));
      return all.map((one) => one.outerHTML.slice(0, 120));
    });
    for (let i = 0; i < expected.length + 60; i++) {
      await page.keyboard.press("Tab");
      const [key, outline] = await page.evaluate(() => {
        const active = document.activeElement as HTMLElement | null;
        return [active?.dataset["test"] ?? "", active === null ? "" : getComputedStyle(active).outlineStyle] as const;
      });
      if (key === "") continue;
      reached.add(key);
      assert.notEqual(outline, "none", expected[Number(key)]);
    }
    const missed = expected.filter((_, i) => !reached.has(String(i)));
    assert.deepEqual(missed, []);
    // A select in the setup keeps the focus after it has opened another system.
    await setup(page, "Vehicle").focus();
    await opening(page, () => page.keyboard.press("h"));
    assert.equal(await page.evaluate(() => (document.activeElement as HTMLElement).dataset["key"]), "vehicle");
    await lab.close(page);
    faults();
  });
});
