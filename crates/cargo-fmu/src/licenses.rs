//! `documentation/licenses` of an FMU: the license of the model, and notices for everything that its libraries contain.
//!
//! FMI 2.0.1 added the folder; `license.txt` is its entry point (FMI 2.0.4, section 2.3). The list of linked crates
//! comes from the messages of the build, so it contains those that `-Z build-std` compiles into the standard library.
//! The texts come from the crates' sources, which have just been compiled, so nothing has to be downloaded.

use std::collections::BTreeSet;
use std::collections::btree_map::{BTreeMap, Entry};
use std::fmt::Write as _;
use std::path::Path;

use miette::{IntoDiagnostic, Result, WrapErr};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::build::{Artifact, Builder, Linker, Package};
use crate::platform::Platform;
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
    /// Empty for a part of a toolchain, because its version is that of the toolchain.
    version: String,
    /// An SPDX expression; empty if none is declared.
    license: String,
    /// Address of the published sources.
    source: String,
    is_member: bool,
    /// True for a crate of a registry.
    is_registered: bool,
    texts: Vec<(String, String)>,
}

impl Component {
    fn title(&self) -> String {
        if self.version.is_empty() { self.name.clone() } else { format!("{} {}", self.name, self.version) }
    }

    fn cyclonedx(&self) -> Value {
        let Self { name, version, license, source, .. } = self;
        let mut component = json!({ "type": "library", "name": name });
        if !version.is_empty() {
            component["version"] = json!(version);
        }
        if license.contains(',') {
            // Not an SPDX expression.
            component["licenses"] = json!([{ "license": { "name": license } }]);
        } else if !license.is_empty() {
            component["licenses"] = json!([{ "expression": license }]);
        }
        if self.is_registered {
            component["purl"] = json!(format!("pkg:cargo/{name}@{version}"));
        }
        if !source.is_empty() {
            component["externalReferences"] = json!([{ "type": "vcs", "url": source }]);
        }
        component
    }
}

/// Parts of toolchains. This program contains their notices, because not every installation of a toolchain has them.
fn toolchain(platform: Platform, linker: Linker) -> Vec<Component> {
    let part = |name: &str, license: &str, source: &str, text: &str| Component {
        name: name.to_owned(),
        version: String::new(),
        license: license.to_owned(),
        source: source.to_owned(),
        is_member: false,
        is_registered: false,
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
    match linker {
        Linker::Native if platform.is_linux() => parts.push(gcc),
        // Other libraries that a native linker adds belong to the system. WebAssembly modules contain none.
        Linker::Native | Linker::Lld => {}
        Linker::Zig => parts.push(part(
            "zig: compiler_rt, libunwind, start-up code of glibc",
            "MIT, Apache-2.0 WITH LLVM-exception, LGPL-2.1-or-later with an exception",
            "https://ziglang.org",
            include_str!("notices/zig.txt"),
        )),
        Linker::Mingw => parts.extend([
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

/// Packages linked into the library of each model.
///
/// `built` contains the parts of each library, `packages` the packages that the workspace depends on.
pub(crate) fn components(
    builder: &Builder,
    workspace: &Workspace,
    packages: &[Package],
    built: &[Vec<Artifact>],
) -> Result<Vec<Vec<Component>>> {
    let target = builder.target()?;
    let mut known: BTreeMap<&str, Option<Component>> = BTreeMap::new();
    let mut all = Vec::new();
    for artifacts in built {
        let mut components = toolchain(builder.platform, builder.linker);
        for artifact in artifacts.iter().filter(|artifact| artifact.is_for(&target)) {
            let component = match known.entry(&artifact.package_id) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => entry.insert(linked(artifact, workspace, packages)?),
            };
            components.extend(component.clone());
        }
        all.push(components);
    }
    for component in known.values().flatten().filter(|component| component.texts.is_empty() && !component.is_member) {
        eprintln!(
            "warning: {} has no license file in its sources; the FMUs only name its license: {}",
            component.title(),
            if component.license.is_empty() { "none is declared" } else { &component.license }
        );
    }
    Ok(all)
}

/// The package of a linked part; `None` for the standard library's own crates, which belong to the toolchain.
fn linked(artifact: &Artifact, workspace: &Workspace, packages: &[Package]) -> Result<Option<Component>> {
    /// A manifest as it is published, without inherited keys.
    #[derive(Deserialize)]
    struct Manifest {
        package: Declared,
    }
    #[derive(Deserialize)]
    struct Declared {
        license: Option<String>,
        repository: Option<String>,
    }
    let Some((name, version)) = artifact.name_and_version() else { return Ok(None) };
    let folder = artifact.manifest_path.parent().unwrap_or(Path::new(""));
    let is_local = artifact.package_id.starts_with("path+");
    let (license, repository) = match packages.iter().find(|package| package.name == name && package.version == version)
    {
        Some(package) => (package.license.clone(), package.repository.clone()),
        None if is_local => return Ok(None),
        // A dependency of the standard library, if that is built from sources.
        None => {
            let reading = || format!("reading {}", artifact.manifest_path.display());
            let text = std::fs::read_to_string(&artifact.manifest_path).into_diagnostic().wrap_err_with(reading)?;
            let declared = toml::from_str::<Manifest>(&text).into_diagnostic().wrap_err_with(reading)?.package;
            (declared.license, declared.repository)
        }
    };
    Ok(Some(Component {
        name: name.to_owned(),
        version: version.to_owned(),
        license: license.unwrap_or_default().replace('/', " OR "),
        source: repository.unwrap_or_default(),
        is_member: is_local && folder.starts_with(&workspace.root),
        is_registered: artifact.package_id.starts_with("registry+"),
        texts: texts(folder, is_local).wrap_err_with(|| format!("reading the licenses of {name}"))?,
    }))
}

/// The license files in the folder of a package. For a local package without such files, they are taken from the
/// nearest parent folder that has a Cargo.toml and license files.
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

/// True for `LICENSE-MIT`, `license.txt` and `COPYING.md`, but not for `license.rs`.
fn is_license(name: &str) -> bool {
    let name = name.to_ascii_lowercase();
    let extension = Path::new(&name).extension().and_then(|extension| extension.to_str());
    BEGINNINGS.iter().any(|beginning| name.starts_with(beginning))
        && !extension.is_some_and(|extension| ["rs", "toml", "json", "py", "sh"].contains(&extension))
}

/// A list of the components in the format CycloneDX 1.6, without time and serial number, so that the same FMU always
/// has the same list.
pub(crate) fn sbom(components: &BTreeSet<Component>, model: &Model) -> String {
    let is_own = |component: &&Component| component.is_member && component.name == model.package;
    let own = components.iter().find(is_own).map(Component::cyclonedx);
    let others: Vec<_> = components.iter().filter(|component| !is_own(component)).map(Component::cyclonedx).collect();
    let tool = json!({ "type": "application", "name": "cargo-fmu", "version": env!("CARGO_PKG_VERSION") });
    let bom = json!({
        "$schema": "http://cyclonedx.org/schema/bom-1.6.schema.json",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": { "tools": { "components": [tool] }, "component": own },
        "components": others,
    });
    format!("{bom:#}\n")
}

/// The files of the folder, for all platforms of an FMU together.
pub(crate) fn files(components: &BTreeSet<Component>, model: &Model) -> BTreeMap<String, String> {
    let own = components.iter().find(|component| component.is_member && component.name == model.package);
    let own_texts = own.map_or(&[][..], |own| &own.texts[..]);
    let (project, others): (Vec<_>, Vec<_>) = components
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
        "\nThe binaries contain third-party software. The copyright notices and license texts are in\n{NOTICES}.\n\n"
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
    let mut notices =
        String::from("Copyright notices and license texts of the third-party software in the binaries.\n");
    for (_, text, places) in places {
        let _ = write!(notices, "\n{line}\n{}\n{line}\n\n{}\n", places.join("\n"), text.trim_matches('\n').trim_end());
    }
    notices
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;
    use crate::build;

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
        let artifact = |id: &str| {
            let message = serde_json::json!({
                "reason": "compiler-artifact",
                "package_id": id,
                "manifest_path": manifest,
                "target": { "crate_types": ["lib"] },
                "filenames": [],
            });
            build::artifacts(&message.to_string()).unwrap().remove(0)
        };
        let root = folder.path().join("workspace");
        let workspace = Workspace {
            target: root.clone(),
            root,
            models: Vec::new(),
            settings: crate::workspace::Settings::default(),
        };
        let found = |id: &str| linked(&artifact(id), &workspace, &[]).unwrap();
        // core is a part of the toolchain.
        assert_eq!(found("path+file:///usr/library/core#0.0.0"), None);
        let expected = Component {
            name: "gimli".to_owned(),
            version: "0.32.3".to_owned(),
            license: "MIT OR Apache-2.0".to_owned(),
            source: "https://x".to_owned(),
            is_member: false,
            is_registered: true,
            texts: vec![("LICENSE-MIT".to_owned(), "Permission is granted.".to_owned())],
        };
        assert_eq!(found("registry+https://github.com/rust-lang/crates.io-index#gimli@0.32.3"), Some(expected));
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
            is_registered: !is_member,
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
        let mut licenses = BTreeSet::new();
        licenses.extend(vec![
            component("demo", "MIT", true, &[mit]),
            component("helper", "MIT", true, &[mit]),
            component("alien", "MIT", false, &[("LICENSE", "Permission\nis granted.")]),
            component("vendored", "BSD-3-Clause", true, &[("LICENSE", "Redistribution is permitted.")]),
        ]);
        licenses.extend(vec![component("zebra", "MIT", false, &[mit]), component("bare", "", false, &[])]);
        let files = files(&licenses, &model("demo"));
        assert_eq!(files.keys().collect::<Vec<_>>(), ["LICENSE-MIT.txt", "license.txt", "third-party-notices.txt"]);
        assert_eq!(
            files["license.txt"],
            "The license of Demo is MIT.\nIts text is in this folder: LICENSE-MIT.txt.\nIt also covers these parts of \
             the same project: helper 1.0.0.\n\nThe binaries contain third-party software. The copyright notices and \
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

    /// Reference: the specification of CycloneDX 1.6, which also gives the form of a package URL.
    #[test]
    fn a_bill_of_materials_lists_all_components() {
        let mut licenses = BTreeSet::new();
        licenses.extend(vec![component("demo", "MIT", true, &[]), component("zebra", "MIT OR Apache-2.0", false, &[])]);
        licenses.extend(toolchain(Platform::Linux64, Linker::Native));
        let bom: Value = serde_json::from_str(&sbom(&licenses, &model("demo"))).unwrap();
        assert_eq!((&bom["bomFormat"], &bom["specVersion"]), (&json!("CycloneDX"), &json!("1.6")));
        assert_eq!(bom["metadata"]["component"]["name"], "demo");
        assert_eq!(bom["metadata"]["component"]["purl"], Value::Null);
        let [rust, library, zebra] = &bom["components"].as_array().unwrap()[..] else { panic!("{bom}") };
        assert_eq!(library["licenses"][0]["expression"], "GPL-3.0-or-later WITH GCC-exception-3.1");
        assert!(rust["licenses"][0]["license"]["name"].is_string() && rust["version"].is_null());
        let expected = json!({
            "type": "library",
            "name": "zebra",
            "version": "1.0.0",
            "licenses": [{ "expression": "MIT OR Apache-2.0" }],
            "purl": "pkg:cargo/zebra@1.0.0",
            "externalReferences": [{ "type": "vcs", "url": "https://example.org/zebra" }],
        });
        assert_eq!(*zebra, expected);
    }

    #[test]
    fn a_model_without_a_license_says_so() {
        let mut licenses = BTreeSet::new();
        licenses.extend(vec![component("demo", "", true, &[])]);
        let entry = &files(&licenses, &model("demo"))["license.txt"];
        assert!(entry.starts_with("No license is declared for Demo: ask its author"), "{entry}");
    }

    #[test]
    fn a_license_file_does_not_take_the_name_of_the_entry_point() {
        let mut licenses = BTreeSet::new();
        licenses.extend(vec![component("demo", "ISC", true, &[("LICENSE", "Permission is granted.\n")])]);
        let files = files(&licenses, &model("demo"));
        assert_eq!(files["Demo-LICENSE.txt"], "Permission is granted.\n");
        assert!(files["license.txt"].contains("Its text is in this folder: Demo-LICENSE.txt."));
    }
}
