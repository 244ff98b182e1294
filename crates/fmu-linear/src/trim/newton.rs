//! Newton's method with a line search, and steps of implicit Euler where Newton's method gets stuck.
//!
//! All unknowns and equations are relative to nominal values. Gaussian elimination with complete pivoting finds the
//! unknowns that the equations do not determine. They keep their values.

use super::TOLERANCE;
use super::plant::{Plant, Start};

/// Maximum number of steps of Newton's method.
const NEWTON_STEPS: usize = 60;
const HALVINGS: usize = 25;
const EULER_STEPS: usize = 200;
/// Length of the first step of implicit Euler, s.
const FIRST_STEP: f64 = 1e-2;
/// A pivot that is smaller than this share of the largest one counts as 0.
const SINGULAR: f64 = 1e-12;

/// A row whose elements are all below this share of the largest one consists of rounding errors.
const ROUNDING: f64 = 1e-14;

pub(super) struct Solution {
    /// Largest derivative of a state at rest, relative to its nominal value, 1/s.
    pub(super) residual: f64,
    /// The state that cannot rest: index, derivative, and derivative relative to the nominal value of the state.
    pub(super) restless: Option<(usize, f64, f64)>,
    /// The state whose value is outside the valid range of the model, and the value.
    pub(super) outside: Option<(usize, f64)>,
    /// Indices of states that the equations do not determine.
    pub(super) undetermined: Vec<usize>,
    /// Jacobian of the derivatives of the states that do not drift with respect to these states, column by column.
    pub(super) jacobian: Vec<f64>,
    pub(super) iterations: usize,
}

/// A point, with the derivatives of all states.
#[derive(Clone)]
struct Point {
    x: Vec<f64>,
    inputs: Vec<f64>,
    rates: Vec<f64>,
    norm: f64,
}

/// System of equations: the states and inputs that are sought, and the derivatives that vanish.
struct System<'p, 'a> {
    plant: &'p mut Plant<'a>,
    /// Nominal values of the states, then of the groups of inputs.
    nominal: Vec<f64>,
    /// States whose derivatives vanish.
    equations: Vec<usize>,
    /// Indices of states, and of groups of inputs, which follow all states.
    unknowns: Vec<usize>,
    states: usize,
    iterations: usize,
}

/// Finds the steady state nearest to the point of the plant, and leaves the plant there.
pub(super) fn solve(plant: &mut Plant<'_>) -> Result<Solution, String> {
    let states = plant.states();
    let n = states.len();
    let groups = plant.groups();
    let nominal = states.iter().map(|state| state.nominal);
    let rests: Vec<usize> = (0..n).filter(|i| !states[*i].drifts).collect();
    let mut system = System {
        nominal: nominal.chain((0..groups).map(|group| plant.nominal_of_input(group))).collect(),
        // Without a free input, the derivative of a held state is not an equation.
        equations: rests.iter().copied().filter(|i| states[*i].held.is_none() || groups > 0).collect(),
        unknowns: rests
            .iter()
            .copied()
            .filter(|i| states[*i].held.is_none() && states[*i].start != Start::Calculated)
            .chain(n..n + groups)
            .collect(),
        states: n,
        iterations: 0,
        plant,
    };
    let (x, inputs, _) = system.plant.point();
    let start = system.at(&x, &inputs)?;
    let mut end = system.newton(start.clone())?;
    if system.residual(&end) > TOLERANCE || system.outside(&end).is_some() {
        let reached = system.euler(start)?;
        let other = system.newton(reached)?;
        // Prefer the point where the model comes to rest by itself to one outside of its valid range.
        let comes_to_rest = system.residual(&other) <= TOLERANCE && system.outside(&other).is_none();
        if other.norm < end.norm || comes_to_rest {
            end = other;
        }
    }
    let end = system.at(&end.x, &end.inputs)?;
    let undetermined = system.step(&end, None)?.1.into_iter().filter(|unknown| *unknown < n).collect();
    let mut jacobian = Vec::new();
    for j in &rests {
        let column = system.plant.column(*j)?;
        jacobian.extend(rests.iter().map(|i| column[*i]));
    }
    let relative = |i: &usize| (end.rates[*i] / states[*i].nominal).abs();
    let worst = rests.iter().copied().max_by(|i, j| relative(i).total_cmp(&relative(j)));
    let residual = worst.map_or(0.0, |i| relative(&i));
    let outside = system.outside(&end).map(|i| (i, end.x[i]));
    let restless = worst.filter(|_| residual.is_nan() || residual > TOLERANCE).map(|i| (i, end.rates[i], residual));
    Ok(Solution { residual, restless, outside, undetermined, jacobian, iterations: system.iterations })
}

impl System<'_, '_> {
    fn at(&mut self, x: &[f64], inputs: &[f64]) -> Result<Point, String> {
        self.plant.move_to(x, inputs)?;
        let rates = self.plant.derivatives()?;
        let (x, inputs, _) = self.plant.point();
        let norm = self.equations.iter().map(|i| (rates[*i] / self.nominal[*i]).powi(2)).sum::<f64>().sqrt();
        Ok(Point { x, inputs, rates, norm })
    }

    fn residual(&self, point: &Point) -> f64 {
        self.equations.iter().map(|i| (point.rates[*i] / self.nominal[*i]).abs()).fold(0.0, f64::max)
    }

    /// The first state whose value is outside the valid range of the model.
    fn outside(&self, point: &Point) -> Option<usize> {
        let states = self.plant.states();
        (0..self.states).find(|i| !states[*i].has(point.x[*i]))
    }

    /// Moves from a point by a share of a step; `None` if the FMU rejects the point.
    fn moved(&mut self, from: &Point, step: &[f64], share: f64) -> Option<Point> {
        let (mut x, mut inputs) = (from.x.clone(), from.inputs.clone());
        for (unknown, change) in self.unknowns.iter().zip(step) {
            let change = share * change * self.nominal[*unknown];
            match unknown.checked_sub(self.states) {
                None => x[*unknown] += change,
                Some(group) => inputs[group] += change,
            }
        }
        let point = self.at(&x, &inputs).ok()?;
        point.norm.is_finite().then_some(point)
    }

    /// Computes the step from the plant's current point, relative to the nominal values. This is a step of Newton's
    /// method or, with `euler`, a step of implicit Euler with this length, s. Also returns the unknowns that the
    /// equations do not determine.
    fn step(&mut self, from: &Point, euler: Option<f64>) -> Result<(Vec<f64>, Vec<usize>), String> {
        let (rows, columns) = (self.equations.len(), self.unknowns.len());
        let mut matrix = vec![vec![0.0; columns + 1]; rows];
        for (j, unknown) in self.unknowns.iter().enumerate() {
            let column = self.plant.column(*unknown)?;
            for (row, i) in matrix.iter_mut().zip(&self.equations) {
                row[j] = -column[*i] * self.nominal[*unknown] / self.nominal[*i];
                if let Some(length) = euler.filter(|_| unknown == i) {
                    row[j] += 1.0 / length;
                }
            }
        }
        for (row, i) in matrix.iter_mut().zip(&self.equations) {
            row[columns] = from.rates[*i] / self.nominal[*i];
        }
        let (step, open) = eliminate(matrix, columns);
        Ok((step, open.into_iter().map(|j| self.unknowns[j]).collect()))
    }

    /// Newton's method with a line search, until only rounding errors are left.
    fn newton(&mut self, from: Point) -> Result<Point, String> {
        let mut best = from;
        for _ in 0..NEWTON_STEPS {
            if best.norm == 0.0 {
                break;
            }
            let here = self.at(&best.x, &best.inputs)?;
            let (step, _) = self.step(&here, None)?;
            self.iterations += 1;
            let mut share = 1.0;
            let mut next = None;
            for _ in 0..HALVINGS {
                next = self.moved(&here, &step, share).filter(|point| point.norm < (1.0 - 1e-4 * share) * here.norm);
                if next.is_some() {
                    break;
                }
                share *= 0.5;
            }
            let Some(next) = next else { break };
            let is_slow = next.norm > 0.5 * best.norm;
            best = next;
            if is_slow && self.residual(&best) <= TOLERANCE {
                break;
            }
        }
        Ok(best)
    }

    /// Implicit Euler with steps that grow while the derivatives decrease. It ends where the plant comes to rest by
    /// itself.
    fn euler(&mut self, from: Point) -> Result<Point, String> {
        let mut best = from;
        let mut length = FIRST_STEP;
        for _ in 0..EULER_STEPS {
            let here = self.at(&best.x, &best.inputs)?;
            let (step, _) = self.step(&here, Some(length))?;
            self.iterations += 1;
            match self.moved(&here, &step, 1.0).filter(|point| point.norm <= 2.0 * here.norm) {
                None => length *= 0.25,
                Some(next) => {
                    length *= (here.norm / next.norm).clamp(1.0, 4.0) * 1.2;
                    best = next;
                }
            }
            if best.norm <= 1e-6 || length < 1e-9 {
                break;
            }
        }
        Ok(best)
    }
}

/// Solves linear equations with the right sides in the last column. Returns the solution, with 0 for undetermined
/// unknowns, and the indices of these unknowns.
fn eliminate(mut matrix: Vec<Vec<f64>>, columns: usize) -> (Vec<f64>, Vec<usize>) {
    let rows = matrix.len();
    let largest = |row: &Vec<f64>| row[..columns].iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let of_all = matrix.iter().map(largest).fold(0.0, f64::max);
    for row in &mut matrix {
        let of_row = largest(row);
        if of_row <= ROUNDING * of_all {
            row[..columns].fill(0.0);
        } else if of_row.is_finite() {
            row.iter_mut().for_each(|value| *value /= of_row);
        }
    }
    let mut open: Vec<usize> = (0..columns).collect();
    let mut pivots: Vec<usize> = Vec::new();
    let mut first = 0.0;
    for k in 0..rows.min(columns) {
        let mut found = (0.0, 0, 0);
        for (i, row) in matrix.iter().enumerate().skip(k) {
            for j in &open {
                if row[*j].abs() > found.0 {
                    found = (row[*j].abs(), i, *j);
                }
            }
        }
        let (size, i, j) = found;
        if k == 0 {
            first = size;
        }
        if size <= SINGULAR * first {
            break;
        }
        matrix.swap(k, i);
        open.retain(|column| *column != j);
        pivots.push(j);
        let (above, below) = matrix.split_at_mut(k + 1);
        let pivot = &above[k];
        for row in below {
            let factor = row[j] / pivot[j];
            if factor != 0.0 {
                for (value, of_pivot) in row.iter_mut().zip(pivot) {
                    *value -= factor * of_pivot;
                }
                row[j] = 0.0;
            }
        }
    }
    let mut solution = vec![0.0; columns];
    for (k, j) in pivots.iter().enumerate().rev() {
        let row = &matrix[k];
        let known: f64 = pivots[k + 1..].iter().map(|later| row[*later] * solution[*later]).sum();
        solution[*j] = (row[columns] - known) / row[*j];
    }
    (solution, open)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: the solution from which the right sides are computed. The tolerance of 1e-14 allows for rounding.
    #[test]
    fn linear_equations_are_solved() {
        let expected = [3.0, -2.0, 0.5];
        let rows = [[1e-3, 2.0, -1.0], [4e6, 1e6, 3e6], [0.0, 0.0, 7.0]];
        let with_right_side = |row: &[f64; 3]| {
            let right: f64 = row.iter().zip(expected).map(|(a, x)| a * x).sum();
            [&row[..], &[right]].concat()
        };
        let (solution, open) = eliminate(rows.iter().map(with_right_side).collect(), 3);
        for (found, expected) in solution.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-14, "{solution:?}");
        }
        assert!(open.is_empty(), "{open:?}");
    }

    /// x + y = 3 and twice the same equation leave an unknown undetermined; z is in no equation.
    #[test]
    fn unknowns_without_an_equation_stay() {
        let (solution, open) = eliminate(vec![vec![1.0, 1.0, 0.0, 3.0], vec![2.0, 2.0, 0.0, 6.0]], 3);
        assert_eq!(solution.iter().sum::<f64>(), 3.0);
        assert_eq!(open.len(), 2);
        assert!(open.contains(&2));
        assert_eq!(eliminate(Vec::new(), 2), (vec![0.0, 0.0], vec![0, 1]));
    }
}
