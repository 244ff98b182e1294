//! Omitted parts of a model: names, units, parameters, derived parameters, state. Reference: the documentation of `fmu-derive`.

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::variable::Kind;

use crate::models::Fmu;

#[derive(Inputs)]
struct U {
    /// Speed of the vehicle (longitudinal) (m/s)
    speed: f64,
    /// Share
    #[var(unit = "1", start = 0.5)]
    share: f64,
}

#[derive(Outputs)]
struct Y {
    /// Share of the speed (m/s)
    #[var("limited.speed", display = "km/h")]
    limited: f64,
}

#[derive(Parameters)]
struct Limiter;

/// Takes a share
/// of the speed
#[fmu::model(stop_time = 2.0 * 3.0, step_size = 0.001)]
impl Discrete for Limiter {
    type Inputs = U;
    type Outputs = Y;
    fn update(&self, sample: Sample<Self>) -> Y {
        Y { limited: sample.inputs.share * sample.inputs.speed }
    }
}

#[test]
fn metadata_come_from_the_type_the_doc_comment_and_the_package() {
    let info = <Limiter as Discrete>::INFO;
    assert_eq!(
        (info.name, info.description, info.version),
        ("Limiter", "Takes a share of the speed", env!("CARGO_PKG_VERSION"))
    );
    assert_eq!((info.stop_time, info.step_size), (6.0, 0.001));
}

#[test]
fn names_come_from_fields_and_units_from_doc_comments() {
    let description = Limiter::description();
    let variables: Vec<_> = description
        .layout
        .variables
        .iter()
        .map(|variable| {
            let Kind::Real(real) = &variable.declaration.kind else { panic!("all variables are real") };
            let declaration = &variable.declaration;
            (
                declaration.name.as_str(),
                declaration.description.as_str(),
                real.unit.name,
                real.display.map(|unit| unit.name),
                real.start,
            )
        })
        .collect();
    assert_eq!(variables[0].0, "sample_time");
    assert_eq!(
        variables[1..],
        [
            ("speed", "Speed of the vehicle (longitudinal)", "m/s", None, 0.0),
            ("share", "Share", "1", None, 0.5),
            ("limited.speed", "Share of the speed", "m/s", Some("km/h"), 0.0),
        ]
    );
}

#[test]
fn a_model_without_parameters_takes_a_sample_each_step_size() {
    let mut fmu = Fmu::<Limiter>::ready();
    fmu.set("speed", 8.0).unwrap();
    fmu.step(0.0005).unwrap();
    assert_eq!(fmu.get("limited.speed"), 4.0);
    fmu.set("speed", 2.0).unwrap();
    fmu.step(0.0005).unwrap();
    assert_eq!(fmu.get("limited.speed"), 4.0, "the next sample is due at 1 ms");
    fmu.step(0.0005).unwrap();
    assert_eq!(fmu.get("limited.speed"), 1.0);
}
