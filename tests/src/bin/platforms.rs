//! Compares the results of FMUs on two platforms (`tests/nightly/windows`, `tests/nightly/platforms`).
//!
//! - `platforms record OUT` runs each FMU with the inputs of its reference run and with changing inputs, and closed
//!   loops of each vehicle with the native master. It writes all results to the folder OUT, including the changing
//!   inputs;
//! - `platforms compare A B` compares the results in two such folders and exits with 1 unless all are bit-identical.

use fmu_import::description::{BaseType, Causality};
use fmu_import::loader::Instance;
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::resolve::{FmuFolder, Options, resolve};
use fmu_system::results;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::process::ExitCode;
use tests::signals::{self, Random};
use tests::{Fmu, folder, ok, paths, workspace};
use zip::ZipArchive;

/// Reference run in an archive.
const REFERENCE_RUN: &str = "extra/io.github.chassis-fmu/reference.csv";
/// Communication step in s.
const STEP: f64 = 0.001;
/// Number of steps of an FMU that runs alone.
const STEPS: u32 = 2000;
/// Closed loops, and their stop times in s.
const LOOPS: [(&str, f64); 4] = [
    ("rescue_vehicle_step_steer", 7.0),
    ("hydro_pneumatic_jturn_random", 7.0),
    ("esp_car_braking", 2.5),
    ("heavy_vehicle_control", 3.0),
];
/// Smallest peak by which a difference is divided in a message.
const FLOOR: f64 = 1e-6;

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args().skip(1).collect();
    let arguments: Vec<_> = arguments.iter().map(String::as_str).collect();
    match arguments.as_slice() {
        ["record", out] => record(Path::new(out)),
        ["compare", a, b] => return compare(Path::new(a), Path::new(b)),
        _ => {
            eprintln!("usage: platforms record OUT | compare A B");
            return ExitCode::from(2);
        }
    }
    ExitCode::SUCCESS
}

fn record(out: &Path) {
    std::fs::create_dir_all(out).unwrap_or_else(|error| panic!("{}: {error}", out.display()));
    for path in paths() {
        let fmu = Fmu::open(&path);
        let write = |name: &str, table: String| {
            let file = out.join(format!("{name}.csv"));
            std::fs::write(&file, table).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        };
        write(&fmu.name, alone(&fmu));
        write(&format!("{}_reference", fmu.name), reference_run(&fmu));
    }
    for (name, stop) in LOOPS {
        let scenario = workspace().join("scenarios").join(format!("{name}.toml"));
        let options = Options { stop: Some(stop), seeds: Some(1), ..Options::default() };
        let plan = resolve(&scenario, &FmuFolder::new([folder()]), &options).unwrap_or_else(|error| panic!("{error}"));
        let fmus = Fmus::load(&plan.runs).unwrap_or_else(|error| panic!("{error}"));
        let names: Vec<_> = plan.columns.iter().map(|column| column.name.clone()).collect();
        for run in &plan.runs {
            let recording = master::execute(&plan.simulation, run, &fmus).unwrap_or_else(|error| panic!("{error}"));
            let file = out.join(format!("{name}_{}", results::file_name(run)));
            results::write_csv(&file, &names, &recording).unwrap_or_else(|error| panic!("{error}"));
        }
    }
}

/// Runs an FMU with changing inputs; returns its inputs and outputs as a table.
fn alone(fmu: &Fmu) -> String {
    let inputs: Vec<_> = fmu.with(Causality::Input).filter(|v| v.base_type == BaseType::Real).collect();
    let input_references = fmu.references(Causality::Input);
    let outputs: Vec<_> = fmu.with(Causality::Output).filter(|v| v.base_type.is_number()).collect();
    let mut random = Random(1);
    // Triangle waves, because the last bit of a sine can differ between platforms.
    let waves: Vec<_> = inputs.iter().map(|_| [1.6 + 1.4 * random.symmetric(), random.symmetric()]).collect();

    let mut table = String::from("time");
    inputs.iter().for_each(|variable| write!(table, ",input {}", variable.name).expect("texts grow"));
    outputs.iter().for_each(|variable| write!(table, ",{}", variable.name).expect("texts grow"));
    let mut instance = fmu.started();
    for k in 0..STEPS {
        let time = f64::from(k) * STEP;
        let values = inputs.iter().zip(&waves).map(|(variable, [frequency, phase])| {
            let triangle = 4.0 * ((frequency * time + phase).rem_euclid(1.0) - 0.5).abs() - 1.0;
            let amplitude = signals::scale(variable);
            let offset = if signals::is_magnitude(variable) { amplitude } else { 0.0 };
            signals::start(variable) + offset + amplitude * triangle
        });
        let values: Vec<_> = values.collect();
        ok(instance.set_real(&input_references, &values));
        ok(instance.do_step(time, STEP));
        write!(table, "\n{:?}", time + STEP).expect("texts grow");
        values
            .iter()
            .chain(&fmu.outputs(&mut instance))
            .for_each(|value| write!(table, ",{value:?}").expect("texts grow"));
    }
    ok(instance.terminate());
    table
}

/// Outputs of an FMU with the inputs of the reference run in its archive. As its documentation states, the outputs of a
/// plant are read before the step, the outputs of other FMUs after the step.
fn reference_run(fmu: &Fmu) -> String {
    let text = entry(&fmu.path, REFERENCE_RUN);
    let mut lines = text.lines();
    let names: Vec<_> = lines.next().expect("a line of names").split(',').collect();
    let inputs: Vec<_> = fmu
        .with(Causality::Input)
        .filter_map(|input| Some((names.iter().position(|name| *name == input.name)?, input)))
        .collect();
    let time = names.iter().position(|name| *name == "time");
    let outputs = fmu.with(Causality::Output).filter(|v| v.base_type.is_number());
    let mut table = String::from("time");
    outputs.for_each(|variable| write!(table, ",{}", variable.name).expect("texts grow"));
    let mut instance: Option<Instance> = None;
    for (k, line) in lines.enumerate() {
        let cells: Vec<_> = line.split(',').collect();
        let number = |column: usize| -> f64 { cells[column].parse().expect("times and inputs are in every row") };
        let time = time.map_or(k as f64 * STEP, number);
        let instance = instance.get_or_insert_with(|| fmu.started_at(time));
        for (column, input) in &inputs {
            let (reference, value) = ([input.reference], number(*column));
            ok(match input.base_type {
                BaseType::Real => instance.set_real(&reference, &[value]),
                BaseType::Boolean => instance.set_boolean(&reference, &[i32::from(value != 0.0)]),
                BaseType::Integer => instance.set_integer(&reference, &[value as i32]),
                BaseType::String | BaseType::Binary => panic!("{} is not a number", input.name),
            });
        }
        let before = fmu.is_plant().then(|| fmu.outputs(instance));
        ok(instance.do_step(time, STEP));
        let values = before.unwrap_or_else(|| fmu.outputs(instance));
        write!(table, "\n{time:?}").expect("texts grow");
        values.iter().for_each(|value| write!(table, ",{value:?}").expect("texts grow"));
    }
    ok(instance.expect("there are rows").terminate());
    table
}

/// The text of an entry of an archive.
fn entry(path: &Path, name: &str) -> String {
    let file = File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut zip = ZipArchive::new(file).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut entry = zip.by_name(name).unwrap_or_else(|error| panic!("{}: {name}: {error}", path.display()));
    let mut text = String::new();
    entry.read_to_string(&mut text).unwrap_or_else(|error| panic!("{}: {name}: {error}", path.display()));
    text
}

/// A file of results.
struct Table {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
}

impl Table {
    fn read(path: &Path) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut lines = text.lines();
        let names: Vec<_> = lines.next().expect("a line of names").split(',').map(str::to_owned).collect();
        let mut columns = vec![Vec::new(); names.len()];
        for line in lines {
            let cells = line.split(',').map(|cell| cell.parse().expect("cells are numbers"));
            columns.iter_mut().zip(cells).for_each(|(column, value): (&mut Vec<f64>, f64)| column.push(value));
        }
        Self { names, columns }
    }
}

fn compare(a: &Path, b: &Path) -> ExitCode {
    let files = |folder: &Path| -> BTreeSet<_> {
        let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        entries.map(|entry| entry.expect("the folder can be read").file_name()).collect()
    };
    let names = files(a);
    assert!(!names.is_empty() && names == files(b), "the folders contain different files: {names:?}, {:?}", files(b));
    let mut code = ExitCode::SUCCESS;
    let (mut runs, mut identical, mut numbers) = (0, 0, 0);
    for file in names {
        let (a, b) = (Table::read(&a.join(&file)), Table::read(&b.join(&file)));
        let file = file.to_string_lossy().trim_end_matches(".csv").to_owned();
        assert!(a.names == b.names, "{file}: other columns");
        let mut worst = (0.0, "");
        let mut equal = 0;
        for (name, (a, b)) in a.names.iter().zip(a.columns.iter().zip(&b.columns)) {
            assert!(a.len() == b.len() && a.iter().chain(b).all(|value| value.is_finite()), "{file}: {name}");
            let peak = a.iter().fold(FLOOR, |peak, value| peak.max(value.abs()));
            let difference = a.iter().zip(b).fold(0.0_f64, |worst, (a, b)| worst.max((a - b).abs())) / peak;
            let is_equal = a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits());
            equal += usize::from(is_equal);
            if !is_equal && difference >= worst.0 {
                worst = (difference, name);
            }
        }
        println!(
            "{file:<50} {:<8} {:<36} {equal} of {} columns equal",
            format!("{:.1e}", worst.0),
            worst.1,
            a.names.len()
        );
        runs += 1;
        identical += usize::from(equal == a.names.len());
        numbers += a.columns.iter().map(Vec::len).sum::<usize>();
        if equal < a.names.len() {
            eprintln!("error: {file}: results must be bit-identical, {} differs by {:e} of its peak", worst.1, worst.0);
            code = ExitCode::FAILURE;
        }
    }
    println!("{identical} of {runs} runs are bit-identical, {numbers} numbers");
    code
}
