// An FMU in its own module: memory, callbacks, and functions for callers with another memory.
//
// Each function copies its arguments into the FMU's memory and the results back. Handles (instances and states) are passed unchanged.
// An exception in the FMU, such as a trap, becomes the status Fatal with a message; it does not unwind frames of the core.
import { CALLBACKS, FUNCTIONS, trampolines } from "./abi";
import { cString, Memory } from "./memory";
import { formatted } from "./printf";
import { wasi } from "./wasi";

const PAGE = 65536;
const FATAL = 4;
const ERROR = 3;
const callbackModule = trampolines(CALLBACKS);

const NONE: number[] = [];

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

/** The callbacks of an instance, as indices of functions in the core, and their environment. */
interface Callbacks {
  log: number;
  /** True if the messages of the logger are formats (FMI 2.0). */
  takesFormats: boolean;
  clockUpdate: number;
  environment: number;
}

/** An array among the parameters of a function: see {@link FUNCTIONS}. */
interface Place {
  index: number;
  /** Size of an element, bytes. */
  size: number;
  isDouble: boolean;
  /** `s` for strings, `b` for bytes, otherwise empty. */
  text: string;
  /** Index of the parameter with the number of elements; -1 for one element. */
  count: number;
  reads: boolean;
  writes: boolean;
}

function places(parameters: string[]): Place[] {
  return parameters.flatMap((of, index) => {
    const [, kind, size = "", count = "-1"] = /^([<>=])(\w+)(?:\*(\d+))?$/.exec(of) ?? [];
    if (kind === undefined) return [];
    const isDouble = size === "d";
    const text = /[sb]/.test(size) ? size : "";
    return [{ index, size: isDouble ? 8 : Number(size) || 4, isDouble, text, count: Number(count), reads: kind !== ">", writes: kind !== "<" }];
  });
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
  readonly #instances = new Map<number, Callbacks>();
  /** Callbacks by environment, for messages that arrive before there is an instance. */
  readonly #environments = new Map<number, Callbacks>();
  /** Functions of the core that lock and unlock preemption; the same for all instances. */
  #preemption = [0, 0];
  #strings: [number, number][] = [];
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
        logMessage: (environment: number, status: number, category: number, message: number) =>
          this.#log(environment, status, this.#memory.text(category), this.#memory.text(message)),
        clockUpdate: (environment: number) => this.#core.call(this.#environments.get(environment)?.clockUpdate ?? 0, environment),
        lockPreemption: () => this.#core.call(this.#preemption[0] ?? 0),
        unlockPreemption: () => this.#core.call(this.#preemption[1] ?? 0),
      },
    });
    const first = table.grow(Object.keys(CALLBACKS).length);
    Object.keys(CALLBACKS).forEach((name, index) => table.set(first + index, callbacks.exports[name]));
    this.#make(first);
  }

  #log(environment: number, status: number, category: string, message: string): void {
    const callbacks = this.#environments.get(environment);
    if (callbacks === undefined) return;
    const { log, takesFormats } = callbacks;
    // The message is already formatted. The core treats it as a format in FMI 2.0, so `%` and `#` are doubled.
    const texts = [category, takesFormats ? message.replaceAll("%", "%%").replaceAll("#", "##") : message].map(cString);
    const [first, second] = texts.map((text) => this.#core.keep(text)) as [number, number];
    if (takesFormats) this.#core.call(log, environment, 0, status, first, second);
    else this.#core.call(log, environment, status, first, second);
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
    for (const [name, parameters] of Object.entries(FUNCTIONS)) {
      const call = this.#exports[name];
      if (call !== undefined) this.functions[name] = this.#guarded(name, this.#function(name, call, parameters.split(" "), callbacks));
    }
  }

  /** Wraps a function of the FMU: an exception becomes the status Fatal. */
  #guarded(name: string, call: Export): Export {
    const isNew = name.includes("Instantiate");
    const failed = isNew ? 0 : FATAL;
    return (...parameters) => {
      if (this.#dead !== "") return name.endsWith("FreeInstance") ? 0 : failed;
      try {
        return call(...parameters);
      } catch (error) {
        this.#dead = error instanceof Error ? error.message : String(error);
        const component = isNew ? undefined : this.#instances.get(parameters[0] ?? 0);
        const callbacks = component ?? [...this.#environments.values()].at(-1);
        if (callbacks !== undefined) this.#log(callbacks.environment, ERROR, "trap", `the FMU stopped with an exception: ${this.#dead}`);
        return failed;
      }
    };
  }

  #function(name: string, call: Export, parameters: string[], callbacks: number): Export {
    if (/Get(Version|TypesPlatform)$/.test(name)) {
      let known = 0;
      return () => (known ||= this.#core.keep(cString(this.#memory.text(call()))));
    }
    if (name.includes("Instantiate")) return this.#instantiation(this.#copying(call, parameters), parameters, callbacks);
    if (!name.endsWith("FreeInstance")) return this.#copying(call, parameters);
    return (component = 0) => {
      call(component);
      const own = this.#instances.get(component);
      this.#instances.delete(component);
      if (own !== undefined) this.#environments.delete(own.environment);
      return 0;
    };
  }

  /** Replaces the callbacks by functions in the FMU's table, the first of which has the index `first`. */
  #instantiation(call: Export, parameters: string[], first: number): Export {
    const callback = (name: string): number => first + Object.keys(CALLBACKS).indexOf(name);
    return (...given) => {
      const own = [...given];
      const at = (kind: string): number => own[parameters.indexOf(kind)] ?? 0;
      const struct = at("c");
      const takesFormats = struct !== 0;
      // fmi2CallbackFunctions: logger, allocateMemory, freeMemory, stepFinished, componentEnvironment.
      const [log, environment] = takesFormats ? [this.#core.memory.word(struct), this.#core.memory.word(struct + 16)] : [at("l"), at("e")];
      const callbacks = { log, takesFormats, clockUpdate: at("k"), environment };
      this.#environments.set(environment, callbacks);
      if (parameters.includes("p")) this.#preemption = own.slice(-2);
      const names = ["lockPreemption", "unlockPreemption"];
      parameters.forEach((of, index) => {
        if (of === "l") own[index] = callback("logMessage");
        if (of === "k") own[index] = callback("clockUpdate");
        if (of === "p") own[index] = callback(names.shift() ?? "");
        if (of !== "c") return;
        own[index] = this.#allocate(20);
        const [memory, to] = [this.#memory, own[index] ?? 0];
        [first, first + 1, first + 2, 0, environment].forEach((value, word) => memory.setWord(to + 4 * word, value));
      });
      const component = call(...own);
      if (component !== 0) this.#instances.set(component, callbacks);
      return component;
    };
  }

  /** Copies strings and arrays to the FMU before a call, and what it has written back. */
  #copying(call: Export, parameters: string[]): Export {
    const arrays = places(parameters);
    const strings = parameters.flatMap((of, index) => (of === "s" ? [index] : []));
    if (arrays.length === 0 && strings.length === 0) return call;
    // The addresses of the arrays in the core.
    const given = arrays.map(() => 0);
    const bytes = ({ count, size }: Place, own: number[]): number => (count < 0 ? 1 : (own[count] ?? 0)) * size;
    return (...own) => {
      if (strings.length > 0) for (const index of strings) own[index] = this.#string(own[index] ?? 0);
      let room = 8;
      for (const place of arrays) room += (bytes(place, own) + 7) & ~7;
      let at = this.#room(room);
      let lent = NONE;
      for (let i = 0; i < arrays.length; i++) {
        const place = arrays[i] as Place;
        const from = own[place.index] ?? 0;
        const size = bytes(place, own);
        given[i] = from;
        own[place.index] = at;
        if (place.reads && place.text === "") copy(this.#core.memory, from, this.#memory, at, size, place.isDouble);
        else if (place.reads) lent = this.#bring(place, size / 4, from, given[i - 1] ?? 0, at);
        at += (size + 7) & ~7;
      }
      const status = own.length === 4 ? call(own[0] ?? 0, own[1] ?? 0, own[2] ?? 0, own[3] ?? 0) : call(...own);
      for (let i = 0; i < arrays.length; i++) {
        const place = arrays[i] as Place;
        if (!place.writes) continue;
        const from = own[place.index] ?? 0;
        const to = given[i] ?? 0;
        const size = bytes(place, own);
        if (place.text === "") copy(this.#memory, from, this.#core.memory, to, size, place.isDouble);
        else if (status <= 1) this.#fetch(place, size / 4, from, own[place.index - 1] ?? 0, to);
      }
      for (const address of lent) this.#giveBack(address);
      return status;
    };
  }

  /** Copies a C string from the core to memory that stays allocated. A null pointer stays a null pointer. */
  #string(address: number): number {
    if (address === 0) return 0;
    const size = this.#core.memory.length(address) + 1;
    const own = this.#allocate(size);
    copy(this.#core.memory, address, this.#memory, own, size);
    return own;
  }

  /** Copies strings or bytes (with their `sizes`) from the core, and their addresses to `to`. Returns the addresses. */
  #bring({ text }: Place, count: number, from: number, sizes: number, to: number): number[] {
    const core = this.#core.memory;
    const addresses = Array.from({ length: count }, (_, i) => {
      const address = core.word(from + 4 * i);
      if (text === "s") return this.#string(address);
      const size = core.word(sizes + 4 * i);
      const own = this.#allocate(Math.max(1, size));
      copy(core, address, this.#memory, own, size);
      return own;
    });
    addresses.forEach((address, i) => this.#memory.setWord(to + 4 * i, address));
    return addresses;
  }

  /** Copies strings or bytes of the FMU to the core, where they are valid until the next call. */
  #fetch({ text }: Place, count: number, from: number, sizes: number, to: number): void {
    this.#strings.forEach(([address, size]) => this.#core.forget(address, size));
    this.#strings = [];
    for (let i = 0; i < count; i++) {
      const address = this.#memory.word(from + 4 * i);
      const size = text === "s" ? this.#memory.length(address) + 1 : this.#memory.word(sizes + 4 * i);
      const bytes = address === 0 ? new Uint8Array(1) : this.#memory.now.bytes.slice(address, address + Math.max(1, size));
      const kept = this.#core.keep(bytes);
      this.#strings.push([kept, bytes.length]);
      this.#core.memory.setWord(to + 4 * i, kept);
    }
  }

  get size(): number {
    return this.#memory.memory.buffer.byteLength;
  }
}

/** Copies bytes between memories; doubles and words one by one, which is faster for the few values of most calls. */
function copy(source: Memory, from: number, target: Memory, to: number, size: number, areDoubles = false): void {
  const [own, other] = [target.now, source.now];
  if (areDoubles) {
    for (let i = 0, a = from >>> 3, b = to >>> 3; i < size >>> 3; i++) own.doubles[b + i] = other.doubles[a + i] ?? 0;
  } else if ((size | from | to) & 3) {
    own.bytes.set(other.bytes.subarray(from, from + size), to);
  } else {
    for (let i = 0, a = from >>> 2, b = to >>> 2; i < size >>> 2; i++) own.words[b + i] = other.words[a + i] ?? 0;
  }
}
