//! Clocks whose interval and shift the importer sets. Reference: FMI 3.0.2, section 2.2.8 (clock types; functions for
//! intervals and shifts); times of ticks in closed form.

use std::path::PathBuf;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::{Function, Protocol};
use fmu::testing::clocks::Span;
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::{CallError, Instance, Qualifier};
use fmu::testing::number::Number;

use crate::models::{Fmu, error_of, exported, reference};

#[derive(Parameters)]
struct Rates {
    /// Interval of `follower` (s)
    #[var(start = 1.0, positive, tunable)]
    period: f64,
}

#[derive(Outputs)]
struct Ticks {
    /// Ticks of `control`
    control_ticks: i32,
    /// Ticks of `slow`
    slow_ticks: i32,
    /// Time of the last tick of `control` (s)
    control_time: f64,
    /// Time of the last tick of `slow` (s)
    slow_time: f64,
    /// Interval of the last tick of `slow` (s)
    slow_interval: f64,
}

/// Clocks of all kinds
#[fmu::model(stop_time = 10.0, step_size = 1.0)]
impl Discrete for Rates {
    type Outputs = Ticks;

    /// Fixed
    #[clock(interval = 1 / 10, shift = 1 / 5, fixed, priority = 0)]
    fn control(&self, tick: Tick<Self>) {
        tick.outputs.control_ticks += 1;
        tick.outputs.control_time = tick.time;
    }

    /// Constant
    #[clock(interval = 100, shift = 100, priority = 1)]
    fn constant(&self, _: Tick<Self>) {}

    /// Tunable
    #[clock(interval = 2.0, tunable, priority = 2)]
    fn slow(&self, tick: Tick<Self>) {
        tick.outputs.slow_ticks += 1;
        tick.outputs.slow_time = tick.time;
        tick.outputs.slow_interval = tick.interval;
    }

    /// Follows a parameter
    #[clock(interval_of = "period", shift = 100.0, priority = 3)]
    fn follower(&self, _: Tick<Self>) {}

    /// Aperiodic
    #[clock(countdown, priority = 4)]
    fn alarm(&self, _: Tick<Self>) {}
}

exported! {
    Rates3: Rates, Format::FMI3;
}

type Instance3 = Fmu<Rates3>;

impl Instance3 {
    fn initializing_with(protocol: Protocol) -> Self {
        let mut fmu = Self(Instance::new(protocol, Rates3::description(), PathBuf::new()).with_event_mode());
        fmu.0.set_experiment(Function::EnterInitializationMode, 0.0, None, None).unwrap();
        fmu.0.enter_initialization().unwrap();
        fmu
    }

    fn set_timing(&mut self, function: Function, clock: &str, span: Span) -> Result<(), CallError> {
        self.0.set_timing(function, &[reference::<Rates3>(clock)], std::iter::once(span))
    }

    fn interval(&mut self, clock: &str) -> (f64, Qualifier) {
        self.0.interval(reference::<Rates3>(clock)).unwrap()
    }

    fn activate(&mut self, clock: &str) -> Result<(), CallError> {
        self.0.set_clock(&[reference::<Rates3>(clock)], std::iter::once(true))
    }

    fn integer(&mut self, name: &str) -> i32 {
        i32::of(self.0.get_number(Function::GetInteger, i32::SIZE, reference::<Rates3>(name)).unwrap())
    }

    fn update(&mut self) {
        self.0.new_discrete_states().unwrap();
    }

    /// Steps to a time, from the end of an event to the next one.
    fn go_to(&mut self, time: f64) {
        self.0.enter_step_mode().unwrap();
        self.step(time - self.0.time()).unwrap();
        self.0.enter_event_mode().unwrap();
    }
}

#[test]
fn the_declared_timing_is_the_default() {
    let mut fmu = Instance3::initializing_with(Protocol::CS3);
    let [control, slow] = ["control", "slow"].map(reference::<Rates3>);
    // The only qualifier of a clock whose interval the importer sets.
    assert_eq!(fmu.interval("control"), (0.1, Qualifier::Unchanged));
    assert_eq!(fmu.interval("slow"), (2.0, Qualifier::Unchanged));
    assert_eq!(
        (fmu.0.interval_fraction(control).unwrap().0, fmu.0.shift_fraction(control).unwrap()),
        ((1, 10), (2, 10))
    );
    assert_eq!(fmu.0.shift(slow).unwrap(), 0.0);
    let xml = Description::of::<<Rates as Export>::Model>(Format::FMI3, "".as_ref()).xml;
    for expected in [
        r#"priority="0" intervalVariability="fixed" intervalDecimal="0.1" shiftDecimal="0.2" supportsFraction="true" resolution="10" intervalCounter="1" shiftCounter="2"/>"#,
        r#"priority="1" intervalVariability="constant""#,
        r#"priority="2" intervalVariability="tunable" intervalDecimal="2.0"/>"#,
        r#"priority="3" intervalVariability="tunable"/>"#,
    ] {
        assert!(xml.contains(expected), "{expected}\n{xml}");
    }
}

/// Ticks at 1/6 + n/3 s, and for the other clock at 1.5 + 0.5 n s.
#[test]
fn intervals_and_shifts_set_in_initialization_mode_determine_the_ticks() {
    let mut fmu = Instance3::initializing_with(Protocol::CS3);
    let set = [
        (Function::SetIntervalFraction, "control", Span::Fraction(1, 3)),
        (Function::SetShiftFraction, "control", Span::Fraction(1, 6)),
        (Function::SetIntervalDecimal, "slow", Span::Decimal(0.5)),
        (Function::SetShiftDecimal, "slow", Span::Decimal(1.5)),
    ];
    for (function, clock, span) in set {
        fmu.set_timing(function, clock, span).unwrap();
    }
    // Saved states contain them, in this mode too.
    let bytes = fmu.bytes();
    fmu.0.reset().unwrap();
    fmu.0.set_experiment(Function::EnterInitializationMode, 0.0, None, None).unwrap();
    fmu.0.enter_initialization().unwrap();
    assert_eq!(fmu.interval("control").0, 0.1, "the declared interval");
    fmu.0.restore(&fmu.0.deserialize(&bytes).unwrap()).unwrap();
    assert_eq!(fmu.interval("control"), (1.0 / 3.0, Qualifier::Unchanged));
    assert_eq!(fmu.0.interval_fraction(reference::<Rates3>("control")).unwrap().0, (1, 3));
    assert_eq!(fmu.0.shift_fraction(reference::<Rates3>("control")).unwrap(), (1, 6));
    fmu.0.exit_initialization().unwrap();
    fmu.update();
    let sixths = [1, 3, 5, 7, 9].map(|n| f64::from(n) / 6.0);
    for (n, time) in sixths.into_iter().enumerate() {
        fmu.go_to(time);
        fmu.activate("control").unwrap();
        assert_eq!(fmu.integer("control_ticks"), n as i32 + 1);
        assert!((fmu.get("control_time") - time).abs() < 1e-15);
        if time == 1.5 {
            fmu.activate("slow").unwrap();
            assert_eq!((fmu.get("slow_time"), fmu.get("slow_interval")), (1.5, 0.5));
        }
        fmu.update();
    }
}

/// An importer without Event Mode: 1 tick at the start, then one each 0.25 s.
#[test]
fn the_interval_holds_for_ticks_inside_steps() {
    let mut fmu = Fmu::<Rates3>(Instance::new(Protocol::CS3, Rates3::description(), PathBuf::new()));
    fmu.0.set_experiment(Function::EnterInitializationMode, 3.0, None, None).unwrap();
    fmu.0.enter_initialization().unwrap();
    fmu.set_timing(Function::SetIntervalDecimal, "slow", Span::Decimal(0.25)).unwrap();
    fmu.0.exit_initialization().unwrap();
    for steps in 1..4 {
        fmu.step(1.0).unwrap();
        assert_eq!(fmu.integer("slow_ticks"), 4 * steps);
    }
}

#[test]
fn a_tunable_interval_counts_from_the_last_tick() {
    let mut fmu = Instance3::initializing_with(Protocol::CS3);
    fmu.set_timing(Function::SetShiftDecimal, "control", Span::Decimal(50.0)).unwrap();
    fmu.0.exit_initialization().unwrap();
    fmu.activate("slow").unwrap();
    fmu.update();
    fmu.go_to(1.0);
    fmu.set_timing(Function::SetIntervalDecimal, "slow", Span::Decimal(1.5)).unwrap();
    let message = error_of(fmu.set_timing(Function::SetIntervalDecimal, "control", Span::Decimal(1.5)));
    assert_eq!(
        message,
        "fmi3SetIntervalDecimal: the interval of the clock 'control' cannot be set after Initialization Mode, because the \
         clock is fixed"
    );
    fmu.update();
    assert_eq!(fmu.interval("slow"), (1.5, Qualifier::Unchanged));
    fmu.go_to(1.5);
    let bytes = fmu.bytes();
    for _ in 0..2 {
        fmu.activate("slow").unwrap();
        assert_eq!((fmu.integer("slow_ticks"), fmu.get("slow_time")), (2, 1.5));
        // The interval that is set at a tick holds from this tick on.
        fmu.set_timing(Function::SetIntervalDecimal, "slow", Span::Decimal(0.25)).unwrap();
        fmu.update();
        fmu.go_to(1.75);
        fmu.activate("slow").unwrap();
        assert_eq!(fmu.get("slow_time"), 1.75);
        fmu.0.restore(&fmu.0.deserialize(&bytes).unwrap()).unwrap();
    }
    fmu.0.enter_step_mode().unwrap();
    let message = error_of(fmu.set_timing(Function::SetIntervalDecimal, "slow", Span::Decimal(1.5)));
    assert_eq!(message, "fmi3SetIntervalDecimal called in Step Mode, allowed in Initialization Mode, Event Mode");
    let message = error_of(fmu.set_timing(Function::SetShiftDecimal, "slow", Span::Decimal(1.5)));
    assert_eq!(message, "fmi3SetShiftDecimal called in Step Mode, allowed in Initialization Mode");
}

#[test]
fn scheduled_execution_has_the_interval_that_was_set() {
    let mut fmu = Instance3::initializing_with(Protocol::SE3);
    fmu.set_timing(Function::SetIntervalDecimal, "slow", Span::Decimal(0.5)).unwrap();
    fmu.0.exit_initialization().unwrap();
    let slow = reference::<Rates3>("slow");
    fmu.0.activate(slow, 0.0).unwrap();
    assert_eq!(fmu.get("slow_interval"), 0.5);
    fmu.set_timing(Function::SetIntervalDecimal, "slow", Span::Decimal(0.75)).unwrap();
    fmu.0.activate(slow, 0.75).unwrap();
    assert_eq!(fmu.get("slow_interval"), 0.75);
    let message = error_of(fmu.set_timing(Function::SetIntervalDecimal, "control", Span::Decimal(1.5)));
    assert!(message.contains("because the clock is fixed"), "{message}");
}

#[test]
fn a_timing_that_cannot_be_set_is_an_error() {
    use Function::{SetIntervalDecimal, SetIntervalFraction, SetShiftDecimal, SetShiftFraction};
    let mut fmu = Instance3::initializing_with(Protocol::CS3);
    let before = fmu.bytes();
    for (function, clock, span, problem) in [
        (SetIntervalDecimal, "constant", Span::Decimal(1.0), "cannot be set: the model determines it"),
        (SetIntervalDecimal, "alarm", Span::Decimal(1.0), "cannot be set: the model determines it"),
        (SetShiftDecimal, "follower", Span::Decimal(1.0), "cannot be set: set the parameter 'period' instead"),
        (SetIntervalDecimal, "control", Span::Decimal(0.0), "must be finite and above 0 s, got 0 s"),
        (SetIntervalDecimal, "slow", Span::Decimal(f64::NAN), "must be finite and above 0 s, got NaN s"),
        (SetIntervalFraction, "control", Span::Fraction(0, 3), "must be finite and above 0 s, got 0 s"),
        (SetIntervalFraction, "control", Span::Fraction(3, 0), "must be finite and above 0 s, got inf s"),
        (SetIntervalFraction, "slow", Span::Fraction(1, 3), "cannot be set as a fraction (supportsFraction is false)"),
        (SetShiftFraction, "slow", Span::Fraction(1, 3), "cannot be set as a fraction (supportsFraction is false)"),
        (SetShiftDecimal, "slow", Span::Decimal(-0.5), "must be finite and at least 0 s, got -0.5 s"),
    ] {
        let message = error_of(fmu.set_timing(function, clock, span));
        let what = if matches!(function, SetShiftDecimal | SetShiftFraction) { "shift" } else { "interval" };
        assert!(message.ends_with(&format!("the {what} of the clock '{clock}' {problem}")), "{message}");
    }
    // Nothing changes if one of several clocks is wrong.
    let both = ["slow", "constant"].map(reference::<Rates3>);
    let spans = [Span::Decimal(1.0); 2].into_iter();
    error_of(fmu.0.set_timing(SetIntervalDecimal, &both, spans));
    assert_eq!(fmu.bytes(), before);
    // A number for a clock with fractions; a shift of 0.
    fmu.set_timing(SetIntervalDecimal, "control", Span::Decimal(0.3)).unwrap();
    fmu.set_timing(SetShiftFraction, "control", Span::Fraction(0, 1)).unwrap();
    assert_eq!((fmu.interval("control").0, fmu.0.shift(reference::<Rates3>("control")).unwrap()), (0.3, 0.0));
    let message = error_of(fmu.0.interval_fraction(reference::<Rates3>("control")));
    assert!(message.ends_with("the interval of the clock 'control' is not a fraction: use the function for decimals"));
    // The words with the timing are not variables.
    let end = Rates3::description().layout.end;
    for unused in (0..end).filter(|reference| Rates3::description().layout.by_reference(*reference).is_none()) {
        let message = error_of(fmu.0.get_number(Function::GetUInt64, u64::SIZE, unused));
        assert!(message.contains("it is no variable"), "{message}");
    }
}
