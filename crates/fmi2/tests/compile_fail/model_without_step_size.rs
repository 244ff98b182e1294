use fmi2::prelude::*;

pub struct Amplifier;

/// Multiplies its input by a gain
#[model(stop_time = 1.0)]
impl Sampled for Amplifier {}

fn main() {}
