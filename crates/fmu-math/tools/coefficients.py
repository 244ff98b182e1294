# /// script
# requires-python = ">=3.10"
# dependencies = ["mpmath==1.4.1"]
# ///
"""Writes src/coefficients.rs: the polynomials and the constants of the range reductions.

Each polynomial is a weighted least-squares fit on Chebyshev points, which is close to the best one. Its coefficients
are rounded to double precision one by one, the lowest first; the others are fitted again after each, so that they make
up for the rounding. The error in the comment is that of the rounded polynomial, relative to the function, without the
rounding errors of its evaluation.
"""

from collections.abc import Callable
from pathlib import Path

from mpmath import (
    asin,
    atan,
    bernoulli,
    binomial,
    cos,
    factorial,
    floor,
    linspace,
    log,
    lu_solve,
    matrix,
    mp,
    mpf,
    nstr,
    pi,
    sin,
    sqrt,
    tanh,
)

mp.dps = 60

Function = Callable[[mpf], mpf]


def double(x: mpf) -> float:
    """Round to the nearest double."""
    return float(x)


def series(terms: Callable[[int], mpf]) -> Function:
    """Sum of a power series that converges fast, for arguments at which the closed form cancels."""

    def value(z: mpf) -> mpf:
        total, k = mpf(0), 0
        while True:
            term = terms(k) * z**k
            total += term
            if abs(term) < mpf(10) ** -40:
                return total
            k += 1

    return value


def rounded(target: Function, weight: Function, low: mpf, high: mpf, count: int) -> tuple[list[float], mpf]:
    """Fit with coefficients in double precision."""
    points = [(low + high) / 2 - (high - low) / 2 * cos(pi * (2 * k + 1) / (6 * count)) for k in range(3 * count)]
    fixed: list[mpf] = []
    while len(fixed) < count:
        rest = range(len(fixed), count)
        system = matrix([[weight(x) * x**power for power in rest] for x in points])
        right = matrix([weight(x) * (target(x) - sum(c * x**i for i, c in enumerate(fixed))) for x in points])
        fixed.append(mpf(double(lu_solve(system, right)[0])))
    worst = max(
        abs(weight(x) * (target(x) - sum(c * x**i for i, c in enumerate(fixed)))) for x in linspace(low, high, 2001)
    )
    return [double(c) for c in fixed], worst


def parts(x: mpf, *bits: int) -> list[float]:
    """Split into parts with so many significant bits and a last one with all that a double holds."""
    result = []
    for width in bits:
        scale = mpf(2) ** (width - 1 - floor(log(x, 2)))
        part = floor(x * scale) / scale
        result.append(double(part))
        assert mpf(result[-1]) == part
        x -= part
    return [*result, double(x)]


class Writer:
    """The lines of the Rust file."""

    def __init__(self) -> None:
        self.lines = [
            "//! Coefficients of the kernels, lowest first. Written by `tools/coefficients.py`: do not edit.",
            "",
            "#![allow(clippy::excessive_precision, clippy::unreadable_literal, clippy::approx_constant)]",
        ]

    def constants(self, text: str, **values: float) -> None:
        """Add single constants."""
        self.lines += ["", f"// {text}"]
        self.lines += [f"pub(crate) const {name}: f64 = {value!r};" for name, value in values.items()]

    def polynomial(
        self, name: str, text: str, target: Function, weight: Function, low: mpf, high: mpf, count: int
    ) -> None:
        """Add a polynomial."""
        coefficients, worst = rounded(target, weight, low, high, count)
        comment = f"{text} Relative error of the function below 2^{nstr(log(worst, 2), 4)}."
        print(name, comment)
        self.lines += ["", f"// {comment}", "#[rustfmt::skip]"]
        self.lines += [f"pub(crate) const {name}: [f64; {count}] = ["]
        self.lines += [f"    {c!r}," for c in coefficients] + ["];"]


def main() -> None:
    """Write the file."""
    out = Writer()
    # Angles: the first two parts of pi/2 times a multiple below 2^14 are exact.
    first, second, third = parts(pi / 2, 39, 39)
    out.constants("pi/2 in three parts.", PIO2_1=first, PIO2_2=second, PIO2_3=third)
    out.constants("2/pi", TWO_OVER_PI=double(2 / pi))
    # Multiples up to 4 of the first part of pi/4 are exact.
    first, second = parts(pi / 4, 50)
    out.constants("pi/4 in two parts.", PIO4_HI=first, PIO4_LO=second)
    # A power of two has an exponent below 2^11.
    first, second = parts(log(2), 42)
    out.constants("ln 2 in two parts.", LN2_HI=first, LN2_LO=second)
    out.constants("1 / ln 2", INV_LN2=double(1 / log(2)))
    third_hi = double(mpf(1) / 3)
    out.constants("1/3 in two parts.", THIRD_HI=third_hi, THIRD_LO=double(mpf(1) / 3 - mpf(third_hi)))

    angle = (pi / 4) ** 2 * mpf("1.001")
    sine = series(lambda k: (-1) ** (k + 1) / factorial(2 * k + 3))
    out.polynomial(
        "SIN",
        "(sin(r)/r - 1)/z, z = r^2, |r| <= pi/4.",
        sine,
        lambda z: z / (sin(sqrt(z)) / sqrt(z) if z else mpf(1)),
        mpf(0),
        angle,
        6,
    )
    cosine = series(lambda k: (-1) ** k / factorial(2 * k + 4))
    out.polynomial(
        "COS",
        "(cos(r) - 1 + z/2)/z^2, z = r^2, |r| <= pi/4.",
        cosine,
        lambda z: z * z / cos(sqrt(z)),
        mpf(0),
        angle,
        6,
    )
    arctangent = series(lambda k: mpf((-1) ** (k + 1)) / (2 * k + 3))
    out.polynomial(
        "ATAN",
        "(atan(t)/t - 1)/z, z = t^2, |t| <= 1/2.",
        arctangent,
        lambda z: z / (atan(sqrt(z)) / sqrt(z) if z else mpf(1)),
        mpf(0),
        mpf("0.2501"),
        13,
    )
    arcsine = series(lambda k: mpf(binomial(2 * k + 2, k + 1)) / (mpf(4) ** (k + 1) * (2 * k + 3)))
    out.polynomial(
        "ASIN",
        "(asin(s)/s - 1)/z, z = s^2, |s| <= 1/2.",
        arcsine,
        lambda z: z / (asin(sqrt(z)) / sqrt(z) if z else mpf(1)),
        mpf(0),
        mpf("0.2501"),
        13,
    )
    # Bernoulli numbers: tanh x = sum of 4^n (4^n - 1) B(2n) / (2n)! x^(2n - 1).
    tangent = series(lambda k: (4 ** (k + 2)) * (4 ** (k + 2) - 1) * bernoulli(2 * k + 4) / factorial(2 * k + 4))
    out.polynomial(
        "TANH",
        "(tanh(x)/x - 1)/z, z = x^2, |x| <= 0.55.",
        tangent,
        lambda z: z / (tanh(sqrt(z)) / sqrt(z) if z else mpf(1)),
        mpf(0),
        mpf("0.3026"),
        11,
    )
    half = log(2) / 2 * mpf("1.001")
    out.polynomial(
        "EXPM1",
        "(exp(r) - 1 - r)/r^2, |r| <= ln(2)/2.",
        series(lambda k: 1 / factorial(k + 2)),
        lambda r: abs(r) + mpf("0.02"),
        -half,
        half,
        11,
    )
    ratio = ((sqrt(2) - 1) / (sqrt(2) + 1)) ** 2 * mpf("1.001")
    out.polynomial(
        "LN",
        "((ln(1 + s) - ln(1 - s))/s - 2)/z, z = s^2, s = (m - 1)/(m + 1), m from sqrt(1/2) to sqrt(2).",
        series(lambda k: mpf(2) / (2 * k + 3)),
        lambda z: z / 2,
        mpf(0),
        ratio,
        7,
    )
    out.polynomial(
        "LN_TAIL",
        "The terms of the same beyond z/3, relative to 2 s: 1/5 + z/7 + ...",
        series(lambda k: mpf(1) / (2 * k + 5)),
        lambda z: z * z,
        mpf(0),
        ratio,
        8,
    )
    path = Path(__file__).parent.parent / "src" / "coefficients.rs"
    path.write_text("\n".join(out.lines) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
