//! Model exchange of a continuous-time model: frozen relations, event indicators, and events at the times that the importer
//! finds.

use super::continuous::{ContinuousModel, MOST_EVENTS, Memory};
use super::{StepError, Update, first_not_finite};
use crate::clock::slack;
use crate::discrete_state::{DiscreteState as _, Word, Words};
use crate::model::{At, Continuous, Event, is_crossing};
use crate::relation::{PROBE, Relational, Relations, indicator_of};
use crate::store::ValueStore;
use crate::variable::{Kind, Layout};
use crate::variables::{Counts, Values, ValuesMut, Variables as _};

/// Data of a continuous-time model for model exchange, besides its variables.
#[derive(Clone, Debug)]
pub(super) struct Exchange {
    relations: Relations,
    /// Number of the first relation of the outputs.
    outputs: usize,
    /// Change of each declared zero crossing that belongs to the nominal values.
    scales: Box<[f64]>,
    /// Time up to which time events were handled in s.
    pub(super) handled: f64,
    /// Time of the next time event as announced to the importer in s; infinite if there is none.
    pub(super) announced: f64,
    /// Inputs and states, then the values computed from them, as numbers of the equations.
    known: Box<[Relational]>,
    unknown: Box<[Relational]>,
}

impl Exchange {
    pub(super) fn new(layout: &Layout, start: f64) -> Self {
        let numbers = |count: usize| vec![Relational::default(); count].into_boxed_slice();
        let (inputs, outputs, states) =
            (layout.inputs.counts.reals, layout.outputs.counts.reals, layout.states.counts.reals);
        Self {
            relations: Relations::with_capacity(layout.indicators.relations),
            outputs: 0,
            scales: vec![1.0; layout.indicators.declared].into(),
            handled: start,
            announced: f64::INFINITY,
            known: numbers(inputs + states),
            unknown: numbers(outputs.max(states)),
        }
    }

    /// Runs both functions of the model, derivatives first, with the relations as they were settled.
    pub(super) fn frozen<R>(&mut self, equations: impl FnOnce() -> R) -> R {
        self.relations.frozen(0, equations)
    }

    pub(super) fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        sink(Word::Real(self.handled));
        sink(Word::Real(self.announced));
        self.relations.save(sink);
        sink(Word::Whole(self.outputs as u64));
        self.scales.iter().for_each(|&scale| sink(Word::Real(scale)));
    }

    pub(super) fn restore(&mut self, source: &mut Words<'_>) -> Result<(), String> {
        self.handled = source.real("time of the events")?;
        if !self.handled.is_finite() {
            return Err(format!("the time of the events must be finite, got {}", self.handled));
        }
        self.announced = source.real("time of the next event")?;
        if self.announced.is_nan() {
            return Err("the time of the next event must be a number, got NaN".to_owned());
        }
        self.relations.restore(source)?;
        self.outputs = usize::try_from(source.whole("number of relations")?).map_err(|e| e.to_string())?;
        for scale in &mut self.scales {
            *scale = source.real("scale of a zero crossing")?;
            if !(*scale > 0.0 && scale.is_finite()) {
                return Err(format!("the scale of a zero crossing must be above 0, got {scale}"));
            }
        }
        Ok(())
    }
}

/// Time of the next time event in s.
///
/// # Errors
/// It is before the present time, or not a number.
pub(super) fn next_time_event<M: Continuous>(model: &M, at: At<'_, f64, M>) -> Result<Option<f64>, StepError> {
    let next = model.next_time_event(at);
    if let Some(next) = next.filter(|next| next.is_nan() || *next < at.time) {
        return Err(StepError::Rejected(format!(
            "`next_time_event` must not return a time before the present one, {} s, got {next} s; count from the start \
             (`initial_discrete_state` knows it) or from the last event",
            at.time
        )));
    }
    Ok(next)
}

/// Error of time events that repeat without end at one time.
pub(super) fn too_many_at(time: f64) -> StepError {
    StepError::Rejected(format!(
        "more than {MOST_EVENTS} time events at {time} s; `on_event` must change what `next_time_event` returns"
    ))
}

/// One of the two functions of a model.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Part {
    Derivatives,
    Outputs,
}

/// Treatment of the relations: they take the sides of the values or keep theirs.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Sides {
    Update,
    Keep,
}

/// The equations of a model at one time.
struct Equations<'a, M: Continuous> {
    p: &'a M,
    derived: &'a M::Derived,
    layout: &'a Layout,
    time: f64,
}

impl<M: Continuous> Equations<'_, M> {
    /// Takes inputs and states from the values.
    fn read(&self, exchange: &mut Exchange, values: &ValueStore) {
        let indices = self.layout.inputs.reals().chain(self.layout.states.reals());
        for (known, index) in exchange.known.iter_mut().zip(indices) {
            *known = Relational(values.reals[index]);
        }
    }

    /// Evaluates one function for the known values, into the unknown ones.
    fn run(&self, exchange: &mut Exchange, discrete: &M::DiscreteState, values: &ValueStore, part: Part, sides: Sides) {
        let Self { p, derived, layout, time } = *self;
        let Exchange { relations, outputs, known, unknown, .. } = exchange;
        let (inputs, states) = known.split_at(layout.inputs.counts.reals);
        let at = Counts { reals: 0, ..layout.inputs.at };
        let inputs = &M::Inputs::read(Values { reals: inputs, ..values.others() }, at);
        let state = &M::State::read(Values::of_reals(states), Counts::ZERO);
        let at = At { time: Relational(time), state, inputs, derived, discrete };
        let first = if part == Part::Derivatives { 0 } else { *outputs };
        let equations = || match part {
            Part::Derivatives => p.derivatives(at).write(&mut ValuesMut::of_reals(unknown), Counts::ZERO),
            Part::Outputs => {
                let position = Counts { reals: 0, ..layout.outputs.at };
                let outputs = p.outputs(at);
                if layout.outputs.has_others() {
                    // They are discrete: between events they keep their values.
                    let ValueStore { mut integers, mut booleans, mut strings, .. } = values.clone();
                    let (integers, booleans, strings) = (&mut integers, &mut booleans, &mut strings);
                    outputs.write(&mut ValuesMut { reals: unknown, integers, booleans, strings }, position);
                } else {
                    outputs.write(&mut ValuesMut::of_reals(unknown), position);
                }
            }
        };
        match sides {
            Sides::Update => relations.update(first, equations),
            Sides::Keep => relations.frozen(first, equations),
        }
    }

    /// Evaluates both functions, for their relations.
    fn run_all(&self, exchange: &mut Exchange, discrete: &M::DiscreteState, values: &ValueStore, sides: Sides) {
        self.run(exchange, discrete, values, Part::Derivatives, sides);
        if sides == Sides::Update {
            exchange.outputs = exchange.relations.count();
        }
        self.run(exchange, discrete, values, Part::Outputs, sides);
    }
}

impl<M: Continuous, const MODEL_EXCHANGE: bool> ContinuousModel<M, MODEL_EXCHANGE> {
    /// Number of relations in the equations at these values.
    pub(super) fn relations(
        p: &M,
        derived: &M::Derived,
        memory: &Memory<M::DiscreteState>,
        layout: &Layout,
        values: &ValueStore,
    ) -> usize {
        let mut exchange = Exchange::new(layout, 0.0);
        let equations = Equations { p, derived, layout, time: 0.0 };
        equations.read(&mut exchange, values);
        equations.run_all(&mut exchange, &memory.discrete, values, Sides::Update);
        exchange.relations.count()
    }

    /// Sets every relation to the side of the present values, and the scale of every indicator.
    pub(super) fn take_sides(
        p: &M,
        derived: &M::Derived,
        memory: &mut Memory<M::DiscreteState>,
        layout: &Layout,
        values: &ValueStore,
        time: f64,
    ) {
        let Memory { discrete, exchange, crossings, .. } = memory;
        let exchange = exchange.get_or_insert_with(|| Exchange::new(layout, time).into());
        let equations = Equations { p, derived, layout, time };
        equations.read(exchange, values);
        if layout.indicators.relations > 0 {
            equations.run_all(exchange, discrete, values, Sides::Update);
            exchange.relations.begin_scales();
            for (number, index) in layout.inputs.reals().chain(layout.states.reals()).enumerate() {
                let value = exchange.known[number];
                exchange.known[number] = Relational(value.0 + PROBE * nominal(layout, index));
                equations.run_all(exchange, discrete, values, Sides::Keep);
                exchange.relations.add_to_scales();
                exchange.known[number] = value;
            }
            exchange.relations.end_scales();
        }
        if !crossings.is_empty() {
            let base = Self::crossings_at(p, derived, discrete, layout, values, time);
            let mut changed = values.clone();
            exchange.scales.fill(0.0);
            for index in layout.inputs.reals().chain(layout.states.reals()) {
                changed.reals[index] += PROBE * nominal(layout, index);
                let here = Self::crossings_at(p, derived, discrete, layout, &changed, time);
                for ((scale, here), base) in exchange.scales.iter_mut().zip(here.as_ref()).zip(base.as_ref()) {
                    let change = (here - base).abs() / PROBE;
                    *scale += if change.is_finite() { change } else { 0.0 };
                }
                changed.reals[index] = values.reals[index];
            }
            for scale in exchange.scales.iter_mut().filter(|scale| !(**scale > 0.0 && scale.is_finite())) {
                *scale = 1.0;
            }
        }
    }

    fn crossings_at(
        p: &M,
        derived: &M::Derived,
        discrete: &M::DiscreteState,
        layout: &Layout,
        values: &ValueStore,
        time: f64,
    ) -> M::Crossings {
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let state = &M::State::read(values.view(), layout.states.at);
        p.zero_crossings(At { time, state, inputs, derived, discrete })
    }

    /// Derivatives or outputs with the relations as they were at the last event.
    pub(super) fn evaluate_frozen(
        p: &M,
        derived: &M::Derived,
        memory: &mut Memory<M::DiscreteState>,
        layout: &Layout,
        values: &mut ValueStore,
        time: f64,
        outputs: bool,
    ) {
        if memory.exchange.is_none() {
            Self::take_sides(p, derived, memory, layout, values, time);
        }
        let Memory { discrete, exchange, .. } = memory;
        let Some(exchange) = exchange else { unreachable!("made above") };
        let equations = Equations { p, derived, layout, time };
        equations.read(exchange, values);
        let (part, range) = if outputs {
            (Part::Outputs, layout.outputs.reals())
        } else {
            (Part::Derivatives, layout.derivatives.reals())
        };
        equations.run(exchange, discrete, values, part, Sides::Keep);
        for (value, result) in values.reals[range].iter_mut().zip(&exchange.unknown) {
            *value = result.0;
        }
    }

    /// The event indicators: the declared zero crossings, then the relations.
    pub(super) fn indicators(
        p: &M,
        derived: &M::Derived,
        memory: &mut Memory<M::DiscreteState>,
        layout: &Layout,
        values: &ValueStore,
        time: f64,
        result: &mut [f64],
    ) {
        if memory.exchange.is_none() {
            Self::take_sides(p, derived, memory, layout, values, time);
        }
        let Memory { discrete, exchange, crossings, .. } = memory;
        let Some(exchange) = exchange else { unreachable!("made above") };
        let (declared, relations) = result.split_at_mut(layout.indicators.declared);
        if !declared.is_empty() {
            let now = Self::crossings_at(p, derived, discrete, layout, values, time);
            let before = crossings.iter().zip(&exchange.scales);
            for ((indicator, now), (before, scale)) in declared.iter_mut().zip(now.as_ref()).zip(before) {
                *indicator = indicator_of(*now, *scale, *before >= 0.0);
            }
        }
        if !relations.is_empty() {
            let equations = Equations { p, derived, layout, time };
            equations.read(exchange, values);
            equations.run_all(exchange, discrete, values, Sides::Keep);
            exchange.relations.indicators(relations);
        }
    }

    /// Handles the events of the present time: first zero crossings, then time events, in the order of co-simulation.
    pub(super) fn events(
        p: &M,
        derived: &M::Derived,
        memory: &mut Memory<M::DiscreteState>,
        layout: &Layout,
        values: &mut ValueStore,
        time: f64,
    ) -> Result<Update, StepError> {
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let before = M::State::read(values.view(), layout.states.at);
        let exchange = memory.exchange.get_or_insert_with(|| Exchange::new(layout, time).into());
        let mut handled = exchange.handled;
        let mut discrete = memory.discrete.clone();
        let mut x = M::State::read(values.view(), layout.states.at);
        let event =
            |x: &mut M::State<f64>, discrete: &mut M::DiscreteState, before: &[f64], after: &[f64], is_timed| {
                p.on_event(Event { time, state: x, discrete, inputs, derived, is_timed, before, after });
                match discrete.not_finite() {
                    Some((name, value)) => Err(StepError::StateNotFinite { name, value, time }),
                    None => Ok(()),
                }
            };
        if layout.indicators.declared > 0 {
            let now = p.zero_crossings(At { time, state: &x, inputs, derived, discrete: &discrete });
            let mut pairs = memory.crossings.iter().zip(now.as_ref());
            if pairs.any(|(before, now)| is_crossing(*before, *now)) {
                event(&mut x, &mut discrete, &memory.crossings, now.as_ref(), false)?;
            }
        }
        let mut next = None;
        if M::HAS_TIME_EVENTS {
            let is_due = |next: f64| next <= time + slack(0.0, time);
            // An importer may handle the announced event late. No other event was due up to now.
            if !is_due(exchange.announced) {
                handled = handled.max(time);
            }
            let mut events = 0;
            loop {
                let at = At { time: handled, state: &x, inputs, derived, discrete: &discrete };
                next = next_time_event(p, at)?;
                if let Some(due) = next.filter(|next| is_due(*next)) {
                    handled = due;
                    events += 1;
                    if events > MOST_EVENTS {
                        return Err(too_many_at(time));
                    }
                    event(&mut x, &mut discrete, &[], &[], true)?;
                } else if handled < time {
                    handled = time;
                } else {
                    break;
                }
            }
        }
        x.write(&mut values.view_mut(), layout.states.at);
        first_not_finite(&values.reals, layout.states.reals(), time)
            .inspect_err(|_| before.write(&mut values.view_mut(), layout.states.at))?;
        if layout.indicators.declared > 0 {
            let now = p.zero_crossings(At { time, state: &x, inputs, derived, discrete: &discrete });
            memory.crossings.clear();
            memory.crossings.extend_from_slice(now.as_ref());
        }
        memory.discrete = discrete;
        if let Some(exchange) = &mut memory.exchange {
            exchange.handled = handled;
            exchange.announced = next.unwrap_or(f64::INFINITY);
        }
        let mut states_changed = false;
        let mut old = vec![0.0; layout.states.counts.reals];
        before.write(&mut ValuesMut::of_reals(&mut old), Counts::ZERO);
        for (old, new) in old.iter().zip(&values.reals[layout.states.reals()]) {
            states_changed |= old.to_bits() != new.to_bits();
        }
        Ok(Update { states_changed, next_event_time: next })
    }
}

/// Nominal value of a real variable.
fn nominal(layout: &Layout, index: usize) -> f64 {
    match &layout.real(index).declaration.kind {
        Kind::Real(real) => real.nominal.unwrap_or(1.0),
        _ => 1.0,
    }
}
