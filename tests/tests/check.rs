//! `cargo fmu check` has no findings in the library, and finds each of many defects.
//!
//! Reference: FMI 2.0.4, sections 2.2 and 4.3. The tests introduce each defect into a valid FMU.
#![cfg(unix)]

use fmu_check::{Event, Finding, Options, Severity, check};
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use tests::paths;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

fn findings(path: &Path) -> Vec<Finding> {
    let mut findings = Vec::new();
    check(path, &Options::default(), &mut |event| {
        if let Event::Found(finding) = event {
            findings.push(finding);
        }
    });
    findings
}

#[test]
fn the_library_is_clean() {
    for path in paths() {
        assert_eq!(findings(&path), [], "{}", path.display());
    }
}

/// An FMU whose files can be changed.
struct Patient {
    name: &'static str,
    files: Vec<(String, Vec<u8>)>,
}

impl Patient {
    fn new(name: &'static str) -> Self {
        let path = tests::folder().join(format!("{name}.fmu"));
        let mut zip = ZipArchive::new(File::open(&path).expect("the FMU is packed")).expect("an FMU is a zip file");
        let mut files = Vec::new();
        for i in 0..zip.len() {
            let mut entry = zip.by_index(i).expect("entries can be read");
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).expect("entries can be unpacked");
            files.push((entry.name().expect("names are UTF-8").into_owned(), bytes));
        }
        Self { name, files }
    }

    /// Replaces the first occurrence of a text in the description.
    #[track_caller]
    fn describe(mut self, from: &str, to: &str) -> Self {
        let (_, bytes) = &mut self.files[0];
        let text = String::from_utf8(std::mem::take(bytes)).expect("UTF-8");
        assert!(text.contains(from), "{} does not contain {from}", self.name);
        *bytes = text.replacen(from, to, 1).into_bytes();
        self
    }

    /// Replaces bytes in the binary by the same number of other bytes.
    #[track_caller]
    fn patch(mut self, from: &[u8], to: &[u8]) -> Self {
        assert_eq!(from.len(), to.len());
        let (_, bytes) = self.files.iter_mut().find(|(name, _)| name.starts_with("binaries/")).expect("a binary");
        let at = bytes.windows(from.len()).position(|window| window == from).expect("the bytes are in the binary");
        bytes[at..at + to.len()].copy_from_slice(to);
        self
    }

    fn findings(self) -> Vec<Finding> {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path: PathBuf = folder.path().join(format!("{}.fmu", self.name));
        let mut zip = ZipWriter::new(File::create(&path).expect("the folder can be written"));
        for (name, bytes) in self.files {
            zip.start_file(name, SimpleFileOptions::default()).expect("an entry");
            zip.write_all(&bytes).expect("an entry");
        }
        zip.finish().expect("the zip file is complete");
        findings(&path)
    }

    /// Checks that a finding with this severity contains `words`; returns all findings.
    #[track_caller]
    fn has(self, severity: Severity, words: &str) -> Vec<Finding> {
        let findings = self.findings();
        let found = findings.iter().any(|finding| finding.severity == severity && finding.to_string().contains(words));
        assert!(found, "expected \"{words}\" in {findings:#?}");
        findings
    }
}

/// The FMU YawRateReference, which has the kinds of variables that the defects need.
fn patient() -> Patient {
    Patient::new("YawRateReference")
}

#[test]
fn an_unchanged_copy_is_clean() {
    assert_eq!(patient().findings(), []);
    assert_eq!(Patient::new("RescueVehicle").findings(), []);
}

/// Defects in the description: text to replace, replacement, and the message.
const DEFECTS: &[(&str, &str, &str)] = &[
    // An input without a start value.
    (
        "causality=\"input\" variability=\"continuous\">\n      <Real unit=\"rad\" displayUnit=\"deg\" nominal=\"0.1\" start=\"0.0\"/>",
        "causality=\"input\" variability=\"continuous\">\n      <Real unit=\"rad\" displayUnit=\"deg\" nominal=\"0.1\"/>",
        "has no start value",
    ),
    ("name=\"vehicle.speed\"", "name=\"driver.steer\"", "is declared twice"),
    (
        "causality=\"input\" variability=\"continuous\"",
        "causality=\"input\" variability=\"continuous\" initial=\"exact\"",
        "may have none",
    ),
    ("<Real unit=\"rad\"", "<Real unit=\"grad\"", "its unit `grad` is not defined"),
    ("displayUnit=\"deg\"", "displayUnit=\"gon\"", "its display unit `gon`"),
    ("initial=\"exact\"", "initial=\"calculated\"", "causality Parameter, variability Fixed and initial Calculated"),
    ("variability=\"fixed\"", "variability=\"continuous\"", "Parameter and variability Continuous do not go together"),
    (
        "variability=\"discrete\" initial=\"exact\"",
        "variability=\"discrete\" initial=\"calculated\"",
        "has a start value, although it is calculated",
    ),
    ("valueReference=\"7\"", "valueReference=\"6\"", "setting one sets the other"),
    ("guid=\"{", "generationDateAndTime=\"yesterday\" guid=\"{", "not a date and time"),
    ("guid=\"{", "guid=\"{0", "; the library and modelDescription.xml do not belong together"),
    ("modelIdentifier=\"YawRateReference\"", "modelIdentifier=\"YawRate\"", "YawRate.so"),
    ("modelName=", "modelMaker=\"me\" modelName=", "no attribute `modelMaker`"),
    ("<LogCategories>", "<LogCategory/><LogCategories>", "no element <LogCategory>"),
    ("name=\"vehicle.speed\"", "name=\"vehicle speed\"", "structured naming convention"),
    ("startTime=\"0.0\"", "startTime=\"1000.0\"", "is not after startTime"),
    ("stepSize=\"", "stepSize=\"-", "stepSize -"),
    ("fmiVersion=\"2.0\"", "fmiVersion=\"2.0.4\"", "FMI version 2.0.4"),
    ("dependencies=\"\"", "dependencies=\"999\"", "names variable 999"),
    (
        "</ModelStructure>",
        "<InitialUnknowns><Unknown index=\"1\"/></InitialUnknowns></ModelStructure>",
        "where it does not belong",
    ),
];

#[test]
fn defects_of_a_description() {
    for (from, to, words) in DEFECTS {
        patient().describe(from, to).has(Severity::Error, words);
    }
    // This is allowed, but the two outputs are then the same variable.
    patient().describe("valueReference=\"9\"", "valueReference=\"8\"").has(Severity::Warning, "they can never differ");
}

#[test]
fn limits_and_start_values() {
    // The mass of the vehicle is at least 1 kg.
    let text = String::from_utf8(patient().files.swap_remove(0).1).expect("UTF-8");
    let limited = text
        .lines()
        .find(|line| line.contains(" min=\"1.0\"") && line.contains("start="))
        .expect("a limited parameter");
    let with = |to: &str| limited.replace(" min=\"1.0\"", to);
    patient().describe(limited, &with(" min=\"1e9\"")).has(Severity::Error, "outside of its limits");
    patient().describe(limited, &with(" min=\"5.0\" max=\"4.0\"")).has(Severity::Error, "is above max");
    patient()
        .describe(limited, &limited.replace("start=\"", "start=\"1"))
        .has(Severity::Error, "but the binary starts with");
}

#[test]
fn the_model_structure() {
    let rescue = || Patient::new("RescueVehicle");
    let text = String::from_utf8(rescue().files.swap_remove(0).1).expect("UTF-8");
    let section = |name: &str| {
        let (start, end) = (format!("<{name}>"), format!("</{name}>"));
        &text[text.find(&start).expect("the section")..text.find(&end).expect("its end") + end.len()]
    };
    let first = |section: &str| section.lines().find(|line| line.contains("<Unknown")).expect("an entry").to_owned();
    for name in ["Outputs", "InitialUnknowns"] {
        let entries = section(name);
        let entry = first(entries);
        let missing = format!("is not listed in ModelStructure/{name}");
        rescue().describe(entries, &entries.replacen(&entry, "", 1)).has(Severity::Error, &missing);
        let twice = format!("is listed twice in {name}");
        rescue()
            .describe(entries, &entries.replacen(&entry, &format!("{entry}{entry}"), 1))
            .has(Severity::Error, &twice);
    }
    rescue()
        .describe(section("InitialUnknowns"), "")
        .has(Severity::Error, "is not listed in ModelStructure/InitialUnknowns");

    // For an output that depends on inputs, an empty list of dependencies is wrong, and a missing list makes importers
    // assume all of them.
    let outputs = section("Outputs");
    let entry = outputs.lines().find(|line| line.contains("dependencies=\"") && !line.contains("dependencies=\"\""));
    let entry = entry.expect("an output that depends on something");
    let (before, rest) = entry.split_once("dependencies=\"").expect("dependencies");
    let (_, after) = rest.split_once('"').expect("their end");
    let none = outputs.replacen(entry, &format!("{before}dependencies=\"\"{after}"), 1);
    rescue().describe(outputs, &none).has(Severity::Error, "which is missing from its dependencies in Outputs");
    let open = outputs.replacen(entry, &format!("{before}{after}"), 1);
    rescue().describe(outputs, &open).has(Severity::Warning, "has no `dependencies`");
    // An output that is a state does not depend directly on inputs.
    let number = |name: &str| 1 + position(&text, name);
    let state = format!("<Unknown index=\"{}\" dependencies=\"", number("body.heave"));
    let with_input = format!("{state}{} ", number("steer.front"));
    let loops = outputs.replacen(&state, &with_input, 1);
    assert_ne!(loops, outputs);
    rescue().describe(outputs, &loops).has(Severity::Warning, "an algebraic loop that does not exist");
}

/// Position of a variable in the description's list.
fn position(text: &str, name: &str) -> usize {
    let variables = text.split("<ScalarVariable ").skip(1);
    let needle = format!("name=\"{name}\"");
    variables.take_while(|variable| !variable.starts_with(&needle)).count()
}

#[test]
fn defects_of_a_binary() {
    patient().patch(b"fmi2CancelStep\0", b"fmi2CancelStop\0").has(Severity::Error, "fmi2CancelStep: is not exported");
    patient().patch(b"fmi2DoStep\0", b"fmi2DoStop\0").has(Severity::Error, "fmi2DoStep: is not exported");
    let mut other = patient();
    for (name, _) in &mut other.files {
        *name = name.replace("binaries/linux64/", "binaries/linux32/");
    }
    other.has(Severity::Error, "linux32");
}

#[test]
fn files_that_are_no_fmu() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("Broken.fmu");
    assert!(findings(&path)[0].to_string().starts_with("error: archive: "), "missing");
    std::fs::write(&path, b"PK but no zip").expect("the folder can be written");
    assert!(findings(&path)[0].to_string().starts_with("error: archive: "), "no zip");
}
