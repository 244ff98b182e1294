/** Data that build-lab.mjs puts into the bundle. */
declare module "lab:data" {
  /** The core as WebAssembly, base64. */
  export const core: string;
  /** Code of the worker. */
  export const worker: string;
  /** Scenarios and what they include, by path. */
  export const texts: Record<string, string>;
  /** modelDescription.xml of all FMUs. */
  export const descriptions: Record<string, string>;
}
