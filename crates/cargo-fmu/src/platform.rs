//! The platforms that FMI 2.0 names, and how their libraries are called.

use clap::ValueEnum;
use miette::{Result, miette};

/// A folder below `binaries/` of an FMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, ValueEnum)]
pub(crate) enum Platform {
    /// Linux on x86-64
    #[value(name = "linux64")]
    Linux64,
    /// Windows on x86-64
    #[value(name = "win64")]
    Win64,
    /// macOS
    #[value(name = "darwin64")]
    Darwin64,
}

impl Platform {
    /// The platform of this machine.
    ///
    /// # Errors
    /// FMI 2.0 has no name for it.
    pub(crate) fn this() -> Result<Self> {
        match (std::env::consts::OS, std::env::consts::ARCH) {
            ("linux", "x86_64") => Ok(Self::Linux64),
            ("windows", "x86_64") => Ok(Self::Win64),
            ("macos", _) => Ok(Self::Darwin64),
            (os, arch) => Err(miette!("FMI 2.0 has no platform for {os} on {arch}")),
        }
    }

    /// Name of the folder.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Linux64 => "linux64",
            Self::Win64 => "win64",
            Self::Darwin64 => "darwin64",
        }
    }

    /// Path of the library in the archive.
    pub(crate) fn entry(self, model: &str) -> String {
        format!("binaries/{}/{model}.{}", self.name(), self.extension())
    }

    const fn extension(self) -> &'static str {
        match self {
            Self::Linux64 => "so",
            Self::Win64 => "dll",
            Self::Darwin64 => "dylib",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn this_platform_is_called_as_the_compiler_calls_it() {
        let this = Platform::this().expect("the tests run where FMUs do");
        assert_eq!(this.name(), fmu_import::archive::platform());
        let value = this.to_possible_value().expect("all platforms can be named");
        assert_eq!(value.get_name(), this.name());
    }

    /// FMI 2.0.4, section 2.3: `binaries/win64/<modelIdentifier>.dll`.
    #[test]
    fn a_library_stands_in_the_folder_of_its_platform() {
        assert_eq!(Platform::Win64.entry("Road"), "binaries/win64/Road.dll");
        assert_eq!(Platform::Linux64.entry("Road"), "binaries/linux64/Road.so");
    }
}
