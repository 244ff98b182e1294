//! Tests each capability that the description promises with one example.

use super::{CheckResult, Report, Trial, derivative_problem, describe, found};
use crate::Finding;
use fmu_import::description::{BaseType, Causality, Unknown, Variability};

impl Trial<'_> {
    /// Tests the capabilities that the description declares, except saved states, which have a separate trial.
    pub(super) fn capabilities(&self, report: Report<'_>) -> CheckResult<()> {
        let unit = self.unit;
        let mut promise = |attribute: &str, result: CheckResult<()>| {
            if let Err(error) = result {
                let message = format!("is promised, but {}", describe(&error));
                found(report, Finding::error(attribute, message));
            }
        };
        if unit.can_handle_variable_communication_step_size {
            let result = self.started("parts").and_then(|mut instance| {
                self.go(&mut instance, 0..2, 1)?;
                self.go(&mut instance, 2..4, 2).map(drop)
            });
            promise("canHandleVariableCommunicationStepSize", result);
        }
        // Only continuous variables have derivatives.
        let continuous = |i: &&usize| self.variable(**i).variability != Variability::Discrete;
        let inputs: Vec<_> = self.inputs.iter().filter(continuous).copied().collect();
        if unit.can_interpolate_inputs && !inputs.is_empty() {
            let slopes = vec![1e-3 / self.step; inputs.len()];
            let result = self.started("slope").and_then(|mut instance| {
                self.go(&mut instance, 0..1, 1)?;
                let references = self.references(&inputs);
                instance.set_real_input_derivatives(&references, &vec![1; slopes.len()], &slopes)?;
                instance.do_step(self.start + self.step, self.step)?;
                self.read_outputs(&mut instance, &mut Vec::new())
            });
            promise("canInterpolateInputs", result);
        }
        if let Some(&output) = self.outputs.iter().find(continuous).filter(|_| unit.max_output_derivative_order > 0) {
            let reference = self.references(&[output]);
            let highest = i32::try_from(unit.max_output_derivative_order).unwrap_or(i32::MAX);
            let result = self.started("slope").and_then(|mut instance| {
                self.go(&mut instance, 0..2, 1)?;
                instance.get_real_output_derivatives(&reference, &[1], &mut [0.0])?;
                instance.get_real_output_derivatives(&reference, &[highest], &mut [0.0])
            });
            promise("maxOutputDerivativeOrder", result);
        }
        if unit.provides_directional_derivative
            && let Some(question) = self.question()
        {
            match self.slope(&question) {
                Err(error) => {
                    let attribute = self.function("providesDirectionalDerivative", "providesDirectionalDerivatives");
                    found(report, derivative_problem(attribute, &error));
                }
                Ok(slope) if !slope.is_finite() => {
                    let function = self.function("fmi2GetDirectionalDerivative", "fmi3GetDirectionalDerivative");
                    found(report, Finding::error(function, format!("gives {slope}")));
                }
                Ok(_) => {}
            }
        }
        if unit.can_not_use_memory_management_functions {
            let before = fmu_import::loader::memory_callbacks();
            drop(self.started("memory").and_then(|mut instance| self.go(&mut instance, 0..2, 1)));
            if fmu_import::loader::memory_callbacks() != before {
                let message =
                    "is set, but the FMU calls allocateMemory or freeMemory, which the master need not provide";
                found(report, Finding::error("canNotUseMemoryManagementFunctions", message));
            }
        }
        Ok(())
    }

    /// Returns the directional derivative of an unknown, in Initialization Mode or after two steps.
    pub(super) fn slope(&self, question: &Question) -> CheckResult<f64> {
        let (unknown, known) = (self.references(&[question.unknown]), self.references(&[question.known]));
        let mut slope = [f64::NAN];
        let mut instance = if question.is_initial {
            self.initializing("derivative")?
        } else {
            let mut instance = self.started("derivative")?;
            self.go(&mut instance, 0..2, 1)?;
            instance
        };
        instance.get_directional_derivative(&unknown, &known, &[1.0], &mut slope)?;
        Ok(slope[0])
    }

    /// Returns a directional derivative to request, preferably one that is probably not 0. Otherwise, returns one that
    /// is 0 by the model structure; FMUs must provide it, too (FMI 2.0.4, section 2.1.9). Between steps, the knowns are
    /// inputs and continuous states.
    pub(super) fn question(&self) -> Option<Question> {
        // A discrete Float32 need not be differentiable.
        let is_real = |i: &usize| {
            let variable = self.variable(*i);
            let is_smooth = variable.variability != Variability::Discrete;
            variable.base_type == BaseType::Real && is_smooth && !variable.is_array()
        };
        let real = |list: &[Unknown]| -> Vec<Unknown> {
            list.iter().filter(|unknown| is_real(&unknown.variable)).cloned().collect()
        };
        let listed = |unknown: &Unknown| {
            unknown.dependencies.iter().flatten().copied().find(|i| is_real(i) && *i != unknown.variable)
        };
        let unknowns = [real(&self.description.outputs), real(&self.description.derivatives)].concat();
        let between_steps = |unknown: usize, known: usize| Question { unknown, known, is_initial: false };
        let named = unknowns.iter().find_map(|unknown| Some(between_steps(unknown.variable, listed(unknown)?)));
        named
            .or_else(|| {
                let states =
                    self.description.derivatives.iter().filter_map(|state| self.variable(state.variable).derivative_of);
                let known = self.inputs.iter().copied().chain(states.filter(is_real)).collect::<Vec<_>>();
                unknowns.iter().find_map(|unknown| {
                    let known = known.iter().find(|known| **known != unknown.variable)?;
                    Some(between_steps(unknown.variable, *known))
                })
            })
            .or_else(|| {
                let is_known =
                    |i: &usize| matches!(self.variable(*i).causality, Causality::Parameter | Causality::Input);
                real(&self.description.initial_unknowns).iter().find_map(|unknown| {
                    let known = listed(unknown).filter(is_known)?;
                    Some(Question { unknown: unknown.variable, known, is_initial: true })
                })
            })
    }
}

/// An unknown and a known, in Initialization Mode or between two steps.
pub(super) struct Question {
    unknown: usize,
    known: usize,
    is_initial: bool,
}
