//! Exports a model, declared once in Rust, as an FMU: FMI 2.0 or 3.0, co-simulation and model exchange.
//!
//! A model consists of structs and pure functions. The fields of the structs declare name, unit, start value and
//! description of every variable. The struct with the parameters implements one of three traits:
//!
//! | trait | model | examples |
//! |---|---|---|
//! | [`Continuous`] | x' = f(t, x, u), with or without events | vehicle, motor, heat exchanger |
//! | [`Discrete`] | an update at each sample | controller, filter, signal source |
//! | [`Stateful`] | an existing simulation that advances itself | anything that can be cloned |
//!
//! [`model`](macro@model) fills in the items that you leave out and exports the model. Value references, the model
//! description, saved states, reset and derivatives are generated from the declaration. `cargo fmu pack` writes the
//! FMU.
//!
//! # A model and its test
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
//!
//! // A test can run the model without an FMU. The results are bit-identical to those of the FMU.
//! // Without damping, the model is a harmonic oscillator: x = 2 cos t.
//! # fn main() -> Result<(), String> {
//! let mut run = fmu::simulation::ContinuousSimulation::new(VanDerPol { mu: 0.0 })?;
//! while run.time() < 10.0 {
//!     run.step(&(), 0.01)?;
//! }
//! assert!((run.state().x - 2.0 * run.time().cos()).abs() < 1e-8);
//! # Ok(()) }
//! ```
//!
//! See [`simulation`]. Each derive lists the attributes of its fields: [`Parameters`](derive@prelude::Parameters),
//! [`Inputs`](derive@prelude::Inputs), [`Outputs`](derive@prelude::Outputs), [`State`](derive@prelude::State),
//! [`Derived`](derive@prelude::Derived), [`DiscreteState`](derive@prelude::DiscreteState).
//!
//! # Solvers
//!
//! `#[fmu::model(…, solver = …)]` selects the [`Solver`] of a continuous-time model in co-simulation; in model exchange the
//! importer solves the equations.
//!
//! | solver | method | step | parameter of the FMU | use it for |
//! |---|---|---|---|---|
//! | `RungeKutta` (default) | classical Runge-Kutta, order 4 | equal parts of the communication step | `max_step` | most models: cheap and deterministic |
//! | `DormandPrince { tolerance: 1e-6 }` | Dormand-Prince, order 5(4) | error control | `tolerance` | smooth models whose time constants change |
//! | `Rosenbrock { tolerance: 1e-6 }` | RODAS, order 4(3), with exact Jacobians | error control | `tolerance` | stiff models |
//! | `Exact` | [`Continuous::advance`]; implementing it selects this solver | communication step | none | equations with a solution in closed form |

// The derive macros generate code that refers to this crate as `fmu`, even in the tests of this crate.
extern crate self as fmu;

mod abi;
mod array;
mod bytes;
mod calls;
mod clocks;
mod combinations;
mod comparison;
mod declare;
mod definition;
mod description;
mod discrete_state;
mod dual;
mod enumeration;
mod expression;
mod instance;
mod model;
mod number;
mod relation;
mod runner;
mod scalar;
#[cfg(feature = "serde")]
mod serde;
pub mod simulation;
mod solver;
mod store;
mod table;
mod timeline;
mod unit;
mod variable;
mod variables;

pub use array::{Array, Matrix};
pub use bytes::Bytes;
pub use clocks::{Clock, Tick, TickOf};
pub use definition::{Definition, LEAST_POSITIVE, MAX_STEP, Range, SAMPLE_TIME, TOLERANCE};
pub use discrete_state::{DiscreteState, StateField, Word, Words};
pub use dual::{Dual, Dual64};
pub use enumeration::Enumeration;
#[doc(no_inline)]
pub use fmu_derive as derive;
pub use fmu_derive::{model, unit};
#[doc(no_inline)]
pub use fmu_math as math;
pub use model::{At, Continuous, Discrete, Event, Influence, Info, Sample, Serialize, Solver, Stateful};
pub use scalar::Scalar;
pub use table::Table;
pub use timeline::slack;
pub use unit::{DisplayUnit, Unit};
pub use variables::{ContinuousState, Derived, Field, Parameters, Variables};

/// Re-exports private modules as public modules with the same names.
macro_rules! open {
    ($($module:ident)*) => {$(
        pub mod $module {
            pub use crate::$module::*;
        }
    )*};
}

/// Items that generated code needs.
#[doc(hidden)]
pub mod __private {
    pub use crate::abi::Export;
    pub use crate::array::Identity;
    pub use crate::clocks::{
        Clocked, ContinuousTick, DiscreteTick, InputClock, Interval, NoTimer, Schedule, Setting, Span, Ticking, Timing,
    };
    pub use crate::declare::*;
    pub use crate::enumeration::Item;
    pub use crate::number::Size;
    pub use crate::store::*;
    pub use crate::variable::{Alias, Declaration, Terminal};
    pub use crate::variables::*;
    pub use crate::*;

    open!(abi calls comparison description enumeration runner);
    #[cfg(feature = "serde")]
    open!(serde);
}

/// Internals for tests and benchmarks, such as instances of a model and its description.
#[cfg(feature = "testing")]
#[doc(hidden)]
pub mod testing {
    open!(abi calls clocks description instance number runner store variable);
}

/// Serialization of a simulation for `#[fmu::model(…, serialize)]`.
#[cfg(feature = "serde")]
#[doc(hidden)]
#[macro_export]
macro_rules! serialize_with_serde {
    () => {
        ::core::option::Option::Some($crate::Serialize {
            save: $crate::__private::serde::to_bytes,
            load: $crate::__private::serde::from_bytes,
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

/// The items that the source file of a model needs.
pub mod prelude {
    pub use crate::derive::{Derived, DiscreteState, Enumeration, Inputs, Outputs, Parameters, State};
    #[doc(no_inline)]
    pub use crate::{
        Array, At, Bytes, Clock, Continuous, Discrete, Event, Influence, MAX_STEP, Matrix, SAMPLE_TIME, Sample, Scalar,
        Solver, Stateful, TOLERANCE, Table, Tick, Unit,
    };
}

/// Compiles and runs the examples in the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
