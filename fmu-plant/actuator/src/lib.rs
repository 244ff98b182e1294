//! `Actuator`: follows any command with a lag, at a limited rate and within a range. The README has the equations.

#[cfg(test)]
mod tests;

use fmu::prelude::*;

/// Symbols as in the README.
#[derive(Parameters, Clone, Debug)]
pub struct Actuator {
    /// T: time constant of the lag
    #[var("actuator.time_constant", unit = "s", start = 0.01, positive, display = "ms")]
    t: f64,
    /// r: greatest rate, in the unit of the command per second
    #[var("actuator.rate_limit", unit = Unit::NONE, start = 1e9, positive, tunable)]
    r: f64,
    /// x_min: least value, in the unit of the command
    #[var("actuator.minimum", unit = Unit::NONE, start = -1e9)]
    x_min: f64,
    /// x_max: greatest value, in the unit of the command
    #[var("actuator.maximum", unit = Unit::NONE, start = 1e9)]
    x_max: f64,
    /// x_0: value at the start, in the unit of the command
    #[var("actuator.initial_value", unit = Unit::NONE, start = 0.0)]
    x_0: f64,
}

/// The command.
#[derive(Inputs, Clone, Debug)]
pub struct U<T> {
    /// Command to follow
    #[var("actuator.command", unit = Unit::NONE)]
    u: T,
}

/// State and output.
#[derive(State, Clone, Debug)]
pub struct X<T> {
    /// Value of the actuator, in the unit of the command
    #[var("actuator.value", unit = Unit::NONE, nominal = 1.0, calculated)]
    x: T,
}

/// Limits a value to the range.
fn within<T: Scalar>(p: &Actuator, value: T) -> T {
    Scalar::clamp(value, T::from(p.x_min), T::from(p.x_max))
}

/// Follows any command with a lag, at a limited rate and within a range
#[fmu::model(stop_time = 2.0, step_size = 0.001)]
impl Continuous for Actuator {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Derived = ();

    fn derived(&self) -> Result<(), String> {
        if self.x_min <= self.x_max {
            return Ok(());
        }
        Err(format!("'actuator.minimum' = {} must not exceed 'actuator.maximum' = {}", self.x_min, self.x_max))
    }
    fn initialize(&self, (): &(), state: &mut X<f64>) {
        state.x = within(self, self.x_0);
    }
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        X { x: Scalar::clamp((within(self, at.inputs.u) - at.state.x) / self.t, T::from(-self.r), T::from(self.r)) }
    }
    fn advance(&self, at: At<f64, Self>, step: f64) -> X<f64> {
        let (x, u) = (at.state.x, at.inputs.u);
        // The value changes at the greatest rate until the error is r T, and then follows the lag.
        let target = within(self, u);
        let e = target - x;
        let h_r = (e.abs() / self.r - self.t).max(0.0);
        if step <= h_r {
            return X { x: x + (self.r * step).copysign(e) };
        }
        X { x: target - e.abs().min(self.r * self.t).copysign(e) * fmu::math::exp((h_r - step) / self.t) }
    }
}
