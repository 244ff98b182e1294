//! Sliding mode control for one error: integral surface, reaching law, boundary layer.
//!
//! The error `e` is driven to zero in two stages. First, a *reaching law* brings the sliding variable `S` to zero; then
//! `e` decays on the surface `S = 0`:
//!
//! ```text
//! S     = e + zeta I,        dI/dt = e                       integral_surface
//! dS/dt = -K S - eps sat(S / width)                          reaching_law
//! S = 0  =>  de/dt = -zeta e
//! ```
//!
//! A controller demands `de/dt = reaching_law(..) - zeta e` and solves its model for the actuator
//! that yields this rate.
//!
//! Reaching time with a sign function (`width` = 0): `ln(1 + K |S(0)| / eps) / K`. A disturbance `w` of `dS/dt` is
//! rejected if `|w| < eps`; inside the boundary layer, an error `|S| <= |w| / (K + eps / width)` remains.
//!
//! NaN in any argument gives NaN.
//!
//! # References
//!
//! * W. Gao, J. C. Hung, "Variable structure control of nonlinear systems: a new approach", IEEE
//!   Transactions on Industrial Electronics 40(1), 1993, 45-55, doi:10.1109/41.184820 (reaching laws).
//! * J.-J. E. Slotine, W. Li, *Applied Nonlinear Control*, Prentice Hall, 1991,
//!   ISBN 0-13-040890-5, chapter 7 (boundary layer, integral surface).

/// Saturation: the sign of `s` outside a boundary layer, linear inside it.
///
/// ```text
/// sat(s) = min(max(s / width, -1), 1)       width > 0
/// sat(s) = sign(s), 0 at s = 0              width <= 0
/// ```
///
/// * `s`: value of the sliding surface.
/// * `width`: half the thickness of the boundary layer, in the unit of `s`. With `width` <= 0, the sign function
///   chatters at the sample rate.
///
/// Returns a dimensionless number within -1..=1.
///
/// ```
/// use chassis_control::sliding_mode::saturation;
/// assert_eq!(saturation(0.01, 0.02), 0.5);
/// assert_eq!(saturation(-3.0, 0.02), -1.0);
/// assert_eq!(saturation(1e-9, 0.0), 1.0);
/// assert_eq!(saturation(0.0, 0.0), 0.0);
/// ```
pub fn saturation(s: f64, width: f64) -> f64 {
    if width > 0.0 {
        (s / width).clamp(-1.0, 1.0)
    } else if s.is_nan() || width.is_nan() {
        f64::NAN
    } else if s == 0.0 {
        0.0
    } else {
        s.signum()
    }
}

/// Integral sliding surface `S = e + zeta I`.
///
/// * `error`: e, actual value minus reference.
/// * `integral`: I, the integral of e over time (unit of e times s). The caller updates, holds or resets it.
/// * `integral_gain`: zeta in 1/s, positive; on S = 0 the error decays as exp(-zeta t).
///
/// Returns S in the unit of e.
pub fn integral_surface(error: f64, integral: f64, integral_gain: f64) -> f64 {
    error + integral_gain * integral
}

/// Demanded rate `dS/dt = -K S - eps sat(S / width)` toward the surface (constant plus proportional rate).
///
/// * `s`: S, value of the sliding surface.
/// * `reaching_rate`: K in 1/s, not negative, for exponential convergence.
/// * `switching_gain`: eps in units of S per s, not negative. It brings S to 0 in finite time if it exceeds the
///   disturbances and model errors of dS/dt.
/// * `width`: boundary layer in the unit of S, see [`saturation`].
///
/// Returns the demanded dS/dt in units of S per s; its sign is opposite to that of S.
///
/// ```
/// use chassis_control::sliding_mode::reaching_law;
/// assert_eq!(reaching_law(0.5, 4.0, 0.25, 0.1), -2.25);
/// ```
pub fn reaching_law(s: f64, reaching_rate: f64, switching_gain: f64, width: f64) -> f64 {
    -reaching_rate * s - switching_gain * saturation(s, width)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn saturation_at_its_edges() {
        assert_eq!(saturation(0.02, 0.02), 1.0);
        assert_eq!(saturation(-0.0, 0.0), 0.0);
        assert_eq!(saturation(-1e-300, -1.0), -1.0);
        assert_eq!(saturation(f64::INFINITY, 0.1), 1.0);
        assert_eq!(saturation(f64::NEG_INFINITY, 0.0), -1.0);
        // The quotient overflows, but the result does not.
        assert_eq!(saturation(1e300, 1e-300), 1.0);
        for (s, width) in [(f64::NAN, 0.1), (f64::NAN, 0.0), (0.1, f64::NAN), (0.0, f64::NAN)] {
            assert!(saturation(s, width).is_nan());
            assert!(reaching_law(s, 1.0, 1.0, width).is_nan());
        }
    }

    /// The surface is reached in finite time, ln(1 + K |S0| / eps) / K (integral of the reaching law with a sign
    /// function; Gao and Hung 1993). Tolerance: a few Euler steps of 1e-5 s.
    #[test]
    fn surface_is_reached_at_the_predicted_time() {
        let (rate, gain, start, dt) = (4.0, 0.05, 0.3, 1e-5);
        let mut s: f64 = start;
        let mut time = 0.0;
        while s > 0.0 {
            s += dt * reaching_law(s, rate, gain, 0.0);
            time += dt;
        }
        let expected = (1.0 + rate * start / gain).ln() / rate;
        assert!((time - expected).abs() < 10.0 * dt);
    }

    /// With S(0) = 0, the error stays on the surface and decays as exp(-zeta t). Tolerance: first-order error of Euler
    /// steps of 1e-5 s.
    #[test]
    fn error_decays_on_the_surface() {
        let (zeta, dt, steps) = (1.5, 1e-5, 100_000);
        let mut error: f64 = 0.1;
        let mut integral = -error / zeta;
        for _ in 0..steps {
            let s = integral_surface(error, integral, zeta);
            let error_rate = reaching_law(s, 4.0, 0.02, 0.01) - zeta * error;
            integral += dt * error;
            error += dt * error_rate;
        }
        let expected = 0.1 * (-zeta * dt * steps as f64).exp();
        assert!((error - expected).abs() < 1e-5 * 0.1);
        assert!(integral_surface(error, integral, zeta).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn saturation_is_odd_bounded_and_monotone(s in -10.0..10.0f64, ds in 0.0..1.0f64, width in -1.0..5.0f64) {
            let y = saturation(s, width);
            prop_assert!((-1.0..=1.0).contains(&y));
            prop_assert_eq!(y, -saturation(-s, width));
            prop_assert!(saturation(s + ds, width) >= y);
        }

        #[test]
        fn reaching_law_always_points_to_the_surface(
            s in -10.0..10.0f64, rate in 0.0..10.0f64, gain in 0.0..10.0f64, width in -1.0..5.0f64,
        ) {
            let law = reaching_law(s, rate, gain, width);
            prop_assert!(s * law <= 0.0);
            prop_assert_eq!(law, -reaching_law(-s, rate, gain, width));
        }
    }
}
