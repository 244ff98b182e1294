//! The parent's side of a worker.

use super::connection::{self, Connection};
use super::message::{self, Numbers, Reader};
use super::output::{Output, Printed};
use super::setup::{Incident, Incidents, Setup};
use crate::loader::calls::{self, Snapshot};
use crate::temporary::Folder;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::ffi::OsString;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Interval at which the call board of a worker is read.
const LOOK: Duration = Duration::from_millis(100);
/// Time limit for the start of a worker, independent of the timeout for a step.
const START: Duration = Duration::from_secs(60);
/// Time limit for the end of a worker after it has closed its connection.
const FAREWELL: Duration = Duration::from_secs(1);
/// Time limit for a supervisor to end the processes that its worker left behind.
#[cfg(target_os = "linux")]
const CLEARING: Duration = Duration::from_secs(6);

/// Command line of a worker: the program, and the arguments that make it a worker. Two arguments are appended: the job
/// (such as `fmu_linear::worker::JOB`), and the path of the call board.
#[derive(Debug, Clone)]
pub struct Launch {
    /// The program.
    pub program: PathBuf,
    /// The arguments.
    pub arguments: Vec<OsString>,
}

/// Settings of workers.
#[derive(Clone)]
pub struct Settings {
    /// Command line.
    pub launch: Launch,
    /// Time limit for a step in a run, or for a trial in a check.
    pub timeout: Duration,
    /// The Python library, for FMUs that need one.
    pub libpython: Option<PathBuf>,
    /// Receives the lines that FMUs print.
    pub printed: Printed,
    /// Folders to which FMUs in a sandbox may write, in addition to the worker's temporary folder; `None` for no
    /// sandbox. Systems other than Linux have no sandbox.
    pub sandbox: Option<Vec<PathBuf>>,
    /// Memory limit for each process of a worker (`RLIMIT_DATA`), bytes. Ignored on systems other than Linux.
    pub memory: Option<u64>,
    /// Receives incidents, unless [`Process::incidents`] has returned them.
    pub noticed: Printed,
}

impl Settings {
    /// Workers without a sandbox, a memory limit or a Python library. Their incidents are discarded.
    pub fn new(launch: Launch, timeout: Duration, printed: Printed) -> Self {
        let noticed: Printed = Arc::new(|_| ());
        Self { launch, timeout, libpython: None, printed, sandbox: None, memory: None, noticed }
    }
}

impl std::fmt::Debug for Settings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Settings").field("launch", &self.launch).field("timeout", &self.timeout).finish_non_exhaustive()
    }
}

/// A running worker; ended when dropped.
pub struct Process {
    child: Child,
    connection: Connection,
    reader: Reader,
    board: File,
    incidents: Incidents,
    noticed: Printed,
    output: Output,
    // Contains the call board and the temporary files of FMUs.
    folder: Folder,
}

/// A worker that ended before it responded.
#[derive(Debug)]
pub struct Ended {
    /// Start of the present step, s.
    pub time: Option<f64>,
    /// Index of the component that was executing.
    pub component: Option<usize>,
    /// Description of the end and of the present call.
    pub message: String,
    /// True if the worker was ended because it took too long.
    pub is_timeout: bool,
}

/// Stopwatch with a timeout.
#[derive(Debug)]
pub struct Watch {
    timeout: Duration,
    since: Instant,
    pulse: Option<u64>,
    /// True if progress restarts the stopwatch.
    is_per_step: bool,
}

impl Watch {
    /// A stopwatch that limits the time of each step.
    pub fn new(timeout: Duration) -> Self {
        Self { timeout, since: Instant::now(), pulse: None, is_per_step: true }
    }

    /// A stopwatch that limits the time of all steps together.
    pub fn of_all(timeout: Duration) -> Self {
        Self { is_per_step: false, ..Self::new(timeout) }
    }

    /// Restarts the stopwatch.
    pub fn restart(&mut self) {
        self.since = Instant::now();
    }

    fn is_over(&mut self, pulse: u64) -> bool {
        if self.pulse.replace(pulse) != Some(pulse) && self.is_per_step {
            self.restart();
        }
        let limit = if pulse == 0 { self.timeout.max(START) } else { self.timeout };
        self.since.elapsed() > limit
    }
}

impl Process {
    /// Starts a worker for a job, with the Python library if requested.
    pub fn start(settings: &Settings, job: &str, with_python: bool) -> io::Result<Self> {
        Self::start_in(settings, job, with_python, None)
    }

    /// Like [`Self::start`]; `directory` is the name of a new working directory in the folder of the worker.
    pub fn start_in(settings: &Settings, job: &str, with_python: bool, directory: Option<&str>) -> io::Result<Self> {
        let folder = Folder::new()?;
        let path = folder.path().join("calls");
        let board = File::options().read(true).write(true).create_new(true).open(&path)?;
        calls::create(&board)?;
        let temporary = folder.path().join("temporary");
        std::fs::create_dir(&temporary)?;
        let directory = directory.map(|name| folder.path().join(name));
        directory.as_ref().map(std::fs::create_dir).transpose()?;
        let mut setup = Setup { writable: settings.sandbox.clone(), memory: settings.memory };
        setup.writable.iter_mut().for_each(|folders| folders.extend(directory.iter().chain([&temporary]).cloned()));
        let incidents = setup.write(&path)?;
        let (pipe, output) = io::pipe()?;
        let mut command = Command::new(&settings.launch.program);
        command.args(&settings.launch.arguments).arg(job).arg(path).stdout(output.try_clone()?).stderr(output);
        command.envs(["TMPDIR", "TMP", "TEMP"].map(|variable| (variable, &temporary)));
        if let Some(directory) = &directory {
            command.current_dir(directory);
        }
        // In a separate process group, a worker gets no signals from the keyboard, and signals to its group do not
        // reach this process.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        if let Some(library) = settings.libpython.as_ref().filter(|_| with_python) {
            let mut list = library.clone().into_os_string();
            if let Some(others) = std::env::var_os("LD_PRELOAD") {
                list.push(":");
                list.push(others);
            }
            command.env("LD_PRELOAD", list);
        }
        let (child, connection) = connection::spawn(command)?;
        connection.set_read_timeout(Some(LOOK.min(settings.timeout / 4)))?;
        let output = Output::read(pipe, settings.printed.clone())?;
        let noticed = settings.noticed.clone();
        Ok(Self { child, connection, reader: Reader::default(), board, incidents, noticed, output, folder })
    }

    /// The incidents since the last call.
    pub fn incidents(&mut self) -> Vec<Incident> {
        self.incidents.take()
    }

    /// Ends the worker and all processes that it left behind. Returns the remaining incidents.
    pub fn finish(&mut self) -> Vec<Incident> {
        self.kill();
        self.incidents()
    }

    /// The folder of the worker.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// From now on, SIGTSTP pauses a run in real time before it stops this process. SIGCONT lets both go on.
    #[cfg(unix)]
    pub fn pause_on_stop(&self) -> io::Result<()> {
        let board = self.board.try_clone()?;
        let mut signals = signal_hook::iterator::Signals::new([signal_hook::consts::SIGTSTP])?;
        let stop = move || {
            for signal in &mut signals {
                let _ = calls::pause(&board, true);
                let _ = signal_hook::low_level::emulate_default_handler(signal);
                let _ = calls::pause(&board, false);
            }
        };
        std::thread::Builder::new().name("stop".to_owned()).spawn(stop).map(drop)
    }

    /// Sends a request. A broken connection is reported by [`Self::receive`].
    pub fn send(&mut self, request: &impl Serialize, body: &[f64]) {
        let _ = message::write(&mut self.connection, request, &[body]);
    }

    /// Waits for a response, and regularly passes the number of completed steps to `steps`. Fails if the worker ends,
    /// or is ended because it takes too long.
    pub fn receive<R: DeserializeOwned>(&mut self, watch: &mut Watch, steps: &mut dyn FnMut(u64)) -> Result<R, Ended> {
        loop {
            match self.reader.read(&mut self.connection) {
                Ok(Some(response)) => return Ok(response),
                Err(error) if connection::is_patience_over(&error) => {
                    let Ok(snapshot) = Snapshot::read(&self.board) else { continue };
                    steps(snapshot.steps);
                    if watch.is_over(snapshot.pulse) {
                        self.kill();
                        let limit = watch.timeout.as_secs_f64();
                        let ended = self.ended(&format!("not done after {limit} s (--timeout), stopped"));
                        return Err(Ended { is_timeout: true, ..ended });
                    }
                    // The process is checked, too, because a program that the worker started can keep the connection
                    // open.
                    if let Ok(Some(status)) = self.child.try_wait() {
                        return Err(self.ended(&format!("the process ended ({})", words(status))));
                    }
                }
                broken => {
                    let how = match (self.wait(), broken) {
                        (Some(status), _) => format!("the process ended ({})", words(status)),
                        (None, Err(error)) => {
                            format!("the process was stopped because its messages cannot be read: {error};")
                        }
                        (None, Ok(_)) => "the process closed its connection and was stopped".to_owned(),
                    };
                    return Err(self.ended(&how));
                }
            }
        }
    }

    /// The numbers in the last response.
    pub fn body(&self) -> Numbers<'_> {
        self.reader.body()
    }

    /// Describes the end of the worker: `how`, followed by the call on the board.
    fn ended(&self, how: &str) -> Ended {
        let snapshot = Snapshot::read(&self.board).ok();
        let call = snapshot.and_then(|snapshot| snapshot.call);
        let message = match call {
            Some((_, "")) => format!("{how} while its library was loaded"),
            Some((_, function)) => format!("{how} during {function}"),
            None => format!("{how} outside of the FMUs"),
        };
        let time = snapshot.and_then(|snapshot| snapshot.time);
        Ended { time, component: call.map(|(index, _)| index), message, is_timeout: false }
    }

    /// Waits for a worker that has closed its connection. Returns its status, or `None` if the worker had to be killed.
    fn wait(&mut self) -> Option<ExitStatus> {
        let begin = Instant::now();
        while begin.elapsed() < FAREWELL {
            match self.child.try_wait() {
                Ok(None) => std::thread::sleep(Duration::from_millis(1)),
                Ok(status) => return status,
                Err(_) => break,
            }
        }
        self.kill();
        None
    }

    #[cfg(target_os = "linux")]
    fn kill(&mut self) {
        use rustix::process::{Pid, Signal, kill_process};
        if let Ok(None) = self.child.try_wait() {
            // The supervisor ends all other processes first. Its process ID is not reused until this process has waited
            // for it.
            let _ = kill_process(Pid::from_child(&self.child), Signal::TERM);
            let begin = Instant::now();
            let mut pause = Duration::from_micros(100);
            while begin.elapsed() < CLEARING && matches!(self.child.try_wait(), Ok(None)) {
                std::thread::sleep(pause);
                pause = (2 * pause).min(Duration::from_millis(5));
            }
        }
        self.kill_child();
    }

    #[cfg(all(unix, not(target_os = "linux")))]
    fn kill(&mut self) {
        use rustix::process::{Pid, Signal, kill_process_group};
        // The group ID is not reused while a process is in the group.
        let _ = kill_process_group(Pid::from_child(&self.child), Signal::KILL);
        self.kill_child();
    }

    #[cfg(not(unix))]
    fn kill(&mut self) {
        self.kill_child();
    }

    fn kill_child(&mut self) {
        // Fails if the process has already ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl std::fmt::Debug for Process {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Process").field("id", &self.child.id()).finish_non_exhaustive()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
        self.output.finish();
        for incident in self.incidents() {
            (self.noticed)(&incident.to_string());
        }
    }
}

fn words(status: ExitStatus) -> String {
    #[cfg(unix)]
    if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status) {
        let name = signal_hook::low_level::signal_name(signal).map_or(String::new(), |name| format!(", {name}"));
        return format!("signal {signal}{name}");
    }
    match status.code() {
        // On Windows, a crash has a negative exit code instead of a signal.
        Some(code) if code < 0 => format!("exit code {code:#x}"),
        Some(code) => format!("exit code {code}"),
        None => status.to_string(),
    }
}
