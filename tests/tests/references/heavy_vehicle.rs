//! The heavy truck and its controllers.

use crate::Call::{Read, Run, Set, Step};
use crate::table::Table;
use crate::{Case, NOTHING, compare, within};
use host::loader::Instance;
use tests::{Fmu, ok, reals};

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

/// An instance of a fuzzy PID with gains that are 10 or `gains` before the rules change them, and domains of the rules that
/// are those of error and rate. One sample lasts 1 s and rates are not filtered: the rate is the difference of two errors.
fn plain(fmu: &Fmu, rule_table: f64, gains: [f64; 3], scale: f64) -> Instance {
    let mut instance = fmu.instance();
    let mut set = |name: &str, value: f64| ok(instance.set_real(&[fmu.reference(name)], &[value]));
    for (name, gain) in ["proportional", "integral", "derivative"].into_iter().zip(gains) {
        set(&format!("pid.{name}_gain"), gain);
        set(&format!("fuzzy.{name}_scale"), scale);
    }
    set("fuzzy.error_range", 3.0);
    set("fuzzy.rate_range", 3.0);
    set("filter.time_constant", 0.0);
    set("sample_time", 1.0);
    ok(instance.set_integer(&[fmu.reference("fuzzy.rule_table")], &[rule_table as i32]));
    ok(instance.setup_experiment(0.0, None));
    ok(instance.enter_initialization_mode());
    ok(instance.exit_initialization_mode());
    instance
}

#[test]
fn fuzzy_rules_make_the_whole_surfaces() {
    // 9 digits of increments up to 3: 5e-9, and roundings of gains of 10.
    let table = Table::read("heavy_vehicle/fuzzy_surfaces");
    let fmu = Fmu::named("ActiveFrontSteering");
    let reference = fmu.reference("reference.yaw_rate");
    let gains =
        ["proportional", "integral", "derivative"].map(|name| fmu.reference(&format!("front_steering.{name}_gain")));
    for row in &table.rows {
        let [rules, e, ec, expected @ ..] = &row[..] else { panic!("a row of {} cells", row.len()) };
        let mut instance = plain(&fmu, *rules, [10.0; 3], 1.0);
        ok(instance.set_real(&[reference], &[e - ec]));
        ok(instance.do_step(0.0, 1.0));
        ok(instance.set_real(&[reference], &[*e]));
        ok(instance.do_step(1.0, 1.0));
        for (found, expected) in reals(&mut instance, &gains).into_iter().zip(expected) {
            assert!((found - 10.0 - expected).abs() < 5.1e-9, "{row:?}: {found}");
        }
    }
}

#[test]
fn the_middle_ratio_follows_the_rear_one() {
    // 9 digits of ratios up to 1.
    let table = Table::read("heavy_vehicle/fuzzy_k1");
    let fmu = Fmu::named("AllWheelSteering");
    let inputs = ["driver.steer", "vehicle.sideslip"].map(|name| fmu.reference(name));
    let ratios = ["steer_ratio.rear", "steer_ratio.middle"].map(|name| fmu.reference(name));
    for row in &table.rows {
        // A proportional law: the rear ratio is the error, within -1 and 1.
        let mut instance = plain(&fmu, 0.0, [1.0, 0.0, 0.0], 0.0);
        ok(instance.set_real(&inputs, &[1.0, -row[0]]));
        ok(instance.do_step(0.0, 1.0));
        let found = reals(&mut instance, &ratios);
        assert!((found[0] - row[0].clamp(-1.0, 1.0)).abs() < 1e-15, "{row:?}: {found:?}");
        assert!((found[1] - row[1]).abs() < 5.1e-10, "{row:?}: {found:?}");
    }
}
