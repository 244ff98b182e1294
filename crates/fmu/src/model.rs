//! The traits that a model author implements: for a continuous-time model, a discrete-time model, or a stateful one.

use std::path::Path;

use crate::discrete_state::DiscreteState;
use crate::scalar::Scalar;
use crate::variables::{ContinuousState, Derived, Parameters, Variables};

/// Facts about a model that are not variables. [`model`](macro@crate::model) takes them from its arguments, the doc comment
/// and the manifest of the package.
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// Name of the FMU: model identifier, file stem and name of the library.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// Version of the package.
    pub version: &'static str,
    /// Authors of the package, separated by colons.
    pub authors: &'static str,
    /// License of the package, an SPDX expression.
    pub license: &'static str,
    /// Home page of the package.
    pub homepage: &'static str,
    /// Length of the default experiment in s.
    pub stop_time: f64,
    /// Communication step of the default experiment in s.
    pub step_size: f64,
    /// The folder `resources` of the package, which tests read; empty in a packed library.
    pub resources: &'static str,
}

/// Solver of a continuous-time model: advances the state from one communication point to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solver {
    /// The classical Runge-Kutta method of order 4 (Kutta 1901) in equal steps not longer than the parameter `max_step`.
    RungeKutta,
    /// The pair of orders 5 and 4 of Dormand and Prince (1980) with error control; the parameter `tolerance` starts with
    /// this value.
    DormandPrince {
        /// Relative tolerance.
        tolerance: f64,
    },
    /// The linearly implicit method RODAS of order 4 (Hairer, Wanner 1996) with error control, for stiff models; the parameter
    /// `tolerance` starts with this value.
    Rosenbrock {
        /// Relative tolerance.
        tolerance: f64,
    },
    /// [`Continuous::advance`], the solution in closed form.
    Exact,
}

/// Point at which the equations of a continuous-time model are evaluated.
#[derive(Debug)]
pub struct At<'a, T: Scalar, M: Continuous> {
    /// Time in s.
    pub time: T,
    /// State.
    pub state: &'a M::State<T>,
    /// Inputs; held during a communication step.
    pub inputs: &'a M::Inputs<T>,
    /// Derived parameters.
    pub derived: &'a M::Derived,
    /// Discrete state; changes at events only.
    pub discrete: &'a M::DiscreteState,
}

impl<T: Scalar, M: Continuous> Clone for At<'_, T, M> {
    #[inline]
    fn clone(&self) -> Self {
        *self
    }
}
impl<T: Scalar, M: Continuous> Copy for At<'_, T, M> {}

/// An event: its cause, and the values that it may change.
#[derive(Debug)]
pub struct Event<'a, M: Continuous> {
    /// Time in s.
    pub time: f64,
    /// State; may be changed.
    pub state: &'a mut M::State<f64>,
    /// Discrete state; may be changed.
    pub discrete: &'a mut M::DiscreteState,
    /// Inputs.
    pub inputs: &'a M::Inputs<f64>,
    /// Derived parameters.
    pub derived: &'a M::Derived,
    /// True if the time of [`Continuous::next_time_event`] has come.
    pub is_timed: bool,
    pub(crate) before: &'a [f64],
    pub(crate) after: &'a [f64],
}

impl<M: Continuous> Event<'_, M> {
    /// Returns true if the zero crossing of this index went from positive or zero to negative.
    ///
    /// # Panics
    /// If the model has no zero crossing of this index.
    #[must_use]
    pub fn fell(&self, index: usize) -> bool {
        self.changed(index) && self.after[index] < 0.0
    }

    /// Returns true if the zero crossing of this index went from negative to positive or zero.
    ///
    /// # Panics
    /// If the model has no zero crossing of this index.
    #[must_use]
    pub fn rose(&self, index: usize) -> bool {
        self.changed(index) && self.after[index] >= 0.0
    }

    fn changed(&self, index: usize) -> bool {
        let count = size_of::<M::Crossings>() / size_of::<f64>();
        assert!(
            index < count,
            "there is no zero crossing {index}: `type Crossings` has the length {count} and counts from 0"
        );
        // A time event has no such values.
        self.before.get(index).zip(self.after.get(index)).is_some_and(|(before, after)| is_crossing(*before, *after))
    }
}

/// Returns true if a quantity has crossed zero. Zero belongs to the positive side.
pub(crate) fn is_crossing(before: f64, after: f64) -> bool {
    (before >= 0.0) != (after >= 0.0)
}

/// A continuous-time model: x' = derivatives(t, x, u), y = outputs(t, x, u). The struct that implements it holds the
/// parameters.
///
/// The equations are generic over the number type: the same function simulates, computes exact directional derivatives, and
/// finds the dependencies of every result. Write either [`Self::derivatives`] and [`Self::outputs`], or [`Self::evaluate`],
/// which returns both. [`model`](macro@crate::model) adds items that a model does not have.
pub trait Continuous: Parameters {
    /// Facts about the model.
    const INFO: Info;
    /// Solver of the state.
    const SOLVER: Solver = Solver::RungeKutta;
    /// True if [`Self::next_time_event`] is implemented.
    const HAS_TIME_EVENTS: bool = false;
    /// The fields of `self` that the equations read; `None` if they pass on `self`, so that they may read any. The attribute
    /// [`model`](macro@crate::model) sets it; [`Self::derived`], [`Self::load`] and [`Self::initialize`] do not count.
    const EQUATIONS_READ: Option<&'static [&'static str]> = None;
    /// The continuous state; also the type of its time derivative.
    type State<T: Scalar>: ContinuousState<T>;
    /// The inputs.
    type Inputs<T: Scalar>: Variables<T>;
    /// The outputs that are not states.
    type Outputs<T: Scalar>: Variables<T>;
    /// Derived parameters.
    type Derived: Derived;
    /// Values that change at events only.
    type DiscreteState: DiscreteState + Clone + Default + Send;
    /// The quantities whose zero crossings are events, `[f64; N]`.
    type Crossings: AsRef<[f64]>;

    /// Computes the derived parameters. It is called again after a tunable parameter has changed.
    ///
    /// # Errors
    /// A sentence that names the parameter, its value and the rule.
    fn derived(&self) -> Result<Self::Derived, String>;
    /// Like [`Self::derived`], for a model that reads files: `resources` is the resources folder of the FMU.
    ///
    /// # Errors
    /// As [`Self::derived`].
    fn load(&self, _resources: &Path) -> Result<Self::Derived, String> {
        self.derived()
    }
    /// Hash of the files read by [`Self::load`]; a saved state is restored only with the same files.
    fn fingerprint(_derived: &Self::Derived) -> u64 {
        0
    }
    /// Writes the states with `#[var(calculated)]`; the others keep their start value. Called before the start only, for every change
    /// of a parameter or of a start value.
    ///
    /// The first argument is the result of [`Self::derived`] or [`Self::load`]: write `derived: &D` for `type Derived = D`, and
    /// `(): &()` in a model without derived parameters. The second one is the state, `state: &mut X<f64>`.
    fn initialize(&self, _derived: &Self::Derived, _state: &mut Self::State<f64>) {}
    /// The discrete state at the start, from the state and the inputs at the end of initialization. `at.discrete` holds the
    /// default. A quantity that starts on its positive side has not risen: set here what an event would have set.
    fn initial_discrete_state(&self, _at: At<'_, f64, Self>) -> Self::DiscreteState {
        Self::DiscreteState::default()
    }
    /// Time derivative of the state.
    fn derivatives<T: Scalar>(&self, at: At<'_, T, Self>) -> Self::State<T>;
    /// Outputs for the present state and inputs.
    fn outputs<T: Scalar>(&self, at: At<'_, T, Self>) -> Self::Outputs<T>;
    /// Derivatives and outputs together.
    #[inline]
    fn evaluate<T: Scalar>(&self, at: At<'_, T, Self>) -> (Self::State<T>, Self::Outputs<T>) {
        (self.derivatives(at), self.outputs(at))
    }

    /// State after the step `step` in s, > 0, for held inputs; the solver of the model ([`Solver::Exact`]).
    fn advance(&self, at: At<'_, f64, Self>, _step: f64) -> Self::State<f64> {
        at.state.copied()
    }
    /// Quantities whose sign changes are state events. Their time is found to a part in 10^15 of the integration step.
    ///
    /// # Panics
    /// Not called unless the model has [`Self::Crossings`].
    fn zero_crossings(&self, _at: At<'_, f64, Self>) -> Self::Crossings {
        unreachable!("the model declares `type Crossings` without `fn zero_crossings`")
    }
    /// Time of the next time event in s. An event that is due at `at.time` happens at once, and again until none is due. A time
    /// before `at.time` is an error.
    fn next_time_event(&self, _at: At<'_, f64, Self>) -> Option<f64> {
        None
    }
    /// Handles an event: may change the state and the discrete state.
    fn on_event(&self, _event: Event<'_, Self>) {}
}

/// Takes the name of an output of a source and that of a parameter: `true` if the output depends on the parameter at
/// any time of a run with any values of the other parameters. Tools read it from the model structure.
pub type Influence = fn(output: &str, parameter: &str) -> bool;

/// A sample of a discrete-time model.
#[derive(Debug)]
pub struct Sample<'a, M: Discrete> {
    /// Time in s.
    pub time: f64,
    /// Discrete state; may be changed.
    pub state: &'a mut M::State,
    /// Inputs, as they were set before the step.
    pub inputs: &'a M::Inputs,
    /// Derived parameters.
    pub derived: &'a M::Derived,
}

/// A discrete-time model: a controller, or a source of signals. The struct that implements it holds the parameters.
///
/// Sample n is due at start + n * `sample_time`. It reads the inputs as they were set before the step, and its outputs are
/// held until the next sample. A model without a field `sample_time` gets the parameter; it starts with `step_size`.
pub trait Discrete: Parameters {
    /// Facts about the model.
    const INFO: Info;
    /// The inputs.
    type Inputs: Variables<f64>;
    /// The outputs; their start values hold until the first sample, except in a source.
    type Outputs: Variables<f64>;
    /// Discrete state, kept from one sample to the next.
    type State: DiscreteState + Clone + Default + Send;
    /// Derived parameters.
    type Derived: Derived;

    /// `Some` makes the model a source: from Initialization Mode on its outputs have the values of [`Self::start`], those of its first
    /// sample.
    const SOURCE: Option<Influence> = None;
    /// Dependencies of outputs of [`Self::start`] on inputs, both by name; tools read them from the model structure.
    const FOLLOWS: Influence = |_, _| false;

    /// Computes the derived parameters. It is called again after a tunable parameter has changed.
    ///
    /// # Errors
    /// A sentence that names the parameter, its value and the rule.
    fn derived(&self) -> Result<Self::Derived, String>;
    /// Outputs of a source until its first sample: those of that sample, unless the model has others. The inputs that they depend on are
    /// in [`Self::FOLLOWS`]. The state of the run begins with the first step.
    fn start(&self, time: f64, derived: &Self::Derived, inputs: &Self::Inputs) -> Self::Outputs {
        let state = &mut self.initial_state(derived);
        self.update(Sample { time, state, inputs, derived })
    }
    /// Like [`Self::derived`], for a model that reads files: `resources` is the resources folder of the FMU.
    ///
    /// # Errors
    /// As [`Self::derived`].
    fn load(&self, _resources: &Path) -> Result<Self::Derived, String> {
        self.derived()
    }
    /// Hash of the files read by [`Self::load`]; a saved state is restored only with the same files.
    fn fingerprint(_derived: &Self::Derived) -> u64 {
        0
    }
    /// The discrete state at the start.
    fn initial_state(&self, _derived: &Self::Derived) -> Self::State {
        Self::State::default()
    }
    /// Checks a sample before it is taken: a model that cannot follow every finite input rejects the step here.
    ///
    /// # Errors
    /// A sentence that names the input, its value and the rule.
    fn check(&self, _sample: &Sample<'_, Self>) -> Result<(), String> {
        Ok(())
    }
    /// Takes one sample.
    fn update(&self, sample: Sample<'_, Self>) -> Self::Outputs;
}

/// A stateful model: an existing simulation that advances itself. The struct that implements it holds the parameters.
///
/// The exporter only requires that the simulation can be cloned, which saves and restores its state.
pub trait Stateful: Parameters {
    /// Facts about the model.
    const INFO: Info;
    /// The inputs.
    type Inputs: Variables<f64>;
    /// The outputs.
    type Outputs: Variables<f64>;
    /// The simulation with all of its state.
    type Simulation: Clone + Send + 'static;
    /// Serialization of the state; `#[fmu::model(…, serialize)]` uses serde.
    const SERIALIZE: Option<Serialize<Self::Simulation>> = None;

    /// Makes the simulation; `resources` is the resources folder of the FMU. Parameters that are tuned after the start reach
    /// [`Self::step`] and [`Self::outputs`] only.
    ///
    /// # Errors
    /// A sentence that names the parameter, its value and the rule.
    fn start(&self, resources: &Path) -> Result<Self::Simulation, String>;
    /// Advances the simulation from `time` to `time + step`, both in s, the inputs held.
    ///
    /// # Errors
    /// The reason why the simulation cannot continue. The instance can then only be reset or set to a saved state.
    fn step(
        &self,
        simulation: &mut Self::Simulation,
        inputs: &Self::Inputs,
        time: f64,
        step: f64,
    ) -> Result<(), String>;
    /// The outputs at the present time.
    fn outputs(&self, simulation: &Self::Simulation) -> Self::Outputs;
}

/// Conversion of the state of a simulation to bytes and back.
#[derive(Debug)]
pub struct Serialize<S> {
    /// Converts a state to bytes.
    pub save: fn(&S) -> Result<Vec<u8>, String>,
    /// Converts bytes to a state.
    pub load: fn(&[u8]) -> Result<S, String>,
}
