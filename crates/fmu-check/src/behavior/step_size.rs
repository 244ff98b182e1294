//! The error of a solver with fixed step size, estimated by comparing results with `max_step` and with half of it.

use super::{CheckResult, Report, Trial, describe, found};
use crate::Finding;
use fmu_import::description::{BaseType, Causality, Value, Variable};

/// Parameter of FMUs that integrate in steps of a fixed size.
const PARAMETER: &str = "max_step";
/// Maximum number of communication steps of the default experiment that are compared.
const MOST_STEPS: f64 = 20_000.0;
/// Difference, relative to the peak of the output, above which the results are unreliable: a tenth of a percent.
const TOLERABLE: f64 = 1e-3;

impl Trial<'_> {
    /// Checks that the default experiment gives the same results with half the integration step.
    pub(super) fn step_size(&self, report: Report<'_>) -> CheckResult<()> {
        let is_parameter = |variable: &&Variable| {
            variable.name == PARAMETER
                && variable.causality == Causality::Parameter
                && variable.base_type == BaseType::Real
        };
        let Some(parameter) = self.description.variables.iter().find(is_parameter) else { return Ok(()) };
        let Some(Value::Real(max_step)) = parameter.start else { return Ok(()) };
        let stop = self.description.default_experiment.stop_time.unwrap_or(self.start + self.step * 1000.0);
        let steps = ((stop - self.start) / self.step).clamp(1.0, MOST_STEPS) as usize;
        let run = |max_step: f64| -> CheckResult<Vec<Vec<f64>>> {
            let mut instance = self.initializing("step size")?;
            instance.set_real(&[parameter.reference], &[max_step])?;
            instance.exit_initialization_mode()?;
            let mut rows = Vec::with_capacity(steps);
            for k in 0..steps {
                self.made.set(self.made.get() + 1);
                instance.do_step(self.start + self.step * k as f64, self.step)?;
                rows.push(self.reals(&mut instance, &self.outputs)?);
            }
            Ok(rows)
        };
        // The step may already have its minimum, so that it cannot be halved. Other failures with half the step prove
        // nothing.
        let Ok(half) = run(0.5 * max_step) else { return Ok(()) };
        let remedy = "use a smaller one, or a solver with error control";
        let whole = match run(max_step) {
            Ok(whole) => whole,
            Err(error) => {
                let message = format!(
                    "the default experiment fails with {max_step} s, but not with half of it; {remedy}: {}",
                    describe(&error)
                );
                found(report, Finding::warning(format!("variable `{PARAMETER}`"), message));
                return Ok(());
            }
        };
        let differences = (0..self.outputs.len()).map(|output| (difference(&whole, &half, output), output));
        if let Some((difference, output)) = differences.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|d| d.0 > TOLERABLE) {
            let name = &self.variable(self.outputs[output]).name;
            let percent = 100.0 * difference;
            let message = format!(
                "in the default experiment `{name}` differs by {percent:.2} % of its peak from a run with half of {max_step} s; {remedy}"
            );
            found(report, Finding::warning(format!("variable `{PARAMETER}`"), message));
        }
        Ok(())
    }
}

/// Greatest difference of a column, relative to its peak; 0 for a column of zeros.
fn difference(a: &[Vec<f64>], b: &[Vec<f64>], column: usize) -> f64 {
    let peak = b.iter().map(|row| row[column].abs()).fold(0.0, f64::max);
    let largest = a.iter().zip(b).map(|(a, b)| (a[column] - b[column]).abs()).fold(0.0, f64::max);
    if largest == 0.0 { 0.0 } else { largest / peak.max(f64::MIN_POSITIVE) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_relative_to_the_peak() {
        let (a, b) = (vec![vec![1.0, 0.0], vec![-4.0, 0.0]], vec![vec![1.5, 0.0], vec![-5.0, 0.0]]);
        assert_eq!(difference(&a, &b, 0), 1.0 / 5.0);
        assert_eq!(difference(&a, &b, 1), 0.0);
    }
}
