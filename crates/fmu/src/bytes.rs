//! Values of the type Binary: a limited number of bytes, stored without an allocation.

use std::fmt::{Debug, Formatter};
use std::ops::Deref;

use crate::discrete_state::{StateField, Word, Words};

/// The type of a Binary variable (FMI 3.0): up to `N` bytes. `N` is the `maxSize` of the variable.
///
/// ```
/// let mut frame = fmu::Bytes::<8>::from(b"\x01\x02");
/// frame.push(3);
/// assert_eq!((frame.len(), &frame[1..]), (3, &[2, 3][..]));
/// ```
#[derive(Clone)]
pub struct Bytes<const N: usize> {
    length: usize,
    bytes: [u8; N],
}

impl<const N: usize> Bytes<N> {
    /// No bytes.
    pub const fn new() -> Self {
        Self { length: 0, bytes: [0; N] }
    }

    /// Replaces the bytes.
    ///
    /// # Panics
    /// If there are more than `N` bytes. In an FMU, the current call then fails with the message of the panic.
    pub fn set(&mut self, bytes: &[u8]) {
        assert!(bytes.len() <= N, "{} bytes are too many for a Binary of at most {N}", bytes.len());
        self.length = bytes.len();
        self.bytes[..bytes.len()].copy_from_slice(bytes);
    }

    /// Appends bytes.
    ///
    /// # Panics
    /// If there would be more than `N` bytes.
    pub fn extend(&mut self, bytes: &[u8]) {
        let end = self.length + bytes.len();
        assert!(end <= N, "{end} bytes are too many for a Binary of at most {N}");
        self.bytes[self.length..end].copy_from_slice(bytes);
        self.length = end;
    }

    /// Appends a byte.
    ///
    /// # Panics
    /// If there are already `N` bytes.
    pub fn push(&mut self, byte: u8) {
        self.extend(&[byte]);
    }

    /// Removes all bytes.
    pub const fn clear(&mut self) {
        self.length = 0;
    }
}

impl<const N: usize> Default for Bytes<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Deref for Bytes<N> {
    type Target = [u8];
    #[inline]
    fn deref(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

impl<const N: usize, const M: usize> From<&[u8; M]> for Bytes<N> {
    fn from(bytes: &[u8; M]) -> Self {
        let mut this = Self::new();
        this.set(bytes);
        this
    }
}

impl<const N: usize> Debug for Bytes<N> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        (**self).fmt(f)
    }
}

impl<const N: usize> PartialEq for Bytes<N> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<const N: usize> Eq for Bytes<N> {}

impl<const N: usize> StateField for Bytes<N> {
    fn save(&self, sink: &mut dyn FnMut(Word<'_>)) {
        sink(Word::Bytes(self));
    }
    fn load(&mut self, name: &'static str, source: &mut Words<'_>) -> Result<(), String> {
        let bytes = source.bytes(name)?;
        if bytes.len() > N {
            return Err(format!("'{name}' must have at most {N} bytes, got {}", bytes.len()));
        }
        self.set(bytes);
        Ok(())
    }
}

/// The bytes of a variable, in memory that is allocated once.
#[derive(Clone, Debug)]
pub struct Buffer {
    length: usize,
    bytes: Box<[u8]>,
}

impl Buffer {
    /// Allocates memory for at most `most` bytes.
    pub fn new(most: usize, start: &[u8]) -> Self {
        let mut this = Self { length: 0, bytes: vec![0; most].into() };
        this.set(start);
        this
    }

    /// The greatest possible number of bytes.
    pub fn most(&self) -> usize {
        self.bytes.len()
    }

    /// Replaces the bytes. Panics if there are more than [`Self::most`].
    pub fn set(&mut self, bytes: &[u8]) {
        self.bytes[..bytes.len()].copy_from_slice(bytes);
        self.length = bytes.len();
    }
}

impl Deref for Buffer {
    type Target = [u8];
    fn deref(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

impl PartialEq for Buffer {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}
