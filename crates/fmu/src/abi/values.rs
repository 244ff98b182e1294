//! Functions that read and set values, for both versions of FMI.

use std::ffi::CStr;
use std::marker::PhantomData;

use super::c::{c_char, c_int, c_void, size_t};
use super::{Call, CallResult, Component, Export, Handle, Status, call, text, updates};
use crate::calls::{Function, Version};
use crate::instance::{CallError, Instance};
use crate::number::{Number, Size};
use crate::runner::Model;

/// Array arguments of a call. In FMI 2.0, the numbers of values and references are equal.
pub(super) struct List<V> {
    pub(super) references: *const u32,
    pub(super) count: size_t,
    pub(super) values: V,
    pub(super) value_count: size_t,
}

impl<V> List<V> {
    /// The list without its values.
    fn empty(self) -> List<()> {
        let Self { references, count, value_count, .. } = self;
        List { references, count, values: (), value_count }
    }
}

fn is_fmi3<E: Export>() -> bool {
    E::FORMAT.version == Version::Fmi3
}

/// Rejects arrays whose length is not the total number of values of the variables.
pub(super) fn check_count<E: Export>(call: &Call<E>, expected: usize, count: usize) -> CallResult {
    if expected == count {
        return Ok(());
    }
    Err(call.error(format_args!("nValues must be {expected} for these variables, got {count}")))
}

/// The value references of all elements of the variables.
#[inline(always)]
pub(super) unsafe fn elements<'h, E: Export>(
    h: &'h mut Handle<E>,
    call: &Call<E>,
    references: *const u32,
    count: size_t,
) -> Result<(&'h [u32], &'h mut Instance<E::Model>), CallError> {
    let name = if is_fmi3::<E>() { "valueReferences" } else { "vr" };
    let references = unsafe { call.array(name, references, count) }?;
    if updates::are_provided::<E>() && h.instance.is_updating() {
        updates::check_access(h, call, references)?;
    }
    if !E::FORMAT.arrays {
        return Ok((references, &mut h.instance));
    }
    h.elements.clear();
    for &reference in references {
        h.instance.elements_of(reference, &mut h.elements);
    }
    Ok((&h.elements, &mut h.instance))
}

const fn name_of_values<E: Export>() -> &'static str {
    if matches!(E::FORMAT.version, Version::Fmi3) { "values" } else { "value" }
}

#[inline(always)]
unsafe fn get<E: Export, V>(
    component: Component,
    function: Function,
    list: List<*mut V>,
    read: impl FnOnce(&mut Instance<E::Model>, &[u32], &mut [V]) -> CallResult,
) -> Status {
    unsafe {
        call::<E>(component, function, |h, call| {
            let values = call.array_mut(name_of_values::<E>(), list.values, list.value_count)?;
            let (references, instance) = elements(h, call, list.references, list.count)?;
            check_count(call, references.len(), values.len())?;
            read(instance, references, values)
        })
    }
}

#[inline(always)]
unsafe fn set<E: Export, V>(
    component: Component,
    function: Function,
    list: List<*const V>,
    write: impl FnOnce(&mut Instance<E::Model>, &[u32], &[V]) -> CallResult,
) -> Status {
    unsafe {
        call::<E>(component, function, |h, call| {
            let values = call.array(name_of_values::<E>(), list.values, list.value_count)?;
            let (references, instance) = elements(h, call, list.references, list.count)?;
            check_count(call, references.len(), values.len())?;
            write(instance, references, values)
        })
    }
}

/// The functions for types of which no variable can be set: numbers of a size, Booleans, Strings and Binaries. A library
/// contains one copy, which is smaller than each of them.
#[inline(never)]
unsafe fn set_nothing<E: Export>(
    component: Component,
    function: Function,
    size: Option<Size>,
    list: List<()>,
) -> Status {
    unsafe {
        call::<E>(component, function, |h, call| {
            let (references, instance) = elements(h, call, list.references, list.count)?;
            check_count(call, references.len(), list.value_count)?;
            instance.set_nothing(function, size, references)
        })
    }
}

/// Reads values one by one and writes them to `targets`. All references are checked before the first value is written.
pub(super) fn each<M: Model, V, T>(
    instance: &mut Instance<M>,
    references: &[u32],
    targets: impl IntoIterator<Item = T>,
    one: impl Fn(&mut Instance<M>, u32) -> Result<V, CallError>,
    write: impl Fn(T, V),
) -> CallResult {
    references.iter().try_for_each(|&reference| one(instance, reference).map(drop))?;
    for (target, &reference) in targets.into_iter().zip(references) {
        write(target, one(instance, reference)?);
    }
    Ok(())
}

/// Reads values of one type.
unsafe fn get_each<E: Export, V>(
    component: Component,
    function: Function,
    list: List<*mut V>,
    one: impl Fn(&mut Instance<E::Model>, u32) -> Result<V, CallError>,
) -> Status {
    unsafe {
        get::<E, _>(component, function, list, |instance, references, values| {
            each(instance, references, values, one, |target, value| *target = value)
        })
    }
}

/// Used only in FMI 3.0.
#[inline]
pub(super) unsafe fn get_real<E: Export>(component: Component, list: List<*mut f64>) -> Status {
    unsafe {
        get::<E, _>(component, Function::GetReal, list, |i, references, values| i.get_float64(references, values))
    }
}

/// Used only in FMI 3.0.
#[inline]
pub(super) unsafe fn set_real<E: Export>(component: Component, list: List<*const f64>) -> Status {
    unsafe { set::<E, _>(component, Function::SetReal, list, |i, references, values| i.set_real(references, values)) }
}

/// Used only in FMI 2.0.
pub(super) unsafe fn get_integer<E: Export>(component: Component, list: List<*mut c_int>) -> Status {
    unsafe { get_each::<E, _>(component, Function::GetInteger, list, Instance::get_integer) }
}

/// An array of numbers of one type. Functions of it are not generic, because a library would contain a copy for each
/// type.
#[derive(Clone, Copy)]
pub(super) struct Numbers {
    array: *mut c_void,
    is_aligned: bool,
    width: usize,
    size: Option<Size>,
    word: unsafe fn(*const c_void, usize) -> u64,
    write: unsafe fn(*mut c_void, usize, u64),
}

impl Numbers {
    /// An array of the caller, which need not be valid.
    pub(super) fn new<V: Number>(array: *const V) -> Self {
        Self {
            array: array.cast_mut().cast(),
            is_aligned: array.is_aligned(),
            width: size_of::<V>(),
            size: V::SIZE,
            word: |array, index| unsafe { (*array.cast::<V>().add(index)).word() },
            write: |array, index, word| unsafe { *array.cast::<V>().add(index) = V::of(word) },
        }
    }

    fn check<E: Export>(&self, call: &Call<E>, length: usize) -> CallResult {
        if length == 0 {
            return Ok(());
        }
        call.check_memory(name_of_values::<E>(), self.array.is_null(), self.is_aligned, [length, self.width])
    }
}

/// Used only in FMI 3.0.
pub(super) unsafe fn get_number<E: Export>(component: Component, function: Function, list: List<Numbers>) -> Status {
    unsafe {
        call::<E>(component, function, |h, call| {
            let List { values, value_count, .. } = list;
            values.check(call, value_count)?;
            let (references, instance) = elements(h, call, list.references, list.count)?;
            check_count(call, references.len(), value_count)?;
            let one = |instance: &mut Instance<_>, reference| instance.get_number(function, values.size, reference);
            each(instance, references, 0.., one, |index, word| (values.write)(values.array, index, word))
        })
    }
}

/// Used only in FMI 2.0.
pub(super) unsafe fn set_integer<E: Export>(component: Component, list: List<*const c_int>) -> Status {
    let List { references, count, values, value_count } = list;
    let list = List { references, count, values: Numbers::new(values), value_count };
    unsafe { set_number::<E>(component, Function::SetInteger, list) }
}

/// Used in both versions of FMI.
pub(super) unsafe fn set_number<E: Export>(component: Component, function: Function, list: List<Numbers>) -> Status {
    if E::Model::SETTABLE.words == 0 {
        return unsafe { set_nothing::<E>(component, function, list.values.size, list.empty()) };
    }
    unsafe {
        call::<E>(component, function, |h, call| {
            let List { values, value_count, .. } = list;
            values.check(call, value_count)?;
            let (references, instance) = elements(h, call, list.references, list.count)?;
            check_count(call, references.len(), value_count)?;
            let words = (0..value_count).map(|index| (values.word)(values.array, index));
            instance.set_numbers(function, values.size, references, words)
        })
    }
}

pub(super) unsafe fn get_boolean<E: Export>(component: Component, list: List<*mut impl From<bool>>) -> Status {
    unsafe { get_each::<E, _>(component, Function::GetBoolean, list, |i, one| i.get_boolean(one).map(Into::into)) }
}

/// Any number except 0 is true.
pub(super) unsafe fn set_boolean<E: Export>(
    component: Component,
    list: List<*const (impl Copy + Into<i64>)>,
) -> Status {
    if E::Model::SETTABLE.booleans == 0 {
        return unsafe { set_nothing::<E>(component, Function::SetBoolean, None, list.empty()) };
    }
    unsafe {
        set::<E, _>(component, Function::SetBoolean, list, |instance, references, values| {
            let values: Vec<_> = values.iter().map(|&value| value.into() != 0).collect();
            instance.set_boolean(references, &values)
        })
    }
}

/// Sizes and values of Binaries, in arrays of equal length.
pub(super) struct Binaries<S, V> {
    pub(super) sizes: S,
    pub(super) values: V,
}

/// The bytes are valid until the next call.
pub(super) unsafe fn get_binary<E: Export>(
    component: Component,
    list: List<Binaries<*mut size_t, *mut *const u8>>,
) -> Status {
    unsafe {
        call::<E>(component, Function::GetBinary, |h, call| {
            let sizes = call.array_mut("valueSizes", list.values.sizes, list.value_count)?;
            let values = call.array_mut("values", list.values.values, list.value_count)?;
            let (references, instance) = elements(h, call, list.references, list.count)?;
            check_count(call, references.len(), values.len())?;
            let one = |instance: &mut Instance<_>, reference| {
                instance.get_binary(reference).map(|bytes| (bytes.as_ptr(), bytes.len()))
            };
            each(instance, references, values.iter_mut().zip(sizes), one, |(v, n), found| (*v, *n) = found)
        })
    }
}

pub(super) unsafe fn set_binary<E: Export>(
    component: Component,
    list: List<Binaries<*const size_t, *const *const u8>>,
) -> Status {
    if E::Model::SETTABLE.binaries == 0 {
        return unsafe { set_nothing::<E>(component, Function::SetBinary, None, list.empty()) };
    }
    unsafe {
        call::<E>(component, Function::SetBinary, |h, call| {
            let sizes = call.array("valueSizes", list.values.sizes, list.value_count)?;
            let values = call.array("values", list.values.values, list.value_count)?;
            let (references, instance) = elements(h, call, list.references, list.count)?;
            check_count(call, references.len(), values.len())?;
            let all = values.iter().zip(sizes).map(|(&value, &size)| call.array::<u8>("a value", value, size));
            all.clone().try_for_each(|bytes| bytes.map(drop))?;
            instance.set_binary(references, all.map(Result::unwrap_or_default))
        })
    }
}

/// The strings live until a string is set, a state is restored, or the instance is reset or freed.
pub(super) unsafe fn get_string<E: Export>(component: Component, list: List<*mut *const c_char>) -> Status {
    unsafe { get_each::<E, _>(component, Function::GetString, list, |i, one| i.get_string(one).map(CStr::as_ptr)) }
}

pub(super) unsafe fn set_string<E: Export>(component: Component, list: List<*const *const c_char>) -> Status {
    let function = Function::SetString;
    if E::Model::SETTABLE.strings == 0 {
        return unsafe { set_nothing::<E>(component, function, None, list.empty()) };
    }
    unsafe {
        set::<E, _>(component, function, list, |instance, references, values| {
            let to_text = |&value: &*const c_char| {
                let error = |e| Call::<E>(function, PhantomData).error(format_args!("a value is {e}"));
                text(value).map(str::to_owned).map_err(error)
            };
            let texts: Result<Vec<_>, _> = values.iter().map(to_text).collect();
            instance.set_string(references, &texts?)
        })
    }
}
