/** The lab: creates its parts and connects them. */

import "uplot/dist/uPlot.min.css";
import "./lab.css";
import { byId, isControl, reducedMotion } from "./dom";
import { decode } from "./link";
import { Messages } from "./messages";
import { Model } from "./model";
import { AdjustPanel } from "./panels/adjust";
import { DrivingPanel } from "./panels/driving";
import { MetricsPanel } from "./panels/metrics";
import { ReaderPanel } from "./panels/reader";
import { SetupPanel } from "./panels/setup";
import { SharePanel } from "./panels/share";
import { Transport } from "./panels/transport";
import { Plots } from "./plots";
import type { Setup } from "./protocol";
import { Stage } from "./stage";
import { Traces } from "./traces";

/** Longest duration of a frame, s. A longer pause of the browser counts as a frame of this duration. */
const LONGEST_FRAME = 0.1;

const model = new Model();
new Messages(model);
const traces = new Traces(model);
const plots = new Plots(model, traces, byId("plots"), byId("plot-tools"), byId("traces"));
const stage = new Stage(model, traces, () => plots.retrace());
const transport = new Transport(model, byId("transport"), () => {
  const setup = model.currentSetup();
  if (setup !== null) void run(setup);
});
const driving = new DrivingPanel(model, byId("driving"));
const metrics = new MetricsPanel(model, byId("metrics"));
new SetupPanel(model, byId("setup"), byId("quick-setup"));
new AdjustPanel(model, byId("adjust"), byId("adjust-tools"), byId("quick-adjust"));
new SharePanel(model, byId("share"));
new ReaderPanel(model, byId("reader"), byId("reader-tools"));

async function run(setup: Setup, plays = true): Promise<boolean> {
  const isOpen = await model.open(setup);
  if (isOpen && plays) await model.play();
  return isOpen;
}

/** Opens the setup in the link, or, if the link contains no valid setup, the default setup of the first vehicle. */
async function openLink(plays: boolean): Promise<void> {
  const { catalog } = model;
  const first = catalog?.vehicles.find(({ fmu }) => fmu === "RescueVehicle") ?? catalog?.vehicles[0];
  if (catalog === null || first === undefined) return;
  let setup: Setup | null = null;
  try {
    const linked = decode(location.hash, catalog);
    setup = linked === null ? null : model.withoutAbsent(linked);
  } catch (error) {
    model.report(error);
  }
  if (setup === null || !(await run(setup, plays))) await run(model.defaultSetup(first), plays);
}

model.on("opened", () => {
  const { opened, task } = model;
  if (opened === null) return;
  const title = model.titleOf(0);
  byId("title").textContent = `${title} · ${task}`;
  document.body.dataset["state"] = "open";
  byId("status").textContent = `Opened: ${title}, ${task}`;
  const fmus = opened.origin.map(({ fmu, version, guid }) => `${fmu} ${version} ${guid}`);
  byId("origin").textContent = fmus.join(" · ");
});
model.on("message", () => {
  if (model.opened === null) byId("cover").textContent = "The models could not be opened.";
});

window.addEventListener("hashchange", () => void openLink(true));
window.addEventListener("keydown", (event) => {
  if (event.key !== " " || isControl(event.target) || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  if (model.playing) model.pause();
  else void model.play();
});

/** The simulation pauses while the page is hidden. */
let wasPlaying = false;
document.addEventListener("visibilitychange", () => {
  if (document.hidden) {
    wasPlaying = model.playing;
    model.pause();
  } else if (wasPlaying) void model.play();
});

let last = performance.now();
function frame(now: number): void {
  const seconds = Math.min(LONGEST_FRAME, (now - last) / 1000);
  last = now;
  driving.frame(seconds);
  model.advance(seconds);
  stage.frame(seconds);
  transport.frame();
  plots.frame(now);
  metrics.frame(now);
  requestAnimationFrame(frame);
}
requestAnimationFrame(frame);

async function start(): Promise<void> {
  try {
    await model.start();
    // If the visitor prefers reduced motion, the simulation does not start automatically.
    await openLink(!reducedMotion.matches);
  } catch (error) {
    model.report(error);
  }
}
void start();
