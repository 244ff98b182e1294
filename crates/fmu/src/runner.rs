//! Executes models: one interface for continuous-time, discrete-time and stateful models.

mod clocked;
mod continuous;
mod discrete;
mod modes;
mod stateful;

use std::path::Path;

pub use clocked::ClockedModel;
pub use continuous::ContinuousModel;
pub use discrete::DiscreteModel;
pub use modes::Modes;
pub use stateful::StatefulModel;

use fmu_math::sparse::Structure;

use crate::clocks::{self, InputClock, Schedule, have_priorities};
use crate::declare::Spec;
use crate::definition::Definition;
use crate::discrete_state::{DiscreteState, Word, Words};
use crate::expression::Expression;
use crate::model::{Influence, Info};
use crate::number::{Number as _, is_finite_f32};
use crate::store::{Counts, ValueStore};
use crate::timeline::Timeline;
use crate::variable::{Block, Declarations, Kind as Type, Layout, Variable};
use crate::variables::{Derived, Parameters, Variables};

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

/// Maximum number of integration steps or samples in one communication step.
pub const MOST_PARTS: f64 = 1e6;

/// Time interval of a step: `[time, time + step)`. Sample 0 is due at `start`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Step {
    /// Start of the experiment in s.
    pub start: f64,
    /// End of the previous step in s; it differs from the start of this step by rounding errors of the master.
    pub reached: f64,
    /// Start of the step in s.
    pub time: f64,
    /// Length of the step in s.
    pub step: f64,
    /// Number of the next sample.
    pub sample: u64,
    /// True if the step ends at the first event, which is handled later.
    pub stops_at_events: bool,
    /// True if the importer activates the clocks.
    pub importer_ticks: bool,
    /// True if inputs have slopes.
    pub has_slopes: bool,
}

/// Position in a communication step that pauses after each integrator step, for intermediate updates.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    /// Time in s that the integration has reached.
    pub time: f64,
    /// End of the step in s: of the communication step, or the time at which the importer requests an early return.
    pub end: f64,
    /// Number of the part of the step that follows `time`.
    pub(crate) part: u64,
    /// Steps that a solver with error control has attempted.
    pub(crate) attempts: u64,
    /// Time in s at which the model is asked for the next time event.
    pub(crate) reached: f64,
    /// Events in the step.
    pub(crate) events: u32,
    /// Time of the first event in the step, for a message.
    pub(crate) first_event: f64,
    /// Time in s of the last time event that was handled in this step; before the first one, the end of the previous
    /// step.
    pub(crate) handled: f64,
}

impl Progress {
    /// The start of a step.
    #[inline]
    pub fn new(step: Step) -> Self {
        let Step { reached, time, step, .. } = step;
        Self { time, end: time + step, part: 0, attempts: 0, reached, events: 0, first_event: 0.0, handled: reached }
    }
}

/// Result of an event in model exchange.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Update {
    /// True if the event has changed continuous states.
    pub states_changed: bool,
    /// Time of the next time event in s.
    pub next_event_time: Option<f64>,
}

/// Data that the functions of a model read in addition to the values and the state of the run.
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

/// A context with the state of the run and the values, which the functions of the model can change.
pub struct Run<'a, M: Model> {
    /// The model.
    pub ctx: Context<'a, M>,
    /// State of the run.
    pub run: &'a mut M::RunnerState,
    /// All values.
    pub values: &'a mut ValueStore,
}

/// The variables that can be set, without the states, which are Float64s.
const fn settable<P: Variables<f64>, I: Variables<f64>, O: Variables<f64>>() -> Counts {
    P::COUNTS.plus(I::COUNTS).plus(O::COUNTS)
}

/// Interface between a model and its instances.
pub trait Model: Sized + 'static {
    /// Metadata of the model.
    const INFO: Info;
    /// Kind of model.
    const KIND: Kind;
    /// See [`Discrete::SOURCE`](crate::Discrete::SOURCE).
    const SOURCE: Option<Influence> = None;
    /// See [`Continuous::EQUATIONS_READ`](crate::Continuous::EQUATIONS_READ).
    const EQUATIONS_READ: Option<&'static [&'static str]> = None;
    /// See [`Discrete::FOLLOWS`](crate::Discrete::FOLLOWS).
    const FOLLOWS: Influence = |_, _| false;
    /// Numbers of the variables that can be set in some mode, by type.
    const SETTABLE: Counts;
    /// True if instances support model exchange.
    const MODEL_EXCHANGE: bool;
    /// True if the state can be serialized.
    const IS_SERIALIZABLE: bool = true;
    /// True if the outputs are calculated at the start; otherwise they have start values.
    const CALCULATES_OUTPUTS: bool = matches!(Self::KIND, Kind::Continuous | Kind::Stateful) || Self::SOURCE.is_some();
    /// True if the solver has a tolerance.
    const HAS_ERROR_CONTROL: bool = false;
    /// True if inputs can be linear in time during a step of co-simulation.
    const INTERPOLATES: bool = false;
    /// True if a step can have events.
    const HAS_EVENTS: bool = false;
    /// True if the model can end the simulation.
    const CAN_FINISH: bool = false;
    /// Input clocks.
    const CLOCKS: &'static [InputClock] = &[];
    /// True if the model has clocks.
    const HAS_CLOCKS: bool = !Self::CLOCKS.is_empty();
    /// True if instances support scheduled execution.
    const SCHEDULED_EXECUTION: bool = have_priorities(Self::CLOCKS);
    /// The parameters.
    type Parameters: Parameters;
    /// Derived parameters.
    type Derived: Derived;
    /// State of a run, without the variables.
    type RunnerState: Clone + Send + 'static;

    /// Assigns positions to all variables.
    fn layout() -> Layout;
    /// The start values of the variables; the slopes of the inputs are 0.
    #[inline]
    fn start(layout: &Layout) -> ValueStore {
        let mut values = ValueStore::start(layout);
        if Self::INTERPOLATES {
            let mut reals = values.reals.into_vec();
            reals.resize(layout.slopes().end, 0.0);
            values.reals = reals.into();
        }
        values
    }
    /// Reads the parameters from the values.
    fn parameters(values: &ValueStore) -> Self::Parameters {
        Self::Parameters::read(values.view(), Counts::ZERO)
    }
    /// Computes the derived parameters.
    fn load(p: &Self::Parameters, resources: &Path) -> Result<Self::Derived, String>;
    /// Hash of the loaded files.
    fn fingerprint(_derived: &Self::Derived) -> u64 {
        0
    }
    /// The state of the run at the start.
    fn init(ctx: Context<'_, Self>, resources: &Path, values: &ValueStore) -> Result<Self::RunnerState, String>;
    /// Writes the calculated states. Their present values have no influence.
    fn initialize(_ctx: Context<'_, Self>, _values: &mut ValueStore) {}
    /// Number of integration steps or samples in a step; more than [`MOST_PARTS`] are rejected.
    fn parts(layout: &Layout, values: &ValueStore, step: Step) -> f64;
    /// Advances states or outputs, and the state of the run. Returns the time of the event at which the step stopped,
    /// if any. Fails, without changing `values`, if a number is not finite or the model rejects the step.
    fn step(run: Run<'_, Self>, step: Step, parts: u64) -> Result<Option<f64>, String>;
    /// Takes one integrator step of a communication step, or a part of it up to an event. Returns the time of an event
    /// at which the communication step stops. After an error, the caller restores the values.
    fn step_to_update(_: Run<'_, Self>, _: Step, _parts: u64, _: &mut Progress) -> Result<Option<f64>, String> {
        unreachable!("only continuous-time models have intermediate updates")
    }
    /// Returns true if the model has ended the simulation.
    fn is_finished(_: &Self::Parameters, _: &Self::RunnerState) -> bool {
        false
    }
    /// Restores the discrete state from before the first event in the step.
    fn undo_events(_: &mut Self::RunnerState) {}
    /// Co-simulation without Event Mode: handles the time events at the start. Fails like [`Self::handle_events`].
    fn init_steps(_: Run<'_, Self>) -> Result<(), String> {
        Ok(())
    }
    /// Prepares the state of the run, if necessary, for events after `time` that the importer handles.
    fn init_events(_: &mut Self::RunnerState, _: &Layout, _time: f64) {}
    /// Computes the outputs; for a source, those of its first sample.
    fn outputs(ctx: Context<'_, Self>, run: &Self::RunnerState, values: &mut ValueStore);
    /// The schedules of the input clocks.
    fn schedules(_: &mut Self::RunnerState) -> &mut [Schedule] {
        &mut []
    }
    /// Takes over the present values of intervals that are parameters or that the importer sets. Fails if one is not
    /// above 0.
    fn update_intervals(Run { ctx, run, values }: Run<'_, Self>) -> Result<(), String> {
        clocks::update_intervals(Self::CLOCKS, Self::schedules(run), ctx.layout, values, ctx.time)
    }
    /// Scheduled execution: runs the part of an input clock at `time`. Returns true if an output clock has ticked or a
    /// countdown clock was started. Fails, without changes, like [`Self::step`], or if the clock has ticked at this time
    /// or a later one.
    fn activate(_: Run<'_, Self>, _clock: usize, _time: f64) -> Result<bool, String> {
        unreachable!("only models with clocks have scheduled execution")
    }
    /// Returns the message if a clock that the importer activates is due before `end`, the end of a step of `step` s, or
    /// if [`Self::update_intervals`] fails.
    fn missed_tick(Run { ctx, run, values }: Run<'_, Self>, end: f64, step: f64) -> Option<String> {
        let result = Self::update_intervals(Run { ctx, run: &mut *run, values });
        result.err().or_else(|| clocks::missed(Self::CLOCKS, Self::schedules(run), end, step))
    }
    /// Event Mode: evaluates the parts of the active clocks, if this has not been done. Fails, without changing
    /// `values`, like [`Self::step`].
    fn evaluate_clocks(_: Run<'_, Self>) -> Result<(), String> {
        Ok(())
    }
    /// Event Mode: writes the outputs from before the active clocks were evaluated.
    fn restore_outputs(_: &Self::RunnerState, _: &Layout, _: &mut ValueStore) {}
    /// Event Mode: the active clocks are evaluated again when their outputs are read.
    fn forget_evaluation(_: &mut Self::RunnerState) {}
    /// Computes the derivatives of the state.
    fn derivatives(_: Context<'_, Self>, _: &Self::RunnerState, _: &mut ValueStore) {}
    /// Derivatives of the real outputs, then of the state derivatives, along `direction` (real inputs, states, time).
    /// If `is_frozen`, relations keep their sides from the last event.
    fn directional(_: Run<'_, Self>, _is_frozen: bool, _direction: &[f64], result: &mut [f64]) {
        result.fill(0.0);
    }
    /// The values in the discrete state on which equations may branch.
    fn modes() -> Modes {
        Modes::default()
    }
    /// The state of the run with values in [`Self::modes`], chosen by index. `None` if the values exclude each other.
    fn with_mode(run: Self::RunnerState, _modes: &Modes, _numbers: &[Option<usize>]) -> Option<Self::RunnerState> {
        Some(run)
    }
    /// Dependencies, with a line for each real output, then for each state derivative. The known variables are the real
    /// inputs, then the states, then the time. `None` if everything may depend on everything.
    fn dependencies(_: Context<'_, Self>, _: &Self::RunnerState, _: &ValueStore) -> Option<Structure> {
        None
    }
    /// The expressions of the outputs, then of the state derivatives, for these values of Booleans, Integers and
    /// Strings; and true if the equations call [`Scalar::value`](crate::Scalar::value) or compare numbers.
    fn expressions(_: Context<'_, Self>, _: &Self::RunnerState, _: &ValueStore) -> (Vec<Expression>, bool) {
        (Vec::new(), false)
    }
    /// Number of relations in the equations with these values.
    fn count_relations(_: Context<'_, Self>, _: &Self::RunnerState, _: &ValueStore) -> usize {
        0
    }
    /// Model exchange: handles the present events. Fails, without changes, for non-finite numbers or rejected events.
    fn handle_events(run: Run<'_, Self>, timeline: &mut Timeline) -> Result<Update, String>;
    /// Model exchange: sets the sides of relations from the present values, and computes the scales of indicators.
    fn freeze_relations(_: Context<'_, Self>, _: &mut Self::RunnerState, _: &ValueStore) {}
    /// Model exchange: computes the outputs or the derivatives with frozen relations.
    fn eval_frozen(_: Context<'_, Self>, _: &mut Self::RunnerState, _: &mut ValueStore, _outputs: bool) {}
    /// Model exchange: the event indicators, first of the declared zero crossings, then of the frozen relations.
    fn event_indicators(_: Context<'_, Self>, _: &mut Self::RunnerState, _: &ValueStore, result: &mut [f64]) {
        result.fill(1.0);
    }
    /// Passes every value of the state to the sink. Fails if the simulation cannot be serialized.
    fn save(run: &Self::RunnerState, sink: &mut dyn FnMut(Word<'_>)) -> Result<(), String>;
    /// Restores the state of a run; `run` must be the state at the start. Fails for a missing or invalid value.
    fn restore(run: &mut Self::RunnerState, layout: &Layout, source: &mut Words<'_>) -> Result<(), String>;
    /// Name and value of the first number in the state that is not finite.
    fn not_finite(_: &Self::RunnerState) -> Option<(&'static str, f64)> {
        None
    }
}

/// Returns true if all numbers are finite. The early exit keeps the compiler from vectorizing the loop: the values were
/// just written one by one, and reading two at once would wait until they are in the cache.
#[inline]
pub(crate) fn are_finite(values: &[f64]) -> bool {
    values.iter().all(|value| value.is_finite())
}

/// Lays out the declared variables. Adds the solver's parameter with its start value, unless the model declares it.
fn layout(mut declared: Declarations, solver: Option<(Definition, f64)>) -> Layout {
    if let Some((definition, start)) = solver {
        if declared.parameters.iter().all(|parameter| parameter.name != definition.name) {
            Spec::defined(&definition).declare_real(Some(start), &mut declared.parameters);
        }
        declared.solver = Some(definition.name);
    }
    Layout::new(declared)
}

#[cold]
fn became(name: &str, value: f64, time: f64) -> String {
    format!("'{name}' became {value} at {time} s")
}

#[inline]
fn check_reals(layout: &Layout, block: Block, values: &ValueStore, time: f64) -> Result<(), String> {
    let reals = &values.reals;
    if are_finite(&reals[block.reals()]) {
        return if layout.has_float32 && block.counts.words > 0 {
            check_float32s(layout, block, &values.words, time)
        } else {
            Ok(())
        };
    }
    let index = block.reals().find(|&i| !reals[i].is_finite()).unwrap_or(block.at.reals);
    Err(became(layout.real_name(index), reals[index], time))
}

fn check_float32s(layout: &Layout, block: Block, words: &[u64], time: f64) -> Result<(), String> {
    let all = block.at.words..block.at.words + block.counts.words;
    let is_bad = |variable: &&Variable| {
        matches!(variable.declaration.kind, Type::Float32(_))
            && all.contains(&variable.index)
            && !is_finite_f32(words[variable.index])
    };
    layout
        .variables
        .iter()
        .find(is_bad)
        .map_or(Ok(()), |variable| Err(became(&variable.declaration.name, f32::of(words[variable.index]).into(), time)))
}

#[inline]
fn check_discrete(state: &impl DiscreteState, time: f64) -> Result<(), String> {
    state.not_finite().map_or(Ok(()), |(name, value)| Err(became(name, value, time)))
}
