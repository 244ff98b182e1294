//! Control laws that do not depend on a vehicle, and parts that several controllers share.
//!
//! Everything here is a pure function of `f64` values, or a small value built once from them, without hidden state or FMI
//! types. Functions called once per sample do not allocate. A controller keeps its own state and calls these functions
//! in the order of its equations.
//!
//! | module | contents | runs |
//! |---|---|---|
//! | [`riccati`] | linear quadratic regulators: algebraic Riccati equation with cross term | once, at initialization |
//! | [`fuzzy`] | Mamdani inference with one or two inputs | every sample |
//! | [`fuzzy_pid`] | PID controller whose gains follow fuzzy rules | every sample |
//! | [`sliding_mode`] | integral sliding surface, reaching law, boundary layer | every sample |
//! | [`limit`] | limits on magnitude and rate, exact step of a first-order lag | every sample |
//! | [`switch`] | hysteresis | every sample |
//! | [`pid`] | increments of a PID law | every sample |
//! | [`semi_active`] | the part of a force that an adjustable damper can produce | every sample |
//! | [`front_steering`] | limits for the front axle of a three-axle vehicle | every sample |
//! | [`lqr_suspension`] | linear quadratic design for the suspension of a three-axle vehicle | once, at initialization |
//!
//! # Numbers that are not finite
//!
//! The functions that run every sample never panic. If an argument is NaN, the result is NaN: an invalid value reaches
//! the output, where the caller finds it, instead of becoming a plausible one. Functions that build a value return a
//! [`Result`] with the cause of an error.

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
