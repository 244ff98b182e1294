//! The history: its content, and the effects of an interruption and of the number of threads.

use fmu_study::journal::{Checkpoint, Journal, Objective, Outcome, Progress, Report};
use fmu_study::search::{Evaluate, ExecutionError, Stop};
use fmu_study::space::Parameter;
use fmu_study::{cma_es, genetic, pacsa};
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use tempfile::TempDir;

const PENALTY: f64 = 1e6;

fn parameters() -> Vec<Parameter> {
    ["a:x", "b:y, \"quoted\""]
        .map(|name| Parameter { name: name.into(), symbol: None, unit: None, min: -2.0, max: 2.0, log: false })
        .into()
}

/// A paraboloid that is infeasible where the first value is above 0.9, computed on threads that finish in any order.
struct Bowl {
    threads: usize,
    computed: AtomicUsize,
}

impl Bowl {
    fn new(threads: usize) -> Self {
        Self { threads, computed: AtomicUsize::new(0) }
    }
}

impl Objective for Bowl {
    fn evaluate(&self, candidates: &[Vec<f64>], done: &(dyn Fn(usize, Outcome) + Sync)) {
        self.computed.fetch_add(candidates.len(), Ordering::Relaxed);
        std::thread::scope(|scope| {
            for thread in 0..self.threads {
                scope.spawn(move || {
                    // In reverse, so that rows never arrive in order.
                    for (i, x) in candidates.iter().enumerate().rev().filter(|(i, _)| i % self.threads == thread) {
                        let objective = x.iter().map(|v| (v - 0.3).powi(2)).sum();
                        let outcome = if x[0] > 0.9 {
                            Outcome { objective: PENALTY, reason: Some("beyond,\n0.9".into()) }
                        } else {
                            Outcome { objective, reason: None }
                        };
                        done(i, outcome);
                    }
                });
            }
        });
    }
}

type Method = fn(&mut dyn Evaluate) -> Result<(), Stop>;

const METHODS: [Method; 3] = [
    |journal| pacsa::run(&pacsa::Settings { generations: 20, ..pacsa::Settings::default() }, 2, 5, journal),
    |journal| genetic::run(&genetic::Settings { generations: 8, ..genetic::Settings::default() }, 2, 5, journal),
    |journal| cma_es::run(&cma_es::Settings::default(), 2, 5, journal),
];

const QUIET: Report<'static> = &|_| ();
const NOTHING: Checkpoint<'static> = &|_| Ok(());

/// Runs a method with a history at `path`; returns its end and its progress.
fn run(path: &Path, method: Method, bowl: &Bowl, budget: u64) -> (Result<(), Stop>, Progress) {
    let parameters = parameters();
    let mut journal = Journal::open(path, &parameters, bowl, (budget, None), QUIET, NOTHING).unwrap();
    let ended = method(&mut journal);
    (ended, journal.progress())
}

#[test]
fn rows_come_in_order_for_any_number_of_threads() {
    let folder = TempDir::new().unwrap();
    for (index, method) in METHODS.into_iter().enumerate() {
        let histories = [1, 2, 7].map(|threads| {
            let path = folder.path().join(format!("{index}_{threads}.csv"));
            let (_, progress) = run(&path, method, &Bowl::new(threads), 200);
            assert!(progress.evaluations >= 150, "{progress:?}");
            std::fs::read_to_string(&path).unwrap()
        });
        assert_eq!(histories[0], histories[1]);
        assert_eq!(histories[0], histories[2]);
        let mut lines = histories[0].lines();
        assert_eq!(lines.next(), Some("evaluation,generation,a:x,\"b:y, \"\"quoted\"\"\",objective,feasible,reason"));
        for (number, line) in lines.enumerate() {
            assert!(line.starts_with(&format!("{},", number + 1)), "{line}");
        }
        assert!(histories[0].contains(",1000000.0,false,\"beyond, 0.9\"\n"), "a reason is one line");
    }
}

/// Wherever the file was cut off, resuming makes the same file, and nothing in it is computed again.
#[test]
fn going_on_equals_never_stopping() {
    let folder = TempDir::new().unwrap();
    for method in METHODS {
        let path = folder.path().join("history.csv");
        let _ = std::fs::remove_file(&path);
        let whole = Bowl::new(2);
        let (_, expected_progress) = run(&path, method, &whole, 150);
        let expected = std::fs::read(&path).unwrap();
        let lines = |bytes: &[u8]| bytes.iter().filter(|b| **b == b'\n').count();
        // The file is cut in the header, after the header, within lines, within generations, and at the end.
        for share in [0.001, 0.02, 0.1, 0.25, 0.5, 0.77, 0.9, 1.0] {
            let cut = (expected.len() as f64 * share) as usize;
            std::fs::write(&path, &expected[..cut]).unwrap();
            let bowl = Bowl::new(3);
            let (_, progress) = run(&path, method, &bowl, 150);
            assert_eq!(std::fs::read(&path).unwrap(), expected, "cut at {cut}");
            assert_eq!(progress, expected_progress);
            let kept = lines(&expected[..cut]).saturating_sub(1);
            let computed = bowl.computed.load(Ordering::Relaxed);
            assert!(computed + kept <= 150, "{computed} computed, {kept} kept");
        }
    }
}

/// The budget can end within a generation. With a larger budget, the search continues as if it had always had this
/// budget.
#[test]
fn a_larger_budget_goes_on() {
    let folder = TempDir::new().unwrap();
    let [short, long] = ["short.csv", "long.csv"].map(|name| folder.path().join(name));
    for method in METHODS {
        let _ = (std::fs::remove_file(&short), std::fs::remove_file(&long));
        let (ended, progress) = run(&short, method, &Bowl::new(2), 33);
        assert!(matches!(ended, Err(Stop::Budget)));
        assert_eq!(progress.evaluations, 33);
        let (_, long_progress) = run(&long, method, &Bowl::new(2), 140);
        let (_, progress) = run(&short, method, &Bowl::new(2), 140);
        assert_eq!(progress, long_progress);
        assert_eq!(std::fs::read(&short).unwrap(), std::fs::read(&long).unwrap());
        // If the budget is below the number of existing evaluations, the evaluations beyond it stay in the file.
        let (_, progress) = run(&short, method, &Bowl::new(2), 20);
        assert_eq!(progress.evaluations, 20);
        assert_eq!(std::fs::read(&short).unwrap(), std::fs::read(&long).unwrap());
    }
}

#[test]
fn the_target_ends_the_search() {
    let folder = TempDir::new().unwrap();
    let (parameters, bowl) = (parameters(), Bowl::new(2));
    let path = folder.path().join("history.csv");
    let mut journal = Journal::open(&path, &parameters, &bowl, (10_000, Some(0.01)), QUIET, NOTHING).unwrap();
    assert!(matches!(METHODS[2](&mut journal), Err(Stop::Target)));
    assert!(journal.progress().best.unwrap().objective <= 0.01);
}

/// A candidate that was tried before is not computed again, neither in the same generation nor later.
#[test]
fn nothing_is_computed_twice() {
    let folder = TempDir::new().unwrap();
    let (parameters, bowl) = (parameters(), Bowl::new(2));
    let path = folder.path().join("history.csv");
    let mut journal = Journal::open(&path, &parameters, &bowl, (100, None), QUIET, NOTHING).unwrap();
    let (a, b) = (vec![0.5, 0.5], vec![0.1, 0.5]);
    let first = journal.evaluate(&[a.clone(), b.clone(), a.clone()]).unwrap();
    let second = journal.evaluate(&[b, vec![0.2, 0.2], a]).unwrap();
    assert_eq!((first[0], first[1]), (second[2], second[0]));
    assert_eq!(bowl.computed.load(Ordering::Relaxed), 3);
    assert_eq!(journal.progress().evaluations, 6, "but all count");
    let progress = journal.progress();
    assert_eq!((progress.generations, progress.infeasible), (2, 0));
    assert_eq!(progress.best.unwrap().evaluation, 1, "the first of equals");
}

/// In reports and checkpoints, the number of evaluations rises, and the best objective never rises.
#[test]
fn the_best_never_rises() {
    let folder = TempDir::new().unwrap();
    let (parameters, bowl) = (parameters(), Bowl::new(2));
    for (index, method) in METHODS.into_iter().enumerate() {
        let seen: Mutex<Vec<Progress>> = Mutex::default();
        let path = folder.path().join(format!("{index}.csv"));
        let report = |progress: &Progress| seen.lock().unwrap().push(progress.clone());
        let mut journal = Journal::open(&path, &parameters, &bowl, (150, None), &report, NOTHING).unwrap();
        let _ = method(&mut journal);
        drop(journal);
        let seen = seen.into_inner().unwrap();
        assert!(seen.windows(2).all(|w| w[1].evaluations == w[0].evaluations + 1));
        let best: Vec<f64> = seen.iter().filter_map(|p| Some(p.best.as_ref()?.objective)).collect();
        assert!(best.windows(2).all(|w| w[1] <= w[0]) && best.len() > 100);
    }
}

#[test]
fn a_file_of_another_study_is_rejected() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("history.csv");
    run(&path, METHODS[0], &Bowl::new(1), 30).0.unwrap_err();
    let good = std::fs::read_to_string(&path).unwrap();
    let (parameters, bowl) = (parameters(), Bowl::new(1));
    let open = || Journal::open(&path, &parameters, &bowl, (30, None), QUIET, NOTHING);

    // Another method asks for other values.
    let mut journal = open().unwrap();
    let other = |seed| pacsa::Settings { generations: seed, ..pacsa::Settings::default() };
    let Err(Stop::Failed(error)) = pacsa::run(&other(3), 2, 6, &mut journal) else { panic!("it was accepted") };
    assert!(error.to_string().contains("history.csv, line 2: this study would try other values"), "{error}");
    drop(journal);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), good, "and nothing is lost");

    for (from, to, expected) in [
        ("a:x", "a:y", "line 1: expected the columns evaluation,generation,a:x"),
        ("\n2,0,", "\n2,0,x", "line 3: column 3: expected a finite number"),
        ("\n2,0,", "\n7,0,", "line 3: expected evaluation 2"),
        (",true,", ",yes,", "expected true or false"),
        ("\n3,0,", "\n3,0,0,0,", "line 4"),
    ] {
        assert!(good.contains(from));
        std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
        let error = open().map(drop).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn two_at_a_time_are_rejected() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("sub/history.csv");
    let (parameters, bowl) = (parameters(), Bowl::new(1));
    let open = || Journal::open(&path, &parameters, &bowl, (30, None), QUIET, NOTHING);
    let first = open().unwrap();
    let error = open().map(drop).unwrap_err().to_string();
    assert!(error.contains("another process is writing to it"), "{error}");
    drop(first);
    open().unwrap();
}

/// A checkpoint that cannot be written ends the search with its reason.
#[test]
fn a_failed_checkpoint_is_an_error() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("history.csv");
    let (parameters, bowl) = (parameters(), Bowl::new(1));
    let full = |_: &Progress| {
        Err(ExecutionError::Io { path: "state.json".into(), cause: std::io::ErrorKind::StorageFull.into() })
    };
    let mut journal = Journal::open(&path, &parameters, &bowl, (30, None), QUIET, &full).unwrap();
    let error = METHODS[0](&mut journal).unwrap_err();
    assert!(error.to_string().starts_with("state.json: "), "{error}");
}
