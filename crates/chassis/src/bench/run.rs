//! `chassis bench run`: standard maneuvers for a plant, without and with controllers.

use clap::Args;
use fmu_assess::assess::{Options, Shown, assess};
use fmu_assess::report::{Assessment, Judgment, Row, Verdict};
use fmu_assess::vehicle::VehicleFile;
use fmu_assess::{ACTUATORS, SetupError, Subject, Suite};
use fmu_import::description::{Causality, Value};
use fmu_import::parameter_set::{Parameter, ParameterSet};
use fmu_system::resolve::{Descriptions, FmuFolder, fmus_with};
use miette::{IntoDiagnostic, WrapErr, miette};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use crate::arguments::{Folders, Jobs, one_of, source};
use crate::python::{self, Python};
use crate::run::progress_bar;
use cargo_fmu::files::{try_to_write, write_whole};
use cargo_fmu::worker;
use cargo_fmu::{errln, outln};

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Plant: name of an FMU in the folder, or path of an .fmu file
    plant: String,

    /// Controller to assess: the plant is compared without and with all controllers; may be repeated
    #[arg(long, value_name = "NAME", value_parser = placed)]
    with: Vec<Placed>,

    /// FMU that belongs to the vehicle, such as its brakes; may be repeated [default: BrakeAndDriveActuators for a
    /// plant with brake and drive torques]
    #[arg(long, value_name = "NAME", value_parser = placed)]
    base: Vec<Placed>,

    /// Group of maneuvers; may be repeated [default: all that the plant supports]
    #[arg(long, value_name = "SUITE", value_parser = one_of(&SUITES))]
    suite: Vec<Suite>,

    #[command(flatten)]
    fmus: Folders,

    /// Set a parameter, such as esp_car:body.mass=1300 or "esp_car:body.mass=1300 kg"; may be repeated
    ///
    /// The component is the name of the FMU in snake case, `driver` or `road`.
    #[arg(long, value_name = "COMPONENT:PARAMETER=VALUE", value_parser = setting)]
    set: Vec<(String, String, String)>,

    /// SSP parameter set with parameters named component.parameter; `--set` takes precedence
    #[arg(long, value_name = "FILE")]
    parameters: Option<PathBuf>,

    /// TOML file with data of the vehicle and the names of its signals; values override the built-in vehicle data
    ///
    /// These are the tables `vehicle` and `signals`.
    #[arg(long, value_name = "FILE")]
    vehicle: Option<PathBuf>,

    /// Speed of the handling and ride maneuvers, in km/h [default: 80 for cars, 60 for trucks]
    #[arg(long, value_name = "SPEED", value_parser = speed)]
    speed: Option<f64>,

    /// End the sine-with-dwell series after the first unstable runs
    #[arg(long)]
    quick: bool,

    /// Give the driver model each system's understeer gradient instead of that of the vehicle without controllers
    #[arg(long)]
    adapt: bool,

    /// Require a metric to meet a limit, such as iso3888_2.max_entry_speed=50; may be repeated
    ///
    /// The limit, in the unit of the metric, is a minimum if more is better and a maximum if less is better.
    #[arg(long, value_name = "METRIC=VALUE", value_parser = requirement)]
    require: Vec<(String, f64)>,

    /// Folder for results [default: results/assess_PLANT]
    #[arg(long, value_name = "OUT")]
    out: Option<PathBuf>,

    /// Make no page
    #[arg(long, conflicts_with = "report_only")]
    no_page: bool,

    /// Make only the page, from the existing results
    #[arg(long)]
    report_only: bool,

    /// Also write the assessment to this file, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,

    /// Also write the verdicts to this file, as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,

    #[command(flatten)]
    jobs: Jobs,

    #[command(flatten)]
    workers: worker::Options,
}

const SUITES: [(&str, &str, Suite); 5] = [
    ("handling", "Steady state and response to steering", Suite::Handling),
    ("stability", "Sine with dwell and double lane changes", Suite::Stability),
    ("rollover", "Fishhook and J-turn", Suite::Rollover),
    ("braking", "Braking straight ahead, on split friction and in a turn", Suite::Braking),
    ("ride", "Ride on rough roads", Suite::Ride),
];

/// The name of an FMU, and its position among the options `--with` and `--base`.
#[derive(Debug, Clone)]
struct Placed {
    name: String,
    place: usize,
}

fn placed(text: &str) -> Result<Placed, String> {
    // Values are parsed in the order of the command line.
    static NEXT: AtomicUsize = AtomicUsize::new(0);
    Ok(Placed { name: text.to_owned(), place: NEXT.fetch_add(1, Ordering::Relaxed) })
}

fn setting(text: &str) -> Result<(String, String, String), String> {
    let parts = text.split_once(':').and_then(|(component, rest)| {
        let (name, value) = rest.split_once('=')?;
        Some((component.to_owned(), name.to_owned(), value.to_owned()))
    });
    parts.ok_or_else(|| "expected COMPONENT:PARAMETER=VALUE, such as esp_car:body.mass=1300".to_owned())
}

/// The values in a parameter set. Each has a component, a parameter, and a value with its unit.
fn parameters(path: &Path) -> miette::Result<Vec<(String, String, String)>> {
    let set = ParameterSet::read(path).into_diagnostic()?;
    let value = |parameter: &Parameter| match (&parameter.value, &parameter.unit) {
        (Value::Real(value), Some(unit)) => format!("{value:?} {unit}"),
        (other, _) => other.text(),
    };
    let split = |parameter: Parameter| {
        let (component, name) = parameter.name.split_once('.').ok_or_else(|| {
            let name = &parameter.name;
            miette!("{}: `{name}` names no component, expected COMPONENT.PARAMETER", path.display())
        })?;
        Ok((component.to_owned(), name.to_owned(), value(&parameter)))
    };
    set.parameters.into_iter().map(split).collect()
}

fn requirement(text: &str) -> Result<(String, f64), String> {
    let parts = text.split_once('=').and_then(|(name, value)| Some((name.to_owned(), value.parse::<f64>().ok()?)));
    parts.ok_or_else(|| "expected METRIC=VALUE, such as iso3888_2.max_entry_speed=50".to_owned())
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse().ok().filter(|speed: &f64| (1.0..=300.0).contains(speed));
    speed.ok_or_else(|| "expected a speed from 1 to 300 km/h".to_owned())
}

/// Name of an FMU. If it is given as a path, its folder is inserted before the other folders.
fn named(name: &str, folders: &mut Vec<PathBuf>) -> String {
    let path = Path::new(name);
    if path.extension().is_none_or(|extension| extension != "fmu") {
        return name.to_owned();
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folders.iter().any(|known| known == folder) {
        folders.insert(0, folder.to_path_buf());
    }
    path.file_stem().map_or_else(|| name.to_owned(), |stem| stem.to_string_lossy().into_owned())
}

/// Assesses the plant, and makes a page. The exit code is 1 if a limit is exceeded or a run failed, 2 if nothing could
/// be run.
pub(crate) fn run(arguments: &Arguments) -> miette::Result<()> {
    if arguments.report_only {
        let python = Python::required("a page")?;
        return page(arguments, &python, 0);
    }
    let python = if arguments.no_page { None } else { Python::find_or_note() };
    let code = match carried_out(arguments) {
        Ok(assessment) if !assessment.has_run() => {
            errln!("Error: nothing could be run: the reasons are above");
            2
        }
        Ok(assessment) => i32::from(!assessment.is_passed()),
        Err(error) => {
            errln!("Error: {error:?}");
            2
        }
    };
    match python {
        Some(python) if code != 2 => page(arguments, &python, code),
        _ if code == 0 => Ok(()),
        _ => python::exit(code),
    }
}

fn out(arguments: &Arguments) -> PathBuf {
    let plant = named(&arguments.plant, &mut Vec::new());
    arguments.out.clone().unwrap_or_else(|| Path::new("results").join(format!("assess_{plant}")))
}

/// Makes the page, and ends with this exit code.
fn page(arguments: &Arguments, python: &Python, code: i32) -> miette::Result<()> {
    let folder = std::path::absolute(out(arguments)).into_diagnostic()?.display().to_string();
    let command = python::command_without(&["--report-only"]);
    match python.call("assess", &[folder, command], None)?.max(code) {
        0 => Ok(()),
        code => python::exit(code),
    }
}

fn carried_out(arguments: &Arguments) -> miette::Result<Assessment> {
    let mut places = arguments.fmus.places();
    let mut order = Vec::new();
    let mut all = |units: &[Placed]| {
        let names: Vec<String> = units.iter().map(|unit| named(&unit.name, &mut places)).collect();
        order.extend(units.iter().map(|unit| unit.place).zip(names.clone()));
        names
    };
    let with = all(&arguments.with);
    let base = all(&arguments.base);
    order.sort();
    let order = order.into_iter().map(|(_, name)| name).collect();
    let plant = named(&arguments.plant, &mut places);
    let vehicle = match &arguments.vehicle {
        None => VehicleFile::of_library(&plant),
        Some(path) => {
            let text = std::fs::read_to_string(path).into_diagnostic();
            let text = text.wrap_err_with(|| format!("cannot read {}", path.display()))?;
            let file = VehicleFile::parse(&text).map_err(|error| miette!("{}: {error}", path.display()))?;
            let takes_part = |fmu: &String| with.contains(fmu) || base.contains(fmu) || fmu == ACTUATORS;
            for fmu in file.controllers.keys().filter(|fmu| !takes_part(fmu)) {
                errln!(
                    "note: {}: the table [signals.{fmu}] is not used, because {fmu} does not take part",
                    path.display()
                );
            }
            file.over(VehicleFile::of_library(&plant))
        }
    };
    let out = out(arguments);
    let mut set = arguments.parameters.as_deref().map_or(Ok(Vec::new()), parameters)?;
    set.retain(|(component, name, _)| !arguments.set.iter().any(|(of, own, _)| (of, own) == (component, name)));
    set.extend(arguments.set.iter().cloned());
    let subject = Subject { plant, base, with, set, order, vehicle };
    let options = Options {
        suites: arguments.suite.clone(),
        speed: arguments.speed.map(|speed| speed / 3.6),
        is_quick: arguments.quick,
        adapts: arguments.adapt,
        required: arguments.require.clone(),
        jobs: arguments.jobs.count(),
    };
    let (bar, lines) = progress_bar(&subject.plant, "{pos}/{len} maneuvers {elapsed}")?;
    let settings = arguments.workers.settings(lines, options.jobs)?;
    let progress = |done: usize, total: usize, runs: usize| {
        bar.set_length(total as u64);
        bar.set_position(done as u64);
        bar.set_message(format!("{} ({runs} runs)", subject.plant));
    };
    let source = source(&places);
    try_to_write(&out)?;
    let result = assess(&subject, &source, &options, &settings, &progress);
    bar.finish_and_clear();
    let (assessment, shown) = result.map_err(|error: SetupError| match error.help.clone() {
        Some(help) => miette!(help = help, "{error}"),
        None => miette!("{error}"),
    })?;
    write(&assessment, &shown, &out, arguments)?;
    print(&assessment, &source);
    outln!("{}", out.join("assessment.json").display());
    Ok(assessment)
}

/// Smallest time between two rows of the written signals, s. It is short enough for figures.
const SPACING: f64 = 0.01;
/// Smallest time between two rows in ride maneuvers, s. It is shorter, because their spectra extend to 100 Hz.
const SPACING_OF_RIDE: f64 = 0.004;

fn write(assessment: &Assessment, shown: &Shown, out: &Path, arguments: &Arguments) -> miette::Result<()> {
    let json = assessment.to_json();
    write_whole(&out.join("assessment.json"), json.as_bytes())?;
    if let Some(path) = &arguments.json {
        write_whole(path, json.as_bytes())?;
    }
    if let Some(path) = &arguments.junit {
        write_whole(path, assessment.to_junit().as_bytes())?;
    }
    let runs = out.join("runs");
    if runs.exists() {
        std::fs::remove_dir_all(&runs).into_diagnostic().wrap_err_with(|| format!("removing {}", runs.display()))?;
    }
    for (system, run, trace) in shown {
        let names: Vec<&str> = trace.names().collect();
        let columns: Vec<&[f64]> = names.iter().filter_map(|name| trace.column(name)).collect();
        let times = trace.times();
        let spacing = times.first().zip(times.get(1)).map_or(SPACING, |(first, second)| second - first);
        let wanted = if run.starts_with("ride") { SPACING_OF_RIDE } else { SPACING };
        let every = (wanted / spacing).round().max(1.0) as usize;
        let mut text = format!("time,{}\n", names.join(","));
        for row in (0..times.len()).step_by(every) {
            let _ = write!(text, "{:.6}", times[row]);
            for column in &columns {
                let _ = write!(text, ",{:.6e}", column[row]);
            }
            text.push('\n');
        }
        write_whole(&runs.join(system).join(format!("{run}.csv")), text.as_bytes())?;
    }
    Ok(())
}

fn maneuver_title(name: &str) -> String {
    match name {
        "iso3888_1" => "ISO 3888-1".to_owned(),
        "iso3888_2" => "ISO 3888-2".to_owned(),
        "j_turn" => "J-turn".to_owned(),
        _ => {
            let words = name.replace('_', " ");
            let (first, rest) = words.split_at(words.chars().next().map_or(0, char::len_utf8));
            first.to_uppercase() + rest
        }
    }
}

fn names(units: &[serde_json::Value]) -> String {
    let names: Vec<&str> = units.iter().filter_map(|unit| unit["fmu"].as_str()).collect();
    names.join(", ")
}

/// Prints the names of the FMUs and the parameters that were set.
fn print_systems(assessment: &Assessment) {
    let plant = assessment.plant["fmu"].as_str().unwrap_or_default();
    let base = names(&assessment.base);
    let base = if base.is_empty() { String::new() } else { format!(" and {base}") };
    outln!(
        "{plant}{base}; with: {}",
        if assessment.with.is_empty() { "nothing".to_owned() } else { names(&assessment.with) }
    );
    for set in &assessment.set {
        let text = |key: &str| set[key].as_str().unwrap_or_default().to_owned();
        outln!(
            "  {}:{} = {} instead of {} {}",
            text("component"),
            text("parameter"),
            text("value"),
            set["start"],
            text("unit")
        );
    }
}

fn limit_text(row: &Row) -> String {
    match ["min", "max"].map(|end| row.limit[end].as_f64()) {
        [_, Some(limit)] => format!(", at most {}", shown(limit)),
        [Some(limit), None] => format!(", at least {}", shown(limit)),
        [None, None] => String::new(),
    }
}

/// Reasons why numbers are missing, and the point at which numbers were compared.
fn notes(row: &Row, has_both: bool) -> Vec<String> {
    let mut notes = Vec::new();
    let reason_with = row.reason.as_deref().unwrap_or_default();
    let reason_without = row.reason_without.as_deref().unwrap_or_default();
    if !has_both {
        return if row.without.is_null() && !reason_with.is_empty() { vec![reason_with.to_owned()] } else { notes };
    }
    match (row.without.is_null(), row.with.is_null()) {
        (true, true) if reason_without == reason_with => notes.push(reason_with.to_owned()),
        (without, with) => {
            if without && !reason_without.is_empty() {
                notes.push(format!("without: {reason_without}"));
            }
            if with && !reason_with.is_empty() {
                notes.push(format!("with: {reason_with}"));
            }
        }
    }
    if let Some(compared) = &row.compared {
        let (without, with) = (shown(compared.without), shown(compared.with));
        notes.push(format!("at {} {}: {without} and {with}", shown(compared.at), compared.at_unit));
    }
    if let Some(reason) = row.incomparable.as_ref().filter(|_| !row.without.is_null() && !row.with.is_null()) {
        notes.push(reason.clone());
    }
    notes
}

const EVENTS: [(&str, &str); 5] = [
    ("spun", "spun"),
    ("rolled_over", "rolled over"),
    ("lost", "lost the path"),
    ("not_finished", "did not get to the end of the path"),
    ("not_settled", "did not settle"),
];

/// Prints the events of runs, except errors.
fn print_events(assessment: &Assessment) {
    let has_both = assessment.systems.len() > 1;
    for (flag, words) in EVENTS {
        for system in &assessment.systems {
            let runs: Vec<&str> = (assessment.runs.iter())
                .filter(|run| run.system == *system && run.flags.contains(&flag))
                .map(|run| run.id.as_str())
                .collect();
            if runs.is_empty() {
                continue;
            }
            let of = if has_both { format!(" {system} controllers") } else { String::new() };
            let rest = if runs.len() > 5 { format!(" and {} others", runs.len() - 5) } else { String::new() };
            outln!("{words}{of}: {}{rest}", runs[..runs.len().min(5)].join(", "));
        }
    }
}

fn print(assessment: &Assessment, source: &FmuFolder) {
    let has_both = assessment.systems.len() > 1;
    print_systems(assessment);
    for suite in Suite::ALL {
        // Maneuvers that were skipped are listed below the metrics.
        let is_shown = |row: &&Row| row.suite == suite && row.id.contains('.');
        let rows: Vec<&Row> = assessment.metrics.iter().filter(is_shown).collect();
        if rows.is_empty() {
            continue;
        }
        let width = rows.iter().map(|row| row.title.chars().count()).max().unwrap_or(0);
        let heading = if has_both { format!("  {:>10}  {:>10}", "with", "change") } else { String::new() };
        outln!("\n  {:width$}  {:>10}{heading}", "", "without");
        let mut maneuver = "";
        for row in rows {
            let of_row = row.id.split('.').next().unwrap_or_default();
            if of_row != maneuver {
                maneuver = of_row;
                outln!("{}", maneuver_title(maneuver));
            }
            let unit = if row.unit == "1" { "" } else { row.unit };
            let value = |value: &serde_json::Value| match value {
                serde_json::Value::Bool(true) => "yes".to_owned(),
                serde_json::Value::Bool(false) => "no".to_owned(),
                serde_json::Value::Null => "–".to_owned(),
                number => number.as_f64().map_or_else(|| number.to_string(), shown),
            };
            let bound = |system: &str, number: &serde_json::Value| match row.bounds.get(system) {
                Some(bound) if number.is_null() => bound.clone(),
                _ => value(number),
            };
            let mut line = format!("  {:width$}  {:>10}", row.title, bound("without", &row.without));
            if has_both {
                let change = row.change.as_f64().map_or(String::new(), |change| match change {
                    change if change.abs() < 0.05 => "0.0 %".to_owned(),
                    change => format!("{change:+.1} %"),
                });
                let _ = write!(line, "  {:>10}  {change:>10}", bound("with", &row.with));
            }
            let _ = write!(line, " {unit:<10}");
            let judgment = match row.judgment {
                Some(Judgment::Better) => "better",
                Some(Judgment::Worse) => "worse",
                Some(Judgment::Same) => "same",
                Some(Judgment::NotComparable) => "not comparable",
                None => "",
            };
            let verdict = match row.verdict {
                Verdict::Pass => format!("passed{}", limit_text(row)),
                Verdict::Fail => format!("FAILED{}", limit_text(row)),
                Verdict::Error => "ERROR".to_owned(),
                Verdict::Comparison => "no limit applies".to_owned(),
                Verdict::Info | Verdict::Dropped => String::new(),
            };
            let of_last = if has_both { "with" } else { "without" };
            let words = row.words.get(of_last).copied().unwrap_or_default();
            let notes = notes(row, has_both).join("; ");
            let notes = if notes.is_empty() { notes } else { format!(" ({notes})") };
            let _ = write!(line, " {judgment:<7} {verdict}{words}{notes}");
            outln!("{}", line.trim_end());
        }
    }
    for dropped in &assessment.dropped {
        outln!("left out: {} ({})", dropped.run, dropped.reason);
    }
    print_events(assessment);
    let broken: Vec<_> = assessment.runs.iter().filter(|run| run.error.is_some()).collect();
    for run in broken.iter().take(5) {
        outln!("broke down: {} {}: {}", run.system, run.id, run.error.as_deref().unwrap_or_default());
    }
    if broken.len() > 5 {
        outln!("and {} other runs", broken.len() - 5);
    }
    if !assessment.assumed.is_empty() {
        let signals: Vec<String> =
            assessment.assumed.iter().map(|(signal, unit)| format!("`{signal}` ({unit})")).collect();
        errln!("note: the plant declares no unit of {}; the units in parentheses are assumed", signals.join(", "));
    }
    print_loose_ends(assessment, source);
    let count = |wanted: Verdict| assessment.metrics.iter().filter(|row| row.verdict == wanted).count();
    let (passed, failed, errors) = (count(Verdict::Pass), count(Verdict::Fail), count(Verdict::Error));
    if passed + failed + errors > 0 {
        let errors = if errors > 0 { format!(", {errors} without a number") } else { String::new() };
        outln!(
            "\nlimits {} controllers: {passed} met, {failed} not met{errors}",
            if has_both { "with" } else { "without" }
        );
    }
}

/// Warns about outputs of controllers that nothing reads, and about inputs that nothing writes. Names FMUs that read or
/// write these signals.
fn print_loose_ends(assessment: &Assessment, source: &FmuFolder) {
    let with =
        |verb: &str, names: Option<String>| names.map_or(String::new(), |names| format!("; FMUs that {verb}: {names}"));
    for fmu in &assessment.idle {
        let found = source.find(fmu).ok().flatten();
        let outputs = found.iter().flat_map(|found| found.description.of(Causality::Output)).map(|v| v.name.as_str());
        let readers = fmus_with(source, Causality::Input, &outputs.collect::<Vec<_>>());
        errln!("warning: {fmu} has no effect: nothing reads its outputs{}", with("read them", readers));
    }
    // Both systems contain the plant, so its inputs are listed only once.
    let unwritten: BTreeMap<&String, &String> = assessment.unwritten.values().flatten().collect();
    for (signal, value) in unwritten {
        if let Some(start) = value.strip_suffix(" (start value)") {
            let writers = fmus_with(source, Causality::Output, &[signal]);
            errln!(
                "warning: nothing writes `{signal}`, which keeps its start value {start}{}",
                with("write it", writers)
            );
        }
    }
}

/// A number with four significant digits.
fn shown(number: f64) -> String {
    if number == 0.0 {
        return "0".to_owned();
    }
    let digits = 3 - number.abs().log10().floor() as i32;
    if (0..=8).contains(&digits) {
        format!("{number:.*}", digits.unsigned_abs() as usize)
    } else {
        format!("{number:.3e}")
    }
}
