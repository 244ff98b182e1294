//! Studies from the file to the results, on FMUs built from C in a temporary folder.
#![cfg(unix)]

mod patience;
#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_import::worker::{Launch, Settings};
use fmu_study::execution::{Existing, Summary, execute};
use fmu_study::search::ExecutionError;
use fmu_study::study::{self, Study, StudyError, Workers};
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::resolve::{FmuFolder, Options, resolve};
use patience::patience;
use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use support::Build;
use tempfile::TempDir;

/// Two integrators in a ring, x' = g y and y' = -g' x.
const SCENARIO: &str = r#"
title = "Ring"
[simulation]
stop = 1.0
step = 0.01
[[component]]
name = "position"
fmu = "Position"
parameters = { start = 1.0 }
[[component]]
name = "velocity"
fmu = "Velocity"
[[case]]
name = "free"
title = "Free"
[[case]]
name = "inverted"
title = "Inverted"
parameters.velocity = { inverted = true }
[[case]]
name = "failing"
title = "Failing"
parameters.velocity = { failure = 1 }
[[case]]
name = "alone"
title = "Alone"
without = ["velocity"]
inputs.position = { y = 2.0 }
[record]
signals = ["x", "y", "velocity:count"]
"#;

const STUDY: &str = r#"title = "Ring"
scenario = "ring.toml"
cases = ["free", "inverted"]
stop = 0.8
seed = 3
method = "optimize"
[budget]
evaluations = 60

[[parameter]]
name = "position:gain"
symbol = "g"
min = -2.0
max = 8.0

[[parameter]]
name = "velocity:gain"
symbol = "k"
min = 0.1
max = 10.0
log = true

[constants]
limit = 30.0

[[constraint]]
name = "product"
inequality = "abs(g) * k <= limit"

[[limit]]
signal = "velocity:y"
magnitude = 40.0

[[objective.term]]
signal = "position:x"
kind = "rms"
weight = 2.0
reference = 0.5
window = [0.2, 0.8]

[[objective.term]]
signal = "y"
kind = "mean_square"
weight = 3.0
reference = 2.0

[[search]]
kind = "pacsa"

[[search]]
kind = "ga"
settings = { population = 10, elite = 2 }

[[search]]
kind = "cmaes"
name = "yardstick"
title = "CMA-ES, other seed"
seed = 9

[[compare]]
title = "As it is"

[[compare]]
title = "Gains of 2, inverted"
case = "inverted"
values = { g = 2.0, "velocity:gain" = 2.0 }
"#;

struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        Build::new("Position", "y", "x").pack(folder.path());
        Build::new("Velocity", "x", "y").pack(folder.path());
        std::fs::write(folder.path().join("ring.toml"), SCENARIO).unwrap();
        Self { folder }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn read(&self, text: &str, jobs: usize) -> Result<Study, StudyError> {
        let path = self.path("study.toml");
        std::fs::write(&path, text).unwrap();
        study::read(&path, &FmuFolder::new([self.folder.path()]), workers(jobs))
    }

    fn execute(&self, text: &str, jobs: usize, out: &str, existing: Existing) -> Result<Summary, ExecutionError> {
        let study = self.read(text, jobs).unwrap_or_else(|e| panic!("{}", lines(&e)));
        execute(&study, &self.path(out), existing, &|_, _| ())
    }

    /// All files of the results by their path.
    fn results(&self, out: &str) -> BTreeMap<PathBuf, Vec<u8>> {
        let root = self.path(out).join("study");
        let mut files = BTreeMap::new();
        let mut open = vec![root.clone()];
        while let Some(folder) = open.pop() {
            for entry in std::fs::read_dir(folder).unwrap() {
                let path = entry.unwrap().path();
                if path.is_dir() {
                    open.push(path);
                } else {
                    files.insert(path.strip_prefix(&root).unwrap().to_path_buf(), std::fs::read(path).unwrap());
                }
            }
        }
        files
    }
}

fn workers(jobs: usize) -> Workers {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_chassis"));
    let launch = Launch { program, arguments: vec!["worker".into()] };
    let settings = Settings::new(launch, patience(60.0), Arc::new(|_| ()));
    (settings, NonZeroUsize::new(jobs).unwrap())
}

/// All mistakes, one per line.
fn lines(error: &StudyError) -> String {
    match error {
        StudyError::Problems(problems) => problems.problems.iter().map(|p| p.line()).collect::<Vec<_>>().join("\n"),
        other => other.to_string(),
    }
}

/// The mean over two runs of 2 rms(x)/0.5 in a window plus 3 (rms(y)/2)^2, computed independently of the study.
fn objective(place: &Place, scenario: &str, gains: Option<[f64; 2]>) -> f64 {
    let options = Options { stop: Some(0.8), ..Options::default() };
    let plan = resolve(&place.path(scenario), &FmuFolder::new([place.folder.path()]), &options).unwrap();
    let fmus = Fmus::load(&plan.runs).unwrap();
    let mut sum = 0.0;
    for run in plan.runs.iter().take(2) {
        let mut run = run.clone();
        for (component, gain) in ["position", "velocity"].into_iter().zip(gains.into_iter().flatten()) {
            run.set_parameter(&fmus, component, "gain", fmu_import::description::Value::Real(gain)).unwrap();
        }
        let recording = master::execute(&plan.simulation, &run, &fmus).unwrap();
        let (x, y) = (&recording.column(0).unwrap()[20..=80], recording.column(1).unwrap());
        let mean_square = |v: &[f64]| v.iter().map(|v| v * v).sum::<f64>() / v.len() as f64;
        sum += 4.0 * mean_square(x).sqrt() + 0.75 * mean_square(y);
    }
    sum / 2.0
}

#[test]
fn a_study_from_the_file_to_the_results() {
    let place = Place::new();
    let summary = place.execute(STUDY, 2, "out", Existing::Error).unwrap();
    let names: Vec<_> = summary.methods.iter().map(|m| m.method.name.as_str()).collect();
    assert_eq!(names, ["pacsa", "ga", "yardstick"]);
    assert_eq!(summary.runs, ["free", "inverted"]);
    // The test adds in the same order as the study, but multiplies by the factors at other places.
    assert!((summary.baseline.outcome.objective - objective(&place, "ring.toml", None)).abs() < 1e-12);
    assert_eq!(summary.baseline.values, [Some(1.0), Some(1.0)], "the start values of the FMUs");
    let compared: Vec<_> = summary.comparisons.iter().map(|c| c.title.as_str()).collect();
    assert_eq!(compared, ["Gains of 2, inverted"], "the scenario's own values are not computed twice");
    assert_eq!(summary.baseline.title, "As it is");
    assert_eq!(summary.comparisons[0].values["velocity:gain"], 2.0);
    assert!(summary.improved);
    let mut best = f64::INFINITY;
    for method in &summary.methods {
        assert_eq!(method.progress.evaluations, 60);
        let found = method.progress.best.as_ref().unwrap();
        let [g, k] = found.values[..] else { panic!() };
        assert!(g.abs() * k <= 30.0 && (-2.0..=8.0).contains(&g) && (0.1..=10.0).contains(&k));
        assert!((found.objective - objective(&place, "ring.toml", Some([g, k]))).abs() < 1e-12);
        assert!(found.objective < summary.baseline.outcome.objective, "better than the gains of 1 of the scenario");
        best = best.min(found.objective);
    }

    // A scenario with the optimum as its parameter set gives the bit-identical objective.
    let with_set = SCENARIO.replacen("title", "parameter_set = \"out/study/best.ssv\"\ntitle", 1);
    std::fs::write(place.path("tuned.toml"), with_set).unwrap();
    let method = summary.methods.iter().find(|m| Some(&m.method.name) == summary.best.as_ref()).unwrap();
    let found = method.progress.best.as_ref().unwrap();
    assert_eq!(found.objective, best);
    let [g, k] = found.values[..] else { panic!() };
    assert_eq!(objective(&place, "tuned.toml", None), objective(&place, "ring.toml", Some([g, k])));
}

#[test]
fn results_do_not_depend_on_the_number_of_processes() {
    let place = Place::new();
    for jobs in [1, 2, 5] {
        place.execute(STUDY, jobs, &format!("out{jobs}"), Existing::Error).unwrap();
    }
    let one = place.results("out1");
    assert_eq!(one.len(), 3 * 3 + 2, "{:?}", one.keys());
    assert!(one == place.results("out2") && one == place.results("out5"));
}

/// A study can be interrupted anywhere: within the second method, in a line of the history, or between a checkpoint and
/// later lines of the history.
#[test]
fn going_on_equals_never_stopping() {
    let place = Place::new();
    place.execute(STUDY, 2, "whole", Existing::Error).unwrap();
    let whole = place.results("whole");
    for share in [0.0, 0.3, 0.8, 1.0] {
        let less = STUDY.replacen("evaluations = 60", "evaluations = 25", 1);
        place.execute(&less, 2, "parts", Existing::Overwrite).unwrap();
        for unfinished in ["yardstick/history.csv", "yardstick/state.json", "yardstick/best.ssv", "summary.json"] {
            std::fs::remove_file(place.path("parts/study").join(unfinished)).unwrap();
        }
        let history = place.path("parts/study/ga/history.csv");
        let content = std::fs::read(&history).unwrap();
        std::fs::write(&history, &content[..(content.len() as f64 * share) as usize]).unwrap();
        place.execute(STUDY, 3, "parts", Existing::Resume).unwrap();
        assert!(place.results("parts") == whole, "cut at {share}");
    }
    // Resuming a finished study changes nothing.
    place.execute(STUDY, 1, "whole", Existing::Resume).unwrap();
    assert!(place.results("whole") == whole);
}

#[test]
fn results_are_not_lost_by_a_slip() {
    let place = Place::new();
    place.execute(STUDY, 2, "out", Existing::Error).unwrap();
    let before = place.results("out");
    let error = place.execute(STUDY, 2, "out", Existing::Error).unwrap_err().to_string();
    assert!(error.contains("history.csv already exists: `--resume` continues"), "{error}");
    for (from, to) in [
        ("max = 8.0", "max = 7.0"),
        ("stop = 0.8", "stop = 0.9"),
        ("weight = 2.0", "weight = 2.5"),
        ("limit = 30.0", "limit = 31.0"),
        ("\"abs(g) * k <= limit\"", "\"abs(g) * k < limit\""),
        ("seed = 3", "seed = 4"),
        ("kind = \"pacsa\"", "kind = \"pacsa\"\nsettings = { selected = 9 }"),
        ("magnitude = 40.0", "magnitude = 41.0"),
    ] {
        let error = place.execute(&STUDY.replacen(from, to, 1), 2, "out", Existing::Resume).unwrap_err().to_string();
        assert!(error.contains("belongs to another version of the study"), "{to}: {error}");
    }
    // Another binary with the same description.
    let rebuilt = Build { states: false, ..Build::new("Velocity", "x", "y") };
    rebuilt.pack(place.folder.path());
    let error = place.execute(STUDY, 2, "out", Existing::Resume).unwrap_err().to_string();
    assert!(error.contains("belongs to another version"), "{error}");
    assert!(place.results("out") == before);
}

/// A smaller budget is rejected, because existing evaluations would have to be dropped.
#[test]
fn a_smaller_budget_is_rejected() {
    let place = Place::new();
    place.execute(STUDY, 2, "out", Existing::Error).unwrap();
    let before = place.results("out");
    let less = STUDY.replacen("evaluations = 60", "evaluations = 59", 1);
    let error = place.execute(&less, 2, "out", Existing::Resume).unwrap_err();
    assert!(matches!(error, ExecutionError::Budget { evaluations: 60, budget: 59, .. }), "{error}");
    let error = error.to_string();
    assert!(error.contains("history.csv has 60 evaluations, more than the budget of 59"), "{error}");
    assert!(error.contains("a budget of at least 60; `--overwrite` starts over"), "{error}");
    assert!(place.results("out") == before);
    // A new target does not drop evaluations either: all existing evaluations are used.
    let early = STUDY.replacen("evaluations = 60", "evaluations = 60\ntarget = 1e5", 1);
    let summary = place.execute(&early, 2, "out", Existing::Resume).unwrap();
    assert_eq!(summary.methods.iter().map(|m| m.progress.evaluations).collect::<Vec<_>>(), [60; 3]);
    for name in ["best.ssv", "ga/best.ssv", "ga/history.csv"] {
        assert_eq!(place.results("out")[Path::new(name)], before[Path::new(name)]);
    }
}

/// Without a `[[compare]]`, results are compared with the scenario's own values, and a result that is not better is
/// reported as such.
#[test]
fn the_scenarios_own_values_are_compared_with() {
    let place = Place::new();
    let own = "parameters.velocity = { gain = 3.0, inverted = true }";
    std::fs::write(place.path("ring.toml"), SCENARIO.replacen("parameters.velocity = { inverted = true }", own, 1))
        .unwrap();
    let text = STUDY.replacen("[[compare]]\ntitle = \"As it is\"\n\n", "", 1);
    assert!(text.len() < STUDY.len());
    let summary = place.execute(&text, 2, "two", Existing::Error).unwrap();
    assert_eq!(summary.baseline.title, "As in the scenario");
    assert_eq!(summary.baseline.values, [Some(1.0), None], "the cases differ in the second");
    assert_eq!(summary.comparisons.len(), 1);

    // In these ranges, the amplitude of y is at least sqrt(8/0.6). In the scenario, it is sqrt(3).
    let text = text.replacen("cases = [\"free\", \"inverted\"]", "cases = [\"inverted\"]", 1);
    let far = text.replacen("min = -2.0\nmax = 8.0", "min = 0.5\nmax = 0.6", 1).replacen("min = 0.1", "min = 8.0", 1);
    let summary = place.execute(&far, 2, "far", Existing::Error).unwrap();
    assert_eq!(summary.baseline.values, [Some(1.0), Some(3.0)]);
    let name = summary.best.as_ref().unwrap();
    let best = summary.methods.iter().find(|m| m.method.name == *name).unwrap().progress.best.as_ref().unwrap();
    assert!(best.objective > summary.baseline.outcome.objective && !summary.improved);
}

/// Only the wrong case is reported, without further errors about recorded signals, because these do not depend on the
/// cases of the study.
#[test]
fn a_wrong_case_is_one_mistake() {
    let place = Place::new();
    let error = place.read(&STUDY.replacen("cases = [\"free\", \"inverted\"]", "cases = [\"fre\"]", 1), 1);
    let error = lines(&error.unwrap_err());
    assert!(error.ends_with("study.toml:3:10: unknown case `fre`") && error.lines().count() == 1, "{error}");
}

/// If the component does not write the signal, the message suggests the one that does.
#[test]
fn a_wrong_component_of_a_signal_is_named() {
    let place = Place::new();
    let error = place.read(&STUDY.replacen("signal = \"position:x\"", "signal = \"position:y\"", 1), 1).unwrap_err();
    let StudyError::Problems(problems) = &error else { panic!("{error}") };
    let help = miette::Diagnostic::help(&problems.problems[0]).unwrap().to_string();
    assert_eq!(help, "did you mean `velocity:y`? Otherwise add it to `signals` of its [record]");
}

/// Runs that fail, exceed a limit or overflow, and candidates that violate the constraints, get a bad but finite
/// objective and a reason. The study continues to its end.
#[test]
fn what_is_not_feasible_is_bad_and_no_more() {
    let place = Place::new();
    let read = |out: &str| std::fs::read_to_string(place.path(out).join("study/pacsa/history.csv")).unwrap();
    let summary = place.execute(STUDY, 2, "some", Existing::Error).unwrap();
    let history = read("some");
    assert!(history.contains(",1000000.0,false,constraint product\n"), "{history}");
    let infeasible = history.matches(",false,").count() as u64;
    assert_eq!(summary.methods[0].progress.infeasible, infeasible);
    assert!((1..60).contains(&infeasible));

    // With the gains of some candidates, a signal exceeds this limit. The penalty is different, too.
    let text = STUDY.replacen("magnitude = 40.0", "magnitude = 1.5", 1).replacen("stop", "penalty = 777.0\nstop", 1);
    place.execute(&text, 2, "limit", Existing::Error).unwrap();
    let history = read("limit");
    assert!(history.contains(",777.0,false,") && history.contains("the limit is 1.5"), "{history}");

    // A tiny reference value makes the term of `y` overflow.
    let text = STUDY.replacen("reference = 2.0", "reference = 1e-200", 1);
    let summary = place.execute(&text, 2, "overflow", Existing::Error).unwrap();
    assert!(read("overflow").contains("the term of `y` is inf"), "{}", read("overflow"));
    assert_eq!(summary.best, None);

    // Every run fails at 0.5 s.
    let text = STUDY.replacen("cases = [\"free\", \"inverted\"]", "cases = [\"failing\"]", 1);
    let summary = place.execute(&text, 2, "failing", Existing::Error).unwrap();
    let history = read("failing");
    assert!(
        history.contains("run failing, step from 0.5 s: ") && history.contains("x left 90% of its range"),
        "{history}"
    );
    for method in &summary.methods {
        assert_eq!((method.progress.evaluations, method.progress.infeasible), (60, 60));
        assert_eq!(method.progress.best, None);
    }
    assert!(!place.path("failing/study/best.ssv").exists());
}

#[test]
fn judgments_become_weights() {
    let place = Place::new();
    let judged = STUDY
        .replacen("[[objective.term]]", "[objective]\njudgments = [[1, 4], [\"1/4\", 1]]\n[[objective.term]]", 1)
        .replacen("weight = 2.0\n", "", 1)
        .replacen("weight = 3.0\n", "", 1);
    let study = place.read(&judged, 1).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let weights: Vec<f64> = study.simulation.terms.iter().map(|t| t.weight).collect();
    // The weights have the ratio 4 : 1, up to rounding errors.
    assert!((weights[0] - 0.8).abs() < 1e-15 && (weights[1] - 0.2).abs() < 1e-15);
    assert_eq!(study.judged.unwrap().ratio, 0.0);
}

/// A method with several seeds becomes one method per seed, with the same settings.
#[test]
fn a_method_runs_with_several_seeds() {
    let place = Place::new();
    let text = STUDY.replacen("kind = \"ga\"", "kind = \"ga\"\nseeds = [3, 7]", 1);
    let study = place.read(&text, 1).unwrap_or_else(|e| panic!("{}", lines(&e)));
    let ga: Vec<_> = study.methods.iter().filter(|m| m.group == "GA").collect();
    let names: Vec<_> = ga.iter().map(|m| (m.name.as_str(), m.title.as_str(), m.seed)).collect();
    assert_eq!(names, [("ga_3", "GA, seed 3", 3), ("ga_7", "GA, seed 7", 7)]);
    assert_eq!(ga[0].search, ga[1].search);
    let other = study.methods.iter().find(|m| m.name == "yardstick").unwrap();
    assert_eq!((other.title.as_str(), other.group.as_str()), ("CMA-ES, other seed", "CMA-ES, other seed"));

    let single = place.execute(STUDY, 2, "single", Existing::Error).unwrap();
    let several = place.execute(&text, 2, "several", Existing::Error).unwrap();
    assert_eq!(single.methods[1].progress, several.methods[1].progress, "the study's seed is 3");
    assert_ne!(several.methods[1].progress, several.methods[2].progress);
}

/// Each entry consists of a change to the study, the marked position of the mistake, and the message.
#[test]
fn mistakes_are_reported_with_their_place() {
    let place = Place::new();
    let judge = |matrix: &str| format!("[objective]\njudgments = {matrix}\n[[objective.term]]");
    let [three, circle, word] = ["[[1]]", "[[1, 2], [2, 1]]", "[[1, \"a\"], [1, 1]]"].map(judge);
    let term = "[[objective.term]]\nsignal = \"position:x\"";
    let cases: &[(&str, &str, &str)] = &[
        ("title = ", "titel = ", "1:1: unknown key `titel`"),
        ("scenario = \"ring.toml\"", "scenario = \"rong.toml\"", "2:12: there is no file"),
        ("method = \"optimize\"", "method = \"sample\"", "6:10: unknown method `sample`, expected optimize"),
        ("method = \"optimize\"", "method = \"guess\"", "6:10: unknown method `guess`, expected optimize"),
        ("\"free\", \"inverted\"", "\"fre\"", "3:10: unknown case `fre`"),
        ("cases = [\"free\", \"inverted\"]", "cases = []", "`cases` is empty"),
        (
            "cases = [\"free\", \"inverted\"]",
            "cases = [\"alone\"]",
            "case `alone`: the run has no component `velocity`",
        ),
        ("stop = 0.8", "stop = 0.805", "4:8: from start 0 s to stop 0.805 s are 80.5 steps of 0.01 s"),
        ("stop = 0.8", "seeds = 0", "4:9: seeds is 0, expected at least 1"),
        ("stop = 0.8", "seeds = 2", "4:9: seeds is 2, the scenario has 0"),
        ("seed = 3", "seed = -3", "5:8: seed is -3, expected 0 or more"),
        ("seed = 3", "penalty = 0.0", "penalty is 0.0, expected above 0"),
        ("evaluations = 60", "evaluations = 0", "8:15: evaluations is 0, expected at least 1"),
        ("evaluations = 60", "evaluations = 60\ntarget = inf", "expected a finite number"),
        ("name = \"position:gain\"", "name = \"gain\"", "11:8: expected \"component:parameter\""),
        (
            "name = \"position:gain\"",
            "name = \"positon:gain\"",
            "11:8: case `free`: the run has no component `positon`",
        ),
        ("name = \"position:gain\"", "name = \"position:gian\"", "Position has no parameter `gian`"),
        ("name = \"position:gain\"", "name = \"position:x\"", "is not a parameter but an output"),
        ("name = \"position:gain\"", "name = \"velocity:gain\"", "the parameter `velocity:gain` appears twice"),
        ("name = \"position:gain\"", "name = \"position:failure\"", "`failure` is Integer"),
        ("max = 8.0", "max = 12.0", "14:7: case `free`: `position`: `gain` is 12.0, expected at most 10"),
        ("max = 8.0", "max = -2.0", "14:7: max is -2.0, expected a finite number above min -2.0"),
        ("min = -2.0", "min = nan", "13:7: expected a finite number"),
        ("min = 0.1", "min = 0.0", "19:7: min is 0.0, expected above 0 with log = true"),
        ("symbol = \"g\"", "symbol = \"2g\"", "not start with a digit"),
        ("symbol = \"g\"", "symbol = \"k\"", "the name `k` appears twice"),
        ("symbol = \"g\"", "symbol = \"sqrt\"", "`sqrt` is a function"),
        ("limit = 30.0", "k = 30.0", "the name `k` appears twice"),
        ("limit = 30.0", "limit = inf", "expected a finite number"),
        ("abs(g) * k <= limit", "abs(g) * q <= limit", "28:24: unknown name `q`"),
        ("abs(g) * k <= limit", "abs(g) * k", "28:25: expected <, <=, > or >="),
        ("[[limit]]", "[[constraint]]\nname = \"product\"\ninequality = \"g > 0\"\n[[limit]]", "appears twice"),
        ("magnitude = 40.0", "magnitude = 0.0", "magnitude is 0.0, expected above 0"),
        ("signal = \"velocity:y\"", "signal = \"velocity:z\"", "the scenario does not record `velocity:z`"),
        ("signal = \"velocity:y\"", "signal = \"position:y\"", "the scenario does not record `position:y`"),
        ("signal = \"velocity:y\"", "signal = \"position:count\"", "the scenario does not record `position:count`"),
        ("kind = \"rms\"", "kind = \"rmss\"", "`kind`: unknown word `rmss`"),
        ("weight = 2.0", "weight = -2.0", "37:10: weight is -2.0, expected 0 or more"),
        ("weight = 2.0\n", "", "this term needs a weight"),
        ("reference = 0.5", "reference = 0.0", "reference is 0.0, expected above 0"),
        ("window = [0.2, 0.8]", "window = [0.2, 0.9]", "expected a window [from, to] with 0 <= from < to <= 0.8"),
        (term, &format!("{}\nsignal = \"position:x\"", circle), "are 2 and 2, expected reciprocals"),
        (term, &format!("{}\nsignal = \"position:x\"", three), "1 rows of judgments, but 2 terms"),
        (term, &format!("{}\nsignal = \"position:x\"", word), "expected a number or a text such as \"1/3\""),
        (term, &format!("{}\nsignal = \"position:x\"", circle), "the judgments determine the weights"),
        ("kind = \"pacsa\"", "kind = \"pacsa\"\nseeds = []", "seeds is empty"),
        ("kind = \"pacsa\"", "kind = \"pacsa\"\nseeds = [2, -3]", "seed is -3, expected 0 or more"),
        ("kind = \"pacsa\"", "kind = \"pacsa\"\nseeds = [2, 2]", "the method `pacsa_2` appears twice"),
        ("seed = 9", "seed = 9\nseeds = [1]", "a method has a seed or seeds, not both"),
        ("kind = \"pacsa\"", "kind = \"pasca\"", "unknown method `pasca`, expected pacsa, ga or cmaes"),
        ("kind = \"pacsa\"", "kind = \"ga\"", "the method `ga` appears twice; give it a name"),
        ("name = \"yardstick\"", "name = \"../x\"", "the name of a method must consist of a-z, 0-9 and _"),
        (
            "kind = \"pacsa\"",
            "kind = \"pacsa\"\nsettings = { mutation_min = 0.2 }",
            "mutation_min is 0.2, expected at most mutation_max 0.15",
        ),
        (
            "kind = \"pacsa\"",
            "kind = \"pacsa\"\nsettings = { updates_max = 2 }",
            "updates_min is 4.0, expected at most updates_max 2.0",
        ),
        ("elite = 2", "elit = 2", "ga has no setting `elit`, expected one of: population, crossover"),
        ("elite = 2", "elite = 10", "elite is 10, expected a whole number from 0 to 9"),
        ("population = 10", "population = 1.5", "population is 1.5, expected a whole number from 2"),
        ("population = 10", "mutation = 1.5", "mutation is 1.5, expected a number from 0 to 1"),
        ("case = \"inverted\"", "case = \"invreted\"", "unknown case `invreted`"),
        ("g = 2.0", "h = 2.0", "`h` is not a parameter of this study"),
        ("g = 2.0", "g = 20.0", "`gain` is 20.0, expected at most 10"),
    ];
    for (from, to, expected) in cases {
        assert!(STUDY.contains(from), "not in the study: {from}");
        let error = place.read(&STUDY.replacen(from, to, 1), 1).err();
        let error = lines(&error.unwrap_or_else(|| panic!("no mistake found: {to}")));
        assert!(error.contains(expected), "{to}\n  expected {expected}\n  got {error}");
        assert!(error.contains("study.toml:"), "{error}");
    }
    let weightless = STUDY.replacen("weight = 2.0", "weight = 0.0", 1).replacen("weight = 3.0", "weight = 0.0", 1);
    let error = lines(&place.read(&weightless, 1).unwrap_err());
    assert!(error.contains("all weights are 0, expected one above 0"), "{error}");
    for (what, expected) in [
        ("[[parameter]]", "a study needs at least one [[parameter]]"),
        ("[[objective.term]]", "missing key `objective`"),
        ("[[search]]", "a study needs at least one [[search]]"),
    ] {
        // Removes all tables with this name.
        let without: String = STUDY
            .split_inclusive("\n\n")
            .filter(|table| !table.starts_with(what))
            .filter(|table| what != "[[parameter]]" || !table.starts_with("[[constraint]]"))
            .collect();
        let error = lines(&place.read(&without, 1).unwrap_err());
        assert!(error.contains(expected), "{what}: {error}");
    }
}

#[test]
fn what_the_study_needs_must_be_there() {
    let place = Place::new();
    let source = FmuFolder::new([place.folder.path()]);
    let error = study::read(Path::new("nowhere.toml"), &source, workers(1)).unwrap_err().to_string();
    assert!(error.starts_with("cannot read nowhere.toml: "), "{error}");
    std::fs::write(place.path("ring.toml"), SCENARIO.replacen("Velocity", "Velocety", 1)).unwrap();
    assert!(matches!(place.read(STUDY, 1), Err(StudyError::Scenario(_))));
}

/// A relative path starts at the folder of the scenario. If the file changes, the study counts as changed, as it does
/// if an FMU changes.
#[test]
fn a_file_that_an_fmu_reads_is_part_of_the_study() {
    let place = Place::new();
    let named = SCENARIO.replacen("fmu = \"Velocity\"", "fmu = \"Velocity\"\nparameters = { label = \"data.csv\" }", 1);
    std::fs::write(place.path("ring.toml"), named).unwrap();
    std::fs::write(place.path("data.csv"), "first").unwrap();
    place.execute(STUDY, 2, "out", Existing::Error).unwrap();
    place.execute(STUDY, 2, "out", Existing::Resume).unwrap();
    std::fs::write(place.path("data.csv"), "other").unwrap();
    let error = place.execute(STUDY, 2, "out", Existing::Resume).unwrap_err().to_string();
    assert!(error.contains("belongs to another version"), "{error}");
}
