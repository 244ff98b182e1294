//! Validates FMUs made with any tool: does the description keep the rules of FMI 2.0 or 3.0, and does the binary do what
//! the description says, for co-simulation and model exchange?
//!
//! The rules of the description are in FMI 2.0.4, sections 2.2, 3.3 and 4.3, and in FMI 3.0.2, section 2.4; `rules` goes
//! through them. Validators that
//! only read XML cannot know whether a start value is the real one, whether an output really follows an input, or
//! whether a restored state goes on as before: `behavior` tries it out.

mod behavior;
mod rules;

use crate::archive::Archive;
use crate::description::{FmiVersion, Interface, ModelDescription};
use crate::loader::{self, Library, LoadError};
use crate::terminal;
use crate::wasm::Names;
use std::collections::HashSet;
use std::fmt;
use std::path::Path;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Allowed, but it misleads masters or their users.
    Warning,
    /// Against the standard, or not as described.
    Error,
}

/// Something that is wrong with an FMU.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Finding {
    /// How bad it is.
    pub severity: Severity,
    /// What it is about, such as a variable or a function.
    pub subject: String,
    /// What is wrong, and what was expected.
    pub message: String,
}

/// Longest subject and message of a finding, bytes: a name may have thousands, and an FMU may say more.
const MAX_TEXT: usize = 2000;

/// Text that is cut where it gets too long.
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
    fn error(subject: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Error, subject: cut(subject), message: cut(message) }
    }

    fn warning(subject: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, ..Self::error(subject, message) }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let severity = match self.severity {
            Severity::Warning => "warning",
            Severity::Error => "error",
        };
        // Both may hold text of the FMU: no line of it passes for another finding.
        let (subject, message) = (terminal::line(&self.subject), terminal::indented(&self.message, "    "));
        write!(f, "{severity}: {subject}: {message}")
    }
}

/// Where findings about a description go.
struct Findings<'a>(&'a mut dyn FnMut(Finding));

impl Findings<'_> {
    fn push(&mut self, finding: Finding) {
        (self.0)(finding);
    }
}

/// What a check tells while it goes on.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// What is tried next. If the binary takes the process down, this is what it did not survive.
    Trying(String),
    /// What was found.
    Found(Finding),
    /// What has been looked at so far.
    Checked(Checked),
}

/// Start of the names of trials by model exchange.
const MODEL_EXCHANGE: &str = "model exchange: ";

/// What a check has looked at.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Checked {
    /// XML elements of the description that were compared with the schema.
    pub elements: usize,
    /// Variables of the description.
    pub variables: usize,
    /// Entries of the model structure.
    pub unknowns: usize,
    /// Trials of the binary that made an instance.
    pub trials: Vec<String>,
    /// Instances that were made.
    pub instances: usize,
    /// Steps that were made, of all instances.
    pub steps: usize,
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
            let is_exchange = |trial: &&String| trial.starts_with(MODEL_EXCHANGE);
            let (exchange, trials): (Vec<&String>, Vec<&String>) = trials.iter().partition(is_exchange);
            let listed = |trials: &[&String]| {
                let names = trials.iter().map(|trial| trial.strip_prefix(MODEL_EXCHANGE).unwrap_or(trial));
                names.collect::<Vec<_>>().join(", ")
            };
            write!(f, "\nbinary: {instances} instances, {steps} steps")?;
            if !trials.is_empty() {
                write!(f, ": {}", listed(&trials))?;
            }
            if !exchange.is_empty() {
                write!(f, "\nmodel exchange: {}", listed(&exchange))?;
            }
        }
        Ok(())
    }
}

/// Most findings that are told; of further ones only their number. A fault may be one of every variable.
const MAX_FINDINGS: usize = 1000;

/// Checks a `.fmu` file.
///
/// The binary is loaded and runs in this process, so call it in a process of its own where a crash matters.
pub fn check(path: &Path, tell: &mut dyn FnMut(Event)) {
    let (mut told, mut errors, mut warnings) = (0, 0, 0);
    examine(path, &mut |event| {
        if let Event::Found(finding) = &event {
            if told == MAX_FINDINGS {
                match finding.severity {
                    Severity::Error => errors += 1,
                    Severity::Warning => warnings += 1,
                }
                return;
            }
            told += 1;
        }
        tell(event);
    });
    let message = format!("{errors} further errors and {warnings} further warnings are left out");
    if errors > 0 {
        tell(Event::Found(Finding::error("findings", message)));
    } else if warnings > 0 {
        tell(Event::Found(Finding::warning("findings", message)));
    }
}

/// Checks what can be seen without running anything: a model description against the rules of its version of FMI, and whether
/// libraries, for any platform, export all functions.
#[must_use]
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

/// Imports of a WebAssembly module, which an importer would have to provide.
fn imports(module: &Path) -> Option<Finding> {
    let names = Names::read(&std::fs::read(module).ok()?)?;
    let message = || {
        format!(
            "the module for WebAssembly imports {}; FMI has functions that it exports only",
            names.imports.join(", ")
        )
    };
    (!names.imports.is_empty()).then(|| Finding::error("binary", message()))
}

fn examine(path: &Path, tell: &mut dyn FnMut(Event)) {
    let mut found = |finding| tell(Event::Found(finding));
    let opened = Archive::open(path).and_then(|mut archive| Ok((archive.description_text()?, archive)));
    let (text, mut archive) = match opened {
        Ok(opened) => opened,
        Err(error) => return found(Finding::error("archive", error.to_string())),
    };
    let description = match ModelDescription::parse(&text) {
        Ok(description) => description,
        Err(error) => return found(Finding::error("modelDescription.xml", error.to_string())),
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
    tell(Event::Checked(checked.clone()));
    let interfaces = description.interfaces();
    if interfaces.is_empty() {
        let subject = "CoSimulation and ModelExchange";
        return tell(Event::Found(if description.has_scheduled_execution {
            Finding::warning(
                subject,
                "are missing: the binary was not tried, because scheduled execution is not supported",
            )
        } else {
            Finding::error(subject, "are missing: the FMU must have one of these interfaces")
        }));
    }
    let (mut libraries, mut problems) = (Vec::new(), Vec::new());
    for &interface in &interfaces {
        tell(Event::Trying(format!("loading the binary for {interface}")));
        let binary = |error: &dyn fmt::Display| Finding::error("binary", error.to_string());
        let loaded = archive.unpack(&description, interface).map_err(|error| binary(&error)).and_then(|unpacked| {
            Library::load(unpacked).map_err(|error| match error {
                LoadError::Missing { function, .. } => missing(function, description.fmi),
                error => binary(&error),
            })
        });
        match loaded {
            Ok(library) => libraries.push((interface, library)),
            // One file may be the library of both.
            Err(problem) if problems.contains(&problem) => (),
            Err(problem) => {
                tell(Event::Found(problem.clone()));
                problems.push(problem);
            }
        }
    }
    let mut told = HashSet::new();
    for (interface, library) in &libraries {
        let own = description.model_identifier(*interface);
        let of_file = |other: &&Interface| description.model_identifier(**other) == own;
        let its_interfaces: Vec<Interface> = interfaces.iter().filter(of_file).copied().collect();
        for function in library.missing_functions(&its_interfaces).into_iter().filter(|name| told.insert(*name)) {
            tell(Event::Found(missing(function, description.fmi)));
        }
    }
    let library = |wanted| libraries.iter().find(|(interface, _)| *interface == wanted).map(|(_, library)| library);
    let co_simulation = library(Interface::CoSimulation);
    if let Some(library) = co_simulation {
        behavior::check(library, &description, &mut checked, tell);
        tell(Event::Checked(checked.clone()));
    }
    if let Some(library) = library(Interface::ModelExchange) {
        behavior::exchange::check(library, co_simulation, &description, &mut checked, tell);
        tell(Event::Checked(checked.clone()));
    }
}

fn missing(function: &str, fmi: FmiVersion) -> Finding {
    let message = format!("is not exported by the binary; all functions of FMI {fmi} have to be there");
    Finding::error(function, message)
}
