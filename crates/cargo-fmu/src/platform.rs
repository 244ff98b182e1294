//! The platforms that FMUs have libraries for, and the folders of these libraries.

use clap::ValueEnum;
use clap::builder::PossibleValue;
use fmu_import::description::FmiVersion;
use fmu_import::wasm::FOLDER as WASM_FOLDER;
use miette::{Result, miette};

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Platform {
    Linux64,
    Win64,
    Aarch64Linux,
    X86_64Darwin,
    Aarch64Darwin,
    /// WebAssembly with 32-bit addresses, for importers in browsers.
    Wasm32,
}

impl Platform {
    const ALL: [Self; 6] =
        [Self::Linux64, Self::Win64, Self::Aarch64Linux, Self::X86_64Darwin, Self::Aarch64Darwin, Self::Wasm32];
    /// Platform that `darwin64` means on the command line: on a Mac, the platform of this Mac; elsewhere, the platform
    /// in the standard.
    const DARWIN64: Self =
        if cfg!(all(target_os = "macos", target_arch = "aarch64")) { Self::Aarch64Darwin } else { Self::X86_64Darwin };

    pub(crate) fn this() -> Result<Self> {
        match (std::env::consts::OS, std::env::consts::ARCH) {
            ("linux", "x86_64") => Ok(Self::Linux64),
            ("linux", "aarch64") => Ok(Self::Aarch64Linux),
            ("windows", "x86_64") => Ok(Self::Win64),
            ("macos", "x86_64") => Ok(Self::X86_64Darwin),
            ("macos", "aarch64") => Ok(Self::Aarch64Darwin),
            (os, arch) => Err(miette!(
                help = "Pack on one of them; `cargo fmu pack --help` lists what they can build for.",
                "FMUs cannot be packed on {os} with the processor {arch}, only on Linux and macOS with x86_64 or aarch64, and \
                 on Windows with x86_64"
            )),
        }
    }

    /// Returns the name, the folders in FMI 2.0 and 3.0, the target of the compiler, and the extension of a library.
    const fn words(self) -> [&'static str; 5] {
        match self {
            Self::Linux64 => ["linux64", "linux64", "x86_64-linux", "x86_64-unknown-linux-gnu", "so"],
            // The target for Windows 7: see `win64`.
            Self::Win64 => ["win64", "win64", "x86_64-windows", "x86_64-win7-windows-gnu", "dll"],
            Self::Aarch64Linux => {
                ["aarch64-linux", "aarch64-linux", "aarch64-linux", "aarch64-unknown-linux-gnu", "so"]
            }
            Self::X86_64Darwin => ["x86_64-darwin", "darwin64", "x86_64-darwin", "x86_64-apple-darwin", "dylib"],
            Self::Aarch64Darwin => ["aarch64-darwin", "darwin64", "aarch64-darwin", "aarch64-apple-darwin", "dylib"],
            Self::Wasm32 => ["wasm32", WASM_FOLDER, WASM_FOLDER, "wasm32-unknown-unknown", "wasm"],
        }
    }

    /// Name on the command line, in messages and in folders of a build.
    pub(crate) const fn name(self) -> &'static str {
        self.words()[0]
    }

    /// Folder below `binaries/` in FMI 2.0.
    ///
    /// FMI 2.0.4, section 2.3, names the x86 platforms and refers to the tuples of FMI 3.0 for all others. Macs are the
    /// exception: FMPy 0.3.32 and fmutool 2.0 look for the libraries of either processor in `darwin64`. No version
    /// names WebAssembly; its folder is a convention of this project.
    pub(crate) const fn fmi2(self) -> &'static str {
        self.words()[1]
    }

    /// Folder below `binaries/` in FMI 3.0, a platform tuple (FMI 3.0.2, section 2.5.1.4.1).
    pub(crate) const fn fmi3(self) -> &'static str {
        self.words()[2]
    }

    /// Target of the compiler in a build on another machine.
    pub(crate) const fn target(self) -> &'static str {
        self.words()[3]
    }

    /// Extension of a library, without the dot.
    pub(crate) const fn extension(self) -> &'static str {
        self.words()[4]
    }

    pub(crate) const fn is_linux(self) -> bool {
        matches!(self, Self::Linux64 | Self::Aarch64Linux)
    }

    pub(crate) const fn is_darwin(self) -> bool {
        matches!(self, Self::X86_64Darwin | Self::Aarch64Darwin)
    }

    pub(crate) fn entry(self, fmi: FmiVersion, model: &str) -> String {
        let folder = if fmi == FmiVersion::V2 { self.fmi2() } else { self.fmi3() };
        format!("binaries/{folder}/{model}.{}", self.extension())
    }

    /// Environment variable with the folder of a toolchain that has the sources of the standard library.
    pub(crate) fn variable(self) -> String {
        format!("CHASSIS_FMU_{}_RUST", self.name().to_uppercase().replace('-', "_"))
    }
}

/// The command line accepts the names of both FMI versions.
impl ValueEnum for Platform {
    fn value_variants<'a>() -> &'a [Self] {
        &Self::ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let value = PossibleValue::new(self.name()).alias(self.fmi3());
        Some(if *self == Self::DARWIN64 { value.alias(self.fmi2()) } else { value })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_platform_has_the_folder_that_the_importer_reads() {
        let this = Platform::this().expect("the tests run where FMUs do");
        assert_eq!(this.fmi2(), fmu_import::archive::platform());
        assert_eq!(format!(".{}", this.extension()), std::env::consts::DLL_SUFFIX);
        let tuple = format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS.replace("macos", "darwin"));
        assert_eq!(this.fmi3(), tuple);
    }

    /// FMI 2.0.4, section 2.3: `binaries/win64/<modelIdentifier>.dll`.
    #[test]
    fn a_library_is_in_the_folder_of_its_platform() {
        let entries = Platform::ALL.map(|platform| platform.entry(FmiVersion::V2, "Road"));
        assert_eq!(
            entries,
            [
                "binaries/linux64/Road.so",
                "binaries/win64/Road.dll",
                "binaries/aarch64-linux/Road.so",
                "binaries/darwin64/Road.dylib",
                "binaries/darwin64/Road.dylib",
                "binaries/wasm32-unknown-unknown/Road.wasm"
            ]
        );
    }

    /// FMI 3.0.2, section 2.5.1.4.1: `<architecture>-<system>`, with the systems `darwin`, `linux` and `windows`.
    #[test]
    fn folders_of_fmi_3_are_platform_tuples() {
        let folders = Platform::ALL.map(Platform::fmi3);
        let tuples = ["x86_64-linux", "x86_64-windows", "aarch64-linux", "x86_64-darwin", "aarch64-darwin"];
        assert_eq!(folders[..5], tuples);
        assert_eq!(folders[5], "wasm32-unknown-unknown", "a convention of this project");
    }

    #[test]
    fn the_names_of_both_versions_are_accepted() {
        for platform in Platform::ALL {
            for name in [platform.name(), platform.fmi3()] {
                assert_eq!(Platform::from_str(name, false), Ok(platform), "{name}");
            }
            if !platform.is_darwin() {
                assert_eq!(Platform::from_str(platform.fmi2(), false), Ok(platform));
            }
        }
        assert_eq!(Platform::from_str("darwin64", false), Ok(Platform::DARWIN64));
    }

    /// Reference: the output of `rustc --print target-list` with rustc 1.95.
    #[test]
    fn targets_are_those_of_the_compiler() {
        let targets = Platform::ALL.map(Platform::target);
        assert_eq!(
            targets,
            [
                "x86_64-unknown-linux-gnu",
                "x86_64-win7-windows-gnu",
                "aarch64-unknown-linux-gnu",
                "x86_64-apple-darwin",
                "aarch64-apple-darwin",
                "wasm32-unknown-unknown"
            ]
        );
    }

    #[test]
    fn a_variable_names_the_toolchain_of_a_platform() {
        assert_eq!(Platform::Win64.variable(), "CHASSIS_FMU_WIN64_RUST");
        assert_eq!(Platform::Aarch64Linux.variable(), "CHASSIS_FMU_AARCH64_LINUX_RUST");
    }
}
