//! Arguments that select a scenario and change it.

use crate::arguments::{Folders, one_of};
use crate::import::Structure;
use cargo_fmu::worker;
use clap::Args;
use fmu_system::plan::Plan;
use fmu_system::resolve::{AfterEnd, Options, resolve};
use fmu_system::run::{Order, Run, Simulation};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Debug, Args)]
pub(crate) struct Selection {
    /// Scenario file (TOML), or SSP file with a system
    scenario: PathBuf,

    #[command(flatten)]
    fmus: Folders,

    #[command(flatten)]
    structure: Structure,

    /// CSV file with signals that replace the outputs of components
    ///
    /// The file has a column `time` and columns named `signal` or `component:signal`. Values are converted to the units
    /// of the variables. Continuous inputs are interpolated linearly, others hold the last value.
    #[arg(long, value_name = "FILE")]
    pub(crate) inputs: Option<PathBuf>,

    /// Action if a signal from `--inputs` ends before the run does
    #[arg(long, value_name = "WHAT", default_value = "error", requires = "inputs", value_parser = one_of(&AFTER_END))]
    after_end: AfterEnd,

    /// Override the scenario's stop time, in seconds
    #[arg(long, value_name = "T", allow_negative_numbers = true)]
    pub(crate) stop: Option<f64>,

    /// Use only the first N seeds
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) seeds: Option<u32>,

    /// Override the scenario's order of the components within a step
    #[arg(long, value_parser = one_of(&ORDERS))]
    order: Option<Order>,
}

const AFTER_END: [(&str, &str, AfterEnd); 2] =
    [("error", "Report an error", AfterEnd::Error), ("hold", "Hold the last value", AfterEnd::Hold)];

const ORDERS: [(&str, &str, Order); 3] = [
    (
        "sequential",
        "Gauss-Seidel: one after the other, each with the new outputs of those before it",
        Order::Sequential,
    ),
    ("jacobi", "Jacobi: all at once, with the outputs of the previous step", Order::Jacobi),
    ("auto", "Sequential, in the order in which the fewest connections carry values of another time", Order::Auto),
];

impl Selection {
    /// Resolves the scenario and adds the warnings that only trial runs give.
    pub(crate) fn plan_with_warnings(&self, workers: &worker::Options) -> miette::Result<Plan> {
        let mut plan = self.plan()?;
        let more = fmu_system::worker::trials(
            &workers.settings(Arc::new(|_| ()), NonZeroUsize::MIN)?,
            &plan.simulation,
            &plan.trials,
        );
        plan.warnings.extend(more);
        Ok(plan)
    }

    /// Like [`Self::plan_with_warnings`], but the plan contains the steady states in which components start, which
    /// other masters cannot compute.
    pub(crate) fn plan_with_steady_starts(&self, workers: &worker::Options) -> miette::Result<Plan> {
        let mut plan = self.plan_with_warnings(workers)?;
        find_steady_starts(&plan.simulation, &mut plan.runs, workers)?;
        Ok(plan)
    }

    pub(crate) fn plan(&self) -> miette::Result<Plan> {
        let options = Options {
            stop: self.stop,
            order: self.order,
            seeds: self.seeds.and_then(|n| usize::try_from(n).ok()),
            inputs: self.inputs.clone(),
            after_end: self.after_end,
            fmus: Vec::new(),
            step: self.structure.step,
            variant: self.structure.variant.clone(),
        };
        Ok(resolve(&self.scenario, &self.fmus.source(), &options)?)
    }
}

pub(crate) fn find_steady_starts(
    simulation: &Simulation,
    runs: &mut [Run],
    workers: &worker::Options,
) -> miette::Result<()> {
    let settings = workers.settings(worker::to_terminal(), NonZeroUsize::MIN)?;
    fmu_system::worker::find_steady_starts(&settings, simulation, runs).map_err(|message| miette::miette!("{message}"))
}
