//! What a model leaves out: names, units, parameters, design, memory. Reference: the documentation of `fmi2-derive`.

use fmi2::abi::{Export, Library};
use fmi2::model::SampledModel;
use fmi2::prelude::*;
use fmi2::variable::Kind;

use crate::models::Unit;

#[derive(Inputs, Clone)]
struct U {
    /// Speed of the vehicle (longitudinal) (m/s)
    speed: f64,
    /// Share
    #[var(unit = ONE, start = 0.5)]
    share: f64,
}

#[derive(Outputs, Clone)]
struct Y {
    /// Share of the speed (m/s)
    #[var("limited.speed", display = "km/h")]
    limited: f64,
}

struct Limiter;

/// Takes a share
/// of the speed
#[model(stop_time = 2.0 * 3.0, step_size = 0.01)]
impl Sampled for Limiter {
    type Inputs = U;
    type Outputs = Y;
    fn update(_: &SampleTime, (): &(), (): &mut (), u: &U, _t: f64) -> Y {
        Y { limited: u.share * u.speed }
    }
}

impl Export for Limiter {
    type Model = SampledModel<Self>;
    fn library() -> &'static Library {
        static LIBRARY: Library = Library::new();
        &LIBRARY
    }
}

#[test]
fn the_facts_come_from_the_type_the_doc_comment_and_the_package() {
    let info = <Limiter as Sampled>::INFO;
    assert_eq!(
        (info.name, info.description, info.version),
        ("Limiter", "Takes a share of the speed", env!("CARGO_PKG_VERSION"))
    );
    assert_eq!((info.stop_time, info.step_size), (6.0, 0.01));
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
            (declaration.name.as_str(), declaration.description.as_str(), real.unit.name, real.display, real.start)
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
fn a_unit_without_parameters_takes_a_sample_each_millisecond() {
    let mut unit = Unit::<Limiter>::ready();
    unit.set("speed", 8.0).unwrap();
    unit.step(0.0005).unwrap();
    assert_eq!(unit.get("limited.speed"), 4.0);
    unit.set("speed", 2.0).unwrap();
    unit.step(0.0005).unwrap();
    assert_eq!(unit.get("limited.speed"), 4.0, "the next sample is due at 1 ms");
    unit.step(0.0005).unwrap();
    assert_eq!(unit.get("limited.speed"), 1.0);
}
