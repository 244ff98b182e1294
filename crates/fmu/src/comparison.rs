//! Comparisons in equations. [`model`](macro@crate::model) replaces the operators with these functions, which do the
//! same but cause a specific error message for the generic number type of the equations.

/// Operands of `<`, `<=`, `>` and `>=`.
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no comparison, use `if_greater`, `min`, `max`, `clamp` or `sign`",
    label = "a number in the equations",
    note = "an `if` on a number in the equations would hide the dependencies of the branch not taken",
    note = "for example `x.if_greater(T::from(limit), then, otherwise)`; `x.value()` is a plain number that can be compared"
)]
pub trait Ordered<Rhs: ?Sized> {
    /// `self > other`.
    fn greater(&self, other: &Rhs) -> bool;
    /// `self >= other`.
    fn greater_or_equal(&self, other: &Rhs) -> bool;
    /// `self < other`.
    fn less(&self, other: &Rhs) -> bool;
    /// `self <= other`.
    fn less_or_equal(&self, other: &Rhs) -> bool;
}

/// Operands of `==` and `!=`.
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no comparison, use `if_greater`, `min`, `max`, `clamp` or `sign`",
    label = "a number in the equations",
    note = "an `if` on a number in the equations would hide the dependencies of the branch not taken",
    note = "`x.value()` is a plain number that can be compared; other types derive `PartialEq`"
)]
pub trait Equal<Rhs: ?Sized> {
    /// `self == other`.
    fn equal(&self, other: &Rhs) -> bool;
    /// `self != other`.
    fn not_equal(&self, other: &Rhs) -> bool;
}

macro_rules! compare {
    ($trait:ident: $bound:ident, $($function:ident $operator:tt)*) => {
        #[diagnostic::do_not_recommend]
        impl<L: $bound<R> + ?Sized, R: ?Sized> $trait<R> for L {
            $(
                #[inline]
                fn $function(&self, other: &R) -> bool {
                    self $operator other
                }
            )*
        }
    };
}
compare!(Ordered: PartialOrd, greater > greater_or_equal >= less < less_or_equal <=);
compare!(Equal: PartialEq, equal == not_equal !=);
