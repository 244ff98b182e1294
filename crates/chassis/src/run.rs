//! `chassis run`: executes a scenario.

use crate::jobs::jobs;
use crate::plan::print_warnings;
use crate::python::{self, Python};
use crate::selection::{Selection, find_steady_starts};
use cargo_fmu::files::{try_to_write, write_whole};
use cargo_fmu::worker;
use cargo_fmu::{errln, outln};
use clap::{Args, ValueEnum};
use fmu_import::terminal::{escaped, indented};
use fmu_system::fmus::Fmus;
use fmu_system::master::Recording;
use fmu_system::plan::{Plan, Signal};
use fmu_system::requirements::{self, Signals, Status};
use fmu_system::results::{self, RunStatus, RunStatuses};
use fmu_system::run::Run;
use fmu_system::worker::{Failure, FailureKind, Pool, Task};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, WrapErr, miette};
use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of different messages shown after all runs.
const SHOWN_MESSAGES: usize = 10;

/// Arguments of `chassis run`.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    selection: Selection,

    /// Master that executes the runs
    #[arg(long, default_value = "native")]
    engine: Engine,

    /// Folder for results
    ///
    /// The files go to OUT/SCENARIO.
    #[arg(long, value_name = "OUT", default_value = "results")]
    out: PathBuf,

    /// Make neither tables nor a page
    #[arg(long, conflicts_with_all = ["parquet", "from_csv"])]
    no_page: bool,

    /// Make tables and page from the CSV files in DIR, without runs
    #[arg(long, value_name = "DIR", conflicts_with = "engine")]
    from_csv: Option<PathBuf>,

    /// Also write the recorded signals as Parquet files
    #[arg(long)]
    parquet: bool,

    /// Leave out the warnings of `chassis plan`
    #[arg(long)]
    no_warnings: bool,

    /// Number of processes [default: number of processors]
    #[arg(long, short, value_name = "N")]
    jobs: Option<NonZeroUsize>,

    /// Exit with 0 even if a requirement is not met
    #[arg(long)]
    no_fail: bool,

    /// Also write the verdicts to this file, as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,

    /// Renamed
    #[arg(long, hide = true)]
    native: bool,

    #[command(flatten)]
    workers: worker::Options,
}

/// A master.
#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Engine {
    /// The master of this program
    Native,
    /// FMPy, in Python: the same results, more slowly
    Fmpy,
}

impl Arguments {
    /// Python, if tables and a page are made or FMPy executes the runs.
    fn python(&self) -> miette::Result<Option<Python>> {
        if self.engine == Engine::Fmpy {
            return Python::required("--engine fmpy").map(Some);
        }
        if self.from_csv.is_some() || self.parquet {
            return Python::required("this option").map(Some);
        }
        Ok(if self.no_page { None } else { Python::find_or_note() })
    }

    /// The request to Python for tables and page.
    fn request(&self, plan: &Plan) -> miette::Result<String> {
        let absolute = |path: &Path| std::path::absolute(path).into_diagnostic();
        let cut = [
            self.selection.stop.map(|stop| format!("--stop {stop}")),
            self.selection.seeds.map(|n| format!("--seeds {n}")),
        ];
        let cut: Vec<String> = cut.into_iter().flatten().collect();
        let engine = match (&self.from_csv, self.engine) {
            (Some(_), _) => "csv",
            (None, Engine::Native) => "native",
            (None, Engine::Fmpy) => "fmpy",
        };
        let request = serde_json::json!({
            "plan": plan,
            "folder": absolute(&self.out.join(&plan.name))?,
            "engine": engine,
            "command": python::command(),
            "csv": self.from_csv.as_deref().map(absolute).transpose()?,
            "jobs": jobs(self.jobs),
            "timeout": self.workers.timeout().as_secs_f64(),
            "parquet": self.parquet,
            "junit": self.junit.as_deref().map(absolute).transpose()?,
            "no_fail": self.no_fail,
            "inputs": self.selection.inputs.as_ref().and_then(|file| file.file_name()).map(|name| name.to_string_lossy()),
            "shortened": (!cut.is_empty()).then(|| cut.join(" ")),
        });
        serde_json::to_string(&request).into_diagnostic()
    }
}

/// Summary of a run whose file is written.
struct Done {
    /// Time of the last row, s.
    end: Option<f64>,
    seconds: f64,
    messages: Vec<String>,
}

impl From<Recording> for Done {
    fn from(recording: Recording) -> Self {
        let messages = recording.messages.iter().map(|(component, message)| format!("{component}: {}", message.text));
        Self { end: recording.time.last().copied(), seconds: recording.seconds, messages: messages.collect() }
    }
}

/// Executes the scenario, and makes tables and page.
pub(crate) fn run(arguments: &Arguments) -> miette::Result<()> {
    if arguments.native {
        return Err(miette!("the native master is the default now, without `--native`; `--engine fmpy` chooses FMPy"));
    }
    let python = arguments.python()?;
    let mut plan = if arguments.no_warnings {
        arguments.selection.plan()?
    } else {
        let plan = arguments.selection.plan_with_warnings(&arguments.workers)?;
        print_warnings(&plan);
        let unread: BTreeSet<&Signal> = plan.wiring.iter().flat_map(|wiring| &wiring.unread).collect();
        if !unread.is_empty() {
            errln!("note: {} outputs are neither read nor recorded; `chassis plan` lists them", unread.len());
        }
        plan
    };
    let is_native = arguments.engine == Engine::Native && arguments.from_csv.is_none();
    if is_native {
        execute(arguments, &plan, python.is_some())?;
    }
    let Some(python) = python else { return Ok(()) };
    if arguments.engine == Engine::Fmpy {
        // The native master finds them itself.
        find_steady_starts(&plan.simulation, &mut plan.runs, &arguments.workers)?;
    }
    match python.call("app", &[], Some(&arguments.request(&plan)?))? {
        0 => Ok(()),
        code => python::exit(code),
    }
}

/// Executes the runs by the master of this program. With `is_reported`, failed runs and verdicts are left to the page.
fn execute(arguments: &Arguments, plan: &Plan, is_reported: bool) -> miette::Result<()> {
    let folder = arguments.out.join(&plan.name).join("runs");
    let fmus = Fmus::unpack(&plan.runs).into_diagnostic()?;
    try_to_write(&folder)?;
    remove_old(plan, &folder)?;
    let bar = progress_bar(plan)?;
    let printing = bar.clone();
    let lines = Arc::new(move |line: &str| printing.suspend(|| eprintln!("{line}")));
    let jobs = jobs(arguments.jobs);
    // An FMU may change the folder of its process.
    let target = std::path::absolute(&folder).into_diagnostic()?;
    let mut settings = arguments.workers.settings(lines, jobs)?;
    if let Some(writable) = &mut settings.sandbox {
        std::fs::create_dir_all(&target).into_diagnostic().wrap_err_with(|| format!("making {}", target.display()))?;
        writable.push(target.clone());
    }
    let pool = Pool::new(settings, jobs, &fmus);

    let began = Instant::now();
    let names: Vec<String> = plan.columns.iter().map(|column| column.name.clone()).collect();
    let task = |index: usize| {
        let run = plan.runs[index].clone();
        let path = target.join(results::file_name(&run));
        Ok(Task { run, csv: Some((names.clone(), path)) })
    };
    let outcomes: Mutex<BTreeMap<usize, Result<Done, Failure>>> = Mutex::default();
    pool.execute(&plan.simulation, plan.runs.len(), &task, &|n| bar.inc(n), &|index, outcome| {
        outcomes.lock().unwrap_or_else(PoisonError::into_inner).insert(index, outcome.map(Done::from));
    });
    drop(pool);
    bar.finish_and_clear();

    let mut done = Vec::new();
    let (mut failures, mut ended, mut statuses) = (Vec::new(), Vec::new(), Vec::new());
    for (index, outcome) in outcomes.into_inner().unwrap_or_else(PoisonError::into_inner) {
        let run = &plan.runs[index];
        match outcome {
            Ok(result) => {
                statuses.push(RunStatus::completed(run, result.end));
                done.push((run, result));
            }
            Err(failure) => {
                statuses.push(RunStatus::of(run, &failure));
                let of_kind = if failure.kind == FailureKind::Terminated { &mut ended } else { &mut failures };
                of_kind.push((run.id.clone(), described(&failure)));
            }
        }
    }
    let statuses = serde_json::to_string_pretty(&RunStatuses::new(statuses)).into_diagnostic()?;
    write_whole(&folder.join(results::STATUS_FILE), (statuses + "\n").as_bytes())?;
    print_summary(plan, &done, ended.len(), &folder, began.elapsed());
    if is_reported {
        return Ok(());
    }
    for (_, message) in &ended {
        errln!("note: {}", indented(message, "  "));
    }
    let failed = report_verdicts(plan, &folder, [&failures[..], &ended[..]], arguments)?;
    if !failures.is_empty() {
        let messages: Vec<&str> = failures.iter().map(|(_, message)| message.as_str()).collect();
        return Err(miette!("{} of {} runs failed\n\n{}", failures.len(), plan.runs.len(), messages.join("\n\n")));
    }
    match failed {
        0 => Ok(()),
        _ if arguments.no_fail => Ok(()),
        1 => Err(miette!(help = NO_FAIL, "1 requirement is not met")),
        _ => Err(miette!(help = NO_FAIL, "{failed} requirements are not met")),
    }
}

/// The reason that a run is incomplete, and its last row.
fn described(failure: &Failure) -> String {
    let last = failure.recorded.as_ref().and_then(|recording| recording.time.last());
    let rows = last.map_or("no rows were written".to_owned(), |time| format!("the rows end at {time} s"));
    let message = failure.to_string();
    // Log messages of the components follow in lines of their own.
    match message.split_once('\n') {
        Some((first, logged)) => format!("{first}; {rows}\n{logged}"),
        None => format!("{message}; {rows}"),
    }
}

/// Hint on options, for requirements that are not met.
const NO_FAIL: &str = "With `--no-fail` the exit code is 0 all the same.";

/// Prints the verdicts on the requirements and writes them as JUnit XML. Returns the number of unmet requirements. `failures` and
/// `ended` (by an FMU) hold ids and messages of runs whose rows do not cover the whole run.
fn report_verdicts(
    plan: &Plan,
    folder: &Path,
    [failures, ended]: [&[(String, String)]; 2],
    arguments: &Arguments,
) -> miette::Result<usize> {
    let read = |run: &Run, columns: &BTreeSet<usize>| {
        if failures.iter().chain(ended).any(|(other, _)| *other == run.id) {
            return None;
        }
        let names: Vec<&str> = columns.iter().map(|index| plan.columns[*index].name.as_str()).collect();
        let read = results::read_csv(&folder.join(results::file_name(run)), &names);
        Some(read.map(|(times, values)| {
            let columns = columns.iter().zip(values).filter_map(|(index, values)| Some((*index, values?)));
            Signals { times, columns: columns.collect() }
        }))
    };
    let verdicts = if plan.metrics.iter().any(|metric| metric.requirement.is_some()) {
        requirements::verdicts(plan, &read).into_diagnostic()?
    } else {
        Vec::new()
    };
    if let Some(path) = &arguments.junit {
        write_whole(path, requirements::junit(plan, &verdicts, failures).as_bytes())?;
    }
    if !verdicts.is_empty() {
        let width = verdicts.iter().map(|verdict| verdict.outcome.status.title().len()).max().unwrap_or(0);
        outln!("\nRequirements");
        for verdict in &verdicts {
            outln!("{:width$}  {}", verdict.outcome.status.title(), escaped(&verdict.text(plan)));
        }
        match verdicts.iter().filter(|verdict| verdict.outcome.status == Status::Open).count() {
            0 => {}
            1 => outln!("1 requirement is not evaluated: a run failed, was ended by an FMU or was cut short."),
            open => {
                outln!("{open} requirements are not evaluated: runs failed, were ended by an FMU or were cut short.")
            }
        }
    }
    Ok(verdicts.iter().filter(|verdict| verdict.outcome.status == Status::Failed).count())
}

/// Removes the files of an earlier call, so that a failed run leaves no old results behind.
fn remove_old(plan: &Plan, folder: &Path) -> miette::Result<()> {
    let files = plan.runs.iter().map(results::file_name);
    for file in files.chain([results::STATUS_FILE.to_owned()]) {
        let path = folder.join(file);
        results::remove_parts(&path);
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                return Err(error).into_diagnostic().wrap_err_with(|| format!("cannot remove {}", path.display()));
            }
            _ => (),
        }
    }
    Ok(())
}

/// A bar that counts steps, shown on a terminal only.
fn progress_bar(plan: &Plan) -> miette::Result<ProgressBar> {
    let runs = u64::try_from(plan.runs.len()).into_diagnostic()?;
    let style = ProgressStyle::with_template("{msg} [{bar:40}] {percent:>3} % {elapsed} (ready in {eta})")
        .into_diagnostic()?
        .progress_chars("=> ");
    let bar = ProgressBar::new(runs * plan.simulation.steps).with_style(style);
    bar.set_message(plan.name.clone());
    bar.enable_steady_tick(Duration::from_millis(200));
    Ok(bar)
}

/// `ended` is the number of runs that an FMU ended, which are shorter than the others.
fn print_summary(plan: &Plan, done: &[(&Run, Done)], ended: usize, folder: &Path, elapsed: Duration) {
    let width = plan.cases.iter().map(|case| case.name.len()).max().unwrap_or(0).max("case".len());
    outln!("{:width$}  runs  seconds per run", "case");
    for case in &plan.cases {
        let of_case = || done.iter().filter(|(run, _)| run.case == case.name);
        let count = of_case().count();
        let seconds: f64 = of_case().map(|(_, done)| done.seconds).sum();
        let mean = if count == 0 { "-".to_string() } else { format!("{:.3}", seconds / count as f64) };
        outln!("{:width$}  {count:>4}  {mean:>15}", case.name);
    }
    outln!(
        "{} of {} runs over {} s{} in {:.1} s: {}",
        done.len(),
        plan.runs.len(),
        plan.simulation.stop - plan.simulation.start,
        if ended > 0 { format!(", {ended} ended by an FMU,") } else { String::new() },
        elapsed.as_secs_f64(),
        folder.join("*.csv").display()
    );
    let mut messages: BTreeMap<&str, usize> = BTreeMap::new();
    for message in done.iter().flat_map(|(_, done)| &done.messages) {
        *messages.entry(message).or_default() += 1;
    }
    for (message, count) in messages.iter().take(SHOWN_MESSAGES) {
        let times = if *count > 1 { format!(" ({count} times)") } else { String::new() };
        errln!("{}{times}", indented(message, "  "));
    }
    if messages.len() > SHOWN_MESSAGES {
        errln!("and {} other messages", messages.len() - SHOWN_MESSAGES);
    }
}
