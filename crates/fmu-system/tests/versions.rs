//! Systems of FMUs of both versions of FMI, built from C in a temporary folder.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/decay.rs"]
mod decay;
#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use decay::Decay;
use fmu_import::description::FmiVersion;
use fmu_system::export::{OSP_STRUCTURE, STRUCTURE, System};
use fmu_system::fmus::Fmus;
use fmu_system::master::{self, Recording};
use fmu_system::plan::Plan;
use fmu_system::problem::Problem;
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve_text};
use std::path::Path;
use support::Build;
use tempfile::TempDir;

/// x' = -2 x, exactly, and its integral by the explicit Euler method. The inputs that FMI 3.0 adds are in place of `INPUTS`.
const SCENARIO: &str = r#"
title = "Integral"
[simulation]
stop = 0.3
step = 0.01
[[component]]
name = "decay"
fmu = "DECAY"
inputs = { u = 0.25INPUTS }
parameters = { k = 2.0PARAMETERS }
[[component]]
name = "integral"
fmu = "Integral"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["x", "y", "integral", "decay:*"]
"#;

fn scenario(fmi: FmiVersion) -> String {
    let [fmu, inputs, parameters] = match fmi {
        FmiVersion::V2 => ["Decay2", "", ""],
        FmiVersion::V3 => ["Decay3", ", flag = true, mode = \"second\"", ", small = -5, wide = 100, label = \"v\""],
    };
    SCENARIO.replace("DECAY", fmu).replace("INPUTS", inputs).replace("PARAMETERS", parameters)
}

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    Decay::new(FmiVersion::V2).pack(folder.path());
    Decay::new(FmiVersion::V3).pack(folder.path());
    Build::new("Integral", "y", "integral").pack(folder.path());
    folder
}

fn plan(folder: &TempDir, text: &str) -> Result<Plan, Vec<String>> {
    let source = FmuFolder::new([folder.path()]);
    resolve_text(Path::new("integral.toml"), text, &source, &Options::default()).map_err(|error| match error {
        ResolveError::Problems(problems) => problems.problems.iter().map(Problem::line).collect(),
        other => vec![other.to_string()],
    })
}

fn column<'a>(plan: &Plan, recording: &'a Recording, name: &str) -> &'a [f64] {
    recording.column(plan.columns.iter().position(|column| column.name == name).unwrap()).unwrap()
}

/// The integral of the outputs of the steps before; the last bits are those of the C library's exponential function.
#[test]
fn a_system_of_both_versions_follows_the_closed_form() {
    let folder = folder();
    let mut integrals = Vec::new();
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        let plan = plan(&folder, &scenario(fmi)).unwrap();
        let fmus = Fmus::load(&plan.runs).unwrap();
        let recording = master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap();
        let (x, integral) = (column(&plan, &recording, "x"), column(&plan, &recording, "integral"));
        let mut sum = 0.0;
        for k in 1..=30 {
            let expected = (-2.0 * 0.01 * k as f64).exp();
            assert!((x[k] - expected).abs() < 1e-14, "{fmi}: {k}");
            sum += 0.01 * (expected + 0.25);
            assert!((integral[k] - sum).abs() < 1e-14, "{fmi}: {k}");
        }
        integrals.push((x.to_vec(), integral.to_vec()));
        if fmi == FmiVersion::V3 {
            for (name, value) in [("y32", 0.125), ("not", 0.0), ("sum", 95.0), ("next", 3.0)] {
                assert_eq!(column(&plan, &recording, name)[30], value, "{name}");
            }
        }
    }
    // To the bit: the calls and their order are the same.
    assert_eq!(integrals[0], integrals[1]);
}

/// An array keeps its start values, which is said; it cannot be set, connected or recorded.
#[test]
fn arrays_are_not_part_of_scenarios() {
    let folder = folder();
    let text = scenario(FmiVersion::V3);
    let sound = plan(&folder, &text).unwrap();
    assert_eq!(
        sound.warnings,
        [
            "integral.toml:7:8: the input `v` is an array, which keeps its start values; only scalars can be connected or set"
        ]
    );
    assert!(!sound.columns.iter().any(|column| column.name == "w"));
    let set = text.replace("k = 2.0", "k = 2.0, bits = true");
    let mistakes = plan(&folder, &set).unwrap_err();
    assert!(mistakes[0].ends_with("`bits` is an array of 2 elements, which a scenario cannot set"), "{mistakes:?}");
    let connected = text.replace("[[case]]", "[[connection]]\nfrom = \"decay:w\"\nto = \"integral:y\"\n[[case]]");
    let mistakes = plan(&folder, &connected).unwrap_err();
    assert!(mistakes[0].ends_with("`w` of `decay` is an array, which cannot be connected"), "{mistakes:?}");
}

/// SSP 1.0 and libcosim are of the time before FMI 3.0.
#[test]
fn fmi_3_is_exported_as_ssp_2() {
    let folder = folder();
    // Without its enumerations, which are not exported.
    let edits = [
        (
            "name=\"mode\" valueReference=\"16\" causality=\"input\"",
            "name=\"mode\" valueReference=\"16\" causality=\"parameter\"",
        ),
        ("    <Enumeration name=\"next\" valueReference=\"17\" causality=\"output\" declaredType=\"Mode\"/>\n", ""),
        ("    <Output valueReference=\"17\" dependencies=\"16\"/>\n", ""),
        ("    <InitialUnknown valueReference=\"17\" dependencies=\"16\"/>\n", ""),
    ];
    Decay { edits: &edits, ..Decay::new(FmiVersion::V3) }.pack(folder.path());
    // Reference: SSP 2.0, which adds the types of FMI 3.0. The structure without FMI 3.0 stays one of SSP 1.0.
    for (fmi, version, value, types, osp) in [
        (FmiVersion::V2, "1.0", "<ssv:Real value=\"2.0\"", &["<ssc:Real"][..], true),
        (FmiVersion::V3, "2.0", "<ssv:Float64 value=\"2.0\"", &["<ssc:Float64", "<ssc:Real"], false),
    ] {
        let text = scenario(fmi).replace(", mode = \"second\"", "");
        let exported = plan(&folder, &text).unwrap();
        let out = folder.path().join(version);
        let files = System::new(&exported, &exported.runs[0]).unwrap().write(&out, false).unwrap();
        assert_eq!(out.join(OSP_STRUCTURE).exists(), osp);
        assert_eq!(files.len(), if osp { 2 } else { 1 });
        let mut package = zip::ZipArchive::new(std::fs::File::open(&files[0]).unwrap()).unwrap();
        let mut text = |name: &str| std::io::read_to_string(package.by_name(name).unwrap()).unwrap();
        let structure = text(STRUCTURE);
        assert!(structure.contains(&format!("version=\"{version}\"")), "{structure}");
        // The component `integral` is of FMI 2.0 in both.
        assert!(types.iter().all(|name| structure.contains(name)), "{structure}");
        assert_eq!(structure.contains("ssc:Float64"), !osp);
        let values = text("resources/decay.ssv");
        assert!(values.contains(&format!("version=\"{version}\"")), "{values}");
        assert!(values.contains(value), "{values}");
    }
}

/// A component has to be steppable.
#[test]
fn a_component_for_model_exchange_only_is_a_mistake() {
    let folder = folder();
    let line = include_str!("../../fmu-import/tests/data/decay3.xml");
    let line = line.lines().find(|line| line.contains("<CoSimulation")).unwrap();
    Decay { edits: &[(line, "")], ..Decay::new(FmiVersion::V3) }.pack(folder.path());
    let mistakes = plan(&folder, &scenario(FmiVersion::V3)).unwrap_err();
    let expected = "has no interface for co-simulation, by which a scenario steps its FMUs";
    assert!(mistakes[0].ends_with(expected), "{mistakes:?}");
}
