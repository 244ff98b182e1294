//! History of a method, written to a file evaluation by evaluation, so that the method can be resumed.
//!
//! A method depends only on its settings, its seed and the objectives that it gets. To resume, it starts over and takes
//! outcomes from the history, as far as they go, instead of computing them. A candidate that differs from the history
//! shows that the study has changed. A line that was cut off by the interruption is dropped.

use crate::search::{Evaluate, ExecutionError, Stop};
use crate::space::Parameter;
use std::collections::HashMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Outcome of a candidate.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Outcome {
    /// Objective: finite and not negative. It is the penalty if the candidate is not feasible.
    pub objective: f64,
    /// Reason that the candidate is not feasible; `None` if it is feasible.
    pub reason: Option<String>,
}

/// Computes the outcomes of candidates.
pub trait Objective: Sync {
    /// Calls `done` once for each candidate (values of the parameters), with its index and outcome, in any order and
    /// from any thread.
    fn evaluate(&self, candidates: &[Vec<f64>], done: &(dyn Fn(usize, Outcome) + Sync));
}

/// A candidate that was tried.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Candidate {
    /// Number of the evaluation, from 1.
    pub evaluation: u64,
    /// Generation, from 0.
    pub generation: u64,
    /// Values of the parameters.
    pub values: Vec<f64>,
    /// Objective.
    pub objective: f64,
}

/// Progress of a method.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize)]
pub struct Progress {
    /// Number of evaluations, including candidates whose outcome was already known.
    pub evaluations: u64,
    /// Generations started.
    pub generations: u64,
    /// Evaluations that violated a constraint or a limit, or that failed.
    pub infeasible: u64,
    /// The best feasible candidate.
    pub best: Option<Candidate>,
}

/// Called after every evaluation, whether it was computed or read from the history.
pub type Report<'a> = &'a (dyn Fn(&Progress) + Sync);
/// Called after every generation with new evaluations; saves what must survive an interruption.
pub type Checkpoint<'a> = &'a dyn Fn(&Progress) -> Result<(), ExecutionError>;

/// Gives a method its objectives, writes the history, enforces the budget.
pub struct Journal<'a> {
    parameters: &'a [Parameter],
    objective: &'a dyn Objective,
    budget: u64,
    target: Option<f64>,
    path: PathBuf,
    /// Rows that were read from the file and not yet requested.
    replay: std::vec::IntoIter<Row>,
    known: HashMap<Vec<u64>, Outcome>,
    log: Mutex<Log<'a>>,
    checkpoint: Checkpoint<'a>,
}

struct Log<'a> {
    file: File,
    progress: Progress,
    report: Report<'a>,
    /// The first failure; nothing is written after it.
    failure: Option<io::Error>,
}

impl<'a> Journal<'a> {
    /// Opens the history. An existing file is continued.
    ///
    /// # Errors
    /// The file cannot be read or written, or is not a history of these parameters.
    pub fn open(
        path: &Path,
        parameters: &'a [Parameter],
        objective: &'a dyn Objective,
        (budget, target): (u64, Option<f64>),
        report: Report<'a>,
        checkpoint: Checkpoint<'a>,
    ) -> Result<Self, ExecutionError> {
        let failed = ExecutionError::io(path);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(&failed)?;
        }
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(&failed)?;
        file.try_lock().map_err(|error| match error {
            TryLockError::WouldBlock => failed(io::Error::other("another process is writing to it")),
            TryLockError::Error(cause) => failed(cause),
        })?;
        let mut content = Vec::new();
        io::Read::read_to_end(&mut file, &mut content).map_err(&failed)?;
        // A line without a line feed was cut off.
        let whole = content.iter().rposition(|b| *b == b'\n').map_or(0, |at| at + 1);
        file.set_len(whole as u64).map_err(&failed)?;
        file.seek(io::SeekFrom::End(0)).map_err(&failed)?;
        let header = header(parameters);
        let replay = if whole == 0 {
            file.write_all(header.as_bytes()).map_err(&failed)?;
            Vec::new()
        } else {
            read(&content[..whole], &header, parameters.len())
                .map_err(|(line, message)| ExecutionError::Line(path.to_path_buf(), line, message))?
        };
        Ok(Self {
            parameters,
            objective,
            budget,
            target,
            path: path.to_path_buf(),
            replay: replay.into_iter(),
            known: HashMap::new(),
            log: Mutex::new(Log { file, progress: Progress::default(), report, failure: None }),
            checkpoint,
        })
    }

    /// Returns the progress.
    pub fn progress(&self) -> Progress {
        self.log().progress.clone()
    }

    fn log(&self) -> MutexGuard<'_, Log<'a>> {
        lock(&self.log)
    }

    fn failed(&self, cause: io::Error) -> ExecutionError {
        ExecutionError::io(&self.path)(cause)
    }

    /// Takes the outcomes of the first candidates from the history, as far as it contains them.
    fn replayed(&mut self, candidates: &[Vec<f64>]) -> Result<Vec<Outcome>, ExecutionError> {
        let mut outcomes = Vec::new();
        for candidate in candidates {
            let Some((values, outcome)) = self.replay.next() else { break };
            if bits(&values) != bits(candidate) {
                // Line 1 contains the names.
                let line = usize::try_from(self.log().progress.evaluations).unwrap_or(usize::MAX) + outcomes.len() + 2;
                let message = "this study would try other values here: the file belongs to another version of it";
                return Err(ExecutionError::Line(self.path.clone(), line, message.to_owned()));
            }
            outcomes.push(outcome);
        }
        Ok(outcomes)
    }
}

impl Evaluate for Journal<'_> {
    fn evaluate(&mut self, population: &[Vec<f64>]) -> Result<Vec<f64>, Stop> {
        let before = self.progress();
        let left = usize::try_from(self.budget.saturating_sub(before.evaluations)).unwrap_or(usize::MAX);
        if left == 0 {
            return Err(Stop::Budget);
        }
        let candidates: Vec<Vec<f64>> = population
            .iter()
            .take(left)
            .map(|shares| self.parameters.iter().zip(shares).map(|(p, share)| p.at(*share)).collect())
            .collect();
        let generation = before.generations;
        self.log().progress.generations += 1;
        let old = self.replayed(&candidates)?;
        for (candidate, outcome) in candidates.iter().zip(&old) {
            self.known.insert(bits(candidate), outcome.clone());
            self.log().count(generation, candidate, outcome);
        }
        // `work` contains each candidate to compute once, and `place` the index of each new candidate in `work`; `None`
        // if its outcome is known.
        let new = &candidates[old.len()..];
        let mut places: HashMap<Vec<u64>, usize> = HashMap::new();
        let mut work: Vec<Vec<f64>> = Vec::new();
        let place: Vec<Option<usize>> = new
            .iter()
            .map(|candidate| {
                let key = bits(candidate);
                (!self.known.contains_key(&key)).then(|| {
                    *places.entry(key).or_insert_with(|| {
                        work.push(candidate.clone());
                        work.len() - 1
                    })
                })
            })
            .collect();
        let (known, log) = (&self.known, &self.log);
        let outcome_of = |done: &[Option<Outcome>], i: usize| match place[i] {
            Some(at) => done[at].clone(),
            None => known.get(&bits(&new[i])).cloned(),
        };
        // Rows are written in order: a row is written when it and all rows before it are done.
        let results: Mutex<(usize, Vec<Option<Outcome>>)> = Mutex::new((0, vec![None; work.len()]));
        let advance = |finished: Option<(usize, Outcome)>| {
            let mut guard = lock(&results);
            let (next, done) = &mut *guard;
            if let Some((at, outcome)) = finished {
                done[at] = Some(outcome);
            }
            while *next < new.len() {
                let Some(outcome) = outcome_of(done, *next) else { break };
                lock(log).append(generation, &new[*next], &outcome);
                *next += 1;
            }
        };
        advance(None);
        self.objective.evaluate(&work, &|at, outcome| advance(Some((at, outcome))));
        let done = std::mem::take(&mut lock(&results).1);
        let outcomes: Vec<Outcome> =
            old.into_iter().chain((0..new.len()).filter_map(|i| outcome_of(&done, i))).collect();
        for (candidate, outcome) in work.iter().zip(done) {
            if let Some(outcome) = outcome {
                self.known.insert(bits(candidate), outcome);
            }
        }
        if outcomes.len() < candidates.len() {
            return Err(self.failed(io::Error::other("a candidate was left without an outcome")).into());
        }
        if let Some(cause) = self.log().failure.take() {
            return Err(self.failed(cause).into());
        }
        let progress = self.progress();
        if !new.is_empty() {
            let synced = self.log().file.sync_data();
            synced.map_err(|cause| self.failed(cause))?;
            (self.checkpoint)(&progress)?;
        }
        let best = progress.best.as_ref().map(|b| b.objective);
        // A history that was written with another target can continue beyond this target. All of it is used, so that no
        // better candidate is lost.
        if self.replay.len() == 0 && self.target.is_some_and(|target| best.is_some_and(|best| best <= target)) {
            return Err(Stop::Target);
        }
        if candidates.len() < population.len() {
            return Err(Stop::Budget);
        }
        Ok(outcomes.into_iter().map(|o| o.objective).collect())
    }
}

impl Log<'_> {
    fn append(&mut self, generation: u64, values: &[f64], outcome: &Outcome) {
        if self.failure.is_some() {
            return;
        }
        let line = line(self.progress.evaluations + 1, generation, values, outcome);
        // One call per line, so that an interruption leaves at most one incomplete line.
        match line.and_then(|line| self.file.write_all(&line)) {
            Ok(()) => self.count(generation, values, outcome),
            Err(error) => self.failure = Some(error),
        }
    }

    fn count(&mut self, generation: u64, values: &[f64], outcome: &Outcome) {
        let progress = &mut self.progress;
        progress.evaluations += 1;
        if outcome.reason.is_some() {
            progress.infeasible += 1;
        } else if progress.best.as_ref().is_none_or(|best| outcome.objective < best.objective) {
            progress.best = Some(Candidate {
                evaluation: progress.evaluations,
                generation,
                values: values.to_vec(),
                objective: outcome.objective,
            });
        }
        (self.report)(progress);
    }
}

/// Locks a mutex even if another thread has panicked: the data are valid, because rows are written as a whole.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// Number of whole evaluations in a history; a line that was cut off does not count.
pub(crate) fn evaluations(path: &Path) -> Result<u64, ExecutionError> {
    let content = std::fs::read(path).map_err(ExecutionError::io(path))?;
    // Each row is a line, and so is the header.
    Ok((content.iter().filter(|b| **b == b'\n').count() as u64).saturating_sub(1))
}

fn header(parameters: &[Parameter]) -> String {
    let mut names = vec!["evaluation", "generation"];
    names.extend(parameters.iter().map(|p| p.name.as_str()));
    names.extend(["objective", "feasible", "reason"]);
    let line = csv_line(names.iter().map(ToString::to_string));
    // Writing strings to memory cannot fail.
    line.map_or_else(|_| String::new(), |line| String::from_utf8_lossy(&line).into_owned())
}

fn line(evaluation: u64, generation: u64, values: &[f64], outcome: &Outcome) -> io::Result<Vec<u8>> {
    let mut fields = vec![evaluation.to_string(), generation.to_string()];
    fields.extend(values.iter().chain([&outcome.objective]).map(|v| format!("{v:?}")));
    fields.push(outcome.reason.is_none().to_string());
    // A row must be a single line.
    fields.push(outcome.reason.as_deref().unwrap_or_default().replace(['\n', '\r'], " "));
    csv_line(fields.into_iter())
}

fn csv_line(fields: impl Iterator<Item = String>) -> io::Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(fields)?;
    writer.into_inner().map_err(|error| io::Error::other(error.to_string()))
}

type Row = (Vec<f64>, Outcome);

/// Reads the rows of a history; the error is a line number and a message.
fn read(content: &[u8], header: &str, count: usize) -> Result<Vec<Row>, (usize, String)> {
    if !content.starts_with(header.as_bytes()) {
        return Err((1, format!("expected the columns {}", header.trim_end())));
    }
    let mut reader = csv::Reader::from_reader(content);
    let mut rows = Vec::new();
    for (row, record) in reader.records().enumerate() {
        let at = |message: String| (row + 2, message);
        let record = record.map_err(|error| at(error.to_string()))?;
        let number = |field: usize| match record.get(field).map(str::parse::<f64>) {
            Some(Ok(value)) if value.is_finite() => Ok(value),
            _ => Err(at(format!("column {}: expected a finite number", field + 1))),
        };
        let values = (2..2 + count).map(number).collect::<Result<Vec<_>, _>>()?;
        let objective = number(2 + count)?;
        let reason = match (record.get(3 + count), record.get(4 + count)) {
            (Some("true"), _) => None,
            (Some("false"), Some(reason)) => Some(reason.to_string()),
            _ => return Err(at(format!("column {}: expected true or false", 4 + count))),
        };
        if record.get(0) != Some(&(row + 1).to_string()) {
            return Err(at(format!("expected evaluation {}", row + 1)));
        }
        rows.push((values, Outcome { objective, reason }));
    }
    Ok(rows)
}
