//! Versions and interfaces of FMI, and their capabilities.

/// Version of FMI.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize, schemars::JsonSchema)]
pub enum FmiVersion {
    /// FMI 2.0.
    #[serde(rename = "2.0")]
    V2,
    /// FMI 3.0.
    #[serde(rename = "3.0")]
    V3,
}

impl std::fmt::Display for FmiVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::V2 => "2.0",
            Self::V3 => "3.0",
        })
    }
}

/// Interface of an FMU.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
pub enum Interface {
    /// The FMU advances its own state.
    CoSimulation,
    /// The importer integrates the states of the FMU.
    ModelExchange,
    /// The importer activates the partitions of the FMU (FMI 3.0).
    ScheduledExecution,
}

impl std::fmt::Display for Interface {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::CoSimulation => "co-simulation",
            Self::ModelExchange => "model exchange",
            Self::ScheduledExecution => "scheduled execution",
        })
    }
}

/// Identifier and capabilities of an interface (FMI 2.0.4, sections 3.3.1 and 4.3.1; FMI 3.0.2, sections 3.4 and 4.4.1).
/// Capabilities that a version or an interface does not define are false or 0.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Capabilities {
    /// File stem of the binary. FMI requires a C identifier, but other file names are accepted.
    pub model_identifier: String,
    /// The FMU needs the tool that exported it.
    pub needs_execution_tool: bool,
    /// The communication step may change.
    pub can_handle_variable_communication_step_size: bool,
    /// The importer can set derivatives of inputs (FMI 2.0).
    pub can_interpolate_inputs: bool,
    /// Maximum order of output derivatives.
    pub max_output_derivative_order: u32,
    /// `fmi2DoStep` may return before the step is complete (FMI 2.0).
    pub can_run_asynchronously: bool,
    /// Step size of the internal solver (FMI 3.0), s.
    pub fixed_internal_step_size: Option<f64>,
    /// The FMU can handle events in Event Mode in co-simulation (FMI 3.0). This crate requests it for clocks only.
    pub has_event_mode: bool,
    /// The FMU can call the importer during a step (FMI 3.0).
    pub provides_intermediate_update: bool,
    /// The FMU ends a step at an intermediate update if the importer asks for it (FMI 3.0).
    pub can_return_early_after_intermediate_update: bool,
    /// In model exchange, the importer must announce the end of each integration step.
    pub needs_completed_integrator_step: bool,
    /// At most one instance per process.
    pub can_be_instantiated_only_once_per_process: bool,
    /// The memory callbacks are not used (FMI 2.0).
    pub can_not_use_memory_management_functions: bool,
    /// The state can be saved and restored.
    pub can_get_and_set_fmu_state: bool,
    /// The state can be turned into bytes.
    pub can_serialize_fmu_state: bool,
    /// Directional derivatives are supported.
    pub provides_directional_derivative: bool,
    /// Adjoint derivatives are supported (FMI 3.0).
    pub provides_adjoint_derivatives: bool,
    /// The dependencies of each element of an array can be read (FMI 3.0).
    pub provides_per_element_dependencies: bool,
}
