//! Exports a model, declared once in Rust, as an FMU: FMI 2.0 or 3.0, co-simulation and model exchange.
//!
//! A model consists of structs whose fields carry name, unit, start value and description of every variable, and of pure
//! functions. The struct with the parameters is the model; it implements one of three traits:
//!
//! | trait | model | examples |
//! |---|---|---|
//! | [`Continuous`] | x' = f(t, x, u), perhaps with events | vehicle, motor, heat exchanger |
//! | [`Discrete`] | an update at each sample | controller, filter, signal source |
//! | [`Stateful`] | an existing simulation that advances itself | anything that can be cloned |
//!
//! [`model`](macro@model) adds what a model does not have and exports it; names, numbers, the model description, saved states,
//! reset and derivatives follow from the declaration. `cargo fmu pack` writes the FMU.
//!
//! ```
//! use fmu::prelude::*;
//!
//! /// Parameters
//! #[derive(Parameters)]
//! pub struct VanDerPol {
//!     /// Damping (1)
//!     #[var(start = 1.0, tunable)]
//!     mu: f64,
//! }
//!
//! #[derive(State)]
//! pub struct X<T> {
//!     /// Position (m)
//!     #[var(start = 2.0)]
//!     x: T,
//!     /// Velocity (m/s)
//!     v: T,
//! }
//!
//! /// Van der Pol oscillator
//! #[fmu::model(stop_time = 20.0, step_size = 0.01)]
//! impl Continuous for VanDerPol {
//!     type State<T: Scalar> = X<T>;
//!     fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
//!         let &X { x, v } = at.state;
//!         X { x: v, v: (-x * x + 1.0) * self.mu * v - x }
//!     }
//! }
//! ```
//!
//! All attributes of a field are listed in the crate `fmu-derive`.

// The derives name this crate by its name, also in its own tests.
extern crate self as fmu;

pub mod abi;
pub mod calls;
mod clock;
mod combinations;
#[doc(hidden)]
pub mod comparison;
#[doc(hidden)]
pub mod declare;
pub mod definition;
pub mod description;
pub mod discrete_state;
mod dual;
pub mod enumeration;
mod expression;
pub mod instance;
pub mod model;
mod relation;
pub mod runner;
pub mod scalar;
#[cfg(feature = "serde")]
pub mod serde;
pub mod simulation;
mod solver;
mod state_bytes;
mod store;
mod table;
pub mod unit;
pub mod variable;
pub mod variables;

pub use abi::Export;
pub use definition::{Definition, Range};
pub use discrete_state::DiscreteState;
pub use dual::{Dual, Dual64};
pub use enumeration::Enumeration;
pub use fmu_derive as derive;
pub use fmu_derive::{model, unit};
#[doc(inline)]
pub use fmu_math as math;
pub use model::{At, Continuous, Discrete, Event, Influence, Info, Sample, Serialize, Solver, Stateful};
pub use scalar::Scalar;
pub use table::Table;
pub use unit::Unit;
pub use variables::{Derived, Field, Parameters, Variables};

/// Serialization of a simulation for `#[fmu::model(…, serialize)]`.
#[cfg(feature = "serde")]
#[doc(hidden)]
#[macro_export]
macro_rules! serialize_with_serde {
    () => {
        ::core::option::Option::Some($crate::Serialize {
            save: $crate::serde::to_bytes,
            load: $crate::serde::from_bytes,
        })
    };
}

#[cfg(not(feature = "serde"))]
#[doc(hidden)]
#[macro_export]
macro_rules! serialize_with_serde {
    () => {
        ::core::compile_error!("`serialize` needs the feature `serde` of the crate `fmu`")
    };
}

/// Items that a model file needs.
pub mod prelude {
    pub use crate::definition::{MAX_STEP, SAMPLE_TIME, TOLERANCE};
    pub use crate::derive::{Derived, DiscreteState, Enumeration, Inputs, Outputs, Parameters, State};
    pub use crate::model::{At, Continuous, Discrete, Event, Influence, Sample, Solver, Stateful};
    pub use crate::scalar::Scalar;
    pub use crate::table::Table;
    pub use crate::unit::Unit;
}

/// The examples of the README are compiled and run.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
