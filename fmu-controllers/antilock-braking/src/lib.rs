//! `AntilockBraking`: brake pressures that keep the slip of each wheel near a target, controlled by thresholds for slip
//! and wheel acceleration.
//!
//! Designed for the car in Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic
//! stability program on a finite-state basis"; the paper mentions an antilock logic without describing it.
//!
//! | symbol | meaning |
//! |---|---|
//! | u, omega | speed of the vehicle, speed of rotation of the wheel |
//! | slip, pred | braking slip (0 rolling, 1 locked), and slip extrapolated by the lead time |
//! | acc | acceleration of the wheel's circumference |
//! | req, cmd | pressure demanded by driver and yaw control, commanded pressure |
//! | T | sample time |

#[cfg(test)]
mod tests;

use chassis_vehicle::data::esp_car as data;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Parameters.
#[derive(Parameters, Clone, Debug)]
pub struct AntilockBraking {
    /// Half the width of the band around the target slip (assumed)
    #[var("slip.band", unit = "1", start = 0.02, min = 0.0, tunable, display = "%")]
    band: f64,
    /// Time by which the slip is extrapolated; a positive value improves the antilock logic (assumed)
    #[var("slip.lead_time", unit = "s", start = 0.0, min = 0.0, tunable, display = "ms")]
    lead: f64,
    /// Rate at which the pressure rises (calibrated to a braking distance in the paper's Table 7)
    #[var("pressure.rise_rate", unit = "MPa/s", start = 20.0, min = 0.0, tunable)]
    rate_up: f64,
    /// Rate at which the pressure falls (assumed)
    #[var("pressure.fall_rate", unit = "MPa/s", start = 60.0, min = 0.0, tunable)]
    rate_down: f64,
    /// Acceleration of the wheel's circumference above which the pressure is held instead of lowered (assumed)
    #[var("pressure.hold_acceleration", unit = "m/s2", start = 10.0, tunable)]
    reacceleration: f64,
    /// Speed below which the logic is off (assumed)
    #[var("activation.minimum_speed", unit = "m/s", start = 1.5, min = 0.0, tunable, display = "km/h")]
    speed_min: f64,
    /// Largest brake pressure (assumed)
    #[var("pressure.limit", unit = "MPa", start = 12.0, min = 0.0, tunable, display = "bar")]
    p_max: f64,
    /// R
    #[var(WHEEL_RADIUS, start = data::RADIUS)]
    radius: f64,
    /// T (assumed)
    #[var(SAMPLE_TIME, start = 0.005)]
    sample_time: f64,
}

/// Demands and measurements.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(ENABLE_ANTILOCK)]
    enable: bool,
    #[var(TARGET_SLIP)]
    target: FourWheels<f64>,
    #[var(BRAKE_MASTER_PRESSURE)]
    master: f64,
    #[var(YAW_CONTROL_PRESSURE)]
    p_dyc: FourWheels<f64>,
    #[var(VEHICLE_SPEED)]
    u: f64,
    #[var(WHEEL_SPEED)]
    omega: FourWheels<f64>,
}

/// Pressures, and whether they are modulated.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(BRAKE_PRESSURE_COMMAND)]
    cmd: FourWheels<f64>,
    #[var(ANTILOCK_ACTIVE)]
    active: FourWheels<bool>,
}

/// Speed, slip and pressure of each wheel at the last sample, and whether the wheel is modulated.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    has_past: bool,
    omega: [f64; 4],
    slip: [f64; 4],
    active: [bool; 4],
    cmd: [f64; 4],
}

/// Lower limit of the speed in the denominator of the slip, m/s.
const LEAST_SPEED: f64 = 0.5;

/// Antilock brakes of a car: pressure of each wheel by thresholds of slip and wheel acceleration around a target slip
#[fmu::model(stop_time = 6.0, step_size = 0.001)]
impl Discrete for AntilockBraking {
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn update(&self, sample: Sample<Self>) -> Y {
        let (x, inputs) = (sample.state, sample.inputs);
        let t = self.sample_time;
        let u = inputs.u;
        let is_on = inputs.enable && u >= self.speed_min;
        for i in 0..4 {
            let omega = inputs.omega[i];
            let req = (inputs.master + inputs.p_dyc[i]).max(0.0).min(self.p_max);
            let slip = (u - self.radius * omega) / u.max(LEAST_SPEED);
            let acc = if x.has_past { self.radius * (omega - x.omega[i]) / t } else { 0.0 };
            let pred = slip + self.lead * (slip - x.slip[i]) / t;
            let is_high = pred > inputs.target[i] + self.band;
            let is_low = pred < inputs.target[i] - self.band;
            x.active[i] = is_on && (x.active[i] || (is_high && req > 0.0));
            if x.active[i] {
                let cmd = if is_high {
                    // The pressure is held while the wheel is already speeding up again.
                    if acc < self.reacceleration { x.cmd[i] - self.rate_down * t } else { x.cmd[i] }
                } else if is_low {
                    x.cmd[i] + self.rate_up * t
                } else {
                    x.cmd[i]
                };
                x.active[i] = cmd < req;
                x.cmd[i] = cmd.min(req).max(0.0);
            } else {
                x.cmd[i] = req;
            }
            (x.omega[i], x.slip[i]) = (omega, slip);
        }
        x.has_past = true;
        Y { cmd: FourWheels(x.cmd), active: FourWheels(x.active) }
    }
}
