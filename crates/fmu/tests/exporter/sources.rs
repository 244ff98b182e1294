//! A source has the outputs of its first sample from Initialization Mode on. Reference: the documentation of
//! `Discrete::SOURCE`, and FMI 2.0.4, section 2.2.8 (InitialUnknowns).

use fmu::prelude::*;
use fmu::testing::abi::Export;

use crate::models::{Fmu, error_of};

#[derive(Parameters)]
struct Lift {
    /// Height at the start (m)
    #[var(start = 2.0)]
    height: f64,
    /// Divisor of the height (1)
    #[var(start = 1.0, min = 0.0, tunable)]
    scale: f64,
    #[var(SAMPLE_TIME, start = 0.1)]
    sample_time: f64,
}

#[derive(Inputs)]
struct U {
    /// Speed (m/s)
    #[var(start = 3.0)]
    speed: f64,
}

#[derive(Outputs)]
struct Y {
    /// Height as a function of time and distance (m)
    #[var(start = -1.0)]
    level: f64,
    /// Samples so far (1)
    count: f64,
}

#[derive(DiscreteState, Clone, Default)]
struct X {
    distance: f64,
    count: f64,
}

/// Height as a function of time and distance
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Lift {
    type State = X;
    type Inputs = U;
    type Outputs = Y;
    const SOURCE: Option<Influence> = Some(|output, parameter| output == "level" || parameter == "sample_time");

    fn update(&self, sample: Sample<Self>) -> Y {
        let Sample { time, state: x, inputs, .. } = sample;
        let y = Y { level: self.height / self.scale + time + x.distance, count: x.count };
        x.distance += inputs.speed * self.sample_time;
        x.count += 1.0;
        y
    }
}

#[test]
fn outputs_are_those_of_the_first_sample_from_initialization_mode_on() {
    let mut lift = Fmu::<Lift>::initializing(10.0);
    assert_eq!((lift.get("level"), lift.get("count")), (12.0, 0.0));
    // The outputs depend on the parameters, not on the inputs.
    lift.set("height", 8.0).unwrap();
    lift.set("scale", 2.0).unwrap();
    lift.set("speed", 1e300).unwrap();
    assert_eq!(lift.get("level"), 14.0);
    lift.0.exit_initialization().unwrap();
    assert_eq!((lift.get("level"), lift.get("count")), (14.0, 0.0));
    // The outputs are held: as in every discrete-time model, a tunable parameter takes effect at the next sample.
    lift.set("scale", 4.0).unwrap();
    lift.set("speed", 5.0).unwrap();
    assert_eq!(lift.get("level"), 14.0);
    // The first step takes the first sample only once.
    lift.step(0.1).unwrap();
    assert_eq!((lift.get("level"), lift.get("count")), (12.0, 0.0));
    lift.step(0.1).unwrap();
    assert_eq!((lift.get("level"), lift.get("count")), (2.0 + 10.1 + 0.5, 1.0));
}

#[test]
fn outputs_read_before_the_start_leave_no_trace_in_the_run() {
    let run = |read: bool| {
        let mut lift = Fmu::<Lift>::initializing(0.0);
        if read {
            lift.get("level");
        }
        lift.0.exit_initialization().unwrap();
        (0..5).for_each(|_| lift.step(0.1).unwrap());
        lift.bytes()
    };
    assert_eq!(run(true), run(false));
}

#[test]
fn a_restored_state_before_the_start_follows_the_parameters_again() {
    let mut lift = Fmu::<Lift>::initializing(0.0);
    assert_eq!(lift.get("level"), 2.0);
    let bytes = lift.bytes();
    let mut other = Fmu::<Lift>::ready();
    other.step(0.5).unwrap();
    let saved = other.0.deserialize(&bytes).unwrap();
    other.0.restore(&saved).unwrap();
    assert_eq!(other.get("level"), 2.0);
    other.set("height", 7.0).unwrap();
    assert_eq!(other.get("level"), 7.0);
    // After the start the outputs are held, also in a restored instance.
    other.0.exit_initialization().unwrap();
    let saved = other.0.snapshot().unwrap();
    other.step(0.5).unwrap();
    other.0.restore(&saved).unwrap();
    assert_eq!(other.get("level"), 7.0);
}

#[test]
fn a_first_sample_that_is_not_finite_ends_the_initialization() {
    let mut lift = Fmu::<Lift>::initializing(0.0);
    lift.set("scale", 0.0).unwrap();
    assert_eq!(error_of(lift.try_get("level")), "fmi2GetReal: 'level' = inf at time 0 s, not a finite number");
    let before = lift.bytes();
    assert_eq!(
        error_of(lift.0.exit_initialization()),
        "Lift: 'level' must be finite at the start, got inf; check the parameters"
    );
    let saved = lift.0.deserialize(&before).unwrap();
    lift.0.restore(&saved).unwrap();
    lift.set("scale", 1.0).unwrap();
    lift.0.exit_initialization().unwrap();
    assert_eq!(lift.get("level"), 2.0);
}

#[test]
fn outputs_cannot_be_set() {
    let mut lift = Fmu::<Lift>::initializing(0.0);
    assert_eq!(
        error_of(lift.set("level", 1.0)),
        "fmi2SetReal: 'level' is an output, never settable; the instance is in Initialization Mode"
    );
}

#[test]
fn the_description_names_the_parameters_of_each_output() {
    let description = Lift::description();
    let xml = &description.xml;
    let output = |name: &str| {
        let (_, rest) = xml.split_once(&format!("name=\"{name}\"")).unwrap();
        rest.split_once("</ScalarVariable>").unwrap().0.to_owned()
    };
    for name in ["level", "count"] {
        let text = output(name);
        assert!(text.contains("variability=\"discrete\" initial=\"calculated\"") && !text.contains("start="), "{text}");
    }
    // Variables 1 to 3 are the parameters, 4 is the input, 5 and 6 are the outputs.
    let (_, structure) = xml.split_once("<ModelStructure>").unwrap();
    let (_, initial) = structure.split_once("<InitialUnknowns>").unwrap();
    assert!(initial.contains(r#"index="5" dependencies="1 2 3""#), "{initial}");
    assert!(initial.contains(r#"index="6" dependencies="3""#), "{initial}");
    // Between steps, outputs have no dependencies.
    assert!(structure.contains(r#"index="5" dependencies="""#), "{structure}");
}
