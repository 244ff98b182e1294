//! `chassis run --converge`: estimates how much the results depend on the communication step.

use crate::run::{Arguments, OF_STEPS, complete, described, grouped, progress_bar};
use cargo_fmu::files::write_whole;
use cargo_fmu::outln;
use clap::Args;
use fmu_import::terminal::escaped;
use fmu_system::converge::{assess, levels, percent};
use fmu_system::fmus::Fmus;
use fmu_system::plan::Plan;
use fmu_system::results::file_name;
use fmu_system::run::Run;
use fmu_system::typography::significant;
use fmu_system::worker::{Failure, Task};
use miette::{IntoDiagnostic, miette};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

#[derive(Debug, Args)]
pub(crate) struct Converge {
    /// Compare the results with those of the steps h/2 and h/4, and of the other order of the components
    ///
    /// Only the first seed is used unless `--seeds` is given. The numbers go to the page and to
    /// OUT/SCENARIO/converge.json.
    #[arg(long)]
    pub(crate) converge: bool,

    /// Error of a metric that is accepted
    #[arg(long, value_name = "PERCENT", default_value = "1%", value_parser = share, requires = "converge")]
    limit: f64,

    /// Also divide the sample times of the controllers
    #[arg(long, requires = "converge")]
    sample_times: bool,

    /// Exit with 1 if the error of a metric is above the limit
    #[arg(long, requires = "converge")]
    converge_fail: bool,
}

fn share(text: &str) -> Result<f64, String> {
    let percent = text.strip_suffix('%').unwrap_or(text).parse().ok();
    let share = percent.filter(|x: &f64| *x > 0.0 && x.is_finite()).map(|x| x / 100.0);
    share.ok_or("must be a percentage above 0, such as 1%".to_owned())
}

/// Executes the runs with other steps and the other order, and compares them with the results in `folder`. The inner
/// result is an error if some of them failed, or if errors above the limit should be one.
pub(crate) fn run(arguments: &Arguments, plan: &Plan, folder: &Path) -> miette::Result<miette::Result<()>> {
    let options = &arguments.converge;
    let fmus = Fmus::unpack(&plan.runs).into_diagnostic()?;
    let levels = levels(plan, &fmus, options.sample_times).map_err(|message| miette!("{message}"))?;
    let others = &levels[1..];
    let (bar, lines) = progress_bar(&plan.name, OF_STEPS)?;
    bar.set_length(others.iter().map(|(simulation, runs)| simulation.steps * runs.len() as u64).sum());
    let pool = arguments.pool(arguments.workers.settings(lines, arguments.jobs.count())?, &fmus);
    let failures = Mutex::new(Vec::new());
    let execute = |(simulation, runs): &fmu_system::converge::Level| {
        let recordings = Mutex::new(vec![None; runs.len()]);
        let task = |index: usize| Ok(Task { run: runs[index].clone(), csv: None });
        pool.execute(simulation, runs.len(), &task, &|n| bar.inc(n), &|index, outcome| match outcome {
            Ok(found) => recordings.lock().unwrap_or_else(PoisonError::into_inner)[index] = Some(found),
            Err(failure) => {
                let run = format!("{} with step {} s", failure.run, simulation.step);
                let message = described(&Failure { run: run.clone(), ..failure });
                failures.lock().unwrap_or_else(PoisonError::into_inner).push((run, message));
            }
        });
        recordings.into_inner().unwrap_or_else(PoisonError::into_inner)
    };
    let recorded = |run: &Run| complete(plan, run, &folder.join("runs").join(file_name(run))).ok();
    let own = plan.runs.iter().map(recorded).collect();
    let recordings: Vec<_> = std::iter::once(own).chain(others.iter().map(execute)).collect();
    drop(pool);
    bar.finish_and_clear();
    let reports = assess(plan, &fmus, &recordings, options.limit).map_err(|message| miette!("{message}"))?;
    let file = folder.join("converge.json");
    let of = |level: usize| levels[level].0;
    let written = serde_json::json!({
        "scenario": plan.file,
        "steps": ([0, 1, 2].map(|level| of(level).step)),
        "order": of(0).order,
        "other_order": of(3).order,
        "limit": options.limit,
        "runs": reports,
    });
    write_whole(&file, (serde_json::to_string_pretty(&written).into_diagnostic()? + "\n").as_bytes())?;
    outln!("\nh = {} s, compared on the rows of h", significant(plan.simulation.step, 6));
    for report in &reports {
        outln!("");
        report.text().lines().for_each(|line| outln!("{}", escaped(line)));
    }
    let mut notes: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for report in &reports {
        report.notes.iter().for_each(|note| notes.entry(note).or_default().push(&report.run));
    }
    for (note, runs) in notes {
        let of = if runs.len() < reports.len() { format!(" ({})", runs.join(", ")) } else { String::new() };
        outln!("note: {}", escaped(&(note.to_owned() + &of)));
    }
    outln!("\n{}\n", file.display());
    let failures = failures.into_inner().unwrap_or_else(PoisonError::into_inner);
    if !failures.is_empty() {
        return Ok(Err(miette!("{} runs with other steps failed\n\n{}", failures.len(), grouped(&failures))));
    }
    let above: Vec<String> = reports.iter().flat_map(|report| report.above()).collect();
    if above.is_empty() || !options.converge_fail {
        return Ok(Ok(()));
    }
    Ok(Err(miette!(
        help = "set a smaller `step` in [simulation], or a larger --limit",
        "the error of the step is above {}: {}",
        percent(options.limit),
        above.join(", ")
    )))
}
