/** The FMUs in the page's folder. Their parts are scripts, because a page from `file://` cannot read other files. */

import { descriptions, names } from "lab:data";
import { inflated } from "../../src/data";
import { element } from "../../src/dom";
import type { FmuFile } from "./protocol";

export interface Documentation {
  /** The documentation; empty if the FMU has none. */
  html: string;
  /** PNG, base64. */
  picture: string;
}

/** The content of an FMU's scripts; `module` is WebAssembly, packed. */
interface Parts {
  module: string;
  documentation: Documentation;
}

const loaded = new Map<string, Promise<unknown>>();
const waiting = new Map<string, (content: unknown) => void>();

Object.assign(window, { chassisLab: { register: (name: string, content: unknown) => waiting.get(name)?.(content) } });

export async function unpack(base64: string): Promise<Uint8Array> {
  return new Uint8Array(await inflated(base64, "deflate-raw"));
}

export async function unpackJson<T>(base64: string): Promise<T> {
  return JSON.parse(new TextDecoder().decode(await unpack(base64))) as T;
}

/** Whether an FMU is part of the lab, and was not dropped by the visitor. */
export const isOurs = (name: string): boolean => names.includes(name);

let known: Promise<Record<string, string>> | null = null;
const allDescriptions = () => (known ??= unpackJson<Record<string, string>>(descriptions));

/** One-sentence descriptions of the FMUs by name, available after the engine has started. */
const summaries = new Map<string, string>();

/** The one-sentence description of an FMU; empty if the FMU has none. */
export const summary = (name: string): string => summaries.get(name) ?? "";

/** Stores the summary of a dropped FMU: its modelName, which can differ from the file name, and its description. */
export function remember(name: string, text: string): void {
  const { documentElement: root } = new DOMParser().parseFromString(text, "text/xml");
  const description = root.getAttribute("description") ?? "";
  const model = isOurs(name) ? "" : (root.getAttribute("modelName") ?? "");
  summaries.set(name, [model, description].filter((part) => part !== "").join(": ").replace(/\.?$/, "."));
}

export async function allFmus(): Promise<FmuFile[]> {
  for (const [name, text] of Object.entries(await allDescriptions())) remember(name, text);
  return Object.entries(await allDescriptions()).map(([name, description]) => ({ name, description, module: null }));
}

export function part<K extends keyof Parts>(name: string, kind: K): Promise<Parts[K]> {
  const key = `${name}.${kind}`;
  let found = loaded.get(key);
  if (found === undefined) {
    found = new Promise<unknown>((resolve, reject) => {
      waiting.set(key, resolve);
      const onerror = () => {
        loaded.delete(key);
        reject(new Error(`fmus/${key}.js cannot be loaded. Put the folder fmus beside this page.`));
      };
      document.head.append(element("script", { src: `fmus/${key}.js`, onerror }));
    });
    loaded.set(key, found);
  }
  return found as Promise<Parts[K]>;
}

/** Returns the files of FMUs, including their modules. */
export async function withModules(wanted: string[]): Promise<FmuFile[]> {
  const texts = await allDescriptions();
  return Promise.all(wanted.map(async (name) => ({ name, description: texts[name] ?? "", module: await unpack(await part(name, "module")) })));
}
