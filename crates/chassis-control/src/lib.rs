//! Control laws: those without a vehicle, and the parts that several controllers share.
//!
//! Everything here is a pure function of `f64` values (or a small value built once from them):
//! no state is hidden, no FMI type appears, and nothing that runs once per sample allocates.
//! A controller keeps its own state and calls these functions in the order of its equations.
//!
//! | module | what it gives | when it runs |
//! |---|---|---|
//! | [`riccati`] | linear quadratic regulators: algebraic Riccati equation with cross term | once, at initialization |
//! | [`fuzzy`] | Mamdani inference with one or two inputs | every sample |
//! | [`fuzzy_pid`] | PID controller with gains by fuzzy rules | every sample |
//! | [`sliding_mode`] | integral sliding surface, reaching law, boundary layer | every sample |
//! | [`limit`] | limits of magnitude and rate, exact step of a first-order lag | every sample |
//! | [`switch`] | hysteresis | every sample |
//! | [`pid`] | increments of a PID law | every sample |
//! | [`semi_active`] | the part of a force that an adjustable damper can produce | every sample |
//! | [`front_steering`] | limits of the front axle of a three-axle vehicle | every sample |
//! | [`lqr_suspension`] | linear quadratic design of the suspension of a three-axle vehicle | once, at initialization |
//!
//! # Numbers that are not finite
//!
//! The functions that run every sample never panic. Where an argument is NaN the result is NaN:
//! an invalid value is passed to the output, where the caller finds it, and is not turned into a
//! plausible one. Functions that build something return a [`Result`] with the reason of an error.

pub mod front_steering;
pub mod fuzzy;
pub mod fuzzy_pid;
pub mod limit;
pub mod lqr_suspension;
pub mod pid;
pub mod riccati;
pub mod semi_active;
pub mod sliding_mode;
pub mod switch;
