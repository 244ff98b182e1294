use fmu::prelude::*;

#[derive(Parameters)]
pub struct Ball {
    /// Restitution (1)
    #[var(start = 0.7)]
    restitution: f64,
}

#[derive(State)]
pub struct X<T> {
    /// Height (m)
    #[var(start = 1.0)]
    height: T,
    /// Velocity (m/s)
    velocity: T,
}

/// Ball
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Ball {
    type State<T: Scalar> = X<T>;
    type Crossings = [f64; 1];

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        X { height: at.state.velocity, velocity: T::from(-9.81) }
    }
    fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
        [at.state.height]
    }
    fn on_event(&self, event: Event<Self>) {
        if event.fell(0) || event.rose(7) {
            event.state.height = 0.0;
            event.state.velocity *= -self.restitution;
        }
    }
}

fn main() {}
