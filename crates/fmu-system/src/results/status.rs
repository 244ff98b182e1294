//! The outcome of each run of a scenario: the file `status.json` next to the CSV files.

use super::file_name;
use crate::failure::{Failure, FailureKind};
use crate::run::{RealTime, Recording, Run, StepCounts};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Name of the file in the folder of the runs.
pub const STATUS_FILE: &str = "status.json";

/// Content of the file: the outcome of each run.
#[derive(Debug, Serialize, Deserialize)]
pub struct RunStatuses {
    /// Version of the file.
    format: u32,
    /// The runs in the order of the plan.
    pub runs: Vec<RunStatus>,
}

/// Outcome of a run. Only a `completed` run has all its rows.
#[derive(Debug, Serialize, Deserialize)]
pub struct RunStatus {
    /// Id of the run.
    pub run: String,
    /// Name of its CSV file; `None` if no row was recorded.
    pub file: Option<String>,
    /// `completed`, `terminated` by an FMU, `discarded` or `failed`.
    pub status: Cow<'static, str>,
    /// Time of the last row, s.
    pub end: Option<f64>,
    /// Start of the step that failed, time of the value that is not finite, or time at which an FMU ended the run, s.
    at: Option<f64>,
    component: Option<String>,
    message: Option<String>,
    /// Only for a run in real time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub real_time: Option<RealTime>,
    /// Numbers of steps under error control, or with shorter steps instead of discarded ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steps: Option<StepCounts>,
}

impl RunStatuses {
    /// The outcomes of some runs.
    pub fn new(runs: Vec<RunStatus>) -> Self {
        Self { format: 1, runs }
    }
}

impl RunStatus {
    /// A complete run with these rows.
    pub fn completed(run: &Run, recording: Option<&Recording>) -> Self {
        let end = recording.and_then(|recording| recording.time.last().copied());
        Self {
            run: run.id.clone(),
            file: end.map(|_| file_name(run)),
            status: Cow::Borrowed("completed"),
            end,
            at: end,
            component: None,
            message: None,
            real_time: recording.and_then(|recording| recording.real_time),
            steps: recording.and_then(|recording| recording.steps),
        }
    }

    /// Reason that the run is not complete.
    pub fn reason(&self) -> &str {
        self.message.as_deref().unwrap_or(&self.status)
    }

    /// A run that is not complete.
    pub fn of(run: &Run, failure: &Failure) -> Self {
        let status = match failure.kind {
            FailureKind::Terminated => "terminated",
            FailureKind::Discarded => "discarded",
            _ => "failed",
        };
        let Failure { time, component, message, .. } = failure;
        let (component, message) = (component.clone(), Some(message.clone()));
        Self {
            status: Cow::Borrowed(status),
            at: *time,
            component,
            message,
            ..Self::completed(run, failure.recorded.as_deref())
        }
    }
}
