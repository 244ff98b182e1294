//! `BrakeAndDriveActuators`: brake pressures and torques at four wheels, pedal pressure, and the drive of the front
//! wheels.
//!
//! Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic stability program on a
//! finite-state basis", eq. 12; the drive is an addition.

#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use chassis_vehicle::data::esp_car as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// The symbols are those of the paper, if it has a symbol for the parameter. All values are assumed.
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
    /// p_loss: pressure lost to springs and friction in the master cylinder
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

/// Pedals, pressure commands and wheel speeds.
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

/// Pascal per megapascal.
const MEGA: f64 = 1e6;

/// Brakes and drive of a car: pedal pressure, lagged wheel pressures, brake torques, drive torque of the front
/// wheels
#[fmu::model(stop_time = 6.0, step_size = 0.001)]
impl Continuous for BrakeAndDriveActuators {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        let (x, u) = (at.state, at.inputs);
        X { p: FourWheels::from_fn(|i| (u.p_cmd[i] - x.p[i]) / self.tau_p) }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        let (x, u) = (at.state, at.inputs);
        let (zero, one) = (T::from(0.0), T::from(1.0));
        let per_pedal = 4.0 * self.f_pedal * self.i_b * self.eta_p * self.boost / (PI * self.d_m * self.d_m) / MEGA;
        let mean_speed = (u.omega[0] + u.omega[1]) * 0.5;
        let torque = Scalar::min(T::from(self.t_max), T::from(self.p_max) / Scalar::max(mean_speed, one));
        let t_d = Scalar::clamp(u.throttle, zero, one) * torque;
        Y {
            p_master: Scalar::max(u.brake * per_pedal - self.p_loss, zero),
            t_b: FourWheels::from_fn(|i| x.p[i] * (self.gain[axle_of(i)] * MEGA)),
            t_d: FourWheels::from_fn(|i| if axle_of(i) == 0 { t_d * 0.5 } else { zero }),
        }
    }
    fn advance(&self, at: At<f64, Self>, step: f64) -> X<f64> {
        let (x, u) = (at.state, at.inputs);
        // The exact solution for held commands.
        let decay = fmu::math::exp(-step / self.tau_p);
        X { p: FourWheels::from_fn(|i| u.p_cmd[i] + (x.p[i] - u.p_cmd[i]) * decay) }
    }
}
