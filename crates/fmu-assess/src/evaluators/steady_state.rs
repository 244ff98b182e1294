//! Gradients over lateral acceleration, for both steady-state cornering maneuvers.

use crate::metric::{Reason, Results};
use crate::numerics::{Line, Rows, lowpass};
use crate::options::{Fallback, Form, OptionRule};

pub(super) const WHEELBASE: OptionRule = OptionRule::new("geometry.wheelbase", "m", Form::Positive, Fallback::Required)
    .is("wheelbase; for more than two axles, the equivalent wheelbase");

/// Steady-state cornering in the chosen rows. Signals are positive in the direction of the turn.
pub(super) struct Cornering<'a> {
    rows: &'a Rows<'a>,
    chosen: Vec<usize>,
    sign: f64,
    /// Road-wheel angle, filtered, rad.
    pub(super) steer: Vec<f64>,
    yaw_rate: Vec<f64>,
    /// Lateral acceleration, filtered, m/s2.
    pub(super) lateral_acceleration: Vec<f64>,
}

impl<'a> Cornering<'a> {
    /// Filters the signals in the chosen rows. `steer` is the cutoff frequency for the steering angle, `motion` for yaw
    /// rate and lateral acceleration, Hz.
    pub(super) fn new(
        rows: &'a Rows<'a>,
        chosen: Vec<usize>,
        sign: f64,
        [steer, motion]: [f64; 2],
    ) -> Result<Self, Reason> {
        let filtered = |name, cutoff| {
            let values = turned(rows, &chosen, sign, name)?;
            lowpass(&values, cutoff, rows.rate)
        };
        Ok(Self {
            steer: filtered("driver.steer", steer)?,
            yaw_rate: filtered("vehicle.yaw_rate", motion)?,
            lateral_acceleration: filtered("vehicle.lateral_acceleration", motion)?,
            rows,
            chosen,
            sign,
        })
    }

    /// Sets the gradients over the lateral acceleration in a window, given as indices into the chosen rows.
    pub(super) fn set_gradients(&self, window: &Result<Vec<usize>, Reason>, wheelbase: f64, results: &mut Results) {
        let gradient = |signal: Result<Vec<f64>, Reason>| {
            let window = window.as_ref().map_err(Clone::clone)?;
            let signal = signal?;
            let x: Vec<f64> = window.iter().map(|index| self.lateral_acceleration[*index]).collect();
            let y: Vec<f64> = window.iter().map(|index| signal[*index]).collect();
            let line = Line::fit(&x, &y);
            line.map(|line| line.slope)
                .ok_or_else(|| "the lateral acceleration does not change in the window".to_owned())
        };
        let unfiltered = |name| turned(self.rows, &self.chosen, self.sign, name);
        results.set("understeer_gradient", gradient(self.dynamic_steer(wheelbase)));
        results.set("sideslip_gradient", gradient(unfiltered("vehicle.sideslip")));
        results.set("roll_gradient", gradient(unfiltered("body.roll")));
        results.set("load_transfer_gradient", gradient(unfiltered("vehicle.load_transfer_ratio")));
    }

    /// Steering angle minus the Ackermann angle, rad.
    fn dynamic_steer(&self, wheelbase: f64) -> Result<Vec<f64>, Reason> {
        let speed = self.rows.column("vehicle.speed")?;
        let ackermann =
            self.chosen.iter().zip(&self.yaw_rate).map(|(row, yaw_rate)| wheelbase * yaw_rate / speed[*row]);
        Ok(self.steer.iter().zip(ackermann).map(|(steer, ackermann)| steer - ackermann).collect())
    }
}

/// A signal in the chosen rows, positive in the direction of the turn.
fn turned(rows: &Rows<'_>, chosen: &[usize], sign: f64, name: &str) -> Result<Vec<f64>, Reason> {
    let values = rows.column(name)?;
    Ok(chosen.iter().map(|row| sign * values[*row]).collect())
}
