//! Execution of a model by an instance: one interface for continuous-time, discrete-time and stateful models.

mod continuous;
mod discrete;
mod modes;
mod stateful;

use std::path::Path;

pub use continuous::ContinuousModel;
pub use discrete::DiscreteModel;
pub use modes::Modes;
pub use stateful::StatefulModel;

use fmu_math::sparse::Structure;

use crate::clock::Clock;
use crate::declare::Spec;
use crate::definition::Definition;
use crate::discrete_state::{DiscreteState, Word, Words};
use crate::expression::Expression;
use crate::model::{Influence, Info};
use crate::store::{Counts, ValueStore};
use crate::variable::{Block, Declarations, Layout};
use crate::variables::{Derived, Parameters, Variables as _};

/// Kind of model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// [`Continuous`](crate::Continuous).
    Continuous,
    /// [`Discrete`](crate::Discrete).
    Discrete,
    /// [`Stateful`](crate::Stateful).
    Stateful,
}

/// The most integration steps or samples in one communication step.
pub const MOST_PARTS: f64 = 1e6;

/// Time interval of a step: `[time, time + step)`, sample 0 at `start`.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Start of the experiment in s.
    pub start: f64,
    /// End of the step before in s; it differs from the start of this one by roundings of the master.
    pub reached: f64,
    /// Start of the step in s.
    pub time: f64,
    /// Length of the step in s.
    pub step: f64,
    /// Number of the next sample.
    pub sample: u64,
    /// True if the step ends at the first event, which is handled later.
    pub stops_at_events: bool,
}

/// Result of an event in model exchange.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// True if the event has changed continuous states.
    pub states_changed: bool,
    /// Time of the next time event in s.
    pub next_event_time: Option<f64>,
}

/// A model at one time: what its functions read besides the values and the state of the run.
pub struct Context<'a, M: Model> {
    /// Parameters.
    pub p: &'a M::Parameters,
    /// Derived parameters.
    pub derived: &'a M::Derived,
    /// Positions of the values.
    pub layout: &'a Layout,
    /// Time in s.
    pub time: f64,
}

impl<M: Model> Clone for Context<'_, M> {
    #[inline]
    fn clone(&self) -> Self {
        *self
    }
}
impl<M: Model> Copy for Context<'_, M> {}

/// A model at one time with the state of the run and the values, which its functions change.
pub struct Run<'a, M: Model> {
    /// The model.
    pub ctx: Context<'a, M>,
    /// State of the run.
    pub run: &'a mut M::RunnerState,
    /// All values.
    pub values: &'a mut ValueStore,
}

/// Interface of a model for instances.
pub trait Model: Sized + 'static {
    /// Facts about the model.
    const INFO: Info;
    /// Kind of model.
    const KIND: Kind;
    /// See [`Discrete::SOURCE`](crate::Discrete::SOURCE).
    const SOURCE: Option<Influence> = None;
    /// See [`Continuous::EQUATIONS_READ`](crate::Continuous::EQUATIONS_READ).
    const EQUATIONS_READ: Option<&'static [&'static str]> = None;
    /// See [`Discrete::FOLLOWS`](crate::Discrete::FOLLOWS).
    const FOLLOWS: Influence = |_, _| false;
    /// True if instances support model exchange.
    const MODEL_EXCHANGE: bool;
    /// True if the state can be serialized.
    const IS_SERIALIZABLE: bool = true;
    /// True if the outputs are calculated at the start, instead of having start values.
    const CALCULATES_OUTPUTS: bool = matches!(Self::KIND, Kind::Continuous | Kind::Stateful) || Self::SOURCE.is_some();
    /// True if the solver of co-simulation has a tolerance.
    const HAS_ERROR_CONTROL: bool = false;
    /// True if a step can have events.
    const HAS_EVENTS: bool = false;
    /// The parameters.
    type Parameters: Parameters;
    /// Derived parameters.
    type Derived: Derived;
    /// State of a run besides the variables.
    type RunnerState: Clone + Send + 'static;

    /// Numbers all variables.
    fn layout() -> Layout;
    /// The parameters with these values.
    fn parameters(values: &ValueStore) -> Self::Parameters {
        Self::Parameters::read(values.view(), Counts::ZERO)
    }
    /// Computes the derived parameters. An error is a sentence that names the parameter, its value and the rule.
    fn load(p: &Self::Parameters, resources: &Path) -> Result<Self::Derived, String>;
    /// Hash of the loaded files.
    fn fingerprint(_derived: &Self::Derived) -> u64 {
        0
    }
    /// The state of the run at the start, for these values and at this time. An error is a sentence that names the parameter, its value
    /// and the rule.
    fn init(ctx: Context<'_, Self>, resources: &Path, values: &ValueStore) -> Result<Self::RunnerState, String>;
    /// Writes the states that follow from the parameters, whatever their values are now.
    fn initialize(_ctx: Context<'_, Self>, _values: &mut ValueStore) {}
    /// Number of integration steps or samples in a step; more than [`MOST_PARTS`] are rejected.
    fn parts(layout: &Layout, values: &ValueStore, step: Step) -> f64;
    /// Advances states or outputs, and the state of the run. Returns the time of the event that ended the step early. Fails if a number
    /// is not finite or the model rejects the step; `values` is kept then, the state of the run is not.
    fn step(run: Run<'_, Self>, step: Step, parts: u64) -> Result<Option<f64>, String>;
    /// Co-simulation without Event Mode: handles the time events that are due at the start. Fails as [`Self::handle_events`].
    fn init_steps(_: Run<'_, Self>) -> Result<(), String> {
        Ok(())
    }
    /// Prepares the state of the run for events that the importer handles, unless it is prepared: those up to `time` are done.
    fn init_events(_: &mut Self::RunnerState, _: &Layout, _time: f64) {}
    /// Computes the outputs; for a source, those of its first sample.
    fn outputs(ctx: Context<'_, Self>, run: &Self::RunnerState, values: &mut ValueStore);
    /// Computes the derivatives of the state.
    fn derivatives(_: Context<'_, Self>, _: &Self::RunnerState, _: &mut ValueStore) {}
    /// Derivatives of all real outputs and state derivatives along `direction` (real inputs, states, the time), outputs first;
    /// if `is_frozen`, with the relations as they were at the last event.
    fn directional(_: Run<'_, Self>, _is_frozen: bool, _direction: &[f64], result: &mut [f64]) {
        result.fill(0.0);
    }
    /// The values of the discrete state on which equations may branch.
    fn modes() -> Modes {
        Modes::default()
    }
    /// The state of the run with the values of these numbers, see [`Self::modes`]; `None` if they are impossible together.
    fn with_mode(run: Self::RunnerState, _modes: &Modes, _numbers: &[Option<usize>]) -> Option<Self::RunnerState> {
        Some(run)
    }
    /// Dependencies of the real outputs, then of the state derivatives, a line for each: the known variables are the real
    /// inputs, then the states, then the time. `None` if everything may depend on everything.
    fn dependencies(_: Context<'_, Self>, _: &Self::RunnerState, _: &ValueStore) -> Option<Structure> {
        None
    }
    /// The expressions that the outputs, then the state derivatives have at these values of Booleans, Integers and Strings, and true if
    /// equations read a value, by [`Scalar::value`](crate::Scalar::value) or a comparison.
    fn expressions(_: Context<'_, Self>, _: &Self::RunnerState, _: &ValueStore) -> (Vec<Expression>, bool) {
        (Vec::new(), false)
    }
    /// Number of relations in the equations at these values.
    fn count_relations(_: Context<'_, Self>, _: &Self::RunnerState, _: &ValueStore) -> usize {
        0
    }
    /// Model exchange: handles the events that are due at the time of the clock. Fails if a number is not finite or the model rejects;
    /// values, state and clock are kept then.
    fn handle_events(run: Run<'_, Self>, clock: &mut Clock) -> Result<Update, String>;
    /// Model exchange: sets every relation to the side of the present values, and the scale of every indicator.
    fn freeze_relations(_: Context<'_, Self>, _: &mut Self::RunnerState, _: &ValueStore) {}
    /// Model exchange: computes the outputs or the derivatives with the relations as they were frozen.
    fn eval_frozen(_: Context<'_, Self>, _: &mut Self::RunnerState, _: &mut ValueStore, _outputs: bool) {}
    /// Model exchange: the event indicators, for relations as they were frozen: first those of the declared zero crossings.
    fn event_indicators(_: Context<'_, Self>, _: &mut Self::RunnerState, _: &ValueStore, result: &mut [f64]) {
        result.fill(1.0);
    }
    /// Passes every value of the state to the sink. Fails if the simulation cannot be serialized.
    fn save(run: &Self::RunnerState, sink: &mut dyn FnMut(Word<'_>)) -> Result<(), String>;
    /// Restores the state of a run, which must be the one at the start. Fails if a value is missing, of another type, or impossible.
    fn restore(run: &mut Self::RunnerState, layout: &Layout, source: &mut Words<'_>) -> Result<(), String>;
    /// Name and value of the first number in the state that is not finite.
    fn not_finite(_: &Self::RunnerState) -> Option<(&'static str, f64)> {
        None
    }
}

/// Returns true if all numbers are finite. It stops at the first that is not, so that the compiler does not vectorize it:
/// the values were written one by one just before, and reading two at once would wait until they are in the cache.
#[inline]
pub(crate) fn are_finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}

/// Numbers declared variables, and the parameter that the solver reads, with its start value, unless the model declares it.
fn layout(mut declared: Declarations, solver: Option<(Definition, f64)>) -> Layout {
    if let Some((definition, start)) = solver {
        if declared.parameters.iter().all(|parameter| parameter.name != definition.name) {
            Spec::defined(&definition).declare_real(Some(start), &mut declared.parameters);
        }
        declared.solver = Some(definition.name);
    }
    Layout::new(declared)
}

/// The error of a number that is not finite.
#[cold]
fn became(name: &str, value: f64, time: f64) -> String {
    format!("'{name}' became {value} at {time} s")
}

/// Returns an error for the first real of a block that is not finite.
#[inline]
fn check_reals(layout: &Layout, block: Block, reals: &[f64], time: f64) -> Result<(), String> {
    if are_finite(&reals[block.reals()]) {
        return Ok(());
    }
    let index = block.reals().find(|&i| !reals[i].is_finite()).unwrap_or(block.at.reals);
    Err(became(layout.real_name(index), reals[index], time))
}

/// Returns an error for the first number of a discrete state that is not finite.
#[inline]
fn check_discrete(state: &impl DiscreteState, time: f64) -> Result<(), String> {
    state.not_finite().map_or(Ok(()), |(name, value)| Err(became(name, value, time)))
}
