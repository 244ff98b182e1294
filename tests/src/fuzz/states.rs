//! Saved states and their bytes.

use super::modes::{FAILED, Mode};
use super::{Bytes, Checked, Fuzzer, Next, STATES, ensure};
use crate::raw::{OK, RawState};
use crate::state_bytes::{COLUMN_AT, GUID_AT, Place, VERSION_AT, seal};

impl Fuzzer<'_> {
    /// A state to pass, with its index in the list and its kind: from this instance, from another instance, freed, null
    /// or invented.
    pub(super) fn some_state(&mut self, at: usize) -> (RawState, Option<usize>, &'static str) {
        let other = (at + 1) % self.slots.len();
        let own = self.slots[at].states.len();
        let (state, what) = match self.random.below(16) {
            0 => (RawState::NULL, "null"),
            1 => (RawState::invented(self.pick(&[1, 8, 16, usize::MAX, 0xdead_beef])), "made up"),
            2 => (self.slots[other].states.first().map_or(RawState::NULL, |state| state.0), "of another instance"),
            3 => (self.slots[at].freed.last().copied().unwrap_or(RawState::NULL), "freed"),
            _ if own == 0 => (RawState::NULL, "null"),
            _ => {
                let place = self.index(own);
                return (self.slots[at].states[place].0, Some(place), "own");
            }
        };
        // A new state may have the address of a freed one. Runs would then depend on addresses, so an invented pointer
        // is used instead, which is rejected like a freed state.
        let is_used_again = self.slots[at].states.iter().any(|known| known.0 == state);
        (if is_used_again { RawState::invented(0xdead_beef) } else { state }, None, what)
    }

    pub(super) fn state(&mut self, at: usize) -> Checked {
        match self.random.below(12) {
            0..3 => self.save(at),
            3..6 => {
                let (state, place, what) = self.some_state(at);
                let mode = place.and_then(|place| self.slots[at].states[place].1);
                let text = format!("{what} {place:?}");
                let next = mode.map_or(Next::Any, Next::To);
                let status = self.call(at, "fmi2SetFMUstate", text, next, |instance| instance.set_state(state))?;
                ensure((status == OK) == place.is_some(), || format!("fmi2SetFMUstate, {what}, returned {status}"))
            }
            6 => self.free(at),
            7..9 => self.serialize(at),
            _ => self.deserialize(at),
        }
    }

    /// Where to save a state: a null pointer or an existing state. `None` if there are enough states and no existing
    /// state was chosen.
    pub(super) fn target(&mut self, at: usize) -> Option<(RawState, Option<usize>, &'static str)> {
        let is_full = self.slots[at].states.len() >= STATES;
        let target = if is_full || self.chance(3) { self.some_state(at) } else { (RawState::NULL, None, "null") };
        (!(target.0.is_null() && is_full)).then_some(target)
    }

    /// Records the FMU state in which the saved state at `place` was saved, or adds a new saved state to the list.
    pub(super) fn keep(&mut self, at: usize, place: Option<usize>, state: RawState, mode: Option<Mode>) {
        match place {
            Some(place) => self.slots[at].states[place].1 = mode,
            None => self.slots[at].states.push((state, mode)),
        }
    }

    pub(super) fn save(&mut self, at: usize) -> Checked {
        // Without a logger, the FMU state is unknown.
        let mode = self.slots[at].has_logger.then_some(self.slots[at].mode);
        if self.chance(40) {
            self.call(at, "fmi2GetFMUstate", "null".to_owned(), Next::Same, |instance| instance.get_state(None))?;
            return Ok(());
        }
        let Some((mut state, place, what)) = self.target(at) else { return self.free(at) };
        let before = state;
        let text = format!("{what} {place:?}");
        let status =
            self.call(at, "fmi2GetFMUstate", text, Next::Same, |instance| instance.get_state(Some(&mut state)))?;
        let is_due = (before.is_null() || place.is_some()) && mode != Some(FAILED);
        ensure(mode.is_none() || (status == OK) == is_due, || {
            format!("fmi2GetFMUstate into a state, {what}, returned {status}")
        })?;
        ensure(before.is_null() || state == before, || "fmi2GetFMUstate changed the pointer".to_owned())?;
        if status == OK {
            ensure(!state.is_null(), || "fmi2GetFMUstate returned no state".to_owned())?;
            self.keep(at, place, state, mode);
        }
        Ok(())
    }

    pub(super) fn free(&mut self, at: usize) -> Checked {
        let (mut state, place, what) = self.some_state(at);
        let before = state;
        let text = format!("{what} {place:?}");
        let status =
            self.call(at, "fmi2FreeFMUstate", text, Next::Same, |instance| instance.free_state(Some(&mut state)))?;
        let is_due = before.is_null() || place.is_some();
        ensure((status == OK) == is_due, || format!("fmi2FreeFMUstate, {what}, returned {status}"))?;
        ensure(state.is_null() || (status != OK && state == before), || "another pointer".to_owned())?;
        if let Some(place) = place.filter(|_| status == OK) {
            self.slots[at].states.remove(place);
            self.slots[at].freed = vec![before];
        }
        Ok(())
    }

    pub(super) fn serialize(&mut self, at: usize) -> Checked {
        const MARK: u8 = 0xa5;
        let (state, place, what) = self.some_state(at);
        let mut size = usize::MAX - 1;
        let target = if self.chance(40) { None } else { Some(&mut size) };
        let has_target = target.is_some();
        let text = format!("{what} {place:?} {has_target}");
        let function = "fmi2SerializedFMUstateSize";
        let status = self.call(at, function, text, Next::Same, |instance| instance.state_size(state, target))?;
        ensure((status == OK) == (place.is_some() && has_target), || format!("{function} returned {status}"))?;
        if size == usize::MAX - 1 {
            size = 100;
        }
        let needed = size;
        let wrong = self.random.below(3) as usize * size / 2;
        let size = if self.chance(6) { wrong } else { size };
        let mut bytes = vec![MARK; size + 8];
        let target = if self.chance(40) { None } else { Some(bytes.as_mut_slice()) };
        let is_due = place.is_some() && size >= needed && target.is_some();
        let text = format!("{what} {place:?} {size} {}", target.is_some());
        let function = "fmi2SerializeFMUstate";
        let status = self.call(at, function, text, Next::Same, |instance| instance.serialize(state, target, size))?;
        // Without the size from the FMU, it is unknown whether this size is sufficient.
        let is_known = place.is_none() || has_target;
        ensure(!is_known || (status == OK) == is_due, || format!("{function} returned {status}"))?;
        let used = if status == OK { needed.min(size) } else { 0 };
        ensure(bytes[used..].iter().all(|&byte| byte == MARK), || format!("{function} wrote beyond the state"))?;
        if status == OK
            && let Some(place) = place
        {
            ensure(is_known, || format!("{function} wrote a state into {size} bytes"))?;
            bytes.truncate(used);
            if self.bytes.len() == STATES {
                let oldest = self.index(STATES);
                self.bytes.swap_remove(oldest);
            }
            let (mode, interface) = (self.slots[at].states[place].1, self.slots[at].interface);
            self.bytes.push(Bytes { bytes, mode, interface });
        }
        Ok(())
    }

    pub(super) fn deserialize(&mut self, at: usize) -> Checked {
        if self.bytes.is_empty() {
            return self.serialize(at);
        }
        let pick = self.index(self.bytes.len());
        let Bytes { mut bytes, mut mode, interface } = self.bytes[pick].clone();
        let kind = self.random.below(10);
        let (what, is_due) = match kind {
            0 => {
                let at = self.index(bytes.len());
                bytes[at] ^= 1 << self.random.below(8);
                ("damaged", Some(false))
            }
            1 => {
                bytes.truncate(self.random.below(bytes.len() as u64) as usize);
                ("cut off", Some(false))
            }
            2 => {
                bytes.extend(std::iter::repeat_n(0, 1 + self.random.below(64) as usize));
                ("too long", Some(false))
            }
            3 => {
                bytes = (0..self.random.below(400)).map(|_| self.random.bits() as u8).collect();
                ("noise", Some(false))
            }
            4 => {
                self.other_version(&mut bytes);
                ("of another version", Some(false))
            }
            // The bytes get changes and a valid checksum: crafted values, or a state of another FMU with the GUID of
            // this FMU.
            5 => {
                for _ in 0..1 + self.random.below(3) {
                    self.craft(&mut bytes);
                }
                if interface != self.slots[at].interface {
                    // The bytes claim to be from an instance with the other interface.
                    bytes[COLUMN_AT] ^= 1;
                }
                seal(&mut bytes);
                mode = None;
                ("crafted", None)
            }
            6 if !self.foreign.is_empty() => {
                let pick = self.index(self.foreign.len());
                let guid = guid(&bytes).to_vec();
                bytes.clone_from(&self.foreign[pick]);
                if self.chance(2) {
                    ("foreign", Some(false))
                } else {
                    // The bytes of the other FMU get the GUID of this FMU. Their values may happen to be valid.
                    replace_guid(&mut bytes, &guid);
                    if self.chance(2) {
                        bytes[COLUMN_AT] ^= 1;
                        seal(&mut bytes);
                    }
                    mode = None;
                    ("foreign under this GUID", None)
                }
            }
            _ if interface != self.slots[at].interface => ("of the other interface", Some(false)),
            _ => ("good", Some(true)),
        };
        let Some((mut state, place, target)) = self.target(at) else { return self.free(at) };
        let before = state;
        let is_null = self.chance(40);
        let count = if kind > 6 && self.chance(40) { usize::MAX } else { bytes.len() };
        let text = format!("{what}, {count} of {} bytes, null {is_null}, into {target} {place:?}", bytes.len());
        let source = (!is_null).then_some(bytes.as_slice());
        let function = "fmi2DeSerializeFMUstate";
        let status = self
            .call(at, function, text, Next::Same, |instance| instance.deserialize(source, count, Some(&mut state)))?;
        let fits = !is_null && count == bytes.len() && (before.is_null() || place.is_some());
        let is_due = is_due.map(|is_due| is_due && fits);
        ensure(is_due.is_none_or(|is_due| (status == OK) == is_due), || {
            format!("{function}, {what}, returned {status}")
        })?;
        ensure(before.is_null() || state == before, || format!("{function} changed the pointer"))?;
        if status == OK {
            ensure(fits && !state.is_null(), || format!("{function} returned no state"))?;
            self.keep(at, place, state, mode);
        }
        Ok(())
    }

    /// Changes the format number or the GUID in the bytes, as if they came from another version of the exporter or the
    /// FMU.
    pub(super) fn other_version(&mut self, bytes: &mut Vec<u8>) {
        let mut other = guid(bytes).to_vec();
        match self.random.below(5) {
            0 => {
                let version = self.pick(&[0, 1, 255]);
                bytes[VERSION_AT] = version;
                return seal(bytes);
            }
            1 => other.clear(),
            2 => other.push(b'}'),
            3 => drop(other.pop()),
            _ => {
                let at = self.index(other.len());
                other[at] ^= 1;
            }
        }
        replace_guid(bytes, &other);
    }

    /// Changes a time or the number of samples, individual bytes anywhere, eight consecutive bytes anywhere, or the
    /// value of a real variable.
    pub(super) fn craft(&mut self, bytes: &mut [u8]) {
        let body = bytes.len() - 8;
        let reals = self.reals();
        match self.random.below(4) {
            0 => {
                let clock = Place::of(self.raw.guid()).clock();
                let at = self.pick(&clock);
                let numbers = [self.wild().to_bits(), self.random.bits(), 0, 1, u64::MAX];
                let number = self.pick(&numbers);
                bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
            }
            1 => {
                let at = self.index(body);
                bytes[at] = self.pick(&[0, 1, 2, 3, 4, 5, 6, 7, 0x7f, 0x80, 0xff]);
            }
            2 => {
                let at = self.index(body - 8);
                let number = if self.chance(2) { self.wild().to_bits() } else { self.random.bits() };
                bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
            }
            _ if reals.is_empty() => {}
            _ => {
                let reference = self.pick(&reals);
                let at = Place::of(self.raw.guid()).real(reference);
                let number = self.value(reference);
                bytes[at..at + 8].copy_from_slice(&number.to_le_bytes());
            }
        }
    }
}

/// The GUID in the bytes of a state.
fn guid(bytes: &[u8]) -> &[u8] {
    let length: [u8; 4] = bytes[GUID_AT - 4..GUID_AT].try_into().expect("four bytes");
    &bytes[GUID_AT..][..u32::from_le_bytes(length) as usize]
}

/// Replaces the GUID, and updates the checksum.
fn replace_guid(bytes: &mut Vec<u8>, other: &[u8]) {
    let end = GUID_AT + guid(bytes).len();
    bytes.splice(GUID_AT..end, other.iter().copied());
    bytes[GUID_AT - 4..GUID_AT].copy_from_slice(&(other.len() as u32).to_le_bytes());
    seal(bytes);
}
