//! The configuration of libcosim (OSP system structure 0.1, schema of libcosim).

use super::{System, number};
use fmu_import::description::Value;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, BytesText, Event};
use std::io;

const NAMESPACE: &str = "http://opensimulationplatform.com/MSMI/OSPSystemStructure";

/// The text of the file.
pub(super) fn structure(system: &System) -> io::Result<String> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    xml.create_element("OspSystemStructure")
        .with_attributes([("xmlns", NAMESPACE), ("version", "0.1")])
        .write_inner_content(|xml| {
            xml.create_element("StartTime").write_text_content(BytesText::new(&number(system.start)))?;
            xml.create_element("BaseStepSize").write_text_content(BytesText::new(&number(system.step)))?;
            xml.create_element("Algorithm").write_text_content(BytesText::new("fixedStep"))?;
            xml.create_element("Simulators").write_inner_content(|xml| simulators(xml, system))?;
            if !system.connections.is_empty() {
                xml.create_element("Connections").write_inner_content(|xml| connections(xml, system))?;
            }
            Ok(())
        })?;
    let mut text = String::from_utf8(xml.into_inner()).map_err(io::Error::other)?;
    text.push('\n');
    Ok(text)
}

fn simulators(xml: &mut Writer<Vec<u8>>, system: &System) -> io::Result<()> {
    for component in &system.components {
        let step = number(system.step);
        let simulator = xml.create_element("Simulator").with_attributes([
            ("name", component.name.as_str()),
            ("source", component.file.as_str()),
            ("stepSize", step.as_str()),
        ]);
        if component.values.is_empty() {
            simulator.write_empty()?;
            continue;
        }
        simulator.write_inner_content(|xml| {
            xml.create_element("InitialValues").write_inner_content(|xml| {
                for value in &component.values {
                    xml.create_element("InitialValue")
                        .with_attribute(("variable", value.name.as_str()))
                        .write_inner_content(|xml| {
                            let (tag, text) = match &value.value {
                                Value::Real(v) => ("Real", number(*v)),
                                Value::Integer(v) => ("Integer", v.to_string()),
                                Value::Boolean(v) => ("Boolean", v.to_string()),
                                Value::String(v) => ("String", v.clone()),
                            };
                            xml.create_element(tag).with_attribute(("value", text.as_str())).write_empty()?;
                            Ok(())
                        })?;
                }
                Ok(())
            })?;
            Ok(())
        })?;
    }
    Ok(())
}

fn connections(xml: &mut Writer<Vec<u8>>, system: &System) -> io::Result<()> {
    for connection in &system.connections {
        xml.create_element("VariableConnection").write_inner_content(|xml| {
            for [simulator, name] in [&connection.from, &connection.to] {
                xml.create_element("Variable")
                    .with_attributes([("simulator", simulator.as_str()), ("name", name.as_str())])
                    .write_empty()?;
            }
            Ok(())
        })?;
    }
    Ok(())
}
