//! Shared code of the tests in this package.
//!
//! The tests access FMUs as any importer does: through the packed `.fmu` file and its C functions. They cover every
//! file `*.fmu` in [`folder`], so a new model is tested as soon as it is packed.

pub mod fuzz;
pub mod life;
pub mod raw;
pub mod signals;
pub mod state_bytes;
pub mod symbols;

use fmu_import::archive::Archive;
use fmu_import::c_api::Reference;
use fmu_import::description::{BaseType, Causality, DataType, Interface, ModelDescription, Variability, Variable};
use fmu_import::loader::{CallError, CallProblem, Instance, Library, Status};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::Arc;

/// Top folder of the workspace.
///
/// # Panics
/// Never, because this package is in a subfolder.
#[must_use]
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the package has a parent folder").to_path_buf()
}

/// The output of a command that must succeed.
///
/// # Panics
/// If the command fails; the message contains its output.
#[track_caller]
pub fn successful(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{command:?}\n{}\n{}", text(&output.stdout), text(&output.stderr));
    output
}

/// Path of the cargo that runs this program.
#[must_use]
pub fn cargo() -> std::ffi::OsString {
    std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into())
}

/// Builds the command of this workspace and returns its path.
///
/// # Panics
/// If it does not build.
#[must_use]
pub fn cargo_fmu() -> PathBuf {
    program("cargo-fmu")
}

/// Like [`cargo_fmu`], for the command `chassis`.
///
/// # Panics
/// If it does not build.
#[must_use]
pub fn chassis() -> PathBuf {
    program("chassis")
}

fn program(name: &str) -> PathBuf {
    // The program is built with a test and all packages, like `cargo test --workspace`, because cargo would build
    // everything again with other features.
    let targets = ["--workspace", "--bin", name, "--test", "commands"];
    let arguments =
        ["build", "--locked", "--offline", "--quiet", "--message-format", "json"].into_iter().chain(targets);
    let output = successful(Command::new(cargo()).args(arguments).current_dir(workspace()));
    let messages = String::from_utf8(output.stdout).expect("messages are UTF-8");
    let mut executables = messages.lines().filter_map(|line| {
        let message: serde_json::Value = serde_json::from_str(line).expect("messages are JSON");
        // The executables of other packages are built for the test.
        let target = &message["target"];
        let is_program = target["kind"] == serde_json::json!(["bin"]) && target["name"] == name;
        message["executable"].as_str().filter(|_| is_program).map(PathBuf::from)
    });
    executables.next_back().expect("cargo names the executable")
}

/// Folder of the packed FMUs: `$CHASSIS_FMU_DIR`, or `target/fmu`.
#[must_use]
pub fn folder() -> PathBuf {
    std::env::var_os("CHASSIS_FMU_DIR").map_or_else(|| workspace().join("target/fmu"), PathBuf::from)
}

/// Paths of all packed FMUs, sorted by name.
///
/// # Panics
/// If there is no packed FMU.
#[must_use]
pub fn paths() -> Vec<PathBuf> {
    let paths = fmus_in(&folder());
    assert!(!paths.is_empty(), "there is no FMU in {}: run `cargo fmu pack --all`", folder().display());
    paths
}

/// Paths of the FMI 3.0 FMUs, sorted by name, from `$CHASSIS_FMU3_DIR` or `target/fmu3`. Leaves out the examples that do
/// not start without their resources, which not all tests pass.
///
/// # Panics
/// If a kind is missing: continuous-time, discrete-time, with events, with all types.
#[must_use]
pub fn paths_of_fmi3() -> Vec<PathBuf> {
    let folder = std::env::var_os("CHASSIS_FMU3_DIR").map_or_else(|| workspace().join("target/fmu3"), PathBuf::from);
    let mut paths = fmus_in(&folder);
    paths.retain(|path| {
        ["LookupTable", "Resource"].iter().all(|name| path.file_stem().is_none_or(|stem| stem != *name))
    });
    for name in ["RescueVehicle", "AllWheelSteering", "BouncingBall", "AllTypes"] {
        let is_there = paths.iter().any(|path| path.file_stem().is_some_and(|stem| stem == name));
        assert!(is_there, "{name}.fmu is not in {}: run `cargo fmu pack --fmi 3 {name}`", folder.display());
    }
    paths
}

fn fmus_in(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<_> = std::fs::read_dir(folder)
        .map(|entries| entries.filter_map(|entry| entry.ok().map(|entry| entry.path())).collect())
        .unwrap_or_default();
    paths.retain(|path: &PathBuf| path.extension().is_some_and(|extension| extension == "fmu"));
    paths.sort();
    paths
}

/// All packed FMUs, sorted by name.
///
/// # Panics
/// If there is no FMU, or an FMU cannot be opened.
#[must_use]
pub fn all() -> Vec<Fmu> {
    paths().iter().map(|path| Fmu::open(path)).collect()
}

/// The FMUs of [`paths_of_fmi3`] without arrays.
///
/// # Panics
/// In the same cases as [`paths_of_fmi3`], or if an FMU cannot be opened.
#[must_use]
pub fn all_of_fmi3() -> Vec<Fmu> {
    let fmus = paths_of_fmi3().iter().map(|path| Fmu::open(path)).collect::<Vec<_>>();
    fmus.into_iter().filter(|fmu| fmu.description.variables.iter().all(|variable| !variable.is_array())).collect()
}

/// All packed FMUs that provide directional derivatives; in this library, these are the plants.
///
/// # Panics
/// In the same cases as [`all`].
#[must_use]
pub fn plants() -> Vec<Fmu> {
    all().into_iter().filter(Fmu::is_plant).collect()
}

/// A valgrind command that fails on an invalid access, a use of uninitialized values, or lost memory. Memory that is
/// still reachable at the end does not count as lost.
#[must_use]
pub fn valgrind() -> Command {
    let mut command = Command::new("valgrind");
    command.args(["--quiet", "--error-exitcode=99", "--leak-check=full"]);
    command.args(["--errors-for-leak-kinds=definite,indirect", "--show-leak-kinds=definite,indirect"]);
    command
}

/// An opened FMU.
pub struct Fmu {
    /// File stem, which is also the model identifier.
    pub name: String,
    /// The `.fmu` file.
    pub path: PathBuf,
    /// Its description.
    pub description: ModelDescription,
    /// The text of its description.
    pub xml: String,
    /// Its functions.
    pub library: Arc<Library>,
}

impl Fmu {
    /// Opens a file.
    ///
    /// # Panics
    /// If the file is missing or is not an FMU for this platform.
    #[must_use]
    pub fn open(path: &Path) -> Self {
        Self::open_with(path, |_| ())
    }

    /// Opens a file; its library stays loaded until the process ends. If `global`, it shares a namespace with other
    /// libraries that are opened with `global`.
    ///
    /// # Panics
    /// As [`Self::open`].
    #[must_use]
    pub fn open_and_keep(path: &Path, global: bool) -> Self {
        Self::open_with(path, |binary| raw::keep_loaded(binary, global))
    }

    fn open_with(path: &Path, before_loading: impl FnOnce(&Path)) -> Self {
        let name = path.file_stem().and_then(|stem| stem.to_str()).expect("names are UTF-8").to_owned();
        let mut archive = match Archive::open(path) {
            Ok(archive) => archive,
            Err(error) => panic!("{error}: run `cargo fmu pack --all`"),
        };
        let xml = archive.description_text().unwrap_or_else(|error| panic!("{error}"));
        let description = archive.description().unwrap_or_else(|error| panic!("{error}"));
        let unpacked = archive.unpack(&description, Interface::CoSimulation).unwrap_or_else(|error| panic!("{error}"));
        before_loading(&unpacked.binary);
        let library = Library::load(unpacked).unwrap_or_else(|error| panic!("{error}"));
        Self { name, path: path.to_path_buf(), description, xml, library }
    }

    /// The packed FMU with this name.
    ///
    /// # Panics
    /// As [`Self::open`].
    #[must_use]
    pub fn named(name: &str) -> Self {
        Self::open(&folder().join(format!("{name}.fmu")))
    }

    /// Returns true if it provides directional derivatives, as continuous-time models do.
    #[must_use]
    pub fn is_plant(&self) -> bool {
        self.description.co_simulation.as_ref().is_some_and(|unit| unit.provides_directional_derivative)
    }

    /// A new instance in the FMU state Instantiated.
    ///
    /// # Panics
    /// If the FMU returns an error.
    #[must_use]
    pub fn instance(&self) -> Instance {
        Instance::instantiate(&self.library, &self.name, &self.description.guid, false)
            .unwrap_or_else(|error| panic!("{error}"))
    }

    /// A new instance that is ready to step from `start`.
    ///
    /// # Panics
    /// If the FMU returns an error.
    #[must_use]
    pub fn started_at(&self, start: f64) -> Instance {
        let mut instance = self.instance();
        ok(instance.setup_experiment(start, None));
        ok(instance.enter_initialization_mode());
        ok(instance.exit_initialization_mode());
        instance
    }

    /// A new instance that is ready to step from 0.
    ///
    /// # Panics
    /// If the FMU returns an error.
    #[must_use]
    pub fn started(&self) -> Instance {
        self.started_at(0.0)
    }

    /// Size in s of a step that fails with [`Self::failing_inputs`].
    pub const FAILING_STEP: f64 = 2.0;

    /// Finite inputs for which the first step gives numbers that are not finite; `None` if no such inputs were found.
    ///
    /// # Panics
    /// If the FMU rejects inputs that are finite.
    #[must_use]
    pub fn failing_inputs(&self) -> Option<Vec<f64>> {
        const HUGE: f64 = 1.7e308;
        let start: Vec<_> = self.with(Causality::Input).filter(|input| is_double(input)).map(signals::start).collect();
        let all = self.reals();
        // One huge input, which overflows when it is integrated, or huge values of all inputs with alternating signs.
        let single = (0..start.len()).map(|i| {
            let mut values = start.clone();
            values[i] = HUGE;
            values
        });
        let alternating = (0..start.len()).map(|i| if i % 2 == 0 { HUGE } else { -HUGE }).collect();
        single.chain([alternating]).find(|values| {
            let mut trial = self.instance_with(values);
            ok(trial.enter_initialization_mode());
            ok(trial.exit_initialization_mode());
            let fails = trial.do_step(0.0, Self::FAILING_STEP).is_err();
            fails && trial.get_real(&all, &mut vec![0.0; all.len()]).is_ok()
        })
    }

    /// A new instance in the FMU state Instantiated, with these values of the real inputs.
    ///
    /// # Panics
    /// If the FMU rejects the values.
    #[must_use]
    pub fn instance_with(&self, inputs: &[f64]) -> Instance {
        let mut instance = self.instance();
        ok(instance.set_real(&self.references(Causality::Input), inputs));
        instance
    }

    /// Variables of a causality.
    pub fn with(&self, causality: Causality) -> impl Iterator<Item = &Variable> {
        self.description.variables.iter().filter(move |variable| variable.causality == causality)
    }

    /// Value references of the real variables of a causality, in the order of the description.
    #[must_use]
    pub fn references(&self, causality: Causality) -> Vec<Reference> {
        self.with(causality).filter(|v| is_double(v)).map(|v| v.reference).collect()
    }

    /// The values of all outputs except Strings, in the order of the description, with Integers and Booleans as
    /// numbers.
    ///
    /// # Panics
    /// If the FMU returns an error.
    #[track_caller]
    #[must_use]
    pub fn outputs(&self, instance: &mut Instance) -> Vec<f64> {
        let mut values = Vec::new();
        for variable in self.with(Causality::Output) {
            let (reference, mut whole) = ([variable.reference], [0]);
            match variable.base_type {
                BaseType::Real => values.extend(reals(instance, &reference)),
                BaseType::Integer => {
                    ok(instance.get_integer(&reference, &mut whole));
                    values.push(f64::from(whole[0]));
                }
                BaseType::Boolean => {
                    ok(instance.get_boolean(&reference, &mut whole));
                    values.push(f64::from(whole[0]));
                }
                BaseType::String | BaseType::Binary => {}
            }
        }
        values
    }

    /// Value references of all real variables.
    #[must_use]
    pub fn reals(&self) -> Vec<Reference> {
        self.description.variables.iter().filter(|v| is_double(v)).map(|v| v.reference).collect()
    }

    /// Value reference of the variable with this name.
    ///
    /// # Panics
    /// If there is no variable with this name.
    #[must_use]
    pub fn reference(&self, name: &str) -> Reference {
        self.description.variable(name).unwrap_or_else(|| panic!("{} has no variable {name}", self.name)).reference
    }

    /// The continuous states: the variables whose derivatives are listed in the model structure.
    #[must_use]
    pub fn states(&self) -> Vec<&Variable> {
        let variables = &self.description.variables;
        self.description
            .derivatives
            .iter()
            .map(|unknown| &variables[variables[unknown.variable].derivative_of.expect("a derivative has a state")])
            .collect()
    }

    /// All combinations of values of Booleans and of Integers with few values. Combinations with which the FMU cannot
    /// be initialized are left out.
    #[must_use]
    pub fn configurations(&self) -> Vec<Configuration> {
        const FEW: f64 = 10.0;
        let mut all = vec![Configuration::default()];
        for variable in self.with(Causality::Parameter) {
            let values: Vec<i32> = match (variable.base_type, variable.min, variable.max) {
                (BaseType::Boolean, ..) => vec![0, 1],
                (BaseType::Integer, Some(min), Some(max)) if max - min < FEW => (min as i32..=max as i32).collect(),
                _ => continue,
            };
            all = all.iter().flat_map(|one| values.iter().map(|&value| one.with(variable, value))).collect();
        }
        all.retain(|one| {
            let mut instance = self.instance();
            one.set(&mut instance).is_ok()
                && instance.enter_initialization_mode().is_ok()
                && instance.exit_initialization_mode().is_ok()
        });
        all
    }
}

/// A combination of values of Integers and Booleans.
#[derive(Clone, Debug, Default)]
pub struct Configuration {
    /// Description for messages.
    pub name: String,
    integers: Vec<(Reference, i32)>,
    booleans: Vec<(Reference, i32)>,
}

impl Configuration {
    fn with(&self, variable: &Variable, value: i32) -> Self {
        let mut new = self.clone();
        new.name = format!("{} {}={value}", self.name, variable.name);
        let list = if variable.base_type == BaseType::Boolean { &mut new.booleans } else { &mut new.integers };
        list.push((variable.reference, value));
        new
    }

    /// Sets the Integers and Booleans.
    ///
    /// # Errors
    /// The FMU rejects a value, such as an Integer that is not a value of an enum.
    pub fn set(&self, instance: &mut Instance) -> Result<(), CallError> {
        for &(reference, value) in &self.integers {
            instance.set_integer(&[reference], &[value])?;
        }
        for &(reference, value) in &self.booleans {
            instance.set_boolean(&[reference], &[value])?;
        }
        Ok(())
    }
}

/// The result of a call that must succeed.
///
/// # Panics
/// If the call did not succeed; the message contains the FMU's messages.
#[track_caller]
pub fn ok<T>(result: Result<T, CallError>) -> T {
    match result {
        Ok(value) => value,
        Err(error) => panic!("{error}"),
    }
}

/// The message of a call that must be rejected with fmi2Error.
///
/// # Panics
/// If the call was not rejected, or was rejected with another status or without a message.
#[track_caller]
pub fn rejected<T>(result: Result<T, CallError>) -> String {
    match result {
        Err(error) if matches!(error.problem, CallProblem::Status(Status::Error) | CallProblem::NoInstance) => {
            let texts: Vec<_> = error.messages.iter().map(|message| message.text.as_str()).collect();
            assert!(!texts.is_empty(), "{}: {} returned fmi2Error without a message", error.instance, error.function);
            texts.join("\n")
        }
        Err(other) => panic!("expected fmi2Error, got: {other}"),
        Ok(_) => panic!("expected fmi2Error, but the call succeeded"),
    }
}

/// The values of real variables.
///
/// # Panics
/// If the FMU returns an error.
#[track_caller]
#[must_use]
pub fn reals(instance: &mut Instance, references: &[Reference]) -> Vec<f64> {
    let mut values = vec![f64::NAN; references.len()];
    ok(instance.get_real(references, &mut values));
    values
}

/// Returns true for a real number of 64 bits. Those of 32 bits do not have all values of the tests, and the importer rounds them.
#[must_use]
pub fn is_double(variable: &Variable) -> bool {
    variable.data_type == DataType::Float64
}

/// The value of a real variable.
///
/// # Panics
/// If there is no variable with this name, or the FMU returns an error.
#[track_caller]
#[must_use]
pub fn real(fmu: &Fmu, instance: &mut Instance, name: &str) -> f64 {
    reals(instance, &[fmu.reference(name)])[0]
}

/// The bits of numbers: equal only if the numbers are bit-identical.
#[must_use]
pub fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Returns true if a variable can be set only before the start.
#[must_use]
pub fn is_fixed(variable: &Variable) -> bool {
    variable.causality == Causality::Parameter && variable.variability == Variability::Fixed
}
