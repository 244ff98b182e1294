//! Saved states: in memory, as bytes, damaged.

use fmu::testing::abi::Export;
use fmu::testing::calls::{Function, Mode, Protocol};
use fmu::testing::instance::Instance;
use proptest::prelude::*;

use crate::models::{CartPair, Fmu, Fragile, Sampler, error_of};

/// An instance in Step Mode after some steps.
fn with_a_past() -> Fmu<Sampler> {
    let mut fmu = Fmu::<Sampler>::new();
    fmu.0.setup_experiment(1.5, Some(100.0)).unwrap();
    fmu.0.enter_initialization().unwrap();
    fmu.set_string("filter.label", "umlaut \u{e4}").unwrap();
    fmu.set_integer("filter.order", 3).unwrap();
    fmu.0.exit_initialization().unwrap();
    for k in 0..7 {
        fmu.set("filter_input", 0.1 * f64::from(k)).unwrap();
        fmu.step(0.013).unwrap();
    }
    fmu.set("filter.gain", -1.25).unwrap();
    fmu
}

/// Replaces the last eight bytes with a valid checksum (FNV-1a, 64 bits).
fn with_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    let body = bytes.len() - 8;
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    for byte in &bytes[..body] {
        hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    }
    bytes[body..].copy_from_slice(&hash.to_le_bytes());
    bytes
}

#[test]
fn a_state_can_be_saved_in_every_mode_and_goes_on_where_it_was_saved() {
    fn check<E: Export>(step: f64) {
        let mut fmu = Fmu::<E>::new();
        for mode in [Mode::Instantiated, Mode::Initialization, Mode::Step, Mode::Terminated] {
            match mode {
                Mode::Initialization => fmu.0.enter_initialization().unwrap(),
                Mode::Step => {
                    fmu.0.exit_initialization().unwrap();
                    fmu.step(step).unwrap();
                }
                Mode::Terminated => fmu.0.terminate().unwrap(),
                _ => {}
            }
            let bytes = fmu.bytes();
            assert_eq!(fmu.0.mode(), mode);
            // Restores the state in another instance.
            let mut other = Fmu::<E>::ready();
            other.step(0.75).unwrap();
            let snapshot = other.0.deserialize(&bytes).unwrap();
            other.0.restore(&snapshot).unwrap();
            assert_eq!(other.0.mode(), mode);
            assert_eq!(other.bytes(), bytes);
            if mode != Mode::Instantiated {
                assert_eq!(other.bits(), fmu.bits());
            }
        }
    }
    check::<CartPair>(0.031);
    check::<Sampler>(0.031);
    check::<Fragile>(0.25);
}

#[test]
fn a_restored_instance_has_strings_discrete_state_time_and_stop_time() {
    let fmu = with_a_past();
    let bytes = fmu.bytes();
    let mut other = Fmu::<Sampler>::new();
    let snapshot = other.0.deserialize(&bytes).unwrap();
    other.0.restore(&snapshot).unwrap();
    assert_eq!(other.0.time(), fmu.0.time());
    other.step(0.01).unwrap();
    assert_eq!(other.get("filter_label_length"), "umlaut \u{e4}".len() as f64);
    assert!(error_of(other.step(1000.0)).contains("stopTime = 100 s"));
}

#[test]
fn a_restored_state_does_not_change_with_the_instance() {
    let mut fmu = with_a_past();
    let snapshot = fmu.0.snapshot().unwrap();
    let bytes = fmu.bytes();
    for _ in 0..2 {
        fmu.set("filter_input", 9.0).unwrap();
        fmu.step(0.5).unwrap();
        fmu.0.restore(&snapshot).unwrap();
        assert_eq!(fmu.bytes(), bytes);
    }
}

#[test]
fn a_state_survives_a_reset() {
    let mut fmu = with_a_past();
    let snapshot = fmu.0.snapshot().unwrap();
    let bytes = fmu.bytes();
    fmu.0.reset().unwrap();
    assert_ne!(fmu.bytes(), bytes);
    fmu.0.restore(&snapshot).unwrap();
    assert_eq!(fmu.bytes(), bytes);
}

#[test]
fn the_calculated_parameters_of_a_restored_state_are_those_of_its_parameters() {
    let mut heavy = Fmu::<CartPair>::starting(0.0, &[("cart.mass", 8.0)]);
    let bytes = heavy.bytes();
    let mut fmu = Fmu::<CartPair>::ready();
    let snapshot = fmu.0.deserialize(&bytes).unwrap();
    fmu.0.restore(&snapshot).unwrap();
    assert_eq!(fmu.get("spring.frequency.l"), 1.0);
    fmu.step(0.5).unwrap();
    heavy.step(0.5).unwrap();
    assert_eq!(fmu.bits(), heavy.bits());
    // In Initialization Mode, setting a fixed parameter changes the derived parameters again.
    let mut fmu = Fmu::<CartPair>::initializing(0.0);
    assert_eq!(fmu.get("spring.frequency.l"), 2.0);
    let snapshot = fmu.0.snapshot().unwrap();
    fmu.set("cart.mass", 8.0).unwrap();
    fmu.0.restore(&snapshot).unwrap();
    assert_eq!(fmu.get("spring.frequency.l"), 2.0);
    fmu.set("cart.mass", 0.5).unwrap();
    assert_eq!(fmu.get("spring.frequency.l"), 4.0);
}

#[test]
fn every_single_damaged_byte_is_found() {
    let fmu = with_a_past();
    let bytes = fmu.bytes();
    for i in 0..bytes.len() {
        for flip in [0x01, 0x10, 0x80, 0xff] {
            let mut damaged = bytes.clone();
            damaged[i] ^= flip;
            let message = error_of(fmu.0.deserialize(&damaged).map(drop));
            assert!(message.starts_with("fmi2DeSerializeFMUstate: "), "byte {i}: {message}");
        }
    }
}

#[test]
fn truncated_and_extended_bytes_are_rejected() {
    let fmu = with_a_past();
    let bytes = fmu.bytes();
    for length in 0..bytes.len() {
        error_of(fmu.0.deserialize(&bytes[..length]).map(drop));
        // The truncated bytes must also be rejected if their checksum is valid.
        if length >= 8 {
            error_of(fmu.0.deserialize(&with_checksum(bytes[..length].to_vec())).map(drop));
        }
    }
    let mut longer = bytes;
    longer.push(0);
    error_of(fmu.0.deserialize(&longer).map(drop));
    assert_eq!(
        error_of(fmu.0.deserialize(&with_checksum(longer)).map(drop)),
        "fmi2DeSerializeFMUstate: 1 bytes too many"
    );
}

#[test]
fn other_bytes_are_rejected_with_a_reason() {
    let fmu = with_a_past();
    let bytes = fmu.bytes();
    let message = |bytes: &[u8]| error_of(fmu.0.deserialize(bytes).map(drop));
    assert_eq!(message(&[]), "fmi2DeSerializeFMUstate: too few bytes for a state");
    assert_eq!(
        message(&[b'x'; 100]),
        "fmi2DeSerializeFMUstate: the bytes are not a state saved by an FMU of this exporter"
    );
    let mut newer = bytes.clone();
    newer[8] = 9;
    assert_eq!(message(&with_checksum(newer)), "fmi2DeSerializeFMUstate: format version must be 5, got 9");
    assert_eq!(
        message(&Fmu::<Fragile>::ready().bytes()),
        format!(
            "fmi2DeSerializeFMUstate: the state belongs to another FMU: GUID {} instead of {}",
            Fragile::description().guid,
            Sampler::description().guid
        )
    );
    let mut damaged = bytes;
    *damaged.last_mut().unwrap() ^= 1;
    assert_eq!(message(&damaged), "fmi2DeSerializeFMUstate: the bytes are damaged (checksum)");
}

#[test]
fn a_state_without_derived_parameters_is_rejected() {
    let fmu = Fmu::<CartPair>::ready();
    let bytes = fmu.bytes();
    // Replaces the stiffness, 8 N/m, with a value that `derived` rejects.
    let at = bytes.windows(8).position(|window| window == 8.0_f64.to_le_bytes()).unwrap();
    let mut crafted = bytes;
    crafted[at..at + 8].copy_from_slice(&2e6_f64.to_le_bytes());
    assert_eq!(
        error_of(fmu.0.deserialize(&with_checksum(crafted.clone())).map(drop)),
        "fmi2DeSerializeFMUstate: 'spring.stiffness.l' must be at most 1e6 N/m, got 2000000 N/m"
    );
    crafted[at..at + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert_eq!(
        error_of(fmu.0.deserialize(&with_checksum(crafted)).map(drop)),
        "fmi2DeSerializeFMUstate: 'spring.stiffness.l' is not a finite number"
    );
}

#[test]
fn a_state_with_an_invalid_parameter_is_rejected() {
    // The fuzzer of the package `tests` crafted a state with a limit below 0, on which a model panicked.
    let fmu = with_a_past();
    let bytes = fmu.bytes();
    let at = bytes.windows(8).position(|window| window == (-1.25_f64).to_le_bytes()).unwrap();
    for (value, expected) in [(10.0, Ok(())), (10.5, Err("'filter.gain' = 10.5 1 is not in [-10, 10]"))] {
        let mut crafted = bytes.clone();
        crafted[at..at + 8].copy_from_slice(&f64::to_le_bytes(value));
        let result = fmu.0.deserialize(&with_checksum(crafted)).map(drop);
        match expected {
            Ok(()) => result.unwrap(),
            Err(message) => assert_eq!(error_of(result), format!("fmi2DeSerializeFMUstate: {message}")),
        }
    }
}

#[test]
fn a_state_with_a_mass_of_0_is_rejected() {
    let expected = "fmi2DeSerializeFMUstate: 'cart.mass' = 0 kg is not in [0.000001, inf]";
    for fmu in [Fmu::<CartPair>::ready(), Fmu::initializing(0.0)] {
        let mut bytes = fmu.bytes();
        let at = bytes.windows(8).position(|window| window == 2.0_f64.to_le_bytes()).unwrap();
        bytes[at..at + 8].copy_from_slice(&0.0_f64.to_le_bytes());
        assert_eq!(error_of(fmu.0.deserialize(&with_checksum(bytes)).map(drop)), expected);
    }
}

#[test]
fn a_state_with_a_wrong_number_of_samples_is_rejected() {
    // The bytes contain the time, then the count, then the reals (see `state_bytes`).
    let fmu = with_a_past();
    let bytes = fmu.bytes();
    let first = fmu.0.time().to_le_bytes();
    let at = bytes.windows(8).position(|window| window == first).unwrap() + 8;
    let count = u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap());
    assert!(count > 2, "{count}");
    for other in [0, count - 1, count + 1, u64::MAX] {
        let mut crafted = bytes.clone();
        crafted[at..at + 8].copy_from_slice(&other.to_le_bytes());
        let message = error_of(fmu.0.deserialize(&with_checksum(crafted)).map(drop));
        let start = format!("fmi2DeSerializeFMUstate: the sample counter is {other}, but from ");
        assert!(message.starts_with(&start) && message.ends_with(&format!("there are {count} samples")), "{message}");
    }
    // A continuous-time model does not take samples.
    let fmu = Fmu::<CartPair>::starting(3.25, &[]);
    let mut crafted = fmu.bytes();
    let at = crafted.windows(8).rposition(|window| window == 3.25_f64.to_le_bytes()).unwrap() + 8;
    crafted[at..at + 8].copy_from_slice(&1_u64.to_le_bytes());
    let message = error_of(fmu.0.deserialize(&with_checksum(crafted)).map(drop));
    assert!(message.ends_with("the sample counter is 1, but from 3.25 s to 3.25 s there are 0 samples"), "{message}");
}

/// The fuzzer of the package `tests` crafted a state in Event Mode. In this mode, a discrete-time model took its first
/// sample before the first step, and states that were saved later were rejected.
#[test]
fn a_state_in_a_missing_event_mode_is_rejected() {
    let folder = std::path::PathBuf::new();
    let mut instance = Instance::<<Sampler as Export>::Model>::new(Protocol::CS3, Sampler::description(), folder);
    instance.set_experiment(Function::SetupExperiment, 1.5, None, None).unwrap();
    instance.enter_initialization().unwrap();
    instance.exit_initialization().unwrap();
    let mut bytes = instance.serialize(&instance.snapshot().unwrap()).unwrap();
    // In the bytes, the mode comes directly before the start time.
    let at = bytes.windows(8).position(|window| window == 1.5_f64.to_le_bytes()).unwrap() - 4;
    assert_eq!(bytes[at..at + 4], (Mode::Step as u32).to_le_bytes());
    bytes[at..at + 4].copy_from_slice(&(Mode::Event as u32).to_le_bytes());
    assert_eq!(
        error_of(instance.deserialize(&with_checksum(bytes)).map(drop)),
        "fmi3DeserializeFMUState: a model without events has no Event Mode in co-simulation"
    );
}

fn steps() -> impl Strategy<Value = Vec<(f64, f64)>> {
    proptest::collection::vec((1e-4..0.05_f64, -2.0..2.0_f64), 1..20)
}

/// Continues from the present state and returns all observable values.
fn follow<E: Export>(fmu: &mut Fmu<E>, input: &str, steps: &[(f64, f64)]) -> Vec<Vec<u64>> {
    let mut seen = Vec::new();
    for (step, value) in steps {
        fmu.set(input, *value).unwrap();
        fmu.step(*step).unwrap();
        seen.push(fmu.bits());
    }
    seen
}

fn a_saved_state_goes_on_bit_by_bit<E: Export>(
    input: &str,
    start: f64,
    before: &[(f64, f64)],
    after: &[(f64, f64)],
) -> Result<(), TestCaseError> {
    let mut fmu = Fmu::<E>::starting(start, &[]);
    follow(&mut fmu, input, before);
    let snapshot = fmu.0.snapshot().unwrap();
    let bytes = fmu.bytes();
    let expected = follow(&mut fmu, input, after);
    // Continues in the same instance, from memory.
    fmu.0.restore(&snapshot).unwrap();
    prop_assert_eq!(&fmu.bytes(), &bytes);
    prop_assert_eq!(&follow(&mut fmu, input, after), &expected);
    // Continues in another instance, from bytes.
    let mut other = Fmu::<E>::new();
    let copy = other.0.deserialize(&bytes).unwrap();
    other.0.restore(&copy).unwrap();
    prop_assert_eq!(&other.bytes(), &bytes);
    prop_assert_eq!(&follow(&mut other, input, after), &expected);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_saved_continuous_model_goes_on_bit_by_bit(start in -1e4..1e4_f64, before in steps(), after in steps()) {
        a_saved_state_goes_on_bit_by_bit::<CartPair>("cart_force.l", start, &before, &after)?;
    }

    #[test]
    fn a_saved_discrete_model_goes_on_bit_by_bit(start in -1e4..1e4_f64, before in steps(), after in steps()) {
        a_saved_state_goes_on_bit_by_bit::<Sampler>("filter_input", start, &before, &after)?;
    }

    /// With constant inputs, the results of a discrete-time model do not depend on the communication steps. The steps
    /// are whole milliseconds, so that a step cannot end within the tolerance of a sample by accident.
    #[test]
    fn splitting_steps_does_not_change_a_discrete_model(
        start in prop_oneof![Just(0.0), Just(1e4), -100.0..100.0_f64],
        input in -2.0..2.0_f64,
        splits in proptest::collection::vec(1..40_u32, 1..30),
    ) {
        let total: u32 = splits.iter().sum();
        let at = |ms: u32| start + f64::from(ms) * 1e-3;
        let mut whole = Fmu::<Sampler>::starting(start, &[("filter_input", input)]);
        whole.0.do_step(at(0), at(total) - at(0)).unwrap();
        let mut split = Fmu::<Sampler>::starting(start, &[("filter_input", input)]);
        let mut ms = 0;
        for step in splits {
            split.0.do_step(at(ms), at(ms + step) - at(ms)).unwrap();
            ms += step;
        }
        prop_assert_eq!(split.get("filter_count"), f64::from(total.div_ceil(10)));
        prop_assert_eq!(split.bits(), whole.bits());
    }

    /// Crafted bytes with a valid checksum are rejected, or the restored instance works correctly; nothing panics.
    #[test]
    fn crafted_bytes_are_rejected_or_harmless(
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 1..4),
    ) {
        let mut fmu = with_a_past();
        let mut bytes = fmu.bytes();
        let changeable = bytes.len() - 8;
        for (index, value) in changes {
            bytes[index.index(changeable)] = value;
        }
        if let Ok(snapshot) = fmu.0.deserialize(&with_checksum(bytes)) {
            fmu.0.restore(&snapshot).unwrap();
            let time = fmu.0.time();
            let _ = fmu.0.do_step(time, 0.01);
            let _ = fmu.try_get("filter_output");
            let _ = fmu.set("filter_input", 1.0);
            fmu.0.reset().unwrap();
        }
    }
}
