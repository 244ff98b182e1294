//! The derives of the crate `fmi2`. Each turns a struct into a block of variables; every mistake is a compile error
//! at the place where it was made.
//!
//! # Attributes of a field
//!
//! | derive | attribute | description of the variable |
//! |---|---|---|
//! | `Parameters` | `#[par("name", unit = U, start = …)]` | the doc comment |
//! | `Parameters` | `#[par(QUANTITY, start = …)]`, an entry of a parameter catalogue | that of the entry; a doc comment is added |
//! | `Parameters` | `#[parameters]`: a block of parameters shared by several models | those of its fields |
//! | `Inputs`, `Outputs`, `State` | `#[signal(SIGNAL)]`, an entry of the signal catalogue | that of the entry; a doc comment is added |
//! | `Inputs`, `Outputs`, `State` | `#[var("name", unit = U)]`, a variable of this unit alone | the doc comment |
//! | `Inputs`, `Outputs`, `State` | none: the same as `#[var]`, with the name of the field and the unit as below | the doc comment |
//! | `Design` | `#[calculated("name", unit = U)]`; fields without it are not shown | the doc comment |
//! | `Memory` | `#[generated]`: finite by construction, not searched for other values | |
//!
//! Without `"name"` a variable is named like its field. Without `unit` the doc comment ends with it, in parentheses:
//! `/// Height of the road (m)`; `(1)` means none. Units are those of `fmi2::unit`.
//!
//! A state is an output of the FMU; with the flag `local` it is a local variable.
//!
//! More keys of a variable: `min`, `max`, `nominal` (usual magnitude; states of a plant should have one),
//! `display = "deg"`, and the flags `positive` (at least `fmi2::signal::LEAST_POSITIVE`) and `tunable` (may change
//! between steps). A switch is a `bool`, a text a `String`, a whole number an `i32` (with `min` and `max`), a choice an
//! enum with `#[derive(Mode)]` and the flag `mode`.
//! `start` is one number for all places of a family, or an array with one per place.

mod attribute;
mod block;
mod mode;
mod model;

use proc_macro::TokenStream;
use syn::{DeriveInput, parse_macro_input};

macro_rules! derives {
    ($($(#[$doc:meta])* $name:ident($($attribute:ident),*) = $function:expr;)*) => {$(
        $(#[$doc])*
        #[proc_macro_derive($name, attributes($($attribute),*))]
        #[allow(non_snake_case)]
        pub fn $name(input: TokenStream) -> TokenStream {
            let input = parse_macro_input!(input as DeriveInput);
            $function(&input).unwrap_or_else(syn::Error::into_compile_error).into()
        }
    )*};
}

derives! {
    /// The parameters of a model. Also implements `Default` (the start values), and `HasSampleTime` or `HasMaxStep`
    /// for a struct with the field `sample_time` or `max_step`.
    Parameters(par, parameters) = block::parameters;
    /// The inputs of a model. Also implements `Default` (the start values).
    Inputs(signal, var) = |input| block::numbers(input, false);
    /// The outputs of a model that are not states. Also implements `Default` (the start values).
    Outputs(signal, var) = |input| block::numbers(input, false);
    /// The continuous state of a plant. The states are outputs of the FMU but for those with the flag `local`. Also
    /// implements `Default` (the start values).
    State(signal, var) = |input| block::numbers(input, true);
    /// What follows from the fixed parameters.
    Design(calculated) = block::design;
    /// What a sampled unit remembers.
    Memory(generated) = block::memory;
    /// A choice among named values: an enum whose variants have a doc comment and may have a number.
    Mode() = mode::mode;
}

/// Completes `impl Plant for …` or `impl Sampled for …`: name (that of the type), description (the doc comment) and
/// version of the FMU, default experiment (the keys, in s), and what a small model leaves out: `Parameters` are then
/// `MaxStep` or `SampleTime`, and `Design` and `Memory` empty.
/// The documentation of the crate `fmi2` has an example.
#[proc_macro_attribute]
pub fn model(arguments: TokenStream, item: TokenStream) -> TokenStream {
    model::model(arguments.into(), item.into()).unwrap_or_else(syn::Error::into_compile_error).into()
}
