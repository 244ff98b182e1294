//! Clocks of continuous-time models. Reference: FMI 3.0.2, sections 2.2.8 (clocks), 2.3.5 (Event Mode), 3.2 (model exchange)
//! and 4.2 (co-simulation); the closed form of a sampled controller, x_(k+1) = x_k + h (r - x_k).

use std::path::PathBuf;

use fmu::prelude::*;
use fmu::simulation::ContinuousSimulation;
use fmu::testing::abi::Export;
use fmu::testing::calls::{Function, Interface, Interfaces, Protocol};
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::{CallError, Instance, PausingStep, Qualifier};
use fmu::testing::number::Number;

use crate::allocations::allocations;
use crate::models::{Fmu, error_of, exported, reference};

#[derive(Inputs)]
struct U<T> {
    /// Reference (m)
    #[var(clock = "control", start = 1.0)]
    target: T,
    /// Time until the alarm, if above 0 (s)
    delay: T,
}

#[derive(State)]
struct X<T> {
    /// Position (m)
    x: T,
}

#[derive(Outputs)]
struct Y<T> {
    /// Speed, as the controller has set it (m/s)
    #[var(clock = "control")]
    speed: T,
    /// Twice the position (m)
    double: T,
    /// Number of alarms
    alarms: i32,
    /// Number of times that the position rose above 0.5 m
    crossings: i32,
}

#[derive(DiscreteState, Clone, Default)]
struct Held {
    /// Speed (m/s)
    #[var("held_speed", clock = "control")]
    speed: f64,
    alarms: i32,
    crossings: i32,
}

macro_rules! sampled {
    ($(#[doc = $doc:literal] $name:ident, $clock:ident, $solver:expr, { $($fields:tt)* };)*) => {$(
        #[derive(Parameters)]
        struct $name { $($fields)* }

        #[doc = $doc]
        #[fmu::model(stop_time = 1.0, step_size = 0.1, solver = $solver)]
        impl Continuous for $name {
            type State<T: Scalar> = X<T>;
            type Inputs<T: Scalar> = U<T>;
            type Outputs<T: Scalar> = Y<T>;
            type DiscreteState = Held;
            type Crossings = [f64; 1];

            fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
                X { x: T::from(at.discrete.speed) }
            }

            fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
                let Held { speed, alarms, crossings } = *at.discrete;
                Y { speed: speed.into(), double: at.state.x * 2.0, alarms, crossings }
            }

            fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
                [at.state.x - 0.5]
            }

            fn on_event(&self, event: Event<Self>) {
                event.discrete.crossings += i32::from(event.rose(0));
            }

            /// Sampled controller
            #[clock(interval = 1 / 10)]
            fn control(&self, mut tick: Tick<Self>) {
                tick.state.speed = tick.inputs.target - tick.continuous.x;
                let delay = tick.inputs.delay;
                if delay > 0.0 {
                    tick.start($clock::Alarm, delay);
                }
            }

            /// Moves the position to 2 m
            #[clock(triggered)]
            fn kick(&self, tick: Tick<Self>) {
                tick.continuous.x = 2.0;
            }

            /// Alarm
            #[clock(countdown)]
            fn alarm(&self, tick: Tick<Self>) {
                tick.state.alarms += 1;
            }
        }
    )*};
}

sampled! {
    /// Position control by equal steps
    Sampled, SampledClock, RungeKutta, { #[var(MAX_STEP, start = 0.03)] max_step: f64 };
    /// Position control with error control
    Controlled, ControlledClock, DormandPrince { tolerance: 1e-9 }, {};
    /// Position control by implicit steps
    Implicit, ImplicitClock, Rosenbrock { tolerance: 1e-9 }, {};
}

exported! {
    Sampled3: Sampled, Format::FMI3;
    Controlled3: Controlled, Format::FMI3;
    Implicit3: Implicit, Format::FMI3;
}

type Instance3 = Fmu<Sampled3>;

/// The position in m at the time of tick `k`, for the reference 1 m.
fn position(k: i32) -> f64 {
    1.0 - 0.9_f64.powi(k)
}

impl<E: Export> Fmu<E> {
    fn of_three(protocol: Protocol, has_event_mode: bool, values: &[(&str, f64)]) -> Self {
        let instance = Instance::new(protocol, E::description(), PathBuf::new());
        let mut fmu = Self(if has_event_mode { instance.with_event_mode() } else { instance });
        fmu.0.set_experiment(Function::EnterInitializationMode, 0.0, None, None).unwrap();
        fmu.0.enter_initialization().unwrap();
        for (name, value) in values {
            fmu.set(name, *value).unwrap();
        }
        fmu.0.exit_initialization().unwrap();
        fmu
    }

    fn tick(&mut self, clock: &str) -> Result<(), CallError> {
        self.0.set_clock(&[reference::<E>(clock)], std::iter::once(true))
    }

    fn whole(&mut self, name: &str) -> i32 {
        i32::of(self.0.get_number(Function::GetInteger, i32::SIZE, reference::<E>(name)).unwrap())
    }

    fn state(&mut self) -> f64 {
        let mut x = [0.0];
        self.0.continuous_states(&mut x).unwrap();
        x[0]
    }
}

fn ticks_inside<E: Export>() {
    for step in [0.1, 0.05, 0.025, 0.2, 0.5] {
        let mut fmu = Fmu::<E>::of_three(Protocol::CS3, false, &[("delay", 0.04)]);
        for _ in 0..(1.0 / step + 0.5) as i32 {
            fmu.step(step).unwrap();
            let (time, k) = (fmu.0.time(), (fmu.0.time() * 10.0 - 1e-6).floor() as i32);
            let expected = position(k) + 0.9_f64.powi(k) * (time - 0.1 * f64::from(k));
            assert!((fmu.get("x") - expected).abs() < 1e-12, "{} instead of {expected} at {time} s", fmu.get("x"));
            assert_eq!(fmu.get("double"), 2.0 * fmu.get("x"));
            // The alarm of tick k is due 0.04 s after it.
            assert_eq!(fmu.whole("alarms"), ((time - 0.04) * 10.0 - 1e-6).floor() as i32 + 1, "at {time} s");
            // 0.6 + (0.5 - (1 - 0.9^6)) / 0.9^6 = 0.6591.
            assert_eq!(fmu.whole("crossings"), i32::from(time > 0.659), "at {time} s");
        }
    }
}

#[test]
fn without_event_mode_clocks_tick_inside_the_steps() {
    ticks_inside::<Sampled3>();
    ticks_inside::<Controlled3>();
    ticks_inside::<Implicit3>();
}

/// FMI 2.0 and simulations in Rust have no clocks: the same bits as FMI 3.0 without Event Mode.
#[test]
fn all_runs_without_event_mode_have_the_same_bits() {
    let mut two = Fmu::<Sampled>::starting(0.0, &[]);
    let mut three = Instance3::of_three(Protocol::CS3, false, &[]);
    let mut simulation = ContinuousSimulation::new(Sampled::default()).unwrap();
    let mut paused = PausingStep::default();
    let mut pausing = Instance3::of_three(Protocol::CS3, false, &[]);
    for _ in 0..7 {
        let time = pausing.0.time();
        two.step(0.17).unwrap();
        three.step(0.17).unwrap();
        simulation.step(&U { target: 1.0, delay: 0.0 }, 0.17).unwrap();
        pausing.0.begin_step(time, 0.17, false, &mut paused).unwrap();
        let mut updates = Vec::new();
        loop {
            pausing.0.advance_to_update(&mut paused).unwrap();
            updates.push(pausing.0.time());
            pausing.0.leave_update();
            if paused.is_complete() {
                break;
            }
        }
        let x = three.get("x").to_bits();
        assert_eq!([two.get("x").to_bits(), simulation.state().x.to_bits(), pausing.get("x").to_bits()], [x; 3]);
        // Every tick inside the step ends an integrator step.
        for tick in
            (0..20).map(|k| f64::from(k) / 10.0).filter(|tick| *tick > time + 1e-9 && *tick < time + 0.17 - 1e-9)
        {
            assert!(updates.contains(&tick), "{tick} is not in {updates:?}");
        }
    }
}

/// A master that activates the clocks, in co-simulation and in model exchange. The derivative is constant between ticks,
/// so one Euler step is exact.
#[test]
fn an_importer_with_clocks_gets_the_closed_form() {
    for protocol in [Protocol::CS3, Protocol::ME3] {
        let is_exchange = protocol.interface == Interface::ModelExchange;
        let mut fmu = Instance3::of_three(protocol, !is_exchange, &[]);
        let control = reference::<Sampled3>("control");
        assert_eq!(fmu.0.interval(control).unwrap().0, 0.1);
        for k in 0..10 {
            let time = f64::from(k) / 10.0;
            fmu.tick("control").unwrap();
            let expected = 0.9_f64.powi(k);
            // Outputs are those after the tick; states change at the end of the event.
            for target in [7.0, 1.0] {
                fmu.set("target", target).unwrap();
                let now = fmu.get("speed");
                assert!((now - (target - 1.0 + expected)).abs() < 1e-12, "{now} at {time} s");
                assert_eq!(fmu.get("held_speed"), now);
            }
            let before = if k == 0 { 0.0 } else { 0.9_f64.powi(k - 1) };
            assert!((fmu.get("previous.held_speed") - before).abs() < 1e-12);
            let bytes = fmu.bytes();
            for _ in 0..2 {
                let update = fmu.0.new_discrete_states().unwrap();
                assert_eq!((update.states_changed, update.next_event_time), (false, None), "ticks are not announced");
                fmu.0.restore(&fmu.0.deserialize(&bytes).unwrap()).unwrap();
                assert!((fmu.get("speed") - expected).abs() < 1e-12, "the clock is still active");
            }
            fmu.0.new_discrete_states().unwrap();
            let message = error_of(fmu.tick("control"));
            assert!(message.contains("the clock 'control' ticks next at"), "{message}");
            let end = f64::from(k + 1) / 10.0;
            if is_exchange {
                fmu.0.enter_continuous_time_mode().unwrap();
                let mut slope = [0.0];
                fmu.0.state_derivatives(&mut slope).unwrap();
                let x = fmu.state() + 0.1 * slope[0];
                fmu.0.set_time(end).unwrap();
                fmu.0.set_continuous_states(&[x]).unwrap();
                fmu.0.check_integrator_step().unwrap();
            } else {
                fmu.0.enter_step_mode().unwrap();
                let message = error_of(fmu.step(0.1001));
                assert!(message.contains("the clock 'control' ticks at"), "{message}");
                fmu.step(end - fmu.0.time()).unwrap();
            }
            let message = error_of(fmu.try_get("speed"));
            assert!(message.contains("only in Event Mode while its clock 'control' is active"), "{message}");
            fmu.0.enter_event_mode().unwrap();
            assert!((fmu.get("x") - position(k + 1)).abs() < 1e-12);
        }
    }
}

#[test]
fn a_tick_can_change_the_continuous_state() {
    for protocol in [Protocol::CS3, Protocol::ME3] {
        let is_exchange = protocol.interface == Interface::ModelExchange;
        let mut fmu = Instance3::of_three(protocol, !is_exchange, &[]);
        fmu.tick("kick").unwrap();
        assert_eq!((fmu.get("double"), fmu.whole("crossings")), (4.0, 0));
        // A clock that is deactivated again has no effect.
        fmu.0.set_clock(&[reference::<Sampled3>("kick")], std::iter::once(false)).unwrap();
        assert_eq!(fmu.get("double"), 0.0);
        fmu.tick("kick").unwrap();
        fmu.tick("control").unwrap();
        // The methods run in their order: `control` reads the state from before `kick`.
        assert_eq!(fmu.get("speed"), 1.0);
        let update = fmu.0.new_discrete_states().unwrap();
        assert!(update.states_changed);
        assert_eq!(fmu.get("x"), 2.0);
        // The position rose above 0.5 m at the tick.
        assert_eq!(fmu.whole("crossings"), 1);
        assert!(!fmu.0.get_clock(reference::<Sampled3>("kick")).unwrap());
        assert!(!fmu.0.new_discrete_states().unwrap().states_changed);
    }
}

#[test]
fn countdown_clocks_are_known_after_the_tick_that_starts_them() {
    let mut fmu = Instance3::of_three(Protocol::ME3, false, &[("delay", 0.04)]);
    let alarm = reference::<Sampled3>("alarm");
    assert_eq!(fmu.0.interval(alarm).unwrap(), (0.0, Qualifier::NotYetKnown));
    fmu.tick("control").unwrap();
    fmu.0.new_discrete_states().unwrap();
    assert_eq!(fmu.0.interval(alarm).unwrap(), (0.04, Qualifier::Changed));
    fmu.0.enter_continuous_time_mode().unwrap();
    fmu.0.set_time(0.05).unwrap();
    let message = error_of(fmu.0.check_integrator_step());
    let expected = "fmi3CompletedIntegratorStep: the clock 'alarm' ticks at 0.04 s: end the step there, and activate the \
                    clock in Event Mode";
    assert_eq!(message, expected);
    fmu.0.set_time(0.04).unwrap();
    fmu.0.check_integrator_step().unwrap();
    fmu.0.enter_event_mode().unwrap();
    fmu.tick("alarm").unwrap();
    assert_eq!(fmu.whole("alarms"), 1);
    fmu.0.new_discrete_states().unwrap();
    assert_eq!(fmu.whole("alarms"), 1);
}

/// Reference: the run without the failed step.
#[test]
fn a_failed_step_restores_the_state_and_the_clocks() {
    let mut fmu = Instance3::of_three(Protocol::CS3, false, &[("delay", 0.04)]);
    fmu.step(0.1).unwrap();
    let (snapshot, bytes) = (fmu.0.snapshot().unwrap(), fmu.bytes());
    let x = fmu.get("x");
    // At the second tick of the step, the speed is infinite.
    fmu.set("target", f64::MAX).unwrap();
    let message = error_of(fmu.step(0.5));
    assert!(message.contains("became") && message.contains("the state at 0.1 s was restored"), "{message}");
    assert_eq!((fmu.get("x"), fmu.whole("alarms")), (x, 1));
    fmu.0.restore(&snapshot).unwrap();
    assert_eq!(fmu.bytes(), bytes);
    let mut other = Instance3::of_three(Protocol::CS3, false, &[]);
    other.0.restore(&other.0.deserialize(&bytes).unwrap()).unwrap();
    for fmu in [&mut fmu, &mut other] {
        fmu.step(0.35).unwrap();
    }
    assert_eq!(fmu.bytes(), other.bytes());
    assert_eq!(fmu.whole("alarms"), 5);
}

#[test]
fn ticks_do_not_allocate() {
    let mut inside = Instance3::of_three(Protocol::CS3, false, &[("delay", 0.04)]);
    assert_eq!(allocations(|| (0..20).for_each(|k| inside.0.do_step(0.05 * f64::from(k), 0.05).unwrap())), 0);
    let mut fmu = Instance3::of_three(Protocol::CS3, true, &[]);
    let [control, speed] = ["control", "speed"].map(reference::<Sampled3>);
    let count = allocations(|| {
        fmu.0.set_clock(&[control], std::iter::once(true)).unwrap();
        fmu.0.get_real(&[speed], &mut [0.0]).unwrap();
    });
    assert_eq!(count, 0);
}

#[test]
fn clocks_of_continuous_time_models_are_described() {
    let xml = Description::of::<<Sampled as Export>::Model>(Format::FMI3, "".as_ref()).xml;
    let of = reference::<Sampled3>;
    let [control, target, speed, previous, end] =
        [of("control"), of("target"), of("speed"), of("previous.held_speed"), Sampled3::description().layout.end];
    let inputs = format!("{target} {} {}", of("delay"), of("x"));
    for expected in [
        r#"needsCompletedIntegratorStep="true"/>"#.to_owned(),
        r#"hasEventMode="true""#.to_owned(),
        format!(
            r#"<Clock name="control" valueReference="{control}" description="Sampled controller" causality="input""#
        ),
        format!(
            r#"name="target" valueReference="{target}" description="Reference" causality="input" variability="discrete""#
        ),
        format!(
            r#"name="speed" valueReference="{speed}" description="Speed, as the controller has set it" causality="output" variability="discrete" initial="calculated" unit="m/s" clocks="{control}"/>"#
        ),
        format!(r#"<Output valueReference="{speed}" dependencies="{end} {inputs} {previous} {control}"/>"#),
        format!(r#"<ClockedState valueReference="{}""#, of("held_speed")),
        r#"reinit="true""#.to_owned(),
    ] {
        assert!(xml.contains(&expected), "{expected}\n{xml}");
    }
    // The first tick initializes a clocked output.
    assert!(!xml.contains(&format!(r#"<InitialUnknown valueReference="{speed}""#)), "{xml}");
    assert!(!xml.contains("ScheduledExecution"), "{xml}");
    let xml = Description::of::<<Sampled as Export>::Model>(Format::FMI2, "".as_ref()).xml;
    assert!(xml.contains("<CoSimulation ") && !xml.contains("<ModelExchange "), "{xml}");
    let scheduled = Interfaces { scheduled_execution: true, ..Interfaces::NONE };
    let format = Format { interfaces: scheduled, ..Format::FMI3 };
    let problem = Description::try_of::<<Sampled as Export>::Model>(format, "".as_ref()).unwrap_err();
    assert!(problem.contains("a continuous-time model has no scheduled execution"), "{problem}");
}
