//! Events of components whose clocks or clocked variables are connected (FMI 3.0.2, sections 2.2.8, 2.3.5 and 4.2).
//!
//! These components end their steps together, at the next tick of a time-based clock of any of them, and handle the
//! event together. Each iteration of an event
//!
//! 1. activates the time-based clocks that are due,
//! 2. transfers inputs and outputs until no signal changes, then activates the input clocks that are connected to
//!    clocks that tick, and repeats this until no further clock becomes active,
//! 3. updates all components in the event, and asks for new intervals.
//!
//! Components in Event Mode evaluate their active clocks from the state before the event, so the values do not depend
//! on the order of the components. Clocks that are due at the end of a step tick at the start of the next step, with
//! the inputs of that step.

use super::{Bus, Component, Overwritten, Reached, Stepped};
use crate::run::Run;
use fmu_import::c_api::Reference;
use fmu_import::loader::{CallError, MOST_ITERATIONS};
use std::collections::HashMap;

/// Components whose clocks or clocked variables are connected; none without clocks.
pub(super) struct Group {
    /// Their indices: each component after those that it reads, except in a loop.
    members: Vec<usize>,
    /// The components of the group that read a component, by its index.
    readers: Vec<Vec<usize>>,
    /// Clocks and the input clocks that they activate: index of the component, and value reference.
    wires: Vec<[(usize, Reference); 2]>,
}

/// The components of a step, their signals, and the values that overwrite inputs.
pub(super) struct Signals<'a> {
    pub(super) members: &'a mut [Component],
    pub(super) bus: &'a mut Bus,
    pub(super) overwritten: &'a [Overwritten],
}

impl Signals<'_> {
    #[inline]
    pub(super) fn set_inputs(&mut self, index: usize) -> Result<(), CallError> {
        self.members[index].set_inputs(self.bus)?;
        self.members[index].set_overwritten(index, self.overwritten)
    }

    #[inline]
    pub(super) fn read_outputs(&mut self, index: usize) -> Result<(), CallError> {
        self.members[index].read_outputs(self.bus)
    }

    /// The values that a component writes, for comparison.
    fn outputs(&self, index: usize) -> Vec<(u64, Option<i128>, Vec<u8>)> {
        let value = |(slot, _): &(usize, String)| {
            (self.bus.numbers[*slot].to_bits(), self.bus.whole(*slot), self.bus.binary(*slot).to_vec())
        };
        self.members[index].names.iter().map(value).collect()
    }
}

impl Group {
    /// The group of a run, whose instances are not initialized yet.
    pub(super) fn new(run: &Run, members: &mut [Component]) -> Self {
        let mut wires = Vec::new();
        // Connections between components with clocks; true if an end is a clock or belongs to one.
        let mut edges = Vec::new();
        let mut writers = HashMap::new();
        for (index, component) in run.components.iter().enumerate() {
            writers.extend(component.outputs.iter().map(|wire| (wire.slot, (index, wire.reference))));
        }
        for (index, component) in run.components.iter().enumerate() {
            for clock in &component.clocks {
                let Some(from) = run.components.iter().position(|other| other.name == clock.component) else {
                    continue;
                };
                wires.push([(from, clock.source_reference), (index, clock.reference)]);
                edges.push((from, index, true));
            }
            for wire in &component.inputs {
                let Some((from, output)) = writers.get(&wire.slot) else { continue };
                let (writer, reader) = (&members[*from].instance, &members[index].instance);
                if *from != index && writer.has_clocks() && reader.has_clocks() {
                    edges.push((*from, index, writer.is_clocked(*output) || reader.is_clocked(wire.reference)));
                }
            }
        }
        let coupled = |edge: &&(usize, usize, bool)| edge.2;
        let is_coupled = |index: usize| edges.iter().filter(coupled).any(|edge| edge.0 == index || edge.1 == index);
        let mut seen: Vec<bool> = (0..members.len()).map(|index| !is_coupled(index)).collect();
        let mut readers = vec![Vec::new(); members.len()];
        for (from, to, _) in edges.iter().filter(|edge| !seen[edge.0] && !seen[edge.1]) {
            readers[*from].push(*to);
        }
        let mut ordered = Vec::new();
        (0..members.len()).for_each(|index| visit(index, &edges, &mut seen, &mut ordered));
        for index in &ordered {
            members[*index].instance.share_events();
        }
        Self { members: ordered, readers, wires }
    }

    /// Makes the step of a component of the run. The components of the group make theirs with the first of them.
    #[inline]
    pub(super) fn step(&self, index: usize, signals: &mut Signals<'_>, time: f64, step: f64) -> Stepped<CallError> {
        if self.members.is_empty() || !self.members.contains(&index) {
            return signals.members[index].do_step(time, step);
        }
        self.step_together(index, signals, time, step)
    }

    fn step_together(&self, index: usize, signals: &mut Signals<'_>, time: f64, step: f64) -> Stepped<CallError> {
        if self.members.iter().min() != Some(&index) {
            return Ok(None);
        }
        let (end, mut now, mut ended) = (time + step, time, None);
        for &m in &self.members {
            signals.members[m].instance.begin_step()?;
        }
        while now < end {
            self.event(signals, now, Some(step))?;
            let next = self.members.iter().filter_map(|m| signals.members[*m].instance.next_tick(now, end, step));
            let until = next.reduce(f64::min).unwrap_or(end);
            for &m in &self.members {
                signals.set_inputs(m)?;
                if let Err(error) = signals.members[m].instance.step(now, until - now) {
                    match signals.members[m].ended(error, end, step)? {
                        at_start @ Some((Reached::Start, _)) => return Ok(at_start),
                        at_end => ended = ended.or(at_end),
                    }
                }
            }
            for &m in &self.members {
                signals.read_outputs(m)?;
            }
            now = until;
        }
        self.event(signals, now, None)?;
        Ok(ended)
    }

    /// Handles an event, if there is one. Time-based clocks tick only with a communication step in s, which determines
    /// the tolerance of their times.
    pub(super) fn event(&self, signals: &mut Signals<'_>, time: f64, step: Option<f64>) -> Result<(), CallError> {
        for &m in &self.members {
            let instance = &mut signals.members[m].instance;
            if instance.wants_event() || step.is_some_and(|step| instance.is_event_needed(time, step)) {
                instance.begin_event()?;
            }
        }
        if !self.members.iter().any(|m| signals.members[*m].instance.is_in_event()) {
            return Ok(());
        }
        let mut iteration = 0;
        loop {
            for &m in &self.members {
                let instance = &mut signals.members[m].instance;
                let due = step.map_or(Vec::new(), |step| instance.due_clocks(time, step));
                if !due.is_empty() {
                    instance.begin_event()?;
                    instance.activate(&due)?;
                }
            }
            self.propagate(signals)?;
            let is_in_event = |m: &usize| signals.members[*m].instance.is_in_event();
            let in_event: Vec<usize> = self.members.iter().copied().filter(is_in_event).collect();
            if iteration == MOST_ITERATIONS {
                return Err(endless(signals, &in_event));
            }
            let mut is_needed_again = false;
            for &m in &in_event {
                is_needed_again |= signals.members[m].instance.update(time)?;
                signals.read_outputs(m)?;
            }
            if let Some(step) = step {
                let is_due = |m: &usize| !signals.members[*m].instance.due_clocks(time, step).is_empty();
                is_needed_again |= in_event.iter().any(is_due);
            }
            if !is_needed_again {
                return in_event.iter().try_for_each(|m| signals.members[*m].instance.end_event());
            }
            iteration += 1;
        }
    }

    /// Transfers signals and activates connected clocks until nothing changes.
    fn propagate(&self, signals: &mut Signals<'_>) -> Result<(), CallError> {
        // Components to evaluate.
        let mut is_open: Vec<bool> = signals.members.iter().map(|member| member.instance.is_in_event()).collect();
        loop {
            let mut left = MOST_ITERATIONS * self.members.len();
            while let Some(&m) = self.members.iter().find(|m| is_open[**m]) {
                is_open[m] = false;
                left -= 1;
                if left == 0 {
                    return Err(self.unsettled(signals, m));
                }
                let before = signals.outputs(m);
                signals.set_inputs(m)?;
                signals.members[m].instance.evaluate()?;
                signals.read_outputs(m)?;
                if signals.outputs(m) != before {
                    for &reader in &self.readers[m] {
                        is_open[reader] |= signals.members[reader].instance.is_in_event();
                    }
                }
            }
            let mut is_settled = true;
            for [from, to] in &self.wires {
                let is_active = |(m, clock): &(usize, Reference)| signals.members[*m].instance.is_active(*clock);
                if is_active(from) && !is_active(to) {
                    let instance = &mut signals.members[to.0].instance;
                    instance.begin_event()?;
                    instance.activate(&[to.1])?;
                    (is_open[to.0], is_settled) = (true, false);
                }
            }
            if is_settled {
                return Ok(());
            }
        }
    }

    /// The error about signals that keep changing at an event.
    #[cold]
    fn unsettled(&self, signals: &mut Signals<'_>, m: usize) -> CallError {
        let names: Vec<&str> = self.readers[m].iter().map(|m| signals.members[*m].instance.name()).collect();
        let reason = format!(
            "the outputs at a tick still change after {MOST_ITERATIONS} evaluations: they depend on those of `{}`, and \
             these on them; one of them must depend on values from before the tick only",
            names.join("`, `")
        );
        signals.members[m].instance.failed_event(reason)
    }
}

/// The error after too many iterations at one time.
#[cold]
fn endless(signals: &mut Signals<'_>, in_event: &[usize]) -> CallError {
    let instances = in_event.iter().map(|m| &signals.members[*m].instance);
    let clocks = instances.flat_map(|one| one.active_clocks().map(move |clock| format!("`{}:{clock}`", one.name())));
    let clocks: Vec<String> = clocks.collect();
    // An event that no component is in has one iteration.
    signals.members[in_event.first().copied().unwrap_or_default()].instance.endless(&clocks)
}

/// Appends the components that a component reads, then the component itself.
fn visit(index: usize, edges: &[(usize, usize, bool)], seen: &mut [bool], ordered: &mut Vec<usize>) {
    if !std::mem::replace(&mut seen[index], true) {
        edges.iter().filter(|edge| edge.1 == index).for_each(|edge| visit(edge.0, edges, seen, ordered));
        ordered.push(index);
    }
}
