//! Finds components that nothing reads, and parameters that affect only outputs that nothing reads.

use super::system::{CaseComponent, Resolver, System, context};
use crate::plan::Wiring;
use crate::run::{Run, Suspect, Trial, Variant};
use crate::scenario::Component;
use fmu_import::description::{Causality, ModelDescription};
use std::collections::BTreeSet;
use std::ops::Range;

/// A component in a case, and its outputs that nothing reads.
struct Place<'a> {
    case: &'a str,
    member: &'a CaseComponent<'a>,
    unread: BTreeSet<&'a str>,
}

impl Place<'_> {
    fn outputs(&self) -> impl Iterator<Item = &str> {
        self.member.wirable(Causality::Output).map(|(_, variable)| variable.name.as_str())
    }
}

impl Resolver<'_> {
    /// Warns about components and parameters that have no effect according to the descriptions. Returns the trial runs
    /// that are needed for the other parameters.
    pub(super) fn unread(&mut self, systems: &[System<'_>], wirings: &[Wiring], runs: &[Run]) -> Vec<Trial> {
        let scenario = self.scenario;
        let mut trials = Vec::new();
        for component in &scenario.components {
            let name = component.name.as_str();
            let activates = |system: &System<'_>| {
                let mut sources = system.members.iter().flat_map(|member| &member.clocks);
                sources.any(|(_, (from, _))| system.members[*from].name() == name)
            };
            // The parameters on which its clocks depend are not known.
            if systems.iter().any(activates) {
                continue;
            }
            let mut places = Vec::new();
            for (system, wiring) in systems.iter().zip(wirings) {
                let Some(member) = system.member(name).map(|m| &system.members[m]).filter(|m| !m.dropped) else {
                    continue;
                };
                let of_member = wiring.unread.iter().filter(|signal| signal.component == name);
                let unread: BTreeSet<&str> = of_member.map(|signal| signal.variable.as_str()).collect();
                let place = Place { case: system.case.name.get_ref(), member, unread };
                if place.outputs().next().is_some() && place.outputs().all(|output| place.unread.contains(output)) {
                    self.problems.set_context(Some(context(system.case, Some(component))));
                    self.problems.warn(
                        component.name.span(),
                        format!("nothing reads the outputs of `{name}`, and none is recorded"),
                        Some("leave the component out with `without`, connect it or record its outputs".to_string()),
                    );
                }
                places.push(place);
            }
            self.problems.set_context(None);
            // If one case reads all outputs, the parameters may be set for that case.
            if places.is_empty() || places.iter().any(|place| place.unread.is_empty()) {
                continue;
            }
            let applied = |parameter: &str| {
                let components = runs.iter().flat_map(|run| &run.components).filter(|u| u.name == name);
                components.flat_map(|u| &u.parameters).any(|setting| setting.name == parameter)
            };
            let (certain, open): (Vec<_>, Vec<_>) = self
                .set_parameters(component)
                .into_iter()
                // An FMU that replaces the component's own FMU does not get all of its parameters.
                .filter(|(parameter, _)| applied(parameter))
                .partition(|(parameter, _)| {
                    places.iter().all(|place| affects_only(&place.member.found.description, parameter, &place.unread))
                });
            for (parameter, span) in certain {
                let message =
                    format!("`{parameter}` of `{name}` has no effect: nothing reads the outputs that depend on it");
                self.problems.warn(span, message, None);
            }
            let has_input = |place: &Place<'_>| place.member.all(Causality::Input).next().is_some();
            if open.is_empty() || places.iter().any(has_input) {
                continue;
            }
            trials.push(Trial {
                component: name.to_string(),
                variants: variants(&places, runs),
                suspects: open
                    .into_iter()
                    .map(|(name, span)| Suspect { name, place: self.problems.place(span) })
                    .collect(),
            });
        }
        trials
    }

    /// Parameters that the tables of the scenario set for a component, with their places.
    fn set_parameters(&self, component: &Component) -> Vec<(String, Range<usize>)> {
        let name = component.name.as_str();
        let of_cases = self.scenario.cases.iter().filter_map(|case| case.parameters.get(name));
        let of_points = self.scenario.points.iter().filter_map(|point| point.parameters.get(name));
        let mut seen = BTreeSet::new();
        std::iter::once(&component.parameters)
            .chain(of_cases)
            .chain(of_points)
            .flatten()
            .filter(|(name, _)| seen.insert(name.get_ref().clone()))
            .map(|(name, _)| (name.get_ref().clone(), name.span()))
            .collect()
    }
}

/// Returns the variants of a component in the runs of all cases, each once.
fn variants(places: &[Place<'_>], runs: &[Run]) -> Vec<Variant> {
    let mut variants: Vec<Variant> = Vec::new();
    for place in places {
        let read: Vec<String> =
            place.outputs().filter(|output| !place.unread.contains(output)).map(str::to_string).collect();
        let components = runs.iter().filter(|run| run.case == place.case).flat_map(|run| &run.components);
        for component in components.filter(|component| component.name == place.member.name()) {
            let is_known = |v: &Variant| {
                v.component.parameters == component.parameters && v.component.fmu == component.fmu && v.read == read
            };
            if !variants.iter().any(is_known) {
                variants.push(Variant { component: component.clone(), read: read.clone() });
            }
        }
    }
    variants
}

/// Returns true if a parameter affects unread outputs only, according to the model structure. The structure lists the
/// parameters on which an initial value depends; an output that is not listed may depend on any parameter. In a model
/// with states, a parameter may affect an output later, so the structure proves nothing.
fn affects_only(description: &ModelDescription, parameter: &str, unread: &BTreeSet<&str>) -> bool {
    let Some(parameter) = description.index(parameter) else { return false };
    let mut reaches_unread = false;
    for (index, output) in description.variables.iter().enumerate() {
        if output.causality != Causality::Output {
            continue;
        }
        let listed = description.initial_unknowns.iter().find(|unknown| unknown.variable == index);
        let dependencies = listed.and_then(|unknown| unknown.dependencies.as_ref());
        let depends = dependencies.is_none_or(|dependencies| dependencies.contains(&parameter));
        if depends && !unread.contains(output.name.as_str()) {
            return false;
        }
        reaches_unread |= depends;
    }
    reaches_unread && description.derivatives.is_empty()
}
