// Stubs of WASI functions (preview 1), which C compilers link into a module although the FMU does not use them.
import type { Memory } from "./memory";

const BAD_DESCRIPTOR = 8;
/** Functions that return BAD_DESCRIPTOR. */
const REFUSED = ["clock_time_get", "fd_close", "fd_fdstat_get", "fd_fdstat_set_flags", "fd_prestat_get", "fd_prestat_dir_name", "fd_read", "fd_seek", "path_open"];

const FUNCTIONS = (memory: () => Memory | null): Record<string, (...parameters: number[]) => number> => {
  const zero = (...addresses: number[]): number => {
    addresses.forEach((address) => memory()?.setWord(address, 0));
    return 0;
  };
  return {
    args_get: () => 0,
    args_sizes_get: (count = 0, size = 0) => zero(count, size),
    environ_get: () => 0,
    environ_sizes_get: (count = 0, size = 0) => zero(count, size),
    ...Object.fromEntries(REFUSED.map((name) => [name, () => BAD_DESCRIPTOR])),
    // Output is discarded; the function reports that everything was written.
    fd_write: (_descriptor = 0, vectors = 0, count = 0, written = 0) => {
      let size = 0;
      for (let i = 0; i < count; i++) size += memory()?.word(vectors + 8 * i + 4) ?? 0;
      memory()?.setWord(written, size);
      return 0;
    },
    proc_exit: (code = 0) => {
      throw new Error(`it called exit with code ${code}`);
    },
  };
};

/** The imports that the lab provides for modules. */
export function wasi(memory: () => Memory | null): Record<string, Record<string, (...parameters: number[]) => number | undefined>> {
  return { wasi_snapshot_preview1: FUNCTIONS(memory), env: { emscripten_notify_memory_growth: () => undefined } };
}

/** Imports of a module that the lab does not provide. */
export function unknownImports(module: WebAssembly.Module): string[] {
  const known = wasi(() => null);
  return WebAssembly.Module.imports(module)
    .filter(({ module: from, name, kind }) => kind !== "function" || known[from]?.[name] === undefined)
    .map(({ module: from, name }) => `${from}.${name}`);
}
