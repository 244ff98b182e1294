//! `cargo fmu inspect`: what an FMU says about itself.

use std::path::PathBuf;

use fmu_import::archive::Archive;
use fmu_import::description::{Causality, ModelDescription, Value};
use fmu_import::terminal::{indented, line};
use miette::{IntoDiagnostic, Result, WrapErr, miette};

use crate::output::{outln, write_file};
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

/// Path of an FMU given by name or path.
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
    let path = workspace.fmus().join(format!("{}.fmu", model.name));
    if !path.exists() {
        return Err(miette!("{} is not packed; run `cargo fmu pack {}`", model.name, model.name));
    }
    Ok(path)
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
    outln!("GUID       {}", line(&description.guid));
    outln!("made with  {}", line(description.generation_tool.as_deref().unwrap_or("unknown")));
    outln!("platforms  {}", archive.platforms().join(", "));
    outln!("supports   {}", capabilities(&description).join(", "));
    for (causality, title) in [
        (Causality::Input, "Inputs"),
        (Causality::Output, "Outputs"),
        (Causality::Parameter, "Parameters"),
        (Causality::CalculatedParameter, "Calculated parameters"),
        (Causality::Local, "Local variables"),
        (Causality::Independent, "Independent variable"),
    ] {
        table(&description, causality, title);
    }
    Ok(())
}

fn capabilities(description: &ModelDescription) -> Vec<&'static str> {
    let Some(co_simulation) = &description.co_simulation else { return vec!["no co-simulation"] };
    [
        (co_simulation.can_handle_variable_communication_step_size, "variable communication steps"),
        (co_simulation.can_get_and_set_fmu_state, "saved states"),
        (co_simulation.can_serialize_fmu_state, "serialized states"),
        (co_simulation.provides_directional_derivative, "directional derivatives"),
        (!co_simulation.can_be_instantiated_only_once_per_process, "several instances in a process"),
    ]
    .into_iter()
    .filter_map(|(can, what)| can.then_some(what))
    .collect()
}

fn table(description: &ModelDescription, causality: Causality, title: &str) {
    let rows: Vec<[String; 4]> = description
        .variables
        .iter()
        .filter(|variable| variable.causality == causality)
        .map(|variable| {
            [
                variable.name.clone(),
                variable.start.as_ref().map_or_else(String::new, value),
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

fn value(value: &Value) -> String {
    match value {
        Value::Real(number) => format!("{number}"),
        other => other.to_string(),
    }
}
