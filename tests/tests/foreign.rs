//! The exporter in a user's workspace, without this project's folders: `cargo fmu new`, `cargo test`, `cargo fmu pack`.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use fmu_import::archive::Archive;
use fmu_import::description::{Interface, ModelDescription};
use fmu_import::fmu::Fmu;
use fmu_import::loader::Instance;
use tempfile::TempDir;
use tests::workspace;

/// A folder with a space in its path. All tests share one target folder, so the exporter is compiled only once.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::Builder::new().prefix("some body's models ").tempdir().expect("a temporary folder");
        Self { folder }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn target() -> PathBuf {
        workspace().join("target/foreign")
    }

    fn run(&self, program: &Path, arguments: &[&str], environment: &[(&str, &str)], folder: &str) -> Output {
        let mut command = Command::new(program);
        command.current_dir(self.path().join(folder)).args(arguments).env("CARGO_TARGET_DIR", Self::target());
        command.env("CARGO_NET_OFFLINE", "true").env("CARGO_PROFILE_DEV_DEBUG", "none");
        command.envs(environment.iter().copied());
        let output = command.output().expect("the command runs");
        assert!(
            output.status.success(),
            "{} {arguments:?}\n{}{}",
            program.display(),
            String::from_utf8_lossy(&output.stdout),
            String::from_utf8_lossy(&output.stderr)
        );
        output
    }

    fn fmu(&self, arguments: &[&str]) -> Output {
        self.run(&tests::cargo_fmu(), arguments, &[], "")
    }

    fn cargo(&self, arguments: &[&str]) -> Output {
        let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
        self.run(Path::new(&cargo), arguments, &[], "")
    }

    fn write(&self, file: &str, text: &str) {
        let path = self.path().join(file);
        std::fs::create_dir_all(path.parent().expect("a file has a folder")).expect("a folder");
        std::fs::write(path, text).expect("a file");
    }

    /// Writes a package that depends on the exporter, as a user would.
    fn package(&self, name: &str, manifest: &str, source: &str) {
        let exporter = workspace().join("crates/fmu");
        let text = format!(
            "[package]\nname = \"{name}\"\nversion = \"1.2.3\"\nedition = \"2024\"\n{manifest}",
            manifest = manifest.replace("EXPORTER", &exporter.display().to_string())
        );
        self.write(&format!("{name}/Cargo.toml"), &text);
        self.write(&format!("{name}/src/lib.rs"), source);
    }

    /// The description and the archive of a packed FMU.
    fn packed(&self, name: &str) -> (ModelDescription, Archive) {
        let path = self.path().join(format!("out/{name}.fmu"));
        let mut archive = Archive::open(&path).unwrap_or_else(|error| panic!("{error}"));
        let text = archive.description_text().unwrap_or_else(|error| panic!("{error}"));
        (ModelDescription::parse(&text).unwrap_or_else(|error| panic!("{error}")), archive)
    }
}

const GAIN: &str = r#"//! A gain.
use fmu::prelude::*;

/// Parameters.
#[derive(Parameters)]
pub struct Widget {
    /// Gain (1)
    #[var(start = 2.0)]
    pub gain: f64,
}

/// Inputs.
#[derive(Inputs)]
pub struct U {
    /// Input (1)
    pub u: f64,
}

/// Outputs.
#[derive(Outputs)]
pub struct Y {
    /// Output (1)
    pub y: f64,
}

/// Gain
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Widget {
    type Inputs = U;
    type Outputs = Y;
    fn update(&self, sample: Sample<Self>) -> Y {
        Y { y: self.gain * sample.inputs.u }
    }
}
"#;

/// A package for each kind of model is written, tested, packed and checked with the commands that `new` prints.
#[test]
fn templates_of_all_kinds_work_outside_of_any_workspace() {
    let place = Place::new();
    let exporter = workspace().join("crates/fmu");
    let exporter = exporter.to_str().expect("the path is UTF-8");
    for kind in ["continuous", "discrete", "stateful"] {
        let name = format!("my-{kind}");
        place.fmu(&["new", &name, "--kind", kind, "--exporter-path", exporter]);
        let ignored = std::fs::read_to_string(place.path().join(&name).join(".gitignore"));
        assert_eq!(ignored.expect("a package of its own ignores its builds"), "/target\n");
        let manifest = format!("{name}/Cargo.toml");
        let output = place.cargo(&["test", "--quiet", "--lib", "--manifest-path", &manifest]);
        let report = String::from_utf8_lossy(&output.stdout);
        assert!(report.contains("test result: ok.") && !report.contains(" 0 passed"), "{report}");
        let inside = Command::new(tests::cargo_fmu())
            .current_dir(place.path().join(&name))
            .args(["pack", "--out", "../out"])
            .env("CARGO_TARGET_DIR", Place::target())
            .env("CARGO_NET_OFFLINE", "true")
            .output()
            .expect("the command runs");
        let messages = String::from_utf8_lossy(&inside.stderr);
        assert!(inside.status.success(), "{messages}");
        // The README is still the one from the template.
        assert!(messages.contains("shows: One paragraph: what the model computes, and what for."), "{messages}");
    }
    for fmu in ["MyContinuous", "MyDiscrete", "MyStateful"] {
        let output = place.fmu(&["check", &format!("out/{fmu}.fmu")]);
        let report = String::from_utf8_lossy(&output.stdout);
        assert!(report.contains("no error, no warning"), "{report}");
        let (description, mut archive) = place.packed(fmu);
        // The binary contains no path of the exporter, the package or the build.
        let unpacked = archive.unpack(&description, Interface::CoSimulation).unwrap_or_else(|error| panic!("{error}"));
        let bytes = std::fs::read(&unpacked.binary).expect("a library");
        for folder in [workspace().join("crates"), place.path().to_path_buf(), Place::target()] {
            let folder = folder.into_os_string().into_encoded_bytes();
            assert!(!bytes.windows(folder.len()).any(|window| window == folder), "{fmu} names a folder of its sources");
        }
        // Its documentation links to existing files only.
        let page = archive.entry("documentation/index.html").unwrap_or_else(|error| panic!("{error}"));
        let page = String::from_utf8(page.expect("a page")).expect("text");
        assert!(!page.contains("model.png") && !page.contains("reference.csv"), "{page}");
        // The FMU does not contain this project's authors, license or version.
        assert_eq!((description.author.as_deref(), description.license.as_deref()), (None, None), "{fmu}");
        assert_eq!(description.version.as_deref(), Some("0.1.0"), "{fmu}");
    }
}

/// The author in the manifest is written to the FMU. Type and package can have different names. Resources keep their
/// folders. The exporter's crate can be renamed. Two models can be linked into a third model. A target can be set for
/// the build.
#[test]
fn a_workspace_of_several_models_packs() {
    let place = Place::new();
    place.write("Cargo.toml", "[workspace]\nresolver = \"3\"\nmembers = [\"widget-maker\", \"renamed\", \"pair\"]\n");
    place.package(
        "widget-maker",
        "authors = [\"Ada\", \"Grace\"]\nlicense = \"ISC\"\n[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n[dependencies]\n\
         fmu = { path = \"EXPORTER\" }\n",
        GAIN,
    );
    place.write("widget-maker/LICENSE", "Permission to use is granted.\n");
    place.write("widget-maker/resources/tables/deep/values.csv", "1,2\n");
    let renamed = GAIN
        .replace("use fmu::prelude", "use exporter::prelude")
        .replace("#[derive(Parameters)]", "#[derive(Parameters)]\n#[fmu(crate = exporter)]")
        .replace("#[derive(Inputs)]", "#[derive(Inputs)]\n#[fmu(crate = exporter)]")
        .replace("#[derive(Outputs)]", "#[derive(Outputs)]\n#[fmu(crate = exporter)]")
        .replace("#[fmu::model(", "#[exporter::model(crate = exporter, ")
        .replace("Widget", "Renamed");
    place.package(
        "renamed",
        "[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n[dependencies]\nexporter = { package = \"fmu\", path = \"EXPORTER\" }\n",
        &renamed,
    );
    place.package(
        "pair",
        "[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n[dependencies]\nfmu = { path = \"EXPORTER\" }\n\
         widget-maker = { path = \"../widget-maker\" }\nrenamed = { path = \"../renamed\" }\n",
        &GAIN
            .replace(
                "Y { y: self.gain * sample.inputs.u }",
                "let inner = widget_maker::Widget { gain: self.gain };\n        \
                 let inputs = &widget_maker::U { u: sample.inputs.u };\n        \
                 let y = inner.update(Sample { time: sample.time, state: &mut (), inputs, derived: &() }).y;\n        \
                 Y { y: y + renamed::Renamed::default().gain }",
            )
            .replace("Widget {\n    ///", "Pair {\n    ///")
            .replace("for Widget", "for Pair"),
    );
    let host = Command::new("rustc").arg("-vV").output().expect("rustc runs").stdout;
    let host = String::from_utf8_lossy(&host).into_owned();
    let host = host.lines().find_map(|line| line.strip_prefix("host: ")).expect("rustc names its host");
    place.run(
        &tests::cargo_fmu(),
        &["pack", "--out", "out"],
        &[("CARGO_BUILD_TARGET", host), ("RUSTFLAGS", "--cfg mine")],
        "",
    );

    let (description, mut archive) = place.packed("Widget");
    assert_eq!(description.author.as_deref(), Some("Ada, Grace"));
    assert_eq!(description.license.as_deref(), Some("ISC"));
    assert_eq!(description.version.as_deref(), Some("1.2.3"));
    let unpacked = archive.unpack(&description, Interface::CoSimulation).unwrap_or_else(|error| panic!("{error}"));
    let table = std::fs::read_to_string(unpacked.resources.join("tables/deep/values.csv"));
    assert_eq!(table.expect("the resource is there"), "1,2\n");
    for fmu in ["Widget", "Renamed", "Pair"] {
        let output = place.fmu(&["check", &format!("out/{fmu}.fmu")]);
        let report = String::from_utf8_lossy(&output.stdout);
        assert!(report.contains("no error, no warning"), "{report}");
    }
}

/// Published crates contain their readme and licenses, and depend only on published crates of the workspace. The
/// packages of the crates that a model needs are complete: a model builds with them.
#[test]
fn a_model_builds_from_the_packaged_crates() {
    let place = Place::new();
    let target = place.path().join("packaged");
    let folder = target.to_str().expect("the path is UTF-8");
    let output = tests::successful(
        Command::new(tests::cargo())
            .args(["metadata", "--no-deps", "--offline", "--format-version", "1"])
            .current_dir(workspace()),
    );
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout).expect("cargo writes JSON");
    let members = metadata["packages"].as_array().expect("cargo lists packages");
    // `publish = false` is reported as an empty list of registries.
    let published = members.iter().filter(|member| member["publish"].is_null());
    let names: Vec<&str> = published.map(|member| member["name"].as_str().expect("a name")).collect();
    assert!(names.contains(&"fmu") && names.contains(&"cargo-fmu") && !names.contains(&"tests"), "{names:?}");
    let package = ["package", "--no-verify", "--allow-dirty", "--offline", "--target-dir", folder];
    let packages = names.iter().flat_map(|name| ["--package", name]);
    tests::successful(Command::new(tests::cargo()).args(package).args(packages).current_dir(workspace()));
    let version = env!("CARGO_PKG_VERSION");
    for name in names {
        let file = target.join(format!("package/{name}-{version}.crate"));
        tests::successful(Command::new("tar").arg("xzf").arg(&file).arg("-C").arg(place.path()));
        for text in ["README.md", "LICENSE-MIT", "LICENSE-APACHE"] {
            assert!(place.path().join(format!("{name}-{version}/{text}")).exists(), "{name}: {text} is missing");
        }
    }
    let manifest = "[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n[dependencies]\nfmu = { path = \"../fmu-VERSION\" }\n\
                    [patch.crates-io]\nfmu-derive = { path = \"../fmu-derive-VERSION\" }\n\
                    fmu-math = { path = \"../fmu-math-VERSION\" }\n[workspace]\n";
    place.package("from-crates", &manifest.replace("VERSION", version), &GAIN.replace("Widget", "FromCrates"));
    place.run(&tests::cargo_fmu(), &["pack", "--debug", "--out", "../out"], &[], "from-crates");
    let (description, _) = place.packed("FromCrates");
    assert_eq!(description.version.as_deref(), Some("1.2.3"));
}

/// A step can be too long for a stiff model. For x' = -1000 (x - cos t), Runge-Kutta steps of 2.5 ms are near the
/// stability limit of 2.785 ms, and cause errors of some percent at the start.
#[test]
fn a_step_that_is_too_long_is_reported() {
    let place = Place::new();
    let lib =
        "[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n[dependencies]\nfmu = { path = \"EXPORTER\" }\n[workspace]\n";
    place.package(
        "stiff",
        lib,
        r#"//! A stiff equation.
use fmu::prelude::*;

/// Parameters.
#[derive(Parameters)]
pub struct Stiff;

/// State.
#[derive(State)]
pub struct X<T> {
    /// Solution (1)
    #[var(nominal = 1.0)]
    x: T,
}

/// Stiff equation
#[fmu::model(stop_time = 0.1, step_size = 0.0025)]
impl Continuous for Stiff {
    type State<T: Scalar> = X<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        X { x: (at.state.x - at.time.cos()) * -1000.0 }
    }
}
"#,
    );
    place.run(&tests::cargo_fmu(), &["pack", "--debug", "--out", "../out"], &[], "stiff");
    let output = place.fmu(&["check", "out/Stiff.fmu"]);
    let report = String::from_utf8_lossy(&output.stdout);
    assert!(report.contains("no error, 1 warning"), "{report}");
    assert!(report.contains("variable `max_step`: in the default experiment `x` differs by"), "{report}");
}

/// Two errors that appear only in a run: a logarithm that becomes undefined during the default experiment, and time
/// events relative to 0 s instead of the start. Both FMUs are debug builds with symbols.
#[test]
fn mistakes_that_only_a_run_shows_are_reported() {
    const LATE: &str = r#"use fmu::prelude::*;

#[derive(Parameters)]
pub struct Late {
    /// Time after which the logarithm has no value (s)
    #[var("End_Time", start = 2.0)]
    end: f64,
}

#[derive(State)]
pub struct X<T> {
    /// Integral of the logarithm (1)
    integral: T,
}

/// Integral of ln(end - t)
#[fmu::model(stop_time = 4.0, step_size = 0.01)]
impl Continuous for Late {
    type State<T: Scalar> = X<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        X { integral: (-at.time + self.end).ln() }
    }
}
"#;
    const CLOCK: &str = r#"use fmu::prelude::*;

#[derive(Parameters)]
pub struct Clock {
    /// Time between two ticks (s)
    #[var(start = 60.0)]
    period: f64,
}

#[derive(State)]
pub struct X<T> {
    /// Mean of the ticks (1)
    mean: T,
}

#[derive(DiscreteState, Clone, Default)]
pub struct Ticks {
    count: i32,
}

/// Ticks
#[fmu::model(stop_time = 600.0, step_size = 1.0)]
impl Continuous for Clock {
    type State<T: Scalar> = X<T>;
    type DiscreteState = Ticks;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        X { mean: T::from(f64::from(at.discrete.count)) - at.state.mean }
    }
    fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
        Some(f64::from(at.discrete.count + 1) * self.period)
    }
    fn on_event(&self, event: Event<Self>) {
        event.discrete.count += 1;
    }
}
"#;
    let place = Place::new();
    let lib =
        "[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n[dependencies]\nfmu = { path = \"EXPORTER\" }\n[workspace]\n";
    let check = |package: &str, fmu: &str, model: &str| {
        place.package(package, lib, model);
        place.run(&tests::cargo_fmu(), &["pack", "--debug", "--out", "../out"], &[], package);
        let (description, mut archive) = place.packed(fmu);
        let unpacked = archive.unpack(&description, Interface::CoSimulation).unwrap_or_else(|error| panic!("{error}"));
        let library = std::fs::read(&unpacked.binary).expect("a library");
        assert!(library.windows(11).any(|window| window == b".debug_info"), "{fmu} has no symbols");
        let output = Command::new(tests::cargo_fmu())
            .args(["check", &format!("out/{fmu}.fmu")])
            .current_dir(place.path())
            .output()
            .expect("the command runs");
        (output.status.code(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let (code, report) = check("late", "Late", LATE);
    assert_eq!(code, Some(1), "{report}");
    let expected = "error: the default experiment: fails at 1.99 s of 4 s: fmi2DoStep returned fmi2Error \
                    (\"fmi2DoStep: 'integral' became -inf at 2 s;";
    assert!(report.contains(expected), "{report}");
    assert!(report.contains("it simulates: no") && report.contains("it follows the standard: yes"), "{report}");
    let (code, report) = check("clock", "Clock", CLOCK);
    assert_eq!(code, Some(0), "{report}");
    let expected = "warning: another start time: fails if started at 300 s, not if started at 0 s: fmi2ExitInitializationMode returned fmi2Error \
                    (\"fmi2ExitInitializationMode: `next_time_event` must not return a time before the present one, 300 s, got 60 s;";
    assert!(report.contains(expected), "{report}");
    let expected = "warning: model exchange: another start time: fails if started at 300 s";
    assert!(report.contains(expected), "{report}");
}

/// A branch on a real parameter hides variables that only the other side reads, because the model structure is
/// determined at the start value of the parameter; `check` also tries the limits of the parameter. `if_greater`, and a
/// product with the parameter, hide nothing.
#[test]
fn inputs_and_states_that_are_hidden_at_the_start_value_are_reported() {
    const MODEL: &str = r#"use fmu::prelude::*;

#[derive(Parameters)]
pub struct Hiding {
    /// Feedthrough (1)
    #[var(start = 0.0, min = 0.0, max = 4.0)]
    feedthrough: f64,
    /// Damping (1/s)
    #[var(start = 1.0, min = 0.5)]
    damping: f64,
    /// Leakage (1/s)
    #[var(start = 0.0, min = 0.0, max = 1.0)]
    leakage: f64,
}

#[derive(Inputs)]
pub struct U<T> {
    /// First input (1)
    first: T,
    /// Second input (1)
    second: T,
}

#[derive(State)]
pub struct X<T> {
    /// State (1)
    #[var(nominal = 1.0)]
    x: T,
    /// Hidden state (1)
    hidden: T,
}

#[derive(Outputs)]
pub struct Y<T> {
    /// Output (1)
    y: T,
    /// Slow part (1)
    slow: T,
    /// Product (1)
    product: T,
}

/// Hides inputs
#[fmu::model(stop_time = 1.0, step_size = 0.01)]
impl Continuous for Hiding {
    type Inputs<T: Scalar> = U<T>;
    type State<T: Scalar> = X<T>;
    type Outputs<T: Scalar> = Y<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        let push = if self.damping > 1.5 { at.inputs.second } else { T::from(0.0) };
        X { x: push - at.state.x * self.damping, hidden: -at.state.hidden }
    }
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        let through = if self.feedthrough > 0.0 { at.inputs.first } else { T::from(0.0) };
        let slow = if self.leakage > 0.5 { at.state.hidden } else { T::from(0.0) };
        Y { y: at.state.x + through, slow, product: at.state.x + at.inputs.first * self.leakage }
    }
}
"#;
    let place = Place::new();
    let manifest = "\n[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n\n[dependencies]\nfmu = { path = \"EXPORTER\" }\n";
    place.package("hiding", manifest, MODEL);
    let folder = place.path().join("hiding");
    let run = |arguments: &[&str]| {
        let output = Command::new(tests::cargo_fmu())
            .current_dir(&folder)
            .args(arguments)
            .env("CARGO_TARGET_DIR", Place::target())
            .env("CARGO_NET_OFFLINE", "true")
            .output()
            .expect("the command runs");
        (output.status.success(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    assert!(run(&["pack", "--debug", "--out", "../out"]).0);
    let (is_clean, report) = run(&["check", "../out/Hiding.fmu"]);
    assert!(!is_clean);
    let errors: Vec<&str> = report.lines().map(str::trim).filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(
        errors,
        [
            "error: variable `slow`: depends on `hidden`, which is missing from its dependencies in InitialUnknowns; \
             seen with `leakage` = 1",
            "error: variable `y`: depends on `first`, which is missing from its dependencies in Outputs; seen with \
             `feedthrough` = 4",
            "error: variable `der(x)`: depends on `second`, which is missing from its dependencies in Derivatives; \
             seen with `damping` = 2",
        ]
    );
}

/// The importer activates the clocks of an FMU in Event Mode, inside its steps. Reference: times and counts in closed
/// form.
#[test]
fn clocks_tick_inside_the_steps_of_the_importer() {
    const MODEL: &str = r#"use fmu::prelude::*;

#[derive(Parameters)]
pub struct Watch {
    /// Interval of the slow part (s)
    #[var(start = 0.25, positive, tunable)]
    slow_time: f64,
}

#[derive(Inputs)]
pub struct U {
    /// Reference (rad/s)
    #[var(clock = "control")]
    reference: f64,
    /// Time until the alarm (s)
    delay: f64,
}

#[derive(Outputs)]
pub struct Y {
    /// Voltage (V)
    #[var(clock = "control")]
    voltage: f64,
    /// Number of ticks of the slow part
    #[var(clock = "slow")]
    slow_ticks: i32,
    /// Time of the last alarm (s)
    alarm_time: f64,
    /// Time of the last pulse (s)
    #[var(clock = "pulse")]
    pulse_time: f64,
    /// Ticks when the voltage exceeds 1 V
    limit: Clock,
}

#[derive(DiscreteState, Clone, Default)]
pub struct X {
    integral: f64,
    pulses: u32,
}

/// Integrates a reference and watches it
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Watch {
    type Inputs = U;
    type Outputs = Y;
    type State = X;

    /// Integral control
    #[clock(interval = 1 / 10)]
    fn control(&self, mut tick: Tick<Self>) {
        tick.state.integral += tick.interval * tick.inputs.reference;
        tick.outputs.voltage = tick.state.integral;
        if tick.outputs.voltage > 1.0 {
            tick.outputs.limit.fire();
        }
        let delay = tick.inputs.delay.abs();
        tick.start(WatchClock::Watchdog, delay);
    }

    /// Slow part
    #[clock(interval_of = "slow_time", shift = 0.5)]
    fn slow(&self, tick: Tick<Self>) {
        tick.outputs.slow_ticks += 1;
    }

    /// Alarm
    #[clock(countdown)]
    fn watchdog(&self, tick: Tick<Self>) {
        tick.outputs.alarm_time = tick.time;
    }

    /// Pulses at 0.125, 0.375, 0.75, … s
    #[clock(changing, interval = 1 / 8)]
    fn pulse(&self, mut tick: Tick<Self>) {
        tick.state.pulses += 1;
        tick.outputs.pulse_time = tick.time;
        let next = 0.125 * f64::from(tick.state.pulses + 1);
        tick.start(WatchClock::Pulse, next);
    }
}
"#;
    let place = Place::new();
    let manifest = "\n[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n\n[dependencies]\nfmu = { path = \"EXPORTER\" }\n";
    place.package("watch", manifest, MODEL);
    place.run(&tests::cargo_fmu(), &["pack", "--fmi", "3", "--debug", "--out", "../out"], &[], "watch");
    let fmu = Fmu::open(place.path().join("out/Watch.fmu")).expect("it opens");
    let report = place.fmu(&["check", "out/Watch.fmu"]);
    let report = String::from_utf8_lossy(&report.stdout).into_owned();
    assert!(report.contains("it follows the standard: yes (no error, no warning)"), "{report}");

    let of = |name: &str| [fmu.description().variable(name).expect("a variable").reference];
    let start = || {
        let mut instance = fmu.instantiate("watch").expect("an instance");
        instance.setup_experiment(0.0, Some(1.0)).unwrap();
        instance.enter_initialization_mode().unwrap();
        instance.set_real(&of("reference"), &[3.0]).unwrap();
        instance.set_real(&of("delay"), &[0.03]).unwrap();
        instance.exit_initialization_mode().unwrap();
        instance
    };
    let outputs = |instance: &mut Instance| {
        let (mut reals, mut ticks) = ([0.0; 3], [0]);
        let [voltage, alarm, pulse] = ["voltage", "alarm_time", "pulse_time"].map(|name| of(name)[0]);
        instance.get_real(&[voltage, alarm, pulse], &mut reals).unwrap();
        instance.get_integer(&of("slow_ticks"), &mut ticks).unwrap();
        (reals, ticks[0])
    };
    for step in [0.005, 0.025, 0.1, 0.5] {
        let mut instance = start();
        let steps = (1.0_f64 / step).round() as i32;
        for number in 0..steps {
            instance.do_step(f64::from(number) * step, step).unwrap();
            // Ticks at the end of a step belong to the next one.
            let before = |tick: f64| tick < f64::from(number + 1) * step - 1e-9;
            let ticks = (0..10).filter(|tick| before(f64::from(*tick) / 10.0)).count();
            let last = |times: &[f64]| times.iter().copied().filter(|tick| before(*tick)).fold(0.0, f64::max);
            let alarms: Vec<f64> = (0..10).map(|tick| f64::from(tick) / 10.0 + 0.03).collect();
            let ([voltage, alarm, pulse], slow) = outputs(&mut instance);
            let time = f64::from(number + 1) * step;
            assert!((voltage - 0.3 * ticks as f64).abs() < 1e-12, "{voltage} V at {time} s");
            assert!((alarm - last(&alarms)).abs() < 1e-12, "alarm at {alarm} s, at {time} s");
            assert!((pulse - last(&[0.125, 0.375, 0.75])).abs() < 1e-12, "pulse at {pulse} s, at {time} s");
            assert_eq!(slow, [0.5, 0.75].into_iter().filter(|tick| before(*tick)).count() as i32, "at {time} s");
        }
    }

    // The slow part ticks at 0.5 s. Its next tick would be in the past, so it is due now, then at 0.65, 0.7 and 0.75 s.
    let mut instance = start();
    instance.do_step(0.0, 0.6).unwrap();
    instance.set_real(&of("slow_time"), &[0.05]).unwrap();
    instance.do_step(0.6, 0.2).unwrap();
    assert_eq!(outputs(&mut instance).1, 5);

    // An input that belongs to a clock is set at its next tick. A saved state contains the times of the ticks.
    let finish = |instance: &mut Instance| {
        instance.set_real(&of("reference"), &[-1.0]).unwrap();
        instance.do_step(0.35, 0.65).unwrap();
        outputs(instance)
    };
    let mut instance = start();
    instance.do_step(0.0, 0.35).unwrap();
    let saved = instance.save_state().unwrap();
    let bytes = instance.serialize_state(&saved).unwrap();
    let expected = finish(&mut instance);
    assert!((expected.0[0] - (4.0 * 0.3 - 6.0 * 0.1)).abs() < 1e-12, "{expected:?}");
    instance.restore_state(&saved).unwrap();
    assert_eq!(finish(&mut instance), expected);
    let mut other = start();
    let saved = other.deserialize_state(&bytes).unwrap();
    other.restore_state(&saved).unwrap();
    assert_eq!(finish(&mut other), expected);
}

/// A package without a model, and a package with contradictory settings, give messages with a remedy.
#[test]
fn packages_that_cannot_be_packed_are_reported() {
    let place = Place::new();
    let lib = "[lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n[dependencies]\nfmu = { path = \"EXPORTER\" }\n";
    let message = |package: &str| {
        let output = Command::new(tests::cargo_fmu())
            .current_dir(place.path().join(package))
            .args(["pack"])
            .env("CARGO_TARGET_DIR", Place::target())
            .env("CARGO_NET_OFFLINE", "true")
            .output()
            .expect("the command runs");
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).split_whitespace().collect::<Vec<_>>().join(" ")
    };
    place.package("empty", lib, "//! Nothing.\n");
    let empty = message("empty");
    assert!(empty.contains("the package exports no model") && empty.contains("#[fmu::model("), "{empty}");
    place.package("twice", lib, &GAIN.replace("pub u: f64", "#[var(\"gain\")]\n    pub u: f64"));
    let twice = message("twice");
    assert!(twice.contains("two variables of the model are named `gain`"), "{twice}");
    place.package("plain", "[dependencies]\nfmu = { path = \"EXPORTER\" }\n", "//! No dynamic library.\n");
    let plain = message("plain");
    assert!(plain.contains("crate-type = [\"cdylib\", \"rlib\"]"), "{plain}");
}
