//! Commands about systems of FMUs.

mod assess;
mod compat;
mod evaluate;
mod export;
mod folders;
mod jobs;
pub(crate) mod needed;
mod plan;
mod run;
mod selection;
pub(crate) mod starter;
mod study;

use fmu_system::data::DataError;
use fmu_system::resolve::ResolveError;
use miette::Result;

/// Commands for systems of several FMUs.
#[derive(clap::Subcommand, Debug)]
pub(crate) enum Command {
    /// Check a scenario and show its runs and its wiring
    ///
    /// Components without inputs are run briefly in a separate process, to find parameters that have no effect.
    Plan(plan::Arguments),
    /// Print the JSON Schema of plans, for programs that read the output of `cargo fmu plan --json`
    PlanSchema,
    /// Execute all runs of a scenario and write a CSV file for each
    Run(run::Arguments),
    /// Export a run of a scenario for other masters: an SSP package and a system structure for libcosim, with the FMUs
    ///
    /// DIR/NAME.ssp contains the structure with units of measure, the parameter sets and the FMUs, for Ecos, libcosim and
    /// OMSimulator. DIR/OspSystemStructure.xml is for libcosim; it is left out if a component is of FMI 3.0, which libcosim
    /// does not support. Constant inputs become start values, and recorded signals become connectors. Metrics and figures are
    /// not exported.
    ///
    /// Neither file defines the order of the components within a step: Ecos and libcosim step all components at once
    /// (`--order jacobi` of `cargo fmu run`).
    Export(export::Arguments),
    /// Optimize parameters of a scenario with PACSA, a genetic algorithm or CMA-ES
    ///
    /// For studies with method `optimize` and `[[parameter]]`. All other studies, those with `[[vary]]`, need Python: `scripts/study`
    /// runs sweeps, samples, sensitivity analyses and searches with the samplers of Optuna, on this machine or on a cluster.
    Study(study::Arguments),
    /// Drive a plant through standard maneuvers, without and with controllers, and compare
    ///
    /// Example: `cargo fmu assess EspCar --with DirectYawControl --with AntilockBraking`. Signals are connected by name. Maneuvers and
    /// metrics that need a signal the plant does not have are skipped. The assessment is written to OUT/assessment.json, the signals of runs
    /// to OUT/runs. The exit code is 1 if a limit of a regulation or of `--require` is missed or a run fails, and 2 if nothing could be run.
    /// The bench follows the procedures of standards; it does not certify anything.
    Assess(assess::Arguments),
    /// Show which FMUs fit which plants by their signals
    ///
    /// A plant is an FMU with continuous states. An FMU that writes inputs of one with more states is an actuator instead. A
    /// block whose signals have no units, and names that no other FMU has, is not a plant either. An output connects to the
    /// input of the same name, type and unit of measure.
    ///
    /// An FMU that is not a plant fits a plant under two conditions: the plant or other fitting FMUs write all of its inputs,
    /// and it writes an input of the plant or of an FMU that acts on the plant. `idle` marks an FMU whose inputs are written
    /// but whose outputs do not act on the plant. `lacks 3` marks one with three inputs that nothing writes; a scenario can set
    /// them to constants. Other plants are ignored.
    ///
    /// Matching signals are not enough: a controller may contain parameters of another vehicle, and an output that nothing
    /// reads has no effect.
    Compat(compat::Arguments),
    /// Compute the metrics of a standard maneuver from recorded signals, and print them as JSON
    ///
    /// The recording is a CSV file, plain or compressed with gzip, from a measurement or any simulator. Its first line contains the names of
    /// the columns: `time` (s), and signals with the names of the library, in SI units or in the units that the file gives: `Speed [km/h]`,
    /// or a line of units below the names. `--vehicle` maps other names. Other columns are ignored. A metric that cannot be computed is null;
    /// the reasons go to standard error. The exit code is 2 if the file cannot be used.
    Evaluate(evaluate::Arguments),
}

/// True if a file of data cannot be used and nothing was run.
pub(crate) fn is_about_data(report: &miette::Report) -> bool {
    let resolved = report.downcast_ref::<ResolveError>();
    report.downcast_ref::<DataError>().is_some() || matches!(resolved, Some(ResolveError::Data(_)))
}

/// Carries out a command.
pub(crate) fn run(command: &Command) -> Result<()> {
    match command {
        Command::Plan(arguments) => plan::run(arguments),
        Command::PlanSchema => plan::print_schema(),
        Command::Run(arguments) => run::run(arguments),
        Command::Export(arguments) => export::run(arguments),
        Command::Study(arguments) => study::run(arguments),
        Command::Assess(arguments) => assess::run(arguments),
        Command::Compat(arguments) => compat::run(arguments),
        Command::Evaluate(arguments) => evaluate::run(arguments),
    }
}
