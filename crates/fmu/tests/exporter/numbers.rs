//! Numbers of all sizes as parameters, inputs, outputs and discrete state. References: FMI 3.0.2, section 2.4.4
//! (types); the limits of Rust's types; a feedthrough, whose outputs are its inputs or parameters.
#![allow(unsafe_code, reason = "the functions of the C interface are unsafe")]

use std::cell::Cell;

use fmu::prelude::*;
use fmu::testing::abi::{Export, Status, fmi3};
use fmu::testing::calls::{Function, Protocol};
use fmu::testing::description::Format;
use fmu::testing::instance::{CallError, Instance as SafeInstance};
use fmu::testing::number::Number;

use crate::fmi3::Instance;
use crate::models::{Fmu, error_of, exported, reference};

/// Level
#[derive(Enumeration, Clone, Copy, Debug, Default, PartialEq)]
#[repr(u8)]
pub(crate) enum Level {
    /// Low
    #[default]
    Low,
    /// High
    High = 200,
}

macro_rules! numbers {
    ($($derive:ident)*, $name:ident $(, $key:ident)?) => {
        #[derive($($derive,)* Clone, Debug, PartialEq)]
        pub(crate) struct $name {
            /// Real of 32 bits (m)
            #[var(start = 0.1 $(, $key)?)]
            float32: f32,
            /// Signed, 8 bits
            #[var(start = -128 $(, $key)?)]
            int8: i8,
            /// Unsigned, 8 bits
            #[var(start = 255 $(, $key)?)]
            uint8: u8,
            /// Signed, 16 bits
            #[var(start = -32_768 $(, $key)?)]
            int16: i16,
            /// Unsigned, 16 bits
            #[var(start = 65_535 $(, $key)?)]
            uint16: u16,
            /// Signed, 32 bits
            #[var(start = -2_147_483_648 $(, $key)?)]
            int32: i32,
            /// Unsigned, 32 bits
            #[var(start = 4_294_967_295 $(, $key)?)]
            uint32: u32,
            /// Signed, 64 bits
            #[var(start = -9_223_372_036_854_775_808 $(, $key)?)]
            int64: i64,
            /// Unsigned, 64 bits
            #[var(start = 18_446_744_073_709_551_615 $(, $key)?)]
            uint64: u64,
            /// Level
            #[var(start = Level::High $(, $key)?)]
            level: Level,
            /// Three numbers
            #[var(start = [1, 2, 3] $(, $key)?)]
            three: [u8; 3],
        }
    };
}
numbers!(Parameters, P, tunable);
numbers!(Inputs, U);
numbers!(Outputs, Y);

impl Default for Past {
    fn default() -> Self {
        Self { float32: 0.0, int8: 0, uint8: 0, int16: 0, uint16: 0, int32: 0, uint32: 0, int64: 0, level: Level::Low }
    }
}

/// The inputs of the last sample.
#[derive(DiscreteState, Clone, Debug, PartialEq)]
pub(crate) struct Past {
    float32: f32,
    int8: i8,
    uint8: u8,
    int16: i16,
    uint16: u16,
    int32: i32,
    uint32: u32,
    int64: i64,
    level: Level,
}

#[derive(Parameters)]
pub(crate) struct Numbers {
    #[var(nested)]
    p: P,
    /// Outputs are the parameters
    #[var(start = false, tunable)]
    of_parameters: bool,
    /// Outputs are the inputs of the last sample
    #[var(start = false, tunable)]
    of_past: bool,
}

#[derive(Inputs)]
pub(crate) struct AllInputs {
    #[var(nested)]
    u: U,
}

#[derive(Outputs)]
pub(crate) struct AllOutputs {
    #[var(nested)]
    y: Y,
}

/// Mirrors numbers of all sizes
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Numbers {
    type Inputs = AllInputs;
    type Outputs = AllOutputs;
    type State = Past;
    fn update(&self, sample: Sample<Self>) -> AllOutputs {
        let U { float32, int8, uint8, int16, uint16, int32, uint32, int64, uint64, level, three } = sample.inputs.u;
        let past = Past { float32, int8, uint8, int16, uint16, int32, uint32, int64, level };
        let past = std::mem::replace(sample.state, past);
        let y = Y { float32, int8, uint8, int16, uint16, int32, uint32, int64, uint64, level, three };
        let y = if self.of_parameters {
            let P { float32, int8, uint8, int16, uint16, int32, uint32, int64, uint64, level, three } = self.p;
            Y { float32, int8, uint8, int16, uint16, int32, uint32, int64, uint64, level, three }
        } else if self.of_past {
            let Past { float32, int8, uint8, int16, uint16, int32, uint32, int64, level } = past;
            Y { float32, int8, uint8, int16, uint16, int32, uint32, int64, level, ..y }
        } else {
            y
        };
        AllOutputs { y }
    }
}

exported! {
    Numbers3: Numbers, Format::FMI3;
}

fn get<V: Number + Default>(instance: &Instance<Numbers3>, function: Function, name: &str) -> Result<V, String> {
    let mut value = V::default();
    let reference = reference::<Numbers3>(name);
    // SAFETY: arrays of one element.
    let status = unsafe { fmi3::get_number::<Numbers3, V>(instance.component, function, &reference, 1, &mut value, 1) };
    if status == Status::Ok { Ok(value) } else { Err(instance.messages.lock().unwrap().pop().unwrap()) }
}

fn set<V: Number>(instance: &Instance<Numbers3>, function: Function, name: &str, value: V) -> Result<(), String> {
    let reference = reference::<Numbers3>(name);
    // SAFETY: arrays of one element.
    let status = unsafe { fmi3::set_number::<Numbers3, V>(instance.component, function, &reference, 1, &value, 1) };
    if status == Status::Ok { Ok(()) } else { Err(instance.messages.lock().unwrap().pop().unwrap()) }
}

/// Outputs have the start value, and later every bit of a number that was set as an input or a parameter.
fn passes<V: Number + Default + PartialEq + std::fmt::Debug>(
    name: &str,
    [getter, setter]: [Function; 2],
    start: V,
    values: &[V],
) {
    let instance = Instance::<Numbers3>::co_simulation(false).initialized();
    let of = |block: &str| format!("{block}.{name}");
    assert_eq!(instance.step(0.0, 0.1).0, Status::Ok);
    assert_eq!(get::<V>(&instance, getter, &of("y")), Ok(start), "{name}");
    for (i, &value) in values.iter().enumerate() {
        set(&instance, setter, &of("u"), value).unwrap();
        set(&instance, setter, &of("p"), value).unwrap();
        assert_eq!(get::<V>(&instance, getter, &of("u")), Ok(value), "{name}");
        assert_eq!(get::<V>(&instance, getter, &of("p")), Ok(value), "{name}");
        assert_eq!(instance.step(0.1 * (i + 1) as f64, 0.1).0, Status::Ok);
        assert_eq!(get::<V>(&instance, getter, &of("y")), Ok(value), "{name}");
    }
}

#[test]
fn numbers_of_all_sizes_pass_through() {
    use Function as F;
    passes::<f32>(
        "float32",
        [F::GetFloat32, F::SetFloat32],
        0.1,
        &[f32::MAX, f32::MIN, f32::MIN_POSITIVE, f32::from_bits(1), -0.0],
    );
    passes::<i8>("int8", [F::GetInt8, F::SetInt8], i8::MIN, &[i8::MAX, -1, 0]);
    passes::<u8>("uint8", [F::GetUInt8, F::SetUInt8], u8::MAX, &[u8::MIN, 128]);
    passes::<i16>("int16", [F::GetInt16, F::SetInt16], i16::MIN, &[i16::MAX, -1]);
    passes::<u16>("uint16", [F::GetUInt16, F::SetUInt16], u16::MAX, &[u16::MIN, 0x8000]);
    passes::<i32>("int32", [F::GetInteger, F::SetInteger], i32::MIN, &[i32::MAX, -1]);
    passes::<u32>("uint32", [F::GetUInt32, F::SetUInt32], u32::MAX, &[u32::MIN, 0x8000_0000]);
    passes::<i64>("int64", [F::GetInt64, F::SetInt64], i64::MIN, &[i64::MAX, -1]);
    passes::<u64>("uint64", [F::GetUInt64, F::SetUInt64], u64::MAX, &[u64::MIN, 1 << 63]);
    passes::<u8>("level", [F::GetUInt8, F::SetUInt8], 200, &[0, 200]);
    passes::<u8>("three[2]", [F::GetUInt8, F::SetUInt8], 2, &[7]);
}

#[test]
fn the_function_of_another_type_names_the_right_one() {
    let instance = Instance::<Numbers3>::co_simulation(false);
    let r = reference::<Numbers3>("u.int8");
    assert_eq!(
        get::<i16>(&instance, Function::GetInt16, "u.int8").unwrap_err(),
        format!("fmi3GetInt16: value reference {r} must be a variable of type Int16, it is 'u.int8' of type Int8")
    );
    assert_eq!(
        set::<f32>(&instance, Function::SetFloat32, "u.int8", 1.0).unwrap_err(),
        format!("fmi3SetFloat32: value reference {r} must be a variable of type Float32, it is 'u.int8' of type Int8")
    );
    let message = get::<i64>(&instance, Function::GetInt64, "u.int8").unwrap_err();
    assert!(message.contains("of type Int64 or Enumeration, it is 'u.int8' of type Int8"), "{message}");
    for value in [f32::NAN, f32::INFINITY] {
        let message = set(&instance, Function::SetFloat32, "u.float32", value).unwrap_err();
        assert!(message.contains("'u.float32' must be a finite Float32, got"), "{message}");
    }
    let message = set::<u8>(&instance, Function::SetUInt8, "p.level", 199).unwrap_err();
    assert!(message.contains("must be 0 (low) or 200 (high), got 199"), "{message}");
}

#[test]
fn a_state_of_numbers_comes_back() {
    let instance = Instance::<Numbers3>::co_simulation(false).initialized();
    set(&instance, Function::SetInt8, "u.int8", -7_i8).unwrap();
    set(&instance, Function::SetInt64, "u.int64", i64::MIN + 1).unwrap();
    set(&instance, Function::SetFloat32, "u.float32", 0.3_f32).unwrap();
    assert_eq!(instance.step(0.0, 0.1).0, Status::Ok);
    let other = instance.copied();
    let set_past = |instance: &Instance<Numbers3>| {
        let (reference, value) = (reference::<Numbers3>("of_past"), 1);
        // SAFETY: arrays of one element.
        let status = unsafe { fmi3::set_boolean::<Numbers3>(instance.component, &reference, 1, &value, 1) };
        assert_eq!(status, Status::Ok);
    };
    for instance in [&instance, &other] {
        set_past(instance);
        set(instance, Function::SetInt8, "u.int8", 1_i8).unwrap();
        assert_eq!(instance.step(0.1, 0.1).0, Status::Ok);
        assert_eq!(get::<i8>(instance, Function::GetInt8, "y.int8"), Ok(-7));
        assert_eq!(get::<i64>(instance, Function::GetInt64, "y.int64"), Ok(i64::MIN + 1));
        assert_eq!(get::<f32>(instance, Function::GetFloat32, "y.float32"), Ok(0.3));
    }
}

fn element<'x>(xml: &'x str, name: &str) -> &'x str {
    let at = xml.find(&format!("name=\"{name}\"")).unwrap_or_else(|| panic!("{name} is missing"));
    let start = xml[..at].rfind('<').unwrap();
    &xml[start..start + xml[start..].find('>').unwrap() + 1]
}

#[test]
fn the_description_of_fmi_3_has_the_types() {
    let xml = &Numbers3::description().xml;
    for (name, kind, start) in [
        ("float32", "Float32", "0.1"),
        ("int8", "Int8", "-128"),
        ("uint8", "UInt8", "255"),
        ("int16", "Int16", "-32768"),
        ("uint16", "UInt16", "65535"),
        ("int32", "Int32", "-2147483648"),
        ("uint32", "UInt32", "4294967295"),
        ("int64", "Int64", "-9223372036854775808"),
        ("uint64", "UInt64", "18446744073709551615"),
        ("level", "UInt8", "200"),
    ] {
        let text = element(xml, &format!("u.{name}"));
        assert!(text.starts_with(&format!("<{kind} ")) && text.contains(&format!("start=\"{start}\"")), "{text}");
        assert!(text.contains("variability=\"discrete\""), "{text}");
    }
    assert!(xml.contains("<UInt8Type name=\"Level\""), "the type of the enumeration has its size");
    assert!(element(xml, "u.float32").contains("unit=\"m\""));
}

#[derive(Parameters)]
pub(crate) struct Small {
    /// Real of 32 bits (m)
    #[var(start = 0.1, min = -1.0, max = 2.0, tunable)]
    float32: f32,
    /// Signed, 8 bits
    #[var(start = 1, tunable)]
    int8: i8,
    /// Unsigned, 64 bits
    #[var(start = 1, min = 0, max = 2_147_483_647, tunable)]
    uint64: u64,
}

#[derive(Inputs)]
pub(crate) struct SmallInputs {
    /// Real of 32 bits (m)
    #[var(max = 1.0)]
    float32_input: f32,
    /// Real (m)
    real: f64,
    /// Unsigned, 64 bits
    #[var(min = 0, max = 10)]
    count: u64,
}

#[derive(Outputs)]
pub(crate) struct SmallOutputs {
    /// Real of 32 bits (m)
    float32_sum: f32,
    /// Unsigned, 64 bits
    #[var(min = 0, max = 2_147_483_647)]
    square: u64,
}

/// Numbers that FMI 2.0 has
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Small {
    type Inputs = SmallInputs;
    type Outputs = SmallOutputs;
    type State = ();
    fn update(&self, sample: Sample<Self>) -> SmallOutputs {
        let SmallInputs { float32_input, real, .. } = *sample.inputs;
        SmallOutputs { float32_sum: self.float32 + float32_input + real as f32, square: self.uint64 * self.uint64 }
    }
}

/// In FMI 2.0, a number of 32 bits is a Real, even in a list with numbers of 64 bits, and an integer of any size is an
/// Integer.
#[test]
fn fmi_2_has_the_numbers_that_fit() {
    let xml = &Small::description().xml;
    for (name, expected) in [
        // A Real has 64 bits, so this is the value that importers read.
        ("float32", "<Real unit=\"m\" min=\"-1.0\" max=\"2.0\" start=\"0.10000000149011612\"/>"),
        ("int8", "<Integer min=\"-128\" max=\"127\" start=\"1\"/>"),
        ("uint64", "<Integer min=\"0\" max=\"2147483647\" start=\"1\"/>"),
        ("square", "<Integer min=\"0\" max=\"2147483647\" start=\"0\"/>"),
    ] {
        let at = xml.find(&format!("name=\"{name}\"")).unwrap();
        assert!(xml[at..].lines().nth(1).unwrap().trim_start().starts_with(expected), "{}", &xml[at..at + 300]);
    }
    let mut fmu = Fmu::<Small>::initializing(0.0);
    fmu.0.exit_initialization().unwrap();
    let of = reference::<Small>;
    let some = [of("real"), of("float32"), of("float32_input")];
    fmu.0.set_real(&some, &[0.25, 1.5, 0.1]).unwrap();
    let mut values = [0.0; 3];
    fmu.0.get_real(&some, &mut values).unwrap();
    assert_eq!(values, [0.25, 1.5, f64::from(0.1_f32)]);
    fmu.step(0.1).unwrap();
    fmu.0.get_real(&[of("float32_sum")], &mut values[..1]).unwrap();
    assert_eq!(values[0], f64::from(1.5_f32 + 0.1_f32 + 0.25_f32));

    // Nothing is set if one value is invalid or one variable has another type.
    for (value, expected) in [(2.5, "in [-1, 2], got 2.5"), (1e39, "in [-1, 2], got inf"), (f64::NAN, "got NaN")] {
        let message = error_of(fmu.0.set_real(&some, &[7.0, value, 0.5]));
        assert!(message.contains("'float32' must be a finite number") && message.contains(expected), "{message}");
    }
    let message = error_of(fmu.0.set_real(&[of("real"), of("int8")], &[7.0, 1.0]));
    assert!(message.contains("must be a variable of type Real, it is 'int8' of type Integer"), "{message}");
    fmu.0.get_real(&some, &mut values).unwrap();
    assert_eq!(values, [0.25, 1.5, f64::from(0.1_f32)]);
    // The limit of an input is only information for the importer, so a value beyond it is accepted.
    fmu.0.set_real(&[of("float32_input")], &[3.0]).unwrap();

    for value in [-129, 128] {
        let message = error_of(fmu.0.set_integer(&[of("int8")], &[value]));
        assert!(message.contains(&format!("'int8' must be in [-128, 127], got {value}")), "{message}");
    }
    let message = error_of(fmu.0.set_integer(&[of("count")], &[-1]));
    assert!(message.contains("'count' must be in [0, 18446744073709551615], got -1"), "{message}");
    // The limit of an input is information for the importer, also in a saved state.
    fmu.0.set_integer(&[of("count")], &[11]).unwrap();
    let saved = fmu.0.serialize(&fmu.0.snapshot().unwrap()).unwrap();
    let mut other = Fmu::<Small>::new();
    let copy = other.0.deserialize(&saved).unwrap();
    other.0.restore(&copy).unwrap();
    assert_eq!(other.0.get_integer(of("count")).unwrap(), 11);
    let message = error_of(fmu.0.set_integer(&[of("uint64")], &[-1]));
    assert!(message.contains("'uint64' must be in [0, 2147483647], got -1"), "{message}");
    fmu.0.set_integer(&[of("uint64")], &[40_000]).unwrap();
    fmu.step(0.1).unwrap();
    assert_eq!(fmu.0.get_integer(of("square")).unwrap(), 1_600_000_000);
    fmu.0.set_integer(&[of("uint64")], &[50_000]).unwrap();
    fmu.step(0.1).unwrap();
    let message = error_of(fmu.0.get_integer(of("square")));
    assert!(
        message.contains("'square' = 2500000000 does not fit in the 32 bits of an Integer of FMI 2.0"),
        "{message}"
    );
}

#[derive(Parameters)]
pub(crate) struct Overflow {
    /// Factor (1)
    #[var(start = 1e38, tunable)]
    factor: f32,
}

#[derive(Outputs)]
pub(crate) struct Product {
    /// Ten times the factor (1)
    product: f32,
}

/// Overflows
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Overflow {
    type Inputs = ();
    type Outputs = Product;
    type State = ();
    fn update(&self, _: Sample<Self>) -> Product {
        Product { product: self.factor * 10.0 }
    }
}

/// A real output of 32 bits that is not finite is an error, like one of 64 bits.
#[test]
fn a_result_that_is_not_finite_is_an_error() {
    let mut fmu = Fmu::<Overflow>::initializing(0.0);
    fmu.0.exit_initialization().unwrap();
    let message = error_of(fmu.step(0.1));
    assert!(message.contains("'product' became inf at 0 s"), "{message}");
}

#[derive(State)]
pub(crate) struct GrowingState<T> {
    /// State (1)
    #[var(start = 1.0)]
    x: T,
}

#[derive(Outputs)]
pub(crate) struct GrowingOutputs<T> {
    /// Twice the state (1)
    double: T,
    /// Ten times the factor (1)
    product: f32,
}

#[derive(Parameters)]
pub(crate) struct Growing {
    /// Factor (1)
    #[var(start = 1.0, tunable)]
    factor: f32,
}

thread_local! {
    /// Number of evaluations of the derivatives.
    static DERIVATIVES: Cell<u32> = const { Cell::new(0) };
}

/// x' = x
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Growing {
    type State<T: Scalar> = GrowingState<T>;
    type Outputs<T: Scalar> = GrowingOutputs<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> GrowingState<T> {
        DERIVATIVES.set(DERIVATIVES.get() + 1);
        GrowingState { x: at.state.x }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> GrowingOutputs<T> {
        GrowingOutputs { double: at.state.x * 2.0, product: self.factor * 10.0 }
    }
}

/// Like a real of 64 bits. Reading a real of 32 bits needs no derivatives.
#[test]
fn a_float32_that_is_not_finite_is_not_read() {
    let some = ["double", "product"].map(reference::<Growing>);
    for protocol in [Protocol::CS2, Protocol::ME2] {
        let mut fmu = Fmu::<Growing>(SafeInstance::new(protocol, Growing::description(), Default::default()));
        fmu.0.setup_experiment(0.0, None).unwrap();
        fmu.0.enter_initialization().unwrap();
        fmu.0.exit_initialization().unwrap();
        let (evaluations, mut values) = (DERIVATIVES.get(), [0.0; 2]);
        fmu.0.get_real(&some, &mut values).unwrap();
        assert_eq!((values, DERIVATIVES.get()), ([2.0, 10.0], evaluations));
        fmu.set("factor", 1e38).unwrap();
        let mut values = [7.0; 2];
        let message = "fmi2GetReal: 'product' = inf at time 0 s, not a finite number".to_owned();
        let expected = match protocol {
            Protocol::CS2 => CallError::Error(message),
            _ => CallError::Discard(message),
        };
        assert_eq!(fmu.0.get_real(&some, &mut values), Err(expected));
        assert_eq!((values, DERIVATIVES.get()), ([7.0; 2], evaluations));
        // The other values are still read.
        fmu.0.get_real(&some[..1], &mut values[..1]).unwrap();
        assert_eq!(values[0], 2.0);
    }
}

#[derive(Parameters)]
pub(crate) struct Limited {
    /// Share (1)
    #[var(start = 0.1, min = 0.1, max = 0.3, tunable)]
    share: f32,
}

#[derive(Outputs)]
pub(crate) struct LimitedOutputs<T> {
    /// Entry of a table (1)
    entry: T,
}

#[derive(DiscreteState, Clone, Default)]
pub(crate) struct Place {
    /// 0 to 2.
    index: u8,
    is_last: bool,
}

/// Reads a table at an index that its discrete state keeps
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Limited {
    type Outputs<T: Scalar> = LimitedOutputs<T>;
    type DiscreteState = Place;
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> LimitedOutputs<T> {
        let entry = [1.0, 2.0, 3.0][usize::from(at.discrete.index)];
        LimitedOutputs { entry: if at.discrete.is_last { T::from(0.0) } else { T::from(entry) } }
    }
    fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
        (!at.discrete.is_last).then(|| 0.25 * f64::from(at.discrete.index + 1))
    }
    fn on_event(&self, event: Event<Self>) {
        let place = event.discrete;
        place.index = (place.index + 1).min(2);
        place.is_last = place.index == 2;
    }
}

/// Limits are those of the type of the variable: 0.1 as `f64` is below 0.1 as `f32`.
#[test]
fn a_float32_takes_its_limits() {
    let mut fmu = Fmu::<Limited>::initializing(0.0);
    for share in [0.3, 0.1, f64::from(0.3_f32)] {
        fmu.0.set_real(&[reference::<Limited>("share")], &[share]).unwrap();
    }
    for share in [0.3001, 0.0999] {
        assert!(error_of(fmu.0.set_real(&[reference::<Limited>("share")], &[share])).contains("in [0.1"), "{share}");
    }
}

/// An index is not tried with other values while the model is described: the table would have no such entry.
#[test]
fn an_index_of_8_bits_in_a_discrete_state_keeps_its_value() {
    let mut fmu = Fmu::<Limited>::initializing(0.0);
    fmu.0.exit_initialization().unwrap();
    assert_eq!(fmu.get("entry"), 1.0);
    fmu.step(0.3).unwrap();
    assert_eq!(fmu.get("entry"), 2.0);
    fmu.step(0.3).unwrap();
    assert_eq!(fmu.get("entry"), 0.0);
}
