//! The SSP file (System Structure and Parameterization 1.0 and 2.0, section 5).

use super::{Component, STRUCTURE, System, number};
use crate::run::Linear;
use fmu_import::description::BaseType;
use fmu_import::parameter_set::{COMMON, write_units};
use fmu_import::xml::write::{Xml, document, element, empty};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Seek, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

const DESCRIPTION: &str = "http://ssp-standard.org/SSP1/SystemStructureDescription";
/// MIME type of FMUs.
pub(crate) const FMU: &str = "application/x-fmu-sharedlibrary";
/// MIME type of parameter sets.
pub(crate) const PARAMETER_SET: &str = "application/x-ssp-parameter-set";
/// Namespaces of the annotations, as the tools themselves write them.
const OMS: &str = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd";
const OSP: &str = "http://opensimulationplatform.com/SSP/OSPAnnotations";

pub(super) fn write(system: &System, fmus: &BTreeMap<&str, &Path>, path: &Path) -> io::Result<()> {
    let copy = |file: &str, output: &mut dyn Write| {
        let source = fmus.get(file).ok_or(io::ErrorKind::NotFound)?;
        io::copy(&mut BufReader::new(File::open(source)?), output).map(drop)
    };
    system.write_ssp(BufWriter::new(File::create(path)?), &copy)?.into_inner()?.sync_all()
}

impl System {
    /// Writes the SSP file; `copy` writes an FMU by its file name.
    pub fn write_ssp<W: Write + Seek>(
        &self,
        output: W,
        copy: &dyn Fn(&str, &mut dyn Write) -> io::Result<()>,
    ) -> io::Result<W> {
        let options = SimpleFileOptions::default().last_modified_time(DateTime::default()).unix_permissions(0o644);
        let packed = options.compression_method(CompressionMethod::Deflated);
        // FMUs are compressed already.
        let stored = options.compression_method(CompressionMethod::Stored);
        let mut zip = ZipWriter::new(output);
        zip.start_file(STRUCTURE, packed)?;
        zip.write_all(structure(self)?.as_bytes())?;
        for component in self.components.iter().filter(|component| !component.values.is_empty()) {
            zip.start_file(parameter_file(component), packed)?;
            zip.write_all(self.parameter_set(component)?.as_bytes())?;
        }
        let files: BTreeSet<&str> = self.components.iter().map(|component| component.file.as_str()).collect();
        for file in files {
            zip.start_file(format!("resources/{file}"), stored)?;
            copy(file, &mut zip)?;
        }
        Ok(zip.finish()?)
    }
}

fn parameter_file(component: &Component) -> String {
    format!("resources/{}.ssv", component.name)
}

pub(super) fn structure(system: &System) -> io::Result<String> {
    let (start, stop, step) = (number(system.start), number(system.stop), number(system.step));
    let attributes = [
        ("xmlns:ssd", DESCRIPTION),
        ("xmlns:ssc", COMMON),
        // Declared here rather than where they are used, because libcosim takes every attribute of osp:Algorithm for an
        // algorithm.
        ("xmlns:oms", OMS),
        ("xmlns:osp", OSP),
        ("version", system.version()),
        ("name", system.name.as_str()),
        ("generationTool", concat!("cargo-fmu ", env!("CARGO_PKG_VERSION"))),
    ];
    document("ssd:SystemStructureDescription", &attributes, |xml| {
        element(xml, "ssd:System", &[("name", &system.name), ("description", &system.description)], |xml| {
            element(xml, "ssd:Elements", &[], |xml| {
                system.components.iter().try_for_each(|component| self::component(xml, component))
            })?;
            if !system.connections.is_empty() {
                element(xml, "ssd:Connections", &[], |xml| connections(xml, system))?;
            }
            // OMSimulator does not start without the master's name and step.
            annotation(xml, "org.openmodelica", |xml| {
                element(xml, "oms:Annotations", &[], |xml| {
                    element(xml, "oms:SimulationInformation", &[], |xml| {
                        let master = [
                            ("description", "oms-ma"),
                            ("stepSize", step.as_str()),
                            ("absoluteTolerance", "0.0001"),
                            ("relativeTolerance", "0.0001"),
                        ];
                        empty(xml, "oms:FixedStepMaster", &master)
                    })
                })
            })
        })?;
        write_units(xml, "ssd:Units", &system.units.iter().collect::<Vec<_>>())?;
        element(xml, "ssd:DefaultExperiment", &[("startTime", &start), ("stopTime", &stop)], |xml| {
            annotation(xml, "com.opensimulationplatform", |xml| {
                element(xml, "osp:Algorithm", &[], |xml| {
                    empty(xml, "osp:FixedStepAlgorithm", &[("baseStepSize", &step)])
                })
            })
        })
    })
}

fn annotation(xml: &mut Xml, tool: &str, content: impl FnOnce(&mut Xml) -> io::Result<()>) -> io::Result<()> {
    element(xml, "ssd:Annotations", &[], |xml| element(xml, "ssc:Annotation", &[("type", tool)], content))
}

fn component(xml: &mut Xml, component: &Component) -> io::Result<()> {
    let attributes = [
        ("name", component.name.as_str()),
        ("type", FMU),
        ("source", &format!("resources/{}", component.file)),
        ("implementation", if component.is_exchange { "ModelExchange" } else { "CoSimulation" }),
    ];
    element(xml, "ssd:Component", &attributes, |xml| {
        if !component.connectors.is_empty() {
            element(xml, "ssd:Connectors", &[], |xml| connectors(xml, component))?;
        }
        if component.values.is_empty() {
            return Ok(());
        }
        element(xml, "ssd:ParameterBindings", &[], |xml| {
            let source = parameter_file(component);
            let set = [("type", PARAMETER_SET), ("source", source.as_str())];
            empty(xml, "ssd:ParameterBinding", &set)
        })
    })
}

fn connectors(xml: &mut Xml, component: &Component) -> io::Result<()> {
    component.connectors.iter().try_for_each(|connector| {
        let kind = if connector.output { "output" } else { "input" };
        element(xml, "ssd:Connector", &[("name", &connector.name), ("kind", kind)], |xml| {
            let unit = connector.unit.as_ref().filter(|_| connector.base_type == BaseType::Real);
            let unit: Vec<(&str, &str)> = unit.iter().map(|unit| ("unit", unit.as_str())).collect();
            empty(xml, &format!("ssc:{}", connector.type_name), &unit)
        })
    })
}

fn connections(xml: &mut Xml, system: &System) -> io::Result<()> {
    system.connections.iter().try_for_each(|connection| {
        let ([start, output], [end, input]) = (&connection.from, &connection.to);
        let ends = [
            ("startElement", start.as_str()),
            ("startConnector", output),
            ("endElement", end),
            ("endConnector", input),
        ];
        let Some(Linear { factor, offset }) = connection.conversion else { return empty(xml, "ssd:Connection", &ends) };
        // The transformation contains the conversion of units.
        let ends: Vec<_> = ends.into_iter().chain([("suppressUnitConversion", "true")]).collect();
        let [factor, offset] = [factor, offset].map(number);
        element(xml, "ssd:Connection", &ends, |xml| {
            empty(xml, "ssc:LinearTransformation", &[("factor", &factor), ("offset", &offset)])
        })
    })
}
