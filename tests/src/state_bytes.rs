//! Other values in the bytes of a saved state.
//!
//! Some states start by the parameters and cannot be set, but the tests of the model structure have to change them one
//! by one. The bytes are those of this project's exporter (crate `fmi2`): somewhere in them the real values stand in
//! the order of their references, little endian, and the last eight bytes are the FNV-1a checksum of all before.

use crate::{Fmu, ok};
use host::c_api::Reference;
use host::description::Causality;
use host::loader::Instance;

/// Where the real values lie in the bytes of an FMU's states.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    first: usize,
}

impl Place {
    /// Finds it by setting an input to a number that stands nowhere else.
    ///
    /// # Panics
    /// When the FMU has no input or the number is not found once.
    #[must_use]
    pub fn find(fmu: &Fmu) -> Self {
        const NUMBER: f64 = 1.234_567_890_123e-3;
        let input = fmu.references(Causality::Input)[0];
        let mut instance = fmu.instance();
        ok(instance.set_real(&[input], &[NUMBER]));
        let saved = ok(instance.save_state());
        let bytes = ok(instance.serialize_state(&saved));
        let mut found = bytes.windows(8).enumerate().filter(|(_, window)| *window == NUMBER.to_le_bytes());
        let (position, _) = found.next().unwrap_or_else(|| panic!("{}: the number is not in the state", fmu.name));
        assert!(found.next().is_none(), "{}: the number stands twice in the state", fmu.name);
        Self { first: position - 8 * input as usize }
    }

    /// Lets an instance go on from its own state with other values of some reals.
    ///
    /// # Panics
    /// When the FMU refuses the state.
    pub fn change(self, instance: &mut Instance, references: &[Reference], values: &[f64]) {
        let saved = ok(instance.save_state());
        let mut bytes = ok(instance.serialize_state(&saved));
        for (&reference, value) in references.iter().zip(values) {
            let position = self.first + 8 * reference as usize;
            bytes[position..position + 8].copy_from_slice(&value.to_le_bytes());
        }
        let body = bytes.len() - 8;
        let sum = checksum(&bytes[..body]);
        bytes[body..].copy_from_slice(&sum.to_le_bytes());
        let changed = ok(instance.deserialize_state(&bytes));
        ok(instance.restore_state(&changed));
        ok(instance.free_state(saved));
        ok(instance.free_state(changed));
    }
}

/// FNV-1a with 64 bits.
pub(crate) fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
