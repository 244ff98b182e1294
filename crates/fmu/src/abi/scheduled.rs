//! Scheduled execution of FMI 3.0: several threads use an instance.
//!
//! Every call locks the instance, so a partition runs from its start to its end before another call begins: correct, but
//! not preemptible. While the importer's `clockUpdate` runs, the partition has ended and the instance is not locked; the
//! calls of this thread are in Clock Update Mode. Other FMUs do not contain this code, and other instances do not lock.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::c::c_void;
use super::float_environment::argument;
use super::fmi3::{ValueReference, not_provided};
use super::{Component, Export, Handle, Status, call};
use crate::calls::{Function, Version};
use crate::description::LOG_ERROR;
use crate::runner::Model as _;

/// fmi3ClockUpdateCallback: environment.
pub type ClockUpdate = unsafe extern "C" fn(*mut c_void);
/// fmi3LockPreemptionCallback and fmi3UnlockPreemptionCallback.
pub type Preemption = unsafe extern "C" fn();

/// An instance of an FMU with scheduled execution. No reference to the whole exists, because one thread may change the
/// handle while others wait for the lock.
#[repr(C)]
struct Shared<E: Export> {
    /// First, so that a component is a pointer to a handle in all FMUs.
    handle: Handle<E>,
    /// `None` in other interfaces.
    scheduler: Option<Scheduler>,
}

struct Scheduler {
    clock_update: Option<ClockUpdate>,
    environment: *mut c_void,
    lock: Option<Preemption>,
    unlock: Option<Preemption>,
    /// Threads in which `clock_update` runs. Locked while a call uses the handle.
    updating: Mutex<Vec<usize>>,
}

/// Calls `unlockPreemption` when dropped.
struct Unlock(Option<Preemption>);

impl Drop for Unlock {
    fn drop(&mut self) {
        if let Some(unlock) = self.0 {
            // SAFETY: a function of the importer, which must not call the FMU.
            unsafe { unlock() }
        }
    }
}

/// A locked instance. When dropped, it unlocks the instance, then calls `unlockPreemption`.
struct Lock<'a> {
    updating: MutexGuard<'a, Vec<usize>>,
    _unlock: Unlock,
}

impl Scheduler {
    fn lock(&self) -> Lock<'_> {
        if let Some(lock) = self.lock {
            // SAFETY: a function of the importer, which must not call the FMU.
            unsafe { lock() }
        }
        let updating = self.updating.lock().unwrap_or_else(PoisonError::into_inner);
        Lock { updating, _unlock: Unlock(self.unlock) }
    }
}

/// A number that no other running thread has. Unlike a thread's id in the standard library, it needs no memory.
fn thread() -> usize {
    thread_local! { static HERE: u8 = const { 0 }; }
    HERE.with(|here| std::ptr::from_ref(here).addr())
}

/// Returns true if the FMU has scheduled execution. Its value is known at compile time.
pub(super) const fn is_provided<E: Export>() -> bool {
    matches!(E::FORMAT.version, Version::Fmi3)
        && E::FORMAT.interfaces.scheduled_execution
        && E::Model::SCHEDULED_EXECUTION
}

pub(super) fn allocate<E: Export>(handle: Handle<E>) -> Component {
    if is_provided::<E>() {
        Box::into_raw(Box::new(Shared { handle, scheduler: None })).cast()
    } else {
        Box::into_raw(Box::new(handle)).cast()
    }
}

/// Frees what [`allocate`] has returned.
pub(super) unsafe fn free<E: Export>(component: Component) {
    // SAFETY: made by Box::into_raw in `allocate`, freed once.
    unsafe {
        if is_provided::<E>() {
            drop(Box::from_raw(component.cast::<Shared<E>>()));
        } else {
            drop(Box::from_raw(component.cast::<Handle<E>>()));
        }
    }
}

/// Prepares a new instance of an FMU with scheduled execution for this interface.
pub(super) unsafe fn share<E: Export>(
    component: Component,
    clock_update: Option<ClockUpdate>,
    environment: *mut c_void,
    lock: Option<Preemption>,
    unlock: Option<Preemption>,
) {
    let updating = Mutex::new(Vec::with_capacity(8));
    // SAFETY: made by `allocate`, and known to no other thread.
    let scheduler = unsafe { &mut (*component.cast::<Shared<E>>()).scheduler };
    *scheduler = Some(Scheduler { clock_update, environment, lock, unlock, updating });
}

/// The scheduler of an instance for scheduled execution.
unsafe fn scheduler<'a, E: Export>(component: Component) -> Option<&'a Scheduler> {
    if !is_provided::<E>() {
        return None;
    }
    // SAFETY: the component was not freed. The reference is only to this field, which does not change.
    unsafe { (*component.cast::<Shared<E>>()).scheduler.as_ref() }
}

/// The exclusive use of an instance, until it is dropped.
pub(super) struct Access<'a, E: Export> {
    handle: *mut Handle<E>,
    lock: Lock<'a>,
    is_updating: bool,
}

impl<E: Export> Drop for Access<'_, E> {
    fn drop(&mut self) {
        if self.is_updating {
            // SAFETY: the instance is still locked, and the call has ended.
            unsafe { (*self.handle).instance.set_updating(false) };
        }
    }
}

/// Locks an instance for a call. Inside `clockUpdate`, the call is in Clock Update Mode.
pub(super) unsafe fn access<'a, E: Export>(component: Component) -> Option<Access<'a, E>> {
    // SAFETY: as the caller promises.
    let lock = unsafe { scheduler::<E>(component) }?.lock();
    let (handle, is_updating) = (component.cast::<Handle<E>>(), lock.updating.contains(&thread()));
    if is_updating {
        // SAFETY: the component is valid and locked.
        unsafe { (*handle).instance.set_updating(true) };
    }
    Some(Access { handle, lock, is_updating })
}

/// Returns true while `clockUpdate` runs in a thread: the instance cannot be freed then.
pub(super) unsafe fn rejects_free<E: Export>(component: Component) -> bool {
    // SAFETY: as the caller promises.
    let access = unsafe { access::<E>(component) };
    let is_used = access.as_ref().is_some_and(|access| !access.lock.updating.is_empty());
    if is_used {
        let message = "fmi3FreeInstance called in Clock Update Mode; the instance was not freed";
        // SAFETY: the component is valid and locked.
        unsafe { &*component.cast::<Handle<E>>() }.log.write(Status::Error, LOG_ERROR, message);
    }
    is_used
}

/// fmi3ActivateModelPartition. Calls `clockUpdate` if an output clock has ticked or a countdown clock was started.
pub unsafe fn activate_model_partition<E: Export>(component: Component, clock: ValueReference, time: f64) -> Status {
    let function = Function::ActivateModelPartition;
    if !is_provided::<E>() {
        return unsafe { not_provided::<E>(component, function) };
    }
    let mut needs_update = false;
    let activate = |h: &mut Handle<E>, _: &_| {
        needs_update = h.instance.activate(clock, argument(time))?;
        Ok(())
    };
    // SAFETY: as the caller promises.
    unsafe {
        let status = call(component, function, activate);
        if needs_update
            && let Some(scheduler) = scheduler::<E>(component)
            && let Some(clock_update) = scheduler.clock_update
        {
            scheduler.lock().updating.push(thread());
            clock_update(scheduler.environment);
            scheduler.lock().updating.retain(|other| *other != thread());
        }
        status
    }
}
