//! Sweeps over the values of one or two parameters, on descriptions without binaries (tests/data).

use fmu_import::description::{ModelDescription, Value};
use fmu_system::plan::{Plan, SecondSweep};
use fmu_system::report::FigureKind;
use fmu_system::resolve::{Options, ResolveError, resolve_text};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

const SCENARIO: &str = r#"
title = "Two axes"
simulation = { stop = 2.0, step = 0.001 }
component = [
    { name = "driver", fmu = "Driver" },
    { name = "vehicle", fmu = "Vehicle", inputs = { "road_friction.*" = 1.0 } },
]
connection = [{ from = "driver:driver.steer", to = "vehicle:steer.front" }]
case = [{ name = "only", title = "Only" }]
record = { signals = ["vehicle:body.roll"] }
metric = [{ name = "peak", title = "Peak", signal = "body.roll", kind = "peak" }]
figure = [{ name = "map", title = "Map", kind = "heat_map", metrics = ["peak"] }]

[sweep]
title = "Speed"
unit = "km/h"
parameter = "driver:speed.initial"
values = [36.0, 72.0]

[sweep.second]
title = "Mass"
unit = "kg"
parameter = "vehicle:vehicle.mass"
values = [1200.5, 1300.0, 1400.0]
"#;

fn plan_of(text: &str) -> Result<Plan, String> {
    let driver = include_str!("data/Driver.xml");
    let vehicle = include_str!("../../fmu-import/tests/data/Vehicle.xml");
    let fmus: BTreeMap<String, Arc<ModelDescription>> = [("Driver", driver), ("Vehicle", vehicle)]
        .map(|(name, text)| (name.to_owned(), Arc::new(ModelDescription::parse(text).unwrap())))
        .into();
    resolve_text(Path::new("two.toml"), text, &fmus, &Options::default()).map_err(|error| match error {
        ResolveError::Problems(problems) => {
            problems.problems.iter().map(|problem| problem.line()).collect::<Vec<_>>().join("\n")
        }
        other => other.to_string(),
    })
}

fn parameter(plan: &Plan, run: usize, component: &str, name: &str) -> Option<Value> {
    let component = plan.runs[run].components.iter().find(|other| other.name == component)?;
    Some(component.parameters.iter().find(|setting| setting.name == name)?.value.clone())
}

#[test]
fn two_parameters_have_a_point_for_each_pair() {
    let plan = plan_of(SCENARIO).unwrap_or_else(|text| panic!("{text}"));
    let sweep = plan.sweep.as_ref().unwrap();
    assert_eq!(sweep.second, Some(SecondSweep { title: "Mass".to_owned(), unit: "kg".to_owned() }));
    let names: Vec<&str> = plan.points.iter().map(|point| point.name.as_str()).collect();
    assert_eq!(names[..2], ["speed_36_mass_1200p5", "speed_36_mass_1300"]);
    assert_eq!(plan.points[0].title, "36 km/h, 1200.5 kg");
    let places: Vec<_> = plan.points.iter().map(|point| (point.value, point.second)).collect();
    let expected = [36.0, 72.0].iter().flat_map(|v| [1200.5, 1300.0, 1400.0].iter().map(move |f| (*v, Some(*f))));
    assert_eq!(places, expected.collect::<Vec<_>>());
    // 72 km/h in m/s.
    assert_eq!(parameter(&plan, 5, "driver", "speed.initial"), Some(Value::Real(20.0)));
    assert_eq!(parameter(&plan, 5, "vehicle", "vehicle.mass"), Some(Value::Real(1400.0)));
    assert_eq!(plan.figures[0].kind, FigureKind::HeatMap);
}

#[test]
fn one_parameter_has_a_point_for_each_value() {
    let (first, _) = SCENARIO.split_once("[sweep.second]").unwrap();
    let plan = plan_of(&first.replace("heat_map", "sweep")).unwrap_or_else(|text| panic!("{text}"));
    let names: Vec<&str> = plan.points.iter().map(|point| point.name.as_str()).collect();
    assert_eq!((names, plan.points[1].second), (vec!["speed_36", "speed_72"], None));
}

#[test]
fn mistakes_of_sweeps_are_named() {
    let point = "[[point]]\nname = \"a\"\ntitle = \"A\"\nvalue = 1.0\n";
    let second = "parameter = \"vehicle:vehicle.mass\"\nvalues = [1200.5, 1300.0, 1400.0]\n";
    let cases: [(&str, &str, &str); 11] = [
        ("values = [36.0, 72.0]", "", "a sweep of a `parameter` needs its `values`"),
        ("parameter = \"driver:speed.initial\"", "", "the `values` of a sweep need the `parameter`"),
        ("driver:speed.initial", "speed.initial", "expected \"component:parameter\""),
        ("driver:speed.initial", "drivr:speed.initial", "unknown component `drivr`"),
        ("driver:speed.initial", "driver:speed.initia", "`speed.initia`"),
        ("values = [36.0, 72.0]", "values = []", "expected at least one value"),
        ("values = [36.0, 72.0]", "values = [36.0, 36.0]", "appears twice"),
        (second, "", "the second axis of the sweep needs a `parameter` and `values`, too"),
        ("[sweep]", &format!("{point}[sweep]"), "which generate its points: remove this [[point]]"),
        ("heat_map", "sweep", "is shown by a figure of kind \"heat_map\""),
        ("unit = \"km/h\"", "unit = \"rad\"", "rad"),
    ];
    for (from, to, expected) in cases {
        assert!(SCENARIO.contains(from), "not in the scenario: {from}");
        let found = plan_of(&SCENARIO.replacen(from, to, 1)).err().unwrap_or_else(|| panic!("no mistake found: {to}"));
        assert!(found.contains(expected), "{to}\n  expected {expected}\n  got {found}");
    }
    let (first, _) = SCENARIO.split_once("[sweep.second]").unwrap();
    let found = plan_of(first).unwrap_err();
    assert!(found.contains("needs a [sweep] with a `second` axis"), "{found}");
    // Points that are listed one by one.
    let written = |points: &str| {
        let (head, _) = SCENARIO.split_once("[sweep]").unwrap();
        plan_of(&format!(
            "{head}{points}[sweep]\ntitle = \"Speed\"\nunit = \"km/h\"\nsecond = {{ title = \"Mass\", unit = \"kg\" }}\n"
        ))
    };
    assert!(written(point).unwrap_err().contains("needs a `second` value"));
    let both = format!("{point}second = 2.0\n");
    assert_eq!(written(&both).unwrap().points[0].second, Some(2.0));
    let twice = format!("{both}{}", both.replace("\"a\"", "\"b\""));
    assert!(written(&twice).unwrap_err().contains("two points have the same values"));
}
