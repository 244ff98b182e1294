/** The state of the lab, independent of its display: the open systems, the recordings, the time shown. */

import { core, texts, worker } from "lab:data";
import { Engine, EngineError, type Query } from "./engine-client";
import { allFmus, isOurs, remember, unpack, unpackJson, withModules } from "./library";
import type { Catalog, Driving, Event, FreeSystem, Metric, Opened, Setup, VariableInfo, Vehicle } from "./protocol";
import { Recording, wheelPlaces } from "./recording";
import { shapeOf } from "./shape";

/** A branch of the simulation. Going back in time and continuing from there begins a new branch. */
export interface Branch {
  id: number;
  /** Time at which the branch left its parent branch, s; 0 for the first branch. */
  from: number;
}

interface Listeners {
  catalog: () => void;
  opened: () => void;
  rows: () => void;
  clock: () => void;
  branch: () => void;
  value: () => void;
  failed: (failure: Failure) => void;
  message: (message: Message) => void;
}

export interface Failure {
  system: number;
  title: string;
  time: number;
  component: string;
  message: string;
}

export interface Message {
  level: "info" | "error";
  text: string;
  help: string;
}

/** Largest delay of the display behind the simulation, in seconds of wall-clock time. */
const LAG = 0.3;

export class Model {
  catalog: Catalog | null = null;
  setup: Setup | null = null;
  opened: Opened | null = null;
  recordings: Recording[] = [];
  branches: Branch[] = [];
  branch = 0;
  failures: Failure[] = [];
  playing = false;
  rate = 1;
  /** The time shown, s. */
  time = 0;
  /** Values of adjustables that the visitor changed. */
  readonly changed = new Map<string, number>();
  #engine: Engine;
  #opening = 0;
  #wantsToPlay = false;
  /** Whether the next `play` must first go back to the time shown. */
  #isBehind = false;
  /** Whether a new worker is starting. Controls and link are updated together, after its system has opened. */
  #isRestarting = false;
  readonly #archives = new Map<string, Uint8Array>();
  /** The setup of a link whose FMUs have not all been dropped yet. */
  #awaited: Setup | null = null;
  readonly #listeners: { [K in keyof Listeners]: Listeners[K][] } = {
    catalog: [], opened: [], rows: [], clock: [], branch: [], value: [], failed: [], message: [],
  };

  constructor() {
    this.#engine = this.#newEngine();
  }

  on<K extends keyof Listeners>(kind: K, listener: Listeners[K]): void {
    this.#listeners[kind].push(listener);
  }

  #emit<K extends keyof Listeners>(kind: K, ...values: Parameters<Listeners[K]>): void {
    for (const listener of this.#listeners[kind]) (listener as (...values: Parameters<Listeners[K]>) => void)(...values);
  }

  #newEngine(): Engine {
    return new Engine(worker, (event) => this.#receive(event), (during) => void this.#restart(during));
  }

  async start(): Promise<void> {
    const [code, fmus, files] = await Promise.all([unpack(core), allFmus(), unpackJson<Record<string, string>>(texts)]);
    const started = await this.#engine.ask({ kind: "start", core: code, fmus, texts: files }, [code.buffer as ArrayBuffer], "started");
    this.#setCatalog(started.catalog);
  }

  #setCatalog(catalog: Catalog): void {
    this.catalog = catalog;
    if (!this.#isRestarting) this.#emit("catalog");
  }

  report(error: unknown): void {
    const help = error instanceof EngineError ? error.help : "";
    this.say("error", error instanceof Error ? error.message : String(error), help);
  }

  say(level: Message["level"], text: string, help = ""): void {
    this.#emit("message", { level, text, help });
  }

  vehicle(name: string): Vehicle | undefined {
    return this.catalog?.vehicles.find(({ fmu }) => fmu === name);
  }

  /** The default setup of a vehicle: the controllers of its paper, and its first test-bench maneuver. */
  defaultSetup(vehicle: Vehicle): Setup {
    const known = (this.catalog?.maneuvers ?? []).filter(({ id }) => vehicle.maneuvers.includes(id));
    const maneuver = (known.find(({ kind }) => kind === "bench") ?? known[0])?.id ?? "";
    const system: FreeSystem = {
      kind: "free",
      vehicle: vehicle.fmu,
      controllers: [...vehicle.defaults],
      maneuver,
      maneuverValues: {},
      road: this.catalog?.roads[0]?.id ?? "",
      seed: 1,
    };
    return { system, values: {} };
  }

  #absent({ system }: Setup): string[] {
    const vehicles = this.catalog?.vehicles ?? [];
    const known = new Set(vehicles.flatMap(({ fmu, controllers }) => [fmu, ...controllers.map((controller) => controller.fmu)]));
    return system.kind === "free" ? [system.vehicle, ...system.controllers].filter((name) => !known.has(name)) : [];
  }

  /** The setup of a link without the FMUs that the visitor must drop first; `null` if the vehicle is one of these FMUs. */
  withoutAbsent(setup: Setup): Setup | null {
    const absent = this.#absent(setup);
    const { system } = setup;
    if (absent.length === 0 || system.kind !== "free") return setup;
    this.#awaited = setup;
    const files = absent.map((name) => `${name}.fmu`).join(", ");
    this.say("error", `The system of this link needs ${absent.join(", ")}, which the link does not contain.`, `Drop ${files} into the page to open the system.`);
    if (absent.includes(system.vehicle)) return null;
    return { ...setup, system: { ...system, controllers: system.controllers.filter((name) => !absent.includes(name)) } };
  }

  /** The setup of a link whose last FMU has been dropped. */
  takeAwaited(): Setup | null {
    const awaited = this.#awaited;
    if (awaited === null || this.#absent(awaited).length > 0) return null;
    this.#awaited = null;
    return awaited;
  }

  /** Opens a setup. A later call supersedes earlier ones. */
  async open(setup: Setup): Promise<boolean> {
    const order = ++this.#opening;
    this.pause();
    try {
      for (;;) {
        const response = await this.#engine.ask({ kind: "open", setup }, [], "opened", "needs");
        if (order !== this.#opening) return false;
        if (response.kind === "opened") {
          this.#begin(setup, response.opened);
          return true;
        }
        await this.#engine.ask({ kind: "add", fmus: await withModules(response.missing) }, [], "added");
        if (order !== this.#opening) return false;
      }
    } catch (error) {
      if (order === this.#opening) this.report(error);
      return false;
    }
  }

  #begin(setup: Setup, opened: Opened): void {
    const isSame = this.setup !== null && JSON.stringify(setup.system) === JSON.stringify(this.setup.system);
    this.setup = setup;
    this.opened = opened;
    this.failures = [];
    this.branches = [{ id: 0, from: 0 }];
    this.branch = 0;
    this.time = 0;
    this.#isBehind = false;
    if (!isSame) this.changed.clear();
    for (const [id, value] of Object.entries(setup.values)) this.changed.set(id, value);
    this.recordings = opened.systems.map((info) => {
      const vehicle = this.vehicle(info.vehicle);
      const shape = vehicle === undefined ? null : shapeOf(vehicle);
      const wheels = vehicle === undefined || shape === null ? [] : wheelPlaces(vehicle).map((place) => ({ place, radius: shape.radius }));
      return new Recording(info, opened.rowStep, wheels);
    });
    for (const { system, branch, count, data } of this.#early) this.recordings[system]?.append(branch, count, data);
    this.#early = [];
    this.#emit("opened");
    this.#emit("rows");
  }

  /** Rows that arrived before the response to `open`. */
  #early: Extract<Event, { kind: "rows" }>[] = [];

  #receive(event: Event): void {
    switch (event.kind) {
      case "rows":
        this.recordings[event.system]?.append(event.branch, event.count, event.data);
        this.#emit("rows");
        break;
      case "branch":
        for (const recording of this.recordings) recording.branch(event.branch, this.branch, event.from);
        this.branches.push({ id: event.branch, from: event.from });
        this.branch = event.branch;
        // Failures belong to the previous branch; the engine reports systems that fail in the new one again.
        this.failures = [];
        this.#emit("branch");
        break;
      case "clock":
        // An event that was sent before a pause can arrive after it.
        this.playing = event.playing && this.#wantsToPlay;
        this.#emit("clock");
        break;
      case "failed": {
        const failure = { ...event, title: this.titleOf(event.system) };
        this.failures.push(failure);
        this.#emit("failed", failure);
        break;
      }
    }
  }

  /** Latest simulated time of the current branch, s. */
  get end(): number {
    return Math.max(0, ...this.recordings.map((recording) => recording.end(this.branch)));
  }

  /** Whether all systems have reached the end of the maneuver or failed. */
  get hasEnded(): boolean {
    const { opened } = this;
    if (opened === null) return false;
    const isOver = (recording: Recording, system: number) =>
      recording.end(this.branch) > opened.stop - opened.rowStep * 1.001 || this.failures.some((failure) => failure.system === system);
    return this.recordings.every(isOver);
  }

  /** Whether the last row is shown. The end of the simulation can be between two row times. */
  get isFinished(): boolean {
    return this.opened !== null && this.time > this.opened.stop - this.opened.rowStep * 1.001;
  }

  async play(): Promise<void> {
    if (this.opened === null) return;
    if (this.isFinished) this.scrub(0);
    if (this.#isBehind) {
      this.#isBehind = false;
      try {
        const sought = await this.#engine.ask({ kind: "seek", time: this.time }, [], "sought");
        this.time = sought.time;
      } catch (error) {
        this.report(error);
        return;
      }
    }
    this.playing = this.#wantsToPlay = true;
    this.#engine.tell({ kind: "play", rate: this.rate });
    this.#emit("clock");
  }

  pause(): void {
    this.#wantsToPlay = false;
    if (!this.playing) return;
    this.playing = false;
    this.#engine.tell({ kind: "play", rate: 0 });
    this.#emit("clock");
  }

  setRate(rate: number): void {
    this.rate = rate;
    if (this.playing) this.#engine.tell({ kind: "play", rate });
  }

  /** Shows a simulated time. The simulation continues from there. */
  scrub(time: number): void {
    this.pause();
    this.time = Math.max(0, Math.min(time, this.end));
    this.#isBehind = true;
    this.#emit("clock");
  }

  /** Advances the time shown by a frame of the display. */
  advance(seconds: number): void {
    const end = this.end;
    if (this.#isBehind || this.time >= end) return;
    const step = Number.isFinite(this.rate) ? seconds * this.rate : Infinity;
    const lag = Number.isFinite(this.rate) ? LAG * this.rate : 0;
    this.time = Math.min(end, Math.max(this.time + step, end - lag));
    if (!this.playing) this.time = end;
  }

  /** Sets an adjustable, in both systems if both have it. */
  set(id: string, value: number): void {
    this.changed.set(id, value);
    const owners = (this.opened?.systems ?? []).filter(({ adjustables }) => adjustables.some((one) => one.id === id)).length;
    this.#engine.tell({ kind: "set", system: owners > 1 ? null : 0, adjustable: id, value });
    this.#emit("value");
  }

  drive(driving: Driving): void {
    this.#engine.tell({ kind: "drive", driving });
  }

  /** A short title of a system, with the number of its controllers if it has several. */
  titleOf(index: number): string {
    const title = this.opened?.systems[index]?.title ?? "";
    const system = this.setup?.system;
    if (system?.kind !== "free") return title;
    const count = index === 0 ? system.controllers.length : 0;
    return `${system.vehicle} ${count === 0 ? "without control" : count === 1 ? `with ${system.controllers[0]}` : `with ${count} controllers`}`;
  }

  get task(): string {
    const { catalog } = this;
    const system = this.setup?.system;
    if (system === undefined) return "";
    if (system.kind === "scenario") return catalog?.scenarios.find(({ id }) => id === system.scenario)?.title ?? system.scenario;
    return catalog?.maneuvers.find(({ id }) => id === system.maneuver)?.title ?? "";
  }

  /** The file name for the run of a system. */
  runOf(index: number): string {
    const system = this.setup?.system;
    const words =
      system?.kind === "scenario"
        ? [system.scenario, index === 0 ? system.case : (system.twin ?? "")]
        : [system?.vehicle, ...(index === 0 && system !== undefined && system.controllers.length > 0 ? ["with", ...system.controllers] : ["without_control"]), system?.maneuver];
    return words.join("_").replaceAll(/[^\w.-]+/g, "_");
  }

  /** The setup, with the current values as start values. */
  currentSetup(): Setup | null {
    if (this.setup === null) return null;
    return { system: this.setup.system, values: Object.fromEntries(this.changed) };
  }

  async metrics(): Promise<Metric[]> {
    return (await this.#engine.ask({ kind: "metrics" }, [], "metrics")).metrics;
  }

  async file(kind: "csv" | "ssp", system: number): Promise<{ name: string; bytes: Uint8Array }> {
    return this.#engine.ask({ kind, system }, [], "file");
  }

  async describe(fmu: string): Promise<VariableInfo[]> {
    return (await this.#engine.ask({ kind: "describe", fmu }, [], "described")).variables;
  }

  /** Adds an FMU from the visitor, and returns its name. */
  async drop(name: string, archive: Uint8Array): Promise<string> {
    const dropped = await this.#engine.ask({ kind: "drop", name, archive: archive.slice() }, [], "dropped");
    this.#archives.set(dropped.name, archive);
    remember(dropped.name, dropped.description);
    this.#setCatalog(dropped.catalog);
    return dropped.name;
  }

  #foreign(): string[] {
    const names = (this.opened?.systems ?? []).flatMap(({ components }) => components.map(({ fmu }) => fmu));
    const chosen = this.setup?.system.kind === "free" ? this.setup.system.controllers : [];
    return [...new Set([...names, ...chosen])].filter((name) => !isOurs(name));
  }

  /** Replaces a worker that did not respond by a new worker, without the visitor's FMU that is probably the cause. */
  async #restart(during: Query["kind"] | "play"): Promise<void> {
    const foreign = this.#foreign();
    const culprit = foreign.length > 0 ? foreign.join(" or ") : (this.opened === null ? "The system" : this.titleOf(0));
    const place = during === "play" ? `after ${this.end.toFixed(2)} s` : `during "${during}"`;
    this.say("error", `${culprit} did not return from a call ${place}. The simulation was ended and restarted.`,
      foreign.length > 0 ? "It was removed from the system. Look for an endless loop in its step." : "Choose other values.");
    this.playing = false;
    for (const name of foreign) this.#archives.delete(name);
    this.#engine = this.#newEngine();
    this.#isRestarting = true;
    try {
      await this.start();
      for (const [name, archive] of this.#archives) await this.drop(name, archive);
      if (this.setup === null) return;
      const { system } = this.setup;
      const isLost = system.kind === "free" && foreign.includes(system.vehicle);
      const first = this.catalog?.vehicles[0];
      if (isLost && first !== undefined) await this.open(this.defaultSetup(first));
      else if (system.kind === "free") {
        await this.open({ ...this.setup, system: { ...system, controllers: system.controllers.filter((name) => !foreign.includes(name)) } });
      } else await this.open(this.setup);
    } catch (error) {
      this.report(error);
    } finally {
      this.#isRestarting = false;
      this.#emit("catalog");
    }
  }
}
