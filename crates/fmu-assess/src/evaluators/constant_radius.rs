//! Constant radius: gradients while the speed rises on a circle.

use super::steady_state::Cornering;
use super::{Column, Evaluator};
use crate::metric::{Definition, Reason, Results};
use crate::numerics::{Rows, largest, mean, sign};
use crate::options::{Fallback, Form, OptionRule, Options};

/// Cutoff frequency of all filtered signals, Hz.
const CUTOFF: f64 = 2.0;
/// Lateral acceleration from which the gradients count, and up to which for both classes, m/s2.
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
        OptionRule {
            name: "geometry.wheelbase",
            unit: "m",
            form: Form::Positive,
            default: Fallback::Required,
            meaning: "wheelbase; of more than two axles the equivalent one",
        },
        OptionRule {
            name: "begin",
            unit: "m",
            form: Form::NotNegative,
            default: Fallback::Number(60.0),
            meaning: "`path.distance` from which the rows count",
        },
        OptionRule {
            name: "vehicle.class",
            unit: "1",
            form: Form::Word(&["car", "truck"]),
            default: Fallback::Word("car"),
            meaning: "gradients are those up to a lateral acceleration of 3 m/s2 (car) or 1.8 m/s2 (truck)",
        },
    ],
    metrics: &[
        Definition::new(
            "lateral_acceleration_max",
            "Largest lateral acceleration",
            "m/s2",
            "Largest lateral acceleration in the direction of the turn. Steering angle, yaw rate and lateral acceleration are filtered at 2 Hz over the rows that count.",
        ),
        Definition::new(
            "deviation_max",
            "Largest deviation",
            "m",
            "Largest magnitude of the lateral deviation from the path.",
        )
        .down(),
        Definition::new(
            "understeer_gradient",
            "Understeer gradient",
            "rad/(m/s2)",
            "Slope of steering angle less wheelbase times yaw rate over speed, over the lateral acceleration from 1 to 3 m/s2 (truck: 1.8).",
        ),
        Definition::new("sideslip_gradient", "Sideslip gradient", "rad/(m/s2)", "The same of the sideslip angle."),
        Definition::new("roll_gradient", "Roll gradient", "rad/(m/s2)", "The same of the roll angle."),
        Definition::new(
            "load_transfer_gradient",
            "Load transfer gradient",
            "1/(m/s2)",
            "The same of the load transfer ratio.",
        ),
    ],
    compute,
};

fn compute(rows: &Rows<'_>, options: &Options, results: &mut Results) -> Result<(), Reason> {
    let begin = options.number("begin");
    let distance = rows.column("path.distance")?;
    let chosen: Vec<usize> = (0..distance.len()).filter(|row| distance[*row] >= begin).collect();
    let too_short = || Reason::new(format!("`path.distance` does not reach {begin} m"));
    let deviation = rows.column("path.lateral_deviation").and_then(|deviation| {
        let magnitudes: Vec<f64> = chosen.iter().map(|row| deviation[*row].abs()).collect();
        largest(&magnitudes).ok_or_else(too_short)
    });
    results.set("deviation_max", deviation);
    let yaw_rate = rows.column("vehicle.yaw_rate")?;
    let yaw_rates: Vec<f64> = chosen.iter().map(|row| yaw_rate[*row]).collect();
    let sign = sign(mean(&yaw_rates).ok_or_else(too_short)?);
    if sign == 0.0 {
        return Err(Reason::new("the mean of `vehicle.yaw_rate` is 0, so the turn has no direction"));
    }
    let cornering = Cornering::new(rows, chosen, sign, [CUTOFF; 2])?;
    let lateral_acceleration = &cornering.lateral_acceleration;
    results.set("lateral_acceleration_max", largest(lateral_acceleration).ok_or_else(too_short));
    let to = if options.word("vehicle.class") == "truck" { TO_TRUCK } else { TO_CAR };
    let window: Vec<usize> =
        (0..lateral_acceleration.len()).filter(|row| (FROM..=to).contains(&lateral_acceleration[*row])).collect();
    let window = if window.is_empty() {
        Err(Reason::new(format!("the lateral acceleration is never between {FROM} and {to} m/s2")))
    } else {
        Ok(window)
    };
    cornering.set_gradients(&window, options.number("geometry.wheelbase"), results);
    Ok(())
}
