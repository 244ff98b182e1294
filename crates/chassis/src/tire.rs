//! Lateral tire laws. A positive slip angle gives a force to the right, so the forces have the sign of -alpha
//! (ISO 8855).

use fmi2::Scalar;

/// F_y = -C alpha: Chen et al., Mathematics 2022, 10, 3562, eq. 7.
///
/// `c`: cornering stiffness of the tire in N/rad, > 0; `alpha`: slip angle in rad. Valid for small slip angles.
#[inline]
pub fn linear<T: Scalar>(c: f64, alpha: T) -> T {
    -alpha * c
}

/// F_y = -mu N tanh(C alpha / (mu N)): the linear law with its force limited by friction.
///
/// `mu_n`: friction coefficient times tire load in N; the force is 0 where it is not above 1 N (a tire in the air).
#[inline]
pub fn saturating<T: Scalar>(c: f64, mu_n: T, alpha: T) -> T {
    let least = T::from(1.0);
    let loaded = Scalar::max(mu_n, least);
    mu_n.if_greater(least, -loaded * (alpha * c / loaded).tanh(), T::from(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_saturating_law_has_the_linear_slope_and_the_friction_limit() {
        // Closed forms: slope C at the origin (relative error alpha^2 (C/(mu N))^2 / 3 = 1e-9), limit mu N.
        let slope = -saturating(3e5, 4e4, 1e-5) / 1e-5;
        assert!((slope / 3e5 - 1.0).abs() < 2e-9, "{slope}");
        assert_eq!(saturating(3e5, 4e4, -10.0), 4e4);
        assert_eq!(saturating(3e5, 1.0, 0.1), 0.0);
        assert_eq!(saturating(3e5, -5.0, 0.1), 0.0);
    }
}
