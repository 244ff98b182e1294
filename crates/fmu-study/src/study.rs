//! Study files: TOML, resolved against a scenario and its FMUs. Their reference is `studies/README.md`.
//!
//! All mistakes of a file are reported together, each with file, line, column and the marked place.

use crate::expression::{FUNCTIONS, Inequality};
use crate::simulation::{Constraint, Limit, Simulation, Term};
use crate::space::Parameter;
use crate::{ahp, cma_es, genetic, pacsa};
use fmu_import::description::Value;
use fmu_import::names::suggestion;
use fmu_import::worker::Settings as WorkerSettings;
use fmu_system::fmus::{Fmus, FmusError};
use fmu_system::metrics::Kind;
use fmu_system::plan::Plan;
use fmu_system::problem::{Collector, Problems};
use fmu_system::resolve::{Descriptions, Options, ResolveError, resolve};
use fmu_system::run::Run;
use fmu_system::worker::Pool;
use miette::Diagnostic;
use serde::Deserialize;
use serde_spanned::Spanned;
use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Objective of what is not feasible, unless the study says otherwise.
const PENALTY: f64 = 1e6;
/// Largest population: 16 doublings of CMA-ES's stay countable.
const MAX_POPULATION: i64 = 100_000;
/// Title of the scenario's own values, unless a `[[compare]]` names them.
const BASELINE: &str = "As in the scenario";

/// Why a study cannot be carried out.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum StudyError {
    /// The study cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// The study has mistakes.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Problems(#[from] Problems),
    /// The scenario cannot be resolved.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Scenario(#[from] ResolveError),
    /// An FMU cannot be opened.
    #[error(transparent)]
    Fmu(#[from] FmusError),
}

/// The processes that run the FMUs of a study.
#[derive(Debug, Clone)]
pub struct Workers {
    /// What they are like.
    pub settings: WorkerSettings,
    /// How many there are.
    pub jobs: NonZeroUsize,
}

/// A study with nothing left to look up.
#[derive(Debug)]
pub struct Study {
    /// File stem of the study.
    pub name: String,
    /// Title.
    pub title: String,
    /// Description; a blank line separates paragraphs.
    pub description: String,
    /// Source.
    pub reference: String,
    /// Path of the scenario.
    pub scenario: PathBuf,
    /// Evaluations per method.
    pub evaluations: u64,
    /// A method ends when it has reached this objective.
    pub target: Option<f64>,
    /// Methods in their order.
    pub methods: Vec<Method>,
    /// Title of the scenario's own values, which are always compared with.
    pub baseline: String,
    /// Other values to compare with.
    pub comparisons: Vec<Comparison>,
    /// Weights from judgments, if there are any.
    pub judged: Option<ahp::Weights>,
    /// Constraints as written: name and inequality.
    pub constraints: Vec<(String, String)>,
    /// Computes objectives.
    pub simulation: Simulation,
}

/// A method and its settings.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Method {
    /// Name, that of its folder.
    pub name: String,
    /// Title.
    pub title: String,
    /// Title without the seed, shared by the runs of a `[[method]]` with several seeds.
    pub group: String,
    /// Seed of its random numbers.
    pub seed: u64,
    /// Kind and settings.
    #[serde(flatten)]
    pub search: Search,
}

/// Kind of a method, and its settings.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
#[serde(tag = "kind", content = "settings", rename_all = "snake_case")]
pub enum Search {
    /// Parallel adaptive clonal selection.
    Pacsa(pacsa::Settings),
    /// Genetic algorithm.
    Ga(genetic::Settings),
    /// Covariance matrix adaptation.
    Cmaes(cma_es::Settings),
}

/// Values of the parameters that are evaluated once, for comparison.
#[derive(Debug)]
pub struct Comparison {
    /// Title.
    pub title: String,
    /// (index of the parameter, value); the others are as the scenario has them.
    pub values: Vec<(usize, f64)>,
    /// The runs.
    pub runs: Vec<Run>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    title: String,
    #[serde(default)]
    description: String,
    #[serde(default)]
    reference: String,
    scenario: Spanned<String>,
    cases: Option<Vec<Spanned<String>>>,
    stop: Option<Spanned<f64>>,
    seeds: Option<Spanned<i64>>,
    seed: Option<Spanned<i64>>,
    penalty: Option<Spanned<f64>>,
    budget: Budget,
    #[serde(rename = "parameter", default)]
    parameters: Vec<ParameterEntry>,
    #[serde(default)]
    constants: BTreeMap<Spanned<String>, Spanned<f64>>,
    #[serde(rename = "constraint", default)]
    constraints: Vec<ConstraintEntry>,
    #[serde(rename = "limit", default)]
    limits: Vec<LimitEntry>,
    objective: Spanned<ObjectiveEntry>,
    #[serde(rename = "method", default)]
    methods: Vec<MethodEntry>,
    #[serde(rename = "compare", default)]
    comparisons: Vec<CompareEntry>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Budget {
    evaluations: Spanned<i64>,
    target: Option<Spanned<f64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ParameterEntry {
    name: Spanned<String>,
    symbol: Option<Spanned<String>>,
    min: Spanned<f64>,
    max: Spanned<f64>,
    #[serde(default)]
    log: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ConstraintEntry {
    name: Spanned<String>,
    inequality: Spanned<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct LimitEntry {
    signal: Spanned<String>,
    magnitude: Spanned<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ObjectiveEntry {
    judgments: Option<Spanned<Vec<Vec<Spanned<Judgment>>>>>,
    #[serde(rename = "term", default)]
    terms: Vec<TermEntry>,
}

/// A number, or a reciprocal such as "1/3".
#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Judgment {
    Number(f64),
    Text(String),
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct TermEntry {
    signal: Spanned<String>,
    kind: Spanned<Kind>,
    weight: Option<Spanned<f64>>,
    reference: Option<Spanned<f64>>,
    window: Option<Spanned<[f64; 2]>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct MethodEntry {
    kind: Spanned<String>,
    name: Option<Spanned<String>>,
    title: Option<String>,
    seed: Option<Spanned<i64>>,
    seeds: Option<Spanned<Vec<Spanned<i64>>>>,
    #[serde(default)]
    settings: BTreeMap<Spanned<String>, Spanned<toml::Value>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CompareEntry {
    title: String,
    case: Option<Spanned<String>>,
    #[serde(default)]
    values: BTreeMap<Spanned<String>, Spanned<f64>>,
}

/// Whether a file is a study, not a scenario: it names one. False if it cannot be read or is no TOML.
#[must_use]
pub fn is_study(path: &Path) -> bool {
    let table = text(path).ok().and_then(|text| text.parse::<toml::Table>().ok());
    table.is_some_and(|table| table.contains_key("scenario"))
}

/// Path of the scenario that a study names.
///
/// # Errors
/// The file cannot be read or does not have the layout of a study.
pub fn scenario(path: &Path) -> Result<PathBuf, StudyError> {
    let text = text(path)?;
    match toml::from_str::<File>(&text) {
        Ok(file) => Ok(path.parent().unwrap_or(Path::new("")).join(file.scenario.get_ref())),
        Err(error) => {
            let mut problems = Collector::new(path, &text, "toml");
            problems.add_layout(&error);
            Err(problems.fail().into())
        }
    }
}

fn text(path: &Path) -> Result<String, StudyError> {
    let read = fmu_system::limits::read_text(path, fmu_system::limits::TEXT_FILE);
    read.map_err(|cause| StudyError::Read { path: path.to_path_buf(), cause })
}

/// Reads a study and everything it needs.
///
/// # Errors
/// A file cannot be read, the study or its scenario has mistakes, an FMU cannot be opened.
pub fn read(path: &Path, source: &dyn Descriptions, workers: Workers) -> Result<Study, StudyError> {
    let text = text(path)?;
    let mut problems = Collector::new(path, &text, "toml");
    let file: File = match toml::from_str(&text) {
        Ok(file) => file,
        Err(error) => {
            problems.add_layout(&error);
            return Err(problems.fail().into());
        }
    };
    // What needs no scenario.
    let symbols = check_parameters(&file, &mut problems);
    let judged = weights(&file, &mut problems);
    let methods = methods(&file, &mut problems);
    let constraints = constraints(&file, &symbols, &mut problems);
    let penalty = file.penalty.as_ref().map_or(PENALTY, |p| positive(p, "penalty", &mut problems));
    let evaluations = at_least_1(&file.budget.evaluations, "evaluations", &mut problems);
    let seeds = file.seeds.as_ref().map(|s| at_least_1(s, "seeds", &mut problems));
    if let Some(target) = file.budget.target.as_ref().filter(|t| !t.get_ref().is_finite()) {
        problems.add(target.span(), "expected a finite number");
    }
    if !problems.is_empty() {
        return Err(problems.fail().into());
    }

    let scenario = path.parent().unwrap_or(Path::new("")).join(file.scenario.get_ref());
    if !scenario.is_file() {
        problems.add(file.scenario.span(), format!("there is no file {}", scenario.display()));
        return Err(problems.fail().into());
    }
    let options = Options {
        stop: file.stop.as_ref().map(|s| *s.get_ref()),
        seeds: seeds.and_then(|n| usize::try_from(n).ok()),
        ..Options::default()
    };
    let plan = match resolve(&scenario, source, &options) {
        Err(ResolveError::Option(message) | ResolveError::Stop { message, .. }) => {
            let span = file.stop.as_ref().map_or(file.scenario.span(), Spanned::span);
            problems.add(span, message);
            return Err(problems.fail().into());
        }
        other => other?,
    };
    if let Some(wanted) = &file.seeds
        && seeds.is_some_and(|n| n > plan.seeds.len() as u64)
    {
        let message = format!("seeds is {}, the scenario has {}", wanted.get_ref(), plan.seeds.len());
        problems.add(wanted.span(), message);
    }
    let fmus = Fmus::unpack(&plan.runs)?;
    let runs = chosen_runs(&file, &plan, &mut problems);
    let parameters = parameters(&file, &runs, &fmus, &mut problems);
    let columns = Columns { plan: &plan, runs: &runs };
    let terms = terms(&file, judged.as_ref(), &columns, &mut problems);
    let limits: Vec<Limit> = file
        .limits
        .iter()
        .filter_map(|limit| {
            Some(Limit {
                signal: limit.signal.get_ref().clone(),
                magnitude: positive(&limit.magnitude, "magnitude", &mut problems),
                column: columns.find(&limit.signal, &mut problems)?,
            })
        })
        .collect();
    let mut comparisons = comparisons(&file, &plan, &runs, &fmus, &mut problems);
    problems.finish()?;
    let pool = Pool::new(workers.settings, workers.jobs, &fmus);
    // A comparison with the scenario's own values only names them: they are evaluated anyway.
    let own = comparisons.iter().position(|c| c.values.is_empty() && c.runs == runs);
    let baseline = own.map_or(BASELINE.to_string(), |at| comparisons.remove(at).title);

    let needed: BTreeSet<usize> = terms.iter().map(|t| t.column).chain(limits.iter().map(|l| l.column)).collect();
    let slim = |runs: Vec<Run>| -> Vec<Run> { runs.into_iter().map(|run| without_columns(run, &needed)).collect() };
    Ok(Study {
        name: path.file_stem().map_or(String::new(), |s| s.to_string_lossy().into_owned()),
        title: file.title,
        description: file.description.trim().to_string(),
        reference: file.reference,
        scenario,
        evaluations,
        target: file.budget.target.map(Spanned::into_inner),
        methods,
        baseline,
        comparisons: comparisons.into_iter().map(|c| Comparison { runs: slim(c.runs), ..c }).collect(),
        judged,
        constraints: file
            .constraints
            .iter()
            .map(|c| (c.name.get_ref().clone(), c.inequality.get_ref().clone()))
            .collect(),
        simulation: Simulation {
            times: plan.simulation,
            fmus,
            pool,
            runs: slim(runs),
            parameters,
            terms,
            limits,
            constraints,
            constants: file.constants.values().map(|v| *v.get_ref()).collect(),
            penalty,
        },
    })
}

/// A run that records only what is needed.
fn without_columns(mut run: Run, needed: &BTreeSet<usize>) -> Run {
    for (index, slot) in run.columns.iter_mut().enumerate() {
        if !needed.contains(&index) {
            *slot = None;
        }
    }
    run
}

/// Checks names and ranges; gives the symbols that constraints may use: those of the parameters, then the constants.
fn check_parameters<'a>(file: &'a File, problems: &mut Collector) -> Vec<&'a str> {
    if file.parameters.is_empty() {
        problems.add(0..0, "a study needs at least one [[parameter]]");
    }
    let mut seen = BTreeSet::new();
    for parameter in &file.parameters {
        let name = parameter.name.get_ref().as_str();
        if !name.contains(':') {
            problems.add(parameter.name.span(), "expected \"component:parameter\"");
        }
        if !seen.insert(name) {
            problems.add(parameter.name.span(), format!("the parameter `{name}` is there twice"));
        }
        let (min, max) = (*parameter.min.get_ref(), *parameter.max.get_ref());
        if !min.is_finite() {
            problems.add(parameter.min.span(), "expected a finite number");
        } else if !(max.is_finite() && min < max) {
            problems.add(parameter.max.span(), format!("max is {max:?}, expected a finite number above min {min:?}"));
        } else if parameter.log && min <= 0.0 {
            problems.add(parameter.min.span(), format!("min is {min:?}, expected above 0 with log = true"));
        }
    }
    let symbols = file.parameters.iter().filter_map(|p| p.symbol.as_ref());
    let mut names: Vec<&str> = Vec::new();
    for symbol in symbols.chain(file.constants.keys()) {
        let text = symbol.get_ref().as_str();
        let is_letter = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if text.starts_with(|c: char| c.is_ascii_digit()) || text.is_empty() || !text.chars().all(is_letter) {
            problems
                .add(symbol.span(), "a name in constraints is made of letters, digits and _ and starts with no digit");
        } else if FUNCTIONS.contains(&text) {
            problems.add(symbol.span(), format!("`{text}` is a function"));
        } else if names.contains(&text) {
            problems.add(symbol.span(), format!("the name `{text}` is there twice"));
        }
        names.push(text);
    }
    for value in file.constants.values().filter(|v| !v.get_ref().is_finite()) {
        problems.add(value.span(), "expected a finite number");
    }
    names
}

fn constraints(file: &File, symbols: &[&str], problems: &mut Collector) -> Vec<Constraint> {
    let mut constraints: Vec<Constraint> = Vec::new();
    for entry in &file.constraints {
        if constraints.iter().any(|c| c.name == *entry.name.get_ref()) {
            problems.add(entry.name.span(), format!("the constraint `{}` is there twice", entry.name.get_ref()));
        }
        match Inequality::parse(entry.inequality.get_ref(), symbols) {
            Ok(inequality) => constraints.push(Constraint { name: entry.name.get_ref().clone(), inequality }),
            Err(error) => {
                // Behind the opening quote; an escape before it would shift the mark a little.
                let start = entry.inequality.span().start + 1;
                problems.add(start + error.span.start..start + error.span.end, error.message);
            }
        }
    }
    constraints
}

/// Weights from judgments; `None` without judgments or if they are wrong.
fn weights(file: &File, problems: &mut Collector) -> Option<ahp::Weights> {
    let objective = file.objective.get_ref();
    if objective.terms.is_empty() {
        problems.add(file.objective.span(), "an objective needs at least one [[objective.term]]");
    }
    for term in &objective.terms {
        if let Some(reference) = &term.reference {
            positive(reference, "reference", problems);
        }
        match (&term.weight, &objective.judgments) {
            (None, None) => problems.add(term.signal.span(), "this term needs a weight, or the objective judgments"),
            (Some(weight), Some(_)) => problems.add(weight.span(), "with judgments the weights follow from them"),
            (Some(weight), None) if !(weight.get_ref().is_finite() && *weight.get_ref() >= 0.0) => {
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
    ahp::weights(&matrix).map_err(|error| problems.add(judgments.span(), error.to_string())).ok()
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

fn methods(file: &File, problems: &mut Collector) -> Vec<Method> {
    if file.methods.is_empty() {
        problems.add(0..0, "a study needs at least one [[method]]");
    }
    let seed_of = |seed: &Spanned<i64>, problems: &mut Collector| {
        u64::try_from(*seed.get_ref()).unwrap_or_else(|_| {
            problems.add(seed.span(), format!("seed is {}, expected 0 or more", seed.get_ref()));
            0
        })
    };
    let common = file.seed.as_ref().map_or(1, |seed| seed_of(seed, problems));
    let mut methods: Vec<Method> = Vec::new();
    for entry in &file.methods {
        let mut settings = Settings { entry, known: Vec::new(), problems };
        let (title, search) = match entry.kind.get_ref().as_str() {
            "pacsa" => ("PACSA", Search::Pacsa(settings.pacsa())),
            "ga" => ("GA", Search::Ga(settings.ga())),
            "cmaes" => ("CMA-ES", Search::Cmaes(settings.cmaes())),
            other => {
                let help = suggestion(other, ["pacsa", "ga", "cmaes"]);
                problems.add_with_help(
                    entry.kind.span(),
                    format!("unknown method `{other}`, expected pacsa, ga or cmaes"),
                    help,
                );
                continue;
            }
        };
        settings.finish();
        let name = entry.name.as_ref().unwrap_or(&entry.kind);
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        if name.get_ref().is_empty() || !name.get_ref().chars().all(plain) {
            problems.add(name.span(), "the name of a method is made of a-z, 0-9 and _");
        }
        let group = entry.title.clone().unwrap_or_else(|| title.to_string());
        let one = |seed, name: String, title: String| Method { name, title, group: group.clone(), seed, search };
        let runs = match (&entry.seed, &entry.seeds) {
            (Some(_), Some(seeds)) => {
                problems.add(seeds.span(), "a method has a seed or seeds, not both");
                continue;
            }
            (_, Some(seeds)) => {
                if seeds.get_ref().is_empty() {
                    problems.add(seeds.span(), "seeds is empty");
                }
                let seeds = seeds.get_ref().iter().map(|seed| seed_of(seed, problems));
                seeds
                    .map(|seed| one(seed, format!("{}_{seed}", name.get_ref()), format!("{group}, seed {seed}")))
                    .collect()
            }
            (Some(seed), None) => vec![one(seed_of(seed, problems), name.get_ref().clone(), group.clone())],
            (None, None) => vec![one(common, name.get_ref().clone(), group.clone())],
        };
        for run in runs {
            if methods.iter().any(|m| m.name == run.name) {
                problems.add(name.span(), format!("the method `{}` is there twice; give it a name", run.name));
            }
            methods.push(run);
        }
    }
    methods
}

/// Reads the settings of a method.
struct Settings<'a> {
    entry: &'a MethodEntry,
    known: Vec<&'static str>,
    problems: &'a mut Collector,
}

impl Settings<'_> {
    fn number(&mut self, name: &'static str, usual: f64, range: RangeInclusive<f64>, whole: bool) -> f64 {
        self.known.push(name);
        let Some((_, written)) = self.entry.settings.iter().find(|(key, _)| key.get_ref() == name) else {
            return usual;
        };
        let value = match written.get_ref() {
            toml::Value::Integer(v) => Some(*v as f64),
            toml::Value::Float(v) if !whole => Some(*v),
            _ => None,
        };
        match value {
            Some(value) if range.contains(&value) => value,
            _ => {
                let kind = if whole { "a whole number" } else { "a number" };
                let message = format!(
                    "{name} is {}, expected {kind} from {} to {}",
                    written.get_ref(),
                    range.start(),
                    range.end()
                );
                self.problems.add(written.span(), message);
                usual
            }
        }
    }

    fn share(&mut self, name: &'static str, usual: f64) -> f64 {
        self.number(name, usual, 0.0..=1.0, false)
    }

    fn count(&mut self, name: &'static str, usual: usize, range: RangeInclusive<i64>) -> usize {
        // Whole and within the range, so the conversions are exact.
        let range = *range.start() as f64..=*range.end() as f64;
        self.number(name, usual as f64, range, true) as usize
    }

    fn generations(&mut self, usual: u32) -> u32 {
        self.number("generations", f64::from(usual), 1.0..=1e9, true) as u32
    }

    fn pacsa(&mut self) -> pacsa::Settings {
        let usual = pacsa::Settings::default();
        let population = self.count("population", usual.population, 2..=MAX_POPULATION);
        let most = population as i64;
        let settings = pacsa::Settings {
            population,
            selected: self.count("selected", usual.selected.min(population), 1..=most),
            clone_scale: self.count("clone_scale", usual.clone_scale, 1..=MAX_POPULATION),
            most_clones: self.count("most_clones", usual.most_clones, 1..=MAX_POPULATION),
            mutation_max: self.share("mutation_max", usual.mutation_max),
            mutation_min: self.share("mutation_min", usual.mutation_min),
            updates_max: self.number(
                "updates_max",
                usual.updates_max.min(most as f64 - 1.0),
                1.0..=most as f64 - 1.0,
                false,
            ),
            updates_min: self.number(
                "updates_min",
                usual.updates_min.min(most as f64 - 1.0),
                0.0..=most as f64 - 1.0,
                false,
            ),
            generations: self.generations(usual.generations),
        };
        self.ordered(["mutation_min", "mutation_max"], [settings.mutation_min, settings.mutation_max]);
        self.ordered(["updates_min", "updates_max"], [settings.updates_min, settings.updates_max]);
        settings
    }

    /// Reports a lower end that is above the upper one.
    fn ordered(&mut self, names: [&str; 2], [min, max]: [f64; 2]) {
        let written = names.iter().find_map(|name| self.entry.settings.iter().find(|(key, _)| key.get_ref() == name));
        if let Some((_, value)) = written.filter(|_| min > max) {
            self.problems.add(value.span(), format!("{} is {min:?}, expected at most {} {max:?}", names[0], names[1]));
        }
    }

    fn ga(&mut self) -> genetic::Settings {
        let usual = genetic::Settings::default();
        let population = self.count("population", usual.population, 2..=MAX_POPULATION);
        genetic::Settings {
            population,
            crossover: self.share("crossover", usual.crossover),
            mutation: self.share("mutation", usual.mutation),
            elite: self.count("elite", usual.elite, 0..=population as i64 - 1),
            generations: self.generations(usual.generations),
        }
    }

    fn cmaes(&mut self) -> cma_es::Settings {
        let usual = cma_es::Settings::default();
        let given = self.entry.settings.keys().any(|key| key.get_ref() == "population");
        let population = self.count("population", 2, 2..=MAX_POPULATION);
        cma_es::Settings {
            population: given.then_some(population),
            step_size: self.number("step_size", usual.step_size, 1e-6..=10.0, false),
        }
    }

    /// Reports settings the method does not have.
    fn finish(self) {
        for key in self.entry.settings.keys().filter(|key| !self.known.contains(&key.get_ref().as_str())) {
            let help = suggestion(key.get_ref(), self.known.iter().copied());
            let message = format!(
                "{} has no setting `{}`, expected one of: {}",
                self.entry.kind.get_ref(),
                key.get_ref(),
                self.known.join(", ")
            );
            self.problems.add_with_help(key.span(), message, help);
        }
    }
}

/// The runs of the cases named, all without names.
fn chosen_runs(file: &File, plan: &Plan, problems: &mut Collector) -> Vec<Run> {
    let Some(cases) = &file.cases else { return plan.runs.clone() };
    let known = || plan.cases.iter().map(|c| c.name.as_str());
    for case in cases {
        let name = case.get_ref();
        if !known().any(|k| k == name) {
            problems.add_with_help(case.span(), format!("unknown case `{name}`"), suggestion(name, known()));
        }
    }
    if cases.is_empty() {
        problems.add(file.scenario.span(), "cases is empty, expected at least one case, or no `cases` for all");
    }
    plan.runs.iter().filter(|run| cases.iter().any(|c| *c.get_ref() == run.case)).cloned().collect()
}

/// The parameters, tried at both ends of their ranges in every run.
fn parameters(file: &File, runs: &[Run], fmus: &Fmus, problems: &mut Collector) -> Vec<Parameter> {
    let mut parameters = Vec::new();
    for entry in &file.parameters {
        let Some((component, name)) = entry.name.get_ref().split_once(':') else { continue };
        for run in runs {
            for bound in [&entry.min, &entry.max] {
                if let Err(error) = run.clone().set_parameter(fmus, component, name, Value::Real(*bound.get_ref())) {
                    let (help, in_range) = parameter_help(run, fmus, component, name);
                    // A parameter that exists is wrong at its bound, any other by its name.
                    let span = if in_range { bound.span() } else { entry.name.span() };
                    problems.add_with_help(span, format!("case `{}`: {error}", run.case), help);
                }
            }
        }
        let of_component = runs.iter().flat_map(|run| &run.components).find(|u| u.name == component);
        let variable =
            of_component.and_then(|u| fmus.get(&u.fmu).ok()).and_then(|fmu| fmu.description().variable(name));
        parameters.push(Parameter {
            name: entry.name.get_ref().clone(),
            symbol: entry.symbol.as_ref().map(|s| s.get_ref().clone()),
            unit: variable.and_then(|v| v.unit.clone()),
            min: *entry.min.get_ref(),
            max: *entry.max.get_ref(),
            log: entry.log,
        });
    }
    parameters
}

/// A near name for a wrong one, and whether the parameter is there.
fn parameter_help(run: &Run, fmus: &Fmus, component: &str, name: &str) -> (Option<String>, bool) {
    let Some(found) = run.components.iter().find(|u| u.name == component) else {
        return (suggestion(component, run.components.iter().map(|u| u.name.as_str())), false);
    };
    let Ok(fmu) = fmus.get(&found.fmu) else { return (None, false) };
    let description = fmu.description();
    if description.variable(name).is_some() {
        return (None, true);
    }
    let parameters =
        description.variables.iter().filter(|v| v.causality == fmu_import::description::Causality::Parameter);
    (suggestion(name, parameters.map(|v| v.name.as_str())), false)
}

/// Finds recorded signals. What the scenario records does not depend on the cases that are chosen.
struct Columns<'a> {
    plan: &'a Plan,
    runs: &'a [Run],
}

impl Columns<'_> {
    /// The component that writes a column.
    fn writer(&self, index: usize) -> Option<&str> {
        self.plan.runs.iter().find_map(|run| {
            let slot = run.columns.get(index).copied().flatten()?;
            let writes = |u: &&fmu_system::run::Component| u.outputs.iter().any(|wire| wire.slot == slot);
            run.components.iter().find(writes).map(|u| u.name.as_str())
        })
    }

    /// Column of `component:signal`, or of `signal` where only one component has it; every run must have it.
    fn find(&self, written: &Spanned<String>, problems: &mut Collector) -> Option<usize> {
        let text = written.get_ref();
        let names = || self.plan.columns.iter().map(|c| c.name.as_str());
        // A column is named `signal` if only one component has it; then the component must be the one that writes it.
        let column = names().position(|name| name == text).or_else(|| {
            let (component, signal) = text.split_once(':')?;
            let index = names().position(|name| name == signal)?;
            (self.writer(index)? == component).then_some(index)
        });
        let Some(index) = column else {
            let signal = text.split_once(':').map_or(text.as_str(), |(_, signal)| signal);
            // Of the name as it is, the component is wrong.
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

fn terms(file: &File, judged: Option<&ahp::Weights>, columns: &Columns<'_>, problems: &mut Collector) -> Vec<Term> {
    let simulation = &columns.plan.simulation;
    let mut terms = Vec::new();
    for (index, entry) in file.objective.get_ref().terms.iter().enumerate() {
        if !entry.kind.get_ref().needs_only_values() {
            problems.add(
                entry.kind.span(),
                "a term has a kind without a threshold or times, and one that is always defined",
            );
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

fn comparisons(file: &File, plan: &Plan, runs: &[Run], fmus: &Fmus, problems: &mut Collector) -> Vec<Comparison> {
    let mut comparisons = Vec::new();
    for entry in &file.comparisons {
        let runs = match &entry.case {
            None => runs.to_vec(),
            Some(case) => plan.runs.iter().filter(|run| run.case == *case.get_ref()).cloned().collect(),
        };
        if let Some(case) = entry.case.as_ref().filter(|_| runs.is_empty()) {
            let help = suggestion(case.get_ref(), plan.cases.iter().map(|c| c.name.as_str()));
            problems.add_with_help(case.span(), format!("unknown case `{}`", case.get_ref()), help);
        }
        let mut values = Vec::new();
        for (key, value) in &entry.values {
            let is = |p: &ParameterEntry| p.name == *key || p.symbol.as_ref().is_some_and(|symbol| symbol == key);
            let Some(index) = file.parameters.iter().position(is) else {
                let names = file.parameters.iter().flat_map(|p| [Some(&p.name), p.symbol.as_ref()]).flatten();
                let help = suggestion(key.get_ref(), names.map(|n| n.get_ref().as_str()));
                problems.add_with_help(key.span(), format!("`{}` is no parameter of this study", key.get_ref()), help);
                continue;
            };
            if let Some((component, name)) = file.parameters[index].name.get_ref().split_once(':') {
                for run in &runs {
                    if let Err(error) = run.clone().set_parameter(fmus, component, name, Value::Real(*value.get_ref()))
                    {
                        problems.add(value.span(), error.to_string());
                    }
                }
            }
            values.push((index, *value.get_ref()));
        }
        comparisons.push(Comparison { title: entry.title.clone(), values, runs });
    }
    comparisons
}

fn positive(value: &Spanned<f64>, name: &str, problems: &mut Collector) -> f64 {
    let number = *value.get_ref();
    if !(number.is_finite() && number > 0.0) {
        problems.add(value.span(), format!("{name} is {number:?}, expected above 0"));
    }
    number
}

fn at_least_1(value: &Spanned<i64>, name: &str, problems: &mut Collector) -> u64 {
    match u64::try_from(*value.get_ref()) {
        Ok(number) if number > 0 => number,
        _ => {
            problems.add(value.span(), format!("{name} is {}, expected at least 1", value.get_ref()));
            1
        }
    }
}
