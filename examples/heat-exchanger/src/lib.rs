//! `HeatExchanger`: two flows in 200 cells each. The README has the equations.

use std::array::from_fn;

use fmu::prelude::*;

/// Cells of each flow.
pub const CELLS: usize = 200;

/// Parameters.
#[derive(Parameters)]
pub struct HeatExchanger {
    /// Product of heat transfer coefficient and area (W/K)
    #[var(start = 4000.0, min = 0.0)]
    pub conductance: f64,
    /// Specific heat capacity of both fluids (J/(kg.K))
    #[var(start = 4180.0, positive)]
    pub heat_capacity: f64,
    /// Mass of each fluid in the exchanger (kg)
    #[var(start = 10.0, positive)]
    pub mass: f64,
    /// Whether both fluids flow in the same direction; otherwise in opposite directions
    #[var(start = false)]
    pub parallel: bool,
}

/// Inputs.
#[derive(Inputs)]
pub struct U<T> {
    /// Temperature of the hot fluid at its inlet (degC)
    #[var(start = 80.0)]
    pub hot_inlet: T,
    /// Temperature of the cold fluid at its inlet (degC)
    #[var(start = 20.0)]
    pub cold_inlet: T,
    /// Mass flow rate of the hot fluid (kg/s)
    #[var(start = 0.5)]
    pub hot_flow: T,
    /// Mass flow rate of the cold fluid (kg/s)
    #[var(start = 0.8)]
    pub cold_flow: T,
}

/// Temperatures of the cells, each in the direction of its flow.
#[derive(State)]
pub struct X<T> {
    /// Temperature of the hot fluid (degC)
    #[var(start = 20.0, nominal = 50.0, local)]
    pub hot: [T; CELLS],
    /// Temperature of the cold fluid (degC)
    #[var(start = 20.0, nominal = 50.0, local)]
    pub cold: [T; CELLS],
}

/// Outputs that are not states.
#[derive(Outputs)]
pub struct Y<T> {
    /// Temperature of the hot fluid at its outlet (degC)
    pub hot_outlet: T,
    /// Temperature of the cold fluid at its outlet (degC)
    pub cold_outlet: T,
    /// Heat flow rate between the fluids (W)
    pub heat_flow: T,
}

/// Heat exchanger with parallel flow or counterflow
#[fmu::model(stop_time = 300.0, step_size = 1.0, solver = DormandPrince { tolerance: 1e-6 })]
impl Continuous for HeatExchanger {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn evaluate<T: Scalar>(&self, at: At<T, Self>) -> (X<T>, Y<T>) {
        let (x, u, n) = (at.state, at.inputs, CELLS as f64);
        // Index of the other fluid's cell across the wall.
        let across = |i: usize| if self.parallel { i } else { CELLS - 1 - i };
        // Heat flow rate into cell i of the cold fluid.
        let heat: [T; CELLS] = from_fn(|i| (x.hot[across(i)] - x.cold[i]) * (self.conductance / n));
        let capacity = self.mass * self.heat_capacity / n;
        let flow = |rate: T, inlet: T, cells: &[T; CELLS], i: usize| {
            rate * self.heat_capacity * (if i == 0 { inlet } else { cells[i - 1] } - cells[i])
        };
        let derivatives = X {
            hot: from_fn(|i| (flow(u.hot_flow, u.hot_inlet, &x.hot, i) - heat[across(i)]) / capacity),
            cold: from_fn(|i| (flow(u.cold_flow, u.cold_inlet, &x.cold, i) + heat[i]) / capacity),
        };
        let outputs =
            Y { hot_outlet: x.hot[CELLS - 1], cold_outlet: x.cold[CELLS - 1], heat_flow: heat.into_iter().sum() };
        (derivatives, outputs)
    }
}
