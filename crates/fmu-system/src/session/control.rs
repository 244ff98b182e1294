//! Steps of coupled components that are repeated until the signals agree (`iterate`), or whose sizes are chosen by their
//! error (`error_control`).
//!
//! A step is repeated from saved states of its components. Components that take samples make their steps once, in their
//! place in the order.

use super::events::{Group as ClockedGroup, Signals};
use super::rates::{Ended, Exchange, Interval, Memory, Stage};
use super::{Bus, Component, Feeder, Reached, STEP_SLACK};
use crate::fmus::FmusError;
use crate::run::{self, ErrorControl, Extrapolation, Iteration, Order, Run, Simulation, StepCounts};
use fmu_import::description::BaseType;
use fmu_import::loader::{CallError, SavedState};

/// The coupling of the components of a run.
pub(super) struct Coupling {
    exchange: Exchange,
    parts: Vec<Part>,
    retry: Option<Retry>,
}

/// Shorter steps instead of discarded ones.
struct Retry {
    start: Start,
    counts: StepCounts,
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
struct Start {
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
        let start = has_retry.then(|| Start::of((0..run.components.len()).collect()));
        let retry = start.map(|start| Retry { start, counts: StepCounts::default() });
        Some(Box::new(Self { exchange: Exchange::new(simulation, run, &groups), parts, retry }))
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
            Some(retry) => retry.step(&mut self.parts, &mut stage, at),
        }
    }

    fn controlled(&self) -> Option<&Controlled> {
        self.parts.iter().find_map(|part| if let Part::Controlled(own) = part { Some(&**own) } else { None })
    }

    /// Numbers of steps under error control, or with shorter steps instead of discarded ones.
    pub(super) fn counts(&self) -> Option<StepCounts> {
        self.retry.as_ref().map(|retry| retry.counts).or_else(|| self.controlled().map(|own| own.counts))
    }

    /// The values that the next steps depend on, with the size of the next step under error control.
    pub(super) fn memory(&self) -> (Memory, Option<f64>) {
        (self.exchange.memory.clone(), self.controlled().map(|own| own.wanted))
    }

    pub(super) fn restore(&mut self, (memory, wanted): &(Memory, Option<f64>)) {
        self.exchange.memory.clone_from(memory);
        for part in &mut self.parts {
            if let (Part::Controlled(own), Some(wanted)) = (part, wanted) {
                own.wanted = *wanted;
            }
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

impl Retry {
    /// Makes a step of the run. If a continuous component discards a part of it, all components repeat it up to the time
    /// that this one has reached, else up to the half of it. Then follows the rest of the step.
    fn step(&mut self, parts: &mut [Part], stage: &mut Stage<'_>, whole: Interval) -> Result<Ended, FmusError> {
        let mut at = whole;
        loop {
            self.start.save(stage)?;
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
                if stage.exchange.is_discrete(index) || end - at.time < stage.exchange.simulation.step / 1024.0 {
                    return Err(error);
                }
                self.counts.rejected += 1;
                self.start.restore(stage)?;
                at = Interval { size: end - at.time, end, ..at };
            };
            self.counts.accept(at.size, false);
            if at.end >= whole.end {
                return Ok(ended);
            }
            if let Some((_, error)) = ended {
                return Ok(Some((Reached::Start, error)));
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
            Part::Iterated(own) => own.step(stage, at)?,
            Part::Controlled(own) => own.step(stage, at)?,
        };
        match found {
            None => (),
            at_start @ Some((Reached::Start, _)) => return Ok(at_start),
            at_end => ended = ended.or(at_end),
        }
    }
    Ok(ended)
}

/// Continuous components that depend on each other.
struct Iterated {
    settings: Iteration,
    states: States,
    /// The signals among them, with the values of the last pass.
    signals: Vec<Signal>,
}

impl Iterated {
    fn step(&mut self, stage: &mut Stage<'_>, at: Interval) -> Result<Ended, FmusError> {
        let ended = self.repeat(stage, at);
        stage.exchange.is_repeated = false;
        ended
    }

    fn repeat(&mut self, stage: &mut Stage<'_>, at: Interval) -> Result<Ended, FmusError> {
        self.states.save(stage.signals.members)?;
        let Iteration { tolerance, limit } = self.settings;
        for pass in 1..=limit {
            if pass > 1 {
                self.states.restore(stage.signals.members)?;
                stage.exchange.is_repeated = true;
            }
            for index in &self.states.members {
                if let Some((_, error)) = stage.together(&[*index], at)? {
                    return Ok(Some((Reached::Start, error)));
                }
            }
            let numbers = &stage.signals.bus.numbers;
            let largest = self.signals.iter().map(|signal| signal.change(numbers)).fold(0.0, f64::max);
            if pass > 1 && largest <= tolerance {
                return Ok(None);
            }
            if pass == limit {
                return Err(self.unsettled(stage, largest));
            }
            self.signals.iter_mut().for_each(|signal| signal.value = numbers[signal.slot]);
        }
        Ok(None)
    }

    #[cold]
    fn unsettled(&self, stage: &Stage<'_>, change: f64) -> FmusError {
        let numbers = &stage.signals.bus.numbers;
        let changing = self.signals.iter().filter(|signal| signal.change(numbers) > self.settings.tolerance);
        let name = |signal: &Signal| {
            let members = &stage.signals.members;
            let mut names =
                members.iter().flat_map(|own| own.names.iter().map(move |name| (own.instance.name(), name)));
            let found = names.find(|(_, (slot, _))| *slot == signal.slot);
            found.map_or(String::new(), |(component, (_, name))| format!("`{component}:{name}`"))
        };
        let signals = changing.map(name).collect::<Vec<_>>().join(", ");
        FmusError::Unsettled { signals, change, passes: self.settings.limit }
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
    /// Size of the next step, s.
    wanted: f64,
    counts: StepCounts,
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
            wanted: settings.initial_step.unwrap_or(largest / 16.0).clamp(limits[0], limits[1]),
            counts: StepCounts::default(),
        }
    }

    fn step(&mut self, stage: &mut Stage<'_>, whole: Interval) -> Result<Ended, FmusError> {
        let mut time = whole.time;
        while time < whole.end {
            let left = whole.end - time;
            let size = match self.wanted {
                wanted if wanted >= left * (1.0 - 1e-6) => left,
                wanted if wanted > 0.5 * left => 0.5 * left,
                wanted => wanted,
            };
            let end = if size == left { whole.end } else { time + size };
            let at = Interval { time, size: end - time, end, ..whole };
            // The size is a difference of times, which is rounded.
            let is_smallest = at.size <= self.limits[0] * (1.0 + STEP_SLACK);
            self.start.save(stage)?;
            let error = match self.estimate(stage, at) {
                Ok(Ok(error)) => error,
                Ok(Err(ended)) => return Ok(Some((Reached::Start, ended))),
                Err(FmusError::Unsettled { .. }) if !is_smallest => f64::INFINITY,
                Err(error) if !is_smallest && error.discarded().is_some() => f64::INFINITY,
                Err(failed) => return Err(failed),
            };
            let factor = 0.9 * libm::pow(error, -1.0 / (self.order + 1.0));
            let factor = if error == 0.0 { 2.0 } else { factor.clamp(0.2, 2.0) };
            let is_shortened = at.size < self.wanted;
            let next = factor * at.size;
            if error <= 1.0 || is_smallest {
                self.counts.accept(at.size, error > 1.0);
                time = end;
                self.wanted = if is_shortened && factor >= 1.0 { self.wanted.max(next) } else { next };
            } else {
                self.counts.rejected += 1;
                self.start.restore(stage)?;
                self.wanted = next;
            }
            self.wanted = self.wanted.clamp(self.limits[0], self.limits[1]);
        }
        Ok(None)
    }

    /// Makes one step, then two halves of it, and returns the error relative to the tolerance. `Err` within `Ok`: a
    /// component ends the simulation.
    fn estimate(&mut self, stage: &mut Stage<'_>, at: Interval) -> Result<Result<f64, CallError>, FmusError> {
        stage.begin(at);
        if let Some((_, error)) = pass(&mut self.parts, stage, at)? {
            return Ok(Err(error));
        }
        self.signals.iter_mut().for_each(|signal| signal.value = stage.signals.bus.numbers[signal.slot]);
        self.start.restore(stage)?;
        let middle = at.time + 0.5 * at.size;
        for (time, end) in [(at.time, middle), (middle, at.end)] {
            let half = Interval { time, size: end - time, end, ..at };
            stage.begin(half);
            if let Some((_, error)) = pass(&mut self.parts, stage, half)? {
                return Ok(Err(error));
            }
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
        Ok(Ok(self.signals.iter().map(error).fold(0.0, f64::max)))
    }
}
