//! Conversion of units in connections, with FMUs built from C in a temporary folder.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_system::export::System;
use fmu_system::fmus::Fmus;
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve_text};
use fmu_system::session::Session;
use std::path::Path;
use support::Build;
use tempfile::TempDir;

/// SI values: Bureau International des Poids et Mesures, The International System of Units, 9th edition; the units of
/// temperature and pressure by their definitions.
const UNITS: &str = "<Unit name=\"rad\"><BaseUnit rad=\"1\"/></Unit>\
<Unit name=\"deg\"><BaseUnit rad=\"1\" factor=\"0.017453292519943295\"/></Unit>\
<Unit name=\"m\"><BaseUnit m=\"1\"/></Unit><Unit name=\"m/s\"><BaseUnit m=\"1\" s=\"-1\"/></Unit>\
<Unit name=\"km/h\"><BaseUnit m=\"1\" s=\"-1\" factor=\"0.2777777777777778\"/></Unit>\
<Unit name=\"K\"><BaseUnit K=\"1\"/></Unit><Unit name=\"degC\"><BaseUnit K=\"1\" offset=\"273.15\"/></Unit>\
<Unit name=\"degF\"><BaseUnit K=\"1\" factor=\"0.5555555555555556\" offset=\"255.3722222222222\"/></Unit>\
<Unit name=\"Pa\"><BaseUnit kg=\"1\" m=\"-1\" s=\"-2\"/></Unit>\
<Unit name=\"bar\"><BaseUnit kg=\"1\" m=\"-1\" s=\"-2\" factor=\"100000\"/></Unit>\
<Unit name=\"rad/s\"><BaseUnit rad=\"1\" s=\"-1\"/></Unit><Unit name=\"Hz\"><BaseUnit s=\"-1\"/></Unit>\
<Unit name=\"rpm\"><BaseUnit rad=\"1\" s=\"-1\" factor=\"0.10471975511965977\"/></Unit>\
<Unit name=\"N\"><BaseUnit kg=\"1\" m=\"1\" s=\"-2\"/></Unit>\
<Unit name=\"kN\"><BaseUnit kg=\"1\" m=\"1\" s=\"-2\" factor=\"1000\"/></Unit><Unit name=\"vague\"/>";

const SCENARIO: &str = r#"
title = "Units"
simulation = { stop = 1.0, step = 0.5 }
[[component]]
name = "source"
fmu = "Source"
inputs = { value = VALUE }
[[component]]
name = "sink"
fmu = "Sink"
[[connection]]
from = "source:signal"
to = "sink:signal"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["sink:copy"]
"#;

/// A source with an output in one unit, and a sink with an input of the same name in another one.
fn fmus(from: &str, to: &str, relative: [bool; 2]) -> TempDir {
    let folder = TempDir::new().unwrap();
    let definitions = ("<Unit name=\"m\"><BaseUnit m=\"1\"/></Unit>", UNITS);
    let attributes = |unit: &str, relative: bool| {
        let type_of = if relative { " declaredType=\"Difference\"" } else { "" };
        format!("unit=\"{unit}\"{type_of}")
    };
    let output = format!("<Real {}/>", attributes(from, relative[0]));
    let input = format!("<Real start=\"0\" {}/>", attributes(to, relative[1]));
    let types = "<TypeDefinitions><SimpleType name=\"Difference\"><Real relativeQuantity=\"true\"/></SimpleType>\
                 </TypeDefinitions><ModelVariables>";
    let types = ("<ModelVariables>", types);
    let defects = ["FOLLOW=i->v.real[1]=i->v.real[0]", "EXIT=FOLLOW"];
    let of_source = [definitions, types, ("<Real unit=\"m\"/>", output.as_str())];
    Build { defects: &defects, edits: &of_source, ..Build::new("Source", "value", "signal") }.pack(folder.path());
    let of_sink = [definitions, types, ("<Real start=\"0\"/>", input.as_str()), ("<Real unit=\"m\"/>", "<Real/>")];
    Build { defects: &defects, edits: &of_sink, ..Build::new("Sink", "signal", "copy") }.pack(folder.path());
    folder
}

fn plan_of(folder: &TempDir, value: f64, keys: Option<&str>) -> Result<Plan, String> {
    let text = SCENARIO.replace("VALUE", &format!("{value:?}"));
    let text = match keys {
        Some(keys) => text.replace("to = \"sink:signal\"", &format!("to = \"sink:signal\"\n{keys}")),
        None => text.replace("[[connection]]\nfrom = \"source:signal\"\nto = \"sink:signal\"\n", ""),
    };
    let plan = resolve_text(Path::new("units.toml"), &text, &FmuFolder::new([folder.path()]), &Options::default());
    plan.map_err(|error| match error {
        ResolveError::Problems(problems) => problems.lines().join("\n"),
        other => other.to_string(),
    })
}

fn received(plan: &Plan) -> f64 {
    let fmus = Fmus::load(&plan.runs).unwrap();
    Session::new(&plan.simulation, &plan.runs[0], &fmus).unwrap().column(0).unwrap()
}

/// The reference is exact arithmetic, rounded once; the formula of FMI rounds up to six times, each by half a unit in
/// the last place of a number that can be ten times as large: 8 such units.
#[test]
fn units_of_the_same_dimension_are_converted() {
    for (value, from, to, relative, keys, expected) in [
        (30.0, "deg", "rad", false, None, 0.523_598_775_598_298_8),
        (100.0, "km/h", "m/s", false, None, 27.777_777_777_777_78),
        (0.1, "m/s", "km/h", false, None, 0.36),
        (25.0, "degC", "K", false, None, 298.15),
        (77.0, "degF", "degC", false, Some(""), 25.0),
        (10.0, "degF", "K", true, None, 5.555_555_555_555_555),
        (2.5, "bar", "Pa", false, None, 250_000.0),
        (3000.0, "rpm", "rad/s", false, None, 314.159_265_358_979_3),
        (1.5, "kN", "N", false, Some("factor = -2.0\noffset = 10.0"), -2990.0),
        (30.0, "deg", "rad", false, Some("factor = 2.0\nconvert = false"), 60.0),
        (30.0, "deg", "deg", false, Some("factor = 2.0"), 60.0),
        (4.0, "Hz", "rad/s", false, Some("factor = 6.25"), 25.0),
        (4.0, "vague", "m", false, Some("convert = false"), 4.0),
    ] {
        let folder = fmus(from, to, [relative; 2]);
        let found = received(&plan_of(&folder, value, keys).unwrap());
        let expected: f64 = expected;
        let unit = f64::from_bits(expected.abs().to_bits() + 1) - expected.abs();
        assert!((found - expected).abs() <= 8.0 * unit, "{value} {from} in {to}: {found}, not {expected}");
    }
}

/// Specification of the master: definitions of a unit that differ by their rounding (1e-9 relative) are equal.
#[test]
fn definitions_with_fewer_digits_are_the_same_unit() {
    for (factor, is_same) in [("0.01745329252", true), ("0.0174533", false)] {
        let folder = fmus("deg", "deg", [false; 2]);
        let unit = UNITS.replace("0.017453292519943295", factor);
        let edits = [
            ("<Unit name=\"m\"><BaseUnit m=\"1\"/></Unit>", unit.as_str()),
            ("<Real start=\"0\"/>", "<Real start=\"0\" unit=\"deg\"/>"),
        ];
        Build { edits: &edits, ..Build::new("Sink", "signal", "copy") }.pack(folder.path());
        let plan = plan_of(&folder, 4.0, None);
        assert_eq!(
            plan.is_ok_and(|plan| plan.wiring[0].inputs.iter().all(|input| input.conversion.is_none())),
            is_same
        );
    }
}

/// Only rad differs between Hz and rad/s, and nothing between deg and rad.
#[test]
fn a_factor_between_an_angle_and_a_number_warns() {
    for (from, to, is_warned) in [("Hz", "rad/s", true), ("deg", "rad", false)] {
        let plan = plan_of(&fmus(from, to, [false; 2]), 4.0, Some("factor = 6.25")).unwrap();
        let warned = plan.warnings.iter().any(|warning| warning.contains("the factor alone converts the value"));
        assert_eq!(warned, is_warned, "{:?}", plan.warnings);
    }
}

#[test]
fn other_units_are_rejected_with_their_definitions() {
    for (from, to, relative, keys, message, help) in [
        (
            "m",
            "rad",
            [false; 2],
            None,
            "`source:signal` is in m (1 m), but its target `sink:signal` is in rad (1 rad)",
            "",
        ),
        ("Hz", "rad/s", [false; 2], Some(""), "is in Hz (1 s^-1), but", "a `factor` in the [[connection]]"),
        ("vague", "m", [false; 2], Some(""), "is in vague, which its FMU does not define, but", "`convert = false`"),
        ("m", "s", [false; 2], Some("factor = 2.0"), "is in m (1 m), but", "only `factor` and `offset` of the"),
        (
            "degC",
            "K",
            [true, false],
            None,
            "is a difference in degC, but its target `sink:signal` is not a difference in K",
            "",
        ),
    ] {
        let found = plan_of(&fmus(from, to, relative), 1.0, keys).unwrap_err();
        assert!(found.contains(message) && found.contains(help), "{found}");
    }
}

/// SSP 1.0.1, section 5.5.1.1: a linear transformation, without another conversion by the importer. Structures of OSP
/// have neither.
#[test]
fn an_exported_connection_contains_its_conversion() {
    let folder = fmus("kN", "N", [false; 2]);
    let plan = plan_of(&folder, 1.5, Some("offset = 10.0")).unwrap();
    let system = System::new(&plan, &plan.runs[0]).unwrap();
    let out = TempDir::new().unwrap();
    let files = system.write(&out.path().join("system"), false).unwrap();
    assert_eq!(files.len(), 1, "{files:?}");
    let mut archive = zip::ZipArchive::new(std::fs::File::open(&files[0]).unwrap()).unwrap();
    let text = std::io::read_to_string(archive.by_name("SystemStructure.ssd").unwrap()).unwrap();
    assert!(text.contains("suppressUnitConversion=\"true\""), "{text}");
    assert!(text.contains("<ssc:LinearTransformation factor=\"1000.0\" offset=\"10.0\"/>"), "{text}");
}
