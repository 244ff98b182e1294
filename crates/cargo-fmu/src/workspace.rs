//! The models among the packages of the workspace.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

use fmu_import::names::suggestion;
use miette::{Result, WrapErr, miette};
use serde::Deserialize;

use crate::toolchain::{cargo, metadata};

/// A package that becomes an FMU: a `cdylib` that depends on `fmu`.
#[derive(Clone, Debug)]
pub struct Model {
    /// Name of the package, in kebab case.
    pub package: String,
    /// Name of the FMU. Until the model's own name is known, this is the name of the package in Pascal case.
    pub name: String,
    /// Folder of the package.
    pub folder: PathBuf,
    /// Name of the library crate, in snake case.
    pub library: String,
    /// True if the package is a default member of the workspace; examples are not.
    pub is_default: bool,
    /// Packages of the workspace on which the model depends, directly or indirectly.
    pub dependencies: BTreeSet<String>,
}

/// The workspace that the command was called in.
#[derive(Clone, Debug)]
pub struct Workspace {
    /// Top folder.
    pub root: PathBuf,
    /// The folder `target`.
    pub target: PathBuf,
    /// All models, by name.
    pub models: Vec<Model>,
    /// Settings of the workspace for `cargo fmu`.
    pub settings: Settings,
}

/// `[workspace.metadata.fmu]` in the Cargo.toml at the top.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// True if linux64 binaries load with an old glibc; options on the command line take precedence.
    pub portable: bool,
    /// Folder of committed model descriptions, relative to the top. Without this setting, descriptions are not
    /// compared.
    pub descriptions: Option<PathBuf>,
    /// Folders of new models by kind: `continuous`, `discrete`, `stateful`.
    pub new: BTreeMap<String, PathBuf>,
    /// Convention for the names of variables. Without a convention, any name that FMI allows is accepted.
    pub names: Option<Names>,
}

/// A convention for the names of variables.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Names {
    /// Words in lower snake case, joined by dots.
    LowerSnakeCase,
}

impl Names {
    /// Returns true if a name follows the convention. Indices and the `der(…)` of derivatives are always allowed.
    pub(crate) fn admits(self, name: &str) -> bool {
        let Self::LowerSnakeCase = self;
        let name = name.strip_prefix("der(").and_then(|rest| rest.strip_suffix(')')).unwrap_or(name);
        name.split('.').all(|part| {
            let word = part.strip_suffix(']').and_then(|rest| rest.split_once('[')).map_or(part, |(word, _)| word);
            word.starts_with(|c: char| c.is_ascii_lowercase())
                && word.bytes().all(|byte| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'_')
        })
    }
}

#[derive(Deserialize)]
struct Metadata {
    packages: Vec<Package>,
    workspace_default_members: Vec<String>,
    workspace_root: PathBuf,
    target_directory: PathBuf,
    metadata: serde_json::Value,
}

#[derive(Deserialize)]
struct Package {
    id: String,
    name: String,
    manifest_path: PathBuf,
    dependencies: Vec<Dependency>,
    targets: Vec<Target>,
}

#[derive(Deserialize)]
struct Dependency {
    name: String,
    /// `dev` or `build`; `None` for a dependency of the library.
    kind: Option<String>,
}

#[derive(Deserialize)]
struct Target {
    name: String,
    crate_types: Vec<String>,
}

impl Workspace {
    /// Reads the workspace from `cargo metadata`.
    pub fn find() -> Result<Self> {
        let metadata: Metadata = metadata(cargo().args(["metadata", "--no-deps"]))?;
        let settings = settings(&metadata.metadata)
            .wrap_err_with(|| format!("reading {}", metadata.workspace_root.join("Cargo.toml").display()))?;
        let direct: BTreeMap<String, BTreeSet<String>> = metadata
            .packages
            .iter()
            .map(|package| {
                let of_library = package.dependencies.iter().filter(|dependency| dependency.kind.is_none());
                (package.name.clone(), of_library.map(|dependency| dependency.name.clone()).collect())
            })
            .collect();
        let mut models: Vec<_> = metadata
            .packages
            .into_iter()
            .filter(|package| direct[&package.name].contains("fmu"))
            .filter_map(|package| {
                let target = package.targets.iter().find(|t| t.crate_types.iter().any(|kind| kind == "cdylib"))?;
                Some(Model {
                    name: pascal_case(&package.name),
                    library: target.name.replace('-', "_"),
                    folder: package.manifest_path.parent().map(Path::to_owned)?,
                    dependencies: reachable(&direct, &package.name),
                    package: package.name,
                    is_default: metadata.workspace_default_members.contains(&package.id),
                })
            })
            .collect();
        models.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(Self { root: metadata.workspace_root, target: metadata.target_directory, models, settings })
    }

    /// Path of a new package or scenario. A plain name is in the folder that the workspace sets for its kind.
    pub fn place(&self, path: &Path, kind: &str) -> PathBuf {
        let folder = self.settings.new.get(kind).filter(|_| path.components().count() == 1);
        folder.map_or_else(|| path.to_owned(), |folder| self.root.join(folder).join(path))
    }

    /// The models with these names (of the FMU or the package), or the models of all default members.
    pub(crate) fn select(&self, names: &[String], all: bool) -> Result<Vec<Model>> {
        if all || names.is_empty() {
            return Ok(self.models.iter().filter(|model| model.is_default).cloned().collect());
        }
        names
            .iter()
            .map(|name| {
                let found = self.models.iter().find(|model| model.name == *name || model.package == *name);
                found.cloned().ok_or_else(|| {
                    let names: Vec<&str> = self.models.iter().map(|model| model.name.as_str()).collect();
                    let hint = suggestion(name, names.iter().copied()).unwrap_or_else(|| match &names[..] {
                        [] => "a model is a package with the crate type `cdylib` that depends on `fmu`".to_owned(),
                        names => format!("its models are {}", names.join(", ")),
                    });
                    miette!("there is no model named '{name}' in this workspace; {hint}")
                })
            })
            .collect()
    }

    /// The models of this workspace whose FMUs are among these.
    pub(crate) fn models_of(&self, fmus: &BTreeSet<String>) -> Vec<Model> {
        self.models.iter().filter(|model| fmus.contains(&model.name)).cloned().collect()
    }

    /// The commit that is checked out, with `-dirty` if files in the workspace differ from it; `None` outside of a git
    /// checkout.
    pub(crate) fn commit(&self) -> Option<String> {
        let git = |arguments: &[&str]| {
            let output = Command::new("git").args(arguments).current_dir(&self.root).output().ok()?;
            let text = String::from_utf8(output.stdout).ok()?;
            (output.status.success() && !text.is_empty()).then_some(text)
        };
        // A workspace in an ignored folder of another checkout is not part of that checkout.
        git(&["ls-files", "--", "Cargo.toml"])?;
        let status = git(&["status", "--porcelain=v2", "--branch", "--", "."])?;
        // Before the first commit, git prints a word in parentheses instead.
        let commit = status.lines().find_map(|line| line.strip_prefix("# branch.oid "))?;
        let is_clean = status.lines().all(|line| line.starts_with('#'));
        let is_hash = commit.bytes().all(|byte| byte.is_ascii_hexdigit());
        is_hash.then(|| format!("{commit}{}", if is_clean { "" } else { "-dirty" }))
    }

    pub(crate) fn fmus(&self) -> PathBuf {
        self.target.join("fmu")
    }

    pub(crate) fn fmus_of_fmi3(&self) -> PathBuf {
        self.target.join("fmu3")
    }
}

/// The packages of the workspace on which a package depends, directly or indirectly.
fn reachable(direct: &BTreeMap<String, BTreeSet<String>>, package: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open = vec![package];
    while let Some(package) = open.pop() {
        for name in direct.get(package).into_iter().flatten().filter(|name| direct.contains_key(*name)) {
            if found.insert(name.clone()) {
                open.push(name);
            }
        }
    }
    found
}

/// The part of `[workspace.metadata]` that is for `cargo fmu`. If it is missing, returns the defaults.
fn settings(metadata: &serde_json::Value) -> Result<Settings> {
    let Some(table) = metadata.get("fmu") else { return Ok(Settings::default()) };
    Settings::deserialize(table).map_err(|error| miette!("[workspace.metadata.fmu]: {error}"))
}

/// Converts `rescue-vehicle` to `RescueVehicle`.
pub(crate) fn pascal_case(kebab: &str) -> String {
    kebab
        .split(['-', '_'])
        .map(|word| {
            let mut letters = word.chars();
            letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn package_names_become_fmu_names() {
        assert_eq!(pascal_case("rescue-vehicle"), "RescueVehicle");
        assert_eq!(pascal_case("road"), "Road");
    }

    #[test]
    fn the_commit_is_that_of_a_checkout() {
        let folder = tempfile::tempdir().unwrap();
        let at = |root: PathBuf| Workspace {
            target: root.join("target"),
            root,
            models: Vec::new(),
            settings: Settings::default(),
        };
        let workspace = at(folder.path().to_owned());
        std::fs::write(folder.path().join("Cargo.toml"), "").unwrap();
        assert_eq!(workspace.commit(), None, "not a checkout");
        let git = |arguments: &[&str]| {
            let identity = ["-c", "user.name=a", "-c", "user.email=a@example.org"];
            let command =
                Command::new("git").args(identity).args(arguments).current_dir(folder.path()).output().unwrap();
            assert!(command.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&command.stderr));
            String::from_utf8(command.stdout).unwrap().trim().to_owned()
        };
        git(&["init", "--quiet"]);
        assert_eq!(workspace.commit(), None, "not in the checkout");
        std::fs::write(folder.path().join(".gitignore"), "/ignored\n").unwrap();
        git(&["add", "."]);
        assert_eq!(workspace.commit(), None, "nothing is committed");
        git(&["commit", "--quiet", "--message", "Begin"]);
        let commit = git(&["rev-parse", "HEAD"]);
        assert_eq!(workspace.commit().as_ref(), Some(&commit));
        let ignored = folder.path().join("ignored");
        std::fs::create_dir(&ignored).unwrap();
        std::fs::write(ignored.join("Cargo.toml"), "").unwrap();
        assert_eq!(workspace.commit().as_ref(), Some(&commit), "ignored files do not count");
        assert_eq!(at(ignored).commit(), None, "an ignored folder is not in the checkout");
        std::fs::write(folder.path().join("new.rs"), "").unwrap();
        assert_eq!(workspace.commit(), Some(format!("{commit}-dirty")));
    }

    #[test]
    fn dependencies_are_followed() {
        let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
        let direct = [("loop", set(&["motor", "fmu"])), ("motor", set(&["shared"])), ("shared", set(&["serde"]))];
        let direct = direct.into_iter().map(|(name, on)| (name.to_owned(), on)).collect();
        assert_eq!(reachable(&direct, "loop"), set(&["motor", "shared"]));
        assert_eq!(reachable(&direct, "shared"), set(&[]));
    }

    #[test]
    fn a_convention_admits_its_names_only() {
        for name in ["tire.front_left.load", "x[1,2]", "der(axle.rear[2].speed)", "b2"] {
            assert!(Names::LowerSnakeCase.admits(name), "{name}");
        }
        for name in ["VehSpd_kph", "acc.setSpeed", "a b", "der(X)", "a..b", "2b"] {
            assert!(!Names::LowerSnakeCase.admits(name), "{name}");
        }
    }

    #[test]
    fn settings_are_read_and_mistakes_named() {
        let portable = |metadata: serde_json::Value| settings(&metadata).map(|settings| settings.portable);
        assert!(!portable(serde_json::Value::Null).unwrap());
        assert!(!portable(serde_json::json!({ "release": {} })).unwrap());
        assert!(portable(serde_json::json!({ "fmu": { "portable": true } })).unwrap());
        for (table, part) in [
            (
                serde_json::json!({ "portabel": true }),
                "unknown field `portabel`, expected one of `portable`, `descriptions`, `new`, `names`",
            ),
            (serde_json::json!({ "portable": "yes" }), "invalid type: string \"yes\", expected a boolean"),
            (serde_json::json!({ "names": "camel" }), "unknown variant `camel`, expected `lower_snake_case`"),
        ] {
            let error = portable(serde_json::json!({ "fmu": table })).unwrap_err().to_string();
            assert!(error.starts_with("[workspace.metadata.fmu]: ") && error.contains(part), "{error}");
        }
    }
}
