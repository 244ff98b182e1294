//! Elements of arrays of FMI 3.0 as signals, and integers of 64 bits. The FMU is built from `data/arrays.c`, which
//! transfers each array as a whole or returns an error.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/arrays.rs"]
mod arrays;
mod counting;
#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_import::description::{ModelDescription, Value};
use fmu_system::failure::Failure;
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::plan::Plan;
use fmu_system::problem::Problem;
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve_text};
use fmu_system::results;
use fmu_system::run::Run;
use fmu_system::session::Session;
use std::path::Path;
use support::Build;
use tempfile::TempDir;

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

/// The file with the results of a run.
fn executed(plan: &Plan, run: &Run) -> String {
    let fmus = Fmus::load(std::slice::from_ref(run)).unwrap();
    let recording = master::execute(&plan.simulation, run, &fmus).unwrap();
    let names: Vec<String> = plan.columns.iter().map(|column| column.name.clone()).collect();
    let mut text = Vec::new();
    results::push_csv(&mut text, &names, &recording).unwrap();
    String::from_utf8(text).unwrap()
}

fn expected(signals: &[(&str, f64)]) -> Vec<(String, f64)> {
    signals.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect()
}

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    arrays::pack(folder.path(), &[]);
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
    let beyond =
        scenario.plan_with(&folder, &Options { inputs: Some(file.clone()), ..Options::default() }).unwrap_err();
    assert!(beyond[0].contains("is Int64, which takes only whole numbers below 2^53 from a file"), "{beyond:?}");
    // Each name of an input can be the name of a column.
    std::fs::write(&file, "time,a:source\n0,7\n0.3,7\n").unwrap();
    let scenario = Scenario { signals: &["a:so"], ..Scenario::default() };
    let text = scenario.text().replacen("s = 1, q", "q", 1);
    let options = Options { inputs: Some(file.clone()), ..Options::default() };
    let source = FmuFolder::new([folder.path()]);
    let plan = resolve_text(Path::new("arrays.toml"), &text, &source, &options).unwrap();
    assert_eq!(last(&plan).unwrap(), expected(&[("so", 7.0)]));
    std::fs::write(&file, "time,a:x\n0,1\n0.3,1\n").unwrap();
    let scenario = Scenario { signals: &["a:xo"], ..Scenario::default() };
    let options = Options { inputs: Some(file), ..Options::default() };
    let binary = scenario.plan_with(&folder, &options).unwrap_err();
    assert!(binary[0].contains("`x` is a Binary, which the input file cannot write"), "{binary:?}");
}

/// Integers of 64 bits keep all digits in parameters, constants, connections, saved states and results, also those
/// that a double rounds.
#[test]
fn integers_of_64_bits_are_exact() {
    let folder = folder();
    let limit = 1_i64 << 53;
    for (s, up) in [
        (5_000_000_000, 4_294_967_296),
        (limit + 1, (1 << 53) + 1),
        (-limit - 1, 0),
        (i64::MAX, i64::MAX as u64 + 1),
        (i64::MIN, u64::MAX),
    ] {
        let parameters = format!("up = \"{up}\"");
        let scenario = Scenario {
            inputs: &format!("\"w[*\" = {s}"),
            parameters: &parameters,
            connections: &[("a:so", "b:s")],
            signals: &["a:so", "a:uo", "b:so"],
            ..Scenario::default()
        };
        let text = scenario.text().replacen("s = 1, q", &format!("s = {s}, q"), 1).replacen("s = 1, q = 0", "q = 0", 1);
        let source = FmuFolder::new([folder.path()]);
        let plan = resolve_text(Path::new("arrays.toml"), &text, &source, &Options::default()).unwrap();
        // A plan is also read from its JSON.
        let run: Run = serde_json::from_str(&serde_json::to_string(&plan.runs[0]).unwrap()).unwrap();
        let recorded = executed(&plan, &run);
        let row = format!("{s},{up},{s}");
        assert!(recorded.lines().skip(1).all(|line| line.split_once(',').unwrap().1 == row), "{recorded}");
    }
    // Without the parameter, the start value in the FMU applies.
    let start = Scenario { signals: &["a:uo"], ..Scenario::default() }.plan(&folder);
    assert_eq!(last(&start).unwrap(), expected(&[("uo", 5e9)]));
    for (value, problem) in [
        ("-1", "`up` is -1, expected a whole number from 0 to 18446744073709551615 (UInt64)"),
        ("\"18446744073709551616\"", "`up` is Integer without named values, got the string \"18446744073709551616\""),
    ] {
        let parameters = format!("up = {value}");
        let wrong = Scenario { parameters: &parameters, signals: &["a:uo"], ..Scenario::default() }.mistakes(&folder);
        assert!(wrong.contains(problem), "{wrong}");
    }
}

/// FMI 3.0.2, section 2.2.6: an Int32 does not have all values of an Int64, a Float32 not those of a Float64; an Int64
/// has those of an Int32.
#[test]
fn connections_widen_but_do_not_narrow() {
    let folder = folder();
    // Without the constant of the input that the connection writes.
    let scenario = |from, to, constant: &str| {
        let text = Scenario { connections: &[(from, to)], signals: &["b:so", "b:qo"], ..Scenario::default() }.text();
        let (head, tail) = text.split_once("name = \"b\"").unwrap();
        let text = format!("{head}name = \"b\"{}", tail.replacen(constant, "", 1));
        let source = FmuFolder::new([folder.path()]);
        resolve_text(Path::new("arrays.toml"), &text, &source, &Options::default()).map_err(|error| match error {
            ResolveError::Problems(problems) => problems.problems[0].explained(),
            other => other.to_string(),
        })
    };
    let plan = scenario("a:qo", "b:s", "s = 1,").unwrap();
    assert_eq!(executed(&plan, &plan.runs[0]).lines().last(), Some("0.3,0,0.0"));
    let narrowing = scenario("a:so", "b:q", "q = 0,").unwrap_err();
    let expected = "`a:so` is Int64, but its target `b:q` is Int32";
    let help = "Int32 does not have all values of Int64: connect an output of a type that Int32 includes, or put a \
                component between them that converts the value";
    assert!(narrowing.contains(expected) && narrowing.contains(help), "{narrowing}");
    let narrowing = scenario("a:sum", "b:f[1]", "").unwrap_err();
    assert!(narrowing.contains("`a:sum` is Float64, but its target `b:f[1]` is Float32"), "{narrowing}");
}

/// xo is x with its bytes in reverse order. The FMU overwrites its buffer in the next call, so the values show that the
/// bytes are copied.
#[test]
fn binaries_are_set_connected_and_recorded() {
    let folder = folder();
    std::fs::write(folder.path().join("frame.bin"), [0, 1, 2, 0xff]).unwrap();
    let file = folder.path().join("frame.bin").to_string_lossy().replace('\\', "/");
    for (value, once, twice) in [
        ("\"\"".to_owned(), "", ""),
        ("\"AAH/\"".to_owned(), "ff0100", "0001ff"),
        ("{ hex = \"0001020304050607\" }".to_owned(), "0706050403020100", "0001020304050607"),
        (format!("{{ file = \"{file}\" }}"), "ff020100", "000102ff"),
    ] {
        let scenario = Scenario {
            inputs: &format!("x = {value}"),
            parameters: &format!("p = {value}"),
            connections: &[("a:xo", "b:x")],
            signals: &["a:xo", "b:xo", "a:po\"]\nbinary = \"hex\"\n#"],
            ..Scenario::default()
        };
        let plan = scenario.plan(&folder);
        assert!(plan.columns.iter().all(|column| column.is_binary));
        let run: Run = serde_json::from_str(&serde_json::to_string(&plan.runs[0]).unwrap()).unwrap();
        let recorded = executed(&plan, &run);
        let row = format!("{once},{twice},{twice}");
        assert_eq!(recorded.lines().next(), Some("time,xo,po,b:xo"));
        assert!(recorded.lines().skip(1).all(|line| line.split_once(',').unwrap().1 == row), "{recorded}");
    }
    // An input without a source keeps its start value. Base64 is the default; the file starts with it.
    let plan = Scenario { signals: &["a:xo"], ..Scenario::default() }.plan(&folder);
    assert_eq!(executed(&plan, &plan.runs[0]).lines().nth(1), Some("0.0,b29m"));
}

#[test]
fn mistakes_with_binaries_name_the_rule() {
    let folder = folder();
    let of = |inputs: &str, connections: &[(&str, &str)]| {
        Scenario { inputs, connections, signals: &["a:xo"], ..Scenario::default() }.mistakes(&folder)
    };
    for (inputs, expected) in [
        ("x = \"AAECAwQFBgcI\"", "`x` has 9 bytes, expected at most 8 (its `maxSize`)"),
        ("x = \"a b\"", "`x` is the string \"a b\", which is not Base64"),
        ("x = { hex = \"abc\" }", "`x` is the string \"abc\", which is not a list of hexadecimal digits in pairs"),
        ("x = { file = \"absent.bin\" }", "`x`: cannot read absent.bin"),
        ("x = 1", "`x` must be a string in Base64, { file = \"..\" } or { hex = \"..\" }, got 1"),
    ] {
        let found = of(inputs, &[]);
        assert!(found.contains(expected), "{found}");
    }
    let number = of("", &[("a:xo", "b:s")]);
    assert!(number.contains("`a:xo` is Binary, but its target `b:s` is Integer"), "{number}");
    let metric = "a:xo\"]\n[[metric]]\nname = \"m\"\ntitle = \"M\"\nsignal = \"a:xo\"\nkind = \"max\"\n#";
    let metric = Scenario { signals: &[metric], ..Scenario::default() }.mistakes(&folder);
    assert!(metric.contains("`a:xo` is a Binary; metrics and figures need numbers"), "{metric}");
}

/// MIME types must be equal, or one of them unknown: `application/octet-stream`.
#[test]
fn binaries_of_other_content_are_not_connected() {
    let folder = folder();
    let scenario = Scenario { connections: &[("a:po", "b:x")], signals: &["b:xo"], ..Scenario::default() };
    let plain = scenario.plan(&folder);
    assert_eq!(executed(&plain, &plain.runs[0]).lines().nth(1), Some("0.0,"));
    let description = include_str!("data/arrays.xml");
    let other = description.replacen(
        "name=\"po\" valueReference=\"23\"",
        "name=\"po\" mimeType=\"image/gif\" valueReference=\"23\"",
        1,
    );
    assert_ne!(other, description);
    let [output, input] = [(other.as_str(), "po"), (description, "x")]
        .map(|(text, name)| ModelDescription::parse(text).unwrap().variable(name).unwrap().clone());
    let types = ["a Binary of the MIME type image/gif", "a Binary of the MIME type image/png"].map(str::to_owned);
    assert_eq!(output.mismatch(&input), Some(types));
}

/// The description has start values of all arrays but the output `v`.
#[test]
fn the_plan_lists_arrays_with_elements_in_use() {
    let folder = folder();
    let scenario = Scenario {
        inputs: "\"w[2]\" = 5",
        parameters: "\"e[1]\" = 3",
        signals: &["a:v[3]", "a:so"],
        ..Scenario::default()
    };
    let run = &scenario.plan(&folder).runs[0];
    let of = |reference| run.components[0].arrays.iter().find(|array| array.reference == reference).unwrap();
    assert_eq!(run.components[0].arrays.len(), 3, "w, v and e");
    assert_eq!((of(9).size, &of(9).starts[..]), (3, &[0, 0, 0].map(Value::Integer)[..]));
    assert_eq!((of(17).size, &of(17).starts[..]), (2, &[1, 2].map(Value::Integer)[..]));
    assert_eq!((of(10).size, &of(10).starts[..]), (3, &[][..]));
    assert_eq!(run.components[0].parameters[0].reference, of(17).first);
    assert_eq!(run.components[0].outputs[0].reference, of(10).first + 2);
    assert!(run.components[1].arrays.is_empty());
}

/// A list sets an array row by row, and names of arrays connect and record all elements.
#[test]
fn whole_arrays_are_set_connected_and_recorded() {
    let folder = folder();
    let whole = Scenario {
        inputs: "m = [[11, 12, 13], [21, 22, 23]], w = [1, -2, 3]",
        parameters: "k = [1, 3, 1, 1, 1, 1.0], e = [1, -7]",
        connections: &[("a:v", "b:w"), ("a:g", "b:f")],
        signals: &["a:t", "b:v", "b:g"],
        ..Scenario::default()
    };
    let by_element = Scenario {
        inputs: &format!("{M}, \"w[1]\" = 1, \"w[2]\" = -2, \"w[3]\" = 3"),
        parameters: r#""k[1,1]" = 1, "k[1,2]" = 3, "k[1,3]" = 1, "k[2,1]" = 1, "k[2,2]" = 1, "k[2,3]" = 1, "e[1]" = 1, "e[2]" = -7"#,
        connections: &[
            ("a:v[1]", "b:w[1]"),
            ("a:v[2]", "b:w[2]"),
            ("a:v[3]", "b:w[3]"),
            ("a:g[1]", "b:f[1]"),
            ("a:g[2]", "b:f[2]"),
        ],
        signals: &["a:t[*]", "b:v[*]", "b:g[*]"],
        ..Scenario::default()
    };
    let [whole, by_element] = [whole, by_element].map(|scenario| scenario.plan(&folder));
    assert!(whole.runs == by_element.runs && whole.columns == by_element.columns);
    assert_eq!(last(&whole).unwrap()[..2], expected(&[("t[1,1]", 11.0), ("t[1,2]", 21.0)]));
    assert_eq!(last(&whole).unwrap()[2], ("t[2,1]".to_owned(), 36.0));
    let of = |inputs: &str, connections: &[(&str, &str)]| {
        Scenario { inputs, connections, signals: &["a:sum"], ..Scenario::default() }.mistakes(&folder)
    };
    for (inputs, connections, expected) in [
        ("m = [1, 2]", &[][..], "`m` is an array of 2 x 3 elements, got a list of 2"),
        ("m = [[1, 2], [3, 4], [5, 6]]", &[], "`m` is an array of 2 x 3 elements, got a list of 6"),
        ("m = [[1, 2, 3], [4]]", &[], "write 6 values row by row, or a list with a list for each row"),
        ("w = [1, 2, true]", &[], "`w[3]` must be a whole number, got true"),
        ("", &[("a:t", "b:m")], "`a:t` is an array up to [3,2], but its target `b:m` is one up to [2,3]"),
        ("", &[("a:t", "b:s")], "`a` has no output `t`"),
    ] {
        let found = of(inputs, connections);
        assert!(found.contains(expected), "{found}");
    }
}

/// ys is xs with its elements swapped, ls are the lengths of the names.
#[test]
fn arrays_of_strings_and_binaries_are_set_by_list_and_by_element() {
    let folder = folder();
    let scenario = Scenario {
        inputs: "xs = [\"AQ==\", \"\"]",
        others: "\"xs[2]\" = { hex = \"0505\" }",
        parameters: "names = [\"four\", \"\"]",
        connections: &[("a:ys[1]", "b:xs[1]")],
        signals: &["a:ls", "a:ys", "b:ys"],
    };
    let plan = scenario.plan(&folder);
    let recorded = executed(&plan, &plan.runs[0]);
    let names = "time,ys[1],ys[2],ls[1],ls[2],b:ys[1],b:ys[2]";
    assert_eq!(recorded.lines().next(), Some(names));
    assert!(recorded.lines().skip(1).all(|line| line.ends_with(",,AQ==,4.0,0.0,BQU=,")), "{recorded}");
    let whole = Scenario { connections: &[("a:ys", "b:xs")], signals: &["b:ys"], ..Scenario::default() }.plan(&folder);
    // Swapped twice: the start values.
    assert_eq!(executed(&whole, &whole.runs[0]).lines().last(), Some("0.3,MQ==,MjI="));
    let one =
        Scenario { parameters: "\"names[2]\" = \"xyz\"", signals: &["a:ls"], ..Scenario::default() }.plan(&folder);
    assert_eq!(last(&one).unwrap(), expected(&[("ls[1]", 1.0), ("ls[2]", 3.0)]));
}

/// FMI 3.0.2, section 2.4.7.5: an alias is another name of the same variable.
#[test]
fn every_name_of_a_variable_can_be_used() {
    let folder = folder();
    let scenario = Scenario {
        inputs: "\"wishes[1]\" = 4, \"wishes[2]\" = 5, \"w[3]\" = 6",
        parameters: "upper = 7",
        connections: &[("a:source_out", "b:source"), ("a:answers", "b:wishes"), ("a:reversed", "b:x")],
        signals: &["a:answers", "b:answers", "a:uo", "a:source_out", "b:source_out", "b:reversed"],
        ..Scenario::default()
    };
    let text = scenario.text();
    let (head, tail) = text.split_once("name = \"b\"").unwrap();
    let text =
        format!("{}name = \"b\"{}", head.replacen("s = 1, ", "source = 9, ", 1), tail.replacen("s = 1, ", "", 1));
    let source = FmuFolder::new([folder.path()]);
    let plan = resolve_text(Path::new("arrays.toml"), &text, &source, &Options::default()).unwrap();
    let recorded = executed(&plan, &plan.runs[0]);
    let mut rows = recorded.lines();
    let names = "time,answers[1],answers[2],answers[3],source_out,uo,b:answers[1],b:answers[2],b:answers[3],b:source_out,\
                 reversed";
    assert_eq!(rows.next(), Some(names));
    assert_eq!(rows.last(), Some("0.3,-4,-5,-6,9,7,4,5,6,9,Zm9v"));
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
            ("a:xo", "b:x"),
        ],
        signals: &["*"],
        ..Scenario::default()
    }
    .plan(&folder);
    let fmus = Fmus::load(&plan.runs).unwrap();
    let mut session = Session::new(&plan.simulation, &plan.runs[0], &fmus).unwrap();
    let before = counting::allocations();
    for _ in 0..3 {
        session.step().unwrap();
    }
    assert_eq!(counting::allocations() - before, 0);
    drop(std::hint::black_box(vec![1]));
    assert_eq!(counting::allocations() - before, 1);
}
