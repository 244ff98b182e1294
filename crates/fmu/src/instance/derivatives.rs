//! Derivatives of the equations, exact by dual numbers.

use super::{CallError, CallResult, Instance, Mode};
use crate::calls::{Function, Version};
use crate::runner::{Kind as ModelKind, Model};

/// A variable whose derivative is asked for.
#[derive(Clone, Copy)]
enum Unknown {
    /// Position among the outputs and state derivatives.
    Computed(usize),
    /// An output that is a state: position among the inputs and states.
    State(usize),
}

impl Unknown {
    /// Its derivative, of those along a direction.
    fn of(self, direction: &[f64], slopes: &[f64]) -> f64 {
        match self {
            Self::Computed(position) => slopes[position],
            Self::State(position) => direction[position],
        }
    }
}

impl<M: Model> Instance<M> {
    /// fmi2GetDirectionalDerivative.
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
        let function = Function::GetDirectionalDerivative;
        self.check(function)?;
        let knowns = self.knowns(function, known)?;
        let unknowns = self.unknowns(function, unknown)?;
        let mut direction = self.direction();
        for ((&position, &slope), &reference) in knowns.iter().zip(seed).zip(known) {
            self.check_seed(function, reference, slope)?;
            direction[position] += slope;
        }
        let slopes = self.slopes(&direction)?;
        let of = |unknown: &Unknown| unknown.of(&direction, &slopes);
        if let Some(at) = unknowns.iter().position(|unknown| !of(unknown).is_finite()) {
            return Err(self.no_derivative(function, "of", unknown[at]));
        }
        for (value, unknown) in result.iter_mut().zip(&unknowns) {
            *value = of(unknown);
        }
        Ok(())
    }

    /// fmi3GetAdjointDerivative: the transposed matrix of derivatives times the seed, column by column.
    ///
    /// # Errors
    /// As [`Self::directional_derivative`].
    pub fn adjoint_derivative(
        &mut self,
        unknown: &[u32],
        known: &[u32],
        seed: &[f64],
        result: &mut [f64],
    ) -> CallResult {
        let function = Function::GetAdjointDerivative;
        self.check(function)?;
        let knowns = self.knowns(function, known)?;
        let unknowns = self.unknowns(function, unknown)?;
        for (&reference, &slope) in unknown.iter().zip(seed) {
            self.check_seed(function, reference, slope)?;
        }
        let mut products = vec![0.0; knowns.len()];
        for ((product, &position), &reference) in products.iter_mut().zip(&knowns).zip(known) {
            let mut direction = self.direction();
            direction[position] = 1.0;
            let slopes = self.slopes(&direction)?;
            *product = unknowns.iter().zip(seed).map(|(unknown, seed)| seed * unknown.of(&direction, &slopes)).sum();
            if !product.is_finite() {
                return Err(self.no_derivative(function, "with respect to", reference));
            }
        }
        result.copy_from_slice(&products);
        Ok(())
    }

    /// A direction of zeros: real inputs, states and the time.
    fn direction(&self) -> Vec<f64> {
        vec![0.0; self.layout().inputs.counts.reals + self.layout().states.counts.reals + 1]
    }

    /// Derivatives of the outputs, then of the state derivatives, along a direction.
    fn slopes(&mut self, direction: &[f64]) -> CallResult<Vec<f64>> {
        let derived = self.derive()?;
        let layout = &self.description.layout;
        let mut slopes = vec![0.0; layout.outputs.counts.reals + layout.states.counts.reals];
        let memory = self.memory.as_mut().expect("made with the derived parameters");
        let (p, values, time) = (&self.parameters, &self.values, self.clock.time);
        let is_frozen = self.mode == Mode::ContinuousTime;
        M::directional(p, &derived, memory, layout, values, time, is_frozen, direction, &mut slopes);
        Ok(slopes)
    }

    /// Positions of inputs and states in a direction.
    fn knowns(&self, function: Function, references: &[u32]) -> CallResult<Vec<usize>> {
        if M::KIND != ModelKind::Continuous {
            return Err(self.error(function, "not provided: only continuous-time models have derivatives"));
        }
        let (inputs, states) = (self.layout().inputs.reals(), self.layout().states.reals());
        let position = |&reference: &u32| {
            let index = reference as usize;
            if inputs.contains(&index) {
                Ok(index - inputs.start)
            } else if states.contains(&index) {
                Ok(inputs.len() + index - states.start)
            } else if reference == self.layout().end && self.protocol.version == Version::Fmi3 {
                Ok(inputs.len() + states.len())
            } else {
                let message = format_args!("value reference {reference} is neither a real input nor a state (known)");
                Err(self.error(function, message))
            }
        };
        references.iter().map(position).collect()
    }

    fn unknowns(&self, function: Function, references: &[u32]) -> CallResult<Vec<Unknown>> {
        let layout = self.layout();
        let (inputs, states) = (layout.inputs.reals(), layout.states.reals());
        let (outputs, derivatives) = (layout.outputs.reals(), layout.derivatives.reals());
        let unknown = |&reference: &u32| {
            let index = reference as usize;
            if outputs.contains(&index) {
                Ok(Unknown::Computed(index - outputs.start))
            } else if derivatives.contains(&index) {
                Ok(Unknown::Computed(outputs.len() + index - derivatives.start))
            } else if states.contains(&index) {
                Ok(Unknown::State(inputs.len() + index - states.start))
            } else {
                let message = format_args!(
                    "value reference {reference} is neither a real output nor the derivative of a state (unknown)"
                );
                Err(self.error(function, message))
            }
        };
        references.iter().map(unknown).collect()
    }

    fn check_seed(&self, function: Function, reference: u32, slope: f64) -> CallResult {
        if slope.is_finite() {
            return Ok(());
        }
        let name = self.name_of(reference);
        Err(self.error(function, format_args!("seed of '{name}' must be finite, got {slope}")))
    }

    /// Name of a variable, or of the time.
    fn name_of(&self, reference: u32) -> &str {
        self.layout().by_reference(reference).map_or("time", |variable| &variable.declaration.name)
    }

    fn no_derivative(&self, function: Function, preposition: &str, reference: u32) -> CallError {
        let name = self.name_of(reference);
        self.error(function, format_args!("the derivative {preposition} '{name}' is not finite at this point"))
    }
}
