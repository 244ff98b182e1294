//! The table of the C functions.

use crate::c_api::{self, RawStatus};
use std::ffi::c_char;

macro_rules! functions {
    (required { $($field:ident: $type:ty = $name:literal,)* } optional { $($other:ident: $other_type:ty = $other_name:literal,)* }) => {
        /// The functions of a library. Those a master cannot do without are required; the others
        /// are missing from many FMUs although FMI 2.0 demands them.
        pub(super) struct Functions { $(pub(super) $field: $type,)* $(pub(super) $other: Option<$other_type>,)* }

        impl Functions {
            /// # Safety
            /// Every function of that name has the signature FMI 2.0 gives it, and the library
            /// outlives the table.
            pub(super) unsafe fn load(library: &libloading::Library) -> Result<Self, &'static str> {
                // SAFETY: promised by the caller.
                unsafe {
                    Ok(Self {
                        $($field: *library.get::<$type>($name).map_err(|_| $name)?,)*
                        $($other: library.get::<$other_type>($other_name).ok().map(|f| *f),)*
                    })
                }
            }

            /// Names of all functions.
            pub(super) const NAMES: &[&str] = &[$($name,)* $($other_name,)*];

            /// Names of the optional functions that are not there.
            pub(super) fn missing(&self) -> Vec<&'static str> {
                let mut names = Vec::new();
                $(if self.$other.is_none() {
                    names.push($other_name);
                })*
                names
            }
        }
    };
}

functions! {
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
        do_step: c_api::DoStep = "fmi2DoStep",
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
        set_real_input_derivatives: c_api::SetInputDerivatives = "fmi2SetRealInputDerivatives",
        get_real_output_derivatives: c_api::GetOutputDerivatives = "fmi2GetRealOutputDerivatives",
        cancel_step: c_api::Transition = "fmi2CancelStep",
        get_status: c_api::GetStatus<RawStatus> = "fmi2GetStatus",
        get_real_status: c_api::GetStatus<f64> = "fmi2GetRealStatus",
        get_integer_status: c_api::GetStatus<i32> = "fmi2GetIntegerStatus",
        get_boolean_status: c_api::GetStatus<c_api::Boolean> = "fmi2GetBooleanStatus",
        get_string_status: c_api::GetStatus<*const c_char> = "fmi2GetStringStatus",
    }
}
