/**
 * The setup in the fragment of the URL. Two formats:
 *
 * - `#setup=…`: JSON of a `Setup`, base64url. `Copy link` makes it.
 * - `#scenario=ID&case=NAME&seed=1&twin=NAME`: a case of a scenario, for links in other pages. Only `scenario` is required. The defaults
 *   are the first case, the first seed, and the second case as the twin (an empty `twin`: none).
 */

import type { Catalog, Setup } from "./protocol";

export function encode(setup: Setup): string {
  const text = new TextEncoder().encode(JSON.stringify(setup));
  const base64 = btoa(Array.from(text, (byte) => String.fromCharCode(byte)).join(""));
  return `#setup=${base64.replaceAll("+", "-").replaceAll("/", "_").replace(/=+$/, "")}`;
}

function decodeSetup(text: string): Setup {
  const base64 = text.replaceAll("-", "+").replaceAll("_", "/");
  const bytes = Uint8Array.from(atob(base64), (char) => char.charCodeAt(0));
  const setup = JSON.parse(new TextDecoder().decode(bytes)) as Setup;
  const { system, values } = setup;
  const isKnown = system.kind === "scenario" || (system.kind === "free" && Array.isArray(system.controllers));
  if (!isKnown || typeof values !== "object") throw new Error("it does not describe a setup");
  return setup;
}

/** Returns the setup in a link; `null` if there is none. Throws if it is invalid. */
export function decode(hash: string, catalog: Catalog): Setup | null {
  const parameters = new URLSearchParams(hash.replace(/^#/, ""));
  const setup = parameters.get("setup");
  try {
    if (setup !== null) return decodeSetup(setup);
  } catch (error) {
    throw new Error(`The link cannot be read: ${(error as Error).message}.`);
  }
  const id = parameters.get("scenario");
  if (id === null) return null;
  const scenario = catalog.scenarios.find((one) => one.id === id);
  if (scenario === undefined) throw new Error(`The link is to the scenario ${id}, which the lab does not contain.`);
  const known = (name: string | null) => scenario.cases.some((one) => one.id === name);
  const chosen = parameters.get("case") ?? scenario.cases[0]?.id ?? "";
  const other = scenario.cases.find((one) => one.id !== chosen)?.id ?? null;
  const twin = parameters.get("twin");
  const missing = [chosen, twin ?? ""].find((name) => name !== "" && !known(name));
  if (missing !== undefined) throw new Error(`The link is to the case ${missing}, which the scenario ${id} does not contain.`);
  const seed = Number(parameters.get("seed") ?? scenario.seeds[0] ?? 1);
  return {
    system: { kind: "scenario", scenario: id, case: chosen, twin: twin === null ? other : twin === "" ? null : twin, seed },
    values: {},
  };
}
