// The engine without a browser: the files that scripts/lab builds, and a client that waits for responses.
import { readFileSync, readdirSync } from "node:fs";
import { inflateRawSync } from "node:zlib";
import { basename, join, resolve } from "node:path";
import { Engine } from "../../lab/src/engine/engine";
import type { Catalog, Event, FmuFile, Metric, Opened, Request, Response, Setup } from "../../lab/src/protocol";

/** The repository, relative to `web/`. */
export const ROOT = resolve("..");
export const BUILT = process.env.LAB_BUILD ?? join(ROOT, "target/lab-build");

/** Reads an entry of a ZIP archive. */
export function entry(archive: Buffer, wanted: string): Buffer | null {
  const end = archive.lastIndexOf("PK\x05\x06", undefined, "latin1");
  let at = archive.readUInt32LE(end + 16);
  for (let count = archive.readUInt16LE(end + 10); count > 0; count--) {
    const [name = 0, extra = 0, comment = 0] = [28, 30, 32].map((offset) => archive.readUInt16LE(at + offset));
    if (archive.toString("utf8", at + 46, at + 46 + name) === wanted) {
      const header = archive.readUInt32LE(at + 42);
      const begin = header + 30 + archive.readUInt16LE(header + 26) + archive.readUInt16LE(header + 28);
      const data = archive.subarray(begin, begin + archive.readUInt32LE(at + 20));
      return archive.readUInt16LE(at + 10) === 0 ? data : inflateRawSync(data);
    }
    at += 46 + name + extra + comment;
  }
  return null;
}

/** All FMUs of a folder with their modules. */
export function fmus(folder = join(BUILT, "fmus")): FmuFile[] {
  return readdirSync(folder)
    .filter((file) => file.endsWith(".fmu"))
    .map((file) => {
      const archive = readFileSync(join(folder, file));
      const name = basename(file, ".fmu");
      const module = entry(archive, `binaries/wasm32-unknown-unknown/${name}.wasm`);
      return { name, description: entry(archive, "modelDescription.xml")?.toString("utf8") ?? "", module };
    });
}

/** A request without its id. */
type Asked<K extends Request["kind"]> = Omit<Extract<Request, { kind: K; id: number }>, "id" | "kind">;

/** Rows of a system. */
export interface Rows {
  branch: number;
  width: number;
  values: number[];
}

export class Client {
  #id = 0;
  readonly #waiting = new Map<number, (response: Response) => void>();
  readonly events: Event[] = [];
  #paused: (() => void)[] = [];
  readonly engine: Engine;
  catalog: Catalog | null = null;
  opened: Opened | null = null;

  constructor() {
    this.engine = new Engine((message) => {
      if ("id" in message) return this.#waiting.get(message.id)?.(message);
      this.events.push(message);
      if (message.kind === "clock" && !message.playing) {
        this.#paused.forEach((resume) => resume());
        this.#paused = [];
      }
    });
  }

  ask<K extends Extract<Request, { id: number }>["kind"]>(kind: K, asked: Asked<K>): Promise<Response> {
    const id = ++this.#id;
    return new Promise((answer) => {
      this.#waiting.set(id, answer);
      this.engine.receive({ kind, id, ...asked } as unknown as Request);
    });
  }

  /** Sends a request and returns the response of the expected kind; throws the message of an error. */
  async expect<R extends Response["kind"], K extends Extract<Request, { id: number }>["kind"]>(
    response: R,
    kind: K,
    asked: Asked<K>,
  ): Promise<Extract<Response, { kind: R }>> {
    const got = await this.ask(kind, asked);
    if (got.kind === "error") throw new Error(`${got.message} ${got.help}`);
    if (got.kind !== response) throw new Error(`${kind} was answered by ${JSON.stringify(got).slice(0, 500)}`);
    return got as Extract<Response, { kind: R }>;
  }

  async start(files = fmus()): Promise<Catalog> {
    const core = readFileSync(join(BUILT, "core.wasm"));
    const texts = JSON.parse(readFileSync(join(BUILT, "texts.json"), "utf8")) as Record<string, string>;
    const { catalog } = await this.expect("started", "start", { core, fmus: files, texts });
    this.catalog = catalog;
    return catalog;
  }

  async open(setup: Setup): Promise<Opened> {
    this.events.length = 0;
    const { opened } = await this.expect("opened", "open", { setup });
    this.opened = opened;
    return opened;
  }

  /** Runs the systems until they end or fail. */
  run(rate = Number.POSITIVE_INFINITY): Promise<void> {
    return new Promise((resume) => {
      this.#paused.push(resume);
      this.engine.receive({ kind: "play", rate });
    });
  }

  /** Runs the systems for a wall-clock time, ms. */
  async play(rate: number, milliseconds: number): Promise<void> {
    this.engine.receive({ kind: "play", rate });
    await new Promise((resume) => setTimeout(resume, milliseconds));
    this.engine.receive({ kind: "play", rate: 0 });
  }

  async csv(system = 0): Promise<string> {
    const { bytes } = await this.expect("file", "csv", { system });
    return Buffer.from(bytes).toString("utf8");
  }

  async metrics(): Promise<Metric[]> {
    return (await this.expect("metrics", "metrics", {})).metrics;
  }

  /** Time in the latest `clock` event. */
  get time(): number {
    const clocks = this.events.filter((event) => event.kind === "clock");
    return clocks.at(-1)?.time ?? Number.NaN;
  }

  /** All rows of a system in a branch, each with its time. */
  rows(system = 0, branch = 0): number[][] {
    const width = (this.opened?.systems[system]?.columns.length ?? 0) + 1;
    const rows: number[][] = [];
    for (const event of this.events) {
      if (event.kind !== "rows" || event.system !== system || event.branch !== branch) continue;
      for (let row = 0; row < event.count; row++) rows.push([...event.data.subarray(row * width, (row + 1) * width)]);
    }
    return rows;
  }
}

export function free(vehicle: string, controllers: string[], maneuver: string, maneuverValues: Record<string, number> = {}, road = "flat"): Setup {
  return { system: { kind: "free", vehicle, controllers, maneuver, maneuverValues, road, seed: 1 }, values: {} };
}
