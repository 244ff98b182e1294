use fmi2::prelude::*;

#[derive(Parameters, Clone)]
pub struct P {
    /// Gain
    #[par("unit.gain", unit = ONE, start = 1.0)]
    pub k: f64,
}
#[derive(Inputs, Clone)]
pub struct U {
    /// Input
    #[var("unit.input", unit = ONE)]
    pub u: f64,
}
#[derive(Outputs, Clone)]
pub struct Y {
    /// Output
    #[var("unit.output", unit = ONE)]
    pub y: f64,
}

pub struct Gain;

impl Sampled for Gain {
    const INFO: Info = Info { name: "Gain", description: "A gain", version: "1", stop_time: 1.0, step_size: 0.1 };
    type Parameters = P;
    type Design = ();
    type Memory = ();
    type Inputs = U;
    type Outputs = Y;

    fn design(_: &P) -> Result<(), String> {
        Ok(())
    }
    fn update(p: &P, (): &(), (): &mut (), u: &U, _: f64) -> Y {
        Y { y: p.k * u.u }
    }
}

fn main() {}
