// Steps an FMU that was compiled to WebAssembly with the inputs in a table from `platforms record`, and compares its
// outputs bit by bit: node replay.mjs MODULE.wasm modelDescription.xml TABLE.csv (tests/nightly/platforms).
import { readFileSync } from "node:fs";

/** Communication step in s, as in platforms.rs. */
const STEP = 0.001;

const [moduleFile, descriptionFile, tableFile] = process.argv.slice(2);
if (!tableFile) {
  console.error("usage: node replay.mjs MODULE.wasm modelDescription.xml TABLE.csv");
  process.exit(2);
}

const description = readFileSync(descriptionFile, "utf8");
const guid = description.match(/guid="([^"]+)"/)[1];
const variables = new Map();
for (const [, attributes, type] of description.matchAll(/<ScalarVariable ([^>]+)>\s*<(\w+)/g)) {
  const read = (name) => attributes.match(new RegExp(`${name}="([^"]+)"`))?.[1];
  variables.set(read("name"), { reference: Number(read("valueReference")), type });
}

const { instance } = await WebAssembly.instantiate(readFileSync(moduleFile), {});
const fmi = instance.exports;

// The arguments are in additional pages at the end of the memory. The module can grow the memory further, so views are
// renewed.
const PAGE = 65536;
let free = fmi.memory.grow(4) * PAGE;
const end = free + 4 * PAGE;
function room(bytes) {
  const at = free;
  free += (bytes + 7) & ~7;
  if (free > end) throw new Error(`the arguments need more than ${4 * PAGE} bytes`);
  return at;
}
const view = () => new DataView(fmi.memory.buffer);
function text(string) {
  const bytes = new TextEncoder().encode(`${string}\0`);
  const at = room(bytes.length);
  new Uint8Array(fmi.memory.buffer).set(bytes, at);
  return at;
}
function call(name, ...values) {
  const status = fmi[name](...values);
  if (status !== 0) throw new Error(`${name} returned ${status}`);
}

const callbacks = room(20);
const component = fmi.fmi2Instantiate(text("replay"), 1, text(guid), 0, callbacks, 0, 0);
if (component === 0) throw new Error("fmi2Instantiate returned no instance");
call("fmi2SetupExperiment", component, 0, 0, 0, 0, 0);
call("fmi2EnterInitializationMode", component);
call("fmi2ExitInitializationMode", component);

const [header, ...lines] = readFileSync(tableFile, "utf8").trimEnd().split("\n");
const columns = header.split(",").map((name) => {
  const input = name.startsWith("input ");
  const variable = variables.get(input ? name.slice("input ".length) : name);
  const references = variable && room(4);
  if (variable) view().setUint32(references, variable.reference, true);
  return { name, input, variable, references };
});
const value = room(8);
const bits = new DataView(new ArrayBuffer(16));
let compared = 0;
lines.forEach((line, k) => {
  const cells = line.split(",").map(Number);
  columns.forEach(({ input, variable, references }, i) => {
    if (!input) return;
    view().setFloat64(value, cells[i], true);
    call(`fmi2Set${variable.type}`, component, references, 1, value);
  });
  call("fmi2DoStep", component, k * STEP, STEP, 1);
  columns.forEach(({ name, input, variable, references }, i) => {
    if (input || !variable) return;
    call(`fmi2Get${variable.type}`, component, references, 1, value);
    const got = variable.type === "Real" ? view().getFloat64(value, true) : view().getInt32(value, true);
    bits.setFloat64(0, got);
    bits.setFloat64(8, cells[i]);
    if (bits.getBigUint64(0) !== bits.getBigUint64(8)) {
      console.error(`error: ${tableFile}: ${name} at ${cells[0]} s is ${got} as WebAssembly, ${cells[i]} in the table`);
      process.exit(1);
    }
    compared += 1;
  });
});
call("fmi2Terminate", component);
fmi.fmi2FreeInstance(component);
if (compared === 0) throw new Error("nothing was compared");
console.log(`${compared} values equal bit by bit`);
