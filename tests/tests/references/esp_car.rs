//! The car with semi-active suspension, antilock brakes and yaw control.

use crate::Call::{Read, Run, Set, Step};
use crate::{Case, Limit, NOTHING, Rule, compare, within};

const ROLLING: (&str, &str, f64) = ("EspCar", "vehicle.initial_speed", 60.0 / 3.6);

const PLANT: Case = Case {
    inputs: &["steer.front", "road_height.*", "suspension_force.*", "brake_torque.*", "drive_torque.*"],
    parameters: &[ROLLING],
    program: &[Read("EspCar"), Set("EspCar"), Step("EspCar")],
    // The reference integrates with 20 RK4 substeps per row, which causes an error of 7e-7 of the peaks; the FMU makes
    // 10 substeps per row.
    limits: &[within(1e-5)],
    ..NOTHING
};

const CONTROLLER: Case = Case {
    // These FMUs have no integration error. The file has 9 digits; the inputs were rounded before the run.
    limits: &[within(1e-7)],
    ..NOTHING
};

const LOOP: Case = Case {
    inputs: &["driver.*", "road_height.*"],
    wires: &[("EspCar", "steer.front", "driver.steer")],
    program: &[
        Read("EspCar"),
        Run("FiniteStateCoordination"),
        Run("SemiActivePidSuspension"),
        Run("DirectYawControl"),
        // The antilock brakes need the pressure that the pedal demands in the same row.
        Set("BrakeAndDriveActuators"),
        Read("BrakeAndDriveActuators"),
        Run("AntilockBraking"),
        Run("BrakeAndDriveActuators"),
        Set("EspCar"),
        Step("EspCar"),
    ],
    limits: SWITCHING,
    ..NOTHING
};

/// The suspension forces jump when the suspension velocity changes its sign; the state and the gains jump when a signal
/// crosses a threshold. Such a jump can be off by one row. These shifts, and the rounding of the road in the file,
/// affect the other signals only slightly.
const SWITCHING: &[Limit] = &[
    Limit { except: &["coordination.state", "suspension_integral_gain.*", "suspension_force.*"], ..within(1e-4) },
    Limit { columns: &["suspension_force.*"], rule: Rule::Mismatch { tolerance: 1e-3, share: 0.005 }, ..within(0.0) },
    Limit {
        columns: &["coordination.state", "suspension_integral_gain.*"],
        rule: Rule::Mismatch { tolerance: 1e-6, share: 0.005 },
        ..within(0.0)
    },
];

#[test]
fn plant_on_a_rough_road() {
    compare(&Case { file: "esp_car/plant_ride_60", ..PLANT });
}

#[test]
fn plant_to_locked_wheels() {
    compare(&Case { file: "esp_car/plant_handling_lock", ..PLANT });
}

#[test]
fn plant_from_rest_and_back() {
    compare(&Case {
        file: "esp_car/plant_launch_stop",
        parameters: &[("EspCar", "vehicle.initial_speed", 0.0)],
        ..PLANT
    });
}

#[test]
fn semi_active_suspension() {
    compare(&Case {
        file: "esp_car/sass",
        inputs: &[
            "enable.suspension",
            "corner_acceleration.*",
            "suspension_velocity.*",
            "suspension_proportional_gain.*",
            "suspension_integral_gain.*",
            "suspension_derivative_gain.*",
        ],
        program: &[Run("SemiActivePidSuspension")],
        ..CONTROLLER
    });
}

#[test]
fn direct_yaw_control() {
    compare(&Case {
        file: "esp_car/dyc",
        inputs: &["enable.yaw_control", "driver.steer", "vehicle.*"],
        program: &[Run("DirectYawControl")],
        ..CONTROLLER
    });
}

#[test]
fn antilock_braking() {
    compare(&Case {
        file: "esp_car/abs",
        inputs: &[
            "enable.antilock",
            "target_slip.*",
            "brake.master_pressure",
            "yaw_control_pressure.*",
            "vehicle.speed",
            "wheel_speed.*",
        ],
        program: &[Run("AntilockBraking")],
        ..CONTROLLER
    });
}

#[test]
fn finite_state_coordination() {
    compare(&Case {
        file: "esp_car/coordinator",
        inputs: &["vehicle.*", "body.*", "driver.*"],
        program: &[Run("FiniteStateCoordination")],
        ..CONTROLLER
    });
}

#[test]
fn brake_and_drive_actuators() {
    compare(&Case {
        file: "esp_car/actuators",
        inputs: &["driver.*", "brake_pressure_command.*", "wheel_speed.*"],
        program: &[Run("BrakeAndDriveActuators")],
        ..CONTROLLER
    });
}

const NONE: &[(&str, &str, f64)] = &[ROLLING, ("FiniteStateCoordination", "strategy", 0.0)];
const INDIVIDUAL: &[(&str, &str, f64)] = &[ROLLING, ("FiniteStateCoordination", "strategy", 1.0)];
const COORDINATED: &[(&str, &str, f64)] = &[ROLLING, ("FiniteStateCoordination", "strategy", 2.0)];

#[test]
fn closed_loop_without_control_in_braking() {
    compare(&Case { file: "esp_car/loop_nc_brake", parameters: NONE, ..LOOP });
}

#[test]
fn closed_loop_with_coordination_in_braking() {
    compare(&Case { file: "esp_car/loop_cc_brake", parameters: COORDINATED, ..LOOP });
}

#[test]
fn closed_loop_with_individual_control_in_braking_in_a_turn() {
    compare(&Case { file: "esp_car/loop_ic_steer_brake", parameters: INDIVIDUAL, ..LOOP });
}

#[test]
fn closed_loop_with_coordination_in_a_step_steer_on_a_rough_road() {
    compare(&Case { file: "esp_car/loop_cc_step_steer_road", parameters: COORDINATED, ..LOOP });
}

#[test]
fn closed_loop_with_coordination_in_accelerating_in_a_turn() {
    compare(&Case { file: "esp_car/loop_cc_steer_accel", parameters: COORDINATED, ..LOOP });
}
