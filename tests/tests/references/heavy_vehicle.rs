//! The heavy truck and its controllers.

use crate::Call::{Read, Run, Set, Step};
use crate::table::Table;
use crate::{Call, Case, NOTHING, compare, simulate, within};
use fmu_import::loader::Instance;
use tests::{Fmu, ok, reals};

const SPEED_60: &[(&str, f64)] = &[("driver.speed", 60.0 / 3.6)];

const PLANT: Case = Case {
    inputs: &["road_height.*", "steer.*", "suspension_force.*"],
    constants: SPEED_60,
    program: &[Read("HeavyVehicle"), Set("HeavyVehicle"), Step("HeavyVehicle")],
    // The reference integrates with 8 RK4 substeps per row, which causes an error of 4e-10 of the peaks. The file has 9
    // digits.
    limits: &[within(1e-6)],
    ..NOTHING
};

const CONTROLLER: Case = Case {
    // The file has 9 digits.
    limits: &[within(1e-7)],
    ..NOTHING
};

const LOOP: Case = Case {
    inputs: &["driver.steer", "road_height.*"],
    constants: SPEED_60,
    // Feedback amplifies the rounding of the road in the file.
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

const CONTROLLED: &[Call] = &[
    Read("HeavyVehicle"),
    Run("YawRateReference"),
    Run("ActiveFrontSteering"),
    Run("AllWheelSteering"),
    Run("SemiActiveFuzzySuspension"),
    Set("HeavyVehicle"),
    Step("HeavyVehicle"),
];

#[test]
fn closed_loop_with_all_controllers_in_a_step_steer() {
    compare(&Case { file: "heavy_vehicle/loop_step60_roadB_all", program: CONTROLLED, ..LOOP });
}

/// Reference: the symmetry of the truck and its rules. The tolerance is 1e-11 of the peaks, because sums in a different
/// order are rounded differently.
#[test]
fn closed_loop_in_a_mirror() {
    let table = Table::read("heavy_vehicle/loop_step60_roadB_all");
    let mirrored = Table {
        names: table.names.iter().map(|name| other_side(name)).collect(),
        rows: table.rows.iter().map(|row| row.iter().zip(&table.names).map(|(v, n)| v * sign(n)).collect()).collect(),
    };
    let is_output = |name: &&str| *name != "time" && !crate::matches(name, LOOP.inputs);
    let signals: Vec<&str> = table.names.iter().map(String::as_str).filter(is_output).collect();
    let others: Vec<String> = signals.iter().map(|name| other_side(name)).collect();
    let others: Vec<&str> = others.iter().map(String::as_str).collect();
    let largest_difference = |parameters: &'static [(&'static str, &'static str, f64)]| {
        let case = Case { file: "heavy_vehicle/loop_step60_roadB_all", program: CONTROLLED, parameters, ..LOOP };
        let (left, right) = (simulate(&case, &table, &signals), simulate(&case, &mirrored, &others));
        let relative = |((name, left), right): ((&&str, &Vec<f64>), &Vec<f64>)| {
            let peak = left.iter().fold(crate::FLOOR, |peak, value| peak.max(value.abs()));
            left.iter().zip(right).fold(0.0, |worst: f64, (l, r)| worst.max((l - sign(name) * r).abs())) / peak
        };
        signals.iter().zip(&left).zip(&right).map(relative).fold(0.0, f64::max)
    };
    let difference = largest_difference(&[]);
    assert!(difference < 1e-11, "{difference:e}");
    // The rules as printed are not symmetric, which shows that the comparison detects asymmetry.
    let difference = largest_difference(STANDARD_RULES);
    assert!(difference > 1e-3, "{difference:e}");
}

const STANDARD_RULES: &[(&str, &str, f64)] = &[
    ("ActiveFrontSteering", "fuzzy.rule_table", 1.0),
    ("AllWheelSteering", "fuzzy.rule_table", 1.0),
    ("SemiActiveFuzzySuspension", "fuzzy.rule_table", 1.0),
];

/// The signal on the other side of the vehicle.
fn other_side(name: &str) -> String {
    match name.rsplit_once('.') {
        Some((signal, place @ ("fl" | "ml" | "rl" | "l"))) => format!("{signal}.{}r", &place[..place.len() - 1]),
        Some((signal, place @ ("fr" | "mr" | "rr" | "r"))) => format!("{signal}.{}l", &place[..place.len() - 1]),
        _ => name.to_owned(),
    }
}

/// -1 for quantities that change their sign in the mirror: quantities along y, and rotations about x or z.
fn sign(name: &str) -> f64 {
    const ODD: &[&str] = &[
        "driver.steer",
        "steer.*",
        "steer_correction.*",
        "reference.yaw_rate",
        "reference.sideslip",
        "vehicle.lateral_acceleration",
        "vehicle.sideslip",
        "vehicle.yaw_rate",
        "body.roll*",
        "demand.roll_moment",
        "tire_lateral_force.*",
    ];
    if crate::matches(name, ODD) { -1.0 } else { 1.0 }
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

/// An instance of a fuzzy PID controller whose gains before adaptation are 10 or `gains`, and whose rules use error and
/// rate without scaling. The sample time is 1 s and the rate is not filtered, so the rate is the difference of two
/// errors.
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
    // Increments up to 3 that are printed with 9 digits have an error of 5e-9. The rest of the tolerance covers the
    // rounding of gains of 10.
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
    // The file contains ratios up to 1 with 9 digits.
    let table = Table::read("heavy_vehicle/fuzzy_k1");
    let fmu = Fmu::named("AllWheelSteering");
    let inputs = ["driver.steer", "vehicle.sideslip"].map(|name| fmu.reference(name));
    let ratios = ["steer_ratio.rear", "steer_ratio.middle"].map(|name| fmu.reference(name));
    for row in &table.rows {
        // With a proportional law, the rear ratio is the error, limited to -1 to 1.
        let mut instance = plain(&fmu, 0.0, [1.0, 0.0, 0.0], 0.0);
        ok(instance.set_real(&inputs, &[1.0, -row[0]]));
        ok(instance.do_step(0.0, 1.0));
        let found = reals(&mut instance, &ratios);
        assert!((found[0] - row[0].clamp(-1.0, 1.0)).abs() < 1e-15, "{row:?}: {found:?}");
        assert!((found[1] - row[1]).abs() < 5.1e-10, "{row:?}: {found:?}");
    }
}
