//! Turns a scenario file into a [`Plan`].
//!
//! An input gets its value, in this order, from an explicit connection, from the only other component
//! that has an output of the same name, or from a constant; an input without any is an error.
//! All mistakes of a file are reported together, each with file, line, column and the marked place.

mod conversion;
mod findings;
mod fmus;
mod pattern;
mod report;
mod unread;
mod values;
mod wiring;

pub use self::fmus::{Descriptions, FmuFolder, Found};
use self::pattern::{matches, split_pattern};
use crate::input_file::InputFile;
use crate::limits;
use crate::parameter_set::ParameterSet;
use crate::plan::{self, Conversion, Plan};
use crate::problem::{Collector, Context};
pub use crate::problem::{Problem, Problems};
use crate::run;
use crate::scenario::{self, Case, Component, Replacement, Scenario, unknown, whole_steps};
use fmu_import::description::{BaseType, Causality, Value, Variable};
use fmu_import::names::{similar, suggestion};
use miette::Diagnostic;
use serde_spanned::Spanned;
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What a call of the resolver changes about a scenario.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Stop here instead, s.
    pub stop: Option<f64>,
    /// Use this order instead.
    pub order: Option<run::Order>,
    /// Use the first so many seeds only.
    pub seeds: Option<usize>,
    /// CSV file with a column `time` and columns named `signal` or `component:signal`, which write these
    /// signals instead of the components; components that nothing needs any more are dropped.
    pub inputs: Option<PathBuf>,
}

/// Why a scenario has no plan.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum ResolveError {
    /// A file cannot be read.
    #[error("cannot read {}: {cause}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        cause: std::io::Error,
    },
    /// A file has mistakes.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Problems(#[from] Problems),
    /// The stop that the options give does not fit the scenario.
    #[error("--stop {stop}: {message}")]
    Stop {
        /// The stop, s.
        stop: f64,
        /// What does not fit.
        message: String,
    },
    /// Another option does not fit the scenario.
    #[error("{0}")]
    Option(String),
}

/// Reads a scenario file and resolves it.
///
/// # Errors
/// A file cannot be read, the scenario or the CSV file has mistakes, an option does not fit.
pub fn resolve(file: &Path, source: &dyn Descriptions, options: &Options) -> Result<Plan, ResolveError> {
    resolve_text(file, &read(file, limits::TEXT_FILE)?, source, options)
}

/// Names of the FMUs of a scenario, of all its components and cases, each once.
///
/// # Errors
/// The file cannot be read or does not have the layout of a scenario.
pub fn fmu_names(file: &Path) -> Result<BTreeSet<String>, ResolveError> {
    let text = read(file, limits::TEXT_FILE)?;
    let mut problems = Collector::new(file, &text, "toml");
    match scenario::parse(&text, &mut problems) {
        Some(scenario) => Ok(scenario.fmus().map(|(name, _)| name.to_string()).collect()),
        None => Err(problems.fail().into()),
    }
}

fn read(path: &Path, limit: u64) -> Result<String, ResolveError> {
    limits::read_text(path, limit).map_err(|cause| ResolveError::Read { path: path.to_path_buf(), cause })
}

/// Resolves the text of a scenario; `file` names it in messages and in the plan.
///
/// # Errors
/// As [`resolve`].
pub fn resolve_text(
    file: &Path,
    text: &str,
    source: &dyn Descriptions,
    options: &Options,
) -> Result<Plan, ResolveError> {
    let mut problems = Collector::new(file, text, "toml");
    let Some(scenario) = scenario::parse(text, &mut problems) else {
        return Err(problems.fail().into());
    };
    scenario.check(&mut problems);
    if !problems.is_empty() {
        return Err(problems.fail().into());
    }
    let simulation = simulation(&scenario, options)?;
    let inputs = match &options.inputs {
        None => None,
        Some(path) => {
            let text = read(path, limits::INPUT_FILE)?;
            let slack = 1e-9 * simulation.step;
            let series = InputFile::parse(path, &text, simulation.start, slack)?;
            Some((path, text, series))
        }
    };
    let mut resolver = Resolver {
        scenario: &scenario,
        problems,
        series: inputs.as_ref().map(|(_, _, series)| series),
        fed: BTreeSet::new(),
        misfits: Vec::new(),
        sets: HashMap::new(),
    };
    resolver.problems.expect_contexts(scenario.cases.len());
    resolver.read_parameter_sets(file.parent().unwrap_or(Path::new("")));
    let Some(mut systems) = resolver.systems(source) else {
        return Err(resolver.problems.fail().into());
    };
    for system in &mut systems {
        resolver.wire(system);
    }
    let columns = resolver.columns(&systems);
    resolver.check_size(&simulation, columns.len(), options)?;
    let metrics = resolver.metrics(&systems, &columns, text);
    let figures = resolver.figures(&systems, &columns, text);
    let findings = findings::findings(&scenario, text, &mut resolver.problems);
    let seeds: Vec<i32> = scenario.seeds.as_ref().map_or(Vec::new(), |seeds| {
        let wanted = options.seeds.unwrap_or(usize::MAX);
        let values = seeds.values.get_ref().iter();
        values.take(wanted).map(|s| *s.get_ref()).collect()
    });
    let runs = resolver.runs(&systems, &columns, &seeds);
    let wiring: Vec<plan::Wiring> = systems.iter().map(|system| resolver.wiring(system)).collect();
    let trials = if resolver.problems.is_empty() { resolver.unread(&systems, &wiring, &runs) } else { Vec::new() };
    let (fed, misfits) = (resolver.fed, resolver.misfits);
    let warnings = resolver.problems.take_warnings();
    resolver.problems.finish()?;
    if let Some((path, text, series)) = &inputs {
        let unused: Vec<String> =
            (0..series.signals.len()).filter(|i| !fed.contains(i)).map(|i| series.signals[i].name.clone()).collect();
        InputFile::report(path, text, &unused, &misfits, &input_names(&systems))?;
    }
    Ok(Plan {
        format: plan::FORMAT,
        name: file.file_stem().map_or(String::new(), |s| s.to_string_lossy().into_owned()),
        file: file.to_string_lossy().into_owned(),
        title: scenario.title.clone(),
        description: scenario.description.trim().to_string(),
        reference: scenario.reference.clone(),
        simulation,
        cases: scenario.cases.iter().map(plan_case).collect(),
        points: scenario.points.iter().map(plan_point).collect(),
        sweep: scenario
            .sweep
            .as_ref()
            .map(|sweep| plan::Sweep { title: sweep.get_ref().title.clone(), unit: sweep.get_ref().unit.clone() }),
        seeds,
        columns: columns.into_iter().map(|c| c.plan).collect(),
        runs,
        metrics,
        figures,
        findings,
        wiring,
        warnings,
        trials,
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
    plan::Point { name: point.name.get_ref().clone(), title: point.title.clone(), value: *point.value.get_ref() }
}

/// Times and order, with the options applied. The scenario has been checked.
fn simulation(scenario: &Scenario, options: &Options) -> Result<run::Simulation, ResolveError> {
    if options.seeds == Some(0) {
        return Err(ResolveError::Option("0 seeds asked for, expected at least 1".into()));
    }
    let start = scenario.start();
    let step = *scenario.simulation.step.get_ref();
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
        every: scenario.record.every.as_ref().map_or(1, |every| every.get_ref().unsigned_abs()),
    })
}

/// A component of a case with its FMU.
struct Member<'a> {
    component: &'a Component,
    found: Found,
    /// Set if the case names another FMU than the component.
    replaced: Option<Replaced>,
    /// Inputs in the order of the description, each with what writes it.
    inputs: Vec<(usize, Source)>,
    /// Nothing needs it since signals are fed from a file.
    dropped: bool,
}

impl Member<'_> {
    fn name(&self) -> &str {
        self.component.name.get_ref()
    }

    fn variable(&self, index: usize) -> &Variable {
        &self.found.description.variables[index]
    }

    /// Variables of a causality that can travel on the bus, by index.
    fn wirable(&self, causality: Causality) -> impl Iterator<Item = (usize, &Variable)> {
        self.all(causality).filter(|(_, v)| v.base_type != BaseType::String)
    }

    fn all(&self, causality: Causality) -> impl Iterator<Item = (usize, &Variable)> {
        self.found.description.variables.iter().enumerate().filter(move |(_, v)| v.causality == causality)
    }
}

/// What a case says about another FMU for a component.
struct Replaced {
    /// The component's own FMU, if it is there.
    original: Option<Found>,
    /// Whether the component's own parameters apply.
    keep_parameters: bool,
}

/// What writes an input.
#[derive(Clone)]
enum Source {
    /// An output: member and variable.
    Output(usize, usize),
    /// A column of the input file.
    Series(usize),
    /// A value.
    Constant(Value),
}

/// A case with its components.
struct System<'a> {
    case: &'a Case,
    members: Vec<Member<'a>>,
}

impl System<'_> {
    fn member(&self, component: &str) -> Option<usize> {
        self.members.iter().position(|m| m.name() == component)
    }
}

/// A recorded signal.
struct Column {
    component: String,
    variable: String,
    plan: plan::Column,
}

struct Resolver<'a> {
    scenario: &'a Scenario,
    problems: Collector,
    series: Option<&'a InputFile>,
    /// Columns of the input file that write an input in some case.
    fed: BTreeSet<usize>,
    /// Values of the input file that do not fit.
    misfits: Vec<String>,
    /// Parameter sets by path as written.
    sets: HashMap<String, ParameterSet>,
}

impl<'a> Resolver<'a> {
    /// The components of every case; `None` if an FMU is missing or unreadable.
    fn systems(&mut self, source: &dyn Descriptions) -> Option<Vec<System<'a>>> {
        let mut systems = Vec::new();
        let mut missing = Vec::new();
        for case in &self.scenario.cases {
            let mut members = Vec::new();
            for component in &self.scenario.components {
                let name = component.name.get_ref();
                if case.leaves_out(name) {
                    continue;
                }
                self.problems.set_context(Some(context(case, Some(component))));
                let other = replacement(case, component);
                let found = match other {
                    Some(other) => self.find(&other.get_ref().fmu, other.span(), source, &mut missing),
                    None => self.find(component.fmu.get_ref(), component.fmu.span(), source, &mut missing),
                };
                let Some(found) = found else { continue };
                let replaced = other.map(|other| {
                    let keep_parameters = other.get_ref().keep_parameters;
                    let original = if keep_parameters {
                        self.find(component.fmu.get_ref(), component.fmu.span(), source, &mut missing)
                    } else {
                        source.find(component.fmu.get_ref()).ok().flatten()
                    };
                    Replaced { original, keep_parameters }
                });
                members.push(Member { component, found, replaced, inputs: Vec::new(), dropped: false });
            }
            systems.push(System { case, members });
        }
        self.problems.set_context(None);
        self.report_missing_fmus(&missing, source);
        self.problems.is_empty().then_some(systems)
    }

    /// The FMU of that name, which stands at `span`; adds it to `missing` if it is not there.
    fn find<'s>(
        &mut self,
        name: &'s str,
        span: Range<usize>,
        source: &dyn Descriptions,
        missing: &mut Vec<(&'s str, Range<usize>)>,
    ) -> Option<Found> {
        match source.find(name) {
            Ok(Some(found)) if found.description.co_simulation.is_none() => {
                let message = format!("{} has no co-simulation interface", found.path);
                self.problems.add(span, message);
                None
            }
            Ok(Some(found)) => Some(found),
            Ok(None) => {
                if !missing.contains(&(name, span.clone())) {
                    missing.push((name, span));
                }
                None
            }
            Err(message) => {
                self.problems.add(span, message);
                None
            }
        }
    }

    /// Reports all FMUs that are not there as one mistake: most often none has been packed.
    fn report_missing_fmus(&mut self, missing: &[(&str, Range<usize>)], source: &dyn Descriptions) {
        let mut names: Vec<&str> = Vec::new();
        for (name, _) in missing {
            if !names.contains(name) {
                names.push(name);
            }
        }
        let message = match names[..] {
            [] => return,
            [name] => format!("there is no {name}.fmu in {}", source.place()),
            _ => format!("{} FMUs are not in {}: {}", names.len(), source.place(), names.join(", ")),
        };
        let (packed, buildable) = (source.names(), source.buildable());
        let (ours, unknown): (Vec<&str>, Vec<&str>) =
            names.iter().partition(|name| buildable.iter().any(|known| known == *name));
        let all = || packed.iter().chain(&buildable).map(String::as_str);
        let mut hints = Vec::new();
        let mut elsewhere = false;
        for name in &unknown {
            match suggestion(name, all()) {
                Some(hint) if names.len() == 1 => hints.push(hint),
                Some(hint) => hints.push(format!("`{name}`: {hint}")),
                None => elsewhere = true,
            }
        }
        if !ours.is_empty() {
            hints.push(format!("`cargo fmu pack --for {}` builds all that this scenario needs", self.problems.file()));
        }
        if elsewhere {
            hints.push("name the folder of FMUs that are not built in this workspace with --fmus".to_string());
        }
        // Names that may be wrong are marked; of those that are right, the first stands for all.
        let wrong = missing.iter().filter(|(name, _)| unknown.contains(name));
        let mut places: Vec<Range<usize>> = wrong.map(|(_, place)| place.clone()).collect();
        if places.is_empty() {
            places.extend(missing.first().map(|(_, place)| place.clone()));
        }
        self.problems.add_at(&places, message, Some(hints.join("\n")));
    }

    /// Refuses a run whose recording does not fit into memory.
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

    /// Splits `component:name` and checks the component; also returns where the name stands.
    fn component_and_name<'s>(&mut self, written: &'s Spanned<String>) -> Option<(&'s str, &'s str, Range<usize>)> {
        let text = written.get_ref().as_str();
        let Some((component, name)) = text.split_once(':') else {
            self.problems.add(written.span(), "expected \"component:variable\"");
            return None;
        };
        let components = self.scenario.components.iter().map(|u| u.name.get_ref().as_str());
        if !components.clone().any(|u| u == component) {
            unknown("component", component, written.span(), components, &mut self.problems);
            return None;
        }
        Some((component, name, written.span()))
    }

    fn is_recorded(&self, component: &str, signal: &str) -> bool {
        self.scenario.record.signals.iter().any(|pattern| {
            let (of, pattern) = split_pattern(pattern.get_ref());
            of.is_none_or(|of| of == component) && matches(pattern, signal)
        })
    }

    /// All recorded signals: components in the order of the scenario, variables in that of the FMU.
    fn columns(&mut self, systems: &[System<'_>]) -> Vec<Column> {
        for pattern in &self.scenario.record.signals {
            let (component, text) = split_pattern(pattern.get_ref());
            if component.is_some() && self.component_and_name(pattern).is_none() {
                continue;
            }
            self.check_pattern(systems, pattern, component, text);
        }
        let mut owners: HashMap<&str, usize> = HashMap::new();
        for (_, name) in outputs(systems, None) {
            *owners.entry(name).or_default() += 1;
        }
        let mut columns: Vec<Column> = Vec::new();
        // (component, variable) -> index; an FMU may have very many outputs.
        let mut indices: HashMap<(&str, &str), usize> = HashMap::new();
        for component in &self.scenario.components {
            for system in systems {
                let Some(m) = system.member(component.name.get_ref()) else {
                    continue;
                };
                let member = &system.members[m];
                self.problems.set_context(Some(context(system.case, Some(component))));
                for (_, variable) in member.wirable(Causality::Output) {
                    if !self.is_recorded(member.name(), &variable.name) {
                        continue;
                    }
                    let shared = owners.get(variable.name.as_str()).is_some_and(|count| *count > 1);
                    let index = *indices.entry((member.name(), variable.name.as_str())).or_insert(columns.len());
                    let Some(known) = columns.get_mut(index) else {
                        columns.push(column(member, variable, shared));
                        continue;
                    };
                    // As with wires: an FMU that declares no units takes those of the one in its place.
                    match (&known.plan.unit, &variable.unit) {
                        (None, Some(_)) => *known = column(member, variable, shared),
                        (Some(other), Some(unit)) if other != unit => self.problems.add(
                            system.case.name.span(),
                            format!(
                                "`{}` of `{}` is in {unit} in this case, in {other} in another",
                                variable.name,
                                member.name(),
                            ),
                        ),
                        _ => {}
                    }
                }
            }
        }
        self.problems.set_context(None);
        columns
    }

    /// Reports a pattern of recorded signals that matches nothing, in any case or with the other FMU of a case.
    fn check_pattern(
        &mut self,
        systems: &[System<'_>],
        pattern: &Spanned<String>,
        component: Option<&str>,
        text: &str,
    ) {
        let all = outputs(systems, component);
        let matches_any = |outputs: &BTreeSet<(&str, &str)>| outputs.iter().any(|(_, name)| matches(text, name));
        let message = format!("no output matches `{}`", pattern.get_ref());
        let is_known = matches_any(&all);
        for system in systems {
            let member = component.and_then(|component| system.member(component)).map(|m| &system.members[m]);
            self.problems.set_context(Some(context(system.case, member.map(|m| m.component))));
            if !is_known && (component.is_none() || member.is_some()) {
                self.problems.add_with_help(
                    pattern.span(),
                    message.clone(),
                    Some(near_outputs(systems, component, text)),
                );
            } else if member.is_some_and(|m| m.replaced.is_some())
                && !matches_any(&outputs(std::slice::from_ref(system), component))
            {
                self.problems.warn(pattern.span(), message.clone(), None);
            }
        }
        self.problems.set_context(None);
        if !is_known && all.is_empty() {
            self.problems.add(pattern.span(), message);
        }
    }

    fn runs(&mut self, systems: &[System<'_>], columns: &[Column], seeds: &[i32]) -> Vec<run::Run> {
        let seed_of = self.scenario.seeds.as_ref().and_then(|s| self.component_and_name(&s.parameter));
        let points: Vec<Option<&scenario::Point>> =
            if self.scenario.points.is_empty() { vec![None] } else { self.scenario.points.iter().map(Some).collect() };
        let seeds: Vec<Option<i32>> =
            if seeds.is_empty() { vec![None] } else { seeds.iter().copied().map(Some).collect() };
        let mut runs = Vec::new();
        for system in systems {
            if let Some((component, ..)) = &seed_of
                && system.member(component).is_none()
            {
                self.problems.add(
                    system.case.name.span(),
                    format!("this case leaves out the component `{component}`, which takes the seeds"),
                );
                continue;
            }
            let wired = self.wired(system, columns);
            for point in &points {
                for seed in &seeds {
                    let mut run = wired.clone();
                    if let Some(point) = point {
                        run.id = format!("{}@{}", run.id, point.name.get_ref());
                        run.point = Some(point.name.get_ref().clone());
                    }
                    if let Some(seed) = seed {
                        run.id = format!("{}#{seed}", run.id);
                        run.seed = Some(*seed);
                    }
                    let members = system.members.iter().filter(|m| !m.dropped);
                    for (component, member) in run.components.iter_mut().zip(members) {
                        let seed = match (&seed_of, seed) {
                            (Some((of, name, span)), Some(seed)) if *of == member.name() => {
                                Some((*name, span.clone(), *seed))
                            }
                            _ => None,
                        };
                        self.problems.set_context(Some(context(system.case, Some(member.component))));
                        component.parameters = self.parameters(system.case, *point, member, seed);
                    }
                    runs.push(run);
                }
            }
        }
        self.problems.set_context(None);
        runs
    }
}

/// The FMU that a case names instead of the component's own.
fn replacement<'c>(case: &'c Case, component: &Component) -> Option<&'c Spanned<Replacement>> {
    let other = case.fmu.get(component.name.get_ref().as_str())?;
    (other.get_ref().fmu != *component.fmu.get_ref()).then_some(other)
}

/// What messages call a case, with the FMU that it names for a component.
fn context(case: &Case, component: Option<&Component>) -> Context {
    let name = case.name.get_ref();
    match component.and_then(|component| Some((component.name.get_ref(), replacement(case, component)?))) {
        Some((component, other)) => Context {
            label: format!("case `{name}` (fmu.{component} = \"{}\")", other.get_ref().fmu),
            is_special: true,
        },
        None => Context { label: format!("case `{name}`"), is_special: false },
    }
}

fn column(member: &Member<'_>, variable: &Variable, shared: bool) -> Column {
    let units: Vec<Conversion> = member
        .found
        .description
        .display_units(variable)
        .into_iter()
        .map(|u| Conversion { name: u.name, factor: u.factor, offset: u.offset })
        .collect();
    let shown = variable.display_unit.as_ref().and_then(|name| units.iter().find(|u| u.name == *name));
    Column {
        component: member.name().to_string(),
        variable: variable.name.clone(),
        plan: plan::Column {
            name: if shared { format!("{}:{}", member.name(), variable.name) } else { variable.name.clone() },
            unit: variable.unit.clone(),
            display_unit: shown.map(|u| u.name.clone()),
            factor: shown.map_or(1.0, |u| u.factor),
            offset: shown.map_or(0.0, |u| u.offset),
            description: variable.description.clone().unwrap_or_default(),
            units,
        },
    }
}

/// (component, output) of all cases, each once, of one component or of all.
fn outputs<'s>(systems: &'s [System<'_>], component: Option<&str>) -> BTreeSet<(&'s str, &'s str)> {
    systems
        .iter()
        .flat_map(|system| &system.members)
        .filter(|member| component.is_none_or(|component| component == member.name()))
        .flat_map(|member| member.wirable(Causality::Output).map(|(_, v)| (member.name(), v.name.as_str())))
        .collect()
}

/// A hint for a name that is not an output of a component, or of any: near names, or else what there is.
fn near_outputs(systems: &[System<'_>], component: Option<&str>, name: &str) -> String {
    const SHOWN: usize = 6;
    if let Some((other, _)) = outputs(systems, None).into_iter().find(|(_, output)| *output == name) {
        return format!("did you mean `{other}:{name}`?");
    }
    let names: BTreeSet<&str> = outputs(systems, component).into_iter().map(|(_, output)| output).collect();
    similar(name, names.iter().copied()).unwrap_or_else(|| {
        let of = component.map_or("all components".to_string(), |component| format!("`{component}`"));
        let mut list: Vec<String> = names.iter().take(SHOWN).map(|name| format!("`{name}`")).collect();
        match names.len().saturating_sub(SHOWN) {
            _ if names.is_empty() => list.push("none".to_string()),
            0 => (),
            more => list.push(format!("{more} more (`cargo fmu inspect FMU` lists those of an FMU)")),
        }
        format!("the outputs of {of}: {}", list.join(", "))
    })
}

/// Names of all inputs and of the outputs they may be fed in place of.
fn input_names(systems: &[System<'_>]) -> Vec<String> {
    let mut names = BTreeSet::new();
    for member in systems.iter().flat_map(|system| &system.members) {
        for causality in [Causality::Input, Causality::Output] {
            for (_, v) in member.wirable(causality) {
                names.insert(v.name.clone());
                names.insert(format!("{}:{}", member.name(), v.name));
            }
        }
    }
    names.into_iter().collect()
}
