//! Passes damaged and hostile FMUs to every command that opens FMUs. The command must print a message, return an exit
//! code, and leave nothing behind.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

mod programs;

use programs::program;
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::path::Path;
use std::process::{Command, Output};
use tempfile::TempDir;
use zip::ZipArchive;
use zip::write::{SimpleFileOptions, ZipWriter};

const SCENARIO: &str = include_str!("data/ramp.toml");

const STUDY: &str = r#"title = "Ramp"
scenario = "ramp.toml"
method = "optimize"
[budget]
evaluations = 10
[[parameter]]
name = "ramp:gain"
min = -2.0
max = 8.0
[[objective.term]]
signal = "x"
kind = "rms"
weight = 1.0
[[search]]
kind = "ga"
settings = { population = 5 }
"#;

const SYSTEM: &str = "<ssd:SystemStructureDescription version='1.0' name='ramp'><ssd:System name='s'><ssd:Elements>
<ssd:Component name='ramp' source='resources/Ramp.fmu'/></ssd:Elements></ssd:System>
<ssd:DefaultExperiment stopTime='1'/></ssd:SystemStructureDescription>";

/// Last part of an FMU that a command reads; damage in later parts is not noticed.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Part {
    Archive,
    Description,
    Binary,
}
use Part::{Archive, Binary, Description};

/// The commands that open an FMU.
const COMMANDS: [(&str, Part); 12] = [
    ("inspect --xml Ramp.fmu", Archive),
    ("inspect Ramp.fmu", Description),
    ("plan ramp.toml --fmus .", Description),
    ("export ramp.toml --fmus . --out system", Description),
    ("fits --fmus .", Description),
    ("plan ramp.ssp", Description),
    ("run ramp.ssp", Binary),
    ("check Ramp.fmu", Binary),
    ("run ramp.toml --fmus .", Binary),
    ("linearize Ramp.fmu", Binary),
    ("trim Ramp.fmu", Binary),
    ("study study.toml --fmus .", Binary),
];

/// Limit of a command's processor time in s, because hostile FMUs must not keep a command busy. Other processes do not
/// affect it. A command that takes longer is killed and has no exit code.
const PROCESSOR_TIME: u32 = 30;
/// Limit of a command's address space in kB: hostile FMUs must not fill the memory.
const MEMORY: u32 = 4 << 20;

/// A valid FMU, which tests damage.
struct Sound {
    description: String,
    binary: Vec<u8>,
}

impl Sound {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let mut zip =
            ZipArchive::new(File::open(support::Build::new("Ramp", "u", "x").pack(folder.path())).unwrap()).unwrap();
        let mut read = |name: &str| {
            let mut bytes = Vec::new();
            zip.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
            bytes
        };
        Self { description: String::from_utf8(read("modelDescription.xml")).unwrap(), binary: read(&binary()) }
    }

    fn entries(&self) -> Vec<(String, Vec<u8>)> {
        vec![
            ("modelDescription.xml".to_owned(), self.description.clone().into_bytes()),
            (binary(), self.binary.clone()),
            ("resources/note.txt".to_owned(), b"here".to_vec()),
        ]
    }

    fn bytes(&self) -> Vec<u8> {
        zipped(&self.entries())
    }

    /// Returns the archive with one more entry.
    fn with(&self, name: &str, content: &[u8]) -> Vec<u8> {
        let mut entries = self.entries();
        entries.push((name.to_owned(), content.to_vec()));
        zipped(&entries)
    }

    /// Returns the archive with another description.
    fn described(&self, description: impl Into<Vec<u8>>) -> Vec<u8> {
        let mut entries = self.entries();
        entries[0].1 = description.into();
        zipped(&entries)
    }

    /// Returns the archive with a part of the description replaced.
    fn changed(&self, from: &str, to: &str) -> Vec<u8> {
        assert!(self.description.contains(from), "not in the description: {from}");
        self.described(self.description.replacen(from, to, 1))
    }

    /// Returns the archive with another binary, or without a binary.
    fn loading(&self, name: &str, content: Option<&[u8]>) -> Vec<u8> {
        let mut entries = self.entries();
        match content {
            Some(content) => entries[1] = (name.to_owned(), content.to_vec()),
            None => drop(entries.remove(1)),
        }
        zipped(&entries)
    }
}

/// Name of the binary in the archive.
fn binary() -> String {
    format!("binaries/{}/Ramp{}", fmu_import::archive::platform(), std::env::consts::DLL_SUFFIX)
}

/// An archive whose entries are not compressed, so that single bytes of them can be changed.
fn zipped(entries: &[(String, Vec<u8>)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, content) in entries {
        zip.start_file(name, options).unwrap();
        zip.write_all(content).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

/// Positions of a byte sequence.
fn places(bytes: &[u8], what: &[u8]) -> Vec<usize> {
    bytes.windows(what.len()).enumerate().filter(|(_, window)| *window == what).map(|(at, _)| at).collect()
}

/// Changes the headers of an entry: at `local` in the local header, at `central` in the central directory.
fn header(mut bytes: Vec<u8>, name: &str, [local, central]: [usize; 2], change: impl Fn(&mut [u8])) -> Vec<u8> {
    let at = places(&bytes, name.as_bytes());
    let [first, second] = at[..] else { panic!("{name} is not there twice: {at:?}") };
    // Before the name, a local header has 30 bytes, and a central header has 46.
    change(&mut bytes[first - 30 + local..]);
    change(&mut bytes[second - 46 + central..]);
    bytes
}

/// An SSP file with a structure and `Ramp.fmu`.
fn system(structure: &str, fmu: &[u8]) -> Vec<u8> {
    let structure = structure.as_bytes().to_vec();
    zipped(&[("SystemStructure.ssd".to_owned(), structure), ("resources/Ramp.fmu".to_owned(), fmu.to_vec())])
}

/// A folder with the scenario, the study, and a folder for temporary files.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    std::fs::write(folder.path().join("ramp.toml"), SCENARIO).unwrap();
    std::fs::write(folder.path().join("study.toml"), STUDY).unwrap();
    std::fs::create_dir(folder.path().join("temporary")).unwrap();
    folder
}

fn command(folder: &Path, command: &str) -> Output {
    let packed = folder.join("ramp.ssp");
    let is_packed = command.contains("ramp.ssp") && !packed.exists();
    if is_packed {
        std::fs::write(&packed, system(SYSTEM, &std::fs::read(folder.join("Ramp.fmu")).unwrap())).unwrap();
    }
    let limits = format!("ulimit -v {MEMORY}; ulimit -t {PROCESSOR_TIME}");
    let output = Command::new("sh")
        .args(["-c", &format!("{limits}; exec \"$0\" {command} 2>stderr")])
        .arg(program(command.split(' ').next().unwrap()))
        .current_dir(folder)
        .env("TMPDIR", folder.join("temporary"))
        .env("NO_COLOR", "1")
        .env("CHASSIS_PYTHON", "")
        .output()
        .unwrap();
    if is_packed {
        std::fs::remove_file(packed).unwrap();
    }
    assert!(output.status.code().is_some(), "{command} ends with {}", output.status);
    Output { stderr: std::fs::read(folder.join("stderr")).unwrap(), ..output }
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// A message without the line breaks that a narrow terminal needs.
fn message(output: &Output) -> String {
    let text = format!("{} {}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    text.split([' ', '\n', '│']).filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ")
}

/// Writes the file and checks that every command that reads up to the damage rejects it.
fn rejected(what: &str, bytes: &[u8], part: Part, expected: &str) {
    rejected_by(what, |path| std::fs::write(path, bytes).unwrap(), part, expected);
}

fn rejected_by(what: &str, write: impl FnOnce(&Path), part: Part, expected: &str) {
    let folder = folder();
    let folder = folder.path();
    write(&folder.join("Ramp.fmu"));
    // Lines may break anywhere.
    let dense = |text: &str| text.split_whitespace().collect::<String>();
    let is_file = folder.join("Ramp.fmu").is_file();
    for (line, _) in COMMANDS.iter().filter(|(line, depth)| *depth >= part && (is_file || !line.contains("ssp"))) {
        let output = command(folder, line);
        let said = message(&output);
        assert_eq!(output.status.code(), Some(1), "{what}: {line} ends with {}: {said}", output.status);
        assert!(dense(&said).contains(&dense(expected)), "{what}: {line} does not say {expected:?}: {said}");
        assert!(said.contains("Ramp.fmu") && !said.contains("panicked"), "{what}: {line}: {said}");
        // A run that was started leaves its status, but no rows, behind.
        let results = folder.join("results");
        if line.starts_with("run") && results.exists() {
            assert_eq!(names(&results.join("ramp/runs")), ["status.json"], "{what}: {line}");
            std::fs::remove_dir_all(results).unwrap();
        }
        assert_eq!(names(folder), ["Ramp.fmu", "ramp.toml", "stderr", "study.toml", "temporary"], "{what}: {line}");
        assert_eq!(names(&folder.join("temporary")), [""; 0], "{what}: {line}");
    }
}

#[test]
fn a_sound_fmu_is_accepted() {
    let folder = folder();
    std::fs::write(folder.path().join("Ramp.fmu"), Sound::new().bytes()).unwrap();
    for (line, _) in COMMANDS {
        let output = command(folder.path(), line);
        // `check` finds errors in this FMU; it is not a plant and has no derivatives.
        let is_due = !["check", "linearize", "trim", "fits"].contains(&line.split(' ').next().unwrap());
        assert_eq!(output.status.success(), is_due, "{line}: {}", message(&output));
        assert_eq!(names(&folder.path().join("temporary")), [""; 0], "{line}");
    }
}

#[test]
fn a_file_that_is_no_archive_is_rejected() {
    let sound = Sound::new().bytes();
    rejected("an empty file", b"", Archive, "not a readable archive");
    rejected("text", b"this is no FMU", Archive, "not a readable archive");
    rejected(
        "noise",
        &(0..10_000_u32).map(|i| ((i * i) >> 3) as u8).collect::<Vec<_>>(),
        Archive,
        "not a readable archive",
    );
    for length in [1, 4, 30, sound.len() / 4, sound.len() / 2, sound.len() - 100, sound.len() - 22, sound.len() - 1] {
        rejected(&format!("{length} bytes"), &sound[..length], Archive, "not a readable archive");
    }
    rejected_by("a folder", |path| std::fs::create_dir(path).unwrap(), Archive, "it is a folder");
}

#[test]
fn an_archive_that_reaches_out_is_rejected() {
    let sound = Sound::new();
    for name in ["../evil", "/evil", "resources/../../evil", "resources\\..\\evil", "C:evil", "resources/a\0b"] {
        rejected(name, &sound.with(name, b"x"), Archive, "is not a path within the archive");
    }
    let mut zip = ZipWriter::new_append(std::io::Cursor::new(sound.bytes())).unwrap();
    zip.add_symlink("resources/link", "/etc/passwd", SimpleFileOptions::default()).unwrap();
    rejected("a link", &zip.finish().unwrap().into_inner(), Archive, "is a link");
}

#[test]
fn damaged_entries_are_rejected() {
    let sound = Sound::new();
    let (xml, library) = ("modelDescription.xml", binary());
    let flip = |mut bytes: Vec<u8>, part: &[u8]| {
        let at = places(&bytes, part)[0];
        bytes[at] ^= 1;
        bytes
    };
    rejected("no description", &zipped(&sound.entries()[1..]), Archive, "modelDescription.xml");
    let inside: Vec<_> = sound.entries().into_iter().map(|(name, content)| (format!("Ramp/{name}"), content)).collect();
    rejected("all in a folder", &zipped(&inside), Archive, "Ramp/modelDescription.xml");
    let mut twice = sound.with("modelDescription.xmk", sound.description.as_bytes());
    for at in places(&twice, b"modelDescription.xmk") {
        twice[at + 19] = b'l';
    }
    rejected("two descriptions", &twice, Archive, "twice");
    rejected("a changed description", &flip(sound.bytes(), b"Ramp\" guid"), Archive, "modelDescription.xml");
    rejected("a changed binary", &flip(sound.bytes(), &sound.binary[..64]), Binary, &library);
    let encrypted = |name: &str| header(sound.bytes(), name, [6, 8], |flags| flags[0] |= 1);
    rejected("an encrypted description", &encrypted(xml), Archive, "encrypted");
    rejected("an encrypted binary", &encrypted(&library), Binary, "encrypted");
    let packed = |name: &str| header(sound.bytes(), name, [8, 10], |method| method[0] = 93);
    rejected("a description packed in an unknown way", &packed(xml), Archive, "ompression");
    rejected("a binary packed in an unknown way", &packed(&library), Binary, "ompression");
}

#[test]
fn bombs_are_rejected() {
    let sound = Sound::new();
    // Declared sizes that are wrong.
    let stated = |name: &str, size: u32| {
        header(sound.bytes(), name, [22, 24], |field| field[..4].copy_from_slice(&size.to_le_bytes()))
    };
    for name in ["modelDescription.xml", "resources/note.txt"] {
        rejected(name, &stated(name, 0xffff_fff0), Archive, "unpacks to 4294967280 bytes, at most 1073741824 are");
    }
    rejected("a large description", &stated("modelDescription.xml", 1 << 30), Archive, "the ratio must not exceed 200");
    rejected("a long description", &sound.described(vec![b' '; 67_108_865]), Archive, "at most 67108864 are read");
    for (size, expected) in [(0, "larger than its declared"), (100_000, "is not the 100000 bytes")] {
        rejected("a description", &stated("modelDescription.xml", size), Archive, expected);
        rejected("a resource", &stated("resources/note.txt", size), Binary, expected);
    }
    // An actual size that is too large: a description of 200 MB, compressed to 200 kB.
    let mut zip = ZipWriter::new(std::io::Cursor::new(Vec::new()));
    zip.start_file("modelDescription.xml", SimpleFileOptions::default()).unwrap();
    zip.write_all(&vec![b' '; 200_000_000]).unwrap();
    rejected("a dense description", &zip.finish().unwrap().into_inner(), Archive, "the ratio must not exceed 200");
    let mut zip = ZipWriter::new_append(std::io::Cursor::new(sound.bytes())).unwrap();
    for number in 0..100_000 {
        zip.start_file(format!("resources/{number}"), SimpleFileOptions::default()).unwrap();
    }
    rejected("many entries", &zip.finish().unwrap().into_inner(), Archive, "100003 entries, at most 100000 are");
    // The entry consists of zeros, which are compressed by a factor of 1000 and would fill the disk.
    let mut zip = ZipWriter::new_append(std::io::Cursor::new(sound.bytes())).unwrap();
    zip.start_file("binaries/zeros.bin", SimpleFileOptions::default()).unwrap();
    let zeros = vec![0; 100_000_000];
    zip.write_all(&zeros).unwrap();
    rejected("zeros", &zip.finish().unwrap().into_inner(), Archive, "the ratio must not exceed 200");
}

/// A structure with 100,000 elements, connections or values is rejected or read in time, and its text does not control
/// the terminal.
#[test]
fn hostile_structures_are_rejected() {
    let fmu = Sound::new().bytes();
    let many = |text: &str| text.repeat(100_000);
    let component = "<ssd:Component name='ramp' source='resources/Ramp.fmu'";
    let with = |elements: String, connections: String| {
        let connections = format!("</ssd:Elements><ssd:Connections>{connections}</ssd:Connections>");
        SYSTEM.replace("</ssd:Elements>", &connections).replace(&format!("{component}/>"), &elements)
    };
    let value = "<ssv:Parameter name='a'><ssv:Real value='1'/></ssv:Parameter>".to_owned();
    let values: String = (0..100_000).map(|i| value.replace("'a'", &format!("'a{i}'"))).collect();
    let set = format!(
        "<ssv:ParameterSet version='1.0' name='p'><ssv:Parameters>{values}</ssv:Parameters></ssv:ParameterSet>"
    );
    let binding = format!(
        "{component}><ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>{set}</ssd:ParameterValues>\
         </ssd:ParameterBinding></ssd:ParameterBindings></ssd:Component>"
    );
    let component = format!("{component}/>\n");
    let components: String = (0..100_000).map(|i| component.replace("'ramp'", &format!("'r{i}'"))).collect();
    let connection = "<ssd:Connection startElement='ramp' startConnector='x' endElement='ramp' endConnector='u'/>\n";
    for (structure, expected) in [
        (with(components, String::new()), "there are more than 1000 components and systems"),
        (with(component.clone(), many(connection)), "a second connection writes `u`"),
        (with(binding, String::new()), "`a1` is not a variable"),
        (with(component.replace("'ramp'", "'r\u{9b}2J\u{202e}'"), many("<ssd:Connection/>")), "lacks the attribute"),
        (with(component.replace("Ramp", "R\u{9b}2J\u{202e}"), String::new()), "the archive does not contain"),
    ] {
        let folder = folder();
        std::fs::write(folder.path().join("ramp.ssp"), system(&structure, &fmu)).unwrap();
        let output = command(folder.path(), "plan ramp.ssp");
        let said = message(&output);
        assert!(said.contains(expected) && !said.contains("panicked"), "{expected}: {said:.1000}");
        assert!(!said.contains(['\u{9b}', '\u{202e}']) && said.len() < 200_000, "{expected}: {said:.1000}");
        assert_eq!(names(&folder.path().join("temporary")), [""; 0], "{expected}");
    }
}

/// Programs interpret these archives differently, so one program could unpack other content than another has checked.
#[test]
fn ambiguous_archives_are_rejected() {
    let sound = Sound::new();
    // Another archive as the comment of this one; the last two bytes are the length of the comment.
    let mut bytes = sound.bytes();
    let other = zipped(&sound.entries()[..1]);
    let length = u16::try_from(other.len()).unwrap().to_le_bytes();
    let at = bytes.len() - 2;
    bytes[at..].copy_from_slice(&length);
    bytes.extend(&other);
    rejected("an archive in the comment", &bytes, Archive, "it has several end records");
    // An end record of zip64 that states one entry fewer.
    let (bytes, end) = (sound.bytes(), 22);
    let (front, end) = bytes.split_at(bytes.len() - end);
    let [size, start] = [12, 16].map(|at| u64::from(u32::from_le_bytes(end[at..at + 4].try_into().unwrap())));
    let mut wide = b"PK\x06\x06".to_vec();
    wide.extend(44_u64.to_le_bytes());
    wide.extend([0; 12]);
    wide.extend([2, 2, size, start].map(u64::to_le_bytes).concat());
    wide.extend(b"PK\x06\x07\0\0\0\0");
    wide.extend((front.len() as u64).to_le_bytes());
    wide.extend(1_u32.to_le_bytes());
    let bytes = [front, &wide, end].concat();
    rejected("an end record of zip64", &bytes, Archive, "its end record contains 3 entries, its zip64 end record 2");
    // Two names for the same content.
    let bytes = header(sound.bytes(), "resources/note.txt", [30, 30], |_| ());
    let last = *places(&bytes, b"resources/note.txt").last().unwrap();
    let mut bytes = bytes;
    bytes[last] = b'R';
    rejected("two names", &bytes, Archive, "has another name, `resources/note.txt`, in its local header");
}

/// Finding a name takes the same time no matter how many names there are. The FMU has 100,000 units of measure, each
/// used by one variable, and as many dependencies.
#[test]
fn many_units_and_dependencies_are_read_in_time() {
    let sound = Sound::new();
    let count = 100_000;
    let units: String = (0..count).map(|i| format!("<Unit name=\"u{i}\"/>")).collect();
    let variables: String = (0..count)
        .map(|i| format!("<ScalarVariable name=\"p{i}\" valueReference=\"1\" causality=\"output\"><Real unit=\"u{i}\"/></ScalarVariable>\n"))
        .collect();
    let unknowns: String =
        (0..count).map(|i| format!("<Unknown index=\"{}\" dependencies=\"1 2 3\"/>", i + 10)).collect();
    let text = sound.description.replace("</UnitDefinitions>", &format!("{units}</UnitDefinitions>"));
    let text = text.replace("</ModelVariables>", &format!("{variables}</ModelVariables>"));
    let text =
        text.replace("<ModelStructure/>", &format!("<ModelStructure><Outputs>{unknowns}</Outputs></ModelStructure>"));
    let folder = folder();
    std::fs::write(folder.path().join("Ramp.fmu"), sound.described(text)).unwrap();
    // All outputs are recorded.
    let scenario = SCENARIO.replace("\"x\"", "\"*\"");
    std::fs::write(folder.path().join("all.toml"), scenario).unwrap();
    for line in [
        "inspect Ramp.fmu",
        "check Ramp.fmu",
        "plan ramp.toml --fmus .",
        "plan all.toml --fmus .",
        "run ramp.toml --fmus .",
    ] {
        let output = command(folder.path(), line);
        let said = message(&output);
        assert!(
            output.status.code().is_some() && !said.contains("panicked"),
            "{line}: {}",
            &said[..said.len().min(2000)]
        );
        assert_eq!(output.status.success(), !line.starts_with("check"), "{line}: {}", &said[..said.len().min(2000)]);
        // `check` reports that every output is missing in InitialUnknowns, but does not list all of these errors.
        let is_cut = said.contains("further errors and") && said.matches(" error: ").count() < 1010;
        assert_eq!(is_cut, line.starts_with("check"), "{line}: {} bytes", said.len());
    }
}

/// An enumeration of 50,000 items shared by 50,000 variables, and a unit with a name of 1 MB.
#[test]
fn what_many_variables_inherit_takes_no_memory_of_each() {
    let sound = Sound::new();
    let items: String = (0..50_000).map(|i| format!("<Item name=\"i{i}\" value=\"{i}\"/>")).collect();
    let of_type = |typed: &str, definition: &str| {
        let variables: String = (0..50_000)
            .map(|i| format!("<ScalarVariable name=\"p{i}\" valueReference=\"0\" causality=\"parameter\" variability=\"fixed\">{typed}</ScalarVariable>\n"))
            .collect();
        let text = sound.description.replace(
            "<ModelVariables>",
            &format!(
                "<TypeDefinitions><SimpleType name=\"T\">{definition}</SimpleType></TypeDefinitions><ModelVariables>"
            ),
        );
        sound.described(text.replace("</ModelVariables>", &format!("{variables}</ModelVariables>")))
    };
    let folder = folder();
    let items =
        of_type("<Enumeration declaredType=\"T\" start=\"49999\"/>", &format!("<Enumeration>{items}</Enumeration>"));
    std::fs::write(folder.path().join("Ramp.fmu"), items).unwrap();
    for line in ["inspect Ramp.fmu", "check Ramp.fmu", "plan ramp.toml --fmus ."] {
        let output = command(folder.path(), line);
        assert!(output.status.code().is_some(), "{line}: {}", output.status);
    }
    let long = format!("<Real unit=\"{}\"/>", "m".repeat(1_000_000));
    let long = of_type("<Real declaredType=\"T\" start=\"1\"/>", &long);
    rejected("a long unit", &long, Description, "`unit` of <Real> has 1000000 bytes, at most 200 are read");
}

/// ESC begins a control sequence of a terminal, U+009B is its second form, U+202E reverses the text direction.
#[test]
fn text_of_an_fmu_does_not_control_the_terminal() {
    let sound = Sound::new();
    let wild = |text: &str| text.chars().any(|c| (c.is_control() && c != '\n') || c == '\u{202e}');
    let name = "gain\u{9b}31m\u{202e}nig\n  error: none";
    let described = sound
        .description
        .replace(
            "name=\"gain\"",
            &format!("name=\"{}\" description=\"\u{9b}2J&#10;forged\"", name.replace('\n', "&#10;")),
        )
        .replace("modelName=\"Ramp\"", "modelName=\"Ramp\u{202e}pmaR\"")
        .replace("unit=\"m\"/>", "unit=\"\u{9b}m\"/>");
    let folder = folder();
    let mut shown = String::new();
    // The GUID is not that of the binary. The message of the FMU quotes it.
    for guid in ["guid=\"Ramp\"", "guid=\"Ra\u{9b}5mmp\""] {
        let text = described.replace("guid=\"Ramp\"", guid);
        std::fs::write(folder.path().join("Ramp.fmu"), sound.described(text)).unwrap();
        for (line, _) in COMMANDS.iter().filter(|(line, _)| !line.contains("--xml")) {
            let output = command(folder.path(), line);
            for text in [String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr)] {
                assert!(!wild(&text), "{line}: {text:?}");
                shown += &text;
            }
        }
    }
    assert!(shown.contains("gain\\u009b31m\\u202enig\\n  error: none"), "{shown}");
    assert!(shown.contains("\\u009b2J\\nforged") && shown.contains("Ramp\\u202epmaR"), "{shown}");
    // In a pipe, the description is unchanged.
    let output = command(folder.path(), "inspect --xml Ramp.fmu");
    assert!(wild(&String::from_utf8_lossy(&output.stdout)));
}

#[test]
fn hostile_descriptions_are_rejected() {
    let sound = Sound::new();
    let start = "<?xml version=\"1.0\"?>\n";
    let laughs: String =
        (1..10).map(|i| format!("<!ENTITY l{i} \"{}\">", format!("&l{};", i - 1).repeat(10))).collect();
    let laughs = format!("{start}<!DOCTYPE l [<!ENTITY l0 \"ha\">{laughs}]>\n");
    rejected("entities", &sound.changed(start, &laughs), Description, "document type declaration");
    let external = format!("{start}<!DOCTYPE l [<!ENTITY l SYSTEM \"file:///etc/passwd\">]>\n");
    rejected("external entities", &sound.changed(start, &external), Description, "document type declaration");
    rejected("an entity", &sound.changed("modelName=\"Ramp\"", "modelName=\"&l;\""), Description, "line 2");
    let deep = format!("{}{}", "<a>".repeat(100_000), "</a>".repeat(100_000));
    rejected(
        "nesting",
        &sound.changed("<ModelStructure/>", &format!("<VendorAnnotations>{deep}</VendorAnnotations><ModelStructure/>")),
        Description,
        "nested deeper",
    );
    let wide: String = (0..10_000).map(|i| format!(" a{i}=\"\"")).collect();
    rejected("attributes", &sound.changed("modelName=", &format!("{wide} modelName=")), Description, "attributes");
    let latin: Vec<u8> = sound.description.replace("gain", "g\u{e4}in").chars().map(|c| c as u32 as u8).collect();
    rejected("another encoding", &sound.described(latin), Archive, "UTF-8");
    let wide: Vec<u8> = sound.description.encode_utf16().flat_map(u16::to_le_bytes).collect();
    rejected("UTF-16", &sound.described([&[0xff, 0xfe], &wide[..]].concat()), Archive, "UTF-8");
    rejected("nothing", &sound.described(""), Description, "no element");
    rejected("half of it", &sound.described(&sound.description[..sound.description.len() / 2]), Description, "line");
    for (from, to, expected) in [
        ("fmiVersion=\"2.0\"", "fmiVersion=\"4.0\"", "FMI version 4.0, expected 2.0 or 3.0"),
        ("fmiVersion=\"2.0\"", "fmiVersion=\"3.0\"", "lacks the attribute `instantiationToken`"),
        ("<Real start=\"1\"", "<Real start=\"one\"", "has start=\"one\", expected a number"),
        ("<Integer start=\"0\"", "<Integer start=\"2147483648\"", "expected a whole number"),
        ("valueReference=\"3\"", "valueReference=\"4294967296\"", "4294967296"),
        ("valueReference=\"3\"", "valueReference=\"-1\"", "-1"),
        ("name=\"start\"", "name=\"gain\"", "declared twice"),
        ("modelIdentifier=\"Ramp\"", "modelIdentifier=\"../Ramp\"", "cannot be the name of a file"),
        ("modelIdentifier=\"Ramp\"", "modelIdentifier=\"\"", "cannot be the name of a file"),
        ("<Real start=\"1\"", "<Real declaredType=\"none\" start=\"1\"", "not defined"),
        (
            "<ModelStructure/>",
            "<ModelStructure><Outputs><Unknown index=\"99999999999\"/></Outputs></ModelStructure>",
            "99999999999",
        ),
        (
            "<ModelStructure/>",
            "<ModelStructure><Outputs><Unknown index=\"0\"/></Outputs></ModelStructure>",
            "names variable 0, expected 1 to 9",
        ),
    ] {
        rejected(to, &sound.changed(from, to), Description, expected);
    }
}

/// The message for each mistake is tested in the crate `fmu-study`.
#[test]
fn a_wrong_study_leaves_nothing_behind() {
    let sound = Sound::new().bytes();
    for (file, from, to, expected) in [
        ("study.toml", "title", "titel", "did you mean `title`?"),
        ("study.toml", "\"ramp.toml\"", "\"romp.toml\"", "there is no file"),
        ("study.toml", "max = 8.0", "max = -8.0", "expected a finite number above min"),
        ("study.toml", "max = 8.0", "max = nan", "expected a finite number above min"),
        ("study.toml", "max = 8.0", "max = 11.0", "expected at most 10"),
        ("study.toml", "ramp:gain", "ramp:gian", "did you mean `gain`?"),
        ("study.toml", "evaluations = 10", "evaluations = 0", "expected at least 1"),
        ("study.toml", "weight = 1.0", "weight = 0.0", "all weights are 0"),
        ("study.toml", "kind = \"rms\"", "kind = \"rsm\"", "did you mean `rms`?"),
        ("study.toml", "kind = \"ga\"", "kind = \"genetic\"", "expected pacsa, ga or cmaes"),
        ("study.toml", "kind = \"ga\"", "kind = \"ga\"\nseeds = [1, 1]", "appears twice"),
        ("study.toml", "title", "\u{0}", "study.toml"),
        ("ramp.toml", "stop = 1.0", "stop = 1.1", "4.4 steps of 0.25 s, which must be a whole number above 0"),
        ("ramp.toml", "signals = [\"x\"]", "signals = [\"y\"]", "no output matches `y`"),
    ] {
        let folder = folder();
        let folder = folder.path();
        std::fs::write(folder.join("Ramp.fmu"), &sound).unwrap();
        let text = std::fs::read_to_string(folder.join(file)).unwrap();
        assert!(text.contains(from), "not in {file}: {from}");
        std::fs::write(folder.join(file), text.replacen(from, to, 1)).unwrap();
        let output = command(folder, "study study.toml --fmus .");
        let said = message(&output);
        assert_eq!(output.status.code(), Some(1), "{to}: {said}");
        assert!(said.contains(expected) && said.contains(file) && !said.contains("panicked"), "{to}: {said}");
        assert_eq!(names(folder), ["Ramp.fmu", "ramp.toml", "stderr", "study.toml", "temporary"], "{to}");
        assert_eq!(names(&folder.join("temporary")), [""; 0], "{to}");
    }
}

/// Only `check` reports these values; the other commands do not use them.
#[test]
fn wild_numbers_in_a_description_are_found_by_the_check() {
    let sound = Sound::new();
    for (from, to, expected) in [
        ("<Real start=\"1\"", "<Real start=\"1e999\"", "variable `gain`: its start value inf is not a finite number"),
        ("<Real start=\"1\"", "<Real start=\"nan\"", "variable `gain`: its start value NaN is not a finite number"),
        ("min=\"-10\"", "min=\"nan\"", "variable `gain`: min NaN is above max 10"),
        ("min=\"-10\"", "min=\"11\"", "variable `gain`: min 11 is above max 10"),
    ] {
        let folder = folder();
        std::fs::write(folder.path().join("Ramp.fmu"), sound.changed(from, to)).unwrap();
        for (line, _) in COMMANDS {
            let output = command(folder.path(), line);
            let said = message(&output);
            assert!(output.status.code().is_some() && !said.contains("panicked"), "{to}: {line}: {said}");
            assert!(said.contains(expected) || !line.starts_with("check"), "{to}: {line}: {said}");
        }
    }
}

#[test]
fn long_descriptions_are_read_in_time() {
    let sound = Sound::new();
    let more: String = (0..200_000)
        .map(|i| format!("<ScalarVariable name=\"p{i}\" valueReference=\"{}\" causality=\"parameter\" variability=\"fixed\"><Real start=\"1\"/></ScalarVariable>\n", i + 10))
        .collect();
    let folder = folder();
    let long = sound.changed("</ModelVariables>", &format!("{more}</ModelVariables>"));
    std::fs::write(folder.path().join("Ramp.fmu"), long).unwrap();
    let output = command(folder.path(), "plan ramp.toml --fmus .");
    assert!(output.status.success(), "{}", message(&output));
}

#[test]
fn binaries_that_do_not_run_here_are_rejected() {
    let sound = Sound::new();
    let name = binary();
    rejected("no binary", &sound.loading("", None), Binary, "the FMU has none");
    rejected(
        "another platform",
        &sound.loading("binaries/amiga68k/Ramp.library", Some(b"x")),
        Binary,
        "the FMU has amiga68k",
    );
    rejected("a folder as binary", &sound.loading(&format!("{name}/"), Some(b"")), Binary, "no binary");
    rejected("an empty binary", &sound.loading(&name, Some(b"")), Binary, &name);
    rejected("text", &sound.loading(&name, Some(b"not a library")), Binary, &name);
    // The rest applies to ELF files.
    if !cfg!(target_os = "linux") {
        return;
    }
    rejected(
        "half a binary",
        &sound.loading(&name, Some(&sound.binary[..sound.binary.len() / 2])),
        Binary,
        "is damaged or truncated",
    );
    let mut other = sound.binary.clone();
    // A processor that does not exist.
    other[18..20].copy_from_slice(&0xdead_u16.to_le_bytes());
    rejected("another machine", &sound.loading(&name, Some(&other)), Binary, &name);
}
