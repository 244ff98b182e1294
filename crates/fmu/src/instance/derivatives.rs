//! Derivatives of the equations, computed exactly with dual numbers.

use fmu_math::sparse::{Structure, groups};

use super::{CallError, CallResult, Instance, Mode};
use crate::calls::{Function, Version};
use crate::runner::{Kind as ModelKind, Model, Run};
use crate::variable::{Layout, Variable};

/// A variable whose derivative is requested.
#[derive(Clone, Copy)]
enum Unknown {
    /// Position among the outputs and state derivatives.
    Computed(usize),
    /// An output that is a state: position among the inputs and states.
    State(usize),
}

impl Unknown {
    /// The derivative of this unknown along `direction`; `slopes` contains the derivatives of all computed unknowns.
    fn of(self, direction: &[f64], slopes: &[f64]) -> f64 {
        match self {
            Self::Computed(position) => slopes[position],
            Self::State(position) => direction[position],
        }
    }
}

impl<M: Model> Instance<M> {
    /// fmi2GetDirectionalDerivative. Fails if the model is not continuous-time, if an unknown is not a real output or
    /// state derivative, if a known variable is not a real input or state, or if a seed is not finite. Returns
    /// fmi2Discard if a derivative is not finite, such as the derivative of the square root at 0.
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
            // Find the input or state with respect to which the derivative is not finite.
            for (&position, &reference) in knowns.iter().zip(known).filter(|(position, _)| direction[**position] != 0.0)
            {
                let mut one = self.direction();
                one[position] = 1.0;
                let slope = unknowns[at].of(&one, &self.slopes(&one)?);
                if !slope.is_finite() {
                    return Err(self.no_derivative(function, unknown[at], reference, slope));
                }
            }
            let slope = of(&unknowns[at]);
            let message = format_args!("the derivative of '{}' along the seed is {slope}", self.name_of(unknown[at]));
            return Err(self.discard(function, message));
        }
        for (value, unknown) in result.iter_mut().zip(&unknowns) {
            *value = of(unknown);
        }
        Ok(())
    }

    /// fmi3GetAdjointDerivative: the transposed Jacobian times the seed. Fails like [`Self::directional_derivative`].
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
        let rows = self.structure(&unknowns, &knowns)?;
        let by_column = rows.transposed(knowns.len());
        let groups = groups(&rows, knowns.len());
        let mut products = vec![0.0; knowns.len()];
        for group in 0..groups.lines() {
            let mut direction = self.direction();
            groups.line(group).iter().for_each(|&column| direction[knowns[column as usize]] = 1.0);
            let slopes = self.slopes(&direction)?;
            for &column in groups.line(group) {
                // Unknowns with a seed of 0 are skipped, because their derivatives need not be finite.
                let asked = || {
                    let rows = by_column.line(column as usize).iter().map(|&row| row as usize);
                    rows.filter(|&row| seed[row] != 0.0).map(|row| (row, unknowns[row].of(&direction, &slopes)))
                };
                let product = asked().fold(0.0, |sum, (row, slope)| sum + seed[row] * slope);
                if !product.is_finite() {
                    let reference = known[column as usize];
                    return Err(match asked().find(|(_, slope)| !slope.is_finite()) {
                        Some((row, slope)) => self.no_derivative(function, unknown[row], reference, slope),
                        None => {
                            let name = self.name_of(reference);
                            let message = format_args!("the derivative with respect to '{name}' is {product}");
                            self.discard(function, message)
                        }
                    });
                }
                products[column as usize] = product;
            }
        }
        result.copy_from_slice(&products);
        Ok(())
    }

    /// fmi3GetOutputDerivatives of order 1: the derivatives of outputs with respect to time, for inputs that keep their
    /// values. Fails if the model is not continuous-time, or if a reference is not a real output. Returns fmi2Discard if
    /// a derivative is not finite.
    pub fn output_derivatives(&mut self, references: &[u32], result: &mut [f64]) -> CallResult {
        let function = Function::GetRealOutputDerivatives;
        self.check(function)?;
        if references.is_empty() {
            return Ok(());
        }
        if M::KIND != ModelKind::Continuous {
            return Err(self.error(function, "not provided: only outputs of continuous-time models have derivatives"));
        }
        let layout = self.layout();
        let is_output = |reference: u32| {
            let is_public = |variable: &Variable| !variable.declaration.local;
            let state = layout.states.position(reference).and_then(|_| layout.by_reference(reference));
            layout.outputs.position(reference).is_some() || state.is_some_and(is_public)
        };
        if let Some(&reference) = references.iter().find(|reference| !is_output(**reference)) {
            let name = self.name_of(reference);
            let message = format_args!("value reference {reference} ('{name}') must be a continuous output");
            return Err(self.error(function, message));
        }
        let unknowns = self.unknowns(function, references)?;
        self.refresh(false, false, true)?;
        let mut direction = self.direction();
        let states = self.layout().inputs.counts.reals;
        let slopes = self.layout().derivatives.reals();
        direction[states..][..slopes.len()].copy_from_slice(&self.values.reals[slopes]);
        direction[states + self.layout().derivatives.counts.reals] = 1.0;
        let slopes = self.slopes(&direction)?;
        for (unknown, &reference) in unknowns.iter().zip(references) {
            let slope = unknown.of(&direction, &slopes);
            if !slope.is_finite() {
                let (name, time) = (self.name_of(reference), self.timeline.time);
                let message = format_args!("the derivative of '{name}' with respect to time is {slope} at {time} s");
                return Err(self.discard(function, message));
            }
        }
        for (value, unknown) in result.iter_mut().zip(&unknowns) {
            *value = unknown.of(&direction, &slopes);
        }
        Ok(())
    }

    /// Dependencies of each unknown on the known variables, by their positions in `knowns`. If there are only a few
    /// known variables, assumes that every unknown depends on all of them, because evaluating them one by one is fast.
    fn structure(&mut self, unknowns: &[Unknown], knowns: &[usize]) -> CallResult<Structure> {
        const FEW: usize = 16;
        let mut rows = Structure::default();
        let all = if knowns.len() > FEW {
            self.derive()?;
            let Run { ctx, run, values } = self.context();
            M::dependencies(ctx, run, values)
        } else {
            None
        };
        let Some(all) = all else {
            unknowns.iter().for_each(|_| rows.push(0..knowns.len() as u32));
            return Ok(rows);
        };
        let mut places = vec![Vec::new(); self.direction().len()];
        knowns.iter().zip(0_u32..).for_each(|(&position, place)| places[position].push(place));
        for unknown in unknowns {
            match *unknown {
                Unknown::Computed(row) => {
                    rows.push(all.line(row).iter().flat_map(|&known| &places[known as usize]).copied());
                }
                Unknown::State(position) => rows.push(places[position].iter().copied()),
            }
        }
        Ok(rows)
    }

    /// A direction of zeros, with an element for each real input and state and for the time.
    fn direction(&self) -> Vec<f64> {
        vec![0.0; self.layout().inputs.counts.reals + self.layout().states.counts.reals + 1]
    }

    /// Derivatives of the real outputs, then of the state derivatives, along a direction.
    fn slopes(&mut self, direction: &[f64]) -> CallResult<Vec<f64>> {
        self.derive()?;
        let is_frozen = self.mode == Mode::ContinuousTime;
        let mut slopes = vec![0.0; self.layout().outputs.counts.reals + self.layout().states.counts.reals];
        M::directional(self.context(), is_frozen, direction, &mut slopes);
        Ok(slopes)
    }

    fn knowns(&self, function: Function, references: &[u32]) -> CallResult<Vec<usize>> {
        if M::KIND != ModelKind::Continuous {
            return Err(self.error(function, "not provided: only continuous-time models have derivatives"));
        }
        let Layout { inputs, states, end, .. } = self.layout();
        let count = inputs.counts.reals + states.counts.reals;
        let position = |&reference: &u32| match inputs.position(reference) {
            Some(position) => Ok(position),
            None if reference == *end && self.protocol.version == Version::Fmi3 => Ok(count),
            None => states.position(reference).map(|position| inputs.counts.reals + position).ok_or_else(|| {
                let message = format_args!("value reference {reference} is neither a real input nor a state (known)");
                self.error(function, message)
            }),
        };
        references.iter().map(position).collect()
    }

    fn unknowns(&self, function: Function, references: &[u32]) -> CallResult<Vec<Unknown>> {
        let Layout { inputs, outputs, states, derivatives, .. } = self.layout();
        let unknown = |&reference: &u32| {
            let derivative = || derivatives.position(reference).map(|position| outputs.counts.reals + position);
            let state = || states.position(reference).map(|position| Unknown::State(inputs.counts.reals + position));
            let computed = outputs.position(reference).or_else(derivative).map(Unknown::Computed);
            computed.or_else(state).ok_or_else(|| {
                let message = format_args!(
                    "value reference {reference} is neither a real output nor the derivative of a state (unknown)"
                );
                self.error(function, message)
            })
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

    fn name_of(&self, reference: u32) -> &str {
        self.layout().by_reference(reference).map_or("time", |variable| &variable.declaration.name)
    }

    fn no_derivative(&self, function: Function, unknown: u32, known: u32, slope: f64) -> CallError {
        let (of, to, time) = (self.name_of(unknown), self.name_of(known), self.timeline.time);
        let message =
            format_args!("the derivative of '{of}' with respect to '{to}' is {slope} at {time} s, not a finite number");
        self.discard(function, message)
    }
}
