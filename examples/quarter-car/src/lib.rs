//! `QuarterCar`: the smallest complete plant, as an example. Its README has the equations.

use fmi2::prelude::*;

/// What acts on the car.
#[derive(Inputs, Clone)]
pub struct U<T> {
    /// Height of the road (m)
    pub z_r: T,
    /// Force of the actuator, up on the body and down on the wheel (N)
    pub f_a: T,
}

/// Body and wheel.
#[derive(State, Clone)]
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

/// What is felt.
#[derive(Outputs, Clone)]
pub struct Y<T> {
    /// Acceleration of the body (m/s2)
    pub a_s: T,
}

/// The plant.
pub struct QuarterCar;

/// Quarter car: body, suspension with an actuator, wheel, tire
#[model(stop_time = 10.0, step_size = 0.001)]
impl Plant for QuarterCar {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    fn derivatives<T: Scalar>(_: &MaxStep, (): &(), x: &X<T>, u: &U<T>) -> X<T> {
        let f = (x.z_s - x.z_u) * 20_000.0 + (x.v_s - x.v_u) * 1_500.0 - u.f_a;
        X { z_s: x.v_s, v_s: -f / 400.0, z_u: x.v_u, v_u: (f - (x.z_u - u.z_r) * 180_000.0) / 40.0 }
    }
    fn outputs<T: Scalar>(p: &MaxStep, (): &(), x: &X<T>, u: &U<T>) -> Y<T> {
        Y { a_s: Self::derivatives(p, &(), x, u).v_s }
    }
}

fmi2::export!(plant QuarterCar);
