//! Small models that use every kind of variable, and what the tests do with their instances.

use std::cell::Cell;
use std::path::PathBuf;

use fmi2::abi::{Export, Library};
use fmi2::instance::{Instance, Refusal};
use fmi2::model::{PlantModel, SampledModel};
use fmi2::prelude::*;
use fmi2::variable::Kind;
use fmi2::{Role, Signal};

fmi2::family! {
    /// Two carts.
    pub(crate) Carts[2] {
        l: "left cart",
        r: "right cart",
    }
}

const CART_POSITION: Signal = Signal {
    name: "cart_position",
    unit: M,
    display: Some("mm"),
    nominal: 0.5,
    role: Role::Measurement,
    description: "Position of the {}",
};

/// What the springs do.
#[derive(Mode, Clone, Copy, PartialEq)]
pub(crate) enum Law {
    /// Proportional
    Linear,
    /// Proportional, with a cubic part, and moved by the ground
    HardeningSpring = 2,
}

#[derive(Parameters, Clone)]
pub(crate) struct CartParameters {
    /// Mass
    #[par("cart.mass", unit = KG, start = 2.0, positive, nominal = 2.0)]
    pub(crate) m: f64,
    /// Stiffness
    #[par("spring.stiffness", unit = N_PER_M, start = [8.0, 18.0], min = 0.0, display = "kN/m")]
    pub(crate) k: Carts<f64>,
    /// Law of the springs
    #[par("spring.law", mode, start = Law::Linear)]
    pub(crate) law: Law,
    /// Damping
    #[par("damper.damping", unit = N_S_PER_M, start = 0.4, min = 0.0, max = 50.0, tunable)]
    pub(crate) c: f64,
    /// Dampers are there
    #[par("damper.on", start = true, tunable)]
    pub(crate) on: bool,
    /// Stiffness between the carts
    #[par("coupling.stiffness", unit = N_PER_M, start = 0.0, min = 0.0)]
    pub(crate) k_c: f64,
    #[par(MAX_STEP, start = 0.01)]
    pub(crate) max_step: f64,
}

#[derive(Design, Clone)]
pub(crate) struct CartDesign {
    /// Undamped natural frequency
    #[calculated("spring.frequency", unit = RAD_PER_S)]
    pub(crate) omega: Carts<f64>,
    /// 1/m, not shown.
    pub(crate) per_mass: f64,
}

#[derive(State, Clone)]
pub(crate) struct CartState<T> {
    #[signal(CART_POSITION, start = [0.1, 0.0])]
    pub(crate) x: Carts<T>,
    /// Velocity
    #[var("cart_velocity", unit = M_PER_S, nominal = 1.0, local)]
    pub(crate) v: Carts<T>,
}

#[derive(Inputs, Clone)]
pub(crate) struct CartInputs<T> {
    /// Force
    #[var("cart_force", unit = N)]
    pub(crate) f: Carts<T>,
    /// Height of the ground
    #[var("ground.height", unit = M)]
    pub(crate) z: T,
    /// What the distance is divided by
    #[var("scale", unit = ONE, start = 1.0)]
    pub(crate) scale: T,
}

#[derive(Outputs, Clone)]
pub(crate) struct CartOutputs<T> {
    /// Acceleration
    #[var("cart_acceleration", unit = M_PER_S2, display = "g")]
    pub(crate) a: Carts<T>,
    /// Distance between the carts, divided by the scale
    #[var("distance", unit = M)]
    pub(crate) distance: T,
    /// Positive part of the left position
    #[var("pushed", unit = M)]
    pub(crate) pushed: T,
}

thread_local! {
    /// How often the derivatives of the carts were computed in this thread.
    static EVALUATIONS: Cell<u64> = const { Cell::new(0) };
}

/// Integration steps since the last call: a Runge-Kutta step of order 4 evaluates the derivatives four times.
pub(crate) fn integration_steps() -> u64 {
    let evaluations = EVALUATIONS.replace(0);
    assert_eq!(evaluations % 4, 0);
    evaluations / 4
}

pub(crate) struct CartPair;

fn accelerations<T: Scalar>(p: &CartParameters, d: &CartDesign, x: &CartState<T>, u: &CartInputs<T>) -> Carts<T> {
    Carts::from_fn(|i| {
        let stretch = match p.law {
            Law::Linear => x.x[i],
            Law::HardeningSpring => {
                let s = x.x[i] - u.z;
                s + s * s * s
            }
        };
        let damping = if p.on { x.v[i] * p.c } else { T::from(0.0) };
        (u.f[i] - stretch * p.k[i] - damping - (x.x[i] - x.x[1 - i]) * p.k_c) * d.per_mass
    })
}

impl Plant for CartPair {
    const INFO: Info = Info {
        name: "CartPair",
        description: "Two carts on springs: <left> & \"right\"",
        version: "1.2.3",
        stop_time: 10.0,
        step_size: 0.01,
    };
    type Parameters = CartParameters;
    type Design = CartDesign;
    type State<T: Scalar> = CartState<T>;
    type Inputs<T: Scalar> = CartInputs<T>;
    type Outputs<T: Scalar> = CartOutputs<T>;

    fn design(p: &CartParameters) -> Result<CartDesign, String> {
        if p.k[0] > 1e6 {
            return Err(format!("'spring.stiffness.l' = {} N/m, at most 1e6 was expected", p.k[0]));
        }
        Ok(CartDesign { omega: Carts::from_fn(|i| (p.k[i] / p.m).sqrt()), per_mass: 1.0 / p.m })
    }

    fn derivatives<T: Scalar>(p: &CartParameters, d: &CartDesign, x: &CartState<T>, u: &CartInputs<T>) -> CartState<T> {
        EVALUATIONS.set(EVALUATIONS.get() + 1);
        CartState { x: x.v, v: accelerations(p, d, x, u) }
    }

    fn outputs<T: Scalar>(p: &CartParameters, d: &CartDesign, x: &CartState<T>, u: &CartInputs<T>) -> CartOutputs<T> {
        CartOutputs {
            a: accelerations(p, d, x, u),
            distance: (x.x[0] - x.x[1]) / u.scale,
            pushed: x.x[0].max(T::from(0.0)),
        }
    }
}

#[derive(Parameters, Clone)]
pub(crate) struct SamplerParameters {
    /// Gain
    #[par("filter.gain", unit = ONE, start = 2.0, min = -10.0, max = 10.0, tunable)]
    pub(crate) gain: f64,
    /// Length
    #[par("filter.length", unit = S, start = 0.05, positive, tunable)]
    pub(crate) length: f64,
    /// Offset in whole steps
    #[par("filter.offset", start = 1, min = -5, max = 5, tunable)]
    pub(crate) offset: i32,
    /// Order
    #[par("filter.order", start = 2, min = 1, max = 4)]
    pub(crate) order: i32,
    /// The integral is on
    #[par("filter.on", start = true)]
    pub(crate) on: bool,
    /// Label
    #[par("filter.label", start = "start <&> \"label\"")]
    pub(crate) label: String,
    #[par(SAMPLE_TIME, start = 0.01)]
    pub(crate) sample_time: f64,
}

#[derive(Design, Clone)]
pub(crate) struct SamplerDesign {
    /// Samples per second
    #[calculated("filter.rate", unit = PER_S)]
    pub(crate) rate: f64,
}

#[derive(Memory, Clone, Default)]
pub(crate) struct SamplerMemory {
    pub(crate) integral: f64,
    pub(crate) count: u64,
    pub(crate) is_high: bool,
    pub(crate) past: [f64; 3],
    #[generated]
    pub(crate) table: [f64; 2],
}

#[derive(Inputs, Clone)]
pub(crate) struct SamplerInputs {
    /// What is filtered
    #[var("filter_input", unit = M, start = 0.25)]
    pub(crate) u: f64,
}

#[derive(Outputs, Clone)]
pub(crate) struct SamplerOutputs {
    /// The filtered input
    #[var("filter_output", unit = M, start = 0.5)]
    pub(crate) y: f64,
    /// Samples so far
    #[var("filter_count", unit = ONE)]
    pub(crate) count: f64,
    /// Time of the last sample
    #[var("filter_time", unit = S, start = -1.0)]
    pub(crate) time: f64,
    /// Bytes of the label
    #[var("filter_label_length", unit = ONE)]
    pub(crate) label: f64,
}

pub(crate) struct Sampler;

impl Sampled for Sampler {
    const INFO: Info = Info {
        name: "Sampler",
        description: "An integrator with a memory",
        version: "1.0.0",
        stop_time: 1.0,
        step_size: 0.01,
    };
    type Parameters = SamplerParameters;
    type Design = SamplerDesign;
    type Memory = SamplerMemory;
    type Inputs = SamplerInputs;
    type Outputs = SamplerOutputs;

    fn design(p: &SamplerParameters) -> Result<SamplerDesign, String> {
        Ok(SamplerDesign { rate: 1.0 / p.sample_time })
    }

    fn begin(p: &SamplerParameters, d: &SamplerDesign) -> SamplerMemory {
        SamplerMemory { table: [d.rate, f64::from(p.order)], ..Default::default() }
    }

    fn update(
        p: &SamplerParameters,
        _: &SamplerDesign,
        x: &mut SamplerMemory,
        u: &SamplerInputs,
        t: f64,
    ) -> SamplerOutputs {
        if p.on {
            x.integral += p.gain * u.u * p.sample_time;
        }
        x.count = x.count.wrapping_add(1);
        x.is_high = u.u > 0.5;
        x.past = [u.u, x.past[0], x.past[1]];
        let past: f64 = x.past.iter().take(p.order as usize).sum();
        let high = if x.is_high { x.table[1] } else { 0.0 };
        SamplerOutputs {
            y: x.integral + past * p.length + f64::from(p.offset) + high,
            count: x.count as f64,
            time: t,
            label: p.label.len() as f64,
        }
    }
}

#[derive(Parameters, Clone)]
pub(crate) struct FragileParameters {
    /// Where it panics
    #[par("panic", mode, start = Panic::Nowhere)]
    pub(crate) panic: Panic,
    /// Product at the start, divided by the scale
    #[par("product.start", unit = ONE, start = 1.0)]
    pub(crate) product: f64,
    /// Scale of the product
    #[par("product.scale", unit = UNDECLARED, start = 1.0, min = 0.0, nominal = 1.0)]
    pub(crate) scale: f64,
    #[par(SAMPLE_TIME, start = 0.1)]
    pub(crate) sample_time: f64,
}

/// Where the fragile unit panics.
#[derive(Mode, Clone, Copy, PartialEq)]
pub(crate) enum Panic {
    /// Nowhere
    Nowhere,
    /// In the design
    Design,
    /// At the begin
    Begin,
    /// In a sample
    Sample,
}

#[derive(Inputs, Clone)]
pub(crate) struct FragileInputs {
    /// Dividend
    #[var("dividend", unit = ONE, start = 1.0)]
    pub(crate) a: f64,
    /// Divisor; a negative one is refused
    #[var("divisor", unit = ONE, start = 1.0)]
    pub(crate) b: f64,
}

#[derive(Outputs, Clone)]
pub(crate) struct FragileOutputs {
    /// Quotient
    #[var("quotient", unit = ONE)]
    pub(crate) q: f64,
    /// Sum of the quotients
    #[var("sum_of_quotients", unit = ONE)]
    pub(crate) sum: f64,
}

#[derive(Memory, Clone, Default)]
pub(crate) struct FragileMemory {
    pub(crate) sum: f64,
    pub(crate) product: f64,
}

/// Divides by an input, refuses negative divisors, and panics on demand.
pub(crate) struct Fragile;

impl Sampled for Fragile {
    const INFO: Info =
        Info { name: "Fragile", description: "Divides", version: "1.0.0", stop_time: 1.0, step_size: 0.1 };
    type Parameters = FragileParameters;
    type Design = ();
    type Memory = FragileMemory;
    type Inputs = FragileInputs;
    type Outputs = FragileOutputs;

    fn design(p: &FragileParameters) -> Result<(), String> {
        assert!(p.panic != Panic::Design, "100% on demand, in the design");
        Ok(())
    }

    fn begin(p: &FragileParameters, (): &()) -> FragileMemory {
        assert!(p.panic != Panic::Begin, "on demand, at the begin");
        FragileMemory { sum: 0.0, product: p.product / p.scale }
    }

    fn check(_: &FragileParameters, (): &(), _: &FragileMemory, u: &FragileInputs, t: f64) -> Result<(), String> {
        if u.b < 0.0 { Err(format!("'divisor' = {} at {t} s, 0 or more was expected", u.b)) } else { Ok(()) }
    }

    fn update(p: &FragileParameters, (): &(), x: &mut FragileMemory, u: &FragileInputs, _: f64) -> FragileOutputs {
        assert!(p.panic != Panic::Sample, "on demand, in a sample");
        let q = u.a / u.b;
        x.sum += q;
        x.product *= u.a;
        FragileOutputs { q, sum: x.sum }
    }
}

macro_rules! export {
    ($($model:ident: $runner:ident)*) => {$(
        impl Export for $model {
            type Model = $runner<$model>;
            fn library() -> &'static Library {
                static LIBRARY: Library = Library::new();
                &LIBRARY
            }
        }
    )*};
}
export! { CartPair: PlantModel  Sampler: SampledModel  Fragile: SampledModel }

/// An instance whose variables are called by name.
pub(crate) struct Unit<E: Export>(pub(crate) Instance<E::Model>);

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

/// The message of a refused call.
#[track_caller]
pub(crate) fn refused<V: std::fmt::Debug>(answer: Result<V, Refusal>) -> String {
    match answer {
        Err(Refusal::Error(message)) => message,
        other => panic!("an error was expected, {other:?} found"),
    }
}

impl<E: Export> Unit<E> {
    /// In Instantiated.
    pub(crate) fn new() -> Self {
        Self(Instance::new(E::description(), PathBuf::new()))
    }

    /// In Initialization Mode.
    pub(crate) fn initializing(start: f64) -> Self {
        let mut unit = Self::new();
        unit.0.setup_experiment(start, None).unwrap();
        unit.0.enter_initialization().unwrap();
        unit
    }

    /// In Step Mode.
    pub(crate) fn ready() -> Self {
        Self::starting(0.0, &[])
    }

    /// In Step Mode at a start time, with values that are set before.
    pub(crate) fn starting(start: f64, values: &[(&str, f64)]) -> Self {
        let mut unit = Self::initializing(start);
        for (name, value) in values {
            unit.set(name, *value).unwrap();
        }
        unit.0.exit_initialization().unwrap();
        unit
    }

    pub(crate) fn set(&mut self, name: &str, value: f64) -> Result<(), Refusal> {
        self.0.set_real(&[reference::<E>(name)], &[value])
    }

    pub(crate) fn set_integer(&mut self, name: &str, value: i32) -> Result<(), Refusal> {
        self.0.set_integer(&[reference::<E>(name)], &[value])
    }

    pub(crate) fn set_boolean(&mut self, name: &str, value: bool) -> Result<(), Refusal> {
        self.0.set_boolean(&[reference::<E>(name)], &[value])
    }

    pub(crate) fn set_string(&mut self, name: &str, value: &str) -> Result<(), Refusal> {
        self.0.set_string(&[reference::<E>(name)], &[value.to_owned()])
    }

    pub(crate) fn try_get(&mut self, name: &str) -> Result<f64, Refusal> {
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

    /// One step on from where the instance stands.
    pub(crate) fn step(&mut self, step: f64) -> Result<(), Refusal> {
        let time = self.0.time();
        self.0.do_step(time, step)
    }

    /// The whole state as bytes.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        self.0.serialize(&self.0.snapshot().unwrap()).unwrap()
    }
}
