//! Saved states.

use super::{CallResult, Instance, Snapshot, state_bytes, structure, texts};
use crate::calls::Function;
use crate::runner::Model;

impl<M: Model> Instance<M> {
    /// fmi2GetFMUstate: a copy of the complete state.
    pub fn snapshot(&self) -> CallResult<Snapshot<M>> {
        self.check(Function::GetFMUstate)?;
        let mut values = self.values.clone();
        if M::HAS_CLOCKS
            && let Some(run) = &self.run
        {
            // The active clocks are evaluated again when their outputs are read.
            M::restore_outputs(run, self.layout(), &mut values);
        }
        Ok(Snapshot {
            mode: self.mode,
            timeline: self.timeline,
            values,
            is_tolerance_set: self.is_tolerance_set,
            run: self.run.clone(),
            derived: self.derived.clone(),
            derived_are_old: self.derived_are_old,
        })
    }

    /// fmi2SetFMUstate. The instance continues from the snapshot.
    pub fn restore(&mut self, snapshot: &Snapshot<M>) -> CallResult {
        self.check(Function::SetFMUstate)?;
        self.enter(snapshot.mode);
        self.timeline = snapshot.timeline;
        self.values.clone_from(&snapshot.values);
        self.present_states = structure::present_states::<M>(&self.description.layout, &self.values);
        self.run.clone_from(&snapshot.run);
        self.is_tolerance_set = snapshot.is_tolerance_set;
        self.derived.clone_from(&snapshot.derived);
        self.derived_are_old = snapshot.derived_are_old;
        if M::INTERPOLATES {
            self.update_slopes();
        }
        if self.uses_event_mode
            && !self.is_before_start()
            && let Some(run) = &mut self.run
        {
            // The instance that saved the state may have handled events inside its steps. In this instance, the
            // importer handles them.
            M::init_events(run, &self.description.layout, self.timeline.time);
        }
        self.parameters = M::parameters(&self.values);
        self.texts = texts(&self.values.strings);
        self.forget_results();
        Ok(())
    }

    /// Bytes of a snapshot, valid in any process with the same FMU.
    pub fn serialize(&self, snapshot: &Snapshot<M>) -> CallResult<Vec<u8>> {
        self.check(Function::SerializeFMUstate)?;
        state_bytes::write(self.protocol, &self.description.guid, self.layout(), snapshot)
            .map_err(|message| self.error(Function::SerializeFMUstate, message))
    }

    /// Reads a snapshot. Fails if the bytes are damaged or from another format or FMU, or if a file has changed.
    pub fn deserialize(&self, bytes: &[u8]) -> CallResult<Snapshot<M>> {
        self.check(Function::DeSerializeFMUstate)?;
        state_bytes::read::<M>(self.protocol, &self.description.guid, self.layout(), &self.resources, bytes)
            .map_err(|message| self.error(Function::DeSerializeFMUstate, message))
    }
}
