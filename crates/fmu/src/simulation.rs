//! Runs a model in Rust, without an FMU: for tests, and for models that contain other models.

use std::path::Path;
use std::sync::Arc;

use crate::clocks::{Clocked, InputClock, Timing};
use crate::model::{Continuous, Discrete, Sample};
use crate::runner::{ClockedModel, Context, ContinuousModel, DiscreteModel, MOST_PARTS, Model, Run, Step};
use crate::store::{Counts, ValueStore};
use crate::timeline::Timeline;
use crate::variable::{Layout, Role, Variable};
use crate::variables::{Parameters, Variables as _};

/// Writes the parameters to the values. Returns the parameters; their arrays have the lengths that the structural
/// parameters state.
fn with_lengths<M: Parameters>(model: M, layout: &Layout, values: &mut ValueStore) -> M {
    model.write(&mut values.view_mut(), Counts::ZERO);
    if layout.structural.is_empty() {
        return model;
    }
    values.update_lengths(layout);
    M::read(values.view(), Counts::ZERO)
}

/// Runs the model without the data for model exchange, with inputs that are held.
type Runner<M> = ContinuousModel<M, false, false>;

/// A run of a continuous-time model. It uses the same solver as the FMU, and its results are bit-identical to those of
/// the FMU.
///
/// ```
/// use fmu::prelude::*;
/// use fmu::simulation::ContinuousSimulation;
///
/// #[derive(Parameters)]
/// struct Decay;
///
/// #[derive(State)]
/// struct X<T> {
///     /// Amount (mol)
///     #[var(start = 1.0)]
///     n: T,
/// }
///
/// /// Radioactive decay
/// #[fmu::model(stop_time = 1.0, step_size = 0.01)]
/// impl Continuous for Decay {
///     type State<T: Scalar> = X<T>;
///     fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
///         X { n: -at.state.n }
///     }
/// }
///
/// # fn main() -> Result<(), String> {
/// let mut run = ContinuousSimulation::new(Decay)?;
/// while run.time() < 1.0 {
///     run.step(&(), 0.01)?;
/// }
/// // The error of the classical Runge-Kutta method is about step^4/120 exp(-1) = 3e-11.
/// assert!((run.state().n - (-run.time()).exp()).abs() < 1e-10);
/// # Ok(()) }
/// ```
pub struct ContinuousSimulation<M: Continuous> {
    model: Arc<M>,
    derived: Arc<M::Derived>,
    resources: Arc<Path>,
    layout: Arc<Layout>,
    run: <Runner<M> as Model>::RunnerState,
    values: ValueStore,
    time: f64,
}

impl<M: Continuous> Clone for ContinuousSimulation<M> {
    fn clone(&self) -> Self {
        Self {
            model: Arc::clone(&self.model),
            derived: Arc::clone(&self.derived),
            resources: Arc::clone(&self.resources),
            layout: Arc::clone(&self.layout),
            run: self.run.clone(),
            values: self.values.clone(),
            time: self.time,
        }
    }
}

impl<M: Continuous> std::fmt::Debug for ContinuousSimulation<M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ContinuousSimulation").field("model", &M::INFO.name).field("time", &self.time).finish()
    }
}

impl<M: Continuous> ContinuousSimulation<M> {
    /// Starts at time 0 with the start values of the states. Files are read from the folder `resources` of the package.
    /// Fails if the parameters are inconsistent.
    pub fn new(model: M) -> Result<Self, String> {
        Self::with_resources(model, Path::new(M::INFO.resources))
    }

    /// Like [`Self::new`], with files from another folder. Also fails if a file cannot be read.
    pub fn with_resources(model: M, resources: &Path) -> Result<Self, String> {
        let layout = Runner::<M>::layout();
        let mut values = ValueStore::start(&layout);
        let model = with_lengths(model, &layout, &mut values);
        let derived = model.load(resources)?;
        let ctx = Context { p: &model, derived: &derived, layout: &layout, time: 0.0 };
        Runner::<M>::initialize(ctx, &mut values);
        let mut run = Runner::<M>::init(ctx, resources, &values)?;
        Runner::<M>::init_steps(Run { ctx, run: &mut run, values: &mut values })?;
        Ok(Self {
            model: model.into(),
            derived: derived.into(),
            resources: resources.into(),
            layout: layout.into(),
            run,
            values,
            time: 0.0,
        })
    }

    /// Time in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The state.
    #[must_use]
    pub fn state(&self) -> M::State<f64> {
        M::State::read(self.values.view(), self.layout.states.at)
    }

    /// Replaces the state. At time 0, also initializes the discrete state for this state.
    pub fn set_state(&mut self, state: &M::State<f64>) {
        state.write(&mut self.values.view_mut(), self.layout.states.at);
        if self.time == 0.0 {
            let resources = Arc::clone(&self.resources);
            let Run { ctx, values, .. } = self.context();
            let run = Runner::<M>::init(ctx, &resources, values);
            self.run = run.unwrap_or_else(|_| unreachable!("a continuous-time model always has one"));
        }
    }

    /// Replaces the tunable parameters and computes the derived parameters again. Fails if a fixed parameter differs,
    /// or the parameters are inconsistent.
    pub fn set_parameters(&mut self, model: M) -> Result<(), String> {
        let mut values = self.values.clone();
        let model = with_lengths(model, &self.layout, &mut values);
        let is_changed = |v: &&Variable| v.role == Role::Parameter && values.differs(&self.values, v);
        let mut changed = self.layout.variables.iter().filter(is_changed).peekable();
        if changed.peek().is_none() {
            return Ok(());
        }
        if let Some(variable) = changed.find(|variable| !variable.declaration.tunable) {
            let name = &variable.declaration.name;
            return Err(format!("`{name}` is fixed and cannot change after the start"));
        }
        self.derived = model.load(&self.resources)?.into();
        self.model = model.into();
        self.values = values;
        Ok(())
    }

    fn context(&mut self) -> Run<'_, Runner<M>> {
        let Self { model, derived, layout, run, values, time, .. } = self;
        Run { ctx: Context { p: &**model, derived: &**derived, layout, time: *time }, run, values }
    }

    /// The derived parameters.
    #[must_use]
    pub fn derived(&self) -> &M::Derived {
        &self.derived
    }

    /// The outputs for these inputs.
    pub fn outputs(&mut self, inputs: &M::Inputs<f64>) -> M::Outputs<f64> {
        inputs.write(&mut self.values.view_mut(), self.layout.inputs.at);
        let Run { ctx, run, values } = self.context();
        Runner::<M>::outputs(ctx, run, values);
        M::Outputs::read(values.view(), ctx.layout.outputs.at)
    }

    /// Advances the time by `step` in s, with constant inputs. Fails if a state is not finite, if the solver cannot
    /// meet its tolerance, or if there are too many events. Ends at the event with which the model ends the simulation;
    /// further steps do not advance the time.
    pub fn step(&mut self, inputs: &M::Inputs<f64>, step: f64) -> Result<(), String> {
        inputs.write(&mut self.values.view_mut(), self.layout.inputs.at);
        let run = self.context();
        let Context { layout, time, .. } = run.ctx;
        let interval = Step { reached: time, time, step, ..Step::default() };
        let parts = Runner::<M>::parts(layout, run.values, interval);
        if parts.is_nan() || parts > MOST_PARTS {
            return Err(format!(
                "a step of {step} s needs {parts} integration steps; at most {MOST_PARTS} are possible"
            ));
        }
        self.time = Runner::<M>::step(run, interval, parts as u64)?.unwrap_or(time + step);
        Ok(())
    }

    /// Returns true if the model has ended the simulation ([`Continuous::is_finished`]).
    #[must_use]
    pub fn is_finished(&self) -> bool {
        M::CAN_FINISH && Runner::<M>::is_finished(&self.model, &self.run)
    }
}

/// A run of a discrete-time model.
pub struct DiscreteSimulation<M: Discrete> {
    model: Arc<M>,
    derived: Arc<M::Derived>,
    state: M::State,
    sample_time: f64,
    samples: u64,
}

impl<M: Discrete> Clone for DiscreteSimulation<M> {
    fn clone(&self) -> Self {
        Self {
            model: Arc::clone(&self.model),
            derived: Arc::clone(&self.derived),
            state: self.state.clone(),
            sample_time: self.sample_time,
            samples: self.samples,
        }
    }
}

impl<M: Discrete> std::fmt::Debug for DiscreteSimulation<M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DiscreteSimulation").field("model", &M::INFO.name).field("samples", &self.samples).finish()
    }
}

impl<M: Discrete> DiscreteSimulation<M> {
    /// Like [`ContinuousSimulation::new`]. The first sample is due at time 0 and has not been taken yet.
    pub fn new(model: M) -> Result<Self, String> {
        Self::with_resources(model, Path::new(M::INFO.resources))
    }

    /// Like [`Self::new`], with files from another folder. Also fails if a file cannot be read.
    pub fn with_resources(model: M, resources: &Path) -> Result<Self, String> {
        let layout = DiscreteModel::<M, false>::layout();
        let mut values = ValueStore::start(&layout);
        let model = with_lengths(model, &layout, &mut values);
        let sample_time = layout.solver.map_or(M::INFO.step_size, |index| values.reals[index]);
        let derived = model.load(resources)?;
        let state = model.initial_state(&derived);
        Ok(Self { model: model.into(), derived: derived.into(), state, sample_time, samples: 0 })
    }

    /// Time from one sample to the next in s.
    #[must_use]
    pub fn sample_time(&self) -> f64 {
        self.sample_time
    }

    /// The discrete state.
    #[must_use]
    pub fn state(&self) -> &M::State {
        &self.state
    }

    /// Takes the next sample. Fails if the model rejects the inputs.
    pub fn sample(&mut self, inputs: &M::Inputs) -> Result<M::Outputs, String> {
        let Self { model, derived, state, sample_time, samples } = self;
        let time = *samples as f64 * *sample_time;
        model.check(&Sample { time, state, inputs, derived })?;
        *samples += 1;
        Ok(model.update(Sample { time, state, inputs, derived }))
    }
}

/// A run of a discrete-time model with clocks. They tick inside the steps, as in an FMU whose importer has no clocks.
pub struct ClockedSimulation<M: Clocked> {
    model: M,
    derived: M::Derived,
    layout: Layout,
    run: <ClockedModel<M> as Model>::RunnerState,
    values: ValueStore,
    time: f64,
}

impl<M: Clocked> std::fmt::Debug for ClockedSimulation<M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ClockedSimulation").field("model", &M::INFO.name).field("time", &self.time).finish()
    }
}

impl<M: Clocked> ClockedSimulation<M> {
    /// Like [`ContinuousSimulation::new`]. Clocks that are due at time 0 have not ticked yet.
    pub fn new(model: M) -> Result<Self, String> {
        let layout = ClockedModel::<M>::layout();
        let resources = Path::new(M::INFO.resources);
        let mut values = ValueStore::start(&layout);
        let model = with_lengths(model, &layout, &mut values);
        let derived = model.load(resources)?;
        let ctx = Context { p: &model, derived: &derived, layout: &layout, time: 0.0 };
        let run = ClockedModel::<M>::init(ctx, resources, &values)?;
        Ok(Self { model, derived, layout, run, values, time: 0.0 })
    }

    /// Time in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }

    /// The discrete state.
    #[must_use]
    pub fn state(&self) -> &M::State {
        self.run.state()
    }

    /// Advances the time by `step` in s, with constant inputs. A clock that is due at the end ticks in the next step.
    /// Returns the outputs; an output clock has fired if it ticked in this step. Fails if a value is not finite, or if
    /// clocks tick too often.
    pub fn step(&mut self, inputs: &M::Inputs, step: f64) -> Result<M::Outputs, String> {
        let interval = Step { reached: self.time, time: self.time, step, ..Step::default() };
        ClockedModel::<M>::step(self.context(inputs), interval, 0)?;
        self.time += step;
        Ok(M::Outputs::read(self.values.view(), self.layout.outputs.at))
    }

    /// Lets triggered clocks tick now, and returns the outputs. Fails if the model has no triggered input clock with one
    /// of the names, or like [`Self::step`].
    pub fn trigger(&mut self, inputs: &M::Inputs, clocks: &[&str]) -> Result<M::Outputs, String> {
        let mut active = Vec::new();
        for name in clocks {
            let is_it = |clock: &InputClock| clock.name == *name && clock.timing == Timing::Triggered;
            let clock = M::CLOCKS.iter().position(is_it);
            active.push(clock.ok_or_else(|| format!("the model has no triggered input clock '{name}'"))?);
        }
        let at = self.layout.clocks.at.booleans;
        active.iter().for_each(|clock| self.values.booleans[at + clock] = true);
        let Run { ctx, run, values } = self.context(inputs);
        ClockedModel::<M>::evaluate_clocks(Run { ctx, run, values })
            .inspect_err(|_| active.iter().for_each(|clock| values.booleans[at + clock] = false))?;
        let outputs = M::Outputs::read(values.view(), ctx.layout.outputs.at);
        let mut timeline = Timeline::ZERO;
        ClockedModel::<M>::handle_events(Run { ctx, run, values }, &mut timeline)?;
        Ok(outputs)
    }

    fn context(&mut self, inputs: &M::Inputs) -> Run<'_, ClockedModel<M>> {
        let Self { model, derived, layout, run, values, time } = self;
        inputs.write(&mut values.view_mut(), layout.inputs.at);
        Run { ctx: Context { p: model, derived, layout, time: *time }, run, values }
    }
}
