//! Which function may be called when: the call-order rules of the FMI 2.0 standard (section 4.2.4), as one table.

/// Where an instance stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Mode {
    /// After fmi2Instantiate or fmi2Reset.
    Instantiated,
    /// Between fmi2EnterInitializationMode and fmi2ExitInitializationMode.
    Initialization,
    /// Ready for a communication step.
    Step,
    /// After a step that failed; the values are those before it.
    StepFailed,
    /// After fmi2Terminate.
    Terminated,
    /// After a panic inside a call; the values are not to be trusted.
    Broken,
}

impl Mode {
    /// All modes, in the order of their numbers.
    pub const ALL: [Mode; 6] =
        [Self::Instantiated, Self::Initialization, Self::Step, Self::StepFailed, Self::Terminated, Self::Broken];

    /// Name as it stands in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Instantiated => "Instantiated",
            Self::Initialization => "Initialization Mode",
            Self::Step => "Step Mode",
            Self::StepFailed => "Step Failed",
            Self::Terminated => "Terminated",
            Self::Broken => "Broken",
        }
    }

    const fn bit(self) -> u8 {
        1 << self as u8
    }
}

const I: u8 = Mode::Instantiated.bit();
const N: u8 = Mode::Initialization.bit();
const S: u8 = Mode::Step.bit();
const F: u8 = Mode::StepFailed.bit();
const T: u8 = Mode::Terminated.bit();
const B: u8 = Mode::Broken.bit();

macro_rules! calls {
    ($($function:ident $modes:expr;)*) => {
        /// A function of the C interface whose use depends on the mode.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[expect(missing_docs, reason = "the names are those of the standard without the prefix fmi2")]
        pub enum Function { $($function),* }

        impl Function {
            /// All functions of the table.
            pub const ALL: &[Function] = &[$(Self::$function),*];

            /// Name in the C interface.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$function => concat!("fmi2", stringify!($function))),* }
            }

            const fn modes(self) -> u8 {
                match self { $(Self::$function => $modes),* }
            }
        }
    };
}

calls! {
    SetDebugLogging             I | N | S | F | T;
    SetupExperiment             I;
    EnterInitializationMode     I;
    ExitInitializationMode          N;
    Terminate                           S | F;
    Reset                       I | N | S | F | T | B;
    GetReal                         N | S | F | T;
    GetInteger                      N | S | F | T;
    GetBoolean                      N | S | F | T;
    GetString                       N | S | F | T;
    SetReal                     I | N | S;
    SetInteger                  I | N | S;
    SetBoolean                  I | N | S;
    SetString                   I | N | S;
    GetFMUstate                 I | N | S     | T;
    SetFMUstate                 I | N | S | F | T;
    FreeFMUstate                I | N | S | F | T;
    SerializedFMUstateSize      I | N | S | F | T;
    SerializeFMUstate           I | N | S | F | T;
    DeSerializeFMUstate         I | N | S | F | T;
    GetDirectionalDerivative        N | S | F | T;
    SetRealInputDerivatives     I | N | S;
    GetRealOutputDerivatives            S | F | T;
    DoStep                              S;
    CancelStep                          S;
    GetStatus                           S | F | T;
    GetRealStatus                       S | F | T;
    GetIntegerStatus                    S | F | T;
    GetBooleanStatus                    S | F | T;
    GetStringStatus                     S | F | T;
}

impl Function {
    /// Whether the function may be called in `mode`.
    #[inline]
    pub const fn allowed(self, mode: Mode) -> bool {
        self.modes() & mode.bit() != 0
    }

    /// Rejects a call out of order.
    ///
    /// # Errors
    /// "called in X, allowed in Y".
    #[inline]
    pub fn check(self, mode: Mode) -> Result<(), String> {
        if self.allowed(mode) { Ok(()) } else { Err(self.out_of_order(mode)) }
    }

    #[cold]
    fn out_of_order(self, mode: Mode) -> String {
        let allowed: Vec<_> = Mode::ALL.into_iter().filter(|&m| self.allowed(m)).map(Mode::name).collect();
        format!("{} called in {}, allowed in {}", self.name(), mode.name(), allowed.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_says_where_it_was_called_and_where_it_may_be() {
        assert_eq!(
            Function::Terminate.check(Mode::Instantiated).unwrap_err(),
            "fmi2Terminate called in Instantiated, allowed in Step Mode, Step Failed"
        );
        assert_eq!(Function::Reset.check(Mode::Broken), Ok(()));
    }

    #[test]
    fn a_broken_instance_can_only_be_reset() {
        for &function in Function::ALL {
            assert_eq!(function.allowed(Mode::Broken), function == Function::Reset, "{}", function.name());
        }
    }
}
