//! The output of a system: from the activation of labels to a number.

use super::error::FuzzyError;
use super::membership::{Membership, point};
use super::numbers::{contains_nan, greatest, least};
use super::partition::check_sets;

/// Number of grid points that are evaluated together.
const LANES: usize = 4;

/// Numbers at neighboring grid points; zeros beyond the end of the grid.
type Block = [f64; LANES];

/// The output of the inference: its labels as fuzzy sets, tabulated on an evenly spaced grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Output<const LABELS: usize> {
    stretches: Vec<Stretch>,
}

/// Neighboring grid points with the same two main labels: the labels with the largest grades.
///
/// Other labels are evaluated only if they can exceed the main labels, which is rare if a main label is active.
#[derive(Clone, Debug, PartialEq)]
struct Stretch {
    main: [usize; 2],
    /// Smallest grade of each main label.
    least: [f64; 2],
    /// Largest grade of the other labels.
    greatest: f64,
    /// Grid points, and the grades of both main labels at these points.
    blocks: Vec<[Block; 3]>,
    /// The other labels with a grade above 0.
    others: Vec<Other>,
}

/// A label that is not among the main ones of a stretch.
#[derive(Clone, Debug, PartialEq)]
struct Other {
    label: usize,
    /// Largest grade in the stretch.
    greatest: f64,
    grades: Vec<Block>,
}

/// Sums over grid points, one per lane, so that additions do not depend on each other.
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
        // The main labels alone reach this grade at every point.
        let floor = greatest(least(a, self.least[0]), least(b, self.least[1]));
        if self.greatest <= floor {
            for [points, of_a, of_b] in &self.blocks {
                sums.add(points, &unite(clip(of_a, a), clip(of_b, b)));
            }
        } else {
            self.add_all_to(sums, activation, floor);
        }
    }

    /// Does the same as `add_to` if labels other than the main labels can exceed `floor`.
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
    /// Tabulates the sets of the labels at `points` evenly spaced points from `low` to `high` (in the unit of the
    /// output, both ends included). Parts of a set outside the grid are cut off.
    ///
    /// # Errors
    ///
    /// * [`FuzzyError::Membership`] if a set breaks the rules stated at its fields;
    /// * [`FuzzyError::Grid`] unless `low < high`, both are finite and `points` is at least 2;
    /// * [`FuzzyError::NoSupport`] if a label has grade 0 at every point and could never have an effect.
    pub fn new(sets: [Membership; LABELS], low: f64, high: f64, points: usize) -> Result<Self, FuzzyError> {
        Ok(Self { stretches: tabulate(&sets, low, high, points)? })
    }

    /// Crisp output: the centroid of the united sets, each clipped at the activation of its label, in the unit of the
    /// output. Up to rounding, it is within the grid.
    ///
    /// NaN if an activation is NaN or if no label is active (see the [module](super)).
    ///
    /// * `activation`: activation of every label, 0..=1.
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

/// The two labels with the largest grades at `points`, in ascending order. If there is only one label, it is repeated.
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
