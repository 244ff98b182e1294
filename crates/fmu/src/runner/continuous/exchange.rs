//! Data of a continuous-time model in model exchange, and evaluation of its equations with relations.

use super::{Context, ContinuousModel};
use crate::discrete_state::{Word, Words};
use crate::model::{At, Continuous};
use crate::relation::{Relational, Relations};
use crate::store::{Counts, ValueStore, Values, ValuesMut};
use crate::variable::Layout;
use crate::variables::Variables as _;

#[derive(Clone, Debug)]
pub(super) struct Exchange {
    pub(super) relations: Relations,
    /// Index of the first relation in the outputs.
    outputs: usize,
    /// Change of each declared zero crossing if states and inputs change by their nominal values.
    pub(super) scales: Box<[f64]>,
    /// Time in s up to which time events have been handled.
    pub(super) handled: f64,
    /// Time in s of the next time event, as announced to the importer; infinite if there is none.
    pub(super) announced: f64,
    /// Real inputs, then states.
    pub(super) known: Box<[Relational]>,
    /// Results of [`ContinuousModel::eval`].
    pub(super) unknown: Box<[Relational]>,
    /// Memory for outputs of other types, which are discrete and keep their values between events.
    others: ValueStore,
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
            others: if layout.outputs.has_others() { ValueStore::start(layout) } else { ValueStore::default() },
        }
    }

    pub(super) fn read(&mut self, layout: &Layout, values: &ValueStore) {
        let indices = layout.inputs.reals().chain(layout.states.reals());
        for (known, index) in self.known.iter_mut().zip(indices) {
            *known = Relational(values.reals[index]);
        }
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

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Derivatives,
    Outputs,
}

/// Sides of the relations in an evaluation: set from the present values, or kept.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sides {
    Update,
    Keep,
}

impl<M: Continuous, const MODEL_EXCHANGE: bool, const LINEAR: bool> ContinuousModel<M, MODEL_EXCHANGE, LINEAR> {
    pub(super) fn crossings_at(
        Context { p, derived, layout, time }: Context<'_, Self>,
        discrete: &M::DiscreteState,
        values: &ValueStore,
    ) -> M::Crossings {
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let state = &M::State::read(values.view(), layout.states.at);
        p.zero_crossings(At { time, state, inputs, derived, discrete })
    }

    /// Evaluates the derivatives or the outputs. Reads `known` and writes `unknown`.
    pub(super) fn eval(
        Context { p, derived, layout, time }: Context<'_, Self>,
        exchange: &mut Exchange,
        discrete: &M::DiscreteState,
        values: &ValueStore,
        part: Part,
        sides: Sides,
    ) {
        let Exchange { relations, outputs, known, unknown, others, .. } = exchange;
        let (inputs, states) = known.split_at(layout.inputs.counts.reals);
        let at = Counts { reals: 0, ..layout.inputs.at };
        let inputs = &M::Inputs::read(values.with_reals(inputs), at);
        let state = &M::State::read(Values::of_states(states, &values.lengths), Counts::ZERO);
        let at = At { time: Relational(time), state, inputs, derived, discrete };
        let first = if part == Part::Derivatives { 0 } else { *outputs };
        let equations = || match part {
            Part::Derivatives => p.derivatives(at).write(&mut ValuesMut::of_reals(unknown), Counts::ZERO),
            Part::Outputs => {
                let position = Counts { reals: 0, ..layout.outputs.at };
                let ValueStore { words, booleans, strings, binaries, .. } = others;
                p.outputs(at).write(
                    &mut ValuesMut { reals: unknown, words, booleans, strings, binaries, lengths: () },
                    position,
                );
            }
        };
        match sides {
            Sides::Update => relations.update(first, equations),
            Sides::Keep => relations.frozen(first, equations),
        }
    }

    /// Evaluates the derivatives and the outputs to update their relations.
    pub(super) fn eval_all(
        ctx: Context<'_, Self>,
        exchange: &mut Exchange,
        discrete: &M::DiscreteState,
        values: &ValueStore,
        sides: Sides,
    ) {
        Self::eval(ctx, exchange, discrete, values, Part::Derivatives, sides);
        if sides == Sides::Update {
            exchange.outputs = exchange.relations.count();
        }
        Self::eval(ctx, exchange, discrete, values, Part::Outputs, sides);
    }
}
