/** Choice of the system: vehicle, controllers, maneuver and road, or a scenario from the library. */

import { button, element } from "../../../src/dom";
import { Choice } from "../choice";
import { field, fill, note } from "../dom";
import { summary } from "../library";
import type { Model } from "../model";
import type { Controller, FreeSystem, ScenarioSystem, Vehicle } from "../protocol";
import { slider } from "./controls";

const KINDS = { bench: "Test bench", free: "You drive" };

export class SetupPanel {
  readonly #kind = element("select", { id: "setup-kind", onchange: () => this.#changeKind() });
  readonly #body = element("div", { className: "fields" });
  #timer = 0;
  /** Whether controllers are listed that are neither chosen nor from the vehicle's paper. */
  #showsMore = false;

  constructor(
    readonly model: Model,
    root: HTMLElement,
    /** Container for the maneuver's values, below the view. */
    readonly quick: HTMLElement,
  ) {
    fill(this.#kind, [{ value: "free", title: "A vehicle and controllers of your choice" }, { value: "scenario", title: "A scenario from the library" }], "free");
    root.append(element("div", { className: "fields" }, field("Simulate", this.#kind)), this.#body);
    model.on("opened", () => this.show());
    model.on("catalog", () => this.show());
  }

  show(): void {
    const { setup, catalog } = this.model;
    if (setup === null || catalog === null) return;
    // A control keeps the focus when it is rebuilt.
    const places = [this.#body, this.quick];
    const focused = places.some((place) => place.contains(document.activeElement)) ? document.activeElement?.getAttribute("data-key") : null;
    this.quick.replaceChildren();
    this.#kind.value = setup.system.kind;
    if (setup.system.kind === "free") this.#showFree(setup.system);
    else this.#showScenario(setup.system);
    if (focused !== null && focused !== undefined) for (const place of places) place.querySelector<HTMLElement>(`[data-key="${CSS.escape(focused)}"]`)?.focus();
  }

  #changeKind(): void {
    const { catalog, setup } = this.model;
    if (catalog === null || setup === null) return;
    if (this.#kind.value === "free") {
      const name = setup.system.kind === "scenario" ? catalog.scenarios.find(({ id }) => id === (setup.system as ScenarioSystem).scenario)?.vehicle : undefined;
      const vehicle = catalog.vehicles.find(({ fmu }) => fmu === name) ?? catalog.vehicles[0];
      if (vehicle !== undefined) void this.#run(this.model.defaultSetup(vehicle).system);
      return;
    }
    const name = setup.system.kind === "free" ? setup.system.vehicle : "";
    const scenario = catalog.scenarios.find(({ vehicle }) => vehicle === name) ?? catalog.scenarios[0];
    if (scenario !== undefined) this.#openScenario(scenario.id);
  }

  #openScenario(id: string): void {
    const scenario = this.model.catalog?.scenarios.find((one) => one.id === id);
    if (scenario === undefined) return;
    // The first case is usually without control, the last one the most complete system.
    const [chosen, twin] = [scenario.cases.at(-1), scenario.cases[0]];
    void this.#run({ kind: "scenario", scenario: id, case: chosen?.id ?? "", twin: twin === undefined || twin === chosen ? null : twin.id, seed: scenario.seeds[0] ?? 1 });
  }

  async #run(system: FreeSystem | ScenarioSystem): Promise<void> {
    clearTimeout(this.#timer);
    if (await this.model.open({ system, values: {} })) void this.model.play();
    else this.show();
  }

  #select(title: string, key: string, options: { value: string; title: string; group?: string }[], value: string, change: (value: string) => void): HTMLElement {
    const select = element("select", { "data-key": key, onchange: () => change(select.value) });
    fill(select, options, value);
    return field(title, select);
  }

  #seed(value: number, change: (value: number) => void): HTMLElement {
    const onchange = () => input.checkValidity() && input.value !== "" && change(input.valueAsNumber);
    const input = element("input", { type: "number", min: "0", max: "1000000", step: "1", value: String(value), "data-key": "seed", onchange });
    return field("Seed of random numbers", input);
  }

  #showFree(system: FreeSystem): void {
    const catalog = this.model.catalog!;
    const vehicle = this.model.vehicle(system.vehicle);
    const change = (part: Partial<FreeSystem>) => void this.#run({ ...system, ...part });
    const parts: HTMLElement[] = [
      this.#select("Vehicle", "vehicle", catalog.vehicles.map(({ fmu }) => ({ value: fmu, title: fmu })), system.vehicle, (name) => {
        const next = this.model.vehicle(name);
        if (next === undefined) return;
        const fresh = this.model.defaultSetup(next).system as FreeSystem;
        // The maneuver and the road stay if the vehicle can drive them.
        const stays = next.maneuvers.includes(system.maneuver);
        void this.#run(stays ? { ...fresh, maneuver: system.maneuver, road: system.road, seed: system.seed } : fresh);
      }),
    ];
    if (vehicle !== undefined) {
      parts.push(note(summary(vehicle.fmu) || vehicle.title), this.#controllers(vehicle, system, change));
    }
    const maneuvers = catalog.maneuvers.filter(({ id }) => vehicle?.maneuvers.includes(id) ?? true);
    const maneuver = maneuvers.find(({ id }) => id === system.maneuver);
    parts.push(
      this.#select("Maneuver", "maneuver", maneuvers.map(({ id, title, kind }) => ({ value: id, title, group: KINDS[kind] })), system.maneuver, (id) => change({ maneuver: id, maneuverValues: {} })),
    );
    for (const value of maneuver?.values ?? []) {
      const { root, input } = slider(value, system.maneuverValues[value.id] ?? value.value, () => {}, (now) => {
        // Several key presses in quick succession count as one change.
        clearTimeout(this.#timer);
        this.#timer = window.setTimeout(() => change({ maneuverValues: { ...system.maneuverValues, [value.id]: now } }), 350);
      });
      input.dataset["key"] = `value ${value.id}`;
      this.quick.append(root);
    }
    parts.push(
      this.#select("Road", "road", catalog.roads.map(({ id, title }) => ({ value: id, title })), system.road, (road) => change({ road })),
      this.#seed(system.seed, (seed) => change({ seed })),
    );
    this.#body.replaceChildren(...parts);
  }

  #controllers(vehicle: Vehicle, system: FreeSystem, change: (part: Partial<FreeSystem>) => void): HTMLElement {
    const entry = (controller: Controller) =>
      this.#controller(controller, new Choice(vehicle, system.controllers), (isOn) => {
        const next = new Choice(vehicle, system.controllers);
        if (isOn) next.add(controller.fmu);
        else next.remove(controller.fmu);
        this.#tellOthers(controller.fmu, system.controllers, next.names);
        change({ controllers: next.names });
      });
    const isMain = ({ fmu }: Controller) => vehicle.defaults.includes(fmu) || system.controllers.includes(fmu);
    const others = vehicle.controllers.filter((controller) => !isMain(controller));
    const list = element("ul", { className: "controllers" }, ...vehicle.controllers.filter(isMain).map(entry));
    const otherList = element("ul", { className: "controllers" }, ...others.map(entry));
    const ontoggle = () => (this.#showsMore = more.open);
    const more = element("details", { open: this.#showsMore, hidden: others.length === 0, ontoggle }, element("summary", {}, `Other controllers that fit: ${others.length}`), otherList);
    const set = (title: string, key: string, controllers: string[]) => {
      const result = button(title, () => change({ controllers }));
      result.dataset["key"] = key;
      return result;
    };
    const buttons = element("div", { className: "row" }, set("As in the paper", "defaults", [...vehicle.defaults]), set("None", "none", []));
    const parts = vehicle.controllers.length === 0 ? [note("No controller of the library fits this vehicle by its signals.")] : [list, more, buttons];
    return element("fieldset", {}, element("legend", {}, "Controllers"), ...parts);
  }

  /** Reports the other controllers that a change has added or removed. */
  #tellOthers(name: string, before: string[], after: string[]): void {
    const added = after.filter((other) => other !== name && !before.includes(other));
    const removed = before.filter((other) => other !== name && !after.includes(other));
    if (added.length > 0) this.model.say("info", `${added.join(", ")} also added: ${name} needs its outputs.`);
    if (removed.length > 0) {
      const why = after.includes(name) ? `${name} writes the same signals.` : `it needs the outputs of ${name}.`;
      this.model.say("info", `${removed.join(", ")} also removed: ${why}`);
    }
  }

  #controller({ fmu, title }: Controller, chosen: Choice, change: (isOn: boolean) => void): HTMLElement {
    const isOn = chosen.has(fmu);
    const box = element("input", { type: "checkbox", checked: isOn, "data-key": `controller ${fmu}`, onchange: () => change(box.checked) });
    const notes = [(summary(fmu) || title).replace(/\.?$/, ".")];
    if (!isOn && chosen.missing(fmu).length > 0) notes.push(`Adds ${chosen.missing(fmu).join(", ")}.`);
    if (!isOn && chosen.replaced(fmu).length > 0) notes.push(`Replaces ${chosen.replaced(fmu).join(", ")}.`);
    return element("li", {}, element("label", { className: "check" }, box, element("span", {}, element("b", {}, fmu), element("small", {}, notes.join(" ")))));
  }

  #showScenario(system: ScenarioSystem): void {
    const catalog = this.model.catalog!;
    const scenario = catalog.scenarios.find(({ id }) => id === system.scenario);
    const change = (part: Partial<ScenarioSystem>) => void this.#run({ ...system, ...part });
    const cases = (scenario?.cases ?? []).map(({ id, title }) => ({ value: id, title: title === "" ? id : title }));
    const parts = [
      this.#select("Scenario", "scenario", catalog.scenarios.map(({ id, title, vehicle }) => ({ value: id, title, group: vehicle })), system.scenario, (id) => this.#openScenario(id)),
      this.#select("Case", "case", cases, system.case, (id) => change({ case: id })),
      this.#select("Case beside it", "twin", [{ value: "", title: "None" }, ...cases], system.twin ?? "", (id) => change({ twin: id === "" ? null : id })),
    ];
    const seeds = scenario?.seeds ?? [];
    if (seeds.length > 1) parts.push(this.#select("Seed of random numbers", "seed", seeds.map((seed) => ({ value: String(seed), title: String(seed) })), String(system.seed), (seed) => change({ seed: Number(seed) })));
    this.#body.replaceChildren(...parts);
  }
}
