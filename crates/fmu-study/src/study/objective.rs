//! The objective: terms, their weights and the recorded signals that they are computed from.

use super::layout::{File, Judgment};
use super::numbers::positive;
use crate::ahp;
use crate::simulation::Term;
use fmu_import::names::suggestion;
use fmu_system::plan::Plan;
use fmu_system::problem::Collector;
use fmu_system::run::Run;
use fmu_system::spanned::Spanned;

/// Weights from judgments; `None` without judgments or if they are invalid.
pub(super) fn weights(file: &File, problems: &mut Collector) -> Option<ahp::Weights> {
    let objective = file.objective.get_ref();
    if objective.terms.is_empty() {
        problems.add(file.objective.span(), "an objective needs at least one [[objective.term]]");
    }
    for term in &objective.terms {
        if let Some(reference) = &term.reference {
            positive(reference, "reference", problems);
        }
        match (&term.weight, &objective.judgments) {
            (None, None) => {
                problems.add(term.signal.span(), "this term needs a weight, unless the objective has judgments")
            }
            (Some(weight), Some(_)) => problems.add(weight.span(), "the judgments determine the weights"),
            (Some(weight), None) if !(weight.is_finite() && *weight.get_ref() >= 0.0) => {
                problems.add(weight.span(), format!("weight is {:?}, expected 0 or more", weight.get_ref()));
            }
            _ => (),
        }
    }
    if !objective.terms.is_empty()
        && objective.terms.iter().all(|t| t.weight.as_ref().is_some_and(|w| *w.get_ref() == 0.0))
    {
        problems.add(file.objective.span(), "all weights are 0, expected one above 0");
    }
    let judgments = objective.judgments.as_ref()?;
    let mut matrix = Vec::new();
    for row in judgments.get_ref() {
        let mut numbers = Vec::new();
        for entry in row {
            match judgment(entry.get_ref()) {
                Some(value) => numbers.push(value),
                None => problems.add(entry.span(), "expected a number or a text such as \"1/3\""),
            }
        }
        matrix.push(numbers);
    }
    let complete = matrix.iter().zip(judgments.get_ref()).all(|(numbers, row)| numbers.len() == row.len());
    if !complete {
        return None;
    }
    if matrix.len() != objective.terms.len() {
        problems.add(
            judgments.span(),
            format!("{} rows of judgments, but {} terms of the objective", matrix.len(), objective.terms.len()),
        );
        return None;
    }
    ahp::weights(&matrix).map_err(|error| problems.add(judgments.span(), error)).ok()
}

fn judgment(entry: &Judgment) -> Option<f64> {
    match entry {
        Judgment::Number(value) => Some(*value),
        Judgment::Text(text) => {
            let (above, below) = text.split_once('/')?;
            let [above, below] = [above, below].map(|t| t.trim().parse::<f64>().ok());
            Some(above? / below?)
        }
    }
}

/// Finds recorded signals. Which signals a scenario records does not depend on the chosen cases.
pub(super) struct Columns<'a> {
    pub(super) plan: &'a Plan,
    pub(super) runs: &'a [Run],
}

impl Columns<'_> {
    fn writer(&self, index: usize) -> Option<&str> {
        self.plan.runs.iter().find_map(|run| {
            let slot = run.columns.get(index).copied().flatten()?;
            let writes = |u: &&fmu_system::run::Component| u.outputs.iter().any(|wire| wire.slot == slot);
            run.components.iter().find(writes).map(|u| u.name.as_str())
        })
    }

    /// Finds the column of `component:signal`, or of `signal` if only one component has a signal of that name. Every
    /// run must have the column.
    pub(super) fn find(&self, written: &Spanned<String>, problems: &mut Collector) -> Option<usize> {
        let text = written.get_ref();
        let names = || self.plan.columns.iter().map(|c| c.name.as_str());
        // A column is named just `signal` if only one component has a recorded signal of that name. In
        // `component:signal`, the component must then be the one that writes the column.
        let column = names().position(|name| name == text).or_else(|| {
            let (component, signal) = text.split_once(':')?;
            let index = names().position(|name| name == signal)?;
            (self.writer(index)? == component).then_some(index)
        });
        let Some(index) = column else {
            let signal = text.split_once(':').map_or(text.as_str(), |(_, signal)| signal);
            // The signal exists, but in another component.
            let writer = names().position(|name| name == signal).and_then(|index| self.writer(index));
            let near = match writer {
                Some(component) => Some(format!("did you mean `{component}:{signal}`?")),
                None => suggestion(signal, names()),
            };
            let near = near.map_or(String::new(), |s| format!("{s} Otherwise "));
            problems.add_with_help(
                written.span(),
                format!("the scenario does not record `{text}`"),
                Some(format!("{near}add it to `signals` of its [record]")),
            );
            return None;
        };
        if let Some(run) = self.runs.iter().find(|run| run.columns.get(index).copied().flatten().is_none()) {
            problems.add(written.span(), format!("the case `{}` does not have the signal `{text}`", run.case));
        }
        Some(index)
    }
}

pub(super) fn terms(
    file: &File,
    judged: Option<&ahp::Weights>,
    columns: &Columns<'_>,
    problems: &mut Collector,
) -> Vec<Term> {
    let simulation = &columns.plan.simulation;
    let mut terms = Vec::new();
    for (index, entry) in file.objective.terms.iter().enumerate() {
        if !entry.kind.needs_only_values() {
            problems
                .add(entry.kind.span(), "the kind of a term must always give a number, without a threshold or times");
        }
        if let Some(window) = &entry.window {
            let [from, to] = *window.get_ref();
            let (start, stop) = (simulation.start, simulation.stop);
            // Written so that a NaN fails as well.
            if !(from < to && from >= start && to <= stop) {
                problems
                    .add(window.span(), format!("expected a window [from, to] with {start} <= from < to <= {stop}"));
            }
        }
        let given = entry.weight.as_ref().map(|w| *w.get_ref());
        let weight = judged.map(|j| j.weights[index]).or(given).unwrap_or(0.0);
        if let Some(column) = columns.find(&entry.signal, problems) {
            terms.push(Term {
                signal: entry.signal.get_ref().clone(),
                kind: *entry.kind.get_ref(),
                window: entry.window.as_ref().map(|w| *w.get_ref()),
                weight,
                reference: entry.reference.as_ref().map_or(1.0, |r| *r.get_ref()),
                column,
            });
        }
    }
    terms
}
