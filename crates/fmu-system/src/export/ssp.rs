//! The SSP file (System Structure and Parameterization 1.0 and 2.0, section 5).

use super::{Component, STRUCTURE, System, number};
use fmu_import::description::BaseType;
use fmu_import::parameter_set::{COMMON, base_unit};
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Seek, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

const DESCRIPTION: &str = "http://ssp-standard.org/SSP1/SystemStructureDescription";
/// Namespaces of the annotations, as the tools themselves write them.
const OMS: &str = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd";
const OSP: &str = "http://opensimulationplatform.com/SSP/OSPAnnotations";

type Xml = Writer<Vec<u8>>;

/// Writes the file.
pub(super) fn write(system: &System, fmus: &BTreeMap<&str, &Path>, path: &Path) -> io::Result<()> {
    let copy = |file: &str, output: &mut dyn Write| {
        let source = fmus.get(file).ok_or(io::ErrorKind::NotFound)?;
        io::copy(&mut BufReader::new(File::open(source)?), output).map(drop)
    };
    write_to(BufWriter::new(File::create(path)?), system, &copy)?.into_inner()?.sync_all()
}

/// Writes the content of the file. `copy` writes an FMU by its file name.
pub(super) fn write_to<W: Write + Seek>(
    output: W,
    system: &System,
    copy: &dyn Fn(&str, &mut dyn Write) -> io::Result<()>,
) -> io::Result<W> {
    let options = SimpleFileOptions::default().last_modified_time(DateTime::default()).unix_permissions(0o644);
    let packed = options.compression_method(CompressionMethod::Deflated);
    // FMUs are compressed already.
    let stored = options.compression_method(CompressionMethod::Stored);
    let mut zip = ZipWriter::new(output);
    zip.start_file(STRUCTURE, packed)?;
    zip.write_all(structure(system)?.as_bytes())?;
    for component in system.components.iter().filter(|component| !component.values.is_empty()) {
        zip.start_file(parameter_file(component), packed)?;
        zip.write_all(system.parameter_set(component)?.as_bytes())?;
    }
    let files: BTreeSet<&str> = system.components.iter().map(|component| component.file.as_str()).collect();
    for file in files {
        zip.start_file(format!("resources/{file}"), stored)?;
        copy(file, &mut zip)?;
    }
    Ok(zip.finish()?)
}

fn parameter_file(component: &Component) -> String {
    format!("resources/{}.ssv", component.name)
}

/// The text of the structure.
pub(super) fn structure(system: &System) -> io::Result<String> {
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    xml.create_element("ssd:SystemStructureDescription")
        .with_attributes([
            ("xmlns:ssd", DESCRIPTION),
            ("xmlns:ssc", COMMON),
            // Here and not where they are used: libcosim takes every attribute of osp:Algorithm for an algorithm.
            ("xmlns:oms", OMS),
            ("xmlns:osp", OSP),
            ("version", system.version()),
            ("name", system.name.as_str()),
            ("generationTool", concat!("cargo-fmu ", env!("CARGO_PKG_VERSION"))),
        ])
        .write_inner_content(|xml| {
            xml.create_element("ssd:System")
                .with_attributes([("name", system.name.as_str()), ("description", system.description.as_str())])
                .write_inner_content(|xml| {
                    xml.create_element("ssd:Elements").write_inner_content(|xml| {
                        system.components.iter().try_for_each(|component| element(xml, component))
                    })?;
                    if !system.connections.is_empty() {
                        xml.create_element("ssd:Connections").write_inner_content(|xml| connections(xml, system))?;
                    }
                    // OMSimulator does not start without the master's name and step.
                    annotation(xml, "org.openmodelica", |xml| {
                        xml.create_element("oms:Annotations").write_inner_content(|xml| {
                            xml.create_element("oms:SimulationInformation").write_inner_content(|xml| {
                                xml.create_element("oms:FixedStepMaster")
                                    .with_attributes([
                                        ("description", "oms-ma"),
                                        ("stepSize", number(system.step).as_str()),
                                        ("absoluteTolerance", "0.0001"),
                                        ("relativeTolerance", "0.0001"),
                                    ])
                                    .write_empty()?;
                                Ok(())
                            })?;
                            Ok(())
                        })?;
                        Ok(())
                    })
                })?;
            if !system.units.is_empty() {
                xml.create_element("ssd:Units").write_inner_content(|xml| units(xml, system))?;
            }
            xml.create_element("ssd:DefaultExperiment")
                .with_attributes([
                    ("startTime", number(system.start).as_str()),
                    ("stopTime", number(system.stop).as_str()),
                ])
                .write_inner_content(|xml| {
                    annotation(xml, "com.opensimulationplatform", |xml| {
                        xml.create_element("osp:Algorithm").write_inner_content(|xml| {
                            xml.create_element("osp:FixedStepAlgorithm")
                                .with_attribute(("baseStepSize", number(system.step).as_str()))
                                .write_empty()?;
                            Ok(())
                        })?;
                        Ok(())
                    })
                })?;
            Ok(())
        })?;
    let mut text = String::from_utf8(xml.into_inner()).map_err(io::Error::other)?;
    text.push('\n');
    Ok(text)
}

fn annotation(xml: &mut Xml, tool: &str, content: impl FnOnce(&mut Xml) -> io::Result<()>) -> io::Result<()> {
    xml.create_element("ssd:Annotations").write_inner_content(|xml| {
        xml.create_element("ssc:Annotation").with_attribute(("type", tool)).write_inner_content(content)?;
        Ok(())
    })?;
    Ok(())
}

fn element(xml: &mut Xml, component: &Component) -> io::Result<()> {
    xml.create_element("ssd:Component")
        .with_attributes([
            ("name", component.name.as_str()),
            ("type", "application/x-fmu-sharedlibrary"),
            ("source", format!("resources/{}", component.file).as_str()),
            ("implementation", "CoSimulation"),
        ])
        .write_inner_content(|xml| {
            if !component.connectors.is_empty() {
                xml.create_element("ssd:Connectors").write_inner_content(|xml| connectors(xml, component))?;
            }
            if !component.values.is_empty() {
                xml.create_element("ssd:ParameterBindings").write_inner_content(|xml| {
                    xml.create_element("ssd:ParameterBinding")
                        .with_attributes([
                            ("type", "application/x-ssp-parameter-set"),
                            ("source", parameter_file(component).as_str()),
                        ])
                        .write_empty()?;
                    Ok(())
                })?;
            }
            Ok(())
        })?;
    Ok(())
}

fn connectors(xml: &mut Xml, component: &Component) -> io::Result<()> {
    for connector in &component.connectors {
        let kind = if connector.output { "output" } else { "input" };
        xml.create_element("ssd:Connector")
            .with_attributes([("name", connector.name.as_str()), ("kind", kind)])
            .write_inner_content(|xml| {
                let mut tag = xml.create_element(format!("ssc:{}", connector.type_name));
                if let (BaseType::Real, Some(unit)) = (connector.base_type, &connector.unit) {
                    tag = tag.with_attribute(("unit", unit.as_str()));
                }
                tag.write_empty()?;
                Ok(())
            })?;
    }
    Ok(())
}

fn connections(xml: &mut Xml, system: &System) -> io::Result<()> {
    for connection in &system.connections {
        let ([start, output], [end, input]) = (&connection.from, &connection.to);
        xml.create_element("ssd:Connection")
            .with_attributes([
                ("startElement", start.as_str()),
                ("startConnector", output.as_str()),
                ("endElement", end.as_str()),
                ("endConnector", input.as_str()),
            ])
            .write_empty()?;
    }
    Ok(())
}

fn units(xml: &mut Xml, system: &System) -> io::Result<()> {
    for unit in &system.units {
        xml.create_element("ssc:Unit")
            .with_attribute(("name", unit.name.as_str()))
            .write_inner_content(|xml| xml.write_event(Event::Empty(base_unit(unit.base.as_ref()))))?;
    }
    Ok(())
}
