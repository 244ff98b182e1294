//! The design model, M Xd = N X + R U + Q W, where W = S X are the forces of springs, dampers and tires (Appendix A of
//! the paper, rederived from the equations of motion).
//!
//! X = [Z, theta, phi, z_w (6), their rates (9), beta, r]; W = [F_s (6), F_t (6), F_y (6)].

use chassis_vehicle::positions::axle_of;
use nalgebra::DMatrix;

use super::{Accepted, VehicleParameters, Weighted};

/// Number of vertical states.
pub const STATES: usize = 18;
/// Number of states with sideslip and yaw rate.
pub const LATERAL_STATES: usize = 20;

// Indices of the states.
const Z: usize = 0;
const THETA: usize = 1;
const PHI: usize = 2;
const Z_W: usize = 3;
/// Index offset from a position to its rate.
const RATE: usize = 9;
const BETA: usize = 18;
const R: usize = 19;

/// A and B in Xd = A X + B U; with sideslip and yaw rate if a `speed` in m/s is given.
///
/// # Errors
/// The mass matrix is not positive definite; the message names the parameter and its required range.
pub fn state_space(p: &VehicleParameters, speed: Option<f64>) -> Result<(DMatrix<f64>, DMatrix<f64>), String> {
    let size = if speed.is_some() { LATERAL_STATES } else { STATES };
    let unsprung = 6.0 * p.m_w;
    if p.m <= unsprung {
        return Err(format!("'vehicle.mass' must be more than six times 'wheel.mass' ({unsprung} kg), got {} kg", p.m));
    }
    let m_s = p.m - unsprung;
    let least = (m_s * p.h_s).powi(2) / p.m + p.i_xz.powi(2) / p.i_z;
    // Also checked without lateral motion in the model, because the plant has the same check.
    if p.i_x <= least {
        return Err(format!(
            "'body.roll_axis_inertia' must be more than {least:.0} kg.m2, got {} kg.m2: mass, \
             'geometry.body_cg_to_roll_axis' and 'body.product_of_inertia' need it",
            p.i_x
        ));
    }
    let u = speed.unwrap_or(1.0); // multiplies lateral states only
    let mut mass = DMatrix::<f64>::identity(LATERAL_STATES, LATERAL_STATES);
    mass[(Z + RATE, Z + RATE)] = m_s;
    mass[(THETA + RATE, THETA + RATE)] = p.i_y;
    mass[(PHI + RATE, PHI + RATE)] = p.i_x;
    for i in 0..6 {
        mass[(Z_W + RATE + i, Z_W + RATE + i)] = p.m_w;
    }
    mass[(PHI + RATE, BETA)] = -m_s * p.h_s * u;
    mass[(PHI + RATE, R)] = -p.i_xz;
    mass[(BETA, BETA)] = p.m * u;
    mass[(BETA, PHI + RATE)] = -m_s * p.h_s;
    mass[(R, R)] = p.i_z;
    mass[(R, PHI + RATE)] = -p.i_xz;

    let mut n = DMatrix::zeros(LATERAL_STATES, LATERAL_STATES);
    for i in 0..RATE {
        n[(i, i + RATE)] = 1.0;
    }
    n[(THETA + RATE, THETA)] = m_s * p.g * p.h_s;
    n[(PHI + RATE, PHI)] = m_s * p.g * p.h_s;
    n[(PHI + RATE, R)] = m_s * p.h_s * u;
    n[(BETA, R)] = -p.m * u;

    // The actuator pushes the body up and the wheel down.
    let mut r = DMatrix::zeros(LATERAL_STATES, 6);
    // Columns of Q: F_s, F_t, F_y.
    let mut q = DMatrix::zeros(LATERAL_STATES, 18);
    // Rows of S: F_s = k_s d + c_s dd, F_t = k_t z_w, F_y = -C (beta + x r/u).
    let mut s = DMatrix::zeros(18, LATERAL_STATES);
    let (xs, ys) = p.positions();
    for i in 0..6 {
        let (x, y) = (xs[i], ys[i]);
        r[(Z + RATE, i)] = 1.0;
        r[(THETA + RATE, i)] = -x;
        r[(PHI + RATE, i)] = y;
        r[(Z_W + RATE + i, i)] = -1.0;
        for row in 0..LATERAL_STATES {
            q[(row, i)] = -r[(row, i)];
        }
        q[(Z_W + RATE + i, 6 + i)] = -1.0;
        q[(BETA, 12 + i)] = 1.0;
        q[(R, 12 + i)] = x;
        for (first, factor) in [(0, p.k_s), (RATE, p.c_s)] {
            s[(i, first + Z)] = factor;
            s[(i, first + THETA)] = -x * factor;
            s[(i, first + PHI)] = y * factor;
            s[(i, first + Z_W + i)] = -factor;
        }
        s[(6 + i, Z_W + i)] = p.k_t;
        s[(12 + i, BETA)] = -p.c[axle_of(i)];
        s[(12 + i, R)] = -p.c[axle_of(i)] * x / u;
    }
    let forces = n + q * s;
    let mass = mass.view((0, 0), (size, size)).into_owned();
    let lu = mass.lu();
    let solve = |right: DMatrix<f64>| {
        lu.solve(&right.rows(0, size).into_owned())
            .ok_or_else(|| "the mass matrix of the design model is singular: use larger masses or inertias".to_owned())
    };
    Ok((solve(forces.columns(0, size).into_owned())?, solve(r)?))
}

/// D and E in Y = D X + E U, and the weight of each row, for the weighted quantities.
pub fn output_rows(
    p: &VehicleParameters,
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    outputs: &[Accepted],
) -> (DMatrix<f64>, DMatrix<f64>, Vec<f64>) {
    let states = a.nrows();
    let (x, y) = p.positions();
    // Each row: coefficients of X, coefficients of U, weight.
    let mut rows: Vec<(Vec<f64>, Vec<f64>, f64)> = Vec::new();
    for &Accepted { quantity, value } in outputs {
        let weight = 1.0 / (value * value);
        let of_state = |coefficients: &[(usize, f64)]| {
            let mut row = vec![0.0; states];
            for &(state, coefficient) in coefficients {
                row[state] = coefficient;
            }
            (row, vec![0.0; 6], weight)
        };
        let acceleration = |position: usize| {
            let row = position + RATE;
            (a.row(row).iter().copied().collect(), b.row(row).iter().copied().collect(), weight)
        };
        match quantity {
            Weighted::HeaveAcceleration => rows.push(acceleration(Z)),
            Weighted::PitchAcceleration => rows.push(acceleration(THETA)),
            Weighted::RollAcceleration => rows.push(acceleration(PHI)),
            Weighted::Roll => rows.push(of_state(&[(PHI, 1.0)])),
            Weighted::SuspensionDeflections => {
                rows.extend((0..6).map(|i| of_state(&[(Z, 1.0), (THETA, -x[i]), (PHI, y[i]), (Z_W + i, -1.0)])))
            }
            Weighted::TireDeflections => rows.extend((0..6).map(|i| of_state(&[(Z_W + i, 1.0)]))),
        }
    }
    (
        DMatrix::from_fn(rows.len(), states, |i, j| rows[i].0[j]),
        DMatrix::from_fn(rows.len(), 6, |i, j| rows[i].1[j]),
        rows.iter().map(|row| row.2).collect(),
    )
}
