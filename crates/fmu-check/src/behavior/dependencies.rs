//! Compares the dependencies that the model structure declares with those that the trials observe.

use super::{CheckResult, Report, Trial, found, moved, values};
use crate::Finding;
use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Causality, DataType, Unknown, Value, Variable};
use fmu_import::loader::Instance;
use std::collections::{BTreeSet, HashSet};

const POINTS: usize = 6;
/// If the range of an Integer parameter is at most this large, all of its values are tried.
const MOST_CHOICES: f64 = 8.0;
/// Maximum number of values that are read to find the dependencies in one list. Reading them takes some seconds.
const MOST_READ: usize = 50_000_000;

#[derive(Clone)]
struct Choice {
    parameter: usize,
    value: Value,
}

impl Trial<'_> {
    /// Returns an instance in Initialization Mode with another value for one parameter.
    fn configured(&self, name: &str, choice: Option<&Choice>) -> CheckResult<Instance> {
        let mut instance = self.instance(name)?;
        if let Some(Choice { parameter, value }) = choice {
            instance.set_value(self.variable(*parameter).reference, value)?;
        }
        instance.setup_experiment(self.start, None)?;
        instance.enter_initialization_mode()?;
        Ok(instance)
    }

    /// The parameters that probably select between equations (Booleans, and Integers with few values), with each value
    /// that is not their start value.
    fn choices(&self) -> Vec<Choice> {
        let values = |variable: &Variable| match (&variable.start, variable.min, variable.max) {
            (Some(Value::Boolean(start)), ..) => vec![Value::Boolean(!start)],
            (Some(Value::Integer(start)), Some(min), Some(max)) if max - min <= MOST_CHOICES => {
                (min as i64..=max as i64).filter(|value| value != start).map(Value::Integer).collect()
            }
            _ => Vec::new(),
        };
        let parameters = self.description.variables.iter().enumerate();
        parameters
            .filter(|(_, variable)| variable.causality == Causality::Parameter)
            .flat_map(|(parameter, variable)| {
                values(variable).into_iter().map(move |value| Choice { parameter, value })
            })
            .collect()
    }

    /// The ends of the ranges of real parameters. Without a limit, the end differs from the start value by the
    /// magnitude of this value. At the ends, equations may have another structure than at the start value.
    fn limits(&self) -> Vec<Choice> {
        let ends = |variable: &Variable| match variable.start {
            Some(Value::Real(start)) => {
                let ends = [
                    variable.min.unwrap_or_else(|| moved(start, -1.0, variable.data_type)),
                    variable.max.unwrap_or_else(|| moved(start, 1.0, variable.data_type)),
                ];
                ends.into_iter().filter(|end| *end != start).collect()
            }
            _ => Vec::new(),
        };
        let parameters = self.filtered(|variable| variable.causality == Causality::Parameter).into_iter();
        parameters
            .flat_map(|parameter| {
                let choice = move |value| Choice { parameter, value: Value::Real(value) };
                ends(self.variable(parameter)).into_iter().map(choice)
            })
            .collect()
    }

    /// For the list InitialUnknowns, finds dependencies on inputs, parameters and exact start values of any type in
    /// Initialization Mode.
    pub(super) fn initial_dependencies(&self, report: Report<'_>) -> CheckResult<()> {
        let mut known = self.settable_in_initialization();
        let unknowns = self.description.initial_unknowns.iter();
        let unknowns: Vec<&Unknown> = unknowns.filter(|unknown| self.is_scalar(unknown)).collect();
        let mut search = self.search(self.function("InitialUnknowns", "InitialUnknown"), unknowns);
        for choice in self.all_choices() {
            let mut instance = None;
            known.retain(|&j| {
                let Some(mut ready) = instance.take().or_else(|| self.readable(choice.as_ref(), &search.variables))
                else {
                    return true;
                };
                let is_sound = search.vary(self, j, &mut ready, report).is_ok();
                instance = is_sound.then_some(ready);
                // A value that makes the FMU unreadable, such as the name of a missing file, proves nothing.
                is_sound
            });
        }
        // While a parameter is at its limit, only states are varied. Other trials vary the inputs between steps. A
        // second parameter is not varied, because there are too many pairs of parameters.
        let states: Vec<usize> = known.into_iter().filter(|&j| self.is_state(j)).collect();
        for limit in self.limits().into_iter().filter(|_| !states.is_empty()) {
            search.choice = Some(limit);
            // Inconsistent values prove nothing.
            let Some(mut instance) = self.readable(search.choice.as_ref(), &search.variables) else { continue };
            for &state in &states {
                if search.vary(self, state, &mut instance, report).is_err() {
                    break;
                }
            }
        }
        search.end(report);
        Ok(())
    }

    /// Returns true for a scalar that is not a wide integer.
    fn is_scalar(&self, unknown: &Unknown) -> bool {
        let variable = self.variable(unknown.variable);
        !variable.is_array() && !values::is_wide(variable)
    }

    /// True for a continuous state, whose derivative is in the list Derivatives.
    fn is_state(&self, variable: usize) -> bool {
        let mut derivatives = self.description.derivatives.iter();
        derivatives.any(|unknown| self.variable(unknown.variable).derivative_of == Some(variable))
    }

    /// An instance in Initialization Mode with this choice; `None` if the variables cannot be read.
    fn readable(&self, choice: Option<&Choice>, variables: &[usize]) -> Option<Instance> {
        let mut instance = self.configured("dependencies", choice).ok()?;
        self.values(&mut instance, variables).is_ok().then_some(instance)
    }

    /// The start values of the parameters, then every choice.
    fn all_choices(&self) -> impl Iterator<Item = Option<Choice>> {
        std::iter::once(None).chain(self.choices().into_iter().map(Some))
    }

    /// For the lists Outputs and Derivatives, finds dependencies on inputs between steps, if a new input has an effect
    /// before the next step.
    pub(super) fn step_dependencies(&self, report: Report<'_>) -> CheckResult<()> {
        let is_real =
            |unknown: &&Unknown| self.variable(unknown.variable).base_type == BaseType::Real && self.is_scalar(unknown);
        let lists = [
            (self.function("Derivatives", "ContinuousStateDerivative"), &self.description.derivatives),
            (self.function("Outputs", "Output"), &self.description.outputs),
        ];
        let mut searches = lists.map(|(list, unknowns)| self.search(list, unknowns.iter().filter(is_real).collect()));
        if self.inputs.is_empty() || searches.iter().all(|search| search.unknowns.is_empty()) {
            return Ok(());
        }
        let limits = self.limits().into_iter().map(|limit| (Some(limit), 1, 1));
        for (choice, points, steps) in self.all_choices().map(|choice| (choice, POINTS, 5)).chain(limits) {
            let started = self.configured("dependencies", choice.as_ref()).and_then(|mut instance| {
                instance.exit_initialization_mode()?;
                Ok(instance)
            });
            // Inconsistent values prove nothing.
            let Ok(mut instance) = started else { continue };
            for point in 0..points {
                if self.go(&mut instance, point * steps..(point + 1) * steps, 1).is_err() {
                    break;
                }
                for search in searches.iter_mut().filter(|search| !search.unknowns.is_empty()) {
                    search.choice.clone_from(&choice);
                    search.look(self, &self.inputs, &mut instance, report)?;
                }
            }
        }
        searches.iter().for_each(|search| search.end(report));
        let [_, search] = searches;
        // In an FMU that computes its outputs only in fmi2DoStep, nothing depends on inputs between steps.
        if search.followed.is_empty() || search.is_cut() {
            return Ok(());
        }
        let inputs: HashSet<usize> = self.inputs.iter().copied().collect();
        for unknown in search.unknowns.iter().filter(|unknown| !search.followed.contains(&unknown.variable)) {
            let names_inputs = unknown.dependencies.iter().flatten().any(|i| inputs.contains(i));
            if names_inputs {
                let name = &self.variable(unknown.variable).name;
                let message = format!(
                    "lists inputs among its dependencies in {}, but depends on none of them in any trial: masters may \
                     solve an algebraic loop that does not exist",
                    search.list
                );
                found(report, Finding::warning(format!("variable `{name}`"), message));
            }
        }
        Ok(())
    }

    /// Compares `fmi3GetVariableDependencies` with the lists Outputs and Derivatives.
    pub(super) fn element_dependencies(&self, report: Report<'_>) -> CheckResult<()> {
        if !self.unit.provides_per_element_dependencies {
            return Ok(());
        }
        let mut instance = self.started("elements")?;
        for unknown in self.description.derivatives.iter().chain(&self.description.outputs) {
            let variable = self.variable(unknown.variable);
            let problem = |(own, reference, element): (usize, Reference, usize)| {
                if self.description.clocks.iter().any(|clock| clock.reference == reference) {
                    return None;
                }
                let is_it = |v: &&Variable| v.reference == reference && v.alias_of.is_none();
                let Some(known) = self.description.variables.iter().find(is_it) else {
                    return Some(format!("the value reference {reference}, which no variable has"));
                };
                let ends = [(own, variable), (element, known)].into_iter().find(|(at, of)| *at > of.size);
                let named = unknown.dependencies.iter().flatten().any(|i| self.variable(*i).reference == reference);
                match ends {
                    Some((at, of)) => Some(format!("element {at} of `{}`, whose size is {}", of.name, of.size)),
                    None if named || unknown.dependencies.is_none() => None,
                    None => Some(format!("`{}`, which is missing from its dependencies in ModelStructure", known.name)),
                }
            };
            if let Some(problem) = instance.get_dependencies(variable.reference)?.into_iter().find_map(problem) {
                let message = format!("names {problem}, among the dependencies of `{}`", variable.name);
                found(report, Finding::error("fmi3GetVariableDependencies", message));
            }
        }
        Ok(())
    }

    fn search<'a>(&'a self, list: &'static str, unknowns: Vec<&'a Unknown>) -> Search<'a> {
        let named = |unknown: &&Unknown| Some(unknown.dependencies.as_ref()?.iter().copied().collect());
        Search {
            list,
            variables: unknowns.iter().map(|unknown| unknown.variable).collect(),
            named: unknowns.iter().map(named).collect(),
            unknowns,
            followed: BTreeSet::new(),
            reported: HashSet::new(),
            read: 0,
            choice: None,
        }
    }
}

struct Search<'a> {
    /// Name of the list in the model structure.
    list: &'static str,
    unknowns: Vec<&'a Unknown>,
    variables: Vec<usize>,
    /// Declared dependencies of each unknown; `None` stands for all knowns.
    named: Vec<Option<HashSet<usize>>>,
    /// Variables with observed dependencies.
    followed: BTreeSet<usize>,
    /// Pairs of an unknown and a known that were reported. Each pair is reported only once, although it may be observed
    /// several times.
    reported: HashSet<(usize, usize)>,
    read: usize,
    /// The parameter whose value differs from its start value.
    choice: Option<Choice>,
}

impl Search<'_> {
    /// Changes one known after the other and observes which unknowns change. Ends early if the FMU cannot be read. This
    /// is not an error, because between steps, a master may not read after it has set inputs (FMI 2.0.4, section
    /// 4.2.4).
    fn look(
        &mut self,
        trial: &Trial<'_>,
        known: &[usize],
        instance: &mut Instance,
        report: Report<'_>,
    ) -> CheckResult<()> {
        for &j in known {
            if self.is_cut() {
                return Ok(());
            }
            let before = trial.reals(instance, &self.variables)?;
            let kept = trial.reals(instance, &[j])?[0];
            for sign in [1.0, -1.0] {
                // A rejected value, perhaps outside of the limits, proves nothing.
                if trial.set(instance, &[j], &[moved(kept, sign * 1e-3, DataType::Float64)]).is_err() {
                    continue;
                }
                self.read += before.len();
                let Ok(after) = trial.reals(instance, &self.variables) else { return Ok(()) };
                for (i, (a, b)) in before.iter().zip(&after).enumerate() {
                    if a.to_bits() != b.to_bits() {
                        self.follows(trial, i, j, report);
                    }
                }
            }
            trial.set(instance, &[j], &[kept])?;
        }
        Ok(())
    }

    /// Sets a known to other values and observes which unknowns change. After an error, the instance is unusable.
    fn vary(&mut self, trial: &Trial<'_>, j: usize, instance: &mut Instance, report: Report<'_>) -> CheckResult<()> {
        if self.is_cut() {
            return Ok(());
        }
        let variable = trial.variable(j);
        let before = trial.values(instance, &self.variables)?;
        let kept = values::read(instance, variable)?;
        for value in values::changes(variable, &kept) {
            // A rejected value, perhaps outside of the limits, proves nothing.
            if instance.set_value(variable.reference, &value).is_err() {
                continue;
            }
            self.read += before.len();
            let after = trial.values(instance, &self.variables)?;
            for (i, (a, b)) in before.iter().zip(&after).enumerate() {
                if !values::is_same(a, b) {
                    self.follows(trial, i, j, report);
                }
            }
        }
        instance.set_value(variable.reference, &kept)?;
        trial.values(instance, &self.variables).map(drop)
    }

    /// Records that an unknown depends on a known, and reports the dependency if it is not declared.
    fn follows(&mut self, trial: &Trial<'_>, i: usize, j: usize, report: Report<'_>) {
        let unknown = self.variables[i];
        if unknown == j {
            return;
        }
        self.followed.insert(unknown);
        let is_missing = self.named[i].as_ref().is_some_and(|named| !named.contains(&j));
        if is_missing && self.reported.insert((unknown, j)) {
            let (name, known) = (&trial.variable(unknown).name, &trial.variable(j).name);
            let mut message = format!("depends on `{known}`, which is missing from its dependencies in {}", self.list);
            if let Some(Choice { parameter, value: Value::Real(value) }) = self.choice {
                let parameter = &trial.variable(parameter).name;
                message.push_str(&format!("; seen with `{parameter}` = {value}"));
            }
            found(report, Finding::error(format!("variable `{name}`"), message));
        }
    }

    fn is_cut(&self) -> bool {
        self.read > MOST_READ
    }

    fn end(&self, report: Report<'_>) {
        if self.is_cut() {
            let message = format!("were tried only in part, because there are too many: {MOST_READ} values were read");
            found(report, Finding::warning(format!("dependencies in {}", self.list), message));
        }
    }
}
