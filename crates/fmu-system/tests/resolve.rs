//! Resolves scenarios to plans, with descriptions without binaries (tests/data).

use fmu_import::description::{BaseType, Value};
use fmu_import::description::{BaseUnit, ModelDescription, Unit};
use fmu_import::parameter_set::{Parameter, ParameterSet};
use fmu_system::metrics::{Combine, Definition, Kind};
use fmu_system::plan::{Origin, Plan, Signal};
use fmu_system::report::{Cell, Expect, FigureKind, Metric, Part, Source};
use fmu_system::resolve::{Descriptions, Found, Options, ResolveError, resolve_text};
use fmu_system::run::Order;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

const SCENARIO: &str = include_str!("data/scenario.toml");

fn fmus() -> BTreeMap<String, Arc<ModelDescription>> {
    let parse = |text| Arc::new(ModelDescription::parse(text).unwrap());
    let steering = include_str!("data/Steering.xml");
    // The other steering differs visibly: a second output and no `strategy`.
    let other = steering
        .replace("Steering\"", "OtherSteering\"")
        .replace("\"{steering}\"", "\"{other}\"")
        .replace("name=\"strategy\"", "name=\"mode\"");
    [
        ("Driver", parse(include_str!("data/Driver.xml"))),
        ("Vehicle", parse(include_str!("../../fmu-import/tests/data/Vehicle.xml"))),
        ("Steering", parse(steering)),
        ("OtherSteering", parse(&other)),
    ]
    .map(|(name, description)| (name.to_string(), description))
    .into()
}

fn plan_of(text: &str, options: &Options) -> Result<Plan, ResolveError> {
    resolve_text(Path::new("scenarios/step.toml"), text, &fmus(), options)
}

fn plan() -> Plan {
    plan_of(SCENARIO, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)))
}

/// All mistakes, one per line.
fn lines(error: &ResolveError) -> String {
    match error {
        ResolveError::Problems(problems) => {
            let lines: Vec<_> = problems.problems.iter().map(|p| p.line()).collect();
            lines.join("\n")
        }
        other => other.to_string(),
    }
}

/// All mistakes in an invalid scenario, one per line, with their help.
fn explained(plan: Result<Plan, ResolveError>) -> String {
    match plan.expect_err("a mistake") {
        ResolveError::Problems(problems) => {
            problems.problems.iter().map(|p| p.explained()).collect::<Vec<_>>().join("\n")
        }
        other => other.to_string(),
    }
}

fn parameter(plan: &Plan, run: &str, component: &str, name: &str) -> Option<Value> {
    let run = plan.runs.iter().find(|r| r.id == run).unwrap();
    let component = run.components.iter().find(|u| u.name == component).unwrap();
    let setting = component.parameters.iter().find(|p| p.name == name)?;
    Some(setting.value.clone())
}

#[test]
fn simulation_and_runs() {
    let plan = plan();
    assert_eq!(plan.name, "step");
    assert_eq!(plan.simulation.steps, 2000);
    assert_eq!(plan.simulation.order, Order::Sequential);
    let ids: Vec<_> = plan.runs.iter().map(|r| r.id.as_str()).collect();
    assert_eq!(ids.len(), 3 * 2 * 2);
    assert_eq!(ids[..3], ["passive@slow#3", "passive@slow#7", "passive@fast#3"]);
    assert_eq!(ids[4], "active@slow#3");
}

#[test]
fn an_fmu_without_units_takes_the_place_of_one_with_units() {
    let mut fmus = fmus();
    let bare = include_str!("data/Steering.xml").replace(" unit=\"rad\"", "").replace(" unit=\"m/s\"", "");
    fmus.insert("Bare".to_string(), Arc::new(ModelDescription::parse(&bare).unwrap()));
    for case in ["passive", "active"] {
        let title = format!("name = \"{case}\"\n");
        let text = SCENARIO.replace(&title, &format!("{title}fmu.steering = \"Bare\"\n"));
        let plan = resolve_text(Path::new("scenarios/step.toml"), &text, &fmus, &Options::default())
            .unwrap_or_else(|e| panic!("{}", lines(&e)));
        let column = plan.columns.iter().find(|c| c.name == "steer.front").unwrap();
        assert_eq!(column.unit.as_deref(), Some("rad"), "bare in {case}");
    }
}

/// A block that declares units for other variables, but not for its input and output.
const FOLLOWER: &str = "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"Follower\" guid=\"{follower}\">\
    <CoSimulation modelIdentifier=\"Follower\"/>\
    <UnitDefinitions><Unit name=\"s\"><BaseUnit s=\"1\"/></Unit></UnitDefinitions><ModelVariables>\
    <ScalarVariable name=\"delay\" valueReference=\"0\" causality=\"parameter\" variability=\"fixed\"><Real unit=\"s\" start=\"0\"/></ScalarVariable>\
    <ScalarVariable name=\"bias\" valueReference=\"1\" causality=\"parameter\" variability=\"fixed\"><Real start=\"0\"/></ScalarVariable>\
    <ScalarVariable name=\"command\" valueReference=\"2\" causality=\"input\"><Real start=\"0\"/></ScalarVariable>\
    <ScalarVariable name=\"value\" valueReference=\"3\" causality=\"output\"><Real/></ScalarVariable>\
    </ModelVariables><ModelStructure><Outputs><Unknown index=\"4\"/></Outputs></ModelStructure></fmiModelDescription>";

/// Driver and vehicle, connected directly or through the follower.
fn through_the_follower(connections: &[[&str; 2]], inputs: &str, bias: &str) -> Result<Plan, String> {
    let follower = match connections.len() {
        1 => String::new(),
        _ => format!("[[component]]\nname = \"follower\"\nfmu = \"Follower\"\nparameters = {{ bias = {bias} }}\n"),
    };
    let connections: String =
        connections.iter().map(|[from, to]| format!("[[connection]]\nfrom = \"{from}\"\nto = \"{to}\"\n")).collect();
    let text = format!(
        "title = \"Follower\"\nreference = \"made up\"\n[simulation]\nstop = 2.0\nstep = 0.001\n\
         [[component]]\nname = \"driver\"\nfmu = \"Driver\"\n{follower}\
         [[component]]\nname = \"vehicle\"\nfmu = \"Vehicle\"\ninputs = {{ \"road_friction.*\" = 1.0{inputs} }}\n{connections}\
         [[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\nsignals = [\"vehicle:body.roll\"]\n"
    );
    let mut fmus = fmus();
    fmus.insert("Follower".to_string(), Arc::new(ModelDescription::parse(FOLLOWER).unwrap()));
    resolve_text(Path::new("scenarios/step.toml"), &text, &fmus, &Options::default()).map_err(|error| lines(&error))
}

/// A variable without a unit fits every unit, even if its FMU declares units for other variables.
#[test]
fn a_variable_without_a_unit_passes_signals_of_every_unit() {
    let [from, to] = ["follower:command", "follower:value"];
    // An angle in rad, a speed in m/s.
    let steer = [["driver:driver.steer", from], [to, "vehicle:steer.front"]];
    let speed = [["driver:driver.speed", from], [to, "vehicle:driver.speed"]];
    for (connections, inputs) in [(steer, ""), (speed, ", \"steer.front\" = 0.0")] {
        let plan = through_the_follower(&connections, inputs, "0.1").unwrap_or_else(|error| panic!("{error}"));
        let written = |[from, to]: [&str; 2]| {
            let signal = |name: &str| {
                let (component, variable) = name.split_once(':').unwrap();
                Signal { component: component.to_string(), variable: variable.to_string() }
            };
            let wire = plan.wiring[0].inputs.iter().find(|wire| wire.input == signal(to)).unwrap();
            assert_eq!(wire.source, Origin::Output(signal(from)), "{to}");
        };
        connections.into_iter().for_each(written);
    }
    // Without the follower, a speed would be connected to an angle.
    let error = through_the_follower(&[["driver:driver.speed", "vehicle:steer.front"]], "", "").unwrap_err();
    assert!(error.contains("is in m/s (1 m s^-1), but its target `vehicle:steer.front` is in rad (1 rad)"), "{error}");
    // The unit of its parameters is unknown.
    let error = through_the_follower(&steer, "", "{ value = 1.0, unit = \"deg\" }").unwrap_err();
    assert!(error.contains("`bias` has no unit of measure"), "{error}");
}

#[test]
fn parameters_are_layered_and_converted() {
    let plan = plan();
    let of = |run, component, name| parameter(&plan, run, component, name);
    let run = "active@slow#7";
    assert_eq!(of(run, "steering", "strategy"), Some(Value::Integer(2)), "case over component");
    assert_eq!(of("passive@slow#7", "steering", "strategy"), Some(Value::Integer(1)));
    assert_eq!(of(run, "driver", "seed"), Some(Value::Integer(7)));
    assert_eq!(of(run, "vehicle", "vehicle.mass"), Some(Value::Real(1200.0)));
    assert_eq!(of(run, "vehicle", "tire.lift_off"), Some(Value::Boolean(false)));
    assert_eq!(of(run, "vehicle", "label"), Some(Value::String("car".into())));
    assert_eq!(of(run, "vehicle", "tire.mode"), Some(Value::Integer(0)));
    // 5 km/h; the declared factor is 3.6, and the division is the documented conversion.
    assert_eq!(of(run, "driver", "speed.initial"), Some(Value::Real(5.0 / 3.6)));
    assert_eq!(of(run, "driver", "steer.amplitude"), Some(Value::Real(30.0 / 57.295_779_513_082_32)));
}

#[test]
fn wires_constants_and_columns() {
    let plan = plan();
    let run = plan.runs.iter().find(|r| r.case == "active").unwrap();
    let component = |name: &str| run.components.iter().find(|u| u.name == name).unwrap();
    let slot_of =
        |name: &str, reference| component(name).outputs.iter().find(|w| w.reference == reference).unwrap().slot;
    // The steering gets driver.steer by name, and vehicle.speed from the driver by an explicit connection.
    let steering = &component("steering").inputs;
    assert_eq!(steering[0].slot, slot_of("driver", 3));
    assert_eq!(steering[1].slot, slot_of("driver", 4));
    assert_eq!(steering[0].base_type, BaseType::Real);
    // The vehicle's steer.front and driver.speed are connected. Its friction is constant, with another value on the
    // left.
    let vehicle = component("vehicle");
    assert_eq!(vehicle.inputs.len(), 2);
    let constants: Vec<_> = vehicle.constants.iter().map(|c| (c.name.as_str(), c.value.clone())).collect();
    assert_eq!(constants, [("road_friction.l", Value::Real(0.5)), ("road_friction.r", Value::Real(1.0))]);
    let names: Vec<_> = plan.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["steer.front", "body.roll", "body.roll_rate", "vehicle.speed"]);
    assert_eq!(plan.columns[1].display_unit.as_deref(), Some("deg"));
    assert_eq!(plan.columns[1].factor, 57.295_779_513_082_32);
    assert_eq!(plan.columns[3].units[0].name, "km/h");
    assert_eq!(run.columns[0], Some(slot_of("steering", 5)));

    // Without steering its column is absent and the vehicle's steer.front is the case's constant.
    let manual = plan.runs.iter().find(|r| r.case == "manual").unwrap();
    assert_eq!(manual.columns[0], None);
    assert!(manual.columns[1].is_some());
    let vehicle = manual.components.iter().find(|u| u.name == "vehicle").unwrap();
    assert!(vehicle.constants.iter().any(|c| c.name == "steer.front"));
    let mut slots: Vec<_> = run.components.iter().flat_map(|u| &u.outputs).map(|w| w.slot).collect();
    slots.sort_unstable();
    assert_eq!(slots, (0..run.slots).collect::<Vec<_>>(), "each slot has one writer");
}

/// The text of a scenario with a case `other` that has this line.
fn with_case(line: &str) -> String {
    SCENARIO.replace(
        "[[case]]\nname = \"active\"",
        &format!("[[case]]\nname = \"other\"\ntitle = \"O\"\n{line}\n\n[[case]]\nname = \"active\""),
    )
}

#[test]
fn another_fmu_starts_from_its_own_defaults() {
    let settings = |line: &str| {
        let plan = plan_of(&with_case(line), &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
        let run = plan.runs.iter().find(|r| r.case == "other").unwrap();
        let component = run.components.iter().find(|u| u.fmu.starts_with("Other")).unwrap().clone();
        let settings: Vec<_> = component.parameters.iter().map(|p| format!("{}={}", p.name, p.value)).collect();
        (component, settings, plan.warnings)
    };
    let (component, parameters, warnings) = settings("fmu.steering = \"OtherSteering\"");
    assert_eq!((component.guid.as_str(), component.model_identifier.as_str()), ("{other}", "OtherSteering"));
    assert_eq!(parameters, [""; 0], "none of the component's own");
    assert_eq!(warnings, [""; 0]);
    // The parameters of the case itself apply.
    let (_, parameters, _) = settings("fmu.steering = \"OtherSteering\"\nparameters.steering = { mode = 2 }");
    assert_eq!(parameters, ["mode=2"]);
    // Parameters that both FMUs have are kept; other parameters give a warning.
    let (_, parameters, warnings) = settings("fmu.steering = { fmu = \"OtherSteering\", keep_parameters = true }");
    assert_eq!(parameters, ["sample_time=0.01"]);
    assert_eq!(
        warnings,
        [
            "scenarios/step.toml:17:16: `strategy` is not carried over: OtherSteering has no such parameter, in case `other` \
          (fmu.steering = \"OtherSteering\")"
        ]
    );
    // The component's own FMU is not a replacement.
    let text = with_case("fmu.steering = \"Steering\"");
    let plan = plan_of(&text, &Options::default()).unwrap();
    assert_eq!(parameter(&plan, "other@slow#3", "steering", "strategy"), Some(Value::Integer(1)));
}

/// Points and seeds apply to all cases, and to another FMU as far as it has the same parameter.
#[test]
fn points_and_seeds_reach_another_fmu() {
    let driver = include_str!("data/Driver.xml").replace("Driver\"", "OtherDriver\"");
    let of = |description: &str| {
        let mut fmus = fmus();
        fmus.insert("OtherDriver".into(), Arc::new(ModelDescription::parse(description).unwrap()));
        let text = with_case("fmu.driver = \"OtherDriver\"");
        resolve_text(Path::new("scenarios/step.toml"), &text, &fmus, &Options::default())
            .unwrap_or_else(|e| panic!("{}", lines(&e)))
    };
    let plan = of(&driver);
    assert_eq!(plan.warnings, [""; 0]);
    assert_eq!(parameter(&plan, "other@slow#7", "driver", "seed"), Some(Value::Integer(7)));
    assert_eq!(parameter(&plan, "other@slow#7", "driver", "speed.initial"), Some(Value::Real(5.0 / 3.6)));
    assert_eq!(parameter(&plan, "other@slow#7", "driver", "maneuver"), None);

    let plan = of(&driver.replace("name=\"seed\"", "name=\"chance\"").replace(
        "<Real unit=\"m/s\" displayUnit=\"km/h\" start=\"10\" min=\"0\"/>",
        "<Real unit=\"rad\" start=\"10\"/>",
    ));
    let run = plan.runs.iter().find(|r| r.id == "other@slow#7").unwrap();
    assert!(run.components[0].parameters.is_empty(), "{:?}", run.components[0].parameters);
    let warnings = plan.warnings.join("\n");
    assert!(
        warnings.contains("`speed.initial` is not carried over: it is in rad there, in m/s in the FMU"),
        "{warnings}"
    );
    assert!(warnings.contains("`seed` is not carried over: OtherDriver has no such parameter"), "{warnings}");
    assert_eq!(plan.warnings.len(), 3, "two points and the seeds, once each: {warnings}");
}

#[test]
fn mistakes_name_their_case() {
    let lines_of_case = [
        "fmu.driver = \"Drver\"",
        "fmu.driver = \"Steering\"",
        "fmu.driver = \"Vehicle\"",
        "without = [\"driver\"]",
        "fmu.steering = \"OtherSteering\"\nparameters.steering = { strategy = 1 }",
        "parameters.steering = { stratgy = 1 }",
        "inputs.vehicle = { \"road*\" = -1 }",
        "fmu.driver = { fmu = \"Driver\", keep = true }",
        "fmu.driver = 3",
    ];
    let report =
        lines_of_case.map(|line| format!("{line}\n{}", explained(plan_of(&with_case(line), &Options::default()))));
    insta::assert_snapshot!(report.join("\n\n"));
    // Patterns of recorded signals that match in no case, or not with another FMU.
    let other = include_str!("data/Steering.xml").replace("steer.front", "steer.rear");
    let mut fmus = fmus();
    fmus.insert("Rear".into(), Arc::new(ModelDescription::parse(&other).unwrap()));
    let plan = |text: &str| resolve_text(Path::new("scenarios/step.toml"), text, &fmus, &Options::default());
    let text = with_case("fmu.steering = \"Rear\"\ninputs.vehicle = { \"steer.*\" = 0.0 }")
        .replace("\"steer.*\"]", "\"steering:steer.front\"]");
    let warnings = plan(&text).unwrap_or_else(|e| panic!("{}", lines(&e))).warnings.join("\n");
    let expected = "no output matches `steering:steer.front`, in case `other` (fmu.steering = \"Rear\")";
    assert!(warnings.contains(expected), "{warnings}");
    let error = lines(&plan(&text.replace("steering:steer.front", "steering:steer.frnt")).unwrap_err());
    assert!(error.contains("`steering:steer.frnt`, in case `passive` and case `other` (fmu"), "{error}");
}

/// A value can be given by name wherever a value is allowed.
#[test]
fn values_by_name() {
    let text = with_case("parameters.vehicle = { \"tire.mode\" = \"linear\" }")
        .replace("\"tire.mode\" = 0", "\"tire.mode\" = \"magic\"")
        .replacen("{ \"speed.initial\" =", "{ maneuver = \"fishhook\", \"speed.initial\" =", 1)
        .replacen("maneuver = 1", "maneuver = \"ramp_step\"", 1);
    let plan = plan_of(&text, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let of = |run, component, name| parameter(&plan, run, component, name);
    assert_eq!(of("passive@fast#3", "vehicle", "tire.mode"), Some(Value::Integer(0)), "an enumeration");
    assert_eq!(of("other@fast#3", "vehicle", "tire.mode"), Some(Value::Integer(1)), "in a case");
    assert_eq!(of("passive@fast#3", "driver", "maneuver"), Some(Value::Integer(1)), "an Integer");
    assert_eq!(of("passive@slow#3", "driver", "maneuver"), Some(Value::Integer(2)), "at a point");

    let help = |from: &str, to: &str| {
        let error = plan_of(&SCENARIO.replacen(from, to, 1), &Options::default()).expect_err(to);
        let ResolveError::Problems(problems) = &error else { panic!("{error}") };
        let help = miette::Diagnostic::help(&problems.problems[0]).map(|help| help.to_string());
        (lines(&error), help)
    };
    let (error, hint) = help("maneuver = 1", "maneuver = \"rampstep\"");
    assert!(
        error.contains("`maneuver` has no value `rampstep`, expected one of straight (0), ramp_step (1)"),
        "{error}"
    );
    assert_eq!(hint.as_deref(), Some("did you mean `ramp_step`?"));
    let (error, hint) = help("maneuver = 1", "maneuver = \"Fishhook\"");
    assert!(error.contains("`maneuver` has no value `Fishhook`"), "{error}");
    assert_eq!(hint.as_deref(), Some("did you mean `fishhook`?"));
    let (error, _) = help("maneuver = 1", "maneuver = 9");
    assert!(error.contains("`maneuver` is 9, expected one of straight (0), ramp_step (1), fishhook (2)"), "{error}");
    let (error, _) = help("strategy = 1", "strategy = \"individual\"");
    assert!(error.contains("`strategy` is Integer without named values, got the string \"individual\""), "{error}");

    // In parameter sets as String or as Enumeration of SSP.
    let set = |value: Value| ParameterSet {
        name: "test".into(),
        parameters: vec![Parameter { name: "maneuver".into(), value, unit: None }],
    };
    let by_name = set(Value::String("fishhook".into())).to_xml(&[]).unwrap();
    let text = scenario_with_sets().replacen("maneuver = 1, ", "", 1);
    for component in [by_name.clone(), by_name.replace("ssv:String", "ssv:Enumeration")] {
        let plan = plan_with_sets(&text, [&parameter_set(&[]), &component, &parameter_set(&[])]);
        let plan = plan.unwrap_or_else(|e| panic!("{}", lines(&e)));
        assert_eq!(parameter(&plan, "passive@slow#3", "driver", "maneuver"), Some(Value::Integer(2)));
    }
}

/// An angle of more than a full turn in rad gives a warning, unless its unit is given or the FMU's start value is also
/// more than a full turn.
#[test]
fn angles_that_look_like_degrees_warn() {
    let driver = include_str!("data/Driver.xml").replace(" min=\"-1\" max=\"1\"", "");
    let warnings = |driver: &str, amplitude: &str, options: &Options| {
        let mut fmus = fmus();
        fmus.insert("Driver".into(), Arc::new(ModelDescription::parse(driver).unwrap()));
        let text = SCENARIO.replacen("{ value = 30.0, unit = \"deg\" }", amplitude, 1);
        resolve_text(Path::new("scenarios/step.toml"), &text, &fmus, options)
            .unwrap_or_else(|e| panic!("{}", lines(&e)))
            .warnings
    };
    let usual = Options::default();
    assert_eq!(
        warnings(&driver, "30", &usual),
        ["scenarios/step.toml:12:50: `steer.amplitude` is 30 rad, which is 1719 deg; if degrees are meant, write \
          { value = 30, unit = \"deg\" }"]
    );
    for amplitude in ["-6.28", "{ value = 1719, unit = \"deg\" }", "{ value = 30, unit = \"rad\" }"] {
        assert_eq!(warnings(&driver, amplitude, &usual), [""; 0], "{amplitude}");
    }
    let start = driver.replacen("displayUnit=\"deg\" start=\"0\"", "displayUnit=\"deg\" start=\"10\"", 1);
    assert_eq!(warnings(&start, "30", &usual), [""; 0], "its start value is as large");
    // The angle is in an input file.
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("in.csv");
    std::fs::write(&file, "time,driver.steer\n0,0\n2,30\n").unwrap();
    let options = Options { inputs: Some(file), ..Options::default() };
    let found = warnings(&driver, "0.5", &options).join("\n");
    assert!(found.contains("the input file has the value 30 rad for `driver.steer`"), "{found}");
}

#[test]
fn what_is_too_large_is_rejected_at_once() {
    let with = |from: &str, to: &str| {
        assert!(SCENARIO.contains(from), "{from}");
        lines(&plan_of(&SCENARIO.replacen(from, to, 1), &Options::default()).expect_err(to))
    };
    let error = with("stop = 2.0", "stop = 1e6");
    assert!(
        error.contains("from start 0 s to stop 1000000 s are 1.000e9 steps of 0.001 s, the limit is 100000000"),
        "{error}"
    );
    let error = with("step = 0.001", "step = 1e-300");
    assert!(error.contains("the limit is 100000000"), "{error}");
    // 9e7 steps, every second recorded, 4 signals.
    let error = with("stop = 2.0", "stop = 9e4");
    assert!(error.contains("45000001 rows of 4 signals and the time are 225000005 numbers per run"), "{error}");
    assert!(error.contains("the limit is 125000000"), "{error}");
    let seeds: Vec<String> = (0..2000).map(|seed| seed.to_string()).collect();
    let error = with("values = [3, 7]", &format!("values = [{}]", seeds.join(", ")));
    assert!(error.contains("3 cases, 2 points and 2000 seeds are 12000 runs, the limit is 10000"), "{error}");
    let error = plan_of(SCENARIO, &Options { stop: Some(1e6), ..Options::default() }).unwrap_err().to_string();
    assert!(error.contains("1.000e9 steps of 0.001 s, the limit is 100000000"), "{error}");

    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("step.toml");
    let read = |content: String| {
        std::fs::write(&file, content).unwrap();
        fmu_system::resolve::resolve(&file, &fmus(), &Options::default()).unwrap_err().to_string()
    };
    let error = read(format!("title = \"{}\"", "x".repeat(50_000_000)));
    assert!(error.contains("the file has 50000010 bytes, the limit is 4000000"), "{error}");
    let error = read(format!("title = \"{}\"", "x".repeat(3_000_000)));
    assert!(error.contains("line 1 has 3000010 bytes, the limit is 100000"), "{error}");
    let csv = folder.path().join("in.csv");
    std::fs::write(&csv, format!("time,{}\n0,1\n", "x".repeat(3_000_000))).unwrap();
    let error = plan_of(SCENARIO, &Options { inputs: Some(csv), ..Options::default() }).unwrap_err().to_string();
    assert!(error.contains("in.csv: line 1 has 3000005 bytes, the limit is 1000000"), "{error}");
}

/// Warns about outputs that nothing reads, and about parameters that affect only such outputs according to the model
/// structure.
#[test]
fn what_nothing_reads_warns() {
    let structure =
        "<Outputs><Unknown index=\"5\" dependencies=\"\"/><Unknown index=\"6\" dependencies=\"\"/></Outputs>";
    let driver = include_str!("data/Driver.xml");
    assert!(driver.contains(structure));
    let plan = |initial: &str, text: &str| {
        let driver = driver.replace(structure, &format!("{structure}<InitialUnknowns>{initial}</InitialUnknowns>"));
        let mut fmus = fmus();
        fmus.insert("Driver".into(), Arc::new(ModelDescription::parse(&driver).unwrap()));
        resolve_text(Path::new("scenarios/step.toml"), text, &fmus, &Options::default())
            .unwrap_or_else(|e| panic!("{}", lines(&e)))
    };
    // The steering, the only reader of the angle, is left out in all cases.
    let text = SCENARIO
        .replace("without = [\"steering\"]\ninputs.vehicle = { \"steer.*\" = 0.0 }", "")
        .replace("title = \"Passive\"", "title = \"Passive\"\nwithout = [\"steering\"]")
        .replace("title = \"Without steering\"", "title = \"Without steering\"\nwithout = [\"steering\"]")
        .replace("parameters.steering = { strategy = 2 }", "without = [\"steering\"]")
        .replace("\"road_friction.l\" = 0.5", "\"road_friction.l\" = 0.5, \"steer.front\" = 0.0")
        .replace("signals = [\"vehicle:body.roll\", \"steer.front\"]", "signals = [\"vehicle:body.roll\"]")
        .replace("\"steer.*\"]", "\"vehicle:body.*\"]");
    let separate = "<Unknown index=\"5\" dependencies=\"1 2\"/><Unknown index=\"6\" dependencies=\"1 3\"/>";
    let found = plan(separate, &text);
    assert_eq!(
        found.warnings,
        [
            "scenarios/step.toml:12:30: `steer.amplitude` of `driver` has no effect: nothing reads the outputs that depend on it"
        ]
    );
    let unread: Vec<_> = found.wiring[0].unread.iter().map(|s| s.variable.as_str()).collect();
    assert_eq!(unread, ["driver.steer"]);
    // A superset of the dependencies, or missing dependencies, is not enough for a warning; a trial run decides.
    for initial in ["<Unknown index=\"5\"/><Unknown index=\"6\"/>", ""] {
        let found = plan(initial, &text);
        assert_eq!(found.warnings, [""; 0]);
        assert_eq!(found.trials.len(), 1);
    }
    // One of the cases reads the output, so the parameter is set for that case.
    let found = plan(separate, SCENARIO);
    assert_eq!((found.warnings, found.trials.len()), (Vec::new(), 0));
    // A component that nothing reads.
    let text = SCENARIO.replacen(
        "[[component]]\nname = \"vehicle\"",
        "[[component]]\nname = \"spare\"\nfmu = \"OtherSteering\"\n[[component]]\nname = \"vehicle\"",
        1,
    );
    let text = text.replacen(
        "[[connection]]",
        "[[connection]]\nfrom = \"steering:steer.front\"\nto = \"vehicle:steer.front\"\n[[connection]]",
        1,
    );
    let text =
        text.replace("\"steer.*\"]", "\"steering:steer.*\"]").replace("\"steer.front\"]", "\"steering:steer.front\"]");
    let text = text.replace("without = [\"steering\"]", "without = [\"steering\", \"spare\"]");
    let found = plan("", &text).warnings;
    assert_eq!(
        found,
        [
            "scenarios/step.toml:20:8: nothing reads the outputs of `spare`, and none is recorded, in case `passive` and case \
          `active`; leave the component out with `without`, connect it or record its outputs"
        ]
    );
}

#[test]
fn options_change_the_plan() {
    let options = Options { stop: Some(0.5), order: Some(Order::Jacobi), seeds: Some(1), ..Options::default() };
    let plan = plan_of(SCENARIO, &options).unwrap();
    assert_eq!(plan.simulation.steps, 500);
    assert_eq!(plan.simulation.order, Order::Jacobi);
    assert_eq!(plan.seeds, [3]);
    assert_eq!(plan.runs.len(), 6);
    let odd = Options { stop: Some(0.0005), ..Options::default() };
    let error = plan_of(SCENARIO, &odd).unwrap_err().to_string();
    assert!(error.contains("are 0.5 steps of 0.001 s, which must be a whole number above 0"), "{error}");
}

fn definition(metric: &Metric) -> &Definition {
    match &metric.source {
        Source::Signals(definition) => definition,
        Source::Metrics { value, .. } => panic!("{value:?}"),
    }
}

/// [`SCENARIO`] followed by a metric and a figure.
fn plan_with(metric: &str, figure: &str) -> Result<Plan, ResolveError> {
    let metric = if metric.is_empty() {
        String::new()
    } else {
        format!("[[metric]]\nname = \"more\"\ntitle = \"More\"\n{metric}\n")
    };
    let figure = if figure.is_empty() {
        String::new()
    } else {
        format!("[[figure]]\nname = \"more\"\ntitle = \"More\"\n{figure}\n")
    };
    plan_of(&format!("{SCENARIO}\n{metric}{figure}"), &Options::default())
}

#[test]
fn metrics_of_metrics_and_requirements() {
    let plan = plan_with(
        "value = \"roll_rms / roll_peak\"\nunit = \"1\"\nmax = 0.35\nrequired_of = [\"active\"]\nrequired_by = \"A standard\"",
        "",
    )
    .unwrap_or_else(|e| panic!("{}", lines(&e)));
    let metric = plan.metrics.last().unwrap();
    let Source::Metrics { value, uses } = &metric.source else { panic!("{metric:?}") };
    assert_eq!((&uses[..], metric.unit.as_deref()), (&[0, 1][..], Some("1")));
    assert_eq!(value.value(|index| [Some(1.0), Some(4.0)][index]), Some(0.25));
    let json = serde_json::to_value(metric).unwrap();
    assert_eq!((json["value"].as_str(), json["uses"][1].as_u64()), (Some("roll_rms / roll_peak"), Some(1)));
    let requirement = metric.requirement.as_ref().unwrap();
    assert_eq!(
        (requirement.min, requirement.max, requirement.source.as_deref()),
        (None, Some(0.35), Some("A standard"))
    );
    assert_eq!(requirement.cases, ["active"]);
    let all =
        plan_with("value = \"abs(roll_rms)\"\nmin = 0.0\nmax = 1.0", "").unwrap_or_else(|e| panic!("{}", lines(&e)));
    let requirement = all.metrics.last().unwrap().requirement.as_ref().unwrap();
    assert_eq!(
        (requirement.min, &requirement.cases[..]),
        (Some(0.0), &["passive", "active", "manual"].map(String::from)[..])
    );

    let mistakes = [
        "value = \"roll_rms / rol_peak\"",
        "value = \"roll_rms /\"",
        "value = \"more + 1\"",
        "value = \"1\"\nsignal = \"body.roll\"",
        "value = \"1\"\nkind = \"rms\"",
        "value = \"1\"\nthreshold = 1.0",
        "signal = \"body.roll\"",
        "value = \"1\"\nmin = 2.0\nmax = 1.0",
        "value = \"1\"\nmax = nan",
        "value = \"1\"\nmax = 1.0\nrequired_of = [\"activ\"]",
        "value = \"1\"\nmax = 1.0\nrequired_of = []",
        "value = \"1\"\nrequired_by = \"A standard\"",
        "value = \"1\"\nshare = 0.5",
        "value = \"1\"\nmax = 2.0\nshare = 0.0",
    ];
    let mut report: Vec<String> =
        mistakes.iter().map(|written| format!("{written}\n{}", explained(plan_with(written, "")))).collect();
    let below = SCENARIO.replacen(
        "signal = \"body.roll\"\nkind = \"rms\"\nunit = \"deg\"\nwindow = [0.5, 2.0]",
        "value = \"roll_peak\"",
        1,
    );
    report.push(explained(plan_of(&below, &Options::default())));
    insta::assert_snapshot!(report.join("\n\n"));
}

/// The first row of a discrete-time model holds start values (FMI 2.0.4, section 2.2.7, `initial = exact`).
#[test]
fn a_limit_that_the_first_row_breaks_warns() {
    let warnings = |metric: &str| {
        let plan = plan_with(metric, "").unwrap_or_else(|e| panic!("{metric}: {}", lines(&e)));
        plan.warnings.into_iter().filter(|warning| warning.contains("first row")).collect::<Vec<_>>()
    };
    let steer = "signal = \"steering:steer.front\"\nkind";
    let found = warnings(&format!("{steer} = \"min\"\nmin = 1.0\nrequired_of = [\"active\"]"));
    let [warning] = &found[..] else { panic!("{found:?}") };
    let expected = "`more` can never meet its limit: `steer.front` is already 0 in the first row, where an output of a \
                    discrete-time model still has its start value";
    assert!(warning.contains(expected), "{warning}");
    assert_eq!(warnings(&format!("{steer} = \"max\"\nmax = -1.0\nrequired_of = [\"active\"]")).len(), 1);
    for kept in [
        "\"min\"\nmin = 0.0",
        "\"min\"\nmax = 1.0",
        "\"peak\"\nmin = 1.0",
        "\"min\"\nmin = 1.0\nwindow = [0.1, 2.0]",
        "\"min\"",
    ] {
        assert_eq!(warnings(&format!("{steer} = {kept}")), [""; 0], "{kept}");
    }
    // A continuous-time model computes its outputs for the first row.
    assert_eq!(warnings("signal = \"body.roll\"\nkind = \"min\"\nmin = 1.0"), [""; 0]);
}

/// A String output of the vehicle is neither recorded nor the signal of a metric.
#[test]
fn string_outputs_are_named() {
    let text = "<ScalarVariable name=\"gear.name\" valueReference=\"9000\" causality=\"output\" variability=\"discrete\" \
                initial=\"exact\"><String start=\"\"/></ScalarVariable></ModelVariables>";
    let vehicle = include_str!("../../fmu-import/tests/data/Vehicle.xml").replace("</ModelVariables>", text);
    let mut fmus = fmus();
    fmus.insert("Vehicle".to_string(), Arc::new(ModelDescription::parse(&vehicle).unwrap()));
    for (from, to) in [
        ("\"vehicle:*\"", "\"vehicle:gear.*\""),
        ("\"vehicle:*\"", "\"gear.name\""),
        ("signal = \"body.roll\"", "signal = \"gear.name\""),
        ("signal = \"body.roll\"", "signal = \"vehicle:gear.name\""),
    ] {
        let text = SCENARIO.replacen(from, to, 1);
        let error = resolve_text(Path::new("scenarios/step.toml"), &text, &fmus, &Options::default()).unwrap_err();
        let ResolveError::Problems(problems) = error else { panic!("{error}") };
        let help = miette::Diagnostic::help(&problems.problems[0]).unwrap().to_string();
        assert!(help.starts_with("`gear.name` is a String;"), "{to}: {help}");
    }
}

#[test]
fn figures_of_every_kind() {
    let figure = |written: &str| {
        let plan = plan_with("", written).unwrap_or_else(|e| panic!("{written}: {}", lines(&e)));
        plan.figures.last().unwrap().clone()
    };
    let xy = figure("kind = \"xy\"\nsignals = [\"body.roll\"]\nover = \"steer.front\"\nequal_axes = true");
    assert_eq!((xy.kind, xy.over.is_some(), xy.equal_axes), (FigureKind::Xy, true, true));
    let transfer =
        figure("kind = \"transfer\"\nsignals = [\"body.roll\"]\nover = \"vehicle.speed\"\nband = [0.2, 4.0]");
    assert_eq!((transfer.kind, transfer.band), (FigureKind::Transfer, Some([0.2, 4.0])));
    let scatter = figure("kind = \"scatter\"\nmetrics = [\"roll_rms\"]\nover = \"roll_peak\"");
    assert_eq!((scatter.metrics.as_slice(), scatter.over), (&[0][..], Some(1)));
    assert_eq!(figure("kind = \"distribution\"\nmetrics = [\"roll_rms\"]").kind, FigureKind::Distribution);
    let time = figure("kind = \"time\"\nsignals = [\"body.roll\"]\nright = \"vehicle.speed\"\nsame_scale = true");
    assert!(time.right.is_some() && time.same_scale);
    let mistakes = [
        "kind = \"xy\"\nsignals = [\"body.roll\"]",
        "kind = \"scatter\"\nmetrics = [\"roll_rms\"]",
        "kind = \"scatter\"\nmetrics = [\"roll_rms\"]\nover = \"roll_pek\"",
        "kind = \"transfer\"\nmetrics = [\"roll_rms\"]\nover = \"body.roll\"",
        "kind = \"time\"\nsignals = [\"body.roll\"]\nover = \"steer.front\"",
        "kind = \"xy\"\nsignals = [\"body.roll\"]\nover = \"vehicle.speed\"\nequal_axes = true",
        "kind = \"time\"\nsignals = [\"body.roll\", \"vehicle.speed\"]\nsame_scale = true",
        "kind = \"spectrum\"\nsignals = [\"body.roll\"]\nband = [2.0, 1.0]",
        "kind = \"distribution\"\nmetrics = [\"roll_rms\"]\nwindow = [0.0, 1.0]",
    ];
    let report = mistakes.map(|written| format!("{written}\n{}", explained(plan_with("", written))));
    insta::assert_snapshot!(report.join("\n\n"));
}

#[test]
fn metrics_and_figures() {
    let plan = plan();
    let metric = &plan.metrics[0];
    assert_eq!((&definition(metric).columns[..], metric.unit.as_deref()), (&[1][..], Some("deg")));
    assert_eq!(definition(metric).factor, 57.295_779_513_082_32);
    assert_eq!(metric.paper.as_ref().unwrap().values["passive@slow"], 1.5);
    assert_eq!(plan.metrics[1].unit.as_deref(), Some("rad"), "the variable's own");
    assert_eq!(plan.figures[0].columns, [1, 0]);
    assert_eq!(plan.figures[0].factor, 1.0);
    assert_eq!(plan.figures[0].cases, ["passive", "active", "manual"], "all, unless some are named");
    assert!(!plan.figures[0].separate);
    assert_eq!(plan.figures[1].metrics, [0]);

    // The threshold is in the unit that the signal is converted to; the metric has another unit.
    let text = SCENARIO
        .replace("kind = \"rms\"", "kind = \"crossing\"\nthreshold = 3.0")
        .replace("kind = \"peak\"", "kind = \"share\"\nthreshold = 0.05")
        .replace(
            "kind = \"time\"",
            "kind = \"time\"\ncases = [\"active\"]\nseparate = true\nlevels = [{ value = 0.1, title = \"L\" }]",
        );
    let plan = plan_of(&text, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let metric = &plan.metrics[0];
    assert_eq!((definition(metric).threshold, metric.unit.as_deref()), (Some(3.0), Some("s")));
    assert_eq!(definition(metric).factor, 57.295_779_513_082_32);
    assert_eq!((definition(&plan.metrics[1]).threshold, plan.metrics[1].unit.as_deref()), (Some(0.05), Some("1")));
    let magnitude = text.replace("\"crossing\"", "\"magnitude_crossing\"");
    let plan_of_magnitude = plan_of(&magnitude, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let metric = &plan_of_magnitude.metrics[0];
    assert_eq!((definition(metric).kind, definition(metric).threshold), (Kind::MagnitudeCrossing, Some(3.0)));
    assert_eq!((metric.unit.as_deref(), definition(metric).factor), (Some("s"), definition(&plan.metrics[0]).factor));
    assert_eq!((&plan.figures[0].cases[..], plan.figures[0].separate), (&["active".to_string()][..], true));
    assert_eq!((plan.figures[0].levels[0].value, plan.figures[0].levels[0].title.as_str()), (0.1, "L"));
    // Numbers that refer to the last value: a share, and a time.
    let text_of_last = SCENARIO
        .replace("kind = \"rms\"", "kind = \"settling_time\"\nthreshold = 0.05")
        .replace("kind = \"peak\"", "kind = \"overshoot\"");
    let plan = plan_of(&text_of_last, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    assert_eq!(plan.metrics[0].unit.as_deref(), Some("s"));
    assert_eq!((definition(&plan.metrics[1]).threshold, plan.metrics[1].unit.as_deref()), (None, Some("1")));
    let spectrum = text.replace("kind = \"time\"", "kind = \"spectrum\"");
    let spectrum = spectrum.replace("separate = true\nlevels = [{ value = 0.1, title = \"L\" }]", "");
    let plan = plan_of(&spectrum, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    assert_eq!((plan.figures[0].kind, &plan.figures[0].columns[..]), (FigureKind::Spectrum, &[1, 0][..]));
}

#[test]
fn findings_are_checks_and_texts_with_numbers() {
    let plan = plan();
    let [finding, own] = &plan.findings[..] else { panic!("{:?}", plan.findings) };
    assert_eq!((finding.own, own.own), (false, true));
    let seen: Vec<_> = finding
        .checks
        .iter()
        .map(|c| (c.expect, c.cell.key(), c.against.as_ref().map_or(String::new(), Cell::key)))
        .collect();
    let of = |expect, cell: &str, against: &str| (expect, cell.to_string(), against.to_string());
    assert_eq!(
        seen,
        [
            // The paper's change, printed or computed from its values, is expected; without a change, the paper's
            // value. A cell without a point stands for all points.
            of(Expect::PaperChange, "active@slow", "passive@slow"),
            of(Expect::PaperChange, "active@fast", "active@slow"),
            of(Expect::PaperValue, "passive@slow", ""),
            of(Expect::Lower, "active@slow", "passive@slow"),
            of(Expect::Lower, "active@fast", "passive@fast"),
        ]
    );
    let changes = &plan.metrics[0].paper.as_ref().unwrap().changes;
    assert_eq!((changes["active@fast/passive@fast"], changes["active@fast/active@slow"]), (-30.0, 10.0));
    assert_eq!((own.checks[0].expect, own.checks[0].level, &own.checks[0].against), (Expect::Below, Some(0.1), &None));
    let words = |text: &[Part]| {
        let shown = |part: &Part| match part {
            Part::Words(words) => words.clone(),
            Part::Number { format, cells, against, .. } => {
                let keys = |cells: &[Cell]| cells.iter().map(Cell::key).collect::<Vec<_>>().join(" ");
                format!("[{format:?} {}/{}]", keys(cells), keys(against))
            }
        };
        text.iter().map(shown).collect::<String>()
    };
    assert_eq!(
        words(&finding.explanation),
        "By [By active@slow active@fast/passive@slow passive@fast] from [From /] on, \
         [Ratio manual@slow/active@fast] times."
    );
    let caption = plan.figures[1].caption.as_ref().unwrap();
    assert_eq!(words(caption), "Up to [Value active@fast/].");
    assert!(plan.figures[0].caption.is_none());
}

#[test]
fn metrics_of_several_signals_and_units_of_kinds() {
    let of = |change: &str| {
        let text = SCENARIO.replacen("signal = \"body.roll\"\nkind = \"rms\"\nunit = \"deg\"", change, 1);
        let plan = plan_of(&text, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
        plan.metrics[0].clone()
    };
    let both = "signals = [\"body.roll\", \"steer.front\"]\n";
    let metric = of(&format!("{both}combine = \"min\"\nkind = \"share_below\"\nthreshold = 1.0"));
    assert_eq!(
        (definition(&metric).columns.len(), definition(&metric).combine, metric.unit.as_deref()),
        (2, Some(Combine::Min), Some("1"))
    );
    let metric = of(&format!("{both}combine = \"squares\"\nweights = [1.0, 2.0]\nkind = \"mean\""));
    assert_eq!((definition(&metric).weights.clone(), metric.unit.as_deref()), (vec![1.0, 2.0], Some("1")));
    for (signal, unit) in [("body.roll", "rad.s"), ("body.roll_rate", "rad"), ("vehicle.speed", "m")] {
        let metric = of(&format!("signal = \"vehicle:{signal}\"\nkind = \"integral\""));
        assert_eq!(metric.unit.as_deref(), Some(unit), "{signal}");
    }
    let metric = of("signal = \"body.roll\"\nkind = \"band_power\"\nband = [1.0, 3.0]\nfrom_baseline = true");
    assert_eq!((definition(&metric).band, metric.unit.as_deref()), (Some([1.0, 3.0]), Some("(rad)2")));
    assert!(definition(&metric).from_baseline);
}

#[test]
fn signals_beside_others_and_origins() {
    let text = SCENARIO
        .replacen(
            "window = [0.5, 2.0]",
            "window = [0.5, 2.0]\nminus = \"steer.front\"\nuntil = { signal = \"body.roll\", above = 9.0, unit = \"deg\" }",
            1,
        )
        .replace("kind = \"peak\"", "kind = \"peak\"\nuntil = { signal = \"body.roll\", below = -0.5 }")
        .replace("\"active@slow\" = 1.2 }", "\"active@slow\" = 1.2 }\ncalibrated = [\"passive@slow\"]")
        .replace("kind = \"time\"", "kind = \"time\"\nagainst = \"steer.front\"");
    let plan = plan_of(&text, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let steer = plan.columns.iter().position(|c| c.name == "steer.front");
    assert_eq!((definition(&plan.metrics[0]).minus, definition(&plan.metrics[1]).minus), (steer, None));
    // The level is in the unit of the signal, whatever it was written in.
    let until = definition(&plan.metrics[0]).until.unwrap();
    assert!((until.level - 9f64.to_radians()).abs() < 1e-15 && until.above);
    assert_eq!(plan.columns[until.column].name, "body.roll");
    let until = definition(&plan.metrics[1]).until.unwrap();
    assert_eq!((until.level, until.above), (-0.5, false));
    assert_eq!(plan.metrics[0].paper.as_ref().unwrap().calibrated, Some(vec!["passive@slow".to_string()]));
    assert_eq!((plan.figures[0].against, plan.figures[1].against), (steer, None));
}

#[test]
fn the_json_has_the_agreed_layout() {
    let json = serde_json::to_value(plan()).unwrap();
    assert_eq!(json["format"], 9);
    assert_eq!(json["is_cut"], false);
    assert_eq!(json["simulation"]["order"], "sequential");
    let run = &json["runs"][0];
    assert_eq!(run["seed"], 3);
    assert_eq!(run["components"][0]["fmi"], "2.0");
    let setting = &run["components"][0]["parameters"][0];
    assert_eq!(setting["name"], "maneuver");
    assert_eq!(setting["type"], "Integer");
    assert_eq!(setting["reference"], 0);
    assert_eq!(setting["value"], 1);
    assert!(run["components"][0]["outputs"][0]["slot"].is_u64());
    assert_eq!(json["cases"][0]["baseline"], serde_json::Value::Null);
    assert_eq!(json["figures"][0]["kind"], "time");
    assert_eq!(json["metrics"][0]["window"], serde_json::json!([0.5, 2.0]));
    assert_eq!(json["metrics"][0]["columns"], serde_json::json!([1]));
    assert_eq!(json["figures"][1]["caption"][0], "Up to ");
    let claim = &json["findings"][0]["claim"];
    assert_eq!(claim[0], "Less roll, by ");
    let active = serde_json::json!({ "metric": 0, "case": "active", "point": "slow" });
    let passive = serde_json::json!({ "metric": 0, "case": "passive", "point": "slow" });
    assert_eq!(
        claim[1],
        serde_json::json!({ "format": "paper_by", "metric": 0, "cells": [active], "against": [passive] })
    );
    assert_eq!(
        json["findings"][0]["checks"][0],
        serde_json::json!({ "cell": active, "against": passive, "expect": "paper_change", "level": null })
    );
}

/// An input with an invalid constant is not also reported as unconnected.
#[test]
fn a_wrong_constant_is_the_only_mistake() {
    let text = SCENARIO.replacen("\"road_friction.*\" = 1.0", "\"road_friction.*\" = -1.0", 1);
    let error = lines(&plan_of(&text, &Options::default()).unwrap_err());
    assert!(error.contains("expected at least 0") && !error.contains("nothing writes"), "{error}");
}

#[test]
fn mistakes_are_reported_with_their_place() {
    let changes = [
        ("stop = 2.0", "stopp = 2.0"),
        ("title = \"Step\"", "titel = \"Step\""),
        ("step = 0.001", "step = 0.0011"),
        ("step = 0.001", "step = -1.0"),
        ("stop = 2.0", "stop = -2"),
        ("stop = 2.0", "stop = \"a\""),
        ("name = \"driver\"", "name = \"Driver\""),
        ("name = \"driver\"", "name = \"vehicle\""),
        ("fmu = \"Driver\"", "fmu = \"Drivr\""),
        ("fmu = \"Driver\"", "fmu = \"../Driver\""),
        ("fmu = \"Driver\"", "fmu = \"Driver.fmu\""),
        ("fmu = \"Driver\"", "fmu = \"..\""),
        ("maneuver = 1", "manouver = 1"),
        ("maneuver = 1", "maneuver = 10"),
        ("maneuver = 1", "maneuver = 1.0"),
        ("maneuver = 1", "maneuver = true"),
        ("maneuver = 1", "maneuver = 5000000000"),
        ("maneuver = 1", "driver.speed = 1"),
        ("maneuver = 1", "\"driver.speed\" = 1"),
        ("strategy = 1, ", "gain = 1, "),
        ("unit = \"deg\" } }", "unit = \"grad\" } }"),
        ("value = 30.0, unit = \"deg\"", "value = 300.0, unit = \"deg\""),
        ("value = 30.0, unit = \"deg\"", "value = 30.0"),
        ("value = 30.0, unit", "value = nan, unit"),
        ("\"tire.mode\" = 0", "\"tire.mode\" = 4"),
        ("label = \"car\"", "label = 1"),
        ("\"road_friction.*\" = 1.0, ", ""),
        ("\"road_friction.*\" = 1.0", "\"road_friktion.*\" = 1.0"),
        ("\"road_friction.*\" = 1.0", "\"road_friction.*\" = 1.0, \"road*\" = 1.0"),
        ("\"road_friction.*\" = 1.0", "\"road_friction.*\" = -1.0"),
        ("\"road_friction.*\" = 1.0", "\"*\" = 1.0"),
        ("from = \"driver:driver.speed\"", "from = \"driver:driver.sped\""),
        ("from = \"driver:driver.speed\"", "from = \"diver:driver.speed\""),
        ("from = \"driver:driver.speed\"", "from = \"driver.speed\""),
        ("from = \"driver:driver.speed\"", "from = \"driver:maneuver\""),
        ("from = \"driver:driver.speed\"", "from = \"driver:driver.steer\""),
        ("to = \"steering:vehicle.speed\"", "to = \"steering:steer.front\""),
        (
            "[[case]]\nname = \"passive\"",
            "[[connection]]\nfrom = \"vehicle:vehicle.speed\"\nto = \"steering:vehicle.speed\"\n[[case]]\nname = \"passive\"",
        ),
        (
            "[[case]]\nname = \"passive\"",
            "[[component]]\nname = \"second\"\nfmu = \"Driver\"\n[[case]]\nname = \"passive\"",
        ),
        (
            "to = \"steering:vehicle.speed\"",
            "to = \"steering:vehicle.sp*\"\n[[connection]]\nfrom = \"driver:driver.*\"\nto = \"vehicle:fuel.*\"",
        ),
        ("to = \"steering:vehicle.speed\"", "to = \"steering:*.sp*\""),
        ("from = \"driver:driver.speed\"", "from = \"driver:driver.*\""),
        ("without = [\"steering\"]", "without = [\"stearing\"]"),
        ("without = [\"steering\"]", "without = [\"steering\", \"driver\", \"vehicle\"]"),
        ("without = [\"steering\"]", "without = [\"steering\"]\nparameters.steering = { strategy = 1 }"),
        ("baseline = \"passive\"", "baseline = \"pasive\""),
        ("values = [3, 7]", "values = [3, 3]"),
        ("values = [3, 7]", "values = []"),
        ("values = [3, 7]", "values = [-3]"),
        ("parameter = \"driver:seed\"", "parameter = \"driver:sed\""),
        ("parameter = \"driver:seed\"", "parameter = \"steering:strategy\""),
        ("[sweep]\ntitle = \"Speed\"\nunit = \"km/h\"\n", ""),
        ("value = 5.0\n", "value = inf\n"),
        ("\"vehicle:*\"", "\"vehicle:wheel*\""),
        ("\"vehicle:*\"", "\"vehikle:*\""),
        ("every = 2", "every = 0"),
        ("kind = \"rms\"", "kind = \"rmss\""),
        ("signal = \"body.roll\"", "signal = \"body.rol\""),
        ("signal = \"body.roll\"", "signal = \"driver.steer\""),
        ("unit = \"deg\"\nwindow", "unit = \"m\"\nwindow"),
        ("window = [0.5, 2.0]", "window = [0.5, 3.0]"),
        ("\"passive@slow\" = 1.5", "\"passiv@slow\" = 1.5"),
        ("\"passive@slow\" = 1.5", "\"passive@slo\" = 1.5"),
        ("\"passive@slow\" = 1.5", "passive = 1.5"),
        ("metrics = [\"roll_rms\"]", "metrics = [\"roll_rsm\"]"),
        ("metrics = [\"roll_rms\"]", "signals = [\"body.roll\"]"),
        ("kind = \"rms\"", "kind = \"share\""),
        ("kind = \"rms\"", "kind = \"rms\"\nthreshold = 0.8"),
        ("kind = \"rms\"", "kind = \"crossing\"\nthreshold = nan"),
        ("kind = \"rms\"", "kind = \"magnitude_crossing\""),
        ("kind = \"rms\"", "kind = \"rms\"\nuntil = { signal = \"body.roll\" }"),
        ("kind = \"rms\"", "kind = \"rms\"\nuntil = { signal = \"body.roll\", above = 1.0, below = 2.0 }"),
        ("kind = \"rms\"", "kind = \"rms\"\nuntil = { signal = \"body.roll\", above = inf }"),
        ("kind = \"rms\"", "kind = \"rms\"\nuntil = { signal = \"body.rol\", above = 1.0 }"),
        ("kind = \"rms\"", "kind = \"rms\"\nuntil = { signal = \"body.roll\", above = 1.0, unit = \"m\" }"),
        ("kind = \"rms\"", "kind = \"rms\"\nminus = \"body.rol\""),
        ("kind = \"rms\"", "kind = \"rms\"\nminus = \"vehicle.speed\""),
        ("\"active@slow\" = 1.2 }", "\"active@slow\" = 1.2 }\ncalibrated = [\"passive@slo\"]"),
        ("kind = \"time\"", "kind = \"time\"\nagainst = \"vehicle.speed\""),
        ("kind = \"sweep\"", "kind = \"sweep\"\nagainst = \"body.roll\""),
        ("kind = \"time\"", "kind = \"time\"\ncases = [\"activ\"]"),
        ("kind = \"time\"", "kind = \"time\"\ncases = []"),
        ("kind = \"time\"", "kind = \"time\"\nlevels = [{ value = nan, title = \"\" }]"),
        ("kind = \"time\"", "kind = \"time\"\nlevels = [{ valu = 1.0, title = \"\" }]"),
        ("kind = \"sweep\"", "kind = \"sweep\"\nseparate = true"),
        ("kind = \"sweep\"", "kind = \"sweep\"\nlevels = [{ value = 1.0, title = \"\" }]"),
        ("kind = \"sweep\"", "kind = \"spectrum\""),
        ("expect = \"lower\"", "expect = \"less\""),
        ("expect = \"lower\"", "expect = \"below\""),
        ("expect = \"lower\"", "expect = \"lower\", level = 1.0"),
        ("level = 0.1", "level = inf"),
        ("[\"roll_peak.active\"], expect", "[\"roll_peak.activ\"], expect"),
        ("[\"roll_peak.active\"], expect", "[\"roll_pek.active\"], expect"),
        ("[\"roll_peak.active\"], expect", "[\"roll_peak.active@slw\"], expect"),
        ("[\"roll_peak.active\"], expect", "[\"roll_peak\"], expect"),
        ("[\"roll_peak.active\"], expect", "[\"roll_peak.manual\"], expect"),
        ("[\"roll_peak.active\"], expect = \"lower\"", "[\"roll_peak.active\"]"),
        ("[\"roll_peak.active\"], expect", "[], expect"),
        ("expect = \"below\", level = 0.1", "expect = \"paper_value\""),
        ("expect = \"below\", level = 0.1", "expect = \"falls_more\""),
        ("[{ cells = [\"roll_peak.manual@slow\"], expect = \"below\", level = 0.1 }]", "[]"),
        ("{roll_peak.active@fast}", "{roll_pek.active@fast}"),
        ("{roll_peak.active@fast}", "{roll_peak.active@fast:chang}"),
        ("{roll_peak.active@fast}", "{roll_peak.active@fast:paper}"),
        ("{roll_peak.active@fast}", "{roll_peak.active@fast"),
        ("{roll_rms:from}", "{roll_rms:threshold}"),
        ("{roll_rms.active:by}", "{roll_rms.activ:by}"),
        ("\"active@fast\" = -30.0", "\"activ@fast\" = -30.0"),
        ("\"active@fast\" = -30.0", "\"manual@fast\" = -30.0"),
        ("signal = \"body.roll\"", "combine = \"min\""),
        ("signal = \"body.roll\"", "signals = [\"body.roll\"]"),
        ("signal = \"body.roll\"", "signal = \"body.roll\"\ncombine = \"min\""),
        ("signal = \"body.roll\"", "signal = \"body.roll\"\nsignals = [\"steer.front\"]"),
        ("signal = \"body.roll\"", "signals = [\"body.roll\", \"vehicle.speed\"]\ncombine = \"max\""),
        (
            "signal = \"body.roll\"",
            "signals = [\"body.roll\", \"steer.front\"]\ncombine = \"norm\"\nweights = [1.0, 2.0]",
        ),
        (
            "signal = \"body.roll\"\nkind = \"rms\"\nunit = \"deg\"",
            "signals = [\"body.roll\", \"steer.front\"]\ncombine = \"squares\"\nkind = \"mean\"",
        ),
        (
            "signal = \"body.roll\"\nkind = \"rms\"\nunit = \"deg\"",
            "signals = [\"body.roll\", \"steer.front\"]\ncombine = \"squares\"\nweights = [1.0]\nkind = \"mean\"",
        ),
        (
            "signal = \"body.roll\"",
            "signals = [\"body.roll\", \"steer.front\"]\ncombine = \"squares\"\nweights = [1.0, 2.0]",
        ),
        ("kind = \"rms\"", "kind = \"rms\"\nband = [1.0, 2.0]"),
        ("kind = \"rms\"", "kind = \"band_power\""),
        ("kind = \"rms\"", "kind = \"band_power\"\nband = [2.0, 1.0]"),
        ("kind = \"sweep\"\nmetrics = [\"roll_rms\"]", "kind = \"running\"\nmetrics = [\"roll_peak\"]"),
        ("maneuver = 1", "manuver = 1"),
        ("signal = \"body.roll\"", "signal = \"driver:body.roll\""),
        ("signal = \"body.roll\"", "signal = \"roll_angle\""),
        ("signal = \"body.roll\"", "signal = \"driver:slip\""),
        ("\"vehicle:*\"", "\"vehicle:roll*\""),
        ("unit = \"km/h\" } }", "unit = \"kmh\" } }"),
        ("unit = \"deg\"\nwindow", "unit = \"degs\"\nwindow"),
        ("kind = \"rms\"", "kind = \"RMS\""),
        ("stop = 2.0", "stop = 2.0\norder = \"sequental\""),
        ("kind = \"time\"", "kind = \"tiem\""),
        ("expect = \"lower\"", "expect = \"lowr\""),
        ("{roll_peak.active@fast}", "{roll_peak.active@fast:ratoi}"),
    ];
    let report = changes.map(|(from, to)| {
        assert!(SCENARIO.contains(from), "not in the scenario: {from}");
        let error = plan_of(&SCENARIO.replacen(from, to, 1), &Options::default());
        format!("{from}  ->  {to}\n{}", explained(error))
    });
    insta::assert_snapshot!(report.join("\n\n"));
}

/// FMUs in memory, and names of FMUs that can be built.
struct Workspace(BTreeMap<String, Arc<ModelDescription>>, &'static [&'static str]);

impl Descriptions for Workspace {
    fn find(&self, name: &str) -> Result<Option<Found>, String> {
        self.0.find(name)
    }

    fn names(&self) -> Vec<String> {
        self.0.names()
    }

    fn buildable(&self) -> Vec<String> {
        self.1.iter().map(|name| (*name).to_string()).collect()
    }

    fn place(&self) -> String {
        self.0.place()
    }
}

#[test]
fn missing_fmus_are_one_mistake() {
    let mistake = |text: &str, packed: &[&str]| {
        let mut found = fmus();
        found.retain(|name, _| packed.contains(&name.as_str()));
        let workspace = Workspace(found, &["Driver", "Steering", "Vehicle"]);
        let error = resolve_text(Path::new("scenarios/step.toml"), text, &workspace, &Options::default()).unwrap_err();
        let ResolveError::Problems(problems) = error else { panic!("{error}") };
        let [problem] = &problems.problems[..] else { panic!("{problems:?}") };
        let help = miette::Diagnostic::help(problem).unwrap().to_string();
        (problem.line(), help, miette::Diagnostic::labels(problem).unwrap().count())
    };
    let pack = "`chassis pack scenarios/step.toml` builds all FMUs that this scenario needs";
    let (line, help, marks) = mistake(SCENARIO, &[]);
    assert_eq!(line, "scenarios/step.toml:11:7: 3 FMUs are not in memory: Driver, Steering, Vehicle");
    assert_eq!((help.as_str(), marks), (pack, 1));
    let (line, help, _) = mistake(SCENARIO, &["Driver", "Vehicle"]);
    assert_eq!(line, "scenarios/step.toml:16:7: there is no Steering.fmu in memory");
    assert_eq!(help, pack);
    // The help corrects a typo, whether or not the right FMU is packed. FMUs from elsewhere cannot be built.
    let slip = SCENARIO.replace("fmu = \"Vehicle\"", "fmu = \"Vehicl\"");
    assert_eq!(mistake(&slip, &["Driver", "Steering"]).1, "did you mean `Vehicle`?");
    assert_eq!(mistake(&slip, &["Driver"]).1, format!("`Vehicl`: did you mean `Vehicle`?\n{pack}"));
    let other = SCENARIO.replace("fmu = \"Vehicle\"", "fmu = \"Somebodys\"");
    let elsewhere = "if an FMU is not built in this workspace, give its folder with --fmus";
    assert_eq!(mistake(&other, &["Driver", "Steering"]).1, elsewhere);
}

/// An input that has no writer, or several, because of the FMU that a case names.
#[test]
fn a_swap_that_breaks_the_wiring_is_named() {
    let mistakes = |text: &str, name: &str, description: &str| {
        let mut fmus = fmus();
        fmus.insert(name.to_string(), Arc::new(ModelDescription::parse(description).unwrap()));
        lines(&resolve_text(Path::new("scenarios/step.toml"), text, &fmus, &Options::default()).unwrap_err())
    };
    let driver = include_str!("data/Driver.xml");
    let text = with_case("fmu.driver = \"Mute\"");
    let error = mistakes(&text, "Mute", &driver.replace("name=\"driver.steer\"", "name=\"steer\""));
    assert_eq!(
        error,
        "scenarios/step.toml:36:14: Mute has no output `driver.steer`, which Driver has; nothing writes the input \
         `driver.steer` of `steering`, in case `other` (fmu.driver = \"Mute\")"
    );
    // Only the connection is reported, not the consequence that its input has no writer.
    let error = mistakes(&text, "Mute", &driver.replace("name=\"driver.speed\"", "name=\"speed\""));
    let connection =
        "scenarios/step.toml:26:8: `driver` has no output `driver.speed`, which Driver has, in case `other`";
    assert!(error.contains(connection), "{error}");
    assert!(!error.contains("of `steering`"), "{error}");

    let vehicle = include_str!("../../fmu-import/tests/data/Vehicle.xml");
    let text = with_case("fmu.vehicle = \"Loud\"");
    let error = mistakes(&text, "Loud", &vehicle.replace("name=\"body.roll_rate\"", "name=\"driver.steer\""));
    let several = "Loud has the output `driver.steer`, which Vehicle does not have; the input `driver.steer` of \
                   `steering` has several writers: `driver` and `vehicle`, in case `other` (fmu.vehicle = \"Loud\")";
    assert!(error.contains(several), "{error}");
}

#[test]
fn a_stop_on_the_command_line_is_named() {
    let error = |stop| plan_of(SCENARIO, &Options { stop: Some(stop), ..Options::default() }).unwrap_err().to_string();
    assert_eq!(error(-3.0), "--stop -3: the stop must be later than the start, 0 s");
    assert_eq!(
        error(1e9),
        "--stop 1000000000: from start 0 s to stop 1000000000 s are 1.000e12 steps of 0.001 s, the limit is 100000000"
    );
    assert!(
        error(0.0005).starts_with("--stop 0.0005: from start 0 s to stop 0.0005 s are 0.5 steps"),
        "{}",
        error(0.0005)
    );
    assert!(error(9e4).starts_with("--stop 90000: 45000001 rows of 4 signals"), "{}", error(9e4));
}

#[test]
fn a_stop_that_is_too_late_is_marked() {
    let marked = |stop: &str| {
        let text = SCENARIO.replace("stop = 2.0", &format!("stop = {stop}"));
        let error = plan_of(&text, &Options::default()).unwrap_err();
        let ResolveError::Problems(problems) = error else { panic!("{error}") };
        let labels = miette::Diagnostic::labels(&problems.problems[0]).unwrap();
        labels.map(|label| text[label.offset()..][..label.len()].to_string()).collect::<Vec<_>>()
    };
    assert_eq!(marked("1e6"), ["1e6", "0.001"]);
    assert_eq!(marked("9e4"), ["9e4", "2"], "stop and every");
}

/// Input time series replace outputs; components that are no longer needed are dropped.
#[test]
fn inputs_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("in.csv");
    let with = |content: &str| {
        std::fs::write(&file, content).unwrap();
        let options = Options { inputs: Some(file.clone()), ..Options::default() };
        plan_of(SCENARIO, &options)
    };
    // The driver's speed also reaches the steering's vehicle.speed, which is wired to it.
    let plan = with("time,driver.speed,driver.steer\n0,10,0\n2,12,0.1\n").unwrap();
    let run = plan.runs.iter().find(|r| r.case == "passive").unwrap();
    let names: Vec<_> = run.components.iter().map(|u| u.name.as_str()).collect();
    assert_eq!(names, ["steering", "vehicle"], "the driver is dropped");
    assert_eq!(run.series.len(), 2);
    assert_eq!(*run.series[0].values, [10.0, 12.0]);
    assert_eq!(run.components[0].inputs[0].slot, run.series[1].slot);
    assert_eq!(run.components[0].inputs[1].slot, run.series[0].slot);

    // A warning lists the output that the file replaces, and each input that read it.
    let at = |warnings: &[String], column: &str| {
        let found = warnings.iter().find(|warning| warning.contains(&format!("in.csv: `{column}` replaces")));
        found.map(|warning| warning.split_once("in.csv: ").unwrap().1.to_owned())
    };
    let speed =
        "`driver.speed` replaces the output `driver:driver.speed` at `steering:vehicle.speed`, `vehicle:driver.speed`";
    assert_eq!(at(&plan.warnings, "driver.speed").as_deref(), Some(speed), "{:?}", plan.warnings);
    assert!(at(&plan.warnings, "driver.steer").is_some());
    let unit = "in.csv: columns without a unit are assumed to have that of the variable: ";
    assert!(plan.warnings.iter().any(|warning| warning.contains(unit)), "{:?}", plan.warnings);

    // A column for one input of one component: the other inputs still read the driver's output. A column takes
    // precedence over a constant.
    let plan = with("time,vehicle:driver.speed,road_friction.l\n0,10,0.3\n2,10,0.3\n").unwrap();
    let run = plan.runs.iter().find(|r| r.case == "passive").unwrap();
    assert_eq!(run.components.len(), 3);
    let vehicle = run.components.iter().find(|u| u.name == "vehicle").unwrap();
    assert_eq!(vehicle.constants.len(), 1);
    assert_eq!(vehicle.inputs.len(), 3);

    let plan = with("time,driver.speed\n0,10\n1,11\n1,12\n1,13\n2,14\n").unwrap();
    let rows = "in.csv: several rows are at 1 s; the first is the value before the jump, the last the one after it, those \
                between are ignored";
    assert!(plan.warnings.iter().any(|warning| warning.contains(rows)), "{:?}", plan.warnings);

    let error = with("time,driver.sped\n0,1\n").unwrap_err().to_string();
    assert!(error.contains("in.csv: no input takes the signal `driver.sped`; did you mean `driver.speed`?"), "{error}");
    let error = with("time,driver.speed\n1,1\n2,1\n").unwrap_err().to_string();
    assert!(error.contains("from 0 s to 1 s it has no value"), "{error}");
}

/// A number that is not in the list of an enumeration is rejected as in a scenario.
#[test]
fn items_from_a_file() {
    let text = "<ScalarVariable name=\"gear\" valueReference=\"9000\" causality=\"input\" variability=\"discrete\">\
                <Enumeration declaredType=\"Mode\" start=\"1\"/></ScalarVariable></ModelVariables>";
    let vehicle = include_str!("../../fmu-import/tests/data/Vehicle.xml").replace("</ModelVariables>", text);
    let mut fmus = fmus();
    fmus.insert("Vehicle".to_string(), Arc::new(ModelDescription::parse(&vehicle).unwrap()));
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("in.csv");
    let options = Options { inputs: Some(file.clone()), ..Options::default() };
    let with = |last: f64| {
        std::fs::write(&file, format!("time,vehicle:gear\n0,1\n1,{last}\n2,1\n")).unwrap();
        resolve_text(Path::new("scenarios/step.toml"), SCENARIO, &fmus, &options)
    };
    assert_eq!(*with(0.0).unwrap().runs[0].series[0].values, [1.0, 0.0, 1.0]);
    for (value, rule) in [(7.0, "is an enumeration: expected one of"), (1.5, "is Integer")] {
        let error = with(value).unwrap_err().to_string();
        let expected =
            format!("in.csv: `vehicle:gear` has the value {value} at 1 s, but the input `gear` of `vehicle` {rule}");
        assert!(error.contains(&expected), "{error}");
    }
}

/// Columns have different names, and no signal is named like the time column.
#[test]
fn names_of_columns_are_told_apart() {
    let text = "<ScalarVariable name=\"time\" valueReference=\"9000\" causality=\"output\"><Real/></ScalarVariable>\
                </ModelVariables>";
    let vehicle = include_str!("../../fmu-import/tests/data/Vehicle.xml").replace("</ModelVariables>", text);
    let mut fmus = fmus();
    fmus.insert("Vehicle".to_string(), Arc::new(ModelDescription::parse(&vehicle).unwrap()));
    let scenario = SCENARIO.replacen("signals = [", "signals = [\"vehicle:time\", ", 1);
    let plan = resolve_text(Path::new("scenarios/step.toml"), &scenario, &fmus, &Options::default()).unwrap();
    let names: Vec<&str> = plan.columns.iter().map(|column| column.name.as_str()).collect();
    assert!(names.contains(&"vehicle:time") && !names.contains(&"time"), "{names:?}");
}

/// Makes a parameter set of Reals from names and values, with or without units.
fn parameter_set(values: &[(&str, f64, Option<&str>)]) -> String {
    let parameters = values
        .iter()
        .map(|(name, value, unit)| Parameter {
            name: (*name).to_string(),
            value: Value::Real(*value),
            unit: unit.map(str::to_string),
        })
        .collect();
    let unit = |name: &str| Unit {
        name: name.to_string(),
        base: Some(BaseUnit { exponents: [0; 8], factor: 1.0, offset: 0.0 }),
        display_units: Vec::new(),
    };
    ParameterSet { name: "test".into(), parameters }.to_xml(&["deg", "rad", "m"].map(unit)).unwrap()
}

/// Resolves a scenario with parameter sets for the scenario, the component `driver` and the case `active`.
fn plan_with_sets(text: &str, sets: [&str; 3]) -> Result<Plan, ResolveError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in ["scenario", "component", "case"].iter().zip(sets) {
        std::fs::write(folder.path().join(format!("{name}.ssv")), content).unwrap();
    }
    let file = folder.path().join("step.toml");
    resolve_text(&file, text, &fmus(), &Options::default())
}

fn scenario_with_sets() -> String {
    SCENARIO
        .replacen("title = \"Step\"", "title = \"Step\"\nparameter_set = \"scenario.ssv\"", 1)
        .replacen("fmu = \"Driver\"", "fmu = \"Driver\"\nparameter_set = \"component.ssv\"", 1)
        .replacen("baseline = \"passive\"", "baseline = \"passive\"\nparameter_set = \"case.ssv\"", 1)
}

/// The precedence rises in this order: the scenario's set, the component's set, the component's parameters, the case's
/// set, the parameters of the case and of the point.
#[test]
fn parameter_sets_are_layers_of_their_own() {
    let amplitude = "driver:steer.amplitude";
    let scenario = parameter_set(&[(amplitude, 0.1, None), ("vehicle.vehicle.mass", 900.0, None)]);
    let component = parameter_set(&[("steer.amplitude", 28.647_889_756_541_16, Some("deg"))]);
    let case = parameter_set(&[(amplitude, 0.3, Some("rad"))]);
    let text = scenario_with_sets();
    let sets = [scenario.as_str(), &component, &case];
    let value = |text: &str, run: &str, component: &str, name: &str| {
        let plan = plan_with_sets(text, sets).unwrap_or_else(|e| panic!("{}", lines(&e)));
        match parameter(&plan, run, component, name) {
            Some(Value::Real(v)) => v,
            other => panic!("{other:?}"),
        }
    };
    let (amplitude, mass) = ("steer.amplitude", "vehicle.mass");
    assert_eq!(value(&text, "passive@slow#3", "vehicle", mass), 1200.0, "the component's value overrides the set");
    assert_eq!(
        value(&text, "active@slow#3", "driver", amplitude),
        0.3,
        "the case's set overrides the component's value"
    );
    let bare = text.replacen(", \"steer.amplitude\" = { value = 30.0, unit = \"deg\" }", "", 1);
    // 0.5 rad in degrees, up to the rounding of the conversion.
    assert!((value(&bare, "passive@slow#3", "driver", amplitude) - 0.5).abs() < 1e-15, "component's over scenario's");
    let bare = bare.replacen("\"vehicle.mass\" = 1200, ", "", 1);
    assert_eq!(value(&bare, "passive@slow#3", "vehicle", mass), 900.0, "the scenario's set");
}

#[test]
fn mistakes_in_parameter_sets_are_marked_where_the_file_is_named() {
    let empty = parameter_set(&[]);
    let text = scenario_with_sets();
    for (scenario, component, expected) in [
        ("<a/>", empty.as_str(), "scenario.ssv: line 1, column 1: expected <ssv:ParameterSet>"),
        (&parameter_set(&[("seed", 1.0, None)]), &empty, "expected \"component.parameter\""),
        (&parameter_set(&[("steer.amplitude", 1.0, None)]), &empty, "unknown component `steer`"),
        (&parameter_set(&[("diver:seed", 1.0, None)]), &empty, "`diver:seed`: unknown component `diver`"),
        (&parameter_set(&[("driver:sed", 1.0, None)]), &empty, "2:17: scenario.ssv: Driver has no parameter `sed`"),
        (&parameter_set(&[("driver:seed", 1.0, None)]), &empty, "`seed` is Integer, got 1.0, Real"),
        (&empty, &parameter_set(&[("steer.amplitude", 300.0, Some("deg"))]), "component.ssv: `steer.amplitude` is 5.2"),
        (&empty, &parameter_set(&[("steer.amplitude", 1.0, Some("m"))]), "cannot be given in `m`"),
    ] {
        let error = lines(&plan_with_sets(&text, [scenario, component, &empty]).unwrap_err());
        assert!(error.contains(expected), "expected {expected}\n  got {error}");
    }
    let missing = text.replacen("component.ssv", "none.ssv", 1);
    let error = lines(&plan_with_sets(&missing, [&empty, &empty, &empty]).unwrap_err());
    assert!(error.contains("cannot read") && error.contains("none.ssv"), "{error}");
}

/// Resolves a scenario that consists of several files, given by name and text. The first file includes the others.
fn plan_of_files(files: &[(&str, String)]) -> Result<Plan, ResolveError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    resolve_text(&folder.path().join(files[0].0), &files[0].1, &fmus(), &Options::default())
}

/// [`SCENARIO`] in two files: the part before the metrics, and the rest.
fn two_files(own: &str) -> [(&'static str, String); 2] {
    let (head, rest) = SCENARIO.split_at(SCENARIO.find("[[metric]]").unwrap());
    let system = &head[head.find("[simulation]").unwrap()..];
    let texts = &head[..head.find("[simulation]").unwrap()];
    let own = format!("include = [\"parts/system.toml\"]\n{own}{texts}{rest}");
    [("step.toml", own), ("parts/system.toml", system.to_string())]
}

#[test]
fn an_included_file_is_part_of_the_scenario() {
    let found = plan_of_files(&two_files("")).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let whole = plan();
    assert_eq!((&found.runs, &found.metrics, &found.figures), (&whole.runs, &whole.metrics, &whole.figures));
    assert_eq!(found.findings, whole.findings);
    // The scenario's `parameters` override those of the components.
    let found =
        plan_of_files(&two_files("parameters.driver = { maneuver = 2 }\n")).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let maneuver = |plan: &Plan| {
        let driver = plan.runs[0].components.iter().find(|component| component.name == "driver").unwrap();
        driver.parameters.iter().find(|parameter| parameter.name == "maneuver").map(|parameter| parameter.value.clone())
    };
    assert_eq!((maneuver(&whole), maneuver(&found)), (Some(Value::Integer(1)), Some(Value::Integer(2))));
}

#[test]
fn mistakes_name_the_included_file() {
    let broken = |change: fn(&mut [(&'static str, String); 2])| {
        let mut files = two_files("");
        change(&mut files);
        lines(&plan_of_files(&files).unwrap_err())
    };
    let found = broken(|files| files[1].1 = files[1].1.replace("step = 0.001", "step = -1.0"));
    assert!(found.contains("parts/system.toml:3:8: step is -1, expected more than 0"), "{found}");
    let found = broken(|files| files[1].1 = files[1].1.replace("stop = ", "stopp = "));
    assert!(found.contains("parts/system.toml:2:1: unknown key `stopp`"), "{found}");
    let found = broken(|files| files[1].1.insert_str(0, "title = \"Part\"\n"));
    assert!(found.contains("parts/system.toml:1:9: an included file must not have `title`"), "{found}");
    let found = broken(|files| files[1].1.insert_str(0, "include = [\"other.toml\"]\n"));
    assert!(found.contains("parts/system.toml:1:12: an included file cannot include others"), "{found}");
    let found = broken(|files| files[0].1 = files[0].1.replace("parts/system.toml", "parts/sytem.toml"));
    assert!(found.contains("step.toml:1:12: cannot read ") && found.contains("sytem.toml"), "{found}");
    let found = lines(&plan_of_files(&two_files("parameters.drivr = { maneuver = 1 }\n")).unwrap_err());
    assert!(found.contains("step.toml:2:12: unknown component `drivr`"), "{found}");
    // Two files that have the same case.
    let found = broken(|files| files[0].1.push_str("\n[[case]]\nname = \"passive\"\ntitle = \"Again\"\n"));
    assert!(found.contains("step.toml:") && found.contains("the case `passive` appears twice"), "{found}");
}
