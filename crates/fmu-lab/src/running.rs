//! A running system: steps, rows, recording, saved states and rewinding.

use crate::columns::Shown;
use crate::drive::{Driver, SPEED};
use crate::fmus::{Descriptions, Modules, name_of};
use crate::requests::{Driving, Failure};
use fmu_assess::single::{PLANT, ROLLED_OVER};
use fmu_import::description::{BaseType, Causality, Value, Variable};
use fmu_system::failure::{Failure as RunFailure, FailureKind};
use fmu_system::master::Recording;
use fmu_system::run::{Run, Simulation};
use fmu_system::session::{Overwrite, Saved, Session};
use std::collections::BTreeMap;

/// Time between two saved states, s.
const BETWEEN_STATES: f64 = 1.0;
/// Minimum time between two rows for the page, s.
const BETWEEN_ROWS: f64 = 0.01;

/// Action of the visitor while a system runs. Actions are kept: rewinding to a time between two saved states repeats
/// them.
#[derive(Debug, Clone)]
pub(crate) enum Action {
    Set { component: String, variables: Vec<String>, value: f64 },
    Drive(Driving),
}

/// A state and the number of steps before it.
struct Checkpoint {
    step: u64,
    saved: Saved,
    driver: Option<Driver>,
}

/// Reason why a system cannot continue.
#[derive(Debug, Clone)]
pub(crate) struct Stopped {
    pub(crate) time: f64,
    pub(crate) component: String,
    pub(crate) message: String,
}

pub(crate) struct Running {
    /// A number that is different for each system.
    modules: usize,
    first_driver: Option<Driver>,
    pub(crate) simulation: Simulation,
    /// The run, with a slot for each output.
    pub(crate) run: Run,
    pub(crate) shown: Vec<Shown>,
    session: Session,
    /// Steps between two rows for the page.
    pub(crate) row_every: u64,
    state_every: u64,
    pub(crate) recording: Recording,
    rows: Vec<f64>,
    checkpoints: Vec<Checkpoint>,
    actions: Vec<(u64, Action)>,
    overwrites: BTreeMap<(String, String), Overwrite>,
    driver: Option<Driver>,
    descriptions: Descriptions,
    /// True if a vehicle on its side ends the run, as on the test bench; false for a scenario.
    pub(crate) ends_rolled_over: bool,
    pub(crate) stopped: Option<Stopped>,
}

impl Running {
    /// Instantiates and initializes a run. `modules` is a number that is different for each system.
    pub(crate) fn new(
        modules: usize,
        simulation: &Simulation,
        run: Run,
        shown: Vec<Shown>,
        driver: Option<Driver>,
        descriptions: &Descriptions,
    ) -> Result<Self, Failure> {
        let instances = Modules::new(modules, descriptions.clone());
        let session = Session::new(simulation, &run, &instances).map_err(Failure::new)?;
        let steps = |time: f64| ((time / simulation.step).round() as u64).max(1);
        let columns = run.columns.iter().map(|slot| slot.map(|_| Vec::new())).collect();
        let mut running = Self {
            modules,
            first_driver: driver.clone(),
            simulation: *simulation,
            row_every: steps(BETWEEN_ROWS),
            state_every: steps(BETWEEN_STATES),
            run,
            shown,
            session,
            recording: Recording { columns, ..Recording::default() },
            rows: Vec::new(),
            checkpoints: Vec::new(),
            actions: Vec::new(),
            overwrites: BTreeMap::new(),
            driver,
            descriptions: descriptions.clone(),
            ends_rolled_over: false,
            stopped: None,
        };
        running.record();
        Ok(running)
    }

    pub(crate) fn time(&self) -> f64 {
        self.session.time()
    }

    /// Number and values of the new rows.
    pub(crate) fn rows(&self) -> (usize, &[f64]) {
        (self.rows.len() / (self.shown.len() + 1), &self.rows)
    }

    pub(crate) fn rows_read(&mut self) {
        self.rows.clear();
    }

    /// Makes at most `steps` steps, fewer if the run ends. Returns their number; `None` if the system fails or has
    /// failed before.
    pub(crate) fn advance(&mut self, steps: u32) -> Option<u32> {
        if self.stopped.is_some() {
            return None;
        }
        for done in 0..steps {
            if self.session.is_over() {
                return Some(done);
            }
            if let Err(error) = self.step() {
                self.stopped = Some(stopped(&error));
                return None;
            }
        }
        Some(steps)
    }

    fn step(&mut self) -> Result<(), RunFailure> {
        let step = self.session.steps();
        let is_due =
            step.is_multiple_of(self.state_every) && self.checkpoints.last().is_none_or(|last| last.step < step);
        // An FMU that cannot save its state can be run, but not rewound.
        if is_due && let Ok(saved) = self.session.save() {
            self.checkpoints.push(Checkpoint { step, saved, driver: self.driver.clone() });
        }
        if let Some(driver) = &mut self.driver {
            for (signal, value) in driver.step(self.simulation.step) {
                for (component, variable) in driver.readers(signal) {
                    if let Some(input) = self.overwrites.get(&(component.clone(), variable.clone())) {
                        self.session.set(*input, value);
                    }
                }
            }
        }
        let ended = self.session.step();
        // An FMU that ends the simulation at the end of the step has made the step.
        let is_whole = ended.as_ref().err().is_none_or(|error| error.kind == FailureKind::Terminated);
        if is_whole && self.session.steps() > step {
            self.record();
            if self.ends_rolled_over {
                self.end_rolled_over();
            }
        }
        ended
    }

    /// Ends the run of a vehicle on its side, as the test bench does, because the model is not valid in this position.
    fn end_rolled_over(&mut self) {
        let is_roll =
            |shown: &&Shown| shown.component == PLANT && shown.variable == "body.roll" && shown.column.unit == "rad";
        let roll = self.shown.iter().find(is_roll).map_or(0.0, |shown| self.session.bus()[shown.slot]);
        if roll.abs() > ROLLED_OVER && self.stopped.is_none() {
            let message =
                format!("the vehicle rolled over, to a roll angle of {roll:.2} rad; the test bench ends a run there");
            self.stopped = Some(Stopped { time: self.session.time(), component: String::new(), message });
        }
    }

    /// Records the signals if a row is due at the current time.
    fn record(&mut self) {
        let (step, time) = (self.session.steps(), self.session.time());
        if step.is_multiple_of(self.simulation.every) {
            self.recording.time.push(time);
            let bus = self.session.bus();
            for (slot, column) in self.run.columns.iter().zip(&mut self.recording.columns) {
                if let (Some(slot), Some(column)) = (slot, column) {
                    column.push(bus[*slot]);
                }
            }
        }
        if step.is_multiple_of(self.row_every) {
            let bus = self.session.bus();
            self.rows.push(time);
            self.rows.extend(self.shown.iter().map(|shown| match &self.driver {
                Some(driver) if shown.component == driver.component => {
                    driver.value(&shown.variable).unwrap_or(bus[shown.slot])
                }
                _ => bus[shown.slot],
            }));
        }
    }

    /// Applies an action from the next step on.
    pub(crate) fn act(&mut self, action: Action) -> Result<(), Failure> {
        self.apply(&action)?;
        let step = self.session.steps();
        // If the visitor drives several times before the next step, only the last action counts.
        if matches!(action, Action::Drive(_)) {
            self.actions.retain(|(of, other)| *of != step || !matches!(other, Action::Drive(_)));
        }
        self.actions.push((step, action));
        Ok(())
    }

    fn apply(&mut self, action: &Action) -> Result<(), Failure> {
        match action {
            Action::Drive(driving) => {
                if let Some(driver) = &mut self.driver {
                    driver.driving = Some(*driving);
                    let readers: Vec<_> = driver.all_readers().cloned().collect();
                    for (component, variable) in readers {
                        self.overwrite(&component, &variable)?;
                    }
                }
                Ok(())
            }
            Action::Set { component, variables, value } => {
                variables.iter().try_for_each(|variable| self.set(component, variable, *value))
            }
        }
    }

    fn variable(&self, component: &str, name: &str) -> Result<Variable, Failure> {
        let planned = self.run.components.iter().find(|planned| planned.name == component);
        let description = planned.and_then(|planned| self.descriptions.get(name_of(&planned.fmu)));
        let variable = description.and_then(|description| description.variable(name)).cloned();
        variable.ok_or_else(|| Failure::new(format!("the system has no `{component}:{name}`")))
    }

    /// Returns a handle of the input, whose value the visitor sets from now on.
    fn overwrite(&mut self, component: &str, name: &str) -> Result<Overwrite, Failure> {
        let key = (component.to_owned(), name.to_owned());
        if let Some(input) = self.overwrites.get(&key) {
            return Ok(*input);
        }
        let variable = self.variable(component, name)?;
        let input = self.session.overwrite(component, &variable).map_err(Failure::new)?;
        self.overwrites.insert(key, input);
        Ok(input)
    }

    fn set(&mut self, component: &str, name: &str, value: f64) -> Result<(), Failure> {
        if let Some(driver) = self.driver.as_mut().filter(|driver| driver.component == component && name == SPEED) {
            driver.speed = value;
            return Ok(());
        }
        let variable = self.variable(component, name)?;
        if variable.causality == Causality::Input {
            let input = self.overwrite(component, name)?;
            self.session.set(input, value);
            return Ok(());
        }
        let value = converted(&variable, value);
        self.session.tune(component, &variable, value).map_err(Failure::new)
    }

    /// Rewinds to a time and discards what came after it.
    pub(crate) fn seek(&mut self, time: f64) -> Result<(), Failure> {
        let target = ((time - self.simulation.start) / self.simulation.step).round().max(0.0) as u64;
        let target = target.min(self.session.steps());
        if target == self.session.steps() && self.stopped.is_none() {
            return Ok(());
        }
        let failed = |error: RunFailure| Failure::new(format!("cannot rewind: {error}"));
        let at = self.checkpoints.iter().rposition(|checkpoint| checkpoint.step <= target);
        // A terminated instance cannot be restored, and some FMUs cannot save their state. The run then starts over
        // with new instances.
        if at.is_none_or(|at| self.restore(at).is_err()) {
            self.restart().map_err(failed)?;
        }
        self.stopped = None;
        // Rows up to the saved state exist. The steps from this state to the requested time are repeated with the
        // visitor's actions.
        let from = self.session.steps();
        let actions = std::mem::take(&mut self.actions);
        let mut next = actions.iter().filter(|(step, _)| *step >= from && *step < target).peekable();
        while self.session.steps() < target {
            while let Some((_, action)) = next.next_if(|(step, _)| *step == self.session.steps()) {
                self.apply(action)?;
            }
            if let Err(error) = self.step() {
                if error.kind != FailureKind::Terminated {
                    return Err(failed(error));
                }
                self.stopped = Some(stopped(&error));
                break;
            }
        }
        self.actions = actions;
        self.actions.retain(|(step, _)| *step < target);
        self.rows.clear();
        Ok(())
    }

    /// Restores a saved state and frees all later ones.
    fn restore(&mut self, at: usize) -> Result<(), RunFailure> {
        for later in self.checkpoints.split_off(at + 1) {
            self.session.free(later.saved)?;
        }
        let checkpoint = &self.checkpoints[at];
        self.session.restore(&checkpoint.saved)?;
        self.driver.clone_from(&checkpoint.driver);
        self.truncate(usize::try_from(checkpoint.step / self.simulation.every + 1).unwrap_or(usize::MAX));
        Ok(())
    }

    /// Starts over with new instances.
    fn restart(&mut self) -> Result<(), RunFailure> {
        let instances = Modules::new(self.modules, self.descriptions.clone());
        self.checkpoints.clear();
        self.session = Session::new(&self.simulation, &self.run, &instances)?;
        self.overwrites.clear();
        self.driver.clone_from(&self.first_driver);
        self.truncate(0);
        self.record();
        Ok(())
    }

    fn truncate(&mut self, rows: usize) {
        self.recording.time.truncate(rows);
        self.recording.columns.iter_mut().flatten().for_each(|column| column.truncate(rows));
    }

    /// Stops a system after a failure outside of its steps.
    pub(crate) fn fail(&mut self, message: &str) {
        let time = self.time();
        self.stopped = Some(Stopped { time, component: String::new(), message: message.to_owned() });
    }
}

/// Converts a number to the type of a variable.
pub(crate) fn converted(variable: &Variable, value: f64) -> Value {
    match variable.base_type {
        BaseType::Integer => Value::Integer(value.round() as i64),
        BaseType::Boolean => Value::Boolean(value > 0.5),
        _ => Value::Real(value),
    }
}

fn stopped(error: &RunFailure) -> Stopped {
    let component = error.component.clone().unwrap_or_default();
    Stopped { time: error.time.unwrap_or(0.0), component, message: error.message.clone() }
}
