//! Combinations of the values of several variables.

/// The values of an Integer are not tried if there are more of them than this.
pub(crate) const MOST_VALUES: usize = 64;

/// If there are more combinations than this, [`combinations`] changes only one variable at a time.
pub(crate) const MOST_COMBINATIONS: usize = 4096;

/// Returns combinations of values to try. `sizes` contains the number of values of each variable. A combination
/// contains the index of each variable's value, or `None` for an unchanged variable. The first combination leaves all
/// variables unchanged. The other combinations give every variable a value; the first variable changes fastest. If
/// there would be more than [`MOST_COMBINATIONS`] of these, each of them instead gives a value to only one variable and
/// leaves the rest unchanged.
pub(crate) fn combinations(sizes: &[usize]) -> Vec<Vec<Option<usize>>> {
    let mut tried = vec![vec![None; sizes.len()]];
    if are_few(sizes) {
        let all: usize = sizes.iter().product();
        tried.extend((0..all).map(|mut number| {
            let digit = |&size: &usize| {
                let value = number % size;
                number /= size;
                Some(value)
            };
            sizes.iter().map(digit).collect()
        }));
    } else {
        for (at, &size) in sizes.iter().enumerate() {
            tried.extend((0..size).map(|value| {
                let mut one = vec![None; sizes.len()];
                one[at] = Some(value);
                one
            }));
        }
    }
    tried
}

/// Returns true if [`combinations`] contains every combination.
pub(crate) fn are_few(sizes: &[usize]) -> bool {
    let all = sizes.iter().try_fold(1_usize, |all, &size| all.checked_mul(size));
    all.is_some_and(|all| all <= MOST_COMBINATIONS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_values_are_tried_in_all_combinations() {
        let tried = combinations(&[2, 3]);
        assert_eq!(tried[0], [None, None]);
        let mut rest = tried[1..].to_vec();
        rest.sort();
        let expected: Vec<_> = (0..2).flat_map(|a| (0..3).map(move |b| vec![Some(a), Some(b)])).collect();
        assert_eq!(rest, expected);
        assert_eq!(combinations(&[]), [vec![], vec![]]);
    }

    #[test]
    fn many_values_are_tried_one_by_one() {
        let tried = combinations(&[2; 13]);
        assert!(!are_few(&[2; 13]));
        assert_eq!(tried.len(), 1 + 26);
        assert!(tried[1..].iter().all(|one| one.iter().flatten().count() == 1));
    }
}
