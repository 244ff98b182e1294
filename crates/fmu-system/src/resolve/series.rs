//! Connects columns of the `--inputs` file to the inputs that they write and the outputs that they replace.

use super::inputs::Feed;
use super::pattern::is_match;
use super::system::{CaseComponent, Resolver, Source, System};
use super::values::is_implausible;
use crate::data::unit::Target;
use crate::run::Interpolation;
use fmu_import::description::{BaseType, Causality, Variability, Variable};

/// Interpolation of an input between samples.
fn interpolation(source: &Variable, reader: &Variable) -> Interpolation {
    let is_continuous = reader.base_type == BaseType::Real && reader.variability == Variability::Continuous;
    if is_continuous && source.base_type == BaseType::Real { Interpolation::Linear } else { Interpolation::Hold }
}

impl Resolver<'_> {
    /// Lets a column write the input `reader`. The column has the values of `variable` of a component: of the input, or
    /// of the output that the column replaces.
    pub(super) fn use_column(
        &mut self,
        column: usize,
        (member, variable): (&CaseComponent<'_>, &Variable),
        reader: &Variable,
    ) -> Result<Source, ()> {
        let inputs = self.inputs.as_mut().ok_or(())?;
        if let Some(binary) = [variable, reader].into_iter().find(|variable| variable.base_type == BaseType::Binary) {
            let message = format!("`{}` is a Binary, which the input file cannot write", binary.name);
            let help = format!("rename the column `{}`", inputs.name(column));
            self.problems.add_with_help(member.component.name.span(), message, Some(help));
            return Err(());
        }
        let target = Target::of(&member.found.description, variable);
        let feed = inputs.feed(column, &target, interpolation(variable, reader)).ok_or(())?;
        inputs.check_values(feed, member.name(), variable);
        let has_unit = inputs.has_unit(column);
        let values = &inputs.feeds[feed].signal.values;
        let implausible = values.iter().copied().find(|value| !has_unit && is_implausible(variable, *value));
        if let Some(value) = implausible {
            let message = format!("the input file has the value {value} rad for `{}`", inputs.name(column));
            let help = format!("that is {:.0} deg; is it in degrees?", value.to_degrees());
            self.problems.warn(member.component.name.span(), message, Some(help));
        }
        Ok(Source::Series(feed))
    }

    /// Marks the recorded outputs of a case that get their values from the file: outputs with the name of a used
    /// column, and outputs whose readers all read the same column instead. `lost` contains the column that replaces
    /// each lost connection.
    pub(super) fn replace_recorded(&mut self, system: &mut System<'_>, lost: &[((usize, usize), usize)]) {
        let Some(inputs) = &self.inputs else { return };
        let sources = || system.members.iter().flat_map(|member| &member.inputs).map(|(_, source)| source);
        let mut replaced = Vec::new();
        for (m, member) in system.members.iter().enumerate() {
            for (v, variable) in member.wirable(Causality::Output) {
                if !self.is_recorded(member.name(), &variable.name) {
                    continue;
                }
                let named =
                    inputs.column(Some(member.name()), &variable.name).or_else(|| inputs.column(None, &variable.name));
                let is_read = sources().any(|source| source.output() == Some((m, v)));
                let mut columns = lost.iter().filter(|(output, _)| *output == (m, v)).map(|(_, column)| *column);
                let taken = columns.next().filter(|first| !is_read && columns.all(|other| other == *first));
                let on_wire = |column: usize| {
                    let feeds = sources().filter_map(Source::series);
                    let of_column = feeds.filter(|feed| inputs.feeds[*feed].column == column);
                    of_column.min_by_key(|feed| inputs.feeds[*feed].interpolation)
                };
                if let Some(feed) = named.and_then(on_wire).or_else(|| taken.and_then(on_wire)) {
                    replaced.push(((m, v), feed));
                }
            }
        }
        for ((m, v), feed) in replaced {
            let member = &system.members[m];
            let target = Target::of(&member.found.description, member.variable(v));
            let Some(inputs) = &mut self.inputs else { return };
            let Feed { column, interpolation, .. } = inputs.feeds[feed];
            // Use the unit of the output: the input at the other end of a connection may have another unit.
            if let Some(feed) = inputs.feed(column, &target, interpolation) {
                system.replaced.insert((m, v), feed);
            }
        }
    }

    /// Returns true if an input from a column is recorded: it matches a pattern of `[record]` that no output matches.
    pub(super) fn records_input(&self, member: &CaseComponent<'_>, v: usize, source: &Source) -> bool {
        let Source::Series(_) = source else { return false };
        self.of_inputs.iter().any(|pattern| is_match(pattern, member.name(), &member.variable(v).name))
    }
}
