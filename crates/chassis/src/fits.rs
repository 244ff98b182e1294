//! `chassis fits`: which FMUs fit which plants by their signals.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use fmu_import::description::ModelDescription;
use fmu_import::names::suggestion;
use fmu_system::compat::{Fit, Systems, systems};
use fmu_system::resolve::{Descriptions, FmuFolder};
use miette::{Result, miette};

use cargo_fmu::out;

use crate::arguments::Folders;

/// Arguments of `chassis fits`. [`fmu_system::compat`] defines the terms.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Show only these plants and other FMUs
    names: Vec<String>,

    #[command(flatten)]
    fmus: Folders,

    /// List what is missing, and why, for every pair that does not fit
    #[arg(long)]
    missing: bool,
}

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let systems = systems(&descriptions(&arguments.fmus.places())?);
    if systems.plants.is_empty() {
        return Err(miette!("found no plant: only FMUs that work with any signal have continuous states"));
    }
    for name in &arguments.names {
        let mut known = systems.plants.iter().chain(&systems.components);
        if !known.any(|other| other == name) {
            let near = suggestion(name, systems.plants.iter().chain(&systems.components).map(String::as_str));
            let hint = near.map_or_else(String::new, |near| format!("; {near}"));
            return Err(miette!("there is no FMU named '{name}'{hint}"));
        }
    }
    let shown = |all: &[String]| -> Vec<usize> {
        let any = all.iter().any(|name| arguments.names.contains(name));
        (0..all.len()).filter(|i| !any || arguments.names.contains(&all[*i])).collect()
    };
    let (plants, components) = (shown(&systems.plants), shown(&systems.components));
    out!("{}", matrix(&systems, &plants, &components));
    if arguments.missing {
        out!("{}", missing(&systems, &plants, &components));
    }
    Ok(())
}

fn descriptions(folders: &[PathBuf]) -> Result<BTreeMap<String, Arc<ModelDescription>>> {
    let folder = FmuFolder::new(folders.iter().cloned());
    let mut found = BTreeMap::new();
    for name in folder.names() {
        let fmu = folder.find(&name).map_err(|message| miette!("{name}.fmu: {message}"))?;
        found.extend(fmu.map(|fmu| (name, fmu.description)));
    }
    if found.is_empty() {
        return Err(miette!("there is no FMU in {}; run `cargo fmu pack --all`", folder.place()));
    }
    Ok(found)
}

/// A table with one line per component and one column per plant.
fn matrix(systems: &Systems, plants: &[usize], components: &[usize]) -> String {
    let cell = |fit: &Fit| match fit {
        Fit::Fits => "fits".to_string(),
        Fit::Idle => "idle".to_string(),
        Fit::Lacks(missing) => format!("lacks {}", missing.len()),
    };
    let mut rows = vec![vec![String::new()]];
    rows[0].extend(plants.iter().map(|plant| systems.plants[*plant].clone()));
    rows.extend(components.iter().map(|component| {
        let cells = plants.iter().map(|plant| cell(&systems.fits[*component][*plant]));
        std::iter::once(systems.components[*component].clone()).chain(cells).collect()
    }));
    let widths: Vec<usize> =
        (0..=plants.len()).map(|i| rows.iter().map(|row| row[i].len()).max().unwrap_or(0)).collect();
    let mut text = String::new();
    for row in rows {
        let line: Vec<String> = row.iter().zip(&widths).map(|(cell, width)| format!("{cell:width$}")).collect();
        text += line.join("  ").trim_end();
        text.push('\n');
    }
    text
}

/// A paragraph per pair that does not fit.
fn missing(systems: &Systems, plants: &[usize], components: &[usize]) -> String {
    let mut text = String::new();
    for component in components {
        for plant in plants {
            let (name, vehicle) = (&systems.components[*component], &systems.plants[*plant]);
            match &systems.fits[*component][*plant] {
                Fit::Fits => (),
                Fit::Idle => {
                    text +=
                        &format!("\n{name}, {vehicle}: nothing that acts on {vehicle} reads the outputs of {name}\n")
                }
                Fit::Lacks(missing) => {
                    text += &format!("\n{name}, {vehicle}:\n");
                    missing.iter().for_each(|missing| text += &format!("  {missing}\n"));
                }
            }
        }
    }
    text
}
