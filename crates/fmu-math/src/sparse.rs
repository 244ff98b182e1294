//! Sparse matrices: LU factors, and groups of columns for computing Jacobians.
//!
//! Everything is deterministic: the structure of a matrix determines the order of elimination, and the smaller index
//! wins ties.

use alloc::collections::BTreeSet;
use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

const NONE: u32 = u32::MAX;

/// A diagonal element becomes the pivot if it is at least this fraction of the largest candidate.
const DIAGONAL_PREFERENCE: f64 = 1e-3;

/// The structure of a sparse matrix: for each line, the positions of the elements that can differ from zero, in
/// ascending order. Lines are rows or columns; the caller decides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Structure {
    starts: Vec<u32>,
    positions: Vec<u32>,
}

impl Default for Structure {
    fn default() -> Self {
        Self { starts: vec![0], positions: Vec::new() }
    }
}

impl Structure {
    /// Appends a line. The positions can be in any order and contain duplicates.
    ///
    /// # Panics
    /// If there are 2^32 or more elements.
    pub fn push(&mut self, line: impl IntoIterator<Item = u32>) {
        let first = self.positions.len();
        self.positions.extend(line);
        self.positions[first..].sort_unstable();
        let mut kept = first;
        for at in first..self.positions.len() {
            if at == first || self.positions[at] != self.positions[kept - 1] {
                self.positions[kept] = self.positions[at];
                kept += 1;
            }
        }
        self.positions.truncate(kept);
        self.starts.push(u32::try_from(kept).expect("fewer than 2^32 elements"));
    }

    /// Number of lines.
    #[must_use]
    pub fn lines(&self) -> usize {
        self.starts.len() - 1
    }

    /// Number of elements.
    #[must_use]
    pub fn elements(&self) -> usize {
        self.positions.len()
    }

    /// The indices of a line's elements among all elements.
    ///
    /// # Panics
    /// If there is no such line.
    #[must_use]
    pub fn range(&self, line: usize) -> Range<usize> {
        self.starts[line] as usize..self.starts[line + 1] as usize
    }

    /// The positions of a line.
    ///
    /// # Panics
    /// If there is no such line.
    #[must_use]
    pub fn line(&self, line: usize) -> &[u32] {
        &self.positions[self.range(line)]
    }

    /// The same matrix, with rows as lines instead of columns or vice versa; `count` is the number of new lines.
    ///
    /// # Panics
    /// If a position is not below `count`.
    #[must_use]
    pub fn transposed(&self, count: usize) -> Self {
        let mut starts = vec![0_u32; count + 1];
        self.positions.iter().for_each(|&position| starts[position as usize + 1] += 1);
        for i in 0..count {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut positions = vec![0; self.positions.len()];
        for line in 0..self.lines() {
            for &position in self.line(line) {
                let at = &mut next[position as usize];
                positions[*at as usize] = line as u32;
                *at += 1;
            }
        }
        Self { starts, positions }
    }
}

/// Groups the columns of a matrix, given by its rows, so that no row has elements in two columns of a group (Curtis,
/// Powell, Reid 1974). One directional derivative then gives all columns of a group. Each column joins the first group
/// into which it fits.
///
/// # Panics
/// If a position is not below `columns`.
#[must_use]
pub fn groups(rows: &Structure, columns: usize) -> Structure {
    let by_column = rows.transposed(columns);
    let mut group_of = vec![NONE; columns];
    // For each group, the last column that does not fit into it.
    let mut excluded: Vec<u32> = Vec::new();
    let mut members: Vec<Vec<u32>> = Vec::new();
    for column in 0..columns {
        let stamp = column as u32;
        for &row in by_column.line(column) {
            for &other in rows.line(row as usize) {
                if let Some(mark) = excluded.get_mut(group_of[other as usize] as usize) {
                    *mark = stamp;
                }
            }
        }
        let group = excluded.iter().position(|&mark| mark != stamp).unwrap_or(excluded.len());
        if group == excluded.len() {
            excluded.push(NONE);
            members.push(Vec::new());
        }
        group_of[column] = group as u32;
        members[group].push(stamp);
    }
    let mut groups = Structure::default();
    members.into_iter().for_each(|members| groups.push(members));
    groups
}

/// Order of elimination for a matrix with the structure of A + A^T that keeps the factors sparse: an unknown with the
/// fewest neighbors is next (minimum degree, Rose 1972). Returns the order and the number of elements below the
/// diagonal of the factor; `None` if there are more than `limit`.
fn minimum_degree(by_column: &Structure, limit: usize) -> Option<(Vec<u32>, usize)> {
    let n = by_column.lines();
    let by_row = by_column.transposed(n);
    let mut neighbors: Vec<Vec<u32>> = (0..n)
        .map(|i| {
            let mut all: Vec<u32> = by_column.line(i).iter().chain(by_row.line(i)).copied().collect();
            all.sort_unstable();
            all.dedup();
            all.retain(|&other| other != i as u32);
            all
        })
        .collect();
    let mut queue: BTreeSet<(u32, u32)> = (0..n).map(|i| (neighbors[i].len() as u32, i as u32)).collect();
    let mut order = Vec::with_capacity(n);
    let mut elements = 0;
    while let Some((degree, next)) = queue.pop_first() {
        order.push(next);
        elements += degree as usize;
        if elements > limit {
            return None;
        }
        let rest = queue.len();
        if degree as usize == rest {
            // All remaining unknowns are neighbors of each other, so their order does not matter.
            order.extend(queue.iter().map(|&(_, node)| node));
            elements += rest * rest.saturating_sub(1) / 2;
            return (elements <= limit).then_some((order, elements));
        }
        let clique = core::mem::take(&mut neighbors[next as usize]);
        for &member in &clique {
            let own = &mut neighbors[member as usize];
            queue.remove(&(own.len() as u32, member));
            own.extend(clique.iter().filter(|&&other| other != member));
            own.sort_unstable();
            own.dedup();
            own.retain(|&other| other != next);
            queue.insert((own.len() as u32, member));
        }
    }
    Some((order, elements))
}

/// A triangular factor by columns, with room for a fixed number of elements.
#[derive(Clone, Debug, Default)]
struct Factor {
    /// Maximum number of elements. The capacity of the lists cannot be used for this, because a clone does not keep it.
    room: usize,
    starts: Vec<u32>,
    /// In L, rows of the matrix; in U, indices of pivots.
    positions: Vec<u32>,
    values: Vec<f64>,
}

impl Factor {
    fn with_capacity(columns: usize, elements: usize) -> Self {
        Self {
            room: elements,
            starts: Vec::with_capacity(columns + 1),
            positions: Vec::with_capacity(elements),
            values: Vec::with_capacity(elements),
        }
    }

    fn clear(&mut self) {
        self.starts.clear();
        self.starts.push(0);
        self.positions.clear();
        self.values.clear();
    }

    /// Appends an element to the last column; false if there is no room.
    fn push(&mut self, position: u32, value: f64) -> bool {
        let has_room = self.positions.len() < self.room;
        if has_room {
            self.positions.push(position);
            self.values.push(value);
        }
        has_room
    }

    fn end_column(&mut self) {
        self.starts.push(self.positions.len() as u32);
    }

    fn range(&self, column: usize) -> Range<usize> {
        self.starts[column] as usize..self.starts[column + 1] as usize
    }
}

/// LU factors of a sparse matrix: columns in minimum degree order, row exchanges only if a diagonal element is too
/// small (Gilbert, Peierls 1988). [`SparseLu::new`] allocates all memory.
#[derive(Clone, Debug)]
pub struct SparseLu {
    order: Vec<u32>,
    lower: Factor,
    upper: Factor,
    diagonal: Vec<f64>,
    /// Row of each pivot, and the pivot of each row.
    pivots: Vec<u32>,
    pivot_of: Vec<u32>,
    /// The values of the current column, indexed by row. After a column is finished, all values are reset to zero.
    column: Vec<f64>,
    /// The column for which a row was last visited.
    visited: Vec<u32>,
    /// The rows with nonzero elements in the current column, in topological order at the end of the list.
    reached: Vec<u32>,
    /// Rows on the search path, and the next element to follow from each.
    path: Vec<(u32, u32)>,
}

impl SparseLu {
    /// Prepares factors for square matrices with a structure given by columns. `None` if the factors would have more
    /// than `limit` elements below the diagonal; use a dense matrix in this case.
    ///
    /// # Panics
    /// If a position is not below the number of columns.
    #[must_use]
    pub fn new(by_column: &Structure, limit: usize) -> Option<Self> {
        let n = by_column.lines();
        let (order, elements) = minimum_degree(by_column, limit)?;
        // Row exchanges need more elements than the elimination order predicts.
        let room = 3 * elements + 8 * n;
        Some(Self {
            order,
            lower: Factor::with_capacity(n, room),
            upper: Factor::with_capacity(n, room),
            diagonal: vec![0.0; n],
            pivots: vec![0; n],
            pivot_of: vec![NONE; n],
            column: vec![0.0; n],
            visited: vec![NONE; n],
            reached: vec![0; n],
            path: Vec::with_capacity(n),
        })
    }

    /// Factors a matrix with the structure given to [`SparseLu::new`] and a value for each element. Returns false if
    /// the matrix is singular or not finite, or if row exchanges need more than the allocated memory.
    #[must_use]
    pub fn factorize(&mut self, by_column: &Structure, values: &[f64]) -> bool {
        self.lower.clear();
        self.upper.clear();
        self.pivot_of.fill(NONE);
        self.visited.fill(NONE);
        (0..self.order.len()).all(|k| self.factorize_column(k, by_column, values))
    }

    fn factorize_column(&mut self, k: usize, by_column: &Structure, values: &[f64]) -> bool {
        let number = self.order[k];
        let elements = by_column.range(number as usize);
        let mut first = self.reached.len();
        for &row in by_column.line(number as usize) {
            first = self.search(row, k as u32, first);
        }
        for (&row, &value) in by_column.line(number as usize).iter().zip(&values[elements]) {
            self.column[row as usize] = value;
        }
        // Elimination, in topological order.
        let mut is_whole = true;
        for at in first..self.reached.len() {
            let row = self.reached[at];
            let earlier = self.pivot_of[row as usize];
            if earlier != NONE {
                let value = self.column[row as usize];
                is_whole &= self.upper.push(earlier, value);
                for at in self.lower.range(earlier as usize) {
                    self.column[self.lower.positions[at] as usize] -= self.lower.values[at] * value;
                }
            }
        }
        self.upper.end_column();
        let (mut pivot, mut largest) = (NONE, 0.0);
        for at in first..self.reached.len() {
            let row = self.reached[at];
            if self.pivot_of[row as usize] == NONE {
                let magnitude = self.column[row as usize].abs();
                is_whole &= magnitude.is_finite();
                if magnitude > largest || (magnitude == largest && row < pivot) {
                    (pivot, largest) = (row, magnitude);
                }
            }
        }
        let diagonal = self.column[number as usize].abs();
        if self.pivot_of[number as usize] == NONE && diagonal > 0.0 && diagonal >= DIAGONAL_PREFERENCE * largest {
            pivot = number;
        }
        is_whole &= largest > 0.0;
        if is_whole {
            let value = self.column[pivot as usize];
            self.diagonal[k] = value;
            self.pivots[k] = pivot;
            self.pivot_of[pivot as usize] = k as u32;
            for at in first..self.reached.len() {
                let row = self.reached[at];
                if self.pivot_of[row as usize] == NONE {
                    is_whole &= self.lower.push(row, self.column[row as usize] / value);
                }
            }
        }
        self.lower.end_column();
        for at in first..self.reached.len() {
            self.column[self.reached[at] as usize] = 0.0;
        }
        is_whole
    }

    /// Adds the rows that can be reached from `row` through the columns of L to the front of the list, which begins at
    /// `first`. Returns the new beginning.
    fn search(&mut self, row: u32, stamp: u32, mut first: usize) -> usize {
        let children = |row: u32, pivot_of: &[u32], lower: &Factor| match pivot_of[row as usize] {
            NONE => 0..0,
            pivot => lower.range(pivot as usize),
        };
        if self.visited[row as usize] == stamp {
            return first;
        }
        self.visited[row as usize] = stamp;
        self.path.clear();
        self.path.push((row, children(row, &self.pivot_of, &self.lower).start as u32));
        while let Some(&mut (row, ref mut next)) = self.path.last_mut() {
            if (*next as usize) < children(row, &self.pivot_of, &self.lower).end {
                let child = self.lower.positions[*next as usize];
                *next += 1;
                if self.visited[child as usize] != stamp {
                    self.visited[child as usize] = stamp;
                    self.path.push((child, children(child, &self.pivot_of, &self.lower).start as u32));
                }
            } else {
                self.path.pop();
                first -= 1;
                self.reached[first] = row;
            }
        }
        first
    }

    /// Replaces `b` by the solution of A x = b, where A is the matrix of the last successful [`SparseLu::factorize`].
    ///
    /// # Panics
    /// If `b` is shorter than the matrix.
    pub fn solve(&mut self, b: &mut [f64]) {
        let n = self.order.len();
        // L y = b: y in the order of the pivots.
        for k in 0..n {
            let value = b[self.pivots[k] as usize];
            self.column[k] = value;
            for at in self.lower.range(k) {
                b[self.lower.positions[at] as usize] -= self.lower.values[at] * value;
            }
        }
        for k in (0..n).rev() {
            let value = self.column[k] / self.diagonal[k];
            for at in self.upper.range(k) {
                self.column[self.upper.positions[at] as usize] -= self.upper.values[at] * value;
            }
            b[self.order[k] as usize] = value;
        }
        self.column.fill(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a matrix by columns from elements (row, column, value).
    fn matrix(n: usize, elements: &[(usize, usize, f64)]) -> (Structure, Vec<f64>) {
        let (mut structure, mut values) = (Structure::default(), Vec::new());
        for column in 0..n {
            let mut all: Vec<_> = elements.iter().filter(|one| one.1 == column).collect();
            all.sort_by_key(|one| one.0);
            structure.push(all.iter().map(|one| one.0 as u32));
            values.extend(all.iter().map(|one| one.2));
        }
        (structure, values)
    }

    /// Largest |A x - b| relative to |b|, where b is computed from x = 1, 2, 3, …
    fn residual(n: usize, elements: &[(usize, usize, f64)]) -> f64 {
        let (structure, values) = matrix(n, elements);
        let product = |x: &[f64]| {
            let mut b = vec![0.0; n];
            elements.iter().for_each(|&(row, column, value)| b[row] += value * x[column]);
            b
        };
        let b = product(&(1..=n).map(|i| i as f64).collect::<Vec<_>>());
        let mut lu = SparseLu::new(&structure, n * n).unwrap();
        let mut worst = 0.0_f64;
        // The second time, the memory of the first is reused.
        for _ in 0..2 {
            assert!(lu.factorize(&structure, &values));
            let mut x = b.clone();
            lu.solve(&mut x);
            let size = b.iter().fold(0.0_f64, |size, b| size.max(b.abs()));
            worst = product(&x).iter().zip(&b).fold(worst, |worst, (a, b)| worst.max((a - b).abs() / size));
        }
        worst
    }

    /// Numbers in [-1, 1) from a linear congruential generator.
    fn random(seed: &mut u64) -> f64 {
        *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    #[test]
    fn solutions_satisfy_their_equations() {
        let tridiagonal: Vec<_> =
            (0..50).flat_map(|i| [(i, i, 2.5), (i, (i + 1) % 50, -1.0), ((i + 1) % 50, i, -1.2)]).collect();
        let arrow: Vec<_> =
            (0..50).map(|i| (i, i, 3.0)).chain((1..50).flat_map(|i| [(0, i, 1.0), (i, 0, -0.5)])).collect();
        // Rows must be exchanged, because the diagonal is zero or tiny.
        let exchanged: Vec<_> =
            (0..20).flat_map(|i| [(i, i, if i % 3 == 0 { 1e-14 } else { 0.0 }), (i, (i + 1) % 20, 1.0)]).collect();
        let mut seed = 1;
        let mut scattered: Vec<_> = (0..60).map(|i| (i, i, random(&mut seed))).collect();
        for i in 0..60 {
            for step in [7, 13, 31] {
                scattered.push((i, (i * 3 + step) % 60, 2.0 * random(&mut seed)));
            }
        }
        scattered.sort_by_key(|one| (one.0, one.1));
        scattered.dedup_by_key(|one| (one.0, one.1));
        for (n, elements) in [(50, tridiagonal), (50, arrow), (20, exchanged), (60, scattered)] {
            // Tolerance: several hundred rounding errors.
            let residual = residual(n, &elements);
            assert!(residual < 1e-12, "{n}: {residual}");
        }
    }

    /// The second matrix has a small diagonal, so rows are exchanged, and its factors need more room than the factors
    /// of the first matrix.
    #[test]
    fn a_copy_factors_other_values_as_the_original_does() {
        const N: usize = 60;
        let mut seed = 1;
        let scattered: Vec<_> = (0..N).flat_map(|i| [7, 13, 31].map(|step| (i, (i + step) % N))).collect();
        let mut with_diagonal = |diagonal: f64| {
            let others = scattered.iter().filter(|(row, column)| row != column);
            let others: Vec<_> = others.map(|&(row, column)| (row, column, 2.0 * random(&mut seed))).collect();
            matrix(N, &[(0..N).map(|i| (i, i, diagonal)).collect(), others].concat())
        };
        let [(structure, dominant), (_, exchanged)] = [100.0, 1e-14].map(&mut with_diagonal);
        let mut original = SparseLu::new(&structure, N * N).unwrap();
        assert!(original.factorize(&structure, &dominant));
        let elements = original.lower.positions.len();
        let mut copy = original.clone();
        let solution = |lu: &mut SparseLu| {
            assert!(lu.factorize(&structure, &exchanged));
            assert!(lu.lower.positions.len() > elements);
            let mut b: Vec<_> = (0..N).map(|i| i as f64).collect();
            lu.solve(&mut b);
            b
        };
        assert_eq!(solution(&mut original), solution(&mut copy));
    }

    #[test]
    fn a_singular_matrix_and_one_that_is_not_finite_have_no_factors() {
        for elements in [
            vec![(0, 0, 1.0), (1, 0, 2.0), (0, 1, 2.0), (1, 1, 4.0)],
            vec![(0, 0, 1.0), (0, 1, 2.0)],
            vec![(0, 0, f64::NAN), (1, 1, 1.0)],
            vec![(0, 0, f64::INFINITY), (1, 1, 1.0)],
        ] {
            let (structure, values) = matrix(2, &elements);
            assert!(!SparseLu::new(&structure, 4).unwrap().factorize(&structure, &values), "{elements:?}");
        }
    }

    /// If the ends are eliminated first, the elimination of a chain or a star creates no new elements. A full matrix
    /// has n (n - 1)/2 elements below the diagonal.
    #[test]
    fn the_order_keeps_chains_and_stars_sparse() {
        let chain: Vec<_> = (0..99).flat_map(|i| [(i, i + 1, 1.0), (i + 1, i, 1.0)]).collect();
        let star: Vec<_> = (1..100).flat_map(|i| [(0, i, 1.0), (i, 0, 1.0)]).collect();
        for elements in [chain, star] {
            assert_eq!(minimum_degree(&matrix(100, &elements).0, 99).unwrap().1, 99);
        }
        let full: Vec<_> = (0..20).flat_map(|i| (0..20).map(move |j| (i, j, 1.0))).collect();
        assert_eq!(minimum_degree(&matrix(20, &full).0, 190).unwrap().1, 190);
        assert!(minimum_degree(&matrix(20, &full).0, 189).is_none());
    }

    #[test]
    fn columns_of_a_group_have_no_row_in_common() {
        let mut rows = Structure::default();
        (0..100_u32).for_each(|i| rows.push([i, i.saturating_sub(1), (i + 1).min(99), i]));
        let chain = groups(&rows, 100);
        // A chain needs three groups, each with every third column.
        assert_eq!(chain.lines(), 3);
        for group in 0..3 {
            assert!(chain.line(group).iter().all(|column| column % 3 == group as u32));
        }
        // A full row puts each of its columns into a separate group. Columns without elements join the first group.
        rows.push(0..100);
        assert_eq!(groups(&rows, 102).lines(), 100);
        assert_eq!(groups(&rows, 102).line(0), [0, 100, 101]);
        assert_eq!(groups(&Structure::default(), 0).lines(), 0);
    }
}
