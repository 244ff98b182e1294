//! FMU states, the calls that change them, and steps.

use super::{Checked, Fuzzer, MARK, Next, Spec, ensure, texts};
use crate::raw::{ERROR, OK, RawInstance, Truth};
use crate::signals::Random;
use fmu_import::c_api::{RawStatus, Reference};
use fmu_import::description::{DataType, FmiVersion, Interface};

/// FMU state of an instance, as in messages.
pub(super) type Mode = &'static str;

pub(super) const INSTANTIATED: Mode = "Instantiated";
pub(super) const INITIALIZATION: Mode = "Initialization Mode";
pub(super) const STEP: Mode = "Step Mode";
pub(super) const FAILED: Mode = "Step Failed";
pub(super) const EVENT: Mode = "Event Mode";
pub(super) const CONTINUOUS: Mode = "Continuous-Time Mode";
pub(super) const TERMINATED: Mode = "Terminated";
pub(super) const CONFIGURATION: Mode = "Configuration Mode";
pub(super) const RECONFIGURATION: Mode = "Reconfiguration Mode";
const MODES: [Mode; 9] =
    [INSTANTIATED, INITIALIZATION, STEP, FAILED, EVENT, CONTINUOUS, TERMINATED, CONFIGURATION, RECONFIGURATION];

const ENTER_INITIALIZATION: &str = "fmi2EnterInitializationMode";
const EXIT_INITIALIZATION: &str = "fmi2ExitInitializationMode";
const ENTER_EVENT: &str = "fmi2EnterEventMode";
const ENTER_CONTINUOUS: &str = "fmi2EnterContinuousTimeMode";
const ENTER_STEP: &str = "fmi3EnterStepMode";
const TERMINATE: &str = "fmi2Terminate";
const RESET: &str = "fmi2Reset";
const ENTER_CONFIGURATION: &str = "fmi3EnterConfigurationMode";
const EXIT_CONFIGURATION: &str = "fmi3ExitConfigurationMode";

/// Functions without arguments; the FMU state to which they lead, if they change it and the new state is the same in
/// all interfaces; the libraries that contain the functions.
const TRANSITIONS: [(&str, Option<Mode>, Libraries); 11] = [
    (ENTER_INITIALIZATION, Some(INITIALIZATION), Libraries::All),
    (EXIT_INITIALIZATION, None, Libraries::All),
    (TERMINATE, Some(TERMINATED), Libraries::All),
    (RESET, Some(INSTANTIATED), Libraries::All),
    ("fmi2CancelStep", None, Libraries::Fmi2CoSimulation),
    (ENTER_EVENT, Some(EVENT), Libraries::ModelExchangeAndFmi3),
    (ENTER_CONTINUOUS, Some(CONTINUOUS), Libraries::ModelExchangeAndFmi3),
    (ENTER_STEP, Some(STEP), Libraries::Fmi3),
    ("fmi3EvaluateDiscreteStates", None, Libraries::Fmi3),
    (ENTER_CONFIGURATION, None, Libraries::Fmi3),
    (EXIT_CONFIGURATION, None, Libraries::Fmi3),
];

/// Versions and interfaces whose libraries contain a function.
#[derive(Clone, Copy)]
enum Libraries {
    All,
    Fmi2CoSimulation,
    ModelExchangeAndFmi3,
    Fmi3,
}

impl Fuzzer<'_> {
    /// The FMU state of an instance with a logger, from the message of a call that is always rejected.
    pub(super) fn mode(&mut self, at: usize) -> Checked<Mode> {
        let slot = &self.slots[at];
        let (function, own, status) = match (self.version, slot.interface) {
            (_, Interface::ModelExchange) => {
                ("fmi2CompletedIntegratorStep", CONTINUOUS, slot.instance.completed_integrator_step(None))
            }
            (FmiVersion::V2, _) => ("fmi2CancelStep", STEP, slot.instance.transition("fmi2CancelStep")),
            (FmiVersion::V3, _) => ("fmi2DoStep", STEP, slot.instance.step_with_events(0.0, 0.0, None, None)),
        };
        self.probed(function, status)?;
        let name = self.name(function);
        ensure(status == ERROR, || format!("{name} returned {status}"))?;
        let slot = &self.slots[at];
        let text = texts(self.version, &slot.instance.take_log(), &slot.name)?;
        if text.starts_with(&format!("{name}: ")) {
            return Ok(own);
        }
        let mode = text.strip_prefix(&format!("{name} called in ")).and_then(|rest| rest.split(',').next());
        MODES.into_iter().find(|&known| Some(known) == mode).ok_or(format!("no mode in: {text}"))
    }

    fn has(&self, libraries: Libraries) -> bool {
        let is_fmi3 = self.version == FmiVersion::V3;
        match libraries {
            Libraries::All => true,
            Libraries::Fmi2CoSimulation => !is_fmi3 && self.interfaces.contains(&Interface::CoSimulation),
            Libraries::ModelExchangeAndFmi3 => is_fmi3 || self.interfaces.contains(&Interface::ModelExchange),
            Libraries::Fmi3 => is_fmi3,
        }
    }

    /// Calls a transition, which usually leads toward the FMU state in which a simulation advances, and rarely out of
    /// it.
    pub(super) fn transition(&mut self, at: usize) -> Checked {
        let (mode, is_exchange) = (self.slots[at].mode, self.slots[at].interface == Interface::ModelExchange);
        let is_fmi2 = self.version == FmiVersion::V2;
        let function = match mode {
            _ if self.chance(5) => {
                let all = TRANSITIONS.iter().filter(|(_, _, libraries)| self.has(*libraries));
                let all: Vec<_> = all.map(|(function, ..)| *function).collect();
                self.pick(&all)
            }
            CONFIGURATION | RECONFIGURATION => EXIT_CONFIGURATION,
            INSTANTIATED | STEP | EVENT if !self.structural.is_empty() && self.chance(4) => ENTER_CONFIGURATION,
            INSTANTIATED if is_fmi2 && self.chance(2) => return self.setup_experiment(at),
            INSTANTIATED => ENTER_INITIALIZATION,
            INITIALIZATION => self.pick(&[EXIT_INITIALIZATION, EXIT_INITIALIZATION, EXIT_INITIALIZATION, RESET]),
            STEP | EVENT | CONTINUOUS if self.chance(8) => self.pick(&[TERMINATE, RESET]),
            STEP if self.slots[at].events.mode_used && self.chance(2) => ENTER_EVENT,
            STEP => return self.get_real(at),
            EVENT if !self.clocks.is_empty() && !self.chance(4) => return self.clocks(at),
            EVENT if self.chance(2) => return self.update(at),
            EVENT if is_exchange => ENTER_CONTINUOUS,
            EVENT => ENTER_STEP,
            CONTINUOUS => ENTER_EVENT,
            _ => self.pick(&[TERMINATE, RESET]),
        };
        if function == ENTER_INITIALIZATION && !is_fmi2 {
            return self.enter_initialization(at);
        }
        let to = TRANSITIONS.iter().find(|(name, ..)| *name == function).and_then(|(_, to, _)| *to);
        let next = match to {
            Some(to) => Next::To(to),
            None if function == EXIT_INITIALIZATION => {
                let has_event_mode = is_exchange || self.slots[at].events.mode_used;
                Next::To(if has_event_mode { EVENT } else { STEP })
            }
            None => match (function, mode) {
                (ENTER_CONFIGURATION, INSTANTIATED) => Next::To(CONFIGURATION),
                (ENTER_CONFIGURATION, _) => Next::To(RECONFIGURATION),
                (EXIT_CONFIGURATION, CONFIGURATION) => Next::To(INSTANTIATED),
                (EXIT_CONFIGURATION, _) => Next::To(if is_exchange { EVENT } else { STEP }),
                _ => Next::Same,
            },
        };
        let status = self.call(at, function, String::new(), next, |instance| instance.transition(function))?;
        ensure(function != RESET || status == OK, || "a reset was rejected".to_owned())
    }

    /// A random start and stop time.
    fn experiment(&mut self) -> (f64, f64) {
        let start = if self.chance(2) { self.wild() } else { 0.0 };
        (start, if self.chance(3) { self.wild() } else { 1e6 })
    }

    fn setup_experiment(&mut self, at: usize) -> Checked {
        let (start, stop) = self.experiment();
        let (has_stop, has_tolerance, tolerance) = (self.integer(), self.integer(), self.wild());
        let text = format!("{has_tolerance} {tolerance:e} {start:e} {has_stop} {stop:e}");
        self.call(at, "fmi2SetupExperiment", text, Next::Same, |instance| {
            instance.setup_experiment_with((has_tolerance, tolerance), start, (has_stop, stop))
        })
        .map(drop)
    }

    fn enter_initialization(&mut self, at: usize) -> Checked {
        let (start, stop) = self.experiment();
        let (has_stop, has_tolerance, tolerance) = (self.chance(2), self.chance(2), self.wild());
        let text = format!("{has_tolerance} {tolerance:e} {start:e} {has_stop} {stop:e}");
        self.call(at, ENTER_INITIALIZATION, text, Next::To(INITIALIZATION), |instance| {
            instance.enter_initialization((has_tolerance, tolerance), start, (has_stop, stop))
        })
        .map(drop)
    }

    /// The time of an instance as reported by the FMU, otherwise 0.
    pub(super) fn now(&mut self, at: usize) -> f64 {
        let (mut now, instance) = ([0.0], &self.slots[at].instance);
        match self.time {
            Some(time) => instance.get(Some(&[time]), 1, Some(&mut now)),
            None if self.slots[at].interface == Interface::ModelExchange => OK,
            None => instance.real_status(2, Some(&mut now[0])),
        };
        let _ = self.slots[at].instance.take_log();
        now[0]
    }

    pub(super) fn do_step(&mut self, at: usize) -> Checked {
        let now = self.now(at);
        let time = if self.chance(10) { self.wild() } else { now };
        let step = if self.chance(10) { self.wild() } else { self.pick(&[1e-3, 1e-3, 1e-2, 1e-4, self.step]) };
        // The first ticks of periodic clocks are a step apart.
        let step = if self.clocks.is_empty() || self.chance(4) { step } else { self.step };
        // Up to a million samples in a step are allowed. Such steps can take seconds, so they are made rarely.
        let step = if (1.0..1e6).contains(&step) && !self.chance(64) { 0.5 } else { step };
        let text = format!("{time:e} {step:e}");
        if self.version == FmiVersion::V3 {
            return self.step_with_events(at, now, (time, step), text);
        }
        self.call(at, "fmi2DoStep", text, Next::Same, |instance| instance.do_step(time, step)).map(drop)
    }

    fn step_with_events(&mut self, at: usize, now: f64, (time, step): (f64, f64), text: String) -> Checked {
        const FLAG: u8 = 77;
        let (mut flags, mut last) = ([FLAG; 3], MARK);
        let flags_there = (!self.chance(40)).then_some(&mut flags);
        let last_there = (!self.chance(40)).then_some(&mut last);
        let is_complete = flags_there.is_some() && last_there.is_some();
        let required = self.slots[at].events.updates.unwrap_or_default();
        let mut importer = Importer {
            random: Random(self.random.bits()),
            required,
            has_logger: self.slots[at].has_logger,
            may_return: self.slots[at].events.early_return && self.chance(2),
            has_requested: false,
            fault: None,
        };
        let status = self.call(at, "fmi2DoStep", text, Next::Same, |instance| {
            let update = &mut || importer.update(instance, time, step);
            instance.step_with_updates((time, step), flags_there, last_there, update)
        })?;
        importer.fault.map_or(Ok(()), Err)?;
        if status != OK {
            // The standard allows an importer to read the last successful time, which is the time before the step.
            let is_kept = flags == [FLAG; 3] && last == MARK;
            let is_reached = flags == [0; 3] && last.to_bits() == now.to_bits();
            return ensure(is_kept || is_reached, || {
                format!("fmi3DoStep at {now:e} returned {status} and wrote {flags:?} {last:e}")
            });
        }
        let [event, terminate, early] = flags;
        let end = time + step;
        let stays_within = last.is_finite() && last >= time && (last - end) <= 1e-6 * step + 1e-9 * end.abs();
        let is_whole = (last - end).abs() <= 1e-6 * step + 1e-9 * end.abs();
        let returns_early = self.slots[at].events.mode_used && self.slots[at].events.early_return;
        let is_requested = u8::from(importer.has_requested);
        let is_right = is_complete
            && flags.iter().all(|flag| *flag <= 1)
            && terminate <= self.can_finish
            && event + terminate <= 1
            && early <= event + terminate + is_requested
            && stays_within
            && (early + terminate > 0 || is_whole)
            && (event == 0 || returns_early);
        ensure(is_right, || format!("fmi3DoStep of {time:e} by {step:e} wrote {flags:?} {last:e}"))
    }

    /// Returns true if an instance is in a mode in which structural parameters are set.
    pub(super) fn is_configuring(&self, at: usize) -> bool {
        [CONFIGURATION, RECONFIGURATION].contains(&self.slots[at].mode)
    }

    /// Sets the length of arrays, usually to a valid one.
    pub(super) fn set_length(&mut self, at: usize) -> Checked {
        let place = self.index(self.structural.len());
        let reference = self.structural[place].0;
        let limits = self.specs.iter().find(|spec| spec.reference == reference).map_or([0.0; 2], |spec| spec.limits);
        let value = if self.chance(8) { self.random.bits() } else { self.random.below(limits[1] as u64 + 2) };
        let function = "fmi3SetUInt64";
        let text = format!("{reference} {value}");
        let status =
            self.call(at, function, text, Next::Same, |instance| instance.set(Some(&[reference]), 1, Some(&[value])))?;
        // All lengths of these FMUs are tunable.
        let is_valid = (limits[0]..=limits[1]).contains(&(value as f64));
        ensure((status == OK) == is_valid, || format!("{function} returned {status} for the length {value}"))?;
        if status == OK {
            self.slots[at].lengths[place] = value;
        }
        Ok(())
    }

    /// Compares the lengths of arrays with those that were set, which only a restored state and a reset change.
    pub(super) fn check_lengths(&mut self, at: usize, function: &str, status: RawStatus) -> Checked {
        if self.structural.is_empty() {
            return Ok(());
        }
        if self.is_configuring(at) {
            // In these modes, no value can be read.
            self.slots[at].are_lengths_known &= status != OK || function != "fmi2SetFMUstate";
            return Ok(());
        }
        let references: Vec<_> = self.structural.iter().map(|(reference, _)| *reference).collect();
        let mut lengths = vec![0_u64; references.len()];
        let slot = &mut self.slots[at];
        let read = slot.instance.get(Some(&references), references.len(), Some(&mut lengths));
        let log = slot.instance.take_log();
        let are_known = std::mem::replace(&mut slot.are_lengths_known, true);
        if !are_known || status == OK && function == "fmi2SetFMUstate" {
            slot.lengths.clone_from(&lengths);
        } else if status == OK && function == RESET {
            slot.lengths = self.structural.iter().map(|(_, start)| *start).collect();
        }
        let expected = slot.lengths.clone();
        ensure(read == OK && lengths == expected, || {
            format!("after {function}, the lengths are {lengths:?}, expected {expected:?}: {log:?}")
        })?;
        self.probed("fmi3GetUInt64", read)
    }

    /// References to the real variables.
    pub(super) fn reals(&self) -> Vec<Reference> {
        let is_ordinary = |spec: &&Spec| self.time.is_none_or(|time| spec.reference < time);
        self.of_type(DataType::Float64).filter(is_ordinary).map(|spec| spec.reference).collect()
    }

    /// Reads values of all types, because some are computed only when they are first needed. Event indicators are read
    /// separately, because the call can be discarded.
    pub(super) fn compute(&mut self, at: usize) -> Checked {
        let reals = self.reals();
        let count = self.size(at, &reals);
        let mut statuses = Vec::new();
        let first = |fuzzer: &Self, data_type| fuzzer.of_type(data_type).map(|spec| spec.reference).next();
        let others = [DataType::Int32, DataType::Boolean, DataType::String].map(|data_type| first(self, data_type));
        let sizes = others.map(|reference| self.size(at, reference.as_slice()));
        let instance = &self.slots[at].instance;
        statuses
            .push(("fmi2GetReal", instance.get_counted(Some(&reals), reals.len(), Some(&mut vec![0.0; count]), count)));
        if let Some(time) = self.time.filter(|_| self.indicators > 0) {
            statuses.push(("fmi2GetReal", instance.get(Some(&[time + 1]), 1, Some(&mut [0.0]))));
        }
        let [integer, boolean, string] = others;
        if let Some(reference) = integer {
            let values = &mut vec![0_i32; sizes[0]];
            statuses.push(("fmi2GetInteger", instance.get_counted(Some(&[reference]), 1, Some(values), sizes[0])));
        }
        if let Some(reference) = boolean {
            let status = if self.version == FmiVersion::V2 {
                instance.get(Some(&[reference]), 1, Some(&mut [Truth(0)]))
            } else {
                instance.get_counted(Some(&[reference]), 1, Some(&mut vec![0_u8; sizes[1]]), sizes[1])
            };
            statuses.push(("fmi2GetBoolean", status));
        }
        if let Some(reference) = string {
            statuses.push(("fmi2GetString", instance.get_texts(Some(&[reference]), 1, Some(1)).0));
        }
        let _ = instance.take_log();
        statuses.into_iter().try_for_each(|(function, status)| self.probed(function, status))
    }
}

/// The importer during the intermediate updates of a step.
struct Importer<'a> {
    random: Random,
    required: &'a [Reference],
    has_logger: bool,
    may_return: bool,
    has_requested: bool,
    fault: Option<String>,
}

impl Importer<'_> {
    /// Makes a call in an update, with a status that FMI 3.0.2, section 4.2.1, requires: the required variables can be
    /// read, and nothing else is allowed.
    fn update(&mut self, instance: &RawInstance<'_>, time: f64, step: f64) -> Option<f64> {
        let (reference, mut value) =
            (self.required[self.random.below(self.required.len() as u64) as usize], [f64::NAN]);
        let (function, status, expected) = match self.random.below(8) {
            0 | 1 => {
                // An array has another number of values.
                let status = instance.get(Some(&[reference]), 1, Some(&mut value));
                ("fmi3GetFloat64", status, if value[0].is_finite() { OK } else { ERROR })
            }
            2 => ("fmi3SetFloat64", instance.set(Some(&[reference]), 1, Some(&[0.0])), ERROR),
            3 => ("fmi3DoStep", instance.step_with_events(time, step, Some(&mut [0; 3]), Some(&mut 0.0)), ERROR),
            4 => ("fmi3Reset", instance.transition(RESET), ERROR),
            5 => ("fmi3Terminate", instance.transition(TERMINATE), ERROR),
            6 => (ENTER_CONFIGURATION, instance.transition(ENTER_CONFIGURATION), ERROR),
            _ => ("fmi3EnterEventMode", instance.transition(ENTER_EVENT), ERROR),
        };
        let log = instance.take_log();
        if status != expected || (self.has_logger && log.is_empty() != (status == OK)) {
            self.fault = Some(format!("{function} in an intermediate update returned {status}: {log:?}"));
        }
        let is_requested = self.may_return && self.random.below(4) == 0;
        self.has_requested |= is_requested;
        is_requested.then(|| time + step * (1.2 * self.random.symmetric().abs()))
    }
}
