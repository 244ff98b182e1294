//! Adjoint derivatives (FMI 3.0): the transpose of the directional derivatives.

use super::{CheckResult, Report, Trial, derivative_problem, found, is_same_derivative};
use crate::Finding;
use fmu_import::description::{BaseType, Causality, ModelDescription, Variability, Variable};
use fmu_import::loader::Instance;

/// Maximum number of elements that are compared, for the unknowns and for the knowns.
const MOST: usize = 100;

impl Trial<'_> {
    pub(super) fn adjoint(&self, report: Report<'_>) -> CheckResult<()> {
        if !self.unit.provides_adjoint_derivatives {
            return Ok(());
        }
        let mut instance = self.started("adjoint")?;
        self.go(&mut instance, 0..2, 1)?;
        compare(self.description, &mut instance, self.unit.provides_directional_derivative, report);
        Ok(())
    }
}

/// Compares the derivatives of state derivatives and outputs with respect to states and inputs.
pub(super) fn compare(
    description: &ModelDescription,
    instance: &mut Instance,
    has_directional: bool,
    report: Report<'_>,
) {
    let of = |variables: Vec<usize>| -> Vec<&Variable> {
        let mut total = 0;
        let variables = variables.into_iter().map(|i| &description.variables[i]);
        let variables = variables.filter(|variable| {
            variable.base_type == BaseType::Real && variable.variability == Variability::Continuous && variable.size > 0
        });
        variables
            .take_while(|variable| {
                total += variable.size;
                total <= MOST
            })
            .collect()
    };
    let derivatives = description.derivatives.iter().map(|unknown| unknown.variable);
    let outputs = description.outputs.iter().map(|unknown| unknown.variable);
    let states = derivatives.clone().filter_map(|i| description.variables[i].derivative_of);
    let is_input = |i: &usize| description.variables[*i].causality == Causality::Input;
    let inputs = (0..description.variables.len()).filter(is_input);
    let states: Vec<usize> = states.collect();
    let unknowns = of(derivatives.chain(outputs.filter(|i| !states.contains(i))).collect());
    let knowns = of(states.iter().copied().chain(inputs).collect());
    let references = |variables: &[&Variable]| variables.iter().map(|variable| variable.reference).collect::<Vec<_>>();
    let names = |variables: &[&Variable]| variables.iter().flat_map(|v| v.elements()).collect::<Vec<_>>();
    let ((unknown, rows), (known, columns)) =
        ((references(&unknowns), names(&unknowns)), (references(&knowns), names(&knowns)));
    let (m, n) = (rows.len(), columns.len());
    if m == 0 || n == 0 {
        return;
    }
    let mut seed = vec![0.0; m.max(n)];
    let mut adjoint = vec![vec![0.0; n]; m];
    for (i, row) in adjoint.iter_mut().enumerate() {
        seed.fill(0.0);
        seed[i] = 1.0;
        if let Err(error) = instance.get_adjoint_derivative(&unknown, &known, &seed[..m], row) {
            return found(report, derivative_problem("providesAdjointDerivatives", &error));
        }
    }
    for j in (0..n).filter(|_| has_directional) {
        seed.fill(0.0);
        seed[j] = 1.0;
        let mut column = vec![0.0; m];
        // The trial of the capabilities reports this error.
        if instance.get_directional_derivative(&unknown, &known, &seed[..n], &mut column).is_err() {
            return;
        }
        for i in 0..m {
            let (a, b) = (column[i], adjoint[i][j]);
            if !is_same_derivative(a, b) {
                let message = format!(
                    "is not the transpose of fmi3GetDirectionalDerivative: d(`{}`)/d(`{}`) is {b}, the directional derivative is {a}",
                    rows[i], columns[j]
                );
                return found(report, Finding::error("fmi3GetAdjointDerivative", message));
            }
        }
    }
}
