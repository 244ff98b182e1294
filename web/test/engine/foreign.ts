// Third-party FMUs for tests: modules that are assembled byte by byte, in archives without compression.
import { SIGNATURES } from "../../lab/src/engine/abi";

const number = (value: number): number[] => (value < 0x80 ? [value] : [(value & 0x7f) | 0x80, ...number(value >> 7)]);
/** Encodes a nonnegative number where the format requires a signed one (LEB128). */
const signed = (value: number): number[] => (value < 0x40 ? [value] : [(value & 0x7f) | 0x80, ...signed(value >> 7)]);
const vector = (items: number[][]): number[] => [...number(items.length), ...items.flat()];
const text = (value: string): number[] => vector([...Buffer.from(value)].map((byte) => [byte]));
const TYPE: Record<string, number> = { i: 0x7f, d: 0x7c };
const types = (letters: string): number[] => vector([...letters].map((letter) => [TYPE[letter] ?? 0]));

/** Code that returns a number. */
export const constant = (value: number): number[] => [0x41, ...signed(value)];
export const UNREACHABLE = [0x00];

/** Code that returns 0 in the first calls, which it counts in memory, and then runs other code. */
export const after = (calls: number, code: number[]): number[] => [
  ...[0x41, 8, 0x41, 8, 0x28, 2, 0, 0x41, 1, 0x6a, 0x36, 2, 0, 0x41, 8, 0x28, 2, 0],
  ...[...constant(calls), 0x4e, 0x04, 0x40, ...code, 0x0b, 0x41, 0],
];
/** Code that never ends. */
export const ENDLESS_LOOP = [0x03, 0x40, 0x0c, 0, 0x0b];

const VERSION = 16;
const PLATFORM = 32;
const MESSAGE = 48;

/** Code that calls the logger with status Error and a message, and returns Error. The instance is the address of the callbacks. */
export const LOG_AND_FAIL = [
  // Arguments: component environment, instance name, status, category, message, address of further arguments.
  ...[0x20, 0, 0x28, 2, 16, 0x41, 0, 0x41, 3, ...constant(MESSAGE), ...constant(MESSAGE + 16), 0x41, 0],
  // call_indirect with type 0; the first word of the callbacks is the index.
  ...[0x20, 0, 0x28, 2, 0, 0x11, 0, 0, 0x41, 3],
];

/** A module with the functions of FMI 2.0, some of them with the given code, and with imports `module.name` without parameters. */
export function module(code: Record<string, number[]>, imports: [string, string][] = []): Uint8Array {
  const functions = Object.entries(SIGNATURES).filter(([name]) => name.startsWith("fmi2"));
  const standard: Record<string, number[]> = {
    fmi2GetVersion: constant(VERSION),
    fmi2GetTypesPlatform: constant(PLATFORM),
    // Returns the address of the callbacks as the instance.
    fmi2Instantiate: [0x20, 4],
  };
  const body = (name: string, results: string): number[] => {
    const own = code[name] ?? standard[name] ?? (results === "" ? [] : constant(0));
    const bytes = [0, ...own, 0x0b];
    return [...number(bytes.length), ...bytes];
  };
  const section = (id: number, content: number[]): number[] => [id, ...number(content.length), ...content];
  const signatures = [{ parameters: "iiiiii", results: "" }, { parameters: "", results: "" }, ...functions.map(([, of]) => of)];
  return new Uint8Array([
    ...[0, 0x61, 0x73, 0x6d, 1, 0, 0, 0],
    ...section(1, vector(signatures.map(({ parameters, results }) => [0x60, ...types(parameters), ...types(results)]))),
    ...(imports.length > 0 ? section(2, vector(imports.map(([from, name]) => [...text(from), ...text(name), 0, 1]))) : []),
    ...section(3, vector(functions.map((_, index) => number(index + 2)))),
    ...section(4, vector([[0x70, 0, 1]])),
    ...section(5, vector([[0, 1]])),
    ...section(
      7,
      vector([
        [...text("memory"), 2, 0],
        [...text("__indirect_function_table"), 1, 0],
        ...functions.map(([name], index) => [...text(name), 0, ...number(index + imports.length)]),
      ]),
    ),
    ...section(10, vector(functions.map(([name, { results }]) => body(name, results)))),
    ...section(
      11,
      vector(
        [
          [VERSION, "2.0\0"] as const,
          [PLATFORM, "default\0"] as const,
          [MESSAGE, "test\0"] as const,
          [MESSAGE + 16, "the spring is broken\0"] as const,
        ].map(([at, value]) => [0, ...constant(at), 0x0b, ...text(value)]),
      ),
    ),
  ]);
}

/** The description of a controller that reads the yaw rate and writes a force at each wheel of a car. */
export function description(name: string, version = "2.0"): string {
  const wheels = ["fl", "fr", "rl", "rr"];
  const variable = (signal: string, index: number, causality: string, unit: string, start = "") =>
    `<ScalarVariable name="${signal}" valueReference="${index}" causality="${causality}" variability="continuous"><Real unit="${unit}"${start}/></ScalarVariable>`;
  return `<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="${version}" modelName="${name}" guid="{1}" numberOfEventIndicators="0">
<CoSimulation modelIdentifier="${name}" canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="false"/>
<UnitDefinitions><Unit name="N"><BaseUnit kg="1" m="1" s="-2"/></Unit><Unit name="rad/s"><BaseUnit rad="1" s="-1"/></Unit></UnitDefinitions>
<ModelVariables>
${variable("vehicle.yaw_rate", 0, "input", "rad/s", ' start="0"')}
${wheels.map((wheel, index) => variable(`suspension_force.${wheel}`, index + 1, "output", "N")).join("\n")}
</ModelVariables>
<ModelStructure><Outputs>${wheels.map((_, index) => `<Unknown index="${index + 2}"/>`).join("")}</Outputs></ModelStructure>
</fmiModelDescription>`;
}

function crc32(bytes: Uint8Array): number {
  let sum = ~0;
  for (const byte of bytes) {
    sum ^= byte;
    for (let bit = 0; bit < 8; bit++) sum = (sum >>> 1) ^ (0xedb88320 & -(sum & 1));
  }
  return ~sum >>> 0;
}

/** A ZIP archive that contains the files. */
export function archive(files: Record<string, string | Uint8Array>): Uint8Array {
  const parts: Buffer[] = [];
  const directory: Buffer[] = [];
  let at = 0;
  for (const [name, content] of Object.entries(files)) {
    const [bytes, title] = [Buffer.from(content as Uint8Array), Buffer.from(name)];
    const common = Buffer.alloc(26);
    common.writeUInt16LE(20, 0);
    common.writeUInt16LE(0x21, 8);
    common.writeUInt32LE(crc32(bytes), 10);
    common.writeUInt32LE(bytes.length, 14);
    common.writeUInt32LE(bytes.length, 18);
    common.writeUInt16LE(title.length, 22);
    const local = [Buffer.from("PK\x03\x04", "latin1"), common, title, bytes];
    const rest = Buffer.alloc(14);
    rest.writeUInt32LE(at, 10);
    directory.push(Buffer.from("PK\x01\x02\x14\x00", "latin1"), common, rest, title);
    parts.push(...local);
    at += 4 + common.length + title.length + bytes.length;
  }
  const entries = Object.keys(files).length;
  const size = directory.reduce((sum, part) => sum + part.length, 0);
  const end = Buffer.alloc(18);
  end.writeUInt16LE(entries, 4);
  end.writeUInt16LE(entries, 6);
  end.writeUInt32LE(size, 8);
  end.writeUInt32LE(at, 12);
  return Buffer.concat([...parts, ...directory, Buffer.from("PK\x05\x06", "latin1"), end]);
}

/** An FMU with this name and a module. */
export function fmu(name: string, bytes: Uint8Array): Uint8Array {
  return archive({ "modelDescription.xml": description(name), [`binaries/wasm32-unknown-unknown/${name}.wasm`]: bytes });
}
