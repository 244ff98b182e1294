//! The model structure of large models and of models with branches. Reference: the equations.

use fmu::abi::Export;
use fmu::prelude::*;

use crate::models::reference;

/// Names of the variables that `name` depends on, in the list of outputs or derivatives.
fn dependencies<E: Export>(name: &str) -> Vec<String> {
    let description = E::description();
    let index = description.layout.structure_index(reference::<E>(name));
    let (_, structure) = description.xml.split_once("<ModelStructure>").unwrap();
    let (_, rest) = structure.split_once(&format!("<Unknown index=\"{index}\" dependencies=\"")).unwrap();
    let list = rest.split_once('"').unwrap().0;
    let name = |index: &str| &description.layout.variables[index.parse::<usize>().unwrap() - 1].declaration.name;
    list.split_whitespace().map(|index| name(index).clone()).collect()
}

const CELLS: usize = 300;

#[derive(Parameters)]
struct Rod;

#[derive(State)]
struct Cells<T> {
    /// Temperature (K)
    #[var("cell", start = 300.0, nominal = 300.0)]
    x: [T; CELLS],
}

#[derive(Inputs)]
struct Heat<T> {
    /// Heating rate (K/s)
    #[var("heat")]
    q: [T; CELLS],
}

#[derive(Outputs)]
struct Ends<T> {
    /// Sum of first cell and last heating (K)
    ends: T,
}

/// Heat conduction in a rod
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Rod {
    type State<T: Scalar> = Cells<T>;
    type Inputs<T: Scalar> = Heat<T>;
    type Outputs<T: Scalar> = Ends<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Cells<T> {
        let x = &at.state.x;
        let flow = |i: usize| {
            let left = if i > 0 { x[i - 1] - x[i] } else { T::from(0.0) };
            let right = if i + 1 < CELLS { x[i + 1] - x[i] } else { T::from(0.0) };
            left + right + at.inputs.q[i]
        };
        Cells { x: std::array::from_fn(flow) }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Ends<T> {
        Ends { ends: at.state.x[0] + at.inputs.q[CELLS - 1] }
    }
}

#[test]
fn each_of_600_inputs_and_states_is_told_apart() {
    for i in 1..=CELLS {
        let mut expected = vec![format!("heat[{i}]")];
        expected.extend((i.saturating_sub(1).max(1)..=(i + 1).min(CELLS)).map(|i| format!("cell[{i}]")));
        assert_eq!(dependencies::<Rod>(&format!("der(cell[{i}])")), expected);
    }
    assert_eq!(dependencies::<Rod>("ends"), ["heat[300]", "cell[1]"]);
}

/// Selected input
#[derive(Enumeration)]
enum Select {
    /// First input
    First,
    /// Second input
    Second = 5,
}

#[derive(Parameters)]
struct Branches {
    /// Boolean
    #[var(start = false)]
    boolean: bool,
    /// Enumeration
    #[var(start = Select::First)]
    select: Select,
    /// Bounded
    #[var(start = 0, min = 0, max = 2)]
    bounded: i32,
}

#[derive(Inputs)]
struct Four<T> {
    /// Inputs (1)
    #[var("u")]
    u: [T; 4],
    /// Boolean input
    on: bool,
}

#[derive(Outputs)]
struct Results<T> {
    /// Depends on a Boolean parameter (1)
    by_boolean: T,
    /// Depends on an enumeration (1)
    by_enumeration: T,
    /// Depends on a bounded Integer (1)
    by_integer: T,
    /// Depends on a Boolean input (1)
    by_input: T,
    /// Both sides of a branch on a value (1)
    by_value: T,
    /// Product with zero (1)
    product: T,
    /// Constant (1)
    constant: T,
}

/// Branches
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Branches {
    type Inputs<T: Scalar> = Four<T>;
    type Outputs<T: Scalar> = Results<T>;
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Results<T> {
        let u = &at.inputs.u;
        Results {
            by_boolean: if self.boolean { u[0] } else { u[1] },
            by_enumeration: match self.select {
                Select::First => u[1],
                Select::Second => u[2],
            },
            by_integer: u[self.bounded as usize],
            by_input: if at.inputs.on { u[3] } else { u[0] },
            by_value: u[0].if_greater(u[1], u[2], T::from(0.0)),
            product: u[3] * 0.0,
            constant: T::from(1.0),
        }
    }
}

#[test]
fn every_branch_on_a_boolean_an_enumeration_and_a_bounded_integer_counts() {
    // What depends on a Boolean input is not known, so each result may.
    for (name, inputs) in [
        ("by_boolean", &[1, 2][..]),
        ("by_enumeration", &[2, 3]),
        ("by_integer", &[1, 2, 3]),
        ("by_input", &[1, 4]),
        ("by_value", &[1, 2, 3]),
        ("product", &[4]),
        ("constant", &[]),
    ] {
        let mut expected: Vec<_> = inputs.iter().map(|i| format!("u[{i}]")).collect();
        expected.push("on".to_owned());
        assert_eq!(dependencies::<Branches>(name), expected, "{name}");
    }
}

macro_rules! open {
    ($(#[doc = $doc:literal] $name:ident { $($field:tt)* } |$p:ident, $u:ident| $first:expr;)*) => {$(
        #[derive(Parameters)]
        struct $name { $($field)* }

        #[doc = $doc]
        #[fmu::model(stop_time = 1.0, step_size = 0.1)]
        impl Continuous for $name {
            type Inputs<T: Scalar> = Pair<T>;
            type Outputs<T: Scalar> = Single<T>;
            fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Single<T> {
                let ($p, $u) = (self, at.inputs.u);
                Single { y: if $first { $u[0] } else { T::from(0.0) } }
            }
        }
    )*};
}

#[derive(Inputs)]
struct Pair<T> {
    /// Inputs (1)
    u: [T; 2],
}

#[derive(Outputs)]
struct Single<T> {
    /// Output (1)
    y: T,
}

open! {
    /// Branches on an Integer without limits
    Unbounded {
        /// Any number
        #[var(start = 1)]
        number: i32,
    } |p, u| p.number == 77;
    /// Branches on a String
    Text {
        /// Any text
        #[var(start = "a")]
        text: String,
    } |p, u| p.text == "b";
    /// Looks at a value
    Inspecting {} |_p, u| u[0].value() > 1.0;
    /// Has too many combinations of Booleans
    Combinations {
        /// Booleans
        #[var(start = false)]
        on: [bool; 13],
    } |p, u| p.on.iter().all(|on| *on);
}

#[test]
fn what_cannot_be_tried_depends_on_everything() {
    let all = ["u[1]", "u[2]"];
    assert_eq!(dependencies::<Unbounded>("y"), all);
    assert_eq!(dependencies::<Text>("y"), all);
    assert_eq!(dependencies::<Inspecting>("y"), all);
    assert_eq!(dependencies::<Combinations>("y"), all);
}
