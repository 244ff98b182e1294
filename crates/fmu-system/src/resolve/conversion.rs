//! Compatibility of outputs and inputs, and conversion between Real and Boolean in connections.

use super::system::CaseComponent;
use crate::data::unit::{Declared, UnitMismatch};
use crate::plan::TypeChange;
use crate::run::Linear;
use fmu_import::description::{BaseType, BaseUnit, Variable};

const PLAIN: BaseUnit = BaseUnit { exponents: [0; 8], factor: 1.0, offset: 0.0 };

/// An end of a connection: a component and one of its variables.
pub(super) type Place<'a> = (&'a CaseComponent<'a>, &'a Variable);

/// Keys of a connection that convert its values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Written {
    pub(super) factor: Option<f64>,
    pub(super) offset: Option<f64>,
    /// Convert units.
    pub(super) convert: bool,
}

impl Written {
    /// A connection by name.
    pub(super) const NONE: Self = Self { factor: None, offset: None, convert: true };
}

/// Returns how an input gets the value of an output, if not unchanged. By name, both must have the same base type. An
/// explicit connection (`Some`) may also join a Boolean and a Real without unit: masters convert as they do for any
/// Boolean on the bus; true is 1, and above 0.5 is true.
///
/// # Errors
/// A message, and a hint.
pub(super) fn conversion(
    from: Place<'_>,
    to: Place<'_>,
    written: Option<Written>,
) -> Result<Linear, (String, Option<String>)> {
    let (factor, offset) = written.map_or((None, None), |written| (written.factor, written.offset));
    let own = Linear { factor: factor.unwrap_or(1.0), offset: offset.unwrap_or(0.0) };
    if written.is_some() && between(from.1, to.1).is_some() {
        let is_plain = |place: &Place<'_>| is_plain_number(place.0, place.1);
        if let Some((_, variable)) = [from, to].iter().find(|place| !is_plain(place)) {
            let unit = variable.unit.as_deref().unwrap_or_default();
            let words = |variable: &Variable| match variable.base_type {
                BaseType::Real => format!("in {unit}; only a Real without a unit converts to or from Boolean"),
                other => other.to_string(),
            };
            return Err((mismatch(from, to, &words(from.1), &words(to.1)), None));
        }
    } else if let Some([output_is, input_is]) = from.1.mismatch_of_types(to.1) {
        return Err((mismatch(from, to, &output_is, &input_is), narrowing(from.1, to.1)));
    }
    if own != Linear::IDENTITY && [from, to].iter().any(|place| place.1.base_type != BaseType::Real) {
        let words = |variable: &Variable| variable.base_type.to_string();
        let message = mismatch(from, to, &words(from.1), &words(to.1));
        return Err((format!("{message}; `factor` and `offset` are for connections of Reals"), None));
    }
    let of_units = match written {
        Some(Written { convert: false, .. }) => Linear::IDENTITY,
        _ => units(from, to, factor.is_some())?,
    };
    Ok(own.after(of_units))
}

/// The quantities of two ends; `None` if one of them is not known.
fn quantities(from: Place<'_>, to: Place<'_>) -> Option<[Declared; 2]> {
    let quantity = |place: Place<'_>| Declared::of(&place.0.found.description, place.1);
    Some([quantity(from)?, quantity(to)?])
}

/// Returns true if the units of two ends differ in the exponent of rad only.
pub(super) fn differ_by_angle(from: Place<'_>, to: Place<'_>) -> bool {
    let is_angle = |[output, input]: [Declared; 2]| output.conversion_to(&input).is_err_and(|it| it.is_angle);
    quantities(from, to).is_some_and(is_angle)
}

/// The conversion between the units of two ends. With a factor of the connection, the exponents of rad may differ.
fn units(from: Place<'_>, to: Place<'_>, has_factor: bool) -> Result<Linear, (String, Option<String>)> {
    let Some([output, input]) = quantities(from, to) else { return Ok(Linear::IDENTITY) };
    match output.conversion_to(&input) {
        Err(mismatch) if mismatch.is_angle && has_factor => Ok(Linear::IDENTITY),
        Err(UnitMismatch { words: [is, other], is_angle }) => {
            let help = match is_angle {
                true => "a `factor` in the [[connection]] converts an angle to or from a pure number",
                _ if has_factor => "with `convert = false`, only `factor` and `offset` of the [[connection]] apply",
                false => "`convert = false` in the [[connection]] passes the number unchanged",
            };
            Err((mismatch(from, to, &is, &other), Some(help.to_owned())))
        }
        Ok(linear) => Ok(linear),
    }
}

/// Returns the conversion in a connection of these two variables, if their types differ.
pub(super) fn between(output: &Variable, input: &Variable) -> Option<TypeChange> {
    match (output.base_type, input.base_type) {
        (BaseType::Real, BaseType::Boolean) => Some(TypeChange::RealToBoolean),
        (BaseType::Boolean, BaseType::Real) => Some(TypeChange::BooleanToReal),
        _ => None,
    }
}

/// Help for a connection of two types of which the second does not have all values of the first.
fn narrowing(output: &Variable, input: &Variable) -> Option<String> {
    let [from, to] = [output, input].map(|variable| variable.data_type);
    let is_narrowing = output.base_type == input.base_type && !from.widens_to(to);
    is_narrowing.then(|| {
        format!(
            "{to} does not have all values of {from}: connect an output of a type that {to} includes, or put a \
             component between them that converts the value"
        )
    })
}

fn is_plain_number(member: &CaseComponent<'_>, variable: &Variable) -> bool {
    let base = |name| member.found.description.unit(name).and_then(|unit| unit.base);
    variable.unit.as_deref().is_none_or(|name| base(name) == Some(PLAIN))
}

fn mismatch((writer, output): Place<'_>, (reader, input): Place<'_>, output_is: &str, input_is: &str) -> String {
    format!(
        "`{}:{}` is {output_is}, but its target `{}:{}` is {input_is}",
        writer.name(),
        output.name,
        reader.name(),
        input.name
    )
}
