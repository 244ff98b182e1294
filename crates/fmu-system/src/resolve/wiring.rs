//! The wires of a case: the source of each input.

use super::clocks::{ClockConnections, clock_wire};
use super::conversion::{self, Written, conversion, differ_by_angle};
use super::fmus::{Descriptions, fmus_with};
use super::system::{CaseComponent, Column, Resolver, Source, System, context, replacement};
use crate::parameter;
use crate::plan::{self, Connected, Origin, Signal};
use crate::run::{self, Extrapolation, Interpolation, Linear, Setting, Wire};
use crate::scenario::Connection;
use crate::spanned::Spanned;
use fmu_import::description::{BaseType, Causality, DataType, ModelDescription, Variable};
use fmu_import::names::{similar, suggestion};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::ops::Range;
use std::sync::Arc;

/// An end of a connection: component and variable; `None` if the case does not have them. `Err`: a mistake was
/// reported.
pub(super) type End = Result<Option<(usize, usize)>, ()>;
type Outputs<'a> = HashMap<&'a str, Vec<(usize, usize)>>;
/// Outputs that connections name, by the input that they write. `Err`: a mistake was reported.
type Connections = HashMap<(usize, usize), Result<((usize, usize), Linear), ()>>;

/// How the FMU that a case sets for a component changes the source of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Change {
    /// The component's own FMU has no such input.
    NewInput,
    /// The component's own FMU has no such output.
    NewOutput,
    /// Only the component's own FMU has this output.
    LostOutput,
}

/// Finds a component whose FMU the case replaces, if this makes one of these changes to an input of `reader`.
fn swap(system: &System<'_>, reader: usize, input: &str, changes: [Change; 2]) -> Option<(usize, Change)> {
    let has = |description: &ModelDescription, causality| {
        description.variable(input).is_some_and(|variable| variable.causality == causality)
    };
    let change = |(m, member): (usize, &CaseComponent<'_>)| {
        let own = &member.replaced.as_ref()?.original.as_ref()?.description;
        let other = &member.found.description;
        let change = match [own, other].map(|description| has(description, Causality::Output)) {
            _ if m == reader => (!has(own, Causality::Input)).then_some(Change::NewInput),
            [false, true] => Some(Change::NewOutput),
            [true, false] => Some(Change::LostOutput),
            _ => None,
        };
        change.filter(|change| changes.contains(change)).map(|change| (m, change))
    };
    system.members.iter().enumerate().find_map(change)
}

/// Returns the place and the description of a replacement that changes the writers of some inputs.
fn cause(system: &System<'_>, (m, change): (usize, Change), inputs: &[&str]) -> (Range<usize>, String) {
    let component = system.members[m].component;
    let (own, written) = (component.fmu.get_ref(), replacement(system.case, component));
    let other = written.map_or(own, |other| &other.fmu);
    let s = if inputs.len() == 1 { "" } else { "s" };
    let names = quoted(inputs);
    let words = match change {
        Change::NewInput => format!("{other} has the input{s} {names}, which {own} does not have"),
        Change::NewOutput => format!("{other} has the output{s} {names}, which {own} does not have"),
        Change::LostOutput => format!("{other} has no output{s} {names}, which {own} has"),
    };
    (written.map_or(component.fmu.span(), Spanned::span), words)
}

fn quoted(names: &[&str]) -> String {
    names.iter().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

impl<'a> Resolver<'a> {
    /// Finds the source of each input of a case.
    pub(super) fn wire(&mut self, system: &mut System<'a>, source: &dyn Descriptions) {
        let (connections, clocks) = self.connections(system);
        // Outputs by name, to find the only other component that has one.
        let mut outputs = Outputs::new();
        for (m, member) in system.members.iter().enumerate() {
            for (v, variable) in member.wirable(Causality::Output).filter(|(_, v)| v.data_type != DataType::Clock) {
                outputs.entry(variable.name.as_str()).or_default().push((m, v));
            }
        }
        let mut wired = Vec::new();
        let mut lost = Vec::new();
        for (m, member) in system.members.iter().enumerate() {
            self.problems.set_context(Some(context(system.case, Some(member.component))));
            let constants = self.constants(system.case, member);
            let (mut inputs, mut conversions) = (Vec::new(), HashMap::new());
            let mut missing = Vec::new();
            let mut elements = Vec::new();
            for (v, variable) in member.all(Causality::Input) {
                if variable.is_array() {
                    self.problems.warn(
                        member.component.name.span(),
                        format!("the input `{}` is an array, which keeps its start values", variable.name),
                        Some("only scalars can be connected or set".to_string()),
                    );
                    continue;
                }
                let constant = constants.get(&v);
                let explicit = connections.get(&(m, v)).copied();
                let from = explicit.map(|explicit| explicit.map(|(from, _)| from));
                let writer = self.writer(system, (m, v), from, &outputs, &mut lost);
                if let Ok(Some(Source::Output(w, o))) = &writer {
                    let by_name = || {
                        let writer = &system.members[*w];
                        conversion((writer, writer.variable(*o)), (member, variable), None).ok()
                    };
                    let linear = explicit.and_then(Result::ok).map(|(_, linear)| linear).or_else(by_name);
                    conversions.extend(linear.filter(|linear| *linear != Linear::IDENTITY).map(|linear| (v, linear)));
                }
                match (writer, constant) {
                    (Ok(Some(Source::Output(from, o))), Some((_, span))) => {
                        let writer = &system.members[from];
                        let message = format!(
                            "the input `{}` has this constant but is written by `{}`",
                            variable.name,
                            writer.name()
                        );
                        let help = match explicit {
                            Some(_) => "remove the constant or the [[connection]]".to_owned(),
                            None => format!(
                                "remove the constant: `{}:{}` is connected by its name",
                                writer.name(),
                                writer.variable(o).name
                            ),
                        };
                        self.problems.add_with_help(span.clone(), message, Some(help));
                    }
                    (Ok(Some(source)), _) => inputs.push((v, source)),
                    (Ok(None), Some((Some(value), _))) => inputs.push((v, Source::Constant(value.clone()))),
                    // The invalid constant has been reported.
                    (Ok(None), Some((None, _))) => (),
                    // Nothing can be connected to a String input, which keeps its start value, as does a Binary.
                    (Ok(None), None) if variable.base_type == BaseType::String && variable.start.is_some() => (),
                    (Ok(None), None) if variable.base_type == BaseType::Binary => (),
                    (Ok(None), None) if variable.element.is_some() => elements.push(variable.name.as_str()),
                    (Ok(None), None) => missing.push(variable.name.as_str()),
                    (Err(()), _) => (),
                }
            }
            if !missing.is_empty() {
                self.report_missing(system, m, &missing, &outputs, source);
            }
            if let Some(first) = elements.first() {
                let more = match elements.len() - 1 {
                    0 => String::new(),
                    more => format!(" and {more} more"),
                };
                self.problems.warn(
                    member.component.name.span(),
                    format!("array elements that nothing writes keep their start values: `{first}`{more}"),
                    Some("connect them, or give them constants in `inputs`".to_string()),
                );
            }
            wired.push((inputs, conversions));
        }
        self.problems.set_context(None);
        for (member, wired) in system.members.iter_mut().zip(wired) {
            (member.inputs, member.conversions) = wired;
        }
        self.wire_clocks(system, &clocks);
        if self.inputs.is_some() {
            self.replace_recorded(system, &lost);
            self.drop_unneeded(system);
        }
    }

    /// Reports inputs of a component without a writer. Inputs that lost their writer because a case replaces an FMU are
    /// listed separately.
    fn report_missing(
        &mut self,
        system: &System<'_>,
        m: usize,
        missing: &[&str],
        outputs: &Outputs<'_>,
        source: &dyn Descriptions,
    ) {
        let member = &system.members[m];
        let name = member.name();
        let mut by_swap: BTreeMap<Option<(usize, Change)>, Vec<&str>> = BTreeMap::new();
        for input in missing {
            by_swap.entry(swap(system, m, input, [Change::NewInput, Change::LostOutput])).or_default().push(input);
        }
        for (swap, inputs) in by_swap {
            let near = inputs
                .iter()
                .find_map(|name| suggestion(name, outputs.keys().copied()))
                .map_or(String::new(), |s| format!("; there is an output with a similar name: {s}"));
            let which = if inputs.len() == 1 { "it" } else { "them" };
            let writers = fmus_with(source, Causality::Output, &inputs)
                .map_or(String::new(), |names| format!("; FMUs that write {which}: {names}"));
            let help = format!("give the component a constant in `inputs` or add a [[connection]]{near}{writers}");
            let which = match inputs[..] {
                [input] => format!("the input `{input}`"),
                _ if swap.is_some() => "these inputs".to_string(),
                _ => format!("the inputs {}", quoted(&inputs)),
            };
            let of = swap.map_or(member.component, |(changed, _)| system.members[changed].component);
            self.problems.set_context(Some(context(system.case, Some(of))));
            let (place, message) = match swap.map(|swap| cause(system, swap, &inputs)) {
                Some((place, cause)) => (place, format!("{cause}; nothing writes {which} of `{name}`")),
                None => (member.component.name.span(), format!("nothing writes {which} of `{name}`")),
            };
            self.problems.add_with_help(place, message, Some(help));
        }
        self.problems.set_context(Some(context(system.case, Some(member.component))));
    }

    fn report_writers(&mut self, system: &System<'_>, (m, v): (usize, usize), writers: &[(usize, usize)]) {
        let member = &system.members[m];
        let input = member.variable(v).name.as_str();
        let names: Vec<String> = writers.iter().map(|(w, _)| format!("`{}`", system.members[*w].name())).collect();
        let mut message =
            format!("the input `{input}` of `{}` has several writers: {}", member.name(), names.join(" and "));
        let mut place = member.component.name.span();
        if let Some(swap) = swap(system, m, input, [Change::NewInput, Change::NewOutput]) {
            let (at, cause) = cause(system, swap, &[input]);
            (place, message) = (at, format!("{cause}; {message}"));
            self.problems.set_context(Some(context(system.case, Some(system.members[swap.0].component))));
        }
        self.problems.add_with_help(place, message, Some("choose one with a [[connection]]".to_string()));
        self.problems.set_context(Some(context(system.case, Some(member.component))));
    }

    /// Finds the source of an input, except constants. `Err`: a mistake was reported. A wire that the input file
    /// replaces is added to `lost`, as its output and the column.
    fn writer(
        &mut self,
        system: &System<'_>,
        (m, v): (usize, usize),
        explicit: Option<Result<(usize, usize), ()>>,
        outputs: &Outputs<'_>,
        lost: &mut Vec<((usize, usize), usize)>,
    ) -> Result<Option<Source>, ()> {
        let member = &system.members[m];
        let input = member.variable(v);
        let name = input.name.as_str();
        if input.base_type == BaseType::String {
            return Ok(None);
        }
        let others = || {
            let names = member.names(v).filter(|_| self.scenario.connect_by_name);
            let writers = names.filter_map(|name| outputs.get(name)).flatten();
            writers.filter(|(other, _)| *other != m).copied()
        };
        let by_name = |component| member.names(v).find_map(|name| self.column(component, name));
        let own = by_name(Some(member.name()));
        let own = own.or_else(|| explicit.is_none().then(|| by_name(None)).flatten());
        if let Some(column) = own {
            let from = explicit.map_or_else(|| others().next().filter(|_| others().count() == 1), Result::ok);
            lost.extend(from.map(|from| (from, column)));
            if let Some(output) = from {
                self.note_replacement(system, output, (m, v), column);
            }
            return self.use_column(column, (member, input), input).map(Some);
        }
        let from = match explicit {
            Some(from) => Some(from?),
            None => {
                let others: Vec<(usize, usize)> = others().collect();
                if others.len() > 1 {
                    self.report_writers(system, (m, v), &others);
                    return Err(());
                }
                others.first().copied()
            }
        };
        let Some((w, o)) = from else {
            return Ok(None);
        };
        let writer = &system.members[w];
        let output = writer.variable(o);
        let fed = self.column(Some(writer.name()), &output.name).or_else(|| self.column(None, &output.name));
        if let Some(column) = fed {
            // If the connection converts between types, the column has values of the output's type.
            let of = if conversion::between(output, input).is_some() { (writer, output) } else { (member, input) };
            lost.push(((w, o), column));
            self.note_replacement(system, (w, o), (m, v), column);
            return self.use_column(column, of, input).map(Some);
        }
        // The ends of an explicit connection have been checked already.
        let ends = ((writer, output), (member, input));
        if explicit.is_none()
            && let Err((message, help)) = conversion(ends.0, ends.1, None)
        {
            let explicit = || {
                format!(
                    "to convert the value, add a [[connection]] with from = \"{}:{}\" and to = \"{}:{name}\"",
                    writer.name(),
                    output.name,
                    member.name()
                )
            };
            let help = conversion(ends.0, ends.1, Some(Written::NONE)).is_ok().then(explicit).or(help);
            self.problems.add_with_help(member.component.name.span(), message, help);
            return Err(());
        }
        Ok(Some(Source::Output(w, o)))
    }

    fn column(&self, component: Option<&str>, signal: &str) -> Option<usize> {
        self.inputs.as_ref()?.column(component, signal)
    }

    fn note_replacement(&mut self, system: &System<'_>, output: (usize, usize), input: (usize, usize), column: usize) {
        let name = |(m, v): (usize, usize)| {
            let member = &system.members[m];
            format!("`{}:{}`", member.name(), member.variable(v).name)
        };
        if let Some(inputs) = &mut self.inputs {
            inputs.replace(column, name(output), name(input));
        }
    }

    pub(super) fn wiring(&self, system: &System<'_>, order: run::Order) -> plan::Wiring {
        let signal = |member: &CaseComponent<'_>, v: usize| Signal {
            component: member.name().to_string(),
            variable: member.variable(v).name.clone(),
        };
        let kept = || system.order.iter().map(|m| (*m, &system.members[*m]));
        let mut inputs = Vec::new();
        let mut read = BTreeSet::new();
        for (m, member) in kept() {
            for (v, source) in &member.inputs {
                let (mut type_change, mut timing) = (None, None);
                let source = match source {
                    Source::Output(from, output) => {
                        read.insert((*from, *output));
                        let writer = &system.members[*from];
                        type_change = conversion::between(writer.variable(*output), member.variable(*v));
                        timing = Some(system.timing(*from, m, order));
                        Origin::Output(signal(writer, *output))
                    }
                    Source::Series(feed) => {
                        let name =
                            self.inputs.as_ref().map(|inputs| inputs.name(inputs.feeds[*feed].column).to_owned());
                        Origin::File(name.unwrap_or_default())
                    }
                    Source::Constant(value) => {
                        Origin::Constant { value: value.clone(), unit: member.variable(*v).unit.clone() }
                    }
                };
                inputs.push(Connected {
                    input: signal(member, *v),
                    source,
                    type_change,
                    conversion: member.conversions.get(v).copied(),
                    timing,
                });
            }
            for (clock, (from, source)) in &member.clocks {
                let of = |member: &CaseComponent<'_>, clock: usize| Signal {
                    component: member.name().to_string(),
                    variable: member.clock(clock).name.clone(),
                };
                let source = Origin::Output(of(&system.members[*from], *source));
                inputs.push(Connected {
                    input: of(member, *clock),
                    source,
                    type_change: None,
                    conversion: None,
                    timing: None,
                });
            }
        }
        let unread = kept()
            .flat_map(|(m, member)| {
                member.wirable(Causality::Output).map(move |(v, variable)| (m, v, member, variable))
            })
            .filter(|(m, v, member, variable)| {
                let is_read = read.contains(&(*m, *v)) || self.is_recorded(member.name(), &variable.name);
                !is_read && variable.data_type != DataType::Clock
            })
            .map(|(_, v, member, _)| signal(member, v))
            .collect();
        let discrete = kept().filter(|(_, member)| member.is_discrete());
        plan::Wiring {
            case: system.case.name.get_ref().clone(),
            inputs,
            unread,
            loops: super::start::loops(system, order),
            discrete: discrete.map(|(_, member)| member.name().to_owned()).collect(),
        }
    }

    fn connections(&mut self, system: &System<'a>) -> (Connections, ClockConnections) {
        let mut connections = Connections::new();
        let mut clocks = ClockConnections::new();
        let mut expanded = Vec::new();
        for connection in self.expanded(system) {
            expanded.append(&mut self.by_element(system, connection));
        }
        for connection in expanded {
            if self.connect_clock(system, &connection, &mut clocks) {
                continue;
            }
            let from = self.end(system, &connection.from, Causality::Output);
            let to = self.end(system, &connection.to, Causality::Input);
            self.problems.set_context(Some(context(system.case, None)));
            let (from, to) = match (from, to) {
                (Ok(Some(from)), Ok(Some(to))) => (from, to),
                (Err(()), Ok(Some(to))) => {
                    connections.insert(to, Err(()));
                    continue;
                }
                _ => continue,
            };
            let ends = |(m, v): (usize, usize)| {
                let member = &system.members[m];
                (member, member.variable(v))
            };
            let number = |written: &Option<Spanned<f64>>| written.as_ref().map(|value| *value.get_ref());
            let written = Written {
                factor: number(&connection.factor),
                offset: number(&connection.offset),
                convert: connection.convert != Some(false),
            };
            let linear = conversion(ends(from), ends(to), Some(written)).unwrap_or_else(|(message, help)| {
                self.problems.add_with_help(connection.to.span(), message, help);
                Linear::IDENTITY
            });
            if written.convert && written.factor.is_some() && differ_by_angle(ends(from), ends(to)) {
                let message = "one unit has an angle that the other lacks: the factor alone converts the value";
                self.problems.warn(connection.to.span(), message, None);
            }
            if connections.insert(to, Ok((from, linear))).is_some() {
                self.problems
                    .add(connection.to.span(), format!("a second connection writes `{}`", connection.to.get_ref()));
            }
        }
        self.problems.set_context(None);
        (connections, clocks)
    }

    /// The connections of a case, one for each input: a `*` in `to` stands for the same text as a `*` in `from`.
    fn expanded(&mut self, system: &System<'_>) -> Vec<Cow<'a, Connection>> {
        let mut all = Vec::new();
        let scenario = self.scenario;
        for connection in &scenario.connections {
            let (from, to) = (connection.from.get_ref(), connection.to.get_ref());
            let Some((before, after)) = to.split_once('*') else {
                if from.contains('*') {
                    let message = format!("`{from}` has a `*`, but `{to}` has none");
                    self.problems.add(connection.from.span(), message);
                } else {
                    all.push(Cow::Borrowed(connection));
                }
                continue;
            };
            if after.contains('*') || from.matches('*').count() > 1 {
                let message = "each end of a connection can have only one `*`";
                self.problems.add(connection.to.span(), message);
                continue;
            }
            let Some((component, name, span)) = self.component_and_name(&connection.to) else { continue };
            // The case leaves the component out.
            let Some(m) = system.member(component) else { continue };
            let member = &system.members[m];
            let prefix = before.split_once(':').map_or("", |(_, prefix)| prefix);
            let names = member.wirable(Causality::Input).map(|(_, input)| &input.name);
            let names = names.chain(member.triggered().map(|(_, clock)| &clock.name));
            let texts: Vec<&str> = names.filter_map(|name| name.strip_prefix(prefix)?.strip_suffix(after)).collect();
            if texts.is_empty() && member.replaced.is_none() {
                self.problems.set_context(Some(context(system.case, Some(member.component))));
                self.problems.add(span, format!("no input of `{component}` matches `{name}`"));
                self.problems.set_context(None);
            }
            all.extend(texts.into_iter().map(|text| {
                let with = |end: &Spanned<String>| Spanned::new(end.span(), end.replace('*', text));
                Cow::Owned(Connection { from: with(&connection.from), to: with(&connection.to), ..connection.clone() })
            }));
        }
        all
    }

    /// Splits a connection of two arrays into connections of their elements. The arrays must have the same lengths.
    fn by_element(&mut self, system: &System<'_>, connection: Cow<'a, Connection>) -> Vec<Cow<'a, Connection>> {
        let elements = |end: &Spanned<String>| -> Vec<String> {
            let Some((component, name)) = end.split_once(':') else { return Vec::new() };
            let description = system.member(component).map(|m| &system.members[m].found.description);
            let arrays = description.filter(|description| description.index(name).is_none());
            let indices = |of: &Variable| of.name[name.len()..].to_owned();
            arrays.map_or(Vec::new(), |description| description.elements_of(name).map(indices).collect())
        };
        let [from, to] = [&connection.from, &connection.to].map(elements);
        if from.is_empty() || to.is_empty() {
            return vec![connection];
        }
        if from != to {
            let last = |list: &[String]| list.last().cloned().unwrap_or_default();
            let message = format!(
                "`{}` is an array up to {}, but its target `{}` is one up to {}",
                connection.from.get_ref(),
                last(&from),
                connection.to.get_ref(),
                last(&to)
            );
            let help = "connect arrays with the same lengths, or element by element";
            self.problems.set_context(Some(context(system.case, None)));
            self.problems.add_with_help(connection.to.span(), message, Some(help.to_owned()));
            self.problems.set_context(None);
            return Vec::new();
        }
        let of = |index: &String| {
            let with = |end: &Spanned<String>| Spanned::new(end.span(), format!("{}{index}", end.get_ref()));
            Cow::Owned(Connection { from: with(&connection.from), to: with(&connection.to), ..(*connection).clone() })
        };
        from.iter().map(of).collect()
    }

    pub(super) fn end(&mut self, system: &System<'_>, written: &Spanned<String>, causality: Causality) -> End {
        let (component, name, name_span) = self.component_and_name(written).ok_or(())?;
        // The case leaves the component out.
        let Some(m) = system.member(component) else { return Ok(None) };
        let member = &system.members[m];
        self.problems.set_context(Some(context(system.case, Some(member.component))));
        let wanted = if causality == Causality::Output { "output" } else { "input" };
        let of_input =
            member.wirable(Causality::Input).map(|(v, _)| v).find(|v| member.names(*v).any(|own| own == name));
        let index = of_input.filter(|_| causality == Causality::Input).or_else(|| member.found.description.index(name));
        match index {
            Some(v) if member.variable(v).causality != causality => {
                self.problems.add(
                    name_span,
                    format!(
                        "`{name}` of `{component}` is {}, expected an {wanted}",
                        parameter::role(member.variable(v))
                    ),
                );
                Err(())
            }
            Some(v) if member.variable(v).is_array() => {
                self.problems.add_with_help(
                    name_span,
                    format!("`{name}` of `{component}` is an array, which cannot be connected"),
                    Some("connect scalars: the FMU needs a variable for each element".to_string()),
                );
                Err(())
            }
            Some(v) if member.variable(v).base_type == BaseType::String => {
                self.problems.add(name_span, "a String cannot be connected".to_string());
                Err(())
            }
            Some(v) => Ok(Some((m, v))),
            // Another FMU need not have all inputs of the component's own FMU.
            None if causality == Causality::Input && member.replaced.is_some() => Ok(None),
            None => {
                let names: Vec<&str> = member.wirable(causality).map(|(_, v)| v.name.as_str()).collect();
                let own = member.replaced.as_ref().and_then(|replaced| replaced.original.as_ref());
                let had = own.filter(|own| own.description.variable(name).is_some());
                let had = had.map_or(String::new(), |_| format!(", which {} has", member.component.fmu.get_ref()));
                let message = format!("`{component}` has no {wanted} `{name}`{had}");
                let help = parameter::array(&member.found.description, name).or_else(|| similar(name, names));
                self.problems.add_with_help(name_span, message, help);
                Err(())
            }
        }
    }

    /// Marks the components from which no path leads to a recorded output.
    fn drop_unneeded(&mut self, system: &mut System<'_>) {
        let mut needed = vec![false; system.members.len()];
        let mut open: Vec<usize> = (0..system.members.len())
            .filter(|&m| {
                let member = &system.members[m];
                let is_recorded = |v: usize, variable: &Variable| {
                    self.is_recorded(member.name(), &variable.name) && !system.replaced.contains_key(&(m, v))
                };
                member.wirable(Causality::Output).any(|(v, variable)| is_recorded(v, variable))
                    || member.inputs.iter().any(|(v, source)| self.records_input(member, *v, source))
            })
            .collect();
        while let Some(m) = open.pop() {
            if std::mem::replace(&mut needed[m], true) {
                continue;
            }
            let member = &system.members[m];
            open.extend(member.inputs.iter().filter_map(|(_, source)| Some(source.output()?.0)));
            open.extend(member.clocks.iter().map(|(_, (from, _))| *from));
        }
        for (member, needed) in system.members.iter_mut().zip(needed) {
            member.dropped = !needed;
        }
    }

    /// The run of a case with its wires, without parameters, arrays, point and seed.
    pub(super) fn wired(&self, system: &System<'_>, columns: &[Column], simulation: &run::Simulation) -> run::Run {
        let kept = &system.order;
        let sources = || kept.iter().flat_map(|&m| &system.members[m].inputs).map(|(_, source)| source);
        // Slots: series first, in the order of the file, then outputs in the order of the components.
        let mut slots = 0..;
        let mut next = || slots.next().unwrap_or_default();
        let feeds = self.inputs.as_ref().map_or(&[][..], |inputs| &inputs.feeds);
        let mut used: Vec<usize> =
            sources().filter_map(Source::series).chain(system.replaced.values().copied()).collect();
        used.sort_by_key(|feed| (feeds[*feed].column, *feed));
        used.dedup();
        let feed_slots: HashMap<usize, usize> = used.iter().map(|&feed| (feed, next())).collect();
        let read: BTreeSet<(usize, usize)> = sources().filter_map(Source::output).collect();
        let mut output_slots: BTreeMap<(usize, usize), usize> = BTreeMap::new();
        for &m in kept {
            let member = &system.members[m];
            for (v, variable) in member.wirable(Causality::Output) {
                let is_recorded =
                    || self.is_recorded(member.name(), &variable.name) && !system.replaced.contains_key(&(m, v));
                if read.contains(&(m, v)) || is_recorded() {
                    output_slots.insert((m, v), next());
                }
            }
        }
        let components = kept
            .iter()
            .map(|&m| {
                let member = &system.members[m];
                let description = &member.found.description;
                let [every, substeps] = member.component.rates();
                let is_linear = simulation.extrapolation == Extrapolation::Linear;
                let mut constants = Vec::new();
                let mut inputs = Vec::new();
                for (v, source) in &member.inputs {
                    let variable = member.variable(*v);
                    let is_line = is_linear && member.is_line(variable);
                    match source {
                        Source::Constant(value) => constants.push(Setting::new(variable, value.clone())),
                        Source::Series(feed) => inputs.push(Wire {
                            is_ramp: is_line && feeds[*feed].interpolation == Interpolation::Linear,
                            ..Wire::new(variable, feed_slots[feed])
                        }),
                        Source::Output(m, o) => inputs.push(Wire {
                            conversion: member.conversions.get(v).copied(),
                            is_ramp: is_line && system.members[*m].is_line(system.members[*m].variable(*o)),
                            ..Wire::new(variable, output_slots[&(*m, *o)])
                        }),
                    }
                }
                run::Component {
                    name: member.name().to_string(),
                    fmu: member.found.path.clone(),
                    fmi: description.fmi,
                    model_identifier: description.model_identifier(member.interface()).unwrap_or_default().to_owned(),
                    integration: member.integration,
                    guid: description.guid.clone(),
                    every,
                    substeps,
                    is_discrete: member.is_discrete(),
                    structure: description.structure.clone(),
                    parameters: Vec::new(),
                    steady: member.component.steady().map(|_| Vec::new()),
                    constants,
                    inputs,
                    outputs: output_slots
                        .range((m, 0)..(m + 1, 0))
                        .map(|((_, v), slot)| Wire {
                            is_ramp: every > 1 && member.is_line(member.variable(*v)),
                            ..Wire::new(member.variable(*v), *slot)
                        })
                        .collect(),
                    clocks: member
                        .clocks
                        .iter()
                        .map(|(clock, source)| clock_wire(system, member, *clock, *source))
                        .collect(),
                    arrays: Vec::new(),
                }
            })
            .collect();
        let series = used
            .iter()
            .map(|feed| run::InputSeries {
                slot: feed_slots[feed],
                interpolation: feeds[*feed].interpolation,
                times: Arc::clone(&feeds[*feed].signal.times),
                values: Arc::clone(&feeds[*feed].signal.values),
            })
            .collect();
        let case = system.case.name.get_ref();
        run::Run {
            id: case.clone(),
            case: case.clone(),
            point: None,
            seed: None,
            components,
            initialization: super::start::evaluations(system, &output_slots),
            series,
            slots: feed_slots.len() + output_slots.len(),
            columns: columns
                .iter()
                .map(|column| {
                    let m = system.member(&column.component)?;
                    let v = system.members[m].found.description.index(&column.variable)?;
                    let mut inputs = system.members[m].inputs.iter().filter(|(input, _)| *input == v);
                    let on_input = inputs.find_map(|(_, source)| source.series());
                    let feed = system.replaced.get(&(m, v)).copied().or(on_input);
                    feed.map_or_else(|| output_slots.get(&(m, v)).copied(), |feed| feed_slots.get(&feed).copied())
                })
                .collect(),
            binary: self.scenario.record.binary,
        }
    }
}
