//! Objectives by simulation: every candidate is evaluated in one or more runs of the scenario with changed parameters.

use crate::expression::Inequality;
use crate::journal::{Objective, Outcome, lock};
use crate::space::Parameter;
use fmu_import::description::Value;
use fmu_system::fmus::Fmus;
use fmu_system::master::Recording;
use fmu_system::metrics::{self, Kind, Summation};
use fmu_system::run::{self, Run};
use fmu_system::worker::{Failure, Pool, Task};
use std::sync::Mutex;

/// A term of the objective: factor * |kind(signal)|. The magnitude is used because an objective is not negative.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Term {
    /// Signal as named in the study.
    pub signal: String,
    /// Kind of number computed from the signal. It needs neither a threshold nor times, and is always defined.
    pub kind: Kind,
    /// Rows with from <= time <= to, s; `None`: all.
    pub window: Option<[f64; 2]>,
    /// Weight, as given or from judgments.
    pub weight: f64,
    /// Reference value, in the unit of the signal. The number is divided by it, or by its square for a mean square.
    pub reference: f64,
    /// Index of the recorded column.
    #[serde(skip)]
    pub column: usize,
}

impl Term {
    /// Factor of the number: the weight divided by the reference, which is squared for a mean square.
    fn factor(&self) -> f64 {
        match self.kind {
            Kind::MeanSquare => self.weight / (self.reference * self.reference),
            _ => self.weight / self.reference,
        }
    }
}

/// A limit on a signal. A run that exceeds it counts as diverged.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub(crate) struct Limit {
    pub(crate) signal: String,
    /// Largest magnitude, in the unit of the signal.
    pub(crate) magnitude: f64,
    /// Index of the recorded column.
    #[serde(skip)]
    pub(crate) column: usize,
}

/// An inequality that the parameters must fulfill. Candidates that violate it are not run.
#[derive(Debug, Clone)]
pub(crate) struct Constraint {
    pub(crate) name: String,
    /// The inequality; its variables are the symbols of the parameters, then the constants.
    pub(crate) inequality: Inequality,
}

/// Computes objectives with FMUs.
#[derive(Debug)]
pub struct Simulation {
    pub(crate) times: run::Simulation,
    /// The unpacked FMUs.
    pub(crate) fmus: Fmus,
    pub(crate) pool: Pool,
    /// The runs whose mean is the objective.
    pub(crate) runs: Vec<Run>,
    /// Parameters to optimize.
    pub parameters: Vec<Parameter>,
    /// Terms of the objective.
    pub terms: Vec<Term>,
    pub(crate) limits: Vec<Limit>,
    pub(crate) constraints: Vec<Constraint>,
    /// Values of the constants. They follow the parameters in the list of the variables of inequalities.
    pub(crate) constants: Vec<f64>,
    pub(crate) penalty: f64,
}

impl Simulation {
    /// Computes the outcome of parameter values (index, value) in some runs, without checking constraints.
    pub(crate) fn outcome(&self, runs: &[Run], values: &[(usize, f64)]) -> Outcome {
        let outcome = Mutex::new(None);
        self.outcomes(runs, &[values.to_vec()], &|_, found| *lock(&outcome) = Some(found));
        let found = lock(&outcome).take();
        found.unwrap_or_else(|| self.infeasible("there are no runs".to_owned()))
    }

    fn infeasible(&self, reason: String) -> Outcome {
        Outcome { objective: self.penalty, reason: Some(reason) }
    }

    /// Computes the outcomes of several sets of values, each in all of the runs.
    fn outcomes(&self, runs: &[Run], sets: &[Vec<(usize, f64)>], done: &(dyn Fn(usize, Outcome) + Sync)) {
        // All runs are executed even if one fails, and the first failure in their order is reported, so the outcome
        // does not depend on the number of processes.
        type Objectives = Vec<Option<Result<f64, String>>>;
        let objectives: Vec<Mutex<Objectives>> = sets.iter().map(|_| Mutex::new(vec![None; runs.len()])).collect();
        let place = |index: usize| (index / runs.len(), index % runs.len());
        let task = |index: usize| {
            let (set, run) = place(index);
            let mut run = runs[run].clone();
            for (parameter, value) in &sets[set] {
                let (component, name) = self.parameters[*parameter].component_and_name();
                let changed = run.set_parameter(&self.fmus, component, name, Value::Real(*value));
                changed.map_err(|error| Failure::new(&run.id, error))?;
            }
            Ok(Task { run, csv: None })
        };
        let finish = |index: usize, recorded: Result<Recording, Failure>| {
            let (set, run) = place(index);
            let objective = recorded
                .map_err(|failure| failure.to_string())
                .and_then(|recording| self.objective(&runs[run].id, &recording));
            let mut of_set = lock(&objectives[set]);
            of_set[run] = Some(objective);
            if of_set.iter().all(Option::is_some) {
                let sum = of_set.drain(..).flatten().try_fold(0.0, |sum, objective| Ok::<_, String>(sum + objective?));
                drop(of_set);
                done(set, self.mean(sum.map(|sum| sum / runs.len() as f64)));
            }
        };
        self.pool.execute(&self.times, sets.len() * runs.len(), &task, &|_| (), &finish);
    }

    fn mean(&self, objective: Result<f64, String>) -> Outcome {
        match objective {
            Ok(objective) if objective <= self.penalty => Outcome { objective, reason: None },
            Ok(objective) => self.infeasible(format!("the objective is {objective:?}, greater than the penalty")),
            Err(reason) => self.infeasible(reason),
        }
    }

    /// Returns the value of a parameter in the scenario, or its start value if the scenario does not set it; `None` if
    /// the runs have different values.
    pub(crate) fn own_value(&self, index: usize) -> Option<f64> {
        let (component, name) = self.parameters[index].component_and_name();
        let of = |run: &Run| {
            let component = run.components.iter().find(|u| u.name == component)?;
            let set = component.parameters.iter().find(|p| p.name == name).map(|p| p.value.clone());
            let start = || self.fmus.get(component).ok()?.description().variable(name)?.start.clone();
            set.or_else(start)?.real()
        };
        let first = of(self.runs.first()?)?;
        self.runs.iter().all(|run| of(run) == Some(first)).then_some(first)
    }

    fn objective(&self, run: &str, recording: &Recording) -> Result<f64, String> {
        for Limit { signal, magnitude, column } in &self.limits {
            let beyond = |v: &&f64| v.abs() > *magnitude;
            if let Some(value) = recording.column(*column).and_then(|values| values.iter().find(beyond)) {
                return Err(format!("run {run}: `{signal}` is {value:?}, the limit is {magnitude:?}"));
            }
        }
        let mut objective = 0.0;
        for term in &self.terms {
            let rows = metrics::window(&recording.time, term.window, self.times.step);
            let values = recording.column(term.column).and_then(|values| values.get(rows)).unwrap_or_default();
            let Some(number) = term.kind.of_values(values, Summation::InOrder) else {
                return Err(format!("run {run}: the window of the term of `{}` contains no recorded row", term.signal));
            };
            let value = term.factor() * number.abs();
            if !value.is_finite() {
                return Err(format!("run {run}: the term of `{}` is {value:?}", term.signal));
            }
            objective += value;
        }
        Ok(objective)
    }

    /// Returns the outcome of a candidate that violates a constraint and is therefore not run; `None` for other
    /// candidates.
    fn violated(&self, values: &[f64]) -> Option<Outcome> {
        let symbols = self.parameters.iter().zip(values).filter(|(p, _)| p.symbol.is_some()).map(|(_, v)| *v);
        let variables: Vec<f64> = symbols.chain(self.constants.iter().copied()).collect();
        let violated = self.constraints.iter().find(|c| !c.inequality.holds(&variables))?;
        Some(self.infeasible(format!("constraint {}", violated.name)))
    }
}

impl Objective for Simulation {
    fn evaluate(&self, candidates: &[Vec<f64>], done: &(dyn Fn(usize, Outcome) + Sync)) {
        let mut indices = Vec::new();
        let mut sets = Vec::new();
        for (index, values) in candidates.iter().enumerate() {
            match self.violated(values) {
                Some(outcome) => done(index, outcome),
                None => {
                    indices.push(index);
                    sets.push(values.iter().copied().enumerate().collect());
                }
            }
        }
        self.outcomes(&self.runs, &sets, &|set, outcome| done(indices[set], outcome));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// For a mean square, the reference is squared: twice the reference means a quarter of the weight.
    #[test]
    fn references_normalize() {
        let term = |kind| Term { signal: String::new(), kind, window: None, weight: 3.0, reference: 2.0, column: 0 };
        assert_eq!(term(Kind::MeanSquare).factor(), 0.75);
        assert_eq!(term(Kind::Rms).factor(), 1.5);
    }
}
