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

from mpmath import mp, mpf

mp.dps = 60

Function = Callable[[mpf], mpf]
LINES = [
    "//! Coefficients of the kernels, lowest first. Written by `tools/coefficients.py`: do not edit.",
    "",
    "#![allow(clippy::excessive_precision, clippy::unreadable_literal, clippy::approx_constant)]",
]


def series(terms: Callable[[int], mpf]) -> Function:
    """Sum of a power series that converges fast, for arguments at which the closed form cancels."""

    def value(z: mpf) -> mpf:
        total, k = mpf(0), 0
        while abs(term := terms(k) * z**k) >= mpf(10) ** -40:
            total, k = total + term, k + 1
        return total + term

    return value


def fitted(target: Function, weight: Function, low: mpf, high: mpf, count: int) -> tuple[list[float], mpf]:
    """Coefficients in double precision, and the largest error."""
    points = [(low + high) / 2 - (high - low) / 2 * mp.cos(mp.pi * (2 * k + 1) / (6 * count)) for k in range(3 * count)]
    fixed: list[float] = []

    def error(x: mpf) -> mpf:
        return weight(x) * (target(x) - sum(mpf(c) * x**i for i, c in enumerate(fixed)))

    while len(fixed) < count:
        system = mp.matrix([[weight(x) * x**power for power in range(len(fixed), count)] for x in points])
        fixed.append(float(mp.lu_solve(system, mp.matrix([error(x) for x in points]))[0]))
    return fixed, max(abs(error(x)) for x in mp.linspace(low, high, 2001))


def parts(x: mpf, *bits: int) -> list[float]:
    """Split into parts with so many significant bits and a last one with all that a double holds."""
    result = []
    for width in bits:
        scale = mpf(2) ** (width - 1 - mp.floor(mp.log(x, 2)))
        part = mp.floor(x * scale) / scale
        result.append(float(part))
        assert mpf(result[-1]) == part
        x -= part
    return [*result, float(x)]


def constants(text: str, names: str, values: list[float]) -> None:
    """Add single constants."""
    LINES.extend(["", f"// {text}"])
    LINES.extend(
        f"pub(crate) const {name}: f64 = {value!r};" for name, value in zip(names.split(), values, strict=True)
    )


def polynomial(
    name: str, text: str, count: int, end: mpf, target: Function, weight: Function, start: float = 0
) -> None:
    """Add a polynomial."""
    coefficients, worst = fitted(target, weight, mpf(start), end, count)
    comment = f"{text} Relative error of the function below 2^{mp.nstr(mp.log(worst, 2), 4)}."
    LINES.extend(["", f"// {comment}", "#[rustfmt::skip]", f"pub(crate) const {name}: [f64; {count}] = ["])
    LINES.extend([f"    {c!r}," for c in coefficients] + ["];"])


def over(function: Function) -> Function:
    """Weight of the error of (f(t)/t - 1)/z, z = t^2, relative to f."""
    return lambda z: z / (function(mp.sqrt(z)) / mp.sqrt(z) if z else mpf(1))


def main() -> None:
    """Write the file."""
    # Angles: the first two parts of pi/2 times a multiple below 2^14 are exact.
    constants("pi/2 in three parts.", "PIO2_1 PIO2_2 PIO2_3", parts(mp.pi / 2, 39, 39))
    constants("2/pi", "TWO_OVER_PI", [float(2 / mp.pi)])
    # Multiples up to 4 of the first part of pi/4 are exact.
    constants("pi/4 in two parts.", "PIO4_HI PIO4_LO", parts(mp.pi / 4, 50))
    # A power of two has an exponent below 2^11.
    constants("ln 2 in two parts.", "LN2_HI LN2_LO", parts(mp.log(2), 42))
    constants("1 / ln 2", "INV_LN2", [float(1 / mp.log(2))])
    third = float(mpf(1) / 3)
    constants("1/3 in two parts.", "THIRD_HI THIRD_LO", [third, float(mpf(1) / 3 - mpf(third))])

    angle = (mp.pi / 4) ** 2 * mpf("1.001")
    terms = series(lambda k: (-1) ** (k + 1) / mp.factorial(2 * k + 3))
    polynomial("SIN", "(sin(r)/r - 1)/z, z = r^2, |r| <= pi/4.", 6, angle, terms, over(mp.sin))
    terms = series(lambda k: (-1) ** k / mp.factorial(2 * k + 4))
    text = "(cos(r) - 1 + z/2)/z^2, z = r^2, |r| <= pi/4."
    polynomial("COS", text, 6, angle, terms, lambda z: z * z / mp.cos(mp.sqrt(z)))
    half = mpf("0.2501")
    terms = series(lambda k: mpf((-1) ** (k + 1)) / (2 * k + 3))
    polynomial("ATAN", "(atan(t)/t - 1)/z, z = t^2, |t| <= 1/2.", 13, half, terms, over(mp.atan))
    terms = series(lambda k: mpf(mp.binomial(2 * k + 2, k + 1)) / (mpf(4) ** (k + 1) * (2 * k + 3)))
    polynomial("ASIN", "(asin(s)/s - 1)/z, z = s^2, |s| <= 1/2.", 13, half, terms, over(mp.asin))
    # Bernoulli numbers: tanh x = sum of 4^n (4^n - 1) B(2n) / (2n)! x^(2n - 1).
    terms = series(lambda k: 4 ** (k + 2) * (4 ** (k + 2) - 1) * mp.bernoulli(2 * k + 4) / mp.factorial(2 * k + 4))
    polynomial("TANH", "(tanh(x)/x - 1)/z, z = x^2, |x| <= 0.55.", 11, mpf("0.3026"), terms, over(mp.tanh))
    end, terms = mp.log(2) / 2 * mpf("1.001"), series(lambda k: 1 / mp.factorial(k + 2))
    text = "(exp(r) - 1 - r)/r^2, |r| <= ln(2)/2."
    polynomial("EXPM1", text, 11, end, terms, lambda r: abs(r) + mpf("0.02"), -end)
    ratio = ((mp.sqrt(2) - 1) / (mp.sqrt(2) + 1)) ** 2 * mpf("1.001")
    text = "((ln(1 + s) - ln(1 - s))/s - 2)/z, z = s^2, s = (m - 1)/(m + 1), m from sqrt(1/2) to sqrt(2)."
    polynomial("LN", text, 7, ratio, series(lambda k: mpf(2) / (2 * k + 3)), lambda z: z / 2)
    text = "The terms of the same beyond z/3, relative to 2 s: 1/5 + z/7 + ..."
    polynomial("LN_TAIL", text, 8, ratio, series(lambda k: mpf(1) / (2 * k + 5)), lambda z: z * z)
    path = Path(__file__).parent.parent / "src" / "coefficients.rs"
    path.write_text("\n".join(LINES) + "\n", encoding="ascii")


if __name__ == "__main__":
    main()
