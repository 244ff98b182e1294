//! Options for the description that a library of this exporter returns. `fmu::abi::model_description` takes their sum.

/// Provide co-simulation.
pub const CO_SIMULATION: i32 = 1;
/// Provide model exchange.
pub const MODEL_EXCHANGE: i32 = 2;
/// Declare arrays as variables with dimensions (FMI 3.0).
pub const ARRAYS: i32 = 4;
/// Return terminalsAndIcons.xml instead of the model description (FMI 3.0).
pub const TERMINALS: i32 = 8;
/// Instead of the model description, return the reasons for too many dependencies in the model structure, one per line.
pub const NOTES: i32 = 16;
/// Return the dependencies that the packer builds into a library of FMI 3.0 instead of the model description.
pub const DEPENDENCIES: i32 = 32;
/// Provide scheduled execution (FMI 3.0); fails if a clock of the model has no priority.
pub const SCHEDULED_EXECUTION: i32 = 64;
/// Provide scheduled execution if every clock of the model has a priority (FMI 3.0).
pub const SCHEDULED_EXECUTION_IF_POSSIBLE: i32 = 128;
