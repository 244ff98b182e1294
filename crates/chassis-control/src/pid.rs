//! Incremental PID.

/// Gains of [`increment`], in the unit of the result per unit of the error. They act per sample, so they include the
/// sample time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// K_p.
    pub proportional: f64,
    /// K_i.
    pub integral: f64,
    /// K_d.
    pub derivative: f64,
}

/// Increment of a PID law from one sample to the next:
///
/// ```text
/// du(k) = K_p (e(k) - e(k-1)) + K_i e(k) + K_d (e(k) - 2 e(k-1) + e(k-2))
/// ```
///
/// `errors`: e(k), e(k-1), e(k-2). If all errors before the first sample are 0, the sum of the increments is u(k) = K_p
/// e(k) + K_i sum e + K_d (e(k) - e(k-1)). The caller adds up the increments and can limit the sum, or let it leak, to
/// prevent windup.
///
/// ```
/// use chassis_control::pid::{Gains, increment};
/// let gains = Gains { proportional: 1.0, integral: 0.5, derivative: 0.25 };
/// assert_eq!(increment(gains, [2.0, 0.0, 0.0]), 3.5);
/// ```
pub fn increment(gains: Gains, errors: [f64; 3]) -> f64 {
    let [e, e1, e2] = errors;
    gains.proportional * (e - e1) + gains.integral * e + gains.derivative * (e - 2.0 * e1 + e2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The sum of the increments is the positional PID law. Tolerance: a few rounding errors of sums up to 1e3.
        #[test]
        fn increments_add_up_to_the_positional_law(
            gains in prop::array::uniform3(-5.0..5.0f64), errors in prop::collection::vec(-3.0..3.0f64, 1..30),
        ) {
            let [proportional, integral, derivative] = gains;
            let gains = Gains { proportional, integral, derivative };
            let (mut u, mut past) = (0.0, [0.0, 0.0]);
            for &e in &errors {
                u += increment(gains, [e, past[0], past[1]]);
                past = [e, past[0]];
            }
            let expected = proportional * past[0] + integral * errors.iter().sum::<f64>() + derivative * (past[0] - past[1]);
            prop_assert!((u - expected).abs() < 1e-11, "{} {}", u, expected);
        }
    }

    #[test]
    fn nan_stays_nan() {
        let gains = Gains { proportional: 1.0, integral: 1.0, derivative: 1.0 };
        for place in 0..3 {
            let mut errors = [1.0; 3];
            errors[place] = f64::NAN;
            assert!(increment(gains, errors).is_nan());
        }
    }
}
