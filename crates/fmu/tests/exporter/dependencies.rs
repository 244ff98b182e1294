//! Dependencies of variables, element by element. References: FMI 3.0.2, section 2.2.10 (retrieving dependencies); the
//! equations.
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use std::ffi::CStr;
use std::ptr::null_mut;

use fmu::prelude::*;
use fmu::testing::abi::{self, Export, Library, Status, fmi3};
use fmu::testing::description::Format;

use crate::events::EqualSteps;
use crate::fmi3::Instance;

#[derive(Parameters)]
pub(crate) struct Tanks {
    /// Outflow (1/s)
    #[var(start = 0.5)]
    rate: f64,
    /// Offsets (m)
    #[var(start = 1.0)]
    offset: [f64; 2],
}

#[derive(State)]
pub(crate) struct Levels<T> {
    /// Levels (m)
    #[var(start = 1.0, nominal = 1.0)]
    level: [T; 3],
    /// Sum of the outflow (m)
    #[var(calculated, local, nominal = 1.0)]
    sum: T,
}

#[derive(Inputs)]
pub(crate) struct Inflow<T> {
    /// Inflow (m/s)
    inflow: [T; 2],
    /// Select the first level
    first: bool,
}

#[derive(Outputs)]
pub(crate) struct Seen<T> {
    /// Differences of levels (m)
    difference: [T; 2],
    /// Level of the selected tank, or the inflow over the time (m)
    selected: T,
    /// Position of the selector
    position: i32,
}

/// Three tanks in a row
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Tanks {
    type State<T: Scalar> = Levels<T>;
    type Inputs<T: Scalar> = Inflow<T>;
    type Outputs<T: Scalar> = Seen<T>;
    fn initialize(&self, _: &(), x: &mut Levels<f64>) {
        x.sum = self.offset[0];
    }
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Levels<T> {
        let (x, u) = (&at.state.level, &at.inputs.inflow);
        let flow = x.map(|x| x * self.rate);
        Levels { level: [u[0] - flow[0], flow[0] - flow[1], flow[1] - flow[2] + u[1]], sum: flow[2] }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Seen<T> {
        let (x, u) = (&at.state.level, &at.inputs.inflow);
        Seen {
            difference: [x[1] - x[0], x[2] - x[1]],
            selected: if at.inputs.first { x[0] } else { u[1] * at.time },
            position: i32::from(at.inputs.first),
        }
    }
}

/// The dependencies of [`Tanks`] for the library, with a line for each value reference: 4 parameters (`p`), inflow 4 and 5,
/// outputs 6 to 8, states 9 to 12, derivatives 13 to 16, position 17, selector 18, time 19.
const TEXT: &str = ";\n;\n;\n;\n;\n;\n9-10\n10-11\n5 9 18-19\n9;\n10;\n11;\n;p\n4 9\n\
                    9-10\n5 10-11\n11\n18\n;\n;";

macro_rules! exported {
    ($($name:ident: $model:ty, $arrays:literal $($guid:literal)?;)*) => {$(
        struct $name;
        impl Export for $name {
            type Model = <$model as Export>::Model;
            const FORMAT: Format = Format { arrays: $arrays, ..Format::FMI3 };
            $(
                const GUID: Option<&'static str> = Some($guid);
                const DEPENDENCIES: &'static str = TEXT;
            )?
            fn library() -> &'static Library {
                static LIBRARY: Library = Library::new();
                &LIBRARY
            }
        }
    )*};
}
exported! {
    Scalars: Tanks, false;
    Arrays: Tanks, true;
    PackedScalars: Tanks, false "{0}";
    PackedArrays: Tanks, true "{0}";
    Ball: EqualSteps, false;
}

/// A dependency: element of the dependent variable, name and element of the other variable.
type Found = (usize, String, usize);

/// Name of a variable; with arrays, of the array.
fn name_of<E: Export>(reference: u32) -> String {
    let description = E::description();
    let Some(variable) = description.layout.by_reference(reference) else {
        assert_eq!(reference, description.layout.end);
        return "time".to_owned();
    };
    let declaration = &variable.declaration;
    let array = declaration.array.as_ref().filter(|_| E::FORMAT.arrays);
    array.map_or(&declaration.name, |array| &array.name).clone()
}

fn reference<E: Export>(name: &str) -> u32 {
    (0..E::description().layout.end).find(|&reference| name_of::<E>(reference) == name).expect("a variable")
}

fn number<E: Export>(instance: &Instance<E>, reference: u32) -> (Status, usize) {
    let mut count = 77;
    // SAFETY: a live component and a number to write to.
    let get = fmi3::get_number_of_variable_dependencies::<E>;
    (unsafe { get(instance.component, reference, &mut count) }, count)
}

fn dependencies<E: Export>(instance: &Instance<E>, reference: u32) -> Vec<Found> {
    let (status, count) = number(instance, reference);
    assert_eq!(status, Status::Ok);
    let (mut elements, mut on, mut of, mut kinds) = (vec![0; count], vec![0; count], vec![0; count], vec![0; count]);
    // SAFETY: arrays of these lengths.
    let status = unsafe {
        let (elements, on, of) = (elements.as_mut_ptr(), on.as_mut_ptr(), of.as_mut_ptr());
        let get = fmi3::get_variable_dependencies::<E>;
        get(instance.component, reference, elements, on, of, kinds.as_mut_ptr(), count)
    };
    assert_eq!(status, Status::Ok);
    // fmi3Dependent
    assert_eq!(kinds, vec![5; count]);
    let all = elements.into_iter().zip(on).zip(of);
    sorted(all.map(|((element, on), of)| (element, name_of::<E>(on), of)).collect())
}

/// The standard prescribes no order.
fn sorted(mut all: Vec<Found>) -> Vec<Found> {
    all.sort();
    all
}

fn found(all: &[(usize, &str, usize)]) -> Vec<Found> {
    sorted(all.iter().map(|&(element, on, of)| (element, on.to_owned(), of)).collect())
}

fn arrays_have_a_pattern<E: Export>() {
    let get = |instance: &Instance<E>, name: &str| dependencies(instance, reference::<E>(name));
    let instance = Instance::<E>::co_simulation(false);
    // At the start, everything follows from the parameters, too. The state `sum` is calculated and not known.
    let parameters = |element| {
        let all = [("rate", 1), ("offset", 1), ("offset", 2), ("max_step", 1)];
        sorted(all.map(|(name, of)| (element, name.to_owned(), of)).to_vec())
    };
    assert_eq!(get(&instance, "sum"), parameters(1));
    let first = [parameters(1), found(&[(1, "level", 1), (1, "level", 2)])].concat();
    let second = [parameters(2), found(&[(2, "level", 2), (2, "level", 3)])].concat();
    assert_eq!(get(&instance, "difference"), sorted([first, second].concat()));
    // A state with a start value, parameters and inputs are known.
    for known in ["level", "rate", "offset", "inflow"] {
        assert_eq!(get(&instance, known), []);
    }
    let instance = instance.initialized();
    assert_eq!(
        get(&instance, "der(level)"),
        found(&[
            (1, "inflow", 1),
            (1, "level", 1),
            (2, "level", 1),
            (2, "level", 2),
            (3, "inflow", 2),
            (3, "level", 2),
            (3, "level", 3),
        ])
    );
    assert_eq!(
        get(&instance, "difference"),
        found(&[(1, "level", 1), (1, "level", 2), (2, "level", 2), (2, "level", 3)])
    );
    let selected = [(1, "time", 1), (1, "inflow", 2), (1, "first", 1), (1, "level", 1)];
    assert_eq!(get(&instance, "selected"), found(&selected));
    assert_eq!(get(&instance, "position"), found(&[(1, "first", 1)]));
    assert_eq!(get(&instance, "level"), found(&[(1, "level", 1), (2, "level", 2), (3, "level", 3)]));
    assert_eq!(get(&instance, "rate"), []);
    // SAFETY: a live component.
    assert_eq!(unsafe { fmi3::reset::<E>(instance.component) }, Status::Ok);
    assert_eq!(get(&instance, "sum"), parameters(1));
    // An element is not a variable.
    let (status, count) = number(&instance, reference::<E>("level") + 1);
    assert_eq!((status, count), (Status::Error, 77));
}

#[test]
fn arrays_keep_the_pattern_of_their_elements() {
    arrays_have_a_pattern::<Arrays>();
    arrays_have_a_pattern::<PackedArrays>();
}

/// Reference: the dependencies in modelDescription.xml.
fn scalars_have_the_dependencies_of_the_description<E: Export>() {
    let xml = &Scalars::description().xml;
    let listed = |element: &str, reference: u32| {
        let text = format!("<{element} valueReference=\"{reference}\" dependencies=\"");
        let (_, rest) = xml.split_once(&text)?;
        let list = rest.split_once('"')?.0.split_whitespace();
        Some(sorted(list.map(|on| (1, name_of::<Scalars>(on.parse().unwrap()), 1)).collect()))
    };
    let instance = Instance::<E>::co_simulation(false);
    let all = || 0..E::description().layout.end;
    let mut count = 0;
    for reference in all() {
        if let Some(expected) = listed("InitialUnknown", reference) {
            assert_eq!(dependencies(&instance, reference), expected, "{}", name_of::<E>(reference));
            count += 1;
        }
    }
    let instance = instance.initialized();
    for reference in all() {
        if let Some(expected) = listed("Output", reference).or_else(|| listed("ContinuousStateDerivative", reference)) {
            assert_eq!(dependencies(&instance, reference), expected, "{}", name_of::<E>(reference));
            count += 1;
        }
    }
    // 4 outputs, 4 derivatives and a calculated state at the start; then 3 outputs that are states, but not this one.
    assert_eq!(count, 9 + 11);
    assert!(xml.contains("<CoSimulation ") && xml.matches("providesPerElementDependencies=\"true\"").count() == 2);
}

#[test]
fn the_dependencies_of_scalars_are_those_of_the_description() {
    scalars_have_the_dependencies_of_the_description::<Scalars>();
    scalars_have_the_dependencies_of_the_description::<PackedScalars>();
    // The packer gets the text from the library.
    // SAFETY: a string that lives until the next call.
    assert_eq!(unsafe { CStr::from_ptr(abi::model_description::<Scalars>(3, 3 | 32)) }.to_str(), Ok(TEXT));
}

/// As in modelDescription.xml, which lists no dependencies of event indicators.
#[test]
fn an_event_indicator_depends_on_everything() {
    let instance = Instance::<Ball>::co_simulation(false).initialized();
    let indicator = Ball::description().layout.end + 1;
    let states = ["time", "height", "velocity"].map(|name| (1, name, 1));
    assert_eq!(dependencies(&instance, indicator), found(&states));
    assert_eq!(number(&instance, indicator + 1).0, Status::Error);
}

#[test]
fn invalid_questions_about_dependencies_are_errors() {
    let instance = Instance::<Scalars>::co_simulation(false).initialized();
    let end = Scalars::description().layout.end;
    let error = || instance.messages.lock().unwrap().pop().expect("an error is logged");
    assert_eq!(number(&instance, end), (Status::Ok, 0));
    // The model has no event indicators.
    assert_eq!(number(&instance, end + 1), (Status::Error, 77));
    assert_eq!(
        error(),
        format!("fmi3GetNumberOfVariableDependencies: value reference {} is not a variable of this FMU", end + 1)
    );
    // SAFETY: null pointers and arrays of no elements are allowed here.
    unsafe {
        let none = fmi3::get_number_of_variable_dependencies::<Scalars>(instance.component, 0, null_mut());
        assert_eq!(none, Status::Error);
        let get = fmi3::get_variable_dependencies::<Scalars>;
        let selected = reference::<Scalars>("selected");
        let none = get(instance.component, selected, null_mut(), null_mut(), null_mut(), null_mut(), 0);
        assert_eq!(none, Status::Error);
    }
    assert_eq!(error(), "fmi3GetVariableDependencies: nDependencies must be 4 for this variable, got 0");
}
