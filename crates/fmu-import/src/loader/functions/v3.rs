//! The functions of FMI 3.0.

use super::table;
use crate::c_api::{self, v3};
use crate::description::Interface;
use std::ffi::c_char;

/// Functions that this crate never calls.
pub(super) const UNUSED: [&str; 6] = [
    "fmi3GetIntervalFraction",
    "fmi3GetShiftFraction",
    "fmi3SetIntervalFraction",
    "fmi3SetShiftDecimal",
    "fmi3SetShiftFraction",
    "fmi3EvaluateDiscreteStates",
];

table! {
    required {
        get_version: c_api::GetText = "fmi3GetVersion",
        free_instance: c_api::FreeInstance = "fmi3FreeInstance",
        enter_initialization_mode: v3::EnterInitializationMode = "fmi3EnterInitializationMode",
        exit_initialization_mode: c_api::Transition = "fmi3ExitInitializationMode",
        terminate: c_api::Transition = "fmi3Terminate",
        reset: c_api::Transition = "fmi3Reset",
        get_float64: v3::Get<f64> = "fmi3GetFloat64",
        get_int32: v3::Get<i32> = "fmi3GetInt32",
        get_boolean: v3::Get<v3::RawBoolean> = "fmi3GetBoolean",
        get_string: v3::Get<*const c_char> = "fmi3GetString",
        set_float64: v3::Set<f64> = "fmi3SetFloat64",
        set_int32: v3::Set<i32> = "fmi3SetInt32",
        set_boolean: v3::Set<bool> = "fmi3SetBoolean",
        set_string: v3::Set<*const c_char> = "fmi3SetString",
    }
    optional {
        set_debug_logging: v3::SetDebugLogging = "fmi3SetDebugLogging",
        enter_configuration_mode: c_api::Transition = "fmi3EnterConfigurationMode",
        exit_configuration_mode: c_api::Transition = "fmi3ExitConfigurationMode",
        get_float32: v3::Get<f32> = "fmi3GetFloat32",
        set_float32: v3::Set<f32> = "fmi3SetFloat32",
        get_int8: v3::Get<i8> = "fmi3GetInt8",
        set_int8: v3::Set<i8> = "fmi3SetInt8",
        get_uint8: v3::Get<u8> = "fmi3GetUInt8",
        set_uint8: v3::Set<u8> = "fmi3SetUInt8",
        get_int16: v3::Get<i16> = "fmi3GetInt16",
        set_int16: v3::Set<i16> = "fmi3SetInt16",
        get_uint16: v3::Get<u16> = "fmi3GetUInt16",
        set_uint16: v3::Set<u16> = "fmi3SetUInt16",
        get_uint32: v3::Get<u32> = "fmi3GetUInt32",
        set_uint32: v3::Set<u32> = "fmi3SetUInt32",
        get_int64: v3::Get<i64> = "fmi3GetInt64",
        set_int64: v3::Set<i64> = "fmi3SetInt64",
        get_uint64: v3::Get<u64> = "fmi3GetUInt64",
        set_uint64: v3::Set<u64> = "fmi3SetUInt64",
        get_binary: v3::GetBinary = "fmi3GetBinary",
        set_binary: v3::SetBinary = "fmi3SetBinary",
        get_state: c_api::AccessState = "fmi3GetFMUState",
        set_state: c_api::SetState = "fmi3SetFMUState",
        free_state: c_api::AccessState = "fmi3FreeFMUState",
        serialized_state_size: c_api::SerializedStateSize = "fmi3SerializedFMUStateSize",
        serialize_state: v3::SerializeState = "fmi3SerializeFMUState",
        deserialize_state: v3::DeserializeState = "fmi3DeserializeFMUState",
        get_directional_derivative: v3::GetDerivative = "fmi3GetDirectionalDerivative",
        get_adjoint_derivative: v3::GetDerivative = "fmi3GetAdjointDerivative",
        get_number_of_dependencies: v3::GetNumberOfDependencies = "fmi3GetNumberOfVariableDependencies",
        get_dependencies: v3::GetDependencies = "fmi3GetVariableDependencies",
        get_clock: v3::GetClock = "fmi3GetClock",
        set_clock: v3::SetClock = "fmi3SetClock",
        get_interval: v3::GetInterval = "fmi3GetIntervalDecimal",
        set_interval: v3::SetInterval = "fmi3SetIntervalDecimal",
        get_shift: v3::GetShift = "fmi3GetShiftDecimal",
    }
    CoSimulation {
        needed {
            instantiate_co_simulation: v3::InstantiateCoSimulation = "fmi3InstantiateCoSimulation",
            do_step: v3::DoStep = "fmi3DoStep",
        }
        get_output_derivatives: v3::GetOutputDerivatives = "fmi3GetOutputDerivatives",
        begin_event: c_api::Transition = "fmi3EnterEventMode",
        update_event: v3::UpdateDiscreteStates = "fmi3UpdateDiscreteStates",
        end_event: c_api::Transition = "fmi3EnterStepMode",
    }
    ModelExchange {
        needed {
            instantiate_model_exchange: v3::InstantiateModelExchange = "fmi3InstantiateModelExchange",
            set_time: c_api::SetTime = "fmi3SetTime",
            set_continuous_states: c_api::SetNumbers = "fmi3SetContinuousStates",
            get_derivatives: c_api::GetNumbers = "fmi3GetContinuousStateDerivatives",
            get_continuous_states: c_api::GetNumbers = "fmi3GetContinuousStates",
            update_discrete_states: v3::UpdateDiscreteStates = "fmi3UpdateDiscreteStates",
            enter_event_mode: c_api::Transition = "fmi3EnterEventMode",
            enter_continuous_time_mode: c_api::Transition = "fmi3EnterContinuousTimeMode",
            completed_integrator_step: v3::CompletedIntegratorStep = "fmi3CompletedIntegratorStep",
        }
        get_event_indicators: c_api::GetNumbers = "fmi3GetEventIndicators",
        get_nominals: c_api::GetNumbers = "fmi3GetNominalsOfContinuousStates",
        get_number_of_states: v3::GetNumber = "fmi3GetNumberOfContinuousStates",
        get_number_of_event_indicators: v3::GetNumber = "fmi3GetNumberOfEventIndicators",
    }
    ScheduledExecution {
        needed {
            instantiate_scheduled_execution: v3::InstantiateScheduledExecution = "fmi3InstantiateScheduledExecution",
            activate_partition: v3::ActivatePartition = "fmi3ActivateModelPartition",
        }
    }
}
