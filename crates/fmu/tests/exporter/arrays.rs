//! Arrays, arrays of arrays, named elements and nested structs. Reference: the documentation of `fmu-derive`, and FMI 2.0.4,
//! section 2.2.9 (variable naming convention "structured").

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::variable::Kind;

use crate::models::{Carts, Fmu};
use crate::numbers::Level;

#[derive(Parameters)]
pub(crate) struct Arrays {
    /// Vector (m)
    #[var(start = [1.0, 2.0, 3.0], min = 0.0)]
    vector: [f64; 3],
    /// Matrix (1)
    #[var(start = [[1.0, 2.0], [3.0, 4.0]])]
    matrix: [[f64; 2]; 2],
    /// Row (1)
    #[var(start = 7)]
    uniform: [[f64; 2]; 1],
    /// Corner (N)
    #[var(start = [10.0, 20.0], elements = ["front", "rear"])]
    corner: [f64; 2],
    /// Mixed
    #[var(start = [1.0, -2.0], unit = ["m", "rad"], description = ["Distance", "Angle"])]
    mixed: [f64; 2],
    /// Cart ({}) (kg)
    #[var(start = [[1.0, 2.0], [3.0, 4.0]])]
    carts: Carts<[f64; 2]>,
    /// Numbers
    #[var(start = [1, -1])]
    numbers: [i32; 2],
    /// Switches
    #[var(start = true)]
    switches: [bool; 2],
    /// Labels
    #[var(start = ["a", "b"])]
    labels: [String; 2],
    #[var(nested)]
    front: Wheel,
    #[var(nested = "axle.rear")]
    rear: Wheel,
    #[var(flatten)]
    wheel: Wheel,
    /// Named `values`, as a local variable of the macro could be (1)
    #[var(start = 5.0)]
    values: f64,
    /// Named `at` (1)
    #[var(start = 6.0)]
    at: f64,
}

#[derive(Parameters)]
pub(crate) struct Wheel {
    /// Radius (m)
    #[var(start = 0.3)]
    radius: f64,
    /// Bolts
    #[var(start = 5)]
    bolts: i32,
}

#[derive(State)]
pub(crate) struct Chain<T> {
    /// Position (m)
    #[var(start = [0.5, 0.25])]
    x: [T; 2],
    #[var(nested)]
    inner: Inner<T>,
}

#[derive(State)]
pub(crate) struct Inner<T> {
    /// Velocity (m/s)
    #[var(start = [[1.0, 2.0]])]
    v: [[T; 2]; 1],
}

/// Arrays
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Arrays {
    type State<T: Scalar> = Chain<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Chain<T> {
        Chain { x: at.state.inner.v[0], inner: Inner { v: [[T::from(self.values), T::from(self.at)]] } }
    }
}

#[test]
fn elements_have_names_units_start_values_and_descriptions() {
    let description = Arrays::description();
    let all: Vec<_> = description
        .layout
        .variables
        .iter()
        .map(|variable| {
            let declaration = &variable.declaration;
            let (start, unit) = match &declaration.kind {
                Kind::Real(real) | Kind::Float32(real) => (real.start.to_string(), real.unit.name),
                Kind::Integer { start, .. } => (start.to_string(), ""),
                Kind::Boolean { start } => (start.to_string(), ""),
                Kind::String { start } => (start.clone(), ""),
                Kind::Binary { start, .. } => (format!("{start:?}"), ""),
                Kind::Clock(_) => (String::new(), ""),
            };
            format!("{} = {start} {unit}: {}", declaration.name, declaration.description)
        })
        .collect();
    let expected = [
        "vector[1] = 1 m: Vector, element 1",
        "vector[2] = 2 m: Vector, element 2",
        "vector[3] = 3 m: Vector, element 3",
        "matrix[1,1] = 1 1: Matrix, element 1, element 1",
        "matrix[1,2] = 2 1: Matrix, element 1, element 2",
        "matrix[2,1] = 3 1: Matrix, element 2, element 1",
        "matrix[2,2] = 4 1: Matrix, element 2, element 2",
        "uniform[1,1] = 7 1: Row, element 1, element 1",
        "uniform[1,2] = 7 1: Row, element 1, element 2",
        "corner.front = 10 N: Corner, front",
        "corner.rear = 20 N: Corner, rear",
        "mixed[1] = 1 m: Distance",
        "mixed[2] = -2 rad: Angle",
        "carts.l[1] = 1 kg: Cart (left cart, element 1)",
        "carts.l[2] = 2 kg: Cart (left cart, element 2)",
        "carts.r[1] = 3 kg: Cart (right cart, element 1)",
        "carts.r[2] = 4 kg: Cart (right cart, element 2)",
        "numbers[1] = 1 : Numbers, element 1",
        "numbers[2] = -1 : Numbers, element 2",
        "switches[1] = true : Switches, element 1",
        "switches[2] = true : Switches, element 2",
        "labels[1] = a : Labels, element 1",
        "labels[2] = b : Labels, element 2",
        "front.radius = 0.3 m: Radius",
        "front.bolts = 5 : Bolts",
        "axle.rear.radius = 0.3 m: Radius",
        "axle.rear.bolts = 5 : Bolts",
        "radius = 0.3 m: Radius",
        "bolts = 5 : Bolts",
        "values = 5 1: Named `values`, as a local variable of the macro could be",
        "at = 6 1: Named `at`",
        "max_step = 0.1 s: Longest integration step; a communication step is divided into equal parts not longer than this",
        "x[1] = 0.5 m: Position, element 1",
        "x[2] = 0.25 m: Position, element 2",
        "inner.v[1,1] = 1 m/s: Velocity, element 1, element 1",
        "inner.v[1,2] = 2 m/s: Velocity, element 1, element 2",
        "der(x[1]) = 0 m/s: Time derivative of x[1]",
        "der(x[2]) = 0 m/s: Time derivative of x[2]",
        "der(inner.v[1,1]) = 0 m/s2: Time derivative of inner.v[1,1]",
        "der(inner.v[1,2]) = 0 m/s2: Time derivative of inner.v[1,2]",
    ];
    assert_eq!(all, expected);
}

#[test]
fn elements_are_read_and_written_one_by_one() {
    let p = Arrays::default();
    assert_eq!((p.vector, p.matrix, p.uniform), ([1.0, 2.0, 3.0], [[1.0, 2.0], [3.0, 4.0]], [[7.0, 7.0]]));
    assert_eq!((p.corner, p.mixed, p.carts.0), ([10.0, 20.0], [1.0, -2.0], [[1.0, 2.0], [3.0, 4.0]]));
    assert_eq!((p.numbers, p.switches, p.labels), ([1, -1], [true; 2], ["a", "b"].map(str::to_owned)));
    assert_eq!((p.front.radius, p.rear.bolts, p.wheel.radius), (0.3, 5, 0.3));
    let mut fmu = Fmu::<Arrays>::starting(0.0, &[("values", 4.0), ("inner.v[1,2]", -1.0), ("x[2]", 2.0)]);
    // x = x0 + v t + a t^2 / 2; a method of order 4 is exact except for rounding errors.
    fmu.step(1.0).unwrap();
    for (name, expected) in [("x[1]", 0.5 + 1.0 + 2.0), ("x[2]", 2.0 - 1.0 + 3.0), ("inner.v[1,1]", 5.0)] {
        assert!((fmu.get(name) - expected).abs() < 1e-14, "{name}: {}", fmu.get(name));
    }
}

const ROW: [f64; 2] = [1.0, 2.0];

#[derive(Parameters)]
struct Nested {
    /// Levels
    #[var(start = Level::High)]
    levels: [[Level; 2]; 3],
    /// Cubes of levels
    #[var(start = Level::High)]
    cubes: [[[Level; 2]; 1]; 2],
    /// Rows (1)
    #[var(start = ROW)]
    rows: [[f64; 2]; 3],
}

#[test]
fn a_start_value_that_is_not_a_literal_is_that_of_all_elements() {
    let Nested { levels, cubes, rows } = Nested::default();
    assert_eq!((levels, cubes, rows), ([[Level::High; 2]; 3], [[[Level::High; 2]; 1]; 2], [ROW; 3]));
}
