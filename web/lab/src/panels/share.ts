/** Link, files, and FMUs from the visitor. */

import { button, element } from "../../../src/dom";
import { Choice } from "../choice";
import { byId, download } from "../dom";
import { encode } from "../link";
import type { Model } from "../model";
import type { FreeSystem } from "../protocol";
import { isOurs, summary } from "../library";

export class SharePanel {
  readonly #link = element("input", { type: "text", readOnly: true, className: "link", "aria-label": "Link to this setup", onfocus: () => this.#link.select() });
  readonly #twin = button("CSV of the twin", () => void this.#save("csv", 1));
  #timer = 0;

  constructor(
    readonly model: Model,
    root: HTMLElement,
  ) {
    const onchange = () => {
      const chosen = file.files?.[0];
      file.value = "";
      if (chosen !== undefined) void this.#take(chosen);
    };
    const file = element("input", { type: "file", accept: ".fmu", id: "fmu-file", onchange });
    root.append(
      element("div", { className: "row" }, button("Copy link", () => void this.#copy()), button("CSV", () => void this.#save("csv", 0)), this.#twin, button("SSP", () => void this.#save("ssp", 0))),
      this.#link,
      element("label", { className: "field", htmlFor: "fmu-file" }, element("span", { textContent: "Your FMU with a WebAssembly binary (or drop it anywhere)" }), file),
    );
    model.on("opened", () => this.#update());
    model.on("value", () => this.#update());
    this.#acceptDrops();
  }

  #update(): void {
    const setup = this.model.currentSetup();
    if (setup === null) return;
    this.#link.value = location.href.replace(/#.*$/, "") + encode(setup);
    this.#twin.hidden = (this.model.opened?.systems.length ?? 0) < 2;
    // Browsers limit how often the address can change.
    clearTimeout(this.#timer);
    this.#timer = window.setTimeout(() => history.replaceState(null, "", encode(setup)), 400);
  }

  async #copy(): Promise<void> {
    try {
      await navigator.clipboard.writeText(this.#link.value);
      this.model.say("info", "The link has been copied. It contains the setup, not the run.");
    } catch {
      // Without permission for the clipboard, the page selects the link.
      this.#link.focus();
      this.model.say("info", "The browser did not allow copying. The link is selected: copy it from the field.");
    }
    const { system } = this.model.setup!;
    const foreign = system.kind === "free" ? [system.vehicle, ...system.controllers].filter((name) => !isOurs(name)) : [];
    if (foreign.length > 0) this.model.say("info", `Whoever opens the link must drop ${foreign.join(", ")} first: the link does not contain FMUs.`);
  }

  async #save(kind: "csv" | "ssp", system: number): Promise<void> {
    try {
      const { name, bytes } = await this.model.file(kind, system);
      download(kind === "csv" ? `${this.model.runOf(system)}.csv` : name, bytes);
    } catch (error) {
      this.model.report(error);
    }
  }

  #acceptDrops(): void {
    const hint = byId("drop-hint");
    const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    window.addEventListener("dragover", (event) => {
      if (!hasFiles(event)) return;
      event.preventDefault();
      hint.hidden = false;
    });
    window.addEventListener("dragleave", (event) => {
      if (event.relatedTarget === null) hint.hidden = true;
    });
    window.addEventListener("drop", (event) => {
      hint.hidden = true;
      if (!hasFiles(event)) return;
      event.preventDefault();
      const file = event.dataTransfer?.files[0];
      if (file !== undefined) void this.#take(file);
    });
  }

  /** Adds an FMU to the system: as a controller if it fits, otherwise as a vehicle. */
  async #take(file: File): Promise<void> {
    try {
      const name = await this.model.drop(file.name, new Uint8Array(await file.arrayBuffer()));
      const awaited = this.model.takeAwaited();
      if (awaited !== null) {
        if (await this.model.open(awaited)) {
          this.model.say("info", `${name} was added: this is the system of the link.`);
          void this.model.play();
        }
        return;
      }
      const system = this.#with(name);
      if (system === null) {
        const where = this.model.setup?.system.kind === "free" ? this.model.setup.system.vehicle : "this system";
        this.model.say("error", `${name} does not fit ${where}: none of its signals is an input or output of the system.`, "Choose another vehicle. The FMU is listed for the vehicles that it fits.");
        return;
      }
      if (await this.model.open({ system, values: {} })) {
        this.model.say("info", `${name} is part of the system.`, summary(name));
        void this.model.play();
      }
    } catch (error) {
      this.model.report(error);
    }
  }

  #with(name: string): FreeSystem | null {
    const { catalog, setup } = this.model;
    const current = setup?.system.kind === "free" ? setup.system : null;
    const vehicles = catalog?.vehicles ?? [];
    const fits = vehicles.filter(({ controllers }) => controllers.some(({ fmu }) => fmu === name));
    const own = vehicles.find(({ fmu }) => fmu === name);
    const vehicle = fits.find(({ fmu }) => fmu === current?.vehicle) ?? own ?? fits[0];
    if (vehicle === undefined) return null;
    const fresh = this.model.defaultSetup(vehicle).system as FreeSystem;
    if (vehicle === own) return fresh;
    const base = current?.vehicle === vehicle.fmu ? current : fresh;
    const choice = new Choice(vehicle, base.controllers);
    choice.add(name);
    return { ...base, controllers: choice.names };
  }
}
