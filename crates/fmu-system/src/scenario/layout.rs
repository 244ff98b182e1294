//! The layout of a scenario file.

use crate::metrics::{Combine, Kind};
use crate::report::{Expect, FigureKind, Level};
use crate::run::{ErrorControl, Extrapolation, Iteration, Order, StepArgument};
use crate::spanned::Spanned;
use fmu_import::bytes::BinaryText;
use fmu_import::loader::Method;
use fmu_import::temporary::Folder;
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Variable or pattern -> value as written.
pub(crate) type Values = BTreeMap<Spanned<String>, Spanned<Given>>;
/// Component -> values.
pub(crate) type ValuesByComponent = BTreeMap<Spanned<String>, Values>;

/// Value of a variable: a number, a Boolean, a String, the name of an enumeration's value, a number with its unit, the
/// bytes of a Binary (a text in Base64, or a file), or a list with the values of an array.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(transparent)]
pub(crate) struct Given(#[schemars(schema_with = "forms_of_values")] pub(crate) toml::Value);

fn forms_of_values(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "anyOf": [{ "type": ["number", "boolean", "string", "array"] }, {
        "type": "object",
        "properties": {
            "value": { "type": "number", "description": "The number." },
            "unit": { "type": "string", "description": "Unit of the value: that of the variable or a display unit." }
        },
        "required": ["value", "unit"],
        "additionalProperties": false
    }, {
        "type": "object",
        "properties": {
            "file": { "type": "string", "description": "Path of a file with the bytes, relative to the scenario." }
        },
        "required": ["file"],
        "additionalProperties": false
    }, {
        "type": "object",
        "properties": { "hex": { "type": "string", "description": "The bytes as hexadecimal digits." } },
        "required": ["hex"],
        "additionalProperties": false
    }] })
}

/// A scenario: the content of its file and of the files that it includes.
#[derive(Debug)]
pub(crate) struct Scenario {
    pub(crate) title: String,
    pub(crate) description: String,
    pub(crate) reference: String,
    /// Path of a parameter set of `component:parameter` names, relative to the scenario.
    pub(crate) parameter_set: Option<Spanned<String>>,
    pub(crate) simulation: Simulation,
    /// False: only explicit connections.
    pub(crate) connect_by_name: bool,
    /// Folders with the FMUs of included SSP files.
    pub(crate) fmus: Vec<Arc<Folder>>,
    pub(crate) components: Vec<Component>,
    pub(crate) connections: Vec<Connection>,
    pub(crate) cases: Vec<Case>,
    pub(crate) points: Vec<Point>,
    pub(crate) sweep: Option<Spanned<Sweep>>,
    pub(crate) seeds: Option<Seeds>,
    pub(crate) record: Record,
    pub(crate) metrics: Vec<Metric>,
    pub(crate) figures: Vec<Figure>,
    pub(crate) findings: Vec<WrittenFinding>,
}

/// A scenario, or a part of scenarios that they include.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Written {
    /// Paths of files with parts of the scenario, relative to this one: scenarios, or systems in SSP files.
    #[serde(default)]
    pub(crate) include: Vec<Spanned<String>>,
    /// Title.
    pub(crate) title: Option<Spanned<String>>,
    /// Description; an empty line begins a new paragraph.
    pub(crate) description: Option<Spanned<String>>,
    /// Source, such as a paper.
    pub(crate) reference: Option<Spanned<String>>,
    /// SSP parameter set with names `component.parameter`; path relative to this file.
    pub(crate) parameter_set: Option<Spanned<String>>,
    /// Parameters that override those of the components.
    #[serde(default)]
    pub(crate) parameters: ValuesByComponent,
    /// Times of the simulation.
    pub(crate) simulation: Option<Simulation>,
    /// False: outputs and inputs with the same name are not connected, only those of connections; true if absent.
    pub(crate) connect_by_name: Option<bool>,
    /// Components in the order of execution, plants last.
    #[serde(rename = "component", default)]
    pub(crate) components: Vec<Component>,
    /// Connections in addition to those between signals with the same name.
    #[serde(rename = "connection", default)]
    pub(crate) connections: Vec<Connection>,
    /// Variants of the system that are compared.
    #[serde(rename = "case", default)]
    pub(crate) cases: Vec<Case>,
    /// Points of the sweep, listed one by one.
    #[serde(rename = "point", default)]
    pub(crate) points: Vec<Point>,
    /// Axis of a sweep.
    pub(crate) sweep: Option<Spanned<Sweep>>,
    /// Seeds of random numbers: each case runs once with each.
    pub(crate) seeds: Option<Seeds>,
    /// Recorded signals.
    pub(crate) record: Option<Record>,
    /// Numbers computed from signals or from other metrics.
    #[serde(rename = "metric", default)]
    pub(crate) metrics: Vec<Metric>,
    /// Figures of the page.
    #[serde(rename = "figure", default)]
    pub(crate) figures: Vec<Figure>,
    /// Claims that the runs confirm or refute.
    #[serde(rename = "finding", default)]
    pub(crate) findings: Vec<WrittenFinding>,
}

/// Times of a simulation.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Simulation {
    /// Start, s; 0 if absent.
    pub(crate) start: Option<Spanned<f64>>,
    /// End, s.
    pub(crate) stop: Spanned<f64>,
    /// Communication step, s; (stop - start)/step must be whole.
    pub(crate) step: Spanned<f64>,
    /// Order of the components within a step; sequential if absent.
    pub(crate) order: Option<Order>,
    /// Inputs within a step: hold (default) or linear.
    pub(crate) extrapolation: Option<Spanned<Extrapolation>>,
    /// Size of the steps that FMUs are asked to make: constant (default) or difference.
    pub(crate) step_argument: Option<StepArgument>,
    /// Iteration of each step.
    pub(crate) iterate: Option<Spanned<Iteration>>,
    /// Steps of continuous components that are chosen by their error.
    pub(crate) error_control: Option<Spanned<ErrorControl>>,
}

/// An FMU in the system.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Component {
    /// Name, lower snake case.
    pub(crate) name: Spanned<String>,
    /// File name of the FMU without `.fmu`.
    pub(crate) fmu: Spanned<String>,
    /// Path of a parameter set of `parameter` names, relative to the scenario.
    pub(crate) parameter_set: Option<Spanned<String>>,
    /// Structural parameters by name (FMI 3.0), which set the sizes of arrays.
    #[serde(default)]
    pub(crate) structure: Values,
    /// Parameters and start values by name.
    #[serde(default)]
    pub(crate) parameters: Values,
    /// Constants for inputs that no component writes; `*` stands for any characters.
    #[serde(default)]
    pub(crate) inputs: Values,
    /// Start values: declared (default) or steady.
    pub(crate) start: Option<Spanned<Start>>,
    /// Whether it takes samples (discrete) or not (continuous); by default, discrete if all its outputs are.
    pub(crate) kind: Option<Spanned<ComponentKind>>,
    /// Number of communication steps in one step of the component; 1 if absent.
    pub(crate) every: Option<Spanned<i64>>,
    /// Number of its steps in a communication step; 1 if absent.
    pub(crate) substeps: Option<Spanned<i64>>,
    /// Interface of the FMU; by default, the first that it has.
    pub(crate) interface: Option<Spanned<ComponentInterface>>,
    /// Solver of a component in model exchange; dormand_prince if absent.
    pub(crate) solver: Option<Spanned<Method>>,
    /// Relative error of a step of the solver; 1e-6 if absent.
    pub(crate) tolerance: Option<Spanned<f64>>,
    /// Longest step of the solver runge_kutta, s.
    pub(crate) max_step: Option<Spanned<f64>>,
}

impl Component {
    /// `every` and `substeps`, which are checked to be at least 1.
    pub(crate) fn rates(&self) -> [u64; 2] {
        [&self.every, &self.substeps].map(|rate| rate.as_ref().map_or(1, |rate| rate.unsigned_abs()))
    }
}

/// Interface of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ComponentInterface {
    /// The FMU advances its own states.
    CoSimulation,
    /// The master integrates the states of the FMU.
    ModelExchange,
}

/// Kind of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum ComponentKind {
    /// It reads its inputs at the start of a step, and its outputs hold until the next sample.
    Discrete,
    /// Its outputs change continuously.
    Continuous,
}

/// Start values of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Start {
    /// The declared start values.
    Declared,
    /// The steady state for the inputs at the start of the run.
    Steady,
}

/// A connection of an output to an input.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Connection {
    /// Output, as `component:variable`; one `*` stands for any characters.
    pub(crate) from: Spanned<String>,
    /// Input, as `component:variable`; the same characters replace its `*`.
    pub(crate) to: Spanned<String>,
    /// Factor of the value, after the conversion of units: 1 if absent.
    pub(crate) factor: Option<Spanned<f64>>,
    /// Offset of the value, after the factor, in the unit of the input: 0 if absent.
    pub(crate) offset: Option<Spanned<f64>>,
    /// False: units are not converted.
    pub(crate) convert: Option<bool>,
}

/// A variant of the system.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Case {
    /// Name, lower snake case.
    pub(crate) name: Spanned<String>,
    /// Title.
    pub(crate) title: String,
    /// Case that changes in percent refer to.
    pub(crate) baseline: Option<Spanned<String>>,
    /// Path of a parameter set of `component:parameter` names, relative to the scenario.
    pub(crate) parameter_set: Option<Spanned<String>>,
    /// Parameters by component, which override those of the components.
    #[serde(default)]
    pub(crate) parameters: ValuesByComponent,
    /// Other FMUs by component.
    #[serde(default)]
    pub(crate) fmu: BTreeMap<Spanned<String>, Spanned<Replacement>>,
    /// Components that are left out.
    #[serde(default)]
    pub(crate) without: Vec<Spanned<String>>,
    /// Constants of inputs by component.
    #[serde(default)]
    pub(crate) inputs: ValuesByComponent,
}

/// Another FMU for a component: `"Name"`, or `{ fmu = "Name", keep_parameters = true }`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, remote = "Self")]
pub(crate) struct Replacement {
    pub(crate) fmu: String,
    /// True if the other FMU gets the component's parameters, as far as it has them.
    #[serde(default)]
    pub(crate) keep_parameters: bool,
}

impl JsonSchema for Replacement {
    fn schema_name() -> Cow<'static, str> {
        "Replacement".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "description": "Another FMU for a component.", "anyOf": [{ "type": "string" }, {
            "type": "object",
            "properties": {
                "fmu": { "type": "string", "description": "File name of the FMU without `.fmu`." },
                "keep_parameters": {
                    "type": "boolean",
                    "description": "True if the other FMU gets the component's parameters, as far as it has them."
                }
            },
            "required": ["fmu"],
            "additionalProperties": false
        }] })
    }
}

impl<'de> Deserialize<'de> for Replacement {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Replacement;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the name of an FMU or { fmu = \"Name\", keep_parameters = true }")
            }

            fn visit_str<E>(self, fmu: &str) -> Result<Replacement, E> {
                Ok(Replacement { fmu: fmu.to_string(), keep_parameters: false })
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Replacement, A::Error> {
                Replacement::deserialize(MapAccessDeserializer::new(map))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// A point of a sweep.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Point {
    /// Name, lower snake case.
    pub(crate) name: Spanned<String>,
    /// Title.
    pub(crate) title: String,
    /// Value on the axis of the sweep.
    pub(crate) value: Spanned<f64>,
    /// Value on the second axis of the sweep.
    pub(crate) second: Option<Spanned<f64>>,
    /// Parameters by component.
    #[serde(default)]
    pub(crate) parameters: ValuesByComponent,
}

/// The axis of a sweep.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sweep {
    /// Title of the axis.
    pub(crate) title: String,
    /// Unit of the values.
    pub(crate) unit: String,
    /// Parameter that takes the values, as `component:parameter`; the points are then generated from the values.
    pub(crate) parameter: Option<Spanned<String>>,
    /// Values of the parameter, instead of points one by one.
    pub(crate) values: Option<Spanned<Vec<f64>>>,
    /// Second axis.
    pub(crate) second: Option<Spanned<SecondSweep>>,
}

/// The second axis of a sweep over the values of two parameters.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SecondSweep {
    /// Title of the axis.
    pub(crate) title: String,
    /// Unit of the values.
    pub(crate) unit: String,
    /// Parameter that takes the values, as `component:parameter`.
    pub(crate) parameter: Option<Spanned<String>>,
    /// Values of the parameter.
    pub(crate) values: Option<Spanned<Vec<f64>>>,
}

/// Seeds of random numbers.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Seeds {
    /// Parameter that takes the seeds, as `component:parameter`.
    pub(crate) parameter: Spanned<String>,
    /// Seeds.
    pub(crate) values: Spanned<Vec<Spanned<i32>>>,
}

/// Recorded signals.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Record {
    /// Outputs as `component:signal`, `component:pattern`, or a pattern for all components.
    pub(crate) signals: Vec<Spanned<String>>,
    /// Number of steps between two rows; 1 if absent.
    pub(crate) every: Option<Spanned<i64>>,
    /// Text of Binaries in the file: base64 (default) or hex.
    pub(crate) binary: Option<BinaryText>,
}

/// A number computed from each run.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Metric {
    /// Name, lower snake case.
    pub(crate) name: Spanned<String>,
    /// Title.
    pub(crate) title: String,
    /// Signal, as `component:variable`.
    pub(crate) signal: Option<Spanned<String>>,
    /// Several signals that are combined row by row.
    #[serde(default)]
    pub(crate) signals: Vec<Spanned<String>>,
    /// Combination of the signals.
    pub(crate) combine: Option<Spanned<Combine>>,
    /// Weights of the signals.
    pub(crate) weights: Option<Spanned<Vec<f64>>>,
    /// Kind of number computed from the signal.
    pub(crate) kind: Option<Kind>,
    /// Formula with other metrics, instead of signals and a kind.
    pub(crate) value: Option<Spanned<String>>,
    /// Level that the kind refers to, in `unit`.
    pub(crate) threshold: Option<Spanned<f64>>,
    /// Frequencies that the kind refers to, Hz.
    pub(crate) band: Option<Spanned<[f64; 2]>>,
    /// First and last time, s; the whole run if absent.
    pub(crate) window: Option<Spanned<[f64; 2]>>,
    /// Condition that ends the window early.
    pub(crate) until: Option<Spanned<Until>>,
    /// Signal that is subtracted first.
    pub(crate) minus: Option<Spanned<String>>,
    /// True if the signal of the baseline's run is subtracted first.
    #[serde(default)]
    pub(crate) from_baseline: bool,
    /// Unit of the signal: its own or a display unit.
    pub(crate) unit: Option<Spanned<String>>,
    /// Decimal places shown.
    pub(crate) digits: Option<Spanned<u8>>,
    /// Numbers from the paper.
    pub(crate) paper: Option<Paper>,
    /// Required minimum, in `unit`.
    pub(crate) min: Option<Spanned<f64>>,
    /// Required maximum, in `unit`.
    pub(crate) max: Option<Spanned<f64>>,
    /// Cases that must meet the requirement; all if absent.
    pub(crate) required_of: Option<Spanned<Vec<Spanned<String>>>>,
    /// Share of the runs that must meet the requirement, above 0 and up to 1; 1 if absent.
    pub(crate) share: Option<Spanned<f64>>,
    /// Source of the requirement.
    pub(crate) required_by: Option<Spanned<String>>,
}

/// A condition on a signal.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Until {
    /// Signal, as `component:variable`.
    pub(crate) signal: Spanned<String>,
    /// The window ends where the signal is above this level.
    pub(crate) above: Option<f64>,
    /// The window ends where the signal is below this level.
    pub(crate) below: Option<f64>,
    /// Unit of the level: that of the signal or a display unit.
    pub(crate) unit: Option<Spanned<String>>,
}

/// Numbers printed in a paper.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Paper {
    /// Table or place in the paper.
    pub(crate) table: Option<String>,
    /// Values by `case`, or `case@point` with a sweep.
    #[serde(default)]
    pub(crate) values: BTreeMap<Spanned<String>, f64>,
    /// Changes in percent where the paper gives no values, by cell or by two cells.
    #[serde(default)]
    pub(crate) changes: BTreeMap<Spanned<String>, f64>,
    /// Keys of the values used for calibration; the other values are then predictions.
    pub(crate) calibrated: Option<Vec<Spanned<String>>>,
}

/// A figure.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct Figure {
    /// File name without extension.
    pub(crate) name: Spanned<String>,
    /// Title.
    pub(crate) title: String,
    /// What the figure shows.
    pub(crate) kind: FigureKind,
    /// Cases shown; all if absent.
    pub(crate) cases: Option<Spanned<Vec<Spanned<String>>>>,
    /// True for a panel for every case; kind time only.
    pub(crate) separate: Option<Spanned<bool>>,
    /// Signals, for kinds that show signals.
    #[serde(default)]
    pub(crate) signals: Vec<Spanned<String>>,
    /// Signal drawn dashed in every panel; kind time only.
    pub(crate) against: Option<Spanned<String>>,
    /// Signal drawn over a second vertical axis.
    pub(crate) right: Option<Spanned<String>>,
    /// Signal or metric on the abscissa.
    pub(crate) over: Option<Spanned<String>>,
    /// True if all panels have the same scales; kinds time, spectrum and xy only.
    pub(crate) same_scale: Option<Spanned<bool>>,
    /// True if both axes have the same scale; kind xy only.
    pub(crate) equal_axes: Option<Spanned<bool>>,
    /// Frequencies shown, Hz.
    pub(crate) band: Option<Spanned<[f64; 2]>>,
    /// Metrics, for kinds that show metrics.
    #[serde(default)]
    pub(crate) metrics: Vec<Spanned<String>>,
    /// Times shown or used, s.
    pub(crate) window: Option<Spanned<[f64; 2]>>,
    /// Unit of the signals.
    pub(crate) unit: Option<Spanned<String>>,
    /// Lines in every panel; kind time only.
    #[serde(default)]
    pub(crate) levels: Vec<Spanned<Level>>,
    /// Caption; `{cell:format}` inserts a number.
    pub(crate) caption: Option<Spanned<String>>,
}

/// `[[finding]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct WrittenFinding {
    /// Claim of the paper; `{cell:format}` inserts a number.
    pub(crate) claim: Spanned<String>,
    /// What the runs show, and why.
    pub(crate) explanation: Spanned<String>,
    /// True if no paper makes the claim.
    #[serde(default)]
    pub(crate) own: bool,
    /// Checks that decide on the claim; all must pass.
    pub(crate) checks: Spanned<Vec<WrittenCheck>>,
}

/// A check of a finding.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct WrittenCheck {
    /// Cells of the table of metrics, as `metric.case`; `metric.case/other_case` compares two.
    pub(crate) cells: Spanned<Vec<Spanned<String>>>,
    /// Expected result; the paper's change or value if absent.
    pub(crate) expect: Option<Spanned<Expect>>,
    /// Level for above and below, in the unit of the metric.
    pub(crate) level: Option<Spanned<f64>>,
}

impl Scenario {
    /// Names of the FMUs in all cases, with their places.
    pub(crate) fn fmus(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        let of_components = self.components.iter().map(|u| (u.fmu.as_str(), u.fmu.span()));
        let of_cases = self.cases.iter().flat_map(|c| c.fmu.values());
        of_components.chain(of_cases.map(|r| (r.fmu.as_str(), r.span())))
    }

    /// Start, 0 unless given.
    pub(crate) fn start(&self) -> f64 {
        self.simulation.start.as_ref().map_or(0.0, |s| *s.get_ref())
    }
}

impl Component {
    /// Returns the place where the scenario requests a start in a steady state.
    pub(crate) fn steady(&self) -> Option<Range<usize>> {
        self.start.as_ref().filter(|start| *start.get_ref() == Start::Steady).map(Spanned::span)
    }
}

impl Metric {
    /// The signal or signals of the metric.
    pub(crate) fn all_signals(&self) -> impl Iterator<Item = &Spanned<String>> {
        self.signal.iter().chain(&self.signals)
    }
}

impl Case {
    /// Returns true if this case omits a component.
    pub(crate) fn leaves_out(&self, component: &str) -> bool {
        self.without.iter().any(|name| name.get_ref() == component)
    }
}
