use fmu::prelude::*;

#[derive(Parameters)]
pub struct Part {
    /// Mass (kg)
    #[var(start = 1.0)]
    mass: f64,
}

#[derive(Parameters)]
pub struct Cart {
    #[var(nested, terminal = "part")]
    part: Part,
}

#[derive(Inputs)]
pub struct Flange {
    /// Force (N)
    force: f64,
}

#[derive(Inputs)]
pub struct U {
    /// Momentum (kg.m/s)
    #[var(terminal = "shaft")]
    p: f64,
    #[var(nested, terminal = 3)]
    a: Flange,
    #[var(nested, terminal = "")]
    b: Flange,
    #[var(nested, terminal = "c", rule = "all")]
    c: Flange,
    #[var(flatten, rule = "bus")]
    d: Flange,
    #[var(nested, terminal)]
    e: Flange,
}

fn main() {}
