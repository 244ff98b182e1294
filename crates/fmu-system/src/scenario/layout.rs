//! The layout of the file.

use crate::metrics::{Combine, Kind};
use crate::report::{Expect, FigureKind, Level};
use crate::run::Order;
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_spanned::Spanned;
use std::collections::BTreeMap;
use std::ops::Range;

/// Variable or pattern -> value as written.
pub(crate) type Values = BTreeMap<Spanned<String>, Spanned<toml::Value>>;
/// Component -> values.
pub(crate) type ValuesByComponent = BTreeMap<Spanned<String>, Values>;

/// A scenario: the content of its file and of the files that it includes.
#[derive(Debug)]
pub(crate) struct Scenario {
    pub(crate) title: String,
    pub(crate) description: String,
    pub(crate) reference: String,
    /// Path of a parameter set of `component:parameter` names, relative to the scenario.
    pub(crate) parameter_set: Option<Spanned<String>>,
    pub(crate) simulation: Simulation,
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

/// Content of one file.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Written {
    /// Paths of files with parts of the scenario, relative to this one.
    #[serde(default)]
    pub(crate) include: Vec<Spanned<String>>,
    pub(crate) title: Option<Spanned<String>>,
    pub(crate) description: Option<Spanned<String>>,
    pub(crate) reference: Option<Spanned<String>>,
    pub(crate) parameter_set: Option<Spanned<String>>,
    /// Parameters that override those of the components.
    #[serde(default)]
    pub(crate) parameters: ValuesByComponent,
    pub(crate) simulation: Option<Simulation>,
    #[serde(rename = "component", default)]
    pub(crate) components: Vec<Component>,
    #[serde(rename = "connection", default)]
    pub(crate) connections: Vec<Connection>,
    #[serde(rename = "case", default)]
    pub(crate) cases: Vec<Case>,
    #[serde(rename = "point", default)]
    pub(crate) points: Vec<Point>,
    pub(crate) sweep: Option<Spanned<Sweep>>,
    pub(crate) seeds: Option<Seeds>,
    pub(crate) record: Option<Record>,
    #[serde(rename = "metric", default)]
    pub(crate) metrics: Vec<Metric>,
    #[serde(rename = "figure", default)]
    pub(crate) figures: Vec<Figure>,
    #[serde(rename = "finding", default)]
    pub(crate) findings: Vec<WrittenFinding>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Simulation {
    pub(crate) start: Option<Spanned<f64>>,
    pub(crate) stop: Spanned<f64>,
    pub(crate) step: Spanned<f64>,
    pub(crate) order: Option<Order>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Component {
    pub(crate) name: Spanned<String>,
    pub(crate) fmu: Spanned<String>,
    /// Path of a parameter set of `parameter` names, relative to the scenario.
    pub(crate) parameter_set: Option<Spanned<String>>,
    #[serde(default)]
    pub(crate) parameters: Values,
    #[serde(default)]
    pub(crate) inputs: Values,
    pub(crate) start: Option<Spanned<Start>>,
}

/// Start of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Start {
    /// With its declared start values.
    Declared,
    /// In the steady state of its first inputs.
    Steady,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Connection {
    pub(crate) from: Spanned<String>,
    pub(crate) to: Spanned<String>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Case {
    pub(crate) name: Spanned<String>,
    pub(crate) title: String,
    pub(crate) baseline: Option<Spanned<String>>,
    /// Path of a parameter set of `component:parameter` names, relative to the scenario.
    pub(crate) parameter_set: Option<Spanned<String>>,
    #[serde(default)]
    pub(crate) parameters: ValuesByComponent,
    #[serde(default)]
    pub(crate) fmu: BTreeMap<Spanned<String>, Spanned<Replacement>>,
    #[serde(default)]
    pub(crate) without: Vec<Spanned<String>>,
    #[serde(default)]
    pub(crate) inputs: ValuesByComponent,
}

/// Another FMU for a component: `"Name"`, or `{ fmu = "Name", keep_parameters = true }`.
#[derive(Debug)]
pub(crate) struct Replacement {
    pub(crate) fmu: String,
    /// True if the component's own parameters apply to it, as far as it has them.
    pub(crate) keep_parameters: bool,
}

impl<'de> Deserialize<'de> for Replacement {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Table {
            fmu: String,
            #[serde(default)]
            keep_parameters: bool,
        }

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
                let Table { fmu, keep_parameters } = Table::deserialize(MapAccessDeserializer::new(map))?;
                Ok(Replacement { fmu, keep_parameters })
            }
        }
        deserializer.deserialize_any(Either)
    }
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Point {
    pub(crate) name: Spanned<String>,
    pub(crate) title: String,
    pub(crate) value: Spanned<f64>,
    /// Place on the second axis of the sweep.
    pub(crate) second: Option<Spanned<f64>>,
    #[serde(default)]
    pub(crate) parameters: ValuesByComponent,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Sweep {
    pub(crate) title: String,
    pub(crate) unit: String,
    /// Parameter that takes the values, as `component:parameter`; the points are then generated from the values.
    pub(crate) parameter: Option<Spanned<String>>,
    pub(crate) values: Option<Spanned<Vec<f64>>>,
    pub(crate) second: Option<Spanned<SecondSweep>>,
}

/// The second axis of a sweep over the values of two parameters.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SecondSweep {
    pub(crate) title: String,
    pub(crate) unit: String,
    pub(crate) parameter: Option<Spanned<String>>,
    pub(crate) values: Option<Spanned<Vec<f64>>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Seeds {
    pub(crate) parameter: Spanned<String>,
    pub(crate) values: Spanned<Vec<Spanned<i32>>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Record {
    pub(crate) signals: Vec<Spanned<String>>,
    pub(crate) every: Option<Spanned<i64>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Metric {
    pub(crate) name: Spanned<String>,
    pub(crate) title: String,
    pub(crate) signal: Option<Spanned<String>>,
    /// Several signals that are combined row by row.
    #[serde(default)]
    pub(crate) signals: Vec<Spanned<String>>,
    pub(crate) combine: Option<Spanned<Combine>>,
    /// Weights of the signals.
    pub(crate) weights: Option<Spanned<Vec<f64>>>,
    pub(crate) kind: Option<Kind>,
    /// A formula of other metrics, instead of signals and a kind.
    pub(crate) value: Option<Spanned<String>>,
    /// Level that the kind refers to, in `unit`.
    pub(crate) threshold: Option<Spanned<f64>>,
    /// Frequencies that the kind refers to, Hz.
    pub(crate) band: Option<Spanned<[f64; 2]>>,
    pub(crate) window: Option<Spanned<[f64; 2]>>,
    /// Condition that ends the window early.
    pub(crate) until: Option<Spanned<Until>>,
    /// Signal that is subtracted first.
    pub(crate) minus: Option<Spanned<String>>,
    /// True if the signal of the baseline's run is subtracted first.
    #[serde(default)]
    pub(crate) from_baseline: bool,
    pub(crate) unit: Option<Spanned<String>>,
    pub(crate) digits: Option<Spanned<u8>>,
    pub(crate) paper: Option<Paper>,
    /// Required minimum, in `unit`.
    pub(crate) min: Option<Spanned<f64>>,
    /// Required maximum, in `unit`.
    pub(crate) max: Option<Spanned<f64>>,
    /// Cases for which it is required; all if absent.
    pub(crate) required_of: Option<Spanned<Vec<Spanned<String>>>>,
    /// Share of the runs that must keep it, above 0 and up to 1; all if absent.
    pub(crate) share: Option<Spanned<f64>>,
    /// Source of the requirement.
    pub(crate) required_by: Option<Spanned<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Until {
    pub(crate) signal: Spanned<String>,
    pub(crate) above: Option<f64>,
    pub(crate) below: Option<f64>,
    pub(crate) unit: Option<Spanned<String>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Paper {
    pub(crate) table: Option<String>,
    #[serde(default)]
    pub(crate) values: BTreeMap<Spanned<String>, f64>,
    /// Changes in percent where the paper gives no values, by cell or by two cells.
    #[serde(default)]
    pub(crate) changes: BTreeMap<Spanned<String>, f64>,
    /// Keys of the values used for calibration; the others are then predictions.
    pub(crate) calibrated: Option<Vec<Spanned<String>>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Figure {
    pub(crate) name: Spanned<String>,
    pub(crate) title: String,
    pub(crate) kind: FigureKind,
    /// Cases shown; all if absent.
    pub(crate) cases: Option<Spanned<Vec<Spanned<String>>>>,
    pub(crate) separate: Option<Spanned<bool>>,
    #[serde(default)]
    pub(crate) signals: Vec<Spanned<String>>,
    /// Signal drawn dashed beside each of them.
    pub(crate) against: Option<Spanned<String>>,
    /// Signal drawn over a second vertical axis.
    pub(crate) right: Option<Spanned<String>>,
    /// Signal or metric on the abscissa.
    pub(crate) over: Option<Spanned<String>>,
    pub(crate) same_scale: Option<Spanned<bool>>,
    pub(crate) equal_axes: Option<Spanned<bool>>,
    /// Frequencies shown, Hz.
    pub(crate) band: Option<Spanned<[f64; 2]>>,
    #[serde(default)]
    pub(crate) metrics: Vec<Spanned<String>>,
    pub(crate) window: Option<Spanned<[f64; 2]>>,
    pub(crate) unit: Option<Spanned<String>>,
    #[serde(default)]
    pub(crate) levels: Vec<Spanned<Level>>,
    pub(crate) caption: Option<Spanned<String>>,
}

/// `[[finding]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct WrittenFinding {
    pub(crate) claim: Spanned<String>,
    pub(crate) explanation: Spanned<String>,
    #[serde(default)]
    pub(crate) own: bool,
    pub(crate) checks: Spanned<Vec<WrittenCheck>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct WrittenCheck {
    pub(crate) cells: Spanned<Vec<Spanned<String>>>,
    pub(crate) expect: Option<Spanned<Expect>>,
    pub(crate) level: Option<Spanned<f64>>,
}

impl Scenario {
    /// Names of all FMUs of all cases, with their places.
    pub(crate) fn fmus(&self) -> impl Iterator<Item = (&str, Range<usize>)> {
        let of_components = self.components.iter().map(|u| (u.fmu.get_ref().as_str(), u.fmu.span()));
        let of_cases = self.cases.iter().flat_map(|c| c.fmu.values());
        of_components.chain(of_cases.map(|r| (r.get_ref().fmu.as_str(), r.span())))
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
    /// All its signals.
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
