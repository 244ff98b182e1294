//! Checks that FMUs and their order meet the requirements of rates, slopes, iteration and error control.

use super::system::{Resolver, System, context};
use crate::algebraic::MAX_UNKNOWNS;
use crate::run::{Extrapolation, Order, Run, Simulation};
use fmu_import::description::{Capabilities, FmiVersion};
use std::ops::Range;

/// A capability: its name in the description, and whether an interface has it.
type Capability = (&'static str, fn(&Capabilities) -> bool);

const SAVE: Capability = ("canGetAndSetFMUstate", |capabilities| capabilities.can_get_and_set_fmu_state);
const VARY: Capability =
    ("canHandleVariableCommunicationStepSize", |capabilities| capabilities.can_handle_variable_communication_step_size);

impl Resolver<'_> {
    /// Checks the components of a case. `run` is its run, with components in the order of the case.
    pub(super) fn check_coupling(&mut self, system: &System<'_>, run: &Run, simulation: &Simulation) {
        self.check_rates(system, run, simulation);
        self.check_slopes(system, run, simulation);
        self.check_loops(system, run);
        let keys = &self.scenario.simulation;
        let places = [keys.iterate.as_ref().map(|key| key.span()), keys.error_control.as_ref().map(|key| key.span())];
        let [iterate, error_control] = places;
        if let (Some(place), Order::Jacobi) = (iterate.as_ref().or(error_control.as_ref()), simulation.order) {
            let help = "set `order` to \"sequential\" or \"auto\"".to_owned();
            self.problems.add_with_help(place.clone(), "steps in the order \"jacobi\" cannot be repeated", Some(help));
        }
        if let Some(place) = iterate {
            let groups = run.coupled();
            if groups.is_empty() {
                self.problems.warn(place.clone(), "no continuous components depend on each other: no effect", None);
            }
            for group in groups {
                self.check_group(system, run, &group, (&place, "iterate"), &[SAVE]);
            }
        }
        if let Some(place) = error_control {
            let group = run.continuous();
            if group.is_empty() {
                self.problems.add(place.clone(), "`error_control` needs a continuous component");
            }
            self.check_group(system, run, &group, (&place, "error_control"), &[SAVE, VARY]);
        }
        self.problems.set_context(None);
    }

    fn check_rates(&mut self, system: &System<'_>, run: &Run, simulation: &Simulation) {
        for (planned, m) in run.components.iter().zip(&system.order) {
            let member = &system.members[*m];
            let own = member.component;
            let rates = [("every", &own.every, planned.every), ("substeps", &own.substeps, planned.substeps)];
            let Some((key, place)) =
                rates.iter().find(|(.., n)| *n > 1).and_then(|(key, at, _)| Some((*key, at.as_ref()?.span())))
            else {
                continue;
            };
            self.problems.set_context(Some(context(system.case, Some(own))));
            if !member.found.description.clocks.is_empty() {
                let message = format!("{} has clocks, so the component cannot have `{key}`", member.found.path);
                self.problems.add(place, message);
            } else if !simulation.steps.is_multiple_of(planned.every) && !member.has(VARY.1) {
                let message = format!(
                    "`every` is {}, which does not divide the {} steps of the run, and {} does not declare {}",
                    planned.every, simulation.steps, member.found.path, VARY.0
                );
                self.problems.add_with_help(place, message, Some("choose a divisor".to_owned()));
            }
        }
    }

    fn check_slopes(&mut self, system: &System<'_>, run: &Run, simulation: &Simulation) {
        let Some(key) = self.scenario.simulation.extrapolation.as_ref() else { return };
        let place = key.span();
        let has_slopes = run.components.iter().flat_map(|own| &own.inputs).any(|wire| wire.is_ramp);
        if simulation.extrapolation == Extrapolation::Linear && !has_slopes {
            self.problems.warn(place.clone(), "no input of a continuous component is a line: no effect", None);
        }
        for (planned, m) in run.components.iter().zip(&system.order) {
            let member = &system.members[*m];
            let has_slope = planned.inputs.iter().any(|wire| wire.is_ramp);
            if simulation.extrapolation != Extrapolation::Linear || !has_slope || member.can_interpolate() {
                continue;
            }
            let reason = match planned.fmi {
                FmiVersion::V2 => "does not declare canInterpolateInputs",
                FmiVersion::V3 => "is of FMI 3.0, which has no derivatives of inputs in co-simulation",
            };
            let message = format!("`{}` cannot get slopes of its inputs: {} {reason}", planned.name, member.found.path);
            let help = "remove `extrapolation`, or use an FMU that interpolates its inputs".to_owned();
            self.problems.set_context(Some(context(system.case, Some(member.component))));
            self.problems.add_at(&[member.component.name.span(), place.clone()], message, Some(help));
        }
    }

    fn check_loops(&mut self, system: &System<'_>, run: &Run) {
        let loops = run.initialization.iter().filter_map(|part| part.equations.as_ref());
        for found in loops.filter(|found| found.unknowns.len() > MAX_UNKNOWNS) {
            let (first, count) = (found.path.split(' ').next().unwrap_or_default(), found.unknowns.len());
            let message =
                format!("the algebraic loop of `{first}` must have up to {MAX_UNKNOWNS} unknowns, got {count}");
            let help = "break it with a delay, such as a discrete component".to_owned();
            self.problems.add_with_help(system.case.name.span(), message, Some(help));
        }
    }

    /// Checks components that repeat their steps together.
    fn check_group(
        &mut self,
        system: &System<'_>,
        run: &Run,
        group: &[usize],
        (place, key): (&Range<usize>, &str),
        needed: &[Capability],
    ) {
        for index in group {
            let (planned, member) = (&run.components[*index], &system.members[system.order[*index]]);
            self.problems.set_context(Some(context(system.case, Some(member.component))));
            let missing = needed.iter().find(|(_, has)| !member.has(*has));
            let reason = match missing {
                Some((name, _)) => format!("{} does not declare {name}", member.found.path),
                None if (planned.every, planned.substeps) != (1, 1) => "it has `every` or `substeps`".to_owned(),
                None if !member.found.description.clocks.is_empty() => format!("{} has clocks", member.found.path),
                None => continue,
            };
            let help = format!("remove `{key}`, or set `kind = \"discrete\"` if the component takes samples");
            let message = format!("`{}` cannot repeat steps, as `{key}` needs: {reason}", planned.name);
            self.problems.add_at(&[member.component.name.span(), place.clone()], message, Some(help));
        }
        if let Some(between) = group.windows(2).find(|pair| pair[0] + 1 != pair[1]).map(|pair| pair[0] + 1) {
            let names: Vec<String> = group.iter().map(|m| format!("`{}`", run.components[*m].name)).collect();
            let (names, other) = (names.join(", "), &run.components[between].name);
            let message = format!("`{key}` needs neighbors in the order, but `{other}` lies between {names}");
            let help = "use `order = \"auto\"`, or list these components one after the other".to_owned();
            self.problems.set_context(Some(context(system.case, None)));
            self.problems.add_with_help(place.clone(), message, Some(help));
        }
    }
}
