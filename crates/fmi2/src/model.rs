//! What a model author writes: a plant as an ordinary differential equation, perhaps with its exact solution, or a
//! sampled unit.

use std::path::Path;

use crate::block::{Block, Design, Memory, Parameters};
use crate::clock::samples_before;
pub use crate::clock::slack;
use crate::scalar::{Dependencies, Dual64, Scalar};
use crate::variable::Layout;

/// Facts about a model that are not variables.
#[derive(Clone, Copy, Debug)]
pub struct Info {
    /// Name of the FMU: model identifier, file stem and name of the library.
    pub name: &'static str,
    /// One sentence.
    pub description: &'static str,
    /// Version of the package that holds the model, as in `env!("CARGO_PKG_VERSION")`.
    pub version: &'static str,
    /// Length of the default experiment in s.
    pub stop_time: f64,
    /// Communication step of the default experiment in s.
    pub step_size: f64,
}

/// Parameters with a sample time; implemented by the derive for a struct with the field `sample_time`.
#[diagnostic::on_unimplemented(
    message = "the parameters of a sampled unit need the field `sample_time: f64`",
    note = "for example `#[par(SAMPLE_TIME, start = 0.001)] pub sample_time: f64`"
)]
pub trait HasSampleTime {
    /// Time from one sample to the next in s, > 0.
    fn sample_time(&self) -> f64;
}

/// Parameters with an integration step; implemented by the derive for a struct with the field `max_step`.
#[diagnostic::on_unimplemented(
    message = "the parameters of a plant need the field `max_step: f64`",
    note = "for example `#[par(MAX_STEP, start = 0.00025)] pub max_step: f64`"
)]
pub trait HasMaxStep {
    /// Longest step of the integrator in s, > 0.
    fn max_step(&self) -> f64;
}

/// A plant: x' = derivatives(p, x, u), y = outputs(p, x, u).
///
/// The exporter integrates it with the classical Runge-Kutta method of order 4 in
/// n = max(1, ceil(h / `max_step` - 1e-6)) equal substeps of the communication step h, the inputs held; a plant that is
/// [`Advancing`] too takes the communication step at once.
pub trait Plant: Sized + 'static {
    /// Facts about the model.
    const INFO: Info;
    /// The parameters; the field `max_step` belongs to them unless the plant is [`Advancing`].
    type Parameters: Parameters + Send;
    /// What follows from the fixed parameters; `()` if nothing does.
    type Design: Design;
    /// The continuous state; also the type of its time derivative.
    type State<T: Scalar>: Block<T>;
    /// The inputs.
    type Inputs<T: Scalar>: Block<T>;
    /// The outputs that are not states.
    type Outputs<T: Scalar>: Block<T>;

    /// Computes the design block. It may use fixed parameters only.
    ///
    /// # Errors
    /// A sentence that names the parameter and what was expected.
    fn design(p: &Self::Parameters) -> Result<Self::Design, String>;
    /// Writes the states whose start value follows from fixed parameters, always the same ones; they are calculated at
    /// the start and cannot be set. The others keep their declared start value, or what was set before the start.
    fn begin(_p: &Self::Parameters, _x: &mut Self::State<f64>) {}
    /// Time derivative of the state.
    fn derivatives<T: Scalar>(
        p: &Self::Parameters,
        d: &Self::Design,
        x: &Self::State<T>,
        u: &Self::Inputs<T>,
    ) -> Self::State<T>;
    /// Outputs for the present state and inputs.
    fn outputs<T: Scalar>(
        p: &Self::Parameters,
        d: &Self::Design,
        x: &Self::State<T>,
        u: &Self::Inputs<T>,
    ) -> Self::Outputs<T>;
}

/// A plant whose state for held inputs is known in closed form: x(t + h) = advance(p, x, u, h) takes the place of the
/// integrator, and no `max_step` is needed.
pub trait Advancing: Plant {
    /// State after the step `h` in s, > 0.
    fn advance(
        p: &Self::Parameters,
        d: &Self::Design,
        x: &Self::State<f64>,
        u: &Self::Inputs<f64>,
        h: f64,
    ) -> Self::State<f64>;
}

/// Whether an output of a source can depend on a parameter, both by name. `true` if it does so at any time of a run with
/// any values of the other parameters; tools read it from the model structure.
pub type Influence = fn(output: &str, parameter: &str) -> bool;

/// A sampled unit: a controller, or a source of signals. Sample n is due at start + n * `sample_time`; it reads the
/// inputs as they were set before the step, and its outputs are held until the next sample.
pub trait Sampled: Sized + 'static {
    /// Facts about the model.
    const INFO: Info;
    /// The parameters.
    type Parameters: Parameters + HasSampleTime + Send;
    /// What follows from the fixed parameters; `()` if nothing does.
    type Design: Design;
    /// What it remembers from one sample to the next; `()` if nothing.
    type Memory: Memory;
    /// The inputs.
    type Inputs: Block<f64>;
    /// The outputs; their start values hold until the first sample, except in a source.
    type Outputs: Block<f64>;

    /// `Some` makes the unit a source: from Initialization Mode on its outputs have the values of its first sample. That
    /// sample must not depend on the inputs; before the start it is taken with their start values.
    const SOURCE: Option<Influence> = None;

    /// Computes the design block. It may use fixed parameters only.
    ///
    /// # Errors
    /// A sentence that names the parameter and what was expected.
    fn design(p: &Self::Parameters) -> Result<Self::Design, String>;
    /// Like [`Self::design`], for a unit that reads files: `resources` is the resources folder of the FMU.
    ///
    /// # Errors
    /// As [`Self::design`].
    fn load(p: &Self::Parameters, _resources: &Path) -> Result<Self::Design, String> {
        Self::design(p)
    }
    /// A number that tells two contents of the files read by [`Self::load`] apart; a saved state is only continued
    /// with the same content.
    fn fingerprint(_d: &Self::Design) -> u64 {
        0
    }
    /// The memory at the start.
    fn begin(_p: &Self::Parameters, _d: &Self::Design) -> Self::Memory {
        Self::Memory::default()
    }
    /// Looks at a sample before it is taken: a unit that cannot follow any finite input refuses the step here.
    ///
    /// # Errors
    /// A sentence that names the input and what was expected.
    fn check(
        _p: &Self::Parameters,
        _d: &Self::Design,
        _x: &Self::Memory,
        _u: &Self::Inputs,
        _t: f64,
    ) -> Result<(), String> {
        Ok(())
    }
    /// One sample at time `t` in s.
    fn update(p: &Self::Parameters, d: &Self::Design, x: &mut Self::Memory, u: &Self::Inputs, t: f64) -> Self::Outputs;
}

/// A result that is not a finite number, or a step that cannot be taken.
#[derive(Debug)]
pub enum StepError {
    /// The real variable of this index is not finite.
    NotFinite {
        /// Index among the reals.
        index: usize,
        /// Its value.
        value: f64,
        /// When, in s.
        time: f64,
    },
    /// The unit refused a sample.
    Refused(String),
    /// This field of the memory is not finite.
    MemoryNotFinite {
        /// Name of the field.
        name: &'static str,
        /// Its value.
        value: f64,
        /// When, in s.
        time: f64,
    },
}

/// The most substeps or samples in one communication step.
pub const MOST_PARTS: f64 = 1e6;

/// Where a step stands: `[time, time + step)`, sample 0 at `start`.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    /// Start of the experiment in s.
    pub start: f64,
    /// Begin of the step in s.
    pub time: f64,
    /// Length of the step in s.
    pub step: f64,
    /// Number of the next sample.
    pub sample: u64,
}

/// How the state of the plant `P` gets over a communication step.
pub trait Stepper<P: Plant>: 'static {
    /// Into how many equal parts a step of `h` s is divided.
    fn parts(p: &P::Parameters, h: f64) -> f64;
    /// State after one part of `h` s, the inputs held.
    fn advance(p: &P::Parameters, d: &P::Design, x: &P::State<f64>, u: &P::Inputs<f64>, h: f64) -> P::State<f64>;
}

/// The classical Runge-Kutta method of order 4 with parts not longer than `max_step`.
#[derive(Debug)]
pub struct RungeKutta;

/// The solution of an [`Advancing`] plant, in one part.
#[derive(Debug)]
pub struct Exact;

/// How an instance runs a model; [`PlantModel`] and [`SampledModel`] implement it for what authors write.
pub trait Model: 'static {
    /// Facts about the model.
    const INFO: Info;
    /// Whether states and derivatives are exposed and outputs follow the inputs at once.
    const IS_PLANT: bool;
    /// See [`Sampled::SOURCE`].
    const SOURCE: Option<Influence>;
    /// Whether the outputs are calculated at the start, instead of having start values.
    const CALCULATES_OUTPUTS: bool = Self::IS_PLANT || Self::SOURCE.is_some();
    /// The parameters.
    type Parameters: Parameters + Send;
    /// What follows from the fixed parameters.
    type Design: Design;
    /// Memory of a sampled unit.
    type Memory: Memory;

    /// Numbers all variables.
    fn layout() -> Layout;
    /// See [`Sampled::load`].
    ///
    /// # Errors
    /// A sentence that names the parameter and what was expected.
    fn load(p: &Self::Parameters, resources: &Path) -> Result<Self::Design, String>;
    /// See [`Sampled::fingerprint`].
    fn fingerprint(d: &Self::Design) -> u64;
    /// See [`Sampled::begin`].
    fn begin(p: &Self::Parameters, d: &Self::Design) -> Self::Memory;
    /// Time from one sample to the next in s; none in a plant.
    fn sample_time(p: &Self::Parameters) -> Option<f64>;
    /// See [`Plant::begin`].
    fn begin_states(p: &Self::Parameters, layout: &Layout, reals: &mut [f64]);
    /// Into how many substeps or samples the step is divided; more than [`MOST_PARTS`] are refused.
    fn parts(p: &Self::Parameters, step: Step) -> f64;
    /// Advances states (plant) or outputs and memory (sampled unit) over `parts` parts.
    ///
    /// # Errors
    /// When a number is not finite or a sample is refused; `reals` is kept then, the memory is not.
    fn step(
        p: &Self::Parameters,
        d: &Self::Design,
        x: &mut Self::Memory,
        layout: &Layout,
        reals: &mut [f64],
        step: Step,
        parts: u64,
    ) -> Result<(), StepError>;
    /// Computes the outputs of a plant, or those of the first sample of a source, which is due at `start`.
    fn outputs(p: &Self::Parameters, d: &Self::Design, layout: &Layout, reals: &mut [f64], start: f64);
    /// Computes the derivatives of a plant.
    fn derivatives(p: &Self::Parameters, d: &Self::Design, layout: &Layout, reals: &mut [f64]);
    /// Derivatives of all outputs and state derivatives along `direction` (inputs, then states), outputs first.
    fn directional(
        p: &Self::Parameters,
        d: &Self::Design,
        layout: &Layout,
        reals: &[f64],
        direction: &[f64],
        result: &mut [f64],
    );
    /// What outputs, then state derivatives depend on: the known variables are the inputs, then the states.
    fn dependencies(p: &Self::Parameters, d: &Self::Design) -> Vec<Dependencies>;
}

/// Runs a [`Plant`].
#[derive(Debug)]
pub struct PlantModel<P, S = RungeKutta>(std::marker::PhantomData<(P, S)>);

/// Runs a [`Sampled`] unit.
#[derive(Debug)]
pub struct SampledModel<S>(std::marker::PhantomData<S>);

impl<P: Plant> Stepper<P> for RungeKutta
where
    P::Parameters: HasMaxStep,
{
    fn parts(p: &P::Parameters, h: f64) -> f64 {
        // Said apart for the usual case, whose equations need not wait for the divisions then.
        if h <= p.max_step() { 1.0 } else { (h / p.max_step() - 1e-6).ceil().max(1.0) }
    }

    #[inline]
    fn advance(p: &P::Parameters, d: &P::Design, x: &P::State<f64>, u: &P::Inputs<f64>, h: f64) -> P::State<f64> {
        let k1 = P::derivatives(p, d, x, u);
        let k2 = P::derivatives(p, d, &x.zip(&k1, |x, k| x + 0.5 * h * k), u);
        let k3 = P::derivatives(p, d, &x.zip(&k2, |x, k| x + 0.5 * h * k), u);
        let k4 = P::derivatives(p, d, &x.zip(&k3, |x, k| x + h * k), u);
        let slope = k1.zip(&k2, |a, b| a + 2.0 * b).zip(&k3, |a, b| a + 2.0 * b).zip(&k4, |a, b| a + b);
        x.zip(&slope, |x, s| x + h / 6.0 * s)
    }
}

impl<P: Advancing> Stepper<P> for Exact {
    fn parts(_: &P::Parameters, _: f64) -> f64 {
        1.0
    }

    #[inline]
    fn advance(p: &P::Parameters, d: &P::Design, x: &P::State<f64>, u: &P::Inputs<f64>, h: f64) -> P::State<f64> {
        P::advance(p, d, x, u, h)
    }
}

/// Whether all are finite numbers: 0 times anything else is not 0.
#[inline]
pub(crate) fn are_finite(values: &[f64]) -> bool {
    values.iter().map(|value| value * 0.0).sum::<f64>() == 0.0
}

#[inline]
fn first_not_finite(reals: &[f64], range: std::ops::Range<usize>, time: f64) -> Result<(), StepError> {
    if are_finite(&reals[range.clone()]) {
        return Ok(());
    }
    let index = range.clone().find(|&i| !reals[i].is_finite()).unwrap_or(range.start);
    Err(StepError::NotFinite { index, value: reals[index], time })
}

impl<P: Plant, S: Stepper<P>> Model for PlantModel<P, S> {
    const INFO: Info = P::INFO;
    const IS_PLANT: bool = true;
    const SOURCE: Option<Influence> = None;
    type Parameters = P::Parameters;
    type Design = P::Design;
    type Memory = ();

    fn layout() -> Layout {
        let mut states = P::State::<f64>::declare();
        // The states that `begin` writes are calculated: they are no longer NaN after it.
        let mut start = vec![f64::NAN; states.len()];
        let mut x = P::State::read(&start);
        P::begin(&P::Parameters::default(), &mut x);
        x.write(&mut start);
        for (state, start) in states.iter_mut().zip(start) {
            state.calculated = !start.is_nan();
        }
        Layout::new(
            P::Parameters::declare(),
            P::Design::declare(),
            P::Inputs::<f64>::declare(),
            P::Outputs::<f64>::declare(),
            states,
        )
    }

    fn load(p: &P::Parameters, _: &Path) -> Result<P::Design, String> {
        P::design(p)
    }

    fn fingerprint(_: &P::Design) -> u64 {
        0
    }

    fn begin(_: &P::Parameters, _: &P::Design) {}

    fn sample_time(_: &P::Parameters) -> Option<f64> {
        None
    }

    fn begin_states(p: &P::Parameters, layout: &Layout, reals: &mut [f64]) {
        let mut x = P::State::read(&reals[layout.states.start..]);
        P::begin(p, &mut x);
        x.write(&mut reals[layout.states.start..]);
    }

    fn parts(p: &P::Parameters, step: Step) -> f64 {
        S::parts(p, step.step)
    }

    fn step(
        p: &P::Parameters,
        d: &P::Design,
        (): &mut (),
        layout: &Layout,
        reals: &mut [f64],
        step: Step,
        parts: u64,
    ) -> Result<(), StepError> {
        let u = P::Inputs::read(&reals[layout.inputs.start..]);
        let before = P::State::read(&reals[layout.states.start..]);
        let mut x = before.clone();
        let h = step.step / parts as f64;
        for _ in 0..parts {
            x = S::advance(p, d, &x, &u, h);
        }
        x.write(&mut reals[layout.states.start..]);
        first_not_finite(reals, layout.states.clone(), step.time + step.step)
            .inspect_err(|_| before.write(&mut reals[layout.states.start..]))
    }

    fn outputs(p: &P::Parameters, d: &P::Design, layout: &Layout, reals: &mut [f64], _: f64) {
        let u = P::Inputs::read(&reals[layout.inputs.start..]);
        let x = P::State::read(&reals[layout.states.start..]);
        P::outputs(p, d, &x, &u).write(&mut reals[layout.outputs.start..]);
    }

    fn derivatives(p: &P::Parameters, d: &P::Design, layout: &Layout, reals: &mut [f64]) {
        let u = P::Inputs::read(&reals[layout.inputs.start..]);
        let x = P::State::read(&reals[layout.states.start..]);
        P::derivatives(p, d, &x, &u).write(&mut reals[layout.derivatives.start..]);
    }

    fn directional(
        p: &P::Parameters,
        d: &P::Design,
        layout: &Layout,
        reals: &[f64],
        direction: &[f64],
        result: &mut [f64],
    ) {
        let inputs = layout.inputs.len();
        let known: Vec<Dual64> = layout
            .inputs
            .clone()
            .chain(layout.states.clone())
            .zip(direction)
            .map(|(i, &slope)| Dual64::new(reals[i], slope))
            .collect();
        let u = P::Inputs::read(&known);
        let x = P::State::read(&known[inputs..]);
        let mut unknown = vec![Dual64::from(0.0); layout.outputs.len() + layout.states.len()];
        P::outputs(p, d, &x, &u).write(&mut unknown);
        P::derivatives(p, d, &x, &u).write(&mut unknown[layout.outputs.len()..]);
        for (slope, unknown) in result.iter_mut().zip(unknown) {
            *slope = unknown.eps;
        }
    }

    fn dependencies(p: &P::Parameters, d: &P::Design) -> Vec<Dependencies> {
        let inputs = P::Inputs::<f64>::LEN;
        let states = P::State::<f64>::LEN;
        let outputs = P::Outputs::<f64>::LEN;
        let known: Vec<_> = (0..inputs + states).map(Dependencies::on).collect();
        let u = P::Inputs::read(&known);
        let x = P::State::read(&known[inputs..]);
        let mut unknown = vec![Dependencies::default(); outputs + states];
        P::outputs(p, d, &x, &u).write(&mut unknown);
        P::derivatives(p, d, &x, &u).write(&mut unknown[outputs..]);
        unknown
    }
}

impl<S: Sampled> Model for SampledModel<S> {
    const INFO: Info = S::INFO;
    const IS_PLANT: bool = false;
    const SOURCE: Option<Influence> = S::SOURCE;
    type Parameters = S::Parameters;
    type Design = S::Design;
    type Memory = S::Memory;

    fn layout() -> Layout {
        Layout::new(
            S::Parameters::declare(),
            S::Design::declare(),
            S::Inputs::declare(),
            S::Outputs::declare(),
            Vec::new(),
        )
    }

    fn load(p: &S::Parameters, resources: &Path) -> Result<S::Design, String> {
        S::load(p, resources)
    }

    fn fingerprint(d: &S::Design) -> u64 {
        S::fingerprint(d)
    }

    fn begin(p: &S::Parameters, d: &S::Design) -> S::Memory {
        S::begin(p, d)
    }

    fn sample_time(p: &S::Parameters) -> Option<f64> {
        Some(p.sample_time())
    }

    fn begin_states(_: &S::Parameters, _: &Layout, _: &mut [f64]) {}

    fn parts(p: &S::Parameters, step: Step) -> f64 {
        let end = samples_before(step.time + step.step, step.start, p.sample_time(), step.step);
        (end - step.sample as f64).max(0.0)
    }

    fn step(
        p: &S::Parameters,
        d: &S::Design,
        x: &mut S::Memory,
        layout: &Layout,
        reals: &mut [f64],
        step: Step,
        parts: u64,
    ) -> Result<(), StepError> {
        let u = S::Inputs::read(&reals[layout.inputs.start..]);
        let before = S::Outputs::read(&reals[layout.outputs.start..]);
        let mut samples = || {
            for sample in step.sample..step.sample + parts {
                let t = step.start + sample as f64 * p.sample_time();
                S::check(p, d, x, &u, t).map_err(StepError::Refused)?;
                S::update(p, d, x, &u, t).write(&mut reals[layout.outputs.start..]);
                first_not_finite(reals, layout.outputs.clone(), t)?;
                if let Some((name, value)) = x.not_finite() {
                    return Err(StepError::MemoryNotFinite { name, value, time: t });
                }
            }
            Ok(())
        };
        samples().inspect_err(|_| before.write(&mut reals[layout.outputs.start..]))
    }

    fn outputs(p: &S::Parameters, d: &S::Design, layout: &Layout, reals: &mut [f64], start: f64) {
        let u = S::Inputs::read(&layout.inputs.clone().map(|index| layout.start(index)).collect::<Vec<_>>());
        // The memory of the run begins with the first step, which takes this sample again.
        S::update(p, d, &mut S::begin(p, d), &u, start).write(&mut reals[layout.outputs.start..]);
    }

    fn derivatives(_: &S::Parameters, _: &S::Design, _: &Layout, _: &mut [f64]) {}

    fn directional(_: &S::Parameters, _: &S::Design, _: &Layout, _: &[f64], _: &[f64], result: &mut [f64]) {
        result.fill(0.0);
    }

    fn dependencies(_: &S::Parameters, _: &S::Design) -> Vec<Dependencies> {
        vec![Dependencies::default(); S::Outputs::LEN]
    }
}
