//! The driver as an FMU: limits, files, saved states.

use std::sync::Arc;

use fmu::testing::calls::Protocol;
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::Instance;
use fmu::testing::runner::DiscreteModel;

use super::*;

type Unit = Instance<DiscreteModel<Driver>>;

/// An instance with its value references by name.
struct Fmu {
    instance: Unit,
    description: Arc<Description>,
}

impl Fmu {
    fn new(resources: &Path) -> Self {
        let description = Arc::new(Description::of::<DiscreteModel<Driver>>(Format::FMI2, Path::new("")));
        Self { instance: Unit::new(Protocol::CS2, Arc::clone(&description), resources.to_owned()), description }
    }

    fn reference(&self, name: &str) -> u32 {
        let variable = self.description.layout.variables.iter().find(|v| v.declaration.name == name);
        variable.unwrap_or_else(|| panic!("no variable '{name}'")).reference
    }

    fn get(&mut self, name: &str) -> f64 {
        let mut value = [0.0];
        self.instance.get_real(&[self.reference(name)], &mut value).unwrap();
        value[0]
    }

    fn set(&mut self, name: &str, value: f64) {
        self.instance.set_real(&[self.reference(name)], &[value]).unwrap();
    }

    fn choose(&mut self, name: &str, value: i32) -> Result<(), fmu::testing::instance::CallError> {
        self.instance.set_integer(&[self.reference(name)], &[value])
    }

    fn take_file(&mut self, path: &str) {
        self.instance.set_string(&[self.reference("table.file")], &[path.to_owned()]).unwrap();
    }

    fn initialize(&mut self) -> Result<(), String> {
        self.instance.setup_experiment(0.0, None).unwrap();
        self.instance.enter_initialization().unwrap();
        self.instance.exit_initialization().map_err(|error| match error {
            fmu::testing::instance::CallError::Error(message) | fmu::testing::instance::CallError::Discard(message) => {
                message
            }
        })
    }

    fn step(&mut self, step: f64) {
        self.instance.do_step(self.instance.time(), step).unwrap();
    }
}

const TABLE: &str = "time,driver.steer,driver.brake\n0,0,0\n2,0.2,1\n";

/// The outputs are valid from the start, and another instance continues from a serialized state.
#[test]
fn demands_and_saved_bytes() {
    let mut fmu = Fmu::new(Path::new(""));
    fmu.set("throttle.amplitude", 0.5);
    fmu.initialize().unwrap();
    assert_eq!([fmu.get("driver.speed"), fmu.get("driver.throttle")], [60.0 / 3.6, 0.0]);
    fmu.step(0.001);
    assert_eq!([fmu.get("driver.speed"), fmu.get("driver.steer")], [60.0 / 3.6, 0.0]);
    // the sample at 1.999 s: both ramps have ended
    fmu.step(1.999);
    assert_eq!([fmu.get("driver.steer"), fmu.get("driver.throttle")], [0.1, 0.5]);
    let saved = fmu.instance.snapshot().unwrap();
    let bytes = fmu.instance.serialize(&saved).unwrap();
    let mut other = Fmu::new(Path::new(""));
    let read = other.instance.deserialize(&bytes).unwrap();
    other.instance.restore(&read).unwrap();
    assert_eq!([other.instance.time(), other.get("driver.steer")], [2.0, 0.1]);
    other.step(0.001);
}

#[test]
fn rejects_numbers_outside_their_limits() {
    let mut fmu = Fmu::new(Path::new(""));
    for (name, value) in [("maneuver", 8), ("maneuver", -1), ("steer.cycles", -1)] {
        assert!(fmu.choose(name, value).is_err(), "{name}");
    }
    for (name, value) in [("steer.rise_time", -0.1), ("brake.amplitude", 1.5), ("brake.start", f64::NAN)] {
        assert!(fmu.instance.set_real(&[fmu.reference(name)], &[value]).is_err(), "{name}");
    }
    fmu.choose("maneuver", 5).unwrap();
    fmu.set("steer.frequency", 0.0);
    assert_eq!(
        fmu.initialize().unwrap_err(),
        "Driver: 'steer.frequency' must be positive for 'maneuver' = 5 (sine_with_dwell), got 0"
    );
}

#[test]
fn table_comes_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("demands.csv");
    std::fs::write(&path, TABLE).unwrap();
    let mut fmu = Fmu::new(folder.path());
    fmu.choose("maneuver", 7).unwrap();
    fmu.take_file("no.csv");
    assert!(fmu.initialize().unwrap_err().starts_with("Driver: 'table.file' = no.csv: "));
    fmu.take_file("demands.csv");
    fmu.instance.exit_initialization().unwrap();
    fmu.step(1.0);
    fmu.step(0.001);
    assert_eq!([fmu.get("driver.steer"), fmu.get("driver.brake")], [0.1, 0.5]);

    // a saved state requires the same file content
    let saved = fmu.instance.snapshot().unwrap();
    let bytes = fmu.instance.serialize(&saved).unwrap();
    assert!(fmu.instance.deserialize(&bytes).is_ok());
    std::fs::write(&path, TABLE.replace("0.2", "0.3")).unwrap();
    assert!(fmu.instance.deserialize(&bytes).is_err());
    std::fs::write(&path, "time,steer\n").unwrap();
    let mut fmu = Fmu::new(Path::new(""));
    fmu.choose("maneuver", 7).unwrap();
    fmu.take_file(path.to_str().unwrap());
    let message = fmu.initialize().unwrap_err();
    assert!(
        message.starts_with("Driver: 'table.file': ") && message.contains(":1: the name of column 2 is unknown"),
        "{message}"
    );
}
