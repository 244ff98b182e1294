//! Systems of FMUs of both versions of FMI, built from C in a temporary folder.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/decay.rs"]
mod decay;
#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;
#[path = "../../../tests/zoo/zoo.rs"]
mod zoo;

use decay::Decay;
use fmu_import::description::FmiVersion;
use fmu_system::export::{OSP_STRUCTURE, STRUCTURE, System};
use fmu_system::fmus::Fmus;
use fmu_system::master::{self, Recording};
use fmu_system::plan::Plan;
use fmu_system::problem::Problem;
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve_text};
use miette::Diagnostic as _;
use std::path::Path;
use support::Build;
use tempfile::TempDir;
use zoo::Zoo;

/// x' = -2 x, exactly, and its integral by the explicit Euler method. The inputs that exist only in FMI 3.0 replace
/// `INPUTS`.
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

const FLAGS: &str = "canGetAndSetFMUstate=\"true\" canHandleVariableCommunicationStepSize=\"true\"";

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

/// The reference is the sum over the outputs of the previous steps. The last bits depend on the C library's exponential
/// function.
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
    // Bit-identical: the calls and their order are the same.
    assert_eq!(integrals[0], integrals[1]);
}

/// Steps of 0.1 s of an FMU that makes at most 0.03 s: it discards the step (FMI 3.0.2, section 2.2.4), or returns early
/// with or without the flag. The step is made of 0.03, 0.03, 0.03 and 0.01 s, and x = exp(-2 t).
#[test]
fn a_discarded_step_and_an_early_return_are_repeated_in_shorter_steps() {
    for (flag, status) in [(0, 2), (1, 0), (0, 0)] {
        let folder = TempDir::new().unwrap();
        let defects = ["LIMIT=0.03".to_owned(), format!("SHORT={flag}"), format!("STATUS={status}")];
        let defects = defects.each_ref().map(String::as_str);
        Decay { defects: &defects, ..Decay::new(FmiVersion::V3) }.pack(folder.path());
        Build { flags: FLAGS, ..Build::new("Integral", "y", "integral") }.pack(folder.path());
        let plan = plan(&folder, &scenario(FmiVersion::V3).replace("step = 0.01", "step = 0.1")).unwrap();
        let recording = master::execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap();
        let steps = recording.steps.unwrap();
        assert_eq!((steps.accepted, steps.rejected), (12, 9), "{flag} {status}");
        for (time, x) in recording.time.iter().zip(column(&plan, &recording, "x")) {
            assert!((x - (-2.0 * time).exp()).abs() < 1e-14, "{flag} {status}: {time}");
        }
    }
}

/// w = x v by element, with x = exp(-2 t) as above; v starts at (1, 2, 3).
#[test]
fn arrays_are_connected_set_and_recorded_by_element() {
    let folder = folder();
    let text = scenario(FmiVersion::V3);
    let set = text
        .replace("label = \"v\"", "label = \"v\", \"bits[2]\" = true")
        .replace("flag = true", "flag = true, \"v[2]\" = 5.0");
    let connected = set.replace("[[case]]", "[[connection]]\nfrom = \"decay:w[3]\"\nto = \"integral:y\"\n[[case]]");
    let plan = plan(&folder, &connected).unwrap();
    let warning = "array elements that nothing writes keep their start values: `v[1]` and 1 more";
    assert!(plan.warnings[0].contains(warning), "{:?}", plan.warnings);
    assert_eq!(plan.runs[0].components[0].parameters[0].name, "bits[2]");
    let fmus = Fmus::load(&plan.runs).unwrap();
    let recording = master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap();
    let x = column(&plan, &recording, "x");
    for (name, v) in [("w[1]", 1.0), ("w[2]", 5.0), ("w[3]", 3.0)] {
        let w = column(&plan, &recording, name);
        assert!(w.iter().zip(x).all(|(w, x)| *w == x * v), "{name}: {w:?}");
    }
    let integral = column(&plan, &recording, "integral");
    let mut sum = 0.0;
    for k in 1..=30 {
        sum += 0.01 * 3.0 * x[k];
        assert!((integral[k] - sum).abs() < 1e-14, "{k}");
    }
}

/// The name of a whole array is a mistake that names its elements.
#[test]
fn an_array_as_a_whole_is_a_mistake() {
    let folder = folder();
    let text = scenario(FmiVersion::V3);
    for (from, to, help) in [
        ("k = 2.0", "k = 2.0, bits = true", "`bits` is an array: write its elements, `bits[1]` to `bits[2]`"),
        ("u = 0.25", "u = 0.25, v = 1.0", "`v` is an array: write its elements, `v[1]` to `v[3]`"),
        (
            "[[case]]",
            "[[connection]]\nfrom = \"decay:w\"\nto = \"integral:y\"\n[[case]]",
            "`w` is an array: write its elements, `w[1]` to `w[3]`",
        ),
    ] {
        let source = FmuFolder::new([folder.path()]);
        let text = text.replace(from, to);
        let resolved = resolve_text(Path::new("integral.toml"), &text, &source, &Options::default());
        let Err(ResolveError::Problems(found)) = resolved else { panic!("{to} is accepted") };
        assert_eq!(found.problems[0].help().map(|found| found.to_string()).as_deref(), Some(help));
    }
}
/// SSP 1.0 and libcosim predate FMI 3.0.
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
    // Reference: SSP 2.0, which adds the types of FMI 3.0. Without FMI 3.0, the structure is still one of SSP 1.0.
    for (fmi, version, value, types, osp) in [
        (FmiVersion::V2, "1.0", "<ssv:Real value=\"2.0\"", &["<ssc:Real"][..], true),
        (FmiVersion::V3, "2.0", "<ssv:Float64 value=\"2.0\"", &["<ssc:Float64", "<ssc:Real"], false),
    ] {
        let text = scenario(fmi).replace(", mode = \"second\"", "");
        let exported = plan(&folder, &text).unwrap();
        let out = folder.path().join(version);
        let system = System::new(&exported, &exported.runs[0]).unwrap();
        let files = system.write(&out, false).unwrap();
        assert_eq!(out.join(OSP_STRUCTURE).exists(), osp);
        let note = "OspSystemStructure.xml is left out, because libcosim does not support FMUs of FMI 3.0".to_string();
        assert_eq!(system.notes(), if osp { vec![] } else { vec![note] });
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
    // Other masters do not support elements of arrays.
    let text = scenario(FmiVersion::V3).replace("flag = true", "flag = true, \"v[2]\" = 5.0");
    let text = text.replace(", mode = \"second\"", "");
    let plan = plan(&folder, &text).unwrap();
    let error = System::new(&plan, &plan.runs[0]).unwrap_err().to_string();
    assert!(error.contains("`decay:v[2]` is an element of an array, which no other master connects"), "{error}");
}

/// An FMU with model exchange only is integrated by the master, and exported as such.
#[test]
fn a_component_for_model_exchange_only_needs_no_key() {
    let folder = folder();
    let line = include_str!("../../fmu-import/tests/data/decay2.xml");
    let line = line.lines().find(|line| line.contains("<CoSimulation")).unwrap();
    Decay { edits: &[(line, "")], ..Decay::new(FmiVersion::V2) }.pack(folder.path());
    let plan = plan(&folder, &scenario(FmiVersion::V2)).unwrap();
    let fmus = Fmus::load(&plan.runs).unwrap();
    let recording = master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap();
    for (k, x) in column(&plan, &recording, "x").iter().enumerate() {
        assert!((x - (-0.02 * k as f64).exp()).abs() < 1e-6, "{k}: {x}");
    }
    let files = System::new(&plan, &plan.runs[0]).unwrap().write(&folder.path().join("system"), false).unwrap();
    let mut archive = zip::ZipArchive::new(std::fs::File::open(&files[0]).unwrap()).unwrap();
    let structure = std::io::read_to_string(archive.by_name(STRUCTURE).unwrap()).unwrap();
    assert!(structure.contains("source=\"resources/Decay2.fmu\" implementation=\"ModelExchange\""), "{structure}");
    // libcosim integrates nothing.
    assert_eq!(files.len(), 1);
}

const ALIASES: &str = r#"
title = "Aliases"
[simulation]
stop = 0.2
step = 0.1
[[component]]
name = "first"
fmu = "Zoo"
inputs = { command = 2.0, ui = 0, ub = false, ue = "eco" }
parameters = { gain = 3.0 }
[[component]]
name = "second"
fmu = "Zoo"
inputs = { ui = 0, ub = false, ue = "eco" }
[[connection]]
from = "first:twin"
to = "second:command"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["first:y", "first:twin", "second:y"]
"#;

/// y = k u. Aliases of inputs, outputs and parameters work like names. Inputs of type String keep their start values.
#[test]
fn aliases_are_names() {
    let folder = TempDir::new().unwrap();
    let edits = [
        (r#"causality="input" start="0"/>"#, r#"causality="input" start="0"><Alias name="command"/></Float64>"#),
        (r#"causality="output"/>"#, r#"causality="output"><Alias name="twin"/></Float64>"#),
        (r#"variability="tunable" start="1"/>"#, r#"variability="tunable" start="1"><Alias name="gain"/></Float64>"#),
    ];
    Zoo { fmi: FmiVersion::V3, at: 1e9, edits: &edits, ..Zoo::new("none") }.pack(folder.path());
    let found = plan(&folder, ALIASES).unwrap();
    let fmus = Fmus::load(&found.runs).unwrap();
    let recording = master::execute(&found.simulation, &found.runs[0], &fmus).unwrap();
    assert_eq!(recording.columns, [(); 3].map(|()| Some(vec![6.0; 3])));
    let twice = ALIASES.replace("gain = 3.0", "gain = 3.0, k = 2.0");
    let said = plan(&folder, &twice).unwrap_err().join("\n");
    assert!(said.contains("`k` sets `k` again") || said.contains("`gain` sets `k` again"), "{said}");
    let twice = ALIASES.replace("command = 2.0", "command = 2.0, u = 2.0");
    assert!(plan(&folder, &twice).unwrap_err().join("\n").contains("both match `u`"));
}

/// Hints of mistakes: the folder of the other version of FMI, and the role of a name that is not an output.
#[test]
fn help_contains_the_other_folder_and_the_role_of_a_name() {
    let root = TempDir::new().unwrap();
    let [second, third] = ["fmu", "fmu3"].map(|name| root.path().join(name));
    [&second, &third].iter().for_each(|folder| std::fs::create_dir(folder).unwrap());
    Decay { has_clocks: true, ..Decay::new(FmiVersion::V3) }.pack(&third);
    let help = |folder: &Path, signal: &str| {
        let scenario = format!(
            "title = \"Clocks\"\n[simulation]\nstop = 1.0\nstep = 0.25\n[[component]]\nname = \"one\"\nfmu = \"Decay3\"\n\
             inputs = {{ u = 1.0 }}\n[[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\nsignals = [\"{signal}\"]\n"
        );
        let source = FmuFolder::new([folder]);
        match resolve_text(Path::new("clocks.toml"), &scenario, &source, &Options::default()) {
            Err(ResolveError::Problems(problems)) => {
                miette::Diagnostic::help(&problems.problems[0]).unwrap().to_string()
            }
            other => panic!("{other:?}"),
        }
    };
    let place = third.display();
    assert_eq!(help(&second, "one:ticks"), format!("add `--fmus {place}`, which contains Decay3.fmu"));
    assert_eq!(help(&third, "one:every"), "`every` is an input Clock, not an output");
}

/// An FMU without co-simulation is stepped in scheduled execution, at the times in its description: `every` at 0.25 s
/// and then every 0.5 s, `varying` 0.3 s and 1 s after each full second, `timer` at 1.25 s.
#[test]
fn a_component_with_scheduled_execution_only_is_stepped() {
    let folder = folder();
    let text = include_str!("../../fmu-import/tests/data/clocks.xml");
    let interface = text.lines().find(|line| line.contains("<CoSimulation")).unwrap();
    Decay { has_clocks: true, edits: &[(interface, "")], ..Decay::new(FmiVersion::V3) }.pack(folder.path());
    let scenario = "title = \"Scheduled\"\n[simulation]\nstop = 1.5\nstep = 0.25\n[[component]]\nname = \"one\"\nfmu = \"Decay3\"\ninputs = { u = 1.0 }\n\
                    [[component]]\nname = \"two\"\nfmu = \"Decay3\"\ninputs = { u = 1.0 }\n[[case]]\nname = \"only\"\ntitle = \"Only\"\n\
                    [record]\nsignals = [\"one:ticks\", \"one:third\"]\n";
    let plan = plan(&folder, scenario).unwrap();
    assert_eq!(plan.runs[0].components[0].model_identifier, "Decay");
    let never = "the clock `asked` of `one` is triggered and never ticks: no clock is connected to it";
    assert!(plan.warnings.iter().any(|warning| warning.ends_with(never)), "{:?}", plan.warnings);
    let recording = master::execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap();
    // A tick at the end of a step belongs to the next one.
    assert_eq!(recording.column(0).unwrap(), [0.0, 0.0, 2.0, 2.0, 3.0, 4.0, 7.0]);
    // The output clock `third` ticks with the third tick of `every`.
    assert_eq!(recording.column(1).unwrap(), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);

    // Its clocks are those of the scheduler.
    let connected = format!("{scenario}[[connection]]\nfrom = \"one:third\"\nto = \"two:asked\"\n");
    let mistakes = self::plan(&folder, &connected).unwrap_err();
    let rule = "is a Clock in scheduled execution, which cannot be connected";
    assert!(mistakes[0].contains(&format!("`one:third` {rule}, but its target `two:asked` {rule}")), "{mistakes:?}");
}
