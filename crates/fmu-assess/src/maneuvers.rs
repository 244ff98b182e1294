//! The maneuvers: their runs and their metrics.

pub(crate) mod braking;
pub(crate) mod double_lane_change;
mod frequency_response;
pub(crate) mod lane_change;
pub(crate) mod ride;
pub(crate) mod rollover;
pub(crate) mod sine_with_dwell;
pub(crate) mod steady_state;
pub(crate) mod step_steer;

#[cfg(not(target_family = "wasm"))]
pub(crate) use steady_state::{Increasing, slowly_increasing_steer};

use crate::bench::{Bench, drive};
use crate::evaluators::cones::Part;
use crate::evaluators::{self, Evaluation};
use crate::metric;
use crate::results::{Results, Series, Suite};
use crate::run_result::RunResult;
use crate::run_spec::RunSpec;
use crate::systems::Speed;
use fmu_import::description::Causality;
use serde_json::Value;

pub(crate) struct Maneuver {
    /// Id, also the prefix of the ids of its metrics.
    pub(crate) id: &'static str,
    pub(crate) suite: Suite,
    /// Outputs that the plant needs. A name that ends with a dot is a prefix.
    pub(crate) outputs: &'static [&'static str],
    /// Returns the reason that a plant with these outputs cannot drive the maneuver; `None` if it can.
    pub(crate) not_applicable: fn(&Bench<'_>) -> Option<NotApplicable>,
    pub(crate) run: fn(&Bench<'_>, &mut Results),
}

/// Reason that a plant cannot be driven in a maneuver.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NotApplicable {
    /// Missing signals, if this is the reason.
    missing: Vec<String>,
    reason: String,
}

impl Maneuver {
    const fn new(
        id: &'static str,
        suite: Suite,
        outputs: &'static [&'static str],
        not_applicable: fn(&Bench<'_>) -> Option<NotApplicable>,
        run: fn(&Bench<'_>, &mut Results),
    ) -> Self {
        Self { id, suite, outputs, not_applicable, run }
    }
}

impl NotApplicable {
    fn new(reason: impl Into<String>) -> Self {
        Self { missing: Vec::new(), reason: reason.into() }
    }

    /// Returns the reason for a plant without the signals `missing`.
    fn without(missing: &[&str], reason: &str) -> Self {
        let missing = missing.iter().map(|name| (*name).to_owned()).collect();
        Self { missing, reason: reason.to_owned() }
    }
}

pub(crate) const POSITION: &[&str] = &["vehicle.position_x", "vehicle.position_y", "vehicle.yaw"];
pub(crate) const TURN: &[&str] = &["vehicle.position_x", "vehicle.position_y", "vehicle.yaw", "vehicle.sideslip"];
pub(crate) const RIDE: &[&str] =
    &["body.heave_acceleration", "vehicle.position_x", "vehicle.position_y", "vehicle.yaw"];

/// All maneuvers except the slowly increasing steer, which runs before them.
pub(crate) const MANEUVERS: [Maneuver; 12] = [
    Maneuver::new("constant_radius", Suite::Handling, POSITION, needs_path, steady_state::constant_radius),
    Maneuver::new("step_steer", Suite::Handling, &[], |_| None, step_steer::run),
    Maneuver::new("single_lane_change", Suite::Handling, POSITION, needs_path, lane_change::run),
    Maneuver::new(
        "sine_with_dwell",
        Suite::Stability,
        &[],
        |bench| needs_amplitude(bench).or_else(|| sine_with_dwell::not_applicable(bench)),
        sine_with_dwell::run,
    ),
    Maneuver::new("iso3888_1", Suite::Stability, POSITION, needs_footprint, |bench, results| {
        double_lane_change::run(bench, Part::One, results)
    }),
    Maneuver::new("iso3888_2", Suite::Stability, POSITION, needs_footprint, |bench, results| {
        double_lane_change::run(bench, Part::Two, results)
    }),
    Maneuver::new("fishhook", Suite::Rollover, ROLLOVER, needs_both_sides, rollover::fishhook),
    Maneuver::new("j_turn", Suite::Rollover, ROLLOVER, needs_both_sides, rollover::j_turn),
    Maneuver::new("braking", Suite::Braking, POSITION, needs_pedals, braking::straight),
    Maneuver::new(
        "split_friction",
        Suite::Braking,
        POSITION,
        |bench| needs_pedals(bench).or_else(|| needs_inputs(bench, "road_friction.")),
        braking::split_friction,
    ),
    Maneuver::new("brake_in_turn", Suite::Braking, TURN, needs_pedals, braking::in_a_turn),
    Maneuver::new(
        "ride",
        Suite::Ride,
        RIDE,
        |bench| needs_path(bench).or_else(|| needs_inputs(bench, "road_height.")),
        ride::run,
    ),
];

const ROLLOVER: &[&str] = &["tire_load."];

fn needs_speed(bench: &Bench<'_>) -> Option<NotApplicable> {
    let reason = "nothing controls the speed: there is neither an input `driver.speed` nor pedals";
    (bench.system.speed == Speed::Own).then(|| NotApplicable::without(&["driver.speed"], reason))
}

/// To follow a path, the driver needs the wheelbase.
fn needs_path(bench: &Bench<'_>) -> Option<NotApplicable> {
    needs_speed(bench).or_else(|| bench.wheelbase().err().map(NotApplicable::new))
}

fn needs_pedals(bench: &Bench<'_>) -> Option<NotApplicable> {
    if !bench.has_pedals() {
        return Some(NotApplicable::without(
            &["drive_torque.*", "brake_torque.*"],
            "there are no pedals: nothing writes `drive_torque.*` or `brake_torque.*`",
        ));
    }
    needs_path(bench)
}

fn needs_inputs(bench: &Bench<'_>, start: &str) -> Option<NotApplicable> {
    let name = format!("{start}*");
    let reason = format!("the plant has no input `{name}`");
    (!bench.plant.has_inputs(start)).then(|| NotApplicable::without(&[&name], &reason))
}

fn needs_amplitude(bench: &Bench<'_>) -> Option<NotApplicable> {
    bench.amplitude.is_none().then(|| NotApplicable::new("the slowly increasing steer gave no amplitude"))
}

fn needs_both_sides(bench: &Bench<'_>) -> Option<NotApplicable> {
    let is_load = |name: &str, side: char| name.starts_with("tire_load.") && name.ends_with(side);
    let has = |side: char| bench.plant.signals(Causality::Output).any(|name| is_load(name, side));
    let missing = ['l', 'r'].into_iter().find(|side| !has(*side));
    let reason = |side| format!("the plant has no output `tire_load.*` for the side `{side}`");
    let sides = missing.map(|side| NotApplicable::without(&["tire_load.*"], &reason(side)));
    sides.or_else(|| needs_amplitude(bench))
}

fn needs_footprint(bench: &Bench<'_>) -> Option<NotApplicable> {
    let vehicle = bench.vehicle;
    let data = [("width", &vehicle.width), ("front", &vehicle.front), ("rear", &vehicle.rear)];
    let unknown: Vec<&str> = data.into_iter().filter(|(_, datum)| datum.is_none()).map(|(name, _)| name).collect();
    needs_path(bench).or_else(|| {
        let reason = format!("unknown vehicle data: {}; set them in a file for `--vehicle`", unknown.join(", "));
        (!unknown.is_empty()).then(|| NotApplicable::new(reason))
    })
}

/// The extreme value of a metric over all runs of a series, and at each amplitude or speed.
struct Extreme {
    name: &'static str,
    choose: fn(f64, f64) -> f64,
    value: Option<f64>,
    /// Amplitude or speed, and value; `None` if a run there has no value that can be compared.
    values: Vec<(f64, Option<f64>)>,
}

impl Extreme {
    fn new(name: &'static str, choose: fn(f64, f64) -> f64) -> Self {
        Self { name, choose, value: None, values: Vec::new() }
    }

    /// Adds a run. A run that was cut short cannot be compared with complete runs.
    fn add(&mut self, at: f64, value: Option<f64>, is_comparable: bool) {
        self.value = self.value.into_iter().chain(value).reduce(self.choose);
        let comparable = value.filter(|_| is_comparable);
        match self.values.last_mut().filter(|(last, _)| *last == at) {
            Some((_, both)) => *both = both.zip(comparable).map(|(old, new)| (self.choose)(old, new)),
            None => self.values.push((at, comparable)),
        }
    }

    fn series(self, unit: &'static str) -> Series {
        let is_whole = self.values.iter().all(|(_, value)| value.is_some());
        let values = self.values.into_iter().filter_map(|(at, value)| Some((at, value?))).collect();
        Series { unit, values, is_whole }
    }
}

/// Runs a maneuver, or records the reason that it does not apply.
pub(crate) fn run(maneuver: &Maneuver, bench: &Bench<'_>) -> Results {
    let mut results = Results::new(maneuver.id, maneuver.suite, bench.system.name);
    let missing: Vec<String> = (maneuver.outputs.iter())
        .filter(|name| {
            let is_group = name.ends_with('.');
            !(bench.plant.has_output(name)
                || is_group && bench.plant.signals(Causality::Output).any(|signal| signal.starts_with(*name)))
        })
        .map(|name| if name.ends_with('.') { format!("{name}*") } else { (*name).to_owned() })
        .collect();
    let not_applicable = if missing.is_empty() {
        (maneuver.not_applicable)(bench)
    } else {
        let reason = format!("the plant has no output `{}`", missing.join("`, `"));
        Some(NotApplicable { missing, reason })
    };
    match not_applicable {
        Some(NotApplicable { missing, reason }) => results.skip(missing, reason),
        None => (maneuver.run)(bench, &mut results),
    }
    results
}

pub(crate) fn evaluated(name: &str, result: &RunResult, options: &Value) -> Evaluation {
    let evaluator = evaluators::find(name).expect("the bench names an evaluator");
    evaluator.evaluate(&result.trace, options).expect("the bench gives the options of the evaluator")
}

/// Executes and evaluates runs, and adds them to the results.
fn executed(
    bench: &Bench<'_>,
    specs: impl Into<Vec<RunSpec>>,
    evaluator: &str,
    options: &Value,
    results: &mut Results,
) -> Vec<(RunResult, Evaluation)> {
    let evaluated = drive(bench, specs.into()).into_iter().map(|run| {
        let metrics = evaluated(evaluator, &run, options);
        results.note(&run, &metrics);
        (run, metrics)
    });
    evaluated.collect()
}

/// Executes one run, evaluates it, and keeps its signals for figures.
fn shown(
    bench: &Bench<'_>,
    spec: RunSpec,
    evaluator: &str,
    options: &Value,
    results: &mut Results,
) -> Option<(RunResult, Evaluation)> {
    let found = executed(bench, vec![spec], evaluator, options, results).pop()?;
    results.show(&found.0);
    Some(found)
}

pub(crate) fn number(metrics: &Evaluation, name: &str) -> Option<f64> {
    if let metric::Value::Number(number) = metrics.value(name)? { Some(*number) } else { None }
}

pub(crate) fn truth(metrics: &Evaluation, name: &str) -> Option<bool> {
    if let metric::Value::Boolean(value) = metrics.value(name)? { Some(*value) } else { None }
}

pub(crate) fn reason(metrics: &Evaluation, name: &str) -> Option<String> {
    let found = metrics.metrics.iter().find(|metric| metric.definition.name == name)?;
    if let metric::Value::Null(reason) = &found.value { Some(reason.clone()) } else { None }
}

/// Both directions of a maneuver: name and sign of the steering angle.
pub(crate) const SIDES: [(&str, f64); 2] = [("left", 1.0), ("right", -1.0)];
