//! Systems read from SSP files (System Structure and Parameterization 1.0 and 2.0), on FMUs built from C.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/mod.rs"]
mod support;

use fmu_import::archive::read_description;
use fmu_import::description::Value;
use fmu_system::export::System;
use fmu_system::fmus::Fmus;
use fmu_system::import::{Choice, import};
use fmu_system::master;
use fmu_system::plan::{Origin, Plan};
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve, resolve_text};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use support::Build;
use tempfile::TempDir;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// `A.fmu`: x' = gain u, with `start` in m. Both names of the variables differ from those in `B.fmu`, where x reads y.
struct Files(TempDir);

impl Files {
    fn new() -> Self {
        let folder = TempDir::new().unwrap();
        let unit = "<Unit name=\"m\"><BaseUnit m=\"1\"/></Unit>";
        let units = format!("{unit}<Unit name=\"km\"><BaseUnit m=\"1\" factor=\"1000\"/></Unit>");
        Build { edits: &[(unit, &units)], ..Build::new("A", "u", "x") }.pack(folder.path());
        Build::new("B", "x", "y").pack(folder.path());
        Self(folder)
    }

    /// An SSP file with the FMUs and these files.
    fn pack(&self, files: &[(&str, &str)]) -> PathBuf {
        let path = self.0.path().join("My System.ssp");
        let mut zip = ZipWriter::new(File::create(&path).unwrap());
        let mut add = |name: &str, content: &[u8]| {
            zip.start_file(name, SimpleFileOptions::default()).unwrap();
            zip.write_all(content).unwrap();
        };
        for (name, content) in files {
            add(name, content.as_bytes());
        }
        for (fmu, name) in [("A", "resources/A.fmu"), ("B", "resources/sub folder/B.fmu")] {
            add(name, &std::fs::read(self.0.path().join(format!("{fmu}.fmu"))).unwrap());
        }
        zip.finish().unwrap();
        path
    }

    /// The plan of a system, or the mistakes.
    fn plan(&self, system: &str, more: &[(&str, &str)], options: &Options) -> Result<Plan, Vec<String>> {
        let path = self.pack(&[&[("SystemStructure.ssd", &*structure(system))], more].concat());
        let here = format!("{}/", self.0.path().display());
        let lines = |error: ResolveError| error.lines().iter().map(|line| line.replace(&here, "")).collect();
        resolve(&path, &FmuFolder::new([""; 0]), options).map_err(lines)
    }

    fn mistakes(&self, system: &str) -> Vec<String> {
        self.plan(system, &[], &Options::default()).unwrap_err()
    }
}

fn structure(system: &str) -> String {
    format!(
        "<SystemStructureDescription xmlns='http://ssp-standard.org/SSP1/SystemStructureDescription' version='1.0' \
         name='s'>\n<System name='root'>\n{system}</System>\n<DefaultExperiment startTime='0.5' stopTime='1.5'/>\n\
         </SystemStructureDescription>"
    )
}

fn set(parameters: &str) -> String {
    format!("<ParameterSet version='1.0' name='p'><Parameters>{parameters}</Parameters></ParameterSet>")
}

fn real(name: &str, value: &str) -> String {
    format!("<Parameter name='{name}'><Real value='{value}'/></Parameter>")
}

const A: &str = "<Component name='A' source='resources/A.fmu'/>";
const B: &str = "<Component name='B' source='resources/sub%20folder/B.fmu'/>";

/// Input of a component -> output and conversion, or constant.
fn wires(plan: &Plan) -> BTreeMap<String, String> {
    let inputs = plan.wiring[0].inputs.iter().map(|connected| {
        let source = match &connected.source {
            Origin::Output(signal) => format!("{}:{}", signal.component, signal.variable),
            Origin::Constant { value, .. } => value.to_string(),
            Origin::File(file) => file.clone(),
        };
        let linear = connected.conversion.map_or(String::new(), |by| format!(" * {} + {}", by.factor, by.offset));
        (format!("{}:{}", connected.input.component, connected.input.variable), source + &linear)
    });
    inputs.collect()
}

fn parameters(plan: &Plan, component: &str) -> BTreeMap<String, Value> {
    let component = plan.runs[0].components.iter().find(|own| own.name == component).unwrap();
    component.parameters.iter().map(|setting| (setting.name.clone(), setting.value.clone())).collect()
}

/// SSP 1.0, sections 5.3 and 5.3.2: connections go through connectors of systems, their ends have no direction.
#[test]
fn nested_systems_are_flattened() {
    let inner = "<System name='Inner One'>
<Connectors><Connector name='in' kind='input'><Real/></Connector><Connector name='out' kind='output'/></Connectors>
<Elements><Component name='A' source='resources/A.fmu'/></Elements>
<Connections>
<Connection startConnector='in' endElement='A' endConnector='u'><LinearTransformation factor='2' offset='1'/></Connection>
<Connection startConnector='out' endElement='A' endConnector='x'/>
</Connections></System>";
    let system = format!(
        "<Connectors><Connector name='y' kind='output'/><Connector name='w' kind='input'/></Connectors>
<Elements>{inner}{A}{B}</Elements>
<Connections>
<Connection startElement='B' startConnector='y' endElement='Inner One' endConnector='in'><LinearTransformation factor='3' \
         offset='4'/></Connection>
<Connection startElement='B' startConnector='x' endElement='Inner One' endConnector='out' suppressUnitConversion='true'/>
<Connection startElement='Inner One' startConnector='out' endConnector='y'/>
<Connection startConnector='w' endElement='A' endConnector='u'/>
</Connections>"
    );
    let plan = Files::new().plan(&system, &[], &Options::default()).unwrap();
    // 2 (3 y + 4) + 1
    let expected = [("a:u", "0.0"), ("b:x", "inner_one_a:x"), ("inner_one_a:u", "b:y * 6 + 9")];
    assert_eq!(wires(&plan), expected.map(|(to, from)| (to.to_owned(), from.to_owned())).into());
    let columns: Vec<&str> = plan.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(columns, ["x"], "the output of the root system");
    assert_eq!((plan.name.as_str(), plan.simulation.start, plan.simulation.stop), ("My System", 0.5, 1.5));
    let warnings = plan.warnings.join("\n");
    assert!(
        warnings.contains("SystemStructure.ssd:15:1: the input `w` of the system is constant: `a:u` is 0"),
        "{warnings}"
    );
    assert!(warnings.contains("0.001 s is about a thousandth of the time"), "{warnings}");
    assert!(!warnings.contains("`b`"), "{warnings}");
    let fmus = Fmus::load(&plan.runs).unwrap();
    assert!(master::execute(&plan.simulation, &plan.runs[0], &fmus).is_ok());
    let folder = plan.folders[0].path().to_path_buf();
    assert!(folder.join("A.fmu").is_file());
    drop(plan);
    assert!(!folder.exists());
}

/// Inputs and outputs with the same name are not connected unless the file connects them.
#[test]
fn names_do_not_connect() {
    let plan = Files::new().plan(&format!("<Elements>{A}{B}</Elements>"), &[], &Options::default()).unwrap();
    assert_eq!(wires(&plan), [("a:u".into(), "0.0".into()), ("b:x".into(), "0.0".into())].into());
}

/// SSP 1.0, section 5.2.2: later values replace earlier ones, those of a system those of its elements; a prefix belongs
/// to all names.
#[test]
fn values_of_parameter_sets_have_an_order() {
    let inline = |set: &str| format!("<ParameterBinding><ParameterValues>{set}</ParameterValues></ParameterBinding>");
    let of_a = inline(&set(&(real("gain", "1") + &real("start", "1"))));
    let next = inline(&set(&real("start", "2")));
    let component = format!(
        "<Component name='A' source='resources/A.fmu'><ParameterBindings>{of_a}{next}</ParameterBindings></Component>"
    );
    let system = format!(
        "<Connectors><Connector name='rate' kind='parameter'/><Connector name='w' kind='input'/></Connectors>
<ParameterBindings><ParameterBinding source='resources/a.ssv' prefix='A.'/>{}</ParameterBindings>
<Elements>{component}{B}</Elements><Connections><Connection startConnector='rate' endElement='B' endConnector='gain'/>
<Connection startConnector='w' endElement='B' endConnector='x'/></Connections>",
        inline(&set(&(real("rate", "7") + &real("w", "8") + &real("B.none", "1"))))
    );
    let text = "<p:ParameterSet xmlns:p='x' version='2.0' name='p'><p:Parameters>
<p:Parameter name='gain'><p:Float64 value='3' unit='x'/></p:Parameter>
<p:Parameter name='inverted'><p:Boolean value='true'/></p:Parameter></p:Parameters></p:ParameterSet>";
    let plan = Files::new().plan(&system, &[("resources/a.ssv", text)], &Options::default()).unwrap();
    let expected = [("gain", Value::Real(3.0)), ("inverted", Value::Boolean(true)), ("start", Value::Real(2.0))];
    assert_eq!(parameters(&plan, "a"), expected.map(|(name, value)| (name.to_owned(), value)).into());
    assert_eq!(parameters(&plan, "b"), [("gain".to_owned(), Value::Real(7.0))].into());
    assert_eq!(wires(&plan)["b:x"], "8.0");
    assert!(plan.warnings.iter().any(|text| text.contains("`B.none` is not a variable")), "{:?}", plan.warnings);
}

/// SSP 1.0, section 5.2.2: a set may also contain start values of variables (FMI 2.0.4, section 2.2.7: `initial`).
#[test]
fn start_values_are_set_before_the_initialization() {
    let files = Files::new();
    let output = "causality=\"output\"><Real unit=\"m\"/>";
    let exact = "causality=\"output\" initial=\"exact\"><Real unit=\"m\" start=\"1\"/>";
    Build { edits: &[(output, exact)], ..Build::new("A", "u", "x") }.pack(files.0.path());
    let set = set(&real("x", "5"));
    let system = format!(
        "<ParameterBindings><ParameterBinding prefix='A.'><ParameterValues>{set}</ParameterValues></ParameterBinding>\
         </ParameterBindings><Elements>{A}</Elements>"
    );
    let plan = files.plan(&system, &[], &Options::default()).unwrap();
    assert_eq!(parameters(&plan, "a"), [("x".to_owned(), Value::Real(5.0))].into());
    let system = system.replace(A, B).replace("'A.'", "'B.'").replace("name='x'", "name='y'");
    let mistake = files.mistakes(&system).remove(0);
    assert!(mistake.contains("`y` of B is not a parameter but an output"), "{mistake}");
}

/// Units of the set come before those of the FMU; FMI 2.0.4, section 2.2.2: SI value = factor value + offset.
#[test]
fn values_are_converted_to_the_unit_of_the_variable() {
    let plan = |unit: &str, units: &str| {
        let parameter = format!("<Parameter name='start'><Real value='3' unit='{unit}'/></Parameter>");
        let set =
            format!("<ParameterSet version='1.0' name='p'><Parameters>{parameter}</Parameters>{units}</ParameterSet>");
        let binding = format!("<ParameterBinding><ParameterValues>{set}</ParameterValues></ParameterBinding>");
        let component = format!(
            "<Component name='A' source='resources/A.fmu'><ParameterBindings>{binding}</ParameterBindings></Component>"
        );
        Files::new().plan(&format!("<Elements>{component}</Elements>"), &[], &Options::default())
    };
    let start = |plan: Plan| parameters(&plan, "a")["start"].clone();
    let defined = |base: &str| format!("<Units><Unit name='km'><BaseUnit {base}/></Unit></Units>");
    assert_eq!(start(plan("km", "").unwrap()), Value::Real(3000.0));
    assert_eq!(start(plan("km", &defined("m='1' factor='2' offset='1'")).unwrap()), Value::Real(7.0));
    assert_eq!(start(plan("m", "").unwrap()), Value::Real(3.0));
    let [mistake] = &plan("km", &defined("s='1'")).unwrap_err()[..] else { panic!() };
    let words = "the value of `start` is in km (1 s), but the variable is in m (1 m)";
    assert!(mistake.ends_with(words) && mistake.contains("SystemStructure.ssd:3:"), "{mistake}");
    assert!(plan("furlong", "").unwrap_err()[0].contains("cannot be given in `furlong`"));
}

/// SSP 1.0, section 5.3.1: units of connectors convert as those of variables do, which come first. FMI 2.0.4,
/// section 2.2.2: 5 km = 5000 m, (5 degC + 273.15) K.
#[test]
fn units_of_connectors_are_converted() {
    let plan_of = |edits: &[(&str, &str)], from: &str, to: &str, suppressed: &str| {
        let connector = |name: &str, kind: &str, unit: &str| {
            format!("<Connectors><Connector name='{name}' kind='{kind}'><Real unit='{unit}'/></Connector></Connectors>")
        };
        let component = |text: &str, connector: &str| text.replace("/>", &format!(">{connector}</Component>"));
        let (b, a) = (component(B, &connector("y", "output", from)), component(A, &connector("u", "input", to)));
        let connection =
            format!("<Connection startElement='B' startConnector='y' endElement='A' endConnector='u'{suppressed}/>");
        let units = "<Units><Unit name='m'><BaseUnit m='1'/></Unit><Unit name='km'><BaseUnit m='1' factor='1000'/></Unit>\
                     <Unit name='K'><BaseUnit K='1'/></Unit><Unit name='degC'><BaseUnit K='1' offset='273.15'/></Unit></Units>";
        let text = structure(&format!("<Elements>{b}{a}</Elements><Connections>{connection}</Connections>"));
        let files = Files::new();
        Build { edits, ..Build::new("B", "x", "y") }.pack(files.0.path());
        let ssp = files.pack(&[(
            "SystemStructure.ssd",
            &text.replace("<DefaultExperiment", &format!("{units}<DefaultExperiment")),
        )]);
        resolve(&ssp, &FmuFolder::new([""; 0]), &Options::default()).map_err(|error| error.lines().join("\n"))
    };
    let plan =
        |from: &str, to: &str, suppressed: &str| plan_of(&[("<Real unit=\"m\"/>", "<Real/>")], from, to, suppressed);
    let wire = |from, to, suppressed| wires(&plan(from, to, suppressed).unwrap())["a:u"].clone();
    assert_eq!(wire("km", "m", ""), "b:y * 1000 + 0");
    assert_eq!(wire("degC", "K", ""), "b:y * 1 + 273.15");
    assert_eq!(wire("km", "km", ""), "b:y");
    assert_eq!(wire("km", "m", " suppressUnitConversion='true'"), "b:y");
    assert_eq!(wires(&plan_of(&[], "K", "km", "").unwrap())["a:u"], "b:y * 0.001 + 0", "B:y is in m");
    let mistake = plan("km", "K", "").unwrap_err();
    assert!(mistake.contains("the source is in km (1000 m), but the target is in K (1 K)"), "{mistake}");
}

#[test]
fn all_that_a_scenario_cannot_express_is_reported_together() {
    let system = "<SignalDictionaries/><Connectors><Connector name='bus' kind='inout'/>
<Connector name='list' kind='input'><Real/><Dimension size='2'/></Connector></Connectors>
<Elements>
<Component name='web' source='https://example.com/A.fmu'/>
<Component name='out' source='../A.fmu'/>
<Component name='gone' source='resources/C.fmu'/>
<Component name='nested' type='application/x-ssp-package' source='resources/s.ssp'/>
<Component name='exchange' source='resources/A.fmu' implementation='ModelExchange'/>
<SignalDictionaryReference name='d' dictionary='d'/>
<Component name='A' source='resources/A.fmu'><Connectors>
<Connector name='q' kind='input'/>
<Connector name='u' kind='output'/>
<Connector name='x' kind='output'><Boolean/></Connector>
</Connectors><ParameterBindings>
<ParameterBinding source='a.ssv'><ParameterMapping source='a.ssm'/></ParameterBinding>
<ParameterBinding source='a.ssv'/>
</ParameterBindings></Component>
<Component name='A' source='resources/A.fmu'/>
</Elements>
<Connections>
<Connection startElement='A' startConnector='x' endElement='A' endConnector='u'/>
<Connection startElement='A' startConnector='x' endElement='A' endConnector='u'/>
<Connection startElement='A' startConnector='u' endElement='A' endConnector='u'/>
<Connection startElement='C' startConnector='u' endElement='A' endConnector='u'/>
<Connection startElement='A' startConnector='x' endElement='A' endConnector='label'/>
<Connection startElement='A' startConnector='x' endElement='A' endConnector='start'/>
<Connection startElement='A' startConnector='count' endElement='A' endConnector='u'><IntegerMappingTransformation/></Connection>
</Connections>
";
    let expected = [
        "3:34: the connector `bus` has the kind inout",
        "4:1: the connector `list` is a clock, has one, or is an array",
        "6:1: `https://example.com/A.fmu` must be a path within the archive",
        "7:1: `../A.fmu` must be a path within the archive",
        "8:1: the archive does not contain `resources/C.fmu`",
        "9:1: a component must be an FMU",
        "10:1: the implementation ModelExchange is not supported, or not by A.fmu",
        "11:1: signal dictionaries are not supported",
        "13:1: the connector `q` is not a variable of A.fmu",
        "14:1: the connector `u` has the kind output, but in A.fmu it is an input",
        "15:1: the connector `x` is Boolean, but in A.fmu it is Real",
        "17:34: parameter mappings are not supported",
        "18:1: the archive does not contain `a.ssv`",
        "20:1: a second element has the name `A`",
        "24:1: a second connection writes `u`",
        "25:1: `u` and `u` both read",
        "26:1: no element is named `C`",
        "27:1: `x` cannot write `label`: only a parameter of a system writes a parameter",
        "28:1: `x` cannot write `start`",
        "29:85: IntegerMappingTransformation is not supported",
    ];
    let found = Files::new().mistakes(system);
    for (found, expected) in found.iter().zip(expected) {
        assert!(found.starts_with(&format!("My System.ssp/SystemStructure.ssd:{expected}")), "{found}\n{expected}");
    }
    assert_eq!(found.len(), expected.len(), "{found:?}");
}

#[test]
fn mistakes_of_the_resolver_are_shown_at_the_element() {
    let system = format!(
        "<Elements>\n{A}\n{B}</Elements><Connections>
<Connection startElement='A' startConnector='moved' endElement='B' endConnector='x'/>
<Connection startElement='B' startConnector='count' endElement='A' endConnector='u'/></Connections>"
    );
    let [mistake] = &Files::new().mistakes(&system)[..] else { panic!() };
    assert!(mistake.starts_with("My System.ssp/SystemStructure.ssd:7:1: `b:count` is Integer"), "{mistake}");
}

#[test]
fn structure_and_step_can_be_chosen() {
    let files = Files::new();
    let other = structure(&format!("<Elements>{B}</Elements>")).replace("stopTime='1.5'", "");
    let oms = "<Annotations><Annotation type='org.openmodelica'><o:FixedStepMaster stepSize='0.25'/></Annotation>\
               <Annotation type='com.example'/></Annotations>";
    let plan =
        |options: &Options| files.plan(&format!("<Elements>{A}</Elements>{oms}"), &[("Other.ssd", &other)], options);
    let of_annotation = plan(&Options::default()).unwrap();
    assert_eq!((of_annotation.simulation.step, of_annotation.runs[0].components[0].name.as_str()), (0.25, "a"));
    assert_eq!(of_annotation.warnings[0].rsplit_once(": ").unwrap().1, "com.example");
    let chosen = Options { step: Some(0.5), stop: Some(2.0), variant: Some("Other".into()), ..Options::default() };
    let plan_of_other = plan(&chosen).unwrap();
    assert_eq!((plan_of_other.simulation.step, plan_of_other.simulation.stop), (0.5, 2.0));
    assert_eq!(plan_of_other.runs[0].components[0].name, "b");
    let mistake = |options: &Options| plan(options).unwrap_err().remove(0);
    let variant = |name: &str| Options { variant: Some(name.into()), ..Options::default() };
    assert!(mistake(&variant("Other")).ends_with("the file has no stop time; set one with `--stop`"));
    assert!(mistake(&variant("None")).ends_with("has no None.ssd; it has SystemStructure.ssd, Other.ssd"));
}

/// A scenario that includes the file has its own cases and metrics, and other values.
#[test]
fn a_scenario_includes_a_system() {
    let files = Files::new();
    files.pack(&[("SystemStructure.ssd", &structure(&format!("<Elements>{A}</Elements>")))]);
    let text = "title = 'With metrics'\ninclude = ['My System.ssp']\nparameters.a = { gain = 2.0 }\n[[case]]\nname = 'one'\n\
                title = 'One'\n[[metric]]\nname = 'x'\ntitle = 'x'\nsignal = 'a:x'\nkind = 'final'\n";
    let plan =
        resolve_text(&files.0.path().join("s.toml"), text, &FmuFolder::new([""; 0]), &Options::default()).unwrap();
    assert_eq!(parameters(&plan, "a")["gain"], Value::Real(2.0));
    assert_eq!((plan.metrics.len(), plan.cases[0].name.as_str()), (1, "one"));
}

/// Damaged and hostile files end with a mistake: truncated and changed bytes, entities, a circle of connectors.
#[test]
fn damaged_files_are_mistakes() {
    let files = Files::new();
    let system = format!("<Elements>{A}</Elements>");
    let read = |path: &Path| resolve(path, &FmuFolder::new([""; 0]), &Options::default());
    let path = files.pack(&[("SystemStructure.ssd", &structure(&system))]);
    let bytes = std::fs::read(&path).unwrap();
    for at in (0..bytes.len()).step_by(bytes.len() / 40) {
        std::fs::write(&path, &bytes[..at]).unwrap();
        assert!(read(&path).is_err(), "{at}");
        let mut changed = bytes.clone();
        changed[at] ^= 0x55;
        std::fs::write(&path, &changed).unwrap();
        // A change within a library is found when it is unpacked.
        let _ = read(&path);
    }
    let text = structure(&system);
    for at in (0..text.len()).step_by(7) {
        let cut = [("SystemStructure.ssd", &text[..at])];
        assert!(read(&files.pack(&cut)).is_err(), "{at}");
    }
    let entities = format!("<!DOCTYPE a [<!ENTITY b 'c'>]>{text}");
    let error = read(&files.pack(&[("SystemStructure.ssd", &entities)])).unwrap_err().lines().remove(0);
    assert!(error.contains("document type declaration is rejected"), "{error}");
    let error = read(&files.pack(&[("other.ssd", &text)])).unwrap_err().lines().remove(0);
    assert!(error.contains("has no SystemStructure.ssd; it has other.ssd"), "{error}");
    let ring = |name: &str| {
        format!(
            "<System name='{name}'><Connectors><Connector name='i' kind='input'/><Connector name='o' kind='output'/></Connectors><Connections><Connection startConnector='i' endConnector='o'/></Connections></System>"
        )
    };
    let wire = |from: &str, to: &str, end: &str| {
        format!("<Connection startElement='{from}' startConnector='o' endElement='{to}' endConnector='{end}'/>")
    };
    let circle = format!(
        "<Elements>{A}{}{}</Elements><Connections>{}{}{}</Connections>",
        ring("s"),
        ring("t"),
        wire("s", "t", "i"),
        wire("t", "s", "i"),
        wire("s", "A", "u")
    );
    assert_eq!(wires(&files.plan(&circle, &[], &Options::default()).unwrap())["a:u"], "0.0");
    // A line that is too long to be shown.
    let long = files.mistakes(&format!("<Elements>{}<Component/></Elements>", " ".repeat(20_000)));
    assert!(long[0].contains("line 3, column 20011: <Component> lacks the attribute `name`"), "{long:?}");
    let many = files.mistakes(&format!("<Elements>{}</Elements>", "<Component/>".repeat(5000)));
    assert_eq!((many.len(), many[99].ends_with("more mistakes or warnings follow")), (100, true));
}

/// The export of a run, imported: the same components in the same order, values and connections, and the same results.
#[test]
fn an_exported_run_comes_back() {
    let files = Files::new();
    let text = "title = 'Ring'\nconnect_by_name = false\n[simulation]\nstart = 0.5\nstop = 1.5\nstep = 0.01\n[[component]]\nname = 'a'\nfmu = 'A'\n\
                parameters = { start = 0.1, inverted = true, label = \"<\\\"\\u0009\" }\n\
                [[component]]\nname = 'b'\nfmu = 'B'\nparameters = { gain = -1e-7, failure = 99 }\n[[component]]\nname = 'c'\n\
                fmu = 'B'\ninputs = { x = -0.0 }\n[[connection]]\nfrom = 'b:y'\nto = 'a:u'\nfactor = 0.1\noffset = 0.7\n\
                [[connection]]\nfrom = 'a:x'\nto = 'b:x'\n[[case]]\nname = 'one'\ntitle = 'One'\n[record]\nsignals = ['x', 'y']";
    let source = FmuFolder::new([files.0.path()]);
    let plan = resolve_text(Path::new("ring.toml"), text, &source, &Options::default()).unwrap();
    let out = files.0.path().join("out");
    let package = System::new(&plan, &plan.runs[0]).unwrap().write(&out, false).unwrap().swap_remove(0);
    let imported = import(&package, &Choice::default()).unwrap();
    assert_eq!(imported.warnings, [""; 0]);
    assert_eq!(read_description(&imported.folder.path().join("A.fmu")).unwrap().model_name, "A");
    let fmus = FmuFolder::new([imported.folder.path()]);
    let again = resolve_text(Path::new("again.toml"), &imported.text, &fmus, &Options::default()).unwrap();
    let of = |plan: &Plan| {
        let parts = plan.runs[0].components.iter();
        parts.map(|own| (own.name.clone(), own.parameters.clone(), own.constants.clone())).collect::<Vec<_>>()
    };
    assert_eq!(of(&again), of(&plan));
    assert_eq!(wires(&again), wires(&plan));
    let columns = |plan: &Plan| {
        let fmus = Fmus::load(&plan.runs).unwrap();
        let recording = master::execute(&plan.simulation, &plan.runs[0], &fmus).unwrap();
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let names = plan.columns.iter().map(|column| column.name.clone());
        names.enumerate().map(|(at, name)| (name, bits(recording.column(at).unwrap()))).collect::<BTreeMap<_, _>>()
    };
    assert_eq!(columns(&again), columns(&plan));
}
