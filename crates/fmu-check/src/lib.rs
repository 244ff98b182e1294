//! Validates FMUs made with any tool: does the description follow the rules of FMI 2.0 or 3.0, and does the binary do
//! what the description promises, in co-simulation and model exchange?
//!
//! The rules of the description are in FMI 2.0.4, sections 2.2, 3.3 and 4.3, and in FMI 3.0.2, section 2.4; `rules`
//! checks them. Validators that only read XML cannot know whether a start value is the real one, whether an output
//! really depends on an input, or whether a restored state continues as before: `behavior` tests that.

mod behavior;
mod process;
mod rules;
#[cfg(not(target_family = "wasm"))]
pub mod worker;

use fmu_import::archive::Archive;
use fmu_import::description::{FmiVersion, Interface, ModelDescription};
use fmu_import::loader::{self, Library, LoadError};
use fmu_import::terminal;
use fmu_import::wasm::Names;
use std::collections::HashSet;
use std::fmt;
use std::path::Path;
use std::time::Duration;

/// Compiles the example in the readme.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;

/// Severity of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Information; nothing is wrong.
    Note,
    /// Allowed, but misleading for masters or their users.
    Warning,
    /// Violates the standard or the description.
    Error,
}

/// The question that a finding answers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Topic {
    /// Does the FMU simulate? It loads, starts and steps, and its results are finite and reproducible.
    Simulation,
    /// Does the FMU follow the standard? Everything else that FMI requires or that the description promises.
    Standard,
}

/// A finding about an FMU.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Finding {
    /// Severity.
    pub severity: Severity,
    /// Question that the finding answers.
    pub topic: Topic,
    /// Subject, such as a variable or a function.
    pub subject: String,
    /// Description of the problem and of the violated rule.
    pub message: String,
}

/// Longest subject and message of a finding, bytes: names and messages of an FMU may be longer.
const MAX_TEXT: usize = 2000;

fn cut(text: impl Into<String>) -> String {
    let mut text = text.into();
    if text.len() > MAX_TEXT {
        let end = (0..=MAX_TEXT).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
        text.truncate(end);
        text.push_str(" ...");
    }
    text
}

impl Finding {
    /// An error about the standard.
    pub(crate) fn error(subject: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Error, topic: Topic::Standard, subject: cut(subject), message: cut(message) }
    }

    /// A warning about the standard.
    pub(crate) fn warning(subject: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(subject, message) }
    }

    /// A note about the simulation.
    pub(crate) fn note(subject: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Note, topic: Topic::Simulation, ..Self::error(subject, message) }
    }

    /// Returns the same finding about another question.
    pub(crate) fn about(self, topic: Topic) -> Self {
        Self { topic, ..self }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Note => "note",
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        // Both may contain text from the FMU, in which no line must look like another finding.
        let (subject, message) = (terminal::line(&self.subject), terminal::indented(&self.message, "    "));
        write!(f, "{severity}: {subject}: {message}")
    }
}

/// Progress of a check.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// The next trial. If the binary crashes the process, it crashed in this trial.
    Trying {
        /// Name of the trial.
        trial: String,
        /// Question that a crash in this trial answers.
        topic: Topic,
    },
    /// A finding.
    Found(Finding),
    /// Scope of the check so far.
    Checked(Checked),
}

impl Event {
    fn trying(trial: impl Into<String>, topic: Topic) -> Self {
        Self::Trying { trial: trial.into(), topic }
    }
}

/// Options of a check.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct Options {
    /// Time limit of the default experiment, after which the experiment is stopped.
    pub experiment: Duration,
    /// Trials to skip. If there are any, findings about the description are skipped, too: the check continues an
    /// earlier one, after a crash.
    pub skip: HashSet<String>,
}

impl Default for Options {
    /// The whole check, with one minute for the default experiment.
    fn default() -> Self {
        Self { experiment: Duration::from_secs(60), skip: HashSet::new() }
    }
}

/// Prefix of the names of trials by model exchange.
const MODEL_EXCHANGE: &str = "model exchange: ";
/// Prefix of the names of trials by scheduled execution.
const SCHEDULED_EXECUTION: &str = "scheduled execution: ";

/// Scope of a check.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Checked {
    /// XML elements of the description that were compared with the schema.
    pub elements: usize,
    /// Variables of the description.
    pub variables: usize,
    /// Entries of the model structure.
    pub unknowns: usize,
    /// Trials of the binary that created an instance.
    pub trials: Vec<String>,
    /// Number of instances.
    pub instances: usize,
    /// Number of steps of all instances.
    pub steps: usize,
}

impl Checked {
    /// Adds the trials, instances and steps of an earlier process.
    #[cfg(not(target_family = "wasm"))]
    pub(crate) fn after(mut self, before: &Self) -> Self {
        self.trials.splice(0..0, before.trials.iter().cloned());
        self.instances += before.instances;
        self.steps += before.steps;
        self
    }
}

impl fmt::Display for Checked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { elements, variables, unknowns, trials, instances, steps } = self;
        write!(
            f,
            "description: {elements} elements checked against the schema; variables: {variables}; entries of the model \
             structure: {unknowns}"
        )?;
        if *instances > 0 {
            write!(f, "\nbinary: {instances} instances, {steps} steps")?;
            let prefixes = [MODEL_EXCHANGE, SCHEDULED_EXECUTION];
            let is_other = |trial: &&String| !prefixes.iter().any(|prefix| trial.starts_with(prefix));
            let others: Vec<&str> = trials.iter().filter(is_other).map(String::as_str).collect();
            if !others.is_empty() {
                write!(f, ": {}", others.join(", "))?;
            }
            for prefix in prefixes {
                let names: Vec<&str> = trials.iter().filter_map(|trial| trial.strip_prefix(prefix)).collect();
                if !names.is_empty() {
                    write!(f, "\n{prefix}{}", names.join(", "))?;
                }
            }
        }
        Ok(())
    }
}

/// Maximum number of findings that are reported; all others are only counted. A single fault may affect every variable.
const MAX_FINDINGS: usize = 1000;

/// Checks a `.fmu` file.
///
/// The binary is loaded and runs in this process, so call this function in a separate process if a crash matters.
pub fn check(path: &Path, options: &Options, report: &mut dyn FnMut(Event)) {
    let (mut reported, mut errors, mut warnings) = (0, 0, 0);
    let mut report_some = |event| {
        if let Event::Found(finding) = &event {
            if reported == MAX_FINDINGS {
                match finding.severity {
                    Severity::Note => (),
                    Severity::Error => errors += 1,
                    Severity::Warning => warnings += 1,
                }
                return;
            }
            reported += 1;
        }
        report(event);
    };
    let mut process = process::Process::new();
    examine(path, options, &mut |event| process.watch(event, &mut report_some));
    process.changes("").into_iter().for_each(|finding| report_some(Event::Found(finding)));
    let message = format!("{errors} further errors and {warnings} further warnings are left out");
    if errors > 0 {
        report(Event::Found(Finding::error("findings", message)));
    } else if warnings > 0 {
        report(Event::Found(Finding::warning("findings", message)));
    }
}

/// Checks an FMU without running it: the model description against the rules of its version of FMI, and whether
/// libraries, for any platform, export all functions.
pub fn without_running(description: &str, libraries: &[&Path]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let parsed = match ModelDescription::parse(description) {
        Ok(parsed) => parsed,
        Err(error) => return vec![Finding::error("modelDescription.xml", error.to_string())],
    };
    rules::check(description, &parsed, &mut |finding| findings.push(finding));
    for library in libraries {
        if library.extension().is_some_and(|extension| extension == "wasm") {
            findings.extend(imports(library));
        }
        match loader::not_exported(library, parsed.fmi, &parsed.interfaces()) {
            Ok(functions) => findings.extend(functions.into_iter().map(|function| missing(function, parsed.fmi))),
            Err(error) => findings.push(Finding::error("binary", error.to_string())),
        }
    }
    findings
}

/// The finding that a WebAssembly module has imports, which an importer would have to provide.
fn imports(module: &Path) -> Option<Finding> {
    let names = Names::read(&std::fs::read(module).ok()?)?;
    let message = || {
        format!(
            "the WebAssembly module imports {}; importers provide no functions, so an FMU must not import any",
            names.imports.join(", ")
        )
    };
    (!names.imports.is_empty()).then(|| Finding::error("binary", message()))
}

fn examine(path: &Path, options: &Options, report: &mut dyn FnMut(Event)) {
    let stray = loader::stray_messages();
    let is_first = options.skip.is_empty();
    let mut found = |finding| {
        if is_first {
            report(Event::Found(finding));
        }
    };
    let opened = Archive::open(path).and_then(|mut archive| Ok((archive.description_text()?, archive)));
    let (text, mut archive) = match opened {
        Ok(opened) => opened,
        Err(error) => return found(Finding::error("archive", error.to_string()).about(Topic::Simulation)),
    };
    if let [name, others @ ..] = &archive.names_with_backslashes()[..] {
        let others = if others.is_empty() { String::new() } else { format!(" and {} others", others.len()) };
        let message = format!(
            "the names of the entries `{name}`{others} have backslashes; zip archives separate folders by slashes, and other \
             importers do not find these files"
        );
        found(Finding::error("archive", message));
    }
    let description = match ModelDescription::parse(&text) {
        Ok(description) => description,
        Err(error) => {
            let finding = Finding::error("modelDescription.xml", error.to_string());
            return found(finding.about(Topic::Simulation));
        }
    };
    let mut checked = Checked {
        elements: rules::check(&text, &description, &mut found),
        variables: description.variables.len(),
        unknowns: [
            &description.outputs,
            &description.derivatives,
            &description.initial_unknowns,
            &description.event_indicators,
        ]
        .map(Vec::len)
        .iter()
        .sum(),
        ..Checked::default()
    };
    match archive.terminals() {
        Ok(terminals) => rules::terminals(&description, &terminals, &mut found),
        Err(error) => found(Finding::error("terminalsAndIcons.xml", error.to_string())),
    }
    report(Event::Checked(checked.clone()));
    let interfaces = description.interfaces();
    if interfaces.is_empty() {
        let message = "are missing: the FMU must have one of these interfaces";
        let finding = Finding::error("CoSimulation and ModelExchange", message);
        return report(Event::Found(finding.about(Topic::Simulation)));
    }
    let (mut libraries, mut problems) = (Vec::new(), Vec::new());
    for &interface in &interfaces {
        report(Event::trying(format!("loading the binary for {interface}"), Topic::Simulation));
        let binary = |error: &dyn fmt::Display| Finding::error("binary", error.to_string()).about(Topic::Simulation);
        let loaded = archive.unpack(&description, interface).map_err(|error| binary(&error)).and_then(|unpacked| {
            Library::load(unpacked).map_err(|error| match error {
                LoadError::Missing { function, .. } => missing(function, description.fmi).about(Topic::Simulation),
                error => binary(&error),
            })
        });
        match loaded {
            Ok(library) => libraries.push((interface, library)),
            // One file may be the library of both interfaces. Its problem is reported once.
            Err(problem) if problems.contains(&problem) => (),
            Err(problem) => {
                if is_first {
                    report(Event::Found(problem.clone()));
                }
                problems.push(problem);
            }
        }
    }
    let mut reported = HashSet::new();
    for (interface, library) in &libraries {
        let own = description.model_identifier(*interface);
        let of_file = |other: &&Interface| description.model_identifier(**other) == own;
        let its_interfaces: Vec<Interface> = interfaces.iter().filter(of_file).copied().collect();
        for function in library.missing_functions(&its_interfaces).into_iter().filter(|name| reported.insert(*name)) {
            if is_first {
                report(Event::Found(missing(function, description.fmi)));
            }
        }
    }
    let library = |wanted| libraries.iter().find(|(interface, _)| *interface == wanted).map(|(_, library)| library);
    let co_simulation = library(Interface::CoSimulation);
    if let Some(library) = co_simulation {
        behavior::check(library, &description, Interface::CoSimulation, options, &mut checked, report);
    }
    if let Some(library) = library(Interface::ModelExchange) {
        behavior::exchange::check(library, co_simulation, &description, options, &mut checked, report);
    }
    if let Some(library) = library(Interface::ScheduledExecution) {
        behavior::check(library, &description, Interface::ScheduledExecution, options, &mut checked, report);
    }
    let stray = loader::stray_messages() - stray;
    if stray > 0 {
        let message = format!(
            "was called with another environment than the one that the importer passed, for {stray} of its messages; importers that \
             use it crash: pass `componentEnvironment` (FMI 3.0: `instanceEnvironment`) of the instance"
        );
        report(Event::Found(Finding::error("logger", message)));
    }
}

fn missing(function: &str, fmi: FmiVersion) -> Finding {
    let message = format!("is not exported by the binary; all functions of FMI {fmi} must be exported");
    Finding::error(function, message)
}
