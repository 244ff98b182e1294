//! The configuration of libcosim (OSP system structure 0.1, schema of libcosim).

use super::{Component, System, number};
use fmu_import::description::Value;
use fmu_import::xml::write::{Xml, document, element, empty};
use quick_xml::events::BytesText;
use std::io;

const NAMESPACE: &str = "http://opensimulationplatform.com/MSMI/OSPSystemStructure";

pub(super) fn structure(system: &System) -> io::Result<String> {
    document("OspSystemStructure", &[("xmlns", NAMESPACE), ("version", "0.1")], |xml| {
        let (start, step) = (number(system.start), number(system.step));
        for (name, text) in [("StartTime", start.as_str()), ("BaseStepSize", &step), ("Algorithm", "fixedStep")] {
            xml.create_element(name).write_text_content(BytesText::new(text))?;
        }
        element(xml, "Simulators", &[], |xml| {
            system.components.iter().try_for_each(|component| simulator(xml, component, &step))
        })?;
        if system.connections.is_empty() {
            return Ok(());
        }
        element(xml, "Connections", &[], |xml| {
            system.connections.iter().try_for_each(|connection| {
                element(xml, "VariableConnection", &[], |xml| {
                    [&connection.from, &connection.to].into_iter().try_for_each(|[simulator, name]| {
                        empty(xml, "Variable", &[("simulator", simulator), ("name", name)])
                    })
                })
            })
        })
    })
}

fn simulator(xml: &mut Xml, component: &Component, step: &str) -> io::Result<()> {
    let attributes = [("name", component.name.as_str()), ("source", &component.file), ("stepSize", step)];
    if component.values.is_empty() {
        return empty(xml, "Simulator", &attributes);
    }
    element(xml, "Simulator", &attributes, |xml| {
        element(xml, "InitialValues", &[], |xml| {
            for value in &component.values {
                let (tag, text) = match &value.value {
                    Value::Real(v) => ("Real", number(*v)),
                    Value::Integer(v) => ("Integer", v.to_string()),
                    Value::Boolean(v) => ("Boolean", v.to_string()),
                    Value::String(v) => ("String", v.clone()),
                    // Only FMI 3.0 has these types, and such a system is not written for libcosim.
                    Value::Unsigned(_) | Value::Binary { .. } => ("String", value.value.text()),
                };
                element(xml, "InitialValue", &[("variable", &value.name)], |xml| empty(xml, tag, &[("value", &text)]))?;
            }
            Ok(())
        })
    })
}
