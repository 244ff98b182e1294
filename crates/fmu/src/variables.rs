//! Converts structs of variables to declarations and to flat lists of values.

use std::marker::PhantomData;

use crate::bytes::Bytes;
use crate::clocks::Clock;
use crate::declare::{Name, Spec};
use crate::number::{Number as _, Size};
use crate::scalar::Scalar;
use crate::store::{Counts, ValueStore, Values, ValuesMut};
use crate::variable::Declaration;

/// The type of a field: a variable, or an array of variables.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not the type of a variable",
    note = "variables are `{T}`, `f32`, integers of 8 to 64 bits, `bool`, `String`, `Bytes`, an enum with \
            `#[derive(Enumeration)]`, or arrays of these",
    note = "for a struct of variables, write `#[var(nested)]`"
)]
pub trait Field<T>: Sized {
    /// Start value, or start values of an array.
    #[doc(hidden)]
    type Start;
    /// Number of values in the field.
    #[doc(hidden)]
    const COUNTS: Counts;
    /// True if the variables are real.
    #[doc(hidden)]
    const IS_REAL: bool;
    /// Adds the variables.
    #[doc(hidden)]
    fn declare(spec: &Spec, start: Option<Self::Start>, all: &mut Vec<Declaration>);
    /// Reads the values at a position.
    #[doc(hidden)]
    fn read(values: Values<'_, T>, at: Counts) -> Self;
    /// Writes the values to a position.
    #[doc(hidden)]
    fn write(&self, values: &mut ValuesMut<'_, T>, at: Counts);
}

/// A field of a continuous state.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not the type of a continuous state",
    note = "states are `{T}` or arrays of it; other types belong to the discrete state"
)]
pub trait RealField<T>: Field<T> {
    /// Combines two states element by element.
    fn combine(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self;
}

impl<T: Scalar> Field<T> for T {
    type Start = f64;
    const COUNTS: Counts = Counts::REAL;
    const IS_REAL: bool = true;
    fn declare(spec: &Spec, start: Option<f64>, all: &mut Vec<Declaration>) {
        spec.declare_real(start, all);
    }
    #[inline]
    fn read(values: Values<'_, T>, at: Counts) -> Self {
        values.reals[at.reals]
    }
    #[inline]
    fn write(&self, values: &mut ValuesMut<'_, T>, at: Counts) {
        values.reals[at.reals] = *self;
    }
}

impl<T: Scalar> RealField<T> for T {
    #[inline]
    fn combine(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self {
        f(*self, *other)
    }
}

macro_rules! field {
    ($($type:ty = $start:ty: $values:ident $counts:ident $declare:ident;)*) => {$(
        #[diagnostic::do_not_recommend]
        impl<T: Scalar> Field<T> for $type {
            type Start = $start;
            const COUNTS: Counts = Counts::$counts;
            const IS_REAL: bool = false;
            fn declare(spec: &Spec, start: Option<$start>, all: &mut Vec<Declaration>) {
                spec.$declare(start, all);
            }
            #[inline]
            fn read(values: Values<'_, T>, at: Counts) -> Self {
                values.$values[at.$values].clone()
            }
            #[inline]
            fn write(&self, values: &mut ValuesMut<'_, T>, at: Counts) {
                values.$values[at.$values].clone_from(self);
            }
        }
    )*};
}
field! {
    bool = bool: booleans BOOLEAN declare_boolean;
    String = &'static str: strings STRING declare_string;
}

macro_rules! number_field {
    ($($type:ty, |$spec:ident, $start:ident, $all:ident| $declare:expr;)*) => {$(
        #[diagnostic::do_not_recommend]
        impl<T: Scalar> Field<T> for $type {
            type Start = Self;
            const COUNTS: Counts = Counts::WORD;
            const IS_REAL: bool = <$type as crate::number::Number>::SIZE.is_none();
            fn declare($spec: &Spec, $start: Option<Self>, $all: &mut Vec<Declaration>) {
                $declare;
            }
            #[inline]
            fn read(values: Values<'_, T>, at: Counts) -> Self {
                Self::of(values.words[at.words])
            }
            #[inline]
            fn write(&self, values: &mut ValuesMut<'_, T>, at: Counts) {
                values.words[at.words] = self.word();
            }
        }
    )*};
}
number_field! {
    f32, |spec, start, all| spec.declare_float32(start, all);
    i8, |spec, start, all| spec.declare_integer(Size::Int8, start.map(i128::from), all);
    u8, |spec, start, all| spec.declare_integer(Size::UInt8, start.map(i128::from), all);
    i16, |spec, start, all| spec.declare_integer(Size::Int16, start.map(i128::from), all);
    u16, |spec, start, all| spec.declare_integer(Size::UInt16, start.map(i128::from), all);
    i32, |spec, start, all| spec.declare_integer(Size::Int32, start.map(i128::from), all);
    u32, |spec, start, all| spec.declare_integer(Size::UInt32, start.map(i128::from), all);
    i64, |spec, start, all| spec.declare_integer(Size::Int64, start.map(i128::from), all);
    u64, |spec, start, all| spec.declare_integer(Size::UInt64, start.map(i128::from), all);
}

impl<T: Scalar, const N: usize> Field<T> for Bytes<N> {
    type Start = Vec<u8>;
    const COUNTS: Counts = Counts::BINARY;
    const IS_REAL: bool = false;
    fn declare(spec: &Spec, start: Option<Vec<u8>>, all: &mut Vec<Declaration>) {
        spec.declare_binary(N, start, all);
    }
    #[inline]
    fn read(values: Values<'_, T>, at: Counts) -> Self {
        let mut bytes = Self::new();
        bytes.set(&values.binaries[at.binaries]);
        bytes
    }
    #[inline]
    fn write(&self, values: &mut ValuesMut<'_, T>, at: Counts) {
        values.binaries[at.binaries].set(self);
    }
}

/// A clock has no start value.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub enum NoStart {}

impl<T: Scalar> Field<T> for Clock {
    type Start = NoStart;
    const COUNTS: Counts = Counts::BOOLEAN;
    const IS_REAL: bool = false;
    fn declare(spec: &Spec, _: Option<NoStart>, all: &mut Vec<Declaration>) {
        spec.declare_clock(all);
    }
    #[inline]
    fn read(values: Values<'_, T>, at: Counts) -> Self {
        Self(values.booleans[at.booleans])
    }
    #[inline]
    fn write(&self, values: &mut ValuesMut<'_, T>, at: Counts) {
        values.booleans[at.booleans] = self.0;
    }
}

/// Start values of an array: one for all elements, or one for each.
#[derive(Clone, Debug)]
pub enum Starts<S, const N: usize> {
    /// The same for all elements.
    All(S),
    /// One per element; on the heap, because an array in a large model could overflow the stack.
    Each(Vec<S>),
}

impl<S, const N: usize> From<S> for Starts<S, N> {
    fn from(start: S) -> Self {
        Self::All(start)
    }
}

impl<S, const N: usize> From<[S; N]> for Starts<S, N> {
    fn from(starts: [S; N]) -> Self {
        Self::Each(starts.into())
    }
}

/// Number of listed start values.
#[doc(hidden)]
pub struct Listed<const M: usize>;

/// Implemented only if the number of start values is `N`.
#[doc(hidden)]
#[diagnostic::on_unimplemented(
    message = "wrong number of start values: the array has {N} elements",
    label = "list one start value for each of the {N} elements, or write one for all"
)]
pub trait FitsArrayOf<const N: usize> {}
impl<const N: usize> FitsArrayOf<N> for Listed<N> {}

impl<S, const N: usize> Starts<S, N> {
    /// One start value per element.
    #[doc(hidden)]
    pub fn listed<const M: usize>(starts: [S; M]) -> Self
    where
        Listed<M>: FitsArrayOf<N>,
    {
        Self::Each(starts.into())
    }
}

impl<S: Clone, const N: usize> Starts<S, N> {
    /// The start value of each element.
    pub fn each(self) -> Vec<S> {
        match self {
            Self::All(start) => vec![start; N],
            Self::Each(starts) => starts,
        }
    }
}

/// Declares the elements of an array.
#[doc(hidden)]
pub fn declare_elements<T, F: Field<T>, const N: usize>(
    spec: impl Fn(usize) -> Spec,
    start: Option<Starts<F::Start, N>>,
    all: &mut Vec<Declaration>,
) where
    F::Start: Clone,
{
    // An `Option` of the iterator would compile to a harmless branch on an uninitialized value, which valgrind reports.
    let mut starts = start.map_or_else(Vec::new, Starts::each).into_iter();
    let first = all.len();
    for i in 0..N {
        F::declare(&spec(i), starts.next(), all);
    }
    for array in all[first..].iter_mut().filter_map(|declaration| declaration.array.as_mut()) {
        array.dimensions.insert(0, N);
    }
}

impl<T, F: Field<T>, const N: usize> Field<T> for [F; N]
where
    F::Start: Clone,
{
    type Start = Starts<F::Start, N>;
    const COUNTS: Counts = F::COUNTS.times(N);
    const IS_REAL: bool = F::IS_REAL;
    fn declare(spec: &Spec, start: Option<Self::Start>, all: &mut Vec<Declaration>) {
        declare_elements::<T, F, N>(|i| spec.indexed(i), start, all);
    }
    #[inline]
    fn read(values: Values<'_, T>, at: Counts) -> Self {
        std::array::from_fn(|i| F::read(values, at.plus(F::COUNTS.times(i))))
    }
    #[inline]
    fn write(&self, values: &mut ValuesMut<'_, T>, at: Counts) {
        for (i, field) in self.iter().enumerate() {
            field.write(values, at.plus(F::COUNTS.times(i)));
        }
    }
}

impl<T, F: RealField<T>, const N: usize> RealField<T> for [F; N]
where
    F::Start: Clone,
{
    #[inline]
    fn combine(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self {
        std::array::from_fn(|i| self[i].combine(&other[i], f))
    }
}

/// Declares an array type whose elements have names.
///
/// ```
/// fmu::named_array! {
///     /// Left and right.
///     pub Sides[2] {
///         l: "left side",
///         r: "right side",
///     }
/// }
/// let heights = Sides([0.1, 0.2]);
/// assert_eq!((heights.l(), heights[1]), (0.1, 0.2));
/// assert_eq!(Sides::<f64>::ELEMENTS[0].name, "l");
/// ```
#[macro_export]
macro_rules! named_array {
    ($(#[$doc:meta])* $visibility:vis $name:ident[$count:literal] { $($element:ident: $words:literal),+ $(,)? }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        $visibility struct $name<T>(pub [T; $count]);

        impl<T> $name<T> {
            /// The elements, in order.
            pub const ELEMENTS: &'static [$crate::__private::Element; $count] =
                &[$($crate::__private::Element { name: stringify!($element), description: $words }),+];

            /// One value per element, from its index.
            #[inline]
            pub fn from_fn(f: impl FnMut(usize) -> T) -> Self {
                Self(std::array::from_fn(f))
            }
        }

        const _: () = {
            #[allow(non_camel_case_types)]
            enum Index { $($element),+ }

            #[allow(
                dead_code,
                non_snake_case,
                unreachable_pub,
                reason = "a model may use only some of the elements, and may declare the type in a private module"
            )]
            impl<T: Copy> $name<T> {
                $(
                    #[doc = concat!("The value of the ", $words, ".")]
                    #[inline]
                    pub fn $element(&self) -> T {
                        self.0[Index::$element as usize]
                    }
                )+
            }
        };

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

        impl<T: $crate::Scalar, F: $crate::Field<T>> $crate::Field<T> for $name<F>
        where
            F::Start: Clone,
        {
            type Start = $crate::__private::Starts<F::Start, $count>;
            const COUNTS: $crate::__private::Counts = F::COUNTS.times($count);
            const IS_REAL: bool = F::IS_REAL;
            fn declare(
                spec: &$crate::__private::Spec,
                start: Option<Self::Start>,
                all: &mut Vec<$crate::__private::Declaration>,
            ) {
                let element = |i: usize| spec.element(i, &Self::ELEMENTS[i]);
                $crate::__private::declare_elements::<T, F, $count>(element, start, all);
            }
            #[inline]
            fn read(values: $crate::__private::Values<'_, T>, at: $crate::__private::Counts) -> Self {
                Self(<[F; $count] as $crate::Field<T>>::read(values, at))
            }
            #[inline]
            fn write(&self, values: &mut $crate::__private::ValuesMut<'_, T>, at: $crate::__private::Counts) {
                $crate::Field::<T>::write(&self.0, values, at);
            }
        }

        impl<T: $crate::Scalar, F: $crate::__private::RealField<T>> $crate::__private::RealField<T> for $name<F>
        where
            F::Start: Clone,
        {
            #[inline]
            fn combine(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self {
                Self::from_fn(|i| self.0[i].combine(&other.0[i], f))
            }
        }
    };
}

/// A struct of variables: parameters, inputs, outputs or states. Derive [`Parameters`](crate::derive::Parameters),
/// [`Inputs`](crate::derive::Inputs), [`Outputs`](crate::derive::Outputs) or [`State`](crate::derive::State).
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not a struct of variables",
    note = "derive `Parameters`, `Inputs`, `Outputs` or `State`; without a type parameter its numbers are `f64`"
)]
pub trait Variables<T: Scalar>: Sized {
    /// Number of values in the struct.
    #[doc(hidden)]
    const COUNTS: Counts = Counts::ZERO;
    /// True if a variable has an explicit start value.
    #[doc(hidden)]
    const HAS_STARTS: bool = false;
    /// True if there are structural parameters.
    #[doc(hidden)]
    const HAS_STRUCTURE: bool = false;
    /// Names of the fields.
    #[doc(hidden)]
    const NAMES: &'static [Name] = &[];
    /// Adds the variables, in the order of the values.
    #[doc(hidden)]
    fn declare(_all: &mut Vec<Declaration>) {}
    /// Reads the values at a position.
    #[doc(hidden)]
    fn read(values: Values<'_, T>, at: Counts) -> Self;
    /// Writes the values to a position.
    #[doc(hidden)]
    #[inline]
    fn write(&self, _values: &mut ValuesMut<'_, T>, _at: Counts) {}

    /// The variables.
    #[doc(hidden)]
    fn declarations() -> Vec<Declaration> {
        let mut all = Vec::new();
        Self::declare(&mut all);
        all
    }
    /// The reals as a list. Panics if there are variables of other types.
    fn reals(&self) -> Vec<T> {
        let mut reals = vec![T::from(0.0); Self::COUNTS.reals];
        self.write(&mut ValuesMut::of_reals(&mut reals), Counts::ZERO);
        reals
    }
    /// Creates the struct from a list of reals. Panics if there are too few, or variables of other types.
    #[inline]
    fn from_reals(reals: &[T]) -> Self {
        Self::read(Values::of_reals(reals), Counts::ZERO)
    }
}

/// The state of a continuous-time model. Derive [`State`](crate::derive::State).
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not the state of a continuous-time model",
    note = "derive `State` for a struct with the number type of the equations, as in `struct X<T>`"
)]
pub trait ContinuousState<T: Scalar>: Variables<T> {
    /// Combines two states element by element, as for a sum.
    fn combine(&self, other: &Self, f: impl Fn(T, T) -> T + Copy) -> Self;

    /// A copy.
    fn copied(&self) -> Self {
        self.combine(self, |x, _| x)
    }
}

/// The parameters of a model. Derive [`Parameters`](crate::derive::Parameters).
#[diagnostic::on_unimplemented(
    message = "`{Self}` does not declare its parameters",
    note = "add `#[derive(Parameters)]`; a model without parameters is a struct without fields"
)]
pub trait Parameters: Variables<f64> + Default + Send + 'static {
    /// The fields of the struct, each with the number of its values of each type.
    #[doc(hidden)]
    const FIELDS: &'static [(&'static str, Counts)] = &[];
}

/// Values that follow from the parameters: gains, tables, static loads. Derive
/// [`Derived`](crate::derive::Derived); fields with `#[var]` are calculated parameters of the FMU.
pub trait Derived: Send + Sync + 'static {
    /// Names of the calculated parameters.
    #[doc(hidden)]
    const NAMES: &'static [Name] = &[];
    /// Adds the calculated parameters.
    #[doc(hidden)]
    fn declare(_all: &mut Vec<Declaration>) {}
    /// Writes the calculated parameters to a position.
    #[doc(hidden)]
    fn write(&self, _values: &mut ValuesMut<'_, f64>, _at: Counts) {}
}

impl<T: Scalar> Variables<T> for () {
    #[inline]
    fn read(_: Values<'_, T>, _: Counts) -> Self {}
}

impl<T: Scalar> ContinuousState<T> for () {
    #[inline]
    fn combine(&self, (): &Self, _: impl Fn(T, T) -> T + Copy) -> Self {}
}

impl Derived for () {}

/// The names in a struct of variables. A type without the derive has none ([`NoNames`]); the missing derive is reported
/// elsewhere.
pub struct NamesOf<V>(PhantomData<V>);

impl<V: Variables<f64>> NamesOf<V> {
    /// Names from the derive.
    pub const NAMES: &'static [Name] = V::NAMES;
}

/// [`NamesOf`] for derived parameters.
pub struct NamesOfDerived<D>(PhantomData<D>);

impl<D: Derived> NamesOfDerived<D> {
    /// Names from the derive.
    pub const NAMES: &'static [Name] = D::NAMES;
}

/// Fallback for a type without the derive.
pub trait NoNames {
    /// No names.
    const NAMES: &'static [Name] = &[];
}

impl<V> NoNames for NamesOf<V> {}
impl<D> NoNames for NamesOfDerived<D> {}

/// A struct of variables with its start values.
#[must_use]
pub fn start_values<T: Scalar, V: Variables<T>>() -> V {
    let starts = ValueStore::of(&V::declarations());
    let reals: Vec<T> = starts.reals.iter().map(|&start| T::from(start)).collect();
    V::read(starts.with_reals(&reals), Counts::ZERO)
}
