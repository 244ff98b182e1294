//! Getters and setters.

use super::{Checked, Fuzzer, MARK, Next, ensure};
use crate::raw::{Element, OK, Text, Truth};
use fmu_import::c_api::Reference;
use fmu_import::description::{DataType, FmiVersion};

impl Fuzzer<'_> {
    /// The number of values to state: usually the number of values of the variables, in FMI 2.0 the number of
    /// references.
    fn value_count(&mut self, references: &[Reference], count: usize) -> usize {
        if self.version == FmiVersion::V2 {
            return count;
        }
        let size = self.size(references.get(..count).unwrap_or(references));
        match self.random.below(30) {
            0 => usize::MAX,
            1 => size + 1,
            2 => size.saturating_sub(1),
            _ => size,
        }
    }

    /// Returns an error if a call was accepted with a wrong number of values.
    fn check_count(&self, function: &str, references: &[Reference], count: usize, value_count: usize) -> Checked {
        let is_right = count <= references.len()
            && (self.version == FmiVersion::V2 || self.size(&references[..count]) == value_count);
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
        let value_count = self.value_count(references, count);
        let mut values = vec![mark; self.size(references) + 2];
        let (known, written) = (self.maybe(references), self.maybe(values.as_mut_slice()));
        let is_null = written.is_none();
        let text = format!("{known:?} {count} values: {} {value_count}", written.is_some());
        let status = self.call(at, function, text, Next::Same, |instance| {
            instance.get_counted(known, count, written, value_count)
        })?;
        let used = if status == OK && !is_null { value_count } else { 0 };
        if status == OK {
            self.check_count(function, references, count, value_count)?;
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
            let size = self.size(&[*reference]);
            values.extend((0..size).map(|_| value(self, *reference)));
        }
        let count = self.count(references.len());
        let value_count = self.value_count(references, count);
        values.push(value(self, 0));
        let (known, values) = (self.maybe(references), self.maybe(values.as_slice()));
        let text = format!("{known:?} {count} {values:?} {value_count}");
        let status = self
            .call(at, function, text, Next::Same, |instance| instance.set_counted(known, count, values, value_count))?;
        if status != OK {
            return Ok(());
        }
        self.check_count(function, references, count, value_count)?;
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
            types.push(DataType::Enumeration);
        }
        let data_type = self.pick(&types);
        let references = self.references(data_type);
        let references = references.as_slice();
        match (data_type, self.chance(2)) {
            (DataType::Int32, true) => self.get(at, "fmi2GetInteger", references, i32::MIN + 77, |_| true),
            (DataType::Int32, false) => self.set(at, "fmi2SetInteger", references, |this, _| this.integer(), |_| true),
            (DataType::Enumeration, true) => self.get(at, "fmi3GetInt64", references, i64::MIN + 77, |_| true),
            (DataType::Enumeration, false) => {
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
