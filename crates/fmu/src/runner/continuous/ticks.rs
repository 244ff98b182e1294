//! Clocks of a continuous-time model.

use std::marker::PhantomData;

use super::{Context, ContinuousModel, Progress, Run, StateOf, Step, check_discrete, check_reals};
use crate::clocks::{self, MOST_AT_ONCE, TickOf, too_often};
use crate::model::Continuous;
use crate::runner::{MOST_PARTS, Model as _};
use crate::store::ValueStore;
use crate::timeline::slack;
use crate::variables::Variables as _;

/// State, discrete state and schedules after ticks.
type Ticked<M> = (<M as Continuous>::State<f64>, <M as Continuous>::DiscreteState, <M as Continuous>::Schedules);

impl<M: Continuous, const MODEL_EXCHANGE: bool, const LINEAR: bool> ContinuousModel<M, MODEL_EXCHANGE, LINEAR> {
    /// Runs the methods of the clocks in the bits of `active`, in their order, at an event at `time`.
    fn tick(
        Context { p, derived, layout, .. }: Context<'_, Self>,
        run: &StateOf<M>,
        values: &ValueStore,
        (active, time): (u64, f64),
    ) -> Result<Ticked<M>, String> {
        let mut continuous = M::State::read(values.view(), layout.states.at);
        let (mut discrete, mut schedules) = (run.discrete.clone(), run.schedules.clone());
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        // First, so that a clock that is started at this event ticks at another one.
        clocks::advance(M::CLOCKS, schedules.as_mut(), layout, values, (active, time));
        for clock in (0..M::CLOCKS.len()).filter(|clock| active >> clock & 1 != 0) {
            let (due, interval) = schedules.as_ref()[clock].present;
            let mut fault = None;
            let tick = TickOf {
                time: due,
                interval,
                state: &mut discrete,
                inputs,
                outputs: &mut (),
                derived,
                continuous: &mut continuous,
                schedules: schedules.as_mut(),
                clocks: M::CLOCKS,
                timers: PhantomData,
                clock,
                event: time,
                fault: &mut fault,
            };
            p.tick(clock, tick);
            if let Some(fault) = fault {
                return Err(fault);
            }
        }
        check_discrete(&discrete, time)?;
        Ok((continuous, discrete, schedules))
    }

    /// Event Mode: the state after the ticks of the active clocks, if there are any. It is not kept: until the end of the
    /// event, every reader evaluates the clocks again, from the state before the event.
    pub(super) fn at_ticks(
        ctx: Context<'_, Self>,
        run: &StateOf<M>,
        values: &ValueStore,
    ) -> Result<Option<Ticked<M>>, String> {
        match clocks::active(ctx.layout, values) {
            0 => Ok(None),
            active => Self::tick(ctx, run, values, (active, ctx.time)).map(Some),
        }
    }

    /// Takes a step in which the clocks tick. If this fails, restores the values, the discrete state and the schedules.
    pub(super) fn step_with_ticks(
        Run { ctx, run, values }: Run<'_, Self>,
        step: Step,
        parts: u64,
    ) -> Result<Option<f64>, String> {
        let before = M::State::read(values.view(), ctx.layout.states.at);
        let inputs =
            (Self::INTERPOLATES && step.has_slopes).then(|| M::Inputs::read(values.view(), ctx.layout.inputs.at));
        let mut progress = Progress::new(step);
        let mut advance = || {
            for _ in 0..parts + MOST_PARTS as u64 {
                let stopped = Self::step_between_ticks(Run { ctx, run, values }, step, parts, &mut progress)?;
                if stopped.is_some() || progress.time >= progress.end {
                    return Ok(stopped);
                }
            }
            Err(too_often(progress.time))
        };
        advance().inspect_err(|_| {
            before.write(&mut values.view_mut(), ctx.layout.states.at);
            inputs.iter().for_each(|inputs| inputs.write(&mut values.view_mut(), ctx.layout.inputs.at));
            Self::undo_events(run);
        })
    }

    /// Lets the clocks tick that are due, unless the importer activates them. Then takes one integrator step, which ends
    /// at the next tick at the latest.
    pub(super) fn step_between_ticks(
        Run { ctx, run, values }: Run<'_, Self>,
        step: Step,
        parts: u64,
        progress: &mut Progress,
    ) -> Result<Option<f64>, String> {
        let (layout, end) = (ctx.layout, progress.end);
        if progress.time <= step.time {
            run.before_events = Some((run.discrete.clone(), run.schedules.clone()));
            clocks::update_intervals(M::CLOCKS, run.schedules.as_mut(), layout, values, ctx.time)?;
        }
        let mut ticks = 0;
        loop {
            let (next, shortest) = clocks::next(run.schedules.as_ref(), step.step);
            // A tick at the end belongs to the next step.
            if step.importer_ticks || next >= end - slack(shortest, end) {
                break;
            }
            if next > progress.time + slack(shortest, progress.time) {
                progress.end = next;
                break;
            }
            ticks += 1;
            if ticks > MOST_AT_ONCE {
                return Err(too_often(next));
            }
            let active = clocks::due(run.schedules.as_ref(), next);
            let (state, discrete, schedules) = Self::tick(ctx, run, values, (active, next))?;
            (run.discrete, run.schedules) = (discrete, schedules);
            state.write(&mut values.view_mut(), layout.states.at);
            check_reals(layout, layout.states, values, next)?;
            // The solution is not smooth at a tick.
            run.proposed = 0.0;
            run.scratch.forget_structure();
        }
        let stopped = Self::advance_or_restore::<true>(Run { ctx, run, values }, step, parts, progress);
        progress.end = end;
        stopped
    }
}
