//! Study files: TOML, resolved against a scenario and its FMUs. Their reference is `studies/README.md`.
//!
//! All mistakes in a file are reported together, each with file, line, column and the marked place.

mod layout;
mod methods;
mod numbers;
mod objective;
mod parameters;

pub use self::methods::{Method, Search};
pub use fmu_system::study::StudyError;

use self::layout::File;
use self::numbers::{at_least_1, positive};
use self::objective::{Columns, terms, weights};
use self::parameters::{Comparison, check_parameters, comparisons, constraints, parameters};
use crate::ahp;
use crate::simulation::{Limit, Simulation};
use fmu_import::names::suggestion;
use fmu_import::worker::Settings as WorkerSettings;
use fmu_system::fmus::Fmus;
use fmu_system::plan::Plan;
use fmu_system::problem::Collector;
use fmu_system::resolve::{Descriptions, Options, ResolveError, resolve};
use fmu_system::run::Run;
use fmu_system::spanned::Spanned;
use fmu_system::study::text;
use fmu_system::worker::Pool;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

const PENALTY: f64 = 1e6;
/// Title of the scenario's own values, unless a `[[compare]]` names them.
const BASELINE: &str = "As in the scenario";

/// Settings and number of the processes that run the FMUs of a study.
pub type Workers = (WorkerSettings, NonZeroUsize);

/// A completely resolved study.
#[derive(Debug)]
pub struct Study {
    /// File stem of the study.
    pub name: String,
    pub(crate) title: String,
    pub(crate) description: String,
    pub(crate) reference: String,
    pub(crate) scenario: PathBuf,
    /// Evaluations per method.
    pub evaluations: u64,
    /// A method ends when it has reached this objective.
    pub(crate) target: Option<f64>,
    /// Methods in their order.
    pub methods: Vec<Method>,
    /// Title of the scenario's own values, with which results are always compared.
    pub(crate) baseline: String,
    pub(crate) comparisons: Vec<Comparison>,
    /// Weights from judgments, if there are any.
    pub judged: Option<ahp::Weights>,
    /// Constraints as written: name and inequality.
    pub(crate) constraints: Vec<(String, String)>,
    /// Computes objectives.
    pub simulation: Simulation,
}

/// Returns true if a file is a study, that is, if it has the key `scenario`. False if it cannot be read or is not TOML.
pub fn is_study(path: &Path) -> bool {
    table(path).is_some_and(|table| table.contains_key("scenario"))
}

/// Returns true if a study varies values in samples, so that `chassis_fmu.study` runs it. This is the case for all
/// studies except those with the method `optimize` and without `[[vary]]`. False if the file cannot be read.
pub fn has_samples(path: &Path) -> bool {
    table(path).is_some_and(|table| {
        table.contains_key("vary") || table.get("method").and_then(toml::Value::as_str) != Some("optimize")
    })
}

fn table(path: &Path) -> Option<toml::Table> {
    text(path).ok()?.parse().ok()
}

/// Returns the schema of studies, with `[[vary]]` or `[[parameter]]`.
pub fn schema() -> Schema {
    fmu_system::schema::of_file::<Any>()
}

/// A study of either kind.
struct Any;

impl JsonSchema for Any {
    fn schema_name() -> Cow<'static, str> {
        "Study".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let kinds = [generator.subschema_for::<fmu_system::study::Study>(), generator.subschema_for::<File>()];
        json_schema!({ "anyOf": kinds })
    }
}

/// Keys that every study has, including studies that `chassis_fmu.study` runs.
#[derive(Debug, Deserialize)]
struct Needs {
    /// Not used. It is required here so that a missing title is reported before FMUs are built.
    #[serde(rename = "title")]
    _title: String,
    scenario: String,
    #[serde(rename = "vary", default)]
    factors: Vec<Factor>,
}

/// A factor that varies the FMU of a component.
#[derive(Debug, Deserialize)]
struct Factor {
    fmu: Option<String>,
    #[serde(default)]
    values: Vec<toml::Value>,
}

/// Returns the path of a study's scenario, and the names of the FMUs that replace FMUs of the scenario.
///
/// # Errors
/// The file cannot be read or does not have the layout of a study.
pub fn needs(path: &Path) -> Result<(PathBuf, BTreeSet<String>), StudyError> {
    let text = text(path)?;
    let mut problems = Collector::new(path, &text, "toml");
    let Some(Needs { scenario, factors, .. }) = problems.parse(&text) else { return Err(problems.fail().into()) };
    let values = factors.iter().filter(|factor| factor.fmu.is_some()).flat_map(|factor| &factor.values);
    let fmus = values.filter_map(|value| value.as_str().map(str::to_owned)).collect();
    Ok((path.parent().unwrap_or(Path::new("")).join(scenario), fmus))
}

/// Reads a study and everything it needs.
///
/// # Errors
/// A file cannot be read, the study or its scenario has mistakes, an FMU cannot be opened.
pub fn read(path: &Path, source: &dyn Descriptions, (settings, jobs): Workers) -> Result<Study, StudyError> {
    let text = text(path)?;
    let mut problems = Collector::new(path, &text, "toml");
    let Some(file) = problems.parse::<File>(&text) else { return Err(problems.fail().into()) };
    // Checks that need no scenario.
    if file.method.get_ref() != "optimize" {
        problems.add(file.method.span(), format!("unknown method `{}`, expected optimize", file.method.get_ref()));
    }
    let symbols = check_parameters(&file, &mut problems);
    let judged = weights(&file, &mut problems);
    let methods = methods::methods(&file, &mut problems);
    let constraints = constraints(&file, &symbols, &mut problems);
    let penalty = file.penalty.as_ref().map_or(PENALTY, |p| positive(p, "penalty", &mut problems));
    let evaluations = at_least_1(&file.budget.evaluations, "evaluations", &mut problems);
    let seeds = file.seeds.as_ref().map(|s| at_least_1(s, "seeds", &mut problems));
    if let Some(target) = file.budget.target.as_ref().filter(|t| !t.is_finite()) {
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
    let pool = Pool::new(settings, jobs, &fmus);
    // A comparison with the scenario's own values only gives them a title, because they are always evaluated.
    let own = comparisons.iter().position(|c| c.values.is_empty() && c.runs == runs);
    let baseline = own.map_or(BASELINE.to_string(), |at| comparisons.remove(at).title);

    let needed: BTreeSet<usize> = terms.iter().map(|t| t.column).chain(limits.iter().map(|l| l.column)).collect();
    let slim = |mut runs: Vec<Run>| {
        runs.iter_mut().for_each(|run| run.keep_columns(&needed));
        runs
    };
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
        problems.add(
            file.scenario.span(),
            "`cases` is empty: list at least one case, or leave `cases` out to use all of them",
        );
    }
    plan.runs.iter().filter(|run| cases.iter().any(|c| *c.get_ref() == run.case)).cloned().collect()
}
