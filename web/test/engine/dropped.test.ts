// FMUs from visitors are connected to the system, or rejected with a message that contains their name. If they fail, the engine goes on.
import assert from "node:assert/strict";
import { before, test } from "node:test";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { after, archive, description, fmu, LOG_AND_FAIL, module, UNREACHABLE } from "./foreign";
import { BUILT, Client, free } from "./lab";

const client = new Client();
before(() => client.start());

async function drop(name: string, bytes: Uint8Array): Promise<string> {
  const answer = await client.ask("drop", { name: `${name}.fmu`, archive: bytes });
  if (answer.kind === "error") return `${answer.message} ${answer.help}`;
  assert.equal(answer.kind, "dropped");
  return "";
}

function failures() {
  return client.events.flatMap((event) => (event.kind === "failed" ? [event] : []));
}

/** Runs both systems up to a time, s, or until all have failed. */
async function until(time: number): Promise<void> {
  while (client.time < time && failures().length < 2) await client.play(Number.POSITIVE_INFINITY, 5);
}

test("a controller takes the place of another", async () => {
  assert.equal(await drop("Springs", fmu("Springs", module({}))), "");
  const answer = await client.expect("dropped", "drop", { name: "Other.fmu", archive: fmu("Other", module({})) });
  const car = answer.catalog.vehicles.find((vehicle) => vehicle.fmu === "EspCar");
  const springs = car?.controllers.find((controller) => controller.fmu === "Springs");
  assert.ok(springs?.excludes.includes("Other") && springs.excludes.includes("SemiActivePidSuspension"));
  await client.open(free("EspCar", ["Springs", "DirectYawControl"], "step_steer"));
  await until(0.5);
  assert.deepEqual(failures(), []);
  assert.ok(client.time >= 0.5);
});

test("a trap stops its system, not the other one, and can be rewound", async () => {
  assert.equal(await drop("Trap", fmu("Trap", module({ fmi2DoStep: after(300, UNREACHABLE) }))), "");
  await client.open(free("EspCar", ["Trap"], "step_steer"));
  await until(1);
  const [failed] = failures();
  assert.equal(failures().length, 1);
  assert.equal(failed?.system, 0);
  assert.equal(failed?.component, "trap");
  assert.ok(Math.abs((failed?.time ?? 0) - 0.299) < 1e-9, `${failed?.time}`);
  assert.match(failed?.message ?? "", /fmi2DoStep returned fmi2Fatal[^]*the FMU stopped with an exception: unreachable/);
  assert.ok(client.time >= 1, "the twin goes on");
  const { time } = await client.expect("sought", "seek", { time: 0.1 });
  assert.ok(Math.abs(time - 0.1) < 1e-9);
  await client.play(Number.POSITIVE_INFINITY, 20);
  assert.ok(client.rows(0, 1).length > 0, "the system goes on from before its end");
});

test("a panic is an error with its message, and can be rewound", async () => {
  assert.equal(await drop("PanickingController", readFileSync(join(BUILT, "tests/PanickingController.fmu"))), "");
  await client.open(free("EspCar", ["PanickingController"], "step_steer"));
  await until(1);
  const [failed] = failures();
  assert.equal(failures().length, 1);
  assert.equal(failed?.component, "panicking_controller");
  assert.match(failed?.message ?? "", /fmi2DoStep returned fmi2Error[^]*index out of bounds: the len is 4 but the index is 4/);
  assert.ok(client.time >= 1, "the twin goes on");
  await client.expect("sought", "seek", { time: 0.1 });
  await client.play(Number.POSITIVE_INFINITY, 20);
  assert.ok(client.rows(0, 1).length > 0, "the system goes on from before the panic");
});

test("an error is shown with what the FMU has logged", async () => {
  assert.equal(await drop("Broken", fmu("Broken", module({ fmi2DoStep: LOG_AND_FAIL }))), "");
  await client.open(free("EspCar", ["Broken"], "step_steer"));
  await until(0.2);
  assert.match(failures()[0]?.message ?? "", /`broken`: fmi2DoStep returned fmi2Error[^]*the spring is broken/);
});

test("an instance that cannot be made is an error of the request", async () => {
  assert.equal(await drop("Nothing", fmu("Nothing", module({ fmi2Instantiate: UNREACHABLE }))), "");
  const answer = await client.ask("open", { setup: free("EspCar", ["Nothing"], "step_steer") });
  assert.equal(answer.kind, "error");
  assert.match(answer.kind === "error" ? answer.message : "", /fmi2Instantiate returned no instance/);
  await client.open(free("EspCar", [], "step_steer"));
  await until(0.1);
  assert.deepEqual(failures(), []);
});

test("what cannot be run is refused by name", async () => {
  const good = module({});
  const cases: [string, Uint8Array, RegExp][] = [
    ["NoModule", archive({ "modelDescription.xml": description("NoModule"), "binaries/linux64/NoModule.so": "x" }), /no binary for a browser .*it has binaries for linux64.*--platforms linux64,wasm32/],
    ["NoBinary", archive({ "modelDescription.xml": description("NoBinary") }), /no binary for a browser .*it has binaries for none/],
    ["Imports", fmu("Imports", module({}, [["env", "sin"]])), /imports env\.sin/],
    ["Future", archive({ "modelDescription.xml": description("Future", "4.0") }), /FMI version 4\.0, expected 2\.0 or 3\.0/],
    ["Past", archive({ "modelDescription.xml": description("Past", "1.0") }), /FMI version 1\.0/],
    ["Text", Buffer.from("this is not an archive"), /not a readable archive/],
    ["Cut", fmu("Cut", good).slice(0, 400), /not a readable archive/],
    ["Empty", archive({ "readme.txt": "" }), /no modelDescription\.xml/],
    ["Garbage", fmu("Garbage", Buffer.from("garbage")), /not a WebAssembly module/],
    ["Half", fmu("Half", good.slice(0, good.length - 30)), /not a WebAssembly module|cannot be compiled/],
  ];
  for (const [name, bytes, message] of cases) assert.match(await drop(name, bytes), message, name);
  assert.ok(!JSON.stringify(client.catalog).includes("NoModule"));
});
