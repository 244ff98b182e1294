//! The variables of an FMU: declarations, positions and value references.

use std::ops::{Range, RangeInclusive};

use crate::bytes::Buffer;
use crate::calls::Version;
use crate::clocks::{InputClock, TIMING_WORDS};
use crate::declare::{hash, prefix};
use crate::discrete_state::DiscreteState;
use crate::enumeration::Item;
use crate::number::{self, Number as _, Size, is_finite_f32};
use crate::store::{Counts, Length, ValueStore};
use crate::unit::{DisplayUnit, Unit};

/// A declared variable.
#[derive(Clone, Debug)]
pub struct Declaration {
    /// Name in the model description.
    pub name: String,
    /// Description.
    pub description: String,
    /// True if the variable is a tunable parameter.
    pub tunable: bool,
    /// True if the variable is a state with causality local instead of output.
    pub local: bool,
    /// True if the variable is a state whose start value follows from the parameters.
    pub calculated: bool,
    /// Type with its attributes.
    pub kind: Kind,
    /// The array to which the variable belongs.
    pub array: Option<ArrayElement>,
    /// Other names.
    pub aliases: Vec<Alias>,
    /// The terminals of FMI 3.0 that contain the variable, the outermost first.
    pub terminals: Vec<Terminal>,
    /// Attributes that few variables have.
    pub details: Details,
}

/// Attributes that few variables have. Their defaults are those of the standard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Details {
    /// The only version of FMI in which the variable exists; `None` for all versions.
    pub only: Option<Version>,
    /// True if the variable always has its start value.
    pub constant: bool,
    /// Names of the input clocks to which the variable belongs.
    pub clocks: &'static [&'static str],
    /// True for a structural parameter.
    pub structural: bool,
    /// Names of the structural parameters that are the lengths of the dimensions of an array.
    pub sizes: &'static [&'static str],
    /// Physical quantity of a number, such as `Angle`; empty if it is not declared.
    pub quantity: &'static str,
    /// True for a real number that is a difference, so the offset of a display unit does not apply.
    pub relative_quantity: bool,
    /// True for an input that importers may set in intermediate updates.
    pub intermediate: bool,
    /// True for a real number that may become much greater than its nominal value.
    pub unbounded: bool,
}

/// Another name of a variable.
#[derive(Clone, Debug, PartialEq)]
pub struct Alias {
    /// Name in the model description.
    pub name: String,
    /// Description; in the code from the derive, empty for that of the variable.
    pub description: String,
    /// Display unit.
    pub display: Option<DisplayUnit>,
}

/// A terminal: a nested struct of inputs or outputs that importers connect as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Terminal {
    /// Name, unique among its siblings.
    pub name: &'static str,
    /// Rule for the connection of its variables: `plug`, `bus`, `sequence`, `none`, or a reversed domain name.
    pub rule: &'static str,
    /// Description; may be empty.
    pub description: &'static str,
    /// Position in the name of the variable at which its name within the terminal starts.
    pub member: usize,
}

/// The array to which a variable belongs, and its element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ArrayElement {
    /// Name of the array.
    pub name: String,
    /// Description of the array.
    pub description: String,
    /// Name of the element, such as `fl`; empty for numbered elements.
    pub element: String,
    /// Dimensions of the array, the outermost first.
    pub dimensions: Vec<usize>,
}

/// Type of a variable with its start value and limits.
#[derive(Clone, Debug)]
pub enum Kind {
    /// A real number with its unit.
    Real(Real),
    /// A Float32 with its unit.
    Float32(Real),
    /// An integer or an enumeration.
    Integer {
        /// Its number of bits and sign.
        size: Size,
        /// Start value.
        start: i128,
        /// Least value; if none is declared, the least value of the type.
        min: i128,
        /// Greatest value; if none is declared, the greatest value of the type.
        max: i128,
        /// Name of the type of an enumeration; empty for a plain number.
        type_name: &'static str,
        /// Values and names of an enumeration; empty for a plain number.
        items: &'static [Item],
        /// True if it is an FMI Enumeration.
        is_enumeration: bool,
    },
    /// A Boolean.
    Boolean {
        /// Start value.
        start: bool,
    },
    /// A String.
    String {
        /// Start value.
        start: String,
    },
    /// A Binary.
    Binary {
        /// Start value.
        start: Vec<u8>,
        /// Greatest number of bytes.
        most: usize,
        /// Type of the data, such as `image/png`; empty if it is not declared.
        mime: &'static str,
    },
    /// A clock: an input clock, or a triggered output clock.
    Clock(Option<InputClock>),
}

/// Attributes of a real variable.
#[derive(Clone, Debug)]
pub struct Real {
    /// Unit of measure.
    pub unit: Unit,
    /// Display unit.
    pub display: Option<DisplayUnit>,
    /// Start value; also the value of calculated variables before they are calculated.
    pub start: f64,
    /// Least value, if there is one.
    pub min: Option<f64>,
    /// Greatest value, if there is one.
    pub max: Option<f64>,
    /// Nominal value, if it was declared.
    pub nominal: Option<f64>,
}

/// Role of a variable in the FMU; determines causality, variability and initial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Set before the start or, if tunable, between steps.
    Parameter,
    /// Follows from the parameters.
    Calculated,
    /// Set by the master.
    Input,
    /// Read by the master.
    Output,
    /// A continuous state.
    State,
    /// The derivative of the state with the same position.
    Derivative,
    /// A field of the discrete state that belongs to a clock.
    Clocked,
    /// The value before the tick of the clocked state with the same position.
    Previous,
    /// An input clock, activated by the master.
    Clock,
}

/// A variable with the position of its value.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Declaration.
    pub declaration: Declaration,
    /// Role in the FMU.
    pub role: Role,
    /// Index among the values of its type.
    pub index: usize,
    /// Value reference in the FMU.
    pub reference: u32,
}

/// A block of variables with the same role: position and number of their values, by type.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Block {
    /// Position of the first values.
    pub at: Counts,
    /// Number of values.
    pub counts: Counts,
}

impl Block {
    /// Indices of the reals.
    pub const fn reals(&self) -> Range<usize> {
        self.at.reals..self.at.reals + self.counts.reals
    }
    /// Indices of the Booleans.
    pub const fn booleans(&self) -> Range<usize> {
        self.at.booleans..self.at.booleans + self.counts.booleans
    }
    /// Position of a real in the block by its value reference.
    pub(crate) fn position(&self, reference: u32) -> Option<usize> {
        (reference as usize).checked_sub(self.at.reals).filter(|&position| position < self.counts.reals)
    }
    /// Returns true if the block contains variables that are not real.
    pub(crate) const fn has_others(&self) -> bool {
        self.counts.words + self.counts.booleans + self.counts.strings + self.counts.binaries > 0
    }
}

/// Numbers of event indicators in model exchange. Those for declared zero crossings come first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Indicators {
    /// Zero crossings that the model declares.
    pub declared: usize,
    /// Number of relations in derivatives and outputs; the maximum over all Booleans and enumerations.
    pub relations: usize,
}

impl Indicators {
    /// Number of all indicators.
    pub const fn total(self) -> usize {
        self.declared + self.relations
    }
}

/// All variables of a model and the positions of their values.
///
/// Reals come first, block by block; the value reference of a real is its index. Words, Booleans, Strings and Binaries
/// follow.
#[derive(Clone, Debug)]
pub struct Layout {
    /// All variables, ordered as in the model description.
    pub variables: Vec<Variable>,
    /// Parameters.
    pub parameters: Block,
    /// Derived parameters.
    pub derived: Block,
    /// Inputs.
    pub inputs: Block,
    /// Outputs that are not states.
    pub outputs: Block,
    /// Clocked states.
    pub clocked: Block,
    /// The values of the clocked states before the tick.
    pub previous: Block,
    /// Continuous states.
    pub states: Block,
    /// Derivatives of the states.
    pub derivatives: Block,
    /// Input clocks: Booleans that are true while the clock is active.
    pub clocks: Block,
    /// Indices of the Booleans that are output clocks.
    pub output_clocks: Vec<usize>,
    /// Numbers of event indicators.
    pub indicators: Indicators,
    /// Indices of the words of structural parameters, in the order of [`ValueStore::lengths`].
    pub structural: Vec<usize>,
    /// Arrays whose lengths are structural parameters.
    pub sized: Vec<SizedArray>,
    /// Index of the parameter `sample_time`, `max_step` or `tolerance`.
    pub solver: Option<usize>,
    /// First value reference of each type.
    pub first: Counts,
    /// One past the last value reference.
    pub end: u32,
    /// True if there is a Float32.
    pub has_float32: bool,
    /// Position in `variables` by value reference.
    positions: Vec<usize>,
}

/// An array whose lengths are structural parameters. In memory, it has its greatest size.
#[derive(Clone, Debug)]
pub struct SizedArray {
    /// Role of its elements.
    pub role: Role,
    /// Value reference of the array and of its first element. The elements have consecutive references, row by row.
    pub reference: u32,
    /// Greatest length of each dimension, and the position of its length in [`ValueStore::lengths`].
    pub dimensions: Vec<(usize, usize)>,
}

impl SizedArray {
    /// Greatest number of elements.
    pub(crate) fn capacity(&self) -> usize {
        self.dimensions.iter().map(|(most, _)| most).product()
    }
    /// Number of present elements.
    pub(crate) fn count(&self, lengths: &[Length]) -> usize {
        self.dimensions.iter().map(|&(_, at)| lengths[at].value).product()
    }
    /// The present elements, by their positions in memory, row by row.
    pub(crate) fn elements(&self, lengths: &[Length]) -> impl Iterator<Item = usize> {
        let length = |&(_, at): &(usize, usize)| lengths[at].value;
        (0..self.count(lengths)).map(move |number| {
            let (mut number, mut position, mut stride) = (number, 0, 1);
            for dimension in self.dimensions.iter().rev() {
                position += number % length(dimension) * stride;
                number /= length(dimension);
                stride *= dimension.0;
            }
            position
        })
    }
}

/// The declared variables of a model, by block.
#[derive(Clone, Debug, Default)]
pub struct Declarations {
    /// Parameters.
    pub parameters: Vec<Declaration>,
    /// Derived parameters.
    pub derived: Vec<Declaration>,
    /// Inputs.
    pub inputs: Vec<Declaration>,
    /// Outputs that are not states.
    pub outputs: Vec<Declaration>,
    /// Clocked states.
    pub clocked: Vec<Declaration>,
    /// The values of the clocked states before the tick.
    pub previous: Vec<Declaration>,
    /// Continuous states.
    pub states: Vec<Declaration>,
    /// Input clocks.
    pub clocks: Vec<Declaration>,
    /// Number of zero crossings.
    pub crossings: usize,
    /// Finds the arrays with structural parameters. `None` if the model has none, so that its library does not contain it.
    pub sized: Option<fn(&Layout) -> Vec<SizedArray>>,
    /// Name of the parameter that the solver reads.
    pub solver: Option<&'static str>,
}

impl Declarations {
    /// Declares the clocked states of a model with clocks.
    pub(crate) fn declare_clocked<D: DiscreteState>(&mut self) {
        D::declare(&mut self.clocked);
        // FMI 2.0 has no clocks.
        self.clocked.iter_mut().for_each(|state| state.details.only = Some(Version::Fmi3));
        self.previous = self.clocked.clone();
        prefix("previous", &mut self.previous);
        self.previous.iter_mut().for_each(|state| state.description.push_str(" (before the tick)"));
    }
}

impl Variable {
    /// Returns true if the variable may have the value in a word.
    pub(crate) fn accepts(&self, word: u64) -> bool {
        let kind = &self.declaration.kind;
        // The order matters: a comparison with NaN could raise an exception that the host does not mask.
        kind.holds(word) && (!self.has_limits() || kind.is_within_limits(word))
    }
    /// Returns true if the description of a version declares the variable.
    pub(crate) fn is_in(&self, version: Version) -> bool {
        self.declaration.details.only.is_none_or(|only| only == version)
    }
    pub(crate) fn is_input(&self) -> bool {
        self.role == Role::Input
    }
    /// Returns true if importers may use the variable in intermediate updates, provided that the model is
    /// continuous-time.
    pub(crate) fn is_intermediate(&self) -> bool {
        let Declaration { kind, details, .. } = &self.declaration;
        let is_continuous = matches!(kind, Kind::Real(_)) && !details.constant && details.clocks.is_empty();
        is_continuous && (matches!(self.role, Role::Output | Role::State) || details.intermediate)
    }
    /// Returns true for an input that can be linear in time; clocked inputs are discrete.
    pub(crate) fn is_continuous_input(&self) -> bool {
        let Declaration { kind, details, .. } = &self.declaration;
        self.role == Role::Input && matches!(kind, Kind::Real(_)) && details.clocks.is_empty()
    }
    /// Returns true if the FMU rejects values outside the limits. Those of inputs and outputs are information for importers.
    pub(crate) fn has_limits(&self) -> bool {
        self.role == Role::Parameter
    }
}

impl Layout {
    /// Assigns positions and value references to the declared variables.
    pub fn new(declared: Declarations) -> Self {
        let derivatives: Vec<_> = declared.states.iter().map(derivative_of).collect();
        let blocks = [
            (Role::Parameter, declared.parameters),
            (Role::Calculated, declared.derived),
            (Role::Input, declared.inputs),
            (Role::Output, declared.outputs),
            (Role::Clocked, declared.clocked),
            (Role::Previous, declared.previous),
            (Role::State, declared.states),
            (Role::Derivative, derivatives),
            (Role::Clock, declared.clocks),
        ];
        let mut total = Counts::ZERO;
        let mut variables = Vec::new();
        let mut placed = [Block::default(); 9];
        for ((role, block), placed) in blocks.into_iter().zip(&mut placed) {
            placed.at = total;
            for declaration in block {
                let index = declaration.kind.of(total);
                total = total.plus(declaration.kind.counts());
                placed.counts = placed.counts.plus(declaration.kind.counts());
                variables.push(Variable { declaration, role, index, reference: 0 });
            }
        }
        let [parameters, derived, inputs, outputs, clocked, previous, states, derivatives, clocks] = placed;
        let words = total.reals;
        let booleans = words + total.words;
        let strings = booleans + total.booleans;
        let binaries = strings + total.strings;
        let first = Counts { reals: 0, words, booleans, strings, binaries, lengths: () };
        let end = u32::try_from(binaries + total.binaries).expect("fewer than 2^32 variables");
        // Words in which clocks keep their intervals have no variable.
        let mut positions = vec![usize::MAX; end as usize];
        for (position, variable) in variables.iter_mut().enumerate() {
            let reference = variable.declaration.kind.of(first) + variable.index;
            variable.reference = u32::try_from(reference).expect("below the end");
            positions[reference] = position;
        }
        let is_output_clock =
            |variable: &&Variable| variable.role == Role::Output && matches!(variable.declaration.kind, Kind::Clock(_));
        let output_clocks = variables.iter().filter(is_output_clock).map(|variable| variable.index).collect();
        let is_solver = |variable: &&Variable| {
            variable.role == Role::Parameter && Some(variable.declaration.name.as_str()) == declared.solver
        };
        let solver = variables.iter().find(is_solver).map(|variable| variable.index);
        let mut layout = Self {
            parameters,
            derived,
            inputs,
            outputs,
            clocked,
            previous,
            states,
            derivatives,
            clocks,
            output_clocks,
            indicators: Indicators { declared: declared.crossings, ..Indicators::default() },
            solver,
            first,
            end,
            has_float32: variables.iter().any(|variable| matches!(variable.declaration.kind, Kind::Float32(_))),
            structural: variables.iter().filter(|v| v.declaration.is_length()).map(|v| v.index).collect(),
            sized: Vec::new(),
            variables,
            positions,
        };
        layout.sized = declared.sized.map_or_else(Vec::new, |sized| sized(&layout));
        layout
    }

    /// See [`Declarations::sized`].
    pub(crate) fn sized_arrays(&self) -> Vec<SizedArray> {
        let of = |variable: &Variable| {
            let sizes = variable.declaration.details.sizes;
            if sizes.is_empty() {
                return None;
            }
            let (array, elements) =
                self.array_of(variable).filter(|(_, elements)| elements[0].index == variable.index)?;
            let position = |name: &&str| {
                let length = self.by_name(name).filter(|variable| variable.declaration.is_length())?;
                self.structural.iter().position(|&index| index == length.index)
            };
            let positions: Option<Vec<usize>> = sizes.iter().map(position).collect();
            let dimensions = array.dimensions.iter().copied().zip(positions?).collect();
            Some(SizedArray { role: variable.role, reference: elements[0].reference, dimensions })
        };
        self.variables.iter().filter_map(of).collect()
    }

    /// Number of states in memory that are not present.
    pub(crate) fn missing_states(&self, lengths: &[Length]) -> usize {
        let missing = |array: &SizedArray| array.capacity() - array.count(lengths);
        self.sized.iter().filter(|array| array.role == Role::State).map(missing).sum()
    }

    /// The array with a value reference, if its lengths are structural parameters.
    #[inline]
    pub(crate) fn sized_array(&self, reference: u32) -> Option<&SizedArray> {
        self.sized.iter().find(|array| array.reference == reference)
    }

    /// The array to which a variable belongs, and all its elements. `None` if they have names, which an FMI array would
    /// lose, if they differ in an attribute that an FMI array has only once (type, unit or limits), or if a variable has
    /// the name of the array.
    pub(crate) fn array_of<'a>(&'a self, variable: &'a Variable) -> Option<(&'a ArrayElement, Vec<&'a Variable>)> {
        let of = variable.declaration.array.as_ref().filter(|array| array.element.is_empty())?;
        let is_element = |other: &&Variable| {
            other.role == variable.role && other.declaration.array.as_ref().is_some_and(|array| array.name == of.name)
        };
        let elements: Vec<_> = self.variables.iter().filter(is_element).collect();
        let first = elements.first()?;
        let agree = elements.iter().all(|element| element.declaration.is_like(&first.declaration));
        let is_whole = elements.len() == of.dimensions.iter().product::<usize>();
        let is_connected = elements.iter().enumerate().all(|(i, element)| element.index == first.index + i);
        let is_free = self.names().all(|name| name != of.name);
        (agree && is_whole && is_connected && is_free).then_some((of, elements))
    }

    /// For each value reference, the reference of the first element of its array; outside of arrays, the reference
    /// itself.
    pub(crate) fn representatives(&self) -> Vec<u32> {
        let mut first: Vec<u32> = (0..self.end).collect();
        for variable in &self.variables {
            let is_known = first[variable.reference as usize] != variable.reference;
            if let Some((_, elements)) = (!is_known).then(|| self.array_of(variable)).flatten() {
                elements.iter().for_each(|element| first[element.reference as usize] = variable.reference);
            }
        }
        first
    }

    /// The names of all variables, with their aliases.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.variables.iter().flat_map(|variable| variable.declaration.names())
    }

    /// The input clocks of a variable; all of them if it names none.
    pub(crate) fn clocks_of(&self, variable: &Variable) -> impl Iterator<Item = &Variable> {
        let names = variable.declaration.details.clocks;
        let clocks = self.variables.iter().filter(|clock| clock.role == Role::Clock);
        clocks.filter(move |clock| names.is_empty() || names.contains(&&*clock.declaration.name))
    }

    /// The variable with a value reference.
    pub fn by_reference(&self, reference: u32) -> Option<&Variable> {
        self.positions.get(reference as usize).and_then(|&position| self.variables.get(position))
    }

    pub(crate) fn by_name(&self, name: &str) -> Option<&Variable> {
        self.variables.iter().find(|variable| variable.declaration.name == name)
    }

    /// The same positions and value references, without the variables that a version does not have.
    pub(crate) fn in_version(&self, version: Version) -> Self {
        let mut layout = self.clone();
        layout.variables.retain(|variable| variable.is_in(version));
        layout.positions.fill(usize::MAX);
        for (position, variable) in layout.variables.iter().enumerate() {
            layout.positions[variable.reference as usize] = position;
        }
        layout
    }

    /// The real variable `index`.
    pub fn real(&self, index: usize) -> &Variable {
        &self.variables[self.positions[index]]
    }

    /// The variable with the value of a clocked state before the tick.
    pub(crate) fn previous(&self, clocked: &Variable) -> Option<&Variable> {
        let kind = &clocked.declaration.kind;
        let index = clocked.index - kind.of(self.clocked.at) + kind.of(self.previous.at);
        self.by_reference(u32::try_from(kind.of(self.first) + index).expect("below the end"))
    }

    pub(crate) fn state_of(&self, derivative: &Variable) -> &Variable {
        self.real(self.states.at.reals + derivative.index - self.derivatives.at.reals)
    }

    pub(crate) fn nominal(&self, index: usize) -> f64 {
        match &self.real(index).declaration.kind {
            Kind::Real(real) => real.nominal.unwrap_or(1.0),
            _ => 1.0,
        }
    }

    /// Name of the real variable `index`.
    pub fn real_name(&self, index: usize) -> &str {
        &self.real(index).declaration.name
    }

    /// Index in ModelStructure, from 1, of the variable with a value reference.
    pub fn structure_index(&self, reference: u32) -> usize {
        self.positions[reference as usize] + 1
    }

    /// Number of real values with a variable.
    pub fn reals(&self) -> usize {
        self.derivatives.reals().end
    }

    /// Indices of the slopes of the real inputs in 1/s. They follow the reals if the model interpolates, and have no
    /// variable.
    pub fn slopes(&self) -> Range<usize> {
        self.reals()..self.reals() + self.inputs.counts.reals
    }
}

impl ValueStore {
    /// Reads the lengths of arrays from the structural parameters.
    pub(crate) fn update_lengths(&mut self, layout: &Layout) {
        for (length, &index) in self.lengths.iter_mut().zip(&layout.structural) {
            length.value = self.words[index] as usize;
        }
    }

    /// The start values.
    pub fn start(layout: &Layout) -> Self {
        Self::of(layout.variables.iter().map(|variable| &variable.declaration))
    }

    /// The start values of the declared variables.
    pub(crate) fn of<'a>(declarations: impl IntoIterator<Item = &'a Declaration>) -> Self {
        let (mut reals, mut words, mut booleans, mut strings) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let (mut binaries, mut lengths) = (Vec::new(), Vec::new());
        for declaration in declarations {
            match &declaration.kind {
                Kind::Real(real) => reals.push(real.start),
                Kind::Float32(real) => words.push((real.start as f32).word()),
                Kind::Integer { start, .. } => {
                    if declaration.is_length() {
                        lengths.push(Length { parameter: hash(&declaration.name), value: *start as usize });
                    }
                    words.push(*start as u64);
                }
                Kind::Boolean { start } => booleans.push(*start),
                Kind::Clock(clock) => {
                    booleans.push(false);
                    if clock.is_some_and(|clock| clock.timing.is_settable()) {
                        words.extend([0; TIMING_WORDS]);
                    }
                }
                Kind::String { start } => strings.push(start.clone()),
                kind @ Kind::Binary { .. } => binaries.extend(kind.buffer()),
            }
        }
        Self {
            reals: reals.into(),
            words: words.into(),
            booleans: booleans.into(),
            strings: strings.into(),
            binaries: binaries.into(),
            lengths: lengths.into(),
        }
    }

    /// Copies the value of a variable.
    pub(crate) fn copy(&mut self, from: &Self, variable: &Variable) {
        let index = variable.index;
        match variable.declaration.kind {
            Kind::Real(_) => self.reals[index] = from.reals[index],
            Kind::Float32(_) | Kind::Integer { .. } => self.words[index] = from.words[index],
            Kind::Boolean { .. } | Kind::Clock(_) => self.booleans[index] = from.booleans[index],
            Kind::String { .. } => self.strings[index].clone_from(&from.strings[index]),
            Kind::Binary { .. } => self.binaries[index].set(&from.binaries[index]),
        }
    }

    pub(crate) fn differs(&self, other: &Self, variable: &Variable) -> bool {
        let index = variable.index;
        match variable.declaration.kind {
            Kind::Real(_) => self.reals[index] != other.reals[index],
            Kind::Float32(_) | Kind::Integer { .. } => self.words[index] != other.words[index],
            Kind::Boolean { .. } | Kind::Clock(_) => self.booleans[index] != other.booleans[index],
            Kind::String { .. } => self.strings[index] != other.strings[index],
            Kind::Binary { .. } => self.binaries[index] != other.binaries[index],
        }
    }
}

impl Real {
    pub(crate) fn range(&self) -> RangeInclusive<f64> {
        self.min.unwrap_or(f64::NEG_INFINITY)..=self.max.unwrap_or(f64::INFINITY)
    }
}

impl Declaration {
    /// The name and the aliases.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.name.as_str()).chain(self.aliases.iter().map(|alias| alias.name.as_str()))
    }

    /// Returns true for a structural parameter that can be the length of arrays.
    pub(crate) fn is_length(&self) -> bool {
        self.details.structural && matches!(self.kind, Kind::Integer { size: Size::UInt64, is_enumeration: false, .. })
    }

    /// Returns true if the variables differ at most in name, description and start value.
    fn is_like(&self, other: &Self) -> bool {
        let is_like = match (&self.kind, &other.kind) {
            // A clock is always a scalar.
            (Kind::Clock(_), _) => false,
            (Kind::Real(one), Kind::Real(other)) | (Kind::Float32(one), Kind::Float32(other)) => {
                let limits = |real: &Real| [real.min, real.max, real.nominal].map(|value| value.map(f64::to_bits));
                let display = |real: &Real| real.display.map(|display| display.name);
                one.unit.name == other.unit.name && display(one) == display(other) && limits(one) == limits(other)
            }
            (
                Kind::Integer { size, min, max, type_name, is_enumeration, .. },
                Kind::Integer {
                    size: other_size,
                    min: other_min,
                    max: other_max,
                    type_name: other_type,
                    is_enumeration: other_is,
                    ..
                },
            ) => {
                (size, min, max, type_name, is_enumeration) == (other_size, other_min, other_max, other_type, other_is)
            }
            (Kind::Binary { most, mime, .. }, Kind::Binary { most: other_most, mime: other_mime, .. }) => {
                (most, mime) == (other_most, other_mime)
            }
            (one, other) => one.type_name(Version::Fmi3) == other.type_name(Version::Fmi3),
        };
        let flags = |one: &Self| (one.tunable, one.local, one.calculated, one.details);
        is_like && flags(self) == flags(other)
    }
}

impl Kind {
    const fn counts(&self) -> Counts {
        match self {
            Self::Real(_) => Counts::REAL,
            Self::Float32(_) | Self::Integer { .. } => Counts::WORD,
            Self::Clock(Some(clock)) if clock.timing.is_settable() => Counts { words: TIMING_WORDS, ..Counts::BOOLEAN },
            Self::Boolean { .. } | Self::Clock(_) => Counts::BOOLEAN,
            Self::String { .. } => Counts::STRING,
            Self::Binary { .. } => Counts::BINARY,
        }
    }
    pub(crate) const fn of(&self, counts: Counts) -> usize {
        match self {
            Self::Real(_) => counts.reals,
            Self::Float32(_) | Self::Integer { .. } => counts.words,
            Self::Boolean { .. } | Self::Clock(_) => counts.booleans,
            Self::String { .. } => counts.strings,
            Self::Binary { .. } => counts.binaries,
        }
    }
    /// Returns true if a word is a value of this type: an item of an enumeration, or a finite number.
    pub(crate) fn holds(&self, word: u64) -> bool {
        match self {
            Self::Float32(_) => is_finite_f32(word),
            Self::Integer { size, items, .. } => {
                let value = size.value(word);
                // The word may contain a number of another size, which a number of this size cannot represent.
                value as u64 == word && (items.is_empty() || items.iter().any(|item| i128::from(item.value) == value))
            }
            _ => false,
        }
    }
    /// Returns true if a word, a value of this type, is within the limits.
    fn is_within_limits(&self, word: u64) -> bool {
        match self {
            Self::Float32(real) => real.range().contains(&f32::of(word).into()),
            Self::Integer { size, min, max, .. } => (*min..=*max).contains(&size.value(word)),
            _ => false,
        }
    }
    /// A word as text.
    pub(crate) fn text(&self, word: u64) -> String {
        number::word_text(if let Self::Integer { size, .. } = self { Some(*size) } else { None }, word)
    }
    /// Memory for a Binary, with its start value.
    pub(crate) fn buffer(&self) -> Option<Buffer> {
        match self {
            Self::Binary { start, most, .. } => Some(Buffer::new(*most, start)),
            _ => None,
        }
    }
    /// Attributes of a real number, Float64 or Float32.
    pub(crate) const fn real(&self) -> Option<&Real> {
        match self {
            Self::Real(real) | Self::Float32(real) => Some(real),
            _ => None,
        }
    }
    /// Name of the type in a version of the FMI standard.
    pub fn type_name(&self, version: Version) -> &'static str {
        match (self, version) {
            (Self::Integer { is_enumeration: true, .. }, _) => "Enumeration",
            (Self::Boolean { .. }, _) | (Self::Clock(_), Version::Fmi2) => "Boolean",
            (Self::Clock(_), Version::Fmi3) => "Clock",
            (Self::String { .. }, _) => "String",
            (Self::Binary { .. }, _) => "Binary",
            (Self::Real(_) | Self::Float32(_), Version::Fmi2) => "Real",
            (Self::Integer { .. }, Version::Fmi2) => "Integer",
            (Self::Real(_), Version::Fmi3) => "Float64",
            (Self::Float32(_), Version::Fmi3) => "Float32",
            (Self::Integer { size, .. }, Version::Fmi3) => size.name(),
        }
    }
}

fn derivative_of(state: &Declaration) -> Declaration {
    let Kind::Real(real) = &state.kind else { unreachable!("states are real numbers") };
    Declaration {
        name: format!("der({})", state.name),
        description: format!("Time derivative of {}", state.name),
        tunable: false,
        local: true,
        calculated: false,
        aliases: Vec::new(),
        terminals: Vec::new(),
        details: Details { sizes: state.details.sizes, ..Details::default() },
        array: state.array.as_ref().map(|array| ArrayElement {
            name: format!("der({})", array.name),
            description: format!("Time derivative of {}", array.description),
            ..array.clone()
        }),
        kind: Kind::Real(Real {
            unit: real.unit.per_second(),
            display: None,
            start: 0.0,
            min: None,
            max: None,
            nominal: None,
        }),
    }
}

/// The declaration of an input clock.
pub(crate) fn declare_clock(clock: &InputClock) -> Declaration {
    Declaration {
        name: clock.name.to_owned(),
        description: clock.description.to_owned(),
        tunable: false,
        local: false,
        calculated: false,
        kind: Kind::Clock(Some(*clock)),
        array: None,
        aliases: Vec::new(),
        terminals: Vec::new(),
        details: Details::default(),
    }
}
