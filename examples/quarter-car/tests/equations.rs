//! The equations against what is known of a quarter car in closed form.

use approx::assert_relative_eq;
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
