//! Fuzzer: calls any function, in any order, with any arguments that the C types allow.
//!
//! The standard does not define the effect of invalid calls. The reference is ARCHITECTURE.md ("Status", "Time"). Every
//! call is checked: the status is fmi2OK, fmi2Discard or fmi2Error; an error is logged with a reason and keeps the FMU
//! state; nothing is written beyond the end of an array, and a rejected call writes nothing at all; returned numbers
//! are finite. For some calls, it is also checked that a rejected call does not change the saved state.
//!
//! An FMU cannot detect the following mistakes, so they are not covered: arrays that are shorter than stated, strings
//! without a terminating zero, freed instances and, except in [scheduled execution](fuzz_scheduled), calls of one
//! instance from two threads.

use crate::Fmu;
use crate::raw::{Arguments, DISCARD, ERROR, Entry, EventArguments, OK, Raw, RawInstance, RawState, in_version};
use crate::signals::Random;
use crate::state_bytes::checksum;
use fmu_import::c_api::{self, RawStatus, Reference};
use fmu_import::description::{Causality, DataType, Dimension, FmiVersion, Interface, Value};
use modes::{CONFIGURATION, FAILED, INSTANTIATED, Mode, RECONFIGURATION};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::ffi::{CStr, CString};
use std::time::{Duration, Instant};

mod arguments;
mod exchange;
mod modes;
mod questions;
mod scheduled;
mod states;
mod values;

pub use scheduled::fuzz_scheduled;

/// Number of calls that are shown after a violation.
const SHOWN: usize = 50;
/// Number of instances of an FMU that are alive at the same time.
const INSTANCES: usize = 4;
/// Maximum number of states of an instance, and of serialized states, that are kept at the same time.
const STATES: usize = 6;
/// Content of an array of numbers before a call.
const MARK: f64 = -7.25e77;

/// Statistics of the calls.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Calls that the generator chose.
    pub calls: u64,
    /// Number of these calls that were made to instances of the other interface.
    pub others: u64,
    /// Additional calls that check the FMU state and the saved state of an instance.
    pub probes: u64,
    /// Number of calls of each function that returned fmi2OK, fmi2Discard and fmi2Error.
    pub functions: BTreeMap<&'static str, [u64; 3]>,
    /// The slowest call.
    pub slowest: (Duration, String),
}

impl Report {
    /// Adds the numbers of another report.
    pub fn add(&mut self, other: &Self) {
        self.calls += other.calls;
        self.others += other.others;
        self.probes += other.probes;
        for (function, counts) in &other.functions {
            let sum = self.functions.entry(function).or_default();
            sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
        }
        if other.slowest.0 > self.slowest.0 {
            self.slowest.clone_from(&other.slowest);
        }
    }
}

/// An FMU that broke a rule.
#[derive(Clone, Debug)]
pub struct Violation {
    /// Description of the violation.
    pub what: String,
    /// Number of the call, from 1.
    pub call: u64,
    /// The last calls, ending with this one.
    pub last: Vec<String>,
}

/// A variable and its valid values.
struct Spec {
    reference: Reference,
    data_type: DataType,
    /// Length of each dimension of an array.
    dimensions: Vec<Length>,
    start: f64,
    limits: [f64; 2],
}

/// Length of an array in one dimension.
#[derive(Clone, Copy)]
enum Length {
    Fixed(usize),
    /// The value of a structural parameter, by its position in [`Fuzzer::structural`].
    Parameter(usize),
}

struct Slot<'a> {
    instance: RawInstance<'a>,
    interface: Interface,
    events: EventArguments<'a>,
    /// Values of the structural parameters.
    lengths: Vec<u64>,
    /// False after a state was restored to a mode in which no value can be read.
    are_lengths_known: bool,
    name: Vec<u8>,
    has_logger: bool,
    /// True if the instance logs all categories, including discarded calls.
    all_logged: bool,
    /// FMU state. It is known only with a logger, because it is read from error messages.
    mode: Mode,
    /// Saved states, each with the FMU state in which it was saved; `None` for crafted bytes.
    states: Vec<(RawState, Option<Mode>)>,
    freed: Vec<RawState>,
}

/// The bytes of a state.
#[derive(Clone)]
struct Bytes {
    bytes: Vec<u8>,
    /// The FMU state in which the state was saved, if known.
    mode: Option<Mode>,
    /// The interface of the instance from which the state was saved.
    interface: Interface,
}

/// The FMU state after a call that returned fmi2OK.
enum Next {
    Same,
    To(Mode),
    /// Not known in advance, so it is read from a message.
    Any,
}

/// Calls one FMU.
struct Fuzzer<'a> {
    raw: &'a Raw,
    version: FmiVersion,
    /// The interface of most instances, followed by all interfaces that the FMU provides.
    interface: Interface,
    interfaces: Vec<Interface>,
    random: Random,
    specs: Vec<Spec>,
    /// The value reference of the time (FMI 3.0).
    time: Option<Reference>,
    /// Unknowns and knowns of directional derivatives.
    unknown: Vec<Reference>,
    known: Vec<Reference>,
    states: Vec<Reference>,
    indicators: usize,
    /// Structural parameters that are lengths of arrays, with their start values.
    structural: Vec<(Reference, u64)>,
    /// Clocks, and whether an importer may activate them.
    clocks: Vec<(Reference, bool)>,
    /// Variables that an importer may read in intermediate updates; empty if the FMU has none.
    intermediate: &'a [Reference],
    /// True if the FMU has Event Mode in FMI 3.0 co-simulation.
    has_event_mode: bool,
    /// 1 if the model can end the simulation.
    can_finish: u8,
    /// True if the FMU has scheduled execution.
    has_scheduled_execution: bool,
    /// Step size of the description in s.
    step: f64,
    slots: Vec<Slot<'a>>,
    bytes: Vec<Bytes>,
    /// Bytes of states of other FMUs.
    foreign: &'a [Vec<u8>],
    last: VecDeque<String>,
    report: Report,
    is_verbose: bool,
}

/// The interfaces that an FMU provides.
#[must_use]
pub fn interfaces(fmu: &Fmu) -> Vec<Interface> {
    let description = &fmu.description;
    let provided = [
        (Interface::CoSimulation, description.co_simulation.is_some()),
        (Interface::ModelExchange, description.model_exchange.is_some()),
    ];
    provided.into_iter().filter(|(_, is_provided)| *is_provided).map(|(interface, _)| interface).collect()
}

/// The bytes of an FMU's state after initialization, which other FMUs must reject.
///
/// # Panics
/// If the FMU does not save a state.
#[must_use]
pub fn state(raw: &Raw, interface: Interface) -> Vec<u8> {
    let guid = CString::new(raw.guid()).expect("no zeros");
    let instance = raw.instantiate(Arguments {
        name: Some(c"state"),
        kind: kind_of(interface),
        guid: Some(&guid),
        resources: None,
        callbacks: true,
        events: EventArguments::default(),
    });
    let instance = instance.expect("an instance");
    let enter = match raw.version() {
        FmiVersion::V2 => instance.transition("fmi2EnterInitializationMode"),
        FmiVersion::V3 => instance.enter_initialization((false, 0.0), 0.0, (false, 0.0)),
    };
    let mut statuses = vec![enter, instance.transition("fmi2ExitInitializationMode")];
    let (mut state, mut size) = (RawState::NULL, 0);
    statuses.push(instance.get_state(Some(&mut state)));
    statuses.push(instance.state_size(state, Some(&mut size)));
    let mut bytes = vec![0; size];
    statuses.push(instance.serialize(state, Some(&mut bytes), size));
    assert_eq!(statuses, [OK; 5], "the FMU saves its state");
    bytes
}

/// fmi2Type.
fn kind_of(interface: Interface) -> i32 {
    match interface {
        Interface::CoSimulation => c_api::CO_SIMULATION,
        _ => c_api::MODEL_EXCHANGE,
    }
}

/// Calls an FMU while `goes_on` returns true. The argument of `goes_on` is the number of calls so far to instances of
/// `interface`. If the FMU provides the other interface, some instances have that interface. Equal seeds and `foreign`
/// states (from other FMUs, see [`state`]) give equal calls. If `is_verbose`, every call is printed to standard error
/// before it is made, which shows a call that ends the process.
///
/// # Errors
/// The FMU breaks a rule.
pub fn fuzz(
    (fmu, raw): (&Fmu, &Raw),
    interface: Interface,
    foreign: &[Vec<u8>],
    seed: u64,
    is_verbose: bool,
    mut goes_on: impl FnMut(u64) -> bool,
) -> Result<Report, Violation> {
    let version = fmu.description.fmi;
    let variables = &fmu.description.variables;
    let lengths: Vec<_> = variables
        .iter()
        .flat_map(|variable| &variable.dimensions)
        .filter_map(|dimension| match dimension {
            Dimension::Parameter(at) => Some(*at),
            Dimension::Fixed(_) => None,
        })
        .collect::<BTreeSet<_>>()
        .into_iter()
        .collect();
    let length = |dimension: &Dimension| match *dimension {
        Dimension::Fixed(length) => Length::Fixed(length),
        Dimension::Parameter(at) => {
            Length::Parameter(lengths.iter().position(|&other| other == at).expect("listed above"))
        }
    };
    let structural = lengths.iter().map(|&at| match variables[at].start {
        Some(Value::Integer(start)) => (variables[at].reference, start as u64),
        _ => panic!("a length without a start value"),
    });
    let outputs = fmu.references(Causality::Output);
    let specs = variables.iter().filter(|variable| variable.causality != Causality::Independent).map(|variable| Spec {
        reference: variable.reference,
        data_type: match variable.data_type {
            // FMI 2.0 has the same functions for Integers and enumerations.
            DataType::Enumeration if version == FmiVersion::V2 => DataType::Int32,
            data_type => data_type,
        },
        dimensions: variable.dimensions.iter().map(length).collect(),
        start: match variable.start {
            Some(Value::Real(start)) => start,
            Some(Value::Integer(start)) => start as f64,
            Some(Value::Boolean(start)) => f64::from(u8::from(start)),
            _ => 0.0,
        },
        limits: [variable.min.unwrap_or(-1e3), variable.max.unwrap_or(1e3)],
    });
    let derivatives = fmu.description.derivatives.iter().map(|unknown| variables[unknown.variable].reference);
    let time = variables.iter().find(|variable| variable.causality == Causality::Independent);
    let states: Vec<_> = fmu.states().iter().map(|state| state.reference).collect();
    // The random numbers for an FMU do not depend on the other FMUs on the command line.
    let seed = seed ^ checksum(fmu.name.as_bytes());
    let mut fuzzer = Fuzzer {
        raw,
        version,
        interface,
        interfaces: interfaces(fmu),
        random: Random(seed),
        specs: specs.collect(),
        time: time.filter(|_| version == FmiVersion::V3).map(|time| time.reference),
        unknown: derivatives.chain(fmu.references(Causality::Output)).collect(),
        known: states.iter().copied().chain(fmu.references(Causality::Input)).collect(),
        states,
        structural: structural.collect(),
        clocks: fmu
            .description
            .clocks
            .iter()
            .map(|clock| (clock.reference, clock.causality == Causality::Input))
            .collect(),
        intermediate: if version == FmiVersion::V3 && fmu.is_plant() { &outputs } else { &[] },
        indicators: fmu.description.number_of_event_indicators,
        has_scheduled_execution: fmu.description.scheduled_execution.is_some(),
        has_event_mode: fmu.description.co_simulation.as_ref().is_some_and(|unit| unit.has_event_mode),
        can_finish: u8::from(fmu.name == "Stair"),
        step: fmu.description.default_experiment.step_size.unwrap_or(1e-3),
        slots: Vec::new(),
        bytes: Vec::new(),
        foreign,
        last: VecDeque::new(),
        report: Report::default(),
        is_verbose,
    };
    while goes_on(fuzzer.report.calls) {
        if let Err(what) = fuzzer.once() {
            let call = fuzzer.report.calls + fuzzer.report.others;
            return Err(Violation { what, call, last: fuzzer.last.into() });
        }
    }
    Ok(fuzzer.report)
}

type Checked<T = ()> = Result<T, String>;

fn ensure(holds: bool, what: impl FnOnce() -> String) -> Checked {
    if holds { Ok(()) } else { Err(what()) }
}

/// The text that a printf format without arguments produces; `None` if the format requires arguments or value
/// references.
fn printed(version: FmiVersion, format: &[u8]) -> Option<String> {
    let text = String::from_utf8(format.to_vec()).ok()?;
    if version == FmiVersion::V3 {
        return Some(text);
    }
    let plain = text.replace("%%", "").replace("##", "");
    (!plain.contains(['%', '#'])).then(|| text.replace("%%", "%").replace("##", "#"))
}

/// Checks the messages logged with a status and returns their texts.
fn texts(version: FmiVersion, entries: &[Entry], name: &[u8]) -> Checked<String> {
    let mut all = String::new();
    for entry in entries {
        let text = printed(version, &entry.format).ok_or("a message asks for arguments or is not UTF-8")?;
        ensure(!text.trim().is_empty(), || "an empty message".to_owned())?;
        ensure(!text.contains("internal error"), || format!("a panic: {text}"))?;
        ensure(!entry.category.is_empty(), || format!("a message without category: {text}"))?;
        ensure(version == FmiVersion::V3 || entry.name == name, || {
            format!("a message with the name of another instance: {text}")
        })?;
        all.push_str(&text);
    }
    Ok(all)
}

impl<'a> Fuzzer<'a> {
    fn note(&mut self, text: String) {
        if self.is_verbose {
            eprintln!("{}: {text}", self.report.calls + self.report.others + 1);
        }
        if self.last.len() == SHOWN {
            self.last.pop_front();
        }
        self.last.push_back(text);
    }

    /// The name of a function in the version of the FMU.
    fn name(&self, function: &'static str) -> &'static str {
        in_version(self.version, function)
    }

    /// Counts a call that the generator made to an instance of an interface.
    fn counted(&mut self, interface: Interface, function: &'static str, status: RawStatus) -> Checked {
        let count = if interface == self.interface { &mut self.report.calls } else { &mut self.report.others };
        *count += 1;
        self.answered(function, status)
    }

    /// Counts a call that only checks an instance.
    fn probed(&mut self, function: &'static str, status: RawStatus) -> Checked {
        self.report.probes += 1;
        self.answered(function, status)
    }

    fn answered(&mut self, function: &'static str, status: RawStatus) -> Checked {
        let column = match status {
            OK => 0,
            DISCARD => 1,
            ERROR => 2,
            other => return Err(format!("{function} returned status {other}")),
        };
        self.report.functions.entry(self.name(function)).or_default()[column] += 1;
        Ok(())
    }

    /// The bytes of an instance's state; `None` if the state cannot be saved. All values are read first, because some
    /// are computed only when they are first needed.
    fn content(&mut self, at: usize) -> Checked<Option<Vec<u8>>> {
        if [FAILED, CONFIGURATION, RECONFIGURATION].contains(&self.slots[at].mode) || !self.slots[at].has_logger {
            return Ok(None);
        }
        if self.slots[at].mode != INSTANTIATED || self.version == FmiVersion::V3 {
            self.compute(at)?;
        }
        let instance = &self.slots[at].instance;
        let (mut state, mut size) = (RawState::NULL, 0);
        let saved = instance.get_state(Some(&mut state));
        let asked = instance.state_size(state, Some(&mut size));
        let mut bytes = vec![0; size];
        let written = instance.serialize(state, Some(&mut bytes), size);
        let freed = instance.free_state(Some(&mut state));
        let log = instance.take_log();
        for (function, status) in [
            ("fmi2GetFMUstate", saved),
            ("fmi2SerializedFMUstateSize", asked),
            ("fmi2SerializeFMUstate", written),
            ("fmi2FreeFMUstate", freed),
        ] {
            self.probed(function, status)?;
            ensure(status == OK, || format!("{function} returned {status} in a checking call: {log:?}"))?;
        }
        Ok(Some(bytes))
    }

    /// Makes a call and checks the rules that apply to all functions.
    fn call(
        &mut self,
        at: usize,
        function: &'static str,
        text: String,
        next: Next,
        call: impl FnOnce(&RawInstance<'a>) -> RawStatus,
    ) -> Checked<RawStatus> {
        let name = self.name(function);
        self.note(format!("#{at} {:?} {name} {text}", self.slots[at].interface));
        let before = if self.chance(32) { self.content(at)? } else { None };
        let start = Instant::now();
        let status = call(&self.slots[at].instance);
        let duration = start.elapsed();
        if duration > self.report.slowest.0 {
            self.report.slowest = (duration, self.last.back().cloned().unwrap_or_default());
        }
        self.counted(self.slots[at].interface, function, status)?;
        if let Some(last) = self.last.back_mut() {
            last.push_str(
                ["", " -> fmi2OK", " -> fmi2Discard", " -> fmi2Error"][match status {
                    OK => 1,
                    DISCARD => 2,
                    _ => 3,
                }],
            );
        }
        let slot = &self.slots[at];
        if !slot.has_logger {
            return Ok(status);
        }
        let entries = slot.instance.take_log();
        let message = texts(self.version, &entries, &slot.name)?;
        ensure(entries.iter().all(|entry| entry.status == status), || {
            format!("{name} returned {status} but logged another status: {message}")
        })?;
        if let Some(last) = self.last.back_mut() {
            last.push_str(&format!(" {message:.200}"));
        }
        let named = message.strip_prefix(name).is_some_and(|rest| rest.starts_with([':', ' ']));
        ensure(named || !message.starts_with("fmi"), || {
            format!("{name} logged the name of another function: {message}")
        })?;
        match status {
            ERROR => ensure(!entries.is_empty(), || format!("{name} was rejected without a reason"))?,
            DISCARD if slot.all_logged => {
                ensure(!entries.is_empty(), || format!("{name} was discarded without a reason"))?;
            }
            _ => {}
        }
        let expected = match (status, next) {
            (OK, Next::To(mode)) => Some(mode),
            (OK, Next::Any) => None,
            (ERROR, _) if function == "fmi2DoStep" && message.contains("cannot continue") => Some(FAILED),
            _ => Some(slot.mode),
        };
        let found = self.mode(at)?;
        ensure(expected.is_none_or(|expected| expected == found), || {
            format!("{name} returned {status} and left {found}, expected {expected:?}: {message}")
        })?;
        self.slots[at].mode = found;
        self.check_lengths(at, function, status)?;
        if status != OK
            && found != FAILED
            && let Some(before) = before
        {
            let after = self.content(at)?;
            ensure(after.as_ref() == Some(&before), || {
                format!("{name} was rejected and changed the state: {message}")
            })?;
        }
        Ok(status)
    }

    /// Replaces one of the instances with a new one.
    fn instantiate(&mut self) -> Checked {
        let is_right = !self.chance(8);
        // Without a logger, the FMU state is unknown, and thereby the number of elements of arrays.
        let has_logger = !self.structural.is_empty() || !self.chance(20);
        let logging_on = self.pick(&[0, 1, -1, i32::MAX]);
        let name = if self.chance(3) { self.text() } else { Some(c"unit \xe2\x82\xac 100%".to_owned()) };
        let mut guid = Some(CString::new(self.raw.guid()).expect("no zeros"));
        let mut resources = Some(c"file:///tmp".to_owned());
        let others = self.interfaces.clone();
        let interface = if self.chance(4) { self.pick(&others) } else { self.interface };
        let (mut kind, mut callbacks) = (kind_of(interface), true);
        let mut events = EventArguments::default();
        if self.version == FmiVersion::V3 && interface == Interface::CoSimulation {
            let may_use_events = self.has_event_mode || self.chance(8);
            (events.mode_used, events.early_return) = (may_use_events && self.chance(2), self.chance(2));
            events.updates = (!self.intermediate.is_empty() && self.chance(2)).then_some(self.intermediate);
        }
        if !is_right {
            match self.random.below(5) {
                0 => guid = self.text(),
                1 => resources = self.text(),
                2 => kind = self.integer(),
                3 => (events.intermediate_variables, events.updates) = (3, None),
                _ => callbacks = false,
            }
        }
        let is_fmi2 = self.version == FmiVersion::V2;
        let function = match kind {
            _ if is_fmi2 => "fmi2Instantiate",
            c_api::MODEL_EXCHANGE => "fmi3InstantiateModelExchange",
            c_api::CO_SIMULATION => "fmi3InstantiateCoSimulation",
            _ => "fmi3InstantiateScheduledExecution",
        };
        self.note(format!(
            "{function} {name:.60?} {kind} {guid:.60?} {resources:.60?} {callbacks} {events:?} {logging_on}"
        ));
        let arguments = Arguments {
            name: name.as_deref(),
            kind,
            guid: guid.as_deref(),
            resources: resources.as_deref(),
            callbacks,
            events,
        };
        let raw = self.raw;
        let made = if has_logger {
            raw.instantiate_logging(arguments, logging_on)
        } else {
            raw.instantiate(arguments).ok_or(Vec::new())
        };
        let is_text = |text: &Option<CString>| text.as_deref().is_some_and(|text| text.to_str().is_ok());
        let found = others.iter().copied().find(|&interface| kind_of(interface) == kind);
        let is_scheduled = function == "fmi3InstantiateScheduledExecution" && self.has_scheduled_execution;
        let is_due = (found.is_some() || is_scheduled)
            && (callbacks || !is_fmi2)
            && (kind != c_api::CO_SIMULATION || is_fmi2 || events.intermediate_variables == 0)
            && (!events.mode_used || kind != c_api::CO_SIMULATION || self.has_event_mode)
            && is_text(&name)
            && name.as_deref().is_some_and(|name| !name.is_empty())
            && guid.as_deref().map(CStr::to_bytes) == Some(raw.guid().as_bytes())
            && (resources.is_none() || is_text(&resources));
        self.counted(interface, function, if made.is_ok() { OK } else { ERROR })?;
        ensure(made.is_ok() == is_due, || format!("{function} returned an instance: {}", made.is_ok()))?;
        let name = name.filter(|name| name.to_str().is_ok()).map(CString::into_bytes).unwrap_or_default();
        match made {
            Ok(instance) => {
                ensure(instance.take_log().iter().all(|entry| entry.status == OK), || {
                    "an error was logged".to_owned()
                })?;
                if is_scheduled {
                    return Ok(()); // freed: see `fuzz_scheduled`
                }
                let all_logged = logging_on != 0;
                let (states, freed, interface) = (Vec::new(), Vec::new(), found.unwrap_or(interface));
                let mode = INSTANTIATED;
                let lengths = self.structural.iter().map(|(_, start)| *start).collect();
                let slot = Slot {
                    lengths,
                    are_lengths_known: true,
                    instance,
                    interface,
                    events,
                    name,
                    has_logger,
                    all_logged,
                    mode,
                    states,
                    freed,
                };
                if self.slots.len() < INSTANCES {
                    self.slots.push(slot);
                } else {
                    let at = self.index(INSTANCES);
                    self.note(format!("#{at} fmi2FreeInstance, replaced by the new one"));
                    let old = std::mem::replace(&mut self.slots[at], slot);
                    self.counted(old.interface, "fmi2FreeInstance", OK)?;
                }
            }
            Err(entries) => {
                texts(self.version, &entries, &name)?;
                let is_silent = !has_logger || (is_fmi2 && !callbacks);
                ensure(!entries.is_empty() || is_silent, || "rejected without a reason".to_owned())?;
            }
        }
        Ok(())
    }

    fn once(&mut self) -> Checked {
        if self.slots.len() < INSTANCES || self.chance(400) {
            return self.instantiate();
        }
        if self.chance(300) {
            return self.without_instance();
        }
        let at = self.index(INSTANCES);
        let is_exchange = self.slots[at].interface == Interface::ModelExchange;
        match self.random.below(100) {
            0..40 if self.is_configuring(at) => self.set_length(at),
            0..20 if is_exchange => self.exchange(at),
            0..20 => self.do_step(at),
            20..32 => self.get_real(at),
            32..44 => self.set_real(at),
            44..52 => self.others(at),
            52..66 => self.transition(at),
            66..84 => self.state(at),
            84..90 => self.derivatives(at),
            90..96 if self.version == FmiVersion::V3 => self.questions(at),
            90..96 if is_exchange => self.exchange(at),
            90..96 => self.status(at),
            _ => self.logging(at),
        }
    }

    /// Calls functions with a null pointer as the instance. Without an instance there is no logger, so only the status
    /// reports the error.
    fn without_instance(&mut self) -> Checked {
        self.note("a null pointer as the instance".to_owned());
        let null = self.raw.null();
        let is_fmi2 = self.version == FmiVersion::V2;
        let step = if is_fmi2 { null.do_step(0.0, f64::NAN) } else { null.step_with_events(0.0, 1.0, None, None) };
        let mut statuses = vec![
            ("fmi2Reset", null.transition("fmi2Reset")),
            ("fmi2Terminate", null.transition("fmi2Terminate")),
            ("fmi2GetReal", null.get::<f64>(None, 0, None)),
            ("fmi2SetReal", null.set::<f64>(None, 1, None)),
            ("fmi2GetFMUstate", null.get_state(None)),
            ("fmi2DeSerializeFMUstate", null.deserialize(None, usize::MAX, None)),
        ];
        if self.interfaces.contains(&Interface::CoSimulation) {
            statuses.push(("fmi2DoStep", step));
        }
        if self.interfaces.contains(&Interface::ModelExchange) {
            statuses.extend([
                ("fmi2NewDiscreteStates", null.update(None)),
                ("fmi2SetTime", null.set_time(0.0)),
                ("fmi2GetEventIndicators", null.numbers("fmi2GetEventIndicators", None, usize::MAX)),
            ]);
        }
        for (function, status) in statuses {
            self.counted(self.interface, function, status)?;
            ensure(status == ERROR, || format!("{function} without an instance returned {status}"))?;
        }
        let (is_right, texts) = match self.version {
            FmiVersion::V2 => (self.raw.texts() == ["2.0", "default"], "version or types platform"),
            FmiVersion::V3 => (self.raw.version_text() == "3.0", "version"),
        };
        ensure(is_right, || format!("another {texts}"))
    }
}
