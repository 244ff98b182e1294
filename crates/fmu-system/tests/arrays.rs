//! Elements of arrays of FMI 3.0 as signals, and integers of 64 bits. The FMU is built from `data/arrays.c`, which
//! transfers each array as a whole or returns an error.
#![cfg(unix)]
#![allow(unsafe_code, reason = "an allocator that counts can only be written with unsafe code")]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_import::archive::platform_of;
use fmu_import::description::{FmiVersion, Value};
use fmu_system::failure::Failure;
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::plan::Plan;
use fmu_system::problem::Problem;
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve_text};
use fmu_system::session::Session;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::fs::File;
use std::io::Write;
use std::path::Path;
use std::process::Command;
use support::Build;
use tempfile::TempDir;
use zip::write::{SimpleFileOptions, ZipWriter};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: everything is passed on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

const SCENARIO: &str = r#"
title = "Arrays"
[simulation]
stop = 0.3
step = 0.1
[[component]]
name = "a"
fmu = "Arrays"
inputs = { s = 1, q = 0, INPUTS }
parameters = { PARAMETERS }
[[component]]
name = "b"
fmu = "Arrays"
inputs = { s = 1, q = 0, OTHERS }
[[component]]
name = "integral"
fmu = "Integral"
inputs = { CONSTANT }
CONNECTIONS
[[case]]
name = "only"
title = "Only"
[record]
signals = [SIGNALS]
"#;

/// m[i,j] = 10 i + j.
const M: &str = r#""m[1,1]" = 11, "m[1,2]" = 12, "m[1,3]" = 13, "m[2,1]" = 21, "m[2,2]" = 22, "m[2,3]" = 23.0"#;

/// A scenario with these entries.
#[derive(Default)]
struct Scenario<'a> {
    inputs: &'a str,
    others: &'a str,
    parameters: &'a str,
    connections: &'a [(&'a str, &'a str)],
    signals: &'a [&'a str],
}

impl Scenario<'_> {
    fn text(&self) -> String {
        let Self { inputs, others, parameters, connections, signals } = *self;
        let is_written = connections.iter().any(|(_, to)| to.starts_with("integral"));
        let connections: String = connections
            .iter()
            .map(|(from, to)| format!("[[connection]]\nfrom = \"{from}\"\nto = \"{to}\"\n"))
            .collect();
        let signals: Vec<String> = signals.iter().map(|signal| format!("\"{signal}\"")).collect();
        SCENARIO
            .replace("INPUTS", inputs)
            .replace("OTHERS", others)
            .replace("PARAMETERS", parameters)
            .replace("CONSTANT", if is_written { "" } else { "u = 0" })
            .replace("CONNECTIONS", &connections)
            .replace("SIGNALS", &signals.join(", "))
    }

    fn plan_with(&self, folder: &TempDir, options: &Options) -> Result<Plan, Vec<String>> {
        let source = FmuFolder::new([folder.path()]);
        resolve_text(Path::new("arrays.toml"), &self.text(), &source, options).map_err(|error| match error {
            ResolveError::Problems(problems) => problems.problems.iter().map(Problem::explained).collect(),
            other => vec![other.to_string()],
        })
    }

    fn plan(&self, folder: &TempDir) -> Plan {
        self.plan_with(folder, &Options::default()).unwrap()
    }

    fn mistakes(&self, folder: &TempDir) -> String {
        self.plan_with(folder, &Options::default()).unwrap_err().join("\n")
    }
}

/// Names and last values of the recorded signals.
fn last(plan: &Plan) -> Result<Vec<(String, f64)>, Failure> {
    let fmus = Fmus::load(&plan.runs).unwrap();
    let recording = master::execute(&plan.simulation, &plan.runs[0], &fmus)?;
    let value = |column: usize| *recording.column(column).unwrap().last().unwrap();
    Ok(plan.columns.iter().enumerate().map(|(index, column)| (column.name.clone(), value(index))).collect())
}

fn expected(signals: &[(&str, f64)]) -> Vec<(String, f64)> {
    signals.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
}

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let (source, binary) = (folder.path().join("arrays.c"), folder.path().join("arrays.so"));
    std::fs::write(&source, include_str!("data/arrays.c")).unwrap();
    let mut cc = Command::new("cc");
    cc.args(["-O1", "-fPIC", "-shared", "-fvisibility=hidden"]).arg("-o").arg(&binary).arg(&source);
    assert!(cc.status().unwrap().success());
    let mut zip = ZipWriter::new(File::create(folder.path().join("Arrays.fmu")).unwrap());
    let mut add = |name: &str, content: &[u8]| {
        zip.start_file(name, SimpleFileOptions::default()).unwrap();
        zip.write_all(content).unwrap();
    };
    add("modelDescription.xml", include_bytes!("data/arrays.xml"));
    let suffix = std::env::consts::DLL_SUFFIX;
    add(&format!("binaries/{}/Arrays{suffix}", platform_of(FmiVersion::V3)), &std::fs::read(&binary).unwrap());
    zip.finish().unwrap();
    Build::new("Integral", "u", "integral").pack(folder.path());
    folder
}

/// t = (m k)', with k[1,2] = 3 and all other elements of k at their start value 1. Expected values computed by hand, in
/// row-major order.
#[test]
fn elements_are_set_and_recorded_in_row_major_order() {
    let folder = folder();
    let scenario = Scenario {
        inputs: M,
        parameters: r#""k[1,2]" = 3.0, "e[2]" = -7"#,
        signals: &["a:t[*", "a:eo[2]", "sum"],
        ..Scenario::default()
    };
    let plan = scenario.plan(&folder);
    let values = [11.0, 21.0, 36.0, 22.0, 13.0, 23.0];
    let names = ["t[1,1]", "t[1,2]", "t[2,1]", "t[2,2]", "t[3,1]", "t[3,2]"];
    let mut signals: Vec<(&str, f64)> = names.into_iter().zip(values).collect();
    signals.extend([("eo[2]", -7.0), ("sum", values.iter().sum()), ("b:sum", 21.0)]);
    assert_eq!(last(&plan).unwrap(), expected(&signals));
    // Set a parameter after the plan is made, as a study does.
    let (mut run, fmus) = (plan.runs[0].clone(), Fmus::load(&plan.runs).unwrap());
    run.set_parameter(&fmus, "a", "k[2,3]", Value::Real(2.0)).unwrap();
    run.set_parameter(&fmus, "b", "k[2,3]", Value::Real(2.0)).unwrap();
    let recording = master::execute(&plan.simulation, &run, &fmus).unwrap();
    assert_eq!(recording.column(5).unwrap().last(), Some(&46.0));
    assert_eq!(recording.column(8).unwrap().last(), Some(&27.0));
}

/// Connects element to element, scalar to element, and element to a scalar of FMI 2.0, for arrays of all types.
#[test]
fn elements_are_wired_like_scalars() {
    let folder = folder();
    let scenario = Scenario {
        inputs: &format!(
            "{M}, \"w[1]\" = 1, \"w[2]\" = -2, \"w[3]\" = 3, \"f[1]\" = 0.5, \"f[2]\" = 1.5, \"b[*\" = true"
        ),
        others: r#""m[2,*" = 0.5, "m[1,3]" = -1.0"#,
        connections: &[
            ("a:t[2,1]", "b:m[1,1]"),
            ("a:sum", "b:m[1,2]"),
            ("a:t[3,2]", "integral:u"),
            ("a:v[1]", "b:w[1]"),
            ("a:v[2]", "b:w[2]"),
            ("a:v[3]", "b:w[3]"),
            ("a:g[1]", "b:f[1]"),
            ("a:g[2]", "b:f[2]"),
            ("a:no[70]", "b:b[70]"),
        ],
        signals: &["b:t[*", "b:v[*", "b:g[*", "a:no[70]", "b:no[70]", "integral"],
        ..Scenario::default()
    };
    let plan = scenario.plan(&folder);
    for order in [fmu_system::run::Order::Sequential, fmu_system::run::Order::Jacobi] {
        let mut plan = plan.clone();
        plan.simulation.order = order;
        let signals = [
            ("no[70]", 0.0),
            ("t[1,1]", 12.0),
            ("t[1,2]", 0.5),
            ("t[2,1]", 102.0),
            ("t[2,2]", 0.5),
            ("t[3,1]", -1.0),
            ("t[3,2]", 0.5),
            ("g[1]", 2.0),
            ("g[2]", 6.0),
            ("b:no[70]", 1.0),
            ("v[1]", 1.0),
            ("v[2]", -2.0),
            ("v[3]", 3.0),
        ];
        let found = last(&plan).unwrap();
        assert_eq!(found[..signals.len()], expected(&signals));
        assert_eq!(found[signals.len()].0, "integral");
        assert!((found[signals.len()].1 - 0.3 * 23.0).abs() < 1e-12, "{found:?}");
    }
}

/// A `*` at both ends of a connection stands for the same text. With a `*` in `to` alone, all matching inputs read one
/// output.
#[test]
fn patterns_connect_several_inputs() {
    let folder = folder();
    let scenario = |connections| {
        let inputs = format!("{M}, \"w[*\" = 1, \"f[*\" = 0.5, \"b[*\" = true");
        let scenario = Scenario {
            inputs: &inputs,
            others: r#""b[*" = true"#,
            connections,
            signals: &["b:t[*", "b:v[*", "b:g[*"],
            ..Scenario::default()
        };
        serde_json::to_value(scenario.plan(&folder)).unwrap()
    };
    let one_by_one = [
        ("a:v[1]", "b:w[1]"),
        ("a:v[2]", "b:w[2]"),
        ("a:v[3]", "b:w[3]"),
        ("a:g[1]", "b:f[1]"),
        ("a:g[2]", "b:f[2]"),
        ("a:sum", "b:m[1,1]"),
        ("a:sum", "b:m[1,2]"),
        ("a:sum", "b:m[1,3]"),
        ("a:sum", "b:m[2,1]"),
        ("a:sum", "b:m[2,2]"),
        ("a:sum", "b:m[2,3]"),
    ];
    let patterns = [("a:v*", "b:w*"), ("a:g[*]", "b:f[*]"), ("a:sum", "b:m*")];
    assert_eq!(scenario(&patterns), scenario(&one_by_one));
}

#[test]
fn limits_and_indices_are_those_of_the_elements() {
    let folder = folder();
    let of = |parameters| Scenario { parameters, signals: &["sum"], ..Scenario::default() }.mistakes(&folder);
    let limited = of("\"k[2,1]\" = 200.0");
    assert!(limited.contains("`k[2,1]` is 200.0, expected at most 100"), "{limited}");
    let beyond = of("\"k[3,1]\" = 2.0");
    assert!(beyond.contains("Arrays has no parameter `k[3,1]`"), "{beyond}");
}

/// A column of a file writes an element: it rises linearly from 11 to 14 in 0.3 s. The last step gets the value at its
/// middle.
#[test]
fn elements_are_read_from_a_file() {
    let folder = folder();
    let file = folder.path().join("in.csv");
    std::fs::write(&file, "time,\"m[1,1]\",a:w[2]\n0,11,-3\n0.3,14,-3\n").unwrap();
    let rest = r#""m[1,2]" = 12, "m[1,3]" = 13, "m[2,*" = 0.0, "w[1]" = 1, "w[3]" = 9007199254740992"#;
    let scenario = Scenario {
        inputs: rest,
        others: r#""m[1,2]" = 0, "m[1,3]" = 0, "m[2,*" = 0.0"#,
        signals: &["a:t[1,*", "a:v[*"],
        ..Scenario::default()
    };
    let plan = scenario.plan_with(&folder, &Options { inputs: Some(file.clone()), ..Options::default() }).unwrap();
    let found = last(&plan).unwrap();
    assert!((found[0].1 - 13.5).abs() < 1e-12, "{found:?}");
    assert_eq!(found[1..], expected(&[("t[1,2]", 0.0), ("v[1]", -1.0), ("v[2]", 3.0), ("v[3]", -9007199254740992.0)]));
    std::fs::write(&file, "time,\"m[1,1]\",a:w[2]\n0,11,-3\n0.3,14,9007199254740993\n").unwrap();
    let beyond = scenario.plan_with(&folder, &Options { inputs: Some(file), ..Options::default() }).unwrap_err();
    assert!(beyond[0].contains("is Int64, which takes only whole numbers below 2^53 from a file"), "{beyond:?}");
}

/// A signal holds integers up to 2^53. A larger one, which would be rounded, is an error.
#[test]
fn integers_of_64_bits_are_exact_or_an_error() {
    let folder = folder();
    let signals: &[&str] = &["a:so", "a:uo", "b:so", "a:v[1]"];
    let wide = |s: i64, up: i64, w: i64| {
        let (inputs, parameters) = (format!("\"w[*\" = {w}"), format!("up = {up}"));
        let text = Scenario {
            inputs: &inputs,
            parameters: &parameters,
            connections: &[("a:so", "b:s")],
            signals,
            ..Scenario::default()
        };
        let text = text.text().replacen("s = 1, q", &format!("s = {s}, q"), 1).replacen("s = 1, q = 0", "q = 0", 1);
        resolve_text(Path::new("arrays.toml"), &text, &FmuFolder::new([folder.path()]), &Options::default())
    };
    let limit = 1_i64 << 53;
    for (s, up, w) in
        [(5_000_000_000, 4_294_967_296, -5_000_000_001), (-limit, limit, limit - 1), (limit - 1, 0, -limit)]
    {
        let plan = wide(s, up, w).unwrap();
        // All these integers are doubles.
        let signals = [("v[1]", -w as f64), ("so", s as f64), ("uo", up as f64), ("b:so", s as f64)];
        assert_eq!(last(&plan).unwrap(), expected(&signals));
    }
    for (s, up, w, function) in [(limit + 1, 0, 0, "Int64"), (0, i64::MAX, 0, "UInt64"), (0, 0, -limit - 1, "Int64")] {
        let error = last(&wide(s, up, w).unwrap()).unwrap_err().to_string();
        let message =
            format!("`a`: fmi3Get{function}: a value is beyond 2^53 and cannot be represented exactly in a signal");
        assert!(error.contains(&message), "{error}");
    }
    // Without the parameter, the start value in the FMU applies.
    let start = Scenario { signals: &["a:uo"], ..Scenario::default() }.plan(&folder);
    assert_eq!(last(&start).unwrap(), expected(&[("uo", 5e9)]));
    let negative = Scenario { parameters: "up = -1", signals: &["a:uo"], ..Scenario::default() }.mistakes(&folder);
    assert!(
        negative.contains("`up` is -1, expected a whole number from 0 to 9223372036854775807 (UInt64)"),
        "{negative}"
    );
    // A 64-bit output connected to a 32-bit input.
    let connected = |s: i64| {
        let scenario = Scenario { connections: &[("a:so", "b:q")], signals: &["b:qo"], ..Scenario::default() };
        let text = scenario.text().replacen("s = 1, q", &format!("s = {s}, q"), 1);
        let text = text.replacen("s = 1, q = 0", "s = 1", 1);
        let plan = resolve_text(Path::new("arrays.toml"), &text, &FmuFolder::new([folder.path()]), &Options::default());
        last(&plan.unwrap()).map_err(|error| error.to_string())
    };
    assert_eq!(connected(-2_147_483_648).unwrap(), expected(&[("qo", -2_147_483_648.0)]));
    let error = connected(2_147_483_648).unwrap_err();
    assert!(error.contains("`b`: fmi3SetInt32: a value does not fit the type of the variable"), "{error}");
}

/// Tests a step with connected arrays of all types. The allocator counts the allocations of this thread.
#[test]
fn a_step_with_arrays_does_not_allocate() {
    let folder = folder();
    let plan = Scenario {
        inputs: &format!("{M}, \"w[*\" = 1, \"f[*\" = 0.5, \"b[*\" = true"),
        others: "\"m[*\" = 1.0",
        connections: &[
            ("a:v[1]", "b:w[1]"),
            ("a:v[2]", "b:w[2]"),
            ("a:v[3]", "b:w[3]"),
            ("a:g[1]", "b:f[1]"),
            ("a:g[2]", "b:f[2]"),
            ("a:no[70]", "b:b[70]"),
            ("a:t[3,2]", "integral:u"),
        ],
        signals: &["*"],
        ..Scenario::default()
    }
    .plan(&folder);
    let fmus = Fmus::load(&plan.runs).unwrap();
    let mut session = Session::new(&plan.simulation, &plan.runs[0], &fmus).unwrap();
    let before = ALLOCATIONS.get();
    for _ in 0..3 {
        session.step().unwrap();
    }
    assert_eq!(ALLOCATIONS.get() - before, 0);
    drop(std::hint::black_box(vec![1]));
    assert_eq!(ALLOCATIONS.get() - before, 1);
}
