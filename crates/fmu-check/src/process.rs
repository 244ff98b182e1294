//! Finds changes that an FMU makes to the state of its process, which it shares with the master and other FMUs.

use super::{Event, Finding, Topic};
use fmu_import::loader::{locale, take_restored};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;

/// State of the process that the FMU and its importer share.
#[derive(Debug)]
pub(super) struct Process {
    trial: String,
    locale: String,
    umask: Option<String>,
    directory: Option<PathBuf>,
    environment: BTreeMap<OsString, OsString>,
}

impl Process {
    pub(super) fn new() -> Self {
        Self {
            trial: String::from("opening the file"),
            locale: locale(),
            umask: umask(),
            directory: std::env::current_dir().ok(),
            environment: std::env::vars_os().collect(),
        }
    }

    /// Changes made by the previous trial. `trial` is the next one.
    pub(super) fn changes(&mut self, trial: &str) -> Vec<Finding> {
        let next = Self { trial: trial.to_owned(), ..Self::new() };
        let mut changes = Vec::new();
        if next.locale != self.locale {
            changes.push(format!("changes the locale of its process from `{}` to `{}`", self.locale, next.locale));
        }
        if let (Some(before), Some(now)) = (&self.umask, &next.umask)
            && before != now
        {
            changes.push(format!("changes the umask of its process from {before} to {now}"));
        }
        if next.directory != self.directory {
            let now = next.directory.as_ref().map_or("one that is gone".to_owned(), |path| path.display().to_string());
            changes.push(format!("changes the working directory of its process to {now}"));
        }
        let names = self.environment.keys().chain(next.environment.keys());
        let mut names: Vec<_> =
            names.filter(|name| self.environment.get(*name) != next.environment.get(*name)).collect();
        names.sort();
        names.dedup();
        if !names.is_empty() {
            let names: Vec<_> = names.iter().map(|name| name.to_string_lossy()).collect();
            changes.push(format!("changes environment variables of its process: {}", names.join(", ")));
        }
        for (function, change) in take_restored() {
            changes.push(format!("{function} changes {change} of its process"));
        }
        let findings = changes.into_iter().map(|change| {
            Finding::warning(self.trial.clone(), format!("{change}, which the master and other FMUs share"))
                .about(Topic::Simulation)
        });
        let findings = findings.collect();
        *self = next;
        findings
    }

    /// Passes an event on; before a new trial, reports the changes that the previous one has made.
    pub(super) fn watch(&mut self, event: Event, report: &mut dyn FnMut(Event)) {
        if let Event::Trying { trial, .. } = &event {
            self.changes(trial).into_iter().for_each(|finding| report(Event::Found(finding)));
        }
        report(event);
    }
}

/// The umask of this process. Linux shows it, so it need not be changed to read it.
fn umask() -> Option<String> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    Some(status.lines().find_map(|line| line.strip_prefix("Umask:"))?.trim().to_owned())
}
