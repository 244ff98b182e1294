//! The array versions of the functions, with four elements. `tests/instructions.rs` checks the instructions that the
//! compiler generates for them.

use std::hint::black_box;

#[inline(never)]
fn four_sines_and_cosines(x: [f64; 4]) -> ([f64; 4], [f64; 4]) {
    fmu_math::sin_cos_each(x)
}

#[inline(never)]
fn four_arctangents(x: [f64; 4]) -> [f64; 4] {
    fmu_math::atan_each(x)
}

#[inline(never)]
fn four_exponentials(x: [f64; 4]) -> [f64; 4] {
    fmu_math::exp_each(x)
}

#[inline(never)]
fn four_hyperbolic_tangents(x: [f64; 4]) -> [f64; 4] {
    fmu_math::tanh_each(x)
}

fn main() {
    let x = black_box([0.1, 0.2, 0.3, 0.4]);
    println!("{:?}", four_sines_and_cosines(x));
    println!("{:?}", four_arctangents(x));
    println!("{:?}", four_exponentials(x));
    println!("{:?}", four_hyperbolic_tangents(x));
}
