/**
 * Messages between the page and the worker that simulates. All numbers are in SI units; the worker makes all texts.
 *
 * - Columns: signals of the plant have their plain names, even if another component has a signal with the same name.
 * - Adjustables: `plant:road_friction.*` is one number for all inputs of this group; `driver:driver.speed` exists while the visitor drives
 *   a plant with prescribed speed.
 * - A dropped FMU that fits no vehicle becomes a separate vehicle, whose only maneuver is `alone`.
 */

/** The choices that the page offers. After `start`, the worker makes them from the FMUs' descriptions and the scenarios. */
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
  fmu: string;
  title: string;
  /** Controllers whose signals fit the vehicle, each with the controllers that it needs. */
  controllers: Controller[];
  /** Controllers of the default system, from the vehicle's paper. */
  defaults: string[];
  /** Start values of all Real parameters, such as dimensions for the drawing. */
  parameters: Record<string, number>;
  /** Names of the outputs. They show which wheels the vehicle has. */
  outputs: string[];
  /** Ids of the maneuvers that the vehicle can drive. */
  maneuvers: string[];
}

export interface Controller {
  fmu: string;
  title: string;
  /** Other controllers whose outputs this one reads. */
  needs: string[];
  /** Controllers that write the same signals as this one, and therefore cannot be in the same system. */
  excludes: string[];
}

export interface Maneuver {
  id: string;
  title: string;
  /** `bench`: a maneuver from the test bench (PathDriver). `free`: the visitor drives. */
  kind: "bench" | "free";
  /** Values that can be chosen before the start; the speed is the first. */
  values: Adjustable[];
}

export interface ScenarioEntry {
  id: string;
  title: string;
  vehicle: string;
  cases: Choice[];
  seeds: number[];
}

/** A number with limits: a value of a maneuver, or a tunable parameter or input of a running system. */
export interface Adjustable {
  /** For a maneuver, the name of the value; for a system, `component:variable`. */
  id: string;
  title: string;
  /** Empty for a number without unit. */
  unit: string;
  min: number;
  max: number;
  value: number;
  /** Display unit and factor from the unit to it (rad: deg, 57.3). */
  display: { unit: string; factor: number };
}

/** The description of a simulation. Links contain it, so it has no binary data. */
export interface Setup {
  system: FreeSystem | ScenarioSystem;
  /** Values of parameters of the first system, by `component:parameter`, set before it starts. */
  values: Record<string, number>;
}

export interface FreeSystem {
  kind: "free";
  vehicle: string;
  /** Names of FMUs, from the library or from dropped files. */
  controllers: string[];
  maneuver: string;
  /** Values of the maneuver by id; a value that is missing has its default. */
  maneuverValues: Record<string, number>;
  road: string;
  seed: number;
}

export interface ScenarioSystem {
  kind: "scenario";
  scenario: string;
  case: string;
  /** The case shown for comparison; `null` for none. */
  twin: string | null;
  seed: number;
}

/** An opened simulation: the visitor's system, and usually its twin without controllers. */
export interface Opened {
  /** Communication step, s. */
  step: number;
  /** Time at which the simulation ends, s. */
  stop: number;
  /** Time between two rows, s. */
  rowStep: number;
  systems: SystemInfo[];
  /** Center line of the path, and sections of cones (begin, end, right edge, left edge; m), if the maneuver has them. */
  path: [number, number][];
  cones: [number, number, number, number][];
  /** Origin of the results: versions and GUIDs of the FMUs. */
  origin: { fmu: string; version: string; guid: string }[];
}

export interface SystemInfo {
  title: string;
  vehicle: string;
  components: { name: string; fmu: string }[];
  columns: Column[];
  /** Tunable parameters and unconnected inputs, which can change while the system runs. */
  adjustables: Adjustable[];
}

export interface Column {
  /** Name of the signal, such as `vehicle.yaw_rate`; `component:signal` if two components have a signal with this name. */
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
  /** One value per system; `null`, with a reason, if the metric is undefined. */
  values: (number | boolean | null)[];
  reason: string;
  verdict: "pass" | "fail" | "info" | null;
}

/** The visitor's commands: pedals from 0 to 1, steering-wheel angle from -1 (right) to 1 (left), or a speed for plants with prescribed speed. */
export interface Driving {
  steer: number;
  throttle: number;
  brake: number;
}

/** A message from the page. Every request with an `id` gets one response with this id. */
export type Request =
  | { kind: "start"; id: number; core: Uint8Array; fmus: FmuFile[]; texts: Record<string, string> }
  /** More FMUs, fetched when chosen. */
  | { kind: "add"; id: number; fmus: FmuFile[] }
  /** A dropped `.fmu` file; the FMU is named after the file. */
  | { kind: "drop"; id: number; name: string; archive: Uint8Array }
  | { kind: "open"; id: number; setup: Setup }
  /** Simulates `rate` seconds per second; 0: pauses; Infinity: as fast as possible. */
  | { kind: "play"; rate: number }
  /** Goes back to a time, starting from the nearest saved state. When the simulation continues, later rows belong to a new branch. */
  | { kind: "seek"; id: number; time: number }
  /** Sets an adjustable of a system from the next step on; `system` null: of both systems. */
  | { kind: "set"; system: number | null; adjustable: string; value: number }
  | { kind: "drive"; driving: Driving }
  | { kind: "metrics"; id: number }
  | { kind: "csv"; id: number; system: number }
  | { kind: "ssp"; id: number; system: number }
  /** Asks for the variables and the documentation (HTML) of an FMU. */
  | { kind: "describe"; id: number; fmu: string };

export interface FmuFile {
  name: string;
  description: string;
  /** `null` until the system needs the module. */
  module: Uint8Array | null;
}

export type Response =
  | { kind: "error"; id: number; message: string; help: string }
  | { kind: "started"; id: number; catalog: Catalog }
  | { kind: "added"; id: number }
  | { kind: "dropped"; id: number; name: string; description: string; catalog: Catalog }
  /** `missing`: FMUs whose modules must be added first (`add`, then `open` again). */
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

export type Event =
  /** New rows of a system: `data` has `count` rows, each with its time and all columns. */
  | { kind: "rows"; system: number; branch: number; count: number; data: Float64Array }
  /** The simulation continued from an earlier time. Later rows of older branches are kept for comparison. */
  | { kind: "branch"; branch: number; from: number }
  /** State of the clock, at least four times a second while the simulation runs. The page treats a longer silence as an endless loop. */
  | { kind: "clock"; time: number; rate: number; playing: boolean }
  /** A system cannot continue: time, component and error. The other system continues. */
  | { kind: "failed"; system: number; time: number; component: string; message: string };
