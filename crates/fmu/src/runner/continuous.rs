//! Runs a continuous-time model.

use std::marker::PhantomData;
use std::path::Path;

use fmu_math::ode;
use fmu_math::sparse::Structure;

use super::exchange::{Exchange, next_time_event, too_many_at};
use super::{Expressions, Kind, MOST_PARTS, Model, Modes, Step, StepError, Update, are_finite, first_not_finite};
use crate::clock::Clock;
use crate::declare::Spec;
use crate::definition::{MAX_STEP, TOLERANCE};
use crate::discrete_state::{DiscreteState, Word, Words};
use crate::dual::{Dual, Dual64};
use crate::expression::{self, Expression};
use crate::model::{At, Continuous, Event, Info, Solver, is_crossing};
use crate::relation::Relational;
use crate::scalar::{Dependencies, Scalar};
use crate::solver::{InPlace, Keep, OnHeap, Problem, Scratch, is_in_place};
use crate::store::ValueStore;
use crate::variable::{Declarations, Kind as Type, Layout, Role};
use crate::variables::{Counts, Derived as _, Values, ValuesMut, Variables as _};

/// Runs a [`Continuous`] model, with or without model exchange.
#[derive(Debug)]
pub struct ContinuousModel<M, const MODEL_EXCHANGE: bool = true>(PhantomData<M>);

/// The most events in one communication step: more of them are a chain of ever shorter intervals (Zeno behavior).
pub(super) const MOST_EVENTS: u32 = 10_000;

/// Discrete state, solver and events of a continuous-time model. `clone` leaves out the working memory of the solver, and `clone_from`
/// keeps that of the target.
#[derive(Debug)]
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

impl<D: Clone> Clone for Memory<D> {
    fn clone(&self) -> Self {
        Self {
            discrete: self.discrete.clone(),
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

/// Makes one step of the solver from a time and state, at most some seconds long. Returns the state after it and its length.
type Advance<'f, 'a, M, K> = &'f mut dyn FnMut(
    &mut Integration<'a, M, K>,
    f64,
    &<K as Keep<M>>::State,
    f64,
) -> Result<(<K as Keep<M>>::State, f64), StepError>;

/// The parameter that the solver reads, with its start value.
fn solver_parameter(solver: Solver, step_size: f64) -> Option<(crate::Definition, f64)> {
    match solver {
        Solver::RungeKutta => Some((MAX_STEP, step_size)),
        Solver::DormandPrince { tolerance } | Solver::Rosenbrock { tolerance } => Some((TOLERANCE, tolerance)),
        Solver::Exact => None,
    }
}

const fn is_stiff<M: Continuous>() -> bool {
    matches!(M::SOLVER, Solver::Rosenbrock { .. })
}

/// Hash of the values that equations may branch on: parameters, inputs that are not real, discrete state (FNV-1a, 64 bits).
fn branches<D: DiscreteState>(layout: &Layout, values: &ValueStore, discrete: &D) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |word: u64| hash = (hash ^ word).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
    values.reals[layout.parameters.reals()].iter().for_each(|value| add(value.to_bits()));
    values.integers.iter().for_each(|&value| add(value as u64));
    values.booleans.iter().for_each(|&value| add(value.into()));
    let mut add_bytes = |bytes: &[u8]| {
        add(bytes.len() as u64);
        bytes.iter().for_each(|&byte| add(byte.into()));
    };
    values.strings.iter().for_each(|value| add_bytes(value.as_bytes()));
    discrete.save(&mut |word| match word {
        Word::Real(value) => add_bytes(&value.to_bits().to_ne_bytes()),
        Word::Whole(value) => add_bytes(&value.to_ne_bytes()),
        Word::Bytes(bytes) => add_bytes(bytes),
    });
    hash
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

/// Real outputs, then state derivatives; outputs of other types go to `others`.
fn unknowns<T: Scalar, M: Continuous>(p: &M, at: At<'_, T, M>, layout: &Layout, others: &mut ValueStore) -> Vec<T> {
    let (derivatives, outputs) = (p.derivatives(at), p.outputs(at));
    let mut all = vec![T::from(0.0); layout.outputs.counts.reals + layout.states.counts.reals];
    let ValueStore { integers, booleans, strings, .. } = others;
    let at = Counts { reals: 0, ..layout.outputs.at };
    outputs.write(&mut ValuesMut { reals: &mut all, integers, booleans, strings }, at);
    derivatives.write(&mut ValuesMut::of_reals(&mut all[layout.outputs.counts.reals..]), Counts::ZERO);
    all
}

/// Advances the state over a step of the master, and keeps states by `K`.
struct Integration<'a, M: Continuous, K> {
    problem: Problem<'a, M>,
    memory: &'a mut Memory<M::DiscreteState>,
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
    keeping: PhantomData<K>,
}

/// Returns true if the model declares zero crossings or time events.
const fn has_events<M: Continuous>() -> bool {
    size_of::<M::Crossings>() > 0 || M::HAS_TIME_EVENTS
}

impl<'a, M: Continuous, K: Keep<M>> Integration<'a, M, K> {
    /// The state after one part of the step, of `h` s, which ends at `end`.
    fn part(&mut self, time: f64, x: K::State, h: f64, end: f64) -> Result<K::State, StepError> {
        if !has_events::<M>() {
            let after = self.fixed(time, &x, h);
            self.recycle(x);
            return Ok(after);
        }
        self.until(time, x, end, &mut |this: &mut Self, time, x, limit| Ok((this.fixed(time, x, limit), limit)))
    }

    /// The state at `end`, by a solver with error control.
    fn controlled(&mut self, time: f64, x: K::State, end: f64, tolerance: f64) -> Result<K::State, StepError> {
        let mut steps = 0_u64;
        self.until(time, x, end, &mut |this: &mut Self, time, x, limit| {
            this.accepted(time, x, limit, tolerance, &mut steps)
        })
    }

    /// One step that the error control accepts, at most `limit` s long.
    fn accepted(
        &mut self,
        time: f64,
        x: &K::State,
        limit: f64,
        tolerance: f64,
        steps: &mut u64,
    ) -> Result<(K::State, f64), StepError> {
        let Self { problem, memory, .. } = self;
        // At first a small part of the step, but not one that is lost in the rounding of the time.
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
            let Some(end) = K::estimated(problem, time, x, &memory.discrete, h, &mut memory.scratch) else {
                h *= 0.25;
                continue;
            };
            let norm = K::error_norm(x, &end, tolerance, &memory.scratch);
            let factor = ode::step_factor(norm);
            if norm <= 1.0 {
                let next = h * factor;
                // A step cut short by the limit does not predict the following ones.
                memory.proposed = if h < proposed { proposed.max(next) } else { next };
                return Ok((end, h));
            }
            K::recycle(end, &mut memory.scratch);
            h *= if norm.is_finite() { factor.min(0.9) } else { 0.2 };
        }
    }

    /// Advances to `end`, from event to event.
    fn until(
        &mut self,
        mut time: f64,
        mut x: K::State,
        end: f64,
        advance: Advance<'_, 'a, M, K>,
    ) -> Result<K::State, StepError> {
        if !has_events::<M>() {
            while time < end {
                let limit = end - time;
                let (after, h) = advance(self, time, &x, limit)?;
                time = if h >= limit { end } else { time + h };
                self.replace(&mut x, after);
            }
            return Ok(x);
        }
        self.changed_by_inputs(time, &mut x)?;
        loop {
            let next = K::show(&x, |x| {
                let at = self.problem.at(self.reached, x, &self.memory.discrete);
                next_time_event(self.problem.model, at)
            })?;
            let due = next.filter(|next| *next <= end);
            // The end of the step before and the start of this one differ by rounding errors.
            if let Some(due) = due.filter(|due| *due <= time.max(self.reached)) {
                self.reached = due;
                self.handled = due;
                self.event(time, &mut x, &[], &[], true)?;
                continue;
            }
            if time >= end {
                return Ok(x);
            }
            let target = due.unwrap_or(end);
            let limit = target - time;
            let (after, h) = advance(self, time, &x, limit)?;
            let before_values = self.crossings(time, &x);
            let after_values = self.crossings(time + h, &after);
            let found = self.locate(time, &x, h, before_values.as_ref(), after_values.as_ref());
            let at = found.as_ref().map_or(time + h, |(at, ..)| *at);
            // Rounding of `limit` must not lead past the time event.
            let is_at_limit = (found.is_none() && h >= limit) || at >= target.min(time + limit);
            time = if is_at_limit { target } else { at };
            self.reached = self.reached.max(time);
            if self.stops_at_events && (found.is_some() || (is_at_limit && due.is_some())) {
                self.stopped = Some(time);
                self.replace(&mut x, after);
                if let Some((_, state, _)) = found {
                    self.replace(&mut x, state);
                }
                return Ok(x);
            }
            match found {
                Some((_, state, values)) => {
                    self.recycle(after);
                    self.replace(&mut x, state);
                    self.event(time, &mut x, before_values.as_ref(), values.as_ref(), false)?;
                }
                None => {
                    self.replace(&mut x, after);
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
    fn changed_by_inputs(&mut self, time: f64, x: &mut K::State) -> Result<(), StepError> {
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

    fn crossings(&self, time: f64, x: &K::State) -> Crossings<M> {
        if size_of::<M::Crossings>() == 0 {
            return Crossings(None);
        }
        let crossings =
            K::show(x, |x| self.problem.model.zero_crossings(self.problem.at(time, x, &self.memory.discrete)));
        Crossings(Some(crossings))
    }

    /// The first zero crossing of a step: its time, the state just after it, and the quantities there.
    fn locate(
        &mut self,
        time: f64,
        x: &K::State,
        h: f64,
        before: &[f64],
        after: &[f64],
    ) -> Option<(f64, K::State, Crossings<M>)> {
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
                if let Some((before, _)) = found.replace((state, values)) {
                    self.recycle(before);
                }
            } else {
                low = middle;
                self.recycle(state);
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
    fn single(&mut self, time: f64, x: &K::State, h: f64) -> Option<K::State> {
        if has_error_control(M::SOLVER) {
            let Self { problem, memory, .. } = self;
            K::estimated(problem, time, x, &memory.discrete, h, &mut memory.scratch)
        } else {
            Some(self.fixed(time, x, h))
        }
    }

    /// The state after one step of fixed length.
    #[inline]
    fn fixed(&mut self, time: f64, x: &K::State, h: f64) -> K::State {
        let Self { problem, memory, .. } = self;
        K::fixed(problem, time, x, &memory.discrete, h, &mut memory.scratch)
    }

    /// Replaces a state by another.
    #[inline]
    fn replace(&mut self, x: &mut K::State, after: K::State) {
        self.recycle(std::mem::replace(x, after));
    }

    #[inline]
    fn recycle(&mut self, x: K::State) {
        K::recycle(x, &mut self.memory.scratch);
    }

    fn event(
        &mut self,
        time: f64,
        x: &mut K::State,
        before: &[f64],
        after: &[f64],
        is_timed: bool,
    ) -> Result<(), StepError> {
        if self.events == 0 {
            self.first_event = time;
            self.memory.before_events = Some(self.memory.discrete.clone());
        }
        self.events += 1;
        if self.events > MOST_EVENTS && is_timed && time <= self.first_event {
            return Err(too_many_at(time));
        }
        if self.events > MOST_EVENTS {
            return Err(StepError::Rejected(format!(
                "more than {MOST_EVENTS} events between {} s and {time} s; let the model come to rest, or use shorter steps",
                self.first_event
            )));
        }
        let Self { problem: Problem { model, inputs, derived }, memory, .. } = self;
        let Memory { discrete, scratch, .. } = &mut **memory;
        K::change(x, |state| {
            model.on_event(Event { time, state, discrete, inputs, derived, is_timed, before, after });
        });
        scratch.forget_structure();
        // The solution has a corner: the proposed step of the solver is not valid any more.
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
            Problem { model: p, inputs, derived }.trace(&discrete, &mut scratch);
        }
        Memory { discrete, proposed: 0.0, crossings, scratch, exchange: None, before_events: None }
    }

    /// Advances the states. If that fails, the values are kept, and the discrete state is the one at the failure.
    #[inline]
    fn advance<K: Keep<M>>(
        p: &M,
        derived: &M::Derived,
        memory: &mut Memory<M::DiscreteState>,
        layout: &Layout,
        values: &mut ValueStore,
        step: Step,
        parts: u64,
    ) -> Result<Option<f64>, StepError> {
        if memory.scratch.is_missing::<M>() {
            memory.scratch = Scratch::new::<M>(layout);
        }
        if is_stiff::<M>() {
            let branches = branches(layout, values, &memory.discrete);
            if std::mem::replace(&mut memory.scratch.branches, branches) != branches {
                memory.scratch.forget_structure();
            }
        }
        let u = M::Inputs::read(values.view(), layout.inputs.at);
        let before = K::load(values.view(), layout.states.at, &mut memory.scratch);
        let mut x = K::copy(&before, &mut memory.scratch);
        let problem = Problem { model: p, inputs: &u, derived };
        let end = step.time + step.step;
        let mut integration = Integration::<M, K> {
            problem,
            memory,
            reached: step.reached,
            events: 0,
            first_event: 0.0,
            handled: step.reached,
            stops_at_events: step.stops_at_events,
            stopped: None,
            keeping: PhantomData,
        };
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
            exchange.announced = stopped.unwrap_or(f64::INFINITY);
        }
        K::store(&x, &mut values.view_mut(), layout.states.at);
        first_not_finite(&values.reals, layout.states.reals(), end)
            .inspect_err(|_| K::store(&before, &mut values.view_mut(), layout.states.at))?;
        K::recycle(x, &mut memory.scratch);
        K::recycle(before, &mut memory.scratch);
        Ok(stopped)
    }
}

impl<M: Continuous, const MODEL_EXCHANGE: bool> Model for ContinuousModel<M, MODEL_EXCHANGE> {
    const MODEL_EXCHANGE: bool = MODEL_EXCHANGE;
    const HAS_EVENTS: bool = has_events::<M>();
    const HAS_ERROR_CONTROL: bool = has_error_control(M::SOLVER);
    const INFO: Info = M::INFO;
    const KIND: Kind = Kind::Continuous;
    const EQUATIONS_READ: Option<&'static [&'static str]> = M::EQUATIONS_READ;
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
        let advance = if is_in_place::<M>() { Self::advance::<InPlace> } else { Self::advance::<OnHeap> };
        if !Self::HAS_EVENTS {
            return advance(p, derived, memory, layout, values, step, parts);
        }
        memory.before_events = None;
        let result = advance(p, derived, memory, layout, values, step, parts);
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
            let unknowns = || unknowns(p, at, layout, &mut values.clone());
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
            let unknowns = unknowns(p, at, layout, &mut values.clone());
            result.iter_mut().zip(unknowns).for_each(|(slope, unknown)| *slope = unknown.eps);
        }
    }

    fn modes() -> Modes {
        Modes::of(&M::DiscreteState::default())
    }

    fn with_mode(memory: Self::Memory, modes: &Modes, numbers: &[Option<usize>]) -> Option<Self::Memory> {
        Some(Memory { discrete: modes.with(&memory.discrete, numbers)?, ..memory })
    }

    fn dependencies(
        p: &M,
        derived: &M::Derived,
        memory: &Self::Memory,
        layout: &Layout,
        values: &ValueStore,
    ) -> Option<Structure> {
        let (inputs, states) = (layout.inputs.reals(), layout.states.reals());
        let time = inputs.len() + states.len();
        Dependencies::trace(|| {
            let known = |index: usize| {
                let number =
                    if inputs.contains(&index) { index - inputs.start } else { inputs.len() + index - states.start };
                Dependencies::on(number)
            };
            let (state, inputs) = typed::<Dependencies, M>(layout, values, known);
            let time = Dependencies::on(time);
            let at = At { time, state: &state, inputs: &inputs, derived, discrete: &memory.discrete };
            unknowns(p, at, layout, &mut values.clone())
        })
    }

    fn begin_steps(
        p: &M,
        derived: &M::Derived,
        memory: &mut Self::Memory,
        layout: &Layout,
        values: &mut ValueStore,
        time: f64,
    ) -> Result<(), StepError> {
        if M::HAS_TIME_EVENTS {
            Self::events(p, derived, memory, layout, values, time)?;
            memory.exchange = None;
        }
        Ok(())
    }

    fn expressions(
        p: &M,
        derived: &M::Derived,
        memory: &Self::Memory,
        layout: &Layout,
        values: &ValueStore,
    ) -> Expressions {
        let (state, inputs) = typed::<Expression, M>(layout, values, Expression::known);
        let time = Expression::known(usize::MAX);
        let at = At { time, state: &state, inputs: &inputs, derived, discrete: &memory.discrete };
        let mut others = values.clone();
        let (reals, is_inspected) = expression::inspected(|| unknowns(p, at, layout, &mut others));
        let all = layout.variables.iter().filter_map(|variable| match (variable.role, &variable.declaration.kind) {
            (Role::Derivative, _) => {
                Some(reals[layout.outputs.counts.reals + variable.index - layout.derivatives.at.reals])
            }
            (Role::Output, Type::Real(_)) => Some(reals[variable.index - layout.outputs.at.reals]),
            (Role::Output, Type::Integer { .. }) => Some(f64::from(others.integers[variable.index]).into()),
            (Role::Output, Type::Boolean { .. }) => Some(f64::from(others.booleans[variable.index]).into()),
            (Role::Output, Type::String { .. }) => Some(Expression::of(&others.strings[variable.index], [])),
            _ => None,
        });
        Expressions { all: all.collect(), is_inspected }
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
