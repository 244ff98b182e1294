//! Mamdani inference of the shares from Tables 2 and 3 of the paper, with Gaussian sets that cross at one half.

use chassis_control::fuzzy::{Conjunction, FuzzyError, LabelMap, Membership, Output, Partition, RuleTable};

use crate::{D, FuzzyCoordination, Strategy, U, Y};

/// Labels of the outputs, from extremely small to extremely big.
const PES: usize = 0;
const PVS: usize = 1;
const PS: usize = 2;
const PM: usize = 3;
const PB: usize = 4;
const PVB: usize = 5;
const PEB: usize = 6;

/// Rows: speed ZO, PS, PM, PB, PVB. Columns: steering angle ZO, PS, PM, PB, PVB.
const RULES: [[usize; 5]; 5] = [
    [PES, PES, PVS, PS, PM],
    [PES, PVS, PS, PM, PB],
    [PVS, PM, PB, PB, PVB],
    [PS, PM, PB, PVB, PVB],
    [PS, PB, PVB, PEB, PEB],
];

/// Table 3: the label of the other share, for each of PES, PVS, ... PEB.
const MIRROR: [usize; 7] = [PEB, PEB, PB, PM, PS, PVS, PES];

const LARGEST_ANGLE: f64 = 32.0; // deg
const LARGEST_SPEED: f64 = 40.0; // km/h

pub(crate) fn rule_base() -> Result<D, String> {
    let make = || -> Result<D, FuzzyError> {
        Ok(D {
            angle: Partition::new(Membership::evenly_spaced_gaussians(0.0, LARGEST_ANGLE))?,
            speed: Partition::new(Membership::evenly_spaced_gaussians(0.0, LARGEST_SPEED))?,
            rules: RuleTable::new(RULES, Conjunction::Minimum)?,
            mirrored: LabelMap::new(MIRROR)?,
            output: Output::new(Membership::evenly_spaced_gaussians(0.0, 1.0), 0.0, 1.0, 101)?,
        })
    };
    make().map_err(|error| error.to_string())
}

pub(crate) fn weights(p: &FuzzyCoordination, d: &D, u: &U) -> Y {
    if p.strategy == Strategy::Individual {
        return Y { k1: p.fixed_integrated, k2: p.fixed_roll, k3: p.fixed_steering };
    }
    let angle = u.steer.to_degrees().abs().min(LARGEST_ANGLE);
    let speed = (u.speed * 3.6).clamp(0.0, LARGEST_SPEED);
    let activation = d.rules.activation(&d.speed.grades(speed), &d.angle.grades(angle));
    let table = d.output.centroid(&activation);
    let mirror = d.output.centroid(&d.mirrored.apply(&activation));
    let (k1, k2) = if p.as_printed { (table, mirror) } else { (mirror, table) };
    let is_on = u.speed > 0.0 && u.steer.abs() >= p.delta_0;
    Y { k1, k2, k3: f64::from(u8::from(is_on)) }
}
