/** The FMUs beside the page. Each has a script, because a page from `file://` may not read other files. */

import { descriptions } from "lab:data";
import type { FmuFile } from "./protocol";

/** The rest of an FMU: what its script contains. */
interface Content {
  /** HTML; empty if it has none. */
  documentation: string;
  /** PNG, base64. */
  picture: string;
  /** WebAssembly, base64. */
  module: string;
}

const loaded = new Map<string, Promise<Content>>();
const waiting = new Map<string, (content: Content) => void>();

Object.assign(window, { chassisLab: { register: (name: string, content: Content) => waiting.get(name)?.(content) } });

export function bytes(base64: string): Uint8Array {
  const text = atob(base64);
  const result = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) result[i] = text.charCodeAt(i);
  return result;
}

/** Whether an FMU is part of the lab; others were dropped by the visitor. */
export const isOurs = (name: string): boolean => descriptions[name] !== undefined;

export const allFmus = (): FmuFile[] => Object.entries(descriptions).map(([name, description]) => ({ name, description, module: null }));

export function content(name: string): Promise<Content> {
  let found = loaded.get(name);
  if (found === undefined) {
    found = new Promise<Content>((resolve, reject) => {
      const script = document.createElement("script");
      waiting.set(name, resolve);
      script.addEventListener("error", () => {
        loaded.delete(name);
        reject(new Error(`fmus/${name}.js cannot be loaded. It belongs beside this page.`));
      });
      script.src = `fmus/${name}.js`;
      document.head.append(script);
    });
    loaded.set(name, found);
  }
  return found;
}

/** The files of FMUs with their modules. */
export async function withModules(names: string[]): Promise<FmuFile[]> {
  const file = async (name: string) => ({ name, description: descriptions[name] ?? "", module: bytes((await content(name)).module) });
  return Promise.all(names.map(file));
}
