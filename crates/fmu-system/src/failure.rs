//! Failures of runs, in this process or in a worker.

use crate::recording::Recording;
use serde::{Deserialize, Serialize};

/// A run that failed, or that an FMU ended before its stop time.
#[derive(Debug, Clone, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[error("run {run}{}: {message}", kind.place(*time, component.as_deref()))]
pub struct Failure {
    /// Id of the run.
    pub run: String,
    /// Start of the step that failed, time of the value that is not finite, or time at which an FMU ended the run, s; `None`
    /// before the first step.
    pub time: Option<f64>,
    /// Name of the component, if one is the cause.
    pub component: Option<String>,
    /// Name of the variable, if its value is the cause.
    pub variable: Option<Box<str>>,
    /// Component, call, and what happened.
    pub message: String,
    /// Kind of failure.
    pub kind: FailureKind,
    /// The rows before it; never those of a complete run.
    #[serde(skip)]
    pub recorded: Option<Box<Recording>>,
}

impl Failure {
    /// A run that could not be started or whose file could not be written.
    #[must_use]
    pub fn new(run: &str, message: String) -> Self {
        Self {
            run: run.to_owned(),
            time: None,
            component: None,
            variable: None,
            message,
            kind: FailureKind::Error,
            recorded: None,
        }
    }
}

/// Kind of failure of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum FailureKind {
    /// It could not be started, a call returned an error, or its file could not be written.
    Error,
    /// A signal is not finite.
    NotFinite,
    /// An FMU discarded a step.
    Discarded,
    /// An FMU ended the simulation, which is not an error.
    Terminated,
    /// Its process ended.
    Crashed,
    /// A step took too long.
    TimedOut,
}

impl FailureKind {
    /// Describes where a run failed, as part of a message. For a call, the message itself names the component.
    pub(crate) fn place(self, time: Option<f64>, component: Option<&str>) -> String {
        match (self, time) {
            (_, None) => String::new(),
            (Self::NotFinite, Some(time)) => format!(", at {time} s: `{}`", component.unwrap_or_default()),
            (Self::Terminated, Some(time)) => format!(", at {time} s"),
            (_, Some(time)) => format!(", step from {time} s"),
        }
    }
}
