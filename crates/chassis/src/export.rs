//! `chassis export`: writes a run of a scenario for other masters.

use clap::Args;
use fmu_import::description::Value;
use fmu_import::names::suggestion;
use fmu_system::export::System;
use fmu_system::plan::Plan;
use fmu_system::resolve::{Options, resolve};
use fmu_system::run::Run;
use miette::{IntoDiagnostic, miette};
use std::path::{Path, PathBuf};

use crate::arguments::Folders;
use crate::selection::find_steady_starts;
use cargo_fmu::worker;
use cargo_fmu::{errln, outln};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Scenario file (TOML)
    scenario: PathBuf,

    #[command(flatten)]
    fmus: Folders,

    /// Case to export [default: the first]
    #[arg(long, value_name = "NAME")]
    case: Option<String>,

    /// Point of the sweep to export [default: the first]
    #[arg(long, value_name = "NAME")]
    point: Option<String>,

    /// Seed of the scenario to export [default: the first]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    seed: Option<i32>,

    /// Override the scenario's stop time, in seconds
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    stop: Option<f64>,

    /// Folder for the files; it must be empty or not exist
    #[arg(long, value_name = "DIR")]
    out: PathBuf,

    /// Replace the files of an earlier export
    #[arg(long)]
    overwrite: bool,
}

pub(crate) fn run(arguments: &Arguments) -> miette::Result<()> {
    let options = Options { stop: arguments.stop, ..Options::default() };
    let plan = resolve(&arguments.scenario, &arguments.fmus.source(), &options)?;
    let mut run = chosen(&plan, arguments)?.clone();
    find_steady_starts(&plan.simulation, std::slice::from_mut(&mut run), &worker::Options::default())?;
    let system = System::new(&plan, &run).into_diagnostic()?;
    let files = system.write(&arguments.out, arguments.overwrite).into_diagnostic()?;
    outln!("run {} for other masters, step {:?} s, until {:?} s:", run.id, system.step, system.stop);
    for file in files {
        outln!("  {}", file.display());
    }
    for note in system.notes() {
        errln!("note: {note}");
    }
    for component in &run.components {
        for setting in &component.parameters {
            // The path is absolute, because the resolver has made it so.
            if let Value::String(path) = &setting.value
                && Path::new(path).is_absolute()
                && Path::new(path).is_file()
            {
                let name = format!("{}:{}", component.name, setting.name);
                errln!("note: `{name}` is {path}, a file on this machine that the export does not contain");
            }
        }
    }
    Ok(())
}

/// Returns the run with the given case, point and seed. The default of each is the first.
fn chosen<'a>(plan: &'a Plan, arguments: &Arguments) -> miette::Result<&'a Run> {
    let known = |what: &str, wanted: Option<&String>, names: Vec<String>| match wanted {
        Some(name) if !names.contains(name) => {
            let hint = match suggestion(name, names.iter().map(String::as_str)) {
                Some(hint) => hint,
                None if names.is_empty() => "it has none".to_string(),
                None => format!("it has {}", names.join(", ")),
            };
            Err(miette!("{} has no {what} `{name}`; {hint}", plan.file))
        }
        _ => Ok(()),
    };
    let seed = arguments.seed.map(|seed| seed.to_string());
    known("case", arguments.case.as_ref(), plan.cases.iter().map(|c| c.name.clone()).collect())?;
    known("point", arguments.point.as_ref(), plan.points.iter().map(|p| p.name.clone()).collect())?;
    known("seed", seed.as_ref(), plan.seeds.iter().map(i32::to_string).collect())?;
    let fits = |run: &&Run| {
        arguments.case.as_ref().is_none_or(|case| run.case == *case)
            && arguments.point.as_ref().is_none_or(|point| run.point.as_ref() == Some(point))
            && arguments.seed.is_none_or(|seed| run.seed == Some(seed))
    };
    // Every case runs at every point with every seed.
    plan.runs.iter().find(fits).ok_or_else(|| miette!("{} has no runs", plan.file))
}
