// Compares a dropped FMU, run alone, with its author's reference table. Not part of the tests, because the module is built manually
// (docs/guide/src/lab.md). REFERENCE is the folder with modelDescription.xml (FMI2.xml), NAME.wasm and NAME_out.csv.
import { readFileSync } from "node:fs";
import { basename, join } from "node:path";
import { archive } from "./foreign";
import { Client } from "./lab";

const [folder = ""] = process.argv.slice(2);
const name = basename(folder);
const client = new Client();
await client.start();
const files = { "modelDescription.xml": readFileSync(join(folder, "FMI2.xml")), [`binaries/wasm32-unknown-unknown/${name}.wasm`]: readFileSync(join(folder, `${name}.wasm`)) };
const dropped = await client.expect("dropped", "drop", { name: `${name}.fmu`, archive: archive(files) });
await client.open({ system: { kind: "free", vehicle: dropped.name, controllers: [], maneuver: "alone", maneuverValues: {}, road: "flat", seed: 1 }, values: {} });
await client.run();
const table = (text: string) => text.trim().split("\n").map((line) => line.trim().split(","));
const [got, expected] = [table(await client.csv()), table(readFileSync(join(folder, `${name}_out.csv`), "utf8"))];
let [compared, largest] = [0, 0];
expected[0]?.forEach((column, index) => {
  const own = got[0]?.indexOf(column) ?? -1;
  if (own < 0) throw new Error(`the run has no ${column}`);
  expected.slice(1).forEach((row, line) => {
    const difference = Math.abs(Number(row[index]) - Number(got[line + 1]?.[own]));
    if (!(difference <= 1e-9)) throw new Error(`${column}, line ${line + 2}: ${got[line + 1]?.[own]}, expected ${row[index]}`);
    largest = Math.max(largest, difference);
    compared += 1;
  });
});
console.log(`${compared} numbers of ${name} equal its table within ${largest}`);
