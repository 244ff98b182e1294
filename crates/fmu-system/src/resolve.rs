//! Turns a scenario file into a [`Plan`].
//!
//! An input gets its value from the first of these sources that exists: an explicit connection, the only other
//! component that has an output of the same name, or a constant. An input without a source is an error. All mistakes in
//! a file are reported together, each with file, line, column and the marked place.

mod clocks;
mod columns;
mod components;
mod conversion;
mod coupling;
mod findings;
mod fmus;
mod inputs;
mod order;
mod pattern;
mod report;
mod runs;
mod series;
mod start;
mod system;
mod unread;
mod values;
mod wiring;

use self::fmus::WithFolders;
pub use self::fmus::{Descriptions, FmuFolder, Found, fmus_with};
pub use self::inputs::AfterEnd;
use self::inputs::Inputs;
use self::system::{Resolver, signal_names};
use crate::data::DataError;
use crate::import::{self, Choice};
use crate::plan::{self, Plan};
use crate::problem::Collector;
pub use crate::problem::{Problem, Problems};
use crate::run;
use crate::scenario::{self, Case, Scenario, whole_steps};
use crate::spanned::Spanned;
use fmu_import::description::Causality;
use fmu_import::limits;
use miette::Diagnostic;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

/// Options of the resolver, which override the scenario.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Stop time, s.
    pub stop: Option<f64>,
    /// Order of the components.
    pub order: Option<run::Order>,
    /// Number of seeds to use, starting with the first.
    pub seeds: Option<usize>,
    /// CSV file with a column `time` and columns named `signal` or `component:signal`. Their values replace those that
    /// components would write; components that are no longer needed are dropped.
    pub inputs: Option<PathBuf>,
    /// Value of a signal from that file after its last sample.
    pub after_end: AfterEnd,
    /// FMUs that replace those of components, in all cases.
    pub fmus: Vec<OtherFmu>,
    /// Communication step, s.
    pub step: Option<f64>,
    /// Name of the structure in an SSP file, without `.ssd`.
    pub variant: Option<String>,
}

impl Options {
    fn choice(&self) -> Choice {
        Choice { variant: self.variant.clone(), stop: self.stop, step: self.step }
    }
}

/// Another FMU for a component.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OtherFmu {
    /// Name of the component.
    pub component: String,
    /// Name of the FMU.
    pub fmu: String,
    /// True if the FMU gets the component's parameters, as far as it has them.
    pub keep_parameters: bool,
}

/// Error while resolving a scenario.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum ResolveError {
    /// A file cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Cause.
        cause: std::io::Error,
    },
    /// A file has mistakes.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Problems(#[from] Problems),
    /// A data file has mistakes.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Data(#[from] DataError),
    /// The stop time in the options does not fit the scenario.
    #[error("--stop {stop}: {message}")]
    Stop {
        /// The stop, s.
        stop: f64,
        /// Reason.
        message: String,
    },
    /// Another option does not fit the scenario.
    #[error("{0}")]
    Option(String),
}

impl ResolveError {
    /// The mistakes, each as `file:line:column: message; hint`.
    pub fn lines(&self) -> Vec<String> {
        match self {
            Self::Problems(problems) => problems.lines(),
            other => vec![other.to_string()],
        }
    }
}

/// Reads a scenario file, or the system in an SSP file, and resolves it.
///
/// # Errors
/// A file cannot be read, the scenario or the CSV file has mistakes, an option does not fit.
pub fn resolve(file: &Path, source: &dyn Descriptions, options: &Options) -> Result<Plan, ResolveError> {
    resolve_text(file, &read(file)?, source, options)
}

/// Names of the FMUs in a scenario (components and cases), each once.
///
/// # Errors
/// The file cannot be read or does not have the layout of a scenario.
pub fn fmu_names(file: &Path) -> Result<BTreeSet<String>, ResolveError> {
    let text = read(file)?;
    let mut problems = collector(file, &text);
    match scenario::parse(&text, folder(file), &Choice::default(), &mut problems) {
        Some(scenario) => Ok(scenario.fmus().map(|(name, _)| name.to_string()).collect()),
        None => Err(problems.fail().into()),
    }
}

fn replace(scenario: &mut Scenario, other: &OtherFmu) -> Result<(), ResolveError> {
    let OtherFmu { component, fmu, keep_parameters } = other;
    let Some(own) = scenario.components.iter().find(|own| own.name.get_ref() == component) else {
        return Err(ResolveError::Option(format!("the scenario has no component `{component}`")));
    };
    for case in scenario.cases.iter_mut().filter(|case| !case.leaves_out(component)) {
        let replacement = scenario::Replacement { fmu: fmu.clone(), keep_parameters: *keep_parameters };
        case.fmu.insert(own.name.clone(), Spanned::new(own.fmu.span(), replacement));
    }
    Ok(())
}

/// Returns the absolute path of a file whose path is the value of a String in a scenario, if the file exists. Relative
/// paths start at the folder of the scenario. Any other String, such as the name of a file within the FMU, stays as it
/// is.
pub fn file_of(scenario: &Path, text: &str) -> Option<String> {
    file_in(folder(scenario), text)
}

fn file_in(folder: &Path, text: &str) -> Option<String> {
    let path = folder.join(text);
    let path = std::path::absolute(&path).ok().filter(|_| !text.is_empty() && path.is_file())?;
    Some(path.to_string_lossy().into_owned())
}

/// The folder that paths in a file are relative to.
fn folder(file: &Path) -> &Path {
    file.parent().unwrap_or(Path::new(""))
}

/// The scenario of an SSP file only includes it and is not shown.
fn collector(file: &Path, text: &str) -> Collector {
    Collector::new(file, if import::is_ssp(file) { "" } else { text }, "toml")
}

pub(crate) fn read(path: &Path) -> Result<String, ResolveError> {
    if import::is_ssp(path) {
        return Ok(import::scenario(path));
    }
    limits::read_text(path, limits::TEXT_FILE).map_err(|cause| ResolveError::Read { path: path.to_path_buf(), cause })
}

/// Resolves the text of a scenario; `file` names it in messages and in the plan.
pub fn resolve_text(
    file: &Path,
    text: &str,
    source: &dyn Descriptions,
    options: &Options,
) -> Result<Plan, ResolveError> {
    let mut problems = collector(file, text);
    let Some(mut scenario) = scenario::parse(text, folder(file), &options.choice(), &mut problems) else {
        return Err(problems.fail().into());
    };
    let source = &WithFolders { folders: FmuFolder::new(scenario.fmus.iter().map(|fmus| fmus.path())), others: source };
    for other in &options.fmus {
        replace(&mut scenario, other)?;
    }
    scenario.check(&mut problems);
    if !problems.is_empty() {
        return Err(problems.fail().into());
    }
    let simulation = simulation(&scenario, options)?;
    let inputs = options.inputs.as_ref().map(|path| Inputs::read(path, simulation, options.after_end));
    let mut resolver = Resolver {
        scenario: &scenario,
        problems,
        inputs: inputs.transpose()?,
        record: scenario.record.signals.clone(),
        of_inputs: Vec::new(),
        folder: folder(file),
        sets: HashMap::new(),
    };
    resolver.problems.expect_contexts(scenario.cases.len());
    resolver.read_parameter_sets();
    let Some(mut systems) = resolver.systems(source) else {
        return Err(resolver.problems.fail().into());
    };
    resolver.record_arrays(&systems);
    resolver.find_patterns_of_inputs(&systems);
    for system in &mut systems {
        resolver.wire(system, source);
        resolver.set_order(system, simulation.order, options.order.or(scenario.simulation.order).is_some());
    }
    let columns = resolver.columns(&systems);
    resolver.check_size(&simulation, columns.len(), options)?;
    let metrics = resolver.metrics(&systems, &columns);
    let figures = resolver.figures(&systems, &columns);
    let findings = findings::findings(&scenario, &mut resolver.problems);
    let seeds: Vec<i32> = scenario.seeds.as_ref().map_or(Vec::new(), |seeds| {
        let wanted = options.seeds.unwrap_or(usize::MAX);
        let values = seeds.values.iter();
        values.take(wanted).map(|s| *s.get_ref()).collect()
    });
    let runs = resolver.runs(&systems, &columns, &seeds, &simulation);
    let wiring: Vec<plan::Wiring> = systems.iter().map(|system| resolver.wiring(system, simulation.order)).collect();
    let trials = if resolver.problems.is_empty() { resolver.unread(&systems, &wiring, &runs) } else { Vec::new() };
    let mut warnings = resolver.problems.take_warnings();
    resolver.problems.finish()?;
    if let Some(inputs) = resolver.inputs {
        let components: Vec<&str> = scenario.components.iter().map(|own| own.name.as_str()).collect();
        let [takes, has] = [Causality::Input, Causality::Output].map(|causality| signal_names(&systems, causality));
        warnings.extend(inputs.finish(&takes, &has, &components)?);
    }
    let mut columns: Vec<plan::Column> = columns.into_iter().map(|column| column.plan).collect();
    for (index, column) in columns.iter_mut().enumerate() {
        let is_from_file =
            |run: &run::Run| run.columns[index].is_some_and(|slot| run.series.iter().any(|series| series.slot == slot));
        column.from_file = runs.iter().any(is_from_file);
    }
    Ok(Plan {
        format: plan::FORMAT,
        name: file.file_stem().map_or(String::new(), |s| s.to_string_lossy().into_owned()),
        file: file.to_string_lossy().into_owned(),
        title: scenario.title.clone(),
        description: scenario.description.trim().to_string(),
        reference: scenario.reference.clone(),
        is_cut: simulation.stop < *scenario.simulation.stop.get_ref(),
        simulation,
        cases: scenario.cases.iter().map(plan_case).collect(),
        points: scenario.points.iter().map(plan_point).collect(),
        sweep: scenario.sweep.as_ref().map(|sweep| plan_sweep(sweep.get_ref())),
        seeds,
        columns,
        runs,
        metrics,
        figures,
        findings,
        wiring,
        warnings,
        trials,
        folders: scenario.fmus,
    })
}

fn plan_case(case: &Case) -> plan::Case {
    plan::Case {
        name: case.name.get_ref().clone(),
        title: case.title.clone(),
        baseline: case.baseline.as_ref().map(|b| b.get_ref().clone()),
    }
}

fn plan_point(point: &scenario::Point) -> plan::Point {
    plan::Point {
        name: point.name.get_ref().clone(),
        title: point.title.clone(),
        value: *point.value.get_ref(),
        second: point.second.as_ref().map(|second| *second.get_ref()),
    }
}

fn plan_sweep(sweep: &scenario::Sweep) -> plan::Sweep {
    let second = sweep.second.as_ref().map(|second| {
        let second = second.get_ref();
        plan::SecondSweep { title: second.title.clone(), unit: second.unit.clone() }
    });
    plan::Sweep { title: sweep.title.clone(), unit: sweep.unit.clone(), second }
}

/// Times and order, with the options applied. The scenario has been checked.
fn simulation(scenario: &Scenario, options: &Options) -> Result<run::Simulation, ResolveError> {
    if options.seeds == Some(0) {
        return Err(ResolveError::Option("the number of seeds must be at least 1, got 0".into()));
    }
    let start = scenario.start();
    let step = options.step.unwrap_or(*scenario.simulation.step.get_ref());
    let stop = options.stop.unwrap_or(*scenario.simulation.stop.get_ref());
    let steps = whole_steps(start, stop, step).map_err(|message| match options.stop {
        Some(stop) if stop <= start => {
            ResolveError::Stop { stop, message: format!("the stop must be later than the start, {start} s") }
        }
        Some(stop) => ResolveError::Stop { stop, message },
        None => ResolveError::Option(message),
    })?;
    Ok(run::Simulation {
        start,
        stop,
        step,
        steps,
        order: options.order.or(scenario.simulation.order).unwrap_or(run::Order::Sequential),
        // Checked to be at least 1.
        every: scenario.record.every.as_ref().map_or(1, |every| every.unsigned_abs()),
        extrapolation: scenario.simulation.extrapolation.as_ref().map_or_else(Default::default, |key| *key.get_ref()),
        step_argument: scenario.simulation.step_argument.unwrap_or_default(),
        iterate: scenario.simulation.iterate.as_ref().map(|key| *key.get_ref()),
        error_control: scenario.simulation.error_control.as_ref().map(|key| *key.get_ref()),
    })
}

impl Resolver<'_> {
    /// Rejects a run whose recording does not fit into memory.
    fn check_size(
        &mut self,
        simulation: &run::Simulation,
        columns: usize,
        options: &Options,
    ) -> Result<(), ResolveError> {
        let rows = simulation.steps / simulation.every + 1;
        let values = rows.saturating_mul(columns as u64 + 1);
        if values > limits::RECORDED {
            let limit = limits::RECORDED;
            let message = format!(
                "{rows} rows of {columns} signals and the time are {values} numbers per run, the limit is {limit}"
            );
            let help = "record every n-th step only (`every` in [record]) or fewer signals";
            if let Some(stop) = options.stop {
                return Err(ResolveError::Stop { stop, message: format!("{message}; {help}") });
            }
            let scenario::Simulation { stop, step, .. } = &self.scenario.simulation;
            let step = self.scenario.record.every.as_ref().map_or(step.span(), Spanned::span);
            self.problems.add_at(&[stop.span(), step], message, Some(help.to_string()));
        }
        Ok(())
    }
}
