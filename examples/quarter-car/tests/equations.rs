//! The equations against what is known of a quarter car in closed form, a run against the integrator written out.

use std::path::PathBuf;
use std::sync::Arc;

use approx::assert_relative_eq;
use fmi2::abi::Export;
use fmi2::instance::Instance;
use fmi2::parameters::MaxStep;
use fmi2::{Block, Plant};
use quarter_car::{QuarterCar, U, X};

const M_S: f64 = 400.0;
const M_U: f64 = 40.0;
const K_S: f64 = 20_000.0;
const C_S: f64 = 1_500.0;
const K_T: f64 = 180_000.0;

fn derivatives(x: [f64; 4], u: [f64; 2]) -> [f64; 4] {
    let mut values = [0.0; 4];
    let slope: X<f64> = QuarterCar::derivatives(&MaxStep::default(), &(), &X::read(&x), &U::read(&u));
    slope.write(&mut values);
    values
}

/// Reference: equilibrium. The actuator opens the suspension by its force over the stiffness; its force is inside the
/// car, so the tire carries what it did before. Tolerance: rounding of numbers of 1e4 N over 40 kg.
#[test]
fn a_constant_force_opens_the_suspension_and_leaves_the_tire() {
    let (z_r, f_a) = (0.03, 500.0);
    for slope in derivatives([z_r + f_a / K_S, 0.0, z_r, 0.0], [z_r, f_a]) {
        assert!(slope.abs() < 1e-10, "{slope}");
    }
}

/// Reference: the characteristic polynomial of two masses on springs,
/// s^4 + c(1/m_s + 1/m_u) s^3 + (k_s/m_s + (k_s + k_t)/m_u) s^2 + c k_t/(m_s m_u) s + k_s k_t/(m_s m_u),
/// against that of the system matrix (traces of its powers, Newton's identities). Tolerance: rounding, 4 digits of the
/// 16 lost in the differences of powers.
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

/// Reference: the classical Runge-Kutta method written out. Bit-equal: the operations and their order are the same.
#[test]
fn a_run_is_the_classical_runge_kutta_method() {
    const STEP: f64 = 0.001;
    let description = <QuarterCar as Export>::description();
    let reference = |name: &str| {
        let variables = &description.layout.variables;
        variables.iter().find(|variable| variable.declaration.name == name).expect("a variable of the model").reference
    };
    let (inputs, states) = (["z_r", "f_a"].map(reference), ["z_s", "v_s", "z_u", "v_u"].map(reference));
    let acceleration = [reference("a_s")];
    let mut instance = Instance::<<QuarterCar as Export>::Model>::new(Arc::clone(&description), PathBuf::new());
    instance.setup_experiment(0.0, None).expect("it starts");
    instance.enter_initialization().expect("it starts");
    instance.exit_initialization().expect("it starts");
    let mut x = [0.0; 4];
    for k in 0..2000 {
        let time = f64::from(k) * STEP;
        let u = [0.05 * (20.0 * time).sin(), 100.0 * (50.0 * time).sin()];
        instance.set_real(&inputs, &u).expect("finite inputs");
        instance.do_step(time, STEP).expect("a step");
        let along = |k: [f64; 4], h: f64| std::array::from_fn(|i| x[i] + h * k[i]);
        let k1 = derivatives(x, u);
        let k2 = derivatives(along(k1, 0.5 * STEP), u);
        let k3 = derivatives(along(k2, 0.5 * STEP), u);
        let k4 = derivatives(along(k3, STEP), u);
        x = std::array::from_fn(|i| x[i] + STEP / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
        let (mut found, mut found_acceleration) = ([0.0; 4], [0.0]);
        instance.get_real(&states, &mut found).expect("the states");
        instance.get_real(&acceleration, &mut found_acceleration).expect("the output");
        assert_eq!(found.map(f64::to_bits), x.map(f64::to_bits), "at {time} s");
        assert_eq!(found_acceleration[0].to_bits(), derivatives(x, u)[1].to_bits(), "at {time} s");
    }
}
