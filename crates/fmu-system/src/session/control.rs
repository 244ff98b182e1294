//! Steps of coupled components that are repeated until the signals agree (`iterate`), or whose sizes are chosen by their
//! error (`error_control`).
//!
//! A step is repeated from saved states of its components. Components that take samples make their steps once, in their
//! place in the order.

use super::events::{Group as ClockedGroup, Signals};
use super::rates::{Ended, Exchange, Interval, Stage};
use super::{Bus, Component, Feeder, STEP_SLACK};
use crate::fmus::FmusError;
use crate::run::{self, ErrorControl, Extrapolation, Iteration, Order, Run, Simulation};
use fmu_import::description::BaseType;
use fmu_import::loader::{CallError, SavedState};

/// The coupling of the components of a run.
pub(super) struct Coupling {
    pub(super) exchange: Exchange,
    parts: Vec<Part>,
    /// For shorter steps instead of discarded ones.
    pub(super) retry: Option<Start>,
}

/// Components that make their steps together. Parts are in order of execution.
enum Part {
    Once(Vec<usize>),
    Iterated(Box<Iterated>),
    Controlled(Box<Controlled>),
}

/// States of components, from which they can repeat a step.
struct States {
    members: Vec<usize>,
    states: Vec<SavedState>,
}

impl States {
    fn of(members: Vec<usize>) -> Self {
        Self { members, states: Vec::new() }
    }

    fn save(&mut self, members: &mut [Component]) -> Result<(), CallError> {
        if self.states.is_empty() {
            self.members.iter().for_each(|index| members[*index].instance.allow_earlier_states());
            let states = self.members.iter().map(|index| members[*index].instance.save_state());
            self.states = states.collect::<Result<_, _>>()?;
            return Ok(());
        }
        let mut all = self.members.iter().zip(&self.states);
        all.try_for_each(|(index, state)| members[*index].instance.save_state_again(state))
    }

    fn restore(&self, members: &mut [Component]) -> Result<(), CallError> {
        let mut all = self.members.iter().zip(&self.states);
        all.try_for_each(|(index, state)| members[*index].instance.restore_state(state))
    }
}

/// The start of a step, from which it can be repeated: states of components, signals, slopes, rows of input series.
pub(super) struct Start {
    states: States,
    bus: Bus,
    slopes: Vec<f64>,
    rows: Vec<usize>,
}

impl Start {
    fn of(members: Vec<usize>) -> Self {
        let bus = Bus { numbers: Vec::new(), exact: Vec::new(), binaries: Vec::new() };
        Self { states: States::of(members), bus, slopes: Vec::new(), rows: Vec::new() }
    }

    fn save(&mut self, stage: &mut Stage<'_>) -> Result<(), CallError> {
        self.bus.take(stage.signals.bus);
        self.slopes.clone_from(&stage.exchange.memory.slopes);
        self.rows.clear();
        self.rows.extend(stage.feeder.series.iter().map(|(_, row)| *row));
        self.states.save(stage.signals.members)
    }

    fn restore(&mut self, stage: &mut Stage<'_>) -> Result<(), CallError> {
        stage.signals.bus.take(&self.bus);
        stage.exchange.memory.slopes.clone_from(&self.slopes);
        stage.feeder.series.iter_mut().zip(&self.rows).for_each(|((_, row), before)| *row = *before);
        self.states.restore(stage.signals.members)
    }
}

/// A connected output, and its value at some time.
struct Signal {
    slot: usize,
    /// `None` for one that is not Real.
    nominal: Option<f64>,
    value: f64,
}

/// The outputs of components that are read by `readers`.
fn signals(run: &Run, members: &[usize], readers: &[usize]) -> Vec<Signal> {
    let is_read = |slot: usize| readers.iter().any(|r| run.components[*r].inputs.iter().any(|wire| wire.slot == slot));
    let outputs = members.iter().flat_map(|index| &run.components[*index].outputs);
    let nominal = |wire: &run::Wire| (wire.base_type == BaseType::Real).then(|| wire.nominal.unwrap_or(1.0));
    let signal = |wire: &run::Wire| Signal { slot: wire.slot, nominal: nominal(wire), value: 0.0 };
    outputs.filter(|wire| is_read(wire.slot)).map(signal).collect()
}

impl Coupling {
    /// The coupling of a run; `None` if all components make one step per step of the run, with constant inputs. With
    /// `has_retry`, discarded steps are repeated with shorter ones.
    pub(super) fn of(simulation: &Simulation, run: &Run, has_retry: bool) -> Option<Box<Self>> {
        let is_special =
            |own: &run::Component| (own.every, own.substeps) != (1, 1) || own.inputs.iter().any(|wire| wire.is_ramp);
        let Simulation { iterate, error_control, order, .. } = *simulation;
        let is_repeated = iterate.is_some() || error_control.is_some() || has_retry;
        if !is_repeated && !run.components.iter().any(is_special) {
            return None;
        }
        let groups = iterate.map_or_else(Vec::new, |_| run.coupled());
        let once_or_iterated = |index: usize| match groups.iter().find(|group| group.contains(&index)) {
            Some(group) if group[0] == index => Some(Part::Iterated(Box::new(Iterated {
                settings: iterate?,
                states: States::of(group.clone()),
                signals: signals(run, group, group),
            }))),
            Some(_) => None,
            None => Some(Part::Once(vec![index])),
        };
        let continuous = run.continuous();
        let all = 0..run.components.len();
        let parts = match (order, error_control) {
            (Order::Jacobi, _) => vec![Part::Once(all.collect())],
            (_, None) => all.filter_map(once_or_iterated).collect(),
            (_, Some(settings)) => {
                let controlled = Controlled::new(
                    simulation,
                    settings,
                    continuous.iter().copied().filter_map(once_or_iterated).collect(),
                    Start::of(continuous.clone()),
                    signals(run, &continuous, &all.clone().collect::<Vec<_>>()),
                );
                let mut controlled = Some(Part::Controlled(Box::new(controlled)));
                let part = |index: usize| {
                    if continuous.contains(&index) { controlled.take() } else { Some(Part::Once(vec![index])) }
                };
                all.filter_map(part).collect()
            }
        };
        let retry = has_retry.then(|| Start::of((0..run.components.len()).collect()));
        let mut exchange = Exchange::new(simulation, run, &groups);
        exchange.memory.wanted = error_control.and_then(|own| own.initial_step).unwrap_or(simulation.step / 16.0);
        Some(Box::new(Self { exchange, parts, retry }))
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
        stage.exchange.whole = at;
        match &mut self.retry {
            None => attempt(&mut self.parts, &mut stage, at),
            Some(start) => start.retry(&mut self.parts, &mut stage, at),
        }
    }
}

/// Makes a step of all parts, with its input series and slopes.
fn attempt(parts: &mut [Part], stage: &mut Stage<'_>, at: Interval) -> Result<Ended, FmusError> {
    stage.begin(at);
    let ended = pass(parts, stage, at)?;
    // Under error control, the last of the smaller steps sets the slopes.
    if !parts.iter().any(|part| matches!(part, Part::Controlled(_))) {
        stage.end(at);
    }
    Ok(ended)
}

impl Start {
    /// Makes a step of the run. If a continuous component discards a part of it, all components repeat it up to the time
    /// that this one has reached, else up to the half of it. Then follows the rest of the step.
    fn retry(&mut self, parts: &mut [Part], stage: &mut Stage<'_>, whole: Interval) -> Result<Ended, FmusError> {
        let mut at = whole;
        loop {
            self.save(stage)?;
            let ended = loop {
                let error = match attempt(parts, stage, at) {
                    Ok(ended) => break ended,
                    Err(error) => error,
                };
                let Some(name) = error.discarded().map(|call| &call.instance) else { return Err(error) };
                let members = &mut *stage.signals.members;
                let Some(index) = members.iter().position(|own| own.instance.name() == name) else { return Err(error) };
                let reached = members[index].instance.last_successful_time().unwrap_or(at.time);
                let is_within = at.time < reached && reached < at.end;
                let end = if is_within { reached } else { at.time + 0.5 * (at.end - at.time) };
                stage.exchange.counts.rejected += 1;
                if stage.exchange.is_discrete(index) || end - at.time < stage.exchange.simulation.step / 1024.0 {
                    return Err(error);
                }
                self.restore(stage)?;
                at = Interval { size: end - at.time, end, ..at };
            };
            stage.exchange.counts.accept(at.size, false);
            match ended {
                ended if at.end >= whole.end => return Ok(ended),
                Some(error) => return Err(error.into()),
                None => (),
            }
            at = Interval { time: at.end, size: whole.end - at.end, ..whole };
        }
    }
}

/// Makes a step of some parts.
fn pass(parts: &mut [Part], stage: &mut Stage<'_>, at: Interval) -> Result<Ended, FmusError> {
    let mut ended = None;
    for part in parts {
        let found = match part {
            Part::Once(members) => stage.together(members, at)?,
            Part::Iterated(own) => own.step(stage, at).map(|()| None)?,
            Part::Controlled(own) => own.step(stage, at).map(|()| None)?,
        };
        ended = ended.or(found);
    }
    Ok(ended)
}

/// An error if a component ends the simulation in a step that may be repeated.
fn fails_if(ended: Ended) -> Result<(), CallError> {
    ended.map_or(Ok(()), Err)
}

/// Continuous components that depend on each other.
struct Iterated {
    settings: Iteration,
    states: States,
    /// The signals among them, with the values of the last pass.
    signals: Vec<Signal>,
}

impl Iterated {
    fn step(&mut self, stage: &mut Stage<'_>, at: Interval) -> Result<(), FmusError> {
        let made = self.repeat(stage, at);
        stage.exchange.is_repeated = false;
        made
    }

    fn repeat(&mut self, stage: &mut Stage<'_>, at: Interval) -> Result<(), FmusError> {
        self.states.save(stage.signals.members)?;
        let Iteration { tolerance, limit } = self.settings;
        for pass in 1..=limit {
            if pass > 1 {
                self.states.restore(stage.signals.members)?;
                stage.exchange.is_repeated = true;
            }
            for index in &self.states.members {
                fails_if(stage.together(&[*index], at)?)?;
            }
            let numbers = &stage.signals.bus.numbers;
            let largest = self.signals.iter().map(|signal| signal.change(numbers)).fold(0.0, f64::max);
            if pass > 1 && largest <= tolerance {
                return Ok(());
            }
            if pass == limit {
                return Err(self.unsettled(stage, largest));
            }
            self.signals.iter_mut().for_each(|signal| signal.value = numbers[signal.slot]);
        }
        Ok(())
    }

    #[cold]
    fn unsettled(&self, stage: &Stage<'_>, change: f64) -> FmusError {
        let numbers = &stage.signals.bus.numbers;
        let changing = self.signals.iter().filter(|signal| signal.change(numbers) > self.settings.tolerance);
        let names = changing.filter_map(|signal| super::output_in(stage.signals.members, signal.slot));
        let names: Vec<String> = names.map(|(component, name)| format!("`{component}:{name}`")).collect();
        FmusError::Unsettled { signals: names.join(", "), change, passes: self.settings.limit }
    }
}

impl Signal {
    /// The change of the value, relative to it or to its nominal value. Values that are not Real must be equal.
    fn change(&self, numbers: &[f64]) -> f64 {
        let value = numbers[self.slot];
        match self.nominal {
            _ if value == self.value => 0.0,
            Some(nominal) => (value - self.value).abs() / value.abs().max(nominal),
            None => f64::INFINITY,
        }
    }
}

/// Continuous components whose steps are chosen by their error: that of one step against two halves.
struct Controlled {
    parts: Vec<Part>,
    start: Start,
    /// The connected signals, with the values after one step.
    signals: Vec<Signal>,
    tolerance: f64,
    /// Smallest and largest step, s.
    limits: [f64; 2],
    /// Order of the coupling: the error of a step is that of its power plus 1.
    order: f64,
}

impl Controlled {
    fn new(
        simulation: &Simulation,
        settings: ErrorControl,
        parts: Vec<Part>,
        start: Start,
        signals: Vec<Signal>,
    ) -> Self {
        let largest = simulation.step;
        let limits = [settings.min_step.unwrap_or(largest / 1024.0), largest];
        Self {
            parts,
            start,
            signals: signals.into_iter().filter(|signal| signal.nominal.is_some()).collect(),
            tolerance: settings.tolerance,
            limits,
            order: if simulation.extrapolation == Extrapolation::Linear { 2.0 } else { 1.0 },
        }
    }

    fn step(&mut self, stage: &mut Stage<'_>, whole: Interval) -> Result<(), FmusError> {
        let [least, most] = self.limits;
        let mut time = whole.time;
        while time < whole.end {
            let left = whole.end - time;
            let wanted = stage.exchange.memory.wanted.clamp(least, most);
            let size = match wanted {
                _ if wanted >= left * (1.0 - 1e-6) => left,
                _ if wanted > 0.5 * left => 0.5 * left,
                _ => wanted,
            };
            let end = if size == left { whole.end } else { time + size };
            let at = Interval { time, size: end - time, end, ..whole };
            // The size is a difference of times, which is rounded.
            let is_smallest = at.size <= least * (1.0 + STEP_SLACK);
            self.start.save(stage)?;
            let error = match self.estimate(stage, at) {
                Ok(error) => error,
                Err(error) if is_smallest || !error.is_of_long_step() => return Err(error),
                Err(_) => f64::INFINITY,
            };
            let factor = 0.9 * libm::pow(error, -1.0 / (self.order + 1.0));
            let factor = if error == 0.0 { 2.0 } else { factor.clamp(0.2, 2.0) };
            let next = factor * at.size;
            let Exchange { memory, counts, .. } = &mut *stage.exchange;
            if error <= 1.0 || is_smallest {
                counts.accept(at.size, error > 1.0);
                time = end;
                let is_shortened = at.size < wanted;
                memory.wanted = if is_shortened && factor >= 1.0 { wanted.max(next) } else { next };
            } else {
                counts.rejected += 1;
                memory.wanted = next;
                self.start.restore(stage)?;
            }
        }
        Ok(())
    }

    /// Makes one step, then two halves of it, and returns the error relative to the tolerance.
    fn estimate(&mut self, stage: &mut Stage<'_>, at: Interval) -> Result<f64, FmusError> {
        stage.begin(at);
        fails_if(pass(&mut self.parts, stage, at)?)?;
        self.signals.iter_mut().for_each(|signal| signal.value = stage.signals.bus.numbers[signal.slot]);
        self.start.restore(stage)?;
        let middle = at.time + 0.5 * at.size;
        for (time, end) in [(at.time, middle), (middle, at.end)] {
            let half = Interval { time, size: end - time, end, ..at };
            stage.begin(half);
            fails_if(pass(&mut self.parts, stage, half)?)?;
            stage.end(half);
        }
        let numbers = &stage.signals.bus.numbers;
        let scale = (libm::exp2(self.order) - 1.0) * self.tolerance;
        let error = |signal: &Signal| {
            let (before, value) = (self.start.bus.numbers[signal.slot], numbers[signal.slot]);
            let range = signal.nominal.unwrap_or(1.0).max(before.abs()).max(value.abs());
            let error = (value - signal.value).abs() / (scale * range);
            if error.is_nan() { f64::INFINITY } else { error }
        };
        Ok(self.signals.iter().map(error).fold(0.0, f64::max))
    }
}
