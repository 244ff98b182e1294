//! Runs written for other masters, on FMUs built from C in a temporary folder. The structure is compared with the
//! elements and attributes of SSP 1.0 and of libcosim's schema.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_import::description::Value;
use fmu_import::parameter_set::ParameterSet;
use fmu_system::export::{ExportError, OSP_STRUCTURE, PARAMETERS, STRUCTURE, System};
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, resolve, resolve_text};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Write};
use std::path::Path;
use support::Build;
use tempfile::TempDir;
use zip::write::SimpleFileOptions;
use zip::{ZipArchive, ZipWriter};

/// A ring of two components, and a third component that reads the first. One case replaces a component, another omits
/// one.
const SYSTEM: &str = r#"
title = "Ring & more"
[simulation]
start = 0.5
stop = 1.5
step = 0.01
[[component]]
name = "position"
fmu = "Position"
parameters = { start = { value = 0.1, unit = "m" }, inverted = true }
[[component]]
name = "velocity"
fmu = "Velocity"
parameters = { gain = -1.0, label = "<v>" }
[[component]]
name = "meter"
fmu = "Meter"
[[connection]]
from = "position:x"
to = "meter:in"
[[case]]
name = "free"
title = "Free"
[[case]]
name = "other"
title = "Other"
fmu.velocity = "Other"
[[case]]
name = "alone"
title = "Alone"
without = ["velocity"]
inputs.position = { y = 2.0 }
[seeds]
parameter = "position:failure"
values = [0, 7]
[record]
signals = ["x", "y", "velocity:moved"]
"#;

fn fmus() -> TempDir {
    let folder = TempDir::new().unwrap();
    Build::new("Position", "y", "x").pack(folder.path());
    Build::new("Velocity", "x", "y").pack(folder.path());
    Build::new("Other", "x", "y").pack(folder.path());
    Build::new("Meter", "in", "out").pack(folder.path());
    folder
}

fn plan(folder: &TempDir, text: &str, options: &Options) -> Plan {
    resolve_text(Path::new("my ring.toml"), text, &FmuFolder::new([folder.path()]), options).unwrap()
}

fn system(folder: &TempDir, id: &str) -> System {
    let plan = plan(folder, SYSTEM, &Options::default());
    System::new(&plan, plan.runs.iter().find(|run| run.id == id).unwrap()).unwrap()
}

/// Elements as `path attribute=value ...`, in the order of the document.
fn elements(text: &str) -> Vec<String> {
    fn line(open: &[String], start: &BytesStart<'_>) -> String {
        let attributes = start.attributes().map(|attribute| {
            let attribute = attribute.unwrap();
            let value = attribute.normalized_value(quick_xml::XmlVersion::Explicit1_0).unwrap();
            format!(" {}={value}", attribute.key.as_ref())
        });
        format!("{}{}", open.join("/"), attributes.collect::<String>())
    }
    let mut reader = Reader::from_str(text);
    let (mut open, mut lines) = (Vec::new(), Vec::new());
    loop {
        match reader.read_event().unwrap() {
            Event::Start(start) => {
                open.push(start.name().as_ref().to_string());
                lines.push(line(&open, &start));
            }
            Event::Empty(start) => {
                open.push(start.name().as_ref().to_string());
                lines.push(line(&open, &start));
                open.pop();
            }
            Event::End(_) => {
                open.pop();
            }
            Event::Eof => return lines,
            _ => (),
        }
    }
}

fn entries(path: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut zip = ZipArchive::new(File::open(path).unwrap()).unwrap();
    (0..zip.len())
        .map(|i| {
            let mut entry = zip.by_index(i).unwrap();
            let mut bytes = Vec::new();
            entry.read_to_end(&mut bytes).unwrap();
            (String::from_utf8(entry.name_raw().to_vec()).unwrap(), bytes)
        })
        .collect()
}

#[test]
fn the_ssp_file_holds_structure_values_and_fmus() {
    let folder = fmus();
    let out = folder.path().join("deep/out");
    let package = system(&folder, "free#7").write(&out, false).unwrap().swap_remove(0);
    assert_eq!(package, out.join("my_ring.ssp"));
    let entries = entries(&package);
    let names: Vec<&str> = entries.keys().map(String::as_str).collect();
    let expected = ["Meter.fmu", "Position.fmu", "Velocity.fmu", "position.ssv", "velocity.ssv"];
    assert_eq!(names[0], STRUCTURE);
    assert_eq!(names[1..], expected.map(|name| format!("resources/{name}")));
    for fmu in expected.iter().filter(|name| name.ends_with(".fmu")) {
        assert_eq!(entries[&format!("resources/{fmu}")], std::fs::read(folder.path().join(fmu)).unwrap());
    }

    let lines = elements(std::str::from_utf8(&entries[STRUCTURE]).unwrap());
    let root = "ssd:SystemStructureDescription";
    let inside = |path: &str| -> Vec<String> {
        let prefix = format!("{root}/{path}");
        let inside = lines.iter().filter_map(|line| line.strip_prefix(&prefix));
        inside.map(|rest| rest.trim_start().to_string()).collect()
    };
    assert!(
        lines[0]
            .ends_with(&format!(" version=1.0 name=my_ring generationTool=cargo-fmu {}", env!("CARGO_PKG_VERSION")))
    );
    assert_eq!(inside("ssd:System name"), ["=my_ring description=Ring & more: case free, seed 7"]);
    let fmu = |name: &str, file: &str| {
        format!(
            "name={name} type=application/x-fmu-sharedlibrary source=resources/{file}.fmu implementation=CoSimulation"
        )
    };
    assert_eq!(
        inside("ssd:System/ssd:Elements/ssd:Component "),
        [fmu("position", "Position"), fmu("velocity", "Velocity"), fmu("meter", "Meter")]
    );
    // Inputs that are written, and outputs that are read or recorded, with types and units of measure.
    assert_eq!(
        inside("ssd:System/ssd:Elements/ssd:Component/ssd:Connectors/ssd:Connector"),
        [
            "name=y kind=input",
            "/ssc:Real",
            "name=x kind=output",
            "/ssc:Real unit=m",
            "name=x kind=input",
            "/ssc:Real",
            "name=y kind=output",
            "/ssc:Real unit=m",
            "name=moved kind=output",
            "/ssc:Boolean",
            "name=in kind=input",
            "/ssc:Real",
        ]
    );
    assert_eq!(
        inside("ssd:System/ssd:Elements/ssd:Component/ssd:ParameterBindings/"),
        ["position", "velocity"].map(|component| format!(
            "ssd:ParameterBinding type=application/x-ssp-parameter-set source=resources/{component}.ssv"
        ))
    );
    let wire = |from: [&str; 2], to: [&str; 2]| {
        format!("startElement={} startConnector={} endElement={} endConnector={}", from[0], from[1], to[0], to[1])
    };
    assert_eq!(
        inside("ssd:System/ssd:Connections/ssd:Connection "),
        [
            wire(["velocity", "y"], ["position", "y"]),
            wire(["position", "x"], ["velocity", "x"]),
            wire(["position", "x"], ["meter", "in"]),
        ]
    );
    assert_eq!(inside("ssd:Units/"), ["ssc:Unit name=m", "ssc:Unit/ssc:BaseUnit m=1"]);
    assert_eq!(inside("ssd:DefaultExperiment startTime"), ["=0.5 stopTime=1.5"]);
    let annotations = |path: &str, tool: &str, rest: &str| {
        let found = inside(&format!("{path}/ssd:Annotations/ssc:Annotation"));
        assert_eq!((found[0].as_str(), found.last().unwrap().as_str()), (tool, rest));
    };
    annotations(
        "ssd:System",
        "type=org.openmodelica",
        "/oms:Annotations/oms:SimulationInformation/oms:FixedStepMaster description=oms-ma stepSize=0.01 \
         absoluteTolerance=0.0001 relativeTolerance=0.0001",
    );
    annotations(
        "ssd:DefaultExperiment",
        "type=com.opensimulationplatform",
        "/osp:Algorithm/osp:FixedStepAlgorithm baseStepSize=0.01",
    );

    let set = |component: &str| {
        let text = std::str::from_utf8(&entries[&format!("resources/{component}.ssv")]).unwrap();
        let set = ParameterSet::parse(text).unwrap();
        assert_eq!(set.name, PARAMETERS);
        set.parameters.into_iter().map(|p| (p.name, p.value, p.unit)).collect::<Vec<_>>()
    };
    assert_eq!(
        set("position"),
        [
            ("failure".to_string(), Value::Integer(7), None),
            ("inverted".to_string(), Value::Boolean(true), None),
            ("start".to_string(), Value::Real(0.1), Some("m".to_string()))
        ]
    );
    assert_eq!(
        set("velocity"),
        [("gain".to_string(), Value::Real(-1.0), None), ("label".to_string(), Value::String("<v>".into()), None)]
    );
}

#[test]
fn the_structure_of_libcosim_stands_beside_the_fmus() {
    let folder = fmus();
    let out = folder.path().join("out");
    let structure = system(&folder, "free#0").write(&out, false).unwrap().swap_remove(1);
    assert_eq!(structure, out.join(OSP_STRUCTURE));
    let text = std::fs::read_to_string(structure).unwrap();
    // The elements are in the order of the schema.
    for (first, second) in [
        ("<StartTime>0.5</StartTime>", "<BaseStepSize>0.01</BaseStepSize>"),
        ("<BaseStepSize>", "<Algorithm>fixedStep</Algorithm>"),
        ("<Algorithm>", "<Simulators>"),
        ("</Simulators>", "<Connections>"),
    ] {
        assert!(text.find(first).unwrap() < text.find(second).unwrap(), "{text}");
    }
    let lines = elements(&text);
    let inside = |path: &str| -> Vec<String> {
        let prefix = format!("OspSystemStructure/{path}");
        lines.iter().filter_map(|line| line.strip_prefix(&prefix)).map(|rest| rest.trim_start().to_string()).collect()
    };
    assert_eq!(
        inside("Simulators/Simulator "),
        ["position source=Position", "velocity source=Velocity", "meter source=Meter"]
            .map(|both| format!("name={both}.fmu stepSize=0.01"))
    );
    assert_eq!(
        inside("Simulators/Simulator/InitialValues/InitialValue"),
        [
            "variable=failure",
            "/Integer value=0",
            "variable=inverted",
            "/Boolean value=true",
            "variable=start",
            "/Real value=0.1",
            "variable=gain",
            "/Real value=-1.0",
            "variable=label",
            "/String value=<v>",
        ]
    );
    assert_eq!(
        inside("Connections/VariableConnection/Variable "),
        [
            ["velocity", "y"],
            ["position", "y"],
            ["position", "x"],
            ["velocity", "x"],
            ["position", "x"],
            ["meter", "in"]
        ]
        .map(|[simulator, name]| format!("simulator={simulator} name={name}"))
    );
    for fmu in ["Position.fmu", "Velocity.fmu", "Meter.fmu"] {
        assert_eq!(std::fs::read(out.join(fmu)).unwrap(), std::fs::read(folder.path().join(fmu)).unwrap());
    }
}

#[test]
fn a_case_has_its_own_fmus_components_and_constants() {
    let folder = fmus();
    let other = system(&folder, "other#0");
    assert_eq!(other.components[1].file, "Other.fmu");
    let alone = system(&folder, "alone#7");
    assert_eq!(alone.components.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["position", "meter"]);
    let constant = alone.components[0].values.iter().find(|v| v.name == "y").unwrap();
    assert_eq!(constant.value, Value::Real(2.0));
    assert!(alone.components[0].connectors.iter().all(|c| c.output), "an input that keeps its value has no connector");
    assert_eq!(alone.connections.len(), 1);
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let folder = fmus();
    let write = |name: &str| {
        let written = system(&folder, "free#0").write(&folder.path().join(name), false).unwrap();
        let [package, structure] = <[_; 2]>::try_from(written).unwrap();
        [package, structure].map(|path| std::fs::read(path).unwrap())
    };
    assert_eq!(write("one"), write("two"));
}

#[test]
fn a_folder_that_holds_something_is_kept() {
    let folder = fmus();
    let system = system(&folder, "free#0");
    let out = folder.path().join("out");
    let rejected = |overwrite: bool, expected: &str| {
        let error = system.write(&out, overwrite).unwrap_err();
        assert!(matches!(error, ExportError::Occupied { .. }), "{error}");
        assert!(error.to_string().contains(expected), "{error}");
    };
    std::fs::create_dir(&out).unwrap();
    system.write(&out, false).unwrap();
    rejected(false, "`--overwrite` replaces");
    std::fs::write(out.join("Stale.fmu"), "").unwrap();
    system.write(&out, true).unwrap();
    assert!(!out.join("Stale.fmu").exists());

    std::fs::write(out.join("thesis.txt"), "mine").unwrap();
    rejected(true, "`thesis.txt` is not from an earlier call");
    std::fs::remove_file(out.join("thesis.txt")).unwrap();
    std::fs::remove_file(out.join(OSP_STRUCTURE)).unwrap();
    std::fs::remove_file(out.join("my_ring.ssp")).unwrap();
    // A folder that contains only FMUs, such as packed models, is not an earlier export.
    rejected(true, "not empty");
    assert!(out.join("Position.fmu").exists());
}

#[test]
fn a_failure_leaves_nothing_behind() {
    let folder = fmus();
    let system = system(&folder, "free#0");
    std::fs::remove_file(folder.path().join("Meter.fmu")).unwrap();
    let parent = folder.path().join("parent");
    let error = system.write(&parent.join("out"), false).unwrap_err().to_string();
    assert!(error.contains("Meter.fmu"), "{error}");
    assert_eq!(std::fs::read_dir(parent).unwrap().count(), 0);
}

#[test]
fn what_cannot_be_written_is_said() {
    let folder = fmus();
    let inputs = folder.path().join("y.csv");
    std::fs::write(&inputs, "time,velocity:y\n0,1\n100,1\n").unwrap();
    let fed = plan(&folder, SYSTEM, &Options { inputs: Some(inputs), ..Options::default() });
    assert!(matches!(System::new(&fed, &fed.runs[0]), Err(ExportError::InputSeries)));

    std::fs::copy(folder.path().join("Meter.fmu"), folder.path().join("My Meter.fmu")).unwrap();
    let named = plan(&folder, &SYSTEM.replace("\"Meter\"", "\"My Meter\""), &Options::default());
    let error = System::new(&named, &named.runs[0]).unwrap_err();
    assert!(error.to_string().contains("My Meter.fmu: the name"), "{error}");
}

/// An FMU with only a description, which is all that the export reads.
fn described(folder: &TempDir, name: &str, units: &str, types: &str, variables: &str) {
    let text = format!(
        "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{name}\" guid=\"{name}\"><CoSimulation modelIdentifier=\"{name}\"/>\
         <UnitDefinitions>{units}</UnitDefinitions><TypeDefinitions>{types}</TypeDefinitions>\
         <ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"
    );
    let mut zip = ZipWriter::new(File::create(folder.path().join(format!("{name}.fmu"))).unwrap());
    zip.start_file("modelDescription.xml", SimpleFileOptions::default()).unwrap();
    zip.write_all(text.as_bytes()).unwrap();
    zip.finish().unwrap();
}

/// Source and sink, wired by the name of the signal.
const PAIR: &str = r#"
title = "Pair"
[simulation]
stop = 1.0
step = 0.1
[[component]]
name = "source"
fmu = "Source"
[[component]]
name = "sink"
fmu = "Sink"
[[case]]
name = "only"
title = "Only"
[record]
signals = ["u"]
"#;

fn rejected(folder: &TempDir) -> String {
    let plan = plan(folder, PAIR, &Options::default());
    System::new(&plan, &plan.runs[0]).unwrap_err().to_string()
}

#[test]
fn an_enumeration_is_rejected() {
    let folder = TempDir::new().unwrap();
    let types = "<SimpleType name=\"T\"><Enumeration><Item name=\"off\" value=\"0\"/></Enumeration></SimpleType>";
    let variable = |causality: &str, start: &str| {
        format!(
            "<ScalarVariable name=\"u\" valueReference=\"0\" causality=\"{causality}\" variability=\"discrete\">\
             <Enumeration declaredType=\"T\"{start}/></ScalarVariable>"
        )
    };
    described(&folder, "Source", "", types, &variable("output", ""));
    described(&folder, "Sink", "", types, &variable("input", " start=\"0\""));
    let error = rejected(&folder);
    assert!(error.starts_with("`source:u` is an enumeration"), "{error}");
}

#[test]
fn a_unit_of_measure_with_two_meanings_is_rejected() {
    let folder = TempDir::new().unwrap();
    let variable = |causality: &str, start: &str| {
        format!(
            "<ScalarVariable name=\"u\" valueReference=\"0\" causality=\"{causality}\"><Real unit=\"mile\"{start}/></ScalarVariable>"
        )
    };
    let unit = |factor: f64| format!("<Unit name=\"mile\"><BaseUnit m=\"1\" factor=\"{factor}\"/></Unit>");
    described(&folder, "Source", &unit(1609.344), "", &variable("output", ""));
    described(&folder, "Sink", &unit(1852.0), "", &variable("input", " start=\"0\""));
    // Without this connection, the scenario is rejected.
    let text = format!("{PAIR}\n[[connection]]\nfrom = \"source:u\"\nto = \"sink:u\"\nconvert = false\n");
    let plan = plan(&folder, &text, &Options::default());
    let error = System::new(&plan, &plan.runs[0]).unwrap_err().to_string();
    assert_eq!(error, "the unit of measure `mile` is defined differently in Sink.fmu and Source.fmu");
}

/// References: SSP 2.0, section ParameterBindings: structural parameters of FMI 3.0 are set in Configuration Mode.
#[test]
fn structural_parameters_are_parameters_of_ssp_2() {
    let folder = TempDir::new().unwrap();
    let mut zip = ZipWriter::new(File::create(folder.path().join("Arrays.fmu")).unwrap());
    zip.start_file("modelDescription.xml", SimpleFileOptions::default()).unwrap();
    zip.write_all(include_bytes!("data/arrays.xml")).unwrap();
    zip.finish().unwrap();
    let text = r#"
title = "Sizes"
simulation = { stop = 1.0, step = 0.1 }
component = [{ name = "a", fmu = "Arrays", structure = { n = 4 }, parameters = { up = 7 }, inputs = { s = 3, q = 0 } }]
case = [{ name = "only", title = "Only" }]
record = { signals = ["so", "t"] }
"#;
    let sized = plan(&folder, text, &Options::default());
    let system = System::new(&sized, &sized.runs[0]).unwrap();
    let out = folder.path().join("out");
    let files = system.write(&out, false).unwrap();
    let values = String::from_utf8(entries(&files[0]).remove("resources/a.ssv").unwrap()).unwrap();
    let found = ParameterSet::parse(&values).unwrap().parameters;
    let found: Vec<_> = found.iter().map(|one| (one.name.as_str(), one.value.clone())).collect();
    assert_eq!(found, [("n", 4), ("up", 7), ("s", 3), ("q", 0)].map(|(name, value)| (name, Value::Integer(value))));
    assert!(values.contains("version=\"2.0\"") && values.contains("<ssv:UInt64 value=\"4\"/>"), "{values}");
    // The elements of `t`, whose number is n, are recorded only.
    assert_eq!(system.components[0].connectors.len(), 1);
    let again = resolve(&files[0], &FmuFolder::new([""; 0]), &Options::default()).unwrap();
    let of = |plan: &Plan| {
        let component = &plan.runs[0].components[0];
        (component.structure.clone(), component.parameters.clone(), component.constants.clone())
    };
    assert_eq!(of(&again), of(&sized));

    let set = text.replace("up = 7", "k = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]");
    let set = plan(&folder, &set, &Options::default());
    let error = System::new(&set, &set.runs[0]).unwrap_err().to_string();
    assert!(error.starts_with("`a:k[1,1]` is an element of an array"), "{error}");
}
