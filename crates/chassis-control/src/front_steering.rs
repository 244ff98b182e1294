//! Limits for the front axle of a three-axle vehicle. The axle follows the driver within three limits: the largest
//! angle, the angle at which a steady turn has the largest lateral acceleration, and the largest rate.
//!
//! | symbol | meaning |
//! |---|---|
//! | u | speed |
//! | df | angle of the front axle |
//! | a, -b, -c | positions of the axles relative to the center of mass, positive forward |
//! | C_F, C_M, C_R | cornering stiffness of the axles (two tires each), positive |
//! | W_F | load of the front axle at rest |
//! | T | sample time |
//!
//! Chen, Gong, Zhao, Liu, Jia, Mathematics 2022, 10, 3562: eqs. 14 and 15 for the yaw rate of a steady turn.

use crate::limit;
use chassis_vehicle::statics;
use fmu::prelude::*;

/// Steady turn on which the yaw rate reference is based.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReferenceModel {
    /// rear axles straight: the ordinary two-degree-of-freedom model
    TwoDegreesOfFreedom = 0,
    /// all axles steer so that there is no sideslip
    ZeroSideslip = 1,
}

/// A three-axle vehicle in a steady turn.
#[derive(Clone, Copy, Debug)]
pub struct Vehicle {
    /// Mass, kg.
    pub m: f64,
    /// Gravity, m/s2.
    pub g: f64,
    /// Distance of the front axle in front of the center of mass, m.
    pub a: f64,
    /// Distance of the middle axle behind the center of mass, m.
    pub b: f64,
    /// Distance of the rear axle behind the center of mass, m.
    pub c: f64,
    /// Cornering stiffness of each axle, N/rad.
    pub c_axle: [f64; 3],
    /// Load of the front axle at rest, N.
    pub w_f: f64,
}

impl Vehicle {
    /// Creates a vehicle with the mass `m` and the gravity `g`. The distances are from the center of mass to the front
    /// axle, then from axle to axle; `c_tire` is the cornering stiffness of one tire of each axle.
    ///
    /// # Errors
    /// The static load of the front axle is not positive.
    pub fn new(m: f64, g: f64, [a, l12, l23]: [f64; 3], c_tire: [f64; 3]) -> Result<Self, String> {
        let (b, c) = (l12 - a, l12 + l23 - a);
        let [w_f, ..] = statics::three_axle_loads(m, g, [a, -b, -c]);
        if w_f <= 0.0 {
            return Err(format!(
                "'geometry.cg_to_front_axle' = {a} m puts the center of mass too far from the front axle: the load of \
                 the front axle at rest would be {w_f:.0} N"
            ));
        }
        Ok(Self { m, g, a, b, c, c_axle: c_tire.map(|tire| 2.0 * tire), w_f })
    }

    /// Yaw rate in a steady turn, divided by the front-axle angle (with zero sideslip: by its tangent), 1/s.
    pub fn yaw_rate_gain(&self, model: ReferenceModel, u: f64) -> f64 {
        let Self { a, b, c, c_axle: [c_f, c_m, c_r], .. } = *self;
        match model {
            ReferenceModel::ZeroSideslip => u / (a + self.w_f / self.g * u * u / c_f),
            ReferenceModel::TwoDegreesOfFreedom => {
                let a1 = c_f + c_m + c_r;
                let a2 = a * c_f - b * c_m - c * c_r;
                let a3 = a * a * c_f + b * b * c_m + c * c * c_r;
                // An oversteering vehicle has a critical speed. The lower limit keeps the gain finite at and above this
                // speed.
                let den = (a1 * a3 - a2 * a2 - a2 * self.m * u * u).max(0.05 * a1 * a3);
                c_f * (a * a1 - a2) * u / den
            }
        }
    }
}

/// Limits for the front axle.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Model of the steady turn to which the lateral acceleration limit applies.
    pub model: ReferenceModel,
    /// Largest lateral acceleration, m/s2.
    pub ay_limit: f64,
    /// Largest angle, rad.
    pub angle: f64,
    /// Largest rate, rad/s; 0 or less means no limit.
    pub rate: f64,
}

/// Result of one sample.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Yaw rate gain, see [`Vehicle::yaw_rate_gain`].
    pub gain: f64,
    /// Yaw rate at the largest lateral acceleration, rad/s.
    pub r_max: f64,
    /// Angle of the front axle, rad.
    pub df: f64,
}

impl Limits {
    /// Largest angle of the front axle, rad: the angle limit, or the angle at which a steady turn has the yaw rate
    /// `r_max`.
    pub fn angle_at(&self, gain: f64, r_max: f64) -> f64 {
        let f_lim = match self.model {
            ReferenceModel::ZeroSideslip => fmu::math::atan(r_max / gain),
            ReferenceModel::TwoDegreesOfFreedom => r_max / gain,
        };
        f_lim.min(self.angle)
    }

    /// Limits the demanded angle `steer` at the speed `u` > 0; `last` is the angle one sample time `t` earlier.
    pub fn sample(&self, vehicle: &Vehicle, steer: f64, u: f64, last: f64, t: f64) -> Sample {
        let gain = vehicle.yaw_rate_gain(self.model, u);
        let r_max = self.ay_limit / u;
        let df = limit::rate(limit::magnitude(steer, self.angle_at(gain, r_max)), last, self.rate, t);
        Sample { gain, r_max, df }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_abs_diff_eq;
    use chassis_vehicle::data::rescue_vehicle as data;

    const KM_H: f64 = 1.0 / 3.6;

    fn vehicle(tire: [f64; 3]) -> Vehicle {
        let axles = [data::CG_TO_FRONT, data::FRONT_TO_MIDDLE, data::MIDDLE_TO_REAR];
        Vehicle::new(data::MASS, data::GRAVITY, axles, tire).unwrap()
    }

    fn rescue_vehicle() -> Vehicle {
        vehicle([data::CORNERING_STIFFNESS; 3])
    }

    #[test]
    fn yaw_rate_gains_and_front_limits_have_the_check_numbers() {
        // Computed by an independent implementation: gains in 1/s to 6 decimals, limits in degrees to 4.
        let expected = [
            (5.0, 0.543544, 0.321808, 32.0),
            (15.0, 1.454898, 0.965424, 31.6931),
            (25.0, 1.994858, 1.609040, 15.1198),
            (35.0, 2.206037, 2.252655, 9.8995),
        ];
        let limits =
            Limits { model: ReferenceModel::ZeroSideslip, ay_limit: 3.743, angle: 32.0_f64.to_radians(), rate: 0.0 };
        for (speed, zero_sideslip, two_degrees_of_freedom, limit) in expected {
            let u = speed * KM_H;
            let gain = rescue_vehicle().yaw_rate_gain(ReferenceModel::ZeroSideslip, u);
            assert_abs_diff_eq!(gain, zero_sideslip, epsilon = 1e-6);
            assert_abs_diff_eq!(limits.angle_at(gain, 3.743 / u).to_degrees(), limit, epsilon = 1e-4);
            let gain = rescue_vehicle().yaw_rate_gain(ReferenceModel::TwoDegreesOfFreedom, u);
            assert_abs_diff_eq!(gain, two_degrees_of_freedom, epsilon = 1e-6);
        }
    }

    #[test]
    fn the_ordinary_gain_is_that_of_a_single_track_model() {
        // Neutral vehicle: u a/(a^2 + b^2 + c^2) (closed form of eqs. 14, 15 with A2 = 0). Tolerance: rounding.
        let neutral = rescue_vehicle();
        let Vehicle { a, b, c, .. } = neutral;
        let u = 35.0 * KM_H;
        let closed = u * a / (a * a + b * b + c * c);
        let gain = neutral.yaw_rate_gain(ReferenceModel::TwoDegreesOfFreedom, u);
        assert_abs_diff_eq!(gain / closed, 1.0, epsilon = 1e-14);
        // For an oversteering vehicle beyond its critical speed, A1 A3 - A2^2 - A2 m u^2 is replaced by 5 % of A1 A3.
        let oversteering = vehicle([6e5, 3e5, 1e5]);
        let Vehicle { a, b, c, c_axle: [c_f, c_m, c_r], m, .. } = oversteering;
        let (a1, a2) = (c_f + c_m + c_r, a * c_f - b * c_m - c * c_r);
        let a3 = a * a * c_f + b * b * c_m + c * c * c_r;
        assert!(a1 * a3 - a2 * a2 - a2 * m * 400.0 < 0.0);
        let floor = c_f * (a * a1 - a2) * 20.0 / (0.05 * a1 * a3);
        let gain = oversteering.yaw_rate_gain(ReferenceModel::TwoDegreesOfFreedom, 20.0);
        assert_abs_diff_eq!(gain / floor, 1.0, epsilon = 1e-14);
    }

    #[test]
    fn data_without_a_steady_turn_are_rejected() {
        let tire = [data::CORNERING_STIFFNESS; 3];
        let axles = [6.0, data::FRONT_TO_MIDDLE, data::MIDDLE_TO_REAR];
        assert_eq!(
            Vehicle::new(data::MASS, data::GRAVITY, axles, tire).unwrap_err(),
            "'geometry.cg_to_front_axle' = 6 m puts the center of mass too far from the front axle: the load of the \
             front axle at rest would be -167313 N"
        );
        // m g/3 (closed form for equal loads). Tolerance: rounding.
        assert_abs_diff_eq!(rescue_vehicle().w_f, 117_720.0, epsilon = 1e-9);
    }
}
