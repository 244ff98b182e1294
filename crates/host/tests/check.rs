//! `check` on FMUs built from C in a temporary folder: what ours never do.
#![cfg(unix)]

mod support;

use host::check::{Event, Severity, check};
use support::Build;

/// What is found about the behavior of the binary in runs.
fn found(build: &Build) -> Vec<(Severity, String)> {
    let folder = tempfile::tempdir().unwrap();
    let path = build.pack(folder.path());
    let mut found = Vec::new();
    check(&path, &mut |event| {
        if let Event::Found(finding) = event
            && ["runs", "fmi2DoStep", "saved states", "fmi2Reset"].contains(&finding.subject.as_str())
        {
            found.push((finding.severity, finding.message));
        }
    });
    found
}

/// FMI 2.0.4, section 4.2.2: fmi2Discard with fmi2Terminated is how an FMU ends the simulation, as Stair of the
/// Reference FMUs does. A step that is discarded otherwise is not what the description promises.
#[test]
fn an_fmu_may_end_the_simulation() {
    let build = |ends, flags| Build { ends, flags, ..Build::new("Ends", "u", "x") };
    let states = "canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\"";
    assert_eq!(found(&build(None, states)), []);
    // In the second half of the 80 steps of 0.01 s that one instance takes, and in the first.
    assert_eq!(found(&build(Some((0.5, true)), states)), []);
    assert_eq!(found(&build(Some((0.2, true)), states)), []);
    let discarded = found(&build(Some((0.5, false)), states));
    assert_eq!(discarded, [(Severity::Error, "fmi2DoStep returned fmi2Discard".to_owned())]);
    let early = "ends the simulation within 8 steps of 0.01 s, too early to be tried";
    assert_eq!(found(&build(Some((0.05, true)), states)), [(Severity::Warning, early.to_owned())]);
}
