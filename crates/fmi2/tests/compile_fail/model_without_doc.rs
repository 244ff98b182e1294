use fmi2::prelude::*;

pub struct Amplifier;

#[model(stop_time = 1.0, step_size = 0.01)]
impl Sampled for Amplifier {}

fn main() {}
