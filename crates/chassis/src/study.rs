//! `chassis study`: carries out a study.

use clap::Args;
use fmu_study::execution::{End, Existing, Summary, execute};
use fmu_study::journal::Progress;
use fmu_study::study::{self, Method, Study, Workers};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, miette};
use std::num::{NonZeroU64, NonZeroUsize};
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::folders::folders;
use crate::jobs::jobs;
use cargo_fmu::outln;
use cargo_fmu::worker;

/// Arguments of `chassis study`. With `--resume`, an interrupted study continues and gives the same results.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Study file (TOML)
    study: PathBuf,

    /// Folder with the FMUs; may be repeated, the first folder that contains an FMU wins
    #[arg(long, value_name = "DIR", default_value = "target/fmu")]
    fmus: Vec<PathBuf>,

    /// Folder for results
    ///
    /// The files go to OUT/STUDY.
    #[arg(long, value_name = "OUT", default_value = "results")]
    out: PathBuf,

    /// Number of processes [default: number of processors]
    #[arg(long, short, value_name = "N")]
    jobs: Option<NonZeroUsize>,

    #[command(flatten)]
    workers: worker::Options,

    /// Override the study's number of evaluations per method
    #[arg(long, value_name = "N")]
    budget: Option<NonZeroU64>,

    /// Continue from the existing results
    #[arg(long, conflicts_with = "overwrite")]
    resume: bool,

    /// Remove the existing results and start over
    #[arg(long)]
    overwrite: bool,
}

/// Progress bar of the current method, and its start time.
struct Bars {
    bar: ProgressBar,
    method: String,
    began: Instant,
    /// Finished methods: name and time they took in this call.
    seconds: Vec<(String, f64)>,
}

impl Bars {
    /// Shows a method and its progress.
    fn show(&mut self, method: &Method, progress: &Progress) {
        if self.method != method.name {
            self.finish();
            self.method.clone_from(&method.name);
            self.began = Instant::now();
            self.bar.reset();
        }
        let best = progress.best.as_ref().map_or("-".to_string(), |best| format!("{:.6}", best.objective));
        self.bar.set_message(format!("{}: best {best}", method.title));
        self.bar.set_position(progress.evaluations);
    }

    fn finish(&mut self) {
        if !self.method.is_empty() {
            self.seconds.push((std::mem::take(&mut self.method), self.began.elapsed().as_secs_f64()));
        }
    }
}

/// Carries out the study.
pub(crate) fn run(arguments: &Arguments) -> miette::Result<()> {
    let bar = ProgressBar::no_length();
    let printing = bar.clone();
    let lines = Arc::new(move |line: &str| printing.suspend(|| eprintln!("{line}")));
    let jobs = jobs(arguments.jobs);
    let workers = Workers { settings: arguments.workers.settings(lines, jobs)?, jobs };
    let mut study = study::read(&arguments.study, &folders(&arguments.fmus), workers)?;
    if let Some(budget) = arguments.budget {
        study.evaluations = budget.get();
    }
    let existing = match (arguments.resume, arguments.overwrite) {
        (true, _) => Existing::Resume,
        (_, true) => Existing::Overwrite,
        _ => Existing::Error,
    };
    let style = ProgressStyle::with_template("{msg} [{bar:40}] {pos}/{len} {elapsed} (ready in {eta})")
        .into_diagnostic()?
        .progress_chars("=> ");
    bar.set_style(style);
    bar.set_length(study.evaluations);
    bar.enable_steady_tick(Duration::from_millis(200));
    let bars = Mutex::new(Bars { bar, method: String::new(), began: Instant::now(), seconds: Vec::new() });
    let report = |method: &Method, progress: &Progress| {
        if let Ok(mut bars) = bars.lock() {
            bars.show(method, progress);
        }
    };
    let summary = execute(&study, &arguments.out, existing, &report);
    let seconds = bars.into_inner().map_or(Vec::new(), |mut bars| {
        bars.finish();
        bars.bar.finish_and_clear();
        bars.seconds
    });
    let summary = summary.into_diagnostic()?;
    print_summary(&study, &summary, &seconds);
    outln!("{}", arguments.out.join(&study.name).join("summary.json").display());
    if summary.methods.iter().all(|method| method.progress.best.is_none()) {
        let help = "The reasons are in `history.csv` of each method, in the folder of the summary.";
        return Err(miette!(help = help, "no evaluation of any method was feasible"));
    }
    Ok(())
}

fn print_summary(study: &Study, summary: &Summary, seconds: &[(String, f64)]) {
    if let Some(judged) = &summary.judged {
        outln!("judgments: lambda_max {:.4}, consistency ratio {:.4}", judged.lambda_max, judged.ratio);
        for (term, weight) in summary.terms.iter().zip(&judged.weights) {
            outln!("  {weight:.4}  {}", term.signal);
        }
    }
    let show = |title: &str, objective: f64, reason: Option<&String>| {
        outln!("{title}: {objective:.6}{}", reason.map_or(String::new(), |r| format!("  ({r})")));
    };
    let baseline = &summary.baseline;
    show(&baseline.title, baseline.objective, baseline.reason.as_ref());
    for compared in &summary.comparisons {
        show(&compared.title, compared.objective, compared.reason.as_ref());
    }
    for method in &summary.methods {
        let progress = &method.progress;
        let end = match method.end {
            End::Generations => "all generations",
            End::Budget => "budget spent",
            End::Target => "target reached",
        };
        let seconds = seconds.iter().find(|(name, _)| *name == method.method.name).map_or(0.0, |(_, s)| *s);
        outln!(
            "{}: {} evaluations ({} not feasible), {} generations, {seconds:.1} s, {end}",
            method.method.title,
            progress.evaluations,
            progress.infeasible,
            progress.generations
        );
        let Some(best) = &progress.best else {
            outln!("  nothing feasible was found");
            continue;
        };
        outln!("  best {:.6} in evaluation {}", best.objective, best.evaluation);
        for (parameter, value) in study.simulation.parameters.iter().zip(&best.values) {
            outln!("  {} = {value:?} {}", parameter.name, parameter.unit.as_deref().unwrap_or_default());
        }
    }
    if !summary.improved {
        outln!("no method improved on the scenario's own values");
    }
}
