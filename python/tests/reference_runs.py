"""Independent implementation of Driver, PathDriver, Road, Sensor, Actuator and SuspensionMixer, for reference data.

It was written from the README files and not from the Rust code, even for the random numbers. numpy computes whole
signals at once; the all-pass is integrated by a series, the cosines are summed one by one, and ChaCha8 follows its
definition (Bernstein, "ChaCha, a variant of Salsa20", 2008; as in RFC 8439, but with 8 rounds, and 64 bits each for the
counter and the stream).

    .venv/bin/python python/tests/reference_runs.py

writes `tests/references/sources` and the `reference.csv` of the six packages; test_reference_data.py compares them with
the results of a new run.
"""

from __future__ import annotations

import gzip
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.floating[Any]]
Words: TypeAlias = NDArray[np.uint32]
Signals: TypeAlias = dict[str, Array]

# Sample time and communication step, s.
STEP = 0.001

# Outputs are written in every THINNED-th row.
THINNED = 7

# Input columns of the files, which follow the column of the time.
INPUTS = (
    "vehicle.position_x",
    "vehicle.position_y",
    "vehicle.yaw",
    "vehicle.speed",
    "sensor.true_value",
    "actuator.command",
)

# Significant digits in the files; the relative rounding error is up to 5e-10.
DIGITS = 10


# Random numbers -----------------------------------------------------------------------------------------------------


def chacha8(seed: int, stream: int, blocks: int) -> Words:
    """Return the words of the first blocks. The first 8 bytes of the key are the seed, the others are zero."""
    low, high = 0xFFFF_FFFF, 32
    state = np.zeros((16, blocks), dtype=np.uint32)
    for place, word in enumerate((0x61707865, 0x3320646E, 0x79622D32, 0x6B206574, seed & low, seed >> high)):
        state[place] = word
    state[12] = np.arange(blocks)
    state[14], state[15] = stream & low, stream >> high
    x = state.copy()

    def rotate(value: Words, bits: int) -> Words:
        return (value << np.uint32(bits)) | (value >> np.uint32(32 - bits))

    def quarter(a: int, b: int, c: int, d: int) -> None:
        for first, second, third, bits in ((a, b, d, 16), (c, d, b, 12), (a, b, d, 8), (c, d, b, 7)):
            x[first] += x[second]
            x[third] = rotate(x[third] ^ x[first], bits)

    columns = [(0, 4, 8, 12), (1, 5, 9, 13), (2, 6, 10, 14), (3, 7, 11, 15)]
    diagonals = [(0, 5, 10, 15), (1, 6, 11, 12), (2, 7, 8, 13), (3, 4, 9, 14)]
    for _ in range(4):
        for places in columns + diagonals:
            quarter(*places)
    words: Words = (x + state).T.reshape(-1)
    return words


def normals(seed: int, stream: int, count: int) -> Array:
    """Return standard normal numbers (Box-Muller), each from four words: the upper 53 bits of two integers."""
    words = chacha8(seed, stream, -(-count // 4)).astype(np.uint64).reshape(-1, 2)
    whole = ((words[:, 0] | (words[:, 1] << np.uint64(32))) >> np.uint64(11)).astype(np.float64)
    radius, angle = (whole[0::2] + 1.0) / 2.0**53, whole[1::2] / 2.0**53
    result: Array = np.sqrt(-2.0 * np.log(radius)) * np.cos(2.0 * np.pi * angle)
    return result[:count]


def split_mix(seed: int, count: int) -> Array:
    """Return the upper 53 bits of the first numbers of SplitMix64, as fractions."""
    mask = 2**64 - 1
    result = []
    for k in range(1, count + 1):
        z = (seed + k * 0x9E3779B97F4A7C15) & mask
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        result.append(((z ^ (z >> 31)) >> 11) / 2.0**53)
    return np.array(result)


# Driver -------------------------------------------------------------------------------------------------------------


def ramp(t: Array, start: float, rise_time: float) -> Array:
    """Return clamp((t - start)/rise_time, 0, 1); for a rise time of 0, a step that is 1 from `start` on."""
    if rise_time == 0.0:
        return np.where(t > start - 1e-9, 1.0, 0.0)
    return np.clip((t - start) / rise_time, 0.0, 1.0)


def periods(phase: Array, end: float = math.inf) -> Array:
    """Return sin(2 pi phase) for phases from 0 to `end`, otherwise 0."""
    return np.where((phase >= 0.0) & (phase < end), np.sin(2.0 * np.pi * phase), 0.0)


def sweep(t: Array, first: float, last: float, duration: float) -> Array:
    """Return a sine whose frequency rises from first to last, up to the first zero crossing after the duration."""
    running = np.maximum(t, 0.0)
    rising = np.minimum(running, duration)
    phase = (first + (last - first) * rising / (2.0 * duration)) * rising + last * (running - rising)
    half_periods = math.ceil(2.0 * ((first + last) / 2.0 * duration) - 1e-6)
    return np.where(t >= 0.0, periods(phase, half_periods / 2.0), 0.0)


def covered(t: Array, speed: Callable[[Array], Array], start: float) -> Array:
    """Return the distance covered since the start, by the trapezoidal rule on a fine grid (exact for ramps)."""
    grid = np.arange(round(t[-1] / 1e-4) + 1) * 1e-4
    v = speed(grid)
    distance = np.concatenate([[0.0], np.cumsum((v[1:] + v[:-1]) / 2.0 * 1e-4)])
    distance -= distance[round(start / 1e-4)]
    result: Array = distance[np.rint(t / 1e-4).astype(int)]
    return result


def driver(seconds: float, steer: Callable[[Array], Array], **others: Callable[[Array], Array]) -> Signals:
    """Return the driver's four demands; by default they follow from the start values of the parameters."""
    t = np.arange(round(seconds / STEP)) * STEP
    zero = np.zeros_like(t)
    result = {"time": t, "driver.steer": steer(t), "driver.speed": zero + 60.0 / 3.6}
    result |= {"driver.throttle": zero, "driver.brake": zero}
    return result | {f"driver.{name}": function(t) for name, function in others.items()}


def rising_speed(t: Array) -> Array:
    """Return the speed of the slalom: from 8 m/s to 24 m/s between 2 s and 7 s."""
    return 8.0 + 16.0 * ramp(t, 2.0, 5.0)


# The columns of the table for `driver_table`.
DEMANDS = {
    "time": [0.5, 1.0, 1.25, 3.0],
    "driver.steer": [0.0, 0.1, -0.05, 0.02],
    "driver.throttle": [0.2, 0.7, 0.7, 0.0],
    "driver.brake": [0.0, 0.0, 0.5, 1.0],
}


def demand(name: str) -> Callable[[Array], Array]:
    """Return a column of the table as a function of time."""
    return lambda t: np.interp(t, DEMANDS["time"], DEMANDS[name])


def dwelling(t: Array) -> Array:
    """Return a sine of 0.08 rad and 0.8 Hz from 1 s on, held for 0.45 s after three quarters of its period."""
    running = t - 1.0
    peak = 0.75 / 0.8
    played = np.where(running < peak, running, np.maximum(running - 0.45, peak))
    return 0.08 * periods(0.8 * played, 1.0)


DRIVER: dict[str, Callable[[], Signals]] = {
    "driver_straight": lambda: driver(
        6.0,
        np.zeros_like,
        speed=lambda t: 20.0 - 12.0 * ramp(t, 1.0, 3.0),
        throttle=lambda t: 0.6 * ramp(t, 0.5, 0.25),
        brake=lambda t: 0.9 * ramp(t, 4.0, 0.0),
    ),
    "driver_ramp_step": lambda: driver(3.0, lambda t: 0.1 * ramp(t, 1.0, 0.2)),
    "driver_fishhook": lambda: driver(6.0, lambda t: 0.12 * ramp(t, 1.0, 0.4) - 0.2 * ramp(t, 3.0, 0.5)),
    "driver_double_lane_change": lambda: driver(
        8.0, lambda t: 0.064 * (periods((t - 0.5) / 3.0, 1.0) - periods((t - 4.0) / 3.0, 1.0))
    ),
    "driver_slalom": lambda: driver(8.0, lambda t: 0.1 * periods((t - 1.0) / 1.6, 3.0)),
    "driver_slalom_cones": lambda: driver(
        9.0, lambda t: 0.1 * periods(covered(t, rising_speed, 1.0) / 36.0), speed=rising_speed
    ),
    "driver_sine_with_dwell": lambda: driver(4.0, dwelling),
    "driver_sine_sweep": lambda: driver(9.0, lambda t: 0.1 * sweep(t - 2.0, 0.3, 3.1, 6.0)),
    "driver_table": lambda: driver(
        4.0, demand("driver.steer"), throttle=demand("driver.throttle"), brake=demand("driver.brake")
    ),
}


# Road ---------------------------------------------------------------------------------------------------------------

# First grid point of shaped noise, relative to the front axle at the start: the random numbers begin 1022 cells behind
# the axle.
FIRST = -1022

# Distance of the axles behind the front axle, m.
OFFSETS = {"f": 0.0, "m": 2.95, "r": 4.6}
NO_OFFSETS = {"f": 0.0, "m": 0.0, "r": 0.0}

# Distance by which the right track of the road lags behind the left track if it is a delayed copy, m.
TRACK = 1.56


def deviation(coefficient: float, cutoff: float) -> float:
    """Return the standard deviation of stationary shaped noise, m."""
    return math.sqrt(math.pi * 0.1**2 * coefficient / (2.0 * cutoff))


def shaped(seed: int, stream: int, coefficient: Array, cutoff: float, spacing: float, last_zero: float | None) -> Array:
    """Return the height at every grid point; `coefficient` has a value for each grid point."""
    numbers = normals(seed, stream, len(coefficient))
    alpha = math.exp(-2.0 * math.pi * cutoff * spacing)
    z = np.zeros(len(coefficient))
    for k, number in enumerate(numbers):
        sigma = deviation(coefficient[k], cutoff)
        if last_zero is not None and FIRST + k <= last_zero:
            continue
        z[k] = sigma * number if k == 0 else alpha * z[k - 1] + sigma * math.sqrt(1.0 - alpha**2) * number
    return z


def all_pass(z: Array, place: Array, length: float) -> Array:
    """Return the output of the all-pass at the given places, for an input that is linear between them.

    With the linear input, the state [X1, X2, z, slope] obeys a linear equation with constant coefficients. Its solution
    over a cell is a matrix exponential, computed from its series.
    """
    a = np.zeros((4, 4))
    a[0] = [0.0, 1.0, -12.0 / length, 0.0]
    a[1] = [-12.0 / length**2, -6.0 / length, 72.0 / length**2, 0.0]
    a[2, 3] = 1.0
    state = np.array([0.0, 12.0 * z[0] / length, z[0], 0.0])
    output = [z[0]]
    propagators: dict[float, Array] = {}
    for k in range(1, len(z)):
        step = float(place[k] - place[k - 1])
        key = round(step, 12)
        if key not in propagators:
            halvings = 10
            term, total = np.eye(4), np.eye(4)
            for order in range(1, 25):
                term = term @ (a * step / 2**halvings) / order
                total = total + term
            for _ in range(halvings):
                total = total @ total
            propagators[key] = total
        state[2:] = z[k - 1], (z[k] - z[k - 1]) / step
        state = propagators[key] @ state
        output.append(state[0] + z[k])
    return np.array(output)


def mixed(first: Array, second: Array, rho: float) -> tuple[Array, Array]:
    """Return two tracks with the correlation rho, mixed from two independent tracks."""
    common, opposite = math.sqrt((1.0 + rho) / 2.0) * first, math.sqrt((1.0 - rho) / 2.0) * second
    return common + opposite, common - opposite


def cosines(x: Array, coefficient: float, seed: int, delay: float = 0.0) -> Array:
    """Return the sum of 800 cosines, each delayed by the all-pass, faded in over 20 m."""
    spacing = (2.83 - 0.011) / 800
    total = np.zeros_like(x)
    for k, fraction in enumerate(split_mix(seed, 800)):
        n = 0.011 + (k + 0.5) * spacing
        w = 2.0 * math.pi * n * delay
        lag = 2.0 * math.atan2(w / 2.0, 1.0 - w**2 / 12.0)
        phase = 2.0 * math.pi * fraction - lag
        total += math.sqrt(2.0 * coefficient * (n / 0.1) ** -2 * spacing) * np.cos(2.0 * math.pi * n * x + phase)
    window = np.where(x <= 0.0, 0.0, np.where(x < 20.0, (1.0 - np.cos(np.pi * x / 20.0)) / 2.0, 1.0))
    return window * total


class Ride:
    """A drive over a road: speed and distance at every sample, and the outputs."""

    def __init__(self, seconds: float, speed: Callable[[Array], Array], offsets: Mapping[str, float] = OFFSETS) -> None:
        self.offsets = offsets
        self.time = np.arange(round(seconds / STEP)) * STEP
        # Rounded as in the file.
        self.speed = np.array([float(f"{v:.{DIGITS}g}") for v in speed(self.time)])
        self.distance = np.concatenate([[0.0], np.cumsum(self.speed[:-1] * STEP)])

    def outputs(
        self,
        track: Callable[[Array], tuple[Array, Array]],
        obstacle: Callable[[Array], tuple[Array, Array]] | None = None,
        friction: Callable[[Array], tuple[Array, Array]] | None = None,
    ) -> Signals:
        """Return all signals; tracks and friction are functions of distance, left and right."""
        result = {"time": self.time, "vehicle.speed": self.speed}
        heights: Signals = {}
        frictions: Signals = {}
        for axle, offset in self.offsets.items():
            place = self.distance - offset
            left, right = track(place)
            if obstacle is not None:
                more = obstacle(place)
                left, right = left + more[0], right + more[1]
            one = np.ones_like(place)
            mu = friction(place) if friction is not None else (one, one)
            heights |= {f"road_height.{axle}l": left, f"road_height.{axle}r": right}
            frictions |= {f"road_friction.{axle}l": mu[0], f"road_friction.{axle}r": mu[1]}
            if axle == "f":
                sides = {"road_height.l": left, "road_height.r": right}
                sides |= {"road_friction.l": mu[0], "road_friction.r": mu[1]}
        return result | heights | frictions | sides | {"road.distance": self.distance}

    def points(self, spacing: float) -> int:
        """Return the number of grid points up to the far end of the last cell."""
        return math.floor(float(self.distance.max()) / spacing + 1e-6) + 2 - FIRST

    def on_grid(self, spacing: float, left: Array, right: Array) -> Callable[[Array], tuple[Array, Array]]:
        """Return tracks that are linear between grid points."""
        grid = np.arange(len(left)) + float(FIRST)
        return lambda x: (np.interp(x / spacing, grid, left), np.interp(x / spacing, grid, right))


def constant(coefficient: float, count: int) -> Array:
    return np.full(count, coefficient)


def default() -> Signals:
    """Return the road with the start values of its parameters, at a varying speed with a standstill."""
    ride = Ride(6.0, lambda t: np.maximum(0.0, 15.0 * np.cos(1.3 * t)), NO_OFFSETS)
    count = ride.points(0.01)
    tracks = [shaped(1, stream, constant(256e-6, count), 0.011, 0.01, None) for stream in (0, 1)]
    return ride.outputs(ride.on_grid(0.01, *tracks))


def from_front_axle() -> Signals:
    """Return mixed tracks that start at the front axle: class B, and class F from 1.5 s on. The vehicle reverses."""
    ride = Ride(2.6, lambda t: 12.0 * np.cos(0.9 * t))
    spacing = 0.02
    count = ride.points(spacing)
    reached = ride.distance[: round(1.5 / STEP) + 1].max()
    point = np.arange(count) + FIRST
    coefficient = np.where(point <= math.floor(reached / spacing + 1e-6) + 1, 64e-6, 16384e-6)
    tracks = [shaped(7, stream, coefficient, 0.02, spacing, 0.0) for stream in (0, 1)]
    return ride.outputs(ride.on_grid(spacing, *mixed(tracks[0], tracks[1], 0.6)))


def from_rear_axle() -> Signals:
    ride = Ride(3.0, lambda t: 20.0 + 0.0 * t)
    count = ride.points(0.01)
    left = shaped(3, 0, constant(100e-6, count), 0.0006, 0.01, -math.floor(4.6 / 0.01))
    right = all_pass(left, np.arange(count) * 0.01, TRACK)
    return ride.outputs(ride.on_grid(0.01, left, right))


def harmonic(pair: str) -> Callable[[], Signals]:
    """Return roads of 800 cosines of class B."""

    def run() -> Signals:
        ride = Ride(4.0, lambda t: 16.0 + 4.0 * t)

        def track(x: Array) -> tuple[Array, Array]:
            left = cosines(x, 64e-6, 2)
            if pair == "delayed":
                return left, cosines(x, 64e-6, 2, TRACK)
            return mixed(left, cosines(x, 64e-6, 2 + 1_000_003), 0.995)

        return ride.outputs(track)

    return run


# The columns of the table for `road_table`.
HEIGHTS = {
    "distance": [-3.0, 0.0, 2.5, 4.0, 4.75, 20.0, 41.0],
    "height_left": [0.01, 0.0, 0.05, -0.02, -0.02, 0.03, 0.0],
    "height_right": [0.0, 0.02, 0.02, 0.01, 0.04, -0.03, -0.01],
}


def table() -> Signals:
    ride = Ride(3.0, lambda t: 10.0 + 5.0 * t)
    rows, heights = np.array(HEIGHTS["distance"]), np.array(HEIGHTS["height_left"])

    def track(x: Array) -> tuple[Array, Array]:
        left = np.interp(x, rows, heights)
        # The all-pass needs the rows of the table and the places of the samples.
        places = np.unique(np.concatenate([rows, x[x > rows[0]]]))
        response = all_pass(np.interp(places, rows, heights), places, TRACK)
        return left, np.where(x <= rows[0], left, np.interp(x, places, response))

    return ride.outputs(track)


def bump_and_friction() -> Signals:
    """Return a bump by distance on a flat road, with split friction that is lower from 21 m on."""
    ride = Ride(3.0, lambda t: 15.0 + 0.0 * t)

    def obstacle(x: Array) -> tuple[Array, Array]:
        inside = (x > 10.0) & (x < 14.5)
        shape = np.where(inside, (1.0 - np.cos(2.0 * np.pi * (x - 10.0) / 4.5)) / 2.0, 0.0)
        return 0.04 * shape, -0.02 * shape

    def friction(x: Array) -> tuple[Array, Array]:
        return np.where(x >= 21.005, 0.5, 0.9), np.where(x >= 21.005, 0.2, 0.3)

    return ride.outputs(lambda x: (np.zeros_like(x), np.zeros_like(x)), obstacle, friction)


def trapezoid_in_time() -> Signals:
    """Return a trapezoid from 1 s to 1.6 s under all axles."""
    ride = Ride(2.5, lambda t: 15.0 + 0.0 * t)
    shape = np.interp(ride.time, [1.0, 1.15, 1.45, 1.6], [0.0, 1.0, 1.0, 0.0])
    flat = (np.zeros_like(shape), np.zeros_like(shape))
    return ride.outputs(lambda _: flat, lambda _: (0.03 * shape, 0.05 * shape))


ROAD: dict[str, Callable[[], Signals]] = {
    "road_default": default,
    "road_from_front_axle": from_front_axle,
    "road_from_rear_axle": from_rear_axle,
    "road_harmonics_mixed": harmonic("mixed"),
    "road_harmonics_delayed": harmonic("delayed"),
    "road_table": table,
    "road_bump_and_friction": bump_and_friction,
    "road_trapezoid_in_time": trapezoid_in_time,
}

# Sensor -------------------------------------------------------------------------------------------------------------


def signal(t: Array) -> Array:
    """Return the signal for sensor and actuator: two sines and three steps."""
    steps = 1.5 * (t >= 0.4) - 2.5 * (t >= 0.9) + 1.2 * (t >= 1.5)
    result: Array = 0.6 * np.sin(9.0 * t) + 0.1 * np.sin(70.0 * t) + steps
    return result


def as_printed(values: Array) -> Array:
    """Return the values as they are rounded in the file."""
    return np.array([float(f"{v:.{DIGITS}g}") for v in values])


def sensor(delay: int, bias: float, noise: float, seed: int, resolution: float) -> Signals:
    """Return the signal and its measured value: delay in samples, bias, noise, resolution."""
    t = np.arange(2000) * STEP
    u = as_printed(signal(t))
    y = u[np.maximum(np.arange(len(t)) - delay, 0)] + bias + noise * normals(seed, 2, len(t))
    if resolution > 0.0:
        # Rounds to the nearest multiple; halves away from zero.
        y = np.copysign(np.floor(np.abs(y) / resolution + 0.5) * resolution, y)
    return {"time": t, "sensor.true_value": u, "sensor.measured_value": y}


def sensor_imperfect() -> Signals:
    """Return a sensor with a delay of 25 ms, a bias of 0.03, noise of 0.08 and a resolution of 0.02."""
    return sensor(25, 0.03, 0.08, 11, 0.02)


def sensor_noisy() -> Signals:
    """Return a sensor with the longest delay, and noise only."""
    return sensor(1000, 0.0, 0.5, 3, 0.0)


def sensor_default() -> Signals:
    return sensor(0, 0.0, 0.0, 1, 0.0)


SENSOR: dict[str, Callable[[], Signals]] = {"sensor_imperfect": sensor_imperfect, "sensor_noisy": sensor_noisy}


# Actuator -----------------------------------------------------------------------------------------------------------


def actuator(time_constant: float, rate: float, least: float, greatest: float, start: float) -> Signals:
    """Return a command, and the actuator's value before each step, integrated by the classical Runge-Kutta method.

    A step has 200 substeps of 5 us. If the rate limit begins within a substep, the error is below 1e-9.
    """
    t = np.arange(2000) * STEP
    u = as_printed(signal(t))
    parts = 200
    h = STEP / parts
    x, values = start, []
    for command in u.tolist():
        values.append(x)
        target = min(max(command, least), greatest)

        def slope(x: float, target: float = target) -> float:
            return min(max((target - x) / time_constant, -rate), rate)

        for _ in range(parts):
            k1 = slope(x)
            k2 = slope(x + 0.5 * h * k1)
            k3 = slope(x + 0.5 * h * k2)
            k4 = slope(x + h * k3)
            x += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return {"time": t, "actuator.command": u, "actuator.value": np.array(values)}


def actuator_limited() -> Signals:
    """Return an actuator that reaches its limits of rate and range."""
    return actuator(0.04, 8.0, -0.9, 1.3, 0.25)


def actuator_default() -> Signals:
    return actuator(0.01, 1e9, -1e9, 1e9, 0.0)


ACTUATOR: dict[str, Callable[[], Signals]] = {"actuator_limited": actuator_limited}


# SuspensionMixer ----------------------------------------------------------------------------------------------------


def mixer() -> str:
    """Return a table with the weighted sum of two forces at six wheels, limited to 100 kN, without empty cells."""
    t = np.arange(100) * STEP
    signals: Signals = {"time": t, "weight.integrated": 0.5 - 0.5 * np.cos(40.0 * t), "weight.roll": 0.9 * t / t[-1]}
    places = ("fl", "fr", "ml", "mr", "rl", "rr")
    for k, place in enumerate(places):
        signals[f"integrated_force.{place}"] = 70e3 * np.sin(60.0 * t + k)
        signals[f"roll_force.{place}"] = 90e3 * np.cos(50.0 * t - 2.0 * k)
    # Rounded as in the file.
    signals = {name: np.array([float(f"{v:.{DIGITS}g}") for v in values]) for name, values in signals.items()}
    for place in places:
        force = signals["weight.integrated"] * signals[f"integrated_force.{place}"]
        force = force + signals["weight.roll"] * signals[f"roll_force.{place}"]
        signals[f"suspension_force.{place}"] = np.clip(force, -100e3, 100e3)
    return text(signals, 1)


RUNS = DRIVER | ROAD | SENSOR | ACTUATOR


# Path driver ---------------------------------------------------------------------------------------------------------


def double_lane_change() -> tuple[Array, Array, Array, Array]:
    """Return x, y, heading and station of the path's points, for the start values."""
    width, overlap = 1.61, 6.0
    x = np.arange(2751) * 0.1
    right = -(1.1 * width + 0.25) / 2.0
    second = right + 3.5 + (1.2 * width + 0.25) / 2.0 - 0.1
    third = right + (1.3 * width + 0.25) / 2.0
    # y and slope of the transition between two lanes, normalized to height 1.
    step, rise = np.polynomial.Polynomial([0, 0, 0, 10, -15, 6]), np.polynomial.Polynomial([0, 0, 30, -60, 30])
    y, slope = np.zeros_like(x), np.zeros_like(x)
    for begin, end, height in (
        (65.0 - overlap, 95.0 + overlap, second),
        (120.0 - overlap, 145.0 + overlap, third - second),
    ):
        q = np.clip((x - begin) / (end - begin), 0.0, 1.0)
        y, slope = y + height * step(q), slope + height * rise(q) / (end - begin)
    return x, y, np.arctan(slope), np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))


def path_driver_default() -> Signals:
    """Return a run with the start values: a vehicle that starts beside the path of the double lane change."""
    n = 1500
    k = np.arange(n)
    at_x, at_y = 40.0 + 0.05 * k, np.round(1.75 - 1.75 * np.cos(math.pi * k / n), 2)
    yaw, speed = np.round(0.12 * np.sin(1.2 * math.pi * k / n), 3), np.full(n, 18.0)
    x, y, heading, s = double_lane_change()
    curvature = np.zeros_like(s)
    curvature[1:-1] = (heading[2:] - heading[:-2]) / (s[2:] - s[:-2])
    along = np.stack((np.diff(x), np.diff(y)))
    station, deviation, error = np.zeros(n), np.zeros(n), np.zeros(n)
    j = 0

    def share(j: int, row: int) -> float:
        away = (at_x[row] - x[j], at_y[row] - y[j])
        return float(np.dot(along[:, j], away) / np.dot(along[:, j], along[:, j]))

    for row in range(n):
        while share(j, row) >= 1.0:
            j += 1
        while j > 0 and share(j, row) < 0.0:
            j -= 1
        q = min(share(j, row), 1.0) if j == 0 else min(max(share(j, row), 0.0), 1.0)
        (dx, dy), length = along[:, j], s[j + 1] - s[j]
        station[row] = s[j] + q * length
        deviation[row] = (dx * (at_y[row] - y[j] - q * dy) - dy * (at_x[row] - x[j] - q * dx)) / length
        error[row] = yaw[row] - (1.0 - q) * heading[j] - q * heading[j + 1]
    preview = 0.8 * speed
    ahead = deviation + preview * np.sin(error)
    raw = 2.34 * (np.interp(station + (0.1 + 0.05 + 0.05) * speed, s, curvature) - 2.0 * ahead / preview**2)
    delayed = np.concatenate((np.zeros(50), raw[:-50]))
    steer = np.zeros(n)
    lag, angle = 0.0, 0.0
    for row in range(n):
        lag = delayed[row] + (lag - delayed[row]) * math.exp(-STEP / 0.05)
        change = math.radians(1000.0) / 16.0 * STEP
        angle += min(max(lag - angle, -change), change)
        steer[row] = angle
    return {
        "time": k * STEP,
        "vehicle.position_x": at_x,
        "vehicle.position_y": at_y,
        "vehicle.yaw": yaw,
        "vehicle.speed": speed,
        "driver.steer": steer,
        "driver.speed": np.full(n, 60.0 / 3.6),
        "driver.throttle": np.zeros(n),
        "driver.brake": np.zeros(n),
        "driver.steering_wheel": 16.0 * steer,
        "path.lateral_deviation": deviation,
        "path.heading_error": error,
        "path.distance": station,
    }


# Files --------------------------------------------------------------------------------------------------------------


def text(signals: Mapping[str, Array], thinned: int = THINNED) -> str:
    """Return a table with inputs in all rows, and outputs in every `thinned`-th row."""
    inputs = [name for name in signals if name in INPUTS]
    names = [name for name in signals if name not in ("time", *INPUTS)]
    lines = [",".join(signals)]
    for k in range(len(signals["time"])):
        cells = [f"{signals['time'][k]:.10g}", *(f"{signals[name][k]:.{DIGITS}g}" for name in inputs)]
        cells += [f"{signals[name][k]:.{DIGITS}g}" if k % thinned == 0 else "" for name in names]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"


def csv(columns: Mapping[str, list[float]]) -> str:
    """Return the content of the file for a table parameter."""
    rows = zip(*columns.values(), strict=True)
    return "\n".join([",".join(columns), *(",".join(f"{v:g}" for v in row) for row in rows)]) + "\n"


# Maximum size of a reference file inside an FMU, bytes.
LARGEST = 60_000


def beginning(table: str) -> str:
    """Return the first rows, up to the size limit for a file inside an FMU."""
    end = len(table) if len(table) <= LARGEST else table.rindex("\n", 0, LARGEST) + 1
    return table[:end]


def files() -> dict[str, str]:
    """Return the content of all files by path in the repository; names that end with .gz are to be compressed."""
    folder = "tests/references/sources"
    result = {f"{folder}/{name}.csv.gz": text(run()) for name, run in RUNS.items()}
    result[f"{folder}/driver_table_file.csv"] = csv(DEMANDS)
    result[f"{folder}/road_table_file.csv"] = csv(HEIGHTS)
    result["fmu-plant/driver/reference.csv"] = beginning(text(RUNS["driver_ramp_step"]()))
    result["fmu-plant/path-driver/reference.csv"] = beginning(text(path_driver_default(), 15))
    result["fmu-plant/road/reference.csv"] = beginning(text(RUNS["road_default"]()))
    result["fmu-plant/sensor/reference.csv"] = beginning(text(sensor_default(), 1))
    result["fmu-plant/actuator/reference.csv"] = beginning(text(actuator_default(), 1))
    result["fmu-controllers/suspension-mixer/reference.csv"] = mixer()
    return result


def write() -> None:
    """Write all files; the same content gives the same bytes."""
    for name, content in files().items():
        path = Path(__file__).parents[2] / name
        path.parent.mkdir(parents=True, exist_ok=True)
        data = content.encode()
        path.write_bytes(gzip.compress(data, mtime=0) if path.suffix == ".gz" else data)


if __name__ == "__main__":
    write()
