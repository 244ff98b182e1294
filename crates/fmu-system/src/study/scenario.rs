//! Checks against the scenario and its FMUs.

use super::{Distribution, Factor, Level, Names, Requirement, Study, StudyError};
use crate::parameter::{Settable, settable_of};
use crate::plan::Plan;
use crate::problem::Collector;
use crate::resolve::{Descriptions, Options, OtherFmu, ResolveError, resolve};
use crate::run::Component;
use crate::spanned::Spanned;
use fmu_import::description::{BaseType, Value};
use fmu_import::names::{any_of, suggestion};
use std::ops::Range;
use std::path::Path;

fn check_names<'a>(
    what: &str,
    names: impl IntoIterator<Item = &'a Spanned<String>>,
    known: &[&str],
    problems: &mut Collector,
) {
    for name in names.into_iter().filter(|name| !known.contains(&name.as_str())) {
        let expected = if known.is_empty() { "none".to_owned() } else { any_of(known) };
        let message = format!("unknown {what} `{}`, expected {expected}", name.get_ref());
        problems.add_with_help(name.span(), message, suggestion(name.get_ref(), known.iter().copied()));
    }
}

/// All combinations of the FMUs and communication steps that factors list, each with the place of its last value.
fn choices(factors: &[Factor], stop: Option<f64>) -> Vec<(Options, Option<Range<usize>>)> {
    let keep_parameters = factors.iter().any(|factor| factor.keep_parameters);
    let mut all = vec![(Options { stop, ..Options::default() }, None)];
    for factor in factors {
        let Some(values) = factor.values.as_ref().filter(|_| factor.fmu.is_some() || factor.is_step()) else {
            continue;
        };
        let with = |(options, _): &(Options, _)| -> Vec<(Options, Option<Range<usize>>)> {
            let each = values.iter().map(|level| {
                let mut options = options.clone();
                if let (Some(component), Level::Text(fmu)) = (&factor.fmu, level.get_ref()) {
                    let component = component.get_ref().clone();
                    options.fmus.push(OtherFmu { component, fmu: fmu.clone(), keep_parameters });
                } else {
                    options.step = level.get_ref().number();
                }
                (options, Some(level.span()))
            });
            each.collect()
        };
        all = all.iter().flat_map(with).collect();
    }
    all
}

impl Study {
    /// Checks everything that needs the scenario and its FMUs.
    pub(super) fn check_scenario(
        &self,
        study: &Path,
        source: &dyn Descriptions,
        problems: &mut Collector,
    ) -> Result<(), StudyError> {
        let scenario = study.parent().unwrap_or(Path::new("")).join(self.scenario.get_ref());
        if !scenario.is_file() {
            problems.add(self.scenario.span(), format!("there is no file {}", scenario.display()));
            return Ok(());
        }
        let mut plans = Vec::new();
        let stop = self.stop.as_ref().map(|stop| *stop.get_ref());
        for (options, place) in choices(self.vary.get_ref(), stop) {
            match resolve(&scenario, source, &options) {
                Ok(plan) => plans.push(plan),
                Err(ResolveError::Stop { message, .. }) => {
                    problems.add(self.stop.as_ref().map_or(0..0, Spanned::span), message);
                    return Ok(());
                }
                Err(error) => match place {
                    // A mistake in the scenario itself.
                    None => return Err(error.into()),
                    Some(place) => problems.add(place, error.lines().join("\n")),
                },
            }
        }
        let Some(plan) = plans.first().filter(|_| problems.is_empty()) else { return Ok(()) };
        self.check_against(plan, problems);
        for factor in self.vary.get_ref() {
            if plan.metrics.iter().any(|metric| metric.name == *factor.name.get_ref()) {
                let message = "the scenario has a metric of that name; choose another name";
                problems.add(factor.name.span(), message);
            }
            factor.check_variables(&plans, source, problems);
        }
        Ok(())
    }

    fn check_against(&self, plan: &Plan, problems: &mut Collector) {
        let cases: Vec<&str> = plan.cases.iter().map(|case| case.name.as_str()).collect();
        let points: Vec<&str> = plan.points.iter().map(|point| point.name.as_str()).collect();
        let metrics: Vec<&str> = plan.metrics.iter().map(|metric| metric.name.as_str()).collect();
        if metrics.is_empty() {
            problems.add(self.scenario.span(), "the scenario has no [[metric]], so there is nothing to report");
        }
        check_names("case", self.cases.iter().flat_map(Spanned::get_ref), &cases, problems);
        check_names("point", self.points.iter().flat_map(Spanned::get_ref), &points, problems);
        check_names("metric", self.metrics.iter().flatten(), &metrics, problems);
        let is_run =
            |case: &str| self.cases.as_ref().is_none_or(|chosen| chosen.iter().any(|name| name.get_ref() == case));
        let run: Vec<&str> = cases.into_iter().filter(|case| is_run(case)).collect();
        if let Some(search) = self.search.as_ref().map(Spanned::get_ref) {
            check_names("metric", [&search.metric], &metrics, problems);
            check_names("case", &search.case, &run, problems);
        }
        check_names("metric", self.series.iter().filter_map(|series| series.metric.as_ref()), &metrics, problems);
        for requirement in &self.requirement {
            check_names("metric", [&requirement.metric], &metrics, problems);
            check_names("case", requirement.cases.iter().flatten(), &run, problems);
            if requirement.of_change {
                requirement.check_baselines(plan, &run, problems);
            }
        }
    }
}

impl Requirement {
    fn check_baselines(&self, plan: &Plan, run: &[&str], problems: &mut Collector) {
        let is_compared = |case: &str| {
            let of_plan = plan.cases.iter().find(|of_plan| of_plan.name == case);
            of_plan.and_then(|case| case.baseline.as_deref()).is_some_and(|baseline| run.contains(&baseline))
        };
        for case in self.cases.iter().flatten() {
            let name = case.as_str();
            if run.contains(&name) && !is_compared(name) {
                problems.add(case.span(), format!("case `{name}` has no baseline that is run"));
            }
        }
        if !run.iter().any(|case| is_compared(case)) {
            problems.add(self.metric.span(), "no case has a baseline that is run");
        }
    }
}

impl Factor {
    /// Checks the variables, each in the first choice of FMUs that has it.
    fn check_variables(&self, plans: &[Plan], source: &dyn Descriptions, problems: &mut Collector) {
        let Some(variable) = self.variable.as_ref().filter(|_| !self.is_step()) else { return };
        let names = match variable.get_ref() {
            Names::One(name) => std::slice::from_ref(name),
            Names::Several(names) => names,
        };
        let describe = |component: &Component| {
            let name = Path::new(&component.fmu).file_stem().unwrap_or_default().to_string_lossy();
            let found = source.find(&name)?.ok_or_else(|| format!("there is no {name}.fmu in {}", source.place()))?;
            Ok(found.with_structure(&component.structure)?.description)
        };
        for name in names {
            let Some((component, of_component)) = name.split_once(':') else {
                problems.add(variable.span(), format!("`{name}`: expected \"component:variable\""));
                continue;
            };
            let mut found = plans.iter().map(|plan| settable_of(plan, describe, component, of_component));
            let first = found.next();
            match first.map(|first| first.or_else(|error| found.find_map(Result::ok).ok_or(error))) {
                Some(Ok(settable)) => self.check_variable(name, &settable, problems),
                Some(Err(message)) => problems.add(variable.span(), message),
                None => (),
            }
        }
    }

    fn check_variable(&self, name: &str, settable: &Settable, problems: &mut Collector) {
        let variable = &settable.variable;
        let base_type = variable.base_type;
        let distribution = self.distribution.as_ref().map(|distribution| *distribution.get_ref());
        let own = settable.value.as_ref().and_then(Value::real);
        let at = self.variable.as_ref().map_or(0..0, Spanned::span);
        if distribution == Some(Distribution::Seed) {
            if base_type != BaseType::Integer {
                problems.add(at, format!("`{name}` is {base_type}; a seed must be an Integer"));
            }
            return;
        }
        if self.relative && (base_type != BaseType::Real || own.is_none()) {
            problems.add(at, format!("`{name}` has no Real value for a relative value to multiply"));
            return;
        }
        if distribution.is_some_and(|d| d != Distribution::Grid) && base_type != BaseType::Real {
            problems.add(at, format!("`{name}` is {base_type} and cannot have a distribution: list its values"));
            return;
        }
        let mut scale = (1.0, 0.0);
        if let Some(unit) = self.unit.as_ref().filter(|unit| variable.unit.as_ref() != Some(unit.get_ref())) {
            let Some(known) = settable.units.iter().find(|known| known.name == *unit.get_ref()) else {
                let own = variable.unit.as_deref().unwrap_or("no unit");
                let mut names = vec![own];
                names.extend(settable.units.iter().map(|unit| unit.name.as_str()).filter(|name| *name != own));
                let message = format!("`{name}` cannot be given in {}, expected {}", unit.get_ref(), any_of(&names));
                problems.add_with_help(unit.span(), message, suggestion(unit.get_ref(), names));
                return;
            };
            scale = (known.factor, known.offset);
        }
        for (value, place) in self.extremes() {
            let value = if self.relative { value * own.unwrap_or(1.0) } else { (value - scale.1) / scale.0 };
            let unit = variable.unit.as_deref().filter(|unit| *unit != "1").map_or(String::new(), |u| format!(" {u}"));
            let wrong = variable.min.filter(|min| value < *min).map(|min| ("at least", min));
            if let Some((side, limit)) = wrong.or(variable.max.filter(|max| value > *max).map(|max| ("at most", max))) {
                problems.add(place, format!("`{name}` would be {value}{unit}, expected {side} {limit}"));
            }
        }
    }

    /// Returns the values of a list, or the ends of a distribution that has a minimum, each with its place.
    fn extremes(&self) -> Vec<(f64, Range<usize>)> {
        if let Some(values) = &self.values {
            let number = |level: &Spanned<Level>| Some((level.get_ref().number()?, level.span()));
            return values.iter().filter_map(number).collect();
        }
        let Some(min) = &self.min else { return Vec::new() };
        let max = self.max.as_ref().map_or((f64::INFINITY, min.span()), |max| (*max.get_ref(), max.span()));
        vec![(*min.get_ref(), min.span()), max]
    }
}
