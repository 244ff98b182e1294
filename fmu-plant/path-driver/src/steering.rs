//! Steering: along a path by looking ahead, or by time.
//!
//! | symbol | meaning |
//! |---|---|
//! | t, T, n | time since the start, sample time, number of the sample |
//! | v | speed, not negative |
//! | e, psi_e, s | deviation, heading error and station of the vehicle on the path |
//! | T_p, L_p | time and distance that the driver looks ahead |
//! | L, K, M | wheelbase, understeer gradient, steering angle per curvature |
//! | g, g_ff | factors on the steering angle against the deviation ahead and for the curvature |
//! | kappa | curvature of the path |
//! | k_i, I | rate of the integral of the deviation, and the integral |
//! | T_ff, T_d, T_r | delay of the vehicle; delay and time constant of the driver |
//! | A, omega, tau | amplitude and rate of the steering wheel, time since the start of a phase |

use fmu::math;
use fmu::prelude::*;
use fmu::{StateField, Word, Words};

use crate::path::Place;
use crate::{D, Maneuver, PathDriver, X};

/// Tolerance for rounding in the time of a sample, s.
pub(crate) const SLACK: f64 = 1e-9;

/// Greatest delay in samples.
const MOST_SAMPLES: f64 = 10_000.0;

/// Speed in m/s below which the integral of the deviation is held.
const INTEGRAL_SPEED: f64 = 0.5;

/// Phases of the fishhook.
#[derive(Enumeration, Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd)]
pub(crate) enum Phase {
    /// straight ahead
    #[default]
    Wait,
    /// to the one side
    Ramp,
    /// until the roll rate is small
    Dwell,
    /// to the other side
    Reversal,
    /// on the other side
    Hold,
    /// back to straight ahead
    Return,
    /// finished
    End,
}

/// Ring buffer of the steering angles during the delay: sample `n` has the index `n` modulo the length.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Delay(Box<[f64]>);

impl Delay {
    /// Creates a delay of `samples` samples, filled with 0.
    pub(crate) fn of(samples: usize) -> Self {
        Self(vec![0.0; samples].into())
    }

    /// Stores the value of sample `n` and returns the delayed value.
    fn shift(&mut self, n: u64, value: f64) -> f64 {
        if self.0.is_empty() {
            return value;
        }
        let slot = (n % self.0.len() as u64) as usize;
        std::mem::replace(&mut self.0[slot], value)
    }
}

impl StateField for Delay {
    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        self.0.iter().for_each(|value| value.save(sink));
    }
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
        self.0.iter_mut().try_for_each(|value| value.load(name, source))
    }
    fn not_finite(&self) -> Option<f64> {
        self.0.iter().find_map(StateField::not_finite)
    }
}

/// Derived parameters.
#[derive(Clone, Debug)]
pub(crate) struct Steering {
    /// T_d in samples.
    pub(crate) delay_samples: usize,
    /// Fraction of the remaining difference that the lag covers in a sample.
    lag_share: f64,
    /// Greatest angle of the road wheels, rad, and the greatest change of this angle in a sample, rad.
    limit: f64,
    change: f64,
}

impl Steering {
    /// # Errors
    /// If the delay is too long, or a maneuver without a path has no amplitude.
    pub(crate) fn new(p: &PathDriver) -> Result<Self, String> {
        let without_amplitude = match p.maneuver {
            Maneuver::SlowlyIncreasingSteer if p.a == 0.0 => Some("6 (slowly_increasing_steer)"),
            Maneuver::Fishhook if p.a == 0.0 => Some("7 (fishhook)"),
            _ => None,
        };
        if let Some(maneuver) = without_amplitude {
            return Err(format!("'steer.wheel_amplitude' must not be 0 for 'maneuver' = {maneuver}, got 0 rad"));
        }
        let samples = (p.t_d / p.sample_time + 0.5).floor();
        if samples > MOST_SAMPLES {
            return Err(format!(
                "'response.delay' = {} s is {samples} samples of 'sample_time' = {} s; it must be at most {MOST_SAMPLES} \
                 samples: use a shorter delay or a longer sample time",
                p.t_d, p.sample_time
            ));
        }
        Ok(Self {
            delay_samples: samples as usize,
            lag_share: if p.t_r > 0.0 { 1.0 - math::exp(-p.sample_time / p.t_r) } else { 1.0 },
            limit: p.angle_limit / p.ratio,
            change: p.rate_limit / p.ratio * p.sample_time,
        })
    }
}

/// One sample of the steering along a path, maneuvers 0 to 5.
pub(crate) fn follow(p: &PathDriver, d: &D, x: &mut X, place: &Place, v: f64, t: f64) {
    let Place { s, e, psi_e } = *place;
    if !x.lost {
        let m = p.l + p.k * v * v;
        let lead = (p.t_ff + p.t_d + p.t_r.max(0.0)) * v;
        let l_p = p.l_p_min.max(p.t_p * v);
        let ahead = e + l_p * math::sin(psi_e) + x.integral;
        x.raw = m * (p.g_ff * d.path.curvature(s + lead) - p.g * (2.0 / (l_p * l_p)) * ahead);
        if v >= INTEGRAL_SPEED && t < p.hold_start {
            x.integral += p.k_i * e * p.sample_time;
        }
    }
    let delayed = x.past.shift(x.n, x.raw);
    x.lagged = if p.t_r > 0.0 { x.lagged + (delayed - x.lagged) * d.steering.lag_share } else { delayed };
    if !is_held(p, t) {
        let Steering { limit, change, .. } = d.steering;
        x.steer += (x.lagged.clamp(-limit, limit) - x.steer).clamp(-change, change);
    }
}

/// Returns true if the steering angle is held.
fn is_held(p: &PathDriver, t: f64) -> bool {
    t >= p.hold_start - SLACK
}

/// Turns the steering wheel to `angle` in rad, positive toward the side on which the maneuver begins.
fn turn(p: &PathDriver, d: &D, x: &mut X, angle: f64, t: f64) {
    if !is_held(p, t) {
        x.steer = (p.a.signum() * angle / p.ratio).clamp(-d.steering.limit, d.steering.limit);
    }
}

/// One sample of slowly increasing steer, maneuver 6.
pub(crate) fn slowly_increasing(p: &PathDriver, d: &D, x: &mut X, t: f64) {
    let angle = p.omega * (t - p.t_0).max(0.0);
    turn(p, d, x, angle.min(p.a.abs()), t);
    x.finished |= angle >= p.a.abs();
}

/// One sample of the fishhook, maneuver 7.
pub(crate) fn fishhook(p: &PathDriver, d: &D, x: &mut X, roll_rate: f64, t: f64) {
    let a = p.a.abs();
    let mut tau = x.n.wrapping_sub(x.phase_start) as f64 * p.sample_time;
    // A phase can end in the same sample in which it begins.
    loop {
        let (length, next) = match x.phase {
            Phase::Wait => (p.t_0, Phase::Ramp),
            Phase::Ramp => (a / p.omega, Phase::Dwell),
            Phase::Dwell if roll_rate.abs() <= p.roll_rate_threshold => (0.0, Phase::Reversal),
            Phase::Dwell => (p.maximum_dwell, Phase::Reversal),
            Phase::Reversal => (2.0 * a / p.omega, Phase::Hold),
            Phase::Hold => (p.hold_time, Phase::Return),
            Phase::Return => (p.return_time, Phase::End),
            Phase::End => break,
        };
        if tau < length - SLACK {
            break;
        }
        (x.phase, x.phase_start, tau) = (next, x.n, 0.0);
    }
    let angle = match x.phase {
        Phase::Wait | Phase::End => 0.0,
        Phase::Ramp => (p.omega * tau).min(a),
        Phase::Dwell => a,
        Phase::Reversal => a - (p.omega * tau).min(2.0 * a),
        Phase::Hold => -a,
        Phase::Return => -a * (1.0 - tau / p.return_time),
    };
    turn(p, d, x, angle, t);
    x.finished |= x.phase == Phase::End;
}
