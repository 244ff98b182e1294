//! Springs, dampers and tire springs. Deflections are negative in compression (see the crate's documentation).

use fmu::Scalar;

/// Force in newtons of a linear spring and damper in parallel: F = -k d - c dd. It pushes the body up, the wheel down.
///
/// `k`: stiffness in N/m, `c`: damping in N s/m, both >= 0; `d`: suspension deflection in m, `dd`: its rate in m/s.
#[inline]
pub fn spring_damper<T: Scalar>(k: f64, c: f64, d: T, dd: T) -> T {
    -d * k - dd * c
}

/// Load in newtons (compressive force on the road) of a tire that is modeled as a linear spring: N = N_0 - k t.
///
/// `at_rest`: N_0 in N; `k`: vertical stiffness in N/m, > 0; `t`: tire deflection in m. With `lift_off`, the load is 0
/// where the spring would pull, because the tire is in the air.
#[inline]
pub fn tire_load<T: Scalar>(at_rest: f64, k: f64, t: T, lift_off: bool) -> T {
    let load = -t * k + at_rest;
    if lift_off { Scalar::max(load, T::from(0.0)) } else { load }
}

/// Load transfer ratio: the right minus the left tire loads, divided by the sum of all tire loads. It is 0 at rest, and
/// 1 when the left tires lift off in a left turn.
///
/// `left`, `right`: sums of the tire loads in N. If all loads together are at most 1 N (the vehicle is in the air), the
/// ratio is 0.
#[inline]
pub fn load_transfer_ratio<T: Scalar>(left: T, right: T) -> T {
    let least = T::from(1.0);
    let all = left + right;
    all.if_greater(least, (right - left) / Scalar::max(all, least), T::from(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_compressed_strut_pushes_the_body_up() {
        // Closed form; the numbers are exact in binary.
        assert_eq!(spring_damper(35_000.0, 980.0, -0.125, 0.5), 4375.0 - 490.0);
    }

    #[test]
    fn a_tire_pulls_only_without_lift_off() {
        // Closed form; the numbers are exact in binary.
        assert_eq!(tire_load(8000.0, 190_000.0, -0.5, true), 103_000.0);
        assert_eq!(tire_load(8000.0, 190_000.0, 0.5, true), 0.0);
        assert_eq!(tire_load(8000.0, 190_000.0, 0.5, false), -87_000.0);
    }

    #[test]
    fn the_load_transfer_ratio_is_signed_and_finite() {
        assert_eq!(load_transfer_ratio(1000.0, 3000.0), 0.5);
        assert_eq!(load_transfer_ratio(3000.0, 1000.0), -0.5);
        assert_eq!(load_transfer_ratio(0.0, 2000.0), 1.0);
        assert_eq!(load_transfer_ratio(0.0, 0.0), 0.0);
    }
}
