//! `chassis run`: executes a scenario.

use crate::arguments::Jobs;
use crate::converge::{self, Converge};
use crate::plan::print_warnings;
use crate::python::{self, Python};
use crate::selection::{Selection, find_steady_starts};
use cargo_fmu::files::{try_to_write, write_whole};
use cargo_fmu::worker::{self, Lines};
use cargo_fmu::{errln, outln};
use clap::{Args, ValueEnum};
use fmu_import::terminal::{escaped, indented};
use fmu_import::worker::Settings;
use fmu_system::fmus::Fmus;
use fmu_system::master::Recording;
use fmu_system::plan::{Plan, Signal};
use fmu_system::requirements::{self, RunNumbers, Signals, Status, Verdict};
use fmu_system::results::{self, RunStatus, RunStatuses};
use fmu_system::run::{RealTime, Run, Simulation, StepCounts};
use fmu_system::typography::significant;
use fmu_system::worker::{Failure, FailureKind, Pool, Task};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, WrapErr, miette};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of different messages shown after all runs.
const SHOWN_MESSAGES: usize = 10;

#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) selection: Selection,

    /// Master that executes the runs
    #[arg(long, default_value = "native")]
    engine: Engine,

    /// Folder for results
    ///
    /// The files go to OUT/SCENARIO.
    #[arg(long, value_name = "OUT", default_value = "results")]
    pub(crate) out: PathBuf,

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

    #[command(flatten)]
    pub(crate) jobs: Jobs,

    /// Exit with 0 even if a requirement is not met
    #[arg(long)]
    no_fail: bool,

    /// Also write the verdicts to this file, as JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,

    /// Execute only the runs of a case: CASE, or CASE@POINT
    #[arg(long, value_name = "CASE")]
    case: Option<String>,

    /// Let simulated time advance FACTOR times as fast as the clock
    ///
    /// Results do not change. The number of steps that were late and their delays are printed, and written to status.json.
    /// SIGTSTP (Ctrl+Z) pauses the run until SIGCONT (`fg`).
    #[arg(long, value_name = "FACTOR", num_args = 0..=1, default_missing_value = "1", value_parser = factor,
        conflicts_with_all = ["engine", "from_csv", "converge"])]
    realtime: Option<f64>,

    #[command(flatten)]
    pub(crate) converge: Converge,

    /// Renamed
    #[arg(long, hide = true)]
    native: bool,

    #[command(flatten)]
    pub(crate) workers: worker::Options,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum Engine {
    /// The master of this program
    Native,
    /// FMPy, in Python: the same results, more slowly
    Fmpy,
}

fn factor(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor: &f64| *factor > 0.0 && factor.is_finite());
    factor.ok_or("must be a number above 0, such as 0.5".to_owned())
}

impl Arguments {
    /// Keeps the runs of the chosen case and seeds.
    fn select(&self, plan: &mut Plan) -> miette::Result<()> {
        if self.converge.converge {
            fmu_system::converge::check(plan).map_err(|message| miette!("{message}"))?;
        }
        if self.converge.converge && self.selection.seeds.is_none() {
            plan.seeds.truncate(1);
            plan.runs.retain(|run| run.seed.is_none_or(|seed| plan.seeds.contains(&seed)));
        }
        if let Some(case) = &self.case {
            plan.runs.retain(|run| run.case == *case || run.id.split('#').next() == Some(case));
        }
        match (plan.runs.len(), &self.case, self.realtime) {
            (0, Some(case), _) => {
                let names: Vec<&str> = plan.cases.iter().map(|case| case.name.as_str()).collect();
                Err(miette!(help = format!("choose one of {}", names.join(", ")), "the scenario has no case `{case}`"))
            }
            (runs @ 2.., _, Some(_)) => Err(miette!(
                help = "choose one with --case and --seeds 1",
                "--realtime executes one run, but the scenario has {runs}"
            )),
            _ => Ok(()),
        }
    }

    /// Returns the Python to call, if tables and a page are requested or FMPy executes the runs.
    fn python(&self) -> miette::Result<Option<Python>> {
        if self.engine == Engine::Fmpy {
            // A process in the sandbox cannot start Python.
            if self.workers.given().iter().any(|(name, _)| *name == "--sandbox") {
                return Err(miette!(
                    "--sandbox only applies to the native master; leave out --sandbox or --engine fmpy"
                ));
            }
            return Python::required("--engine fmpy").map(Some);
        }
        if self.from_csv.is_some() || self.parquet {
            return Python::required("this option").map(Some);
        }
        Ok(if self.no_page { None } else { Python::find_or_note() })
    }

    /// Processes that execute runs with the chosen master.
    pub(crate) fn pool(&self, settings: Settings, fmus: &Fmus) -> Pool {
        let pool = Pool::new(settings, self.jobs.count(), fmus).in_real_time(self.realtime);
        if self.engine == Engine::Fmpy { pool.with_job(python::FMPY) } else { pool }
    }

    /// The request to Python to make tables and a page. Runs that have no metrics in `results` are incomplete.
    fn page_request(&self, plan: &Plan, folder: &Path, results: &Results<'_>) -> miette::Result<String> {
        let incomplete = results.statuses.runs.iter().filter(|run| run.status != "completed");
        let cut = [
            self.case.as_ref().map(|case| format!("--case {case}")),
            self.selection.stop.map(|stop| format!("--stop {stop}")),
            self.selection
                .seeds
                .or((self.converge.converge && !plan.seeds.is_empty()).then_some(1))
                .map(|n| format!("--seeds {n}")),
        ];
        let cut: Vec<String> = cut.into_iter().flatten().collect();
        let engine = match (&self.from_csv, self.engine) {
            (Some(_), _) => "csv",
            (None, Engine::Native) => "native",
            (None, Engine::Fmpy) => "fmpy",
        };
        let verdicts = results
            .verdicts
            .iter()
            .map(|verdict| serde_json::json!({ "status": verdict.outcome.status, "text": verdict.text(plan) }));
        let request = serde_json::json!({
            "plan": plan,
            "folder": absolute(folder)?.to_string_lossy(),
            "engine": engine,
            "command": python::command_without(&[]),
            "numbers": results.numbers,
            "verdicts": verdicts.collect::<Vec<_>>(),
            "incomplete": incomplete.map(|run| (&run.run, run.reason())).collect::<BTreeMap<_, _>>(),
            "steps": results.statuses.runs.iter().filter_map(|run| Some((&run.run, run.steps?))).collect::<BTreeMap<_, _>>(),
            "parquet": self.parquet,
            "converge": self.converge.converge,
            "inputs": self.selection.inputs.as_ref().and_then(|file| file.file_name()).map(|name| name.to_string_lossy()),
            "shortened": (!cut.is_empty()).then(|| cut.join(" ")),
        });
        serde_json::to_string(&request).into_diagnostic()
    }
}

fn absolute(path: &Path) -> miette::Result<PathBuf> {
    std::path::absolute(path).into_diagnostic()
}

#[derive(Default)]
struct Incomplete {
    failures: Vec<(String, String)>,
    /// Runs that an FMU ended before the stop time.
    ended: Vec<(String, String)>,
}

impl Incomplete {
    fn of(statuses: &[RunStatus]) -> Self {
        let mut found = Self::default();
        for status in statuses {
            let message = (status.run.clone(), format!("run {}: {}", status.run, status.reason()));
            match &*status.status {
                "completed" => (),
                "terminated" => found.ended.push(message),
                _ => found.failures.push(message),
            }
        }
        found
    }
}

/// Metrics of the complete runs, and verdicts on them.
struct Results<'a> {
    statuses: RunStatuses,
    numbers: RunNumbers<'a>,
    verdicts: Vec<Verdict<'a>>,
}

impl<'a> Results<'a> {
    /// Evaluates the files of the runs. With `is_only_required`, only the metrics that requirements need are computed.
    fn of(plan: &'a Plan, runs: &Path, statuses: RunStatuses, is_only_required: bool) -> miette::Result<Self> {
        let completed = statuses.runs.iter().filter(|status| status.status == "completed");
        let completed: BTreeSet<&str> = completed.map(|status| status.run.as_str()).collect();
        let read = |run: &Run, columns: &BTreeSet<usize>| {
            if !completed.contains(run.id.as_str()) {
                return None;
            }
            let names: Vec<&str> = columns.iter().map(|index| plan.columns[*index].name.as_str()).collect();
            let read = results::read_csv(&runs.join(results::file_name(run)), &names);
            Some(read.map_err(|error| error.to_string()).map(|(times, values)| {
                let columns = columns.iter().zip(values).filter_map(|(index, values)| Some((*index, values?)));
                Signals { times, columns: columns.collect() }
            }))
        };
        let numbers = requirements::numbers(plan, is_only_required, &read).map_err(|message| miette!("{message}"))?;
        let verdicts = requirements::verdicts(plan, &numbers);
        Ok(Self { statuses, numbers, verdicts })
    }
}

pub(crate) fn run(arguments: &Arguments) -> miette::Result<()> {
    if arguments.native {
        return Err(miette!("the native master is the default now, without `--native`; `--engine fmpy` chooses FMPy"));
    }
    let python = arguments.python()?.filter(|_| !arguments.no_page);
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
    arguments.select(&mut plan)?;
    let folder = arguments.out.join(&plan.name);
    let runs = folder.join("runs");
    if arguments.engine == Engine::Fmpy {
        let Simulation { iterate, error_control, .. } = &plan.simulation;
        let keys = [("iterate", iterate.is_some()), ("error_control", error_control.is_some())];
        if let Some((key, _)) = keys.iter().find(|(_, is_used)| *is_used) {
            return Err(miette!("only the native master executes a scenario with `{key}`; leave out --engine fmpy"));
        }
        // The native master finds the steady states itself.
        find_steady_starts(&plan.simulation, &mut plan.runs, &arguments.workers)?;
    }
    let (statuses, Incomplete { failures, ended }) = match &arguments.from_csv {
        Some(source) => take(source, &plan, &runs)?,
        None => execute(arguments, &plan, &runs)?,
    };
    let compared = if arguments.converge.converge { converge::run(arguments, &plan, &folder)? } else { Ok(()) };
    let results = Results::of(&plan, &runs, statuses, python.is_none())?;
    if let Some(path) = &arguments.junit {
        write_whole(path, requirements::junit(&plan, &results.verdicts, &failures).as_bytes())?;
    }
    let python = python.filter(|_| {
        // Keep the page of an earlier call rather than make one that contains only failures.
        let is_empty = failures.len() == plan.runs.len();
        if is_empty {
            errln!("note: no page is written, because all runs failed");
        }
        !is_empty
    });
    if let Some(python) = &python {
        match python.call("app", &[], Some(&arguments.page_request(&plan, &folder, &results)?))? {
            0 => (),
            code => python::exit(code),
        }
    }
    for (_, message) in &ended {
        errln!("note: {}", indented(message, "  "));
    }
    let unmet = print_verdicts(&plan, &results.verdicts);
    if python.is_some() {
        outln!("\n{}", folder.join("index.html").display());
    }
    if !failures.is_empty() {
        return Err(miette!("{} of {} runs failed\n\n{}", failures.len(), plan.runs.len(), grouped(&failures)));
    }
    match unmet {
        0 => compared,
        _ if arguments.no_fail => compared,
        1 => Err(miette!(help = NO_FAIL, "1 requirement is not met")),
        _ => Err(miette!(help = NO_FAIL, "{unmet} requirements are not met")),
    }
}

/// Copies the files of recorded runs from a folder, or from its folder `runs`.
fn take(source: &Path, plan: &Plan, folder: &Path) -> miette::Result<(RunStatuses, Incomplete)> {
    if !source.is_dir() {
        return Err(miette!("--from-csv {}: no such folder", source.display()));
    }
    let inside = source.join("runs");
    let place = if inside.is_dir() { &inside } else { source };
    let reading = || format!("reading {}", place.join(results::STATUS_FILE).display());
    let mut known = match std::fs::read(place.join(results::STATUS_FILE)) {
        Ok(text) => serde_json::from_slice::<RunStatuses>(&text).into_diagnostic().wrap_err_with(reading)?.runs,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Vec::new(),
        Err(error) => return Err(error).into_diagnostic().wrap_err_with(reading),
    };
    known.retain(|status| status.status != "completed");
    try_to_write(folder)?;
    let is_elsewhere = place.canonicalize().ok() != folder.canonicalize().ok();
    if is_elsewhere {
        remove_old(plan, folder)?;
    }
    let names: Vec<String> = plan.columns.iter().map(|column| column.name.clone()).collect();
    let mut statuses = Vec::new();
    for run in &plan.runs {
        let name = results::file_name(run);
        let (from, to) = (place.join(&name), folder.join(&name));
        let status = if let Some(at) = known.iter().position(|status| status.run == run.id) {
            let mut status = known.swap_remove(at);
            if is_elsewhere && status.file.is_some() && from.is_file() {
                std::fs::copy(&from, &to).into_diagnostic().wrap_err_with(|| format!("copying {}", from.display()))?;
            } else if is_elsewhere {
                (status.file, status.end) = (None, None);
            }
            status
        } else {
            match complete(plan, run, &from) {
                Ok(recording) => {
                    if is_elsewhere {
                        results::write_csv(&to, &names, &recording).into_diagnostic()?;
                    }
                    RunStatus::completed(run, Some(&recording))
                }
                Err(message) => RunStatus::of(run, &Failure::new(&run.id, message)),
            }
        };
        statuses.push(status);
    }
    let incomplete = Incomplete::of(&statuses);
    let statuses = write_statuses(statuses, folder)?;
    if let Some((_, first)) = incomplete.failures.first().filter(|_| incomplete.failures.len() == plan.runs.len()) {
        return Err(miette!("{} has no results for {}: {first}", source.display(), plan.name));
    }
    Ok((statuses, incomplete))
}

pub(crate) fn complete(plan: &Plan, run: &Run, path: &Path) -> Result<Recording, String> {
    let file = results::file_name(run);
    let recorded =
        || plan.columns.iter().zip(&run.columns).filter(|(_, slot)| slot.is_some()).map(|(column, _)| column);
    let names: Vec<&str> = recorded().map(|column| column.name.as_str()).collect();
    let binaries: Vec<&str> = recorded().filter(|column| column.is_binary).map(|column| column.name.as_str()).collect();
    let numbers: Vec<&str> = names.iter().copied().filter(|name| !binaries.contains(name)).collect();
    let (time, found) = results::read_csv(path, &numbers).map_err(|error| error.to_string())?;
    let mut exact =
        results::read_exact(path, &binaries, run.binary.unwrap_or_default()).map_err(|error| error.to_string())?;
    let rows = usize::try_from(plan.simulation.steps / plan.simulation.every + 1).unwrap_or(usize::MAX);
    let missing = numbers.iter().zip(&found).find(|(_, values)| values.is_none()).map(|(name, _)| name);
    if let Some(name) = missing.or_else(|| binaries.iter().find(|name| !exact.contains_key(**name))) {
        return Err(format!("{file} has no column {name}"));
    }
    if time.len() != rows {
        return Err(format!("{file} has {} rows, expected {rows}", time.len()));
    }
    if found.iter().flatten().flatten().any(|value| !value.is_finite()) {
        return Err(format!("{file} contains a value that is not finite"));
    }
    let mut found = found.into_iter();
    let columns = run.columns.iter().zip(&plan.columns).map(|(slot, column)| match slot {
        Some(_) if column.is_binary => Some(vec![0.0; time.len()]),
        _ => slot.and_then(|_| found.next().flatten()),
    });
    let columns = columns.collect();
    let of_plan = plan.columns.iter().enumerate().filter_map(|(at, column)| Some((at, exact.remove(&column.name)?)));
    Ok(Recording { time, columns, exact: of_plan.collect(), ..Recording::default() })
}

fn write_statuses(statuses: Vec<RunStatus>, folder: &Path) -> miette::Result<RunStatuses> {
    let statuses = RunStatuses::new(statuses);
    let text = serde_json::to_string_pretty(&statuses).into_diagnostic()?;
    write_whole(&folder.join(results::STATUS_FILE), (text + "\n").as_bytes())?;
    Ok(statuses)
}

/// Executes the runs with a master. Returns the outcomes of the runs, and a message for each incomplete run, with the
/// place of the failure and the last row.
fn execute(arguments: &Arguments, plan: &Plan, folder: &Path) -> miette::Result<(RunStatuses, Incomplete)> {
    let fmus = Fmus::unpack(&plan.runs).into_diagnostic()?;
    try_to_write(folder)?;
    remove_old(plan, folder)?;
    let runs = u64::try_from(plan.runs.len()).into_diagnostic()?;
    let (bar, lines) = progress_bar(&plan.name, OF_STEPS)?;
    bar.set_length(runs * plan.simulation.steps);
    // The path is absolute, because an FMU may change the working directory.
    let target = absolute(folder)?;
    let mut settings = arguments.workers.settings(lines, arguments.jobs.count())?;
    if let Some(writable) = &mut settings.sandbox {
        std::fs::create_dir_all(&target).into_diagnostic().wrap_err_with(|| format!("making {}", target.display()))?;
        writable.push(target.clone());
    }
    let pool = arguments.pool(settings, &fmus);

    let began = Instant::now();
    let names: Vec<String> = plan.columns.iter().map(|column| column.name.clone()).collect();
    let task = |index: usize| {
        let run = plan.runs[index].clone();
        let path = target.join(results::file_name(&run));
        Ok(Task { run, csv: Some((names.clone(), path)) })
    };
    let outcomes: Mutex<BTreeMap<usize, Result<Recording, Failure>>> = Mutex::default();
    pool.execute(&plan.simulation, plan.runs.len(), &task, &|n| bar.inc(n), &|index, outcome| {
        outcomes.lock().unwrap_or_else(PoisonError::into_inner).insert(index, outcome);
    });
    drop(pool);
    bar.finish_and_clear();

    let mut done = Vec::new();
    let (mut incomplete, mut statuses) = (Incomplete::default(), Vec::new());
    for (index, outcome) in outcomes.into_inner().unwrap_or_else(PoisonError::into_inner) {
        let run = &plan.runs[index];
        match outcome {
            Ok(result) => {
                statuses.push(RunStatus::completed(run, Some(&result)));
                done.push((run, result));
            }
            Err(failure) => {
                statuses.push(RunStatus::of(run, &failure));
                let Incomplete { failures, ended } = &mut incomplete;
                let of_kind = if failure.kind == FailureKind::Terminated { ended } else { failures };
                of_kind.push((run.id.clone(), described(&failure)));
            }
        }
    }
    let statuses = write_statuses(statuses, folder)?;
    print_summary(plan, &done, incomplete.ended.len(), folder, began.elapsed());
    for RealTime { factor, late_steps, largest_delay, total_delay } in
        statuses.runs.iter().filter_map(|run| run.real_time)
    {
        let [largest, total] = [largest_delay, total_delay].map(|delay| significant(delay, 3));
        outln!("real time x {factor}: {late_steps} steps late, by up to {largest} s, {total} s in total");
    }
    Ok((statuses, incomplete))
}

/// Lists the messages of runs. A message that several runs share is listed once, with the names of these runs.
pub(crate) fn grouped(failures: &[(String, String)]) -> String {
    let mut groups: Vec<(String, &str)> = Vec::new();
    for (run, message) in failures {
        // Each message begins with the name of the run.
        let reason = message.strip_prefix(&format!("run {run}")).unwrap_or(message);
        match groups.iter_mut().find(|(_, known)| *known == reason) {
            Some((runs, _)) => runs.push_str(&format!(", {run}")),
            None => groups.push((format!("run {run}"), reason)),
        }
    }
    groups.iter().map(|(runs, reason)| format!("{runs}{reason}")).collect::<Vec<_>>().join("\n\n")
}

/// The reason why a run is incomplete, and the time of its last row.
pub(crate) fn described(failure: &Failure) -> String {
    let last = failure.recorded.as_ref().and_then(|recording| recording.time.last());
    let rows = last.map_or("no rows were written".to_owned(), |time| format!("the rows end at {time} s"));
    let message = failure.to_string();
    // Log messages of the components follow on separate lines.
    match message.split_once('\n') {
        Some((first, logged)) => format!("{first}; {rows}\n{logged}"),
        None => format!("{message}; {rows}"),
    }
}

const NO_FAIL: &str = "With `--no-fail` the exit code is 0 anyway.";

/// Prints the verdicts on the requirements. Returns the number of those that are not met.
fn print_verdicts(plan: &Plan, verdicts: &[Verdict<'_>]) -> usize {
    if !verdicts.is_empty() {
        let width = verdicts.iter().map(|verdict| verdict.outcome.status.title().len()).max().unwrap_or(0);
        outln!("\nRequirements");
        for verdict in verdicts {
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
    verdicts.iter().filter(|verdict| verdict.outcome.status == Status::Failed).count()
}

/// Removes the files of an earlier call, so that a failed run leaves no old results behind.
fn remove_old(plan: &Plan, folder: &Path) -> miette::Result<()> {
    // Parquet files are removed, too, because Python replaces them only when it makes a page.
    let files = plan.runs.iter().map(results::file_name).flat_map(|csv| {
        let parquet = Path::new(&csv).with_extension("parquet").to_string_lossy().into_owned();
        [csv, parquet]
    });
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

/// The text after a progress bar that counts steps.
pub(crate) const OF_STEPS: &str = "{percent:>3} % {elapsed} (ready in {eta})";

/// A progress bar between `message` and `shown`, on a terminal only, and the function that prints a line above it.
pub(crate) fn progress_bar(message: &str, shown: &str) -> miette::Result<(ProgressBar, Lines)> {
    let style = ProgressStyle::with_template(&format!("{{msg}} [{{bar:40}}] {shown}")).into_diagnostic()?;
    let bar = ProgressBar::no_length().with_style(style.progress_chars("=> "));
    bar.set_message(message.to_owned());
    bar.enable_steady_tick(Duration::from_millis(200));
    let printing = bar.clone();
    Ok((bar, Arc::new(move |line| printing.suspend(|| eprintln!("{line}")))))
}

/// Prints the number of runs and their duration for each case. `ended` is the number of runs that are shorter, because
/// an FMU ended them.
fn print_summary(plan: &Plan, done: &[(&Run, Recording)], ended: usize, folder: &Path, elapsed: Duration) {
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
    if let Some(steps) = done.iter().filter_map(|(_, done)| done.steps).reduce(StepCounts::plus) {
        let [smallest, largest] = [steps.smallest, steps.largest].map(|size| significant(size, 3));
        let (accepted, rejected) = (steps.accepted, steps.rejected);
        outln!("{accepted} steps accepted, {rejected} rejected; sizes from {smallest} s to {largest} s");
        if steps.inaccurate > 0 {
            errln!("warning: {} steps of the size `min_step` have an error above the tolerance", steps.inaccurate);
        }
    }
    let mut messages: BTreeMap<String, usize> = BTreeMap::new();
    for (component, message) in done.iter().flat_map(|(_, done)| &done.messages) {
        *messages.entry(format!("{component}: {}", message.text)).or_default() += 1;
    }
    for (message, count) in messages.iter().take(SHOWN_MESSAGES) {
        let times = if *count > 1 { format!(" ({count} times)") } else { String::new() };
        errln!("{}{times}", indented(message, "  "));
    }
    if messages.len() > SHOWN_MESSAGES {
        errln!("and {} other messages", messages.len() - SHOWN_MESSAGES);
    }
}
