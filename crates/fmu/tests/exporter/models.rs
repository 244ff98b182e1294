//! Small models that use every kind of variable, and helpers for their instances.

use std::cell::Cell;
use std::path::PathBuf;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::Protocol;
use fmu::testing::instance::{CallError, Instance};
use fmu::testing::variable::Kind;
use fmu::{Definition, Range};

fmu::named_array! {
    /// Two carts.
    pub(crate) Carts[2] {
        l: "left cart",
        r: "right cart",
    }
}

const CART_POSITION: Definition = Definition {
    name: "cart_position",
    unit: fmu::unit!("m"),
    display: Some("mm"),
    nominal: Some(0.5),
    range: Range::Any,
    description: "Position of the {}",
};

/// Characteristic of the springs
#[derive(Enumeration, Clone, Copy, PartialEq)]
pub(crate) enum Law {
    /// Proportional
    Linear,
    /// Proportional, with a cubic part, and moved by the ground
    HardeningSpring = 2,
}

#[derive(Parameters, Clone)]
pub(crate) struct CartPair {
    /// Mass
    #[var("cart.mass", unit = "kg", start = 2.0, positive, nominal = 2.0)]
    pub(crate) m: f64,
    /// Stiffness
    #[var("spring.stiffness", unit = "N/m", start = [8.0, 18.0], min = 0.0, display = "kN/m")]
    pub(crate) k: Carts<f64>,
    /// Law of the springs
    #[var("spring.law", start = Law::Linear)]
    pub(crate) law: Law,
    /// Damping
    #[var("damper.damping", unit = "N.s/m", start = 0.4, min = 0.0, max = 50.0, tunable)]
    pub(crate) c: f64,
    /// Dampers are active
    #[var("damper.on", start = true, tunable)]
    pub(crate) on: bool,
    /// Stiffness between the carts
    #[var("coupling.stiffness", unit = "N/m", start = 0.0, min = 0.0)]
    pub(crate) k_c: f64,
    #[var(MAX_STEP, start = 0.01)]
    pub(crate) max_step: f64,
}

#[derive(Derived, Clone)]
pub(crate) struct CartDerived {
    /// Undamped natural frequency
    #[var("spring.frequency", unit = "rad/s")]
    pub(crate) omega: Carts<f64>,
    /// 1/m, not visible.
    pub(crate) per_mass: f64,
}

#[derive(State, Clone)]
pub(crate) struct CartState<T> {
    #[var(CART_POSITION, start = [0.1, 0.0])]
    pub(crate) x: Carts<T>,
    /// Velocity
    #[var("cart_velocity", unit = "m/s", nominal = 1.0, local)]
    pub(crate) v: Carts<T>,
}

#[derive(Inputs, Clone)]
pub(crate) struct CartInputs<T> {
    /// Force
    #[var("cart_force", unit = "N")]
    pub(crate) f: Carts<T>,
    /// Height of the ground
    #[var("ground.height", unit = "m")]
    pub(crate) z: T,
    /// Divisor of the distance
    #[var("scale", unit = "1", start = 1.0)]
    pub(crate) scale: T,
}

#[derive(Outputs, Clone)]
pub(crate) struct CartOutputs<T> {
    /// Acceleration
    #[var("cart_acceleration", unit = "m/s2", display = "g")]
    pub(crate) a: Carts<T>,
    /// Distance between the carts, divided by the scale
    #[var("distance", unit = "m")]
    pub(crate) distance: T,
    /// Positive part of the left position
    #[var("pushed", unit = "m")]
    pub(crate) pushed: T,
}

thread_local! {
    /// Number of evaluations of the derivatives of the carts in this thread.
    static EVALUATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Integration steps since the last call. A Runge-Kutta step evaluates the derivatives four times.
pub(crate) fn integration_steps() -> u64 {
    let evaluations = EVALUATIONS.replace(0);
    assert_eq!(evaluations % 4, 0);
    evaluations / 4
}

impl CartPair {
    fn accelerations<T: Scalar>(&self, at: At<T, Self>) -> Carts<T> {
        let (x, u) = (at.state, at.inputs);
        Carts::from_fn(|i| {
            let stretch = match self.law {
                Law::Linear => x.x[i],
                Law::HardeningSpring => {
                    let s = x.x[i] - u.z;
                    s + s * s * s
                }
            };
            let damping = if self.on { x.v[i] * self.c } else { T::from(0.0) };
            (u.f[i] - stretch * self.k[i] - damping - (x.x[i] - x.x[1 - i]) * self.k_c) * at.derived.per_mass
        })
    }
}

/// Two carts on springs: <left> & "right"
#[fmu::model(stop_time = 10.0, step_size = 0.01)]
impl Continuous for CartPair {
    type Derived = CartDerived;
    type State<T: Scalar> = CartState<T>;
    type Inputs<T: Scalar> = CartInputs<T>;
    type Outputs<T: Scalar> = CartOutputs<T>;

    fn derived(&self) -> Result<CartDerived, String> {
        if self.k[0] > 1e6 {
            return Err(format!("'spring.stiffness.l' must be at most 1e6 N/m, got {} N/m", self.k[0]));
        }
        Ok(CartDerived { omega: Carts::from_fn(|i| (self.k[i] / self.m).sqrt()), per_mass: 1.0 / self.m })
    }

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> CartState<T> {
        EVALUATIONS.set(EVALUATIONS.get() + 1);
        CartState { x: at.state.v, v: self.accelerations(at) }
    }

    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> CartOutputs<T> {
        let x = at.state;
        CartOutputs {
            a: self.accelerations(at),
            distance: (x.x[0] - x.x[1]) / at.inputs.scale,
            pushed: x.x[0].max(T::from(0.0)),
        }
    }
}

#[derive(Parameters, Clone)]
pub(crate) struct Sampler {
    /// Gain
    #[var("filter.gain", unit = "1", start = 2.0, min = -10.0, max = 10.0, tunable)]
    pub(crate) gain: f64,
    /// Length
    #[var("filter.length", unit = "s", start = 0.05, positive, tunable)]
    pub(crate) length: f64,
    /// Offset in whole steps
    #[var("filter.offset", start = 1, min = -5, max = 5, tunable)]
    pub(crate) offset: i32,
    /// Order
    #[var("filter.order", start = 2, min = 1, max = 4)]
    pub(crate) order: i32,
    /// The integral is on
    #[var("filter.on", start = true)]
    pub(crate) on: bool,
    /// Label
    #[var("filter.label", start = "start <&> \"label\"")]
    pub(crate) label: String,
    #[var(SAMPLE_TIME, start = 0.01)]
    pub(crate) sample_time: f64,
}

#[derive(Derived, Clone)]
pub(crate) struct SamplerDerived {
    /// Samples per second
    #[var("filter.rate", unit = "1/s")]
    pub(crate) rate: f64,
}

#[derive(DiscreteState, Clone, Default)]
pub(crate) struct SamplerState {
    pub(crate) integral: f64,
    pub(crate) count: u64,
    pub(crate) is_high: bool,
    pub(crate) past: [f64; 3],
    #[var(always_finite)]
    pub(crate) table: [f64; 2],
}

#[derive(Inputs, Clone)]
pub(crate) struct SamplerInputs {
    /// What is filtered
    #[var("filter_input", unit = "m", start = 0.25)]
    pub(crate) u: f64,
}

#[derive(Outputs, Clone)]
pub(crate) struct SamplerOutputs {
    /// The filtered input
    #[var("filter_output", unit = "m", start = 0.5)]
    pub(crate) y: f64,
    /// Samples so far
    #[var("filter_count", unit = "1")]
    pub(crate) count: f64,
    /// Time of the last sample
    #[var("filter_time", unit = "s", start = -1.0)]
    pub(crate) time: f64,
    /// Bytes of the label
    #[var("filter_label_length", unit = "1")]
    pub(crate) label: f64,
}

/// An integrator with a discrete state
#[fmu::model(stop_time = 1.0, step_size = 0.01)]
impl Discrete for Sampler {
    type Derived = SamplerDerived;
    type State = SamplerState;
    type Inputs = SamplerInputs;
    type Outputs = SamplerOutputs;

    fn derived(&self) -> Result<SamplerDerived, String> {
        Ok(SamplerDerived { rate: 1.0 / self.sample_time })
    }

    fn initial_state(&self, derived: &SamplerDerived) -> SamplerState {
        SamplerState { table: [derived.rate, f64::from(self.order)], ..Default::default() }
    }

    fn update(&self, sample: Sample<Self>) -> SamplerOutputs {
        let Sample { time, state: x, inputs, .. } = sample;
        let u = inputs.u;
        if self.on {
            x.integral += self.gain * u * self.sample_time;
        }
        x.count = x.count.wrapping_add(1);
        x.is_high = u > 0.5;
        x.past = [u, x.past[0], x.past[1]];
        let past: f64 = x.past.iter().take(self.order as usize).sum();
        let high = if x.is_high { x.table[1] } else { 0.0 };
        SamplerOutputs {
            y: x.integral + past * self.length + f64::from(self.offset) + high,
            count: x.count as f64,
            time,
            label: self.label.len() as f64,
        }
    }
}

#[derive(Parameters, Clone)]
pub(crate) struct Fragile {
    /// Where it panics
    #[var("panic", start = Panic::Nowhere)]
    pub(crate) panic: Panic,
    /// Product at the start, divided by the scale
    #[var("product.start", unit = "1", start = 1.0)]
    pub(crate) product: f64,
    /// Scale of the product
    #[var("product.scale", unit = Unit::NONE, start = 1.0, min = 0.0, nominal = 1.0)]
    pub(crate) scale: f64,
    #[var(SAMPLE_TIME, start = 0.1)]
    pub(crate) sample_time: f64,
}

/// Function in which the model panics
#[derive(Enumeration, Clone, Copy, PartialEq)]
pub(crate) enum Panic {
    /// Nowhere
    Nowhere,
    /// In the derived parameters
    Derived,
    /// In the initial state
    InitialState,
    /// In a sample
    Sample,
}

#[derive(Inputs, Clone)]
pub(crate) struct FragileInputs {
    /// Dividend
    #[var("dividend", unit = "1", start = 1.0)]
    pub(crate) a: f64,
    /// Divisor; a negative one is an error
    #[var("divisor", unit = "1", start = 1.0)]
    pub(crate) b: f64,
}

#[derive(Outputs, Clone)]
pub(crate) struct FragileOutputs {
    /// Quotient
    #[var("quotient", unit = "1")]
    pub(crate) q: f64,
    /// Sum of the quotients
    #[var("sum_of_quotients", unit = "1")]
    pub(crate) sum: f64,
}

#[derive(DiscreteState, Clone, Default)]
pub(crate) struct FragileState {
    pub(crate) sum: f64,
    pub(crate) product: f64,
}

/// Divides by an input; negative divisors are errors, and it panics on demand
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Fragile {
    type State = FragileState;
    type Inputs = FragileInputs;
    type Outputs = FragileOutputs;
    type Derived = ();

    fn derived(&self) -> Result<(), String> {
        assert!(self.panic != Panic::Derived, "100% on demand, in the derived parameters");
        Ok(())
    }

    fn initial_state(&self, (): &()) -> FragileState {
        assert!(self.panic != Panic::InitialState, "on demand, in the initial state");
        FragileState { sum: 0.0, product: self.product / self.scale }
    }

    fn check(&self, sample: &Sample<Self>) -> Result<(), String> {
        let b = sample.inputs.b;
        if b < 0.0 { Err(format!("'divisor' must be 0 or more, got {b} at {} s", sample.time)) } else { Ok(()) }
    }

    fn update(&self, sample: Sample<Self>) -> FragileOutputs {
        assert!(self.panic != Panic::Sample, "on demand, in a sample");
        let Sample { state: x, inputs, .. } = sample;
        let q = inputs.a / inputs.b;
        x.sum += q;
        x.product *= inputs.a;
        FragileOutputs { q, sum: x.sum }
    }
}

/// Exports models in a format, as `cargo fmu pack` does.
macro_rules! exported {
    ($($name:ident: $model:ty, $format:expr;)*) => {$(
        struct $name;
        impl fmu::testing::abi::Export for $name {
            type Model = <$model as fmu::testing::abi::Export>::Model;
            const FORMAT: fmu::testing::description::Format = $format;
            fn library() -> &'static fmu::testing::abi::Library {
                static LIBRARY: fmu::testing::abi::Library = fmu::testing::abi::Library::new();
                &LIBRARY
            }
        }
    )*};
}
pub(crate) use exported;

/// An instance whose variables are accessed by name.
pub(crate) struct Fmu<E: Export>(pub(crate) Instance<E::Model>);

/// The value reference of a variable.
pub(crate) fn reference<E: Export>(name: &str) -> u32 {
    let description = E::description();
    let found = description.layout.variables.iter().find(|variable| variable.declaration.name == name);
    found.unwrap_or_else(|| panic!("no variable '{name}'")).reference
}

/// Value references of all real variables.
pub(crate) fn reals<E: Export>() -> Vec<u32> {
    let description = E::description();
    let variables = description.layout.variables.iter();
    variables.filter(|v| matches!(v.declaration.kind, Kind::Real(_))).map(|v| v.reference).collect()
}

/// The message of a failed call.
#[track_caller]
pub(crate) fn error_of<V: std::fmt::Debug>(answer: Result<V, CallError>) -> String {
    match answer {
        Err(CallError::Error(message)) => message,
        other => panic!("an error was expected, {other:?} found"),
    }
}

impl<E: Export> Fmu<E> {
    /// An instance in the mode Instantiated.
    pub(crate) fn new() -> Self {
        Self(Instance::new(Protocol::CS2, E::description(), PathBuf::new()))
    }

    /// An instance in Initialization Mode.
    pub(crate) fn initializing(start: f64) -> Self {
        let mut fmu = Self::new();
        fmu.0.setup_experiment(start, None).unwrap();
        fmu.0.enter_initialization().unwrap();
        fmu
    }

    /// An instance in Step Mode.
    pub(crate) fn ready() -> Self {
        Self::starting(0.0, &[])
    }

    /// An instance in Step Mode at a start time. Sets the values during initialization.
    pub(crate) fn starting(start: f64, values: &[(&str, f64)]) -> Self {
        let mut fmu = Self::initializing(start);
        for (name, value) in values {
            fmu.set(name, *value).unwrap();
        }
        fmu.0.exit_initialization().unwrap();
        fmu
    }

    pub(crate) fn set(&mut self, name: &str, value: f64) -> Result<(), CallError> {
        self.0.set_real(&[reference::<E>(name)], &[value])
    }

    pub(crate) fn set_integer(&mut self, name: &str, value: i32) -> Result<(), CallError> {
        self.0.set_integer(&[reference::<E>(name)], &[value])
    }

    pub(crate) fn set_boolean(&mut self, name: &str, value: bool) -> Result<(), CallError> {
        self.0.set_boolean(&[reference::<E>(name)], &[value])
    }

    pub(crate) fn set_string(&mut self, name: &str, value: &str) -> Result<(), CallError> {
        self.0.set_string(&[reference::<E>(name)], &[value.to_owned()])
    }

    pub(crate) fn try_get(&mut self, name: &str) -> Result<f64, CallError> {
        let mut value = [f64::NAN];
        self.0.get_real(&[reference::<E>(name)], &mut value).map(|()| value[0])
    }

    #[track_caller]
    pub(crate) fn get(&mut self, name: &str) -> f64 {
        self.try_get(name).unwrap()
    }

    /// The bits of all real variables.
    pub(crate) fn bits(&mut self) -> Vec<u64> {
        let references = reals::<E>();
        let mut values = vec![0.0; references.len()];
        self.0.get_real(&references, &mut values).unwrap();
        values.iter().map(|value| value.to_bits()).collect()
    }

    /// Takes a step from the present time.
    pub(crate) fn step(&mut self, step: f64) -> Result<(), CallError> {
        let time = self.0.time();
        self.0.do_step(time, step)
    }

    /// The state as bytes.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.0.serialize(&self.0.snapshot().unwrap()).unwrap()
    }
}
