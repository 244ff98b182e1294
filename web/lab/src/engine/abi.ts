// Parameters of the FMI functions that the core calls, and modules that give JavaScript functions their WebAssembly signatures.
//
// WebAssembly calls a function in a table only if it has the type that the caller expects. A JavaScript function has no type until a
// module imports and exports it. Such modules are assembled here, byte by byte.

/** Getters and setters of FMI 3.0 and the size of their values, bytes. */
const NUMBERS = { Float32: 4, Float64: "d", Int8: 1, UInt8: 1, Int16: 2, UInt16: 2, Int32: 4, UInt32: 4, Int64: 8, UInt64: 8, Boolean: 1 };

/** Functions of both versions (FMI 2.0.4, fmi2FunctionTypes.h; FMI 3.0.2, fmi3FunctionTypes.h), without their prefix. */
const SHARED = {
  GetVersion: "",
  FreeInstance: "i",
  ExitInitializationMode: "i",
  Terminate: "i",
  Reset: "i",
  EnterEventMode: "i",
  EnterContinuousTimeMode: "i",
  SetTime: "i d",
  SetContinuousStates: "i <d*2 i",
  GetContinuousStates: "i >d*2 i",
  GetEventIndicators: "i >d*2 i",
  GetNominalsOfContinuousStates: "i >d*2 i",
};

const prefixed = (prefix: string, functions: Record<string, string>): Record<string, string> =>
  Object.fromEntries(Object.entries(functions).map(([name, parameters]) => [prefix + name, parameters]));

/**
 * Parameters by function, one word each: `i` a 32-bit integer or a handle, `d` a double, `s` a C string, `c` the callbacks of FMI 2.0,
 * `e` the environment of the callbacks that follow it: `l` a logger, `k` fmi3ClockUpdateCallback, `p` a callback without parameters,
 * `0` none. `<4*2` is an array that the FMU reads: values of 4 bytes, as many as parameter 2 (counted from 0) says; `>4*2` an array that
 * it writes, `>4` one value, `=4` one that it replaces. Instead of a size, `d` stands for doubles, `s` for C strings, and `b` for bytes
 * whose numbers are in the array before them.
 */
export const FUNCTIONS: Record<string, string> = {
  ...prefixed("fmi2", {
    ...SHARED,
    GetTypesPlatform: "",
    Instantiate: "s i s s c i i",
    SetupExperiment: "i i d d i d",
    EnterInitializationMode: "i",
    GetReal: "i <4*2 i >d*2",
    GetInteger: "i <4*2 i >4*2",
    GetBoolean: "i <4*2 i >4*2",
    GetString: "i <4*2 i >s*2",
    SetReal: "i <4*2 i <d*2",
    SetInteger: "i <4*2 i <4*2",
    SetBoolean: "i <4*2 i <4*2",
    SetString: "i <4*2 i <s*2",
    SetRealInputDerivatives: "i <4*2 i <4*2 <d*2",
    GetFMUstate: "i =4",
    SetFMUstate: "i i",
    FreeFMUstate: "i =4",
    GetDirectionalDerivative: "i <4*2 i <4*4 i <d*4 >d*2",
    DoStep: "i d d i",
    GetDerivatives: "i >d*2 i",
    // fmi2EventInfo: five numbers, then a time.
    NewDiscreteStates: "i =32",
    CompletedIntegratorStep: "i i >4 >4",
  }),
  ...prefixed("fmi3", {
    ...SHARED,
    InstantiateCoSimulation: "s s s i i i i <4*8 i e l 0",
    InstantiateModelExchange: "s s s i i e l",
    InstantiateScheduledExecution: "s s s i i e l k p p",
    EnterInitializationMode: "i i d d i d",
    EnterConfigurationMode: "i",
    ExitConfigurationMode: "i",
    EnterStepMode: "i",
    ...Object.fromEntries(
      Object.entries(NUMBERS).flatMap(([type, size]) => [
        [`Get${type}`, `i <4*2 i >${size}*4 i`],
        [`Set${type}`, `i <4*2 i <${size}*4 i`],
      ]),
    ),
    GetString: "i <4*2 i >s*4 i",
    SetString: "i <4*2 i <s*4 i",
    GetBinary: "i <4*2 i >4*5 >b*5 i",
    SetBinary: "i <4*2 i <4*5 <b*5 i",
    GetFMUState: "i =4",
    SetFMUState: "i i",
    FreeFMUState: "i =4",
    GetDirectionalDerivative: "i <4*2 i <4*4 i <d*6 i >d*8 i",
    GetClock: "i <4*2 i >1*2",
    SetClock: "i <4*2 i <1*2",
    GetIntervalDecimal: "i <4*2 i >d*2 >4*2",
    SetIntervalDecimal: "i <4*2 i <d*2",
    GetShiftDecimal: "i <4*2 i >d*2",
    DoStep: "i d d i >1 >1 >1 >d",
    UpdateDiscreteStates: "i >1 >1 >1 >1 >1 >d",
    GetContinuousStateDerivatives: "i >d*2 i",
    CompletedIntegratorStep: "i i >1 >1",
    GetNumberOfContinuousStates: "i >4",
    GetNumberOfEventIndicators: "i >4",
    ActivateModelPartition: "i i d",
  }),
};

/** Parameters and results, one letter each: `i` for a 32-bit integer or an address, `d` for a double. */
export interface Signature {
  parameters: string;
  results: string;
}

/** The WebAssembly signatures of all functions. */
export const SIGNATURES: Record<string, Signature> = Object.fromEntries(
  Object.entries(FUNCTIONS).map(([name, parameters]) => [
    name,
    {
      parameters: parameters.split(" ").map((of) => (of === "" || of === "d" ? of : "i")).join(""),
      results: name.endsWith("FreeInstance") ? "" : "i",
    },
  ]),
);

/** The callbacks of an FMU. The logger of FMI 2.0 is variadic in C, so its last parameter is the address of the variable arguments. */
export const CALLBACKS: Record<string, Signature> = {
  logger: { parameters: "iiiiii", results: "" },
  allocateMemory: { parameters: "ii", results: "i" },
  freeMemory: { parameters: "i", results: "" },
  logMessage: { parameters: "iiii", results: "" },
  clockUpdate: { parameters: "i", results: "" },
  lockPreemption: { parameters: "", results: "" },
  unlockPreemption: { parameters: "", results: "" },
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
