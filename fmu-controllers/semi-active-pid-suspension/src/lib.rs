//! `SemiActivePidSuspension`: suspension forces that damp the body above each wheel. An incremental PID law accumulates
//! them from the vertical acceleration of the body, limited to the forces that an adjustable damper can produce.
//!
//! Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic stability program on a
//! finite-state basis", eq. 18.
//!
//! | symbol | meaning |
//! |---|---|
//! | a | vertical acceleration of the body above the wheel: now, one (a1) and two (a2) samples earlier |
//! | v | velocity of the suspension |
//! | u | accumulated law, a force that would accelerate the body further |
//! | f_d, f | demanded force, and force of the actuator |
//! | T_s | sample time |

#[cfg(test)]
mod tests;

use std::f64::consts::TAU;

use chassis_control::limit::magnitude;
use chassis_control::pid::{Gains, increment};
use chassis_control::semi_active::dissipative;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Constraint of the actuators.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Constraint {
    /// any force within the limit: active suspension
    None = 0,
    /// forces against the velocity of the suspension only: adjustable dampers
    Dissipative = 1,
}

/// Parameters.
#[derive(Parameters, Clone, Debug)]
pub struct SemiActivePidSuspension {
    /// F_max: largest suspension force, also the limit of the accumulated law (assumed: valve damper of a car)
    #[var("actuator.force_limit", unit = "N", start = 1500.0, min = 0.0, tunable, display = "kN")]
    f_max: f64,
    /// c_add: largest damping that the valve adds (assumed)
    #[var("damper.maximum_added_damping", unit = "N.s/m", start = 3000.0, min = 0.0, tunable, display = "kN.s/m")]
    c_add: f64,
    /// f_leak: frequency below which the accumulated law decays (assumed: prevents drift)
    #[var("pid.leak_frequency", unit = "Hz", start = 0.1, min = 0.0, tunable)]
    f_leak: f64,
    /// Factor on the accumulated law
    #[var("pid.output_gain", unit = "1", start = 1.0, tunable)]
    gain: f64,
    /// Capability of the actuators
    #[var("constraint", start = Constraint::Dissipative)]
    constraint: Constraint,
    /// T_s (assumed: the paper's gains are effective at this value)
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// Gains, and measurements at each wheel.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(ENABLE_SUSPENSION)]
    enable: bool,
    #[var(SUSPENSION_PROPORTIONAL_GAIN)]
    k_p: FourWheels<f64>,
    #[var(SUSPENSION_INTEGRAL_GAIN)]
    k_i: FourWheels<f64>,
    #[var(SUSPENSION_DERIVATIVE_GAIN)]
    k_d: FourWheels<f64>,
    #[var(CORNER_ACCELERATION)]
    a: FourWheels<f64>,
    #[var(SUSPENSION_VELOCITY)]
    v: FourWheels<f64>,
}

/// Suspension forces.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(SUSPENSION_FORCE)]
    f: FourWheels<f64>,
}

/// The accumulated law of each wheel, and the last two accelerations.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    u: [f64; 4],
    a1: [f64; 4],
    a2: [f64; 4],
}

/// Semi-active suspension of a car: accumulated incremental PID of the body's acceleration above each wheel, limited to
/// the forces of a damper
#[fmu::model(stop_time = 6.0, step_size = 0.001)]
impl Discrete for SemiActivePidSuspension {
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn update(&self, sample: Sample<Self>) -> Y {
        let (x, inputs) = (sample.state, sample.inputs);
        if !inputs.enable {
            *x = X { u: [0.0; 4], a1: *inputs.a, a2: *inputs.a };
            return Y { f: FourWheels([0.0; 4]) };
        }
        let leak = fmu::math::exp(-TAU * self.f_leak * self.sample_time);
        let f = FourWheels::from_fn(|i| {
            let (a, v) = (inputs.a[i], inputs.v[i]);
            let gains = Gains { proportional: inputs.k_p[i], integral: inputs.k_i[i], derivative: inputs.k_d[i] };
            let u = magnitude(leak * x.u[i] + increment(gains, [a, x.a1[i], x.a2[i]]), self.f_max);
            x.u[i] = u;
            (x.a2[i], x.a1[i]) = (x.a1[i], a);
            let f_d = -self.gain * u;
            match self.constraint {
                Constraint::None => f_d,
                Constraint::Dissipative => dissipative(f_d, v, self.f_max.min(self.c_add * v.abs())),
            }
        });
        Y { f }
    }
}
