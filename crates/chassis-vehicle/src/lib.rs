//! Code shared by the vehicles and controllers of the library: the catalogue of [`signals`] and [`parameters`], the
//! [`positions`] of wheels and axles, [`tire`] and [`suspension`] laws, loads at rest ([`statics`]), [`random`]
//! numbers, [`arithmetic`] that keeps equations fast, [`mirror`] images for tests, and the data of the vehicles.
//!
//! Axes and signs follow ISO 8855: x forward, y left, z up, SI units, angles in radians. Roll is positive about x (the
//! body leans right), pitch about y (nose down), yaw about z (left turn). Deflections are negative in compression; a
//! tire load is the compressive force on the road; a suspension force pushes the body up and the wheel down.

pub mod arithmetic;
pub mod data;
pub mod mirror;
pub mod parameters;
pub mod positions;
pub mod random;
pub mod road;
pub mod signals;
pub mod statics;
pub mod suspension;
pub mod table;
pub mod tire;

/// Items that a model file needs in addition to `fmu::prelude`.
pub mod prelude {
    pub use crate::parameters::*;
    pub use crate::positions::*;
    pub use crate::signals::*;
}
