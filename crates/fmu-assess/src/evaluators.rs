//! Evaluators: each computes the metrics of one kind of maneuver from a recording.
//!
//! [`EVALUATORS`] lists them with their columns, their options, and the definitions of their metrics.

mod brake_in_turn;
mod braking;
pub(crate) mod cones;
mod constant_radius;
pub(crate) mod frequency_response;
mod reference;
mod ride;
mod rollover;
pub(crate) mod sine_with_dwell;
mod single_lane_change;
mod slowly_increasing_steer;
mod steady_state;
mod steering_wheel;
mod step_steer;
pub(crate) mod weighting;

pub use reference::reference;
pub(crate) use ride::comfort;

use crate::components::SetupError;
use crate::json;
use crate::metric::{Definition, Metric, Reason, Results, Value};
use crate::numerics::{Rows, largest_magnitude, no_rows};
use crate::options::{OptionRule, Options};
use crate::trace::Trace;

pub use crate::trace::Column;

/// All evaluators.
pub static EVALUATORS: [Evaluator; 11] = [
    slowly_increasing_steer::EVALUATOR,
    constant_radius::EVALUATOR,
    step_steer::EVALUATOR,
    frequency_response::EVALUATOR,
    sine_with_dwell::EVALUATOR,
    cones::EVALUATOR,
    rollover::EVALUATOR,
    braking::EVALUATOR,
    brake_in_turn::EVALUATOR,
    ride::EVALUATOR,
    single_lane_change::EVALUATOR,
];

/// Computes the metrics of a maneuver.
#[derive(Debug)]
pub struct Evaluator {
    /// Name: `step_steer`.
    pub name: &'static str,
    /// Title.
    pub title: &'static str,
    /// The test procedure that it follows.
    pub source: &'static str,
    /// The columns that it reads.
    pub columns: &'static [Column],
    /// Its options.
    pub options: &'static [OptionRule],
    /// Its metrics.
    pub metrics: &'static [Definition],
    compute: fn(&Rows<'_>, &Options, &mut Results) -> Result<(), Reason>,
}

/// The metrics of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Evaluation {
    /// The metrics in the order of the evaluator's table.
    pub metrics: Vec<Metric>,
    /// Notes for the user.
    pub notes: Vec<String>,
}

/// Finds an evaluator by its name.
pub fn find(name: &str) -> Option<&'static Evaluator> {
    EVALUATORS.iter().find(|evaluator| evaluator.name == name)
}

impl Evaluator {
    /// Computes all metrics. A metric that the trace cannot provide is [`Value::Null`].
    ///
    /// # Errors
    /// The options are not an object, an option is unknown or missing, or a value is not allowed.
    pub fn evaluate(&self, trace: &Trace<'_>, options: &serde_json::Value) -> Result<Evaluation, SetupError> {
        let options = Options::new(self.name, self.options, options)?;
        let mut results = Results::new(self.metrics);
        let computed = Rows::new(trace).and_then(|rows| {
            for (of, column) in self.metrics.iter().filter_map(|of| Some((of, of.peak_of?))) {
                results.set(of.name, rows.column(column).and_then(|x| largest_magnitude(x).ok_or_else(no_rows)));
            }
            (self.compute)(&rows, &options, &mut results)
        });
        let reason = computed.err().unwrap_or_else(|| "the recording contains no data for it".to_owned());
        let notes = std::mem::take(&mut results.notes);
        Ok(Evaluation { metrics: results.finish(&reason), notes })
    }
}

impl Evaluation {
    /// Value of a metric, by its name.
    pub fn value(&self, name: &str) -> Option<&Value> {
        self.metrics.iter().find(|metric| metric.name == name).map(|metric| &metric.value)
    }

    /// The metrics as a JSON object: keys sorted, numbers with 9 significant digits, null if a value cannot be
    /// computed. A dot in a name separates a group: `yaw_rate.gain` is `{"yaw_rate": {"gain": …}}`.
    pub fn to_json(&self) -> String {
        // Maps of strings, finite numbers and Booleans can always be written.
        serde_json::to_string_pretty(&json::document(&self.metrics)).unwrap_or_default()
    }
}

/// Defines a metric that is the largest magnitude of a column.
const fn peak(name: &'static str, title: &'static str, unit: &'static str, column: &'static str) -> Definition {
    Definition { peak_of: Some(column), ..Definition::neutral(name, title, unit).is("Largest magnitude in the run.") }
}

const LATERAL_ACCELERATION_PEAK: Definition =
    peak("lateral_acceleration_peak", "Peak of the lateral acceleration", "m/s2", "vehicle.lateral_acceleration");
const SIDESLIP_PEAK: Definition = peak("sideslip_peak", "Peak of the sideslip angle", "rad", "vehicle.sideslip").down();
const ROLL_PEAK: Definition = peak("roll_peak", "Peak of the roll angle", "rad", "body.roll").down();
const YAW_RATE_PEAK: Definition = peak("yaw_rate_peak", "Peak of the yaw rate", "rad/s", "vehicle.yaw_rate");
const LOAD_TRANSFER_PEAK: Definition =
    peak("load_transfer_peak", "Peak of the load transfer ratio", "1", "vehicle.load_transfer_ratio").down();

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn options(evaluator: &Evaluator) -> serde_json::Value {
        let all = json!({
            "steer.ratio": 16.0, "geometry.wheelbase": 2.7, "maneuver": 2, "vehicle.width": 1.75,
            "footprint.front": 2.0, "footprint.rear": 2.2,
        });
        let chosen =
            all.as_object().unwrap().iter().filter(|(name, _)| evaluator.options.iter().any(|o| o.name == *name));
        serde_json::Value::Object(chosen.map(|(name, value)| (name.clone(), value.clone())).collect())
    }

    /// A trace with every column that the evaluator reads.
    fn trace(evaluator: &Evaluator, times: Vec<f64>, value: impl Fn(usize, usize) -> f64) -> Trace<'static> {
        let rows = times.len();
        let names = evaluator.columns.iter().flat_map(|column| match column.name.strip_suffix('*') {
            Some(group) => vec![format!("{group}fl"), format!("{group}fr")],
            None => vec![column.name.to_owned()],
        });
        names.enumerate().fold(Trace::new(times), |trace, (index, name)| {
            trace.with(name, (0..rows).map(|row| value(index, row)).collect::<Vec<_>>()).unwrap()
        })
    }

    fn grid(rows: u32) -> Vec<f64> {
        (1..=rows).map(|row| f64::from(row) * 0.01).collect()
    }

    fn evaluated(evaluator: &Evaluator, trace: &Trace<'_>) -> Evaluation {
        evaluator.evaluate(trace, &options(evaluator)).unwrap()
    }

    /// Asserts that each definition has a metric, in the order of the table.
    #[track_caller]
    fn assert_complete(evaluator: &Evaluator, evaluation: &Evaluation) {
        let mut names: Vec<&str> = evaluation.metrics.iter().map(|metric| metric.definition.name).collect();
        names.dedup();
        let table: Vec<&str> = evaluator.metrics.iter().map(|definition| definition.name).collect();
        assert_eq!(names, table, "{}", evaluator.name);
        for metric in &evaluation.metrics {
            if let Value::Null(reason) = &metric.value {
                assert!(reason.to_string().len() > 10, "{}: {reason}", metric.name);
            }
        }
    }

    #[test]
    fn what_cannot_be_used_has_a_reason() {
        let falling: Vec<f64> = grid(50).into_iter().rev().collect();
        for evaluator in &EVALUATORS {
            for (times, value, expected) in [
                (Vec::new(), 1.0, "the recording has no rows; at least two are needed"),
                (vec![0.0], 1.0, "the recording has one row; at least two are needed"),
                (falling.clone(), 1.0, "the times must increase: row 2 is at 0.49 s, the previous row at 0.5 s"),
                (vec![f64::NAN; 50], 1.0, "the time of row 1 is not a finite number"),
                (grid(3_000), f64::NAN, "is not a finite number at 0.01 s"),
            ] {
                let evaluation = evaluated(evaluator, &trace(evaluator, times, |_, _| value));
                assert_complete(evaluator, &evaluation);
                for metric in evaluation.metrics {
                    // The metric `frequency` does not depend on any signal.
                    if metric.name == "frequency" {
                        continue;
                    }
                    let Value::Null(reason) = &metric.value else { panic!("{metric:?}") };
                    let reason = reason.to_string();
                    assert!(reason.contains(expected), "{} {}: {reason}", evaluator.name, metric.name);
                }
            }
        }
    }

    #[test]
    fn a_missing_column_is_named() {
        for evaluator in &EVALUATORS {
            let evaluation = evaluated(evaluator, &Trace::new(grid(3_000)));
            assert_complete(evaluator, &evaluation);
            let needed: Vec<&str> = evaluator.columns.iter().map(|c| c.name.trim_end_matches(".*")).collect();
            for metric in evaluation.metrics.iter().filter(|metric| metric.name != "frequency") {
                let Value::Null(reason) = &metric.value else { panic!("{metric:?}") };
                let reason = reason.to_string();
                assert!(
                    needed.iter().any(|name| reason.contains(name)),
                    "{} {}: {reason}",
                    evaluator.name,
                    metric.name
                );
            }
        }
    }

    /// Constant, noisy and huge signals, also at extreme sampling rates, cause no panic and give either a number or a
    /// reason. The noise comes from a linear congruential generator with the multiplier of Knuth's MMIX.
    #[test]
    fn any_signal_is_evaluated() {
        let noise = |index: usize, row: usize| {
            let seed = (index * 1_000_003 + row) as u64;
            let state = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let state = (state ^ (state >> 29)).wrapping_mul(6_364_136_223_846_793_005);
            (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
        };
        let signals: [&dyn Fn(usize, usize) -> f64; 8] = [
            &|_, _| 0.0,
            &|_, _| 1.0,
            &|_, _| -2.0,
            &|_, _| 1e308,
            &|index, row| 1e300 * noise(index, row),
            &|index, row| noise(index, row),
            &|_, row| row as f64,
            &|index, row| f64::from(row > 100) + 0.1 * noise(index, row),
        ];
        for evaluator in &EVALUATORS {
            let steps =
                [(2, 1.0), (3, 1.0), (15, 1.0), (150, 1.0), (2_500, 1.0), (150, 1e-300), (150, 1e4), (150, 1e305)];
            for ((rows, scale), signal) in
                steps.into_iter().flat_map(|(rows, scale)| signals.map(|signal| ((rows, scale), signal)))
            {
                let times = grid(rows).into_iter().map(|time| scale * time).collect();
                let evaluation = evaluated(evaluator, &trace(evaluator, times, signal));
                assert_complete(evaluator, &evaluation);
                for metric in &evaluation.metrics {
                    assert!(!matches!(metric.value, Value::Number(number) if !number.is_finite()), "{metric:?}");
                }
                assert!(serde_json::from_str::<serde_json::Value>(&evaluation.to_json()).is_ok());
            }
        }
    }

    #[test]
    fn the_tables_are_sound() {
        for evaluator in &EVALUATORS {
            assert_eq!(find(evaluator.name).map(|found| found.title), Some(evaluator.title));
            for (index, definition) in evaluator.metrics.iter().enumerate() {
                assert!(definition.definition.ends_with('.'), "{}", definition.name);
                assert!(evaluator.metrics[..index].iter().all(|other| other.name != definition.name));
            }
        }
        assert!(find("braking_distance").is_none());
    }
}
