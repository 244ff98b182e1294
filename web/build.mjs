// Bundles the code and the style of the pages: one file each, which the Python package contains, so that making a page needs no
// Node.
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
