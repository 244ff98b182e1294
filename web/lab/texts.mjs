// Writes the scenarios of the library and the files they include as JSON, {path: text}: node texts.mjs FILE (scripts/lab).
import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join, relative, resolve } from "node:path";

const root = resolve(import.meta.dirname ?? new URL(".", import.meta.url).pathname, "../..");
const texts = {};
function add(folder) {
  for (const entry of readdirSync(folder, { withFileTypes: true })) {
    const path = join(folder, entry.name);
    if (entry.isDirectory()) add(path);
    else if (/\.(toml|ssv|csv)$/.test(entry.name)) texts[relative(root, path)] = readFileSync(path, "utf8");
  }
}
add(join(root, "scenarios"));
add(join(root, "modelDescription/parameters"));
writeFileSync(process.argv[2], JSON.stringify(texts));
