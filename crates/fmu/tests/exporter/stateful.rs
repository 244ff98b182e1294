//! Stateful models: a simulation that the exporter only clones. Reference: the equations of the simulation.

use std::collections::HashMap;
use std::path::Path;

use fmu::prelude::*;
use fmu::testing::abi::Export;

use crate::models::{Fmu, error_of, reference};

/// A recursive type.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
enum Behavior {
    Idle,
    Count { down: u32 },
    Then(Box<Behavior>, Box<Behavior>),
}

/// A simulation with a map, a list of any length and a recursive type.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Warehouse {
    time: f64,
    history: Vec<f64>,
    stock: HashMap<String, f64>,
    behavior: Behavior,
}

impl Warehouse {
    fn new(initial: f64, delay: i32) -> Self {
        let count = Behavior::Count { down: delay.cast_unsigned() };
        let behavior = Behavior::Then(Box::new(count), Box::new(Behavior::Idle));
        Self { time: 0.0, history: Vec::new(), stock: HashMap::from([("steel".to_owned(), initial)]), behavior }
    }

    fn advance(&mut self, inflow: f64, good: &str, step: f64) {
        self.time += step;
        *self.stock.entry(good.to_owned()).or_insert(0.0) += inflow * step;
        self.history.push(self.stock.values().sum());
        self.behavior = match std::mem::replace(&mut self.behavior, Behavior::Idle) {
            Behavior::Then(first, second) => match *first {
                Behavior::Count { down: 0 } => *second,
                Behavior::Count { down } => Behavior::Then(Box::new(Behavior::Count { down: down - 1 }), second),
                first => Behavior::Then(Box::new(first), second),
            },
            other => other,
        };
    }
}

#[derive(Inputs)]
struct Delivery {
    /// Inflow (kg/s)
    #[var(start = 1.0)]
    inflow: f64,
    /// Good that is delivered
    #[var(start = "steel")]
    good: String,
}

#[derive(Outputs)]
struct Stock {
    /// Sum of all goods (kg)
    total: f64,
    /// Length of the history
    entries: i32,
    /// Idle
    idle: bool,
    /// Greatest stock
    greatest: String,
}

macro_rules! warehouse {
    ($name:ident $(, $serialize:ident)?) => {
        #[derive(Parameters)]
        struct $name {
            /// Initial stock (kg)
            #[var(start = 2.0)]
            initial: f64,
            /// Steps until it is idle
            #[var(start = 3, min = 0)]
            delay: i32,
        }

        /// Warehouse
        #[fmu::model(stop_time = 1.0, step_size = 0.5 $(, $serialize)?)]
        impl Stateful for $name {
            type Simulation = Warehouse;
            type Inputs = Delivery;
            type Outputs = Stock;

            fn start(&self, _: &Path) -> Result<Warehouse, String> {
                if self.initial < 0.0 {
                    return Err(format!("'initial' must be 0 kg or more, got {} kg", self.initial));
                }
                Ok(Warehouse::new(self.initial, self.delay))
            }
            fn step(&self, warehouse: &mut Warehouse, inputs: &Delivery, time: f64, step: f64) -> Result<(), String> {
                if inputs.good.is_empty() {
                    return Err(format!("'good' must not be empty at {time} s"));
                }
                warehouse.advance(inputs.inflow, &inputs.good, step);
                Ok(())
            }
            fn outputs(&self, warehouse: &Warehouse) -> Stock {
                let greatest = warehouse.stock.iter().max_by(|a, b| a.1.total_cmp(b.1));
                Stock {
                    total: warehouse.stock.values().sum(),
                    entries: warehouse.history.len() as i32,
                    idle: warehouse.behavior == Behavior::Idle,
                    greatest: greatest.map_or_else(String::new, |(name, _)| name.clone()),
                }
            }
        }
    };
}

warehouse!(Depot);
#[cfg(feature = "serde")]
warehouse!(SerializedDepot, serialize);

fn read<E: Export>(fmu: &mut Fmu<E>) -> (f64, i32, bool, String) {
    (
        fmu.get("total"),
        fmu.0.get_integer(reference::<E>("entries")).unwrap(),
        fmu.0.get_boolean(reference::<E>("idle")).unwrap(),
        fmu.0.get_string(reference::<E>("greatest")).unwrap().to_str().unwrap().to_owned(),
    )
}

fn run<E: Export>() -> Fmu<E> {
    let mut fmu = Fmu::<E>::starting(0.0, &[("initial", 4.0)]);
    assert_eq!(read(&mut fmu), (4.0, 0, false, "steel".to_owned()));
    fmu.step(0.5).unwrap();
    assert_eq!(read(&mut fmu), (4.5, 1, false, "steel".to_owned()));
    fmu.set_string("good", "wood").unwrap();
    fmu.set("inflow", 8.0).unwrap();
    // The outputs are still those of the last step.
    assert_eq!(read(&mut fmu), (4.5, 1, false, "steel".to_owned()));
    fmu.step(1.0).unwrap();
    assert_eq!(read(&mut fmu), (12.5, 2, false, "wood".to_owned()));
    fmu
}

/// Outputs in the next steps.
fn follow<E: Export>(fmu: &mut Fmu<E>) -> Vec<(f64, i32, bool, String)> {
    let mut seen = vec![read(fmu)];
    for step in [0.5, 0.25, 1.0] {
        fmu.step(step).unwrap();
        seen.push(read(fmu));
    }
    seen
}

#[test]
fn a_simulation_with_collections_runs_and_is_saved_by_a_clone() {
    let mut fmu = run::<Depot>();
    let saved = fmu.0.snapshot().unwrap();
    let expected = follow(&mut fmu);
    assert_eq!(expected.last().unwrap(), &(26.5, 5, true, "wood".to_owned()));
    for _ in 0..2 {
        fmu.0.restore(&saved).unwrap();
        assert_eq!(follow(&mut fmu), expected);
    }
    fmu.0.reset().unwrap();
    fmu.0.enter_initialization().unwrap();
    assert_eq!(read(&mut fmu), (2.0, 0, false, "steel".to_owned()));
    let message = "fmi2SerializeFMUstate: the state of this model cannot be serialized";
    fmu.0.exit_initialization().unwrap();
    assert_eq!(error_of(fmu.0.serialize(&fmu.0.snapshot().unwrap())), message);
    assert!(!Depot::description().xml.contains("canSerializeFMUstate"));
}

#[test]
fn errors_of_a_simulation_are_those_of_the_model() {
    let mut fmu = Fmu::<Depot>::initializing(0.0);
    fmu.set("initial", -1.0).unwrap();
    assert_eq!(error_of(fmu.0.exit_initialization()), "Depot: 'initial' must be 0 kg or more, got -1 kg");
    fmu.set("initial", 1.0).unwrap();
    fmu.0.exit_initialization().unwrap();
    let saved = fmu.0.snapshot().unwrap();
    fmu.set_string("good", "").unwrap();
    assert_eq!(
        error_of(fmu.step(0.5)),
        "fmi2DoStep: 'good' must not be empty at 0 s; the state at 0 s was restored and the instance cannot continue"
    );
    fmu.0.restore(&saved).unwrap();
    fmu.step(0.5).unwrap();
    assert_eq!(fmu.get("total"), 1.5);
    // A result that is not finite is an error, too.
    fmu.set("inflow", f64::MAX).unwrap();
    let message = error_of(fmu.step(1e3));
    assert!(message.starts_with("fmi2DoStep: 'total' became inf at 1000.5 s"), "{message}");
    assert_eq!(fmu.get("total"), 1.5);
}

#[cfg(feature = "serde")]
#[test]
fn a_serialized_simulation_continues_in_another_instance() {
    let mut fmu = run::<SerializedDepot>();
    let bytes = fmu.bytes();
    let expected = follow(&mut fmu);
    let mut other = Fmu::<SerializedDepot>::new();
    let saved = other.0.deserialize(&bytes).unwrap();
    other.0.restore(&saved).unwrap();
    assert_eq!(follow(&mut other), expected);
    assert!(SerializedDepot::description().xml.contains("canSerializeFMUstate=\"true\""));
    for length in 0..bytes.len() {
        error_of(other.0.deserialize(&bytes[..length]).map(drop));
    }
}
