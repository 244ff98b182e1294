//! Values of Binary variables (FMI 3.0.2, section 2.2.6.2).

use super::calls::Function;
use super::error::{CallError, CallProblem};
use super::instance::Instance;
use crate::c_api::Reference;
use crate::description::Value;
use std::mem;
use std::ptr;
use std::slice;

const NO_BYTES: CallProblem = CallProblem::Arguments("the FMU returned a null pointer for a value that is not empty");

impl Instance {
    /// `fmi3GetBinary`: one value per element.
    pub fn get_binary(&mut self, refs: &[Reference]) -> Result<Vec<Vec<u8>>, CallError> {
        if self.has_special(refs) && self.has_elements(refs) {
            return self.get_list_elements(refs, Self::get_binary);
        }
        let mut values = vec![Vec::new(); self.elements(refs)];
        self.read_binary(refs, &mut values)?;
        Ok(values)
    }

    /// Like [`Self::get_binary`], into existing values. Allocates only for more or longer values than before.
    pub fn read_binary(&mut self, refs: &[Reference], values: &mut [Vec<u8>]) -> Result<(), CallError> {
        if self.has_clocked(refs) {
            let of = |value: &Value| if let Value::Binary { hex } = value { Some(hex.clone()) } else { None };
            return self.get_held(refs, values, of, Self::read_binary);
        }
        const NAME: Function = Function::GetBinary;
        self.same_length(NAME, self.elements(refs), values.len())?;
        if self.has_special(refs) && self.has_elements(refs) {
            return self.read_elements(refs, values);
        }
        let (mut sizes, mut pointers) = (mem::take(&mut self.buffers.sizes), mem::take(&mut self.buffers.pointers));
        sizes.resize(values.len(), 0);
        pointers.resize(values.len(), ptr::null());
        // SAFETY: live instance; the arrays have the stated lengths.
        let mut result = self.call_v3(NAME, |f, c| unsafe {
            let (sizes, pointers) = (sizes.as_mut_ptr(), pointers.as_mut_ptr());
            Some((f.get_binary?)(c, refs.as_ptr(), refs.len(), sizes, pointers, values.len()))
        });
        for (value, (size, pointer)) in values.iter_mut().zip(sizes.iter().zip(&pointers)) {
            value.clear();
            if result.is_err() || *size == 0 {
                continue;
            }
            if pointer.is_null() {
                result = Err(self.failure(NAME, NO_BYTES));
                continue;
            }
            // SAFETY: the FMU returned this number of bytes, which stay valid until its next function is called.
            value.extend_from_slice(unsafe { slice::from_raw_parts(*pointer, *size) });
        }
        (self.buffers.sizes, self.buffers.pointers) = (sizes, pointers);
        result
    }

    fn read_elements(&mut self, refs: &[Reference], mut values: &mut [Vec<u8>]) -> Result<(), CallError> {
        let mut array = mem::take(&mut self.buffers.binaries);
        let mut result = Ok(());
        for reference in refs {
            let own = values.split_off_mut(..self.elements(&[*reference])).unwrap_or_default();
            let read = match self.signature().element(*reference) {
                None => self.read_binary(&[*reference], own),
                Some((element, size)) => {
                    // Longer memory of another array is kept.
                    array.resize(array.len().max(size), Vec::new());
                    let read = self.read_binary(&[element.array], &mut array[..size]);
                    own[0].clone_from(&array[element.index]);
                    read
                }
            };
            result = result.and(read);
        }
        self.buffers.binaries = array;
        result
    }

    /// `fmi3SetBinary`: one value per element.
    pub fn set_binary<V: AsRef<[u8]>>(&mut self, refs: &[Reference], values: &[V]) -> Result<(), CallError> {
        if self.has_clocked(refs) {
            let to = |value: &V| Some(Value::Binary { hex: value.as_ref().to_vec() });
            return self.set_held(refs, values, to, Self::set_binary);
        }
        self.is_set_now(refs, &[], Self::get_real)?;
        const NAME: Function = Function::SetBinary;
        self.same_length(NAME, self.elements(refs), values.len())?;
        if self.has_special(refs) && self.has_elements(refs) {
            let values: Vec<Vec<u8>> = values.iter().map(|value| value.as_ref().to_vec()).collect();
            let of = |start: &Value| if let Value::Binary { hex } = start { Some(hex.clone()) } else { None };
            let set = |this: &mut Self, refs: &[Reference], values: &[Vec<u8>]| this.set_binary(refs, values);
            return self.set_list_elements(refs, &values, |whole| &mut whole.binaries, of, Self::get_binary, set);
        }
        if let [value] = values {
            return self.set_binaries(refs, &[value.as_ref().len()], &[value.as_ref().as_ptr()]);
        }
        let sizes: Vec<usize> = values.iter().map(|value| value.as_ref().len()).collect();
        let pointers: Vec<*const u8> = values.iter().map(|value| value.as_ref().as_ptr()).collect();
        self.set_binaries(refs, &sizes, &pointers)
    }

    fn set_binaries(&mut self, refs: &[Reference], sizes: &[usize], pointers: &[*const u8]) -> Result<(), CallError> {
        // SAFETY: live instance; both arrays have the stated length, and the bytes outlive the call.
        self.call_v3(Function::SetBinary, |f, c| unsafe {
            Some((f.set_binary?)(c, refs.as_ptr(), refs.len(), sizes.as_ptr(), pointers.as_ptr(), pointers.len()))
        })
    }
}
