//! A simulation that is advanced step by step. [`master`](crate::master) makes all steps of a run with it.
//!
//! Components are stepped with a fixed communication step, either one after the other (Gauss-Seidel) or all at once
//! from the outputs of the previous step (Jacobi); see [`Order`]. The sequence of calls is part of the plan's meaning:
//! another master that makes the same calls gets bit-identical results.
//!
//! The functions below are those of FMI 2.0. A component of FMI 3.0 gets the calls that do the same, in the same
//! places: `fmi3EnterInitializationMode` takes the times of `fmi2SetupExperiment`, and early return is not used. Event
//! Mode is used for clocks only: a component handles its ticks within its step, but components whose clocks or clocked
//! variables are connected make their steps and events together, in the place of the first of them (`events.rs`).
//!
//! 1. Instantiate all components, `fmi2SetupExperiment` without tolerance and with the stop time.
//! 2. Set the parameters, then the start values of a steady state, `fmi2EnterInitializationMode` on all.
//! 3. Set the bus to 0 and write the input series at the start time. Read the outputs of all components. Then, in the
//!    order of the plan, each component after those on whose outputs it depends: set constants, set inputs from the
//!    bus, read outputs; algebraic loops are solved (`start.rs`). `fmi2ExitInitializationMode` on all; read the outputs
//!    of all.
//! 4. Step k starts at start + k*step. Write the input series: linear ones at the middle of the step, others at its
//!    start. Sequential: component by component set inputs, `fmi2DoStep`, read outputs. Jacobi: set the inputs of all,
//!    step all, read all. The step size is constant, except if start + k*step + step exceeds the stop time in double
//!    arithmetic: that step ends at the stop time.
//! 5. `fmi2Terminate`, `fmi2FreeInstance`.
//!
//! An input that the caller overwrites ([`Session::overwrite`]) gets its value right after the inputs of its component
//! are set from the bus.
//!
//! Inputs and outputs of a component are set and read by one call per base type: Real, Integer, Boolean. The bus holds
//! doubles. UInt32 has a separate call, as do Int64 and UInt64, whose slots also hold the exact value. Binary outputs
//! are read by one call, Binary inputs are set by one call each. On the bus, a Boolean output is 0 or 1, and a Boolean
//! input is true if its slot is above 0.5. Connections between Real and Boolean are converted in the same way. A Real
//! input in another unit than its output gets the converted value.

mod control;
mod events;
mod rates;
mod start;

use self::control::Coupling;
use self::events::{Group as ClockedGroup, Signals};
use self::rates::{Interval, Memory};
use crate::failure::{Failure, FailureKind};
use crate::fmus::{FmusError, Instances};
use crate::parameter;
use crate::run::{
    Binaries, Evaluation, Exact, InputSeries, Interpolation, Linear, Order, Run, Setting, Simulation, StepCounts, Wire,
};
use fmu_import::bytes::BinaryText;
use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Causality, Value, Variability, Variable};
use fmu_import::loader::calls::{self, Board};
use fmu_import::loader::{CallError, CallProblem, Instance, Message, SavedState, Status, WholeNumber};
use std::collections::BTreeMap;

/// Tolerance, in steps, for the time that an FMU reports at the end of a step: FMUs add up step sizes, which are
/// rounded.
const STEP_SLACK: f64 = 1e-6;

const HELP_DISCARDED: &str = "; choose a smaller `step`; only `chassis run` repeats a step in shorter ones, if all FMUs can \
                              save their state and make steps of any size";

/// Variables of one base type, set or read by one call.
struct Group<T> {
    references: Vec<Reference>,
    slots: Vec<usize>,
    values: Vec<T>,
    /// Conversions by the index of the variable.
    conversions: Vec<(usize, Linear)>,
}

impl<T: Clone + Default> Group<T> {
    fn new(wires: &[Wire], is_own: impl Fn(&Wire) -> bool) -> Self {
        let of_type = || wires.iter().filter(|wire| is_own(wire));
        Self {
            references: of_type().map(|w| w.reference).collect(),
            slots: of_type().map(|w| w.slot).collect(),
            values: vec![T::default(); of_type().count()],
            conversions: of_type().enumerate().filter_map(|(i, wire)| Some((i, wire.conversion?))).collect(),
        }
    }

    fn load(&mut self, bus: &[f64], mut convert: impl FnMut(f64) -> T) {
        for (value, slot) in self.values.iter_mut().zip(&self.slots) {
            *value = convert(bus[*slot]);
        }
    }

    fn set(
        &self,
        instance: &mut Instance,
        set: impl FnOnce(&mut Instance, &[Reference], &[T]) -> Result<(), CallError>,
    ) -> Result<(), CallError> {
        if self.slots.is_empty() { Ok(()) } else { set(instance, &self.references, &self.values) }
    }

    /// Reads the variables and puts them on the bus.
    fn read(
        &mut self,
        instance: &mut Instance,
        bus: &mut [f64],
        get: impl FnOnce(&mut Instance, &[Reference], &mut [T]) -> Result<(), CallError>,
        convert: impl Fn(&T) -> f64,
    ) -> Result<(), CallError> {
        if self.slots.is_empty() {
            return Ok(());
        }
        get(instance, &self.references, &mut self.values)?;
        for (value, slot) in self.values.iter().zip(&self.slots) {
            bus[*slot] = convert(value);
        }
        Ok(())
    }
}

/// The signals of a run, by slot.
#[derive(Debug, Clone)]
struct Bus {
    /// Numbers; for a Binary, its size in bytes.
    numbers: Vec<f64>,
    /// Values of the slots that Int64 and UInt64 outputs write; empty if there are none.
    exact: Vec<Option<i128>>,
    /// Values of the slots that Binary outputs write; empty if there are none.
    binaries: Vec<Option<Vec<u8>>>,
}

impl Bus {
    fn new(slots: usize, members: &[Component]) -> Self {
        let special = || members.iter().filter_map(|member| member.outputs.special.as_deref());
        let exact: Vec<usize> = special().flat_map(|special| &special.exact.slots).copied().collect();
        let binaries: Vec<usize> = special().flat_map(|special| &special.binaries.slots).copied().collect();
        let mut bus = Self {
            numbers: vec![0.0; slots],
            exact: vec![None; if exact.is_empty() { 0 } else { slots }],
            binaries: vec![None; if binaries.is_empty() { 0 } else { slots }],
        };
        exact.into_iter().for_each(|slot| bus.exact[slot] = Some(0));
        binaries.into_iter().for_each(|slot| bus.binaries[slot] = Some(Vec::new()));
        bus
    }

    /// Takes all values from another bus of the same run.
    fn take(&mut self, other: &Self) {
        self.numbers.clone_from(&other.numbers);
        self.exact.clone_from(&other.exact);
        self.binaries.clone_from(&other.binaries);
    }

    /// Takes the value of a slot from another bus of the same run.
    fn copy(&mut self, slot: usize, other: &Self) {
        self.numbers[slot] = other.numbers[slot];
        if let Some(whole) = self.exact.get_mut(slot) {
            *whole = other.exact[slot];
        }
        if let Some(binary) = self.binaries.get_mut(slot) {
            binary.clone_from(&other.binaries[slot]);
        }
    }

    /// Returns true if a slot has the same value on another bus of the same run.
    fn is_same(&self, slot: usize, other: &Self) -> bool {
        self.numbers[slot].to_bits() == other.numbers[slot].to_bits()
            && self.exact.get(slot) == other.exact.get(slot)
            && self.binaries.get(slot) == other.binaries.get(slot)
    }

    /// The whole number in a slot; `None` if it is not one, or a double above 2^53.
    fn whole(&self, slot: usize) -> Option<i128> {
        self.exact.get(slot).copied().flatten().or_else(|| self.numbers[slot].whole())
    }

    /// The value in a slot that a Binary output writes.
    fn binary(&self, slot: usize) -> &[u8] {
        self.binaries.get(slot).and_then(Option::as_deref).unwrap_or_default()
    }

    /// Memory for the exact values of a slot; `None` if doubles represent them.
    fn exact_values(&self, slot: usize, rows: usize, text: BinaryText) -> Option<Exact> {
        if self.exact.get(slot).is_some_and(Option::is_some) {
            return Some(Exact::Integers(Vec::with_capacity(rows)));
        }
        let is_binary = self.binaries.get(slot).is_some_and(Option::is_some);
        is_binary.then(|| Exact::Binaries { text, values: Binaries::with_rows(rows) })
    }

    /// Appends the value of a slot to its exact values.
    fn record(&self, slot: usize, values: &mut Exact) {
        match values {
            Exact::Integers(values) => values.push(self.whole(slot).unwrap_or_default()),
            Exact::Binaries { values, .. } => values.push(self.binary(slot)),
        }
    }
}

/// The wires of a component in one direction.
struct Port {
    reals: Group<f64>,
    integers: Group<i32>,
    /// Integers of the type UInt32.
    wide: Group<f64>,
    booleans: Group<i32>,
    /// Variables with values that a double cannot represent; `None` if there are none.
    special: Option<Box<Special>>,
}

struct Special {
    /// Integers of the types Int64 and UInt64.
    exact: Group<i128>,
    binaries: Group<Vec<u8>>,
}

impl Port {
    fn new(instance: &Instance, wires: &[Wire]) -> Self {
        let of = |base_type| move |wire: &Wire| wire.base_type == base_type;
        let is_exact = |wire: &Wire| of(BaseType::Integer)(wire) && instance.is_exact(wire.reference);
        let is_wide = |wire: &Wire| of(BaseType::Integer)(wire) && instance.is_wide(wire.reference);
        let special = Special { exact: Group::new(wires, is_exact), binaries: Group::new(wires, of(BaseType::Binary)) };
        let has_special = !special.exact.slots.is_empty() || !special.binaries.slots.is_empty();
        Self {
            reals: Group::new(wires, of(BaseType::Real)),
            integers: Group::new(wires, |wire| of(BaseType::Integer)(wire) && !is_wide(wire)),
            wide: Group::new(wires, |wire| is_wide(wire) && !is_exact(wire)),
            booleans: Group::new(wires, of(BaseType::Boolean)),
            special: has_special.then(|| Box::new(special)),
        }
    }
}

/// The end of a step that an FMU has reached when it ends the simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Reached {
    Start,
    End,
}

/// Result of a step: if the component ends the simulation, the time that it has reached, and the call.
type Stepped<E> = Result<Option<(Reached, CallError)>, E>;

struct Component {
    instance: Instance,
    inputs: Port,
    outputs: Port,
    /// Slots of the outputs and their names.
    names: Vec<(usize, String)>,
}

impl Component {
    fn set(&mut self, setting: &Setting) -> Result<(), CallError> {
        self.instance.set_value(setting.reference, &setting.value)
    }

    fn set_inputs(&mut self, bus: &Bus) -> Result<(), CallError> {
        self.load_reals(bus);
        self.set_reals()?;
        self.set_others(bus)
    }

    /// Takes the values of the Real inputs from the bus.
    fn load_reals(&mut self, bus: &Bus) {
        let reals = &mut self.inputs.reals;
        reals.load(&bus.numbers, |v| v);
        for (i, conversion) in &reals.conversions {
            reals.values[*i] = conversion.of(reals.values[*i]);
        }
    }

    fn set_reals(&mut self) -> Result<(), CallError> {
        self.inputs.reals.set(&mut self.instance, Instance::set_real)
    }

    /// Sets the inputs that are not Real.
    fn set_others(&mut self, bus: &Bus) -> Result<(), CallError> {
        let Self { instance, inputs, .. } = self;
        let numbers = &bus.numbers[..];
        let mut are_exact = true;
        inputs.integers.load(numbers, |v| {
            let value = v as i32;
            are_exact &= f64::from(value) == v;
            value
        });
        if !are_exact {
            return set_exactly(instance, &inputs.integers, numbers);
        }
        inputs.integers.set(instance, Instance::set_integer)?;
        inputs.wide.load(numbers, |v| v);
        inputs.wide.set(instance, Instance::set_integer)?;
        inputs.booleans.load(numbers, |v| i32::from(v > 0.5));
        inputs.booleans.set(instance, Instance::set_boolean)?;
        match &mut inputs.special {
            None => Ok(()),
            Some(special) => special.set(instance, bus),
        }
    }

    /// Sets the inputs of the component with this index to the values of the caller.
    fn set_overwritten(&mut self, index: usize, inputs: &[Overwritten]) -> Result<(), CallError> {
        for input in inputs.iter().filter(|input| input.member == index) {
            let (references, Some(value)) = ([input.reference], input.value) else { continue };
            match input.base_type {
                BaseType::Real => self.instance.set_real(&references, &[value])?,
                BaseType::Integer => self.instance.set_integer(&references, &[value.trunc()])?,
                BaseType::Boolean => self.instance.set_boolean(&references, &[i32::from(value > 0.5)])?,
                BaseType::String | BaseType::Binary => (),
            }
        }
        Ok(())
    }

    fn do_step(&mut self, time: f64, step: f64) -> Stepped<CallError> {
        match self.instance.do_step(time, step).and_then(|()| self.instance.check_reached(time, step)) {
            Ok(()) => Ok(None),
            Err(error) => self.ended(error, time + step, step),
        }
    }

    /// Finds out whether a failed step ended the simulation; otherwise returns the error.
    #[cold]
    fn ended(&mut self, mut error: CallError, end: f64, step: f64) -> Stepped<CallError> {
        let may_end = matches!(error.problem, CallProblem::Status(Status::Discard) | CallProblem::Terminated);
        if !may_end || !self.instance.wants_termination().is_ok_and(|is_wanted| is_wanted) {
            return Err(error);
        }
        let is_done = |reached: f64| (reached - end).abs() <= STEP_SLACK * step;
        let reached =
            if self.instance.last_successful_time().is_ok_and(is_done) { Reached::End } else { Reached::Start };
        error.problem = CallProblem::Terminated;
        Ok(Some((reached, error)))
    }

    fn read_outputs(&mut self, bus: &mut Bus) -> Result<(), CallError> {
        let Self { instance, outputs, .. } = self;
        let numbers = &mut bus.numbers[..];
        outputs.reals.read(instance, numbers, Instance::get_real, |v| *v)?;
        outputs.integers.read(instance, numbers, Instance::get_integer, |v| f64::from(*v))?;
        outputs.wide.read(instance, numbers, Instance::get_integer, |v| *v)?;
        outputs.booleans.read(instance, numbers, Instance::get_boolean, |v| f64::from(u8::from(*v != 0)))?;
        match &mut outputs.special {
            None => Ok(()),
            Some(special) => special.read(instance, bus),
        }
    }
}

impl Special {
    fn set(&mut self, instance: &mut Instance, bus: &Bus) -> Result<(), CallError> {
        for (value, slot) in self.exact.values.iter_mut().zip(&self.exact.slots) {
            let Some(whole) = bus.whole(*slot) else { return set_exactly(instance, &self.exact, &bus.numbers) };
            *value = whole;
        }
        self.exact.set(instance, Instance::set_integer)?;
        let mut binaries = self.binaries.references.iter().zip(&self.binaries.slots);
        binaries.try_for_each(|(reference, slot)| instance.set_binary(&[*reference], &[bus.binary(*slot)]))
    }

    fn read(&mut self, instance: &mut Instance, bus: &mut Bus) -> Result<(), CallError> {
        self.exact.read(instance, &mut bus.numbers, Instance::get_integer, |v| *v as f64)?;
        for (value, slot) in self.exact.values.iter().zip(&self.exact.slots) {
            bus.exact[*slot] = Some(*value);
        }
        self.binaries.read(instance, &mut bus.numbers, Instance::read_binary, |v| v.len() as f64)?;
        for (value, slot) in self.binaries.values.iter_mut().zip(&self.binaries.slots) {
            if let Some(own) = &mut bus.binaries[*slot] {
                std::mem::swap(own, value);
            }
        }
        Ok(())
    }
}

/// Sets Integers although a signal does not have a value of their type. Returns the error of the call.
#[cold]
fn set_exactly<T>(instance: &mut Instance, integers: &Group<T>, bus: &[f64]) -> Result<(), CallError> {
    let values: Vec<f64> = integers.slots.iter().map(|slot| bus[*slot]).collect();
    instance.set_integer(&integers.references, &values)
}

/// Tolerance, in steps, for the times of a held series: a sample at t_k applies even if t_k is rounded.
const SLACK: f64 = 1e-9;

struct Feeder {
    series: Vec<(InputSeries, usize)>,
    /// Communication step, s.
    step: f64,
}

impl Feeder {
    /// Writes the series to the bus: the values for `time`, linear ones some seconds `later`. Times must increase from
    /// call to call.
    fn feed(&mut self, time: f64, later: f64, bus: &mut [f64]) {
        for (feed, row) in &mut self.series {
            let at = match feed.interpolation {
                Interpolation::Linear => time + later,
                Interpolation::Hold => time + SLACK * self.step,
            };
            if let Some(value) = feed.at(at, row) {
                bus[feed.slot] = value;
            }
        }
    }

    /// Writes the slopes of linear series in a step, by slot, after [`Self::feed`]. A jump at the end of the step is not
    /// part of it.
    fn slopes(&self, time: f64, size: f64, bus: &[f64], slopes: &mut [f64]) {
        for (feed, row) in self.series.iter().filter(|(feed, _)| feed.interpolation == Interpolation::Linear) {
            let end = time + (1.0 - SLACK) * size;
            if let Some(value) = feed.at(end, &mut row.clone()) {
                slopes[feed.slot] = (value - bus[feed.slot]) / (end - time);
            }
        }
    }
}

/// An input whose value comes from the caller.
struct Overwritten {
    /// Index of the component.
    member: usize,
    name: String,
    reference: Reference,
    base_type: BaseType,
    /// Value as on the bus; `None` until the caller sets one.
    value: Option<f64>,
}

/// An input that the caller overwrites: see [`Session::overwrite`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Overwrite(usize);

/// A saved state of a session, valid only for that session.
#[derive(Debug)]
pub struct Saved {
    states: Vec<SavedState>,
    bus: Bus,
    rows: Vec<usize>,
    step: u64,
    overwritten: Vec<Option<f64>>,
    memory: Option<Memory>,
}

/// A run between two steps.
pub struct Session {
    run: String,
    simulation: Simulation,
    columns: Vec<Option<usize>>,
    members: Vec<Component>,
    /// Components whose clocks or clocked variables are connected.
    clocked: ClockedGroup,
    bus: Bus,
    feeder: Feeder,
    overwritten: Vec<Overwritten>,
    /// `None` if all components make one step per step of the run, with constant inputs.
    coupling: Option<Box<Coupling>>,
    /// Steps that are done.
    step: u64,
    board: Option<&'static Board>,
    /// A warning about the start, and messages from the call with which an FMU ended the simulation, with the name of
    /// the component.
    pub(crate) logged: Vec<(String, Message)>,
}

impl Session {
    /// Instantiates and initializes a run.
    ///
    /// # Errors
    /// An FMU cannot be loaded or instantiated, a call returns more than `fmi2Warning`, a component that starts in a
    /// steady state has none, or a signal is not finite.
    pub fn new(simulation: &Simulation, run: &Run, fmus: &dyn Instances) -> Result<Self, Failure> {
        if run.needs_steady_starts() {
            let mut run = run.clone();
            run.find_steady_starts(simulation, fmus)?;
            return Self::initialized(simulation, &run, fmus)?.checked();
        }
        Self::initialized(simulation, run, fmus)?.checked()
    }

    /// Returns the session if all signals at the start are finite.
    fn checked(self) -> Result<Self, Failure> {
        self.check_bus(self.simulation.start)?;
        Ok(self)
    }

    /// Instantiates and initializes a run, without searching for steady states.
    pub(crate) fn initialized(simulation: &Simulation, run: &Run, fmus: &dyn Instances) -> Result<Self, Failure> {
        let failed = |cause: FmusError| Failure::of(&run.id, None, cause);
        let board = calls::board();
        if let Some(board) = board {
            board.begin();
        }
        let mut members = instantiate(run, fmus).map_err(failed)?;
        let mut session = Self {
            run: run.id.clone(),
            simulation: *simulation,
            columns: run.columns.clone(),
            bus: Bus::new(run.slots, &members),
            clocked: ClockedGroup::new(run, &mut members),
            members,
            feeder: Feeder { series: run.series.iter().map(|feed| (feed.clone(), 0)).collect(), step: simulation.step },
            overwritten: Vec::new(),
            coupling: Coupling::of(simulation, run, false),
            step: 0,
            board,
            logged: Vec::new(),
        };
        session.initialize(run).map_err(failed)?;
        Ok(session)
    }

    /// Number of steps that are done.
    pub fn steps(&self) -> u64 {
        self.step
    }

    /// Time, s.
    pub fn time(&self) -> f64 {
        self.simulation.time(self.step as f64)
    }

    /// Returns true if all steps are done.
    pub fn is_over(&self) -> bool {
        self.step >= self.simulation.steps
    }

    /// Repeats discarded steps with shorter ones.
    pub(crate) fn retry_steps(&mut self, run: &Run) {
        self.coupling = Coupling::of(&self.simulation, run, true);
    }

    /// Numbers of steps under error control, or with shorter steps instead of discarded ones.
    pub(crate) fn counts(&self) -> Option<StepCounts> {
        self.coupling.as_ref().map(|own| own.exchange.counts).filter(|counts| *counts != StepCounts::default())
    }

    /// The signals at the current time.
    pub fn bus(&self) -> &[f64] {
        &self.bus.numbers
    }

    /// Memory for the exact values of the columns that doubles cannot represent.
    pub(crate) fn exact_columns(&self, rows: usize, text: BinaryText) -> BTreeMap<usize, Exact> {
        let recorded = self.columns.iter().enumerate().filter_map(|(column, slot)| Some((column, (*slot)?)));
        recorded.filter_map(|(column, slot)| Some((column, self.bus.exact_values(slot, rows, text)?))).collect()
    }

    /// Appends the current values to columns from [`Self::exact_columns`].
    pub(crate) fn record_exact(&self, columns: &mut BTreeMap<usize, Exact>) {
        for (column, values) in columns {
            if let Some(slot) = self.columns.get(*column).copied().flatten() {
                self.bus.record(slot, values);
            }
        }
    }

    /// Value of a column of the plan; `None` if the run does not record it.
    pub fn column(&self, index: usize) -> Option<f64> {
        let slot = self.columns.get(index).copied().flatten()?;
        self.bus.numbers.get(slot).copied()
    }

    /// Lets the caller set the values of an input. The input's connection, series or constant applies until the first
    /// [`Self::set`].
    ///
    /// # Errors
    /// The run has no such component, or the variable is not a scalar Real, Integer or Boolean input.
    pub fn overwrite(&mut self, component: &str, variable: &Variable) -> Result<Overwrite, String> {
        let Some(member) = self.members.iter().position(|member| member.instance.name() == component) else {
            return Err(parameter::no_component(component));
        };
        let name = &variable.name;
        let reason = if variable.causality != Causality::Input {
            format!("`{name}` is {}; only inputs can be overwritten", parameter::role(variable))
        } else if variable.is_array() {
            format!("`{name}` is an array of {} elements; only scalars can be overwritten", variable.size)
        } else if !variable.base_type.is_number() {
            format!("`{name}` is a {}; only Real, Integer and Boolean inputs can be overwritten", variable.base_type)
        } else {
            let Variable { reference, base_type, .. } = *variable;
            self.overwritten.push(Overwritten { member, name: name.clone(), reference, base_type, value: None });
            return Ok(Overwrite(self.overwritten.len() - 1));
        };
        Err(format!("`{component}`: {reason}"))
    }

    /// Sets the value of an input from the next step on. As on the bus, a Boolean is true above 0.5, and an Integer is
    /// rounded toward zero.
    pub fn set(&mut self, input: Overwrite, value: f64) {
        if let Some(overwritten) = self.overwritten.get_mut(input.0) {
            overwritten.value = Some(value);
        }
    }

    /// Sets a tunable parameter now.
    ///
    /// # Errors
    /// The run has no such component, the variable is not a tunable parameter, or the FMU returns an error.
    pub fn tune(&mut self, component: &str, variable: &Variable, value: Value) -> Result<(), String> {
        let rejected = |reason: String| format!("`{component}`: {reason}");
        let Some(member) = self.members.iter_mut().find(|member| member.instance.name() == component) else {
            return Err(parameter::no_component(component));
        };
        if variable.causality != Causality::Parameter || variable.variability != Variability::Tunable {
            return Err(rejected(format!("`{}` is not a tunable parameter", variable.name)));
        }
        member.set(&Setting::new(variable, value)).map_err(|error| rejected(error.to_string()))
    }

    /// Makes a step. Nothing is allocated unless it fails. A session that has failed can be restored.
    ///
    /// # Errors
    /// A call returns more than `fmi2Warning`, or a signal or the value of an overwritten input is not finite. If an
    /// FMU ends the simulation ([`FailureKind::Terminated`]) at the end of the
    /// step, all components have made the step, and [`Self::steps`] counts it.
    pub fn step(&mut self) -> Result<(), Failure> {
        let time = self.time();
        self.check_overwritten(time)?;
        if let Some(board) = self.board {
            board.step(time, self.step);
        }
        let ended = self.step_all(time).map_err(|error| self.failed(Some(time), error))?;
        if let Some((Reached::Start, error)) = ended {
            return Err(self.failed(Some(time), error));
        }
        self.step += 1;
        self.check_bus(self.time())?;
        let Some((_, error)) = ended else { return Ok(()) };
        let messages = error.messages.iter().map(|message| (error.instance.clone(), message.clone()));
        self.logged.extend(messages);
        Err(self.failed(Some(self.time()), error))
    }

    fn check_bus(&self, time: f64) -> Result<(), Failure> {
        // No early exit, so that the loop is vectorized.
        let is_finite = self.bus.numbers.iter().fold(true, |all, value| all & value.is_finite());
        if is_finite { Ok(()) } else { Err(self.not_finite(time)) }
    }

    #[cold]
    fn not_finite(&self, time: f64) -> Failure {
        let slot = self.bus.numbers.iter().position(|value| !value.is_finite()).unwrap_or_default();
        let (component, variable) = output_in(&self.members, slot).unwrap_or(("", "input series"));
        let (component, variable) = (component.to_owned(), variable.to_owned());
        Failure::of(&self.run, Some(time), FmusError::NotFinite { component, variable, value: self.bus.numbers[slot] })
    }

    fn check_overwritten(&self, time: f64) -> Result<(), Failure> {
        let bad = self.overwritten.iter().find(|input| input.value.is_some_and(|value| !value.is_finite()));
        let Some(Overwritten { member, name, value: Some(value), .. }) = bad else { return Ok(()) };
        let component = self.members[*member].instance.name().to_owned();
        let cause = FmusError::NotFinite { component, variable: name.clone(), value: *value };
        Err(Failure::of(&self.run, Some(time), cause))
    }

    /// Saves the FMU states of all components, the signals and the overwritten inputs.
    pub fn save(&mut self) -> Result<Saved, Failure> {
        let states: Result<_, CallError> = self.members.iter_mut().map(|member| member.instance.save_state()).collect();
        Ok(Saved {
            states: states.map_err(|error| self.failed(Some(self.time()), error))?,
            bus: self.bus.clone(),
            rows: self.feeder.series.iter().map(|(_, row)| *row).collect(),
            step: self.step,
            overwritten: self.overwritten.iter().map(|input| input.value).collect(),
            memory: self.coupling.as_ref().map(|coupling| coupling.exchange.memory.clone()),
        })
    }

    /// Restores a saved state, from an earlier or a later time. An input that was overwritten since then gets its
    /// previous source again.
    ///
    /// # Errors
    /// The state is of another session, or an FMU returns an error.
    pub fn restore(&mut self, saved: &Saved) -> Result<(), Failure> {
        let restored: Result<(), CallError> = self
            .members
            .iter_mut()
            .zip(&saved.states)
            .try_for_each(|(member, state)| member.instance.restore_state(state));
        restored.map_err(|error| self.failed(Some(self.time()), error))?;
        self.bus.clone_from(&saved.bus);
        for ((_, row), before) in self.feeder.series.iter_mut().zip(&saved.rows) {
            *row = *before;
        }
        let values = saved.overwritten.iter().copied().chain(std::iter::repeat(None));
        for (input, value) in self.overwritten.iter_mut().zip(values) {
            input.value = value;
        }
        if let (Some(coupling), Some(memory)) = (&mut self.coupling, &saved.memory) {
            coupling.exchange.memory.clone_from(memory);
        }
        self.step = saved.step;
        Ok(())
    }

    /// Frees a state.
    pub fn free(&mut self, saved: Saved) -> Result<(), Failure> {
        let freed: Result<(), CallError> =
            self.members.iter_mut().zip(saved.states).try_for_each(|(member, state)| member.instance.free_state(state));
        freed.map_err(|error| self.failed(Some(self.time()), error))
    }

    /// Ends the run. Returns the warnings of a successful run, with the component's name.
    ///
    /// # Errors
    /// A call returns more than `fmi2Warning`.
    pub fn terminate(mut self) -> Result<Vec<(String, Message)>, Failure> {
        let time = self.time();
        if let Some(board) = self.board {
            board.step(time, self.step);
        }
        let mut logged = std::mem::take(&mut self.logged);
        for member in &mut self.members {
            member.instance.terminate().map_err(|error| Failure::of(&self.run, Some(time), error))?;
            let messages = member.instance.take_messages();
            let component = member.instance.name();
            logged.extend(messages.into_iter().map(|message| (component.to_owned(), message)));
        }
        Ok(logged)
    }

    #[cold]
    fn failed(&self, time: Option<f64>, error: impl Into<FmusError>) -> Failure {
        let mut failure = Failure::of(&self.run, time, error);
        if failure.kind == FailureKind::Discarded && self.coupling.as_ref().is_none_or(|own| own.retry.is_none()) {
            // Log messages follow on further lines.
            let end = failure.message.find('\n').unwrap_or(failure.message.len());
            failure.message.insert_str(end, HELP_DISCARDED);
        }
        failure
    }

    /// From instantiation to the end of initialization; see the top of this file.
    fn initialize(&mut self, run: &Run) -> Result<(), FmusError> {
        let Self { simulation, members, clocked, bus, feeder, overwritten, logged, .. } = self;
        for member in members.iter_mut() {
            member.instance.setup_experiment(simulation.start, Some(simulation.stop))?;
        }
        for (member, component) in members.iter_mut().zip(&run.components) {
            for start in component.parameters.iter().chain(component.steady.iter().flatten()) {
                member.set(start)?;
            }
        }
        for member in members.iter_mut() {
            member.instance.enter_initialization_mode()?;
        }
        feeder.feed(simulation.start, 0.0, &mut bus.numbers);
        for member in members.iter_mut() {
            member.read_outputs(bus)?;
        }
        let mut constants: Vec<&[Setting]> = run.components.iter().map(|c| &c.constants[..]).collect();
        for Evaluation { components, equations } in &run.initialization {
            for index in components {
                for constant in std::mem::take(&mut constants[*index]) {
                    members[*index].set(constant)?;
                }
            }
            match equations {
                None => start::evaluate(components, members, bus, None)?,
                Some(equations) => start::solve(equations, components, members, bus)?,
            }
        }
        let before = bus.numbers.clone();
        for member in members.iter_mut() {
            member.instance.exit_initialization_mode()?;
        }
        // Clocks that are due at the start tick in the first step.
        clocked.event(&mut Signals { members, bus, overwritten }, simulation.start, None)?;
        for member in members.iter_mut() {
            member.read_outputs(bus)?;
        }
        logged.extend(start::change(run, members, &before, &bus.numbers));
        Ok(())
    }

    /// Makes a step of all components. If a component ends the simulation, returns the time that it has reached, and
    /// the call.
    fn step_all(&mut self, time: f64) -> Stepped<FmusError> {
        let Self { simulation, members, clocked, bus, feeder, overwritten, coupling, step: done, .. } = self;
        let step = simulation.step_size(*done, time);
        if let Some(coupling) = coupling {
            let at = Interval { step: *done, time, size: step, end: simulation.time((*done + 1) as f64) };
            let ended = coupling.step(clocked, Signals { members, bus, overwritten }, feeder, at)?;
            return Ok(ended.map(|error| (Reached::End, error)));
        }
        feeder.feed(time, 0.5 * simulation.step, &mut bus.numbers);
        let (mut all, signals) = (0..members.len(), &mut Signals { members, bus, overwritten });
        let is_jacobi = simulation.order == Order::Jacobi;
        if is_jacobi {
            all.clone().try_for_each(|index| signals.set_inputs(index))?;
        }
        let mut ended = None;
        for index in all.clone() {
            if !is_jacobi {
                signals.set_inputs(index)?;
            }
            match clocked.step(index, signals, time, step)? {
                None => (),
                at_start @ Some((Reached::Start, _)) => return Ok(at_start),
                at_end => ended = ended.or(at_end),
            }
            if !is_jacobi {
                signals.read_outputs(index)?;
            }
        }
        if is_jacobi {
            all.try_for_each(|index| signals.read_outputs(index))?;
        }
        Ok(ended)
    }
}

/// The component and the name of the output that writes a slot.
fn output_in(members: &[Component], slot: usize) -> Option<(&str, &str)> {
    let mut outputs = members.iter().flat_map(|own| own.names.iter().map(move |name| (own.instance.name(), name)));
    outputs.find(|(_, (own, _))| *own == slot).map(|(component, (_, name))| (component, name.as_str()))
}

fn instantiate(run: &Run, fmus: &dyn Instances) -> Result<Vec<Component>, FmusError> {
    run.components
        .iter()
        .enumerate()
        .map(|(index, component)| {
            if let Some(board) = calls::board() {
                board.component(index);
            }
            let mut instance = fmus.of(component)?;
            if let Some(solver) = component.integration {
                instance.integrate(solver);
            }
            Ok(Component {
                inputs: Port::new(&instance, &component.inputs),
                outputs: Port::new(&instance, &component.outputs),
                instance,
                names: component.outputs.iter().map(|wire| (wire.slot, wire.name.clone())).collect(),
            })
        })
        .collect()
}
