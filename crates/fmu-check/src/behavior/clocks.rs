//! Clocks, in Event Mode of co-simulation and in scheduled execution (FMI 3.0.2, sections 2.2.8, 2.3.5 and 5.2).

use super::experiment::ends_simulation;
use super::{CheckResult, Report, Trial, describe, found};
use crate::{Finding, Severity};
use fmu_import::c_api::Reference;
use fmu_import::description::{Causality, Clock, IntervalVariability as Kind, Value, Variable};
use fmu_import::loader::{Activation, AskedInterval, Instance, MOST_ITERATIONS};
use std::cell::Cell;

/// Name of the trial.
pub(super) const CLOCKS: &str = "clocks";
/// Number of events in a run.
const EVENTS: usize = 60;
/// Number of events in which the state is saved and restored.
const RESTORED: usize = 5;
/// Longest time between two events, in communication steps.
const HORIZON: f64 = 1e6;
/// Maximum number of clocks of which each has instances of its own.
const MOST: usize = 10;

/// A function that a run calls after each tick in scheduled execution.
type Probe<'a> = &'a dyn Fn(&mut Instance, Activation) -> CheckResult<()>;
type Start<'a> = &'a dyn Fn() -> CheckResult<Instance>;
type Call<'a> = &'a dyn Fn(&mut Instance) -> CheckResult<()>;

/// The observed outputs after each tick, and the time and value reference of each tick.
#[derive(Default)]
struct Run {
    outputs: Vec<f64>,
    ticks: Vec<(f64, Reference)>,
    findings: Vec<Finding>,
}

fn wrong(clock: &Clock, message: impl Into<String>) -> Finding {
    Finding::error(format!("clock `{}`", clock.name), message)
}

/// The rule that a qualifier of an interval violates (FMI 3.0.2, section 2.2.8, on `qualifiers`).
fn wrong_qualifier(clock: &Clock, asked: &AskedInterval) -> Option<Finding> {
    let is_declared = clock.interval.is_some();
    let problem = match asked.qualifier {
        0 if clock.interval_variability != Kind::Countdown => "0 (not yet known), which only countdown clocks may have",
        1 if !is_declared && !asked.was_pending => "1 (unchanged), although no earlier interval is still valid",
        0..=2 => return None,
        _ => "not 0, 1 or 2",
    };
    Some(wrong(clock, format!("has an interval whose qualifier is {problem}")))
}

impl Trial<'_> {
    /// Checks intervals, determinism, saved states in events, deactivation, the calls of `clockUpdate`, and that the
    /// FMU rejects calls that the standard forbids.
    pub(super) fn clocks(&self, report: Report<'_>) -> CheckResult<()> {
        if self.description.clocks.is_empty() {
            return Ok(());
        }
        self.intervals(report)?;
        let none = |_: &mut Instance, _: Activation| Ok(());
        let first = self.run(0, &none)?;
        first.findings.iter().for_each(|finding| found(report, finding.clone()));
        let restored = self.unit.can_get_and_set_fmu_state.then_some((RESTORED, "if states are restored in events"));
        for (restored, which) in [(0, "in another instance")].into_iter().chain(restored) {
            let (subject, again) = (self.name(CLOCKS), self.run(restored, &none)?);
            if first.ticks == again.ticks {
                let message = format!("give other results {which}");
                self.compare(report, &subject, &message, &first.outputs, &again.outputs);
            } else {
                let message = format!("tick at other times, or in another order, {which}");
                found(report, Finding::error(subject, message));
            }
        }
        self.forbidden(report);
        if self.is_scheduled() {
            self.unreported(report)
        } else {
            self.deactivation(report)?
        }
        Ok(())
    }

    fn clocks_of(&self, causality: Causality) -> impl Iterator<Item = &Clock> {
        // Aliases follow their clock.
        let clocks = &self.description.clocks;
        let is_first = move |i: usize| i == 0 || clocks[i - 1].reference != clocks[i].reference;
        let of = move |(i, clock): &(usize, &Clock)| clock.causality == causality && is_first(*i);
        clocks.iter().enumerate().filter(of).map(|(_, clock)| clock)
    }

    /// Compares intervals and shifts in Initialization Mode with the description.
    fn intervals(&self, report: Report<'_>) -> CheckResult<()> {
        let has_interval = |clock: &&Clock| clock.interval_variability != Kind::Triggered;
        for clock in self.clocks_of(Causality::Input).filter(has_interval).take(MOST) {
            let mut instance = self.initializing("intervals")?;
            let is_periodic = !matches!(clock.interval_variability, Kind::Changing | Kind::Countdown);
            let asked = instance.get_interval(clock.reference).and_then(|interval| {
                Ok((interval, if is_periodic { instance.get_shift(clock.reference)? } else { 0.0 }))
            });
            let ((interval, qualifier), shift) = match asked {
                Ok(asked) => asked,
                Err(error) => {
                    let problem = describe(&error);
                    found(report, wrong(clock, format!("has no interval or shift in Initialization Mode: {problem}")));
                    continue;
                }
            };
            let asked = AskedInterval { clock: clock.reference, qualifier, was_pending: false };
            wrong_qualifier(clock, &asked).into_iter().for_each(|finding| found(report, finding));
            let is_valid = interval.is_finite() && (interval > 0.0 || interval == 0.0 && !is_periodic);
            let is_declared = clock.interval.is_none_or(|declared| (declared, clock.shift) == (interval, shift));
            if qualifier != 0 && !(is_valid && is_declared && shift >= 0.0) {
                let rule = clock.interval.map_or("at least 0".to_owned(), |declared| {
                    format!("those in the description, {declared} s and {} s", clock.shift)
                });
                let message = format!("has the interval {interval} s and the shift {shift} s, which must be {rule}");
                found(report, wrong(clock, message));
            }
        }
        Ok(())
    }

    /// An instance in its first event, or in Clock Activation Mode.
    fn in_event(&self) -> CheckResult<Instance> {
        let mut instance = self.initializing("event")?;
        instance.share_events();
        instance.exit_initialization_mode()?;
        Ok(instance)
    }

    /// Lets clocks tick, in scheduled execution one clock.
    fn tick(&self, instance: &mut Instance, clocks: &[Reference], time: f64) -> CheckResult<Activation> {
        if let (true, Some(clock)) = (self.is_scheduled(), clocks.first()) {
            return instance.activate_partition(*clock, time);
        }
        instance.activate(clocks)?;
        instance.evaluate().map(|()| Activation::default())
    }

    /// Runs from event to event. Time-based clocks tick at their times, triggered ones in every third event. In the
    /// first events, the ticks are repeated after the state was restored.
    fn run(&self, restored: usize, probe: Probe<'_>) -> CheckResult<Run> {
        let (mut instance, mut run, mut time) = (self.in_event()?, Run::default(), self.start);
        for event in 0..EVENTS {
            let is_triggered = |clock: &&Clock| clock.interval_variability == Kind::Triggered && event % 3 == 1;
            let triggered = self.clocks_of(Causality::Input).filter(is_triggered).map(|clock| clock.reference);
            let (mut triggered, mut ticked): (Vec<Reference>, Vec<Reference>) = (triggered.collect(), Vec::new());
            instance.begin_event()?;
            for iteration in 0.. {
                let mut due = instance.due_clocks(time, self.step);
                due.append(&mut triggered);
                if self.is_scheduled() {
                    due.retain(|clock| !ticked.contains(clock));
                    triggered = due.iter().skip(1).copied().collect();
                    due.truncate(1);
                    ticked.extend(&due);
                    if due.is_empty() {
                        break;
                    }
                }
                if event < restored && !due.is_empty() {
                    let saved = instance.save_state()?;
                    self.tick(&mut instance, &due, time)?;
                    if !self.is_scheduled() {
                        instance.update(time)?;
                    }
                    instance.restore_state(&saved)?;
                    instance.free_state(saved)?;
                }
                let activation = self.tick(&mut instance, &due, time)?;
                let clocks = self.description.clocks.iter().map(|clock| clock.reference);
                run.ticks.extend(clocks.filter(|clock| instance.is_active(*clock)).map(|clock| (time, clock)));
                self.read_outputs(&mut instance, &mut run.outputs)?;
                probe(&mut instance, activation)?;
                let is_needed_again = self.is_scheduled() || instance.update(time)?;
                self.check_ticks(&instance, activation, &mut run.findings);
                if !is_needed_again && instance.due_clocks(time, self.step).is_empty() {
                    instance.end_event()?;
                    break;
                }
                if iteration == MOST_ITERATIONS {
                    return Err(instance.endless(&[]));
                }
            }
            let next = instance.next_tick(time, time + HORIZON * self.step, self.step).unwrap_or(time + self.step);
            if !self.is_scheduled() {
                self.made.set(self.made.get() + 1);
                if let Err(error) = instance.step(time, next - time) {
                    return if ends_simulation(&mut instance, &error) { Ok(run) } else { Err(error) };
                }
            }
            time = next;
        }
        Ok(run)
    }

    /// Checks the last ticks of a run: qualifiers and locks.
    fn check_ticks(&self, instance: &Instance, activation: Activation, findings: &mut Vec<Finding>) {
        let clock = |asked: &AskedInterval| self.description.clocks.iter().find(|clock| clock.reference == asked.clock);
        let qualifiers = instance.asked_intervals().iter().filter_map(|asked| wrong_qualifier(clock(asked)?, asked));
        let message = "does not call lockPreemption and unlockPreemption equally often";
        let locks = (activation.locks != 0).then(|| Finding::error("fmi3ActivateModelPartition", message));
        for finding in qualifiers.chain(locks) {
            if !findings.contains(&finding) {
                findings.push(finding);
            }
        }
    }

    /// Finds output clocks and new intervals for which the FMU does not call `clockUpdate`. Errors end a run, because
    /// an FMU may reject these calls outside `clockUpdate`.
    fn unreported(&self, report: Report<'_>) {
        for causality in [Causality::Output, Causality::Input] {
            let missing = Cell::new(None);
            let probe = |instance: &mut Instance, activation: Activation| {
                for clock in self.clocks_of(causality).filter(|_| activation.updates == 0) {
                    let is_new = match clock.interval_variability {
                        Kind::Countdown => instance.get_interval(clock.reference)?.1 == 2,
                        _ => causality == Causality::Output && instance.get_clock(clock.reference)?,
                    };
                    missing.set(missing.get().or(is_new.then_some(clock)));
                }
                Ok(())
            };
            drop(self.run(0, &probe));
            if let Some(clock) = missing.get() {
                let event = if causality == Causality::Output { "ticks" } else { "has a new interval" };
                let message = format!("{event}, but the FMU does not call clockUpdate (FMI 3.0.2, section 5.2.1)");
                found(report, wrong(clock, message));
            }
        }
    }

    /// Checks that a deactivated clock has no effect, and that others cannot be deactivated.
    fn deactivation(&self, report: Report<'_>) -> CheckResult<()> {
        for clock in self.clocks_of(Causality::Input).take(MOST) {
            let deactivate = |instance: &mut Instance| instance.deactivate(clock.reference);
            let active = || {
                let mut instance = self.in_event()?;
                self.tick(&mut instance, &[clock.reference], self.start).map(|_| instance)
            };
            if !clock.can_be_deactivated {
                let what = "deactivates a clock without `canBeDeactivated`";
                self.rejects(report, clock, what, &active, &deactivate);
                continue;
            }
            // An FMU may reject the activation of a clock that is not due.
            let Ok(mut deactivated) = active() else { continue };
            if let Err(error) = deactivate(&mut deactivated) {
                found(report, wrong(clock, format!("has `canBeDeactivated`, but {}", describe(&error))));
                continue;
            }
            let then = |mut instance: Instance| -> CheckResult<Vec<f64>> {
                instance.update(self.start)?;
                instance.end_event()?;
                instance.begin_event()?;
                self.tick(&mut instance, &[clock.reference], self.start)?;
                let mut outputs = Vec::new();
                self.read_outputs(&mut instance, &mut outputs).map(|()| outputs)
            };
            let (Ok(expected), Ok(outputs)) = (then(self.in_event()?), then(deactivated)) else { continue };
            let message = "has an effect although it is deactivated before fmi3UpdateDiscreteStates";
            self.compare(report, &format!("clock `{}`", clock.name), message, &expected, &outputs);
        }
        Ok(())
    }

    /// Reports a call that the FMU accepts although the standard forbids it. Errors before the call are ignored: other
    /// trials report them.
    fn rejects(&self, report: Report<'_>, clock: &Clock, what: &str, start: Start<'_>, call: Call<'_>) {
        if start().is_ok_and(|mut instance| call(&mut instance).is_ok()) {
            let message = format!("the FMU accepts a call that {what}; it must return fmi3Error");
            found(report, Finding { severity: Severity::Warning, ..wrong(clock, message) });
        }
    }

    /// Tries calls that the standard forbids, each in an instance of its own.
    fn forbidden(&self, report: Report<'_>) {
        let mut kinds = Vec::new();
        for clock in self.clocks_of(Causality::Input) {
            let kind = clock.interval_variability;
            let is_settable = matches!(kind, Kind::Fixed | Kind::Tunable) && clock.interval.is_some();
            if !is_settable && !kinds.contains(&kind) {
                kinds.push(kind);
                let what = format!("sets the interval of a {kind} clock, which only the FMU determines");
                let start = || self.initializing("interval");
                self.rejects(report, clock, &what, &start, &|i| i.set_interval(clock.reference, 1.0));
            }
        }
        let event = || self.in_event();
        if let Some(clock) = self.clocks_of(Causality::Output).next() {
            let activate = |i: &mut Instance| self.tick(i, &[clock.reference], self.start).map(drop);
            self.rejects(report, clock, "activates an output clock", &event, &activate);
        }
        let Some(clock) = self.clocks_of(Causality::Input).next() else { return };
        let (reference, later) = (clock.reference, self.start + self.step);
        let set = |i: &mut Instance| i.activate(&[reference]);
        if self.is_scheduled() {
            self.rejects(report, clock, "sets it in scheduled execution", &event, &set);
            let activated = || {
                let mut instance = event()?;
                instance.activate_partition(reference, later).map(|_| instance)
            };
            for (what, time) in [("a second time at one time", later), ("at a time before its last tick", self.start)] {
                let again = |i: &mut Instance| i.activate_partition(reference, time).map(drop);
                self.rejects(report, clock, &format!("activates its partition {what}"), &activated, &again);
            }
            return;
        }
        let stepping = || {
            let mut instance = event()?;
            instance.update(self.start)?;
            instance.end_event().map(|()| instance)
        };
        self.rejects(report, clock, "sets it in Step Mode", &stepping, &set);
        let is_clocked = |variable: &&Variable| !variable.clocks.is_empty() && variable.alias_of.is_none();
        let mut clocked = self.description.variables.iter().filter(is_clocked);
        if let Some(output) = clocked.clone().find(|variable| variable.causality == Causality::Output) {
            let what = format!("gets `{}` while no clock is active", output.name);
            self.rejects(report, clock, &what, &event, &|i| i.unheld(|i| i.get_values(output).map(drop)));
        }
        if let Some(input) = clocked.find(|variable| variable.causality == Causality::Input) {
            let what = format!("sets `{}` while no clock is active", input.name);
            let starts: Vec<Value> = input.start.iter().chain(&input.starts).cloned().collect();
            self.rejects(report, clock, &what, &event, &|i| i.unheld(|i| i.set_values(input, &starts)));
        }
    }
}
