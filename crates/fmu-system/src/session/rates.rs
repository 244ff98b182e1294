//! Steps of components with rates, and inputs that are lines in time.
//!
//! A component with `every` = n makes a step in each n-th step of the run. The bus interpolates its continuous outputs
//! until the next one. A component with `substeps` makes several steps in each step of the run. Their step sizes are
//! differences of times, without error that accumulates.
//!
//! An input that is a line gets its value at the start of the step and a slope: to the value at the end of the step, if
//! the source has made its step already, else the slope of the source in the previous step.

use super::events::{Group as ClockedGroup, Signals};
use super::{Feeder, Reached};
use crate::run::{Component, Linear, Order, Run, Simulation, StepCounts, Wire};
use fmu_import::c_api::Reference;
use fmu_import::description::BaseType;
use fmu_import::loader::CallError;

/// The call with which a component ends the simulation at the end of a step. At another time, it is an error.
pub(super) type Ended = Option<CallError>;

/// A step of the components that have no rate.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interval {
    /// Steps of the run before it.
    pub(super) step: u64,
    /// Start, s.
    pub(super) time: f64,
    /// Size that FMUs are asked for, s.
    pub(super) size: f64,
    /// End, s.
    pub(super) end: f64,
}

/// An input that is a line.
struct Line {
    /// Index among the Real inputs of the component.
    input: usize,
    slot: usize,
    conversion: Option<Linear>,
    /// True if the source makes its step before the reader.
    is_ahead: bool,
    /// True if the source makes its step before the reader when a step is repeated.
    is_ahead_again: bool,
}

/// The rate of a component and its lines.
struct Rate {
    is_discrete: bool,
    every: u64,
    substeps: u64,
    /// Slots of the outputs that the bus interpolates.
    ramps: Vec<usize>,
    lines: Vec<Line>,
    /// Arguments for the slopes of the lines.
    references: Vec<Reference>,
    orders: Vec<i32>,
    slopes: Vec<f64>,
}

/// Values from before a step that the next steps depend on.
#[derive(Debug, Clone)]
pub(super) struct Memory {
    /// By slot, the slope in the previous interval.
    pub(super) slopes: Vec<f64>,
    /// By component, the values of interpolated outputs at both ends of its step.
    ramps: Vec<Vec<[f64; 2]>>,
    /// Size of the next step under error control, s.
    pub(super) wanted: f64,
}

/// Rates and lines of a run.
pub(super) struct Exchange {
    pub(super) simulation: Simulation,
    /// Number of steps until the stop time.
    steps: u64,
    rates: Vec<Rate>,
    /// Slots of the sources of all lines.
    sources: Vec<usize>,
    /// By slot, the value at the start of the interval.
    start: Vec<f64>,
    pub(super) memory: Memory,
    /// True while a step is repeated.
    pub(super) is_repeated: bool,
    /// The step of the run, which components that take samples make at once.
    pub(super) whole: Interval,
    pub(super) counts: StepCounts,
}

impl Exchange {
    /// `groups` are the components that repeat their steps together.
    pub(super) fn new(simulation: &Simulation, run: &Run, groups: &[Vec<usize>]) -> Self {
        let writer = |slot: usize| run.components.iter().position(|own| own.outputs.iter().any(|o| o.slot == slot));
        let rate = |(index, component): (usize, &Component)| {
            let line = |(input, wire): (usize, &Wire)| {
                let source = writer(wire.slot);
                let is_ahead = simulation.order != Order::Jacobi && source.is_some_and(|source| source < index);
                let is_with = |group: &Vec<usize>| group.contains(&index) && source.is_some_and(|s| group.contains(&s));
                let is_ahead_again = is_ahead || groups.iter().any(is_with);
                Line { input, slot: wire.slot, conversion: wire.conversion, is_ahead, is_ahead_again }
            };
            let reals = component.inputs.iter().filter(|wire| wire.base_type == BaseType::Real).enumerate();
            let ramps = reals.filter(|(_, wire)| wire.is_ramp);
            let lines: Vec<Line> = ramps.clone().map(line).collect();
            Rate {
                is_discrete: component.is_discrete,
                every: component.every,
                substeps: component.substeps,
                ramps: component.outputs.iter().filter(|wire| wire.is_ramp).map(|wire| wire.slot).collect(),
                references: ramps.map(|(_, wire)| wire.reference).collect(),
                orders: vec![1; lines.len()],
                slopes: vec![0.0; lines.len()],
                lines,
            }
        };
        let rates: Vec<Rate> = run.components.iter().enumerate().map(rate).collect();
        let Simulation { start, stop, step, .. } = *simulation;
        Self {
            simulation: *simulation,
            steps: ((stop - start) / step).round() as u64,
            sources: rates.iter().flat_map(|rate| &rate.lines).map(|line| line.slot).collect(),
            start: vec![0.0; run.slots],
            memory: Memory {
                slopes: vec![0.0; run.slots],
                ramps: rates.iter().map(|rate| vec![[0.0; 2]; rate.ramps.len()]).collect(),
                wanted: 0.0,
            },
            rates,
            is_repeated: false,
            whole: Interval { step: 0, time: start, size: step, end: start + step },
            counts: StepCounts::default(),
        }
    }

    pub(super) fn is_discrete(&self, index: usize) -> bool {
        self.rates[index].is_discrete
    }
}

/// The components of a run and all that they exchange.
pub(super) struct Stage<'a> {
    pub(super) exchange: &'a mut Exchange,
    pub(super) clocked: &'a ClockedGroup,
    pub(super) signals: Signals<'a>,
    pub(super) feeder: &'a mut Feeder,
}

impl Stage<'_> {
    /// Writes the input series for an interval and remembers the values at its start.
    pub(super) fn begin(&mut self, at: Interval) {
        let Self { exchange, signals, feeder, .. } = self;
        let numbers = &mut signals.bus.numbers;
        if exchange.sources.is_empty() {
            feeder.feed(at.time, 0.5 * at.size, numbers);
            return;
        }
        feeder.feed(at.time, 0.0, numbers);
        feeder.slopes(at.time, at.size, numbers, &mut exchange.memory.slopes);
        exchange.sources.iter().for_each(|slot| exchange.start[*slot] = numbers[*slot]);
    }

    /// Remembers the slopes of the lines in an interval.
    pub(super) fn end(&mut self, at: Interval) {
        let Exchange { sources, start, memory, .. } = &mut *self.exchange;
        for slot in sources {
            memory.slopes[*slot] = (self.signals.bus.numbers[*slot] - start[*slot]) / (at.end - at.time);
        }
    }

    /// Sets the inputs of components, makes their steps, and reads their outputs.
    pub(super) fn together(&mut self, members: &[usize], at: Interval) -> Result<Ended, CallError> {
        for index in members {
            let Some(at) = self.interval(*index, at) else { continue };
            self.set_inputs(*index, at, at.time)?;
        }
        let mut ended = None;
        for index in members {
            let Some(at) = self.interval(*index, at) else { continue };
            let found = self.make_steps(*index, at)?;
            ended = ended.or(found);
        }
        for index in members {
            let Some(at) = self.interval(*index, at) else { continue };
            self.read_outputs(*index, at)?;
        }
        Ok(ended)
    }

    fn is_due(&self, index: usize, at: Interval) -> bool {
        at.step.is_multiple_of(self.exchange.rates[index].every)
    }

    /// The step of a component for this interval; `None` if it takes samples and has made the step of the run.
    fn interval(&self, index: usize, at: Interval) -> Option<Interval> {
        let Exchange { rates, whole, .. } = &*self.exchange;
        if rates[index].is_discrete { Some(*whole).filter(|whole| whole.time == at.time) } else { Some(at) }
    }

    /// Sets the inputs of a component, with the values that lines have at `time`.
    fn set_inputs(&mut self, index: usize, at: Interval, time: f64) -> Result<(), CallError> {
        if !self.is_due(index, at) {
            return Ok(());
        }
        let Exchange { rates, start, memory, is_repeated, .. } = &mut *self.exchange;
        let Signals { members, bus, overwritten } = &mut self.signals;
        let (member, Rate { lines, references, orders, slopes, .. }) = (&mut members[index], &mut rates[index]);
        if lines.is_empty() {
            member.set_inputs(bus)?;
        } else {
            member.load_reals(bus);
            for ((line, slope), reference) in lines.iter().zip(&mut *slopes).zip(&*references) {
                let from = start[line.slot];
                let is_ahead = if *is_repeated { line.is_ahead_again } else { line.is_ahead };
                let rise = if is_ahead { (bus.numbers[line.slot] - from) / at.size } else { memory.slopes[line.slot] };
                let value = from + rise * (time - at.time);
                let (value, rise) =
                    line.conversion.map_or((value, rise), |linear| (linear.of(value), linear.factor * rise));
                member.inputs.reals.values[line.input] = value;
                let is_own =
                    overwritten.iter().any(|o| (o.member, o.reference) == (index, *reference) && o.value.is_some());
                *slope = if is_own { 0.0 } else { rise };
            }
            member.set_reals()?;
            member.instance.set_real_input_derivatives(references, orders, slopes)?;
            member.set_others(bus)?;
        }
        members[index].set_overwritten(index, overwritten)
    }

    fn make_steps(&mut self, index: usize, at: Interval) -> Result<Ended, CallError> {
        let Rate { every, substeps, ref lines, .. } = self.exchange.rates[index];
        let has_lines = !lines.is_empty();
        if (every, substeps) == (1, 1) {
            return self.make_step(index, at.time, at.size);
        }
        if !self.is_due(index, at) {
            return Ok(None);
        }
        let simulation = self.exchange.simulation;
        let first = at.step as f64;
        let mut time = at.time;
        for i in 1..=substeps {
            let end =
                simulation.time(if i == substeps { first + every as f64 } else { first + i as f64 / substeps as f64 });
            if i > 1 && has_lines {
                self.set_inputs(index, at, time)?;
            }
            if let Some(error) = self.make_step(index, time, end - time)? {
                // Other components have not reached the end of this step, or have passed it.
                return Err(error);
            }
            time = end;
        }
        Ok(None)
    }

    fn make_step(&mut self, index: usize, time: f64, size: f64) -> Result<Ended, CallError> {
        match self.clocked.step(index, &mut self.signals, time, size)? {
            Some((Reached::Start, error)) => Err(error),
            ended => Ok(ended.map(|(_, error)| error)),
        }
    }

    /// Reads the outputs of a component that has made a step; those of a slow one are interpolated.
    fn read_outputs(&mut self, index: usize, at: Interval) -> Result<(), CallError> {
        let Exchange { rates, memory, steps, .. } = &mut *self.exchange;
        let Rate { every, ref ramps, .. } = rates[index];
        let Signals { members, bus, .. } = &mut self.signals;
        let done = at.step % every;
        let ends = &mut memory.ramps[index];
        if done == 0 {
            ramps.iter().zip(&mut *ends).for_each(|(slot, [old, _])| *old = bus.numbers[*slot]);
            members[index].read_outputs(bus)?;
            ramps.iter().zip(&mut *ends).for_each(|(slot, [_, new])| *new = bus.numbers[*slot]);
        }
        let count = every.min(*steps - (at.step - done));
        for (slot, [old, new]) in ramps.iter().zip(ends) {
            let share = (done + 1) as f64 / count as f64;
            bus.numbers[*slot] = if done + 1 == count { *new } else { *old + share * (*new - *old) };
        }
        Ok(())
    }
}
