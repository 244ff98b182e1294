//! Scenarios into plans, on descriptions without binaries (tests/data).

use host::description::{BaseUnit, ModelDescription, Unit};
use host::parameter_set::{Parameter, ParameterSet};
use host::plan::{BaseType, FigureKind, MetricKind, Order, Plan, Value};
use host::resolve::{Options, ResolveError, resolve_text};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

const SCENARIO: &str = include_str!("data/scenario.toml");

fn fmus() -> BTreeMap<String, Arc<ModelDescription>> {
    let parse = |text| Arc::new(ModelDescription::parse(text).unwrap());
    let steering = include_str!("data/Steering.xml");
    // The other steering differs in what shows: a second output and no `strategy`.
    let other = steering
        .replace("Steering\"", "OtherSteering\"")
        .replace("\"{steering}\"", "\"{other}\"")
        .replace("name=\"strategy\"", "name=\"mode\"");
    [
        ("Driver", parse(include_str!("data/Driver.xml"))),
        ("Vehicle", parse(include_str!("data/Vehicle.xml"))),
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

fn parameter(plan: &Plan, run: &str, unit: &str, name: &str) -> Option<Value> {
    let run = plan.runs.iter().find(|r| r.id == run).unwrap();
    let unit = run.units.iter().find(|u| u.name == unit).unwrap();
    let setting = unit.parameters.iter().find(|p| p.name == name)?;
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

#[test]
fn parameters_are_layered_and_converted() {
    let plan = plan();
    let of = |run, unit, name| parameter(&plan, run, unit, name);
    let run = "active@slow#7";
    assert_eq!(of(run, "steering", "strategy"), Some(Value::Integer(2)), "case over unit");
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
    let unit = |name: &str| run.units.iter().find(|u| u.name == name).unwrap();
    let slot_of = |name: &str, reference| unit(name).outputs.iter().find(|w| w.reference == reference).unwrap().slot;
    // Steering takes driver.steer by name, vehicle.speed from the driver by connection.
    let steering = &unit("steering").inputs;
    assert_eq!(steering[0].slot, slot_of("driver", 3));
    assert_eq!(steering[1].slot, slot_of("driver", 4));
    assert_eq!(steering[0].base_type, BaseType::Real);
    // The vehicle: steer.front and driver.speed wired, friction constant, the left one its own.
    let vehicle = unit("vehicle");
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
    let vehicle = manual.units.iter().find(|u| u.name == "vehicle").unwrap();
    assert!(vehicle.constants.iter().any(|c| c.name == "steer.front"));
    let mut slots: Vec<_> = run.units.iter().flat_map(|u| &u.outputs).map(|w| w.slot).collect();
    slots.sort_unstable();
    assert_eq!(slots, (0..run.slots).collect::<Vec<_>>(), "each slot has one writer");
}

#[test]
fn another_fmu_in_a_case() {
    let text = SCENARIO.replace(
        "[[case]]\nname = \"active\"",
        "[[case]]\nname = \"other\"\ntitle = \"O\"\nfmu.steering = \"OtherSteering\"\n\n[[case]]\nname = \"active\"",
    );
    // The unit's own `strategy` is unknown to the other FMU, which is said.
    let error = lines(&plan_of(&text, &Options::default()).unwrap_err());
    assert!(error.contains("OtherSteering has no parameter `strategy`"), "{error}");
    let text = text.replace("parameters = { strategy = 1, sample_time = 0.01 }", "");
    let plan = plan_of(&text, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let run = plan.runs.iter().find(|r| r.case == "other").unwrap();
    let steering = run.units.iter().find(|u| u.name == "steering").unwrap();
    assert_eq!(steering.fmu, "OtherSteering.fmu");
    assert_eq!(steering.guid, "{other}");
    assert_eq!(steering.model_identifier, "OtherSteering");
}

#[test]
fn options_change_the_plan() {
    let options = Options { stop: Some(0.5), order: Some(Order::Jacobi), seeds: Some(1), inputs: None };
    let plan = plan_of(SCENARIO, &options).unwrap();
    assert_eq!(plan.simulation.steps, 500);
    assert_eq!(plan.simulation.order, Order::Jacobi);
    assert_eq!(plan.seeds, [3]);
    assert_eq!(plan.runs.len(), 6);
    let odd = Options { stop: Some(0.0005), ..Options::default() };
    let error = plan_of(SCENARIO, &odd).unwrap_err().to_string();
    assert!(error.contains("not a whole number of steps"), "{error}");
}

#[test]
fn metrics_and_figures() {
    let plan = plan();
    let metric = &plan.metrics[0];
    assert_eq!((metric.column, metric.unit.as_deref()), (1, Some("deg")));
    assert_eq!(metric.factor, 57.295_779_513_082_32);
    assert_eq!(metric.paper.as_ref().unwrap().values["passive@slow"], 1.5);
    assert_eq!(plan.metrics[1].unit.as_deref(), Some("rad"), "the variable's own");
    assert_eq!(plan.figures[0].columns, [1, 0]);
    assert_eq!(plan.figures[0].factor, 1.0);
    assert_eq!(plan.figures[0].cases, ["passive", "active", "manual"], "all, unless some are named");
    assert!(!plan.figures[0].separate);
    assert_eq!(plan.figures[1].metrics, [0]);

    // The threshold is in the unit the signal is converted to; the number has a unit of its own.
    let text = SCENARIO
        .replace("kind = \"rms\"", "kind = \"crossing\"\nthreshold = 3.0")
        .replace("kind = \"peak\"", "kind = \"share\"\nthreshold = 0.05")
        .replace(
            "kind = \"time\"",
            "kind = \"time\"\ncases = [\"active\"]\nseparate = true\nlevels = [{ value = 0.1, title = \"L\" }]",
        );
    let plan = plan_of(&text, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let metric = &plan.metrics[0];
    assert_eq!((metric.threshold, metric.unit.as_deref()), (Some(3.0), Some("s")));
    assert_eq!(metric.factor, 57.295_779_513_082_32);
    assert_eq!((plan.metrics[1].threshold, plan.metrics[1].unit.as_deref()), (Some(0.05), Some("1")));
    let magnitude = text.replace("\"crossing\"", "\"magnitude_crossing\"");
    let plan_of_magnitude = plan_of(&magnitude, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let metric = &plan_of_magnitude.metrics[0];
    assert_eq!((metric.kind, metric.threshold), (MetricKind::MagnitudeCrossing, Some(3.0)));
    assert_eq!((metric.unit.as_deref(), metric.factor), (Some("s"), plan.metrics[0].factor));
    assert_eq!((&plan.figures[0].cases[..], plan.figures[0].separate), (&["active".to_string()][..], true));
    assert_eq!((plan.figures[0].levels[0].value, plan.figures[0].levels[0].title.as_str()), (0.1, "L"));
    // Numbers that refer to the last value: a share, and a time.
    let text_of_last = SCENARIO
        .replace("kind = \"rms\"", "kind = \"settling_time\"\nthreshold = 0.05")
        .replace("kind = \"peak\"", "kind = \"overshoot\"");
    let plan = plan_of(&text_of_last, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    assert_eq!(plan.metrics[0].unit.as_deref(), Some("s"));
    assert_eq!((plan.metrics[1].threshold, plan.metrics[1].unit.as_deref()), (None, Some("1")));
    let spectrum = text.replace("kind = \"time\"", "kind = \"spectrum\"");
    let spectrum = spectrum.replace("separate = true\nlevels = [{ value = 0.1, title = \"L\" }]", "");
    let plan = plan_of(&spectrum, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    assert_eq!((plan.figures[0].kind, &plan.figures[0].columns[..]), (FigureKind::Spectrum, &[1, 0][..]));
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
        .replace("{ \"passive@slow\" = 1.5 }", "{ \"passive@slow\" = 1.5 }\ncalibrated = [\"passive@slow\"]")
        .replace("kind = \"time\"", "kind = \"time\"\nagainst = \"steer.front\"");
    let plan = plan_of(&text, &Options::default()).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let steer = plan.columns.iter().position(|c| c.name == "steer.front");
    assert_eq!((plan.metrics[0].minus, plan.metrics[1].minus), (steer, None));
    // The level is in the unit of the signal, whatever it was written in.
    let until = plan.metrics[0].until.unwrap();
    assert!((until.level - 9f64.to_radians()).abs() < 1e-15 && until.above);
    assert_eq!(plan.columns[until.column].name, "body.roll");
    let until = plan.metrics[1].until.unwrap();
    assert_eq!((until.level, until.above), (-0.5, false));
    assert_eq!(plan.metrics[0].paper.as_ref().unwrap().calibrated, Some(vec!["passive@slow".to_string()]));
    assert_eq!((plan.figures[0].against, plan.figures[1].against), (steer, None));
}

#[test]
fn the_json_has_the_agreed_layout() {
    let json = serde_json::to_value(plan()).unwrap();
    assert_eq!(json["format"], 1);
    assert_eq!(json["simulation"]["order"], "sequential");
    let run = &json["runs"][0];
    assert_eq!(run["seed"], 3);
    let setting = &run["units"][0]["parameters"][0];
    assert_eq!(setting["name"], "maneuver");
    assert_eq!(setting["type"], "Integer");
    assert_eq!(setting["reference"], 0);
    assert_eq!(setting["value"], 1);
    assert!(run["units"][0]["outputs"][0]["slot"].is_u64());
    assert_eq!(json["cases"][0]["baseline"], serde_json::Value::Null);
    assert_eq!(json["figures"][0]["kind"], "time");
    assert_eq!(json["metrics"][0]["window"], serde_json::json!([0.5, 2.0]));
    assert_eq!(json["findings"][0]["status"], "partly");
}

/// One change to the scenario, where the mistake is marked, and what is said.
#[test]
fn mistakes_are_reported_with_their_place() {
    let cases: &[(&str, &str, &str)] = &[
        ("stop = 2.0", "stopp = 2.0", "5:1: unknown field `stopp`"),
        ("title = \"Step\"", "titel = \"Step\"", "1:1: unknown field `titel`"),
        ("step = 0.001", "step = 0.0011", "6:8: (stop - start)/step is"),
        ("step = 0.001", "step = -1.0", "6:8: step is -1"),
        ("stop = 2.0", "stop = -2", "5:8: stop is -2"),
        ("stop = 2.0", "stop = \"a\"", "5:8: invalid type: string \"a\""),
        ("name = \"driver\"", "name = \"Driver\"", "the name of a unit is made of"),
        ("name = \"driver\"", "name = \"vehicle\"", "the unit `vehicle` is there twice"),
        ("fmu = \"Driver\"", "fmu = \"Drivr\"", "11:7: there is no Drivr.fmu in memory"),
        ("fmu = \"Driver\"", "fmu = \"../Driver\"", "file stem"),
        ("maneuver = 1", "manouver = 1", "Driver has no parameter `manouver`"),
        ("maneuver = 1", "maneuver = 10", "12:27: `maneuver` is 10, expected at most 9"),
        ("maneuver = 1", "maneuver = 1.0", "12:27: `maneuver` is Integer, got float"),
        ("maneuver = 1", "maneuver = true", "`maneuver` is Integer, got boolean"),
        ("maneuver = 1", "maneuver = 5000000000", "more than 32 bits"),
        ("maneuver = 1", "driver.speed = 1", "Driver has no parameter `driver`"),
        ("maneuver = 1", "\"driver.speed\" = 1", "is not a parameter but an output"),
        ("strategy = 1, ", "gain = 1, ", "not a parameter but a calculated parameter"),
        ("unit = \"deg\" } }", "unit = \"grad\" } }", "cannot be given in `grad`, expected one of: rad, deg"),
        ("value = 30.0, unit = \"deg\"", "value = 300.0, unit = \"deg\"", "expected at most 1"),
        ("value = 30.0, unit = \"deg\"", "value = 30.0", "expected a value or { value"),
        ("value = 30.0, unit", "value = nan, unit", "expected a finite number"),
        ("\"tire.mode\" = 0", "\"tire.mode\" = 4", "expected one of 0 (magic), 1 (linear)"),
        ("label = \"car\"", "label = 1", "`label` is String, got integer"),
        ("\"road_friction.*\" = 1.0, ", "", "nobody writes the input `road_friction.r` of `vehicle`"),
        ("\"road_friction.*\" = 1.0", "\"road_friktion.*\" = 1.0", "`vehicle` has no input `road_friktion.*`"),
        ("\"road_friction.*\" = 1.0", "\"road_friction.*\" = 1.0, \"road*\" = 1.0", "both match `road_friction.l`"),
        ("\"road_friction.*\" = 1.0", "\"road_friction.*\" = -1.0", "expected at least 0"),
        ("\"road_friction.*\" = 1.0", "\"*\" = 1.0", "has this constant but is written by `driver`"),
        ("from = \"driver:driver.speed\"", "from = \"driver:driver.sped\"", "`driver` has no output `driver.sped`"),
        ("from = \"driver:driver.speed\"", "from = \"diver:driver.speed\"", "unknown unit `diver`"),
        ("from = \"driver:driver.speed\"", "from = \"driver.speed\"", "expected \"unit:variable\""),
        ("from = \"driver:driver.speed\"", "from = \"driver:maneuver\"", "is a parameter, expected an output"),
        (
            "from = \"driver:driver.speed\"",
            "from = \"driver:driver.steer\"",
            "is in rad, but `steering:vehicle.speed`, which it writes, is in m/s",
        ),
        ("to = \"steering:vehicle.speed\"", "to = \"steering:steer.front\"", "is an output, expected an input"),
        (
            "[[case]]\nname = \"passive\"",
            "[[connection]]\nfrom = \"vehicle:vehicle.speed\"\nto = \"steering:vehicle.speed\"\n[[case]]\nname = \"passive\"",
            "a second connection writes `steering:vehicle.speed`",
        ),
        (
            "[[case]]\nname = \"passive\"",
            "[[unit]]\nname = \"second\"\nfmu = \"Driver\"\n[[case]]\nname = \"passive\"",
            "the input `driver.steer` of `steering` has several writers: `driver` and `second`",
        ),
        ("without = [\"steering\"]", "without = [\"stearing\"]", "unknown unit `stearing`"),
        ("without = [\"steering\"]", "without = [\"steering\", \"driver\", \"vehicle\"]", "leaves all units out"),
        (
            "without = [\"steering\"]",
            "without = [\"steering\"]\nparameters.steering = { strategy = 1 }",
            "this case leaves the unit `steering` out",
        ),
        ("baseline = \"passive\"", "baseline = \"pasive\"", "unknown case `pasive`"),
        ("values = [3, 7]", "values = [3, 3]", "this seed is there twice"),
        ("values = [3, 7]", "values = []", "at least one seed"),
        ("values = [3, 7]", "values = [-3]", "`seed` is -3, expected at least 0"),
        ("parameter = \"driver:seed\"", "parameter = \"driver:sed\"", "Driver has no parameter `sed`"),
        (
            "parameter = \"driver:seed\"",
            "parameter = \"steering:strategy\"",
            "this case leaves out the unit `steering`, which takes the seeds",
        ),
        ("[sweep]\ntitle = \"Speed\"\nunit = \"km/h\"\n", "", "points need a [sweep]"),
        ("value = 5.0\n", "value = inf\n", "expected a finite number"),
        ("\"vehicle:*\"", "\"vehicle:wheel*\"", "no output matches `vehicle:wheel*`"),
        ("\"vehicle:*\"", "\"vehikle:*\"", "unknown unit `vehikle`"),
        ("every = 2", "every = 0", "every is 0, expected at least 1"),
        ("kind = \"rms\"", "kind = \"rmss\"", "unknown variant `rmss`"),
        ("signal = \"body.roll\"", "signal = \"body.rol\"", "there is no output `body.rol`"),
        ("signal = \"body.roll\"", "signal = \"driver.steer\"", "`driver.steer` is not recorded"),
        (
            "unit = \"deg\"\nwindow",
            "unit = \"m\"\nwindow",
            "`body.roll` cannot be shown in `m`, expected one of: rad, deg",
        ),
        ("window = [0.5, 2.0]", "window = [0.5, 3.0]", "expected a window [from, to]"),
        ("\"passive@slow\" = 1.5", "\"passiv@slow\" = 1.5", "unknown case `passiv`"),
        ("\"passive@slow\" = 1.5", "\"passive@slo\" = 1.5", "unknown point `slo`"),
        ("\"passive@slow\" = 1.5", "passive = 1.5", "with a sweep the paper's values"),
        ("metrics = [\"roll_rms\"]", "metrics = [\"roll_rsm\"]", "unknown metric `roll_rsm`"),
        ("metrics = [\"roll_rms\"]", "signals = [\"body.roll\"]", "has `metrics`, no `signals`"),
        ("kind = \"rms\"", "kind = \"share\"", "a metric of this kind needs a `threshold`"),
        ("kind = \"rms\"", "kind = \"rms\"\nthreshold = 0.8", "a metric of this kind has no `threshold`"),
        ("kind = \"rms\"", "kind = \"crossing\"\nthreshold = nan", "expected a finite number"),
        ("kind = \"rms\"", "kind = \"magnitude_crossing\"", "a metric of this kind needs a `threshold`"),
        ("kind = \"rms\"", "kind = \"rms\"\nuntil = { signal = \"body.roll\" }", "either `above` or `below`"),
        (
            "kind = \"rms\"",
            "kind = \"rms\"\nuntil = { signal = \"body.roll\", above = 1.0, below = 2.0 }",
            "either `above` or `below`",
        ),
        ("kind = \"rms\"", "kind = \"rms\"\nuntil = { signal = \"body.roll\", above = inf }", "a finite number"),
        ("kind = \"rms\"", "kind = \"rms\"\nuntil = { signal = \"body.rol\", above = 1.0 }", "no output `body.rol`"),
        (
            "kind = \"rms\"",
            "kind = \"rms\"\nuntil = { signal = \"body.roll\", above = 1.0, unit = \"m\" }",
            "cannot be shown in `m`",
        ),
        ("kind = \"rms\"", "kind = \"rms\"\nminus = \"body.rol\"", "no output `body.rol`"),
        ("kind = \"rms\"", "kind = \"rms\"\nminus = \"vehicle.speed\"", "is in m/s, but `body.roll` is in rad"),
        (
            "{ \"passive@slow\" = 1.5 }",
            "{ \"passive@slow\" = 1.5 }\ncalibrated = [\"passive@slo\"]",
            "unknown value of the paper `passive@slo`",
        ),
        ("kind = \"time\"", "kind = \"time\"\nagainst = \"vehicle.speed\"", "is in m/s, but `body.roll` is in rad"),
        (
            "kind = \"sweep\"",
            "kind = \"sweep\"\nagainst = \"body.roll\"",
            "only a figure of kind \"time\" has `against`",
        ),
        ("kind = \"time\"", "kind = \"time\"\ncases = [\"activ\"]", "unknown case `activ`"),
        ("kind = \"time\"", "kind = \"time\"\ncases = []", "expected at least one case"),
        ("kind = \"time\"", "kind = \"time\"\nlevels = [{ value = nan, title = \"\" }]", "expected a finite number"),
        ("kind = \"time\"", "kind = \"time\"\nlevels = [{ valu = 1.0, title = \"\" }]", "unknown field `valu`"),
        ("kind = \"sweep\"", "kind = \"sweep\"\nseparate = true", "only a figure of kind \"time\" has `separate`"),
        (
            "kind = \"sweep\"",
            "kind = \"sweep\"\nlevels = [{ value = 1.0, title = \"\" }]",
            "only a figure of kind \"time\" has `levels`",
        ),
        ("kind = \"sweep\"", "kind = \"spectrum\"", "a figure of kind \"time\" or \"spectrum\" has `signals`"),
        ("status = \"partly\"", "status = \"maybe\"", "unknown variant `maybe`"),
    ];
    for (from, to, expected) in cases {
        assert!(SCENARIO.contains(from), "not in the scenario: {from}");
        let text = SCENARIO.replacen(from, to, 1);
        let error = plan_of(&text, &Options::default()).err();
        let error = lines(&error.unwrap_or_else(|| panic!("no mistake found: {to}")));
        assert!(error.contains(expected), "{to}\n  expected {expected}\n  got {error}");
        assert!(error.starts_with("scenarios/step.toml:"), "{error}");
    }
}

#[test]
fn near_names_are_suggested() {
    for (from, to, expected) in [
        (
            "fmu = \"Driver\"",
            "fmu = \"Drivr\"",
            "did you mean `Driver`? Otherwise name its folder with --fmus, or run `cargo fmu pack Drivr` if it is a model of this workspace",
        ),
        ("maneuver = 1", "manuver = 1", "did you mean `maneuver`?"),
        ("signal = \"body.roll\"", "signal = \"body.rol\"", "did you mean `body.roll`?"),
        // Keys and words of the layout.
        ("stop = 2.0", "stopp = 2.0", "did you mean `stop`?"),
        ("stop = 2.0", "stop = 2.0\norder = \"sequental\"", "did you mean `sequential`?"),
        ("kind = \"rms\"", "kind = \"rmss\"", "did you mean `rms`?"),
        ("kind = \"time\"", "kind = \"tiem\"", "did you mean `time`?"),
        ("status = \"partly\"", "status = \"partley\"", "did you mean `partly`?"),
    ] {
        let error = plan_of(&SCENARIO.replacen(from, to, 1), &Options::default()).unwrap_err();
        let ResolveError::Problems(problems) = error else { panic!("{error}") };
        let help = miette::Diagnostic::help(&problems.problems[0]).unwrap().to_string();
        assert_eq!(help, expected);
    }
}

/// Feeds stand in for outputs; what nothing needs any more is dropped.
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
    let plan = with("time,driver.speed,driver.steer\n0,10,0\n1,12,0.1\n").unwrap();
    let run = plan.runs.iter().find(|r| r.case == "passive").unwrap();
    let names: Vec<_> = run.units.iter().map(|u| u.name.as_str()).collect();
    assert_eq!(names, ["steering", "vehicle"], "the driver is dropped");
    assert_eq!(run.feeds.len(), 2);
    assert_eq!(*run.feeds[0].values, [10.0, 12.0]);
    assert_eq!(run.units[0].inputs[0].slot, run.feeds[1].slot);
    assert_eq!(run.units[0].inputs[1].slot, run.feeds[0].slot);

    // One input of one unit only: the other readers keep the driver. It stands above a constant.
    let plan = with("time,vehicle:driver.speed,road_friction.l\n0,10,0.3\n").unwrap();
    let run = plan.runs.iter().find(|r| r.case == "passive").unwrap();
    assert_eq!(run.units.len(), 3);
    let vehicle = run.units.iter().find(|u| u.name == "vehicle").unwrap();
    assert_eq!(vehicle.constants.len(), 1);
    assert_eq!(vehicle.inputs.len(), 3);

    let error = lines(&with("time,driver.sped\n0,1\n").unwrap_err());
    assert!(error.contains("in.csv:1:1: no input takes the signal `driver.sped`"), "{error}");
    let error = lines(&with("time,driver.speed\n1,1\n").unwrap_err());
    assert!(error.contains("after the start"), "{error}");
}

/// Values of a parameter set, by name, each a Real with or without a unit.
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

/// A scenario beside its parameter sets: that of the scenario, of the unit `driver` and of the case `active`.
fn plan_with_sets(text: &str, sets: [&str; 3]) -> Result<Plan, ResolveError> {
    let folder = tempfile::tempdir().unwrap();
    for (name, content) in ["scenario", "unit", "case"].iter().zip(sets) {
        std::fs::write(folder.path().join(format!("{name}.ssv")), content).unwrap();
    }
    let file = folder.path().join("step.toml");
    resolve_text(&file, text, &fmus(), &Options::default())
}

fn scenario_with_sets() -> String {
    SCENARIO
        .replacen("title = \"Step\"", "title = \"Step\"\nparameter_set = \"scenario.ssv\"", 1)
        .replacen("fmu = \"Driver\"", "fmu = \"Driver\"\nparameter_set = \"unit.ssv\"", 1)
        .replacen("baseline = \"passive\"", "baseline = \"passive\"\nparameter_set = \"case.ssv\"", 1)
}

/// From the bottom up: scenario's set, unit's set, unit's parameters, case's set, case's and point's parameters.
#[test]
fn parameter_sets_are_layers_of_their_own() {
    let amplitude = "driver:steer.amplitude";
    let scenario = parameter_set(&[(amplitude, 0.1, None), ("vehicle.vehicle.mass", 900.0, None)]);
    let unit = parameter_set(&[("steer.amplitude", 28.647_889_756_541_16, Some("deg"))]);
    let case = parameter_set(&[(amplitude, 0.3, Some("rad"))]);
    let text = scenario_with_sets();
    let sets = [scenario.as_str(), &unit, &case];
    let value = |text: &str, run: &str, unit: &str, name: &str| {
        let plan = plan_with_sets(text, sets).unwrap_or_else(|e| panic!("{}", lines(&e)));
        match parameter(&plan, run, unit, name) {
            Some(Value::Real(v)) => v,
            other => panic!("{other:?}"),
        }
    };
    let (amplitude, mass) = ("steer.amplitude", "vehicle.mass");
    assert_eq!(value(&text, "passive@slow#3", "vehicle", mass), 1200.0, "the unit's own stands above the set");
    assert_eq!(value(&text, "active@slow#3", "driver", amplitude), 0.3, "the case's set stands above the unit's own");
    let bare = text.replacen(", \"steer.amplitude\" = { value = 30.0, unit = \"deg\" }", "", 1);
    // 0.5 rad in degrees, to the last digit or two of the conversion
    assert!((value(&bare, "passive@slow#3", "driver", amplitude) - 0.5).abs() < 1e-15, "unit's over scenario's");
    let bare = bare.replacen("\"vehicle.mass\" = 1200, ", "", 1);
    assert_eq!(value(&bare, "passive@slow#3", "vehicle", mass), 900.0, "the scenario's set");
}

#[test]
fn mistakes_in_parameter_sets_are_marked_where_the_file_is_named() {
    let empty = parameter_set(&[]);
    let text = scenario_with_sets();
    for (scenario, unit, expected) in [
        ("<a/>", empty.as_str(), "scenario.ssv: line 1, column 1: expected <ssv:ParameterSet>"),
        (&parameter_set(&[("seed", 1.0, None)]), &empty, "expected \"unit.parameter\""),
        (&parameter_set(&[("steer.amplitude", 1.0, None)]), &empty, "unknown unit `steer`"),
        (&parameter_set(&[("diver:seed", 1.0, None)]), &empty, "`diver:seed`: unknown unit `diver`"),
        (&parameter_set(&[("driver:sed", 1.0, None)]), &empty, "2:17: scenario.ssv: Driver has no parameter `sed`"),
        (&parameter_set(&[("driver:seed", 1.0, None)]), &empty, "`seed` is Integer, got 1.0, Real"),
        (&empty, &parameter_set(&[("steer.amplitude", 300.0, Some("deg"))]), "unit.ssv: `steer.amplitude` is 5.2"),
        (&empty, &parameter_set(&[("steer.amplitude", 1.0, Some("m"))]), "cannot be given in `m`"),
    ] {
        let error = lines(&plan_with_sets(&text, [scenario, unit, &empty]).unwrap_err());
        assert!(error.contains(expected), "expected {expected}\n  got {error}");
    }
    let missing = text.replacen("unit.ssv", "none.ssv", 1);
    let error = lines(&plan_with_sets(&missing, [&empty, &empty, &empty]).unwrap_err());
    assert!(error.contains("cannot read") && error.contains("none.ssv"), "{error}");
}
