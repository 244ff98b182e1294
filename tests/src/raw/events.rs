//! The functions of model exchange and of Event Mode, and those that only FMI 3.0 has.

use super::{RawInstance, pointer, pointer_mut};
use fmu_import::c_api::{self, Component, EventInfo, RawStatus, Reference, v3};
use fmu_import::description::FmiVersion;
use std::ffi::c_int;
use std::ptr;

/// The flags of fmi2NewDiscreteStates and fmi3UpdateDiscreteStates, in their order, and the time of the next event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UpdateFlags {
    /// In this order: a new update is needed, the simulation is to be terminated, nominal values changed, states
    /// changed, the time of the next event is defined.
    pub flags: [c_int; 5],
    /// nextEventTime.
    pub next_event_time: f64,
}

/// Arrays of a directional or adjoint derivative of FMI 3.0, each with its number; `None` is a null pointer.
#[derive(Debug)]
pub struct DerivativeArrays<'a> {
    /// unknowns.
    pub unknowns: (Option<&'a [Reference]>, usize),
    /// knowns.
    pub knowns: (Option<&'a [Reference]>, usize),
    /// seed.
    pub seed: (Option<&'a [f64]>, usize),
    /// sensitivity.
    pub result: (Option<&'a mut [f64]>, usize),
}

/// Two flags of fmi2CompletedIntegratorStep; `None` is a null pointer.
type Flags<'a> = Option<&'a mut [c_int; 2]>;

/// A pointer to the byte, or null.
fn byte(value: Option<&mut u8>) -> *mut u8 {
    value.map_or(ptr::null_mut(), |value| &raw mut *value)
}

impl RawInstance<'_> {
    fn is_fmi2(&self) -> bool {
        self.raw.version == FmiVersion::V2
    }

    /// fmi2SetTime.
    pub fn set_time(&self, time: f64) -> RawStatus {
        let function: c_api::SetTime = self.raw.function("fmi2SetTime");
        // SAFETY: a live instance or null.
        unsafe { function(self.component, time) }
    }

    /// fmi2SetContinuousStates.
    pub fn set_continuous_states(&self, values: Option<&[f64]>, count: usize) -> RawStatus {
        let function: c_api::SetNumbers = self.raw.function("fmi2SetContinuousStates");
        // SAFETY: an array of the stated length, or null.
        unsafe { function(self.component, pointer(values, count), count) }
    }

    /// fmi2GetDerivatives, fmi2GetContinuousStates, fmi2GetEventIndicators or fmi2GetNominalsOfContinuousStates.
    pub fn numbers(&self, name: &str, values: Option<&mut [f64]>, count: usize) -> RawStatus {
        let function: c_api::GetNumbers = self.raw.function(name);
        // SAFETY: as above.
        unsafe { function(self.component, pointer_mut(values, count), count) }
    }

    /// fmi3GetNumberOfEventIndicators or fmi3GetNumberOfContinuousStates; `None` is a null pointer.
    pub fn number_of(&self, name: &str, number: Option<&mut usize>) -> RawStatus {
        let function: v3::GetNumber = self.raw.function(name);
        // SAFETY: a number to write to, or null.
        unsafe { function(self.component, number.map_or(ptr::null_mut(), |number| &raw mut *number)) }
    }

    /// fmi2NewDiscreteStates, fmi3UpdateDiscreteStates; `None` is a null pointer, in FMI 3.0 for the last argument.
    pub fn update(&self, update: Option<&mut UpdateFlags>) -> RawStatus {
        if self.is_fmi2() {
            let function: c_api::NewDiscreteStates = self.raw.function("fmi2NewDiscreteStates");
            let Some(update) = update else {
                // SAFETY: null is to be rejected.
                return unsafe { function(self.component, ptr::null_mut()) };
            };
            let [needed, terminate, nominals, states, defined] = update.flags;
            let mut info = EventInfo {
                new_discrete_states_needed: needed,
                terminate_simulation: terminate,
                nominals_of_continuous_states_changed: nominals,
                values_of_continuous_states_changed: states,
                next_event_time_defined: defined,
                next_event_time: update.next_event_time,
            };
            // SAFETY: a struct to write to.
            let status = unsafe { function(self.component, &raw mut info) };
            update.flags = [
                info.new_discrete_states_needed,
                info.terminate_simulation,
                info.nominals_of_continuous_states_changed,
                info.values_of_continuous_states_changed,
                info.next_event_time_defined,
            ];
            update.next_event_time = info.next_event_time;
            return status;
        }
        let function: v3::UpdateDiscreteStates = self.raw.function("fmi3UpdateDiscreteStates");
        let mut bytes = update.as_ref().map_or([0; 5], |update| update.flags.map(|flag| flag as u8));
        let [needed, terminate, nominals, states, defined] = &mut bytes;
        let mut update = update;
        let time = update.as_mut().map_or(ptr::null_mut(), |update| &raw mut update.next_event_time);
        // SAFETY: values to write to, or null.
        let status = unsafe { function(self.component, needed, terminate, nominals, states, defined, time) };
        if let Some(update) = update {
            update.flags = bytes.map(c_int::from);
        }
        status
    }

    /// fmi2CompletedIntegratorStep: enterEventMode and terminateSimulation.
    pub fn completed_integrator_step(&self, flags: Flags<'_>) -> RawStatus {
        if self.is_fmi2() {
            let function: c_api::CompletedIntegratorStep = self.raw.function("fmi2CompletedIntegratorStep");
            let [event, end] = flags.map_or([ptr::null_mut(); 2], |[event, end]| [&raw mut *event, &raw mut *end]);
            // SAFETY: values to write to, or null.
            return unsafe { function(self.component, 1, event, end) };
        }
        let function: v3::CompletedIntegratorStep = self.raw.function("fmi3CompletedIntegratorStep");
        let mut bytes = flags.as_ref().map_or([0; 2], |flags| flags.map(|flag| flag as u8));
        let [event, end] = &mut bytes;
        let are_there = flags.is_some();
        // SAFETY: as above.
        let status =
            unsafe { function(self.component, true, byte(are_there.then_some(event)), byte(are_there.then_some(end))) };
        if let Some(flags) = flags {
            *flags = bytes.map(c_int::from);
        }
        status
    }

    /// fmi3EnterInitializationMode.
    pub fn enter_initialization(&self, tolerance: (bool, f64), start: f64, stop: (bool, f64)) -> RawStatus {
        let function: v3::EnterInitializationMode = self.raw.function("fmi3EnterInitializationMode");
        // SAFETY: a live instance or null.
        unsafe { function(self.component, tolerance.0, tolerance.1, start, stop.0, stop.1) }
    }

    /// fmi3DoStep: flags eventHandlingNeeded, terminateSimulation and earlyReturn, and lastSuccessfulTime; `None` is a null
    /// pointer for each.
    pub fn step_with_events(
        &self,
        time: f64,
        step: f64,
        flags: Option<&mut [u8; 3]>,
        last: Option<&mut f64>,
    ) -> RawStatus {
        let function: v3::DoStep = self.raw.function("fmi3DoStep");
        let [event, terminate, early] = flags.map_or([ptr::null_mut(); 3], |[event, terminate, early]| {
            [&raw mut *event, &raw mut *terminate, &raw mut *early]
        });
        let last = last.map_or(ptr::null_mut(), |last| &raw mut *last);
        // SAFETY: values to write to, or null.
        unsafe { function(self.component, time, step, true, event, terminate, early, last) }
    }

    /// fmi3GetDirectionalDerivative or fmi3GetAdjointDerivative.
    pub fn derivative(&self, name: &str, arrays: DerivativeArrays<'_>) -> RawStatus {
        let function: v3::GetDerivative = self.raw.function(name);
        let DerivativeArrays { unknowns, knowns, seed, result } = arrays;
        // SAFETY: arrays of the stated lengths, or null.
        unsafe {
            function(
                self.component,
                pointer(unknowns.0, unknowns.1),
                unknowns.1,
                pointer(knowns.0, knowns.1),
                knowns.1,
                pointer(seed.0, seed.1),
                seed.1,
                pointer_mut(result.0, result.1),
                result.1,
            )
        }
    }

    /// fmi3GetOutputDerivatives: references, orders, values, all of one length.
    pub fn output_derivatives(&self, references: &[Reference], orders: &[c_int], values: &mut [f64]) -> RawStatus {
        let function: v3::GetOutputDerivatives = self.raw.function("fmi3GetOutputDerivatives");
        let count = references.len();
        assert!(count <= orders.len() && count <= values.len(), "an array is too short");
        // SAFETY: arrays of the stated length.
        unsafe {
            function(self.component, references.as_ptr(), count, orders.as_ptr(), values.as_mut_ptr(), values.len())
        }
    }

    /// fmi3GetNumberOfVariableDependencies; `None` is a null pointer.
    pub fn number_of_dependencies(&self, reference: Reference, number: Option<&mut usize>) -> RawStatus {
        type GetNumberOfDependencies = unsafe extern "C" fn(Component, Reference, *mut usize) -> RawStatus;
        let function: GetNumberOfDependencies = self.raw.function("fmi3GetNumberOfVariableDependencies");
        // SAFETY: a number to write to, or null.
        unsafe { function(self.component, reference, number.map_or(ptr::null_mut(), |number| &raw mut *number)) }
    }

    /// fmi3GetVariableDependencies with arrays of `count` elements. Also returns the value references that it wrote.
    pub fn dependencies(&self, reference: Reference, count: usize) -> (RawStatus, Vec<Reference>) {
        type GetDependencies = unsafe extern "C" fn(
            Component,
            Reference,
            *mut usize,
            *mut Reference,
            *mut usize,
            *mut c_int,
            usize,
        ) -> RawStatus;
        let function: GetDependencies = self.raw.function("fmi3GetVariableDependencies");
        let (mut elements, mut of, mut kinds) = (vec![0; count], vec![0; count], vec![0; count]);
        let mut on = vec![Reference::MAX; count];
        let (elements, of, kinds) = (elements.as_mut_ptr(), of.as_mut_ptr(), kinds.as_mut_ptr());
        // SAFETY: arrays of the stated length.
        let status = unsafe { function(self.component, reference, elements, on.as_mut_ptr(), of, kinds, count) };
        (status, on)
    }
}
