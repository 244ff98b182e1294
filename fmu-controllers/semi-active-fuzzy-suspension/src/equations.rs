//! One sample of the law: three fuzzy PIDs demand a force and two moments on the body, which are allocated to the
//! struts and limited to the feasible forces of a damper.
//!
//! | symbol | meaning |
//! |---|---|
//! | F_h, M_p, M_r | demanded heave force (up), pitch moment (nose down), roll moment (to the right) |
//! | e, ec | errors: minus the rate, and minus the acceleration of the body |
//! | l1, l2, b | distances from the center of mass to the front axle and to the trunnion between the rear axles; track |
//! | eps | share of the front struts in the roll moment |
//! | f, v | force of a strut (pushes the body up) and rate of its length |
//! | c_0, c_min, c_max | damping that the plant already has, smallest and largest damping of the damper |

use chassis_control::fuzzy_pid::{FuzzyPid, Gains, Settings};
use chassis_control::limit;
use chassis_vehicle::positions::{Struts, left_is_positive};

use crate::{Constraint, D, SemiActiveFuzzySuspension, U, X, Y};

/// Tabulates the rules.
pub(crate) fn derived(p: &SemiActiveFuzzySuspension) -> Result<D, String> {
    for (axle, name) in ["front", "rear"].into_iter().enumerate() {
        if p.c_max[axle] < p.c_min[axle] {
            return Err(format!(
                "'damper.maximum_damping.{name}' must be at least 'damper.minimum_damping.{name}' ({} N.s/m), got {} \
                 N.s/m",
                p.c_min[axle], p.c_max[axle]
            ));
        }
        if p.constraint == Constraint::Command && p.c_max[axle] < p.c_0[axle] {
            return Err(format!(
                "'damper.maximum_damping.{name}' must be at least 'suspension.damping.{name}' ({} N.s/m), got {} \
                 N.s/m: the command alone can only add damping",
                p.c_0[axle], p.c_max[axle]
            ));
        }
    }
    Ok(D { pid: FuzzyPid::new(p.rule_table).map_err(|error| error.to_string())? })
}

/// Settings of the PIDs for heave, pitch and roll.
fn settings(p: &SemiActiveFuzzySuspension) -> [Settings; 3] {
    let heave = Settings {
        gains: Gains { proportional: p.kp_heave, integral: p.ki_heave, derivative: p.kd_heave },
        scales: Gains { proportional: p.kp_scale_heave, integral: p.ki_scale_heave, derivative: p.kd_scale_heave },
        error_range: p.error_range_heave,
        rate_range: p.rate_range_heave,
        output_minimum: p.output_minimum_heave,
        output_maximum: p.output_maximum_heave,
        integral_limit: p.integral_limit_heave,
        leak_rate: p.leak_rate[0],
    };
    let rotation = |i: usize| Settings {
        gains: Gains { proportional: p.kp[i], integral: p.ki[i], derivative: p.kd[i] },
        scales: Gains { proportional: p.kp_scale[i], integral: p.ki_scale[i], derivative: p.kd_scale[i] },
        error_range: p.error_range[i],
        rate_range: p.rate_range[i],
        output_minimum: p.output_minimum[i],
        output_maximum: p.output_maximum[i],
        integral_limit: p.integral_limit[i],
        leak_rate: p.leak_rate[1 + i],
    };
    [heave, rotation(0), rotation(1)]
}

/// Strut forces that add up to the heave force and produce the pitch and roll moments.
pub(crate) fn allocation(p: &SemiActiveFuzzySuspension, [f_h, m_p, m_r]: [f64; 3]) -> Struts<f64> {
    let l = p.l1 + p.l2;
    let axle = [(p.l2 * f_h - m_p) / l, (p.l1 * f_h + m_p) / l];
    let share = [p.eps, 1.0 - p.eps];
    Struts::from_fn(|i| axle[i / 2] / 2.0 + left_is_positive(i) * share[i / 2] * m_r / p.b)
}

/// The part of the force `f` that the damper of an axle (0 front, 1 rear) can produce at the velocity `v`.
pub(crate) fn constrained(p: &SemiActiveFuzzySuspension, axle: usize, f: f64, v: f64) -> f64 {
    let (c_0, c_min, c_max) = (p.c_0[axle], p.c_min[axle], p.c_max[axle]);
    // Smallest and largest damping that the command may add.
    let range = match p.constraint {
        Constraint::Active => None,
        Constraint::Command => Some((0.0, c_max - c_0)),
        Constraint::Damper => Some((c_min - c_0, c_max - c_0)),
    };
    let f = match range {
        None => f,
        Some((low, high)) => {
            let (a, b) = (-low * v, -high * v);
            f.clamp(a.min(b), a.max(b))
        }
    };
    limit::magnitude(f, p.force_limit)
}

pub(crate) fn sample(p: &SemiActiveFuzzySuspension, d: &D, x: &mut X, u: &U) -> Y {
    let motions = [[u.zd, u.zdd], [u.thetad, u.thetadd], [u.phid, u.phidd]];
    let settings = settings(p);
    let mut demand = [0.0; 3];
    for (i, [rate, acceleration]) in motions.into_iter().enumerate() {
        (demand[i], _) = d.pid.sample(&settings[i], &mut x.i[i], -rate, -acceleration, p.sample_time);
    }
    let wanted = allocation(p, demand);
    let f = Struts::from_fn(|i| constrained(p, i / 2, wanted[i], u.v[i]));
    let [f_h, m_p, m_r] = demand;
    Y { f, f_h, m_p, m_r }
}
