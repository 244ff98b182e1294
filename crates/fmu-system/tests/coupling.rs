//! Rates of components, slopes of inputs, iteration and error control, with FMUs built from `coupled.c`.
//!
//! Reference: an independent master with exact components (oscillator of two masses, and a control loop with several
//! rates). Numbers without a further source are from it.
#![cfg(unix)]

use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use fmu_system::run::Recording;
use std::fmt::Write as _;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use zip::write::{SimpleFileOptions, ZipWriter};

const ALL: &str = "canGetAndSetFMUstate=\"true\" canHandleVariableCommunicationStepSize=\"true\" \
                   canInterpolateInputs=\"true\"";

/// Compiles and packs an FMU: its inputs, and its outputs with their nominal values.
fn pack(folder: &Path, name: &str, flags: &str, defects: &[&str], inputs: &[&str], outputs: &[(&str, f64)]) {
    use std::io::Write as _;
    let (source, binary) = (folder.join(format!("{name}.c")), folder.join(format!("{name}.so")));
    std::fs::write(&source, include_str!("data/coupled.c")).unwrap();
    let status = Command::new("cc")
        .args(["-O2", "-fPIC", "-shared", "-fvisibility=hidden"])
        .args([format!("-DMODEL={}", name.to_uppercase()), format!("-DGUID=\"{name}\"")])
        .args(defects.iter().map(|defect| format!("-D{defect}")))
        .arg("-o")
        .args([&binary, &source])
        .arg("-lm")
        .status();
    assert!(status.unwrap().success());
    let mut variables = String::new();
    let mut variable = |name: &str, reference: usize, causality: &str, real: &str| {
        let variability = match name {
            "sensor_y" | "u" if causality == "output" => "variability=\"discrete\"",
            _ if causality == "parameter" => "variability=\"fixed\"",
            _ => "",
        };
        writeln!(
            variables,
            "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" causality=\"{causality}\" {variability}>\
             <Real {real}/></ScalarVariable>"
        )
        .unwrap();
    };
    inputs.iter().zip(0..).for_each(|(name, r)| variable(name, r, "input", "start=\"0\""));
    outputs.iter().zip(2..).for_each(|((name, n), r)| variable(name, r, "output", &format!("nominal=\"{n}\"")));
    let discrete = if inputs.len() + outputs.len() == 2 && outputs[0].0 != "y" { "parameter" } else { "output" };
    variable(
        &format!("{}_gaps", name.to_lowercase()),
        5,
        discrete,
        if discrete == "output" { "" } else { "start=\"0\"" },
    );
    variable("limit", 7, "parameter", "start=\"1e9\"");
    let all: Vec<String> = (1..=inputs.len()).map(|index| index.to_string()).collect();
    let unknown = |index: usize| {
        let dependencies = if name == "S2" && index == 0 { all.join(" ") } else { String::new() };
        format!("<Unknown index=\"{}\" dependencies=\"{dependencies}\"/>", inputs.len() + 1 + index)
    };
    let unknowns: String = (0..outputs.len() + usize::from(discrete == "output")).map(unknown).collect();
    let description = format!(
        "<?xml version=\"1.0\"?>\n<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{name}\" guid=\"{name}\">\n\
         <CoSimulation modelIdentifier=\"{name}\" {flags}/>\n<ModelVariables>\n{variables}</ModelVariables>\n\
         <ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure></fmiModelDescription>\n"
    );
    let mut zip = ZipWriter::new(std::fs::File::create(folder.join(format!("{name}.fmu"))).unwrap());
    let library = format!("binaries/{}/{name}{}", fmu_import::archive::platform(), std::env::consts::DLL_SUFFIX);
    for (path, content) in
        [("modelDescription.xml", description.into_bytes()), (&library, std::fs::read(&binary).unwrap())]
    {
        zip.start_file(path, SimpleFileOptions::default()).unwrap();
        zip.write_all(&content).unwrap();
    }
    zip.finish().unwrap();
}

fn oscillator_with(flags: [&str; 2], defects: &[&str]) -> TempDir {
    let folder = TempDir::new().unwrap();
    pack(folder.path(), "S1", flags[0], defects, &["force"], &[("x1", 0.1), ("v1", 1.0)]);
    pack(folder.path(), "S2", flags[1], defects, &["x1", "v1"], &[("force", 10.0), ("x2", 1.0), ("v2", 1.0)]);
    folder
}

fn multirate() -> TempDir {
    let folder = TempDir::new().unwrap();
    pack(folder.path(), "Plant", ALL, &[], &["u"], &[("y", 1.0)]);
    pack(folder.path(), "Sensor", ALL, &[], &["y"], &[("sensor_y", 1.0)]);
    pack(folder.path(), "Controller", ALL, &[], &["sensor_y"], &[("u", 1.0)]);
    folder
}

fn resolved(folder: &TempDir, text: &str) -> Result<Plan, String> {
    let plan = resolve_text(Path::new("c.toml"), text, &FmuFolder::new([folder.path()]), &Options::default());
    plan.map_err(|error| error.lines().join("\n"))
}

/// A scenario: keys of [simulation], components as FMU and keys, recorded signals.
fn scenario(simulation: &str, components: &[(&str, &str)], record: &str) -> String {
    let mut text = format!("title = \"Coupled\"\n[simulation]\n{simulation}\n");
    for (fmu, keys) in components {
        write!(text, "[[component]]\nname = \"{}\"\nfmu = \"{fmu}\"\n{keys}\n", fmu.to_lowercase()).unwrap();
    }
    text + &format!("[[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\nsignals = [{record}]\n")
}

fn run(plan: &Plan) -> Recording {
    let fmus = Fmus::load(&plan.runs).unwrap();
    master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap()
}

/// Values of the columns at the row nearest to a time.
fn row(recording: &Recording, time: f64) -> Vec<f64> {
    let at = recording.time.iter().position(|t| (t - time).abs() < 1e-9).unwrap();
    (0..recording.columns.len()).map(|column| recording.column(column).unwrap()[at]).collect()
}

/// x1 of the undivided oscillator at times in s: Runge-Kutta method with 0.1 ms, error below 1e-10.
fn exact(times: &[f64]) -> Vec<f64> {
    let f = |x: [f64; 4]| {
        let force = 300.0 * (x[2] - x[0]) + 0.2 * (x[3] - x[1]);
        let a1 = force - 100.0 * x[0] - 0.5 * x[1];
        [x[1], a1, x[3], (-force - 200.0 * x[2] - 0.5 * x[3]) / 2.0]
    };
    let h = 1e-4;
    let along = |x: [f64; 4], d: [f64; 4], s: f64| std::array::from_fn(|i| x[i] + s * d[i]);
    let (mut x, mut done) = ([0.1, 0.0, 0.0, 0.0], 0);
    let mut at = |time: &f64| {
        while done < (time / h).round() as usize {
            let k1 = f(x);
            let k2 = f(along(x, k1, 0.5 * h));
            let k3 = f(along(x, k2, 0.5 * h));
            let k4 = f(along(x, k3, h));
            x = std::array::from_fn(|i| x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
            done += 1;
        }
        x[0]
    };
    times.iter().map(&mut at).collect()
}

/// The largest error of x1, and the values at the end: x1, v1, force, x2, v2.
fn oscillation(folder: &TempDir, simulation: &str, components: &[(&str, &str)]) -> (f64, Vec<f64>, Recording) {
    let text = scenario(&format!("stop = 2.0\n{simulation}"), components, "\"x1\", \"v1\", \"force\", \"x2\", \"v2\"");
    let plan = resolved(folder, &text).unwrap();
    let recording = run(&plan);
    let order: Vec<usize> = ["x1", "v1", "force", "x2", "v2"]
        .iter()
        .map(|name| plan.columns.iter().position(|column| column.name == *name).unwrap())
        .collect();
    let x1 = recording.column(order[0]).unwrap();
    let errors = x1.iter().zip(exact(&recording.time)).map(|(found, exact)| (found - exact).abs());
    let last = row(&recording, 2.0);
    (errors.fold(0.0, f64::max), order.iter().map(|column| last[*column]).collect(), recording)
}

/// Compares an error and values at the end with 1e-7 of the largest values of the columns.
#[track_caller]
fn check(found: &(f64, Vec<f64>, Recording), error: f64, end: [f64; 5]) {
    let peak = 0.1_f64.max(error);
    assert!((found.0 - error).abs() <= 1e-7 * peak, "error {}, expected {error}", found.0);
    for (value, (expected, peak)) in found.1.iter().zip(end.into_iter().zip([0.1, 1.0, 30.0, 0.1, 1.0])) {
        let peak = f64::max(peak, expected.abs());
        assert!((value - expected).abs() <= 1e-7 * peak, "{value}, expected {expected}");
    }
}

const S1_FIRST: [(&str, &str); 2] = [("S1", ""), ("S2", "")];

#[test]
fn the_oscillator_has_the_error_of_its_coupling() {
    let folder = oscillator_with([ALL; 2], &[]);
    let find = |simulation: &str| oscillation(&folder, simulation, &S1_FIRST);
    check(
        &find("step = 0.005"),
        0.027_165_167_682_607_502,
        [
            -0.042_523_394_662_195_62,
            -0.626_533_855_329_908_2,
            23.389_321_874_483_848,
            0.035_145_417_353_104_31,
            -0.183_142_505_860_549_7,
        ],
    );
    check(
        &find("step = 0.005\norder = \"jacobi\""),
        0.192_518_207_651_178_77,
        [
            -0.209_409_954_599_519_75,
            -2.570_411_148_509_071_7,
            96.054_512_112_747_63,
            0.122_515_980_286_840_1,
            0.630_007_419_611_517_8,
        ],
    );
}

#[test]
fn components_with_rates() {
    let folder = oscillator_with([ALL; 2], &[]);
    let slow = [("S1", "every = 4"), ("S2", "")];
    check(
        &oscillation(&folder, "step = 0.001", &slow),
        0.024_510_759_687_476_267,
        [
            -0.045_486_985_835_127_93,
            -0.554_143_442_669_373_2,
            24.738_355_854_043_547,
            0.036_673_608_257_450_044,
            -0.103_255_311_318_612_78,
        ],
    );
    check(
        &oscillation(&folder, "step = 0.001\norder = \"jacobi\"", &slow),
        0.043_395_048_225_048_83,
        [
            -0.064_371_274_372_700_5,
            -0.699_043_638_381_656_6,
            33.124_403_267_989_68,
            0.046_354_758_601_436_535,
            -0.039_662_080_962_927_13,
        ],
    );
    check(
        &oscillation(&folder, "step = 0.001", &[("S1", ""), ("S2", "every = 4")]),
        0.046_668_050_728_555_885,
        [
            -0.062_875_869_172_573_48,
            -0.740_362_969_642_156_6,
            32.737_872_238_241_074,
            0.048_117_526_146_759_81,
            -0.063_030_343_601_168_65,
        ],
    );
    check(
        &oscillation(&folder, "step = 0.004", &[("S1", ""), ("S2", "substeps = 4")]),
        0.020_834_046_873_599_257,
        [
            -0.037_363_366_765_182_11,
            -0.561_156_004_046_337_9,
            21.211_887_507_247_76,
            0.033_084_130_094_529_64,
            -0.172_963_757_375_155_24,
        ],
    );
}

/// The components and orders of the loop, and y at 37 ms, 0.1 s, 0.5 s and 1 s.
#[test]
fn a_loop_with_three_rates() {
    let folder = multirate();
    let (plant, sensor, controller) = (("Plant", ""), ("Sensor", "every = 2"), ("Controller", "every = 10"));
    for (order, components, expected) in [
        (
            "sequential",
            [sensor, controller, plant],
            [0.560_529_534_927_150_9, 0.833_215_636_654_878_3, 0.997_299_177_938_402_4, 0.999_982_321_231_416_3],
        ),
        (
            "auto",
            [plant, controller, sensor],
            [0.560_529_534_927_150_9, 0.833_215_636_654_878_3, 0.997_299_177_938_402_4, 0.999_982_321_231_416_3],
        ),
        (
            "sequential",
            [controller, sensor, plant],
            [0.574_774_111_526_070_9, 0.841_835_570_086_586, 0.997_494_911_358_223_2, 0.999_984_280_833_172_5],
        ),
        (
            "sequential",
            [plant, sensor, controller],
            [0.551_862_572_426_624_1, 0.831_128_823_022_105, 0.997_273_102_740_565_2, 0.999_982_150_552_679_4],
        ),
        (
            "jacobi",
            [plant, sensor, controller],
            [0.573_550_438_328_035_2, 0.844_321_188_340_924, 0.997_566_579_482_657_9, 0.999_985_055_484_808_2],
        ),
    ] {
        let text = scenario(&format!("stop = 1.0\nstep = 0.001\norder = \"{order}\""), &components, "\"y\"");
        let recording = run(&resolved(&folder, &text).unwrap());
        for (time, expected) in [0.037, 0.1, 0.5, 1.0].into_iter().zip(expected) {
            let found = row(&recording, time)[0];
            assert!((found - expected).abs() <= 1e-9, "{order}, {components:?}: y({time}) = {found}");
        }
    }
}

/// Steps of 0.1 s to 20 s: 55 of the 200 sums of time and step are not the next time, the last of which no step
/// follows. Sums of
/// differences all are, also with rates that do not divide the number of steps.
#[test]
fn differences_of_times_add_up_to_the_next_time() {
    let folder = oscillator_with([ALL; 2], &[]);
    for (keys, components, gaps) in [
        ("", S1_FIRST, [54.0, 54.0]),
        ("step_argument = \"difference\"", S1_FIRST, [0.0, 0.0]),
        ("", [("S1", "every = 7"), ("S2", "substeps = 3")], [0.0, 0.0]),
    ] {
        let text = scenario(&format!("stop = 20.0\nstep = 0.1\n{keys}"), &components, "\"s1_gaps\", \"s2_gaps\"");
        assert_eq!(row(&run(&resolved(&folder, &text).unwrap()), 20.0), gaps, "{keys} {components:?}");
    }
}

#[test]
fn slopes_of_inputs() {
    let folder = oscillator_with([ALL; 2], &[]);
    let find = |simulation: &str| oscillation(&folder, &format!("extrapolation = \"linear\"\n{simulation}"), &S1_FIRST);
    check(
        &find("step = 0.005"),
        0.002_328_833_409_201_206_5,
        [
            -0.021_688_728_696_261_882,
            -0.331_699_229_549_978_3,
            14.486_015_097_409_396,
            0.026_478_501_907_224_707,
            -0.152_469_647_732_880_46,
        ],
    );
    check(
        &find("step = 0.01\norder = \"jacobi\""),
        0.031_715_021_821_610_9,
        [
            -0.021_876_524_484_240_836,
            0.350_116_884_470_300_04,
            14.143_970_346_522_922,
            0.023_938_730_012_045_918,
            -0.486_517_638_506_327_34,
        ],
    );
}

/// A line from the start to the end of a step is the same line in each quarter of it.
#[test]
fn substeps_follow_the_lines_of_their_inputs() {
    let folder = oscillator_with([ALL; 2], &[]);
    let find = |s2| oscillation(&folder, "step = 0.004\nextrapolation = \"linear\"", &[("S1", ""), ("S2", s2)]);
    let (one, four) = (find(""), find("substeps = 4"));
    check(&four, one.0, one.1.try_into().unwrap());
}

/// Between the samples of a linear input series, steps of any size follow the line. A series with a jump at the end of
/// a step is followed until the jump.
#[test]
fn a_linear_series_is_followed_exactly() {
    let folder = oscillator_with([ALL; 2], &[]);
    let file = folder.path().join("force.csv");
    std::fs::write(&file, "time,force\n0,0\n0.4,8\n0.4,-2\n1,5\n").unwrap();
    let find = |step: &str| {
        let keys = format!("stop = 1.0\nstep = {step}\nextrapolation = \"linear\"");
        let text = scenario(&keys, &S1_FIRST[..1], "\"x1\", \"v1\"");
        let options = Options { inputs: Some(file.clone()), ..Options::default() };
        let plan = resolve_text(Path::new("c.toml"), &text, &FmuFolder::new([folder.path()]), &options).unwrap();
        row(&run(&plan), 1.0)
    };
    let (fine, coarse) = (find("0.001"), find("0.1"));
    assert!(fine.iter().zip(&coarse).all(|(a, b)| (a - b).abs() < 1e-9), "{fine:?} {coarse:?}");
}
