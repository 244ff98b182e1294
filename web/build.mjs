// Bundles the code and the style of the pages into one file each. They are part of the Python package, so pages can be made without Node.
import { readFileSync } from "node:fs";
import { build } from "esbuild";

const license = `/*! uPlot: ${readFileSync("node_modules/uplot/LICENSE", "utf8").trim()} */`;

await build({
  entryPoints: { page: "src/main.ts" },
  outdir: "../python/chassis_fmu/web",
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  charset: "utf8",
  banner: { js: license, css: license },
});
