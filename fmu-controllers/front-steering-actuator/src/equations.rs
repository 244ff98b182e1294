//! One sample of the front axle; symbols and equations as in `chassis_control::front_steering`.

use chassis_control::front_steering::{Limits, Vehicle};
use chassis_vehicle::positions::FrontAxle;

use crate::{D, FrontSteeringActuator, U, X, Y};

/// Positions, axle stiffnesses and the load of the front axle.
pub(crate) fn derived(p: &FrontSteeringActuator) -> Result<D, String> {
    let vehicle = Vehicle::new(p.m, p.g, [p.a, p.l12, p.l23], *p.c_tire)?;
    Ok(D { vehicle, w_f: vehicle.w_f })
}

pub(crate) fn sample(p: &FrontSteeringActuator, d: &D, x: &mut X, inputs: &U) -> Y {
    let limits = Limits { model: p.reference_model, ay_limit: p.ay_limit, angle: p.front_limit, rate: p.front_rate };
    let u = inputs.u.max(p.u_min);
    x.df = limits.sample(&d.vehicle, inputs.steer, u, x.df, p.sample_time).df;
    Y { delta: FrontAxle([x.df]) }
}
