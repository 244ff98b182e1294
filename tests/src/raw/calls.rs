//! The functions that FMI 2.0 has for co-simulation, and those that both interfaces and versions share.

use super::{Element, Entry, LogBook, OK, RawInstance, RawState, Text, pointer, pointer_mut};
use fmu_import::c_api::{self, RawStatus, Reference, v3};
use fmu_import::description::FmiVersion;
use std::ffi::{CStr, c_char, c_int};
use std::ptr;

impl RawInstance<'_> {
    /// fmi2Get of a type: references, number of both arrays, values.
    pub fn get<T: Element>(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        values: Option<&mut [T]>,
    ) -> RawStatus {
        self.get_counted(references, count, values, count)
    }

    /// fmi3Get of a type: references, their number, values, their number; the last has no meaning in FMI 2.0.
    pub fn get_counted<T: Element>(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        values: Option<&mut [T]>,
        value_count: usize,
    ) -> RawStatus {
        // SAFETY: arrays of the stated lengths, or null.
        unsafe {
            if self.raw.version == FmiVersion::V2 {
                let get: c_api::Get<T> = self.raw.function(&format!("fmi2Get{}", T::NAMES[0]));
                return get(self.component, pointer(references, count), count, pointer_mut(values, count));
            }
            let get: v3::Get<T> = self.raw.function(&format!("fmi3Get{}", T::NAMES[1]));
            let values = pointer_mut(values, value_count);
            get(self.component, pointer(references, count), count, values, value_count)
        }
    }

    /// fmi2Set of a type: references, number of both arrays, values.
    pub fn set<T: Element>(&self, references: Option<&[Reference]>, count: usize, values: Option<&[T]>) -> RawStatus {
        self.set_counted(references, count, values, count)
    }

    /// fmi3Set of a type: references, their number, values, their number; the last has no meaning in FMI 2.0.
    pub fn set_counted<T: Element>(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        values: Option<&[T]>,
        value_count: usize,
    ) -> RawStatus {
        // SAFETY: arrays of the stated lengths, or null; strings end with a zero, or are null.
        unsafe {
            if self.raw.version == FmiVersion::V2 {
                let set: c_api::Set<T> = self.raw.function(&format!("fmi2Set{}", T::NAMES[0]));
                return set(self.component, pointer(references, count), count, pointer(values, count));
            }
            let set: v3::Set<T> = self.raw.function(&format!("fmi3Set{}", T::NAMES[1]));
            set(self.component, pointer(references, count), count, pointer(values, value_count), value_count)
        }
    }

    /// Calls a function whose only argument is the instance.
    pub fn transition(&self, name: &str) -> RawStatus {
        let function: c_api::Transition = self.raw.function(name);
        // SAFETY: a live instance or null.
        unsafe { function(self.component) }
    }

    /// fmi2SetupExperiment without a tolerance and stop time.
    pub fn setup_experiment(&self, start: f64) -> RawStatus {
        let function: c_api::SetupExperiment = self.raw.function("fmi2SetupExperiment");
        // SAFETY: a live instance or null.
        unsafe { function(self.component, 0, 0.0, start, 0, 0.0) }
    }

    /// fmi2SetupExperiment with all arguments: tolerance with its flag, start, stop time with its flag.
    pub fn setup_experiment_with(&self, tolerance: (c_int, f64), start: f64, stop: (c_int, f64)) -> RawStatus {
        let function: c_api::SetupExperiment = self.raw.function("fmi2SetupExperiment");
        // SAFETY: a live instance or null.
        unsafe { function(self.component, tolerance.0, tolerance.1, start, stop.0, stop.1) }
    }

    /// fmi2DoStep.
    pub fn do_step(&self, time: f64, step: f64) -> RawStatus {
        let function: c_api::DoStep = self.raw.function("fmi2DoStep");
        // SAFETY: a live instance or null.
        unsafe { function(self.component, time, step, 1) }
    }

    /// fmi2SetDebugLogging.
    pub fn set_debug_logging(&self, count: usize, categories: Option<&[Text<'_>]>) -> RawStatus {
        self.log_categories(1, count, pointer(categories, count).cast())
    }

    /// fmi2SetDebugLogging without categories.
    pub fn set_all_logging(&self, on: c_int) -> RawStatus {
        self.log_categories(on, 0, ptr::null())
    }

    fn log_categories(&self, on: c_int, count: usize, categories: *const *const c_char) -> RawStatus {
        // SAFETY: an array of the stated length, or null; strings end with a zero, or are null.
        unsafe {
            if self.raw.version == FmiVersion::V2 {
                let function: c_api::SetDebugLogging = self.raw.function("fmi2SetDebugLogging");
                return function(self.component, on, count, categories);
            }
            let function: v3::SetDebugLogging = self.raw.function("fmi3SetDebugLogging");
            function(self.component, on != 0, count, categories)
        }
    }

    /// fmi2GetFMUstate; `None` is a null pointer to the pointer.
    pub fn get_state(&self, state: Option<&mut RawState>) -> RawStatus {
        self.access_state("fmi2GetFMUstate", state)
    }

    /// fmi2FreeFMUstate; `None` is a null pointer to the pointer.
    pub fn free_state(&self, state: Option<&mut RawState>) -> RawStatus {
        self.access_state("fmi2FreeFMUstate", state)
    }

    fn access_state(&self, name: &str, state: Option<&mut RawState>) -> RawStatus {
        let function: c_api::AccessState = self.raw.function(name);
        // SAFETY: null, or any pointer: the FMU only compares it with the pointers that it has returned, and the tests
        // check this.
        unsafe { function(self.component, state.map_or(ptr::null_mut(), |state| &raw mut state.0)) }
    }

    /// fmi2SetFMUstate.
    pub fn set_state(&self, state: RawState) -> RawStatus {
        let function: c_api::SetState = self.raw.function("fmi2SetFMUstate");
        // SAFETY: as above.
        unsafe { function(self.component, state.0) }
    }

    /// fmi2SerializedFMUstateSize; `None` is a null pointer.
    pub fn state_size(&self, state: RawState, size: Option<&mut usize>) -> RawStatus {
        let function: c_api::SerializedStateSize = self.raw.function("fmi2SerializedFMUstateSize");
        // SAFETY: as above.
        unsafe { function(self.component, state.0, size.map_or(ptr::null_mut(), |size| &raw mut *size)) }
    }

    /// fmi2SerializeFMUstate; `None` is a null pointer.
    pub fn serialize(&self, state: RawState, bytes: Option<&mut [u8]>, size: usize) -> RawStatus {
        let function: c_api::SerializeState = self.raw.function("fmi2SerializeFMUstate");
        // The stated size must not exceed the array. Greater sizes would test nothing more, because the FMU writes only
        // as many bytes as the state needs.
        assert!(bytes.as_ref().is_none_or(|bytes| size <= bytes.len()), "the array is shorter than stated");
        // SAFETY: as above; an array of the stated length, or null.
        unsafe { function(self.component, state.0, pointer_mut(bytes, size).cast(), size) }
    }

    /// fmi2DeSerializeFMUstate; `None` is a null pointer.
    pub fn deserialize(&self, bytes: Option<&[u8]>, size: usize, state: Option<&mut RawState>) -> RawStatus {
        let function: c_api::DeserializeState = self.raw.function("fmi2DeSerializeFMUstate");
        let state = state.map_or(ptr::null_mut(), |state| &raw mut state.0);
        // SAFETY: as above; an array of the stated length, or null.
        unsafe { function(self.component, pointer(bytes, size).cast(), size, state) }
    }

    /// fmi2GetDirectionalDerivative of one unknown by one known; each array may be null.
    pub fn directional_derivative(
        &self,
        unknown: Option<&[Reference]>,
        known: Option<&[Reference]>,
        seed: Option<&[f64]>,
        result: Option<&mut [f64]>,
    ) -> RawStatus {
        let function: c_api::GetDirectionalDerivative = self.raw.function("fmi2GetDirectionalDerivative");
        // SAFETY: arrays of one value, or null.
        unsafe {
            function(
                self.component,
                pointer(unknown, 1),
                1,
                pointer(known, 1),
                1,
                pointer(seed, 1),
                pointer_mut(result, 1),
            )
        }
    }

    /// fmi2GetDirectionalDerivative: unknowns, their number, knowns, their number, seed, result; each array may be null.
    pub fn directional_derivatives(
        &self,
        (unknown, unknowns): (Option<&[Reference]>, usize),
        (known, knowns): (Option<&[Reference]>, usize),
        seed: Option<&[f64]>,
        result: Option<&mut [f64]>,
    ) -> RawStatus {
        let function: c_api::GetDirectionalDerivative = self.raw.function("fmi2GetDirectionalDerivative");
        // SAFETY: arrays of the stated lengths, or null.
        unsafe {
            function(
                self.component,
                pointer(unknown, unknowns),
                unknowns,
                pointer(known, knowns),
                knowns,
                pointer(seed, knowns),
                pointer_mut(result, unknowns),
            )
        }
    }

    /// fmi2SetRealInputDerivatives; each array may be null.
    pub fn set_input_derivatives(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        orders: Option<&[c_int]>,
        values: Option<&[f64]>,
    ) -> RawStatus {
        let function: c_api::SetInputDerivatives = self.raw.function("fmi2SetRealInputDerivatives");
        // SAFETY: arrays of the stated length, or null.
        unsafe {
            function(self.component, pointer(references, count), count, pointer(orders, count), pointer(values, count))
        }
    }

    /// fmi2GetRealOutputDerivatives; each array may be null.
    pub fn get_output_derivatives(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        orders: Option<&[c_int]>,
        values: Option<&mut [f64]>,
    ) -> RawStatus {
        let function: c_api::GetOutputDerivatives = self.raw.function("fmi2GetRealOutputDerivatives");
        // SAFETY: arrays of the stated length, or null.
        unsafe {
            function(
                self.component,
                pointer(references, count),
                count,
                pointer(orders, count),
                pointer_mut(values, count),
            )
        }
    }

    /// Calls fmi2GetString with an array for `room` strings, or with a null pointer; returns the strings if the status is
    /// fmi2OK.
    pub fn get_texts(
        &self,
        references: Option<&[Reference]>,
        count: usize,
        room: Option<usize>,
    ) -> (RawStatus, Vec<Vec<u8>>) {
        let mut values = room.map(|room| vec![Text::new(None); room]);
        let status = self.get(references, count, values.as_deref_mut());
        let values = values.unwrap_or_default();
        let written = if status == OK { &values[..count.min(values.len())] } else { &[] };
        // SAFETY: the FMU has just filled in strings that live until its next function is called.
        let read = |text: &Text<'_>| unsafe { CStr::from_ptr(text.0) }.to_bytes().to_vec();
        (status, written.iter().filter(|text| !text.0.is_null()).map(read).collect())
    }

    /// The messages that the logger received since the last call; none if there is no logger.
    #[must_use]
    pub fn take_log(&self) -> Vec<Entry> {
        self.log.as_deref().map(LogBook::take).unwrap_or_default()
    }

    /// fmi2GetRealStatus of a kind; `None` is a null pointer.
    pub fn real_status(&self, kind: c_int, value: Option<&mut f64>) -> RawStatus {
        let function: c_api::GetStatus<f64> = self.raw.function("fmi2GetRealStatus");
        // SAFETY: a live instance or null; one value, or null.
        unsafe { function(self.component, kind, value.map_or(ptr::null_mut(), |value| &raw mut *value)) }
    }

    /// fmi2GetBooleanStatus of a kind; `None` is a null pointer.
    pub fn boolean_status(&self, kind: c_int, value: Option<&mut c_int>) -> RawStatus {
        let function: c_api::GetStatus<c_int> = self.raw.function("fmi2GetBooleanStatus");
        // SAFETY: a live instance or null; one value, or null.
        unsafe { function(self.component, kind, value.map_or(ptr::null_mut(), |value| &raw mut *value)) }
    }

    /// fmi2GetStatus of a kind.
    pub fn status(&self, kind: c_int) -> RawStatus {
        let function: c_api::GetStatus<RawStatus> = self.raw.function("fmi2GetStatus");
        let mut value = 0;
        // SAFETY: a live instance or null; one value.
        unsafe { function(self.component, kind, &raw mut value) }
    }

    /// fmi2GetIntegerStatus of a kind; `None` is a null pointer.
    pub fn integer_status(&self, kind: c_int, value: Option<&mut c_int>) -> RawStatus {
        let function: c_api::GetStatus<c_int> = self.raw.function("fmi2GetIntegerStatus");
        // SAFETY: a live instance or null; one value, or null.
        unsafe { function(self.component, kind, value.map_or(ptr::null_mut(), |value| &raw mut *value)) }
    }

    /// fmi2GetStringStatus of a kind.
    pub fn string_status(&self, kind: c_int) -> RawStatus {
        let function: c_api::GetStatus<*const c_char> = self.raw.function("fmi2GetStringStatus");
        let mut value = ptr::null();
        // SAFETY: a live instance or null; one value.
        unsafe { function(self.component, kind, &raw mut value) }
    }
}
