//! `AntilockBraking`: brake pressures that keep the slip of each wheel near a target, by thresholds of slip and wheel
//! acceleration.
//!
//! Made for the car of Xia, Tang, Zhao, "Coordinated control of a semi-active suspension system and an electronic
//! stability program on a finite-state basis"; the paper names its antilock logic without describing it.

mod equations;
#[cfg(test)]
mod tests;

use chassis::data::esp_car as data;
use chassis::prelude::*;
use fmi2::prelude::*;

/// The controller.
pub struct AntilockBraking;

/// Parameters.
#[derive(Parameters, Clone, Debug)]
pub struct P {
    /// Half the width of the band around the target slip (assumed)
    #[par("slip.band", unit = ONE, start = 0.02, min = 0.0, tunable, display = "%")]
    band: f64,
    /// How far ahead the slip is extrapolated; a positive time is a better antilock logic (assumed)
    #[par("slip.lead_time", unit = S, start = 0.0, min = 0.0, tunable, display = "ms")]
    lead: f64,
    /// Rate at which the pressure rises (calibrated on a braking distance of the paper's Table 7)
    #[par("pressure.rise_rate", unit = MPA_PER_S, start = 20.0, min = 0.0, tunable)]
    rate_up: f64,
    /// Rate at which the pressure falls (assumed)
    #[par("pressure.fall_rate", unit = MPA_PER_S, start = 60.0, min = 0.0, tunable)]
    rate_down: f64,
    /// Acceleration of the wheel's circumference from which on the pressure is held instead of lowered (assumed)
    #[par("pressure.hold_acceleration", unit = M_PER_S2, start = 10.0, tunable)]
    reacceleration: f64,
    /// Speed below which the logic is off (assumed)
    #[par("activation.minimum_speed", unit = M_PER_S, start = 1.5, min = 0.0, tunable, display = "km/h")]
    speed_min: f64,
    /// Greatest brake pressure (assumed)
    #[par("pressure.limit", unit = MPA, start = 12.0, min = 0.0, tunable, display = "bar")]
    p_max: f64,
    /// R
    #[par(WHEEL_RADIUS, start = data::RADIUS)]
    radius: f64,
    /// T (assumed)
    #[par(SAMPLE_TIME, start = 0.005)]
    sample_time: f64,
}

/// What is asked for and what is measured.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[signal(ENABLE_ANTILOCK)]
    enable: f64,
    #[signal(TARGET_SLIP)]
    target: FourWheels<f64>,
    #[signal(BRAKE_MASTER_PRESSURE)]
    master: f64,
    #[signal(YAW_CONTROL_PRESSURE)]
    p_dyc: FourWheels<f64>,
    #[signal(VEHICLE_SPEED)]
    u: f64,
    #[signal(WHEEL_SPEED)]
    omega: FourWheels<f64>,
}

/// Pressures, and where they are modulated.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[signal(BRAKE_PRESSURE_COMMAND)]
    cmd: FourWheels<f64>,
    #[signal(ANTILOCK_ACTIVE)]
    active: FourWheels<f64>,
}

/// Last speed and slip of each wheel, whether it is modulated, and the last pressure.
#[derive(Memory, Clone, Debug, Default)]
pub struct X {
    has_past: bool,
    omega: [f64; 4],
    slip: [f64; 4],
    active: [bool; 4],
    cmd: [f64; 4],
}

/// Antilock brakes of a car: pressure of each wheel by thresholds of slip and wheel acceleration around a target slip
#[model(stop_time = 6.0, step_size = 0.001)]
impl Sampled for AntilockBraking {
    type Parameters = P;
    type Memory = X;
    type Inputs = U;
    type Outputs = Y;

    fn update(p: &P, (): &(), x: &mut X, u: &U, _t: f64) -> Y {
        equations::sample(p, x, u)
    }
}

fmi2::export!(sampled AntilockBraking);
