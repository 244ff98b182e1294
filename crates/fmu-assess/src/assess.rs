//! Runs an assessment: all maneuvers of both systems, each in a thread that waits for its runs.

use crate::Trace;
use crate::bench::{Bench, Described, Execute, drive};
use crate::components::{Component, SetupError};
use crate::evaluators::cones::Part;
use crate::evaluators::weighting::Weighting;
use crate::executor::with_workers;
use crate::maneuvers::double_lane_change::compare_at;
use crate::maneuvers::{self, Increasing, MANEUVERS, Maneuver};
use crate::metric::Direction;
use crate::numerics::GRAVITY;
use crate::report::{Assessment, Row, SCHEMA, row};
use crate::results::{Limit, Measured, REQUIRED, Results, Skipped, Suite};
use crate::run_spec::RunSpec;
use crate::subject::Subject;
use crate::systems::{System, Systems};
use crate::vehicle::{Datum, Vehicle};
use crate::wiring::{Driving, STEP};
use fmu_import::temporary::Folder;
use fmu_import::worker::Settings;
use fmu_system::fmus::Fmus;
use fmu_system::resolve::Descriptions;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::f64::consts::LN_10;
use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Options of an assessment.
#[derive(Debug)]
pub struct Options {
    /// Groups of maneuvers; empty for all.
    pub suites: Vec<Suite>,
    /// Speed for handling maneuvers and ride instead of the usual speed, m/s.
    pub speed: Option<f64>,
    /// Ends the sine-with-dwell series after the first unstable runs.
    pub is_quick: bool,
    /// Gives the driver model the understeer gradient of each system. Otherwise, both systems get the gradient of the
    /// system without controllers.
    pub adapts: bool,
    /// Limits set by the caller: name of a metric, and a minimum or maximum, depending on the metric's direction.
    pub required: Vec<(String, f64)>,
    /// Number of processes.
    pub jobs: NonZeroUsize,
}

/// Progress callback. Its arguments are the numbers of finished maneuvers, of all maneuvers, and of finished runs.
pub type Progress<'a> = &'a (dyn Fn(usize, usize, usize) + Sync);

/// Signals for figures: for each shown run, its system, its id and its trace.
pub type Shown = Vec<(&'static str, String, Trace<'static>)>;

/// Assesses a plant.
///
/// # Errors
/// An FMU is missing or cannot be driven, or a value or requirement is invalid. A failed run is not an error.
pub fn assess(
    subject: &Subject,
    source: &dyn Descriptions,
    options: &Options,
    settings: &Settings,
    progress: Progress<'_>,
) -> Result<(Assessment, Shown), SetupError> {
    let systems = Systems::new(subject, source)?;
    let runs: Vec<_> = systems.systems.iter().flat_map(System::plans).flat_map(|plan| plan.runs.clone()).collect();
    let fmus = Fmus::unpack(&runs).map_err(|error| SetupError::new(error.to_string()))?;
    let folder = Folder::new().map_err(|error| SetupError::new(format!("cannot make a temporary folder: {error}")))?;
    let (done, finished) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let chosen: Vec<&Maneuver> = MANEUVERS.iter().filter(|maneuver| options.wants(maneuver.suite)).collect();
    let total = (chosen.len() + 1) * systems.systems.len();
    let tell = || progress(finished.load(Ordering::Relaxed), total, done.load(Ordering::Relaxed));
    let add = |count: &AtomicUsize| {
        count.fetch_add(1, Ordering::Relaxed);
        tell();
    };
    let count = || add(&done);
    let of_fmus = runs.iter().flat_map(|run| &run.components);
    let descriptions: Described<'_> =
        of_fmus.filter_map(|of| Some((&*of.fmu, fmus.get(of).ok()?.description()))).collect();
    let steering = options.steering();
    let (vehicle, driver, found) = with_workers(settings, options.jobs, &fmus, &count, |execute| {
        let place = Place { execute, descriptions: &descriptions, systems: &systems, folder: folder.path(), options };
        let mut vehicle = Vehicle::new(&subject.vehicle.vehicle, &systems.plant, None);
        if vehicle.mass.is_none() {
            let mass = place.bench(0, &vehicle, &[]).weighed();
            vehicle = Vehicle::new(&subject.vehicle.vehicle, &systems.plant, mass);
        }
        // Braking and ride need the results of the slowly increasing steer only if the understeer gradient is unknown.
        let is_known = vehicle.understeer_gradient.is_some() && steering.is_none();
        let steered = if is_known { 0 } else { systems.systems.len() };
        let increasing = in_threads((0..steered).collect(), |index| {
            let bench = place.bench(index, &vehicle, &[]);
            let result = maneuvers::slowly_increasing_steer(&bench, steering.unwrap_or(Suite::Handling));
            add(&finished);
            result
        });
        if vehicle.understeer_gradient.is_none() {
            let measured = increasing.first().and_then(|(_, found)| found.understeer_gradient);
            let source = "slowly increasing steer".to_owned();
            vehicle.understeer_gradient = measured.map(|value| Datum { value, source });
        }
        // Both systems are steered with the same amplitude, so any difference comes from the controllers. Unless the
        // driver adapts, it also has the same understeer gradient in both systems.
        let known: Vec<Increasing> = increasing.iter().map(|(_, known)| *known).collect();
        let tasks: Vec<(usize, &Maneuver)> = (0..systems.systems.len())
            .flat_map(|index| chosen.iter().map(move |maneuver| (index, *maneuver)))
            .collect();
        let mut found: Vec<Results> = in_threads(tasks, |(index, maneuver)| {
            let result = maneuvers::run(maneuver, &place.bench(index, &vehicle, &known));
            add(&finished);
            result
        });
        // Metrics at different entry speeds are not comparable, so the faster system is also driven at the entry speed
        // of the slower system.
        for part in Part::ALL {
            let of = |system: usize| {
                let name = systems.systems.get(system)?.name;
                found.iter().position(|results| results.maneuver == part.name() && results.system == name)
            };
            let Some(pair) = of(0).zip(of(1)) else { continue };
            let Some((first, second)) = found[pair.0].entry_speed.zip(found[pair.1].entry_speed) else { continue };
            if first != second {
                let (faster, at) = if first > second { (0, pair.0) } else { (1, pair.1) };
                compare_at(&place.bench(faster, &vehicle, &known), part, first.min(second), &mut found[at]);
            }
        }
        let driver = json!({
            "amplitude": known.first().and_then(|known| known.amplitude),
            "understeer_gradient": vehicle.understeer_gradient.as_ref().map(|datum| datum.value),
        });
        if steering.is_some() {
            found.splice(0..0, increasing.into_iter().map(|(results, _)| results));
        }
        (vehicle, driver, found)
    });
    let shown = found
        .iter()
        .flat_map(|results| results.shown.iter().map(|(run, trace)| (results.system, run.clone(), trace.clone())))
        .collect();
    let assessment = assembled(&systems, vehicle, driver, found, options)?;
    Ok((assessment, shown))
}

impl Options {
    fn wants(&self, suite: Suite) -> bool {
        self.suites.is_empty() || self.suites.contains(&suite)
    }

    /// The suite that reports the slowly increasing steer: the first selected suite that needs its amplitude.
    fn steering(&self) -> Option<Suite> {
        [Suite::Handling, Suite::Stability, Suite::Rollover].into_iter().find(|suite| self.wants(*suite))
    }
}

/// Shared data of all benches.
struct Place<'a> {
    execute: &'a Execute<'a>,
    descriptions: &'a Described<'a>,
    systems: &'a Systems,
    folder: &'a std::path::Path,
    options: &'a Options,
}

impl<'a> Place<'a> {
    /// `known` contains the results of the slowly increasing steer for all systems, if available.
    fn bench(&self, index: usize, vehicle: &'a Vehicle, known: &[Increasing]) -> Bench<'a> {
        let given = vehicle.understeer_gradient.as_ref().map(|datum| datum.value);
        let own = known.get(index).filter(|_| self.options.adapts).and_then(|known| known.understeer_gradient);
        Bench {
            execute: self.execute,
            descriptions: self.descriptions,
            plant: &self.systems.plant,
            system: &self.systems.systems[index],
            vehicle,
            understeer_gradient: own.or(given).unwrap_or(0.0),
            amplitude: known.first().and_then(|known| known.amplitude),
            is_mirrored: self.systems.is_mirrored,
            other_speed: self.options.speed,
            is_quick: self.options.is_quick,
            folder: self.folder,
        }
    }
}

impl Bench<'_> {
    /// Mass from the tire loads in the first row, kg.
    fn weighed(&self) -> Option<f64> {
        let spec = RunSpec::new("weighing", Driving::OpenLoop, self.speed(), STEP);
        let run = drive(self, vec![spec]).pop()?;
        let names = run.trace.names().filter(|name| name.starts_with("tire_load."));
        let loads: Vec<f64> = names.filter_map(|name| run.trace.column(name)?.first().copied()).collect();
        (!loads.is_empty()).then(|| loads.iter().sum::<f64>() / GRAVITY)
    }
}

/// Calls `work` for each item in a separate thread. The results are in the order of the items.
fn in_threads<T: Send, R: Send>(items: Vec<T>, work: impl Fn(T) -> R + Sync) -> Vec<R> {
    std::thread::scope(|scope| {
        let work = &work;
        let threads: Vec<_> = items.into_iter().map(|item| scope.spawn(move || work(item))).collect();
        threads
            .into_iter()
            .map(|thread| match thread.join() {
                Ok(result) => result,
                Err(panic) => std::panic::resume_unwind(panic),
            })
            .collect()
    })
}

fn assembled(
    systems: &Systems,
    vehicle: Vehicle,
    driver: Value,
    mut found: Vec<Results>,
    options: &Options,
) -> Result<Assessment, SetupError> {
    for (name, limit) in &options.required {
        require(&mut found, name, *limit)?;
    }
    let of = |system: &str| -> Vec<&Measured> {
        found.iter().filter(|results| results.system == system).flat_map(|results| &results.metrics).collect()
    };
    let rows = rows(&of("without"), (systems.systems.len() > 1).then(|| of("with")).as_deref());
    let mut dropped: Vec<Skipped> = Vec::new();
    for skipped in found.iter().filter_map(|results| results.skipped.as_ref()) {
        if !dropped.contains(skipped) {
            dropped.push(skipped.clone());
        }
    }
    let described = |component: &Component| {
        let description = &component.found.description;
        let sha256 = std::fs::read(&component.found.path).ok().map(|bytes| format!("{:x}", Sha256::digest(bytes)));
        json!({ "fmu": component.fmu, "guid": description.guid, "version": description.version, "sha256": sha256 })
    };
    let given = |(component, parameter, value): (&Component, &str, &str)| {
        let variable = component.description().variable(parameter);
        let start = variable.and_then(|variable| variable.start.as_ref());
        let unit_of_measure = variable.and_then(|variable| variable.unit.as_deref());
        json!({ "component": component.name, "fmu": component.fmu, "parameter": parameter, "value": value, "unit": unit_of_measure, "start": start })
    };
    let unwritten = |system: &System| (system.name, system.unwritten.iter().cloned().collect::<BTreeMap<_, _>>());
    let decisive = systems.systems.last();
    let runs = found.iter().flat_map(|results| results.runs.clone()).collect();
    Ok(Assessment {
        schema: SCHEMA,
        plant: described(&systems.plant.component),
        base: systems.base.iter().map(described).collect(),
        with: systems.with.iter().map(described).collect(),
        set: systems.given().map(given).collect(),
        vehicle,
        driver,
        systems: systems.systems.iter().map(|system| system.name).collect(),
        unwritten: systems.systems.iter().map(unwritten).collect(),
        idle: decisive.map_or(Vec::new(), |system| system.idle.clone()),
        assumed: systems.plant.assumed.clone(),
        runs,
        metrics: rows,
        dropped,
        tracks: found.iter().filter_map(|results| Some((results.maneuver, results.track?))).collect(),
        weighting: options.wants(Suite::Ride).then(weighting),
    })
}

/// Puts the metrics of both systems side by side, in the order of `without`. A metric that is only in `with` is
/// inserted after its predecessor in `with`.
fn rows(without: &[&Measured], with: Option<&[&Measured]>) -> Vec<Row> {
    let Some(with) = with else { return without.iter().map(|metric| row(Some(metric), None, false)).collect() };
    let of = |metrics: &[&'_ Measured], id: &str| metrics.iter().position(|metric| metric.id == id);
    let mut rows: Vec<Row> =
        (without.iter()).map(|metric| row(Some(metric), of(with, &metric.id).map(|index| with[index]), true)).collect();
    for (index, metric) in with.iter().enumerate().filter(|(_, metric)| of(without, &metric.id).is_none()) {
        let before = index.checked_sub(1).and_then(|before| rows.iter().position(|row| row.id == with[before].id));
        rows.insert(before.map_or(rows.len(), |before| before + 1), row(None, Some(metric), true));
    }
    rows
}

/// Frequencies from 0.1 to 100 Hz, 24 in each decade, and the gain of W_k at each.
fn weighting() -> [Vec<f64>; 2] {
    let frequencies: Vec<f64> = (0..=72).map(|index| fmu_math::exp((f64::from(index) / 24.0 - 1.0) * LN_10)).collect();
    let gains = frequencies.iter().map(|frequency| Weighting::Vertical.gain(*frequency)).collect();
    [frequencies, gains]
}

/// Sets a limit given by the caller.
fn require(found: &mut [Results], name: &str, limit: f64) -> Result<(), SetupError> {
    let mut is_found = false;
    for metric in found.iter_mut().flat_map(|results| &mut results.metrics).filter(|metric| metric.id == name) {
        is_found = true;
        metric.limit = Some(match metric.direction {
            Direction::Up => Limit::at_least(limit, REQUIRED),
            Direction::Down => Limit::at_most(limit, REQUIRED),
            Direction::None => {
                return Err(SetupError::new(format!(
                    "`--require` needs a metric with a preferred direction; `{name}` has none"
                )));
            }
        });
    }
    if is_found {
        return Ok(());
    }
    let names = found.iter().flat_map(|results| &results.metrics).map(|metric| metric.id.as_str());
    let help = fmu_import::names::suggestion(name, names);
    Err(SetupError { message: format!("`--require {name}={limit}`: these maneuvers have no metric `{name}`"), help })
}
