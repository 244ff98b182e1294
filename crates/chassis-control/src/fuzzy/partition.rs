//! The labels of an input.

use super::error::FuzzyError;
use super::membership::{Membership, gaussian_exponent};

/// The labels of one input: `N` fuzzy sets over the same axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Partition<const N: usize> {
    sets: [Membership; N],
    /// All sets, if all are Gaussian.
    gaussians: Option<Gaussians>,
}

/// Largest number of Gaussian sets whose grades are evaluated together.
const GAUSSIANS: usize = 8;

/// Up to `GAUSSIANS` Gaussian sets. The last one is repeated to fill the arrays.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Gaussians {
    centers: [f64; GAUSSIANS],
    widths: [f64; GAUSSIANS],
}

impl Gaussians {
    /// `None` unless there are 1 to `GAUSSIANS` sets, all of them Gaussian.
    fn new(sets: &[Membership]) -> Option<Self> {
        let mut gaussians = Self { centers: [0.0; GAUSSIANS], widths: [1.0; GAUSSIANS] };
        let last = sets.len().checked_sub(1).filter(|&last| last < GAUSSIANS)?;
        for i in 0..GAUSSIANS {
            let Membership::Gaussian { center, width } = sets[i.min(last)] else {
                return None;
            };
            (gaussians.centers[i], gaussians.widths[i]) = (center, width);
        }
        Some(gaussians)
    }

    /// Grades of the first `N` sets. Two are evaluated at a time, so `N` should be even.
    fn grades<const N: usize>(&self, x: f64) -> [f64; N] {
        let mut exponents = [0.0; N];
        for ((exponent, &center), &width) in exponents.iter_mut().zip(&self.centers).zip(&self.widths) {
            *exponent = gaussian_exponent(x, center, width);
        }
        fmu::math::exp_each(exponents)
    }
}

impl<const N: usize> Partition<N> {
    /// Takes the sets of the labels in order.
    ///
    /// # Errors
    ///
    /// [`FuzzyError::Membership`] if a set breaks the rules stated at its fields.
    pub fn new(sets: [Membership; N]) -> Result<Self, FuzzyError> {
        check_sets(&sets)?;
        Ok(Self { sets, gaussians: Gaussians::new(&sets) })
    }

    /// Grade (0..=1) of `x` in every label; all NaN if `x` is NaN. `x` is in the unit of the sets
    /// and is not clipped here.
    pub fn grades(&self, x: f64) -> [f64; N] {
        match &self.gaussians {
            // Bit-identical to evaluating the sets one by one.
            Some(gaussians) if N <= 6 => first(gaussians.grades::<6>(x)),
            Some(gaussians) => first(gaussians.grades::<GAUSSIANS>(x)),
            None => self.sets.map(|set| set.grade(x)),
        }
    }
}

fn first<const FROM: usize, const N: usize>(values: [f64; FROM]) -> [f64; N] {
    std::array::from_fn(|i| values[i])
}

pub(super) fn check_sets(sets: &[Membership]) -> Result<(), FuzzyError> {
    for (index, set) in sets.iter().enumerate() {
        if let Some(requirement) = set.broken_rule() {
            return Err(FuzzyError::Membership { index, set: *set, requirement });
        }
    }
    Ok(())
}
