//! The order in which components make their steps, and the times of the values that connections carry.

use super::system::{CaseComponent, Resolver, System, context};
use crate::plan::Timing;
use crate::run;
use crate::scenario::ComponentKind;
use fmu_import::description::{BaseType, Causality, Variability};

/// Largest number of components in a cycle for which the best order is searched.
const MAX_CYCLE: usize = 12;

impl CaseComponent<'_> {
    /// Returns true if the component takes samples: all its outputs are discrete and it is not in model exchange, unless
    /// the scenario declares its kind.
    pub(super) fn is_discrete(&self) -> bool {
        let is_sampled = |v: &fmu_import::description::Variable| {
            v.base_type != BaseType::Real || v.variability == Variability::Discrete
        };
        match self.component.kind.as_ref().map(|kind| *kind.get_ref()) {
            Some(kind) => kind == ComponentKind::Discrete,
            None if self.integration.is_some() => false,
            None => self.all(Causality::Output).all(|(_, variable)| is_sampled(variable)),
        }
    }

    /// Returns true if a variable of the component changes continuously.
    pub(super) fn is_line(&self, variable: &fmu_import::description::Variable) -> bool {
        let kind = (variable.base_type, variable.variability);
        kind == (BaseType::Real, Variability::Continuous) && !self.is_discrete()
    }
}

impl System<'_> {
    /// The connections, each as the component that writes and the one that reads.
    fn wires(&self) -> impl Iterator<Item = (usize, usize)> {
        let kept = self.members.iter().enumerate().filter(|(_, member)| !member.dropped);
        kept.flat_map(|(to, member)| {
            member.inputs.iter().filter_map(move |(_, source)| source.output().map(|(from, _)| (from, to)))
        })
    }

    /// When a reader gets the values of a writer, with the components in this order.
    pub(super) fn timing(&self, from: usize, to: usize, order: run::Order) -> Timing {
        let place = |m: usize| self.order.iter().position(|other| *other == m);
        let is_first = order != run::Order::Jacobi && place(from) < place(to);
        match (self.members[from].is_discrete(), self.members[to].is_discrete(), is_first) {
            (false, true, true) => Timing::Early,
            (false, true, false) | (_, _, true) => Timing::OnTime,
            (false, false, false) => Timing::Held,
            (true, _, false) => Timing::Late,
        }
    }

    /// Number of connections whose values come too late or too early.
    fn misplaced(&self, order: run::Order) -> usize {
        let timing = |(from, to)| self.timing(from, to, order);
        self.wires().map(timing).filter(|timing| matches!(timing, Timing::Late | Timing::Early)).count()
    }

    /// The order with the fewest connections that carry values of another time; of equal orders, the one that is
    /// nearest to the scenario. The second value is the size of the largest cycle that keeps the order of the scenario.
    fn best_order(&self) -> (Vec<usize>, usize) {
        let count = self.members.len();
        // How often a component should come before another one. What takes samples reads the values from before the
        // step, and therefore comes before what it reads.
        let mut wishes = vec![vec![0_usize; count]; count];
        for (from, to) in self.wires().filter(|(from, to)| from != to) {
            let is_reversed = !self.members[from].is_discrete() && self.members[to].is_discrete();
            let (first, second) = if is_reversed { (to, from) } else { (from, to) };
            wishes[first][second] += 1;
        }
        let mut leads: Vec<Vec<bool>> = wishes.iter().map(|row| row.iter().map(|n| *n > 0).collect()).collect();
        run::close(&mut leads);
        let mut open = self.order.clone();
        open.sort_unstable();
        let (mut order, mut unsearched) = (Vec::new(), 0);
        while !open.is_empty() {
            let waits = |m: usize| open.iter().any(|other| leads[*other][m] && !leads[m][*other]);
            let Some(next) = open.iter().copied().find(|m| !waits(*m)) else { break };
            let (cycle, rest): (Vec<usize>, Vec<usize>) =
                open.iter().partition(|m| **m == next || leads[**m][next] && leads[next][**m]);
            if cycle.len() > MAX_CYCLE {
                unsearched = unsearched.max(cycle.len());
                order.extend(cycle);
            } else {
                order.extend(shortest(&cycle, &wishes));
            }
            open = rest;
        }
        (order, unsearched)
    }
}

/// The order of the components of a cycle with the fewest broken wishes, by dynamic programming over the sets of
/// components that come first. Of equal orders, the lexicographically smallest.
fn shortest(cycle: &[usize], wishes: &[Vec<usize>]) -> Vec<usize> {
    let size = cycle.len();
    let all = (1_usize << size) - 1;
    // Broken if `next` comes after the set `before`.
    let broken = |before: usize, next: usize| -> usize {
        (0..size).filter(|i| before >> i & 1 == 1).map(|i| wishes[cycle[next]][cycle[i]]).sum()
    };
    let open = |before: usize| (0..size).filter(move |i| before >> i & 1 == 0);
    let mut fewest = vec![0_usize; all + 1];
    for before in (0..all).rev() {
        fewest[before] = open(before).map(|next| broken(before, next) + fewest[before | 1 << next]).min().unwrap_or(0);
    }
    let (mut order, mut before) = (Vec::new(), 0);
    while before != all {
        let is_best = |next: &usize| broken(before, *next) + fewest[before | 1 << next] == fewest[before];
        let Some(next) = open(before).find(is_best) else { break };
        order.push(cycle[next]);
        before |= 1 << next;
    }
    order
}

impl Resolver<'_> {
    /// Sets the order of the components of a case. Unless somebody has chosen the order, warns if connections carry
    /// values of another time although there is an order in which they would not.
    pub(super) fn set_order(&mut self, system: &mut System<'_>, order: run::Order, is_chosen: bool) {
        system.order = (0..system.members.len()).filter(|m| !system.members[*m].dropped).collect();
        let now = system.misplaced(order);
        if order != run::Order::Auto && (is_chosen || now == 0) {
            return;
        }
        let (best, unsearched) = system.best_order();
        let listed = std::mem::replace(&mut system.order, best);
        let (span, message, help) = match order {
            run::Order::Auto if unsearched == 0 => return,
            run::Order::Auto => (
                self.scenario.simulation.step.span(),
                format!("{unsearched} components depend on each other in a cycle and keep the order of the scenario"),
                format!("cycles of up to {MAX_CYCLE} components are ordered automatically"),
            ),
            _ => {
                let fewer = system.misplaced(run::Order::Auto);
                system.order = listed;
                if fewer >= now {
                    return;
                }
                let misplaced = |(from, to): &(usize, usize)| {
                    matches!(system.timing(*from, *to, order), Timing::Late | Timing::Early)
                };
                let reader = system.wires().find(misplaced).map_or(0, |(_, to)| to);
                (
                    system.members[reader].component.name.span(),
                    format!("connections that carry values of another step: {now}"),
                    format!("`order = \"auto\"` in [simulation] finds an order with {fewer}"),
                )
            }
        };
        self.problems.set_context(Some(context(system.case, None)));
        self.problems.warn(span, message, Some(help));
        self.problems.set_context(None);
    }
}
