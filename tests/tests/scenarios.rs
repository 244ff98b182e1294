//! The scenario files resolve without warnings, each of their components can be replaced by one line, and parameters
//! without effect are found.

use fmu_import::description::ModelDescription;
use fmu_system::plan::Plan;
use fmu_system::resolve::{Options, ResolveError, resolve_text};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tests::workspace;

type Descriptions = BTreeMap<String, Arc<ModelDescription>>;

/// The committed descriptions. Each is also available as `NameCopy` and, with different names for all parameters, as
/// `NameOther`.
fn descriptions() -> Descriptions {
    let mut all = Descriptions::new();
    for entry in std::fs::read_dir(workspace().join("modelDescription")).expect("the folder is there") {
        let path = entry.expect("the folder can be read").path();
        if path.extension().is_none_or(|extension| extension != "xml") {
            continue;
        }
        let name = path.file_stem().and_then(|stem| stem.to_str()).expect("names are UTF-8").to_owned();
        let text = std::fs::read_to_string(&path).expect("the description can be read");
        let description = ModelDescription::parse(&text).unwrap_or_else(|error| panic!("{name}: {error}"));
        let other: String = text
            .split_inclusive('\n')
            .map(|line| match line.contains("causality=\"parameter\"") {
                true => line.replacen("<ScalarVariable name=\"", "<ScalarVariable name=\"other.", 1),
                false => line.to_owned(),
            })
            .collect();
        assert_ne!(other, text, "{name} has parameters");
        let other = ModelDescription::parse(&other).unwrap_or_else(|error| panic!("{name}: {error}"));
        let description = Arc::new(description);
        all.insert(format!("{name}Copy"), Arc::clone(&description));
        all.insert(format!("{name}Other"), Arc::new(other));
        all.insert(name, description);
    }
    all
}

fn toml_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).expect("the folder is there");
    let mut files: Vec<_> = entries.map(|entry| entry.expect("the folder can be read").path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "toml"));
    files.sort();
    files
}

fn scenarios() -> Vec<PathBuf> {
    let files = toml_files(&workspace().join("scenarios"));
    assert!(files.len() > 20, "the scenarios of all papers");
    files
}

fn lines(error: &ResolveError) -> String {
    match error {
        ResolveError::Problems(problems) => {
            problems.problems.iter().map(|problem| problem.line()).collect::<Vec<_>>().join("\n")
        }
        other => other.to_string(),
    }
}

fn plan(file: &Path, text: &str, source: &Descriptions) -> Plan {
    let fail = |error| panic!("{}\n{}", file.display(), lines(&error));
    resolve_text(file, text, source, &Options::default()).unwrap_or_else(fail)
}

/// The part of a text that defines a case.
fn case_of<'a>(text: &'a str, case: &str) -> Option<&'a str> {
    let name = format!("name = \"{case}\"\n");
    text.split("[[").find(|part| part.starts_with("case]]") && part.contains(&name))
}

/// A scenario in a temporary folder, with all files that scenarios refer to.
struct Copied {
    folder: tempfile::TempDir,
    file: PathBuf,
}

impl Copied {
    fn new(file: &Path) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        for used in ["scenarios/systems", "modelDescription/parameters"] {
            let copy = folder.path().join(used);
            std::fs::create_dir_all(&copy).expect("a new folder");
            for entry in std::fs::read_dir(workspace().join(used)).expect("the folder is there") {
                let entry = entry.expect("the folder can be read");
                std::fs::copy(entry.path(), copy.join(entry.file_name())).expect("a copy");
            }
        }
        let copy = folder.path().join("scenarios").join(file.file_name().expect("a file"));
        std::fs::copy(file, &copy).expect("a copy");
        Self { folder, file: copy }
    }

    /// The file that defines a case (the scenario or an included file), and its text.
    fn file_of(&self, case: &str) -> (PathBuf, String) {
        let read = |file: &Path| std::fs::read_to_string(file).expect("the file can be read");
        let scenario = read(&self.file);
        let included = toml_files(&self.folder.path().join("scenarios/systems")).into_iter().filter(|file| {
            scenario.contains(&format!("\"systems/{}\"", file.file_name().expect("a file").to_string_lossy()))
        });
        let mut files = std::iter::once(self.file.clone()).chain(included).map(|file| (read(&file), file));
        let (text, file) = files.find(|(text, _)| case_of(text, case).is_some()).expect("a file defines the case");
        (file, text)
    }

    /// The plan with an additional line in the definition of a case.
    fn with_line(&self, case: &str, line: &str, source: &Descriptions) -> Plan {
        let (file, text) = self.file_of(case);
        let defined = case_of(&text, case).expect("the file defines the case");
        let name = format!("name = \"{case}\"\n");
        let changed = text.replacen(defined, &defined.replacen(&name, &format!("{name}{line}\n"), 1), 1);
        std::fs::write(&file, changed).expect("the copy can be written");
        let scenario = std::fs::read_to_string(&self.file).expect("the scenario can be read");
        let plan = plan(&self.file, &scenario, source);
        std::fs::write(&file, text).expect("the copy can be written");
        plan
    }
}

/// Checks only the warnings that need no trial run, because a trial run needs the FMUs.
#[test]
fn no_scenario_warns() {
    let source = descriptions();
    for file in scenarios() {
        let text = std::fs::read_to_string(&file).expect("the scenario can be read");
        assert_eq!(plan(&file, &text, &source).warnings, [""; 0], "{}", file.display());
    }
}

/// One line is enough to swap any component in any case of any scenario, for a copy of its FMU as well as for an FMU
/// that has the same signals but different parameter names.
#[test]
fn every_component_is_replaced_by_one_line() {
    let source = descriptions();
    let mut swaps = 0;
    for file in scenarios() {
        let text = std::fs::read_to_string(&file).expect("the scenario can be read");
        let whole = plan(&file, &text, &source);
        let copied = Copied::new(&file);
        for case in &whole.cases {
            let run = whole.runs.iter().find(|run| run.case == case.name).expect("every case is run");
            for component in &run.components {
                let fmu = component.fmu.strip_suffix(".fmu").expect("an FMU");
                for suffix in ["Copy", "Other"] {
                    let line = format!("fmu.{} = \"{fmu}{suffix}\"", component.name);
                    // A case can set parameters of the component, which another FMU does not have.
                    if suffix == "Other" && case_sets(&copied.file_of(&case.name).1, &case.name, &component.name) {
                        continue;
                    }
                    let swapped = copied.with_line(&case.name, &line, &source);
                    let run = swapped.runs.iter().find(|run| run.case == case.name).expect("the case is still there");
                    let other =
                        run.components.iter().find(|u| u.name == component.name).expect("the component is still there");
                    assert_eq!(other.fmu, format!("{fmu}{suffix}.fmu"), "{}: {line}", file.display());
                    // The other FMU gets parameters only from points, seeds and the case.
                    assert!(suffix == "Copy" || other.parameters.is_empty(), "{}: {line}", file.display());
                    swaps += 1;
                }
            }
        }
    }
    assert!(swaps > 1000, "only {swaps} swaps");
}

/// Returns true if a case has values for parameters of a component, in its own table or in a parameter set.
fn case_sets(text: &str, case: &str, component: &str) -> bool {
    let of_case = case_of(text, case).expect("the file defines the case");
    of_case.contains(&format!("parameters.{component} ")) || of_case.contains("parameter_set")
}

/// A copy that keeps the parameters results in the same system.
#[test]
fn kept_parameters_are_those_of_the_component() {
    let source = descriptions();
    for name in ["esp_car_step_steer", "rescue_vehicle_step_steer", "hydro_pneumatic_robustness"] {
        let file = workspace().join(format!("scenarios/{name}.toml"));
        let text = std::fs::read_to_string(&file).expect("the scenario can be read");
        let whole = plan(&file, &text, &source);
        let copied = Copied::new(&file);
        let case = &whole.cases[0].name;
        for component in &whole.runs[0].components {
            let fmu = component.fmu.strip_suffix(".fmu").expect("an FMU");
            let line = format!("fmu.{} = {{ fmu = \"{fmu}Copy\", keep_parameters = true }}", component.name);
            let swapped = copied.with_line(case, &line, &source);
            let other = swapped.runs[0]
                .components
                .iter()
                .find(|u| u.name == component.name)
                .expect("the component is still there");
            assert_eq!(other.parameters, component.parameters, "{name}: {line}");
            assert_eq!(swapped.warnings, [""; 0], "{name}: {line}");
        }
    }
}

/// Every enum of the library has names for all its values, and no other description is parsed as a list of names.
#[test]
fn modes_have_names() {
    let mut modes = 0;
    for (name, description) in descriptions() {
        for variable in &description.variables {
            let values: Vec<i32> = variable.named_values().iter().map(|(value, _)| *value).collect();
            let is_mode =
                variable.declared_type.is_some() && variable.base_type == fmu_import::description::BaseType::Integer;
            assert_eq!(!values.is_empty(), is_mode, "{name}: {}", variable.name);
            if is_mode {
                let ends = [values[0], *values.last().expect("not empty")].map(f64::from);
                assert_eq!([variable.min, variable.max], ends.map(Some), "{name}: {}", variable.name);
                modes += 1;
            }
        }
    }
    assert!(modes > 20, "{modes}");
}

/// A prescribed speed has no effect on a car that computes its speed. A trial run with the real FMUs finds this, as in
/// `chassis plan`.
#[test]
fn a_trial_run_finds_parameters_without_effect() {
    let file = workspace().join("scenarios/esp_car_step_steer.toml");
    let text = std::fs::read_to_string(&file).expect("the scenario can be read");
    let folder = fmu_system::resolve::FmuFolder::new([tests::folder()]);
    let warnings = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        let text = text.replacen(from, to, 1);
        let plan = resolve_text(&file, &text, &folder, &Options { stop: Some(2.0), ..Options::default() });
        let plan = plan.unwrap_or_else(|error| panic!("{}", lines(&error)));
        assert_eq!(plan.warnings, [""; 0], "the descriptions do not tell");
        fmu_system::trial::warnings(&plan.simulation, &plan.trials)
            .iter()
            .map(|w| w.rsplit_once(".toml:").expect("a place").1.to_owned())
            .collect()
    };
    let found: Vec<String> = warnings("title", "title");
    assert_eq!(found, [""; 0], "as it is");
    let place = "maneuver = \"ramp_step\", ";
    // 60 km/h is the default, which is reported like any other value.
    for speed in ["{ value = 60.0, unit = \"km/h\" }", "5.0"] {
        let found: Vec<String> = warnings(place, &format!("{place}\"speed.initial\" = {speed}, "));
        assert_eq!(
            found,
            ["11:47: `speed.initial` of `driver` has no effect: it changes `driver.speed` only, which nothing reads"]
        );
    }
    // In a slalom between cones the same parameter determines how fast the driver steers.
    let slalom = "maneuver = \"slalom\", \"steer.period\" = 0.0, \"speed.initial\" = 5.0, ";
    let found: Vec<String> = warnings(place, slalom);
    assert!(found.iter().all(|warning| !warning.contains("speed.initial")), "{found:?}");
}
