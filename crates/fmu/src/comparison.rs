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
    fn is_greater(&self, other: &Rhs) -> bool;
    /// `self >= other`.
    fn is_greater_or_equal(&self, other: &Rhs) -> bool;
    /// `self < other`.
    fn is_less(&self, other: &Rhs) -> bool;
    /// `self <= other`.
    fn is_less_or_equal(&self, other: &Rhs) -> bool;
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
    fn is_equal(&self, other: &Rhs) -> bool;
    /// `self != other`.
    fn is_not_equal(&self, other: &Rhs) -> bool;
}

#[diagnostic::do_not_recommend]
impl<L: PartialOrd<R> + ?Sized, R: ?Sized> Ordered<R> for L {
    #[inline]
    fn is_greater(&self, other: &R) -> bool {
        self > other
    }
    #[inline]
    fn is_greater_or_equal(&self, other: &R) -> bool {
        self >= other
    }
    #[inline]
    fn is_less(&self, other: &R) -> bool {
        self < other
    }
    #[inline]
    fn is_less_or_equal(&self, other: &R) -> bool {
        self <= other
    }
}

#[diagnostic::do_not_recommend]
impl<L: PartialEq<R> + ?Sized, R: ?Sized> Equal<R> for L {
    #[inline]
    fn is_equal(&self, other: &R) -> bool {
        self == other
    }
    #[inline]
    fn is_not_equal(&self, other: &R) -> bool {
        self != other
    }
}

/// `left > right`.
#[inline]
pub fn greater<L: Ordered<R> + ?Sized, R: ?Sized>(left: &L, right: &R) -> bool {
    left.is_greater(right)
}

/// `left >= right`.
#[inline]
pub fn greater_or_equal<L: Ordered<R> + ?Sized, R: ?Sized>(left: &L, right: &R) -> bool {
    left.is_greater_or_equal(right)
}

/// `left < right`.
#[inline]
pub fn less<L: Ordered<R> + ?Sized, R: ?Sized>(left: &L, right: &R) -> bool {
    left.is_less(right)
}

/// `left <= right`.
#[inline]
pub fn less_or_equal<L: Ordered<R> + ?Sized, R: ?Sized>(left: &L, right: &R) -> bool {
    left.is_less_or_equal(right)
}

/// `left == right`.
#[inline]
pub fn equal<L: Equal<R> + ?Sized, R: ?Sized>(left: &L, right: &R) -> bool {
    left.is_equal(right)
}

/// `left != right`.
#[inline]
pub fn not_equal<L: Equal<R> + ?Sized, R: ?Sized>(left: &L, right: &R) -> bool {
    left.is_not_equal(right)
}
