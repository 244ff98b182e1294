//! `documentation/licenses` in every packed FMU contains the license of the model and the notices of all linked code.
//!
//! References: FMI 2.0.4, section 2.3 (entry point `license.txt`); `cargo tree` for each model on its own, and the
//! license files in the sources of its crates; the paths of source files that the binaries contain.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use tests::{paths, workspace};
use zip::ZipArchive;

/// The files of an FMU by name.
fn contents(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let file = File::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut zip = ZipArchive::new(file).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    (0..zip.len())
        .map(|i| {
            let mut entry = zip.by_index(i).expect("the archive was made by us");
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).expect("the archive was made by us");
            (entry.name().expect("names are UTF-8").into_owned(), bytes)
        })
        .collect()
}

fn text<'a>(contents: &'a BTreeMap<String, Vec<u8>>, name: &str) -> &'a str {
    let bytes = contents.get(name).unwrap_or_else(|| panic!("there is no {name}, only {:?}", contents.keys()));
    std::str::from_utf8(bytes).expect("UTF-8")
}

fn name_of(path: &Path) -> String {
    path.file_stem().and_then(|stem| stem.to_str()).expect("names are UTF-8").to_owned()
}

fn cargo(arguments: &[&str]) -> String {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo).args(arguments).current_dir(workspace()).output().expect("cargo runs");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Folders of all packages. The keys have the form `name version`.
fn folders() -> BTreeMap<String, PathBuf> {
    let metadata: Value =
        serde_json::from_str(&cargo(&["metadata", "--format-version", "1", "--locked"])).expect("cargo writes JSON");
    let packages = metadata["packages"].as_array().expect("cargo lists packages");
    let string = |value: &Value| value.as_str().expect("cargo writes strings").to_owned();
    packages
        .iter()
        .map(|package| {
            let manifest = PathBuf::from(string(&package["manifest_path"]));
            let folder = manifest.parent().expect("a file has a folder").to_owned();
            (format!("{} {}", string(&package["name"]), string(&package["version"])), folder)
        })
        .collect()
}

/// Name of the package of an FMU: `rescue-vehicle` for `RescueVehicle`.
fn package(name: &str) -> String {
    let mut package = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !package.is_empty() {
            package.push('-');
        }
        package.extend(letter.to_lowercase());
    }
    package
}

/// Crates linked into a model on this platform, as `name version`, without the model itself.
fn linked(name: &str) -> BTreeSet<String> {
    let package = package(name);
    let arguments = ["tree", "--locked", "--edges", "normal,no-proc-macro", "--prefix", "none", "--package", &package];
    let tree = cargo(&arguments);
    tree.lines()
        .filter_map(|line| {
            let mut words = line.split(' ');
            Some(format!("{} {}", words.next()?, words.next()?.strip_prefix('v')?))
        })
        .filter(|title| !title.starts_with(&format!("{package} ")))
        .collect()
}

fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn every_linked_crate_is_listed_with_its_license_texts() {
    let folders = folders();
    let root = workspace();
    for path in paths() {
        let name = name_of(&path);
        let contents = contents(&path);
        let entry = text(&contents, "documentation/licenses/license.txt");
        assert!(entry.starts_with(&format!("The license of {name} is MIT OR Apache-2.0.\n")), "{name}: {entry}");
        let project = entry.lines().find(|line| line.starts_with("It also covers")).unwrap_or_default();
        let notices = text(&contents, "documentation/licenses/third-party-notices.txt");
        let notices_words = words(notices);
        let linked = linked(&name);
        assert!(linked.iter().any(|title| title.starts_with("fmu ")), "{name}: {linked:?}");
        for title in &linked {
            let folder = folders.get(title).unwrap_or_else(|| panic!("cargo metadata lists no {title}"));
            if folder.starts_with(&root) {
                assert!(project.contains(title), "{name}: {title} is part of this project: {entry}");
                continue;
            }
            assert!(entry.lines().any(|line| line.starts_with(&format!("{title}  "))), "{name}: no {title} in {entry}");
            let files = std::fs::read_dir(folder).expect("the sources are there");
            let mut texts = 0;
            for file in files.map(|file| file.expect("the sources are there").path()) {
                let file_name = file.file_name().and_then(|name| name.to_str()).unwrap_or_default();
                if ["license", "copying", "copyright", "unlicense", "notice"]
                    .iter()
                    .any(|beginning| file_name.to_lowercase().starts_with(beginning))
                {
                    let license = std::fs::read_to_string(&file).expect("licenses are UTF-8");
                    let place = format!("\n{title}: {file_name}\n");
                    assert!(notices.contains(&place), "{name}: the notices name no {place:?}");
                    assert!(notices_words.contains(&words(&license)), "{name}: the text of {place:?} is missing");
                    texts += 1;
                }
            }
            assert!(texts > 0, "{title} has no license file in {}", folder.display());
        }
    }
}

/// Panic messages contain source paths, so a binary mentions some of the crates that it contains.
#[test]
fn crates_that_binaries_mention_are_listed() {
    let mut of_rust = 0;
    for path in paths() {
        let name = name_of(&path);
        let contents = contents(&path);
        let entry = text(&contents, "documentation/licenses/license.txt");
        let notices = text(&contents, "documentation/licenses/third-party-notices.txt");
        assert!(entry.lines().any(|line| line.starts_with("Rust standard library  ")), "{name}: {entry}");
        for (file, bytes) in contents.iter().filter(|(file, _)| file.starts_with("binaries/")) {
            let binary = String::from_utf8_lossy(bytes);
            // Crates of the standard library are in `/rust/deps/NAME-VERSION/`, or in its folder `vendor` if it is
            // compiled with the FMU.
            let of_std = ["/rust/deps/", "/rust/library/vendor/"].map(|start| (start, binary.match_indices(start)));
            for (start, (at, _)) in of_std.into_iter().flat_map(|(start, places)| places.map(move |at| (start, at))) {
                let folder = binary[at + start.len()..].split('/').next().expect("there is a name");
                let krate = folder.rsplit_once('-').expect("there is a version").0;
                let listed = notices.lines().any(|line| line.split(' ').next() == Some(krate));
                assert!(listed, "{name}: {file} mentions {folder}, the notices do not");
                of_rust += 1;
            }
            // Other crates, and the crates of a standard library that is compiled with the FMU, are in
            // `/cargo/registry/src/INDEX/NAME-VERSION/`.
            for (at, _) in binary.match_indices("/cargo/registry/src/") {
                let folder = binary[at..].split('/').nth(5).expect("there is a name");
                let (krate, version) = folder.rsplit_once('-').expect("there is a version");
                let title = format!("{krate} {version}");
                assert!(
                    entry.lines().any(|line| line.starts_with(&format!("{title} "))),
                    "{name}: {file} mentions {title}, the entry point does not"
                );
                assert!(notices.contains(&format!("\n{title}: ")), "{name}: the notices have no text of {title}");
            }
        }
    }
    assert!(of_rust > 0, "the binaries mention no crate of the standard library: the path has changed");
}
