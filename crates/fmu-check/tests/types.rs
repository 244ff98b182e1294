//! `check` on the types of FMI 3.0, with an FMU built from C.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/arrays.rs"]
mod arrays;

use fmu_check::{Event, Options, Severity, check};
use std::collections::BTreeSet;

/// The errors and warnings.
fn findings(defects: &[&str]) -> BTreeSet<String> {
    let folder = tempfile::tempdir().unwrap();
    let mut lines = BTreeSet::new();
    check(&arrays::pack(folder.path(), defects), &Options::default(), &mut |event| {
        if let Event::Found(finding) = event
            && finding.severity != Severity::Note
        {
            lines.insert(finding.to_string());
        }
    });
    lines
}

/// Each defect is found, and a sound FMU has none of them.
#[test]
fn defects_of_types_and_arrays_are_found() {
    let sound = findings(&[]);
    for (defect, expected) in [
        // Row-major order (FMI 3.0.2, section 2.2.6.1).
        ("PLACE=(e%3*2+e/3)", "error: variable `m[1,2]`: is set to 2.004, but then has the value 4.016"),
        (
            "WIDTH(value)=(int32_t)(value)",
            "error: variable `s`: is set to -9223372036854775808, but then has the value 0",
        ),
        ("MOST=9", "warning: variable `x`: accepts 9 bytes, although its `maxSize` is 8"),
        // The importer may change the bytes after the call (FMI 3.0.2, section 2.2.6.2).
        ("KEEPS", "error: variable `x`: is set to 0x0102030405060708, but then has the value 0xeeeeeeeeeeeeeeee"),
    ] {
        let found = findings(&[defect]);
        assert!(sound.iter().all(|line| !line.contains("`m[1,2]`") && !line.contains("`x`")), "{sound:#?}");
        assert!(found.difference(&sound).any(|line| line.starts_with(expected)), "{defect}: {found:#?}");
    }
}
