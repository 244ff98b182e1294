//! The three-axle rescue vehicle and its controllers.

use crate::Call::{Read, Run, Set, Step};
use crate::{Call, Case, NOTHING, STEP, compare, within};
use tests::{Fmu, ok, real, reals};

const PLANT: Case = Case {
    inputs: &["driver.speed", "steer.*", "suspension_force.*", "road_height.*"],
    program: &[Set("RescueVehicle"), Read("RescueVehicle"), Step("RescueVehicle")],
    // The reference integrates with 16 RK4 substeps per row, the FMU with 4. In smooth runs, this makes a difference of
    // 3e-10. The file has 8 digits.
    limits: &[within(1e-6)],
    ..NOTHING
};

const FEEDBACK: &[&str] = &["body.*", "wheel_*", "vehicle.*"];

const LOOP: Case = Case {
    inputs: &["driver.*", "road_height.*"],
    program: &[
        Set("RescueVehicle"),
        Read("RescueVehicle"),
        Run("FuzzyCoordination"),
        Run("DualSlidingModeSteering"),
        Run("IntegratedLqrSuspension"),
        Run("RollLqrSuspension"),
        Run("SuspensionMixer"),
        Set("RescueVehicle"),
        Read("RescueVehicle"),
        Step("RescueVehicle"),
    ],
    // The inputs in the file have 8 digits, and feedback amplifies their rounding.
    limits: &[within(1e-5)],
    ..NOTHING
};

const STEERING: Case = Case {
    inputs: &["driver.steer", "vehicle.*", "weight.steering"],
    program: &[Run("DualSlidingModeSteering")],
    // The file has 8 digits.
    limits: &[within(1e-6)],
    ..NOTHING
};

/// The front axle alone, with the same file, because its limits do not depend on the other axles.
const FRONT_AXLE: Case = Case {
    inputs: &["driver.steer", "vehicle.speed"],
    program: &[Run("FrontSteeringActuator")],
    renamed: &[("steer.front", "steer.front")],
    // The file has 8 digits.
    limits: &[within(1e-6)],
    ..NOTHING
};

const COORDINATION: Case = Case {
    inputs: &["driver.steer", "vehicle.speed"],
    program: &[Run("FuzzyCoordination")],
    // The controller has no state, and the file has 12 digits. Both implementations tabulate the output sets at 101
    // points.
    limits: &[within(1e-7)],
    ..NOTHING
};

#[test]
fn plant_in_ordinary_driving() {
    compare(&Case { file: "rescue_vehicle/plant_nominal", ..PLANT });
}

#[test]
fn plant_with_wheels_in_the_air_and_saturated_tires() {
    // When a wheel lifts off, the derivative has a kink and RK4 loses its order: the error is 1e-6 with substeps of
    // 0.25 ms. The tolerance is 100 times this error.
    compare(&Case { file: "rescue_vehicle/plant_limits", limits: const { &[within(1e-4)] }, ..PLANT });
}

#[test]
fn plant_with_the_linear_laws_of_the_paper() {
    const LINEAR: &[(&str, &str, f64)] =
        &[("RescueVehicle", "tire.model", 0.0), ("RescueVehicle", "tire.lift_off", 0.0)];
    compare(&Case { file: "rescue_vehicle/plant_linear_tire", parameters: LINEAR, ..PLANT });
}

#[test]
fn dual_sliding_mode_steering() {
    compare(&Case { file: "rescue_vehicle/dsm", ..STEERING });
}

#[test]
fn lqr_suspensions() {
    // The controllers have no discrete state, so the rows are independent of each other. The file has 12 digits, but
    // the gains come from two different Riccati solvers.
    let case = Case { file: "rescue_vehicle/lqr", inputs: FEEDBACK, limits: const { &[within(1e-6)] }, ..NOTHING };
    const INTEGRATED: &[Call] = &[Run("IntegratedLqrSuspension")];
    compare(&Case { program: INTEGRATED, ignored: &["roll_force.*"], ..case });
    const ROLL: &[Call] = &[Run("RollLqrSuspension")];
    compare(&Case { program: ROLL, ignored: &["integrated_force.*"], ..case });
}

#[test]
fn fuzzy_coordination() {
    compare(&Case {
        file: "rescue_vehicle/coordination",
        ignored: &["as_printed.*"],
        // The file has rows at 1 deg, which is the threshold, and rounds this value down.
        parameters: &[("FuzzyCoordination", "steering.activation_angle", 0.017_453_29)],
        ..COORDINATION
    });
}

#[test]
fn fuzzy_coordination_with_the_rules_as_printed() {
    compare(&Case {
        file: "rescue_vehicle/coordination",
        renamed: &[("as_printed.weight.integrated", "weight.integrated"), ("as_printed.weight.roll", "weight.roll")],
        parameters: &[("FuzzyCoordination", "rules.as_printed", 1.0)],
        ..COORDINATION
    });
}

#[test]
fn closed_loop_with_individual_control_in_a_step_steer() {
    const INDIVIDUAL: &[(&str, &str, f64)] = &[("FuzzyCoordination", "strategy", 1.0)];
    compare(&Case { file: "rescue_vehicle/loop_step_individual", parameters: INDIVIDUAL, ..LOOP });
}

#[test]
fn closed_loop_with_coordination_in_a_step_steer() {
    compare(&Case { file: "rescue_vehicle/loop_step_coordination", ..LOOP });
}

#[test]
fn closed_loop_with_coordination_in_a_lane_change() {
    compare(&Case { file: "rescue_vehicle/loop_lane_change_coordination", ..LOOP });
}

#[test]
fn gain_matrices_of_the_lqr_suspensions() {
    let path = tests::workspace().join("tests/references/rescue_vehicle/gains.json");
    let text = std::fs::read_to_string(path).expect("the file is there");
    let gains: serde_json::Value = serde_json::from_str(&text).expect("the file is JSON");
    const WHEELS: [&str; 6] = ["fl", "fr", "ml", "mr", "rl", "rr"];
    let single = |state: &str| vec![format!("gain.{state}")];
    let wheels = |state: &str| WHEELS.iter().map(|wheel| format!("gain.{state}.{wheel}")).collect();
    // The states, in the order of the file.
    let states: Vec<String> = [
        single("heave"),
        single("pitch"),
        single("roll"),
        wheels("wheel_height"),
        single("heave_rate"),
        single("pitch_rate"),
        single("roll_rate"),
        wheels("wheel_velocity"),
        single("sideslip"),
        single("yaw_rate"),
    ]
    .concat();
    for (name, key) in [("IntegratedLqrSuspension", "K_integrated"), ("RollLqrSuspension", "K_roll")] {
        let expected: Vec<Vec<f64>> = serde_json::from_value(gains[key].clone()).expect("a matrix");
        let fmu = Fmu::named(name);
        let mut instance = fmu.started();
        let largest = expected.iter().flatten().fold(0.0_f64, |largest, gain| largest.max(gain.abs()));
        assert!(largest > 1000.0, "{name}: the reference matrix is not empty");
        for (i, wheel) in WHEELS.iter().enumerate() {
            for (j, state) in states.iter().enumerate() {
                let found = real(&fmu, &mut instance, &format!("{state}.{wheel}"));
                // Both Riccati solvers have a residual near 1e-9 of the solution.
                let error = (found - expected[i][j]).abs() / largest;
                assert!(error <= 1e-6, "{name}: {state}.{wheel} = {found}, {} was expected", expected[i][j]);
            }
        }
    }
}

#[test]
fn the_plant_starts_at_rest() {
    // Without inputs, everything except loads, speed and friction is exactly 0, at any speed.
    let fmu = Fmu::named("RescueVehicle");
    let mut instance = fmu.started();
    for k in 0..100 {
        ok(instance.do_step(f64::from(k) * STEP, STEP));
    }
    let states: Vec<_> = fmu.states().into_iter().filter(|state| state.name != "vehicle.position_x").collect();
    let references: Vec<_> = states.iter().map(|state| state.reference).collect();
    let values = reals(&mut instance, &references);
    for (state, value) in states.iter().zip(values) {
        assert_eq!(value, 0.0, "{}", state.name);
    }
    // 36 t on six wheels are a load of 36000 * 9.81 / 6 N on each wheel, except for rounding in the last digits.
    let load = real(&fmu, &mut instance, "tire_load.mr");
    assert!((load - 58_860.0).abs() < 1e-9 * 58_860.0, "tire_load.mr = {load}");
}

#[test]
fn front_axle_within_its_limits() {
    compare(&Case { file: "rescue_vehicle/dsm", ..FRONT_AXLE });
}

#[test]
fn front_axle_is_that_of_the_steering_law() {
    // Both FMUs use one implementation of the limits, so the results are bit-identical: at all speeds, in turns to both
    // sides, and with sideslip, which is an input of the control law only.
    let fmus = [Fmu::named("DualSlidingModeSteering"), Fmu::named("FrontSteeringActuator")];
    for model in [0, 1] {
        let mut instances = fmus.each_ref().map(|fmu| {
            let mut instance = fmu.instance();
            ok(instance.set_integer(&[fmu.reference("reference.model")], &[model]));
            ok(instance.enter_initialization_mode());
            ok(instance.exit_initialization_mode());
            instance
        });
        let law = ["vehicle.sideslip", "vehicle.yaw_rate", "weight.steering"].map(|name| fmus[0].reference(name));
        for k in 0..5000 {
            let time = f64::from(k) * STEP;
            let (steer, speed) = (0.6 * (1.3 * time).sin(), 12.0 * (0.4 * time).sin().abs());
            ok(instances[0].set_real(&law, &[0.02 * time.cos(), 0.2 * time.sin(), 1.0]));
            let angles = [0, 1].map(|i| {
                let inputs = ["driver.steer", "vehicle.speed"].map(|name| fmus[i].reference(name));
                ok(instances[i].set_real(&inputs, &[steer, speed]));
                ok(instances[i].do_step(time, STEP));
                real(&fmus[i], &mut instances[i], "steer.front")
            });
            assert_eq!(angles[0].to_bits(), angles[1].to_bits(), "reference.model {model}, {time} s");
        }
    }
}
