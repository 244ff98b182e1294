//! Exports a model, declared once in Rust, as an FMI 2.0 co-simulation FMU.
//!
//! A model consists of structs (parameters, inputs, outputs, state) whose fields carry name, unit, start value and
//! description of every variable, and of pure functions: a [`Plant`] is an ordinary differential equation, an
//! [`Advancing`] one knows its solution, a [`Sampled`] unit is an update per sample. [`export!`] makes a library with the whole C interface of them; names,
//! numbers, the model description, saved states, reset and derivatives follow from the declaration.
//!
//! A variable is named by its attribute, or like its field; its unit is a key, or stands in parentheses at the end of the
//! doc comment. All attributes are explained in the crate `fmi2-derive`. [`derive::model`] completes what a model does
//! not say.
//!
//! ```
//! use fmi2::prelude::*;
//!
//! #[derive(Parameters, Clone)]
//! pub struct P {
//!     /// Gain from the input to the output (1)
//!     #[par(start = 2.0, tunable)]
//!     pub gain: f64,
//!     #[par(SAMPLE_TIME, start = 0.01)]
//!     pub sample_time: f64,
//! }
//! #[derive(Inputs, Clone)]
//! pub struct U {
//!     /// What is amplified (m)
//!     pub u: f64,
//! }
//! #[derive(Outputs, Clone)]
//! pub struct Y {
//!     /// The amplified input
//!     #[var("filter.output", unit = M)]
//!     pub y: f64,
//! }
//! pub struct Amplifier;
//! /// Multiplies its input by a gain
//! #[model(stop_time = 1.0, step_size = 0.01)]
//! impl Sampled for Amplifier {
//!     type Parameters = P;
//!     type Inputs = U;
//!     type Outputs = Y;
//!     fn update(p: &P, (): &(), (): &mut (), u: &U, _t: f64) -> Y {
//!         Y { y: p.gain * u.u }
//!     }
//! }
//! fmi2::export!(sampled Amplifier);
//! # fn main() {}
//! ```

// The derives name this crate by its name, also in its own tests.
extern crate self as fmi2;

pub mod abi;
pub mod block;
pub mod calls;
mod clock;
#[doc(hidden)]
pub mod declare;
pub mod description;
pub mod instance;
pub mod model;
pub mod parameters;
pub mod scalar;
pub mod signal;
mod state_bytes;
pub mod unit;
pub mod variable;

pub use block::{Block, Field, Place};
pub use fmi2_derive as derive;
pub use model::{Advancing, Influence, Info, Plant, Sampled};
pub use scalar::{Dual64, Scalar};
pub use signal::{Quantity, Range, Role, Signal};
pub use unit::Unit;

/// What a model file needs.
pub mod prelude {
    pub use crate::block::Field;
    pub use crate::derive::{Design, Inputs, Memory, Mode, Outputs, Parameters, State, model};
    pub use crate::model::{Advancing, Influence, Info, Plant, Sampled};
    pub use crate::parameters::{MAX_STEP, MaxStep, SAMPLE_TIME, SampleTime};
    pub use crate::scalar::Scalar;
    pub use crate::unit::*;
}
