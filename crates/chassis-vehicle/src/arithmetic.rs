//! Arithmetic of the equations of motion, which run up to 40,000 times per second of simulated time. Model files
//! contain only physics; optimizations and their reasons are in this module:
//!
//! * A division takes several times as long as a multiplication. A [`Divisor`] keeps its reciprocal.
//! * A call between other operations moves their intermediate results from registers to memory. Create a [`Rotation`], and
//!   call other functions of state and inputs, before the rest of the equations.
//! * Processors add two pairs of numbers at once. `FourWheels::sum_of` and its like add the left and the right elements side by
//!   side.
//! * The compiler combines operations on two numbers across the functions of a model after it has inlined them. How the
//!   functions share the work, and whether they pass an array by value or within a struct, changes the time of a step by up
//!   to 12 %. Measure it after such a change (`cargo bench -p bench`).

use fmu::Scalar;

/// A constant that the equations divide by.
///
/// ```
/// use chassis_vehicle::arithmetic::{Divisor, Over};
///
/// let m = Divisor::new(4.0);
/// assert_eq!(10.0.over(m), 2.5);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Divisor {
    /// Alone, without the number itself: the reciprocals of an array are adjacent in memory.
    reciprocal: f64,
}

impl Divisor {
    /// Creates a divisor; `value` is not 0.
    pub fn new(value: f64) -> Self {
        Self { reciprocal: 1.0 / value }
    }
}

/// Division by a [`Divisor`].
pub trait Over: Scalar {
    /// `self` divided by `divisor`, to within a rounding of its reciprocal.
    #[inline]
    fn over(self, divisor: Divisor) -> Self {
        self * divisor.reciprocal
    }
}

impl<T: Scalar> Over for T {}

/// A rotation in a plane, such as that of a vehicle on the road or of a wheel under the vehicle.
#[derive(Clone, Copy, Debug)]
pub struct Rotation<T> {
    /// Sine of the angle.
    pub sin: T,
    /// Cosine of the angle.
    pub cos: T,
}

impl<T: Scalar> Rotation<T> {
    /// The rotation by `angle` in rad, positive from x to y.
    #[inline]
    pub fn by(angle: T) -> Self {
        let (sin, cos) = angle.sin_cos();
        Self { sin, cos }
    }

    /// The rotations by several angles at once. They should be of similar size: a large one slows down all.
    #[inline]
    pub fn by_each<const N: usize>(angles: [T; N]) -> [Self; N] {
        let (sin, cos) = T::sin_cos_each(angles);
        std::array::from_fn(|i| Self { sin: sin[i], cos: cos[i] })
    }

    /// The vector (`x`, `y`), given in the turned frame, in the frame that is not turned.
    #[inline]
    pub fn out_of_frame(self, [x, y]: [T; 2]) -> [T; 2] {
        [x * self.cos - y * self.sin, x * self.sin + y * self.cos]
    }

    /// The vector (`x`, `y`), given in the frame that is not turned, in the turned frame.
    #[inline]
    pub fn into_frame(self, [x, y]: [T; 2]) -> [T; 2] {
        [x * self.cos + y * self.sin, y * self.cos - x * self.sin]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_divisor_divides() {
        // A power of two: the reciprocal is exact.
        assert_eq!(3.0.over(Divisor::new(8.0)), 0.375);
        // Otherwise two roundings.
        assert!((1.0.over(Divisor::new(0.3)) * 0.3 - 1.0_f64).abs() < 4.0 * f64::EPSILON);
    }

    #[test]
    fn a_left_turn_points_forward_to_the_left() {
        // Closed form: a quarter turn. The cosine of the rounded angle is 6e-17.
        let quarter = Rotation::by(std::f64::consts::FRAC_PI_2);
        let [x, y] = quarter.out_of_frame([2.0, 1.0]);
        assert!((x + 1.0).abs() < 1e-15 && (y - 2.0).abs() < 1e-15, "{x} {y}");
        let [x, y] = quarter.into_frame([x, y]);
        assert!((x - 2.0).abs() < 1e-15 && (y - 1.0).abs() < 1e-15, "{x} {y}");
    }

    #[test]
    fn rotations_at_once_are_those_one_by_one() {
        // Bit-identical, as promised for arrays of functions.
        let angles = [-0.4, 0.1, 3.0];
        for (each, angle) in Rotation::by_each(angles).into_iter().zip(angles) {
            let one = Rotation::by(angle);
            assert_eq!((each.sin, each.cos), (one.sin, one.cos));
        }
    }
}
