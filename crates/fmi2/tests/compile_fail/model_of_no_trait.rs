use fmi2::prelude::*;

pub struct Amplifier;

/// Multiplies its input by a gain
#[model(stop_time = 1.0, step_size = 0.01)]
impl Amplifier {}

fn main() {}
