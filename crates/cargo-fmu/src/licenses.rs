//! `documentation/licenses` of an FMU: the license of the model, and the notices of everything linked into its libraries.
//!
//! FMI 2.0.1 added the folder; `license.txt` is its entry point (FMI 2.0.4, section 2.3). The list of linked crates comes
//! from `cargo tree`, with the features of this build. The texts come from the crates' sources, which are on the disk because
//! they have just been compiled. So nothing has to be installed or downloaded, and the versions are those of Cargo.lock.
//! `cargo tree` leaves out the crates that `-Z build-std` compiles into the standard library; the messages of the build
//! list those.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use miette::{IntoDiagnostic, Result, WrapErr, miette};
use serde::Deserialize;

use crate::build::{Builder, Options, name_and_version};
use crate::platform::Platform;
use crate::toolchain::Toolchain;
use crate::toolchain::cargo;
use crate::workspace::{Model, Workspace};

/// Entry point of the folder.
const ENTRY: &str = "license.txt";
const NOTICES: &str = "third-party-notices.txt";
/// Beginnings of license file names, in upper or lower case.
const BEGINNINGS: [&str; 6] = ["license", "licence", "copying", "copyright", "notice", "unlicense"];

/// A crate, or a part of a toolchain, that is linked into a library.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Component {
    name: String,
    /// Empty for parts of a toolchain, which have its version.
    version: String,
    /// An SPDX expression; empty if none is declared.
    license: String,
    /// Address of the published sources.
    source: String,
    /// True for a member of the workspace.
    is_member: bool,
    /// File names and contents.
    texts: Vec<(String, String)>,
}

impl Component {
    fn title(&self) -> String {
        if self.version.is_empty() { self.name.clone() } else { format!("{} {}", self.name, self.version) }
    }
}

/// Parts of toolchains. Their notices are kept here because not every installation has them.
fn toolchain(builder: &Builder) -> Vec<Component> {
    let part = |name: &str, license: &str, source: &str, text: &str| Component {
        name: name.to_owned(),
        version: String::new(),
        license: license.to_owned(),
        source: source.to_owned(),
        is_member: false,
        texts: vec![("notices".to_owned(), text.to_owned())],
    };
    let mut parts = vec![part(
        "Rust standard library",
        "MIT OR Apache-2.0, parts under other licenses",
        "https://github.com/rust-lang/rust",
        include_str!("notices/rust-standard-library.txt"),
    )];
    let gcc = part(
        "libgcc",
        "GPL-3.0-or-later WITH GCC-exception-3.1",
        "https://gcc.gnu.org",
        include_str!("notices/gcc.txt"),
    );
    match builder {
        Builder::Native(Platform::Linux64 | Platform::Aarch64Linux) => parts.push(gcc),
        // Other libraries they link belong to the system; WebAssembly links none.
        Builder::Native(_) | Builder::Wasm32(_) => {}
        Builder::Portable(_) => parts.push(part(
            "zig: compiler_rt, libunwind, start-up code of glibc",
            "MIT, Apache-2.0 WITH LLVM-exception, LGPL-2.1-or-later with an exception",
            "https://ziglang.org",
            include_str!("notices/zig.txt"),
        )),
        Builder::Win64(_) => parts.extend([
            gcc,
            part(
                "mingw-w64 runtime",
                "ZPL-2.1, parts under other licenses",
                "https://www.mingw-w64.org",
                include_str!("notices/mingw-w64.txt"),
            ),
        ]),
    }
    parts
}

/// Packages linked into the library of each model, the model itself first.
///
/// `messages` are those of the build in JSON.
///
/// # Errors
/// Cargo does not list the dependencies, or a file cannot be read.
pub(crate) fn components(
    builder: &Builder,
    workspace: &Workspace,
    models: &[Model],
    options: &Options,
    messages: &str,
) -> Result<Vec<Vec<Component>>> {
    let messages = read(messages)?;
    let folders = folders(&messages);
    let of_std = standard_library(&messages)?;
    let mut known: BTreeMap<String, Component> = BTreeMap::new();
    let mut trees: BTreeMap<String, Vec<Component>> = BTreeMap::new();
    let mut model = String::new();
    for line in tree(builder, workspace, models, options)?.lines().filter(|line| !line.is_empty()) {
        let package = Package::parse(line).ok_or_else(|| miette!("`cargo tree` printed an unknown line: {line}"))?;
        let component = match known.get(line.trim_start_matches(|c: char| c.is_ascii_digit())) {
            Some(component) => component.clone(),
            None => {
                let component = package.component(workspace, &folders)?;
                let key = line.trim_start_matches(|c: char| c.is_ascii_digit()).to_owned();
                known.insert(key, component.clone());
                component
            }
        };
        if package.depth == 0 {
            model = package.name.to_owned();
        }
        let components = trees.entry(model.clone()).or_default();
        if !components.contains(&component) {
            components.push(component);
        }
    }
    let all = known.values().chain(&of_std);
    for component in all.filter(|component| component.texts.is_empty() && !component.is_member) {
        eprintln!(
            "warning: {} has no license file in its sources; the FMUs only name its license: {}",
            component.title(),
            if component.license.is_empty() { "none is declared" } else { &component.license }
        );
    }
    let of = |model: &Model| {
        let mut components = trees.get(&model.package).cloned().unwrap_or_default();
        if components.is_empty() {
            return Err(miette!("`cargo tree` does not list {}", model.package));
        }
        components.extend(of_std.iter().cloned());
        components.extend(toolchain(builder));
        Ok(components)
    };
    models.iter().map(of).collect()
}

/// The packages that are linked, one per line with the depth in front, a tree for each model.
fn tree(builder: &Builder, workspace: &Workspace, models: &[Model], options: &Options) -> Result<String> {
    let mut command = builder.toolchain().map_or_else(cargo, Toolchain::cargo);
    command.args(["tree", "--prefix", "depth", "--no-dedupe", "--edges", "normal,no-proc-macro"]);
    command.args(["--format", "{p}\t{l}\t{r}"]);
    if builder.platform() != Platform::this()? || matches!(builder, Builder::Portable(_)) {
        command.args(["--target", builder.platform().target()]);
    }
    options.apply(&mut command);
    for model in models {
        command.args(["--package", &model.package]);
    }
    let output = command.current_dir(&workspace.root).output().into_diagnostic().wrap_err("cargo cannot be run")?;
    if !output.status.success() {
        return Err(miette!("cargo tree failed:\n{}", String::from_utf8_lossy(&output.stderr).trim()));
    }
    String::from_utf8(output.stdout).into_diagnostic().wrap_err("reading the output of cargo tree")
}

/// A line of `cargo tree`: `2libm v0.2.16<tab>MIT<tab>https://…`, with the folder after the version of a local package.
#[derive(Debug, PartialEq, Eq)]
struct Package<'a> {
    depth: usize,
    name: &'a str,
    version: &'a str,
    license: &'a str,
    source: &'a str,
}

impl<'a> Package<'a> {
    fn parse(line: &'a str) -> Option<Self> {
        let (depth, rest) = line.split_at(line.find(|c: char| !c.is_ascii_digit())?);
        let mut columns = rest.split('\t');
        let mut words = columns.next()?.split(' ');
        let (name, version) = (words.next()?, words.next()?.strip_prefix('v')?);
        Some(Self { depth: depth.parse().ok()?, name, version, license: columns.next()?, source: columns.next()? })
    }

    fn component(&self, workspace: &Workspace, folders: &Folders) -> Result<Component> {
        let (folder, is_local) = folders
            .get(&(self.name.to_owned(), self.version.to_owned()))
            .ok_or_else(|| miette!("cargo did not say where {} {} is", self.name, self.version))?;
        let is_member = *is_local && folder.starts_with(&workspace.root);
        let texts = texts(folder, *is_local).wrap_err_with(|| format!("reading the licenses of {}", self.name))?;
        Ok(Component {
            name: self.name.to_owned(),
            version: self.version.to_owned(),
            license: self.license.replace('/', " OR "),
            source: self.source.to_owned(),
            is_member,
            texts,
        })
    }
}

/// The fields used of a message of cargo.
#[derive(Deserialize)]
struct Message {
    package_id: Option<String>,
    manifest_path: Option<PathBuf>,
    #[serde(default)]
    features: Vec<String>,
    target: Option<Target>,
}

#[derive(Deserialize)]
struct Target {
    kind: Vec<String>,
}

impl Message {
    /// Name, version and folder of the package that was compiled.
    fn package(&self) -> Option<((String, String), &Path)> {
        Some((name_and_version(self.package_id.as_ref()?)?, self.manifest_path.as_ref()?.parent()?))
    }

    /// True for sources in the workspace or the toolchain, that is, neither from a registry nor from git.
    fn is_local(&self) -> bool {
        self.package_id.as_ref().is_some_and(|id| id.starts_with("path+"))
    }
}

/// The messages of a build, one per line.
fn read(messages: &str) -> Result<Vec<Message>> {
    let read = |line| serde_json::from_str(line).into_diagnostic().wrap_err("reading the messages of cargo");
    messages.lines().map(read).collect()
}

/// Folders of packages by name and version, and whether they are local.
type Folders = BTreeMap<(String, String), (PathBuf, bool)>;

/// Folders of the packages that a build compiled.
fn folders(messages: &[Message]) -> Folders {
    let folder = |message: &Message| {
        let (package, folder) = message.package()?;
        Some((package, (folder.to_owned(), message.is_local())))
    };
    messages.iter().filter_map(folder).collect()
}

/// Crates from a registry that `-Z build-std` compiled into the standard library; none in other builds.
///
/// Each of them has the feature `rustc-dep-of-std`, which nothing else may use. The standard library's own crates are a
/// part of the toolchain.
fn standard_library(messages: &[Message]) -> Result<Vec<Component>> {
    #[derive(Deserialize)]
    struct Manifest {
        package: Declared,
    }
    #[derive(Deserialize)]
    struct Declared {
        #[serde(default)]
        license: String,
        #[serde(default)]
        repository: String,
    }
    let mut components = Vec::new();
    for message in messages {
        let is_library = message.target.as_ref().is_some_and(|target| target.kind.iter().any(|kind| kind == "lib"));
        let is_of_std = message.features.iter().any(|feature| feature == "rustc-dep-of-std");
        let Some(((name, version), folder)) = message.package() else { continue };
        if !is_library || !is_of_std || message.is_local() {
            continue;
        }
        let manifest = folder.join("Cargo.toml");
        let text = std::fs::read_to_string(&manifest)
            .into_diagnostic()
            .wrap_err_with(|| format!("reading {}", manifest.display()))?;
        let declared = toml::from_str::<Manifest>(&text)
            .into_diagnostic()
            .wrap_err_with(|| format!("reading {}", manifest.display()))?
            .package;
        let texts = texts(folder, false).wrap_err_with(|| format!("reading the licenses of {name}"))?;
        components.push(Component {
            name,
            version,
            license: declared.license.replace('/', " OR "),
            source: declared.repository,
            is_member: false,
            texts,
        });
    }
    Ok(components)
}

/// The license files of a package: in its folder, or, if it is local, in the nearest folder above with a Cargo.toml.
fn texts(folder: &Path, is_local: bool) -> Result<Vec<(String, String)>> {
    let depth = if is_local { usize::MAX } else { 1 };
    for folder in folder.ancestors().take(depth).filter(|folder| folder.join("Cargo.toml").exists()) {
        let mut texts = Vec::new();
        for entry in std::fs::read_dir(folder).into_diagnostic()? {
            let path = entry.into_diagnostic()?.path();
            if let Some(name) = path.file_name().and_then(|name| name.to_str())
                && is_license(name)
                && path.is_file()
            {
                let bytes = std::fs::read(&path).into_diagnostic()?;
                texts.push((name.to_owned(), String::from_utf8_lossy(&bytes).replace("\r\n", "\n")));
            }
        }
        if !texts.is_empty() {
            texts.sort();
            return Ok(texts);
        }
    }
    Ok(Vec::new())
}

/// `LICENSE-MIT`, `license.txt`, `COPYING.md`, but not `license.rs`.
fn is_license(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let extension = Path::new(&name).extension().and_then(|extension| extension.to_str());
    BEGINNINGS.iter().any(|beginning| name.starts_with(beginning))
        && !extension.is_some_and(|extension| ["rs", "toml", "json", "py", "sh"].contains(&extension))
}

/// Content of the folder, for all platforms of an FMU together.
#[derive(Clone, Debug, Default)]
pub(crate) struct Licenses {
    components: BTreeSet<Component>,
}

impl Licenses {
    /// Adds what is linked into the library of one more platform.
    pub(crate) fn add(&mut self, components: Vec<Component>) {
        self.components.extend(components);
    }

    /// The files of the folder.
    pub(crate) fn files(&self, model: &Model) -> BTreeMap<String, String> {
        let own = self.components.iter().find(|component| component.is_member && component.name == model.package);
        let own_texts = own.map_or(&[][..], |own| &own.texts[..]);
        let (project, others): (Vec<_>, Vec<_>) = self
            .components
            .iter()
            .filter(|component| own.is_none_or(|own| **component != *own))
            .partition(|component| component.is_member && component.texts == own_texts);

        let mut files = BTreeMap::new();
        let mut names = Vec::new();
        for (name, text) in own_texts {
            let name = if name.contains('.') { name.clone() } else { format!("{name}.txt") };
            // File names are case-insensitive on Windows.
            let is_taken = [ENTRY, NOTICES].iter().any(|taken| name.eq_ignore_ascii_case(taken));
            let name = if is_taken { format!("{}-{name}", model.name) } else { name };
            names.push(name.clone());
            files.insert(name, text.clone());
        }
        files.insert(ENTRY.to_owned(), entry(model, own, &names, &project, &others));
        files.insert(NOTICES.to_owned(), notices(&others));
        files
    }
}

/// The text of the entry point.
fn entry(
    model: &Model,
    own: Option<&Component>,
    names: &[String],
    project: &[&Component],
    others: &[&Component],
) -> String {
    let name = &model.name;
    let mut text = match own.map(|own| own.license.as_str()) {
        None | Some("") => format!("No license is declared for {name}: ask its author before you pass it on.\n"),
        Some(license) => format!("The license of {name} is {license}.\n"),
    };
    if !names.is_empty() {
        let _ = writeln!(text, "Its text is in this folder: {}.", names.join(", "));
    }
    if !project.is_empty() {
        let titles: Vec<_> = project.iter().map(|component| component.title()).collect();
        let _ = writeln!(text, "It also covers these parts of the same project: {}.", titles.join(", "));
    }
    let _ = write!(
        text,
        "\nThe binaries contain software of others. The copyright notices and license texts are in\n{NOTICES}.\n\n"
    );
    let rows = others.iter().map(|component| {
        let license = if component.license.is_empty() { "not declared" } else { &component.license };
        [component.title(), license.to_owned(), component.source.clone()]
    });
    let rows: Vec<_> = rows.collect();
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max().unwrap_or_default();
    let (first, second) = (width(0), width(1));
    for [title, license, source] in &rows {
        let line = format!("{title:first$}  {license:second$}  {source}");
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

/// Lists all texts, each once, below the names of the files that contain it.
fn notices(others: &[&Component]) -> String {
    // Texts that differ only in white space are the same.
    let mut places: Vec<(Vec<&str>, &str, Vec<String>)> = Vec::new();
    for component in others {
        for (file, text) in &component.texts {
            let words: Vec<_> = text.split_whitespace().collect();
            let place = format!("{}: {file}", component.title());
            match places.iter_mut().find(|(other, ..)| *other == words) {
                Some((.., places)) => places.push(place),
                None => places.push((words, text, vec![place])),
            }
        }
    }
    let line = "=".repeat(80);
    let mut notices = String::from("Copyright notices and license texts of the software of others in the binaries.\n");
    for (_, text, places) in places {
        let _ = write!(notices, "\n{line}\n{}\n{line}\n\n{}\n", places.join("\n"), text.trim_matches('\n').trim_end());
    }
    notices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_cargo_tree_are_read() {
        let registry = Package::parse("12libm v0.2.16\tMIT\thttps://github.com/rust-lang/compiler-builtins");
        let expected = Package {
            depth: 12,
            name: "libm",
            version: "0.2.16",
            license: "MIT",
            source: "https://github.com/rust-lang/compiler-builtins",
        };
        assert_eq!(registry, Some(expected));
        let local = Package::parse("0road v0.1.0 (project/road)\tMIT OR Apache-2.0\t").unwrap();
        assert_eq!((local.depth, local.name, local.version, local.source), (0, "road", "0.1.0", ""));
        assert_eq!(Package::parse("road v0.1.0\t\t"), None);
        assert_eq!(Package::parse(""), None);
    }

    /// The forms of cargo's documentation, "Package ID Specifications".
    #[test]
    fn identities_of_packages_are_read() {
        let read = |id| name_and_version(id).unwrap();
        let pair = |name: &str, version: &str| (name.to_owned(), version.to_owned());
        assert_eq!(read("registry+https://github.com/rust-lang/crates.io-index#libm@0.2.16"), pair("libm", "0.2.16"));
        assert_eq!(read("path+file:///home/me/project/road#0.1.0"), pair("road", "0.1.0"));
        assert_eq!(read("path+file:///home/me/project/road#my-road@0.1.0"), pair("my-road", "0.1.0"));
        assert_eq!(read("git+https://example.org/fmu?branch=main#fmu@0.2.0"), pair("fmu", "0.2.0"));
    }

    /// Messages as cargo 1.96 prints them for `-Z build-std`, shortened.
    #[test]
    fn crates_of_a_standard_library_that_is_built_along_are_listed() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = folder.path().join("Cargo.toml");
        std::fs::write(
            &manifest,
            "[package]\nname = \"gimli\"\nlicense = \"MIT/Apache-2.0\"\nrepository = \"https://x\"\n",
        )
        .unwrap();
        std::fs::write(folder.path().join("LICENSE-MIT"), "Permission is granted.").unwrap();
        let artifact = |id: &str, kind: &str, features: &[&str]| {
            serde_json::json!({
                "reason": "compiler-artifact",
                "package_id": id,
                "manifest_path": manifest,
                "target": { "kind": [kind] },
                "features": features,
            })
            .to_string()
        };
        let registry = "registry+https://github.com/rust-lang/crates.io-index";
        let messages = [
            artifact(&format!("{registry}#gimli@0.32.3"), "lib", &["read", "rustc-dep-of-std"]),
            // A build script is not linked, a model's crate is in `cargo tree`, core is a part of the toolchain.
            artifact(&format!("{registry}#object@0.37.3"), "custom-build", &["rustc-dep-of-std"]),
            artifact(&format!("{registry}#libm@0.2.16"), "lib", &["default"]),
            artifact("path+file:///usr/library/proc_macro#0.0.0", "lib", &["rustc-dep-of-std"]),
            r#"{"reason":"build-finished","success":true}"#.to_owned(),
        ];
        let components = standard_library(&read(&messages.join("\n")).unwrap()).unwrap();
        let expected = Component {
            name: "gimli".to_owned(),
            version: "0.32.3".to_owned(),
            license: "MIT OR Apache-2.0".to_owned(),
            source: "https://x".to_owned(),
            is_member: false,
            texts: vec![("LICENSE-MIT".to_owned(), "Permission is granted.".to_owned())],
        };
        assert_eq!(components, [expected]);
    }

    #[test]
    fn license_files_are_known_by_their_names() {
        for name in
            ["LICENSE", "LICENSE-MIT", "license-apache", "LICENSE-APACHE-2.0", "COPYING.md", "NOTICE", "UNLICENSE"]
        {
            assert!(is_license(name), "{name}");
        }
        for name in ["Cargo.toml", "license.rs", "README.md", "deny-licenses.toml", "licenses.json"] {
            assert!(!is_license(name), "{name}");
        }
    }

    fn component(name: &str, license: &str, is_member: bool, texts: &[(&str, &str)]) -> Component {
        Component {
            name: name.to_owned(),
            version: "1.0.0".to_owned(),
            license: license.to_owned(),
            source: format!("https://example.org/{name}"),
            is_member,
            texts: texts.iter().map(|(file, text)| ((*file).to_owned(), (*text).to_owned())).collect(),
        }
    }

    fn model(package: &str) -> Model {
        Model {
            package: package.to_owned(),
            name: "Demo".to_owned(),
            folder: PathBuf::new(),
            library: package.to_owned(),
            is_default: true,
            dependencies: BTreeSet::new(),
        }
    }

    #[test]
    fn texts_are_written_once_and_own_crates_are_no_third_party() {
        let mit = ("LICENSE-MIT", "Permission is granted.\n");
        let mut licenses = Licenses::default();
        licenses.add(vec![
            component("demo", "MIT", true, &[mit]),
            component("helper", "MIT", true, &[mit]),
            component("alien", "MIT", false, &[("LICENSE", "Permission\nis granted.")]),
            component("vendored", "BSD-3-Clause", true, &[("LICENSE", "Redistribution is permitted.")]),
        ]);
        licenses.add(vec![component("zebra", "MIT", false, &[mit]), component("bare", "", false, &[])]);
        let files = licenses.files(&model("demo"));
        assert_eq!(files.keys().collect::<Vec<_>>(), ["LICENSE-MIT.txt", "license.txt", "third-party-notices.txt"]);
        assert_eq!(
            files["license.txt"],
            "The license of Demo is MIT.\nIts text is in this folder: LICENSE-MIT.txt.\nIt also covers these parts of \
             the same project: helper 1.0.0.\n\nThe binaries contain software of others. The copyright notices and \
             license texts are in\nthird-party-notices.txt.\n\n\
             alien 1.0.0     MIT           https://example.org/alien\n\
             bare 1.0.0      not declared  https://example.org/bare\n\
             vendored 1.0.0  BSD-3-Clause  https://example.org/vendored\n\
             zebra 1.0.0     MIT           https://example.org/zebra\n"
        );
        let notices = &files["third-party-notices.txt"];
        assert_eq!(notices.matches("Permission").count(), 1, "{notices}");
        assert!(notices.contains("\nalien 1.0.0: LICENSE\nzebra 1.0.0: LICENSE-MIT\n===="), "{notices}");
        assert!(notices.contains("\nvendored 1.0.0: LICENSE\n===="), "{notices}");
    }

    #[test]
    fn a_model_without_a_license_says_so() {
        let mut licenses = Licenses::default();
        licenses.add(vec![component("demo", "", true, &[])]);
        let entry = &licenses.files(&model("demo"))["license.txt"];
        assert!(entry.starts_with("No license is declared for Demo: ask its author"), "{entry}");
    }

    #[test]
    fn a_license_file_does_not_take_the_name_of_the_entry_point() {
        let mut licenses = Licenses::default();
        licenses.add(vec![component("demo", "ISC", true, &[("LICENSE", "Permission is granted.\n")])]);
        let files = licenses.files(&model("demo"));
        assert_eq!(files["Demo-LICENSE.txt"], "Permission is granted.\n");
        assert!(files["license.txt"].contains("Its text is in this folder: Demo-LICENSE.txt."));
    }
}
