//! Slowly increasing steer: understeer gradient and the steering angle at 0.3 g.

use super::steady_state::{Cornering, WHEELBASE};
use super::steering_wheel::RATIO;
use super::{Column, Evaluator};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{GRAVITY, Line, Rows, largest, no_rows, sign};
use crate::options::Options;

/// Cutoff frequencies of steering angle and motion, Hz.
const CUTOFFS: [f64; 2] = [10.0, 6.0];
/// Lateral accelerations between which the line for A is fitted, and at which it is evaluated, m/s2.
const ANGLE_WINDOW: [f64; 2] = [0.1 * GRAVITY, 0.375 * GRAVITY];
const ANGLE_AT: f64 = 0.3 * GRAVITY;
/// Lateral accelerations between which the gradients are computed, m/s2.
const GRADIENT_WINDOW: [f64; 2] = [1.0, 3.0];
/// Smallest number of rows in a window.
const MIN_ROWS: usize = 10;

pub(super) const EVALUATOR: Evaluator = Evaluator {
    name: "slowly_increasing_steer",
    title: "Slowly increasing steer",
    source: "FMVSS 126 S7.6, ISO 4138 (constant speed)",
    columns: &[
        Column::needed("driver.steer", "rad"),
        Column::needed("vehicle.yaw_rate", "rad/s"),
        Column::needed("vehicle.lateral_acceleration", "m/s2"),
        Column::optional("vehicle.speed", "m/s"),
        Column::optional("vehicle.sideslip", "rad"),
        Column::optional("body.roll", "rad"),
        Column::optional("vehicle.load_transfer_ratio", "1"),
    ],
    options: &[RATIO, WHEELBASE],
    metrics: &[
        Definition::neutral("A_raw", "Steering wheel angle at 0.3 g", "deg")
            .is("Value at 0.3 g of the least-squares line through the steering wheel angle over the lateral acceleration from 0.1 g to 0.375 g. The \
             steering angle is filtered at 10 Hz, yaw rate and lateral acceleration at 6 Hz; all are positive in the direction of the last steering \
             angle."),
        Definition::neutral("A", "A, rounded", "deg")
            .is("A_raw, rounded to 0.1 deg. The amplitudes of other maneuvers are multiples of it."),
        Definition::neutral("understeer_gradient", "Understeer gradient", "rad/(m/s2)")
            .is("Slope of (steering angle - wheelbase * yaw rate / speed) over the lateral acceleration from 1 to 3 \
                 m/s2."),
        Definition::neutral("sideslip_gradient", "Sideslip gradient", "rad/(m/s2)")
            .is("Slope of the sideslip angle over the lateral acceleration from 1 to 3 m/s2."),
        Definition::neutral("roll_gradient", "Roll gradient", "rad/(m/s2)")
            .is("Slope of the roll angle over the lateral acceleration from 1 to 3 m/s2."),
        Definition::neutral("load_transfer_gradient", "Load transfer gradient", "1/(m/s2)")
            .is("Slope of the load transfer ratio over the lateral acceleration from 1 to 3 m/s2."),
        Definition::neutral("lateral_acceleration_max", "Largest lateral acceleration", "m/s2")
            .is("Largest filtered lateral acceleration in the direction of the turn."),
    ],
    compute,
};

fn compute(rows: &Rows<'_>, options: &Options, results: &mut Results) -> Result<(), Reason> {
    let last = rows.column("driver.steer")?.last().copied().unwrap_or(0.0);
    let sign = sign(last);
    if sign == 0.0 {
        return Err("`driver.steer` is 0 in the last row, so the turn has no direction".to_owned());
    }
    let cornering = Cornering::new(rows, (0..rows.times.len()).collect(), sign, CUTOFFS)?;
    let angle = angle(&cornering, options.number("steer.ratio"));
    results.set("A_raw", angle.clone());
    results.set("A", angle.map(|angle| (10.0 * angle + 0.5).floor() / 10.0));
    let window = window(&cornering.lateral_acceleration, GRADIENT_WINDOW);
    cornering.set_gradients(&window, options.number("geometry.wheelbase"), results);
    let largest = largest(&cornering.lateral_acceleration);
    results.set("lateral_acceleration_max", largest.ok_or_else(no_rows));
    Ok(())
}

/// Steering wheel angle at 0.3 g, deg.
fn angle(cornering: &Cornering<'_>, ratio: f64) -> Result<f64, Reason> {
    let window = window(&cornering.lateral_acceleration, ANGLE_WINDOW)?;
    let x: Vec<f64> = window.iter().map(|row| cornering.lateral_acceleration[*row]).collect();
    let y: Vec<f64> = window.iter().map(|row| (cornering.steer[*row] * ratio).to_degrees()).collect();
    let line = Line::fit(&x, &y).ok_or_else(|| "the lateral acceleration does not change in the window".to_owned())?;
    Ok(line.at(ANGLE_AT))
}

/// The rows from the first one at or above `low` up to the last one before the value exceeds `high`.
fn window(lateral_acceleration: &[f64], [low, high]: [f64; 2]) -> Result<Vec<usize>, Reason> {
    let begin = lateral_acceleration.iter().position(|value| *value >= low);
    let end = begin.and_then(|begin| lateral_acceleration[begin..].iter().position(|value| *value > high));
    let (Some(begin), Some(length)) = (begin, end) else {
        return Err(format!("the filtered lateral acceleration does not exceed {high:.3} m/s2"));
    };
    if length < MIN_ROWS {
        return Err(format!(
            "the lateral acceleration is between {low:.3} and {high:.3} m/s2 in {length} rows; at least {MIN_ROWS} are needed"
        ));
    }
    Ok((begin..begin + length).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_need_ten_rows_and_an_end() {
        let ramp = |slope: f64, rows: usize| (0..rows).map(|row| slope * row as f64).collect::<Vec<_>>();
        assert_eq!(window(&ramp(0.1, 50), [1.0, 3.0]).unwrap(), (10..31).collect::<Vec<_>>());
        let reason = window(&ramp(0.1, 30), [1.0, 3.0]).unwrap_err().to_string();
        assert_eq!(reason, "the filtered lateral acceleration does not exceed 3.000 m/s2");
        let reason = window(&ramp(0.5, 30), [1.0, 3.0]).unwrap_err().to_string();
        assert_eq!(
            reason,
            "the lateral acceleration is between 1.000 and 3.000 m/s2 in 5 rows; at least 10 are needed"
        );
        assert!(window(&[], [1.0, 3.0]).is_err());
    }
}
