//! Rates of components, slopes of inputs, iteration and error control, with FMUs built from `coupled.c`.
//!
//! Reference: an independent master with exact components (oscillator of two masses, and a control loop with several
//! rates). Numbers without a further source are from it.
#![cfg(unix)]

mod counting;

use fmu_system::converge;
use fmu_system::export::System;
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use fmu_system::run::Recording;
use fmu_system::session::Session;
use fmu_system::worker::FailureKind;
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
        ("step_argument = \"difference\"", [("S1", "every = 7"), ("S2", "substeps = 3")], [0.0, 0.0]),
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
    let fine = find("0.001");
    for coarse in [find("0.1"), find("0.1\nstep_argument = \"difference\"")] {
        assert!(fine.iter().zip(&coarse).all(|(a, b)| (a - b).abs() < 1e-9), "{fine:?} {coarse:?}");
    }
}

#[test]
fn iterated_steps() {
    let folder = oscillator_with([ALL; 2], &[]);
    let keys = |more: &str| format!("step = 0.005\niterate = {{ tolerance = 1e-10, limit = 20 }}\n{more}");
    check(
        &oscillation(&folder, &keys(""), &S1_FIRST),
        0.026_254_163_512_221_672,
        [
            0.002_690_840_899_961_444_7,
            -0.355_954_628_425_640_46,
            5.019_312_232_927_334,
            0.019_337_447_386_474_56,
            -0.229_303_196_830_646_6,
        ],
    );
    let linear = keys("extrapolation = \"linear\"");
    for components in [S1_FIRST, [S1_FIRST[1], S1_FIRST[0]]] {
        check(
            &oscillation(&folder, &linear, &components),
            6.314_460_474_257_62e-4,
            [
                -0.020_889_389_360_602_213,
                -0.397_612_512_943_314_07,
                14.193_953_740_811_43,
                0.026_239_092_115_027_538,
                -0.120_566_022_330_793_25,
            ],
        );
    }
}

/// Tolerance of the numbers of steps: 2 % and 2, because a decision near the limit flips with rounding.
#[test]
fn steps_chosen_by_their_error() {
    let folder = oscillator_with([ALL; 2], &[]);
    for (extrapolation, tolerance, error, counts, sizes) in [
        ("hold", "1e-4", 0.002_372_413, [1905, 51], [0.000_471_198_742, 0.004_318_726_739]),
        ("hold", "1e-6", 2.419_914_79e-4, [18346, 56], [4.138_692_44e-5, 9.172_244_17e-4]),
        ("linear", "1e-4", 5.385_293_76e-4, [402, 29], [0.00125, 0.012_042_035_1]),
        ("linear", "1e-6", 2.694_884_59e-5, [1670, 32], [4.544_373_27e-4, 0.003_913_422_66]),
    ] {
        let keys =
            format!("step = 0.02\nextrapolation = \"{extrapolation}\"\nerror_control = {{ tolerance = {tolerance} }}");
        let (found, _, recording) = oscillation(&folder, &keys, &S1_FIRST);
        let steps = recording.steps.unwrap();
        println!("{extrapolation} {tolerance}: {found} {steps:?}");
        assert!((found - error).abs() <= 0.05 * error, "{extrapolation}, {tolerance}: {found}");
        for (found, expected) in [steps.accepted, steps.rejected].into_iter().zip(counts) {
            assert!(found.abs_diff(expected) as f64 <= 0.02 * expected as f64 + 2.0, "{steps:?}");
        }
        for (found, expected) in [steps.smallest, steps.largest].into_iter().zip(sizes) {
            assert!((found - expected).abs() <= 0.05 * expected, "{steps:?}");
        }
        assert_eq!((steps.inaccurate, recording.time.len()), (0, 101));
    }
}

#[test]
fn a_plan_names_what_its_coupling_needs() {
    let save = "canGetAndSetFMUstate=\"true\"";
    let [bare, able] = [oscillator_with([save, ""], &[]), oscillator_with([ALL; 2], &[])];
    let loops = multirate();
    let rated = [("S1", "every = 3"), ("S2", "")];
    for (folder, keys, components, message) in [
        (&able, "", &[("S1", "every = 0"), ("S2", "substeps = -1")][..], "`every` must be from 1 to 1000000, got 0"),
        (&able, "", &[("S1", "every = 2\nsubsteps = 2"), ("S2", "")], "either `every` or `substeps` above 1"),
        (&bare, "", &rated, "`every` is 3, which does not divide the 10 steps of the run, and "),
        (&bare, "", &rated, "does not declare canHandleVariableCommunicationStepSize; choose a divisor"),
        (&bare, "extrapolation = \"linear\"", &S1_FIRST, "`s1` cannot get slopes of its inputs: "),
        (&bare, "extrapolation = \"linear\"", &S1_FIRST, "S2.fmu does not declare canInterpolateInputs"),
        (&bare, "iterate = {}", &S1_FIRST, "`s2` cannot repeat steps, as `iterate` needs: "),
        (&bare, "error_control = {}", &S1_FIRST, "S1.fmu does not declare canHandleVariableCommunicationStepSize"),
        (&able, "error_control = {}", &rated, "`s1` cannot repeat steps, as `error_control` needs: it has `every`"),
        (&able, "iterate = { limit = 1 }", &S1_FIRST, "`limit` must be at least 2, got 1"),
        (&able, "iterate = { tolerance = 0.0 }", &S1_FIRST, "`tolerance` must be from 1e-14 to 1.0, got 0.0"),
        (&able, "error_control = { min_step = 0.2 }", &S1_FIRST, "`min_step` must be from 1e-7 to 0.1, got 0.2"),
        (&able, "order = \"jacobi\"\niterate = {}", &S1_FIRST, "steps in the order \"jacobi\" cannot be repeated; set"),
        (&loops, "error_control = {}", &[("Sensor", ""), ("Controller", "")], "needs a continuous component"),
        (
            &loops,
            "iterate = {}",
            &[("Plant", ""), ("Sensor", ""), ("Controller", "kind = \"continuous\"\n")],
            "no error: the sensor takes samples, so nothing is iterated",
        ),
    ] {
        let text = scenario(&format!("stop = 1.0\nstep = 0.1\n{keys}"), components, "\"*\"");
        let text = if components.len() == 2 && components[0].0 == "Sensor" {
            text.replace("name = \"sensor\"", "name = \"sensor\"\ninputs = { y = 0.0 }")
        } else {
            text
        };
        match resolved(folder, &text) {
            Ok(_) => assert!(message.starts_with("no error"), "{keys}: expected {message}"),
            Err(found) => assert!(found.contains(message), "{keys}: {found}"),
        }
    }
}

/// x1 and force need more than two passes; components between those of a loop would have to be repeated, too.
#[test]
fn what_cannot_be_iterated_is_named() {
    let folder = oscillator_with([ALL; 2], &[]);
    let keys = "stop = 1.0\nstep = 0.01\niterate = { tolerance = 1e-12, limit = 2 }";
    let plan = resolved(&folder, &scenario(keys, &S1_FIRST, "\"x1\"")).unwrap();
    let failure = master::execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap_err();
    let message = failure.to_string();
    assert!(message.contains("step from 0 s: `s1:x1`, `s1:v1`, `s2:force` still change by"), "{message}");
    assert!(message.contains("after 2 passes of a step; choose a smaller step, or a larger"), "{message}");
    // Under error control, such a step is rejected.
    let keys = "stop = 0.1\nstep = 0.02\niterate = { tolerance = 1e-6, limit = 3 }\nerror_control = {}";
    let steps = run(&resolved(&folder, &scenario(keys, &S1_FIRST, "\"x1\"")).unwrap()).steps.unwrap();
    assert!(steps.rejected > 0 && steps.largest < 0.004, "{steps:?}");

    pack(folder.path(), "Plant", ALL, &[], &["x2"], &[("y", 1.0)]);
    let text = scenario("stop = 1.0\nstep = 0.01\niterate = {}", &[S1_FIRST[0], ("Plant", ""), S1_FIRST[1]], "\"x1\"");
    let message = resolved(&folder, &text).unwrap_err();
    let expected =
        "`iterate` needs neighbors in the order, but `plant` lies between `s1`, `s2`; use `order = \"auto\"`";
    assert!(message.contains(expected), "{message}");
}

/// The sensor and the controller make one step per step of the run, and the plant, with constant inputs, is exact with
/// any steps: the results are those of fixed steps.
#[test]
fn components_that_take_samples_keep_their_steps_under_error_control() {
    let folder = multirate();
    let components = [("Sensor", ""), ("Controller", ""), ("Plant", "")];
    let find = |keys: &str| {
        let keys = format!("stop = 1.0\nstep = 0.01\n{keys}");
        let recording = run(&resolved(&folder, &scenario(&keys, &components, "\"y\", \"u\"")).unwrap());
        (recording.column(0).unwrap().to_vec(), recording.column(1).unwrap().to_vec(), recording.steps)
    };
    let (fixed, controlled) = (find(""), find("error_control = { initial_step = 0.01, min_step = 0.005 }"));
    for (a, b) in fixed.0.iter().zip(&controlled.0).chain(fixed.1.iter().zip(&controlled.1)) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }
    assert_eq!(controlled.2.map(|steps| (steps.accepted, steps.rejected)), Some((100, 0)));
}

/// A step that is the smallest is accepted with its error, and counted.
#[test]
fn steps_do_not_become_smaller_than_the_smallest() {
    let folder = oscillator_with([ALL; 2], &[]);
    let keys = "step = 0.01\nerror_control = { tolerance = 1e-9, min_step = 0.005 }";
    let steps = oscillation(&folder, keys, &S1_FIRST).2.steps.unwrap();
    assert_eq!((steps.accepted, steps.inaccurate), (400, 400));
    assert!((steps.smallest - 0.005).abs() < 1e-12 && (steps.largest - 0.005).abs() < 1e-12, "{steps:?}");
}

/// Outputs are defined after steps of up to 6 ms.
#[test]
fn error_control_rejects_steps_after_which_an_output_is_not_defined() {
    let folder = oscillator_with([ALL; 2], &["NARROW=0.006"]);
    let keys = "step = 0.02\nerror_control = { tolerance = 1.0, initial_step = 0.02 }";
    let steps = oscillation(&folder, keys, &S1_FIRST).2.steps.unwrap();
    assert!(steps.rejected > 0 && steps.largest <= 0.006, "{steps:?}");
    // A session cannot repeat the step; its message names what can.
    let folder = oscillator_with([ALL; 2], &[]);
    let limited = [("S1", ""), ("S2", "parameters = { limit = 0.03 }")];
    let plan = resolved(&folder, &scenario("stop = 1.0\nstep = 0.1", &limited, "\"x1\"")).unwrap();
    let mut session = Session::new(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap();
    let failure = session.step().unwrap_err();
    assert_eq!(failure.kind, FailureKind::Discarded);
    let message =
        "`s2`: fmi2DoStep returned fmi2Discard; choose a smaller `step`; only `chassis run` repeats a step in ";
    assert!(failure.message.starts_with(message), "{failure}");
}

/// Components whose steps may have any size: the plant is exact between the samples, with a factor on its input; the mass
/// integrates a line of a series with a jump. So the results are those without discards.
#[test]
fn repeated_steps_keep_samples_conversions_and_series() {
    let folder = multirate();
    pack(folder.path(), "S1", ALL, &[], &["force"], &[("x1", 0.1), ("v1", 1.0)]);
    let file = folder.path().join("force.csv");
    std::fs::write(&file, "time,force\n0,0\n0.25,8\n0.25,-2\n1,5\n").unwrap();
    let find = |limit: &str| {
        let components = [("Sensor", ""), ("Controller", ""), ("Plant", limit), ("S1", limit)];
        let text = scenario("stop = 1.0\nstep = 0.05\nextrapolation = \"linear\"", &components, "\"y\", \"x1\"");
        let wire = "[[connection]]\nfrom = \"controller:u\"\nto = \"plant:u\"\nfactor = 0.5\noffset = 0.1\n[[case]]";
        let options = Options { inputs: Some(file.clone()), ..Options::default() };
        let text = text.replace("[[case]]", wire);
        let plan = resolve_text(Path::new("c.toml"), &text, &FmuFolder::new([folder.path()]), &options);
        run(&plan.map_err(|error| error.lines().join("\n")).unwrap())
    };
    let (whole, short) = (find(""), find("parameters = { limit = 0.02 }"));
    let steps = short.steps.unwrap();
    // 0.02, 0.02 and 0.01 s; the plant discards, then the mass has the same limit.
    assert_eq!((whole.steps, steps.accepted, steps.rejected), (None, 60, 40));
    for (a, b) in whole.columns.iter().flatten().zip(short.columns.iter().flatten()) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9), "{a:?} {b:?}");
    }
}

/// The reference is the run without restoring.
#[test]
fn a_restored_session_has_its_slopes_rates_and_step() {
    let folder = oscillator_with([ALL; 2], &[]);
    for (keys, components) in [
        ("extrapolation = \"linear\"", [("S1", "every = 4"), ("S2", "")]),
        ("extrapolation = \"linear\"\nerror_control = {}", S1_FIRST),
        ("iterate = {}", S1_FIRST),
    ] {
        let keys = format!("stop = 0.2\nstep = 0.005\n{keys}");
        let plan = resolved(&folder, &scenario(&keys, &components, "\"x1\"")).unwrap();
        let fmus = Fmus::load(&plan.runs).unwrap();
        let expected = run(&plan);
        let mut session = Session::new(&plan.simulation, &plan.runs[0], &fmus).unwrap();
        let mut saved = None;
        for step in 0..30 {
            if step == 13 {
                saved = Some(session.save().unwrap());
            }
            session.step().unwrap();
        }
        session.restore(&saved.unwrap()).unwrap();
        while !session.is_over() {
            session.step().unwrap();
            assert_eq!(session.column(0), Some(expected.column(0).unwrap()[session.steps() as usize]), "{keys}");
        }
    }
}

/// With steps of 0.1 s, a component discards each step above 0.03 s. With the last successful time: 0.03, 0.03, 0.03,
/// 0.01 s and 3 discards; without: 0.025, 0.01875, 0.028125, 0.028125 s and 5 discards.
#[test]
fn discarded_steps_are_repeated_with_shorter_ones() {
    let limited = [("S1", ""), ("S2", "parameters = { limit = 0.03 }")];
    let keys = "stop = 1.0\nstep = 0.1\nextrapolation = \"linear\"";
    for (defects, smallest, largest, discards) in
        [(&[][..], 0.01, 0.03, 30), (&["NO_LAST_TIME"], 0.01875, 0.028125, 50)]
    {
        let folder = oscillator_with([ALL; 2], defects);
        let recording = run(&resolved(&folder, &scenario(keys, &limited, "\"x1\", \"s2_gaps\"")).unwrap());
        let steps = recording.steps.unwrap();
        assert_eq!((steps.accepted, steps.rejected, recording.time.len()), (40, discards, 11));
        assert!((steps.smallest - smallest).abs() < 1e-12 && (steps.largest - largest).abs() < 1e-12, "{steps:?}");
        // The largest error of fixed steps of 10 ms is 0.0095.
        let last = row(&recording, 1.0);
        assert!((last[0] - exact(&[1.0])[0]).abs() < 0.1 && last[1] == 0.0, "{last:?}");
        // Error control rejects such steps.
        let control = keys.to_owned() + "\nerror_control = { tolerance = 1.0, initial_step = 0.1 }";
        let steps = run(&resolved(&folder, &scenario(&control, &limited, "\"x1\"")).unwrap()).steps.unwrap();
        assert!(steps.rejected > 0 && steps.largest <= 0.06 + 1e-9, "{steps:?}");
    }
    // A component that takes samples, and one that cannot save its state, end the run.
    for (flags, kind) in [([ALL; 2], "kind = \"discrete\"\n"), (["", ALL], "")] {
        let folder = oscillator_with(flags, &[]);
        let limited = [("S1", ""), ("S2", &*format!("{kind}parameters = {{ limit = 0.03 }}"))];
        let plan = resolved(&folder, &scenario("stop = 1.0\nstep = 0.1", &limited, "\"x1\"")).unwrap();
        let failure = master::execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap_err();
        assert_eq!((failure.kind, failure.component.as_deref()), (FailureKind::Discarded, Some("s2")));
    }
}

/// After the first step, which saves the first states.
#[test]
fn a_coupled_step_does_not_allocate() {
    let folder = oscillator_with([ALL; 2], &[]);
    for (keys, components) in [
        ("extrapolation = \"linear\"", [("S1", "every = 4"), ("S2", "")]),
        ("extrapolation = \"linear\"", [("S1", ""), ("S2", "substeps = 3")]),
        ("iterate = {}", S1_FIRST),
        ("iterate = {}\nerror_control = {}", S1_FIRST),
    ] {
        let text = scenario(&format!("stop = 1.0\nstep = 0.001\n{keys}"), &components, "\"x1\"");
        let plan = resolved(&folder, &text).unwrap();
        let mut session = Session::new(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap();
        session.step().unwrap();
        let before = counting::allocations();
        for _ in 0..20 {
            session.step().unwrap();
        }
        assert_eq!(counting::allocations(), before, "{keys}");
    }
}

#[test]
fn other_uses_of_a_plan_know_its_rates() {
    let folder = oscillator_with([ALL; 2], &[]);
    let find = |keys: &str, s1: &str| {
        let text = scenario(&format!("stop = 1.0\nstep = 0.01\n{keys}"), &[("S1", s1), ("S2", "")], "\"x1\"");
        resolved(&folder, &text).unwrap()
    };
    // Components keep their period, and only sequential steps are iterated.
    let plan = find("iterate = {}", "");
    let levels = converge::levels(&plan, &Fmus::load(&plan.runs).unwrap(), false).unwrap();
    assert_eq!(levels.iter().map(|level| level.0.iterate.is_some()).collect::<Vec<_>>(), [true, true, true, false]);
    let plan = find("", "every = 3");
    let levels = converge::levels(&plan, &Fmus::load(&plan.runs).unwrap(), false).unwrap();
    let every = |level: &converge::Level| level.1[0].components.iter().map(|own| own.every).collect::<Vec<_>>();
    assert_eq!(levels.iter().map(every).collect::<Vec<_>>(), [[3, 1], [6, 1], [12, 1], [3, 1]]);
    let plan = find("error_control = {}", "");
    let message = converge::levels(&plan, &Fmus::load(&plan.runs).unwrap(), false).unwrap_err();
    assert!(message.starts_with("`error_control` chooses the communication step; compare runs"), "{message}");
    for (keys, s1, name) in [
        ("", "every = 2", "every` or `substeps"),
        ("extrapolation = \"linear\"", "", "extrapolation"),
        ("iterate = {}", "", "iterate"),
        ("error_control = {}", "", "error_control"),
    ] {
        let plan = find(keys, s1);
        let message = System::new(&plan, &plan.runs[0]).unwrap_err().to_string();
        assert!(message.starts_with(&format!("neither SSP nor OSP structures can express `{name}`;")), "{message}");
    }
}

/// A component with `every` takes samples at its own times, one without once per step.
#[test]
fn the_report_on_convergence_knows_which_components_have_a_period() {
    let folder = multirate();
    let components = [("Sensor", "every = 2"), ("Controller", ""), ("Plant", "")];
    let plan = resolved(&folder, &scenario("stop = 0.2\nstep = 0.01", &components, "\"y\"")).unwrap();
    let fmus = Fmus::load(&plan.runs).unwrap();
    let levels = converge::levels(&plan, &fmus, false).unwrap();
    let execute = |level: &converge::Level| vec![master::execute(&level.0, &level.1[0], &fmus).ok()];
    let recordings: Vec<_> = levels.iter().map(execute).collect();
    let reports = converge::assess(&plan, &fmus, &recordings, 0.01).unwrap();
    assert_eq!(
        reports[0].notes,
        ["`controller` updates once per communication step, so the systems with h, h/2 and h/4 differ"]
    );
}
