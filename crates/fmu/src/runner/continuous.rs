//! Runs a continuous-time model.

use std::marker::PhantomData;
use std::path::Path;

use super::exchange::Exchange;
use super::{Kind, MOST_PARTS, Model, Step, StepError, Update, are_finite, first_not_finite};
use crate::clock::Clock;
use crate::declare::Spec;
use crate::definition::{MAX_STEP, TOLERANCE};
use crate::discrete_state::{DiscreteState as _, Word, Words};
use crate::dual::{Dual, Dual64};
use crate::model::{At, Continuous, Event, Info, Solver, is_crossing};
use crate::relation::Relational;
use crate::scalar::{Dependencies, DependencySet, Scalar};
use crate::solver::{Problem, Scratch};
use crate::store::ValueStore;
use crate::variable::{Declarations, Kind as Type, Layout};
use crate::variables::{ContinuousState as _, Counts, Derived as _, Values, ValuesMut, Variables as _};

/// Runs a [`Continuous`] model, with or without model exchange.
#[derive(Debug)]
pub struct ContinuousModel<M, const MODEL_EXCHANGE: bool = true>(PhantomData<M>);

/// The most events in one communication step: more of them are a chain of ever shorter intervals (Zeno behavior).
pub(super) const MOST_EVENTS: u32 = 10_000;

/// What a continuous-time model has besides its variables.
#[derive(Clone, Debug)]
pub struct Memory<D> {
    pub(super) discrete: D,
    /// Step that the solver with error control proposes next in s; 0 before the first one.
    proposed: f64,
    /// The quantities whose zero crossings are events, at the start or where the last step ended.
    pub(super) crossings: Vec<f64>,
    scratch: Scratch,
    /// In model exchange, from its first event on.
    pub(super) exchange: Option<Box<Exchange>>,
    /// The discrete state before the first event of a step, for a step that fails.
    before_events: Option<D>,
}

/// Makes one step of the solver from a time and state, at most some seconds long. Returns the state after it and its length.
type Advance<'f, 'a, M> = &'f mut dyn FnMut(
    &mut Integration<'a, M>,
    f64,
    &<M as Continuous>::State<f64>,
    f64,
) -> Result<(<M as Continuous>::State<f64>, f64), StepError>;

/// The parameter that the solver reads, with its start value.
fn solver_parameter(solver: Solver, step_size: f64) -> Option<(crate::Definition, f64)> {
    match solver {
        Solver::RungeKutta => Some((MAX_STEP, step_size)),
        Solver::DormandPrince { tolerance } | Solver::Rosenbrock { tolerance } => Some((TOLERANCE, tolerance)),
        Solver::Exact => None,
    }
}

const fn has_error_control(solver: Solver) -> bool {
    matches!(solver, Solver::DormandPrince { .. } | Solver::Rosenbrock { .. })
}

/// The variables as numbers of type `T`, with reals made from indices.
fn typed<T: Scalar, M: Continuous>(
    layout: &Layout,
    values: &ValueStore,
    real: impl Fn(usize) -> T,
) -> (M::State<T>, M::Inputs<T>) {
    let inputs: Vec<T> = layout.inputs.reals().map(&real).collect();
    let states: Vec<T> = layout.states.reals().map(&real).collect();
    let at = Counts { reals: 0, ..layout.inputs.at };
    let u = M::Inputs::read(Values { reals: &inputs, ..values.others() }, at);
    (M::State::from_reals(&states), u)
}

/// Real outputs, then state derivatives.
fn unknowns<T: Scalar, M: Continuous>(p: &M, at: At<'_, T, M>, layout: &Layout, values: &ValueStore) -> Vec<T> {
    let (derivatives, outputs) = (p.derivatives(at), p.outputs(at));
    let mut all = vec![T::from(0.0); layout.outputs.counts.reals + layout.states.counts.reals];
    let mut others = values.clone();
    let ValueStore { integers, booleans, strings, .. } = &mut others;
    let at = Counts { reals: 0, ..layout.outputs.at };
    outputs.write(&mut ValuesMut { reals: &mut all, integers, booleans, strings }, at);
    derivatives.write(&mut ValuesMut::of_reals(&mut all[layout.outputs.counts.reals..]), Counts::ZERO);
    all
}

/// Advances the state over a step of the master.
struct Integration<'a, M: Continuous> {
    problem: Problem<'a, M>,
    memory: &'a mut Memory<M::DiscreteState>,
    layout: &'a Layout,
    /// Time up to which time events were handled in s.
    reached: f64,
    events: u32,
    /// Time of the first event of the step, for a message.
    first_event: f64,
    /// Time up to which time events were handled in this step in s.
    handled: f64,
    stops_at_events: bool,
    /// Time of the event at which the step stopped in s.
    stopped: Option<f64>,
}

/// Returns true if the model declares zero crossings or time events.
const fn has_events<M: Continuous>() -> bool {
    size_of::<M::Crossings>() > 0 || M::HAS_TIME_EVENTS
}

impl<'a, M: Continuous> Integration<'a, M> {
    /// The state after one part of the step, of `h` s, which ends at `end`.
    fn part(&mut self, time: f64, x: M::State<f64>, h: f64, end: f64) -> Result<M::State<f64>, StepError> {
        if !has_events::<M>() {
            return Ok(self.problem.fixed(time, &x, &self.memory.discrete, h));
        }
        self.until(time, x, end, &mut |this: &mut Self, time, x, limit| {
            Ok((this.problem.fixed(time, x, &this.memory.discrete, limit), limit))
        })
    }

    /// The state at `end`, by a solver with error control.
    fn controlled(
        &mut self,
        time: f64,
        x: M::State<f64>,
        end: f64,
        tolerance: f64,
    ) -> Result<M::State<f64>, StepError> {
        let mut steps = 0_u64;
        self.until(time, x, end, &mut |this: &mut Self, time, x, limit| {
            this.accepted(time, x, limit, tolerance, &mut steps)
        })
    }

    /// One step that the error control accepts, at most `limit` s long.
    fn accepted(
        &mut self,
        time: f64,
        x: &M::State<f64>,
        limit: f64,
        tolerance: f64,
        steps: &mut u64,
    ) -> Result<(M::State<f64>, f64), StepError> {
        let Self { problem, memory, layout, .. } = self;
        // At first a small part of the step, but not one that roundings of the time swallow.
        let first = (limit * 1e-3).max(16.0 * f64::EPSILON * time.abs());
        let proposed = if memory.proposed > 0.0 { memory.proposed } else { first };
        // No tiny step is left over before the limit.
        let mut h = if 1.01 * proposed >= limit { limit } else { proposed };
        loop {
            *steps += 1;
            // The limit may be short: the next event, or the end of the step.
            let is_too_short = h < limit && (h <= 4.0 * f64::EPSILON * time.abs() || h < f64::MIN_POSITIVE);
            if *steps as f64 > MOST_PARTS || is_too_short {
                return Err(StepError::Rejected(format!(
                    "the solver cannot keep the tolerance {tolerance} at {time} s; its step became {h} s"
                )));
            }
            let Some((end, error)) = problem.estimated(time, x, &memory.discrete, h, &mut memory.scratch) else {
                h *= 0.25;
                continue;
            };
            let norm = error_norm::<M>(layout, &mut memory.scratch, x, &end, &error, tolerance);
            // Order 4 of the error estimate plus one.
            let factor = if norm > 0.0 { (0.9 * fmu_math::pow(norm, -0.2)).clamp(0.2, 5.0) } else { 5.0 };
            if norm <= 1.0 {
                let next = h * factor;
                // A step cut short by the limit says nothing about the steps to come.
                memory.proposed = if h < proposed { proposed.max(next) } else { next };
                return Ok((end, h));
            }
            h *= if norm.is_finite() { factor.min(0.9) } else { 0.2 };
        }
    }

    /// Advances to `end`, from event to event.
    fn until(
        &mut self,
        mut time: f64,
        mut x: M::State<f64>,
        end: f64,
        advance: Advance<'_, 'a, M>,
    ) -> Result<M::State<f64>, StepError> {
        if !has_events::<M>() {
            while time < end {
                let limit = end - time;
                let (after, h) = advance(self, time, &x, limit)?;
                time = if h >= limit { end } else { time + h };
                x = after;
            }
            return Ok(x);
        }
        self.changed_by_inputs(time, &mut x)?;
        loop {
            let next = self.problem.model.next_time_event(self.problem.at(self.reached, &x, &self.memory.discrete));
            let due = next.filter(|next| *next > self.reached && *next <= end);
            if let Some(due) = due.filter(|due| *due <= time) {
                // Between the end of the step before and the start of this one, which differ by roundings.
                self.reached = due;
                self.handled = due;
                self.event(time, &mut x, &[], &[], true)?;
                continue;
            }
            if time >= end {
                return Ok(x);
            }
            let limit = due.unwrap_or(end) - time;
            let (after, h) = advance(self, time, &x, limit)?;
            let before_values = self.crossings(time, &x);
            let after_values = self.crossings(time + h, &after);
            let found = self.locate(time, &x, h, before_values.as_ref(), after_values.as_ref());
            let is_at_limit = found.as_ref().map_or(h >= limit, |(at, ..)| *at >= time + limit);
            let at = found.as_ref().map_or(time + h, |(at, ..)| *at);
            time = if is_at_limit { due.unwrap_or(end) } else { at };
            self.reached = self.reached.max(time);
            if self.stops_at_events && (found.is_some() || (is_at_limit && due.is_some())) {
                self.stopped = Some(time);
                return Ok(found.map_or(after, |(_, state, _)| state));
            }
            match found {
                Some((_, state, values)) => {
                    x = state;
                    self.event(time, &mut x, before_values.as_ref(), values.as_ref(), false)?;
                }
                None => {
                    x = after;
                    self.memory.crossings.clear();
                    self.memory.crossings.extend_from_slice(after_values.as_ref());
                }
            }
            if is_at_limit && due.is_some() {
                self.handled = time;
                self.event(time, &mut x, &[], &[], true)?;
            }
        }
    }

    /// An event at the start of a step if inputs or parameters have changed the sign of a quantity since the last one.
    fn changed_by_inputs(&mut self, time: f64, x: &mut M::State<f64>) -> Result<(), StepError> {
        let now = self.crossings(time, x);
        let before = std::mem::take(&mut self.memory.crossings);
        let is_changed = before.iter().zip(now.as_ref()).any(|(before, now)| is_crossing(*before, *now));
        let result = if is_changed { self.event(time, x, &before, now.as_ref(), false) } else { Ok(()) };
        let kept = std::mem::replace(&mut self.memory.crossings, before);
        if is_changed {
            self.memory.crossings = kept;
        } else {
            self.memory.crossings.clear();
            self.memory.crossings.extend_from_slice(now.as_ref());
        }
        result
    }

    fn crossings(&self, time: f64, x: &M::State<f64>) -> Crossings<M> {
        if size_of::<M::Crossings>() == 0 {
            return Crossings(None);
        }
        Crossings(Some(self.problem.model.zero_crossings(self.problem.at(time, x, &self.memory.discrete))))
    }

    /// The first zero crossing of a step: its time, the state just after it, and the quantities there.
    fn locate(
        &mut self,
        time: f64,
        x: &M::State<f64>,
        h: f64,
        before: &[f64],
        after: &[f64],
    ) -> Option<(f64, M::State<f64>, Crossings<M>)> {
        let crosses = |values: &[f64]| before.iter().zip(values).any(|(a, b)| is_crossing(*a, *b));
        if !crosses(after) {
            return None;
        }
        // Bisection: no crossing up to `low`, one up to `high`. Every point is one step from the start of the interval.
        let (mut low, mut high) = (0.0, h);
        let mut found = None;
        for _ in 0..64 {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high || high - low <= f64::EPSILON * (time.abs() + h) {
                break;
            }
            let state = self.single(time, x, middle)?;
            let values = self.crossings(time + middle, &state);
            if crosses(values.as_ref()) {
                high = middle;
                found = Some((state, values));
            } else {
                low = middle;
            }
        }
        let (state, values) = match found {
            Some(found) => found,
            None => {
                let state = self.single(time, x, high)?;
                let values = self.crossings(time + high, &state);
                (state, values)
            }
        };
        Some((time + high, state, values))
    }

    /// The state after one step of the solver, whatever its error.
    fn single(&mut self, time: f64, x: &M::State<f64>, h: f64) -> Option<M::State<f64>> {
        if has_error_control(M::SOLVER) {
            let Self { problem, memory, .. } = self;
            problem.estimated(time, x, &memory.discrete, h, &mut memory.scratch).map(|(end, _)| end)
        } else {
            Some(self.problem.fixed(time, x, &self.memory.discrete, h))
        }
    }

    fn event(
        &mut self,
        time: f64,
        x: &mut M::State<f64>,
        before: &[f64],
        after: &[f64],
        is_timed: bool,
    ) -> Result<(), StepError> {
        if self.events == 0 {
            self.first_event = time;
            self.memory.before_events = Some(self.memory.discrete.clone());
        }
        self.events += 1;
        if self.events > MOST_EVENTS {
            return Err(StepError::Rejected(format!(
                "more than {MOST_EVENTS} events between {} s and {time} s; let the model come to rest, or use shorter steps",
                self.first_event
            )));
        }
        self.problem.model.on_event(Event {
            time,
            state: x,
            discrete: &mut self.memory.discrete,
            inputs: self.problem.inputs,
            derived: self.problem.derived,
            is_timed,
            before,
            after,
        });
        // The solution has a corner: what the solver learned of it is of no use.
        self.memory.proposed = 0.0;
        let values = self.crossings(time, x);
        self.memory.crossings.clear();
        self.memory.crossings.extend_from_slice(values.as_ref());
        match self.memory.discrete.not_finite() {
            Some((name, value)) => Err(StepError::StateNotFinite { name, value, time }),
            None => Ok(()),
        }
    }
}

/// The quantities whose zero crossings are events.
struct Crossings<M: Continuous>(Option<M::Crossings>);

impl<M: Continuous> Crossings<M> {
    fn as_ref(&self) -> &[f64] {
        self.0.as_ref().map_or(&[], AsRef::as_ref)
    }
}

/// Weighted root mean square of the error (Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", eq. II.4.11).
fn error_norm<M: Continuous>(
    layout: &Layout,
    scratch: &mut Scratch,
    x: &M::State<f64>,
    end: &M::State<f64>,
    error: &M::State<f64>,
    tolerance: f64,
) -> f64 {
    let n = layout.states.counts.reals;
    if n == 0 {
        return 0.0;
    }
    let largest = x.combine(end, |a, b| a.abs().max(b.abs()));
    largest.write(&mut ValuesMut::of_reals(&mut scratch.state), Counts::ZERO);
    error.write(&mut ValuesMut::of_reals(&mut scratch.other), Counts::ZERO);
    let mut sum = 0.0;
    for (i, index) in layout.states.reals().enumerate() {
        let nominal = match &layout.real(index).declaration.kind {
            Type::Real(real) => real.nominal.unwrap_or(1.0),
            _ => 1.0,
        };
        let ratio = scratch.other[i] / (tolerance * (nominal + scratch.state[i]));
        sum += ratio * ratio;
    }
    (sum / n as f64).sqrt()
}

impl<M: Continuous, const MODEL_EXCHANGE: bool> ContinuousModel<M, MODEL_EXCHANGE> {
    /// The memory at the start.
    pub(crate) fn memory(
        p: &M,
        derived: &M::Derived,
        layout: &Layout,
        values: &ValueStore,
        time: f64,
    ) -> Memory<M::DiscreteState> {
        // Here, so that no step allocates.
        let mut scratch = Scratch::default();
        scratch.resize::<M>();
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let state = &M::State::read(values.view(), layout.states.at);
        let default = M::DiscreteState::default();
        let discrete = p.initial_discrete_state(At { time, state, inputs, derived, discrete: &default });
        let mut crossings = Vec::new();
        if size_of::<M::Crossings>() > 0 {
            let at = At { time, state, inputs, derived, discrete: &discrete };
            crossings.extend_from_slice(p.zero_crossings(at).as_ref());
        }
        Memory { discrete, proposed: 0.0, crossings, scratch, exchange: None, before_events: None }
    }

    /// Advances the states. If that fails, the values are kept, and the discrete state is the one at the failure.
    #[inline]
    fn advance(
        p: &M,
        derived: &M::Derived,
        memory: &mut Memory<M::DiscreteState>,
        layout: &Layout,
        values: &mut ValueStore,
        step: Step,
        parts: u64,
    ) -> Result<Option<f64>, StepError> {
        let u = M::Inputs::read(values.view(), layout.inputs.at);
        let before = M::State::read(values.view(), layout.states.at);
        let problem = Problem { model: p, inputs: &u, derived };
        let end = step.time + step.step;
        let mut integration = Integration {
            problem,
            memory,
            layout,
            reached: step.reached,
            events: 0,
            first_event: 0.0,
            handled: step.reached,
            stops_at_events: step.stops_at_events,
            stopped: None,
        };
        let mut x = before.copied();
        if has_error_control(M::SOLVER) {
            let tolerance = layout.solver.map_or(1e-6, |index| values.reals[index]);
            x = integration.controlled(step.time, x, end, tolerance)?;
        } else {
            let h = step.step / parts as f64;
            for part in 0..parts {
                // Each part ends where the next one starts, so that no time event is between them.
                let start = |part: u64| step.time + part as f64 * h;
                let end = if part + 1 == parts { end } else { start(part + 1) };
                x = integration.part(start(part), x, h, end)?;
                if has_events::<M>() && integration.stopped.is_some() {
                    break;
                }
            }
        }
        let (stopped, handled) = (integration.stopped, integration.handled);
        if has_events::<M>()
            && let Some(exchange) = &mut memory.exchange
        {
            exchange.handled = if stopped.is_some() { handled } else { end };
        }
        x.write(&mut values.view_mut(), layout.states.at);
        first_not_finite(&values.reals, layout.states.reals(), end)
            .inspect_err(|_| before.write(&mut values.view_mut(), layout.states.at))?;
        Ok(stopped)
    }
}

impl<M: Continuous, const MODEL_EXCHANGE: bool> Model for ContinuousModel<M, MODEL_EXCHANGE> {
    const MODEL_EXCHANGE: bool = MODEL_EXCHANGE;
    const HAS_EVENTS: bool = has_events::<M>();
    const INFO: Info = M::INFO;
    const KIND: Kind = Kind::Continuous;
    type Parameters = M;
    type Derived = M::Derived;
    type Memory = Memory<M::DiscreteState>;

    fn layout() -> Layout {
        let parameter = solver_parameter(M::SOLVER, M::INFO.step_size);
        let mut declared = Declarations {
            parameters: M::declarations(),
            inputs: M::Inputs::<f64>::declarations(),
            outputs: M::Outputs::<f64>::declarations(),
            states: M::State::<f64>::declarations(),
            crossings: size_of::<M::Crossings>() / size_of::<f64>(),
            solver: parameter.map(|(definition, _)| definition.name),
            ..Declarations::default()
        };
        M::Derived::declare(&mut declared.derived);
        if let Some((definition, start)) = parameter
            && declared.parameters.iter().all(|parameter| parameter.name != definition.name)
        {
            Spec::defined(&definition).declare_real(Some(start), &mut declared.parameters);
        }
        Layout::new(declared)
    }

    fn load(p: &M, resources: &Path) -> Result<M::Derived, String> {
        p.load(resources)
    }

    fn fingerprint(derived: &M::Derived) -> u64 {
        M::fingerprint(derived)
    }

    fn begin(
        p: &M,
        derived: &M::Derived,
        _: &Path,
        layout: &Layout,
        values: &ValueStore,
        time: f64,
    ) -> Result<Self::Memory, String> {
        Ok(Self::memory(p, derived, layout, values, time))
    }

    fn initialize(p: &M, derived: &M::Derived, layout: &Layout, values: &mut ValueStore) {
        let mut x = M::State::read(values.view(), layout.states.at);
        let before: Vec<f64> = layout.states.reals().map(|index| values.reals[index]).collect();
        p.initialize(derived, &mut x);
        x.write(&mut values.view_mut(), layout.states.at);
        // Only states declared as calculated are.
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

    fn step(
        p: &M,
        derived: &M::Derived,
        memory: &mut Self::Memory,
        layout: &Layout,
        values: &mut ValueStore,
        step: Step,
        parts: u64,
    ) -> Result<Option<f64>, StepError> {
        if !Self::HAS_EVENTS {
            return Self::advance(p, derived, memory, layout, values, step, parts);
        }
        memory.before_events = None;
        let result = Self::advance(p, derived, memory, layout, values, step, parts);
        if result.is_err()
            && let Some(discrete) = memory.before_events.take()
        {
            memory.discrete = discrete;
        }
        result
    }

    fn outputs(
        p: &M,
        derived: &M::Derived,
        memory: &Self::Memory,
        layout: &Layout,
        values: &mut ValueStore,
        time: f64,
    ) {
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let state = &M::State::read(values.view(), layout.states.at);
        let at = At { time, state, inputs, derived, discrete: &memory.discrete };
        p.outputs(at).write(&mut values.view_mut(), layout.outputs.at);
    }

    fn derivatives(
        p: &M,
        derived: &M::Derived,
        memory: &Self::Memory,
        layout: &Layout,
        values: &mut ValueStore,
        time: f64,
    ) {
        let inputs = &M::Inputs::read(values.view(), layout.inputs.at);
        let state = &M::State::read(values.view(), layout.states.at);
        let at = At { time, state, inputs, derived, discrete: &memory.discrete };
        p.derivatives(at).write(&mut values.view_mut(), layout.derivatives.at);
    }

    fn directional(
        p: &M,
        derived: &M::Derived,
        memory: &mut Self::Memory,
        layout: &Layout,
        values: &ValueStore,
        time: f64,
        is_frozen: bool,
        direction: &[f64],
        result: &mut [f64],
    ) {
        let (inputs, states) = (layout.inputs.reals(), layout.states.reals());
        let slope = |index: usize| {
            if inputs.contains(&index) {
                direction[index - inputs.start]
            } else {
                direction[inputs.len() + index - states.start]
            }
        };
        let time_slope = direction.last().copied().unwrap_or(0.0);
        if MODEL_EXCHANGE {
            let dual = |value, slope| Dual::new(Relational(value), Relational(slope));
            let (state, inputs) = typed::<_, M>(layout, values, |index| dual(values.reals[index], slope(index)));
            let time = dual(time, time_slope);
            let at = At { time, state: &state, inputs: &inputs, derived, discrete: &memory.discrete };
            let unknowns = || unknowns(p, at, layout, values);
            let unknowns = match &mut memory.exchange {
                Some(exchange) if is_frozen => exchange.frozen(unknowns),
                _ => unknowns(),
            };
            result.iter_mut().zip(unknowns).for_each(|(slope, unknown)| *slope = unknown.eps.0);
        } else {
            let (state, inputs) =
                typed::<Dual64, M>(layout, values, |index| Dual64::new(values.reals[index], slope(index)));
            let time = Dual64::new(time, time_slope);
            let at = At { time, state: &state, inputs: &inputs, derived, discrete: &memory.discrete };
            let unknowns = unknowns(p, at, layout, values);
            result.iter_mut().zip(unknowns).for_each(|(slope, unknown)| *slope = unknown.eps);
        }
    }

    fn dependencies(
        p: &M,
        derived: &M::Derived,
        memory: &Self::Memory,
        layout: &Layout,
        values: &ValueStore,
    ) -> Vec<DependencySet> {
        let (inputs, states) = (layout.inputs.reals(), layout.states.reals());
        let time = inputs.len() + states.len();
        let known = time + 1;
        let number = |index: usize| {
            if inputs.contains(&index) { index - inputs.start } else { inputs.len() + index - states.start }
        };
        let mut all = vec![DependencySet::default(); layout.outputs.counts.reals + layout.states.counts.reals];
        // A set holds a part of the known variables; the equations run once for each part.
        for first in (0..known).step_by(Dependencies::CAPACITY) {
            Dependencies::forget_inspections();
            let one = |number: usize| {
                let is_here = (first..first + Dependencies::CAPACITY).contains(&number);
                if is_here { Dependencies::on(number - first) } else { Dependencies::default() }
            };
            let (state, inputs) = typed::<Dependencies, M>(layout, values, |index| one(number(index)));
            let at = At { time: one(time), state: &state, inputs: &inputs, derived, discrete: &memory.discrete };
            let unknowns = unknowns(p, at, layout, values);
            // Equations that look at a value may branch on it: then everything depends on everything.
            let inspected = Dependencies::has_inspections();
            for (set, part) in all.iter_mut().zip(unknowns) {
                for number in 0..Dependencies::CAPACITY.min(known - first) {
                    if inspected || part.contains(number) {
                        set.insert(first + number);
                    }
                }
            }
        }
        all
    }

    fn begin_events(memory: &mut Self::Memory, layout: &Layout, time: f64) {
        memory.exchange.get_or_insert_with(|| Exchange::new(layout, time).into());
    }

    fn count_relations(
        p: &M,
        derived: &M::Derived,
        memory: &Self::Memory,
        layout: &Layout,
        values: &ValueStore,
    ) -> usize {
        Self::relations(p, derived, memory, layout, values)
    }

    fn handle_events(
        p: &M,
        derived: &M::Derived,
        memory: &mut Self::Memory,
        layout: &Layout,
        values: &mut ValueStore,
        clock: &mut Clock,
    ) -> Result<Update, StepError> {
        Self::events(p, derived, memory, layout, values, clock.time)
    }

    fn settle(p: &M, derived: &M::Derived, memory: &mut Self::Memory, layout: &Layout, values: &ValueStore, time: f64) {
        Self::take_sides(p, derived, memory, layout, values, time);
    }

    fn frozen(
        p: &M,
        derived: &M::Derived,
        memory: &mut Self::Memory,
        layout: &Layout,
        values: &mut ValueStore,
        time: f64,
        outputs: bool,
    ) {
        Self::evaluate_frozen(p, derived, memory, layout, values, time, outputs);
    }

    fn event_indicators(
        p: &M,
        derived: &M::Derived,
        memory: &mut Self::Memory,
        layout: &Layout,
        values: &ValueStore,
        time: f64,
        result: &mut [f64],
    ) {
        Self::indicators(p, derived, memory, layout, values, time, result);
    }

    fn save(memory: &Self::Memory, sink: &mut dyn FnMut(Word<'_>)) -> Result<(), String> {
        if has_error_control(M::SOLVER) {
            sink(Word::Real(memory.proposed));
        }
        if size_of::<M::Crossings>() > 0 {
            sink(Word::Whole(memory.crossings.len() as u64));
            memory.crossings.iter().for_each(|&value| sink(Word::Real(value)));
        }
        memory.discrete.save(sink);
        if MODEL_EXCHANGE || Self::HAS_EVENTS {
            sink(Word::Whole(memory.exchange.is_some().into()));
            if let Some(exchange) = &memory.exchange {
                exchange.save(sink);
            }
        }
        Ok(())
    }

    fn restore(memory: &mut Self::Memory, layout: &Layout, source: &mut Words<'_>) -> Result<(), String> {
        if has_error_control(M::SOLVER) {
            memory.proposed = source.real("step of the solver")?;
            if !(memory.proposed >= 0.0 && are_finite(&[memory.proposed])) {
                return Err(format!("the step of the solver must be 0 or more, got {}", memory.proposed));
            }
        }
        if size_of::<M::Crossings>() > 0 {
            memory.crossings.clear();
            for _ in 0..source.whole("number of zero crossings")? {
                memory.crossings.push(source.real("zero crossing")?);
            }
        }
        memory.discrete.load(source)?;
        let has_exchange = (MODEL_EXCHANGE || Self::HAS_EVENTS) && source.whole("mark of events")? != 0;
        if has_exchange {
            let mut exchange = Exchange::new(layout, 0.0);
            exchange.restore(source)?;
            memory.exchange = Some(exchange.into());
        }
        Ok(())
    }

    fn not_finite(memory: &Self::Memory) -> Option<(&'static str, f64)> {
        memory.discrete.not_finite()
    }
}
