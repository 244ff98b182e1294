//! Floating-point environments that a host may have (Intel 64 and IA-32 Architectures Software Developer's Manual, volume 1,
//! sections 8.1.5 and 10.2.3).

use std::arch::asm;

/// The control words of a thread.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FloatEnvironment {
    /// Control word of SSE (MXCSR), without the exception flags.
    pub mxcsr: u32,
    /// Control word of x87.
    pub x87: u16,
}

impl FloatEnvironment {
    /// All exceptions masked, rounding to nearest, subnormal numbers.
    pub const DEFAULT: Self = Self { mxcsr: 0x1f80, x87: 0x037f };
    /// Exceptions end the process, as with Delphi and `gfortran -ffpe-trap`: here all six.
    pub const TRAPS: Self = Self { mxcsr: 0, x87: 0x0340 };
    /// Rounding down.
    pub const DOWN: Self = Self { mxcsr: 0x3f80, x87: 0x077f };
    /// Rounding up.
    pub const UP: Self = Self { mxcsr: 0x5f80, x87: 0x0b7f };
    /// Rounding to zero.
    pub const TO_ZERO: Self = Self { mxcsr: 0x7f80, x87: 0x0f7f };
    /// Subnormal results and arguments are zero, as with `-ffast-math` in a C host.
    pub const FLUSH: Self = Self { mxcsr: 0x9fc0, x87: 0x037f };

    /// The environment of this thread.
    #[must_use]
    pub fn current() -> Self {
        let (mut mxcsr, mut x87) = (0_u32, 0_u16);
        // SAFETY: stores two registers.
        unsafe {
            asm!("stmxcsr [{}]", in(reg) &raw mut mxcsr);
            asm!("fnstcw [{}]", in(reg) &raw mut x87);
        }
        Self { mxcsr: mxcsr & !0x3f, x87 }
    }

    fn set(self) {
        // SAFETY: loads two registers; no exception is pending after fnclex.
        unsafe {
            asm!("fnclex");
            asm!("fldcw [{}]", in(reg) &raw const self.x87);
            asm!("ldmxcsr [{}]", in(reg) &raw const self.mxcsr);
        }
    }

    /// Runs `f` in this environment; returns the result of `f`, and the environment after it.
    pub fn around<R>(self, f: impl FnOnce() -> R) -> (R, Self) {
        /// Not inlined, because the compiler could otherwise move operations of `f` to another environment.
        #[inline(never)]
        fn apart<R>(f: impl FnOnce() -> R) -> R {
            f()
        }
        self.set();
        let result = apart(f);
        let left = Self::current();
        Self::DEFAULT.set();
        (result, left)
    }
}
