//! Output clocks that tick at events of their FMU. The FMU is built from `data/clocks.c`, which rejects calls that FMI
//! 3.0 does not allow. Systems with other clocks are in `tests/tests/clocked_systems.rs`.
#![cfg(unix)]

use fmu_import::archive::platform_of;
use fmu_import::description::FmiVersion;
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve_text};
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use zip::write::{SimpleFileOptions, ZipWriter};

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let (source, binary) = (folder.path().join("clocks.c"), folder.path().join("clocks.so"));
    std::fs::write(&source, include_str!("data/clocks.c")).unwrap();
    let mut cc = Command::new("cc");
    cc.args(["-O1", "-fPIC", "-shared", "-fvisibility=hidden", "-o"]).arg(&binary).arg(&source).arg("-lm");
    assert!(cc.status().unwrap().success());
    let mut zip = ZipWriter::new(File::create(folder.path().join("Crossing.fmu")).unwrap());
    let library = format!("binaries/{}/Crossing{}", platform_of(FmiVersion::V3), std::env::consts::DLL_SUFFIX);
    let description = include_bytes!("data/clocks.xml").to_vec();
    for (name, content) in [("modelDescription.xml", description), (&library, std::fs::read(&binary).unwrap())] {
        zip.start_file(name, SimpleFileOptions::default()).unwrap();
        zip.write_all(&content).unwrap();
    }
    zip.finish().unwrap();
    folder
}

/// The clock ticks once after the initialization and at the end of the first step at or after each multiple of 0.25 s.
/// The counter ticks with it and reads the time. The crossings of the counter itself are connected to nothing.
#[test]
fn an_output_clock_at_the_end_of_a_step_activates_the_other_fmu() {
    let folder = folder();
    for (step, order) in [(0.1, "sequential"), (0.05, "sequential"), (0.1, "jacobi")] {
        for names in [["source", "counter"], ["counter", "source"]] {
            let mut text =
                format!("title = \"Clocks\"\n[simulation]\nstop = 1.0\nstep = {step}\norder = \"{order}\"\n");
            for name in names {
                let inputs = if name == "source" { "inputs = { value = 0.0 }\n" } else { "" };
                text += &format!("[[component]]\nname = \"{name}\"\nfmu = \"Crossing\"\n{inputs}");
            }
            for (from, to) in [("crossing", "trigger"), ("time_out", "value")] {
                text += &format!("[[connection]]\nfrom = \"source:{from}\"\nto = \"counter:{to}\"\n");
            }
            text += "[[case]]\nname = \"only\"\ntitle = \"Only\"\n";
            text += "[record]\nsignals = [\"counter:count\", \"counter:last\", \"source:crossing\"]\n";
            let source = FmuFolder::new([folder.path()]);
            let plan = resolve_text(Path::new("clocks.toml"), &text, &source, &Options::default()).unwrap();
            let never = "the clock `trigger` of `source` is triggered and never ticks: no clock is connected to it";
            assert!(plan.warnings.len() == 1 && plan.warnings[0].contains(never), "{:?}", plan.warnings);
            let recording = master::execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap();
            let column = |name: &str| plan.columns.iter().position(|column| column.name == name).unwrap();
            let [count, last, ticks] =
                ["count", "last", "crossing"].map(|name| recording.column(column(name)).unwrap());
            for row in 0..count.len() {
                let crossings = (row as f64 * step / 0.25 + 1e-9).floor();
                // The end of the step in which the last multiple of 0.25 s was reached.
                let time = (0.25 * crossings / step - 1e-9).ceil() * step;
                assert_eq!(count[row], 1.0 + crossings, "{step} s, {order}, {names:?}, row {row}");
                // The recorded clock is 1 in each row after whose predecessor it has ticked.
                let before = if row == 0 { 0.0 } else { count[row - 1] };
                assert_eq!(ticks[row], count[row] - before, "{step} s, {order}, {names:?}, row {row}");
                assert!((last[row] - time).abs() < 1e-12, "{step} s, {order}, row {row}: {} s", last[row]);
            }
        }
    }
}

/// The clocks of an FMU tick at instants of its own; a component that makes fewer or shorter steps would miss them.
#[test]
fn components_with_clocks_have_the_rate_of_the_run() {
    let folder = folder();
    for key in ["every", "substeps"] {
        let text = format!(
            "title = \"Clocks\"\n[simulation]\nstop = 1.0\nstep = 0.1\n[[component]]\nname = \"source\"\nfmu = \
             \"Crossing\"\n{key} = 2\ninputs = {{ value = 0.0 }}\n[[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\n\
             signals = [\"source:count\"]\n"
        );
        let source = FmuFolder::new([folder.path()]);
        let Err(ResolveError::Problems(found)) =
            resolve_text(Path::new("clocks.toml"), &text, &source, &Options::default())
        else {
            panic!("the plan has no mistake")
        };
        let message = found.problems[0].to_string();
        assert!(message.contains(&format!("has clocks, so the component cannot have `{key}`")), "{message}");
    }
}
