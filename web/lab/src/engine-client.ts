/** The page's interface to the worker: requests with responses, events, and detection of endless loops. */

import type { Event, Request, Response } from "./protocol";

type WithoutId<T> = T extends { id: number } ? Omit<T, "id"> : never;
export type Query = WithoutId<Request>;
export type Command = Exclude<Request, { id: number }>;
type Answer<K extends Response["kind"]> = Extract<Response, { kind: K }>;

/** Longest silence of a worker during a simulation, ms. */
const SILENCE = 2000;
/** Longest time for a response, ms. It allows for compiling modules on slow machines. */
const PATIENCE = { start: 60_000, other: 15_000 };
/** Queries that a worker answers between two steps. While it handles any other query, it may be silent for longer. */
const QUICK = new Set<Query["kind"]>(["metrics", "describe"]);
/** Time to receive messages that were queued while the page was busy, ms. */
const GRACE = 400;

/** An error that the engine reports: what is wrong, and what to do. */
export class EngineError extends Error {
  constructor(
    message: string,
    readonly help: string,
  ) {
    super(message);
  }
}

interface Waiting {
  query: Query;
  deadline: number;
  resolve: (response: Response) => void;
  reject: (error: Error) => void;
}

export class Engine {
  #worker: Worker;
  #next = 1;
  #last = performance.now();
  #isPlaying = false;
  #suspected: number | null = null;
  readonly #waiting = new Map<number, Waiting>();
  readonly #timer: number;
  readonly #url: string;

  /** `onSilence` is called once, after the worker has been terminated because it did not respond. */
  constructor(
    source: string,
    readonly onEvent: (event: Event) => void,
    readonly onSilence: (during: Query["kind"] | "play") => void,
  ) {
    this.#url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
    this.#worker = new Worker(this.#url);
    this.#worker.addEventListener("message", ({ data }: MessageEvent<Response | Event>) => this.#receive(data));
    this.#worker.addEventListener("error", (event) => this.#fail(new EngineError(event.message, "Reload the page.")));
    this.#timer = window.setInterval(() => this.#watch(), 250);
  }

  async ask<K extends Response["kind"]>(query: Query, transfer: Transferable[], ...kinds: K[]): Promise<Answer<K>> {
    const id = this.#next++;
    const response = await new Promise<Response>((resolve, reject) => {
      const deadline = performance.now() + (query.kind === "start" ? PATIENCE.start : PATIENCE.other);
      this.#waiting.set(id, { query, deadline, resolve, reject });
      this.#worker.postMessage({ ...query, id }, transfer);
    });
    if (response.kind === "error") throw new EngineError(response.message, response.help);
    if (!(kinds as string[]).includes(response.kind)) throw new Error(`unexpected response ${response.kind}`);
    return response as Answer<K>;
  }

  tell(command: Command): void {
    if (command.kind === "play") {
      this.#isPlaying = command.rate > 0;
      this.#last = performance.now();
    }
    this.#worker.postMessage(command);
  }

  end(): void {
    clearInterval(this.#timer);
    this.#worker.terminate();
    URL.revokeObjectURL(this.#url);
    this.#fail(new EngineError("The simulation was ended.", ""));
  }

  #receive(data: Response | Event): void {
    this.#last = performance.now();
    this.#suspected = null;
    if ("id" in data) {
      this.#waiting.get(data.id)?.resolve(data);
      this.#waiting.delete(data.id);
      return;
    }
    if (data.kind === "clock") this.#isPlaying = data.playing;
    this.onEvent(data);
  }

  #fail(error: Error): void {
    for (const { reject } of this.#waiting.values()) reject(error);
    this.#waiting.clear();
  }

  /** The activity of the worker that takes too long; `null` if there is none. */
  #overdue(now: number): Query["kind"] | "play" | null {
    for (const { query, deadline } of this.#waiting.values()) {
      if (now > Math.max(deadline, this.#last + SILENCE)) return query.kind;
    }
    const isBusy = [...this.#waiting.values()].some(({ query }) => !QUICK.has(query.kind));
    return this.#isPlaying && !isBusy && now > this.#last + SILENCE ? "play" : null;
  }

  #watch(): void {
    const now = performance.now();
    const overdue = this.#overdue(now);
    if (overdue === null) this.#suspected = null;
    else if (this.#suspected === null) this.#suspected = now;
    else if (now > this.#suspected + GRACE) {
      this.end();
      this.onSilence(overdue);
    }
  }
}
