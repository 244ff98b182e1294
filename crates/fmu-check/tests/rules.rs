//! Rules of descriptions of FMI 3.0: `Rules.xml` follows them all, and each edit violates one. The sections in the
//! messages are those of FMI 3.0.2.

use fmu_check::without_running;

const SOUND: &str = include_str!("data/Rules.xml");

fn findings(description: &str) -> Vec<String> {
    without_running(description, &[]).iter().map(ToString::to_string).collect()
}

/// An edit, the finding that it leads to, and the section of the rule; the section is empty if the finding is not about
/// a rule of `fmi3.rs`.
type Case<'a> = (&'a str, &'a str, &'a str, &'a str);

/// Each edit leads to exactly this finding.
#[track_caller]
fn violations(cases: &[Case<'_>]) {
    for (from, to, expected, section) in cases {
        assert!(SOUND.contains(from), "not in the description: {from}");
        let clause = if section.is_empty() { String::new() } else { format!(" (FMI 3.0.2, section {section})") };
        assert_eq!(findings(&SOUND.replacen(from, to, 1)), [format!("error: {expected}{clause}")], "{to}");
    }
}

#[test]
fn a_sound_description_has_no_findings() {
    assert_eq!(findings(SOUND), [""; 0]);
}

#[test]
fn timing_of_clocks() {
    let later = "name=\"later\"";
    violations(&[
        (
            " intervalDecimal=\"0.01\" shiftDecimal=\"0.005\"",
            "",
            "variable `control`: is a constant input clock, which must have an interval: add `intervalDecimal`",
            "2.4.4",
        ),
        (
            "clocks=\"1 3\" intervalVariability=\"triggered\"",
            "clocks=\"1 3\" intervalVariability=\"constant\" intervalDecimal=\"1\"",
            "variable `fired`: is a constant output clock, which must be an input",
            "2.2.8.2",
        ),
        (
            "clocks=\"1 3\" intervalVariability=\"triggered\"",
            "clocks=\"1 3\" intervalVariability=\"countdown\"",
            "variable `fired`: is a countdown output clock, which must be an input",
            "2.2.8.2",
        ),
        (
            "valueReference=\"5\" intervalVariability=\"triggered\"",
            "valueReference=\"5\" intervalVariability=\"changing\"",
            "variable `inner`: is a changing local clock, which must be an input",
            "2.2.8.2",
        ),
        (
            "valueReference=\"5\" intervalVariability=\"triggered\"",
            "valueReference=\"5\"",
            "variable `inner`: is a triggered local clock, which must have the attribute `intervalVariability`",
            "2.4.4",
        ),
        (
            "intervalDecimal=\"0.01\"",
            "intervalDecimal=\"0\"",
            "variable `control`: is a constant input clock, which must have a number above 0 as `intervalDecimal`, got 0",
            "2.4.4",
        ),
        (
            "shiftDecimal=\"0.005\"",
            "shiftDecimal=\"-1\"",
            "variable `control`: is a constant input clock, which must have a number from 0 as `shiftDecimal`, got -1",
            "2.4.4",
        ),
        (
            "\"fixed\"",
            "\"fixed\" shiftDecimal=\"0\"",
            "variable `free`: is a fixed input clock, which must have `intervalDecimal`, because it has `shiftDecimal`",
            "2.4.4",
        ),
        (
            "\"fixed\"",
            "\"fixed\" shiftCounter=\"1\"",
            "variable `free`: is a fixed input clock, which must have `intervalCounter`, because it has `shiftCounter`",
            "2.4.4",
        ),
        (
            later,
            &format!("{later} intervalDecimal=\"1\""),
            "variable `later`: is a countdown input clock, which must be constant, fixed or tunable, because it has `intervalDecimal`",
            "2.4.4",
        ),
        (
            later,
            &format!("{later} resolution=\"1\""),
            "variable `later`: is a countdown input clock, which must be constant, fixed or tunable, because it has `resolution`",
            "2.4.4",
        ),
        (
            " supportsFraction=\"true\" resolution=\"3\"",
            " resolution=\"3\"",
            "variable `task`: is a tunable input clock, which must have supportsFraction=\"true\" and `resolution`, because it has `intervalCounter`",
            "2.4.4",
        ),
        (
            " resolution=\"3\"",
            "",
            "variable `task`: is a tunable input clock, which must have supportsFraction=\"true\" and `resolution`, because it has `intervalCounter`",
            "2.4.4",
        ),
        (
            "shiftCounter=\"0\"",
            "shiftCounter=\"0.5\"",
            "variable `task`: is a tunable input clock, which must have a whole number from 0 as `shiftCounter`, got 0.5",
            "2.4.4",
        ),
        (
            " intervalDecimal=\"0.333333333\" supportsFraction=\"true\" resolution=\"3\" intervalCounter=\"1\"",
            " supportsFraction=\"true\" resolution=\"3\" intervalCounter=\"0\"",
            "variable `task`: is a tunable input clock, which must have a whole number above 0 as `intervalCounter`, got 0",
            "2.4.4",
        ),
        (
            "intervalCounter=\"1\"",
            "intervalCounter=\"2\"",
            "variable `task`: is a tunable input clock, which must have one interval, got 0.333333333 s and 2 / 3 s",
            "2.4.4",
        ),
    ]);
}

#[test]
fn attributes_of_clocks() {
    let inner = "name=\"inner\"";
    violations(&[
        ("hasEventMode=\"true\"", "", "hasEventMode: must be true, because the FMU has clocks, got false", "4.4"),
        (
            " priority=\"3\"",
            "",
            "variable `later`: is a countdown input clock, which must have a `priority` for scheduled execution",
            "2.4.4",
        ),
        (
            " priority=\"1\"",
            "",
            "variable `control`: is a constant input clock, which must have a `priority` for scheduled execution",
            "2.4.4",
        ),
        (
            "priority=\"3\"",
            "priority=\"-3\"",
            "variable `later`: is a countdown input clock, which must have a whole number from 0 as `priority`, got -3",
            "2.4.4",
        ),
        (
            "name=\"fired\"",
            "name=\"fired\" priority=\"1\"",
            "variable `fired`: is a triggered output clock, which must not have a `priority`",
            "2.4.4",
        ),
        (
            inner,
            &format!("{inner} causality=\"parameter\""),
            "variable `inner`: is a triggered parameter clock, which must be an input, an output or local",
            "2.4.7.4",
        ),
        (
            inner,
            &format!("{inner} variability=\"tunable\""),
            "variable `inner`: is a triggered local clock, which must be discrete, got variability=\"tunable\"",
            "2.4.7.4",
        ),
        (
            "<Output valueReference=\"4\" dependencies=\"1 3\"/>",
            "",
            "variable `fired`: is an output, so it must be listed in Output",
            "2.4.8",
        ),
        (
            "<Output valueReference=\"4\"",
            "<Output valueReference=\"5\"/><Output valueReference=\"4\"",
            "variable `inner`: is not an output, so it must not be listed in Output",
            "2.4.8",
        ),
        (
            "<Output valueReference=\"4\"",
            "<Output valueReference=\"4\"/><Output valueReference=\"4\"",
            "variable `fired`: is listed twice in Output",
            "2.4.8",
        ),
        (inner, &format!("{inner} start=\"true\""), "<Clock>, line 17: FMI 3.0 has no attribute `start` here", ""),
        (inner, &format!("{inner} initial=\"exact\""), "<Clock>, line 17: FMI 3.0 has no attribute `initial` here", ""),
        (inner, &format!("{inner} previous=\"4\""), "<Clock>, line 17: FMI 3.0 has no attribute `previous` here", ""),
        (
            inner,
            &format!("{inner} intermediateUpdate=\"false\""),
            "<Clock>, line 17: FMI 3.0 has no attribute `intermediateUpdate` here",
            "",
        ),
        (
            "<Alias name=\"same\"/>",
            "<Dimension start=\"2\"/>",
            "<Clock>, line 18: FMI 3.0 has no element <Dimension> here",
            "",
        ),
    ]);
    let without = SOUND.replace("<ScheduledExecution modelIdentifier=\"Rules\"/>", "").replace("priority=\"3\"", "");
    assert_eq!(findings(&without), [""; 0], "other interfaces need no priority");
}

#[test]
fn clocked_variables() {
    violations(&[
        (
            "clocks=\"1 3\"",
            "clocks=\"1 12\"",
            "variable `fired`: has variable `before` in `clocks`, which is not a Clock",
            "2.4.7.4",
        ),
        (
            "clocks=\"1 3\"",
            "clocks=\"1 999\"",
            "variable `fired`: has value reference 999 in `clocks`, which is not a Clock",
            "2.4.7.4",
        ),
        (
            "clocks=\"1 3\"",
            "clocks=\"\"",
            "variable `fired`: `clocks` is empty; leave it out, or add the value reference of a clock",
            "2.4.7.4",
        ),
        (
            "intermediateUpdate=\"true\"",
            "clocks=\"1\"",
            "variable `height`: has clocks, so it must be discrete or tunable, got Continuous",
            "2.4.7.4",
        ),
        (
            "name=\"p\"",
            "name=\"p\" clocks=\"1\"",
            "variable `p`: has clocks, so it must be discrete or tunable, got Fixed",
            "2.4.7.4",
        ),
        (
            "name=\"two\"",
            "name=\"two\" clocks=\"1\"",
            "variable `two`: has clocks, so it must be discrete or tunable, got Constant",
            "2.4.7.4",
        ),
        (
            "name=\"p\"",
            "name=\"p\" intermediateUpdate=\"true\"",
            "variable `p`: has intermediateUpdate=\"true\", which needs a continuous variable, got Fixed",
            "2.4.7.4",
        ),
        (
            "name=\"command\"",
            "name=\"command\" intermediateUpdate=\"1\"",
            "variable `command`: has intermediateUpdate=\"true\", which needs a continuous variable, got Discrete",
            "2.4.7.4",
        ),
    ]);
}

#[test]
fn clocked_states() {
    let entry = "<ClockedState valueReference=\"11\" dependencies=\"12\"/>";
    let (twice, and_clock, and_none) = (
        entry.repeat(2),
        format!("{entry}<ClockedState valueReference=\"5\"/>"),
        format!("{entry}<ClockedState valueReference=\"99\"/>"),
    );
    violations(&[
        (
            " previous=\"12\"",
            "",
            "variable `sum`: is a clocked state, which must have the attribute `previous`",
            "2.4.8",
        ),
        (entry, "", "variable `sum`: is a clocked state, which must be listed in ClockedState", "2.4.8"),
        (entry, &twice, "variable `sum`: is listed twice in ClockedState", "2.4.8"),
        (entry, &and_clock, "variable `inner`: is a Clock, which cannot be listed in ClockedState", "2.4.8"),
        (entry, &and_none, "value reference 99: is listed in ClockedState, but belongs to no variable", "2.4.8"),
        (
            "clocks=\"2\" previous=\"14\"",
            "previous=\"14\"",
            "variable `count`: is a clocked state, which must have the attribute `clocks`",
            "2.4.8",
        ),
        (
            "variability=\"discrete\" clocks=\"1\" previous=\"12\"",
            "variability=\"tunable\" clocks=\"1\" previous=\"12\"",
            "variable `sum`: is a clocked state, which must be discrete, got Tunable",
            "2.4.8",
        ),
        (
            "previous=\"12\"",
            "previous=\"11\"",
            "variable `sum`: is a clocked state, which must have the value reference of another variable as `previous`, got 11",
            "2.4.7.4",
        ),
        (
            "previous=\"12\"",
            "previous=\"5\"",
            "variable `sum`: is a clocked state, which must have the value reference of another variable as `previous`, got 5",
            "2.4.7.4",
        ),
        (
            "<Int32 name=\"former\"",
            "<Int16 name=\"former\"",
            "variable `count`: is a clocked state, which must have a previous value of its type Int32, got `former` of type Int16",
            "2.4.7.4",
        ),
        (
            "<Float64 name=\"before\" valueReference=\"12\" variability=\"discrete\" initial=\"exact\" start=\"0\"/>",
            "<Float64 name=\"before\" valueReference=\"12\"/>",
            "variable `sum`: is a clocked state, which must have a discrete previous value, got `before`, which is Continuous",
            "2.4.7.4",
        ),
        (
            "<Float64 name=\"before\" valueReference=\"12\" variability=\"discrete\" initial=\"exact\" start=\"0\"/>",
            "<Float64 name=\"before\" valueReference=\"12\" causality=\"input\" variability=\"discrete\" start=\"0\"/>",
            "variable `sum`: is a clocked state, which must have a previous value that is not an input, got `before`",
            "2.4.7.4",
        ),
        (
            "<Int32 name=\"count\" valueReference=\"13\" variability=\"discrete\" clocks=\"2\" previous=\"14\"",
            "<Float64 name=\"count\" valueReference=\"13\" variability=\"discrete\" clocks=\"2\" previous=\"12\"",
            "variable `count`: is a clocked state, which must have a previous value of its own, got `before`, as has `sum`",
            "2.4.7.4",
        ),
    ]);
}

#[test]
fn arrays() {
    violations(&[
        (
            "<UInt64 name=\"n\"",
            "<Int32 name=\"n\"",
            "variable `n`: is the length of an array, so it must be a UInt64, got Int32",
            "2.4.7.2",
        ),
        (
            "<UInt64 name=\"two\"",
            "<UInt8 name=\"two\"",
            "variable `two`: is the length of an array, so it must be a UInt64, got UInt8",
            "2.4.7.2",
        ),
        (
            "start=\"3\" min=\"0\"",
            "start=\"0\" min=\"0\"",
            "variable `n`: is the length of an array, so its start value must be above 0, got 0; `min` may be 0",
            "2.4.7.4",
        ),
        (
            "start=\"1 2 3 4\"><Dimension start=\"4\"/>",
            "start=\"1\"><Dimension start=\"0\"/>",
            "variable `v`: a dimension has start=\"0\", but must be above 0",
            "2.4.7.2",
        ),
        (
            "<Dimension valueReference=\"20\"/>",
            "<Dimension valueReference=\"20\" start=\"3\"/>",
            "variable `u`: a dimension must have one of the attributes `start` and `valueReference`, got both",
            "2.4.7.2",
        ),
        (
            "start=\"true\"/>",
            "start=\"true\"><Dimension start=\"1\"/></Boolean>",
            "variable `option`: is a structural parameter, which must be a scalar",
            "2.4.7.4",
        ),
        (
            "variability=\"tunable\" start=\"3\"",
            "variability=\"discrete\" start=\"3\"",
            "variable `n`: causality StructuralParameter and variability Discrete do not go together",
            "",
        ),
    ]);
}

/// Units, limits and `initial` (FMI 3.0.2, section 2.4.7.5).
#[test]
fn other_attributes() {
    violations(&[
        (
            "name=\"high\" displayUnit=\"ft\"",
            "name=\"high\" displayUnit=\"yd\"",
            "variable `high`: its display unit `yd` is not one of the unit `m`",
            "",
        ),
        (
            "displayUnit=\"1/m\"",
            "displayUnit=\"1/ft\"",
            "variable `height`: its display unit `1/ft` is not one of the unit `m`",
            "",
        ),
        ("name=\"p\"", "name=\"p\" displayUnit=\"ft\"", "variable `p`: has the display unit `ft`, but no unit", ""),
        ("max=\"1\"", "max=\"-1\"", "variable `p`: min 0 is above max -1", ""),
        ("max=\"1\"", "max=\"0.25\"", "variable `p`: its start value 0.5 is outside of its limits, 0 to 0.25", ""),
        ("\"666f\"", "\"666f6f\"", "variable `image`: its start value has 3 bytes, but its `maxSize` is 2", ""),
        (
            "causality=\"independent\"",
            "causality=\"independent\" initial=\"calculated\"",
            "variable `time`: causality Independent, variability Continuous and initial Calculated do not go together",
            "",
        ),
        (
            "name=\"two\"",
            "name=\"two\" initial=\"approx\"",
            "variable `two`: causality Local, variability Constant and initial Approx do not go together",
            "",
        ),
        (
            "\"tunable\" start=\"3\"",
            "\"tunable\" initial=\"approx\" start=\"3\"",
            "variable `n`: causality StructuralParameter, variability Tunable and initial Approx do not go together",
            "",
        ),
        (
            "<UInt64 name=\"two\"",
            "<UInt64 name=\"one\" valueReference=\"40\" variability=\"fixed\" initial=\"exact\" start=\"1\"/><UInt64 name=\"two\"",
            "variable `one`: causality Local, variability Fixed and initial Exact do not go together",
            "",
        ),
    ]);
}

/// Descriptions that contradict themselves cannot be read.
#[test]
fn unusable_descriptions() {
    for (from, to, expected) in [
        ("start=\"1 2 3 4\"", "start=\"1 2 3\"", "variable `v` has 3 start values, but 4 elements"),
        ("start=\"1 2 3 4\"", "start=\"1 2 3 4 5\"", "variable `v` has 5 start values, but 4 elements"),
        (
            "<Dimension start=\"4\"/>",
            "<Dimension/>",
            "<Dimension> must have one of the attributes `start` and `valueReference`",
        ),
        (
            "<Dimension start=\"4\"/>",
            "<Dimension valueReference=\"26\"/>",
            "<Dimension> refers to the value reference 26, which is not a structural parameter or constant",
        ),
        (
            "<Dimension start=\"4\"/>",
            "<Dimension valueReference=\"99\"/>",
            "<Dimension> refers to the value reference 99, which no variable has",
        ),
        ("name=\"high\"", "name=\"height\"", "variable `height` is declared twice"),
        ("name=\"same\"", "name=\"p\"", "variable `p` is declared twice"),
        ("\"666f\"", "\"666g\"", "a start value of `image` is not a list of hexadecimal digits in pairs"),
        ("\"666f\"", "\"666\"", "a start value of `image` is not a list of hexadecimal digits in pairs"),
        ("clocks=\"1 3\"", "clocks=\"1,3\"", "<Clock> has clocks=\"1,3\", which is not a list of value references"),
        ("declaredType=\"Periodic\"", "declaredType=\"None\"", "variable `control`: type `None` is not defined"),
    ] {
        assert!(SOUND.contains(from), "not in the description: {from}");
        let found = findings(&SOUND.replacen(from, to, 1));
        let is_expected = found[0].starts_with("error: modelDescription.xml: line ") && found[0].ends_with(expected);
        assert!(is_expected && found.len() == 1, "{to}: {found:?}");
    }
}
