//! Structure of the equations: dependencies and relations.

use std::path::Path;

use super::Format;
use crate::calls::Version;
use crate::combinations::{MOST_COMBINATIONS, MOST_VALUES, are_few, combinations};
use crate::expression::Expression;
use crate::number::Number as _;
use crate::runner::{Context, Kind as ModelKind, Model};
use crate::scalar::DependencySet;
use crate::store::{Counts, ValueStore};
use crate::variable::{Kind, Layout, Role, Variable};
use crate::variables::Parameters;

#[derive(Default)]
pub(super) struct Structure {
    /// Dependencies of the real outputs, then of the derivatives, on real inputs, states and time.
    dependencies: Vec<DependencySet>,
    /// Dependencies of the outputs, then of the derivatives, on inputs that are not real. An input is given by its
    /// position among these inputs.
    on_others: Vec<DependencySet>,
    /// True if outputs that are not real may depend on real variables.
    is_inspected: bool,
    /// Number of relations; the maximum over the combinations of values.
    pub(super) relations: usize,
    /// Reasons why the structure lists too many dependencies, each with the remedy.
    pub(super) notes: Vec<String>,
}

/// Finds dependencies and relations by evaluating the equations for [`combinations`] of the values of Booleans,
/// enumerations and bounded Integers, including Booleans and enumerations of the discrete state.
///
/// An unknown depends on a Boolean or Integer input if changing the input changes the unknown's expression. This is
/// tested with the start values of the real parameters and with other values, because the input may select between two
/// parameters with equal start values. Strings and Integers without limits have too many values to try. Parameters of
/// these types are ignored if only `load` and `derived` read them, because the results of these functions are constants
/// in the equations.
///
/// Variables that the version does not have keep their start values.
pub(super) fn structure<M: Model>(layout: &Layout, resources: &Path, version: Version) -> Result<Structure, String> {
    let start = ValueStore::start(layout);
    let mut values = start.clone();
    // The last known variable is the time.
    let known = layout.inputs.counts.reals + layout.states.counts.reals + 1;
    let unknown = layout.outputs.counts.reals + layout.states.counts.reals;
    let others: Vec<_> = other_inputs(layout).collect();
    let unknown_of_all_types =
        layout.variables.iter().filter(|v| matches!(v.role, Role::Output | Role::Derivative)).count();
    // Variables that equations may branch on, with their values.
    let mut branches: Vec<(bool, &Variable, Vec<u64>)> = Vec::new();
    let mut notes = Vec::new();
    let may_change = |v: &&Variable| matches!(v.role, Role::Parameter | Role::Input) && v.is_in(version);
    for variable in layout.variables.iter().filter(may_change) {
        match &variable.declaration.kind {
            Kind::Real(_) | Kind::Clock(_) => {}
            Kind::Integer { items, .. } if !items.is_empty() => {
                branches.push((true, variable, items.iter().map(|item| item.value.word()).collect()));
            }
            Kind::Integer { min, max, .. } if variable.has_limits() && max - min < MOST_VALUES as i128 => {
                branches.push((true, variable, (*min..=*max).map(|value| value as u64).collect()));
            }
            Kind::Boolean { .. } => branches.push((false, variable, vec![0, 1])),
            Kind::Float32(_) | Kind::Integer { .. } | Kind::String { .. } | Kind::Binary { .. } => {
                notes.extend(too_many_values::<M>(variable))
            }
        }
    }
    let modes = M::modes();
    let sizes: Vec<_> = branches.iter().map(|(_, _, options)| options.len()).chain(modes.sizes()).collect();
    if !are_few(&sizes) {
        let of_state =
            (sizes.len() > branches.len()).then(|| "Booleans and enumerations of the discrete state".to_owned());
        let names = branches.iter().map(|(_, variable, _)| format!("`{}`", variable.declaration.name));
        let names: Vec<_> = names.chain(of_state).collect();
        notes.push(format!("{} have more than {MOST_COMBINATIONS} combinations of values", names.join(", ")));
    }
    let is_open = !notes.is_empty();
    let nothing = DependencySet::default();
    let mut union = vec![if is_open { DependencySet::all(known) } else { nothing.clone() }; unknown];
    let mut on_others = vec![if is_open { DependencySet::all(others.len()) } else { nothing }; unknown_of_all_types];
    let mut is_inspected = is_open;
    let mut relations = 0;
    let mut failure = None;
    let mut has_derived = false;
    // The expressions for each combination.
    let mut expressions: Vec<Vec<Expression>> = Vec::new();
    let begin = |values: &mut ValueStore, from: &ValueStore, choice: &[Option<usize>]| {
        values.clone_from(from);
        let (choice, mode) = choice.split_at(branches.len());
        for ((is_integer, variable, options), number) in branches.iter().zip(choice) {
            let Some(number) = *number else { continue };
            let value = options[number];
            if *is_integer {
                values.words[variable.index] = value;
            } else {
                values.booleans[variable.index] = value != 0;
            }
        }
        values.update_lengths(layout);
        let p = M::parameters(values);
        let derived = M::load(&p, resources)?;
        let mut initial = values.clone();
        let ctx = Context { p: &p, derived: &derived, layout, time: 0.0 };
        M::initialize(ctx, &mut initial);
        let run = M::init(ctx, resources, &initial)?;
        let run = M::with_mode(run, &modes, mode).ok_or("values of the discrete state exclude each other")?;
        Ok::<_, String>((p, derived, run))
    };
    let choices = combinations(&sizes);
    for choice in &choices {
        let mut found = Vec::new();
        match begin(&mut values, &start, choice) {
            Ok((p, derived, run)) => {
                has_derived = true;
                let ctx = Context { p: &p, derived: &derived, layout, time: 0.0 };
                relations = relations.max(M::count_relations(ctx, &run, &values));
                if !is_open {
                    match M::dependencies(ctx, &run, &values) {
                        Some(sets) => union.iter_mut().enumerate().for_each(|(i, sum)| sum.extend(sets.line(i))),
                        None => union.fill(DependencySet::all(known)),
                    }
                    let (all, is_read) = M::expressions(ctx, &run, &values);
                    is_inspected |= is_read;
                    found = all;
                }
            }
            // If the derived parameters cannot be computed for a combination, it cannot be simulated and adds no
            // dependencies.
            Err(message) => failure = failure.or(Some(message)),
        }
        expressions.push(found);
    }
    if is_inspected && !is_open {
        notes.push("the equations read the value of a number (with `value()` or a comparison)".to_owned());
        on_others.fill(DependencySet::all(others.len()));
    } else if !is_open {
        let mut find = |expressions: &[Vec<Expression>]| {
            let mut stride = 1;
            for ((_, variable, _), &size) in branches.iter().zip(&sizes) {
                if let Some(number) = others.iter().position(|other| other.reference == variable.reference) {
                    influences(&expressions[1..], stride, size, |unknown| on_others[unknown].extend(&[number as u32]));
                }
                stride *= size;
            }
        };
        find(&expressions);
        if M::KIND == ModelKind::Continuous && !others.is_empty() {
            let moved = with_other_parameters(layout, &start);
            let mut is_whole = true;
            for (choice, found) in choices.iter().zip(&mut expressions) {
                match begin(&mut values, &moved, choice) {
                    Ok((p, derived, run)) => {
                        let ctx = Context { p: &p, derived: &derived, layout, time: 0.0 };
                        *found = M::expressions(ctx, &run, &values).0;
                    }
                    Err(_) => is_whole &= std::mem::take(found).is_empty(),
                }
            }
            find(&expressions);
            if !is_whole {
                on_others.fill(DependencySet::all(others.len()));
            }
        }
    }
    match failure {
        Some(message) if !has_derived => Err(format!("the model rejects its start values: {message}")),
        _ => Ok(Structure { dependencies: union, on_others, is_inspected, relations, notes }),
    }
}

/// Values in which each real parameter differs from its start value, and from parameters with the same start value.
fn with_other_parameters(layout: &Layout, start: &ValueStore) -> ValueStore {
    let mut values = start.clone();
    for (number, index) in layout.parameters.reals().enumerate() {
        let value = start.reals[index];
        // Multiples of the golden ratio modulo 1 are all different.
        let share = 1e-3 * (1.0 + (number as f64 * 0.618_033_988_749_894_9).fract());
        let (up, down) = (value + share * (1.0 + value.abs()), value - share * (1.0 + value.abs()));
        if let Kind::Real(real) = &layout.real(index).declaration.kind {
            let range = real.range();
            values.reals[index] = if up <= *range.end() { up } else { down.max(*range.start()) };
        }
    }
    values
}

/// Calls `f` with the unknowns whose expressions differ between combinations that differ only in one variable. This
/// variable has `size` values; two combinations with consecutive values are `stride` apart in the list.
fn influences(expressions: &[Vec<Expression>], stride: usize, size: usize, mut f: impl FnMut(usize)) {
    for (number, first) in expressions.iter().enumerate().filter(|(number, _)| (number / stride).is_multiple_of(size)) {
        for other in (1..size).map(|value| &expressions[number + value * stride]) {
            first.iter().zip(other).enumerate().filter(|(_, (a, b))| a != b).for_each(|(unknown, _)| f(unknown));
        }
    }
}

fn other_inputs(layout: &Layout) -> impl Iterator<Item = &Variable> {
    let is_other = |v: &&Variable| v.role == Role::Input && !matches!(v.declaration.kind, Kind::Real(_));
    layout.variables.iter().filter(is_other)
}

/// Returns a note if the equations may read a variable with too many values to try (a Float32, String or Binary, or an
/// Integer without limits), which therefore adds too many dependencies.
fn too_many_values<M: Model>(variable: &Variable) -> Option<String> {
    let name = &variable.declaration.name;
    let is_integer = matches!(variable.declaration.kind, Kind::Integer { .. });
    let limits =
        if is_integer && variable.has_limits() { "give it `min` and `max` less than 64 apart, or " } else { "" };
    if variable.role == Role::Input {
        let instead = match variable.declaration.kind {
            Kind::Float32(_) => "use the number type of the equations",
            Kind::String { .. } | Kind::Binary { .. } => "use an enumeration or a Boolean",
            _ => "use an enumeration",
        };
        return Some(format!("the equations may read the input `{name}`, which can have any value; {limits}{instead}"));
    }
    let field = field_of::<M::Parameters>(variable);
    match M::EQUATIONS_READ {
        Some(read) if field.is_some_and(|field| !read.contains(&field)) => None,
        Some(_) => Some(format!(
            "the equations read the parameter `{name}`, which can have any value; {limits}read it in `derived` or `load` \
             and store in the derived parameters what the equations need"
        )),
        None => Some(format!(
            "the equations pass on `self`, and may thereby read the parameter `{name}`, which can have any value; {limits}\
             pass on only the fields that are needed"
        )),
    }
}

fn field_of<P: Parameters>(variable: &Variable) -> Option<&'static str> {
    let kind = &variable.declaration.kind;
    let mut end = Counts::ZERO;
    P::FIELDS
        .iter()
        .find(|(_, counts)| {
            end = end.plus(*counts);
            variable.index < kind.of(end)
        })
        .map(|(name, _)| *name)
}

/// The dependencies for the functions of FMI 3.0. The line of a value reference lists the references on which the variable
/// depends, as numbers and ranges; after a semicolon, it lists those at the start, where `p` stands for all parameters.
/// Without a semicolon, those at the start are all parameters and the same references. The line of a variable of another
/// version is empty.
pub(super) fn table(layout: &Layout, unknowns: &Unknowns<'_>, format: Format) -> String {
    let Unknowns { outputs, derivatives, clocked, initial } = unknowns;
    let indicators = if format.interfaces.model_exchange { layout.indicators.total() } else { 0 };
    let shown = || layout.variables.iter().filter(|variable| variable.is_in(format.version));
    let mut parameters: Vec<u32> = shown().filter(|v| v.role == Role::Parameter).map(|v| v.reference).collect();
    parameters.sort_unstable();
    let mut lines = vec![[const { Vec::new() }; 2]; layout.end as usize + 1];
    for (at_start, unknown) in
        outputs.iter().chain(derivatives).chain(clocked).map(|u| (0, u)).chain(initial.iter().map(|u| (1, u)))
    {
        let time = unknown.on_time.then_some(layout.end);
        lines[unknown.variable.reference as usize][at_start] =
            unknown.dependencies.iter().map(|known| known.reference).chain(time).collect();
    }
    // An event indicator may depend on everything.
    let known = shown().filter(|v| matches!(v.role, Role::Input | Role::State)).map(|v| v.reference);
    let known: Vec<_> = known.chain([layout.end]).collect();
    lines.extend(std::iter::repeat_n([known.clone(), [parameters.clone(), known].concat()], indicators));
    let text = |mut references: Vec<u32>| {
        references.sort_unstable();
        references.dedup();
        let has_parameters = !parameters.is_empty() && parameters.iter().all(|p| references.binary_search(p).is_ok());
        references.retain(|reference| !(has_parameters && parameters.binary_search(reference).is_ok()));
        let ranges = references.chunk_by(|one, next| one + 1 == *next).map(|range| match range {
            [one] => one.to_string(),
            [first, .., last] => format!("{first}-{last}"),
            [] => unreachable!("a chunk is not empty"),
        });
        has_parameters.then(|| "p".to_owned()).into_iter().chain(ranges).collect::<Vec<_>>().join(" ")
    };
    let line = |(reference, line): (u32, [Vec<u32>; 2])| {
        let is_shown = layout.by_reference(reference).map_or(reference >= layout.end, |v| v.is_in(format.version));
        if !is_shown {
            return String::new();
        }
        let [after_start, start] = line.map(text);
        let is_short = !after_start.is_empty() && start == format!("p {after_start}");
        if is_short { after_start } else { format!("{after_start};{start}") }
    };
    (0..).zip(lines).map(line).collect::<Vec<_>>().join("\n")
}

pub(super) struct Unknown<'a> {
    pub(super) variable: &'a Variable,
    /// The variables on which the unknown depends, ordered as in the model description.
    pub(super) dependencies: Vec<&'a Variable>,
    /// True if the unknown depends on the time.
    pub(super) on_time: bool,
}

pub(super) struct Unknowns<'a> {
    pub(super) outputs: Vec<Unknown<'a>>,
    pub(super) derivatives: Vec<Unknown<'a>>,
    pub(super) clocked: Vec<Unknown<'a>>,
    pub(super) initial: Vec<Unknown<'a>>,
}

impl<'a> Unknowns<'a> {
    /// Without the variables that a version does not have.
    pub(super) fn in_version(mut self, version: Version) -> Self {
        for unknowns in [&mut self.outputs, &mut self.derivatives, &mut self.clocked, &mut self.initial] {
            unknowns.retain(|unknown| unknown.variable.is_in(version));
            unknowns.iter_mut().for_each(|unknown| unknown.dependencies.retain(|known| known.is_in(version)));
        }
        self
    }

    pub(super) fn of<M: Model>(layout: &'a Layout, structure: &Structure) -> Self {
        let with_role = |role: Role| layout.variables.iter().filter(move |variable| variable.role == role);
        let is_real = |variable: &&Variable| matches!(variable.declaration.kind, Kind::Real(_));
        // Known variables, ordered by their numbers in the dependency sets.
        let known: Vec<_> = with_role(Role::Input).filter(is_real).chain(with_role(Role::State)).collect();
        let others: Vec<_> = other_inputs(layout).collect();
        // The position of each output and derivative in `on_others`, by its index in the model structure.
        let mut numbers = vec![0; layout.variables.len() + 1];
        let unknowns = layout.variables.iter().filter(|v| matches!(v.role, Role::Output | Role::Derivative));
        unknowns.enumerate().for_each(|(number, v)| numbers[layout.structure_index(v.reference)] = number);
        let sorted = |mut variables: Vec<&'a Variable>| {
            variables.sort_by_key(|variable| layout.structure_index(variable.reference));
            variables
        };
        let any = DependencySet::all(if structure.is_inspected { known.len() + 1 } else { 0 });
        let depends = |variable: &'a Variable| -> Unknown<'a> {
            let any = &any;
            let set = match (variable.role, M::KIND) {
                // The parts of the active clocks may read every input and state.
                (Role::Output | Role::Clocked, _) if M::HAS_CLOCKS => {
                    let known = with_role(Role::Input).chain(with_role(Role::State)).chain(with_role(Role::Previous));
                    let dependencies = known.chain(layout.clocks_of(variable)).collect();
                    return Unknown { variable, dependencies, on_time: true };
                }
                (Role::Output, ModelKind::Continuous) if is_real(&variable) => {
                    &structure.dependencies[variable.index - layout.outputs.at.reals]
                }
                (Role::Output, ModelKind::Continuous) => any,
                (Role::Derivative, _) => {
                    let index = layout.outputs.counts.reals + variable.index - layout.derivatives.at.reals;
                    &structure.dependencies[index]
                }
                (Role::State, _) => return Unknown { variable, dependencies: vec![variable], on_time: false },
                // Discrete-time and stateful models hold their outputs between steps, so these have no dependencies.
                _ => return Unknown { variable, dependencies: Vec::new(), on_time: false },
            };
            let number = numbers[layout.structure_index(variable.reference)];
            let in_set = |set: &DependencySet, of: &[&'a Variable]| -> Vec<&'a Variable> {
                set.iter().filter_map(|i| of.get(i).copied()).collect()
            };
            let mut all = in_set(set, &known);
            all.extend(in_set(&structure.on_others[number], &others));
            Unknown { variable, dependencies: sorted(all), on_time: set.contains(known.len()) }
        };
        let is_output = |v: &&Variable| v.role == Role::Output || (v.role == Role::State && !v.declaration.local);
        // At the start, unknowns may also depend on any parameter. Outputs of a source depend only on the parameters
        // that the source declares.
        let can_follow = |v: &Variable, parameter: &Variable| match (v.role, M::SOURCE) {
            (Role::Output, Some(influence)) => influence(&v.declaration.name, &parameter.declaration.name),
            _ => true,
        };
        let is_initial = |v: &&Variable| match v.role {
            _ if v.declaration.details.constant => false,
            Role::Calculated | Role::Derivative => true,
            Role::State => v.declaration.calculated,
            // The first tick of its clock initializes a clocked output.
            Role::Output => M::CALCULATES_OUTPUTS && v.declaration.details.clocks.is_empty(),
            _ => false,
        };
        let initial = |variable: &'a Variable| {
            let parameters = with_role(Role::Parameter).filter(|parameter| can_follow(variable, parameter));
            // A calculated state is not known at the start, but follows from the parameters.
            let known = depends(variable);
            let others = known.dependencies.into_iter().filter(|other| !other.declaration.calculated);
            let is_followed = |input: &&Variable| {
                M::SOURCE.is_some() && M::FOLLOWS(&variable.declaration.name, &input.declaration.name)
            };
            let followed = with_role(Role::Input).filter(|input| variable.role == Role::Output && is_followed(input));
            Unknown {
                variable,
                dependencies: parameters.chain(followed).chain(others).collect(),
                on_time: known.on_time,
            }
        };
        Self {
            outputs: layout.variables.iter().filter(is_output).map(depends).collect(),
            derivatives: with_role(Role::Derivative).map(depends).collect(),
            clocked: with_role(Role::Clocked).map(depends).collect(),
            initial: sorted(layout.variables.iter().filter(is_initial).collect()).into_iter().map(initial).collect(),
        }
    }
}
