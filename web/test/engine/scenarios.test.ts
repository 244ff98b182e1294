// For every scenario of the library, with one seed, the engine writes the same bytes as `chassis run`.
//
// CHASSIS is the command, FMUS the folder with native FMUs from the same sources.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { Client, ROOT } from "./lab";

const COMMAND = process.env.CHASSIS ?? join(ROOT, "target/debug/chassis");
const NATIVE = process.env.FMUS ?? join(ROOT, "target/fmu");

const client = new Client();
let folder = "";

before(async () => {
  folder = mkdtempSync(join(tmpdir(), "lab-"));
  await client.start();
});
after(() => rmSync(folder, { recursive: true }));

test("all scenarios have the bytes of the native master", async (context) => {
  const wanted = process.env.SCENARIOS?.split(",");
  const scenarios = client.catalog?.scenarios.filter(({ id }) => wanted?.includes(id) ?? true) ?? [];
  assert.ok(scenarios.length > 0);
  for (const { id, cases, seeds } of scenarios) {
    await context.test(id, async () => {
      const out = join(folder, id);
      execFileSync(COMMAND, ["run", `scenarios/${id}.toml`, "--no-page", "--seeds", "1", "--out", out, "--fmus", NATIVE], { cwd: ROOT, stdio: "pipe" });
      for (const { id: name } of cases) {
        const seed = seeds[0] ?? 0;
        await client.open({ system: { kind: "scenario", scenario: id, case: name, twin: null, seed }, values: {} });
        await client.run();
        const failed = client.events.find((event) => event.kind === "failed");
        assert.equal(failed, undefined, JSON.stringify(failed));
        const got = await client.csv();
        // The engine runs only the first point of a sweep.
        const runs = join(out, id, "runs");
        const files = readdirSync(runs).filter((file) => file === `${name}.csv` || (file.startsWith(`${name}_`) && file.endsWith(seeds.length > 0 ? `_${seed}.csv` : ".csv")));
        const texts = files.map((file) => readFileSync(join(runs, file), "utf8"));
        if (!texts.includes(got)) {
          const expected = texts[0] ?? "";
          const [a, b] = [got.split("\n"), expected.split("\n")];
          const row = a.findIndex((line, index) => line !== b[index]);
          assert.fail(`${id} ${name}: line ${row + 1} of ${a.length}/${b.length}:\n${a[row]}\n${b[row]}`);
        }
      }
    });
  }
});
