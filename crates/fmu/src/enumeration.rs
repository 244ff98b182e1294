//! Named values of a variable.

use crate::discrete_state::Words;
use crate::number::Size;

/// An enum with named values. Derive [`Enumeration`](crate::derive::Enumeration) for an enum without data.
///
/// In the FMU, the variable is an Integer whose type lists the names, because several masters cannot set FMI
/// enumerations. With `#[var(enumeration)]` it is an FMI Enumeration.
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not have named values",
    note = "add `#[derive(Enumeration)]` to an enum without data"
)]
pub trait Enumeration: Sized + Send + 'static {
    /// Name of the type in the model description.
    const NAME: &'static str;
    /// The values, in increasing order.
    const ITEMS: &'static [Item];
    /// Type of the numbers, as in `#[repr(u8)]`; `i32` by default.
    #[doc(hidden)]
    const SIZE: Size = Size::Int32;
    /// The first variant, which is the start value of inputs and outputs.
    fn first() -> Self;
    /// The variant with this value.
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

/// Implements the traits for variables and for fields of a discrete state.
#[doc(hidden)]
#[macro_export]
macro_rules! enumeration_fields {
    ($name:ty) => {
        impl<T: $crate::Scalar> $crate::Field<T> for $name {
            type Start = Self;
            const COUNTS: $crate::__private::Counts = $crate::__private::Counts::WORD;
            const IS_REAL: bool = false;
            fn declare(
                spec: &$crate::__private::Spec,
                start: ::core::option::Option<Self>,
                all: &mut ::std::vec::Vec<$crate::__private::Declaration>,
            ) {
                spec.declare_enumeration(start, all);
            }
            #[inline]
            fn read(values: $crate::__private::Values<'_, T>, at: $crate::__private::Counts) -> Self {
                let value = <Self as $crate::Enumeration>::from_value(values.words[at.words] as i32);
                // The value was checked when it was set.
                value.unwrap_or_else(<Self as $crate::Enumeration>::first)
            }
            #[inline]
            fn write(&self, values: &mut $crate::__private::ValuesMut<'_, T>, at: $crate::__private::Counts) {
                values.words[at.words] = $crate::Enumeration::value(self) as u64;
            }
        }
        impl $crate::StateField for $name {
            fn save(&self, sink: &mut dyn FnMut($crate::Word<'_>)) {
                sink($crate::Word::Choice($crate::Enumeration::value(self) as u64));
            }
            fn load(
                &mut self,
                name: &'static str,
                source: &mut $crate::Words<'_>,
            ) -> ::core::result::Result<(), ::std::string::String> {
                *self = $crate::__private::enumeration::load(name, source)?;
                Ok(())
            }
        }
    };
}

/// Restores a variant. Fails if the value is missing, has another type, or is not in the enumeration.
#[doc(hidden)]
pub fn load<E: Enumeration>(name: &'static str, source: &mut Words<'_>) -> Result<E, String> {
    let word = source.choice(name)?;
    let value = i32::try_from(word).ok().and_then(E::from_value);
    value.ok_or_else(|| format!("'{name}' = {word} is not a value of {}", E::NAME))
}
