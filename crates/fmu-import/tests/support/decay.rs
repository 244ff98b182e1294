//! Builds FMUs of FMI 2.0 and 3.0, for co-simulation and model exchange, from `decay.c`, and FMUs with clocks, for
//! co-simulation and scheduled execution, from `clocks.c`.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use zip::write::{SimpleFileOptions, ZipWriter};

use fmu_import::archive::platform_of;
use fmu_import::description::FmiVersion;

const SOURCE: &str = include_str!("../data/decay.c");
const DESCRIPTION_2: &str = include_str!("../data/decay2.xml");
const DESCRIPTION_3: &str = include_str!("../data/decay3.xml");
const CLOCKS: [&str; 2] = [include_str!("../data/clocks.c"), include_str!("../data/clocks.xml")];

/// Options for building an FMU.
pub(crate) struct Decay<'a> {
    pub(crate) fmi: FmiVersion,
    /// True for `clocks.c`, false for `decay.c`.
    pub(crate) has_clocks: bool,
    /// Defects, as macros of the source.
    pub(crate) defects: &'a [&'a str],
    /// Replacements in the description: old text, new text.
    pub(crate) edits: &'a [(&'a str, &'a str)],
    /// The element `Terminals` of terminalsAndIcons.xml; empty for none.
    pub(crate) terminals: &'a str,
}

impl Decay<'_> {
    pub(crate) fn new(fmi: FmiVersion) -> Self {
        Self { fmi, has_clocks: false, defects: &[], edits: &[], terminals: "" }
    }

    /// Compiles and packs the FMU into a folder, as `Decay2.fmu` or `Decay3.fmu`.
    pub(crate) fn pack(&self, folder: &Path) -> PathBuf {
        let (number, description) = match self.fmi {
            FmiVersion::V2 => (2, DESCRIPTION_2),
            FmiVersion::V3 => (3, if self.has_clocks { CLOCKS[1] } else { DESCRIPTION_3 }),
        };
        let source = folder.join("decay.c");
        let binary = source.with_extension("so");
        std::fs::write(&source, if self.has_clocks { CLOCKS[0] } else { SOURCE }).unwrap();
        let mut cc = Command::new("cc");
        cc.args(["-O1", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off"]).arg(format!("-DFMI={number}"));
        cc.args(self.defects.iter().map(|defect| format!("-D{defect}")));
        let status = cc.arg("-o").arg(&binary).arg(&source).arg("-lm").status().unwrap();
        assert!(status.success());
        let path = folder.join(format!("Decay{number}.fmu"));
        let mut zip = ZipWriter::new(File::create(&path).unwrap());
        let mut add = |name: &str, content: &[u8]| {
            zip.start_file(name, SimpleFileOptions::default()).unwrap();
            zip.write_all(content).unwrap();
        };
        let description = self.edits.iter().fold(description.to_owned(), |text, (from, to)| {
            assert!(text.contains(from), "not in the description: {from}");
            text.replacen(from, to, 1)
        });
        add("modelDescription.xml", description.as_bytes());
        let suffix = std::env::consts::DLL_SUFFIX;
        add(&format!("binaries/{}/Decay{suffix}", platform_of(self.fmi)), &std::fs::read(&binary).unwrap());
        add("resources/note.txt", b"here");
        if !self.terminals.is_empty() {
            let text = format!("<fmiTerminalsAndIcons fmiVersion=\"3.0\">{}</fmiTerminalsAndIcons>", self.terminals);
            add("terminalsAndIcons/terminalsAndIcons.xml", text.as_bytes());
        }
        zip.finish().unwrap();
        std::fs::remove_file(source).unwrap();
        std::fs::remove_file(binary).unwrap();
        path
    }
}
