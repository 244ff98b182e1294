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
    /// Components without inputs are run alone for a moment, in a separate process, to find parameters without an effect.
    Plan(plan::Arguments),
    /// Print the JSON Schema of plans, for programs that read the output of `plan --json`
    PlanSchema,
    /// Execute all runs of a scenario and write a CSV file for each
    Run(run::Arguments),
    /// Write a run of a scenario for other masters: an SSP file and a system structure of libcosim, with the FMUs
    ///
    /// OUT/NAME.ssp holds the structure with units of measure, parameter sets and the FMUs, for Ecos, libcosim and
    /// OMSimulator; OUT/OspSystemStructure.xml is for libcosim. Inputs that keep one value are start values. Neither file
    /// says in which order the components of a step follow each other: Ecos and libcosim step all at once (`--order jacobi`
    /// of `cargo fmu run`). What is recorded becomes a connector; metrics and figures are left out.
    Export(export::Arguments),
    /// Tune parameters of a scenario as a study describes, by PACSA, a genetic algorithm or CMA-ES
    ///
    /// For studies of method `optimize` with `[[parameter]]`. All other studies, with `[[vary]]`, need Python: `scripts/study`
    /// carries out sweeps, samples, sensitivities and searches by samplers of Optuna, here or on a cluster.
    Study(study::Arguments),
    /// Drive a plant through standard maneuvers, without and with controllers, and compare
    ///
    /// `cargo fmu assess EspCar --with DirectYawControl --with AntilockBraking`. Signals are wired by name; what a plant does not have
    /// leaves out the maneuvers and numbers that need it. Writes OUT/assessment.json and the signals of runs to OUT/runs. Ends with
    /// 1 if a limit of a regulation or of --require is not kept, with 2 if nothing could be run. The bench follows the procedures of
    /// standards; it certifies nothing.
    Assess(assess::Arguments),
    /// Show which FMUs fit which plants by their signals
    ///
    /// A plant is an FMU with continuous states, unless it writes inputs of one with more states: then it is an actuator.
    /// A block whose signals have no units, and names that no other FMU has, is not a plant either.
    /// An output connects to the input of the same name, type and unit of measure. An FMU that is not a plant fits a plant
    /// under two conditions: the plant or other fitting FMUs write all of its inputs, and it writes an input of the plant or
    /// of an FMU that acts on the plant. `idle` marks an FMU whose inputs are written but that acts on nothing. `lacks 3`
    /// marks one with three inputs that nothing writes; a scenario can set them to constants. Other plants are ignored.
    ///
    /// Matching signals are not enough: a controller may contain parameters of another vehicle, and an output that nothing
    /// reads has no effect.
    Compat(compat::Arguments),
    /// Compute the metrics of a standard maneuver from recorded signals, and print them as JSON
    ///
    /// The recording is a CSV file, plain or compressed with gzip, of a simulation, a measurement or another simulator. Its first line has
    /// the names of the columns: `time` (s), and signals by the names of the library, in SI units or those that the file gives: `Speed
    /// [km/h]`, or a line of units below the names. --vehicle renames columns. Other columns are ignored. A metric that cannot be computed
    /// is null; the reasons go to the standard error. Exit code 2 if the file cannot be used.
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
