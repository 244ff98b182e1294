//! `chassis compare`: compares a simulated signal with a measured one.

use cargo_fmu::outln;
use clap::Args;
use fmu_assess::json;
use fmu_system::comparison::{Comparison, Samples, Tube};
use fmu_system::data::unit::Target;
use fmu_system::data::{Channel, DataError, Duplicates, Format, Signal, Table, TimeColumn};
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// CSV file of the simulation, plain or compressed with gzip
    simulated: PathBuf,

    /// CSV file of the measurement, the reference
    measured: PathBuf,

    /// Column in both files
    #[arg(long, value_name = "NAME")]
    signal: String,

    /// Column in the file of the measurement, if it has another name there
    #[arg(long, value_name = "NAME")]
    column: Option<String>,

    /// Unit of the results, and of options; columns with another unit in their file are converted
    #[arg(long)]
    unit: Option<String>,

    /// Tolerance of `share_within`: absolute, or absolute and relative (1 for 100 %)
    #[arg(long, value_name = "ABSOLUTE[,RELATIVE]", value_parser = tolerance)]
    tolerance: Option<[f64; 2]>,

    /// Tube around the measurement: half width in s and half height, or one number for both relative to its extent
    #[arg(long, value_name = "WIDTH,HEIGHT", value_parser = tube)]
    tube: Option<Tube>,

    /// Interval of the measurement, in s
    #[arg(long, value_name = "FROM,TO", value_parser = window, allow_hyphen_values = true)]
    window: Option<[f64; 2]>,

    /// Largest time shift that is tried for `shift`, in s
    #[arg(long, value_name = "T", value_parser = positive)]
    max_shift: Option<f64>,
}

fn numbers(text: &str) -> Result<Vec<f64>, String> {
    let number = |part: &str| part.trim().parse().ok().filter(|number: &f64| number.is_finite());
    text.split(',').map(|part| number(part).ok_or_else(|| format!("`{part}` is not a number"))).collect()
}

fn positive(text: &str) -> Result<f64, String> {
    let [number] = numbers(text)?[..] else { return Err("give one number".to_owned()) };
    if number > 0.0 { Ok(number) } else { Err("must be above 0".to_owned()) }
}

fn tolerance(text: &str) -> Result<[f64; 2], String> {
    match numbers(text)?[..] {
        [absolute] if absolute >= 0.0 => Ok([absolute, 0.0]),
        [absolute, relative] if absolute.min(relative) >= 0.0 => Ok([absolute, relative]),
        _ => Err("give one or two numbers that are not below 0".to_owned()),
    }
}

fn tube(text: &str) -> Result<Tube, String> {
    match numbers(text)?[..] {
        [part] if part >= 0.0 => Ok(Tube::Relative(part)),
        [width, height] if width.min(height) >= 0.0 => Ok(Tube::Size(width, height)),
        _ => Err("give one or two numbers that are not below 0".to_owned()),
    }
}

fn window(text: &str) -> Result<[f64; 2], String> {
    match numbers(text)?[..] {
        [from, to] if from < to => Ok([from, to]),
        _ => Err("give two numbers, the lesser one first".to_owned()),
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), DataError> {
    let Arguments { simulated, measured, signal, column, unit, tolerance, tube, window, max_shift } = arguments;
    let comparison = Comparison { window: *window, tolerance: *tolerance, tube: *tube, max_shift: *max_shift };
    let target = unit.as_deref().map(Target::named);
    let (simulated, own) = read(simulated, signal, target.clone())?;
    // Without --unit, the measurement gets the unit of the simulation.
    let (measured, _) = read(measured, column.as_ref().unwrap_or(signal), target.or(own))?;
    let [simulated, measured] =
        [&simulated, &measured].map(|signal| Samples { times: &signal.times, values: &signal.values });
    let metrics = comparison.metrics(simulated, measured);
    let mut document = serde_json::json!(metrics);
    document["samples"] = metrics["samples"].map(|count| count as u64).into();
    outln!("{:#}", json::all_rounded(&document));
    Ok(())
}

/// The samples of a column, and the unit that the file gives it.
fn read(path: &Path, column: &str, target: Option<Target>) -> Result<(Signal, Option<Target>), DataError> {
    let table = Table::read(path, &Format::default())?;
    let clock = table.times(&TimeColumn { duplicates: Duplicates::Jump, ..TimeColumn::default() })?;
    let unit = table.columns().iter().find(|known| known.name == column).and_then(|known| known.unit.as_deref());
    let signal = table.signal(&clock, &Channel::new(column), &target.unwrap_or_default())?;
    Ok((signal, unit.map(Target::named)))
}
