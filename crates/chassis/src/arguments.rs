//! Arguments that several commands share.

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use cargo_fmu::workspace::Workspace;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use fmu_system::resolve::FmuFolder;

/// Output folder of `cargo fmu pack`, relative to the workspace root.
const PACKED: &str = "target/fmu";

#[derive(clap::Args, Debug)]
pub(crate) struct Folders {
    /// Folder with the FMUs; may be repeated, the first folder that contains an FMU wins [default: target/fmu, here or
    /// in a folder above, or the FMUs that came with this program]
    #[arg(long, value_name = "DIR")]
    fmus: Vec<PathBuf>,
}

impl Folders {
    /// The FMUs in the folders, and the names of those that the current workspace, if any, can build.
    pub(crate) fn source(&self) -> FmuFolder {
        source(&self.places())
    }

    /// The given folders; without any, `target/fmu` of this folder or one above it, or, outside of workspaces, the FMUs
    /// that came with this program.
    pub(crate) fn places(&self) -> Vec<PathBuf> {
        if self.fmus.is_empty() { vec![usual()] } else { self.fmus.clone() }
    }

    pub(crate) fn given(&self) -> &[PathBuf] {
        &self.fmus
    }
}

pub(crate) fn source(places: &[PathBuf]) -> FmuFolder {
    let buildable = || Workspace::find().map_or(Vec::new(), |w| w.models.into_iter().map(|model| model.name).collect());
    FmuFolder::new(places).with_buildable(buildable)
}

fn usual() -> PathBuf {
    let here = std::env::current_dir().unwrap_or_default();
    let above = || here.ancestors().skip(1).map(|folder| folder.join(PACKED)).find(|folder| folder.is_dir());
    // In the repository, the program is in `target`. In a wheel, it is in a folder next to the folder of the FMUs. In
    // another workspace, the program's own FMUs are not used, because its models may have the same names.
    let own = || {
        if here.ancestors().any(|folder| folder.join("Cargo.toml").exists()) {
            return None;
        }
        let own = std::env::current_exe().ok()?;
        let places = own.ancestors().skip(2).take(2).flat_map(|folder| [folder.join("fmu"), folder.join("fmus")]);
        places.into_iter().find(|folder| folder.is_dir())
    };
    let here = Path::new(PACKED).to_path_buf();
    let found = if here.is_dir() { None } else { above().or_else(own) };
    found.unwrap_or(here)
}

#[derive(clap::Args, Debug)]
pub(crate) struct Jobs {
    /// Number of processes [default: number of processors]
    #[arg(long, short, value_name = "N")]
    jobs: Option<NonZeroUsize>,
}

impl Jobs {
    /// The given number of processes; by default, one process per processor.
    pub(crate) fn count(&self) -> NonZeroUsize {
        self.jobs.or_else(|| std::thread::available_parallelism().ok()).unwrap_or(NonZeroUsize::MIN)
    }
}

/// Parser for an option that accepts fixed words. Each word has a help text and a value.
pub(crate) fn one_of<T: Copy + Send + Sync>(
    words: &'static [(&'static str, &'static str, T)],
) -> impl TypedValueParser<Value = T> {
    let shown = words.iter().map(|(word, help, _)| PossibleValue::new(*word).help(*help));
    PossibleValuesParser::new(shown).try_map(|given| {
        let found = words.iter().find(|(word, ..)| *word == given);
        found.map(|(.., value)| *value).ok_or("unknown word")
    })
}
