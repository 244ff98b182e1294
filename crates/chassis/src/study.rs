//! `chassis study`: runs a study.

use clap::Args;
use fmu_import::terminal::escaped;
use fmu_study::execution::{End, Existing, Summary, execute};
use fmu_study::journal::Progress;
use fmu_study::study::{self, Method, Study};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, Result, miette};
use std::num::NonZeroU64;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use crate::arguments::{Folders, Jobs};
use crate::python::{self, Python};
use cargo_fmu::outln;
use cargo_fmu::worker;

/// Arguments of `chassis study`. With `--resume`, an interrupted study continues and gives the same results.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    /// Study file (TOML)
    study: PathBuf,

    #[command(flatten)]
    fmus: Folders,

    /// Folder for results
    ///
    /// The files go to OUT/STUDY.
    #[arg(long, value_name = "OUT", default_value = RESULTS)]
    out: PathBuf,

    #[command(flatten)]
    jobs: Jobs,

    #[command(flatten)]
    workers: worker::Options,

    /// Override the study's number of samples (`runs`)
    #[arg(long, value_name = "N")]
    runs: Option<NonZeroU64>,

    /// Override the number of evaluations per method of a study without `[[vary]]`
    #[arg(long, value_name = "N", conflicts_with_all = ["runs", "dask", "shard", "merge"])]
    budget: Option<NonZeroU64>,

    /// Execute the runs with Dask, by the scheduler at ADDRESS, such as tcp://HOST:8786 [default: one on this machine]
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, require_equals = true, default_missing_value = "")]
    dask: Option<String>,

    /// Run only the I-th of N parts of the samples
    #[arg(long, value_name = "I/N", conflicts_with = "merge", value_parser = shard)]
    shard: Option<Shard>,

    /// Make tables and page from the results of all parts
    #[arg(long)]
    merge: bool,

    /// Make no page
    #[arg(long, conflicts_with = "report_only")]
    no_page: bool,

    /// Exit with 0 even if a requirement is not met
    #[arg(long)]
    no_fail: bool,

    /// Continue from the existing results
    #[arg(long, conflicts_with_all = ["overwrite", "report_only"])]
    resume: bool,

    /// Remove the existing results and start over
    #[arg(long, conflicts_with = "report_only")]
    overwrite: bool,

    /// Make only tables and page, from the existing results
    #[arg(long)]
    report_only: bool,
}

const RESULTS: &str = "results";

/// Exit code of a study that could not run.
const UNABLE: i32 = 2;

impl Arguments {
    /// The first given option that applies only to studies with `[[vary]]`.
    fn of_samples(&self) -> Option<&'static str> {
        let given = [
            ("--runs", self.runs.is_some()),
            ("--dask", self.dask.is_some()),
            ("--shard", self.shard.is_some()),
            ("--merge", self.merge),
        ];
        given.into_iter().find(|(_, is_given)| *is_given).map(|(name, _)| name)
    }

    /// The request to Python, which runs studies with `[[vary]]`.
    fn request(&self) -> Result<String> {
        if self.budget.is_some() {
            return Err(miette!("--budget is for studies without [[vary]]; --runs N sets the number of samples"));
        }
        if let Some((name, _)) =
            self.workers.given().into_iter().find(|(name, _)| ["--memory", "--sandbox"].contains(name))
        {
            return Err(miette!("{name} only applies to studies without [[vary]]"));
        }
        let absolute =
            |path: &Path| std::path::absolute(path).into_diagnostic().map(|path| path.to_string_lossy().into_owned());
        let request = serde_json::json!({
            "study": absolute(&self.study)?,
            "fmus": self.fmus.places().iter().map(|folder| absolute(folder)).collect::<Result<Vec<_>>>()?,
            "out": absolute(&self.out)?,
            "command": self.repeated(),
            "jobs": self.jobs.count(),
            "timeout": self.workers.timeout().as_secs_f64(),
            "runs": self.runs,
            "dask": self.dask,
            "shard": self.shard,
            "merge": self.merge,
            "no_page": self.no_page,
            "no_fail": self.no_fail,
            "resume": self.resume,
            "overwrite": self.overwrite,
            "report_only": self.report_only,
        });
        serde_json::to_string(&request).into_diagnostic()
    }

    /// The command that repeats the study with the same results.
    fn repeated(&self) -> String {
        let mut words = vec!["chassis".to_owned(), "study".to_owned(), python::named(&self.study.to_string_lossy())];
        words.extend(self.runs.iter().flat_map(|runs| ["--runs".to_owned(), runs.to_string()]));
        if self.out != Path::new(RESULTS) {
            words.extend(["--out".to_owned(), python::named(&self.out.to_string_lossy())]);
        }
        let folders = self.fmus.given().iter().map(|folder| python::named(&folder.to_string_lossy()));
        words.extend(folders.flat_map(|folder| ["--fmus".to_owned(), folder]));
        words.join(" ")
    }
}

/// A part of the samples. It contains every `of`-th sample, beginning with the sample `number` - 1.
#[derive(Debug, Clone, Copy, serde::Serialize)]
struct Shard {
    number: u32,
    of: u32,
}

fn shard(text: &str) -> Result<Shard, &'static str> {
    let parts = text.split_once('/').and_then(|(number, of)| Some((number.parse().ok()?, of.parse().ok()?)));
    let shard = parts.map(|(number, of)| Shard { number, of });
    let shard = shard.filter(|shard| (1..=shard.of).contains(&shard.number));
    shard.ok_or("must be I/N with I from 1 to N, such as 3/20")
}

struct Bars {
    bar: ProgressBar,
    method: String,
    began: Instant,
    /// Names of the finished methods, and the seconds that each has taken in this call.
    seconds: Vec<(String, f64)>,
}

impl Bars {
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

pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    if study::has_samples(&arguments.study) {
        let request = arguments.request()?;
        // The study is read here only to show mistakes with their places. Python reads it again.
        let runs = arguments.runs.map(NonZeroU64::get);
        if let Err(error) = fmu_system::study::read(&arguments.study, &arguments.fmus.source(), runs) {
            eprintln!("Error: {:?}", miette::Report::from(error));
            python::exit(UNABLE);
        }
        let python = Python::required("a study with [[vary]]")?;
        python::exit(python.call("study", &[], Some(&request))?);
    }
    if let Some(option) = arguments.of_samples() {
        eprintln!(
            "error: {} has no [[vary]]: PACSA, GA and CMA-ES run on this machine, without {option}. --budget N sets the number of \
             evaluations, --jobs N the number of processes; method = \"optimize\" with [search] and [[vary]] takes --dask and --runs",
            escaped(&arguments.study.display().to_string())
        );
        python::exit(UNABLE);
    }
    if arguments.report_only {
        return page(arguments, &Python::required("a page")?);
    }
    let python = if arguments.no_page { None } else { Python::find_or_note() };
    optimize(arguments)?;
    python.map_or(Ok(()), |python| page(arguments, &python))
}

/// Makes the page of a study without `[[vary]]`.
fn page(arguments: &Arguments, python: &Python) -> Result<()> {
    let name = arguments.study.file_stem().unwrap_or_default();
    let folder = std::path::absolute(arguments.out.join(name)).into_diagnostic()?;
    // The command on the page has no `--resume`, because an interruption does not change the results.
    let command = python::command_without(&["--resume", "--overwrite", "--report-only"]);
    match python.call("tuning", &[folder.display().to_string(), command], None)? {
        0 => Ok(()),
        code => python::exit(code),
    }
}

fn optimize(arguments: &Arguments) -> Result<()> {
    let bar = ProgressBar::no_length();
    let printing = bar.clone();
    let lines = Arc::new(move |line: &str| printing.suspend(|| eprintln!("{line}")));
    let jobs = arguments.jobs.count();
    let workers = (arguments.workers.settings(lines, jobs)?, jobs);
    let mut study = study::read(&arguments.study, &arguments.fmus.source(), workers)?;
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
    let compared = summary.comparisons.iter().map(|compared| (&compared.title, &compared.outcome));
    for (title, outcome) in std::iter::once((&summary.baseline.title, &summary.baseline.outcome)).chain(compared) {
        let reason = outcome.reason.as_ref().map_or(String::new(), |reason| format!("  ({reason})"));
        outln!("{title}: {:.6}{reason}", outcome.objective);
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
