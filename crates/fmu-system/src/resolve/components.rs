//! Finds the FMUs of every case.

use super::fmus::{Descriptions, Found};
use super::system::{CaseComponent, Replaced, Resolver, System, context, replacement};
use crate::scenario::{Component, ComponentInterface, ComponentKind};
use crate::spanned::Spanned;
use crate::steady;
use fmu_import::description::{Causality, Interface, StructuralParameters, Variable};
use fmu_import::loader::{Method, Solver};
use fmu_import::names::{any_of, suggestion};
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

impl<'a> Resolver<'a> {
    /// The components of every case; `None` if an FMU is missing or unreadable.
    pub(super) fn systems(&mut self, source: &dyn Descriptions) -> Option<Vec<System<'a>>> {
        let mut systems = Vec::new();
        let mut missing = Vec::new();
        // The missing FMUs that only a case names, each with the case.
        let mut of_cases = Vec::new();
        for case in &self.scenario.cases {
            let mut members = Vec::new();
            for component in &self.scenario.components {
                let name = component.name.get_ref();
                if case.leaves_out(name) {
                    continue;
                }
                self.problems.set_context(Some(context(case, Some(component))));
                let other = replacement(case, component);
                let found = match other {
                    Some(other) => {
                        let before = missing.len();
                        let found = self.find(&other.fmu, other.span(), source, &mut missing);
                        if missing.len() > before {
                            of_cases.push((other.fmu.as_str(), case.name.as_str()));
                        }
                        found
                    }
                    None => self.find(component.fmu.get_ref(), component.fmu.span(), source, &mut missing),
                };
                let Some(found) = found.and_then(|found| self.with_structure(component, found, other.is_some())) else {
                    continue;
                };
                let Some(integration) = self.integration(component, &found, other.is_some()) else { continue };
                if let Some(place) = component.steady()
                    && let Err(message) = steady::check(
                        &found.description,
                        integration.map_or(Interface::CoSimulation, |_| Interface::ModelExchange),
                    )
                {
                    let help = "remove `start`, or set it for a component with states".to_string();
                    self.problems.add_with_help(place, message, Some(help));
                }
                let replaced = other.map(|other| {
                    let keep_parameters = other.keep_parameters;
                    let original = if keep_parameters {
                        self.find(component.fmu.get_ref(), component.fmu.span(), source, &mut missing)
                    } else {
                        source.find(component.fmu.get_ref()).ok().flatten()
                    };
                    Replaced { original, keep_parameters }
                });
                members.push(CaseComponent {
                    component,
                    found,
                    replaced,
                    inputs: Vec::new(),
                    conversions: HashMap::new(),
                    clocks: Vec::new(),
                    integration,
                    dropped: false,
                });
            }
            systems.push(System { case, members, order: Vec::new(), replaced: BTreeMap::new() });
        }
        self.problems.set_context(None);
        self.report_missing_fmus(&missing, &of_cases, source);
        self.problems.is_empty().then_some(systems)
    }

    /// The FMU with the structural parameters of the component. Another FMU that a case names gets those that it has.
    fn with_structure(&mut self, component: &Component, found: Found, is_other: bool) -> Option<Found> {
        let mut structure = StructuralParameters::new();
        for (name, written) in &component.structure {
            let is_structural = |v: &&Variable| v.causality == Causality::StructuralParameter;
            match found.description.variable(name).filter(is_structural) {
                Some(variable) => {
                    structure.insert(name.get_ref().clone(), self.value(&found.description, variable, written)?);
                }
                None if is_other => {}
                None => {
                    let known = found.description.variables.iter().filter(is_structural).map(|v| v.name.as_str());
                    let known: Vec<&str> = known.collect();
                    let help = suggestion(name, known.iter().copied())
                        .or_else(|| (!known.is_empty()).then(|| format!("it has {}", any_of(&known))));
                    let message = format!("{} has no structural parameter `{}`", found.path, name.get_ref());
                    self.problems.add_with_help(name.span(), message, help);
                    return None;
                }
            }
        }
        found.with_structure(&structure).map_err(|message| self.problems.add(component.fmu.span(), message)).ok()
    }

    /// The solver of a component; the inner `None` is for one that is not in model exchange. Another FMU that a case
    /// names ignores keys for an interface that it does not have.
    fn integration(&mut self, component: &Component, found: &Found, is_other: bool) -> Option<Option<Solver>> {
        let Component { interface, solver, tolerance, max_step, kind, .. } = component;
        let description = &found.description;
        let mut fail = |place: Range<usize>, message: String, help: &str| {
            self.problems.add_with_help(place, message, (!help.is_empty()).then(|| help.to_owned()));
            None
        };
        let mut used = description.stepped_interface();
        if let Some(key) = interface {
            let wanted = match **key {
                ComponentInterface::CoSimulation => Interface::CoSimulation,
                ComponentInterface::ModelExchange => Interface::ModelExchange,
            };
            let has_it = description.interface(wanted).is_some();
            if !has_it && !is_other {
                let message = format!("{} has no interface for {wanted}, only for {used}", found.path);
                return fail(key.span(), message, "leave out `interface`");
            }
            used = if has_it { wanted } else { used };
        }
        let solver_at = solver.as_ref().map(Spanned::span);
        let [tolerance, step] = [("tolerance", tolerance), ("max_step", max_step)];
        if used != Interface::ModelExchange {
            let place = [tolerance.1, step.1].into_iter().flatten().map(Spanned::span).chain(solver_at).next();
            let Some(place) = place.filter(|_| !is_other) else { return Some(None) };
            let message = format!("only components in model exchange have a solver; {} is used for {used}", found.path);
            return fail(place, message, "set `interface = \"model-exchange\"` if the FMU has it");
        }
        if let Some(kind) = kind.as_ref().filter(|kind| ***kind == ComponentKind::Discrete) {
            return fail(
                kind.span(),
                "a component in model exchange must be continuous".to_owned(),
                "leave out `kind`",
            );
        }
        let method = solver.as_ref().map_or(Method::DormandPrince, |solver| **solver);
        let has_fixed_step = method == Method::RungeKutta;
        let ((name, key), other, range) =
            if has_fixed_step { (step, tolerance, 1e-6..=1e6) } else { (tolerance, step, 1e-14..=0.1) };
        if let Some(key) = other.1 {
            return fail(key.span(), format!("this solver has `{name}`, not `{}`", other.0), "");
        }
        let limit = key.as_ref().map_or(if has_fixed_step { f64::NAN } else { 1e-6 }, |key| **key);
        if !range.contains(&limit) {
            let place = key.as_ref().map(Spanned::span).or(solver_at).unwrap_or_default();
            let allowed = format!("{:e} to {}", range.start(), range.end());
            return match key {
                Some(_) => fail(place, format!("`{name}` must be from {allowed}, got {limit}"), ""),
                None => fail(place, format!("`runge_kutta` needs `{name}`, in s, from {allowed}"), ""),
            };
        }
        Some(Some(Solver { method, limit }))
    }

    /// Finds the FMU with this name, written at `span`; adds it to `missing` if it does not exist.
    fn find<'s>(
        &mut self,
        name: &'s str,
        span: Range<usize>,
        source: &dyn Descriptions,
        missing: &mut Vec<(&'s str, Range<usize>)>,
    ) -> Option<Found> {
        match source.find(name) {
            Ok(Some(found)) if found.description.interfaces().is_empty() => {
                self.problems.add(span, format!("{} declares no interface", found.path));
                None
            }
            Ok(Some(found)) => Some(found),
            Ok(None) => {
                if !missing.contains(&(name, span.clone())) {
                    missing.push((name, span));
                }
                None
            }
            Err(message) => {
                self.problems.add(span, message);
                None
            }
        }
    }

    /// Reports all missing FMUs as one mistake: usually none has been packed.
    fn report_missing_fmus(
        &mut self,
        missing: &[(&str, Range<usize>)],
        of_cases: &[(&str, &str)],
        source: &dyn Descriptions,
    ) {
        let mut names: Vec<&str> = Vec::new();
        for (name, _) in missing {
            if !names.contains(name) {
                names.push(name);
            }
        }
        let in_case = |name: &str| {
            let cases: Vec<&str> = of_cases.iter().filter(|(fmu, _)| *fmu == name).map(|(_, case)| *case).collect();
            let is_of_component = missing.iter().filter(|(other, _)| *other == name).count() > cases.len();
            match cases[..] {
                [case, ..] if !is_of_component => format!(" (case `{case}`)"),
                _ => String::new(),
            }
        };
        let message = match names[..] {
            [] => return,
            [name] => format!("there is no {name}.fmu in {}{}", source.place(), in_case(name)),
            _ => {
                let names: Vec<String> = names.iter().map(|name| format!("{name}{}", in_case(name))).collect();
                format!("{} FMUs are not in {}: {}", names.len(), source.place(), names.join(", "))
            }
        };
        let (packed, buildable) = (source.names(), source.buildable());
        let (ours, unknown): (Vec<&str>, Vec<&str>) =
            names.iter().partition(|name| buildable.iter().any(|known| known == *name));
        let all = || packed.iter().chain(&buildable).map(String::as_str);
        let mut hints = Vec::new();
        let mut elsewhere = false;
        for name in &unknown {
            match suggestion(name, all()) {
                Some(hint) if names.len() == 1 => hints.push(hint),
                Some(hint) => hints.push(format!("`{name}`: {hint}")),
                None => elsewhere |= source.beside(name).is_none(),
            }
        }
        let beside = names.iter().find_map(|name| Some((name, source.beside(name)?)));
        if let Some((name, folder)) = &beside {
            hints.push(format!("add `--fmus {folder}`, which contains {name}.fmu"));
        }
        if ours.iter().any(|name| source.beside(name).is_none()) {
            hints.push(format!("`chassis pack {}` builds all FMUs that this scenario needs", self.problems.file()));
        }
        if elsewhere {
            hints.push("if an FMU is not built in this workspace, give its folder with --fmus".to_string());
        }
        // Mark the names that may be wrong; if there are none, mark the first missing FMU.
        let wrong = missing.iter().filter(|(name, _)| unknown.contains(name));
        let mut places: Vec<Range<usize>> = wrong.map(|(_, place)| place.clone()).collect();
        if places.is_empty() {
            places.extend(missing.first().map(|(_, place)| place.clone()));
        }
        self.problems.add_at(&places, message, Some(hints.join("\n")));
    }
}
