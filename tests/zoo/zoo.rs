//! Builds FMUs with the habits of other tools from `zoo.c`. Tests of all packages include this file by its path.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use zip::write::{SimpleFileOptions, ZipWriter};

use fmu_import::archive::platform_of;
use fmu_import::description::FmiVersion;

const SOURCE: &str = include_str!("zoo.c");

/// Build settings of an FMU.
pub(crate) struct Zoo<'a> {
    pub(crate) fmi: FmiVersion,
    /// File stem.
    pub(crate) name: &'a str,
    /// Model identifier, and stem of the library.
    pub(crate) identifier: &'a str,
    /// Name of the initial habit; scenarios can set the parameter `habit`.
    pub(crate) habit: &'a str,
    /// Time at which the habit begins, s.
    pub(crate) at: f64,
    /// The file of the habit `write`.
    pub(crate) file: &'a str,
    /// Texts in the description, and their replacements.
    pub(crate) edits: &'a [(&'a str, &'a str)],
}

impl<'a> Zoo<'a> {
    /// An FMI 2.0 FMU named `Zoo`, with a habit that begins at the start.
    pub(crate) fn new(habit: &'a str) -> Self {
        Self { fmi: FmiVersion::V2, name: "Zoo", identifier: "Zoo", habit, at: 0.0, file: "none", edits: &[] }
    }

    /// Compiles and packs the FMU into a folder.
    pub(crate) fn pack(&self, folder: &Path) -> PathBuf {
        let Self { fmi, name, identifier, habit, at, file, edits } = *self;
        let names = SOURCE.lines().filter_map(|line| line.strip_prefix("    habit_")?.split_once(','));
        let names: Vec<&str> = names.map(|(name, _)| name).collect();
        let chosen = names.iter().position(|known| *known == habit).expect("a habit of zoo.c");
        let items: String =
            names.iter().enumerate().map(|(i, name)| format!("<Item name=\"{name}\" value=\"{i}\"/>")).collect();
        let (number, description) = match fmi {
            FmiVersion::V2 => (2, include_str!("zoo2.xml")),
            FmiVersion::V3 => (3, include_str!("zoo3.xml")),
        };

        let (source, binary) = (folder.join("zoo.c"), folder.join("zoo.so"));
        std::fs::write(&source, SOURCE).unwrap();
        let mut cc = Command::new("cc");
        cc.args(["-O1", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off"]);
        cc.arg(format!("-DFMI={number}")).arg(format!("-DHABIT=habit_{habit}")).arg(format!("-DAT={at:?}"));
        cc.arg(format!("-DTARGET=\"{file}\"")).arg("-o").arg(&binary).arg(&source).args(["-lm", "-pthread"]);
        assert!(cc.status().unwrap().success());

        let values = [
            ("@IDENTIFIER@", identifier.to_owned()),
            ("@HABITS@", items),
            ("@HABIT@", chosen.to_string()),
            ("@AT@", at.to_string()),
            ("@FILE@", file.to_owned()),
        ];
        let text = values.iter().fold(description.to_owned(), |text, (from, to)| text.replace(from, to));
        let text = edits.iter().fold(text, |text, (from, to)| {
            assert!(text.contains(from), "not in the description: {from}");
            text.replacen(from, to, 1)
        });
        let path = folder.join(format!("{name}.fmu"));
        let mut zip = ZipWriter::new(File::create(&path).unwrap());
        let mut add = |name: &str, content: &[u8]| {
            zip.start_file(name, SimpleFileOptions::default()).unwrap();
            zip.write_all(content).unwrap();
        };
        add("modelDescription.xml", text.as_bytes());
        let suffix = std::env::consts::DLL_SUFFIX;
        add(&format!("binaries/{}/{identifier}{suffix}", platform_of(fmi)), &std::fs::read(&binary).unwrap());
        zip.finish().unwrap();
        std::fs::remove_file(source).unwrap();
        std::fs::remove_file(binary).unwrap();
        path
    }
}
