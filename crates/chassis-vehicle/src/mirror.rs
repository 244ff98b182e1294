//! Mirror images of a vehicle about its longitudinal axis. The response of a symmetric vehicle to a right turn is the
//! mirror image of its response to a left turn.

use fmu::Variables;

/// Name prefixes of the signals that change sign: they point sideways or turn about the x or z axis.
const ODD: [&str; 9] = [
    "steer",
    "tire_slip_angle",
    "tire_lateral_force",
    "vehicle.lateral",
    "vehicle.sideslip",
    "vehicle.yaw",
    "vehicle.position_y",
    "vehicle.load_transfer",
    "body.roll",
];

/// Mirrors a block of variables: elements of the left and the right side swap values, and sideways signals change sign.
///
/// # Panics
/// If a variable of one side has no counterpart on the other side.
pub fn mirrored<B: Variables<f64>>(block: &B) -> B {
    let names: Vec<_> = B::declarations().into_iter().map(|declaration| declaration.name).collect();
    let values = block.reals();
    let reflected: Vec<_> = names
        .iter()
        .map(|name| {
            let other = other_side(name);
            let source = names.iter().position(|candidate| *candidate == other);
            let value = values[source.unwrap_or_else(|| panic!("'{name}' has no counterpart '{other}'"))];
            if ODD.iter().any(|odd| name.starts_with(odd)) { -value } else { value }
        })
        .collect();
    B::from_reals(&reflected)
}

/// Maps `tire_load.fl` to `tire_load.fr`, `beam_height.l` to `beam_height.r`, and back. Other names are unchanged.
fn other_side(name: &str) -> String {
    match name.rsplit_once('.') {
        Some((family, place @ ("l" | "fl" | "ml" | "rl"))) => format!("{family}.{}r", &place[..place.len() - 1]),
        Some((family, place @ ("r" | "fr" | "mr" | "rr"))) => format!("{family}.{}l", &place[..place.len() - 1]),
        _ => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_change_places() {
        for (left, right) in
            [("tire_load.fl", "tire_load.fr"), ("wheel_height.ml", "wheel_height.mr"), ("a.b.l", "a.b.r")]
        {
            assert_eq!((other_side(left).as_str(), other_side(right).as_str()), (right, left));
        }
        for name in ["body.roll", "steer.rear", "l", "x.all"] {
            assert_eq!(other_side(name), name);
        }
    }
}
