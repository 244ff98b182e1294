//! Requests of the worker and their responses, with the names in `web/lab/src/protocol.ts`.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub(crate) enum Request {
    /// Provides the descriptions of FMUs by name, and the texts of files by path. Response: `Catalog`.
    Start {
        descriptions: BTreeMap<String, String>,
        texts: BTreeMap<String, String>,
    },
    /// Reads an archive, which is the body of the request. Response: name and description; its body is the module.
    Drop {
        name: String,
    },
    /// Adds an FMU whose module can be used. Response: `Catalog`.
    Add {
        name: String,
        description: String,
    },
    /// Ends the running systems and opens new ones. Response: `Opened`, or `Needs`.
    Open {
        setup: Setup,
        /// FMUs whose modules the worker has loaded.
        modules: Vec<String>,
    },
    /// Rewinds all systems to a time. Response: `Sought`.
    Seek {
        time: f64,
    },
    Set {
        /// Index of the system; `None` for all systems that have the adjustable number.
        system: Option<usize>,
        adjustable: String,
        value: f64,
    },
    Drive {
        driving: Driving,
    },
    /// Metrics of the runs so far. Response: list of [`Metric`].
    Metrics,
    /// Writes the recording as CSV, which is the body of the response.
    Csv {
        system: usize,
    },
    /// Writes the system as SSP, which is the body of the response.
    Ssp {
        system: usize,
    },
    /// Variables of an FMU. Response: list of `VariableInfo`.
    Describe {
        fmu: String,
    },
}

#[derive(Debug, Clone, Deserialize)]
pub(crate) struct Setup {
    pub(crate) system: System,
    /// Values of parameters of the first system, by `component:parameter`.
    #[serde(default)]
    pub(crate) values: BTreeMap<String, f64>,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(crate) enum System {
    Free {
        vehicle: String,
        controllers: Vec<String>,
        maneuver: String,
        #[serde(default)]
        maneuver_values: BTreeMap<String, f64>,
        road: String,
        #[serde(default)]
        seed: i32,
    },
    Scenario {
        scenario: String,
        case: String,
        twin: Option<String>,
        /// Seed; any number for a scenario without seeds.
        #[serde(default)]
        seed: i32,
    },
}

/// Steering wheel from -1 (right) to 1 (left), pedals from 0 to 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
pub(crate) struct Driving {
    pub(crate) steer: f64,
    pub(crate) throttle: f64,
    pub(crate) brake: f64,
}

#[derive(Debug, Default, Serialize)]
pub(crate) struct Vehicle {
    pub(crate) fmu: String,
    pub(crate) title: String,
    pub(crate) controllers: Vec<Controller>,
    pub(crate) defaults: Vec<String>,
    pub(crate) parameters: BTreeMap<String, f64>,
    pub(crate) outputs: Vec<String>,
    pub(crate) maneuvers: Vec<String>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Controller {
    pub(crate) fmu: String,
    pub(crate) title: String,
    pub(crate) needs: Vec<String>,
    pub(crate) excludes: Vec<String>,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Adjustable {
    pub(crate) id: String,
    pub(crate) title: String,
    pub(crate) unit: String,
    pub(crate) min: f64,
    pub(crate) max: f64,
    pub(crate) value: f64,
    pub(crate) display: Display,
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Display {
    pub(crate) unit: String,
    pub(crate) factor: f64,
}

impl Display {
    pub(crate) fn new(unit: &str, factor: f64) -> Self {
        Self { unit: unit.to_owned(), factor }
    }
}

#[derive(Debug, Clone, Serialize)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) description: String,
    pub(crate) unit: String,
    pub(crate) display: Display,
}

#[derive(Debug, Serialize)]
pub(crate) struct Metric {
    pub(crate) id: String,
    pub(crate) title: String,
    pub(crate) unit: String,
    pub(crate) definition: String,
    pub(crate) values: Vec<Value>,
    pub(crate) reason: String,
    /// `pass`, `fail` or `info`, for the first system.
    pub(crate) verdict: Option<&'static str>,
}

#[derive(Debug, Serialize)]
pub(crate) struct Failure {
    pub(crate) message: String,
    pub(crate) help: String,
}

impl Failure {
    pub(crate) fn new(message: impl ToString) -> Self {
        Self { message: message.to_string(), help: String::new() }
    }

    pub(crate) fn with_help(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into() }
    }
}
