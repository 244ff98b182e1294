//! Units in the model description. References: FMI 2.0.4, section 2.2.2 (unit definitions), SI brochure (9th edition, 2019).

use std::path::Path;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::description::{Description, Format};

/// An old unit of length; the unit of its time derivative is declared.
const FURLONG: Unit = Unit { name: "furlong", factor: 201.168, display: &[], rate: Some(&SPEED), ..fmu::unit!("m") };
const SPEED: Unit = Unit { name: "furlong/s", factor: 201.168, display: &[], rate: None, ..fmu::unit!("m/s") };

#[derive(Parameters)]
struct Units {
    /// Mass (kg)
    #[var(start = 1.0)]
    mass: f64,
    /// Length (m)
    #[var(start = 1.0)]
    length: f64,
    /// Time (s)
    #[var(start = 1.0)]
    time: f64,
    /// Current (A)
    #[var(start = 1.0)]
    current: f64,
    /// Temperature (K)
    #[var(start = 300.0)]
    temperature: f64,
    /// Amount (mol)
    #[var(start = 1.0)]
    amount: f64,
    /// Intensity (cd)
    #[var(start = 1.0)]
    intensity: f64,
    /// Outside temperature (degC)
    #[var(start = 20.0, display = "K")]
    outside: f64,
    /// Heat capacity (kJ/(kg.K))
    #[var(start = 4.2)]
    capacity: f64,
    /// Distance
    #[var(unit = FURLONG, start = 1.0)]
    distance: f64,
}

#[derive(State)]
struct X<T> {
    /// Coolant temperature (degC)
    coolant: T,
    /// Angle (deg)
    angle: T,
    /// Torsional stiffness (N.m/rad)
    stiffness: T,
    /// Race distance
    #[var(unit = FURLONG)]
    race: T,
    /// Flow (L/min)
    flow: T,
}

/// Units
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Units {
    type State<T: Scalar> = X<T>;
    fn derivatives<T: Scalar>(&self, _: At<T, Self>) -> X<T> {
        let zero = T::from(0.0);
        X { coolant: zero, angle: zero, stiffness: zero, race: zero, flow: zero }
    }
}

/// The definition of a unit, without line breaks.
fn unit(name: &str) -> String {
    let xml = &Units::description().xml;
    let (_, rest) = xml.split_once(&format!("<Unit name=\"{name}\">")).unwrap_or_else(|| panic!("no unit {name}"));
    let text = rest.split_once("</Unit>").unwrap().0;
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn units_are_products_of_base_units_with_factor_and_offset() {
    for (name, expected) in [
        ("kg", r#"<BaseUnit kg="1"/>"#),
        ("m", r#"<BaseUnit m="1"/>"#),
        ("s", r#"<BaseUnit s="1"/>"#),
        ("A", r#"<BaseUnit A="1"/>"#),
        ("K", r#"<BaseUnit K="1"/>"#),
        ("mol", r#"<BaseUnit mol="1"/>"#),
        ("cd", r#"<BaseUnit cd="1"/>"#),
        ("degC", r#"<BaseUnit K="1" offset="273.15"/>"#),
        ("K/s", r#"<BaseUnit s="-1" K="1"/>"#),
        ("kJ/(kg.K)", r#"<BaseUnit m="2" s="-2" K="-1" factor="1000.0"/>"#),
        ("deg", r#"<BaseUnit rad="1" factor="0.017453292519943295"/>"#),
        ("deg/s", r#"<BaseUnit s="-1" rad="1" factor="0.017453292519943295"/>"#),
        ("N.m/rad", r#"<BaseUnit kg="1" m="2" s="-2" rad="-1"/>"#),
        ("N.m/(rad.s)", r#"<BaseUnit kg="1" m="2" s="-3" rad="-1"/>"#),
        ("furlong", r#"<BaseUnit m="1" factor="201.168"/>"#),
        ("furlong/s", r#"<BaseUnit m="1" s="-1" factor="201.168"/>"#),
        // 1/60000 m3/s.
        ("L/min", r#"<BaseUnit m="3" s="-1" factor="0.000016666666666666667"/>"#),
    ] {
        let found = unit(name);
        let expected = expected.replace("0.000016666666666666667", "1.6666666666666667e-5");
        assert!(found.starts_with(&expected), "{name}: {found}");
    }
    // display value = factor * value + offset: 20 degC are 293.15 K.
    assert!(unit("degC").contains(r#"<DisplayUnit name="K" factor="1.0" offset="273.15"/>"#));
    assert!(unit("K").contains(r#"<DisplayUnit name="degC" factor="1.0" offset="-273.15"/>"#));
}

#[test]
fn derivatives_have_the_unit_of_the_rate() {
    let description = Units::description();
    let rates: Vec<_> = description
        .layout
        .variables
        .iter()
        .filter(|variable| variable.role == fmu::testing::variable::Role::Derivative)
        .map(|variable| match &variable.declaration.kind {
            fmu::testing::variable::Kind::Real(real) => real.unit.name,
            _ => unreachable!("derivatives are real"),
        })
        .collect();
    assert_eq!(rates, ["K/s", "deg/s", "N.m/(rad.s)", "furlong/s", "L/(min.s)"]);
}

#[derive(Parameters)]
struct Follower {
    /// Time constant (s)
    #[var(start = 0.1, positive)]
    time_constant: f64,
    /// Offset
    #[var(unit = Unit::NONE, start = 0.5, min = -1.0)]
    offset: f64,
}

#[derive(Inputs)]
struct FollowerInputs<T> {
    /// Command
    #[var(unit = Unit::NONE)]
    command: T,
}

#[derive(State)]
struct FollowerState<T> {
    /// Value
    #[var(unit = Unit::NONE, nominal = 10.0)]
    value: T,
}

#[derive(Outputs)]
struct FollowerOutputs<T> {
    /// Errors
    #[var(unit = Unit::NONE)]
    error: [T; 2],
}

/// Follows a command of any unit
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Follower {
    type State<T: Scalar> = FollowerState<T>;
    type Inputs<T: Scalar> = FollowerInputs<T>;
    type Outputs<T: Scalar> = FollowerOutputs<T>;
    fn evaluate<T: Scalar>(&self, at: At<T, Self>) -> (FollowerState<T>, FollowerOutputs<T>) {
        let error = at.inputs.command + self.offset - at.state.value;
        (FollowerState { value: error / self.time_constant }, FollowerOutputs { error: [error, -error] })
    }
}

#[test]
fn a_variable_can_leave_its_unit_open() {
    for format in [Format::FMI2, Format::FMI3, Format { arrays: true, ..Format::FMI3 }] {
        let xml = Description::of::<<Follower as Export>::Model>(format, Path::new("")).xml;
        let written = |name: &str| {
            let (_, rest) = xml.split_once(&format!(" name=\"{name}\"")).unwrap_or_else(|| panic!("no {name}"));
            // Up to the next variable or the end of the list.
            rest.split(" name=\"").next().and_then(|text| text.split("</ModelVariables>").next()).unwrap().to_owned()
        };
        let error = if format.arrays { "error" } else { "error[1]" };
        for name in ["offset", "command", "value", "der(value)", error] {
            assert!(!written(name).contains("unit="), "{name}: {}", written(name));
        }
        assert!(written("offset").contains("min=\"-1.0\"") && written("offset").contains("start=\"0.5\""));
        assert!(written("time_constant").contains("unit=\"s\""));
        assert!(!xml.contains("name=\"\""), "no unit without a name is defined");
    }
}

#[derive(Parameters)]
struct Wheel {
    /// Temperature rise (K)
    #[var(start = 10.0, display = "degC", quantity = "ThermodynamicTemperature", relative_quantity)]
    rise: f64,
}

#[derive(State)]
struct Turned<T> {
    /// Angle (rad)
    #[var(nominal = 1.0, quantity = "Angle", unbounded)]
    angle: T,
}

#[derive(Outputs)]
struct Counted {
    /// Turns
    #[var(quantity = "Turns", min = 0)]
    turns: i32,
    /// Wear of the sides (1)
    #[var(quantity = "Wear")]
    wear: [f32; 2],
}

/// Wheel
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Wheel {
    type State<T: Scalar> = Turned<T>;
    type Outputs<T: Scalar> = Counted;
    fn derivatives<T: Scalar>(&self, _: At<T, Self>) -> Turned<T> {
        Turned { angle: T::from(self.rise) }
    }
    fn outputs<T: Scalar>(&self, _: At<T, Self>) -> Counted {
        Counted { turns: 0, wear: [0.0; 2] }
    }
}

/// Reference: the attributes of the schemas of FMI 2.0.4 and 3.0.2.
#[test]
fn quantities_are_attributes_in_both_versions() {
    let xml = |format| Description::of::<<Wheel as Export>::Model>(format, Path::new("")).xml;
    let [two, three] = [Format::FMI2, Format { arrays: true, ..Format::FMI3 }].map(xml);
    for text in [
        r#"<Real unit="K" displayUnit="degC" quantity="ThermodynamicTemperature" relativeQuantity="true" start="10.0"/>"#,
        r#"<Real unit="rad" nominal="1.0" quantity="Angle" unbounded="true" start="0.0"/>"#,
        r#"<Integer min="0" quantity="Turns"/>"#,
        r#"<Real unit="1" quantity="Wear"/>"#,
    ] {
        assert!(two.contains(text), "{text} in {two}");
        // States are available in intermediate updates.
        let of_fmi3 = text.replace(r#" start="0.0""#, r#" intermediateUpdate="true" start="0.0""#);
        let of_fmi3 = of_fmi3.split_once(' ').unwrap().1.trim_end_matches("/>");
        assert!(three.contains(of_fmi3), "{of_fmi3} in {three}");
    }
    // The elements of the array agree, and the derivative has no quantity.
    assert!(three.contains("<Dimension start=\"2\"/>"));
    assert_eq!((two.matches(" quantity=").count(), three.matches(" quantity=").count()), (5, 4));
}
