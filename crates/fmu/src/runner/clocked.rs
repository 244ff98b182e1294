//! Runs a discrete-time model with clocks.

use std::marker::PhantomData;
use std::path::Path;

use super::{Context, Kind, MOST_PARTS, Model, Run, Step, Update, check_discrete, check_reals, layout, settable};
use crate::clocks::{self, Clocked, InputClock, MOST_AT_ONCE, Schedule, TickOf, Timing, too_often};
use crate::definition::SAMPLE_TIME;
use crate::discrete_state::{DiscreteState as _, Word, Words};
use crate::model::{Influence, Info, Sample};
use crate::store::{Counts, ValueStore};
use crate::timeline::{Timeline, slack};
use crate::variable::{Declarations, Layout, declare_clock};
use crate::variables::{Derived as _, Variables as _};

/// Runs a [`Discrete`](crate::Discrete) model with clocks. A model without clocks of its own gets the clock
/// `sample`, which ticks at its sample times.
pub struct ClockedModel<M>(PhantomData<M>);

/// Discrete state and schedules.
pub(super) struct Part<M: Clocked> {
    state: M::State,
    schedules: M::Schedules,
}

impl<M: Clocked> Clone for Part<M> {
    fn clone(&self) -> Self {
        Self { state: self.state.clone(), schedules: self.schedules.clone() }
    }
}

/// State of a run.
pub struct ClockedRun<M: Clocked> {
    part: Part<M>,
    /// In Event Mode, after the active clocks were evaluated: what becomes the state at the end of the event, and the
    /// outputs from before.
    evaluated: Option<(Part<M>, M::Outputs)>,
}

/// A clone has not evaluated the active clocks; its outputs are those of [`Model::restore_outputs`].
impl<M: Clocked> Clone for ClockedRun<M> {
    fn clone(&self) -> Self {
        Self { part: self.part.clone(), evaluated: None }
    }
}

impl<M: Clocked> ClockedRun<M> {
    pub(crate) fn state(&self) -> &M::State {
        &self.part.state
    }
}

impl<M: Clocked> ClockedModel<M> {
    /// Runs the methods of the active clocks, in their order, at an event at `time`. `active` has a bit for each clock.
    fn tick(
        ctx: &Context<'_, Self>,
        part: &mut Part<M>,
        values: &mut ValueStore,
        time: f64,
        active: u64,
    ) -> Result<(), String> {
        // First, so that a clock that is started at this event ticks at another one.
        clocks::advance(Self::CLOCKS, part.schedules.as_mut(), ctx.layout, values, (active, time));
        Self::run_parts(ctx, part, values, time, active)
    }

    /// Runs the methods of the active clocks, whose schedules were moved on.
    fn run_parts(
        ctx: &Context<'_, Self>,
        part: &mut Part<M>,
        values: &mut ValueStore,
        time: f64,
        active: u64,
    ) -> Result<(), String> {
        let Context { p, derived, layout, .. } = *ctx;
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let mut outputs = M::Outputs::read(values.view(), layout.outputs.at);
        for clock in (0..Self::CLOCKS.len()).filter(|clock| active >> clock & 1 != 0) {
            let (due, interval) = part.schedules.as_ref()[clock].present;
            p.check(&Sample { time: due, state: &mut part.state, inputs, derived })?;
            let (schedules, mut fault) = (part.schedules.as_mut(), None);
            let tick = TickOf {
                time: due,
                interval,
                state: &mut part.state,
                inputs,
                outputs: &mut outputs,
                derived,
                continuous: &mut (),
                schedules,
                clocks: Self::CLOCKS,
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
        outputs.write(&mut values.view_mut(), layout.outputs.at);
        check_reals(layout, layout.outputs, values, time)?;
        check_discrete(&part.state, time)
    }

    /// A bit for each output clock that ticks.
    fn fired(layout: &Layout, values: &ValueStore) -> u128 {
        let clocks = layout.output_clocks.iter().enumerate();
        clocks.fold(0, |all, (number, &index)| all | u128::from(values.booleans[index]) << number)
    }

    /// Lets the output clocks in a result of [`Self::fired`] tick.
    fn add_fired(layout: &Layout, values: &mut ValueStore, fired: u128) {
        for (number, &index) in layout.output_clocks.iter().enumerate() {
            values.booleans[index] |= fired >> number & 1 != 0;
        }
    }

    /// Deactivates all output clocks.
    fn clear(layout: &Layout, values: &mut ValueStore) {
        layout.output_clocks.iter().for_each(|&index| values.booleans[index] = false);
    }

    /// Deactivates all clocks.
    fn deactivate(layout: &Layout, values: &mut ValueStore) {
        values.booleans[layout.clocks.booleans()].fill(false);
        Self::clear(layout, values);
    }

    fn run_ticks(run: Run<'_, Self>, end: f64, step: f64) -> Result<Part<M>, String> {
        let Run { ctx, run, values } = run;
        let mut part = run.part.clone();
        clocks::update_intervals(Self::CLOCKS, part.schedules.as_mut(), ctx.layout, values, ctx.time)?;
        let (mut all, mut at_once, mut last) = (0.0, 0, f64::NEG_INFINITY);
        let mut fired = 0;
        loop {
            let (next, shortest) = clocks::next(part.schedules.as_ref(), step);
            if next >= end - slack(shortest, end) {
                Self::add_fired(ctx.layout, values, fired);
                return Ok(part);
            }
            at_once = if next > last { 1 } else { at_once + 1 };
            last = next;
            all += 1.0;
            if at_once > MOST_AT_ONCE || all > MOST_PARTS {
                return Err(too_often(next));
            }
            let active = clocks::due(part.schedules.as_ref(), next);
            // An output clock ticks at one event, although the importer sees that it has ticked in the step.
            Self::clear(ctx.layout, values);
            Self::tick(&ctx, &mut part, values, next, active)?;
            fired |= Self::fired(ctx.layout, values);
        }
    }
}

impl<M: Clocked> Model for ClockedModel<M> {
    const MODEL_EXCHANGE: bool = false;
    const INFO: Info = M::INFO;
    const SETTABLE: Counts = settable::<M, M::Inputs, M::Outputs>();
    const KIND: Kind = Kind::Discrete;
    const HAS_EVENTS: bool = true;
    const SOURCE: Option<Influence> = if M::CLOCKS.is_empty() { M::SOURCE } else { None };
    const FOLLOWS: Influence = M::FOLLOWS;
    const CLOCKS: &'static [InputClock] = if M::CLOCKS.is_empty() { &[clocks::SAMPLE] } else { M::CLOCKS };
    type Parameters = M;
    type Derived = M::Derived;
    type RunnerState = ClockedRun<M>;

    fn layout() -> Layout {
        let mut declared = Declarations {
            parameters: M::declarations(),
            sized: M::HAS_STRUCTURE.then_some(Layout::sized_arrays),
            inputs: M::Inputs::declarations(),
            outputs: M::Outputs::declarations(),
            clocks: Self::CLOCKS.iter().map(declare_clock).collect(),
            ..Declarations::default()
        };
        M::Derived::declare(&mut declared.derived);
        declared.declare_clocked::<M::State>();
        if !M::CLOCKS.is_empty() {
            return Layout::new(declared);
        }
        let variables = declared.inputs.iter_mut().chain(&mut declared.outputs);
        let clocked = variables.filter(|variable| !variable.details.constant);
        clocked.for_each(|variable| variable.details.clocks = &[clocks::SAMPLE.name]);
        let mut layout = layout(declared, Some((SAMPLE_TIME, M::INFO.step_size)));
        // The schedule of the clock counts the samples, not the timeline.
        layout.solver = None;
        layout
    }

    fn load(p: &M, resources: &Path) -> Result<M::Derived, String> {
        p.load(resources)
    }

    fn fingerprint(derived: &M::Derived) -> u64 {
        M::fingerprint(derived)
    }

    fn init(ctx: Context<'_, Self>, _: &Path, values: &ValueStore) -> Result<ClockedRun<M>, String> {
        let schedules = clocks::first(Self::CLOCKS, ctx.layout, values, ctx.time)?;
        Ok(ClockedRun { part: Part { state: ctx.p.initial_state(ctx.derived), schedules }, evaluated: None })
    }

    fn parts(_: &Layout, _: &ValueStore, _: Step) -> f64 {
        0.0
    }

    fn activate(Run { ctx, run, values }: Run<'_, Self>, clock: usize, time: f64) -> Result<bool, String> {
        Self::update_intervals(Run { ctx, run: &mut *run, values: &mut *values })?;
        let mut part = run.part.clone();
        part.schedules.as_mut()[clock].activate(&clocks::present(Self::CLOCKS, clock, ctx.layout, values), time)?;
        let before = M::Outputs::read(values.view(), ctx.layout.outputs.at);
        // Ticks of output clocks that the importer has not asked for.
        let unread = Self::fired(ctx.layout, values);
        Self::clear(ctx.layout, values);
        Self::run_parts(&ctx, &mut part, values, time, 1 << clock)
            .inspect_err(|_| before.write(&mut values.view_mut(), ctx.layout.outputs.at))?;
        let fired = Self::fired(ctx.layout, values);
        Self::add_fired(ctx.layout, values, unread);
        let mut schedules = part.schedules.as_ref().iter().zip(run.part.schedules.as_ref()).zip(Self::CLOCKS);
        let is_started = schedules.any(|((now, before), clock)| {
            matches!(clock.timing, Timing::Countdown(_)) && now.is_new && now.next.is_finite() && now != before
        });
        run.part = part;
        Ok(fired != 0 || is_started)
    }

    fn step(Run { ctx, run, values }: Run<'_, Self>, step: Step, _: u64) -> Result<Option<f64>, String> {
        Self::clear(ctx.layout, values);
        if step.importer_ticks {
            return Ok(None);
        }
        let before = M::Outputs::read(values.view(), ctx.layout.outputs.at);
        let part = Self::run_ticks(Run { ctx, run, values }, step.time + step.step, step.step)
            .inspect_err(|_| before.write(&mut values.view_mut(), ctx.layout.outputs.at))?;
        run.part = part;
        Ok(None)
    }

    fn outputs(Context { p, derived, layout, time }: Context<'_, Self>, run: &ClockedRun<M>, values: &mut ValueStore) {
        let now = run.evaluated.as_ref().map_or(&run.part, |(part, _)| part);
        // Until its first sample, a source has outputs that follow from its parameters.
        if Self::SOURCE.is_some() && now.schedules.as_ref()[0].count == 0 {
            let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
            p.start(time, derived, inputs).write(&mut values.view_mut(), layout.outputs.at);
        }
        now.state.write(&mut values.view_mut(), layout.clocked.at);
        run.part.state.write(&mut values.view_mut(), layout.previous.at);
    }

    fn schedules(run: &mut ClockedRun<M>) -> &mut [Schedule] {
        run.part.schedules.as_mut()
    }

    fn evaluate_clocks(Run { ctx, run, values }: Run<'_, Self>) -> Result<(), String> {
        let active = clocks::active(ctx.layout, values);
        if run.evaluated.is_some() || active == 0 {
            return Ok(());
        }
        let before = M::Outputs::read(values.view(), ctx.layout.outputs.at);
        Self::clear(ctx.layout, values);
        let mut part = run.part.clone();
        Self::tick(&ctx, &mut part, values, ctx.time, active)
            .inspect_err(|_| before.write(&mut values.view_mut(), ctx.layout.outputs.at))?;
        run.evaluated = Some((part, before));
        Ok(())
    }

    fn restore_outputs(run: &ClockedRun<M>, layout: &Layout, values: &mut ValueStore) {
        if let Some((_, before)) = &run.evaluated {
            before.write(&mut values.view_mut(), layout.outputs.at);
        }
    }

    fn forget_evaluation(run: &mut ClockedRun<M>) {
        run.evaluated = None;
    }

    fn handle_events(Run { ctx, run, values }: Run<'_, Self>, _: &mut Timeline) -> Result<Update, String> {
        Self::evaluate_clocks(Run { ctx, run, values })?;
        let part = run.evaluated.as_mut().map_or(&mut run.part, |(part, _)| part);
        clocks::update_intervals(Self::CLOCKS, part.schedules.as_mut(), ctx.layout, values, ctx.time)?;
        if let Some((part, _)) = run.evaluated.take() {
            run.part = part;
        }
        Self::deactivate(ctx.layout, values);
        Ok(Update { states_changed: false, next_event_time: None })
    }

    fn save(run: &ClockedRun<M>, sink: &mut dyn FnMut(Word<'_>)) -> Result<(), String> {
        run.part.state.save(sink);
        clocks::save(run.part.schedules.as_ref(), sink);
        Ok(())
    }

    fn restore(run: &mut ClockedRun<M>, _: &Layout, source: &mut Words<'_>) -> Result<(), String> {
        run.part.state.load(source)?;
        clocks::restore(run.part.schedules.as_mut(), source)
    }

    fn not_finite(run: &ClockedRun<M>) -> Option<(&'static str, f64)> {
        run.part.state.not_finite()
    }
}
