//! Clocks. Reference: FMI 3.0.2, sections 2.2.8 (clocks), 2.3.5 (Event Mode) and 4.2 (co-simulation); counts and times
//! in closed form.

use std::path::PathBuf;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::{Mode, Protocol};
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::{CallError, Instance, Qualifier};
use fmu::testing::number::Number;

use crate::allocations::allocations;
use crate::models::{Fmu, error_of, exported, reference};

#[derive(Parameters)]
pub(crate) struct Watch {
    /// Interval of the slow part (s)
    #[var(start = 0.25, positive, tunable)]
    slow_time: f64,
}

#[derive(Inputs)]
pub(crate) struct WatchInputs {
    /// Reference (rad/s)
    #[var(clock = "control")]
    reference: f64,
    /// Time until the alarm (s)
    delay: f64,
}

#[derive(Outputs)]
pub(crate) struct WatchOutputs {
    /// Voltage (V)
    #[var(clock = "control")]
    voltage: f64,
    /// Number of ticks of `control`
    ticks: i32,
    /// Number of ticks of `slow`
    #[var(clock = "slow")]
    slow_ticks: i32,
    /// Time of the last alarm (s)
    alarm_time: f64,
    /// Time of the last pulse (s)
    pulse_time: f64,
    /// Number of ticks of any clock
    #[var(clock = ["control", "slow", "watchdog", "pulse"])]
    all: i32,
    /// Ticks when the voltage exceeds 1 V
    #[var(alias("exceeded", description = "Another name"))]
    limit: Clock,
}

#[derive(DiscreteState, Clone, Default)]
pub(crate) struct WatchState {
    integral: f64,
    pulses: u32,
}

/// Integrates a reference and watches it
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Watch {
    type Inputs = WatchInputs;
    type Outputs = WatchOutputs;
    type State = WatchState;

    /// Integral control
    #[clock(interval = 1 / 10)]
    fn control(&self, mut tick: Tick<Self>) {
        tick.state.integral += tick.interval * tick.inputs.reference;
        tick.outputs.voltage = tick.state.integral;
        tick.outputs.ticks += 1;
        tick.outputs.all += 1;
        if tick.outputs.voltage > 1.0 {
            tick.outputs.limit.fire();
        }
        let delay = tick.inputs.delay;
        if delay != 0.0 {
            tick.start(WatchClock::Watchdog, delay);
        }
    }

    /// Slow part
    #[clock(interval_of = "slow_time", shift = 0.5)]
    fn slow(&self, tick: Tick<Self>) {
        tick.outputs.slow_ticks += 1;
        tick.outputs.all += 1;
    }

    /// Alarm
    #[clock("watchdog", countdown)]
    fn watchdog(&self, tick: Tick<Self>) {
        tick.outputs.alarm_time = tick.time;
        tick.outputs.all += 1;
    }

    /// Pulses at 0.125, 0.375, 0.75, … s
    #[clock(changing, interval = 1 / 8)]
    fn pulse(&self, mut tick: Tick<Self>) {
        tick.state.pulses += 1;
        tick.outputs.pulse_time = tick.time;
        tick.outputs.all += 1;
        let next = 0.125 * f64::from(tick.state.pulses + 1);
        tick.start(WatchClock::Pulse, next);
    }
}

exported! {
    Watch3: Watch, Format::FMI3;
}

type Clocked = Fmu<Watch3>;

impl Clocked {
    fn in_event_mode(values: &[(&str, f64)]) -> Self {
        let mut fmu = Self(Instance::new(Protocol::CS3, Watch3::description(), PathBuf::new()).with_event_mode());
        fmu.0.setup(0.0);
        for (name, value) in values {
            fmu.set(name, *value).unwrap();
        }
        fmu.0.exit_initialization().unwrap();
        assert_eq!(fmu.0.mode(), Mode::Event);
        fmu
    }

    fn activate(&mut self, clock: &str, is_active: bool) -> Result<(), CallError> {
        self.0.set_clock(&[reference::<Watch3>(clock)], std::iter::once(is_active))
    }

    fn clock(&mut self, name: &str) -> bool {
        self.0.get_clock(reference::<Watch3>(name)).unwrap()
    }

    fn interval(&mut self, name: &str) -> (f64, Qualifier) {
        let reference = reference::<Watch3>(name);
        let answer = self.0.interval(reference).unwrap();
        self.0.intervals_are_known(fmu::testing::calls::Function::GetIntervalDecimal, &[reference]).unwrap();
        answer
    }

    fn integer(&mut self, name: &str) -> i32 {
        i32::of(
            self.0.get_number(fmu::testing::calls::Function::GetInteger, i32::SIZE, reference::<Watch3>(name)).unwrap(),
        )
    }

    /// Ends the event and takes a step.
    fn step_from_event(&mut self, step: f64) -> Result<(), CallError> {
        self.0.new_discrete_states().unwrap();
        self.0.enter_step_mode().unwrap();
        self.step(step)
    }
}

trait Setup {
    fn setup(&mut self, start: f64);
}

impl<M: fmu::testing::runner::Model> Setup for Instance<M> {
    fn setup(&mut self, start: f64) {
        let function = fmu::testing::calls::Function::EnterInitializationMode;
        self.set_experiment(function, start, None, None).unwrap();
        self.enter_initialization().unwrap();
    }
}

/// A master: activates each clock when it is due. Calls `seen` with the time, the names of the active clocks, and the
/// FMU in Event Mode.
fn simulate(fmu: &mut Clocked, stop: f64, mut seen: impl FnMut(f64, &[&'static str], &mut Clocked)) {
    let clocks = ["control", "slow", "watchdog", "pulse"];
    let mut due = [0.0, 0.5, f64::INFINITY, fmu.interval("pulse").0];
    loop {
        let time = fmu.0.time();
        let active: Vec<_> = (0..4).filter(|&clock| (due[clock] - time).abs() < 1e-9).collect();
        let names: Vec<_> = active.iter().map(|&clock| clocks[clock]).collect();
        for name in &names {
            fmu.activate(name, true).unwrap();
        }
        seen(time, &names, fmu);
        fmu.0.new_discrete_states().unwrap();
        for &clock in &active {
            due[clock] = f64::INFINITY;
            if clock < 2 {
                due[clock] = time + fmu.interval(clocks[clock]).0;
            }
        }
        for clock in 2..4 {
            let (interval, qualifier) = fmu.interval(clocks[clock]);
            if qualifier == Qualifier::Changed {
                due[clock] = time + interval;
            }
        }
        let next = due.into_iter().fold(stop, f64::min);
        if next <= time + 1e-9 && next < stop {
            continue;
        }
        if time >= stop {
            break;
        }
        fmu.0.enter_step_mode().unwrap();
        fmu.step(next - time).unwrap();
        fmu.0.enter_event_mode().unwrap();
    }
}

#[test]
fn clocks_tick_at_the_times_that_the_standard_defines() {
    let mut fmu = Clocked::in_event_mode(&[]);
    let mut times: [Vec<f64>; 4] = Default::default();
    simulate(&mut fmu, 1.0, |time, active, fmu| {
        for (list, name) in times.iter_mut().zip(["control", "slow", "watchdog", "pulse"]) {
            if active.contains(&name) {
                list.push(time);
            }
        }
        assert_eq!(fmu.integer("ticks"), (time * 10.0 + 1e-6).floor() as i32 + 1);
    });
    let close = |found: &[f64], expected: &[f64]| {
        found.len() == expected.len() && found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12)
    };
    let tenths: Vec<_> = (0..=10).map(|n| f64::from(n) / 10.0).collect();
    assert!(close(&times[0], &tenths), "{:?}", times[0]);
    assert!(close(&times[1], &[0.5, 0.75, 1.0]), "{:?}", times[1]);
    assert!(times[2].is_empty());
    // Triangular numbers of eighths.
    assert!(close(&times[3], &[0.125, 0.375, 0.75]), "{:?}", times[3]);
}

#[test]
fn a_countdown_clock_ticks_when_it_was_started() {
    let mut fmu = Clocked::in_event_mode(&[("delay", 0.04)]);
    assert_eq!(fmu.interval("watchdog"), (0.0, Qualifier::NotYetKnown));
    fmu.activate("control", true).unwrap();
    fmu.0.new_discrete_states().unwrap();
    assert_eq!(fmu.interval("watchdog"), (0.04, Qualifier::Changed));
    fmu.0.new_discrete_states().unwrap();
    assert_eq!(fmu.interval("watchdog"), (0.04, Qualifier::Unchanged));
    fmu.0.enter_step_mode().unwrap();
    let message = error_of(fmu.step(0.1));
    let expected =
        "fmi3DoStep: the clock 'watchdog' ticks at 0.04 s: end the step there, and activate the clock in Event Mode";
    assert_eq!(message, expected);
    // Nothing has changed.
    fmu.step(0.04).unwrap();
    fmu.0.enter_event_mode().unwrap();
    fmu.activate("watchdog", true).unwrap();
    assert_eq!(fmu.get("alarm_time"), 0.04);
    fmu.0.new_discrete_states().unwrap();
    assert_eq!(fmu.interval("watchdog"), (0.0, Qualifier::NotYetKnown));
    let message = error_of(fmu.activate("watchdog", true));
    assert_eq!(message, "fmi3SetClock: the clock 'watchdog' was not started; it is 0.04 s now");
}

/// Section 2.2.8, algebraic loops: an input that is set again replaces the result, and the state is that from before
/// the event.
#[test]
fn a_part_starts_from_the_state_before_the_event() {
    let mut fmu = Clocked::in_event_mode(&[]);
    fmu.activate("control", true).unwrap();
    for reference in [1.0, 20.0, 3.0] {
        fmu.set("reference", reference).unwrap();
        assert_eq!(fmu.get("voltage"), 0.1 * reference);
        assert_eq!(fmu.integer("ticks"), 1);
        assert_eq!(fmu.clock("limit"), reference > 10.0);
    }
    fmu.step_from_event(0.1).unwrap();
    fmu.0.enter_event_mode().unwrap();
    assert!(!fmu.clock("limit") && !fmu.clock("control"), "a clock ticks at one event");
    fmu.activate("control", true).unwrap();
    assert_eq!(fmu.get("voltage"), 0.1 * 3.0 + 0.1 * 3.0);
}

#[test]
fn a_deactivated_clock_has_no_effect() {
    let mut fmu = Clocked::in_event_mode(&[("reference", 20.0), ("delay", 0.01)]);
    fmu.activate("control", true).unwrap();
    assert!(fmu.clock("limit"));
    fmu.activate("control", false).unwrap();
    assert!(!fmu.clock("limit"));
    assert_eq!(fmu.integer("ticks"), 0);
    fmu.0.new_discrete_states().unwrap();
    assert_eq!(fmu.interval("watchdog").1, Qualifier::NotYetKnown);
    fmu.activate("control", true).unwrap();
    assert_eq!(fmu.integer("ticks"), 1, "it is still due");
}

#[test]
fn clocked_variables_are_accessible_while_their_clock_is_active() {
    let mut fmu = Clocked::in_event_mode(&[]);
    let expected = |function: &str, name: &str, mode: &str| {
        format!(
            "{function}: '{name}' can be read and set only in Event Mode while its clock 'control' is active; the instance is \
             in {mode}"
        )
    };
    assert_eq!(error_of(fmu.try_get("voltage")), expected("fmi3GetFloat64", "voltage", "Event Mode"));
    assert_eq!(error_of(fmu.set("reference", 1.0)), expected("fmi3SetFloat64", "reference", "Event Mode"));
    fmu.get("alarm_time");
    fmu.set("delay", 0.0).unwrap();
    fmu.activate("control", true).unwrap();
    fmu.set("reference", 1.0).unwrap();
    assert_eq!(fmu.get("voltage"), 0.1);
    assert_eq!(fmu.integer("all"), 1, "one of its clocks is active");
    fmu.step_from_event(0.1).unwrap();
    assert_eq!(error_of(fmu.try_get("voltage")), expected("fmi3GetFloat64", "voltage", "Step Mode"));
}

#[test]
fn only_a_clock_that_is_due_can_be_activated() {
    let mut fmu = Clocked::in_event_mode(&[]);
    let message = error_of(fmu.activate("slow", true));
    assert_eq!(message, "fmi3SetClock: the clock 'slow' ticks next at 0.5 s; it is 0 s now");
    fmu.activate("control", true).unwrap();
    fmu.0.new_discrete_states().unwrap();
    // Section 2.3.5: a periodic clock ticks only once at an event.
    let message = error_of(fmu.activate("control", true));
    assert_eq!(message, "fmi3SetClock: the clock 'control' ticks next at 0.1 s; it is 0 s now");
    let message = error_of(fmu.activate("limit", true));
    assert_eq!(message, "fmi3SetClock: 'limit' is an output clock, which only the model activates");
    let message = error_of(fmu.activate("delay", true));
    assert!(message.contains("must be a variable of type Clock, it is 'delay' of type Float64"), "{message}");
}

#[test]
fn intervals_and_shifts_can_be_read() {
    let mut fmu = Clocked::in_event_mode(&[("slow_time", 0.5)]);
    let of = reference::<Watch3>;
    assert_eq!(fmu.interval("slow"), (0.5, Qualifier::Changed));
    assert_eq!(fmu.interval("pulse"), (0.125, Qualifier::Changed));
    assert_eq!(fmu.0.interval_fraction(of("control")).unwrap().0, (1, 10));
    let message = error_of(fmu.0.interval_fraction(of("slow")));
    assert_eq!(
        message,
        "fmi3GetIntervalFraction: the interval of the clock 'slow' is not a fraction: use the function for decimals"
    );
    let function = fmu::testing::calls::Function::SetIntervalDecimal;
    let span = fmu::testing::clocks::Span::Decimal(1.0);
    let message = error_of(fmu.0.set_timing(function, &[of("slow")], std::iter::once(span)));
    assert_eq!(
        message,
        "fmi3SetIntervalDecimal: the interval of the clock 'slow' cannot be set: set the parameter 'slow_time' instead"
    );
    // A tunable parameter changes the interval. The next tick is one new interval after the last one.
    fmu.0.new_discrete_states().unwrap();
    assert_eq!(fmu.interval("slow").1, Qualifier::Unchanged);
    fmu.set("slow_time", 0.2).unwrap();
    fmu.0.new_discrete_states().unwrap();
    assert_eq!(fmu.interval("slow"), (0.2, Qualifier::Changed));
    let mut initializing =
        Instance::<<Watch3 as Export>::Model>::new(Protocol::CS3, Watch3::description(), PathBuf::new());
    initializing.setup(0.0);
    assert_eq!(initializing.shift(of("slow")).unwrap(), 0.5);
    assert_eq!(initializing.shift_fraction(of("control")).unwrap(), (0, 10));
    let message = error_of(initializing.shift(of("pulse")));
    assert_eq!(message, "fmi3GetShiftDecimal: 'pulse' is not a periodic clock, and has no shift");
}

/// An importer without clocks gets the same results: at each communication point, the values of a master that activates
/// the clocks.
#[test]
fn without_event_mode_clocks_tick_inside_the_steps() {
    let inputs = [("reference", 3.0), ("delay", 0.03)];
    let names = ["alarm_time", "pulse_time"];
    let mut expected = Vec::new();
    let mut master = Clocked::in_event_mode(&inputs);
    simulate(&mut master, 1.0, |time, active, fmu| {
        let reals = names.map(|name| fmu.get(name).to_bits());
        let voltage = active.contains(&"control").then(|| fmu.get("voltage").to_bits());
        expected.push((time, fmu.integer("ticks"), reals, voltage));
    });
    for step in [0.005, 0.025, 0.1, 0.5] {
        let mut fmu = Clocked::starting(0.0, &inputs);
        let mut time = 0.0;
        while time < 1.0 - 1e-9 {
            // The ticks at the end of a step belong to the next one.
            fmu.step(step).unwrap();
            time = fmu.0.time();
            let (_, ticks, reals, _) = expected.iter().rev().find(|(of, ..)| *of < time - 1e-9).unwrap();
            assert_eq!(fmu.integer("ticks"), *ticks, "at {time} s");
            assert_eq!(names.map(|name| fmu.get(name).to_bits()), *reals, "at {time} s");
            let voltage = expected.iter().rev().filter(|(of, ..)| *of < time - 1e-9).find_map(|(.., voltage)| *voltage);
            assert_eq!(Some(fmu.get("voltage").to_bits()), voltage, "at {time} s");
        }
        assert_eq!(fmu.integer("ticks"), 10);
    }
}

/// FMI 2.0 has no clocks: the same model runs with the same results, and an output clock is a Boolean.
#[test]
fn in_fmi_2_clocks_tick_inside_the_steps() {
    let mut two = Fmu::<Watch>::starting(0.0, &[("reference", 3.0)]);
    let mut three = Clocked::starting(0.0, &[("reference", 3.0)]);
    for step in 0..10 {
        two.step(0.1).unwrap();
        three.step(0.1).unwrap();
        assert_eq!(two.get("voltage").to_bits(), three.get("voltage").to_bits());
        // 0.3 V per tick: above 1 V from the 4th on.
        assert_eq!(two.0.get_boolean(reference::<Watch>("limit")).unwrap(), step >= 3);
    }
    let xml = Description::of::<<Watch as Export>::Model>(Format::FMI2, "".as_ref()).xml;
    assert!(xml.contains(r#"<ScalarVariable name="limit""#) && !xml.contains(r#"name="control""#), "{xml}");
    let of = |name| format!(r#"<ScalarVariable name="{name}" valueReference="{}""#, reference::<Watch>("limit"));
    let alias = &xml[xml.find(&of("exceeded")).unwrap_or_else(|| panic!("{xml}"))..];
    assert!(alias.lines().nth(1).unwrap().trim() == "<Boolean/>" && alias.contains(r#"causality="local""#), "{alias}");
}

/// The state that is saved while clocks are active contains neither their results nor forgets that they are active.
#[test]
fn states_can_be_saved_while_clocks_are_active() {
    let inputs = [("reference", 20.0), ("delay", 0.03)];
    for is_read in [false, true] {
        let mut fmu = Clocked::in_event_mode(&inputs);
        fmu.activate("control", true).unwrap();
        if is_read {
            assert_eq!(fmu.get("voltage"), 2.0);
        }
        let bytes = fmu.bytes();
        let mut other = Clocked::in_event_mode(&[]);
        let snapshot = other.0.deserialize(&bytes).unwrap();
        other.0.restore(&snapshot).unwrap();
        assert_eq!(other.bytes(), bytes, "reading changes no state");
        for fmu in [&mut fmu, &mut other] {
            assert!(fmu.clock("control") && fmu.clock("limit"));
            assert_eq!((fmu.get("voltage"), fmu.integer("ticks")), (2.0, 1));
            fmu.step_from_event(0.03).unwrap();
            fmu.0.enter_event_mode().unwrap();
            fmu.activate("watchdog", true).unwrap();
            assert_eq!(fmu.get("alarm_time"), 0.03);
        }
        assert_eq!(fmu.bytes(), other.bytes());
    }
}

#[test]
fn clocks_are_described() {
    let xml = Description::of::<<Watch as Export>::Model>(Format::FMI3, "".as_ref()).xml;
    let of = reference::<Watch3>;
    let [control, slow, watchdog, pulse] = ["control", "slow", "watchdog", "pulse"].map(of);
    for expected in [
        r#"hasEventMode="true""#.to_owned(),
        format!(
            r#"<Clock name="control" valueReference="{control}" description="Integral control" causality="input" canBeDeactivated="true" intervalVariability="constant" intervalDecimal="0.1" supportsFraction="true" resolution="10" intervalCounter="1"/>"#
        ),
        format!(
            r#"<Clock name="slow" valueReference="{slow}" description="Slow part" causality="input" canBeDeactivated="true" intervalVariability="tunable"/>"#
        ),
        format!(
            r#"<Clock name="watchdog" valueReference="{watchdog}" description="Alarm" causality="input" canBeDeactivated="true" intervalVariability="countdown"/>"#
        ),
        r#"canBeDeactivated="true" intervalVariability="changing"/>"#.to_owned(),
        format!(
            r#"<Clock name="limit" valueReference="{}" description="Ticks when the voltage exceeds 1 V" causality="output" clocks="{control} {slow} {watchdog} {pulse}" intervalVariability="triggered">
      <Alias name="exceeded" description="Another name"/>
    </Clock>"#,
            of("limit")
        ),
        format!(r#"causality="input" variability="discrete" unit="rad/s" clocks="{control}" start="0.0"/>"#),
        format!(r#"variability="discrete" initial="exact" unit="V" clocks="{control}" start="0.0"/>"#),
        format!(
            r#"<Output valueReference="{}" dependencies="{} {} {} {control}"/>"#,
            of("voltage"),
            Watch3::description().layout.end,
            of("reference"),
            of("delay")
        ),
    ] {
        assert!(xml.contains(&expected), "{expected}\n{xml}");
    }
    assert!(!xml.contains("<ModelExchange") && !xml.contains("InitialUnknown"), "{xml}");
}

#[test]
fn events_do_not_allocate() {
    let mut fmu = Clocked::in_event_mode(&[("reference", 1.0)]);
    let [control, reference, voltage, limit] = ["control", "reference", "voltage", "limit"].map(reference::<Watch3>);
    let mut value = [0.0];
    let count = allocations(|| {
        for second in 0..100 {
            fmu.0.set_clock(&[control], std::iter::once(true)).unwrap();
            fmu.0.set_real(&[reference], &[f64::from(second)]).unwrap();
            fmu.0.get_real(&[voltage], &mut value).unwrap();
            fmu.0.get_clock(limit).unwrap();
            fmu.0.set_clock(&[control], std::iter::once(false)).unwrap();
        }
        fmu.0.set_clock(&[control], std::iter::once(true)).unwrap();
        fmu.0.new_discrete_states().unwrap();
        fmu.0.enter_step_mode().unwrap();
        fmu.0.do_step(0.0, 0.1).unwrap();
        fmu.0.enter_event_mode().unwrap();
    });
    assert_eq!(count, 0);
    let mut inside = Clocked::starting(0.0, &[("reference", 1.0)]);
    let count = allocations(|| (0..100).for_each(|step| inside.0.do_step(0.05 * f64::from(step), 0.05).unwrap()));
    assert_eq!(count, 0);
}

/// Two clocks at the same time: the first restarts the second, which is due as well. It ticks now and, restarted,
/// again.
#[test]
fn a_clock_that_is_restarted_when_it_is_due_ticks_twice() {
    let inputs = [("delay", 0.1)];
    let mut inside = Clocked::starting(0.0, &inputs);
    let mut alarms = Vec::new();
    for _ in 0..4 {
        inside.step(0.1).unwrap();
        alarms.push((inside.get("alarm_time"), inside.integer("ticks")));
    }
    // The alarm that `control` starts at each tick is due at the next tick of `control`.
    assert_eq!(alarms, [(0.0, 1), (0.1, 2), (0.2, 3), (0.1 + 0.2, 4)]);
    let mut master = Clocked::in_event_mode(&inputs);
    let mut seen = Vec::new();
    simulate(&mut master, 0.3, |_, active, fmu| {
        if active.contains(&"control") {
            seen.push((fmu.get("alarm_time"), fmu.integer("ticks")));
        }
    });
    assert_eq!(seen, alarms);
}

/// An interval that was tuned in Step Mode is reported in the next event; a tick that would be in the past is due at
/// once.
#[test]
fn intervals_can_be_tuned_between_events() {
    let mut fmu = Clocked::in_event_mode(&[]);
    fmu.interval("slow");
    fmu.activate("control", true).unwrap();
    fmu.0.new_discrete_states().unwrap();
    fmu.0.enter_step_mode().unwrap();
    fmu.set("slow_time", 0.125).unwrap();
    fmu.step(0.1).unwrap();
    fmu.0.enter_event_mode().unwrap();
    fmu.0.new_discrete_states().unwrap();
    assert_eq!(fmu.interval("slow"), (0.125, Qualifier::Changed));
    assert_eq!(fmu.interval("slow"), (0.125, Qualifier::Unchanged));
    // A failed update changes nothing and can be repeated.
    fmu.activate("control", true).unwrap();
    let ticks = fmu.integer("ticks");
    fmu.0.new_discrete_states().unwrap();
    assert_eq!((ticks, fmu.integer("ticks")), (2, 2));
}

#[derive(Outputs)]
pub(crate) struct SeenOutputs {
    /// Number of ticks
    ticks: i32,
    /// Number of ticks at which the clock had fired before
    seen: i32,
    /// Ticks at every third tick
    third: Clock,
}

#[derive(Parameters)]
pub(crate) struct Seen {}

/// Fires a clock, and notes whether it has fired before
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Seen {
    type Inputs = ();
    type Outputs = SeenOutputs;
    type State = ();

    /// Fires at every third tick
    #[clock(interval = 1 / 10)]
    fn sample(&self, tick: Tick<Self>) {
        let outputs = tick.outputs;
        outputs.seen += i32::from(outputs.third.has_fired());
        if outputs.ticks % 3 == 0 {
            outputs.third.fire();
        }
        outputs.ticks += 1;
    }
}

/// A clock ticks at one event (FMI 3.0, section 2.2.8). An importer without clocks sees after a step that it has ticked
/// at any event of the step.
#[test]
fn an_output_clock_ticks_at_one_event_of_a_step() {
    let mut fmu = Fmu::<Seen>::starting(0.0, &[]);
    // Ticks at 0, 0.1 and 0.2 s, then at 0.3 s, 0.4 and 0.5 s, and at 0.6 s.
    for (step, ticks, third) in [(0.3, 3, true), (0.1, 4, true), (0.2, 6, false), (0.1, 7, true)] {
        fmu.step(step).unwrap();
        let [count, seen] = ["ticks", "seen"].map(|name| fmu.0.get_integer(reference::<Seen>(name)).unwrap());
        assert_eq!((count, seen), (ticks, 0));
        assert_eq!(fmu.0.get_boolean(reference::<Seen>("third")).unwrap(), third, "after {ticks} ticks");
    }
}

#[derive(Parameters)]
struct Pump {
    /// Time between strokes (s)
    #[var(start = 0.25, positive)]
    period: f64,
}

#[derive(Derived)]
struct Rate {
    /// Number of strokes in a second (Hz)
    #[var]
    rate: f64,
}

/// Pump
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Pump {
    type Derived = Rate;
    fn derived(&self) -> Result<Rate, String> {
        Ok(Rate { rate: 1.0 / self.period })
    }

    /// Stroke
    #[clock(changing, interval_of = "period")]
    fn stroke(&self, _: Tick<Self>) {}
}

/// Reference: the same instance without the read.
#[test]
fn a_read_before_the_start_time_is_known_does_not_change_intervals() {
    for is_read in [false, true] {
        let mut pump = Instance::<<Pump as Export>::Model>::new(Protocol::CS3, Pump::description(), PathBuf::new());
        if is_read {
            pump.get_real(&[reference::<Pump>("rate")], &mut [0.0]).unwrap();
        }
        pump.setup(1000.0);
        let stroke = Pump::description().layout.variables.iter().position(|v| v.declaration.name == "stroke").unwrap();
        let stroke = Pump::description().layout.variables[stroke].reference;
        assert_eq!(pump.interval(stroke).unwrap(), (0.25, Qualifier::Changed));
    }
}

/// In FMI 2.0, outputs of a model with clocks are held, but a calculated parameter depends on the parameters.
#[test]
fn calculated_parameters_of_a_model_with_clocks_have_dependencies() {
    let xml = Description::of::<<Pump as Export>::Model>(Format::FMI2, "".as_ref()).xml;
    assert!(xml.contains(r#"<Unknown index="2" dependencies="1"/>"#), "{xml}");
}

/// Reference: the same calls without the read, after which nothing was evaluated when the interval was asked for.
#[test]
fn an_interval_is_new_once_whatever_was_read() {
    for is_read in [false, true] {
        let mut fmu = Clocked::in_event_mode(&[]);
        fmu.activate("control", true).unwrap();
        if is_read {
            fmu.integer("ticks");
        }
        assert_eq!(fmu.interval("pulse"), (0.125, Qualifier::Changed));
        fmu.0.new_discrete_states().unwrap();
        assert_eq!(fmu.interval("pulse"), (0.125, Qualifier::Unchanged));
        assert_eq!(fmu.integer("ticks"), 1);
    }
}
