//! `cargo fmu run`: executes a scenario.

use super::jobs::jobs;
use super::plan::print_warnings;
use super::selection::Selection;
use crate::output::{errln, outln};
use crate::worker;
use clap::Args;
use fmu_import::terminal::indented;
use fmu_system::fmus::Fmus;
use fmu_system::master::Recording;
use fmu_system::plan::{Plan, Signal};
use fmu_system::results;
use fmu_system::run::Run;
use fmu_system::worker::{Failure, Pool, Task};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, WrapErr, miette};
use std::collections::{BTreeMap, BTreeSet};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Different messages shown after all runs.
const SHOWN_MESSAGES: usize = 10;

/// Which scenario, and where the results go.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    selection: Selection,

    /// Folder for results; the files go to its subfolder SCENARIO/runs
    #[arg(long, value_name = "OUT", default_value = "results")]
    out: PathBuf,

    /// Leaves out the warnings of `cargo fmu plan`
    #[arg(long)]
    no_warnings: bool,

    /// Number of processes [default: that of the processors]
    #[arg(long, short, value_name = "N")]
    jobs: Option<NonZeroUsize>,

    #[command(flatten)]
    workers: worker::Options,
}

/// What is left of a run once its file is written.
struct Done {
    seconds: f64,
    messages: Vec<String>,
}

impl From<Recording> for Done {
    fn from(recording: Recording) -> Self {
        let messages = recording.messages.iter().map(|(component, message)| format!("{component}: {}", message.text));
        Self { seconds: recording.seconds, messages: messages.collect() }
    }
}

/// Executes the scenario.
pub(crate) fn run(arguments: &Arguments) -> miette::Result<()> {
    let plan = if arguments.no_warnings {
        arguments.selection.plan()?
    } else {
        let plan = arguments.selection.plan_with_warnings(&arguments.workers)?;
        print_warnings(&plan);
        let unread: BTreeSet<&Signal> = plan.wiring.iter().flat_map(|wiring| &wiring.unread).collect();
        if !unread.is_empty() {
            errln!("note: {} outputs are neither read nor recorded; `cargo fmu plan` lists them", unread.len());
        }
        plan
    };
    let folder = arguments.out.join(&plan.name).join("runs");
    remove_old(&plan, &folder)?;
    let fmus = Fmus::unpack(&plan.runs).into_diagnostic()?;
    let bar = progress_bar(&plan)?;
    let printing = bar.clone();
    let printed = Arc::new(move |line: &str| printing.suspend(|| eprintln!("FMU prints: {line}")));
    let pool = Pool::new(arguments.workers.settings(printed)?, jobs(arguments.jobs), &fmus);

    let began = Instant::now();
    let names: Vec<String> = plan.columns.iter().map(|column| column.name.clone()).collect();
    // An FMU may change the folder of its process.
    let target = std::path::absolute(&folder).into_diagnostic()?;
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
    let mut failures = Vec::new();
    for (index, outcome) in outcomes.into_inner().unwrap_or_else(PoisonError::into_inner) {
        match outcome {
            Ok(result) => done.push((&plan.runs[index], result)),
            Err(error) => failures.push(error.to_string()),
        }
    }
    print_summary(&plan, &done, &folder, began.elapsed());
    if failures.is_empty() {
        Ok(())
    } else {
        Err(miette!("{} of {} runs failed\n\n{}", failures.len(), plan.runs.len(), failures.join("\n\n")))
    }
}

/// Removes the files of an earlier call, so that a failed run leaves no old results behind.
fn remove_old(plan: &Plan, folder: &Path) -> miette::Result<()> {
    for run in &plan.runs {
        let path = folder.join(results::file_name(run));
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

/// A bar that counts steps; it shows itself on a terminal only.
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

fn print_summary(plan: &Plan, done: &[(&Run, Done)], folder: &Path, elapsed: Duration) {
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
        "{} of {} runs over {} s in {:.1} s: {}",
        done.len(),
        plan.runs.len(),
        plan.simulation.stop - plan.simulation.start,
        elapsed.as_secs_f64(),
        folder.join("*.csv").display()
    );
    let mut messages: BTreeMap<&str, usize> = BTreeMap::new();
    for message in done.iter().flat_map(|(_, done)| &done.messages) {
        *messages.entry(message).or_default() += 1;
    }
    for (message, count) in messages.iter().take(SHOWN_MESSAGES) {
        errln!("{} ({count} times)", indented(message, "  "));
    }
    if messages.len() > SHOWN_MESSAGES {
        errln!("and {} other messages", messages.len() - SHOWN_MESSAGES);
    }
}
