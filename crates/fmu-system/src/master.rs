//! The master: executes the runs of a plan.
//!
//! Components are stepped with a fixed communication step, either one after the other (Gauss-Seidel) or
//! all from the outputs of the step before (Jacobi); see [`Order`]. The sequence of calls is part of
//! the plan's meaning: another master that makes the same calls gets the same bits.
//!
//! The functions below are those of FMI 2.0. A component of FMI 3.0 gets the calls that do the same, in the same places:
//! `fmi3EnterInitializationMode` has the times of `fmi2SetupExperiment`, and Event Mode and early return are not used.
//!
//! 1. Instantiate all components, `fmi2SetupExperiment` without tolerance and with the stop time.
//! 2. Set the parameters, `fmi2EnterInitializationMode` on all.
//! 3. Bus at 0; input series of the start time; read the outputs of all components; then component by component: set
//!    constants, set inputs from the bus, read outputs. `fmi2ExitInitializationMode` on all; read
//!    the outputs of all.
//! 4. Record. Step k goes from start + k*step: input series of that time; sequential: component by component set
//!    inputs, `fmi2DoStep`, read outputs; Jacobi: set the inputs of all, step all, read all.
//!    Record every n-th step.
//! 5. `fmi2Terminate`, `fmi2FreeInstance`.
//!
//! Inputs and outputs of a component are set and read by one call per base type: Real, Integer, Boolean. The bus holds
//! doubles. A Boolean output is 0 or 1 there, and a Boolean input is true where its slot is above 0.5. That is also how a
//! connection converts between Real and Boolean.

use crate::fmus::{FmusError, Instances};
use crate::limits;
use crate::run::{self, Order, Run, Setting, Simulation, Wire};
use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Value};
use fmu_import::loader::{CallError, Instance, Message, calls};
use std::time::Instant;

/// A run that failed. It has no results.
#[derive(Debug, thiserror::Error)]
#[error("run {run}{}: {cause}", time.map_or(String::new(), |t| format!(", step from {t} s")))]
pub struct RunError {
    /// Id of the run.
    pub run: String,
    /// Start of the step that failed, s; `None` before the first step.
    pub time: Option<f64>,
    /// Component, function, status and what the component logged.
    pub cause: Box<FmusError>,
}

/// Recorded signals of a run.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Time of each row, s.
    pub time: Vec<f64>,
    /// Values of each of the columns of the run; `None` where the case leaves the component out.
    pub columns: Vec<Option<Vec<f64>>>,
    /// What the components logged although all went well, with the name of the component: warnings.
    pub messages: Vec<(String, Message)>,
    /// Time the run took, instantiation included, s.
    pub seconds: f64,
}

impl Recording {
    /// Values of a column of the plan.
    #[must_use]
    pub fn column(&self, index: usize) -> Option<&[f64]> {
        self.columns.get(index)?.as_deref()
    }
}

/// The columns of a run and the slots they record, in memory that is reserved before the first step.
struct Recorder {
    time: Vec<f64>,
    columns: Vec<(usize, Vec<f64>)>,
}

impl Recorder {
    fn new(simulation: &Simulation, run: &Run) -> Self {
        let slots: Vec<usize> = run.columns.iter().copied().flatten().collect();
        // A plan does not exceed the limit. A caller that does reserves no more, and its columns grow.
        let most = limits::RECORDED / (slots.len() as u64 + 1);
        let rows = usize::try_from((simulation.steps / simulation.every + 1).min(most)).unwrap_or(0);
        let columns = slots.into_iter().map(|slot| (slot, Vec::with_capacity(rows))).collect();
        Self { time: Vec::with_capacity(rows), columns }
    }

    fn push(&mut self, time: f64, bus: &[f64]) {
        self.time.push(time);
        for (slot, column) in &mut self.columns {
            column.push(bus[*slot]);
        }
    }

    fn finish(self, run: &Run) -> Recording {
        let mut recorded = self.columns.into_iter();
        let columns = run.columns.iter().map(|slot| slot.and_then(|_| recorded.next()).map(|(_, column)| column));
        Recording { time: self.time, columns: columns.collect(), messages: Vec::new(), seconds: 0.0 }
    }
}

/// Variables of one base type, set or read by one call.
struct Group<T> {
    references: Vec<Reference>,
    slots: Vec<usize>,
    values: Vec<T>,
}

impl<T: Copy + Default> Group<T> {
    fn new(wires: &[Wire], base_type: BaseType) -> Self {
        let of_type = || wires.iter().filter(|w| w.base_type == base_type);
        Self {
            references: of_type().map(|w| w.reference).collect(),
            slots: of_type().map(|w| w.slot).collect(),
            values: vec![T::default(); of_type().count()],
        }
    }

    fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    fn load(&mut self, bus: &[f64], convert: impl Fn(f64) -> T) {
        for (value, slot) in self.values.iter_mut().zip(&self.slots) {
            *value = convert(bus[*slot]);
        }
    }

    fn store(&self, bus: &mut [f64], convert: impl Fn(T) -> f64) {
        for (value, slot) in self.values.iter().zip(&self.slots) {
            bus[*slot] = convert(*value);
        }
    }
}

/// The wires of a component in one direction.
struct Port {
    reals: Group<f64>,
    integers: Group<i32>,
    booleans: Group<i32>,
}

impl Port {
    fn new(wires: &[Wire]) -> Self {
        Self {
            reals: Group::new(wires, BaseType::Real),
            integers: Group::new(wires, BaseType::Integer),
            booleans: Group::new(wires, BaseType::Boolean),
        }
    }
}

/// An instance with its wires.
struct Member {
    instance: Instance,
    inputs: Port,
    outputs: Port,
}

impl Member {
    fn set(&mut self, setting: &Setting) -> Result<(), CallError> {
        let references = [setting.reference];
        match &setting.value {
            Value::Real(v) => self.instance.set_real(&references, &[*v]),
            Value::Integer(v) => self.instance.set_integer(&references, &[*v]),
            Value::Boolean(v) => self.instance.set_boolean(&references, &[i32::from(*v)]),
            Value::String(v) => self.instance.set_string(&references, &[v]),
        }
    }

    fn set_inputs(&mut self, bus: &[f64]) -> Result<(), CallError> {
        let Self { instance, inputs, .. } = self;
        if !inputs.reals.is_empty() {
            inputs.reals.load(bus, |v| v);
            instance.set_real(&inputs.reals.references, &inputs.reals.values)?;
        }
        if !inputs.integers.is_empty() {
            // Exact: the bus holds what an integer output or a checked input series put there.
            inputs.integers.load(bus, |v| v as i32);
            instance.set_integer(&inputs.integers.references, &inputs.integers.values)?;
        }
        if !inputs.booleans.is_empty() {
            inputs.booleans.load(bus, |v| i32::from(v > 0.5));
            instance.set_boolean(&inputs.booleans.references, &inputs.booleans.values)?;
        }
        Ok(())
    }

    fn read_outputs(&mut self, bus: &mut [f64]) -> Result<(), CallError> {
        let Self { instance, outputs, .. } = self;
        if !outputs.reals.is_empty() {
            instance.get_real(&outputs.reals.references, &mut outputs.reals.values)?;
            outputs.reals.store(bus, |v| v);
        }
        if !outputs.integers.is_empty() {
            instance.get_integer(&outputs.integers.references, &mut outputs.integers.values)?;
            outputs.integers.store(bus, f64::from);
        }
        if !outputs.booleans.is_empty() {
            instance.get_boolean(&outputs.booleans.references, &mut outputs.booleans.values)?;
            outputs.booleans.store(bus, |v| f64::from(u8::from(v != 0)));
        }
        Ok(())
    }
}

/// Signals from a file and the row each is at.
struct Feeder<'a> {
    series: Vec<(&'a run::InputSeries, usize)>,
    slack: f64,
}

impl Feeder<'_> {
    /// Puts the values of a time onto the bus. Times must rise from call to call.
    fn feed(&mut self, time: f64, bus: &mut [f64]) {
        for (feed, row) in &mut self.series {
            while feed.times.get(*row + 1).is_some_and(|next| *next <= time + self.slack) {
                *row += 1;
            }
            if let Some(value) = feed.values.get(*row) {
                bus[feed.slot] = *value;
            }
        }
    }
}

/// Executes a run in this process and returns its signals in memory.
///
/// # Errors
/// An FMU cannot be loaded or instantiated, or a call returns more than `fmi2Warning`.
pub fn execute(simulation: &Simulation, run: &Run, fmus: &dyn Instances) -> Result<Recording, RunError> {
    let failed = |time, cause: FmusError| RunError { run: run.id.clone(), time, cause: Box::new(cause) };
    let began = Instant::now();
    let board = calls::board();
    if let Some(board) = board {
        board.begin();
    }
    let mut members = instantiate(run, fmus).map_err(|error| failed(None, error))?;
    let mut bus = vec![0.0; run.slots];
    let mut feeder =
        Feeder { series: run.series.iter().map(|feed| (feed, 0)).collect(), slack: 1e-9 * simulation.step };
    initialize(simulation, run, &mut members, &mut bus, &mut feeder).map_err(|error| failed(None, error.into()))?;

    let mut recorder = Recorder::new(simulation, run);
    // Product, then sum: no error piles up, and every master gets the same bits.
    let time_of = |step: u64| simulation.start + step as f64 * simulation.step;
    recorder.push(simulation.start, &bus);
    for k in 0..simulation.steps {
        let time = time_of(k);
        if let Some(board) = board {
            board.step(time, k);
        }
        feeder.feed(time, &mut bus);
        step(simulation, time, &mut members, &mut bus).map_err(|error| failed(Some(time), error.into()))?;
        if (k + 1) % simulation.every == 0 {
            recorder.push(time_of(k + 1), &bus);
        }
    }
    if let Some(board) = board {
        board.step(simulation.stop, simulation.steps);
    }
    let mut recording = recorder.finish(run);
    for member in &mut members {
        member.instance.terminate().map_err(|error| failed(Some(simulation.stop), error.into()))?;
        let messages = member.instance.take_messages();
        let component = member.instance.name();
        recording.messages.extend(messages.into_iter().map(|m| (component.to_string(), m)));
    }
    recording.seconds = began.elapsed().as_secs_f64();
    Ok(recording)
}

fn instantiate(run: &Run, fmus: &dyn Instances) -> Result<Vec<Member>, FmusError> {
    run.components
        .iter()
        .enumerate()
        .map(|(index, component)| {
            if let Some(board) = calls::board() {
                board.component(index);
            }
            Ok(Member {
                instance: fmus.of(component)?,
                inputs: Port::new(&component.inputs),
                outputs: Port::new(&component.outputs),
            })
        })
        .collect()
}

/// From instantiation to the end of initialization; see the top of this file.
fn initialize(
    simulation: &Simulation,
    run: &Run,
    members: &mut [Member],
    bus: &mut [f64],
    feeder: &mut Feeder<'_>,
) -> Result<(), CallError> {
    for member in members.iter_mut() {
        member.instance.setup_experiment(simulation.start, Some(simulation.stop))?;
    }
    for (member, component) in members.iter_mut().zip(&run.components) {
        for parameter in &component.parameters {
            member.set(parameter)?;
        }
    }
    for member in members.iter_mut() {
        member.instance.enter_initialization_mode()?;
    }
    feeder.feed(simulation.start, bus);
    for member in members.iter_mut() {
        member.read_outputs(bus)?;
    }
    for (member, component) in members.iter_mut().zip(&run.components) {
        for constant in &component.constants {
            member.set(constant)?;
        }
        member.set_inputs(bus)?;
        member.read_outputs(bus)?;
    }
    for member in members.iter_mut() {
        member.instance.exit_initialization_mode()?;
    }
    for member in members.iter_mut() {
        member.read_outputs(bus)?;
    }
    Ok(())
}

fn step(simulation: &Simulation, time: f64, members: &mut [Member], bus: &mut [f64]) -> Result<(), CallError> {
    match simulation.order {
        Order::Sequential => {
            for member in members {
                member.set_inputs(bus)?;
                member.instance.do_step(time, simulation.step)?;
                member.read_outputs(bus)?;
            }
        }
        Order::Jacobi => {
            for member in members.iter_mut() {
                member.set_inputs(bus)?;
            }
            for member in members.iter_mut() {
                member.instance.do_step(time, simulation.step)?;
            }
            for member in members.iter_mut() {
                member.read_outputs(bus)?;
            }
        }
    }
    Ok(())
}
