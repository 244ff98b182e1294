//! Reads the system in an SSP file (System Structure and Parameterization 1.0 and 2.0) as a scenario.
//!
//! The structure becomes the text of a scenario: nested systems are flattened, connections through connectors of systems
//! lead from output to input, and values of parameter sets are those of the components. SSP does not define the order of
//! the components within a step, so it is found automatically. A mistake that the resolver finds in the text is shown at
//! the element from which that part of the text stems.

mod text;

use crate::data::unit::{Declared, UnitMismatch};
use crate::export::STRUCTURE;
use crate::export::ssp::{FMU, PARAMETER_SET};
use crate::parameter::role;
use crate::problem::{Collector, Problems};
use crate::run::Linear;
use fmu_import::archive::{Archive, path_within};
use fmu_import::description::{Causality, DataType, ModelDescription, Unit, Value, word};
use fmu_import::parameter_set::{ParameterSet, units};
use fmu_import::temporary::Folder;
use fmu_import::terminal::escaped;
use fmu_import::xml::{self, Element, Place, XmlError};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io::Cursor;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Maximum number of components and systems.
const MAX_OWNERS: usize = 1000;
/// Maximum number of mistakes and warnings that are listed.
const MAX_LISTED: usize = 100;
/// Length of a line in bytes above which messages do not show it.
const MAX_LINE: usize = 10_000;

/// Options for reading an SSP file, and defaults for values that it does not contain.
#[derive(Debug, Clone, Default)]
pub struct Choice {
    /// Name of the structure; by default `SystemStructure`.
    pub variant: Option<String>,
    /// Stop time of a file without one, s.
    pub stop: Option<f64>,
    /// Communication step, s; by default that of an annotation, of the FMUs, or a thousandth of the time.
    pub step: Option<f64>,
}

/// A system as a scenario.
#[derive(Debug)]
pub struct Imported {
    /// Text of the scenario.
    pub text: String,
    /// Folder with the FMUs.
    pub folder: Folder,
    /// Warnings, each as `file:line:column: message`.
    pub warnings: Vec<String>,
}

/// A system as a part of a scenario.
pub(crate) struct System {
    pub(crate) text: String,
    /// Offsets in the text, each with the place of the element from which the text from there on stems.
    pub(crate) origins: Vec<(usize, Range<usize>)>,
    /// The FMUs.
    pub(crate) folder: Folder,
}

/// Returns true if the name of a file is that of an SSP file.
pub fn is_ssp(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ssp"))
}

/// Makes the system in an SSP file a scenario.
///
/// # Errors
/// The file is damaged or has something that a scenario cannot express.
pub fn import(file: &Path, choice: &Choice) -> Result<Imported, Problems> {
    let mut problems = Collector::new(file, "", "toml");
    let Some(System { text, folder, .. }) = read(file, 0..0, choice, &mut problems) else {
        return Err(problems.fail());
    };
    Ok(Imported { text: text::scenario(file, &text), folder, warnings: problems.take_warnings() })
}

/// The text of a scenario that includes an SSP file.
pub(crate) fn scenario(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    text::scenario(file, &format!("include = [{}]", text::quoted(&name)))
}

/// Reads the system in an SSP file that is named at `at`. `None`: mistakes were reported.
pub(crate) fn read(file: &Path, at: Range<usize>, choice: &Choice, problems: &mut Collector) -> Option<System> {
    let variant = choice.variant.as_deref().unwrap_or(STRUCTURE);
    let name = format!("{}.ssd", variant.strip_suffix(".ssd").unwrap_or(variant));
    let opened = open(file, &name).map_err(|message| problems.add(at, message));
    let (archive, text, folder) = opened.ok()?;
    let text = text.trim_start_matches('\u{feff}');
    let is_hidden = text.lines().any(|line| line.len() > MAX_LINE || matches!(escaped(line), Cow::Owned(_)));
    let mut reader = Reader {
        from: problems.add_source(&file.join(&name), if is_hidden { "" } else { text }, "xml"),
        problems,
        archive,
        text,
        is_hidden,
        lines: std::iter::once(0).chain(text.match_indices('\n').map(|(end, _)| end + 1)).collect(),
        folder,
        choice,
        fmus: BTreeMap::new(),
        units: Vec::new(),
        owners: Vec::new(),
        ids: BTreeSet::new(),
        listed: 0,
        is_refused: false,
    };
    let root = reader.take(xml::parse(text).map(Element::without_prefixes))?;
    let structure = reader.structure(&root);
    reader.take(structure)?;
    let (text, origins) = text::write(&mut reader, &root);
    (!reader.is_refused).then_some(System { text, origins, folder: reader.folder })
}

/// The archive, a structure in it, and a folder for the FMUs.
fn open(file: &Path, name: &str) -> Result<(Archive, String, Folder), String> {
    let mut archive = Archive::open(file).map_err(|error| error.to_string())?;
    let Some(text) = archive.text_of(name).map_err(|error| error.to_string())? else {
        let others: Vec<&str> =
            archive.names().iter().map(String::as_str).filter(|name| name.ends_with(".ssd")).collect();
        return Err(format!("{} has no {name}; it has {}", file.display(), others.join(", ")));
    };
    let folder = Folder::new().map_err(|error| format!("cannot create a temporary folder: {error}"))?;
    Ok((archive, text, folder))
}

/// An FMU of the archive.
#[derive(Clone)]
struct Fmu {
    stem: String,
    description: Arc<ModelDescription>,
}

/// A system or a component.
struct Owner<'e> {
    element: &'e Element,
    name: &'e str,
    /// Name in the scenario.
    id: String,
    children: Vec<usize>,
    /// The FMU of a component, unless it was rejected.
    fmu: Option<Fmu>,
    connectors: HashMap<&'e str, Causality>,
    /// Units of its connectors.
    units: HashMap<&'e str, &'e str>,
    /// Values of parameter sets, by variable or connector.
    values: HashMap<String, Bound<'e>>,
    /// Connections to its connectors.
    incoming: HashMap<&'e str, Edge<'e>>,
}

/// A value of a parameter set.
#[derive(Clone)]
struct Bound<'e> {
    value: Value,
    unit: Option<Declared>,
    element: &'e Element,
}

/// A connection from a connector.
#[derive(Clone, Copy)]
struct Edge<'e> {
    from: (usize, &'e str),
    linear: Linear,
    convert: bool,
    element: &'e Element,
}

struct Reader<'a, 'e> {
    problems: &'a mut Collector,
    archive: Archive,
    text: &'a str,
    /// Offset of its places.
    from: usize,
    /// Messages do not show the text: lines are too long, or control the terminal.
    is_hidden: bool,
    /// Offsets of the lines in the text.
    lines: Vec<usize>,
    folder: Folder,
    choice: &'a Choice,
    /// By path in the archive.
    fmus: BTreeMap<String, Result<Fmu, String>>,
    /// Units of measure that the file defines.
    units: Vec<Unit>,
    /// The first is the root system.
    owners: Vec<Owner<'e>>,
    /// Names of components.
    ids: BTreeSet<String>,
    /// Number of mistakes and warnings.
    listed: usize,
    is_refused: bool,
}

/// An end of a connection.
#[derive(Clone, Copy)]
struct End<'e> {
    at: (usize, &'e str),
    causality: Causality,
    /// Values come from there.
    writes: bool,
}

/// Returns true for what gets its value from outside.
fn is_inward(causality: Causality) -> bool {
    matches!(causality, Causality::Input | Causality::Parameter | Causality::StructuralParameter)
}

impl<'e> Reader<'_, 'e> {
    /// The place of the element that begins there.
    fn span(&self, place: Place) -> Range<usize> {
        let start =
            self.lines.get(place.line.saturating_sub(1)).map_or(0, |line| line + place.column.saturating_sub(1));
        let length = self.text.get(start..).and_then(|rest| rest.find('>')).map_or(1, |length| length + 1);
        if self.is_hidden { self.from..self.from } else { self.from + start..self.from + start + length }
    }

    /// The message, unless too many were listed.
    fn listed(&mut self, XmlError { line, column, message }: XmlError) -> Option<(Range<usize>, String)> {
        let place = Place { line, column };
        self.listed += 1;
        let message = if self.is_hidden { place.error(message).to_string() } else { message };
        let message = if self.listed == MAX_LISTED { "more mistakes or warnings follow".to_owned() } else { message };
        (self.listed <= MAX_LISTED).then(|| (self.span(place), message))
    }

    fn refuse(&mut self, error: XmlError) {
        self.is_refused = true;
        if let Some((span, message)) = self.listed(error) {
            self.problems.add(span, message);
        }
    }

    fn warn(&mut self, element: &Element, message: String) {
        if let Some((span, message)) = self.listed(element.place.error(message)) {
            self.problems.warn(span, message, None);
        }
    }

    /// The value; reports a mistake.
    fn take<T>(&mut self, result: Result<T, XmlError>) -> Option<T> {
        result.map_err(|error| self.refuse(error)).ok()
    }

    fn structure(&mut self, root: &'e Element) -> Result<(), XmlError> {
        let version = root.required("version")?;
        if root.name != "SystemStructureDescription" || !(version.starts_with("1.") || version.starts_with("2.")) {
            let message = "the root must be a SystemStructureDescription of version 1.0 or 2.0";
            return Err(root.place.error(format!("{message}, got {} of version {version}", root.name)));
        }
        let system = root.child("System").ok_or_else(|| root.place.error("the file has no System"))?;
        self.units = units(root)?;
        self.owner(system, "")?;
        match self.owners.iter().any(|owner| owner.element.name == "Component") {
            true => Ok(()),
            false => Err(system.place.error("the system has no components")),
        }
    }

    /// Adds a system with all that it contains, or a component.
    fn owner(&mut self, element: &'e Element, prefix: &str) -> Result<usize, XmlError> {
        let name = element.required("name")?;
        let at = self.owners.len();
        if at == MAX_OWNERS {
            return Err(element.place.error(format!("there are more than {MAX_OWNERS} components and systems")));
        }
        let is_system = element.name == "System";
        let mut id = if at == 0 { String::new() } else { text::snake_case(&format!("{prefix}{name}")) };
        if !is_system {
            id = text::unique(&id, &mut self.ids);
        }
        let fmu = if is_system { None } else { Some(self.component(element)) };
        let fmu = fmu.and_then(|fmu| self.take(fmu.map_err(|message| element.place.error(message))));
        self.owners.push(Owner {
            element,
            name,
            id: id.clone(),
            children: Vec::new(),
            fmu,
            connectors: HashMap::new(),
            units: HashMap::new(),
            values: HashMap::new(),
            incoming: HashMap::new(),
        });
        for connector in element.listed("Connectors", "Connector") {
            let checked = self.connector(at, connector);
            let Some((name, causality)) = self.take(checked) else { continue };
            let unit = connector.children.iter().find_map(|child| child.attribute("unit"));
            self.owners[at].connectors.insert(name, causality);
            self.owners[at].units.extend(unit.map(|unit| (name, unit)));
        }
        let prefix = if at == 0 { String::new() } else { id + "_" };
        let elements = element.child("Elements").map_or(&[][..], |elements| &elements.children);
        for child in elements.iter().filter(|child| child.name != "Annotations") {
            let added = match child.name.as_str() {
                "System" | "Component" => self.owner(child, &prefix),
                _ => Err(child.place.error("signal dictionaries are not supported; connect the components directly")),
            };
            if let Some(added) = self.take(added) {
                if self.child(at, self.owners[added].name).is_some() {
                    let message = format!("a second element has the name `{}`", self.owners[added].name);
                    self.refuse(child.place.error(message));
                }
                self.owners[at].children.push(added);
            }
        }
        for connection in element.listed("Connections", "Connection") {
            let added = self.connection(at, connection);
            self.take(added);
        }
        // Values of a system replace those of its elements, and later values earlier ones.
        for binding in element.listed("ParameterBindings", "ParameterBinding") {
            let bound = self.binding(at, binding);
            self.take(bound);
        }
        Ok(at)
    }

    fn child(&self, system: usize, name: &str) -> Option<usize> {
        self.owners[system].children.iter().copied().find(|child| self.owners[*child].name == name)
    }

    fn component(&mut self, element: &Element) -> Result<Fmu, String> {
        let kind = element.attribute("type").unwrap_or(FMU);
        let source = element.attribute("source").filter(|_| kind == FMU);
        let source =
            source.ok_or_else(|| format!("a component must be an FMU (`type` {FMU}) with a `source`, got {kind}"))?;
        let path = path(source)?;
        if !self.fmus.contains_key(&path) {
            let fmu = self.fmu(&path);
            self.fmus.insert(path.clone(), fmu);
        }
        let fmu = self.fmus[&path].clone()?;
        let implementation = element.attribute("implementation").unwrap_or("any");
        let is_there = match implementation {
            "CoSimulation" => fmu.description.co_simulation.is_some(),
            "ModelExchange" => fmu.description.model_exchange.is_some(),
            other => other == "any",
        };
        let error = || format!("the implementation {implementation} is not supported, or not by {}.fmu", fmu.stem);
        is_there.then_some(()).ok_or_else(error)?;
        Ok(fmu)
    }

    /// Unpacks an FMU of the archive.
    fn fmu(&mut self, path: &str) -> Result<Fmu, String> {
        let bytes = self.archive.entry(path).map_err(|error| error.to_string())?.ok_or_else(|| missing(path))?;
        let file = path.rsplit_once('/').map_or(path, |(_, file)| file);
        let mut taken = self.fmus.values().flatten().map(|fmu| fmu.stem.clone()).collect();
        let stem = text::unique(file.strip_suffix(".fmu").unwrap_or(file), &mut taken);
        let unpacked = self.folder.path().join(format!("{stem}.fmu"));
        std::fs::write(unpacked, &bytes).map_err(|cause| format!("cannot unpack `{path}`: {cause}"))?;
        let archive = Archive::read(Path::new(path), Cursor::new(bytes));
        let description = archive.and_then(|mut archive| archive.description()).map_err(|error| error.to_string())?;
        Ok(Fmu { stem, description: Arc::new(description) })
    }

    /// Checks a connector of a system or component.
    fn connector(&self, at: usize, connector: &'e Element) -> Result<(&'e str, Causality), XmlError> {
        let [name, kind] = ["name", "kind"].map(|attribute| connector.required(attribute));
        let (name, kind) = (name?, kind?);
        let error = |message: String| Err(connector.place.error(format!("the connector `{name}` {message}")));
        let Some(causality) = word::<Causality>(kind) else {
            return error(format!("has the kind {kind}, which is not supported"));
        };
        if connector.children.iter().any(|child| matches!(child.name.as_str(), "Clock" | "Dimension")) {
            return error("is a clock, has one, or is an array; only scalars without clocks are supported".into());
        }
        let Some(Fmu { stem, description }) = &self.owners[at].fmu else { return Ok((name, causality)) };
        let Some(variable) = description.variable(name) else {
            return error(format!("is not a variable of {stem}.fmu"));
        };
        let base_type = |name: &str| word(name).or_else(|| word::<DataType>(name)?.base_type());
        match connector.children.iter().find_map(|child| base_type(&child.name)) {
            _ if variable.causality != causality => {
                error(format!("has the kind {kind}, but in {stem}.fmu it is {}", role(variable)))
            }
            Some(base_type) if variable.base_type != base_type => {
                error(format!("is {base_type}, but in {stem}.fmu it is {}", variable.base_type))
            }
            _ => Ok((name, causality)),
        }
    }

    fn connection(&mut self, system: usize, element: &'e Element) -> Result<(), XmlError> {
        let error = |message: String| Err(element.place.error(message));
        let [start, end] = ["start", "end"].map(|side| self.end(system, element, side));
        let mut linear = Linear::IDENTITY;
        for child in &element.children {
            if child.name == "LinearTransformation" {
                let [factor, offset] = ["factor", "offset"].map(|name| child.real(name));
                linear = Linear { factor: factor?.unwrap_or(1.0), offset: offset?.unwrap_or(0.0) };
            } else if child.name.ends_with("Transformation") {
                return Err(child.place.error(format!("{} is not supported, only LinearTransformation", child.name)));
            }
        }
        if ["startIndices", "endIndices"].iter().any(|name| element.attribute(name).is_some()) {
            return error("connections of arrays are not supported".into());
        }
        let convert = element.boolean("suppressUnitConversion")? != Some(true);
        let (Some(start), Some(end)) = (start?, end?) else { return Ok(()) };
        // The words start and end do not imply a direction.
        let (from, to) = if start.writes { (start, end) } else { (end, start) };
        let [source, target] = [from, to].map(|end| end.at.1);
        let is_parameter = |end: End<'_>| end.causality != Causality::Input && is_inward(end.causality);
        if start.writes == end.writes {
            return error(format!("`{source}` and `{target}` both {}", if start.writes { "write" } else { "read" }));
        }
        if from.causality == Causality::CalculatedParameter || (is_parameter(to) && !is_parameter(from)) {
            return error(format!(
                "`{source}` cannot write `{target}`: only a parameter of a system writes a parameter"
            ));
        }
        let (from, to) = (from.at, to.at);
        match self.owners[to.0].incoming.insert(to.1, Edge { from, linear, convert, element }) {
            None => Ok(()),
            Some(_) => error(format!("a second connection writes `{}`; remove one of them", to.1)),
        }
    }

    /// An end of a connection; `None` if its FMU was rejected.
    fn end(&self, system: usize, element: &'e Element, side: &str) -> Result<Option<End<'e>>, XmlError> {
        let name = element.required(&format!("{side}Connector"))?;
        let of = element.attribute(&format!("{side}Element")).filter(|of| !of.is_empty());
        let error = |kind: &str, name: &str| Err(element.place.error(format!("no {kind} is named `{name}`")));
        let Some(at) = of.map_or(Some(system), |of| self.child(system, of)) else {
            return error("element", of.unwrap_or_default());
        };
        let owner = &self.owners[at];
        let found = match &owner.fmu {
            Some(fmu) => fmu.description.variable(name).map(|variable| variable.causality),
            None if owner.element.name == "Component" => return Ok(None),
            None => owner.connectors.get(name).copied(),
        };
        match found {
            // Inside a system, its inputs are sources of connections.
            Some(causality) => {
                Ok(Some(End { at: (at, name), causality, writes: is_inward(causality) == of.is_none() }))
            }
            None => error("connector", name),
        }
    }

    fn binding(&mut self, at: usize, binding: &'e Element) -> Result<(), XmlError> {
        let error = |message: String| binding.place.error(message);
        let kind = binding.attribute("type").unwrap_or(PARAMETER_SET);
        if let Some(mapping) = binding.child("ParameterMapping") {
            return Err(mapping
                .place
                .error("parameter mappings are not supported; write a set with the variables' names"));
        }
        if kind != PARAMETER_SET || binding.attribute("sourceBase") == Some("component") {
            return Err(error(format!("only a {PARAMETER_SET} beside the structure is supported")));
        }
        let inline = binding.child("ParameterValues").and_then(|values| values.child("ParameterSet"));
        let (set, units) = match (binding.attribute("source"), inline) {
            (Some(source), _) => {
                let path = path(source).map_err(error)?;
                let text = self.archive.text_of(&path).map_err(|cause| error(cause.to_string()))?;
                let root = xml::parse(&text.ok_or_else(|| error(missing(&path)))?).map(Element::without_prefixes);
                let set = root.and_then(|root| ParameterSet::of_element(&root));
                set.map_err(|cause| error(format!("{path}: {cause}")))?
            }
            (None, Some(set)) => ParameterSet::of_element(set)?,
            (None, None) => return Err(error("there is neither a `source` nor a ParameterSet".into())),
        };
        let prefix = binding.attribute("prefix").unwrap_or_default();
        for parameter in set.parameters {
            let base = |name: &String| units.iter().find(|unit| unit.name == *name)?.base;
            let unit = parameter.unit.map(|name| Declared { base: base(&name), name, is_relative: false });
            let name = format!("{prefix}{}", parameter.name);
            if !self.bind(at, &name, &Bound { value: parameter.value, unit, element: binding }) {
                self.warn(binding, format!("`{name}` is not a variable; its value is ignored"));
            }
        }
        Ok(())
    }

    /// Gives all variables and connectors with a hierarchical name a value. Returns false if there are none.
    fn bind(&mut self, at: usize, name: &str, bound: &Bound<'e>) -> bool {
        let Owner { element, fmu, connectors, .. } = &self.owners[at];
        let mut is_found = match fmu {
            Some(fmu) => fmu.description.index(name).is_some(),
            // Nothing is known about a component whose FMU was rejected.
            None => element.name == "Component" || connectors.contains_key(name),
        };
        if is_found {
            self.owners[at].values.insert(name.to_owned(), bound.clone());
        }
        for child in self.owners[at].children.clone() {
            let rest = name.strip_prefix(self.owners[child].name).and_then(|rest| rest.strip_prefix('.'));
            is_found |= rest.is_some_and(|rest| self.bind(child, rest, bound));
        }
        is_found
    }

    /// Follows the connections to a connector back to an output, or to a connector of a system that nothing writes. The
    /// result has the element of the last connection.
    fn source(&self, at: usize, name: &str) -> Option<Edge<'e>> {
        let mut found = *self.owners[at].incoming.get(name)?;
        // Connectors of systems may form a circle.
        for _ in 0..2 * MAX_OWNERS {
            let Owner { fmu: None, incoming, .. } = &self.owners[found.from.0] else { break };
            let Some(edge) = incoming.get(found.from.1) else { break };
            found.linear = found.linear.after(edge.linear);
            found.convert &= edge.convert;
            found.from = edge.from;
        }
        Some(found)
    }

    /// The unit of an end of a connection, and whether it is that of the variable, or else that of the connector.
    fn unit(&self, (at, name): (usize, &str)) -> Option<(Declared, bool)> {
        let Owner { fmu, units, .. } = &self.owners[at];
        let description = &fmu.as_ref()?.description;
        Declared::of(description, description.variable(name)?).map(|unit| (unit, true)).or_else(|| {
            let name = *units.get(name)?;
            let base = self.units.iter().find(|unit| unit.name == name).and_then(|unit| unit.base);
            Some((Declared { name: name.to_owned(), base, is_relative: false }, false))
        })
    }

    /// The factor and offset of a connection. If both variables have a unit, the scenario adds their conversion.
    fn linear(&self, edge: &Edge<'e>, to: (usize, &str)) -> Result<Linear, XmlError> {
        match (self.unit(edge.from), self.unit(to)) {
            (Some((from, a)), Some((to, b))) if edge.convert && !(a && b) => from.conversion_to(&to),
            _ => return Ok(edge.linear),
        }
        .map(|units| edge.linear.after(units))
        .map_err(|UnitMismatch { words: [from, to], .. }| {
            edge.element.place.error(format!("the source is {from}, but the target is {to}"))
        })
    }
}

fn missing(path: &str) -> String {
    format!("the archive does not contain `{path}`")
}

/// The path of a file in the archive.
fn path(uri: &str) -> Result<String, String> {
    let path = decoded(uri).and_then(|path| path_within(&path)).filter(|_| !uri.starts_with('#'));
    path.ok_or_else(|| format!("`{uri}` must be a path within the archive, without a scheme"))
}

/// Replaces the escape sequences of a URI; `None` if they are not those of a text.
fn decoded(uri: &str) -> Option<String> {
    let mut parts = uri.split('%');
    let mut bytes = parts.next()?.as_bytes().to_vec();
    for part in parts {
        bytes.push(u8::from_str_radix(part.get(..2)?, 16).ok()?);
        bytes.extend(part.bytes().skip(2));
    }
    String::from_utf8(bytes).ok()
}
