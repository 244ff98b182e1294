//! The quarter car from `examples/quarter-car`. The integration scheme is part of the model.

#![allow(unexpected_cfgs)]

use fmi::fmi3::Fmi3Error;
use fmi_export::FmuModel;
use fmi_export::fmi3::{CSDoStepResult, Context, DefaultLoggingCategory, UserModel};

/// Step of the Runge-Kutta method (s).
const STEP: f64 = 1e-3;

/// Quarter car: body, suspension with an actuator, wheel, tire
#[derive(FmuModel, Default, Debug)]
#[model(model_exchange = false, co_simulation = true, user_model = false)]
struct QuarterCar {
    /// Height of the road (m)
    #[variable(causality = Input, variability = Continuous, start = 0.0)]
    z_r: f64,
    /// Force of the actuator, up on the body and down on the wheel (N)
    #[variable(causality = Input, variability = Continuous, start = 0.0)]
    f_a: f64,
    /// Height of the body (m)
    #[variable(causality = Output, variability = Continuous, start = 0.0, initial = Exact)]
    z_s: f64,
    /// Velocity of the body (m/s)
    #[variable(causality = Output, variability = Continuous, start = 0.0, initial = Exact)]
    v_s: f64,
    /// Height of the wheel (m)
    #[variable(causality = Output, variability = Continuous, start = 0.0, initial = Exact)]
    z_u: f64,
    /// Velocity of the wheel (m/s)
    #[variable(causality = Output, variability = Continuous, start = 0.0, initial = Exact)]
    v_u: f64,
    /// Acceleration of the body (m/s2)
    #[variable(causality = Output, variability = Continuous, initial = Calculated)]
    a_s: f64,
}

impl QuarterCar {
    fn derivatives(&self, [z_s, v_s, z_u, v_u]: [f64; 4]) -> [f64; 4] {
        let f = 20_000.0 * (z_s - z_u) + 1_500.0 * (v_s - v_u) - self.f_a;
        [v_s, -f / 400.0, v_u, (f - 180_000.0 * (z_u - self.z_r)) / 40.0]
    }
}

impl UserModel for QuarterCar {
    type LoggingCategory = DefaultLoggingCategory;

    fn do_step(
        &mut self,
        context: &mut dyn Context<Self>,
        time: f64,
        step: f64,
        _: bool,
    ) -> Result<CSDoStepResult, Fmi3Error> {
        let mut x = [self.z_s, self.v_s, self.z_u, self.v_u];
        for _ in 0..(step / STEP).round() as usize {
            let along = |k: [f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
            let k1 = self.derivatives(x);
            let k2 = self.derivatives(along(k1, 0.5 * STEP));
            let k3 = self.derivatives(along(k2, 0.5 * STEP));
            let k4 = self.derivatives(along(k3, STEP));
            x = std::array::from_fn(|i| x[i] + STEP / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        }
        [self.z_s, self.v_s, self.z_u, self.v_u] = x;
        self.a_s = self.derivatives(x)[1];
        context.set_time(time + step);
        Ok(CSDoStepResult::completed(time + step))
    }
}

fmi_export::export_fmu!(QuarterCar);
