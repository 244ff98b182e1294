//! Array elements as scalar variables, for masters that connect and record scalars.
//!
//! In FMI 3.0, an array has one value reference, and a call reads or writes all its elements. Here, each element gets
//! an unused value reference; [`Instance`](crate::loader::Instance) then calls the FMU for the entire array.

use super::{ModelDescription, Unknown, Value, Variable};
use crate::c_api::Reference;
use std::collections::HashSet;
use std::ops::Range;

/// Maximum number of array elements that become variables. It limits the memory; all further arrays stay arrays.
const MAX_ELEMENTS: usize = 20_000;
/// Maximum number of dependencies of an array that are listed element by element. If there are more, the elements
/// depend on all knowns.
const MAX_DEPENDENCIES: usize = 1_000_000;

/// An element of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct ArrayElement {
    /// Value reference of the array.
    pub array: Reference,
    /// Position in the array, row by row, from 0.
    pub index: usize,
}

impl ModelDescription {
    /// The elements of the array with this name, after [`Self::with_elements`]; empty if there is no such array.
    pub fn elements_of<'d>(&'d self, array: &'d str) -> impl DoubleEndedIterator<Item = &'d Variable> {
        let is_element = move |variable: &&Variable| {
            let rest = variable.element.and_then(|_| variable.name.strip_prefix(array));
            rest.is_some_and(|rest| rest.starts_with('[') && !rest[1..].contains('['))
        };
        self.variables.iter().filter(is_element)
    }

    /// The value references that the elements of each array get; `None` for a variable that stays as it is.
    pub(crate) fn element_references(&self) -> Vec<Option<Range<Reference>>> {
        let mut references = vec![None; self.variables.len()];
        if self.variables.iter().all(|variable| !variable.is_array()) {
            return references;
        }
        let mut counted = 0;
        let mut chosen = Vec::new();
        for (i, variable) in self.variables.iter().enumerate() {
            let is_chosen = variable.is_array()
                && variable.alias_of.is_none()
                && counted + variable.size <= MAX_ELEMENTS
                // An FMU may already have a variable with the name of an element.
                && !variable.elements().iter().any(|name| self.by_name.contains_key(name));
            if is_chosen {
                counted += variable.size;
                chosen.push(i);
            }
        }
        let clocks = self.clocks.iter().map(|clock| clock.reference);
        let mut next = gap(self.variables.iter().map(|variable| variable.reference).chain(clocks), counted);
        for i in chosen {
            let end = next + self.variables[i].size as Reference;
            references[i] = Some(next..end);
            next = end;
        }
        for (i, variable) in self.variables.iter().enumerate() {
            if let Some(of) = variable.alias_of {
                references[i] = references[of].clone();
            }
        }
        references
    }

    /// Replaces arrays with a variable for each element: `a[1]`, `a[2]`, …, or `a[1,1]`, `a[1,2]`, …, row by row.
    /// All further arrays stay arrays once 20,000 elements are variables. Also adds a Boolean for each output clock, which
    /// is true if the clock has ticked in the last step.
    #[must_use]
    pub fn with_elements(self) -> Self {
        let references = self.element_references();
        let signals = self.clocks.iter().filter_map(|clock| clock.signal.clone());
        let signals: Vec<Variable> = signals.collect();
        if references.iter().all(Option::is_none) && signals.is_empty() {
            return self;
        }
        // For each old variable, the indices of its new variables.
        let mut places: Vec<Range<usize>> = Vec::new();
        for (variable, references) in self.variables.iter().zip(&references) {
            let start = places.last().map_or(0, |place| place.end);
            places.push(start..start + if references.is_some() { variable.size } else { 1 });
        }
        let place = |old: usize, element: usize| match places[old].len() {
            1 => places[old].start,
            _ => places[old].start + element,
        };
        let mut variables = Vec::new();
        for (variable, references) in self.variables.iter().zip(&references) {
            let Some(references) = references else {
                let derivative_of = variable.derivative_of.map(|of| place(of, 0));
                let alias_of = variable.alias_of.map(|of| place(of, 0));
                let mut variable = Variable { derivative_of, alias_of, ..variable.clone() };
                for dimension in &mut variable.dimensions {
                    if let super::Dimension::Parameter(parameter) = dimension {
                        *parameter = place(*parameter, 0);
                    }
                }
                variables.push(variable);
                continue;
            };
            for (index, (name, reference)) in variable.elements().into_iter().zip(references.clone()).enumerate() {
                variables.push(Variable {
                    name,
                    reference,
                    dimensions: Vec::new(),
                    lengths: Vec::new(),
                    size: 1,
                    start: variable.starts.get(index).cloned(),
                    starts: Vec::<Value>::new(),
                    derivative_of: variable.derivative_of.map(|of| place(of, index)),
                    alias_of: variable.alias_of.map(|of| place(of, index)),
                    element: Some(ArrayElement { array: variable.reference, index }),
                    ..variable.clone()
                });
            }
        }
        variables.extend(signals);
        let unknowns = |list: &[Unknown]| list.iter().flat_map(|unknown| expanded(unknown, &places)).collect();
        Self {
            outputs: unknowns(&self.outputs),
            derivatives: unknowns(&self.derivatives),
            initial_unknowns: unknowns(&self.initial_unknowns),
            event_indicators: unknowns(&self.event_indicators),
            by_name: variables.iter().enumerate().map(|(i, variable)| (variable.name.clone(), i)).collect(),
            variables,
            ..self
        }
    }
}

/// Splits an unknown into one unknown per element. Each of these depends on all elements of the arrays on which the
/// original unknown depends.
fn expanded(unknown: &Unknown, places: &[Range<usize>]) -> Vec<Unknown> {
    let own = places[unknown.variable].clone();
    let length = |dependencies: &Vec<usize>| dependencies.iter().map(|i| places[*i].len()).sum::<usize>();
    let listed =
        unknown.dependencies.as_ref().filter(|list| length(list).saturating_mul(own.len()) <= MAX_DEPENDENCIES);
    let dependencies = listed.map(|list| list.iter().flat_map(|i| places[*i].clone()).collect::<Vec<usize>>());
    own.map(|variable| Unknown { variable, dependencies: dependencies.clone() }).collect()
}

/// The first of `count` consecutive unused numbers.
fn gap(used: impl Iterator<Item = Reference>, count: usize) -> Reference {
    let mut used: Vec<Reference> = used.collect::<HashSet<_>>().into_iter().collect();
    used.sort_unstable();
    let mut next: Reference = 0;
    for reference in used {
        if (reference - next) as usize >= count {
            break;
        }
        next = reference.saturating_add(1);
    }
    next
}

#[cfg(test)]
mod tests {
    use super::{ArrayElement, gap};
    use crate::description::{ModelDescription, Value};

    /// The order is row by row, as specified in FMI 3.0.2, section 2.2.7.1.
    #[test]
    fn elements_are_variables_of_their_own() {
        let (from, to) = (
            "start=\"1 2 3\"><Dimension start=\"3\"/>",
            "start=\"1 2 3 4 5 6\"><Dimension start=\"2\"/><Dimension start=\"3\"/>",
        );
        let text = include_str!("../../tests/data/decay3.xml").replacen(from, to, 1);
        let d = ModelDescription::parse(&text).unwrap();
        let e = d.clone().with_elements();
        let v = e.variable("v[2,1]").unwrap();
        assert_eq!((v.start.clone(), v.size, v.is_array()), (Some(Value::Real(4.0)), 1, false));
        assert_eq!(v.element, Some(ArrayElement { array: d.variable("v").unwrap().reference, index: 3 }));
        assert_eq!(e.variable("bits[2]").unwrap().start, Some(Value::Boolean(false)));
        assert!(e.variable("v").is_none());
        let names = e.elements_of("v").map(|element| element.name.as_str());
        assert_eq!(names.collect::<Vec<_>>(), ["v[1,1]", "v[1,2]", "v[1,3]", "v[2,1]", "v[2,2]", "v[2,3]"]);
        assert_eq!(e.elements_of("k").count(), 0);
        // No two variables share a reference, and the other variables keep theirs.
        let mut references: Vec<_> = e.variables.iter().map(|variable| variable.reference).collect();
        references.sort_unstable();
        references.dedup();
        assert_eq!(references.len(), d.variables.len() - 3 + 6 + 3 + 2);
        assert_eq!(e.variable("x").unwrap().reference, d.variable("x").unwrap().reference);
        // Each element of w depends on x and on all elements of v.
        let w = e.index("w[2]").unwrap();
        let unknown = e.outputs.iter().find(|unknown| unknown.variable == w).unwrap();
        let names = unknown.dependencies.as_ref().unwrap().iter().map(|i| e.variables[*i].name.as_str());
        assert_eq!(names.collect::<Vec<_>>(), ["x", "v[1,1]", "v[1,2]", "v[1,3]", "v[2,1]", "v[2,2]", "v[2,3]"]);
    }

    #[test]
    fn numbers_that_are_not_used() {
        assert_eq!(gap([0, 1, 5].into_iter(), 3), 2);
        assert_eq!(gap([0, 1, 5].into_iter(), 4), 6);
        assert_eq!(gap([7, u32::MAX].into_iter(), 7), 0);
        assert_eq!(gap([3, u32::MAX].into_iter(), 9), 4);
    }
}
