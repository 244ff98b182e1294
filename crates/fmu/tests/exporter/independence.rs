//! Results must not depend on which variables were read, in which order values were set, or whether the state was
//! converted to bytes. Reference: a run that reads nothing before its end, sets values in the order of their
//! declaration, and uses one instance. Initial states and derived parameters are compared with closed forms.

use std::path::{Path, PathBuf};

use fmu::prelude::*;
use fmu::simulation::ContinuousSimulation;
use fmu::testing::abi::Export;
use fmu::testing::calls::{Function, Interface, Mode, Protocol, Version};
use fmu::testing::instance::{CallError, Instance};
use fmu::testing::runner::Model;
use fmu::testing::variable::{Kind, Role};

use crate::models::{Fmu, error_of, reference};

#[derive(Parameters)]
struct Tank {
    /// Volume at the start (m3)
    #[var(start = 2.0, min = 0.0, max = 10.0, tunable)]
    volume: f64,
    /// Cross section (m2)
    #[var(start = 0.5, min = 0.1, max = 2.0)]
    area: f64,
    /// Discharge coefficient (1)
    #[var(start = 0.6, min = 0.0, max = 1.0, tunable)]
    discharge: f64,
    /// Whether the outlet is open
    #[var(start = true, tunable)]
    is_open: bool,
}

#[derive(Derived)]
struct Outlet {
    /// Factor of the root of the level (1)
    #[var]
    factor: f64,
    /// Whether something flows
    #[var]
    flows: bool,
}

#[derive(State)]
struct Levels<T> {
    /// Level (m)
    #[var(calculated)]
    level: T,
    /// Level of the second tank (m)
    #[var(start = 1.0)]
    second: T,
    /// Sum of both at the start (m)
    #[var(calculated)]
    sum: T,
}

#[derive(Inputs)]
struct Inflow<T> {
    /// Inflow (m3/s)
    #[var(start = 0.25)]
    inflow: T,
}

#[derive(Outputs)]
struct Sight<T> {
    /// Relative level (1)
    relative: T,
    /// Switchings so far
    switched: i32,
    /// Whether the level is high
    is_high: bool,
}

#[derive(DiscreteState, Clone, Default)]
struct Alarm {
    is_high: bool,
    switched: i32,
    at_start: f64,
}

macro_rules! tanks {
    ($(#[doc = $doc:literal] $name:ident $solver:expr;)*) => {$(
        #[derive(Parameters)]
        struct $name {
            #[var(flatten)]
            p: Tank,
        }

        #[doc = $doc]
        #[fmu::model(stop_time = 1.0, step_size = 0.1, solver = $solver)]
        impl Continuous for $name {
            type State<T: Scalar> = Levels<T>;
            type Inputs<T: Scalar> = Inflow<T>;
            type Outputs<T: Scalar> = Sight<T>;
            type Derived = Outlet;
            type DiscreteState = Alarm;
            type Crossings = [f64; 1];

            fn derived(&self) -> Result<Outlet, String> {
                Ok(Outlet { factor: self.p.discharge * self.p.volume, flows: self.p.is_open })
            }
            fn initialize(&self, derived: &Outlet, state: &mut Levels<f64>) {
                // These sums would grow from call to call if the states did not have the same values before each call.
                state.level += self.p.volume / self.p.area;
                state.sum += state.level + state.second + derived.factor;
                state.second = -1.0; // ignored: this state is not calculated
            }
            fn initial_discrete_state(&self, at: At<f64, Self>) -> Alarm {
                let is_high = at.state.level > 1.0;
                Alarm { is_high, switched: 0, at_start: at.inputs.inflow + at.time + at.derived.factor }
            }
            fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> Levels<T> {
                let x = at.state;
                let flow = if at.derived.flows { x.level.max(T::from(0.0)) * at.derived.factor } else { T::from(0.0) };
                let overflow = x.second.if_greater(T::from(1.5), x.second - 1.5, T::from(0.0));
                let inflow = at.inputs.inflow + at.discrete.at_start * 0.01;
                Levels { level: (inflow - flow) / self.p.area, second: flow - overflow, sum: inflow }
            }
            fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Sight<T> {
                let relative = at.state.level / at.derived.factor.max(0.1);
                Sight { relative, switched: at.discrete.switched, is_high: at.discrete.is_high }
            }
            fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
                [at.state.level - 1.0 - at.derived.factor * 0.1]
            }
            fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
                Some((at.time * 4.0).floor() / 4.0 + 0.25)
            }
            fn on_event(&self, event: Event<Self>) {
                event.discrete.is_high = event.state.level > 1.0;
                event.discrete.switched += 1;
                event.state.second += 0.01;
            }
        }
    )*};
}

tanks! {
    /// Two tanks by the classical method
    Classical Solver::RungeKutta;
    /// Two tanks with error control
    Controlled Solver::DormandPrince { tolerance: 1e-6 };
    /// Two tanks by a solver that keeps a Jacobian
    Stiff Solver::Rosenbrock { tolerance: 1e-6 };
}

#[derive(DiscreteState, Clone, Default)]
struct Filtered {
    y: f64,
}

#[derive(Outputs)]
struct Signal {
    /// Signal (1)
    y: f64,
    /// Whether it is positive
    is_positive: bool,
}

#[derive(Parameters)]
struct Filter {
    #[var(flatten)]
    p: Tank,
}

/// A filter that starts at, and is made from, tunable parameters
#[fmu::model(stop_time = 1.0, step_size = 0.05)]
impl Discrete for Filter {
    type Inputs = Inflow<f64>;
    type Outputs = Signal;
    type State = Filtered;
    type Derived = Outlet;
    fn derived(&self) -> Result<Outlet, String> {
        Ok(Outlet { factor: self.p.discharge / (1.0 + self.p.volume), flows: self.p.is_open })
    }
    fn initial_state(&self, derived: &Outlet) -> Filtered {
        Filtered { y: self.p.volume + derived.factor }
    }
    fn update(&self, sample: Sample<Self>) -> Signal {
        let (x, d) = (sample.state, sample.derived);
        x.y += d.factor * (sample.inputs.inflow - x.y);
        Signal { y: x.y, is_positive: d.flows && x.y > 0.0 }
    }
}

#[derive(Parameters)]
struct Wave {
    #[var(flatten)]
    p: Tank,
}

/// A source whose signal follows from tunable parameters
#[fmu::model(stop_time = 1.0, step_size = 0.05)]
impl Discrete for Wave {
    type Outputs = Signal;
    type State = Filtered;
    type Derived = Outlet;
    const SOURCE: Option<Influence> = Some(|_, _| true);
    fn derived(&self) -> Result<Outlet, String> {
        Ok(Outlet { factor: self.p.discharge * self.p.area, flows: self.p.is_open })
    }
    fn initial_state(&self, derived: &Outlet) -> Filtered {
        Filtered { y: self.p.volume - derived.factor }
    }
    fn update(&self, sample: Sample<Self>) -> Signal {
        let (x, d) = (sample.state, sample.derived);
        x.y += d.factor + sample.time;
        Signal { y: x.y, is_positive: d.flows }
    }
}

#[derive(Parameters)]
struct Store {
    #[var(flatten)]
    p: Tank,
}

/// A simulation that starts from tunable parameters
#[fmu::model(stop_time = 1.0, step_size = 0.05)]
impl Stateful for Store {
    type Inputs = Inflow<f64>;
    type Outputs = Signal;
    type Simulation = Vec<f64>;
    const SERIALIZE: Option<fmu::Serialize<Vec<f64>>> = Some(fmu::Serialize {
        save: |x| Ok(x.iter().flat_map(|x| x.to_le_bytes()).collect()),
        load: |bytes| {
            let chunks = bytes.chunks_exact(8).map(|bytes| bytes.try_into().map_err(|_| "too short".to_owned()));
            chunks.map(|bytes| Ok(f64::from_le_bytes(bytes?))).collect()
        },
    });
    fn start(&self, _: &Path) -> Result<Vec<f64>, String> {
        Ok(vec![self.p.volume, self.p.area])
    }
    fn step(&self, x: &mut Vec<f64>, inputs: &Inflow<f64>, _: f64, step: f64) -> Result<(), String> {
        x[0] += step * self.p.discharge * inputs.inflow * x[1];
        Ok(())
    }
    fn outputs(&self, x: &Vec<f64>) -> Signal {
        Signal { y: x[0], is_positive: self.p.is_open }
    }
}

/// Pseudorandom number generator (xorshift).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() >> 11) as usize % n
    }

    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Variations of a run that must not change its results.
#[derive(Clone, Copy, Default, Debug)]
struct Variation {
    reads: bool,
    shuffles: bool,
    moves: bool,
}

struct Run<E: Export> {
    instance: Instance<E::Model>,
    protocol: Protocol,
    variation: Variation,
    random: Random,
    /// Bytes of the state at several times.
    bytes: Vec<Vec<u8>>,
}

impl<E: Export> Run<E> {
    fn instance(protocol: Protocol) -> Instance<E::Model> {
        let instance = Instance::new(protocol, E::description(), PathBuf::new());
        // The instance uses Event Mode if the version and the model support it.
        if protocol == Protocol::CS3 && E::Model::HAS_EVENTS { instance.with_event_mode() } else { instance }
    }

    fn is_exchange(&self) -> bool {
        self.protocol.interface == Interface::ModelExchange
    }

    /// Reads some variables, also with invalid calls, and ignores the results.
    fn read(&mut self) {
        let description = E::description();
        let layout = &description.layout;
        let reals = layout.reals() as u32;
        let i = &mut self.instance;
        for _ in 0..self.random.below(4) {
            let some = [self.random.below(reals as usize) as u32, self.random.below(layout.end as usize) as u32];
            let mut values = [0.0; 2];
            match self.random.below(8) {
                0 => drop(i.get_real(&some[..1], &mut values[..1])),
                1 => drop(i.get_real(&[some[0], u32::MAX], &mut values)),
                2 => drop((i.get_boolean(some[1]), i.get_integer(some[1]), i.get_string(some[1]).map(drop))),
                3 => drop(i.directional_derivative(
                    &[layout.derivatives.at.reals as u32],
                    &[layout.states.at.reals as u32],
                    &[1.0],
                    &mut values[..1],
                )),
                4 => drop(i.event_indicators(&mut vec![0.0; layout.indicators.total()])),
                5 => drop(i.state_derivatives(&mut vec![0.0; layout.states.counts.reals])),
                // Time and event indicators in FMI 3.0, then an invalid reference.
                6 => drop(i.get_float64(&[layout.end + self.random.below(3) as u32, some[0]], &mut values)),
                _ => drop(i.get_float64(&[layout.end + 1, u32::MAX], &mut values)),
            }
        }
    }

    /// Applies the variations between two calls.
    fn between(&mut self) {
        if self.variation.reads {
            self.read();
        }
        if self.variation.moves && self.random.below(3) == 0 {
            let snapshot = self.instance.snapshot().unwrap();
            let bytes = self.instance.serialize(&snapshot).unwrap();
            // Continues in an instance with a different history.
            let mut other = Self::instance(self.protocol);
            other.set_real(&[reference::<E>("volume")], &[7.0]).unwrap();
            other.enter_initialization().unwrap();
            if self.random.below(2) == 0 {
                other.exit_initialization().unwrap();
            }
            let snapshot = other.deserialize(&bytes).unwrap();
            other.restore(&snapshot).unwrap();
            assert_eq!(other.serialize(&other.snapshot().unwrap()).unwrap(), bytes);
            if self.random.below(2) == 0 {
                self.instance = other;
            } else {
                // Restores an earlier state, then the present one.
                let kept = self.instance.snapshot().unwrap();
                self.instance.restore(&snapshot).unwrap();
                self.instance.restore(&kept).unwrap();
            }
        }
    }

    /// Sets all variables that can be set now to random values.
    fn set(&mut self, values: &mut Random, is_before_start: bool) {
        let description = E::description();
        let mut sets = Vec::new();
        for variable in &description.layout.variables {
            let declaration = &variable.declaration;
            let is_settable = match variable.role {
                Role::Parameter if declaration.name == "sample_time" || declaration.name == "max_step" => false,
                Role::Parameter => is_before_start || declaration.tunable,
                Role::Input => true,
                Role::State => is_before_start && !declaration.calculated,
                _ => false,
            };
            let (part, chosen) = (values.unit(), values.below(3) > 0);
            if !(is_settable && chosen) {
                continue;
            }
            sets.push((
                variable.reference,
                match &declaration.kind {
                    Kind::Real(real) => {
                        let (min, max) = (real.min.unwrap_or(0.0), real.max.unwrap_or(1.0));
                        min + part * (max - min)
                    }
                    _ => f64::from(u8::from(part < 0.7)),
                },
            ));
        }
        if self.variation.shuffles {
            for i in (1..sets.len()).rev() {
                sets.swap(i, self.random.below(i + 1));
            }
        }
        for (reference, value) in sets {
            self.between();
            let i = &mut self.instance;
            if (reference as usize) < description.layout.reals() {
                i.set_real(&[reference], &[value]).unwrap();
            } else {
                i.set_boolean(&[reference], &[value != 0.0]).unwrap();
            }
        }
        self.between();
    }

    fn keep(&mut self) {
        self.between();
        let snapshot = self.instance.snapshot().unwrap();
        self.bytes.push(self.instance.serialize(&snapshot).unwrap());
    }

    fn update(&mut self) -> Result<(), CallError> {
        self.instance.new_discrete_states()?;
        self.between();
        if self.is_exchange() { self.instance.enter_continuous_time_mode() } else { self.instance.enter_step_mode() }
    }

    /// Runs a simulation and returns the values at its end.
    fn run(&mut self, seed: u64) -> Result<Vec<u64>, CallError> {
        let mut values = Random(seed);
        self.set(&mut values, true);
        self.keep();
        self.instance.set_experiment(Function::SetupExperiment, 0.5, None, None)?;
        self.instance.enter_initialization()?;
        self.set(&mut values, true);
        self.keep();
        self.instance.exit_initialization()?;
        self.keep();
        if self.instance.mode() == Mode::Event {
            self.update()?;
        }
        let h = 0.0625;
        for step in 0..12 {
            if self.is_exchange() && step % 3 == 0 {
                self.instance.enter_event_mode()?;
                self.between();
                self.set(&mut values, false);
                self.update()?;
            } else if !self.is_exchange() && step % 3 == 0 {
                self.set(&mut values, false);
            }
            self.keep();
            let time = self.instance.time();
            if self.is_exchange() {
                let count = E::description().layout.states.counts.reals;
                let (mut x, mut slopes) = (vec![0.0; count], vec![0.0; count]);
                self.instance.continuous_states(&mut x)?;
                self.instance.state_derivatives(&mut slopes)?;
                self.instance.set_time(time + h)?;
                x.iter_mut().zip(slopes).for_each(|(x, slope)| *x += h * slope);
                self.instance.set_continuous_states(&x)?;
            } else if self.protocol.version == Version::Fmi2 {
                self.instance.do_step(time, h)?;
            } else if self.instance.do_step_to_event(time, h)? {
                self.between();
                self.instance.enter_event_mode()?;
                self.between();
                self.update()?;
            }
        }
        self.keep();
        let references: Vec<u32> = (0..E::description().layout.reals() as u32).collect();
        let mut reals = vec![0.0; references.len()];
        self.instance.get_real(&references, &mut reals)?;
        let mut all: Vec<u64> = reals.iter().map(|value| value.to_bits()).collect();
        for variable in &E::description().layout.variables {
            match variable.declaration.kind {
                Kind::Boolean { .. } => all.push(self.instance.get_boolean(variable.reference)?.into()),
                Kind::Integer { .. } => {
                    all.push(self.instance.get_integer(variable.reference)?.cast_unsigned().into());
                }
                _ => {}
            }
        }
        Ok(all)
    }
}

const CO_SIMULATION: [Protocol; 2] = [Protocol::CS2, Protocol::CS3];
/// All protocols but scheduled execution, which is for models with clocks.
const WITHOUT_CLOCKS: [Protocol; 4] = [Protocol::CS2, Protocol::ME2, Protocol::CS3, Protocol::ME3];

/// Number of seeds for each protocol, multiplied by `FMU_TEST_FACTOR`.
fn seeds() -> u64 {
    39 * std::env::var("FMU_TEST_FACTOR").map_or(1, |factor| factor.parse::<u64>().unwrap())
}

fn check<E: Export>(protocols: &[Protocol]) {
    let run = |protocol, variation, seed| {
        let (instance, random) = (Run::<E>::instance(protocol), Random(seed ^ 0x9e37_79b9_7f4a_7c15));
        let mut run = Run::<E> { instance, protocol, variation, random, bytes: Vec::new() };
        let end = run.run(seed).unwrap();
        (end, run.bytes)
    };
    for &protocol in protocols {
        for seed in 1..=seeds() {
            let (end, bytes) = run(protocol, Variation::default(), seed);
            for number in 1..8 {
                let variation = Variation { reads: number & 1 > 0, shuffles: number & 2 > 0, moves: number & 4 > 0 };
                let name = std::any::type_name::<E>();
                let (other_end, other_bytes) = run(protocol, variation, seed);
                let differs = bytes.iter().zip(&other_bytes).position(|(a, b)| a != b);
                assert_eq!(differs, None, "bytes of {name}, {protocol:?}, {variation:?}, seed {seed}");
                assert_eq!(end, other_end, "{name}, {protocol:?}, {variation:?}, seed {seed}");
            }
        }
    }
}

#[test]
fn results_of_continuous_time_models_depend_on_the_values_alone() {
    check::<Classical>(&WITHOUT_CLOCKS);
    check::<Controlled>(&WITHOUT_CLOCKS);
    // Not checked in model exchange, where the importer's solver is used.
    check::<Stiff>(&CO_SIMULATION);
}

#[test]
fn results_of_discrete_time_models_depend_on_the_values_alone() {
    check::<Filter>(&WITHOUT_CLOCKS);
    check::<Wave>(&WITHOUT_CLOCKS);
}

#[test]
fn results_of_stateful_models_depend_on_the_values_alone() {
    check::<Store>(&CO_SIMULATION);
}

/// level(0) = volume/area, independent of what was read before.
#[test]
fn calculated_states_follow_tunable_parameters() {
    for reads in [false, true] {
        let mut fmu = Fmu::<Classical>::initializing(0.0);
        if reads {
            assert_eq!(fmu.get("level"), 4.0);
            assert_eq!(fmu.get("sum"), 4.0 + 1.0 + 0.6 * 2.0);
        }
        fmu.set("volume", 10.0).unwrap();
        fmu.set("second", 2.0).unwrap();
        if reads {
            assert_eq!(fmu.get("level"), 20.0);
        }
        fmu.0.exit_initialization().unwrap();
        assert_eq!(fmu.get("level"), 20.0);
        assert_eq!((fmu.get("second"), fmu.get("sum")), (2.0, 20.0 + 2.0 + 0.6 * 10.0));
    }
}

#[test]
fn derived_parameters_follow_tunable_ones_after_the_start() {
    let mut fmu = Fmu::<Classical>::starting(0.0, &[("volume", 1.0)]);
    assert_eq!((fmu.get("level"), fmu.get("factor")), (2.0, 0.6));
    fmu.set("discharge", 0.25).unwrap();
    fmu.set_boolean("is_open", false).unwrap();
    assert_eq!((fmu.get("level"), fmu.get("factor")), (2.0, 0.25));
    assert!(!fmu.0.get_boolean(reference::<Classical>("flows")).unwrap());
    // No outflow: level' = (inflow + at_start/100)/area, at_start = 0.25 + 0.6.
    fmu.set("inflow", 0.0).unwrap();
    fmu.step(0.125).unwrap();
    assert!((fmu.get("level") - (2.0 + 0.125 * 0.0085 / 0.5)).abs() < 1e-15);
    // A discrete-time model: y += factor (u - y) from y = volume + factor.
    let mut filter = Fmu::<Filter>::starting(0.0, &[("volume", 1.0), ("inflow", 0.0)]);
    filter.set("volume", 0.0).unwrap();
    filter.step(0.05).unwrap();
    assert!((filter.get("y") - (1.0 + 0.3) * (1.0 - 0.6)).abs() < 1e-15);
}

/// A run in Rust is bit-identical to the FMU.
#[test]
fn derived_parameters_of_a_run_in_rust_follow_tunable_ones() {
    let tank = |discharge| Classical { p: Tank { volume: 2.0, area: 0.5, discharge, is_open: true } };
    let mut run = ContinuousSimulation::new(tank(0.6)).unwrap();
    let mut fmu = Fmu::<Classical>::ready();
    for discharge in [0.6, 0.1] {
        run.set_parameters(tank(discharge)).unwrap();
        fmu.set("discharge", discharge).unwrap();
        run.step(&Inflow { inflow: 0.25 }, 0.1).unwrap();
        fmu.step(0.1).unwrap();
        assert_eq!(run.state().level.to_bits(), fmu.get("level").to_bits());
        assert_eq!(run.derived().factor, 2.0 * discharge);
    }
}

/// FMI 2.0.4, sections 2.2.7 and 2.2.8: a variable that changes with a tunable parameter is tunable, and depends on it
/// at the start.
#[test]
fn the_description_has_the_dependencies_on_tunable_parameters() {
    let xml = &Classical::description().xml;
    let variable = &xml[xml.find("name=\"factor\"").unwrap()..];
    assert!(variable[..200].contains("causality=\"calculatedParameter\" variability=\"tunable\""), "{xml}");
    let at = |name: &str| Classical::description().layout.structure_index(reference::<Classical>(name));
    let initial = &xml[xml.find("<InitialUnknowns>").unwrap()..];
    for unknown in ["factor", "level"] {
        let element = &initial[initial.find(&format!("index=\"{}\"", at(unknown))).unwrap()..];
        let element = &element[..element.find("/>").unwrap()];
        for parameter in ["volume", "area", "discharge", "is_open"] {
            let number = at(parameter).to_string();
            let list = element.split('"').nth(3).unwrap();
            assert!(list.split(' ').any(|index| index == number), "{unknown} on {parameter}: {element}");
        }
    }
}

#[test]
fn the_tolerance_of_the_experiment_is_that_of_the_solver() {
    let starting = |tolerance: Option<f64>, set: Option<f64>, is_before: bool| {
        let mut fmu = Fmu::<Controlled>::new();
        let setup = |fmu: &mut Fmu<Controlled>| {
            fmu.0.set_experiment(Function::SetupExperiment, 0.0, None, tolerance).unwrap();
        };
        if !is_before {
            setup(&mut fmu);
        }
        if let Some(set) = set {
            fmu.set("tolerance", set).unwrap();
        }
        if is_before {
            // The same must hold after the state was converted to bytes.
            let snapshot = fmu.0.deserialize(&fmu.bytes()).unwrap();
            fmu = Fmu::new();
            fmu.0.restore(&snapshot).unwrap();
            setup(&mut fmu);
        }
        fmu.0.enter_initialization().unwrap();
        fmu.0.exit_initialization().unwrap();
        fmu.step(1.0).unwrap();
        fmu
    };
    for is_before in [false, true] {
        let mut usual = starting(None, None, is_before);
        assert_eq!(usual.get("tolerance"), 1e-6);
        let mut fine = starting(Some(1e-9), None, is_before);
        assert_eq!(fine.get("tolerance"), 1e-9);
        assert_ne!(fine.get("level").to_bits(), usual.get("level").to_bits());
        assert_eq!(fine.bits(), starting(None, Some(1e-9), is_before).bits());
        // Setting the parameter, even to its present value, takes precedence over the tolerance of the experiment.
        assert_eq!(starting(Some(1e-3), Some(1e-9), is_before).bits(), fine.bits());
        assert_eq!(starting(Some(1e-3), Some(1e-6), is_before).bits(), usual.bits());
    }
    let mut fmu = Fmu::<Controlled>::new();
    for tolerance in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let message = error_of(fmu.0.set_experiment(Function::SetupExperiment, 0.0, None, Some(tolerance)));
        assert!(message.contains("fmi2SetupExperiment: tolerance must be finite and above 0, got"), "{message}");
    }
    // This solver does not use the tolerance, so any value is accepted.
    Fmu::<Classical>::new().0.set_experiment(Function::SetupExperiment, 0.0, None, Some(0.0)).unwrap();
}
