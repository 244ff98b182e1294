//! Further names of variables. References: FMI 3.0.2, section 2.4.7.3 (alias variables); FMI 2.0.4, section 2.2.7
//! (variables with the same value reference); the schemas of both versions for the order of the elements.

use std::path::Path;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::description::{Description, Format};
use fmu::{Definition, Range};

const SPEED: Definition = Definition {
    name: "speed",
    unit: fmu::unit!("m/s"),
    display: Some("km/h"),
    nominal: None,
    range: Range::Any,
    description: "Speed of the wind",
};

#[derive(Parameters)]
struct Balloon {
    /// Rate of climb per volume (1/(m2.s))
    #[var(start = 0.5, min = 0.0, tunable, alias("k"))]
    rate: f64,
    /// Serial number
    #[var(start = "a", alias("number", description = "Number on the label"))]
    serial: String,
    #[var(nested)]
    basket: Basket,
}

#[derive(Parameters)]
struct Basket {
    /// Mass (kg)
    #[var(start = 10.0, alias("mass_lb", display = "lb"))]
    mass: f64,
}

#[derive(Inputs)]
struct Wind<T> {
    #[var(SPEED, alias("u", display = "mm/s"))]
    speed: T,
}

#[derive(State)]
struct Height<T> {
    /// Height
    #[var(
        unit = "m",
        start = 1.0,
        nominal = 1.0,
        alias("h_ft", display = "ft", description = "Height in feet"),
        alias("z")
    )]
    h: T,
}

#[derive(Outputs)]
struct Signs {
    /// Sign of the wind
    #[var(alias("direction"))]
    sign: i32,
}

/// Balloon
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Balloon {
    type State<T: Scalar> = Height<T>;
    type Inputs<T: Scalar> = Wind<T>;
    type Outputs<T: Scalar> = Signs;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Height<T> {
        Height { h: at.inputs.speed * self.rate }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Signs {
        Signs { sign: at.inputs.speed.value().signum() as i32 }
    }
}

fn xml(format: Format) -> String {
    Description::of::<<Balloon as Export>::Model>(format, Path::new("")).xml
}

/// The lines of the variables, without indentation.
fn variables(xml: &str) -> Vec<&str> {
    let (_, rest) = xml.split_once("<ModelVariables>").unwrap();
    rest.split_once("</ModelVariables>").unwrap().0.trim().lines().map(str::trim).collect()
}

#[test]
fn aliases_are_elements_in_fmi_3() {
    let xml = xml(Format::FMI3);
    let lines = variables(&xml);
    for (variable, aliases) in [
        ("rate", &[r#"<Alias name="k" description="Rate of climb per volume"/>"#][..]),
        ("serial", &[r#"<Start value="a"/>"#, r#"<Alias name="number" description="Number on the label"/>"#]),
        ("basket.mass", &[r#"<Alias name="basket.mass_lb" description="Mass" displayUnit="lb"/>"#]),
        ("speed", &[r#"<Alias name="u" description="Speed of the wind" displayUnit="mm/s"/>"#]),
        (
            "h",
            &[
                r#"<Alias name="h_ft" description="Height in feet" displayUnit="ft"/>"#,
                r#"<Alias name="z" description="Height"/>"#,
            ],
        ),
        ("sign", &[r#"<Alias name="direction" description="Sign of the wind"/>"#]),
    ] {
        let at = lines.iter().position(|line| line.contains(&format!(" name=\"{variable}\""))).unwrap();
        assert_eq!(lines[at + 1..=at + aliases.len()], *aliases);
        assert!(lines[at + 1 + aliases.len()].starts_with("</"), "{variable}");
    }
    // The derivative has no alias.
    assert_eq!(xml.matches("<Alias ").count(), 7);
    // 1 ft = 0.3048 m (NIST SP 811).
    let (_, rest) = xml.split_once("<DisplayUnit name=\"ft\" factor=\"").unwrap();
    assert!((rest.split_once('"').unwrap().0.parse::<f64>().unwrap() - 1.0 / 0.3048).abs() < 1e-15);
}

#[test]
fn aliases_are_local_variables_at_the_end_in_fmi_2() {
    let xml = xml(Format::FMI2);
    let lines = variables(&xml);
    let layout = &Balloon::description().layout;
    let expected = [
        ("k", "rate", "Rate of climb per volume", "tunable", r#"Real unit="1/(m2.s)" min="0.0""#),
        ("number", "serial", "Number on the label", "fixed", "String"),
        ("basket.mass_lb", "basket.mass", "Mass", "fixed", r#"Real unit="kg" displayUnit="lb""#),
        ("u", "speed", "Speed of the wind", "continuous", r#"Real unit="m/s" displayUnit="mm/s""#),
        ("direction", "sign", "Sign of the wind", "discrete", "Integer"),
        ("h_ft", "h", "Height in feet", "continuous", r#"Real unit="m" displayUnit="ft" nominal="1.0""#),
        ("z", "h", "Height", "continuous", r#"Real unit="m" nominal="1.0""#),
    ];
    let written: Vec<_> = expected
        .iter()
        .flat_map(|(name, of, description, variability, of_type)| {
            let reference = crate::models::reference::<Balloon>(of);
            let attributes = format!("name=\"{name}\" valueReference=\"{reference}\" description=\"{description}\"");
            let attributes =
                format!("{attributes} causality=\"local\" variability=\"{variability}\" initial=\"calculated\"");
            [format!("<ScalarVariable {attributes}>"), format!("<{of_type}/>"), "</ScalarVariable>".to_owned()]
        })
        .collect();
    assert_eq!(lines[lines.len() - written.len()..], written);
    assert_eq!(lines.len() / 3, layout.variables.len() + expected.len());
}
