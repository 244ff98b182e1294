//! Fuzzy sets.

/// A fuzzy set of real numbers: the grade (0..=1) to which a number belongs to a label.
///
/// The parameters have the unit of the number. [`Partition::new`](super::Partition::new) and
/// [`Output::new`](super::Output::new) check them; [`Membership::grade`] does not.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Membership {
    /// `exp(-(x - center)^2 / (2 width^2))`.
    Gaussian {
        /// Point of grade 1; finite.
        center: f64,
        /// Standard deviation; positive and finite.
        width: f64,
    },
    /// 0 at the feet, 1 at the peak, linear in between. With an infinite foot, the grade is 1 from the peak on in that
    /// direction (a shoulder). A foot at the peak gives a vertical edge.
    Triangle {
        /// Left foot, at most `peak`; minus infinity for a left shoulder.
        left: f64,
        /// Point of grade 1; finite.
        peak: f64,
        /// Right foot, at least `peak`, greater than `left`; plus infinity for a right shoulder.
        right: f64,
    },
    /// 1 between the shoulders, 0 outside the feet, linear in between. With an infinite foot, the grade is 1 from its
    /// shoulder on in that direction.
    Trapezoid {
        /// Left foot, at most `left_shoulder`.
        left_foot: f64,
        /// Left end of grade 1, at most `right_shoulder`; not plus infinity.
        left_shoulder: f64,
        /// Right end of grade 1; not minus infinity.
        right_shoulder: f64,
        /// Right foot, at least `right_shoulder`, greater than `left_foot`.
        right_foot: f64,
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
    /// let shoulder = Membership::Triangle { left: f64::NEG_INFINITY, peak: 1.0, right: 3.0 };
    /// assert_eq!(shoulder.grade(-100.0), 1.0);
    /// ```
    #[inline(never)] // one copy in an FMU
    pub fn grade(&self, x: f64) -> f64 {
        if x.is_nan() {
            return x;
        }
        match *self {
            Self::Gaussian { center, width } => fmu::math::exp(gaussian_exponent(x, center, width)),
            Self::Triangle { left, peak, right } => trapezoid(x, left, peak, peak, right),
            Self::Trapezoid { left_foot, left_shoulder, right_shoulder, right_foot } => {
                trapezoid(x, left_foot, left_shoulder, right_shoulder, right_foot)
            }
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

    /// `N` triangles with evenly spaced peaks from `first` to `last`. Each reaches to the peaks of its neighbors, so
    /// neighbors cross at grade 1/2; the outer two extend beyond `first` and `last` by the same distance.
    ///
    /// `N` is at least 2 and `first < last`; otherwise [`Partition::new`](super::Partition::new) rejects the sets.
    pub fn evenly_spaced_triangles<const N: usize>(first: f64, last: f64) -> [Self; N] {
        let spacing = spacing(N, first, last);
        grid(first, last).map(|peak| Self::Triangle { left: peak - spacing, peak, right: peak + spacing })
    }

    /// The requirement that this set violates, if any.
    pub(super) fn broken_rule(&self) -> Option<&'static str> {
        // Written so that NaN fails every comparison.
        match *self {
            Self::Gaussian { center, width } => {
                if !center.is_finite() {
                    Some("center must be finite")
                } else if !(width > 0.0 && width.is_finite()) {
                    Some("width must be positive and finite")
                } else {
                    None
                }
            }
            Self::Triangle { left, peak, right } => {
                if !peak.is_finite() {
                    Some("peak must be finite")
                } else if !(left <= peak && peak <= right && left < right) {
                    Some("left <= peak <= right and left < right must hold")
                } else {
                    None
                }
            }
            Self::Trapezoid { left_foot, left_shoulder, right_shoulder, right_foot } => {
                if !(left_foot <= left_shoulder
                    && left_shoulder <= right_shoulder
                    && right_shoulder <= right_foot
                    && left_foot < right_foot)
                {
                    Some(
                        "left_foot <= left_shoulder <= right_shoulder <= right_foot and left_foot < right_foot must hold",
                    )
                } else if !(left_shoulder < f64::INFINITY && right_shoulder > f64::NEG_INFINITY) {
                    Some("left_shoulder must not be plus infinity and right_shoulder must not be minus infinity")
                } else {
                    None
                }
            }
        }
    }
}

/// Logarithm of the grade of a Gaussian set.
pub(super) fn gaussian_exponent(x: f64, center: f64, width: f64) -> f64 {
    let z = (x - center) / width;
    -0.5 * z * z
}

/// Grade of a trapezoid whose feet may be infinite.
fn trapezoid(x: f64, left_foot: f64, left_shoulder: f64, right_shoulder: f64, right_foot: f64) -> f64 {
    // The falling edge is a rising edge seen from the other side.
    edge(x, left_foot, left_shoulder).min(edge(-x, -right_foot, -right_shoulder))
}

/// Rising edge: 0 up to `foot`, 1 from `shoulder` on.
fn edge(x: f64, foot: f64, shoulder: f64) -> f64 {
    if x >= shoulder || foot == f64::NEG_INFINITY {
        1.0
    } else if x <= foot {
        0.0
    } else {
        (x - foot) / (shoulder - foot)
    }
}

/// Distance between `n` evenly spaced points from `first` to `last`.
fn spacing(n: usize, first: f64, last: f64) -> f64 {
    (last - first) / (n as f64 - 1.0)
}

/// Point `i` of `n` evenly spaced points from `first` to `last`; exactly symmetric if `first == -last`.
pub(super) fn point(i: usize, n: usize, first: f64, last: f64) -> f64 {
    let end = n as f64 - 1.0;
    (first * (end - i as f64) + last * i as f64) / end
}

/// `N` evenly spaced points from `first` to `last`.
fn grid<const N: usize>(first: f64, last: f64) -> [f64; N] {
    std::array::from_fn(|i| point(i, N, first, last))
}
