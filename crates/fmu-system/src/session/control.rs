//! Steps of coupled components: with rates, with slopes, repeated until the signals agree, or with sizes that are
//! chosen by their error.

use super::events::{Group as ClockedGroup, Signals};
use super::rates::{Ended, Exchange, Interval, Memory, Stage};
use super::{Feeder, Reached};
use crate::fmus::FmusError;
use crate::run::{self, Order, Run, Simulation};

/// The coupling of the components of a run.
pub(super) struct Coupling {
    pub(super) exchange: Exchange,
    /// Components that make their steps together, in order of execution.
    parts: Vec<Vec<usize>>,
}

impl Coupling {
    /// The coupling of a run; `None` if all components make one step per step of the run with constant inputs.
    pub(super) fn of(simulation: &Simulation, run: &Run) -> Option<Box<Self>> {
        let is_special =
            |own: &run::Component| (own.every, own.substeps) != (1, 1) || own.inputs.iter().any(|wire| wire.is_ramp);
        if !run.components.iter().any(is_special) {
            return None;
        }
        let all = 0..run.components.len();
        let parts = match simulation.order {
            Order::Jacobi => vec![all.collect()],
            _ => all.map(|index| vec![index]).collect(),
        };
        Some(Box::new(Self { exchange: Exchange::new(simulation, run, &[]), parts }))
    }

    /// Makes a step of the run.
    pub(super) fn step(
        &mut self,
        clocked: &ClockedGroup,
        signals: Signals<'_>,
        feeder: &mut Feeder,
        at: Interval,
    ) -> Result<Ended, FmusError> {
        let mut stage = Stage { exchange: &mut self.exchange, clocked, signals, feeder };
        stage.begin(at);
        let mut ended = None;
        for part in &self.parts {
            match stage.together(part, at)? {
                None => (),
                at_start @ Some((Reached::Start, _)) => return Ok(at_start),
                at_end => ended = ended.or(at_end),
            }
        }
        stage.end(at);
        Ok(ended)
    }

    pub(super) fn memory(&self) -> Memory {
        self.exchange.memory.clone()
    }

    pub(super) fn restore(&mut self, memory: &Memory) {
        self.exchange.memory.clone_from(memory);
    }
}
