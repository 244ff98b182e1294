use fmi2::prelude::*;

#[derive(Memory, Clone, Default)]
pub struct Memory {
    pub past: Vec<f64>,
}

fn main() {}
