//! Named values of a variable.

use crate::discrete_state::{Word, Words};

/// Named values. Derive [`Enumeration`](crate::derive::Enumeration) for an enum without data.
///
/// In the FMU the variable is an Integer with a type that lists the names, because several masters cannot set FMI
/// enumerations; `#[var(enumeration)]` makes it an FMI Enumeration.
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not have named values",
    note = "add `#[derive(Enumeration)]` to an enum without data"
)]
pub trait Enumeration: Sized + Send + 'static {
    /// Name of the type in the model description.
    const NAME: &'static str;
    /// The values, in increasing order.
    const ITEMS: &'static [Item];
    /// The first one: start value of inputs and outputs.
    fn first() -> Self;
    /// The variant of this value.
    fn from_value(value: i32) -> Option<Self>;
    /// The value of this variant.
    fn value(&self) -> i32;
}

/// One value of an [`Enumeration`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item {
    /// The number in the FMU.
    pub value: i32,
    /// Name in lower snake case.
    pub name: &'static str,
    /// Meaning.
    pub description: &'static str,
}

/// The variant of a value that was checked when it was set.
#[doc(hidden)]
#[inline]
pub fn read<E: Enumeration>(value: i32) -> E {
    E::from_value(value).unwrap_or_else(E::first)
}

#[doc(hidden)]
pub fn save<E: Enumeration>(value: &E, sink: &mut dyn FnMut(Word<'_>)) {
    sink(Word::Whole(u64::from(value.value().cast_unsigned())));
}

#[doc(hidden)]
pub fn load<E: Enumeration>(name: &'static str, source: &mut Words<'_>) -> Result<E, String> {
    let word = source.whole(name)?;
    let value = u32::try_from(word).ok().and_then(|word| E::from_value(word.cast_signed()));
    value.ok_or_else(|| format!("'{name}' = {word} is not a value of {}", E::NAME))
}
