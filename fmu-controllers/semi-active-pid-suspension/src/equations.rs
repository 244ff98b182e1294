//! One sample of the suspension law (eq. 18), wheel by wheel.
//!
//! | symbol | meaning |
//! |---|---|
//! | a | vertical acceleration of the body above the wheel: now, one (a1) and two (a2) samples before |
//! | v | velocity of the suspension |
//! | u | accumulated law, a force that would accelerate the body further |
//! | f_d, f | demanded force, and force of the actuator |
//! | T_s | sample time |

use std::f64::consts::TAU;

use chassis_control::limit::magnitude;
use chassis_control::pid::{Gains, increment};
use chassis_control::semi_active::dissipative;
use chassis_vehicle::positions::FourWheels;

use crate::{Constraint, SemiActivePidSuspension, U, X, Y};

pub(crate) fn sample(p: &SemiActivePidSuspension, x: &mut X, inputs: &U) -> Y {
    if !inputs.enable {
        *x = X { u: [0.0; 4], a1: *inputs.a, a2: *inputs.a };
        return Y { f: FourWheels([0.0; 4]) };
    }
    let leak = fmu::math::exp(-TAU * p.f_leak * p.sample_time);
    let f = FourWheels::from_fn(|i| {
        let (a, v) = (inputs.a[i], inputs.v[i]);
        let gains = Gains { proportional: inputs.k_p[i], integral: inputs.k_i[i], derivative: inputs.k_d[i] };
        let u = magnitude(leak * x.u[i] + increment(gains, [a, x.a1[i], x.a2[i]]), p.f_max);
        x.u[i] = u;
        (x.a2[i], x.a1[i]) = (x.a1[i], a);
        let f_d = -p.gain * u;
        match p.constraint {
            Constraint::None => f_d,
            Constraint::Dissipative => dissipative(f_d, v, p.f_max.min(p.c_add * v.abs())),
        }
    });
    Y { f }
}
