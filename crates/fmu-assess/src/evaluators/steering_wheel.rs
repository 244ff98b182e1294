//! Steering wheel angle.

use crate::metric::Reason;
use crate::numerics::Rows;
use crate::options::{Fallback, Form, OptionRule, Options};
use std::borrow::Cow;

/// Option for evaluators that need the steering wheel angle.
pub(super) const RATIO: OptionRule = OptionRule::new("steer.ratio", "1", Form::Positive, Fallback::Required)
    .is("ratio of steering wheel angle to road-wheel angle");

/// Option for recordings without a column of the steering wheel angle.
pub(super) const OPTIONAL_RATIO: OptionRule = OptionRule {
    default: Fallback::Absent,
    meaning: "ratio of steering wheel angle to road-wheel angle, to compute the steering wheel angle from `driver.steer` if the recording has no column `driver.steering_wheel`",
    ..RATIO
};

/// Steering wheel angle, rad: the column, or the road-wheel angle times the given ratio.
pub(super) fn steering_wheel<'a>(rows: &Rows<'a>, options: &Options) -> Result<Cow<'a, [f64]>, Reason> {
    let column = rows.column("driver.steering_wheel");
    match (column, options.given(RATIO.name)) {
        (Err(_), Some(ratio)) if rows.column("driver.steer").is_ok() => {
            Ok(rows.column("driver.steer")?.iter().map(|angle| ratio * angle).collect())
        }
        (column, _) => column.map(Cow::Borrowed),
    }
}
