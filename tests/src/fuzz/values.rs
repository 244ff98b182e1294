//! Getters and setters.

use super::{Checked, Fuzzer, MARK, Next, ensure};
use crate::raw::{Element, OK, Octet, Text, Truth};
use fmu_import::c_api::Reference;
use fmu_import::description::{DataType, FmiVersion};

impl Fuzzer<'_> {
    /// The number of values to state: usually the number of values of the variables, in FMI 2.0 the number of
    /// references.
    fn value_count(&mut self, at: usize, references: &[Reference], count: usize) -> usize {
        if self.version == FmiVersion::V2 {
            return count;
        }
        let size = self.size(at, references.get(..count).unwrap_or(references));
        match self.random.below(30) {
            0 => usize::MAX,
            1 => size + 1,
            2 => size.saturating_sub(1),
            _ => size,
        }
    }

    /// Returns an error if a call was accepted with a wrong number of values.
    fn check_count(
        &self,
        at: usize,
        function: &str,
        references: &[Reference],
        count: usize,
        value_count: usize,
    ) -> Checked {
        let is_right = count <= references.len()
            && (self.version == FmiVersion::V2 || self.size(at, &references[..count]) == value_count);
        ensure(is_right, || format!("{function} accepted {value_count} values for {count} references"))
    }

    /// Calls a getter; `mark` is the content of the array before the call, `is_valid` checks the returned values.
    fn get<T: Element + PartialEq + std::fmt::Debug>(
        &mut self,
        at: usize,
        function: &'static str,
        references: &[Reference],
        mark: T,
        is_valid: impl Fn(&T) -> bool,
    ) -> Checked {
        let count = self.count(references.len());
        let value_count = self.value_count(at, references, count);
        let mut values = vec![mark; self.size(at, references) + 2];
        let (known, written) = (self.maybe(references), self.maybe(values.as_mut_slice()));
        let is_null = written.is_none();
        let text = format!("{known:?} {count} values: {} {value_count}", written.is_some());
        let status = self.call(at, function, text, Next::Same, |instance| {
            instance.get_counted(known, count, written, value_count)
        })?;
        let used = if status == OK && !is_null { value_count } else { 0 };
        if status == OK {
            self.check_count(at, function, references, count, value_count)?;
        }
        ensure(values[..used].iter().all(is_valid), || format!("{function} handed out {:?}", &values[..used]))?;
        ensure(values[used..].iter().all(|value| *value == mark), || {
            format!("{function} returned {status} and wrote what it should not: {values:?}")
        })
    }

    /// Calls a setter.
    fn set<T: Element + std::fmt::Debug>(
        &mut self,
        at: usize,
        function: &'static str,
        references: &[Reference],
        mut value: impl FnMut(&mut Self, Reference) -> T,
        is_valid: impl Fn(&T) -> bool,
    ) -> Checked {
        let mut values = Vec::new();
        for reference in references {
            let size = self.size(at, &[*reference]);
            values.extend((0..size).map(|_| value(self, *reference)));
        }
        let count = self.count(references.len());
        let value_count = self.value_count(at, references, count);
        values.push(value(self, 0));
        let (known, values) = (self.maybe(references), self.maybe(values.as_slice()));
        let text = format!("{known:?} {count} {values:?} {value_count}");
        let status = self
            .call(at, function, text, Next::Same, |instance| instance.set_counted(known, count, values, value_count))?;
        if status != OK {
            return Ok(());
        }
        self.check_count(at, function, references, count, value_count)?;
        let taken = values.map_or(&[][..], |values| &values[..value_count]);
        ensure(taken.iter().all(is_valid), || format!("{function} accepted {taken:?}"))
    }

    pub(super) fn get_real(&mut self, at: usize) -> Checked {
        let mut references = self.references(DataType::Float64);
        if let Some(time) = self.time.filter(|_| self.chance(8)) {
            // The value references of the event indicators follow the value reference of the time.
            let special = time + self.random.below(self.indicators as u64 + 2) as Reference;
            references.push(special);
            let position = self.index(references.len());
            references.swap(0, position);
        }
        self.get(at, "fmi2GetReal", &references, MARK, |value: &f64| value.is_finite())
    }

    pub(super) fn set_real(&mut self, at: usize) -> Checked {
        let references = self.references(DataType::Float64);
        self.set(at, "fmi2SetReal", &references, Self::value, |value| value.is_finite())
    }

    /// Calls getters and setters of Integers, enumerations, Booleans and Strings.
    pub(super) fn others(&mut self, at: usize) -> Checked {
        let is_fmi2 = self.version == FmiVersion::V2;
        let mut types = vec![DataType::Int32, DataType::Boolean, DataType::String];
        if !is_fmi2 {
            types.extend([
                DataType::Float32,
                DataType::Int8,
                DataType::UInt8,
                DataType::Int16,
                DataType::UInt16,
                DataType::UInt32,
                DataType::Int64,
                DataType::UInt64,
                DataType::Enumeration,
                DataType::Binary,
            ]);
            // Most FMUs have variables of few types.
            if self.chance(2) {
                types.retain(|data_type| self.of_type(*data_type).next().is_some());
            }
            if types.is_empty() {
                return Ok(());
            }
        }
        let data_type = self.pick(&types);
        let references = self.references(data_type);
        let references = references.as_slice();
        match (data_type, self.chance(2)) {
            (DataType::Int32, true) => self.get(at, "fmi2GetInteger", references, i32::MIN + 77, |_| true),
            (DataType::Int32, false) => self.set(at, "fmi2SetInteger", references, |this, _| this.integer(), |_| true),
            (DataType::Float32, true) => {
                let mark = MARK as f32;
                self.get(at, "fmi3GetFloat32", references, mark, |value| value.is_finite())
            }
            (DataType::Float32, false) => {
                let value = |this: &mut Self, reference| this.value(reference) as f32;
                self.set(at, "fmi3SetFloat32", references, value, |value| value.is_finite())
            }
            (DataType::Int8, true) => self.get(at, "fmi3GetInt8", references, 77_i8, |_| true),
            (DataType::Int8, false) => self.set(at, "fmi3SetInt8", references, |this, _| this.word() as i8, |_| true),
            (DataType::UInt8, true) => self.get(at, "fmi3GetUInt8", references, Octet(77), |_| true),
            (DataType::UInt8, false) => {
                self.set(at, "fmi3SetUInt8", references, |this, _| Octet(this.word() as u8), |_| true)
            }
            (DataType::Int16, true) => self.get(at, "fmi3GetInt16", references, 7777_i16, |_| true),
            (DataType::Int16, false) => {
                self.set(at, "fmi3SetInt16", references, |this, _| this.word() as i16, |_| true)
            }
            (DataType::UInt16, true) => self.get(at, "fmi3GetUInt16", references, 7777_u16, |_| true),
            (DataType::UInt16, false) => {
                self.set(at, "fmi3SetUInt16", references, |this, _| this.word() as u16, |_| true)
            }
            (DataType::UInt32, true) => self.get(at, "fmi3GetUInt32", references, u32::MAX - 77, |_| true),
            (DataType::UInt32, false) => {
                self.set(at, "fmi3SetUInt32", references, |this, _| this.word() as u32, |_| true)
            }
            (DataType::UInt64, true) => self.get(at, "fmi3GetUInt64", references, u64::MAX - 77, |_| true),
            // Lengths of arrays are set by `set_length`.
            (DataType::UInt64, false) if self.is_configuring(at) => Ok(()),
            (DataType::UInt64, false) => self.set(at, "fmi3SetUInt64", references, |this, _| this.word(), |_| true),
            (DataType::Binary, true) => self.get_binary(at, references),
            (DataType::Binary, false) => self.set_binary(at, references),
            (DataType::Enumeration | DataType::Int64, true) => {
                self.get(at, "fmi3GetInt64", references, i64::MIN + 77, |_| true)
            }
            (DataType::Enumeration | DataType::Int64, false) => {
                let value = |this: &mut Self, _| match this.random.below(8) {
                    0 => this.random.bits() as i64,
                    1 => i64::from(this.integer()) + (1 << 32),
                    _ => i64::from(this.integer()),
                };
                self.set(at, "fmi3SetInt64", references, value, |_| true)
            }
            (DataType::Boolean, true) if is_fmi2 => {
                self.get(at, "fmi2GetBoolean", references, Truth(77), |truth| matches!(truth.0, 0 | 1))
            }
            (DataType::Boolean, true) => {
                self.get(at, "fmi2GetBoolean", references, 77_u8, |truth| matches!(truth, 0 | 1))
            }
            (DataType::Boolean, false) if is_fmi2 => {
                self.set(at, "fmi2SetBoolean", references, |this, _| Truth(this.integer()), |_| true)
            }
            (DataType::Boolean, false) => {
                self.set(at, "fmi2SetBoolean", references, |this, _| this.integer() as u8, |_| true)
            }
            (_, true) => self.get_string(at, references),
            (_, false) => {
                let owned: Vec<_> = references.iter().map(|_| self.text()).collect();
                let values: Vec<_> = owned.iter().map(|text| Text::new(text.as_deref())).collect();
                let count = self.count(references.len());
                let (known, values) = (self.maybe(references), self.maybe(values.as_slice()));
                let text = format!("{known:?} {count} {owned:.60?}");
                self.call(at, "fmi2SetString", text, Next::Same, |instance| instance.set(known, count, values))?;
                Ok(())
            }
        }
    }

    /// The bits of an integer of any size, often small.
    fn word(&mut self) -> u64 {
        if self.chance(3) { self.random.bits() } else { self.random.below(5).wrapping_sub(1) }
    }

    fn get_binary(&mut self, at: usize, references: &[Reference]) -> Checked {
        let size = self.size(at, references);
        let count = if self.chance(20) { self.index(size + 2) } else { size };
        let (mut found, text) = (Vec::new(), format!("{references:?} {count}"));
        let status = self.call(at, "fmi3GetBinary", text, Next::Same, |instance| {
            let (status, values) = instance.get_binary(references, count);
            found = values;
            status
        })?;
        ensure(status != OK || (count == size && found.len() == count), || format!("fmi3GetBinary returned {found:?}"))
    }

    fn set_binary(&mut self, at: usize, references: &[Reference]) -> Checked {
        let size = self.size(at, references);
        let count = if self.chance(20) { self.index(size + 2) } else { size };
        let mut values = Vec::new();
        for _ in 0..count {
            let length = self.pick(&[0, 0, 1, 7, 100, 5000]);
            let bytes = (0..length).map(|_| self.random.bits() as u8).collect();
            values.push(self.maybe(bytes));
        }
        let is_huge = self.chance(40);
        let length = |value: &Option<Vec<u8>>| value.as_ref().map_or(usize::from(is_huge), Vec::len);
        let sizes: Vec<_> = values.iter().map(|value| if is_huge { usize::MAX } else { length(value) }).collect();
        let (function, text) = ("fmi3SetBinary", format!("{references:?} {count} {sizes:?}"));
        let status =
            self.call(at, function, text, Next::Same, |instance| instance.set_binary(references, &values, &sizes))?;
        ensure(status != OK || (count == size && (!is_huge || count == 0)), || {
            format!("{function} accepted {sizes:?}")
        })?;
        if status != OK || references.len() != 1 {
            return Ok(());
        }
        // What was set is read back, where that is possible.
        let (mut found, text) = (Vec::new(), format!("{references:?} {size}"));
        let status = self.call(at, "fmi3GetBinary", text, Next::Same, |instance| {
            let (status, values) = instance.get_binary(references, size);
            found = values;
            status
        })?;
        let expected: Vec<_> = values.into_iter().map(Option::unwrap_or_default).collect();
        ensure(status != OK || found == expected, || format!("fmi3GetBinary returned {found:?}, expected {expected:?}"))
    }

    fn get_string(&mut self, at: usize, references: &[Reference]) -> Checked {
        let count = self.count(references.len());
        let (known, room) = (self.maybe(references), self.maybe(references.len()));
        let text = format!("{known:?} {count} values: {}", room.is_some());
        let mut found = Vec::new();
        let status = self.call(at, "fmi2GetString", text, Next::Same, |instance| {
            let (status, texts) = instance.get_texts(known, count, room);
            found = texts;
            status
        })?;
        ensure(status != OK || found.len() == count, || "fmi2GetString returned a null pointer".to_owned())?;
        ensure(found.iter().all(|text| std::str::from_utf8(text).is_ok()), || "a text is not UTF-8".to_owned())
    }
}
