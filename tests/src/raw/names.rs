//! Names of functions in the versions of FMI.

use fmu_import::description::FmiVersion;

/// Functions of both versions: their names in FMI 2.0 and FMI 3.0.
const NAMES: [[&str; 2]; 34] = [
    ["fmi2CompletedIntegratorStep", "fmi3CompletedIntegratorStep"],
    ["fmi2DeSerializeFMUstate", "fmi3DeserializeFMUState"],
    ["fmi2DoStep", "fmi3DoStep"],
    ["fmi2EnterContinuousTimeMode", "fmi3EnterContinuousTimeMode"],
    ["fmi2EnterEventMode", "fmi3EnterEventMode"],
    ["fmi2EnterInitializationMode", "fmi3EnterInitializationMode"],
    ["fmi2ExitInitializationMode", "fmi3ExitInitializationMode"],
    ["fmi2FreeFMUstate", "fmi3FreeFMUState"],
    ["fmi2FreeInstance", "fmi3FreeInstance"],
    ["fmi2GetBoolean", "fmi3GetBoolean"],
    ["fmi2GetContinuousStates", "fmi3GetContinuousStates"],
    ["fmi2GetDerivatives", "fmi3GetContinuousStateDerivatives"],
    ["fmi2GetDirectionalDerivative", "fmi3GetDirectionalDerivative"],
    ["fmi2GetEventIndicators", "fmi3GetEventIndicators"],
    ["fmi2GetFMUstate", "fmi3GetFMUState"],
    ["fmi2GetInteger", "fmi3GetInt32"],
    ["fmi2GetNominalsOfContinuousStates", "fmi3GetNominalsOfContinuousStates"],
    ["fmi2GetReal", "fmi3GetFloat64"],
    ["fmi2GetRealOutputDerivatives", "fmi3GetOutputDerivatives"],
    ["fmi2GetString", "fmi3GetString"],
    ["fmi2GetVersion", "fmi3GetVersion"],
    ["fmi2NewDiscreteStates", "fmi3UpdateDiscreteStates"],
    ["fmi2Reset", "fmi3Reset"],
    ["fmi2SerializeFMUstate", "fmi3SerializeFMUState"],
    ["fmi2SerializedFMUstateSize", "fmi3SerializedFMUStateSize"],
    ["fmi2SetBoolean", "fmi3SetBoolean"],
    ["fmi2SetContinuousStates", "fmi3SetContinuousStates"],
    ["fmi2SetDebugLogging", "fmi3SetDebugLogging"],
    ["fmi2SetFMUstate", "fmi3SetFMUState"],
    ["fmi2SetInteger", "fmi3SetInt32"],
    ["fmi2SetReal", "fmi3SetFloat64"],
    ["fmi2SetString", "fmi3SetString"],
    ["fmi2SetTime", "fmi3SetTime"],
    ["fmi2Terminate", "fmi3Terminate"],
];

/// The name, in this version of FMI, of the function that is called `name` in FMI 2.0. The name of a function that
/// exists in only one version is not changed.
#[must_use]
pub fn in_version(version: FmiVersion, name: &str) -> &str {
    if version == FmiVersion::V2 {
        return name;
    }
    NAMES.iter().find(|[two, _]| *two == name).map_or(name, |[_, three]| three)
}
