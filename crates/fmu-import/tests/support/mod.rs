//! Builds FMUs from `stranger.c`, to test the importer with FMUs that do not come from this project's exporter.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use zip::write::{SimpleFileOptions, ZipWriter};

const SOURCE: &str = include_str!("../data/stranger.c");

/// Options for building an FMU.
pub(crate) struct Build<'a> {
    /// Model identifier and file stem.
    pub(crate) name: &'a str,
    /// Name of the Real input.
    pub(crate) input: &'a str,
    /// Name of the Real output.
    pub(crate) output: &'a str,
    /// Further attributes of `<CoSimulation>`.
    pub(crate) flags: &'a str,
    /// Result of `fmi2GetVersion`.
    pub(crate) version: &'a str,
    /// Export state and derivative functions.
    pub(crate) states: bool,
    /// C statement at the beginning of every step; `i` is the instance.
    pub(crate) step: &'a str,
    /// C declarations at the end of the file.
    pub(crate) declarations: &'a str,
    /// Time in s after which all steps are discarded, and true if the FMU then requests termination.
    pub(crate) ends: Option<(f64, bool)>,
    /// GUID in the description. The binary has the GUID `{name}`.
    pub(crate) guid: &'a str,
    /// Defects, as macros of `stranger.c`.
    pub(crate) defects: &'a [&'a str],
    /// Replacements in the description: old text, new text.
    pub(crate) edits: &'a [(&'a str, &'a str)],
}

impl<'a> Build<'a> {
    /// An integrator from `input` to `output`.
    pub(crate) fn new(name: &'a str, input: &'a str, output: &'a str) -> Self {
        Self {
            name,
            input,
            output,
            flags: "",
            version: "2.0",
            states: true,
            step: "",
            declarations: "",
            ends: None,
            guid: name,
            defects: &[],
            edits: &[],
        }
    }

    /// Compiles and packs the FMU into a folder. On Unix, a C compiler is available wherever Rust is, because it is the
    /// linker of Rust programs.
    pub(crate) fn pack(&self, folder: &Path) -> PathBuf {
        let source = folder.join(format!("{}.c", self.name));
        let binary = source.with_extension("so");
        std::fs::write(&source, format!("{SOURCE}\n{}\n", self.declarations)).unwrap();
        let mut cc = Command::new("cc");
        cc.args(["-O1", "-fPIC", "-shared", "-fvisibility=hidden"])
            // No fused multiply-add, so that results are rounded as in Rust.
            .arg("-ffp-contract=off")
            .arg(format!("-DVERSION=\"{}\"", self.version))
            .arg(format!("-DGUID=\"{}\"", self.name));
        if self.states {
            cc.arg("-DSTATES");
        }
        cc.arg(format!("-DSTEP={}", self.step));
        cc.args(self.defects.iter().map(|defect| format!("-D{defect}")));
        if let Some((time, terminated)) = self.ends {
            cc.arg(format!("-DENDS={time}")).arg(format!("-DTERMINATED={}", u8::from(terminated)));
        }
        let status = cc.arg("-o").arg(&binary).arg(&source).status().unwrap();
        assert!(status.success());
        let path = folder.join(format!("{}.fmu", self.name));
        let mut zip = ZipWriter::new(File::create(&path).unwrap());
        let mut add = |name: &str, content: &[u8]| {
            zip.start_file(name, SimpleFileOptions::default()).unwrap();
            zip.write_all(content).unwrap();
        };
        add("modelDescription.xml", self.description().as_bytes());
        let in_archive =
            format!("binaries/{}/{}{}", fmu_import::archive::platform(), self.name, std::env::consts::DLL_SUFFIX);
        add(&in_archive, &std::fs::read(&binary).unwrap());
        add("resources/note.txt", b"here");
        zip.finish().unwrap();
        std::fs::remove_file(source).unwrap();
        std::fs::remove_file(binary).unwrap();
        path
    }

    fn description(&self) -> String {
        let Self { name, input, output, flags, guid, .. } = self;
        let mut variables = String::new();
        for (variable, reference, causality, typed) in [
            (*input, 0, "input", "<Real start=\"0\"/>"),
            (*output, 1, "output", "<Real unit=\"m\"/>"),
            ("gain", 2, "parameter", "<Real start=\"1\" min=\"-10\" max=\"10\"/>"),
            ("start", 3, "parameter", "<Real unit=\"m\" start=\"0\"/>"),
            ("failure", 0, "parameter", "<Integer start=\"0\"/>"),
            ("count", 1, "output", "<Integer/>"),
            ("inverted", 0, "parameter", "<Boolean start=\"false\"/>"),
            ("moved", 1, "output", "<Boolean/>"),
            ("label", 0, "parameter", "<String start=\"\"/>"),
        ] {
            let variability = match causality {
                "parameter" => " variability=\"fixed\"",
                _ if !typed.starts_with("<Real") => " variability=\"discrete\"",
                _ => "",
            };
            variables += &format!(
                "<ScalarVariable name=\"{variable}\" valueReference=\"{reference}\" causality=\"{causality}\"{variability}>{typed}</ScalarVariable>\n"
            );
        }
        let text = format!(
            "<?xml version=\"1.0\"?>\n<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{name}\" guid=\"{guid}\">\n\
             <CoSimulation modelIdentifier=\"{name}\" {flags}/>\n\
             <UnitDefinitions><Unit name=\"m\"><BaseUnit m=\"1\"/></Unit></UnitDefinitions>\n\
             <ModelVariables>\n{variables}</ModelVariables>\n<ModelStructure/></fmiModelDescription>\n"
        );
        self.edits.iter().fold(text, |text, (from, to)| {
            assert!(text.contains(from), "not in the description: {from}");
            text.replacen(from, to, 1)
        })
    }
}
