//! Derivatives of the equations along directions.

use super::{CallError, CallResult, Instance};
use crate::calls::Function;
use crate::runner::{Kind as ModelKind, Model};

impl<M: Model> Instance<M> {
    /// fmi2GetDirectionalDerivative: exact, by dual numbers.
    ///
    /// # Errors
    /// For a discrete-time model, whose outputs are held; on a reference that is no output or state derivative (unknown) or
    /// no input or state (known), or a seed or result that is not finite.
    pub fn directional_derivative(
        &mut self,
        unknown: &[u32],
        known: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> CallResult {
        self.check(Function::GetDirectionalDerivative)?;
        let name = Function::GetDirectionalDerivative.name(self.protocol.version);
        let rejected = |message: String| Err(CallError::Error(format!("{name}: {message}")));
        if M::KIND != ModelKind::Continuous {
            return rejected("not provided: only continuous-time models have derivatives".to_owned());
        }
        let layout = self.layout();
        let (inputs, states) = (layout.inputs.reals(), layout.states.reals());
        let (outputs, derivatives) = (layout.outputs.reals(), layout.derivatives.reals());
        let mut direction = vec![0.0; inputs.len() + states.len()];
        for (&reference, &slope) in known.iter().zip(seed) {
            let index = reference as usize;
            let position = if inputs.contains(&index) {
                index - inputs.start
            } else if states.contains(&index) {
                inputs.len() + index - states.start
            } else {
                return rejected(format!("value reference {reference} is neither a real input nor a state (known)"));
            };
            if !slope.is_finite() {
                return rejected(format!("seed of '{}' must be finite, got {slope}", layout.real_name(index)));
            }
            direction[position] += slope;
        }
        let mut positions = Vec::with_capacity(unknown.len());
        for &reference in unknown {
            let index = reference as usize;
            positions.push(if outputs.contains(&index) {
                Ok(index - outputs.start)
            } else if derivatives.contains(&index) {
                Ok(outputs.len() + index - derivatives.start)
            } else if states.contains(&index) {
                Err(inputs.len() + index - states.start) // an output that is a state
            } else {
                return rejected(format!(
                    "value reference {reference} is neither a real output nor the derivative of a state (unknown)"
                ));
            });
        }
        let derived = self.derive()?;
        let layout = self.layout();
        let mut slopes = vec![0.0; outputs.len() + states.len()];
        let memory = self.memory.as_ref().expect("made with the derived parameters");
        let time = self.clock.time;
        M::directional(&self.parameters, &derived, memory, layout, &self.values, time, &direction, &mut slopes);
        let slope = |position: &Result<usize, usize>| position.map_or_else(|own| direction[own], |other| slopes[other]);
        if let Some(at) = positions.iter().position(|position| !slope(position).is_finite()) {
            let name = layout.real_name(unknown[at] as usize);
            return rejected(format!("the derivative of '{name}' is not finite at this point"));
        }
        for (value, position) in result.iter_mut().zip(&positions) {
            *value = slope(position);
        }
        Ok(())
    }
}
