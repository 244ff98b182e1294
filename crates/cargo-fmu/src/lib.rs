//! The command `cargo fmu`: packs models into FMUs, inspects, checks and linearizes FMUs, creates models.
//!
//! The command `chassis`, for systems of FMUs, shares the public modules.

mod build;
mod check;
mod documentation;
pub mod errors;
pub mod files;
mod inspect;
mod licenses;
pub mod linearize;
mod new;
mod operating_point;
pub mod output;
pub mod pack;
mod platform;
mod toolchain;
pub mod trim;
mod variables;
mod wasm32;
mod win64;
pub mod worker;
pub mod workspace;
mod zigbuild;

use clap::Parser;
use miette::{IntoDiagnostic as _, miette};

const MOVED: [(&str, &str); 11] = [
    ("system", "chassis export"),
    ("systems", "chassis fits"),
    ("tune", "chassis study"),
    ("plan", "chassis plan"),
    ("plan-schema", "chassis schema plan"),
    ("run", "chassis run"),
    ("export", "chassis export"),
    ("study", "chassis study"),
    ("assess", "chassis bench run"),
    ("evaluate", "chassis bench evaluate"),
    ("compat", "chassis fits"),
];

const JOBS: [worker::Job; 2] =
    [(fmu_check::worker::JOB, fmu_check::worker::serve), (fmu_linear::worker::JOB, fmu_linear::worker::serve)];

/// Export models as FMUs, and examine FMUs
#[derive(Parser, Debug)]
#[command(name = "cargo fmu", bin_name = "cargo fmu", version)]
enum Cli {
    /// Build models and pack them into FMUs, target/fmu/NAME.fmu
    Pack(pack::Arguments),
    /// Show an FMU's metadata and variables
    Inspect(inspect::Arguments),
    /// Validate FMUs from any tool: the description by the rules of FMI 2.0 or 3.0, the binary by its behavior
    ///
    /// The binary is loaded and run in a separate process, on Linux in a sandbox, so a crash is reported as a finding.
    /// The check covers start values, repeated runs, the whole default experiment, another start time, two instances,
    /// reset, saved states, dependencies, and whatever else the description promises. Model exchange is run with a
    /// built-in solver: states, derivatives, event indicators and events.
    ///
    /// Each finding belongs to one of two questions: does the FMU simulate, and does it follow the standard? The exit
    /// code is 1 if errors were found; `--fail-on` selects the question that counts. The default experiment is cut
    /// short after `--timeout`, with a note. Results that differ but should not are a note up to 1e-12 of the peak
    /// (rounding), a warning up to the tolerance of the default experiment (1e-4 without one), and an error above.
    Check(check::Arguments),
    /// Linearize an FMU at an operating point: modes, A, B, C, D, Bode plots
    Linearize(linearize::Arguments),
    /// Find the steady state of an FMU at an operating point, and the drive torques that hold it
    ///
    /// Newton's method with the exact Jacobian of the FMU finds the values at which the derivatives of all states
    /// vanish, to 1e-10 of the nominal value per second. States that only integrate other states, such as position and
    /// heading, drift and keep their start values. A state given by `--set` is held, and a free input (`--free`) keeps
    /// it there. The speed of a plant with pedals is always held. Its drive torques share one free value unless you set
    /// them. Without a steady state, the command prints a state that keeps changing and exits with 1.
    Trim(trim::Arguments),
    /// Create a package with a working model
    New(new::Arguments),
    /// Execute FMUs for another command
    #[command(hide = true)]
    Worker(worker::Arguments),
}

/// Runs the command with the arguments of this process.
pub fn main() -> miette::Result<()> {
    errors::install()?;
    // Cargo passes the name of the subcommand as the first argument.
    let arguments = std::env::args_os().enumerate().filter(|(i, argument)| *i != 1 || argument != "fmu");
    let arguments: Vec<_> = arguments.map(|(_, argument)| argument).collect();
    if let Some((old, new)) = MOVED.iter().find(|(old, _)| arguments.get(1).is_some_and(|given| given == old)) {
        return Err(miette!("`cargo fmu {old}` is called `{new}` now"));
    }
    let command = Cli::parse_from(arguments);
    // A worker uses the temporary folders of the process that started it.
    if !matches!(command, Cli::Worker(_)) {
        fmu_import::temporary::remove_on_signals().into_diagnostic()?;
    }
    match command {
        Cli::Pack(arguments) => pack::run(&arguments),
        Cli::Inspect(arguments) => inspect::run(&arguments),
        Cli::Check(arguments) => check::run(&arguments),
        Cli::Linearize(arguments) => linearize::run(&arguments),
        Cli::Trim(arguments) => trim::run(&arguments),
        Cli::New(arguments) => new::run(&arguments),
        Cli::Worker(arguments) => worker::run(&arguments, &JOBS),
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
