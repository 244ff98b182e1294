//! FMUs of this exporter as components in model exchange, against their own co-simulation, closed forms, and the
//! published runs of the Reference FMUs.

use fmu_system::export::System;
use fmu_system::failure::FailureKind;
use fmu_system::fmus::Fmus;
use fmu_system::master::execute;
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use fmu_system::run::Recording;
use std::path::Path;
use tests::workspace;

fn plan(component: &str, stop: f64, step: f64, signals: &str) -> Plan {
    let text = format!(
        "title = \"Test\"\n[simulation]\nstop = {stop:?}\nstep = {step:?}\n[[component]]\nname = \"own\"\n{component}\n\
         [[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\nsignals = [{signals}]\n"
    );
    let folder = std::env::var_os("CHASSIS_FMU3_DIR").map_or_else(|| workspace().join("target/fmu3"), Into::into);
    let plan = resolve_text(Path::new("test.toml"), &text, &FmuFolder::new([folder]), &Options::default());
    plan.unwrap_or_else(|error| panic!("pack the FMUs as `scripts/test` does: {:?}", error.lines()))
}

fn run(plan: &Plan) -> Recording {
    execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).expect("FMUs")).expect("it runs")
}

fn columns(recording: &Recording) -> Vec<&[f64]> {
    (0..recording.columns.len()).map(|index| recording.column(index).expect("recorded")).collect()
}

/// 200 ms of a plant with 60 states, driven by its start values. Both interfaces use the same method with the same
/// steps; model exchange adds them to the time in another way, which rounds.
#[test]
fn a_vehicle_moves_as_in_co_simulation() {
    let keys = "fmu = \"RescueVehicle\"\ninputs = { \"road_height.*\" = 0.01, \"road_friction.*\" = 1.0, \"driver.speed\" = 5.0, \
                \"steer.front\" = 0.05, \"steer.middle\" = 0.0, \"steer.rear\" = 0.0, \"suspension_force.*\" = 0.0 }\n";
    let signals = "\"own:body.*\", \"own:vehicle.*\"";
    let solver = "interface = \"model-exchange\"\nsolver = \"runge_kutta\"\nmax_step = 0.00025\n";
    let [own, exchange] = ["", solver].map(|more| run(&plan(&format!("{keys}{more}"), 0.2, 0.001, signals)));
    let mut moved = 0;
    for (own, exchange) in columns(&own).into_iter().zip(columns(&exchange)) {
        let peak = own.iter().fold(1e-3_f64, |peak, value| peak.max(value.abs()));
        moved += usize::from(own.iter().any(|value| *value != own[0]));
        for (own, exchange) in own.iter().zip(exchange) {
            assert!((own - exchange).abs() < 1e-9 * peak, "{own} {exchange}");
        }
    }
    assert!(moved > 5, "{moved} of {} signals", own.columns.len());
}

/// Reference: the ball in co-simulation, up to the rest after 2.5 s. In model exchange, the indicator of this exporter is
/// shifted by 1e-9, so a bounce at the speed v is found 1e-9/v s late. Speeds fall by 0.7 to 0.01 m/s; the delays and
/// their effect on later bounces add up to 5e-6 (measured).
#[test]
fn a_ball_comes_to_rest_as_in_co_simulation() {
    let signals = "\"own:*\"";
    for fmu in ["BouncingBall", "ReferenceBouncingBall"] {
        let [own, exchange] = ["", "interface = \"model-exchange\""]
            .map(|more| run(&plan(&format!("fmu = \"{fmu}\"\n{more}"), 3.0, 0.01, signals)));
        for (own, exchange) in columns(&own).into_iter().zip(columns(&exchange)) {
            for (k, (own, exchange)) in own.iter().zip(exchange).enumerate() {
                assert!((own - exchange).abs() < 1e-5, "{fmu}: {k}: {own} {exchange}");
            }
        }
    }
}

/// Reference: exp(-t), with the tolerance 1e-6 of the solver in each of its steps.
#[test]
fn dahlquist_decays() {
    let plan = plan("fmu = \"Dahlquist\"\ninterface = \"model-exchange\"", 10.0, 0.1, "\"own:x\"");
    let notes = System::new(&plan, &plan.runs[0]).unwrap().notes();
    assert!(notes[0].contains("`own` is in model exchange; SSP has no place for its `solver`"), "{notes:?}");
    assert!(notes[1].contains("libcosim does not support FMUs of FMI 3.0"), "{notes:?}");
    let recording = run(&plan);
    for (time, x) in recording.time.iter().zip(columns(&recording)[0]) {
        assert!((x - (-time).exp()).abs() < 1e-5 * (-time).exp().max(0.01), "{time}: {x}");
    }
}

/// The published run: 1 at the start, one more at each second, the last of 46 rows at 9 s with 10, the end.
#[test]
fn the_stair_ends_the_simulation_at_9_s() {
    let plan = plan("fmu = \"Stair\"\ninterface = \"model-exchange\"", 10.0, 0.2, "\"own:counter\"");
    let failure =
        execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).expect("FMUs")).expect_err("it ends");
    assert_eq!(failure.kind, FailureKind::Terminated);
    let recording = failure.recorded.expect("rows up to the end");
    assert_eq!(recording.time.len(), 46);
    for (time, counter) in recording.time.iter().zip(columns(&recording)[0]) {
        assert_eq!(*counter, (time + 1e-9).floor() + 1.0, "{time}");
    }
}
