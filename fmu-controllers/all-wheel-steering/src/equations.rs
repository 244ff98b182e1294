//! One sample of the law: sideslip error, fuzzy PID for the rear axle, fuzzy rules for the middle axle.
//!
//! | symbol | meaning |
//! |---|---|
//! | beta_d, beta | sideslip reference, sideslip angle |
//! | delta | front-axle angle demanded by the driver |
//! | s | smoothed sign of delta |
//! | e, ec | sideslip error (positive if the rear axle has to steer further in the direction of the front axle), its filtered rate |
//! | k1, k2 | angles of the middle and the rear axle, divided by delta |
//! | K_p, K_i, K_d | gains after the correction by fuzzy rules |

use chassis_control::fuzzy::{FuzzyError, LabelMap, Membership, Output, Partition};
use chassis_control::fuzzy_pid::{FuzzyPid, Gains, Settings, filtered_rate};
use chassis_control::sliding_mode::saturation;
use chassis_vehicle::positions::RearAxles;

use crate::{AllWheelSteering, D, U, X, Y};

/// Table 2 of the paper: label of k1 for the labels NB, NM, NS, ZO, PS, PM, PB of k2.
const K1_OF_K2: [usize; 7] = {
    const NM: usize = 1;
    const NS: usize = 2;
    const ZO: usize = 3;
    const PM: usize = 5;
    const PB: usize = 6;
    [NM, NS, NS, ZO, PM, PB, PB]
};

/// The fuzzy rules that give k1 from k2, with triangular sets from -1 to 1.
#[derive(Clone, Debug)]
pub(crate) struct MiddleRatio {
    input: Partition<7>,
    rules: LabelMap<7, 7>,
    output: Output<7>,
}

impl MiddleRatio {
    fn new() -> Result<Self, FuzzyError> {
        let sets = Membership::evenly_spaced_triangles(-1.0, 1.0);
        Ok(Self {
            input: Partition::new(sets)?,
            rules: LabelMap::new(K1_OF_K2)?,
            output: Output::new(sets, -1.0, 1.0, 201)?,
        })
    }

    /// k1 for `k2`, which is limited to -1 to 1.
    pub(crate) fn of(&self, k2: f64) -> f64 {
        self.output.centroid(&self.rules.apply(&self.input.grades(k2.clamp(-1.0, 1.0))))
    }
}

/// Tabulates the rules.
pub(crate) fn derived(p: &AllWheelSteering) -> Result<D, String> {
    let make = || Ok::<_, FuzzyError>(D { pid: FuzzyPid::new(p.rule_table)?, middle: MiddleRatio::new()? });
    make().map_err(|error| error.to_string())
}

pub(crate) fn sample(p: &AllWheelSteering, d: &D, x: &mut X, u: &U) -> Y {
    // k2 multiplies the driver's angle, so the error needs the sign of this angle. Without an angle, k2 has no effect,
    // and the error is 0.
    let s = saturation(u.delta, p.sign_width);
    let e = (u.beta_d - u.beta) * s;
    let previous = if x.has_previous { x.e } else { e };
    let ec = filtered_rate(x.ec, e, previous, p.t_f, p.sample_time);
    (x.e, x.ec, x.has_previous) = (e, ec, true);

    let settings = Settings {
        gains: Gains { proportional: p.kp, integral: p.ki, derivative: p.kd },
        scales: Gains { proportional: p.kp_scale, integral: p.ki_scale, derivative: p.kd_scale },
        error_range: p.error_range,
        rate_range: p.rate_range,
        output_minimum: p.output_minimum,
        output_maximum: p.output_maximum,
        integral_limit: p.integral_limit,
        leak_rate: p.leak_rate,
    };
    let (k2, k) = d.pid.sample(&settings, &mut x.i, e, ec, p.sample_time);
    let ratio = RearAxles([d.middle.of(k2), k2]);
    let delta = RearAxles(ratio.map(|ratio| ratio * u.delta));
    Y { delta, ratio, kp: k.proportional, ki: k.integral, kd: k.derivative }
}
