//! `chassis`: plans and runs systems of FMUs, runs studies, and drives vehicles through standard maneuvers.

mod arguments;
mod bench;
mod compare;
mod converge;
mod export;
mod fits;
mod import;
mod lab;
mod new;
mod plan;
mod python;
mod run;
mod schema;
mod selection;
mod study;

use cargo_fmu::{errors, linearize, out, outln, pack, trim, worker};
use clap::{CommandFactory as _, Parser};
use fmu_system::data::DataError;
use fmu_system::resolve::{ResolveError, fmu_names};
use miette::{IntoDiagnostic as _, Result, miette};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

const RENAMED: [(&str, &str); 4] =
    [("assess", "bench run"), ("evaluate", "bench evaluate"), ("compat", "fits"), ("plan-schema", "schema plan")];

const EXIT_CODES: &str = "Exit codes:
  0  success
  1  a run failed, a requirement or limit is not met, or a file has a mistake
  2  wrong usage, unusable data, or nothing could be run";

const JOBS: [worker::Job; 3] = [
    (fmu_linear::worker::JOB, fmu_linear::worker::serve),
    (fmu_system::worker::JOB, fmu_system::worker::serve),
    (python::FMPY, python::serve_fmpy),
];

/// Run systems of FMUs, studies, and a test bench for vehicles and their controllers
#[derive(Parser, Debug)]
#[command(name = "chassis", bin_name = "chassis", version, after_help = EXIT_CODES)]
enum Cli {
    /// Check a scenario and show its runs and its wiring
    ///
    /// Components without inputs are run briefly in a separate process, to find parameters that have no effect.
    Plan(plan::Arguments),
    /// Run a scenario, and write signals, tables and a page
    ///
    /// Each run has a CSV file in OUT/SCENARIO/runs. Tables, figures and the page index.html need the Python package
    /// `chassis_fmu`. The exit code is 1 if a run fails or a requirement is not met.
    Run(run::Arguments),
    /// Export a run of a scenario for other masters: an SSP package and a system structure for libcosim, with the FMUs
    ///
    /// DIR/NAME.ssp contains the structure with units of measure, the parameter sets and the FMUs, for Ecos, libcosim
    /// and OMSimulator. DIR/OspSystemStructure.xml is for libcosim; it is left out of systems that libcosim does not
    /// support. Constant inputs become start values, and recorded signals become connectors. Metrics and figures are
    /// not exported.
    ///
    /// Neither file defines the order of the components within a step: Ecos and libcosim step all components at once
    /// (`--order jacobi` of `chassis run`).
    Export(export::Arguments),
    /// Import a system of another tool: write the system in an SSP file as a scenario, with its FMUs
    ///
    /// SSP 1.0 and 2.0 are supported. Nested systems are flattened. What a scenario cannot express is reported with its
    /// place in the file, and nothing is written. `chassis plan` and `chassis run` also take the SSP file itself.
    Import(import::Arguments),
    /// Run a study: a scenario many times with varying values, or a search for the best parameters
    ///
    /// Studies with `[[vary]]` are sweeps, samples, sensitivity analyses and searches with the samplers of Optuna, on
    /// this machine or on a cluster; they need the Python package `chassis_fmu`. Studies with `[[parameter]]` search
    /// with PACSA, a genetic algorithm or CMA-ES; only their page needs the package. The exit code is 1 if a
    /// requirement is not met or nothing feasible was found, and 2 if the study could not run.
    Study(study::Arguments),
    /// Test bench: drive standard maneuvers, or evaluate recorded ones
    #[command(subcommand)]
    Bench(bench::Command),
    /// Compare a simulated signal with a measured one: errors, correlation, time shift, tolerance and tube
    ///
    /// Prints JSON with sorted keys; a metric that does not exist, such as the correlation with a constant, is null.
    /// The simulation is linear between its rows. Only samples of the measurement within the time of the simulation
    /// count, all with the same weight; nothing is resampled or aligned.
    Compare(compare::Arguments),
    /// Show which FMUs fit which plants by their signals
    ///
    /// A plant is an FMU with continuous states. An FMU that writes inputs of an FMU with more states is an actuator
    /// instead. A block whose signals have no units, and names that no other FMU has, is not a plant either. An output
    /// connects to the input of the same name, type and unit of measure.
    ///
    /// An FMU that is not a plant fits a plant under two conditions: the plant or other fitting FMUs write all of its
    /// inputs, and it writes an input of the plant or of an FMU that acts on the plant. `idle` marks an FMU whose
    /// inputs are written but whose outputs do not act on the plant. `lacks 3` marks an FMU with three inputs that
    /// nothing writes; a scenario can set them to constants. Other plants are ignored.
    ///
    /// Matching signals are not enough: a controller may contain parameters of another vehicle, and an output that
    /// nothing reads has no effect.
    Fits(fits::Arguments),
    /// Pack the FMUs that a scenario or study needs, as far as the current workspace has their models
    ///
    /// FMUs that are up to date are left out.
    Pack {
        /// Scenario or study file (TOML)
        file: PathBuf,
        #[command(flatten)]
        settings: pack::Settings,
    },
    /// Write a short scenario for a plant, ready to run
    New(new::Arguments),
    /// Build the lab, a static site that simulates vehicles and controllers in a browser
    Lab {
        /// Options of `scripts/lab`
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        options: Vec<String>,
    },
    /// Print a completion script for a shell
    ///
    /// For bash: chassis completions bash > ~/.local/share/bash-completion/completions/chassis
    Completions {
        /// Shell
        shell: clap_complete::Shell,
    },
    /// Print the JSON Schema of a format
    Schema {
        /// Format
        format: schema::Format,
    },
    /// `cargo fmu linearize`, for the Python package
    #[command(hide = true)]
    Linearize(linearize::Arguments),
    /// `cargo fmu trim`, for the Python package
    #[command(hide = true)]
    Trim(trim::Arguments),
    /// Execute FMUs for another command
    #[command(hide = true)]
    Worker(worker::Arguments),
}

fn main() -> Result<()> {
    errors::install()?;
    if let Some((old, new)) = RENAMED.iter().find(|(old, _)| std::env::args().nth(1).is_some_and(|given| given == *old))
    {
        return Err(miette!("`chassis {old}` is called `chassis {new}` now"));
    }
    let command = Cli::parse();
    // A worker uses the temporary folders of the process that started it.
    if !matches!(command, Cli::Worker(_)) {
        fmu_import::temporary::remove_on_signals().into_diagnostic()?;
    }
    let result = run(&command);
    if let Err(report) = &result
        && is_about_data(report)
    {
        // The exit code is the same as for wrong arguments, because nothing was run.
        eprintln!("Error: {report:?}");
        std::process::exit(2);
    }
    result
}

fn is_about_data(report: &miette::Report) -> bool {
    let resolved = report.downcast_ref::<ResolveError>();
    report.downcast_ref::<DataError>().is_some() || matches!(resolved, Some(ResolveError::Data(_)))
}

fn run(command: &Cli) -> Result<()> {
    match command {
        Cli::Plan(arguments) => plan::run(arguments),
        Cli::Run(arguments) => run::run(arguments),
        Cli::Export(arguments) => export::run(arguments),
        Cli::Import(arguments) => import::run(arguments),
        Cli::Compare(arguments) => Ok(compare::run(arguments)?),
        Cli::Study(arguments) => study::run(arguments),
        Cli::Bench(bench::Command::Run(arguments)) => bench::run::run(arguments),
        Cli::Bench(bench::Command::Evaluate(arguments)) => bench::evaluate::run(arguments),
        Cli::Fits(arguments) => fits::run(arguments),
        Cli::Pack { file, settings } => pack::pack_needed(&fmus(file)?, settings),
        Cli::New(arguments) => new::run(arguments),
        Cli::Lab { options } => lab::run(options),
        Cli::Completions { shell } => {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut Cli::command(), "chassis", &mut script);
            out!("{}", String::from_utf8_lossy(&script));
            Ok(())
        }
        Cli::Schema { format } => {
            outln!("{}", format.text()?);
            Ok(())
        }
        Cli::Linearize(arguments) => linearize::run(arguments),
        Cli::Trim(arguments) => trim::run(arguments),
        Cli::Worker(arguments) => worker::run(arguments, &JOBS),
    }
}

/// Names of the FMUs in a scenario, or in the scenario of a study.
fn fmus(file: &Path) -> Result<BTreeSet<String>> {
    if !fmu_study::study::is_study(file) {
        return Ok(fmu_names(file)?);
    }
    let (scenario, mut fmus) = fmu_study::study::needs(file)?;
    fmus.append(&mut fmu_names(&scenario)?);
    Ok(fmus)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn arguments_are_consistent() {
        Cli::command().debug_assert();
    }
}
