//! Runs the methods of a study and writes the results.
//!
//! | file in OUT/STUDY | content |
//! |---|---|
//! | `METHOD/history.csv` | every evaluation, appended as it happens |
//! | `METHOD/state.json` | hash of what the history depends on, and progress; replaced after every generation |
//! | `METHOD/best.ssv` | the best values so far as an SSP parameter set; replaced when there are better ones |
//! | `summary.json` | [`Summary`]; replaced after every method |
//! | `best.ssv` | the best values of all methods |
//!
//! Apart from the history, a file is complete or does not exist.

use crate::journal::{self, Candidate, Journal, Outcome, Progress};
use crate::search::{ExecutionError, Stop};
use crate::simulation::{Limit, Term};
use crate::space::Parameter;
use crate::study::{Method, Search, Study};
use crate::{ahp, cma_es, genetic, pacsa};
use fmu_import::description::{Unit, Value};
use fmu_import::parameter_set::{self, ParameterSet};
use fmu_import::temporary;
use fmu_system::run::Run;
use serde::Serialize;
use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

/// Version of the layout of the summary.
const FORMAT: u32 = 3;
/// Version of the history and its state. The summary has its own version, because it is regenerated from the history.
const HISTORY_FORMAT: u32 = 1;

/// Treatment of results from an earlier call.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// Keep the results and fail.
    Error,
    /// Continue from the results.
    Resume,
    /// Start over.
    Overwrite,
}

/// Reason for the end of a method.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum End {
    /// The last generation is done.
    Generations,
    /// The budget is spent.
    Budget,
    /// The target is reached.
    Target,
}

/// Results of a study.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    format: u32,
    name: String,
    title: String,
    description: String,
    reference: String,
    scenario: String,
    fmus: BTreeSet<String>,
    /// Ids of the runs whose mean is the objective.
    pub runs: Vec<String>,
    /// Simulated time of a run, s.
    duration: f64,
    /// Evaluations per method.
    budget: u64,
    target: Option<f64>,
    penalty: f64,
    parameters: Vec<Parameter>,
    /// Name and inequality.
    constraints: Vec<(String, String)>,
    limits: Vec<Limit>,
    /// Terms of the objective.
    pub terms: Vec<Term>,
    /// Number of recorded rows in the window of each term.
    rows: Vec<usize>,
    /// Weights from judgments.
    pub judged: Option<ahp::Weights>,
    /// The scenario's own values.
    pub baseline: Baseline,
    /// Results of the comparisons.
    pub comparisons: Vec<Compared>,
    /// Methods that have ended.
    pub methods: Vec<MethodSummary>,
    /// Name of the method with the best values.
    pub best: Option<String>,
    /// True if the best values are better than the scenario's.
    pub improved: bool,
}

/// The scenario's own values of the parameters, and their objective.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Baseline {
    /// Title.
    pub title: String,
    /// Values in the order of the parameters; `None` where the runs have different values.
    pub values: Vec<Option<f64>>,
    /// Outcome.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// Result of a comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Compared {
    /// Title.
    pub title: String,
    /// Values that differ from the scenario's, by `component:parameter`.
    pub values: BTreeMap<String, f64>,
    /// Outcome.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// Result of a method.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MethodSummary {
    /// Method and settings.
    #[serde(flatten)]
    pub method: Method,
    /// Reason for its end.
    pub end: End,
    /// Progress.
    #[serde(flatten)]
    pub progress: Progress,
}

/// The file `state.json`.
#[derive(Serialize, serde::Deserialize)]
struct State<P> {
    format: u32,
    /// Hash of everything that the history depends on.
    fingerprint: String,
    progress: P,
}

/// Runs a study. `out` is the folder of all results; `report` is called with the method and its progress after every
/// evaluation.
///
/// # Errors
/// An FMU cannot be loaded, there are results that must be kept or belong to another study, or a file cannot be read or
/// written.
pub fn execute(
    study: &Study,
    out: &Path,
    existing: Existing,
    report: &(dyn Fn(&Method, &Progress) + Sync),
) -> Result<Summary, ExecutionError> {
    // If an FMU cannot be loaded, all runs would fail.
    study.simulation.pool.load().map_err(ExecutionError::Load)?;
    let folder = out.join(&study.name);
    let names = ["history.csv", "state.json", "best.ssv"];
    for method in &study.methods {
        let [history, state, best] = names.map(|name| folder.join(&method.name).join(name));
        match existing {
            Existing::Error if history.exists() => return Err(ExecutionError::Exists(history)),
            Existing::Overwrite => {
                for path in [history, state, best] {
                    remove(&path)?;
                }
            }
            Existing::Error | Existing::Resume => (),
        }
    }
    let fmus = fingerprints(study)?;
    // Check earlier results before anything is written.
    check_existing(study, &folder, &fmus)?;
    let mut summary = summary(study);
    for method in &study.methods {
        let (end, progress) = search(study, method, &folder.join(&method.name), &fmus, &|p| report(method, p))?;
        let objective = |best: &Option<Candidate>| best.as_ref().map_or(f64::INFINITY, |b| b.objective);
        let before = summary.methods.iter().map(|m| objective(&m.progress.best)).fold(f64::INFINITY, f64::min);
        if let Some(best) = progress.best.as_ref().filter(|b| b.objective < before) {
            write(&folder.join("best.ssv"), parameter_set(study, &best.values).as_bytes())?;
            summary.best = Some(method.name.clone());
            let baseline = &summary.baseline.outcome;
            summary.improved = baseline.reason.is_some() || best.objective < baseline.objective;
        }
        summary.methods.push(MethodSummary { method: method.clone(), end, progress });
        write(&folder.join("summary.json"), json(&summary).as_bytes())?;
    }
    Ok(summary)
}

/// Rejects histories of another study, and histories that are longer than the budget.
fn check_existing(study: &Study, folder: &Path, fmus: &BTreeMap<String, String>) -> Result<(), ExecutionError> {
    let mut longest: Option<(u64, PathBuf)> = None;
    for method in &study.methods {
        let folder = folder.join(&method.name);
        let history = folder.join("history.csv");
        if !history.exists() {
            continue;
        }
        let path = folder.join("state.json");
        let known = match std::fs::read(&path) {
            Ok(bytes) => serde_json::from_slice::<State<serde_json::Value>>(&bytes).ok(),
            Err(cause) if cause.kind() == io::ErrorKind::NotFound => None,
            Err(cause) => return Err(ExecutionError::io(&path)(cause)),
        };
        let fingerprint = fingerprint(study, method, fmus);
        if known.is_none_or(|state| state.format != HISTORY_FORMAT || state.fingerprint != fingerprint) {
            return Err(ExecutionError::Changed(history));
        }
        let evaluations = journal::evaluations(&history)?;
        if longest.as_ref().is_none_or(|(most, _)| evaluations > *most) {
            longest = Some((evaluations, history));
        }
    }
    match longest {
        Some((evaluations, path)) if evaluations > study.evaluations => {
            Err(ExecutionError::Budget { path, evaluations, budget: study.evaluations })
        }
        _ => Ok(()),
    }
}

fn search(
    study: &Study,
    method: &Method,
    folder: &Path,
    fmus: &BTreeMap<String, String>,
    report: &(dyn Fn(&Progress) + Sync),
) -> Result<(End, Progress), ExecutionError> {
    let fingerprint = fingerprint(study, method, fmus);
    let state_path = folder.join("state.json");
    let history = folder.join("history.csv");
    let save = |progress: &Progress| {
        let state = State { format: HISTORY_FORMAT, fingerprint: fingerprint.clone(), progress };
        write(&state_path, json(&state).as_bytes())
    };
    if !history.exists() {
        save(&Progress::default())?;
    }
    let written = Cell::new(0);
    let checkpoint = |progress: &Progress| {
        if let Some(best) = progress.best.as_ref().filter(|best| best.evaluation != written.get()) {
            write(&folder.join("best.ssv"), parameter_set(study, &best.values).as_bytes())?;
            written.set(best.evaluation);
        }
        save(progress)
    };
    let simulation = &study.simulation;
    let limits = (study.evaluations, study.target);
    let mut journal = Journal::open(&history, &simulation.parameters, simulation, limits, report, &checkpoint)?;
    let dimension = simulation.parameters.len();
    let ended = match &method.search {
        Search::Pacsa(settings) => pacsa::run(settings, dimension, method.seed, &mut journal),
        Search::Ga(settings) => genetic::run(settings, dimension, method.seed, &mut journal),
        Search::Cmaes(settings) => cma_es::run(settings, dimension, method.seed, &mut journal),
    };
    let end = match ended {
        Ok(()) => End::Generations,
        Err(Stop::Budget) => End::Budget,
        Err(Stop::Target) => End::Target,
        Err(Stop::Failed(error)) => return Err(error),
    };
    let progress = journal.progress();
    // If an earlier call ended before its last checkpoint, the last generation came from the history and has no
    // checkpoint yet.
    checkpoint(&progress)?;
    Ok((end, progress))
}

fn rows(times: &fmu_system::run::Simulation, term: &Term) -> usize {
    let distance = times.step * times.every as f64;
    let all: Vec<f64> = (0..=times.steps / times.every).map(|row| times.start + distance * row as f64).collect();
    fmu_system::metrics::window(&all, term.window, times.step).len()
}

/// Returns the summary without the results of the methods.
fn summary(study: &Study) -> Summary {
    let simulation = &study.simulation;
    let name = |index: usize| simulation.parameters[index].name.clone();
    let comparisons = study.comparisons.iter().map(|comparison| Compared {
        title: comparison.title.clone(),
        values: comparison.values.iter().map(|(index, value)| (name(*index), *value)).collect(),
        outcome: simulation.outcome(&comparison.runs, &comparison.values),
    });
    Summary {
        format: FORMAT,
        name: study.name.clone(),
        title: study.title.clone(),
        description: study.description.clone(),
        reference: study.reference.clone(),
        scenario: study.scenario.to_string_lossy().into_owned(),
        fmus: simulation.runs.iter().flat_map(|run| &run.components).map(|component| component.fmu.clone()).collect(),
        runs: simulation.runs.iter().map(|run| run.id.clone()).collect(),
        duration: simulation.times.stop - simulation.times.start,
        budget: study.evaluations,
        target: study.target,
        penalty: simulation.penalty,
        parameters: simulation.parameters.clone(),
        constraints: study.constraints.clone(),
        limits: simulation.limits.clone(),
        terms: simulation.terms.clone(),
        rows: simulation.terms.iter().map(|term| rows(&simulation.times, term)).collect(),
        judged: study.judged.clone(),
        baseline: Baseline {
            title: study.baseline.clone(),
            values: (0..simulation.parameters.len()).map(|index| simulation.own_value(index)).collect(),
            outcome: simulation.outcome(&simulation.runs, &[]),
        },
        comparisons: comparisons.collect(),
        methods: Vec::new(),
        best: None,
        improved: false,
    }
}

/// Hashes of files by path: of the FMUs, because a GUID identifies only the interface of an FMU, and of the files whose
/// paths are values of Strings.
fn fingerprints(study: &Study) -> Result<BTreeMap<String, String>, ExecutionError> {
    let mut hashes = BTreeMap::new();
    for component in study.simulation.runs.iter().flat_map(|run| &run.components) {
        let strings =
            component.parameters.iter().chain(&component.constants).filter_map(|setting| match &setting.value {
                // The paths in a plan are absolute.
                Value::String(text) if Path::new(text).is_absolute() && Path::new(text).is_file() => Some(text),
                _ => None,
            });
        for file in std::iter::once(&component.fmu).chain(strings) {
            if !hashes.contains_key(file) {
                let bytes = std::fs::read(file).map_err(ExecutionError::io(Path::new(file)))?;
                hashes.insert(file.clone(), hash(&bytes));
            }
        }
    }
    Ok(hashes)
}

/// Hash of everything that determines the history of a method. Budget and target only determine where it ends.
fn fingerprint(study: &Study, method: &Method, files: &BTreeMap<String, String>) -> String {
    let simulation = &study.simulation;
    // Only the content of a file matters, not its path.
    let runs: Vec<Run> = simulation
        .runs
        .iter()
        .cloned()
        .map(|mut run| {
            for component in &mut run.components {
                component.fmu = files.get(&component.fmu).cloned().unwrap_or_default();
                for setting in component.parameters.iter_mut().chain(&mut component.constants) {
                    if let Value::String(text) = &mut setting.value
                        && let Some(hash) = files.get(text.as_str())
                    {
                        text.clone_from(hash);
                    }
                }
            }
            run
        })
        .collect();
    let mut content = json(&(
        HISTORY_FORMAT,
        (&simulation.times, runs),
        (&simulation.parameters, &simulation.constants, &study.constraints),
        (&simulation.terms, &simulation.limits, simulation.penalty),
        (method.seed, method.search),
    ));
    if let Search::Cmaes(_) = method.search {
        content += cma_es::VERSION;
    }
    hash(content.as_bytes())
}

fn hash(bytes: &[u8]) -> String {
    uuid::Uuid::new_v5(&uuid::Uuid::NAMESPACE_OID, bytes).to_string()
}

/// The values as an SSP parameter set with names `component:parameter`.
fn parameter_set(study: &Study, values: &[f64]) -> String {
    let simulation = &study.simulation;
    let set = ParameterSet {
        name: study.name.clone(),
        parameters: simulation
            .parameters
            .iter()
            .zip(values)
            .map(|(parameter, value)| parameter_set::Parameter {
                name: parameter.name.clone(),
                value: Value::Real(*value),
                unit: parameter.unit.clone(),
            })
            .collect(),
    };
    let units: Vec<Unit> = simulation
        .runs
        .iter()
        .flat_map(|run| &run.components)
        .filter_map(|component| simulation.fmus.get(component).ok())
        .flat_map(|fmu| &fmu.description().units)
        .cloned()
        .collect();
    // Writing to memory cannot fail.
    set.to_xml(&units).unwrap_or_default()
}

/// Formats JSON with line breaks. All maps here have strings as keys, so it cannot fail.
fn json<T: Serialize>(value: &T) -> String {
    serde_json::to_string_pretty(value).map(|text| text + "\n").unwrap_or_default()
}

fn write(path: &Path, content: &[u8]) -> Result<(), ExecutionError> {
    temporary::write_whole(path, content).map_err(ExecutionError::io(path))
}

fn remove(path: &Path) -> Result<(), ExecutionError> {
    match std::fs::remove_file(path) {
        Err(cause) if cause.kind() != io::ErrorKind::NotFound => Err(ExecutionError::io(path)(cause)),
        _ => Ok(()),
    }
}
