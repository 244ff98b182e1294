//! Time of an evaluation of the ride objective (6 s in steps of 1 ms) in two ways: with the packed half car and comfort
//! law, as `chassis study` runs them, and with the same equations called directly in Rust. Both read road and speed
//! from the same precomputed table, and their objectives are bit-identical.

use std::hint::black_box;
use std::time::Instant;

use chassis_vehicle::positions::Sides;
use comfort_sliding_mode::{ComfortSlidingMode, U as Measured};
use fmu::simulation::{ContinuousSimulation, DiscreteSimulation};
use fmu::{Continuous, Variables as _};
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::resolve::{FmuFolder, Options, resolve};
use hydro_pneumatic_half_car::HydroPneumaticHalfCar as Car;

/// Communication step in s.
const STEP: f64 = 0.001;
/// Evaluations of each kind. The time of the fastest evaluation is reported, because other processes disturb it least.
const EVALUATIONS: usize = 101;
/// Weights of the objective (Table 4).
const WEIGHTS: [f64; 6] = [0.48, 0.06, 131.3, 2100.0, 9777.0, 485.8];
/// Weighted signals: heave and roll acceleration, deflections of suspension and tires.
const SIGNALS: &str =
    r#"["body.heave_acceleration", "body.roll_acceleration", "suspension_deflection.*", "tire_deflection.*"]"#;

/// Scenario whose driver and road provide the table.
const RIDE: &str = include_str!("../../../scenarios/hydro_pneumatic_tuning_ride.toml");

/// Scenario with only the comfort law and the half car.
const FED: &str = r#"
title = "Ride"
[simulation]
stop = 6.0
step = 0.001
[[component]]
name = "comfort"
fmu = "ComfortSlidingMode"
[[component]]
name = "plant"
fmu = "HydroPneumaticHalfCar"
[[connection]]
from = "comfort:comfort_force.l"
to = "plant:suspension_force.l"
[[connection]]
from = "comfort:comfort_force.r"
to = "plant:suspension_force.r"
[[case]]
name = "comfort"
title = "Comfort law"
[record]
signals = SIGNALS
"#;

fn main() {
    // Inputs of the plant in step k are the outputs of driver and road in that step: their row k + 1.
    let sources =
        ["driver.speed", "driver.steer", "road_height.l", "road_height.r", "road_friction.l", "road_friction.r"];
    let inputs =
        ["driver.speed", "steer.front", "road_height.l", "road_height.r", "road_friction.l", "road_friction.r"];
    let (head, _) = RIDE.split_once("[record]").expect("the scenario records");
    let rows = evaluation("ride", &format!("{head}[record]\nsignals = {sources:?}\n"), None)();
    let table: Vec<[f64; 6]> = (0..rows[0].len())
        .map(|k| std::array::from_fn(|signal| rows[signal][(k + 1).min(rows[0].len() - 1)]))
        .collect();
    let mut csv = format!("time,{}\n", inputs.join(","));
    for (k, row) in table.iter().enumerate() {
        let row: Vec<String> = row.iter().map(|value| format!("{value:?}")).collect();
        csv += &format!("{:?},{}\n", k as f64 * STEP, row.join(","));
    }
    let fed = evaluation("fed", &FED.replace("SIGNALS", SIGNALS), Some(&csv));
    // The two kinds alternate, so disturbances affect both equally.
    let (mut time, mut fmu_time) = (f64::INFINITY, f64::INFINITY);
    for _ in 0..EVALUATIONS {
        let (direct, fmus) = (timed(&|| direct(&table), &mut time), timed(&fed, &mut fmu_time));
        assert_eq!(direct, fmus, "the same data give the same objective");
    }
    println!(
        "{:28} {time:8.2} ms directly {fmu_time:8.2} ms by FMUs   ratio {:.2}   objective {:.6}",
        "half car and comfort law",
        fmu_time / time,
        objective(&direct(&table))
    );
}

/// Returns the objective of an evaluation, and lowers `fastest` to its time (ms) if it was faster.
fn timed(evaluate: &dyn Fn() -> Vec<Vec<f64>>, fastest: &mut f64) -> f64 {
    let begin = Instant::now();
    let objective = black_box(objective(&evaluate()));
    *fastest = fastest.min(begin.elapsed().as_secs_f64() * 1e3);
    objective
}

/// Returns a function that executes the first run of a scenario with packed FMUs and returns the recorded columns. As
/// in `chassis study`, libraries are loaded once, instances are created for each run, and signals stay in memory.
/// `inputs` is the text of a CSV file with signals (see `chassis plan --inputs`).
fn evaluation(name: &str, scenario: &str, inputs: Option<&str>) -> impl Fn() -> Vec<Vec<f64>> + use<> {
    let folder = bench::target().join("bench");
    std::fs::create_dir_all(&folder).expect("a folder for the scenario");
    let write = |name: String, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).expect("a file in the folder");
        path
    };
    let path = write(format!("{name}.toml"), scenario);
    let inputs = inputs.map(|text| write(format!("{name}.csv"), text));
    let options = Options { inputs, ..Options::default() };
    let plan = resolve(&path, &FmuFolder::new([bench::target().join("fmu")]), &options)
        .unwrap_or_else(|error| panic!("{error:?}; are the FMUs packed?"));
    let fmus = Fmus::load(&plan.runs).unwrap_or_else(|error| panic!("{error}"));
    move || {
        let recording = master::execute(&plan.simulation, &plan.runs[0], &fmus);
        recording.unwrap_or_else(|error| panic!("{error}")).columns.into_iter().flatten().collect()
    }
}

/// Weighted mean squares (eq. 24).
fn objective(columns: &[Vec<f64>]) -> f64 {
    let mean_square = |column: &Vec<f64>| column.iter().map(|v| v * v).sum::<f64>() / column.len() as f64;
    columns.iter().zip(WEIGHTS).map(|(column, weight)| weight * mean_square(column)).sum()
}

/// The same run without FMUs, in the order of the master.
fn direct(table: &[[f64; 6]]) -> Vec<Vec<f64>> {
    let mut comfort = DiscreteSimulation::new(ComfortSlidingMode::default()).expect("the parameters suit each other");
    let mut car = ContinuousSimulation::new(Car::default()).expect("the parameters suit each other");
    let mut columns = vec![Vec::with_capacity(table.len()); WEIGHTS.len()];
    let mut record = |car: &mut ContinuousSimulation<Car>, u: &<Car as Continuous>::Inputs<f64>| {
        let outputs = car.outputs(u).reals();
        for (column, output) in columns.iter_mut().zip([5, 6, 7, 8, 11, 12]) {
            column.push(outputs[output]);
        }
    };
    let inputs = |f: Sides<f64>, [v, delta, z_l, z_r, mu_l, mu_r]: [f64; 6]| {
        <Car as Continuous>::Inputs::<f64>::from_reals(&[v, delta, f[0], f[1], z_l, z_r, mu_l, mu_r])
    };
    record(&mut car, &inputs(Sides([0.0; 2]), table[0]));
    for row in &table[..table.len() - 1] {
        let states = car.state().reals();
        let [x2, _, x1, _, x4, _, x3, ..] = states[..] else { unreachable!("the car has 13 states") };
        let y = comfort.sample(&Measured::from_reals(&[x1, x2, x3, x4])).expect("the force moves the surface");
        let f = y.reals();
        let u = inputs(Sides([f[0], f[1]]), *row);
        car.step(&u, STEP).expect("the run stays finite");
        record(&mut car, &u);
    }
    black_box(columns)
}
