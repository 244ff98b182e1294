//! The floating-point environment in which an FMU computes.
//!
//! A host may unmask exceptions (Delphi does, and `-ffpe-trap` of gfortran), choose another rounding, or flush subnormal
//! numbers to zero. Rust code assumes the default of IEEE 754, and so do models: with traps they would end the host, with
//! another rounding their results would change. Calls run in the default environment and give the caller's back.

#[cfg(target_arch = "aarch64")]
use aarch64::{Control, Saved};
#[cfg(not(any(
    target_arch = "x86_64",
    all(target_arch = "x86", target_feature = "sse2"),
    target_arch = "aarch64"
)))]
use fixed::{Control, Saved};
#[cfg(any(target_arch = "x86_64", all(target_arch = "x86", target_feature = "sse2")))]
use x86::{Control, Saved};

/// Runs `f` in the default environment.
#[inline(always)]
pub(super) fn in_default<R>(f: impl FnOnce() -> R) -> R {
    let callers = Control::current();
    if callers.is_default() { apart(f) } else { replaced(callers, f) }
}

/// Not inlined: the compiler, which knows nothing of the environment, may not move an operation of `f` in front of the check.
#[inline(never)]
fn apart<R>(f: impl FnOnce() -> R) -> R {
    f()
}

#[cold]
#[inline(never)]
fn replaced<R>(callers: Control, f: impl FnOnce() -> R) -> R {
    struct Restore(Saved);
    impl Drop for Restore {
        fn drop(&mut self) {
            self.0.restore();
        }
    }
    let _restore = Restore(callers.replace());
    apart(f)
}

/// Intel 64 and IA-32 Architectures Software Developer's Manual, volume 1, sections 8.1 (x87) and 10.2.3 (SSE).
#[cfg(any(target_arch = "x86_64", all(target_arch = "x86", target_feature = "sse2")))]
mod x86 {
    use std::arch::asm;

    /// MXCSR with all exceptions masked, rounding to nearest and subnormal numbers.
    const SSE: u32 = 0x1f80;
    /// Exceptions that occurred: they change nothing.
    const SSE_FLAGS: u32 = 0x3f;
    /// Masks of exceptions and the rounding. The precision, which differs between systems, is the caller's.
    const X87_BITS: u16 = 0x0c3f;
    const X87: u16 = 0x003f;

    #[derive(Clone, Copy)]
    pub(super) struct Control {
        sse: u32,
        x87: u16,
    }

    pub(super) struct Saved {
        sse: u32,
        /// As fnstenv writes it: an exception that is pending stays pending.
        x87: [u32; 7],
    }

    impl Control {
        #[inline(always)]
        pub(super) fn current() -> Self {
            let (mut sse, mut x87) = (0_u32, 0_u16);
            // SAFETY: stores two registers.
            unsafe {
                asm!("stmxcsr [{}]", in(reg) &raw mut sse, options(nostack, preserves_flags));
                asm!("fnstcw [{}]", in(reg) &raw mut x87, options(nostack, preserves_flags));
            }
            Self { sse, x87 }
        }

        #[inline(always)]
        pub(super) fn is_default(self) -> bool {
            self.sse & !SSE_FLAGS == SSE && self.x87 & X87_BITS == X87
        }

        /// Sets the default and returns what to restore.
        pub(super) fn replace(self) -> Saved {
            let mut saved = Saved { sse: self.sse, x87: [0; 7] };
            let (sse, x87) = (SSE, self.x87 & !X87_BITS | X87);
            // SAFETY: stores and loads registers; fnstenv masks all exceptions, so that fldcw meets none.
            unsafe {
                asm!("fnstenv [{}]", in(reg) &raw mut saved.x87, options(nostack, preserves_flags));
                asm!("fldcw [{}]", in(reg) &raw const x87, options(nostack, preserves_flags));
                asm!("ldmxcsr [{}]", in(reg) &raw const sse, options(nostack, preserves_flags));
            }
            saved
        }
    }

    impl Saved {
        pub(super) fn restore(&self) {
            // SAFETY: what the caller's registers held.
            unsafe {
                asm!("fldenv [{}]", in(reg) &raw const self.x87, options(nostack, preserves_flags));
                asm!("ldmxcsr [{}]", in(reg) &raw const self.sse, options(nostack, preserves_flags));
            }
        }
    }
}

/// Arm Architecture Reference Manual for A-profile, register FPCR: all zeros are the default.
#[cfg(target_arch = "aarch64")]
mod aarch64 {
    use std::arch::asm;

    #[derive(Clone, Copy)]
    pub(super) struct Control(u64);
    pub(super) type Saved = Control;

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

/// WebAssembly has one environment. Of other processors none is known here.
#[cfg(not(any(target_arch = "x86_64", all(target_arch = "x86", target_feature = "sse2"), target_arch = "aarch64")))]
mod fixed {
    #[derive(Clone, Copy)]
    pub(super) struct Control;
    pub(super) type Saved = Control;

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
