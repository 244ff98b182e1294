//! Intermediate updates, early return and output derivatives of FMI 3.0. References: closed forms; the times of the
//! Reference FMUs (Dahlquist in a step of 0.5 s); steps without a callback, bit for bit; FMI 3.0.2, section 4.2.1.
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use std::cell::Cell;
use std::ffi::c_void;
use std::ptr::{null, null_mut};

use fmu::prelude::*;
use fmu::testing::abi::fmi3::{self, Boolean};
use fmu::testing::abi::{Component, Export, Status};
use fmu::testing::calls::{Function, Mode, Protocol, Version};
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::Instance as SafeInstance;

use crate::allocations::allocations;
use crate::arrays::Arrays;
use crate::events::{ControlledSteps, EqualSteps, ImplicitSteps, Pulses, ball};
use crate::fmi3::Instance;
use crate::models::{Sampler, exported, reals, reference};

#[derive(Parameters)]
struct Dahlquist {
    #[var(MAX_STEP, start = 0.1)]
    max_step: f64,
}

#[derive(State)]
struct Decaying<T> {
    /// Solution (1)
    #[var(start = 1.0)]
    x: T,
}

/// x' = -x
#[fmu::model(stop_time = 10.0, step_size = 0.5)]
impl Continuous for Dahlquist {
    type State<T: Scalar> = Decaying<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Decaying<T> {
        Decaying { x: -at.state.x }
    }
}

#[derive(Inputs)]
struct U<T> {
    /// Input that importers may set during a step (1)
    #[var(intermediate)]
    u: T,
    /// Added to the output (1)
    offset: T,
}

#[derive(State)]
struct X<T> {
    /// State (1)
    #[var(start = 1.0)]
    x: T,
    /// Integral of the state (s)
    #[var(local)]
    integral: T,
}

#[derive(Outputs)]
struct Y<T> {
    /// x^2 + u t + offset (1)
    y: T,
    /// A number that is not continuous
    number: i32,
}

macro_rules! lag {
    ($(#[doc = $doc:literal] $name:ident, $solver:expr, { $($fields:tt)* };)*) => {$(
        #[derive(Parameters)]
        struct $name { $($fields)* }

        #[doc = $doc]
        #[fmu::model(stop_time = 10.0, step_size = 0.5, solver = $solver)]
        impl Continuous for $name {
            type State<T: Scalar> = X<T>;
            type Inputs<T: Scalar> = U<T>;
            type Outputs<T: Scalar> = Y<T>;
            fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
                X { x: at.inputs.u - at.state.x, integral: at.state.x }
            }
            fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
                let (x, u) = (at.state.x, at.inputs.u);
                assert!(u.value() != PANIC, "on demand");
                Y { y: x * x + u * at.time + at.inputs.offset, number: 3 }
            }
        }
    )*};
}

/// The input with which the outputs panic.
const PANIC: f64 = 1234.0;

lag! {
    /// x' = u - x by equal steps
    Lag, RungeKutta, { #[var(MAX_STEP, start = 0.1)] max_step: f64 };
    /// x' = u - x with error control
    ControlledLag, DormandPrince { tolerance: 1e-9 }, {};
    /// x' = u - x by implicit steps
    ImplicitLag, Rosenbrock { tolerance: 1e-9 }, {};
}

#[derive(Parameters)]
struct Comparator {
    #[var(MAX_STEP, start = 0.1)]
    max_step: f64,
}

#[derive(Inputs)]
struct Signal<T> {
    /// Compared with 0.5 (1)
    #[var(intermediate)]
    u: T,
}

#[derive(Outputs)]
struct LastOutput<T> {
    /// Time of the last event (s)
    last: T,
}

#[derive(DiscreteState, Clone, Default)]
struct Last {
    time: f64,
}

/// Has an event when its input crosses 0.5
#[fmu::model(stop_time = 10.0, step_size = 0.5)]
impl Continuous for Comparator {
    type State<T: Scalar> = Decaying<T>;
    type Inputs<T: Scalar> = Signal<T>;
    type Outputs<T: Scalar> = LastOutput<T>;
    type DiscreteState = Last;
    type Crossings = [f64; 1];
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Decaying<T> {
        Decaying { x: -at.state.x }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> LastOutput<T> {
        LastOutput { last: T::from(at.discrete.time) }
    }
    fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
        [at.inputs.u - 0.5]
    }
    fn on_event(&self, event: Event<Self>) {
        event.discrete.time = event.time;
    }
}

exported! {
    Dahlquist3: Dahlquist, Format::FMI3;
    Lag3: Lag, Format::FMI3;
    ControlledLag3: ControlledLag, Format::FMI3;
    ImplicitLag3: ImplicitLag, Format::FMI3;
    Ball: EqualSteps, Format::FMI3;
    ControlledBall: ControlledSteps, Format::FMI3;
    ImplicitBall: ImplicitSteps, Format::FMI3;
    Train: Pulses, Format::FMI3;
    Comparator3: Comparator, Format::FMI3;
    Filter: Sampler, Format::FMI3;
    NativeArrays: Arrays, Format { arrays: true, ..Format::FMI3 };
}

/// Arguments of the callback, except those that are always true.
struct Update {
    time: f64,
    sets: bool,
    can_return_early: bool,
}

thread_local! {
    /// The importer's part of an update. Returns the time of a requested early return.
    static IMPORTER: Cell<Option<*mut Importer>> = const { Cell::new(None) };
}

type Importer = dyn FnMut(Update) -> Option<f64>;

unsafe extern "C" fn update(
    _: *mut c_void,
    time: f64,
    sets: Boolean,
    gets: Boolean,
    is_finished: Boolean,
    can_return_early: Boolean,
    requested: *mut Boolean,
    return_time: *mut f64,
) {
    assert_eq!((gets, is_finished), (1, 1));
    let importer = IMPORTER.get().expect("a step is made with `step`");
    // SAFETY: the function lives as long as the step; the pointers are the FMU's.
    unsafe {
        assert_eq!(*requested, 0);
        if let Some(time) = (*importer)(Update { time, sets: sets != 0, can_return_early: can_return_early != 0 }) {
            (*requested, *return_time) = (1, time);
        }
    }
}

/// A step in which `importer` is called at each update.
fn step<E: Export>(
    instance: &Instance<E>,
    time: f64,
    length: f64,
    mut importer: impl FnMut(Update) -> Option<f64>,
) -> (Status, bool, bool, f64) {
    type Shorter<'a> = dyn FnMut(Update) -> Option<f64> + 'a;
    let importer: *mut Shorter<'_> = &mut importer;
    // SAFETY: only the lifetime changes; the pointer is removed before the function ends.
    IMPORTER.set(Some(unsafe { std::mem::transmute::<*mut Shorter<'_>, *mut Importer>(importer) }));
    let result = instance.step(time, length);
    IMPORTER.set(None);
    result
}

/// An instance with a callback that has not begun the initialization.
fn instantiated<E: Export>(events: bool, early: bool, required: &[u32]) -> Instance<E> {
    // SAFETY: strings that end with a zero, an array of this length, and a function of the right type.
    Instance::new(|arguments| unsafe {
        let (events, early) = (events.into(), early.into());
        fmi3::instantiate_co_simulation::<E>(arguments, events, early, required.as_ptr(), required.len(), Some(update))
    })
}

/// An initialized instance with a callback, without Event Mode.
fn ready<E: Export>(early: bool, required: &[u32]) -> Instance<E> {
    let instance = instantiated::<E>(false, early, required);
    assert!(!instance.component.is_null(), "{}", instance.error());
    instance.initialized()
}

fn get<E: Export>(instance: &Instance<E>, reference: u32) -> f64 {
    let mut value = [f64::NAN];
    assert_eq!(instance.get(&[reference], &mut value), Status::Ok, "{:?}", instance.messages);
    value[0]
}

fn output_derivatives<E: Export>(component: Component, references: &[u32], values: &mut [f64], order: i32) -> Status {
    let orders = vec![order; references.len()];
    let (count, length) = (references.len(), values.len());
    // SAFETY: arrays of these lengths.
    unsafe {
        fmi3::get_output_derivatives::<E>(
            component,
            references.as_ptr(),
            count,
            orders.as_ptr(),
            values.as_mut_ptr(),
            length,
        )
    }
}

/// The error of a Runge-Kutta step of 0.1 s is 0.1^5/120 = 8.3e-8 of the solution.
#[test]
fn dahlquist_has_the_times_of_the_reference_fmus() {
    let x = reference::<Dahlquist>("x");
    let instance = ready::<Dahlquist3>(false, &[x]);
    let mut times = Vec::new();
    let result = step(&instance, 0.0, 0.5, |update| {
        assert_eq!((update.sets, update.can_return_early), (false, false));
        let (mut value, mut slope) = ([0.0], [0.0]);
        assert_eq!(instance.get(&[x], &mut value), Status::Ok);
        assert_eq!(output_derivatives::<Dahlquist3>(instance.component, &[x], &mut slope, 1), Status::Ok);
        assert!((value[0] - (-update.time).exp()).abs() < 5e-7, "{} at {} s", value[0], update.time);
        assert_eq!(slope[0], -value[0]);
        times.push(update.time);
        None
    });
    assert_eq!(result, (Status::Ok, false, false, 0.5));
    assert_eq!(times.len(), 5);
    assert!(times.iter().zip([0.1, 0.2, 0.3, 0.4, 0.5]).all(|(time, expected)| (time - expected).abs() < 1e-15));
    assert_eq!(times[4], 0.5);
}

/// Steps with a callback that does nothing, compared with steps without.
fn has_the_bits_without_a_callback<E: Export>() {
    let references = reals::<E>();
    let (with, without) = (ready::<E>(true, &[]), Instance::<E>::co_simulation(false).initialized());
    let bits = |instance: &Instance<E>| {
        let mut values = vec![0.0; references.len()];
        assert_eq!(instance.get(&references, &mut values), Status::Ok);
        values.iter().map(|value| value.to_bits()).collect::<Vec<_>>()
    };
    let mut updates = 0;
    for k in 0..20 {
        let (time, length) = (f64::from(k) * 0.13, 0.13);
        let count = |_: Update| {
            updates += 1;
            None
        };
        assert_eq!(step(&with, time, length, count), without.step(time, length));
        assert_eq!(bits(&with), bits(&without), "at {} s", time + length);
    }
    // At least two steps of at most 0.1 s each.
    assert!(updates >= 40, "{updates}");
}

#[test]
fn a_callback_that_does_nothing_changes_no_bit() {
    has_the_bits_without_a_callback::<Lag3>();
    has_the_bits_without_a_callback::<Ball>();
    has_the_bits_without_a_callback::<ControlledBall>();
    has_the_bits_without_a_callback::<ImplicitBall>();
    has_the_bits_without_a_callback::<Train>();
    has_the_bits_without_a_callback::<ControlledLag3>();
}

/// The input has another value from each update on. Reference: the closed form for a piecewise constant input. The
/// solvers keep a tolerance of 1e-9 per step; the error of equal steps is as for Dahlquist, with inputs up to 5.
fn inputs_apply_from_an_update_on<E: Export>(tolerance: f64) {
    let [u, x, y] = ["u", "x", "y"].map(reference::<E>);
    let instance = ready::<E>(false, &[u, x, y]);
    let (mut last, mut expected, mut input) = (0.0, 1.0, 0.0);
    let mut updates = 0;
    for k in 0..4 {
        let result = step(&instance, f64::from(k) * 0.5, 0.5, |update| {
            assert!(update.sets);
            expected = input + (expected - input) * f64::exp(-(update.time - last));
            let (mut values, mut slope) = ([0.0; 2], [0.0]);
            assert_eq!(instance.get(&[x, y], &mut values), Status::Ok);
            assert!((values[0] - expected).abs() < tolerance, "{} {expected} at {} s", values[0], update.time);
            assert_eq!(values[1], values[0] * values[0] + input * update.time);
            // y' = 2 x x' + u, because the inputs keep their values.
            assert_eq!(output_derivatives::<E>(instance.component, &[y], &mut slope, 1), Status::Ok);
            let by_hand = 2.0 * values[0] * (input - values[0]) + input;
            assert!((slope[0] - by_hand).abs() < 1e-13 * (1.0 + by_hand.abs()), "{} {by_hand}", slope[0]);
            last = update.time;
            updates += 1;
            input = f64::from(updates % 6);
            assert_eq!(instance.set(&[u], &[input]), Status::Ok);
            None
        });
        assert_eq!(result, (Status::Ok, false, false, f64::from(k + 1) * 0.5));
        // The value from the last update stays for the next step.
        assert_eq!(get(&instance, u), input);
    }
    assert!(updates >= 12, "{updates}");
}

#[test]
fn inputs_apply_from_the_update_on_in_which_they_are_set() {
    inputs_apply_from_an_update_on::<Lag3>(1e-5);
    inputs_apply_from_an_update_on::<ControlledLag3>(1e-7);
    inputs_apply_from_an_update_on::<ImplicitLag3>(1e-7);
}

#[test]
fn a_step_returns_at_the_requested_time() {
    let x = reference::<Dahlquist>("x");
    // Times of the updates of a step from 0 to 0.5 s, in which the importer requests `then` at the time `when`.
    let run = |when: f64, then: f64| {
        let instance = ready::<Dahlquist3>(true, &[x]);
        let mut times = Vec::new();
        let (status, event, early, last) = step(&instance, 0.0, 0.5, |update| {
            assert!(update.can_return_early);
            times.push((update.time * 1e6).round() / 1e6);
            (update.time > when - 1e-9).then_some(then)
        });
        assert_eq!((status, event), (Status::Ok, false));
        assert!((get(&instance, x) - (-last).exp()).abs() < 5e-7);
        // The next step starts there.
        assert_eq!(step(&instance, last, 0.1, |_| None), (Status::Ok, false, false, last + 0.1));
        (times, early, last)
    };
    assert_eq!(run(0.2, 0.2), (vec![0.1, 0.2], true, 0.2));
    // A time that has passed means the present time.
    assert_eq!(run(0.2, 0.0), (vec![0.1, 0.2], true, 0.2));
    assert_eq!(run(0.1, 0.25), (vec![0.1, 0.2, 0.25], true, 0.25));
    // A later request does not move the end back.
    assert_eq!(run(0.3, 0.45), (vec![0.1, 0.2, 0.3, 0.4, 0.45], true, 0.45));
    // The end of the step is not an early return.
    assert_eq!(run(0.1, 0.5), (vec![0.1, 0.2, 0.3, 0.4, 0.5], false, 0.5));
    assert_eq!(run(0.5, 0.5), (vec![0.1, 0.2, 0.3, 0.4, 0.5], false, 0.5));
}

/// Reference: the closed form of the ball, whose first bounce is at sqrt(2 h/g).
#[test]
fn an_importer_returns_early_at_the_bounce_that_it_sees() {
    let [height, velocity] = ["height", "velocity"].map(reference::<EqualSteps>);
    let first = (2.0 / 9.81_f64).sqrt();
    let instance = ready::<Ball>(true, &[height, velocity]);
    let (status, event, early, last) = step(&instance, 0.0, 1.0, |update| {
        let mut values = [0.0; 2];
        assert_eq!(instance.get(&[height, velocity], &mut values), Status::Ok);
        let (_, _, expected, _) = ball(update.time);
        assert!((values[0] - expected).abs() < 1e-9);
        (values[1] > 0.0).then_some(update.time)
    });
    assert_eq!((status, event, early), (Status::Ok, false, true));
    assert!((last - first).abs() < 1e-9, "{last}");
    assert!((get(&instance, velocity) - 0.7 * 9.81 * first).abs() < 1e-8);
}

#[test]
fn a_step_that_stops_at_an_event_has_its_last_update_there() {
    let instance = instantiated::<Ball>(true, true, &[]).initialized();
    // SAFETY: a live component.
    assert_eq!(unsafe { fmi3::enter_step_mode::<Ball>(instance.component) }, Status::Ok);
    let mut times = Vec::new();
    let (status, event, early, last) = step(&instance, 0.0, 1.0, |update| {
        times.push(update.time);
        None
    });
    assert_eq!((status, event, early), (Status::Ok, true, true));
    assert_eq!(times.last(), Some(&last));
    assert!((last - ball(1.0).1).abs() < 1e-9, "{last}");
    assert!(times.is_sorted() && times.len() == 46, "{times:?}");
}

/// In steps of 0.2 s, the pulses have time events at 0.1 s, 0.2 s, ….
#[test]
fn an_update_happens_at_a_time_event() {
    let instance = ready::<Train>(false, &[]);
    let mut times = Vec::new();
    let note = |update: Update| {
        times.push(update.time);
        None
    };
    assert_eq!(step(&instance, 0.0, 0.2, note), (Status::Ok, false, false, 0.2));
    assert!(times.contains(&0.1) && times.last() == Some(&0.2), "{times:?}");
    assert!(times.is_sorted_by(|a, b| a < b), "{times:?}");
}

/// An early return between two time events leaves the next one due.
#[test]
fn a_time_event_after_an_early_return_happens_once() {
    let instance = instantiated::<Train>(true, true, &[]).initialized();
    assert_eq!(instance.update(), (false, Some(0.1)));
    // SAFETY: a live component.
    let to_step_mode = || assert_eq!(unsafe { fmi3::enter_step_mode::<Train>(instance.component) }, Status::Ok);
    to_step_mode();
    assert_eq!(step(&instance, 0.0, 0.3, |_| Some(0.05)), (Status::Ok, false, true, 0.05));
    for (start, event) in [(0.05, 0.1), (0.1, 0.2)] {
        assert_eq!(step(&instance, start, 0.3, |_| None), (Status::Ok, true, true, event));
        // SAFETY: a live component.
        assert_eq!(unsafe { fmi3::enter_event_mode::<Train>(instance.component) }, Status::Ok);
        let (_, next) = instance.update();
        assert!((next.unwrap() - event - 0.1).abs() < 1e-15, "{next:?}");
        to_step_mode();
    }
}

/// An input that crosses a threshold in an update causes an event at the time of the update.
#[test]
fn an_input_that_is_set_in_an_update_can_cause_an_event() {
    let [u, last] = ["u", "last"].map(reference::<Comparator>);
    let instance = ready::<Comparator3>(false, &[u]);
    let mut updates = Vec::new();
    let result = step(&instance, 0.0, 0.5, |update| {
        updates.push(update.time);
        assert_eq!(instance.set(&[u], &[f64::from(u8::from(update.time > 0.15))]), Status::Ok);
        None
    });
    assert_eq!((result.0, updates.len()), (Status::Ok, 5));
    assert_eq!(get(&instance, last), updates[1]);
}

#[test]
fn a_step_that_fails_after_an_update_restores_everything() {
    let [u, x, integral] = ["u", "x", "integral"].map(reference::<Lag>);
    let instance = ready::<Lag3>(true, &[u, x]);
    assert_eq!(step(&instance, 0.0, 0.5, |_| None).0, Status::Ok);
    assert_eq!(instance.set(&[u], &[2.0]), Status::Ok);
    let values = |instance: &Instance<Lag3>| [u, x, integral].map(|reference| get(instance, reference));
    let before = values(&instance);
    // The slopes of a Runge-Kutta step overflow.
    let result = step(&instance, 0.5, 0.5, |update| {
        let too_large = if update.time > 0.65 { f64::MAX } else { 1.0 };
        assert_eq!(instance.set(&[u], &[too_large]), Status::Ok);
        None
    });
    assert_eq!(result, (Status::Error, false, false, 0.5));
    let error = instance.error();
    assert!(error.starts_with("fmi3DoStep: 'x' became "), "{error}");
    assert!(error.ends_with("; the state at 0.5 s was restored and the instance cannot continue"), "{error}");
    assert_eq!(values(&instance), before);
    // Invalid requests fail in the same way.
    for (early, time, message) in [
        (true, f64::NAN, "earlyReturnTime must be a number, got NaN"),
        (false, 0.1, "earlyReturnRequested must be false if canReturnEarly is false"),
    ] {
        let instance = ready::<Lag3>(early, &[]);
        assert_eq!(step(&instance, 0.0, 0.5, |_| Some(time)), (Status::Error, false, false, 0.0));
        let rest = "the state at 0 s was restored and the instance cannot continue";
        assert_eq!(instance.error(), format!("fmi3DoStep: {message}; {rest}"));
        assert_eq!(get(&instance, x), 1.0);
        assert_eq!(instance.step(0.0, 0.5).0, Status::Error);
    }
}

/// The discrete state is that before the step, too.
#[test]
fn a_step_that_fails_after_an_event_undoes_it() {
    let [height, velocity, last] = ["height", "velocity", "last_bounce"].map(reference::<EqualSteps>);
    let instance = ready::<Ball>(true, &[velocity]);
    assert_eq!(step(&instance, 0.0, 0.4, |_| None).0, Status::Ok);
    let values = |instance: &Instance<Ball>| [height, velocity, last].map(|reference| get(instance, reference));
    let before = values(&instance);
    let result = step(&instance, 0.4, 0.4, |_| {
        let mut value = [0.0];
        assert_eq!(instance.get(&[velocity], &mut value), Status::Ok);
        (value[0] > 0.0).then_some(f64::NAN)
    });
    assert_eq!(result, (Status::Error, false, false, 0.4));
    assert_eq!(values(&instance), before);
}

#[test]
fn an_update_reads_first_and_uses_required_variables_only() {
    let [u, offset, x, y, number] = ["u", "offset", "x", "y", "number"].map(reference::<Lag>);
    let instance = ready::<Lag3>(false, &[y, u]);
    let rejected = |status: Status| {
        assert_eq!(status, Status::Error);
        instance.error()
    };
    let must = "must be one of requiredIntermediateVariables during an intermediate update";
    let result = step(&instance, 0.0, 0.1, |_| {
        let (mut value, component) = ([0.0], instance.component);
        assert_eq!(
            rejected(instance.get(&[y, x], &mut [0.0; 2])),
            format!("fmi3GetFloat64: value reference {x} ('x') {must}")
        );
        assert_eq!(
            rejected(instance.set(&[offset], &[1.0])),
            format!("fmi3SetFloat64: value reference {offset} ('offset') {must}")
        );
        assert_eq!(
            rejected(output_derivatives::<Lag3>(component, &[x], &mut value, 1)),
            format!("fmi3GetOutputDerivatives: value reference {x} ('x') {must}")
        );
        // SAFETY: arrays of these lengths.
        let status = unsafe { fmi3::get_number::<Lag3, i32>(component, Function::GetInteger, &number, 1, &mut 0, 1) };
        assert_eq!(rejected(status), format!("fmi3GetInt32: value reference {number} ('number') {must}"));
        assert_eq!(
            rejected(instance.set(&[y], &[1.0])),
            "fmi3SetFloat64: 'y' is an output, never settable; the instance is in Intermediate Update Mode"
        );
        None
    });
    assert_eq!(result.0, Status::Ok);
    let result = step(&instance, 0.1, 0.2, |_| {
        assert_eq!(instance.get(&[y, u], &mut [0.0; 2]), Status::Ok);
        assert_eq!(instance.set(&[u], &[1.0]), Status::Ok);
        let after = "called after an input was set in this intermediate update";
        assert_eq!(rejected(instance.get(&[y], &mut [0.0])), format!("fmi3GetFloat64: {after}"));
        assert_eq!(
            rejected(output_derivatives::<Lag3>(instance.component, &[y], &mut [0.0], 1)),
            format!("fmi3GetOutputDerivatives: {after}")
        );
        assert_eq!(instance.set(&[u], &[2.0]), Status::Ok);
        None
    });
    assert_eq!(result, (Status::Ok, false, false, 0.1 + 0.2));
    assert_eq!(get(&instance, u), 2.0);
}

#[test]
fn required_variables_must_have_the_attribute() {
    let rejected = |instance: Instance<Lag3>| {
        assert!(instance.component.is_null());
        instance.error()
    };
    for (reference, what) in [
        (reference::<Lag>("offset"), "'offset'".to_owned()),
        (reference::<Lag>("number"), "'number'".to_owned()),
        (reference::<Lag>("max_step"), "'max_step'".to_owned()),
        (reference::<Lag>("der(x)"), "'der(x)'".to_owned()),
        (9999, "value reference 9999".to_owned()),
    ] {
        assert_eq!(
            rejected(instantiated::<Lag3>(false, false, &[crate::models::reference::<Lag>("u"), reference])),
            format!(
                "fmi3InstantiateCoSimulation: requiredIntermediateVariables must list variables with \
                 intermediateUpdate = true, {what} is not one of them"
            )
        );
    }
    let output = reference::<Sampler>("filter_output");
    let none = instantiated::<Filter>(false, false, &[output]);
    assert!(none.component.is_null() && none.error().contains("'filter_output'"));
    // SAFETY: a null pointer is rejected.
    let none = Instance::<Lag3>::new(|arguments| unsafe {
        fmi3::instantiate_co_simulation::<Lag3>(arguments, 0, 0, null(), 2, Some(update))
    });
    let error = "requiredIntermediateVariables must be an array of length nRequiredIntermediateVariables";
    assert_eq!(rejected(none), format!("fmi3InstantiateCoSimulation: {error}"));
}

/// Without a callback, or in a model that is not continuous-time, there are no updates.
#[test]
fn a_step_may_have_no_updates() {
    let x = reference::<Lag>("x");
    // SAFETY: an array of one reference.
    let instance = Instance::<Lag3>::new(|arguments| unsafe {
        fmi3::instantiate_co_simulation::<Lag3>(arguments, 0, 1, &x, 1, None)
    });
    let instance = instance.initialized();
    assert_eq!(instance.step(0.0, 0.5), (Status::Ok, false, false, 0.5));
    let filter = ready::<Filter>(true, &[]);
    assert_eq!(step(&filter, 0.0, 0.5, |_| unreachable!()), (Status::Ok, false, false, 0.5));
}

#[test]
fn a_panic_in_an_update_breaks_the_instance_until_a_reset() {
    let [u, y] = ["u", "y"].map(reference::<Lag>);
    let instance = ready::<Lag3>(false, &[u, y]);
    let mut updates = 0;
    let result = step(&instance, 0.0, 0.5, |_| {
        updates += 1;
        let mut value = [7.0];
        let expected = if updates == 1 { Status::Ok } else { Status::Error };
        assert_eq!(instance.get(&[y], &mut value), expected);
        if updates == 2 {
            let error = "fmi3GetFloat64: internal error: on demand; the instance can only be reset or freed";
            assert_eq!(instance.error(), error);
            // The step still uses the instance.
            // SAFETY: a live component.
            assert_eq!(unsafe { fmi3::reset::<Lag3>(instance.component) }, Status::Error);
            let error = "fmi3Reset: must not be called in an intermediate update; first return from the callback";
            assert_eq!(instance.error(), error);
            // SAFETY: a live component.
            unsafe { fmi3::free_instance::<Lag3>(instance.component) };
            let error = "fmi3FreeInstance called in Intermediate Update Mode; the instance was not freed";
            assert_eq!(instance.error(), error);
            return None;
        }
        assert_eq!(instance.set(&[u], &[PANIC]), Status::Ok);
        None
    });
    assert_eq!((result.0, updates), (Status::Error, 2));
    assert_eq!(instance.error(), "fmi3DoStep called in Broken, allowed in Step Mode");
    // SAFETY: a live component.
    assert_eq!(unsafe { fmi3::reset::<Lag3>(instance.component) }, Status::Ok);
    let instance = instance.initialized();
    let mut updates = 0;
    let count = |_: Update| {
        updates += 1;
        None
    };
    assert_eq!(step(&instance, 0.0, 0.5, count), (Status::Ok, false, false, 0.5));
    assert_eq!(updates, 5, "the callback outlives the reset");
}

/// Every function of co-simulation, called in the callback. Reference: the table of calls, and for the functions that
/// it allows, FMI 3.0.2, section 4.2.1, Intermediate Update Mode.
#[test]
fn an_update_allows_only_the_functions_of_its_mode() {
    let allowed = |function: Function| function.allowed(Protocol::CS3, Mode::IntermediateUpdate);
    let by_type = |name: &str, start: &str| name.strip_prefix(start).is_some_and(|rest| !rest.contains("FMUState"));
    for &function in Function::ALL.iter().filter(|function| allowed(**function)) {
        let name = function.name(Version::Fmi3);
        assert!(by_type(name, "fmi3Get") || by_type(name, "fmi3Set"), "{name}");
        assert!(!["Clock", "Interval", "Shift", "Mode", "Debug"].iter().any(|word| name.contains(word)), "{name}");
    }
    let instance = ready::<Ball>(false, &[]);
    let component = instance.component;
    let (mut saved, mut size) = (null_mut(), 0);
    // SAFETY: live components, arrays of these lengths, and values to write to.
    unsafe { assert_eq!(fmi3::get_fmu_state::<Ball>(component, &mut saved), Status::Ok) };
    let height = reference::<EqualSteps>("height");
    let mut calls = Vec::new();
    // SAFETY: as above.
    let mut all = || unsafe {
        let (mut state, mut flags, mut number, mut real) = (null_mut(), [0_u8; 5], 0_usize, 0.0_f64);
        let [a, b, c, d, e] = &mut flags;
        let (mut elements, mut on, mut elements_of, mut kind) = (0, 0, 0, 0);
        let not_provided = |function| fmi3::not_provided::<Ball>(component, function);
        let none = |function| fmi3::no_variables::<Ball>(component, function, null(), 0);
        let derivative = |function| {
            let (no, none) = (null(), null_mut());
            fmi3::get_derivative::<Ball>(component, function, no, 0, no, 0, null(), 0, none, 0)
        };
        macro_rules! numbers {
            ($($get:ident $set:ident $type:ty;)*) => {
                let getters = [$((
                    Function::$get,
                    fmi3::get_number::<Ball, $type>(component, Function::$get, null(), 0, null_mut(), 0),
                )),*];
                calls.extend(getters);
                calls.extend([$((
                    Function::$set,
                    fmi3::set_number::<Ball, $type>(component, Function::$set, null(), 0, null(), 0),
                )),*]);
            };
        }
        calls.extend([
            (Function::SetDebugLogging, fmi3::set_debug_logging::<Ball>(component, 0_u8, 0, null())),
            (
                Function::EnterInitializationMode,
                fmi3::enter_initialization_mode::<Ball>(component, 0, 0.0, 0.0, 0, 0.0),
            ),
            (Function::ExitInitializationMode, fmi3::exit_initialization_mode::<Ball>(component)),
            (Function::Terminate, fmi3::terminate::<Ball>(component)),
            (Function::Reset, fmi3::reset::<Ball>(component)),
            (Function::GetReal, fmi3::get_float64::<Ball>(component, null(), 0, null_mut(), 0)),
            (Function::GetBoolean, fmi3::get_boolean::<Ball>(component, null(), 0, null_mut(), 0)),
            (Function::GetString, fmi3::get_string::<Ball>(component, null(), 0, null_mut(), 0)),
            (Function::GetBinary, fmi3::get_binary::<Ball>(component, null(), 0, null_mut(), null_mut(), 0)),
            (Function::GetFMUstate, fmi3::get_fmu_state::<Ball>(component, &mut state)),
            (Function::SetFMUstate, fmi3::set_fmu_state::<Ball>(component, saved)),
            (Function::FreeFMUstate, fmi3::free_fmu_state::<Ball>(component, &mut { saved })),
            (Function::SerializedFMUstateSize, fmi3::serialized_fmu_state_size::<Ball>(component, saved, &mut size)),
            (Function::SerializeFMUstate, fmi3::serialize_fmu_state::<Ball>(component, saved, null_mut::<u8>(), 0)),
            (
                Function::DeSerializeFMUstate,
                fmi3::deserialize_fmu_state::<Ball>(component, null::<u8>(), 0, &mut state),
            ),
            (Function::GetDirectionalDerivative, derivative(Function::GetDirectionalDerivative)),
            (Function::GetAdjointDerivative, derivative(Function::GetAdjointDerivative)),
            (Function::EnterEventMode, fmi3::enter_event_mode::<Ball>(component)),
            (Function::NewDiscreteStates, fmi3::update_discrete_states::<Ball>(component, a, b, c, d, e, &mut real)),
            (Function::EvaluateDiscreteStates, fmi3::evaluate_discrete_states::<Ball>(component)),
            (Function::EnterContinuousTimeMode, fmi3::enter_continuous_time_mode::<Ball>(component)),
            (Function::CompletedIntegratorStep, fmi3::completed_integrator_step::<Ball>(component, 1_u8, a, b)),
            (Function::SetTime, fmi3::set_time::<Ball>(component, 0.0)),
            (Function::SetContinuousStates, fmi3::set_continuous_states::<Ball>(component, null(), 0)),
            (Function::GetDerivatives, fmi3::get_derivatives::<Ball>(component, null_mut(), 0)),
            (Function::GetEventIndicators, fmi3::get_event_indicators::<Ball>(component, null_mut(), 0)),
            (Function::GetContinuousStates, fmi3::get_continuous_states::<Ball>(component, null_mut(), 0)),
            (
                Function::GetNominalsOfContinuousStates,
                fmi3::get_nominals_of_continuous_states::<Ball>(component, null_mut(), 0),
            ),
            (
                Function::GetNumberOfEventIndicators,
                fmi3::get_number_of_event_indicators::<Ball>(component, &mut number),
            ),
            (
                Function::GetNumberOfContinuousStates,
                fmi3::get_number_of_continuous_states::<Ball>(component, &mut number),
            ),
            (Function::GetRealOutputDerivatives, output_derivatives::<Ball>(component, &[], &mut [], 1)),
            (
                Function::GetNumberOfVariableDependencies,
                fmi3::get_number_of_variable_dependencies::<Ball>(component, height, &mut number),
            ),
            (
                // A state depends on itself only.
                Function::GetVariableDependencies,
                fmi3::get_variable_dependencies::<Ball>(
                    component,
                    height,
                    &mut elements,
                    &mut on,
                    &mut elements_of,
                    &mut kind,
                    1,
                ),
            ),
            (Function::EnterStepMode, fmi3::enter_step_mode::<Ball>(component)),
            (Function::DoStep, fmi3::do_step::<Ball>(component, 0.0, 0.1, 1, a, b, c, &mut real)),
        ]);
        calls.extend(
            [Function::EnterConfigurationMode, Function::ExitConfigurationMode, Function::ActivateModelPartition]
                .map(|function| (function, not_provided(function))),
        );
        calls.extend(
            [
                Function::GetClock,
                Function::SetClock,
                Function::GetIntervalDecimal,
                Function::GetIntervalFraction,
                Function::GetShiftDecimal,
                Function::GetShiftFraction,
                Function::SetIntervalDecimal,
                Function::SetIntervalFraction,
                Function::SetShiftDecimal,
                Function::SetShiftFraction,
            ]
            .map(|function| (function, none(function))),
        );
        numbers! {
            GetFloat32 SetFloat32 f32;
            GetInt8 SetInt8 i8;
            GetUInt8 SetUInt8 u8;
            GetInt16 SetInt16 i16;
            GetUInt16 SetUInt16 u16;
            GetInteger SetInteger i32;
            GetUInt32 SetUInt32 u32;
            GetInt64 SetInt64 i64;
            GetUInt64 SetUInt64 u64;
        }
        // Setting comes last, because reading is not allowed after it.
        let setters = [
            (Function::SetReal, fmi3::set_float64::<Ball>(component, null(), 0, null(), 0)),
            (Function::SetBoolean, fmi3::set_boolean::<Ball>(component, null(), 0, null(), 0)),
            (Function::SetString, fmi3::set_string::<Ball>(component, null(), 0, null(), 0)),
            (Function::SetBinary, fmi3::set_binary::<Ball>(component, null(), 0, null(), null(), 0)),
        ];
        calls.extend(setters);
        // Has no result; the component stays valid.
        fmi3::free_instance::<Ball>(component);
    };
    let mut is_first = true;
    let result = step(&instance, 0.0, 0.25, |_| {
        if std::mem::take(&mut is_first) {
            all();
        }
        None
    });
    assert_eq!(result, (Status::Ok, false, false, 0.25));
    let functions = Function::ALL.iter().filter(|function| !function.name(Version::Fmi3).is_empty());
    assert_eq!(calls.len(), functions.count(), "every function is called");
    for (function, status) in calls {
        let expected = if allowed(function) { Status::Ok } else { Status::Error };
        assert_eq!(status, expected, "{}", function.name(Version::Fmi3));
    }
    let error = "fmi3FreeInstance called in Intermediate Update Mode; the instance was not freed";
    assert_eq!(instance.error(), error);
    // Nothing has changed the step.
    assert!((get(&instance, height) - ball(0.25).2).abs() < 1e-12);
}

#[test]
fn a_step_with_updates_does_not_allocate() {
    let [u, y] = ["u", "y"].map(reference::<Lag>);
    let instance = ready::<Lag3>(true, &[u, y]);
    let mut value = [0.0];
    let mut run = |first: u32| {
        for k in first..first + 10 {
            let result = step(&instance, f64::from(k) * 0.5, 0.5, |update| {
                instance.get(&[y], &mut value);
                instance.set(&[u], &[update.time]);
                None
            });
            assert_eq!(result.0, Status::Ok);
        }
    };
    // The first step allocates the memory for the values before a step.
    run(0);
    assert_eq!(allocations(|| run(10)), 0);
}

#[test]
fn output_derivatives_are_those_of_outputs() {
    let [u, offset, x, y, integral] = ["u", "offset", "x", "y", "integral"].map(reference::<Lag>);
    let instance = Instance::<Lag3>::co_simulation(false).initialized();
    let component = instance.component;
    assert_eq!(instance.set(&[u, offset], &[3.0, 5.0]), Status::Ok);
    assert_eq!(instance.step(0.0, 0.5).0, Status::Ok);
    let state = get(&instance, x);
    let mut values = [0.0; 3];
    assert_eq!(output_derivatives::<Lag3>(component, &[x, y, x], &mut values, 1), Status::Ok);
    assert_eq!(values, [3.0 - state, 2.0 * state * (3.0 - state) + 3.0, 3.0 - state]);
    for (references, order, error) in [
        ([u], 1, format!("value reference {u} ('u') must be a continuous output")),
        ([integral], 1, format!("value reference {integral} ('integral') must be a continuous output")),
        ([y], 2, "orders must be from 1 to maxOutputDerivativeOrder = 1, got 2".to_owned()),
        ([y], 0, "orders must be from 1 to maxOutputDerivativeOrder = 1, got 0".to_owned()),
    ] {
        assert_eq!(output_derivatives::<Lag3>(component, &references, &mut [0.0], order), Status::Error);
        assert_eq!(instance.error(), format!("fmi3GetOutputDerivatives: {error}"));
    }
    assert_eq!(output_derivatives::<Lag3>(component, &[y], &mut [0.0; 2], 1), Status::Error);
    assert_eq!(instance.error(), "fmi3GetOutputDerivatives: nValues must be 1 for these variables, got 2");
    // SAFETY: a live component.
    assert_eq!(unsafe { fmi3::terminate::<Lag3>(component) }, Status::Ok);
    assert_eq!(output_derivatives::<Lag3>(component, &[y], &mut values[..1], 1), Status::Ok);
    let filter = Instance::<Filter>::co_simulation(false).initialized();
    let output = reference::<Sampler>("filter_output");
    assert_eq!(output_derivatives::<Filter>(filter.component, &[output], &mut [0.0], 1), Status::Error);
    assert_eq!(
        filter.error(),
        "fmi3GetOutputDerivatives: not provided: only outputs of continuous-time models have derivatives"
    );
    // An array has the derivatives of its elements, here the velocities.
    let arrays = Instance::<NativeArrays>::co_simulation(false).initialized();
    assert_eq!(arrays.step(0.0, 0.5).0, Status::Ok);
    let [position, velocity] = ["x[1]", "inner.v[1,1]"].map(reference::<Arrays>);
    let (mut slopes, mut velocities) = ([0.0; 2], [0.0; 2]);
    assert_eq!(output_derivatives::<NativeArrays>(arrays.component, &[position], &mut slopes, 1), Status::Ok);
    assert_eq!(arrays.get(&[velocity], &mut velocities), Status::Ok);
    assert_eq!((slopes, velocities), (velocities, [3.5, 5.0]));
}

/// Reference: the attributes in FMI 3.0.2, sections 2.4.7 and 4.4.
#[test]
fn the_description_declares_the_capabilities_and_variables() {
    let text = |format| Description::of::<<Lag3 as Export>::Model>(format, std::path::Path::new("")).xml;
    let xml = text(Format::FMI3);
    let line = |start: &str| xml.lines().find(|line| line.contains(start)).unwrap_or_else(|| panic!("{start}: {xml}"));
    for attribute in [
        "providesIntermediateUpdate=\"true\"",
        "canReturnEarlyAfterIntermediateUpdate=\"true\"",
        "maxOutputDerivativeOrder=\"1\"",
    ] {
        assert!(line("<CoSimulation").contains(attribute), "{xml}");
        assert!(!line("<ModelExchange").contains(attribute), "{xml}");
    }
    for (name, expected) in [
        ("u", true),
        ("offset", false),
        ("x", true),
        ("integral", true),
        ("y", true),
        ("number", false),
        ("max_step", false),
        ("der(x)", false),
        ("time", false),
    ] {
        let found = line(&format!(" name=\"{name}\"")).contains(" intermediateUpdate=\"true\"");
        assert_eq!(found, expected, "{name}: {xml}");
    }
    assert!(!text(Format::FMI2).contains("ntermediate"));
    let filter = Description::of::<<Filter as Export>::Model>(Format::FMI3, std::path::Path::new("")).xml;
    assert!(!filter.contains("ntermediate") && !filter.contains("OutputDerivative"), "{filter}");
}

/// A state cannot be saved during an update, so bytes with this mode are invalid.
#[test]
fn a_state_is_never_in_an_update() {
    let new = || SafeInstance::<<Lag3 as Export>::Model>::new(Protocol::CS3, Lag3::description(), Default::default());
    let instance = new();
    let mut bytes = instance.serialize(&instance.snapshot().unwrap()).unwrap();
    // Magic number, format version, column, GUID with its length, mode.
    let at = 8 + 4 + 4 + 4 + Lag3::description().guid.len();
    assert_eq!(bytes[at], Mode::Instantiated as u8);
    bytes[at] = Mode::IntermediateUpdate as u8;
    let body = bytes.len() - 8;
    let sum = bytes[..body]
        .iter()
        .fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3));
    bytes[body..].copy_from_slice(&sum.to_le_bytes());
    let error = new().deserialize(&bytes).map(drop).unwrap_err();
    assert!(format!("{error:?}").contains("unknown mode 8"), "{error:?}");
}
