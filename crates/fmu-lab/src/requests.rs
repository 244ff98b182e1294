//! Requests of the worker and their responses, with the names in `web/lab/src/protocol.ts`.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A request.
#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Request {
    /// Descriptions of FMUs by name, and texts of files by path. Response: [`Catalog`].
    Start {
        /// modelDescription.xml of each FMU.
        descriptions: BTreeMap<String, String>,
        /// Scenarios and the files they include.
        texts: BTreeMap<String, String>,
    },
    /// Reads an archive, which is the body. Response: [`Dropped`], the module is the body.
    Drop {
        /// Name of the file.
        name: String,
    },
    /// Adds an FMU whose module can be used. Response: [`Catalog`].
    Add {
        /// Its name.
        name: String,
        /// modelDescription.xml
        description: String,
    },
    /// Ends the systems that run and makes others. Response: [`Opened`], or [`Needs`].
    Open {
        /// The systems to simulate.
        setup: Setup,
        /// FMUs whose modules are there.
        modules: Vec<String>,
    },
    /// Goes to a time. Response: [`Sought`].
    Seek {
        /// Time, s.
        time: f64,
    },
    /// Sets a parameter or an input.
    Set {
        /// Index of the system; `None`: all that have it.
        system: Option<usize>,
        /// `component:variable`.
        adjustable: String,
        /// Value.
        value: f64,
    },
    /// Drives.
    Drive {
        /// Steering and pedals.
        driving: Driving,
    },
    /// Numbers of the runs so far. Response: list of [`Metric`].
    Metrics,
    /// The recording as CSV, which is the body.
    Csv {
        /// Index of the system.
        system: usize,
    },
    /// The system as SSP, which is the body.
    Ssp {
        /// Index of the system.
        system: usize,
    },
    /// Variables of an FMU. Response: list of [`VariableInfo`].
    Describe {
        /// Its name.
        fmu: String,
    },
}

/// Systems to simulate.
#[derive(Debug, Clone, Deserialize)]
pub struct Setup {
    /// The system.
    pub system: System,
    /// Values of parameters of the first system, by `component:parameter`.
    #[serde(default)]
    pub values: BTreeMap<String, f64>,
}

/// A system by its parts, or a scenario.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "kind", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub enum System {
    /// A vehicle with controllers, in a maneuver.
    Free {
        /// Plant.
        vehicle: String,
        /// Names of FMUs.
        controllers: Vec<String>,
        /// Id.
        maneuver: String,
        /// Values of the maneuver by id.
        #[serde(default)]
        maneuver_values: BTreeMap<String, f64>,
        /// Id.
        road: String,
        /// Seed of the road.
        #[serde(default)]
        seed: i32,
    },
    /// A scenario.
    Scenario {
        /// File stem.
        scenario: String,
        /// Name of a case.
        case: String,
        /// Name of another case.
        twin: Option<String>,
        /// Seed; any number for a scenario without seeds.
        #[serde(default)]
        seed: i32,
    },
}

/// Steering wheel from -1 (right) to 1 (left), pedals from 0 to 1.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
pub struct Driving {
    /// Steering wheel.
    pub steer: f64,
    /// Accelerator.
    pub throttle: f64,
    /// Brake.
    pub brake: f64,
}

/// Choices that the page offers.
#[derive(Debug, Default, Serialize)]
pub struct Catalog {
    /// Vehicles.
    pub vehicles: Vec<Vehicle>,
    /// Maneuvers.
    pub maneuvers: Vec<Maneuver>,
    /// Roads.
    pub roads: Vec<Choice>,
    /// Scenarios.
    pub scenarios: Vec<ScenarioEntry>,
}

/// One of several.
#[derive(Debug, Clone, Serialize)]
pub struct Choice {
    /// Id.
    pub id: String,
    /// Title.
    pub title: String,
}

impl Choice {
    pub(crate) fn new(id: &str, title: &str) -> Self {
        Self { id: id.to_owned(), title: title.to_owned() }
    }
}

/// A plant.
#[derive(Debug, Serialize)]
pub struct Vehicle {
    /// Name of the FMU.
    pub fmu: String,
    /// Title.
    pub title: String,
    /// FMUs that belong to it.
    pub base: Vec<String>,
    /// Controllers that fit.
    pub controllers: Vec<Controller>,
    /// Controllers of its paper.
    pub defaults: Vec<String>,
    /// Start values of Real parameters.
    pub parameters: BTreeMap<String, f64>,
    /// Names of outputs.
    pub outputs: Vec<String>,
    /// Ids of maneuvers.
    pub maneuvers: Vec<String>,
}

/// A controller.
#[derive(Debug, Serialize)]
pub struct Controller {
    /// Name of the FMU.
    pub fmu: String,
    /// Title.
    pub title: String,
    /// Controllers whose outputs it reads.
    pub needs: Vec<String>,
    /// Controllers that write the same signals.
    pub excludes: Vec<String>,
}

/// A maneuver.
#[derive(Debug, Serialize)]
pub struct Maneuver {
    /// Id.
    pub id: String,
    /// Title.
    pub title: String,
    /// `bench` or `free`.
    pub kind: &'static str,
    /// Values to choose.
    pub values: Vec<Adjustable>,
}

/// A scenario.
#[derive(Debug, Serialize)]
pub struct ScenarioEntry {
    /// File stem.
    pub id: String,
    /// Title.
    pub title: String,
    /// Plant.
    pub vehicle: String,
    /// Cases.
    pub cases: Vec<Choice>,
    /// Seeds.
    pub seeds: Vec<i32>,
}

/// A number with limits.
#[derive(Debug, Clone, Serialize)]
pub struct Adjustable {
    /// Id.
    pub id: String,
    /// Title.
    pub title: String,
    /// Unit of measure.
    pub unit: String,
    /// Least value.
    pub min: f64,
    /// Greatest value.
    pub max: f64,
    /// Value.
    pub value: f64,
    /// Unit to show it in.
    pub display: Display,
}

/// A unit to show values in, and the factor to it.
#[derive(Debug, Clone, Serialize)]
pub struct Display {
    /// Name.
    pub unit: String,
    /// Factor.
    pub factor: f64,
}

impl Display {
    pub(crate) fn new(unit: &str, factor: f64) -> Self {
        Self { unit: unit.to_owned(), factor }
    }
}

/// FMUs whose modules are needed first.
#[derive(Debug, Serialize)]
pub struct Needs {
    /// Their names.
    pub missing: Vec<String>,
}

/// Systems that were made.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct Opened {
    /// Communication step, s.
    pub step: f64,
    /// End, s.
    pub stop: f64,
    /// Time between two rows, s.
    pub row_step: f64,
    /// The first is the visitor's.
    pub systems: Vec<SystemInfo>,
    /// Middle line of the path.
    pub path: Vec<[f64; 2]>,
    /// Sections of cones.
    pub cones: Vec<[f64; 4]>,
    /// FMUs.
    pub origin: Vec<Origin>,
}

/// A system.
#[derive(Debug, Serialize)]
pub struct SystemInfo {
    /// Title.
    pub title: String,
    /// Plant.
    pub vehicle: String,
    /// Components in order of execution.
    pub components: Vec<ComponentInfo>,
    /// Columns of the rows.
    pub columns: Vec<Column>,
    /// Values that may change.
    pub adjustables: Vec<Adjustable>,
}

/// A component.
#[derive(Debug, Serialize)]
pub struct ComponentInfo {
    /// Name.
    pub name: String,
    /// Name of its FMU.
    pub fmu: String,
}

/// A column of the rows.
#[derive(Debug, Clone, Serialize)]
pub struct Column {
    /// Name.
    pub name: String,
    /// Description.
    pub description: String,
    /// Unit of measure.
    pub unit: String,
    /// Unit to show it in.
    pub display: Display,
}

/// Version of an FMU.
#[derive(Debug, Serialize)]
pub struct Origin {
    /// Name.
    pub fmu: String,
    /// Version.
    pub version: String,
    /// GUID.
    pub guid: String,
}

/// The time after a seek.
#[derive(Debug, Serialize)]
pub struct Sought {
    /// Time, s.
    pub time: f64,
}

/// A number of a run.
#[derive(Debug, Serialize)]
pub struct Metric {
    /// Id.
    pub id: String,
    /// Title.
    pub title: String,
    /// Unit of measure.
    pub unit: String,
    /// Definition.
    pub definition: String,
    /// One for each system.
    pub values: Vec<Option<MetricValue>>,
    /// Reason that the first system has no number.
    pub reason: String,
    /// `pass`, `fail` or `info`, of the first system.
    pub verdict: Option<&'static str>,
}

/// Value of a metric.
#[derive(Debug, Clone, Copy, Serialize)]
#[serde(untagged)]
pub enum MetricValue {
    /// A number.
    Number(f64),
    /// Yes or no.
    Boolean(bool),
}

/// An FMU that was dropped.
#[derive(Debug, Serialize)]
pub struct Dropped {
    /// Its name.
    pub name: String,
    /// modelDescription.xml
    pub description: String,
    /// documentation/index.html
    pub documentation: String,
}

/// A variable.
#[derive(Debug, Serialize)]
pub struct VariableInfo {
    /// Name.
    pub name: String,
    /// Role.
    pub causality: String,
    /// Unit of measure.
    pub unit: String,
    /// Start value.
    pub start: String,
    /// Description.
    pub description: String,
}

/// A failed request.
#[derive(Debug, Serialize)]
pub struct Failure {
    /// Message.
    pub message: String,
    /// Remedy.
    pub help: String,
}

impl Failure {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), help: String::new() }
    }

    pub(crate) fn with_help(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self { message: message.into(), help: help.into() }
    }
}
