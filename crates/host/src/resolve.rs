//! Turns a scenario file into a [`Plan`].
//!
//! An input gets its value, in this order, from an explicit connection, from the only other unit
//! that has an output of the same name, or from a constant; an input without any is an error.
//! All mistakes of a file are reported together, each with file, line, column and the marked place.

use crate::archive::read_description;
use crate::description::{BaseType, Causality, ModelDescription, Value, Variable};
use crate::feeds::Feeds;
use crate::parameter_set::ParameterSet;
use crate::plan::{self, Conversion, Plan, Setting, Wire};
use crate::problem::{Collector, suggestion};
pub use crate::problem::{Problem, Problems};
use crate::scenario::{self, Case, Scenario, Unit, Values, unknown, whole_steps};
use miette::Diagnostic;
use serde_spanned::Spanned;
use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a call of the resolver changes about a scenario.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// Stop here instead, s.
    pub stop: Option<f64>,
    /// Use this order instead.
    pub order: Option<plan::Order>,
    /// Use the first so many seeds only.
    pub seeds: Option<usize>,
    /// CSV file with a column `time` and columns named `signal` or `unit:signal`, which write these
    /// signals instead of the units; units that nothing needs any more are dropped.
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
    /// An option does not fit the scenario.
    #[error("{0}")]
    Option(String),
}

/// An FMU that was found.
#[derive(Debug, Clone)]
pub struct Found {
    /// Path of the file, as it shall stand in the plan.
    pub path: String,
    /// Its description.
    pub description: Arc<ModelDescription>,
}

/// Where the resolver looks FMUs up.
pub trait Descriptions {
    /// The FMU of that file stem; `None` if there is none.
    ///
    /// # Errors
    /// It is there but cannot be read; the text says why.
    fn find(&self, name: &str) -> Result<Option<Found>, String>;

    /// File stems of all FMUs.
    fn names(&self) -> Vec<String>;

    /// Where was looked, for messages.
    fn place(&self) -> String;
}

/// FMUs in folders; the first folder that has a file wins.
#[derive(Debug)]
pub struct FmuFolder {
    folders: Vec<PathBuf>,
    read: RefCell<HashMap<String, Found>>,
}

impl FmuFolder {
    /// Looks into these folders. They are read when something is looked up.
    #[must_use]
    pub fn new<P: Into<PathBuf>>(folders: impl IntoIterator<Item = P>) -> Self {
        Self { folders: folders.into_iter().map(Into::into).collect(), read: RefCell::default() }
    }
}

impl Descriptions for FmuFolder {
    fn find(&self, name: &str) -> Result<Option<Found>, String> {
        if let Some(found) = self.read.borrow().get(name) {
            return Ok(Some(found.clone()));
        }
        let file = format!("{name}.fmu");
        let Some(path) = self.folders.iter().map(|folder| folder.join(&file)).find(|path| path.exists()) else {
            return Ok(None);
        };
        let description = read_description(&path).map_err(|error| error.to_string())?;
        let found = Found { path: path.to_string_lossy().into_owned(), description: Arc::new(description) };
        self.read.borrow_mut().insert(name.to_string(), found.clone());
        Ok(Some(found))
    }

    fn names(&self) -> Vec<String> {
        let entries = self.folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
        let mut names: Vec<String> = entries
            .filter_map(|entry| {
                let path = entry.ok()?.path();
                let stem = path.file_stem()?.to_str()?.to_string();
                (path.extension()? == "fmu").then_some(stem)
            })
            .collect();
        names.sort();
        names
    }

    fn place(&self) -> String {
        let folders: Vec<_> = self.folders.iter().map(|f| f.to_string_lossy().into_owned()).collect();
        folders.join(", ")
    }
}

/// Descriptions in memory, without files behind them.
impl Descriptions for BTreeMap<String, Arc<ModelDescription>> {
    fn find(&self, name: &str) -> Result<Option<Found>, String> {
        Ok(self
            .get(name)
            .map(|description| Found { path: format!("{name}.fmu"), description: Arc::clone(description) }))
    }

    fn names(&self) -> Vec<String> {
        self.keys().cloned().collect()
    }

    fn place(&self) -> String {
        "memory".to_string()
    }
}

/// Reads a scenario file and resolves it.
///
/// # Errors
/// A file cannot be read, the scenario or the CSV file has mistakes, an option does not fit.
pub fn resolve(file: &Path, source: &dyn Descriptions, options: &Options) -> Result<Plan, ResolveError> {
    resolve_text(file, &read(file)?, source, options)
}

fn read(path: &Path) -> Result<String, ResolveError> {
    std::fs::read_to_string(path).map_err(|cause| ResolveError::Read { path: path.to_path_buf(), cause })
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
            let text = read(path)?;
            let slack = 1e-9 * simulation.step;
            let feeds = Feeds::parse(path, &text, simulation.start, slack)?;
            Some((path, text, feeds))
        }
    };
    let mut resolver = Resolver {
        scenario: &scenario,
        problems,
        feeds: inputs.as_ref().map(|(_, _, feeds)| feeds),
        fed: BTreeSet::new(),
        misfits: Vec::new(),
        sets: HashMap::new(),
    };
    resolver.read_parameter_sets(file.parent().unwrap_or(Path::new("")));
    let Some(mut systems) = resolver.systems(source) else {
        return Err(resolver.problems.fail().into());
    };
    for system in &mut systems {
        resolver.wire(system);
    }
    let columns = resolver.columns(&systems);
    let metrics = resolver.metrics(&systems, &columns);
    let figures = resolver.figures(&systems, &columns);
    let seeds: Vec<i32> = scenario.seeds.as_ref().map_or(Vec::new(), |seeds| {
        let wanted = options.seeds.unwrap_or(usize::MAX);
        let values = seeds.values.get_ref().iter();
        values.take(wanted).map(|s| *s.get_ref()).collect()
    });
    let runs = resolver.runs(&systems, &columns, &seeds);
    let (fed, misfits) = (resolver.fed, resolver.misfits);
    resolver.problems.finish()?;
    if let Some((path, text, feeds)) = &inputs {
        let unused: Vec<String> =
            (0..feeds.signals.len()).filter(|i| !fed.contains(i)).map(|i| feeds.signals[i].name.clone()).collect();
        Feeds::report(path, text, &unused, &misfits, &input_names(&systems))?;
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
        findings: scenario
            .findings
            .iter()
            .map(|f| plan::Finding { status: f.status, claim: f.claim.clone(), explanation: f.explanation.clone() })
            .collect(),
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
fn simulation(scenario: &Scenario, options: &Options) -> Result<plan::Simulation, ResolveError> {
    if options.seeds == Some(0) {
        return Err(ResolveError::Option("0 seeds asked for, expected at least 1".into()));
    }
    let start = scenario.start();
    let step = *scenario.simulation.step.get_ref();
    let stop = options.stop.unwrap_or(*scenario.simulation.stop.get_ref());
    let steps = whole_steps(start, stop, step).ok_or_else(|| {
        ResolveError::Option(format!("stop {stop} s is not a whole number of steps of {step} s after start {start} s"))
    })?;
    Ok(plan::Simulation {
        start,
        stop,
        step,
        steps,
        order: options.order.or(scenario.simulation.order).unwrap_or(plan::Order::Sequential),
        // Checked to be at least 1.
        every: scenario.record.every.as_ref().map_or(1, |every| every.get_ref().unsigned_abs()),
    })
}

/// A unit of a case with its FMU.
struct Member<'a> {
    unit: &'a Unit,
    found: Found,
    /// Inputs in the order of the description, each with what writes it.
    inputs: Vec<(usize, Source)>,
    /// Nothing needs it since signals are fed from a file.
    dropped: bool,
}

impl Member<'_> {
    fn name(&self) -> &str {
        self.unit.name.get_ref()
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

/// What writes an input.
#[derive(Clone)]
enum Source {
    /// An output: member and variable.
    Output(usize, usize),
    /// A column of the input file.
    Feed(usize),
    /// A value.
    Constant(Value),
}

/// A case with its units.
struct System<'a> {
    case: &'a Case,
    members: Vec<Member<'a>>,
}

impl System<'_> {
    fn member(&self, unit: &str) -> Option<usize> {
        self.members.iter().position(|m| m.name() == unit)
    }
}

/// A recorded signal.
struct Column {
    unit: String,
    variable: String,
    plan: plan::Column,
}

struct Resolver<'a> {
    scenario: &'a Scenario,
    problems: Collector,
    feeds: Option<&'a Feeds>,
    /// Columns of the input file that write an input in some case.
    fed: BTreeSet<usize>,
    /// Values of the input file that do not fit.
    misfits: Vec<String>,
    /// Parameter sets by path as written.
    sets: HashMap<String, ParameterSet>,
}

/// Unit and parameter of a name in a parameter set for several units: `unit.parameter` as SSP writes it (names of units
/// have no dot), or `unit:parameter` as in the rest of a scenario.
fn split_unit(name: &str) -> Option<(&str, &str)> {
    name.split_once([':', '.'])
}

impl<'a> Resolver<'a> {
    /// Reads the parameter sets that the scenario names, relative to its folder, each once.
    fn read_parameter_sets(&mut self, folder: &Path) {
        let scenario = self.scenario;
        let of_units = scenario.units.iter().filter_map(|u| u.parameter_set.as_ref());
        let of_cases = scenario.cases.iter().filter_map(|c| c.parameter_set.as_ref());
        for path in of_units.chain(of_cases).chain(&scenario.parameter_set) {
            match ParameterSet::read(&folder.join(path.get_ref())) {
                Ok(set) => {
                    self.sets.insert(path.get_ref().clone(), set);
                }
                Err(error) => self.problems.add(path.span(), error.to_string()),
            }
        }
        for path in scenario.cases.iter().filter_map(|c| c.parameter_set.as_ref()).chain(&scenario.parameter_set) {
            let Some(set) = self.sets.get(path.get_ref()) else { continue };
            for parameter in &set.parameters {
                let of = split_unit(&parameter.name).map(|(unit, _)| unit);
                let names = || scenario.units.iter().map(|u| u.name.get_ref().as_str());
                match of {
                    None => self.problems.add(
                        path.span(),
                        format!("{}: `{}`, expected \"unit.parameter\"", path.get_ref(), parameter.name),
                    ),
                    Some(unit) if !names().any(|name| name == unit) => self.problems.add_with_help(
                        path.span(),
                        format!("{}: `{}`: unknown unit `{unit}`", path.get_ref(), parameter.name),
                        suggestion(unit, names()),
                    ),
                    Some(_) => (),
                }
            }
        }
    }

    /// The units of every case; `None` if an FMU is missing or unreadable.
    fn systems(&mut self, source: &dyn Descriptions) -> Option<Vec<System<'a>>> {
        let mut systems = Vec::new();
        for case in &self.scenario.cases {
            let mut members = Vec::new();
            for unit in &self.scenario.units {
                let name = unit.name.get_ref();
                if case.leaves_out(name) {
                    continue;
                }
                let fmu = case.fmu.get(name.as_str()).unwrap_or(&unit.fmu);
                if let Some(found) = self.find(fmu, source) {
                    members.push(Member { unit, found, inputs: Vec::new(), dropped: false });
                }
            }
            systems.push(System { case, members });
        }
        self.problems.is_empty().then_some(systems)
    }

    fn find(&mut self, fmu: &Spanned<String>, source: &dyn Descriptions) -> Option<Found> {
        let name = fmu.get_ref();
        match source.find(name) {
            Ok(Some(found)) if found.description.co_simulation.is_none() => {
                let message = format!("{} has no co-simulation interface", found.path);
                self.problems.add(fmu.span(), message);
                None
            }
            Ok(Some(found)) => Some(found),
            Ok(None) => {
                let names = source.names();
                let help = suggestion(name, names.iter().map(String::as_str))
                    .map_or(String::new(), |s| format!("{s} Otherwise "));
                self.problems.add_with_help(
                    fmu.span(),
                    format!("there is no {name}.fmu in {}", source.place()),
                    Some(format!("{help}name its folder with --fmus, or run `cargo fmu pack {name}` if it is a model of this workspace")),
                );
                None
            }
            Err(message) => {
                self.problems.add(fmu.span(), message);
                None
            }
        }
    }

    /// Finds out what writes each input of a case.
    fn wire(&mut self, system: &mut System<'a>) {
        let connections = self.connections(system);
        // Outputs by name, to find the only other unit that has one.
        let mut outputs: HashMap<&str, Vec<(usize, usize)>> = HashMap::new();
        for (m, member) in system.members.iter().enumerate() {
            for (v, variable) in member.wirable(Causality::Output) {
                outputs.entry(variable.name.as_str()).or_default().push((m, v));
            }
        }
        let mut wired = Vec::new();
        for (m, member) in system.members.iter().enumerate() {
            let constants = self.constants(system.case, member);
            let mut inputs = Vec::new();
            let mut missing = Vec::new();
            for (v, variable) in member.all(Causality::Input) {
                let constant = constants.get(&v);
                let explicit = connections.get(&(m, v)).copied();
                let writer = self.writer(system, (m, v), explicit, &outputs);
                match (writer, constant) {
                    (Ok(Some(Source::Output(from, _))), Some((_, span))) => self.problems.add(
                        span.clone(),
                        format!(
                            "the input `{}` has this constant but is written by `{}`",
                            variable.name,
                            system.members[from].name()
                        ),
                    ),
                    (Ok(Some(source)), _) => inputs.push((v, source)),
                    (Ok(None), Some((value, _))) => {
                        inputs.push((v, Source::Constant(value.clone())));
                    }
                    (Ok(None), None) => missing.push(variable.name.as_str()),
                    (Err(()), _) => (),
                }
            }
            if !missing.is_empty() {
                self.report_missing(system, member, &missing, &outputs);
            }
            wired.push(inputs);
        }
        for (member, inputs) in system.members.iter_mut().zip(wired) {
            member.inputs = inputs;
        }
        if self.feeds.is_some() {
            self.drop_unneeded(system);
        }
    }

    fn report_missing(
        &mut self,
        system: &System<'_>,
        member: &Member<'_>,
        missing: &[&str],
        outputs: &HashMap<&str, Vec<(usize, usize)>>,
    ) {
        let list: Vec<String> = missing.iter().map(|name| format!("`{name}`")).collect();
        let near = missing
            .iter()
            .find_map(|name| suggestion(name, outputs.keys().copied()))
            .map_or(String::new(), |s| format!("; there is an output of similar name: {s}"));
        self.problems.add_with_help(
            member.unit.name.span(),
            format!(
                "nobody writes {} {} of `{}`",
                if missing.len() == 1 { "the input" } else { "the inputs" },
                list.join(", "),
                member.name()
            ),
            Some(format!(
                "in case `{}`; give the unit a constant in `inputs` or add a [[connection]]{near}",
                system.case.name.get_ref()
            )),
        );
    }

    /// What writes an input, constants aside. `Err`: a mistake was noted.
    fn writer(
        &mut self,
        system: &System<'_>,
        (m, v): (usize, usize),
        explicit: Option<(usize, usize)>,
        outputs: &HashMap<&str, Vec<(usize, usize)>>,
    ) -> Result<Option<Source>, ()> {
        let member = &system.members[m];
        let input = member.variable(v);
        let name = input.name.as_str();
        if input.base_type == BaseType::String {
            return Ok(None);
        }
        if let Some(feed) = self.feed(Some(member.name()), name) {
            return Ok(Some(self.use_feed(feed, member, input)));
        }
        let from = match explicit {
            Some(from) => Some(from),
            None => {
                if let Some(feed) = self.feed(None, name) {
                    return Ok(Some(self.use_feed(feed, member, input)));
                }
                let others: Vec<(usize, usize)> =
                    outputs.get(name).into_iter().flatten().filter(|(other, _)| *other != m).copied().collect();
                if others.len() > 1 {
                    let units: Vec<String> =
                        others.iter().map(|(other, _)| format!("`{}`", system.members[*other].name())).collect();
                    self.problems.add_with_help(
                        member.unit.name.span(),
                        format!(
                            "the input `{name}` of `{}` has several writers: {}",
                            member.name(),
                            units.join(" and ")
                        ),
                        Some("choose one with a [[connection]]".to_string()),
                    );
                    return Err(());
                }
                others.first().copied()
            }
        };
        let Some((w, o)) = from else {
            return Ok(None);
        };
        let writer = &system.members[w];
        let output = writer.variable(o);
        let fed = self.feed(Some(writer.name()), &output.name).or_else(|| self.feed(None, &output.name));
        if let Some(feed) = fed {
            return Ok(Some(self.use_feed(feed, member, input)));
        }
        // The ends of a connection were checked where it is written.
        if explicit.is_none()
            && let Err(message) = compatible((writer, output), (member, input))
        {
            self.problems.add(member.unit.name.span(), message);
            return Err(());
        }
        Ok(Some(Source::Output(w, o)))
    }

    fn feed(&self, unit: Option<&str>, signal: &str) -> Option<usize> {
        let feeds = self.feeds?;
        match unit {
            Some(unit) => feeds.index(&format!("{unit}:{signal}")),
            None => feeds.index(signal),
        }
    }

    /// Notes that a feed writes an input, and values that the input cannot take.
    fn use_feed(&mut self, feed: usize, member: &Member<'_>, input: &Variable) -> Source {
        self.fed.insert(feed);
        let signal = self.feeds.map(|f| &f.signals[feed]);
        let fits = |value: f64| match input.base_type {
            BaseType::Integer => value.fract() == 0.0 && (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&value),
            BaseType::Boolean => value == 0.0 || value == 1.0,
            BaseType::Real | BaseType::String => true,
        };
        if let Some(signal) = signal
            && let Some(value) = signal.values.iter().find(|v| !fits(**v))
        {
            let misfit = format!(
                "`{}` has the value {value}, but the input `{}` of `{}` is {}",
                signal.name,
                input.name,
                member.name(),
                input.base_type
            );
            if !self.misfits.contains(&misfit) {
                self.misfits.push(misfit);
            }
        }
        Source::Feed(feed)
    }

    /// Explicit connections of a case: (member, input) -> (member, output).
    fn connections(&mut self, system: &System<'_>) -> HashMap<(usize, usize), (usize, usize)> {
        let mut connections = HashMap::new();
        for connection in &self.scenario.connections {
            let from = self.end(system, &connection.from, Causality::Output);
            let to = self.end(system, &connection.to, Causality::Input);
            let (Some(from), Some(to)) = (from, to) else {
                continue;
            };
            let ends = |(m, v): (usize, usize)| {
                let member = &system.members[m];
                (member, member.variable(v))
            };
            if let Err(message) = compatible(ends(from), ends(to)) {
                self.problems.add(connection.to.span(), message);
            }
            if connections.insert(to, from).is_some() {
                self.problems
                    .add(connection.to.span(), format!("a second connection writes `{}`", connection.to.get_ref()));
            }
        }
        connections
    }

    /// One end of a connection; `None` if it is wrong or the case leaves its unit out.
    fn end(&mut self, system: &System<'_>, written: &Spanned<String>, causality: Causality) -> Option<(usize, usize)> {
        let (unit, name, name_span) = self.unit_and_name(written)?;
        let m = system.member(unit)?;
        let member = &system.members[m];
        let wanted = if causality == Causality::Output { "output" } else { "input" };
        match member.found.description.index(name) {
            Some(v) if member.variable(v).causality != causality => {
                self.problems.add(
                    name_span,
                    format!("`{name}` of `{unit}` is {}, expected an {wanted}", plan::role(member.variable(v))),
                );
                None
            }
            Some(v) if member.variable(v).base_type == BaseType::String => {
                self.problems.add(name_span, "a String cannot be connected".to_string());
                None
            }
            Some(v) => Some((m, v)),
            None => {
                let names = member.wirable(causality).map(|(_, v)| v.name.as_str());
                let help = suggestion(name, names);
                self.problems.add_with_help(name_span, format!("`{unit}` has no {wanted} `{name}`"), help);
                None
            }
        }
    }

    /// Splits `unit:name` and checks the unit; also returns where the name stands.
    fn unit_and_name<'s>(&mut self, written: &'s Spanned<String>) -> Option<(&'s str, &'s str, Range<usize>)> {
        let text = written.get_ref().as_str();
        let Some((unit, name)) = text.split_once(':') else {
            self.problems.add(written.span(), "expected \"unit:variable\"");
            return None;
        };
        let units = self.scenario.units.iter().map(|u| u.name.get_ref().as_str());
        if !units.clone().any(|u| u == unit) {
            unknown("unit", unit, written.span(), units, &mut self.problems);
            return None;
        }
        Some((unit, name, written.span()))
    }

    /// Constants of the inputs of a unit: those of the case stand above those of the unit.
    fn constants(&mut self, case: &Case, member: &Member<'_>) -> BTreeMap<usize, (Value, Range<usize>)> {
        let mut constants = BTreeMap::new();
        for level in [Some(&member.unit.inputs), case.inputs.get(member.name())].into_iter().flatten() {
            constants.extend(self.constants_of_level(level, member));
        }
        constants
    }

    fn constants_of_level(&mut self, level: &Values, member: &Member<'_>) -> BTreeMap<usize, (Value, Range<usize>)> {
        let mut constants = BTreeMap::new();
        // A plain name stands above a pattern, so patterns come first.
        for is_plain in [false, true] {
            let mut by_pattern: BTreeMap<usize, &str> = BTreeMap::new();
            for (pattern, written) in level {
                let text = pattern.get_ref().as_str();
                if text.contains('*') == is_plain {
                    continue;
                }
                let mut any = false;
                for (v, variable) in member.all(Causality::Input) {
                    if !matches(text, &variable.name) {
                        continue;
                    }
                    any = true;
                    if let Some(other) = by_pattern.insert(v, text) {
                        self.problems
                            .add(pattern.span(), format!("`{text}` and `{other}` both match `{}`", variable.name));
                    }
                    if let Some(value) = self.value(&member.found.description, variable, written) {
                        constants.insert(v, (value, pattern.span()));
                    }
                }
                if !any {
                    let names = member.all(Causality::Input).map(|(_, v)| v.name.as_str());
                    let help = suggestion(text, names);
                    self.problems.add_with_help(
                        pattern.span(),
                        format!("`{}` has no input `{text}`", member.name()),
                        help,
                    );
                }
            }
        }
        constants
    }

    /// A value as written, converted to the unit of the variable and checked.
    fn value(
        &mut self,
        description: &ModelDescription,
        variable: &Variable,
        written: &Spanned<toml::Value>,
    ) -> Option<Value> {
        let result = convert(description, variable, written.get_ref()).and_then(|value| {
            plan::check(variable, &value).map_err(|message| (message, None))?;
            Ok(value)
        });
        match result {
            Ok(value) => Some(value),
            Err((message, help)) => {
                self.problems.add_with_help(written.span(), message, help);
                None
            }
        }
    }

    /// Marks the units from which no way leads to a recorded output.
    fn drop_unneeded(&mut self, system: &mut System<'_>) {
        let mut needed = vec![false; system.members.len()];
        let mut open: Vec<usize> = (0..system.members.len())
            .filter(|&m| {
                let member = &system.members[m];
                member.wirable(Causality::Output).any(|(_, v)| self.is_recorded(member.name(), &v.name))
            })
            .collect();
        while let Some(m) = open.pop() {
            if std::mem::replace(&mut needed[m], true) {
                continue;
            }
            for (_, source) in &system.members[m].inputs {
                if let Source::Output(from, _) = source {
                    open.push(*from);
                }
            }
        }
        for (member, needed) in system.members.iter_mut().zip(needed) {
            member.dropped = !needed;
        }
    }

    fn is_recorded(&self, unit: &str, signal: &str) -> bool {
        self.scenario.record.signals.iter().any(|pattern| {
            let (of, pattern) = split_pattern(pattern.get_ref());
            of.is_none_or(|of| of == unit) && matches(pattern, signal)
        })
    }

    /// All recorded signals: units in the order of the scenario, variables in that of the FMU.
    fn columns(&mut self, systems: &[System<'_>]) -> Vec<Column> {
        for pattern in &self.scenario.record.signals {
            let (unit, text) = split_pattern(pattern.get_ref());
            if unit.is_some() && self.unit_and_name(pattern).is_none() {
                continue;
            }
            let outputs = outputs(systems, unit);
            if !outputs.iter().any(|(_, name)| matches(text, name)) {
                let help = suggestion(text, outputs.iter().map(|(_, name)| *name));
                self.problems.add_with_help(pattern.span(), format!("no output matches `{}`", pattern.get_ref()), help);
            }
        }
        let owners = outputs(systems, None);
        let mut columns: Vec<Column> = Vec::new();
        for unit in &self.scenario.units {
            for system in systems {
                let Some(m) = system.member(unit.name.get_ref()) else {
                    continue;
                };
                let member = &system.members[m];
                for (_, variable) in member.wirable(Causality::Output) {
                    if !self.is_recorded(member.name(), &variable.name) {
                        continue;
                    }
                    let shared = owners.iter().filter(|(_, name)| *name == variable.name).count() > 1;
                    let known = columns.iter_mut().find(|c| c.unit == member.name() && c.variable == variable.name);
                    let Some(known) = known else {
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
        columns
    }

    /// Column of a signal named in a metric or a figure.
    fn column_index(&mut self, written: &Spanned<String>, systems: &[System<'_>], columns: &[Column]) -> Option<usize> {
        let (unit, name) = split_pattern(written.get_ref());
        if unit.is_some() {
            self.unit_and_name(written)?;
        }
        let candidates = outputs(systems, unit);
        let owners: Vec<&str> =
            candidates.iter().filter(|(_, output)| *output == name).map(|(owner, _)| *owner).collect();
        match owners[..] {
            [] => {
                let help = suggestion(name, candidates.iter().map(|(_, output)| *output));
                self.problems.add_with_help(
                    written.span(),
                    format!("there is no output `{}`", written.get_ref()),
                    help,
                );
                None
            }
            [owner] => {
                let at = columns.iter().position(|c| c.unit == owner && c.variable == name);
                if at.is_none() {
                    self.problems.add_with_help(
                        written.span(),
                        format!("`{}` is not recorded", written.get_ref()),
                        Some("add it to `signals` of [record]".to_string()),
                    );
                }
                at
            }
            [first, ..] => {
                self.problems.add_with_help(
                    written.span(),
                    format!("several units have an output `{name}`: {}", owners.join(", ")),
                    Some(format!("name one of them: \"{first}:{name}\"")),
                );
                None
            }
        }
    }

    /// Factor and offset of a unit to show a column in.
    fn conversion(&mut self, unit: Option<&Spanned<String>>, column: &plan::Column) -> Option<(f64, f64)> {
        let Some(unit) = unit else {
            return Some((1.0, 0.0));
        };
        let name = unit.get_ref();
        if column.unit.as_ref() == Some(name) {
            return Some((1.0, 0.0));
        }
        let found = column.units.iter().find(|u| u.name == *name);
        if found.is_none() {
            let own = column.unit.iter();
            let all: Vec<&str> = own.chain(column.units.iter().map(|u| &u.name)).map(String::as_str).collect();
            let help = suggestion(name, all.iter().copied());
            let message = format!("`{}` cannot be shown in `{name}`, expected one of: {}", column.name, all.join(", "));
            self.problems.add_with_help(unit.span(), message, help);
        }
        found.map(|u| (u.factor, u.offset))
    }

    fn metrics(&mut self, systems: &[System<'_>], columns: &[Column]) -> Vec<plan::Metric> {
        let mut metrics = Vec::new();
        for metric in &self.scenario.metrics {
            let Some(column) = self.column_index(&metric.signal, systems, columns) else {
                continue;
            };
            let shown = &columns[column].plan;
            let Some((factor, offset)) = self.conversion(metric.unit.as_ref(), shown) else {
                continue;
            };
            let minus = self.beside(metric.minus.as_ref(), &[column], systems, columns);
            let until = metric.until.as_ref().and_then(|until| self.until(until.get_ref(), systems, columns));
            metrics.push(plan::Metric {
                name: metric.name.get_ref().clone(),
                title: metric.title.clone(),
                column,
                kind: metric.kind,
                window: metric.window.as_ref().map(|w| *w.get_ref()),
                until,
                minus,
                threshold: metric.threshold.as_ref().map(|t| *t.get_ref()),
                unit: match metric.kind.unit() {
                    Some(unit) => Some(unit.to_string()),
                    None => metric.unit.as_ref().map(|u| u.get_ref().clone()).or_else(|| shown.unit.clone()),
                },
                factor,
                // A difference has none.
                offset: if minus.is_some() { 0.0 } else { offset },
                digits: metric.digits.as_ref().map(|d| *d.get_ref()),
                paper: metric.paper.as_ref().map(|paper| plan::Paper {
                    table: paper.table.clone(),
                    values: paper.values.iter().map(|(key, value)| (key.get_ref().clone(), *value)).collect(),
                    calibrated: paper
                        .calibrated
                        .as_ref()
                        .map(|keys| keys.iter().map(|key| key.get_ref().clone()).collect()),
                }),
            });
        }
        metrics
    }

    /// Column of a signal that is compared with others, which have its unit of measure.
    fn beside(
        &mut self,
        signal: Option<&Spanned<String>>,
        others: &[usize],
        systems: &[System<'_>],
        columns: &[Column],
    ) -> Option<usize> {
        let signal = signal?;
        let index = self.column_index(signal, systems, columns)?;
        let unit = |index: usize| columns[index].plan.unit.as_deref().unwrap_or("no unit");
        if let Some(&other) = others.iter().find(|&&other| unit(other) != unit(index)) {
            let name = &columns[other].plan.name;
            let message = format!("`{}` is in {}, but `{name}` is in {}", signal.get_ref(), unit(index), unit(other));
            self.problems.add(signal.span(), message);
        }
        Some(index)
    }

    fn until(&mut self, until: &scenario::Until, systems: &[System<'_>], columns: &[Column]) -> Option<plan::Until> {
        let column = self.column_index(&until.signal, systems, columns)?;
        let (factor, offset) = self.conversion(until.unit.as_ref(), &columns[column].plan)?;
        // Checked to be one of the two.
        let level = until.above.or(until.below)?;
        Some(plan::Until { column, above: until.above.is_some(), level: (level - offset) / factor })
    }

    fn figures(&mut self, systems: &[System<'_>], columns: &[Column]) -> Vec<plan::Figure> {
        let mut figures = Vec::new();
        for figure in &self.scenario.figures {
            let mut indices = Vec::new();
            let mut scale = (1.0, 0.0);
            for signal in &figure.signals {
                if let Some(column) = self.column_index(signal, systems, columns) {
                    let shown = &columns[column].plan;
                    let own = self.conversion(figure.unit.as_ref(), shown);
                    scale = own.unwrap_or(scale);
                    indices.push(column);
                }
            }
            let against = self.beside(figure.against.as_ref(), &indices, systems, columns);
            let metric_index = |name: &Spanned<String>| {
                let metrics = &self.scenario.metrics;
                metrics.iter().position(|m| m.name == *name)
            };
            figures.push(plan::Figure {
                name: figure.name.get_ref().clone(),
                title: figure.title.clone(),
                kind: figure.kind,
                cases: match &figure.cases {
                    Some(cases) => cases.get_ref().iter().map(|name| name.get_ref().clone()).collect(),
                    None => self.scenario.cases.iter().map(|case| case.name.get_ref().clone()).collect(),
                },
                separate: figure.separate.as_ref().is_some_and(|separate| *separate.get_ref()),
                columns: indices,
                against,
                metrics: figure.metrics.iter().filter_map(metric_index).collect(),
                window: figure.window.as_ref().map(|w| *w.get_ref()),
                unit: figure.unit.as_ref().map(|u| u.get_ref().clone()),
                factor: scale.0,
                offset: scale.1,
                levels: figure.levels.iter().map(|level| level.get_ref().clone()).collect(),
                caption: figure.caption.clone(),
            });
        }
        figures
    }

    fn runs(&mut self, systems: &[System<'_>], columns: &[Column], seeds: &[i32]) -> Vec<plan::Run> {
        let seed_of = self.scenario.seeds.as_ref().and_then(|s| self.unit_and_name(&s.parameter));
        let points: Vec<Option<&scenario::Point>> =
            if self.scenario.points.is_empty() { vec![None] } else { self.scenario.points.iter().map(Some).collect() };
        let seeds: Vec<Option<i32>> =
            if seeds.is_empty() { vec![None] } else { seeds.iter().copied().map(Some).collect() };
        let mut runs = Vec::new();
        for system in systems {
            if let Some((unit, ..)) = &seed_of
                && system.member(unit).is_none()
            {
                self.problems.add(
                    system.case.name.span(),
                    format!("this case leaves out the unit `{unit}`, which takes the seeds"),
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
                    for (unit, member) in run.units.iter_mut().zip(members) {
                        let seed = match (&seed_of, seed) {
                            (Some((of, name, span)), Some(seed)) if *of == member.name() => {
                                Some((*name, span.clone(), *seed))
                            }
                            _ => None,
                        };
                        unit.parameters = self.parameters(system.case, *point, member, seed);
                    }
                    runs.push(run);
                }
            }
        }
        runs
    }

    /// Parameters of a unit: from the bottom up the parameter set of the scenario and its own, its parameters, the
    /// parameter set of the case, the parameters of the case and of the point, the seed.
    fn parameters(
        &mut self,
        case: &Case,
        point: Option<&scenario::Point>,
        member: &Member<'_>,
        seed: Option<(&str, Range<usize>, i32)>,
    ) -> Vec<Setting> {
        let description = &member.found.description;
        let mut settings: BTreeMap<String, Setting> = BTreeMap::new();
        let mut set = |variable: &Variable, value: Value| {
            let setting = setting(variable, value);
            settings.insert(variable.name.clone(), setting);
        };
        let of_point = point.and_then(|p| p.parameters.get(member.name()));
        // (parameter set, whether its names are those of the unit)
        let of_scenario = (self.scenario.parameter_set.as_ref(), false);
        let of_unit = (member.unit.parameter_set.as_ref(), true);
        let of_case = (case.parameter_set.as_ref(), false);
        let levels = [
            (&[of_scenario, of_unit][..], Some(&member.unit.parameters)),
            (&[of_case], case.parameters.get(member.name())),
            (&[], of_point),
        ];
        for (sets, values) in levels {
            for (path, is_of_unit) in sets {
                let Some(path) = path else { continue };
                for (variable, value) in self.set_values(path, *is_of_unit, member) {
                    set(variable, value);
                }
            }
            for (name, written) in values.into_iter().flatten() {
                match plan::parameter(description, name.get_ref()) {
                    Ok(variable) => {
                        if let Some(value) = self.value(description, variable, written) {
                            set(variable, value);
                        }
                    }
                    Err(e) => self.problems.add_with_help(name.span(), e.message, e.help),
                }
            }
        }
        if let Some((name, span, seed)) = seed {
            let value = Value::Integer(seed);
            match plan::parameter(description, name) {
                Ok(variable) => match plan::check(variable, &value) {
                    Ok(()) => set(variable, value),
                    Err(message) => self.problems.add(span, message),
                },
                Err(e) => self.problems.add_with_help(span, e.message, e.help),
            }
        }
        settings.into_values().collect()
    }

    /// What a parameter set says about a unit: all of it, or what is named `unit:parameter`.
    fn set_values<'m>(
        &mut self,
        path: &Spanned<String>,
        of_unit: bool,
        member: &'m Member<'_>,
    ) -> Vec<(&'m Variable, Value)> {
        let description = &member.found.description;
        let mut values = Vec::new();
        for written in self.sets.get(path.get_ref()).into_iter().flat_map(|set| &set.parameters) {
            let name = match split_unit(&written.name) {
                _ if of_unit => written.name.as_str(),
                Some((unit, name)) if unit == member.name() => name,
                _ => continue,
            };
            let value = plan::parameter(description, name).map_err(|e| (e.message, e.help)).and_then(|variable| {
                let value = match (&written.value, &written.unit) {
                    (Value::Real(number), Some(unit)) => convert_unit(description, variable, *number, unit)?,
                    (value, _) => value.clone(),
                };
                plan::check(variable, &value).map_err(|message| (message, None))?;
                Ok((variable, value))
            });
            match value {
                Ok(value) => values.push(value),
                Err((message, help)) => {
                    self.problems.add_with_help(path.span(), format!("{}: {message}", path.get_ref()), help);
                }
            }
        }
        values
    }

    /// The run of a case with its wires, without parameters, point and seed.
    fn wired(&self, system: &System<'_>, columns: &[Column]) -> plan::Run {
        let kept: Vec<usize> = (0..system.members.len()).filter(|&m| !system.members[m].dropped).collect();
        let sources = || kept.iter().flat_map(|&m| &system.members[m].inputs).map(|(_, source)| source);
        // Slots: feeds first, then outputs in the order of the units.
        let mut slots = 0..;
        let mut next = || slots.next().unwrap_or_default();
        let used: BTreeSet<usize> = sources()
            .filter_map(|s| match s {
                Source::Feed(feed) => Some(*feed),
                _ => None,
            })
            .collect();
        let feed_slots: HashMap<usize, usize> = used.iter().map(|&feed| (feed, next())).collect();
        let read: BTreeSet<(usize, usize)> = sources()
            .filter_map(|s| match s {
                Source::Output(m, v) => Some((*m, *v)),
                _ => None,
            })
            .collect();
        let mut output_slots: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for &m in &kept {
            let member = &system.members[m];
            for (v, variable) in member.wirable(Causality::Output) {
                if read.contains(&(m, v)) || self.is_recorded(member.name(), &variable.name) {
                    output_slots.insert((m, v), next());
                }
            }
        }
        let units = kept
            .iter()
            .map(|&m| {
                let member = &system.members[m];
                let description = &member.found.description;
                let mut constants = Vec::new();
                let mut inputs = Vec::new();
                for (v, source) in &member.inputs {
                    let variable = member.variable(*v);
                    match source {
                        Source::Constant(value) => {
                            constants.push(setting(variable, value.clone()));
                        }
                        Source::Feed(feed) => inputs.push(wire(variable, feed_slots[feed])),
                        Source::Output(m, o) => {
                            inputs.push(wire(variable, output_slots[&(*m, *o)]));
                        }
                    }
                }
                plan::Unit {
                    name: member.name().to_string(),
                    fmu: member.found.path.clone(),
                    model_identifier: description
                        .co_simulation
                        .as_ref()
                        .map_or(String::new(), |c| c.model_identifier.clone()),
                    guid: description.guid.clone(),
                    parameters: Vec::new(),
                    constants,
                    inputs,
                    outputs: output_slots
                        .range((m, 0)..(m + 1, 0))
                        .map(|((_, v), slot)| wire(member.variable(*v), *slot))
                        .collect(),
                }
            })
            .collect();
        let feeds = self.feeds.map_or(Vec::new(), |feeds| {
            used.iter()
                .map(|feed| plan::Feed {
                    slot: feed_slots[feed],
                    times: Arc::clone(&feeds.times),
                    values: Arc::clone(&feeds.signals[*feed].values),
                })
                .collect()
        });
        let case = system.case.name.get_ref();
        plan::Run {
            id: case.clone(),
            case: case.clone(),
            point: None,
            seed: None,
            units,
            feeds,
            slots: feed_slots.len() + output_slots.len(),
            columns: columns
                .iter()
                .map(|column| {
                    let m = system.member(&column.unit)?;
                    let v = system.members[m].found.description.index(&column.variable)?;
                    output_slots.get(&(m, v)).copied()
                })
                .collect(),
        }
    }
}

fn setting(variable: &Variable, value: Value) -> Setting {
    Setting { name: variable.name.clone(), base_type: variable.base_type, reference: variable.reference, value }
}

fn wire(variable: &Variable, slot: usize) -> Wire {
    Wire { reference: variable.reference, base_type: variable.base_type, slot }
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
        unit: member.name().to_string(),
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

/// (unit, output) of all cases, each once, of one unit or of all.
fn outputs<'s>(systems: &'s [System<'_>], unit: Option<&str>) -> BTreeSet<(&'s str, &'s str)> {
    systems
        .iter()
        .flat_map(|system| &system.members)
        .filter(|member| unit.is_none_or(|unit| unit == member.name()))
        .flat_map(|member| member.wirable(Causality::Output).map(|(_, v)| (member.name(), v.name.as_str())))
        .collect()
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

/// `unit:pattern` or `pattern`.
fn split_pattern(text: &str) -> (Option<&str>, &str) {
    match text.split_once(':') {
        Some((unit, pattern)) => (Some(unit), pattern),
        None => (None, text),
    }
}

/// Whether a name matches a pattern, in which `*` stands for any characters.
fn matches(pattern: &str, name: &str) -> bool {
    let Some((first, rest)) = pattern.split_once('*') else {
        return pattern == name;
    };
    let Some(mut name) = name.strip_prefix(first) else {
        return false;
    };
    let (middle, last) = rest.rsplit_once('*').unwrap_or(("", rest));
    // The leftmost place for each part leaves most room for those that follow.
    for part in middle.split('*') {
        let Some(at) = name.find(part) else {
            return false;
        };
        name = &name[at + part.len()..];
    }
    name.ends_with(last)
}

/// Whether an output may write an input: same base type, same unit of measure where both have one.
fn compatible(
    (writer, output): (&Member<'_>, &Variable),
    (reader, input): (&Member<'_>, &Variable),
) -> Result<(), String> {
    let describe = |output_is: &str, input_is: &str| {
        format!(
            "`{}:{}` is {output_is}, but `{}:{}`, which it writes, is {input_is}",
            writer.name(),
            output.name,
            reader.name(),
            input.name
        )
    };
    output.mismatch(input).map_or(Ok(()), |[output_is, input_is]| Err(describe(&output_is, &input_is)))
}

/// A message and a hint.
type Mistake = (String, Option<String>);

/// A value as written in TOML as a value of the variable, in the unit of the variable.
fn convert(description: &ModelDescription, variable: &Variable, written: &toml::Value) -> Result<Value, Mistake> {
    let name = &variable.name;
    let wrong = |found: &str| Err((format!("`{name}` is {}, got {found}", variable.base_type), None));
    match (written, variable.base_type) {
        (toml::Value::Float(v), BaseType::Real) => Ok(Value::Real(*v)),
        // TOML integers have 64 bits; whole numbers beyond 2^53 are no sensible parameters.
        (toml::Value::Integer(v), BaseType::Real) => Ok(Value::Real(*v as f64)),
        (toml::Value::Integer(v), BaseType::Integer) => match i32::try_from(*v) {
            Ok(v) => Ok(Value::Integer(v)),
            Err(_) => wrong(&format!("{v}, which has more than 32 bits")),
        },
        (toml::Value::Boolean(v), BaseType::Boolean) => Ok(Value::Boolean(*v)),
        (toml::Value::String(v), BaseType::String) => Ok(Value::String(v.clone())),
        (toml::Value::Table(table), base_type) => {
            let mut keys = table.keys().map(String::as_str);
            let (Some(value), Some(toml::Value::String(unit)), true) =
                (table.get("value"), table.get("unit"), keys.all(|key| key == "value" || key == "unit"))
            else {
                return Err((
                    format!("`{name}`: expected a value or {{ value = .., unit = \"..\" }}"),
                    Some("a name with a dot is written in quotes: \"steer.amplitude\" = 1".into()),
                ));
            };
            let number = match value {
                toml::Value::Float(v) => *v,
                toml::Value::Integer(v) => *v as f64,
                other => return wrong(other.type_str()),
            };
            if base_type != BaseType::Real {
                return wrong("a value with a unit");
            }
            convert_unit(description, variable, number, unit)
        }
        (other, _) => wrong(other.type_str()),
    }
}

fn convert_unit(
    description: &ModelDescription,
    variable: &Variable,
    number: f64,
    unit: &str,
) -> Result<Value, Mistake> {
    let name = &variable.name;
    let Some(own) = &variable.unit else {
        return Err((format!("`{name}` has no unit of measure"), None));
    };
    if own == unit {
        return Ok(Value::Real(number));
    }
    let display_units = description.display_units(variable);
    match display_units.iter().find(|u| u.name == unit) {
        Some(u) => Ok(Value::Real((number - u.offset) / u.factor)),
        None => {
            let mut all = vec![own.as_str()];
            all.extend(display_units.iter().map(|u| u.name.as_str()));
            Err((format!("`{name}` cannot be given in `{unit}`, expected one of: {}", all.join(", ")), None))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn patterns() {
        for (pattern, name, expected) in [
            ("body.roll", "body.roll", true),
            ("body.roll", "body.roll_rate", false),
            ("body.*", "body.roll", true),
            ("*", "", true),
            ("*.fl", "road_height.fl", true),
            ("*.fl", "road_height.fr", false),
            ("a*b*c", "a-b-b-c", true),
            ("a*b*c", "acb", false),
            ("a*a", "a", false),
            ("**", "x", true),
        ] {
            assert_eq!(matches(pattern, name), expected, "{pattern} {name}");
        }
    }
}
