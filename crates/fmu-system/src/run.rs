//! Runs: what a master executes.
//!
//! Signals travel on a *bus* of doubles per run: every connected or recorded output and every signal from a file has a
//! slot. Integers and Booleans are doubles there. For slots that an Int64, UInt64 or Binary writes, the bus also has the
//! exact value.

use fmu_import::bytes::BinaryText;
use fmu_import::c_api::Reference;
use fmu_import::description::{
    BaseType, FmiVersion, Interface, ModelDescription, StructuralParameters, Value, Variable,
};
use fmu_import::fmu::Binary;
use fmu_import::loader::{Message, Solver};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::collections::{BTreeMap, BTreeSet, HashSet};
use std::path::Path;
use std::sync::Arc;

/// Times, s, order of execution, and coupling.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Simulation {
    /// Start, s.
    pub start: f64,
    /// Stop, s.
    pub stop: f64,
    /// Communication step, s.
    pub step: f64,
    /// Number of steps.
    pub steps: u64,
    /// Order of the components.
    pub order: Order,
    /// Number of steps between two recorded rows, at least 1.
    pub every: u64,
    /// Inputs within a step.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(extend("default" = "hold"))]
    pub extrapolation: Extrapolation,
    /// Size of the steps that FMUs are asked to make.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(extend("default" = "constant"))]
    pub step_argument: StepArgument,
    /// Iteration of each step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub iterate: Option<Iteration>,
    /// Steps of continuous components that are chosen by their error.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error_control: Option<ErrorControl>,
}

impl Simulation {
    /// Time of a number of steps after the start, s. Product, then sum: no error accumulates, and the times of all
    /// masters are bit-identical. The last time is the stop time.
    pub(crate) fn time(&self, steps: f64) -> f64 {
        let time = self.start + steps * self.step;
        if time + 0.5 * self.step > self.stop { self.stop } else { time }
    }

    /// Size of the step that follows after a number of steps and starts at `time`, s: the communication step, or less
    /// if the stop time is nearer. An FMU may reject a step beyond its stop time, which `time` plus the communication
    /// step may exceed by rounding.
    pub(crate) fn step_size(&self, steps: u64, time: f64) -> f64 {
        match self.step_argument {
            StepArgument::Constant if time + self.step > self.stop => self.stop - time,
            StepArgument::Constant => self.step,
            StepArgument::Difference => self.time((steps + 1) as f64) - time,
        }
    }
}

/// Inputs within a step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Extrapolation {
    /// Constant.
    #[default]
    Hold,
    /// Lines: continuous components get the slopes of signals from continuous components.
    Linear,
}

/// Size of the steps that FMUs are asked to make.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StepArgument {
    /// The communication step.
    #[default]
    Constant,
    /// The difference of the times at its ends, for FMUs that compare times exactly.
    Difference,
}

/// Iteration of each step for the continuous components that depend on each other.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Iteration {
    /// Largest change of a signal in the last pass, relative to its value or its nominal value.
    pub tolerance: f64,
    /// Largest number of passes.
    pub limit: u64,
}

impl Default for Iteration {
    fn default() -> Self {
        Self { tolerance: 1e-6, limit: 10 }
    }
}

/// Choice of the steps of continuous components. The communication step is the largest of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ErrorControl {
    /// Error of a signal in a step, relative to its value or its nominal value.
    pub tolerance: f64,
    /// Smallest step, s; the communication step/1024 if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_step: Option<f64>,
    /// First step, s; the communication step/16 if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub initial_step: Option<f64>,
}

impl Default for ErrorControl {
    fn default() -> Self {
        Self { tolerance: 1e-4, min_step: None, initial_step: None }
    }
}

/// Numbers of steps under error control.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct StepCounts {
    /// Accepted steps.
    pub accepted: u64,
    /// Rejected steps.
    pub rejected: u64,
    /// Accepted steps whose error is above the tolerance, because they are the smallest.
    pub inaccurate: u64,
    /// Smallest accepted step, s.
    pub smallest: f64,
    /// Largest accepted step, s.
    pub largest: f64,
}

impl StepCounts {
    pub(crate) fn accept(&mut self, size: f64, is_inaccurate: bool) {
        self.smallest = if self.accepted == 0 { size } else { self.smallest.min(size) };
        self.largest = self.largest.max(size);
        self.inaccurate += u64::from(is_inaccurate);
        self.accepted += 1;
    }

    /// The numbers of two runs together.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            accepted: self.accepted + other.accepted,
            rejected: self.rejected + other.rejected,
            inaccurate: self.inaccurate + other.inaccurate,
            smallest: self.smallest.min(other.smallest),
            largest: self.largest.max(other.largest),
        }
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn one() -> u64 {
    1
}

fn is_one(count: &u64) -> bool {
    *count == 1
}

/// Execution order of the components of a system within a step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// One after the other; a component sees the new outputs of those before it (Gauss-Seidel).
    #[default]
    Sequential,
    /// All at once, with the outputs of the previous step.
    Jacobi,
    /// Sequential, in the order in which the fewest connections carry values of another time.
    Auto,
}

/// A run of one case at one point with one seed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Run {
    /// `case`, `case@point`, `case#seed` or `case@point#seed`.
    pub id: String,
    /// Name of the case.
    pub case: String,
    /// Name of the point.
    pub point: Option<String>,
    /// Seed.
    pub seed: Option<i32>,
    /// Components in order of execution.
    pub components: Vec<Component>,
    /// How their inputs and outputs get their values in Initialization Mode.
    pub initialization: Vec<Evaluation>,
    /// Signals from a file.
    pub series: Vec<InputSeries>,
    /// Number of bus slots.
    pub slots: usize,
    /// Slot of each column of the plan; `None` where the case leaves the component out.
    pub columns: Vec<Option<usize>>,
    /// Text of Binaries in the file of results; Base64 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub binary: Option<BinaryText>,
}

impl Run {
    /// Records only these columns.
    pub fn keep_columns(&mut self, needed: &BTreeSet<usize>) {
        for (_, slot) in self.columns.iter_mut().enumerate().filter(|(index, _)| !needed.contains(index)) {
            *slot = None;
        }
    }

    /// Indices of the continuous components.
    pub(crate) fn continuous(&self) -> Vec<usize> {
        (0..self.components.len()).filter(|index| !self.components[*index].is_discrete).collect()
    }

    /// The continuous components that depend on each other, by their indices.
    pub(crate) fn coupled(&self) -> Vec<Vec<usize>> {
        let members = self.continuous();
        let count = self.components.len();
        let reads = |from: usize, to: usize| {
            let inputs = &self.components[to].inputs;
            self.components[from].outputs.iter().any(|output| inputs.iter().any(|input| input.slot == output.slot))
        };
        let mut leads = vec![vec![false; count]; count];
        for from in &members {
            for to in &members {
                leads[*from][*to] = reads(*from, *to);
            }
        }
        close(&mut leads);
        let group = |first: usize| -> Vec<usize> {
            members.iter().copied().filter(|other| leads[first][*other] && leads[*other][first]).collect()
        };
        let groups = members.iter().map(|first| (first, group(*first)));
        groups.filter(|(first, group)| group.first() == Some(first)).map(|(_, group)| group).collect()
    }
}

/// Adds the paths of several edges to a graph.
pub(crate) fn close(leads: &mut [Vec<bool>]) {
    let all = 0..leads.len();
    for (via, from) in all.clone().flat_map(|via| all.clone().map(move |from| (via, from))) {
        if leads[from][via] {
            all.clone().for_each(|to| leads[from][to] |= leads[via][to]);
        }
    }
}

/// A part of the initialization: the inputs of components are set, then their outputs are read.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Evaluation {
    /// Indices of the components: one, or those of an algebraic loop.
    pub components: Vec<usize>,
    /// Equations of an algebraic loop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub equations: Option<AlgebraicLoop>,
}

impl Evaluation {
    /// The evaluation of one component.
    pub(crate) fn of(component: usize) -> Self {
        Self { components: vec![component], equations: None }
    }
}

/// Outputs that depend on each other in Initialization Mode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct AlgebraicLoop {
    /// The signals to solve for.
    pub unknowns: Vec<Unknown>,
    /// Slots of the other signals, and of those that inputs of another type read. They are held meanwhile, the latter
    /// for these inputs only.
    pub held: Vec<usize>,
    /// True if all FMUs of the loop return directional derivatives.
    pub has_derivatives: bool,
    /// The loop: `a:y -> b:u -> b:y -> a:u`.
    pub path: String,
}

/// A Real signal of an algebraic loop.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Unknown {
    /// Slot of the bus.
    pub slot: usize,
    /// Start value of the first Real input of the loop that reads it, in the unit of the output.
    pub start: f64,
    /// Nominal value, above 0.
    pub nominal: f64,
}

/// An instance of an FMU and its wires.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Component {
    /// Name, also of the instance.
    pub name: String,
    /// Path of the `.fmu` file.
    #[schemars(extend("format" = "path"))]
    pub fmu: String,
    /// Version of FMI.
    pub fmi: FmiVersion,
    /// Model identifier.
    pub model_identifier: String,
    /// GUID, or instantiation token of FMI 3.0.
    pub guid: String,
    /// Number of communication steps in one step of the component.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    #[schemars(extend("default" = 1))]
    pub every: u64,
    /// Number of its steps in a communication step.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    #[schemars(extend("default" = 1))]
    pub substeps: u64,
    /// True if it takes samples.
    #[serde(default, skip_serializing_if = "is_default")]
    pub is_discrete: bool,
    /// Structural parameters to set after instantiation (FMI 3.0).
    #[serde(default, skip_serializing_if = "StructuralParameters::is_empty")]
    pub structure: StructuralParameters,
    /// Solver of a component that the master integrates (model exchange); `None` for any other interface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub integration: Option<Solver>,
    /// Parameters to set before initialization, sorted by name.
    pub parameters: Vec<Setting>,
    /// Start values of a component that starts in a steady state, to be set after the parameters; empty if they are not
    /// known yet. `None` for a component that starts as declared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub steady: Option<Vec<Setting>>,
    /// Inputs that are held constant.
    pub constants: Vec<Setting>,
    /// Inputs read from the bus.
    pub inputs: Vec<Wire>,
    /// Outputs written to the bus.
    pub outputs: Vec<Wire>,
    /// Triggered input clocks that another clock activates.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub clocks: Vec<ClockWire>,
    /// Arrays with elements that settings and wires have as variables (FMI 3.0).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub arrays: Vec<ArrayElements>,
}

/// An array whose elements are variables in a plan. The FMU has a value reference for the array only.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ArrayElements {
    /// Value reference of the array.
    pub reference: Reference,
    /// Value reference of the first element in the plan; those of the others follow, row by row.
    pub first: Reference,
    /// Number of elements.
    pub size: usize,
    /// Start values of the elements; empty if the description does not have them all.
    pub starts: Vec<Value>,
}

impl Component {
    /// The interface, if it is not the one that the master chooses.
    pub(crate) fn interface(&self) -> Option<Interface> {
        self.integration.map(|_| Interface::ModelExchange)
    }

    /// Returns true if this is the binary of the component.
    pub(crate) fn uses(&self, binary: &Binary) -> bool {
        binary.is_of(Path::new(&self.fmu), &self.structure, self.integration.is_some())
    }

    /// Lists the arrays with elements that the component uses; all if it starts in a steady state.
    pub(crate) fn list_arrays(&mut self, description: &ModelDescription) {
        let settings = self.parameters.iter().chain(&self.constants).map(|setting| setting.reference);
        let wires = self.inputs.iter().chain(&self.outputs).map(|wire| wire.reference);
        let used: HashSet<Reference> = settings.chain(wires).collect();
        let elements = description.variables.iter().filter(|variable| variable.alias_of.is_none());
        let elements: Vec<_> = elements.filter_map(|variable| Some((variable.element?.array, variable))).collect();
        let of_arrays = elements.chunk_by(|one, next| one.0 == next.0);
        let is_used = |elements: &&[(_, &Variable)]| {
            self.steady.is_some() || elements.iter().any(|(_, element)| used.contains(&element.reference))
        };
        let array = |elements: &[(Reference, &Variable)]| ArrayElements {
            reference: elements[0].0,
            first: elements[0].1.reference,
            size: elements.len(),
            starts: elements
                .iter()
                .map(|(_, element)| element.start.clone())
                .collect::<Option<_>>()
                .unwrap_or_default(),
        };
        self.arrays = of_arrays.filter(is_used).map(array).collect();
    }
}

/// A triggered input clock and the clock whose ticks activate it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ClockWire {
    /// Name of the input clock.
    pub name: String,
    /// Its value reference.
    pub reference: Reference,
    /// Name of the component with the other clock.
    pub component: String,
    /// Name of the other clock: an output clock, or an input clock that ticks at its own times.
    pub source: String,
    /// Its value reference.
    pub source_reference: Reference,
}

/// A variable and its value.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Setting {
    /// Name of the variable.
    pub name: String,
    /// Base type.
    #[serde(rename = "type")]
    pub base_type: BaseType,
    /// Value reference.
    pub reference: Reference,
    /// Value, of that base type.
    pub value: Value,
}

impl Setting {
    pub(crate) fn new(variable: &Variable, value: Value) -> Self {
        let Variable { name, reference, base_type, .. } = variable;
        Self { name: name.clone(), base_type: *base_type, reference: *reference, value }
    }
}

/// A variable and its place on the bus.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Wire {
    /// Name of the variable.
    pub name: String,
    /// Value reference.
    pub reference: Reference,
    /// Base type, not `String`.
    #[serde(rename = "type")]
    pub base_type: BaseType,
    /// Slot of the bus.
    pub slot: usize,
    /// For a Real input, how its value follows from the signal, if they are not the same.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub conversion: Option<Linear>,
    /// True if the value is a line in time: an input that gets its slope, or an output of a slow component, which the
    /// bus interpolates between the component's steps.
    #[serde(default, skip_serializing_if = "is_default")]
    pub is_ramp: bool,
    /// Nominal value, above 0; 1 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nominal: Option<f64>,
}

/// A conversion: factor * value + offset.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Linear {
    /// Factor.
    pub factor: f64,
    /// Offset, in the unit of the result.
    pub offset: f64,
}

impl Linear {
    /// Does not change a value.
    pub const IDENTITY: Self = Self { factor: 1.0, offset: 0.0 };

    /// Converts a value.
    pub fn of(self, value: f64) -> f64 {
        self.factor * value + self.offset
    }

    /// The value that is converted to this one.
    pub fn inverse_of(self, value: f64) -> f64 {
        (value - self.offset) / self.factor
    }

    /// Applies another one first.
    pub(crate) fn after(self, first: Self) -> Self {
        Self { factor: self.factor * first.factor, offset: self.of(first.offset) }
    }
}

impl Wire {
    /// A scalar variable and its place on the bus.
    pub fn new(variable: &Variable, slot: usize) -> Self {
        let Variable { name, reference, base_type, .. } = variable;
        let nominal = variable.nominal.map(f64::abs).filter(|nominal| *nominal > 0.0);
        let (name, reference, base_type) = (name.clone(), *reference, *base_type);
        Self { name, reference, base_type, slot, conversion: None, is_ramp: false, nominal }
    }
}

/// Interpolation of a signal from a file between its samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Interpolation {
    /// Linear, for continuous inputs. A step gets the value at its middle.
    Linear,
    /// The last sample up to the start of the step, for all other inputs. The tolerance is 1e-9 steps.
    Hold,
}

/// A signal from a file. The last sample holds beyond its time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct InputSeries {
    /// Slot of the bus, written by nothing else.
    pub slot: usize,
    /// Interpolation between its samples.
    pub interpolation: Interpolation,
    /// Nondecreasing times, s; the first is at or before the start. At equal times the signal jumps: the first sample
    /// is its left limit, the last one holds from there on. Series from the same file share the times.
    #[serde(serialize_with = "as_sequence", deserialize_with = "from_sequence")]
    #[schemars(with = "Vec<f64>")]
    pub times: Arc<[f64]>,
    /// Value at each time.
    #[serde(serialize_with = "as_sequence", deserialize_with = "from_sequence")]
    #[schemars(with = "Vec<f64>")]
    pub values: Arc<[f64]>,
}

impl InputSeries {
    /// Returns the value at a time. `row` is the index of the last sample that is not after the previous time, 0 at
    /// first.
    pub(crate) fn at(&self, time: f64, row: &mut usize) -> Option<f64> {
        while self.times.get(*row + 1).is_some_and(|next| *next <= time) {
            *row += 1;
        }
        let (t0, v0) = (*self.times.get(*row)?, *self.values.get(*row)?);
        let next = self.times.get(*row + 1).zip(self.values.get(*row + 1));
        Some(match next {
            Some((t1, v1)) if self.interpolation == Interpolation::Linear && time > t0 => {
                v0 + (v1 - v0) * ((time - t0) / (t1 - t0))
            }
            _ => v0,
        })
    }
}

fn as_sequence<S: Serializer>(values: &Arc<[f64]>, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(values.iter())
}

fn from_sequence<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Arc<[f64]>, D::Error> {
    Ok(Vec::deserialize(deserializer)?.into())
}

/// A run in real time: simulated time advances `factor` times as fast as the clock. The time in which a run is paused
/// does not count.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct RealTime {
    /// Simulated time per time, above 0.
    pub factor: f64,
    /// Number of steps that ended late.
    pub late_steps: u64,
    /// Largest delay at the end of a step, s.
    pub largest_delay: f64,
    /// Sum of the delays at the ends of all steps, s.
    pub total_delay: f64,
}

/// Recorded signals of a run.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Recording {
    /// Time of each row, s.
    #[serde(skip)]
    pub time: Vec<f64>,
    /// Values of each column of the run; `None` where the case leaves the component out. The numbers of a Binary are
    /// its sizes in bytes.
    #[serde(skip)]
    pub columns: Vec<Option<Vec<f64>>>,
    /// By column, the values that a double cannot represent: those of Int64, UInt64 and Binary.
    pub exact: BTreeMap<usize, Exact>,
    /// Warnings of a successful run about its start and those that components logged, with the name of the component.
    pub messages: Vec<(String, Message)>,
    /// Time the run took, instantiation included, s.
    pub seconds: f64,
    /// Late steps of a run in real time.
    pub real_time: Option<RealTime>,
    /// Numbers of steps under error control, or with shorter steps instead of discarded ones.
    pub steps: Option<StepCounts>,
}

impl Recording {
    /// Values of a column of the plan.
    pub fn column(&self, index: usize) -> Option<&[f64]> {
        self.columns.get(index)?.as_deref()
    }
}

/// Values that a double cannot represent, one per row.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Exact {
    /// Values of an Int64 or UInt64.
    Integers(Vec<i128>),
    /// Values of a Binary.
    Binaries {
        /// Text of the values in a file.
        text: BinaryText,
        /// The values.
        values: Binaries,
    },
}

/// Values of a Binary. A value that is equal to the one before it needs no memory of its own.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Binaries {
    bytes: Vec<u8>,
    /// Start and end of each value.
    places: Vec<(usize, usize)>,
}

impl Binaries {
    /// Room for a number of values.
    pub(crate) fn with_rows(rows: usize) -> Self {
        Self { bytes: Vec::new(), places: Vec::with_capacity(rows) }
    }

    /// Appends a value.
    pub(crate) fn push(&mut self, value: &[u8]) {
        let place = match self.places.last() {
            Some((start, end)) if self.bytes[*start..*end] == *value => (*start, *end),
            _ => (self.bytes.len(), self.bytes.len() + value.len()),
        };
        if place.1 > self.bytes.len() {
            self.bytes.extend_from_slice(value);
        }
        self.places.push(place);
    }

    /// Memory of the values, bytes.
    pub(crate) fn memory(&self) -> usize {
        self.bytes.len()
    }

    /// The values in order.
    pub fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.places.iter().map(|(start, end)| self.bytes.get(*start..*end).unwrap_or_default())
    }
}

/// Parameters to test for an effect: a scenario sets them for a component without inputs, and no case reads all outputs
/// of the component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    pub(crate) component: String,
    /// Variants of the component in the runs, each once.
    pub(crate) variants: Vec<Variant>,
    pub(crate) suspects: Vec<Suspect>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Variant {
    pub(crate) component: Component,
    /// Names of the outputs that are read in the case of the run.
    pub(crate) read: Vec<String>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Suspect {
    pub(crate) name: String,
    /// `file:line:column`.
    pub(crate) place: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values at rising times.
    fn values(interpolation: Interpolation, rows: &[(f64, f64)], times: impl IntoIterator<Item = f64>) -> Vec<f64> {
        let series = InputSeries {
            slot: 0,
            interpolation,
            times: rows.iter().map(|row| row.0).collect(),
            values: rows.iter().map(|row| row.1).collect(),
        };
        let mut row = 0;
        times.into_iter().map(|time| series.at(time, &mut row).unwrap()).collect()
    }

    #[test]
    fn binaries_keep_all_values_and_repeated_ones_once() {
        let mut binaries = Binaries::default();
        let values: [&[u8]; 6] = [b"", b"ab", b"ab", b"", b"", b"abc"];
        values.iter().for_each(|value| binaries.push(value));
        assert_eq!(binaries.iter().collect::<Vec<_>>(), values);
        assert_eq!(binaries.memory(), 5);
    }

    /// The expected values are on straight lines between the rows. Two or three rows with the same time are a jump: the
    /// first is the left limit, the last the right limit.
    #[test]
    fn a_series_is_a_line_or_held_and_jumps_at_equal_times() {
        let rows =
            [(0.0, 0.0), (0.5, 1.0), (0.5, 3.0), (1.0, 2.0), (1.25, 2.0), (1.25, -7.0), (1.25, -1.0), (2.0, 0.5)];
        let times = [0.0, 0.1, 0.25, 0.499, 0.5, 0.501, 0.75, 1.0, 1.1, 1.249, 1.25, 1.5, 2.0, 2.5];
        let linear = [0.0, 0.2, 0.5, 0.998, 3.0, 2.998, 2.5, 2.0, 2.0, 2.0, -1.0, -0.5, 0.5, 0.5];
        let hold = [0.0, 0.0, 0.0, 0.0, 3.0, 3.0, 3.0, 2.0, 2.0, 2.0, -1.0, -1.0, 0.5, 0.5];
        for (interpolation, expected) in [(Interpolation::Linear, linear), (Interpolation::Hold, hold)] {
            let found = values(interpolation, &rows, times);
            for ((time, found), expected) in times.iter().zip(found).zip(expected) {
                assert!((found - expected).abs() < 1e-12, "{interpolation:?} at {time} s: {found}, not {expected}");
            }
        }
    }

    /// A sine of 0.5 Hz with 20 samples per second. With theta = 2 pi f/fs, the error of linear interpolation is at
    /// most 1 - cos(theta/2), and the error of holding the last sample is at most sin(theta). The expected largest and
    /// RMS errors on a grid of 1 ms are from an independent implementation.
    #[test]
    fn a_sampled_sine_has_the_error_of_its_chords() {
        let sine = |time: f64| (std::f64::consts::PI * time).sin();
        let rows: Vec<(f64, f64)> = (0..=40).map(|k| (f64::from(k) / 20.0, sine(f64::from(k) / 20.0))).collect();
        let times: Vec<f64> = (0..2000).map(|k| f64::from(k) / 1000.0).collect();
        for (interpolation, largest, rms) in [
            (Interpolation::Linear, 0.003_073_163_435_559_078_7, 0.001_591_842_919_050_318_3),
            (Interpolation::Hold, 0.153_330_783_736_961, 0.063_126_597_021_131_2),
        ] {
            let found = values(interpolation, &rows, times.iter().copied());
            let errors: Vec<f64> = times.iter().zip(found).map(|(time, value)| value - sine(*time)).collect();
            let peak = errors.iter().fold(0.0, |peak: f64, error| peak.max(error.abs()));
            let square = errors.iter().map(|error| error * error).sum::<f64>() / 2000.0;
            assert!((peak - largest).abs() < 1e-12 && (square.sqrt() - rms).abs() < 1e-12, "{peak} {}", square.sqrt());
        }
    }
}
