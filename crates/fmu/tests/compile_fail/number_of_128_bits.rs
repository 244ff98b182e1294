use fmu::prelude::*;

/// Law of the controller
#[derive(Enumeration, Clone, Copy)]
pub enum Law {
    /// Proportional
    Linear,
    /// Progressive
    Progressive = 2,
}

#[derive(Parameters)]
pub struct Gain {
    /// Gain (1)
    #[var(start = 1.0)]
    k: f64,
    /// Law
    #[var(start = Law::Linear)]
    law: Law,
    /// Order
    #[var(start = 2, min = 1, max = 4)]
    order: i32,
    /// Active
    #[var(start = true)]
    on: bool,
    /// Limits (1)
    #[var(start = [-1.0, 1.0], min = -5.0, max = 5.0)]
    limits: [f64; 2],
}

#[derive(Inputs)]
pub struct U {
    /// Control error (1)
    u: u128,
}

#[derive(Outputs)]
pub struct Y {
    /// Command (1)
    y: f64,
}

#[derive(DiscreteState, Clone, Default)]
pub struct Memory {
    integral: f64,
}

#[derive(Derived)]
pub struct Rates {
    /// Rate (1/s)
    #[var]
    rate: f64,
}

/// Gain
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Gain {
    type State = Memory;
    type Inputs = U;
    type Outputs = Y;
    type Derived = Rates;

    fn derived(&self) -> Result<Rates, String> {
        Ok(Rates { rate: self.k })
    }
    fn update(&self, sample: Sample<Self>) -> Y {
        sample.state.integral += sample.inputs.u as f64;
        Y { y: self.k * sample.state.integral }
    }
}

fn main() {}
