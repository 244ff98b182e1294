/**
 * Messages between the page and the worker that simulates. All numbers are SI; all texts are made by the worker.
 *
 * - Columns: signals of the plant have their plain names, even if another component has the same one.
 * - Adjustables: `plant:road_friction.*` is one number for all inputs of that group; `driver:driver.speed` is there while the visitor drives a
 *   plant with prescribed speed.
 * - A dropped FMU that fits no vehicle is a vehicle of its own, with the only maneuver `alone`.
 */

/** What the page can offer: made from the FMUs' descriptions and the scenarios by the worker, after `start`. */
export interface Catalog {
  vehicles: Vehicle[];
  maneuvers: Maneuver[];
  roads: Choice[];
  scenarios: ScenarioEntry[];
}

export interface Choice {
  id: string;
  title: string;
}

export interface Vehicle {
  /** Name of the FMU. */
  fmu: string;
  title: string;
  /** Controllers that fit by their signals, each with the ones it cannot work without. */
  controllers: Controller[];
  /** Controllers of the default system: those of its paper. */
  defaults: string[];
  /** Start values of all Real parameters, for the drawing: geometry, wheel radii. */
  parameters: Record<string, number>;
  /** Outputs, for the drawing: which wheels there are. */
  outputs: string[];
  /** Ids of the maneuvers that it can drive. */
  maneuvers: string[];
}

export interface Controller {
  fmu: string;
  title: string;
  /** Other controllers whose outputs it reads. */
  needs: string[];
  /** Controllers that write the same signals; two of them cannot be in one system. */
  excludes: string[];
}

export interface Maneuver {
  id: string;
  title: string;
  /** `bench`: of the test bench (PathDriver). `free`: the visitor drives. */
  kind: "bench" | "free";
  /** What can be chosen before it starts, the speed first. */
  values: Adjustable[];
}

export interface ScenarioEntry {
  /** File stem. */
  id: string;
  title: string;
  vehicle: string;
  cases: Choice[];
  seeds: number[];
}

/** A number with limits: of a maneuver, or a tunable parameter or an input of a running system. */
export interface Adjustable {
  /** Of a maneuver its name; of a system `component:variable`. */
  id: string;
  title: string;
  /** Empty if it has none. */
  unit: string;
  min: number;
  max: number;
  value: number;
  /** Display unit and factor from the unit to it (rad: deg, 57.3). */
  display: { unit: string; factor: number };
}

/** What is simulated. It is also what a link contains, so it has no binary data. */
export interface Setup {
  system: FreeSystem | ScenarioSystem;
  /** Values of parameters of the first system, by `component:parameter`, set before it starts. */
  values: Record<string, number>;
}

export interface FreeSystem {
  kind: "free";
  vehicle: string;
  /** Names of FMUs: ours, or of a dropped file. */
  controllers: string[];
  maneuver: string;
  /** Values of the maneuver by id; missing ones have their defaults. */
  maneuverValues: Record<string, number>;
  road: string;
  seed: number;
}

export interface ScenarioSystem {
  kind: "scenario";
  scenario: string;
  case: string;
  /** The case shown beside it; `null` for none. */
  twin: string | null;
  seed: number;
}

/** A system that was opened. The first one is the visitor's, the second one its twin without controllers. */
export interface Opened {
  /** Communication step, s. */
  step: number;
  /** End, s; the simulation pauses there. */
  stop: number;
  /** Time between two rows, s. */
  rowStep: number;
  /** One or two. */
  systems: SystemInfo[];
  /** Middle line of the path, and sections of cones (begin, end, right edge, left edge; m), where the maneuver has them. */
  path: [number, number][];
  cones: [number, number, number, number][];
  /** Where results of the run come from, for the page: versions and hashes of FMUs. */
  origin: { fmu: string; version: string; guid: string }[];
}

export interface SystemInfo {
  title: string;
  vehicle: string;
  components: { name: string; fmu: string }[];
  columns: Column[];
  /** Tunable parameters and unwritten inputs that may change while it runs. */
  adjustables: Adjustable[];
}

export interface Column {
  /** Name of the signal, such as `vehicle.yaw_rate`; `component:signal` for one that two components have. */
  name: string;
  description: string;
  unit: string;
  display: { unit: string; factor: number };
}

export interface Metric {
  id: string;
  title: string;
  unit: string;
  definition: string;
  /** One per system; `null` with a reason if it has none. */
  values: (number | boolean | null)[];
  reason: string;
  verdict: "pass" | "fail" | "info" | null;
}

/** What the visitor drives with: pedals from 0 to 1, steering-wheel angle from -1 (right) to 1 (left), or a speed for plants with prescribed speed. */
export interface Driving {
  steer: number;
  throttle: number;
  brake: number;
}

/** From the page. Every request with an `id` gets one response with it. */
export type Request =
  | { kind: "start"; id: number; core: Uint8Array; fmus: FmuFile[]; texts: Record<string, string> }
  /** More FMUs, fetched when chosen. */
  | { kind: "add"; id: number; fmus: FmuFile[] }
  /** A dropped `.fmu` file; it gets the name of its file. */
  | { kind: "drop"; id: number; name: string; archive: Uint8Array }
  | { kind: "open"; id: number; setup: Setup }
  /** Simulates `rate` seconds a second; 0 pauses; Infinity: as fast as possible. */
  | { kind: "play"; rate: number }
  /** Goes to an earlier time, from the nearest saved state; rows behind it belong to a new branch as soon as it goes on. */
  | { kind: "seek"; id: number; time: number }
  /** Sets an adjustable of a system from the next step on; `system` null: of both. */
  | { kind: "set"; system: number | null; adjustable: string; value: number }
  | { kind: "drive"; driving: Driving }
  | { kind: "metrics"; id: number }
  | { kind: "csv"; id: number; system: number }
  | { kind: "ssp"; id: number; system: number }
  /** Description of an FMU for reading: variables and documentation (HTML). */
  | { kind: "describe"; id: number; fmu: string };

export interface FmuFile {
  name: string;
  /** modelDescription.xml */
  description: string;
  /** Absent until the system needs it. */
  module: Uint8Array | null;
}

export type Response =
  | { kind: "error"; id: number; message: string; help: string }
  | { kind: "started"; id: number; catalog: Catalog }
  | { kind: "added"; id: number }
  | { kind: "dropped"; id: number; name: string; description: string; catalog: Catalog }
  /** `missing`: FMUs whose modules are needed first (`add`, then `open` again). */
  | { kind: "needs"; id: number; missing: string[] }
  | { kind: "opened"; id: number; opened: Opened }
  | { kind: "sought"; id: number; time: number }
  | { kind: "metrics"; id: number; metrics: Metric[] }
  | { kind: "file"; id: number; name: string; bytes: Uint8Array }
  | { kind: "described"; id: number; variables: VariableInfo[] };

export interface VariableInfo {
  name: string;
  causality: string;
  unit: string;
  start: string;
  description: string;
}

/** What happens while it runs. */
export type Event =
  /** New rows of a system: `data` has `count` rows of all columns, row by row, after the time of each. */
  | { kind: "rows"; system: number; branch: number; count: number; data: Float64Array }
  /** The simulation went on from an earlier time: later rows of older branches are kept for comparison. */
  | { kind: "branch"; branch: number; from: number }
  /** State of the clock, at least four times a second while it runs; the page takes a longer silence for an endless loop. */
  | { kind: "clock"; time: number; rate: number; playing: boolean }
  /** A system cannot go on: its time, the component, what was wrong. The other one goes on. */
  | { kind: "failed"; system: number; time: number; component: string; message: string };
