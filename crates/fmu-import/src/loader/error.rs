//! Statuses, messages and errors when libraries are loaded and functions are called.

use crate::c_api::RawStatus;
use crate::description::Interface;
use crate::terminal;
use std::path::{Path, PathBuf};

/// Error while loading a library.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// A function of the interface is missing.
    #[error("{} does not export {function}", path.display())]
    Missing {
        /// The library.
        path: PathBuf,
        /// Name of the function.
        function: &'static str,
    },
    /// The library was built for other types or another FMI version.
    #[error("{0}")]
    Version(String),
    /// The system cannot load the library, its model declarations are inconsistent, or it needs Python.
    #[error("{0}")]
    Other(String),
}

impl LoadError {
    pub(super) fn of_system(path: &Path, reason: impl std::fmt::Display) -> Self {
        Self::Other(format!("cannot load {}: {reason}", path.display()))
    }
}

/// `fmi2Status` or `fmi3Status`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Status {
    /// Success.
    Ok,
    /// Done, with a warning.
    Warning,
    /// Not done; the instance can continue.
    Discard,
    /// Failed; the instance can be freed or reset.
    Error,
    /// Failed; no instance of the FMU can be used afterwards.
    Fatal,
    /// Not done yet.
    Pending,
    /// A number that FMI does not define.
    Unknown(RawStatus),
}

/// The statuses, ordered by number, with their names.
const STATUSES: [(Status, &str); 6] = [
    (Status::Ok, "OK"),
    (Status::Warning, "Warning"),
    (Status::Discard, "Discard"),
    (Status::Error, "Error"),
    (Status::Fatal, "Fatal"),
    (Status::Pending, "Pending"),
];

impl From<RawStatus> for Status {
    fn from(raw: RawStatus) -> Self {
        let known = usize::try_from(raw).ok().and_then(|number| STATUSES.get(number));
        known.map_or(Self::Unknown(raw), |(status, _)| *status)
    }
}

impl Status {
    fn name(self, function: &str) -> String {
        if let Self::Unknown(raw) = self {
            return format!("the unknown status {raw}");
        }
        let name = STATUSES.iter().find(|(status, _)| *status == self).map_or("", |(_, name)| name);
        format!("{}{name}", if function.starts_with("fmi3") { "fmi3" } else { "fmi2" })
    }
}

/// A message that an instance logged.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Message {
    /// Severity.
    pub status: Status,
    /// Category, empty if none was given.
    pub category: String,
    /// Text. In FMI 2.0 it contains the arguments, unless this crate was built without a C compiler for its target.
    pub text: String,
}

/// Cause of a [`CallError`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum CallProblem {
    /// The FMU returned this status.
    Status(Status),
    /// The FMU returned no instance.
    NoInstance,
    /// The FMU does not export the function.
    NotExported,
    /// The instance was created for this interface, which does not have the function.
    Interface(Interface),
    /// The step was taken and the FMU ended the simulation (FMI 3.0; in FMI 2.0 such a step is discarded).
    Terminated,
    /// The step ended early, although this was not allowed (FMI 3.0).
    EarlyReturn,
    /// The arguments are invalid; the FMU was not called.
    Arguments(&'static str),
    /// An event or the integration of the states cannot be completed for this reason.
    Events(String),
    /// A previous call returned `fmi2Fatal` or `fmi3Fatal`; the FMU was not called.
    Dead,
}

/// A call that failed. Boxed, so that results of calls that succeed fit in a register.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CallError(Box<FailedCall>);

impl std::ops::Deref for CallError {
    type Target = FailedCall;

    fn deref(&self) -> &FailedCall {
        &self.0
    }
}

impl std::ops::DerefMut for CallError {
    fn deref_mut(&mut self) -> &mut FailedCall {
        &mut self.0
    }
}

impl From<FailedCall> for CallError {
    fn from(call: FailedCall) -> Self {
        Self(Box::new(call))
    }
}

/// Details of a call that failed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FailedCall {
    /// Name of the instance.
    pub instance: String,
    /// Name of the C function.
    pub function: &'static str,
    /// Cause of the error.
    pub problem: CallProblem,
    /// Messages of the instance since its messages were last taken, including those from this call.
    pub messages: Vec<Message>,
}

impl CallError {
    /// Returns true if the FMU cannot provide the value, such as the derivative of a square root at 0, but can
    /// continue.
    pub fn is_discarded(&self) -> bool {
        self.problem == CallProblem::Status(Status::Discard)
    }
}

impl std::error::Error for CallError {}

impl std::fmt::Display for CallError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let FailedCall { instance, function, .. } = &**self;
        write!(f, "`{instance}`: ")?;
        match &self.problem {
            CallProblem::Status(status) => write!(f, "{function} returned {}", status.name(function)),
            CallProblem::NoInstance => write!(f, "{function} returned no instance"),
            CallProblem::NotExported => write!(f, "the FMU does not export {function}"),
            CallProblem::Interface(interface) => {
                write!(f, "{function} is not a function of {interface}, for which the instance was created")
            }
            CallProblem::Terminated => write!(f, "the FMU ended the simulation in {function}"),
            CallProblem::EarlyReturn => {
                write!(f, "{function} returned before the end of the step, which was not allowed")
            }
            CallProblem::Arguments(reason) => write!(f, "{function}: {reason}"),
            CallProblem::Events(reason) => write!(f, "{function}: {reason}"),
            CallProblem::Dead => write!(f, "{function} cannot be called after {}", Status::Fatal.name(function)),
        }?;
        for message in &self.messages {
            // Indented, because a line within a message must not look like a message.
            write!(f, "\n  {}: {}", message.status.name(function), terminal::indented(&message.text, "    "))?;
        }
        Ok(())
    }
}
