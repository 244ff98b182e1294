//! The floating-point environment in which an FMU computes.
//!
//! A host can unmask exceptions (as Delphi and gfortran's `-ffpe-trap` do), choose another rounding mode, or flush
//! subnormal numbers to zero. Unmasked exceptions would terminate the host; another rounding mode would change the
//! results. Calls that compute therefore run in the default environment of IEEE 754 and then restore the caller's
//! environment.

use control::{DEFAULT, FLAGS, Register, read, write};

/// Sets the default environment, until [`leave`]. Returns the caller's environment if it is not the default.
///
/// The compiler does not know that operations depend on the environment. It cannot move operations on values that are
/// read from memory across the assembly in [`control`], but it could move operations on numbers in registers: pass
/// these numbers through [`argument`].
#[inline(always)]
pub(super) fn enter() -> Option<Register> {
    let callers = read();
    if callers & !FLAGS == DEFAULT {
        return None;
    }
    change(DEFAULT);
    Some(callers)
}

#[inline(always)]
pub(super) fn leave(callers: Option<Register>) {
    if let Some(callers) = callers {
        change(callers);
    }
}

#[cold]
#[inline(never)]
fn change(register: Register) {
    write(register);
}

/// Keeps the compiler from moving operations on an argument out of the code between [`enter`] and [`leave`].
#[inline(always)]
#[cfg_attr(not(target_arch = "x86_64"), expect(unused_mut, reason = "only assembly changes it"))]
pub(super) fn argument(mut number: f64) -> f64 {
    // SAFETY: the assembly contains no instruction. It keeps its place, and the following code uses its result.
    #[cfg(target_arch = "x86_64")]
    unsafe {
        std::arch::asm!("/* {} */", inout(xmm_reg) number, options(nomem, nostack, preserves_flags));
    }
    #[cfg(not(target_arch = "x86_64"))]
    let number = std::hint::black_box(number);
    number
}

/// Intel 64 and IA-32 Architectures Software Developer's Manual, volume 1, section 10.2.3. Rust computes with SSE. The
/// x87 unit, which has separate registers, is used only by C code with `long double`.
#[cfg(target_arch = "x86_64")]
mod control {
    use std::arch::asm;

    pub(super) type Register = u32;
    /// MXCSR with all exceptions masked, rounding to nearest and subnormal numbers.
    pub(super) const DEFAULT: Register = 0x1f80;
    /// Flags of exceptions that occurred; they do not influence computations.
    pub(super) const FLAGS: Register = 0x3f;

    #[inline(always)]
    pub(super) fn read() -> Register {
        let mut mxcsr = 0;
        // SAFETY: stores a register.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut mxcsr, options(nostack, preserves_flags)) };
        mxcsr
    }

    pub(super) fn write(mxcsr: Register) {
        // SAFETY: writes the default, or the value that the caller's register had.
        unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const mxcsr, options(nostack, preserves_flags)) };
    }
}

/// Arm Architecture Reference Manual for A-profile, register FPCR: all zeros are the default.
#[cfg(target_arch = "aarch64")]
mod control {
    use std::arch::asm;

    pub(super) type Register = u64;
    pub(super) const DEFAULT: Register = 0;
    pub(super) const FLAGS: Register = 0;

    #[inline(always)]
    pub(super) fn read() -> Register {
        let fpcr;
        // SAFETY: reads a register.
        unsafe { asm!("mrs {}, fpcr", out(reg) fpcr, options(nostack, preserves_flags)) };
        fpcr
    }

    pub(super) fn write(fpcr: Register) {
        // SAFETY: writes zeros, or the value that the caller's register had.
        unsafe { asm!("msr fpcr, {}", in(reg) fpcr, options(nostack, preserves_flags)) };
    }
}

/// WebAssembly has only the default environment. On other processors, the environment is not changed.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod control {
    pub(super) type Register = u32;
    pub(super) const DEFAULT: Register = 0;
    pub(super) const FLAGS: Register = 0;

    pub(super) fn read() -> Register {
        DEFAULT
    }
    pub(super) fn write(_: Register) {}
}
