//! Consistent values of connected inputs and outputs in Initialization Mode.

use super::{Bus, Component};
use crate::algebraic::{self, Equations, Unsolved};
use crate::fmus::FmusError;
use crate::run::{AlgebraicLoop, Run, Wire};
use fmu_import::c_api::Reference;
use fmu_import::description::BaseType;
use fmu_import::loader::{CallError, Message, Status};

/// Maximum number of rounds until the signals that are not Real no longer change.
const ROUNDS: usize = 10;

/// Sets the inputs of components, those that are not Real to their values on the bus `held` if it is given, then reads
/// their outputs.
pub(super) fn evaluate(
    components: &[usize],
    members: &mut [Component],
    bus: &mut Bus,
    held: Option<&Bus>,
) -> Result<(), CallError> {
    for index in components {
        let member = &mut members[*index];
        member.load_reals(bus);
        member.set_reals()?;
        member.set_others(held.unwrap_or(bus))?;
    }
    components.iter().try_for_each(|index| members[*index].read_outputs(bus))
}

/// Warns of the first connected output that the end of initialization changes by more than 1e-6 of its value or nominal
/// value: the inputs that read it were initialized with the earlier value. Clocks may change outputs then.
pub(super) fn change(run: &Run, members: &[Component], before: &[f64], after: &[f64]) -> Option<(String, Message)> {
    let inputs = || run.components.iter().flat_map(|component| &component.inputs);
    let is_changed = |wire: &&Wire| {
        let (old, new) = (before[wire.slot], after[wire.slot]);
        let is_real = wire.base_type == BaseType::Real;
        let limit = if is_real { 1e-6 * new.abs().max(wire.nominal.unwrap_or(1.0)) } else { 0.0 };
        (new - old).abs() > limit && inputs().any(|input| input.slot == wire.slot)
    };
    let mut unclocked = run.components.iter().zip(members).filter(|(_, member)| !member.instance.has_clocks());
    let (component, Wire { name, slot, .. }) =
        unclocked.find_map(|(own, _)| Some((own.name.clone(), own.outputs.iter().find(is_changed)?)))?;
    let text = format!(
        "output `{name}` changes from {:?} to {:?} at the end of initialization; the inputs that read it were \
         initialized with the first value",
        before[*slot], after[*slot]
    );
    Some((component, Message { status: Status::Warning, category: String::new(), text }))
}

/// Solves an algebraic loop. Signals that are not Real are held while the equations are solved, until nothing changes.
pub(super) fn solve(
    equations: &AlgebraicLoop,
    components: &[usize],
    members: &mut [Component],
    bus: &mut Bus,
) -> Result<(), FmusError> {
    let unsolved = |problem, detail| FmusError::Loop { problem, path: equations.path.clone(), detail };
    let nominal: Vec<f64> = equations.unknowns.iter().map(|unknown| unknown.nominal).collect();
    let mut z: Vec<f64> = equations.unknowns.iter().map(|unknown| unknown.start).collect();
    for _ in 0..ROUNDS {
        let held = bus.clone();
        let mut system = System { equations, components, members, bus, held: &held };
        z = match algebraic::solve(&mut system, &z, &nominal) {
            Ok(solution) => solution,
            Err(Unsolved::Evaluation(error)) => return Err(error.into()),
            Err(Unsolved::NoSolution { problem, detail }) => return Err(unsolved(problem, detail)),
        };
        system.evaluate(&z)?;
        if equations.held.iter().all(|slot| bus.is_same(*slot, &held)) {
            return Ok(());
        }
    }
    Err(unsolved("does not settle", format!("signals that are not Real change in each of {ROUNDS} rounds")))
}

struct System<'a> {
    equations: &'a AlgebraicLoop,
    components: &'a [usize],
    members: &'a mut [Component],
    bus: &'a mut Bus,
    /// Values of the signals that are not Real, and of all signals for the inputs that are not.
    held: &'a Bus,
}

impl Equations for System<'_> {
    type Error = CallError;

    fn evaluate(&mut self, z: &[f64]) -> Result<Vec<f64>, CallError> {
        for slot in &self.equations.held {
            self.bus.copy(*slot, self.held);
        }
        for (unknown, value) in self.equations.unknowns.iter().zip(z) {
            self.bus.numbers[unknown.slot] = *value;
        }
        match evaluate(self.components, self.members, self.bus, Some(self.held)) {
            // Not defined here: the solver tries a point that is nearer to the one before.
            Err(error) if error.is_discarded() => return Ok(vec![f64::NAN; z.len()]),
            evaluated => evaluated?,
        }
        Ok(self.equations.unknowns.iter().map(|unknown| self.bus.numbers[unknown.slot]).collect())
    }

    fn derivatives(&mut self) -> Result<Option<Vec<Vec<f64>>>, CallError> {
        if !self.equations.has_derivatives {
            return Ok(None);
        }
        let unknowns = &self.equations.unknowns;
        let mut columns = vec![vec![0.0; unknowns.len()]; unknowns.len()];
        for index in self.components {
            let Component { instance, inputs, outputs, .. } = &mut self.members[*index];
            let place = |slot: &usize| unknowns.iter().position(|unknown| unknown.slot == *slot);
            let own = outputs.reals.slots.iter().zip(&outputs.reals.references);
            let (rows, results): (Vec<usize>, Vec<Reference>) =
                own.filter_map(|(slot, reference)| Some((place(slot)?, *reference))).unzip();
            for (column, unknown) in columns.iter_mut().zip(unknowns) {
                let factor = |input: usize| {
                    let own = inputs.reals.conversions.iter().find(|(i, _)| *i == input);
                    own.map_or(1.0, |(_, conversion)| conversion.factor)
                };
                let read = inputs.reals.slots.iter().zip(&inputs.reals.references).enumerate();
                let (knowns, seed): (Vec<Reference>, Vec<f64>) = read
                    .filter(|(_, (slot, _))| **slot == unknown.slot)
                    .map(|(input, (_, reference))| (*reference, factor(input)))
                    .unzip();
                if knowns.is_empty() {
                    continue;
                }
                let mut found = vec![0.0; rows.len()];
                match instance.get_directional_derivative(&results, &knowns, &seed, &mut found) {
                    Err(error) if error.is_discarded() => return Ok(None),
                    evaluated => evaluated?,
                }
                for (row, value) in rows.iter().zip(found) {
                    column[*row] = value;
                }
            }
        }
        Ok(Some(columns))
    }
}
