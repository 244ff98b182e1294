//! `SuspensionSwitch`: switches between the comfort and the handling law, depending on the estimated load transfer
//! ratio.
//!
//! Applied Sciences 2020, 10, 1852, eq. 8; hysteresis, blending and the use of the magnitude are additions.
//!
//! | symbol | meaning |
//! |---|---|
//! | LTR, Q | load transfer ratio (estimate), its threshold |
//! | f_c, f_h | forces that the comfort and the handling law propose |
//! | w | share of the handling law |
//! | h | sample time |

#[cfg(test)]
mod tests;

use chassis_control::limit;
use chassis_control::switch::hysteresis;
use chassis_vehicle::prelude::*;
use fmu::prelude::*;

/// Control case.
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// comfort law, handling law above the threshold
    Switched = 0,
    /// comfort law alone
    Comfort = 1,
    /// handling law alone
    Handling = 2,
    /// no force; the mode is still shown
    Passive = 3,
}

/// Symbols as in the paper.
#[derive(Parameters, Clone, Debug)]
pub struct SuspensionSwitch {
    /// Q: load transfer ratio above which the handling law acts (paper)
    #[var("threshold.load_transfer", unit = "1", start = 0.8, tunable)]
    q: f64,
    /// Distance below the threshold at which the comfort law returns; 0 as in the paper, 0.1 is recommended to prevent
    /// repeated switching
    #[var("threshold.hysteresis", unit = "1", start = 0.0, min = 0.0, tunable)]
    width: f64,
    /// Use the magnitude of the ratio, which also protects right turns; if false, use the signed ratio as in the paper
    #[var("threshold.magnitude", start = false)]
    magnitude: bool,
    /// Time in which one law fades into the other; 0 as in the paper, 0.3 s is recommended to prevent jumps of the
    /// force
    #[var("blend.time", unit = "s", start = 0.0, min = 0.0, tunable)]
    blend_time: f64,
    /// Control case
    #[var("strategy", start = Strategy::Switched)]
    strategy: Strategy,
    /// h, assumed
    #[var(SAMPLE_TIME, start = 0.001)]
    sample_time: f64,
}

/// The load transfer, and the forces of the two laws.
#[derive(Inputs, Clone, Debug)]
pub struct U {
    #[var(VEHICLE_LOAD_TRANSFER_ESTIMATE)]
    ltr: f64,
    #[var(COMFORT_FORCE)]
    f_c: Sides<f64>,
    #[var(HANDLING_FORCE)]
    f_h: Sides<f64>,
}

/// The force of the active law, and which law is active.
#[derive(Outputs, Clone, Debug)]
pub struct Y {
    #[var(SUSPENSION_FORCE)]
    f: Sides<f64>,
    #[var(SWITCH_MODE)]
    mode: i32,
    #[var(SWITCH_BLEND)]
    w: f64,
}

/// True while the handling law is active, and its share.
#[derive(DiscreteState, Clone, Debug, Default)]
pub struct X {
    handling: bool,
    w: f64,
}

/// Switches the suspension of a half car between the comfort and the handling law by the load transfer ratio
#[fmu::model(stop_time = 10.0, step_size = 0.001)]
impl Discrete for SuspensionSwitch {
    type State = X;
    type Inputs = U;
    type Outputs = Y;

    fn update(&self, sample: Sample<Self>) -> Y {
        let (x, u) = (sample.state, sample.inputs);
        let ltr = if self.magnitude { u.ltr.abs() } else { u.ltr };
        x.handling = match self.strategy {
            Strategy::Switched | Strategy::Passive => hysteresis(x.handling, ltr, self.q, self.width),
            Strategy::Comfort => false,
            Strategy::Handling => true,
        };
        let mode = if x.handling { 1.0 } else { 0.0 };
        x.w =
            if self.blend_time > 0.0 { limit::rate(mode, x.w, 1.0 / self.blend_time, self.sample_time) } else { mode };
        let w = x.w;
        let f = match self.strategy {
            Strategy::Passive => Sides([0.0; 2]),
            _ => Sides::from_fn(|i| (1.0 - w) * u.f_c[i] + w * u.f_h[i]),
        };
        Y { f, mode: i32::from(x.handling), w }
    }
}
