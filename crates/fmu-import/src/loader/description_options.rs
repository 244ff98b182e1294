//! What a library of this project's exporter is asked for when it describes its model: a sum of these numbers. The exporter reads
//! them in `fmu::abi::model_description`.

/// The FMU provides co-simulation.
pub const CO_SIMULATION: i32 = 1;
/// The FMU provides model exchange.
pub const MODEL_EXCHANGE: i32 = 2;
/// Arrays are variables with dimensions (FMI 3.0).
pub const ARRAYS: i32 = 4;
/// terminalsAndIcons.xml instead of the model description (FMI 3.0).
pub const TERMINALS: i32 = 8;
