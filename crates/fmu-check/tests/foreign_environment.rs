//! Messages that an FMU logs with an environment that is not the importer's. In a process of its own, because any instance
//! in the process may take such messages.
#![cfg(unix)]

#[path = "../../../tests/zoo/zoo.rs"]
mod zoo;

use fmu_check::{Event, Options, Topic, check};
use fmu_import::description::FmiVersion;
use fmu_import::fmu::Fmu;
use zoo::Zoo;

const VERSIONS: [FmiVersion; 2] = [FmiVersion::V2, FmiVersion::V3];

/// The pointer to the environment is only compared, never read, so it may be any number.
#[test]
fn messages_are_kept_and_reported() {
    for fmi in VERSIONS {
        for habit in ["stranger", "stranger_start"] {
            let zoo = Zoo { fmi, ..Zoo::new(habit) };
            let folder = tempfile::tempdir().unwrap();
            let path = zoo.pack(folder.path());
            let mut instance = Fmu::open(&path).unwrap().instantiate("one").unwrap();
            instance.setup_experiment(0.0, Some(1.0)).unwrap();
            instance.enter_initialization_mode().unwrap();
            instance.exit_initialization_mode().unwrap();
            instance.do_step(0.0, 0.01).unwrap();
            assert_eq!(instance.take_messages()[0].text, "an environment that is not the importer's", "{habit}");
            drop(instance);
            let mut findings = Vec::new();
            check(&path, &Options::default(), &mut |event| {
                if let Event::Found(finding) = event {
                    findings.push(finding);
                }
            });
            assert_eq!(findings.len(), 1, "{findings:#?}");
            let line = findings[0].to_string();
            assert!(line.starts_with("error: logger: was called with another environment"), "{line}");
            assert_eq!(findings[0].topic, Topic::Standard);
        }
    }
}
