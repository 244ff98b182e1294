// Bundles the lab: a static site that needs no server. Called by scripts/lab.
//
//   node build-lab.mjs --in FOLDER --out FOLDER [--worker FILE]
//
// The first folder contains core.wasm, texts.json (scenarios and the files they include, {path: text}) and fmus/NAME.fmu with binaries for
// wasm32. The site consists of index.html, lab.js, lab.css, and for each FMU fmus/NAME.module.js, loaded when a system needs the FMU, and
// fmus/NAME.documentation.js, loaded when it is read. All data is in scripts, because a page from file:// cannot fetch other files.
import { mkdirSync, readFileSync, readdirSync, rmSync, writeFileSync } from "node:fs";
import { basename, join } from "node:path";
import { parseArgs } from "node:util";
import { deflateRawSync } from "node:zlib";
import { build } from "esbuild";
import { unzipSync } from "three/examples/jsm/libs/fflate.module.js";

const { values: options } = parseArgs({
  options: { in: { type: "string" }, out: { type: "string" }, worker: { type: "string", default: "lab/src/engine/worker.ts" } },
});
if (options.in === undefined || options.out === undefined) throw new Error("usage: node build-lab.mjs --in FOLDER --out FOLDER");

/** Bytes as text for a script. They are compressed first, because a server compresses base64 badly. */
const packed = (bytes) => deflateRawSync(bytes, { level: 9 }).toString("base64");

const fmus = readdirSync(join(options.in, "fmus"))
  .filter((file) => file.endsWith(".fmu"))
  .map((file) => {
    const archive = unzipSync(readFileSync(join(options.in, "fmus", file)));
    const read = (path, encoding) => Buffer.from(archive[path] ?? []).toString(encoding);
    const name = basename(file, ".fmu");
    const module = archive[`binaries/wasm32-unknown-unknown/${name}.wasm`];
    if (module === undefined) throw new Error(`${file} has no binary for wasm32: pack it with --platforms wasm32`);
    return {
      name,
      description: read("modelDescription.xml", "utf8"),
      documentation: { html: read("documentation/index.html", "utf8"), picture: read("model.png", "base64") },
      module: packed(module),
    };
  });

const bundled = { bundle: true, minify: true, format: "iife", target: "es2022", charset: "utf8", write: false, legalComments: "none" };
const worker = await build({ ...bundled, entryPoints: [options.worker] });

/** The data that is bundled with the page's code. */
const data = {
  core: packed(readFileSync(join(options.in, "core.wasm"))),
  worker: worker.outputFiles[0].text,
  texts: packed(readFileSync(join(options.in, "texts.json"))),
  descriptions: packed(Buffer.from(JSON.stringify(Object.fromEntries(fmus.map(({ name, description }) => [name, description]))))),
  names: fmus.map(({ name }) => name),
};
const dataModule = {
  name: "data",
  setup(builder) {
    builder.onResolve({ filter: /^lab:data$/ }, () => ({ path: "data", namespace: "lab" }));
    builder.onLoad({ filter: /.*/, namespace: "lab" }, () => ({ contents: JSON.stringify(data), loader: "json" }));
  },
};

const license = (name) => `${name}: ${readFileSync(`node_modules/${name}/LICENSE`, "utf8").trim()}`;
const notice = `/*! ${license("uplot")}\n\n${license("three")} */`;
const page = await build({
  ...bundled,
  entryPoints: { lab: "lab/src/main.ts" },
  outdir: options.out,
  plugins: [dataModule],
  banner: { js: notice, css: notice },
});

rmSync(join(options.out, "fmus"), { recursive: true, force: true });
mkdirSync(join(options.out, "fmus"), { recursive: true });
for (const file of page.outputFiles) writeFileSync(file.path, file.contents);
writeFileSync(join(options.out, "index.html"), readFileSync("lab/src/index.html"));
for (const { name, documentation, module } of fmus) {
  const write = (kind, content) => writeFileSync(join(options.out, "fmus", `${name}.${kind}.js`), `chassisLab.register(${JSON.stringify(`${name}.${kind}`)}, ${JSON.stringify(content)});\n`);
  write("module", module);
  write("documentation", documentation);
}
