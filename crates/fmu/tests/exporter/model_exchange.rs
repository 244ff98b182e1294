//! Model exchange with [`Instance`] and the small importer in this file. References: closed forms, the definition of a
//! relation, and co-simulation of the same model.

use std::path::PathBuf;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::{Function, Mode, Protocol};
use fmu::testing::instance::{CallError, Instance};
use proptest::prelude::*;

use crate::events::{Clocked, EqualSteps, Pulses, ball};
use crate::models::{CartPair, Fmu, Sampler, error_of, reference};

/// An importer that integrates with the classical Runge-Kutta method and finds events by bisection.
struct Importer<E: Export> {
    instance: Instance<E::Model>,
    next_event: Option<f64>,
    events: u32,
}

impl<E: Export> Importer<E> {
    fn instantiated() -> Instance<E::Model> {
        Instance::new(Protocol::ME2, E::description(), PathBuf::new())
    }

    /// An importer in Event Mode, before the first event.
    fn initialized(start: f64, values: &[(&str, f64)]) -> Self {
        let mut instance = Self::instantiated();
        instance.setup_experiment(start, None).unwrap();
        instance.enter_initialization().unwrap();
        for (name, value) in values {
            instance.set_real(&[reference::<E>(name)], &[*value]).unwrap();
        }
        instance.exit_initialization().unwrap();
        Self { instance, next_event: None, events: 0 }
    }

    /// An importer in Continuous-Time Mode.
    fn starting(start: f64, values: &[(&str, f64)]) -> Self {
        let mut importer = Self::initialized(start, values);
        importer.update();
        importer
    }

    /// Handles the events at the present time.
    fn update(&mut self) {
        self.next_event = self.instance.new_discrete_states().unwrap().next_event_time;
        self.instance.enter_continuous_time_mode().unwrap();
    }

    fn event(&mut self) {
        self.events += 1;
        self.instance.enter_event_mode().unwrap();
        self.update();
    }

    fn states(&mut self) -> Vec<f64> {
        let mut states = vec![0.0; E::description().layout.states.counts.reals];
        self.instance.continuous_states(&mut states).unwrap();
        states
    }

    fn indicators(&mut self) -> Vec<f64> {
        let mut indicators = vec![0.0; E::description().layout.indicators.total()];
        self.instance.event_indicators(&mut indicators).unwrap();
        indicators
    }

    fn go_to(&mut self, time: f64, states: &[f64]) {
        self.instance.set_time(time).unwrap();
        self.instance.set_continuous_states(states).unwrap();
    }

    /// The state after one step of the method.
    fn integrated(&mut self, time: f64, x: &[f64], h: f64) -> Vec<f64> {
        let mut slope = |c: f64, x: Vec<f64>| {
            self.go_to(time + c * h, &x);
            let mut derivatives = vec![0.0; x.len()];
            self.instance.state_derivatives(&mut derivatives).unwrap();
            derivatives
        };
        let along = |k: &[f64], h: f64| x.iter().zip(k).map(|(x, k)| x + h * k).collect::<Vec<_>>();
        let k1 = slope(0.0, x.to_vec());
        let k2 = slope(0.5, along(&k1, 0.5 * h));
        let k3 = slope(0.5, along(&k2, 0.5 * h));
        let k4 = slope(1.0, along(&k3, h));
        (0..x.len()).map(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])).collect()
    }

    /// Advances to `end` in steps of at most `step`.
    fn run(&mut self, end: f64, step: f64) {
        while self.instance.time() < end {
            let time = self.instance.time();
            let limit = self.next_event.unwrap_or(end).min(end);
            let mut h = step.min(limit - time);
            let before = self.states();
            let signs = |values: Vec<f64>| values.into_iter().map(|value| value > 0.0).collect::<Vec<_>>();
            let old = signs(self.indicators());
            let mut after = self.integrated(time, &before, h);
            self.go_to(time + h, &after);
            let has_event = signs(self.indicators()) != old;
            if has_event {
                let (mut low, mut high) = (0.0, h);
                while high - low > 1e-14 * (1.0 + time) {
                    let middle = 0.5 * (low + high);
                    let state = self.integrated(time, &before, middle);
                    self.go_to(time + middle, &state);
                    if signs(self.indicators()) == old { low = middle } else { high = middle }
                }
                h = high;
                after = self.integrated(time, &before, h);
                self.go_to(time + h, &after);
            } else if time + step >= limit {
                self.go_to(limit, &after);
            }
            self.instance.check(Function::CompletedIntegratorStep).unwrap();
            if has_event || self.next_event.is_some_and(|next| next <= self.instance.time()) {
                self.event();
            }
        }
    }

    fn get(&mut self, name: &str) -> f64 {
        let mut value = [0.0];
        self.instance.get_real(&[reference::<E>(name)], &mut value).unwrap();
        value[0]
    }
}

fn discarded<V: std::fmt::Debug>(answer: Result<V, CallError>) -> String {
    match answer {
        Err(CallError::Discard(message)) => message,
        other => panic!("fmi2Discard was expected, {other:?} found"),
    }
}

/// A declared zero crossing is an event. The method is exact for a parabola. An event is detected when the height is
/// 1e-9 nominal heights beyond zero, so at 3 m/s each bounce adds an error of 3e-10 s.
#[test]
fn a_bouncing_ball_follows_its_closed_form() {
    let mut importer = Importer::<EqualSteps>::starting(0.0, &[]);
    for i in 1..=21 {
        let time = 0.1 * f64::from(i);
        importer.run(time, 0.02);
        let (count, last, height, velocity) = ball(importer.instance.time());
        let bounces = importer.instance.get_integer(reference::<EqualSteps>("bounces")).unwrap();
        assert_eq!(bounces, count, "at {time} s");
        assert!((importer.get("last_bounce") - last).abs() < 1e-8);
        assert!((importer.get("height") - height).abs() < 1e-7, "{} {height}", importer.get("height"));
        assert!((importer.get("velocity") - velocity).abs() < 1e-7);
    }
    assert!(importer.events >= 5);
}

#[derive(Parameters)]
struct Relay {
    /// Threshold of the charge (C)
    #[var(start = 0.5, tunable)]
    threshold: f64,
    /// The relay has two more contacts
    #[var(start = false)]
    is_double: bool,
}

#[derive(State)]
struct Charge<T> {
    /// Charge (C)
    #[var(nominal = 2.0)]
    charge: T,
    /// Second charge (C)
    #[var(nominal = 5.0)]
    other: T,
}

#[derive(Inputs)]
struct Current<T> {
    /// Current (A)
    current: T,
}

#[derive(Outputs)]
struct Contact<T> {
    /// Contact is closed (1)
    contact: T,
    /// Divisor (1)
    ratio: T,
}

/// Relay that opens above a charge
#[fmu::model(stop_time = 3.0, step_size = 0.01)]
impl Continuous for Relay {
    type State<T: Scalar> = Charge<T>;
    type Inputs<T: Scalar> = Current<T>;
    type Outputs<T: Scalar> = Contact<T>;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Charge<T> {
        let (charge, other) = (at.state.charge, at.state.other);
        let (one, zero) = (T::from(1.0), T::from(0.0));
        let mut slope = charge.if_greater(T::from(self.threshold), T::from(-2.0), one);
        if self.is_double {
            let less = other.if_greater(charge, one, zero) - charge.if_greater(other + 0.25, one, zero);
            slope += less;
        }
        Charge { charge: slope + at.inputs.current, other: T::from(0.25) }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Contact<T> {
        let limit = T::from(0.8);
        Contact {
            contact: at.state.other.if_greater(limit, T::from(0.0), T::from(1.0)),
            ratio: T::from(1.0) / at.state.other,
        }
    }
}

const DOUBLE: &str = "is_double";

fn relay(is_double: bool, state: [f64; 2], current: f64) -> Importer<Relay> {
    let mut instance = Importer::<Relay>::instantiated();
    instance.set_boolean(&[reference::<Relay>(DOUBLE)], &[is_double]).unwrap();
    let mut importer = Importer { instance, next_event: None, events: 0 };
    importer.instance.enter_initialization().unwrap();
    let references = ["charge", "other", "current"].map(reference::<Relay>);
    importer.instance.set_real(&references, &[state[0], state[1], current]).unwrap();
    importer.instance.exit_initialization().unwrap();
    importer.update();
    importer
}

proptest! {
    /// Reference: the same relations, computed in the test. Unused indicators are 1.
    #[test]
    fn each_indicator_has_the_sign_of_its_relation(
        charge in -2.0..2.0, other in -2.0..2.0, current in -1.0..1.0, is_double: bool,
    ) {
        let mut importer = relay(is_double, [charge, other], current);
        let mut expected = vec![charge > 0.5];
        if is_double {
            expected.extend([other > charge, charge > other + 0.25]);
        }
        expected.push(other > 0.8);
        let indicators = importer.indicators();
        prop_assert_eq!(indicators.len(), 4);
        for (indicator, side) in indicators.iter().zip(&expected) {
            prop_assert_eq!(*indicator > 0.0, *side);
            prop_assert!(*indicator != 0.0);
        }
        prop_assert!(indicators[expected.len()..].iter().all(|&indicator| indicator == 1.0));
        // The scale is the change of the difference if the charge changes by its nominal value, 2. With a PROBE of
        // 1e-6, ten digits are correct.
        let scaled = (charge - 0.5) / 2.0;
        prop_assert!((indicators[0] - scaled).abs() < 1e-9 * (1.0 + scaled.abs()) + 1e-9);
    }
}

/// Between events, relations keep their sides, even beyond the threshold.
#[test]
fn relations_keep_their_sides_between_events() {
    let mut importer = relay(false, [0.0, 1.0], 0.0);
    let slope = |importer: &mut Importer<Relay>| {
        let mut derivatives = [0.0; 2];
        importer.instance.state_derivatives(&mut derivatives).unwrap();
        derivatives[0]
    };
    assert_eq!((slope(&mut importer), importer.get("contact")), (1.0, 0.0));
    importer.go_to(0.1, &[0.7, 0.5]);
    assert_eq!((slope(&mut importer), importer.get("contact")), (1.0, 0.0));
    let indicators = importer.indicators();
    assert!(indicators[0] > 0.0 && indicators[1] < 0.0, "{indicators:?}");
    importer.event();
    assert_eq!((slope(&mut importer), importer.get("contact")), (-2.0, 1.0));
}

/// Closed form: the charge rises with slope 1 to the threshold, where it falls with slope -2. From there it stays at
/// the threshold, from event to event, within 1e-9 of its nominal value 2 C.
#[test]
fn a_relation_is_an_event_where_its_operands_are_equal() {
    let mut importer = relay(false, [0.0, 0.0], 0.0);
    importer.run(0.4, 0.05);
    assert_eq!(importer.events, 0);
    importer.run(0.5 + 1e-6, 0.05);
    let charge = importer.get("charge");
    assert!(importer.events >= 1 && (charge - 0.5).abs() < 1e-7, "{} {charge}", importer.events);
}

#[derive(Parameters)]
struct Latch;

#[derive(DiscreteState, Clone, Default)]
struct Locks {
    is_locked: bool,
    is_reversed: bool,
}

/// Relations that exist only while both locks are closed
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Latch {
    type State<T: Scalar> = Charge<T>;
    type DiscreteState = Locks;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Charge<T> {
        let (one, zero) = (T::from(1.0), T::from(0.0));
        let mut slope = at.state.charge.if_greater(one, zero, one);
        if at.discrete.is_locked && at.discrete.is_reversed {
            slope = slope + at.state.other.if_greater(one, zero, one) + at.state.other.if_greater(zero, zero, one);
        }
        Charge { charge: slope, other: one }
    }
}

/// Reference: the equations have one or three relations, depending on the locks.
#[test]
fn the_number_of_indicators_is_the_maximum_over_all_modes() {
    assert_eq!(Latch::description().layout.indicators.total(), 3);
    let mut importer = Importer::<Latch>::starting(0.0, &[]);
    assert_eq!(importer.indicators()[1..], [1.0, 1.0]);
}

#[test]
fn what_is_not_finite_is_discarded_so_that_a_solver_can_shorten_its_step() {
    let mut importer = relay(false, [0.0, 1.0], 0.0);
    importer.go_to(0.1, &[f64::MAX, 0.0]);
    let ratio = reference::<Relay>("ratio");
    let message = discarded(importer.instance.get_real(&[ratio], &mut [0.0]));
    assert_eq!(message, "fmi2GetReal: 'ratio' = inf at time 0.1 s, not a finite number");
    assert_eq!(
        discarded(importer.instance.set_continuous_states(&[f64::NAN, 0.0])),
        "fmi2SetContinuousStates: 'charge' must be finite, got NaN"
    );
    assert_eq!(
        discarded(importer.instance.set_real(&[reference::<Relay>("charge")], &[f64::NAN])),
        "fmi2SetReal: 'charge' must be finite, got NaN"
    );
    importer.instance.set_real(&[reference::<Relay>("current")], &[f64::MAX]).unwrap();
    // The instance continues normally.
    importer.go_to(0.1, &[0.0, 0.5]);
    assert_eq!(importer.get("ratio"), 2.0);
    let mut cart = Importer::<CartPair>::starting(0.0, &[]);
    cart.go_to(0.1, &[f64::MAX, -f64::MAX, f64::MAX, f64::MAX]);
    let message = discarded(cart.instance.state_derivatives(&mut [0.0; 4]));
    assert!(message.starts_with("fmi2GetDerivatives: 'der(cart_velocity.l)' = "), "{message}");
}

/// CasADi sets continuous states with fmi2SetReal. Reference: the closed form of an output, 1 / other.
#[test]
fn states_can_be_set_one_by_one() {
    let mut importer = relay(false, [0.0, 1.0], 0.0);
    let other = reference::<Relay>("other");
    importer.instance.set_real(&[other], &[0.25]).unwrap();
    assert_eq!((importer.states(), importer.get("ratio")), (vec![0.0, 0.25], 4.0));
    importer.instance.enter_event_mode().unwrap();
    let message = error_of(importer.instance.set_real(&[other], &[0.5]));
    assert!(message.contains("'other' is a continuous state, settable only in"), "{message}");
}

#[derive(Parameters)]
struct Stop;

/// Spring that is three times as stiff behind a stop
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Stop {
    type State<T: Scalar> = Charge<T>;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Charge<T> {
        let x = at.state.charge;
        Charge { charge: x.if_greater(T::from(0.0), -x * 3.0, -x), other: Scalar::max(x, T::from(0.0)) }
    }
}

/// Derivatives are computed for the equations that a solver sees, with frozen relations. Closed form: -1 in front of
/// the stop and -3 behind it; `max` is not a relation and follows the values.
#[test]
fn directional_derivatives_keep_the_sides_of_relations() {
    let mut importer = Importer::<Stop>::starting(0.0, &[("charge", -1.0)]);
    let slopes = |importer: &mut Importer<Stop>| {
        let unknown = ["der(charge)", "der(other)"].map(reference::<Stop>);
        let mut slopes = [0.0; 2];
        let known = [reference::<Stop>("charge")];
        importer.instance.directional_derivative(&unknown, &known, &[1.0], &mut slopes).unwrap();
        slopes
    };
    assert_eq!(slopes(&mut importer), [-1.0, 0.0]);
    importer.go_to(0.1, &[1.0, 0.0]);
    assert_eq!(slopes(&mut importer), [-1.0, 1.0]);
    importer.event();
    assert_eq!(slopes(&mut importer), [-3.0, 1.0]);
    importer.go_to(0.2, &[-1.0, 0.0]);
    assert_eq!(slopes(&mut importer), [-3.0, 0.0]);
}

/// Reference: co-simulation of the same model, which takes a sample at the start of each step.
#[test]
fn samples_are_time_events_with_the_bits_of_co_simulation() {
    let start = -0.3;
    let mut co_simulation = Fmu::<Sampler>::starting(start, &[]);
    let mut importer = Importer::<Sampler>::initialized(start, &[]);
    let period = importer.get("sample_time");
    let input = reference::<Sampler>("filter_input");
    for k in 0..50_u32 {
        let value = f64::from(k % 7) - 2.5;
        let time = start + f64::from(k) * period;
        co_simulation.0.set_real(&[input], &[value]).unwrap();
        co_simulation.0.do_step(time, period).unwrap();
        if k > 0 {
            assert_eq!(importer.next_event, Some(time));
            importer.instance.set_time(time).unwrap();
            importer.instance.enter_event_mode().unwrap();
        }
        importer.instance.set_real(&[input], &[value]).unwrap();
        importer.update();
        for name in ["filter_output", "filter_time"] {
            assert_eq!(importer.get(name).to_bits(), co_simulation.get(name).to_bits(), "{name} at {time} s");
        }
        // Nothing changes between samples; an event there does not take a sample.
        importer.instance.set_time(time + 0.4 * period).unwrap();
        importer.event();
        assert_eq!(importer.get("filter_output").to_bits(), co_simulation.get("filter_output").to_bits());
    }
}

/// Time events of a continuous-time model. References: the closed form of the integral, the number of periods.
#[test]
fn declared_time_events_are_handled_at_their_times() {
    fn edges<E: Export>(importer: &mut Importer<E>) -> i32 {
        importer.instance.get_integer(reference::<E>("edges")).unwrap()
    }
    let mut pulses = Importer::<Pulses>::starting(0.0, &[]);
    assert_eq!(pulses.next_event, Some(0.1));
    for k in 1..=40_i32 {
        pulses.run(f64::from(k) * 0.1 + 0.05, 0.03);
        assert_eq!((edges(&mut pulses), pulses.next_event), (k, Some(f64::from(k + 1) * 0.1)));
        // The integral of a pulse train that is on in [T, 2T), [3T, 4T), …: a sum of a few hundred rounded terms.
        let charge = 0.1 * f64::from(k / 2) + if k % 2 == 1 { 0.05 } else { 0.0 };
        assert!((pulses.get("charge") - charge).abs() < 1e-12, "{} {charge}", pulses.get("charge"));
    }
    let mut clocked = Importer::<Clocked>::starting(0.0, &[]);
    clocked.run(3.05, 0.07);
    assert_eq!(edges(&mut clocked), 21); // 1.0, 1.1, …, 3.0

    // The event is due when the state is saved, but is not handled yet.
    let mut importer = Importer::<Pulses>::starting(0.0, &[]);
    let states = importer.states();
    importer.go_to(0.1, &states);
    let bytes = importer.instance.serialize(&importer.instance.snapshot().unwrap()).unwrap();
    let mut other = Importer::<Pulses> { instance: Importer::<Pulses>::instantiated(), next_event: None, events: 0 };
    other.instance.restore(&other.instance.deserialize(&bytes).unwrap()).unwrap();
    other.event();
    assert_eq!((edges(&mut other), other.next_event), (1, Some(0.2)));
}

#[derive(Parameters)]
struct Gears;

#[derive(DiscreteState, Clone, Default)]
struct Gear {
    number: i32,
    is_locked: bool,
}

/// Equations that work for three gears only
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Gears {
    type State<T: Scalar> = Charge<T>;
    type DiscreteState = Gear;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Charge<T> {
        let ratio = T::from([1.0, 2.0, 3.0][at.discrete.number as usize]);
        let slope = if at.discrete.is_locked { at.state.charge.if_greater(ratio, ratio, -ratio) } else { ratio };
        Charge { charge: slope, other: ratio }
    }
}

/// Both values of a Boolean in the discrete state are tried; an Integer keeps its value.
#[test]
fn equations_need_not_work_for_every_integer_of_the_discrete_state() {
    assert_eq!(Gears::description().layout.indicators.total(), 1);
}

#[derive(Parameters)]
struct Switches {
    /// Switches
    #[var(start = [true; 13])]
    on: [bool; 13],
}

/// Relations that most switches at once would not show
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Switches {
    type State<T: Scalar> = Charge<T>;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Charge<T> {
        let (one, zero) = (T::from(1.0), T::from(0.0));
        let on = self.on.iter().filter(|on| **on).count();
        let relation = || at.state.charge.if_greater(one, zero, one);
        Charge { charge: (0..on).fold(zero, |sum, _| sum + relation()), other: one }
    }
}

/// The 2^13 combinations are too many to try; only those in which at most one parameter differs from its start value
/// are tried.
#[test]
fn with_many_parameters_the_start_values_count() {
    assert_eq!(Switches::description().layout.indicators.total(), 13);
}

#[test]
fn a_saved_state_continues_with_the_same_bits() {
    let run = |importer: &mut Importer<EqualSteps>, end: f64| {
        importer.run(end, 0.02);
        importer.states().iter().map(|state| state.to_bits()).collect::<Vec<_>>()
    };
    let mut importer = Importer::<EqualSteps>::starting(0.0, &[]);
    run(&mut importer, 0.7);
    let snapshot = importer.instance.snapshot().unwrap();
    let bytes = importer.instance.serialize(&snapshot).unwrap();
    let first = run(&mut importer, 1.5);
    importer.instance.restore(&snapshot).unwrap();
    assert_eq!(run(&mut importer, 1.5), first);
    let mut other = Importer::<EqualSteps>::instantiated();
    let snapshot = other.deserialize(&bytes).unwrap();
    other.restore(&snapshot).unwrap();
    assert_eq!(other.serialize(&snapshot).unwrap(), bytes);
    let mut other = Importer { instance: other, next_event: None, events: 0 };
    assert_eq!(run(&mut other, 1.5), first);
}

#[test]
fn the_bytes_of_one_interface_are_rejected_by_another() {
    let importer = Importer::<CartPair>::starting(0.0, &[]);
    let fmu = Fmu::<CartPair>::ready();
    let bytes = importer.instance.serialize(&importer.instance.snapshot().unwrap()).unwrap();
    assert_eq!(
        error_of(fmu.0.deserialize(&bytes).map(drop)),
        "fmi2DeSerializeFMUstate: the state was saved by an instance for model exchange of FMI 2.0, this instance is for \
         co-simulation of FMI 2.0"
    );
    assert!(
        error_of(importer.instance.deserialize(&fmu.bytes()).map(drop)).contains("this instance is for model exchange")
    );
}

#[test]
fn invalid_arguments_are_reported_with_the_rule() {
    let mut importer = Importer::<CartPair>::starting(2.0, &[]);
    let instance = &mut importer.instance;
    assert_eq!(
        error_of(instance.set_time(1.0)),
        "fmi2SetTime: time must be finite and not before startTime = 2, got 1 s"
    );
    assert_eq!(
        error_of(instance.set_continuous_states(&[0.0])),
        "fmi2SetContinuousStates: the model has 4 states, the array has the length 1"
    );
    assert_eq!(
        error_of(instance.continuous_states(&mut [0.0])),
        "fmi2GetContinuousStates: the model has 4 states, the array has the length 1"
    );
    assert_eq!(
        error_of(instance.event_indicators(&mut [0.0; 9])),
        "fmi2GetEventIndicators: the model has 0 event indicators, the array has the length 9"
    );
    assert_eq!(
        error_of(instance.set_real(&[reference::<CartPair>("damper.damping")], &[1.0])),
        "fmi2SetReal: 'damper.damping' is a tunable parameter, not settable in Continuous-Time Mode; the instance is in \
         Continuous-Time Mode"
    );
    assert_eq!(error_of(instance.do_step(2.0, 0.1)), "fmi2DoStep is not a function of model exchange");
    assert_eq!(
        error_of(instance.new_discrete_states()),
        "fmi2NewDiscreteStates called in Continuous-Time Mode, allowed in Event Mode"
    );
}

/// Brings an instance into a mode.
fn in_mode(mode: Mode) -> Importer<CartPair> {
    let instance = Importer::<CartPair>::instantiated();
    let mut importer = Importer { instance, next_event: None, events: 0 };
    match mode {
        Mode::Instantiated => {}
        Mode::Initialization => importer.instance.enter_initialization().unwrap(),
        Mode::Event => importer = Importer::initialized(0.0, &[]),
        _ => importer = Importer::starting(0.0, &[]),
    }
    if mode == Mode::Terminated {
        importer.instance.terminate().unwrap();
    }
    assert_eq!(importer.instance.mode(), mode);
    importer
}

#[test]
fn every_function_follows_the_table_of_calls() {
    type Call = (Function, fn(&mut Instance<<CartPair as Export>::Model>) -> Result<(), CallError>);
    let calls: [Call; 19] = [
        (Function::SetupExperiment, |i| i.setup_experiment(0.0, None)),
        (Function::EnterInitializationMode, Instance::enter_initialization),
        (Function::ExitInitializationMode, Instance::exit_initialization),
        (Function::Terminate, Instance::terminate),
        (Function::Reset, Instance::reset),
        (Function::GetReal, |i| i.get_real(&[], &mut [])),
        (Function::SetReal, |i| i.set_real(&[], &[])),
        (Function::GetFMUstate, |i| i.snapshot().map(drop)),
        (Function::GetDirectionalDerivative, |i| i.directional_derivative(&[], &[], &[], &mut [])),
        (Function::EnterEventMode, Instance::enter_event_mode),
        (Function::NewDiscreteStates, |i| i.new_discrete_states().map(drop)),
        (Function::EnterContinuousTimeMode, Instance::enter_continuous_time_mode),
        (Function::CompletedIntegratorStep, |i| i.check(Function::CompletedIntegratorStep)),
        (Function::SetTime, |i| i.set_time(0.0)),
        (Function::SetContinuousStates, |i| i.set_continuous_states(&[0.0; 4])),
        (Function::GetDerivatives, |i| i.state_derivatives(&mut [0.0; 4])),
        (Function::GetEventIndicators, |i| i.event_indicators(&mut [])),
        (Function::GetContinuousStates, |i| i.continuous_states(&mut [0.0; 4])),
        (Function::GetNominalsOfContinuousStates, |i| i.nominals(&mut [0.0; 4])),
    ];
    for mode in Mode::ALL.into_iter().filter(|mode| mode.belongs_to(Protocol::ME2) && *mode != Mode::Broken) {
        for (function, call) in calls {
            let mut importer = in_mode(mode);
            let answer = call(&mut importer.instance);
            if function.allowed(Protocol::ME2, mode) {
                answer.unwrap_or_else(|e| panic!("{function:?} in {}: {e:?}", mode.name()));
            } else {
                assert!(error_of(answer).contains(&format!(" called in {}, allowed in ", mode.name())));
                assert_eq!(importer.instance.mode(), mode);
            }
        }
    }
}
