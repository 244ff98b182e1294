//! Feasible part of the force demanded from a semi-active actuator: an adjustable damper can only dissipate.

/// The part of `force` that a damper can produce: it opposes the velocity and does not exceed `limit`.
///
/// ```text
/// v > 0: f = min(max(force, -limit), 0)      v < 0: f = max(min(force, limit), 0)      v = 0: f = 0
/// ```
///
/// `force`: demanded force, N; a positive force lengthens the damper. `velocity`: rate of the damper's length, m/s.
/// `limit`: largest force, N, such as the largest damping times |v|; a negative limit is treated as 0. NaN gives NaN.
///
/// ```
/// use chassis_control::semi_active::dissipative;
/// assert_eq!(dissipative(-300.0, 0.1, 200.0), -200.0);
/// assert_eq!(dissipative(300.0, 0.1, 200.0), 0.0);
/// ```
pub fn dissipative(force: f64, velocity: f64, limit: f64) -> f64 {
    if force.is_nan() || velocity.is_nan() || limit.is_nan() {
        return f64::NAN;
    }
    let limit = limit.max(0.0);
    if velocity > 0.0 {
        force.clamp(-limit, 0.0)
    } else if velocity < 0.0 {
        force.clamp(0.0, limit)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn edges_and_nan() {
        assert_eq!(dissipative(5.0, 0.0, 1.0), 0.0);
        assert_eq!(dissipative(-5.0, 1.0, -1.0), 0.0);
        assert_eq!(dissipative(-5.0, 1.0, f64::INFINITY), -5.0);
        for bad in 0..3 {
            let mut x = [1.0; 3];
            x[bad] = f64::NAN;
            assert!(dissipative(x[0], x[1], x[2]).is_nan());
        }
    }

    proptest! {
        #[test]
        fn power_is_never_put_in(force in -1e4..1e4f64, velocity in -2.0..2.0f64, limit in 0.0..5e3f64) {
            let f = dissipative(force, velocity, limit);
            prop_assert!(f * velocity <= 0.0 && f.abs() <= limit && f.abs() <= force.abs());
            prop_assert_eq!(f, -dissipative(-force, -velocity, limit));
        }
    }
}
