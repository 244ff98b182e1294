//! Runs without results, of whichever process executed them.

/// A run that failed. It has no results.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("run {run}{}: {message}", time.map_or(String::new(), |t| format!(", step from {t} s")))]
pub struct Failure {
    /// Id of the run.
    pub run: String,
    /// Start of the step that failed, s; `None` before the first step.
    pub time: Option<f64>,
    /// Name of the component, if one is the cause.
    pub component: Option<String>,
    /// Component, call, and what happened.
    pub message: String,
    /// What kind of failure it is.
    pub kind: FailureKind,
}

/// How a run failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FailureKind {
    /// It could not be begun, a call returned an error, or its file could not be written.
    Error,
    /// Its process ended.
    Crashed,
    /// A step took too long.
    TimedOut,
}
