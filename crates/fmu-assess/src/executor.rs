//! Executes runs in worker processes, for several callers at once. The results that a caller gets depend only on the
//! caller's runs.

use crate::bench::Execute;
use fmu_import::worker::Settings;
use fmu_system::failure::Failure;
use fmu_system::fmus::Fmus;
use fmu_system::master::Recording;
use fmu_system::run::{Run, Simulation};
use fmu_system::worker::{Pool, Task};
use std::num::NonZeroUsize;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};

/// A run, and the channel for its outcome.
struct Work {
    index: usize,
    simulation: Simulation,
    run: Run,
    reply: Sender<(usize, Result<Recording, Failure>)>,
}

/// Starts `jobs` workers and calls `body`, which can execute runs from any thread. Calls `done` after each run.
pub(crate) fn with_workers<T>(
    settings: &Settings,
    jobs: NonZeroUsize,
    fmus: &Fmus,
    done: &(dyn Fn() + Sync),
    body: impl FnOnce(&Execute<'_>) -> T,
) -> T {
    let (queue, receiver) = channel::<Work>();
    let receiver = Mutex::new(receiver);
    std::thread::scope(|scope| {
        for _ in 0..jobs.get() {
            let receiver = &receiver;
            scope.spawn(move || {
                let pool = Pool::new(settings.clone(), NonZeroUsize::MIN, fmus);
                work(receiver, &pool, done);
            });
        }
        // The workers end when all senders are dropped.
        body(&move |runs| execute(&queue, runs))
    })
}

fn execute(queue: &Sender<Work>, runs: Vec<(Simulation, Run)>) -> Vec<Result<Recording, Failure>> {
    let (reply, outcomes) = channel();
    let lost = |run: &Run| Err(Failure::new(&run.id, "no process could execute it".to_owned()));
    let mut found: Vec<_> = runs.iter().map(|(_, run)| lost(run)).collect();
    for (index, (simulation, run)) in runs.into_iter().enumerate() {
        // The workers live as long as the queue, so sending does not fail.
        let _ = queue.send(Work { index, simulation, run, reply: reply.clone() });
    }
    drop(reply);
    for (index, outcome) in outcomes {
        found[index] = outcome;
    }
    found
}

fn work(receiver: &Mutex<Receiver<Work>>, pool: &Pool, done: &(dyn Fn() + Sync)) {
    loop {
        let next = receiver.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok(Work { index, simulation, run, reply }) = next else { return };
        let task = |_| Ok(Task { run: run.clone(), csv: None });
        let finish = |_: usize, outcome| {
            let _ = reply.send((index, outcome));
        };
        pool.execute(&simulation, 1, &task, &|_| (), &finish);
        done();
    }
}
