//! Comparisons in equations, as [`model`](macro@crate::model) writes them: those of `PartialOrd` and `PartialEq`, with a
//! message of their own for the numbers of the equations.

/// Operands of `<`, `<=`, `>` and `>=`.
#[diagnostic::on_unimplemented(
    message = "`{Self}` has no comparison, use `if_greater`, `min`, `max`, `clamp` or `sign`",
    label = "a number of the equations",
    note = "a branch on a number of the equations would hide the dependencies of its other side",
    note = "as in `x.if_greater(T::from(limit), then, otherwise)`; `x.value()` is a plain number to compare"
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
    label = "a number of the equations",
    note = "a branch on a number of the equations would hide the dependencies of its other side",
    note = "`x.value()` is a plain number to compare; other types derive `PartialEq`"
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
