//! `DcMotorDrive`: a motor and its controller in one FMU. The README has the signal flow.

use std::path::Path;

use dc_motor::DcMotor;
use dc_motor_controller::DcMotorController;
use fmu::prelude::*;
use fmu::simulation::{ContinuousSimulation, DiscreteSimulation};

/// Parameters of both parts; their names start with `motor` and `controller`.
#[derive(Parameters)]
pub struct DcMotorDrive {
    /// Parameters of the motor.
    #[var(nested)]
    pub motor: DcMotor,
    /// Parameters of the controller.
    #[var(nested)]
    pub controller: DcMotorController,
}

/// Inputs.
#[derive(Inputs)]
pub struct U {
    /// Reference speed (rad/s)
    #[var(start = 100.0)]
    pub reference_speed: f64,
    /// Torque of the load, against a positive speed (N.m)
    pub load_torque: f64,
    /// Whether the controller is on
    #[var(start = true)]
    pub enabled: bool,
}

/// Outputs.
#[derive(Outputs)]
pub struct Y {
    /// Speed of the rotor (rad/s)
    pub speed: f64,
    /// Current in the armature (A)
    pub current: f64,
    /// Voltage of the armature (V)
    pub voltage: f64,
    /// Whether the voltage is at its limit
    pub saturated: bool,
}

/// The two parts, and the values held between samples.
#[derive(Clone)]
pub struct Drive {
    motor: ContinuousSimulation<DcMotor>,
    controller: DiscreteSimulation<DcMotorController>,
    command: dc_motor_controller::Y,
    next_sample: f64,
}

/// DC motor with PI control of its speed
#[fmu::model(stop_time = 2.0, step_size = 0.01)]
impl Stateful for DcMotorDrive {
    type Inputs = U;
    type Outputs = Y;
    type Simulation = Drive;

    fn start(&self, _resources: &Path) -> Result<Drive, String> {
        Ok(Drive {
            motor: ContinuousSimulation::new(self.motor.clone())?,
            controller: DiscreteSimulation::new(self.controller.clone())?,
            command: dc_motor_controller::Y::default(),
            next_sample: 0.0,
        })
    }

    fn step(&self, drive: &mut Drive, inputs: &U, _time: f64, step: f64) -> Result<(), String> {
        let &U { reference_speed, load_torque, enabled } = inputs;
        let sample_time = drive.controller.sample_time();
        // Times that differ only by rounding are treated as equal.
        let rounding = 1e-6 * sample_time;
        let end = drive.motor.time() + step;
        while drive.motor.time() < end - rounding {
            if drive.motor.time() > drive.next_sample - rounding {
                let speed = drive.motor.state().speed;
                let measured = dc_motor_controller::U { reference_speed, speed, enabled };
                drive.command = drive.controller.sample(&measured)?;
                drive.next_sample += sample_time;
            }
            let part = drive.next_sample.min(end) - drive.motor.time();
            drive.motor.step(&dc_motor::U { voltage: drive.command.voltage, load_torque }, part)?;
        }
        Ok(())
    }

    fn outputs(&self, drive: &Drive) -> Y {
        let state = drive.motor.state();
        let &dc_motor_controller::Y { voltage, saturated } = &drive.command;
        Y { speed: state.speed, current: state.current, voltage, saturated }
    }
}
