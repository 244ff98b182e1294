//! `PanickingController`: a controller with a deliberate bug, to test how importers handle a panic.

use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Parameters: only the sample time.
#[derive(Parameters, Clone, Debug)]
pub struct PanickingController {
    #[var(SAMPLE_TIME, start = 0.01)]
    sample_time: f64,
}

/// Inputs.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(VEHICLE_YAW_RATE)]
    yaw_rate: f64,
}

/// Outputs.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(SUSPENSION_FORCE)]
    force: FourWheels<f64>,
}

/// Panics after 0.5 s
#[fmu::model(stop_time = 1.0, step_size = 0.01)]
impl Discrete for PanickingController {
    type Inputs = U;
    type Outputs = Y;

    fn update(&self, sample: Sample<Self>) -> Y {
        let wheels = [sample.inputs.yaw_rate; 4];
        let wheel = if sample.time < 0.5 { 0 } else { wheels.len() };
        Y { force: FourWheels::from_fn(|_| 0.0 * wheels[wheel]) }
    }
}
