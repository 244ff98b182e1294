//! `cargo fmu inspect`: metadata and variables of an FMU.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use fmu_import::archive::{Archive, ArchiveError};
use fmu_import::description::{
    Causality, Clock, DataType, FmiVersion, Interface, ModelDescription, Terminal, TerminalMember, Variable,
};
use fmu_import::terminal::{indented, line};
use fmu_import::xml::{self, Element};
use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::outln;
use crate::output::write_file;
use crate::variables;
use crate::workspace::Workspace;

/// Arguments of `cargo fmu inspect`.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Name of a packed FMU of this workspace, or path of any .fmu file
    fmu: String,
    /// Print modelDescription.xml instead of the summary
    #[arg(long)]
    xml: bool,
}

/// Path of an FMU given by name or path. A model that is packed for FMI 2.0 and 3.0 is found as FMI 2.0.
pub(crate) fn locate(fmu: &str) -> Result<PathBuf> {
    let path = PathBuf::from(fmu);
    // A name has neither extension nor folder.
    if path.extension().is_some() || path.components().count() > 1 {
        return if path.exists() { Ok(path) } else { Err(miette!("there is no file {fmu}")) };
    }
    let workspace = Workspace::find().wrap_err_with(|| format!("looking for the model {fmu}"))?;
    let model = workspace.select(&[fmu.to_owned()], false)?.remove(0);
    let found = [workspace.fmus(), workspace.fmus_of_fmi3()].into_iter();
    let found = found.map(|folder| folder.join(format!("{}.fmu", model.name))).find(|path| path.exists());
    found.ok_or_else(|| miette!("{} is not packed; run `cargo fmu pack {}`", model.name, model.name))
}

/// The readable text of a description, and the problem with the archive, if any.
struct Opened {
    text: String,
    platforms: Vec<String>,
    terminals: Result<Vec<Terminal>, ArchiveError>,
    problem: Option<ArchiveError>,
}

/// Opens an FMU. An FMU that other commands reject is still read if its description is in the right place.
fn open(path: &Path) -> Result<Opened, ArchiveError> {
    const NAME: &str = "modelDescription.xml";
    let lossy = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    match Archive::open(path) {
        Ok(mut archive) => {
            let platforms = archive.platforms();
            match archive.description_text() {
                Ok(text) => Ok(Opened { text, platforms, terminals: archive.terminals(), problem: None }),
                // The description is too large, or not UTF-8.
                Err(error) => match archive.entry(NAME) {
                    Ok(Some(bytes)) if bytes.len() <= xml::MAX_BYTES => {
                        Ok(Opened { text: lossy(bytes), platforms, terminals: Ok(Vec::new()), problem: Some(error) })
                    }
                    _ => Err(error),
                },
            }
        }
        Err(error) => {
            let read = || -> Option<Vec<u8>> {
                let mut zip = zip::ZipArchive::new(File::open(path).ok()?).ok()?;
                let mut bytes = Vec::new();
                zip.by_name(NAME).ok()?.take(xml::MAX_BYTES as u64).read_to_end(&mut bytes).ok()?;
                Some(bytes)
            };
            match read() {
                Some(bytes) => {
                    let (platforms, terminals) = (Vec::new(), Ok(Vec::new()));
                    Ok(Opened { text: lossy(bytes), platforms, terminals, problem: Some(error) })
                }
                None => Err(error),
            }
        }
    }
}

/// Prints metadata and variables. If other commands reject the FMU, prints the readable part first, then fails.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let path = locate(&arguments.fmu)?;
    let Opened { text, platforms, terminals, problem } = open(&path).into_diagnostic()?;
    let unusable = |problem: Option<String>| match problem {
        None => Ok(()),
        Some(problem) => Err(miette!("other commands cannot use this FMU: {problem}")),
    };
    let problem = problem.map(|error| error.to_string());
    if arguments.xml {
        write_file(&text);
        return unusable(problem);
    }
    match ModelDescription::parse(&text) {
        Ok(description) => {
            show(&description, &platforms);
            let terminals = terminals.into_diagnostic()?;
            if !terminals.is_empty() {
                outln!("\nTerminals ({})", terminals.len());
                terminals.iter().for_each(|terminal| show_terminal(terminal, 2));
            }
            unusable(problem)
        }
        Err(error) => {
            let problem = problem.unwrap_or_else(|| format!("{}: modelDescription.xml: {error}", path.display()));
            // A file that is not XML has no elements to show.
            let root = xml::parse(&text).map_err(|_| miette!("{problem}"))?;
            show_elements(&root, &platforms);
            unusable(Some(problem))
        }
    }
}

/// Prints the elements of a description that breaks rules of FMI or has another version.
fn show_elements(root: &Element, platforms: &[String]) {
    let text = |element: &Element, name: &str| line(element.attribute(name).unwrap_or("-")).into_owned();
    outln!("{}", text(root, "modelName"));
    outln!("FMI             {}", text(root, "fmiVersion"));
    outln!("made with       {}", text(root, "generationTool"));
    outln!("platforms       {}", platforms.join(", "));
    for element in root.children.iter().filter(|element| element.attribute("modelIdentifier").is_some()) {
        outln!("{:14}  {}", line(&element.name), text(element, "modelIdentifier"));
    }
    let variables = root.child("ModelVariables").map_or(&[][..], |variables| &variables.children);
    let name = |variable: &Element| text(variable, "name");
    let width = variables.iter().map(|variable| name(variable).chars().count()).max().unwrap_or(0);
    outln!("\nVariables ({})", variables.len());
    for variable in variables {
        let causality = line(variable.attribute("causality").unwrap_or("local"));
        let description = line(variable.attribute("description").unwrap_or_default()).into_owned();
        outln!("  {:width$}  {causality:19}  {description}", name(variable));
    }
}

fn show(description: &ModelDescription, platforms: &[String]) {
    let version = description.version.as_deref().unwrap_or_default();
    outln!("{} {}", line(&description.model_name), line(version));
    if let Some(text) = &description.description {
        outln!("{}", indented(text, "  "));
    }
    let token = match description.fmi {
        FmiVersion::V2 => "GUID",
        FmiVersion::V3 => "token",
    };
    outln!("FMI             {}", line(&description.fmi_version));
    outln!("{token:14}  {}", line(&description.guid));
    outln!("made with       {}", line(description.generation_tool.as_deref().unwrap_or("unknown")));
    outln!("platforms       {}", platforms.join(", "));
    for (interface, capabilities) in interfaces(description) {
        outln!("{interface:14}  {}", if capabilities.is_empty() { "-".to_owned() } else { capabilities.join(", ") });
    }
    for (causality, title) in [
        (Causality::Input, "Inputs"),
        (Causality::Output, "Outputs"),
        (Causality::StructuralParameter, "Structural parameters"),
        (Causality::Parameter, "Parameters"),
        (Causality::CalculatedParameter, "Calculated parameters"),
        (Causality::Local, "Local variables"),
        (Causality::Independent, "Independent variable"),
    ] {
        table(description, causality, title);
    }
    clocks(description);
}

fn interfaces(description: &ModelDescription) -> Vec<(String, Vec<String>)> {
    let mut interfaces = Vec::new();
    for interface in description.interfaces() {
        let mut capabilities = match interface {
            Interface::CoSimulation | Interface::ScheduledExecution => Vec::new(),
            Interface::ModelExchange => vec![
                format!("continuous states: {}", description.number_of_states()),
                format!("event indicators: {}", description.number_of_event_indicators),
            ],
        };
        if let Some(unit) = description.interface(interface) {
            let named = [
                (unit.can_handle_variable_communication_step_size, "variable communication steps"),
                (unit.can_get_and_set_fmu_state, "saved states"),
                (unit.can_serialize_fmu_state, "serialized states"),
                (unit.provides_directional_derivative, "directional derivatives"),
                (unit.provides_adjoint_derivatives, "adjoint derivatives"),
                (unit.has_event_mode, "event mode"),
                (unit.provides_intermediate_update, "intermediate updates"),
                (unit.can_return_early_after_intermediate_update, "early return at intermediate updates"),
                (!unit.can_be_instantiated_only_once_per_process, "several instances in a process"),
            ];
            capabilities.extend(named.iter().filter(|(can, _)| *can).map(|(_, what)| (*what).to_owned()));
            capabilities.extend(unit.fixed_internal_step_size.map(|step| format!("internal steps of {step} s")));
        }
        interfaces.push((interface.to_string(), capabilities));
    }
    interfaces
}

/// Prints the clocks with their kinds.
fn clocks(description: &ModelDescription) {
    let clocks = &description.clocks;
    if clocks.is_empty() {
        return;
    }
    outln!("\nClocks ({})", clocks.len());
    let kind = |clock: &Clock| {
        let (causality, kind) = (format!("{:?}", clock.causality).to_lowercase(), clock.interval_variability);
        match clock.interval {
            Some(interval) => format!("{causality}, {kind}, {interval} s"),
            None => format!("{causality}, {kind}"),
        }
    };
    let width = |of: &dyn Fn(&Clock) -> usize| clocks.iter().map(of).max().unwrap_or(0);
    let (width, of_kind) = (width(&|clock| clock.name.chars().count()), width(&|clock| kind(clock).chars().count()));
    for clock in clocks {
        let (name, text) = (line(&clock.name), clock.description.as_deref().unwrap_or_default());
        outln!("  {name:width$}  {:of_kind$}  {}", kind(clock), line(text));
    }
}

/// Prints a terminal with its members: their names in the terminal, and their variables if these have other names.
fn show_terminal(terminal: &Terminal, indent: usize) {
    let Terminal { name, matching_rule, kind, description, members, terminals } = terminal;
    let kind = kind.as_ref().map_or_else(String::new, |kind| format!(", {kind}"));
    let text = format!("{name} ({matching_rule}{kind})  {}", description.as_deref().unwrap_or_default());
    outln!("{:indent$}{}", "", line(text.trim_end()));
    for TerminalMember { variable, name, kind } in members {
        let name = name.as_ref().filter(|name| *name != variable).map_or_else(String::new, |name| format!("{name} = "));
        let kind = if kind == "signal" { String::new() } else { format!(" [{kind}]") };
        outln!("{:indent$}  {}", "", line(&format!("{name}{variable}{kind}")));
    }
    terminals.iter().for_each(|terminal| show_terminal(terminal, indent + 2));
}

/// The description, with the properties that only FMI 3.0 has in brackets: type, content of a Binary, other name,
/// clocks.
fn described(description: &ModelDescription, variable: &Variable) -> String {
    use DataType::{Binary, Boolean, Enumeration, Float64, Int32, String as Text};
    let mut properties = Vec::new();
    if let Some(of) = variable.alias_of {
        properties.push(format!("alias of `{}`", description.variables[of].name));
    }
    if !matches!(variable.data_type, Float64 | Int32 | Boolean | Text | Enumeration) {
        properties.push(variable.data_type.to_string());
    }
    if variable.data_type == Binary {
        properties.push(variable.mime_type().to_owned());
        properties.extend(variable.max_size.map(|size| format!("at most {size} bytes")));
    }
    if !variable.clocks.is_empty() {
        let of = |clock: &&Clock| variable.clocks.contains(&clock.reference);
        let names: Vec<_> = description.clocks.iter().filter(of).map(|clock| format!("`{}`", clock.name)).collect();
        properties.push(format!("{} {}", if names.len() == 1 { "clock" } else { "clocks" }, names.join(", ")));
    }
    let text = variable.description.clone().unwrap_or_default();
    match properties.is_empty() {
        true => text,
        false => format!("{text} [{}]", properties.join(", ")).trim_start().to_owned(),
    }
}

fn table(description: &ModelDescription, causality: Causality, title: &str) {
    let rows: Vec<[String; 4]> = description
        .of(causality)
        .map(|variable| {
            [
                format!("{}{}", variable.name, variables::lengths(variable)),
                variables::start(variable),
                variable.unit.clone().unwrap_or_default(),
                described(description, variable),
            ]
            .map(|cell| line(&cell).into_owned())
        })
        .collect();
    if rows.is_empty() {
        return;
    }
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
    let (name, start, unit) = (width(0), width(1), width(2));
    outln!("\n{title} ({})", rows.len());
    for row in &rows {
        outln!("  {:name$}  {:>start$} {:unit$}  {}", row[0], row[1], row[2], row[3]);
    }
}
