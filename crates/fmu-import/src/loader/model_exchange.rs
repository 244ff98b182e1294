//! Model exchange: the importer integrates the states.
//!
//! After [`Instance::exit_initialization_mode`] an instance is in Event Mode. Call [`Instance::new_discrete_states`]
//! until no further update is needed, then [`Instance::enter_continuous_time_mode`].

use super::calls::Function;
use super::error::{CallError, CallProblem};
use super::functions::{Functions, v3};
use super::instance::Instance;
use crate::c_api::v3::GetNumber;
use crate::c_api::{self, EventInfo, GetNumbers};

/// Bits of a NaN that no FMU writes.
const UNWRITTEN: u64 = 0x7ff8_dead_0000_beef;

/// Result of [`Instance::new_discrete_states`].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct EventUpdate {
    /// Discrete states must be updated again.
    pub is_needed_again: bool,
    /// The FMU requests the end of the simulation.
    pub terminates: bool,
    /// Continuous states have changed.
    pub states_changed: bool,
    /// Time of the next time event, s.
    pub next_event: Option<f64>,
}

/// Result of [`Instance::completed_integrator_step`].
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct CompletedStep {
    /// The FMU requests Event Mode.
    pub enters_event_mode: bool,
    /// The FMU requests the end of the simulation.
    pub terminates: bool,
}

impl Instance {
    /// `fmi2SetTime`; the time is in s.
    pub fn set_time(&mut self, time: f64) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_optional(Function::SetTime, Functions::set_time, |f, c| unsafe { f(c, time) })
    }

    /// Number of continuous states in the description, including array elements.
    pub fn number_of_states(&self) -> usize {
        self.signature().states
    }

    /// Number of event indicators in the description, including array elements.
    pub fn number_of_event_indicators(&self) -> usize {
        self.signature().event_indicators
    }

    /// `fmi3GetNumberOfContinuousStates`.
    pub fn get_number_of_states(&mut self) -> Result<usize, CallError> {
        self.get_number(Function::GetNumberOfStates, |f| f.get_number_of_states)
    }

    /// `fmi3GetNumberOfEventIndicators`.
    pub fn get_number_of_event_indicators(&mut self) -> Result<usize, CallError> {
        self.get_number(Function::GetNumberOfEventIndicators, |f| f.get_number_of_event_indicators)
    }

    fn get_number(
        &mut self,
        function: Function,
        select: impl FnOnce(&v3::Functions) -> Option<GetNumber>,
    ) -> Result<usize, CallError> {
        let mut number = 0;
        // SAFETY: live instance; the number is written through a valid pointer.
        self.call_v3(function, |f, c| unsafe { Some(select(f)?(c, &raw mut number)) })?;
        Ok(number)
    }

    /// `fmi2SetContinuousStates`.
    pub fn set_continuous_states(&mut self, states: &[f64]) -> Result<(), CallError> {
        const NAME: Function = Function::SetContinuousStates;
        self.check_number(NAME, states.len(), self.number_of_states())?;
        let spare = [0.0];
        let values = if states.is_empty() { &spare[..] } else { states };
        // SAFETY: live instance; the array has the stated length, at least one element.
        self.call_optional(NAME, Functions::set_continuous_states, |f, c| unsafe {
            f(c, values.as_ptr(), states.len())
        })
    }

    /// `fmi2GetContinuousStates`.
    pub fn get_continuous_states(&mut self, states: &mut [f64]) -> Result<(), CallError> {
        let number = self.number_of_states();
        self.get_numbers(Function::GetContinuousStates, Functions::get_continuous_states, states, number)
    }

    /// `fmi2GetDerivatives`, `fmi3GetContinuousStateDerivatives`.
    pub fn get_derivatives(&mut self, derivatives: &mut [f64]) -> Result<(), CallError> {
        let number = self.number_of_states();
        self.get_numbers(Function::GetDerivatives, Functions::get_derivatives, derivatives, number)
    }

    /// `fmi2GetEventIndicators`.
    pub fn get_event_indicators(&mut self, indicators: &mut [f64]) -> Result<(), CallError> {
        let number = self.number_of_event_indicators();
        self.get_numbers(Function::GetEventIndicators, Functions::get_event_indicators, indicators, number)
    }

    /// `fmi2GetNominalsOfContinuousStates`.
    pub fn get_nominals(&mut self, nominals: &mut [f64]) -> Result<(), CallError> {
        let number = self.number_of_states();
        self.get_numbers(Function::GetNominals, Functions::get_nominals, nominals, number)
    }

    /// `fmi2EnterEventMode`.
    pub fn enter_event_mode(&mut self) -> Result<(), CallError> {
        // SAFETY: live instance.
        self.call_optional(Function::EnterEventMode, Functions::enter_event_mode, |f, c| unsafe { f(c) })
    }

    /// `fmi2EnterContinuousTimeMode`.
    pub fn enter_continuous_time_mode(&mut self) -> Result<(), CallError> {
        const NAME: Function = Function::EnterContinuousTimeMode;
        // SAFETY: live instance.
        self.call_optional(NAME, Functions::enter_continuous_time_mode, |f, c| unsafe { f(c) })
    }

    /// `fmi2NewDiscreteStates`, `fmi3UpdateDiscreteStates`.
    pub fn new_discrete_states(&mut self) -> Result<EventUpdate, CallError> {
        let mut info = EventInfo::default();
        let (mut flags, mut time) = ([0; 5], 0.0);
        // SAFETY: live instance; the outcome is written through valid pointers.
        self.call_present(Function::NewDiscreteStates, |f, c| unsafe {
            match f {
                Functions::V2(f) => Some(f.new_discrete_states?(c, &raw mut info)),
                Functions::V3(f) => {
                    let [needed, terminate, nominals, states, defined] = &mut flags;
                    let update = f.update_discrete_states.or(f.update_event)?;
                    Some(update(c, needed, terminate, nominals, states, defined, &raw mut time))
                }
            }
        })?;
        let [needed, terminate, _, states, defined] = flags.map(|flag| flag != 0);
        let is_next = defined || info.next_event_time_defined != 0;
        Ok(EventUpdate {
            is_needed_again: needed || info.new_discrete_states_needed != 0,
            terminates: terminate || info.terminate_simulation != 0,
            states_changed: states || info.values_of_continuous_states_changed != 0,
            // The FMU wrote only one of these times; the other is 0.
            next_event: is_next.then_some(time + info.next_event_time),
        })
    }

    /// `fmi2CompletedIntegratorStep`. No earlier state may be restored afterwards.
    pub fn completed_integrator_step(&mut self) -> Result<CompletedStep, CallError> {
        let (mut old, mut new) = ([c_api::FALSE; 2], [0; 2]);
        // SAFETY: live instance; the outcome is written through valid pointers.
        self.call_present(Function::CompletedIntegratorStep, |f, c| unsafe {
            match f {
                Functions::V2(f) => {
                    let [enter, terminate] = &mut old;
                    Some(f.completed_integrator_step?(c, c_api::TRUE, enter, terminate))
                }
                Functions::V3(f) => {
                    let [enter, terminate] = &mut new;
                    Some(f.completed_integrator_step?(c, true, enter, terminate))
                }
            }
        })?;
        Ok(CompletedStep { enters_event_mode: old[0] != 0 || new[0] != 0, terminates: old[1] != 0 || new[1] != 0 })
    }

    fn get_numbers(
        &mut self,
        function: Function,
        select: impl FnOnce(&Functions) -> Option<GetNumbers>,
        numbers: &mut [f64],
        expected: usize,
    ) -> Result<(), CallError> {
        self.check_number(function, numbers.len(), expected)?;
        if numbers.is_empty() {
            // FMUs from some tools write to the first element of an empty array.
            let mut spare = f64::from_bits(UNWRITTEN);
            // SAFETY: live instance; the array has more elements than stated.
            let result = self.call_optional(function, select, |f, c| unsafe { f(c, &raw mut spare, 0) });
            if spare.to_bits() != UNWRITTEN {
                self.overrun = Some(function);
            }
            return result;
        }
        // SAFETY: live instance; the array has the stated length.
        self.call_optional(function, select, |f, c| unsafe { f(c, numbers.as_mut_ptr(), numbers.len()) })
    }

    /// The last function that wrote to an array without elements. Here, such an array has a spare element; in another
    /// importer, the FMU would overwrite other memory or crash.
    pub fn overrun(&self) -> Option<&'static str> {
        self.overrun.map(|function| function.name(self.fmi()))
    }

    fn check_number(&mut self, function: Function, found: usize, expected: usize) -> Result<(), CallError> {
        if found == expected {
            return Ok(());
        }
        let reason = "the number of values must equal the number of states or event indicators";
        Err(self.failure(function, CallProblem::Arguments(reason)))
    }
}
