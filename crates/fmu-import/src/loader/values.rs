//! Values of variables and their derivatives.

use super::calls::Function;
use super::error::CallError;
use super::instance::Instance;
use super::strings::text;
use crate::c_api::{self, Reference};
use std::ptr;

impl Instance {
    /// `fmi2GetReal`.
    ///
    /// # Errors
    /// The lengths differ or the FMU returns an error.
    pub fn get_real(&mut self, refs: &[Reference], values: &mut [f64]) -> Result<(), CallError> {
        self.same_length(Function::GetReal, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::GetReal, |f, c| unsafe { (f.get_real)(c, refs.as_ptr(), refs.len(), values.as_mut_ptr()) })
    }

    /// `fmi2GetInteger`, also for enumerations.
    ///
    /// # Errors
    /// The lengths differ or the FMU returns an error.
    pub fn get_integer(&mut self, refs: &[Reference], values: &mut [i32]) -> Result<(), CallError> {
        self.same_length(Function::GetInteger, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::GetInteger, |f, c| unsafe {
            (f.get_integer)(c, refs.as_ptr(), refs.len(), values.as_mut_ptr())
        })
    }

    /// `fmi2GetBoolean`; 0 is false, all else true.
    ///
    /// # Errors
    /// The lengths differ or the FMU returns an error.
    pub fn get_boolean(&mut self, refs: &[Reference], values: &mut [c_api::Boolean]) -> Result<(), CallError> {
        self.same_length(Function::GetBoolean, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::GetBoolean, |f, c| unsafe {
            (f.get_boolean)(c, refs.as_ptr(), refs.len(), values.as_mut_ptr())
        })
    }

    /// `fmi2GetString`.
    ///
    /// # Errors
    /// The FMU returns an error.
    pub fn get_string(&mut self, refs: &[Reference]) -> Result<Vec<String>, CallError> {
        let mut pointers = vec![ptr::null(); refs.len()];
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::GetString, |f, c| unsafe {
            (f.get_string)(c, refs.as_ptr(), refs.len(), pointers.as_mut_ptr())
        })?;
        // SAFETY: the FMU filled in C strings that stay valid until its next function is called.
        Ok(pointers.into_iter().map(|p| unsafe { text(p) }).collect())
    }

    /// `fmi2SetReal`.
    ///
    /// # Errors
    /// The lengths differ or the FMU returns an error.
    pub fn set_real(&mut self, refs: &[Reference], values: &[f64]) -> Result<(), CallError> {
        self.same_length(Function::SetReal, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::SetReal, |f, c| unsafe { (f.set_real)(c, refs.as_ptr(), refs.len(), values.as_ptr()) })
    }

    /// `fmi2SetInteger`, also for enumerations.
    ///
    /// # Errors
    /// The lengths differ or the FMU returns an error.
    pub fn set_integer(&mut self, refs: &[Reference], values: &[i32]) -> Result<(), CallError> {
        self.same_length(Function::SetInteger, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::SetInteger, |f, c| unsafe {
            (f.set_integer)(c, refs.as_ptr(), refs.len(), values.as_ptr())
        })
    }

    /// `fmi2SetBoolean`; values are 0 or 1.
    ///
    /// # Errors
    /// The lengths differ or the FMU returns an error.
    pub fn set_boolean(&mut self, refs: &[Reference], values: &[c_api::Boolean]) -> Result<(), CallError> {
        self.same_length(Function::SetBoolean, refs.len(), values.len())?;
        // SAFETY: live instance; both arrays have the stated length.
        self.call(Function::SetBoolean, |f, c| unsafe {
            (f.set_boolean)(c, refs.as_ptr(), refs.len(), values.as_ptr())
        })
    }

    /// `fmi2SetString`.
    ///
    /// # Errors
    /// The lengths differ, a value holds a zero byte, or the FMU returns an error.
    pub fn set_string(&mut self, refs: &[Reference], values: &[&str]) -> Result<(), CallError> {
        self.same_length(Function::SetString, refs.len(), values.len())?;
        let (_owned, pointers) = self.c_strings(Function::SetString, values)?;
        // SAFETY: live instance; both arrays have the stated length, the strings live on.
        self.call(Function::SetString, |f, c| unsafe {
            (f.set_string)(c, refs.as_ptr(), refs.len(), pointers.as_ptr())
        })
    }

    /// `fmi2GetDirectionalDerivative`: `result` = d(unknowns)/d(knowns) * `seed`.
    ///
    /// # Errors
    /// The lengths differ, or the FMU returns an error or lacks the function.
    pub fn get_directional_derivative(
        &mut self,
        unknowns: &[Reference],
        knowns: &[Reference],
        seed: &[f64],
        result: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::GetDirectionalDerivative;
        self.same_length(NAME, knowns.len(), seed.len())?;
        self.same_length(NAME, unknowns.len(), result.len())?;
        self.call_optional(
            NAME,
            |f| f.get_directional_derivative,
            // SAFETY: live instance; all arrays have the stated lengths.
            |f, c| unsafe {
                f(
                    c,
                    unknowns.as_ptr(),
                    unknowns.len(),
                    knowns.as_ptr(),
                    knowns.len(),
                    seed.as_ptr(),
                    result.as_mut_ptr(),
                )
            },
        )
    }

    /// `fmi2SetRealInputDerivatives`; an order per reference, from 1.
    ///
    /// # Errors
    /// The lengths differ, or the FMU returns an error or lacks the function.
    pub fn set_real_input_derivatives(
        &mut self,
        refs: &[Reference],
        orders: &[i32],
        values: &[f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::SetRealInputDerivatives;
        self.same_length(NAME, refs.len(), values.len())?;
        self.same_length(NAME, refs.len(), orders.len())?;
        self.call_optional(
            NAME,
            |f| f.set_real_input_derivatives,
            // SAFETY: live instance; all arrays have the stated length.
            |f, c| unsafe { f(c, refs.as_ptr(), refs.len(), orders.as_ptr(), values.as_ptr()) },
        )
    }

    /// `fmi2GetRealOutputDerivatives`; an order per reference, from 1.
    ///
    /// # Errors
    /// The lengths differ, or the FMU returns an error or lacks the function.
    pub fn get_real_output_derivatives(
        &mut self,
        refs: &[Reference],
        orders: &[i32],
        values: &mut [f64],
    ) -> Result<(), CallError> {
        const NAME: Function = Function::GetRealOutputDerivatives;
        self.same_length(NAME, refs.len(), values.len())?;
        self.same_length(NAME, refs.len(), orders.len())?;
        self.call_optional(
            NAME,
            |f| f.get_real_output_derivatives,
            // SAFETY: live instance; all arrays have the stated length.
            |f, c| unsafe { f(c, refs.as_ptr(), refs.len(), orders.as_ptr(), values.as_mut_ptr()) },
        )
    }
}
