//! Tire laws. A positive slip angle gives a lateral force to the right, which is negative (ISO 8855). A positive
//! longitudinal slip gives a driving force.

use std::array::from_fn;

use fmu::Scalar;

/// F_y = -C alpha: Chen et al., Mathematics 2022, 10, 3562, eq. 7.
///
/// `c`: cornering stiffness of the tire in N/rad, > 0; `alpha`: slip angle in rad. Valid for small slip angles.
#[inline]
pub fn linear<T: Scalar>(c: f64, alpha: T) -> T {
    -alpha * c
}

/// F_y = -mu N tanh(C alpha / (mu N)) for several tires at once: the linear law with its force limited by friction.
///
/// `mu_n`: friction coefficient times tire load in N. If `mu_n` is at most 1 N (a tire in the air), the force is 0.
#[inline]
pub fn saturating_each<T: Scalar, const N: usize>(c: [f64; N], mu_n: [T; N], alpha: [T; N]) -> [T; N] {
    let least = T::from(1.0);
    let loaded = mu_n.map(|mu_n| Scalar::max(mu_n, least));
    let share: [T; N] = T::tanh_each(from_fn(|i| alpha[i] * c[i] / loaded[i]));
    from_fn(|i| mu_n[i].if_greater(least, -loaded[i] * share[i], T::from(0.0)))
}

/// The lateral magic formula: Bakker, Nyborg, Pacejka, "Tyre modelling for use in vehicle dynamics studies", SAE paper
/// 870421, 1987, without camber.
///
/// With the tire load N in kN, the slip angle x in degrees and the force in N:
///
/// ```text
/// D = mu (a1 N^2 + a2 N)      B C D = a3 sin(a4 atan(a5 N))      E = a6 N^2 + a7 N + a8
/// F_y = -D sin(C atan(B x - E (B x - atan(B x))))
/// ```
///
/// mu scales only the peak D; the slope B C D at the origin does not change. The formula is valid for the loads of the
/// fit, 2 to 8 kN for a passenger car. The peak decreases again for loads above -a2/(2 a1). The force is 0 where D is
/// not positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MagicFormula {
    /// Shape factor C.
    pub c: f64,
    /// a1 to a8.
    pub a: [f64; 8],
}

impl MagicFormula {
    /// The passenger car tire used in textbooks.
    pub const PASSENGER_CAR: Self = Self { c: 1.3, a: [-22.1, 1011.0, 1078.0, 1.82, 0.208, 0.0, -0.354, 0.707] };

    /// Lateral forces on several tires in N.
    ///
    /// `mu`: factor on the peak, 1 for the fitted tire; `load`: tire load in N; `alpha`: slip angle in rad.
    #[inline]
    pub fn lateral_each<T: Scalar, const N: usize>(&self, mu: [T; N], load: [T; N], alpha: [T; N]) -> [T; N] {
        let [a1, a2, a3, a4, a5, a6, a7, a8] = self.a;
        let zero = T::from(0.0);
        let least = T::from(1e-6);
        let n = load.map(|load| Scalar::max(load, zero) * 1e-3);
        let peak: [T; N] = from_fn(|i| mu[i] * (n[i] * n[i] * a1 + n[i] * a2));
        let d = peak.map(|peak| Scalar::max(peak, least));
        // B x without the factor sin(a4 atan(a5 N)), whose computation takes as long as this division. Both run at the
        // same time.
        let rest: [T; N] = from_fn(|i| alpha[i] * (180.0 / std::f64::consts::PI * a3 / self.c) / d[i]);
        let e = n.map(|n| n * n * a6 + n * a7 + a8);
        let stiffness = T::sin_each(T::atan_each(n.map(|n| n * a5)).map(|angle| angle * a4));
        let bx: [T; N] = from_fn(|i| stiffness[i] * rest[i]);
        let bent = T::atan_each(bx);
        let curved: [T; N] = from_fn(|i| bx[i] - e[i] * (bx[i] - bent[i]));
        let share = T::sin_each(T::atan_each(curved).map(|angle| angle * self.c));
        from_fn(|i| -Scalar::max(peak[i], zero) * share[i])
    }
}

/// Forces on several tires by Dugoff's law in N: longitudinal, then lateral forces, in the frame of the wheel. Dugoff,
/// Fancher, Segel, "An analysis of tire traction properties and their influence on vehicle dynamic performance", SAE
/// paper 700377, 1970.
///
/// ```text
/// (g_x, g_y) = (C_x s, -C_y t)      D = |g|      N = mu F_z (1 - |s|) / 2
/// (F_x, F_y) = g / (1 - |s|)                     D <= N (the whole contact adheres)
/// (F_x, F_y) = g mu F_z / (2 D) (2 - N / D)      D > N  (part of it slides)
/// ```
///
/// `c`: slip and cornering stiffness C_x in N and C_y in N/rad, >= 0; `mu_n`: friction coefficient times tire load mu
/// F_z in N, where a negative value acts like 0; `s`: longitudinal slip within [-1, 1] (-1 locked); `t`: tangent of the
/// slip angle. The law is continuous, even at s = -1, and the force is never greater than mu F_z.
#[inline]
pub fn dugoff_each<T: Scalar, const N: usize>(c: [[T; N]; 2], mu_n: [T; N], s: [T; N], t: [T; N]) -> [[T; N]; 2] {
    let g_x: [T; N] = from_fn(|i| c[0][i] * s[i]);
    let g_y: [T; N] = from_fn(|i| -c[1][i] * t[i]);
    let factor: [T; N] = from_fn(|i| {
        let mu_n = Scalar::max(mu_n[i], T::from(0.0));
        let rest = -s[i].abs() + 1.0;
        let d2 = g_x[i].squared() + g_y[i].squared();
        let d = d2.sqrt();
        let n = mu_n * rest * 0.5;
        // One division for both cases. A locked wheel in the air has D = N = 0 and is in the adhering case: the floor
        // of 1e-12 avoids 0/0.
        let numerator = d.if_greater(n, mu_n * (d * 2.0 - n), T::from(1.0));
        let sliding = Scalar::max(d2 * 2.0, T::from(1e-30));
        let denominator = d.if_greater(n, sliding, Scalar::max(rest, T::from(1e-12)));
        numerator / denominator
    });
    [from_fn(|i| g_x[i] * factor[i]), from_fn(|i| g_y[i] * factor[i])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use fmu::Dual64;

    fn saturating(c: f64, mu_n: f64, alpha: f64) -> f64 {
        saturating_each([c], [mu_n], [alpha])[0]
    }

    fn dugoff<T: Scalar>(c: [T; 2], mu_n: T, s: T, t: T) -> [T; 2] {
        dugoff_each([[c[0]], [c[1]]], [mu_n], [s], [t]).map(|[force]| force)
    }

    #[test]
    fn the_saturating_law_has_the_linear_slope_and_the_friction_limit() {
        // Closed forms: the slope at the origin is C (with a relative error of alpha^2 (C/(mu N))^2 / 3 = 1e-9), the
        // limit is mu N.
        let slope = -saturating(3e5, 4e4, 1e-5) / 1e-5;
        assert!((slope / 3e5 - 1.0).abs() < 2e-9, "{slope}");
        assert_eq!(saturating(3e5, 4e4, -10.0), 4e4);
        assert_eq!(saturating(3e5, 1.0, 0.1), 0.0);
        assert_eq!(saturating(3e5, -5.0, 0.1), 0.0);
    }

    fn magic(mu: f64, load: f64, alpha: f64) -> f64 {
        MagicFormula::PASSENGER_CAR.lateral_each([mu], [load], [alpha])[0]
    }

    #[test]
    fn the_magic_formula_gives_the_reference_forces() {
        // These values were computed by an independent implementation and printed with 6 decimals.
        let numbers = [
            (0.02, 4817.14, -1206.443245),
            (-0.05, 3153.49, 2174.795431),
            (0.1, 8000.0, -5308.211081),
            (0.03, 1500.0, -833.501125),
        ];
        for (alpha, load, force) in numbers {
            assert!((magic(1.0, load, alpha) - force).abs() < 1e-6, "{alpha} {load}");
        }
    }

    #[test]
    fn the_magic_formula_has_its_slope_and_its_peak() {
        // Closed forms: the slope is B C D for any mu (relative error of the order of (B x)^2 = 1e-8). The greatest
        // force is D; a search in steps of 0.01 deg finds it with a second-order error.
        let load: f64 = 4000.0;
        let slope = 1078.0 * (1.82 * (0.208 * load / 1000.0).atan()).sin() * 180.0 / std::f64::consts::PI;
        for mu in [0.3, 1.0] {
            assert!((-magic(mu, load, 1e-6) / 1e-6 / slope - 1.0).abs() < 1e-8);
            let peak = mu * (-22.1 * 16.0 + 1011.0 * 4.0);
            let greatest =
                (1..6000).map(|i| -magic(mu, load, 0.01_f64.to_radians() * f64::from(i))).fold(0.0, f64::max);
            assert!((greatest / peak - 1.0).abs() < 1e-6, "{greatest} {peak}");
        }
    }

    #[test]
    fn the_magic_formula_is_finite_where_the_peak_is_zero() {
        // In the air, with a pulling load, without friction, and above 45.7 kN, where the formula for the peak is
        // negative.
        for (mu, load) in [(1.0, 0.0), (1.0, -500.0), (0.0, 4000.0), (1.0, 50_000.0)] {
            assert_eq!(magic(mu, load, 0.1), 0.0);
            let (load, alpha) = (Dual64::new(load, 1.0), Dual64::new(0.0, 1.0));
            let [slope] = MagicFormula::PASSENGER_CAR.lateral_each([Dual64::from(mu)], [load], [alpha]);
            assert_eq!((slope.re, slope.eps), (0.0, 0.0));
        }
        // The force has no step at a load of zero.
        assert!(magic(1.0, 0.01, 0.1).abs() < 0.02);
    }

    /// Force on the front tire of `EspCar` at its load at rest and 60 km/h. As in that model, the friction is
    /// 0.77 (1 - 0.015 s/m times the sliding speed), and slip and tangent are relative to a speed with 0.5 m/s added in
    /// quadrature.
    fn front_tire(slip: f64, alpha: f64) -> [f64; 2] {
        let load = 1360.0 * 9.81 * 1.24 / (2.0 * 2.34);
        let speed = 60.0 / 3.6;
        let smooth = speed / f64::hypot(speed, 0.5);
        let sliding = f64::hypot(slip * speed, alpha.tan() * speed);
        dugoff([65_000.0, 38_000.0], 0.77 * (1.0 - 0.015 * sliding) * load, slip * smooth, alpha.tan() * smooth)
    }

    #[test]
    fn dugoff_gives_the_reference_forces() {
        // The expected values were computed by an independent implementation; they are compared to their last printed
        // digit.
        let near = |actual: f64, expected: f64, tolerance: f64| {
            assert!((actual - expected).abs() <= tolerance, "{actual} {expected}");
        };
        near(front_tire(-0.001, 0.0)[0], -65.0358, 5e-5);
        near(front_tire(0.0, 0.001)[1], -37.9829, 5e-5);
        let [x, y] = front_tire(-0.05, 0.05);
        near(x, -1918.394, 5e-4);
        near(y, -1122.458, 5e-4);
        near(front_tire(-0.15, 0.0)[0], -2470.173, 5e-4);
        // Locked: mu F_z. Relative to a speed with 0.5 m/s added in quadrature, the slip is slightly less than 1.
        near(front_tire(-1.0, 0.0)[0], -2041.429, 5e-3);
    }

    proptest::proptest! {
        /// The force stays within the friction circle, opposes the slip and is odd.
        #[test]
        fn dugoff_stays_in_the_friction_circle(
            s in -1.0..=1.0f64, t in -3.0..3.0f64, mu_n in 0.0..5e3f64, c in proptest::array::uniform2(0.0..1e5f64),
        ) {
            let [x, y] = dugoff(c, mu_n, s, t);
            // A few roundings.
            proptest::prop_assert!(x.hypot(y) <= mu_n * (1.0 + 1e-14), "{x} {y}");
            proptest::prop_assert!(x * s >= 0.0 && y * t <= 0.0);
            proptest::prop_assert_eq!(dugoff(c, mu_n, -s, -t), [-x, -y]);
        }
    }

    #[test]
    fn dugoff_is_finite_and_continuous_at_its_edges() {
        // Closed forms: the force is 0 in the air, without friction and without slip; the force on a locked wheel is mu
        // F_z.
        assert_eq!(dugoff([0.0, 0.0], 0.0, -1.0, 0.3), [0.0, 0.0]);
        assert_eq!(dugoff([6e4, 4e4], 0.0, 0.0, 0.0), [0.0, 0.0]);
        assert_eq!(dugoff([6e4, 4e4], -5.0, 0.1, 0.1), [0.0, 0.0]);
        assert_eq!(dugoff([6e4, 4e4], 3000.0, 0.0, 0.0), [0.0, 0.0]);
        assert_eq!(dugoff([6e4, 4e4], 3000.0, -1.0, 0.0)[0], -3000.0);
        // Without lateral slip, sliding begins at C s/(1 - s) = mu F_z/2, where both forms give this force. A step of
        // 1e-9 to either side changes the force by 1e-4 N.
        let edge = 1500.0 / 6e4 / (1.0 + 1500.0 / 6e4);
        let [below, above] = [edge - 1e-9, edge + 1e-9].map(|s| dugoff([6e4, 4e4], 3000.0, s, 0.0)[0]);
        assert!((below - 1500.0).abs() < 1e-3 && (above - below).abs() < 1e-3, "{below} {above}");
        let slope = dugoff(
            [Dual64::from(6e4), Dual64::from(4e4)],
            Dual64::from(3000.0),
            Dual64::new(0.0, 1.0),
            Dual64::from(0.0),
        );
        assert_eq!((slope[0].eps, slope[1].eps), (6e4, 0.0));
    }
}
