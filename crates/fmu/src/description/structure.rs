//! What the equations say about themselves: dependencies and relations.

use std::path::Path;

use crate::combinations::{MOST_VALUES, are_few, combinations};
use crate::runner::{Kind as ModelKind, Model};
use crate::scalar::DependencySet;
use crate::store::ValueStore;
use crate::variable::{Kind, Layout, Role, Variable};

/// What the equations say about themselves.
#[derive(Default)]
pub(super) struct Structure {
    /// What each real output, then each derivative depends on.
    pub(super) dependencies: Vec<DependencySet>,
    /// The most relations.
    pub(super) relations: usize,
}

/// Dependencies and relations over the values of Booleans, enumerations and bounded Integers, see [`combinations`].
pub(super) fn structure<M: Model>(layout: &Layout, resources: &Path) -> Result<Structure, String> {
    let start = ValueStore::start(layout);
    let mut values = start.clone();
    // The last one is the time.
    let known = layout.inputs.counts.reals + layout.states.counts.reals + 1;
    let unknown = layout.outputs.counts.reals + layout.states.counts.reals;
    // Variables that equations may branch on, with their values.
    let mut branches: Vec<(bool, usize, Vec<i32>)> = Vec::new();
    let mut is_open = false;
    for variable in layout.variables.iter().filter(|v| matches!(v.role, Role::Parameter | Role::Input)) {
        match &variable.declaration.kind {
            Kind::Real(_) => {}
            Kind::Integer { items, .. } if !items.is_empty() => {
                branches.push((true, variable.index, items.iter().map(|item| item.value).collect()));
            }
            Kind::Integer { min, max, .. } if i64::from(*max) - i64::from(*min) < MOST_VALUES as i64 => {
                branches.push((true, variable.index, (*min..=*max).collect()));
            }
            Kind::Boolean { .. } => branches.push((false, variable.index, vec![0, 1])),
            // Too many values to try: anything may depend on them, and on everything else through them.
            Kind::Integer { .. } | Kind::String { .. } => is_open = true,
        }
    }
    let sizes: Vec<_> = branches.iter().map(|(_, _, options)| options.len()).collect();
    is_open |= !are_few(&sizes);
    let mut union = vec![DependencySet::default(); unknown];
    if is_open {
        union.iter_mut().for_each(|set| (0..known).for_each(|index| set.insert(index)));
    }
    let mut relations = 0;
    let mut failure = None;
    let mut has_derived = false;
    for choice in combinations(&sizes) {
        values.clone_from(&start);
        for ((is_integer, index, options), number) in branches.iter().zip(choice) {
            let Some(number) = number else { continue };
            let value = options[number];
            if *is_integer {
                values.integers[*index] = value;
            } else {
                values.booleans[*index] = value != 0;
            }
        }
        let p = values.parameters::<M>();
        let begun = M::load(&p, resources).and_then(|derived| {
            let mut values = values.clone();
            M::initialize(&p, &derived, layout, &mut values);
            let memory = M::begin(&p, &derived, resources, layout, &values, 0.0)?;
            Ok((derived, memory))
        });
        match begun {
            Ok((derived, memory)) => {
                has_derived = true;
                relations = relations.max(M::count_relations(&p, &derived, &memory, layout, &values));
                if !is_open {
                    let sets = M::dependencies(&p, &derived, &memory, layout, &values);
                    union.iter_mut().zip(sets).for_each(|(sum, set)| sum.extend(&set));
                }
            }
            // A combination without derived parameters cannot be simulated, so it adds nothing.
            Err(message) => failure = failure.or(Some(message)),
        }
    }
    match failure {
        Some(message) if !has_derived => Err(format!("the start values of the parameters do not work: {message}")),
        _ => Ok(Structure { dependencies: union, relations }),
    }
}

/// An unknown of the model structure with what it depends on.
pub(super) struct Unknown<'a> {
    pub(super) variable: &'a Variable,
    /// In the order of the model description.
    pub(super) dependencies: Vec<&'a Variable>,
    /// Whether it depends on the time.
    pub(super) on_time: bool,
}

/// The lists of the element ModelStructure.
pub(super) struct Unknowns<'a> {
    pub(super) outputs: Vec<Unknown<'a>>,
    pub(super) derivatives: Vec<Unknown<'a>>,
    pub(super) initial: Vec<Unknown<'a>>,
}

impl<'a> Unknowns<'a> {
    pub(super) fn of<M: Model>(layout: &'a Layout, structure: &[DependencySet]) -> Self {
        let with_role = |role: Role| layout.variables.iter().filter(move |variable| variable.role == role);
        let is_real = |variable: &&Variable| matches!(variable.declaration.kind, Kind::Real(_));
        // Known real variables in the order in which `DependencySet` numbers them; what depends on the others is not known.
        let known: Vec<_> = with_role(Role::Input).filter(is_real).chain(with_role(Role::State)).collect();
        let others: Vec<_> = with_role(Role::Input).filter(|variable| !is_real(variable)).collect();
        let sorted = |mut variables: Vec<&'a Variable>| {
            variables.sort_by_key(|variable| layout.structure_index(variable.reference));
            variables
        };
        let depends = |variable: &'a Variable| -> Unknown<'a> {
            let set = match (variable.role, M::KIND) {
                (Role::Output, ModelKind::Continuous) if is_real(&variable) => {
                    &structure[variable.index - layout.outputs.at.reals]
                }
                (Role::Output, ModelKind::Continuous) => {
                    let dependencies = sorted(known.iter().chain(&others).copied().collect());
                    return Unknown { variable, dependencies, on_time: true };
                }
                (Role::Derivative, _) => {
                    &structure[layout.outputs.counts.reals + variable.index - layout.derivatives.at.reals]
                }
                (Role::State, _) => return Unknown { variable, dependencies: vec![variable], on_time: false },
                // Outputs of other models are held.
                _ => return Unknown { variable, dependencies: Vec::new(), on_time: false },
            };
            let mut all: Vec<_> =
                known.iter().enumerate().filter(|&(i, _)| set.contains(i)).map(|(_, &variable)| variable).collect();
            all.extend(&others);
            Unknown { variable, dependencies: sorted(all), on_time: set.contains(known.len()) }
        };
        let is_output = |v: &&Variable| v.role == Role::Output || (v.role == Role::State && !v.declaration.local);
        // At the start everything may also depend on any parameter; calculated ones on the fixed parameters only, the
        // outputs of a source on those it names.
        let can_follow = |v: &Variable, parameter: &Variable| match (v.role, M::SOURCE) {
            (Role::Calculated | Role::State, _) => !parameter.declaration.tunable,
            (_, Some(influence)) => influence(&v.declaration.name, &parameter.declaration.name),
            _ => true,
        };
        let is_initial = |v: &&Variable| match v.role {
            Role::Calculated | Role::Derivative => true,
            Role::State => v.declaration.calculated,
            Role::Output => M::CALCULATES_OUTPUTS,
            _ => false,
        };
        let initial = |variable: &'a Variable| {
            let parameters = with_role(Role::Parameter).filter(|parameter| can_follow(variable, parameter));
            // A state that is calculated itself is unknown at the start; it follows from the parameters.
            let known = depends(variable);
            let others = known.dependencies.into_iter().filter(|other| !other.declaration.calculated);
            Unknown { variable, dependencies: parameters.chain(others).collect(), on_time: known.on_time }
        };
        Self {
            outputs: layout.variables.iter().filter(is_output).map(depends).collect(),
            derivatives: with_role(Role::Derivative).map(depends).collect(),
            initial: sorted(layout.variables.iter().filter(is_initial).collect()).into_iter().map(initial).collect(),
        }
    }
}
