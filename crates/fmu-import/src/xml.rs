//! A small element tree for untrusted XML: attributes and structure, no text.
//!
//! Model descriptions and parameter sets contain all information in attributes, so text is skipped. Document type
//! declarations are rejected, which prevents entity expansion. Size, depth, and the numbers of elements and attributes
//! are limited, so that memory and time are at most proportional to the size of the file.

pub mod write;

use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};

/// Maximum size of a document, bytes. Real descriptions are smaller than a tenth of this.
pub const MAX_BYTES: usize = 64 << 20;
/// Maximum depth of nesting. The FMI schema needs 6; annotations from tools may need more.
const MAX_DEPTH: usize = 100;
/// Maximum number of elements. An element without attributes uses 4 bytes in the file and 130 bytes in memory.
const MAX_ELEMENTS: usize = 2_000_000;
/// Maximum number of attributes of an element. The FMI schema has at most 17; the check for duplicates is quadratic.
const MAX_ATTRIBUTES: usize = 64;

/// A position in the document and the problem there.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {message}")]
pub struct XmlError {
    /// Line, from 1.
    pub line: usize,
    /// Column in bytes, from 1.
    pub column: usize,
    /// Description of the problem and of the violated rule.
    pub message: String,
}

/// Line and column, both from 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Line.
    pub line: usize,
    /// Column in bytes.
    pub column: usize,
}

impl Place {
    /// Returns an error at this place.
    pub fn error(self, message: impl Into<String>) -> XmlError {
        XmlError { line: self.line, column: self.column, message: message.into() }
    }
}

/// An element with its attributes and children in document order.
#[derive(Debug)]
pub struct Element {
    /// Name as written, with the namespace prefix if there is one.
    pub name: String,
    /// Place of its start.
    pub place: Place,
    attributes: Vec<(String, String)>,
    /// Child elements.
    pub children: Vec<Element>,
}

impl Element {
    /// Value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(n, _)| n == name).map(|(_, value)| value.as_str())
    }

    /// Names of all attributes.
    pub fn attribute_names(&self) -> impl Iterator<Item = &str> {
        self.attributes.iter().map(|(name, _)| name.as_str())
    }

    /// The elements with this name in the child `list`.
    pub fn listed<'a>(&'a self, list: &str, name: &'a str) -> impl Iterator<Item = &'a Element> {
        self.child(list).into_iter().flat_map(|list| &list.children).filter(move |child| child.name == name)
    }

    /// Value of a required attribute.
    pub fn required(&self, name: &str) -> Result<&str, XmlError> {
        self.attribute(name).ok_or_else(|| self.place.error(format!("<{}> lacks the attribute `{name}`", self.name)))
    }

    /// Parsed value of an attribute. The error contains `expected`, the kind of value.
    pub fn parsed<T: std::str::FromStr>(&self, name: &str, expected: &str) -> Result<Option<T>, XmlError> {
        self.attribute(name)
            .map(|text| {
                text.trim().parse().map_err(|_| {
                    self.place.error(format!("<{}> has {name}=\"{text}\", expected {expected}", self.name))
                })
            })
            .transpose()
    }

    /// A number; `None` without the attribute.
    pub fn real(&self, name: &str) -> Result<Option<f64>, XmlError> {
        self.parsed(name, "a number")
    }

    /// `true`, `1`, `false` or `0`; `None` without the attribute.
    pub fn boolean(&self, name: &str) -> Result<Option<bool>, XmlError> {
        match self.attribute(name).map(str::trim) {
            None => Ok(None),
            Some("true" | "1") => Ok(Some(true)),
            Some("false" | "0") => Ok(Some(false)),
            Some(text) => {
                Err(self.place.error(format!("<{}> has {name}=\"{text}\", expected true or false", self.name)))
            }
        }
    }

    /// The same tree without namespace prefixes in the names of the elements.
    #[must_use]
    pub fn without_prefixes(mut self) -> Self {
        if let Some((_, local)) = self.name.rsplit_once(':') {
            self.name = local.to_owned();
        }
        self.children = self.children.into_iter().map(Self::without_prefixes).collect();
        self
    }

    /// First child with this name.
    pub fn child(&self, name: &str) -> Option<&Element> {
        self.children.iter().find(|c| c.name == name)
    }
}

/// Converts byte offsets, in increasing order, to places.
struct Places<'a> {
    text: &'a str,
    offset: usize,
    line: usize,
    line_start: usize,
}

impl Places<'_> {
    fn at(&mut self, offset: usize) -> Place {
        let offset = offset.min(self.text.len());
        for (i, byte) in self.text.as_bytes()[self.offset.min(offset)..offset].iter().enumerate() {
            if *byte == b'\n' {
                self.line += 1;
                self.line_start = self.offset + i + 1;
            }
        }
        self.offset = self.offset.max(offset);
        Place { line: self.line, column: offset.saturating_sub(self.line_start) + 1 }
    }
}

/// The root element of a document.
pub fn parse(text: &str) -> Result<Element, XmlError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut places = Places { text, offset: 0, line: 1, line_start: 0 };
    if text.len() > MAX_BYTES {
        return Err(places.at(0).error(format!("the document has {} bytes, at most {MAX_BYTES} are read", text.len())));
    }
    let mut reader = Reader::from_str(text);
    // The open elements, outermost first.
    let mut open: Vec<Element> = Vec::new();
    let mut root = None;
    let mut elements = 0;
    loop {
        let place = places.at(usize::try_from(reader.buffer_position()).unwrap_or(usize::MAX));
        let event = reader.read_event().map_err(|error| place.error(error.to_string()))?;
        elements += usize::from(matches!(event, Event::Start(_) | Event::Empty(_)));
        if elements > MAX_ELEMENTS {
            return Err(place.error(format!("more than {MAX_ELEMENTS} elements")));
        }
        match event {
            Event::Start(start) => {
                if open.len() == MAX_DEPTH {
                    return Err(place.error(format!("nested deeper than {MAX_DEPTH} elements")));
                }
                open.push(element(&start, place)?);
            }
            Event::Empty(start) => close(element(&start, place)?, &mut open, &mut root)?,
            Event::End(_) => {
                if let Some(done) = open.pop() {
                    close(done, &mut open, &mut root)?;
                }
            }
            Event::DocType(_) => {
                return Err(place.error(
                    "a document type declaration is rejected: FMI and SSP need none, and it can expand entities",
                ));
            }
            Event::Eof => break,
            Event::Text(_)
            | Event::CData(_)
            | Event::Comment(_)
            | Event::Decl(_)
            | Event::PI(_)
            | Event::GeneralRef(_) => (),
        }
    }
    let end = places.at(text.len());
    if let Some(element) = open.last() {
        return Err(end.error(format!(
            "the document ends inside <{}>, which starts in line {}",
            element.name, element.place.line
        )));
    }
    root.ok_or_else(|| end.error("the document has no element"))
}

/// Adds a complete element to its parent, or makes it the root.
fn close(done: Element, open: &mut [Element], root: &mut Option<Element>) -> Result<(), XmlError> {
    match open.last_mut() {
        Some(parent) => parent.children.push(done),
        None if root.is_some() => {
            return Err(done.place.error(format!("<{}> is a second root element", done.name)));
        }
        None => *root = Some(done),
    }
    Ok(())
}

fn element(start: &BytesStart<'_>, place: Place) -> Result<Element, XmlError> {
    let name = start.name().as_ref().to_string();
    let mut attributes = Vec::new();
    for attribute in start.attributes() {
        let attribute = attribute.map_err(|error| place.error(format!("<{name}>: {error}")))?;
        if attributes.len() == MAX_ATTRIBUTES {
            return Err(place.error(format!("<{name}> has more than {MAX_ATTRIBUTES} attributes")));
        }
        let value = attribute
            .normalized_value(XmlVersion::Explicit1_0)
            .map_err(|error| place.error(format!("<{name}>: {error}")))?;
        attributes.push((attribute.key.as_ref().to_string(), value.into_owned()));
    }
    Ok(Element { name, place, attributes, children: Vec::new() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_attributes_and_places() {
        let root =
            parse("\u{feff}<?xml version=\"1.0\"?>\n<a x='1 &lt; 2'>\n  <!-- c -->\n  <b y=\"&#228;\"/>text\n</a>")
                .unwrap();
        assert_eq!(root.attribute("x"), Some("1 < 2"));
        let b = root.child("b").unwrap();
        assert_eq!(b.attribute("y"), Some("ä"));
        assert_eq!((b.place.line, b.place.column), (4, 3));
    }

    #[test]
    fn hostile_documents_are_rejected_with_a_place() {
        let deep = "<a>".repeat(200);
        let many = format!("<a>{}</a>", "<b/>".repeat(MAX_ELEMENTS));
        let wide = format!("<a {}/>", (0..100).map(|i| format!("a{i}='' ")).collect::<String>());
        for (text, expected) in [
            ("<!DOCTYPE a [<!ENTITY b \"c\">]><a x='&b;'/>", "document type"),
            ("<a x='&unknown;'/>", "unknown"),
            ("<a>\n<b></a>", "line 2"),
            ("<a><b/>", "ends inside <a>"),
            ("<a/><b/>", "second root"),
            ("<a x='1' x='2'/>", "duplicate"),
            ("<a x=1/>", "<a>"),
            ("", "no element"),
            ("</a>", "a"),
            (deep.as_str(), "nested deeper"),
            (many.as_str(), "more than 2000000 elements"),
            (wide.as_str(), "more than 64"),
        ] {
            let error = parse(text).expect_err(expected).to_string();
            assert!(error.contains(expected), "{expected}: {error}");
        }
    }
}
