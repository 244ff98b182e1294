//! The FMUs accept every limit that their descriptions declare as a value.

use fmu_import::description::{BaseType, Causality, Variable};
use fmu_import::loader::{CallError, Instance};
use tests::{Fmu, all};

/// Parameters whose valid range depends on other parameters, and values of the other parameters for which the full
/// range is valid. For example, a vehicle must be heavier than its wheels, and its center of mass must be between its
/// axles. The FMU's message for a rejected limit states the relation.
const RELATIONS: &[(&str, &[(&str, f64)])] = &[
    ("vehicle.mass", &[("wheel.mass", 0.01)]),
    ("vehicle.yaw_inertia", &[("body.product_of_inertia", 0.0), ("body.roll_yaw_inertia", 0.0)]),
    ("body.roll_axis_inertia", &[("body.product_of_inertia", 0.0), ("geometry.body_cg_to_roll_axis", 0.0)]),
    ("geometry.front_to_middle_axle", &[("geometry.cg_to_front_axle", 0.5)]),
    ("geometry.cg_to_front_axle", &[("geometry.front_to_middle_axle", 1e-6), ("geometry.middle_to_rear_axle", 1e-6)]),
    ("geometry.cg_to_rear_suspension", &[("geometry.middle_to_rear_axle", 1e-6)]),
    ("geometry.cg_height", &[("geometry.body_cg_to_roll_axis", 0.0), ("geometry.wheel_center_height", 0.0)]),
    // A delay of 50 ms would be 50,000 samples.
    ("sample_time", &[("response.delay", 0.0)]),
    // Rougher classes would give roads that are meters high.
    ("roughness.cutoff", &[("roughness.class", 1.0)]),
    ("damper.maximum_damping.front", &[("damper.minimum_damping.front", 0.0), ("suspension.damping.front", 0.0)]),
    ("damper.maximum_damping.rear", &[("damper.minimum_damping.rear", 0.0), ("suspension.damping.rear", 0.0)]),
];

/// Modes that need a file, which the tests of the two models provide.
const NEEDS_A_FILE: [(&str, &str); 2] = [("Driver", "maneuver"), ("Road", "profile")];

/// Initializes an FMU with these parameters.
fn initialize(fmu: &Fmu, parameters: &[(&Variable, f64)]) -> Result<Instance, CallError> {
    let mut instance = fmu.instance();
    for &(variable, value) in parameters {
        match variable.base_type {
            BaseType::Real => instance.set_real(&[variable.reference], &[value])?,
            _ => instance.set_integer(&[variable.reference], &[value as i32])?,
        }
    }
    instance.enter_initialization_mode()?;
    instance.exit_initialization_mode()?;
    Ok(instance)
}

/// The message of an FMU that rejects a value, alone and with the related parameters; `None` if it is accepted.
fn error_of(fmu: &Fmu, parameter: &Variable, value: f64) -> Option<String> {
    let text = |error: CallError| error.messages.iter().map(|message| message.text.as_str()).collect::<String>();
    let alone = text(initialize(fmu, &[(parameter, value)]).err()?);
    if NEEDS_A_FILE.contains(&(&fmu.name, &parameter.name))
        && alone.contains("'table.file' must be the path of a CSV file")
    {
        return None;
    }
    let Some((_, others)) = RELATIONS.iter().find(|(name, _)| *name == parameter.name) else { return Some(alone) };
    let others = others.iter().filter_map(|(name, value)| Some((fmu.description.variable(name)?, *value)));
    // The message must name the conflicting parameters.
    let names: Vec<_> = others.clone().map(|(other, _)| other.name.clone()).chain([parameter.name.clone()]).collect();
    let named = names.iter().filter(|name| alone.contains(&format!("'{name}'"))).count();
    if named == 0 {
        return Some(format!("none of {names:?} is named: {alone}"));
    }
    initialize(fmu, &others.chain([(parameter, value)]).collect::<Vec<_>>()).err().map(text)
}

#[test]
fn every_limit_of_a_parameter_is_accepted() {
    let mut rejected = Vec::new();
    let mut tried = 0;
    for fmu in all() {
        for parameter in fmu.with(Causality::Parameter) {
            for value in [parameter.min, parameter.max].into_iter().flatten().filter(|limit| limit.is_finite()) {
                tried += 1;
                if let Some(message) = error_of(&fmu, parameter, value) {
                    rejected.push(format!("{} {} = {value}: {message}", fmu.name, parameter.name));
                }
            }
        }
    }
    assert!(rejected.is_empty(), "{} of {tried} limits are rejected:\n{}", rejected.len(), rejected.join("\n"));
    assert!(tried > 400, "{tried} limits");
}
