//! Solvers for ordinary differential equations x' = f(t, x), one step at a time.
//!
//! All functions work on the caller's slices, allocate nothing and need no `std`. `f` writes the derivatives for a time
//! and a state; if it returns an error, the step ends. Operations have a fixed order, so results are bit-identical on
//! every platform.

/// Length of `work` per state for [`runge_kutta`].
pub const RUNGE_KUTTA_WORK: usize = 4;
/// Length of `work` per state for [`dormand_prince`].
pub const DORMAND_PRINCE_WORK: usize = 7;
/// Length of `work` per state for [`rodas`].
pub const RODAS_WORK: usize = 5;

/// Splits off the first `K` slices of `n` numbers.
#[inline]
fn split<const K: usize>(mut work: &mut [f64], n: usize) -> [&mut [f64]; K] {
    core::array::from_fn(|_| work.split_off_mut(..n).expect("`work` is long enough"))
}

/// to = x + factor k, element by element.
#[inline]
fn along(to: &mut [f64], x: &[f64], factor: f64, k: &[f64]) {
    for ((to, x), k) in to.iter_mut().zip(x).zip(k) {
        *to = x + factor * k;
    }
}

/// to = to + factor k, element by element.
#[inline]
fn add(to: &mut [f64], factor: f64, k: &[f64]) {
    for (to, k) in to.iter_mut().zip(k) {
        *to += factor * k;
    }
}

/// to = x + h a1 k1 + h a2 k2 + …
#[inline]
fn sum(to: &mut [f64], x: &[f64], h: f64, parts: &[(f64, &[f64])]) {
    to.copy_from_slice(x);
    parts.iter().for_each(|&(a, k)| add(to, h * a, k));
}

/// One step of length `h` with the classical Runge-Kutta method of order 4 (Kutta 1901), from `x` to `end`.
///
/// # Errors
/// The first error of `f`.
///
/// # Panics
/// If a slice is shorter than the state `x`, or `work` shorter than [`RUNGE_KUTTA_WORK`] times the length of `x`.
#[inline]
pub fn runge_kutta<E>(
    mut f: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
    time: f64,
    x: &[f64],
    h: f64,
    end: &mut [f64],
    work: &mut [f64],
) -> Result<(), E> {
    let n = x.len();
    let [k1, k2, k3, k4] = split(work, n);
    f(time, x, k1)?;
    along(end, x, 0.5 * h, k1);
    f(time + 0.5 * h, end, k2)?;
    along(end, x, 0.5 * h, k2);
    f(time + 0.5 * h, end, k3)?;
    along(end, x, h, k3);
    f(time + h, end, k4)?;
    for i in 0..n {
        let slope = k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i];
        end[i] = x[i] + h / 6.0 * slope;
    }
    Ok(())
}

/// One step of length `h` with the Dormand-Prince pair of orders 5 and 4 (1980, RK5(4)7M), from `x` to `end`. Writes
/// the error estimate to `error`, see [`error_norm`].
///
/// # Errors
/// The first error of `f`.
///
/// # Panics
/// If a slice is shorter than the state `x`, or `work` shorter than [`DORMAND_PRINCE_WORK`] times the length of `x`.
#[inline]
pub fn dormand_prince<E>(
    mut f: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
    time: f64,
    x: &[f64],
    h: f64,
    end: &mut [f64],
    error: &mut [f64],
    work: &mut [f64],
) -> Result<(), E> {
    let [k1, k2, k3, k4, k5, k6, k7] = split(work, x.len());
    f(time, x, k1)?;
    sum(end, x, h, &[(1.0 / 5.0, k1)]);
    f(time + 1.0 / 5.0 * h, end, k2)?;
    sum(end, x, h, &[(3.0 / 40.0, k1), (9.0 / 40.0, k2)]);
    f(time + 3.0 / 10.0 * h, end, k3)?;
    sum(end, x, h, &[(44.0 / 45.0, k1), (-56.0 / 15.0, k2), (32.0 / 9.0, k3)]);
    f(time + 4.0 / 5.0 * h, end, k4)?;
    let parts = [(19372.0 / 6561.0, &*k1), (-25360.0 / 2187.0, k2), (64448.0 / 6561.0, k3), (-212.0 / 729.0, k4)];
    sum(end, x, h, &parts);
    f(time + 8.0 / 9.0 * h, end, k5)?;
    let parts: [(f64, &[f64]); 5] = [
        (9017.0 / 3168.0, k1),
        (-355.0 / 33.0, k2),
        (46732.0 / 5247.0, k3),
        (49.0 / 176.0, k4),
        (-5103.0 / 18656.0, k5),
    ];
    sum(end, x, h, &parts);
    f(time + h, end, k6)?;
    let parts: [(f64, &[f64]); 5] =
        [(35.0 / 384.0, k1), (500.0 / 1113.0, k3), (125.0 / 192.0, k4), (-2187.0 / 6784.0, k5), (11.0 / 84.0, k6)];
    sum(end, x, h, &parts);
    f(time + h, end, k7)?;
    let parts: [(f64, &[f64]); 6] = [
        (71.0 / 57600.0, k1),
        (-71.0 / 16695.0, k3),
        (71.0 / 1920.0, k4),
        (-17253.0 / 339_200.0, k5),
        (22.0 / 525.0, k6),
        (-1.0 / 40.0, k7),
    ];
    error.fill(0.0);
    parts.iter().for_each(|&(e, k)| add(error, h * e, k));
    Ok(())
}

/// Writes the state at `time + part * h`, with `part` from 0 to 1, within the last step of [`dormand_prince`] to `to`.
/// `x`, `h`, `end` and `work` are those of the step. The interpolation has order 4 (Hairer, Norsett, Wanner, section
/// II.6, with the coefficients from their program).
///
/// # Panics
/// If a slice is shorter than [`dormand_prince`] requires.
pub fn dormand_prince_within(part: f64, x: &[f64], h: f64, end: &[f64], work: &[f64], to: &mut [f64]) {
    const D: [f64; 7] = [
        -12_715_105_075.0 / 11_282_082_432.0,
        0.0,
        87_487_479_700.0 / 32_700_410_799.0,
        -10_690_763_975.0 / 1_880_347_072.0,
        701_980_252_875.0 / 199_316_789_632.0,
        -1_453_857_185.0 / 822_651_844.0,
        69_997_945.0 / 29_380_423.0,
    ];
    let (n, rest) = (x.len(), 1.0 - part);
    for i in 0..n {
        let k = |stage: usize| work[stage * n + i];
        let change = end[i] - x[i];
        let start = h * k(0) - change;
        let bend = change - h * k(6) - start;
        let fourth: f64 = D.iter().enumerate().map(|(stage, d)| d * k(stage)).sum();
        to[i] = x[i] + part * (change + rest * (start + part * (bend + rest * (h * fourth))));
    }
}

/// The value that [`rodas`] adds to each diagonal element of the negative Jacobian for a step of length `h`.
#[must_use]
pub fn rodas_diagonal(h: f64) -> f64 {
    1.0 / (h * 0.25)
}

/// One step of length `h` with the stiffly stable method RODAS of order 4 (Hairer, Wanner, "Solving Ordinary
/// Differential Equations II", 1996, section IV.7, with the coefficients from their program), from `x` to `end`. Writes
/// the error estimate to `error`, see [`error_norm`].
///
/// `solve` replaces b by the solution u of ([`rodas_diagonal`] I - J) u = b, where J is the Jacobian of `f` at `time`
/// and `x`; `slope` is the partial derivative of `f` with respect to time at this point.
///
/// # Errors
/// The first error of `f`.
///
/// # Panics
/// If a slice is shorter than the state `x`, or `work` shorter than [`RODAS_WORK`] times the length of `x`.
#[expect(clippy::too_many_arguments, reason = "the problem, its linearization, the step and three results")]
#[inline]
pub fn rodas<E>(
    mut f: impl FnMut(f64, &[f64], &mut [f64]) -> Result<(), E>,
    mut solve: impl FnMut(&mut [f64]),
    time: f64,
    x: &[f64],
    slope: &[f64],
    h: f64,
    end: &mut [f64],
    error: &mut [f64],
    work: &mut [f64],
) -> Result<(), E> {
    const A: [&[f64]; 5] = [
        &[],
        &[1.544],
        &[0.946_678_528_081_582_6, 0.255_701_169_898_328_4],
        &[3.314_825_187_068_521, 2.896_124_015_972_201, 0.998_641_913_997_781_7],
        &[1.221_224_509_226_641, 6.019_134_481_288_629, 12.537_083_329_320_87, -0.687_886_036_105_895],
    ];
    const C: [&[f64]; 6] = [
        &[],
        &[-5.6688],
        &[-2.430_093_356_833_875, -0.206_359_915_709_191_5],
        &[-0.107_352_905_815_137_5, -9.594_562_251_023_355, -20.470_286_148_096_16],
        &[7.496_443_313_967_647, -10.246_804_314_643_52, -33.999_903_528_199_05, 11.708_908_932_061_6],
        &[
            8.083_246_795_921_522,
            -7.981_132_988_064_893,
            -31.521_594_328_743_71,
            16.319_305_431_231_36,
            -6.058_818_238_834_054,
        ],
    ];
    /// Relative times of the stages, and their coefficients for the time derivative.
    const TIMES: [f64; 6] = [0.0, 0.386, 0.21, 0.63, 1.0, 1.0];
    const D: [f64; 6] = [0.25, -0.1043, 0.1035, -0.036_200_000_000_000_23, 0.0, 0.0];

    let n = x.len();
    // (1/(h gamma) - J) u = f + sum (c/h) u + h d f_t
    for stage in 0..6 {
        let (known, rest) = work.split_at_mut(stage * n);
        let known = |j: usize| &known[j * n..][..n];
        let u = if stage < 5 { &mut rest[..n] } else { &mut error[..n] };
        // The argument of the last stage is the previous argument plus the previous increment.
        match A.get(stage) {
            Some(coefficients) => {
                end.copy_from_slice(x);
                coefficients.iter().enumerate().for_each(|(j, &a)| add(end, a, known(j)));
            }
            None => add(end, 1.0, known(stage - 1)),
        }
        f(time + TIMES[stage] * h, end, u)?;
        C[stage].iter().enumerate().for_each(|(j, &c)| add(u, c / h, known(j)));
        add(u, h * D[stage], slope);
        solve(u);
    }
    add(end, 1.0, error);
    Ok(())
}

/// Weighted root mean square of the error in a step from `x` to `end`; at most 1 if the step meets the tolerance
/// (Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", eq. II.4.11). Each error is divided by the
/// tolerance times the sum of the nominal value and the magnitude of the state. Without states, the norm is 0.
#[must_use]
#[inline]
pub fn error_norm(x: &[f64], end: &[f64], error: &[f64], nominals: &[f64], tolerance: f64) -> f64 {
    if x.is_empty() {
        return 0.0;
    }
    let mut sum = 0.0;
    for (((x, end), error), nominal) in x.iter().zip(end).zip(error).zip(nominals) {
        let ratio = error / (tolerance * (nominal + x.abs().max(end.abs())));
        sum += ratio * ratio;
    }
    crate::bits::sqrt(sum / x.len() as f64)
}

/// Factor for the length of the next step, between 0.2 and 5, after a step with the error `norm`, for methods whose
/// error estimate has order 4.
#[must_use]
pub fn step_factor(norm: f64) -> f64 {
    if norm > 0.0 { (0.9 * crate::pow(norm, -0.2)).clamp(0.2, 5.0) } else { 5.0 }
}

/// Takes one step that the error control accepts, from `time`, at most `limit` long. Returns its length.
///
/// `attempt` makes a step of a length and returns its [`error_norm`], or `None` if this length is not possible; the last
/// attempt is the step. `proposed` is the length that the step before proposes, 0 if there is none, and then the length
/// for the next step.
///
/// # Errors
/// The first error of `attempt`; `too_short` if the length no longer advances the time.
pub fn controlled<E>(
    proposed: &mut f64,
    time: f64,
    limit: f64,
    mut attempt: impl FnMut(f64) -> Result<Option<f64>, E>,
    too_short: impl FnOnce(f64) -> E,
) -> Result<f64, E> {
    // The first step is a small part of the limit, but is not lost when it is added to the time.
    let first = (limit * 1e-3).max(16.0 * f64::EPSILON * time.abs());
    let wanted = if *proposed > 0.0 { *proposed } else { first };
    // Avoids leaving a tiny step before the limit.
    let mut h = if 1.01 * wanted >= limit { limit } else { wanted };
    loop {
        // A short step up to the limit (the next event, or the end of the step) is not an error.
        if h < limit && (h <= 4.0 * f64::EPSILON * time.abs() || h < f64::MIN_POSITIVE) {
            return Err(too_short(h));
        }
        let Some(norm) = attempt(h)? else {
            h *= 0.25;
            continue;
        };
        let factor = step_factor(norm);
        if norm <= 1.0 {
            let next = h * factor;
            // A step that was shortened by the limit must not reduce the next proposal.
            *proposed = if h < wanted { wanted.max(next) } else { next };
            return Ok(h);
        }
        h *= if norm.is_finite() { factor.min(0.9) } else { 0.2 };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x' = x cos t with x(0) = 1. The solution is x = exp(sin t).
    fn f(time: f64, x: &[f64], to: &mut [f64]) -> Result<(), ()> {
        to[0] = x[0] * crate::cos(time);
        Ok(())
    }

    /// Error at t = 2 after `steps` equal steps.
    fn error_of(step: impl Fn(f64, f64, f64) -> f64, steps: u32) -> f64 {
        let h = 2.0 / f64::from(steps);
        let end = (0..steps).fold(1.0, |x, k| step(f64::from(k) * h, x, h));
        (end - crate::exp(crate::sin(2.0))).abs()
    }

    #[test]
    fn the_error_falls_with_the_order_of_the_method() {
        let runge_kutta = |time, x, h| {
            let (mut end, mut work) = ([0.0], [0.0; RUNGE_KUTTA_WORK]);
            runge_kutta(f, time, &[x], h, &mut end, &mut work).unwrap();
            end[0]
        };
        let dormand_prince = |time, x, h| {
            let (mut end, mut error, mut work) = ([0.0], [0.0], [0.0; DORMAND_PRINCE_WORK]);
            dormand_prince(f, time, &[x], h, &mut end, &mut error, &mut work).unwrap();
            end[0]
        };
        let rodas = |time: f64, x: f64, h: f64| {
            let (mut end, mut error, mut work) = ([0.0], [0.0], [0.0; RODAS_WORK]);
            let matrix = rodas_diagonal(h) - crate::cos(time);
            let slope = [-x * crate::sin(time)];
            rodas(f, |b| b[0] /= matrix, time, &[x], &slope, h, &mut end, &mut error, &mut work).unwrap();
            end[0]
        };
        let errors = |steps| [error_of(runge_kutta, steps), error_of(dormand_prince, steps), error_of(rodas, steps)];
        let all = [40, 80, 160].map(errors);
        for (method, order) in [4, 5, 4].into_iter().enumerate() {
            let errors = all.map(|errors| errors[method]);
            for pair in errors.windows(2) {
                let ratio = pair[0] / pair[1];
                // Half the step length divides the error by 2^order. Tolerance: 30 % for terms of higher order.
                assert!((ratio / 2.0_f64.powi(order) - 1.0).abs() < 0.3, "order {order}: {ratio} of {errors:?}");
            }
        }
    }

    /// The error of the interpolation in a step of length h has the order 5 of h, as that of a method of order 4.
    #[test]
    fn a_step_can_be_interpolated() {
        let error = |h: f64| {
            let (mut end, mut error, mut work) = ([0.0], [0.0], [0.0; DORMAND_PRINCE_WORK]);
            dormand_prince(f, 0.0, &[1.0], h, &mut end, &mut error, &mut work).unwrap();
            let errors = [0.0, 0.3, 0.7, 1.0].map(|part| {
                let mut x = [0.0];
                dormand_prince_within(part, &[1.0], h, &end, &work, &mut x);
                (x[0] - crate::exp(crate::sin(part * h))).abs()
            });
            assert!(errors[0] == 0.0 && errors[3] < errors[1], "{errors:?}");
            errors[1].max(errors[2])
        };
        let ratio = error(0.1) / error(0.05);
        assert!((ratio / 32.0 - 1.0).abs() < 0.3, "{ratio}");
    }

    #[test]
    fn an_error_of_the_equations_ends_the_step() {
        let mut calls = 0;
        let failing = |_: f64, _: &[f64], _: &mut [f64]| {
            calls += 1;
            if calls == 3 { Err("third") } else { Ok(()) }
        };
        let (mut end, mut work) = ([0.0; 2], [0.0; 2 * RUNGE_KUTTA_WORK]);
        assert_eq!(runge_kutta(failing, 0.0, &[1.0, 2.0], 0.1, &mut end, &mut work), Err("third"));
        assert_eq!(calls, 3);
    }

    /// The weights are 1: tolerance times (nominal + magnitude) = 0.1 (1 + 9). The result is the root mean square of 3
    /// and 4.
    #[test]
    fn the_norm_is_the_weighted_root_mean_square() {
        let norm = error_norm(&[9.0, -5.0], &[2.0, 9.0], &[3.0, -4.0], &[1.0, 1.0], 0.1);
        assert!((norm - 12.5_f64.sqrt()).abs() < 1e-15, "{norm}");
        assert_eq!(error_norm(&[], &[], &[], &[], 0.1), 0.0);
        assert_eq!([0.0, 1e-30, 1e30].map(step_factor), [5.0, 5.0, 0.2]);
    }
}
