//! The road as an FMU: names, limits, files, saved states.

use std::sync::Arc;

use fmu::testing::calls::Protocol;
use fmu::testing::description::{Description, Format};
use fmu::testing::instance::Instance;
use fmu::testing::runner::DiscreteModel;

use super::*;

type Unit = Instance<DiscreteModel<Road>>;

/// An instance with its value references by name.
struct Fmu {
    instance: Unit,
    description: Arc<Description>,
}

impl Fmu {
    fn new(resources: &Path) -> Self {
        let description = Arc::new(Description::of::<DiscreteModel<Road>>(Format::FMI2, Path::new("")));
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

    fn step(&mut self) -> Vec<u64> {
        self.instance.do_step(self.instance.time(), 0.001).unwrap();
        let names: Vec<String> = self.outputs();
        names.iter().map(|name| self.get(name).to_bits()).collect()
    }

    fn outputs(&self) -> Vec<String> {
        let layout = &self.description.layout;
        layout.outputs.reals().map(|index| layout.real_name(index).to_owned()).collect()
    }
}

const TABLE: &str = "distance,height_left,height_right\n0,0,0\n10,0.1,0.2\n";

/// Each signal has outputs for wheels and for sides. Before the first sample, they already have the values of that
/// sample.
#[test]
fn outputs_for_six_wheels_and_two_sides() {
    let mut fmu = Fmu::new(Path::new(""));
    let places = ["fl", "fr", "ml", "mr", "rl", "rr", "l", "r"];
    let expected: Vec<_> = ["road_height", "road_friction"]
        .iter()
        .flat_map(|signal| places.map(|place| format!("{signal}.{place}")))
        .chain(["road.distance".to_owned()])
        .collect();
    assert_eq!(fmu.outputs(), expected);
    fmu.set("friction.right", 0.5);
    fmu.initialize().unwrap();
    let start: Vec<u64> = fmu.outputs().iter().map(|name| fmu.get(name).to_bits()).collect();
    fmu.set("vehicle.speed", 25.0);
    assert_eq!(fmu.step(), start);
    assert_eq!([fmu.get("road_friction.fr"), fmu.get("road_friction.r"), fmu.get("road_friction.l")], [0.5, 0.5, 1.0]);
    assert!(fmu.get("road_height.fr") != 0.0);
    for [side, wheel] in [["l", "fl"], ["r", "fr"]] {
        assert_eq!(fmu.get(&format!("road_height.{side}")), fmu.get(&format!("road_height.{wheel}")));
    }
    // friction is tunable: a change takes effect at the next sample
    fmu.set("friction.right", 0.25);
    fmu.step();
    assert_eq!(fmu.get("road_friction.rr"), 0.25);
}

#[test]
fn rejects_numbers_outside_their_limits() {
    let mut fmu = Fmu::new(Path::new(""));
    for (name, value) in
        [("profile", 4), ("tracks", -1), ("seed", -1), ("roughness.class", 9), ("roughness.change_class", 0)]
    {
        assert!(fmu.choose(name, value).is_err(), "{name}");
    }
    for (name, value) in [
        ("track.coherence", 1.5),
        ("geometry.axle_offset.rear", -1.0),
        ("roughness.spacing", -1.0),
        ("roughness.cutoff", 0.0),
    ] {
        assert!(fmu.instance.set_real(&[fmu.reference(name)], &[value]).is_err(), "{name}");
    }
}

/// After serialization, every profile continues bit-identically in another instance.
#[test]
fn saved_bytes_continue() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("road.csv"), TABLE).unwrap();
    for profile in 0..4 {
        for tracks in 0..4 {
            let mut fmu = Fmu::new(folder.path());
            fmu.choose("profile", profile).unwrap();
            fmu.choose("tracks", tracks).unwrap();
            fmu.take_file("road.csv");
            fmu.set("roughness.change_time", 0.2);
            fmu.set("geometry.axle_offset.rear", 3.2);
            fmu.initialize().unwrap();
            fmu.set("vehicle.speed", 21.0);
            for _ in 0..100 {
                fmu.step();
            }
            let saved = fmu.instance.snapshot().unwrap();
            let bytes = fmu.instance.serialize(&saved).unwrap();
            let mut other = Fmu::new(folder.path());
            let read = other.instance.deserialize(&bytes).unwrap();
            other.instance.restore(&read).unwrap();
            for _ in 0..1000 {
                assert_eq!(other.step(), fmu.step());
            }
        }
    }
}

#[test]
fn table_comes_from_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("road.csv");
    std::fs::write(&path, TABLE).unwrap();
    let mut fmu = Fmu::new(folder.path());
    fmu.choose("profile", 3).unwrap();
    assert_eq!(fmu.initialize().unwrap_err(), "Road: 'table.file' must be the path of a CSV file, it is empty");
    let mut fmu = Fmu::new(folder.path());
    fmu.choose("profile", 3).unwrap();
    fmu.take_file("no.csv");
    assert!(fmu.initialize().unwrap_err().starts_with("Road: 'table.file' = no.csv: "));
    fmu.take_file("road.csv");
    fmu.instance.exit_initialization().unwrap();
    fmu.set("vehicle.speed", 5000.0);
    fmu.step();
    fmu.step();
    assert_eq!([fmu.get("road_height.l"), fmu.get("road_height.r"), fmu.get("road.distance")], [0.05, 0.1, 5.0]);

    // a saved state requires the same file content
    let saved = fmu.instance.snapshot().unwrap();
    let bytes = fmu.instance.serialize(&saved).unwrap();
    assert!(fmu.instance.deserialize(&bytes).is_ok());
    std::fs::write(&path, TABLE.replace("0.1", "0.3")).unwrap();
    assert!(fmu.instance.deserialize(&bytes).is_err());
    std::fs::write(&path, "distance,height\n").unwrap();
    let mut fmu = Fmu::new(Path::new(""));
    fmu.choose("profile", 3).unwrap();
    fmu.take_file(path.to_str().unwrap());
    let message = fmu.initialize().unwrap_err();
    assert!(
        message.starts_with("Road: 'table.file': ") && message.contains(":1: the name of column 2 is unknown"),
        "{message}"
    );
}

/// A speed for which no road can be generated fails the step, with a message that names the input.
#[test]
fn an_impossible_speed_fails_the_step() {
    let mut fmu = Fmu::new(Path::new(""));
    fmu.initialize().unwrap();
    fmu.set("vehicle.speed", 1e9);
    let Err(fmu::testing::instance::CallError::Error(message)) = fmu.instance.do_step(0.0, 0.001) else {
        panic!("the step was taken")
    };
    assert!(message.starts_with("fmi2DoStep: 'vehicle.speed' = 1000000000 m/s"), "{message}");
}
