//! An instance of an FMU, in safe Rust: modes, values, time, state. The C interface is a thin layer over this module.
#![cfg_attr(not(feature = "testing"), expect(unreachable_pub, reason = "public with the feature `testing`"))]

use std::ffi::CString;
use std::path::PathBuf;
use std::sync::Arc;

use crate::calls::{ALLOWED, Function, Interface, Mode, Protocol, Version};
use crate::description::{Dependency, Description};
use crate::runner::{Context, Kind as ModelKind, Model, Run, are_finite};
use crate::store::{Counts, ValueStore};
use crate::timeline::Timeline;
use crate::variable::{Kind, Layout};
use crate::variables::Derived as _;

mod clocks;
mod co_simulation;
mod derivatives;
mod model_exchange;
mod state_bytes;
mod states;
mod structure;
mod updates;
mod values;

pub use updates::PausingStep;

/// Error of a call.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CallError {
    /// fmi2Error, with a message: what is wrong, where, and the rule.
    Error(String),
    /// fmi2Discard: the requested information does not exist, or the model has ended the simulation.
    Discard(String),
}

impl From<String> for CallError {
    fn from(message: String) -> Self {
        Self::Error(message)
    }
}

#[cfg(feature = "testing")]
pub use clocks::Qualifier;

type CallResult<T = ()> = Result<T, CallError>;

/// The complete state of an instance, to which an fmi2FMUstate points.
pub struct Snapshot<M: Model> {
    pub(crate) mode: Mode,
    pub(crate) timeline: Timeline,
    pub(crate) values: ValueStore,
    pub(crate) is_tolerance_set: bool,
    pub(crate) run: Option<M::RunnerState>,
    pub(crate) derived: Option<Arc<M::Derived>>,
    pub(crate) derived_are_old: bool,
}

/// An instance of the model `M`.
pub struct Instance<M: Model> {
    protocol: Protocol,
    /// True if the importer handles events in co-simulation (FMI 3.0).
    uses_event_mode: bool,
    description: Arc<Description>,
    resources: PathBuf,
    mode: Mode,
    /// A bit for each function that the mode allows.
    allowed: u128,
    timeline: Timeline,
    values: ValueStore,
    parameters: M::Parameters,
    /// True if the parameter `tolerance` was set; otherwise the tolerance of the experiment applies.
    is_tolerance_set: bool,
    derived: Option<Arc<M::Derived>>,
    /// True if a parameter has changed since the derived parameters were computed. They are computed again when needed.
    derived_are_old: bool,
    /// The state of the run. Created when needed; before the start, created again when a value on which it depends
    /// changes. If a step of a continuous-time model fails, only the discrete state in the state of the run is
    /// restored, because the outputs depend on it. In Step Failed, nothing else in the state of the run is read before
    /// a saved state or a reset replaces everything.
    run: Option<M::RunnerState>,
    outputs_are_old: bool,
    derivatives_are_old: bool,
    /// True if an up-to-date output or derivative is not finite. All other values are always finite.
    has_not_finite: bool,
    /// True if a slope of an input is not 0.
    has_slopes: bool,
    /// Positions of the present states in memory; `None` if their number cannot change.
    present_states: Option<Vec<usize>>,
    /// Strings handed out by fmi2GetString; they live until the value changes.
    texts: Box<[CString]>,
}

impl<M: Model> Instance<M> {
    /// A new instance in mode Instantiated. `resources` is the resources folder of the unpacked FMU.
    pub fn new(protocol: Protocol, description: Arc<Description>, resources: PathBuf) -> Self {
        let values = M::start(&description.layout);
        let parameters = M::parameters(&values);
        let texts = texts(&values.strings);
        Self {
            protocol,
            uses_event_mode: false,
            resources,
            mode: Mode::Instantiated,
            allowed: ALLOWED[protocol.column()][Mode::Instantiated as usize],
            timeline: Timeline::ZERO,
            parameters,
            is_tolerance_set: false,
            derived: None,
            derived_are_old: true,
            run: None,
            outputs_are_old: true,
            derivatives_are_old: true,
            has_not_finite: false,
            has_slopes: false,
            texts,
            present_states: structure::present_states::<M>(&description.layout, &values),
            description,
            values,
        }
    }

    /// An instance for an importer that handles events in co-simulation.
    pub fn with_event_mode(self) -> Self {
        Self { uses_event_mode: true, ..self }
    }

    /// Returns the mode.
    #[cfg(feature = "testing")]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    fn enter(&mut self, mode: Mode) {
        self.mode = mode;
        self.allowed = ALLOWED[self.protocol.column()][mode as usize];
    }

    /// Rejects a call that the mode does not allow. The error is "called in X, allowed in Y".
    #[inline]
    pub fn check(&self, function: Function) -> CallResult {
        if self.allowed >> function as u32 & 1 != 0 {
            return Ok(());
        }
        Err(self.out_of_order(function))
    }

    #[cold]
    fn out_of_order(&self, function: Function) -> CallError {
        if function.allowed(self.protocol, self.mode) {
            return self.error(function, "called after an input was set in this intermediate update");
        }
        function.out_of_order(self.protocol, self.mode).into()
    }

    fn error(&self, function: Function, message: impl std::fmt::Display) -> CallError {
        CallError::Error(format!("{}: {message}", function.name(self.protocol.version)))
    }

    fn is_before_start(&self) -> bool {
        self.mode.is_before_start()
    }

    /// Marks the instance as broken after a panic: only reset and free are allowed.
    pub(crate) fn mark_broken(&mut self) {
        self.enter(Mode::Broken);
    }

    pub(crate) fn layout(&self) -> &Layout {
        &self.description.layout
    }

    /// Returns true if the derived parameters or the state of the run must be computed before they are used.
    #[inline]
    fn is_stale(&self) -> bool {
        self.derived_are_old || self.run.is_none()
    }

    /// Returns true if the real `index` is a state whose start value must be computed.
    fn is_calculated_state(&self, index: usize) -> bool {
        let layout = self.layout();
        self.run.is_none() && layout.states.reals().contains(&index) && layout.real(index).declaration.calculated
    }

    /// fmi2SetupExperiment without a tolerance, see [`Self::set_experiment`].
    #[cfg(feature = "testing")]
    pub fn setup_experiment(&mut self, start: f64, stop: Option<f64>) -> CallResult {
        let function = Function::SetupExperiment;
        self.check(function)?;
        self.set_experiment(function, start, stop, None)
    }

    /// Sets start time, stop time and relative tolerance; errors contain the name of `function`. A solver with error
    /// control uses the tolerance, unless the parameter `tolerance` was set. Fails if the start time is not finite, if
    /// the stop time is NaN or before the start time, or if such a solver gets an invalid tolerance.
    pub fn set_experiment(
        &mut self,
        function: Function,
        start: f64,
        stop: Option<f64>,
        tolerance: Option<f64>,
    ) -> CallResult {
        if !start.is_finite() {
            return Err(self.error(function, format_args!("startTime must be finite, got {start}")));
        }
        if let Some(stop) = stop
            && (stop.is_nan() || stop < start)
        {
            let message = format_args!("stopTime must not be before startTime = {start}, got {stop}");
            return Err(self.error(function, message));
        }
        if M::HAS_ERROR_CONTROL
            && let Some(tolerance) = tolerance
            && !(tolerance > 0.0 && tolerance.is_finite())
        {
            let message = format_args!(
                "tolerance must be finite and above 0, got {tolerance}; with toleranceDefined = false the model's tolerance is used"
            );
            return Err(self.error(function, message));
        }
        self.timeline = Timeline { start, stop, time: start, sample: 0 };
        if M::HAS_CLOCKS {
            // The ticks count from the start.
            self.run = None;
        }
        if M::HAS_ERROR_CONTROL && !self.is_tolerance_set {
            self.set_tolerance(tolerance);
        }
        self.values_changed();
        Ok(())
    }

    /// Sets the solver's tolerance to the tolerance of the experiment, clamped to the limits of the parameter. Without
    /// a tolerance of the experiment, sets the start value of the parameter.
    fn set_tolerance(&mut self, tolerance: Option<f64>) {
        let layout = &self.description.layout;
        if let Some(index) = layout.solver
            && let Kind::Real(real) = &layout.real(index).declaration.kind
        {
            let range = real.range();
            self.values.reals[index] =
                tolerance.map_or(real.start, |tolerance| tolerance.max(*range.start()).min(*range.end()));
            self.parameters_changed();
        }
    }

    /// fmi2EnterInitializationMode.
    pub fn enter_initialization(&mut self) -> CallResult {
        self.check(Function::EnterInitializationMode)?;
        self.enter(Mode::Initialization);
        Ok(())
    }

    /// fmi2ExitInitializationMode: computes the derived parameters. Fails if the parameters are inconsistent.
    pub fn exit_initialization(&mut self) -> CallResult {
        let function = Function::ExitInitializationMode;
        self.check(function)?;
        // The state of the run is created again, so that earlier reads have no effect on it.
        self.run = None;
        self.derive()?;
        let run = self.run.as_ref().expect("made with the derived parameters");
        if let Some((name, value)) = M::not_finite(run) {
            return Err(Self::no_start(format_args!("start of '{name}' must be finite"), value));
        }
        if M::SOURCE.is_some() || M::KIND == ModelKind::Stateful {
            self.outputs_are_old = true;
            self.refresh(false, true, false)?;
            let outputs = self.layout().outputs.reals();
            if let Some(index) = outputs.into_iter().find(|&index| !self.values.reals[index].is_finite()) {
                let name = self.layout().real_name(index);
                return Err(Self::no_start(
                    format_args!("'{name}' must be finite at the start"),
                    self.values.reals[index],
                ));
            }
        }
        let mode = match self.protocol.interface {
            Interface::CoSimulation if !self.uses_event_mode => Mode::Step,
            Interface::ScheduledExecution => Mode::ClockActivation,
            _ => Mode::Event,
        };
        let Run { ctx, run, values } = self.context();
        if mode == Mode::Event {
            M::init_events(run, ctx.layout, ctx.time);
        } else {
            M::init_steps(Run { ctx, run, values }).map_err(|error| self.error(function, error))?;
            self.forget_results();
        }
        self.enter(mode);
        Ok(())
    }

    fn no_start(rule: std::fmt::Arguments<'_>, value: f64) -> CallError {
        format!("{}: {rule}, got {value}; check the parameters", M::INFO.name).into()
    }

    /// fmi2Terminate.
    pub fn terminate(&mut self) -> CallResult {
        self.check(Function::Terminate)?;
        self.enter(Mode::Terminated);
        Ok(())
    }

    /// fmi2Reset: restores the state after instantiation.
    pub fn reset(&mut self) -> CallResult {
        self.check(Function::Reset)?;
        let uses_event_mode = self.uses_event_mode;
        *self = Self::new(self.protocol, Arc::clone(&self.description), self.resources.clone());
        self.uses_event_mode = uses_event_mode;
        Ok(())
    }

    /// The model, the state of the run and the values. The derived parameters must already be computed.
    #[inline]
    fn context(&mut self) -> Run<'_, M> {
        let (Some(derived), Some(run)) = (self.derived.as_deref(), &mut self.run) else {
            unreachable!("made by `derive` before the end of initialization");
        };
        let ctx = Context { p: &self.parameters, derived, layout: &self.description.layout, time: self.timeline.time };
        Run { ctx, run, values: &mut self.values }
    }

    /// Returns the derived parameters, which are computed again if a parameter has changed. Before the start, also
    /// computes the calculated states and the state of the run. They depend only on the values, not on earlier reads.
    #[inline]
    fn derive(&mut self) -> CallResult<Arc<M::Derived>> {
        match &self.derived {
            Some(derived) if !self.is_stale() => Ok(Arc::clone(derived)),
            _ => self.derive_anew(),
        }
    }

    #[cold]
    fn derive_anew(&mut self) -> CallResult<Arc<M::Derived>> {
        let named = |e: String| format!("{}: {e}", M::INFO.name);
        let known = self.derived.as_ref().filter(|_| !self.derived_are_old);
        let derived = match known {
            Some(derived) => Arc::clone(derived),
            None => Arc::new(M::load(&self.parameters, &self.resources).map_err(named)?),
        };
        if let Some(before) = self.derived.as_deref().filter(|_| !self.is_before_start())
            && M::fingerprint(before) != M::fingerprint(&derived)
        {
            return Err(named("a file that the model read at the start has changed since".to_owned()).into());
        }
        let layout = &self.description.layout;
        derived.write(&mut self.values.view_mut(), layout.derived.at);
        let ctx = Context { p: &self.parameters, derived: &*derived, layout, time: self.timeline.start };
        if self.run.is_none() {
            M::initialize(ctx, &mut self.values);
        }
        for index in layout.derived.reals().chain(layout.states.reals()) {
            let value = self.values.reals[index];
            let what = if index < layout.states.at.reals { "calculated parameter" } else { "start of" };
            if !value.is_finite() {
                let name = layout.real_name(index);
                return Err(Self::no_start(format_args!("{what} '{name}' must be finite"), value));
            }
        }
        if self.run.is_none() {
            self.run = Some(M::init(ctx, &self.resources, &self.values).map_err(named)?);
        }
        self.derived = Some(Arc::clone(&derived));
        self.derived_are_old = false;
        Ok(derived)
    }

    /// Discards results after parameters, inputs or states were set.
    #[inline]
    fn values_changed(&mut self) {
        if M::KIND == ModelKind::Continuous && self.is_before_start() {
            // The calculated states and the initial discrete state may depend on any value.
            self.run = None;
        }
        self.forget_results();
    }

    /// Discards outputs and derivatives, which are computed again when they are read.
    #[inline]
    fn forget_results(&mut self) {
        if M::HAS_CLOCKS
            && let Some(run) = &mut self.run
        {
            M::restore_outputs(run, &self.description.layout, &mut self.values);
            M::forget_evaluation(run);
        }
        self.outputs_are_old = true;
        self.derivatives_are_old = true;
        self.has_not_finite = false;
    }

    #[inline]
    fn outputs_are_due(&self) -> bool {
        // A source computes outputs up to the start and then holds them; a stateful model computes them in each step.
        let are_computed = M::KIND == ModelKind::Continuous || (M::CALCULATES_OUTPUTS && self.is_before_start());
        let are_clocked = M::HAS_CLOCKS && (self.mode == Mode::Event || self.layout().clocked.counts != Counts::ZERO);
        (are_computed || are_clocked) && self.outputs_are_old
    }

    #[inline]
    fn converts_float32(&self) -> bool {
        self.protocol.version == Version::Fmi2 && self.layout().has_float32
    }

    /// Returns true if a call may do arithmetic, and so needs the default floating-point environment. Setting real
    /// values only compares finite numbers; only continuous-time models compute when values are read after the start.
    #[inline]
    pub(crate) fn may_compute(&self, function: Function) -> bool {
        match function {
            // FMI 2.0 reads and sets a Float32 as a Real, which is converted.
            Function::GetReal | Function::SetReal if self.converts_float32() => true,
            Function::SetReal => false,
            Function::GetReal => M::KIND == ModelKind::Continuous || self.is_before_start() || self.is_stale(),
            _ => true,
        }
    }

    /// Updates outputs, derivatives and calculated parameters if the caller requests them. In a controller they are
    /// usually up to date; this function is inlined because a call would cost more than the test.
    #[inline(always)]
    fn refresh(&mut self, calculated: bool, outputs: bool, derivatives: bool) -> CallResult {
        let outputs = outputs && self.outputs_are_due();
        let derivatives = derivatives && self.derivatives_are_old;
        if calculated || outputs || derivatives { self.compute(outputs, derivatives) } else { Ok(()) }
    }

    /// Computes outputs and derivatives; if necessary, first the derived parameters and the state of the run.
    fn compute(&mut self, outputs: bool, derivatives: bool) -> CallResult {
        if self.is_stale() {
            self.derive()?;
        }
        let is_frozen = M::MODEL_EXCHANGE && self.mode == Mode::ContinuousTime;
        let mut has_not_finite = false;
        if M::HAS_CLOCKS && self.mode == Mode::Event {
            M::evaluate_clocks(self.context())?;
        }
        let Run { ctx, run, values } = self.context();
        if outputs {
            if is_frozen {
                M::eval_frozen(ctx, run, values, true);
            } else {
                // For a source, this takes the first sample, which is due at the start.
                M::outputs(ctx, run, values);
            }
            has_not_finite |= !are_finite(&values.reals[ctx.layout.outputs.reals()]);
        }
        if derivatives {
            if is_frozen {
                M::eval_frozen(ctx, run, values, false);
            } else {
                M::derivatives(ctx, run, values);
            }
            has_not_finite |= !are_finite(&values.reals[ctx.layout.derivatives.reals()]);
        }
        self.outputs_are_old &= !outputs;
        self.derivatives_are_old &= !derivatives;
        self.has_not_finite |= has_not_finite;
        Ok(())
    }

    /// fmi3GetVariableDependencies. Fails for an unknown reference.
    pub(crate) fn dependencies(&self, function: Function, reference: u32) -> CallResult<Vec<Dependency>> {
        self.description.dependencies_of(reference, self.is_before_start(), &self.values.lengths).ok_or_else(|| {
            self.error(function, format_args!("value reference {reference} is not a variable of this FMU"))
        })
    }

    /// Time of the last successful step in s.
    pub fn time(&self) -> f64 {
        self.timeline.time
    }
}

/// Converts a string for the C interface.
fn text(string: &str) -> CString {
    // A model may return a string that contains a zero byte, which would end the string in C.
    CString::new(string).unwrap_or_else(|_| CString::new(string.replace('\0', " ")).unwrap_or_default())
}

fn texts(strings: &[String]) -> Box<[CString]> {
    strings.iter().map(|string| text(string)).collect()
}
