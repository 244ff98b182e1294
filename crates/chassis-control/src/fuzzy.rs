//! Mamdani fuzzy inference with one or two inputs. Tables are allocated once; an evaluation allocates nothing.
//!
//! One evaluation has four steps. Each is a value that is built once, with a method that is called per sample:
//!
//! | step | built once | per sample |
//! |---|---|---|
//! | fuzzify an input: compute the grade of every label | [`Partition`] | [`Partition::grades`] |
//! | fire the rules: compute the activation of every output label | [`RuleTable`] (two inputs), [`LabelMap`] (one input) | [`RuleTable::activation`], [`LabelMap::apply`] |
//! | map the output labels to other labels (optional) | [`LabelMap`] | [`LabelMap::apply`] |
//! | clip, unite and take the centroid | [`Output`] | [`Output::centroid`] |
//!
//! ```text
//! strength of rule (i, j):  g_i and g_j            AND = min or product (Conjunction)
//! activation of label l:    w_l = max of the strengths of its rules
//! fuzzy output:             mu(y) = max over l of min(w_l, mu_l(y))
//! crisp output:             sum(y mu(y)) / sum(mu(y)) over an even grid of points y
//! ```
//!
//! A label has the largest strength of its rules. The activation is therefore computed once per label, and several
//! outputs that share the rules need only one table.
//!
//! # No rule active, NaN
//!
//! An empty set has no centroid: if no label is active at any grid point, the result is NaN. It is also NaN if any
//! input is NaN. The first case cannot occur if the partitions cover the complete (clipped) input range and every pair
//! of labels has a rule.
//!
//! # Example
//!
//! ```
//! use chassis_control::fuzzy::{Conjunction, LabelMap, Membership, Output, Partition, RuleTable};
//! # fn main() -> Result<(), chassis_control::fuzzy::FuzzyError> {
//! // Two inputs in 0..=1 with the labels low and high; one output with the labels small, medium and large.
//! let input = Partition::new(Membership::evenly_spaced_triangles::<2>(0.0, 1.0))?;
//! let rules = RuleTable::<2, 2, 3>::new([[0, 1], [1, 2]], Conjunction::Minimum)?;
//! let output = Output::<3>::new(Membership::evenly_spaced_triangles(0.0, 1.0), 0.0, 1.0, 101)?;
//! let opposite = LabelMap::<3, 3>::new([2, 1, 0])?;
//!
//! let activation = rules.activation(&input.grades(0.9), &input.grades(0.2));
//! let first = output.centroid(&activation);
//! let second = output.centroid(&opposite.apply(&activation));
//! assert!((first + second - 1.0).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```
//!
//! # Reference
//!
//! E. H. Mamdani, S. Assilian, "An experiment in linguistic synthesis with a fuzzy logic
//! controller", International Journal of Man-Machine Studies 7(1), 1975, 1-13,
//! doi:10.1016/S0020-7373(75)80002-2.

mod error;
mod membership;
mod numbers;
mod output;
mod partition;
mod rules;

pub use error::FuzzyError;
pub use membership::Membership;
pub use output::Output;
pub use partition::Partition;
pub use rules::{Conjunction, LabelMap, RuleTable};

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Coordination of the rescue vehicle (Chen et al., Mathematics 2022, 10, 3562, Tables 2 and 3): the inputs are the
    /// steering angle in deg and the speed in km/h; the outputs are the weights of the two suspension laws.
    struct Coordination {
        speed: Partition<5>,
        angle: Partition<5>,
        rules: RuleTable<5, 5, 7>,
        opposite: LabelMap<7, 7>,
        weight: Output<7>,
    }

    const PES: usize = 0;
    const PVS: usize = 1;
    const PS: usize = 2;
    const PM: usize = 3;
    const PB: usize = 4;
    const PVB: usize = 5;
    const PEB: usize = 6;

    impl Coordination {
        fn new() -> Self {
            let table = [
                [PES, PES, PVS, PS, PM],
                [PES, PVS, PS, PM, PB],
                [PVS, PM, PB, PB, PVB],
                [PS, PM, PB, PVB, PVB],
                [PS, PB, PVB, PEB, PEB],
            ];
            Self {
                speed: Partition::new(Membership::evenly_spaced_gaussians(0.0, 40.0)).unwrap(),
                angle: Partition::new(Membership::evenly_spaced_gaussians(0.0, 32.0)).unwrap(),
                rules: RuleTable::new(table, Conjunction::Minimum).unwrap(),
                opposite: LabelMap::new([PEB, PEB, PB, PM, PS, PVS, PES]).unwrap(),
                weight: Output::new(Membership::evenly_spaced_gaussians(0.0, 1.0), 0.0, 1.0, 101).unwrap(),
            }
        }

        /// Weights of the integrated and of the roll law.
        fn weights(&self, degrees: f64, speed: f64) -> [f64; 2] {
            let activation = self.rules.activation(
                &self.speed.grades(speed.clamp(0.0, 40.0)),
                &self.angle.grades(degrees.abs().clamp(0.0, 32.0)),
            );
            [self.weight.centroid(&self.opposite.apply(&activation)), self.weight.centroid(&activation)]
        }
    }

    /// Check values for the coordination of the rescue vehicle, computed by an independent implementation and printed
    /// to 9 digits. Tolerance: 1e-9.
    #[test]
    fn coordination_matches_the_check_values() {
        let coordination = Coordination::new();
        for (degrees, speed, integrated, roll) in [
            (30.0, 35.0, 0.146518016, 0.853481984),
            (0.0, 35.0, 0.615975864, 0.384024136),
            (10.0, 20.0, 0.492556677, 0.507443323),
            (32.0, 40.0, 0.075676347, 0.924323653),
            (16.0, 20.0, 0.381932498, 0.618067502),
            (5.0, 0.0, 0.932707829, 0.088768399),
            (20.0, 10.0, 0.580488560, 0.419511440),
        ] {
            let [k1, k2] = coordination.weights(degrees, speed);
            assert!(
                (k1 - integrated).abs() < 1e-9 && (k2 - roll).abs() < 1e-9,
                "({degrees} deg, {speed} km/h): {k1}, {k2}"
            );
        }
    }

    /// Check values for two systems of the heavy vehicle: the first output of a fuzzy PID with 7 x 7 rules, triangular
    /// output sets and 121 points, and a system with one input (k1 from k2). An independent implementation computed
    /// them and printed 8 digits. Tolerance: 1e-8.
    #[test]
    fn other_systems_match_their_check_values() {
        // The label NB = 0 does not occur in these tables.
        const NM: usize = 1;
        const NS: usize = 2;
        const ZO: usize = 3;
        const PS: usize = 4;
        const PM: usize = 5;
        const PB: usize = 6;
        let input = Partition::new(Membership::evenly_spaced_gaussians::<7>(-3.0, 3.0)).unwrap();
        let proportional = RuleTable::<7, 7, 7>::new(
            [
                [PB, PB, PM, PM, PS, ZO, ZO],
                [PB, PB, PM, PS, PS, ZO, NS],
                [PM, PM, PM, PS, ZO, NS, NS],
                [PM, PM, PS, ZO, PS, PM, PM],
                [NS, NS, ZO, PS, PM, PM, PM],
                [NS, ZO, PS, PS, PM, PB, PB],
                [ZO, ZO, PS, PM, PM, PB, PB],
            ],
            Conjunction::Minimum,
        )
        .unwrap();
        let output = Output::<7>::new(Membership::evenly_spaced_triangles(-3.0, 3.0), -3.0, 3.0, 121).unwrap();
        for (error, rate, expected) in [
            (0.0, 0.0, 0.21831225),
            (-3.0, -3.0, 2.68329967),
            (1.0, 0.0, 0.99996779),
            (-1.0, 0.0, 0.99996779),
            (2.2, 0.3, 1.27839916),
        ] {
            let activation = proportional.activation(&input.grades(error), &input.grades(rate));
            assert!((output.centroid(&activation) - expected).abs() < 1e-8);
        }

        let sets = Membership::evenly_spaced_triangles::<7>(-1.0, 1.0);
        let input = Partition::new(sets).unwrap();
        let rules = LabelMap::<7, 7>::new([NM, NS, NS, ZO, PM, PB, PB]).unwrap();
        let output = Output::<7>::new(sets, -1.0, 1.0, 201).unwrap();
        for (k2, k1) in
            [(-1.0, -0.66663366), (-0.5, -0.3334), (0.0, 0.0), (0.1, 0.23939586), (0.5, 0.70883073), (1.0, 0.89217822)]
        {
            let y = output.centroid(&rules.apply(&input.grades(k2)));
            assert!((y - k1).abs() < 1e-8, "{k2}: {y}");
        }
    }

    #[test]
    fn grades_of_every_shape() {
        let gaussian = Membership::Gaussian { center: 2.0, width: 0.5 };
        assert_eq!(gaussian.grade(2.0), 1.0);
        // At one standard deviation. Tolerance: one rounding error, because the reference uses the same function.
        assert!((gaussian.grade(1.5) - (-0.5_f64).exp()).abs() < 1e-15);
        assert_eq!(gaussian.grade(f64::INFINITY), 0.0);

        let edge = Membership::Triangle { left: 1.0, peak: 1.0, right: 2.0 };
        assert_eq!([0.999, 1.0, 1.5, 2.0].map(|x| edge.grade(x)), [0.0, 1.0, 0.5, 0.0]);

        let trapezoid =
            Membership::Trapezoid { left_foot: 0.0, left_shoulder: 1.0, right_shoulder: 2.0, right_foot: 4.0 };
        assert_eq!(
            [-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 4.0, 5.0].map(|x| trapezoid.grade(x)),
            [0.0, 0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0]
        );

        let everything = Membership::Trapezoid {
            left_foot: f64::NEG_INFINITY,
            left_shoulder: f64::NEG_INFINITY,
            right_shoulder: f64::INFINITY,
            right_foot: f64::INFINITY,
        };
        let right_shoulder = Membership::Trapezoid {
            left_foot: 0.0,
            left_shoulder: 1.0,
            right_shoulder: 2.0,
            right_foot: f64::INFINITY,
        };
        for x in [f64::NEG_INFINITY, -1.0, 0.0, f64::INFINITY] {
            assert_eq!(everything.grade(x), 1.0);
        }
        assert_eq!([-1.0, 0.5, 1e9, f64::INFINITY].map(|x| right_shoulder.grade(x)), [0.0, 0.5, 1.0, 1.0]);
        for set in [gaussian, edge, trapezoid, everything, right_shoulder] {
            assert!(set.grade(f64::NAN).is_nan());
            assert!(Partition::new([set]).is_ok());
        }
    }

    #[test]
    fn neighbors_cross_at_one_half() {
        let halfway = 0.5 * (8.0 + 16.0);
        for sets in
            [Membership::evenly_spaced_gaussians::<5>(0.0, 32.0), Membership::evenly_spaced_triangles::<5>(0.0, 32.0)]
        {
            // exp(-ln 2). Tolerance: a few rounding errors in the width.
            assert!((sets[1].grade(halfway) - 0.5).abs() < 1e-15);
            assert!((sets[2].grade(halfway) - 0.5).abs() < 1e-15);
        }
        // Width for the rescue vehicle, truncated to 6 digits.
        let [Membership::Gaussian { width, .. }, ..] = Membership::evenly_spaced_gaussians::<5>(0.0, 32.0) else {
            panic!("not a Gaussian set");
        };
        assert!((width - 3.39728).abs() < 1e-5);
    }

    #[test]
    fn product_and_minimum_differ_as_they_should() {
        let [minimum, product] = [Conjunction::Minimum, Conjunction::Product].map(|conjunction| {
            RuleTable::<2, 2, 3>::new([[0, 1], [1, 2]], conjunction).unwrap().activation(&[0.25, 0.75], &[0.5, 0.5])
        });
        assert_eq!(minimum, [0.25, 0.5, 0.5]);
        assert_eq!(product, [0.125, 0.375, 0.375]);
    }

    #[test]
    fn a_label_without_rule_stays_inactive_and_merged_labels_take_the_larger() {
        let rules = RuleTable::<1, 2, 3>::new([[0, 0]], Conjunction::Minimum).unwrap();
        assert_eq!(rules.activation(&[0.8], &[0.3, 0.6]), [0.6, 0.0, 0.0]);
        let merge = LabelMap::<3, 2>::new([1, 0, 1]).unwrap();
        assert_eq!(merge.apply(&[0.2, 0.3, 0.4]), [0.3, 0.4]);
    }

    /// The centroid of one fully active triangle is its peak. Tolerance: rounding of a sum of 101 terms below 1.
    #[test]
    fn one_active_label_gives_its_center() {
        let output = Output::<5>::new(Membership::evenly_spaced_triangles(0.0, 1.0), 0.0, 1.0, 101).unwrap();
        assert!((output.centroid(&[0.0, 0.0, 1.0, 0.0, 0.0]) - 0.5).abs() < 1e-14);
        assert!((output.centroid(&[0.0, 1.0, 0.0, 0.0, 0.0]) - 0.25).abs() < 1e-14);
    }

    #[test]
    fn no_active_rule_and_nan_give_nan() {
        let coordination = Coordination::new();
        assert!(coordination.weight.centroid(&[0.0; 7]).is_nan());
        assert!(Output::<0>::new([], 0.0, 1.0, 11).unwrap().centroid(&[]).is_nan());
        for (degrees, speed) in [(f64::NAN, 10.0), (10.0, f64::NAN), (f64::NAN, f64::NAN)] {
            let [k1, k2] = coordination.weights(degrees, speed);
            assert!(k1.is_nan() && k2.is_nan());
        }

        // An input between the sets fires no rule.
        let gap = Partition::new([
            Membership::Triangle { left: 0.0, peak: 1.0, right: 2.0 },
            Membership::Triangle { left: 3.0, peak: 4.0, right: 5.0 },
        ])
        .unwrap();
        let output = Output::<2>::new(Membership::evenly_spaced_triangles(0.0, 1.0), 0.0, 1.0, 11).unwrap();
        let rules = LabelMap::<2, 2>::new([0, 1]).unwrap();
        assert!(output.centroid(&rules.apply(&gap.grades(2.5))).is_nan());
        assert!(!output.centroid(&rules.apply(&gap.grades(1.5))).is_nan());
    }

    #[test]
    fn tables_can_be_checked_at_compile_time() {
        const RULES: Result<RuleTable<2, 2, 2>, FuzzyError> = RuleTable::new([[0, 1], [1, 0]], Conjunction::Product);
        const MAP: Result<LabelMap<2, 2>, FuzzyError> = LabelMap::new([0, 2]);
        assert!(RULES.is_ok());
        assert!(MAP.is_err());
    }

    #[test]
    fn bad_descriptions_are_rejected() {
        let bad_label = RuleTable::<2, 2, 3>::new([[0, 1], [2, 3]], Conjunction::Minimum);
        assert_eq!(
            bad_label.unwrap_err().to_string(),
            "fuzzy rule in row 1, column 1: label 3 does not exist, expected 0 to 2"
        );

        let triangle = |left, peak, right| Membership::Triangle { left, peak, right };
        let trapezoid = |left_foot, left_shoulder, right_shoulder, right_foot| Membership::Trapezoid {
            left_foot,
            left_shoulder,
            right_shoulder,
            right_foot,
        };
        let gaussian = |center, width| Membership::Gaussian { center, width };
        let infinity = f64::INFINITY;
        for set in [
            gaussian(f64::NAN, 1.0),
            gaussian(infinity, 1.0),
            gaussian(0.0, 0.0),
            gaussian(0.0, -1.0),
            gaussian(0.0, f64::NAN),
            gaussian(0.0, infinity),
            triangle(0.0, f64::NAN, 1.0),
            triangle(f64::NAN, 0.0, 1.0),
            triangle(0.0, 2.0, 1.0),
            triangle(1.0, 0.0, 2.0),
            triangle(1.0, 1.0, 1.0),
            triangle(-infinity, infinity, infinity),
            trapezoid(0.0, 2.0, 1.0, 3.0),
            trapezoid(1.0, 1.0, 1.0, 1.0),
            trapezoid(0.0, 1.0, f64::NAN, 3.0),
            trapezoid(0.0, infinity, infinity, infinity),
            trapezoid(-infinity, -infinity, -infinity, 0.0),
        ] {
            let good = gaussian(0.0, 1.0);
            let error = Partition::new([good, set]).unwrap_err();
            assert!(matches!(error, FuzzyError::Membership { index: 1, .. }), "{set:?}: {error}");
            assert!(Output::<2>::new([good, set], 0.0, 1.0, 11).is_err());
        }
        // A single set has no spacing.
        assert!(Partition::new(Membership::evenly_spaced_gaussians::<1>(0.0, 1.0)).is_err());

        let sets = Membership::evenly_spaced_gaussians::<2>(0.0, 1.0);
        for (low, high) in [(1.0, 0.0), (0.0, 0.0), (0.0, f64::NAN), (-infinity, 0.0)] {
            assert!(matches!(Output::<2>::new(sets, low, high, 11), Err(FuzzyError::Grid { points: 11, .. })));
        }
        assert!(matches!(Output::<2>::new(sets, 0.0, 1.0, 1), Err(FuzzyError::Grid { points: 1, .. })));
        assert_eq!(
            Output::<1>::new([triangle(0.11, 0.15, 0.19)], 0.0, 1.0, 11),
            Err(FuzzyError::NoSupport { label: 0 })
        );
    }

    /// The centroid computed from its definition, with every label at every point.
    fn centroid_by_definition(sets: &[Membership], low: f64, high: f64, points: usize, activation: &[f64]) -> f64 {
        let (mut moment, mut area) = (0.0, 0.0);
        for i in 0..points {
            let y = low + (high - low) * i as f64 / (points - 1) as f64;
            let clipped = sets.iter().zip(activation).map(|(set, limit)| set.grade(y).min(*limit));
            let mu = clipped.fold(0.0, f64::max);
            moment += y * mu;
            area += mu;
        }
        moment / area
    }

    /// A set with its center between -3 and 3, wide enough for a grid of 8 points.
    fn membership() -> impl Strategy<Value = Membership> {
        let sorted = |mut x: [f64; 4]| {
            x.sort_by(f64::total_cmp);
            [x[0] - 0.5, x[1], x[2], x[3] + 0.5]
        };
        prop_oneof![
            (-3.0..3.0, 0.3..2.0).prop_map(|(center, width)| Membership::Gaussian { center, width }),
            (-3.0..3.0, 0.5..4.0, 0.5..4.0).prop_map(|(peak, before, after)| Membership::Triangle {
                left: peak - before,
                peak,
                right: peak + after
            }),
            prop::array::uniform4(-3.0..3.0).prop_map(move |x| {
                let [left_foot, left_shoulder, right_shoulder, right_foot] = sorted(x);
                Membership::Trapezoid { left_foot, left_shoulder, right_shoulder, right_foot }
            }),
        ]
    }

    /// Activations of any size, including 0 and equal activations.
    fn activation() -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), Just(0.5), 0.0..1.0, (0.0..200.0).prop_map(|digits: f64| 10.0_f64.powf(-digits))]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// The labels that `centroid` skips never change its result. Tolerance: the order of the terms differs. A sum
        /// of n terms has a relative error of n 1.1e-16, so two centroids differ by at most 4 n 1.1e-16 times the
        /// largest point: 2.7e-13 with 200 points up to 3.
        #[test]
        fn the_centroid_follows_its_definition(
            sets in prop::array::uniform5(membership()), activation in prop::array::uniform5(activation()),
            points in 8_usize..200,
        ) {
            if let Ok(output) = Output::new(sets, -3.0, 3.0, points) {
                let (actual, expected) =
                    (output.centroid(&activation), centroid_by_definition(&sets, -3.0, 3.0, points, &activation));
                prop_assert!(
                    actual.is_nan() && expected.is_nan() || (actual - expected).abs() < 1e-12,
                    "{actual} is not {expected}"
                );
            }
        }

        /// The output sets of the controllers, with 7 labels and 101, 121 or 201 points. The tolerance is the same as
        /// in the test above.
        #[test]
        fn evenly_spaced_sets_follow_the_definition(
            activation in prop::array::uniform7(activation()), points in prop::sample::select(vec![101_usize, 121, 201]),
            gaussian: bool,
        ) {
            let sets = if gaussian {
                Membership::evenly_spaced_gaussians(-3.0, 3.0)
            } else {
                Membership::evenly_spaced_triangles(-3.0, 3.0)
            };
            let actual = Output::<7>::new(sets, -3.0, 3.0, points).unwrap().centroid(&activation);
            let expected = centroid_by_definition(&sets, -3.0, 3.0, points, &activation);
            prop_assert!(
                actual.is_nan() && expected.is_nan() || (actual - expected).abs() < 1e-12,
                "{actual} is not {expected}"
            );
        }
    }

    proptest! {
        /// Weights stay within the output range and depend only on the magnitude of the angle.
        #[test]
        fn coordination_is_bounded_and_even(degrees in -60.0..60.0f64, speed in -10.0..80.0f64) {
            let coordination = Coordination::new();
            let weights = coordination.weights(degrees, speed);
            for weight in weights {
                prop_assert!((0.0..=1.0).contains(&weight));
            }
            prop_assert_eq!(weights, coordination.weights(-degrees, speed));
        }

        /// Mirrored rules give a mirrored output. Tolerance: the two sums are in opposite order.
        #[test]
        fn mirrored_rules_are_odd(x in -4.0..4.0f64, y in -4.0..4.0f64, product: bool) {
            let input = Partition::new(Membership::evenly_spaced_triangles::<3>(-4.0, 4.0)).unwrap();
            let conjunction = if product { Conjunction::Product } else { Conjunction::Minimum };
            let rules = RuleTable::<3, 3, 5>::new([[0, 1, 2], [1, 2, 3], [2, 3, 4]], conjunction).unwrap();
            let output = Output::<5>::new(Membership::evenly_spaced_gaussians(-2.0, 2.0), -2.0, 2.0, 81).unwrap();
            let at = |x, y| output.centroid(&rules.activation(&input.grades(x), &input.grades(y)));
            prop_assert!((at(x, y) + at(-x, -y)).abs() < 1e-13);
            prop_assert!(at(x, y).abs() <= 2.0);
            prop_assert!((at(x, y) - at(y, x)).abs() < 1e-13);
        }
    }
}
