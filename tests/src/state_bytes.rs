//! Changes values in the bytes of a saved state.
//!
//! Some continuous states start from parameters and cannot be set, but the tests of the model structure must change
//! them one by one. Other tests craft states that no run reaches. The crate `fmu` defines the format (`state_bytes`): a
//! magic number, the format version, version and interface of FMI (4 bytes), the GUID with its length, the FMU state (4
//! bytes), the start time, a flag for a stop time (4 bytes), the stop time, the time, the number of samples, then the
//! real values in the order of their references, little endian. The last eight bytes are the FNV-1a checksum of all
//! bytes before them.

use crate::ok;
use fmu_import::c_api::Reference;
use fmu_import::loader::Instance;

/// The format's version, after the magic number.
pub(crate) const VERSION_AT: usize = 8;
/// Version and interface of FMI.
pub(crate) const COLUMN_AT: usize = 12;
/// The text of the GUID, after its length.
pub(crate) const GUID_AT: usize = 20;
/// FMU state, start, flag for a stop time, stop, time, number of samples.
const BETWEEN_GUID_AND_REALS: usize = 4 + 8 + 4 + 3 * 8;

/// Positions of values in the bytes of an FMU's states.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    first: usize,
}

impl Place {
    /// The positions in the serialized states of the FMU with this GUID.
    #[must_use]
    pub fn of(guid: &str) -> Self {
        Self { first: GUID_AT + guid.len() + BETWEEN_GUID_AND_REALS }
    }

    /// Position of the value of a real variable.
    pub(crate) fn real(self, reference: Reference) -> usize {
        self.first + 8 * reference as usize
    }

    /// Position of the number of samples.
    fn samples_at(self) -> usize {
        self.first - 8
    }

    /// Positions of start, stop, time and number of samples.
    pub(crate) fn clock(self) -> [usize; 4] {
        [self.first - 36, self.first - 24, self.first - 16, self.samples_at()]
    }

    /// The number of samples that an instance has taken.
    ///
    /// # Panics
    /// If the FMU does not save its state.
    #[must_use]
    pub fn samples(self, instance: &mut Instance) -> u64 {
        let bytes = state(instance);
        u64::from_le_bytes(bytes[self.samples_at()..self.first].try_into().expect("eight bytes"))
    }

    /// The bytes of the instance's state with a changed number of samples.
    ///
    /// # Panics
    /// If the FMU does not save its state.
    #[must_use]
    pub fn with_samples(self, instance: &mut Instance, samples: u64) -> Vec<u8> {
        let mut bytes = state(instance);
        bytes[self.samples_at()..self.first].copy_from_slice(&samples.to_le_bytes());
        seal(&mut bytes);
        bytes
    }

    /// Continues an instance from its own state with changed values of real variables.
    ///
    /// # Panics
    /// If the FMU rejects the state.
    pub fn change(self, instance: &mut Instance, references: &[Reference], values: &[f64]) {
        let mut bytes = state(instance);
        for (&reference, value) in references.iter().zip(values) {
            let position = self.real(reference);
            bytes[position..position + 8].copy_from_slice(&value.to_le_bytes());
        }
        seal(&mut bytes);
        let changed = ok(instance.deserialize_state(&bytes));
        ok(instance.restore_state(&changed));
        ok(instance.free_state(changed));
    }
}

/// The bytes of an instance's state.
///
/// # Panics
/// If the FMU does not save its state.
#[must_use]
pub fn state(instance: &mut Instance) -> Vec<u8> {
    let saved = ok(instance.save_state());
    let bytes = ok(instance.serialize_state(&saved));
    ok(instance.free_state(saved));
    bytes
}

/// Updates the checksum.
pub(crate) fn seal(bytes: &mut [u8]) {
    let body = bytes.len() - 8;
    let sum = checksum(&bytes[..body]);
    bytes[body..].copy_from_slice(&sum.to_le_bytes());
}

/// FNV-1a with 64 bits.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
