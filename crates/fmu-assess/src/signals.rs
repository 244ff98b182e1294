//! Units of the bench's signals, and conversion from the units that an FMU declares.

use crate::evaluators::EVALUATORS;
use fmu_import::description::{BaseUnit, ModelDescription, Variable};
use fmu_system::data::unit::{find, is_same_without_angle};
use fmu_system::run::Linear;

/// Recorded signals that no evaluator reads.
const OTHERS: [(&str, &str); 6] = [
    ("vehicle.lateral_velocity", "m/s"),
    ("vehicle.longitudinal_acceleration", "m/s2"),
    ("vehicle.yaw_acceleration", "rad/s2"),
    ("body.pitch", "rad"),
    ("body.heave", "m"),
    ("driver.speed", "m/s"),
];

/// Other variables of a plant that the bench sets.
const WRITTEN: [(&str, &str); 4] =
    [("steer.front", "rad"), ("vehicle.initial_speed", "m/s"), ("road_friction.*", "1"), ("target_slip.*", "1")];

/// Parameters that define the size of a plant, in order of precedence.
pub(crate) const DATA: [(&str, &str); 9] = [
    ("vehicle.mass", "kg"),
    ("geometry.track", "m"),
    ("geometry.half_track.left", "m"),
    ("geometry.half_track.right", "m"),
    ("geometry.cg_to_front_axle", "m"),
    ("geometry.cg_to_rear_axle", "m"),
    ("geometry.front_to_middle_axle", "m"),
    ("geometry.middle_to_rear_axle", "m"),
    ("geometry.cg_to_rear_suspension", "m"),
];

/// The unit in which the bench reads or writes a signal; `None` for an unknown signal.
pub fn unit(signal: &str) -> Option<&'static str> {
    let columns = EVALUATORS.iter().flat_map(|evaluator| evaluator.columns).map(|column| (column.name, column.unit));
    let is_meant = |(name, _): &(&str, &str)| match name.strip_suffix('*') {
        Some(group) => signal.starts_with(group),
        None => *name == signal,
    };
    columns.chain(OTHERS).chain(WRITTEN).find(is_meant).map(|(_, unit)| unit)
}

/// The conversion of a variable to the unit `needed`; `None` if it has this unit or no unit. `given` is a unit set by
/// the caller, which takes precedence over the declared unit.
///
/// # Errors
/// The unit belongs to another quantity or is unknown. The message begins with the unit.
pub(crate) fn conversion(
    needed: &str,
    description: &ModelDescription,
    variable: &Variable,
    given: Option<&str>,
) -> Result<Option<Linear>, String> {
    let exponents = find(needed).map_or([0; 8], |unit| unit.exponents);
    let Some(name) = given.or(variable.unit.as_deref()) else { return Ok(None) };
    let of_description = if given.is_none() { description.unit(name).and_then(|unit| unit.base) } else { None };
    match of_description.or_else(|| find(name)) {
        // Some tools omit the radian from the base unit, but keep the name.
        Some(BaseUnit { exponents: declared, factor, offset })
            if declared == exponents || (is_same_without_angle(declared, exponents) && name == needed) =>
        {
            if factor.is_finite() && factor != 0.0 && offset.is_finite() {
                let linear = Linear { factor, offset: if variable.relative_quantity { 0.0 } else { offset } };
                return Ok((linear != Linear::IDENTITY).then_some(linear));
            }
            Err(format!("{name}, whose factor is {factor} and whose offset is {offset}"))
        }
        Some(_) => Err(name.to_owned()),
        None if name == needed => Ok(None),
        None => Err(format!("{name}, whose base units are not declared")),
    }
}
