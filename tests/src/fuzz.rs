//! Calls that no master should make: any function, in any order, with any arguments that the C types allow.
//!
//! The standard leaves undefined what a master does wrong; ARCHITECTURE.md ("Status", "Time") defines it, and that is
//! the reference here. Checked at every call: the status is fmi2OK, fmi2Discard or fmi2Error; an error is logged with
//! a reason and keeps the mode; nothing is written beyond the array, and nothing at all by a rejected call; a number
//! that is handed out is finite. At some calls also: a rejected call leaves the saved state as it was.
//!
//! What is not done, because no FMU can notice it: arrays shorter than stated, strings without an end, instances that
//! were freed, one instance in two threads.

use crate::Fmu;
use crate::raw::{self, Arguments, DISCARD, ERROR, Element, Entry, OK, Raw, RawInstance, RawState, Text, Truth};
use crate::signals::Random;
use crate::state_bytes::{self, GUID_AT, Place, VERSION_AT, checksum, seal};
use fmu_import::c_api::{RawStatus, Reference};
use fmu_import::description::{BaseType, Causality, Value};
use std::collections::{BTreeMap, VecDeque};
use std::ffi::{CStr, CString};
use std::time::{Duration, Instant};

/// Calls that are shown after a violation.
const SHOWN: usize = 50;
/// Instances of an FMU that are alive at once.
const INSTANCES: usize = 4;
/// States of an instance and kept bytes of states at once.
const STATES: usize = 6;

const INSTANTIATED: &str = "Instantiated";
const INITIALIZATION: &str = "Initialization Mode";
const STEP: &str = "Step Mode";
const FAILED: &str = "Step Failed";
const TERMINATED: &str = "Terminated";
const MODES: [&str; 5] = [INSTANTIATED, INITIALIZATION, STEP, FAILED, TERMINATED];

/// What was done.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Calls that the generator chose.
    pub calls: u64,
    /// Calls between them that observe an instance: its mode, its state.
    pub probes: u64,
    /// Function: calls that returned fmi2OK, fmi2Discard, fmi2Error.
    pub functions: BTreeMap<&'static str, [u64; 3]>,
    /// The call that took longest.
    pub slowest: (Duration, String),
}

impl Report {
    /// Adds another one.
    pub fn add(&mut self, other: &Self) {
        self.calls += other.calls;
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
    /// What is wrong.
    pub what: String,
    /// Number of the call, from 1.
    pub call: u64,
    /// The last calls, this one at the end.
    pub last: Vec<String>,
}

/// A variable and what values suit it.
struct Spec {
    reference: Reference,
    base_type: BaseType,
    start: f64,
    limits: [f64; 2],
}

struct Slot<'a> {
    instance: RawInstance<'a>,
    name: Vec<u8>,
    has_logger: bool,
    /// Whether discarded calls are logged too.
    all_logged: bool,
    /// Kept only if there is a logger, whose messages tell it.
    mode: &'static str,
    /// With the mode that each was saved in; unknown for crafted bytes.
    states: Vec<(RawState, Option<&'static str>)>,
    freed: Vec<RawState>,
}

/// Where a call leads that returns fmi2OK.
enum Next {
    Same,
    To(&'static str),
    /// Not known beforehand; it is read.
    Any,
}

/// Calls one FMU.
struct Fuzzer<'a> {
    raw: &'a Raw,
    random: Random,
    specs: Vec<Spec>,
    /// What directional derivatives are of, and by.
    unknown: Vec<Reference>,
    known: Vec<Reference>,
    slots: Vec<Slot<'a>>,
    /// Bytes of states, with the mode each was saved in.
    bytes: Vec<(Vec<u8>, Option<&'static str>)>,
    /// Bytes of states of other FMUs.
    foreign: &'a [Vec<u8>],
    last: VecDeque<String>,
    report: Report,
    is_verbose: bool,
}

/// The bytes of a state of an FMU, for others that must reject it.
///
/// # Panics
/// When the FMU does not save one.
#[must_use]
pub fn state(fmu: &Fmu) -> Vec<u8> {
    state_bytes::state(&mut fmu.started())
}

/// Calls an FMU as long as `goes_on` says, which gets the number of calls so far. Equal seeds and `foreign` states (of
/// other FMUs, see [`state`]) make equal calls. If `is_verbose`, every call is printed to standard error before it is
/// made, which shows the one that ends a process.
///
/// # Errors
/// When the FMU breaks a rule.
pub fn fuzz(
    fmu: &Fmu,
    raw: &Raw,
    foreign: &[Vec<u8>],
    seed: u64,
    is_verbose: bool,
    mut goes_on: impl FnMut(u64) -> bool,
) -> Result<Report, Violation> {
    let specs = fmu.description.variables.iter().map(|variable| Spec {
        reference: variable.reference,
        base_type: variable.base_type,
        start: match variable.start {
            Some(Value::Real(start)) => start,
            Some(Value::Integer(start)) => f64::from(start),
            Some(Value::Boolean(start)) => f64::from(u8::from(start)),
            _ => 0.0,
        },
        limits: [variable.min.unwrap_or(-1e3), variable.max.unwrap_or(1e3)],
    });
    let variables = &fmu.description.variables;
    let derivatives = fmu.description.derivatives.iter().map(|unknown| variables[unknown.variable].reference);
    // Every FMU has its own numbers, whichever others are called in the same process.
    let seed = seed ^ checksum(fmu.name.as_bytes());
    let mut fuzzer = Fuzzer {
        raw,
        random: Random(seed),
        specs: specs.collect(),
        unknown: derivatives.chain(fmu.references(Causality::Output)).collect(),
        known: fmu.states().iter().map(|state| state.reference).chain(fmu.references(Causality::Input)).collect(),
        slots: Vec::new(),
        bytes: Vec::new(),
        foreign,
        last: VecDeque::new(),
        report: Report::default(),
        is_verbose,
    };
    while goes_on(fuzzer.report.calls) {
        if let Err(what) = fuzzer.once() {
            return Err(Violation { what, call: fuzzer.report.calls, last: fuzzer.last.into() });
        }
    }
    Ok(fuzzer.report)
}

type Checked<T = ()> = Result<T, String>;

fn ensure(holds: bool, what: impl FnOnce() -> String) -> Checked {
    if holds { Ok(()) } else { Err(what()) }
}

/// The text of a message without arguments and value references; `None` if it asks for some.
fn printed(format: &[u8]) -> Option<String> {
    let text = String::from_utf8(format.to_vec()).ok()?;
    let plain = text.replace("%%", "").replace("##", "");
    (!plain.contains(['%', '#'])).then(|| text.replace("%%", "%").replace("##", "#"))
}

/// Checks messages that came with a status and returns their texts.
fn texts(entries: &[Entry], name: &[u8]) -> Checked<String> {
    let mut all = String::new();
    for entry in entries {
        let text = printed(&entry.format).ok_or("a message asks for arguments or is not UTF-8")?;
        ensure(!text.trim().is_empty(), || "an empty message".to_owned())?;
        ensure(!text.contains("internal error"), || format!("a panic: {text}"))?;
        ensure(!entry.category.is_empty(), || format!("a message without category: {text}"))?;
        ensure(entry.name == name, || format!("a message in another name: {text}"))?;
        all.push_str(&text);
    }
    Ok(all)
}

impl<'a> Fuzzer<'a> {
    fn chance(&mut self, one_in: u64) -> bool {
        self.random.below(one_in) == 0
    }

    fn pick<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.random.below(all.len() as u64) as usize]
    }

    fn index(&mut self, length: usize) -> usize {
        self.random.below(length as u64) as usize
    }

    /// A number of any kind.
    fn wild(&mut self) -> f64 {
        const NUMBERS: [f64; 22] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            5e-324,
            -5e-324,
            f64::MIN_POSITIVE,
            1e-300,
            1e-9,
            -1e-9,
            0.1,
            1e3,
            -1e3,
            1e15,
            9_007_199_254_740_993.0,
            1e300,
            1.7e308,
            -1.7e308,
            f64::MAX,
        ];
        match self.random.below(4) {
            0 => f64::from_bits(self.random.bits()),
            1 => self.random.symmetric() * 10.0,
            _ => self.pick(&NUMBERS),
        }
    }

    fn integer(&mut self) -> i32 {
        match self.random.below(3) {
            0 => self.pick(&[i32::MIN, i32::MAX, -1, 0, 1, 2, 1000]),
            1 => self.random.bits() as i32,
            _ => self.random.below(5) as i32,
        }
    }

    /// A number that suits the variable, most of the time.
    fn value(&mut self, reference: Reference) -> f64 {
        if self.chance(12) {
            return self.wild();
        }
        let symmetric = self.random.symmetric();
        let kind = self.random.below(8);
        match self.specs.iter().find(|spec| spec.reference == reference) {
            None => symmetric,
            Some(spec) if kind == 0 => spec.limits[0],
            Some(spec) if kind == 1 => spec.limits[1],
            Some(spec) if kind == 2 => spec.limits[0] + 0.5 * (1.0 + symmetric) * (spec.limits[1] - spec.limits[0]),
            Some(spec) if spec.start == 0.0 => 0.05 * symmetric,
            Some(spec) => spec.start * (1.0 + 0.1 * symmetric),
        }
    }

    /// References, mostly of variables of that type.
    fn references(&mut self, base_type: BaseType) -> Vec<Reference> {
        let of_type: Vec<_> = self.specs.iter().filter(|s| s.base_type == base_type).map(|s| s.reference).collect();
        if self.chance(8) {
            return of_type;
        }
        let last = self.specs.len() as u64;
        (0..self.random.below(6))
            .map(|_| match self.random.below(24) {
                0 => self.pick(&[Reference::MAX, 0, 1 << 31, 4_000_000_000]),
                1 => self.random.below(last + 2) as Reference,
                _ if of_type.is_empty() => self.random.below(last + 2) as Reference,
                _ => self.pick(&of_type),
            })
            .collect()
    }

    /// How many values of an array are stated: all, fewer, or more than memory can hold.
    fn count(&mut self, length: usize) -> usize {
        match self.random.below(40) {
            0 => usize::MAX,
            1 => self.index(length + 1),
            _ => length,
        }
    }

    /// The array, or a null pointer.
    fn maybe<T>(&mut self, value: T) -> Option<T> {
        (!self.chance(40)).then_some(value)
    }

    fn text(&mut self) -> Option<CString> {
        let bytes = match self.random.below(9) {
            0 => return None,
            1 => Vec::new(),
            2 => b"%s%n%d%100$s".to_vec(),
            3 => vec![0xff, 0xfe, 0xc0, 0x80],
            4 => vec![b'x'; 10_000],
            5 if self.chance(20) => "\u{20ac}".repeat(400_000).into_bytes(),
            6 => (1..=255).collect(),
            7 => "logEvents".into(),
            _ => b"file:///tmp/#r1#%zz%e2%82".to_vec(),
        };
        Some(CString::new(bytes).expect("no zeros"))
    }

    fn note(&mut self, text: String) {
        if self.is_verbose {
            eprintln!("{}: {text}", self.report.calls + 1);
        }
        if self.last.len() == SHOWN {
            self.last.pop_front();
        }
        self.last.push_back(text);
    }

    /// Counts a call of the generator.
    fn counted(&mut self, function: &'static str, status: RawStatus) -> Checked {
        self.report.calls += 1;
        self.answered(function, status)
    }

    /// Counts a call that observes.
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
        self.report.functions.entry(function).or_default()[column] += 1;
        Ok(())
    }

    /// The mode of an instance with a logger: what the error of fmi2CancelStep says.
    fn mode(&mut self, at: usize) -> Checked<&'static str> {
        const FUNCTION: &str = "fmi2CancelStep";
        let status = self.slots[at].instance.transition(FUNCTION);
        self.probed(FUNCTION, status)?;
        ensure(status == ERROR, || format!("{FUNCTION} returned {status}"))?;
        let slot = &self.slots[at];
        let text = texts(&slot.instance.take_log(), &slot.name)?;
        if text == "fmi2CancelStep: no step is pending" {
            return Ok(STEP);
        }
        let mode = text.strip_prefix("fmi2CancelStep called in ").and_then(|rest| rest.split(',').next());
        MODES.into_iter().find(|&known| Some(known) == mode).ok_or(format!("no mode in: {text}"))
    }

    /// The bytes of an instance's state; `None` where none can be saved. All values are asked for before: some are
    /// computed when they are first needed.
    fn content(&mut self, at: usize) -> Checked<Option<Vec<u8>>> {
        if matches!(self.slots[at].mode, FAILED) || !self.slots[at].has_logger {
            return Ok(None);
        }
        let instance = &self.slots[at].instance;
        if self.slots[at].mode != INSTANTIATED {
            let reals: Vec<_> =
                self.specs.iter().filter(|spec| spec.base_type == BaseType::Real).map(|spec| spec.reference).collect();
            let status = instance.get(Some(&reals), reals.len(), Some(&mut vec![0.0; reals.len()]));
            let _ = instance.take_log();
            self.probed("fmi2GetReal", status)?;
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
            ensure(status == OK, || format!("{function} returned {status} when looking: {log:?}"))?;
        }
        Ok(Some(bytes))
    }

    /// Makes a call and checks everything that holds for all functions.
    fn call(
        &mut self,
        at: usize,
        function: &'static str,
        text: String,
        next: Next,
        call: impl FnOnce(&RawInstance<'a>) -> RawStatus,
    ) -> Checked<RawStatus> {
        self.note(format!("#{at} {function} {text}"));
        let before = if self.chance(32) { self.content(at)? } else { None };
        let start = Instant::now();
        let status = call(&self.slots[at].instance);
        let duration = start.elapsed();
        if duration > self.report.slowest.0 {
            self.report.slowest = (duration, self.last.back().cloned().unwrap_or_default());
        }
        self.counted(function, status)?;
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
        let message = texts(&entries, &slot.name)?;
        ensure(entries.iter().all(|entry| entry.status == status), || {
            format!("{function} returned {status}, the log says otherwise: {message}")
        })?;
        if let Some(last) = self.last.back_mut() {
            last.push_str(&format!(" {message:.200}"));
        }
        match status {
            ERROR => ensure(!entries.is_empty(), || format!("{function} was rejected without a reason"))?,
            DISCARD if slot.all_logged => {
                ensure(!entries.is_empty(), || format!("{function} was discarded without a reason"))?;
            }
            _ => {}
        }
        let expected = match (status, next) {
            (OK, Next::To(mode)) => Some(mode),
            (OK, Next::Any) => None,
            (ERROR, _) if function == "fmi2DoStep" && message.contains("cannot step on") => Some(FAILED),
            _ => Some(slot.mode),
        };
        let found = self.mode(at)?;
        ensure(expected.is_none_or(|expected| expected == found), || {
            format!("{function} returned {status} and left {found}, expected {expected:?}: {message}")
        })?;
        self.slots[at].mode = found;
        if status != OK
            && found != FAILED
            && let Some(before) = before
        {
            let after = self.content(at)?;
            ensure(after.as_ref() == Some(&before), || {
                format!("{function} was rejected and changed the state: {message}")
            })?;
        }
        Ok(status)
    }

    /// A new instance in place of one of those that are there.
    fn instantiate(&mut self) -> Checked {
        const FUNCTION: &str = "fmi2Instantiate";
        let is_right = !self.chance(8);
        let has_logger = !self.chance(20);
        let logging_on = self.pick(&[0, 1, -1, i32::MAX]);
        let name = if self.chance(3) { self.text() } else { Some(c"unit \xe2\x82\xac 100%".to_owned()) };
        let mut guid = Some(CString::new(self.raw.guid()).expect("no zeros"));
        let mut resources = Some(c"file:///tmp".to_owned());
        let (mut kind, mut callbacks) = (1, true);
        if !is_right {
            match self.random.below(4) {
                0 => guid = self.text(),
                1 => resources = self.text(),
                2 => kind = self.integer(),
                _ => callbacks = false,
            }
        }
        self.note(format!("{FUNCTION} {name:.60?} {kind} {guid:.60?} {resources:.60?} {callbacks} {logging_on}"));
        let arguments = Arguments {
            name: name.as_deref(),
            kind,
            guid: guid.as_deref(),
            resources: resources.as_deref(),
            callbacks,
        };
        let raw = self.raw;
        let made = if has_logger {
            raw.instantiate_logging(arguments, logging_on)
        } else {
            raw.instantiate(arguments).ok_or(Vec::new())
        };
        let is_text = |text: &Option<CString>| text.as_deref().is_some_and(|text| text.to_str().is_ok());
        let is_due = kind == 1
            && callbacks
            && is_text(&name)
            && name.as_deref().is_some_and(|name| !name.is_empty())
            && guid.as_deref().map(CStr::to_bytes) == Some(raw.guid().as_bytes())
            && (resources.is_none() || is_text(&resources));
        self.counted(FUNCTION, if made.is_ok() { OK } else { ERROR })?;
        ensure(made.is_ok() == is_due, || format!("{FUNCTION} gave an instance: {}", made.is_ok()))?;
        let name = name.filter(|name| name.to_str().is_ok()).map(CString::into_bytes).unwrap_or_default();
        match made {
            Ok(instance) => {
                ensure(instance.take_log().iter().all(|entry| entry.status == OK), || {
                    "an error was logged".to_owned()
                })?;
                let all_logged = logging_on != 0;
                let (states, freed) = (Vec::new(), Vec::new());
                let slot = Slot { instance, name, has_logger, all_logged, mode: INSTANTIATED, states, freed };
                if self.slots.len() < INSTANCES {
                    self.slots.push(slot);
                } else {
                    let at = self.index(INSTANCES);
                    self.note(format!("#{at} fmi2FreeInstance, replaced by the new one"));
                    self.slots[at] = slot;
                    self.counted("fmi2FreeInstance", OK)?;
                }
            }
            Err(entries) => {
                texts(&entries, &name)?;
                ensure(!entries.is_empty() || !has_logger || !callbacks, || "rejected without a reason".to_owned())?;
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
        match self.random.below(100) {
            0..20 => self.do_step(at),
            20..32 => self.get_real(at),
            32..44 => self.set_real(at),
            44..52 => self.others(at),
            52..66 => self.transition(at),
            66..84 => self.state(at),
            84..90 => self.derivatives(at),
            90..96 => self.status(at),
            _ => self.logging(at),
        }
    }

    /// Functions with a null pointer in place of the instance: there is no logger to tell, the status says it.
    fn without_instance(&mut self) -> Checked {
        self.note("a null pointer as the instance".to_owned());
        let null = self.raw.null();
        let statuses = [
            ("fmi2Reset", null.transition("fmi2Reset")),
            ("fmi2Terminate", null.transition("fmi2Terminate")),
            ("fmi2GetReal", null.get::<f64>(None, 0, None)),
            ("fmi2SetReal", null.set::<f64>(None, 1, None)),
            ("fmi2DoStep", null.do_step(0.0, f64::NAN)),
            ("fmi2GetFMUstate", null.get_state(None)),
            ("fmi2DeSerializeFMUstate", null.deserialize(None, usize::MAX, None)),
        ];
        for (function, status) in statuses {
            self.counted(function, status)?;
            ensure(status == ERROR, || format!("{function} without an instance returned {status}"))?;
        }
        let expected = ["2.0".to_owned(), "default".to_owned()];
        ensure(self.raw.texts() == expected, || "another version or types platform".to_owned())
    }

    fn transition(&mut self, at: usize) -> Checked {
        // Mostly the way to Step Mode; from there rarely out of it.
        let mode = self.slots[at].mode;
        let kind = match mode {
            _ if self.chance(5) => self.random.below(6),
            INSTANTIATED => self.pick(&[0, 1]),
            INITIALIZATION => self.pick(&[2, 2, 2, 4]),
            STEP if !self.chance(8) => return self.get_real(at),
            _ => self.pick(&[3, 4]),
        };
        match kind {
            0 => {
                let start = if self.chance(2) { self.wild() } else { 0.0 };
                let stop = if self.chance(3) { self.wild() } else { 1e6 };
                let (has_stop, has_tolerance, tolerance) = (self.integer(), self.integer(), self.wild());
                let text = format!("{has_tolerance} {tolerance:e} {start:e} {has_stop} {stop:e}");
                self.call(at, "fmi2SetupExperiment", text, Next::Same, |instance| {
                    instance.setup_experiment_with((has_tolerance, tolerance), start, (has_stop, stop))
                })?;
            }
            kind => {
                let (function, next) = [
                    ("fmi2EnterInitializationMode", Next::To(INITIALIZATION)),
                    ("fmi2ExitInitializationMode", Next::To(STEP)),
                    ("fmi2Terminate", Next::To(TERMINATED)),
                    ("fmi2Reset", Next::To(INSTANTIATED)),
                    ("fmi2CancelStep", Next::Same),
                ]
                .into_iter()
                .nth(kind as usize - 1)
                .expect("below 6");
                let status = self.call(at, function, String::new(), next, |instance| instance.transition(function))?;
                ensure(function != "fmi2Reset" || status == OK, || "fmi2Reset was rejected".to_owned())?;
            }
        }
        Ok(())
    }

    fn do_step(&mut self, at: usize) -> Checked {
        const STEPS: [f64; 4] = [1e-3, 1e-3, 1e-2, 1e-4];
        let mut now = 0.0;
        self.slots[at].instance.real_status(2, Some(&mut now));
        let _ = self.slots[at].instance.take_log();
        let time = if self.chance(10) { self.wild() } else { now };
        let step = if self.chance(10) { self.wild() } else { self.pick(&STEPS) };
        // Up to a million samples are in order; where that takes seconds, it is done now and then only.
        let step = if (1.0..1e6).contains(&step) && !self.chance(64) { 0.5 } else { step };
        let text = format!("{time:e} {step:e}");
        self.call(at, "fmi2DoStep", text, Next::Same, |instance| instance.do_step(time, step))?;
        Ok(())
    }

    /// A getter of numbers; `mark` stands in the array before, `is_valid` checks what is handed out.
    fn get<T: Element + PartialEq + std::fmt::Debug>(
        &mut self,
        at: usize,
        function: &'static str,
        references: &[Reference],
        mark: T,
        is_valid: impl Fn(&T) -> bool,
    ) -> Checked {
        let count = self.count(references.len());
        let mut values = vec![mark; references.len() + 1];
        let (known, written) = (self.maybe(references), self.maybe(values.as_mut_slice()));
        let (is_null, text) = (written.is_none(), format!("{known:?} {count} values: {}", written.is_some()));
        let status = self.call(at, function, text, Next::Same, |instance| instance.get(known, count, written))?;
        let used = if status == OK && !is_null { count } else { 0 };
        ensure(values[..used].iter().all(is_valid), || format!("{function} handed out {:?}", &values[..used]))?;
        ensure(values[used..].iter().all(|value| *value == mark), || {
            format!("{function} returned {status} and wrote what it should not: {values:?}")
        })
    }

    fn get_real(&mut self, at: usize) -> Checked {
        let references = self.references(BaseType::Real);
        self.get(at, "fmi2GetReal", &references, -7.25e77, |value: &f64| value.is_finite())
    }

    fn set_real(&mut self, at: usize) -> Checked {
        let references = self.references(BaseType::Real);
        let values: Vec<_> = references.iter().map(|&reference| self.value(reference)).collect();
        let count = self.count(references.len());
        let (known, values) = (self.maybe(references.as_slice()), self.maybe(values.as_slice()));
        let text = format!("{known:?} {count} {values:?}");
        let status = self.call(at, "fmi2SetReal", text, Next::Same, |instance| instance.set(known, count, values))?;
        let taken = values.filter(|_| status == OK).map_or(&[][..], |values| &values[..count]);
        ensure(taken.iter().all(|value| value.is_finite()), || format!("fmi2SetReal accepted {taken:?}"))
    }

    /// Integers, booleans and strings.
    fn others(&mut self, at: usize) -> Checked {
        let base_type = self.pick(&[BaseType::Integer, BaseType::Boolean, BaseType::String]);
        let references = self.references(base_type);
        let gets = self.chance(2);
        match (base_type, gets) {
            (BaseType::Integer, true) => self.get(at, "fmi2GetInteger", &references, i32::MIN + 77, |_| true),
            (BaseType::Boolean, true) => {
                self.get(at, "fmi2GetBoolean", &references, Truth(77), |truth| matches!(truth.0, 0 | 1))
            }
            (BaseType::Integer | BaseType::Boolean, false) => {
                let values: Vec<_> = references.iter().map(|_| self.integer()).collect();
                let count = self.count(references.len());
                let (known, values) = (self.maybe(references.as_slice()), self.maybe(values));
                let text = format!("{known:?} {count} {values:?}");
                if base_type == BaseType::Integer {
                    let set = |instance: &RawInstance<'_>| instance.set(known, count, values.as_deref());
                    self.call(at, "fmi2SetInteger", text, Next::Same, set)?;
                } else {
                    let truths = values.map(|values| values.into_iter().map(Truth).collect::<Vec<_>>());
                    let set = |instance: &RawInstance<'_>| instance.set(known, count, truths.as_deref());
                    self.call(at, "fmi2SetBoolean", text, Next::Same, set)?;
                }
                Ok(())
            }
            (_, true) => {
                let count = self.count(references.len());
                let (known, room) = (self.maybe(references.as_slice()), self.maybe(references.len()));
                let text = format!("{known:?} {count} values: {}", room.is_some());
                let mut found = Vec::new();
                let status = self.call(at, "fmi2GetString", text, Next::Same, |instance| {
                    let (status, texts) = instance.get_texts(known, count, room);
                    found = texts;
                    status
                })?;
                ensure(status != OK || found.len() == count, || "fmi2GetString gave a null pointer".to_owned())?;
                ensure(found.iter().all(|text| std::str::from_utf8(text).is_ok()), || "a text is not UTF-8".to_owned())
            }
            (_, false) => {
                let owned: Vec<_> = references.iter().map(|_| self.text()).collect();
                let values: Vec<_> = owned.iter().map(|text| Text::new(text.as_deref())).collect();
                let count = self.count(references.len());
                let (known, values) = (self.maybe(references.as_slice()), self.maybe(values.as_slice()));
                let text = format!("{known:?} {count} {owned:.60?}");
                self.call(at, "fmi2SetString", text, Next::Same, |instance| instance.set(known, count, values))?;
                Ok(())
            }
        }
    }

    /// A state to pass, with its place in the list and the mode it was saved in: one of the instance, of another one,
    /// freed, null or made up.
    fn some_state(&mut self, at: usize) -> (RawState, Option<usize>, &'static str) {
        let other = (at + 1) % self.slots.len();
        let own = self.slots[at].states.len();
        let (state, what) = match self.random.below(16) {
            0 => (RawState::NULL, "null"),
            1 => (RawState::invented(self.pick(&[1, 8, 16, usize::MAX, 0xdead_beef])), "made up"),
            2 => (self.slots[other].states.first().map_or(RawState::NULL, |state| state.0), "of another instance"),
            3 => (self.slots[at].freed.last().copied().unwrap_or(RawState::NULL), "freed"),
            _ if own == 0 => (RawState::NULL, "null"),
            _ => {
                let place = self.index(own);
                return (self.slots[at].states[place].0, Some(place), "own");
            }
        };
        // Memory of a freed state may be that of a new one. What stands in for it is rejected like it, so that a run
        // does not depend on addresses.
        let is_used_again = self.slots[at].states.iter().any(|known| known.0 == state);
        (if is_used_again { RawState::invented(0xdead_beef) } else { state }, None, what)
    }

    fn state(&mut self, at: usize) -> Checked {
        match self.random.below(12) {
            0..3 => self.save(at),
            3..6 => {
                let (state, place, what) = self.some_state(at);
                let mode = place.and_then(|place| self.slots[at].states[place].1);
                let text = format!("{what} {place:?}");
                let next = mode.map_or(Next::Any, Next::To);
                let status = self.call(at, "fmi2SetFMUstate", text, next, |instance| instance.set_state(state))?;
                ensure((status == OK) == place.is_some(), || format!("fmi2SetFMUstate, {what}, returned {status}"))
            }
            6 => self.free(at),
            7..9 => self.serialize(at),
            _ => self.deserialize(at),
        }
    }

    /// Where a state goes to: none yet, or one that is there; `None` if there are enough and none was picked.
    fn target(&mut self, at: usize) -> Option<(RawState, Option<usize>, &'static str)> {
        let is_full = self.slots[at].states.len() >= STATES;
        let target = if is_full || self.chance(3) { self.some_state(at) } else { (RawState::NULL, None, "null") };
        (!(target.0.is_null() && is_full)).then_some(target)
    }

    /// Notes the mode of the state at `place`, or a new state.
    fn keep(&mut self, at: usize, place: Option<usize>, state: RawState, mode: Option<&'static str>) {
        match place {
            Some(place) => self.slots[at].states[place].1 = mode,
            None => self.slots[at].states.push((state, mode)),
        }
    }

    fn save(&mut self, at: usize) -> Checked {
        // Without a logger the mode is not known.
        let mode = self.slots[at].has_logger.then_some(self.slots[at].mode);
        if self.chance(40) {
            self.call(at, "fmi2GetFMUstate", "null".to_owned(), Next::Same, |instance| instance.get_state(None))?;
            return Ok(());
        }
        let Some((mut state, place, what)) = self.target(at) else { return self.free(at) };
        let before = state;
        let text = format!("{what} {place:?}");
        let status =
            self.call(at, "fmi2GetFMUstate", text, Next::Same, |instance| instance.get_state(Some(&mut state)))?;
        let is_due = (before.is_null() || place.is_some()) && mode != Some(FAILED);
        ensure(mode.is_none() || (status == OK) == is_due, || {
            format!("fmi2GetFMUstate into a state, {what}, returned {status}")
        })?;
        ensure(before.is_null() || state == before, || "fmi2GetFMUstate changed the pointer".to_owned())?;
        if status == OK {
            ensure(!state.is_null(), || "fmi2GetFMUstate gave no state".to_owned())?;
            self.keep(at, place, state, mode);
        }
        Ok(())
    }

    fn free(&mut self, at: usize) -> Checked {
        let (mut state, place, what) = self.some_state(at);
        let before = state;
        let text = format!("{what} {place:?}");
        let status =
            self.call(at, "fmi2FreeFMUstate", text, Next::Same, |instance| instance.free_state(Some(&mut state)))?;
        let is_due = before.is_null() || place.is_some();
        ensure((status == OK) == is_due, || format!("fmi2FreeFMUstate, {what}, returned {status}"))?;
        ensure(state.is_null() || (status != OK && state == before), || "another pointer".to_owned())?;
        if let Some(place) = place {
            self.slots[at].states.remove(place);
            self.slots[at].freed = vec![before];
        }
        Ok(())
    }

    fn serialize(&mut self, at: usize) -> Checked {
        const MARK: u8 = 0xa5;
        let (state, place, what) = self.some_state(at);
        let mut size = usize::MAX - 1;
        let target = if self.chance(40) { None } else { Some(&mut size) };
        let has_target = target.is_some();
        let text = format!("{what} {place:?} {has_target}");
        let function = "fmi2SerializedFMUstateSize";
        let status = self.call(at, function, text, Next::Same, |instance| instance.state_size(state, target))?;
        ensure((status == OK) == (place.is_some() && has_target), || format!("{function} returned {status}"))?;
        if size == usize::MAX - 1 {
            size = 100;
        }
        let needed = size;
        let wrong = self.random.below(3) as usize * size / 2;
        let size = if self.chance(6) { wrong } else { size };
        let mut bytes = vec![MARK; size + 8];
        let target = if self.chance(40) { None } else { Some(bytes.as_mut_slice()) };
        let is_due = place.is_some() && size >= needed && target.is_some();
        let text = format!("{what} {place:?} {size} {}", target.is_some());
        let function = "fmi2SerializeFMUstate";
        let status = self.call(at, function, text, Next::Same, |instance| instance.serialize(state, target, size))?;
        // Where the size was not told, it is not known whether this one is enough.
        let is_known = place.is_none() || has_target;
        ensure(!is_known || (status == OK) == is_due, || format!("{function} returned {status}"))?;
        let used = if status == OK { needed.min(size) } else { 0 };
        ensure(bytes[used..].iter().all(|&byte| byte == MARK), || format!("{function} wrote beyond the state"))?;
        if status == OK
            && let Some(place) = place
        {
            ensure(is_known, || format!("{function} wrote a state into {size} bytes"))?;
            bytes.truncate(used);
            if self.bytes.len() == STATES {
                let oldest = self.index(STATES);
                self.bytes.swap_remove(oldest);
            }
            self.bytes.push((bytes, self.slots[at].states[place].1));
        }
        Ok(())
    }

    fn deserialize(&mut self, at: usize) -> Checked {
        if self.bytes.is_empty() {
            return self.serialize(at);
        }
        let pick = self.index(self.bytes.len());
        let (mut bytes, mut mode) = self.bytes[pick].clone();
        let kind = self.random.below(10);
        let (what, is_due) = match kind {
            0 => {
                let at = self.index(bytes.len());
                bytes[at] ^= 1 << self.random.below(8);
                ("damaged", Some(false))
            }
            1 => {
                bytes.truncate(self.random.below(bytes.len() as u64) as usize);
                ("cut off", Some(false))
            }
            2 => {
                bytes.extend(std::iter::repeat_n(0, 1 + self.random.below(64) as usize));
                ("too long", Some(false))
            }
            3 => {
                bytes = (0..self.random.below(400)).map(|_| self.random.bits() as u8).collect();
                ("noise", Some(false))
            }
            4 => {
                self.other_version(&mut bytes);
                ("of another version", Some(false))
            }
            // What the checksum does not find: the values of another FMU of the same GUID, or crafted ones.
            5 => {
                for _ in 0..1 + self.random.below(3) {
                    self.craft(&mut bytes);
                }
                seal(&mut bytes);
                mode = None;
                ("crafted", None)
            }
            6 if !self.foreign.is_empty() => {
                let pick = self.index(self.foreign.len());
                let guid = guid(&bytes).to_vec();
                bytes.clone_from(&self.foreign[pick]);
                if self.chance(2) {
                    ("foreign", Some(false))
                } else {
                    // As if the other FMU had this one's GUID; its values may happen to suit.
                    replace_guid(&mut bytes, &guid);
                    mode = None;
                    ("foreign under this GUID", None)
                }
            }
            _ => ("good", Some(true)),
        };
        let Some((mut state, place, target)) = self.target(at) else { return self.free(at) };
        let before = state;
        let is_null = self.chance(40);
        let count = if kind > 6 && self.chance(40) { usize::MAX } else { bytes.len() };
        let text = format!("{what}, {count} of {} bytes, null {is_null}, into {target} {place:?}", bytes.len());
        let source = (!is_null).then_some(bytes.as_slice());
        let function = "fmi2DeSerializeFMUstate";
        let status = self
            .call(at, function, text, Next::Same, |instance| instance.deserialize(source, count, Some(&mut state)))?;
        let fits = !is_null && count == bytes.len() && (before.is_null() || place.is_some());
        let is_due = is_due.map(|is_due| is_due && fits);
        ensure(is_due.is_none_or(|is_due| (status == OK) == is_due), || {
            format!("{function}, {what}, returned {status}")
        })?;
        ensure(before.is_null() || state == before, || format!("{function} changed the pointer"))?;
        if status == OK {
            ensure(fits && !state.is_null(), || format!("{function} gave no state"))?;
            self.keep(at, place, state, mode);
        }
        Ok(())
    }

    /// As another version of the exporter or of the FMU would write them: with another number of the format or GUID.
    fn other_version(&mut self, bytes: &mut Vec<u8>) {
        let mut other = guid(bytes).to_vec();
        match self.random.below(5) {
            0 => {
                let version = self.pick(&[0, 1, 255]);
                bytes[VERSION_AT] = version;
                return seal(bytes);
            }
            1 => other.clear(),
            2 => other.push(b'}'),
            3 => drop(other.pop()),
            _ => {
                let at = self.index(other.len());
                other[at] ^= 1;
            }
        }
        replace_guid(bytes, &other);
    }

    /// Other bytes: a time or the number of samples, single bytes anywhere, eight anywhere that are a number, or the
    /// value of a real variable.
    fn craft(&mut self, bytes: &mut [u8]) {
        let body = bytes.len() - 8;
        let reals: Vec<_> =
            self.specs.iter().filter(|spec| spec.base_type == BaseType::Real).map(|spec| spec.reference).collect();
        match self.random.below(4) {
            0 => {
                let clock = Place::of(self.raw.guid()).clock();
                let at = self.pick(&clock);
                let numbers = [self.wild().to_bits(), self.random.bits(), 0, 1, u64::MAX];
                let number = self.pick(&numbers);
                bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
            }
            1 => {
                let at = self.index(body);
                bytes[at] = self.pick(&[0, 1, 2, 3, 4, 5, 0x7f, 0x80, 0xff]);
            }
            2 => {
                let at = self.index(body - 8);
                let number = if self.chance(2) { self.wild().to_bits() } else { self.random.bits() };
                bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
            }
            _ => {
                let reference = self.pick(&reals);
                let at = Place::of(self.raw.guid()).real(reference);
                let number = self.value(reference);
                bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
            }
        }
    }

    fn derivatives(&mut self, at: usize) -> Checked {
        let (mut unknown, mut known) = (self.references(BaseType::Real), self.references(BaseType::Real));
        if !self.chance(8) && !self.unknown.is_empty() && !self.known.is_empty() {
            let all = (self.unknown.clone(), self.known.clone());
            unknown = (0..self.random.below(6)).map(|_| self.pick(&all.0)).collect();
            known = (0..self.random.below(6)).map(|_| self.pick(&all.1)).collect();
        }
        let (unknowns, knowns) = (self.count(unknown.len()), self.count(known.len()));
        let seed: Vec<_> = known.iter().map(|_| if self.chance(20) { self.wild() } else { 1.0 }).collect();
        const MARK: f64 = -7.25e77;
        let mut result = vec![MARK; unknown.len() + 1];
        let unknown = self.maybe(unknown.as_slice());
        let known = self.maybe(known.as_slice());
        let seed = self.maybe(seed.as_slice());
        let (function, status, used) = match self.random.below(4) {
            0 => {
                let orders = vec![self.integer(); knowns.min(100)];
                let count = if knowns == usize::MAX { knowns } else { orders.len() };
                let function = "fmi2SetRealInputDerivatives";
                let text = format!("{known:?} {count} {orders:?} {seed:?}");
                let status = self.call(at, function, text, Next::Same, |instance| {
                    instance.set_input_derivatives(known, count, Some(&orders), seed)
                })?;
                (function, status, 0)
            }
            1 => {
                let orders = vec![self.integer(); unknowns.min(100)];
                let count = if unknowns == usize::MAX { unknowns } else { orders.len() };
                let function = "fmi2GetRealOutputDerivatives";
                let text = format!("{unknown:?} {count} {orders:?}");
                let status = self.call(at, function, text, Next::Same, |instance| {
                    instance.get_output_derivatives(unknown, count, Some(&orders), Some(&mut result))
                })?;
                (function, status, 0)
            }
            _ => {
                let function = "fmi2GetDirectionalDerivative";
                let text = format!("{unknown:?} {unknowns} {known:?} {knowns} {seed:?}");
                let status = self.call(at, function, text, Next::Same, |instance| {
                    instance.directional_derivatives((unknown, unknowns), (known, knowns), seed, Some(&mut result))
                })?;
                (function, status, if status == OK { unknowns } else { 0 })
            }
        };
        ensure(result[..used].iter().all(|slope| slope.is_finite()), || format!("{function} handed out {result:?}"))?;
        ensure(result[used..].iter().all(|&slope| slope == MARK), || {
            format!("{function} returned {status} and wrote what it should not: {result:?}")
        })
    }

    fn status(&mut self, at: usize) -> Checked {
        let kind = if self.chance(2) { self.random.below(4) as i32 } else { self.integer() };
        let is_null = self.chance(20);
        let text = format!("{kind} null {is_null}");
        match self.random.below(5) {
            0 => self.call(at, "fmi2GetStatus", text, Next::Same, |instance| instance.status(kind)).map(drop),
            1 => {
                let mut value = -7;
                let target = (!is_null).then_some(&mut value);
                let function = "fmi2GetIntegerStatus";
                self.call(at, function, text, Next::Same, |instance| instance.integer_status(kind, target)).map(drop)
            }
            2 => {
                let function = "fmi2GetStringStatus";
                self.call(at, function, text, Next::Same, |instance| instance.string_status(kind)).map(drop)
            }
            3 => {
                let mut value = -7;
                let target = (!is_null).then_some(&mut value);
                let function = "fmi2GetBooleanStatus";
                let status =
                    self.call(at, function, text, Next::Same, |instance| instance.boolean_status(kind, target))?;
                ensure((status == OK) == (value == 0), || format!("{function} returned {status} and wrote {value}"))
            }
            _ => {
                let mut value = f64::NAN;
                let target = (!is_null).then_some(&mut value);
                let function = "fmi2GetRealStatus";
                let status =
                    self.call(at, function, text, Next::Same, |instance| instance.real_status(kind, target))?;
                ensure((status == OK) == value.is_finite(), || format!("{function} returned {status}, wrote {value}"))
            }
        }
    }

    fn logging(&mut self, at: usize) -> Checked {
        let function = "fmi2SetDebugLogging";
        if self.chance(2) {
            let on = self.integer();
            let text = format!("{on}, all");
            let status = self.call(at, function, text, Next::Same, |instance| instance.set_all_logging(on))?;
            ensure(status == OK, || format!("{function} returned {status}"))?;
            self.slots[at].all_logged = on != 0;
            return Ok(());
        }
        let owned: Vec<_> = (0..1 + self.random.below(4)).map(|_| self.text()).collect();
        let names: Vec<_> = owned.iter().map(|text| raw::Text::new(text.as_deref())).collect();
        let count = self.count(names.len());
        let categories = self.maybe(names.as_slice());
        let text = format!("{count} {} {owned:.60?}", categories.is_some());
        let call = |instance: &RawInstance<'_>| instance.set_debug_logging(count, categories);
        let status = self.call(at, function, text, Next::Same, call)?;
        if status == OK {
            self.slots[at].all_logged = false;
        }
        Ok(())
    }
}

/// The GUID in the bytes of a state.
fn guid(bytes: &[u8]) -> &[u8] {
    let length: [u8; 4] = bytes[GUID_AT - 4..GUID_AT].try_into().expect("four bytes");
    &bytes[GUID_AT..][..u32::from_le_bytes(length) as usize]
}

/// Another GUID, with a fitting checksum.
fn replace_guid(bytes: &mut Vec<u8>, other: &[u8]) {
    let end = GUID_AT + guid(bytes).len();
    bytes.splice(GUID_AT..end, other.iter().copied());
    bytes[GUID_AT - 4..GUID_AT].copy_from_slice(&(other.len() as u32).to_le_bytes());
    seal(bytes);
}
