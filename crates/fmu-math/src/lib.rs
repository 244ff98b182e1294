#![doc = include_str!("../README.md")]
#![cfg_attr(not(any(feature = "std", test)), no_std)]

#[cfg(feature = "alloc")]
extern crate alloc;

mod bits;
mod coefficients;
pub mod dense;
#[cfg(feature = "eigenvalues")]
mod eigenvalues;
mod exponential;
mod inverse;
mod lanes;
mod logarithm;
pub mod ode;
mod power;
#[cfg(feature = "alloc")]
pub mod sparse;
mod trigonometric;

#[cfg(feature = "eigenvalues")]
pub use eigenvalues::eigenvalues;
pub use exponential::{cosh, exp, exp_each, sinh, tanh, tanh_each};
pub use inverse::{acos, asin, atan, atan_each, atan2, atan2_each};
pub use logarithm::ln;
pub use power::{hypot, pow, powi};
pub use trigonometric::{cos, cos_each, sin, sin_cos, sin_cos_each, sin_each, tan, tan_each};
