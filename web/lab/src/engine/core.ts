// The core (crates/fmu-lab: resolver, master and metrics as WebAssembly), and the modules of FMUs that it opens.
import type { Catalog, Opened, Request, Setup } from "../protocol";
import { SIGNATURES, trampolines } from "./abi";
import { Fmu } from "./fmu";
import { Memory } from "./memory";
import { unknownImports } from "./wasi";

/** An error in a request: what is wrong, and what to do. */
export class Failure extends Error {
  constructor(
    message: string,
    readonly help: string,
  ) {
    super(message);
  }
}

/** A request, as in crates/fmu-lab/src/requests.rs; the core ignores the `id` of requests from the page. */
type CoreRequest =
  | { kind: "start"; descriptions: Record<string, string>; texts: Record<string, string> }
  | { kind: "drop"; name: string }
  | { kind: "add"; name: string; description: string }
  | { kind: "open"; setup: Setup; modules: string[] }
  | Extract<Request, { kind: "seek" | "set" | "drive" | "metrics" | "csv" | "ssp" | "describe" }>;

interface Exports {
  memory: WebAssembly.Memory;
  __indirect_function_table: WebAssembly.Table;
  lab_allocate(size: number): number;
  lab_free(address: number, size: number): void;
  lab_request(text: number, length: number, body: number, size: number): number;
  lab_response(): number;
  lab_body(): number;
  lab_body_size(): number;
  lab_advance(system: number, steps: number): number;
  lab_time(system: number): number;
  lab_rows(system: number): number;
  lab_rows_data(system: number): number;
  lab_rows_read(system: number): void;
  lab_failure(system: number): number;
}

const ENCODER = new TextEncoder();
const EMPTY = new Uint8Array();

/** The module of an FMU. Its bytes are kept until it is compiled. */
interface Module {
  bytes: Uint8Array;
  compiled: WebAssembly.Module | null;
}

/** An instance that the core has opened, and the indices of its functions in the table. */
interface Library {
  fmu: Fmu;
  indices: Map<string, number>;
  trampolines: WebAssembly.Instance;
}

/** Imports of wasm-bindgen, which the crate `zip` needs for random numbers to encrypt archives. The lab never calls them. */
function unused(module: WebAssembly.Module): WebAssembly.Imports {
  const imports: Record<string, Record<string, () => never>> = {};
  for (const { module: from, name } of WebAssembly.Module.imports(module)) {
    (imports[from] ??= {})[name] = () => {
      throw new Error(`${from}.${name} is not available`);
    };
  }
  return imports;
}

export class Core {
  readonly #exports: Exports;
  readonly #memory: Memory;
  readonly #modules = new Map<string, Module>();
  readonly #libraries = new Map<number, Library>();
  /** Indices in the function table that can be used again. */
  readonly #places: number[] = [];
  readonly #trampolines = trampolines(SIGNATURES);
  #next = 1;
  /** The reason why the last module could not be instantiated. */
  #refusal = "";

  constructor(bytes: Uint8Array) {
    const text = (address: number, length: number) => this.#memory.slice(address, length);
    const module = new WebAssembly.Module(bytes as BufferSource);
    const instance = new WebAssembly.Instance(module, {
      ...unused(module),
      host: {
        open_library: (name: number, length: number) => this.#open(text(name, length)),
        find_function: (library: number, name: number, length: number) => this.#find(library, text(name, length)),
        close_library: (library: number) => this.#close(library),
        read_module: (name: number, length: number, to: number) => this.#read(text(name, length), to),
      },
    });
    this.#exports = instance.exports as unknown as Exports;
    this.#memory = new Memory(this.#exports.memory);
  }

  /** Stores a module, which is compiled when it is needed. */
  addModule(name: string, bytes: Uint8Array): void {
    if (!this.#modules.has(name)) this.#modules.set(name, { bytes, compiled: null });
  }

  #compiled(name: string): WebAssembly.Module {
    const module = this.#modules.get(name);
    if (module === undefined) throw new Error(`there is no module for ${name}`);
    module.compiled ??= new WebAssembly.Module(module.bytes as BufferSource);
    return module.compiled;
  }

  #open(name: string): number {
    try {
      // The name begins with the number of the system, such as `0/EspCar`, because each system has its own modules.
      const module = this.#compiled(name.slice(name.indexOf("/") + 1));
      const fmu = new Fmu(module, {
        memory: this.#memory,
        call: (index, ...parameters) => (this.#exports.__indirect_function_table.get(index) as (...of: number[]) => void)(...parameters),
        keep: (bytes) => this.#put(bytes),
        forget: (address, size) => this.#exports.lab_free(address, size),
      });
      const functions = Object.fromEntries(Object.keys(SIGNATURES).map((of) => [of, fmu.functions[of] ?? (() => 0)]));
      const library = { fmu, indices: new Map<string, number>(), trampolines: new WebAssembly.Instance(this.#trampolines, { f: functions }) };
      this.#libraries.set(this.#next, library);
      return this.#next++;
    } catch (error) {
      this.#refusal = error instanceof Error ? error.message : String(error);
      return 0;
    }
  }

  #find(handle: number, name: string): number {
    const library = this.#libraries.get(handle);
    if (library?.fmu.functions[name] === undefined) return 0;
    const known = library.indices.get(name);
    if (known !== undefined) return known;
    const table = this.#exports.__indirect_function_table;
    const index = this.#places.pop() ?? table.grow(1);
    table.set(index, library.trampolines.exports[name]);
    library.indices.set(name, index);
    return index;
  }

  #close(handle: number): void {
    this.#libraries.get(handle)?.indices.forEach((index) => this.#places.push(index));
    this.#libraries.delete(handle);
  }

  #read(name: string, to: number): number {
    const bytes = this.#modules.get(name)?.bytes ?? EMPTY;
    if (to !== 0) this.#memory.now.bytes.set(bytes, to);
    return bytes.length;
  }

  #put(bytes: Uint8Array): number {
    const address = this.#exports.lab_allocate(bytes.length);
    this.#memory.now.bytes.set(bytes, address);
    return address;
  }

  /** The response to a request, and its body. */
  request<T>(request: CoreRequest, body: Uint8Array = EMPTY): [T, Uint8Array] {
    const text = ENCODER.encode(JSON.stringify(request));
    const [at, bodyAt] = [this.#put(text), this.#put(body)];
    this.#refusal = "";
    const length = this.#exports.lab_request(at, text.length, bodyAt, body.length);
    this.#exports.lab_free(at, text.length);
    this.#exports.lab_free(bodyAt, body.length);
    const response: unknown = JSON.parse(this.#memory.slice(this.#exports.lab_response(), Math.abs(length)));
    if (length < 0) {
      const { message, help } = response as { message: string; help: string };
      throw new Failure(this.#refusal === "" ? message : `${message}: ${this.#refusal}`, help);
    }
    const from = this.#exports.lab_body();
    return [response as T, this.#memory.now.bytes.slice(from, from + this.#exports.lab_body_size()) as Uint8Array<ArrayBuffer>];
  }

  /** Adds a dropped archive; returns the name assigned to it. */
  drop(name: string, archive: Uint8Array): { name: string; description: string; catalog: Catalog } {
    const [dropped, bytes] = this.request<{ name: string; description: string }>({ kind: "drop", name }, archive);
    const refuse = (reason: string, help: string): never => {
      throw new Failure(`${name}: ${reason}`, help);
    };
    let compiled: WebAssembly.Module;
    try {
      compiled = new WebAssembly.Module(bytes as BufferSource);
    } catch (error) {
      return refuse(`its module cannot be compiled: ${error instanceof Error ? error.message : String(error)}`, "Build it again.");
    }
    const unknown = unknownImports(compiled);
    if (unknown.length > 0) {
      refuse(`its module imports ${unknown.join(", ")}, which no FMI importer provides`, "Link these functions into the module.");
    }
    const exported = new Set(WebAssembly.Module.exports(compiled).map((entry) => entry.name));
    const missing = ["memory", "__indirect_function_table"].filter((entry) => !exported.has(entry));
    if (missing.length > 0) {
      refuse(`its module does not export ${missing.join(", ")}`, "Link with --export-table and --growable-table.");
    }
    this.#modules.set(dropped.name, { bytes, compiled });
    const [catalog] = this.request<Catalog>({ kind: "add", name: dropped.name, description: dropped.description });
    return { ...dropped, catalog };
  }

  /** Opens systems, or returns the modules that are missing. */
  open(setup: Setup): Opened | { missing: string[] } {
    return this.request<Opened | { missing: string[] }>({ kind: "open", setup, modules: [...this.#modules.keys()] })[0];
  }

  /** Makes steps; returns the number of steps made (fewer than `steps` at the end of a system), or -1 if the system has failed. */
  advance(system: number, steps: number): number {
    return this.#exports.lab_advance(system, steps);
  }

  time(system: number): number {
    return this.#exports.lab_time(system);
  }

  rows(system: number, width: number): { count: number; data: Float64Array } {
    const count = this.#exports.lab_rows(system);
    const from = this.#exports.lab_rows_data(system) >>> 3;
    const data = this.#memory.now.doubles.slice(from, from + count * width);
    this.#exports.lab_rows_read(system);
    return { count, data };
  }

  /** The reason why a system cannot continue; `null` if it can. */
  failure(system: number): { time: number; component: string; message: string } | null {
    const length = this.#exports.lab_failure(system);
    return JSON.parse(this.#memory.slice(this.#exports.lab_response(), length)) as { time: number; component: string; message: string } | null;
  }

  get size(): number {
    return [...this.#libraries.values()].reduce((sum, library) => sum + library.fmu.size, this.#memory.memory.buffer.byteLength);
  }
}
