//! The model structure of large models and of models with branches. Reference: the equations.

use fmu::prelude::*;
use fmu::testing::abi::Export;

use crate::models::reference;

/// Names of the variables on which the output or derivative `name` depends.
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
fn dependencies_on_600_inputs_and_states_are_exact() {
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
        // The input is a dependency if its value changes the expression.
        if name == "by_input" {
            expected.push("on".to_owned());
        }
        assert_eq!(dependencies::<Branches>(name), expected, "{name}");
    }
}

/// Path through a valve
#[derive(Enumeration, Clone, Copy, PartialEq, Default)]
enum Path {
    /// Nothing passes
    #[default]
    Closed,
    /// The second input passes
    Second,
    /// The third input passes
    Third,
}

/// Discrete state of a valve.
#[derive(DiscreteState, Clone, Default)]
struct Switched {
    is_open: bool,
    path: Path,
}

#[derive(Parameters)]
struct Valve;

#[derive(Inputs)]
struct Sources<T> {
    /// Inputs (1)
    u: [T; 4],
}

/// Branches on the discrete state
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Valve {
    type Inputs<T: Scalar> = Sources<T>;
    type Outputs<T: Scalar> = Single<T>;
    type DiscreteState = Switched;
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Single<T> {
        let (u, zero) = (at.inputs.u, T::from(0.0));
        let first = if at.discrete.is_open { u[0] } else { zero };
        let other = match at.discrete.path {
            Path::Closed => zero,
            Path::Second => u[1],
            Path::Third => u[2],
        };
        Single { y: first + other }
    }
}

/// Each field of the discrete state has one value at the start, but events can change it, so branches for all values
/// count.
#[test]
fn every_branch_on_the_discrete_state_counts() {
    assert_eq!(dependencies::<Valve>("y"), ["u[1]", "u[2]", "u[3]"]);
}

#[derive(Parameters)]
struct Modes {
    /// Gain in one mode (1)
    #[var(start = 1.0)]
    firm: f64,
    /// Gain in the other mode (1)
    #[var(start = 1.0, max = 1.0)]
    soft: f64,
    /// Bias (N)
    #[var(start = 0.0)]
    bias: f64,
}

#[derive(Inputs)]
struct Chosen<T> {
    /// Input (1)
    u: T,
    /// Chooses the gain
    is_firm: bool,
    /// Adds the bias
    is_biased: bool,
    /// Chooses nothing
    is_unused: bool,
}

#[derive(Outputs)]
struct Both<T> {
    /// Output (1)
    scaled: T,
    /// Output (N)
    shifted: T,
}

/// Chooses between parameters that start with the same value
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Modes {
    type Inputs<T: Scalar> = Chosen<T>;
    type Outputs<T: Scalar> = Both<T>;
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Both<T> {
        let bias = if at.inputs.is_biased { self.bias } else { 0.0 };
        let gain = if at.inputs.is_firm { self.firm } else { self.soft };
        Both { scaled: at.inputs.u * gain, shifted: T::from(bias) }
    }
}

#[test]
fn a_choice_between_parameters_counts_if_they_start_alike() {
    assert_eq!(dependencies::<Modes>("scaled"), ["u", "is_firm"]);
    assert_eq!(dependencies::<Modes>("shifted"), ["is_biased"]);
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
fn variables_with_too_many_values_affect_everything() {
    let all = ["u[1]", "u[2]"];
    assert_eq!(dependencies::<Unbounded>("y"), all);
    assert_eq!(dependencies::<Text>("y"), all);
    assert_eq!(dependencies::<Inspecting>("y"), all);
    assert_eq!(dependencies::<Combinations>("y"), all);
}

mod sums {
    use fmu::prelude::*;

    #[derive(Parameters)]
    pub(super) struct Sums;

    #[derive(Inputs)]
    pub(super) struct U<T> {
        /// Forces (N)
        pub(super) forces: [T; 2],
        /// Not used (N)
        pub(super) other: T,
    }

    #[derive(Outputs)]
    pub(super) struct Y<T> {
        /// Sum (N)
        pub(super) sum: T,
    }

    /// Adds the elements of an array
    #[fmu::model(stop_time = 1.0, step_size = 0.1)]
    impl Continuous for Sums {
        type Inputs<T: Scalar> = U<T>;
        type Outputs<T: Scalar> = Y<T>;
        fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
            Y { sum: at.inputs.forces.iter().sum() }
        }
    }
}

/// `Sum` also works for references, with every number type.
#[test]
fn a_sum_depends_on_its_terms() {
    use fmu::testing::abi::Export as _;
    let xml = &sums::Sums::description().xml;
    // Variables: 1 max_step, 2 to 4 the inputs, 5 the sum.
    assert!(xml.contains(r#"<Unknown index="5" dependencies="2 3"/>"#), "{xml}");
    let mut run = fmu::simulation::ContinuousSimulation::new(sums::Sums).unwrap();
    assert_eq!(run.outputs(&sums::U { forces: [1.0, 2.0], other: 4.0 }).sum, 3.0);
}

#[derive(Parameters)]
struct Resource {
    /// File with the points
    #[var(start = "points.csv")]
    file: String,
    /// Number of the first point
    #[var(start = 0)]
    first: i32,
    /// Factor (1)
    #[var(start = 2.0)]
    factor: f64,
}

struct Points(fmu::Table);

impl fmu::Derived for Points {
    fn declare(_: &mut Vec<fmu::testing::variable::Declaration>) {}
    fn write(&self, _: &mut fmu::testing::store::ValuesMut<'_, f64>, _: fmu::testing::store::Counts) {}
}

/// Reads a String and an Integer without limits before the equations only
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Resource {
    type Inputs<T: Scalar> = Pair<T>;
    type Outputs<T: Scalar> = Single<T>;
    type Derived = Points;
    fn load(&self, _: &std::path::Path) -> Result<Points, String> {
        let first = f64::from(self.first) + self.file.len() as f64;
        Ok(Points(fmu::Table::new([(0.0, first), (1.0, 2.0)])?))
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Single<T> {
        Single { y: at.inputs.u[1].interpolate(&at.derived.0) * self.factor }
    }
}

#[test]
fn a_string_that_the_equations_do_not_read_leaves_the_structure_alone() {
    assert_eq!(dependencies::<Resource>("y"), ["u[2]"]);
    assert_eq!(Resource::description().notes, Vec::<String>::new());
}

#[derive(Parameters)]
struct Calling {
    /// File with the points
    #[var(start = "points.csv")]
    file: String,
}

/// Reads a String in a function that the equations call
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Calling {
    type Inputs<T: Scalar> = Pair<T>;
    type Outputs<T: Scalar> = Single<T>;
    type Derived = Points;
    fn load(&self, _: &std::path::Path) -> Result<Points, String> {
        Ok(Points(fmu::Table::new([(0.0, self.file.len() as f64), (1.0, 2.0)])?))
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Single<T> {
        let is_other = self.load(std::path::Path::new("")).is_err();
        Single { y: at.inputs.u[usize::from(is_other)] }
    }
}

#[derive(Outputs)]
struct Mixed<T> {
    /// Constant
    whole: i32,
    /// Follows the Boolean input
    follows: bool,
    /// Compares
    compares: bool,
    /// Output (1)
    y: T,
}

/// Outputs of other types
#[derive(Parameters)]
struct Others;

/// Outputs of other types
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Others {
    type Inputs<T: Scalar> = Four<T>;
    type Outputs<T: Scalar> = Mixed<T>;
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Mixed<T> {
        Mixed { whole: 3, follows: !at.inputs.on, compares: true, y: at.inputs.u[2] }
    }
}

#[test]
fn outputs_of_other_types_depend_on_what_they_follow() {
    assert_eq!(dependencies::<Others>("whole"), Vec::<String>::new());
    assert_eq!(dependencies::<Others>("follows"), ["on"]);
    assert_eq!(dependencies::<Others>("y"), ["u[3]"]);
}

/// The notes contain the reason for too many dependencies, and the remedy.
#[test]
fn notes_explain_too_many_dependencies() {
    let note = |description: std::sync::Arc<fmu::testing::description::Description>| description.notes.join("; ");
    let text = note(Text::description());
    assert!(text.contains("`text`") && text.contains("pass on only the fields that are needed"), "{text}");
    let called = note(Calling::description());
    assert!(called.contains("`file`") && called.contains("pass on `self`"), "{called}");
    assert_eq!(dependencies::<Calling>("y"), ["u[1]", "u[2]"]);
    let number = note(Unbounded::description());
    assert!(number.contains("`number`") && number.contains("`min` and `max`"), "{number}");
    assert!(note(Inspecting::description()).contains("read the value"));
    assert!(note(Combinations::description()).contains("more than 4096 combinations"));
}

#[derive(State)]
struct Clock<T> {
    /// Integral (1)
    x: T,
}

#[derive(Parameters)]
struct TimeOnly;

/// A state that follows from the time
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for TimeOnly {
    type State<T: Scalar> = Clock<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Clock<T> {
        Clock { x: at.time.cos() }
    }
}

#[test]
fn a_derivative_of_the_time_alone_depends_on_no_state() {
    assert_eq!(dependencies::<TimeOnly>("der(x)"), Vec::<String>::new());
}
