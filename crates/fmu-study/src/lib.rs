//! Optimizes parameters of FMUs in a scenario.
//!
//! A [`study`] names a scenario, the parameters with their ranges, inequalities they must fulfill, an objective made of
//! recorded signals, and one or more methods. The modules, from the bottom up:
//!
//! - [`ahp`] turns judgments into weights, `expression` checks inequalities, [`space`] defines the ranges,
//! - [`pacsa`], [`genetic`] and [`cma_es`] search. They do not depend on FMUs: they only use
//!   [`Evaluate::evaluate`](search::Evaluate::evaluate), which takes a population and returns its objectives,
//! - [`simulation`] computes objectives by runs of the FMUs on all processors, [`journal`] keeps every evaluation on
//!   disk, so that a resumed study is bit-identical,
//! - [`execute`](execution::execute) runs a study and writes the results.
//!
//! # Evaluations
//! Every candidate that a method requests is an evaluation and counts against the budget, even if it is not run because
//! it violates a constraint or was tried before. A candidate that violates a constraint, or whose run fails, exceeds a
//! limit or gives no finite objective, gets the study's `penalty` as its objective and is marked in the history. It
//! never stops the study.
//!
//! # Reproducibility
//! The result is a function of the study, the scenario and the FMUs, bit-identical for any number of threads: every
//! individual of every generation has its own random numbers, and sums are computed in the order of the runs.

pub mod ahp;
pub mod cma_es;
pub mod execution;
mod expression;
pub mod genetic;
pub mod journal;
pub mod pacsa;
pub mod search;
pub mod simulation;
pub mod space;
pub mod study;
