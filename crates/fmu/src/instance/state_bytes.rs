//! The bytes of a saved state: magic number, format version, GUID, everything that changes, checksum. They are little
//! endian and contain no pointers, so they are valid in other processes and on other machines.

use std::path::Path;
use std::sync::Arc;

use super::Snapshot;
use crate::calls::{Interface, Mode, Protocol};
use crate::discrete_state::Words;
use crate::runner::{Context, Kind as ModelKind, Model};
use crate::store::ValueStore;
use crate::timeline::Timeline;
use crate::variable::{Kind, Layout, Role, Variable};
use crate::variables::Derived as _;

const MAGIC: &[u8; 8] = b"FMURS\r\n\0";
const VERSION: u32 = 5;

/// FNV-1a, 64 bits: detects damaged bytes, not crafted ones.
pub(crate) fn checksum(bytes: &[u8]) -> u64 {
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

fn write_text(out: &mut Vec<u8>, text: &str) {
    write_bytes(out, text.as_bytes());
}

fn write_bytes(out: &mut Vec<u8>, bytes: &[u8]) {
    out.extend(u32::try_from(bytes.len()).expect("values are shorter than 4 GiB").to_le_bytes());
    out.extend(bytes);
}

/// Serializes a snapshot. The bytes depend only on the state, not on which results were read.
pub(crate) fn write<M: Model>(
    protocol: Protocol,
    guid: &str,
    layout: &Layout,
    snapshot: &Snapshot<M>,
) -> Result<Vec<u8>, String> {
    let initialized = !snapshot.mode.is_before_start();
    let mut values = snapshot.values.clone();
    let starts = ValueStore::start(layout);
    for variable in layout.variables.iter().filter(|variable| is_computed::<M>(snapshot.mode, variable)) {
        values.copy(&starts, variable);
    }
    let mut out = MAGIC.to_vec();
    out.extend(VERSION.to_le_bytes());
    out.extend((protocol.column() as u32).to_le_bytes());
    write_text(&mut out, guid);
    out.extend((snapshot.mode as u32).to_le_bytes());
    let Timeline { start, stop, time, sample } = snapshot.timeline;
    out.extend(start.to_le_bytes());
    out.extend(u32::from(stop.is_some()).to_le_bytes());
    out.extend(stop.unwrap_or(0.0).to_le_bytes());
    out.extend(time.to_le_bytes());
    out.extend(sample.to_le_bytes());
    values.reals.iter().for_each(|value| out.extend(value.to_le_bytes()));
    values.words.iter().for_each(|value| out.extend(value.to_le_bytes()));
    out.extend(values.booleans.iter().map(|&value| u8::from(value)));
    values.strings.iter().for_each(|value| write_text(&mut out, value));
    values.binaries.iter().for_each(|value| write_bytes(&mut out, value));
    // After the start, the tolerance no longer changes, so the flag has no effect.
    out.extend(u32::from(!initialized && snapshot.is_tolerance_set).to_le_bytes());
    // Before the start, the state of the run follows from the values and is not saved.
    if let (true, Some(derived), Some(run)) = (initialized, snapshot.derived.as_deref(), &snapshot.run) {
        out.extend(M::fingerprint(derived).to_le_bytes());
        M::save(run, &mut |word| word.write(&mut out))?;
    }
    out.extend(checksum(&out).to_le_bytes());
    Ok(out)
}

/// Returns true if a value is computed from other values before it is read. In model exchange, outputs that are not
/// real keep their values between two events.
fn is_computed<M: Model>(mode: Mode, variable: &Variable) -> bool {
    let initialized = !mode.is_before_start();
    match variable.role {
        Role::Calculated | Role::Derivative | Role::Clocked | Role::Previous => true,
        Role::State => variable.declaration.calculated && !initialized,
        Role::Output => {
            let is_kept = mode == Mode::ContinuousTime && !matches!(variable.declaration.kind, Kind::Real(_));
            // A source computes its outputs up to the start.
            !is_kept && (M::KIND == ModelKind::Continuous || (M::CALCULATES_OUTPUTS && !initialized))
        }
        Role::Parameter | Role::Input | Role::Clock => false,
    }
}

/// Returns true for modes in which no state is saved, although no error has led to them.
fn is_transient(mode: Mode) -> bool {
    matches!(mode, Mode::IntermediateUpdate | Mode::ClockUpdate)
}

fn read_switch(source: &mut Words<'_>) -> Result<bool, String> {
    match u32::from_le_bytes(source.take()?) {
        0 => Ok(false),
        1 => Ok(true),
        other => Err(format!("a Boolean must be 0 or 1, got {other}")),
    }
}

fn read_text(source: &mut Words<'_>) -> Result<String, String> {
    let length = u32::from_le_bytes(source.take()?);
    String::from_utf8(source.bytes_of(length.into())?.to_vec()).map_err(|_| "a string is not UTF-8".to_owned())
}

pub(crate) fn read<M: Model>(
    protocol: Protocol,
    guid: &str,
    layout: &Layout,
    resources: &Path,
    bytes: &[u8],
) -> Result<Snapshot<M>, String> {
    let body = bytes.len().checked_sub(8).filter(|&body| body > MAGIC.len()).ok_or("too few bytes for a state")?;
    let (body, sum) = bytes.split_at(body);
    let source = &mut Words(body);
    if &source.take::<8>()? != MAGIC {
        return Err("the bytes are not a state saved by an FMU of this exporter".to_owned());
    }
    let version = u32::from_le_bytes(source.take()?);
    if version != VERSION {
        return Err(format!("format version must be {VERSION}, got {version}"));
    }
    let column = u32::from_le_bytes(source.take()?);
    if column != protocol.column() as u32 {
        let from = Protocol::ALL.get(column as usize).map_or_else(|| "an unknown interface".to_owned(), Protocol::name);
        return Err(format!("the state was saved by an instance for {from}, this instance is for {}", protocol.name()));
    }
    let found = read_text(source)?;
    if found != guid {
        return Err(format!("the state belongs to another FMU: GUID {found} instead of {guid}"));
    }
    if Words(sum).u64()? != checksum(body) {
        return Err("the bytes are damaged (checksum)".to_owned());
    }
    let number = u32::from_le_bytes(source.take()?);
    let is_saved = |mode: &Mode| mode.belongs_to(protocol) && !is_transient(*mode);
    let mode = Mode::ALL.get(number as usize).copied().filter(is_saved);
    let mode = mode.ok_or_else(|| format!("unknown mode {number}"))?;
    if mode == Mode::Event && protocol.interface == Interface::CoSimulation && !M::HAS_EVENTS {
        return Err(format!("a model without events has no {} in co-simulation", mode.name()));
    }
    let start = f64::from_le_bytes(source.take()?);
    let has_stop = read_switch(source)?;
    let stop = f64::from_le_bytes(source.take()?);
    let timeline = Timeline {
        start,
        stop: has_stop.then_some(stop),
        time: f64::from_le_bytes(source.take()?),
        sample: source.u64()?,
    };
    let mut values = M::start(layout);
    for value in &mut values.reals {
        *value = f64::from_le_bytes(source.take()?);
    }
    for value in &mut values.words {
        *value = source.u64()?;
    }
    values.update_lengths(layout);
    for value in &mut values.booleans {
        *value = source.take()? != [0];
    }
    for value in &mut values.strings {
        *value = read_text(source)?;
    }
    for value in &mut values.binaries {
        let length = u32::from_le_bytes(source.take()?);
        if length as usize > value.most() {
            return Err(format!("a Binary must have at most {} bytes, got {length}", value.most()));
        }
        value.set(source.bytes_of(length.into())?);
    }
    if M::INTERPOLATES && values.reals[layout.slopes()].iter().any(|slope| !slope.is_finite()) {
        return Err("the derivative of an input is not a finite number".to_owned());
    }
    let is_tolerance_set = read_switch(source)?;
    let initialized = !mode.is_before_start();
    if mode == Mode::Broken {
        return Err(format!("no state can be saved in {}", mode.name()));
    }
    for variable in layout.variables.iter().filter(|variable| !is_computed::<M>(mode, variable)) {
        let name = &variable.declaration.name;
        match &variable.declaration.kind {
            Kind::Real(_) if !values.reals[variable.index].is_finite() => {
                return Err(format!("'{name}' is not a finite number"));
            }
            // A restored state must not contain values that the set functions reject: models rely on parameter limits.
            Kind::Real(real) if variable.role == Role::Parameter => {
                let value = values.reals[variable.index];
                let range = real.range();
                if !range.contains(&value) {
                    let (value, min, max) = (real.unit.with(value), range.start(), range.end());
                    return Err(format!("'{name}' = {value} is not in [{min}, {max}]"));
                }
            }
            kind @ (Kind::Float32(_) | Kind::Integer { .. }) if !variable.accepts(values.words[variable.index]) => {
                return Err(format!("'{name}' = {} is not one of its values", kind.text(values.words[variable.index])));
            }
            Kind::String { .. } if values.strings[variable.index].contains('\0') => {
                return Err(format!("'{name}' has a zero byte"));
            }
            _ => {}
        }
    }
    let period = layout.solver.filter(|_| M::KIND == ModelKind::Discrete).map(|index| values.reals[index]);
    timeline.check(protocol.interface, initialized, period)?;
    let mut snapshot =
        Snapshot { mode, timeline, values, is_tolerance_set, run: None, derived: None, derived_are_old: true };
    if initialized {
        let fingerprint = source.u64()?;
        let parameters = M::parameters(&snapshot.values);
        let derived = Arc::new(M::load(&parameters, resources)?);
        if M::fingerprint(&derived) != fingerprint {
            return Err("a file that the model read before the state was saved has changed since".to_owned());
        }
        // The state is restored in place, because the state of a model can be too large for a thread's stack.
        let Snapshot { values, timeline, run, .. } = &mut snapshot;
        derived.write(&mut values.view_mut(), layout.derived.at);
        if let Some(index) = layout.derived.reals().find(|&index| !values.reals[index].is_finite()) {
            return Err(format!("'{}' is not a finite number", layout.real_name(index)));
        }
        let ctx = Context { p: &parameters, derived: &*derived, layout, time: timeline.start };
        let run = run.insert(M::init(ctx, resources, values)?);
        M::restore(run, layout, source)?;
        (snapshot.derived, snapshot.derived_are_old) = (Some(derived), false);
    }
    if !source.0.is_empty() {
        return Err(format!("{} bytes too many", source.0.len()));
    }
    Ok(snapshot)
}
