/** Data that build-lab.mjs adds to the bundle. "Packed" means deflated and in base64. */
declare module "lab:data" {
  /** The core as WebAssembly, packed. */
  export const core: string;
  export const worker: string;
  /** JSON with scenarios and the files they include, by path, packed. */
  export const texts: string;
  /** JSON with the modelDescription.xml of all FMUs, by name, packed. */
  export const descriptions: string;
  export const names: string[];
}
