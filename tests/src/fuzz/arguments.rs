//! Random arguments.

use super::{Fuzzer, Length, Spec};
use fmu_import::c_api::Reference;
use fmu_import::description::{DataType, FmiVersion};
use std::ffi::CString;

impl Fuzzer<'_> {
    pub(super) fn chance(&mut self, one_in: u64) -> bool {
        self.random.below(one_in) == 0
    }

    pub(super) fn pick<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.random.below(all.len() as u64) as usize]
    }

    pub(super) fn index(&mut self, length: usize) -> usize {
        self.random.below(length as u64) as usize
    }

    /// Any number, including NaN and infinity.
    pub(super) fn wild(&mut self) -> f64 {
        const NUMBERS: [f64; 22] = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
            5e-324,
            -5e-324,
            f64::MIN_POSITIVE,
            1e-300,
            1e-9,
            -1e-9,
            0.1,
            1e3,
            -1e3,
            1e15,
            9_007_199_254_740_993.0,
            1e300,
            1.7e308,
            -1.7e308,
            f64::MAX,
        ];
        match self.random.below(4) {
            0 => f64::from_bits(self.random.bits()),
            1 => self.random.symmetric() * 10.0,
            _ => self.pick(&NUMBERS),
        }
    }

    pub(super) fn integer(&mut self) -> i32 {
        match self.random.below(3) {
            0 => self.pick(&[i32::MIN, i32::MAX, -1, 0, 1, 2, 1000]),
            1 => self.random.bits() as i32,
            _ => self.random.below(5) as i32,
        }
    }

    /// A number that is usually valid for the variable.
    pub(super) fn value(&mut self, reference: Reference) -> f64 {
        if self.chance(12) {
            return self.wild();
        }
        let symmetric = self.random.symmetric();
        let kind = self.random.below(8);
        match self.specs.iter().find(|spec| spec.reference == reference) {
            None => symmetric,
            Some(spec) if kind == 0 => spec.limits[0],
            Some(spec) if kind == 1 => spec.limits[1],
            Some(spec) if kind == 2 => spec.limits[0] + 0.5 * (1.0 + symmetric) * (spec.limits[1] - spec.limits[0]),
            Some(spec) if spec.start == 0.0 => 0.05 * symmetric,
            Some(spec) => spec.start * (1.0 + 0.1 * symmetric),
        }
    }

    /// The variables of a type.
    pub(super) fn of_type(&self, data_type: DataType) -> impl Iterator<Item = &Spec> {
        self.specs.iter().filter(move |spec| spec.data_type == data_type)
    }

    /// The total number of values of these variables in an instance; 1 for an unknown variable.
    pub(super) fn size(&self, at: usize, references: &[Reference]) -> usize {
        let lengths = &self.slots[at].lengths;
        let length = |dimension: &Length| match *dimension {
            Length::Fixed(length) => length,
            Length::Parameter(parameter) => lengths[parameter] as usize,
        };
        let of = |spec: &Spec| spec.dimensions.iter().map(length).product();
        let size = |reference| self.specs.iter().find(|spec| spec.reference == reference).map_or(1, of);
        if self.version == FmiVersion::V2 { references.len() } else { references.iter().copied().map(size).sum() }
    }

    /// Random references, mostly of variables of this type.
    pub(super) fn references(&mut self, data_type: DataType) -> Vec<Reference> {
        let of_type: Vec<_> = self.of_type(data_type).map(|spec| spec.reference).collect();
        if self.chance(8) {
            return of_type;
        }
        let last = self.specs.len() as u64;
        (0..self.random.below(6))
            .map(|_| match self.random.below(24) {
                0 => self.pick(&[Reference::MAX, 0, 1 << 31, 4_000_000_000]),
                1 => self.random.below(last + 2) as Reference,
                _ if of_type.is_empty() => self.random.below(last + 2) as Reference,
                _ => self.pick(&of_type),
            })
            .collect()
    }

    /// The number of values to state for an array: all, fewer, or more than memory can hold.
    pub(super) fn count(&mut self, length: usize) -> usize {
        match self.random.below(40) {
            0 => usize::MAX,
            1 => self.index(length + 1),
            _ => length,
        }
    }

    /// The array, or a null pointer.
    pub(super) fn maybe<T>(&mut self, value: T) -> Option<T> {
        (!self.chance(40)).then_some(value)
    }

    pub(super) fn text(&mut self) -> Option<CString> {
        let bytes = match self.random.below(9) {
            0 => return None,
            1 => Vec::new(),
            2 => b"%s%n%d%100$s".to_vec(),
            3 => vec![0xff, 0xfe, 0xc0, 0x80],
            4 => vec![b'x'; 10_000],
            5 if self.chance(20) => "\u{20ac}".repeat(400_000).into_bytes(),
            6 => (1..=255).collect(),
            7 => "logEvents".into(),
            _ => b"file:///tmp/#r1#%zz%e2%82".to_vec(),
        };
        Some(CString::new(bytes).expect("no zeros"))
    }
}
