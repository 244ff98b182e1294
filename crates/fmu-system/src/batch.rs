//! Runs a plan many times with changed values and reduces each run to the numbers of its metrics.
//!
//! A [`Sample`] is a set of values and the runs of the plan to try them in. Its runs are consecutive tasks. A [`Row`] depends only on the
//! values of its sample, so a batch gives the same rows in any order, with any number of processes and beside any other samples.

use crate::fmus::Fmus;
use crate::master::{self, Recording};
use crate::metrics::{Columns, Definition};
use crate::parameter::ParameterError;
use crate::plan::Plan;
use crate::report::Source;
use crate::run::Run;
use crate::worker::{Failure, FailureKind, Pool, Task};
use fmu_import::description::Value;
use serde::Serialize;
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

/// Values for variables of components, and the runs they are tried in.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The values. A run ignores those of components that it does not have.
    pub changes: Vec<Change>,
    /// Indices of runs of the plan, ascending.
    pub runs: Vec<usize>,
}

/// A value for a variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Name of the component.
    pub component: String,
    /// Name of the variable.
    pub variable: String,
    /// The value, in the unit of the variable.
    pub value: Value,
}

/// Outcome of a run with the values of a sample.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Index of the sample.
    pub sample: usize,
    /// Index of the run in the plan.
    pub run: usize,
    /// Numbers of the metrics of the plan; `None` if undefined. Empty if the run failed.
    pub numbers: Vec<Option<f64>>,
    /// End of the run.
    pub end: End,
    /// Place of the failure, if it failed.
    pub place: Place,
    /// Time that the run took, s; 0 if it failed.
    pub seconds: f64,
}

/// Component and variable that caused a failure, if known.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    /// Name of the component.
    pub component: Option<String>,
    /// Name of the variable: a signal that is not finite.
    pub variable: Option<String>,
}

/// End of a run of a sample.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum End {
    /// The run succeeded.
    Ok,
    /// An FMU did not accept the values, or could not be used at all.
    Rejected {
        /// Reason.
        message: String,
    },
    /// A step failed, a signal is not finite, or an FMU ended the simulation before the stop time.
    Diverged {
        /// Start of the step, or time of the row, s.
        time: f64,
        /// Component and call, or the signal.
        message: String,
    },
    /// The process that executed the run ended.
    Crashed {
        /// Start of the step, s; `None` before the first one.
        time: Option<f64>,
        /// Component and call.
        message: String,
    },
    /// A step took too long.
    TimedOut {
        /// Start of the step, s; `None` before the first one.
        time: Option<f64>,
        /// Component and call.
        message: String,
    },
}

impl From<&Failure> for End {
    fn from(failure: &Failure) -> Self {
        let Failure { time, message, kind, .. } = failure.clone();
        match (kind, time) {
            (FailureKind::Crashed, time) => Self::Crashed { time, message },
            (FailureKind::TimedOut, time) => Self::TimedOut { time, message },
            (_, Some(time)) => Self::Diverged { time, message },
            (_, None) => Self::Rejected { message },
        }
    }
}

/// The runs of a plan, prepared for many samples. They record only what the metrics need.
#[derive(Debug, Clone)]
pub struct Batch {
    plan: Plan,
    fmus: Fmus,
    /// For each run, the run of the baseline of its case, if a metric needs it.
    baselines: Vec<Option<usize>>,
}

/// Receives each row when it is done, in no particular order. After it returns false, runs that have not started are skipped.
pub type Take<'a> = &'a (dyn Fn(Row) -> bool + Sync);

impl Batch {
    /// Prepares the runs of a plan; the FMUs are those of its runs.
    #[must_use]
    pub fn new(mut plan: Plan, fmus: Fmus) -> Self {
        let needed: BTreeSet<usize> = definitions(&plan).flat_map(needed_columns).collect();
        for (index, slot) in plan.runs.iter_mut().flat_map(|run| run.columns.iter_mut().enumerate()) {
            if !needed.contains(&index) {
                *slot = None;
            }
        }
        let compared = definitions(&plan).any(|definition| definition.from_baseline);
        let baseline = |run: &Run| {
            let case = plan.cases.iter().find(|case| case.name == run.case)?;
            let name = case.baseline.as_ref().filter(|_| compared)?;
            plan.runs.iter().position(|other| other.case == *name && other.point == run.point && other.seed == run.seed)
        };
        let baselines = plan.runs.iter().map(baseline).collect();
        Self { plan, fmus, baselines }
    }

    /// The plan, whose runs record what the metrics need.
    #[must_use]
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The FMUs.
    #[must_use]
    pub fn fmus(&self) -> &Fmus {
        &self.fmus
    }

    /// A run of the plan with other values.
    ///
    /// # Errors
    /// A value does not fit.
    ///
    /// # Panics
    /// If the plan has no such run.
    pub fn changed(&self, run: usize, changes: &[Change]) -> Result<Run, ParameterError> {
        let mut run = self.plan.runs[run].clone();
        for Change { component, variable, value } in changes {
            if run.components.iter().any(|other| other.name == *component) {
                run.set_value(&self.fmus, component, variable, value.clone())?;
            }
        }
        Ok(run)
    }

    /// Executes all runs of some samples in worker processes.
    pub fn execute(&self, pool: &Pool, samples: &[Sample], take: Take<'_>) {
        let tasks: Vec<(usize, usize)> = samples
            .iter()
            .enumerate()
            .flat_map(|(index, sample)| self.executed(sample).into_iter().map(move |run| (index, run)))
            .collect();
        let states: Vec<Mutex<Collected>> =
            samples.iter().map(|sample| Mutex::new(Collected::new(self.executed(sample)))).collect();
        let stopped = std::sync::atomic::AtomicBool::new(false);
        let order = std::sync::atomic::Ordering::Relaxed;
        let task = |index: usize| {
            let (sample, run) = tasks[index];
            let failed = |message: String| Failure::new(&self.plan.runs[run].id, message);
            if stopped.load(order) {
                return Err(failed("stopped".to_owned()));
            }
            let run = self.changed(run, &samples[sample].changes).map_err(|error| failed(error.to_string()))?;
            Ok(Task { run, csv: None })
        };
        let finish = |index: usize, outcome: Result<Recording, Failure>| {
            if stopped.load(order) {
                return;
            }
            let (sample, run) = tasks[index];
            let done = states[sample].lock().unwrap_or_else(PoisonError::into_inner).add(run, outcome);
            for row in done.map_or(Vec::new(), |outcomes| self.rows(sample, &samples[sample], &outcomes)) {
                if !take(row) {
                    stopped.store(true, order);
                }
            }
        };
        pool.execute(&self.plan.simulation, tasks.len(), &task, &|_| (), &finish);
    }

    /// Executes runs with other values in worker processes and hands over their signals. `columns` are the slots to record
    /// for each run of the plan.
    pub fn record(
        &self,
        pool: &Pool,
        columns: &[Vec<Option<usize>>],
        runs: &[(Vec<Change>, usize)],
        take: &(dyn Fn(usize, Result<Recording, Failure>) + Sync),
    ) {
        let task = |index: usize| {
            let (changes, at) = &runs[index];
            let changed =
                self.changed(*at, changes).map_err(|error| Failure::new(&self.plan.runs[*at].id, error.to_string()));
            changed.map(|run| Task { run: Run { columns: columns[*at].clone(), ..run }, csv: None })
        };
        pool.execute(&self.plan.simulation, runs.len(), &task, &|_| (), take);
    }

    /// Executes the runs of a sample in this process. The FMUs must be loaded; one that crashes ends the process.
    #[must_use]
    pub fn execute_here(&self, index: usize, sample: &Sample) -> Vec<Row> {
        let outcome = |run: &usize| {
            let failed = |error: ParameterError| Failure::new(&self.plan.runs[*run].id, error.to_string());
            let changed = self.changed(*run, &sample.changes).map_err(failed)?;
            master::execute(&self.plan.simulation, &changed, &self.fmus).map_err(Failure::from)
        };
        let outcomes: Vec<_> = self.executed(sample).iter().map(|run| (*run, outcome(run))).collect();
        self.rows(index, sample, &outcomes)
    }

    /// The runs that the rows of a sample need: its own and those of baselines.
    fn executed(&self, sample: &Sample) -> Vec<usize> {
        let own = sample.runs.iter().copied();
        let all: BTreeSet<usize> = own.clone().chain(own.filter_map(|run| self.baselines[run])).collect();
        all.into_iter().collect()
    }

    fn rows(&self, index: usize, sample: &Sample, outcomes: &[(usize, Result<Recording, Failure>)]) -> Vec<Row> {
        let of = |run: usize| outcomes.iter().find(|(of, _)| *of == run).map(|(_, outcome)| outcome);
        let row = |run: usize| {
            let outcome = of(run)?;
            let (numbers, end, place, seconds) = match outcome {
                Err(failure) => {
                    let Failure { component, variable, .. } = failure;
                    let place =
                        Place { component: component.clone(), variable: variable.as_deref().map(str::to_owned) };
                    (Vec::new(), failure.into(), place, 0.0)
                }
                Ok(recording) => {
                    let baseline = self.baselines[run].and_then(of).and_then(|outcome| outcome.as_ref().ok());
                    match self.numbers(recording, baseline) {
                        Ok(numbers) => (numbers, End::Ok, Place::default(), recording.seconds),
                        Err(message) => (Vec::new(), End::Rejected { message }, Place::default(), 0.0),
                    }
                }
            };
            Some(Row { sample: index, run, numbers, end, place, seconds })
        };
        sample.runs.iter().filter_map(|run| row(*run)).collect()
    }

    /// The numbers of the metrics of a run.
    fn numbers(&self, recording: &Recording, baseline: Option<&Recording>) -> Result<Vec<Option<f64>>, String> {
        let columns = columns(recording);
        let of_baseline = baseline.map(self::columns);
        let simulation = &self.plan.simulation;
        let mut numbers: Vec<Option<f64>> = Vec::new();
        for metric in &self.plan.metrics {
            let number = match &metric.source {
                // The runs were cut short.
                Source::Signals(Definition { window: Some([from, _]), .. }) if *from >= simulation.stop => None,
                Source::Signals(definition) => definition
                    .value(&recording.time, &columns, of_baseline.as_ref(), simulation.step)
                    .map_err(|error| format!("metric {}: {error}", metric.name))?,
                Source::Metrics { value, .. } => value.value(|index| numbers.get(index).copied().flatten()),
            };
            numbers.push(number);
        }
        Ok(numbers)
    }
}

/// Outcomes of the runs of a sample, until all are there.
struct Collected {
    outcomes: Vec<(usize, Option<Result<Recording, Failure>>)>,
}

impl Collected {
    fn new(runs: Vec<usize>) -> Self {
        Self { outcomes: runs.into_iter().map(|run| (run, None)).collect() }
    }

    /// Adds an outcome; returns all of them after the last one.
    fn add(
        &mut self,
        run: usize,
        outcome: Result<Recording, Failure>,
    ) -> Option<Vec<(usize, Result<Recording, Failure>)>> {
        if let Some((_, slot)) = self.outcomes.iter_mut().find(|(of, _)| *of == run) {
            *slot = Some(outcome);
        }
        if self.outcomes.iter().any(|(_, outcome)| outcome.is_none()) {
            return None;
        }
        Some(self.outcomes.drain(..).filter_map(|(run, outcome)| Some((run, outcome?))).collect())
    }
}

fn definitions(plan: &Plan) -> impl Iterator<Item = &Definition> {
    plan.metrics.iter().filter_map(|metric| match &metric.source {
        Source::Signals(definition) => Some(definition),
        Source::Metrics { .. } => None,
    })
}

fn needed_columns(definition: &Definition) -> impl Iterator<Item = usize> {
    let until = definition.until.as_ref().map(|until| until.column);
    definition.columns.iter().copied().chain(definition.minus).chain(until)
}

fn columns(recording: &Recording) -> Columns<'_> {
    let values = recording.columns.iter().enumerate();
    values.filter_map(|(index, column)| Some((index, column.as_deref()?))).collect()
}
