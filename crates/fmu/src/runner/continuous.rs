//! Runs a continuous-time model.

mod exchange;
mod integration;
mod ticks;

use std::marker::PhantomData;
use std::path::Path;

use fmu_math::sparse::Structure;

use exchange::{Exchange, Part, Sides};
use integration::{MOST_EVENTS, has_error_control, has_events, next_time_event, too_many_at};

use super::{
    Context, Kind, Model, Modes, Progress, Run, Step, Update, are_finite, check_discrete, check_reals, layout, settable,
};
use crate::clocks::{self, InputClock, Schedule};
use crate::definition::{MAX_STEP, TOLERANCE};
use crate::discrete_state::{DiscreteState, Word, Words};
use crate::dual::{Dual, Dual64};
use crate::expression::{self, Expression};
use crate::model::{At, Continuous, Event, Info, Solver, is_crossing};
use crate::number::Number as _;
use crate::relation::{PROBE, Relational, indicator_of};
use crate::scalar::{Dependencies, Scalar};
use crate::solver::{InPlace, OnHeap, Problem, Scratch, is_in_place};
use crate::store::{Counts, ValueStore, Values, ValuesMut};
use crate::timeline::{Timeline, slack};
use crate::variable::{Declarations, Kind as Type, Layout, Role, declare_clock};
use crate::variables::{Derived as _, Variables as _};

/// Runs a [`Continuous`] model, with or without model exchange.
///
/// With `LINEAR`, inputs can be linear in time during a step.
pub struct ContinuousModel<M, const MODEL_EXCHANGE: bool = true, const LINEAR: bool = true>(PhantomData<M>);

/// State of a run: discrete state, solver and events. `clone` leaves the solver's working memory empty; `clone_from`
/// keeps the working memory of the target.
pub struct RunnerState<D, S> {
    discrete: D,
    /// Schedules of the clocks.
    schedules: S,
    /// Next step in s proposed by a solver with error control; 0 before the first step.
    proposed: f64,
    /// Values of the declared zero crossings at the start or at the end of the last step.
    crossings: Vec<f64>,
    scratch: Scratch,
    /// Created at the first event that the importer handles.
    exchange: Option<Box<Exchange>>,
    /// The discrete state and the schedules before the first event in a step, restored if the step fails.
    before_events: Option<(D, S)>,
}

type StateOf<M> = RunnerState<<M as Continuous>::DiscreteState, <M as Continuous>::Schedules>;

impl<D: Clone, S: Clone> Clone for RunnerState<D, S> {
    fn clone(&self) -> Self {
        Self {
            discrete: self.discrete.clone(),
            schedules: self.schedules.clone(),
            proposed: self.proposed,
            crossings: self.crossings.clone(),
            scratch: Scratch::default(),
            exchange: self.exchange.clone(),
            before_events: self.before_events.clone(),
        }
    }

    fn clone_from(&mut self, source: &Self) {
        let scratch = std::mem::take(&mut self.scratch);
        *self = Self { scratch, ..source.clone() };
    }
}

const fn is_stiff<M: Continuous>() -> bool {
    matches!(M::SOLVER, Solver::Rosenbrock { .. })
}

/// Hash of the values that equations may branch on: parameters, inputs that are not real, discrete state.
fn branches<D: DiscreteState>(layout: &Layout, values: &ValueStore, discrete: &D) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |word: u64| hash = (hash ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
    values.reals[layout.parameters.reals()].iter().for_each(|value| add(value.to_bits()));
    values.words.iter().for_each(|&value| add(value));
    values.booleans.iter().for_each(|&value| add(value.into()));
    let mut add_bytes = |bytes: &[u8]| {
        add(bytes.len() as u64);
        bytes.iter().for_each(|&byte| add(byte.into()));
    };
    values.strings.iter().for_each(|value| add_bytes(value.as_bytes()));
    values.binaries.iter().for_each(|value| add_bytes(value));
    discrete.save(&mut |word| match word {
        Word::Real(value) => add_bytes(&value.to_bits().to_ne_bytes()),
        Word::Whole(value) | Word::Choice(value) => add_bytes(&value.to_ne_bytes()),
        Word::Bytes(bytes) => add_bytes(bytes),
    });
    hash
}

/// Position of a real input or state in the list of real inputs and states.
fn number(layout: &Layout, index: usize) -> usize {
    let (inputs, states) = (layout.inputs.reals(), layout.states.reals());
    if inputs.contains(&index) { index - inputs.start } else { inputs.len() + index - states.start }
}

impl<M: Continuous, const MODEL_EXCHANGE: bool, const LINEAR: bool> ContinuousModel<M, MODEL_EXCHANGE, LINEAR> {
    /// Evaluates real outputs, then state derivatives, for numbers of type `T`: the time, and inputs and states, which
    /// `real` returns by index. Values of other types are read from and written to `others`.
    fn unknowns<T: Scalar>(
        Context { p, derived, layout, .. }: Context<'_, Self>,
        discrete: &M::DiscreteState,
        others: &mut ValueStore,
        time: T,
        real: impl Fn(usize) -> T,
    ) -> Vec<T> {
        let [inputs, states] =
            [&layout.inputs, &layout.states].map(|block| block.reals().map(&real).collect::<Vec<_>>());
        let at = Counts { reals: 0, ..layout.inputs.at };
        let inputs = &M::Inputs::read(others.with_reals(&inputs), at);
        let state = &M::State::read(Values::of_states(&states, &others.lengths), Counts::ZERO);
        let at = At { time, state, inputs, derived, discrete };
        let (derivatives, outputs) = (p.derivatives(at), p.outputs(at));
        let mut all = vec![T::from(0.0); layout.outputs.counts.reals + layout.states.counts.reals];
        let ValueStore { words, booleans, strings, binaries, .. } = others;
        let at = Counts { reals: 0, ..layout.outputs.at };
        outputs.write(&mut ValuesMut { reals: &mut all, words, booleans, strings, binaries, lengths: () }, at);
        derivatives.write(&mut ValuesMut::of_reals(&mut all[layout.outputs.counts.reals..]), Counts::ZERO);
        all
    }

    /// Advances to the end of a step or, with `PAUSES`, to the next intermediate update. If this fails, restores the
    /// discrete state from before the step.
    #[inline]
    fn advance_or_restore<const PAUSES: bool>(
        Run { ctx, run, values }: Run<'_, Self>,
        step: Step,
        parts: u64,
        progress: &mut Progress,
    ) -> Result<Option<f64>, String> {
        let advance = match (is_in_place::<M>(), Self::INTERPOLATES) {
            (true, true) => Self::advance::<InPlace<true>, PAUSES>,
            (true, false) => Self::advance::<InPlace<false>, PAUSES>,
            (false, true) => Self::advance::<OnHeap<true>, PAUSES>,
            (false, false) => Self::advance::<OnHeap<false>, PAUSES>,
        };
        if !has_events::<M>() {
            return advance(Run { ctx, run, values }, step, parts, progress);
        }
        if progress.events == 0 && !Self::HAS_CLOCKS {
            run.before_events = None;
        }
        advance(Run { ctx, run, values }, step, parts, progress).inspect_err(|_| Self::undo_events(run))
    }
}

impl<M: Continuous, const MODEL_EXCHANGE: bool, const LINEAR: bool> Model
    for ContinuousModel<M, MODEL_EXCHANGE, LINEAR>
{
    const MODEL_EXCHANGE: bool = MODEL_EXCHANGE;
    const HAS_EVENTS: bool = has_events::<M>() || Self::HAS_CLOCKS;
    const CLOCKS: &'static [InputClock] = M::CLOCKS;
    const SCHEDULED_EXECUTION: bool = false;
    const CAN_FINISH: bool = M::CAN_FINISH;
    // A solution in closed form applies to inputs that are held.
    const INTERPOLATES: bool =
        LINEAR && !matches!(M::SOLVER, Solver::Exact) && <M::Inputs<f64> as crate::Variables<f64>>::COUNTS.reals > 0;
    const HAS_ERROR_CONTROL: bool = has_error_control(M::SOLVER);
    const INFO: Info = M::INFO;
    const SETTABLE: Counts = settable::<M, M::Inputs<f64>, M::Outputs<f64>>();
    const KIND: Kind = Kind::Continuous;
    const EQUATIONS_READ: Option<&'static [&'static str]> = M::EQUATIONS_READ;
    type Parameters = M;
    type Derived = M::Derived;
    type RunnerState = StateOf<M>;

    fn layout() -> Layout {
        let mut declared = Declarations {
            parameters: M::declarations(),
            sized: M::HAS_STRUCTURE.then_some(Layout::sized_arrays),
            inputs: M::Inputs::<f64>::declarations(),
            outputs: M::Outputs::<f64>::declarations(),
            states: M::State::<f64>::declarations(),
            crossings: size_of::<M::Crossings>() / size_of::<f64>(),
            clocks: M::CLOCKS.iter().map(declare_clock).collect(),
            ..Declarations::default()
        };
        M::Derived::declare(&mut declared.derived);
        const { assert!(M::DiscreteState::NAMES.is_empty() || Self::HAS_CLOCKS, "no clock for `#[var(clock = …)]`") };
        if Self::HAS_CLOCKS {
            declared.declare_clocked::<M::DiscreteState>();
        }
        let solver = match M::SOLVER {
            Solver::RungeKutta => Some((MAX_STEP, M::INFO.step_size)),
            Solver::DormandPrince { tolerance } | Solver::Rosenbrock { tolerance } => Some((TOLERANCE, tolerance)),
            Solver::Exact => None,
        };
        layout(declared, solver)
    }

    fn load(p: &M, resources: &Path) -> Result<M::Derived, String> {
        p.load(resources)
    }

    fn fingerprint(derived: &M::Derived) -> u64 {
        M::fingerprint(derived)
    }

    fn init(ctx: Context<'_, Self>, _: &Path, values: &ValueStore) -> Result<Self::RunnerState, String> {
        let Context { p, derived, layout, time } = ctx;
        // Allocated here because steps must not allocate.
        let mut scratch = Scratch::new::<M>(layout);
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let state = &M::State::read(values.view(), layout.states.at);
        let default = M::DiscreteState::default();
        let discrete = p.initial_discrete_state(At { time, state, inputs, derived, discrete: &default });
        let mut crossings = Vec::new();
        if size_of::<M::Crossings>() > 0 {
            let at = At { time, state, inputs, derived, discrete: &discrete };
            crossings.extend_from_slice(p.zero_crossings(at).as_ref());
        }
        if is_stiff::<M>() {
            scratch.branches = branches(layout, values, &discrete);
            let inputs = M::Inputs::read(values.view(), layout.inputs.at);
            let problem = Problem { model: p, inputs, derived, lengths: &values.lengths, line: None };
            problem.trace(&discrete, &mut scratch);
        }
        let schedules = clocks::first(M::CLOCKS, layout, values, time)?;
        Ok(RunnerState { discrete, schedules, proposed: 0.0, crossings, scratch, exchange: None, before_events: None })
    }

    fn initialize(Context { p, derived, layout, .. }: Context<'_, Self>, values: &mut ValueStore) {
        for index in layout.states.reals() {
            let declaration = &layout.real(index).declaration;
            if let Type::Real(real) = &declaration.kind
                && declaration.calculated
            {
                values.reals[index] = real.start;
            }
        }
        let mut x = M::State::read(values.view(), layout.states.at);
        let before: Vec<f64> = layout.states.reals().map(|index| values.reals[index]).collect();
        p.initialize(derived, &mut x);
        x.write(&mut values.view_mut(), layout.states.at);
        // Changes to other states are ignored.
        for (index, before) in layout.states.reals().zip(before) {
            if !layout.real(index).declaration.calculated {
                values.reals[index] = before;
            }
        }
    }

    fn parts(layout: &Layout, values: &ValueStore, step: Step) -> f64 {
        let Some(max_step) = layout.solver.map(|index| values.reals[index]) else { return 1.0 };
        // Fast path: no division when the step fits.
        if has_error_control(M::SOLVER) || step.step <= max_step {
            1.0
        } else {
            (step.step / max_step - 1e-6).ceil().max(1.0)
        }
    }

    fn step(run: Run<'_, Self>, step: Step, parts: u64) -> Result<Option<f64>, String> {
        if Self::HAS_CLOCKS {
            if !step.importer_ticks {
                return Self::step_with_ticks(run, step, parts);
            }
            run.run.before_events = None;
        }
        Self::advance_or_restore::<false>(run, step, parts, &mut Progress::new(step))
    }

    fn step_to_update(
        run: Run<'_, Self>,
        step: Step,
        parts: u64,
        progress: &mut Progress,
    ) -> Result<Option<f64>, String> {
        if Self::HAS_CLOCKS {
            return Self::step_between_ticks(run, step, parts, progress);
        }
        Self::advance_or_restore::<true>(run, step, parts, progress)
    }

    fn outputs(ctx: Context<'_, Self>, run: &Self::RunnerState, values: &mut ValueStore) {
        let Context { p, derived, layout, time } = ctx;
        // `evaluate_clocks` has reported an error.
        let ticked = if Self::HAS_CLOCKS { Self::at_ticks(ctx, run, values).ok().flatten() } else { None };
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let (state, discrete) = match &ticked {
            Some((state, discrete, _)) => (state, discrete),
            None => (&M::State::read(values.view(), layout.states.at), &run.discrete),
        };
        p.outputs(At { time, state, inputs, derived, discrete }).write(&mut values.view_mut(), layout.outputs.at);
        discrete.write(&mut values.view_mut(), layout.clocked.at);
        run.discrete.write(&mut values.view_mut(), layout.previous.at);
    }

    fn derivatives(ctx: Context<'_, Self>, run: &Self::RunnerState, values: &mut ValueStore) {
        let Context { p, derived, layout, time } = ctx;
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let state = &M::State::read(values.view(), layout.states.at);
        let at = At { time, state, inputs, derived, discrete: &run.discrete };
        p.derivatives(at).write(&mut values.view_mut(), layout.derivatives.at);
    }

    fn directional(Run { ctx, run, values }: Run<'_, Self>, is_frozen: bool, direction: &[f64], result: &mut [f64]) {
        let slope = |index: usize| direction[number(ctx.layout, index)];
        let time_slope = direction.last().copied().unwrap_or(0.0);
        let mut others = values.clone();
        if MODEL_EXCHANGE {
            let dual = |value, slope| Dual::new(Relational(value), Relational(slope));
            let known = |index: usize| dual(values.reals[index], slope(index));
            let time = dual(ctx.time, time_slope);
            let mut unknowns = || Self::unknowns(ctx, &run.discrete, &mut others, time, known);
            let unknowns = match &mut run.exchange {
                Some(exchange) if is_frozen => exchange.relations.frozen(0, unknowns),
                _ => unknowns(),
            };
            result.iter_mut().zip(unknowns).for_each(|(slope, unknown)| *slope = unknown.eps.0);
        } else {
            let known = |index: usize| Dual64::new(values.reals[index], slope(index));
            let time = Dual64::new(ctx.time, time_slope);
            let unknowns = Self::unknowns(ctx, &run.discrete, &mut others, time, known);
            result.iter_mut().zip(unknowns).for_each(|(slope, unknown)| *slope = unknown.eps);
        }
    }

    fn modes() -> Modes {
        Modes::of(&M::DiscreteState::default())
    }

    fn with_mode(run: Self::RunnerState, modes: &Modes, numbers: &[Option<usize>]) -> Option<Self::RunnerState> {
        Some(RunnerState { discrete: modes.with(&run.discrete, numbers)?, ..run })
    }

    fn dependencies(ctx: Context<'_, Self>, run: &Self::RunnerState, values: &ValueStore) -> Option<Structure> {
        let count = ctx.layout.inputs.counts.reals + ctx.layout.states.counts.reals;
        Dependencies::trace(|| {
            let known = |index: usize| Dependencies::on(number(ctx.layout, index));
            let time = Dependencies::on(count);
            Self::unknowns(ctx, &run.discrete, &mut values.clone(), time, known)
        })
    }

    fn is_finished(p: &M, run: &Self::RunnerState) -> bool {
        p.is_finished(&run.discrete)
    }

    fn undo_events(run: &mut Self::RunnerState) {
        if let Some(before) = run.before_events.take() {
            (run.discrete, run.schedules) = before;
        }
    }

    fn init_steps(Run { ctx, run, values }: Run<'_, Self>) -> Result<(), String> {
        if M::HAS_TIME_EVENTS {
            let mut timeline = Timeline::ZERO;
            Self::handle_events(Run { ctx, run, values }, &mut timeline)?;
            run.exchange = None;
        }
        Ok(())
    }

    fn expressions(ctx: Context<'_, Self>, run: &Self::RunnerState, values: &ValueStore) -> (Vec<Expression>, bool) {
        let layout = ctx.layout;
        let time = Expression::known(usize::MAX);
        let mut others = values.clone();
        let equations = || Self::unknowns(ctx, &run.discrete, &mut others, time, Expression::known);
        let (reals, is_inspected) = expression::inspected(equations);
        let all = layout.variables.iter().filter_map(|variable| match (variable.role, &variable.declaration.kind) {
            (Role::Derivative, _) => {
                Some(reals[layout.outputs.counts.reals + variable.index - layout.derivatives.at.reals])
            }
            (Role::Output, Type::Real(_)) => Some(reals[variable.index - layout.outputs.at.reals]),
            (Role::Output, Type::Float32(_)) => Some(f64::from(f32::of(others.words[variable.index])).into()),
            (Role::Output, Type::Integer { .. }) => {
                Some(Expression::bytes(&others.words[variable.index].to_le_bytes()))
            }
            (Role::Output, Type::Boolean { .. } | Type::Clock(_)) => {
                Some(f64::from(others.booleans[variable.index]).into())
            }
            (Role::Output, Type::String { .. }) => Some(Expression::text(&others.strings[variable.index])),
            (Role::Output, Type::Binary { .. }) => Some(Expression::bytes(&others.binaries[variable.index])),
            _ => None,
        });
        (all.collect(), is_inspected)
    }

    fn init_events(run: &mut Self::RunnerState, layout: &Layout, time: f64) {
        run.exchange.get_or_insert_with(|| Exchange::new(layout, time).into());
    }

    fn schedules(run: &mut Self::RunnerState) -> &mut [Schedule] {
        run.schedules.as_mut()
    }

    fn evaluate_clocks(Run { ctx, run, values }: Run<'_, Self>) -> Result<(), String> {
        Self::at_ticks(ctx, run, values).map(drop)
    }

    fn count_relations(ctx: Context<'_, Self>, run: &Self::RunnerState, values: &ValueStore) -> usize {
        let layout = ctx.layout;
        let mut exchange = Exchange::new(layout, 0.0);
        exchange.read(layout, values);
        Self::eval_all(ctx, &mut exchange, &run.discrete, values, Sides::Update);
        exchange.relations.count()
    }

    // Handles first the ticks, then the zero crossings, then the time events, in the same order as co-simulation.
    fn handle_events(Run { ctx, run, values }: Run<'_, Self>, _: &mut Timeline) -> Result<Update, String> {
        let Context { p, derived, layout, time } = ctx;
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let before = M::State::read(values.view(), layout.states.at);
        let mut discrete = run.discrete.clone();
        let mut x = M::State::read(values.view(), layout.states.at);
        let mut schedules = run.schedules.clone();
        if Self::HAS_CLOCKS {
            if let Some(ticked) = Self::at_ticks(ctx, run, values)? {
                (x, discrete, schedules) = ticked;
            }
            clocks::update_intervals(M::CLOCKS, schedules.as_mut(), layout, values, time)?;
        }
        let exchange = run.exchange.get_or_insert_with(|| Exchange::new(layout, time).into());
        let mut handled = exchange.handled;
        let event =
            |x: &mut M::State<f64>, discrete: &mut M::DiscreteState, before: &[f64], after: &[f64], is_timed| {
                p.on_event(Event { time, state: x, discrete, inputs, derived, is_timed, before, after });
                check_discrete(discrete, time)
            };
        if layout.indicators.declared > 0 {
            let now = p.zero_crossings(At { time, state: &x, inputs, derived, discrete: &discrete });
            let mut pairs = run.crossings.iter().zip(now.as_ref());
            if pairs.any(|(before, now)| is_crossing(*before, *now)) {
                event(&mut x, &mut discrete, &run.crossings, now.as_ref(), false)?;
            }
        }
        let mut next = None;
        if M::HAS_TIME_EVENTS {
            let is_due = |next: f64| next <= time + slack(0.0, time);
            // If the announced event is due now or was due earlier (an importer may handle it late), its time is not
            // handled yet. Otherwise, no event was due up to now.
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
        check_reals(layout, layout.states, values, time)
            .inspect_err(|_| before.write(&mut values.view_mut(), layout.states.at))?;
        if layout.indicators.declared > 0 {
            let now = p.zero_crossings(At { time, state: &x, inputs, derived, discrete: &discrete });
            run.crossings.clear();
            run.crossings.extend_from_slice(now.as_ref());
        }
        run.discrete = discrete;
        if Self::HAS_CLOCKS {
            run.schedules = schedules;
            values.booleans[layout.clocks.booleans()].fill(false);
        }
        if let Some(exchange) = &mut run.exchange {
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

    fn freeze_relations(ctx: Context<'_, Self>, run: &mut Self::RunnerState, values: &ValueStore) {
        let Context { layout, time, .. } = ctx;
        let RunnerState { discrete, exchange, crossings, .. } = run;
        let exchange = exchange.get_or_insert_with(|| Exchange::new(layout, time).into());
        exchange.read(layout, values);
        if layout.indicators.relations > 0 {
            Self::eval_all(ctx, exchange, discrete, values, Sides::Update);
            exchange.relations.begin_scales();
            for (number, index) in layout.inputs.reals().chain(layout.states.reals()).enumerate() {
                let value = exchange.known[number];
                exchange.known[number] = Relational(value.0 + PROBE * layout.nominal(index));
                Self::eval_all(ctx, exchange, discrete, values, Sides::Keep);
                exchange.relations.add_to_scales();
                exchange.known[number] = value;
            }
            exchange.relations.end_scales();
        }
        if !crossings.is_empty() {
            let base = Self::crossings_at(ctx, discrete, values);
            let mut changed = values.clone();
            exchange.scales.fill(0.0);
            for index in layout.inputs.reals().chain(layout.states.reals()) {
                changed.reals[index] += PROBE * layout.nominal(index);
                let here = Self::crossings_at(ctx, discrete, &changed);
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

    fn eval_frozen(ctx: Context<'_, Self>, run: &mut Self::RunnerState, values: &mut ValueStore, outputs: bool) {
        let layout = ctx.layout;
        if run.exchange.is_none() {
            Self::freeze_relations(ctx, run, values);
        }
        let RunnerState { discrete, exchange, .. } = run;
        let Some(exchange) = exchange else { unreachable!("made above") };
        exchange.read(layout, values);
        let (part, range) = if outputs {
            (Part::Outputs, layout.outputs.reals())
        } else {
            (Part::Derivatives, layout.derivatives.reals())
        };
        Self::eval(ctx, exchange, discrete, values, part, Sides::Keep);
        for (value, result) in values.reals[range].iter_mut().zip(&exchange.unknown) {
            *value = result.0;
        }
    }

    fn event_indicators(ctx: Context<'_, Self>, run: &mut Self::RunnerState, values: &ValueStore, result: &mut [f64]) {
        let layout = ctx.layout;
        if run.exchange.is_none() {
            Self::freeze_relations(ctx, run, values);
        }
        let RunnerState { discrete, exchange, crossings, .. } = run;
        let Some(exchange) = exchange else { unreachable!("made above") };
        let (declared, relations) = result.split_at_mut(layout.indicators.declared);
        if !declared.is_empty() {
            let now = Self::crossings_at(ctx, discrete, values);
            let before = crossings.iter().zip(&exchange.scales);
            for ((indicator, now), (before, scale)) in declared.iter_mut().zip(now.as_ref()).zip(before) {
                *indicator = indicator_of(*now, *scale, *before >= 0.0);
            }
        }
        if !relations.is_empty() {
            exchange.read(layout, values);
            Self::eval_all(ctx, exchange, discrete, values, Sides::Keep);
            exchange.relations.indicators(relations);
        }
    }

    fn save(run: &Self::RunnerState, sink: &mut dyn FnMut(Word<'_>)) -> Result<(), String> {
        if has_error_control(M::SOLVER) {
            sink(Word::Real(run.proposed));
        }
        if size_of::<M::Crossings>() > 0 {
            sink(Word::Whole(run.crossings.len() as u64));
            run.crossings.iter().for_each(|&value| sink(Word::Real(value)));
        }
        run.discrete.save(sink);
        clocks::save(run.schedules.as_ref(), sink);
        if MODEL_EXCHANGE || Self::HAS_EVENTS {
            sink(Word::Whole(run.exchange.is_some().into()));
            if let Some(exchange) = &run.exchange {
                exchange.save(sink);
            }
        }
        Ok(())
    }

    fn restore(run: &mut Self::RunnerState, layout: &Layout, source: &mut Words<'_>) -> Result<(), String> {
        if has_error_control(M::SOLVER) {
            run.proposed = source.real("step of the solver")?;
            if !(run.proposed >= 0.0 && are_finite(&[run.proposed])) {
                return Err(format!("the step of the solver must be 0 or more, got {}", run.proposed));
            }
        }
        if size_of::<M::Crossings>() > 0 {
            run.crossings.clear();
            for _ in 0..source.whole("number of zero crossings")? {
                run.crossings.push(source.real("zero crossing")?);
            }
        }
        run.discrete.load(source)?;
        clocks::restore(run.schedules.as_mut(), source)?;
        let has_exchange = (MODEL_EXCHANGE || Self::HAS_EVENTS) && source.whole("mark of events")? != 0;
        if has_exchange {
            let mut exchange = Exchange::new(layout, 0.0);
            exchange.restore(source)?;
            run.exchange = Some(exchange.into());
        }
        Ok(())
    }

    fn not_finite(run: &Self::RunnerState) -> Option<(&'static str, f64)> {
        run.discrete.not_finite()
    }
}
