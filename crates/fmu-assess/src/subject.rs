//! The subject of an assessment, as the caller describes it, and the values that the caller can set.

use crate::components::{Component, SetupError};
use crate::plant::Plant;
use crate::vehicle::VehicleFile;
use fmu_import::description::Causality;
use fmu_import::names::suggestion;

/// Base component for plants with brake and drive torques as inputs.
pub const ACTUATORS: &str = "BrakeAndDriveActuators";

/// Subject of an assessment.
#[derive(Debug, Clone, Default)]
pub struct Subject {
    /// Name of the plant's FMU.
    pub plant: String,
    /// Components that belong to the vehicle. If empty, the components that the plant needs are used.
    pub base: Vec<String>,
    /// Controllers.
    pub with: Vec<String>,
    /// Values for parameters: component, parameter, value as written. A number can be followed by a space and a unit.
    pub set: Vec<(String, String, String)>,
    /// FMUs of `with` and `base` in the caller's order. If empty, the FMUs of `with` come first.
    pub order: Vec<String>,
    /// Vehicle data and names of signals.
    pub vehicle: VehicleFile,
}

/// FMUs of the drivers: for steering as a function of time, and along a path.
pub(crate) const DRIVERS: [&str; 2] = ["Driver", "PathDriver"];

/// Parameters of drivers and plants that the bench sets, and the alternative for the user.
const GIVEN: [(&str, &str, &str); 6] = [
    ("driver", "geometry.wheelbase", "Set `wheelbase` in the table [vehicle] of a file for `--vehicle`."),
    (
        "driver",
        "vehicle.understeer_gradient",
        "Set `understeer_gradient` in the table [vehicle] of a file for `--vehicle`.",
    ),
    ("driver", "steer.ratio", "Set `steer_ratio` in the table [vehicle] of a file for `--vehicle`."),
    ("driver", "path.vehicle_width", "Set `width` in the table [vehicle] of a file for `--vehicle`."),
    ("driver", "speed.initial", "Use --speed."),
    ("plant", "vehicle.initial_speed", "Use --speed."),
];

/// Parameters of drivers and road that the maneuver procedures prescribe, separated by white space.
const PRESCRIBED: [(&str, &str); 2] = [
    (
        "driver",
        "maneuver table.file path.start path.radius path.turn_in path.arc path.overlap path.offset path.change_distance \
         path.run_out path.lost_distance steer.amplitude steer.start steer.rise_time steer.frequency steer.dwell_time \
         steer.wheel_amplitude steer.wheel_rate steer.maximum_dwell steer.hold_start roll_rate.threshold speed.control \
         speed.final speed.start speed.rise_time release.distance brake.amplitude brake.start brake.rise_time",
    ),
    (
        "road",
        "profile tracks roughness.start roughness.class seed geometry.axle_offset.middle geometry.axle_offset.rear",
    ),
];

/// Checks the caller's values, and names their components as in the scenarios.
pub(crate) fn settings(
    subject: &Subject,
    plant: &Plant,
    components: &[Component],
    drivers: &[Component],
) -> Result<Vec<(String, String, String)>, SetupError> {
    let mut known = vec![plant.component.name.as_str(), "driver"];
    if plant.has_inputs("road_height.") {
        known.push("road");
    }
    known.extend(components.iter().map(|component| component.name.as_str()));
    let mut set = Vec::new();
    for (owner, name, value) in &subject.set {
        if !known.contains(&owner.as_str()) {
            let message = format!("`{name}` cannot be set: there is no component `{owner}`");
            return Err(SetupError::with_help(message, format!("Components: `{}`.", known.join("`, `"))));
        }
        let own = if *owner == plant.component.name { "plant" } else { owner.as_str() };
        let given = GIVEN.iter().find(|(of, parameter, _)| *of == own && parameter == name).map(|(_, _, help)| *help);
        let is_prescribed =
            PRESCRIBED.iter().any(|(of, names)| *of == own && names.split_whitespace().any(|known| known == name));
        if given.is_some() || is_prescribed {
            return Err(SetupError::with_help(
                format!("`{owner}:{name}` cannot be set: the bench sets it"),
                given.unwrap_or("The maneuver procedures prescribe its value."),
            ));
        }
        let is_known = |driver: &Component| driver.description().variable(name).is_some();
        if own == "driver" && !drivers.is_empty() && !drivers.iter().any(is_known) {
            let names = drivers.iter().flat_map(|driver| driver.description().of(Causality::Parameter));
            let help = suggestion(name, names.map(|variable| variable.name.as_str()));
            let message = format!("neither Driver nor PathDriver has a parameter `{name}`");
            return Err(SetupError { message, help });
        }
        let component = std::iter::once(&plant.component).chain(components).find(|component| component.name == *owner);
        if let Some(component) = component.filter(|component| component.description().variable(name).is_none()) {
            let names = component.description().of(Causality::Parameter).map(|variable| variable.name.as_str());
            let message = format!("{} has no parameter `{name}`", component.fmu);
            return Err(SetupError { message, help: suggestion(name, names) });
        }
        set.push((own.to_owned(), name.clone(), value.clone()));
    }
    Ok(set)
}
