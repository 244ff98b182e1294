/**
 * A mock engine: it implements the protocol without a simulation, to cause failures that the real engine does not cause on demand.
 * Vehicles move by sine functions. The controller `Endless` stops responding at 1 s, `Broken` fails at 1 s, and `Rollover` ends both
 * systems at 4 s.
 */

import type { Adjustable, Catalog, Column, Controller, Event, FmuFile, Opened, Request, Response, Setup, Vehicle } from "../../lab/src/protocol";

const STEP = 0.01;
const STOP = 12;
const DEG = { unit: "deg", factor: 180 / Math.PI };
const adjustable = (id: string, title: string, unit: string, min: number, max: number, value: number): Adjustable => ({ id, title, unit, min, max, value, display: { unit: unit === "m/s" ? "km/h" : unit, factor: unit === "m/s" ? 3.6 : 1 } });

const DISPLAY: Record<string, Column["display"]> = { rad: DEG, "rad/s": { unit: "deg/s", factor: DEG.factor }, "m/s": { unit: "km/h", factor: 3.6 } };
const CONTROLLERS: Controller[] = [
  { fmu: "Steady", title: "Reduces roll", needs: [], excludes: ["Endless"] },
  { fmu: "Helper", title: "Needs Steady", needs: ["Steady"], excludes: [] },
  { fmu: "Endless", title: "Does not return from a step at 1 s", needs: [], excludes: ["Steady"] },
  { fmu: "Broken", title: "Fails at 1 s", needs: [], excludes: [] },
  { fmu: "Rollover", title: "Ends both systems at 4 s", needs: [], excludes: [] },
];
const SPEED = adjustable("speed", "Speed", "m/s", 5, 30, 20);

/** Columns of each vehicle. */
const columnsOf = new Map<string, Column[]>();

/** The vehicles among the FMUs, with parameters and outputs from their descriptions. */
function vehicles(fmus: FmuFile[]): Vehicle[] {
  return fmus.flatMap(({ name: fmu, description }) => {
    const variables = [...description.matchAll(/<ScalarVariable ([^>]*)>\s*<(\w+)([^>]*)/g)].map(([, head, , type]) => {
      const get = (attributes: string, key: string) => new RegExp(`\\b${key}="([^"]*)"`).exec(attributes)?.[1] ?? "";
      return { name: get(head!, "name"), causality: get(head!, "causality"), description: get(head!, "description"), unit: get(type!, "unit"), start: Number(get(type!, "start")) };
    });
    const outputs = variables.filter(({ causality }) => causality === "output");
    if (!outputs.some(({ name }) => name === "vehicle.yaw")) return [];
    const inputs = variables.filter(({ name }) => name.startsWith("steer."));
    columnsOf.set(fmu, [...outputs, ...inputs].map(({ name, description, unit }) => ({ name, description, unit, display: DISPLAY[unit] ?? { unit, factor: 1 } })));
    const parameters = Object.fromEntries(variables.filter(({ causality }) => causality === "parameter").map(({ name, start }) => [name, start]));
    const title = /description="([^"]*)"/.exec(description)?.[1] ?? "";
    return [{ fmu, title, controllers: CONTROLLERS, defaults: ["Steady"], parameters, outputs: outputs.map(({ name }) => name), maneuvers: ["weave", "free"] }];
  });
}

const catalog: Catalog = {
  vehicles: [],
  maneuvers: [
    { id: "weave", title: "Weave", kind: "bench", values: [SPEED] },
    { id: "free", title: "Free drive", kind: "free", values: [SPEED] },
  ],
  roads: [{ id: "flat", title: "Flat" }],
  scenarios: [{ id: "demo", title: "A demonstration", vehicle: "RescueVehicle", cases: [{ id: "none", title: "No control" }, { id: "all", title: "All controllers" }], seeds: [1, 2] }],
};

let setup: Setup | null = null;
let [time, rate, branch, branches, isBehind] = [0, 0, 0, 0, false];
let gain = 1;
let steer = 0;
let hasFailed = false;
let hasRolledOver = false;

const post = (message: Response | Event) => self.postMessage(message);
const has = (name: string) => setup?.system.kind === "free" && setup.system.controllers.includes(name);

const vehicleName = () => (setup?.system.kind === "free" ? setup.system.vehicle : "RescueVehicle");

function value(name: string, time: number, share: number, load: number): number {
  const w = 2 * Math.PI * 0.3;
  const [s, c] = [Math.sin(w * time), Math.cos(w * time)];
  const [group, place] = name.split(".") as [string, string];
  const side = place.endsWith("l") ? 1 : -1;
  switch (name) {
    case "vehicle.speed": return 20;
    case "vehicle.position_x": return 20 * time;
    case "vehicle.position_y": return 3 * (1 - c) * share + steer;
    case "vehicle.yaw": return 0.15 * s * share;
    case "vehicle.yaw_rate": return 0.28 * c * share;
    case "vehicle.lateral_acceleration": return 4 * s;
    case "vehicle.load_transfer_ratio": return 0.9 * s * share;
    case "body.roll": return 0.08 * s * share;
    case "body.pitch": return 0.01 * c;
    case "body.heave": return 0.01 * s;
    case "steer.front": return 0.06 * s;
    case "steer.rear": return -0.02 * s * share;
  }
  switch (group) {
    case "wheel_height": return 0.02 * share * side * s;
    case "wheel_speed": return 20 / 0.29;
    case "tire_load": return Math.max(0, load * (1 - 0.9 * share * side * s));
    case "tire_lateral_force": return 0.4 * load * s * (1 - 0.5 * side * s);
    default: return 0;
  }
}

function row(time: number, system: number): number[] {
  const isControlled = system === 0 && !(setup?.system.kind === "free" && setup.system.controllers.length === 0);
  const share = (isControlled ? 0.55 : 1) * gain;
  const { parameters = {}, outputs = [] } = catalog.vehicles.find(({ fmu }) => fmu === vehicleName()) ?? {};
  const wheels = outputs.filter((name) => name.startsWith("tire_load.")).length;
  const load = (9.81 * (parameters["vehicle.mass"] ?? parameters["body.mass"] ?? 1500)) / Math.max(4, wheels);
  return [time, ...columnsOf.get(vehicleName())!.map(({ name }) => value(name, time, share, load))];
}

function send(from: number, count: number): void {
  for (const system of [0, 1]) {
    if (system === 0 && hasFailed) continue;
    const rows = Array.from({ length: count }, (_, i) => row((from + i) * STEP, system)).flat();
    post({ kind: "rows", system, branch, count, data: Float64Array.from(rows) });
  }
}

const info = (title: string) => ({
  title, vehicle: vehicleName(), components: [{ name: "vehicle", fmu: vehicleName() }], columns: columnsOf.get(vehicleName())!,
  adjustables: [adjustable("vehicle:driver.speed", "Speed", "m/s", 0, 30, 20), adjustable("vehicle:tire.friction", "Friction", "", 0.1, 1, 0.7)],
});

function open(next: Setup): Opened {
  [setup, time, rate, branch, branches, isBehind, gain, steer, hasFailed, hasRolledOver] = [next, 0, 0, 0, 0, false, 1, 0, false, false];
  const path = Array.from({ length: 300 }, (_, i) => [i, 3 * (1 - Math.cos(2 * Math.PI * 0.3 * i / 20))] as [number, number]);
  return { step: 0.001, stop: STOP, rowStep: STEP, systems: [info(`${vehicleName()} with controllers`), info("Without controllers")], path, cones: [[20, 40, -2, 2], [60, 80, 4, 8]], origin: [{ fmu: "RescueVehicle", version: "0", guid: "{0}" }] };
}

setInterval(() => {
  if (rate === 0 || setup === null) return;
  if (isBehind) {
    isBehind = false;
    branch = ++branches;
    post({ kind: "branch", branch, from: time });
  }
  const wanted = Math.min(STOP, time + Math.min(rate, 50) * 0.03);
  const [first, last] = [Math.round(time / STEP) + 1, Math.round(wanted / STEP)];
  if (wanted > 1 && has("Endless")) for (;;);
  if (wanted > 1 && has("Broken") && !hasFailed) {
    hasFailed = true;
    post({ kind: "failed", system: 0, time: 1, component: "Broken", message: "division by zero" });
  }
  if (wanted > 4 && has("Rollover")) {
    if (!hasRolledOver) for (const system of [0, 1]) post({ kind: "failed", system, time: 4, component: "", message: "the vehicle rolled over" });
    [hasRolledOver, rate] = [true, 0];
    return post({ kind: "clock", time, rate, playing: false });
  }
  if (last >= first) send(first, last - first + 1);
  time = wanted;
  if (time >= STOP) rate = 0;
  post({ kind: "clock", time, rate, playing: rate > 0 });
}, 30);

self.addEventListener("message", ({ data }: MessageEvent<Request>) => {
  switch (data.kind) {
    case "start":
      catalog.vehicles = vehicles(data.fmus);
      return post({ kind: "started", id: data.id, catalog });
    case "add": return post({ kind: "added", id: data.id });
    case "drop": return post({ kind: "error", id: data.id, message: `${data.name} has no binary for WebAssembly.`, help: "Pack it with --platforms wasm32." });
    case "open":
      post({ kind: "opened", id: data.id, opened: open(data.setup) });
      return send(0, 1);
    case "play": rate = data.rate; return;
    case "seek":
      time = data.time;
      [isBehind, hasRolledOver] = [true, false];
      return post({ kind: "sought", id: data.id, time });
    case "set": if (data.adjustable.endsWith("friction")) gain = 0.7 / data.value; return;
    case "drive": steer = data.driving.steer; return;
    case "metrics": return post({ kind: "metrics", id: data.id, metrics: [{ id: "roll", title: "Greatest roll", unit: "deg", definition: "Greatest absolute value of the roll angle.", values: [2.5, 4.6], reason: "", verdict: "pass" }] });
    case "csv": case "ssp": return post({ kind: "file", id: data.id, name: `run.${data.kind}`, bytes: new TextEncoder().encode("time\n") });
    case "describe": return post({ kind: "described", id: data.id, variables: [{ name: "body.roll", causality: "output", unit: "rad", start: "", description: "Roll angle" }] });
  }
});
