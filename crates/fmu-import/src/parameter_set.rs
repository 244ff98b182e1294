//! Parameter sets: files with values for the parameters of a system (SSV in SSP 1.0 and 2.0).
//!
//! Source: System Structure and Parameterization 1.0, section 6 (SystemStructureParameterValues); 2.0 adds the types of
//! FMI 3.0. A value without a unit is in the unit of the variable. Enumerations, and Integers with named values, can be
//! given by name. The bytes of a Binary are hexadecimal digits.

use crate::bytes::BinaryText;
use crate::description::{BaseType, BaseUnit, Unit, Value, unit};
use crate::limits;
use crate::xml::write::{Xml, document, element, empty};
use crate::xml::{self, Element, XmlError};
use quick_xml::events::{BytesStart, Event};
use std::collections::HashSet;
use std::io;
use std::path::Path;

const NAMESPACE: &str = "http://ssp-standard.org/SSP1/SystemStructureParameterValues";
/// Namespace of the elements that all SSP file formats share.
pub const COMMON: &str = "http://ssp-standard.org/SSP1/SystemStructureCommon";
/// Attributes of a base unit, in the order of [`BaseUnit::exponents`].
const BASE: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

/// A parameter set.
#[derive(Debug, Clone, PartialEq)]
pub struct ParameterSet {
    /// Name.
    pub name: String,
    /// Parameters in the order of the file. No name is repeated.
    pub parameters: Vec<Parameter>,
}

/// A parameter with its value.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// `parameter` in a component's set, `component:parameter` in a scenario's set.
    pub name: String,
    /// Value.
    pub value: Value,
    /// Unit of a Real value; `None` for the unit of the variable.
    pub unit: Option<String>,
}

impl ParameterSet {
    /// Reads a file.
    pub fn read(path: &Path) -> io::Result<Self> {
        let text = limits::read_text(path, limits::TEXT_FILE).map_err(|cause| {
            io::Error::new(cause.kind(), format!("cannot read {}: {cause}", path.to_string_lossy()))
        })?;
        Self::parse(&text).map_err(|cause| io::Error::other(format!("{}: {cause}", path.to_string_lossy())))
    }

    /// Parses the text of a file. Fails if it is not a parameter set of SSP 1.0 or 2.0, a value is invalid, or a name
    /// repeats.
    pub fn parse(text: &str) -> Result<Self, XmlError> {
        Self::of_element(&xml::parse(text)?.without_prefixes()).map(|(set, _)| set)
    }

    /// Reads the element `ParameterSet` and the units of measure that it defines; names have no namespace prefix.
    pub fn of_element(root: &Element) -> Result<(Self, Vec<Unit>), XmlError> {
        if root.name != "ParameterSet" {
            return Err(root.place.error(format!("expected <ssv:ParameterSet>, got <{}>", root.name)));
        }
        let version = root.required("version")?;
        if !version.starts_with("1.") && !version.starts_with("2.") {
            return Err(root.place.error(format!("version {version} of the format, expected 1.0 or 2.0")));
        }
        if root.child("Parameters").is_none() {
            return Err(root.place.error("<ssv:ParameterSet> lacks <ssv:Parameters>"));
        }
        let (mut parameters, mut names) = (Vec::new(), HashSet::new());
        for element in root.listed("Parameters", "Parameter") {
            let name = element.required("name")?;
            if !names.insert(name) {
                return Err(element.place.error(format!("the parameter `{name}` appears twice")));
            }
            parameters.push(parameter(element, name)?);
        }
        Ok((Self { name: root.required("name")?.to_string(), parameters }, units(root)?))
    }

    /// The text of the file, in SSP 1.0. `units` defines the units. If the unit of a value is not defined, or is not
    /// defined with SI units, it is left out; the value is then in the unit of its variable.
    pub fn to_xml(&self, units: &[Unit]) -> io::Result<String> {
        self.to_xml_of("1.0", units, |parameter| parameter.value.base_type().to_string())
    }

    /// The text of the file in an SSP version. `type_name` returns the name of a type, which is the same as in FMI.
    pub fn to_xml_of(
        &self,
        version: &str,
        units: &[Unit],
        type_name: impl Fn(&Parameter) -> String,
    ) -> io::Result<String> {
        let attributes = [("xmlns:ssv", NAMESPACE), ("xmlns:ssc", COMMON), ("version", version), ("name", &self.name)];
        document("ssv:ParameterSet", &attributes, |xml| {
            let mut used: Vec<&Unit> = Vec::new();
            element(xml, "ssv:Parameters", &[], |xml| {
                self.parameters.iter().try_for_each(|parameter| {
                    let text = parameter.value.text();
                    let mut value = vec![("value", text.as_str())];
                    let name = parameter.unit.as_deref().filter(|_| parameter.value.base_type() == BaseType::Real);
                    let unit = name.and_then(|name| units.iter().find(|u| u.name == name && u.base.is_some()));
                    if let Some(unit) = unit {
                        value.push(("unit", &unit.name));
                        if !used.contains(&unit) {
                            used.push(unit);
                        }
                    }
                    let tag = format!("ssv:{}", type_name(parameter));
                    element(xml, "ssv:Parameter", &[("name", &parameter.name)], |xml| empty(xml, &tag, &value))
                })
            })?;
            write_units(xml, "ssv:Units", &used)
        })
    }
}

/// The units of measure that the root element of a file defines; names have no namespace prefix.
pub fn units(root: &Element) -> Result<Vec<Unit>, XmlError> {
    root.listed("Units", "Unit").map(unit).collect()
}

/// Writes the definitions of units of measure into an element with this name, if there are any.
pub fn write_units(xml: &mut Xml, name: &str, units: &[&Unit]) -> io::Result<()> {
    if units.is_empty() {
        return Ok(());
    }
    element(xml, name, &[], |xml| {
        units.iter().try_for_each(|unit| {
            element(xml, "ssc:Unit", &[("name", &unit.name)], |xml| {
                xml.write_event(Event::Empty(base_unit(unit.base.as_ref())))
            })
        })
    })
}

/// The element `BaseUnit`: exponents, factor and offset, as in FMI.
fn base_unit(base: Option<&BaseUnit>) -> BytesStart<'static> {
    let mut element = BytesStart::new("ssc:BaseUnit");
    let Some(base) = base else { return element };
    for (name, exponent) in BASE.iter().zip(base.exponents) {
        if exponent != 0 {
            element.push_attribute((*name, exponent.to_string().as_str()));
        }
    }
    if base.factor != 1.0 {
        element.push_attribute(("factor", format!("{:?}", base.factor).as_str()));
    }
    if base.offset != 0.0 {
        element.push_attribute(("offset", format!("{:?}", base.offset).as_str()));
    }
    element
}

fn parameter(element: &Element, name: &str) -> Result<Parameter, XmlError> {
    if element.child("Dimension").is_some() {
        return Err(element.place.error(format!("the parameter `{name}` is an array; only scalars can be set")));
    }
    let typed = element
        .children
        .iter()
        .find(|c| c.name != "Annotations")
        .ok_or_else(|| element.place.error(format!("the parameter `{name}` has no value")))?;
    let value = match typed.name.as_str() {
        // XML Schema also allows INF and NaN, but parameters must be finite.
        "Real" | "Float64" | "Float32" => typed.real("value")?.filter(|v| v.is_finite()).map(Value::Real),
        "Integer" | "Int8" | "UInt8" | "Int16" | "UInt16" | "Int32" | "UInt32" | "Int64" | "UInt64" => {
            typed.parsed("value", "a whole number of 64 bits")?.and_then(Value::integer)
        }
        "Boolean" => typed.boolean("value")?.map(Value::Boolean),
        "String" | "Enumeration" => Some(Value::String(typed.required("value")?.to_string())),
        "Binary" => {
            let bytes = BinaryText::Hex.decode(typed.required("value")?.trim());
            let message =
                || format!("the value of the parameter `{name}` is not a list of hexadecimal digits in pairs");
            Some(Value::Binary { hex: bytes.ok_or_else(|| typed.place.error(message()))? })
        }
        other => {
            return Err(typed.place.error(format!(
                "the parameter `{name}` is given as <{other}>, expected Real, Integer, Boolean, String, Enumeration, \
                 Binary, or Float64, Int32 and the like"
            )));
        }
    };
    let value = value.ok_or_else(|| typed.place.error(format!("the parameter `{name}` has no finite value")))?;
    Ok(Parameter { name: name.to_string(), value, unit: typed.attribute("unit").map(str::to_string) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::description::{BaseType, DataType};

    fn unit(name: &str, exponents: [i32; 8], factor: f64) -> Unit {
        Unit {
            name: name.to_string(),
            base: Some(BaseUnit { exponents, factor, offset: 0.0 }),
            display_units: Vec::new(),
        }
    }

    #[test]
    fn written_and_read_back() {
        let parameter = |name: &str, value, unit: Option<&str>| Parameter {
            name: name.to_string(),
            value,
            unit: unit.map(str::to_string),
        };
        let set = ParameterSet {
            name: "tuned <1>".into(),
            parameters: vec![
                parameter("roll:gain", Value::Real(0.1 + 0.2), Some("rad/s2")),
                parameter("roll:limit", Value::Real(-1e-300), None),
                parameter("roll:mode", Value::Integer(-3), None),
                parameter("roll:on", Value::Boolean(true), None),
                parameter("roll:file", Value::String("a & \"b\"".into()), None),
                parameter("roll:id", Value::Unsigned(u64::MAX), None),
                parameter("roll:frame", Value::Binary { hex: vec![0, 0xff] }, None),
            ],
        };
        let units = [unit("rad/s2", [0, 0, -2, 0, 0, 0, 0, 1], 1.0), unit("km", [0, 1, 0, 0, 0, 0, 0, 0], 1000.0)];
        let text = set
            .to_xml_of("2.0", &units, |parameter| match parameter.value.base_type() {
                BaseType::Real => DataType::Float64.to_string(),
                BaseType::Integer => DataType::Int8.to_string(),
                other => other.to_string(),
            })
            .unwrap();
        assert_eq!(ParameterSet::parse(&text).unwrap(), set);
        assert!(text.contains("version=\"2.0\""), "{text}");
        assert!(text.contains("<ssv:Float64 value=\"0.30000000000000004\" unit=\"rad/s2\"/>"), "{text}");
        assert!(text.contains("<ssv:Int8 value=\"-3\"/>"), "{text}");
        assert!(text.contains("<ssv:Binary value=\"00ff\"/>"), "{text}");
        let text = set.to_xml(&units).unwrap();
        assert_eq!(ParameterSet::parse(&text).unwrap(), set);
        assert!(text.contains("version=\"1.0\""), "{text}");
        assert!(text.contains("<ssv:Real value=\"0.30000000000000004\" unit=\"rad/s2\"/>"), "{text}");
        assert!(text.contains("<ssc:BaseUnit s=\"-2\" rad=\"1\"/>"), "{text}");
        assert!(!text.contains("km"), "only units that are used: {text}");
    }

    #[test]
    fn a_unit_that_is_not_defined_is_left_out() {
        let set = ParameterSet {
            name: "a".into(),
            parameters: vec![Parameter { name: "x".into(), value: Value::Real(1.0), unit: Some("furlong".into()) }],
        };
        let text = set.to_xml(&[]).unwrap();
        assert_eq!(ParameterSet::parse(&text).unwrap().parameters[0].unit, None);
    }

    #[test]
    fn other_prefixes_and_annotations_are_read() {
        let text = "<ParameterSet xmlns='x' version='1.0' name='a'><Parameters><p:Parameter name='x'>\
                    <p:Annotations/><p:Real value=' 2 '/></p:Parameter></Parameters></ParameterSet>";
        assert_eq!(ParameterSet::parse(text).unwrap().parameters[0].value, Value::Real(2.0));
    }

    #[test]
    fn mistakes_have_a_place() {
        let around = |inner: &str| {
            format!(
                "<s:ParameterSet version=\"1.0\" name=\"a\"><s:Parameters>\n{inner}</s:Parameters></s:ParameterSet>"
            )
        };
        let real = |value: &str| around(&format!("<s:Parameter name=\"x\"><s:Real {value}/></s:Parameter>"));
        for (text, expected) in [
            ("<a/>".to_string(), "expected <ssv:ParameterSet>"),
            ("<ParameterSet version=\"3.0\" name=\"a\"/>".to_string(), "version 3.0"),
            ("<ParameterSet name=\"a\"/>".to_string(), "lacks the attribute `version`"),
            ("<ParameterSet version=\"1.0\" name=\"a\"/>".to_string(), "lacks <ssv:Parameters>"),
            (around("<s:Parameter name=\"x\"/>"), "line 2, column 1: the parameter `x` has no value"),
            (around("<s:Parameter/>"), "lacks the attribute `name`"),
            (around("<s:Parameter name=\"x\"><s:Clock value=\"00\"/></s:Parameter>"), "given as <Clock>"),
            (around("<s:Parameter name=\"x\"><s:Binary value=\"0\"/></s:Parameter>"), "not a list of hexadecimal"),
            (real("value=\"abc\""), "expected a number"),
            (real("value=\"nan\""), "no finite value"),
            (real(""), "no finite value"),
            (real("value=\"1\"/></s:Parameter><s:Parameter name=\"x\"><s:Real value=\"1\""), "`x` appears twice"),
        ] {
            let error = ParameterSet::parse(&text).expect_err(&text).to_string();
            assert!(error.contains(expected), "{text}: {error}");
        }
    }
}
