//! Saved states.

use super::calls::Function;
use super::clocks::Clocks;
use super::error::{CallError, CallProblem};
use super::functions::Functions;
use super::instance::Instance;
use crate::c_api;
use std::ptr;

const NO_CLOCKS: CallProblem = CallProblem::Arguments("the bytes do not contain the clocks of this FMU");
const NO_POINT: CallProblem = CallProblem::Arguments("the bytes do not contain the position of the integrator");

/// A state saved with [`Instance::save_state`]; valid only for the instance that saved it.
#[derive(Debug)]
pub struct SavedState {
    /// Address of the log, unique among living instances; identifies the owner of the state.
    owner: usize,
    slot: usize,
}

impl Instance {
    fn owner(&self) -> usize {
        self.log.environment().addr()
    }

    fn state(&mut self, function: Function, saved: &SavedState) -> Result<c_api::State, CallError> {
        if saved.owner == self.owner()
            && let Some(state) = self.states.get(saved.slot)
        {
            return Ok(*state);
        }
        Err(self.failure(function, CallProblem::Arguments("the state was saved by another instance")))
    }

    fn keep(&mut self, state: c_api::State) -> SavedState {
        let owner = self.owner();
        self.states.push(state);
        let point = self.integration.as_ref().map(|own| own.point.clone());
        self.saved.push((self.clocks.clone(), point));
        SavedState { owner, slot: self.states.len() - 1 }
    }

    /// `fmi2GetFMUstate`. The state lives until [`Self::free_state`] or the end of the instance.
    pub fn save_state(&mut self) -> Result<SavedState, CallError> {
        let mut state = ptr::null_mut();
        self.call_optional(
            Function::GetFmuState,
            Functions::get_state,
            // SAFETY: live instance; a null state asks for a new one.
            |f, c| unsafe { f(c, &raw mut state) },
        )?;
        Ok(self.keep(state))
    }

    /// `fmi2GetFMUstate`, overwriting a saved state.
    pub fn save_state_again(&mut self, saved: &SavedState) -> Result<(), CallError> {
        const NAME: Function = Function::GetFmuState;
        let mut state = self.state(NAME, saved)?;
        // SAFETY: live instance; the state is null or one that this instance returned.
        let get = |f: c_api::AccessState, c| unsafe { f(c, &raw mut state) };
        let result = self.call_optional(NAME, Functions::get_state, get);
        // The FMU may have replaced the pointer, even if it failed.
        self.states[saved.slot] = state;
        let (clocks, point) = &mut self.saved[saved.slot];
        clocks.clone_from(&self.clocks);
        if let (Some(own), Some(point)) = (&self.integration, point) {
            point.take(&own.point);
        }
        result
    }

    /// `fmi2SetFMUstate`.
    pub fn restore_state(&mut self, saved: &SavedState) -> Result<(), CallError> {
        const NAME: Function = Function::SetFmuState;
        let state = self.state(NAME, saved)?;
        self.call_optional(
            NAME,
            Functions::set_state,
            // SAFETY: live instance; the state is one that this instance returned.
            |f, c| unsafe { f(c, state) },
        )?;
        let (clocks, point) = &self.saved[saved.slot];
        self.clocks.clone_from(clocks);
        if let (Some(own), Some(point)) = (&mut self.integration, point) {
            own.point.take(point);
        }
        Ok(())
    }

    /// `fmi2FreeFMUstate`.
    pub fn free_state(&mut self, saved: SavedState) -> Result<(), CallError> {
        const NAME: Function = Function::FreeFmuState;
        let mut state = self.state(NAME, &saved)?;
        // SAFETY: live instance; the state is null or one that this instance returned.
        let free = |f: c_api::AccessState, c| unsafe { f(c, &raw mut state) };
        self.call_optional(NAME, Functions::free_state, free)?;
        // The slot is kept, so that the slots of other states stay valid. Freeing null does nothing.
        self.states[saved.slot] = ptr::null_mut();
        Ok(())
    }

    /// `fmi2SerializeFMUstate`: the bytes of a saved state.
    pub fn serialize_state(&mut self, saved: &SavedState) -> Result<Vec<u8>, CallError> {
        const NAME: Function = Function::SerializeFmuState;
        let state = self.state(NAME, saved)?;
        let mut size = 0;
        self.call_optional(
            Function::SerializedFmuStateSize,
            Functions::serialized_state_size,
            // SAFETY: live instance and state; the size is written through a valid pointer.
            |f, c| unsafe { f(c, state, &raw mut size) },
        )?;
        // FMUs from some tools write a byte even if the size is 0.
        let mut bytes = vec![0_u8; size.max(1)];
        // SAFETY: live instance and state; the buffer has the size that the FMU asked for.
        self.call_present(NAME, |f, c| unsafe {
            match f {
                Functions::V2(f) => Some(f.serialize_state?(c, state, bytes.as_mut_ptr().cast(), size)),
                Functions::V3(f) => Some(f.serialize_state?(c, state, bytes.as_mut_ptr(), size)),
            }
        })?;
        if size == 0 && bytes != [0] {
            self.overrun = Some(NAME);
        }
        bytes.truncate(size);
        if let Some(clocks) = &self.saved[saved.slot].0 {
            clocks.append(&mut bytes);
        }
        Ok(bytes)
    }

    /// `fmi2DeSerializeFMUstate`: restores a saved state from its bytes. They do not contain the position of the
    /// integrator ([`Self::integrate`]), so this fails if there is one.
    pub fn deserialize_state(&mut self, bytes: &[u8]) -> Result<SavedState, CallError> {
        const NAME: Function = Function::DeserializeFmuState;
        let clocks = match &self.clocks {
            _ if self.integration.is_some() => return Err(self.failure(NAME, NO_POINT)),
            Some(_) => match Clocks::split(bytes, self.signature()) {
                Some(parts) => Some(parts),
                None => return Err(self.failure(NAME, NO_CLOCKS)),
            },
            None => None,
        };
        let (bytes, clocks) = clocks.map_or((bytes, None), |(bytes, clocks)| (bytes, Some(clocks)));
        let mut state = ptr::null_mut();
        // SAFETY: live instance; the bytes have the stated length; null asks for a new state.
        self.call_present(NAME, |f, c| unsafe {
            match f {
                Functions::V2(f) => Some(f.deserialize_state?(c, bytes.as_ptr().cast(), bytes.len(), &raw mut state)),
                Functions::V3(f) => Some(f.deserialize_state?(c, bytes.as_ptr(), bytes.len(), &raw mut state)),
            }
        })?;
        let saved = self.keep(state);
        self.saved[saved.slot].0 = clocks;
        Ok(saved)
    }
}
