//! `ReferenceBouncingBall`: a model of the Reference FMUs of the Modelica Association, with its names. The README has the
//! equations.

use fmu::prelude::*;

/// Velocity below which the ball stops, m/s.
pub const V_MIN: f64 = 0.1;

/// Parameters.
#[derive(Parameters)]
pub struct ReferenceBouncingBall {
    /// Gravity acting on the ball (m/s2)
    #[var(start = -9.81, quantity = "Acceleration")]
    pub g: f64,
    /// Coefficient of restitution
    #[var(unit = Unit::NONE, start = 0.7, min = 0.5, max = 1.0, tunable)]
    pub e: f64,
}

/// A constant.
#[derive(Derived)]
pub struct Constants {
    /// Velocity below which the ball stops bouncing (m/s)
    #[var(constant = V_MIN, quantity = "Velocity")]
    pub v_min: f64,
}

/// Flight.
#[derive(State)]
pub struct Flight<T> {
    /// Position of the ball (m)
    #[var(
        start = 1.0,
        nominal = 1.0,
        quantity = "Position",
        alias("h_ft", display = "ft", description = "Position in feet")
    )]
    pub h: T,
    /// Velocity of the ball (m/s)
    #[var(start = 0.0, nominal = 1.0, quantity = "Velocity")]
    pub v: T,
}

/// State that changes at events only.
#[derive(DiscreteState, Clone, Default)]
pub struct Contact {
    /// Whether the ball has stopped bouncing.
    pub at_rest: bool,
}

/// Trajectory of a ball dropped from a height of 1 m
#[fmu::model(stop_time = 3.0, step_size = 0.01)]
impl Continuous for ReferenceBouncingBall {
    type State<T: Scalar> = Flight<T>;
    type DiscreteState = Contact;
    type Derived = Constants;
    type Crossings = [f64; 1];

    fn derived(&self) -> Result<Constants, String> {
        Ok(Constants { v_min: V_MIN })
    }
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Flight<T> {
        Flight { h: at.state.v, v: T::from(if at.discrete.at_rest { 0.0 } else { self.g }) }
    }
    fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
        [at.state.h]
    }
    fn on_event(&self, event: Event<Self>) {
        let rebound = -self.e * event.state.v;
        event.discrete.at_rest = rebound < event.derived.v_min;
        *event.state = Flight { h: 0.0, v: if event.discrete.at_rest { 0.0 } else { rebound } };
    }
}
