//! Time of a communication step of 1 ms: the model's functions called directly in Rust, and the packed FMU through its
//! C interface (set all real inputs, step, get all real outputs). Both alternate in the same process, so their ratio is
//! meaningful on a busy machine.

use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::time::Instant;

use fmu::testing::abi::Export;
use fmu::testing::runner::{Context, Kind as ModelKind, Model, Run, Step};
use fmu::testing::store::ValueStore;
use fmu::testing::variable::Layout;
use fmu_import::description::{BaseType, Causality, Variable};
use fmu_import::fmu::Fmu;
use fmu_import::loader::Instance;
use tests::signals;

/// Communication step in s.
const STEP: f64 = 0.001;
/// Steps per measurement.
const STEPS: u32 = 20_000;
/// Measurements of each kind; the median is the result.
const ROUNDS: usize = 7;
/// Measurements of each of two versions. The fastest one is reported, because other processes disturb it least.
const VERSION_ROUNDS: usize = 25;

/// Prints one line: name, ns per step directly, through C, and their ratio.
///
/// # Panics
/// If the FMU is not packed or does not run.
pub fn compare<E: Export>() {
    let name = E::Model::INFO.name;
    let path = target().join("fmu").join(format!("{name}.fmu"));
    let fmu = Fmu::open(&path).unwrap_or_else(|error| panic!("{error}; run `cargo fmu pack {name}`"));
    let layout = &E::description().layout;
    let (mut direct, mut through_c) = (Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        direct.push(time_direct::<E::Model>(layout));
        through_c.push(time_fmu(&fmu));
    }
    let (direct, through_c) = (median(direct), median(through_c));
    println!("{name:28} {direct:8.0} ns directly {through_c:8.0} ns through C   ratio {:.2}", through_c / direct);
}

/// Prints a line for each FMU that is both in `target/fmu` and in the folder `before`: ns per step of the FMU in
/// `before`, ns per step of the FMU in `target/fmu`, and their ratio, which is above 1 if the FMU in `target/fmu` is
/// faster. The inputs are triangle waves with an amplitude that depends on the unit of measure.
///
/// # Panics
/// If a folder cannot be read, an FMU does not run, or there are no FMUs to compare.
pub fn compare_versions(before: &Path) {
    let entries = std::fs::read_dir(target().join("fmu")).expect("FMUs that `cargo fmu pack --all` has packed");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("the folder can be read").path()).collect();
    paths.sort();
    let mut compared = 0;
    for path in paths {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let old = before.join(format!("{name}.fmu"));
        if !old.is_file() {
            continue;
        }
        let fmus = [&old, &path].map(|path| Fmu::open(path).unwrap_or_else(|error| panic!("{error}")));
        let mut fastest = [f64::INFINITY; 2];
        for _ in 0..VERSION_ROUNDS {
            for (fastest, fmu) in fastest.iter_mut().zip(&fmus) {
                *fastest = fastest.min(time_triangles(fmu));
            }
        }
        println!(
            "{name:28} {:8.0} ns before {:8.0} ns now   ratio {:.2}",
            fastest[0],
            fastest[1],
            fastest[0] / fastest[1]
        );
        compared += 1;
    }
    assert!(compared > 0, "no FMU in {} has the name of one in `target/fmu`", before.display());
}

/// The folder that cargo builds in.
#[must_use]
pub fn target() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target"), PathBuf::from)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// Inputs that keep the model busy: small, different at every step.
fn excite(inputs: &mut [f64], start: &[f64], step: u32) {
    let wave = f64::from(step % 1000) * 1e-6;
    for (input, start) in inputs.iter_mut().zip(start) {
        *input = start + wave;
    }
}

fn time_direct<M: Model>(layout: &Layout) -> f64 {
    let mut values = ValueStore::start(layout);
    let p = M::parameters(&values);
    let no_resources = Path::new("");
    let derived = M::load(&p, no_resources).expect("the start values suit each other");
    let mut ctx = Context { p: &p, derived: &derived, layout, time: 0.0 };
    let mut run = M::init(ctx, no_resources, &values).expect("the start values suit each other");
    let inputs = layout.inputs.reals();
    let start = values.reals[inputs.clone()].to_vec();
    let mut step = Step {
        start: 0.0,
        reached: 0.0,
        time: 0.0,
        step: STEP,
        sample: 0,
        stops_at_events: false,
        importer_ticks: false,
        has_slopes: false,
    };
    let begin = Instant::now();
    for k in 0..STEPS {
        excite(&mut values.reals[inputs.clone()], &start, k);
        step.time = f64::from(k) * STEP;
        step.reached = step.time;
        let parts = M::parts(layout, &values, step) as u64;
        M::step(Run { ctx, run: &mut run, values: &mut values }, step, parts).expect("the run stays finite");
        step.sample += parts;
        if M::KIND == ModelKind::Continuous {
            ctx.time = step.time + STEP;
            M::outputs(ctx, &run, &mut values);
        }
        black_box(&values);
    }
    begin.elapsed().as_secs_f64() / f64::from(STEPS) * 1e9
}

/// The real variables with a causality. The few Integers and Booleans keep their start values.
fn reals(fmu: &Fmu, causality: Causality) -> impl Iterator<Item = &Variable> {
    let is_wanted = move |variable: &&Variable| variable.causality == causality && variable.base_type == BaseType::Real;
    fmu.description().variables.iter().filter(is_wanted)
}

fn time_fmu(fmu: &Fmu) -> f64 {
    let start: Vec<f64> = reals(fmu, Causality::Input).map(signals::start).collect();
    time_steps(fmu, |values, k| excite(values, &start, k))
}

/// Like [`time_fmu`], with triangle waves as inputs.
fn time_triangles(fmu: &Fmu) -> f64 {
    let waves: Vec<_> = reals(fmu, Causality::Input)
        .enumerate()
        .map(|(i, variable)| {
            let amplitude = signals::scale(variable);
            let offset = if signals::is_magnitude(variable) { amplitude } else { 0.0 };
            (signals::start(variable) + offset, amplitude, 0.37 * i as f64)
        })
        .collect();
    time_steps(fmu, |values, k| {
        let turns = f64::from(k) * STEP / 1.7;
        for (value, (middle, amplitude, phase)) in values.iter_mut().zip(&waves) {
            *value = middle + amplitude * (4.0 * ((turns + phase).fract() - 0.5).abs() - 1.0);
        }
    })
}

/// Time of a communication step with these inputs, in ns.
fn time_steps(fmu: &Fmu, excite: impl Fn(&mut [f64], u32)) -> f64 {
    let references = |causality| reals(fmu, causality).map(|variable| variable.reference).collect::<Vec<_>>();
    let (inputs, outputs) = (&references(Causality::Input), &references(Causality::Output));
    let run = || -> Result<f64, Box<dyn std::error::Error>> {
        let mut instance: Instance = fmu.instantiate("bench")?;
        instance.setup_experiment(0.0, None)?;
        instance.enter_initialization_mode()?;
        instance.exit_initialization_mode()?;
        let mut values = vec![0.0; inputs.len()];
        let mut results = vec![0.0; outputs.len()];
        let begin = Instant::now();
        for k in 0..STEPS {
            excite(&mut values, k);
            instance.set_real(inputs, &values)?;
            instance.do_step(f64::from(k) * STEP, STEP)?;
            instance.get_real(outputs, &mut results)?;
            black_box(&results);
        }
        Ok(begin.elapsed().as_secs_f64() / f64::from(STEPS) * 1e9)
    };
    run().unwrap_or_else(|error| panic!("{error}"))
}
