//! Rules: from the grades of inputs to the activation of labels.

use super::error::FuzzyError;
use super::numbers::{contains_nan, greatest, least};

/// Combines the grades of the two inputs of a rule into its strength ("and").
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
    /// Indices of the rules in the flattened table, sorted by label.
    rules: [[usize; COLUMNS]; ROWS],
    /// End of each label's rules in `rules`.
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
    /// * `rows`, `columns`: grades of the labels of the first and the second input.
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

/// Fills `rules` with the indices of the rules, sorted by label, and `ends` with the end of each label in `rules`.
#[inline(never)] // otherwise unrolled for each table size
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

/// A map from `FROM` labels to `TO` labels. It replaces the output labels of a [`RuleTable`], or contains the rules of
/// a system with one input ("if the input is label i, then the output is label `map[i]`").
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
