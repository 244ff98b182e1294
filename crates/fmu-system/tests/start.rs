//! Consistent start values of connected components, with FMUs built from C in a temporary folder.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_system::fmus::Fmus;
use fmu_system::plan::{Loop, Plan, Timing};
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use fmu_system::session::Session;
use std::path::Path;
use support::Build;
use tempfile::TempDir;

/// The function of an FMU: `y` in terms of the input `u`, discarded where it is NaN.
struct Function<'a> {
    name: &'a str,
    input: &'a str,
    output: &'a str,
    formula: &'a str,
    /// The list `dependencies` of the output among the initial unknowns; `None` without one.
    dependencies: Option<&'a str>,
}

impl Function<'_> {
    fn pack(&self, folder: &Path) {
        self.pack_with(folder, &[]);
    }

    /// Packs the FMU with replacements in its description.
    fn pack_with(&self, folder: &Path, edits: &[(&str, &str)]) {
        let exit = format!("EXIT=i->v.real[1]=({})", self.formula.replace('u', "i->v.real[0]"));
        let follow = exit.replace("EXIT", "FOLLOW") + ";if(i->v.real[1]!=i->v.real[1])return 2";
        let list = self.dependencies.map_or(String::new(), |list| format!(" dependencies=\"{list}\""));
        let structure = format!(
            "<ModelStructure><Outputs><Unknown index=\"2\"/><Unknown index=\"6\"/><Unknown index=\"8\"/></Outputs>\
             <InitialUnknowns><Unknown index=\"2\"{list}/></InitialUnknowns></ModelStructure>"
        );
        let edits = [&[("<ModelStructure/>", structure.as_str())], edits].concat();
        let defects = [follow.as_str(), exit.as_str()];
        Build { defects: &defects, edits: &edits, ..Build::new(self.name, self.input, self.output) }.pack(folder);
    }
}

/// The plan of components, each a name and an FMU, and of connections. Without a connection, the input `free` is 0.
fn plan(folder: &TempDir, components: &[[&str; 2]], connections: &[[&str; 2]], record: &str) -> Plan {
    plan_in(folder, "", components, connections, record)
}

/// As [`plan`], with an order if it is not empty. A component whose name begins with `s` takes samples.
fn plan_in(folder: &TempDir, order: &str, components: &[[&str; 2]], connections: &[[&str; 2]], record: &str) -> Plan {
    let mut text = "title = \"Start\"\n[simulation]\nstop = 1.0\nstep = 0.1\n".to_owned();
    if !order.is_empty() {
        text += &format!("order = \"{order}\"\n");
    }
    for [name, fmu] in components {
        text += &format!("[[component]]\nname = \"{name}\"\nfmu = \"{fmu}\"\n");
        if name.starts_with('s') {
            text += "kind = \"discrete\"\n";
        }
    }
    for [from, to] in connections {
        text += &format!("[[connection]]\nfrom = \"{from}\"\nto = \"{to}\"\n");
    }
    text += "[[case]]\nname = \"only\"\ntitle = \"Only\"\n";
    let is_connected = connections.iter().any(|[_, to]| *to == "source:free");
    if !is_connected && components.iter().any(|[name, _]| *name == "source") {
        text += "inputs.source = { free = 0.0 }\n";
    }
    text += &format!("[record]\nsignals = [{record}]\n");
    resolved(folder, &text).unwrap()
}

fn resolved(folder: &TempDir, text: &str) -> Result<Plan, String> {
    let fmus = FmuFolder::new([folder.path()]);
    resolve_text(Path::new("start.toml"), text, &fmus, &Options::default()).map_err(|problems| format!("{problems:?}"))
}

fn start(plan: &Plan) -> Result<Vec<f64>, String> {
    let fmus = Fmus::load(&plan.runs).unwrap();
    let session = Session::new(&plan.simulation, &plan.runs[0], &fmus).map_err(|failure| failure.to_string())?;
    Ok((0..plan.columns.len()).map(|column| session.column(column).unwrap()).collect())
}

/// y_j = g_j y_(j-1) + b_j. The reference is the product; each listing order gives the same bits, and one evaluation of
/// each component is enough.
#[test]
fn a_chain_starts_right_in_any_listing_order() {
    let folder = TempDir::new().unwrap();
    let gains = [(2.0, 0.5), (-1.5, 1.0), (0.4, -2.0), (3.0, 0.125), (0.25, 4.0)];
    let mut expected = vec![1.25];
    for (number, (gain, offset)) in gains.iter().enumerate() {
        let (name, input, output) = (format!("Gain{number}"), format!("y{number}"), format!("y{}", number + 1));
        let formula = format!("{gain:?} * u + {offset:?}");
        Function { name: &name, input: &input, output: &output, formula: &formula, dependencies: Some("1") }
            .pack(folder.path());
        expected.push(gain * expected[number] + offset);
    }
    Function { name: "Source", input: "free", output: "y0", formula: "1.25", dependencies: Some("") }
        .pack(folder.path());
    let mut components =
        vec![["source", "Source"], ["a", "Gain0"], ["b", "Gain1"], ["c", "Gain2"], ["d", "Gain3"], ["e", "Gain4"]];
    for _ in 0..2 {
        let plan = plan(&folder, &components, &[], "\"y0\", \"y1\", \"y2\", \"y3\", \"y4\", \"y5\"");
        assert_eq!(plan.runs[0].initialization.len(), 6);
        assert_eq!(start(&plan).unwrap(), expected);
        components.reverse();
        expected.reverse();
    }
}

/// Two functions in a loop; the tolerance of a solution is 1e-9 of its value, which the other function can enlarge.
fn in_loop(a: &str, b: &str, dependencies: [Option<&str>; 2], extra: &[&str]) -> Result<Vec<f64>, String> {
    let folder = TempDir::new().unwrap();
    Function { name: "A", input: "au", output: "ay", formula: a, dependencies: dependencies[0] }.pack(folder.path());
    Function { name: "B", input: "bu", output: "by", formula: b, dependencies: dependencies[1] }.pack(folder.path());
    Function { name: "Source", input: "free", output: "y0", formula: "1", dependencies: Some("") }.pack(folder.path());
    let components = [["a", "A"], ["b", "B"], ["source", "Source"]];
    let connections = [["a:ay", "b:bu"], ["b:by", "a:au"]];
    let record: Vec<String> = ["ay", "by", "y0"].iter().chain(extra).map(|name| format!("\"{name}\"")).collect();
    start(&plan(&folder, &components, &connections, &record.join(", ")))
}

#[test]
fn loops_are_solved() {
    let both = [Some("1"), Some("1")];
    for (a, b, dependencies, expected) in [
        ("0.5 * u + 1", "u", both, [2.0, 2.0]),
        ("-3 * u + 4", "u", both, [1.0, 1.0]),
        ("2 - 0.5 * u * u * u", "1.2 * u", both, [1.036_868_969_729_86, 1.2 * 1.036_868_969_729_86]),
        // a is a constant, but does not say so: the loop ends after as many passes as the true chain is long.
        ("3", "2 * u", [None, Some("1")], [3.0, 6.0]),
    ] {
        let found = in_loop(a, b, dependencies, &[]).unwrap();
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() <= 1e-8 * expected.abs(), "{a}: {found}, not {expected}");
        }
    }
}

#[test]
fn a_loop_without_a_solution_is_named() {
    for (a, reason) in
        [("u + 1", "singular Jacobian"), ("u + 1000", "singular Jacobian"), ("u * u + 1", "no convergence")]
    {
        let message = in_loop(a, "u", [Some("1"); 2], &[]).unwrap_err();
        let expected = format!(
            "the algebraic loop at the start has no solution ({reason}): a:ay -> b:bu -> b:by -> a:au; residual "
        );
        assert!(message.contains(&expected), "{message}");
        assert!(message.contains(" after 5 fixed-point iterations; break it with a delay"), "{message}");
    }
}

/// Makes the Boolean of an FMU an input and its Real output a pure number, which a Boolean may read.
const BOOLEAN: [(&str, &str); 2] = [
    ("causality=\"parameter\" variability=\"fixed\"><Boolean", "causality=\"input\"><Boolean"),
    ("<Real unit=\"m\"/>", "<Real/>"),
];

/// Two functions in a loop in which `source` reads the output of a as a Boolean, and also as a Real if it depends on it.
fn with_boolean(a: &str, b: &str, dependencies: &str) -> Result<Vec<f64>, String> {
    let folder = TempDir::new().unwrap();
    Function { name: "A", input: "au", output: "ay", formula: a, dependencies: Some("1") }
        .pack_with(folder.path(), &BOOLEAN[1..]);
    Function { name: "B", input: "free", output: "by", formula: b, dependencies: Some(dependencies) }
        .pack_with(folder.path(), &BOOLEAN);
    let all = [["a:ay", "source:inverted"], ["source:by", "a:au"], ["a:ay", "source:free"]];
    let connections = if dependencies == "7" { &all[..2] } else { &all };
    start(&plan(&folder, &[["a", "A"], ["source", "B"]], connections, "\"ay\", \"by\""))
}

/// y = 0.5 z + 0.4, z = y + (1 if y > 0.5 else 0). The Boolean changes after the first solution, 0.8.
#[test]
fn a_signal_of_a_loop_can_be_read_as_real_and_boolean() {
    let found = with_boolean("0.5 * u + 0.4", "u + i->v.boolean[0]", "1 7").unwrap();
    for (found, expected) in found.iter().zip([1.8, 2.8]) {
        assert!((found - expected).abs() <= 1e-8, "{found}, not {expected}");
    }
    // Only the Boolean matters: y = z, z = 2 if y > 0.5 else 1.
    assert_eq!(with_boolean("u", "1 + i->v.boolean[0]", "7").unwrap(), [2.0, 2.0]);
}

/// The equations y = z and z = 0 if y > 0.5 else 1 have no solution.
#[test]
fn a_loop_that_does_not_settle_is_named() {
    let message = with_boolean("u", "!i->v.boolean[0]", "7").unwrap_err();
    let expected = "the algebraic loop at the start does not settle: a:ay -> source:inverted -> source:by -> a:au; \
                    signals that are not Real change in each of 10 rounds; break it with a delay";
    assert!(message.contains(expected), "{message}");
}

/// Two loops: u = 0.5 u + 1 and u = -3 u + 4; the FMUs of the second have no initial unknowns, so that the dependencies
/// of their outputs count.
#[test]
fn each_of_several_loops_is_solved() {
    let folder = TempDir::new().unwrap();
    let undeclared = [
        ("<Unknown index=\"2\"/>", "<Unknown index=\"2\" dependencies=\"1\"/>"),
        ("<InitialUnknowns><Unknown index=\"2\" dependencies=\"1\"/></InitialUnknowns>", ""),
    ];
    for (name, input, output, formula, edits) in [
        ("A", "au", "ay", "0.5 * u + 1", &undeclared[..0]),
        ("B", "bu", "by", "u", &undeclared[..0]),
        ("C", "cu", "cy", "-3 * u + 4", &undeclared),
        ("D", "du", "dy", "u", &undeclared),
    ] {
        Function { name, input, output, formula, dependencies: Some("1") }.pack_with(folder.path(), edits);
    }
    let components = [["a", "A"], ["b", "B"], ["c", "C"], ["d", "D"]];
    let connections = [["a:ay", "b:bu"], ["b:by", "a:au"], ["c:cy", "d:du"], ["d:dy", "c:cu"]];
    let plan = plan(&folder, &components, &connections, "\"ay\", \"cy\"");
    assert_eq!(plan.wiring[0].loops.iter().filter(|found| found.at_start).count(), 2);
    let found = start(&plan).unwrap();
    assert!((found[0] - 2.0).abs() <= 1e-8 && (found[1] - 1.0).abs() <= 1e-8, "{found:?}");
}

/// y = 0.25 z + 1, z = 2 y + 1. The start value of the input of b, 5, belongs to y = (5 - 1) / 2; the component `c` also
/// reads y, but is not in the loop.
#[test]
fn a_loop_converts_values_and_start_values() {
    let folder = TempDir::new().unwrap();
    for (name, input, output, formula, value) in [
        ("A", "au", "ay", "0.25 * u + 1", "<Real start=\"0\"/>"),
        ("B", "bu", "by", "u", "<Real start=\"5\"/>"),
        ("C", "cu", "cy", "u", "<Real start=\"7\"/>"),
    ] {
        Function { name, input, output, formula, dependencies: Some("1") }
            .pack_with(folder.path(), &[("<Real start=\"0\"/>", value)]);
    }
    let text = "title = \"Start\"\nsimulation = { stop = 1.0, step = 0.1 }\n\
                component = [{ name = \"c\", fmu = \"C\" }, { name = \"a\", fmu = \"A\" }, { name = \"b\", fmu = \"B\" }]\n\
                connection = [{ from = \"a:ay\", to = \"c:cu\" }, { from = \"b:by\", to = \"a:au\" }, \
                { from = \"a:ay\", to = \"b:bu\", factor = 2.0, offset = 1.0 }]\n\
                case = [{ name = \"only\", title = \"Only\" }]\nrecord.signals = [\"ay\", \"by\"]\n";
    let plan = resolved(&folder, text).unwrap();
    let equations = plan.runs[0].initialization.iter().find_map(|part| part.equations.as_ref()).unwrap();
    let ay = plan.runs[0].columns[0];
    let unknown = equations.unknowns.iter().find(|unknown| Some(unknown.slot) == ay).unwrap();
    assert_eq!(unknown.start, 2.0);
    let found = start(&plan).unwrap();
    assert!((found[0] - 2.5).abs() <= 1e-8 && (found[1] - 6.0).abs() <= 1e-8, "{found:?}");
}

/// A ring of 1002 signals through two FMUs. The limit is 1000 unknowns.
#[test]
fn a_loop_of_too_many_unknowns_is_an_error() {
    let folder = TempDir::new().unwrap();
    let (first, count) = (10, 500);
    for (name, input, output, shift) in [("A", "p", "q", 0), ("B", "q", "p", 1)] {
        let variable = |name: String, number: usize, causality: &str, typed: &str| {
            format!(
                "<ScalarVariable name=\"{name}\" valueReference=\"{number}\" causality=\"{causality}\">{typed}\
                 </ScalarVariable>"
            )
        };
        let (mut variables, mut unknowns) = (String::new(), String::new());
        for i in 0..=count {
            variables += &variable(format!("{input}{i}"), 2 * i + 10, "input", "<Real start=\"0\"/>");
            variables += &variable(format!("{output}{}", (i + shift) % (count + 1)), 2 * i + 11, "output", "<Real/>");
            let (input, output) = (first + 2 * i, first + 2 * i + 1);
            unknowns += &format!("<Unknown index=\"{output}\" dependencies=\"{input}\"/>");
        }
        let structure =
            format!("<Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns></ModelStructure>");
        let edits = [
            ("</ModelVariables>", &*format!("{variables}</ModelVariables>")),
            ("<ModelStructure/>", &*format!("<ModelStructure>{structure}")),
        ];
        let (input, output) = (format!("{input}_free"), format!("{output}_free"));
        Build { edits: &edits, ..Build::new(name, &input, &output) }.pack(folder.path());
    }
    let text = "title = \"Start\"\nsimulation = { stop = 1.0, step = 0.1 }\n\
                component = [{ name = \"a\", fmu = \"A\" }, { name = \"b\", fmu = \"B\" }]\n\
                case = [{ name = \"only\", title = \"Only\", inputs.a.p_free = 0.0, inputs.b.q_free = 0.0 }]\n\
                record.signals = [\"a:q0\"]\n";
    let message = resolved(&folder, text).unwrap_err();
    let expected = "the algebraic loop of `a:q0` must have up to 1000 unknowns, got 1002";
    assert!(message.contains(expected), "{message}");
}

/// A warning names the first output that an input reads and that changes by more than 1e-6 of its value when
/// Initialization Mode ends. `before` and `after` are the values around that call.
#[test]
fn a_change_at_the_end_of_initialization_is_a_warning() {
    let folder = TempDir::new().unwrap();
    Function { name: "Reader", input: "y", output: "z", formula: "u", dependencies: Some("1") }.pack(folder.path());
    let messages = |before: f64, after: f64, components: &[[&str; 2]]| -> Vec<String> {
        let defects = [format!("FOLLOW=i->v.real[1]={before:?}"), format!("EXIT=i->v.real[1]={after:?}")];
        let defects = defects.each_ref().map(String::as_str);
        Build { defects: &defects, ..Build::new("Source", "free", "y") }.pack(folder.path());
        let plan = plan(&folder, components, &[], "\"source:y\"");
        let fmus = Fmus::load(&plan.runs).unwrap();
        let session = Session::new(&plan.simulation, &plan.runs[0], &fmus).unwrap();
        session.terminate().unwrap().into_iter().map(|(component, message)| component + ": " + &message.text).collect()
    };
    let both = [["reader", "Reader"], ["source", "Source"]];
    let expected = "source: output `y` changes from 2.5 to 3.0 at the end of initialization; the inputs that read it \
                    were initialized with the first value";
    assert_eq!(messages(2.5, 3.0, &both), [expected]);
    let none: [&str; 0] = [];
    assert_eq!(messages(2.5, 2.5 * (1.0 + 0.9e-6), &both), none);
    assert_eq!(messages(2.5, 3.0, &both[1..]), none);
}

fn timings(plan: &Plan) -> Vec<(&str, Timing)> {
    let of = |input: &'_ fmu_system::plan::Connected| input.timing;
    plan.wiring[0].inputs.iter().filter_map(|input| Some((input.input.variable.as_str(), of(input)?))).collect()
}

fn names(plan: &Plan) -> Vec<&str> {
    plan.runs[0].components.iter().map(|component| component.name.as_str()).collect()
}

/// A plant, an actuator, and a controller that takes samples. The classes are those of the definition: in a sequential
/// order, what takes samples should come before what it reads, and all else after what it reads.
#[test]
fn the_plan_classifies_the_times_of_connections() {
    let folder = TempDir::new().unwrap();
    for (name, input, output) in
        [("Plant", "force", "speed"), ("Control", "speed", "demand"), ("Drive", "demand", "force")]
    {
        Function { name, input, output, formula: "u", dependencies: Some("1") }.pack(folder.path());
    }
    let components = [["plant", "Plant"], ["drive", "Drive"], ["samples", "Control"]];
    use Timing::{Early, Held, Late, OnTime};
    let listed = plan_in(&folder, "", &components, &[], "\"speed\"");
    assert_eq!(timings(&listed), [("force", Held), ("demand", Late), ("speed", Early)]);
    assert_eq!(listed.warnings.len(), 1, "{:?}", listed.warnings);
    assert!(listed.warnings[0].contains("connections that carry values of another step: 2"), "{}", listed.warnings[0]);
    let jacobi = plan_in(&folder, "jacobi", &components, &[], "\"speed\"");
    assert_eq!(timings(&jacobi), [("force", Held), ("demand", Late), ("speed", OnTime)]);
    let auto = plan_in(&folder, "auto", &components, &[], "\"speed\"");
    assert_eq!(names(&auto), ["samples", "drive", "plant"]);
    assert!(timings(&auto).iter().all(|(_, timing)| *timing == OnTime) && auto.warnings.is_empty());
    // No warning if nothing is wrong, or if the scenario states the order.
    let mut reversed = components;
    reversed.reverse();
    for (order, components) in [("", reversed), ("sequential", components)] {
        assert!(plan_in(&folder, order, &components, &[], "\"speed\"").warnings.is_empty());
    }
}

/// A cycle of 13 components is too long for the search for the best order, one of 12 is not.
#[test]
fn long_cycles_keep_their_order() {
    let folder = TempDir::new().unwrap();
    let warned = |size: usize| {
        let signals: Vec<_> = (0..size).map(|k| format!("x{size}_{k}")).collect();
        let names: Vec<_> = (0..size).map(|k| format!("C{size}_{k}")).collect();
        for k in 0..size {
            let [name, input, output] = [&names[k], &signals[k], &signals[(k + 1) % size]];
            Function { name, input, output, formula: "0.5 * u + 1", dependencies: Some("1") }.pack(folder.path());
        }
        // From the last to the first: every connection but one is late.
        let lower: Vec<_> = names.iter().map(|name| name.to_lowercase()).collect();
        let components: Vec<_> = (0..size).rev().map(|k| [&*lower[k], &*names[k]]).collect();
        plan_in(&folder, "auto", &components, &[], &format!("\"{}\"", signals[0])).warnings
    };
    assert_eq!(warned(12), <[String; 0]>::default());
    let warnings = warned(13);
    let message = "13 components depend on each other in a cycle and keep the order of the scenario";
    assert!(warnings.len() == 1 && warnings[0].contains(message), "{warnings:?}");
    assert!(warnings[0].contains("cycles of up to 12 components are ordered automatically"), "{warnings:?}");
}

/// u = 1 + 0.9 u - u^3/3.375, which the FMU discards above 1.55: fixed-point iteration reaches 1.6, and the first step of
/// Newton's method 10. Reference: Cardano's formula.
#[test]
fn a_loop_that_is_not_defined_everywhere_is_solved() {
    let folder = TempDir::new().unwrap();
    let cubic = "u > 1.55 ? 0. / 0. : 1 + 0.9 * u - u * u * u / 3.375";
    for (name, input, output, formula) in [("A", "b", "a", cubic), ("B", "a", "b", "u")] {
        Function { name, input, output, formula, dependencies: Some("1") }.pack(folder.path());
    }
    let root = (1.6875_f64.powi(2) + 0.1125_f64.powi(3)).sqrt();
    let expected = (root + 1.6875).cbrt() - (root - 1.6875).cbrt();
    let found = start(&plan(&folder, &[["a", "A"], ["b", "B"]], &[], "\"a\"")).unwrap()[0];
    assert!((found - expected).abs() < 1e-8 * expected, "{found} {expected}");
}

/// A cycle of continuous components: any order holds one connection; the first of them begins, and the loop of direct
/// feedthrough is reported at the start and in each step.
#[test]
fn the_plan_names_loops_and_the_connection_that_breaks_them() {
    let folder = TempDir::new().unwrap();
    for (name, input, output) in [("A", "c", "a"), ("B", "a", "b"), ("C", "b", "c")] {
        Function { name, input, output, formula: "0.5 * u + 1", dependencies: Some("1") }.pack(folder.path());
    }
    let components = [["c", "C"], ["b", "B"], ["a", "A"]];
    let auto = plan_in(&folder, "auto", &components, &[], "\"a\"");
    assert_eq!(names(&auto), ["c", "a", "b"]);
    let path = "c:c -> a:c -> a:a -> b:a -> b:b -> c:b";
    let of = |at_start| Loop { at_start, path: path.into(), held: vec!["b:b -> c:b".into()] };
    assert_eq!(auto.wiring[0].loops, [of(true), of(false)]);
    let jacobi = plan_in(&folder, "jacobi", &components, &[], "\"a\"");
    assert_eq!(jacobi.wiring[0].loops[1].held, ["c:c -> a:c", "a:a -> b:a", "b:b -> c:b"]);
    // x = x / 8 + 1.75.
    assert!((start(&auto).unwrap()[0] - 2.0).abs() < 1e-8);
}
