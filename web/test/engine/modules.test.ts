// The modules of all FMUs: no imports, no exports except FMI functions and those of the linker, and their size.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { gzipSync } from "node:zlib";
import { BUILT, fmus, ROOT } from "./lab";

/** Exports that a linker adds. */
const OF_LINKER = ["memory", "__indirect_function_table", "__data_end", "__heap_base"];
/** Maximum size of a module, bytes. The largest module in the library has 418 kB. */
const LIMIT = 450_000;

/** Functions of FMI 2.0 that the importer looks up (crates/fmu-import/src/loader/functions/v2.rs). */
const FUNCTIONS = new Set(readFileSync(join(ROOT, "crates/fmu-import/src/loader/functions/v2.rs"), "utf8").match(/fmi2[A-Za-z]+(?=")/g));

test("modules import nothing, export the functions of FMI, and are small", () => {
  const all = fmus();
  assert.ok(all.length >= 20, `${all.length} FMUs`);
  for (const { name, module, description } of all) {
    assert.ok(module !== null, name);
    const compiled = new WebAssembly.Module(module as Uint8Array<ArrayBuffer>);
    assert.deepEqual(WebAssembly.Module.imports(compiled), [], name);
    const exported = WebAssembly.Module.exports(compiled).map((entry) => entry.name);
    const unknown = exported.filter((entry) => !FUNCTIONS.has(entry) && !OF_LINKER.includes(entry));
    assert.deepEqual(unknown, [], name);
    const hasModelExchange = description.includes("<ModelExchange");
    const ofExchange = /ContinuousStates|DerivativesOf|SetTime|GetDerivatives|DiscreteStates|EventMode|ContinuousTimeMode|IntegratorStep|EventIndicators|Nominals/;
    const missing = [...FUNCTIONS].filter((entry) => !exported.includes(entry) && (hasModelExchange || !ofExchange.test(entry)));
    assert.deepEqual(missing, [], name);
    assert.ok(module.length <= LIMIT, `${name} has ${module.length} bytes`);
  }
  const sizes = all.map(({ module }) => [module?.length ?? 0, gzipSync(module ?? new Uint8Array(), { level: 9 }).length] as const);
  const sum = (index: 0 | 1) => sizes.reduce((total, size) => total + size[index], 0);
  console.log(`${all.length} modules: ${Math.min(...sizes.map(([raw]) => raw))} to ${Math.max(...sizes.map(([raw]) => raw))} bytes, ${sum(0)} in all, ${sum(1)} with gzip`);
});

test("the core imports only its host", () => {
  const core = new WebAssembly.Module(readFileSync(join(BUILT, "core.wasm")));
  // The crate `zip` needs wasm-bindgen, see unused() in core.ts.
  const imports = WebAssembly.Module.imports(core).filter((entry) => !entry.module.startsWith("__wbindgen"));
  const names = imports.map((entry) => `${entry.module}.${entry.name}`);
  assert.deepEqual(names.sort(), ["host.close_library", "host.find_function", "host.open_library", "host.read_module"]);
});
