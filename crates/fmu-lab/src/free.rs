//! Prepares systems to run, from parts or from scenarios.

use crate::adjust;
use crate::catalog::{self, ALONE, Scenario};
use crate::drive::Driver;
use crate::fmus::{Fmus, name_of};
use crate::requests::{Failure, Setup, System};
use crate::running::converted;
use fmu_assess::single::{self, MANEUVERS, OnRoad, Single, single};
use fmu_assess::{SetupError, Subject, vehicle::VehicleFile};
use fmu_import::description::{BaseType, Causality, Value, Variable};
use fmu_system::plan::Plan;
use fmu_system::resolve::{Options, ResolveError, resolve_text};
use fmu_system::run::{Component, Run, Simulation};
use std::collections::BTreeMap;
use std::path::Path;

/// Source of the metrics of a system.
pub(crate) enum Source {
    Scenario { case: String },
    Maneuver(Box<Single>),
    Nothing,
}

pub(crate) struct Prepared {
    pub(crate) title: String,
    pub(crate) vehicle: String,
    /// Name of the plant's component.
    pub(crate) plant: String,
    pub(crate) plan: Plan,
    pub(crate) simulation: Simulation,
    pub(crate) run: Run,
    pub(crate) driver: Option<Driver>,
    pub(crate) source: Source,
    pub(crate) cones: Vec<[f64; 4]>,
}

impl From<SetupError> for Failure {
    fn from(error: SetupError) -> Self {
        Self { message: error.message, help: error.help.unwrap_or_default() }
    }
}

/// The systems of a setup: the system that the visitor has selected and, for comparison, its twin, which has no
/// controllers or is another case of the scenario.
pub(crate) fn prepare(setup: &Setup, fmus: &Fmus, scenarios: &[Scenario]) -> Result<Vec<Prepared>, Failure> {
    let mut prepared = match &setup.system {
        System::Free { vehicle, controllers, maneuver, maneuver_values, road, seed } => {
            let made = |with: &[String]| free(fmus, vehicle, with, maneuver, maneuver_values, road, *seed);
            let mut systems = vec![made(controllers)?];
            if !controllers.is_empty() {
                systems.push(made(&[])?);
            }
            systems
        }
        System::Scenario { scenario, case, twin, seed } => {
            let found = scenarios.iter().find(|known| known.id == *scenario);
            let found = found.ok_or_else(|| Failure::new(format!("there is no scenario `{scenario}`")))?;
            let cases = std::iter::once(case).chain(twin);
            cases.map(|case| of_scenario(found, case, *seed)).collect::<Result<Vec<_>, _>>()?
        }
    };
    for (id, value) in &setup.values {
        set(&mut prepared[0], fmus, id, *value)?;
    }
    Ok(prepared)
}

fn free(
    fmus: &Fmus,
    vehicle: &str,
    controllers: &[String],
    maneuver: &str,
    values: &BTreeMap<String, f64>,
    road: &str,
    seed: i32,
) -> Result<Prepared, Failure> {
    if maneuver == ALONE {
        return alone(fmus, vehicle);
    }
    let found = MANEUVERS.iter().find(|known| known.id == maneuver);
    let found = found.ok_or_else(|| Failure::new(format!("there is no maneuver `{maneuver}`")))?;
    let subject = Subject {
        plant: vehicle.to_owned(),
        with: controllers.to_vec(),
        vehicle: VehicleFile::of_library(vehicle),
        ..Subject::default()
    };
    let road = OnRoad { class: catalog::class(road), seed };
    let made = single(&subject, found, values, road, &fmus.descriptions)?;
    let names: Vec<String> = controllers.iter().map(|name| catalog::title(name)).collect();
    let with = if names.is_empty() { "without control".to_owned() } else { names.join(", ") };
    let driver = found.is_free.then(|| Driver::new(single::DRIVER, &made.plan, made.largest_steer, made.speed));
    Ok(Prepared {
        title: format!("{}, {with}", catalog::title(vehicle)),
        vehicle: vehicle.to_owned(),
        plant: single::PLANT.to_owned(),
        plan: made.plan.clone(),
        simulation: made.simulation,
        run: made.run.clone(),
        driver,
        cones: made.cones.clone(),
        source: Source::Maneuver(Box::new(made)),
    })
}

/// A scenario with one component, whose inputs keep their start values.
fn alone(fmus: &Fmus, name: &str) -> Result<Prepared, Failure> {
    let description = fmus.descriptions.get(name).ok_or_else(|| Failure::new(format!("there is no FMU {name}")))?;
    let experiment = &description.default_experiment;
    let step = experiment.step_size.filter(|step| *step > 0.0).unwrap_or(0.001);
    let stop = experiment.stop_time.filter(|stop| *stop > step).unwrap_or(10.0);
    let steps = (stop / step).round();
    let quoted = |text: &str| serde_json::json!(text).to_string();
    let scalars = |causality: Causality| {
        let is_scalar = |variable: &&Variable| !variable.is_array() && variable.base_type.is_number();
        description.of(causality).filter(is_scalar)
    };
    let inputs = scalars(Causality::Input).map(|variable| {
        let value = match &variable.start {
            Some(value @ (Value::Real(_) | Value::Integer(_) | Value::Boolean(_))) => value.to_string(),
            _ if variable.base_type == BaseType::Boolean => "false".to_owned(),
            _ => "0".to_owned(),
        };
        format!("{} = {value}", quoted(&variable.name))
    });
    let inputs = inputs.collect::<Vec<_>>().join(", ");
    let signals = scalars(Causality::Output).map(|variable| quoted(&format!("{ALONE}:{}", variable.name)));
    let signals = signals.collect::<Vec<_>>().join(", ");
    if signals.is_empty() {
        return Err(Failure::new(format!("{name} has no outputs to show")));
    }
    let text = format!(
        "title = {title}\n[simulation]\nstop = {stop:?}\nstep = {step:?}\n[[component]]\nname = {ALONE:?}\nfmu = {title}\ninputs = {{ \
         {inputs} }}\n[[case]]\nname = {ALONE:?}\ntitle = {title}\n[record]\nsignals = [{signals}]\n",
        title = quoted(name),
        stop = steps * step,
    );
    let plan = resolve_text(Path::new("alone.toml"), &text, &fmus.descriptions, &Options::default());
    let plan = plan.map_err(|error| match error {
        ResolveError::Problems(problems) => {
            Failure::new(problems.problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "))
        }
        other => Failure::new(other),
    })?;
    let run = plan.runs.first().cloned().ok_or_else(|| Failure::new("there is no run"))?;
    Ok(Prepared {
        title: name.to_owned(),
        vehicle: name.to_owned(),
        plant: ALONE.to_owned(),
        simulation: plan.simulation,
        run,
        plan,
        driver: None,
        source: Source::Nothing,
        cones: Vec::new(),
    })
}

fn of_scenario(scenario: &Scenario, case: &str, seed: i32) -> Result<Prepared, Failure> {
    let plan = &scenario.plan;
    let known = plan.cases.iter().find(|known| known.name == case);
    let known = known.ok_or_else(|| Failure::new(format!("`{}` has no case `{case}`", scenario.id)))?;
    // Takes the first point of a sweep, and the first seed if the scenario does not have the requested one.
    let of_case: Vec<&Run> = plan.runs.iter().filter(|run| run.case == case).collect();
    let run = of_case.iter().find(|run| run.seed == Some(seed)).or(of_case.first()).copied();
    let run = run.ok_or_else(|| Failure::new(format!("`{}` has no run of the case `{case}`", scenario.id)))?;
    Ok(Prepared {
        title: known.title.clone(),
        vehicle: scenario.vehicle.clone(),
        plant: scenario.plant.clone(),
        plan: plan.clone(),
        simulation: plan.simulation,
        run: run.clone(),
        driver: None,
        source: Source::Scenario { case: case.to_owned() },
        cones: Vec::new(),
    })
}

/// Splits an id into component and variable.
pub(crate) fn split(id: &str) -> Result<(&str, &str), Failure> {
    id.split_once(':').ok_or_else(|| Failure::new(format!("`{id}` is not of the form `component:variable`")))
}

/// Sets a value before the run.
fn set(prepared: &mut Prepared, fmus: &Fmus, id: &str, value: f64) -> Result<(), Failure> {
    let (component, name) = split(id)?;
    let planned = prepared.run.components.iter().find(|planned| planned.name == component);
    // An unknown component is ignored, because the value may come from a link to a system with another controller.
    let Some(planned) = planned.cloned() else { return Ok(()) };
    let Some(description) = fmus.described(&planned.fmu) else { return Ok(()) };
    for name in adjust::variables(&planned, name) {
        let Some(variable) = description.variable(&name) else { continue };
        if !matches!(variable.causality, Causality::Parameter | Causality::Input) {
            continue;
        }
        let describe = |of: &Component| fmus.descriptions.get(name_of(&of.fmu)).map(|description| &**description);
        let set = prepared.run.set_described(&describe, component, &name, converted(variable, value));
        set.map_err(Failure::new)?;
    }
    Ok(())
}
