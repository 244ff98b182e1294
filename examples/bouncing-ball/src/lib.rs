//! `BouncingBall`: an event found by its zero crossing. The README has the equations.

use fmu::prelude::*;

/// Parameters.
#[derive(Parameters)]
pub struct BouncingBall {
    /// Acceleration of gravity (m/s2)
    #[var(start = 9.81, positive)]
    pub g: f64,
    /// Coefficient of restitution (1)
    #[var(start = 0.7, min = 0.0, max = 1.0)]
    pub restitution: f64,
    /// Rebound velocity below which the ball comes to rest (m/s)
    #[var(start = 0.01, positive)]
    pub least_velocity: f64,
}

/// Flight.
#[derive(State)]
pub struct Flight<T> {
    /// Height (m)
    #[var(start = 1.0, nominal = 1.0)]
    pub height: T,
    /// Velocity, positive upward (m/s)
    #[var(nominal = 1.0)]
    pub velocity: T,
}

/// Contact with the ground: changes at events, and is an output.
#[derive(Outputs, DiscreteState, Clone)]
pub struct Contact {
    /// Number of bounces
    pub bounces: i32,
    /// Whether the ball lies on the ground
    pub at_rest: bool,
}

/// Bouncing ball that comes to rest
#[fmu::model(stop_time = 3.0, step_size = 0.01)]
impl Continuous for BouncingBall {
    type State<T: Scalar> = Flight<T>;
    type Outputs<T: Scalar> = Contact;
    type DiscreteState = Contact;
    type Crossings = [f64; 1];

    fn evaluate<T: Scalar>(&self, at: At<T, Self>) -> (Flight<T>, Contact) {
        let acceleration = if at.discrete.at_rest { 0.0 } else { -self.g };
        (Flight { height: at.state.velocity, velocity: T::from(acceleration) }, at.discrete.clone())
    }
    fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
        [at.state.height]
    }
    fn on_event(&self, event: Event<Self>) {
        let rebound = -self.restitution * event.state.velocity;
        let at_rest = rebound < self.least_velocity;
        *event.state = Flight { height: 0.0, velocity: if at_rest { 0.0 } else { rebound } };
        *event.discrete = Contact { bounces: event.discrete.bounces + 1, at_rest };
    }
}
