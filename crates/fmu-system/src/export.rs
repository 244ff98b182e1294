//! Writes a run of a plan for other masters: an SSP file and an OSP system structure, with the FMUs.
//!
//! [`System`] is a run with names instead of references and slots. [`System::write`] makes a folder with
//!
//! - `NAME.ssp`, System Structure and Parameterization 1.0, or 2.0 if a component is of FMI 3.0: the structure with
//!   connectors, units of measure and connections, a parameter set for every component, the FMUs, and the annotations
//!   from which OMSimulator and libcosim take the step (Ecos and FMPy take it from the caller),
//! - `OspSystemStructure.xml`, the configuration of libcosim, with the FMUs in the same folder; left out if a component
//!   is of FMI 3.0 or in model exchange, or if a connection converts values, which libcosim does not support.
//!
//! Constant inputs become start values in both. Neither format defines the order of the components within a step, the
//! recording, or the metrics. Recorded outputs become connectors, so a tool that records all connectors also records
//! these outputs.

mod osp;
pub(crate) mod ssp;

use crate::plan::Plan;
use crate::run::{self, Extrapolation, Linear, Run, Wire};
use fmu_import::archive::{ArchiveError, read_description_with};
use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Causality, DataType, FmiVersion, ModelDescription, Unit, Variable};
use fmu_import::parameter_set::{Parameter, ParameterSet};
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Name of the structure inside an SSP file.
pub const STRUCTURE: &str = "SystemStructure.ssd";
/// Name of the file that libcosim reads.
pub const OSP_STRUCTURE: &str = "OspSystemStructure.xml";
/// Name of every parameter set in an SSP file. Ecos applies the sets of all components that have the requested name.
pub const PARAMETERS: &str = "parameters";

/// Error while exporting a run for other masters.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// An FMU cannot be read.
    #[error(transparent)]
    Fmu(#[from] ArchiveError),
    /// The run reads signals from a file.
    #[error("signals from a file cannot be exported: neither SSP nor OSP structures can contain them")]
    InputSeries,
    /// Something that other masters do not support, or an FMU that has changed since the plan was made.
    #[error("{0}")]
    Unsupported(String),
    /// The folder is not empty.
    #[error("{}: the folder is not empty{hint}", path.display())]
    Occupied {
        /// The folder.
        path: PathBuf,
        /// Remedy, appended to the message.
        hint: String,
    },
    /// A file cannot be written.
    #[error("{}: {cause}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Cause.
        cause: io::Error,
    },
}

/// A complete run, with names instead of references and slots.
#[derive(Debug, Clone, PartialEq)]
pub struct System {
    /// Name of the scenario, with `_` in place of characters other than letters, digits and `_`.
    pub name: String,
    /// Scenario, case, point and seed.
    description: String,
    start: f64,
    /// Stop, s.
    pub stop: f64,
    /// Communication step, s.
    pub step: f64,
    /// Components of the scenario in their order.
    pub components: Vec<Component>,
    /// Connections, in the order of the reading components and their inputs.
    pub connections: Vec<Connection>,
    /// Definitions of the units of measure that connectors and parameters have.
    units: Vec<Unit>,
}

/// A component of the scenario.
#[derive(Debug, Clone, PartialEq)]
pub struct Component {
    /// Name.
    pub name: String,
    fmu: PathBuf,
    /// Its file name.
    pub file: String,
    fmi: FmiVersion,
    /// True in model exchange. SSP has no place for the solver.
    is_exchange: bool,
    /// Inputs that are written, and outputs that are read or recorded.
    pub connectors: Vec<Connector>,
    /// Values of parameters and of inputs that nothing writes.
    pub values: Vec<Parameter>,
    /// Types of the values by name, as FMI and SSP call them.
    value_types: HashMap<String, String>,
}

/// An input or output of a component.
#[derive(Debug, Clone, PartialEq)]
pub struct Connector {
    name: String,
    /// True for an output, false for an input.
    pub output: bool,
    base_type: BaseType,
    /// Its type, as FMI and SSP name it.
    type_name: String,
    unit: Option<String>,
}

/// A connection: component and variable at both ends.
#[derive(Debug, Clone, PartialEq)]
pub struct Connection {
    /// The end that writes.
    from: [String; 2],
    to: [String; 2],
    /// How the value of the input follows, if it is not the same.
    conversion: Option<Linear>,
}

impl System {
    /// Makes a system from a run of a plan.
    ///
    /// # Errors
    /// An FMU cannot be read or has changed since the plan was made, signals come from a file, the file name of an FMU
    /// is not valid in a URI, components have rates or a coupling that other masters do not know, an enumeration or an element of an array is set or connected, clocks are connected, a
    /// connection converts between Real and Boolean, or a unit of measure has two definitions.
    pub fn new(plan: &Plan, run: &Run) -> Result<Self, ExportError> {
        let describe = |component: &run::Component| {
            Ok(read_description_with(Path::new(&component.fmu), &component.structure)?.with_elements().into())
        };
        Self::described(plan, run, &describe)
    }

    /// As [`Self::new`]; `describe` returns the description of the FMU of a component.
    pub fn described(
        plan: &Plan,
        run: &Run,
        describe: &dyn Fn(&run::Component) -> Result<Arc<ModelDescription>, ArchiveError>,
    ) -> Result<Self, ExportError> {
        if !run.series.is_empty() {
            return Err(ExportError::InputSeries);
        }
        let simulation = &plan.simulation;
        let rated = run.components.iter().find(|own| (own.every, own.substeps) != (1, 1));
        let keys = [
            ("every` or `substeps", rated.is_some()),
            ("extrapolation", simulation.extrapolation == Extrapolation::Linear),
            ("iterate", simulation.iterate.is_some()),
            ("error_control", simulation.error_control.is_some()),
        ];
        if let Some((key, _)) = keys.iter().find(|(_, is_set)| *is_set) {
            return Err(ExportError::Unsupported(format!(
                "neither SSP nor OSP structures can express `{key}`; remove it, or run the scenario with the native master"
            )));
        }
        let recorded: BTreeSet<usize> = run.columns.iter().flatten().copied().collect();
        let read: BTreeSet<usize> =
            run.components.iter().flat_map(|planned| &planned.inputs).map(|wire| wire.slot).collect();
        let mut writers: BTreeMap<usize, ([String; 2], BaseType)> = BTreeMap::new();
        let mut units = Definitions::default();
        let mut components = Vec::new();
        for planned in &run.components {
            if let Some(clock) = planned.clocks.first() {
                return Err(ExportError::Unsupported(format!(
                    "the connection from `{}:{}` to `{}:{}` joins clocks, which masters of SSP packages do not activate; \
                     run the scenario with the native master",
                    clock.component, clock.source, planned.name, clock.name
                )));
            }
            let description = describe(planned)?;
            let fmu = PathBuf::from(&planned.fmu);
            let mut component = Component {
                name: planned.name.clone(),
                file: file_name(&fmu)?,
                fmu,
                fmi: description.fmi,
                is_exchange: planned.integration.is_some(),
                connectors: Vec::new(),
                values: Vec::new(),
                value_types: HashMap::new(),
            };
            let wirable = wirable(&description);
            for wire in &planned.inputs {
                let variable = wired(&wirable, planned, wire, Causality::Input)?;
                component.connectors.push(connector(variable, false, &description, &planned.name)?);
            }
            for wire in planned.outputs.iter().filter(|wire| read.contains(&wire.slot) || recorded.contains(&wire.slot))
            {
                let variable = wired(&wirable, planned, wire, Causality::Output)?;
                // Skip an element of an array, or a clock, that is only recorded.
                let is_special = variable.element.is_some() || variable.data_type == DataType::Clock;
                if is_special && !read.contains(&wire.slot) {
                    continue;
                }
                component.connectors.push(connector(variable, true, &description, &planned.name)?);
                writers.insert(wire.slot, ([planned.name.clone(), variable.name.clone()], wire.base_type));
            }
            let steady = planned.steady.iter().flatten();
            // A start value of the steady state replaces the parameter.
            let is_found = |name: &str| planned.steady.iter().flatten().any(|setting| setting.name == name);
            let parameters = planned.parameters.iter().filter(|setting| !is_found(&setting.name));
            // Masters of SSP 2.0 set structural parameters in Configuration Mode (SSP 2.0, section ParameterBindings).
            for (name, value) in &planned.structure {
                let of = description.variable(name).map_or(String::new(), |of| type_name(of, description.fmi));
                component.value_types.insert(name.clone(), of);
                component.values.push(Parameter { name: name.clone(), value: value.clone(), unit: None });
            }
            for setting in parameters.chain(steady).chain(&planned.constants) {
                let variable = description.variable(&setting.name);
                reject(variable, &planned.name)?;
                let unit = variable.and_then(|v| v.unit.clone()).filter(|name| defined(&description, name).is_some());
                if let Some(variable) = variable {
                    component.value_types.insert(variable.name.clone(), type_name(variable, description.fmi));
                }
                component.values.push(Parameter { name: setting.name.clone(), value: setting.value.clone(), unit });
            }
            let used = component.connectors.iter().map(|c| &c.unit).chain(component.values.iter().map(|v| &v.unit));
            for name in used.flatten() {
                units.add(&description, name, &component.file)?;
            }
            components.push(component);
        }
        let mut connections = Vec::new();
        for (planned, component) in run.components.iter().zip(&components) {
            for (wire, connector) in planned.inputs.iter().zip(&component.connectors) {
                let Some((from, output)) = writers.get(&wire.slot) else { continue };
                let to = [planned.name.clone(), connector.name.clone()];
                if *output != wire.base_type {
                    return Err(ExportError::Unsupported(format!(
                        "the connection from `{}` ({output}) to `{}` ({}) converts the value, which neither SSP 1.0 nor OSP \
                         structures can express; connect variables of the same type",
                        from.join(":"),
                        to.join(":"),
                        wire.base_type
                    )));
                }
                connections.push(Connection { from: from.clone(), to, conversion: wire.conversion });
            }
        }
        Ok(Self {
            name: plan.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect(),
            description: text(plan, run),
            start: plan.simulation.start,
            stop: plan.simulation.stop,
            step: plan.simulation.step,
            components,
            connections,
            units: units.0.into_values().map(|(unit, _)| unit).collect(),
        })
    }

    fn has_fmi_3(&self) -> bool {
        self.components.iter().any(|component| component.fmi == FmiVersion::V3)
    }

    /// The first version of SSP that has the types of all components.
    fn version(&self) -> &'static str {
        if self.has_fmi_3() { "2.0" } else { "1.0" }
    }

    /// The feature for which libcosim cannot run the system.
    fn libcosim_obstacle(&self) -> Option<&'static str> {
        let obstacles = [
            ("FMUs of FMI 3.0", self.has_fmi_3()),
            ("FMUs in model exchange", self.components.iter().any(|component| component.is_exchange)),
            ("conversions of values", self.connections.iter().any(|connection| connection.conversion.is_some())),
        ];
        obstacles.into_iter().find_map(|(what, is_used)| is_used.then_some(what))
    }

    /// Lists the parts of the run that the files do not contain, a sentence each.
    pub fn notes(&self) -> Vec<String> {
        let solver = |component: &Component| {
            format!("`{}` is in model exchange; SSP has no place for its `solver` and `tolerance`", component.name)
        };
        let exchange = self.components.iter().filter(|component| component.is_exchange).map(solver);
        let osp = |what| format!("{OSP_STRUCTURE} is left out, because libcosim does not support {what}");
        exchange.chain(self.libcosim_obstacle().map(osp)).collect()
    }

    /// Writes the files into a folder, which appears complete or not at all, and returns their paths: the SSP file and,
    /// if libcosim supports the system, its configuration. With `overwrite`, the folder may contain the files of an
    /// earlier call.
    ///
    /// # Errors
    /// The folder is not empty, or contains files that an earlier call did not write; a file cannot be read or written.
    pub fn write(&self, folder: &Path, overwrite: bool) -> Result<Vec<PathBuf>, ExportError> {
        let at = |path: &Path| {
            let path = path.to_path_buf();
            move |cause| ExportError::Write { path, cause }
        };
        reject_foreign(folder, overwrite)?;
        let name = folder.file_name().ok_or_else(|| ExportError::Write {
            path: folder.to_path_buf(),
            cause: io::Error::new(io::ErrorKind::InvalidInput, "this is not a folder name"),
        })?;
        // Create it in the same parent folder, so that it can be renamed.
        let parent = folder.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        std::fs::create_dir_all(parent).map_err(at(parent))?;
        let work = tempfile::Builder::new().prefix(".system").tempdir_in(parent).map_err(at(parent))?;
        let new = work.path().join(name);
        std::fs::create_dir(&new).map_err(at(&new))?;

        let fmus: BTreeMap<&str, &Path> =
            self.components.iter().map(|component| (component.file.as_str(), component.fmu.as_path())).collect();
        for (file, source) in &fmus {
            std::fs::copy(source, new.join(file)).map_err(at(source))?;
        }
        let package = format!("{}.ssp", self.name);
        ssp::write(self, &fmus, &new.join(&package)).map_err(at(&folder.join(&package)))?;
        let mut files = vec![folder.join(package)];
        if self.libcosim_obstacle().is_none() {
            osp::structure(self)
                .and_then(|xml| std::fs::write(new.join(OSP_STRUCTURE), xml))
                .map_err(at(&folder.join(OSP_STRUCTURE)))?;
            files.push(folder.join(OSP_STRUCTURE));
        }

        let old = work.path().join("old");
        let replaced = folder.exists();
        if replaced {
            std::fs::rename(folder, &old).map_err(at(folder))?;
        }
        if let Err(cause) = std::fs::rename(&new, folder) {
            if replaced {
                // Restore the old folder; the first error is the one to report.
                let _ = std::fs::rename(&old, folder);
            }
            return Err(at(folder)(cause));
        }
        Ok(files)
    }

    fn parameter_set(&self, component: &Component) -> io::Result<String> {
        let set = ParameterSet { name: PARAMETERS.to_string(), parameters: component.values.clone() };
        set.to_xml_of(self.version(), &self.units, |parameter| {
            let known = component.value_types.get(&parameter.name).cloned();
            known.unwrap_or_else(|| parameter.value.base_type().to_string())
        })
    }
}

/// Definitions of units of measure by name, each with the file it is from.
#[derive(Default)]
struct Definitions(BTreeMap<String, (Unit, String)>);

impl Definitions {
    fn add(&mut self, description: &ModelDescription, name: &str, file: &str) -> Result<(), ExportError> {
        let Some(unit) = defined(description, name) else { return Ok(()) };
        let (known, first) = self.0.entry(name.to_string()).or_insert_with(|| (unit.clone(), file.to_string()));
        if known.base == unit.base {
            return Ok(());
        }
        Err(ExportError::Unsupported(format!(
            "the unit of measure `{name}` is defined differently in {file} and {first}"
        )))
    }
}

/// The definition of a unit of measure in terms of SI units, the only kind that SSP has.
fn defined<'a>(description: &'a ModelDescription, name: &str) -> Option<&'a Unit> {
    description.unit(name).filter(|unit| unit.base.is_some())
}

type Wirable<'a> = HashMap<(Causality, BaseType, Reference), &'a Variable>;

/// Maps causality, type and value reference of a connected variable to the variable, or to the first of several
/// aliases.
fn wirable(description: &ModelDescription) -> Wirable<'_> {
    let mut wirable = HashMap::new();
    for variable in &description.variables {
        wirable.entry((variable.causality, variable.base_type, variable.reference)).or_insert(variable);
    }
    wirable
}

fn wired<'a>(
    wirable: &Wirable<'a>,
    planned: &run::Component,
    wire: &Wire,
    causality: Causality,
) -> Result<&'a Variable, ExportError> {
    wirable.get(&(causality, wire.base_type, wire.reference)).copied().ok_or_else(|| {
        let what = if causality == Causality::Input { "input" } else { "output" };
        ExportError::Unsupported(format!(
            "{}: the FMU has changed since the plan was made: it has no {what} {} {}",
            planned.fmu, wire.base_type, wire.reference
        ))
    })
}

fn connector(
    variable: &Variable,
    output: bool,
    description: &ModelDescription,
    component: &str,
) -> Result<Connector, ExportError> {
    reject(Some(variable), component)?;
    Ok(Connector {
        name: variable.name.clone(),
        output,
        base_type: variable.base_type,
        type_name: type_name(variable, description.fmi),
        unit: variable.unit.clone().filter(|name| defined(description, name).is_some()),
    })
}

fn type_name(variable: &Variable, fmi: FmiVersion) -> String {
    match fmi {
        FmiVersion::V2 => variable.base_type.to_string(),
        FmiVersion::V3 => variable.data_type.to_string(),
    }
}

fn reject(variable: Option<&Variable>, component: &str) -> Result<(), ExportError> {
    let why = match variable {
        Some(variable) if variable.element.is_some() => {
            "an element of an array, which no other master connects; only scalars can be written"
        }
        // Only enumerations have items.
        Some(variable) if !variable.items.is_empty() => {
            "an enumeration, which libcosim and Ecos do not read; only Integer can be written"
        }
        _ => return Ok(()),
    };
    let name = variable.map_or("", |variable| &variable.name);
    Err(ExportError::Unsupported(format!("`{component}:{name}` is {why}")))
}

fn file_name(fmu: &Path) -> Result<String, ExportError> {
    let name = fmu.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-' | '.');
    if name.chars().all(plain) {
        return Ok(name);
    }
    let rule = "the name of an FMU may hold letters, digits, `_`, `-` and `.` only, because it is part of a URI";
    Err(ExportError::Unsupported(format!("{name}: {rule}")))
}

fn text(plan: &Plan, run: &Run) -> String {
    let mut text = format!("{}: case {}", plan.title, run.case);
    if let Some(point) = &run.point {
        text += &format!(", point {point}");
    }
    if let Some(seed) = run.seed {
        text += &format!(", seed {seed}");
    }
    text
}

fn reject_foreign(folder: &Path, overwrite: bool) -> Result<(), ExportError> {
    let error = |cause| ExportError::Write { path: folder.to_path_buf(), cause };
    let entries = match std::fs::read_dir(folder) {
        Err(cause) if cause.kind() == io::ErrorKind::NotFound => return Ok(()),
        entries => entries.map_err(error)?,
    };
    let names: Vec<String> = entries
        .map(|entry| entry.map(|e| e.file_name().to_string_lossy().into_owned()))
        .collect::<io::Result<_>>()
        .map_err(error)?;
    let ours = |name: &&String| *name == OSP_STRUCTURE || name.ends_with(".fmu") || name.ends_with(".ssp");
    let hint = match names.iter().find(|name| !ours(name)) {
        Some(other) => format!(", and `{other}` is not from an earlier call; choose another folder"),
        None if names.is_empty() || (overwrite && names.iter().any(|name| name.ends_with(".ssp"))) => return Ok(()),
        None => "; `--overwrite` replaces an earlier system".to_string(),
    };
    Err(ExportError::Occupied { path: folder.to_path_buf(), hint })
}

/// Formats a number for XML Schema so that it reads back as the same double.
fn number(value: f64) -> String {
    format!("{value:?}")
}
