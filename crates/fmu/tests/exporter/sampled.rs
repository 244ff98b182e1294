//! Discrete-time models with the clock `sample`, as `cargo fmu pack --clocks` exports them. Reference: the same models
//! without the clock, and FMI 3.0.2, sections 2.2.8 (clocks), 2.3.5 (Event Mode) and 2.4.7.4 (clocked variables).

use std::path::PathBuf;

use fmu::prelude::*;
use fmu::testing::abi::{Export, Library};
use fmu::testing::calls::{Function, Mode, Protocol};
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::{CallError, Instance, Qualifier};
use fmu::testing::number::Number;
use fmu::testing::runner::{ClockedModel, DiscreteModel};

use crate::models::{Fmu, error_of, reference};

#[derive(Parameters)]
struct Tracker {
    /// Gain (1/s)
    #[var(start = 0.7, tunable)]
    gain: f64,
}

#[derive(Inputs)]
struct U {
    /// Reference (m)
    #[var(start = 0.25)]
    target: f64,
    /// Active
    #[var(start = true)]
    on: bool,
}

#[derive(Outputs)]
struct Y {
    /// Position (m)
    #[var(start = -1.0)]
    position: f64,
    /// Number of samples
    samples: i32,
    /// Version of the law
    #[var(constant = 3)]
    version: i32,
}

#[derive(DiscreteState, Clone, Default)]
struct X {
    position: f64,
    samples: i32,
}

/// Follows a reference
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Tracker {
    type Inputs = U;
    type Outputs = Y;
    type State = X;

    fn update(&self, sample: Sample<Self>) -> Y {
        let Sample { time, state, inputs, .. } = sample;
        if inputs.on {
            state.position += self.gain * (inputs.target - state.position) + 1e-3 * time;
        }
        state.samples += 1;
        Y { position: state.position, samples: state.samples, version: 3 }
    }
}

#[derive(Parameters)]
struct Wave {
    /// Height (m)
    #[var(start = 2.0)]
    height: f64,
    #[var(SAMPLE_TIME, start = 0.125)]
    sample_time: f64,
}

#[derive(Outputs)]
struct Level {
    /// Level (m)
    level: f64,
}

/// Source of a level
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Wave {
    type Outputs = Level;
    const SOURCE: Option<Influence> = Some(|_, parameter| parameter == "height");

    fn update(&self, sample: Sample<Self>) -> Level {
        Level { level: self.height + sample.time + self.sample_time }
    }
}

#[derive(Parameters)]
struct Taken;
#[derive(Outputs)]
struct TakenName {
    /// Value (1)
    sample: f64,
}
/// Has a variable with the name of the clock
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Taken {
    type Outputs = TakenName;
    fn update(&self, _: Sample<Self>) -> TakenName {
        TakenName { sample: 1.0 }
    }
}

/// Without the clock, with it, and the same for a source.
macro_rules! exported {
    ($($name:ident: $model:ty;)*) => {$(
        struct $name;
        impl Export for $name {
            type Model = $model;
            const FORMAT: Format = Format::FMI3;
            fn library() -> &'static Library {
                static LIBRARY: Library = Library::new();
                &LIBRARY
            }
        }
    )*};
}
exported! {
    Plain: DiscreteModel<Tracker>;
    Sampled: ClockedModel<Tracker>;
    PlainWave: DiscreteModel<Wave>;
    SampledWave: ClockedModel<Wave>;
}

fn initializing<E: Export>(protocol: Protocol, start: f64, values: &[(&str, f64)]) -> Fmu<E> {
    let mut fmu = Fmu(Instance::new(protocol, E::description(), PathBuf::new()));
    fmu.0.set_experiment(Function::EnterInitializationMode, start, None, None).unwrap();
    fmu.0.enter_initialization().unwrap();
    values.iter().for_each(|(name, value)| fmu.set(name, *value).unwrap());
    fmu
}

/// In Step Mode, for an importer without Event Mode.
fn stepping<E: Export>(start: f64, values: &[(&str, f64)]) -> Fmu<E> {
    let mut fmu = initializing::<E>(Protocol::CS3, start, values);
    fmu.0.exit_initialization().unwrap();
    fmu
}

/// In the first Event Mode.
fn in_event_mode<E: Export>(start: f64, values: &[(&str, f64)]) -> Fmu<E> {
    let mut fmu = initializing::<E>(Protocol::CS3, start, values);
    fmu.0 = fmu.0.with_event_mode();
    fmu.0.exit_initialization().unwrap();
    assert_eq!(fmu.0.mode(), Mode::Event);
    fmu
}

fn activate<E: Export>(fmu: &mut Fmu<E>) -> Result<(), CallError> {
    fmu.0.set_clock(&[reference::<E>("sample")], std::iter::once(true))
}

fn set_on<E: Export>(fmu: &mut Fmu<E>, on: bool) {
    fmu.set_boolean("on", on).unwrap();
}

/// Bits of the position, and the number of samples.
fn outputs<E: Export>(fmu: &mut Fmu<E>) -> (u64, i32) {
    let samples = fmu.0.get_number(Function::GetInteger, i32::SIZE, reference::<E>("samples")).unwrap();
    (fmu.get("position").to_bits(), i32::of(samples))
}

/// A different reference for each sample.
fn target(number: u32) -> f64 {
    (f64::from(number) * 0.37).sin()
}

/// Ends the event, advances to the next one, and enters its Event Mode.
fn to_next_event<E: Export>(fmu: &mut Fmu<E>, step: f64) -> Result<(), CallError> {
    fmu.0.new_discrete_states().unwrap();
    fmu.0.enter_step_mode().unwrap();
    fmu.step(step)?;
    fmu.0.enter_event_mode()
}

/// FMI 3.0.2, section 2.2.8: `fixed` without `intervalDecimal`, because the interval follows from a parameter. Section
/// 2.4.7.4: a clocked variable is discrete and lists its clocks; a constant has none.
#[test]
fn the_description_has_one_clock_to_which_all_inputs_and_outputs_belong() {
    let xml = &Sampled::description().xml;
    let clock = reference::<Sampled>("sample");
    let lines = |name: &str| xml.lines().find(|line| line.contains(&format!("name=\"{name}\""))).unwrap().to_owned();
    let expected = format!(
        "<Clock name=\"sample\" valueReference=\"{clock}\" description=\"Takes a sample\" causality=\"input\" \
         canBeDeactivated=\"true\" priority=\"0\" intervalVariability=\"fixed\"/>"
    );
    assert_eq!(lines("sample").trim(), expected);
    for name in ["target", "on", "position", "samples"] {
        let line = lines(name);
        assert!(line.contains(&format!(" clocks=\"{clock}\"")) && line.contains("variability=\"discrete\""), "{line}");
    }
    for name in ["version", "gain", "sample_time"] {
        assert!(!lines(name).contains("clocks="), "{}", lines(name));
    }
    assert_eq!(xml.matches("<Clock ").count(), 1);
    assert!(xml.contains("hasEventMode=\"true\"") && !xml.contains("<ModelExchange"), "{xml}");
    // Apart from the clock, the variables are those of the model without it, with the same value references.
    let names = |xml: &str| {
        let variables = xml.lines().filter(|line| line.contains("valueReference=") && line.contains("name="));
        let words = |line: &str| line.split_whitespace().take(3).map(str::to_owned).collect::<Vec<_>>();
        variables.map(words).filter(|words| words[0] != "<Clock").collect::<Vec<_>>()
    };
    let plain = Plain::description();
    let own = names(&plain.xml).into_iter().filter(|words| words[1] != "name=\"time\"");
    assert!(own.clone().count() >= 7);
    let found = names(xml);
    own.for_each(|words| assert!(found.contains(&words), "{words:?} in {found:?}"));
    assert_ne!(plain.guid, Sampled::description().guid);
}

/// Section 2.2.8: the importer asks for interval and shift in Initialization Mode.
#[test]
fn the_interval_is_the_sample_time() {
    let clock = reference::<Sampled>("sample");
    for sample_time in [0.1, 0.03] {
        let mut fmu = initializing::<Sampled>(Protocol::CS3, 0.0, &[("sample_time", sample_time)]);
        assert_eq!(fmu.0.interval(clock).unwrap(), (sample_time, Qualifier::Changed));
        assert_eq!(fmu.0.shift(clock).unwrap(), 0.0);
        let error = fmu.0.set_timing(
            Function::SetIntervalDecimal,
            &[clock],
            std::iter::once(fmu::testing::clocks::Span::Decimal(1.0)),
        );
        assert_eq!(
            error_of(error),
            "fmi3SetIntervalDecimal: the interval of the clock 'sample' cannot be set: set the parameter 'sample_time' \
             instead"
        );
    }
}

/// Reference: the model without the clock, with steps of one sample time.
#[test]
fn ticks_in_event_mode_give_the_bits_of_plain_co_simulation() {
    for (start, sample_time) in [(0.0, 0.1), (10.3, 0.03), (-1.0, 0.25)] {
        let values = [("sample_time", sample_time)];
        let (mut plain, mut sampled) = (stepping::<Plain>(start, &values), in_event_mode::<Sampled>(start, &values));
        for number in 0..200 {
            activate(&mut sampled).unwrap();
            sampled.set("target", target(number)).unwrap();
            set_on(&mut sampled, number % 7 != 3);
            plain.set("target", target(number)).unwrap();
            set_on(&mut plain, number % 7 != 3);
            if number == 50 {
                plain.set("gain", 0.3).unwrap();
                sampled.set("gain", 0.3).unwrap();
            }
            plain.step(sample_time).unwrap();
            assert_eq!(outputs(&mut sampled), outputs(&mut plain), "sample {number} from {start} s");
            assert_eq!(outputs(&mut sampled).1, i32::try_from(number).unwrap() + 1);
            to_next_event(&mut sampled, sample_time).unwrap();
        }
    }
}

/// Reference: the model without the clock, in the same steps.
#[test]
fn without_event_mode_the_results_are_those_without_the_clock() {
    for (start, sample_time) in [(0.0, 0.1), (10.3, 0.03), (-1.0, 0.25)] {
        let values = [("sample_time", sample_time)];
        let (mut plain, mut sampled) = (stepping::<Plain>(start, &values), stepping::<Sampled>(start, &values));
        assert_eq!(outputs(&mut sampled), outputs(&mut plain));
        for number in 0..300 {
            let step = [0.1, 0.01, 0.25, 0.03, 1.0 / 3.0][number as usize % 5];
            plain.set("target", target(number)).unwrap();
            sampled.set("target", target(number)).unwrap();
            plain.step(step).unwrap();
            sampled.step(step).unwrap();
            assert_eq!(outputs(&mut sampled), outputs(&mut plain), "step {number} from {start} s");
            if number % 50 == 20 {
                let saved = sampled.0.deserialize(&sampled.bytes()).unwrap();
                sampled = stepping::<Sampled>(start, &values);
                sampled.0.restore(&saved).unwrap();
            }
        }
    }
}

#[test]
fn a_step_does_not_sample_and_cannot_go_past_a_tick() {
    let mut fmu = in_event_mode::<Sampled>(0.0, &[]);
    let message = |time: &str| {
        format!(
            "fmi3DoStep: the clock 'sample' ticks at {time} s: end the step there, and activate the clock in Event Mode"
        )
    };
    // The tick at the start was not activated.
    assert_eq!(error_of(to_next_event(&mut fmu, 0.05)), message("0"));
    fmu.0.enter_event_mode().unwrap();
    activate(&mut fmu).unwrap();
    assert_eq!(outputs(&mut fmu).1, 1);
    assert_eq!(error_of(to_next_event(&mut fmu, 0.15)), message("0.1"));
    // The failed step has changed nothing.
    fmu.step(0.05).unwrap();
    assert_eq!(
        error_of(fmu.try_get("position")),
        "fmi3GetFloat64: 'position' can be read and set only in Event Mode while its clock 'sample' is active; the \
         instance is in Step Mode"
    );
    fmu.step(0.05).unwrap();
    fmu.0.enter_event_mode().unwrap();
    activate(&mut fmu).unwrap();
    assert_eq!(outputs(&mut fmu).1, 2);
}

/// Reference: the source without the clock. FMI 3.0.2, section 2.4.8: a clocked output is not an InitialUnknown.
#[test]
fn a_source_has_outputs_from_initialization_mode_on() {
    let values = [("height", 5.0)];
    let mut sampled = initializing::<SampledWave>(Protocol::CS3, 0.5, &values);
    assert_eq!(sampled.get("level"), 5.0 + 0.5 + 0.125);
    let (mut plain, mut sampled) = (stepping::<PlainWave>(0.5, &values), stepping::<SampledWave>(0.5, &values));
    for _ in 0..20 {
        assert_eq!(sampled.get("level").to_bits(), plain.get("level").to_bits());
        plain.step(0.1).unwrap();
        sampled.step(0.1).unwrap();
    }
    let mut sampled = in_event_mode::<SampledWave>(0.5, &values);
    for number in 0..20 {
        activate(&mut sampled).unwrap();
        assert_eq!(sampled.get("level"), 5.0 + (0.5 + 0.125 * f64::from(number)) + 0.125);
        to_next_event(&mut sampled, 0.125).unwrap();
    }
    assert!(!SampledWave::description().xml.contains("<InitialUnknown"));
    assert!(PlainWave::description().xml.contains("<InitialUnknown"));
}

/// FMI 3.0.2, section 5.2: fmi3ActivateModelPartition runs the part of the clock. Reference: the model without the clock.
#[test]
fn scheduled_execution_gives_the_bits_of_plain_co_simulation() {
    let mut plain = stepping::<Plain>(0.0, &[]);
    let mut sampled = initializing::<Sampled>(Protocol::SE3, 0.0, &[]);
    sampled.0.exit_initialization().unwrap();
    for number in 0..50 {
        plain.set("target", target(number)).unwrap();
        sampled.set("target", target(number)).unwrap();
        plain.step(0.1).unwrap();
        sampled.0.activate(reference::<Sampled>("sample"), f64::from(number) * 0.1).unwrap();
        assert_eq!(outputs(&mut sampled), outputs(&mut plain));
    }
}

#[test]
fn a_variable_with_the_name_of_the_clock_is_an_error() {
    let error = Description::try_of::<ClockedModel<Taken>>(Format::FMI3, std::path::Path::new("")).unwrap_err();
    assert_eq!(error, "Taken: two variables are named 'sample'");
}
