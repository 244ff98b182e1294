//! The call-order rules of FMI 2.0 (sections 3.2.3 and 4.2.4) and FMI 3.0 (sections 2.3, 3.2 and 4.2), as one table.

/// Version of the standard that an FMU follows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Fmi2,
    /// FMI 3.0.
    Fmi3,
}

/// Interface through which an instance is used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interface {
    /// The FMU contains its solver.
    CoSimulation,
    /// The importer solves the equations.
    ModelExchange,
}

impl Interface {
    /// Name in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::CoSimulation => "co-simulation",
            Self::ModelExchange => "model exchange",
        }
    }
}

/// Interfaces that an FMU provides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interfaces {
    /// True if it supports co-simulation.
    pub co_simulation: bool,
    /// True if it supports model exchange.
    pub model_exchange: bool,
}

impl Interfaces {
    /// No interface.
    pub const NONE: Self = Self { co_simulation: false, model_exchange: false };
    /// Both interfaces.
    pub const ALL: Self = Self { co_simulation: true, model_exchange: true };

    /// Returns true if an interface is provided.
    pub const fn contains(self, interface: Interface) -> bool {
        match interface {
            Interface::CoSimulation => self.co_simulation,
            Interface::ModelExchange => self.model_exchange,
        }
    }
}

/// Version and interface of an instance: its column in the table of calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Protocol {
    /// Version of the standard.
    pub version: Version,
    /// Interface.
    pub interface: Interface,
}

impl Protocol {
    /// FMI 2.0, co-simulation.
    pub const CS2: Self = Self { version: Version::Fmi2, interface: Interface::CoSimulation };
    /// FMI 2.0, model exchange.
    pub const ME2: Self = Self { version: Version::Fmi2, interface: Interface::ModelExchange };
    /// FMI 3.0, co-simulation.
    pub const CS3: Self = Self { version: Version::Fmi3, interface: Interface::CoSimulation };
    /// FMI 3.0, model exchange.
    pub const ME3: Self = Self { version: Version::Fmi3, interface: Interface::ModelExchange };
    /// All columns of the table.
    pub const ALL: [Self; 4] = [Self::CS2, Self::ME2, Self::CS3, Self::ME3];

    /// Name in messages.
    pub fn name(&self) -> String {
        let version = match self.version {
            Version::Fmi2 => "2.0",
            Version::Fmi3 => "3.0",
        };
        format!("{} of FMI {version}", self.interface.name())
    }

    pub(crate) const fn column(self) -> usize {
        2 * (self.version as usize) + self.interface as usize
    }
}

/// State of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// After instantiation or reset.
    Instantiated,
    /// Between the start and the end of the initialization.
    Initialization,
    /// Co-simulation: ready for a communication step.
    Step,
    /// Co-simulation: after a step that failed. The values from before the step are restored.
    StepFailed,
    /// After the end of the simulation.
    Terminated,
    /// After a panic inside a call; the values are not reliable.
    Broken,
    /// Events are handled.
    Event,
    /// Model exchange: the importer integrates.
    ContinuousTime,
    /// Co-simulation: inside a step, while the importer's `intermediateUpdate` runs.
    IntermediateUpdate,
}

impl Mode {
    /// All modes, ordered by their discriminants.
    pub const ALL: [Mode; 9] = [
        Self::Instantiated,
        Self::Initialization,
        Self::Step,
        Self::StepFailed,
        Self::Terminated,
        Self::Broken,
        Self::Event,
        Self::ContinuousTime,
        Self::IntermediateUpdate,
    ];

    /// Name in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Instantiated => "Instantiated",
            Self::Initialization => "Initialization Mode",
            Self::Step => "Step Mode",
            Self::StepFailed => "Step Failed",
            Self::Terminated => "Terminated",
            Self::Broken => "Broken",
            Self::Event => "Event Mode",
            Self::ContinuousTime => "Continuous-Time Mode",
            Self::IntermediateUpdate => "Intermediate Update Mode",
        }
    }

    /// Returns true if an instance with this protocol can be in the mode.
    pub const fn belongs_to(self, protocol: Protocol) -> bool {
        match (self, protocol.interface) {
            (Self::Step | Self::StepFailed, interface) => matches!(interface, Interface::CoSimulation),
            (Self::Event | Self::IntermediateUpdate, Interface::CoSimulation) => {
                matches!(protocol.version, Version::Fmi3)
            }
            (Self::IntermediateUpdate, Interface::ModelExchange) => false,
            (Self::ContinuousTime, interface) => matches!(interface, Interface::ModelExchange),
            _ => true,
        }
    }

    const fn bit(self) -> u16 {
        1 << self as u8
    }
}

const I: u16 = Mode::Instantiated.bit();
const N: u16 = Mode::Initialization.bit();
const S: u16 = Mode::Step.bit();
const F: u16 = Mode::StepFailed.bit();
const T: u16 = Mode::Terminated.bit();
const B: u16 = Mode::Broken.bit();
const E: u16 = Mode::Event.bit();
const C: u16 = Mode::ContinuousTime.bit();
const M: u16 = Mode::IntermediateUpdate.bit();
/// Not a function of this interface.
const NO: u16 = 0;

macro_rules! calls {
    ($($function:ident $two:literal $three:literal: $($modes:expr),*;)*) => {
        /// A function of the C interface whose use depends on the mode.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the names come from FMI 2.0, or from FMI 3.0 if they are new")]
        pub enum Function { $($function),* }

        impl Function {
            /// All functions of the table.
            pub const ALL: &[Function] = &[$(Self::$function),*];

            /// Name in the C interface of a version; empty if the version does not have the function.
            pub const fn name(self, version: Version) -> &'static str {
                match (self, version) { $(
                    (Self::$function, Version::Fmi2) => $two,
                    (Self::$function, Version::Fmi3) => $three,
                )* }
            }

            const fn modes(self) -> [u16; 4] {
                match self { $(Self::$function => [$($modes),*]),* }
            }
        }
    };
}

calls! {
    //                                                                        FMI 2.0: co-simulation, model exchange,
    //                                                                        FMI 3.0: co-simulation, model exchange
    SetDebugLogging "fmi2SetDebugLogging" "fmi3SetDebugLogging":              I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T, I|N|E|C|T;
    SetupExperiment "fmi2SetupExperiment" "":                                 I, I, NO, NO;
    EnterInitializationMode "fmi2EnterInitializationMode" "fmi3EnterInitializationMode": I, I, I, I;
    ExitInitializationMode "fmi2ExitInitializationMode" "fmi3ExitInitializationMode": N, N, N, N;
    Terminate "fmi2Terminate" "fmi3Terminate":                                S|F, E|C, S|E|F, E|C;
    Reset "fmi2Reset" "fmi3Reset":                                            I|N|S|F|T|B, I|N|E|C|T|B, I|N|S|E|F|T|B, I|N|E|C|T|B;
    GetReal "fmi2GetReal" "fmi3GetFloat64":                                   N|S|F|T, N|E|C|T, I|N|S|E|M|F|T, I|N|E|C|T;
    GetInteger "fmi2GetInteger" "fmi3GetInt32":                               N|S|F|T, N|E|C|T, I|N|S|E|M|F|T, I|N|E|C|T;
    GetInt64 "" "fmi3GetInt64":                                               NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetBoolean "fmi2GetBoolean" "fmi3GetBoolean":                             N|S|F|T, N|E|C|T, I|N|S|E|M|F|T, I|N|E|C|T;
    GetString "fmi2GetString" "fmi3GetString":                                N|S|F|T, N|E|C|T, I|N|S|E|M|F|T, I|N|E|C|T;
    SetReal "fmi2SetReal" "fmi3SetFloat64":                                   I|N|S, I|N|E|C, I|N|S|E|M, I|N|E|C;
    SetInteger "fmi2SetInteger" "fmi3SetInt32":                               I|N|S, I|N|E, I|N|S|E|M, I|N|E;
    SetInt64 "" "fmi3SetInt64":                                               NO, NO, I|N|S|E|M, I|N|E;
    SetBoolean "fmi2SetBoolean" "fmi3SetBoolean":                             I|N|S, I|N|E, I|N|S|E|M, I|N|E;
    SetString "fmi2SetString" "fmi3SetString":                                I|N|S, I|N|E, I|N|S|E|M, I|N|E;
    GetFMUstate "fmi2GetFMUstate" "fmi3GetFMUState":                          I|N|S|T, I|N|E|C|T, I|N|S|E|T, I|N|E|C|T;
    SetFMUstate "fmi2SetFMUstate" "fmi3SetFMUState":                          I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T, I|N|E|C|T;
    FreeFMUstate "fmi2FreeFMUstate" "fmi3FreeFMUState":                       I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T, I|N|E|C|T;
    SerializedFMUstateSize "fmi2SerializedFMUstateSize" "fmi3SerializedFMUStateSize": I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T, I|N|E|C|T;
    SerializeFMUstate "fmi2SerializeFMUstate" "fmi3SerializeFMUState":        I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T, I|N|E|C|T;
    DeSerializeFMUstate "fmi2DeSerializeFMUstate" "fmi3DeserializeFMUState":  I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T, I|N|E|C|T;
    GetDirectionalDerivative "fmi2GetDirectionalDerivative" "fmi3GetDirectionalDerivative": N|S|F|T, N|E|C|T, N|S|E|F|T, N|E|C|T;
    GetAdjointDerivative "" "fmi3GetAdjointDerivative":                       NO, NO, N|S|E|F|T, N|E|C|T;
    // Model exchange, and events.
    EnterEventMode "fmi2EnterEventMode" "fmi3EnterEventMode":                 NO, C|E, S, C|E;
    NewDiscreteStates "fmi2NewDiscreteStates" "fmi3UpdateDiscreteStates":     NO, E, E, E;
    EvaluateDiscreteStates "" "fmi3EvaluateDiscreteStates":                   NO, NO, E, E;
    EnterContinuousTimeMode "fmi2EnterContinuousTimeMode" "fmi3EnterContinuousTimeMode": NO, E, NO, E;
    CompletedIntegratorStep "fmi2CompletedIntegratorStep" "fmi3CompletedIntegratorStep": NO, C, NO, C;
    SetTime "fmi2SetTime" "fmi3SetTime":                                      NO, E|C, NO, E|C;
    SetContinuousStates "fmi2SetContinuousStates" "fmi3SetContinuousStates":  NO, C, NO, C;
    GetDerivatives "fmi2GetDerivatives" "fmi3GetContinuousStateDerivatives":  NO, N|E|C|T, NO, N|E|C|T;
    GetEventIndicators "fmi2GetEventIndicators" "fmi3GetEventIndicators":     NO, N|E|C|T, NO, N|E|C|T;
    GetContinuousStates "fmi2GetContinuousStates" "fmi3GetContinuousStates":  NO, N|E|C|T, NO, N|E|C|T;
    GetNominalsOfContinuousStates "fmi2GetNominalsOfContinuousStates" "fmi3GetNominalsOfContinuousStates": NO, I|N|E|C|T, NO, I|N|E|C|T;
    GetNumberOfEventIndicators "" "fmi3GetNumberOfEventIndicators":           NO, NO, NO, I|N|E|C|T;
    GetNumberOfContinuousStates "" "fmi3GetNumberOfContinuousStates":         NO, NO, NO, I|N|E|C|T;
    // Co-simulation.
    SetRealInputDerivatives "fmi2SetRealInputDerivatives" "":                 I|N|S, NO, NO, NO;
    GetRealOutputDerivatives "fmi2GetRealOutputDerivatives" "fmi3GetOutputDerivatives": S|F|T, NO, S|M|F|T, NO;
    EnterStepMode "" "fmi3EnterStepMode":                                     NO, NO, E, NO;
    DoStep "fmi2DoStep" "fmi3DoStep":                                         S, NO, S, NO;
    CancelStep "fmi2CancelStep" "":                                           S, NO, NO, NO;
    GetStatus "fmi2GetStatus" "":                                             S|F|T, NO, NO, NO;
    GetRealStatus "fmi2GetRealStatus" "":                                     S|F|T, NO, NO, NO;
    GetIntegerStatus "fmi2GetIntegerStatus" "":                               S|F|T, NO, NO, NO;
    GetBooleanStatus "fmi2GetBooleanStatus" "":                               S|F|T, NO, NO, NO;
    GetStringStatus "fmi2GetStringStatus" "":                                 S|F|T, NO, NO, NO;
    GetNumberOfVariableDependencies "" "fmi3GetNumberOfVariableDependencies": NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetVariableDependencies "" "fmi3GetVariableDependencies":                 NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    // FMI 3.0, capabilities that the exporter does not support. The functions exist and return errors.
    EnterConfigurationMode "" "fmi3EnterConfigurationMode":                   NO, NO, I|S|E, I|E;
    ExitConfigurationMode "" "fmi3ExitConfigurationMode":                     NO, NO, I, I;
    GetFloat32 "" "fmi3GetFloat32": NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetInt8 "" "fmi3GetInt8": NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetUInt8 "" "fmi3GetUInt8": NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetInt16 "" "fmi3GetInt16": NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetUInt16 "" "fmi3GetUInt16": NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetUInt32 "" "fmi3GetUInt32": NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetUInt64 "" "fmi3GetUInt64": NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetBinary "" "fmi3GetBinary": NO, NO, I|N|S|E|M|F|T, I|N|E|C|T;
    GetClock "" "fmi3GetClock": NO, NO, E, E;
    SetFloat32 "" "fmi3SetFloat32": NO, NO, I|N|S|E|M, I|N|E|C;
    SetInt8 "" "fmi3SetInt8": NO, NO, I|N|S|E|M, I|N|E;
    SetUInt8 "" "fmi3SetUInt8": NO, NO, I|N|S|E|M, I|N|E;
    SetInt16 "" "fmi3SetInt16": NO, NO, I|N|S|E|M, I|N|E;
    SetUInt16 "" "fmi3SetUInt16": NO, NO, I|N|S|E|M, I|N|E;
    SetUInt32 "" "fmi3SetUInt32": NO, NO, I|N|S|E|M, I|N|E;
    SetUInt64 "" "fmi3SetUInt64": NO, NO, I|N|S|E|M, I|N|E;
    SetBinary "" "fmi3SetBinary": NO, NO, I|N|S|E|M, I|N|E;
    SetClock "" "fmi3SetClock": NO, NO, E, E;
    GetIntervalDecimal "" "fmi3GetIntervalDecimal": NO, NO, N|E, N|E;
    GetIntervalFraction "" "fmi3GetIntervalFraction": NO, NO, N|E, N|E;
    GetShiftDecimal "" "fmi3GetShiftDecimal": NO, NO, N, N;
    GetShiftFraction "" "fmi3GetShiftFraction": NO, NO, N, N;
    SetIntervalDecimal "" "fmi3SetIntervalDecimal": NO, NO, N|E, N|E;
    SetIntervalFraction "" "fmi3SetIntervalFraction": NO, NO, N|E, N|E;
    SetShiftDecimal "" "fmi3SetShiftDecimal": NO, NO, N, N;
    SetShiftFraction "" "fmi3SetShiftFraction": NO, NO, N, N;
    ActivateModelPartition "" "fmi3ActivateModelPartition": NO, NO, NO, NO;
}

impl Function {
    /// Returns true if the function may be called in `mode`.
    pub const fn allowed(self, protocol: Protocol, mode: Mode) -> bool {
        self.modes()[protocol.column()] & mode.bit() != 0
    }

    /// Returns the error message for a function that the mode does not allow: "called in X, allowed in Y".
    #[cold]
    pub fn out_of_order(self, protocol: Protocol, mode: Mode) -> String {
        let name = self.name(protocol.version);
        if self.modes()[protocol.column()] == NO {
            return format!("{name} is not a function of {}", protocol.interface.name());
        }
        let allowed: Vec<_> = Mode::ALL.into_iter().filter(|&m| self.allowed(protocol, m)).map(Mode::name).collect();
        format!("{name} called in {}, allowed in {}", mode.name(), allowed.join(", "))
    }
}

/// The table of calls by column and mode, with a bit for each allowed function: a call tests only one bit.
pub(crate) static ALLOWED: [[u128; Mode::ALL.len()]; Protocol::ALL.len()] = {
    let mut table = [[0; Mode::ALL.len()]; Protocol::ALL.len()];
    let mut place = 0;
    while place < Function::ALL.len() * Protocol::ALL.len() * Mode::ALL.len() {
        let (mode, rest) = (place % Mode::ALL.len(), place / Mode::ALL.len());
        let (column, function) = (rest % Protocol::ALL.len(), Function::ALL[rest / Protocol::ALL.len()]);
        if function.allowed(Protocol::ALL[column], Mode::ALL[mode]) {
            table[column][mode] |= 1 << function as u32;
        }
        place += 1;
    }
    table
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_contains_the_mode_and_the_allowed_modes() {
        assert_eq!(
            Function::Terminate.out_of_order(Protocol::CS2, Mode::Instantiated),
            "fmi2Terminate called in Instantiated, allowed in Step Mode, Step Failed"
        );
        assert_eq!(
            Function::DoStep.out_of_order(Protocol::ME3, Mode::Event),
            "fmi3DoStep is not a function of model exchange"
        );
    }

    #[test]
    fn the_functions_of_a_mode_are_those_that_allow_it() {
        for protocol in Protocol::ALL {
            for mode in Mode::ALL {
                let functions = ALLOWED[protocol.column()][mode as usize];
                for &function in Function::ALL {
                    let expected = function.allowed(protocol, mode);
                    assert_eq!(functions >> function as u32 & 1 != 0, expected, "{function:?} {protocol:?} {mode:?}");
                }
            }
        }
    }

    #[test]
    fn a_broken_instance_can_only_be_reset() {
        for protocol in Protocol::ALL {
            for &function in Function::ALL {
                let expected = function == Function::Reset;
                assert_eq!(function.allowed(protocol, Mode::Broken), expected, "{function:?} {protocol:?}");
            }
        }
    }

    /// A mode that an interface does not have allows no function. A function that a version does not have is allowed in
    /// no mode.
    #[test]
    fn functions_and_modes_belong_to_their_versions_and_interfaces() {
        for protocol in Protocol::ALL {
            for &function in Function::ALL {
                for mode in Mode::ALL.into_iter().filter(|&mode| function.allowed(protocol, mode)) {
                    assert!(mode.belongs_to(protocol), "{function:?} {protocol:?} {mode:?}");
                    let prefix = if protocol.version == Version::Fmi2 { "fmi2" } else { "fmi3" };
                    assert!(function.name(protocol.version).starts_with(prefix), "{function:?} {protocol:?}");
                }
            }
        }
    }
}
