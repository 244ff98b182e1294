use fmi2::prelude::*;

pub struct Amplifier;

/// Multiplies its input by a gain
#[model(stop_time = 1.0, step_size = 0.01)]
impl Sampled for Amplifier {
    const INFO: Info = Info { name: "", description: "", version: "", stop_time: 1.0, step_size: 0.01 };
}

fn main() {}
