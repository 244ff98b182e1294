//! `AllTypes`: variables of every type of FMI 2.0. The README has the table of types.

use fmu::prelude::*;

/// Gear
#[derive(Enumeration, Clone, Copy, Debug, PartialEq)]
pub enum Gear {
    /// Reverse gear
    Reverse = 1,
    /// Neutral
    Neutral,
    /// Drive
    Drive,
}

/// Parameters.
#[derive(Parameters)]
pub struct AllTypes {
    /// Real (m)
    #[var("p.real", start = 1.5, min = -10.0, max = 10.0, display = "mm", tunable)]
    pub real: f64,
    /// Integer
    #[var("p.integer", start = -3, min = -100, max = 100, tunable)]
    pub integer: i32,
    /// Boolean
    #[var("p.boolean", start = true, tunable)]
    pub boolean: bool,
    /// String
    #[var("p.string", start = "parameter", tunable)]
    pub string: String,
    /// Enumeration as an Integer with named values
    #[var("p.gear", start = Gear::Neutral, tunable)]
    pub gear: Gear,
    /// Enumeration of FMI
    #[var("p.listed_gear", start = Gear::Drive, enumeration, tunable)]
    pub listed_gear: Gear,
}

/// Inputs.
#[derive(Inputs)]
pub struct U<T> {
    /// Whether the outputs mirror the parameters instead of the inputs
    #[var("u.select_parameters")]
    pub select_parameters: bool,
    /// Real (m)
    #[var("u.real")]
    pub real: T,
    /// Integer
    #[var("u.integer")]
    pub integer: i32,
    /// Boolean
    #[var("u.boolean")]
    pub boolean: bool,
    /// String
    #[var("u.string", start = "input")]
    pub string: String,
    /// Enumeration as an Integer with named values
    #[var("u.gear", start = Gear::Neutral)]
    pub gear: Gear,
    /// Enumeration of FMI
    #[var("u.listed_gear", start = Gear::Neutral, enumeration)]
    pub listed_gear: Gear,
}

/// Outputs.
#[derive(Outputs, Debug, PartialEq)]
pub struct Y<T> {
    /// Real (m)
    #[var("y.real")]
    pub real: T,
    /// Integer
    #[var("y.integer")]
    pub integer: i32,
    /// Boolean
    #[var("y.boolean")]
    pub boolean: bool,
    /// String
    #[var("y.string")]
    pub string: String,
    /// Enumeration as an Integer with named values
    #[var("y.gear")]
    pub gear: Gear,
    /// Enumeration of FMI
    #[var("y.listed_gear", enumeration)]
    pub listed_gear: Gear,
}

/// Mirrors its inputs or its parameters
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for AllTypes {
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        if at.inputs.select_parameters {
            let Self { real, integer, boolean, ref string, gear, listed_gear } = *self;
            Y { real: T::from(real), integer, boolean, string: string.clone(), gear, listed_gear }
        } else {
            let U { real, integer, boolean, ref string, gear, listed_gear, .. } = *at.inputs;
            Y { real, integer, boolean, string: string.clone(), gear, listed_gear }
        }
    }
}
