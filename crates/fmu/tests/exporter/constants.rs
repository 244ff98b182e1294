//! Constants as outputs and derived parameters. References: FMI 3.0.2, section 2.4.7.4, and FMI 2.0.4, section 2.2.7
//! (legal combinations of causality, variability and initial; start values of alias variables); the declared values.

use std::path::Path;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::description::{Description, Format};

use crate::models::{Fmu, error_of, reference};

/// Medium
#[derive(Enumeration, Clone, Copy, Debug, PartialEq)]
pub(crate) enum Medium {
    /// Air
    Air,
    /// Water
    Water = 3,
}

const DENSITY: f64 = 1000.0;

#[derive(Parameters)]
struct Pool {
    /// Depth (m)
    #[var(start = 2.0, tunable)]
    depth: f64,
}

#[derive(Derived)]
struct Known {
    /// Density (kg/m3)
    #[var(constant = DENSITY, alias("rho"))]
    density: f64,
    /// Number of lanes
    #[var(constant = 8)]
    lanes: u8,
    /// Pressure at the bottom (Pa)
    #[var]
    pressure: f64,
}

#[derive(State)]
struct Level<T> {
    /// Level (m)
    #[var(start = 1.0, nominal = 1.0)]
    level: T,
}

#[derive(Outputs)]
struct Facts<T> {
    /// Area (m2)
    #[var(constant = 50.0)]
    area: T,
    /// Volume (m3)
    volume: T,
    /// Open to the public
    #[var(constant = true)]
    is_open: bool,
    /// Least temperature (K)
    #[var(constant = 0.1)]
    least: f32,
    /// Medium
    #[var(constant = Medium::Water)]
    medium: Medium,
}

/// Swimming pool
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Pool {
    type State<T: Scalar> = Level<T>;
    type Outputs<T: Scalar> = Facts<T>;
    type Derived = Known;
    fn derived(&self) -> Result<Known, String> {
        // The FMU has the declared constants instead.
        Ok(Known { density: 1.0, lanes: 1, pressure: DENSITY * 9.81 * self.depth })
    }
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Level<T> {
        Level { level: -at.state.level }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Facts<T> {
        let area = at.state.level;
        Facts { area, volume: at.state.level * 50.0, is_open: false, least: 7.0, medium: Medium::Air }
    }
}

fn values(fmu: &mut Fmu<Pool>) -> (f64, f64, i32, bool, f64, i32) {
    let name = |name| reference::<Pool>(name);
    (
        fmu.get("area"),
        fmu.get("density"),
        fmu.0.get_integer(name("lanes")).unwrap(),
        fmu.0.get_boolean(name("is_open")).unwrap(),
        fmu.get("least"),
        fmu.0.get_integer(name("medium")).unwrap(),
    )
}

#[test]
fn constants_have_their_values_in_every_state() {
    let expected = (50.0, 1000.0, 8, true, f64::from(0.1_f32), 3);
    let mut fmu = Fmu::<Pool>::initializing(0.0);
    assert_eq!(values(&mut fmu), expected);
    fmu.0.exit_initialization().unwrap();
    fmu.step(0.5).unwrap();
    assert_eq!(values(&mut fmu), expected);
    fmu.set("depth", 3.0).unwrap();
    fmu.step(0.5).unwrap();
    assert_eq!(values(&mut fmu), expected);
    assert_eq!(fmu.get("pressure"), 29430.0);
    // The state of the model is not a dependency of the constant.
    let (known, unknown) = (reference::<Pool>("level"), ["area", "volume"].map(reference::<Pool>));
    let mut slopes = [7.0; 2];
    fmu.0.directional_derivative(&unknown, &[known], &[1.0], &mut slopes).unwrap();
    assert_eq!(slopes, [0.0, 50.0]);
    assert!(fmu.set("area", 1.0).is_err() && fmu.set("density", 1.0).is_err());
}

#[test]
fn constants_are_declared_in_both_versions() {
    let xml = |format| Description::of::<<Pool as Export>::Model>(format, Path::new("")).xml;
    let [two, three] = [Format::FMI2, Format::FMI3].map(xml);
    let has = |xml: &str, text: String| assert!(xml.contains(&text), "{text} in {xml}");
    for (name, causality, starts) in [
        ("area", "output", ["50.0"; 2]),
        ("density", "local", ["1000.0"; 2]),
        ("lanes", "local", ["8"; 2]),
        ("is_open", "output", ["true"; 2]),
        ("least", "output", ["0.10000000149011612", "0.1"]),
        ("medium", "output", ["3"; 2]),
    ] {
        let reference = reference::<Pool>(name);
        let attributes = format!("causality=\"{causality}\" variability=\"constant\" initial=\"exact\"");
        for (xml, start) in [&two, &three].into_iter().zip(starts) {
            let (_, rest) = xml.split_once(&format!(" name=\"{name}\" valueReference=\"{reference}\"")).unwrap();
            let end = rest.find(" name=").unwrap_or(rest.len());
            has(&rest[..end], attributes.clone());
            has(&rest[..end], format!("start=\"{start}\""));
            // Only continuous variables have intermediate updates.
            assert!(!rest[..end].contains("intermediateUpdate"), "{name}");
        }
        assert!(!three.contains(&format!("<InitialUnknown valueReference=\"{reference}\"")), "{name}");
    }
    let [area, volume] = ["area", "volume"].map(reference::<Pool>);
    has(&three, format!("<Output valueReference=\"{area}\" dependencies=\"\"/>"));
    assert!(three.contains(&format!("<InitialUnknown valueReference=\"{volume}\"")));
    // An alias of a constant is constant.
    let alias = r#"description="Density" causality="local" variability="constant" initial="exact">"#;
    has(&two, alias.to_owned());
    has(two.split_once("name=\"rho\"").unwrap().1, "<Real unit=\"kg/m3\" start=\"1000.0\"/>".to_owned());
}

#[derive(Outputs)]
struct Box {
    /// Number of sides
    #[var(constant = 6)]
    sides: i32,
    /// Number of samples
    samples: i32,
}

#[derive(Parameters)]
struct Boxes;

/// Boxes
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Boxes {
    type Outputs = Box;
    fn update(&self, _: Sample<Self>) -> Box {
        Box { sides: 1, samples: 1 }
    }
}

/// The outputs of a discrete-time model have start values, which importers may set, but a constant cannot change.
#[test]
fn the_constant_of_a_discrete_time_model_cannot_be_set() {
    let mut fmu = Fmu::<Boxes>::initializing(0.0);
    fmu.set_integer("samples", 5).unwrap();
    let expected = "fmi2SetInteger: 'sides' is a constant, never settable; the instance is in Initialization Mode";
    assert_eq!(error_of(fmu.set_integer("sides", 5)), expected);
    assert_eq!(fmu.0.get_integer(reference::<Boxes>("sides")), Ok(6));
}
