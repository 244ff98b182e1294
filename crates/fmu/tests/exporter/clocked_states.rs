//! Clocked states. Reference: FMI 3.0.2, sections 2.2.8 (clocked states and their previous values), 2.3.5 (Event Mode),
//! 2.4.7.4 (attribute `previous`) and 2.4.8 (ClockedState); sums in closed form.

use std::path::PathBuf;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::{Function, Protocol};
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::Instance;
use fmu::testing::number::Number;

use crate::allocations::allocations;
use crate::models::{Fmu, error_of, exported, reference};

/// Method of a filter
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Default)]
enum Method {
    /// Sum
    #[default]
    Sum,
    /// Mean
    Mean,
}

#[derive(Parameters)]
struct Sums {
    /// Start value of the sum (m)
    #[var(start = 5.0)]
    offset: f64,
}

#[derive(Inputs)]
struct Summand {
    /// Summand (m)
    #[var(clock = "fast")]
    value: f64,
}

#[derive(Outputs)]
struct Result {
    /// Twice the sum (m)
    #[var(clock = "fast")]
    double: f64,
}

#[derive(DiscreteState, Clone, Default)]
struct State {
    /// Sum (m)
    #[var(clock = "fast", nominal = 10.0)]
    sum: f64,
    /// Ticks of each clock
    #[var("ticks", clock = ["fast", "slow"], elements = ["fast", "slow"])]
    counts: [u16; 2],
    /// Last summands (m)
    #[var(clock = "fast", always_finite)]
    last: [f64; 2],
    /// Method
    #[var(clock = "slow")]
    method: Method,
    /// Bytes
    #[var(clock = "slow", mime = "text/plain")]
    bytes: Bytes<4>,
    hidden: f64,
}

/// Sums its input
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Sums {
    type Inputs = Summand;
    type Outputs = Result;
    type State = State;

    fn initial_state(&self, (): &()) -> State {
        State { sum: self.offset, ..State::default() }
    }

    /// Adds the input
    #[clock(interval = 1 / 10, priority = 0)]
    fn fast(&self, tick: Tick<Self>) {
        let State { sum, counts, last, hidden, .. } = tick.state;
        *sum += tick.inputs.value;
        *last = [tick.inputs.value, last[0]];
        counts[0] += 1;
        *hidden += 1.0;
        tick.outputs.double = 2.0 * *sum;
    }

    /// Chooses the other method
    #[clock(triggered, priority = 1)]
    fn slow(&self, tick: Tick<Self>) {
        tick.state.counts[1] += 1;
        tick.state.method = if tick.state.method == Method::Sum { Method::Mean } else { Method::Sum };
        tick.state.bytes.set(&[1, 2]);
    }
}

exported! {
    Sums3: Sums, Format::FMI3;
}

type Instance3 = Fmu<Sums3>;

impl Instance3 {
    fn in_event_mode(offset: f64) -> Self {
        let mut fmu = Self(Instance::new(Protocol::CS3, Sums3::description(), PathBuf::new()).with_event_mode());
        fmu.0.set_experiment(Function::EnterInitializationMode, 0.0, None, None).unwrap();
        fmu.set("offset", offset).unwrap();
        fmu.0.enter_initialization().unwrap();
        assert_eq!(fmu.sums(), [offset; 2]);
        fmu.0.exit_initialization().unwrap();
        fmu
    }

    fn activate(&mut self, clock: &str, is_active: bool) {
        self.0.set_clock(&[reference::<Sums3>(clock)], std::iter::once(is_active)).unwrap();
    }

    /// The sum and its previous value.
    fn sums(&mut self) -> [f64; 2] {
        ["sum", "previous.sum"].map(|name| self.get(name))
    }

    fn number<N: Number>(&mut self, function: Function, name: &str) -> N {
        N::of(self.0.get_number(function, N::SIZE, reference::<Sums3>(name)).unwrap())
    }

    fn step_from_event(&mut self) {
        self.0.new_discrete_states().unwrap();
        self.0.enter_step_mode().unwrap();
        self.step(0.1).unwrap();
        self.0.enter_event_mode().unwrap();
    }
}

#[test]
fn the_previous_value_is_that_before_the_tick() {
    let mut fmu = Instance3::in_event_mode(5.0);
    fmu.activate("fast", true);
    for value in [1.0, 20.0, 3.0] {
        fmu.set("value", value).unwrap();
        assert_eq!((fmu.sums(), fmu.get("double")), ([5.0 + value, 5.0], 2.0 * (5.0 + value)));
        assert_eq!([fmu.get("last[1]"), fmu.get("previous.last[1]")], [value, 0.0]);
    }
    // Section 2.3.5: a clock that is deactivated again leaves the values from before.
    fmu.activate("fast", false);
    fmu.activate("fast", true);
    assert_eq!(fmu.sums(), [8.0, 5.0]);
    for before in [8.0, 11.0, 14.0] {
        fmu.step_from_event();
        fmu.activate("fast", true);
        assert_eq!(fmu.sums(), [before + 3.0, before]);
        assert_eq!([fmu.get("last[2]"), fmu.get("previous.last[2]")], [3.0, if before == 8.0 { 0.0 } else { 3.0 }]);
    }
}

#[test]
fn every_type_has_previous_values() {
    let mut fmu = Instance3::in_event_mode(0.0);
    fmu.activate("fast", true);
    fmu.activate("slow", true);
    for (name, value) in [("ticks.fast", 1), ("ticks.slow", 1), ("previous.ticks.fast", 0), ("previous.ticks.slow", 0)]
    {
        assert_eq!(fmu.number::<u16>(Function::GetUInt16, name), value, "{name}");
    }
    assert_eq!(fmu.number::<i32>(Function::GetInteger, "method"), Method::Mean as i32);
    assert_eq!(fmu.number::<i32>(Function::GetInteger, "previous.method"), Method::Sum as i32);
    assert_eq!(fmu.0.get_binary(reference::<Sums3>("bytes")).unwrap(), [1, 2]);
    assert!(fmu.0.get_binary(reference::<Sums3>("previous.bytes")).unwrap().is_empty());
}

#[test]
fn clocked_states_are_accessible_while_their_clock_is_active_and_never_settable() {
    let mut fmu = Instance3::in_event_mode(0.0);
    fmu.activate("slow", true);
    for name in ["sum", "previous.sum"] {
        let message = error_of(fmu.try_get(name));
        let rule =
            format!("fmi3GetFloat64: '{name}' can be read and set only in Event Mode while its clock 'fast' is active");
        assert!(message.starts_with(&rule), "{message}");
    }
    fmu.activate("fast", true);
    for name in ["sum", "previous.sum"] {
        let message = error_of(fmu.set(name, 1.0));
        assert!(message.contains("a clock or a clocked state") && message.contains("never settable"), "{message}");
    }
    assert_eq!(fmu.sums(), [0.0; 2]);
}

/// An importer without clocks reads the values after the ticks in the step: 5 + 3 n.
#[test]
fn without_event_mode_clocked_states_are_readable_between_steps() {
    let mut fmu = Instance3::starting(0.0, &[("value", 3.0)]);
    for ticks in [1.0, 2.0, 3.0] {
        fmu.step(0.1).unwrap();
        assert_eq!(fmu.sums(), [5.0 + 3.0 * ticks; 2]);
    }
}

/// Reference: the instance that saved the state.
#[test]
fn saved_states_contain_clocked_states() {
    for is_read in [false, true] {
        let mut fmu = Instance3::in_event_mode(2.0);
        fmu.activate("fast", true);
        fmu.set("value", 4.0).unwrap();
        fmu.step_from_event();
        fmu.activate("fast", true);
        if is_read {
            fmu.sums();
        }
        let bytes = fmu.bytes();
        let mut other = Instance3::in_event_mode(0.0);
        other.0.restore(&other.0.deserialize(&bytes).unwrap()).unwrap();
        assert_eq!(other.bytes(), bytes);
        assert_eq!([fmu.sums(), other.sums()], [[10.0, 6.0]; 2]);
        assert_eq!(other.bytes(), bytes, "reading changes no state");
    }
}

#[test]
fn clocked_states_are_described() {
    let xml = Description::of::<<Sums as Export>::Model>(Format::FMI3, "".as_ref()).xml;
    let of = reference::<Sums3>;
    let [fast, slow, sum, previous, value, end] =
        [of("fast"), of("slow"), of("sum"), of("previous.sum"), of("value"), Sums3::description().layout.end];
    let all: Vec<_> = ["sum", "last[1]", "last[2]", "ticks.fast", "ticks.slow", "method", "bytes"]
        .map(|name| of(&format!("previous.{name}")).to_string())
        .into();
    let all = all.join(" ");
    for expected in [
        format!(
            r#"<Float64 name="sum" valueReference="{sum}" description="Sum" causality="local" variability="discrete" initial="calculated" unit="m" nominal="10.0" clocks="{fast}" previous="{previous}"/>"#
        ),
        format!(
            r#"<Float64 name="previous.sum" valueReference="{previous}" description="Sum (before the tick)" causality="local" variability="discrete" initial="calculated" unit="m" nominal="10.0" clocks="{fast}"/>"#
        ),
        format!(r#"initial="calculated" clocks="{fast} {slow}" previous="{}"/>"#, of("previous.ticks.slow")),
        format!(r#"<Binary name="previous.bytes" valueReference="{}""#, of("previous.bytes")),
        r#"variableNamingConvention="structured""#.to_owned(),
    ] {
        assert!(xml.contains(&expected), "{expected}\n{xml}");
    }
    let list = |name: &str| xml.lines().find(|line| line.contains(&format!("<{name} valueReference=\"{sum}\"")));
    let listed = list("ClockedState").unwrap_or_else(|| panic!("{xml}"));
    let dependencies: Vec<_> = listed.split('"').nth(3).unwrap().split(' ').collect();
    for known in format!("{end} {value} {all} {fast}").split(' ') {
        assert!(dependencies.contains(&known), "{known}: {listed}");
    }
    assert_eq!(xml.matches("<ClockedState ").count(), 7);
    assert!(list("Output").is_none() && !xml.contains("InitialUnknown"), "{xml}");
    let arrays = Format { arrays: true, ..Format::FMI3 };
    let xml = Description::of::<<Sums as Export>::Model>(arrays, "".as_ref()).xml;
    assert!(xml.contains(r#"name="last""#) && xml.contains(r#"name="previous.last""#), "{xml}");
    let xml = Description::of::<<Sums as Export>::Model>(Format::FMI2, "".as_ref()).xml;
    assert!(!xml.contains("previous") && !xml.contains(r#"name="sum""#), "{xml}");
}

#[test]
fn clocked_states_do_not_allocate() {
    let mut fmu = Instance3::in_event_mode(0.0);
    let references = ["sum", "previous.sum"].map(reference::<Sums3>);
    let fast = reference::<Sums3>("fast");
    let count = allocations(|| {
        fmu.0.set_clock(&[fast], std::iter::once(true)).unwrap();
        fmu.0.get_real(&references, &mut [0.0; 2]).unwrap();
        fmu.0.new_discrete_states().unwrap();
    });
    assert_eq!(count, 0);
}
