//! `QuarterCar`: the smallest complete vehicle. Its README has the equations.

use fmu::prelude::*;

/// Quarter car without parameters.
#[derive(Parameters)]
pub struct QuarterCar;

/// Inputs.
#[derive(Inputs)]
pub struct U<T> {
    /// Height of the road (m)
    pub z_r: T,
    /// Force of the actuator, up on the body and down on the wheel (N)
    pub f_a: T,
}

/// Body and wheel.
#[derive(State)]
pub struct X<T> {
    /// Height of the body (m)
    pub z_s: T,
    /// Velocity of the body (m/s)
    pub v_s: T,
    /// Height of the wheel (m)
    pub z_u: T,
    /// Velocity of the wheel (m/s)
    pub v_u: T,
}

/// Outputs that are not states.
#[derive(Outputs)]
pub struct Y<T> {
    /// Acceleration of the body (m/s2)
    pub a_s: T,
}

/// Quarter car: body, suspension with an actuator, wheel, tire
#[fmu::model(stop_time = 10.0, step_size = 0.001)]
impl Continuous for QuarterCar {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    fn evaluate<T: Scalar>(&self, at: At<T, Self>) -> (X<T>, Y<T>) {
        let (x, u) = (at.state, at.inputs);
        let f = (x.z_s - x.z_u) * 20_000.0 + (x.v_s - x.v_u) * 1_500.0 - u.f_a;
        let a_s = -f / 400.0;
        (X { z_s: x.v_s, v_s: a_s, z_u: x.v_u, v_u: (f - (x.z_u - u.z_r) * 180_000.0) / 40.0 }, Y { a_s })
    }
}
