//! Trial runs of a scenario's sources, in a process of their own, which an FMU may take down.

use crate::output::outln;
use crate::selection::Selection;
use host::plan::Plan;
use std::io::Read as _;
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

/// Starts the line with the warnings; an FMU may print lines of its own.
const MARK: &str = "cargo-fmu-trials ";
/// How long all trials of a scenario may take. Those of ours take a fraction of a second.
const TIMEOUT: Duration = Duration::from_secs(20);

/// Prints the warnings of all trials, for [`warnings`].
pub(crate) fn print(plan: &Plan) {
    let warnings = serde_json::to_string(&host::trial::warnings(plan)).expect("texts are plain data");
    outln!("\n{MARK}{warnings}");
}

/// The warnings that trial runs give. Trials that fail or take too long give none: nothing depends on them.
pub(crate) fn warnings(plan: &Plan, selection: &Selection) -> Vec<String> {
    if plan.trials.is_empty() { Vec::new() } else { run(selection).unwrap_or_default() }
}

fn run(selection: &Selection) -> Option<Vec<String>> {
    // What the process unpacks is removed even if it is killed.
    let temporary = host::temporary::Folder::new().ok()?;
    let mut child = Command::new(std::env::current_exe().ok()?)
        .args(["plan", "--trials"])
        .args(selection.arguments())
        .envs(["TMPDIR", "TMP", "TEMP"].map(|variable| (variable, temporary.path())))
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .ok()?;
    let mut output = child.stdout.take()?;
    let (sender, receiver) = mpsc::channel();
    std::thread::spawn(move || {
        let mut bytes = Vec::new();
        // Nobody waits any more after the timeout.
        let _ = output.read_to_end(&mut bytes).map(|_| sender.send(bytes));
    });
    let bytes = receiver.recv_timeout(TIMEOUT);
    if bytes.is_err() {
        child.kill().ok()?;
    }
    child.wait().ok()?;
    let text = String::from_utf8_lossy(&bytes.ok()?).into_owned();
    serde_json::from_str(text.lines().rev().find_map(|line| line.strip_prefix(MARK))?).ok()
}
