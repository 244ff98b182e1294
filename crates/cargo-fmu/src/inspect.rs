//! `cargo fmu inspect`: what an FMU says about itself.

use std::path::PathBuf;

use fmu_import::archive::Archive;
use fmu_import::description::{Causality, FmiVersion, ModelDescription};
use fmu_import::terminal::{indented, line};
use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::output::{outln, write_file};
use crate::variables;
use crate::workspace::Workspace;

/// Which FMU.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Name of an FMU of this workspace (packed before), or path of any .fmu file
    fmu: String,
    /// Prints modelDescription.xml as it is
    #[arg(long)]
    xml: bool,
}

/// Path of an FMU given by name or path. A model that is packed for FMI 2.0 and 3.0 is found as FMI 2.0.
///
/// # Errors
/// On a name that is no model, or an FMU that was not packed yet.
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

/// Prints.
///
/// # Errors
/// When the file is no FMU.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let path = locate(&arguments.fmu)?;
    let mut archive = Archive::open(&path).into_diagnostic()?;
    if arguments.xml {
        write_file(&archive.description_text().into_diagnostic()?);
        return Ok(());
    }
    let description = archive.description().into_diagnostic()?;
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
    outln!("platforms       {}", archive.platforms().join(", "));
    for (interface, capabilities) in interfaces(&description) {
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
        table(&description, causality, title);
    }
    opaque(&description);
    Ok(())
}

/// The interfaces of an FMU, each with its capabilities.
fn interfaces(description: &ModelDescription) -> Vec<(&'static str, Vec<String>)> {
    let named = |capabilities: &[(bool, &str)]| -> Vec<String> {
        capabilities.iter().filter(|(can, _)| *can).map(|(_, what)| (*what).to_owned()).collect()
    };
    let mut interfaces = Vec::new();
    if let Some(unit) = &description.co_simulation {
        let mut capabilities = named(&[
            (unit.can_handle_variable_communication_step_size, "variable communication steps"),
            (unit.can_get_and_set_fmu_state, "saved states"),
            (unit.can_serialize_fmu_state, "serialized states"),
            (unit.provides_directional_derivative, "directional derivatives"),
            (unit.provides_adjoint_derivatives, "adjoint derivatives"),
            (unit.has_event_mode, "event mode"),
            (!unit.can_be_instantiated_only_once_per_process, "several instances in a process"),
        ]);
        if let Some(step) = unit.fixed_internal_step_size {
            capabilities.push(format!("internal steps of {step} s"));
        }
        interfaces.push(("co-simulation", capabilities));
    }
    if let Some(unit) = &description.model_exchange {
        let mut capabilities = vec![
            format!("continuous states: {}", description.number_of_states()),
            format!("event indicators: {}", description.number_of_event_indicators),
        ];
        capabilities.extend(named(&[
            (unit.can_get_and_set_fmu_state, "saved states"),
            (unit.can_serialize_fmu_state, "serialized states"),
            (unit.provides_directional_derivative, "directional derivatives"),
            (unit.provides_adjoint_derivatives, "adjoint derivatives"),
            (!unit.can_be_instantiated_only_once_per_process, "several instances in a process"),
        ]));
        interfaces.push(("model exchange", capabilities));
    }
    if description.has_scheduled_execution {
        interfaces.push(("scheduled execution", vec!["not supported".to_owned()]));
    }
    interfaces
}

/// Variables that this command neither reads nor sets.
fn opaque(description: &ModelDescription) {
    let variables = &description.opaque_variables;
    if variables.is_empty() {
        return;
    }
    outln!("\nBinary and Clock variables, not supported ({})", variables.len());
    let width = variables.iter().map(|variable| variable.name.chars().count()).max().unwrap_or(0);
    for variable in variables {
        let (name, text) = (line(&variable.name), variable.description.as_deref().unwrap_or_default());
        outln!("  {name:width$}  {}  {}", variable.data_type, line(text));
    }
}

fn table(description: &ModelDescription, causality: Causality, title: &str) {
    let rows: Vec<[String; 4]> = description
        .variables
        .iter()
        .filter(|variable| variable.causality == causality)
        .map(|variable| {
            [
                format!("{}{}", variable.name, variables::lengths(variable)),
                variables::start(variable),
                variable.unit.clone().unwrap_or_default(),
                variable.description.clone().unwrap_or_default(),
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
