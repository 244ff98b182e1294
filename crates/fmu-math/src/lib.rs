#![doc = include_str!("../README.md")]
#![cfg_attr(not(any(feature = "std", test)), no_std)]

mod bits;
mod coefficients;
mod exponential;
mod inverse;
mod lanes;
mod logarithm;
mod power;
mod trigonometric;

pub use exponential::{cosh, cosh_each, exp, exp_each, sinh, sinh_each, tanh, tanh_each};
pub use inverse::{acos, acos_each, asin, asin_each, atan, atan_each, atan2, atan2_each};
pub use logarithm::{ln, ln_each};
pub use power::{hypot, hypot_each, pow, pow_each, powi};
pub use trigonometric::{cos, cos_each, sin, sin_cos, sin_cos_each, sin_each, tan, tan_each};
