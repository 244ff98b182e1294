//! Numeric types of variables other than `f64`. A value is stored in a word of 64 bits.

use std::ops::RangeInclusive;

/// A number of any integer type as text. Formatting `i128` itself needs code that a library does not contain otherwise.
pub(crate) fn text(number: i128) -> String {
    i64::try_from(number).map_or_else(|_| (number as u64).to_string(), |number| number.to_string())
}

/// The number in a word as text. Formatting `f32` itself needs code that a library does not contain otherwise.
pub(crate) fn word_text(size: Option<Size>, word: u64) -> String {
    size.map_or_else(|| f64::from(f32::of(word)).to_string(), |size| text(size.value(word)))
}

/// Returns true if a number is finite, by its bits: independent of the floating-point environment of the host.
#[inline]
pub(crate) const fn is_finite(value: f64) -> bool {
    value.to_bits() << 1 < f64::INFINITY.to_bits() << 1
}

/// As [`is_finite`], for the word of an `f32`.
#[inline]
pub(crate) const fn is_finite_f32(word: u64) -> bool {
    word & 0x7f80_0000 != 0x7f80_0000
}

/// A number that is stored in a word. Signed integers are sign-extended; an `f32` is stored as its bits.
pub trait Number: Copy {
    /// Number of bits and sign of an integer; `None` for `f32`.
    const SIZE: Option<Size>;
    /// The number in a word.
    fn of(word: u64) -> Self;
    /// The word of the number.
    fn word(self) -> u64;
}

impl Number for f32 {
    const SIZE: Option<Size> = None;
    #[inline]
    fn of(word: u64) -> Self {
        Self::from_bits(word as u32)
    }
    #[inline]
    fn word(self) -> u64 {
        self.to_bits().into()
    }
}

macro_rules! integers {
    ($($type:ident $name:ident;)*) => {
        /// Number of bits and sign of an integer.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Size { $(
            #[doc = concat!("As in `", stringify!($type), "`.")]
            $name,
        )* }

        impl Size {
            /// Name of the type in FMI 3.0.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$name => stringify!($name),)* }
            }
            /// All values of the type.
            pub const fn range(self) -> RangeInclusive<i128> {
                match self { $(Self::$name => $type::MIN as i128..=$type::MAX as i128,)* }
            }
            /// The integer in a word.
            pub const fn value(self, word: u64) -> i128 {
                match self { $(Self::$name => word as $type as i128,)* }
            }
        }

        $(impl Number for $type {
            const SIZE: Option<Size> = Some(Size::$name);
            #[inline]
            fn of(word: u64) -> Self {
                word as Self
            }
            #[inline]
            fn word(self) -> u64 {
                self as u64
            }
        })*
    };
}
integers! {
    i8 Int8;
    u8 UInt8;
    i16 Int16;
    u16 UInt16;
    i32 Int32;
    u32 UInt32;
    i64 Int64;
    u64 UInt64;
}
