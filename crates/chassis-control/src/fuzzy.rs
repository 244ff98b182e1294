//! Mamdani fuzzy inference with one or two inputs. Tables are allocated once, an evaluation allocates nothing.
//!
//! One evaluation is a chain of four steps, each a value built once and a method called per sample:
//!
//! | step | built once | per sample |
//! |---|---|---|
//! | fuzzify an input: grade of every label | [`Partition`] | [`Partition::grades`] |
//! | fire the rules: activation of every output label | [`RuleTable`] (two inputs), [`LabelMap`] (one input) | [`RuleTable::activation`], [`LabelMap::apply`] |
//! | give the same rules another consequent (optional) | [`LabelMap`] | [`LabelMap::apply`] |
//! | clip, unite and take the centroid | [`Output`] | [`Output::centroid`] |
//!
//! ```text
//! strength of rule (i, j):  g_i and g_j            AND = min or product (Conjunction)
//! activation of label l:    w_l = max of the strengths of its rules
//! fuzzy output:             mu(y) = max over l of min(w_l, mu_l(y))
//! crisp output:             sum(y mu(y)) / sum(mu(y)) over an even grid of points y
//! ```
//!
//! As a label counts with the largest strength of its rules, the activation is computed once per
//! label, and several outputs that share the rules need only one table.
//!
//! # No rule active, NaN
//!
//! The centroid of an empty set does not exist: if no label is active at any grid point, the
//! result is NaN, as it is if any input is NaN. Partitions that cover the whole (clipped) input
//! range with a rule for every pair of labels never get there.
//!
//! # Example
//!
//! ```
//! use chassis_control::fuzzy::{Conjunction, LabelMap, Membership, Output, Partition, RuleTable};
//! # fn main() -> Result<(), chassis_control::fuzzy::FuzzyError> {
//! // Labels low, high of two inputs in 0..=1; labels small, medium, large of the output.
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

use std::fmt;

/// A fuzzy set on the real line: the grade (0..=1) to which a number belongs to a label.
///
/// The parameters have the unit of the number. [`Partition::new`] and [`Output::new`] check them;
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
    /// 0 at the feet, 1 at the peak, linear in between. An infinite foot makes a shoulder: the
    /// grade is 1 from the peak on to that side. A foot at the peak makes a vertical edge.
    Triangle {
        /// Left foot, at most `peak`; minus infinity for a left shoulder.
        left: f64,
        /// Point of grade 1; finite.
        peak: f64,
        /// Right foot, at least `peak`, greater than `left`; plus infinity for a right shoulder.
        right: f64,
    },
    /// 1 between the shoulders, 0 outside the feet, linear in between. An infinite foot makes the
    /// grade 1 from its shoulder on to that side.
    Trapezoid {
        /// Left foot, at most `left_shoulder`.
        left_foot: f64,
        /// Left end of grade 1, at most `right_shoulder`; below plus infinity.
        left_shoulder: f64,
        /// Right end of grade 1; above minus infinity.
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
    /// `N` is at least 2 and `first < last`; otherwise [`Partition::new`] rejects the sets.
    pub fn evenly_spaced_gaussians<const N: usize>(first: f64, last: f64) -> [Self; N] {
        let width = spacing(N, first, last) / (8.0 * std::f64::consts::LN_2).sqrt();
        grid(first, last).map(|center| Self::Gaussian { center, width })
    }

    /// `N` triangles with evenly spaced peaks from `first` to `last`, each reaching to the peaks of
    /// its neighbors, so that they cross at grade 1/2; the outer two reach beyond `first` and
    /// `last` by the same distance.
    ///
    /// `N` is at least 2 and `first < last`; otherwise [`Partition::new`] rejects the sets.
    pub fn evenly_spaced_triangles<const N: usize>(first: f64, last: f64) -> [Self; N] {
        let spacing = spacing(N, first, last);
        grid(first, last).map(|peak| Self::Triangle { left: peak - spacing, peak, right: peak + spacing })
    }

    /// The rule this set breaks, if any.
    fn broken_rule(&self) -> Option<&'static str> {
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
                    Some("left_shoulder must be below and right_shoulder above infinity")
                } else {
                    None
                }
            }
        }
    }
}

/// Logarithm of the grade of a Gaussian set.
fn gaussian_exponent(x: f64, center: f64, width: f64) -> f64 {
    let z = (x - center) / width;
    -0.5 * z * z
}

/// The smaller of two numbers that are not NaN. One instruction, unlike `f64::min`.
#[inline]
fn least(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers that are not NaN.
#[inline]
fn greatest(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// Grade of a trapezoid whose feet may be infinite.
fn trapezoid(x: f64, left_foot: f64, left_shoulder: f64, right_shoulder: f64, right_foot: f64) -> f64 {
    // The falling edge is the rising one seen from the other side.
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

/// Distance of `n` even points from `first` to `last`.
fn spacing(n: usize, first: f64, last: f64) -> f64 {
    (last - first) / (n as f64 - 1.0)
}

/// Point `i` of `n` even points from `first` to `last`; exactly symmetric if `first == -last`.
fn point(i: usize, n: usize, first: f64, last: f64) -> f64 {
    let end = n as f64 - 1.0;
    (first * (end - i as f64) + last * i as f64) / end
}

/// `N` even points from `first` to `last`.
fn grid<const N: usize>(first: f64, last: f64) -> [f64; N] {
    std::array::from_fn(|i| point(i, N, first, last))
}

#[inline]
fn contains_nan<const N: usize>(values: &[f64; N]) -> bool {
    // All of them, without a branch for each.
    values.iter().fold(false, |any, x| any | x.is_nan())
}

/// The labels of one input: `N` fuzzy sets over the same axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Partition<const N: usize> {
    sets: [Membership; N],
    /// All sets, if all are Gaussian.
    gaussians: Option<Gaussians>,
}

/// Greatest number of Gaussian sets whose grades are evaluated together.
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
            // The same bits as one by one.
            Some(gaussians) if N <= 6 => first(gaussians.grades::<6>(x)),
            Some(gaussians) => first(gaussians.grades::<GAUSSIANS>(x)),
            None => self.sets.map(|set| set.grade(x)),
        }
    }
}

/// The first `N` of `FROM` values.
fn first<const FROM: usize, const N: usize>(values: [f64; FROM]) -> [f64; N] {
    std::array::from_fn(|i| values[i])
}

fn check_sets(sets: &[Membership]) -> Result<(), FuzzyError> {
    for (index, set) in sets.iter().enumerate() {
        if let Some(requirement) = set.broken_rule() {
            return Err(FuzzyError::Membership { index, set: *set, requirement });
        }
    }
    Ok(())
}

/// Combination of the grades of the two inputs of a rule to its strength ("and").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Conjunction {
    /// The smaller grade.
    Minimum,
    /// The product of the grades.
    Product,
}

/// A full set of rules with two inputs: "if the first input is row i and the second is column j,
/// then the output is label `table[i][j]`".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RuleTable<const ROWS: usize, const COLUMNS: usize, const LABELS: usize> {
    /// Numbers of the rules (rows one after the other), sorted by label.
    rules: [[usize; COLUMNS]; ROWS],
    /// End index in `rules` of the rules of each label.
    ends: [usize; LABELS],
    conjunction: Conjunction,
}

impl<const ROWS: usize, const COLUMNS: usize, const LABELS: usize> RuleTable<ROWS, COLUMNS, LABELS> {
    /// Takes the table of output labels, numbered from 0 to `LABELS - 1`. Can be evaluated at
    /// compile time.
    ///
    /// # Errors
    ///
    /// [`FuzzyError::Label`] if an entry is not below `LABELS`.
    pub const fn new(table: [[usize; COLUMNS]; ROWS], conjunction: Conjunction) -> Result<Self, FuzzyError> {
        let mut row = 0;
        while row < ROWS {
            if let Err(error) = check_labels(&table[row], row, LABELS) {
                return Err(error);
            }
            row += 1;
        }
        let (mut rules, mut ends) = ([[0; COLUMNS]; ROWS], [0; LABELS]);
        sort_by_label(table.as_flattened(), rules.as_flattened_mut(), &mut ends);
        Ok(Self { rules, ends, conjunction })
    }

    /// Activation (0..=1) of every output label: the largest strength among the rules that
    /// conclude it, 0 if there is none. All NaN if a grade is NaN.
    ///
    /// * `rows`, `columns`: grades of the first and the second input in their labels.
    #[inline(never)] // one copy in an FMU
    pub fn activation(&self, rows: &[f64; ROWS], columns: &[f64; COLUMNS]) -> [f64; LABELS] {
        // f64::min and f64::max would drop a NaN.
        if contains_nan(rows) || contains_nan(columns) {
            return [f64::NAN; LABELS];
        }
        let strengths = rows.map(|row| match self.conjunction {
            Conjunction::Minimum => columns.map(|column| least(row, column)),
            Conjunction::Product => columns.map(|column| row * column),
        });
        let (strengths, rules) = (strengths.as_flattened(), self.rules.as_flattened());
        let mut first = 0;
        self.ends.map(|end| {
            let of_label = &rules[std::mem::replace(&mut first, end)..end];
            of_label.iter().fold(0.0, |activation, &rule| greatest(activation, strengths[rule]))
        })
    }
}

/// Fills `rules` with the numbers of the rules, sorted by their labels, and `ends` with the ends of the labels.
#[inline(never)] // not unrolled for the size of a table
const fn sort_by_label(labels: &[usize], rules: &mut [usize], ends: &mut [usize]) {
    let (mut label, mut count) = (0, 0);
    while label < ends.len() {
        let mut rule = 0;
        while rule < labels.len() {
            if labels[rule] == label {
                rules[count] = rule;
                count += 1;
            }
            rule += 1;
        }
        ends[label] = count;
        label += 1;
    }
}

/// A map from `FROM` labels to `TO` labels. It gives the rules of a [`RuleTable`] another
/// consequent, or is itself the rule list of a system with one input ("if the input is label i,
/// then the output is label `map[i]`").
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LabelMap<const FROM: usize, const TO: usize> {
    map: [usize; FROM],
}

impl<const FROM: usize, const TO: usize> LabelMap<FROM, TO> {
    /// Takes the new label of every label, numbered from 0 to `TO - 1`. Can be evaluated at compile
    /// time.
    ///
    /// # Errors
    ///
    /// [`FuzzyError::Label`] (with row 0) if an entry is not below `TO`.
    pub const fn new(map: [usize; FROM]) -> Result<Self, FuzzyError> {
        match check_labels(&map, 0, TO) {
            Ok(()) => Ok(Self { map }),
            Err(error) => Err(error),
        }
    }

    /// Activation of every new label: the largest among the labels mapped to it, 0 if there is
    /// none. All NaN if an activation is NaN.
    pub fn apply(&self, activation: &[f64; FROM]) -> [f64; TO] {
        if contains_nan(activation) {
            return [f64::NAN; TO];
        }
        let mut mapped = [0.0_f64; TO];
        for (&label, &value) in self.map.iter().zip(activation) {
            mapped[label] = greatest(mapped[label], value);
        }
        mapped
    }
}

const fn check_labels(labels_used: &[usize], row: usize, labels: usize) -> Result<(), FuzzyError> {
    let mut column = 0;
    while column < labels_used.len() {
        if labels_used[column] >= labels {
            return Err(FuzzyError::Label { row, column, label: labels_used[column], labels });
        }
        column += 1;
    }
    Ok(())
}

/// Number of grid points that are evaluated together.
const LANES: usize = 4;

/// Numbers at neighboring grid points; zeros beyond the end of the grid.
type Block = [f64; LANES];

/// The output of the inference: its labels as fuzzy sets, tabulated on a grid of even points.
#[derive(Clone, Debug, PartialEq)]
pub struct Output<const LABELS: usize> {
    /// Cover the grid in order.
    stretches: Vec<Stretch>,
}

/// Neighboring grid points that have the same two main labels, those with the greatest grades.
///
/// Another label counts only where it can exceed these, which is rare if one of them is active.
#[derive(Clone, Debug, PartialEq)]
struct Stretch {
    main: [usize; 2],
    /// Smallest grade of the main labels.
    least: [f64; 2],
    /// Greatest grade of the other labels.
    greatest: f64,
    /// Points, and the grades of the main labels.
    blocks: Vec<[Block; 3]>,
    /// The other labels that have a grade.
    others: Vec<Other>,
}

/// A label that is not among the main ones of a stretch.
#[derive(Clone, Debug, PartialEq)]
struct Other {
    label: usize,
    /// Greatest grade in the stretch.
    greatest: f64,
    /// Grades in the stretch.
    grades: Vec<Block>,
}

/// Sums over grid points, one per lane, so that additions do not wait for each other.
#[derive(Default)]
struct Sums {
    moment: Block,
    area: Block,
}

impl Sums {
    #[inline]
    fn add(&mut self, points: &Block, grades: &Block) {
        for lane in 0..LANES {
            self.moment[lane] += points[lane] * grades[lane];
            self.area[lane] += grades[lane];
        }
    }

    fn centroid(&self) -> f64 {
        let sum = |parts: Block| (parts[0] + parts[1]) + (parts[2] + parts[3]);
        sum(self.moment) / sum(self.area)
    }
}

/// Grades clipped at the activation of their label.
#[inline]
fn clip(grades: &Block, activation: f64) -> Block {
    grades.map(|grade| least(grade, activation))
}

#[inline]
fn unite(a: Block, b: Block) -> Block {
    std::array::from_fn(|lane| greatest(a[lane], b[lane]))
}

impl Stretch {
    fn new(sets: &[Membership], main: [usize; 2], points: &[f64]) -> Self {
        let mut others = Vec::new();
        for (label, set) in sets.iter().enumerate() {
            let greatest = greatest_grade(set, points);
            if greatest > 0.0 && !main.contains(&label) {
                others.push(Other { label, greatest, grades: grades(set, points) });
            }
        }
        let [a, b] = main.map(|label| grades(&sets[label], points));
        let block = |points: &[f64]| std::array::from_fn(|lane| points.get(lane).copied().unwrap_or(0.0));
        let points_and_grades = points.chunks(LANES).zip(a.iter().zip(b));
        Self {
            main,
            least: main.map(|label| least_grade(&sets[label], points)),
            greatest: others.iter().map(|other| other.greatest).fold(0.0, greatest),
            blocks: points_and_grades.map(|(points, (&a, b))| [block(points), a, b]).collect(),
            others,
        }
    }

    #[inline]
    fn add_to<const LABELS: usize>(&self, sums: &mut Sums, activation: &[f64; LABELS]) {
        let [a, b] = self.main.map(|label| activation[label]);
        // The main labels alone reach this at every point.
        let floor = greatest(least(a, self.least[0]), least(b, self.least[1]));
        if self.greatest <= floor {
            for [points, of_a, of_b] in &self.blocks {
                sums.add(points, &unite(clip(of_a, a), clip(of_b, b)));
            }
        } else {
            self.add_all_to(sums, activation, floor);
        }
    }

    /// The same if labels other than the main ones can exceed `floor`.
    #[inline(never)]
    fn add_all_to<const LABELS: usize>(&self, sums: &mut Sums, activation: &[f64; LABELS], floor: f64) {
        let [a, b] = self.main.map(|label| activation[label]);
        let (mut rising, mut count) = ([(0, 0.0); LABELS], 0);
        for (number, other) in self.others.iter().enumerate() {
            if least(activation[other.label], other.greatest) > floor {
                rising[count] = (number, activation[other.label]);
                count += 1;
            }
        }
        for (block, [points, of_a, of_b]) in self.blocks.iter().enumerate() {
            let mut united = unite(clip(of_a, a), clip(of_b, b));
            for &(number, limit) in &rising[..count] {
                united = unite(united, clip(&self.others[number].grades[block], limit));
            }
            sums.add(points, &united);
        }
    }
}

impl<const LABELS: usize> Output<LABELS> {
    /// Tabulates the sets of the labels on `points` even points from `low` to `high` (in the unit of
    /// the output, both ends included). Parts of a set outside the grid are cut off.
    ///
    /// # Errors
    ///
    /// * [`FuzzyError::Membership`] if a set breaks the rules stated at its fields;
    /// * [`FuzzyError::Grid`] unless `low < high`, both are finite and `points` is at least 2;
    /// * [`FuzzyError::NoSupport`] if a label has grade 0 at every point, so that it could never
    ///   have an effect.
    pub fn new(sets: [Membership; LABELS], low: f64, high: f64, points: usize) -> Result<Self, FuzzyError> {
        Ok(Self { stretches: tabulate(&sets, low, high, points)? })
    }

    /// Crisp output: the centroid of the united sets, each clipped at the activation of its label,
    /// in the unit of the output. It lies within the grid to rounding.
    ///
    /// NaN if an activation is NaN or if no label is active (see the [module](self)).
    ///
    /// * `activation`: w_l of every label, 0..=1.
    pub fn centroid(&self, activation: &[f64; LABELS]) -> f64 {
        if contains_nan(activation) {
            return f64::NAN;
        }
        let mut sums = Sums::default();
        for stretch in &self.stretches {
            stretch.add_to(&mut sums, activation);
        }
        sums.centroid()
    }
}

/// The stretches of [`Output::new`].
fn tabulate(sets: &[Membership], low: f64, high: f64, points: usize) -> Result<Vec<Stretch>, FuzzyError> {
    check_sets(sets)?;
    if !(low < high && low.is_finite() && high.is_finite() && points >= 2) {
        return Err(FuzzyError::Grid { low, high, points });
    }
    let points: Vec<f64> = (0..points).map(|i| point(i, points, low, high)).collect();
    if let Some(label) = sets.iter().position(|set| greatest_grade(set, &points) == 0.0) {
        return Err(FuzzyError::NoSupport { label });
    }
    let mut stretches = Vec::new();
    if sets.is_empty() {
        return Ok(stretches);
    }
    let mut rest = &points[..];
    while let Some(block) = rest.chunks(LANES).next() {
        let main = main_labels(sets, block);
        let has_main_labels = |block: &&[f64]| main_labels(sets, block) == main;
        let length = rest.chunks(LANES).take_while(has_main_labels).map(<[f64]>::len).sum();
        let (points, next) = rest.split_at(length);
        stretches.push(Stretch::new(sets, main, points));
        rest = next;
    }
    Ok(stretches)
}

/// The two labels with the greatest grades at `points`, in order of their numbers; twice the same if there is only one.
fn main_labels(sets: &[Membership], points: &[f64]) -> [usize; 2] {
    let sum = |label: usize| points.iter().map(|&y| sets[label].grade(y)).sum::<f64>();
    let (mut first, mut second) = (0, 0);
    for label in 1..sets.len() {
        if sum(label) > sum(first) {
            (first, second) = (label, first);
        } else if second == first || sum(label) > sum(second) {
            second = label;
        }
    }
    [first.min(second), first.max(second)]
}

fn greatest_grade(set: &Membership, points: &[f64]) -> f64 {
    points.iter().fold(0.0, |grade, &y| greatest(grade, set.grade(y)))
}

fn least_grade(set: &Membership, points: &[f64]) -> f64 {
    points.iter().fold(1.0, |grade, &y| least(grade, set.grade(y)))
}

/// Grade at each point.
fn grades(set: &Membership, points: &[f64]) -> Vec<Block> {
    let block = |points: &[f64]| std::array::from_fn(|lane| points.get(lane).map_or(0.0, |&y| set.grade(y)));
    points.chunks(LANES).map(block).collect()
}

/// Error in the definition of a fuzzy system.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FuzzyError {
    /// A fuzzy set has invalid parameters.
    Membership {
        /// Number of the label, from 0.
        index: usize,
        /// The set.
        set: Membership,
        /// Rule that the set breaks.
        requirement: &'static str,
    },
    /// A rule table or label map names a label that does not exist.
    Label {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        column: usize,
        /// The entry.
        label: usize,
        /// Number of labels.
        labels: usize,
    },
    /// The grid of the output is empty or not finite.
    Grid {
        /// First point.
        low: f64,
        /// Last point.
        high: f64,
        /// Number of points.
        points: usize,
    },
    /// An output label has grade 0 at every grid point.
    NoSupport {
        /// Number of the label, from 0.
        label: usize,
    },
}

impl fmt::Display for FuzzyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Membership { index, set, requirement } => {
                write!(f, "fuzzy set of label {index} ({set:?}): {requirement}")
            }
            Self::Label { row, column, label, labels } => write!(
                f,
                "fuzzy rule in row {row}, column {column}: label {label} does not exist, expected 0 to {}",
                labels.saturating_sub(1)
            ),
            Self::Grid { low, high, points } => write!(
                f,
                "fuzzy output grid of {points} points from {low} to {high}: expected at least 2 points and finite ends, the first below the last"
            ),
            Self::NoSupport { label } => write!(
                f,
                "fuzzy output label {label}: grade 0 at every grid point, expected a set that covers at least one"
            ),
        }
    }
}

impl std::error::Error for FuzzyError {}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Coordination of the rescue vehicle (Chen et al., Mathematics 2022, 10, 3562, Tables 2 and 3):
    /// inputs steering angle in deg and speed in km/h, output weights of the two suspension laws.
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

    /// Check values of the model specification of the rescue vehicle (section "coordination"), made
    /// by an independent implementation; 9 digits printed, hence 1e-9.
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

    /// The first output of a fuzzy PID with 7 x 7 rules, triangles as output sets and 121 points,
    /// and a system with one input (k1 from k2): check values of the model specification of the heavy
    /// vehicle, made by an independent implementation; 8 digits printed, hence 1e-8.
    #[test]
    fn other_systems_match_their_check_values() {
        // NB = 0 occurs in neither table.
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
        // One standard deviation; the reference is the same function, hence one rounding.
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
            // exp(-ln 2) with a few roundings in the width.
            assert!((sets[1].grade(halfway) - 0.5).abs() < 1e-15);
            assert!((sets[2].grade(halfway) - 0.5).abs() < 1e-15);
        }
        // Width in the specification of the rescue vehicle, cut after 6 digits.
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

    /// One fully active triangle: the centroid is its peak. Tolerance: rounding of a sum of 101
    /// terms below 1.
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

        // An input between the sets fires nothing.
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
        // One set has no spacing.
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

    /// The centroid by the definition of the module: every label at every point.
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

    /// A set whose center lies between -3 and 3, wide enough for a grid of 8 points.
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

    /// Activations of any size, among them 0 and equal ones.
    fn activation() -> impl Strategy<Value = f64> {
        prop_oneof![Just(0.0), Just(0.5), 0.0..1.0, (0.0..200.0).prop_map(|digits: f64| 10.0_f64.powf(-digits))]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        /// Whatever the sets, the labels that are left out make no difference. Tolerance: the same terms in
        /// another order. A sum of n terms has a relative error of n 1.1e-16, so two centroids differ by at most
        /// 4 n 1.1e-16 of the greatest point: 2.7e-13 with 200 points up to 3.
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

        /// The output sets of the controllers: 7 labels, on 101, 121 and 201 points. Tolerance as above.
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
        /// Weights stay inside the output range and depend on the size of the angle only.
        #[test]
        fn coordination_is_bounded_and_even(degrees in -60.0..60.0f64, speed in -10.0..80.0f64) {
            let coordination = Coordination::new();
            let weights = coordination.weights(degrees, speed);
            for weight in weights {
                prop_assert!((0.0..=1.0).contains(&weight));
            }
            prop_assert_eq!(weights, coordination.weights(-degrees, speed));
        }

        /// Mirrored rules give a mirrored output. Tolerance: the two sums run in opposite order.
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
