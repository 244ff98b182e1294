//! Runs a discrete-time model.

use std::marker::PhantomData;
use std::path::Path;

use super::{Context, Kind, MOST_PARTS, Model, Run, Step, Update, check_discrete, check_reals, layout, settable};
use crate::definition::SAMPLE_TIME;
use crate::discrete_state::{DiscreteState as _, Word, Words};
use crate::model::{Discrete, Influence, Info, Sample};
use crate::store::{Counts, ValueStore};
use crate::timeline::{Timeline, samples_due, slack};
use crate::variable::{Declarations, Layout};
use crate::variables::{Derived as _, Variables as _};

/// Runs a [`Discrete`] model, with or without model exchange.
pub struct DiscreteModel<M, const MODEL_EXCHANGE: bool = true>(PhantomData<M>);

#[inline]
fn sample_time(layout: &Layout, values: &ValueStore) -> f64 {
    layout.solver.map_or(f64::INFINITY, |index| values.reals[index])
}

impl<M: Discrete, const MODEL_EXCHANGE: bool> DiscreteModel<M, MODEL_EXCHANGE> {
    /// Takes one sample. Not inlined: a step usually has one sample, and the compiler would compute and store
    /// loop-invariant values before the loop.
    #[inline(never)]
    fn sample(ctx: &Context<'_, Self>, state: &mut M::State, values: &mut ValueStore, time: f64) -> Result<(), String> {
        let Context { p, derived, layout, .. } = *ctx;
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        p.check(&Sample { time, state, inputs, derived })?;
        let outputs = p.update(Sample { time, state, inputs, derived });
        outputs.write(&mut values.view_mut(), layout.outputs.at);
        check_reals(layout, layout.outputs, values, time)?;
        check_discrete(state, time)
    }
}

impl<M: Discrete, const MODEL_EXCHANGE: bool> Model for DiscreteModel<M, MODEL_EXCHANGE> {
    const MODEL_EXCHANGE: bool = MODEL_EXCHANGE;
    const INFO: Info = M::INFO;
    const SETTABLE: Counts = settable::<M, M::Inputs, M::Outputs>();
    const KIND: Kind = Kind::Discrete;
    const SOURCE: Option<Influence> = M::SOURCE;
    const FOLLOWS: Influence = M::FOLLOWS;
    type Parameters = M;
    type Derived = M::Derived;
    type RunnerState = M::State;

    fn layout() -> Layout {
        const { assert!(M::State::NAMES.is_empty(), "no clock for `#[var(clock = …)]`") };
        let mut declared = Declarations {
            parameters: M::declarations(),
            sized: M::HAS_STRUCTURE.then_some(Layout::sized_arrays),
            inputs: M::Inputs::declarations(),
            outputs: M::Outputs::declarations(),
            ..Declarations::default()
        };
        M::Derived::declare(&mut declared.derived);
        layout(declared, Some((SAMPLE_TIME, M::INFO.step_size)))
    }

    fn load(p: &M, resources: &Path) -> Result<M::Derived, String> {
        p.load(resources)
    }

    fn fingerprint(derived: &M::Derived) -> u64 {
        M::fingerprint(derived)
    }

    fn init(ctx: Context<'_, Self>, _: &Path, _: &ValueStore) -> Result<M::State, String> {
        Ok(ctx.p.initial_state(ctx.derived))
    }

    fn parts(layout: &Layout, values: &ValueStore, step: Step) -> f64 {
        samples_due(step.time + step.step, step.start, sample_time(layout, values), step.step, step.sample)
    }

    fn step(Run { ctx, run, values }: Run<'_, Self>, step: Step, parts: u64) -> Result<Option<f64>, String> {
        if parts == 0 {
            return Ok(None);
        }
        let layout = ctx.layout;
        let before = M::Outputs::read(values.view(), layout.outputs.at);
        let period = sample_time(layout, values);
        let mut samples = || {
            for sample in step.sample..step.sample + parts {
                let time = step.start + sample as i64 as f64 * period;
                Self::sample(&ctx, run, values, time)?;
            }
            Ok(None)
        };
        samples().inspect_err(|_| before.write(&mut values.view_mut(), layout.outputs.at))
    }

    fn outputs(ctx: Context<'_, Self>, _: &M::State, values: &mut ValueStore) {
        if M::SOURCE.is_none() {
            return; // removes the code below from the library
        }
        let Context { p, derived, layout, time } = ctx;
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        p.start(time, derived, inputs).write(&mut values.view_mut(), layout.outputs.at);
    }

    fn handle_events(Run { ctx, run, values }: Run<'_, Self>, timeline: &mut Timeline) -> Result<Update, String> {
        let layout = ctx.layout;
        let period = sample_time(layout, values);
        let instant = |sample: u64| timeline.start + sample as i64 as f64 * period;
        let end = timeline.time + slack(period.min(1.0), timeline.time);
        let due = if instant(timeline.sample) <= end { ((end - timeline.start) / period).floor() + 1.0 } else { 0.0 };
        if due - timeline.sample as f64 > MOST_PARTS {
            let message = format!("more than {MOST_PARTS} samples up to {} s", timeline.time);
            return Err(message);
        }
        let before = M::Outputs::read(values.view(), layout.outputs.at);
        let mut new = run.clone();
        let mut next = timeline.sample;
        while instant(next) <= end {
            Self::sample(&ctx, &mut new, values, instant(next))
                .inspect_err(|_| before.write(&mut values.view_mut(), layout.outputs.at))?;
            next += 1;
        }
        let next_event_time = Some(instant(next)).filter(|time| time.is_finite());
        *run = new;
        timeline.sample = next;
        Ok(Update { states_changed: false, next_event_time })
    }

    fn save(state: &M::State, sink: &mut dyn FnMut(Word<'_>)) -> Result<(), String> {
        state.save(sink);
        Ok(())
    }

    fn restore(state: &mut M::State, _: &Layout, source: &mut Words<'_>) -> Result<(), String> {
        state.load(source)
    }

    fn not_finite(state: &M::State) -> Option<(&'static str, f64)> {
        state.not_finite()
    }
}
