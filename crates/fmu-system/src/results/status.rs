//! The outcome of each run of a scenario: the file `status.json` beside their rows.

use super::file_name;
use crate::failure::{Failure, FailureKind};
use crate::run::Run;
use serde::Serialize;

/// Name of the file in the folder of the runs.
pub const STATUS_FILE: &str = "status.json";

/// Content of the file: the outcome of each run.
#[derive(Debug, Serialize)]
pub struct RunStatuses {
    /// Version of the file.
    format: u32,
    /// The runs in the order of the plan.
    pub runs: Vec<RunStatus>,
}

/// Outcome of a run. Only a run that is `completed` has the rows of a whole run.
#[derive(Debug, Serialize)]
pub struct RunStatus {
    run: String,
    /// Its file of rows; `None` if there is no row.
    file: Option<String>,
    status: &'static str,
    /// Time of the last row, s.
    end: Option<f64>,
    /// Start of the step that failed, time of the value that is not finite, or time at which an FMU ended the run, s.
    at: Option<f64>,
    component: Option<String>,
    message: Option<String>,
}

impl RunStatuses {
    /// The outcomes of some runs.
    #[must_use]
    pub fn new(runs: Vec<RunStatus>) -> Self {
        Self { format: 1, runs }
    }
}

impl RunStatus {
    /// A complete run, whose last row has this time, s.
    #[must_use]
    pub fn completed(run: &Run, end: Option<f64>) -> Self {
        Self {
            run: run.id.clone(),
            file: end.map(|_| file_name(run)),
            status: "completed",
            end,
            at: end,
            component: None,
            message: None,
        }
    }

    /// A run that is not complete.
    #[must_use]
    pub fn of(run: &Run, failure: &Failure) -> Self {
        let end = failure.recorded.as_ref().and_then(|recording| recording.time.last().copied());
        let status = match failure.kind {
            FailureKind::Terminated => "terminated",
            FailureKind::Discarded => "discarded",
            FailureKind::Error | FailureKind::NotFinite | FailureKind::Crashed | FailureKind::TimedOut => "failed",
        };
        let Failure { time, component, message, .. } = failure;
        let (component, message) = (component.clone(), Some(message.clone()));
        Self { status, at: *time, component, message, ..Self::completed(run, end) }
    }
}
