//! Scheduled execution. Reference: FMI 3.0.2, sections 5.1 and 5.2; the published model Clocks of the Reference FMUs;
//! counts and sums in closed form, whatever the order of the threads.
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicI64, AtomicPtr, Ordering::SeqCst};
use std::sync::{Barrier, Mutex};

use fmu::prelude::*;
use fmu::testing::abi::fmi3::{self, Arguments};
use fmu::testing::abi::{self, Component, Export, FmuState, Status};
use fmu::testing::calls::Function;
use fmu::testing::description::{Description, Format};

use crate::models::{exported, reference};

#[allow(unreachable_pub, reason = "the example is a library")]
#[path = "../../../../examples/reference-fmus/clocks/src/lib.rs"]
mod clocks;

#[derive(Parameters)]
struct Workers {
    /// Interval of `first` (s)
    #[var(start = 1.0, tunable)]
    period: f64,
    /// Offset of the third sum (1)
    #[var(start = 0.0, tunable)]
    offset: f64,
}

#[derive(Inputs)]
struct Work {
    /// Summand of the first part (1)
    #[var(clock = "first")]
    first_value: f64,
    /// Summand of the second part (1)
    #[var(clock = "second")]
    second_value: f64,
    /// Summand of the third part (1)
    #[var(clock = "third")]
    third_value: f64,
}

#[derive(Outputs)]
struct Sums {
    /// Sum of the first part (1)
    #[var(clock = "first")]
    first_sum: f64,
    /// Sum of the second part (1)
    #[var(clock = "second")]
    second_sum: f64,
    /// Sum of the third part (1)
    #[var(clock = "third")]
    third_sum: f64,
    /// Number of ticks of all parts
    total: i32,
    /// Time since the last tick of `second` (s)
    passed: f64,
    /// Ticks with `first`
    first_done: Clock,
    /// Ticks with `second`
    second_done: Clock,
}

#[derive(DiscreteState, Clone, Default)]
struct Count {
    total: i32,
}

impl Count {
    /// Adds 1, and loses a count if another thread runs a part at the same time.
    fn count(&mut self) -> i32 {
        let before = self.total;
        std::thread::yield_now();
        self.total = before + 1;
        self.total
    }
}

/// Three parts with a common count
#[fmu::model(stop_time = 1.0, step_size = 1.0)]
impl Discrete for Workers {
    type Inputs = Work;
    type Outputs = Sums;
    type State = Count;

    /// First part
    #[clock(interval_of = "period", priority = 0)]
    fn first(&self, tick: Tick<Self>) {
        assert!(tick.inputs.first_value >= 0.0, "a negative value");
        tick.outputs.first_sum += tick.inputs.first_value;
        tick.outputs.total = tick.state.count();
        assert!(!tick.outputs.second_done.has_fired(), "the tick of another part");
        tick.outputs.first_done.fire();
    }

    /// Second part
    #[clock(triggered, priority = 1)]
    fn second(&self, mut tick: Tick<Self>) {
        tick.outputs.second_sum += tick.inputs.second_value;
        tick.outputs.total = tick.state.count();
        tick.outputs.passed = tick.interval;
        tick.outputs.second_done.fire();
        if tick.inputs.second_value > 0.0 {
            let after = tick.inputs.second_value;
            tick.start(WorkersClock::Alarm, after);
        }
    }

    /// Third part
    #[clock(changing, interval = 0.5, priority = 2)]
    fn third(&self, mut tick: Tick<Self>) {
        tick.outputs.third_sum += tick.inputs.third_value + self.offset;
        tick.outputs.total = tick.state.count();
        tick.start(WorkersClock::Third, 0.25);
    }

    /// Started by the second part
    #[clock(countdown, priority = 3)]
    fn alarm(&self, tick: Tick<Self>) {
        tick.outputs.total = tick.state.count();
    }
}

/// Only one of its clocks has a priority
#[derive(Parameters)]
struct Mixed {}

/// Two parts without results
#[fmu::model(stop_time = 1.0, step_size = 1.0)]
impl Discrete for Mixed {
    /// First part
    #[clock(interval = 1.0, priority = 0)]
    fn first(&self, _: Tick<Self>) {}

    /// Second part
    #[clock(triggered)]
    fn second(&self, _: Tick<Self>) {}
}

exported! {
    Clocks: clocks::Clocks, Format::FMI3;
    Parts: Workers, Format::FMI3;
    Unordered: crate::clocks::Watch, Format::FMI3;
    MixedParts: Mixed, Format::FMI3;
}

type Callback = Box<dyn Fn(Component) + Send + Sync>;

/// The instance environment.
struct Environment {
    messages: Mutex<Vec<String>>,
    component: AtomicPtr<c_void>,
    clock_update: Callback,
}

unsafe extern "C" fn log(environment: *mut c_void, _: c_int, _: *const c_char, message: *const c_char) {
    // SAFETY: the environment of the test, and a C string.
    let (environment, message) = unsafe { (&*environment.cast::<Environment>(), CStr::from_ptr(message)) };
    environment.messages.lock().unwrap().push(message.to_str().unwrap().to_owned());
}

unsafe extern "C" fn clock_update(environment: *mut c_void) {
    // SAFETY: the environment of the test.
    let environment = unsafe { &*environment.cast::<Environment>() };
    (environment.clock_update)(environment.component.load(SeqCst));
}

/// An instance of FMI 3.0 that several threads may use; freed when dropped.
struct Scheduled<E: Export> {
    component: Component,
    environment: Box<Environment>,
    model: std::marker::PhantomData<fn(E)>,
}

// SAFETY: for scheduled execution, the functions of the C interface may be called by several threads.
unsafe impl<E: Export> Sync for Scheduled<E> {}

impl<E: Export> Drop for Scheduled<E> {
    fn drop(&mut self) {
        // SAFETY: a component that was not freed.
        unsafe { fmi3::free_instance::<E>(self.component) }
    }
}

fn interval<E: Export>(component: Component, clock: &str) -> (f64, c_int) {
    let (mut interval, mut qualifier) = (0.0, -1);
    // SAFETY: a live component, and values to write to.
    let status =
        unsafe { fmi3::get_interval_decimal::<E>(component, &reference::<E>(clock), 1, &mut interval, &mut qualifier) };
    assert_eq!(status, Status::Ok);
    (interval, qualifier)
}

fn ticks<E: Export>(component: Component, clock: &str) -> bool {
    let mut value = 2;
    // SAFETY: a live component, and a value to write to.
    assert_eq!(unsafe { fmi3::get_clock::<E>(component, &reference::<E>(clock), 1, &mut value) }, Status::Ok);
    value == 1
}

impl<E: Export> Scheduled<E> {
    fn make(
        callback: impl Fn(Component) + Send + Sync + 'static,
        instantiate: impl FnOnce(Arguments) -> Component,
    ) -> Self {
        let (messages, component) = (Mutex::default(), AtomicPtr::default());
        let environment = Box::new(Environment { messages, component, clock_update: Box::new(callback) });
        let token = CString::new(E::description().guid.clone()).unwrap();
        let component = instantiate(Arguments {
            name: c"instance".as_ptr(),
            token: token.as_ptr(),
            resources: null(),
            logging_on: 0,
            environment: std::ptr::from_ref(&*environment).cast_mut().cast(),
            logger: Some(log),
        });
        environment.component.store(component, SeqCst);
        Self { component, environment, model: std::marker::PhantomData }
    }

    fn with(callback: impl Fn(Component) + Send + Sync + 'static) -> Self {
        // SAFETY: strings that end with a zero, and functions of these types.
        Self::make(callback, |arguments| unsafe {
            fmi3::instantiate_scheduled_execution::<E>(arguments, Some(clock_update), None, None)
        })
    }

    /// In Clock Activation Mode at 0 s.
    fn ready(callback: impl Fn(Component) + Send + Sync + 'static) -> Self {
        let this = Self::with(callback);
        assert!(!this.component.is_null(), "{}", this.error());
        this.initialize(0.0, None);
        this
    }

    fn initialize(&self, start: f64, stop: Option<f64>) {
        let (has_stop, stop) = (stop.is_some().into(), stop.unwrap_or(0.0));
        // SAFETY: a live component.
        unsafe {
            let status = fmi3::enter_initialization_mode::<E>(self.component, 0, 0.0, start, has_stop, stop);
            assert_eq!(status, Status::Ok);
            assert_eq!(fmi3::exit_initialization_mode::<E>(self.component), Status::Ok);
        }
    }

    fn activate(&self, clock: &str, time: f64) -> Status {
        // SAFETY: a live component.
        unsafe { fmi3::activate_model_partition::<E>(self.component, reference::<E>(clock), time) }
    }

    fn set(&self, name: &str, value: f64) {
        // SAFETY: a live component, and a value to read.
        let status = unsafe { fmi3::set_float64::<E>(self.component, &reference::<E>(name), 1, &value, 1) };
        assert_eq!(status, Status::Ok, "{}", self.error());
    }

    fn get(&self, name: &str) -> f64 {
        let mut value = f64::NAN;
        // SAFETY: a live component, and a value to write to.
        let status = unsafe { fmi3::get_float64::<E>(self.component, &reference::<E>(name), 1, &mut value, 1) };
        assert_eq!(status, Status::Ok, "{}", self.error());
        value
    }

    fn integer(&self, name: &str) -> i32 {
        let (mut value, of) = (0, reference::<E>(name));
        // SAFETY: a live component, and a value to write to.
        let status = unsafe { fmi3::get_number::<E, i32>(self.component, Function::GetInteger, &of, 1, &mut value, 1) };
        assert_eq!(status, Status::Ok, "{}", self.error());
        value
    }

    fn save(&self) -> FmuState {
        let mut state = null_mut();
        // SAFETY: a live component, and a state to write to.
        assert_eq!(unsafe { fmi3::get_fmu_state::<E>(self.component, &mut state) }, Status::Ok);
        state
    }

    fn bytes(&self) -> Vec<u8> {
        let (mut state, mut size) = (self.save(), 0);
        // SAFETY: a live component and its state, and bytes to write to.
        unsafe {
            assert_eq!(fmi3::serialized_fmu_state_size::<E>(self.component, state, &mut size), Status::Ok);
            let mut bytes = vec![0_u8; size];
            let status = fmi3::serialize_fmu_state::<E>(self.component, state, bytes.as_mut_ptr(), size);
            assert_eq!(status, Status::Ok);
            assert_eq!(fmi3::free_fmu_state::<E>(self.component, &mut state), Status::Ok);
            bytes
        }
    }

    fn error(&self) -> String {
        self.environment.messages.lock().unwrap().last().cloned().unwrap_or_default()
    }
}

/// The counters of Clocks, `result2`, `output3`.
const COUNTERS: [&str; 6] =
    ["inClock1Ticks", "inClock2Ticks", "inClock3Ticks", "totalInClockTicks", "result2", "output3"];

/// Runs the published scenario from `first` to `last` s: `inClock1` every second, `inClock2` at 0, 1, 8 and 9 s with
/// `input2` = 10, `inClock3` when it is started, in the order of their priorities.
fn scenario(run: &Scheduled<Clocks>, first: i32, last: i32, mut seen: impl FnMut(i32, [i32; 6])) {
    for second in first..=last {
        let time = f64::from(second);
        assert_eq!(run.activate("inClock1", time), Status::Ok);
        if [0, 1, 8, 9].contains(&second) {
            // SAFETY: a live component, and a value to read.
            let status = unsafe {
                let of = reference::<Clocks>("input2");
                fmi3::set_number::<Clocks, i32>(run.component, Function::SetInteger, &of, 1, &10, 1)
            };
            assert_eq!(status, Status::Ok);
            assert_eq!(run.activate("inClock2", time), Status::Ok);
        }
        if second == 4 {
            assert_eq!(run.activate("inClock3", time), Status::Ok);
        }
        seen(second, COUNTERS.map(|name| run.integer(name)));
    }
}

const PUBLISHED: [[i32; 6]; 10] = [
    [1, 1, 0, 2, 10, 0],
    [2, 2, 0, 4, 20, 0],
    [3, 2, 0, 5, 20, 0],
    [4, 2, 0, 6, 20, 0],
    [5, 2, 1, 8, 20, 1000],
    [6, 2, 1, 9, 20, 1000],
    [7, 2, 1, 10, 20, 1000],
    [8, 2, 1, 11, 20, 1000],
    [9, 3, 1, 13, 30, 1000],
    [10, 4, 1, 15, 40, 1000],
];

/// Reference: the published model. Its interval of `inClock3` stays "unchanged" after the tick at 4 s; FMI 3.0, section
/// 2.2.9, requires "not yet known" (0).
#[test]
fn the_published_model_counts_its_ticks() {
    let calls = std::sync::Arc::new(Mutex::new(Vec::new()));
    let seen = calls.clone();
    let run = Scheduled::<Clocks>::ready(move |component| {
        let (interval, qualifier) = interval::<Clocks>(component, "inClock3");
        let call = (interval, qualifier, ticks::<Clocks>(component, "outClock"));
        assert!(!ticks::<Clocks>(component, "outClock"), "reading resets");
        seen.lock().unwrap().push(call);
    });
    let check = |second: i32, found| {
        assert_eq!(found, PUBLISHED[usize::try_from(second).unwrap()], "at {second} s");
        let expected = match second {
            2 | 6 | 9 => vec![(0.0, 0, true)],
            4 => vec![(0.0, 2, false)],
            _ => vec![],
        };
        assert_eq!(std::mem::take(&mut *calls.lock().unwrap()), expected, "at {second} s");
    };
    scenario(&run, 0, 9, check);
    // SAFETY: a live component.
    assert_eq!(unsafe { fmi3::reset::<Clocks>(run.component) }, Status::Ok);
    run.initialize(0.0, Some(9.0));
    scenario(&run, 0, 3, check);
    // A saved state, and the same in bytes for another instance.
    let (state, bytes) = (run.save(), run.bytes());
    scenario(&run, 4, 9, check);
    assert_eq!(run.activate("inClock1", 10.0), Status::Error);
    assert_eq!(
        run.error(),
        "fmi3ActivateModelPartition: activationTime of the clock 'inClock1' must not be after stopTime = 9 s, got 10 s"
    );
    // SAFETY: a live component and its state.
    assert_eq!(unsafe { fmi3::set_fmu_state::<Clocks>(run.component, state) }, Status::Ok);
    assert_eq!(run.activate("inClock1", 3.0), Status::Error, "the times of the ticks are part of the state");
    scenario(&run, 4, 9, check);
    let other = Scheduled::<Clocks>::with(|component| {
        interval::<Clocks>(component, "inClock3");
        ticks::<Clocks>(component, "outClock");
    });
    let mut state = null_mut();
    // SAFETY: a live component, and bytes of this length.
    unsafe {
        let status = fmi3::deserialize_fmu_state::<Clocks>(other.component, bytes.as_ptr(), bytes.len(), &mut state);
        assert_eq!(status, Status::Ok, "{}", other.error());
        assert_eq!(fmi3::set_fmu_state::<Clocks>(other.component, state), Status::Ok);
    }
    scenario(&other, 4, 9, |second, found| assert_eq!(found, PUBLISHED[usize::try_from(second).unwrap()]));
    assert_eq!(other.bytes(), run.bytes());
    // SAFETY: a live component.
    assert_eq!(unsafe { fmi3::terminate::<Clocks>(other.component) }, Status::Ok);
    assert_eq!(other.integer("totalInClockTicks"), 15);
    assert_eq!(other.activate("inClock1", 10.0), Status::Error);
    assert_eq!(other.error(), "fmi3ActivateModelPartition called in Terminated, allowed in Clock Activation Mode");
}

/// The times of activations increase for each clock, not from clock to clock (FMI 3.0.2, section 5.2.2): the clock that
/// starts a countdown may tick at an earlier time than the countdown clock has ticked. The fuzzer found that such a state
/// was rejected.
#[test]
fn a_state_is_restored_after_a_countdown_was_started_in_the_past() {
    let run = Scheduled::<Clocks>::ready(|_| {});
    assert_eq!(run.activate("inClock3", 5.25), Status::Ok);
    assert_eq!(run.activate("inClock1", 4.0), Status::Ok);
    let (bytes, mut state) = (run.bytes(), null_mut());
    // SAFETY: a live component, and bytes of this length.
    let status =
        unsafe { fmi3::deserialize_fmu_state::<Clocks>(run.component, bytes.as_ptr(), bytes.len(), &mut state) };
    assert_eq!(status, Status::Ok, "{}", run.error());
    assert_eq!(interval::<Clocks>(run.component, "inClock3"), (0.0, 2));
}

static LOCKS: AtomicI64 = AtomicI64::new(0);
static UNLOCKS: AtomicI64 = AtomicI64::new(0);

unsafe extern "C" fn lock_preemption() {
    LOCKS.fetch_add(1, SeqCst);
}

unsafe extern "C" fn unlock_preemption() {
    UNLOCKS.fetch_add(1, SeqCst);
}

/// Each thread sets the input of its part to 1, 2, …, n before its activations at 1, 2, …, n s: every sum is n (n + 1)/2
/// after them, in all interleavings. Every tick of an output clock and every interval of the countdown clock is reported
/// once, in any thread.
#[test]
fn threads_activate_their_parts_at_the_same_time() {
    const N: i32 = 300;
    for parts in [&["first", "second"][..], &["first", "second", "third"]] {
        let reported: std::sync::Arc<[AtomicI64; 4]> = std::sync::Arc::default();
        let counts = reported.clone();
        let callback = move |component| {
            for (count, clock) in counts.iter().zip(["first_done", "second_done"]) {
                count.fetch_add(ticks::<Parts>(component, clock).into(), SeqCst);
            }
            if let (after, 2) = interval::<Parts>(component, "alarm") {
                counts[2].fetch_add(1, SeqCst);
                counts[3].fetch_add(after as i64, SeqCst);
            }
        };
        let (locks, unlocks) = (LOCKS.load(SeqCst), UNLOCKS.load(SeqCst));
        // SAFETY: strings that end with a zero, and functions of these types.
        let run = Scheduled::<Parts>::make(callback, |arguments| unsafe {
            let (lock, unlock) = (Some(lock_preemption as _), Some(unlock_preemption as _));
            fmi3::instantiate_scheduled_execution::<Parts>(arguments, Some(clock_update), lock, unlock)
        });
        run.initialize(0.0, None);
        let start = Barrier::new(parts.len());
        std::thread::scope(|scope| {
            for part in parts {
                let (run, start) = (&run, &start);
                scope.spawn(move || {
                    start.wait();
                    for k in 1..=N {
                        run.set(&format!("{part}_value"), f64::from(k));
                        assert_eq!(run.activate(part, f64::from(k)), Status::Ok, "{}", run.error());
                        let sum = f64::from(k * (k + 1) / 2);
                        assert_eq!(run.get(&format!("{part}_sum")), sum, "the outputs of a part are its own");
                    }
                });
            }
        });
        for part in parts {
            assert_eq!(run.get(&format!("{part}_sum")), f64::from(N * (N + 1) / 2));
        }
        assert_eq!(run.integer("total"), N * i32::try_from(parts.len()).unwrap());
        let n = i64::from(N);
        assert_eq!(reported.each_ref().map(|count| count.load(SeqCst)), [n, n, n, n * (n + 1) / 2]);
        let locks = LOCKS.load(SeqCst) - locks;
        assert!(locks >= n * i64::try_from(parts.len()).unwrap());
        assert_eq!(locks, UNLOCKS.load(SeqCst) - unlocks);
    }
}

/// FMI 3.0.2, section 5.2: Clock Update Mode applies to the calls in the callback only; other parts go on meanwhile.
#[test]
fn a_clock_update_locks_out_no_other_thread() {
    let (enter, leave) = (std::sync::Arc::new(Barrier::new(2)), std::sync::Arc::new(Barrier::new(2)));
    let (entered, left) = (enter.clone(), leave.clone());
    let run = Scheduled::<Parts>::ready(move |component| {
        if !ticks::<Parts>(component, "first_done") {
            return;
        }
        // SAFETY: a live component, values to read and to write to.
        let statuses = unsafe {
            let (mut value, mut state) = (0.0, null_mut());
            let sum = &reference::<Parts>("first_sum");
            let input = &reference::<Parts>("first_value");
            fmi3::free_instance::<Parts>(component);
            [
                fmi3::get_float64::<Parts>(component, sum, 1, &mut value, 1),
                fmi3::set_float64::<Parts>(component, input, 1, &0.0, 1),
                fmi3::activate_model_partition::<Parts>(component, reference::<Parts>("second"), 1.0),
                fmi3::get_fmu_state::<Parts>(component, &mut state),
                fmi3::reset::<Parts>(component),
                fmi3::terminate::<Parts>(component),
            ]
        };
        assert_eq!(statuses, [Status::Error; 6]);
        entered.wait();
        left.wait();
    });
    run.set("first_value", 3.0);
    std::thread::scope(|scope| {
        let first = scope.spawn(|| run.activate("first", 0.5));
        enter.wait();
        {
            let messages = run.environment.messages.lock().unwrap();
            assert_eq!(messages[0], "fmi3FreeInstance called in Clock Update Mode; the instance was not freed");
            assert!(messages[1..].iter().all(|text| text.contains(" called in Clock Update Mode, allowed in ")));
            assert_eq!(messages.len(), 7);
        }
        run.set("second_value", 2.0);
        assert_eq!(run.activate("second", 0.75), Status::Ok);
        assert_eq!((run.get("first_sum"), run.get("second_sum"), run.get("passed")), (3.0, 2.0, 0.75));
        leave.wait();
        assert_eq!(first.join().unwrap(), Status::Ok);
    });
    assert!(ticks::<Parts>(run.component, "second_done"), "also in Clock Activation Mode");
}

#[test]
fn wrong_activations_change_nothing() {
    let run = Scheduled::<Parts>::with(|_| ());
    assert_eq!(run.activate("first", 0.0), Status::Error);
    assert_eq!(run.error(), "fmi3ActivateModelPartition called in Instantiated, allowed in Clock Activation Mode");
    run.initialize(1.0, None);
    let before = run.bytes();
    let wrong = |clock: &str, time: f64, message: &str| {
        assert_eq!(run.activate(clock, time), Status::Error);
        assert_eq!(run.error(), format!("fmi3ActivateModelPartition: {message}"));
    };
    let of = "activationTime of the clock 'first' must";
    wrong("first", f64::NAN, &format!("{of} be finite, got NaN s"));
    wrong("first", 0.5, &format!("{of} not be before the start at 1 s, got 0.5 s"));
    wrong("first_done", 2.0, "'first_done' is an output clock, which only the model activates");
    wrong(
        "total",
        2.0,
        &format!(
            "value reference {} must be a variable of type Clock, it is 'total' of type Int32",
            reference::<Parts>("total")
        ),
    );
    assert_eq!(run.bytes(), before);
    // The importer chooses the times: neither is a multiple of the interval.
    for (time, sum) in [(1.0, 2.0), (1.25, 4.0), (4.0, 6.0)] {
        run.set("first_value", 2.0);
        assert_eq!(run.activate("first", time), Status::Ok, "{}", run.error());
        assert_eq!(run.get("first_sum"), sum);
        wrong("first", time, &format!("{of} be later than its last tick at {time} s, got {time} s"));
    }
    // Other clocks have their own times.
    assert_eq!(run.activate("second", 1.0), Status::Ok);
    // A tunable parameter sets the interval; the tick of a changing clock sets its own.
    assert_eq!(interval::<Parts>(run.component, "first"), (1.0, 2));
    assert_eq!(interval::<Parts>(run.component, "first"), (1.0, 1));
    run.set("period", 0.125);
    assert_eq!(interval::<Parts>(run.component, "first"), (0.125, 2));
    assert_eq!(interval::<Parts>(run.component, "third"), (0.5, 2));
    run.set("offset", 0.5);
    assert_eq!(run.activate("third", 1.5), Status::Ok);
    assert_eq!((interval::<Parts>(run.component, "third"), run.get("third_sum")), ((0.25, 2), 0.5));
    run.set("period", -1.0);
    let before = run.bytes();
    wrong("first", 5.0, "'period' = -1 s is the interval of the clock 'first' and must be above 0");
    assert_eq!(run.bytes(), before);
    run.set("period", 1.0);
    // A panic in a part.
    run.set("first_value", -1.0);
    assert_eq!(run.activate("first", 5.0), Status::Error);
    assert!(run.error().contains("a negative value"), "{}", run.error());
    // SAFETY: a live component.
    assert_eq!(unsafe { fmi3::reset::<Parts>(run.component) }, Status::Ok);
    run.initialize(0.0, None);
    assert_eq!(run.activate("first", 0.0), Status::Ok);
}

/// Only FMUs whose clocks all have priorities have the interface, and other interfaces do not have its function.
#[test]
fn scheduled_execution_needs_priorities() {
    let none = Scheduled::<Unordered>::with(|_| ());
    assert!(none.component.is_null());
    assert_eq!(none.error(), "fmi3InstantiateScheduledExecution: this FMU does not provide scheduled execution");
    // SAFETY: strings that end with a zero.
    let other = Scheduled::<Parts>::make(
        |_| (),
        |arguments| unsafe { fmi3::instantiate_co_simulation::<Parts>(arguments, 1, 0, null(), 0, None) },
    );
    other.initialize(0.0, None);
    assert_eq!(other.activate("first", 0.0), Status::Error);
    assert_eq!(other.error(), "fmi3ActivateModelPartition is not a function of co-simulation");
    let xml = &Parts::description().xml;
    let element = "<ScheduledExecution modelIdentifier=\"Workers\" canGetAndSetFMUState=\"true\" \
                   canSerializeFMUState=\"true\" providesPerElementDependencies=\"true\"/>";
    assert!(xml.contains(element) && xml.contains("priority=\"3\""), "{xml}");
    assert!(!Unordered::description().xml.contains("Scheduled"));
    // The packer's options: 64 requires scheduled execution, 128 asks for it if possible.
    let of = |version, options, describe: fn(c_int, c_int) -> *const c_char| {
        // SAFETY: a string that lives until the next call.
        unsafe { CStr::from_ptr(describe(version, options)) }.to_str().unwrap().to_owned()
    };
    let (ordered, unordered): (fn(_, _) -> _, fn(_, _) -> _) =
        (abi::model_description::<Parts>, abi::model_description::<Unordered>);
    assert_eq!(of(3, 1 | 128, ordered), of(3, 1 | 64, ordered));
    assert!(of(3, 64, ordered).contains(element) && !of(3, 64, ordered).contains("<CoSimulation"));
    assert_eq!(of(3, 1 | 128, unordered), of(3, 1, unordered));
    assert_eq!(
        of(3, 1 | 64, unordered),
        "!Watch: scheduled execution needs the `priority` of every clock: add it to the clock 'control'"
    );
    // A priority means that the interface is wanted, so it is not left out without a word.
    let mixed = abi::model_description::<MixedParts>;
    assert_eq!(
        of(3, 1 | 128, mixed),
        "!Mixed: scheduled execution needs the `priority` of every clock: add it to the clock 'second'"
    );
    let error = Description::try_of::<<crate::models::Sampler as Export>::Model>(
        Format {
            interfaces: fmu::testing::calls::Interfaces {
                scheduled_execution: true,
                ..fmu::testing::calls::Interfaces::NONE
            },
            ..Format::FMI3
        },
        std::path::Path::new(""),
    );
    assert!(
        error
            .unwrap_err()
            .ends_with(": a model without clocks has no scheduled execution; pack it with the interface cs")
    );
}
