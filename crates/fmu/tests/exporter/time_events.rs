//! Time events at or before the present time, in every interface. References: the times of the events in closed form.

use std::path::PathBuf;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::{Interface, Mode, Protocol};
use fmu::testing::instance::{CallError, Instance};

use crate::models::{error_of, reference};

#[derive(Outputs)]
struct Counted {
    /// Events so far
    count: i32,
}

#[derive(DiscreteState, Clone, Default)]
struct Counter {
    count: i32,
    other: i32,
    last: f64,
}

macro_rules! counting {
    ($(#[doc = $doc:literal] $name:ident [$($variability:ident)?] |$p:ident, $at:ident| $next:expr, |$event:ident| $on_event:expr;)*) => {$(
        #[derive(Parameters)]
        struct $name {
            /// Period (s)
            #[var(start = 60.0 $(, $variability)?)]
            period: f64,
        }

        #[doc = $doc]
        #[fmu::model(stop_time = 600.0, step_size = 1.0)]
        impl Continuous for $name {
            type Outputs<T: Scalar> = Counted;
            type DiscreteState = Counter;
            fn initial_discrete_state(&self, at: At<f64, Self>) -> Counter {
                Counter { last: at.time, ..Counter::default() }
            }
            fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Counted {
                Counted { count: at.discrete.count }
            }
            fn next_time_event(&self, $at: At<f64, Self>) -> Option<f64> {
                let $p = self;
                $next
            }
            fn on_event(&self, $event: Event<Self>) {
                assert!($event.is_timed);
                $on_event
            }
        }
    )*};
}

counting! {
    /// Counts from time 0
    Absolute [] |p, at| Some(f64::from(at.discrete.count + 1) * p.period), |event| event.discrete.count += 1;
    /// Counts from the last event
    Relative [tunable] |p, at| Some((at.discrete.last + p.period).max(at.time)), |event| {
        event.discrete.count += 1;
        event.discrete.last = event.time;
    };
    /// A tunable period, counted from time 0
    Shortened [tunable] |p, at| Some(f64::from(at.discrete.count + 1) * p.period), |event| event.discrete.count += 1;
    /// Two timers, whose times coincide at every third event of the first one
    Timers [] |p, at| {
        let times = [f64::from(at.discrete.count + 1) * p.period, f64::from(at.discrete.other + 1) * 3.0 * p.period];
        Some(times[0].min(times[1]))
    }, |event| {
        // Each event belongs to one timer.
        if f64::from(event.discrete.other + 1) * 3.0 < f64::from(event.discrete.count + 1) {
            event.discrete.other += 1;
        } else {
            event.discrete.count += 1;
        }
    };
    /// An event that stays due
    Stuck [] |p, _at| Some(p.period), |event| event.discrete.count += 1;
    /// No number
    NotANumber [] |_p, _at| Some(f64::NAN), |event| event.discrete.count += 1;
}

/// All interfaces. The flag is true if the importer handles the events. Co-simulation in FMI 3.0 is tested with and
/// without Event Mode.
const INTERFACES: [(Protocol, bool); 5] = [
    (Protocol::CS2, false),
    (Protocol::CS3, false),
    (Protocol::CS3, true),
    (Protocol::ME2, true),
    (Protocol::ME3, true),
];

/// An instance that is used through one of the interfaces.
struct Run<E: Export> {
    instance: Instance<E::Model>,
    protocol: Protocol,
    has_events: bool,
    next_event: Option<f64>,
}

impl<E: Export> Run<E> {
    fn starting(protocol: Protocol, has_events: bool, start: f64) -> Result<Self, CallError> {
        let mut instance = Instance::new(protocol, E::description(), PathBuf::new());
        if has_events {
            instance = instance.with_event_mode();
        }
        instance.set_experiment(fmu::testing::calls::Function::SetupExperiment, start, None, None)?;
        instance.enter_initialization()?;
        instance.exit_initialization()?;
        let mut run = Self { instance, protocol, has_events, next_event: None };
        if has_events {
            run.update()?;
        }
        Ok(run)
    }

    fn is_exchange(&self) -> bool {
        self.protocol.interface == Interface::ModelExchange
    }

    /// Handles the events at the present time.
    fn update(&mut self) -> Result<(), CallError> {
        self.next_event = self.instance.new_discrete_states()?.next_event_time;
        if self.is_exchange() { self.instance.enter_continuous_time_mode() } else { self.instance.enter_step_mode() }
    }

    /// Advances to `end` in steps of at most 1 s.
    fn run(&mut self, end: f64) -> Result<(), CallError> {
        while self.instance.time() < end {
            let time = self.instance.time();
            if self.is_exchange() {
                let next = self.next_event.unwrap_or(end).min(end).min(time + 1.0);
                self.instance.set_time(next)?;
                if self.next_event == Some(next) {
                    self.instance.enter_event_mode()?;
                    self.update()?;
                }
            } else if !self.has_events {
                self.instance.do_step(time, 1.0_f64.min(end - time))?;
            } else if self.instance.do_step_to_event(time, 1.0_f64.min(end - time))? {
                self.instance.enter_event_mode()?;
                self.update()?;
            }
        }
        Ok(())
    }

    fn count(&mut self) -> i32 {
        self.instance.get_integer(reference::<E>("count")).unwrap()
    }
}

#[test]
fn an_event_that_is_due_at_the_start_happens_there() {
    for (protocol, has_events) in INTERFACES {
        let mut run = Run::<Absolute>::starting(protocol, has_events, 60.0).unwrap();
        assert_eq!(run.count(), 1, "{protocol:?}");
        for (end, count) in [(119.0, 1), (120.0, 2), (179.5, 2), (600.0, 10)] {
            run.run(end).unwrap();
            assert_eq!(run.count(), count, "{protocol:?}, {end} s");
        }
        // The run starts before the first event of the model.
        let mut run = Run::<Absolute>::starting(protocol, has_events, -30.0).unwrap();
        assert_eq!(run.count(), 0);
        run.run(60.0).unwrap();
        assert_eq!(run.count(), 1);
    }
}

#[test]
fn a_time_event_before_the_present_time_is_an_error() {
    for (protocol, has_events) in INTERFACES {
        let message = error_of(Run::<Absolute>::starting(protocol, has_events, 100.0).map(|_| ()));
        for part in ["`next_time_event`", "present one, 100 s", "got 60 s", "initial_discrete_state"] {
            assert!(message.contains(part), "{protocol:?}: {message}");
        }
        let message = error_of(Run::<NotANumber>::starting(protocol, has_events, 0.0).map(|_| ()));
        assert!(message.contains("`next_time_event`") && message.contains("got NaN s"), "{message}");
    }
}

#[test]
fn timers_that_coincide_both_go_on() {
    for (protocol, has_events) in INTERFACES {
        let mut run = Run::<Timers>::starting(protocol, has_events, 0.0).unwrap();
        run.run(600.0).unwrap();
        assert_eq!(run.count(), 10, "{protocol:?}");
    }
}

#[test]
fn an_event_that_stays_due_is_an_error() {
    for (protocol, has_events) in INTERFACES {
        let run = Run::<Stuck>::starting(protocol, has_events, 0.0);
        let message = error_of(run.and_then(|mut run| run.run(100.0)));
        assert!(message.contains("more than 10000 time events at 60 s"), "{protocol:?}: {message}");
        assert!(message.contains("`on_event` must change what `next_time_event` returns"), "{message}");
        let message = error_of(Run::<Stuck>::starting(protocol, has_events, 60.0).map(|_| ()));
        assert!(message.contains("more than 10000 time events at 60 s"), "{protocol:?}: {message}");
    }
}

/// Sets the period at 330 s, if the interface allows it. The last event was at 300 s.
fn shortened<E: Export>(protocol: Protocol, has_events: bool, period: f64) -> Result<Run<E>, CallError> {
    let mut run = Run::<E>::starting(protocol, has_events, 0.0).unwrap();
    run.run(330.0).unwrap();
    assert_eq!(run.count(), 5, "{protocol:?}");
    if has_events {
        run.instance.enter_event_mode().unwrap();
    }
    run.instance.set_real(&[reference::<E>("period")], &[period]).unwrap();
    if has_events {
        run.update()?;
    } else {
        run.run(331.0)?;
    }
    Ok(run)
}

#[test]
fn a_period_that_is_shortened_takes_effect_at_once() {
    for (protocol, has_events) in INTERFACES {
        // 300 s + 20 s is in the past, so the next event is at 330 s, followed by events every 20 s.
        let mut run = shortened::<Relative>(protocol, has_events, 20.0).unwrap();
        for (end, count) in [(331.0, 6), (349.0, 6), (350.0, 7), (390.0, 9)] {
            run.run(end).unwrap();
            assert_eq!(run.count(), count, "{protocol:?}, {end} s");
        }
        // The sixth event would be at 180 s or 312 s, before the present time. At 330 s, it is due now.
        for (period, next) in [(30.0, "180 s"), (52.0, "312 s")] {
            let message = error_of(shortened::<Shortened>(protocol, has_events, period).map(|_| ()));
            assert!(message.contains("present one, 330 s") && message.contains(next), "{protocol:?}: {message}");
        }
        let mut run = shortened::<Shortened>(protocol, has_events, 55.0).unwrap();
        assert_eq!(run.count(), 6, "{protocol:?}");
        run.run(385.0).unwrap();
        assert_eq!(run.count(), 7, "{protocol:?}");
    }
}

/// An importer with a fixed step handles an event at the end of the step that contains the event.
#[test]
fn model_exchange_handles_an_announced_event_late() {
    let mut run = Run::<Absolute>::starting(Protocol::ME2, true, 0.0).unwrap();
    assert_eq!(run.next_event, Some(60.0));
    run.instance.set_time(130.0).unwrap();
    run.instance.enter_event_mode().unwrap();
    run.update().unwrap();
    assert_eq!((run.count(), run.next_event), (2, Some(180.0)));
}

/// An instance that is restored from bytes knows which event was announced, although it did not handle an event.
#[test]
fn a_restored_instance_has_the_same_time_events() {
    for (protocol, has_events) in INTERFACES {
        let mut run = Run::<Relative>::starting(protocol, has_events, 7.0).unwrap();
        run.run(100.0).unwrap();
        let bytes = run.instance.serialize(&run.instance.snapshot().unwrap()).unwrap();
        let mut other = Run::<Relative>::starting(protocol, has_events, 0.0).unwrap();
        let snapshot = other.instance.deserialize(&bytes).unwrap();
        other.instance.restore(&snapshot).unwrap();
        other.next_event = run.next_event;
        assert!(matches!(other.instance.mode(), Mode::Step | Mode::ContinuousTime));
        for end in [126.5, 127.0, 187.0] {
            run.run(end).unwrap();
            other.run(end).unwrap();
            assert_eq!(run.count(), other.count(), "{protocol:?}, {end} s");
        }
        assert_eq!(run.count(), 3);
    }
}
