//! Cost of an evaluation of the ride objective, 6 s at steps of 1 ms: the packed half car and comfort law as the tuner runs
//! them, and the same equations called directly in Rust, with the same data to the last bit of the objective. Road and speed
//! are computed before and read from a table by both.

use std::hint::black_box;

use bench::{Evaluation, compare_evaluations};
use chassis::positions::{LeftSide, Sides};
use fmi2::block::Block;
use fmi2::model::{Plant, RungeKutta, Stepper};
use hydro_pneumatic_half_car::{HydroPneumaticHalfCar as Car, P as CarParameters};

// A program can hold the C interface of one package only, so the comfort law is its file of equations.
#[path = "../../../fmu-controllers/comfort-sliding-mode/src/equations.rs"]
mod equations;

/// The parameters of the comfort law.
struct P {
    m_s: f64,
    m_u: f64,
    k_s: f64,
    c_s: f64,
    k_t: f64,
    n1: f64,
    n2: f64,
    n3: f64,
    eta: f64,
    mu: f64,
    width: f64,
    zeta: f64,
    limit: f64,
}

/// Its inputs.
struct U {
    x1: LeftSide<f64>,
    x2: f64,
    x3: LeftSide<f64>,
    x4: f64,
}

/// Its outputs.
struct Y {
    f: Sides<f64>,
    s: f64,
}

/// Communication step in s.
const STEP: f64 = 0.001;
/// Weights of the objective (Table 4).
const WEIGHTS: [f64; 6] = [0.48, 0.06, 131.3, 2100.0, 9777.0, 485.8];
/// What they belong to: heave and roll acceleration, deflections of suspension and tires.
const SIGNALS: &str =
    r#"["body.heave_acceleration", "body.roll_acceleration", "suspension_deflection.*", "tire_deflection.*"]"#;

/// The scenario whose driver and road the table comes from.
const RIDE: &str = include_str!("../../../scenarios/hydro_pneumatic_tuning_ride.toml");

/// Comfort law and half car, nothing else.
const FED: &str = r#"
title = "Ride"
[simulation]
stop = 6.0
step = 0.001
[[unit]]
name = "comfort"
fmu = "ComfortSlidingMode"
[[unit]]
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
    // What the plant gets in step k is what driver and road give in it: their row k + 1.
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

    let car = CarParameters::default();
    compare_evaluations("half car and comfort law", || objective(&direct(&car, &table)), || objective(&fed.run()));
}

/// Weighted mean squares (eq. 24).
fn objective(columns: &[Vec<f64>]) -> f64 {
    let mean_square = |column: &Vec<f64>| column.iter().map(|v| v * v).sum::<f64>() / column.len() as f64;
    columns.iter().zip(WEIGHTS).map(|(column, weight)| weight * mean_square(column)).sum()
}

/// The run without FMUs: the order of the master, the substeps of the exporter.
fn direct(car: &CarParameters, table: &[[f64; 6]]) -> Vec<Vec<f64>> {
    // As the package declares them.
    let comfort = P {
        m_s: 1525.0,
        m_u: 50.0,
        k_s: 35_000.0,
        c_s: 980.0,
        k_t: 190_000.0,
        n1: -0.575,
        n2: 0.6559,
        n3: 0.0,
        eta: 11.0,
        mu: 0.0005,
        width: 0.0,
        zeta: 0.444,
        limit: 0.0,
    };
    equations::check(&comfort).expect("the force moves the surface");
    let design = Car::design(car).expect("a valid design");
    let parts = <RungeKutta as Stepper<Car>>::parts(car, STEP);
    let mut states = [0.0; 13];
    let mut x = <Car as Plant>::State::<f64>::read(&states);
    let mut outputs = [0.0; 21];
    let mut columns = vec![Vec::with_capacity(table.len()); WEIGHTS.len()];
    let mut record = |x: &<Car as Plant>::State<f64>, u: &<Car as Plant>::Inputs<f64>| {
        Car::outputs(car, &design, x, u).write(&mut outputs);
        for (column, output) in columns.iter_mut().zip([5, 6, 7, 8, 11, 12]) {
            column.push(outputs[output]);
        }
    };
    let inputs = |f: Sides<f64>, [v, delta, z_l, z_r, mu_l, mu_r]: [f64; 6]| {
        <Car as Plant>::Inputs::<f64>::read(&[v, delta, f[0], f[1], z_l, z_r, mu_l, mu_r])
    };
    record(&x, &inputs(Sides([0.0; 2]), table[0]));
    for row in &table[..table.len() - 1] {
        x.write(&mut states);
        let [x2, _, x1, _, x4, _, x3, ..] = states;
        let y = equations::forces(&comfort, &U { x1: LeftSide([x1]), x2, x3: LeftSide([x3]), x4 });
        black_box(y.s);
        let u = inputs(y.f, *row);
        for _ in 0..parts as u64 {
            x = <RungeKutta as Stepper<Car>>::advance(car, &design, &x, &u, STEP / parts);
        }
        record(&x, &u);
    }
    columns
}
