// A WebAssembly memory with views that are renewed when it grows.

const DECODER = new TextDecoder();
const ENCODER = new TextEncoder();

export class Memory {
  #buffer: ArrayBuffer | null = null;
  bytes = new Uint8Array();
  words = new Uint32Array();
  doubles = new Float64Array();

  constructor(readonly memory: WebAssembly.Memory) {}

  /** This memory with valid views. Use it after every call that can make the memory grow. */
  get now(): this {
    const buffer = this.memory.buffer;
    if (buffer !== this.#buffer) {
      this.#buffer = buffer;
      this.bytes = new Uint8Array(buffer);
      this.words = new Uint32Array(buffer);
      this.doubles = new Float64Array(buffer);
    }
    return this;
  }

  word(address: number): number {
    return this.now.words[address >>> 2] ?? 0;
  }

  setWord(address: number, value: number): void {
    this.now.words[address >>> 2] = value;
  }

  length(address: number): number {
    const end = this.now.bytes.indexOf(0, address);
    return (end < 0 ? this.bytes.length : end) - address;
  }

  /** The text of a C string; empty for a null pointer. */
  text(address: number): string {
    return address === 0 ? "" : this.slice(address, this.length(address));
  }

  slice(address: number, length: number): string {
    return DECODER.decode(this.now.bytes.subarray(address, address + length));
  }
}

/** The bytes of a C string, with the final zero. */
export function cString(text: string): Uint8Array {
  return ENCODER.encode(`${text}\0`);
}
