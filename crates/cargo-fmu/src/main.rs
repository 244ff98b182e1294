//! `cargo fmu`: packs models into FMUs, inspects, compares and linearizes them, writes new ones from a template, plans and
//! runs scenarios, writes them for other masters, and tunes parameters.

mod build;
mod check;
mod documentation;
mod errors;
mod inspect;
mod licenses;
mod linearize;
mod needed;
mod new;
mod output;
mod pack;
mod plan;
mod platform;
mod run;
mod selection;
mod system;
mod systems;
mod tune;
mod win64;
mod worker;
mod workspace;
mod zigbuild;

use clap::Parser;
use miette::IntoDiagnostic as _;

/// Exports models as FMUs and runs systems of them
#[derive(Parser, Debug)]
#[command(name = "cargo fmu", bin_name = "cargo fmu", version)]
enum Cli {
    /// Builds models and packs them to target/fmu/NAME.fmu
    Pack(pack::Arguments),
    /// Shows what an FMU says of itself
    Inspect(inspect::Arguments),
    /// Judges FMUs of any origin: the description by the rules of FMI 2.0, the binary by what it does
    ///
    /// The binary is loaded and run in a process of its own, so a crash is one more finding: start values, repeated runs, two instances, reset, saved states,
    /// dependencies, and whatever else the description promises. Ends with 1 if there are errors.
    Check(check::Arguments),
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
    Systems(systems::Arguments),
    /// Prints A, B, C, D and the modes of a plant at an operating point
    Linearize(linearize::Arguments),
    /// Writes a working package of a new model
    New(new::Arguments),
    /// Checks a scenario and shows what it runs and how it is wired
    ///
    /// Components without inputs are run alone for a moment, in a process of their own, to find parameters without an effect.
    Plan(plan::Arguments),
    /// Executes all runs of a scenario and writes a CSV file for each
    Run(run::Arguments),
    /// Writes a run of a scenario for other masters: an SSP file and a system structure of libcosim, with the FMUs
    ///
    /// OUT/NAME.ssp holds the structure with units of measure, parameter sets and the FMUs, for Ecos, libcosim and
    /// OMSimulator; OUT/OspSystemStructure.xml is for libcosim. Inputs that keep one value are start values. Neither file
    /// says in which order the units of a step follow each other: Ecos and libcosim step all at once (`--order jacobi`
    /// of `cargo fmu run`). What is recorded becomes a connector; metrics and figures are left out.
    System(system::Arguments),
    /// Tunes parameters of a scenario as a study says
    Tune(tune::Arguments),
    /// Executes FMUs for another command
    #[command(hide = true)]
    Worker(worker::Arguments),
}

fn main() -> miette::Result<()> {
    errors::install()?;
    // As a subcommand of cargo the program gets its own name as the first argument.
    let arguments = std::env::args_os().enumerate().filter(|(i, argument)| *i != 1 || argument != "fmu");
    let command = Cli::parse_from(arguments.map(|(_, argument)| argument));
    // The temporary folders of a worker are those of the process that started it.
    if !matches!(command, Cli::Worker(_)) {
        fmu_import::temporary::remove_on_signals().into_diagnostic()?;
    }
    match command {
        Cli::Pack(arguments) => pack::run(&arguments),
        Cli::Inspect(arguments) => inspect::run(&arguments),
        Cli::Check(arguments) => check::run(&arguments),
        Cli::Systems(arguments) => systems::run(&arguments),
        Cli::Linearize(arguments) => linearize::run(&arguments),
        Cli::New(arguments) => new::run(&arguments),
        Cli::Plan(arguments) => plan::run(&arguments),
        Cli::Run(arguments) => run::run(&arguments),
        Cli::System(arguments) => system::run(&arguments),
        Cli::Tune(arguments) => tune::run(&arguments),
        Cli::Worker(arguments) => worker::run(&arguments),
    }
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
