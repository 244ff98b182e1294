//! Reads `terminalsAndIcons.xml` (FMI 3.0.2, section 2.4.9).

use crate::xml::{self, Element, XmlError};
use std::collections::HashSet;

/// A terminal: variables that importers connect as a whole, such as the signals of a wheel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Terminal {
    /// Name, unique among the terminals at its level.
    pub name: String,
    /// Rule by which the members of two connected terminals are matched: `plug`, `bus`, `sequence`, `none`, or a
    /// reversed domain name.
    pub matching_rule: String,
    /// Kind that another standard or a tool defines.
    pub kind: Option<String>,
    /// Description.
    pub description: Option<String>,
    /// Variables, in the order of the file.
    pub members: Vec<TerminalMember>,
    /// Terminals within this one.
    pub terminals: Vec<Terminal>,
}

/// A variable of a terminal.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TerminalMember {
    /// Name of the variable in `modelDescription.xml`.
    pub variable: String,
    /// Name within the terminal, by which `plug` and `bus` match.
    pub name: Option<String>,
    /// `signal`, `inflow`, `outflow`, or a reversed domain name; `inStream` or `outStream` for a transported quantity.
    pub kind: String,
}

impl Terminal {
    /// Parses the text of a `terminalsAndIcons.xml`. Fails if the XML is not well-formed or hostile, an attribute is
    /// missing, or two terminals at one level have the same name. The error contains line and column.
    pub fn parse_all(text: &str) -> Result<Vec<Self>, XmlError> {
        let root = xml::parse(text)?;
        root.child("Terminals").map_or(Ok(Vec::new()), Self::children)
    }

    fn children(of: &Element) -> Result<Vec<Self>, XmlError> {
        let mut names = HashSet::new();
        let elements = of.children.iter().filter(|child| child.name == "Terminal");
        let read = |element: &Element| {
            let name = element.required("name")?.to_owned();
            if !names.insert(name.clone()) {
                return Err(element.place.error(format!("terminal `{name}` is declared twice")));
            }
            let text = |name| element.attribute(name).map(str::to_owned);
            let members = element.children.iter().map(members).collect::<Result<Vec<_>, _>>()?;
            Ok(Self {
                name,
                matching_rule: element.required("matchingRule")?.to_owned(),
                kind: text("terminalKind"),
                description: text("description"),
                members: members.concat(),
                terminals: Self::children(element)?,
            })
        };
        elements.map(read).collect()
    }
}

/// The members in an element of a terminal; empty for other elements.
fn members(element: &Element) -> Result<Vec<TerminalMember>, XmlError> {
    let member = |variable: &str, name: &str, kind: &str| {
        let (variable, name) = (element.required(variable)?.to_owned(), element.attribute(name).map(str::to_owned));
        Ok(TerminalMember { variable, name, kind: kind.to_owned() })
    };
    Ok(match element.name.as_str() {
        "TerminalMemberVariable" => vec![member("variableName", "memberName", element.required("variableKind")?)?],
        "TerminalStreamMemberVariable" => vec![
            member("inStreamVariableName", "inStreamMemberName", "inStream")?,
            member("outStreamVariableName", "outStreamMemberName", "outStream")?,
        ],
        _ => Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: the elements and attributes of the schema fmi3Terminal.xsd.
    #[test]
    fn terminals_are_read_with_nested_ones() {
        let text = r#"<?xml version="1.0" encoding="UTF-8"?>
<fmiTerminalsAndIcons fmiVersion="3.0">
  <GraphicalRepresentation/>
  <Terminals>
    <Terminal name="port" matchingRule="plug" terminalKind="org.example.fluid" description="Port">
      <TerminalMemberVariable variableName="m" memberName="flow" variableKind="inflow"/>
      <TerminalStreamMemberVariable inStreamMemberName="hi" outStreamMemberName="ho" inStreamVariableName="h_in" outStreamVariableName="h_out"/>
      <Terminal name="port" matchingRule="sequence">
        <TerminalMemberVariable variableName="p" variableKind="signal"/>
      </Terminal>
    </Terminal>
    <Terminal name="other" matchingRule="none"/>
  </Terminals>
</fmiTerminalsAndIcons>"#;
        let member = |variable: &str, name: Option<&str>, kind: &str| TerminalMember {
            variable: variable.to_owned(),
            name: name.map(str::to_owned),
            kind: kind.to_owned(),
        };
        let all = Terminal::parse_all(text).unwrap();
        let [port, other] = &all[..] else { panic!("{all:?}") };
        assert_eq!(
            (&*port.name, &*port.matching_rule, port.kind.as_deref()),
            ("port", "plug", Some("org.example.fluid"))
        );
        assert_eq!(port.description.as_deref(), Some("Port"));
        let streams = [member("h_in", Some("hi"), "inStream"), member("h_out", Some("ho"), "outStream")];
        assert_eq!(port.members, [&[member("m", Some("flow"), "inflow")][..], &streams].concat());
        let [inner] = &port.terminals[..] else { panic!("{port:?}") };
        assert_eq!((&*inner.name, &*inner.matching_rule), ("port", "sequence"));
        assert_eq!(inner.members, [member("p", None, "signal")]);
        assert!(other.members.is_empty() && other.terminals.is_empty());
        for (old, new, message) in [
            ("\"other\"", "\"port\"", "terminal `port` is declared twice"),
            (" variableKind=\"inflow\"", "", "variableKind"),
            (" outStreamVariableName=\"h_out\"", "", "outStreamVariableName"),
            ("</Terminals>", "", "Terminals"),
        ] {
            let error = Terminal::parse_all(&text.replace(old, new)).unwrap_err().to_string();
            assert!(error.contains(message), "{message}: {error}");
        }
        assert_eq!(Terminal::parse_all("<fmiTerminalsAndIcons/>").unwrap(), []);
    }
}
