//! Runs a stateful model.

use std::marker::PhantomData;
use std::path::Path;

use super::{Context, Kind, Model, Run, Step, Update, check_reals, settable};
use crate::discrete_state::{Word, Words};
use crate::model::{Info, Stateful};
use crate::store::{Counts, ValueStore};
use crate::timeline::Timeline;
use crate::variable::{Declarations, Layout};
use crate::variables::Variables as _;

/// Runs a [`Stateful`] model.
pub struct StatefulModel<M>(PhantomData<M>);

impl<M: Stateful> Model for StatefulModel<M> {
    const INFO: Info = M::INFO;
    const SETTABLE: Counts = settable::<M, M::Inputs, M::Outputs>();
    const KIND: Kind = Kind::Stateful;
    const MODEL_EXCHANGE: bool = false;
    const IS_SERIALIZABLE: bool = M::SERIALIZE.is_some();
    type Parameters = M;
    type Derived = ();
    type RunnerState = M::Simulation;

    fn layout() -> Layout {
        Layout::new(Declarations {
            parameters: M::declarations(),
            sized: M::HAS_STRUCTURE.then_some(Layout::sized_arrays),
            inputs: M::Inputs::declarations(),
            outputs: M::Outputs::declarations(),
            ..Declarations::default()
        })
    }

    fn load(_: &M, _: &Path) -> Result<(), String> {
        Ok(())
    }

    fn init(ctx: Context<'_, Self>, resources: &Path, _: &ValueStore) -> Result<M::Simulation, String> {
        ctx.p.start(resources)
    }

    fn parts(_: &Layout, _: &ValueStore, _: Step) -> f64 {
        1.0
    }

    fn step(Run { ctx, run, values }: Run<'_, Self>, step: Step, _: u64) -> Result<Option<f64>, String> {
        let Context { p, layout, .. } = ctx;
        let inputs = M::Inputs::read(values.view(), layout.inputs.at);
        let before = M::Outputs::read(values.view(), layout.outputs.at);
        p.step(run, &inputs, step.time, step.step)?;
        p.outputs(run).write(&mut values.view_mut(), layout.outputs.at);
        check_reals(layout, layout.outputs, values, step.time + step.step)
            .inspect_err(|_| before.write(&mut values.view_mut(), layout.outputs.at))?;
        Ok(None)
    }

    fn outputs(ctx: Context<'_, Self>, simulation: &M::Simulation, values: &mut ValueStore) {
        ctx.p.outputs(simulation).write(&mut values.view_mut(), ctx.layout.outputs.at);
    }

    fn handle_events(_: Run<'_, Self>, _: &mut Timeline) -> Result<Update, String> {
        unreachable!("neither model exchange nor Event Mode is provided")
    }

    fn save(simulation: &M::Simulation, sink: &mut dyn FnMut(Word<'_>)) -> Result<(), String> {
        let Some(serialize) = &M::SERIALIZE else {
            return Err("the state of this model cannot be serialized".to_owned());
        };
        sink(Word::Bytes(&(serialize.save)(simulation)?));
        Ok(())
    }

    fn restore(simulation: &mut M::Simulation, _: &Layout, source: &mut Words<'_>) -> Result<(), String> {
        let Some(serialize) = &M::SERIALIZE else {
            return Err("the state of this model cannot be serialized".to_owned());
        };
        *simulation = (serialize.load)(source.bytes("simulation")?)?;
        Ok(())
    }
}
