//! Compatibility of outputs and inputs, and conversion between Real and Boolean in connections.

use super::system::CaseComponent;
use crate::plan::TypeChange;
use fmu_import::description::{BaseType, BaseUnit, Variable};

const PLAIN: BaseUnit = BaseUnit { exponents: [0; 8], factor: 1.0, offset: 0.0 };

/// An end of a connection: a component and one of its variables.
pub(super) type Place<'a> = (&'a CaseComponent<'a>, &'a Variable);

/// Checks that an output may write an input of the same name: same base type, same unit of measure where both have one.
pub(super) fn compatible(from: Place<'_>, to: Place<'_>) -> Result<(), String> {
    from.1.mismatch(to.1).map_or(Ok(()), |[output_is, input_is]| Err(mismatch(from, to, &output_is, &input_is)))
}

/// Checks that an explicit connection may join an output and an input: they are compatible, or one is Boolean and the
/// other a Real without unit of measure. Masters convert as they do for any Boolean on the bus: true is 1, and above
/// 0.5 is true.
pub(super) fn convertible(from: Place<'_>, to: Place<'_>) -> Result<(), String> {
    if between(from.1, to.1).is_none() {
        return compatible(from, to);
    }
    let with_unit = [from, to].into_iter().find(|(member, variable)| !is_plain_number(member, variable));
    with_unit.map_or(Ok(()), |(_, variable)| {
        let unit = variable.unit.as_deref().unwrap_or_default();
        let words = |variable: &Variable| match variable.base_type {
            BaseType::Real => format!("in {unit}; only a Real without a unit converts to or from Boolean"),
            other => other.to_string(),
        };
        Err(mismatch(from, to, &words(from.1), &words(to.1)))
    })
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
pub(super) fn narrowing(output: &Variable, input: &Variable) -> Option<String> {
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
