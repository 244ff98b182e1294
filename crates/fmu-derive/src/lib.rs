//! The macros of the crate `fmu`. Every mistake is a compile error at its location, and all mistakes in a declaration
//! are reported together.

mod attribute;
mod clocks;
mod comparison;
mod enumeration;
mod errors;
mod forgotten;
mod model;
mod reads;
mod stubs;
mod unattributed;
mod unit;
mod variables;

use proc_macro::TokenStream;
use quote::quote;
use syn::{DeriveInput, LitStr, parse_macro_input};
use variables::Block;

macro_rules! derives {
    ($($(#[$doc:meta])* $name:ident = $function:expr, $stub:expr;)*) => {$(
        $(#[$doc])*
        #[proc_macro_derive($name, attributes(var, fmu))]
        #[allow(non_snake_case)]
        pub fn $name(input: TokenStream) -> TokenStream {
            let input = parse_macro_input!(input as DeriveInput);
            let tokens = $function(&input).unwrap_or_else(|error| {
                let stub = $stub(&input);
                let error = error.into_compile_error();
                quote!(#error #stub)
            });
            tokens.into()
        }
    )*};
}

derives! {
    /// The parameters of a model: the struct that implements the model trait. Also implements `Default` (start values).
    #[doc = include_str!("attributes.md")]
    Parameters = variables::parameters, |input| stubs::variables(input, Block::Parameters);
    /// The inputs of a model. Also implements `Default` (the start values).
    #[doc = include_str!("attributes.md")]
    Inputs = |input| variables::variables(input, Block::Inputs), |input| stubs::variables(input, Block::Inputs);
    /// The outputs of a model that are not states. Also implements `Default` (the start values).
    #[doc = include_str!("attributes.md")]
    Outputs = |input| variables::variables(input, Block::Outputs), |input| stubs::variables(input, Block::Outputs);
    /// The state of a continuous-time model. States are outputs of the FMU unless they have the flag `local`. Also
    /// implements `Default` (the start values).
    #[doc = include_str!("attributes.md")]
    State = |input| variables::variables(input, Block::State), |input| stubs::variables(input, Block::State);
    /// Derived parameters: values that follow from the parameters. Fields with `#[var]` are calculated parameters of
    /// the FMU; other fields are not visible.
    #[doc = include_str!("attributes.md")]
    Derived = variables::derived, |input| stubs::empty(input, "Derived");
    /// Discrete state of a model, kept from one sample or event to the next. It is not visible outside the FMU.
    #[doc = include_str!("attributes.md")]
    DiscreteState = variables::discrete_state, |input| stubs::empty(input, "DiscreteState");
    /// Named values: an enum whose variants have a doc comment and, optionally, a value.
    Enumeration = enumeration::enumeration, stubs::enumeration;
}

/// Completes `impl Continuous for …`, `impl Discrete for …` or `impl Stateful for …` and exports the model.
///
/// The FMU has the name of the type; the doc comment is its description. `stop_time` and `step_size` define the default
/// experiment, in s. Author, license, version and homepage come from the manifest of the package. Leave out inputs,
/// outputs and derived parameters that the model does not have.
///
/// A method with `#[clock(…)]` in `impl Discrete for …` or `impl Continuous for …` runs when its input clock ticks (FMI
/// 3.0): `interval = 1 / 100`, which an importer can set if the clock is also `fixed` or `tunable`; `interval_of =
/// "sample_time"`; both with `shift = 0.5`; `changing, interval = 0.1`; `countdown`; or `triggered`.
///
/// More keys: `name = "…"` sets another name for the FMU, `solver = …` selects a `fmu::Solver`, `serialize` serializes
/// the state of a stateful model with serde, and `crate = path` is the path of the crate `fmu` if the dependency is
/// renamed.
#[proc_macro_attribute]
pub fn model(arguments: TokenStream, item: TokenStream) -> TokenStream {
    model::model(arguments.into(), item.into()).into()
}

/// A unit of measure as a constant, for use in a `fmu::Definition`: `unit!("N.m/rad")`.
#[proc_macro]
pub fn unit(input: TokenStream) -> TokenStream {
    let text = parse_macro_input!(input as LitStr);
    unit::Unit::parse(&text.value(), text.span())
        .map_or_else(syn::Error::into_compile_error, |unit| unit.tokens(&attribute::private(None)))
        .into()
}
