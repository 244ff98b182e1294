//! Intermediate updates of FMI 3.0: the importer's callback inside a communication step.
//!
//! The callback calls functions of the same instance. While it runs, no reference to the instance exists: between two
//! updates, the step is a value of its own, and the instance is in Intermediate Update Mode.

use super::c::{c_void, size_t};
use super::float_environment::argument;
use super::fmi3::{Boolean, ValueReference};
use super::{Call, CallResult, Component, Export, Handle, Status, call, functions};
use crate::calls::{Function, Version};
use crate::instance::PausingStep;
use crate::runner::{Kind, Model as _};

/// fmi3IntermediateUpdateCallback: environment, time, intermediateVariableSetRequested, intermediateVariableGetAllowed,
/// intermediateStepFinished, canReturnEarly, earlyReturnRequested, earlyReturnTime.
pub type IntermediateUpdate =
    unsafe extern "C" fn(*mut c_void, f64, Boolean, Boolean, Boolean, Boolean, *mut Boolean, *mut f64);

/// Data of an instance whose importer passed a callback.
pub(super) struct Updates {
    callback: IntermediateUpdate,
    environment: *mut c_void,
    /// By value reference, true for the variables that the importer may use.
    required: Box<[bool]>,
    /// True if an input is required.
    sets: bool,
    can_return_early: bool,
    /// True while the callback runs. The instance may then be neither reset nor freed, not even after a panic, because
    /// the step goes on with it.
    is_calling: bool,
    step: PausingStep,
}

/// Arguments of fmi3InstantiateCoSimulation.
pub(super) struct Request<'a> {
    pub(super) required: &'a [ValueReference],
    pub(super) callback: Option<IntermediateUpdate>,
    pub(super) environment: *mut c_void,
    pub(super) can_return_early: bool,
}

/// Pointers to the results of fmi3DoStep.
#[derive(Clone, Copy)]
pub(super) struct Results {
    pub(super) event_handling_needed: *mut Boolean,
    pub(super) terminate: *mut Boolean,
    pub(super) early_return: *mut Boolean,
    pub(super) last_successful_time: *mut f64,
}

/// Returns true if the model has intermediate updates. Its value is known at compile time.
pub(super) const fn are_provided<E: Export>() -> bool {
    matches!(E::FORMAT.version, Version::Fmi3) && matches!(E::Model::KIND, Kind::Continuous)
}

impl Request<'_> {
    /// Validates the variables. `None` without a callback.
    pub(super) fn accept<E: Export>(self) -> Result<Option<Box<Updates>>, String> {
        let description = E::description();
        let layout = &description.layout;
        let mut required = vec![false; layout.end as usize];
        let mut sets = false;
        for &reference in self.required {
            let variable = layout.by_reference(reference);
            let allowed = variable.filter(|variable| are_provided::<E>() && variable.is_intermediate());
            let Some(variable) = allowed else {
                let what = variable.map_or_else(
                    || format!("value reference {reference}"),
                    |variable| format!("'{}'", variable.declaration.name),
                );
                return Err(format!(
                    "requiredIntermediateVariables must list variables with intermediateUpdate = true, {what} is not \
                     one of them"
                ));
            };
            required[reference as usize] = true;
            sets |= variable.is_input();
        }
        Ok(self.callback.filter(|_| are_provided::<E>()).map(|callback| {
            let Self { environment, can_return_early, .. } = self;
            let (required, is_calling, step) = (required.into(), false, PausingStep::default());
            Updates { callback, environment, required, sets, can_return_early, is_calling, step }.into()
        }))
    }
}

/// In an intermediate update, rejects variables that are not required, and reading after setting.
#[cold]
pub(super) fn check_access<E: Export>(h: &mut Handle<E>, call: &Call<E>, references: &[ValueReference]) -> CallResult {
    h.instance.check(call.0)?;
    let Some(updates) = &h.updates else { return Ok(()) };
    let is_required = |reference: u32| updates.required.get(reference as usize).copied().unwrap_or(false);
    if let Some(reference) = references.iter().find(|reference| !is_required(**reference)) {
        let variable = h.instance.layout().by_reference(*reference);
        let name = variable.map_or_else(String::new, |variable| format!(" ('{}')", variable.declaration.name));
        return Err(call.error(format_args!(
            "value reference {reference}{name} must be one of requiredIntermediateVariables during an intermediate update"
        )));
    }
    if call.0.name(Version::Fmi3).starts_with("fmi3Set") {
        h.instance.forbid_reading();
    }
    Ok(())
}

/// Returns true while the importer's callback runs.
pub(super) fn is_calling<E: Export>(h: &Handle<E>) -> bool {
    are_provided::<E>() && h.updates.as_ref().is_some_and(|updates| updates.is_calling)
}

/// Returns true if the importer passed a callback.
#[inline]
pub(super) unsafe fn has_callback<E: Export>(component: Component) -> bool {
    let handle = component.cast::<Handle<E>>();
    // SAFETY: the caller passes a component that was not freed.
    !handle.is_null() && handle.is_aligned() && unsafe { (*handle).updates.is_some() }
}

/// fmi3DoStep with a callback.
pub(super) unsafe fn do_step<E: Export>(component: Component, time: f64, step: f64, results: Results) -> Status {
    let Results { event_handling_needed, terminate, early_return, last_successful_time } = results;
    let (mut is_first, mut is_complete) = (true, false);
    // The time of an early return that the importer has requested in the last update, and whether it may do so.
    let mut requested = None;
    loop {
        let advance = |h: &mut Handle<E>, call: &Call<E>| {
            // SAFETY: values to write to, or null.
            let (event, terminate, early, last) = unsafe {
                (
                    call.target("eventHandlingNeeded", event_handling_needed)?,
                    call.target("terminateSimulation", terminate)?,
                    call.target("earlyReturn", early_return)?,
                    call.target("lastSuccessfulTime", last_successful_time)?,
                )
            };
            let Handle { instance, updates: Some(updates), returns_early, .. } = h else {
                unreachable!("the importer passed a callback")
            };
            let paused = &mut updates.step;
            if is_first {
                (*event, *terminate, *early, *last) = (0, 0, 0, instance.time());
                instance.begin_step(argument(time), argument(step), *returns_early, paused)?;
                is_first = false;
            }
            match requested.take() {
                Some(time) if updates.can_return_early => instance.return_early(argument(time), paused)?,
                Some(_) => {
                    let message = "earlyReturnRequested must be false if canReturnEarly is false".to_owned();
                    instance.fail_step(paused, message)?;
                }
                None => {}
            }
            is_complete = paused.is_complete();
            if is_complete {
                *early = (paused.is_early() && updates.can_return_early).into();
                *terminate = instance.is_finished().into();
                *event = (paused.is_at_event() && *terminate == 0).into();
                *last = instance.time();
                return Ok(());
            }
            instance.advance_to_update(paused)
        };
        // SAFETY: as the caller promises.
        let status = unsafe { call(component, Function::DoStep, advance) };
        if status != Status::Ok || is_complete {
            return status;
        }
        // SAFETY: a component that the call above has accepted.
        requested = unsafe { update::<E>(component) };
    }
}

/// Calls the callback. Returns the time of an early return, if the importer requests it.
unsafe fn update<E: Export>(component: Component) -> Option<f64> {
    let handle = component.cast::<Handle<E>>();
    // SAFETY: the component is valid. No reference to it lives longer than this statement.
    let (callback, environment, time, sets, can_return_early) = unsafe {
        let Handle { instance, updates: Some(updates), .. } = &mut *handle else {
            unreachable!("the importer passed a callback")
        };
        updates.is_calling = true;
        (updates.callback, updates.environment, instance.time(), updates.sets, updates.can_return_early)
    };
    let (mut is_requested, mut return_time) = (0, time);
    // SAFETY: the callback and its environment are the importer's. `free_instance` does not free the component now.
    let Handle { instance, updates, .. } = unsafe {
        callback(environment, time, sets.into(), 1, 1, can_return_early.into(), &mut is_requested, &mut return_time);
        &mut *handle
    };
    updates.iter_mut().for_each(|updates| updates.is_calling = false);
    instance.leave_update();
    (is_requested != 0).then_some(return_time)
}

functions! {
    /// fmi3GetOutputDerivatives: the derivatives of order 1.
    fn get_output_derivatives[GetRealOutputDerivatives](
        h, call, references: *const ValueReference, count: size_t, orders: *const i32, values: *mut f64,
        value_count: size_t
    ) {
        let orders = call.array("orders", orders, count)?;
        let values = call.array_mut("values", values, value_count)?;
        let (references, instance) = super::values::elements(h, call, references, count)?;
        super::values::check_count(call, references.len(), values.len())?;
        if let Some(order) = orders.iter().find(|order| **order != 1) {
            let most = u8::from(are_provided::<E>());
            return Err(call.error(format_args!("orders must be from 1 to maxOutputDerivativeOrder = {most}, got {order}")));
        }
        instance.output_derivatives(references, values)
    }
}
