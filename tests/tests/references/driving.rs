//! The driver for standard maneuvers, and the car whose results are known in closed form.

use crate::Call::{Read, Run, Set, Step};
use crate::{Case, Limit, NOTHING, Rule, compare, within};

const DRIVER: Case = Case {
    inputs: &["vehicle.*", "body.roll_rate"],
    program: &[Run("PathDriver")],
    // Points define the path, so two implementations differ only by rounding. Outputs have 14 digits; the largest
    // values are stations of some 100 m.
    limits: &[Limit { rule: Rule::Absolute(1e-9), ..within(0.0) }],
    ..NOTHING
};

#[test]
fn path_driver_in_a_double_lane_change_with_pedals() {
    compare(&Case {
        file: "driving/driver_iso3888_1",
        step: 0.002,
        parameters: &[
            ("PathDriver", "maneuver", 2.0),
            ("PathDriver", "path.vehicle_width", 1.75),
            ("PathDriver", "path.overlap", 6.0),
            ("PathDriver", "geometry.wheelbase", 2.7),
            ("PathDriver", "vehicle.understeer_gradient", 0.00303),
            ("PathDriver", "speed.control", 1.0),
            ("PathDriver", "speed.initial", 22.0),
            ("PathDriver", "path.start", 40.0),
            ("PathDriver", "sample_time", 0.002),
        ],
        ..DRIVER
    });
}

#[test]
fn path_driver_on_a_mirrored_circle_with_a_speed_ramp() {
    compare(&Case {
        file: "driving/driver_circle",
        step: 0.005,
        parameters: &[
            ("PathDriver", "maneuver", 1.0),
            ("PathDriver", "path.radius", 60.0),
            ("PathDriver", "path.turn_in", 25.0),
            ("PathDriver", "path.arc", 150.0),
            ("PathDriver", "path.start", 20.0),
            ("PathDriver", "path.mirror", 1.0),
            ("PathDriver", "geometry.wheelbase", 2.7),
            ("PathDriver", "vehicle.understeer_gradient", 0.003),
            ("PathDriver", "lateral.integral_gain", 0.3),
            ("PathDriver", "speed.initial", 10.0),
            ("PathDriver", "speed.final", 16.0),
            ("PathDriver", "speed.start", 3.0),
            ("PathDriver", "speed.rise_time", 8.0),
            ("PathDriver", "response.delay", 0.1),
            ("PathDriver", "sample_time", 0.005),
        ],
        ..DRIVER
    });
}

#[test]
fn path_driver_in_a_fishhook() {
    compare(&Case {
        file: "driving/driver_fishhook",
        step: 0.002,
        parameters: &[
            ("PathDriver", "maneuver", 7.0),
            ("PathDriver", "steer.wheel_amplitude", 2.0),
            ("PathDriver", "steer.wheel_rate", 12.566370614359172),
            ("PathDriver", "steer.start", 0.5),
            ("PathDriver", "speed.initial", 18.0),
            ("PathDriver", "sample_time", 0.002),
        ],
        ..DRIVER
    });
}

#[test]
fn path_driver_loses_the_path_of_a_table() {
    compare(&Case {
        file: "driving/driver_table_lost",
        step: 0.01,
        parameters: &[
            ("PathDriver", "maneuver", 5.0),
            ("PathDriver", "preview.time", 0.5),
            ("PathDriver", "response.delay", 0.13),
            ("PathDriver", "response.time_constant", 0.0),
            ("PathDriver", "path.lost_distance", 6.0),
            ("PathDriver", "speed.control", 1.0),
            ("PathDriver", "speed.initial", 11.0),
            ("PathDriver", "steer.wheel_rate_limit", 6.0),
            ("PathDriver", "lateral.integral_gain", 0.2),
            ("PathDriver", "sample_time", 0.01),
        ],
        files: &[("PathDriver", "table.file", "driving/driver_table_lost_table.csv")],
        ..DRIVER
    });
}

#[test]
fn bicycle_car() {
    const CAR: Case = Case {
        file: "driving/plant_bicycle_car",
        step: 0.002,
        inputs: &["driver.speed", "steer.front", "road_friction.fl"],
        program: &[Read("BicycleCar"), Set("BicycleCar"), Step("BicycleCar")],
        // The reference integrates with the same RK4 substeps of 1 ms, and its file has 12 digits.
        limits: &[within(1e-6)],
        ..NOTHING
    };
    compare(&CAR);
}
