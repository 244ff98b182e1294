/** Choice of controllers: adding a controller adds the controllers that it depends on, and removes those that write the same signals. */

import type { Controller, Vehicle } from "./protocol";

/** The chosen controllers of a vehicle, which are always consistent. */
export class Choice {
  readonly #chosen: Set<string>;

  constructor(
    readonly vehicle: Vehicle,
    chosen: string[],
  ) {
    this.#chosen = new Set(chosen);
  }

  get names(): string[] {
    return [...this.#chosen];
  }

  has(name: string): boolean {
    return this.#chosen.has(name);
  }

  #of(name: string): Controller | undefined {
    return this.vehicle.controllers.find(({ fmu }) => fmu === name);
  }

  #excludes(one: string, other: string): boolean {
    return (this.#of(one)?.excludes.includes(other) ?? false) || (this.#of(other)?.excludes.includes(one) ?? false);
  }

  /**
   * The controllers that a controller needs and that are not chosen yet. Two controllers that exclude each other are alternatives, because they write
   * the same signal: one of them is enough, and the vehicle's defaults have priority.
   */
  missing(name: string): string[] {
    const needs = (this.#of(name)?.needs ?? []).filter((need) => !this.#excludes(name, need));
    const rank = (need: string) => (this.#chosen.has(need) ? 0 : this.vehicle.defaults.includes(need) ? 1 : 2);
    const taken: string[] = [];
    for (const need of [...needs].sort((a, b) => rank(a) - rank(b))) {
      if (!taken.some((other) => this.#excludes(need, other))) taken.push(need);
    }
    return taken.filter((need) => !this.#chosen.has(need));
  }

  /** The chosen controllers that a controller would replace. */
  replaced(name: string): string[] {
    return this.names.filter((other) => other !== name && this.#excludes(name, other));
  }

  add(name: string): void {
    this.#include(name);
    this.#dropIncomplete();
  }

  #include(name: string): void {
    if (this.#chosen.has(name)) return;
    for (const other of this.replaced(name)) this.#chosen.delete(other);
    this.#chosen.add(name);
    for (const need of this.missing(name)) this.#include(need);
  }

  remove(name: string): void {
    this.#chosen.delete(name);
    this.#dropIncomplete();
  }

  /** Removes controllers whose needs are no longer met. */
  #dropIncomplete(): void {
    for (;;) {
      const incomplete = this.names.find((name) => this.missing(name).length > 0);
      if (incomplete === undefined) return;
      this.#chosen.delete(incomplete);
    }
  }
}
