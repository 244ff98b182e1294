//! Fuzzy sets.

/// A fuzzy set on the real line: the grade (0..=1) to which a number belongs to a label.
///
/// The parameters have the unit of the number. [`Partition::new`](super::Partition::new) and [`Output::new`](super::Output::new) check them;
/// [`Membership::grade`] alone does not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Membership {
    /// `exp(-(x - center)^2 / (2 width^2))`.
    Gaussian {
        /// Point of grade 1; finite.
        center: f64,
        /// Standard deviation; positive and finite.
        width: f64,
    },
    /// 0 at the feet, 1 at the peak, linear in between. A foot at the peak makes a vertical edge.
    Triangle {
        /// Left foot, at most `peak`; finite.
        left: f64,
        /// Point of grade 1.
        peak: f64,
        /// Right foot, at least `peak`, greater than `left`; finite.
        right: f64,
    },
}

impl Membership {
    /// Grade of `x` in 0..=1; NaN if `x` is NaN.
    ///
    /// ```
    /// use chassis_control::fuzzy::Membership;
    /// let triangle = Membership::Triangle { left: 0.0, peak: 1.0, right: 3.0 };
    /// assert_eq!(triangle.grade(0.25), 0.25);
    /// assert_eq!(triangle.grade(2.0), 0.5);
    /// ```
    #[inline(never)] // one copy in an FMU
    pub fn grade(&self, x: f64) -> f64 {
        if x.is_nan() {
            return x;
        }
        match *self {
            Self::Gaussian { center, width } => fmu::math::exp(gaussian_exponent(x, center, width)),
            // The falling edge is the rising one seen from the other side.
            Self::Triangle { left, peak, right } => edge(x, left, peak).min(edge(-x, -right, -peak)),
        }
    }

    /// `N` Gaussian sets with evenly spaced centers from `first` to `last`, neighbors crossing at
    /// grade 1/2: `width = spacing / (2 sqrt(2 ln 2))`.
    ///
    /// `N` is at least 2 and `first < last`; otherwise [`Partition::new`](super::Partition::new) rejects the sets.
    pub fn evenly_spaced_gaussians<const N: usize>(first: f64, last: f64) -> [Self; N] {
        let width = spacing(N, first, last) / (8.0 * std::f64::consts::LN_2).sqrt();
        grid(first, last).map(|center| Self::Gaussian { center, width })
    }

    /// `N` triangles with evenly spaced peaks from `first` to `last`, each reaching to the peaks of
    /// its neighbors, so that they cross at grade 1/2; the outer two reach beyond `first` and
    /// `last` by the same distance.
    ///
    /// `N` is at least 2 and `first < last`; otherwise [`Partition::new`](super::Partition::new) rejects the sets.
    pub fn evenly_spaced_triangles<const N: usize>(first: f64, last: f64) -> [Self; N] {
        let spacing = spacing(N, first, last);
        grid(first, last).map(|peak| Self::Triangle { left: peak - spacing, peak, right: peak + spacing })
    }

    /// The rule this set breaks, if any.
    pub(super) fn broken_rule(&self) -> Option<&'static str> {
        // Written so that NaN fails every comparison.
        match *self {
            Self::Gaussian { center, width } => (!(center.is_finite() && width > 0.0 && width.is_finite()))
                .then_some("center and width must be finite, and width positive"),
            Self::Triangle { left, peak, right } => {
                (!(left.is_finite() && left <= peak && peak <= right && left < right && right.is_finite()))
                    .then_some("left <= peak <= right and left < right must hold, all finite")
            }
        }
    }
}

/// Logarithm of the grade of a Gaussian set.
pub(super) fn gaussian_exponent(x: f64, center: f64, width: f64) -> f64 {
    let z = (x - center) / width;
    -0.5 * z * z
}

/// Rising edge: 0 up to `foot`, 1 from `peak` on.
fn edge(x: f64, foot: f64, peak: f64) -> f64 {
    if x >= peak {
        1.0
    } else if x <= foot {
        0.0
    } else {
        (x - foot) / (peak - foot)
    }
}

/// Distance of `n` even points from `first` to `last`.
fn spacing(n: usize, first: f64, last: f64) -> f64 {
    (last - first) / (n as f64 - 1.0)
}

/// Point `i` of `n` even points from `first` to `last`; exactly symmetric if `first == -last`.
pub(super) fn point(i: usize, n: usize, first: f64, last: f64) -> f64 {
    let end = n as f64 - 1.0;
    (first * (end - i as f64) + last * i as f64) / end
}

/// `N` even points from `first` to `last`.
fn grid<const N: usize>(first: f64, last: f64) -> [f64; N] {
    std::array::from_fn(|i| point(i, N, first, last))
}
