//! `cargo fmu evaluate`: metrics of recorded signals.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser as _};
use fmu_assess::evaluators::{self, EVALUATORS, reference};
use fmu_assess::{Evaluator, Trace, Value};
use miette::{Result, miette};

use crate::output::{errln, out, outln};

/// Shown below the options.
const EXAMPLES: &str = "\
Examples:
  cargo fmu evaluate step_steer run.csv
  cargo fmu evaluate sine_with_dwell measured.csv.gz --options '{\"steer.ratio\": 16}'
  cargo fmu evaluate cones --list";

/// Arguments of `cargo fmu evaluate`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Evaluator
    #[arg(value_name = "NAME", required_unless_present = "list", value_parser = parser())]
    evaluator: Option<&'static Evaluator>,

    /// CSV file of the recording, plain or compressed with gzip
    #[arg(required_unless_present = "list")]
    trace: Option<PathBuf>,

    /// Options of the evaluator as an object of JSON
    #[arg(long, value_name = "JSON", default_value = "{}")]
    options: String,

    /// Prints columns, options and definitions of the metrics instead, of one evaluator or of all
    #[arg(long)]
    list: bool,
}

/// Accepts the names of evaluators, and shows their titles.
fn parser() -> impl clap::builder::TypedValueParser<Value = &'static Evaluator> {
    let names = EVALUATORS.iter().map(|evaluator| PossibleValue::new(evaluator.name).help(evaluator.title));
    PossibleValuesParser::new(names)
        .try_map(|name| evaluators::find(&name).ok_or_else(|| format!("there is no evaluator {name}")))
}

/// Prints the metrics as JSON. Reasons go to the standard error.
///
/// # Errors
/// When the file cannot be read, is not a recording, or the options are not allowed.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    if arguments.list {
        match arguments.evaluator {
            Some(evaluator) => out!("{}", reference([evaluator])),
            None => out!("{}", reference(&EVALUATORS)),
        }
        return Ok(());
    }
    let (Some(evaluator), Some(path)) = (arguments.evaluator, &arguments.trace) else {
        return Err(miette!("an evaluator and a recording are needed"));
    };
    let options = serde_json::from_str(&arguments.options).map_err(|error| {
        miette!(
            help = "Write an object of JSON, in quotes of the shell: --options '{{\"steer.ratio\": 16}}'.",
            "--options: {error}"
        )
    })?;
    let place = || path.display().to_string();
    let bytes = std::fs::read(path).map_err(|error| {
        miette!(
            help = "Give the path of a CSV file, plain or compressed with gzip.",
            "{} cannot be read: {error}",
            place()
        )
    })?;
    let trace = Trace::read(&bytes).map_err(|error| miette!(help = error.help(), "{}: {error}", place()))?;
    let evaluation = evaluator.evaluate(&trace, &options).map_err(|error| {
        let list = format!("`cargo fmu evaluate {} --list` shows all options.", evaluator.name);
        miette!(help = format!("{} {list}", error.help()), "--options: {error}")
    })?;
    for metric in &evaluation.metrics {
        if let Value::Null(reason) = &metric.value {
            errln!("note: {} is null: {reason}", metric.name);
        }
    }
    outln!("{}", evaluation.to_json());
    Ok(())
}
