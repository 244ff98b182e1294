//! `DcMotorController`: PI control of a speed. The README has the equations.

use fmu::prelude::*;

/// Parameters.
#[derive(Parameters, Clone)]
pub struct DcMotorController {
    /// Proportional gain (V.s/rad)
    #[var(start = 0.2, min = 0.0)]
    pub proportional_gain: f64,
    /// Integral gain (V/rad)
    #[var(start = 1.5, min = 0.0)]
    pub integral_gain: f64,
    /// Greatest magnitude of the voltage (V)
    #[var(start = 24.0, positive)]
    pub voltage_limit: f64,
    #[var(SAMPLE_TIME, start = 0.002)]
    sample_time: f64,
}

/// Inputs.
#[derive(Inputs)]
pub struct U {
    /// Reference speed (rad/s)
    pub reference_speed: f64,
    /// Measured speed (rad/s)
    pub speed: f64,
    /// Whether the controller is on; if off, the voltage is zero and the integral is reset
    #[var(start = true)]
    pub enabled: bool,
}

/// Outputs.
#[derive(Outputs, Clone)]
pub struct Y {
    /// Voltage of the armature (V)
    pub voltage: f64,
    /// Whether the voltage is at its limit
    pub saturated: bool,
}

/// Discrete state.
#[derive(DiscreteState, Clone, Default)]
pub struct X {
    /// Integral of the control error in rad.
    pub integral: f64,
}

/// PI controller of the speed of a DC motor
#[fmu::model(stop_time = 2.0, step_size = 0.002)]
impl Discrete for DcMotorController {
    type Inputs = U;
    type Outputs = Y;
    type State = X;

    fn update(&self, sample: Sample<Self>) -> Y {
        let (x, u) = (sample.state, sample.inputs);
        if !u.enabled {
            *x = X::default();
            return Y::default();
        }
        let error = u.reference_speed - u.speed;
        let voltage = self.proportional_gain * error + self.integral_gain * x.integral;
        let saturated = voltage.abs() > self.voltage_limit;
        // The integral stops at the limit (anti-windup).
        if !saturated {
            x.integral += error * self.sample_time;
        }
        Y { voltage: voltage.clamp(-self.voltage_limit, self.voltage_limit), saturated }
    }
}
