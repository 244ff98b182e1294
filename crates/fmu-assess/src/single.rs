//! One run of a maneuver with chosen values, for programs that execute the steps themselves: the lab.
//!
//! The runs have the same wiring and evaluators as on the bench. Results that need a series of runs (limits in
//! regulations, a largest speed) are available only on the bench.

use crate::bench::{self, Bench};
use crate::components::SetupError;
use crate::evaluators::cones::Part;
use crate::evaluators::{self, Evaluation};
use crate::maneuvers::{
    POSITION, RIDE, TURN, braking, double_lane_change, lane_change, ride, rollover, sine_with_dwell, steady_state,
    step_steer,
};
use crate::run_spec::RunSpec;
use crate::subject::Subject;
use crate::systems::Systems;
use crate::vehicle::Vehicle;
use crate::wiring::{Driving, Road};
use fmu_system::master::Recording;
use fmu_system::plan::Plan;
use fmu_system::resolve::Descriptions;
use fmu_system::run::{Run, Simulation};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// Duration of free driving, s.
const FREE: f64 = 600.0;
/// Steering wheel angle at full lock, rad: one and a quarter turns.
const LOCK: f64 = 7.85;

/// A value that the visitor can choose before a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choosable {
    /// Name.
    pub id: &'static str,
    /// Title.
    pub title: &'static str,
    /// Unit of measure.
    pub unit: &'static str,
    /// Limits.
    pub limits: [f64; 2],
    /// Default value.
    pub value: f64,
    /// Display unit, and the conversion factor.
    pub display: (&'static str, f64),
}

const fn speed(kilometers: f64) -> Choosable {
    Choosable {
        id: "speed",
        title: "Speed",
        unit: "m/s",
        limits: [10.0 / 3.6, 140.0 / 3.6],
        value: kilometers / 3.6,
        display: ("km/h", 3.6),
    }
}

const fn wheel(degrees: f64) -> Choosable {
    const RADIANS: f64 = std::f64::consts::PI / 180.0;
    Choosable {
        id: "steering_wheel",
        title: "Steering wheel angle",
        unit: "rad",
        limits: [-360.0 * RADIANS, 360.0 * RADIANS],
        value: degrees * RADIANS,
        display: ("deg", 1.0 / RADIANS),
    }
}

/// A maneuver that can be driven as a single run.
#[derive(Debug)]
pub struct Maneuver {
    /// Name.
    pub id: &'static str,
    /// Title.
    pub title: &'static str,
    /// True if the visitor drives.
    pub is_free: bool,
    /// Values that the visitor can choose.
    pub values: &'static [Choosable],
    driving: Driving,
    /// Outputs that the plant needs.
    outputs: &'static [&'static str],
    needs_pedals: bool,
    evaluator: &'static str,
    make: fn(&Bench<'_>, &Chosen) -> Option<(RunSpec, Value)>,
}

/// Template for a maneuver along a path.
const PATH: Maneuver = Maneuver {
    id: "",
    title: "",
    is_free: false,
    values: &[],
    driving: Driving::Path,
    outputs: POSITION,
    needs_pedals: false,
    evaluator: "",
    make: |_, _| None,
};
/// Template for a maneuver with steering as a function of time.
const OPEN_LOOP: Maneuver = Maneuver { driving: Driving::OpenLoop, outputs: &[], ..PATH };

/// All maneuvers, and free driving.
pub static MANEUVERS: [Maneuver; 13] = [
    Maneuver {
        id: "free",
        title: "Drive yourself",
        is_free: true,
        values: &[speed(60.0)],
        make: |_, chosen| {
            let spec = RunSpec::new("free", Driving::OpenLoop, chosen.speed, FREE);
            alone(spec.maneuver("ramp_step").drivers(&[("steer.amplitude", 0.0)]))
        },
        ..OPEN_LOOP
    },
    Maneuver {
        id: "iso3888_1",
        title: "Double lane change, ISO 3888-1",
        values: &[speed(60.0)],
        evaluator: "cones",
        make: |bench, chosen| double_lane_change::spec(bench, Part::One, "double_lane_change".to_owned(), chosen.speed),
        ..PATH
    },
    Maneuver {
        id: "iso3888_2",
        title: "Obstacle avoidance, ISO 3888-2",
        values: &[speed(50.0)],
        evaluator: "cones",
        make: |bench, chosen| double_lane_change::spec(bench, Part::Two, "double_lane_change".to_owned(), chosen.speed),
        ..PATH
    },
    Maneuver {
        id: "single_lane_change",
        title: "Single lane change, ISO 14791",
        values: &[speed(80.0)],
        evaluator: "single_lane_change",
        make: |bench, chosen| alone(lane_change::spec(bench, chosen.speed)),
        ..PATH
    },
    Maneuver {
        id: "sine_with_dwell",
        title: "Sine with dwell, FMVSS 126",
        values: &[speed(80.0), wheel(90.0)],
        evaluator: "sine_with_dwell",
        make: |bench, chosen| {
            let spec = sine_with_dwell::spec("sine_with_dwell".to_owned(), chosen.speed, chosen.wheel / bench.ratio());
            Some((spec, json!({ "steer.ratio": bench.ratio() })))
        },
        ..OPEN_LOOP
    },
    Maneuver {
        id: "step_steer",
        title: "Step steer, ISO 7401",
        values: &[speed(60.0), wheel(45.0)],
        evaluator: "step_steer",
        make: |bench, chosen| {
            alone(step_steer::spec("step_steer".to_owned(), chosen.speed, chosen.wheel / bench.ratio()))
        },
        ..OPEN_LOOP
    },
    Maneuver {
        id: "fishhook",
        title: "Fishhook, NHTSA",
        values: &[speed(60.0), wheel(180.0)],
        evaluator: "rollover",
        make: |bench, chosen| {
            alone(rollover::fishhook_spec(bench, "fishhook".to_owned(), chosen.speed, chosen.wheel.to_degrees()))
        },
        ..PATH
    },
    Maneuver {
        id: "j_turn",
        title: "J-turn, NHTSA",
        values: &[speed(60.0), wheel(180.0)],
        evaluator: "rollover",
        make: |bench, chosen| {
            alone(rollover::j_turn_spec(bench, "j_turn".to_owned(), chosen.speed, chosen.wheel.to_degrees()))
        },
        ..OPEN_LOOP
    },
    Maneuver {
        id: "constant_radius",
        title: "Constant radius, ISO 4138",
        evaluator: "constant_radius",
        make: |bench, _| steady_state::circle(bench),
        ..PATH
    },
    Maneuver {
        id: "braking",
        title: "Straight braking, UN R13-H",
        values: &[speed(100.0)],
        needs_pedals: true,
        evaluator: "braking",
        make: |_, chosen| alone(braking::spec("braking".to_owned(), chosen.speed)),
        ..PATH
    },
    Maneuver {
        id: "split_friction",
        title: "Braking on split friction, UN R13-H",
        values: &[speed(50.0)],
        needs_pedals: true,
        evaluator: "braking",
        make: |bench, chosen| alone(braking::split_spec(bench, "split_friction".to_owned(), chosen.speed, true)),
        ..PATH
    },
    Maneuver {
        id: "brake_in_turn",
        title: "Braking in a turn, ISO 7975",
        outputs: TURN,
        needs_pedals: true,
        evaluator: "brake_in_turn",
        make: |_, _| alone(braking::turn_spec()),
        ..PATH
    },
    Maneuver {
        id: "ride",
        title: "Ride, ISO 8608 and ISO 2631-1",
        values: &[speed(60.0)],
        driving: Driving::Ride,
        outputs: RIDE,
        evaluator: "ride",
        make: |bench, chosen| {
            let spec = ride::spec(bench, "road", chosen.class, chosen.seed);
            Some((RunSpec { speed: chosen.speed, ..spec }, json!({ "begin": ride::BEGIN })))
        },
        ..PATH
    },
];

/// A run whose evaluator needs no options.
fn alone(spec: RunSpec) -> Option<(RunSpec, Value)> {
    Some((spec, json!({})))
}

/// The choice of the visitor.
struct Chosen {
    speed: f64,
    /// Steering wheel angle, rad.
    wheel: f64,
    /// Roughness class of the road, from 1 for A; unused on a flat road.
    class: f64,
    seed: f64,
}

impl Maneuver {
    fn chosen(&self, id: &str, values: &BTreeMap<String, f64>) -> f64 {
        let offered = self.values.iter().find(|value| value.id == id);
        let given = values.get(id).copied().filter(|value| value.is_finite());
        match (offered, given) {
            (Some(offered), Some(given)) => given.clamp(offered.limits[0], offered.limits[1]),
            (Some(offered), None) => offered.value,
            (None, given) => given.unwrap_or(0.0),
        }
    }
}

/// Returns the reason that a plant cannot drive a maneuver; `None` if it can.
///
/// # Errors
/// The FMU does not exist or is not a plant that can be driven.
pub fn not_applicable(
    plant: &str,
    maneuver: &Maneuver,
    source: &dyn Descriptions,
) -> Result<Option<String>, SetupError> {
    let subject = Subject { plant: plant.to_owned(), ..Subject::default() };
    let found = Systems::found(&subject, source)?;
    let plant = &found.plant;
    if let Some(missing) = maneuver.outputs.iter().find(|name| !plant.has_output(name)) {
        return Ok(Some(format!("it has no output `{missing}`")));
    }
    let has_pedals = !plant.has_input("driver.speed") && !found.base.is_empty();
    if maneuver.needs_pedals && !has_pedals {
        return Ok(Some("it has no pedals".to_owned()));
    }
    if maneuver.id == "split_friction" && !plant.has_inputs("road_friction.") {
        return Ok(Some("it has no inputs `road_friction.*`".to_owned()));
    }
    if maneuver.driving == Driving::Ride && !plant.has_inputs("road_height.") {
        return Ok(Some("it has no inputs `road_height.*`".to_owned()));
    }
    Ok(None)
}

/// The FMUs that a plant needs in every system.
///
/// # Errors
/// The FMU does not exist or is not a plant that can be driven.
pub fn base(plant: &str, source: &dyn Descriptions) -> Result<Vec<String>, SetupError> {
    let subject = Subject { plant: plant.to_owned(), ..Subject::default() };
    Ok(Systems::found(&subject, source)?.base.into_iter().map(|component| component.fmu).collect())
}

/// A prepared run.
#[derive(Debug)]
pub struct Single {
    /// Times.
    pub simulation: Simulation,
    /// The run.
    pub run: Run,
    /// The plan that contains the run.
    pub plan: Plan,
    /// Speed at the start, m/s.
    pub speed: f64,
    /// Front steering angle at full lock, rad.
    pub largest_steer: f64,
    /// Sections of cones, m: begin, end, right and left edge of each.
    pub cones: Vec<[f64; 4]>,
    systems: Systems,
    vehicle: Vehicle,
    spec: RunSpec,
    evaluator: &'static str,
    options: Value,
}

/// Name of the driver component in all runs.
pub const DRIVER: &str = "driver";
/// Name of the plant component in all runs.
pub const PLANT: &str = "plant";
/// Roll angle, rad, above which the bench ends a run because the vehicle has rolled over.
pub const ROLLED_OVER: f64 = crate::run_result::ROLLED_OVER;

/// Road of a run.
#[derive(Debug, Clone, Copy, Default)]
pub struct OnRoad {
    /// Class.
    pub class: Option<i32>,
    /// Seed.
    pub seed: i32,
}

/// Prepares one run of a maneuver.
///
/// # Errors
/// An FMU is missing or cannot be driven, or a value is invalid.
pub fn single(
    subject: &Subject,
    maneuver: &'static Maneuver,
    values: &BTreeMap<String, f64>,
    road: OnRoad,
    source: &dyn Descriptions,
) -> Result<Single, SetupError> {
    let is_rough = road.class.is_some() || maneuver.driving == Driving::Ride;
    let on = if is_rough { Road::Rough } else { Road::Flat };
    let systems = Systems::only(subject, source, maneuver.driving, on)?;
    if is_rough && !systems.plant.has_inputs("road_height.") {
        return Err(SetupError::new(format!("{} has no inputs `road_height.*`", subject.plant)));
    }
    let vehicle = Vehicle::new(&subject.vehicle.vehicle, &systems.plant, None);
    let plan = systems.systems.first().and_then(|system| system.plan(maneuver.driving)).cloned();
    let plan = plan.ok_or_else(|| SetupError::new("the plant cannot drive this maneuver"))?;
    let components = plan.runs.iter().flat_map(|run| &run.components);
    let described = components.filter_map(|component| {
        let name = component.fmu.strip_suffix(".fmu").unwrap_or(&component.fmu);
        Some((&*component.fmu, source.find(name).ok()??.description))
    });
    let described: Vec<_> = described.collect();
    let descriptions = described.iter().map(|(fmu, description)| (*fmu, &**description)).collect();
    let [speed, wheel] = ["speed", "steering_wheel"].map(|id| maneuver.chosen(id, values));
    let chosen = Chosen { speed, wheel, class: road.class.unwrap_or(3).into(), seed: road.seed.max(1).into() };
    let bench = bench(&systems, &vehicle, &descriptions);
    let made = (maneuver.make)(&bench, &chosen);
    let (mut spec, options) =
        made.ok_or_else(|| SetupError::new("the width, front or rear of the vehicle is unknown"))?;
    if is_rough && maneuver.driving != Driving::Ride {
        spec = ride::on_road(&bench, spec, chosen.class, chosen.seed);
    }
    let (simulation, run) = bench.run(&spec, spec.stop).map_err(SetupError::new)?;
    let part = match maneuver.id {
        "iso3888_1" => Some(Part::One),
        "iso3888_2" => Some(Part::Two),
        _ => None,
    };
    let cones =
        part.and_then(|part| double_lane_change::cones(part, &bench)).map_or(Vec::new(), |cones| cones.to_vec());
    // Free driving is not evaluated, so figures need only every tenth step.
    let every = if maneuver.is_free { 10 } else { simulation.every };
    Ok(Single {
        simulation: Simulation { every, ..simulation },
        run,
        plan,
        speed: spec.speed,
        largest_steer: LOCK / vehicle.steer_ratio.value,
        cones,
        systems,
        vehicle,
        spec,
        evaluator: maneuver.evaluator,
        options,
    })
}

/// A bench with a single system. It executes no runs.
fn bench<'a>(systems: &'a Systems, vehicle: &'a Vehicle, descriptions: &'a bench::Described<'a>) -> Bench<'a> {
    Bench {
        execute: &|_| Vec::new(),
        descriptions,
        plant: &systems.plant,
        system: &systems.systems[0],
        vehicle,
        understeer_gradient: vehicle.understeer_gradient.as_ref().map_or(0.0, |datum| datum.value),
        amplitude: None,
        is_mirrored: systems.is_mirrored,
        other_speed: None,
        is_quick: false,
        folder: std::path::Path::new(""),
    }
}

impl Single {
    /// Metrics of the recorded part of the run, up to where the bench would end it; `None` for free driving.
    pub fn evaluate(&self, recording: &Recording) -> Option<Evaluation> {
        let evaluator = evaluators::find(self.evaluator)?;
        let none = BTreeMap::new();
        let bench = bench(&self.systems, &self.vehicle, &none);
        let result = bench::result(&bench, self.spec.clone(), recording, None);
        evaluator.evaluate(&result.trace, &self.options).ok()
    }
}
