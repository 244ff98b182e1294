//! A planned run of a maneuver.

use crate::wiring::Driving;
use std::collections::BTreeMap;

#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Setting {
    Number(f64),
    Text(String),
}

/// A planned run.
#[derive(Debug, Clone)]
pub(crate) struct RunSpec {
    /// Id, unique in a system.
    pub(crate) id: String,
    pub(crate) driving: Driving,
    pub(crate) speed: f64,
    /// Values: component (`driver`, `road`, `plant`), variable, value.
    pub(crate) values: Vec<(&'static str, String, Setting)>,
    /// Stop time, s, unless the run ends earlier.
    pub(crate) stop: f64,
    pub(crate) ends: Vec<EndAt>,
    /// True if the driver should reach the end of a path.
    pub(crate) has_end: bool,
    /// Numbers shown in the report.
    pub(crate) shown: BTreeMap<String, f64>,
}

impl RunSpec {
    pub(crate) fn new(id: impl Into<String>, driving: Driving, speed: f64, stop: f64) -> Self {
        let shown = BTreeMap::from([("speed".to_owned(), speed)]);
        Self { id: id.into(), driving, speed, values: Vec::new(), stop, ends: Vec::new(), has_end: false, shown }
    }

    pub(crate) fn maneuver(self, name: &str) -> Self {
        self.text("maneuver", name)
    }

    /// Sets variables of the driver.
    pub(crate) fn drivers(self, values: &[(&str, f64)]) -> Self {
        values.iter().fold(self, |spec, (name, value)| spec.value("driver", name, *value))
    }

    pub(crate) fn value(mut self, component: &'static str, name: &str, value: f64) -> Self {
        self.values.push((component, name.to_owned(), Setting::Number(value)));
        self
    }

    /// Sets a String of the driver, or an Enumeration by the name of its value.
    pub(crate) fn text(mut self, name: &str, value: &str) -> Self {
        self.values.push(("driver", name.to_owned(), Setting::Text(value.to_owned())));
        self
    }

    /// Adds a condition that ends the run early.
    pub(crate) fn end(mut self, end: EndAt) -> Self {
        self.ends.push(end);
        self
    }

    /// Requires the driver to reach the end of its path.
    pub(crate) fn with_end(mut self) -> Self {
        self.has_end = true;
        self
    }

    /// Shows a number in the report.
    pub(crate) fn show(mut self, name: &str, value: f64) -> Self {
        self.shown.insert(name.to_owned(), value);
        self
    }
}

/// Condition that ends a run early. The row in which it becomes true is the last one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum EndAt {
    /// Magnitude of the lateral acceleration above this, m/s2.
    LateralAcceleration(f64),
    /// Time after the end of the path, s.
    Finished(f64),
    Lost,
    /// Position along x beyond this, m.
    Position(f64),
    /// Speed below this, m/s.
    Speed(f64),
    /// Speed over ground below this, m/s.
    GroundSpeed(f64),
}
