//! Results of `cargo fmu pack` and `cargo fmu new`: the contents of every packed FMU, and packages from the templates.
//!
//! References: FMI 2.0.4, sections 2.3 (contents of the archive) and 2.2 (description), and the committed descriptions
//! in `modelDescription/`. All comparisons are exact.

use fmu_import::archive::{Archive, platform};
use fmu_import::description::{Causality, Interface, Variable};
use fmu_import::loader::description_options::{CO_SIMULATION, MODEL_EXCHANGE};
use fmu_import::loader::{Instance, exported_descriptions};
use object::{Architecture, BinaryFormat};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Cursor, Read as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use tests::{Fmu, all, folder, ok, paths, real, rejected, symbols, workspace};
use zip::{CompressionMethod, DateTime, ZipArchive};

/// Hint for a description that differs from the committed one.
const UPDATE: &str =
    "if the change of the interface is intended, run `cargo fmu pack --all --update-descriptions` and commit it";

/// An unpacked archive in memory.
struct Contents {
    /// Names in the order of the archive.
    names: Vec<String>,
    files: BTreeMap<String, Vec<u8>>,
}

impl Contents {
    /// Reads an archive and checks that its entries do not depend on the machine: they have no time and no file mode.
    #[track_caller]
    fn read(path: &Path) -> Self {
        let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut zip = ZipArchive::new(Cursor::new(bytes)).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut contents = Self { names: Vec::new(), files: BTreeMap::new() };
        for i in 0..zip.len() {
            let mut entry = zip.by_index(i).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
            let name = entry.name().expect("names are UTF-8").into_owned();
            let what = format!("{}: {name}", path.display());
            assert!(entry.is_file() && !entry.encrypted(), "{what} is no plain file");
            assert_eq!(entry.compression(), CompressionMethod::Deflated, "{what}: the method that all readers know");
            assert_eq!(entry.last_modified(), Some(DateTime::default()), "{what}: time");
            assert_eq!(entry.unix_mode().map(|mode| mode & 0o777), Some(0o644), "{what}: mode");
            let mut file = Vec::new();
            entry.read_to_end(&mut file).unwrap_or_else(|error| panic!("{}: {name}: {error}", path.display()));
            contents.names.push(name.clone());
            contents.files.insert(name, file);
        }
        contents
    }

    #[track_caller]
    fn text(&self, name: &str) -> &str {
        std::str::from_utf8(self.file(name)).expect("UTF-8")
    }

    #[track_caller]
    fn file(&self, name: &str) -> &[u8] {
        self.files.get(name).unwrap_or_else(|| panic!("there is no {name}, only {:?}", self.names))
    }
}

fn name_of(path: &Path) -> String {
    path.file_stem().and_then(|stem| stem.to_str()).expect("names are UTF-8").to_owned()
}

/// Name of the binary of this platform in the archive.
fn binary(name: &str) -> String {
    format!("binaries/{}/{name}{}", platform(), std::env::consts::DLL_SUFFIX)
}

/// The platforms that the FMUs were packed for, from `CHASSIS_FMU_PLATFORMS` (a list like for `--platforms`); `None`
/// for this platform only.
fn platforms() -> Option<String> {
    std::env::var("CHASSIS_FMU_PLATFORMS").ok().filter(|platforms| !platforms.is_empty())
}

#[test]
fn descriptions_are_the_committed_ones() {
    let folder = workspace().join("modelDescription");
    let mut committed = BTreeMap::new();
    for entry in std::fs::read_dir(&folder).expect("the folder is there") {
        let path = entry.expect("the folder can be read").path();
        if path.extension().is_some_and(|extension| extension == "xml") {
            committed.insert(name_of(&path), std::fs::read_to_string(&path).expect("the description can be read"));
        }
    }
    let mut differences = Vec::new();
    for path in paths() {
        let name = name_of(&path);
        match committed.remove(&name) {
            None => differences.push(format!("modelDescription/{name}.xml is missing")),
            Some(text) if text != Contents::read(&path).text("modelDescription.xml") => {
                differences.push(format!("{name} is not as in modelDescription/{name}.xml"));
            }
            Some(_) => (),
        }
    }
    // The committed descriptions that are left over belong to no FMU.
    differences.extend(committed.keys().map(|name| format!("there is no {name}.fmu: run `cargo fmu pack --all`")));
    assert!(differences.is_empty(), "{}\n{UPDATE}", differences.join("\n"));
}

#[test]
fn binaries_know_their_description_only() {
    for fmu in all() {
        let Fmu { name, description, library, .. } = &fmu;
        drop(fmu.instance());
        let mut other = description.guid.clone();
        let last = if other.ends_with("0}") { "1}" } else { "0}" };
        other.replace_range(other.len() - 2.., last);
        assert_ne!(other, description.guid);
        for guid in [other.as_str(), "", &description.guid.to_uppercase().replace('{', "")] {
            let message = rejected(Instance::instantiate(library, name, guid, false));
            assert!(message.contains(&description.guid), "{name}: the message names the expected GUID: {message}");
        }
        assert_eq!(description.model_name, *name);
        let unit = description.co_simulation.as_ref().expect("all are for co-simulation");
        assert_eq!(unit.model_identifier, *name, "the file stem of the binary");
    }
}

/// The packer builds the GUID into the library. Without it, the library would have to generate its description whenever
/// it is loaded.
#[test]
fn binaries_are_told_their_guid() {
    for path in paths() {
        let mut archive = Archive::open(&path).unwrap_or_else(|error| panic!("{error}"));
        let description = archive.description().unwrap_or_else(|error| panic!("{error}"));
        let unpacked = archive.unpack(&description, Interface::CoSimulation).unwrap_or_else(|error| panic!("{error}"));
        let descriptions = exported_descriptions(&unpacked.binary, 2, CO_SIMULATION | MODEL_EXCHANGE)
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(descriptions, [], "{}", path.display());
    }
}

#[test]
fn archives_hold_what_users_look_for() {
    let root = workspace();
    for path in paths() {
        let name = name_of(&path);
        let contents = Contents::read(&path);
        let (first, rest) = contents.names.split_first().expect("there are entries");
        assert_eq!(first, "modelDescription.xml", "{name}: readers expect it first");
        assert!(rest.is_sorted() && contents.files.len() == contents.names.len(), "{name}: {rest:?}");
        assert!(!contents.file(&binary(&name)).is_empty());
        for license in ["LICENSE-MIT", "LICENSE-APACHE"] {
            let text = std::fs::read(root.join(license)).expect("the license is there");
            assert!(contents.file(&format!("documentation/licenses/{license}.txt")) == text, "{name}: {license}");
        }
        let page = contents.text("documentation/index.html");
        assert!(page.starts_with("<!DOCTYPE html>"), "{name}: documentation/index.html");
        for variable in Fmu::open(&path).description.variables {
            if variable.causality != Causality::Independent {
                let cell = format!("<code>{}</code>", variable.name);
                assert!(page.contains(&cell), "{name}: {} is missing in the documentation", variable.name);
            }
        }
    }
}

#[test]
fn archives_have_one_binary_for_each_platform() {
    let wanted = platforms().unwrap_or_else(|| platform().to_owned());
    let mut wanted: Vec<_> = wanted.split(',').collect();
    wanted.sort_unstable();
    for path in paths() {
        let contents = Contents::read(&path);
        let binaries: Vec<_> = contents.names.iter().filter(|name| name.starts_with("binaries/")).cloned().collect();
        let expected: Vec<_> = wanted
            .iter()
            .map(|platform| {
                let suffix = if platform.starts_with("win") { ".dll" } else { std::env::consts::DLL_SUFFIX };
                format!("binaries/{platform}/{}{suffix}", name_of(&path))
            })
            .collect();
        assert_eq!(binaries, expected, "{}", path.display());
    }
}

#[test]
fn libraries_export_the_interface_only() {
    // Libraries export only FMI functions: other symbols could collide in a process, and the description is for the
    // packer only.
    for path in paths() {
        let contents = Contents::read(&path);
        for (name, library) in contents.files.iter().filter(|(name, _)| name.starts_with("binaries/")) {
            let exported = symbols::exported(library);
            let others: Vec<_> =
                exported.iter().filter(|symbol| !symbol.trim_start_matches('_').starts_with("fmi2")).collect();
            assert!(others.is_empty(), "{name} exports {others:?}");
            assert!(exported.iter().any(|symbol| symbol.ends_with("fmi2DoStep")), "{name} exports {exported:?}");
        }
    }
}

/// The last digits of functions in the C library depend on the platform and even on the processor, so FMUs must not
/// call them.
#[test]
fn libraries_call_no_inexact_function_of_the_c_library() {
    for path in paths() {
        let contents = Contents::read(&path);
        for (name, library) in contents.files.iter().filter(|(name, _)| name.starts_with("binaries/")) {
            let imported = symbols::imported(library);
            assert!(imported.iter().any(|function| function.contains("mem")), "{name} imports {imported:?}");
            let inexact: Vec<_> = imported.iter().filter(|function| symbols::is_inexact(function)).collect();
            assert!(inexact.is_empty(), "{name} calls {inexact:?}: use the functions of `Scalar` and `fmu::math`");
        }
    }
}

/// The libraries for Windows load on Windows 7 and later, because they require only libraries that are part of Windows.
#[test]
fn libraries_for_windows_need_the_system_only() {
    const SYSTEM: [&str; 6] = ["advapi32.dll", "kernel32.dll", "msvcrt.dll", "ntdll.dll", "userenv.dll", "ws2_32.dll"];
    let packed = platforms().is_some_and(|platforms| platforms.split(',').any(|platform| platform == "win64"));
    for path in paths() {
        let name = name_of(&path);
        let contents = Contents::read(&path);
        let Some(library) = contents.files.get(&format!("binaries/win64/{name}.dll")) else {
            assert!(!packed, "{name} has no binary for win64");
            continue;
        };
        let needed = symbols::imported_libraries(library);
        println!("{name}: {} kB, needs {needed:?}", library.len() / 1000);
        let others: Vec<_> = needed.iter().filter(|library| !SYSTEM.contains(&library.as_str())).collect();
        assert!(others.is_empty() && !needed.is_empty(), "{name} needs {needed:?}");
    }
}

/// FMUs must load on distributions with glibc 2.17, the oldest version that Rust supports, and newer.
#[cfg(target_os = "linux")]
#[test]
fn libraries_need_an_old_c_library_only() {
    for path in paths() {
        let name = name_of(&path);
        let contents = Contents::read(&path);
        assert!(contents.files.contains_key(&binary(&name)));
        for (file, library) in contents.files.iter().filter(|(file, _)| file.ends_with(".so")) {
            let newest = symbols::newest_glibc(library).expect("a 64-bit ELF library");
            println!("{name}: {file} needs glibc {newest:?}");
            // A library without a version would not be linked with glibc at all.
            let fits = newest.is_some_and(|version| version <= (2, 17));
            assert!(fits, "{name}: {file} needs glibc {newest:?}: pack it without `--no-portable`");
        }
    }
}

#[test]
fn libraries_are_for_the_platform_of_their_folder() {
    for path in paths() {
        for (file, library) in Contents::read(&path).files.iter().filter(|(file, _)| file.starts_with("binaries/")) {
            let platform = file.split('/').nth(1).expect("a folder");
            let expected = match platform {
                "linux64" | "x86_64-linux" => (BinaryFormat::Elf, Architecture::X86_64),
                "win64" | "x86_64-windows" => (BinaryFormat::Pe, Architecture::X86_64),
                "aarch64-linux" => (BinaryFormat::Elf, Architecture::Aarch64),
                "x86_64-darwin" => (BinaryFormat::MachO, Architecture::X86_64),
                "aarch64-darwin" => (BinaryFormat::MachO, Architecture::Aarch64),
                // FMI 2.0 has one folder for both processors.
                "darwin64" => (BinaryFormat::MachO, symbols::format(library).1),
                _ => panic!("{}: no platform has the folder {platform}", path.display()),
            };
            assert_eq!(symbols::format(library), expected, "{}: {file}", path.display());
        }
    }
}

/// Paths of the packing machine would reveal who built an FMU, and would make its bytes depend on the machine.
#[test]
fn nothing_names_the_machine_that_packed() {
    let variables =
        ["CARGO_HOME", "RUSTUP_HOME", "CARGO_TARGET_DIR"].map(|name| std::env::var_os(name).map(Into::into));
    let places = [Some(workspace()), std::env::home_dir(), Some(std::env::temp_dir())].into_iter().chain(variables);
    // The test searches for paths with a separator at the end, because "/root" alone can also be the start of other
    // words. The root of the file system is left out, because it reveals nothing.
    let folders = places.flatten().filter(|folder: &PathBuf| folder.is_absolute() && folder.parent().is_some());
    let folders: Vec<_> = folders.map(|folder| folder.join("").into_os_string().into_encoded_bytes()).collect();
    for path in paths() {
        for (file, bytes) in Contents::read(&path).files {
            for folder in &folders {
                let found = bytes.windows(folder.len()).position(|window| window == folder);
                if let Some(at) = found {
                    let text = String::from_utf8_lossy(&bytes[at..bytes.len().min(at + 120)]);
                    panic!("{}: {file} contains {text}", name_of(&path));
                }
            }
        }
    }
}

/// A copy of the workspace to write packages into. It has a fixed path, and its files keep their times, so cargo
/// compiles the dependencies of the templates only once. The copy is removed at the end, but the build stays in
/// `target`.
struct Copy {
    root: PathBuf,
    target: PathBuf,
    /// Locked while the copy is in use, because all processes use the same path.
    _lock: File,
}

impl Copy {
    fn new() -> Self {
        let place = Path::new(env!("CARGO_TARGET_TMPDIR")).join("templates");
        std::fs::create_dir_all(&place).expect("the folder can be made");
        let lock = File::create(place.join("lock")).expect("the folder can be written");
        lock.lock().expect("files can be locked");
        let copy = Self { root: place.join("workspace"), target: place.join("target"), _lock: lock };
        copy.remove();
        let from = workspace();
        for entry in [
            "Cargo.toml",
            "Cargo.lock",
            "LICENSE-MIT",
            "LICENSE-APACHE",
            "crates",
            "docs/guide",
            "examples",
            "fmu-plant",
            "fmu-controllers",
            "python/Cargo.toml",
            "python/src",
            "tests",
        ] {
            copy_times(&from.join(entry), &copy.root.join(entry)).unwrap_or_else(|error| panic!("{entry}: {error}"));
        }
        copy
    }

    fn remove(&self) {
        if self.root.exists() {
            std::fs::remove_dir_all(&self.root).expect("the copy can be removed");
        }
    }

    /// Runs a command in the copy; it must succeed.
    fn command(&self, program: impl AsRef<std::ffi::OsStr>, arguments: &[&str]) -> Output {
        tests::successful(&mut self.prepared(program, arguments))
    }

    fn prepared(&self, program: impl AsRef<std::ffi::OsStr>, arguments: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(&self.root).env("CARGO_TARGET_DIR", &self.target).env("NO_COLOR", "1");
        // The linker zig is in the workspace's `.venv`, which is not part of the copy.
        let path = std::env::var_os("PATH").unwrap_or_default();
        let folders = std::iter::once(workspace().join(".venv/bin")).chain(std::env::split_paths(&path));
        command.env("PATH", std::env::join_paths(folders).expect("folders of the PATH have no separators"));
        // Without debug information, builds take less time and space.
        command.env("CARGO_PROFILE_DEV_DEBUG", "none").env("CARGO_INCREMENTAL", "0");
        command
    }

    fn fmu(&self, name: &str) -> PathBuf {
        self.target.join("fmu").join(format!("{name}.fmu"))
    }
}

impl Drop for Copy {
    fn drop(&mut self) {
        self.remove();
    }
}

fn copy_times(from: &Path, to: &Path) -> std::io::Result<()> {
    if from.is_dir() {
        std::fs::create_dir_all(to)?;
        for entry in std::fs::read_dir(from)? {
            let name = entry?.file_name();
            copy_times(&from.join(&name), &to.join(&name))?;
        }
        return Ok(());
    }
    std::fs::create_dir_all(to.parent().expect("files lie in folders"))?;
    std::fs::copy(from, to)?;
    File::options().write(true).open(to)?.set_modified(from.metadata()?.modified()?)
}

#[test]
fn packages_from_the_templates_pass_their_tests_and_pack() {
    let cargo_fmu = tests::cargo_fmu();
    let copy = Copy::new();
    let fmu = |arguments: &[&str]| copy.command(&cargo_fmu, &[&["fmu"], arguments].concat());
    fmu(&["new", "yaw-damper", "--kind", "discrete"]);
    fmu(&["new", "bouncing-body", "--kind", "continuous"]);

    let packages = ["--package", "yaw-damper", "--package", "bouncing-body"];
    let output =
        copy.command(tests::cargo(), &[&["test", "--offline", "--locked", "--quiet", "--lib"][..], &packages].concat());
    let report = String::from_utf8_lossy(&output.stdout);
    let passed = report.matches("test result: ok.").count();
    assert!(passed == 2 && !report.contains(" 0 passed"), "both packages have tests: {report}");

    let platforms = platforms().map(|platforms| format!("--platforms={platforms}"));
    let pack = |more: &[&str]| {
        let platforms = platforms.as_deref();
        let arguments = ["pack", "YawDamper", "bouncing-body", "SuspensionMixer"].into_iter().chain(platforms);
        let output = fmu(&arguments.chain(more.iter().copied()).collect::<Vec<_>>());
        let names = ["YawDamper", "BouncingBody", "SuspensionMixer"];
        (names.map(|name| std::fs::read(copy.fmu(name)).expect("it was packed")), output)
    };
    let (first, output) = pack(&[]);
    let hint = String::from_utf8_lossy(&output.stderr);
    assert!(hint.contains("cargo fmu pack --update-descriptions"), "new interfaces are not committed yet: {hint}");
    let (second, output) = pack(&["--update-descriptions"]);
    assert!(first == second, "packing again gives the same bytes");
    let hint = String::from_utf8_lossy(&output.stderr);
    assert!(!hint.contains("--update-descriptions"), "now they are: {hint}");
    // The path of the sources does not matter either: an FMU packed from the workspace itself has the same files, plus
    // the commit if the workspace is a checkout. FMUs in another folder are compared only if their platforms are
    // listed, because otherwise they come from another machine.
    if std::env::var_os("CHASSIS_FMU_DIR").is_none() || platforms.is_some() {
        let mut other = Contents::read(&folder().join("SuspensionMixer.fmu"));
        let commit = other.files.remove("extra/io.github.chassis-fmu/commit.txt");
        assert_eq!(commit.is_some(), workspace().join(".git").exists(), "a commit");
        let copied = Contents::read(&copy.fmu("SuspensionMixer"));
        assert!(copied.files == other.files, "SuspensionMixer.fmu differs from a new one: run `cargo fmu pack --all`");
    }

    let controller = Fmu::open(&copy.fmu("YawDamper"));
    let committed = std::fs::read_to_string(copy.root.join("modelDescription/YawDamper.xml"));
    assert_eq!(committed.expect("it was written"), controller.xml);
    let mut instance = controller.started();
    ok(instance.set_real(&[controller.reference("reference")], &[0.5]));
    ok(instance.do_step(0.0, 0.01));
    // The command is the proportional gain 2 times the error 0.5, because nothing has been integrated before the first
    // sample.
    assert_eq!(real(&controller, &mut instance, "command"), 2.0 * 0.5);

    let plant = Fmu::open(&copy.fmu("BouncingBody"));
    let mut instance = plant.started();
    ok(instance.set_real(&[plant.reference("f")], &[1.0]));
    let (step, steps) = (0.01, 5000);
    for k in 0..steps {
        ok(instance.do_step(f64::from(k) * step, step));
    }
    // A mass of 1 kg on a spring of 10 N/m with a damping of 0.5 N s/m oscillates about F/k. The amplitude, below 0.1 m
    // at first, decays with exp(-c t/(2 m)). The error of the Runge-Kutta method with steps of 10 ms is far smaller.
    let bound = 0.1 * (-0.25 * f64::from(steps) * step).exp();
    let position = real(&plant, &mut instance, "x");
    assert!((position - 0.1).abs() <= bound, "position {position}, expected 0.1 within {bound:e}");
}

/// Functions that belong to one interface only, from the tables of the calling sequence in FMI 2.0.4, sections 3.2.3
/// and 4.2.4.
const CO_SIMULATION_ONLY: [&str; 9] = [
    "fmi2CancelStep",
    "fmi2DoStep",
    "fmi2GetBooleanStatus",
    "fmi2GetIntegerStatus",
    "fmi2GetRealOutputDerivatives",
    "fmi2GetRealStatus",
    "fmi2GetStatus",
    "fmi2GetStringStatus",
    "fmi2SetRealInputDerivatives",
];
const MODEL_EXCHANGE_ONLY: [&str; 10] = [
    "fmi2CompletedIntegratorStep",
    "fmi2EnterContinuousTimeMode",
    "fmi2EnterEventMode",
    "fmi2GetContinuousStates",
    "fmi2GetDerivatives",
    "fmi2GetEventIndicators",
    "fmi2GetNominalsOfContinuousStates",
    "fmi2NewDiscreteStates",
    "fmi2SetContinuousStates",
    "fmi2SetTime",
];

/// `--interfaces` determines the exported functions and the declared interfaces, `--arrays` whether variables are
/// arrays.
#[test]
fn formats_have_what_their_options_say() {
    let cargo_fmu = tests::cargo_fmu();
    let copy = Copy::new();
    let pack = |name: &str, options: &[&str]| {
        let arguments =
            [&["fmu", "pack", "--no-portable", "--debug", "--out", "target/formats", name], options].concat();
        copy.command(&cargo_fmu, &arguments);
        let path = copy.root.join(format!("target/formats/{name}.fmu"));
        // With 400 states, the check of a debug build takes minutes. `python/tests/test_fmi3.py` checks this FMU.
        if name == "HeatExchanger" {
            return path;
        }
        let output = copy.command(&cargo_fmu, &["fmu", "check", path.to_str().expect("UTF-8")]);
        let findings = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(findings.contains(": no error, no warning"), "{options:?}: {findings}");
        path
    };
    for (interfaces, has_cs, has_me) in [("cs", true, false), ("me", false, true)] {
        let contents = Contents::read(&pack("BouncingBall", &["--interfaces", interfaces]));
        let exported = symbols::exported(contents.file(&binary("BouncingBall")));
        let xml = contents.text("modelDescription.xml");
        for (element, functions, is_wanted) in
            [("<CoSimulation", &CO_SIMULATION_ONLY[..], has_cs), ("<ModelExchange", &MODEL_EXCHANGE_ONLY[..], has_me)]
        {
            assert_eq!(xml.matches(element).count(), usize::from(is_wanted), "{interfaces}: {element}");
            for function in functions {
                // macOS prefixes every name with an underscore.
                let is_there = exported.iter().any(|name| name.strip_prefix('_').unwrap_or(name) == *function);
                assert_eq!(is_there, is_wanted, "{interfaces}: {function} in {exported:?}");
            }
        }
    }

    // The description, and whether there are terminals.
    let packed = |name: &str, options: &[&str]| {
        let path = pack(name, &[&["--fmi", "3"], options].concat());
        let contents = Contents::read(&path);
        let terminals = contents.text("terminalsAndIcons/terminalsAndIcons.xml");
        (Fmu::open(&path).description.variables, terminals.contains("<Terminal "))
    };
    let (arrays, _) = packed("HeatExchanger", &["--arrays"]);
    let (scalars, _) = packed("HeatExchanger", &[]);
    assert!(arrays.iter().any(Variable::is_array) && !scalars.iter().any(Variable::is_array));
    let elements: usize = arrays.iter().map(|variable| variable.size).sum();
    assert_eq!(elements, scalars.len(), "the same variables, one for each element");
    // Elements with names are variables in both formats, and belong to terminals.
    for options in [&[][..], &["--arrays"]] {
        let (variables, has_terminals) = packed("SuspensionMixer", options);
        assert!(!variables.iter().any(Variable::is_array) && has_terminals, "{options:?}");
    }

    // Two calls at once: each gets the library of its version, although cargo has one place for both.
    let mut both = ["2", "3"].map(|version| {
        let arguments = ["fmu", "pack", "--no-portable", "--debug", "SuspensionMixer", "--fmi", version];
        let mut command = copy.prepared(&cargo_fmu, &arguments);
        command.args(["--out", &format!("target/at_once_{version}")]);
        command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the command starts")
    });
    for call in &mut both {
        let mut messages = String::new();
        call.stderr.take().expect("it is piped").read_to_string(&mut messages).expect("messages are UTF-8");
        assert!(call.wait().expect("the command ends").success(), "{messages}");
    }
}

/// `chassis pack SCENARIO`, as `scripts/run` calls it: a package that does not compile affects only scenarios that need
/// it, and up-to-date FMUs are not reported.
#[test]
fn a_broken_package_blocks_only_what_needs_it() {
    let chassis = tests::chassis();
    let copy = Copy::new();
    std::fs::write(copy.root.join("fmu-plant/road/src/lib.rs"), "this is not Rust").expect("it can be written");
    // Descriptions with other interfaces than the committed ones would be reported.
    let descriptions = "modelDescription";
    copy_times(&workspace().join(descriptions), &copy.root.join(descriptions)).expect("it can be copied");
    let scenario = |name: &str, fmus: [&str; 2]| {
        let components: Vec<String> = fmus
            .iter()
            .enumerate()
            .map(|(i, fmu)| format!("[[component]]\nname = \"u{i}\"\nfmu = \"{fmu}\"\n"))
            .collect();
        let text = format!(
            "title = \"T\"\n[simulation]\nstop = 1.0\nstep = 0.1\n{}[[case]]\nname = \"a\"\ntitle = \"A\"\n[record]\nsignals = [\"*\"]\n",
            components.join("")
        );
        std::fs::write(copy.root.join(name), text).expect("it can be written");
    };
    // One of the FMUs is not from this workspace.
    scenario("fine.toml", ["FuzzyCoordination", "FromElsewhere"]);
    scenario("elsewhere.toml", ["FromElsewhere", "FromThere"]);
    scenario("broken.toml", ["FuzzyCoordination", "Road"]);
    std::fs::write(copy.root.join("study.toml"), "scenario = \"fine.toml\"\n").expect("it can be written");
    if copy.fmu("FuzzyCoordination").exists() {
        std::fs::remove_file(copy.fmu("FuzzyCoordination")).expect("it can be removed");
    }
    let pack = |file: &str| {
        let mut command = copy.prepared(&chassis, &["pack", file]);
        let output = command.env("CARGO_TERM_QUIET", "true").output().expect("it starts");
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        (output.status.success(), text(&output.stdout), text(&output.stderr))
    };
    let (is_fine, packed, messages) = pack("fine.toml");
    assert!(is_fine, "{messages}");
    assert!(packed.lines().count() == 1 && packed.contains("FuzzyCoordination.fmu"), "{packed}");
    assert!(messages.starts_with("Building FuzzyCoordination; "), "{messages}");
    assert_eq!(pack("fine.toml"), (true, String::new(), String::new()), "nothing to do, nothing to tell");
    assert_eq!(pack("elsewhere.toml"), (true, String::new(), String::new()));
    let (is_fine, _, messages) = pack("broken.toml");
    assert!(!is_fine && messages.contains("fmu-plant/road/src/lib.rs"), "{messages}");
    // An incomplete study gives the message of `chassis study`.
    let (is_fine, _, messages) = pack("study.toml");
    assert!(!is_fine && messages.contains("study.toml") && messages.contains("missing key `title`"), "{messages}");
}
