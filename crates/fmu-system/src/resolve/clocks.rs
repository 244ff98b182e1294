//! Connections of clocks: the clock that activates each triggered input clock.

use super::system::{CaseComponent, Resolver, Source, System, context};
use crate::run::ClockWire;
use crate::scenario::Connection;
use crate::spanned::Spanned;
use fmu_import::c_api::Reference;
use fmu_import::description::{Causality, Clock, IntervalVariability};
use std::collections::{BTreeSet, HashMap};

/// The clocks that connections name, as component and clock, by the component and the reference of the input clock.
/// `None`: a mistake was reported.
pub(super) type ClockConnections = HashMap<(usize, Reference), Option<(usize, usize)>>;

impl CaseComponent<'_> {
    /// Triggered input clocks, by index; also their aliases.
    pub(super) fn triggered(&self) -> impl Iterator<Item = (usize, &Clock)> {
        self.all_clocks(Causality::Input).filter(|(_, clock)| is_triggered(clock))
    }
}

fn is_triggered(clock: &Clock) -> bool {
    clock.interval_variability == IntervalVariability::Triggered
}

/// Returns true if other components can activate the clock.
fn is_target(clock: &Clock) -> bool {
    clock.causality == Causality::Input && is_triggered(clock)
}

/// Returns true if the clock can activate those of other components.
fn is_source(clock: &Clock) -> bool {
    clock.causality != Causality::Local && !is_target(clock)
}

/// The clock that an end of a connection names, as component and clock.
fn clock_of(system: &System<'_>, end: &Spanned<String>) -> Option<(usize, usize)> {
    let (component, name) = end.split_once(':')?;
    let m = system.member(component)?;
    let index = system.members[m].found.description.clocks.iter().position(|clock| clock.name == name)?;
    Some((m, index))
}

/// The wire of an input clock in a run.
pub(super) fn clock_wire(
    system: &System<'_>,
    member: &CaseComponent<'_>,
    clock: usize,
    from: (usize, usize),
) -> ClockWire {
    let (clock, writer) = (member.clock(clock), &system.members[from.0]);
    let source = writer.clock(from.1);
    ClockWire {
        name: clock.name.clone(),
        reference: clock.reference,
        component: writer.name().to_owned(),
        source: source.name.clone(),
        source_reference: source.reference,
    }
}

/// The clocks of the outputs that the inputs of a clock read: a connection of clocked variables carries their clock.
fn carried(system: &System<'_>, member: &CaseComponent<'_>, clock: Reference) -> BTreeSet<(usize, usize)> {
    let clocked = member.inputs.iter().filter(|(input, _)| member.variable(*input).clocks.contains(&clock));
    let clocks = |(_, source): &(usize, Source)| {
        let Source::Output(from, output) = source else { return Vec::new() };
        let writer = &system.members[*from];
        let of = &writer.variable(*output).clocks;
        let is_source = |clock: &Clock| of.contains(&clock.reference) && is_source(clock);
        let clocks = writer.found.description.clocks.iter().enumerate().filter(|_| writer.shares_clocks());
        clocks.filter(|(_, clock)| is_source(clock)).map(|(index, _)| (*from, index)).collect()
    };
    clocked.flat_map(clocks).collect()
}

impl<'a> Resolver<'a> {
    /// Adds the connection of two clocks. Returns false if neither end is a clock.
    pub(super) fn connect_clock(
        &mut self,
        system: &System<'a>,
        connection: &Connection,
        clocks: &mut ClockConnections,
    ) -> bool {
        let ends = [(&connection.from, Causality::Output), (&connection.to, Causality::Input)];
        let [from, to] = ends.map(|(end, _)| clock_of(system, end));
        if from.is_none() && to.is_none() {
            return false;
        }
        let clock = |(m, index): (usize, usize)| system.members[m].clock(index);
        let input = to.map(|to| (to.0, clock(to).reference));
        let shares = |(m, _): (usize, usize)| system.members[m].shares_clocks();
        let is_valid = from.is_some_and(|from| is_source(clock(from)) && shares(from))
            && to.is_some_and(|to| is_target(clock(to)) && shares(to));
        let scheduled = [from, to].map(|end| end.is_some_and(|end| !shares(end)));
        let known = input.map(|input| clocks.insert(input, from.filter(|_| is_valid)));
        let [from, to] = [from, to].map(|end| end.map(clock));
        let (message, help) = if is_valid {
            if known == Some(None) {
                return true;
            }
            (format!("a second connection writes `{}`", connection.to.get_ref()), None)
        } else {
            let mut words = Vec::new();
            for ((end, causality), (clock, is_scheduled)) in ends.into_iter().zip([from, to].into_iter().zip(scheduled))
            {
                let is = match (clock, clock.map(|clock| clock.causality)) {
                    (Some(_), _) if is_scheduled => {
                        "a Clock in scheduled execution, which cannot be connected".to_owned()
                    }
                    (Some(clock), Some(Causality::Input)) => format!("a {} input Clock", clock.interval_variability),
                    (Some(_), Some(Causality::Output)) => "an output Clock".to_owned(),
                    (Some(_), _) => "a local Clock".to_owned(),
                    (None, _) => match self.end(system, end, causality) {
                        Ok(Some((m, v))) => system.members[m].variable(v).base_type.to_string(),
                        _ => return true,
                    },
                };
                words.push(format!("`{}` is {is}", end.get_ref()));
            }
            let help = "connect an output Clock, or one that ticks at its own times, to a triggered input Clock";
            (words.join(", but its target "), Some(help.to_owned()))
        };
        self.problems.set_context(Some(context(system.case, None)));
        self.problems.add_with_help(connection.to.span(), message, help);
        true
    }

    /// Finds the clock that activates each triggered input clock: that of a connection, or the only output clock of the
    /// same name, or else the only clock of the outputs that its clocked inputs read.
    pub(super) fn wire_clocks(&mut self, system: &mut System<'a>, connections: &ClockConnections) {
        let outputs: Vec<(usize, usize)> = (system.members.iter().enumerate())
            .filter(|(_, member)| member.shares_clocks())
            .flat_map(|(m, member)| member.all_clocks(Causality::Output).map(move |(index, _)| (m, index)))
            .collect();
        let mut wired = Vec::new();
        for (m, member) in system.members.iter().enumerate() {
            self.problems.set_context(Some(context(system.case, Some(member.component))));
            let mut clocks: Vec<(usize, (usize, usize))> = Vec::new();
            let mut seen = Vec::new();
            for (index, clock) in member.triggered() {
                if seen.contains(&clock.reference) {
                    continue;
                }
                seen.push(clock.reference);
                if let Some(connected) = connections.get(&(m, clock.reference)) {
                    clocks.extend(connected.map(|from| (index, from)));
                    continue;
                }
                let is_own = |name: &str| {
                    member.triggered().any(|(_, own)| own.reference == clock.reference && own.name == name)
                };
                let others = outputs.iter().filter(|from| from.0 != m && member.shares_clocks());
                let with_clock =
                    |from: (usize, usize)| (from, &system.members[from.0], system.members[from.0].clock(from.1));
                let others = others.map(|from| with_clock(*from));
                let mut same: Vec<_> = others.clone().filter(|(_, _, other)| is_own(&other.name)).collect();
                if same.is_empty() && member.shares_clocks() {
                    same = carried(system, member, clock.reference).into_iter().map(with_clock).collect();
                }
                let list = |ends: &mut dyn Iterator<Item = (_, &CaseComponent<'_>, &Clock)>| {
                    let names = ends.map(|(_, member, clock)| format!("`{}:{}`", member.name(), clock.name));
                    names.collect::<Vec<_>>().join(", ")
                };
                let (place, of) =
                    (member.component.name.span(), format!("the clock `{}` of `{}`", clock.name, member.name()));
                match same[..] {
                    [(from, ..)] => clocks.push((index, from)),
                    [] => {
                        let message = format!("{of} is triggered and never ticks: no clock is connected to it");
                        let help = Some(list(&mut others.clone())).filter(|list| !list.is_empty());
                        let help = help.map(|list| format!("add a [[connection]]; output clocks: {list}"));
                        self.problems.warn(place, message, help);
                    }
                    _ => {
                        let message = format!("{of} has several writers: {}", list(&mut same.into_iter()));
                        self.problems.add_with_help(
                            place,
                            message,
                            Some("choose one with a [[connection]]".to_owned()),
                        );
                    }
                }
            }
            wired.push(clocks);
        }
        self.problems.set_context(None);
        for (member, clocks) in system.members.iter_mut().zip(wired) {
            member.clocks = clocks;
        }
    }
}
