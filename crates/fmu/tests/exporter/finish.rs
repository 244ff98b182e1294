//! Models that end the simulation. References: a fall from 5 m at 10 m/s^2 takes 1 s; FMI 2.0.4, section 4.2.2 (fmi2Discard,
//! fmi2Terminated, fmi2LastSuccessfulTime); FMI 3.0.2, sections 2.3.5 and 4.2.1 (terminateSimulation, earlyReturn).
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use std::ffi::c_void;
use std::path::PathBuf;
use std::ptr::null;

use fmu::prelude::*;
use fmu::simulation::ContinuousSimulation;
use fmu::testing::abi::fmi2::{self, EventInfo};
use fmu::testing::abi::fmi3::{self, Boolean, IntermediateUpdate};
use fmu::testing::abi::{Export, Status};
use fmu::testing::calls::{Function, Protocol};
use fmu::testing::description::Format;
use fmu::testing::instance::Instance as SafeInstance;

use crate::c_interface::C;
use crate::fmi3::Instance;
use crate::models::{exported, reference};

#[derive(State)]
struct X<T> {
    /// Height (m)
    #[var(start = 5.0)]
    height: T,
    /// Velocity (m/s)
    velocity: T,
}

#[derive(DiscreteState, Clone, Default)]
struct Contact {
    has_landed: bool,
}

macro_rules! falls {
    ($($name:ident $solver:expr;)*) => {$(
        #[derive(Parameters)]
        struct $name;

        /// Ends when the body lands
        #[fmu::model(stop_time = 3.0, step_size = 0.75, solver = $solver)]
        impl Continuous for $name {
            type State<T: Scalar> = X<T>;
            type DiscreteState = Contact;
            type Crossings = [f64; 1];
            fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
                X { height: at.state.velocity, velocity: T::from(-10.0) }
            }
            fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
                [at.state.height]
            }
            fn on_event(&self, event: Event<Self>) {
                event.discrete.has_landed |= event.fell(0);
            }
            fn is_finished(&self, contact: &Contact) -> bool {
                contact.has_landed
            }
        }
    )*};
}
falls! {
    EqualSteps RungeKutta;
    ControlledSteps DormandPrince { tolerance: 1e-9 };
}

#[derive(Parameters)]
struct Alarm;

#[derive(DiscreteState, Clone, Default)]
struct Alarms {
    count: i32,
}

#[derive(Outputs)]
struct Y {
    /// Events so far
    count: i32,
}

/// Two time events at 0 s, with the first of which the simulation ends
#[fmu::model(stop_time = 3.0, step_size = 0.75)]
impl Continuous for Alarm {
    type Outputs<T: Scalar> = Y;
    type DiscreteState = Alarms;
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y {
        Y { count: at.discrete.count }
    }
    fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
        (at.discrete.count < 2).then_some(at.time)
    }
    fn on_event(&self, event: Event<Self>) {
        event.discrete.count += 1;
    }
    fn is_finished(&self, alarms: &Alarms) -> bool {
        alarms.count > 0
    }
}

exported! {
    EqualSteps3: EqualSteps, Format::FMI3;
    ControlledSteps3: ControlledSteps, Format::FMI3;
    Alarm3: Alarm, Format::FMI3;
}

/// Times in s are accurate to rounding errors: both solvers are exact for a parabola.
fn is_landing(time: f64) -> bool {
    (time - 1.0).abs() < 1e-12
}

#[test]
fn a_simulation_ends_at_the_event() {
    fn ends<M: Continuous<State<f64> = X<f64>, Inputs<f64> = ()>>(model: M) {
        let mut run = ContinuousSimulation::new(model).unwrap();
        run.step(&(), 0.75).unwrap();
        assert!(!run.is_finished());
        for _ in 0..2 {
            run.step(&(), 0.75).unwrap();
            assert!(run.is_finished() && is_landing(run.time()) && run.state().height.abs() < 1e-12);
        }
    }
    ends(EqualSteps);
    ends(ControlledSteps);
}

#[test]
fn a_step_of_fmi_2_is_discarded() {
    fn ends<E: Export>() {
        let fmu = C::<E>::ready();
        // SAFETY: values to write to.
        let status = || unsafe {
            let (mut terminated, mut last) = (-1, -1.0);
            assert_eq!(fmi2::get_boolean_status::<E>(fmu.component, 3, &mut terminated), Status::Ok);
            assert_eq!(fmi2::get_real_status::<E>(fmu.component, 2, &mut last), Status::Ok);
            (terminated, last)
        };
        assert_eq!((fmu.step(0.0, 0.75), status()), (Status::Ok, (0, 0.75)));
        let saved = fmu.save();
        assert_eq!(fmu.step(0.75, 0.75), Status::Discard);
        let (terminated, last) = status();
        assert!(terminated == 1 && is_landing(last) && fmu.get("height").abs() < 1e-12);
        // The end is part of the state: an earlier state has not ended.
        // SAFETY: a state of the component.
        assert_eq!(unsafe { fmi2::set_fmu_state::<E>(fmu.component, saved) }, Status::Ok);
        assert_eq!(status(), (0, 0.75));
        assert_eq!((fmu.step(0.75, 0.2), status().0), (Status::Ok, 0));
        assert_eq!(fmu.step(0.95, 0.2), Status::Discard);
        // SAFETY: a live component.
        assert_eq!(unsafe { fmi2::terminate::<E>(fmu.component) }, Status::Ok);
    }
    ends::<EqualSteps>();
    ends::<ControlledSteps>();
}

/// Result of fmi3DoStep: event, terminate, early return, time.
fn step<E: Export>(instance: &Instance<E>, time: f64, step: f64) -> ([Boolean; 3], f64) {
    let (mut flags, mut last) = ([9; 3], f64::NAN);
    let [event, terminate, early] = &mut flags;
    // SAFETY: values to write to.
    let status = unsafe { fmi3::do_step::<E>(instance.component, time, step, 1, event, terminate, early, &mut last) };
    assert_eq!(status, Status::Ok, "{:?}", instance.messages);
    (flags, last)
}

/// fmi3UpdateDiscreteStates in Event Mode. Returns terminateSimulation.
fn update<E: Export>(instance: &Instance<E>) -> Boolean {
    let (mut flags, mut next) = ([9; 5], 0.0);
    let [needed, terminate, nominals, states, defined] = &mut flags;
    let component = instance.component;
    // SAFETY: values to write to.
    let status = unsafe {
        fmi3::update_discrete_states::<E>(component, needed, terminate, nominals, states, defined, &mut next)
    };
    assert_eq!(status, Status::Ok, "{:?}", instance.messages);
    flags[1]
}

unsafe extern "C" fn ignore(
    _: *mut c_void,
    _: f64,
    _: Boolean,
    _: Boolean,
    _: Boolean,
    _: Boolean,
    _: *mut Boolean,
    _: *mut f64,
) {
}

/// An early return must be allowed, the end of the simulation need not. With a callback, the result is the same.
#[test]
fn a_step_of_fmi_3_ends_at_the_event() {
    fn ends<E: Export>() {
        for early in [0, 1] {
            for callback in [None, Some(ignore as IntermediateUpdate)] {
                // SAFETY: strings that end with a zero.
                let instance = Instance::<E>::new(|arguments| unsafe {
                    fmi3::instantiate_co_simulation::<E>(arguments, 0, early, null(), 0, callback)
                });
                let instance = instance.initialized();
                assert_eq!(step(&instance, 0.0, 0.75), ([0, 0, 0], 0.75));
                let (flags, last) = step(&instance, 0.75, 0.75);
                assert!(is_landing(last) && flags == [0, 1, early], "{flags:?} at {last} s");
                let mut height = [f64::NAN];
                assert_eq!(instance.get(&[reference::<E>("height")], &mut height), Status::Ok);
                assert!(height[0].abs() < 1e-12);
                // Further steps, and those of an instance with this state, do not go on.
                let copy = instance.copied();
                assert_eq!(step(&instance, last, 0.75), ([0, 1, early], last));
                // Made without early return.
                assert_eq!(step(&copy, last, 0.75), ([0, 1, 0], last));
            }
        }
    }
    ends::<EqualSteps3>();
    ends::<ControlledSteps3>();
}

/// In Event Mode, the update handles the event, so it also ends the simulation.
#[test]
fn an_importer_that_handles_events_learns_it_there() {
    fn ends<E: Export>() {
        let instance = Instance::<E>::co_simulation(true).initialized();
        let enter = |mode: unsafe fn(_) -> Status| {
            // SAFETY: a live component.
            assert_eq!(unsafe { mode(instance.component) }, Status::Ok);
        };
        assert_eq!(update(&instance), 0);
        enter(fmi3::enter_step_mode::<E>);
        let (flags, last) = step(&instance, 0.0, 3.0);
        assert!(is_landing(last) && flags == [1, 0, 1], "{flags:?} at {last} s");
        enter(fmi3::enter_event_mode::<E>);
        assert_eq!(update(&instance), 1);
        // An importer that goes on does not get far.
        enter(fmi3::enter_step_mode::<E>);
        assert_eq!(step(&instance, last, 1.0), ([0, 1, 1], last));
    }
    ends::<EqualSteps3>();
    ends::<ControlledSteps3>();
}

/// All events of a time happen before the simulation ends, in every interface.
#[test]
fn the_end_may_be_at_the_start() {
    for protocol in [Protocol::ME2, Protocol::ME3, Protocol::CS2, Protocol::CS3] {
        let mut instance =
            SafeInstance::<<Alarm as Export>::Model>::new(protocol, Alarm::description(), PathBuf::new());
        instance.set_experiment(Function::SetupExperiment, 0.0, None, None).unwrap();
        instance.enter_initialization().unwrap();
        instance.exit_initialization().unwrap();
        if matches!(protocol, Protocol::ME2 | Protocol::ME3) {
            instance.new_discrete_states().unwrap();
        } else {
            instance.do_step(0.0, 0.75).unwrap();
        }
        assert!(instance.is_finished());
        let count = instance.get_integer(reference::<Alarm>("count")).unwrap();
        assert_eq!((instance.time(), count), (0.0, 2), "{protocol:?}");
    }
    let instance = Instance::<Alarm3>::model_exchange().initialized();
    assert_eq!(update(&instance), 1);
    let fmu = C::<Alarm>::exchange();
    let mut info = EventInfo::default();
    // SAFETY: a value to write to.
    assert_eq!(unsafe { fmi2::new_discrete_states::<Alarm>(fmu.component, &mut info) }, Status::Ok);
    assert_eq!((info.terminate_simulation, info.next_event_time_defined), (1, 0));
}
