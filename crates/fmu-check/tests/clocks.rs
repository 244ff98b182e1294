//! `check` on an FMU with clocks, built from C, with one defect each. Reference: FMI 3.0.2, sections 2.2.8, 2.3.5 and
//! 5.2.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/decay.rs"]
mod decay;

use decay::Decay;
use fmu_check::{Checked, Event, Options, check};
use fmu_import::description::FmiVersion;

const CO_SIMULATION: &str = "  <CoSimulation modelIdentifier=\"Decay\" canHandleVariableCommunicationStepSize=\"true\" \
                             canGetAndSetFMUState=\"true\" hasEventMode=\"true\"/>\n";
const SCHEDULED: &str = "  <ScheduledExecution modelIdentifier=\"Decay\" canGetAndSetFMUState=\"true\"/>\n";

/// The scope of the check, and all findings as lines.
fn checked(defects: &[&str], edits: &[(&str, &str)]) -> (Checked, Vec<String>) {
    let folder = tempfile::tempdir().unwrap();
    let path = Decay { has_clocks: true, defects, edits, ..Decay::new(FmiVersion::V3) }.pack(folder.path());
    let (mut looked_at, mut lines) = (Checked::default(), Vec::new());
    check(&path, &Options::default(), &mut |event| match event {
        Event::Checked(so_far) => looked_at = so_far,
        Event::Found(finding) => lines.push(finding.to_string()),
        Event::Trying { .. } => (),
    });
    (looked_at, lines)
}

#[test]
fn a_sound_fmu_with_clocks_has_no_findings() {
    let (looked_at, lines) = checked(&[], &[]);
    assert_eq!(lines, [""; 0]);
    let text = looked_at.to_string();
    let scheduled = "\nscheduled execution: start values, runs, another start time, the default experiment, reset before \
                     initialization, reset after a run, two instances, saved states, dependencies at the start, \
                     dependencies between steps, clocks, the end of a run, stack";
    assert!(
        text.ends_with(scheduled) && text.contains("dependencies between steps, clocks, the end of a run"),
        "{text}"
    );
    for interface in [CO_SIMULATION, SCHEDULED] {
        let (looked_at, lines) = checked(&[], &[(interface, "")]);
        assert_eq!((lines, looked_at.trials.iter().any(|trial| trial.ends_with("clocks"))), (vec![], true));
    }
}

/// Each defect is found, in the interfaces that can have it.
#[test]
fn defects_of_clocks_are_found() {
    let [cs, se, both] = [SCHEDULED, CO_SIMULATION, ""];
    let forbidden = |what: &str| format!("the FMU accepts a call that {what}; it must return fmi3Error");
    for (defect, without, name, expected) in [
        // Intervals and shifts in Initialization Mode.
        (
            "INTERVAL=2",
            both,
            "every",
            "has the interval 2 s and the shift 0.25 s, which must be those in the description, 0.5 s and 0.25 s",
        ),
        (
            "INTERVAL=0",
            both,
            "every",
            "has the interval 0 s and the shift 0.25 s, which must be those in the description",
        ),
        (
            "SHIFT=0.5",
            both,
            "every",
            "has the interval 0.5 s and the shift 0.5 s, which must be those in the description, 0.5 s and 0.25 s",
        ),
        (
            "NO_INTERVAL",
            both,
            "every",
            "has no interval or shift in Initialization Mode: fmi3GetIntervalDecimal returned fmi3Error",
        ),
        // Qualifiers, by section 2.2.8.
        (
            "QUALIFIER=0",
            both,
            "every",
            "has an interval whose qualifier is 0 (not yet known), which only countdown clocks may have",
        ),
        ("QUALIFIER=7", both, "every", "has an interval whose qualifier is not 0, 1 or 2"),
        (
            "COUNTDOWN_UNCHANGED",
            both,
            "timer",
            "has an interval whose qualifier is 1 (unchanged), although no earlier interval is still valid",
        ),
        (
            "CHANGING_UNCHANGED",
            both,
            "varying",
            "has an interval whose qualifier is 1 (unchanged), although no earlier interval is still valid",
        ),
        // Deactivation.
        ("NOT_DEACTIVATED", cs, "timer", "has `canBeDeactivated`, but fmi3SetClock returned fmi3Error"),
        (
            "STAYS_ACTIVE",
            cs,
            "timer",
            "has an effect although it is deactivated before fmi3UpdateDiscreteStates; first `ticks`",
        ),
        ("DEACTIVATES_ALL", cs, "every", &forbidden("deactivates a clock without `canBeDeactivated`")),
        // Calls that the state does not allow.
        ("CLOCKS_IN_STEP", cs, "every", &forbidden("sets it in Step Mode")),
        ("GETS_ANY", cs, "every", &forbidden("gets `sum` while no clock is active")),
        ("SETS_ANY", cs, "every", &forbidden("sets `u` while no clock is active")),
        ("SETS_OUTPUT_CLOCK", cs, "third", &forbidden("activates an output clock")),
        (
            "SETS_INTERVALS",
            both,
            "every",
            &forbidden("sets the interval of a constant clock, which only the FMU determines"),
        ),
        (
            "SETS_INTERVALS",
            both,
            "timer",
            &forbidden("sets the interval of a countdown clock, which only the FMU determines"),
        ),
        (
            "SETS_INTERVALS",
            both,
            "varying",
            &forbidden("sets the interval of a changing clock, which only the FMU determines"),
        ),
        (
            "SETS_INTERVALS",
            both,
            "asked",
            &forbidden("sets the interval of a triggered clock, which only the FMU determines"),
        ),
        ("SCHEDULED_SET_CLOCK", se, "every", &forbidden("sets it in scheduled execution")),
        ("ACTIVATES_OUTPUTS", se, "third", &forbidden("activates an output clock")),
        ("SAME_TIME", se, "every", &forbidden("activates its partition a second time at one time")),
        ("EARLIER_TIME", se, "every", &forbidden("activates its partition at a time before its last tick")),
        // Callbacks.
        ("NO_CLOCK_UPDATE", se, "third", "ticks, but the FMU does not call clockUpdate (FMI 3.0.2, section 5.2.1)"),
        ("NO_CLOCK_UPDATE", se, "timer", "has a new interval, but the FMU does not call clockUpdate"),
        ("OTHER_ENVIRONMENT", se, "third", "ticks, but the FMU does not call clockUpdate"),
    ] {
        let interfaces: &[&str] = if without.is_empty() { &[CO_SIMULATION, SCHEDULED] } else { &[without] };
        for interface in interfaces {
            let lines = checked(&[defect], &[(interface, "")]).1;
            let expected = ["error", "warning"].map(|severity| format!("{severity}: clock `{name}`: {expected}"));
            let is_found = lines.iter().any(|line| expected.iter().any(|expected| line.starts_with(expected)));
            assert!(is_found, "{defect}: {expected:#?} {lines:#?}");
        }
    }
    for (defect, without, expected) in [
        ("NOT_DETERMINISTIC", cs, "error: clocks: give other results in another instance; first `"),
        (
            "NOT_DETERMINISTIC",
            se,
            "error: scheduled execution: clocks: give other results in another instance; first `",
        ),
        ("OTHER_TIMES", cs, "error: clocks: tick at other times, or in another order, in another instance"),
        (
            "OTHER_TIMES",
            se,
            "error: scheduled execution: clocks: tick at other times, or in another order, in another instance",
        ),
        (
            "FORGETS_EVENT",
            cs,
            "error: clocks: tick at other times, or in another order, if states are restored in events",
        ),
        (
            "LOCKED",
            se,
            "error: fmi3ActivateModelPartition: does not call lockPreemption and unlockPreemption equally often",
        ),
        // An interval of 0 again and again.
        ("ENDLESS", cs, "error: clocks: fmi3UpdateDiscreteStates: more than 100 event iterations at one time"),
        (
            "ENDLESS",
            se,
            "error: scheduled execution: runs: fmi3UpdateDiscreteStates: the clock `timer` is due twice at 1.25 s; start it with an interval above 0",
        ),
    ] {
        let lines = checked(&[defect], &[(without, "")]).1;
        assert!(lines.iter().any(|line| line.starts_with(expected)), "{defect}: {expected} {lines:#?}");
    }
}
