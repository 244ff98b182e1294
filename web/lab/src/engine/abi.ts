// Signatures of the FMI 2.0 co-simulation functions that the core calls, and modules that give JavaScript functions these signatures.
//
// WebAssembly calls a function in a table only if it has the type that the caller expects. A JavaScript function has no type until a
// module imports and exports it. Such modules are assembled here, byte by byte.

/** Parameters and results, one letter each: `i` for a 32-bit integer or an address, `d` for a double. */
export interface Signature {
  parameters: string;
  results: string;
}

const signature = (parameters: string, results = "i"): Signature => ({ parameters, results });

/** Functions by name (FMI 2.0.4, fmi2FunctionTypes.h). */
export const FUNCTIONS: Record<string, Signature> = {
  fmi2GetTypesPlatform: signature(""),
  fmi2GetVersion: signature(""),
  fmi2Instantiate: signature("iiiiiii"),
  fmi2FreeInstance: signature("i", ""),
  fmi2SetupExperiment: signature("iiddid"),
  fmi2EnterInitializationMode: signature("i"),
  fmi2ExitInitializationMode: signature("i"),
  fmi2Terminate: signature("i"),
  fmi2Reset: signature("i"),
  fmi2GetReal: signature("iiii"),
  fmi2GetInteger: signature("iiii"),
  fmi2GetBoolean: signature("iiii"),
  fmi2GetString: signature("iiii"),
  fmi2SetReal: signature("iiii"),
  fmi2SetInteger: signature("iiii"),
  fmi2SetBoolean: signature("iiii"),
  fmi2SetString: signature("iiii"),
  fmi2GetFMUstate: signature("ii"),
  fmi2SetFMUstate: signature("ii"),
  fmi2FreeFMUstate: signature("ii"),
  fmi2DoStep: signature("iddi"),
};

/** Functions that a module must export. */
export const REQUIRED = Object.keys(FUNCTIONS).filter((name) => !name.endsWith("FMUstate"));

/** The callbacks of an FMU. The logger is variadic in C, so its last parameter is the address of the variable arguments. */
export const CALLBACKS: Record<string, Signature> = {
  logger: signature("iiiiii", ""),
  allocateMemory: signature("ii"),
  freeMemory: signature("i", ""),
};

const TYPE: Record<string, number> = { i: 0x7f, d: 0x7c };

/** A module that imports `f.NAME` and exports NAME for each name (WebAssembly 1.0, section 5.5). */
export function trampolines(functions: Record<string, Signature>): WebAssembly.Module {
  const names = Object.entries(functions);
  const number = (value: number): number[] => (value < 0x80 ? [value] : [(value & 0x7f) | 0x80, ...number(value >> 7)]);
  const vector = (items: number[][]): number[] => [...number(items.length), ...items.flat()];
  const text = (value: string): number[] => vector([...value].map((letter) => [letter.charCodeAt(0)]));
  const types = (letters: string): number[] => vector([...letters].map((letter) => [TYPE[letter] ?? 0]));
  const section = (id: number, content: number[]): number[] => [id, ...number(content.length), ...content];
  const bytes = [
    ...[0, 0x61, 0x73, 0x6d, 1, 0, 0, 0],
    ...section(1, vector(names.map(([, { parameters, results }]) => [0x60, ...types(parameters), ...types(results)]))),
    ...section(2, vector(names.map(([name], index) => [...text("f"), ...text(name), 0, ...number(index)]))),
    ...section(7, vector(names.map(([name], index) => [...text(name), 0, ...number(index)]))),
  ];
  return new WebAssembly.Module(new Uint8Array(bytes));
}
