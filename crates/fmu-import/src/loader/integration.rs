//! Integration of an FMU for model exchange, so that a master can step it like one for co-simulation.
//!
//! After [`Instance::integrate`], [`Instance::exit_initialization_mode`] handles the event at the start, and
//! [`Instance::do_step`] integrates the states from event to event. An input or tunable parameter whose value changes
//! between two steps is set in Event Mode; an input with a slope is set in each evaluation of the derivatives.

use super::calls::Function;
use super::clocks::{Clocks, MOST_ITERATIONS};
use super::error::{CallError, CallProblem};
use super::instance::{Instance, StepEnd};
use super::model_exchange::CompletedStep;
use crate::c_api::Reference;
use crate::signature::Exchange;
use fmu_math::{dense, ode};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum number of steps of the solver, and of events, in a communication step.
const MOST_STEPS: u32 = 1_000_000;
const MOST_EVENTS: u32 = 10_000;
/// An event is located to this fraction of the communication step, or to these units in the last place of the time.
const EVENT_PRECISION: f64 = 1e-12;
const EVENT_ROUNDINGS: f64 = 4.0;
/// Change of a state for its column of the Jacobian, relative to its value: the cube root of the machine precision. Of
/// the time for the derivative with respect to it, relative to the step.
const STATE_CHANGE: f64 = 6e-6;
const TIME_CHANGE: f64 = 1e-5;

/// Solver for the states of an FMU for model exchange.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Solver {
    /// The method.
    pub method: Method,
    /// Limit of a step: its relative error, see [`ode::error_norm`], or for the Runge-Kutta method its length in s.
    pub limit: f64,
}

/// Method that integrates states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Dormand-Prince method of order 5.
    DormandPrince,
    /// Rosenbrock method of order 4 (RODAS), for stiff equations.
    Rosenbrock,
    /// Runge-Kutta method of order 4 with steps of equal length.
    RungeKutta,
}

impl std::fmt::Display for Solver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (method, limit) = match self.method {
            Method::DormandPrince => ("dormand_prince", "tolerance"),
            Method::Rosenbrock => ("rosenbrock", "tolerance"),
            Method::RungeKutta => ("runge_kutta", "max_step"),
        };
        write!(f, "{method}, {limit} {:e}", self.limit)
    }
}

/// The integration between two steps: what a saved state contains in addition to that of the FMU.
#[derive(Debug, Clone, Default)]
pub(super) struct Point {
    time: f64,
    x: Vec<f64>,
    indicators: Vec<f64>,
    /// Length that the last step proposes for the next, 0 if there is none.
    proposed: f64,
    next_event: Option<f64>,
    /// True outside Continuous-Time Mode, where all variables can be set.
    can_set: bool,
    inputs: Vec<Input>,
    /// Start of the communication step, s.
    since: f64,
}

/// An input with a slope, and its value at the start of the communication step.
#[derive(Debug, Clone, Copy)]
struct Input {
    reference: Reference,
    value: f64,
    slope: f64,
}

/// The integrator of an instance. Its steps allocate nothing.
pub(super) struct Integration {
    pub(super) solver: Solver,
    pub(super) point: Point,
    exchange: Exchange,
    nominals: Vec<f64>,
    /// The end of a step, and its error.
    end: Vec<f64>,
    error: Vec<f64>,
    work: Vec<f64>,
    /// State and indicators at a point in a step, and the state at the end of the interval that contains an event.
    found: Vec<f64>,
    indicators: Vec<f64>,
    last: Vec<f64>,
    /// Of the Rosenbrock method: the Jacobian and the derivative with respect to time at the start of the step, and the
    /// factors of the matrix.
    jacobian: Vec<f64>,
    slope: Vec<f64>,
    matrix: Vec<f64>,
    pivots: Vec<usize>,
    is_linearized: bool,
    /// Length of the last step that was tried, s.
    tried: f64,
    /// Numbers in the present communication step.
    steps: u32,
    events: u32,
}

impl Point {
    /// Takes the values of another point. Reuses the memory, because steps are repeated.
    pub(super) fn take(&mut self, from: &Self) {
        let Self { mut x, mut indicators, mut inputs, .. } = std::mem::take(self);
        x.clone_from(&from.x);
        indicators.clone_from(&from.indicators);
        inputs.clone_from(&from.inputs);
        *self = Self { x, indicators, inputs, ..*from };
    }

    /// Sets time, inputs with slopes, and states.
    fn set(&self, fmu: &mut Instance, time: f64, x: &[f64]) -> Result<(), CallError> {
        fmu.set_time(time)?;
        for Input { reference, value, slope } in &self.inputs {
            fmu.set_real(&[*reference], &[value + slope * (time - self.since)])?;
        }
        fmu.set_continuous_states(x)
    }

    fn derivatives(&self, fmu: &mut Instance, time: f64, x: &[f64], to: &mut [f64]) -> Result<(), CallError> {
        self.set(fmu, time, x)?;
        fmu.get_derivatives(to)
    }
}

impl Integration {
    fn new(solver: Solver, exchange: &Exchange, n: usize, indicators: usize) -> Self {
        let zeros = |count: usize| vec![0.0; count];
        let (stages, linear) = match solver.method {
            Method::DormandPrince => (ode::DORMAND_PRINCE_WORK, 0),
            Method::Rosenbrock => (ode::RODAS_WORK, n),
            Method::RungeKutta => (ode::RUNGE_KUTTA_WORK, 0),
        };
        Self {
            solver,
            point: Point { x: zeros(n), indicators: zeros(indicators), can_set: true, ..Point::default() },
            exchange: exchange.clone(),
            nominals: zeros(n),
            end: zeros(n),
            error: zeros(n),
            work: zeros(stages * n),
            found: zeros(n),
            indicators: zeros(indicators),
            last: zeros(n),
            jacobian: zeros(linear * n),
            slope: zeros(linear),
            matrix: zeros(linear * n),
            pivots: vec![0; linear],
            is_linearized: false,
            tried: 0.0,
            steps: 0,
            events: 0,
        }
    }

    /// Makes a step of the method from the present point, without events, to `self.end`; the error is in `self.error`.
    /// Returns false if a step of this length is not possible.
    fn attempt(&mut self, fmu: &mut Instance, h: f64) -> Result<bool, CallError> {
        (self.steps, self.tried) = (self.steps + 1, h);
        if self.steps > MOST_STEPS {
            let Point { since, time, .. } = self.point;
            let reason = format!(
                "more than {MOST_STEPS} steps of the solver between {since} s and {time} s; if the equations are stiff, use \
                 `solver = \"rosenbrock\"`"
            );
            return Err(fmu.failure(Function::GetDerivatives, CallProblem::Events(reason)));
        }
        if self.solver.method == Method::Rosenbrock && !self.linearize(fmu, h)? {
            return Ok(false);
        }
        let Self { point, end, error, work, slope, matrix, pivots, .. } = self;
        let (time, x) = (point.time, &point.x[..]);
        let f = |time, x: &[f64], to: &mut [f64]| point.derivatives(fmu, time, x, to);
        let solve = |b: &mut [f64]| dense::solve(matrix, pivots, x.len(), b);
        match self.solver.method {
            Method::DormandPrince => ode::dormand_prince(f, time, x, h, end, error, work),
            Method::Rosenbrock => ode::rodas(f, solve, time, x, slope, h, end, error, work),
            Method::RungeKutta => ode::runge_kutta(f, time, x, h, end, work),
        }
        .map(|()| true)
    }

    /// Factors the matrix of a step of the Rosenbrock method; returns false if it is singular.
    fn linearize(&mut self, fmu: &mut Instance, h: f64) -> Result<bool, CallError> {
        let Self { exchange, point, nominals, end, error, found, jacobian, slope, matrix, pivots, .. } = self;
        let (n, time) = (point.x.len(), point.time);
        if !self.is_linearized {
            let later = time + TIME_CHANGE * h;
            point.derivatives(fmu, later, &point.x, found)?;
            point.derivatives(fmu, time, &point.x, slope)?;
            let change = (later - time).max(f64::MIN_POSITIVE);
            slope.iter_mut().zip(&*found).for_each(|(slope, later)| *slope = (later - *slope) / change);
            for column in 0..n {
                if exchange.has_derivatives {
                    end.fill(0.0);
                    end[column] = 1.0;
                    fmu.get_directional_derivative(&exchange.derivatives, &exchange.states, end, error)?;
                } else {
                    let change = STATE_CHANGE * point.x[column].abs().max(nominals[column]);
                    let [before, after] = [-change, change].map(|change| point.x[column] + change);
                    end.copy_from_slice(&point.x);
                    end[column] = before;
                    point.derivatives(fmu, time, end, found)?;
                    end[column] = after;
                    point.derivatives(fmu, time, end, error)?;
                    error.iter_mut().zip(&*found).for_each(|(end, start)| *end = (*end - start) / (after - before));
                }
                (0..n).for_each(|row| jacobian[row * n + column] = error[row]);
            }
            self.is_linearized = true;
        }
        matrix.iter_mut().zip(jacobian).for_each(|(element, value)| *element = -*value);
        (0..n).for_each(|i| matrix[i * n + i] += ode::rodas_diagonal(h));
        Ok(dense::factorize(matrix, pivots, n))
    }

    /// Makes a step of at most `limit` seconds to `self.end`. Returns its length.
    fn advance(&mut self, fmu: &mut Instance, limit: f64) -> Result<f64, CallError> {
        self.is_linearized = false;
        let Solver { method, limit: tolerance } = self.solver;
        if method == Method::RungeKutta {
            let h = limit / (limit / self.solver.limit - 1e-6).ceil().max(1.0);
            return self.attempt(fmu, h).map(|_| h);
        }
        let (time, mut proposed) = (self.point.time, self.point.proposed);
        let attempt = |h| match self.attempt(fmu, h) {
            Ok(is_made) => {
                Ok(is_made.then(|| ode::error_norm(&self.point.x, &self.end, &self.error, &self.nominals, tolerance)))
            }
            Err(error) if error.is_discarded() => Ok(None),
            Err(error) => Err(Ok(error)),
        };
        let accepted = ode::controlled(&mut proposed, time, limit, attempt, Err);
        self.point.proposed = proposed;
        accepted.map_err(|stop| {
            stop.unwrap_or_else(|h| {
                let reason =
                    format!("the solver cannot keep the tolerance {tolerance} at {time} s; its step became {h} s");
                fmu.failure(Function::GetDerivatives, CallProblem::Events(reason))
            })
        })
    }

    /// The first event indicator whose sign differs from that at the present point.
    fn crossed(&self) -> Option<usize> {
        let mut signs = self.point.indicators.iter().zip(&self.indicators);
        signs.position(|(before, after)| (*before > 0.0) != (*after > 0.0))
    }

    /// Sets a time and the states in `self.found`, and returns the event indicator that has changed its sign.
    fn evaluate(&mut self, fmu: &mut Instance, time: f64) -> Result<Option<usize>, CallError> {
        self.point.set(fmu, time, &self.found)?;
        fmu.get_event_indicators(&mut self.indicators)?;
        Ok(self.crossed())
    }

    /// Evaluates the end of a step of length `h`, or the point right after the first event in the step. Returns its time
    /// and the event indicator. `target` is the end of the longest step, `precision` that of the time of an event, s.
    fn locate(&mut self, fmu: &mut Instance, h: f64, target: f64, precision: f64) -> Located {
        let time = self.point.time;
        let at = |h: f64| if h >= target - time { target } else { time + h };
        self.found.copy_from_slice(&self.end);
        if self.evaluate(fmu, at(h))?.is_none() {
            return Ok((at(h), None));
        }
        let (mut low, mut high) = (0.0, h);
        self.last.copy_from_slice(&self.end);
        while high - low > precision.max(rounding(time)) {
            let middle = 0.5 * (low + high);
            if self.solver.method == Method::DormandPrince {
                let Self { point, end, work, found, .. } = self;
                ode::dormand_prince_within(middle / h, &point.x, h, end, work, found);
            } else {
                self.attempt(fmu, middle)?;
                self.found.copy_from_slice(&self.end);
            }
            if self.evaluate(fmu, time + middle)?.is_some() {
                high = middle;
                self.last.copy_from_slice(&self.found);
            } else {
                low = middle;
            }
        }
        self.found.copy_from_slice(&self.last);
        Ok((at(high), self.evaluate(fmu, at(high))?))
    }

    /// Handles an event at the present point, at which the clocks in `due` tick, and enters Continuous-Time Mode.
    fn event(&mut self, fmu: &mut Instance, crossed: Option<usize>, mut due: Vec<Reference>) -> Result<(), CallError> {
        let Self { point, nominals, events, .. } = self;
        *events += 1;
        if *events > MOST_EVENTS {
            let name =
                |i: usize| self.exchange.indicators.get(i).map_or(format!("{}", i + 1), |name| format!("`{name}`"));
            let cause = crossed.map_or("no event indicator".to_owned(), |i| format!("event indicator {}", name(i)));
            let reason = format!(
                "more than {MOST_EVENTS} events between {} s and {} s, the last of {cause}; let the model come to rest, or use \
                 shorter steps",
                point.since, point.time
            );
            return Err(fmu.failed_event(reason));
        }
        // New inputs leave the states as they are, so the proposed step stays valid.
        let mut is_smooth = std::mem::replace(&mut point.can_set, true);
        if !is_smooth {
            fmu.enter_event_mode()?;
        }
        for _ in 0..MOST_ITERATIONS {
            fmu.activate(&std::mem::take(&mut due))?;
            fmu.evaluate()?;
            let update = fmu.update_clocks(point.time)?;
            if update.terminates {
                return Err(ended(fmu, Function::NewDiscreteStates, point.time));
            }
            is_smooth &= !update.states_changed;
            if !update.is_needed_again {
                point.next_event = update.next_event;
                point.proposed = if is_smooth { point.proposed } else { 0.0 };
                fmu.enter_continuous_time_mode()?;
                point.can_set = false;
                fmu.get_continuous_states(&mut point.x)?;
                fmu.get_nominals(nominals)?;
                return fmu.get_event_indicators(&mut point.indicators);
            }
        }
        let reason = format!("the event at {} s needs more than {MOST_ITERATIONS} updates", point.time);
        Err(fmu.failed_event(reason))
    }

    /// Makes a communication step, from event to event.
    fn step(&mut self, fmu: &mut Instance, time: f64, step: f64) -> Result<(), CallError> {
        let end = time + step;
        // A time event that is later only by rounding belongs to this step, but no FMU is asked to pass its stop time.
        let last = end + rounding(end);
        let last = fmu.experiment().1.map_or(last, |stop| last.min(stop).max(end));
        (self.point.since, self.steps, self.events) = (time, 0, 0);
        if self.point.can_set || fmu.is_event_needed(time, step) {
            self.event(fmu, None, fmu.due_clocks(time, step))?;
        } else if !self.point.inputs.is_empty() {
            // The new values of inputs with slopes may be those after a jump.
            self.found.copy_from_slice(&self.point.x);
            if let crossed @ Some(_) = self.evaluate(fmu, self.point.time)? {
                self.event(fmu, crossed, Vec::new())?;
            }
        }
        loop {
            let now = self.point.time;
            let due = self.point.next_event.filter(|next| *next <= last);
            // As in co-simulation, a clock that is due at the end of the step ticks in the next one.
            let has_ticks = now < end && fmu.is_due(now, step);
            if has_ticks || due.is_some_and(|due| due <= now) {
                let clocks = if has_ticks { fmu.due_clocks(now, step) } else { Vec::new() };
                self.event(fmu, None, clocks)?;
                continue;
            }
            if now >= end {
                return Ok(());
            }
            let target = due.into_iter().chain(fmu.next_tick(now, end, step)).reduce(f64::min).unwrap_or(end);
            let mut limit = target - self.point.time;
            let (time, crossed) = loop {
                let located =
                    self.advance(fmu, limit).and_then(|h| self.locate(fmu, h, target, EVENT_PRECISION * step));
                match located {
                    // The equations are not defined somewhere in the step; a shorter one may stay where they are.
                    Err(error) if error.is_discarded() && self.tried > rounding(self.point.time) => {
                        limit = 0.5 * self.tried;
                        self.point.proposed = limit;
                    }
                    located => break located?,
                }
            };
            self.point.time = time;
            self.point.x.copy_from_slice(&self.found);
            let needs_call = self.exchange.needs_completed_step;
            let completed = if needs_call { fmu.completed_integrator_step()? } else { CompletedStep::default() };
            if completed.terminates {
                return Err(ended(fmu, Function::CompletedIntegratorStep, time));
            }
            self.point.indicators.copy_from_slice(&self.indicators);
            if crossed.is_some() || completed.enters_event_mode {
                self.event(fmu, crossed, Vec::new())?;
            }
        }
    }
}

/// Shortest interval at a time that is not lost in rounding, s.
fn rounding(time: f64) -> f64 {
    EVENT_ROUNDINGS * (time.abs().next_up() - time.abs())
}

/// A time, and the event indicator that has changed its sign.
type Located = Result<(f64, Option<usize>), CallError>;

/// The FMU ends the simulation at this time.
#[cold]
fn ended(fmu: &mut Instance, function: Function, time: f64) -> CallError {
    (fmu.step_end.terminate, fmu.step_end.time) = (1, time);
    fmu.failure(function, CallProblem::Terminated)
}

impl Instance {
    /// Lets [`Self::do_step`] integrate the states. Call this right after instantiation for model exchange.
    pub fn integrate(&mut self, solver: Solver) {
        let (states, indicators) = (self.number_of_states(), self.number_of_event_indicators());
        let exchange = &self.signature().exchange;
        self.integration = Some(Box::new(Integration::new(solver, exchange, states, indicators)));
        self.clocks = Clocks::of(self.signature(), self.signature().has_clocks);
    }

    /// Accesses the integrator. In the meantime, variables are set at once.
    fn with_integration<T: Default>(
        &mut self,
        access: impl FnOnce(&mut Integration, &mut Self) -> Result<T, CallError>,
    ) -> Result<T, CallError> {
        let Some(mut own) = self.integration.take() else { return Ok(T::default()) };
        let result = access(&mut own, self);
        self.integration = Some(own);
        result
    }

    /// After the initialization: the event at the start.
    pub(super) fn start_integration(&mut self) -> Result<(), CallError> {
        let start = self.experiment().0;
        self.with_integration(|own, this| {
            own.point.time = start;
            own.event(this, None, Vec::new())
        })
    }

    /// Makes a communication step.
    pub(super) fn step_integration(&mut self, time: f64, step: f64) -> Result<(), CallError> {
        self.step_end = StepEnd::default();
        self.clear_ticks();
        self.with_integration(|own, this| own.step(this, time, step))
    }

    /// Returns true if variables are to be set now. In Continuous-Time Mode, this enters Event Mode if one of them
    /// changes; otherwise they have these values, or are inputs with slopes, which are set during the integration.
    pub(super) fn is_set_now<T: Copy + Default + PartialEq>(
        &mut self,
        refs: &[Reference],
        values: &[T],
        get: impl Fn(&mut Self, &[Reference], &mut [T]) -> Result<(), CallError>,
    ) -> Result<bool, CallError> {
        if self.integration.as_ref().is_none_or(|own| own.point.can_set) {
            return Ok(true);
        }
        self.with_integration(|own, this| {
            let are_scalars = refs.len() == values.len();
            let mut is_changed = !are_scalars;
            for (reference, value) in refs.iter().zip(values).filter(|_| are_scalars) {
                if own.point.inputs.iter().all(|input| input.reference != *reference) {
                    let mut now = [T::default()];
                    get(this, &[*reference], &mut now)?;
                    is_changed |= now != [*value];
                }
            }
            if is_changed {
                this.enter_event_mode()?;
                own.point.can_set = true;
            }
            Ok(is_changed)
        })
    }

    /// New values of inputs with slopes; the slopes are 0 until they are set.
    pub(super) fn keep_inputs(&mut self, refs: &[Reference], values: &[f64]) {
        for input in self.integration.iter_mut().flat_map(|own| &mut own.point.inputs) {
            if let Some((_, value)) = refs.iter().zip(values).find(|(reference, _)| **reference == input.reference) {
                (input.value, input.slope) = (*value, 0.0);
            }
        }
    }

    /// Slopes of inputs from the values that were set last.
    pub(super) fn keep_slopes(&mut self, refs: &[Reference], slopes: &[f64]) -> Result<(), CallError> {
        self.with_integration(|own, this| {
            for (&reference, &slope) in refs.iter().zip(slopes) {
                if let Some(input) = own.point.inputs.iter_mut().find(|input| input.reference == reference) {
                    input.slope = slope;
                } else {
                    let mut value = [0.0];
                    this.get_real(&[reference], &mut value)?;
                    own.point.inputs.push(Input { reference, value: value[0], slope });
                }
            }
            Ok(())
        })
    }
}
