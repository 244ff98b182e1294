//! Linear models and steady states of FMUs with continuous states.
//!
//! [`mod@linearize`] makes linear models, [`trim`] finds steady states; [`worker`] does both in processes that may
//! crash.

pub mod linearize;
pub mod trim;
#[cfg(not(target_family = "wasm"))]
pub mod worker;

/// Compiles the example in the readme.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
