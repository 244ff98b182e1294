//! Runs a plan many times with changed values and reduces each run to the numbers of its metrics.
//!
//! A [`Sample`] is a set of values and the runs of the plan to try them in. Its runs are consecutive tasks. A [`Row`]
//! depends only on the values of its sample, so a batch gives the same rows in any order, with any number of processes,
//! and whatever other samples it contains.

use crate::fmus::Fmus;
use crate::master::{self, Recording};
use crate::metrics::{Columns, Definition};
use crate::plan::Plan;
use crate::requirements::{baseline, definitions, numbers_of};
use crate::run::Run;
use crate::worker::{Failure, Pool, Task};
use fmu_import::description::Value;
use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

/// Values for variables of components, and the runs they are tried in.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The values. A run ignores values for components that it does not have.
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
    /// Values of the plan's metrics, `None` if undefined; or the failure, without the recorded rows.
    pub result: Result<Vec<Option<f64>>, Failure>,
    /// Time that the run took, s; 0 if it failed.
    pub seconds: f64,
}

/// The runs of a plan, prepared for many samples. They record only what the metrics need.
#[derive(Debug, Clone)]
pub struct Batch {
    plan: Plan,
    fmus: Fmus,
    metrics: BTreeSet<usize>,
    /// For each run, the index of the baseline's run, if a metric needs it.
    baselines: Vec<Option<usize>>,
}

/// Receives each row when it is done, in any order. After it returns false, runs that have not started are skipped.
pub type Take<'a> = &'a (dyn Fn(Row) -> bool + Sync);

impl Batch {
    /// Prepares the runs of a plan. `fmus` contains the FMUs of all runs.
    pub fn new(mut plan: Plan, fmus: Fmus) -> Self {
        let metrics = (0..plan.metrics.len()).collect();
        let needed: BTreeSet<usize> = definitions(&plan, &metrics).flat_map(Definition::needed_columns).collect();
        plan.runs.iter_mut().for_each(|run| run.keep_columns(&needed));
        let baselines = plan.runs.iter().map(|run| baseline(&plan, &metrics, run)).collect();
        Self { baselines, metrics, plan, fmus }
    }

    /// The plan; its runs record only what the metrics need.
    pub fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The FMUs.
    pub fn fmus(&self) -> &Fmus {
        &self.fmus
    }

    /// Returns a copy of a run with changed values.
    ///
    /// # Errors
    /// A value does not fit.
    ///
    /// # Panics
    /// If the plan has no such run.
    pub fn changed(&self, run: usize, changes: &[Change]) -> Result<Run, String> {
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
        // The finished runs of each sample.
        type Outcomes = Vec<(usize, Result<Recording, Failure>)>;
        let states: Vec<Mutex<Outcomes>> = samples.iter().map(|_| Mutex::default()).collect();
        let stopped = std::sync::atomic::AtomicBool::new(false);
        let order = std::sync::atomic::Ordering::Relaxed;
        let task = |index: usize| {
            let (sample, run) = tasks[index];
            let failed = |message: String| Failure::new(&self.plan.runs[run].id, message);
            if stopped.load(order) {
                return Err(failed("stopped".to_owned()));
            }
            let run = self.changed(run, &samples[sample].changes).map_err(failed)?;
            Ok(Task { run, csv: None })
        };
        let finish = |index: usize, outcome: Result<Recording, Failure>| {
            if stopped.load(order) {
                return;
            }
            let (sample, run) = tasks[index];
            let outcomes = {
                let mut outcomes = states[sample].lock().unwrap_or_else(PoisonError::into_inner);
                outcomes.push((run, outcome));
                if outcomes.len() < self.executed(&samples[sample]).len() {
                    return;
                }
                std::mem::take(&mut *outcomes)
            };
            for row in self.rows(sample, &samples[sample], &outcomes) {
                if !take(row) {
                    stopped.store(true, order);
                }
            }
        };
        pool.execute(&self.plan.simulation, tasks.len(), &task, &|_| (), &finish);
    }

    /// Executes runs with other values in worker processes and hands over their signals. `columns` are the slots to
    /// record for each run of the plan.
    pub fn record(
        &self,
        pool: &Pool,
        columns: &[Vec<Option<usize>>],
        runs: &[(Vec<Change>, usize)],
        take: &(dyn Fn(usize, Result<Recording, Failure>) + Sync),
    ) {
        let task = |index: usize| {
            let (changes, at) = &runs[index];
            let changed = self.changed(*at, changes).map_err(|error| Failure::new(&self.plan.runs[*at].id, error));
            changed.map(|run| Task { run: Run { columns: columns[*at].clone(), ..run }, csv: None })
        };
        pool.execute(&self.plan.simulation, runs.len(), &task, &|_| (), take);
    }

    /// Executes the runs of a sample in this process. The FMUs must be loaded. If an FMU crashes, the process ends.
    pub fn execute_here(&self, index: usize, sample: &Sample) -> Vec<Row> {
        let outcome = |run: &usize| {
            let failed = |error: String| Failure::new(&self.plan.runs[*run].id, error);
            let changed = self.changed(*run, &sample.changes).map_err(failed)?;
            master::execute(&self.plan.simulation, &changed, &self.fmus)
        };
        let outcomes: Vec<_> = self.executed(sample).iter().map(|run| (*run, outcome(run))).collect();
        self.rows(index, sample, &outcomes)
    }

    /// The runs that the rows of a sample need: its own runs, and the runs of their baselines.
    fn executed(&self, sample: &Sample) -> Vec<usize> {
        let own = sample.runs.iter().copied();
        let all: BTreeSet<usize> = own.clone().chain(own.filter_map(|run| self.baselines[run])).collect();
        all.into_iter().collect()
    }

    fn rows(&self, index: usize, sample: &Sample, outcomes: &[(usize, Result<Recording, Failure>)]) -> Vec<Row> {
        let of = |run: usize| outcomes.iter().find(|(of, _)| *of == run).map(|(_, outcome)| outcome);
        let row = |run: usize| {
            let result = match of(run)? {
                Err(failure) => Err(Failure { recorded: None, ..failure.clone() }),
                Ok(recording) => {
                    let baseline = self.baselines[run].and_then(of).and_then(|outcome| outcome.as_ref().ok());
                    let numbers = numbers_of(
                        &self.plan,
                        &self.metrics,
                        &recording.time,
                        &columns(recording),
                        baseline.map(columns).as_ref(),
                    );
                    let failed = |error: String| Failure::new(&self.plan.runs[run].id, error);
                    numbers.map(|numbers| (numbers, recording.seconds)).map_err(failed)
                }
            };
            let seconds = result.as_ref().map_or(0.0, |(_, seconds)| *seconds);
            Some(Row { sample: index, run, result: result.map(|(numbers, _)| numbers), seconds })
        };
        sample.runs.iter().filter_map(|run| row(*run)).collect()
    }
}

fn columns(recording: &Recording) -> Columns<'_> {
    let values = recording.columns.iter().enumerate();
    values.filter_map(|(index, column)| Some((index, column.as_deref()?))).collect()
}
