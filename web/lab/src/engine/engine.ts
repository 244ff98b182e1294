// The engine of the lab: answers the page's requests, and advances the systems in real time.
import type { Catalog, Event, Metric, Opened, Request, Response, VariableInfo } from "../protocol";
import { Core, Failure } from "./core";

/** Wall-clock time, ms, for which the systems advance before the worker reads messages again (a turn). */
const TURN = 12;
const FAST_TURN = 50;
/** Simulated time by which a system advances before it is the other system's turn, s. */
const SLICE = 0.02;
/** Longest time between two `clock` events, ms. */
const CLOCK = 100;

export type Post = (message: Response | Event, transfer: Transferable[]) => void;

export class Engine {
  /** `null` before the first request. */
  core: Core | null = null;
  #opened: Opened | null = null;
  #rate = 0;
  #failed: boolean[] = [];
  #over: boolean[] = [];
  #branch = 0;
  /** The time to which the simulation went back, until it continues from there; otherwise `null`. */
  #from: number | null = null;
  /** Wall-clock time that corresponds to the simulated time, ms. */
  #reached = 0;
  #told = 0;
  #scheduled = false;

  constructor(readonly post: Post) {}

  receive(request: Request): void {
    const id = "id" in request ? request.id : null;
    try {
      this.#answer(request);
    } catch (error) {
      const message = error instanceof Error ? error.message : String(error);
      const help = error instanceof Failure ? error.help : "";
      if (id === null) console.error(message);
      else this.post({ kind: "error", id, message, help }, []);
    }
  }

  get #running(): Core {
    if (this.core === null) throw new Error("the first request must be `start`");
    return this.core;
  }

  #answer(request: Request): void {
    switch (request.kind) {
      case "start": {
        this.core = new Core(request.core);
        this.#add(request.fmus);
        const descriptions = Object.fromEntries(request.fmus.map((fmu) => [fmu.name, fmu.description]));
        const [catalog] = this.core.request<Catalog>({ kind: "start", descriptions, texts: request.texts });
        return this.post({ kind: "started", id: request.id, catalog }, []);
      }
      case "add":
        this.#add(request.fmus);
        return this.post({ kind: "added", id: request.id }, []);
      case "drop": {
        const { name, description, catalog } = this.#running.drop(request.name, request.archive);
        return this.post({ kind: "dropped", id: request.id, name, description, catalog }, []);
      }
      case "open":
        return this.#open(request);
      case "play":
        return this.#play(request.rate);
      case "seek": {
        const [{ time }] = this.#running.request<{ time: number }>(request);
        this.#from = time;
        this.#failed = this.#failed.map((_, index) => this.#running.failure(index) !== null);
        this.#over = this.#over.map(() => false);
        this.post({ kind: "sought", id: request.id, time }, []);
        return this.#tell();
      }
      case "set":
      case "drive":
        this.#running.request(request);
        return;
      case "metrics":
        return this.post({ kind: "metrics", id: request.id, metrics: this.#running.request<Metric[]>(request)[0] }, []);
      case "csv":
      case "ssp": {
        const [name, bytes] = this.#running.request<string>(request);
        return this.post({ kind: "file", id: request.id, name, bytes }, [bytes.buffer]);
      }
      case "describe":
        return this.post({ kind: "described", id: request.id, variables: this.#running.request<VariableInfo[]>(request)[0] }, []);
    }
  }

  #add(fmus: { name: string; module: Uint8Array | null }[]): void {
    for (const { name, module } of fmus) if (module !== null) this.#running.addModule(name, module);
  }

  #open(request: Extract<Request, { kind: "open" }>): void {
    this.#rate = 0;
    const opened = this.#running.open(request.setup);
    if ("missing" in opened) return this.post({ kind: "needs", id: request.id, missing: opened.missing }, []);
    this.#opened = opened;
    this.#branch = 0;
    this.#from = null;
    this.#failed = opened.systems.map(() => false);
    this.#over = opened.systems.map(() => false);
    this.post({ kind: "opened", id: request.id, opened }, []);
    this.#sendRows();
    this.#tell();
  }

  #play(rate: number): void {
    if (this.#opened === null) return;
    this.#rate = rate;
    this.#reached = performance.now();
    if (rate > 0) this.#schedule();
    this.#tell();
  }

  #schedule(): void {
    if (this.#scheduled) return;
    this.#scheduled = true;
    setTimeout(() => {
      this.#scheduled = false;
      this.#turn();
    }, this.#rate === Number.POSITIVE_INFINITY ? 0 : 4);
  }

  /** Advances the systems to the time they should have reached, within the duration of a turn. */
  #turn(): void {
    if (this.#opened === null || this.#rate <= 0) return;
    const { step } = this.#opened;
    const begin = performance.now();
    const end = begin + (this.#rate === Number.POSITIVE_INFINITY ? FAST_TURN : TURN);
    const wanted = this.#rate === Number.POSITIVE_INFINITY ? Number.POSITIVE_INFINITY : ((begin - this.#reached) / 1000) * this.#rate;
    let steps = Math.floor(wanted / step);
    const slice = Math.max(1, Math.round(SLICE / step));
    if (steps > 0) this.#begin();
    let done = 0;
    while (steps > 0 && this.#isActive && performance.now() < end) {
      const now = Math.min(steps, slice);
      this.#advance(now);
      steps -= now;
      done += now;
    }
    // Steps that do not fit into a turn are not made up for later; the simulation is then slower than real time.
    this.#reached = steps > 0 || done === 0 ? (done === 0 ? this.#reached : performance.now()) : this.#reached + ((done * step) / this.#rate) * 1000;
    this.#sendRows();
    if (!this.#isActive) {
      this.#rate = 0;
      return this.#tell();
    }
    if (performance.now() - this.#told >= CLOCK) this.#tell();
    this.#schedule();
  }

  get #isActive(): boolean {
    return this.#failed.some((failed, index) => !failed && !this.#over[index]);
  }

  /** Continues the simulation; begins a new branch if it went back. */
  #begin(): void {
    if (this.#from === null) return;
    this.#branch += 1;
    this.post({ kind: "branch", branch: this.#branch, from: this.#from }, []);
    this.#from = null;
    // A system that had failed before the time of the branch has failed in the branch, too.
    this.#failed.forEach((failed, system) => failed && this.#report(system));
  }

  #advance(steps: number): void {
    this.#failed.forEach((failed, system) => {
      if (failed || this.#over[system]) return;
      const done = this.#running.advance(system, steps);
      if (done < 0) {
        this.#failed[system] = true;
        this.#sendRows();
        this.#report(system);
      } else if (done < steps) {
        this.#over[system] = true;
      }
    });
  }

  #report(system: number): void {
    const failure = this.#running.failure(system);
    this.post({ kind: "failed", system, time: failure?.time ?? this.#running.time(system), component: failure?.component ?? "", message: failure?.message ?? "" }, []);
  }

  #sendRows(): void {
    this.#opened?.systems.forEach(({ columns }, system) => {
      const { count, data } = this.#running.rows(system, columns.length + 1);
      if (count > 0) this.post({ kind: "rows", system, branch: this.#branch, count, data }, [data.buffer]);
    });
  }

  #tell(): void {
    if (this.#opened === null) return;
    this.#told = performance.now();
    const times = this.#opened.systems.map((_, system) => this.#running.time(system));
    this.post({ kind: "clock", time: Math.max(...times), rate: this.#rate, playing: this.#rate > 0 }, []);
  }
}
