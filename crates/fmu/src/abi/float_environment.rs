//! The floating-point environment in which an FMU computes.
//!
//! A host may unmask exceptions (Delphi does, and `-ffpe-trap` of gfortran), choose another rounding, or flush subnormal
//! numbers to zero. Rust code assumes the default of IEEE 754, and so do models: with traps they would end the host, with
//! another rounding their results would change. Calls that compute run in the default environment and restore the
//! caller's.

#[cfg(target_arch = "aarch64")]
use aarch64::Control;
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
use fixed::Control;
#[cfg(target_arch = "x86_64")]
use x86_64::Control;

/// Sets the default environment, until [`leave`]. Returns that of the caller if it is another one.
///
/// The compiler does not model the environment. It cannot move operations on values read from memory to the other side of the assembly in
/// [`Control`]; numbers in registers go through [`argument`].
#[inline(always)]
pub(super) fn enter() -> Option<Control> {
    let callers = Control::current();
    if callers.is_default() { None } else { Some(replace(callers)) }
}

/// Restores the environment of the caller.
#[inline(always)]
pub(super) fn leave(callers: Option<Control>) {
    if let Some(callers) = callers {
        restore(callers);
    }
}

#[cold]
#[inline(never)]
fn replace(callers: Control) -> Control {
    callers.replace()
}

#[cold]
#[inline(never)]
fn restore(callers: Control) {
    callers.restore();
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
mod x86_64 {
    use std::arch::asm;

    /// MXCSR with all exceptions masked, rounding to nearest and subnormal numbers.
    const DEFAULT: u32 = 0x1f80;
    /// Exceptions that occurred: they change nothing.
    const FLAGS: u32 = 0x3f;

    #[derive(Clone, Copy)]
    pub(in crate::abi) struct Control(u32);

    impl Control {
        #[inline(always)]
        pub(super) fn current() -> Self {
            let mut mxcsr = 0_u32;
            // SAFETY: stores a register.
            unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut mxcsr, options(nostack, preserves_flags)) };
            Self(mxcsr)
        }

        #[inline(always)]
        pub(super) fn is_default(self) -> bool {
            self.0 & !FLAGS == DEFAULT
        }

        pub(super) fn replace(self) -> Self {
            Self(DEFAULT).restore();
            self
        }

        pub(super) fn restore(&self) {
            // SAFETY: the default, or what the caller's register held.
            unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const self.0, options(nostack, preserves_flags)) };
        }
    }
}

/// Arm Architecture Reference Manual for A-profile, register FPCR: all zeros are the default.
#[cfg(target_arch = "aarch64")]
mod aarch64 {
    use std::arch::asm;

    #[derive(Clone, Copy)]
    pub(in crate::abi) struct Control(u64);

    impl Control {
        #[inline(always)]
        pub(super) fn current() -> Self {
            let fpcr;
            // SAFETY: reads a register.
            unsafe { asm!("mrs {}, fpcr", out(reg) fpcr, options(nostack, preserves_flags)) };
            Self(fpcr)
        }

        #[inline(always)]
        pub(super) fn is_default(self) -> bool {
            self.0 == 0
        }

        pub(super) fn replace(self) -> Self {
            Self(0).restore();
            self
        }

        pub(super) fn restore(&self) {
            // SAFETY: zeros, or what the caller's register held.
            unsafe { asm!("msr fpcr, {}", in(reg) self.0, options(nostack, preserves_flags)) };
        }
    }
}

/// WebAssembly has one environment. Those of other processors are not changed.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod fixed {
    #[derive(Clone, Copy)]
    pub(in crate::abi) struct Control;

    impl Control {
        pub(super) fn current() -> Self {
            Self
        }
        pub(super) fn is_default(self) -> bool {
            true
        }
        pub(super) fn replace(self) -> Self {
            self
        }
        pub(super) fn restore(&self) {}
    }
}
