# /// script
# requires-python = ">=3.10"
# dependencies = ["mpmath==1.4.1"]
# ///
"""Writes values.bin: arguments and results computed by mpmath, for the accuracy test.

For each function: its name (8 bytes), the number of rows (4 bytes), the number of arguments (4 bytes), and rows of
doubles: the arguments, the result rounded to a double, and the rounding error of this double.
"""

import math
import random
import struct
from collections.abc import Callable
from pathlib import Path

import mpmath
from mpmath import mp, mpf

# Enough for sin(x) near multiples of pi with exponents up to 1023.
mp.prec = 1400
ROWS = 260
chance = random.Random(20261122)


def uniform(low: float, high: float) -> Callable[[], float]:
    """Return a source of uniformly distributed numbers."""
    return lambda: chance.uniform(low, high)


def wide(low: int, high: int, sign: bool = True) -> Callable[[], float]:
    """Return a source of numbers with uniformly distributed exponents."""
    return lambda: (
        math.ldexp(chance.uniform(1, 2), chance.randint(low, high - 1)) * (chance.choice([-1, 1]) if sign else 1)
    )


def near(*points: float) -> Callable[[], float]:
    """Return a source of the points and their neighbors."""

    def pick() -> float:
        x = chance.choice(points)
        for _ in range(chance.randint(0, 3)):
            x = math.nextafter(x, chance.choice([-math.inf, math.inf]))
        return x

    return pick


def quarter_turns() -> float:
    """Return a double next to a multiple of pi/4, where a sine is small or the quadrant changes."""
    return near(chance.choice([-1, 1]) * float(chance.randint(1, 31_000) * mpmath.pi / 4))()


def halves_of_ln2() -> float:
    """Return a double next to an odd multiple of ln(2)/2, where the power of two changes."""
    return near(float((2 * chance.randint(-1000, 1000) + 1) * mpmath.ln(2) / 2))()


ANGLES = [uniform(-1, 1), uniform(-30, 30), uniform(-25_000, 25_000), quarter_turns, wide(-60, 14), wide(14, 1024)]
UNIT = [uniform(-1, 1), uniform(0.45, 0.55), wide(-60, 0), near(0.5, -0.5), lambda: 1 - wide(-53, -1, sign=False)()]
EXPONENTS = [uniform(-1, 1), uniform(-20, 20), uniform(-708, 708), halves_of_ln2, near(708, -708), wide(-1022, 9)]
Sources = list[Callable[[], float]]
ONE: dict[str, tuple[Callable[[mpf], mpf], Sources]] = {
    "sin": (mpmath.sin, ANGLES),
    "cos": (mpmath.cos, ANGLES),
    "tan": (mpmath.tan, ANGLES),
    "asin": (mpmath.asin, UNIT),
    "acos": (mpmath.acos, UNIT),
    "atan": (mpmath.atan, [uniform(-1, 1), uniform(-4, 4), near(0.5, 1, 2), wide(-1022, 1024), near(1e300)]),
    "exp": (mpmath.exp, [*EXPONENTS, uniform(-745, 709.7), near(709.7)]),
    "ln": (mpmath.ln, [uniform(0, 2), uniform(0, 100), near(1, 0.5**0.5, 2**0.5), wide(-1074, 1024, sign=False)]),
    "sinh": (mpmath.sinh, EXPONENTS),
    "cosh": (mpmath.cosh, EXPONENTS),
    "tanh": (mpmath.tanh, [uniform(-1, 1), uniform(-22, 22), near(0.17, 22, 19.06), wide(-1022, 5)]),
}


def powers() -> tuple[float, float]:
    """Return arguments for a power with a result of any size."""
    x = chance.choice([uniform(0.5, 2), uniform(0, 10), wide(-1022, 1024, sign=False), near(1, 0.5**0.5)])()
    bound = min(700 / abs(math.log(x)), 1e99) if x != 1 else 1e99
    return x, chance.choice([uniform(-bound, bound), uniform(-min(3, bound), min(3, bound))])()


def far_powers() -> tuple[float, float]:
    """Return arguments for a power near overflow: bases near 1 with exponents to 1e18, negative and subnormal bases."""
    x = chance.choice([lambda: 1 + wide(-52, -22)(), uniform(0.5, 2), wide(-1074, 1024, sign=False)])()
    y = float(chance.uniform(707.9, 709.75) / mpmath.ln(mpf(x))) if x != 1 else 1.0
    return (-x, float(round(y))) if abs(y) > 1e6 and chance.random() < 0.3 else (x, y)


def points() -> tuple[float, float]:
    """Return coordinates for an angle or a length."""
    x = chance.choice([uniform(-1, 1), wide(-20, 20), wide(-1022, 1023)])()
    kind = chance.randint(0, 3)
    if kind == 0:
        return uniform(-1, 1)(), x
    if kind == 1:
        return x * chance.uniform(0.4, 2.5), x
    if kind == 2:
        return near(x, -x, x / 2, 2 * x)(), x
    return wide(-1022, 1024)(), x


TWO: dict[str, tuple[Callable[[mpf, mpf], mpf], Callable[[], tuple[float, float]]]] = {
    "atan2": (mpmath.atan2, points),
    "pow": (mpmath.power, powers),
    "hypot": (mpmath.hypot, points),
    "pow far": (mpmath.power, far_powers),
}


def split(value: mpf) -> tuple[float, float] | None:
    """Split into a rounded double and the rounding error; None if the result is not a normal number."""
    return (float(value), float(value - mpf(float(value)))) if 2.3e-308 < abs(value) < 1.7e308 else None


def table(function: Callable[..., mpf], arguments: Callable[[int], tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Compute the rows for a function; `arguments` chooses the arguments by row number."""
    rows: list[tuple[float, ...]] = []
    while len(rows) < ROWS:
        x = arguments(len(rows))
        if (result := split(function(*map(mpf, x)))) is not None:
            rows.append((*x, *result))
    return rows


def main() -> None:
    """Write the file."""
    tables = {name: table(f, lambda i, s=sources: (s[i % len(s)](),)) for name, (f, sources) in ONE.items()}
    tables |= {name: table(f, lambda _, s=source: s()) for name, (f, source) in TWO.items()}
    data = b""
    for name, rows in tables.items():
        data += struct.pack("<8sII", name.encode(), len(rows), len(rows[0]) - 2)
        data += b"".join(struct.pack(f"<{len(row)}d", *row) for row in rows)
    (Path(__file__).parent / "values.bin").write_bytes(data)


if __name__ == "__main__":
    main()
