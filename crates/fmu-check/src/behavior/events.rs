//! Event Mode in co-simulation of FMI 3.0, of FMUs without clocks (FMI 3.0.2, sections 2.3.5 and 4.2.1).

use super::experiment::ends_simulation;
use super::updates::SLACK;
use super::{CheckResult, Report, Trial, found};
use crate::Finding;
use fmu_import::loader::{CallProblem, Instance, MOST_ITERATIONS};

/// Name of the trial.
pub(super) const EVENTS: &str = "event mode";
/// One step in this number is preceded by an event of the importer.
const PERIOD: usize = 3;
/// Maximum number of events in a step.
const MOST: usize = 1000;

impl Trial<'_> {
    /// Checks that events end, that the FMU announces the next one for the future, and that neither another instance nor
    /// a state that is restored in Event Mode changes the results.
    pub(super) fn events(&self, report: Report<'_>) -> CheckResult<()> {
        if !self.unit.has_event_mode || !self.description.clocks.is_empty() {
            return Ok(());
        }
        let mut findings = Vec::new();
        let expected = self.run_with_events(false, &mut findings)?;
        findings.into_iter().for_each(|finding| found(report, finding));
        let restored = self.unit.can_get_and_set_fmu_state.then_some((true, "if states are restored in Event Mode"));
        for (restores, which) in [(false, "in another instance")].into_iter().chain(restored) {
            let outputs = self.run_with_events(restores, &mut Vec::new())?;
            if !self.compare(report, EVENTS, &format!("gives other results {which}"), &expected, &outputs) {
                break;
            }
        }
        Ok(())
    }

    /// The outputs after each step of a run in which the check handles the events.
    fn run_with_events(&self, restores: bool, findings: &mut Vec<Finding>) -> CheckResult<Vec<f64>> {
        self.instances.set(self.instances.get() + 1);
        let mut instance = Instance::instantiate_with_events(self.library, "events", &self.description.guid)?;
        instance.setup_experiment(self.start, None)?;
        instance.enter_initialization_mode()?;
        instance.share_events();
        instance.exit_initialization_mode()?;
        self.handle(&mut instance, self.start, restores, findings)?;
        let mut outputs = Vec::new();
        for k in 0..self.steps {
            self.set(&mut instance, &self.inputs, &self.input(k))?;
            let (mut time, end) = (self.start + self.step * k as f64, self.start + self.step * (k + 1) as f64);
            if k % PERIOD == 1 {
                self.handle(&mut instance, time, restores, findings)?;
            }
            for event in 0.. {
                let until = instance.next_tick(time, end, self.step).unwrap_or(end);
                self.made.set(self.made.get() + 1);
                time = match instance.step(time, until - time) {
                    Ok(()) => until,
                    Err(error) if error.problem == CallProblem::EarlyReturn => instance.last_successful_time()?,
                    Err(error) if ends_simulation(&mut instance, &error) => return Ok(outputs),
                    Err(error) => return Err(error),
                };
                if instance.wants_event() || instance.is_event_needed(time, self.step) {
                    self.handle(&mut instance, time, restores, findings)?;
                }
                if time >= end - SLACK * self.step {
                    break;
                }
                if event == MOST {
                    return Err(instance.failed_event(format!("more than {MOST} events before {time} s in one step")));
                }
            }
            self.read_outputs(&mut instance, &mut outputs)?;
        }
        Ok(outputs)
    }

    /// Handles an event; with `restores`, for a second time after the state was restored.
    fn handle(&self, fmu: &mut Instance, time: f64, restores: bool, findings: &mut Vec<Finding>) -> CheckResult<()> {
        fmu.begin_event()?;
        if restores {
            let saved = fmu.save_state()?;
            fmu.update(time)?;
            fmu.restore_state(&saved)?;
            fmu.free_state(saved)?;
        }
        for _ in 0..MOST_ITERATIONS {
            if !fmu.update(time)? {
                if findings.is_empty() && fmu.is_event_needed(time, self.step) {
                    let message = format!("announces at {time} s a next event that is not after this time");
                    findings.push(Finding::error("fmi3UpdateDiscreteStates", message));
                }
                return fmu.end_event();
            }
        }
        Err(fmu.endless(&[]))
    }
}
