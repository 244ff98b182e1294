//! Failures of runs, in this process or in a worker.

use crate::fmus::FmusError;
use crate::run::Recording;
use fmu_import::fmu::FmuError;
use fmu_import::loader::{CallProblem, Status};
use serde::{Deserialize, Serialize};

/// A run that failed, or that an FMU ended before its stop time.
#[derive(Debug, Clone, Default, PartialEq, thiserror::Error, Serialize, Deserialize)]
#[error("run {run}{}: {message}", kind.place(*time, component.as_deref()))]
pub struct Failure {
    /// Id of the run.
    pub run: String,
    /// Start of the step that failed, time of the value that is not finite, or time at which an FMU ended the run, s;
    /// `None` before the first step.
    pub time: Option<f64>,
    /// Name of the component, if one is the cause.
    pub component: Option<String>,
    /// Name of the variable, if its value is the cause.
    pub variable: Option<Box<str>>,
    /// Component, call, and what happened.
    pub message: String,
    /// Kind of failure.
    pub kind: FailureKind,
    /// The rows recorded before the failure; never those of a complete run.
    #[serde(skip)]
    pub recorded: Option<Box<Recording>>,
}

impl Failure {
    pub(crate) fn of(run: &str, time: Option<f64>, cause: impl Into<FmusError>) -> Self {
        let cause = cause.into();
        let (component, variable, kind) = match &cause {
            FmusError::NotFinite { component, variable, .. } => {
                (Some(component), Some(variable), FailureKind::NotFinite)
            }
            FmusError::Steady { component, .. } => (Some(component), None, FailureKind::Error),
            FmusError::Fmu(FmuError::Call(call)) => {
                let kind = match &call.problem {
                    CallProblem::Terminated => FailureKind::Terminated,
                    CallProblem::Status(Status::Fatal) => FailureKind::Fatal,
                    _ if cause.discarded().is_some() => FailureKind::Discarded,
                    _ => FailureKind::Error,
                };
                (Some(&call.instance), None, kind)
            }
            _ => (None, None, FailureKind::Error),
        };
        let (component, variable) = (component.cloned(), variable.map(|name| name.as_str().into()));
        Self { time, component, variable, kind, ..Self::new(run, cause.to_string()) }
    }

    /// The status in tables: `rejected`, `diverged`, `crashed` or `timed_out`.
    pub fn status(&self) -> &'static str {
        match self.kind {
            FailureKind::Crashed => "crashed",
            FailureKind::TimedOut => "timed_out",
            _ if self.time.is_some() => "diverged",
            _ => "rejected",
        }
    }

    /// A run that could not be started or whose file could not be written.
    pub fn new(run: &str, message: String) -> Self {
        Self { run: run.to_owned(), message, ..Self::default() }
    }
}

/// Kind of failure of a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum FailureKind {
    /// The run could not be started, a call returned an error, or the file of the run could not be written.
    #[default]
    Error,
    /// A call returned `fmi2Fatal`: no instance of the FMU may be used again in this process.
    Fatal,
    /// A signal is not finite.
    NotFinite,
    /// An FMU discarded a step.
    Discarded,
    /// An FMU ended the simulation, which is not an error.
    Terminated,
    /// The worker process ended.
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
