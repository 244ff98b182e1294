//! The functions of FMI 2.0.

use super::table;
use crate::c_api;
use crate::description::Interface;
use std::ffi::c_char;

/// Functions for co-simulation that this crate never calls.
pub(super) const UNUSED: [&str; 3] = ["fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"];

table! {
    required {
        get_types_platform: c_api::GetText = "fmi2GetTypesPlatform",
        get_version: c_api::GetText = "fmi2GetVersion",
        instantiate: c_api::Instantiate = "fmi2Instantiate",
        free_instance: c_api::FreeInstance = "fmi2FreeInstance",
        setup_experiment: c_api::SetupExperiment = "fmi2SetupExperiment",
        enter_initialization_mode: c_api::Transition = "fmi2EnterInitializationMode",
        exit_initialization_mode: c_api::Transition = "fmi2ExitInitializationMode",
        terminate: c_api::Transition = "fmi2Terminate",
        reset: c_api::Transition = "fmi2Reset",
        get_real: c_api::Get<f64> = "fmi2GetReal",
        get_integer: c_api::Get<i32> = "fmi2GetInteger",
        get_boolean: c_api::Get<c_api::Boolean> = "fmi2GetBoolean",
        get_string: c_api::Get<*const c_char> = "fmi2GetString",
        set_real: c_api::Set<f64> = "fmi2SetReal",
        set_integer: c_api::Set<i32> = "fmi2SetInteger",
        set_boolean: c_api::Set<c_api::Boolean> = "fmi2SetBoolean",
        set_string: c_api::Set<*const c_char> = "fmi2SetString",
    }
    optional {
        set_debug_logging: c_api::SetDebugLogging = "fmi2SetDebugLogging",
        get_state: c_api::AccessState = "fmi2GetFMUstate",
        set_state: c_api::SetState = "fmi2SetFMUstate",
        free_state: c_api::AccessState = "fmi2FreeFMUstate",
        serialized_state_size: c_api::SerializedStateSize = "fmi2SerializedFMUstateSize",
        serialize_state: c_api::SerializeState = "fmi2SerializeFMUstate",
        deserialize_state: c_api::DeserializeState = "fmi2DeSerializeFMUstate",
        get_directional_derivative: c_api::GetDirectionalDerivative = "fmi2GetDirectionalDerivative",
    }
    CoSimulation {
        needed {
            do_step: c_api::DoStep = "fmi2DoStep",
        }
        set_real_input_derivatives: c_api::SetInputDerivatives = "fmi2SetRealInputDerivatives",
        get_real_output_derivatives: c_api::GetOutputDerivatives = "fmi2GetRealOutputDerivatives",
        cancel_step: c_api::Transition = "fmi2CancelStep",
        get_real_status: c_api::GetStatus<f64> = "fmi2GetRealStatus",
        get_boolean_status: c_api::GetStatus<c_api::Boolean> = "fmi2GetBooleanStatus",
    }
    ModelExchange {
        needed {
            set_time: c_api::SetTime = "fmi2SetTime",
            set_continuous_states: c_api::SetNumbers = "fmi2SetContinuousStates",
            get_derivatives: c_api::GetNumbers = "fmi2GetDerivatives",
            get_continuous_states: c_api::GetNumbers = "fmi2GetContinuousStates",
            new_discrete_states: c_api::NewDiscreteStates = "fmi2NewDiscreteStates",
            enter_event_mode: c_api::Transition = "fmi2EnterEventMode",
            enter_continuous_time_mode: c_api::Transition = "fmi2EnterContinuousTimeMode",
            completed_integrator_step: c_api::CompletedIntegratorStep = "fmi2CompletedIntegratorStep",
        }
        get_event_indicators: c_api::GetNumbers = "fmi2GetEventIndicators",
        get_nominals: c_api::GetNumbers = "fmi2GetNominalsOfContinuousStates",
    }
}
