use fmi2::prelude::*;

#[derive(Parameters, Clone)]
pub struct P {
    #[par(SAMPLE_TIME, start = 0.01, tunable)]
    pub sample_time: f64,
}

fn main() {}
