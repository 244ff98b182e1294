//! Single lane change: peaks, and deviation from the path.

use super::{
    Column, Evaluator, LATERAL_ACCELERATION_PEAK, LOAD_TRANSFER_PEAK, ROLL_PEAK, SIDESLIP_PEAK, YAW_RATE_PEAK, peak,
};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::Rows;
use crate::options::Options;

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "single_lane_change",
    title: "Single lane change",
    source: "ISO 14791, SAE J2179; without rearward amplification, because the vehicles have one unit",
    columns: &[
        Column::optional("vehicle.lateral_acceleration", "m/s2"),
        Column::optional("path.lateral_deviation", "m"),
        Column::optional("path.finished", "1"),
        Column::optional("vehicle.sideslip", "rad"),
        Column::optional("body.roll", "rad"),
        Column::optional("vehicle.load_transfer_ratio", "1"),
        Column::optional("vehicle.yaw_rate", "rad/s"),
    ],
    options: &[],
    metrics: &[
        LATERAL_ACCELERATION_PEAK,
        peak("deviation_peak", "Largest deviation", "m", "path.lateral_deviation")
            .is("Largest magnitude of the lateral deviation from the path.")
            .down(),
        Definition::lower("overshoot", "Overshoot", "m")
            .is("Largest magnitude of the lateral deviation after the end of the path, where `path.finished` is 1."),
        SIDESLIP_PEAK,
        ROLL_PEAK,
        LOAD_TRANSFER_PEAK,
        YAW_RATE_PEAK,
    ],
    compute,
};

fn compute(rows: &Rows<'_>, _: &Options, results: &mut Results) -> Result<(), Reason> {
    results.set("overshoot", overshoot(rows));
    Ok(())
}

fn overshoot(rows: &Rows<'_>) -> Result<f64, Reason> {
    let (deviation, finished) = (rows.column("path.lateral_deviation")?, rows.column("path.finished")?);
    let after = deviation.iter().zip(finished).filter(|(_, finished)| **finished > 0.5);
    let largest = after.map(|(deviation, _)| deviation.abs()).reduce(f64::max);
    largest.ok_or_else(|| "the path is not finished: `path.finished` is never 1".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::Value;
    use crate::trace::Trace;
    use serde_json::json;

    /// Largest magnitude overall, and after the path is finished.
    #[test]
    fn the_overshoot_is_after_the_end() {
        let evaluate = |finished: [f64; 4]| {
            let trace = Trace::new(vec![0.0, 0.1, 0.2, 0.3])
                .with("path.lateral_deviation", vec![0.1, -0.5, 0.3, -0.2])
                .and_then(|trace| trace.with("path.finished", finished.to_vec()))
                .unwrap();
            EVALUATOR.evaluate(&trace, &json!({})).unwrap()
        };
        let evaluation = evaluate([0.0, 0.0, 1.0, 1.0]);
        assert_eq!(evaluation.value("deviation_peak"), Some(&Value::Number(0.5)));
        assert_eq!(evaluation.value("overshoot"), Some(&Value::Number(0.3)));
        assert!(matches!(evaluate([0.0; 4]).value("overshoot"), Some(Value::Null(_))));
    }
}
