//! The compared systems: a plant with its base components and a driver, without and with controllers.

use crate::components::{Component, SetupError, find};
use crate::plant::Plant;
use crate::subject::{ACTUATORS, DRIVERS, Subject, settings};
use crate::wiring::{Driving, OF_DRIVER, OF_PATH, Road, Wiring};
use fmu_import::description::Causality;
use fmu_system::plan::Plan;
use fmu_system::resolve::{Descriptions, Options, ResolveError, resolve_text};
use std::collections::BTreeMap;
use std::path::Path;

/// Control of a plant's speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Speed {
    /// An input prescribes it.
    Prescribed,
    /// The driver's pedals control it; without pedals, the plant coasts.
    Pedals,
    /// Nothing controls it.
    Own,
}

/// A plant with its components, connected for each kind of driving.
#[derive(Debug)]
pub(crate) struct System {
    /// `without` or `with`.
    pub(crate) name: &'static str,
    pub(crate) speed: Speed,
    /// Plans, and the bench's names of their recorded columns.
    plans: Vec<(Driving, Plan, Vec<String>)>,
    /// Unconnected inputs in any kind of driving, and their values.
    pub(crate) unwritten: Vec<(String, String)>,
    /// Components whose outputs nothing reads.
    pub(crate) idle: Vec<String>,
}

impl System {
    pub(crate) fn plan(&self, driving: Driving) -> Option<&Plan> {
        self.plans.iter().find(|(of, ..)| *of == driving).map(|(_, plan, _)| plan)
    }

    pub(crate) fn columns(&self, driving: Driving) -> &[String] {
        self.plans.iter().find(|(of, ..)| *of == driving).map_or(&[], |(_, _, columns)| columns)
    }

    pub(crate) fn plans(&self) -> impl Iterator<Item = &Plan> {
        self.plans.iter().map(|(_, plan, _)| plan)
    }
}

/// Plant and systems of an assessment.
#[derive(Debug)]
pub(crate) struct Systems {
    pub(crate) plant: Plant,
    pub(crate) base: Vec<Component>,
    pub(crate) with: Vec<Component>,
    /// Controllers and base components, in the caller's order.
    all: Vec<Component>,
    drivers: Vec<Component>,
    /// The caller's values, with component names as in the scenarios.
    set: Vec<(String, String, String)>,
    /// True if the caller mirrors the paths of the driver.
    pub(crate) is_mirrored: bool,
    /// The system without controllers, then the system with controllers, if any.
    pub(crate) systems: Vec<System>,
}

impl Systems {
    /// The caller's values: component, parameter, value.
    pub(crate) fn given(&self) -> impl Iterator<Item = (&Component, &str, &str)> {
        self.set.iter().filter_map(|(owner, name, value)| {
            let mut components = self.all.iter().chain(&self.drivers);
            let is_known = |component: &&Component| component.description().variable(name).is_some();
            let component = match owner.as_str() {
                "plant" => Some(&self.plant.component),
                "driver" => self.drivers.iter().find(is_known),
                _ => components.find(|component| component.name == *owner),
            };
            component.map(|component| (component, name.as_str(), value.as_str()))
        })
    }

    /// Finds the FMUs and connects them.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn new(subject: &Subject, source: &dyn Descriptions) -> Result<Self, SetupError> {
        let mut found = Self::found(subject, source)?;
        let mut drivings = vec![(Driving::OpenLoop, Road::Flat), (Driving::Path, Road::Flat)];
        if found.plant.has_inputs("road_height.") {
            drivings.push((Driving::Ride, Road::Rough));
        }
        found.systems.push(found.system("without", &found.base, source, &drivings)?);
        if !found.with.is_empty() {
            found.systems.push(found.system("with", &found.all, source, &drivings)?);
        }
        Ok(found)
    }

    /// Connects one system, with all controllers, for one kind of driving.
    pub(crate) fn only(
        subject: &Subject,
        source: &dyn Descriptions,
        driving: Driving,
        road: Road,
    ) -> Result<Self, SetupError> {
        let mut found = Self::found(subject, source)?;
        found.systems.push(found.system("with", &found.all, source, &[(driving, road)])?);
        Ok(found)
    }

    /// Connects a system for the given kinds of driving.
    fn system(
        &self,
        name: &'static str,
        components: &[Component],
        source: &dyn Descriptions,
        drivings: &[(Driving, Road)],
    ) -> Result<System, SetupError> {
        let Self { plant, drivers, .. } = self;
        let mut written: BTreeMap<&str, &str> = BTreeMap::new();
        for component in drivers.iter().rev().chain([&plant.component]) {
            written.extend(component.signals(Causality::Output).map(|output| (output, component.fmu.as_str())));
        }
        for component in components {
            for output in component.signals(Causality::Output) {
                if let Some(other) = written.insert(output, &component.fmu) {
                    return Err(SetupError::with_help(
                        format!("{other} and {} both write `{output}`", component.fmu),
                        "Remove one of them.",
                    ));
                }
            }
        }
        let reads = |signal: &str| {
            plant.has_input(signal) || components.iter().any(|component| component.has(Causality::Input, signal))
        };
        let acts = |component: &&Component| component.signals(Causality::Output).any(reads);
        let idle =
            components.iter().filter(|component| !acts(component)).map(|component| component.fmu.clone()).collect();
        let is_torque = |signal: &str| signal.starts_with("drive_torque.") || signal.starts_with("brake_torque.");
        let has_pedals = components.iter().any(|component| component.signals(Causality::Output).any(is_torque));
        let speed = match has_pedals {
            _ if plant.has_input("driver.speed") => Speed::Prescribed,
            true => Speed::Pedals,
            false => Speed::Own,
        };
        let mut plans = Vec::new();
        let mut unwritten: Vec<(String, String)> = Vec::new();
        for &(driving, road) in drivings {
            let driver = DRIVERS[usize::from(driving != Driving::OpenLoop)];
            // The two drivers have different parameters, and each run has only one driver.
            let description = drivers.iter().find(|component| component.fmu == driver).map(Component::description);
            let is_of_system = |(component, name, _): &&(String, String, String)| match component.as_str() {
                "driver" => description.is_none_or(|description| description.variable(name).is_some()),
                _ => true,
            };
            let set: Vec<_> = self.set.iter().filter(is_of_system).cloned().collect();
            let mut wiring =
                Wiring { plant, components: ordered(components), driving, road, driver, unwritten: Vec::new() };
            let text = wiring.scenario(&set)?;
            let options = Options::default();
            let plan = resolve_text(Path::new("assessment.toml"), &text, source, &options)
                .map_err(|error| SetupError::new(explained(&error)))?;
            let columns = plan.columns.iter().map(|column| signal_of(&column.name, plant)).collect();
            plans.push((driving, plan, columns));
            for entry in wiring.unwritten {
                if !unwritten.iter().any(|(signal, _)| *signal == entry.0) {
                    unwritten.push(entry);
                }
            }
        }
        Ok(System { name, speed, plans, unwritten, idle })
    }

    pub(crate) fn found(subject: &Subject, source: &dyn Descriptions) -> Result<Self, SetupError> {
        let component = find(source, &subject.plant, Some(&subject.vehicle.signals))?;
        let mut set = BTreeMap::new();
        for (_, name, value) in subject.set.iter().filter(|(owner, _, _)| *owner == component.name) {
            let (number, given) = value.split_once(' ').map_or((value.as_str(), None), |(n, unit)| (n, Some(unit)));
            let Ok(number) = number.parse::<f64>() else { continue };
            let own = component.description().variable(name).and_then(|variable| variable.unit.as_deref());
            // Vehicle data are derived from these numbers, so they must be in the declared unit.
            if let Some(given) = given.filter(|given| Some(*given) != own) {
                let own = own.unwrap_or("1");
                return Err(SetupError::new(format!("`{name}` of {} is given in {given}; use {own}", component.name)));
            }
            set.insert(name.clone(), number);
        }
        let plant = Plant::new(component, set, &subject.vehicle.units)?;
        let of = |fmu: &String| find(source, fmu, subject.vehicle.controllers.get(fmu));
        let mut base = subject.base.iter().map(of).collect::<Result<Vec<_>, _>>()?;
        let needs_torques = plant.has_inputs("brake_torque.") || plant.has_inputs("drive_torque.");
        if base.is_empty() && needs_torques && source.names().iter().any(|name| name == ACTUATORS) {
            base.push(of(&ACTUATORS.to_owned())?);
        }
        let with = subject.with.iter().map(of).collect::<Result<Vec<_>, _>>()?;
        let controllers: Vec<&Component> = with.iter().chain(&base).collect();
        controllers.iter().try_for_each(|component| plant.check_reader(component, &controllers))?;
        let mut all: Vec<Component> = with.iter().chain(&base).cloned().collect();
        all.sort_by_key(|component| subject.order.iter().position(|fmu| *fmu == component.fmu).unwrap_or(usize::MAX));
        let drivers = DRIVERS.into_iter().filter_map(|fmu| find(source, fmu, None).ok()).collect::<Vec<_>>();
        let set = settings(subject, &plant, &all, &drivers)?;
        let is_mirrored = set.iter().any(|(component, name, value)| {
            let is_true = value == "true" || value.parse::<f64>().is_ok_and(|number| number > 0.5);
            component == "driver" && name == "path.mirror" && is_true
        });
        Ok(Self { plant, base, with, all, drivers, set, is_mirrored, systems: Vec::new() })
    }
}

/// The bench's name of a recorded column. If several components have the signal, the column name begins with the
/// component.
fn signal_of(column: &str, plant: &Plant) -> String {
    let (component, variable) = column.split_once(':').unwrap_or(("", column));
    let is_of_driver = OF_DRIVER.contains(&variable) || OF_PATH.contains(&variable);
    if component == "driver" || (component.is_empty() && is_of_driver) {
        return variable.to_owned();
    }
    plant.signal(variable).to_owned()
}

fn explained(error: &ResolveError) -> String {
    match error {
        // Omits the locations: they are in a generated file that the user does not have.
        ResolveError::Problems(problems) => {
            let lines = problems.problems.iter().map(ToString::to_string);
            lines.collect::<Vec<_>>().join("\n")
        }
        other => other.to_string(),
    }
}

/// Components in the order of execution: the writer of a signal comes before its readers. A cycle is broken at its
/// first component in `components`. Otherwise, the components keep their order.
fn ordered(components: &[Component]) -> Vec<&Component> {
    let writes = |component: &Component, other: &Component| {
        component.name != other.name
            && component.signals(Causality::Output).any(|output| other.has(Causality::Input, output))
    };
    let edges: Vec<Vec<bool>> =
        components.iter().map(|component| components.iter().map(|other| writes(component, other)).collect()).collect();
    order(&edges).into_iter().map(|index| &components[index]).collect()
}

/// Topological order of a graph: if `edges[i][j]`, i comes before j, unless a cycle is broken there.
fn order(edges: &[Vec<bool>]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..edges.len()).collect();
    let mut order = Vec::new();
    while !left.is_empty() {
        // Transitive closure of the edges.
        let mut reaches = edges.to_vec();
        for via in &left {
            for from in &left {
                for to in &left {
                    reaches[*from][*to] |= reaches[*from][*via] && reaches[*via][*to];
                }
            }
        }
        // All predecessors of the next component are in the same cycle.
        let is_next =
            |component: &usize| left.iter().all(|other| !reaches[*other][*component] || reaches[*component][*other]);
        let next = left.iter().position(is_next).unwrap_or(0);
        order.push(left.remove(next));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `"ab"` means that a writes a signal that b reads.
    #[test]
    fn writers_come_before_readers_and_cycles_are_cut_where_they_are_named_first() {
        let of = |count: usize, edges: &[&str]| {
            let mut graph = vec![vec![false; count]; count];
            for edge in edges {
                let ends: Vec<usize> = edge.bytes().map(|letter| usize::from(letter - b'a')).collect();
                graph[ends[0]][ends[1]] = true;
            }
            order(&graph).into_iter().map(|index| char::from(b'a' + index as u8)).collect::<String>()
        };
        assert_eq!(of(3, &[]), "abc");
        assert_eq!(of(3, &["ca", "cb"]), "cab");
        assert_eq!(of(4, &["dc", "cb", "ba"]), "dcba");
        // A cycle of b and c is broken at b, which comes first.
        assert_eq!(of(3, &["bc", "cb"]), "abc");
        // a depends on the cycle of b and c, so the cycle is not broken at a.
        assert_eq!(of(3, &["ba", "bc", "cb"]), "bac");
        assert_eq!(of(3, &["ca", "bc", "cb"]), "bca");
        // The cycle of a and b depends on the cycle of c and d.
        assert_eq!(of(4, &["ab", "ba", "cd", "dc", "da"]), "cdab");
        // All are in one cycle. After it is broken at a, the other edges apply.
        assert_eq!(of(3, &["ac", "cb", "ba"]), "acb");
    }
}
