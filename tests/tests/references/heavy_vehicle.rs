//! The heavy truck and its controllers.

use crate::Call::{Read, Run, Set, Step};
use crate::{Case, NOTHING, compare, within};

const SPEED_60: &[(&str, f64)] = &[("driver.speed", 60.0 / 3.6)];

const PLANT: Case = Case {
    inputs: &["road_height.*", "steer.*", "suspension_force.*"],
    constants: SPEED_60,
    program: &[Read("HeavyVehicle"), Set("HeavyVehicle"), Step("HeavyVehicle")],
    // The reference integrates with 8 substeps of RK4 per row, 4e-10 of the peaks, and has 9 digits.
    limits: &[within(1e-6)],
    ..NOTHING
};

const CONTROLLER: Case = Case {
    // 9 digits.
    limits: &[within(1e-7)],
    ..NOTHING
};

const LOOP: Case = Case {
    inputs: &["driver.steer", "road_height.*"],
    constants: SPEED_60,
    // Feedback amplifies the rounding of the road.
    limits: &[within(1e-5)],
    ..NOTHING
};

#[test]
fn plant_in_a_step_steer_on_a_rough_road() {
    compare(&Case { file: "heavy_vehicle/plant_coupled_step60_roadB", ..PLANT });
}

#[test]
fn plant_with_vertical_motion_only() {
    compare(&Case {
        file: "heavy_vehicle/plant_vertical_only_roadB",
        parameters: &[("HeavyVehicle", "coupling", 1.0)],
        ..PLANT
    });
}

#[test]
fn plant_with_lateral_motion_only() {
    compare(&Case {
        file: "heavy_vehicle/plant_lateral_only_step60",
        parameters: &[("HeavyVehicle", "coupling", 2.0)],
        ..PLANT
    });
}

#[test]
fn plant_with_all_inputs() {
    compare(&Case {
        file: "heavy_vehicle/plant_coupled_all_inputs72",
        constants: &[("driver.speed", 72.0 / 3.6)],
        ..PLANT
    });
}

#[test]
fn yaw_rate_reference() {
    compare(&Case {
        file: "heavy_vehicle/ctrl_reference_model",
        inputs: &["driver.steer", "vehicle.speed"],
        program: &[Run("YawRateReference")],
        ..CONTROLLER
    });
}

#[test]
fn active_front_steering() {
    compare(&Case {
        file: "heavy_vehicle/ctrl_active_front_steer",
        inputs: &["driver.steer", "reference.yaw_rate", "vehicle.yaw_rate"],
        program: &[Run("ActiveFrontSteering")],
        ..CONTROLLER
    });
}

#[test]
fn all_wheel_steering() {
    compare(&Case {
        file: "heavy_vehicle/ctrl_all_wheel_steer",
        inputs: &["driver.steer", "reference.sideslip", "vehicle.sideslip"],
        program: &[Run("AllWheelSteering")],
        ..CONTROLLER
    });
}

#[test]
fn semi_active_suspension() {
    compare(&Case {
        file: "heavy_vehicle/ctrl_semi_active_suspension",
        inputs: &["body.*", "suspension_velocity.*"],
        program: &[Run("SemiActiveFuzzySuspension")],
        ..CONTROLLER
    });
}

#[test]
fn closed_loop_with_all_controllers_in_a_step_steer() {
    compare(&Case {
        file: "heavy_vehicle/loop_step60_roadB_all",
        program: &[
            Read("HeavyVehicle"),
            Run("YawRateReference"),
            Run("ActiveFrontSteering"),
            Run("AllWheelSteering"),
            Run("SemiActiveFuzzySuspension"),
            Set("HeavyVehicle"),
            Step("HeavyVehicle"),
        ],
        ..LOOP
    });
}

#[test]
fn closed_loop_without_control_in_a_step_steer() {
    compare(&Case {
        file: "heavy_vehicle/loop_step60_roadB_none",
        wires: &[("HeavyVehicle", "steer.front", "driver.steer")],
        program: &[Read("HeavyVehicle"), Run("YawRateReference"), Set("HeavyVehicle"), Step("HeavyVehicle")],
        ..LOOP
    });
}

#[test]
fn closed_loop_with_six_wheel_steering_on_a_flat_road() {
    compare(&Case {
        file: "heavy_vehicle/loop_step80_flat_six_wheel",
        constants: &[("driver.speed", 80.0 / 3.6)],
        program: &[
            Read("HeavyVehicle"),
            Run("YawRateReference"),
            Run("ActiveFrontSteering"),
            Run("AllWheelSteering"),
            Set("HeavyVehicle"),
            Step("HeavyVehicle"),
        ],
        ..LOOP
    });
}
