//! `Driver` and `Road`: maneuvers, profiles and tracks. `Sensor` and `Actuator`: their effect on a signal.

use crate::Call::{Read, Run, Set, Step};
use crate::{Case, Limit, NOTHING, Rule, compare, within};

// The file has 10 digits; the reference implements the same formulas independently.
const DRIVER: Case = Case { program: &[Run("Driver")], limits: &[within(1e-8)], ..NOTHING };

const ROAD: Case = Case {
    inputs: &["vehicle.speed"],
    program: &[Run("Road")],
    // The file has 10 digits; the speed is exact. The recursion over some thousand points only adds rounding errors.
    limits: &[within(1e-8)],
    ..NOTHING
};

/// Distances between the axles, for all roads except the road with the start values of the parameters.
const AXLES: [(&str, &str, f64); 2] =
    [("Road", "geometry.axle_offset.middle", 2.95), ("Road", "geometry.axle_offset.rear", 4.6)];

fn driver(file: &'static str, parameters: &'static [(&'static str, &'static str, f64)]) {
    compare(&Case { file, parameters, ..DRIVER });
}

fn road(file: &'static str, parameters: &'static [(&'static str, &'static str, f64)]) {
    compare(&Case { file, parameters, ..ROAD });
}

#[test]
fn driver_on_a_straight_road_with_pedals_and_speed() {
    driver(
        "sources/driver_straight",
        &[
            ("Driver", "maneuver", 0.0),
            ("Driver", "speed.initial", 20.0),
            ("Driver", "speed.final", 8.0),
            ("Driver", "speed.start", 1.0),
            ("Driver", "speed.rise_time", 3.0),
            ("Driver", "throttle.amplitude", 0.6),
            ("Driver", "throttle.start", 0.5),
            ("Driver", "throttle.rise_time", 0.25),
            ("Driver", "brake.amplitude", 0.9),
            ("Driver", "brake.start", 4.0),
            ("Driver", "brake.rise_time", 0.0),
        ],
    );
}

#[test]
fn driver_with_the_start_values() {
    driver("sources/driver_ramp_step", &[]);
}

#[test]
fn driver_in_a_fishhook() {
    driver(
        "sources/driver_fishhook",
        &[
            ("Driver", "maneuver", 2.0),
            ("Driver", "steer.amplitude", 0.12),
            ("Driver", "steer.rise_time", 0.4),
            ("Driver", "steer.reversal_start", 3.0),
            ("Driver", "steer.reversal_time", 0.5),
            ("Driver", "steer.reversal_amplitude", 0.08),
        ],
    );
}

#[test]
fn driver_in_a_double_lane_change() {
    driver(
        "sources/driver_double_lane_change",
        &[
            ("Driver", "maneuver", 3.0),
            ("Driver", "steer.amplitude", 0.064),
            ("Driver", "steer.start", 0.5),
            ("Driver", "steer.period", 3.0),
            ("Driver", "steer.reversal_start", 4.0),
        ],
    );
}

#[test]
fn driver_in_a_slalom_of_three_periods() {
    driver(
        "sources/driver_slalom",
        &[("Driver", "maneuver", 4.0), ("Driver", "steer.period", 1.6), ("Driver", "steer.cycles", 3.0)],
    );
}

#[test]
fn driver_in_a_slalom_between_cones_with_a_rising_speed() {
    driver(
        "sources/driver_slalom_cones",
        &[
            ("Driver", "maneuver", 4.0),
            ("Driver", "steer.period", 0.0),
            ("Driver", "steer.cone_distance", 18.0),
            ("Driver", "speed.initial", 8.0),
            ("Driver", "speed.final", 24.0),
            ("Driver", "speed.start", 2.0),
            ("Driver", "speed.rise_time", 5.0),
        ],
    );
}

#[test]
fn driver_in_a_sine_with_dwell() {
    driver(
        "sources/driver_sine_with_dwell",
        &[
            ("Driver", "maneuver", 5.0),
            ("Driver", "steer.amplitude", 0.08),
            ("Driver", "steer.frequency", 0.8),
            ("Driver", "steer.dwell_time", 0.45),
        ],
    );
}

#[test]
fn driver_in_a_rising_sweep_with_its_tail() {
    driver(
        "sources/driver_sine_sweep",
        &[
            ("Driver", "maneuver", 6.0),
            ("Driver", "steer.start", 2.0),
            ("Driver", "steer.frequency", 0.3),
            ("Driver", "steer.final_frequency", 3.1),
            ("Driver", "steer.duration", 6.0),
        ],
    );
}

#[test]
fn driver_from_a_table() {
    compare(&Case {
        file: "sources/driver_table",
        parameters: &[("Driver", "maneuver", 7.0)],
        files: &[("Driver", "table.file", "sources/driver_table_file.csv")],
        ..DRIVER
    });
}

#[test]
fn road_with_the_start_values() {
    road("sources/road_default", &[]);
}

#[test]
fn road_that_starts_at_the_front_axle_changes_and_is_driven_back() {
    road(
        "sources/road_from_front_axle",
        const {
            &[
                AXLES[0],
                AXLES[1],
                ("Road", "tracks", 2.0),
                ("Road", "track.coherence", 0.6),
                ("Road", "seed", 7.0),
                ("Road", "roughness.class", 2.0),
                ("Road", "roughness.cutoff", 0.02),
                ("Road", "roughness.spacing", 0.02),
                ("Road", "roughness.start", 1.0),
                ("Road", "roughness.change_time", 1.5),
            ]
        },
    );
}

#[test]
fn road_that_starts_at_the_rear_axle_with_a_delayed_track() {
    road(
        "sources/road_from_rear_axle",
        const {
            &[
                AXLES[0],
                AXLES[1],
                ("Road", "tracks", 3.0),
                ("Road", "seed", 3.0),
                ("Road", "roughness.class", 0.0),
                ("Road", "roughness.coefficient", 100e-6),
                ("Road", "roughness.cutoff", 0.0006),
                ("Road", "roughness.start", 2.0),
            ]
        },
    );
}

/// The FMU interpolates a table of the envelope; the cubic interpolation has an error of 2.4e-9 m (standard deviation)
/// for class B. The tolerance is eight standard deviations.
const INTERPOLATED: &[Limit] = &[
    Limit { columns: &["road_height.*"], rule: Rule::Absolute(2e-8), ..within(0.0) },
    Limit { columns: &["road.distance", "road_friction.*"], ..within(1e-8) },
];

#[test]
fn road_of_cosines_with_mixed_tracks() {
    compare(&Case {
        file: "sources/road_harmonics_mixed",
        parameters: const {
            &[
                AXLES[0],
                AXLES[1],
                ("Road", "profile", 2.0),
                ("Road", "tracks", 2.0),
                ("Road", "seed", 2.0),
                ("Road", "roughness.class", 2.0),
            ]
        },
        limits: INTERPOLATED,
        ..ROAD
    });
}

#[test]
fn road_of_cosines_with_a_delayed_track() {
    compare(&Case {
        file: "sources/road_harmonics_delayed",
        parameters: const {
            &[
                AXLES[0],
                AXLES[1],
                ("Road", "profile", 2.0),
                ("Road", "tracks", 3.0),
                ("Road", "seed", 2.0),
                ("Road", "roughness.class", 2.0),
            ]
        },
        limits: INTERPOLATED,
        ..ROAD
    });
}

#[test]
fn road_from_a_table_with_a_delayed_track() {
    compare(&Case {
        file: "sources/road_table",
        parameters: const { &[AXLES[0], AXLES[1], ("Road", "profile", 3.0), ("Road", "tracks", 3.0)] },
        files: &[("Road", "table.file", "sources/road_table_file.csv")],
        ..ROAD
    });
}

#[test]
fn road_with_a_bump_and_changing_friction() {
    road(
        "sources/road_bump_and_friction",
        const {
            &[
                AXLES[0],
                AXLES[1],
                ("Road", "profile", 0.0),
                ("Road", "obstacle.shape", 1.0),
                ("Road", "obstacle.start", 10.0),
                ("Road", "obstacle.length", 4.5),
                ("Road", "obstacle.height.left", 0.04),
                ("Road", "obstacle.height.right", -0.02),
                ("Road", "friction.left", 0.9),
                ("Road", "friction.right", 0.3),
                ("Road", "friction.change_start", 21.005),
                ("Road", "friction.changed_left", 0.5),
                ("Road", "friction.changed_right", 0.2),
            ]
        },
    );
}

#[test]
fn road_with_a_trapezoid_in_time() {
    road(
        "sources/road_trapezoid_in_time",
        const {
            &[
                AXLES[0],
                AXLES[1],
                ("Road", "profile", 0.0),
                ("Road", "obstacle.shape", 2.0),
                ("Road", "obstacle.in_time", 1.0),
                ("Road", "obstacle.start", 1.0),
                ("Road", "obstacle.length", 0.6),
                ("Road", "obstacle.height.left", 0.03),
                ("Road", "obstacle.height.right", 0.05),
            ]
        },
    );
}

const SENSOR: Case = Case {
    inputs: &["sensor.true_value"],
    program: &[Run("Sensor")],
    // The file has 10 digits. No value is so close to the middle between two multiples that its rounding matters.
    limits: &[within(1e-9)],
    ..NOTHING
};

fn sensor(file: &'static str, parameters: &'static [(&'static str, &'static str, f64)]) {
    compare(&Case { file, parameters, ..SENSOR });
}

const ACTUATOR: Case = Case {
    inputs: &["actuator.command"],
    program: &[Read("Actuator"), Set("Actuator"), Step("Actuator")],
    // At the kinks of the rate limit, the Runge-Kutta steps of 5 us in the reference cause an error of 1.6e-10.
    limits: &[within(1e-9)],
    ..NOTHING
};

#[test]
fn sensor_with_all_effects() {
    sensor(
        "sources/sensor_imperfect",
        &[
            ("Sensor", "sensor.delay", 0.025),
            ("Sensor", "sensor.bias", 0.03),
            ("Sensor", "sensor.noise", 0.08),
            ("Sensor", "seed", 11.0),
            ("Sensor", "sensor.resolution", 0.02),
        ],
    );
}

#[test]
fn sensor_with_the_longest_delay() {
    sensor(
        "sources/sensor_noisy",
        &[("Sensor", "sensor.delay", 1.0), ("Sensor", "sensor.noise", 0.5), ("Sensor", "seed", 3.0)],
    );
}

#[test]
fn actuator_with_all_limits() {
    compare(&Case {
        file: "sources/actuator_limited",
        parameters: &[
            ("Actuator", "actuator.time_constant", 0.04),
            ("Actuator", "actuator.rate_limit", 8.0),
            ("Actuator", "actuator.minimum", -0.9),
            ("Actuator", "actuator.maximum", 1.3),
            ("Actuator", "actuator.initial_value", 0.25),
        ],
        ..ACTUATOR
    });
}
