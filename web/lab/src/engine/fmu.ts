// An FMU in its own module: memory, callbacks, and functions for callers with another memory.
//
// Each function copies its arguments into the FMU's memory and the results back. Handles (instances and states) are passed unchanged.
// An exception in the FMU, such as a trap, becomes fmi2Fatal with a message; it does not unwind frames of the core.
import { CALLBACKS, FUNCTIONS, trampolines } from "./abi";
import { cString, Memory } from "./memory";
import { formatted } from "./printf";
import { wasi } from "./wasi";

const PAGE = 65536;
const FATAL = 4;
const ERROR = 3;
const callbackModule = trampolines(CALLBACKS);

type Export = (...parameters: number[]) => number;

export interface Core {
  memory: Memory;
  /** Calls a function in the core's table. */
  call(index: number, ...parameters: number[]): void;
  /** Copies a string to the core's memory; returns its address. */
  keep(bytes: Uint8Array): number;
  /** Frees the memory of such a string. */
  forget(address: number, size: number): void;
}

/** Logger of an instance: the index of the logger function in the core, and the logger's environment. */
interface Logger {
  log: number;
  environment: number;
}

export class Fmu {
  readonly #memory: Memory;
  readonly #exports: Record<string, Export>;
  readonly #core: Core;
  readonly functions: Record<string, Export> = {};
  #scratch = 0;
  #scratchSize = 0;
  #free = 0;
  #end = 0;
  /** Blocks that the FMU has freed, by size. */
  readonly #returned = new Map<number, number[]>();
  readonly #sizes = new Map<number, number>();
  readonly #loggers = new Map<number, Logger>();
  /** Loggers by environment, for messages that arrive before there is an instance. */
  readonly #environments = new Map<number, Logger>();
  #strings: [number, number][] = [];
  #version: Record<string, number> = {};
  #dead = "";

  constructor(module: WebAssembly.Module, core: Core) {
    const holder: { memory: Memory | null } = { memory: null };
    const instance = new WebAssembly.Instance(module, wasi(() => holder.memory) as WebAssembly.Imports);
    const memory = instance.exports.memory;
    if (!(memory instanceof WebAssembly.Memory)) throw new Error("it exports no memory");
    this.#memory = new Memory(memory);
    holder.memory = this.#memory;
    this.#exports = instance.exports as unknown as Record<string, Export>;
    this.#core = core;
    this.#exports._initialize?.();
    const table = instance.exports.__indirect_function_table;
    if (!(table instanceof WebAssembly.Table)) throw new Error("it exports no function table, which is needed for callbacks");
    const callbacks = new WebAssembly.Instance(callbackModule, {
      f: {
        logger: (environment: number, _name: number, status: number, category: number, message: number, rest: number) =>
          this.#log(environment, status, this.#memory.text(category), formatted(this.#memory, message, rest)),
        allocateMemory: (count: number, size: number) => this.#allocate(count * size),
        freeMemory: (address: number) => this.#giveBack(address),
      },
    });
    const first = table.grow(Object.keys(CALLBACKS).length);
    Object.keys(CALLBACKS).forEach((name, index) => table.set(first + index, callbacks.exports[name]));
    this.#make(first);
  }

  #log(environment: number, status: number, category: string, message: string): void {
    const logger = this.#environments.get(environment);
    if (logger === undefined) return;
    // The message is already formatted. The core treats it as a format, so `%` and `#` are doubled.
    const texts = [category, message.replaceAll("%", "%%").replaceAll("#", "##")].map(cString);
    const [first, second] = texts.map((text) => this.#core.keep(text)) as [number, number];
    this.#core.call(logger.log, environment, 0, status, first, second);
    this.#core.forget(first, texts[0]?.length ?? 0);
    this.#core.forget(second, texts[1]?.length ?? 0);
  }

  /** Returns zeroed memory, from the FMU's own allocator or from additional pages. */
  #allocate(size: number): number {
    const malloc = this.#exports.malloc;
    let address: number;
    if (malloc !== undefined) {
      address = malloc(size);
    } else {
      const rounded = Math.max(16, (size + 15) & ~15);
      address = this.#returned.get(rounded)?.pop() ?? this.#bump(rounded);
      this.#sizes.set(address, rounded);
    }
    if (address !== 0) this.#memory.now.bytes.fill(0, address, address + size);
    return address;
  }

  #giveBack(address: number): void {
    if (address === 0) return;
    if (this.#exports.malloc !== undefined) {
      this.#exports.free?.(address);
      return;
    }
    const size = this.#sizes.get(address);
    if (size === undefined) return;
    const list = this.#returned.get(size);
    if (list === undefined) this.#returned.set(size, [address]);
    else list.push(address);
  }

  #bump(size: number): number {
    if (this.#free + size > this.#end) {
      const pages = Math.ceil(size / PAGE);
      const begin = this.#memory.memory.grow(pages) * PAGE;
      // Pages that directly follow the previous ones extend the free block.
      if (begin !== this.#end) this.#free = begin;
      this.#end = begin + pages * PAGE;
    }
    const address = this.#free;
    this.#free += size;
    return address;
  }

  /** Memory for the arguments of a call, valid until the next call. */
  #room(size: number): number {
    if (size > this.#scratchSize) {
      this.#scratchSize = Math.max(4096, 2 * size);
      this.#scratch = this.#allocate(this.#scratchSize);
    }
    return this.#scratch;
  }

  #make(callbacks: number): void {
    const functions: Record<string, Export> = {
      ...this.#texts(),
      ...this.#life(callbacks),
      ...this.#numbers("Real", 8),
      ...this.#numbers("Integer", 4),
      ...this.#numbers("Boolean", 4),
      ...this.#stringFunctions(),
      ...this.#states(),
    };
    for (const name of Object.keys(FUNCTIONS)) {
      if (this.#exports[name] === undefined) continue;
      const call = functions[name] ?? this.#exports[name];
      if (call !== undefined) this.functions[name] = this.#guarded(name, call);
    }
  }

  /** Wraps a function of the FMU: an exception becomes the status fmi2Fatal. */
  #guarded(name: string, call: Export): Export {
    const failed = name === "fmi2Instantiate" ? 0 : FATAL;
    return (...parameters) => {
      if (this.#dead !== "") return name === "fmi2FreeInstance" ? 0 : failed;
      try {
        return call(...parameters);
      } catch (error) {
        this.#dead = error instanceof Error ? error.message : String(error);
        const component = name === "fmi2Instantiate" ? undefined : this.#loggers.get(parameters[0] ?? 0);
        const logger = component ?? [...this.#environments.values()].at(-1);
        if (logger !== undefined) this.#log(logger.environment, ERROR, "trap", `the FMU stopped with an exception: ${this.#dead}`);
        return failed;
      }
    };
  }

  #function(name: string): Export {
    const found = this.#exports[name];
    if (found === undefined) return () => FATAL;
    return found;
  }

  /** Copies bytes from the core to an address in the FMU. */
  #bring(from: number, to: number, size: number): void {
    const source = this.#core.memory.now.bytes;
    this.#memory.now.bytes.set(source.subarray(from, from + size), to);
  }

  /** Copies a C string from the core to memory that stays allocated. A null pointer stays a null pointer. */
  #string(address: number): number {
    if (address === 0) return 0;
    const size = this.#core.memory.length(address) + 1;
    const own = this.#allocate(size);
    this.#bring(address, own, size);
    return own;
  }

  #texts(): Record<string, Export> {
    const text = (name: string) => () => {
      const known = this.#version[name];
      if (known !== undefined) return known;
      const address = this.#core.keep(cString(this.#memory.text(this.#function(name)())));
      this.#version[name] = address;
      return address;
    };
    return { fmi2GetTypesPlatform: text("fmi2GetTypesPlatform"), fmi2GetVersion: text("fmi2GetVersion") };
  }

  #life(callbacks: number): Record<string, Export> {
    return {
      fmi2Instantiate: (name = 0, type = 0, guid = 0, resources = 0, functions = 0, visible = 0, logging = 0) => {
        // fmi2CallbackFunctions: logger, allocateMemory, freeMemory, stepFinished, componentEnvironment.
        const environment = this.#core.memory.word(functions + 16);
        const logger = { log: this.#core.memory.word(functions), environment };
        this.#environments.set(environment, logger);
        const own = this.#allocate(20);
        [callbacks, callbacks + 1, callbacks + 2, 0, environment].forEach((value, index) => this.#memory.setWord(own + 4 * index, value));
        const strings = [name, guid, resources].map((text) => this.#string(text)) as [number, number, number];
        const component = this.#function("fmi2Instantiate")(strings[0], type, strings[1], strings[2], own, visible, logging);
        if (component !== 0) this.#loggers.set(component, logger);
        return component;
      },
      fmi2FreeInstance: (component = 0) => {
        this.#function("fmi2FreeInstance")(component);
        const logger = this.#loggers.get(component);
        this.#loggers.delete(component);
        if (logger !== undefined) this.#environments.delete(logger.environment);
        return 0;
      },
    };
  }

  /** Getter and setter for a numeric type with a given size. */
  #numbers(type: string, size: number): Record<string, Export> {
    const [get, set] = [this.#function(`fmi2Get${type}`), this.#function(`fmi2Set${type}`)];
    const core = this.#core.memory;
    const own = this.#memory;
    const bring = (references: number, count: number): [number, number] => {
      const to = this.#room(count * (size + 4) + 8);
      const source = core.now.words;
      const target = own.now.words;
      for (let i = 0, a = references >>> 2, b = to >>> 2; i < count; i++) target[b + i] = source[a + i] ?? 0;
      return [to, (to + 4 * count + 7) & ~7];
    };
    return {
      [`fmi2Get${type}`]: (component = 0, references = 0, count = 0, values = 0) => {
        const [names, room] = bring(references, count);
        const status = get(component, names, count, room);
        const [source, target, shift] = size === 8 ? [own.now.doubles, core.now.doubles, 3] : [own.now.words, core.now.words, 2];
        for (let i = 0, a = room >>> shift, b = values >>> shift; i < count; i++) target[b + i] = source[a + i] ?? 0;
        return status;
      },
      [`fmi2Set${type}`]: (component = 0, references = 0, count = 0, values = 0) => {
        const [names, room] = bring(references, count);
        const [source, target, shift] = size === 8 ? [core.doubles, own.doubles, 3] : [core.words, own.words, 2];
        for (let i = 0, a = values >>> shift, b = room >>> shift; i < count; i++) target[b + i] = source[a + i] ?? 0;
        return set(component, names, count, room);
      },
    };
  }

  #stringFunctions(): Record<string, Export> {
    return {
      fmi2GetString: (component = 0, references = 0, count = 0, values = 0) => {
        const room = this.#room(8 * count);
        this.#bring(references, room, 4 * count);
        const status = this.#function("fmi2GetString")(component, room, count, room + 4 * count);
        // Strings are valid until the next call.
        this.#strings.forEach(([address, size]) => this.#core.forget(address, size));
        this.#strings = [];
        for (let i = 0; status <= 1 && i < count; i++) {
          const text = cString(this.#memory.text(this.#memory.word(room + 4 * (count + i))));
          const address = this.#core.keep(text);
          this.#strings.push([address, text.length]);
          this.#core.memory.setWord(values + 4 * i, address);
        }
        return status;
      },
      fmi2SetString: (component = 0, references = 0, count = 0, values = 0) => {
        const strings = Array.from({ length: count }, (_, i) => this.#string(this.#core.memory.word(values + 4 * i)));
        const room = this.#room(8 * count);
        this.#bring(references, room, 4 * count);
        strings.forEach((address, i) => this.#memory.setWord(room + 4 * (count + i), address));
        const status = this.#function("fmi2SetString")(component, room, count, room + 4 * count);
        strings.forEach((address) => this.#giveBack(address));
        return status;
      },
    };
  }

  #states(): Record<string, Export> {
    // The address of a handle that the FMU may replace.
    const through = (name: string) => {
      const call = this.#function(name);
      return (component = 0, state = 0) => {
        const room = this.#room(4);
        this.#memory.setWord(room, this.#core.memory.word(state));
        const status = call(component, room);
        this.#core.memory.setWord(state, this.#memory.word(room));
        return status;
      };
    };
    return { fmi2GetFMUstate: through("fmi2GetFMUstate"), fmi2FreeFMUstate: through("fmi2FreeFMUstate") };
  }

  get size(): number {
    return this.#memory.memory.buffer.byteLength;
  }
}
