//! `check` on FMUs built from C in a temporary folder, with behavior that no FMU exported by this project has.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_check::{Event, Options, Severity, check};
use support::Build;

/// Findings about the behavior of the binary in runs.
fn found(build: &Build) -> Vec<(Severity, String)> {
    let folder = tempfile::tempdir().unwrap();
    let path = build.pack(folder.path());
    let mut found = Vec::new();
    check(&path, &Options::default(), &mut |event| {
        if let Event::Found(finding) = event
            && ["runs", "another start time", "two instances", "fmi2DoStep", "saved states", "fmi2Reset"]
                .contains(&finding.subject.as_str())
        {
            found.push((finding.severity, finding.message));
        }
    });
    found
}

/// FMI 2.0.4, section 4.2.2: an FMU ends the simulation with fmi2Discard and fmi2Terminated, as Stair of the Reference
/// FMUs does. An FMU that discards a step without ending the simulation violates its description.
#[test]
fn an_fmu_may_end_the_simulation() {
    let build = |ends, flags| Build { ends, flags, ..Build::new("Ends", "u", "x") };
    let states = "canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\"";
    assert_eq!(found(&build(None, states)), []);
    // The FMU ends in the second half of the 80 steps of 0.01 s that one instance takes, then in the first half.
    assert_eq!(found(&build(Some((0.5, true)), states)), []);
    assert_eq!(found(&build(Some((0.2, true)), states)), []);
    let discarded = found(&build(Some((0.5, false)), states));
    let later = "fails if started at 5 s, not if started at 0 s: fmi2DoStep returned fmi2Discard".to_owned();
    let from_start = "fmi2DoStep returned fmi2Discard".to_owned();
    assert_eq!(discarded, [(Severity::Warning, later), (Severity::Error, from_start)]);
    let early = "ends the simulation within 8 steps of 0.01 s, too early to be tried";
    assert_eq!(found(&build(Some((0.05, true)), states)), [(Severity::Warning, early.to_owned())]);
}

/// All findings, as lines.
fn lines(build: &Build) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = build.pack(folder.path());
    let mut lines = Vec::new();
    check(&path, &Options::default(), &mut |event| {
        if let Event::Found(finding) = event {
            lines.push(finding.to_string());
        }
    });
    lines
}

/// All capabilities except directional derivatives, because the FMU without defects has only some derivatives.
const FLAGS: &str = "canHandleVariableCommunicationStepSize=\"true\" canInterpolateInputs=\"true\" \
                     maxOutputDerivativeOrder=\"2\" canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\"";

/// Lines that a defect adds to the lines about the FMU without the defect.
fn added(defects: &[&str], flags: &str, edits: &[(&str, &str)]) -> Vec<String> {
    let sound = ["SLOPES=2"];
    let build = Build { flags, edits, defects: &sound, ..Build::new("Fault", "u", "x") };
    let known = lines(&build);
    let of_behavior = ["fmi2Reset", "two instances", "saved states", "FMUstate:", "runs", "promised", "memory"];
    let of_behavior =
        |line: &&String| of_behavior.iter().any(|words| line.contains(words)) && !line.contains("exported");
    assert_eq!(known.iter().filter(of_behavior).collect::<Vec<_>>(), [""; 0], "the FMU without the defect");
    let with_defects = [defects, &sound].concat();
    let build = Build {
        defects: if defects.iter().any(|d| d.starts_with("SLOPES")) { defects } else { &with_defects },
        ..build
    };
    lines(&build).into_iter().filter(|line| !known.contains(line)).collect()
}

#[track_caller]
fn only(found: &[String], expected: &str) {
    assert!(matches!(found, [line] if line.starts_with(expected)), "{expected:?} was expected, not {found:#?}");
}

/// FMI 2.0.4, section 2.1.6: after fmi2Reset the FMU is in the same state as after fmi2Instantiate; all start values
/// are those in the description.
#[test]
fn a_reset_that_keeps_something_is_found() {
    for (defect, expected) in [
        ("RESET_NOTHING", ["leaves `u` at 0.001, its start value is 0.0 (and 5", "leaves `u` at 0.008"]),
        ("RESET_STATES", ["leaves `u` at 0.001, its start value is 0.0 (and 5", "leaves `u` at 0.008"]),
        ("RESET_NUMBERS", ["leaves `label` at \"x\", its start value is \"\""; 2]),
    ] {
        let found = added(&[defect], FLAGS, &[]);
        assert_eq!(found.len(), 2, "{defect}: {found:#?}");
        let when = ["before initialization", "after a run"];
        for ((line, when), expected) in found.iter().zip(when).zip(expected) {
            assert!(line.starts_with(&format!("error: fmi2Reset: {when}, {expected}")), "{defect}: {line}");
        }
    }
}

/// FMI 2.0.4, section 2.1.8: a state contains everything that later steps depend on, including parameters and inputs.
#[test]
fn a_state_that_lacks_something_is_found() {
    for (defect, expected) in [
        ("STATE_NOTHING", "error: fmi2SetFMUstate: leaves `u` at 0.001, it was "),
        ("STATE_WITHOUT_INPUTS", "error: fmi2SetFMUstate: leaves `u` at 0.001, it was "),
        ("NO_STATE", "error: saved states: fmi2GetFMUstate returned fmi2Error"),
        ("BYTES_WITHOUT_PARAMETERS", "error: fmi2DeSerializeFMUstate: leaves `gain` at 1.0, it was 1.001 when"),
        ("BYTES_WITHOUT_STATES", "error: fmi2DeSerializeFMUstate: a state read from its bytes continues differently"),
        ("NO_BYTES", "error: saved states: fmi2SerializedFMUstateSize returned fmi2Error"),
    ] {
        only(&added(&[defect], FLAGS, &[]), expected);
    }
}

/// A difference is a note up to rounding errors, a warning up to the tolerance, and an error above.
#[test]
fn a_state_that_goes_on_otherwise_is_graded() {
    let otherwise = "fmi2SetFMUstate: a restored state continues differently; first `x`: ";
    for (relative, severity, end) in [
        ("1e-14", "note", " of the peak, as by rounding"),
        ("1e-6", "warning", " of the peak, within the tolerance 1e-4"),
        ("1e-2", "error", ""),
    ] {
        let found = added(&[&format!("STATE_OFF={relative}")], FLAGS, &[]);
        let line = found.iter().find(|line| line.contains(otherwise)).unwrap_or_else(|| panic!("{found:#?}"));
        assert!(line.starts_with(&format!("{severity}: {otherwise}")) && line.ends_with(end), "{line}");
    }
}

#[test]
fn instances_that_share_values_are_found() {
    let found = added(&["SHARED"], FLAGS, &[]);
    let expected = "error: two instances: share `u`: set in one, it changes from 0.0 to 0.001 in the other (and 5 other variables)";
    assert!(found.iter().any(|line| line == expected), "{found:#?}");
}

/// FMI 2.0.4, section 4.3.1: one defect for each capability.
#[test]
fn capabilities_that_are_not_there_are_found() {
    for (defect, flags, expected) in [
        (
            "FIXED_STEP",
            "",
            "error: canHandleVariableCommunicationStepSize: is promised, but fmi2DoStep returned fmi2Error",
        ),
        (
            "SLOPES=0",
            "",
            "error: canInterpolateInputs: is promised, but fmi2SetRealInputDerivatives returned fmi2Error",
        ),
        (
            "SLOPES=1",
            "",
            "error: maxOutputDerivativeOrder: is promised, but fmi2GetRealOutputDerivatives returned fmi2Error",
        ),
        (
            "NONE",
            "canNotUseMemoryManagementFunctions=\"true\"",
            "error: canNotUseMemoryManagementFunctions: is set, but",
        ),
        ("PENDING", "", "error: runs: fmi2DoStep returned fmi2Pending"),
        ("PENDING", "canRunAsynchronuously=\"true\"", "warning: canRunAsynchronuously: "),
    ] {
        let flags = format!("{FLAGS} {flags}");
        let build = |defects: &[&str]| lines(&Build { flags: &flags, defects, ..Build::new("Fault", "u", "x") });
        let found = build(&[defect, if defect.starts_with("SLOPES") { "NONE" } else { "SLOPES=2" }]);
        assert!(found.iter().any(|line| line.starts_with(expected)), "{expected:?} was expected, not {found:#?}");
    }
    // A discrete output has no derivatives (FMI 2.0.4, section 4.2.1).
    let discrete = [("causality=\"output\"", "causality=\"output\" variability=\"discrete\"")];
    let found =
        lines(&Build { flags: FLAGS, edits: &discrete, defects: &["SLOPES=1"], ..Build::new("Fault", "u", "x") });
    assert!(!found.iter().any(|line| line.contains("maxOutputDerivativeOrder")), "{found:#?}");
    // An FMU may allow only one instance at a time if its description declares this.
    let single = |flags: &str| lines(&Build { flags, defects: &["SINGLE"], ..Build::new("Fault", "u", "x") });
    let is_rejected = |line: &String| line.starts_with("error: two instances: fmi2Instantiate returned no instance");
    assert!(single("").iter().any(is_rejected));
    assert!(!single("canBeInstantiatedOnlyOncePerProcess=\"true\"").iter().any(is_rejected));
    // Serialized states require saved states.
    let bytes_only = lines(&Build { flags: "canSerializeFMUstate=\"true\"", ..Build::new("Fault", "u", "x") });
    assert!(bytes_only.iter().any(|line| line.starts_with("error: canSerializeFMUstate: ")), "{bytes_only:#?}");
}

/// The check also requests directional derivatives if all are 0 by the model structure, and with respect to states.
#[test]
fn directional_derivatives_that_are_rejected_are_found() {
    const STATE: &str = "<ScalarVariable name=\"rate\" valueReference=\"0\"><Real derivative=\"2\"/></ScalarVariable>\n</ModelVariables>";
    const INPUT: &str = "causality=\"input\"";
    const PARAMETER: &str = "causality=\"parameter\" variability=\"tunable\"";
    let structure = |text: &str| format!("<ModelStructure>{text}</ModelStructure>");
    let outputs = |dependencies: &str| format!("<Outputs><Unknown index=\"2\" {dependencies}/></Outputs>");
    let derivatives = "<Derivatives><Unknown index=\"10\" dependencies=\"\"/></Derivatives>";
    let initial = "<InitialUnknowns><Unknown index=\"2\" dependencies=\"4\"/></InitialUnknowns>";
    let cases = [
        ("an output that depends on an input", vec![], outputs("dependencies=\"1\"")),
        ("an output that may depend on all", vec![], outputs("")),
        ("an output that depends on nothing", vec![], outputs("dependencies=\"\"")),
        ("a state", vec![(INPUT, PARAMETER), ("</ModelVariables>", STATE)], outputs("dependencies=\"\"") + derivatives),
        ("a start", vec![(INPUT, PARAMETER)], outputs("dependencies=\"\"") + initial),
    ];
    for (case, mut edits, text) in cases {
        let text = structure(&text);
        edits.push(("<ModelStructure/>", &text));
        let build = |defects: &[&str], expected: &str| {
            let flags = "providesDirectionalDerivative=\"true\"";
            let found = lines(&Build { flags, edits: &edits, defects, ..Build::new("Fault", "u", "x") });
            found.iter().any(|line| line.starts_with(expected))
        };
        let expected = "error: providesDirectionalDerivative: is promised, but fmi2GetDirectionalDerivative returned";
        assert!(build(&["NO_DERIVATIVE"], expected), "{case}");
        assert!(case == "a state" || !build(&[], expected), "{case}");
        // fmi2Discard is the status of a derivative that is not finite.
        let noted = "note: providesDirectionalDerivative: derivatives that the check requests are not finite: ";
        let defects = &["DISCARDED_DERIVATIVE"];
        assert!(build(defects, noted) && !build(defects, expected), "{case}");
    }
}

/// FMI 2.0.4, section 2.2.8: in Initialization Mode, an initial unknown depends only on the variables, of any type,
/// that its entry lists. Variables by number: 1 u, 2 x, 3 gain, 4 start, 5 failure, 6 count, 7 inverted, 8 moved, 9
/// label.
#[test]
fn initial_unknowns_that_follow_more_than_they_name_are_found() {
    let about = |follow: &str, unknown: usize, dependencies: &str, edits: &[(&str, &str)]| {
        let text = format!(
            "<ModelStructure><Outputs><Unknown index=\"2\"/><Unknown index=\"6\"/><Unknown index=\"8\"/></Outputs>\
             <InitialUnknowns><Unknown index=\"{unknown}\" dependencies=\"{dependencies}\"/></InitialUnknowns></ModelStructure>"
        );
        let edits = [edits, &[("<ModelStructure/>", &text)]].concat();
        let defects = [format!("FOLLOW={follow}")];
        let defects: Vec<&str> = defects.iter().map(String::as_str).collect();
        let found = lines(&Build { edits: &edits, defects: &defects, ..Build::new("Fault", "u", "x") });
        found.into_iter().filter(|line| line.contains("missing from its dependencies")).collect::<Vec<_>>()
    };
    let line = |unknown: &str, known: &str| {
        format!(
            "error: variable `{unknown}`: depends on `{known}`, which is missing from its dependencies in InitialUnknowns"
        )
    };
    let sum = "i->v.real[1]=i->v.real[3]+i->v.real[0]+i->v.boolean[0]+strlen(i->label)";
    assert_eq!(about(sum, 2, "1 4 7 9", &[]), [""; 0]);
    assert_eq!(about(sum, 2, "1 4 7", &[]), [line("x", "label")]);
    assert_eq!(about(sum, 2, "1 4 9", &[]), [line("x", "inverted")]);
    assert_eq!(about(sum, 2, "4 7 9", &[]), [line("x", "u")]);
    assert_eq!(about(sum, 2, "", &[]), ["u", "start", "inverted", "label"].map(|known| line("x", known)));
    // Unknowns of other types.
    let flag = "i->v.boolean[1]=i->v.real[2]>1";
    assert_eq!(about(flag, 8, "3", &[]), [""; 0]);
    assert_eq!(about(flag, 8, "", &[]), [line("moved", "gain")]);
    // A start value of a variable that is not a parameter.
    let exact = ("<Integer/>", "<Integer start=\"0\"/>");
    let initial = (
        "name=\"count\" valueReference=\"1\" causality=\"output\"",
        "name=\"count\" valueReference=\"1\" causality=\"output\" initial=\"exact\"",
    );
    let twice = "i->v.real[1]=2*i->v.integer[1]";
    assert_eq!(about(twice, 2, "6", &[exact, initial]), [""; 0]);
    assert_eq!(about(twice, 2, "", &[exact, initial]), [line("x", "count")]);
}
