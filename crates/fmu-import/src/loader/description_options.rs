//! Options of the description that a library of this exporter returns. They are added up and read by `fmu::abi::model_description`.

/// The FMU provides co-simulation.
pub const CO_SIMULATION: i32 = 1;
/// The FMU provides model exchange.
pub const MODEL_EXCHANGE: i32 = 2;
/// Arrays are variables with dimensions (FMI 3.0).
pub const ARRAYS: i32 = 4;
/// terminalsAndIcons.xml instead of the model description (FMI 3.0).
pub const TERMINALS: i32 = 8;
/// The reasons for too many dependencies in the model structure, one line each, instead of the model description.
pub const NOTES: i32 = 16;
