//! The values of all variables of an instance, by type.

use crate::runner::Model;
use crate::variable::{Declaration, Kind, Layout, Variable};
use crate::variables::{Counts, Values, ValuesMut, Variables as _};

/// The values of all variables, by type.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueStore {
    /// Reals.
    pub reals: Box<[f64]>,
    /// Integers and enumerations.
    pub integers: Box<[i32]>,
    /// Booleans.
    pub booleans: Box<[bool]>,
    /// Strings.
    pub strings: Box<[String]>,
}

impl ValueStore {
    /// The start values.
    #[must_use]
    pub fn start(layout: &Layout) -> Self {
        Self::of(layout.variables.iter().map(|variable| &variable.declaration))
    }

    /// The start values of some variables.
    pub(crate) fn of<'a>(declarations: impl IntoIterator<Item = &'a Declaration>) -> Self {
        let (mut reals, mut integers, mut booleans, mut strings) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for declaration in declarations {
            match &declaration.kind {
                Kind::Real(real) => reals.push(real.start),
                Kind::Integer { start, .. } => integers.push(*start),
                Kind::Boolean { start } => booleans.push(*start),
                Kind::String { start } => strings.push(start.clone()),
            }
        }
        Self { reals: reals.into(), integers: integers.into(), booleans: booleans.into(), strings: strings.into() }
    }

    /// View to read from.
    #[inline]
    #[must_use]
    pub fn view(&self) -> Values<'_, f64> {
        Values { reals: &self.reals, integers: &self.integers, booleans: &self.booleans, strings: &self.strings }
    }

    /// View to write to.
    #[inline]
    pub fn view_mut(&mut self) -> ValuesMut<'_, f64> {
        ValuesMut {
            reals: &mut self.reals,
            integers: &mut self.integers,
            booleans: &mut self.booleans,
            strings: &mut self.strings,
        }
    }

    /// All but the reals, for equations of another number type.
    pub(crate) fn others<T>(&self) -> Values<'_, T> {
        Values { reals: &[], integers: &self.integers, booleans: &self.booleans, strings: &self.strings }
    }

    /// Returns true if a variable has another value in `other`.
    pub(crate) fn differs(&self, other: &Self, variable: &Variable) -> bool {
        let index = variable.index;
        match variable.declaration.kind {
            Kind::Real(_) => self.reals[index] != other.reals[index],
            Kind::Integer { .. } => self.integers[index] != other.integers[index],
            Kind::Boolean { .. } => self.booleans[index] != other.booleans[index],
            Kind::String { .. } => self.strings[index] != other.strings[index],
        }
    }

    pub(crate) fn parameters<M: Model>(&self) -> M::Parameters {
        M::Parameters::read(self.view(), Counts::ZERO)
    }
}
