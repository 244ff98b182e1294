//! Compares the equations with closed forms, and a run with a written-out integrator.

use approx::assert_relative_eq;
use fmu::simulation::ContinuousSimulation;
use fmu::{At, Continuous as _, Variables as _};
use quarter_car::{QuarterCar, U, X};

const M_S: f64 = 400.0;
const M_U: f64 = 40.0;
const K_S: f64 = 20_000.0;
const C_S: f64 = 1_500.0;
const K_T: f64 = 180_000.0;

fn derivatives(x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
    let (state, inputs) = (&X::from_reals(&x), &U::from_reals(&u));
    let slope = QuarterCar.derivatives(At { time: 0.0, state, inputs, derived: &(), discrete: &() });
    slope.reals().try_into().expect("four states")
}

/// Reference: equilibrium. The actuator extends the suspension by its force divided by the stiffness. The force is
/// internal, so the tire load does not change. The tolerance covers the rounding of forces of 1e4 N that act on 40 kg.
#[test]
fn a_constant_force_extends_the_suspension_but_not_the_tire() {
    let (z_r, f_a) = (0.03, 500.0);
    for slope in derivatives([z_r + f_a / K_S, 0.0, z_r, 0.0], [z_r, f_a]) {
        assert!(slope.abs() < 1e-10, "{slope}");
    }
}

/// Reference: the characteristic polynomial of two masses on springs, s^4 + c(1/m_s + 1/m_u) s^3 + (k_s/m_s + (k_s +
/// k_t)/m_u) s^2 + c k_t/(m_s m_u) s + k_s k_t/(m_s m_u), compared with the characteristic polynomial of the system
/// matrix (from the traces of its powers and Newton's identities). Tolerance: the differences of powers lose 4 of 16
/// digits to rounding.
#[test]
fn the_modes_are_those_of_two_masses_on_springs() {
    let columns: [[f64; 4]; 4] = std::array::from_fn(|j| {
        let mut unit = [0.0; 4];
        unit[j] = 1.0;
        derivatives(unit, [0.0, 0.0])
    });
    let a = nalgebra::Matrix4::from_fn(|i, j| columns[j][i]);
    let (mut power, mut coefficients) = (nalgebra::Matrix4::<f64>::identity(), vec![1.0]);
    for n in 1..=4 {
        power = a * power;
        let coefficient = -power.trace() / f64::from(n);
        coefficients.push(coefficient);
        power += nalgebra::Matrix4::identity() * coefficient;
    }
    let expected = [
        1.0,
        C_S * (1.0 / M_S + 1.0 / M_U),
        K_S / M_S + (K_S + K_T) / M_U,
        C_S * K_T / (M_S * M_U),
        K_S * K_T / (M_S * M_U),
    ];
    for (coefficient, expected) in coefficients.iter().zip(expected) {
        assert_relative_eq!(*coefficient, expected, max_relative = 1e-12);
    }
}

/// Reference: the classical Runge-Kutta method, written out. The results are bit-identical, because the operations and
/// their order are the same.
#[test]
fn a_run_is_the_classical_runge_kutta_method() {
    const STEP: f64 = 0.001;
    let mut run = ContinuousSimulation::new(QuarterCar).expect("it starts");
    let mut x = [0.0; 4];
    for k in 0..2000 {
        let time = f64::from(k) * STEP;
        let u = [0.05 * (20.0 * time).sin(), 100.0 * (50.0 * time).sin()];
        run.step(&U::from_reals(&u), STEP).expect("a step");
        let along = |k: [f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
        let k1 = derivatives(x, u);
        let k2 = derivatives(along(k1, 0.5 * STEP), u);
        let k3 = derivatives(along(k2, 0.5 * STEP), u);
        let k4 = derivatives(along(k3, STEP), u);
        x = std::array::from_fn(|i| x[i] + STEP / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        let found: [f64; 4] = run.state().reals().try_into().expect("four states");
        let acceleration = run.outputs(&U::from_reals(&u)).a_s;
        assert_eq!(found.map(f64::to_bits), x.map(f64::to_bits), "at {time} s");
        assert_eq!(acceleration.to_bits(), derivatives(x, u)[1].to_bits(), "at {time} s");
    }
}
