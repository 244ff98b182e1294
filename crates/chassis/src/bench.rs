//! `chassis bench`: drives standard maneuvers, or evaluates recorded ones.

pub(crate) mod evaluate;
pub(crate) mod run;

#[derive(clap::Subcommand, Debug)]
pub(crate) enum Command {
    /// Drive a plant through standard maneuvers, without and with controllers, and compare
    ///
    /// Example: `chassis bench run EspCar --with DirectYawControl --with AntilockBraking`. Signals are connected by
    /// name. Maneuvers and metrics that need a signal the plant does not have are skipped. The assessment is written to
    /// OUT/assessment.json, the signals of runs to OUT/runs. The exit code is 1 if a limit of a regulation or of
    /// `--require` is missed or a run fails, and 2 if nothing could be run. The bench follows the procedures of
    /// standards; it does not certify anything.
    Run(Box<run::Arguments>),
    /// Compute the metrics of a standard maneuver from recorded signals, and print them as JSON
    ///
    /// The recording is a CSV file, plain or compressed with gzip, from a measurement or any simulator. Its first line
    /// contains the names of the columns: `time` (s), and signals with the names of the library, in SI units or in the
    /// units that the file gives: `Speed [km/h]`, or a line of units below the names. `--vehicle` maps other names.
    /// Other columns are ignored. A metric that cannot be computed is null; the reasons go to standard error. The exit
    /// code is 2 if the file cannot be used.
    Evaluate(evaluate::Arguments),
}
