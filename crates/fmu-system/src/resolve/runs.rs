//! Makes the runs, ordered by case, then point, then seed.

use super::system::{Column, Resolver, System, context};
use crate::{run, scenario};

impl Resolver<'_> {
    pub(super) fn runs(
        &mut self,
        systems: &[System<'_>],
        columns: &[Column],
        seeds: &[i32],
        simulation: &run::Simulation,
    ) -> Vec<run::Run> {
        let seed_of = self.scenario.seeds.as_ref().and_then(|s| self.component_and_name(&s.parameter));
        let points: Vec<Option<&scenario::Point>> =
            if self.scenario.points.is_empty() { vec![None] } else { self.scenario.points.iter().map(Some).collect() };
        let seeds: Vec<Option<i32>> =
            if seeds.is_empty() { vec![None] } else { seeds.iter().copied().map(Some).collect() };
        let mut runs = Vec::new();
        for system in systems {
            if let Some((component, ..)) = &seed_of
                && system.member(component).is_none()
            {
                self.problems.add(
                    system.case.name.span(),
                    format!("this case leaves out the component `{component}`, which takes the seeds"),
                );
                continue;
            }
            let wired = self.wired(system, columns, simulation);
            self.check_coupling(system, &wired, simulation);
            for point in &points {
                for seed in &seeds {
                    let mut run = wired.clone();
                    if let Some(point) = point {
                        run.id = format!("{}@{}", run.id, point.name.get_ref());
                        run.point = Some(point.name.get_ref().clone());
                    }
                    if let Some(seed) = seed {
                        run.id = format!("{}#{seed}", run.id);
                        run.seed = Some(*seed);
                    }
                    let members = system.order.iter().map(|m| &system.members[*m]);
                    for (component, member) in run.components.iter_mut().zip(members) {
                        let seed = match (&seed_of, seed) {
                            (Some((of, name, span)), Some(seed)) if *of == member.name() => {
                                Some((*name, span.clone(), *seed))
                            }
                            _ => None,
                        };
                        self.problems.set_context(Some(context(system.case, Some(member.component))));
                        component.parameters = self.parameters(system.case, *point, member, seed);
                        component.list_arrays(&member.found.description);
                    }
                    runs.push(run);
                }
            }
        }
        self.problems.set_context(None);
        runs
    }
}
