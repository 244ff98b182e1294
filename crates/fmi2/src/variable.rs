//! The variables of an FMU, as declared and as numbered.

use std::ops::Range;

use crate::block::Choice;
use crate::unit::Unit;

/// A variable as a block declares it.
#[derive(Clone, Debug)]
pub struct Declaration {
    /// Name in the model description.
    pub name: String,
    /// What it is.
    pub description: String,
    /// Whether a parameter may change between steps; false for everything else.
    pub tunable: bool,
    /// Whether it is a signal only this unit knows and no other is meant to read (causality local).
    pub local: bool,
    /// Whether the start value of a state follows from the parameters; false for everything else.
    pub calculated: bool,
    /// Type and what belongs to it.
    pub kind: Kind,
}

/// Type of a variable with its start value and limits.
#[derive(Clone, Debug)]
pub enum Kind {
    /// A real number with its unit.
    Real(Real),
    /// A whole number; `choices` names the values of a mode.
    Integer {
        /// Start value.
        start: i32,
        /// Least value.
        min: i32,
        /// Greatest value.
        max: i32,
        /// Name of the mode's type; empty for a plain number.
        type_name: &'static str,
        /// Values and names of a mode; empty for a plain number.
        choices: &'static [Choice],
    },
    /// A switch.
    Boolean {
        /// Start value.
        start: bool,
    },
    /// A text.
    String {
        /// Start value.
        start: String,
    },
}

/// What belongs to a real variable.
#[derive(Clone, Debug)]
pub struct Real {
    /// Unit of measure.
    pub unit: Unit,
    /// Unit in which it is best shown.
    pub display: Option<&'static str>,
    /// Start value; what calculated variables have before they are calculated.
    pub start: f64,
    /// Least value, if there is one.
    pub min: Option<f64>,
    /// Greatest value, if there is one.
    pub max: Option<f64>,
    /// Usual magnitude, if it was declared.
    pub nominal: Option<f64>,
}

/// What a variable is in the FMU; decides causality, variability and initial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Set before or, if tunable, between steps.
    Parameter,
    /// Follows from the parameters.
    Calculated,
    /// Set by the master.
    Input,
    /// Read by the master.
    Output,
    /// A continuous state of a plant.
    State,
    /// The derivative of the state of the same number.
    Derivative,
}

/// A variable with its place among all values of its type.
#[derive(Clone, Debug)]
pub struct Variable {
    /// As declared.
    pub declaration: Declaration,
    /// What it is in the FMU.
    pub role: Role,
    /// Index among the values of its type.
    pub index: usize,
    /// Value reference in the FMU.
    pub reference: u32,
}

/// All variables of a model and where their values lie.
///
/// Reals come first, block by block, so that a value reference is an index; integers, booleans and strings follow.
#[derive(Clone, Debug)]
pub struct Layout {
    /// In the order of the model description.
    pub variables: Vec<Variable>,
    /// Real parameters.
    pub parameters: Range<usize>,
    /// Calculated parameters.
    pub calculated: Range<usize>,
    /// Inputs.
    pub inputs: Range<usize>,
    /// Outputs that are not states.
    pub outputs: Range<usize>,
    /// Continuous states.
    pub states: Range<usize>,
    /// Their derivatives.
    pub derivatives: Range<usize>,
    /// First value reference of the integers.
    pub first_integer: u32,
    /// First value reference of the booleans.
    pub first_boolean: u32,
    /// First value reference of the strings.
    pub first_string: u32,
    /// One past the last value reference.
    pub end: u32,
    /// Position in `variables` by value reference.
    positions: Vec<usize>,
}

impl Layout {
    /// Numbers the declared variables of all blocks.
    ///
    /// # Panics
    /// On more than [`u32::MAX`] variables.
    pub fn new(
        parameters: Vec<Declaration>,
        calculated: Vec<Declaration>,
        inputs: Vec<Declaration>,
        outputs: Vec<Declaration>,
        states: Vec<Declaration>,
    ) -> Self {
        let derivatives: Vec<_> = states.iter().map(derivative_of).collect();
        let blocks = [
            (Role::Parameter, parameters),
            (Role::Calculated, calculated),
            (Role::Input, inputs),
            (Role::Output, outputs),
            (Role::State, states),
            (Role::Derivative, derivatives),
        ];
        let mut counts = [0_usize; 4];
        let mut variables = Vec::new();
        let mut ranges = Vec::new();
        for (role, block) in blocks {
            let first = counts[0];
            for declaration in block {
                let index = &mut counts[declaration.kind.type_number()];
                variables.push(Variable { declaration, role, index: *index, reference: 0 });
                *index += 1;
            }
            ranges.push(first..counts[0]);
        }
        let mut first = [0_u32; 5];
        for i in 0..4 {
            first[i + 1] = first[i] + u32::try_from(counts[i]).expect("fewer than 2^32 variables");
        }
        let mut positions = vec![0; variables.len()];
        for (position, variable) in variables.iter_mut().enumerate() {
            variable.reference =
                first[variable.declaration.kind.type_number()] + u32::try_from(variable.index).expect("checked above");
            positions[variable.reference as usize] = position;
        }
        let mut ranges = ranges.into_iter();
        let mut next = || ranges.next().expect("one range per block");
        Self {
            parameters: next(),
            calculated: next(),
            inputs: next(),
            outputs: next(),
            states: next(),
            derivatives: next(),
            first_integer: first[1],
            first_boolean: first[2],
            first_string: first[3],
            end: first[4],
            variables,
            positions,
        }
    }

    /// The variable of a value reference.
    pub fn by_reference(&self, reference: u32) -> Option<&Variable> {
        self.positions.get(reference as usize).map(|&position| &self.variables[position])
    }

    /// The real variable `index`.
    pub fn real(&self, index: usize) -> &Variable {
        &self.variables[self.positions[index]]
    }

    /// Start value of the real variable `index`.
    pub fn start(&self, index: usize) -> f64 {
        match &self.real(index).declaration.kind {
            Kind::Real(real) => real.start,
            _ => unreachable!("reals are numbered apart"),
        }
    }

    /// Name of the real variable `index`.
    pub fn real_name(&self, index: usize) -> &str {
        &self.real(index).declaration.name
    }

    /// Number of a variable in ModelStructure, which counts from 1, by value reference.
    pub fn structure_index(&self, reference: u32) -> usize {
        self.positions[reference as usize] + 1
    }

    /// How many real values there are.
    pub fn reals(&self) -> usize {
        self.derivatives.end
    }
}

impl Kind {
    fn type_number(&self) -> usize {
        match self {
            Self::Real(_) => 0,
            Self::Integer { .. } => 1,
            Self::Boolean { .. } => 2,
            Self::String { .. } => 3,
        }
    }
    /// Name of the type in the FMI standard.
    pub fn type_name(&self) -> &'static str {
        ["Real", "Integer", "Boolean", "String"][self.type_number()]
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
