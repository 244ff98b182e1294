// Systems of the lab in Node.js: every vehicle and maneuver, rewinding, driving, and measurements.
import assert from "node:assert/strict";
import { before, test } from "node:test";
import { Client, free } from "./lab";

const client = new Client();
before(() => client.start());

/** The last value of each column by name. */
function last(system = 0, branch = 0): Record<string, number> {
  const rows = client.rows(system, branch);
  const columns = client.opened?.systems[system]?.columns ?? [];
  return Object.fromEntries(columns.map(({ name }, index) => [name, rows.at(-1)?.[index + 1] ?? Number.NaN]));
}

/** Runs the systems up to a time, s, unless they fail. */
async function until(time: number): Promise<void> {
  while (client.time < time && failures().length === 0) await client.play(Number.POSITIVE_INFINITY, 5);
}

function failures(): string[] {
  return client.events.flatMap((event) => (event.kind === "failed" ? [`${event.system} ${event.time} ${event.component}: ${event.message}`] : []));
}

/** Failures other than a rollover. A rollover can happen soon after the time that a test waits for, depending on the machine. */
function faults(): string[] {
  return failures().filter((failure) => !failure.includes("the vehicle rolled over"));
}

test("every vehicle runs every maneuver that it can drive, with its controllers", async (context) => {
  let yesOrNo = 0;
  for (const { fmu, defaults, maneuvers } of client.catalog?.vehicles ?? []) {
    for (const id of maneuvers) {
      await context.test(`${fmu} ${id}`, async () => {
        const { systems } = await client.open(free(fmu, defaults, id));
        assert.equal(systems.length, defaults.length > 0 ? 2 : 1);
        await until(0.2);
        assert.deepEqual(faults(), []);
        assert.ok(client.time > 0.1, `${client.time} s`);
        assert.ok(Object.values(last()).every(Number.isFinite));
        for (const { title, definition, values, reason } of await client.metrics()) {
          assert.ok(title !== "" && (values[0] !== null || reason !== ""), `${title} has neither a value nor a reason`);
          const isYesOrNo = typeof values[0] === "boolean";
          if (values[0] !== null) assert.equal(isYesOrNo, definition.startsWith("True if"), title);
          yesOrNo += Number(isYesOrNo);
        }
      });
    }
  }
  assert.ok(yesOrNo > 0, "some metrics are yes or no");
});

test("each controller can be swapped in alone with what it needs", async (context) => {
  for (const { fmu, controllers } of client.catalog?.vehicles ?? []) {
    for (const { fmu: controller, needs } of controllers) {
      await context.test(`${fmu} with ${controller}`, async () => {
        const chosen = new Set([controller]);
        const add = (names: string[]): void => {
          for (const name of names) {
            const other = controllers.find((known) => known.fmu === name);
            if (other === undefined || chosen.has(name) || other.excludes.some((excluded) => chosen.has(excluded))) continue;
            chosen.add(name);
            add(other.needs);
          }
        };
        add(needs);
        await client.open(free(fmu, [...chosen], "free"));
        await until(0.2);
        assert.deepEqual(failures(), []);
        assert.ok(client.time > 0.1);
      });
    }
  }
});

test("a rollover ends the run, as on the test bench", async () => {
  await client.open(free("HydroPneumaticHalfCar", [], "fishhook"));
  await until(9);
  // Reference: the test bench, which ends a run at a roll angle of 0.8 rad.
  assert.match(failures()[0] ?? "", /rolled over/);
  assert.ok(Math.abs(last()["body.roll"] ?? 0) > 0.7, `${last()["body.roll"]} rad`);
  assert.ok(Math.abs(last()["body.roll"] ?? 0) < 1, `${last()["body.roll"]} rad`);
  assert.ok(client.time < 9, `${client.time} s`);
});

test("a branch reports the systems that stop in it", async () => {
  const setup = free("HydroPneumaticHalfCar", client.catalog?.vehicles.find(({ fmu }) => fmu === "HydroPneumaticHalfCar")?.defaults ?? [], "fishhook");
  await client.open(setup);
  const stops = () => client.events.splice(0).flatMap((event) => (event.kind === "failed" ? [[event.system, event.time.toFixed(3)]] : []));
  await client.run();
  // The twin rolls over first.
  const expected = stops();
  assert.deepEqual(expected.map(([system]) => system), [1, 0]);
  for (const time of [2.3, 1]) {
    assert.ok(time === 1 || (time > Number(expected[0]?.[1]) && time < Number(expected[1]?.[1])));
    await client.expect("sought", "seek", { time });
    await client.run();
    assert.equal(client.events.findIndex(({ kind }) => kind === "branch") < client.events.findIndex(({ kind }) => kind === "failed"), true);
    assert.deepEqual(stops(), expected, `from ${time} s`);
  }
});

test("rewound and replayed, a run has the same rows; continued otherwise, another branch", async () => {
  const setup = free("RescueVehicle", client.catalog?.vehicles.find(({ fmu }) => fmu === "RescueVehicle")?.defaults ?? [], "free", {}, "c");
  await client.open(setup);
  const drive = (steer: number) => client.engine.receive({ kind: "drive", driving: { steer, throttle: 0.2, brake: 0 } });
  drive(0.1);
  await until(4);
  const original = client.rows(0, 0);
  const { time } = await client.expect("sought", "seek", { time: 2.5 });
  assert.ok(Math.abs(time - 2.5) < 1e-9);
  await until(3.5);
  const again = client.rows(0, 1);
  assert.ok(again.length > 10);
  const from = original.findIndex(([at]) => (at ?? 0) === again[0]?.[0]);
  const common = Math.min(again.length, original.length - from);
  assert.ok(common > 10);
  assert.deepEqual(again.slice(0, common), original.slice(from, from + common));
  await client.expect("sought", "seek", { time: 2.5 });
  drive(-0.3);
  await until(3.5);
  const other = client.rows(0, 2);
  assert.notDeepEqual(other.slice(5, 20), again.slice(5, 20));
  assert.deepEqual(
    client.events.filter((event) => event.kind === "branch").map((event) => event.branch),
    [1, 2],
  );
});

test("sliders and driving change the run", async () => {
  const { systems } = await client.open(free("EspCar", ["DirectYawControl"], "free"));
  const ids = systems[0]?.adjustables.map(({ id }) => id) ?? [];
  assert.ok(ids.includes("plant:road_friction.*"), ids.join(" "));
  client.engine.receive({ kind: "drive", driving: { steer: 0.3, throttle: 0, brake: 0 } });
  await until(1);
  const yaw = Math.abs(last()["vehicle.yaw_rate"] ?? 0);
  assert.ok(yaw > 0.01, `yaw rate ${yaw}`);
  for (const { id, max } of systems[0]?.adjustables ?? []) client.engine.receive({ kind: "set", system: 0, adjustable: id, value: max });
  await until(1.5);
  assert.deepEqual(faults(), []);
});

test("files and descriptions", async () => {
  await client.open(free("EspCar", ["DirectYawControl", "AntilockBraking"], "step_steer"));
  await until(1);
  const [header = "", first = ""] = (await client.csv()).split("\n");
  assert.ok(header.startsWith("time,") && first.startsWith("0.0,"));
  // The file contains a controller's signal.
  assert.ok(header.split(",").some((name) => name.startsWith("yaw_control_pressure.")), header);
  assert.equal(first.split(",").length, header.split(",").length);
  const ssp = await client.expect("file", "ssp", { system: 0 });
  // The name states that its FMUs only have binaries for WebAssembly.
  assert.ok(ssp.name.endsWith("_wasm32.ssp"), ssp.name);
  assert.equal(Buffer.from(ssp.bytes.subarray(0, 2)).toString(), "PK");
  const { variables } = await client.expect("described", "describe", { fmu: "EspCar" });
  assert.ok(variables.some(({ name, causality }) => name === "steer.front" && causality === "input"));
});

/** The median. */
function median(values: number[]): number {
  return [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)] ?? Number.NaN;
}

test("measurements of a truck and its twin", async () => {
  const defaults = client.catalog?.vehicles.find(({ fmu }) => fmu === "RescueVehicle")?.defaults ?? [];
  await client.open(free("RescueVehicle", defaults, "free", {}, "c"));
  await until(2);
  const [began, cpu] = [performance.now(), process.cpuUsage()];
  const from = client.time;
  while (client.time < from + 20) await client.play(Number.POSITIVE_INFINITY, 200);
  const simulated = client.time - from;
  const { user, system } = process.cpuUsage(cpu);
  const [wall, busy] = [performance.now() - began, (user + system) / 1000];
  const speed = (milliseconds: number) => ((1000 * simulated) / milliseconds).toFixed(1);
  console.log(`${speed(wall)} times real time, ${speed(busy)} by CPU time`);
  const restored: number[] = [];
  for (let time = 20; time > 2; time--) {
    const sought = performance.now();
    await client.expect("sought", "seek", { time });
    restored.push(performance.now() - sought);
  }
  const core = client.engine.core;
  assert.ok(core !== null);
  const timed = (): number => {
    const start = performance.now();
    core.advance(0, 1);
    return performance.now() - start;
  };
  // The state is saved before the first step of each second.
  const saved = Array.from({ length: 20 }, () => {
    core.advance(0, 999 - (Math.round(1000 * core.time(0)) % 1000) + 1);
    const [first, second] = [timed(), timed()];
    return first - second;
  });
  console.log(`one system is saved in ${median(saved).toFixed(2)} ms, both are restored in ${median(restored).toFixed(2)} ms (medians)`);
});

test("ten minutes fit into 200 MB", async () => {
  const defaults = client.catalog?.vehicles.find(({ fmu }) => fmu === "RescueVehicle")?.defaults ?? [];
  await client.open(free("RescueVehicle", defaults, "free", {}, "c"));
  await until(60);
  const [early, at] = [client.engine.core?.size ?? 0, client.time];
  await until(120);
  // The memory that grows with time contains the rows, and a saved state per second.
  const later = client.engine.core?.size ?? 0;
  const all = early + ((later - early) * (600 - at)) / (client.time - at);
  console.log(`${(later / 1e6).toFixed(1)} MB after ${client.time.toFixed(0)} s, ${(all / 1e6).toFixed(0)} MB after ten minutes`);
  assert.ok(all < 200e6);
});
