//! The master: executes the runs of a plan from start to stop. It records the start and every n-th step of a
//! [`Session`], which makes the calls.

use crate::failure::{Failure, FailureKind};
use crate::fmus::Instances;
pub use crate::run::Recording;
use crate::run::{Component, Exact, RealTime, Run, Simulation};
use crate::session::Session;
use fmu_import::limits;
use fmu_import::loader::calls;
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

/// The columns of a run and the slots they record, in memory that is reserved before the first step. Only the bytes of
/// Binaries, whose number is unknown, need more memory during the run.
struct Recorder {
    time: Vec<f64>,
    columns: Vec<(usize, Vec<f64>)>,
    exact: BTreeMap<usize, Exact>,
}

impl Recorder {
    fn new(simulation: &Simulation, run: &Run, session: &Session) -> Self {
        let slots: Vec<usize> = run.columns.iter().copied().flatten().collect();
        // Plans stay within the limit. Beyond it, the columns grow without being reserved.
        let most = limits::RECORDED / (slots.len() as u64 + 1);
        let rows = usize::try_from((simulation.steps / simulation.every + 1).min(most)).unwrap_or(0);
        let columns = slots.into_iter().map(|slot| (slot, Vec::with_capacity(rows))).collect();
        Self {
            time: Vec::with_capacity(rows),
            columns,
            exact: session.exact_columns(rows, run.binary.unwrap_or_default()),
        }
    }

    fn push(&mut self, time: f64, session: &Session) {
        self.time.push(time);
        let bus = session.bus();
        for (slot, column) in &mut self.columns {
            column.push(bus[*slot]);
        }
        session.record_exact(&mut self.exact);
    }

    /// An error if the Binaries need more memory than a recording may have.
    fn check_memory(&self, run: &Run, time: f64) -> Result<(), Failure> {
        let bytes = |values: &Exact| match values {
            Exact::Binaries { values, .. } => values.memory() as u64,
            Exact::Integers(_) => 0,
        };
        let (bytes, limit) = (self.exact.values().map(bytes).sum::<u64>(), 8 * limits::RECORDED);
        if bytes <= limit {
            return Ok(());
        }
        let message = format!(
            "the recorded Binaries have {bytes} bytes, the limit is {limit}; record every n-th step only (`every` in \
             [record]) or fewer signals"
        );
        Err(Failure { time: Some(time), ..Failure::new(&run.id, message) })
    }

    fn finish(self, run: &Run) -> Recording {
        let mut recorded = self.columns.into_iter();
        let columns = run.columns.iter().map(|slot| slot.and_then(|_| recorded.next()).map(|(_, column)| column));
        let columns = columns.collect();
        Recording { time: self.time, columns, exact: self.exact, ..Recording::default() }
    }
}

/// A run in real time.
struct Pace {
    start: f64,
    began: Instant,
    report: RealTime,
}

impl Pace {
    /// Waits at the end of a step until it is its time. The sleeps are short, so that pauses are noticed, and the parent
    /// sees that the run goes on.
    fn wait(&mut self, time: f64) {
        const SLEEP: Duration = Duration::from_millis(20);
        let report = &mut self.report;
        let due = Duration::try_from_secs_f64((time - self.start) / report.factor).unwrap_or(Duration::MAX);
        let delay = self.began.elapsed().saturating_sub(due).as_secs_f64();
        report.late_steps += u64::from(delay > 0.0);
        report.largest_delay = report.largest_delay.max(delay);
        report.total_delay += delay;
        let board = calls::board();
        loop {
            let (now, is_paused) = (Instant::now(), board.is_some_and(calls::Board::is_paused));
            let left = due.saturating_sub(now - self.began);
            if left.is_zero() && !is_paused {
                return;
            }
            std::thread::sleep(if is_paused { SLEEP } else { left.min(SLEEP) });
            if is_paused {
                self.began += now.elapsed();
            }
            board.into_iter().for_each(calls::Board::pulse);
        }
    }
}

/// Executes a run in this process and returns its signals in memory.
///
/// # Errors
/// An FMU cannot be loaded or instantiated, a call returns more than `fmi2Warning`, a signal is not finite, or an FMU
/// ends the simulation before the stop time. The error contains the rows that were recorded before it.
pub fn execute(simulation: &Simulation, run: &Run, fmus: &dyn Instances) -> Result<Recording, Failure> {
    record(simulation, run, fmus, true, None)
}

/// Works like [`execute`]. Without `is_terminated`, the instances are neither terminated nor freed, because these calls
/// may have crashed or hung in an earlier attempt. The instances stay until the process ends. `pace` is the factor of a
/// run in real time.
pub(crate) fn record(
    simulation: &Simulation,
    run: &Run,
    fmus: &dyn Instances,
    is_terminated: bool,
    pace: Option<f64>,
) -> Result<Recording, Failure> {
    match attempt(simulation, run, fmus, is_terminated, pace, false) {
        Err(failure) if failure.kind == FailureKind::Discarded && can_retry(simulation, run, fmus) => {
            attempt(simulation, run, fmus, is_terminated, pace, true)
        }
        recorded => recorded,
    }
}

/// Returns true if all components can repeat a discarded step with shorter ones.
fn can_retry(simulation: &Simulation, run: &Run, fmus: &dyn Instances) -> bool {
    let can_repeat = |own: &Component| {
        let description = fmus.description(own);
        description.is_ok_and(|description| {
            let interface = description.interface(own.interface().unwrap_or(description.stepped_interface()));
            let has_both = interface.is_some_and(|interface| {
                let is_variable = interface.can_handle_variable_communication_step_size || own.integration.is_some();
                interface.can_get_and_set_fmu_state && is_variable
            });
            has_both && description.clocks.is_empty() && (own.is_discrete || (own.every, own.substeps) == (1, 1))
        })
    };
    simulation.error_control.is_none() && run.components.iter().all(can_repeat)
}

/// Executes a run. With `has_retry`, discarded steps are repeated with shorter ones.
fn attempt(
    simulation: &Simulation,
    run: &Run,
    fmus: &dyn Instances,
    is_terminated: bool,
    pace: Option<f64>,
    has_retry: bool,
) -> Result<Recording, Failure> {
    let began = Instant::now();
    let mut session = Session::new(simulation, run, fmus)?;
    if has_retry {
        session.retry_steps(run);
    }
    let mut recorder = Recorder::new(simulation, run, &session);
    recorder.push(simulation.start, &session);
    let report = |factor| RealTime { factor, ..RealTime::default() };
    let mut pace = pace.map(|factor| Pace { start: simulation.start, began: Instant::now(), report: report(factor) });
    let mut ended = Ok(());
    while ended.is_ok() && !session.is_over() {
        let before = session.steps();
        ended = session.step();
        let is_made = session.steps() > before && !matches!(&ended, Err(error) if error.kind == FailureKind::NotFinite);
        if is_made && session.steps() % simulation.every == 0 {
            recorder.push(session.time(), &session);
            ended = ended.and_then(|()| recorder.check_memory(run, session.time()));
        }
        if let Some(pace) = &mut pace {
            pace.wait(session.time());
        }
    }
    let (real_time, steps) = (pace.map(|pace| pace.report), session.counts());
    let recording = Recording { real_time, steps, ..recorder.finish(run) };
    let messages = match ended {
        ended if !is_terminated => {
            std::mem::forget(session);
            ended.map(|()| Vec::new())
        }
        Ok(()) => session.terminate(),
        Err(failure) if failure.kind == FailureKind::Terminated => {
            let is_whole = session.is_over();
            let mut messages = std::mem::take(&mut session.logged);
            // Errors during termination do not matter after an FMU has ended the simulation.
            messages.extend(session.terminate().unwrap_or_default());
            if is_whole { Ok(messages) } else { Err(failure) }
        }
        Err(failure) => Err(failure),
    };
    match messages {
        Ok(messages) => Ok(Recording { messages, seconds: began.elapsed().as_secs_f64(), ..recording }),
        Err(failure) => Err(Failure { recorded: Some(Box::new(recording)), ..failure }),
    }
}
