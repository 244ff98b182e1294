//! Events of continuous-time models. References: closed forms.

use fmu::prelude::*;

use crate::models::{Fmu, error_of};

const GRAVITY: f64 = 9.81;

macro_rules! ball {
    ($(#[doc = $doc:literal] $name:ident, $solver:expr;)*) => {$(
        #[derive(Parameters)]
        pub(crate) struct $name {
            /// Coefficient of restitution (1)
            #[var(start = 0.7)]
            restitution: f64,
        }

        #[doc = $doc]
        #[fmu::model(stop_time = 3.0, step_size = 0.01, solver = $solver)]
        impl Continuous for $name {
            type State<T: Scalar> = BallState<T>;
            type Outputs<T: Scalar> = BallOutputs<T>;
            type DiscreteState = Bounces;
            type Crossings = [f64; 1];

            fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> BallState<T> {
                BallState { height: at.state.velocity, velocity: T::from(-GRAVITY) }
            }
            fn outputs<T: Scalar>(&self, at: At<T, Self>) -> BallOutputs<T> {
                BallOutputs { bounces: at.discrete.count, last_bounce: T::from(at.discrete.last) }
            }
            fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
                [at.state.height]
            }
            fn on_event(&self, event: Event<Self>) {
                if event.fell(0) {
                    event.state.height = 0.0;
                    event.state.velocity *= -self.restitution;
                    event.discrete.count += 1;
                    event.discrete.last = event.time;
                }
            }
        }
    )*};
}

#[derive(State)]
pub(crate) struct BallState<T> {
    /// Height (m)
    #[var(start = 1.0)]
    height: T,
    /// Velocity (m/s)
    velocity: T,
}

#[derive(Outputs)]
pub(crate) struct BallOutputs<T> {
    /// Bounces so far
    bounces: i32,
    /// Time of the last bounce (s)
    last_bounce: T,
}

#[derive(DiscreteState, Clone, Default)]
pub(crate) struct Bounces {
    count: i32,
    last: f64,
}

ball! {
    /// Bouncing ball by equal steps
    EqualSteps, RungeKutta;
    /// Bouncing ball by steps with error control
    ControlledSteps, DormandPrince { tolerance: 1e-9 };
    /// Bouncing ball by implicit steps
    ImplicitSteps, Rosenbrock { tolerance: 1e-9 };
}

/// Number of bounces up to `time`, time of the last bounce, height and velocity.
pub(crate) fn ball(time: f64) -> (i32, f64, f64, f64) {
    let first = (2.0 / GRAVITY).sqrt();
    if time < first {
        return (0, 0.0, 1.0 - 0.5 * GRAVITY * time * time, -GRAVITY * time);
    }
    let (mut count, mut last, mut speed) = (1, first, 0.7 * GRAVITY * first);
    while last + 2.0 * speed / GRAVITY <= time {
        last += 2.0 * speed / GRAVITY;
        speed *= 0.7;
        count += 1;
    }
    let t = time - last;
    (count, last, speed * t - 0.5 * GRAVITY * t * t, speed - GRAVITY * t)
}

fn bounces<E: fmu::testing::abi::Export>(fmu: &mut Fmu<E>) -> i32 {
    fmu.0.get_integer(crate::models::reference::<E>("bounces")).unwrap()
}

fn bouncing<E: fmu::testing::abi::Export>() {
    // Every method is exact for a parabola, and the time of a bounce has only rounding errors, far below 1e-9.
    for (step, count) in [(0.01, 200), (0.3, 7), (2.1, 1)] {
        let mut fmu = Fmu::<E>::ready();
        for _ in 0..count {
            fmu.step(step).unwrap();
            let time = fmu.0.time();
            let (expected, last, height, velocity) = ball(time);
            assert_eq!(bounces(&mut fmu), expected, "at {time} s in steps of {step} s");
            assert!((fmu.get("last_bounce") - last).abs() < 1e-9);
            assert!((fmu.get("height") - height).abs() < 1e-9, "{} {height} at {time} s", fmu.get("height"));
            assert!((fmu.get("velocity") - velocity).abs() < 1e-8);
        }
    }
    // The single step of 2.1 s contains several bounces.
    assert!(ball(2.1).0 >= 5);
}

#[test]
fn a_bouncing_ball_follows_its_closed_form() {
    bouncing::<EqualSteps>();
    bouncing::<ControlledSteps>();
    bouncing::<ImplicitSteps>();
}

fn continues<E: fmu::testing::abi::Export>() {
    let mut fmu = Fmu::<E>::ready();
    fmu.step(0.9).unwrap();
    let bytes = fmu.bytes();
    let follow = |fmu: &mut Fmu<E>| {
        let mut seen = Vec::new();
        for step in [0.01, 0.35, 0.002, 0.5] {
            fmu.step(step).unwrap();
            seen.push((bounces(fmu), fmu.bits()));
        }
        seen
    };
    let expected = follow(&mut fmu);
    let mut other = Fmu::<E>::new();
    let saved = other.0.deserialize(&bytes).unwrap();
    other.0.restore(&saved).unwrap();
    assert_eq!(other.bytes(), bytes);
    assert_eq!(follow(&mut other), expected);
}

#[test]
fn a_state_saved_between_bounces_continues_bit_by_bit() {
    continues::<EqualSteps>();
    continues::<ControlledSteps>();
    continues::<ImplicitSteps>();
}

#[test]
fn a_chain_of_ever_shorter_intervals_is_an_error() {
    // The bounces accumulate at t1 + 2 t1 0.7 / (1 - 0.7) = 2.56 s.
    fn check<E: fmu::testing::abi::Export>() {
        let mut fmu = Fmu::<E>::ready();
        let message = error_of(fmu.step(10.0));
        assert!(message.contains("more than 10000 events between 0.45"), "{message}");
        assert!(message.contains("let the model come to rest"), "{message}");
        assert_eq!((fmu.get("height"), fmu.0.time()), (1.0, 0.0));
    }
    check::<EqualSteps>();
    check::<ControlledSteps>();
}

#[derive(Parameters)]
struct Brittle;

/// Ball that breaks at its second bounce
#[fmu::model(stop_time = 3.0, step_size = 0.01)]
impl Continuous for Brittle {
    type State<T: Scalar> = BallState<T>;
    type Outputs<T: Scalar> = BallOutputs<T>;
    type DiscreteState = Bounces;
    type Crossings = [f64; 1];

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> BallState<T> {
        BallState { height: at.state.velocity, velocity: T::from(-GRAVITY) }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> BallOutputs<T> {
        BallOutputs { bounces: at.discrete.count, last_bounce: T::from(at.discrete.last) }
    }
    fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
        [at.state.height]
    }
    fn on_event(&self, event: Event<Self>) {
        event.discrete.count += 1;
        event.state.height = if event.discrete.count == 2 { f64::NAN } else { 0.0 };
        event.state.velocity *= -0.7;
    }
}

/// After a failed step, the outputs have their values from before the step, even if an event in the step changed them.
#[test]
fn a_step_that_fails_after_an_event_keeps_the_discrete_state() {
    let mut fmu = Fmu::<Brittle>::ready();
    fmu.step(0.1).unwrap();
    let before = fmu.bits();
    error_of(fmu.step(2.0));
    assert_eq!((bounces(&mut fmu), fmu.bits()), (0, before));
}

#[derive(Parameters)]
pub(crate) struct Pulses {
    /// Period (s)
    #[var(start = 0.1)]
    period: f64,
}

#[derive(State)]
pub(crate) struct Charge<T> {
    /// Integral of the pulses (s)
    charge: T,
}

#[derive(Outputs)]
pub(crate) struct Edges {
    /// Edges so far
    edges: i32,
}

#[derive(DiscreteState, Clone, Default)]
pub(crate) struct Edge {
    /// Edges so far; the signal is on after an odd number.
    count: i32,
}

/// Pulse train that is on in every second period
#[fmu::model(stop_time = 1.0, step_size = 0.05, solver = DormandPrince { tolerance: 1e-6 })]
impl Continuous for Pulses {
    type State<T: Scalar> = Charge<T>;
    type Outputs<T: Scalar> = Edges;
    type DiscreteState = Edge;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Charge<T> {
        Charge { charge: T::from(f64::from(at.discrete.count % 2)) }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Edges {
        Edges { edges: at.discrete.count }
    }
    fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
        Some(f64::from(at.discrete.count + 1) * self.period)
    }
    fn on_event(&self, event: Event<Self>) {
        assert!(event.is_timed);
        event.discrete.count += 1;
    }
}

#[test]
fn time_events_are_met_exactly_whatever_the_communication_steps() {
    // The integral of a pulse train that is on in [T, 2T), [3T, 4T), …
    for (step, count) in [(0.1, 1000), (0.07, 1000), (0.25, 100), (3.3, 20)] {
        let mut fmu = Fmu::<Pulses>::ready();
        for k in 0..count {
            fmu.0.do_step(f64::from(k) * step, step).unwrap();
            let time = f64::from(k + 1) * step;
            let periods = (time / 0.1 + 1e-6).floor();
            let rest = time - periods * 0.1;
            let charge = 0.1 * (periods / 2.0).floor() + if periods % 2.0 == 1.0 { rest } else { 0.0 };
            // A sum of 1000 terms of 0.1 s; each has a rounding error below 1e-14 s.
            assert!(
                (fmu.get("charge") - charge).abs() < 1e-11,
                "{} instead of {charge} at {time} s",
                fmu.get("charge")
            );
        }
        // An edge at the end of the last step may be handled in the next step.
        let end = f64::from(count) * step;
        fmu.0.do_step(end, 1e-3).unwrap();
        let edges = fmu.0.get_integer(crate::models::reference::<Pulses>("edges")).unwrap();
        assert_eq!(f64::from(edges), ((end + 1e-3) / 0.1).floor(), "in steps of {step} s");
    }
}

#[derive(Parameters)]
pub(crate) struct Clocked;

/// The next event follows from the time alone
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Clocked {
    type Outputs<T: Scalar> = Edges;
    type DiscreteState = Edge;
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Edges {
        Edges { edges: at.discrete.count }
    }
    fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
        // Every 0.1 s from 1 s on.
        let nearest = (at.time * 10.0).round();
        let next = if nearest / 10.0 > at.time { nearest } else { nearest + 1.0 };
        Some(next.max(10.0) / 10.0)
    }
    fn on_event(&self, event: Event<Self>) {
        event.discrete.count += 1;
    }
}

#[test]
fn time_events_of_a_clock_are_neither_lost_nor_doubled() {
    for step in [0.1, 0.03, 1.0, 0.0125] {
        let mut fmu = Fmu::<Clocked>::ready();
        let mut k = 0;
        while f64::from(k) * step < 30.05 {
            fmu.0.do_step(f64::from(k) * step, step).unwrap();
            k += 1;
        }
        let end = f64::from(k) * step;
        fmu.0.do_step(end, 1e-3).unwrap();
        let edges = fmu.0.get_integer(crate::models::reference::<Clocked>("edges")).unwrap();
        assert_eq!(f64::from(edges), ((end + 1e-3) * 10.0).floor() - 9.0, "in steps of {step} s");
    }
}

#[derive(Inputs)]
struct Level<T> {
    /// Level (1)
    level: T,
    /// Reset
    restart: bool,
}

#[derive(DiscreteState, Clone, Default)]
struct Relay {
    is_on: bool,
    switched: i32,
}

#[derive(Parameters)]
struct Hysteresis {
    /// Half width (1)
    #[var(start = 0.5, tunable)]
    width: f64,
}

/// Relay with hysteresis
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Hysteresis {
    type Inputs<T: Scalar> = Level<T>;
    type Outputs<T: Scalar> = Switched;
    type State<T: Scalar> = Charge<T>;
    type DiscreteState = Relay;
    type Crossings = [f64; 3];

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Charge<T> {
        Charge { charge: T::from(f64::from(i32::from(at.discrete.is_on))) }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Switched {
        Switched { is_on: at.discrete.is_on, switched: at.discrete.switched }
    }
    fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 3] {
        let restart = if at.inputs.restart { 1.0 } else { -1.0 };
        [at.inputs.level - self.width, at.inputs.level + self.width, restart]
    }
    fn on_event(&self, event: Event<Self>) {
        if event.rose(0) || event.fell(1) {
            event.discrete.is_on = event.rose(0);
            event.discrete.switched += 1;
        }
        if event.rose(2) {
            event.state.charge = 0.0;
        }
    }
}

#[derive(Outputs)]
struct Switched {
    /// On
    is_on: bool,
    /// Number of switching events
    switched: i32,
}

#[test]
fn an_input_that_changes_a_sign_between_steps_is_an_event_at_the_start_of_the_next_one() {
    let mut fmu = Fmu::<Hysteresis>::ready();
    let read = |fmu: &mut Fmu<Hysteresis>| {
        let [is_on, switched] = ["is_on", "switched"].map(crate::models::reference::<Hysteresis>);
        (fmu.0.get_boolean(is_on).unwrap(), fmu.0.get_integer(switched).unwrap(), fmu.get("charge"))
    };
    let mut run = |level: f64, restart: bool| {
        fmu.set("level", level).unwrap();
        fmu.set_boolean("restart", restart).unwrap();
        // A copy that continues from the bytes of the state has the same events, because the signs of the zero
        // crossings are part of the state.
        let bytes = fmu.bytes();
        let mut copy = Fmu::<Hysteresis>::new();
        let saved = copy.0.deserialize(&bytes).unwrap();
        copy.0.restore(&saved).unwrap();
        fmu.step(0.25).unwrap();
        copy.step(0.25).unwrap();
        assert_eq!(read(&mut copy), read(&mut fmu));
        read(&mut fmu)
    };
    assert_eq!(run(0.0, false), (false, 0, 0.0));
    assert_eq!(run(0.6, false), (true, 1, 0.25));
    assert_eq!(run(0.0, false), (true, 1, 0.5));
    assert_eq!(run(0.0, true), (true, 1, 0.25));
    assert_eq!(run(-0.6, true), (false, 2, 0.25));
    assert_eq!(run(-0.6, false), (false, 2, 0.25));
    assert_eq!(run(0.7, true), (true, 3, 0.25));
}

#[derive(Parameters)]
struct Thermostat {
    /// Switched off at this temperature (degC)
    #[var(start = 22.0, tunable)]
    upper: f64,
    /// Switched on below this temperature (degC)
    #[var(start = 18.0, tunable)]
    lower: f64,
}

#[derive(State)]
struct Room<T> {
    /// Temperature (degC)
    #[var(start = 20.0)]
    temperature: T,
}

#[derive(Inputs)]
struct Outside<T> {
    /// Temperature outside (degC)
    #[var(start = 10.0)]
    outside: T,
}

#[derive(Outputs)]
struct Heating {
    /// Whether the heater is on
    is_on: bool,
}

#[derive(DiscreteState, Clone, Default)]
struct Heater {
    is_on: bool,
}

/// Room with a heater and a thermostat that starts on if it is cold
#[fmu::model(stop_time = 3600.0, step_size = 10.0)]
impl Continuous for Thermostat {
    type State<T: Scalar> = Room<T>;
    type Inputs<T: Scalar> = Outside<T>;
    type Outputs<T: Scalar> = Heating;
    type DiscreteState = Heater;
    type Crossings = [f64; 2];

    fn initial_discrete_state(&self, at: At<f64, Self>) -> Heater {
        assert!(!at.discrete.is_on, "the default");
        Heater { is_on: at.state.temperature < self.lower || at.inputs.outside < 0.0 }
    }
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Room<T> {
        let heat = if at.discrete.is_on { 0.02 } else { 0.0 };
        Room { temperature: (at.inputs.outside - at.state.temperature) * 1e-3 + heat }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Heating {
        Heating { is_on: at.discrete.is_on }
    }
    fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 2] {
        [at.state.temperature - self.upper, at.state.temperature - self.lower]
    }
    fn on_event(&self, event: Event<Self>) {
        if event.rose(0) {
            event.discrete.is_on = false;
        } else if event.fell(1) {
            event.discrete.is_on = true;
        }
    }
}

fn is_on(fmu: &mut Fmu<Thermostat>) -> bool {
    fmu.0.get_boolean(crate::models::reference::<Thermostat>("is_on")).unwrap()
}

#[test]
fn the_discrete_state_at_the_start_follows_from_the_start_values() {
    for (temperature, outside, expected) in
        [(20.0, 10.0, false), (18.5, 10.0, false), (17.9, 10.0, true), (20.0, -1.0, true)]
    {
        let mut fmu = Fmu::<Thermostat>::new();
        fmu.0.setup_experiment(0.0, None).unwrap();
        fmu.set("temperature", temperature).unwrap();
        fmu.0.enter_initialization().unwrap();
        // This first read of the output must have no effect.
        is_on(&mut fmu);
        fmu.set("outside", outside).unwrap();
        assert_eq!(is_on(&mut fmu), expected);
        fmu.0.exit_initialization().unwrap();
        assert_eq!(is_on(&mut fmu), expected);
        fmu.step(1.0).unwrap();
        assert_eq!(is_on(&mut fmu), expected, "{temperature} degC, {outside} degC outside");
    }
}

#[test]
fn a_sign_that_changes_between_the_start_and_the_first_step_is_an_event() {
    let mut fmu = Fmu::<Thermostat>::ready();
    fmu.set("lower", 21.0).unwrap();
    assert!(!is_on(&mut fmu));
    fmu.step(1.0).unwrap();
    assert!(is_on(&mut fmu));
}

#[test]
fn a_simulation_takes_tunable_parameters_between_steps() {
    use fmu::simulation::ContinuousSimulation;

    let mut run = ContinuousSimulation::new(Thermostat::default()).unwrap();
    let inputs = Outside { outside: 10.0 };
    run.step(&inputs, 1.0).unwrap();
    run.set_parameters(Thermostat { lower: 21.0, ..Default::default() }).unwrap();
    run.step(&inputs, 1.0).unwrap();
    assert!(run.outputs(&inputs).is_on);
    // Before the first step, setting the state also determines the initial discrete state.
    let mut run = ContinuousSimulation::new(Thermostat::default()).unwrap();
    run.set_state(&Room { temperature: 5.0 });
    assert!(run.outputs(&inputs).is_on);

    let mut run = ContinuousSimulation::new(EqualSteps::default()).unwrap();
    let error = run.set_parameters(EqualSteps { restitution: 0.5 }).unwrap_err();
    assert_eq!(error, "`restitution` is fixed and cannot change after the start");
}

#[derive(Parameters)]
struct Asking;

/// Asks for a zero crossing that is not there
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Asking {
    type State<T: Scalar> = BallState<T>;
    type Crossings = [f64; 1];
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> BallState<T> {
        BallState { height: at.state.velocity, velocity: T::from(-GRAVITY) }
    }
    fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
        [at.state.height]
    }
    fn on_event(&self, event: Event<Self>) {
        for i in 0..2 {
            let _ = event.rose(i);
        }
    }
}

#[test]
#[should_panic(expected = "there is no zero crossing 1: `type Crossings` has the length 1 and counts from 0")]
fn a_zero_crossing_that_is_not_there_is_an_error() {
    let mut run = fmu::simulation::ContinuousSimulation::new(Asking).unwrap();
    let _ = run.step(&(), 1.0);
}
