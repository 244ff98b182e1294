//! Bouncing ball with the integration scheme of the Reference FMUs: Euler steps of 1 ms, a bounce at the end of a step.

#![allow(unexpected_cfgs)]

use fmi::fmi3::Fmi3Error;
use fmi_export::FmuModel;
use fmi_export::fmi3::{CSDoStepResult, Context, DefaultLoggingCategory, UserModel};

/// Euler step (s).
const STEP: f64 = 1e-3;

/// Bouncing ball that comes to rest
#[derive(FmuModel, Default, Debug)]
#[model(model_exchange = false, co_simulation = true, user_model = false)]
struct BouncingBall {
    /// Height (m)
    #[variable(causality = Output, variability = Continuous, start = 1.0, initial = Exact)]
    h: f64,
    /// Velocity, positive upward (m/s)
    #[variable(causality = Output, variability = Continuous, start = 0.0, initial = Exact)]
    v: f64,
    /// Acceleration of gravity (m/s2)
    #[variable(causality = Parameter, variability = Fixed, start = -9.81, initial = Exact)]
    g: f64,
    /// Coefficient of restitution
    #[variable(causality = Parameter, variability = Fixed, start = 0.7, initial = Exact)]
    e: f64,
    /// Rebound velocity below which the ball comes to rest (m/s)
    #[variable(causality = Parameter, variability = Fixed, start = 0.1, initial = Exact)]
    v_min: f64,
}

impl UserModel for BouncingBall {
    type LoggingCategory = DefaultLoggingCategory;

    fn do_step(
        &mut self,
        context: &mut dyn Context<Self>,
        time: f64,
        step: f64,
        _: bool,
    ) -> Result<CSDoStepResult, Fmi3Error> {
        for _ in 0..(step / STEP).round() as usize {
            self.h += STEP * self.v;
            self.v += STEP * self.g;
            if self.h <= 0.0 && self.v < 0.0 {
                self.h = 0.0;
                self.v *= -self.e;
                if self.v < self.v_min {
                    (self.v, self.g) = (0.0, 0.0);
                }
            }
        }
        context.set_time(time + step);
        Ok(CSDoStepResult::completed(time + step))
    }
}

fmi_export::export_fmu!(BouncingBall);
