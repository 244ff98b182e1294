//! Scheduled execution of FMI 3.0 (FMI 3.0.2, chapter 5) without preemption, for tests and demonstrations.
//!
//! [`Instance::do_step`] activates the partitions of time-based clocks one after the other, each at its time; at the
//! same time, smaller priorities come first. Clocks that are due at the end of a step tick in the next step. Triggered
//! clocks tick if the caller activates them, and output clocks activate nothing.
//!
//! Variables that are set get their values before the next activation, and clocked outputs are read after each one.

use super::calls::Function;
use super::error::{CallError, CallProblem, Status};
use super::functions::{Functions, v3};
use super::instance::Instance;
use super::library::Library;
use crate::c_api::v3::RawBoolean;
use crate::c_api::{Component, RawStatus, Reference};
use crate::description::{Interface, IntervalVariability};
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ffi::{c_int, c_void};
use std::sync::Arc;

/// The calls that an FMU has made in an activation of a partition.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Activation {
    /// Calls of `clockUpdate`.
    pub updates: usize,
    /// Calls of `lockPreemption` minus those of `unlockPreemption`.
    pub locks: isize,
}

/// The activation that a thread executes.
struct Running {
    environment: *mut c_void,
    component: Component,
    library: Arc<Library>,
    activation: Activation,
    /// Output clocks that ticked, and the intervals and qualifiers of countdown clocks.
    fired: Vec<Reference>,
    intervals: BTreeMap<Reference, (f64, c_int)>,
    failure: Option<(Function, RawStatus)>,
}

thread_local! {
    static RUNNING: RefCell<Option<Running>> = const { RefCell::new(None) };
}

/// Changes the activation of this thread; nothing happens outside an activation, or if `change` itself calls it.
fn running(change: impl Fn(&mut Running)) {
    RUNNING.with(|running| {
        running.try_borrow_mut().into_iter().for_each(|mut it| it.as_mut().into_iter().for_each(&change))
    });
}

pub(super) unsafe extern "C" fn lock_preemption() {
    running(|running| running.activation.locks += 1);
}

pub(super) unsafe extern "C" fn unlock_preemption() {
    running(|running| running.activation.locks -= 1);
}

/// Asks for output clocks and intervals. Ignored in other threads, and with the environment of another instance.
pub(super) unsafe extern "C" fn clock_update(environment: *mut c_void) {
    running(|running| {
        if running.environment == environment {
            running.activation.updates += 1;
            running.ask();
        }
    });
}

impl Running {
    fn ask(&mut self) {
        let Functions::V3(v3::Functions { get_clock: Some(get_clock), get_interval: Some(get_interval), .. }) =
            &self.library.functions
        else {
            return;
        };
        let failure = |function, status| (status > 1).then_some((function, status));
        for (clock, _) in &self.library.signature.output_clocks {
            let mut ticks: RawBoolean = 0;
            // SAFETY: live instance in Clock Update Mode; one clock, and its state is written through a valid pointer.
            let status = unsafe { get_clock(self.component, &raw const *clock, 1, &raw mut ticks) };
            self.failure = self.failure.or(failure(Function::GetClock, status));
            self.fired.extend((ticks != 0).then_some(*clock));
        }
        let clocks = self.library.signature.clocks.iter();
        for clock in clocks.filter(|clock| clock.kind == IntervalVariability::Countdown).map(|clock| clock.reference) {
            let (mut interval, mut qualifier) = (0.0, 0);
            // SAFETY: as above; the interval is written through valid pointers.
            let status =
                unsafe { get_interval(self.component, &raw const clock, 1, &raw mut interval, &raw mut qualifier) };
            self.failure = self.failure.or(failure(Function::GetIntervalDecimal, status));
            // A later update in the same activation repeats an interval only as unchanged.
            if qualifier == super::clocks::CHANGED || !self.intervals.contains_key(&clock) {
                self.intervals.insert(clock, (interval, qualifier));
            }
        }
    }
}

impl Instance {
    pub(super) fn is_scheduled(&self) -> bool {
        self.signature().interface == Interface::ScheduledExecution
    }

    /// `fmi3ActivateModelPartition`, in s: sets the variables that were changed, and reads the clocked outputs. The
    /// next ticks of time-based clocks follow from the intervals that the FMU reports.
    pub fn activate_partition(&mut self, clock: Reference, time: f64) -> Result<Activation, CallError> {
        self.with_clocks(|this, clocks| {
            clocks.active = vec![clock];
            this.set_pending(clocks)?;
            RUNNING.set(Some(Running {
                environment: this.log.environment(),
                component: this.component,
                library: Arc::clone(this.library()),
                activation: Activation::default(),
                fired: Vec::new(),
                intervals: BTreeMap::new(),
                failure: None,
            }));
            // SAFETY: live instance.
            let result = this.call_v3(Function::ActivateModelPartition, |f, c| unsafe {
                Some(f.activate_partition?(c, clock, time))
            });
            let Some(running) = RUNNING.take().filter(|_| result.is_ok()) else {
                return result.map(|()| Activation::default());
            };
            if let Some((function, status)) = running.failure {
                return Err(this.failure(function, CallProblem::Status(Status::from(status))));
            }
            this.advance_clocks(clocks, time, Some(&running.intervals))?;
            running.fired.iter().for_each(|clock| clocks.mark(*clock, true));
            clocks.fired = running.fired;
            this.read_clocked(clocks)?;
            Ok(running.activation)
        })
    }

    /// Activates the partitions that are due from `time` until before `time + step`, both in s.
    pub(super) fn step_partitions(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        let (end, mut now) = (time + step, time);
        self.clear_ticks();
        while now < end {
            let mut ticked = Vec::new();
            while let Some(&clock) = self.due_clocks(now, step).first() {
                if ticked.contains(&clock) {
                    let clock: String = self.active_clocks().collect();
                    let reason =
                        format!("the clock `{clock}` is due twice at {now} s; start it with an interval above 0");
                    return Err(self.failed_event(reason));
                }
                ticked.push(clock);
                self.activate_partition(clock, now)?;
            }
            now = self.next_tick(now, end, step).unwrap_or(end);
        }
        Ok(())
    }
}
