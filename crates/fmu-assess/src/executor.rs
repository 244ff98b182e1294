//! Executes runs in worker processes, for several callers at once. The results that a caller gets depend only on the
//! caller's runs.

use crate::bench::Execute;
use fmu_import::worker::Settings;
use fmu_system::failure::Failure;
use fmu_system::fmus::Fmus;
use fmu_system::run::{Run, Simulation};
use fmu_system::worker::{Pool, Task};
use std::num::NonZeroUsize;
use std::panic::resume_unwind;
use std::sync::mpsc::channel;
use std::sync::{Mutex, PoisonError};

/// Starts `jobs` workers and calls `body`, which can execute runs from any thread. Calls `done` after each run.
pub(crate) fn with_workers<T>(
    settings: &Settings,
    jobs: NonZeroUsize,
    fmus: &Fmus,
    done: &(dyn Fn() + Sync),
    body: impl FnOnce(&Execute<'_>) -> T,
) -> T {
    let (give_back, free) = channel();
    for _ in 0..jobs.get() {
        // The receiver exists until the end.
        let _ = give_back.send(Pool::new(settings.clone(), NonZeroUsize::MIN, fmus));
    }
    let free = Mutex::new(free);
    let execute = |(simulation, run): (Simulation, Run)| {
        let outcome = Mutex::new(Err(Failure::new(&run.id, "no process could execute it".to_owned())));
        let worker = free.lock().unwrap_or_else(PoisonError::into_inner).recv();
        if let Ok(worker) = worker {
            let task = |_| Ok(Task { run: run.clone(), csv: None });
            let finish = |_, found| *outcome.lock().unwrap_or_else(PoisonError::into_inner) = found;
            worker.execute(&simulation, 1, &task, &|_| (), &finish);
            let _ = give_back.send(worker);
            done();
        }
        outcome.into_inner().unwrap_or_else(PoisonError::into_inner)
    };
    // Each run has a thread, which waits for a worker.
    body(&|runs| {
        std::thread::scope(|scope| {
            let running: Vec<_> = runs.into_iter().map(|run| scope.spawn(|| execute(run))).collect();
            running.into_iter().map(|run| run.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
        })
    })
}
