//! Cones of the lane changes of ISO 3888: the double lane change (part 1) and the obstacle avoidance (part 2).
//!
//! Lengths and widths are from the standard. Open-source implementations of both tracks agree on the edges that are in
//! one line: the right edges in part 1, the left edges of the first and the third lane in part 2.
//!
//! ```
//! // A car 1.61 m wide; the first lane begins at 50 m.
//! let [first, second, third] = path_driver::tracks::iso_3888_1(50.0, 1.61);
//! assert_eq!((second.begin, second.end), (95.0, 120.0));
//! assert!((second.right - 2.4895).abs() < 1e-12 && (second.left - 4.6715).abs() < 1e-12);
//! assert_eq!(first.right, third.right);
//! ```

/// A lane between cones. `x` points along the first lane, and `y = 0` is its middle; left is positive. All values are
/// in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Section {
    /// Position x of the first cones.
    pub begin: f64,
    /// Position x of the last cones.
    pub end: f64,
    /// Position y of the cones on the right.
    pub right: f64,
    /// Position y of the cones on the left, greater than `right`.
    pub left: f64,
}

impl Section {
    /// Position y of the middle of the lane in m.
    pub fn middle(&self) -> f64 {
        (self.right + self.left) / 2.0
    }
}

/// The double lane change of ISO 3888-1, to the left: sections of 15, 25 and 30 m. The first one begins at `start` in
/// m; `w` is the width of the vehicle in m.
pub fn iso_3888_1(start: f64, w: f64) -> [Section; 3] {
    let [w_1, w_3, w_5] = [1.1 * w + 0.25, 1.2 * w + 0.25, 1.3 * w + 0.25];
    let right = -w_1 / 2.0;
    [
        Section { begin: start, end: start + 15.0, right, left: w_1 / 2.0 },
        Section { begin: start + 45.0, end: start + 70.0, right: right + 3.5, left: right + 3.5 + w_3 },
        Section { begin: start + 95.0, end: start + 125.0, right, left: right + w_5 },
    ]
}

/// The obstacle avoidance of ISO 3888-2, to the left: sections of 12, 11 and 12 m. The first one begins at `start` in
/// m; `w` is the width of the vehicle in m.
pub fn iso_3888_2(start: f64, w: f64) -> [Section; 3] {
    let [w_1, w_3, w_5] = [1.1 * w + 0.25, w + 1.0, (1.3 * w + 0.25).max(3.0)];
    let left = w_1 / 2.0;
    [
        Section { begin: start, end: start + 12.0, right: -left, left },
        Section { begin: start + 25.5, end: start + 36.5, right: left + 1.0, left: left + 1.0 + w_3 },
        Section { begin: start + 49.0, end: start + 61.0, right: left - w_5, left },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_edges(sections: [Section; 3], edges: [[f64; 2]; 3]) {
        for (section, [right, left]) in sections.into_iter().zip(edges) {
            assert!((section.right - right).abs() < 1e-12 && (section.left - left).abs() < 1e-12, "{section:?}");
        }
    }

    /// Reference values for a width of 1.61 m. The digits shown are exact; the tolerance covers the rounding of sums of
    /// three numbers.
    #[test]
    fn edges_follow_the_standard() {
        let double = iso_3888_1(50.0, 1.61);
        assert_edges(double, [[-1.0105, 1.0105], [2.4895, 4.6715], [-1.0105, 1.3325]]);
        assert_eq!(double.map(|section| [section.begin, section.end]), [[50.0, 65.0], [95.0, 120.0], [145.0, 175.0]]);
        let avoidance = iso_3888_2(50.0, 1.61);
        assert_edges(avoidance, [[-1.0105, 1.0105], [2.0105, 4.6205], [-1.9895, 1.0105]]);
        assert_eq!(avoidance.map(|section| [section.begin, section.end]), [[50.0, 62.0], [75.5, 86.5], [99.0, 111.0]]);
        // For a wide vehicle, 1.3 w + 0.25 exceeds the minimum of 3 m.
        for (w, width) in [(2.5, 3.5), (1.61, 3.0)] {
            let Section { right, left, .. } = iso_3888_2(0.0, w)[2];
            assert!((left - right - width).abs() < 1e-12);
        }
    }
}
