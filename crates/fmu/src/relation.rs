//! Relations: the comparisons in [`Scalar::if_greater`]. In model exchange, a change of a relation's result is an
//! event.
//!
//! A relation's side is the branch that it selects. Between two events a relation keeps its side, whatever the values
//! are (FMI 2.0, section 3.1.1); the importer's solver therefore sees smooth equations. The sign of the event indicator
//! changes where the side would change. The model needs no code for this: the equations run on [`Relational`] numbers,
//! which read the sides from the [`Relations`] in use.

use std::cell::RefCell;
use std::iter::Sum;
use std::mem::ManuallyDrop;
use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::discrete_state::{Word, Words};
use crate::scalar::{Scalar, assign_and_sum};
use crate::table::Table;

/// Magnitude of an indicator where the operands of its relation are equal. The event occurs this far beyond the point
/// of equality, so that rounding errors at an event do not cause a second event.
const BAND: f64 = 1e-9;

/// Minimum scale relative to the greater operand, whose rounding errors are then far below [`BAND`] times the scale.
const LEAST_SCALE: f64 = 1e-3;

/// To find a scale, states and inputs are changed by this fraction of their nominal values.
pub(crate) const PROBE: f64 = 1e-6;

/// The relations of a model, in the order of their evaluation: first in the derivatives, then in the outputs.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Relations {
    /// For each relation, true if the left operand is greater. Kept until the next event.
    sides: Box<[bool]>,
    /// Change of each difference if states and inputs change by their nominal values.
    scales: Box<[f64]>,
    /// First operand minus second operand, at the last evaluation.
    differences: Box<[f64]>,
    /// While scales are computed: differences at the event.
    base: Box<[f64]>,
    /// Magnitude of the greater operand.
    operands: Box<[f64]>,
    /// Index of the next relation.
    count: usize,
    is_frozen: bool,
}

thread_local! {
    /// The relations in use by the equations that run in this thread; empty between evaluations. Not dropped when the
    /// thread ends, because the destructor is in the library, which may be unloaded by then.
    static IN_USE: RefCell<ManuallyDrop<Relations>> = RefCell::new(ManuallyDrop::new(Relations::default()));
}

fn swap(relations: &mut Relations) {
    IN_USE.with_borrow_mut(|in_use| std::mem::swap(&mut **in_use, relations));
}

/// Lends relations to the equations of this thread. They are returned when the loan is dropped, even after a panic.
struct Loan<'a>(&'a mut Relations);

impl Drop for Loan<'_> {
    fn drop(&mut self) {
        swap(self.0);
    }
}

impl Relations {
    pub(crate) fn with_capacity(capacity: usize) -> Self {
        let zeros = || vec![0.0; capacity].into_boxed_slice();
        Self {
            sides: vec![false; capacity].into(),
            scales: vec![1.0; capacity].into(),
            differences: zeros(),
            base: zeros(),
            operands: zeros(),
            count: 0,
            is_frozen: false,
        }
    }

    fn evaluate<R>(&mut self, first: usize, is_frozen: bool, equations: impl FnOnce() -> R) -> R {
        self.count = first;
        self.is_frozen = is_frozen;
        swap(self);
        let _loan = Loan(self);
        equations()
    }

    /// Runs equations. The sides of their relations, from index `first` on, are set from the present values.
    pub(crate) fn update<R>(&mut self, first: usize, equations: impl FnOnce() -> R) -> R {
        self.evaluate(first, false, equations)
    }

    /// Runs equations. Their relations, from index `first` on, keep their sides.
    pub(crate) fn frozen<R>(&mut self, first: usize, equations: impl FnOnce() -> R) -> R {
        self.evaluate(first, true, equations)
    }

    /// One past the index of the last relation that was evaluated.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Starts to compute the scales at the values of the last evaluation.
    pub(crate) fn begin_scales(&mut self) {
        self.base.copy_from_slice(&self.differences);
        self.scales.fill(0.0);
    }

    /// Adds the changes in the last evaluation, in which one value was changed by [`PROBE`] times its nominal value.
    pub(crate) fn add_to_scales(&mut self) {
        for ((scale, difference), base) in self.scales.iter_mut().zip(&self.differences).zip(&self.base) {
            let change = (difference - base).abs() / PROBE;
            *scale += if change.is_finite() { change } else { 0.0 };
        }
    }

    pub(crate) fn end_scales(&mut self) {
        for (scale, operand) in self.scales.iter_mut().zip(&self.operands) {
            *scale = scale.max(LEAST_SCALE * operand);
            if !(*scale > 0.0 && scale.is_finite()) {
                *scale = 1.0;
            }
        }
    }

    /// The indicators for the last evaluation: positive if the relation selects `then`. The number of relations can
    /// depend on Booleans and enumerations; unused indicators are 1.
    pub(crate) fn indicators(&self, result: &mut [f64]) {
        result.fill(1.0);
        for (i, indicator) in result.iter_mut().take(self.count).enumerate() {
            *indicator = indicator_of(self.differences[i], self.scales[i], self.sides[i]);
        }
    }

    pub(crate) fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        sink(Word::Whole(self.sides.len() as u64));
        for (&side, &scale) in self.sides.iter().zip(&self.scales) {
            sink(Word::Whole(side.into()));
            sink(Word::Real(scale));
        }
    }

    pub(crate) fn restore(&mut self, source: &mut Words<'_>) -> Result<(), String> {
        let count = source.whole("number of relations")?;
        if count != self.sides.len() as u64 {
            return Err(format!("the model has {} relations, got {count}", self.sides.len()));
        }
        for (side, scale) in self.sides.iter_mut().zip(&mut self.scales) {
            *side = match source.whole("side of a relation")? {
                0 => false,
                1 => true,
                other => return Err(format!("the side of a relation must be 0 or 1, got {other}")),
            };
            *scale = source.real("scale of a relation")?;
            if !(*scale > 0.0 && scale.is_finite()) {
                return Err(format!("the scale of a relation must be above 0, got {scale}"));
            }
        }
        Ok(())
    }

    fn compare(&mut self, left: f64, right: f64) -> bool {
        let is_greater = left > right;
        let at = self.count;
        self.count += 1;
        let Some(side) = self.sides.get_mut(at) else { return is_greater };
        self.differences[at] = left - right;
        if !self.is_frozen {
            *side = is_greater;
            self.operands[at] = left.abs().max(right.abs());
        }
        *side
    }
}

/// The event indicator: the difference divided by its scale, shifted by [`BAND`] away from zero on the present side.
pub(crate) fn indicator_of(difference: f64, scale: f64, side: bool) -> f64 {
    difference / scale + if side { BAND } else { -BAND }
}

/// A real number in equations whose relations the exporter tracks. Operations are bit-identical to those of [`f64`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Relational(pub(crate) f64);

impl From<f64> for Relational {
    fn from(value: f64) -> Self {
        Self(value)
    }
}

macro_rules! operators {
    ($($operator:ident $function:ident),*) => {$(
        impl $operator for Relational {
            type Output = Self;
            #[inline]
            fn $function(self, other: Self) -> Self {
                Self($operator::$function(self.0, other.0))
            }
        }
        impl $operator<f64> for Relational {
            type Output = Self;
            #[inline]
            fn $function(self, other: f64) -> Self {
                Self($operator::$function(self.0, other))
            }
        }
    )*};
}
operators!(Add add, Sub sub, Mul mul, Div div);

impl Neg for Relational {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
assign_and_sum!(@assign [] Relational);

// Bit-identical to the sum of plain numbers, for which the standard library chooses the initial term, 0 or -0.
impl Sum for Relational {
    fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
        Self(terms.map(|term| term.0).sum())
    }
}

macro_rules! as_for_f64 {
    ($($function:ident($($argument:ident: $type:ty = $value:expr)?)),* $(,)?) => {$(
        #[inline]
        fn $function(self $(, $argument: $type)?) -> Self {
            Self(Scalar::$function(self.0 $(, $value)?))
        }
    )*};
}

impl Scalar for Relational {
    as_for_f64!(
        sin(), cos(), tan(), asin(), acos(), atan(), sinh(), cosh(), tanh(), sqrt(), exp(), ln(), floor(), abs(),
        atan2(x: Self = x.0), hypot(other: Self = other.0), powf(exponent: f64 = exponent), powi(exponent: i32 = exponent),
        rem_euclid(modulus: f64 = modulus), interpolate(table: &Table = table),
    );
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = Scalar::sin_cos(self.0);
        (Self(sin), Self(cos))
    }
    fn if_greater(self, threshold: Self, then: Self, otherwise: Self) -> Self {
        if IN_USE.with_borrow_mut(|relations| relations.compare(self.0, threshold.0)) { then } else { otherwise }
    }
    // Not relations: a kink is not a jump, and a solver with error control can follow it. With relations, two values
    // that stay equal for a while would cause an endless series of events.
    #[inline]
    fn max(self, other: Self) -> Self {
        Self(Scalar::max(self.0, other.0))
    }
    #[inline]
    fn min(self, other: Self) -> Self {
        Self(Scalar::min(self.0, other.0))
    }
    #[inline]
    fn value(self) -> f64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_relation_keeps_its_side_until_it_is_updated() {
        let mut relations = Relations::with_capacity(1);
        let step = |x: f64| Relational(x).if_greater(Relational(2.0), Relational(1.0), Relational(-1.0)).0;
        let mut indicator = [0.0];
        for (start, side) in [(3.0, 1.0), (2.0, -1.0), (1.0, -1.0)] {
            assert_eq!(relations.update(0, || step(start)), side);
            relations.indicators(&mut indicator);
            assert_eq!(indicator[0] > 0.0, side > 0.0, "{start}");
            for x in [0.0, 2.0, 5.0] {
                assert_eq!(relations.frozen(0, || step(x)), side, "{start} {x}");
                relations.indicators(&mut indicator);
                assert_eq!(indicator[0], x - 2.0 + BAND * side, "{start} {x}");
            }
        }
    }

    #[test]
    fn min_max_and_abs_have_no_relations_and_sign_has_two() {
        let mut relations = Relations::with_capacity(8);
        let (x, y) = (Relational(1.0), Relational(-2.0));
        let value = relations.update(0, || Scalar::clamp(Scalar::max(x, y), y, x) + Scalar::min(x, y) + y.abs());
        assert_eq!((value.0, relations.count()), (1.0, 0));
        assert_eq!((relations.update(0, || y.sign()).0, relations.count()), (-1.0, 2));
    }

    /// Relations beyond the capacity have no indicators. Their sides follow from the present values.
    #[test]
    fn relations_beyond_the_capacity_are_not_frozen() {
        let mut relations = Relations::with_capacity(1);
        let zero = Relational(0.0);
        let sides = |x: f64| {
            let x = Relational(x);
            [0.0, 0.0].map(|_| x.if_greater(zero, Relational(1.0), zero).0)
        };
        assert_eq!(relations.update(0, || sides(1.0)), [1.0, 1.0]);
        assert_eq!(relations.frozen(0, || sides(-1.0)), [1.0, 0.0]);
        assert_eq!(relations.count(), 2);
    }

    #[test]
    fn relations_come_back_after_a_panic() {
        let mut relations = Relations::with_capacity(1);
        let panicked =
            std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| relations.update(0, || panic!("on purpose"))));
        assert!(panicked.is_err());
        assert_eq!(relations.sides.len(), 1);
        // Without relations in use, the present values are compared.
        assert_eq!(Relational(1.0).if_greater(Relational(0.0), Relational(1.0), Relational(2.0)).0, 1.0);
    }

    /// Closed form: if x and y change by their nominal values, 10 and 3, x - 2 y changes by 10 and 6.
    #[test]
    fn a_scale_is_the_change_by_the_nominal_values() {
        let mut relations = Relations::with_capacity(1);
        let mut at = |x: f64, y: f64, is_first: bool| {
            let run = || Relational(x).if_greater(Relational(y) * 2.0, Relational(1.0), Relational(0.0));
            if is_first {
                relations.update(0, run)
            } else {
                relations.frozen(0, run)
            };
            if is_first {
                relations.begin_scales()
            } else {
                relations.add_to_scales()
            };
        };
        at(5.0, 1.0, true);
        at(5.0 + 10.0 * PROBE, 1.0, false);
        at(5.0, 1.0 + 3.0 * PROBE, false);
        relations.end_scales();
        // The difference quotient, with a change of 1e-6, has rounding errors.
        assert!((relations.scales[0] - 16.0).abs() < 1e-8, "{}", relations.scales[0]);
    }
}
