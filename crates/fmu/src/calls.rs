//! The call-order rules of FMI 2.0 (sections 3.2.3 and 4.2.4) and FMI 3.0 (sections 2.3, 3.2, 4.2 and 5.2), as one
//! table.

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
    /// The importer activates the parts of a model with clocks (FMI 3.0).
    ScheduledExecution,
}

impl Interface {
    /// Name in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::CoSimulation => "co-simulation",
            Self::ModelExchange => "model exchange",
            Self::ScheduledExecution => "scheduled execution",
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
    /// True if it supports scheduled execution.
    pub scheduled_execution: bool,
}

impl Interfaces {
    /// No interface.
    pub const NONE: Self = Self { co_simulation: false, model_exchange: false, scheduled_execution: false };
    /// All interfaces.
    pub const ALL: Self = Self { co_simulation: true, model_exchange: true, scheduled_execution: true };

    /// Returns true if an interface is provided.
    pub const fn contains(self, interface: Interface) -> bool {
        match interface {
            Interface::CoSimulation => self.co_simulation,
            Interface::ModelExchange => self.model_exchange,
            Interface::ScheduledExecution => self.scheduled_execution,
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
    /// FMI 3.0, scheduled execution.
    pub const SE3: Self = Self { version: Version::Fmi3, interface: Interface::ScheduledExecution };
    /// All columns of the table.
    pub const ALL: [Self; 5] = [Self::CS2, Self::ME2, Self::CS3, Self::ME3, Self::SE3];

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
    /// Between instantiation and initialization: structural parameters may be set.
    Configuration,
    /// After the initialization: tunable structural parameters may be set.
    Reconfiguration,
    /// Scheduled execution: the importer activates parts of the model.
    ClockActivation,
    /// Scheduled execution: inside an activation, while the importer's `clockUpdate` runs.
    ClockUpdate,
}

impl Mode {
    /// All modes, ordered by their discriminants.
    pub const ALL: [Mode; 13] = [
        Self::Instantiated,
        Self::Initialization,
        Self::Step,
        Self::StepFailed,
        Self::Terminated,
        Self::Broken,
        Self::Event,
        Self::ContinuousTime,
        Self::IntermediateUpdate,
        Self::Configuration,
        Self::Reconfiguration,
        Self::ClockActivation,
        Self::ClockUpdate,
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
            Self::Configuration => "Configuration Mode",
            Self::Reconfiguration => "Reconfiguration Mode",
            Self::ClockActivation => "Clock Activation Mode",
            Self::ClockUpdate => "Clock Update Mode",
        }
    }

    /// Returns true if an instance with this protocol can be in the mode.
    pub const fn belongs_to(self, protocol: Protocol) -> bool {
        let is_fmi3 = matches!(protocol.version, Version::Fmi3);
        match (self, protocol.interface) {
            (Self::Step | Self::StepFailed, interface) => matches!(interface, Interface::CoSimulation),
            (Self::IntermediateUpdate, interface) => is_fmi3 && matches!(interface, Interface::CoSimulation),
            (Self::Event, Interface::CoSimulation) => is_fmi3,
            (Self::Event | Self::ContinuousTime, interface) => matches!(interface, Interface::ModelExchange),
            (Self::ClockActivation | Self::ClockUpdate, interface) => {
                matches!(interface, Interface::ScheduledExecution)
            }
            (Self::Configuration | Self::Reconfiguration, _) => is_fmi3,
            _ => true,
        }
    }

    /// True before the end of the initialization.
    pub(crate) const fn is_before_start(self) -> bool {
        matches!(self, Self::Instantiated | Self::Configuration | Self::Initialization)
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
const K: u16 = Mode::Configuration.bit();
const R: u16 = Mode::Reconfiguration.bit();
const A: u16 = Mode::ClockActivation.bit();
const U: u16 = Mode::ClockUpdate.bit();
/// Not a function of this interface.
const NO: u16 = 0;
// Modes of FMI 3.0 in which values are read and set, in co-simulation, model exchange and scheduled execution.
const CS_GET: u16 = I | N | S | E | M | F | T;
const ME_GET: u16 = I | N | E | C | T;
const SE_GET: u16 = I | N | A | T;
const CS_SET: u16 = I | N | S | E | M | K | R;
const ME_SET: u16 = I | N | E | K | R;
const SE_SET: u16 = I | N | A | K | R;

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
            pub fn name(self, version: Version) -> &'static str {
                // One text per version: a table of names needs more memory in the library, and a `match` more code.
                let names = [concat!($($two, " ",)*), concat!($($three, " ",)*)];
                names[version as usize].split(' ').nth(self as usize).unwrap_or_default()
            }

            /// True if the function reads values in FMI 3.0.
            pub(crate) const fn reads(self) -> bool {
                matches!(match self { $(Self::$function => $three),* }.as_bytes(), [_, _, _, _, b'G', b'e', b't', ..])
            }

            const fn modes(self) -> [u16; 5] {
                match self { $(Self::$function => [$($modes),*]),* }
            }
        }
    };
}

calls! {
    //                                                                        FMI 2.0: co-simulation, model exchange,
    //                                                                        FMI 3.0: co-simulation, model exchange, scheduled execution
    SetDebugLogging "fmi2SetDebugLogging" "fmi3SetDebugLogging":              I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T|K|R, I|N|E|C|T|K|R, I|N|A|T|K|R;
    SetupExperiment "fmi2SetupExperiment" "":                                 I, I, NO, NO, NO;
    EnterInitializationMode "fmi2EnterInitializationMode" "fmi3EnterInitializationMode": I, I, I, I, I;
    ExitInitializationMode "fmi2ExitInitializationMode" "fmi3ExitInitializationMode": N, N, N, N, N;
    Terminate "fmi2Terminate" "fmi3Terminate":                                S|F, E|C, S|E|F, E|C, A;
    Reset "fmi2Reset" "fmi3Reset":                                            I|N|S|F|T|B, I|N|E|C|T|B, I|N|S|E|F|T|B|K|R, I|N|E|C|T|B|K|R, I|N|A|T|B|K|R;
    GetReal "fmi2GetReal" "fmi3GetFloat64":                                   N|S|F|T, N|E|C|T, CS_GET, ME_GET, SE_GET;
    GetInteger "fmi2GetInteger" "fmi3GetInt32":                               N|S|F|T, N|E|C|T, CS_GET, ME_GET, SE_GET;
    GetInt64 "" "fmi3GetInt64":                                               NO, NO, CS_GET, ME_GET, SE_GET;
    GetBoolean "fmi2GetBoolean" "fmi3GetBoolean":                             N|S|F|T, N|E|C|T, CS_GET, ME_GET, SE_GET;
    GetString "fmi2GetString" "fmi3GetString":                                N|S|F|T, N|E|C|T, CS_GET, ME_GET, SE_GET;
    SetReal "fmi2SetReal" "fmi3SetFloat64":                                   I|N|S, I|N|E|C, CS_SET & !(K|R), ME_SET & !(K|R) | C, SE_SET & !(K|R);
    SetInteger "fmi2SetInteger" "fmi3SetInt32":                               I|N|S, I|N|E, CS_SET, ME_SET, SE_SET;
    SetInt64 "" "fmi3SetInt64":                                               NO, NO, CS_SET, ME_SET, SE_SET;
    SetBoolean "fmi2SetBoolean" "fmi3SetBoolean":                             I|N|S, I|N|E, CS_SET, ME_SET, SE_SET;
    SetString "fmi2SetString" "fmi3SetString":                                I|N|S, I|N|E, CS_SET, ME_SET, SE_SET;
    GetFMUstate "fmi2GetFMUstate" "fmi3GetFMUState":                          I|N|S|T, I|N|E|C|T, I|N|S|E|T|K|R, I|N|E|C|T|K|R, I|N|A|T|K|R;
    SetFMUstate "fmi2SetFMUstate" "fmi3SetFMUState":                          I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T|K|R, I|N|E|C|T|K|R, I|N|A|T|K|R;
    FreeFMUstate "fmi2FreeFMUstate" "fmi3FreeFMUState":                       I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T|K|R, I|N|E|C|T|K|R, I|N|A|T|K|R;
    SerializedFMUstateSize "fmi2SerializedFMUstateSize" "fmi3SerializedFMUStateSize": I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T|K|R, I|N|E|C|T|K|R, I|N|A|T|K|R;
    SerializeFMUstate "fmi2SerializeFMUstate" "fmi3SerializeFMUState":        I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T|K|R, I|N|E|C|T|K|R, I|N|A|T|K|R;
    DeSerializeFMUstate "fmi2DeSerializeFMUstate" "fmi3DeserializeFMUState":  I|N|S|F|T, I|N|E|C|T, I|N|S|E|F|T|K|R, I|N|E|C|T|K|R, I|N|A|T|K|R;
    GetDirectionalDerivative "fmi2GetDirectionalDerivative" "fmi3GetDirectionalDerivative": N|S|F|T, N|E|C|T, N|S|E|F|T, N|E|C|T, N|A|T;
    GetAdjointDerivative "" "fmi3GetAdjointDerivative":                       NO, NO, N|S|E|F|T, N|E|C|T, N|A|T;
    // Model exchange, and events.
    EnterEventMode "fmi2EnterEventMode" "fmi3EnterEventMode":                 NO, C|E, S, C|E, NO;
    NewDiscreteStates "fmi2NewDiscreteStates" "fmi3UpdateDiscreteStates":     NO, E, E, E, NO;
    EvaluateDiscreteStates "" "fmi3EvaluateDiscreteStates":                   NO, NO, E, E, NO;
    EnterContinuousTimeMode "fmi2EnterContinuousTimeMode" "fmi3EnterContinuousTimeMode": NO, E, NO, E, NO;
    CompletedIntegratorStep "fmi2CompletedIntegratorStep" "fmi3CompletedIntegratorStep": NO, C, NO, C, NO;
    SetTime "fmi2SetTime" "fmi3SetTime":                                      NO, E|C, NO, E|C, NO;
    SetContinuousStates "fmi2SetContinuousStates" "fmi3SetContinuousStates":  NO, C, NO, C, NO;
    GetDerivatives "fmi2GetDerivatives" "fmi3GetContinuousStateDerivatives":  NO, N|E|C|T, NO, N|E|C|T, NO;
    GetEventIndicators "fmi2GetEventIndicators" "fmi3GetEventIndicators":     NO, N|E|C|T, NO, N|E|C|T, NO;
    GetContinuousStates "fmi2GetContinuousStates" "fmi3GetContinuousStates":  NO, N|E|C|T, NO, N|E|C|T, NO;
    GetNominalsOfContinuousStates "fmi2GetNominalsOfContinuousStates" "fmi3GetNominalsOfContinuousStates": NO, I|N|E|C|T, NO, I|N|E|C|T, NO;
    GetNumberOfEventIndicators "" "fmi3GetNumberOfEventIndicators":           NO, NO, NO, I|N|E|C|T, NO;
    GetNumberOfContinuousStates "" "fmi3GetNumberOfContinuousStates":         NO, NO, NO, I|N|E|C|T, NO;
    // Co-simulation.
    SetRealInputDerivatives "fmi2SetRealInputDerivatives" "":                 I|N|S, NO, NO, NO, NO;
    GetRealOutputDerivatives "fmi2GetRealOutputDerivatives" "fmi3GetOutputDerivatives": S|F|T, NO, S|M|T, NO, NO;
    EnterStepMode "" "fmi3EnterStepMode":                                     NO, NO, E, NO, NO;
    DoStep "fmi2DoStep" "fmi3DoStep":                                         S, NO, S, NO, NO;
    CancelStep "fmi2CancelStep" "":                                           S, NO, NO, NO, NO;
    GetStatus "fmi2GetStatus" "":                                             S|F|T, NO, NO, NO, NO;
    GetRealStatus "fmi2GetRealStatus" "":                                     S|F|T, NO, NO, NO, NO;
    GetIntegerStatus "fmi2GetIntegerStatus" "":                               S|F|T, NO, NO, NO, NO;
    GetBooleanStatus "fmi2GetBooleanStatus" "":                               S|F|T, NO, NO, NO, NO;
    GetStringStatus "fmi2GetStringStatus" "":                                 S|F|T, NO, NO, NO, NO;
    GetNumberOfVariableDependencies "" "fmi3GetNumberOfVariableDependencies": NO, NO, CS_GET, ME_GET, SE_GET|U;
    GetVariableDependencies "" "fmi3GetVariableDependencies":                 NO, NO, CS_GET, ME_GET, SE_GET|U;
    // FMI 3.0: structural parameters, types that FMI 2.0 does not have, and clocks.
    EnterConfigurationMode "" "fmi3EnterConfigurationMode":                   NO, NO, I|S, I|E, I|A;
    ExitConfigurationMode "" "fmi3ExitConfigurationMode":                     NO, NO, K|R, K|R, K|R;
    GetFloat32 "" "fmi3GetFloat32": NO, NO, CS_GET, ME_GET, SE_GET;
    GetInt8 "" "fmi3GetInt8": NO, NO, CS_GET, ME_GET, SE_GET;
    GetUInt8 "" "fmi3GetUInt8": NO, NO, CS_GET, ME_GET, SE_GET;
    GetInt16 "" "fmi3GetInt16": NO, NO, CS_GET, ME_GET, SE_GET;
    GetUInt16 "" "fmi3GetUInt16": NO, NO, CS_GET, ME_GET, SE_GET;
    GetUInt32 "" "fmi3GetUInt32": NO, NO, CS_GET, ME_GET, SE_GET;
    GetUInt64 "" "fmi3GetUInt64": NO, NO, CS_GET, ME_GET, SE_GET;
    GetBinary "" "fmi3GetBinary": NO, NO, CS_GET, ME_GET, SE_GET;
    GetClock "" "fmi3GetClock": NO, NO, E, E, A|U;
    SetFloat32 "" "fmi3SetFloat32": NO, NO, CS_SET, ME_SET|C, SE_SET;
    SetInt8 "" "fmi3SetInt8": NO, NO, CS_SET, ME_SET, SE_SET;
    SetUInt8 "" "fmi3SetUInt8": NO, NO, CS_SET, ME_SET, SE_SET;
    SetInt16 "" "fmi3SetInt16": NO, NO, CS_SET, ME_SET, SE_SET;
    SetUInt16 "" "fmi3SetUInt16": NO, NO, CS_SET, ME_SET, SE_SET;
    SetUInt32 "" "fmi3SetUInt32": NO, NO, CS_SET, ME_SET, SE_SET;
    SetUInt64 "" "fmi3SetUInt64": NO, NO, CS_SET, ME_SET, SE_SET;
    SetBinary "" "fmi3SetBinary": NO, NO, CS_SET, ME_SET, SE_SET;
    SetClock "" "fmi3SetClock": NO, NO, E, E, NO;
    GetIntervalDecimal "" "fmi3GetIntervalDecimal": NO, NO, N|E, N|E, N|A|U;
    GetIntervalFraction "" "fmi3GetIntervalFraction": NO, NO, N|E, N|E, N|A|U;
    GetShiftDecimal "" "fmi3GetShiftDecimal": NO, NO, N, N, N;
    GetShiftFraction "" "fmi3GetShiftFraction": NO, NO, N, N, N;
    SetIntervalDecimal "" "fmi3SetIntervalDecimal": NO, NO, N|E, N|E, N|A;
    SetIntervalFraction "" "fmi3SetIntervalFraction": NO, NO, N|E, N|E, N|A;
    SetShiftDecimal "" "fmi3SetShiftDecimal": NO, NO, N, N, N;
    SetShiftFraction "" "fmi3SetShiftFraction": NO, NO, N, N, N;
    ActivateModelPartition "" "fmi3ActivateModelPartition": NO, NO, NO, NO, A;
}

impl Function {
    /// Returns true if the function may be called in `mode`.
    pub fn allowed(self, protocol: Protocol, mode: Mode) -> bool {
        ALLOWED[protocol.column()][mode as usize] >> self as u32 & 1 != 0
    }

    /// Returns the error message for a function that the mode does not allow: "called in X, allowed in Y".
    #[cold]
    pub fn out_of_order(self, protocol: Protocol, mode: Mode) -> String {
        let name = self.name(protocol.version);
        let allowed = Mode::ALL.iter().filter(|mode| self.allowed(protocol, **mode));
        let allowed: Vec<_> = allowed.map(|mode| mode.name()).collect();
        if allowed.is_empty() {
            return format!("{name} is not a function of {}", protocol.interface.name());
        }
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
        if function.modes()[column] & Mode::ALL[mode].bit() != 0 {
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
                    let expected = function.modes()[protocol.column()] & mode.bit() != 0;
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

    /// FMI 3.0.2, sections 2.3 (Configuration Mode and Reconfiguration Mode) and 5.2 (Clock Update Mode), and the tables
    /// of the modes from which they are entered. Logging, saved states and reset are always possible.
    #[test]
    fn modes_for_one_purpose_allow_only_its_functions() {
        let names = |protocol, mode| -> Vec<_> {
            let functions = Function::ALL.iter().filter(|function| function.allowed(protocol, mode));
            functions.map(|function| function.name(Version::Fmi3)).collect()
        };
        for protocol in [Protocol::CS3, Protocol::ME3, Protocol::SE3] {
            for mode in [Mode::Configuration, Mode::Reconfiguration] {
                let is_of_states = |name: &&str| name.ends_with("FMUState") || name.ends_with("FMUStateSize");
                let states = Function::ALL.iter().map(|function| function.name(Version::Fmi3)).filter(is_of_states);
                let setters = Function::ALL.iter().map(|function| function.name(Version::Fmi3)).filter(|name| {
                    let value = name.strip_prefix("fmi3Set").unwrap_or("Time");
                    // Structural parameters are integers or Booleans.
                    !["Time", "Clock", "FMUState", "ContinuousStates", "DebugLogging", "Float64"].contains(&value)
                        && !["Interval", "Shift"].iter().any(|word| value.starts_with(word))
                });
                let others = ["fmi3SetDebugLogging", "fmi3Reset", "fmi3ExitConfigurationMode"];
                let mut expected: Vec<_> = setters.chain(states).chain(others).collect();
                let mut found = names(protocol, mode);
                expected.sort_unstable();
                found.sort_unstable();
                assert_eq!(found, expected, "{protocol:?} {mode:?}");
            }
            let from: Vec<_> = Mode::ALL
                .into_iter()
                .filter(|mode| Function::EnterConfigurationMode.allowed(protocol, *mode))
                .collect();
            let running = match protocol.interface {
                Interface::CoSimulation => Mode::Step,
                Interface::ModelExchange => Mode::Event,
                Interface::ScheduledExecution => Mode::ClockActivation,
            };
            assert_eq!(from, [Mode::Instantiated, running]);
        }
        assert_eq!(
            names(Protocol::SE3, Mode::ClockUpdate),
            [
                "fmi3GetNumberOfVariableDependencies",
                "fmi3GetVariableDependencies",
                "fmi3GetClock",
                "fmi3GetIntervalDecimal",
                "fmi3GetIntervalFraction"
            ]
        );
    }
}
