//! `chassis schema`: JSON Schemas of the formats.

use miette::{IntoDiagnostic as _, Result};

#[derive(Debug, Clone, Copy, clap::ValueEnum)]
pub(crate) enum Format {
    /// Scenario file, or a part that scenarios include (TOML)
    Scenario,
    /// Study file (TOML)
    Study,
    /// Vehicle file of the test bench (TOML)
    Vehicle,
    /// Output of `chassis plan --json`
    Plan,
}

impl Format {
    pub(crate) fn text(self) -> Result<String> {
        let schema = match self {
            Self::Scenario => fmu_system::schema::scenario(),
            Self::Study => fmu_study::study::schema(),
            Self::Vehicle => fmu_assess::vehicle::schema(),
            Self::Plan => fmu_system::plan::schema(),
        };
        serde_json::to_string_pretty(&schema).into_diagnostic()
    }
}
