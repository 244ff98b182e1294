//! An instance: life cycle and function calls.

use super::array_values::{Buffers, Whole};
use super::callbacks::{OpenLog, allocate_memory, free_memory, log_text, logger};
use super::calls::{self, Board, Function};
use super::clocks::Clocks;
use super::error::{CallError, CallProblem, FailedCall, Message, Status};
use super::floats::{self, FloatEnvironment};
use super::functions::{Functions, v3};
use super::integration::{Integration, Point};
use super::library::Library;
use super::{scheduled, updates};
use crate::c_api::v3::RawBoolean;
use crate::c_api::{self, CallbackFunctions, Component, RawStatus, Reference};
use crate::description::{FmiVersion, Interface};
use crate::signature::Signature;
use std::ffi::{CString, c_char};
use std::ptr;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// A step that ends earlier than this before its end, in steps, has returned early even without the flag. FMUs add up
/// step sizes: after 1,000,000 steps of 1 ms, the sum is wrong by 2e-5 steps.
const EARLY: f64 = 1e-3;

/// Results of the last `fmi3DoStep`.
#[derive(Debug, Clone, Copy)]
pub(super) struct StepEnd {
    pub(super) event: RawBoolean,
    pub(super) terminate: RawBoolean,
    early: RawBoolean,
    pub(super) time: f64,
}

impl Default for StepEnd {
    /// An FMU that writes nothing has made the step.
    fn default() -> Self {
        Self { event: 0, terminate: 0, early: 0, time: f64::INFINITY }
    }
}

/// An instance, freed when dropped.
///
/// Methods are named after the C functions of FMI 2.0 and also work with FMI 3.0. Getting and setting numbers and
/// stepping do not allocate, unless they fail or transfer more FMI 3.0 values of a type than before.
///
/// # Errors
/// Each method returns an error if the status is above `fmi2Warning`, or if the FMU does not have the function for this
/// interface. The error contains the messages of the instance. If the lengths of arrays do not match, a string contains
/// a zero byte, or a saved state comes from another instance, the method fails without calling the FMU.
pub struct Instance {
    pub(super) component: Component,
    // Every call is recorded here; `index` identifies the component.
    board: Option<&'static Board>,
    index: u64,
    dead: bool,
    /// The floating-point environment before the FMU was called.
    floats: FloatEnvironment,
    /// True if a call has changed the floating-point environment.
    has_changed_floats: bool,
    pub(super) states: Vec<c_api::State>,
    name: CString,
    /// Start and stop time, which `fmi3EnterInitializationMode` needs.
    experiment: (f64, Option<f64>),
    pub(super) step_end: StepEnd,
    /// True if states from before the start of a step may be restored after it.
    goes_back: bool,
    /// The last function that wrote to an array without elements.
    pub(super) overrun: Option<Function>,
    pub(super) has_entered: bool,
    pub(super) whole: Whole,
    pub(super) buffers: Buffers,
    /// Clocks of an FMU of FMI 3.0, if it has any.
    pub(super) clocks: Option<Box<Clocks>>,
    /// The integrator, if `do_step` integrates the states.
    pub(super) integration: Option<Box<Integration>>,
    /// The clocks and the position of the integrator of each of `states`.
    pub(super) saved: Vec<(Option<Box<Clocks>>, Option<Point>)>,
    pub(super) log: OpenLog,
    // The instance keeps a pointer to the callbacks until it is freed.
    _callbacks: Box<CallbackFunctions>,
    library: Arc<Library>,
}

// SAFETY: the pointers to component, states, log and callbacks belong to this instance only, and every call needs
// exclusive access. FMI requires that calls to an instance are sequential, not that they come from one thread.
unsafe impl Send for Instance {}

/// Optional features of co-simulation in FMI 3.0 that an instance uses.
#[derive(Clone, Copy, Default)]
pub(super) struct Uses<'a> {
    /// Event Mode, also without clocks.
    pub(super) events: bool,
    /// Early return.
    pub(super) early: bool,
    /// Intermediate updates, in which these variables are read.
    pub(super) updates: Option<&'a [Reference]>,
}

impl Instance {
    /// `fmi2Instantiate`, `fmi3InstantiateCoSimulation`, `fmi3InstantiateModelExchange` or
    /// `fmi3InstantiateScheduledExecution`, for the library's interface. Sets `visible` to false, and uses neither
    /// early return nor, in co-simulation without clocks, Event Mode. `logging` requests messages other than errors.
    /// Fails if the FMU returns no instance, or if a name contains a zero byte.
    pub fn instantiate(library: &Arc<Library>, name: &str, guid: &str, logging: bool) -> Result<Self, CallError> {
        Self::instantiate_with(library, name, guid, logging, Uses::default())
    }

    /// Like [`Self::instantiate`], but an FMU of FMI 3.0 uses Event Mode and early return in co-simulation, also without
    /// clocks. The caller handles the events ([`Self::share_events`]).
    pub fn instantiate_with_events(library: &Arc<Library>, name: &str, guid: &str) -> Result<Self, CallError> {
        Self::instantiate_with(library, name, guid, false, Uses { events: true, early: true, updates: None })
    }

    pub(super) fn instantiate_with(
        library: &Arc<Library>,
        name: &str,
        guid: &str,
        logging: bool,
        uses: Uses<'_>,
    ) -> Result<Self, CallError> {
        let Signature { fmi, interface, .. } = library.signature;
        let function = match interface {
            Interface::CoSimulation => Function::InstantiateCoSimulation,
            Interface::ModelExchange => Function::InstantiateModelExchange,
            Interface::ScheduledExecution => Function::InstantiateScheduledExecution,
        };
        let failed = |problem, messages| {
            let call = FailedCall { instance: name.to_string(), function: function.name(fmi), problem, messages };
            CallError::from(call)
        };
        let (Ok(c_name), Ok(c_guid)) = (CString::new(name), CString::new(guid)) else {
            return Err(failed(CallProblem::Arguments("the name or the GUID contains a zero byte"), Vec::new()));
        };
        let log = OpenLog::new(name);
        let callbacks = Box::new(CallbackFunctions {
            logger: logger(),
            allocate_memory,
            free_memory,
            step_finished: None,
            environment: log.environment(),
        });
        let board = calls::board();
        let index = board.map_or(0, Board::current);
        if let Some(board) = board {
            board.enter(index, function, fmi);
        }
        let resources = library.resources.as_ptr();
        let floats = FloatEnvironment::current();
        // SAFETY: all pointers are valid during the call; callbacks and log live as long as the instance.
        let component = unsafe {
            match &library.functions {
                Functions::V2(f) => (f.instantiate)(
                    c_name.as_ptr(),
                    match interface {
                        Interface::CoSimulation => c_api::CO_SIMULATION,
                        _ => c_api::MODEL_EXCHANGE,
                    },
                    c_guid.as_ptr(),
                    resources,
                    &raw const *callbacks,
                    c_api::FALSE,
                    c_api::Boolean::from(logging),
                ),
                Functions::V3(v3::Functions { instantiate_scheduled_execution: Some(instantiate), .. }) => instantiate(
                    c_name.as_ptr(),
                    c_guid.as_ptr(),
                    resources,
                    false,
                    logging,
                    callbacks.environment,
                    log_text,
                    scheduled::clock_update,
                    scheduled::lock_preemption,
                    scheduled::unlock_preemption,
                ),
                Functions::V3(f) => match (f.instantiate_co_simulation, f.instantiate_model_exchange) {
                    (Some(instantiate), _) => instantiate(
                        c_name.as_ptr(),
                        c_guid.as_ptr(),
                        resources,
                        false,
                        logging,
                        // FMI 3.0.2, section 2.3.1: required if the FMU has clocks.
                        Clocks::of(&library.signature, uses.events).is_some(),
                        uses.early,
                        uses.updates.map_or(ptr::null(), |variables| variables.as_ptr()),
                        uses.updates.map_or(0, |variables| variables.len()),
                        callbacks.environment,
                        log_text,
                        uses.updates.map(|_| updates::intermediate_update as _),
                    ),
                    (None, Some(instantiate)) => instantiate(
                        c_name.as_ptr(),
                        c_guid.as_ptr(),
                        resources,
                        false,
                        logging,
                        callbacks.environment,
                        log_text,
                    ),
                    // Unreachable: the table contains one of these functions.
                    (None, None) => ptr::null_mut(),
                },
            }
        };
        if FloatEnvironment::current() != floats {
            floats.restore(function.name(fmi));
        }
        if let Some(board) = board {
            board.leave();
        }
        if component.is_null() {
            return Err(failed(CallProblem::NoInstance, log.take()));
        }
        library.instances.fetch_add(1, Ordering::AcqRel);
        let mut instance = Self {
            component,
            board,
            index,
            dead: false,
            floats,
            has_changed_floats: false,
            states: Vec::new(),
            name: c_name,
            experiment: (0.0, None),
            step_end: StepEnd::default(),
            goes_back: false,
            overrun: None,
            has_entered: false,
            whole: Whole::default(),
            buffers: Buffers::default(),
            clocks: Clocks::of(&library.signature, uses.events),
            integration: None,
            saved: Vec::new(),
            log,
            _callbacks: callbacks,
            library: Arc::clone(library),
        };
        instance.configure()?;
        Ok(instance)
    }

    /// Name given at instantiation.
    pub fn name(&self) -> &str {
        self.name.to_str().unwrap_or_default()
    }

    pub(super) fn fmi(&self) -> FmiVersion {
        self.library.functions.fmi()
    }

    /// Start and stop time in s.
    pub(super) fn experiment(&self) -> (f64, Option<f64>) {
        self.experiment
    }

    pub(super) fn library(&self) -> &Arc<Library> {
        &self.library
    }

    pub(super) fn signature(&self) -> &Signature {
        &self.library.signature
    }

    /// Messages since the last call to this function; at most the last 100.
    pub fn take_messages(&mut self) -> Vec<Message> {
        self.log.take()
    }

    #[cold]
    pub(super) fn failure(&mut self, function: Function, problem: CallProblem) -> CallError {
        if problem == CallProblem::Status(Status::Fatal) {
            self.dead = true;
        }
        let function = function.name(self.fmi());
        FailedCall { instance: self.name().to_string(), function, problem, messages: self.log.take() }.into()
    }

    fn enter(&self, function: Function) {
        if let Some(board) = self.board {
            board.enter(self.index, function, self.fmi());
        }
    }

    fn leave(&self) {
        if let Some(board) = self.board {
            board.leave();
        }
    }

    /// Calls the FMU and checks the status. Fails after a fatal error.
    pub(super) fn call(
        &mut self,
        function: Function,
        call: impl FnOnce(&Functions, Component) -> RawStatus,
    ) -> Result<(), CallError> {
        if self.dead {
            return Err(self.failure(function, CallProblem::Dead));
        }
        self.enter(function);
        let status = call(&self.library.functions, self.component);
        // Reading the control word waits until all operations of the FMU are complete. For short calls, only the
        // rounding mode is tested, with arithmetic.
        let is_same = match function {
            Function::GetReal | Function::SetReal if self.floats.allows_inexact() => floats::rounds_to_nearest(),
            _ => FloatEnvironment::current() == self.floats,
        };
        if !is_same {
            self.restore_floats(function);
        }
        self.leave();
        match status {
            0 | 1 => Ok(()),
            status => Err(self.failure(function, CallProblem::Status(Status::from(status)))),
        }
    }

    #[cold]
    fn restore_floats(&mut self, function: Function) {
        if FloatEnvironment::current() == self.floats {
            // The rounding mode was already different when the instance was created, so the FMU has not changed it.
            return;
        }
        let function = function.name(self.fmi());
        let change = self.floats.restore(function);
        if !self.has_changed_floats {
            self.has_changed_floats = true;
            let text = format!("{function} changes {change} of its process; it is restored after each call");
            self.log.warn(text);
        }
    }

    /// Like [`Self::call`], for a function that the FMU may not have. If the function is missing, `call` must return
    /// `None`.
    pub(super) fn call_present(
        &mut self,
        function: Function,
        call: impl FnOnce(&Functions, Component) -> Option<RawStatus>,
    ) -> Result<(), CallError> {
        let mut is_missing = false;
        let result = self.call(function, |f, component| {
            call(f, component).unwrap_or_else(|| {
                is_missing = true;
                0
            })
        });
        if is_missing { Err(self.missing(function)) } else { result }
    }

    /// Like [`Self::call_present`], for a function with the same signature in both versions.
    pub(super) fn call_optional<F: Copy>(
        &mut self,
        function: Function,
        select: impl FnOnce(&Functions) -> Option<F>,
        call: impl FnOnce(F, Component) -> RawStatus,
    ) -> Result<(), CallError> {
        match select(&self.library.functions) {
            Some(f) => self.call(function, |_, component| call(f, component)),
            None => Err(self.missing(function)),
        }
    }

    #[cold]
    fn missing(&mut self, function: Function) -> CallError {
        let interface = self.signature().interface;
        let is_of_other = function.interface().is_some_and(|other| other != interface);
        let problem = if is_of_other { CallProblem::Interface(interface) } else { CallProblem::NotExported };
        self.failure(function, problem)
    }

    pub(super) fn same_length(
        &mut self,
        function: Function,
        references: usize,
        values: usize,
    ) -> Result<(), CallError> {
        if references == values {
            Ok(())
        } else {
            Err(self.failure(function, CallProblem::Arguments("the numbers of references and values must be equal")))
        }
    }

    /// `fmi2SetDebugLogging` for these categories; if there are none, for all.
    pub fn set_debug_logging(&mut self, on: bool, categories: &[&str]) -> Result<(), CallError> {
        const NAME: Function = Function::SetDebugLogging;
        let (_owned, pointers) = self.c_strings(NAME, categories)?;
        // SAFETY: live instance; the array contains as many C strings as stated.
        self.call_present(NAME, |f, c| unsafe {
            match f {
                Functions::V2(f) => {
                    Some(f.set_debug_logging?(c, c_api::Boolean::from(on), pointers.len(), pointers.as_ptr()))
                }
                Functions::V3(f) => Some(f.set_debug_logging?(c, on, pointers.len(), pointers.as_ptr())),
            }
        })
    }

    /// `fmi2SetupExperiment` without a tolerance; the times are in s. In FMI 3.0, the times are arguments of the later
    /// call to `fmi3EnterInitializationMode`.
    pub fn setup_experiment(&mut self, start: f64, stop: Option<f64>) -> Result<(), CallError> {
        self.experiment = (start, stop);
        // SAFETY: live instance.
        self.call(Function::SetupExperiment, |f, c| unsafe {
            match f {
                Functions::V2(f) => {
                    let has_stop = c_api::Boolean::from(stop.is_some());
                    (f.setup_experiment)(c, c_api::FALSE, 0.0, start, has_stop, stop.unwrap_or(0.0))
                }
                Functions::V3(_) => 0,
            }
        })
    }

    /// `fmi2EnterInitializationMode`.
    pub fn enter_initialization_mode(&mut self) -> Result<(), CallError> {
        let (start, stop) = self.experiment;
        // SAFETY: live instance.
        self.has_entered = true;
        self.call(Function::EnterInitializationMode, |f, c| unsafe {
            match f {
                Functions::V2(f) => (f.enter_initialization_mode)(c),
                Functions::V3(f) => {
                    (f.enter_initialization_mode)(c, false, 0.0, start, stop.is_some(), stop.unwrap_or(0.0))
                }
            }
        })
    }

    /// `fmi2ExitInitializationMode`.
    pub fn exit_initialization_mode(&mut self) -> Result<(), CallError> {
        if self.clocks.is_some() {
            self.start_clocks(self.experiment.0)?;
        }
        // SAFETY: live instance.
        self.call(Function::ExitInitializationMode, |f, c| unsafe { f.exit_initialization_mode()(c) })?;
        self.start_integration()?;
        if self.clocks.is_some() { self.enter_first_step_mode() } else { Ok(()) }
    }

    /// `fmi2Terminate`.
    pub fn terminate(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call(Function::Terminate, |f, c| unsafe { f.terminate()(c) })
    }

    /// `fmi2Reset`.
    pub fn reset(&mut self) -> Result<(), CallError> {
        self.has_entered = false;
        self.whole = Whole::default();
        self.clocks = Clocks::of(self.signature(), self.clocks.is_some());
        if let Some(own) = &self.integration {
            self.integrate(own.solver);
        }
        // SAFETY: live instance.
        self.call(Function::Reset, |f, c| unsafe { f.reset()(c) })?;
        self.configure()
    }

    /// `fmi2DoStep` from `time` to `time + step`, both in s; in scheduled execution, the activations in this interval; in
    /// model exchange, the integration over it ([`Self::integrate`]).
    /// No earlier state may be restored afterwards, except after [`Self::allow_earlier_states`]. Also fails if the FMU
    /// has not finished the step, or ends the simulation.
    #[inline]
    pub fn do_step(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        match &self.clocks {
            _ if self.integration.is_some() => self.step_integration(time, step),
            None => self.step(time, step),
            Some(_) if self.is_scheduled() => self.step_partitions(time, step),
            Some(_) => self.step_with_clocks(time, step),
        }
    }

    /// Lets later steps be undone: a state from before the start of a step may be restored after it.
    pub fn allow_earlier_states(&mut self) {
        self.goes_back = true;
    }

    /// Like [`Self::do_step`], without ticks of clocks; the step must not go past [`Self::next_tick`].
    pub fn step(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        let mut end = StepEnd::default();
        let is_final = !self.goes_back;
        // SAFETY: live instance; the end of the step is written through valid pointers.
        let result = self.call_present(Function::DoStep, |f, c| unsafe {
            match f {
                Functions::V2(f) => Some(f.do_step?(c, time, step, c_api::Boolean::from(is_final))),
                Functions::V3(f) => {
                    let StepEnd { event, terminate, early, time: reached } = &mut end;
                    Some(f.do_step?(c, time, step, is_final, event, terminate, early, reached))
                }
            }
        });
        self.step_end = end;
        result?;
        if end.terminate | end.early == 0 { Ok(()) } else { Err(self.not_stepped(end)) }
    }

    /// Fails if the last step, from `time` to `time + step`, has returned early by the time that the FMU has written
    /// (FMI 3.0). This is not a part of [`Self::step`], which computes nothing in the floating-point environment of the
    /// host.
    #[inline]
    pub fn check_reached(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        let is_early = self.step_end.time < time + (1.0 - EARLY) * step;
        if is_early { Err(self.not_stepped(self.step_end)) } else { Ok(()) }
    }

    #[cold]
    fn not_stepped(&mut self, end: StepEnd) -> CallError {
        let problem = if end.terminate != 0 { CallProblem::Terminated } else { CallProblem::EarlyReturn };
        self.failure(Function::DoStep, problem)
    }

    pub(super) fn c_strings(
        &mut self,
        function: Function,
        texts: &[&str],
    ) -> Result<(Vec<CString>, Vec<*const c_char>), CallError> {
        let owned: Result<Vec<CString>, _> = texts.iter().map(|t| CString::new(*t)).collect();
        match owned {
            Ok(owned) => {
                let pointers = owned.iter().map(|s| s.as_ptr()).collect();
                Ok((owned, pointers))
            }
            Err(_) => Err(self.failure(function, CallProblem::Arguments("a string contains a zero byte"))),
        }
    }
}

impl std::fmt::Debug for Instance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Instance").field("name", &self.name).field("dead", &self.dead).finish_non_exhaustive()
    }
}

impl Drop for Instance {
    fn drop(&mut self) {
        // After fmi2Fatal no function may be called, not even fmi2FreeInstance.
        if !self.dead {
            // The caller may have changed the environment since the last call.
            let floats = FloatEnvironment::current();
            if let Some(free) = self.library.functions.free_state() {
                self.enter(Function::FreeFmuState);
                for state in &mut self.states {
                    if !state.is_null() {
                        // SAFETY: live instance; the state came from it. A failure cannot be handled here.
                        unsafe { free(self.component, &raw mut *state) };
                    }
                }
            }
            self.enter(Function::FreeInstance);
            // SAFETY: the instance is freed once, here.
            unsafe { self.library.functions.free_instance()(self.component) };
            if FloatEnvironment::current() != floats {
                floats.restore(Function::FreeInstance.name(self.fmi()));
            }
            self.leave();
        }
        self.library.instances.fetch_sub(1, Ordering::AcqRel);
    }
}
