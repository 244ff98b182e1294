//! Models that read files.

use std::path::Path;

use fmu::prelude::*;
use fmu::simulation::{ContinuousSimulation, DiscreteSimulation};
use fmu::testing::abi::Export;

fn factor(resources: &Path) -> Result<Factor, String> {
    if resources == Path::new(env!("CARGO_MANIFEST_DIR")).join("resources") {
        return Ok(Factor { factor: 3.0 });
    }
    Err(format!("'{}' does not contain the file", resources.display()))
}

#[derive(Derived)]
struct Factor {
    factor: f64,
}

#[derive(Inputs)]
struct U<T> {
    /// Factor (1)
    #[var(start = 2.0)]
    u: T,
    /// Not used (1)
    other: T,
}

#[derive(Outputs)]
struct Y<T> {
    /// Product (1)
    y: T,
}

#[derive(Parameters)]
struct ContinuousReader;

/// Needs a file
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for ContinuousReader {
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    type Derived = Factor;
    fn load(&self, resources: &Path) -> Result<Factor, String> {
        factor(resources)
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        Y { y: at.inputs.u * at.derived.factor }
    }
}

#[derive(Parameters)]
struct DiscreteReader;

/// Needs a file
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for DiscreteReader {
    type Inputs = U<f64>;
    type Outputs = Y<f64>;
    type Derived = Factor;
    fn load(&self, resources: &Path) -> Result<Factor, String> {
        factor(resources)
    }
    fn update(&self, sample: Sample<Self>) -> Y<f64> {
        Y { y: sample.inputs.u * sample.derived.factor }
    }
}

#[test]
fn a_model_is_described_with_the_resources_of_its_package() {
    let xml = &ContinuousReader::description().xml;
    // Variables: 1 max_step, 2 u, 3 other, 4 y.
    assert!(xml.contains(r#"<Unknown index="4" dependencies="2"/>"#), "{xml}");
}

#[test]
fn a_simulation_reads_the_resources() {
    let elsewhere = Path::new("");
    let error = |folder| ContinuousSimulation::with_resources(ContinuousReader, folder).unwrap_err();
    assert_eq!(error(elsewhere), "'' does not contain the file");
    assert_eq!(ContinuousSimulation::new(ContinuousReader).unwrap().outputs(&U::default()).y, 6.0);
    let error = |folder| DiscreteSimulation::with_resources(DiscreteReader, folder).unwrap_err();
    assert_eq!(error(elsewhere), "'' does not contain the file");
    assert_eq!(DiscreteSimulation::new(DiscreteReader).unwrap().sample(&U::default()).unwrap().y, 6.0);
    // `derived` calls `load`.
    assert_eq!(ContinuousReader.derived().unwrap().factor, 3.0);
}
