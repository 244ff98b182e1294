//! PID controller whose gains follow fuzzy rules on the error and its rate.
//!
//! One sample with the error `e` and its rate `ec`, sample time `T` ([`FuzzyPid::sample`]):
//!
//! ```text
//! E, EC  = 3 e / error_range, 3 ec / rate_range, limited to -3..=3
//! dK     = fuzzy rules on E and EC, one table for each of the three gains       FuzzyPid::increments
//! K      = max(0, k + scale dK)
//! I_new  = I exp(-leak T) + K_i e T, limited to -integral_limit..=integral_limit
//! v      = K_p e + I_new + K_d ec
//! output = v, limited to output_minimum..=output_maximum
//! I      = I_new, unless v is beyond a limit and e drives it further (anti-windup)
//! ```
//!
//! Each input has seven Gaussian sets NB, NM, NS, ZO, PS, PM, PB, centered at -3, -2, ... 3; neighbors cross at 1/2.
//! The strength of a rule is the smaller of its two grades; a label has the largest strength of its rules. The labels
//! of the output are triangles at the same positions; the centroid of their union is computed from 121 points between
//! -3 and 3.
//!
//! If the rate is not measured, [`filtered_rate`] computes it from the error.
//!
//! # Reference
//!
//! Z.-Y. Zhao, M. Tomizuka, S. Isaka, "Fuzzy gain scheduling of PID controllers", IEEE Transactions on Systems, Man,
//! and Cybernetics 23(5), 1993, 1392-1398, doi:10.1109/21.260670 (gains by fuzzy rules on error and rate).

use fmu::derive::Enumeration;

use crate::fuzzy::{Conjunction, FuzzyError, Membership, Output, Partition, RuleTable};

const LABELS: usize = 7;
/// The inputs and outputs of the rules are within -`DOMAIN`..=`DOMAIN`.
const DOMAIN: f64 = 3.0;

/// Labels, negative big to positive big.
const NB: usize = 0;
const NM: usize = 1;
const NS: usize = 2;
const ZO: usize = 3;
const PS: usize = 4;
const PM: usize = 5;
const PB: usize = 6;

type Table = [[usize; LABELS]; LABELS];

/// Proportional, integral and derivative gain, or one value for each of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gains {
    /// Gain of the error: output per error.
    pub proportional: f64,
    /// Gain of the integral of the error: output per error and s.
    pub integral: f64,
    /// Gain of the rate of the error: output per rate.
    pub derivative: f64,
}

/// Rules that change the gains; a parameter of the FMUs that use them. Rows are the error, columns its rate, both from
/// NB to PB.
///
/// The tables in most publications are for steps in one direction: the sign of the error determines whether they
/// increase or decrease the proportional and integral gains. The mirrored tables, which have the same rows for negative
/// errors, make the law odd.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rules {
    /// point symmetric: an error and its opposite change the gains alike
    Mirrored = 0,
    /// as commonly printed, for steps in one direction
    Standard = 1,
}

/// The rows for negative errors, common to both sets of rules: proportional, integral, derivative.
const NEGATIVE: [[[usize; LABELS]; 3]; 3] = [
    [[PB, PB, PM, PM, PS, ZO, ZO], [PB, PB, PM, PS, PS, ZO, NS], [PM, PM, PM, PS, ZO, NS, NS]],
    [[NB, NB, NM, NM, NS, ZO, ZO], [NB, NB, NM, NS, NS, ZO, ZO], [NB, NM, NS, NS, ZO, PS, PS]],
    [[PS, NS, NB, NB, NB, NM, PS], [PS, NS, NB, NM, NM, NS, ZO], [ZO, NS, NM, NM, NS, NS, ZO]],
];

/// The mirrored rules' row for zero error, for each gain. Each row is symmetric.
const MIDDLE: [[usize; LABELS]; 3] =
    [[PM, PM, PS, ZO, PS, PM, PM], [NM, NM, NS, ZO, NS, NM, NM], [ZO, NS, NS, NS, NS, NS, ZO]];

/// The standard rules' rows for zero and positive errors.
const STANDARD: [[[usize; LABELS]; 4]; 3] = [
    [
        [PM, PM, PS, ZO, NS, NM, NM],
        [PS, PS, ZO, NS, NS, NM, NM],
        [PS, ZO, NS, NM, NM, NM, NB],
        [ZO, ZO, NM, NM, NM, NB, NB],
    ],
    [
        [NM, NM, NS, ZO, PS, PM, PM],
        [NM, NS, ZO, PS, PS, PM, PB],
        [ZO, ZO, PS, PS, PM, PB, PB],
        [ZO, ZO, PS, PM, PM, PB, PB],
    ],
    [
        [ZO, NS, NS, NS, NS, NS, ZO],
        [ZO, ZO, ZO, ZO, ZO, ZO, ZO],
        [PB, NS, PS, PS, PS, PS, PB],
        [PB, PM, PM, PM, PS, PS, PB],
    ],
];

impl Rules {
    /// The table of a gain: 0 proportional, 1 integral, 2 derivative.
    fn table(self, gain: usize) -> Table {
        let negative = NEGATIVE[gain];
        std::array::from_fn(|row| match self {
            _ if row < ZO => negative[row],
            Self::Standard => STANDARD[gain][row - ZO],
            Self::Mirrored if row == ZO => MIDDLE[gain],
            Self::Mirrored => {
                let mut reflected = negative[PB - row];
                reflected.reverse();
                reflected
            }
        })
    }
}

/// Parameters of the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Gains before the correction by the rules, >= 0.
    pub gains: Gains,
    /// Change of a gain per unit of the rules' output (which stays within -3..=3), in the unit of the gain.
    pub scales: Gains,
    /// Error at the edge of the rules' domain, > 0.
    pub error_range: f64,
    /// Rate of the error at the edge of the rules' domain, > 0.
    pub rate_range: f64,
    /// Smallest output.
    pub output_minimum: f64,
    /// Largest output, at least `output_minimum`.
    pub output_maximum: f64,
    /// Largest magnitude of the integral part of the output, >= 0.
    pub integral_limit: f64,
    /// Rate at which the integral decays, 1/s, >= 0.
    pub leak_rate: f64,
}

/// The rules, tabulated once.
#[derive(Clone, Debug, PartialEq)]
pub struct FuzzyPid {
    input: Partition<LABELS>,
    tables: [RuleTable<LABELS, LABELS, LABELS>; 3],
    output: Output<LABELS>,
}

impl FuzzyPid {
    /// Tabulates the rules.
    ///
    /// # Errors
    ///
    /// The rules are invalid, which does not occur with the existing variants of [`Rules`].
    pub fn new(rules: Rules) -> Result<Self, FuzzyError> {
        let table = |gain| RuleTable::new(rules.table(gain), Conjunction::Minimum);
        Ok(Self {
            input: Partition::new(Membership::evenly_spaced_gaussians(-DOMAIN, DOMAIN))?,
            tables: [table(0)?, table(1)?, table(2)?],
            output: Output::new(Membership::evenly_spaced_triangles(-DOMAIN, DOMAIN), -DOMAIN, DOMAIN, 121)?,
        })
    }

    /// Output of the rules for the error `e` and the rate `ec`, both scaled and clipped to -3..=3: a number within
    /// -3..=3 for each gain. NaN gives NaN.
    pub fn increments(&self, e: f64, ec: f64) -> Gains {
        let grades = |x: f64| self.input.grades(x.clamp(-DOMAIN, DOMAIN));
        let (rows, columns) = (grades(e), grades(ec));
        let [proportional, integral, derivative] =
            [0, 1, 2].map(|gain: usize| self.output.centroid(&self.tables[gain].activation(&rows, &columns)));
        Gains { proportional, integral, derivative }
    }

    /// Computes one sample: the output, and the gains used for it.
    ///
    /// * `e`: error; `ec`: its rate.
    /// * `integral`: I, integral part of the output, 0 at the start; updated for the next sample.
    /// * `sample_time`: T in s, > 0.
    ///
    /// NaN in any argument gives NaN.
    pub fn sample(&self, s: &Settings, integral: &mut f64, e: f64, ec: f64, sample_time: f64) -> (f64, Gains) {
        let dk = self.increments(DOMAIN * e / s.error_range, DOMAIN * ec / s.rate_range);
        let gain = |k: f64, scale: f64, dk: f64| at_least_zero(k + scale * dk);
        let k = Gains {
            proportional: gain(s.gains.proportional, s.scales.proportional, dk.proportional),
            integral: gain(s.gains.integral, s.scales.integral, dk.integral),
            derivative: gain(s.gains.derivative, s.scales.derivative, dk.derivative),
        };
        let leaked = *integral * fmu::math::exp(-s.leak_rate * sample_time);
        let next = within(leaked + k.integral * e * sample_time, -s.integral_limit, s.integral_limit);
        let v = k.proportional * e + next + k.derivative * ec;
        let winds_up = v > s.output_maximum && e > 0.0 || v < s.output_minimum && e < 0.0;
        if !winds_up {
            *integral = next;
        }
        (within(v, s.output_minimum, s.output_maximum), k)
    }
}

/// The greater of `value` and 0, but NaN if it is NaN (f64::max would give 0).
fn at_least_zero(value: f64) -> f64 {
    if value < 0.0 { 0.0 } else { value }
}

/// Limits `value` to `low..=high`; unlike f64::clamp, it never panics.
fn within(value: f64, low: f64, high: f64) -> f64 {
    if value > high {
        high
    } else if value < low {
        low
    } else {
        value
    }
}

/// Rate of a sampled error: its difference quotient, filtered by a first-order lag.
///
/// ```text
/// d <- a d + (1 - a) (e - e_previous) / T,   a = exp(-T / T_f)
/// ```
///
/// * `rate`: d at the last sample, 0 at the start.
/// * `e`, `previous`: the error now and at the last sample; at the first sample both are the same.
/// * `time_constant`: T_f in s; <= 0 for no lag. `sample_time`: T in s, > 0.
///
/// NaN gives NaN.
pub fn filtered_rate(rate: f64, e: f64, previous: f64, time_constant: f64, sample_time: f64) -> f64 {
    crate::limit::lag(rate, (e - previous) / sample_time, time_constant, sample_time)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn gains(proportional: f64, integral: f64, derivative: f64) -> Gains {
        Gains { proportional, integral, derivative }
    }

    fn rules(rules: Rules) -> FuzzyPid {
        FuzzyPid::new(rules).unwrap()
    }

    /// A plain PID: with scales of 0, the rules have no effect.
    const PLAIN: Settings = Settings {
        gains: Gains { proportional: 2.0, integral: 8.0, derivative: 0.5 },
        scales: Gains { proportional: 0.0, integral: 0.0, derivative: 0.0 },
        error_range: 1.0,
        rate_range: 1.0,
        output_minimum: -10.0,
        output_maximum: 10.0,
        integral_limit: 100.0,
        leak_rate: 0.0,
    };

    /// Check values for the heavy vehicle, computed by an independent implementation and printed to 8 digits.
    /// Tolerance: 1e-8.
    #[test]
    fn increments_match_the_check_values() {
        let mirrored = [
            (0.0, 0.0, gains(0.21831225, -0.08619045, -1.08617784)),
            (-3.0, -3.0, gains(2.68329967, -2.68323694, 0.78467085)),
            (1.0, 0.0, gains(0.99996779, -0.99996779, -1.9176143)),
            (-1.0, 0.0, gains(0.99996779, -0.99996779, -1.9176143)),
            (2.2, 0.3, gains(1.27839916, -1.27839916, -2.02324844)),
            // Beyond the domain, the increments are those at its edge.
            (-30.0, -4.0, gains(2.68329967, -2.68323694, 0.78467085)),
        ];
        let standard = [
            (-3.0, -3.0, gains(2.68329967, -2.68323694, 0.784670854)),
            (-2.4, 2.4, gains(-0.384338791, 0.0, -0.56869968)),
            (0.0, 0.0, gains(0.129705217, 0.0, -0.999967787)),
            (2.4, -2.4, gains(0.374344265, -0.0122137929, 0.358046784)),
            (3.0, 3.0, gains(-2.56111733, 2.68323694, 2.36876144)),
        ];
        for (set, values) in [(Rules::Mirrored, &mirrored[..]), (Rules::Standard, &standard)] {
            let fuzzy = rules(set);
            for &(e, ec, expected) in values {
                let dk = fuzzy.increments(e, ec);
                for (actual, expected) in [
                    (dk.proportional, expected.proportional),
                    (dk.integral, expected.integral),
                    (dk.derivative, expected.derivative),
                ] {
                    assert!((actual - expected).abs() < 1e-8, "{set:?} ({e}, {ec}): {actual} is not {expected}");
                }
            }
        }
    }

    /// The increment of one gain computed from its definition, with every rule in the table and every label at every
    /// point.
    fn increment_by_definition(table: &Table, e: f64, ec: f64) -> f64 {
        let place = |label: usize| label as f64 - 3.0;
        // Neighbors cross at 1/2.
        let grade = |label: usize, x: f64| 0.5_f64.powf(4.0 * (x - place(label)) * (x - place(label)));
        let mut activation = [0.0_f64; LABELS];
        for (row, labels) in table.iter().enumerate() {
            for (column, &label) in labels.iter().enumerate() {
                activation[label] = activation[label].max(grade(row, e).min(grade(column, ec)));
            }
        }
        let (mut moment, mut area) = (0.0, 0.0);
        for point in -60..=60 {
            let y = f64::from(point) / 20.0;
            let mut mu = 0.0_f64;
            for (label, limit) in activation.iter().enumerate() {
                mu = mu.max((1.0 - (y - place(label)).abs()).max(0.0).min(*limit));
            }
            moment += y * mu;
            area += mu;
        }
        moment / area
    }

    /// Checks the complete domain. Tolerance: the exponent of a grade is at most 100, so its relative error is about
    /// 1e-14, but only grades above 1e-6 (errors of 2e-15) affect the result at this level. A sum of 121 terms adds 121
    /// rounding errors, so two centroids within -3..=3 differ by at most 2e-13.
    #[test]
    fn increments_follow_their_definition() {
        for set in [Rules::Mirrored, Rules::Standard] {
            let fuzzy = rules(set);
            for (i, j) in (0..=60).flat_map(|i| (0..=60).map(move |j| (i, j))) {
                let (e, ec) = (f64::from(i) / 10.0 - 3.0, f64::from(j) / 10.0 - 3.0);
                let dk = fuzzy.increments(e, ec);
                for (gain, actual) in [dk.proportional, dk.integral, dk.derivative].into_iter().enumerate() {
                    let expected = increment_by_definition(&set.table(gain), e, ec);
                    assert!((actual - expected).abs() < 1e-12, "{set:?} ({e}, {ec}) {gain}: {actual}, not {expected}");
                }
            }
        }
    }

    #[test]
    fn the_tables_are_as_symmetric_as_they_say() {
        for gain in 0..3 {
            let (mirrored, standard) = (Rules::Mirrored.table(gain), Rules::Standard.table(gain));
            for i in 0..LABELS {
                for j in 0..LABELS {
                    assert_eq!(mirrored[i][j], mirrored[6 - i][6 - j], "{gain}: {i} {j}");
                }
            }
            assert_eq!(mirrored[..3], standard[..3]);
            assert_ne!(mirrored, standard);
        }
        // The standard proportional rules change sign when error and rate do.
        let standard = Rules::Standard.table(0);
        assert_eq!((standard[0][0], standard[6][6]), (PB, NB));
    }

    #[test]
    fn without_rules_it_is_a_pid() {
        // K_p e + K_i e T + K_d ec, exact with powers of 2.
        let fuzzy = rules(Rules::Mirrored);
        let mut integral = 0.0;
        let (output, used) = fuzzy.sample(&PLAIN, &mut integral, 0.5, 0.25, 0.125);
        assert_eq!((output, integral, used), (1.0 + 0.5 + 0.125, 0.5, PLAIN.gains));
        let (output, _) = fuzzy.sample(&PLAIN, &mut integral, -0.25, 0.0, 0.125);
        assert_eq!((output, integral), (-0.5 + 0.25, 0.25));
    }

    #[test]
    fn rules_change_gains_by_their_scales_but_never_below_zero() {
        let fuzzy = rules(Rules::Mirrored);
        let settings = Settings { scales: gains(1.0, 100.0, 0.25), error_range: 2.0, rate_range: 4.0, ..PLAIN };
        let (_, used) = fuzzy.sample(&settings, &mut 0.0, -2.0, -4.0, 0.125);
        let dk = fuzzy.increments(-3.0, -3.0);
        assert_eq!(used, gains(2.0 + dk.proportional, 0.0, 0.5 + 0.25 * dk.derivative));
    }

    #[test]
    fn the_integral_is_limited_leaks_and_does_not_wind_up() {
        let fuzzy = rules(Rules::Mirrored);
        let mut integral = 0.0;
        let limited = Settings { integral_limit: 0.25, ..PLAIN };
        assert_eq!(fuzzy.sample(&limited, &mut integral, 1.0, 0.0, 0.125).0, 2.25);
        assert_eq!(integral, 0.25);

        let leaking = Settings { leak_rate: 2.0, ..PLAIN };
        fuzzy.sample(&leaking, &mut integral, 0.0, 0.0, 0.125);
        assert_eq!(integral, 0.25 * (-0.25_f64).exp());

        // If the output is beyond a limit and the error drives it further, the integral is held, without leak. If the
        // error has the other sign, the integral changes.
        let tight = Settings { output_minimum: -0.5, output_maximum: 0.5, leak_rate: 2.0, ..PLAIN };
        let mut integral = 0.25;
        assert_eq!(fuzzy.sample(&tight, &mut integral, 1.0, 0.0, 0.125).0, 0.5);
        assert_eq!(integral, 0.25);
        assert_eq!(fuzzy.sample(&tight, &mut integral, -1.0, 0.0, 0.125).0, -0.5);
        assert_eq!(integral, 0.25);
        fuzzy.sample(&tight, &mut integral, -1.0, 8.0, 0.125); // the rate outweighs the error: output at its maximum
        assert_eq!(integral, 0.25 * (-0.25_f64).exp() - 1.0);
    }

    #[test]
    fn nan_comes_out_as_nan() {
        let fuzzy = rules(Rules::Mirrored);
        for (e, ec, i) in [(f64::NAN, 0.0, 0.0), (0.0, f64::NAN, 0.0), (0.0, 0.0, f64::NAN)] {
            assert!(fuzzy.sample(&PLAIN, &mut i.clone(), e, ec, 0.001).0.is_nan());
        }
        assert!(fuzzy.increments(f64::NAN, 0.0).integral.is_nan());
    }

    #[test]
    fn the_rate_of_a_ramp_is_its_slope() {
        // Closed form of the lag with a constant slope: slope (1 - a^n). Tolerance: rounding in the difference of
        // numbers of order 1.
        let (a, ramp) = ((-0.05_f64).exp(), |n: i32| 0.7 + 0.003 * f64::from(n));
        let mut rate = 0.0;
        for n in 1..100 {
            rate = filtered_rate(rate, ramp(n), ramp(n - 1), 0.02, 0.001);
            assert!((rate - 3.0 * (1.0 - a.powi(n))).abs() < 1e-11);
        }
        // Without lag, the rate is the difference quotient.
        assert_eq!(filtered_rate(7.0, 2.0, 1.0, 0.0, 0.5), 2.0);
        assert!(filtered_rate(0.0, f64::NAN, 1.0, 0.0, 0.5).is_nan());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(128))]

        /// Mirrored rules make an odd law. The comparison is exact, because the sums of the centroid add the same
        /// numbers in the same order.
        #[test]
        fn mirrored_rules_make_an_odd_law(e in -2.0..2.0_f64, ec in -2.0..2.0_f64, i in -0.1..0.1_f64) {
            let fuzzy = rules(Rules::Mirrored);
            let settings = Settings { scales: gains(0.5, 2.0, 0.1), output_minimum: -1.0, output_maximum: 1.0, ..PLAIN };
            let (mut right, mut left) = (i, -i);
            let (there, used) = fuzzy.sample(&settings, &mut right, e, ec, 0.001);
            let (mirror, used_in_mirror) = fuzzy.sample(&settings, &mut left, -e, -ec, 0.001);
            prop_assert_eq!((there, right, used), (-mirror, -left, used_in_mirror));
        }

        /// For any input, outputs, integral and gains stay within their limits.
        #[test]
        fn everything_stays_within_its_limits(
            errors in prop::collection::vec((-5.0..5.0_f64, -5.0..5.0_f64), 1..20), standard: bool,
        ) {
            let fuzzy = rules(if standard { Rules::Standard } else { Rules::Mirrored });
            let settings = Settings { scales: gains(0.5, 2.0, 0.1), output_maximum: 3.0, integral_limit: 0.5, ..PLAIN };
            let mut integral = 0.0;
            for (e, ec) in errors {
                let (output, used) = fuzzy.sample(&settings, &mut integral, e, ec, 0.1);
                prop_assert!((-10.0..=3.0).contains(&output) && integral.abs() <= 0.5);
                for (used, (k, scale)) in [used.proportional, used.integral, used.derivative]
                    .into_iter()
                    .zip([(2.0, 0.5), (8.0, 2.0), (0.5, 0.1)])
                {
                    prop_assert!(used >= 0.0 && (used - k).abs() <= 3.0 * scale);
                }
            }
        }
    }
}
