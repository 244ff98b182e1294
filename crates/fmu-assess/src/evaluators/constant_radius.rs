//! Constant radius: gradients while the speed increases on a circle.

use super::steady_state::{Cornering, WHEELBASE};
use super::{Column, Evaluator};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{Rows, largest, mean, sign};
use crate::options::{Fallback, Form, OptionRule, Options};

/// Cutoff frequency of all filtered signals, Hz.
const CUTOFF: f64 = 2.0;
/// Range of lateral acceleration for the gradients, m/s2; the upper limit depends on the vehicle class.
const FROM: f64 = 1.0;
const TO_CAR: f64 = 3.0;
const TO_TRUCK: f64 = 1.8;

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "constant_radius",
    title: "Constant radius",
    source: "ISO 4138",
    columns: &[
        Column::needed("driver.steer", "rad"),
        Column::needed("path.distance", "m"),
        Column::needed("vehicle.yaw_rate", "rad/s"),
        Column::needed("vehicle.lateral_acceleration", "m/s2"),
        Column::optional("path.lateral_deviation", "m"),
        Column::optional("vehicle.speed", "m/s"),
        Column::optional("vehicle.sideslip", "rad"),
        Column::optional("body.roll", "rad"),
        Column::optional("vehicle.load_transfer_ratio", "1"),
    ],
    options: &[
        WHEELBASE,
        OptionRule::new("begin", "m", Form::NotNegative, Fallback::Number(60.0))
            .is("`path.distance` at which the evaluation begins"),
        OptionRule::new("vehicle.class", "1", Form::Word(&["car", "truck"]), Fallback::Word("car"))
            .is("largest lateral acceleration for the gradients: 3 m/s2 (car) or 1.8 m/s2 (truck)"),
    ],
    metrics: &[
        Definition::neutral("lateral_acceleration_max", "Largest lateral acceleration", "m/s2")
            .is("Largest lateral acceleration in the direction of the turn. Steering angle, yaw rate and lateral acceleration are filtered at 2 Hz over the evaluated rows."),
        Definition::lower("deviation_max", "Largest deviation", "m")
            .is("Largest magnitude of the lateral deviation from the path."),
        Definition::neutral("understeer_gradient", "Understeer gradient", "rad/(m/s2)")
            .is("Slope of (steering angle - wheelbase * yaw rate / speed) over the lateral acceleration from 1 to 3 m/s2 (truck: 1.8)."),
        Definition::neutral("sideslip_gradient", "Sideslip gradient", "rad/(m/s2)")
            .is("Slope of the sideslip angle over the same lateral accelerations."),
        Definition::neutral("roll_gradient", "Roll gradient", "rad/(m/s2)")
            .is("Slope of the roll angle over the same lateral accelerations."),
        Definition::neutral("load_transfer_gradient", "Load transfer gradient", "1/(m/s2)")
            .is("Slope of the load transfer ratio over the same lateral accelerations."),
    ],
    compute,
};

fn compute(rows: &Rows<'_>, options: &Options, results: &mut Results) -> Result<(), Reason> {
    let begin = options.number("begin");
    let distance = rows.column("path.distance")?;
    let chosen: Vec<usize> = (0..distance.len()).filter(|row| distance[*row] >= begin).collect();
    let too_short = || format!("`path.distance` does not reach {begin} m");
    let deviation = rows.column("path.lateral_deviation").and_then(|deviation| {
        let magnitudes: Vec<f64> = chosen.iter().map(|row| deviation[*row].abs()).collect();
        largest(&magnitudes).ok_or_else(too_short)
    });
    results.set("deviation_max", deviation);
    let yaw_rate = rows.column("vehicle.yaw_rate")?;
    let yaw_rates: Vec<f64> = chosen.iter().map(|row| yaw_rate[*row]).collect();
    let sign = sign(mean(&yaw_rates).ok_or_else(too_short)?);
    if sign == 0.0 {
        return Err("the mean of `vehicle.yaw_rate` is 0, so the turn has no direction".to_owned());
    }
    let cornering = Cornering::new(rows, chosen, sign, [CUTOFF; 2])?;
    let lateral_acceleration = &cornering.lateral_acceleration;
    results.set("lateral_acceleration_max", largest(lateral_acceleration).ok_or_else(too_short));
    let to = if options.word("vehicle.class") == "truck" { TO_TRUCK } else { TO_CAR };
    let window: Vec<usize> =
        (0..lateral_acceleration.len()).filter(|row| (FROM..=to).contains(&lateral_acceleration[*row])).collect();
    let window = if window.is_empty() {
        Err(format!("the lateral acceleration is never between {FROM} and {to} m/s2"))
    } else {
        Ok(window)
    };
    cornering.set_gradients(&window, options.number("geometry.wheelbase"), results);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::metric::Value;
    use crate::trace::Trace;
    use serde_json::json;

    /// Closed form: a vehicle whose understeer gradient is 0.002 up to 1.8 m/s2 and 0.005 above, in a left and a right
    /// turn. Tolerance: the low-pass filter smooths the kink.
    #[test]
    fn a_truck_is_evaluated_up_to_less() {
        let times: Vec<f64> = (1..=6_000).map(|k| f64::from(k) * 0.01).collect();
        for sign in [1.0, -1.0] {
            let column = |of: &dyn Fn(f64) -> f64| times.iter().map(|time| sign * of(0.07 * time)).collect::<Vec<_>>();
            let steer = |a: f64| 4.0 * a / 400.0 + 0.002 * a + 0.003 * (a - 1.8).max(0.0);
            let trace = Trace::new(times.clone())
                .with("driver.steer", column(&steer))
                .and_then(|trace| trace.with("vehicle.lateral_acceleration", column(&|a| a)))
                .and_then(|trace| trace.with("vehicle.yaw_rate", column(&|a| a / 20.0)))
                .and_then(|trace| trace.with("body.roll", column(&|a| 0.01 * a)))
                .and_then(|trace| trace.with("vehicle.speed", vec![20.0; 6_000]))
                .and_then(|trace| trace.with("path.distance", times.iter().map(|t| 20.0 * t).collect::<Vec<_>>()))
                .unwrap();
            let number = |options: serde_json::Value, name: &str| {
                let evaluation = EVALUATOR.evaluate(&trace, &options).unwrap();
                let Some(Value::Number(number)) = evaluation.value(name) else { panic!("{name}") };
                *number
            };
            let truck = json!({"geometry.wheelbase": 4.0, "vehicle.class": "truck"});
            assert!((number(truck.clone(), "understeer_gradient") - 0.002).abs() < 1e-5);
            assert!((number(truck, "roll_gradient") - 0.01).abs() < 1e-6);
            // The least-squares slope of max(a - 1.8, 0) between 1 and 3 m/s2 is (1 - p)^2 (1 + 2 p) with p = 0.4.
            let car = number(json!({"geometry.wheelbase": 4.0}), "understeer_gradient");
            assert!((car - (0.002 + 0.003 * 0.36 * 1.8)).abs() < 1e-5, "{car}");
        }
    }

    #[test]
    fn a_path_that_is_too_short_is_named() {
        let trace = Trace::new(vec![0.0, 0.1]).with("path.distance", vec![0.0, 59.0]).unwrap();
        let trace = trace.with("vehicle.yaw_rate", vec![1.0; 2]).unwrap();
        let evaluation = EVALUATOR.evaluate(&trace, &json!({"geometry.wheelbase": 2.7})).unwrap();
        let Some(Value::Null(reason)) = evaluation.value("roll_gradient") else { panic!() };
        assert_eq!(reason.to_string(), "`path.distance` does not reach 60 m");
    }
}
