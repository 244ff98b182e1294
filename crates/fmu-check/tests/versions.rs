//! `check` on FMUs of both versions with both interfaces, built from C.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/decay.rs"]
mod decay;

use decay::Decay;
use fmu_check::{Checked, Event, Options, check};
use fmu_import::description::FmiVersion;

/// The scope of the check, and all findings as lines.
fn checked(build: &Decay<'_>) -> (Checked, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let path = build.pack(folder.path());
    let (mut looked_at, mut lines) = (Checked::default(), Vec::new());
    check(&path, &Options::default(), &mut |event| match event {
        Event::Checked(so_far) => looked_at = so_far,
        Event::Found(finding) => lines.push(finding.to_string()),
        Event::Trying { .. } => (),
    });
    (looked_at, lines)
}

#[test]
fn sound_fmus_of_both_versions_have_no_findings() {
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        let (looked_at, lines) = checked(&Decay::new(fmi));
        assert_eq!(lines, [""; 0], "{fmi}");
        let text = looked_at.to_string();
        let exchange = "model exchange: the event at the start, states with derivatives and event indicators, saved states, integration, another start time, \
                        partial derivatives, the end, stack, state derivatives as in co-simulation";
        assert!(text.ends_with(exchange), "{text}");
        assert_eq!(text.contains("adjoint derivatives"), fmi == FmiVersion::V3, "{text}");
    }
}

/// FMI 3.0.2, section 2.4.9.2: members are variables that can be connected, with unique names if these match.
#[test]
fn defects_of_terminals_are_found() {
    let member = |variable: &str, member: &str| {
        format!("<TerminalMemberVariable variableName=\"{variable}\" {member} variableKind=\"signal\"/>")
    };
    let (u, named) = (member("u", "memberName=\"u\""), member("y", "memberName=\"u\""));
    let (unnamed, unknown, local) = (member("y", ""), member("none", ""), member("der(x)", ""));
    for (terminals, expected) in [
        (format!("<Terminal name=\"a\" matchingRule=\"plug\">{u}</Terminal>"), vec![]),
        (format!("<Terminal name=\"a\" matchingRule=\"sequence\">{u}{unnamed}</Terminal>"), vec![]),
        (
            format!("<Terminal name=\"a\" matchingRule=\"plug\">{u}{named}</Terminal>"),
            vec!["error: terminal `a`: has two members named `u`"],
        ),
        (
            format!("<Terminal name=\"a\" matchingRule=\"bus\">{unnamed}</Terminal>"),
            vec![
                "error: terminal `a`: matches members by their names (matchingRule=\"bus\"), but `y` has no memberName",
            ],
        ),
        (
            format!(
                "<Terminal name=\"a\" matchingRule=\"none\"><Terminal name=\"b\" matchingRule=\"none\">{unknown}{local}\
                 </Terminal></Terminal>"
            ),
            vec![
                "error: terminal `b`: refers to the variable `none`, which does not exist",
                "error: terminal `b`: contains `der(x)`: only inputs, outputs and parameters can be connected",
            ],
        ),
    ] {
        let terminals = format!("<Terminals>{terminals}</Terminals>");
        let (_, lines) = checked(&Decay { terminals: &terminals, ..Decay::new(FmiVersion::V3) });
        assert_eq!(lines, expected, "{terminals}");
    }
    let (_, lines) = checked(&Decay { terminals: "<Terminals><Terminal/></Terminals>", ..Decay::new(FmiVersion::V3) });
    assert!(lines[0].starts_with("error: terminalsAndIcons.xml: ") && lines.len() == 1, "{lines:?}");
}

/// Each defect is found, in each version that can have it.
#[test]
fn defects_of_model_exchange_are_found() {
    let [two, three] = [FmiVersion::V2, FmiVersion::V3];
    for (fmi, defect, expected) in [
        (
            two,
            "FOREVER",
            "error: fmi2NewDiscreteStates: needs another update after 1000 updates: the event at 0 s does not end",
        ),
        (three, "FOREVER", "error: fmi3UpdateDiscreteStates: needs another update after 1000 updates"),
        (two, "NOT_FINITE", "error: fmi2GetDerivatives: gives NaN for `x` at the start"),
        (three, "NOT_FINITE", "error: fmi3GetContinuousStateDerivatives: gives NaN for `x` at the start"),
        (
            two,
            "NOT_REPEATABLE",
            "error: fmi2GetDerivatives: gives -2.0 for `x`, but the variable has the value -1.9999",
        ),
        (
            three,
            "NOMINAL=0",
            "error: fmi3GetNominalsOfContinuousStates: gives 0 for `x`; a nominal value must be above 0",
        ),
        (
            two,
            "NOMINAL=-1",
            "error: fmi2GetNominalsOfContinuousStates: gives -1 for `x`; a nominal value must be above 0",
        ),
        (
            three,
            "STATE_NOTHING",
            "error: fmi3SetFMUState: gives 1.0 for `x`, but when the state was saved it was 1.001",
        ),
        (
            three,
            "OTHER_IN_EXCHANGE",
            "error: fmi3GetContinuousStateDerivatives: gives -4.0 for the derivative of `x` at the start, but co-simulation gives -2.0",
        ),
        (
            two,
            "OTHER_IN_EXCHANGE",
            "error: fmi2GetDerivatives: gives -4.0 for the derivative of `x` at the start, but co-simulation gives -2.0",
        ),
        (
            three,
            "ADJOINT_TWICE",
            "error: fmi3GetAdjointDerivative: is not the transpose of fmi3GetDirectionalDerivative: d(`der(x)`)/d(`x`) is -4, the directional derivative is -2",
        ),
        (
            three,
            "UNEXPORTED",
            "error: fmi3ActivateModelPartition: is not exported by the binary; all functions of FMI 3.0 must be exported",
        ),
        (three, "EARLY", "error: runs: fmi3DoStep returned before the end of the step, which was not allowed"),
        (three, "ENDS=0.02", "warning: fmi3DoStep: ends the simulation within 8 steps of 0.01 s"),
    ] {
        let (_, lines) = checked(&Decay { defects: &[defect], ..Decay::new(fmi) });
        assert!(lines.iter().any(|line| line.starts_with(expected)), "{fmi} {defect}: {lines:#?}");
    }
}

/// FMI 3.0.2, section 2.2.10: dependencies are on variables in ModelStructure, and on elements that exist.
#[test]
fn wrong_dependencies_of_elements_are_found() {
    let handles = "canHandleVariableCommunicationStepSize=\"true\"";
    let both = format!("{handles} providesPerElementDependencies=\"true\"");
    let promised = [(handles, both.as_str())];
    let of_y = "among the dependencies of `y`";
    for (defects, expected) in [
        (&[][..], None),
        (&["DEPENDENCY=9"], Some("`flag`, which is missing from its dependencies in ModelStructure")),
        (&["DEPENDENCY=99"], Some("the value reference 99, which no variable has")),
        (&["ELEMENT=2"], Some("element 2 of `u`, whose size is 1")),
    ] {
        let (looked_at, lines) = checked(&Decay { defects, edits: &promised, ..Decay::new(FmiVersion::V3) });
        let expected = expected.map(|what| format!("error: fmi3GetVariableDependencies: names {what}, {of_y}"));
        assert_eq!(lines, Vec::from_iter(expected));
        assert!(looked_at.trials.contains(&"dependencies of elements".to_owned()), "{looked_at:?}");
    }
}

/// A function that writes to the first element of an empty array is found.
#[test]
fn writes_without_elements_are_found() {
    let [two, three] = [FmiVersion::V2, FmiVersion::V3];
    for (fmi, list, derivative, function) in [
        (
            two,
            "<Derivatives><Unknown index=\"3\" dependencies=\"2\"/></Derivatives>",
            "derivative=\"2\"",
            "fmi2GetDerivatives",
        ),
        (
            three,
            "<ContinuousStateDerivative valueReference=\"2\" dependencies=\"1\"/>",
            "derivative=\"1\"",
            "fmi3GetContinuousStateDerivatives",
        ),
    ] {
        let edits = [(list, ""), (derivative, "")];
        let (_, lines) = checked(&Decay { defects: &["LEAST=0"], edits: &edits, ..Decay::new(fmi) });
        let expected = format!("error: {function}: writes to the first element of an array that has none");
        assert!(lines.iter().any(|line| line.starts_with(&expected)), "{fmi}: {lines:#?}");
    }
}

/// The states of such an FMU have no variables, so messages name the derivatives instead.
#[test]
fn derivatives_without_a_state_of_their_size_are_checked() {
    let [two, three] = [FmiVersion::V2, FmiVersion::V3];
    for (fmi, edit, rule, value) in [
        (
            two,
            ("derivative=\"2\"", ""),
            "error: variable `der(x)`: is listed in Derivatives, but lacks the attribute `derivative`",
            "error: fmi2GetDerivatives: gives NaN for `der(x)` at the start",
        ),
        (
            three,
            ("derivative=\"1\"", ""),
            "error: variable `der(x)`: is listed in ContinuousStateDerivative, but lacks the attribute `derivative`",
            "error: fmi3GetContinuousStateDerivatives: gives NaN for `der(x)` at the start",
        ),
        (
            three,
            ("derivative=\"1\"", "derivative=\"18\""),
            "error: variable `der(x)`: must have as many elements as its state: it has 1, but `v` has 3",
            "error: fmi3GetContinuousStateDerivatives: gives NaN for `der(x)` at the start",
        ),
    ] {
        let (looked_at, lines) = checked(&Decay { defects: &["NOT_FINITE"], edits: &[edit], ..Decay::new(fmi) });
        for expected in [rule, value] {
            assert!(lines.iter().any(|line| line == expected), "{expected}: {lines:#?}");
        }
        assert!(looked_at.to_string().contains("state derivatives as in co-simulation"), "{looked_at:?}");
    }
}

/// An FMU for model exchange only, without communication steps, is checked too.
#[test]
fn an_fmu_for_model_exchange_only_is_sound() {
    for (fmi, text) in [
        (FmiVersion::V2, include_str!("../../fmu-import/tests/data/decay2.xml")),
        (FmiVersion::V3, include_str!("../../fmu-import/tests/data/decay3.xml")),
    ] {
        let line = text.lines().find(|line| line.contains("<CoSimulation")).unwrap();
        let (looked_at, lines) = checked(&Decay { edits: &[(line, "")], ..Decay::new(fmi) });
        assert_eq!(lines, [""; 0], "{fmi}");
        assert!(looked_at.trials.iter().all(|trial| trial.starts_with("model exchange: ")), "{looked_at:?}");
    }
}

/// Rules of FMI 3.0 that differ from those of FMI 2.0.
#[test]
fn rules_of_descriptions_of_fmi_3() {
    for (from, to, expected) in [
        (
            "causality=\"independent\" variability=\"continuous\"",
            "",
            "error: ModelVariables: has no variable with causality",
        ),
        (
            "<Float64 name=\"time\"",
            "<Float64 name=\"t\" valueReference=\"90\" causality=\"independent\"/><Float64 name=\"time\"",
            "error: variable `time`: is a second variable with causality Independent",
        ),
        (
            "reinit=\"true\"",
            "reinitialize=\"true\"",
            "error: <Float64>, line 12: FMI 3.0 has no attribute `reinitialize` here",
        ),
        (
            "<Output valueReference=\"1\" dependencies=\"\"/>",
            "",
            "error: variable `x`: is not listed in ModelStructure/Output, where it belongs",
        ),
        (
            "<InitialUnknown valueReference=\"5\" dependencies=\"1 4\"/>",
            "",
            "error: variable `y`: is not listed in ModelStructure/InitialUnknown",
        ),
        (
            "<Output valueReference=\"5\" dependencies=\"1 4\"/>",
            "<Output valueReference=\"5\" dependencies=\"1\"/>",
            "error: variable `y`: depends on `u`, which is missing from its dependencies in Output",
        ),
        (
            "<EventIndicator valueReference=\"7\"",
            "<EventIndicator valueReference=\"6\"",
            "error: variable `count`: is listed in EventIndicator, which takes continuous Float64 and Float32 only",
        ),
        (
            "valueReference=\"2\" derivative=\"1\"",
            "valueReference=\"2\"",
            "error: variable `der(x)`: is listed in ContinuousStateDerivative, but lacks the attribute `derivative`",
        ),
        (
            "start=\"1 2 3\"",
            "start=\"1 2 4\"",
            "error: variable `v[3]`: its start value is 4.0, but the binary starts with 3.0",
        ),
        ("start=\"7\"", "start=\"8\"", "error: variable `wide`: its start value is 8, but the binary starts with 7"),
        (
            "canGetAndSetFMUState=\"true\" ",
            "",
            "error: canSerializeFMUState: is true, which needs canGetAndSetFMUState to be true as well",
        ),
        (
            "<EventIndicator valueReference=\"7\" dependencies=\"1\"/>",
            "",
            "error: fmi3GetNumberOfEventIndicators: gives 1, but ModelStructure has 0",
        ),
    ] {
        let (_, lines) = checked(&Decay { edits: &[(from, to)], ..Decay::new(FmiVersion::V3) });
        assert!(lines.iter().any(|line| line.starts_with(expected)), "{expected}: {lines:#?}");
    }
}

/// FMI 3.0.2, sections 2.4.7.2 and 2.3.6: after Configuration Mode, and after Reconfiguration Mode if the parameter is
/// tunable, arrays have the new lengths. The FMU is tried with the lengths 2, 5 and 3.
#[test]
fn lengths_that_structural_parameters_set_are_checked() {
    let edits = [
        (
            "name=\"wide\" valueReference=\"14\" causality=\"parameter\" start=\"7\"",
            "name=\"wide\" valueReference=\"14\" causality=\"structuralParameter\" variability=\"tunable\" start=\"3\" min=\"2\" max=\"5\"",
        ),
        ("<Dimension start=\"3\"/>", "<Dimension valueReference=\"14\"/>"),
        ("<Dimension start=\"3\"/>", "<Dimension valueReference=\"14\"/>"),
    ];
    let lines = |defects: &[&str]| checked(&Decay { defects, edits: &edits, ..Decay::new(FmiVersion::V3) });
    let (looked_at, sound) = lines(&["RESIZED"]);
    assert_eq!(sound, [""; 0]);
    let trials = looked_at.trials.iter().filter(|trial| trial.ends_with("structural parameters"));
    assert_eq!(trials.count(), 2, "{looked_at:?}");

    let status = "returned fmi3Error";
    let twice = |line: String| ["co-simulation", "model exchange"].map(|name| line.replace("IN", name)).to_vec();
    for (defects, expected) in [
        (
            &["RESIZED", "KEEPS_LENGTH"][..],
            twice(format!(
                "error: variable `v`: must have 2 elements when `wide` has the value 2 (IN): fmi3SetFloat64 {status}"
            )),
        ),
        (
            &["RESIZED", "ONLY_BEFORE_START"],
            twice(format!(
                "error: variable `wide`: cannot have the value 2 in Reconfiguration Mode, although it is within the limits (IN): \
                 fmi3EnterConfigurationMode {status}"
            )),
        ),
        (
            &["RESIZED", "ANY_COUNT"],
            twice("warning: variable `v`: gives 3 values although it has 2 elements (IN)".into()),
        ),
        (
            &["RESIZED", "COUNTS_ELEMENTS"],
            vec!["error: fmi3GetNumberOfContinuousStates: gives 0 when `wide` has the value 2, but must give 1".into()],
        ),
        (
            &[],
            twice(format!(
                "error: variable `wide`: cannot have the value 2 in Configuration Mode, although it is within the limits (IN): \
                 fmi3EnterConfigurationMode {status}"
            )),
        ),
    ] {
        let found = lines(defects).1;
        let of_trial = found.iter().filter(|line| {
            ["`wide`", "3 values"].iter().any(|text| line.contains(text)) && !line.contains("start value")
        });
        assert_eq!(of_trial.cloned().collect::<Vec<_>>(), expected, "{defects:?}");
    }
}

/// FMI 3.0.2, sections 4.2.1 and 4.2.2: updates are within the step and in order, change nothing, and the step ends where
/// the importer asks for it.
#[test]
fn defects_of_intermediate_updates_are_found() {
    let edits = [
        (
            "<CoSimulation modelIdentifier=\"Decay\"",
            "<CoSimulation modelIdentifier=\"Decay\" providesIntermediateUpdate=\"true\" \
             canReturnEarlyAfterIntermediateUpdate=\"true\"",
        ),
        ("name=\"y\" valueReference=\"5\"", "name=\"y\" valueReference=\"5\" intermediateUpdate=\"true\""),
    ];
    let sound = ["UPDATES=0.5", "LAST=1", "EFFECT=", "RESTORES=0", "CAN_RETURN=1", "IGNORES=0"];
    let early = "canReturnEarlyAfterIntermediateUpdate: is promised, but ";
    for (defects, expected) in [
        (&[][..], String::new()),
        (&["UPDATES=1.5"], "error: intermediateUpdate: is called at 0.015 s in the step from 0 s to 0.01 s".to_owned()),
        (
            &["UPDATES=0.75", "LAST=0.5"],
            "error: intermediateUpdate: is called at 0.005 s after 0.0075 s, although that step of the solver was finished"
                .to_owned(),
        ),
        (
            &["EFFECT=i->m.u=NAN", "RESTORES=1"],
            "error: intermediateUpdate: is called at 0.005 s, where `y` is NaN".to_owned(),
        ),
        (&["EFFECT=continue"], "warning: providesIntermediateUpdate: is promised, but 40 steps have no intermediate update".to_owned()),
        (&["EFFECT=i->m.x+=0.125"], "error: intermediate updates: change the results; first `x`: ".to_owned()),
        (&["CAN_RETURN=0"], format!("warning: {early}no intermediate update of a step allows it")),
        (&["IGNORES=1"], format!("error: {early}a return requested at 0.05 s ends the step at 0.1 s")),
    ] {
        let name = |macro_: &str| macro_.split('=').next().unwrap().to_owned();
        let kept = sound.iter().filter(|own| defects.iter().all(|defect| name(defect) != name(own)));
        let macros: Vec<&str> = kept.chain(defects).copied().collect();
        let (looked_at, lines) = checked(&Decay { defects: &macros, edits: &edits, ..Decay::new(FmiVersion::V3) });
        assert!(looked_at.to_string().contains("intermediate updates"), "{looked_at}");
        assert_eq!(lines.len(), usize::from(!expected.is_empty()), "{defects:?}: {lines:?}");
        assert!(lines.iter().all(|line| line.starts_with(&expected)), "{defects:?}: {lines:?}");
    }
}

/// FMI 3.0.2, sections 2.3.5 and 4.2.1: an event ends, the next one is in the future, and the same calls have the same
/// results, also after a state was restored.
#[test]
fn defects_of_events_in_co_simulation_are_found() {
    let edits =
        [("<CoSimulation modelIdentifier=\"Decay\"", "<CoSimulation modelIdentifier=\"Decay\" hasEventMode=\"true\"")];
    for (handled, announces, expected) in [
        ("", "0", None),
        (
            "static int n; i->m.x += 0.125 * n++",
            "0",
            Some("error: event mode: gives other results in another instance; first `x`: "),
        ),
        (
            "i->m.x += 0.125 * i->handled++",
            "0",
            Some("error: event mode: gives other results if states are restored in Event Mode; first `x`: "),
        ),
        (
            "*needed = true",
            "0",
            Some("error: event mode: fmi3UpdateDiscreteStates: more than 100 event iterations at one time"),
        ),
        ("", "1", Some("error: fmi3UpdateDiscreteStates: announces at 0 s a next event that is not after this time")),
    ] {
        let defects = ["EVENTS".to_owned(), format!("HANDLED={handled}"), format!("ANNOUNCES={announces}")];
        let defects = defects.each_ref().map(String::as_str);
        let (looked_at, lines) = checked(&Decay { defects: &defects, edits: &edits, ..Decay::new(FmiVersion::V3) });
        assert!(looked_at.trials.iter().any(|trial| trial == "event mode") || expected.is_some(), "{looked_at}");
        // Model exchange has the same defects.
        let of_trial = lines.iter().filter(|line| ["event mode", "announces"].iter().any(|text| line.contains(text)));
        let of_trial: Vec<_> = of_trial.collect();
        assert_eq!(of_trial.len(), usize::from(expected.is_some()), "{handled}: {lines:?}");
        assert!(of_trial.iter().all(|line| line.starts_with(expected.unwrap_or_default())), "{handled}: {lines:?}");
    }
}
