//! Several workers that execute runs.

use super::JOB;
use super::protocol::{Request, Response};
use crate::failure::{Failure, FailureKind};
use crate::fmus::Fmus;
use crate::results::Part;
use crate::run::{Component, Recording, Run, Simulation};
use fmu_import::fmu::Binary;
use fmu_import::worker::{Ended, Incident, Process, Settings, Watch};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{SendError, SyncSender, sync_channel};
use std::sync::{Mutex, PoisonError};

/// Workers that execute runs, each at most one at a time. They are started when they are needed and stay until the pool
/// is dropped, with the libraries they have loaded. Every run has its own instances, so the results do not depend on
/// the number of workers.
#[derive(Debug)]
pub struct Pool {
    settings: Settings,
    job: &'static str,
    fmus: Fmus,
    needs_python: bool,
    pace: Option<f64>,
    workers: Vec<Mutex<Option<Process>>>,
}

/// A run, and the destination of its signals.
#[derive(Debug)]
pub struct Task {
    /// The run.
    pub run: Run,
    /// Names of its columns, and absolute path of the file to write them to; `None` to return the signals.
    pub csv: Option<(Vec<String>, PathBuf)>,
}

/// Receives the index of a task and its outcome. If the rows were written to a file, the recording in the outcome, also
/// in a failure, contains only the time of the last row.
pub type Finish<'a> = &'a (dyn Fn(usize, Result<Recording, Failure>) + Sync);

/// A run whose file is written, but not published.
struct Written {
    index: usize,
    run: String,
    part: Part,
    outcome: Result<Recording, Failure>,
}

impl Written {
    fn publish(self, finish: Finish<'_>) {
        let outcome = match self.part.publish() {
            Ok(()) => self.outcome,
            Err(error) => Err(Failure::new(&self.run, error.to_string())),
        };
        finish(self.index, outcome);
    }
}

impl Pool {
    /// A pool of `jobs` workers for runs of some FMUs, which need not be loaded in this process.
    pub fn new(settings: Settings, jobs: NonZeroUsize, fmus: &Fmus) -> Self {
        let needs_python = settings.libpython.is_some() && fmus.iter().any(|fmu| fmu.binary().needs_python());
        let workers = std::iter::repeat_with(Mutex::default).take(jobs.get()).collect();
        Self { settings, job: JOB, fmus: fmus.clone(), needs_python, pace: None, workers }
    }

    /// Changes the job of the workers. Workers with the new job must respond to the same requests.
    #[must_use]
    pub fn with_job(self, job: &'static str) -> Self {
        Self { job, ..self }
    }

    /// Executes a run in real time: simulated time advances `factor` times as fast as the clock. SIGTSTP pauses it.
    #[must_use]
    pub fn in_real_time(self, factor: Option<f64>) -> Self {
        Self { pace: factor, ..self }
    }

    /// Loads all FMUs in one worker, as a check.
    ///
    /// # Errors
    /// An FMU cannot be loaded; the message contains the reason.
    pub fn load(&self) -> Result<(), String> {
        let Some(slot) = self.workers.first() else { return Ok(()) };
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        let worker = self.worker(&mut slot)?;
        worker.send(&Request::Load, &[]);
        match worker.receive(&mut Watch::new(self.settings.timeout), &mut |_| ()) {
            Ok(Response::Failed { failure, .. }) => Err(failure.message),
            Ok(_) => Ok(()),
            Err(Ended { component, message, .. }) => {
                *slot = None;
                let fmu = component.and_then(|index| self.fmus.iter().nth(index));
                Err(fmu.map_or(String::new(), |fmu| format!("{}: ", fmu.path().display())) + &message)
            }
        }
    }

    /// Executes `count` tasks, each made by `task` when a worker is free for it. `progress` is called from time to time
    /// with the number of steps since the previous call.
    pub fn execute(
        &self,
        simulation: &Simulation,
        count: usize,
        task: &(dyn Fn(usize) -> Result<Task, Failure> + Sync),
        progress: &(dyn Fn(u64) + Sync),
        finish: Finish<'_>,
    ) {
        let next = AtomicUsize::new(0);
        let work = |slot: &Mutex<Option<Process>>, written: SyncSender<Written>| {
            let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
            loop {
                let index = next.fetch_add(1, Ordering::Relaxed);
                if index >= count {
                    return;
                }
                let mut done = 0;
                let mut steps = |steps: u64| {
                    progress(steps.saturating_sub(done));
                    done = done.max(steps);
                };
                let (run, part, outcome) = match task(index) {
                    Err(failure) => (String::new(), None, Err(failure)),
                    Ok(Task { run, csv }) => {
                        let id = run.id.clone();
                        let csv = csv.map(|(names, path)| (names, Part::of(&path)));
                        let part = csv.as_ref().map(|(_, part)| part.clone());
                        (id, part, self.run_or_repeat(&mut slot, simulation, run, csv, &mut steps))
                    }
                };
                steps(simulation.steps);
                let has_rows = outcome.as_ref().map_or_else(|failure| failure.recorded.is_some(), |_| true);
                match part {
                    Some(part) if has_rows => {
                        // There is no receiver if the publishing thread could not be started.
                        if let Err(SendError(file)) = written.send(Written { index, run, part, outcome }) {
                            file.publish(finish);
                        }
                    }
                    // Remove what the process may have left of the file.
                    unused => {
                        unused.iter().for_each(Part::remove);
                        finish(index, outcome);
                    }
                }
            }
        };
        std::thread::scope(|scope| {
            // A separate thread waits for the disk, while the worker executes the next run. At most as many files wait
            // as there are workers.
            let (written, files) = sync_channel::<Written>(self.workers.len());
            let _ = std::thread::Builder::new()
                .spawn_scoped(scope, move || files.into_iter().for_each(|file| file.publish(finish)));
            // This thread executes runs too, in case no other thread can be started.
            let Some((first, others)) = self.workers.split_first() else { return };
            for slot in others.iter().take(count.saturating_sub(1)) {
                let (work, written) = (&work, written.clone());
                let _ = std::thread::Builder::new().spawn_scoped(scope, move || work(slot, written));
            }
            work(first, written);
        });
    }

    fn worker<'a>(&self, slot: &'a mut Option<Process>) -> Result<&'a mut Process, String> {
        if slot.is_none() {
            let mut worker = Process::start(&self.settings, self.job, self.needs_python)
                .map_err(|error| format!("cannot start a worker process: {error}"))?;
            let binaries: Vec<Binary> = self.fmus.iter().map(|fmu| fmu.binary().clone()).collect();
            worker.send(&Request::Fmus(binaries), &[]);
            *slot = Some(worker);
        }
        slot.as_mut().ok_or_else(String::new)
    }

    /// Executes a run. If the worker process ends, the recorded rows are lost. If they were for a file, the run is then
    /// repeated up to the failure, with the same calls.
    fn run_or_repeat(
        &self,
        slot: &mut Option<Process>,
        simulation: &Simulation,
        run: Run,
        csv: Option<(Vec<String>, Part)>,
        steps: &mut dyn FnMut(u64),
    ) -> Result<Recording, Failure> {
        let again = csv.is_some().then(|| run.clone());
        self.run(slot, simulation, run, csv.clone(), false, steps).map_err(|failure| {
            let (Some(run), FailureKind::Crashed | FailureKind::TimedOut, Some(time)) =
                (again, failure.kind, failure.time)
            else {
                return failure;
            };
            let done = ((time - simulation.start) / simulation.step).round() as u64;
            let until = Simulation { steps: done.min(simulation.steps), ..*simulation };
            // The instances are not terminated: termination may have crashed, and an FMU may reject it before the stop
            // time.
            let repeated = self.run(slot, &until, run, csv, true, steps);
            // The process still contains the instances.
            *slot = None;
            let recorded = repeated.map_or_else(|failure| failure.recorded, |recording| Some(Box::new(recording)));
            Failure { recorded, ..failure }
        })
    }

    fn run(
        &self,
        slot: &mut Option<Process>,
        simulation: &Simulation,
        run: Run,
        csv: Option<(Vec<String>, Part)>,
        is_repeated: bool,
        steps: &mut dyn FnMut(u64),
    ) -> Result<Recording, Failure> {
        let id = run.id.clone();
        let failed = |message| Failure::new(&id, message);
        let components: Vec<(String, String)> =
            run.components.iter().map(|Component { name, fmu, .. }| (name.clone(), fmu.clone())).collect();
        let worker = self.worker(slot).map_err(failed)?;
        let pace = self.pace.filter(|_| !is_repeated);
        #[cfg(unix)]
        if pace.is_some() {
            worker.pause_on_stop().map_err(|error| failed(error.to_string()))?;
        }
        let (request, body) = Request::run(simulation, run, csv, is_repeated, pace);
        worker.send(&request, &body);
        drop(body);
        let received = worker.receive(&mut Watch::new(self.settings.timeout), steps);
        let component = |index: Option<usize>| index.and_then(|index| components.get(index));
        let place =
            |index: Option<usize>| component(index).map_or(String::new(), |(name, fmu)| format!("`{name}` ({fmu}): "));
        for incident in worker.incidents() {
            let index = if let Incident::Denied { component, .. } = incident { component } else { None };
            (self.settings.noticed)(&format!("{}{incident}", place(index)));
        }
        let response = match received {
            Ok(answer) => answer,
            Err(Ended { time, component: index, message, is_timeout }) => {
                *slot = None;
                let component = component(index).map(|(name, _)| name.clone());
                let kind = if is_timeout { FailureKind::TimedOut } else { FailureKind::Crashed };
                return Err(Failure { time, component, kind, ..failed(place(index) + &message) });
            }
        };
        let unexpected = |slot: &mut Option<Process>| {
            *slot = None;
            failed("the worker process sent an unexpected response".to_owned())
        };
        match response {
            Response::Recorded(header) => header.recording(worker.body()).map_err(|_| unexpected(slot)),
            Response::Failed { failure, rows } => {
                let recorded = rows.map(|header| header.recording(worker.body()).map(Box::new)).transpose();
                let recorded = recorded.map_err(|_| unexpected(slot))?;
                if failure.kind == FailureKind::Fatal {
                    // No instance of that FMU may be used again in this process.
                    *slot = None;
                }
                Err(Failure { run: id.clone(), recorded, ..failure })
            }
            Response::Done | Response::Steady(_) | Response::Warnings(_) => Err(unexpected(slot)),
        }
    }
}
