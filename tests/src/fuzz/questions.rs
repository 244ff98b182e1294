//! Derivatives, status and logging.

use super::modes::{EVENT, INITIALIZATION};
use super::{Checked, Fuzzer, MARK, Next, ensure};
use crate::raw::{self, DerivativeArrays, ERROR, OK, RawInstance, TYPES_WITHOUT_VARIABLES};
use fmu_import::c_api::Reference;
use fmu_import::description::{DataType, FmiVersion, Interface};

impl Fuzzer<'_> {
    /// Unknowns and knowns for a derivative.
    fn pair(&mut self) -> [Vec<Reference>; 2] {
        let (all, mut knowns) = (self.unknown.clone(), self.known.clone());
        knowns.extend(self.time);
        if self.chance(8) || all.is_empty() || knowns.is_empty() {
            return [self.references(DataType::Float64), self.references(DataType::Float64)];
        }
        let unknown = (0..self.random.below(6)).map(|_| self.pick(&all)).collect();
        [unknown, (0..self.random.below(6)).map(|_| self.pick(&knowns)).collect()]
    }

    pub(super) fn derivatives(&mut self, at: usize) -> Checked {
        if self.version == FmiVersion::V3 {
            return self.derivatives_of_fmi3(at);
        }
        let [unknown, known] = self.pair();
        let (unknowns, knowns) = (self.count(unknown.len()), self.count(known.len()));
        let seed: Vec<_> = known.iter().map(|_| if self.chance(20) { self.wild() } else { 1.0 }).collect();
        let mut result = vec![MARK; unknown.len() + 1];
        let unknown = self.maybe(unknown.as_slice());
        let known = self.maybe(known.as_slice());
        let seed = self.maybe(seed.as_slice());
        let has_slopes = self.interfaces.contains(&Interface::CoSimulation);
        let (function, status, used) = match self.random.below(4) {
            0 if has_slopes => {
                let orders = vec![self.integer(); knowns.min(100)];
                let count = if knowns == usize::MAX { knowns } else { orders.len() };
                let function = "fmi2SetRealInputDerivatives";
                let text = format!("{known:?} {count} {orders:?} {seed:?}");
                let status = self.call(at, function, text, Next::Same, |instance| {
                    instance.set_input_derivatives(known, count, Some(&orders), seed)
                })?;
                (function, status, 0)
            }
            1 if has_slopes => {
                let orders = vec![self.integer(); unknowns.min(100)];
                let count = if unknowns == usize::MAX { unknowns } else { orders.len() };
                let function = "fmi2GetRealOutputDerivatives";
                let text = format!("{unknown:?} {count} {orders:?}");
                let status = self.call(at, function, text, Next::Same, |instance| {
                    instance.get_output_derivatives(unknown, count, Some(&orders), Some(&mut result))
                })?;
                (function, status, 0)
            }
            _ => {
                let function = "fmi2GetDirectionalDerivative";
                let text = format!("{unknown:?} {unknowns} {known:?} {knowns} {seed:?}");
                let status = self.call(at, function, text, Next::Same, |instance| {
                    instance.directional_derivatives((unknown, unknowns), (known, knowns), seed, Some(&mut result))
                })?;
                (function, status, if status == OK { unknowns } else { 0 })
            }
        };
        ensure(result[..used].iter().all(|slope| slope.is_finite()), || format!("{function} returned {result:?}"))?;
        ensure(result[used..].iter().all(|&slope| slope == MARK), || {
            format!("{function} returned {status} and wrote what it should not: {result:?}")
        })
    }

    /// fmi3GetDirectionalDerivative, fmi3GetAdjointDerivative and fmi3GetOutputDerivatives.
    fn derivatives_of_fmi3(&mut self, at: usize) -> Checked {
        let [unknown, known] = self.pair();
        let kind = self.random.below(5);
        if kind == 0 {
            let order = if self.chance(4) { self.integer() } else { 1 };
            let orders = vec![order; unknown.len()];
            let mut values = vec![MARK; self.size(at, &unknown).max(unknown.len())];
            let (function, text) = ("fmi2GetRealOutputDerivatives", format!("{unknown:?} {orders:?}"));
            let status = self.call(at, function, text, Next::Same, |instance| {
                instance.output_derivatives(&unknown, &orders, &mut values)
            })?;
            let is_right =
                |value: &f64| if status == OK { value.is_finite() && *value != MARK } else { *value == MARK };
            return ensure(values.iter().all(is_right) && (status != OK || order == 1 || unknown.is_empty()), || {
                format!("{function} returned {status} for {orders:?} and wrote {values:?}")
            });
        }
        let is_adjoint = kind < 3;
        let function = if is_adjoint { "fmi3GetAdjointDerivative" } else { "fmi2GetDirectionalDerivative" };
        let (unknowns, knowns) = (self.size(at, &unknown), self.size(at, &known));
        let (seeds, results) = if is_adjoint { (unknowns, knowns) } else { (knowns, unknowns) };
        let seed: Vec<_> = (0..=seeds).map(|_| if self.chance(20) { self.wild() } else { 1.0 }).collect();
        let mut result = vec![MARK; results + 2];
        let counts = [unknown.len(), known.len()].map(|length| self.count(length));
        let is_whole = counts == [unknown.len(), known.len()];
        let lengths = [seeds, results].map(|length| match self.random.below(30) {
            0 => usize::MAX,
            1 => length + 1,
            2 => length.saturating_sub(1),
            _ => length,
        });
        let text = format!("{unknown:?} {known:?} {seed:?} {counts:?} {lengths:?}");
        let arrays = DerivativeArrays {
            unknowns: (self.maybe(unknown.as_slice()), counts[0]),
            knowns: (self.maybe(known.as_slice()), counts[1]),
            seed: (self.maybe(seed.as_slice()), lengths[0]),
            result: (self.maybe(result.as_mut_slice()), lengths[1]),
        };
        let status = self.call(at, function, text, Next::Same, |instance| instance.derivative(function, arrays))?;
        ensure(status != OK || !is_whole || lengths == [seeds, results], || {
            format!("{function} accepted {lengths:?} in place of {seeds}, {results}")
        })?;
        let used = if status == OK { lengths[1] } else { 0 };
        ensure(result[..used].iter().all(|slope| slope.is_finite()), || format!("{function} returned {result:?}"))?;
        ensure(result[used..].iter().all(|&slope| slope == MARK), || {
            format!("{function} returned {status} and wrote what it should not: {result:?}")
        })
    }

    /// Calls FMI 3.0 functions for features that these FMUs do not have, and the functions that count states and event
    /// indicators.
    pub(super) fn questions(&mut self, at: usize) -> Checked {
        match self.random.below(8) {
            0 => {
                let (mut number, reference) = (usize::MAX, self.index(self.specs.len() + 2) as Reference);
                let target = (!self.chance(40)).then_some(&mut number);
                let (function, text) = ("fmi3GetNumberOfVariableDependencies", format!("{reference}"));
                let status = self.call(at, function, text.clone(), Next::Same, |instance| {
                    instance.number_of_dependencies(reference, target)
                })?;
                ensure((status == OK) == (number != usize::MAX), || {
                    format!("{function} returned {status} and wrote {number}")
                })?;
                if status != OK {
                    return Ok(());
                }
                let count = if self.chance(8) { self.index(number + 2) } else { number };
                let (function, mut on) = ("fmi3GetVariableDependencies", Vec::new());
                let status = self.call(at, function, text, Next::Same, |instance| {
                    let (status, found) = instance.dependencies(reference, count);
                    on = found;
                    status
                })?;
                let is_written = on.iter().all(|&reference| reference != Reference::MAX);
                let expected = if count == number { (OK, true) } else { (ERROR, on.is_empty()) };
                ensure((status, is_written) == expected, || format!("{function} returned {status} and wrote {on:?}"))
            }
            1 | 2 => {
                let of_states = self.chance(2);
                let (function, expected) = if of_states {
                    ("fmi3GetNumberOfContinuousStates", self.size(at, &self.states))
                } else {
                    ("fmi3GetNumberOfEventIndicators", self.indicators)
                };
                let mut number = usize::MAX;
                let target = (!self.chance(40)).then_some(&mut number);
                let text = format!("null {}", target.is_none());
                let status =
                    self.call(at, function, text, Next::Same, |instance| instance.number_of(function, target))?;
                let expected = if status == OK { expected } else { usize::MAX };
                ensure(number == expected, || format!("{function} returned {status} and wrote {number}"))
            }
            3 if self.slots[at].interface == Interface::CoSimulation => self.exchange(at),
            3 => self.do_step(at),
            4 if !self.clocks.is_empty() => self.clocks(at),
            _ => {
                const MARK: u64 = 0xa5a5_a5a5_a5a5_a5a5;
                let kind = self.pick(&TYPES_WITHOUT_VARIABLES);
                // A Float64, which none of these functions accepts. The type of an array without elements is not checked.
                let real = self.reals().into_iter().find(|&real| self.size(at, &[real]) > 0);
                let references = vec![real.unwrap_or(Reference::MAX); self.random.below(4) as usize];
                let count = self.count(references.len());
                let mut values = vec![MARK; references.len() + 1];
                let value_count = if self.chance(8) { self.index(references.len() + 2) } else { references.len() };
                let known = self.maybe(references.as_slice());
                let text = format!("{known:?} {count} {value_count}");
                let status = self.call(at, kind.0, text, Next::Same, |instance| {
                    instance.without_variables(kind, known, count, &mut values, value_count)
                })?;
                ensure(status != OK || count == 0, || format!("{} accepted {count} variables", kind.0))?;
                ensure(values.iter().all(|value| *value == MARK), || format!("{} wrote {values:?}", kind.0))
            }
        }
    }

    /// Functions of clocks.
    pub(super) fn clocks(&mut self, at: usize) -> Checked {
        const TIME: f64 = -7.25e77;
        let mut clocks = self.clocks.clone();
        clocks.retain(|(_, is_input)| *is_input || self.random.below(8) == 0);
        let chosen: Vec<_> = (0..1 + self.random.below(3)).map(|_| self.pick(&clocks)).collect();
        let references: Vec<_> = chosen.iter().map(|(reference, _)| *reference).collect();
        let (are_inputs, mode) = (chosen.iter().all(|(_, is_input)| *is_input), self.slots[at].mode);
        let is_in = |modes: &[&str]| modes.contains(&mode) || !self.slots[at].has_logger;
        let (is_event, is_early) = (is_in(&[EVENT]), is_in(&[EVENT, INITIALIZATION]));
        let (length, text) = (references.len(), format!("{references:?}"));
        let (function, status, is_allowed, is_right) = match self.random.below(6) {
            0 | 1 => {
                let mut values: Vec<_> = references.iter().map(|_| self.random.below(2) as u8).collect();
                let function = "fmi3SetClock";
                let text = format!("{text} {values:?}");
                let status = self.call(at, function, text, Next::Same, |instance| {
                    instance.clocks(function, &references, Some(&mut values))
                })?;
                (function, status, is_event && are_inputs, true)
            }
            2 | 3 => {
                let (mut values, function) = (vec![77; length], "fmi3GetClock");
                let status = self.call(at, function, text, Next::Same, |instance| {
                    instance.clocks(function, &references, Some(&mut values))
                })?;
                let is_right = values.iter().all(|value| if status == OK { *value < 2 } else { *value == 77 });
                (function, status, is_event, is_right)
            }
            4 => {
                let (mut times, mut qualifiers) = (vec![TIME; length], vec![77; length]);
                let function = "fmi3GetIntervalDecimal";
                let status = self.call(at, function, text, Next::Same, |instance| {
                    instance.intervals(&references, Some(&mut times), Some(&mut qualifiers))
                })?;
                let is_right = times.iter().zip(&qualifiers).all(|(time, qualifier)| match status {
                    OK => time.is_finite() && *time >= 0.0 && (0..3).contains(qualifier),
                    _ => (*time, *qualifier) == (TIME, 77),
                });
                (function, status, is_early && are_inputs, is_right)
            }
            _ => {
                let mut times: Vec<_> = references.iter().map(|_| self.wild()).collect();
                let function = self.pick(&["fmi3GetShiftDecimal", "fmi3SetShiftDecimal", "fmi3SetIntervalDecimal"]);
                let status = self.call(at, function, format!("{text} {times:?}"), Next::Same, |instance| {
                    instance.clock_times(function, &references, Some(&mut times))
                })?;
                let is_right = status != OK || times.iter().all(|time| time.is_finite() && *time >= 0.0);
                (function, status, is_early && are_inputs, is_right)
            }
        };
        ensure((status != OK || is_allowed) && is_right, || {
            format!("{function} in {mode} returned {status} for {references:?}, or wrote wrong values")
        })
    }

    pub(super) fn status(&mut self, at: usize) -> Checked {
        let kind = if self.chance(2) { self.random.below(4) as i32 } else { self.integer() };
        let is_null = self.chance(20);
        let text = format!("{kind} null {is_null}");
        match self.random.below(5) {
            0 => self.call(at, "fmi2GetStatus", text, Next::Same, |instance| instance.status(kind)).map(drop),
            1 => {
                let mut value = -7;
                let target = (!is_null).then_some(&mut value);
                let function = "fmi2GetIntegerStatus";
                self.call(at, function, text, Next::Same, |instance| instance.integer_status(kind, target)).map(drop)
            }
            2 => {
                let function = "fmi2GetStringStatus";
                self.call(at, function, text, Next::Same, |instance| instance.string_status(kind)).map(drop)
            }
            3 => {
                let mut value = -7;
                let target = (!is_null).then_some(&mut value);
                let function = "fmi2GetBooleanStatus";
                let status =
                    self.call(at, function, text, Next::Same, |instance| instance.boolean_status(kind, target))?;
                ensure((status == OK) == (value == 0), || format!("{function} returned {status} and wrote {value}"))
            }
            _ => {
                let mut value = f64::NAN;
                let target = (!is_null).then_some(&mut value);
                let function = "fmi2GetRealStatus";
                let status =
                    self.call(at, function, text, Next::Same, |instance| instance.real_status(kind, target))?;
                ensure((status == OK) == value.is_finite(), || format!("{function} returned {status}, wrote {value}"))
            }
        }
    }

    pub(super) fn logging(&mut self, at: usize) -> Checked {
        let function = "fmi2SetDebugLogging";
        if self.chance(2) {
            let on = self.integer();
            let text = format!("{on}, all");
            let status = self.call(at, function, text, Next::Same, |instance| instance.set_all_logging(on))?;
            ensure(status == OK, || format!("{function} returned {status}"))?;
            self.slots[at].all_logged = on != 0;
            return Ok(());
        }
        let owned: Vec<_> = (0..1 + self.random.below(4)).map(|_| self.text()).collect();
        let names: Vec<_> = owned.iter().map(|text| raw::Text::new(text.as_deref())).collect();
        let count = self.count(names.len());
        let categories = self.maybe(names.as_slice());
        let text = format!("{count} {} {owned:.60?}", categories.is_some());
        let call = |instance: &RawInstance<'_>| instance.set_debug_logging(count, categories);
        let status = self.call(at, function, text, Next::Same, call)?;
        if status == OK {
            self.slots[at].all_logged = false;
        }
        Ok(())
    }
}
