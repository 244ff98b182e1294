//! terminalsAndIcons.xml of FMI 3.0.

use std::fmt::Display;

use super::Format;
use super::fmi3::variables;
use super::xml::{Attributes, Written, Xml, borrowed, document, element, empty};
use crate::variable::{self, Layout, Role, Variable};

/// A terminal with its variables.
pub(super) struct Terminal<'a> {
    name: &'a str,
    rule: &'a str,
    description: String,
    /// The names within the terminal and in the model description.
    members: Vec<(&'a str, &'a str)>,
    inner: Vec<Terminal<'a>>,
}

impl<'a> Terminal<'a> {
    /// The terminal with a name; it is added if it is missing.
    fn of<'t>(
        all: &'t mut Vec<Self>,
        name: &'a str,
        rule: &'a str,
        description: impl FnOnce() -> String,
    ) -> &'t mut Self {
        let at = all.iter().position(|terminal| terminal.name == name).unwrap_or(all.len());
        if at == all.len() {
            all.push(Self { name, rule, description: description(), members: Vec::new(), inner: Vec::new() });
        }
        &mut all[at]
    }

    /// Adds a variable to the last terminal in `path`.
    fn add(all: &mut Vec<Self>, path: &'a [variable::Terminal], variable: &'a str) -> Result<(), String> {
        let Some((outer, rest)) = path.split_first() else { return Ok(()) };
        let name = outer.name;
        let terminal = Self::of(all, name, outer.rule, || outer.description.to_owned());
        if terminal.rule != outer.rule {
            return Err(format!("the terminal '{name}' has the rules `{}` and `{}`", terminal.rule, outer.rule));
        }
        if !rest.is_empty() {
            return Self::add(&mut terminal.inner, rest, variable);
        }
        let member = &variable[outer.member..];
        if let Some((_, other)) = terminal.members.iter().find(|(known, _)| *known == member) {
            return Err(format!(
                "the terminal '{name}' has two members '{member}', the variables '{other}' and '{variable}': give one of \
                 them another name, or declare two terminals"
            ));
        }
        terminal.members.push((member, variable));
        Ok(())
    }

    fn write(&self, xml: &mut Xml) -> Written {
        let mut attributes: Attributes = vec![("name", self.name.to_owned()), ("matchingRule", self.rule.to_owned())];
        attributes.extend((!self.description.is_empty()).then(|| ("description", self.description.clone())));
        element(xml, "Terminal", &borrowed(&attributes), |xml| {
            self.members.iter().try_for_each(|(member, variable)| {
                let attributes: [(&str, &dyn Display); 3] =
                    [("variableName", variable), ("memberName", member), ("variableKind", &"signal")];
                empty(xml, "TerminalMemberVariable", &attributes)
            })?;
            self.inner.iter().try_for_each(|terminal| terminal.write(xml))
        })
    }
}

/// The terminals of named elements, then those of nested structs. Fails for the first contradiction in their
/// declarations.
pub(super) fn terminals(layout: &Layout, format: Format) -> Result<Vec<Terminal<'_>>, String> {
    // In the order of their first variables.
    let (mut elements, mut declared) = (Vec::new(), Vec::new());
    let is_signal = |variable: &&Variable| match variable.role {
        Role::Input | Role::Output => true,
        Role::State => !variable.declaration.local,
        _ => false,
    };
    for variable in variables(layout, format).filter(is_signal) {
        let declaration = &variable.declaration;
        let mut name = &declaration.name;
        match &declaration.array {
            Some(array) if array.dimensions.len() == 1 && !array.element.is_empty() => {
                let description = || format!("Signals of the element {}", array.element);
                let terminal = Terminal::of(&mut elements, &array.element, "bus", description);
                terminal.members.push((&array.name, name));
            }
            Some(array) if format.arrays && layout.array_of(variable).is_some() => name = &array.name,
            _ => {}
        }
        Terminal::add(&mut declared, &declaration.terminals, name)?;
    }
    if let Some(Terminal { name, .. }) = declared.iter().find(|one| elements.iter().any(|other| other.name == one.name))
    {
        return Err(format!(
            "the terminal '{name}' has the name of an element of an array, which has a terminal of its own: choose \
             another name"
        ));
    }
    elements.append(&mut declared);
    Ok(elements)
}

/// Length of each side of the icon in the coordinates of terminalsAndIcons.xml.
const SIDE: &str = "100.0";

pub(super) fn write(layout: &Layout, format: Format) -> std::io::Result<Vec<u8>> {
    let terminals = terminals(layout, format).unwrap_or_default();
    document("fmiTerminalsAndIcons", &vec![("fmiVersion", "3.0".to_owned())], |xml| {
        // The packer adds an icon to every FMU.
        element(xml, "GraphicalRepresentation", &[], |xml| {
            let system: [(&str, &dyn Display); 5] =
                [("x1", &"0.0"), ("y1", &"0.0"), ("x2", &SIDE), ("y2", &SIDE), ("suggestedScalingFactorTo_mm", &"0.1")];
            empty(xml, "CoordinateSystem", &system)?;
            empty(xml, "Icon", &system[..4])
        })?;
        if terminals.is_empty() {
            return Ok(());
        }
        element(xml, "Terminals", &[], |xml| terminals.iter().try_for_each(|terminal| terminal.write(xml)))
    })
}
