//! `chassis bench evaluate`: metrics of recorded signals.

use std::path::PathBuf;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser as _};
use fmu_assess::evaluators::{self, EVALUATORS, reference};
use fmu_assess::signals::unit;
use fmu_assess::vehicle::VehicleFile;
use fmu_assess::{Evaluator, Metric, Reading, Reason, Resample, Trace, Value};
use fmu_import::limits;
use fmu_import::names::suggestion;
use fmu_system::data::DataError;
use miette::{Result, miette};

use cargo_fmu::{errln, out, outln};

const EXAMPLES: &str = "\
Examples:
  chassis bench evaluate step_steer run.csv
  chassis bench evaluate sine_with_dwell measured.csv.gz --options '{\"steer.ratio\": 16}'
  chassis bench evaluate braking measured.csv --vehicle logger.toml --resample
  chassis bench evaluate cones --list";

/// Maximum number of metrics that are listed by name if they are null for the same reason.
const SHOWN: usize = 6;

/// Arguments of `chassis bench evaluate`.
#[derive(clap::Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Name of the evaluator
    #[arg(value_name = "NAME", required_unless_present = "list", value_parser = parser())]
    evaluator: Option<&'static Evaluator>,

    /// CSV file of the recording, plain or compressed with gzip
    ///
    /// Delimiter, decimal mark, encoding and units are detected.
    #[arg(required_unless_present = "list")]
    trace: Option<PathBuf>,

    /// TOML file with names and units of signals
    ///
    /// Only the table `signals` of a file for `chassis bench run --vehicle` is used. Its key `time` names the time
    /// column.
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,

    /// Interpolate unevenly spaced rows, every SECONDS or, without a value, at their median distance
    #[arg(long, value_name = "SECONDS", num_args = 0..=1, require_equals = true, default_missing_value = "median", value_parser = resample)]
    resample: Option<Resample>,

    /// Options of the evaluator, as a JSON object
    #[arg(long, value_name = "JSON", default_value = "{}")]
    options: String,

    /// List the columns, options and metric definitions of one evaluator or of all, and evaluate nothing
    #[arg(long)]
    list: bool,
}

/// Accepts the names of evaluators, and shows their titles.
fn parser() -> impl clap::builder::TypedValueParser<Value = &'static Evaluator> {
    let names = EVALUATORS.iter().map(|evaluator| PossibleValue::new(evaluator.name).help(evaluator.title));
    PossibleValuesParser::new(names)
        .try_map(|name| evaluators::find(&name).ok_or_else(|| format!("there is no evaluator {name}")))
}

fn resample(text: &str) -> std::result::Result<Resample, String> {
    if text == "median" {
        return Ok(Resample::Median);
    }
    let step = text.parse().ok().filter(|step: &f64| step.is_finite() && *step > 0.0);
    step.map(Resample::Step).ok_or_else(|| "expected a time above 0, in s".to_owned())
}

/// Prints the metrics as JSON. Reasons go to the standard error.
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
        miette!(help = r#"Write a JSON object in single quotes, such as '{"steer.ratio": 16}'."#, "--options: {error}")
    })?;
    let file = path.display().to_string();
    let bytes = limits::read_bytes(path, limits::INPUT_FILE).map_err(|error| {
        let help = "give the path of a CSV file, plain or compressed with gzip".to_owned();
        DataError::new(&file, format!("the file cannot be read: {error}"), Some(help))
    })?;
    let mut reading = Reading { resample: arguments.resample, ..Reading::default() };
    if let Some(path) = &arguments.vehicle {
        let text = std::fs::read_to_string(path).map_err(|error| miette!("{}: {error}", path.display()))?;
        let vehicle = VehicleFile::parse(&text).map_err(|error| miette!("{}: {error}", path.display()))?;
        (reading.names, reading.units) = (vehicle.signals, vehicle.units);
        for name in reading.names.keys().chain(reading.units.keys()).filter(|name| *name != "time") {
            check_signal(name).map_err(|message| miette!("{}: [signals] {message}", path.display()))?;
        }
    }
    let (trace, notes) = Trace::read(&file, &bytes, evaluator.columns, &reading)?;
    let evaluation = evaluator.evaluate(&trace, &options).map_err(|error| {
        let list = format!("`chassis bench evaluate {} --list` shows all options.", evaluator.name);
        miette!(help = format!("{} {list}", error.help.as_deref().unwrap_or_default()), "--options: {error}")
    })?;
    for note in notes.iter().chain(&evaluation.notes) {
        errln!("note: {note}");
    }
    report_nulls(&evaluation.metrics);
    outln!("{}", evaluation.to_json());
    Ok(())
}

/// Checks the name of a signal in a vehicle file. If no evaluator reads the signal, prints only a note, because the
/// name may be meant for `chassis bench run`.
fn check_signal(name: &str) -> std::result::Result<(), String> {
    if name.contains('*') {
        return Err(format!("has a pattern, `{name}`: name each signal"));
    }
    if unit(name).is_some() {
        return Ok(());
    }
    let known = EVALUATORS.iter().flat_map(|evaluator| evaluator.columns).map(|column| column.name);
    match suggestion(name, known) {
        Some(near) => Err(format!("has an unknown signal, `{name}`; {near}")),
        None => {
            errln!("note: [signals] has `{name}`, which no evaluator reads");
            Ok(())
        }
    }
}

/// Reports why metrics are null, once for each reason.
fn report_nulls(metrics: &[Metric]) {
    let mut reasons: Vec<(&Reason, Vec<&str>)> = Vec::new();
    for metric in metrics {
        let Value::Null(reason) = &metric.value else { continue };
        match reasons.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, names)) => names.push(&metric.name),
            None => reasons.push((reason, vec![&metric.name])),
        }
    }
    for (reason, names) in &reasons {
        match names[..] {
            [name] => errln!("note: {name} is null: {reason}"),
            [first, .., last] if names.len() > SHOWN => {
                errln!("note: {} metrics, from {first} to {last}, are null: {reason}", names.len());
            }
            _ => errln!("note: {} are null: {reason}", names.join(", ")),
        }
    }
    if reasons.iter().map(|(_, names)| names.len()).sum::<usize>() == metrics.len() {
        errln!("warning: no metric has a value");
    }
}
