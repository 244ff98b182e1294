//! Validates FMUs made with any tool: does the description keep the rules of FMI 2.0 for co-simulation, and does the
//! binary do what the description says?
//!
//! The rules of the description stand in FMI 2.0.4, section 2.2 and 4.3; `rules` goes through them. Validators that
//! only read XML cannot know whether a start value is the real one, whether an output really follows an input, or
//! whether a restored state goes on as before: `behavior` tries it out.

mod behavior;
mod rules;

use crate::archive::Archive;
use crate::description::{FmiVersion, Interface, ModelDescription};
use crate::loader::{self, Library, LoadError};
use crate::terminal;
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
            write!(f, "\nbinary: {instances} instances, {steps} steps: {}", trials.join(", "))?;
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

/// Checks what can be seen without running anything: a model description against the rules of FMI 2.0, and whether
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
        match loader::not_exported(library, parsed.fmi, &parsed.interfaces()) {
            Ok(functions) => findings.extend(functions.into_iter().map(|function| missing(function, parsed.fmi))),
            Err(error) => findings.push(Finding::error("binary", error.to_string())),
        }
    }
    findings
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
        unknowns: description.outputs.len() + description.derivatives.len() + description.initial_unknowns.len(),
        ..Checked::default()
    };
    tell(Event::Checked(checked.clone()));
    if description.co_simulation.is_none() {
        return tell(Event::Found(Finding::error("CoSimulation", "is missing: the FMU cannot be stepped by a master")));
    }
    tell(Event::Trying("loading the binary".to_owned()));
    let unpacked = match archive.unpack(&description, Interface::CoSimulation) {
        Ok(unpacked) => unpacked,
        Err(error) => return tell(Event::Found(Finding::error("binary", error.to_string()))),
    };
    match Library::load(unpacked) {
        Ok(library) => {
            for function in library.missing_functions(&description.interfaces()) {
                tell(Event::Found(missing(function, description.fmi)));
            }
            behavior::check(&library, &description, &mut checked, tell);
            tell(Event::Checked(checked.clone()));
        }
        Err(LoadError::Missing { function, .. }) => tell(Event::Found(missing(function, description.fmi))),
        Err(error) => tell(Event::Found(Finding::error("binary", error.to_string()))),
    }
}

fn missing(function: &str, fmi: FmiVersion) -> Finding {
    let message = format!("is not exported by the binary; all functions of FMI {fmi} have to be there");
    Finding::error(function, message)
}
