//! Compares the table with the values in its file.

use fmu::simulation::ContinuousSimulation;
use fmu::{Continuous as _, Variables as _};
use lookup_table::{LookupTable, U};

/// Reference: the rows of `torque.csv`, with linear interpolation between them and constant values outside. All numbers
/// are exact in binary.
#[test]
fn torque_is_interpolated() {
    let model = LookupTable { factor: 0.5, ..LookupTable::default() };
    let mut run = ContinuousSimulation::new(model).expect("it starts");
    for (speed, torque) in [(-10.0, 180.0), (0.0, 180.0), (50.0, 200.0), (200.0, 240.0), (575.0, 30.0), (700.0, 0.0)] {
        assert_eq!(run.outputs(&U { speed }).torque, 0.5 * torque, "at {speed} rad/s");
    }
}

/// Reference: the slope of the table between 200 and 300 rad/s, -0.1 N.m.s/rad.
#[test]
fn the_derivative_is_the_slope_of_the_table() {
    let model = LookupTable::default();
    let derived = model.derived().expect("a table");
    let inputs = U { speed: fmu::Dual64::new(250.0, 1.0) };
    let at = fmu::At { time: 0.0.into(), state: &(), inputs: &inputs, derived: &derived, discrete: &() };
    assert!((model.outputs(at).reals()[0].eps + 0.1).abs() < 1e-15);
}

#[test]
fn mistakes_in_the_file_are_reported_with_their_line() {
    let folder = tempfile::tempdir().expect("a folder");
    let error = |text: &str| {
        std::fs::write(folder.path().join("torque.csv"), text).expect("a file");
        LookupTable::default().load(folder.path()).err().expect("an error")
    };
    assert!(error("speed,torque\n0,1\n1,two\n").ends_with("torque.csv:3: `two` is not a finite number"));
    assert!(
        error("speed,torque\n0,1\n0,2\n").ends_with("torque.csv:3: the first column must increase, but 0 follows 0")
    );
    let file = "missing.csv".to_owned();
    let missing = LookupTable { file, ..LookupTable::default() }.load(folder.path()).err().expect("an error");
    assert!(missing.starts_with("'file': ") && missing.contains("missing.csv"), "{missing}");
}

#[test]
fn other_contents_have_another_fingerprint() {
    let folder = tempfile::tempdir().expect("a folder");
    let fingerprint = |text: &str| {
        std::fs::write(folder.path().join("torque.csv"), text).expect("a file");
        LookupTable::fingerprint(&LookupTable::default().load(folder.path()).expect("a table"))
    };
    let first = fingerprint("speed,torque\n0,1\n");
    assert_ne!(fingerprint("speed,torque\n0,2\n"), first);
    assert_eq!(fingerprint("speed,torque\n0,1\n"), first);
}
