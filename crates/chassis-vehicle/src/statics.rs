//! Vehicles at rest.

/// Loads of three axles under a rigid body on equal springs, N.
///
/// The balances of force and moment determine only two of the three loads. Equal springs make the load a linear
/// function of the axle position, A + D x, with sum (A + D x) = m g and sum x (A + D x) = 0.
///
/// `mass`: m, kg; `gravity`: g, m/s2; `x`: positions of the axles in front of the center of mass, m, not all equal.
/// A load is negative if the axle would have to pull the vehicle down.
pub fn three_axle_loads(mass: f64, gravity: f64, x: [f64; 3]) -> [f64; 3] {
    let s1: f64 = x.iter().sum();
    let s2: f64 = x.iter().map(|x| x * x).sum();
    let a = mass * gravity * s2 / (3.0 * s2 - s1 * s1);
    let d = -a * s1 / s2;
    x.map(|x| a + d * x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::rescue_vehicle as data;

    #[test]
    fn loads_balance_force_and_moment_and_follow_a_straight_line() {
        // The tolerances cover a few roundings of forces of 4e5 N and moments of 2e6 N m.
        let x = [2.1, -0.6, -2.9];
        let [front, middle, rear] = three_axle_loads(36_000.0, 9.81, x);
        assert!((front + middle + rear - 36_000.0 * 9.81).abs() < 1e-9);
        assert!((x[0] * front + x[1] * middle + x[2] * rear).abs() < 1e-8);
        assert!(((front - middle) / (x[0] - x[1]) - (middle - rear) / (x[1] - x[2])).abs() < 1e-9);
    }

    #[test]
    fn the_rescue_vehicle_stands_with_equal_loads() {
        // The center of mass is at the mean position of the axles, so each axle carries m g / 3. The tolerance covers a
        // few roundings.
        let front = data::CG_TO_FRONT;
        let x = [front, front - data::FRONT_TO_MIDDLE, front - data::FRONT_TO_MIDDLE - data::MIDDLE_TO_REAR];
        for load in three_axle_loads(data::MASS, data::GRAVITY, x) {
            assert!((load - 117_720.0).abs() < 1e-9, "{load}");
        }
    }

    #[test]
    fn an_axle_far_from_the_load_would_have_to_pull() {
        assert!(three_axle_loads(1.0, 9.81, [4.0, 3.0, 1.0])[0] < 0.0);
    }
}
