/** Reads the data of the page. */

import type { Column, PageData } from "./page-data";

/** The word for a missing number. */
const MISSING = 65535;

/** Returns the data in the page; null if the page has no data, or data of a different version. */
export function read(): PageData | null {
  const element = document.getElementById("page-data");
  if (element === null) return null;
  const data = JSON.parse(element.textContent) as PageData;
  return data.format === 1 ? data : null;
}

/** Decompresses bytes in base64. */
export async function inflated(base64: string, format: CompressionFormat): Promise<ArrayBuffer> {
  const text = atob(base64);
  const compressed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) compressed[i] = text.charCodeAt(i);
  return new Response(new Blob([compressed]).stream().pipeThrough(new DecompressionStream(format))).arrayBuffer();
}

/** Returns the words of the block, in which each column is stored as differences. */
export async function unpack(block: string): Promise<Uint16Array> {
  const bytes = new DataView(await inflated(block, "deflate"));
  return Uint16Array.from({ length: bytes.byteLength / 2 }, (_, i) => bytes.getUint16(2 * i, true));
}

/** Returns the numbers of a column; null for a missing number. */
export function numbers(words: Uint16Array, column: Column): (number | null)[] {
  let word = 0;
  return Array.from(words.subarray(column.at, column.at + column.count), (difference) => {
    word = (word + difference) & 0xffff;
    if (word === MISSING) return null;
    const value = column.first + column.step * word;
    return column.log ? 10 ** value : value;
  });
}

/** Returns the number of significant digits that remain after rounding a column to words. */
export function digits(column: Column): number {
  if (column.step === 0) return 6;
  if (column.log) return 4;
  const largest = Math.max(Math.abs(column.first), Math.abs(column.first + column.step * (MISSING - 1)));
  return Math.max(1, Math.min(6, Math.floor(Math.log10(largest / Math.abs(column.step)))));
}
