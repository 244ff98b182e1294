//! Variables of one FMI version only. Reference: the description of the other version, and of the same model without the
//! restrictions; the rules of the crate's documentation.
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use std::path::Path;

use fmu::prelude::*;
use fmu::testing::abi::{Export, Status, fmi3};
use fmu::testing::description::{Description, Format};

use crate::fmi3::Instance;
use crate::models::{exported, reference};

#[derive(Parameters)]
pub(crate) struct Camera {
    /// Largest possible counter
    #[var(start = 7, fmi = 3)]
    most: u64,
    /// Gain (1)
    #[var(start = 2.0)]
    gain: f64,
}

#[derive(Inputs)]
pub(crate) struct Light<T> {
    /// Brightness of the pixels (1)
    #[var(fmi = 3)]
    pixels: [T; 2],
    /// Reflect the light of the second pixel
    #[var(fmi = 3, alias("mirror"))]
    reflect: bool,
    /// Brightness (1)
    #[var(fmi = 2)]
    brightness: T,
    /// Shutter opening (1)
    shutter: T,
}

#[derive(State)]
pub(crate) struct Charge<T> {
    /// Charge (C)
    #[var(start = 0.0, nominal = 1.0)]
    charge: T,
}

#[derive(Outputs)]
pub(crate) struct Exposure<T> {
    /// Exposure (lx)
    #[var(fmi = 2)]
    exposure: T,
    /// Current (A)
    current: T,
}

/// Camera
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Camera {
    type State<T: Scalar> = Charge<T>;
    type Inputs<T: Scalar> = Light<T>;
    type Outputs<T: Scalar> = Exposure<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Charge<T> {
        let u = at.inputs;
        Charge { charge: (u.brightness + u.pixels[0] + u.pixels[1]) * u.shutter * self.gain }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Exposure<T> {
        let u = at.inputs;
        let pixel = if u.reflect { u.pixels[1] } else { u.pixels[0] };
        Exposure { exposure: u.brightness * u.shutter, current: pixel * u.shutter }
    }
}

exported! {
    Camera3: Camera, Format::FMI3;
}

fn xml(format: Format) -> String {
    Description::try_of::<<Camera as Export>::Model>(format, Path::new("")).unwrap().xml
}

/// Names and value references of the declared variables, in the order of the description.
fn variables(xml: &str) -> Vec<(&str, u32)> {
    let attribute = |line: &'_ str, name: &str| -> Option<(usize, usize)> {
        let start = line.find(&format!(" {name}=\""))? + name.len() + 3;
        Some((start, start + line[start..].find('"')?))
    };
    let lines = xml.lines().filter(|line| line.contains(" causality="));
    lines
        .map(|line| {
            let text = |name| attribute(line, name).map(|(start, end)| &line[start..end]).unwrap();
            (text("name"), text("valueReference").parse().unwrap())
        })
        .collect()
}

fn name_and_reference(name: &str) -> (&str, u32) {
    (name, reference::<Camera>(name))
}

#[test]
fn each_version_has_its_variables_with_their_references() {
    let common = ["max_step", "shutter", "current", "charge", "der(charge)"];
    let expected = |names: &[&'static str]| names.iter().map(|name| name_and_reference(name)).collect::<Vec<_>>();
    let in_2 = ["gain", "max_step", "brightness", "shutter", "exposure", "current", "charge", "der(charge)"];
    assert_eq!(variables(&xml(Format::FMI2)), expected(&in_2));
    let end = Camera::description().layout.end;
    let in_3 = [
        "most",
        "gain",
        "max_step",
        "pixels[1]",
        "pixels[2]",
        "reflect",
        "shutter",
        "current",
        "charge",
        "der(charge)",
    ];
    let xml = xml(Format::FMI3);
    assert_eq!(variables(&xml), [vec![("time", end)], expected(&in_3)].concat());
    assert!(common.iter().all(|name| in_2.contains(name) && in_3.contains(name)));
    // The alias of a variable is left out with it.
    assert!(xml.contains("<Alias name=\"mirror\"") && !self::xml(Format::FMI2).contains("mirror"));
    // A unit that only a left-out variable has is not declared.
    assert!(!xml.contains("\"lx\"") && self::xml(Format::FMI2).contains("\"lx\""));
}

#[test]
fn the_model_structure_refers_to_declared_variables() {
    // Positions, from 1, in the list of the test above: brightness 3, shutter 4, exposure 5, current 6, charge 7, der(charge) 8.
    let xml = xml(Format::FMI2);
    let (_, structure) = xml.split_once("<ModelStructure>").unwrap();
    for unknown in [
        r#"<Unknown index="5" dependencies="3 4"/>"#,
        r#"<Unknown index="6" dependencies="4"/>"#,
        r#"<Unknown index="7" dependencies="7"/>"#,
        r#"<Unknown index="8" dependencies="3 4"/>"#,
        r#"<Unknown index="5" dependencies="1 2 3 4"/>"#,
    ] {
        assert!(structure.contains(unknown), "{unknown} in {structure}");
    }
    assert!(xml.contains(" derivative=\"7\"/>"), "{xml}");
    // In FMI 3.0, by value reference.
    let xml = self::xml(Format::FMI3);
    let [first, second, shutter, reflect, current] =
        ["pixels[1]", "pixels[2]", "shutter", "reflect", "current"].map(reference::<Camera>);
    let dependencies = format!("{first} {second} {reflect} {shutter}");
    let output = format!("<Output valueReference=\"{current}\" dependencies=\"{dependencies}\"/>");
    assert!(xml.contains(&output), "{output} in {xml}");
    let [exposure, brightness] = ["exposure", "brightness"].map(reference::<Camera>);
    assert!(!xml.contains(&format!("valueReference=\"{exposure}\"")) && !xml.contains(&format!(" {brightness} ")));
}

#[test]
fn a_left_out_variable_has_no_dependencies() {
    let instance = Instance::<Camera3>::co_simulation(false).initialized();
    let mut count = 0;
    let mut number = |name| {
        // SAFETY: a live component and a number to write to.
        let get = fmi3::get_number_of_variable_dependencies::<Camera3>;
        (unsafe { get(instance.component, reference::<Camera>(name), &mut count) }, count)
    };
    assert_eq!(number("current"), (Status::Ok, 4));
    assert_eq!(number("der(charge)"), (Status::Ok, 3));
    assert_eq!(number("exposure").0, Status::Error);
}

/// The left-out inputs keep their start values. Reference: the equations.
#[test]
fn results_are_the_same_in_both_versions() {
    let mut old = crate::models::Fmu::<Camera>::ready();
    old.set("shutter", 0.5).unwrap();
    let new = Instance::<Camera3>::co_simulation(false).initialized();
    let [shutter, charge] = ["shutter", "charge"].map(reference::<Camera>);
    assert_eq!(new.set(&[shutter], &[0.5]), Status::Ok);
    old.step(1.0).unwrap();
    assert_eq!(new.step(0.0, 1.0).0, Status::Ok);
    let mut value = [7.0];
    assert_eq!(new.get(&[charge], &mut value), Status::Ok);
    assert_eq!((value[0], old.get("charge")), (0.0, 0.0));
}
