//! All types of variables, as parameters, inputs, outputs and discrete state, in all kinds of models. Reference: the
//! equations, and FMI 2.0.4, sections 2.2.3 (types) and 2.2.7 (variables).

use std::path::Path;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::Mode;

use crate::models::{Fmu, error_of, reference};

/// Gear
#[derive(Enumeration, Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) enum Gear {
    /// Neutral
    #[default]
    Neutral,
    /// First
    First,
    /// Top gear
    Top = 6,
}

#[derive(Parameters, Clone)]
pub(crate) struct All {
    /// Real (m)
    #[var("p.real", start = 1.5, min = -10.0, max = 10.0, tunable)]
    real: f64,
    /// Integer
    #[var("p.integer", start = -3, tunable)]
    integer: i32,
    /// Boolean
    #[var("p.boolean", start = true, tunable)]
    boolean: bool,
    /// String
    #[var("p.string", start = "<p>", tunable)]
    string: String,
    /// Named
    #[var("p.named", start = Gear::First, tunable)]
    named: Gear,
    /// Listed
    #[var("p.listed", start = Gear::Top, enumeration, tunable)]
    listed: Gear,
}

#[derive(Inputs, Clone)]
pub(crate) struct U<T> {
    /// Real (m)
    #[var("u.real", start = 0.5)]
    real: T,
    /// Integer
    #[var("u.integer", start = 7)]
    integer: i32,
    /// Boolean
    #[var("u.boolean")]
    boolean: bool,
    /// String
    #[var("u.string", start = "u")]
    string: String,
    /// Named
    #[var("u.named")]
    named: Gear,
    /// Listed
    #[var("u.listed", start = Gear::Top, enumeration)]
    listed: Gear,
}

#[derive(Outputs, Clone)]
pub(crate) struct Y<T> {
    /// Real (m)
    #[var("y.real")]
    real: T,
    /// Integer
    #[var("y.integer")]
    integer: i32,
    /// Boolean
    #[var("y.boolean")]
    boolean: bool,
    /// String
    #[var("y.string")]
    string: String,
    /// Named
    #[var("y.named")]
    named: Gear,
    /// Listed
    #[var("y.listed", enumeration)]
    listed: Gear,
}

/// Sums of the inputs.
#[derive(DiscreteState, Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(crate) struct Sums {
    real: f64,
    integer: i32,
    count: u64,
    boolean: bool,
    string: String,
    named: Gear,
    past: [bool; 2],
}

impl Sums {
    fn add(&mut self, u: &U<f64>) {
        self.real += u.real;
        self.integer = self.integer.wrapping_add(u.integer);
        self.count += 1;
        self.past = [self.boolean, self.past[0]];
        self.boolean ^= u.boolean;
        self.string.push_str(&u.string);
        self.named = u.named;
    }
    /// Outputs computed from parameters and sums.
    fn outputs<T: Scalar>(&self, p: &All) -> Y<T> {
        Y {
            real: T::from(p.real + self.real),
            integer: p.integer + self.integer + self.count as i32,
            boolean: p.boolean ^ self.boolean ^ self.past[1],
            string: format!("{}{}", p.string, self.string),
            named: if self.named == Gear::Neutral { p.named } else { self.named },
            listed: p.listed,
        }
    }
}

#[derive(Parameters)]
struct ContinuousTypes {
    #[var(flatten)]
    p: All,
}

/// Adds its inputs at events
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for ContinuousTypes {
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    type DiscreteState = Sums;
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        at.discrete.outputs(&self.p)
    }
    fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
        Some((at.discrete.count as f64 + 1.0) * 0.125)
    }
    fn on_event(&self, event: Event<Self>) {
        event.discrete.add(event.inputs);
    }
}

#[derive(Parameters)]
pub(crate) struct DiscreteTypes {
    #[var(flatten)]
    p: All,
}

/// Adds its inputs at samples
#[fmu::model(stop_time = 1.0, step_size = 0.125)]
impl Discrete for DiscreteTypes {
    type Inputs = U<f64>;
    type Outputs = Y<f64>;
    type State = Sums;
    fn update(&self, sample: Sample<Self>) -> Y<f64> {
        sample.state.add(sample.inputs);
        sample.state.outputs(&self.p)
    }
}

macro_rules! stateful {
    ($name:ident $(, $serialize:ident)?) => {
        /// Adds its inputs in steps
        #[fmu::model(stop_time = 1.0, step_size = 0.125 $(, $serialize)?)]
        impl Stateful for $name {
            type Inputs = U<f64>;
            type Outputs = Y<f64>;
            type Simulation = Sums;
            fn start(&self, _: &Path) -> Result<Sums, String> {
                Ok(Sums::default())
            }
            fn step(&self, sums: &mut Sums, inputs: &U<f64>, _time: f64, _step: f64) -> Result<(), String> {
                sums.add(inputs);
                Ok(())
            }
            fn outputs(&self, sums: &Sums) -> Y<f64> {
                sums.outputs(&self.p)
            }
        }
    };
}

#[derive(Parameters)]
struct StatefulTypes {
    #[var(flatten)]
    p: All,
}

stateful!(StatefulTypes);

#[cfg(feature = "serde")]
#[derive(Parameters)]
struct SerializedTypes {
    #[var(flatten)]
    p: All,
}

#[cfg(feature = "serde")]
stateful!(SerializedTypes, serialize);

/// Values of all types.
#[derive(Clone, Debug, PartialEq)]
struct Seen(f64, i32, bool, String, i32, i32);

fn seen<E: Export>(fmu: &mut Fmu<E>, of: &str) -> Seen {
    let name = |kind: &str| reference::<E>(&format!("{of}.{kind}"));
    let real = fmu.get(&format!("{of}.real"));
    let text = fmu.0.get_string(name("string")).unwrap().to_str().unwrap().to_owned();
    Seen(
        real,
        fmu.0.get_integer(name("integer")).unwrap(),
        fmu.0.get_boolean(name("boolean")).unwrap(),
        text,
        fmu.0.get_integer(name("named")).unwrap(),
        fmu.0.get_integer(name("listed")).unwrap(),
    )
}

fn set<E: Export>(fmu: &mut Fmu<E>, of: &str, values: &Seen) {
    let name = |kind: &str| format!("{of}.{kind}");
    fmu.set(&name("real"), values.0).unwrap();
    fmu.set_integer(&name("integer"), values.1).unwrap();
    fmu.set_boolean(&name("boolean"), values.2).unwrap();
    fmu.set_string(&name("string"), &values.3).unwrap();
    fmu.set_integer(&name("named"), values.4).unwrap();
    fmu.set_integer(&name("listed"), values.5).unwrap();
}

fn check<E: Export>(is_serializable: bool) {
    let start = || (Seen(1.5, -3, true, "<p>".into(), 1, 6), Seen(0.5, 7, false, "u".into(), 0, 6));
    let mut fmu = Fmu::<E>::initializing(0.0);
    assert_eq!((seen(&mut fmu, "p"), seen(&mut fmu, "u")), start());
    for of in ["p", "u"] {
        for kind in ["named", "listed"] {
            let message = error_of(fmu.set_integer(&format!("{of}.{kind}"), 2));
            assert!(message.contains("must be 0 (neutral) or 1 (first) or 6 (top)"), "{message}");
        }
    }
    let (p, u) = (Seen(-2.0, 10, false, "ä".into(), 0, 1), Seen(0.25, -1, true, "x".into(), 6, 0));
    set(&mut fmu, "p", &p);
    set(&mut fmu, "u", &u);
    assert_eq!((seen(&mut fmu, "p"), seen(&mut fmu, "u")), (p.clone(), u.clone()));
    fmu.0.exit_initialization().unwrap();

    // A discrete-time model takes samples at 0 and 0.125 s, a continuous-time model has events at 0.125 and 0.25 s.
    fmu.step(0.25).unwrap();
    let count = if E::description().xml.contains("Adds its inputs in steps") { 1 } else { 2 };
    let expected = match count {
        1 => Seen(-1.75, 10 - 1 + 1, true, "äx".into(), 6, 1),
        _ => Seen(-1.5, 10 - 2 + 2, false, "äxx".into(), 6, 1),
    };
    assert_eq!(seen(&mut fmu, "y"), expected);

    let follow = |fmu: &mut Fmu<E>| {
        set(fmu, "u", &Seen(1.0, 3, true, "z".into(), 0, 1));
        fmu.step(0.125).unwrap();
        set(fmu, "p", &Seen(9.0, 1, true, "q".into(), 6, 6));
        fmu.step(0.125).unwrap();
        (seen(fmu, "p"), seen(fmu, "u"), seen(fmu, "y"))
    };
    let saved = fmu.0.snapshot().unwrap();
    let bytes = fmu.0.serialize(&saved);
    let expected = follow(&mut fmu);
    fmu.0.restore(&saved).unwrap();
    assert_eq!(follow(&mut fmu), expected);
    if is_serializable {
        let mut other = Fmu::<E>::new();
        let copy = other.0.deserialize(&bytes.unwrap()).unwrap();
        other.0.restore(&copy).unwrap();
        assert_eq!(follow(&mut other), expected);
    } else {
        assert_eq!(error_of(bytes), "fmi2SerializeFMUstate: the state of this model cannot be serialized");
    }
    fmu.0.reset().unwrap();
    assert_eq!(fmu.0.mode(), Mode::Instantiated);
    fmu.0.enter_initialization().unwrap();
    assert_eq!((seen(&mut fmu, "p"), seen(&mut fmu, "u")), start());

    let xml = &E::description().xml;
    assert_eq!(xml.contains("canSerializeFMUstate=\"true\""), is_serializable);
    let written = |name: &str| {
        let (_, rest) = xml.split_once(&format!("name=\"{name}\"")).unwrap();
        let (_, rest) = rest.split_once("<").unwrap();
        rest.split_once("/>").unwrap().0
    };
    for (name, expected) in [
        ("p.real", r#"Real unit="m" min="-10.0" max="10.0" start="1.5""#),
        ("p.integer", r#"Integer start="-3""#),
        ("p.boolean", r#"Boolean start="true""#),
        ("p.string", r#"String start="&lt;p&gt;""#),
        ("p.named", r#"Integer declaredType="Gear" min="0" max="6" start="1""#),
        ("p.listed", r#"Enumeration declaredType="GearEnumeration" min="0" max="6" start="6""#),
        ("u.real", r#"Real unit="m" start="0.5""#),
        ("u.integer", r#"Integer start="7""#),
        ("u.boolean", r#"Boolean start="false""#),
        ("u.string", r#"String start="u""#),
        ("u.named", r#"Integer declaredType="Gear" min="0" max="6" start="0""#),
        ("u.listed", r#"Enumeration declaredType="GearEnumeration" min="0" max="6" start="6""#),
    ] {
        assert_eq!(written(name), expected, "{name}");
    }
}

#[test]
fn continuous_models_have_all_types() {
    check::<ContinuousTypes>(true);
}

#[test]
fn discrete_models_have_all_types() {
    check::<DiscreteTypes>(true);
}

#[test]
fn stateful_models_have_all_types() {
    check::<StatefulTypes>(false);
}

#[cfg(feature = "serde")]
#[test]
fn serialized_stateful_models_have_all_types() {
    check::<SerializedTypes>(true);
}
