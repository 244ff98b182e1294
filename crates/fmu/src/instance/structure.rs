//! Structural parameters: Configuration and Reconfiguration Mode of FMI 3.0.

use std::collections::BTreeSet;

use super::{CallResult, Instance};
use crate::calls::{Function, Interface, Mode};
use crate::runner::Model;
use crate::store::ValueStore;
use crate::variable::{Layout, Role, SizedArray, Variable};
use crate::variables::Variables as _;

/// Positions of the present states in memory; `None` if their number cannot change.
pub(super) fn present_states<M: Model>(layout: &Layout, values: &ValueStore) -> Option<Vec<usize>> {
    if !M::Parameters::HAS_STRUCTURE {
        return None;
    }
    layout.sized.iter().find(|array| array.role == Role::State)?;
    let states = layout.states.reals();
    let (mut present, mut at) = (Vec::new(), states.start);
    while at < states.end {
        let array = layout.sized_array(at as u32);
        match array {
            Some(array) => present.extend(array.elements(&values.lengths).map(|position| at - states.start + position)),
            None => present.push(at - states.start),
        }
        at += array.map_or(1, SizedArray::capacity);
    }
    Some(present)
}

impl<M: Model> Instance<M> {
    /// fmi3EnterConfigurationMode. Fails if the FMU has no structural parameter; after the start, if none is tunable.
    pub fn enter_configuration(&mut self) -> CallResult {
        let function = Function::EnterConfigurationMode;
        self.check(function)?;
        if !M::Parameters::HAS_STRUCTURE {
            return Err(self.error(function, "the FMU has no structural parameters"));
        }
        let before_start = self.mode == Mode::Instantiated;
        let is_settable = |variable: &Variable| {
            variable.declaration.details.structural && (before_start || variable.declaration.tunable)
        };
        if !self.layout().variables.iter().any(is_settable) {
            let which = if before_start { "structural parameters" } else { "tunable structural parameters" };
            return Err(self.error(function, format_args!("the FMU has no {which}")));
        }
        self.enter(if before_start { Mode::Configuration } else { Mode::Reconfiguration });
        Ok(())
    }

    /// fmi3ExitConfigurationMode.
    pub fn exit_configuration(&mut self) -> CallResult {
        self.check(Function::ExitConfigurationMode)?;
        self.enter(match (self.mode, self.protocol.interface) {
            (Mode::Configuration, _) => Mode::Instantiated,
            (_, Interface::CoSimulation) => Mode::Step,
            (_, Interface::ModelExchange) => Mode::Event,
            (_, Interface::ScheduledExecution) => Mode::ClockActivation,
        });
        Ok(())
    }

    /// Gives the arrays the lengths of the structural parameters. Elements keep their row and column. New elements get
    /// their start values, because a model may have copied other values to their memory.
    pub(super) fn resize(&mut self) {
        let layout = &self.description.layout;
        let lengths = &self.values.lengths;
        if layout.structural.iter().zip(lengths).all(|(&index, length)| self.values.words[index] == length.value as u64)
        {
            return;
        }
        let before = lengths.clone();
        self.values.update_lengths(layout);
        let starts = ValueStore::start(layout);
        for array in &layout.sized {
            let old: BTreeSet<_> = array.elements(&before).collect();
            let kept: BTreeSet<_> = array.elements(&self.values.lengths).filter(|at| old.contains(at)).collect();
            for position in (0..array.capacity()).filter(|position| !kept.contains(position)) {
                if let Some(element) = layout.by_reference(array.reference + position as u32) {
                    self.values.copy(&starts, element);
                }
            }
        }
        self.present_states = present_states::<M>(layout, &self.values);
    }
}
