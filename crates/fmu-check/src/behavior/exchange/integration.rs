//! Integration of the states by the classical Runge-Kutta method.

use super::super::experiment::{EXPERIMENT, progress};
use super::super::{CheckResult, Report, describe, found, middle, stop_time};
use super::{Exchange, Failure, Outcome};
use crate::{Finding, MODEL_EXCHANGE, Topic};
use fmu_import::loader::{CallProblem, Instance, Status};
use std::time::Instant;

const STEPS: usize = 40;
/// Maximum number of parts of a step. A step is divided if the solution is otherwise not finite, or if the FMU requests
/// shorter steps. Stiff equations, which need millions of parts, are integrated over a fraction of the time only.
const MOST_PARTS: usize = 1 << 24;
/// Maximum number of parts of all steps together.
const MOST_STEPS: usize = 64 * STEPS;

impl Exchange<'_> {
    /// Checks that a short integration stays finite and is reproducible, also after a reset.
    pub(super) fn integration(&self, report: Report<'_>) -> Outcome<()> {
        let mut parts = 1;
        let (first, mut instance) = loop {
            let mut instance = self.instance("integration")?;
            match self.integrate(&mut instance, parts) {
                Ok(end) if end.states.iter().all(|state| state.is_finite()) => break (end.states, instance),
                // Not finite or discarded: shorten the step, as a solver does.
                Ok(_) => {}
                Err(Failure::Call(error)) if matches!(error.problem, CallProblem::Status(Status::Discard)) => {}
                Err(failure) => return Err(failure),
            }
            if parts == MOST_PARTS {
                let step = self.step / MOST_PARTS as f64;
                let message = format!(
                    "is not finite, or is discarded, within {MOST_STEPS} steps of {step:.1e} s by the Runge-Kutta \
                     method"
                );
                return Err(Failure::Found(Finding::warning("model exchange: integration", message)));
            }
            parts *= 4;
        };
        self.parts.set(parts);
        instance.reset()?;
        let after = self.integrate(&mut instance, parts)?.states;
        let reset = self.function("fmi2Reset", "fmi3Reset");
        self.differs(report, reset, "the same integration before it ended with", &after, &first);
        drop(instance);
        let again = self.integrate(&mut self.instance("again")?, parts)?.states;
        self.differs(report, "model exchange: integration", "another instance ends with", &first, &again);
        Ok(())
    }

    /// Integrates from the middle of the default experiment. An FMU may reject this start time, but its users should
    /// know that.
    pub(super) fn another_start(&self, report: Report<'_>) -> Outcome<()> {
        let parts = self.parts.get();
        let count = (STEPS * parts).min(MOST_STEPS);
        let run = |start| self.integrate_over(&mut self.instance("start")?, &Span { start, stop: None, parts, count });
        // Other trials report failures of a run from the declared start.
        if !run(self.start).is_ok_and(|end| end.states.iter().all(|state| state.is_finite())) {
            return Ok(());
        }
        let later = middle(self.description, self.start, self.step);
        let problem = match run(later) {
            Ok(end) => match end.states.iter().position(|state| !state.is_finite()) {
                None => return Ok(()),
                Some(i) => format!("`{}` is {} at {} s", self.names[i], end.states[i], end.time),
            },
            Err(Failure::Call(error)) => describe(&error),
            Err(Failure::Found(finding)) => format!("{}: {}", finding.subject, finding.message),
        };
        let message = format!("fails if started at {later} s, not if started at {} s: {problem}", self.start);
        found(
            report,
            Finding::warning(format!("{MODEL_EXCHANGE}another start time"), message).about(Topic::Simulation),
        );
        Ok(())
    }

    /// Runs the default experiment once, from its start to its stop.
    pub(super) fn experiment(&self, report: Report<'_>) -> Outcome<()> {
        let Some(stop) = stop_time(self.description, self.start) else { return Ok(()) };
        let parts = self.parts.get();
        let count = ((stop - self.start) / self.step * parts as f64).round().max(1.0) as usize;
        let span = Span { start: self.start, stop: Some(stop), parts, count };
        self.time.set(self.start);
        let subject = format!("{MODEL_EXCHANGE}{EXPERIMENT}");
        let finding = match self.integrate_over(&mut self.instance("experiment")?, &span) {
            Ok(End { states, time, is_cut }) => {
                if let Some(i) = states.iter().position(|state| !state.is_finite()) {
                    let message = format!(
                        "`{}` is {} at {time} s of {stop} s, by the Runge-Kutta method with steps of {:.1e} s",
                        self.names[i],
                        states[i],
                        self.step / parts as f64
                    );
                    Finding::warning(subject, message)
                } else if is_cut {
                    let limit = self.options.experiment.as_secs_f64();
                    Finding::note(subject, format!("was cut at {time} s of {stop} s after {limit} s (--timeout)"))
                } else if time < stop - self.step {
                    Finding::note(subject, format!("the FMU ended the simulation at {time} s, before {stop} s"))
                } else {
                    return Ok(());
                }
            }
            Err(Failure::Call(error)) => {
                Finding::error(subject, format!("fails at {} s of {stop} s: {}", self.time.get(), describe(&error)))
            }
            Err(Failure::Found(finding)) => finding,
        };
        found(report, finding.about(Topic::Simulation));
        Ok(())
    }

    /// Integrates over some steps, each divided into parts, but over at most [`MOST_STEPS`] parts.
    pub(super) fn integrate(&self, instance: &mut Instance, parts: usize) -> Outcome<End> {
        let count = (STEPS * parts).min(MOST_STEPS);
        self.integrate_over(instance, &Span { start: self.start, stop: None, parts, count })
    }

    /// Integrates over parts of steps. If an indicator changes its sign in a part, an event is handled at the end of
    /// the part.
    fn integrate_over(&self, instance: &mut Instance, span: &Span) -> Outcome<End> {
        let &Span { start, stop, parts, count } = span;
        // The default experiment may take longer than a trial. The other integrations have few steps.
        let limit = stop.map(|_| Instant::now() + self.options.experiment);
        let mut next_event = self.start_up(instance, start, stop)?;
        let mut states = self.states(instance)?;
        let mut indicators = self.indicators(instance)?;
        let mut time = start;
        for k in 1..=count {
            if let Some(limit) = limit {
                progress();
                if Instant::now() > limit {
                    return Ok(End { states, time, is_cut: true });
                }
            }
            let end = start + self.step * k as f64 / parts as f64;
            let end = stop.map_or(end, |stop| end.min(stop));
            self.made.set(self.made.get() + 1);
            while time < end {
                let until = next_event.filter(|next| *next < end).unwrap_or(end);
                states = self.advance(instance, time, &states, until - time)?;
                if states.iter().any(|state| !state.is_finite()) {
                    return Ok(End { states, time: until, is_cut: false });
                }
                time = until;
                self.time.set(time);
                instance.set_time(time)?;
                instance.set_continuous_states(&states)?;
                let now = self.indicators(instance)?;
                let mut is_event = next_event.is_some_and(|next| next <= time);
                is_event |= now.iter().zip(&indicators).any(|(a, b)| (*a > 0.0) != (*b > 0.0));
                // An FMU may reject a step past a tick, and clocks are not activated here.
                if self.unit.needs_completed_integrator_step && self.description.clocks.is_empty() {
                    let completed = instance.completed_integrator_step()?;
                    if completed.terminates {
                        return Ok(End { states, time, is_cut: false });
                    }
                    is_event |= completed.enters_event_mode;
                }
                indicators = now;
                if is_event {
                    instance.enter_event_mode()?;
                    let settled = self.settle(instance, time)?;
                    if settled.is_over {
                        return Ok(End { states, time, is_cut: false });
                    }
                    next_event = settled.next_event;
                    states = self.states(instance)?;
                    indicators = self.indicators(instance)?;
                }
            }
        }
        instance.terminate()?;
        Ok(End { states, time, is_cut: false })
    }

    fn advance(&self, instance: &mut Instance, time: f64, states: &[f64], h: f64) -> CheckResult<Vec<f64>> {
        let moved = |slope: &[f64], h: f64| -> Vec<f64> { states.iter().zip(slope).map(|(x, k)| x + h * k).collect() };
        let mut slope = |time: f64, states: &[f64]| {
            instance.set_time(time)?;
            instance.set_continuous_states(states)?;
            self.derivatives(instance)
        };
        let a = slope(time, states)?;
        let b = slope(time + 0.5 * h, &moved(&a, 0.5 * h))?;
        let c = slope(time + 0.5 * h, &moved(&b, 0.5 * h))?;
        let d = slope(time + h, &moved(&c, h))?;
        let end = (0..states.len()).map(|i| states[i] + h / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
        Ok(end.collect())
    }
}

struct Span {
    /// Start and declared stop, s.
    start: f64,
    stop: Option<f64>,
    parts: usize,
    count: usize,
}

pub(super) struct End {
    states: Vec<f64>,
    time: f64,
    is_cut: bool,
}
