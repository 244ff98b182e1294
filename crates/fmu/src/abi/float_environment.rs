//! The floating-point environment in which an FMU computes.
//!
//! A host may unmask exceptions (Delphi does, and `-ffpe-trap` of gfortran), choose another rounding, or flush subnormal
//! numbers to zero. Rust code assumes the default of IEEE 754, and so do models: with traps they would end the host, with
//! another rounding their results would change. Calls that compute run in the default environment and restore the
//! caller's.

use control::{DEFAULT, FLAGS, Register, read, write};

/// Sets the default environment, until [`leave`]. Returns that of the caller if it is another one.
///
/// The compiler does not model the environment. It cannot move operations on values read from memory to the other side of the assembly in
/// [`control`]; numbers in registers go through [`argument`].
#[inline(always)]
pub(super) fn enter() -> Option<Register> {
    let callers = read();
    if callers & !FLAGS == DEFAULT {
        return None;
    }
    change(DEFAULT);
    Some(callers)
}

/// Restores the environment of the caller.
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

/// A number that the caller passed, to be used between [`enter`] and [`leave`] only.
#[inline(always)]
#[cfg_attr(not(target_arch = "x86_64"), expect(unused_mut, reason = "only assembly changes it"))]
pub(super) fn argument(mut number: f64) -> f64 {
    // SAFETY: no instruction. Assembly keeps its order, and the following code uses its result.
    #[cfg(target_arch = "x86_64")]
    unsafe {
        std::arch::asm!("/* {} */", inout(xmm_reg) number, options(nomem, nostack, preserves_flags));
    }
    #[cfg(not(target_arch = "x86_64"))]
    let number = std::hint::black_box(number);
    number
}

/// Intel 64 and IA-32 Architectures Software Developer's Manual, volume 1, section 10.2.3: SSE, with which Rust computes. The
/// x87 unit has registers of its own and serves C code with `long double` only.
#[cfg(target_arch = "x86_64")]
mod control {
    use std::arch::asm;

    pub(super) type Register = u32;
    /// MXCSR with all exceptions masked, rounding to nearest and subnormal numbers.
    pub(super) const DEFAULT: Register = 0x1f80;
    /// Exceptions that occurred: they change nothing.
    pub(super) const FLAGS: Register = 0x3f;

    #[inline(always)]
    pub(super) fn read() -> Register {
        let mut mxcsr = 0;
        // SAFETY: stores a register.
        unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut mxcsr, options(nostack, preserves_flags)) };
        mxcsr
    }

    pub(super) fn write(mxcsr: Register) {
        // SAFETY: the default, or what the caller's register held.
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
        // SAFETY: zeros, or what the caller's register held.
        unsafe { asm!("msr fpcr, {}", in(reg) fpcr, options(nostack, preserves_flags)) };
    }
}

/// WebAssembly has one environment. Those of other processors are not changed.
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
