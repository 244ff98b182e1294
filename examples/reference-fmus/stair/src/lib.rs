//! `Stair`: a model of the Reference FMUs of the Modelica Association, with its names. It counts the seconds and ends the
//! simulation.

use fmu::prelude::*;

/// Value of the counter with which the simulation ends.
pub const LAST: i32 = 10;

/// Parameters.
#[derive(Parameters)]
pub struct Stair;

/// Outputs.
#[derive(Outputs)]
pub struct Y {
    /// counts the seconds
    #[var(max = LAST)]
    pub counter: i32,
}

/// State that changes at events only.
#[derive(DiscreteState, Clone, Default)]
pub struct Seconds {
    /// Start of the simulation, s.
    start: f64,
    /// 1 at the start.
    counter: i32,
}

/// This model generates a stair signal using time events
#[fmu::model(stop_time = 10.0, step_size = 0.2)]
impl Continuous for Stair {
    type Outputs<T: Scalar> = Y;
    type DiscreteState = Seconds;

    fn initial_discrete_state(&self, at: At<f64, Self>) -> Seconds {
        Seconds { start: at.time, counter: 1 }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y {
        Y { counter: at.discrete.counter }
    }
    fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
        Some(at.discrete.start + f64::from(at.discrete.counter))
    }
    fn on_event(&self, event: Event<Self>) {
        event.discrete.counter += 1;
    }
    fn is_finished(&self, discrete: &Seconds) -> bool {
        discrete.counter >= LAST
    }
}
