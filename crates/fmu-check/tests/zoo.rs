//! FMUs with the habits of other tools: what the loader accepts, and what `check` reports.
#![cfg(unix)]

#[path = "../../../tests/zoo/zoo.rs"]
mod zoo;

use fmu_check::{Event, Finding, Options, Severity, Topic, check};
use fmu_import::description::FmiVersion;
use fmu_import::fmu::Fmu;
use fmu_import::loader::Instance;
use std::time::Duration;
use zoo::Zoo;

const VERSIONS: [FmiVersion; 2] = [FmiVersion::V2, FmiVersion::V3];

fn findings_with(zoo: &Zoo, options: &Options) -> Vec<Finding> {
    let folder = tempfile::tempdir().unwrap();
    let mut findings = Vec::new();
    check(&zoo.pack(folder.path()), options, &mut |event| {
        if let Event::Found(finding) = event {
            findings.push(finding);
        }
    });
    findings
}

fn findings(zoo: &Zoo) -> Vec<Finding> {
    findings_with(zoo, &Options::default())
}

/// The only finding, as a line, and the question that it answers.
#[track_caller]
fn only(zoo: &Zoo) -> (String, Topic) {
    let found = findings(zoo);
    assert_eq!(found.len(), 1, "{found:#?}");
    (found[0].to_string(), found[0].topic)
}

/// An FMU, and an instance of it that can be stepped.
fn started(zoo: &Zoo) -> Instance {
    let folder = tempfile::tempdir().unwrap();
    let mut instance = Fmu::open(zoo.pack(folder.path())).unwrap().instantiate("one").unwrap();
    instance.setup_experiment(0.0, Some(1.0)).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    instance
}

#[test]
fn an_fmu_without_habits_has_no_findings() {
    for fmi in VERSIONS {
        assert_eq!(findings(&Zoo { fmi, ..Zoo::new("none") }), []);
    }
}

/// FMI 2.0.4, section 2.1.5: the message is a format of printf, and its arguments follow.
#[test]
fn messages_have_their_arguments() {
    for fmi in VERSIONS {
        let mut instance = started(&Zoo { fmi, at: 0.5, ..Zoo::new("error") });
        instance.do_step(0.0, 0.01).unwrap();
        let error = instance.do_step(0.49, 0.01).unwrap_err().to_string();
        assert!(error.ends_with("it broke at 0.49 with 7 of nine"), "{error}");
    }
}

/// The default experiment is simulated once from start to stop. An error near its end is reported with its time.
#[test]
fn the_default_experiment_is_simulated() {
    for fmi in VERSIONS {
        let late = |habit, at| Zoo { fmi, at, ..Zoo::new(habit) };
        let message = "error: the default experiment: fails at 0.96 s of 1 s: ";
        let (line, topic) = only(&late("error", 0.97));
        assert!(line.starts_with(message) && line.contains("(\"it broke at 0.96 with 7 of nine\")"), "{line}");
        assert_eq!(topic, Topic::Simulation);
        let (line, topic) = only(&late("nan", 0.97));
        assert_eq!(line, "error: the default experiment: `y` is NaN at 0.97 s of 1 s");
        assert_eq!(topic, Topic::Simulation);
        let (line, _) = only(&late("end", 0.97));
        assert_eq!(
            line,
            "note: the default experiment: the FMU ended the simulation in the step at 0.96 s, before 1 s"
        );
        // The declared stop time is never exceeded.
        assert_eq!(findings(&late("strict", 0.0)), []);
        let long = [("stopTime=\"1\"", "stopTime=\"1e12\"")];
        let options = Options { experiment: Duration::from_millis(50), ..Options::default() };
        let cut = findings_with(&Zoo { edits: &long, ..late("none", 1e9) }, &options);
        assert_eq!(cut.len(), 1, "{cut:#?}");
        assert_eq!(cut[0].severity, Severity::Note);
        assert!(cut[0].message.ends_with("s of 1000000000000 s after 0.05 s (--timeout)"), "{}", cut[0]);
    }
}

/// Reference: the step uses 400 kB of stack, which are 391 KiB. Without them, a call needs some KiB.
#[test]
#[cfg(all(target_os = "linux", target_arch = "x86_64"))]
fn a_step_that_takes_much_stack_is_reported() {
    let (line, topic) = only(&Zoo::new("deep"));
    let size: usize = line
        .strip_prefix("warning: stack: a run takes ")
        .and_then(|rest| rest.split_once(" KiB of stack, more than 256 KiB"))
        .and_then(|(size, _)| size.parse().ok())
        .unwrap_or_else(|| panic!("{line}"));
    assert!((391..450).contains(&size), "{line}");
    assert_eq!(topic, Topic::Simulation);
}

/// An FMU that fails only if it starts later gets a warning.
#[test]
fn another_start_time_is_tried() {
    for fmi in VERSIONS {
        // No run reaches 1.41 s, at which the output becomes NaN.
        let edits = [("startTime=\"0\" stopTime=\"1\"", "startTime=\"0\" stopTime=\"1.4\"")];
        let found = findings(&Zoo { fmi, at: 1.41, edits: &edits, ..Zoo::new("nan") });
        assert_eq!(found, []);
        let edits = [("startTime=\"0\" stopTime=\"1\"", "startTime=\"0\" stopTime=\"2.2\"")];
        let found = findings(&Zoo { fmi, at: 1.2, edits: &edits, ..Zoo::new("nan") });
        let lines: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert_eq!(
            lines,
            [
                "warning: another start time: fails if started at 1.1 s, not if started at 0 s: `y` is not finite",
                "error: the default experiment: `y` is NaN at 1.2 s of 2.2 s"
            ]
        );
    }
}

/// A failed reset before initialization and a failed reset after a run are two findings.
#[test]
fn resets_are_two_findings() {
    for (fmi, function) in [(FmiVersion::V2, "fmi2Reset"), (FmiVersion::V3, "fmi3Reset")] {
        let found = findings(&Zoo { fmi, at: 1e9, ..Zoo::new("reset_nothing") });
        let lines: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert_eq!(lines.len(), 2, "{lines:#?}");
        for (line, when) in lines.iter().zip(["before initialization", "after a run"]) {
            assert!(line.starts_with(&format!("error: {function}: {when}, leaves `u` at ")), "{line}");
        }
    }
}

/// FMI 2.0.4, section 2.2.1: `modelIdentifier` must be a C identifier. FMUs with other identifiers are loaded anyway.
#[test]
fn identifiers_that_are_not_of_c_are_findings() {
    for fmi in VERSIONS {
        for identifier in ["Zoo-Dash.1", "Zoo of blanks"] {
            let (line, topic) = only(&Zoo { fmi, identifier, ..Zoo::new("none") });
            let expected = format!("error: modelIdentifier: \"{identifier}\" is not a C identifier");
            assert!(line.starts_with(&expected), "{line}");
            assert_eq!(topic, Topic::Standard);
        }
    }
}

#[test]
fn rules_of_the_schema_and_of_variability() {
    let [two, three] = VERSIONS;
    for (fmi, from, to, expected) in [
        (
            two,
            "causality=\"output\" variability=\"discrete\"><Integer",
            "causality=\"output\"><Integer",
            "error: variable `yi`: is continuous, the default of `variability`",
        ),
        (
            two,
            "<UnitDefinitions>",
            "<UnitDefinitions/><UnitDefinitions>",
            "error: <UnitDefinitions>, line 4: is empty; FMI 2.0 requires an element in it: leave it out",
        ),
        (
            three,
            "causality=\"input\" start=\"0\"/>\n    <Float64 name=\"y\"",
            "causality=\"input\" start=\"0\"><Alias name=\"v\"/><Annotations><Annotation type=\"x\"/></Annotations></Float64>\n    <Float64 name=\"y\"",
            "error: <Float64>, line 15, child in line 15: has <Annotations> after <Alias>, which must come first in FMI 3.0",
        ),
        (
            three,
            "<UnitDefinitions>",
            "<Annotations><Annotation type=\"x\"/></Annotations><UnitDefinitions>",
            "error: <fmiModelDescription>, line 2, child in line 4: has <UnitDefinitions> after <Annotations>",
        ),
    ] {
        let found = findings(&Zoo { fmi, edits: &[(from, to)], ..Zoo::new("none") });
        assert!(found.iter().any(|finding| finding.to_string().starts_with(expected)), "{expected}: {found:#?}");
        assert!(found.iter().all(|finding| finding.topic == Topic::Standard), "{found:#?}");
    }
    // If there are no outputs, the list must be missing, not empty.
    let text = include_str!("../../../tests/zoo/zoo2.xml");
    let list = text.lines().find(|line| line.contains("<Unknown index=\"2\" dependencies=\"1\"/>")).unwrap();
    let found = findings(&Zoo { edits: &[(list, "")], ..Zoo::new("none") });
    let is_empty = |finding: &Finding| finding.to_string().starts_with("error: <Outputs>, line 31: is empty; FMI 2.0");
    assert!(found.iter().any(is_empty), "{found:#?}");
}
