/** Data that build-lab.mjs puts into the bundle; what is packed is deflated, as base64. */
declare module "lab:data" {
  /** The core as WebAssembly, packed. */
  export const core: string;
  /** Code of the worker. */
  export const worker: string;
  /** JSON of scenarios and what they include, by path, packed. */
  export const texts: string;
  /** JSON of the modelDescription.xml of all FMUs, by name, packed. */
  export const descriptions: string;
  /** Names of the FMUs. */
  export const names: string[];
}
