//! Compares the steady state with closed forms.

use fmu::simulation::ContinuousSimulation;
use heat_exchanger::{CELLS, HeatExchanger, U, Y};

/// Outputs in the steady state: the fluids are replaced every 20 s and 12.5 s, so the initial temperatures have no
/// effect after 600 s.
fn steady(model: HeatExchanger) -> Y<f64> {
    let mut run = ContinuousSimulation::new(model).expect("it starts");
    for _ in 0..60 {
        run.step(&U::default(), 10.0).expect("a step");
    }
    run.outputs(&U::default())
}

/// Heat flow rate of a continuous heat exchanger from its effectiveness and number of transfer units (Incropera et al.,
/// "Fundamentals of Heat and Mass Transfer", section 11.4).
fn by_transfer_units(model: &HeatExchanger, u: &U<f64>) -> f64 {
    let [hot, cold] = [u.hot_flow, u.cold_flow].map(|flow| flow * model.heat_capacity);
    let (least, greatest) = (hot.min(cold), hot.max(cold));
    let (units, ratio) = (model.conductance / least, least / greatest);
    let effectiveness = if model.parallel {
        (1.0 - (-units * (1.0 + ratio)).exp()) / (1.0 + ratio)
    } else {
        let part = (-units * (1.0 - ratio)).exp();
        (1.0 - part) / (1.0 - ratio * part)
    };
    effectiveness * least * (u.hot_inlet - u.cold_inlet)
}

/// Heat flow rate of the cells: from cell to cell, the temperature difference changes by a factor of (1 + a_c) / (1 +
/// a_h) in counterflow and 1 / (1 + a_c + a_h) in parallel flow, with a = conductance / (cells * flow * heat capacity).
fn by_cells(model: &HeatExchanger, u: &U<f64>) -> f64 {
    let n = CELLS as f64;
    let [hot, cold] = [u.hot_flow, u.cold_flow].map(|flow| model.conductance / (n * flow * model.heat_capacity));
    let inlets = u.hot_inlet - u.cold_inlet;
    let differences = if model.parallel {
        let factor = 1.0 / (1.0 + cold + hot);
        (1..=CELLS).map(|i| inlets * factor.powi(i as i32)).sum::<f64>()
    } else {
        let factor = (1.0 + cold) / (1.0 + hot);
        let sum: f64 = (0..CELLS).map(|i| factor.powi(i as i32)).sum();
        sum * inlets / (factor.powi(CELLS as i32 - 1) * (1.0 + cold) + hot * sum)
    };
    model.conductance / n * differences
}

/// The tolerance for the closed form of the cells is ten times the solver's tolerance of 1e-6, because the errors of
/// the steps add up. The tolerance for the closed form with transfer units is the first-order error of the cells, about
/// half of the transfer units per cell, 2 / 400.
#[test]
fn heat_flow_and_outlets_match_the_closed_forms() {
    for parallel in [false, true] {
        let model = || HeatExchanger { parallel, ..HeatExchanger::default() };
        let (y, u) = (steady(model()), U::<f64>::default());
        let expected = by_cells(&model(), &u);
        assert!(
            (y.heat_flow / expected - 1.0).abs() < 1e-5,
            "parallel {parallel}: {} W, not {expected} W",
            y.heat_flow
        );
        let expected = by_transfer_units(&model(), &u);
        assert!(
            (y.heat_flow / expected - 1.0).abs() < 5e-3,
            "parallel {parallel}: {} W, not {expected} W",
            y.heat_flow
        );
        // Both fluids carry this heat. The tolerance is 1e-5 of the difference between the inlet temperatures.
        let [hot, cold] = [u.hot_flow, u.cold_flow].map(|flow| y.heat_flow / (flow * model().heat_capacity));
        assert!((u.hot_inlet - y.hot_outlet - hot).abs() < 6e-4);
        assert!((y.cold_outlet - u.cold_inlet - cold).abs() < 6e-4);
    }
}

#[test]
fn counterflow_transfers_more_than_parallel_flow() {
    let [counter, parallel] =
        [false, true].map(|parallel| steady(HeatExchanger { parallel, ..HeatExchanger::default() }).heat_flow);
    assert!(counter > 1.1 * parallel, "{counter} W and {parallel} W");
}
