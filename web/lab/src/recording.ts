/** The recorded rows of a running system, for going back in time and comparing branches. */

import type { SystemInfo, Vehicle } from "./protocol";

/** A wheel whose rotation angle is integrated from its speed, because no signal contains it. */
interface Spin {
  /** Column of the wheel speed, and the factor from its unit to rad/s. The column is -1 if the wheel does not turn. */
  column: number;
  factor: number;
}

/** Rows per block. Memory grows by blocks, so existing rows are not copied. */
const BLOCK = 2048;

/** The rows of a branch, at multiples of `rowStep`. */
class Track {
  readonly #blocks: Float32Array[] = [];
  count = 0;

  constructor(
    readonly width: number,
    readonly first: number,
    readonly parent: Track | null,
  ) {}

  get end(): number {
    return this.first + this.count;
  }

  value(index: number, column: number): number {
    if (index < this.first) return this.parent?.value(index, column) ?? NaN;
    if (index >= this.end) return NaN;
    const row = index - this.first;
    return this.#blocks[Math.floor(row / BLOCK)]![(row % BLOCK) * this.width + column]!;
  }

  /** Returns the memory of a row for writing; skipped rows are NaN. */
  row(index: number): Float32Array {
    for (;;) {
      const last = Math.min(index - this.first, this.count);
      const block = Math.floor(last / BLOCK);
      this.#blocks[block] ??= new Float32Array(BLOCK * this.width).fill(NaN);
      if (last === index - this.first) {
        this.count = Math.max(this.count, last + 1);
        return this.#blocks[block]!.subarray((last % BLOCK) * this.width, ((last % BLOCK) + 1) * this.width);
      }
      this.count += 1;
    }
  }
}

export class Recording {
  readonly #tracks = new Map<number, Track>();
  readonly #columns = new Map<string, number>();
  readonly #spins: Spin[];
  readonly #width: number;

  constructor(
    readonly info: SystemInfo,
    readonly rowStep: number,
    wheels: { place: string; radius: number }[],
  ) {
    info.columns.forEach(({ name }, i) => this.#columns.set(name, i));
    // If two components have a signal, its plain name refers to the vehicle's signal, otherwise to the first one.
    const owner = info.components.find(({ fmu }) => fmu === info.vehicle)?.name;
    info.columns.forEach(({ name }, i) => {
      const [component, signal] = name.includes(":") ? name.split(":") : [null, name];
      if (signal !== undefined && (component === owner || !this.#columns.has(signal))) this.#columns.set(signal, i);
    });
    const speed = this.column("vehicle.speed", "driver.speed");
    this.#spins = wheels.map(({ place, radius }) => {
      const own = this.column(`wheel_speed.${place}`);
      return own >= 0 ? { column: own, factor: 1 } : { column: speed, factor: 1 / radius };
    });
    this.#width = info.columns.length + wheels.length;
  }

  /** The column of the first of these signals that exists; -1 if none of them exists. */
  column(...names: string[]): number {
    for (const name of names) {
      const found = this.#columns.get(name);
      if (found !== undefined) return found;
    }
    return -1;
  }

  /** The column with the angle of a wheel, rad. */
  spinColumn(wheel: number): number {
    return this.info.columns.length + wheel;
  }

  /** Begins a branch at a time of its parent branch. */
  branch(branch: number, parent: number, from: number): void {
    // The row at this time still belongs to the parent.
    this.#tracks.set(branch, new Track(this.#width, Math.round(from / this.rowStep) + 1, this.#tracks.get(parent) ?? null));
  }

  append(branch: number, count: number, rows: Float64Array): void {
    const columns = this.info.columns.length;
    for (let row = 0; row < count; row++) {
      const at = row * (columns + 1);
      const index = Math.round(rows[at]! / this.rowStep);
      let track = this.#tracks.get(branch);
      if (track === undefined) this.#tracks.set(branch, (track = new Track(this.#width, index, null)));
      if (index < track.first) continue;
      const place = track.row(index);
      place.set(rows.subarray(at + 1, at + 1 + columns));
      this.#spins.forEach(({ column, factor }, wheel) => {
        const angle = track.value(index - 1, columns + wheel);
        const rate = column < 0 ? 0 : factor * rows[at + 1 + column]!;
        place[columns + wheel] = Number.isNaN(angle) ? 0 : angle + rate * this.rowStep;
      });
    }
  }

  /** Time of the last row of a branch, s; 0 if the branch has no row. */
  end(branch: number): number {
    const track = this.#tracks.get(branch);
    if (track === undefined) return 0;
    return Math.max(0, (track.count > 0 ? track.end : track.first) - 1) * this.rowStep;
  }

  /** Returns the interpolated value at a time; after the end, the last value. */
  at(branch: number, column: number, time: number): number {
    const track = this.#tracks.get(branch);
    if (track === undefined || column < 0) return NaN;
    const grid = Math.max(0, Math.min(time, this.end(branch)) / this.rowStep);
    const index = Math.floor(grid + 1e-6);
    const share = grid - index;
    const value = this.#valueOf(track, index, column);
    return share < 1e-6 ? value : value + share * (this.#valueOf(track, index + 1, column) - value);
  }

  #valueOf(track: Track, index: number, column: number): number {
    // A branch without rows uses the rows of its parent.
    return track.count === 0 && track.parent !== null ? track.parent.value(index, column) : track.value(index, column);
  }

  /** Returns every `stride`-th value between two row indices; `null` for missing values. */
  values(branch: number, column: number, first: number, last: number, stride: number, factor: number): (number | null)[] {
    const track = this.#tracks.get(branch);
    const result: (number | null)[] = [];
    for (let index = first; index <= last; index += stride) {
      const value = track === undefined || column < 0 ? NaN : track.value(index, column);
      result.push(Number.isNaN(value) ? null : value * factor);
    }
    return result;
  }
}

/** Names of the wheels of a vehicle, by their signals. */
export function wheelPlaces(vehicle: Vehicle): string[] {
  const has = (name: string) => vehicle.outputs.includes(name);
  const all = ["fl", "fr", "ml", "mr", "rl", "rr"];
  const found = all.filter((place) => ["wheel_height", "tire_load", "wheel_speed", "tire_lateral_force"].some((group) => has(`${group}.${place}`)));
  if (found.length > 0) return found;
  return vehicle.outputs.includes("vehicle.yaw") ? ["fl", "fr", "rl", "rr"] : [];
}
