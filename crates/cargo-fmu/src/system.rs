//! Commands about systems of FMUs.

mod compat;
mod export;
mod folders;
mod jobs;
pub(crate) mod needed;
mod plan;
mod run;
mod selection;
mod study;

use miette::Result;

/// What to do with a system.
#[derive(clap::Subcommand, Debug)]
pub(crate) enum Command {
    /// Checks a scenario and shows what it runs and how it is wired
    ///
    /// Components without inputs are run alone for a moment, in a process of their own, to find parameters without an effect.
    Plan(plan::Arguments),
    /// Prints the JSON Schema of plans, for programs that read what `plan --json` prints
    PlanSchema,
    /// Executes all runs of a scenario and writes a CSV file for each
    Run(run::Arguments),
    /// Writes a run of a scenario for other masters: an SSP file and a system structure of libcosim, with the FMUs
    ///
    /// OUT/NAME.ssp holds the structure with units of measure, parameter sets and the FMUs, for Ecos, libcosim and
    /// OMSimulator; OUT/OspSystemStructure.xml is for libcosim. Inputs that keep one value are start values. Neither file
    /// says in which order the components of a step follow each other: Ecos and libcosim step all at once (`--order jacobi`
    /// of `cargo fmu run`). What is recorded becomes a connector; metrics and figures are left out.
    Export(export::Arguments),
    /// Searches parameters of a scenario as a study describes
    Study(study::Arguments),
    /// Shows which FMUs fit which plants by their signals
    ///
    /// A plant is an FMU with continuous states, unless it writes inputs of one with more states: then it is an actuator.
    /// Signals go from an output to an input of the same name, type and unit of measure. Every FMU that is no plant fits a
    /// plant if all its inputs are written by the plant or by others that are supplied this way, and if it writes an input
    /// of the plant or of another one that acts on it. `idle`: supplied, but it acts on nothing. `lacks 3`: nothing writes
    /// three of its inputs; in a scenario constants may stand in for them. Other plants never count.
    ///
    /// That signals fit does not say that a law suits a vehicle: vehicle data in it may have to be changed, and outputs that
    /// nothing reads go nowhere.
    Compat(compat::Arguments),
}

/// Carries out a command.
pub(crate) fn run(command: &Command) -> Result<()> {
    match command {
        Command::Plan(arguments) => plan::run(arguments),
        Command::PlanSchema => plan::print_schema(),
        Command::Run(arguments) => run::run(arguments),
        Command::Export(arguments) => export::run(arguments),
        Command::Study(arguments) => study::run(arguments),
        Command::Compat(arguments) => compat::run(arguments),
    }
}
