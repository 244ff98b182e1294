//! A number type for the equations. Its values identify expressions.

use std::cell::Cell;

use crate::scalar::{Scalar, Symbol, assign_and_sum, symbolic};
use crate::table::Table;

/// Hash of an expression of known variables and constants. If two evaluations of the equations give the same hash, they
/// computed the same expression, except with a probability of about 2^-64.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Expression(u128);

thread_local! {
    /// True if the equations of this thread have read the value of a number.
    static INSPECTED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `equations`. Returns their result, and true if they called [`Scalar::value`].
pub(crate) fn inspected<R>(equations: impl FnOnce() -> R) -> (R, bool) {
    INSPECTED.set(false);
    (equations(), INSPECTED.get())
}

/// Odd numbers from the digits of pi. Multiplication by them mixes the operands.
const FIRST: u128 = 0x243f_6a88_85a3_08d3_1319_8a2e_0370_7345;
const SECOND: u128 = 0xa409_3822_299f_31d0_082e_fa98_ec4e_6c89;

impl Expression {
    pub(crate) fn known(index: usize) -> Self {
        Self::hash("known", [index as u128])
    }

    pub(crate) fn text(text: &str) -> Self {
        Self::hash(text, [])
    }

    /// The expression of the value of a Binary.
    pub(crate) fn bytes(bytes: &[u8]) -> Self {
        bytes.iter().fold(Self::hash("bytes", []), |hash, &byte| Self::hash("byte", [hash.0, byte.into()]))
    }

    fn hash<const N: usize>(name: &str, operands: [u128; N]) -> Self {
        let mix = |hash: u128, word: u128| {
            let hash = (hash ^ word).wrapping_mul(FIRST);
            (hash ^ (hash >> 59)).wrapping_mul(SECOND)
        };
        let hash = name.bytes().fold(FIRST, |hash, byte| mix(hash, byte.into()));
        let hash = operands.into_iter().fold(hash, mix);
        Self(hash ^ (hash >> 67))
    }
}

impl From<f64> for Expression {
    fn from(constant: f64) -> Self {
        Self::hash("constant", [constant.to_bits().into()])
    }
}

impl Symbol for Expression {
    fn of<const N: usize>(operation: &str, operands: [Self; N]) -> Self {
        Self::hash(operation, operands.map(|operand| operand.0))
    }
    fn look_up(self, table: &Table) -> Self {
        Self::hash("interpolate", [self.0, table.fingerprint().into()])
    }
    fn inspect() {
        INSPECTED.set(true);
    }
}
symbolic!(Expression);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_expressions_have_equal_hashes() {
        let [x, y] = [0, 1].map(Expression::known);
        assert_eq!((x + y) * 2.0, (x + y) * Expression::from(2.0));
        let all = [x, y, x + y, y + x, x - y, x * y, x / y, -x, x.sin(), x.cos(), x.powi(2), x.powf(2.0), x * 0.0];
        for (i, a) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|b| a != b), "{i}");
        }
        let table = |y| Table::new([(0.0, 1.0), (1.0, y)]).unwrap();
        assert_eq!(x.interpolate(&table(2.0)), x.interpolate(&table(2.0)));
        assert_ne!(x.interpolate(&table(2.0)), x.interpolate(&table(3.0)));
    }
}
