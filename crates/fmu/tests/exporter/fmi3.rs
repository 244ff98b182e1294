//! The C interface of FMI 3.0. References: the same model in FMI 2.0, bit for bit; closed forms; the matrix of
//! directional derivatives.
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::ptr::{null, null_mut};
use std::sync::Mutex;

use fmu::testing::abi::fmi3::{self, Arguments};
use fmu::testing::abi::{self, Component, Export, Library, Status};
use fmu::testing::calls::{Function, Interfaces};
use fmu::testing::description::{Description, Format};
use fmu::testing::runner::ContinuousModel;

use crate::arrays::Arrays;
use crate::events::{EqualSteps, Pulses, ball};
use crate::models::{CartPair, Fmu, Sampler, exported, reals, reference};
use crate::types::DiscreteTypes;

exported! {
    Carts: CartPair, Format::FMI3;
    NativeArrays: Arrays, Format { arrays: true, ..Format::FMI3 };
    Ball: EqualSteps, Format::FMI3;
    Train: Pulses, Format::FMI3;
    TrainWithoutExchange: WithoutExchange, Format { interfaces: Interfaces { model_exchange: false, ..Interfaces::ALL }, ..Format::FMI3 };
    Filter: Sampler, Format::FMI3;
    Types: DiscreteTypes, Format::FMI3;
}

/// A model packed for co-simulation only, as expanded by the macro.
struct WithoutExchange;

impl Export for WithoutExchange {
    type Model = ContinuousModel<Pulses, false>;
    fn library() -> &'static Library {
        static LIBRARY: Library = Library::new();
        &LIBRARY
    }
}

/// Messages of an instance.
pub(crate) type Messages = Mutex<Vec<String>>;

unsafe extern "C" fn log(environment: *mut c_void, _: c_int, _: *const c_char, message: *const c_char) {
    // SAFETY: the environment is the test's list, the message is a C string.
    let (messages, message) = unsafe { (&*environment.cast::<Messages>(), CStr::from_ptr(message)) };
    messages.lock().unwrap().push(message.to_str().unwrap().to_owned());
}

/// An instance of FMI 3.0, freed when dropped.
pub(crate) struct Instance<E: Export> {
    pub(crate) component: Component,
    pub(crate) messages: Box<Messages>,
    model: std::marker::PhantomData<E>,
}

impl<E: Export> Drop for Instance<E> {
    fn drop(&mut self) {
        // SAFETY: a component that was not freed.
        unsafe { fmi3::free_instance::<E>(self.component) }
    }
}

impl<E: Export> Instance<E> {
    pub(crate) fn new(make: impl FnOnce(Arguments) -> Component) -> Self {
        let messages = Box::new(Messages::default());
        let token = std::ffi::CString::new(E::description().guid.clone()).unwrap();
        let component = make(Arguments {
            name: c"instance".as_ptr(),
            token: token.as_ptr(),
            resources: null(),
            logging_on: 0,
            environment: std::ptr::from_ref(&*messages).cast_mut().cast(),
            logger: Some(log),
        });
        Self { component, messages, model: std::marker::PhantomData }
    }

    pub(crate) fn co_simulation(events: bool) -> Self {
        // SAFETY: strings that end with a zero.
        let this = Self::new(|arguments| unsafe {
            fmi3::instantiate_co_simulation::<E>(arguments, events.into(), events.into(), null(), 0, None)
        });
        assert!(!this.component.is_null());
        this
    }

    pub(crate) fn model_exchange() -> Self {
        // SAFETY: strings that end with a zero.
        Self::new(|arguments| unsafe { fmi3::instantiate_model_exchange::<E>(arguments) })
    }

    pub(crate) fn initialized(self) -> Self {
        // SAFETY: a live component.
        unsafe {
            assert_eq!(fmi3::enter_initialization_mode::<E>(self.component, 0, 0.0, 0.0, 0, 0.0), Status::Ok);
            assert_eq!(fmi3::exit_initialization_mode::<E>(self.component), Status::Ok);
        }
        self
    }

    /// A new instance in the same state, created from the bytes of the state.
    pub(crate) fn copied(&self) -> Self {
        let other = Self::co_simulation(false);
        let (mut state, mut size) = (null_mut(), 0);
        // SAFETY: live components; the buffer has the size that the FMU states.
        unsafe {
            assert_eq!(fmi3::get_fmu_state::<E>(self.component, &mut state), Status::Ok);
            assert_eq!(fmi3::serialized_fmu_state_size::<E>(self.component, state, &mut size), Status::Ok);
            let mut bytes = vec![0; size];
            assert_eq!(fmi3::serialize_fmu_state::<E>(self.component, state, bytes.as_mut_ptr(), size), Status::Ok);
            assert_eq!(fmi3::free_fmu_state::<E>(self.component, &mut state), Status::Ok);
            let made = fmi3::deserialize_fmu_state::<E>(other.component, bytes.as_ptr(), size, &mut state);
            assert_eq!(made, Status::Ok);
            assert_eq!(fmi3::set_fmu_state::<E>(other.component, state), Status::Ok);
            assert_eq!(fmi3::free_fmu_state::<E>(other.component, &mut state), Status::Ok);
        }
        other
    }

    pub(crate) fn get(&self, references: &[u32], values: &mut [f64]) -> Status {
        let (count, length) = (references.len(), values.len());
        // SAFETY: arrays of these lengths.
        unsafe { fmi3::get_float64::<E>(self.component, references.as_ptr(), count, values.as_mut_ptr(), length) }
    }

    pub(crate) fn set(&self, references: &[u32], values: &[f64]) -> Status {
        let (count, length) = (references.len(), values.len());
        // SAFETY: as above.
        unsafe { fmi3::set_float64::<E>(self.component, references.as_ptr(), count, values.as_ptr(), length) }
    }

    /// Status, true if an event must be handled, true if the step ended early, and the time reached.
    pub(crate) fn step(&self, time: f64, step: f64) -> (Status, bool, bool, f64) {
        let (mut event, mut end, mut early, mut last) = (7, 7, 7, f64::NAN);
        // SAFETY: a live component and variables to write to.
        let status =
            unsafe { fmi3::do_step::<E>(self.component, time, step, 1, &mut event, &mut end, &mut early, &mut last) };
        (status, event == 1, early == 1, last)
    }

    /// Returns true if an event has set states, and the time of the next event.
    pub(crate) fn update(&self) -> (bool, Option<f64>) {
        let (mut flags, mut next) = ([7_u8; 5], f64::NAN);
        let [needs, end, nominals, states, defined] = &mut flags;
        // SAFETY: as above.
        let status = unsafe {
            fmi3::update_discrete_states::<E>(self.component, needs, end, nominals, states, defined, &mut next)
        };
        assert_eq!((status, *needs, *end, *nominals), (Status::Ok, 0, 0, 0));
        (*states == 1, (*defined == 1).then_some(next))
    }

    pub(crate) fn error(&self) -> String {
        self.messages.lock().unwrap().pop().expect("an error is logged")
    }

    fn derivative(&self, function: Function, unknowns: &[u32], knowns: &[u32], seed: &[f64]) -> Vec<f64> {
        let length = if function == Function::GetAdjointDerivative { knowns.len() } else { unknowns.len() };
        let mut result = vec![0.0; length];
        // SAFETY: arrays of these lengths.
        let status = unsafe {
            fmi3::get_derivative::<E>(
                self.component,
                function,
                unknowns.as_ptr(),
                unknowns.len(),
                knowns.as_ptr(),
                knowns.len(),
                seed.as_ptr(),
                seed.len(),
                result.as_mut_ptr(),
                length,
            )
        };
        assert_eq!(status, Status::Ok);
        result
    }
}

/// Reference: FMI 2.0.
#[test]
fn co_simulation_has_the_bits_of_fmi_2() {
    let references = reals::<CartPair>();
    let (new, mut old) = (Instance::<Carts>::co_simulation(false).initialized(), Fmu::<CartPair>::ready());
    let force = reference::<CartPair>("cart_force.r");
    for i in 0..200_u32 {
        let value = f64::from(i % 13) - 6.0;
        assert_eq!(new.set(&[force], &[value]), Status::Ok);
        old.0.set_real(&[force], &[value]).unwrap();
        let time = old.0.time();
        let (status, event, early, last) = new.step(time, 0.013);
        old.step(0.013).unwrap();
        assert_eq!((status, event, early, last.to_bits()), (Status::Ok, false, false, old.0.time().to_bits()));
        let mut values = vec![0.0; references.len()];
        assert_eq!(new.get(&references, &mut values), Status::Ok);
        assert_eq!(values.iter().map(|value| value.to_bits()).collect::<Vec<_>>(), old.bits(), "at {last} s");
    }
}

/// Reference: the same steps without Event Mode, in which the steps themselves handle the events. The parabola is
/// integrated exactly, so dividing steps changes only rounding errors, which are far below 1e-12.
#[test]
fn a_step_returns_early_at_an_event_that_the_importer_handles() {
    let states = ["height", "velocity", "last_bounce"].map(reference::<EqualSteps>);
    let (inside, outside) =
        (Instance::<Ball>::co_simulation(false).initialized(), Instance::<Ball>::co_simulation(true).initialized());
    // Initialization ends in Event Mode.
    assert_eq!(outside.update(), (false, None));
    // SAFETY: a live component.
    let to_step_mode = || assert_eq!(unsafe { fmi3::enter_step_mode::<Ball>(outside.component) }, Status::Ok);
    to_step_mode();
    let (mut time, mut events) = (0.0, 0);
    for i in 1..=50_u32 {
        let end = f64::from(i) * 0.04;
        assert_eq!(inside.step(f64::from(i - 1) * 0.04, end - f64::from(i - 1) * 0.04).0, Status::Ok);
        while end - time > 1e-12 {
            let (status, event, early, last) = outside.step(time, end - time);
            assert_eq!((status, event), (Status::Ok, early));
            time = last;
            if event {
                events += 1;
                // SAFETY: a live component.
                assert_eq!(unsafe { fmi3::enter_event_mode::<Ball>(outside.component) }, Status::Ok);
                assert_eq!(outside.update(), (true, None));
                to_step_mode();
            }
        }
        let (mut one, mut other) = ([0.0; 3], [0.0; 3]);
        assert_eq!((inside.get(&states, &mut one), outside.get(&states, &mut other)), (Status::Ok, Status::Ok));
        for (one, other) in one.iter().zip(other) {
            assert!((one - other).abs() < 1e-12, "{one} {other} at {end} s");
        }
    }
    assert_eq!(events, ball(2.0).0 as u32);
}

/// Each time event is handled once in Event Mode, even if the state was saved between the end of a step and the event,
/// by an instance with or without Event Mode. Reference: the number of periods.
fn time_events_are_handled_once<E: Export>() {
    let edges = reference::<Pulses>("edges");
    let count = |instance: &Instance<E>| {
        let mut value = [0];
        // SAFETY: arrays of these lengths.
        assert_eq!(
            unsafe {
                fmi3::get_number::<E, i32>(instance.component, Function::GetInteger, &edges, 1, value.as_mut_ptr(), 1)
            },
            Status::Ok
        );
        value[0]
    };
    // SAFETY: live components, and arrays of their lengths.
    let copied = |from: &Instance<E>, to: &Instance<E>| unsafe {
        let (mut state, mut size) = (null_mut(), 0);
        assert_eq!(fmi3::get_fmu_state::<E>(from.component, &mut state), Status::Ok);
        assert_eq!(fmi3::serialized_fmu_state_size::<E>(from.component, state, &mut size), Status::Ok);
        let mut bytes = vec![0; size];
        assert_eq!(fmi3::serialize_fmu_state::<E>(from.component, state, bytes.as_mut_ptr(), size), Status::Ok);
        let mut other = null_mut();
        assert_eq!(fmi3::deserialize_fmu_state::<E>(to.component, bytes.as_ptr(), size, &mut other), Status::Ok);
        assert_eq!(fmi3::set_fmu_state::<E>(to.component, other), Status::Ok);
    };
    // SAFETY: live components.
    let to_step_mode = |instance: &Instance<E>| unsafe {
        assert_eq!(fmi3::enter_step_mode::<E>(instance.component), Status::Ok);
    };
    let handle = |instance: &Instance<E>| {
        // SAFETY: a live component.
        assert_eq!(unsafe { fmi3::enter_event_mode::<E>(instance.component) }, Status::Ok);
        let update = instance.update();
        to_step_mode(instance);
        update
    };
    let first = Instance::<E>::co_simulation(true).initialized();
    assert_eq!(first.update(), (false, Some(0.1)));
    to_step_mode(&first);
    assert_eq!(first.step(0.0, 0.07), (Status::Ok, false, false, 0.07));
    assert_eq!(first.step(0.07, 0.1), (Status::Ok, true, true, 0.1));
    let second = Instance::<E>::co_simulation(true);
    copied(&first, &second);
    for instance in [&first, &second] {
        assert_eq!((handle(instance), count(instance)), ((false, Some(0.2)), 1));
        assert_eq!(instance.step(0.1, 0.1), (Status::Ok, true, false, 0.2));
        assert_eq!(handle(instance), (false, Some(3.0 * 0.1)));
        assert_eq!(count(instance), 2);
    }
    // An instance that handles events inside its steps has also handled the events at the end of the last step.
    let inside = Instance::<E>::co_simulation(false).initialized();
    assert_eq!(inside.step(0.0, 0.2), (Status::Ok, false, false, 0.2));
    let outside = Instance::<E>::co_simulation(true);
    copied(&inside, &outside);
    assert_eq!(count(&outside), 2);
    let (status, event, _, time) = outside.step(0.2, 0.15);
    assert_eq!((status, event, time), (Status::Ok, true, 3.0 * 0.1));
    assert_eq!(handle(&outside), (false, Some(0.4)));
    assert_eq!(count(&outside), 3);
}

#[test]
fn declared_time_events_are_handled_once() {
    time_events_are_handled_once::<Train>();
    time_events_are_handled_once::<TrainWithoutExchange>();
}

#[test]
fn messages_name_the_types_of_the_version() {
    let instance = Instance::<Carts>::co_simulation(false);
    let layout = &CartPair::description().layout;
    let mut value = [0.0];
    assert_eq!(instance.get(&[layout.first.words as u32], &mut value), Status::Error);
    let error = instance.error();
    assert!(error.contains("must be a variable of type Float64, it is"), "{error}");
}

#[test]
fn the_adjoint_derivative_is_the_transposed_matrix() {
    let instance = Instance::<Carts>::co_simulation(false).initialized();
    let layout = &CartPair::description().layout;
    let of = |range: std::ops::Range<usize>| range.map(|index| index as u32).collect::<Vec<_>>();
    let unknowns = [of(layout.outputs.reals()), of(layout.derivatives.reals()), of(layout.states.reals())].concat();
    // The time is a known variable, too.
    let knowns = [of(layout.inputs.reals()), of(layout.states.reals()), vec![layout.end]].concat();
    let unit = |count: usize, at: usize| (0..count).map(|i| f64::from(u8::from(i == at))).collect::<Vec<_>>();
    let columns: Vec<Vec<f64>> = (0..knowns.len())
        .map(|at| {
            let seed = unit(knowns.len(), at);
            instance.derivative(Function::GetDirectionalDerivative, &unknowns, &knowns, &seed)
        })
        .collect();
    assert!(columns.iter().flatten().any(|value| *value != 0.0));
    for row in 0..unknowns.len() {
        let seed = unit(unknowns.len(), row);
        let adjoint = instance.derivative(Function::GetAdjointDerivative, &unknowns, &knowns, &seed);
        // Sums with only one nonzero term are exact.
        assert_eq!(adjoint, columns.iter().map(|column| column[row]).collect::<Vec<_>>());
    }
}

#[test]
fn arrays_are_read_and_set_as_one_variable() {
    let instance = Instance::<NativeArrays>::co_simulation(false);
    let [matrix, front, values] = ["matrix[1,1]", "corner.front", "values"].map(reference::<Arrays>);
    assert_eq!(instance.set(&[matrix], &[5.0, 6.0, 7.0, 8.0]), Status::Ok);
    assert_eq!(instance.set(&[matrix], &[5.0]), Status::Error);
    assert_eq!(instance.error(), "fmi3SetFloat64: nValues must be 4 for these variables, got 1");
    let mut found = [0.0; 6];
    assert_eq!(instance.get(&[front, matrix, values], &mut found), Status::Ok);
    assert_eq!(found, [10.0, 5.0, 6.0, 7.0, 8.0, 5.0]);
    let xml = &NativeArrays::description().xml;
    assert!(xml.contains("name=\"matrix\"") && xml.contains("start=\"1.0 2.0 3.0 4.0\""), "{xml}");
    assert!(!xml.contains("matrix["), "{xml}");
    // Named elements stay variables, also those that are arrays, and elements that differ in their units.
    for name in ["corner.front", "corner.rear", "carts.l[1]", "carts.r[2]", "mixed[1]"] {
        assert!(xml.contains(&format!("name=\"{name}\"")), "{name}: {xml}");
    }
    let found = Description::of::<<CartPair as Export>::Model>(NativeArrays::FORMAT, std::path::Path::new(""));
    assert!(!found.xml.contains("<Dimension"), "{}", found.xml);
}

#[test]
fn the_time_and_the_event_indicators_are_variables() {
    let instance = Instance::<Ball>::co_simulation(false).initialized();
    assert_eq!(instance.step(0.0, 0.25).0, Status::Ok);
    let layout = &Ball::description().layout;
    let mut values = [0.0; 3];
    let height = reference::<EqualSteps>("height");
    assert_eq!(instance.get(&[layout.end, height, layout.end + 1], &mut values), Status::Ok);
    assert_eq!(values[0], 0.25);
    // The indicator is the height divided by its nominal value, 1 m, shifted by 1e-9 away from zero.
    assert!((values[2] - values[1] - 1e-9).abs() < 1e-9, "{values:?}");
    assert_eq!(instance.get(&[layout.end + 2], &mut values[..1]), Status::Error);
    assert_eq!(instance.set(&[layout.end], &[1.0]), Status::Error);
    // A call that fails writes nothing, even for valid references before the invalid one.
    let mut values = [7.0; 3];
    assert_eq!(instance.get(&[layout.end, height, u32::MAX], &mut values), Status::Error);
    assert_eq!(values, [7.0; 3]);
}

#[test]
fn messages_about_enumerations_name_their_function() {
    let instance = Instance::<Types>::co_simulation(false);
    let listed = reference::<DiscreteTypes>("p.listed");
    // SAFETY: arrays of these lengths.
    let set = |value: i64| unsafe {
        fmi3::set_number::<Types, i64>(instance.component, Function::SetInt64, &listed, 1, &value, 1)
    };
    assert_eq!(set(6), Status::Ok);
    assert_eq!(set(5), Status::Error);
    assert!(instance.error().starts_with("fmi3SetInt64: 'p.listed' must be 0 (neutral) or "), "{}", instance.error());
}

/// Reference: co-simulation in FMI 2.0, which takes the same samples.
#[test]
fn samples_are_time_events() {
    let instance = Instance::<Filter>::model_exchange().initialized();
    let mut old = Fmu::<Sampler>::ready();
    let (input, output) = (reference::<Sampler>("filter_input"), reference::<Sampler>("filter_output"));
    let period = old.get("sample_time");
    for k in 0..20_u32 {
        let time = f64::from(k) * period;
        // SAFETY: a live component.
        unsafe {
            if k > 0 {
                assert_eq!(fmi3::enter_event_mode::<Filter>(instance.component), Status::Ok);
                assert_eq!(fmi3::set_time::<Filter>(instance.component, time), Status::Ok);
            }
            assert_eq!(instance.set(&[input], &[f64::from(k)]), Status::Ok);
            assert_eq!(instance.update(), (false, Some(f64::from(k + 1) * period)));
            assert_eq!(fmi3::enter_continuous_time_mode::<Filter>(instance.component), Status::Ok);
        }
        old.set("filter_input", f64::from(k)).unwrap();
        old.step(period).unwrap();
        let mut value = [0.0];
        assert_eq!(instance.get(&[output], &mut value), Status::Ok);
        assert_eq!(value[0].to_bits(), old.get("filter_output").to_bits());
    }
}

#[test]
fn the_states_of_one_version_are_rejected_by_the_other() {
    let instance = Instance::<Carts>::co_simulation(false).initialized();
    let bytes = Fmu::<CartPair>::ready().bytes();
    let mut state = null_mut();
    // SAFETY: an array of this length.
    let status =
        unsafe { fmi3::deserialize_fmu_state::<Carts>(instance.component, bytes.as_ptr(), bytes.len(), &mut state) };
    assert_eq!(status, Status::Error);
    assert_eq!(
        instance.error(),
        "fmi3DeserializeFMUState: the state was saved by an instance for co-simulation of FMI 2.0, this instance is for \
         co-simulation of FMI 3.0"
    );
}

#[test]
fn missing_capabilities_are_reported() {
    let instance = Instance::<Carts>::co_simulation(false).initialized();
    // SAFETY: a live component.
    unsafe {
        assert_eq!(fmi3::no_variables::<Carts>(instance.component, Function::GetFloat32, null(), 0), Status::Ok);
        assert_eq!(fmi3::no_variables::<Carts>(instance.component, Function::GetFloat32, null(), 1), Status::Error);
        assert_eq!(instance.error(), "fmi3GetFloat32: no variable of this FMU has this type");
        assert_eq!(fmi3::not_provided::<Carts>(instance.component, Function::EnterConfigurationMode), Status::Error);
        assert_eq!(fmi3::set_time::<Carts>(instance.component, 1.0), Status::Error);
        assert_eq!(instance.error(), "fmi3SetTime is not a function of co-simulation");
    }
    let none = Instance::<Carts>::new(|arguments| unsafe {
        fmi3::instantiate_scheduled_execution::<Carts>(arguments, None, None, None)
    });
    assert!(none.component.is_null());
    assert_eq!(none.error(), "fmi3InstantiateScheduledExecution: this FMU does not provide scheduled execution");
    let none = Instance::<Filter>::new(|arguments| unsafe {
        fmi3::instantiate_co_simulation::<Filter>(arguments, 1, 1, null(), 0, None)
    });
    assert!(none.component.is_null());
    assert_eq!(
        none.error(),
        "fmi3InstantiateCoSimulation: eventModeUsed must be false: the FMU has no Event Mode (hasEventMode is false)"
    );
    let ball = Instance::<Ball>::co_simulation(false).initialized();
    // SAFETY: a live component.
    assert_eq!(unsafe { fmi3::enter_event_mode::<Ball>(ball.component) }, Status::Error);
    assert_eq!(ball.error(), "fmi3EnterEventMode: eventModeUsed was false when the instance was made");
    let none = Instance::<Carts>::new(|arguments| unsafe {
        fmi3::instantiate_model_exchange::<Carts>(Arguments { token: c"{other}".as_ptr(), ..arguments })
    });
    assert!(none.error().starts_with("fmi3InstantiateModelExchange: instantiationToken must be {"));
}

#[test]
fn wheels_and_axles_are_terminals() {
    let description = Description::of::<<CartPair as Export>::Model>(Format::FMI3, std::path::Path::new(""));
    let xml = description.terminals(Format::FMI3);
    for text in [
        "<Terminal name=\"l\" matchingRule=\"bus\"",
        "<TerminalMemberVariable variableName=\"cart_force.l\" memberName=\"cart_force\" variableKind=\"signal\"/>",
        "<Icon x1=\"0.0\"",
    ] {
        assert!(xml.contains(text), "{xml}");
    }
    assert_eq!(description.terminals(NativeArrays::FORMAT), xml, "named elements are variables in both formats");
    // Local variables and parameters are not signals and belong to no terminal.
    assert!(!xml.contains("cart_velocity") && !xml.contains("spring.stiffness"), "{xml}");
    // The packer gets the same text from the library.
    let asked = abi::model_description::<Carts>(3, 3 | 8);
    // SAFETY: a string that lives until the next call.
    assert_eq!(unsafe { CStr::from_ptr(asked) }.to_str(), Ok(xml.as_str()));
}
