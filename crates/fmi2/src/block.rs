//! Blocks of values: the structs that a model declares, as flat lists of numbers and as lists of declarations.

use crate::scalar::Scalar;
use crate::variable::Declaration;

/// One place of a family, for example the front left wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// What follows the dot in the name, for example `fl`.
    pub suffix: &'static str,
    /// The place in words, for example `front left wheel`.
    pub words: &'static str,
}

/// A field of a block: one number, or a family of numbers over places.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is neither a number of type `{T}` nor a family of them",
    note = "a family is declared with `fmi2::family!`; a choice among named values is a parameter with the flag `mode`"
)]
pub trait Field<T>: Sized {
    /// How many numbers the field holds.
    const LEN: usize;
    /// Suffix (without its dot; empty for a single number) and words of every number.
    fn places() -> Vec<(String, String)>;
    /// From the first [`Self::LEN`] of `values`.
    fn read(values: &[T]) -> Self;
    /// To the first [`Self::LEN`] of `values`.
    fn write(&self, values: &mut [T]);
    /// Number by number.
    fn zip(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self;
}

impl<T: Scalar> Field<T> for T {
    const LEN: usize = 1;
    fn places() -> Vec<(String, String)> {
        vec![(String::new(), String::new())]
    }
    #[inline]
    fn read(values: &[T]) -> Self {
        values[0]
    }
    #[inline]
    fn write(&self, values: &mut [T]) {
        values[0] = *self;
    }
    #[inline]
    fn zip(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self {
        f(*self, *other)
    }
}

/// Declares a family: an array whose places have names, used as the type of a block's field.
///
/// ```
/// fmi2::family! {
///     /// Left and right.
///     pub Sides[2] {
///         l: "left side",
///         r: "right side",
///     }
/// }
/// let heights = Sides([0.1, 0.2]);
/// assert_eq!(heights[1], 0.2);
/// ```
#[macro_export]
macro_rules! family {
    ($(#[$doc:meta])* $visibility:vis $name:ident[$count:literal] { $($suffix:ident: $words:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        $visibility struct $name<T>(pub [T; $count]);

        impl<T> $name<T> {
            /// The places, in order.
            pub const PLACES: &'static [$crate::Place; $count] =
                &[$($crate::Place { suffix: stringify!($suffix), words: $words }),+];

            /// One value per place, from its number.
            #[inline]
            pub fn from_fn(f: impl FnMut(usize) -> T) -> Self {
                Self(std::array::from_fn(f))
            }
        }

        impl<T> std::ops::Deref for $name<T> {
            type Target = [T; $count];
            #[inline]
            fn deref(&self) -> &Self::Target {
                &self.0
            }
        }

        impl<T> std::ops::DerefMut for $name<T> {
            #[inline]
            fn deref_mut(&mut self) -> &mut Self::Target {
                &mut self.0
            }
        }

        impl<T: $crate::Scalar, F: $crate::Field<T>> $crate::Field<T> for $name<F> {
            const LEN: usize = Self::PLACES.len() * F::LEN;
            fn places() -> Vec<(String, String)> {
                $crate::block::nest(Self::PLACES, F::places())
            }
            #[inline]
            fn read(values: &[T]) -> Self {
                Self::from_fn(|i| F::read(&values[i * F::LEN..]))
            }
            #[inline]
            fn write(&self, values: &mut [T]) {
                for (i, field) in self.0.iter().enumerate() {
                    field.write(&mut values[i * F::LEN..]);
                }
            }
            #[inline]
            fn zip(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self {
                Self::from_fn(|i| self.0[i].zip(&other.0[i], f))
            }
        }
    };
}

/// Places of a family whose members may be families themselves.
#[doc(hidden)]
pub fn nest(outer: &[Place], inner: Vec<(String, String)>) -> Vec<(String, String)> {
    outer
        .iter()
        .flat_map(|place| {
            inner.iter().map(|(suffix, words)| {
                let join = |a: &str, b: &str, with: &str| {
                    if b.is_empty() { a.to_owned() } else { format!("{a}{with}{b}") }
                };
                (join(place.suffix, suffix, "."), join(place.words, words, ", "))
            })
        })
        .collect()
}

/// A struct of numbers: inputs, outputs, or the continuous state of a plant. Derive [`Inputs`](crate::derive::Inputs),
/// [`Outputs`](crate::derive::Outputs) or [`State`](crate::derive::State).
pub trait Block<T: Scalar>: Clone {
    /// How many numbers the block holds.
    const LEN: usize;
    /// The variables, in the order of the numbers.
    fn declare() -> Vec<Declaration>;
    /// From a flat list of at least [`Self::LEN`] numbers.
    fn read(values: &[T]) -> Self;
    /// To a flat list of at least [`Self::LEN`] numbers.
    fn write(&self, values: &mut [T]);
    /// Number by number; the integrator adds states with it.
    fn zip(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self;
    /// The numbers as a list of their own.
    fn numbers(&self) -> Vec<T> {
        let mut values = vec![T::from(0.0); Self::LEN];
        self.write(&mut values);
        values
    }
}

/// The parameters of a model. Derive [`Parameters`](crate::derive::Parameters).
pub trait Parameters: Clone + Default + 'static {
    /// The variables, in declared order.
    fn declare() -> Vec<Declaration>;
    /// Takes the values one by one, in declared order.
    fn read(values: &mut ParameterReader<'_>) -> Self;
}

/// The values of all parameters, by type, in declared order.
#[derive(Debug)]
pub struct ParameterReader<'a> {
    reals: &'a [f64],
    integers: &'a [i32],
    booleans: &'a [bool],
    strings: &'a [String],
}

impl<'a> ParameterReader<'a> {
    /// Starts at the first of each.
    pub fn new(reals: &'a [f64], integers: &'a [i32], booleans: &'a [bool], strings: &'a [String]) -> Self {
        Self { reals, integers, booleans, strings }
    }
    fn next<V: Clone>(values: &mut &'a [V]) -> V {
        let (first, rest) = values.split_first().expect("as many values as declarations");
        *values = rest;
        first.clone()
    }
}

/// A type that a parameter's field may have: numbers and families of them, modes, switches and texts.
pub trait ParameterField: Sized {
    /// Takes as many values as it needs.
    fn read(values: &mut ParameterReader<'_>) -> Self;
}

impl ParameterField for bool {
    fn read(values: &mut ParameterReader<'_>) -> Self {
        ParameterReader::next(&mut values.booleans)
    }
}
impl ParameterField for String {
    fn read(values: &mut ParameterReader<'_>) -> Self {
        ParameterReader::next(&mut values.strings)
    }
}
impl ParameterField for i32 {
    fn read(values: &mut ParameterReader<'_>) -> Self {
        ParameterReader::next(&mut values.integers)
    }
}

/// Takes a number or a family of numbers.
#[doc(hidden)]
pub fn read_reals<F: Field<f64>>(values: &mut ParameterReader<'_>) -> F {
    let field = F::read(values.reals);
    values.reals = &values.reals[F::LEN..];
    field
}

/// A choice among named values; in the FMU an integer parameter. Derive [`Mode`](crate::derive::Mode) for an
/// enum without data.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no choice among named values",
    note = "a choice is an enum with `#[derive(Mode)]`"
)]
pub trait Mode: Copy + 'static {
    /// Name of the type in the model description.
    const NAME: &'static str;
    /// Value, name and meaning of every choice, in rising order.
    const CHOICES: &'static [Choice];
    /// The choice of this value.
    fn from_value(value: i32) -> Option<Self>;
    /// The value of this choice.
    fn value(self) -> i32;
}

/// One value of a [`Mode`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// The number that stands for it in the FMU.
    pub value: i32,
    /// Name in lower snake case.
    pub name: &'static str,
    /// What it means.
    pub description: &'static str,
}

/// Takes a mode.
#[doc(hidden)]
pub fn read_mode<M: Mode>(values: &mut ParameterReader<'_>) -> M {
    M::from_value(ParameterReader::next(&mut values.integers)).expect("a value that was checked when it was set")
}

/// Values that follow from the fixed parameters at the end of initialization: gains, tables, static loads. Derive
/// [`Design`](crate::derive::Design); fields with `#[calculated]` are readable as calculated parameters.
pub trait Design: Clone + Send + Sync + 'static {
    /// The calculated parameters, in declared order.
    fn declare() -> Vec<Declaration>;
    /// Their values, in the same order.
    fn write(&self, values: &mut [f64]);
}

impl Design for () {
    fn declare() -> Vec<Declaration> {
        Vec::new()
    }
    fn write(&self, _: &mut [f64]) {}
}

/// The memory of a sampled unit between two samples. Derive [`Memory`](crate::derive::Memory).
pub trait Memory: Clone + Default + Send + 'static {
    /// Passes every value on.
    fn save(&self, sink: &mut dyn FnMut(&'static str, Word));
    /// Takes the values back in the same order.
    ///
    /// # Errors
    /// When a value is missing or of another type.
    fn load(&mut self, source: &mut dyn FnMut() -> Option<Word>) -> Result<(), String>;
    /// Name and value of the first real number that is not finite. Fields marked `#[generated]` are left out: large
    /// buffers of values that are finite by construction would be searched at every sample.
    fn not_finite(&self) -> Option<(&'static str, f64)>;
}

impl Memory for () {
    fn not_finite(&self) -> Option<(&'static str, f64)> {
        None
    }
    fn save(&self, _: &mut dyn FnMut(&'static str, Word)) {}
    fn load(&mut self, _: &mut dyn FnMut() -> Option<Word>) -> Result<(), String> {
        Ok(())
    }
}

/// One value of a memory.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Word {
    /// A real number; it has to be finite after every step.
    Real(f64),
    /// A count, an index or a switch.
    Whole(u64),
}

/// A type that a memory's field may have.
#[diagnostic::on_unimplemented(
    message = "`{Self}` cannot be a field of a memory",
    note = "a memory holds `f64`, `u64`, `bool` and arrays of them, so that a step does not allocate"
)]
pub trait MemoryField {
    /// Passes every value on.
    fn save(&self, name: &'static str, sink: &mut dyn FnMut(&'static str, Word));
    /// Takes its values back.
    ///
    /// # Errors
    /// When a value is missing or of another type.
    fn load(&mut self, name: &'static str, source: &mut dyn FnMut() -> Option<Word>) -> Result<(), String>;
    /// The first real number that is not finite.
    fn not_finite(&self) -> Option<f64>;
}

impl MemoryField for f64 {
    fn not_finite(&self) -> Option<f64> {
        (!self.is_finite()).then_some(*self)
    }
    fn save(&self, name: &'static str, sink: &mut dyn FnMut(&'static str, Word)) {
        sink(name, Word::Real(*self));
    }
    fn load(&mut self, name: &'static str, source: &mut dyn FnMut() -> Option<Word>) -> Result<(), String> {
        match source() {
            Some(Word::Real(value)) => *self = value,
            other => return Err(format!("'{name}': a real number was expected, {other:?} found")),
        }
        Ok(())
    }
}

impl MemoryField for u64 {
    fn not_finite(&self) -> Option<f64> {
        None
    }
    fn save(&self, name: &'static str, sink: &mut dyn FnMut(&'static str, Word)) {
        sink(name, Word::Whole(*self));
    }
    fn load(&mut self, name: &'static str, source: &mut dyn FnMut() -> Option<Word>) -> Result<(), String> {
        match source() {
            Some(Word::Whole(value)) => *self = value,
            other => return Err(format!("'{name}': a whole number was expected, {other:?} found")),
        }
        Ok(())
    }
}

impl MemoryField for bool {
    fn not_finite(&self) -> Option<f64> {
        None
    }
    fn save(&self, name: &'static str, sink: &mut dyn FnMut(&'static str, Word)) {
        u64::from(*self).save(name, sink);
    }
    fn load(&mut self, name: &'static str, source: &mut dyn FnMut() -> Option<Word>) -> Result<(), String> {
        let mut word = 0_u64;
        word.load(name, source)?;
        match word {
            0 | 1 => *self = word == 1,
            other => return Err(format!("'{name}': 0 or 1 was expected, {other} found")),
        }
        Ok(())
    }
}

impl<F: MemoryField> MemoryField for [F] {
    fn not_finite(&self) -> Option<f64> {
        self.iter().find_map(F::not_finite)
    }
    fn save(&self, name: &'static str, sink: &mut dyn FnMut(&'static str, Word)) {
        self.iter().for_each(|field| field.save(name, sink));
    }
    fn load(&mut self, name: &'static str, source: &mut dyn FnMut() -> Option<Word>) -> Result<(), String> {
        self.iter_mut().try_for_each(|field| field.load(name, source))
    }
}

impl<F: MemoryField, const N: usize> MemoryField for [F; N] {
    fn not_finite(&self) -> Option<f64> {
        self.as_slice().not_finite()
    }
    fn save(&self, name: &'static str, sink: &mut dyn FnMut(&'static str, Word)) {
        self.as_slice().save(name, sink);
    }
    fn load(&mut self, name: &'static str, source: &mut dyn FnMut() -> Option<Word>) -> Result<(), String> {
        self.as_mut_slice().load(name, source)
    }
}

/// Start values written as one number for all places, or one per place.
#[doc(hidden)]
#[diagnostic::on_unimplemented(
    message = "`{Self}` is no start value of a real variable",
    note = "expected one number, as in `1.0`, or an array with one per place; a choice among named values is a \
            parameter with the flag `mode`"
)]
pub trait StartValues {
    fn start_values(self) -> Vec<f64>;
}
impl StartValues for f64 {
    fn start_values(self) -> Vec<f64> {
        vec![self]
    }
}
impl<const N: usize> StartValues for [f64; N] {
    fn start_values(self) -> Vec<f64> {
        self.to_vec()
    }
}
