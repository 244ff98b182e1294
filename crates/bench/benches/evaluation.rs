//! Cost of an evaluation of the ride objective, 6 s at steps of 1 ms: the packed half car and comfort law as `chassis study`
//! runs them, and the same equations called directly in Rust, with the same data and bit-identical objectives. Both read road
//! and speed from a table computed in advance.

use std::hint::black_box;

use bench::{Evaluation, compare_evaluations};
use chassis_vehicle::positions::Sides;
use comfort_sliding_mode::{ComfortSlidingMode, U as Measured};
use fmu::simulation::{ContinuousSimulation, DiscreteSimulation};
use fmu::{Continuous, Variables as _};
use hydro_pneumatic_half_car::HydroPneumaticHalfCar as Car;

/// Communication step in s.
const STEP: f64 = 0.001;
/// Weights of the objective (Table 4).
const WEIGHTS: [f64; 6] = [0.48, 0.06, 131.3, 2100.0, 9777.0, 485.8];
/// Weighted signals: heave and roll acceleration, deflections of suspension and tires.
const SIGNALS: &str =
    r#"["body.heave_acceleration", "body.roll_acceleration", "suspension_deflection.*", "tire_deflection.*"]"#;

/// Scenario with the driver and the road of the table.
const RIDE: &str = include_str!("../../../scenarios/hydro_pneumatic_tuning_ride.toml");

/// Comfort law and half car, nothing else.
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
    let source = Evaluation::new("ride", &format!("{head}[record]\nsignals = {sources:?}\n"), None);
    let rows = source.run();
    let table: Vec<[f64; 6]> = (0..rows[0].len())
        .map(|k| std::array::from_fn(|signal| rows[signal][(k + 1).min(rows[0].len() - 1)]))
        .collect();
    let mut csv = format!("time,{}\n", inputs.join(","));
    for (k, row) in table.iter().enumerate() {
        let row: Vec<String> = row.iter().map(|value| format!("{value:?}")).collect();
        csv += &format!("{:?},{}\n", k as f64 * STEP, row.join(","));
    }
    let fed = Evaluation::new("fed", &FED.replace("SIGNALS", SIGNALS), Some(&csv));

    compare_evaluations("half car and comfort law", || objective(&direct(&table)), || objective(&fed.run()));
}

/// Weighted mean squares (eq. 24).
fn objective(columns: &[Vec<f64>]) -> f64 {
    let mean_square = |column: &Vec<f64>| column.iter().map(|v| v * v).sum::<f64>() / column.len() as f64;
    columns.iter().zip(WEIGHTS).map(|(column, weight)| weight * mean_square(column)).sum()
}

/// The run without FMUs, in the order of the master.
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
