//! The floating-point environment of a thread: rounding, traps, treatment of denormal numbers.
//!
//! An FMU that changes the environment would change the results of other FMUs and of the master. The environment is
//! therefore checked after each call, and restored if it differs from its value at instantiation.

use std::collections::BTreeSet;
use std::hint::black_box;
use std::sync::{Mutex, PoisonError};

/// Returns true if operations round to nearest. If the inexact exception is not masked, this test traps. It is faster
/// than reading the control word, which takes some nanoseconds.
#[inline]
pub(super) fn rounds_to_nearest() -> bool {
    let (one, half_ulp) = (black_box(1.0_f64), black_box(f64::EPSILON / 2.0));
    // Each of the other rounding modes changes one of these results.
    one + half_ulp == 1.0 && -one - half_ulp == -1.0 && one - 0.5 * half_ulp == 1.0
}

/// The control word of a thread.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FloatEnvironment(u64);

/// Functions that changed the environment, and what they changed.
static RESTORED: Mutex<BTreeSet<(&'static str, &'static str)>> = Mutex::new(BTreeSet::new());

/// Returns the functions of FMUs that changed the environment since the last call, and what they changed.
pub fn take_restored() -> BTreeSet<(&'static str, &'static str)> {
    std::mem::take(&mut *RESTORED.lock().unwrap_or_else(PoisonError::into_inner))
}

impl FloatEnvironment {
    /// Restores the environment after `function` has changed it. Returns what was changed.
    #[cold]
    pub(super) fn restore(self, function: &'static str) -> &'static str {
        let change = self.difference(Self::current());
        self.set();
        RESTORED.lock().unwrap_or_else(PoisonError::into_inner).insert((function, change));
        change
    }
}

#[cfg(target_arch = "x86_64")]
mod processor {
    use super::FloatEnvironment;
    use std::arch::asm;

    /// Exception flags in MXCSR. Operations set them, but they have no effect.
    const FLAGS: u32 = 0x3f;
    const DENORMALS_ARE_ZERO: u64 = 1 << 6;
    const MASKS: u64 = 0x3f << 7;
    const ROUNDING: u64 = 3 << 13;
    const FLUSH_TO_ZERO: u64 = 1 << 15;

    /// If set, inexact operations do not trap.
    const INEXACT_MASK: u64 = 1 << 12;

    impl FloatEnvironment {
        pub(in super::super) fn allows_inexact(self) -> bool {
            self.0 & INEXACT_MASK != 0
        }

        #[inline]
        pub(in super::super) fn current() -> Self {
            let mut word = 0_u32;
            // SAFETY: the instruction stores four bytes.
            unsafe { asm!("stmxcsr [{}]", in(reg) &raw mut word, options(nostack, preserves_flags)) };
            Self(u64::from(word & !FLAGS))
        }

        /// Sets the environment of this thread, including the x87 unit, whose precision is kept.
        pub(super) fn set(self) {
            let word = u32::try_from(self.0).unwrap_or(0x1f80);
            let mut old = 0_u16;
            let (masks, rounding) = ((self.0 & MASKS) >> 7, (self.0 & ROUNDING) >> 3);
            // SAFETY: the instructions load and store as many bytes as the variables have; all bits are defined.
            // Pending exceptions are cleared first, because unmasking one would raise it.
            unsafe {
                asm!("fnclex", "fnstcw [{}]", in(reg) &raw mut old, options(nostack, preserves_flags));
                let new = (old & !0xc3f) | u16::try_from(masks | rounding).unwrap_or(0x3f);
                asm!("fldcw [{}]", "ldmxcsr [{}]", in(reg) &raw const new, in(reg) &raw const word, options(nostack, preserves_flags, readonly));
            }
        }

        pub(super) fn difference(self, other: Self) -> &'static str {
            let changed = self.0 ^ other.0;
            if changed & ROUNDING != 0 {
                "the rounding mode"
            } else if changed & (DENORMALS_ARE_ZERO | FLUSH_TO_ZERO) != 0 {
                "the treatment of denormal numbers"
            } else {
                "the traps of floating-point operations"
            }
        }
    }
}

#[cfg(target_arch = "aarch64")]
mod processor {
    use super::FloatEnvironment;
    use std::arch::asm;

    const TRAPS: u64 = 0x9f00;
    const ROUNDING: u64 = 3 << 22;

    /// If set, inexact operations trap.
    const INEXACT_TRAP: u64 = 1 << 12;

    impl FloatEnvironment {
        pub(in super::super) fn allows_inexact(self) -> bool {
            self.0 & INEXACT_TRAP == 0
        }

        #[inline]
        pub(in super::super) fn current() -> Self {
            let word: u64;
            // SAFETY: the instruction reads a register that every program may read.
            unsafe { asm!("mrs {}, fpcr", out(reg) word, options(nomem, nostack, preserves_flags)) };
            Self(word)
        }

        pub(super) fn set(self) {
            // SAFETY: the word was read from this register.
            unsafe { asm!("msr fpcr, {}", in(reg) self.0, options(nomem, nostack, preserves_flags)) };
        }

        pub(super) fn difference(self, other: Self) -> &'static str {
            let changed = self.0 ^ other.0;
            if changed & ROUNDING != 0 {
                "the rounding mode"
            } else if changed & TRAPS != 0 {
                "the traps of floating-point operations"
            } else {
                "the treatment of denormal numbers"
            }
        }
    }
}

/// Other processors are not supported. WebAssembly has no floating-point environment.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod processor {
    use super::FloatEnvironment;

    impl FloatEnvironment {
        pub(in super::super) fn allows_inexact(self) -> bool {
            true
        }

        pub(in super::super) fn current() -> Self {
            Self(0)
        }

        pub(super) fn set(self) {}

        pub(super) fn difference(self, _: Self) -> &'static str {
            "the floating-point environment"
        }
    }
}
