//! The traits that a model implements: for continuous-time, discrete-time and stateful models.

use std::path::Path;

use crate::clocks::{ContinuousTick, InputClock, Schedules};
use crate::discrete_state::DiscreteState;
use crate::scalar::Scalar;
use crate::variables::{ContinuousState, Derived, Parameters, Variables};

/// Metadata of a model. [`model`](macro@crate::model) takes it from its arguments, the doc comment and the manifest.
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
    /// The folder `resources` of the package, for tests; empty in a packed library.
    pub resources: &'static str,
}

/// Solver of a continuous-time model: advances the state from one communication point to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Solver {
    /// The classical Runge-Kutta method of order 4 (Kutta 1901) in equal steps not longer than the parameter `max_step`.
    RungeKutta,
    /// The Dormand-Prince pair of orders 5 and 4 (1980), with error control.
    DormandPrince {
        /// Start value of the parameter `tolerance`, the relative tolerance.
        tolerance: f64,
    },
    /// The linearly implicit method RODAS of order 4 (Hairer, Wanner 1996), with error control, for stiff models.
    Rosenbrock {
        /// Start value of the parameter `tolerance`, the relative tolerance.
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
    /// Inputs, which are constant during a communication step.
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

/// An event: its cause, and the values that [`Continuous::on_event`] may change.
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
    /// True for a time event, false for a zero crossing.
    pub is_timed: bool,
    pub(crate) before: &'a [f64],
    pub(crate) after: &'a [f64],
}

impl<M: Continuous> Event<'_, M> {
    /// Returns true if the quantity `index` of [`Continuous::zero_crossings`] went from positive or zero to negative.
    /// Panics if there is no quantity with this index.
    #[must_use]
    pub fn fell(&self, index: usize) -> bool {
        self.changed(index) && self.after[index] < 0.0
    }

    /// Returns true if the quantity `index` of [`Continuous::zero_crossings`] went from negative to positive or zero.
    /// Panics if there is no quantity with this index.
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
        // For a time event, `before` and `after` are empty.
        self.before.get(index).zip(self.after.get(index)).is_some_and(|(before, after)| is_crossing(*before, *after))
    }
}

/// Returns true if a quantity has crossed zero. Zero belongs to the positive side.
pub(crate) fn is_crossing(before: f64, after: f64) -> bool {
    (before >= 0.0) != (after >= 0.0)
}

/// A continuous-time model: x' = derivatives(t, x, u), y = outputs(t, x, u). The struct that implements this trait
/// holds the parameters.
///
/// The equations are generic over the number type: the same function simulates, computes exact directional derivatives,
/// and finds the dependencies of every result. Write either [`Self::derivatives`] and [`Self::outputs`], or
/// [`Self::evaluate`], which returns both. [`model`](macro@crate::model) fills in the items that you leave out.
pub trait Continuous: Parameters {
    /// Metadata of the model.
    const INFO: Info;
    /// Solver of the state.
    const SOLVER: Solver = Solver::RungeKutta;
    /// True if [`Self::next_time_event`] is implemented.
    const HAS_TIME_EVENTS: bool = false;
    /// True if [`Self::is_finished`] is implemented.
    const CAN_FINISH: bool = false;
    /// The fields of `self` that the equations read; `None` if the equations pass `self` to another function, which may
    /// read any field. [`Self::derived`], [`Self::load`] and [`Self::initialize`] do not count as equations.
    /// [`model`](macro@crate::model) sets this.
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
    /// Type of the quantities whose zero crossings are events: `[f64; N]`.
    type Crossings: AsRef<[f64]>;

    /// Input clocks. [`model`](macro@crate::model) makes them from the methods with `#[clock(…)]`.
    #[doc(hidden)]
    const CLOCKS: &'static [InputClock] = &[];
    /// A schedule per input clock.
    #[doc(hidden)]
    type Schedules: Schedules;
    /// The clocks that a tick can start.
    #[doc(hidden)]
    type Timers: Into<usize>;
    /// Runs the method of an input clock.
    #[doc(hidden)]
    fn tick(&self, _clock: usize, _tick: ContinuousTick<'_, Self>) {}

    /// Computes the derived parameters. Called again after a tunable parameter has changed. The error is a sentence
    /// that contains the parameter's name, its value and the rule that it breaks.
    fn derived(&self) -> Result<Self::Derived, String>;
    /// Like [`Self::derived`], for a model that reads files from the FMU's folder `resources`.
    fn load(&self, _resources: &Path) -> Result<Self::Derived, String> {
        self.derived()
    }
    /// Hash of the files read by [`Self::load`]; a saved state is restored only with the same files.
    fn fingerprint(_derived: &Self::Derived) -> u64 {
        0
    }
    /// Writes the states with `#[var(calculated)]`; changes to other states are ignored. Called only before the start,
    /// whenever a parameter or start value has changed.
    ///
    /// The first argument is the result of [`Self::derived`] or [`Self::load`]: write `derived: &D` for `type Derived =
    /// D`, and `(): &()` in a model without derived parameters. The second argument is the state, `state: &mut X<f64>`.
    fn initialize(&self, _derived: &Self::Derived, _state: &mut Self::State<f64>) {}
    /// The discrete state at the start, computed from the state and inputs at the end of initialization. `at.discrete`
    /// has the default values. A quantity of [`Self::zero_crossings`] that is already positive at the start causes no
    /// event: set the discrete state here as the event would have set it.
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

    /// State after a step of `step` > 0 s with constant inputs, for [`Solver::Exact`].
    fn advance(&self, at: At<'_, f64, Self>, _step: f64) -> Self::State<f64> {
        at.state.copied()
    }
    /// Quantities whose sign changes are state events. The time of an event is accurate to 10^-15 of the integration
    /// step. Called only if the model declares [`Self::Crossings`].
    fn zero_crossings(&self, _at: At<'_, f64, Self>) -> Self::Crossings {
        unreachable!("the model declares `type Crossings` without `fn zero_crossings`")
    }
    /// Time of the next time event in s. An event at `at.time` is handled at once; then this function is called again,
    /// until no event is due. A time before `at.time` is an error.
    fn next_time_event(&self, _at: At<'_, f64, Self>) -> Option<f64> {
        None
    }
    /// Handles an event. May change the state and the discrete state.
    fn on_event(&self, _event: Event<'_, Self>) {}
    /// Returns true if the simulation ends with this discrete state. Called after the events of a time; then the FMU
    /// asks the importer to stop, and a step of co-simulation ends at this time.
    fn is_finished(&self, _discrete: &Self::DiscreteState) -> bool {
        false
    }
}

/// Declares dependencies of the outputs of a source. Takes the name of an output, and the name of a parameter (in
/// [`Discrete::SOURCE`]) or of an input (in [`Discrete::FOLLOWS`]). Returns `true` if the output can depend on this
/// parameter or input, at some time and for some values of the other parameters. Tools find the dependencies in the
/// model structure.
pub type Influence = fn(output: &str, parameter: &str) -> bool;

/// A sample of a discrete-time model.
#[derive(Debug)]
pub struct Sample<'a, M: Discrete> {
    /// Time in s.
    pub time: f64,
    /// Discrete state; may be changed.
    pub state: &'a mut M::State,
    /// Inputs that were set before the step.
    pub inputs: &'a M::Inputs,
    /// Derived parameters.
    pub derived: &'a M::Derived,
}

/// A discrete-time model: a controller, or a signal source. The struct that implements this trait holds the parameters.
///
/// Sample n is due at start + n * `sample_time`. It reads the inputs that were set before the step; its outputs are
/// held until the next sample. If the struct has no field `sample_time`, a parameter with this name is added; its start
/// value is `step_size`.
pub trait Discrete: Parameters {
    /// Metadata of the model.
    const INFO: Info;
    /// The inputs.
    type Inputs: Variables<f64>;
    /// The outputs; their start values hold until the first sample, except in a source.
    type Outputs: Variables<f64>;
    /// Discrete state, kept from one sample to the next.
    type State: DiscreteState + Clone + Default + Send;
    /// Derived parameters.
    type Derived: Derived;

    /// `Some(influence)` makes the model a source: from Initialization Mode until the first sample, [`Self::start`]
    /// computes its outputs. `influence` returns `true` if an output depends on a parameter.
    const SOURCE: Option<Influence> = None;
    /// Takes the names of an output and an input. Returns `true` if the value of the output from [`Self::start`]
    /// depends on the input. Tools find this dependency in the model structure.
    const FOLLOWS: Influence = |_, _| false;

    /// Computes the derived parameters. Called again after a tunable parameter has changed. The error is a sentence
    /// that contains the parameter's name, its value and the rule that it breaks.
    fn derived(&self) -> Result<Self::Derived, String>;
    /// Outputs of a source until its first sample. The default implementation returns the outputs of the first sample,
    /// without changing the state of the run. If the outputs depend on inputs, declare the inputs in [`Self::FOLLOWS`].
    fn start(&self, time: f64, derived: &Self::Derived, inputs: &Self::Inputs) -> Self::Outputs {
        let state = &mut self.initial_state(derived);
        self.update(Sample { time, state, inputs, derived })
    }
    /// Like [`Self::derived`], for a model that reads files from the FMU's folder `resources`.
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
    /// Checks a sample before it is taken. A model that cannot process every finite input rejects the step here, with a
    /// sentence that contains the input's name, its value and the rule that it breaks.
    fn check(&self, _sample: &Sample<'_, Self>) -> Result<(), String> {
        Ok(())
    }
    /// Takes one sample.
    fn update(&self, sample: Sample<'_, Self>) -> Self::Outputs;
}

/// A stateful model: an existing simulation that advances itself. The struct that implements this trait holds the
/// parameters.
///
/// The simulation must implement `Clone`: the exporter clones it to save and restore its state.
pub trait Stateful: Parameters {
    /// Metadata of the model.
    const INFO: Info;
    /// The inputs.
    type Inputs: Variables<f64>;
    /// The outputs.
    type Outputs: Variables<f64>;
    /// The simulation with all of its state.
    type Simulation: Clone + Send + 'static;
    /// Serialization of the state; `#[fmu::model(…, serialize)]` uses serde.
    const SERIALIZE: Option<Serialize<Self::Simulation>> = None;

    /// Creates the simulation; `resources` is the resources folder of the FMU. Changes to tunable parameters after the
    /// start reach only [`Self::step`] and [`Self::outputs`]. The error is a sentence that contains the parameter's
    /// name, its value and the rule that it breaks.
    fn start(&self, resources: &Path) -> Result<Self::Simulation, String>;
    /// Advances the simulation from `time` to `time + step`, both in s, with constant inputs. The error is the reason
    /// why the simulation cannot continue; the instance must then be reset or restored from a saved state.
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
