//! The recorded signals.

use super::pattern::{is_match, matches, split_pattern};
use super::system::{CaseComponent, Column, Resolver, System, context, near_outputs, outputs};
use crate::plan;
use crate::spanned::Spanned;
use fmu_import::description::{BaseType, Causality, Variable};
use std::collections::{BTreeSet, HashMap};

impl Resolver<'_> {
    /// All recorded signals, in the order of the scenario's components and the FMUs' variables.
    pub(super) fn columns(&mut self, systems: &[System<'_>]) -> Vec<Column> {
        for pattern in self.record.clone() {
            let (component, text) = split_pattern(pattern.get_ref());
            if component.is_some() && self.component_and_name(&pattern).is_none() {
                continue;
            }
            self.check_pattern(systems, &pattern, component, text);
        }
        // If several components record the same signal, the first one in the scenario keeps the plain name, so that
        // adding a component does not rename it.
        let mut owners: HashMap<&str, &str> = HashMap::new();
        let mut columns: Vec<Column> = Vec::new();
        // Maps (component, variable) to the index: a search would be slow for an FMU with very many outputs.
        let mut indices: HashMap<(&str, &str), usize> = HashMap::new();
        for component in &self.scenario.components {
            for system in systems {
                let Some(m) = system.member(component.name.get_ref()) else {
                    continue;
                };
                let member = &system.members[m];
                self.problems.set_context(Some(context(system.case, Some(component))));
                let inputs = member.inputs.iter().filter(|(v, source)| self.records_input(member, *v, source));
                let outputs = member
                    .wirable(Causality::Output)
                    .filter(|(_, variable)| self.is_recorded(member.name(), &variable.name));
                let recorded: Vec<&Variable> =
                    outputs.map(|(_, variable)| variable).chain(inputs.map(|(v, _)| member.variable(*v))).collect();
                for variable in recorded {
                    let owner = owners.entry(variable.name.as_str()).or_insert(member.name());
                    let shared = *owner != member.name();
                    let index = *indices.entry((member.name(), variable.name.as_str())).or_insert(columns.len());
                    let Some(known) = columns.get_mut(index) else {
                        columns.push(column(member, variable, shared));
                        continue;
                    };
                    // If the FMU of one case declares no unit, the unit of another case applies, as for connections.
                    match (&known.plan.unit, &variable.unit) {
                        (None, Some(_)) => *known = column(member, variable, shared),
                        (Some(other), Some(unit)) if other != unit => self.problems.add(
                            system.case.name.span(),
                            format!(
                                "`{}` of `{}` is in {unit} in this case, in {other} in another",
                                variable.name,
                                member.name(),
                            ),
                        ),
                        _ => {}
                    }
                }
            }
        }
        self.problems.set_context(None);
        self.tell_apart(&mut columns);
        columns
    }

    /// Gives a column the name component:variable if its plain name is `time` or the name of another column.
    fn tell_apart(&mut self, columns: &mut [Column]) {
        let mut taken = BTreeSet::from(["time".to_owned()]);
        for column in columns {
            if taken.contains(&column.plan.name) {
                column.plan.name = format!("{}:{}", column.component, column.variable);
            }
            if !taken.insert(column.plan.name.clone()) {
                let message = format!("two recorded signals have the name `{}`", column.plan.name);
                self.problems.add_with_help(
                    0..0,
                    message,
                    Some("rename a component, or record one of them only".into()),
                );
            }
        }
    }

    /// Finds the patterns of recorded signals that no output matches in any case.
    pub(super) fn find_patterns_of_inputs(&mut self, systems: &[System<'_>]) {
        let all = outputs(systems, None);
        let patterns = self.record.iter().map(|pattern| pattern.get_ref().clone());
        self.of_inputs =
            patterns.filter(|pattern| !all.iter().any(|(owner, name)| is_match(pattern, owner, name))).collect();
    }

    /// Returns true if a pattern matches an input. Reports inputs that are not recorded, and how to record them.
    fn is_input(&mut self, systems: &[System<'_>], pattern: &Spanned<String>) -> bool {
        let inputs = || {
            let members = systems.iter().flat_map(|system| &system.members);
            let all = members.flat_map(|member| member.inputs.iter().map(move |(v, source)| (member, *v, source)));
            all.filter(|(member, v, _)| is_match(pattern.get_ref(), member.name(), &member.variable(*v).name))
        };
        if inputs().any(|(member, v, source)| self.records_input(member, v, source)) {
            return true;
        }
        if inputs().next().is_some() {
            let message = format!("`{}` is an input, not an output", pattern.get_ref());
            let help = "record the output that writes it; only inputs that a file writes (`--inputs`) are recorded";
            self.problems.add_with_help(pattern.span(), message, Some(help.to_owned()));
            return true;
        }
        false
    }

    /// Reports a pattern of recorded signals that matches nothing in any case. Warns if it matches nothing in a case
    /// that replaces the FMU.
    fn check_pattern(
        &mut self,
        systems: &[System<'_>],
        pattern: &Spanned<String>,
        component: Option<&str>,
        text: &str,
    ) {
        if self.of_inputs.contains(pattern.get_ref()) && self.is_input(systems, pattern) {
            return;
        }
        let all = outputs(systems, component);
        let matches_any = |outputs: &BTreeSet<(&str, &str)>| outputs.iter().any(|(_, name)| matches(text, name));
        let message = format!("no output matches `{}`", pattern.get_ref());
        let is_known = matches_any(&all);
        for system in systems {
            let member = component.and_then(|component| system.member(component)).map(|m| &system.members[m]);
            self.problems.set_context(Some(context(system.case, member.map(|m| m.component))));
            if !is_known && (component.is_none() || member.is_some()) {
                self.problems.add_with_help(
                    pattern.span(),
                    message.clone(),
                    Some(near_outputs(systems, component, text)),
                );
            } else if member.is_some_and(|m| m.replaced.is_some())
                && !matches_any(&outputs(std::slice::from_ref(system), component))
            {
                self.problems.warn(pattern.span(), message.clone(), None);
            }
        }
        self.problems.set_context(None);
        if !is_known && all.is_empty() {
            self.problems.add(pattern.span(), message);
        }
    }
}

fn column(member: &CaseComponent<'_>, variable: &Variable, shared: bool) -> Column {
    let units = member.found.description.display_units(variable);
    let shown = variable.display_unit.as_ref().and_then(|name| units.iter().find(|u| u.name == *name));
    Column {
        component: member.name().to_string(),
        variable: variable.name.clone(),
        plan: plan::Column {
            name: if shared { format!("{}:{}", member.name(), variable.name) } else { variable.name.clone() },
            unit: variable.unit.clone(),
            display_unit: shown.map(|u| u.name.clone()),
            factor: shown.map_or(1.0, |u| u.factor),
            offset: shown.map_or(0.0, |u| u.offset),
            description: variable.description.clone().unwrap_or_default(),
            units,
            from_file: false,
            is_binary: variable.base_type == BaseType::Binary,
        },
    }
}
