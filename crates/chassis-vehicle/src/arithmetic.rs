//! Arithmetic for the equations of motion, which are evaluated up to 40,000 times per second of simulated time. Model
//! files contain only physics; optimizations and their reasons are in this module:
//!
//! * A division takes several times as long as a multiplication. A [`Divisor`] keeps its reciprocal.
//! * A function call in the middle of the equations moves intermediate results from registers to memory. So create each
//!   [`Rotation`] first, and make the other calls that need only state and inputs before the equations.
//! * Processors add two pairs of numbers at once. `FourWheels::sum_of` and its counterparts add the left and the right
//!   elements side by side.
//! * After inlining, the compiler combines operations on two numbers across the functions of a model. The time per step
//!   changes by up to 12 % with the division of the work into functions, and with the choice of passing an array by
//!   value or within a struct. Measure it after such a change (`cargo bench -p bench`).

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
    /// The number itself is not stored: the reciprocals in an array of divisors are then adjacent in memory.
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
    /// `self` times the rounded reciprocal of `divisor`.
    #[inline]
    fn over(self, divisor: Divisor) -> Self {
        self * divisor.reciprocal
    }
}

impl<T: Scalar> Over for T {}

/// A rotation in a plane, such as the heading of a vehicle or the steering angle of a wheel.
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

    /// The rotations by several angles at once. If one of the angles is large, all of them take the slow general path
    /// of sine and cosine.
    #[inline]
    pub fn by_each<const N: usize>(angles: [T; N]) -> [Self; N] {
        let (sin, cos) = T::sin_cos_each(angles);
        std::array::from_fn(|i| Self { sin: sin[i], cos: cos[i] })
    }

    /// Transforms a vector from the rotated frame to the unrotated frame.
    #[inline]
    pub fn out_of_frame(self, [x, y]: [T; 2]) -> [T; 2] {
        [x * self.cos - y * self.sin, x * self.sin + y * self.cos]
    }

    /// Transforms a vector from the unrotated frame to the rotated frame.
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
        // The reciprocal of a power of two is exact.
        assert_eq!(3.0.over(Divisor::new(8.0)), 0.375);
        // Otherwise, the result has been rounded twice.
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
    fn by_each_is_bit_identical_to_by() {
        let angles = [-0.4, 0.1, 3.0];
        for (each, angle) in Rotation::by_each(angles).into_iter().zip(angles) {
            let one = Rotation::by(angle);
            assert_eq!((each.sin, each.cos), (one.sin, one.cos));
        }
    }
}
