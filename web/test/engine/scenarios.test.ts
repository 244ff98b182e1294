// For every scenario of the library, with one seed, the engine writes the same bytes as `chassis run`. For FMUs of FMI 3.0, it does so
// for a scenario, and for examples with all types and with clocks, which run alone.
//
// CHASSIS is the command, FMUS the folder with native FMUs from the same sources.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { BUILT, Client, fmus, free, ROOT } from "./lab";

const COMMAND = process.env.CHASSIS ?? join(ROOT, "target/debug/chassis");
const NATIVE = process.env.FMUS ?? join(ROOT, "target/fmu");

const FMI3 = join(BUILT, "fmi3");

const client = new Client();
let folder = "";

before(async () => {
  folder = mkdtempSync(join(tmpdir(), "lab-"));
  await client.start();
});
after(() => rmSync(folder, { recursive: true }));

/** Runs the cases of a scenario and compares their files with those of the native master. */
async function compare(engine: Client, id: string): Promise<void> {
  const found = engine.catalog?.scenarios.find((scenario) => scenario.id === id);
  assert.ok(found !== undefined, id);
  const { cases, seeds } = found;
  const out = join(folder, id);
  execFileSync(COMMAND, ["run", `scenarios/${id}.toml`, "--no-page", "--seeds", "1", "--out", out, "--fmus", NATIVE], { cwd: ROOT, stdio: "pipe" });
  for (const { id: name } of cases) {
    const seed = seeds[0] ?? 0;
    await engine.open({ system: { kind: "scenario", scenario: id, case: name, twin: null, seed }, values: {} });
    await engine.run();
    const failed = engine.events.find((event) => event.kind === "failed");
    assert.equal(failed, undefined, JSON.stringify(failed));
    // The engine runs only the first point of a sweep.
    const runs = join(out, id, "runs");
    const files = readdirSync(runs).filter((file) => file === `${name}.csv` || (file.startsWith(`${name}_`) && file.endsWith(seeds.length > 0 ? `_${seed}.csv` : ".csv")));
    same(await engine.csv(), files.map((file) => readFileSync(join(runs, file), "utf8")), `${id} ${name}`);
  }
}

/** Compares a file with those that it may be equal to. */
function same(got: string, files: string[], what: string): void {
  if (files.includes(got)) return;
  const expected = files[0] ?? "";
  const [a, b] = [got.split("\n"), expected.split("\n")];
  const row = a.findIndex((line, index) => line !== b[index]);
  assert.fail(`${what}: line ${row + 1} of ${a.length}/${b.length}:\n${a[row]}\n${b[row]}`);
}

test("all scenarios have the bytes of the native master", async (context) => {
  const wanted = process.env.SCENARIOS?.split(",");
  const scenarios = client.catalog?.scenarios.filter(({ id }) => wanted?.includes(id) ?? true) ?? [];
  assert.ok(scenarios.length > 0);
  for (const { id } of scenarios) await context.test(id, () => compare(client, id));
});

test("FMUs of FMI 3.0 have the bytes of FMI 2.0", async () => {
  const engine = new Client();
  const replaced = new Map(fmus(FMI3).map((file) => [file.name, file]));
  await engine.start(fmus().map((file) => replaced.get(file.name) ?? file));
  await compare(engine, "esp_car_braking");
});

test("types and clocks of FMI 3.0 have the bytes of the native master", async (context) => {
  for (const name of ["AllTypes", "Clocks"]) {
    await context.test(name, async () => {
      const dropped = await client.expect("dropped", "drop", { name: `${name}.fmu`, archive: readFileSync(join(FMI3, `${name}.fmu`)) });
      assert.equal(dropped.name, name);
      await client.open(free(name, [], "alone"));
      await client.run();
      const got = await client.csv();
      const [header = "", , , second = ""] = got.split("\n");
      const rows = got.trim().split("\n");
      const [stop, step] = [rows.at(-1) ?? "", rows[2] ?? second].map((row) => row.split(",")[0]);
      const signals = header.split(",").slice(1).map((signal) => JSON.stringify(signal));
      // The inputs have their start values in the lab, too.
      const variables = fmus(FMI3).find((fmu) => fmu.name === name)?.description.match(/<(?!Clock|Binary|String)\w+ [^>]*causality="input"[^>]*>/g) ?? [];
      const inputs = variables.map((text) => ["name", "start"].map((key) => new RegExp(` ${key}="([^"]*)"`).exec(text)?.[1] ?? "")).map(([input, start]) => `"${input}" = ${start}`);
      const file = join(folder, `${name}.toml`);
      writeFileSync(file, `title = "${name}"\n[simulation]\nstop = ${stop}\nstep = ${step}\n[[component]]\nname = "alone"\nfmu = "${name}"\ninputs = { ${inputs.join(", ")} }\n[[case]]\nname = "alone"\ntitle = "alone"\n[record]\nsignals = [${signals.join(", ")}]\n`);
      execFileSync(COMMAND, ["run", file, "--no-page", "--out", join(folder, "alone"), "--fmus", FMI3], { stdio: "pipe" });
      same(got, [readFileSync(join(folder, "alone", name, "runs", "alone.csv"), "utf8")], name);
    });
  }
});
