//! The order in which inputs and outputs are evaluated in Initialization Mode, from the dependencies that the FMUs
//! declare, and the algebraic loops among them.

use super::system::{CaseComponent, Source, System};
use crate::plan;
use crate::run::{self, AlgebraicLoop, Evaluation, Linear, Unknown};
use fmu_import::description::{BaseType, FmiVersion, Initial, Variable};
use std::collections::{BTreeMap, BTreeSet};

/// An output with a slot.
struct Output<'a> {
    /// Component, as an index among those that are kept.
    component: usize,
    variable: &'a Variable,
    slot: usize,
    /// Slots of the outputs on which its value depends in Initialization Mode.
    needs: BTreeSet<usize>,
    /// True if it depends on inputs, which have to be set first.
    has_inputs: bool,
}

/// A connected input.
struct Reader<'a> {
    component: usize,
    variable: &'a Variable,
    slot: usize,
    conversion: Linear,
}

/// A connection in a loop.
struct Connection {
    /// Output and input.
    ends: [String; 2],
    /// True if the writer comes before the reader.
    is_forward: bool,
}

/// The inputs on which an output depends in Initialization Mode; `None`: all of them. Without an entry in the model
/// structure, the value is the start value, except in FMI 2.0 without any entry, where outputs that are not exact depend
/// on the same inputs as later.
fn initial_dependencies<'a>(member: &'a CaseComponent<'_>, output: usize) -> Option<&'a [usize]> {
    let description = &member.found.description;
    let variable = &description.variables[output];
    let output = variable.alias_of.unwrap_or(output);
    let find = |unknowns: &'a [fmu_import::description::Unknown]| unknowns.iter().find(|u| u.variable == output);
    if let Some(entry) = find(&description.initial_unknowns) {
        return entry.dependencies.as_deref();
    }
    let is_undeclared = description.fmi == FmiVersion::V2 && description.initial_unknowns.is_empty();
    if is_undeclared && variable.initial != Some(Initial::Exact) {
        return find(&description.outputs).and_then(|entry| entry.dependencies.as_deref());
    }
    Some(&[])
}

/// The inputs on which an output depends within a step; `None`: all of them. Samples depend on none.
fn dependencies<'a>(member: &'a CaseComponent<'_>, output: usize) -> Option<&'a [usize]> {
    if member.is_discrete() {
        return Some(&[]);
    }
    let description = &member.found.description;
    let output = description.variables[output].alias_of.unwrap_or(output);
    let entry = description.outputs.iter().find(|unknown| unknown.variable == output);
    entry.and_then(|entry| entry.dependencies.as_deref())
}

/// Returns the evaluations of a case in their order. `slots` has the slots of the outputs.
pub(super) fn evaluations(system: &System<'_>, slots: &BTreeMap<(usize, usize), usize>) -> Vec<Evaluation> {
    Graph::new(system, slots, initial_dependencies).find().into_iter().map(|(evaluation, _)| evaluation).collect()
}

/// The algebraic loops of a case: at the start, and those that the order of the components breaks in each step.
pub(super) fn loops(system: &System<'_>, order: run::Order) -> Vec<plan::Loop> {
    let inputs = system.order.iter().flat_map(|m| &system.members[*m].inputs);
    let read: BTreeSet<(usize, usize)> = inputs.filter_map(|(_, source)| source.output()).collect();
    let slots = read.into_iter().zip(0..).collect();
    let found = |at_start, graph: Graph<'_>| {
        let loops = graph.find().into_iter().filter_map(|(evaluation, cycle)| {
            let is_held = |connection: &&Connection| order == run::Order::Jacobi || !connection.is_forward;
            let held = cycle.iter().filter(is_held).map(|connection| connection.ends.join(" -> ")).collect();
            Some(plan::Loop { at_start, path: evaluation.equations?.path, held })
        });
        loops.collect::<Vec<_>>()
    };
    let mut all = found(true, Graph::new(system, &slots, initial_dependencies));
    all.append(&mut found(false, Graph::new(system, &slots, dependencies)));
    all
}

struct Graph<'a> {
    members: Vec<&'a CaseComponent<'a>>,
    /// In the order of their slots.
    outputs: Vec<Output<'a>>,
    readers: Vec<Reader<'a>>,
    /// Slots of the outputs that have their final values.
    known: BTreeSet<usize>,
}

impl<'a> Graph<'a> {
    fn new(
        system: &'a System<'_>,
        slots: &BTreeMap<(usize, usize), usize>,
        dependencies: impl Fn(&'a CaseComponent<'_>, usize) -> Option<&'a [usize]>,
    ) -> Self {
        let (mut outputs, mut readers) = (Vec::new(), Vec::new());
        let members: Vec<&CaseComponent<'_>> = system.order.iter().map(|m| &system.members[*m]).collect();
        for (component, (&m, member)) in system.order.iter().zip(&members).enumerate() {
            let slot_of = |source: &Source| slots.get(&source.output()?).copied();
            readers.extend(member.inputs.iter().filter_map(|(v, source)| {
                let slot = slot_of(source)?;
                let conversion = member.conversions.get(v).copied().unwrap_or(Linear::IDENTITY);
                Some(Reader { component, variable: member.variable(*v), slot, conversion })
            }));
            for ((_, v), slot) in slots.range((m, 0)..(m + 1, 0)) {
                let listed = dependencies(member, *v);
                let is_needed = |input: usize| listed.is_none_or(|list| list.contains(&input));
                let needed = || member.inputs.iter().filter(|(input, _)| is_needed(*input));
                outputs.push(Output {
                    component,
                    variable: member.variable(*v),
                    slot: *slot,
                    needs: needed().filter_map(|(_, source)| slot_of(source)).collect(),
                    has_inputs: needed().next().is_some(),
                });
            }
        }
        Self { members, outputs, readers, known: BTreeSet::new() }
    }

    /// The evaluations in their order; for loops, also a cycle of connections.
    fn find(mut self) -> Vec<(Evaluation, Vec<Connection>)> {
        self.known = self.outputs.iter().filter(|output| !output.has_inputs).map(|output| output.slot).collect();
        let mut open: Vec<usize> = (0..self.members.len()).collect();
        let mut evaluations = Vec::new();
        while !open.is_empty() {
            let is_ready = |c: &usize| self.readers.iter().all(|r| r.component != *c || self.known.contains(&r.slot));
            let ready = open.iter().position(is_ready).map(|at| open.remove(at));
            let next = ready.or_else(|| open.iter().copied().find(|component| self.news(*component).next().is_some()));
            // Otherwise, each unknown signal depends on another one, so there is a cycle.
            evaluations.push(match next {
                Some(component) => self.evaluate(component),
                None => self.solve(),
            });
        }
        evaluations
    }

    /// The outputs of a component that become known when it is evaluated.
    fn news(&self, component: usize) -> impl Iterator<Item = usize> {
        let own = self.outputs.iter().filter(move |output| output.component == component);
        own.filter(|o| !self.known.contains(&o.slot) && o.needs.is_subset(&self.known)).map(|output| output.slot)
    }

    fn evaluate(&mut self, component: usize) -> (Evaluation, Vec<Connection>) {
        let news: Vec<usize> = self.news(component).collect();
        self.known.extend(news);
        (Evaluation::of(component), Vec::new())
    }

    fn needs(&self, slot: usize) -> &BTreeSet<usize> {
        static NONE: BTreeSet<usize> = BTreeSet::new();
        self.outputs.iter().find(|output| output.slot == slot).map_or(&NONE, |output| &output.needs)
    }

    /// The slots that the value in a slot depends on and that are not known yet, directly or through others.
    fn behind(&self, slot: usize) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        let mut open = vec![slot];
        while let Some(next) = open.pop() {
            open.extend(self.needs(next).difference(&self.known).filter(|need| found.insert(**need)));
        }
        found
    }

    /// The unknown slots whose values depend on that in a slot, directly or through others.
    fn ahead(&self, slot: usize) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        let mut open = vec![slot];
        while let Some(next) = open.pop() {
            let readers = self.outputs.iter().filter(|output| output.needs.contains(&next)).map(|output| output.slot);
            open.extend(readers.filter(|reader| !self.known.contains(reader) && found.insert(*reader)));
        }
        found
    }

    /// The first algebraic loop on which no other loop has an effect. Its signals are known from now on.
    fn solve(&mut self) -> (Evaluation, Vec<Connection>) {
        let unknown = || self.outputs.iter().filter(|output| !self.known.contains(&output.slot));
        // A signal of a loop depends on itself; in the first loop, all signals depend on each other.
        let is_mutual =
            |slots: &BTreeSet<usize>, slot| self.behind(slot) == *slots && slots.is_subset(&self.ahead(slot));
        let is_first = |slots: &BTreeSet<usize>| slots.first().is_some_and(|slot| is_mutual(slots, *slot));
        let slots = unknown().map(|output| self.behind(output.slot)).find(is_first);
        let slots = slots.unwrap_or_default();
        let members = || self.outputs.iter().filter(|output| slots.contains(&output.slot));
        let is_in_loop = |reader: &&Reader<'_>| {
            members().any(|output| output.component == reader.component && output.needs.contains(&reader.slot))
        };
        let readers = |slot: usize| self.readers.iter().filter(move |reader| reader.slot == slot).filter(is_in_loop);
        let is_real = |reader: &&Reader<'_>| reader.variable.base_type == BaseType::Real;
        let is_unknown = |output: &&Output<'_>| {
            output.variable.base_type == BaseType::Real && readers(output.slot).any(|reader| is_real(&reader))
        };
        let is_held =
            |output: &&Output<'_>| !is_unknown(output) || readers(output.slot).any(|reader| !is_real(&reader));
        let start = |slot: usize| {
            let mut values = readers(slot).filter(is_real).filter_map(|reader| {
                let start = reader.variable.start.as_ref()?.real()?;
                Some((start - reader.conversion.offset) / reader.conversion.factor)
            });
            values.find(|start| start.is_finite())
        };
        let components: BTreeSet<usize> = members().map(|output| output.component).collect();
        let has_derivatives = |component: &usize| {
            let has_elements = members().any(|output| output.variable.element.is_some());
            !has_elements && self.members[*component].has(|unit| unit.provides_directional_derivative)
        };
        let name =
            |component: usize, variable: &Variable| format!("{}:{}", self.members[component].name(), variable.name);
        let connection = |(from, to): (&Output<'_>, &Reader<'_>)| Connection {
            ends: [name(from.component, from.variable), name(to.component, to.variable)],
            is_forward: from.component < to.component,
        };
        let cycle: Vec<Connection> = self.cycle(&slots).into_iter().map(connection).collect();
        let path: Vec<&str> = cycle.iter().flat_map(|connection| &connection.ends).map(String::as_str).collect();
        let equations = AlgebraicLoop {
            unknowns: members()
                .filter(is_unknown)
                .map(|output| Unknown {
                    slot: output.slot,
                    start: start(output.slot).unwrap_or_default(),
                    nominal: output.variable.nominal.map(f64::abs).filter(|n| *n > 0.0).unwrap_or(1.0),
                })
                .collect(),
            held: members().filter(is_held).map(|output| output.slot).collect(),
            has_derivatives: components.iter().all(has_derivatives),
            path: path.join(" -> "),
        };
        let evaluation = Evaluation { components: components.into_iter().collect(), equations: Some(equations) };
        self.known.extend(slots);
        (evaluation, cycle)
    }

    /// A cycle of connections through a loop, beginning with its first signal.
    fn cycle(&self, slots: &BTreeSet<usize>) -> Vec<(&Output<'a>, &Reader<'a>)> {
        let of = |slot: usize| self.outputs.iter().find(|output| output.slot == slot);
        // From a signal back to one that it needs, until a signal comes again.
        let mut chain: Vec<usize> = slots.first().copied().into_iter().collect();
        let first = loop {
            let next = chain.last().and_then(|slot| self.needs(*slot).intersection(slots).next());
            let Some(next) = next else { return Vec::new() };
            match chain.iter().position(|slot| slot == next) {
                Some(place) => break place,
                None => chain.push(*next),
            }
        };
        chain.drain(..first);
        chain.reverse();
        let begin = (0..chain.len()).min_by_key(|i| chain[*i]).unwrap_or_default();
        chain.rotate_left(begin);
        let next = |i: usize| of(chain[(i + 1) % chain.len()]);
        let wire = |(i, slot): (usize, &usize)| {
            let component = next(i)?.component;
            let reader = self.readers.iter().find(|r| r.slot == *slot && r.component == component)?;
            Some((of(*slot)?, reader))
        };
        chain.iter().enumerate().filter_map(wire).collect()
    }
}
