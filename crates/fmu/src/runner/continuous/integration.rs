//! Integration of a continuous-time model over a communication step, from event to event.

use std::marker::PhantomData;

use fmu_math::ode;

use super::{
    Context, ContinuousModel, Progress, Run, RunnerState, StateOf, Step, branches, check_discrete, check_reals,
    is_stiff,
};
use crate::model::{At, Continuous, Event, Solver, is_crossing};
use crate::runner::{MOST_PARTS, became};
use crate::solver::{Interval, Keep, Line, Problem, Scratch};
use crate::variables::Variables as _;

/// Maximum number of events in one communication step, to detect ever shorter intervals (Zeno behavior).
pub(super) const MOST_EVENTS: u32 = 10_000;

/// Takes one solver step from a time and state, with a maximum length in s. Returns the new state and the length.
type Advance<'f, 'a, M, K, const PAUSES: bool> = &'f mut dyn FnMut(
    &mut Integration<'a, M, K, PAUSES>,
    f64,
    &<K as Keep<M>>::State,
    f64,
) -> Result<(<K as Keep<M>>::State, f64), String>;

pub(super) const fn has_error_control(solver: Solver) -> bool {
    matches!(solver, Solver::DormandPrince { .. } | Solver::Rosenbrock { .. })
}

/// Time of the next time event in s. Fails if it is before the present time or is NaN.
pub(super) fn next_time_event<M: Continuous>(model: &M, at: At<'_, f64, M>) -> Result<Option<f64>, String> {
    let next = model.next_time_event(at);
    if let Some(next) = next.filter(|next| next.is_nan() || *next < at.time) {
        return Err(format!(
            "`next_time_event` must not return a time before the present one, {} s, got {next} s; compute it from the \
             time of the last event, or from the start time, which `initial_discrete_state` gets as `at.time`",
            at.time
        ));
    }
    Ok(next)
}

pub(super) fn too_many_at(time: f64) -> String {
    format!("more than {MOST_EVENTS} time events at {time} s; `on_event` must change what `next_time_event` returns")
}

/// Advances the state over a communication step; `K` stores the states. With `PAUSES`, stops after an integrator step.
struct Integration<'a, M: Continuous, K, const PAUSES: bool> {
    problem: Problem<'a, M>,
    run: &'a mut StateOf<M>,
    progress: Progress,
    stops_at_events: bool,
    /// Time in s of the event at which the step stopped.
    stopped: Option<f64>,
    keeping: PhantomData<K>,
}

/// Returns true if the model declares zero crossings or time events.
pub(super) const fn has_events<M: Continuous>() -> bool {
    size_of::<M::Crossings>() > 0 || M::HAS_TIME_EVENTS
}

impl Progress {
    /// Start, length and end of the rest of a part with this start, length and end.
    fn rest(&self, (start, h, end): (f64, f64, f64)) -> (f64, f64, f64) {
        let last = end.min(self.end);
        let is_whole = self.time <= start && last >= end;
        (self.time, if is_whole { h } else { last - self.time }, last)
    }
}

impl<'a, M: Continuous, K: Keep<M>, const PAUSES: bool> Integration<'a, M, K, PAUSES> {
    /// The state after a part of the step with length `h` in s, which ends at `end`.
    fn part(&mut self, time: f64, x: K::State, h: f64, end: f64) -> Result<K::State, String> {
        if !has_events::<M>() {
            let after = self.fixed(time, &x, h);
            self.recycle(x);
            return Ok(after);
        }
        self.until(time, x, end, &mut |this: &mut Self, time, x, limit| Ok((this.fixed(time, x, limit), limit)))
    }

    /// The state at `end`, computed by a solver with error control.
    fn controlled(&mut self, time: f64, x: K::State, end: f64, tolerance: f64) -> Result<K::State, String> {
        self.until(time, x, end, &mut |this: &mut Self, time, x, limit| this.accepted(time, x, limit, tolerance))
    }

    /// Takes one step that the error control accepts, at most `limit` s long.
    fn accepted(&mut self, time: f64, x: &K::State, limit: f64, tolerance: f64) -> Result<(K::State, f64), String> {
        let Self { problem, run, progress, .. } = self;
        let failed = |h| format!("the solver cannot keep the tolerance {tolerance} at {time} s; its step became {h} s");
        let (mut proposed, mut end) = (run.proposed, None);
        let attempt = |h| {
            progress.attempts += 1;
            if progress.attempts as f64 > MOST_PARTS {
                return Err(failed(h));
            }
            end.take().into_iter().for_each(|rejected| K::recycle(rejected, &mut run.scratch));
            end = K::estimated(problem, x, Interval { time, h, discrete: &run.discrete }, &mut run.scratch);
            Ok(end.as_ref().map(|end| K::error_norm(x, end, tolerance, &run.scratch)))
        };
        let h = ode::controlled(&mut proposed, time, limit, attempt, failed)?;
        run.proposed = proposed;
        end.map(|end| (end, h)).ok_or_else(|| failed(h))
    }

    /// Advances to `end`, from event to event.
    fn until(
        &mut self,
        mut time: f64,
        mut x: K::State,
        end: f64,
        advance: Advance<'_, 'a, M, K, PAUSES>,
    ) -> Result<K::State, String> {
        if !has_events::<M>() {
            while time < end {
                let limit = end - time;
                let (after, h) = advance(self, time, &x, limit)?;
                time = if h >= limit { end } else { time + h };
                self.replace(&mut x, after);
                if PAUSES {
                    break;
                }
            }
            if PAUSES {
                self.progress.time = time;
            }
            return Ok(x);
        }
        self.changed_by_inputs(time, &mut x)?;
        let mut has_advanced = false;
        loop {
            self.problem.move_to::<K>(time);
            let next = K::show(&x, self.problem.lengths, |x| {
                let at = self.problem.at(self.progress.reached, x, &self.run.discrete);
                next_time_event(self.problem.model, at)
            })?;
            let due = next.filter(|next| *next <= end);
            // An event is due if it is not after the start of this step or the end of the previous step, which differ
            // by rounding errors.
            if let Some(due) = due.filter(|due| *due <= time.max(self.progress.reached)) {
                self.progress.reached = due;
                self.progress.handled = due;
                self.event(time, &mut x, &[], &[], true)?;
                continue;
            }
            let is_finished = M::CAN_FINISH && self.problem.model.is_finished(&self.run.discrete);
            if is_finished {
                self.stopped = Some(time);
            }
            if is_finished || time >= end || (PAUSES && has_advanced) {
                if PAUSES {
                    self.progress.time = time;
                }
                return Ok(x);
            }
            has_advanced = true;
            let target = due.unwrap_or(end);
            let limit = target - time;
            let (after, h) = advance(self, time, &x, limit)?;
            let before_values = self.crossings(time, &x);
            let after_values = self.crossings(time + h, &after);
            let found = self.locate(time, &x, h, before_values.as_ref(), after_values.as_ref());
            let at = found.as_ref().map_or(time + h, |(at, ..)| *at);
            // Rounding of `limit` must not move the time past the time event.
            let is_at_limit = (found.is_none() && h >= limit) || at >= target.min(time + limit);
            time = if is_at_limit { target } else { at };
            self.progress.reached = self.progress.reached.max(time);
            if self.stops_at_events && (found.is_some() || (is_at_limit && due.is_some())) {
                self.stopped = Some(time);
                if PAUSES {
                    self.progress.time = time;
                }
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
                    self.run.crossings.clear();
                    self.run.crossings.extend_from_slice(after_values.as_ref());
                }
            }
            if is_at_limit && due.is_some() {
                self.progress.handled = time;
                self.event(time, &mut x, &[], &[], true)?;
            }
        }
    }

    /// Handles an event at the start of a step if inputs or parameters have changed the sign of a zero crossing.
    fn changed_by_inputs(&mut self, time: f64, x: &mut K::State) -> Result<(), String> {
        let now = self.crossings(time, x);
        if self.run.crossings.iter().zip(now.as_ref()).any(|(before, now)| is_crossing(*before, *now)) {
            let before = std::mem::take(&mut self.run.crossings);
            return self.event(time, x, &before, now.as_ref(), false);
        }
        self.run.crossings.clear();
        self.run.crossings.extend_from_slice(now.as_ref());
        Ok(())
    }

    fn crossings(&mut self, time: f64, x: &K::State) -> Crossings<M> {
        if size_of::<M::Crossings>() == 0 {
            return Crossings(None);
        }
        self.problem.move_to::<K>(time);
        let crossings = K::show(x, self.problem.lengths, |x| {
            self.problem.model.zero_crossings(self.problem.at(time, x, &self.run.discrete))
        });
        Crossings(Some(crossings))
    }

    /// Finds the first event in a step. Returns its time, and the state and the values of the zero crossings just after
    /// it.
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
        // Bisection: the event is after `low` and not after `high`. Every state is computed with one step from `time`.
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

    /// The state after one solver step, without error control.
    fn single(&mut self, time: f64, x: &K::State, h: f64) -> Option<K::State> {
        if has_error_control(M::SOLVER) {
            let Self { problem, run, .. } = self;
            K::estimated(problem, x, Interval { time, h, discrete: &run.discrete }, &mut run.scratch)
        } else {
            Some(self.fixed(time, x, h))
        }
    }

    /// The state after one step of fixed length.
    #[inline]
    fn fixed(&mut self, time: f64, x: &K::State, h: f64) -> K::State {
        let Self { problem, run, .. } = self;
        K::fixed(problem, x, Interval { time, h, discrete: &run.discrete }, &mut run.scratch)
    }

    #[inline]
    fn replace(&mut self, x: &mut K::State, after: K::State) {
        self.recycle(std::mem::replace(x, after));
    }

    #[inline]
    fn recycle(&mut self, x: K::State) {
        K::recycle(x, &mut self.run.scratch);
    }

    fn event(
        &mut self,
        time: f64,
        x: &mut K::State,
        before: &[f64],
        after: &[f64],
        is_timed: bool,
    ) -> Result<(), String> {
        let Progress { events, first_event, .. } = &mut self.progress;
        if *events == 0 {
            *first_event = time;
            // With clocks inside the step, the state before the first tick is known.
            if M::CLOCKS.is_empty() || self.run.before_events.is_none() {
                self.run.before_events = Some((self.run.discrete.clone(), self.run.schedules.clone()));
            }
        }
        *events += 1;
        if *events > MOST_EVENTS && is_timed && time <= *first_event {
            return Err(too_many_at(time));
        }
        if *events > MOST_EVENTS {
            return Err(format!(
                "more than {MOST_EVENTS} events between {first_event} s and {time} s; let the model come to rest, or use \
                 shorter steps"
            ));
        }
        self.problem.move_to::<K>(time);
        let Self { problem: Problem { model, inputs, derived, lengths, .. }, run, .. } = self;
        let RunnerState { discrete, scratch, .. } = &mut **run;
        K::change(x, lengths, |state| {
            model.on_event(Event { time, state, discrete, inputs, derived, is_timed, before, after });
        });
        scratch.forget_structure();
        // The solution is not smooth at an event: the proposed step is no longer valid.
        self.run.proposed = 0.0;
        let values = self.crossings(time, x);
        self.run.crossings.clear();
        self.run.crossings.extend_from_slice(values.as_ref());
        check_discrete(&self.run.discrete, time)
    }
}

/// Values of the declared zero crossings.
struct Crossings<M: Continuous>(Option<M::Crossings>);

impl<M: Continuous> Crossings<M> {
    fn as_ref(&self) -> &[f64] {
        self.0.as_ref().map_or(&[], AsRef::as_ref)
    }
}

impl<M: Continuous, const MODEL_EXCHANGE: bool, const LINEAR: bool> ContinuousModel<M, MODEL_EXCHANGE, LINEAR> {
    /// Advances the states from `progress` to the end of the step or, with `PAUSES`, over one integrator step. If this
    /// fails, the values are unchanged; the discrete state may have changed.
    #[inline]
    pub(super) fn advance<K: Keep<M>, const PAUSES: bool>(
        Run { ctx, run, values }: Run<'_, Self>,
        step: Step,
        parts: u64,
        progress: &mut Progress,
    ) -> Result<Option<f64>, String> {
        let Context { p, derived, layout, .. } = ctx;
        if run.scratch.is_missing::<M>() {
            run.scratch = Scratch::new::<M>(layout);
        }
        if has_error_control(M::SOLVER) && M::HAS_STRUCTURE {
            let (all, missing) = (layout.states.counts.reals, layout.missing_states(&values.lengths));
            run.scratch.weight = f64::sqrt(all as f64 / (all - missing).max(1) as f64);
        }
        if is_stiff::<M>() {
            let branches = branches(layout, values, &run.discrete);
            if std::mem::replace(&mut run.scratch.branches, branches) != branches {
                run.scratch.forget_structure();
            }
        }
        let has_slopes = K::LINEAR && step.has_slopes;
        let line = has_slopes.then(|| Line::new(layout, values, progress.time, std::mem::take(&mut run.scratch.moved)));
        let inputs = M::Inputs::read(values.view(), layout.inputs.at);
        let before = K::load(values.view(), layout.states.at, &mut run.scratch);
        let mut x = K::load(values.view(), layout.states.at, &mut run.scratch);
        let problem = Problem { model: p, inputs, derived, lengths: &values.lengths, line };
        let start = *progress;
        let mut integration = Integration::<M, K, PAUSES> {
            problem,
            run,
            progress: start,
            stops_at_events: step.stops_at_events,
            stopped: None,
            keeping: PhantomData,
        };
        if has_error_control(M::SOLVER) {
            let tolerance = layout.solver.map_or(1e-6, |index| values.reals[index]);
            x = integration.controlled(start.time, x, start.end, tolerance)?;
        } else {
            let h = step.step / parts as f64;
            for part in start.part..parts {
                // Each part ends exactly where the next part starts; no time event can be between them.
                let start_of = |part: u64| step.time + part as f64 * h;
                let part_end = if part + 1 == parts { step.time + step.step } else { start_of(part + 1) };
                let whole = (start_of(part), h, part_end);
                let (time, length, end) = if PAUSES { start.rest(whole) } else { whole };
                x = integration.part(time, x, length, end)?;
                if PAUSES {
                    if !has_events::<M>() {
                        integration.progress.time = end;
                    }
                    integration.progress.part += u64::from(integration.progress.time >= part_end);
                    break;
                }
                if has_events::<M>() && integration.stopped.is_some() {
                    break;
                }
            }
        }
        let Integration { stopped, progress: Progress { time, handled, .. }, problem, .. } = integration;
        let end = if PAUSES { time } else { step.time + step.step };
        let moved = problem.line.map(|line| line.into_reals(stopped.unwrap_or(end)));
        if PAUSES {
            *progress = integration.progress;
        }
        if has_events::<M>()
            && let Some(exchange) = &mut run.exchange
        {
            exchange.handled = if stopped.is_some() { handled } else { end };
            exchange.announced = stopped.unwrap_or(f64::INFINITY);
        }
        let moved = moved.filter(|_| K::LINEAR);
        if let Some((number, value)) = moved.iter().flatten().enumerate().find(|(_, value)| !value.is_finite()) {
            return Err(became(layout.real_name(layout.inputs.at.reals + number), *value, end));
        }
        K::store(&x, &mut values.view_mut(), layout.states.at);
        check_reals(layout, layout.states, values, end)
            .inspect_err(|_| K::store(&before, &mut values.view_mut(), layout.states.at))?;
        if let Some(moved) = moved {
            values.reals[layout.inputs.reals()].copy_from_slice(&moved);
            run.scratch.moved = moved;
        }
        K::recycle(x, &mut run.scratch);
        K::recycle(before, &mut run.scratch);
        Ok(stopped)
    }
}
