//! Arrays whose lengths are structural parameters. References: FMI 3.0.2, sections 2.2.6 (arrays), 2.3.1 (Configuration and
//! Reconfiguration Mode) and 2.4.7.5 (structural parameters); closed forms.
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use std::path::Path;
use std::ptr::null_mut;

use fmu::prelude::*;
use fmu::simulation::ContinuousSimulation;
use fmu::testing::abi::{Export, Status, fmi3};
use fmu::testing::calls::Function;
use fmu::testing::description::{Description, Format};

use crate::allocations::allocations;
use crate::events::EqualSteps;
use crate::fmi3::Instance;
use crate::models::exported;

/// Tanks that empty independently: level' = inflow - rate × level.
#[derive(Parameters)]
struct Drains {
    /// Number of tanks
    #[var(structural, start = 3, max = 4, tunable)]
    n: u64,
    /// Number of sums
    #[var(structural, start = 1, max = 2)]
    m: u64,
    /// Report the levels above 0 only
    #[var(structural, start = false)]
    clamps: bool,
    /// Rates (1/s)
    #[var(size = "n", start = [1.0, 2.0, 3.0, 4.0], min = 0.0, tunable)]
    rate: Array<f64, 4>,
    /// Weights (1)
    #[var(size = ["m", "n"], start = identity, tunable)]
    weight: Matrix<f64, 2, 4>,
}

#[derive(State)]
struct Levels<T> {
    /// Level (m)
    #[var(size = "n", start = 1.0, nominal = 2.0)]
    level: Array<T, 4>,
    /// Lost (m)
    #[var(start = 0.5)]
    lost: T,
}

#[derive(Inputs)]
struct Inflows<T> {
    /// Inflow (m/s)
    #[var(size = "n")]
    inflow: Array<T, 4>,
}

#[derive(Outputs)]
struct Sums<T> {
    /// Weighted sums (m)
    #[var(size = "m")]
    sum: Array<T, 2>,
    /// Numbers of the tanks
    #[var(size = "n")]
    number: Array<i32, 4>,
}

/// Tanks that empty
#[fmu::model(stop_time = 1.0, step_size = 0.1, solver = Solver::DormandPrince { tolerance: 1e-10 })]
impl Continuous for Drains {
    type State<T: Scalar> = Levels<T>;
    type Inputs<T: Scalar> = Inflows<T>;
    type Outputs<T: Scalar> = Sums<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Levels<T> {
        let (level, inflow) = (&at.state.level, &at.inputs.inflow);
        let lost = level.iter().zip(&self.rate[..]).fold(T::from(0.0), |sum, (&x, &rate)| sum + x * rate);
        Levels { level: Array::from_fn(level.len(), |i| inflow[i] - level[i] * self.rate[i]), lost }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Sums<T> {
        let level = &at.state.level;
        let product = |row: &[f64]| row.iter().zip(&level[..]).fold(T::from(0.0), |sum, (&w, &x)| sum + x * w);
        let sum = Array::from_fn(self.weight.len(), |i| product(&self.weight[i]));
        Sums { sum, number: Array::from_fn(level.len(), |i| i as i32 + 1) }
    }
}

exported! {
    Tanks: Drains, Format { arrays: true, ..Format::FMI3 };
    Ball: EqualSteps, Format { arrays: true, ..Format::FMI3 };
    Copying: Copier, Format { arrays: true, ..Format::FMI3 };
}

/// The value reference of a variable, or of an array.
fn reference(name: &str) -> u32 {
    let description = Tanks::description();
    let mut variables = description.layout.variables.iter().map(|variable| (&variable.declaration, variable.reference));
    let is_named = |declaration: &fmu::testing::variable::Declaration| {
        declaration.array.as_ref().map_or(&declaration.name, |array| &array.name) == name
    };
    variables.find(|(declaration, _)| is_named(declaration)).expect("a variable").1
}

impl<E: Export> Instance<E> {
    fn call(&self, function: unsafe fn(fmu::testing::abi::Component) -> Status) {
        // SAFETY: a live component.
        assert_eq!(unsafe { function(self.component) }, Status::Ok, "{:?}", self.messages.lock().unwrap());
    }

    fn rejected(&self, function: unsafe fn(fmu::testing::abi::Component) -> Status) -> String {
        // SAFETY: a live component.
        assert_eq!(unsafe { function(self.component) }, Status::Error);
        self.error()
    }

    fn set_size(&self, name: &str, size: u64) -> Status {
        // SAFETY: arrays of these lengths.
        unsafe { fmi3::set_number::<E, u64>(self.component, Function::SetUInt64, &reference(name), 1, &size, 1) }
    }

    fn values<const N: usize>(&self, name: &str) -> [f64; N] {
        let mut values = [f64::NAN; N];
        assert_eq!(self.get(&[reference(name)], &mut values), Status::Ok, "{:?}", self.messages.lock().unwrap());
        values
    }

    fn states(&self) -> usize {
        let mut count = 77;
        // SAFETY: a live component and a number to write to.
        unsafe { assert_eq!(fmi3::get_number_of_continuous_states::<E>(self.component, &mut count), Status::Ok) };
        count
    }
}

/// A new instance with these sizes.
fn configured(is_exchange: bool, n: u64, m: u64) -> Instance<Tanks> {
    let instance = if is_exchange { Instance::model_exchange() } else { Instance::co_simulation(false) };
    instance.call(fmi3::enter_configuration_mode::<Tanks>);
    assert_eq!((instance.set_size("n", n), instance.set_size("m", m)), (Status::Ok, Status::Ok));
    instance.call(fmi3::exit_configuration_mode::<Tanks>);
    instance
}

/// level = 1 · exp(-rate t) + inflow / rate · (1 - exp(-rate t)); the tolerance of the solver is 1e-10.
fn assert_levels(levels: &[f64], rates: &[f64], inflow: f64, start: f64, time: f64) {
    assert_eq!(levels.len(), rates.len());
    for (level, rate) in levels.iter().zip(rates) {
        let decay = (-rate * time).exp();
        let expected = start * decay + inflow / rate * (1.0 - decay);
        assert!((level - expected).abs() < 1e-8, "{level} {expected}");
    }
}

#[test]
fn arrays_have_the_lengths_that_are_set_in_configuration_mode() {
    let instance = configured(false, 2, 2);
    assert_eq!(instance.values::<2>("rate"), [1.0, 2.0]);
    assert_eq!(instance.values::<4>("weight"), [1.0, 0.0, 0.0, 1.0]);
    assert_eq!(instance.set(&[reference("weight")], &[1.0, 1.0, 0.0, 2.0]), Status::Ok);
    assert_eq!(instance.set(&[reference("rate")], &[1.0, 2.0, 3.0]), Status::Error);
    assert_eq!(instance.error(), "fmi3SetFloat64: nValues must be 2 for these variables, got 3");
    let instance = instance.initialized();
    assert_eq!(instance.set(&[reference("inflow")], &[3.0, 3.0]), Status::Ok);
    let (status, ..) = instance.step(0.0, 0.5);
    assert_eq!(status, Status::Ok);
    let levels = instance.values::<2>("level");
    assert_levels(&levels, &[1.0, 2.0], 3.0, 1.0, 0.5);
    assert_eq!(instance.values::<2>("sum"), [levels[0] + levels[1], 2.0 * levels[1]]);
    let mut numbers = [0; 2];
    // SAFETY: arrays of these lengths.
    let status = unsafe {
        let get = fmi3::get_number::<Tanks, i32>;
        get(instance.component, Function::GetInteger, &reference("number"), 1, numbers.as_mut_ptr(), 2)
    };
    assert_eq!((status, numbers), (Status::Ok, [1, 2]));
    // Two arrays in one call.
    let mut both = [0.0; 4];
    assert_eq!(instance.get(&[reference("rate"), reference("level")], &mut both), Status::Ok);
    assert_eq!(both, [1.0, 2.0, levels[0], levels[1]]);
}

#[test]
fn arrays_may_be_empty() {
    let instance = configured(false, 0, 1).initialized();
    assert_eq!(instance.step(0.0, 0.5).0, Status::Ok);
    assert_eq!((instance.values::<0>("level"), instance.values::<1>("sum")), ([], [0.0]));
    assert_eq!(instance.values::<1>("lost"), [0.5]);
}

#[test]
fn arrays_grow_and_shrink_between_steps() {
    let instance = configured(false, 3, 2).initialized();
    let resize = |n| {
        instance.call(fmi3::enter_configuration_mode::<Tanks>);
        assert_eq!(instance.set_size("n", n), Status::Ok);
        instance.call(fmi3::exit_configuration_mode::<Tanks>);
    };
    assert_eq!(instance.set(&[reference("rate")], &[2.0, 2.0, 2.0]), Status::Ok);
    assert_eq!(instance.step(0.0, 0.5).0, Status::Ok);
    let before = instance.values::<3>("level");
    resize(2);
    assert_eq!(instance.values::<2>("level"), before[..2]);
    // A new element has the start values, also if the array was longer before.
    resize(4);
    assert_eq!(instance.values::<4>("level"), [before[0], before[1], 1.0, 1.0]);
    assert_eq!(instance.values::<4>("rate"), [2.0, 2.0, 3.0, 4.0]);
    assert_eq!(instance.values::<8>("weight"), [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    assert_eq!(instance.step(0.5, 0.5).0, Status::Ok);
    let levels = instance.values::<4>("level");
    assert_levels(&levels[..2], &[2.0, 2.0], 0.0, 1.0, 1.0);
    assert_levels(&levels[2..], &[3.0, 4.0], 0.0, 1.0, 0.5);
}

#[derive(Parameters)]
struct Copier {
    /// Number of values
    #[var(structural, start = 1, max = 2, tunable)]
    n: u64,
}

#[derive(Inputs)]
struct Originals {
    /// Originals (1)
    #[var(size = "n", start = [1.0, 2.0])]
    original: Array<f64, 2>,
}

#[derive(Outputs)]
struct Copies {
    /// Copies (1)
    #[var(size = "n", start = [3.0, 4.0])]
    copy: Array<f64, 2>,
}

/// Copies its inputs
#[fmu::model(stop_time = 1.0, step_size = 0.5)]
impl Discrete for Copier {
    type Inputs = Originals;
    type Outputs = Copies;
    fn update(&self, sample: Sample<Self>) -> Copies {
        Copies { copy: sample.inputs.original }
    }
}

/// The copy of an array contains the start values of the elements that are not present; they must not become values.
#[test]
fn a_new_element_has_its_start_value_after_arrays_were_copied() {
    let instance = Instance::<Copying>::co_simulation(false).initialized();
    let description = Copying::description();
    let of = |name: &str| {
        let is_it = |v: &&fmu::testing::variable::Variable| v.declaration.name.starts_with(name);
        description.layout.variables.iter().find(is_it).unwrap().reference
    };
    let copies = |count: usize| {
        let mut values = vec![0.0; count];
        assert_eq!(instance.get(&[of("copy")], &mut values), Status::Ok);
        values
    };
    assert_eq!(instance.step(0.0, 0.5).0, Status::Ok);
    assert_eq!(copies(1), [1.0]);
    instance.call(fmi3::enter_configuration_mode::<Copying>);
    // SAFETY: arrays of these lengths.
    let status =
        unsafe { fmi3::set_number::<Copying, u64>(instance.component, Function::SetUInt64, &of("n"), 1, &2, 1) };
    assert_eq!(status, Status::Ok);
    instance.call(fmi3::exit_configuration_mode::<Copying>);
    assert_eq!(copies(2), [1.0, 4.0]);
    assert_eq!(instance.step(0.5, 0.5).0, Status::Ok);
    assert_eq!(copies(2), [1.0, 2.0]);
}

/// Reference: the equations. The third state in memory is not present.
#[test]
fn model_exchange_has_the_present_states() {
    let instance = configured(true, 2, 1);
    assert_eq!((instance.states(), Instance::<Tanks>::model_exchange().states()), (3, 4));
    let instance = instance.initialized();
    let mut values = [0.0; 3];
    // SAFETY: live components and arrays of these lengths.
    unsafe {
        let component = instance.component;
        instance.call(fmi3::enter_continuous_time_mode::<Tanks>);
        let states = [5.0, 6.0, 7.0];
        assert_eq!(fmi3::set_continuous_states::<Tanks>(component, states.as_ptr(), 3), Status::Ok);
        assert_eq!(fmi3::get_continuous_states::<Tanks>(component, values.as_mut_ptr(), 3), Status::Ok);
        assert_eq!(values, states);
        assert_eq!(fmi3::get_derivatives::<Tanks>(component, values.as_mut_ptr(), 3), Status::Ok);
        assert_eq!(values, [-5.0, -12.0, 17.0]);
        assert_eq!(fmi3::get_nominals_of_continuous_states::<Tanks>(component, values.as_mut_ptr(), 3), Status::Ok);
        assert_eq!(values, [2.0, 2.0, 1.0]);
        assert_eq!(fmi3::set_continuous_states::<Tanks>(component, [1.0, f64::NAN, 1.0].as_ptr(), 3), Status::Discard);
        assert_eq!(fmi3::get_continuous_states::<Tanks>(component, values.as_mut_ptr(), 4), Status::Error);
        assert!(instance.error().contains("the model has 3 states, the array has the length 4"));
    }
    assert_eq!(instance.values::<2>("level"), [5.0, 6.0]);
    let [level, lost, slope] = ["level", "lost", "der(level)"].map(reference);
    let (knowns, seed, mut found) = ([level, lost], [1.0, 10.0, 0.0], [0.0; 2]);
    // SAFETY: arrays of these lengths.
    let status = unsafe {
        let get = fmi3::get_derivative::<Tanks>;
        let (function, to) = (Function::GetDirectionalDerivative, found.as_mut_ptr());
        get(instance.component, function, &slope, 1, knowns.as_ptr(), 2, seed.as_ptr(), 3, to, 2)
    };
    assert_eq!((status, found), (Status::Ok, [-1.0, -20.0]));
}

/// A state is restored with its sizes, also from bytes. Reference: the instance that saved it.
#[test]
fn saved_states_contain_the_sizes() {
    let instance = configured(false, 2, 2).initialized();
    assert_eq!(instance.step(0.0, 0.5).0, Status::Ok);
    let copy = instance.copied();
    assert_eq!(copy.values::<2>("level"), instance.values::<2>("level"));
    assert_eq!((instance.step(0.5, 0.5).0, copy.step(0.5, 0.5).0), (Status::Ok, Status::Ok));
    assert_eq!(copy.values::<2>("sum"), instance.values::<2>("sum"));
    let mut state = null_mut();
    // SAFETY: a live component and a state of it.
    unsafe {
        assert_eq!(fmi3::get_fmu_state::<Tanks>(instance.component, &mut state), Status::Ok);
        instance.call(fmi3::reset::<Tanks>);
        assert_eq!(instance.values::<3>("rate"), [1.0, 2.0, 3.0]);
        assert_eq!(fmi3::set_fmu_state::<Tanks>(instance.component, state), Status::Ok);
        assert_eq!(fmi3::free_fmu_state::<Tanks>(instance.component, &mut state), Status::Ok);
    }
    assert_eq!(instance.values::<2>("sum"), copy.values::<2>("sum"));
}

/// States are saved and restored in all modes of the super state FMU State Setable. Reference: FMI 3.0.2, section 2.3.
#[test]
fn states_are_saved_while_structural_parameters_are_set() {
    let instance = Instance::<Tanks>::co_simulation(false);
    instance.call(fmi3::enter_configuration_mode::<Tanks>);
    assert_eq!(instance.set_size("n", 2), Status::Ok);
    let copy = instance.copied();
    assert_eq!(copy.set_size("m", 2), Status::Ok);
    copy.call(fmi3::exit_configuration_mode::<Tanks>);
    let copy = copy.initialized();
    assert_eq!(copy.values::<2>("level"), [1.0, 1.0]);
    assert_eq!(copy.step(0.0, 0.5).0, Status::Ok);
    copy.call(fmi3::enter_configuration_mode::<Tanks>);
    assert_eq!(copy.set_size("n", 3), Status::Ok);
    let other = copy.copied();
    assert_eq!(other.set_size("m", 1), Status::Error);
    for instance in [&copy, &other] {
        instance.call(fmi3::exit_configuration_mode::<Tanks>);
        assert_eq!(instance.step(0.5, 0.5).0, Status::Ok);
    }
    assert_eq!(other.values::<3>("level"), copy.values::<3>("level"));
    assert_eq!(other.values::<2>("sum"), copy.values::<2>("sum"));
}

macro_rules! decays {
    ($($model:ident $state:ident: [$($size:tt)*], $type:ty, { $($n:tt)* };)*) => {$(
        #[derive(Parameters)]
        struct $model {
            $($n)*
        }
        #[derive(State)]
        struct $state<T> {
            /// Amount (mol)
            #[var(start = 2.0, $($size)*)]
            x: $type,
        }
        /// Logistic decay
        #[fmu::model(stop_time = 1.0, step_size = 0.1, solver = Solver::DormandPrince { tolerance: 1e-4 })]
        impl Continuous for $model {
            type State<T: Scalar> = $state<T>;
            fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> $state<T> {
                let mut x = at.state.x;
                x[0] = x[0] - x[0] * x[0];
                $state { x }
            }
        }
    )*};
}
decays! {
    One OneX: [], [T; 1], {};
    OneOfFour OneOfFourX: [size = "n"], Array<T, 4>, {
        /// Length
        #[var(structural, start = 1, min = 1, max = 4)]
        n: u64,
    };
}

/// The error of a step is averaged over the present states: one of four, whose root is exact. Reference: the model with one
/// state, bit by bit.
#[test]
fn states_that_are_not_present_do_not_change_the_steps_of_the_solver() {
    let mut one = ContinuousSimulation::new(One::default()).unwrap();
    let mut of_four = ContinuousSimulation::new(OneOfFour::default()).unwrap();
    for _ in 0..10 {
        one.step(&(), 0.5).unwrap();
        of_four.step(&(), 0.5).unwrap();
        assert_eq!(of_four.state().x.iter().map(|x| x.to_bits()).collect::<Vec<_>>(), [one.state().x[0].to_bits()]);
    }
}

#[test]
fn dependencies_are_those_of_the_present_elements() {
    let instance = configured(false, 2, 1).initialized();
    let pairs = |name: &str| {
        let mut count = 0;
        // SAFETY: a live component, a number to write to, and arrays of this length.
        unsafe {
            let number = fmi3::get_number_of_variable_dependencies::<Tanks>;
            assert_eq!(number(instance.component, reference(name), &mut count), Status::Ok);
            let (mut elements, mut on, mut of, mut kinds) =
                (vec![0; count], vec![0; count], vec![0; count], vec![0; count]);
            let (to, independents, indices) = (elements.as_mut_ptr(), on.as_mut_ptr(), of.as_mut_ptr());
            let get = fmi3::get_variable_dependencies::<Tanks>;
            let status = get(instance.component, reference(name), to, independents, indices, kinds.as_mut_ptr(), count);
            assert_eq!(status, Status::Ok);
            let mut all: Vec<_> = elements.into_iter().zip(on).zip(of).map(|((e, on), of)| (e, on, of)).collect();
            all.sort_unstable();
            all
        }
    };
    let [level, inflow] = ["level", "inflow"].map(reference);
    let mut expected = vec![(1, level, 1), (2, level, 2), (1, inflow, 1), (2, inflow, 2)];
    expected.sort_unstable();
    assert_eq!(pairs("der(level)"), expected);
    assert_eq!(pairs("sum"), [(1, level, 1), (1, level, 2)]);
}

#[test]
fn structural_parameters_are_set_in_their_modes_only() {
    let instance = configured(false, 2, 2);
    assert_eq!(instance.set_size("n", 1), Status::Error);
    assert_eq!(
        instance.error(),
        "fmi3SetUInt64: 'n' is a structural parameter, settable only in Configuration Mode and Reconfiguration Mode; the \
         instance is in Instantiated"
    );
    instance.call(fmi3::enter_configuration_mode::<Tanks>);
    assert_eq!(instance.set(&[reference("inflow")], &[1.0, 1.0]), Status::Error);
    assert!(instance.error().contains("fmi3SetFloat64 called in Configuration Mode"));
    assert_eq!(instance.set_size("n", 5), Status::Error);
    assert_eq!(instance.error(), "fmi3SetUInt64: 'n' must be in [0, 4], got 5");
    let clamps = reference("clamps");
    // SAFETY: arrays of these lengths.
    unsafe {
        assert_eq!(fmi3::set_boolean::<Tanks>(instance.component, &clamps, 1, &1, 1), Status::Ok);
    }
    instance.call(fmi3::exit_configuration_mode::<Tanks>);
    let instance = instance.initialized();
    instance.call(fmi3::enter_configuration_mode::<Tanks>);
    assert_eq!(instance.set_size("m", 1), Status::Error);
    assert!(instance.error().contains("'m' is a structural parameter, settable only in Configuration Mode"));
    let ball = Instance::<Ball>::co_simulation(false);
    assert_eq!(
        ball.rejected(fmi3::enter_configuration_mode::<Ball>),
        "fmi3EnterConfigurationMode: the FMU has no structural parameters"
    );
}

#[test]
fn steps_with_sizes_do_not_allocate() {
    let instance = configured(false, 2, 2).initialized();
    let (level, inflow, mut values) = (reference("level"), reference("inflow"), [0.0; 2]);
    let mut step = |i: u32| {
        assert_eq!(instance.set(&[inflow], &[1.0, 2.0]), Status::Ok);
        assert_eq!(instance.step(f64::from(i) * 0.1, 0.1).0, Status::Ok);
        assert_eq!(instance.get(&[level], &mut values), Status::Ok);
    };
    step(0);
    assert_eq!(allocations(|| (1..10).for_each(&mut step)), 0);
}

#[test]
fn the_description_names_the_sizes() {
    let xml = &Tanks::description().xml;
    let [n, m] = ["n", "m"].map(reference);
    for text in [
        format!(
            "<UInt64 name=\"n\" valueReference=\"{n}\" description=\"Number of tanks\" causality=\"structuralParameter\" variability=\"tunable\" initial=\"exact\" max=\"4\" start=\"3\"/>"
        ),
        format!(
            "start=\"1.0 0.0 0.0\">\n      <Dimension valueReference=\"{m}\"/>\n      <Dimension valueReference=\"{n}\"/>"
        ),
        format!("min=\"0.0\" start=\"1.0 2.0 3.0\">\n      <Dimension valueReference=\"{n}\"/>"),
        "<Boolean name=\"clamps\"".to_owned(),
    ] {
        assert!(xml.contains(&text), "{text}\n{xml}");
    }
    assert_eq!(xml.matches("structuralParameter").count(), 3);
}

macro_rules! mistaken {
    ($($name:ident, [$($keys:tt)*], $size:literal;)*) => {$(
        #[derive(Parameters)]
        struct $name {
            /// Length
            #[var($($keys)*)]
            n: u64,
            /// Values (1)
            #[var(size = $size, start = 0.0)]
            values: Array<f64, 4>,
        }
        /// Mistake
        #[fmu::model(stop_time = 1.0, step_size = 0.1)]
        impl Continuous for $name {
            type State<T: Scalar> = Decaying<T>;
            fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Decaying<T> {
                let _ = (self.n, &self.values);
                Decaying { x: -at.state.x }
            }
        }
    )*};
}

#[derive(State)]
struct Decaying<T> {
    /// State (1)
    x: T,
}

fn error_of<E: Export>(format: Format) -> String {
    Description::try_of::<E::Model>(format, Path::new("")).unwrap_err()
}

// The test that the macro adds to each model fails: it reports the same mistakes.
#[test]
#[allow(unnameable_test_items, reason = "see above")]
fn mistaken_sizes_are_errors() {
    mistaken! {
        Plain, [start = 3, max = 4], "n";
        Unknown, [structural, start = 3, max = 4], "m";
        TooLong, [structural, start = 3, max = 5], "n";
        Empty, [structural, start = 0, max = 4], "n";
    }
    let rule = "must be a parameter of type `u64` with `structural`";
    let format = Format { arrays: true, ..Format::FMI3 };
    assert_eq!(error_of::<Plain>(format), format!("Plain: the length 'n' of 'values' {rule}"));
    assert_eq!(error_of::<Unknown>(format), format!("Unknown: the length 'm' of 'values' {rule}"));
    let room = "TooLong: 'values' has room for 4 elements, so `max` of 'n' must be 4, got 5";
    assert_eq!(error_of::<TooLong>(format), room);
    let empty = "Empty: start of 'n' must be above 0, because it is the length of an array; got 0";
    assert_eq!(error_of::<Empty>(format), empty);
    for format in [Format::FMI2, Format::FMI3] {
        let expected = "'rate' has the length n, which only array variables can have: pack with --fmi 3 --arrays";
        assert_eq!(error_of::<Drains>(format), format!("Drains: {expected}"));
    }
}
