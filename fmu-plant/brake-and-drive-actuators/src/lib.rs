//! `BrakeAndDriveActuators`: brake pressures and torques of four wheels, pressure of the driver's pedal, and the drive of
//! the front wheels.
//!
//! Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic stability program on a
//! finite-state basis", eq. 12; the drive is an addition.

mod equations;
#[cfg(test)]
mod tests;

use chassis_vehicle::data::esp_car as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Symbols as in the paper, where it has one. All values are assumed: a full pedal locks the front wheels, then the rear
/// ones.
#[derive(Parameters, Clone, Debug)]
pub struct BrakeAndDriveActuators {
    /// F_pedal: force of the driver's foot on the fully pressed brake pedal
    #[var("brake.maximum_pedal_force", unit = "N", start = 300.0, min = 0.0)]
    f_pedal: f64,
    /// i_b: lever ratio of the brake pedal
    #[var("brake.pedal_ratio", unit = "1", start = 4.0, min = 0.0)]
    i_b: f64,
    /// eta_p: efficiency of the brake pedal
    #[var("brake.efficiency", unit = "1", start = 0.85, min = 0.0, max = 1.0)]
    eta_p: f64,
    /// B: force ratio of the brake booster
    #[var("brake.booster_ratio", unit = "1", start = 4.0, min = 0.0)]
    boost: f64,
    /// D_m: diameter of the master cylinder
    #[var("brake.master_cylinder_diameter", unit = "m", start = 0.0222, positive, display = "mm")]
    d_m: f64,
    /// p_loss: pressure that springs and friction of the master cylinder take
    #[var("brake.pressure_loss", unit = "MPa", start = 0.1, min = 0.0, display = "bar")]
    p_loss: f64,
    /// A_wc eta B_F R_b: pistons, efficiency, brake factor and effective radius
    #[var(BRAKE_GAIN, start = data::BRAKE_GAIN)]
    gain: TwoAxles<f64>,
    /// tau_p: first-order lag of the wheel pressures
    #[var("brake.time_constant", unit = "s", start = 0.015, positive, display = "ms")]
    tau_p: f64,
    /// T_max: greatest drive torque of both front wheels together
    #[var("drive.maximum_torque", unit = "N.m", start = 1100.0, min = 0.0, display = "kN.m")]
    t_max: f64,
    /// P_max: greatest drive power
    #[var("drive.maximum_power", unit = "W", start = 75_000.0, min = 0.0, display = "kW")]
    p_max: f64,
}

/// Pedals, pressure commands and the wheels that are driven.
#[derive(Inputs, Clone, Debug)]
pub struct U<T> {
    #[var(DRIVER_THROTTLE)]
    throttle: T,
    #[var(DRIVER_BRAKE)]
    brake: T,
    #[var(BRAKE_PRESSURE_COMMAND)]
    p_cmd: FourWheels<T>,
    #[var(WHEEL_SPEED)]
    omega: FourWheels<T>,
}

/// State: wheel pressures.
#[derive(State, Clone, Debug)]
pub struct X<T> {
    #[var(BRAKE_PRESSURE)]
    p: FourWheels<T>,
}

/// Outputs that are not states.
#[derive(Outputs, Clone, Debug)]
pub struct Y<T> {
    #[var(BRAKE_MASTER_PRESSURE)]
    p_master: T,
    #[var(BRAKE_TORQUE)]
    t_b: FourWheels<T>,
    #[var(DRIVE_TORQUE)]
    t_d: FourWheels<T>,
}

/// Brakes and drive of a car: pressure of the pedal, lagged wheel pressures, brake torques, drive torque of the front
/// wheels
#[fmu::model(stop_time = 6.0, step_size = 0.001)]
impl Continuous for BrakeAndDriveActuators {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        equations::derivatives(self, at.state, at.inputs)
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        equations::outputs(self, at.state, at.inputs)
    }
    fn advance(&self, at: At<f64, Self>, step: f64) -> X<f64> {
        equations::advance(self, at.state, at.inputs, step)
    }
}
