//! Choices that the page offers, from the descriptions of FMUs and the scenarios.

use crate::fmus::{Fmus, name_of};
use crate::requests::{Adjustable, Controller, Display, Vehicle};
use fmu_assess::single::{self, Choosable, MANEUVERS};
use fmu_import::description::{Causality, ModelDescription};
use fmu_system::compat::{Fit, Systems};
use fmu_system::plan::Plan;
use fmu_system::resolve::{Options, resolve};
use serde_json::{Value as Json, json};
use std::collections::BTreeSet;
use std::path::Path;

/// Id of the maneuver for an FMU that runs alone, and name of its component.
pub(crate) const ALONE: &str = "alone";

/// FMUs that are not offered as controllers: they are part of every system, or need explicit connections.
const OTHERS: [&str; 6] = ["Driver", "PathDriver", "Road", "Sensor", "Actuator", "BrakeAndDriveActuators"];

/// Ids and titles of the roads: flat, and the classes of ISO 8608.
const ROADS: [(&str, &str); 5] = [
    ("flat", "Flat"),
    ("a", "ISO 8608 class A, very good"),
    ("b", "ISO 8608 class B, good"),
    ("c", "ISO 8608 class C, average"),
    ("d", "ISO 8608 class D, poor"),
];

/// Class of roughness of a road, from 1; `None` for a flat road.
pub(crate) fn class(road: &str) -> Option<i32> {
    let index = ROADS.iter().position(|(id, _)| *id == road)?;
    i32::try_from(index).ok().filter(|class| *class > 0)
}

/// Title of an FMU: its name as words.
pub(crate) fn title(name: &str) -> String {
    let letters: Vec<char> = name.chars().collect();
    let mut title = String::new();
    for (i, letter) in letters.iter().enumerate() {
        let begins = i > 0 && letter.is_uppercase() && letters[i - 1].is_lowercase();
        let is_acronym = letters.get(i + 1).is_some_and(|next| next.is_uppercase());
        if begins {
            title.push(' ');
        }
        if begins && !is_acronym { title.extend(letter.to_lowercase()) } else { title.push(*letter) }
    }
    title
}

#[derive(Debug)]
pub(crate) struct Scenario {
    pub(crate) id: String,
    pub(crate) plan: Plan,
    /// Name of the plant's component, and of its FMU.
    pub(crate) plant: String,
    pub(crate) vehicle: String,
}

/// Resolves all scenarios. Scenarios that cannot be resolved, because an FMU is missing, are omitted.
pub(crate) fn scenarios(paths: &[String], fmus: &Fmus, systems: &Systems) -> Vec<Scenario> {
    let resolved = |path: &String| {
        let plan = resolve(Path::new(path), &fmus.descriptions, &Options::default()).ok()?;
        let components: Vec<_> = plan.runs.iter().flat_map(|run| &run.components).collect();
        let is_plant = |name: &str| systems.plants.iter().any(|plant| plant == name);
        let plant = components.iter().rev().find(|component| is_plant(name_of(&component.fmu)))?;
        let (plant, vehicle) = (plant.name.clone(), name_of(&plant.fmu).to_owned());
        Some(Scenario { id: plan.name.clone(), plan, plant, vehicle })
    };
    paths.iter().filter_map(resolved).collect()
}

pub(crate) fn catalog(fmus: &Fmus, systems: &Systems, scenarios: &[Scenario]) -> Json {
    let mut vehicles: Vec<Vehicle> =
        (0..systems.plants.len()).filter_map(|index| vehicle(index, fmus, systems, scenarios)).collect();
    let is_part = |name: &String| {
        let is_controller = |vehicle: &Vehicle| vehicle.controllers.iter().any(|controller| controller.fmu == *name);
        vehicles.iter().any(|vehicle| vehicle.fmu == *name || is_controller(vehicle))
    };
    // FMUs that fit no vehicle run alone.
    let alone: Vec<String> = fmus.dropped.iter().filter(|name| !is_part(name)).cloned().collect();
    vehicles.extend(alone.iter().filter_map(|name| lone(name, fmus)));
    let alone = (!alone.is_empty())
        .then(|| json!({ "id": ALONE, "title": "Run without others", "kind": "bench", "values": [] }));
    json!({
        "vehicles": vehicles,
        "maneuvers": MANEUVERS.iter().map(maneuver).chain(alone).collect::<Vec<_>>(),
        "roads": ROADS.map(|(id, title)| json!({ "id": id, "title": title })),
        "scenarios": scenarios.iter().map(entry).collect::<Vec<_>>(),
    })
}

fn maneuver(maneuver: &single::Maneuver) -> Json {
    json!({
        "id": maneuver.id,
        "title": maneuver.title,
        "kind": if maneuver.is_free { "free" } else { "bench" },
        "values": maneuver.values.iter().map(adjustable).collect::<Vec<_>>(),
    })
}

fn adjustable(value: &Choosable) -> Adjustable {
    let [min, max] = value.limits;
    Adjustable {
        id: value.id.to_owned(),
        title: value.title.to_owned(),
        unit: value.unit.to_owned(),
        min,
        max,
        value: value.value,
        display: Display::new(value.display.0, value.display.1),
    }
}

fn entry(scenario: &Scenario) -> Json {
    let cases = scenario.plan.cases.iter().map(|case| json!({ "id": case.name, "title": case.title }));
    json!({
        "id": scenario.id,
        "title": scenario.plan.title,
        "vehicle": scenario.vehicle,
        "cases": cases.collect::<Vec<_>>(),
        "seeds": scenario.plan.seeds,
    })
}

fn names(description: &ModelDescription, causality: Causality) -> BTreeSet<&str> {
    description.of(causality).map(|variable| variable.name.as_str()).collect()
}

/// An FMU that runs alone.
fn lone(name: &str, fmus: &Fmus) -> Option<Vehicle> {
    let description = fmus.descriptions.get(name)?;
    Some(Vehicle {
        fmu: name.to_owned(),
        title: name.to_owned(),
        outputs: names(description, Causality::Output).into_iter().map(str::to_owned).collect(),
        maneuvers: vec![ALONE.to_owned()],
        ..Vehicle::default()
    })
}

fn vehicle(index: usize, fmus: &Fmus, systems: &Systems, scenarios: &[Scenario]) -> Option<Vehicle> {
    let name = &systems.plants[index];
    let description = fmus.descriptions.get(name)?;
    // A plant that the bench cannot drive is not a vehicle.
    let base = single::base(name, &fmus.descriptions).ok()?;
    let fits = |row: usize| systems.fits[row][index] == Fit::Fits;
    let is_controller = |name: &String| !OTHERS.contains(&name.as_str()) && !base.contains(name);
    let fitting: Vec<&String> =
        systems.components.iter().enumerate().filter(|(row, _)| fits(*row)).map(|(_, name)| name).collect();
    let controllers: Vec<&String> = fitting.into_iter().filter(|name| is_controller(name)).collect();
    let others = |of: &str, shares: &dyn Fn(&ModelDescription, &ModelDescription) -> bool| -> Vec<String> {
        let own = &fmus.descriptions[of];
        let others =
            controllers.iter().filter(|other| other.as_str() != of && shares(own, &fmus.descriptions[**other]));
        others.map(|name| (*name).clone()).collect()
    };
    // Signals of the plant, its base, the drivers and the road need no controller.
    let mut given = names(description, Causality::Output);
    for other in base.iter().map(String::as_str).chain(["Driver", "PathDriver", "Road"]) {
        given.extend(fmus.descriptions.get(other).map(|of| names(of, Causality::Output)).into_iter().flatten());
    }
    let reads = |own: &ModelDescription, other: &ModelDescription| {
        let written = names(other, Causality::Output);
        names(own, Causality::Input).iter().any(|input| !given.contains(input) && written.contains(input))
    };
    let writes_same = |own: &ModelDescription, other: &ModelDescription| {
        !names(own, Causality::Output).is_disjoint(&names(other, Causality::Output))
    };
    let parameters = description.of(Causality::Parameter);
    let parameters = parameters.filter_map(|of| Some((of.name.clone(), of.start.as_ref()?.real()?)));
    let not_applicable = |maneuver: &single::Maneuver| single::not_applicable(name, maneuver, &fmus.descriptions);
    Some(Vehicle {
        fmu: name.clone(),
        title: title(name),
        controllers: controllers
            .iter()
            .map(|fmu| Controller {
                fmu: (*fmu).clone(),
                title: title(fmu),
                needs: others(fmu, &reads),
                excludes: others(fmu, &writes_same),
            })
            .collect(),
        defaults: defaults(name, &controllers, scenarios),
        parameters: parameters.collect(),
        outputs: names(description, Causality::Output).into_iter().map(str::to_owned).collect(),
        maneuvers: MANEUVERS
            .iter()
            .filter(|maneuver| not_applicable(maneuver).is_ok_and(|reason| reason.is_none()))
            .map(|maneuver| maneuver.id.to_owned())
            .collect(),
    })
}

/// Controllers that are selected at first: those of the run with the most fitting controllers in the scenarios of the
/// vehicle, which are the controllers of the paper.
fn defaults(vehicle: &str, controllers: &[&String], scenarios: &[Scenario]) -> Vec<String> {
    let mut best: Vec<String> = Vec::new();
    for scenario in scenarios.iter().filter(|scenario| scenario.vehicle == vehicle && !scenario.id.starts_with("swap_"))
    {
        for run in &scenario.plan.runs {
            let mut used: Vec<String> =
                run.components.iter().map(|component| name_of(&component.fmu).to_owned()).collect();
            used.retain(|name| controllers.contains(&name));
            used.sort();
            used.dedup();
            if used.len() > best.len() {
                best = used;
            }
        }
    }
    best
}
