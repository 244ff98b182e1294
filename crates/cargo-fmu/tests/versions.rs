//! The commands on FMUs of FMI 3.0 and for model exchange, built from C.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/decay.rs"]
mod decay;

use std::path::Path;
use std::process::{Command, Output};

use decay::Decay;
use fmu_import::description::FmiVersion;

fn command(folder: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_cargo-fmu"));
    command.arg("fmu").args(arguments).current_dir(folder).output().unwrap()
}

/// Standard output of a command that must succeed.
fn printed(folder: &Path, arguments: &[&str]) -> String {
    let output = command(folder, arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Only the description is read, so the FMU has that of another one.
#[test]
fn properties_that_only_fmi_3_has_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_str!("../../fmu-import/tests/data/decay3.xml");
    let (_, sum) = text.split_once("<Int64 name=\"sum\"").unwrap();
    let sum = sum.lines().next().unwrap();
    let others = sum.replace("/>", "><Alias name=\"total\" description=\"Sum\"/></Int64>")
        + "\n    <Binary name=\"image\" valueReference=\"90\" causality=\"input\" mimeType=\"image/png\" maxSize=\"8\">\
           <Start value=\"00ff\"/></Binary>\n    <Binary name=\"raw\" valueReference=\"91\" causality=\"input\" clocks=\"92\">\
           <Start value=\"\"/></Binary>\n    <Clock name=\"tick\" valueReference=\"92\" intervalVariability=\"constant\"/>";
    let terminals = "<Terminals><Terminal name=\"port\" matchingRule=\"plug\" terminalKind=\"org.example.k\" description=\"A port\">\
                     <TerminalMemberVariable variableName=\"port.u\" memberName=\"u\" variableKind=\"inflow\"/>\
                     <Terminal name=\"bus\" matchingRule=\"bus\">\
                     <TerminalMemberVariable variableName=\"y\" memberName=\"y\" variableKind=\"signal\"/>\
                     </Terminal></Terminal></Terminals>";
    Decay { edits: &[(sum, &others)], terminals, ..Decay::new(FmiVersion::V3) }.pack(folder.path());
    let listed = printed(folder.path(), &["inspect", "Decay3.fmu"]);
    for expected in [
        "  total      Sum [alias of `sum`, Int64]\n",
        "  wide               7      [UInt64]\n",
        "  image  0x00ff   [Binary, image/png, at most 8 bytes]\n",
        "  raw        0x   [Binary, application/octet-stream, clock `tick`]\n",
        "\nClocks (1)\n  tick",
        "\nTerminals (1)\n  port (plug, org.example.k)  A port\n    u = port.u [inflow]\n    bus (bus)\n      y\n",
    ] {
        assert!(listed.contains(expected), "{expected}: {listed}");
    }
}

#[test]
fn an_fmu_of_fmi_3_is_listed_and_validated() {
    let folder = tempfile::tempdir().unwrap();
    Decay::new(FmiVersion::V3).pack(folder.path());
    let listed = printed(folder.path(), &["inspect", "Decay3.fmu"]);
    for expected in [
        "FMI             3.0\ntoken           {decay}\n",
        "\nco-simulation   variable communication steps, saved states, serialized states, directional derivatives, adjoint \
         derivatives, several instances in a process\n",
        "\nmodel exchange  continuous states: 1, event indicators: 1, saved states,",
        "\nInputs (4)\n",
        "  v (3)  1 2 3",
        "  bits (2)  true false",
    ] {
        assert!(listed.contains(expected), "{expected}: {listed}");
    }
    let checked = printed(folder.path(), &["check", "Decay3.fmu"]);
    assert!(checked.starts_with("Decay3.fmu: no error, no warning\n"), "{checked}");
    assert!(checked.contains("\n  model exchange: the event at the start, "), "{checked}");
}

/// x' = -2 x; y = x + u, w = x v, y32 = u / 2 at x = 1, v = (1, 2, 3); each element of an array is a column or a row.
#[test]
fn arrays_are_linearized_by_either_interface() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_str!("../../fmu-import/tests/data/decay3.xml");
    let co_simulation = text.lines().find(|line| line.contains("<CoSimulation")).unwrap();
    for edits in [&[][..], &[(co_simulation, "")]] {
        Decay { edits, ..Decay::new(FmiVersion::V3) }.pack(folder.path());
        let json = printed(folder.path(), &["linearize", "Decay3.fmu", "--json"]);
        let linear: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(linear["states"], serde_json::json!(["x"]));
        assert_eq!(linear["inputs"], serde_json::json!(["u", "v[1]", "v[2]", "v[3]"]));
        assert_eq!(linear["outputs"], serde_json::json!(["x", "y", "y32", "w[1]", "w[2]", "w[3]"]));
        assert_eq!(linear["A"], serde_json::json!([[-2.0]]));
        assert_eq!(linear["C"], serde_json::json!([[1.0], [1.0], [0.0], [1.0], [2.0], [3.0]]));
        let expected = serde_json::json!([
            [0.0, 0.0, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0],
            [0.5, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0]
        ]);
        assert_eq!(linear["D"], expected);
    }
    let output = command(folder.path(), &["linearize", "Decay3.fmu", "--set", "v=1"]);
    let error = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(error.contains("--set v=1: `v` is an array of 3 elements; only scalars can be set"), "{error}");
}

/// x' = -k x and y = x + u at k = 2, u = 0.5: A, C and D are constant, so central differences have rounding errors
/// only. Without model exchange, differences cannot be computed.
#[test]
fn an_fmu_without_directional_derivatives_is_linearized_by_differences() {
    for (fmi, name, flag) in [
        (FmiVersion::V2, "Decay2.fmu", r#" providesDirectionalDerivative="true""#),
        (FmiVersion::V3, "Decay3.fmu", r#" providesDirectionalDerivatives="true""#),
    ] {
        let folder = tempfile::tempdir().unwrap();
        Decay { edits: &[(flag, ""), (flag, "")], ..Decay::new(fmi) }.pack(folder.path());
        let output = command(folder.path(), &["linearize", name, "--json", "--set", "u=0.5"]);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && said.contains("central differences"), "{said}");
        let linear: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let at = |matrix: &str, row: usize, column: usize| linear[matrix][row][column].as_f64().unwrap();
        // The FMI 3.0 FMU has Float32 variables, which have 7 digits.
        let slack = if fmi == FmiVersion::V2 { 1e-9 } else { 1e-4 };
        let expected = [("A", 0, 0, -2.0), ("B", 0, 0, 0.0), ("C", 0, 0, 1.0), ("C", 1, 0, 1.0), ("D", 1, 0, 1.0)];
        for (matrix, row, column, value) in expected {
            assert!((at(matrix, row, column) - value).abs() < slack, "{name} {matrix}[{row}][{column}]: {linear}");
        }

        let description = match fmi {
            FmiVersion::V2 => include_str!("../../fmu-import/tests/data/decay2.xml"),
            FmiVersion::V3 => include_str!("../../fmu-import/tests/data/decay3.xml"),
        };
        let exchange = description.lines().find(|line| line.contains("<ModelExchange")).unwrap();
        Decay { edits: &[(exchange, ""), (flag, "")], ..Decay::new(fmi) }.pack(folder.path());
        let output = command(folder.path(), &["linearize", name]);
        assert_eq!(output.status.code(), Some(1));
        let said = String::from_utf8_lossy(&output.stderr).replace('│', " ");
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains("neither directional derivatives nor the interface for model exchange"), "{said}");
    }
}

/// x' = -2 x rests at 0, wherever it starts, in both versions and by either interface. The pole is -2.
#[test]
fn decay_is_trimmed_by_either_interface() {
    let folder = tempfile::tempdir().unwrap();
    let text = include_str!("../../fmu-import/tests/data/decay3.xml");
    let co_simulation = text.lines().find(|line| line.contains("<CoSimulation")).unwrap();
    for edits in [&[][..], &[(co_simulation, "")]] {
        Decay { edits, ..Decay::new(FmiVersion::V3) }.pack(folder.path());
        let steady: serde_json::Value =
            serde_json::from_str(&printed(folder.path(), &["trim", "Decay3.fmu", "--json"])).unwrap();
        assert_eq!(steady["states"][0]["name"], "x");
        assert_eq!(steady["states"][0]["value"], 0.0);
        assert_eq!(steady["growth"], -2.0);
        let output = command(folder.path(), &["trim", "Decay3.fmu", "--set", "x=1"]);
        assert_eq!(output.status.code(), Some(1));
        let error = String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(error.contains("`x` cannot rest"), "{error}");
    }
    let table = printed(folder.path(), &["trim", "Decay3.fmu"]);
    assert!(table.contains("Stability: stable, largest real part of a pole -2.0000 1/s\n"), "{table}");
}

/// The message about a crash contains the function name of the FMI version.
#[test]
fn a_crash_in_fmi_3_is_named() {
    let folder = tempfile::tempdir().unwrap();
    Decay { defects: &["CRASH"], ..Decay::new(FmiVersion::V3) }.pack(folder.path());
    let output = command(folder.path(), &["check", "Decay3.fmu"]);
    let checked = String::from_utf8_lossy(&output.stdout);
    assert!(checked.contains("during fmi3DoStep"), "{checked}");
}
