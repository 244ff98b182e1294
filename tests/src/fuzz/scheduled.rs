//! Fuzzer of scheduled execution, with the example Clocks: random calls of one thread, and bursts of calls of up to
//! three threads, each with a clock of its own.
//!
//! The reference is a small model of the standard (FMI 3.0.2, sections 2.2.8 and 5.2) and of the counters in Clocks. It
//! predicts the status of every call and every value. In a burst, the values do not depend on the order of the threads.

use super::{Checked, Report, SHOWN, Violation, ensure, texts};
use crate::Fmu;
use crate::raw::{Arguments, ERROR, EventArguments, OK, Raw, RawInstance, RawState, Shared, locks};
use crate::signals::Random;
use fmu_import::c_api::{RawStatus, Reference};
use fmu_import::description::FmiVersion;
use std::collections::{BTreeMap, VecDeque};
use std::ffi::CString;
use std::time::Instant;

/// `fmuType` of [`Arguments::kind`].
const SCHEDULED: i32 = 2;
/// Clocks by position: every second, triggered, countdown that the first clock starts at 4 s.
const CLOCKS: [&str; 3] = ["inClock1", "inClock2", "inClock3"];
const COUNTERS: [&str; 6] =
    ["inClock1Ticks", "inClock2Ticks", "inClock3Ticks", "totalInClockTicks", "result2", "output3"];
/// The time at which the first clock starts the countdown, s.
const COUNTDOWN: f64 = 4.0;
/// The output clock ticks when the number of all ticks becomes a multiple of this.
const PERIOD: i32 = 5;
/// Value in an array before a call.
const MARK: i32 = i32::MIN + 77;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Instantiated,
    Initialization,
    ClockActivation,
    Terminated,
}
use Mode::{ClockActivation, Initialization, Instantiated, Terminated};

/// State of the countdown clock: the qualifier of its interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Countdown {
    NotYetKnown = 0,
    Unchanged = 1,
    Changed = 2,
}

/// The state of an instance as the standard and the equations of Clocks require it.
#[derive(Clone, Copy, Debug)]
struct Model {
    mode: Mode,
    start: f64,
    stop: f64,
    time: f64,
    last: [Option<f64>; 3],
    ticks: [i32; 3],
    input: i32,
    sum: i32,
    output: i32,
    has_fired: bool,
    countdown: Countdown,
}

impl Model {
    const NEW: Self = Self {
        mode: Instantiated,
        start: 0.0,
        stop: f64::INFINITY,
        time: 0.0,
        last: [None; 3],
        ticks: [0; 3],
        input: 0,
        sum: 0,
        output: 0,
        has_fired: false,
        countdown: Countdown::NotYetKnown,
    };

    fn counters(&self) -> [i32; 6] {
        let [first, second, third] = self.ticks;
        [first, second, third, first + second + third, self.sum, self.output]
    }

    fn is_activated(&self, clock: usize, time: f64) -> bool {
        let is_later = self.last[clock].map_or(time >= self.start, |last| time > last);
        self.mode == ClockActivation && time.is_finite() && time <= self.stop && is_later
    }

    /// A tick of a clock. Returns true if the importer gets an update.
    fn activate(&mut self, clock: usize, time: f64) -> bool {
        self.last[clock] = Some(time);
        self.time = self.time.max(time);
        self.ticks[clock] += 1;
        let starts = clock == 0 && time == COUNTDOWN;
        match clock {
            0 if starts => self.countdown = Countdown::Changed,
            0 => {}
            1 => self.sum = self.sum.wrapping_add(self.input),
            _ => (self.output, self.countdown) = (1000, Countdown::NotYetKnown),
        }
        let fires = self.counters()[3] % PERIOD == 0;
        self.has_fired |= fires;
        fires || starts
    }
}

/// Value references of Clocks.
#[derive(Clone, Copy)]
struct References {
    clocks: [Reference; 3],
    output_clock: Reference,
    input: Reference,
    counters: [Reference; 6],
    time: Reference,
}

/// Calls of one thread in a burst.
#[derive(Default)]
struct Burst {
    model: Option<Model>,
    functions: BTreeMap<&'static str, [u64; 3]>,
    updates: u64,
    starts: u64,
    /// Ticks of the output clock that the thread has seen.
    seen: u64,
}

struct Fuzzer<'a> {
    raw: &'a Raw,
    of: References,
    random: Random,
    instance: Shared<'a>,
    has_callbacks: bool,
    model: Model,
    states: Vec<(RawState, Model)>,
    bytes: Vec<(Vec<u8>, Model)>,
    last: VecDeque<String>,
    report: Report,
    is_verbose: bool,
}

/// Calls Clocks in scheduled execution while `goes_on` returns true, as in [`fuzz`](super::fuzz).
///
/// # Errors
/// The FMU breaks a rule.
///
/// # Panics
/// If the FMU is not the example Clocks.
pub fn fuzz_scheduled(
    (fmu, raw): (&Fmu, &Raw),
    seed: u64,
    is_verbose: bool,
    mut goes_on: impl FnMut(u64) -> bool,
) -> Result<Report, Violation> {
    let clock = |name: &str| {
        let found = fmu.description.clocks.iter().find(|clock| clock.name == name);
        found.unwrap_or_else(|| panic!("{} is not the example Clocks", fmu.name)).reference
    };
    let of = References {
        clocks: CLOCKS.map(clock),
        output_clock: clock("outClock"),
        input: fmu.reference("input2"),
        counters: COUNTERS.map(|name| fmu.reference(name)),
        time: fmu.reference("time"),
    };
    let mut fuzzer = Fuzzer {
        raw,
        of,
        random: Random(seed),
        instance: Shared(instantiate(raw, true)),
        has_callbacks: true,
        model: Model::NEW,
        states: Vec::new(),
        bytes: Vec::new(),
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

fn instantiate(raw: &Raw, schedules: bool) -> RawInstance<'_> {
    let guid = CString::new(raw.guid()).expect("no zeros");
    let events = EventArguments { schedules, ..EventArguments::default() };
    let (name, guid) = (Some(c"scheduled"), Some(guid.as_c_str()));
    let arguments = Arguments { name, kind: SCHEDULED, guid, resources: None, callbacks: true, events };
    raw.instantiate_logging(arguments, 0).expect("an instance")
}

/// A call to one value: status and value; the value is not written if the call is rejected.
fn read<T: Copy + PartialEq>(status: RawStatus, value: T, mark: T) -> (RawStatus, Option<T>) {
    (status, (value != mark || status == OK).then_some(value))
}

fn integers(instance: &RawInstance<'_>, references: &[Reference]) -> (RawStatus, Vec<i32>) {
    let mut values = vec![MARK; references.len()];
    (instance.get(Some(references), references.len(), Some(&mut values)), values)
}

fn ticks(instance: &RawInstance<'_>, clock: Reference) -> (RawStatus, Option<u8>) {
    let mut value = [77];
    let status = instance.clocks("fmi3GetClock", &[clock], Some(&mut value));
    read(status, value[0], 77)
}

fn interval(instance: &RawInstance<'_>, clock: Reference) -> (RawStatus, Option<(f64, i32)>) {
    let (mut value, mut qualifier) = ([-7.0], [77]);
    let status = instance.intervals(&[clock], Some(&mut value), Some(&mut qualifier));
    read(status, (value[0], qualifier[0]), (-7.0, 77))
}

fn set(instance: &RawInstance<'_>, reference: Reference, value: i32) -> RawStatus {
    instance.set(Some(&[reference]), 1, Some(&[value]))
}

impl<'a> Fuzzer<'a> {
    fn below(&mut self, end: u64) -> u64 {
        self.random.below(end)
    }

    /// Makes a call with a predicted status. Checks the messages and, now and then, that a rejected call changes nothing.
    fn expect<T>(
        &mut self,
        function: &'static str,
        text: String,
        is_due: bool,
        call: impl FnOnce(&RawInstance<'a>) -> (RawStatus, T),
    ) -> Checked<T> {
        let text = format!("{function} {text}");
        if self.is_verbose {
            eprintln!("{}: {text}", self.report.calls + 1);
        }
        if self.last.len() == SHOWN {
            self.last.pop_front();
        }
        self.last.push_back(text);
        let before = if is_due || self.below(16) > 0 { None } else { Some(self.content()?) };
        let began = Instant::now();
        let (status, result) = call(&self.instance.0);
        let duration = began.elapsed();
        if duration > self.report.slowest.0 {
            self.report.slowest = (duration, self.last.back().cloned().unwrap_or_default());
        }
        self.report.calls += 1;
        let column = match status {
            OK => 0,
            ERROR => 2,
            _ => return Err(format!("{function} returned {status}")),
        };
        self.report.functions.entry(function).or_default()[column] += 1;
        let entries = self.instance.0.take_log();
        let message = texts(FmiVersion::V3, &entries, b"")?;
        ensure((status == OK) == is_due, || format!("{function} returned {status}, {:?}: {message}", self.model))?;
        ensure(status == OK || message.starts_with(function), || format!("{function} logged: {message}"))?;
        if let Some(before) = before {
            let after = self.content()?;
            ensure(after == before, || format!("{function} was rejected and changed the state: {message}"))?;
        }
        Ok(result)
    }

    /// The bytes of the instance's state.
    fn content(&mut self) -> Checked<Vec<u8>> {
        let (instance, mut state, mut size) = (&self.instance.0, RawState::NULL, 0);
        let saved = [instance.get_state(Some(&mut state)), instance.state_size(state, Some(&mut size))];
        let mut bytes = vec![0; size];
        let written = [instance.serialize(state, Some(&mut bytes), size), instance.free_state(Some(&mut state))];
        self.report.probes += 4;
        ensure([saved, written] == [[OK; 2]; 2], || format!("no state was saved: {:?}", self.instance.0.take_log()))?;
        Ok(bytes)
    }

    fn once(&mut self) -> Checked {
        if self.below(500) == 0 {
            self.last.push_back("a new instance".to_owned());
            self.has_callbacks = self.below(3) > 0;
            self.instance = Shared(instantiate(self.raw, self.has_callbacks));
            (self.model, self.states) = (Model::NEW, Vec::new());
        }
        match self.below(100) {
            0..14 => self.transition(),
            14..40 => self.activate(),
            40..50 => self.values(),
            50..62 => self.read_clocks(),
            62..70 => self.others(),
            70..90 => self.state(),
            _ if self.model.mode == ClockActivation && self.model.stop == f64::INFINITY => self.burst(),
            _ => self.activate(),
        }
    }

    fn transition(&mut self) -> Checked {
        const FUNCTIONS: [&str; 4] =
            ["fmi3ExitInitializationMode", "fmi3Terminate", "fmi3Reset", "fmi3EnterConfigurationMode"];
        let mode = self.model.mode;
        let (start, has_stop) = ([0.0, 0.0, 3.0, -2.5, f64::NAN][self.below(5) as usize], self.below(3) == 0);
        let stop = [50.0, 1e6, -100.0, f64::INFINITY, f64::NAN][self.below(5) as usize];
        let at = match mode {
            _ if self.below(6) == 0 => self.below(5) as usize,
            Instantiated => 4,
            Initialization => 0,
            ClockActivation if self.below(4) > 0 => return self.activate(),
            ClockActivation => 1,
            Terminated => 2,
        };
        if at == 4 {
            let is_due = mode == Instantiated && start.is_finite() && (!has_stop || stop >= start);
            let text = format!("{start:e} {has_stop} {stop:e}");
            self.expect("fmi3EnterInitializationMode", text, is_due, |instance| {
                (instance.enter_initialization((false, 0.0), start, (has_stop, stop)), ())
            })?;
            if is_due {
                let stop = if has_stop { stop } else { f64::INFINITY };
                self.model = Model { mode: Initialization, start, stop, time: start, ..self.model };
            }
            return Ok(());
        }
        let is_due = [mode == Initialization, mode == ClockActivation, true, false][at];
        let name = FUNCTIONS[at];
        self.expect(name, String::new(), is_due, |instance| (instance.transition(name), ()))?;
        match at {
            _ if !is_due => {}
            0 => self.model.mode = ClockActivation,
            1 => self.model.mode = Terminated,
            _ => self.model = Model::NEW,
        }
        Ok(())
    }

    fn activate(&mut self) -> Checked {
        let (clock, of) = (self.below(3) as usize, self.of);
        let is_clock = self.below(30) > 0;
        let other = [of.output_clock, of.input, Reference::MAX][self.below(3) as usize];
        let reference = if is_clock { of.clocks[clock] } else { other };
        let last = self.model.last[clock].unwrap_or(self.model.start);
        let time = match self.below(12) {
            0 => [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, -1e300][self.below(5) as usize],
            1 => last,
            2 => last.next_up(),
            3 => last - 1.0,
            4 => COUNTDOWN,
            _ => last + 0.25 * self.below(8) as f64,
        };
        // A time within the tolerance of the stop time is accepted.
        if (time - self.model.stop).abs() < 1e-3 * time.abs() {
            return Ok(());
        }
        // Greater times would leave no room for later activations.
        if time > 1e300 && self.below(50) > 0 {
            return Ok(());
        }
        let is_due = is_clock && self.model.is_activated(clock, time);
        let has_update = is_due && self.model.activate(clock, time) && self.has_callbacks;
        let mut updates = Vec::new();
        let text = format!("{reference} {time:e}");
        self.expect("fmi3ActivateModelPartition", text, is_due, |instance| {
            let status = instance.activate(reference, time, &mut || {
                let (fired, read) = (ticks(instance, of.output_clock), interval(instance, of.clocks[2]));
                let rejected = [set(instance, of.input, 1), integers(instance, &of.counters).0];
                updates.push((fired, read, rejected, instance.transition("fmi2Terminate")));
                let _ = instance.take_log();
                None
            });
            (status, ())
        })?;
        ensure(updates.len() == usize::from(has_update), || format!("{} updates: {:?}", updates.len(), self.model))?;
        for (fired, read, rejected, terminate) in updates {
            let expected = (OK, Some(u8::from(self.model.has_fired)));
            ensure(fired == expected, || format!("fmi3GetClock in an update: {fired:?}, expected {expected:?}"))?;
            self.check_countdown(read)?;
            ensure((rejected, terminate) == ([ERROR; 2], ERROR), || "Clock Update Mode allows too much".to_owned())?;
            self.model.has_fired = false;
        }
        Ok(())
    }

    /// Checks an interval of the countdown clock, after which the importer knows it.
    fn check_countdown(&mut self, found: (RawStatus, Option<(f64, i32)>)) -> Checked {
        let expected = (OK, Some((0.0, self.model.countdown as i32)));
        if self.model.countdown == Countdown::Changed {
            self.model.countdown = Countdown::Unchanged;
        }
        ensure(found == expected, || format!("interval of the countdown {found:?}, expected {expected:?}"))
    }

    fn values(&mut self) -> Checked {
        let (of, model) = (self.of, self.model);
        match self.below(5) {
            0 | 1 => {
                let is_due = model.mode != Terminated;
                let value = self.below(2001) as i32 - 1000;
                self.expect("fmi3SetInt32", format!("{value}"), is_due, |instance| {
                    (set(instance, of.input, value), ())
                })?;
                if is_due {
                    self.model.input = value;
                }
                Ok(())
            }
            2 => {
                let is_known = self.below(8) > 0;
                let reference = if is_known { of.time } else { of.input };
                let mut time = [-7.0_f64];
                self.expect("fmi3GetFloat64", format!("{reference}"), is_known, |instance| {
                    (instance.get(Some(&[reference]), 1, Some(&mut time)), ())
                })?;
                let expected = if is_known { model.time } else { -7.0 };
                ensure(time[0].to_bits() == expected.to_bits(), || format!("the time is {time:?}, {model:?}"))
            }
            _ => {
                let found = self.expect("fmi3GetInt32", String::new(), true, |i| integers(i, &of.counters))?;
                ensure(found == model.counters(), || format!("{COUNTERS:?} = {found:?}, {model:?}"))
            }
        }
    }

    fn read_clocks(&mut self) -> Checked {
        let (of, mode) = (self.of, self.model.mode);
        let is_active = mode == ClockActivation;
        match self.below(6) {
            0 | 1 => {
                let found = self.expect("fmi3GetClock", String::new(), is_active, |i| ticks(i, of.output_clock))?;
                let expected = is_active.then_some(u8::from(self.model.has_fired));
                self.model.has_fired &= !is_active;
                ensure(found == expected, || format!("fmi3GetClock returned {found:?}, expected {expected:?}"))
            }
            2 | 3 => {
                let is_due = is_active || mode == Initialization;
                let found = self.expect("fmi3GetIntervalDecimal", "countdown".to_owned(), is_due, |instance| {
                    interval(instance, of.clocks[2])
                })?;
                if is_due { self.check_countdown((OK, found)) } else { Ok(()) }
            }
            4 => {
                // A triggered clock has no interval, and an output clock is no input clock.
                let (clock, is_right) =
                    [(of.clocks[0], true), (of.clocks[1], false), (of.output_clock, false)][self.below(3) as usize];
                let is_due = is_right && (is_active || mode == Initialization);
                let text = format!("{clock}");
                let found =
                    self.expect("fmi3GetIntervalDecimal", text, is_due, |instance| interval(instance, clock))?;
                let is_one = found.is_some_and(|(value, qualifier)| value == 1.0 && [1, 2].contains(&qualifier));
                ensure(is_one == is_due, || format!("interval of {clock}: {found:?}"))
            }
            _ => {
                let at = self.below(3) as usize;
                let (clock, is_due) = (of.clocks[at], at == 0 && mode == Initialization);
                let mut shift = [-7.0];
                self.expect("fmi3GetShiftDecimal", format!("{clock}"), is_due, |instance| {
                    (instance.clock_times("fmi3GetShiftDecimal", &[clock], Some(&mut shift)), ())
                })?;
                let expected = if is_due { 0.0 } else { -7.0 };
                ensure(shift == [expected], || format!("shift of {clock}: {shift:?}"))
            }
        }
    }

    /// Functions that are never allowed in scheduled execution or for these clocks, and dependencies.
    fn others(&mut self) -> Checked {
        let of = self.of;
        match self.below(8) {
            0 => {
                let function = "fmi3SetClock";
                self.expect(function, String::new(), false, |i| {
                    (i.clocks(function, &of.clocks[..1], Some(&mut [1])), ())
                })
            }
            1 => self.expect("fmi3DoStep", String::new(), false, |i| {
                (i.step_with_events(0.0, 1.0, Some(&mut [0; 3]), Some(&mut 0.0)), ())
            }),
            2 => self.expect("fmi3UpdateDiscreteStates", String::new(), false, |i| (i.update(None), ())),
            3 => self.expect("fmi3SetTime", String::new(), false, |i| (i.set_time(1.0), ())),
            4 => {
                let function = "fmi3SetIntervalDecimal";
                self.expect(function, String::new(), false, |i| {
                    (i.clock_times(function, &of.clocks[..1], Some(&mut [0.5])), ())
                })
            }
            5 => self.expect("fmi3EnterStepMode", String::new(), false, |i| (i.transition("fmi3EnterStepMode"), ())),
            6 => {
                let (reference, mut number) = (of.counters[self.below(6) as usize], usize::MAX);
                let function = "fmi3GetNumberOfVariableDependencies";
                self.expect(function, format!("{reference}"), true, |i| {
                    (i.number_of_dependencies(reference, Some(&mut number)), ())
                })?;
                ensure(number != usize::MAX, || "no number of dependencies".to_owned())
            }
            _ => self.expect("fmi3SetDebugLogging", String::new(), true, |i| (i.set_all_logging(0), ())),
        }
    }

    fn state(&mut self) -> Checked {
        let at = if self.states.is_empty() { 0 } else { self.below(self.states.len() as u64) as usize };
        match self.below(6) {
            0 | 1 if self.states.len() < 4 => {
                let mut state = RawState::NULL;
                self.expect("fmi3GetFMUState", "new".to_owned(), true, |i| (i.get_state(Some(&mut state)), ()))?;
                self.states.push((state, self.model));
                Ok(())
            }
            _ if self.states.is_empty() => {
                let state = RawState::invented(0xdead_beef);
                self.expect("fmi3SetFMUState", "made up".to_owned(), false, |i| (i.set_state(state), ()))
            }
            0 | 1 => {
                let mut state = self.states[at].0;
                self.expect("fmi3GetFMUState", format!("{at}"), true, |i| (i.get_state(Some(&mut state)), ()))?;
                self.states[at].1 = self.model;
                Ok(())
            }
            2 => {
                let (state, model) = self.states[at];
                self.expect("fmi3SetFMUState", format!("{at}"), true, |i| (i.set_state(state), ()))?;
                self.model = model;
                Ok(())
            }
            3 => {
                let (mut state, _) = self.states.swap_remove(at);
                self.expect("fmi3FreeFMUState", format!("{at}"), true, |i| (i.free_state(Some(&mut state)), ()))
            }
            4 => {
                let ((state, model), mut size) = (self.states[at], 0);
                let function = "fmi3SerializedFMUStateSize";
                self.expect(function, format!("{at}"), true, |i| (i.state_size(state, Some(&mut size)), ()))?;
                let mut bytes = vec![0; size];
                self.expect("fmi3SerializeFMUState", format!("{at}"), true, |i| {
                    (i.serialize(state, Some(&mut bytes), size), ())
                })?;
                self.bytes.truncate(3);
                self.bytes.insert(0, (bytes, model));
                Ok(())
            }
            _ if self.bytes.is_empty() => Ok(()),
            _ => {
                let pick = self.below(self.bytes.len() as u64) as usize;
                let (mut bytes, model) = self.bytes[pick].clone();
                let is_whole = self.below(3) > 0;
                if !is_whole {
                    let place = self.below(bytes.len() as u64) as usize;
                    bytes[place] ^= 1 << self.below(8);
                }
                let mut state = self.states[at].0;
                self.expect("fmi3DeserializeFMUState", format!("whole {is_whole} into {at}"), is_whole, |i| {
                    (i.deserialize(Some(&bytes), bytes.len(), Some(&mut state)), ())
                })?;
                if is_whole {
                    self.states[at].1 = model;
                }
                Ok(())
            }
        }
    }

    /// Several threads make calls, each with a clock of its own.
    fn burst(&mut self) -> Checked {
        let threads = 1 + self.below(3) as usize;
        let seeds: Vec<_> = (0..threads).map(|_| self.random.bits()).collect();
        self.last.push_back(format!("{threads} threads with seeds {seeds:?}"));
        let (before, locked, instance) = (self.model, locks(), &self.instance);
        let (of, has_callbacks) = (self.of, self.has_callbacks);
        let bursts: Vec<_> = std::thread::scope(|scope| {
            let run = |(clock, &seed)| scope.spawn(move || work(instance, of, clock, before, Random(seed)));
            let running: Vec<_> = seeds.iter().enumerate().map(run).collect();
            running.into_iter().map(|thread| thread.join().unwrap_or_else(|_| Err("a panic".to_owned()))).collect()
        });
        let entries = self.instance.0.take_log();
        texts(FmiVersion::V3, &entries, b"")?;
        let [mut updates, mut starts, mut seen] = [0; 3];
        for (clock, burst) in bursts.into_iter().enumerate() {
            let burst = burst?;
            let model = burst.model.expect("the thread has ended");
            for (function, counts) in burst.functions {
                let sum = self.report.functions.entry(function).or_default();
                sum.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
                self.report.calls += counts.iter().sum::<u64>();
            }
            (updates, starts, seen) = (updates + burst.updates, starts + burst.starts, seen + burst.seen);
            self.model.ticks[clock] = model.ticks[clock];
            self.model.last[clock] = model.last[clock];
            self.model.time = self.model.time.max(model.time);
            match clock {
                0 => {}
                1 => (self.model.input, self.model.sum) = (model.input, model.sum),
                _ => self.model.output = model.output,
            }
        }
        let found = self.expect("fmi3GetInt32", "after threads".to_owned(), true, |i| integers(i, &of.counters))?;
        ensure(found == self.model.counters(), || format!("{COUNTERS:?} = {found:?}, {:?}", self.model))?;
        let [first, last] = [before, self.model].map(|model| (model.counters()[3] / PERIOD) as u64);
        let fired = last - first;
        let is_right = (fired.max(starts)..=fired + starts).contains(&updates) || (!has_callbacks && updates == 0);
        ensure(is_right, || format!("{updates} updates for {fired} ticks and {starts} countdowns"))?;
        let ticks = self.expect("fmi3GetClock", "after threads".to_owned(), true, |i| ticks(i, of.output_clock))?;
        let (seen, most) = (seen + u64::from(ticks.unwrap_or(0)), fired + u64::from(before.has_fired));
        ensure(seen <= most && (most == 0 || seen > 0), || format!("{seen} ticks were seen, {most} happened"))?;
        self.model.has_fired = false;
        let found =
            self.expect("fmi3GetIntervalDecimal", "after threads".to_owned(), true, |i| interval(i, of.clocks[2]))?;
        let qualifier = found.map_or(-1, |(_, qualifier)| qualifier);
        let may_run = starts > 0 || before.countdown != Countdown::NotYetKnown;
        ensure(qualifier == 0 || (may_run && [1, 2].contains(&qualifier)), || format!("countdown: {found:?}"))?;
        self.model.countdown = if qualifier == 0 { Countdown::NotYetKnown } else { Countdown::Unchanged };
        let calls: Vec<_> = locks().into_iter().zip(locked).map(|(now, before)| now - before).collect();
        ensure(calls[0] == calls[1] && (calls[0] > 0) == has_callbacks, || format!("{calls:?} locks and unlocks"))
    }
}

/// Calls of a thread that activates one clock. Returns an error if a status or value is not the predicted one.
fn work(shared: &Shared<'_>, of: References, clock: usize, model: Model, mut random: Random) -> Checked<Burst> {
    let (instance, mut burst, mut model) = (&shared.0, Burst::default(), model);
    let mut count = |function: &'static str, status: RawStatus, expected: RawStatus| {
        burst.functions.entry(function).or_default()[usize::from(status == ERROR) * 2] += 1;
        ensure(status == expected, || format!("{function} returned {status} in the thread of clock {clock}"))
    };
    for _ in 0..8 + random.below(8) {
        match random.below(8) {
            0..3 => {
                let last = model.last[clock].unwrap_or(model.start);
                let time = if last < COUNTDOWN && random.below(4) == 0 { COUNTDOWN } else { last + 0.25 };
                let mut found = Vec::new();
                let is_due = model.is_activated(clock, time);
                let status = instance.activate(of.clocks[clock], time, &mut || {
                    let read = [ticks(instance, of.output_clock), ticks(instance, of.output_clock)];
                    let other = interval(instance, of.clocks[2]).0;
                    found.push((read, other, set(instance, of.input, 1), integers(instance, &of.counters).0));
                    None
                });
                count("fmi3ActivateModelPartition", status, if is_due { OK } else { ERROR })?;
                if is_due {
                    burst.starts += u64::from(clock == 0 && time == COUNTDOWN);
                    model.activate(clock, time);
                }
                for (read, other, set, get) in found {
                    burst.updates += 1;
                    for (status, fired) in read {
                        count("fmi3GetClock", status, OK)?;
                        burst.seen += u64::from(fired.unwrap_or(0));
                    }
                    count("fmi3GetIntervalDecimal", other, OK)?;
                    count("fmi3SetInt32", set, ERROR)?;
                    count("fmi3GetInt32", get, ERROR)?;
                }
            }
            3 => {
                if let Some(last) = model.last[clock] {
                    let status = instance.activate(of.clocks[clock], last, &mut || None);
                    count("fmi3ActivateModelPartition", status, ERROR)?;
                }
            }
            4 if clock == 1 => {
                model.input = random.below(2001) as i32 - 1000;
                count("fmi3SetInt32", set(instance, of.input, model.input), OK)?;
            }
            4 | 5 => {
                let (status, found) = integers(instance, &of.counters[clock..=clock]);
                count("fmi3GetInt32", status, OK)?;
                ensure(found == [model.ticks[clock]], || {
                    format!("{found:?} ticks of clock {clock}, expected {}", model.ticks[clock])
                })?;
            }
            6 => {
                let (status, fired) = ticks(instance, of.output_clock);
                count("fmi3GetClock", status, OK)?;
                burst.seen += u64::from(fired.unwrap_or(0));
            }
            _ => {
                let status = instance.clocks("fmi3SetClock", &of.clocks[..1], Some(&mut [1]));
                count("fmi3SetClock", status, ERROR)?;
            }
        }
    }
    burst.model = Some(model);
    Ok(burst)
}
