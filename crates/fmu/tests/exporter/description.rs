//! The model description: well-formed, complete, and identified by its GUID.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use fmu::testing::abi::Export;
use fmu::testing::description::{Description, Format};
use fmu::testing::variable::Kind;
use quick_xml::Reader;
use quick_xml::events::Event;

use crate::models::{CartPair, Fragile, Sampler};

/// An XML element.
#[derive(Debug, Default)]
struct Element {
    name: String,
    attributes: BTreeMap<String, String>,
    children: Vec<Element>,
}

impl Element {
    fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Element> {
        self.children.iter().filter(move |child| child.name == name)
    }
    #[track_caller]
    fn one(&self, name: &str) -> &Element {
        self.children.iter().find(|child| child.name == name).unwrap_or_else(|| panic!("{} has no {name}", self.name))
    }
    fn get(&self, attribute: &str) -> Option<&str> {
        self.attributes.get(attribute).map(String::as_str)
    }
    /// Name and sorted attributes.
    fn text(&self) -> String {
        let pairs: Vec<_> = self.attributes.iter().map(|(key, value)| format!("{key}={value}")).collect();
        format!("{} {}", self.name, pairs.join(" "))
    }
}

/// Parses a document. Panics if it is not well-formed.
fn parse(xml: &str) -> Element {
    let mut reader = Reader::from_str(xml);
    let mut open = vec![Element::default()];
    loop {
        let event = reader.read_event().unwrap();
        match &event {
            Event::Start(start) | Event::Empty(start) => {
                let mut element = Element { name: start.name().0.to_owned(), ..Element::default() };
                for attribute in start.attributes() {
                    let attribute = attribute.unwrap();
                    let value = quick_xml::escape::unescape(&attribute.value).unwrap().into_owned();
                    assert!(!attribute.value.contains(['<', '\n']), "{value}");
                    element.attributes.insert(attribute.key.0.to_owned(), value);
                }
                open.push(element);
            }
            Event::Text(text) => assert!(text.trim().is_empty()),
            Event::Eof => break,
            Event::Decl(_) | Event::End(_) => {}
            other => panic!("{other:?} was not expected"),
        }
        if matches!(event, Event::Empty(_) | Event::End(_)) {
            let element = open.pop().unwrap();
            open.last_mut().unwrap().children.push(element);
        }
    }
    assert_eq!((open.len(), open[0].children.len()), (1, 1), "one root element, and all are closed");
    open.pop().unwrap().children.pop().unwrap()
}

fn described<E: Export>() -> Element {
    parse(&E::description().xml)
}

fn variables(root: &Element) -> Vec<&Element> {
    root.one("ModelVariables").all("ScalarVariable").collect()
}

#[test]
fn the_root_element_lists_the_capabilities() {
    let root = described::<CartPair>();
    assert_eq!(root.name, "fmiModelDescription");
    assert_eq!(root.get("fmiVersion"), Some("2.0"));
    assert_eq!(root.get("modelName"), Some("CartPair"));
    assert_eq!(root.get("description"), Some("Two carts on springs: <left> & \"right\""));
    assert_eq!(root.get("version"), Some(env!("CARGO_PKG_VERSION")));
    assert_eq!(root.get("author"), Some(env!("CARGO_PKG_AUTHORS").replace(':', ", ").as_str()));
    assert_eq!(root.get("license"), Some(env!("CARGO_PKG_LICENSE")));
    assert_eq!(root.get("variableNamingConvention"), Some("structured"));
    assert_eq!(root.get("guid"), Some(CartPair::description().guid.as_str()));
    let order: Vec<_> = root.children.iter().map(|child| child.name.as_str()).collect();
    // The elements must be in the order of the schema.
    assert_eq!(
        order,
        [
            "ModelExchange",
            "CoSimulation",
            "UnitDefinitions",
            "TypeDefinitions",
            "LogCategories",
            "DefaultExperiment",
            "ModelVariables",
            "ModelStructure"
        ]
    );
    let flags = "canGetAndSetFMUstate=true canHandleVariableCommunicationStepSize=true \
                 canNotUseMemoryManagementFunctions=true canSerializeFMUstate=true modelIdentifier=";
    assert_eq!(
        root.one("CoSimulation").text().replace(" canInterpolateInputs=true", ""),
        format!("CoSimulation {flags}CartPair providesDirectionalDerivative=true")
    );
    assert_eq!(described::<Sampler>().one("CoSimulation").text(), format!("CoSimulation {flags}Sampler"));
    let flags = flags.replace(
        "canHandleVariableCommunicationStepSize=true canNotUseMemoryManagementFunctions=true canSerializeFMUstate=true",
        "canNotUseMemoryManagementFunctions=true canSerializeFMUstate=true completedIntegratorStepNotNeeded=true",
    );
    assert_eq!(
        root.one("ModelExchange").text(),
        format!("ModelExchange {flags}CartPair providesDirectionalDerivative=true")
    );
    assert_eq!(described::<Sampler>().one("ModelExchange").text(), format!("ModelExchange {flags}Sampler"));
    assert_eq!(root.one("DefaultExperiment").text(), "DefaultExperiment startTime=0.0 stepSize=0.01 stopTime=10.0");
    let categories: Vec<_> = root.one("LogCategories").children.iter().filter_map(|c| c.get("name")).collect();
    assert_eq!(categories, ["logStatusError", "logStatusDiscard", "logEvents"]);
    // A model without enumerations has no types.
    assert_eq!(described::<Sampler>().all("TypeDefinitions").count(), 0);
}

#[test]
fn a_unit_that_is_not_declared_and_a_nominal_value_of_1_are_left_out() {
    let root = described::<Fragile>();
    let variable = *variables(&root).iter().find(|v| v.get("name") == Some("product.scale")).unwrap();
    assert_eq!(variable.children[0].text(), "Real min=0.0 start=1.0");
    let units: Vec<_> = root.one("UnitDefinitions").children.iter().filter_map(|unit| unit.get("name")).collect();
    assert!(units.iter().all(|name| !name.is_empty()), "{units:?}");
}

#[test]
fn variables_are_written_as_they_are_declared() {
    let root = described::<CartPair>();
    let written = |name: &str| {
        let variable = *variables(&root).iter().find(|v| v.get("name") == Some(name)).unwrap();
        assert_eq!(variable.children.len(), 1);
        let text = variable.text().replace("ScalarVariable ", "");
        let (what, reference) = text.split_once(" valueReference=").unwrap();
        let (_, variability) = reference.split_once(' ').unwrap();
        format!("{what} {variability} | {}", variable.children[0].text())
    };
    assert_eq!(
        written("cart.mass"),
        "causality=parameter description=Mass initial=exact name=cart.mass variability=fixed | \
         Real min=1e-6 nominal=2.0 start=2.0 unit=kg"
    );
    assert_eq!(
        written("spring.stiffness.r"),
        "causality=parameter description=Stiffness, right cart initial=exact name=spring.stiffness.r \
         variability=fixed | Real displayUnit=kN/m min=0.0 start=18.0 unit=N/m"
    );
    assert_eq!(
        written("spring.law"),
        "causality=parameter description=Law of the springs (0 linear, 2 hardening_spring) initial=exact \
         name=spring.law variability=fixed | Integer declaredType=Law max=2 min=0 start=0"
    );
    assert_eq!(
        written("damper.damping"),
        "causality=parameter description=Damping initial=exact name=damper.damping variability=tunable | \
         Real max=50.0 min=0.0 start=0.4 unit=N.s/m"
    );
    assert_eq!(
        written("damper.on"),
        "causality=parameter description=Dampers are active initial=exact name=damper.on variability=tunable | \
         Boolean start=true"
    );
    assert_eq!(
        written("spring.frequency.l"),
        "causality=calculatedParameter description=Undamped natural frequency, left cart initial=calculated \
         name=spring.frequency.l variability=tunable | Real unit=rad/s"
    );
    assert_eq!(
        written("cart_force.l"),
        "causality=input description=Force, left cart name=cart_force.l variability=continuous | \
         Real start=0.0 unit=N"
    );
    assert_eq!(
        written("cart_acceleration.r"),
        "causality=output description=Acceleration, right cart initial=calculated name=cart_acceleration.r \
         variability=continuous | Real displayUnit=g unit=m/s2"
    );
    assert_eq!(
        written("cart_position.l"),
        "causality=output description=Position of the left cart initial=exact name=cart_position.l \
         variability=continuous | Real displayUnit=mm nominal=0.5 start=0.1 unit=m"
    );
    assert_eq!(
        written("cart_velocity.l"),
        "causality=local description=Velocity, left cart initial=exact name=cart_velocity.l \
         variability=continuous | Real nominal=1.0 start=0.0 unit=m/s"
    );
    let state = CartPair::description().layout.structure_index(crate::models::reference::<CartPair>("cart_velocity.l"));
    assert_eq!(
        written("der(cart_velocity.l)"),
        format!(
            "causality=local description=Time derivative of cart_velocity.l initial=calculated \
             name=der(cart_velocity.l) variability=continuous | Real derivative={state} unit=m/s2"
        )
    );

    let root = described::<Sampler>();
    let elements: BTreeMap<_, _> = variables(&root).iter().map(|v| (v.get("name").unwrap(), *v)).collect();
    let output = elements["filter_output"];
    assert_eq!((output.get("variability"), output.get("initial")), (Some("discrete"), Some("exact")));
    assert_eq!(output.children[0].text(), "Real start=0.5 unit=m");
    assert_eq!(elements["filter.label"].children[0].text(), "String start=start <&> \"label\"");
    assert_eq!(elements["filter.order"].children[0].text(), "Integer max=4 min=1 start=2");
}

/// Rules of the standard that the schema does not contain: section 2.2.7 and its tables.
fn check_rules<E: Export>() {
    let root = described::<E>();
    let variables = variables(&root);
    let (mut names, mut references) = (BTreeSet::new(), BTreeSet::new());
    let units: BTreeMap<_, Vec<_>> = root
        .one("UnitDefinitions")
        .all("Unit")
        .map(|u| (u.get("name").unwrap(), u.all("DisplayUnit").filter_map(|d| d.get("name")).collect()))
        .collect();
    let mut used = BTreeSet::new();
    for variable in &variables {
        let name = variable.get("name").unwrap();
        assert!(names.insert(name), "{name}");
        assert!(references.insert(variable.get("valueReference").unwrap()), "{name}: no two share a reference");
        let kind = &variable.children[0];
        let legal = [
            ("parameter", "fixed", Some("exact")),
            ("parameter", "tunable", Some("exact")),
            ("calculatedParameter", "tunable", Some("calculated")),
            ("input", "continuous", None),
            ("output", "continuous", Some("calculated")),
            ("output", "continuous", Some("exact")),
            ("output", "discrete", Some("exact")),
            ("local", "continuous", Some("exact")),
            ("local", "continuous", Some("calculated")),
        ];
        let combination =
            (variable.get("causality").unwrap(), variable.get("variability").unwrap(), variable.get("initial"));
        assert!(legal.contains(&combination), "{name}: {combination:?}");
        let has_start = kind.get("start").is_some();
        assert_eq!(has_start, combination.2 != Some("calculated"), "{name}");
        if kind.name == "Real" {
            let unit = kind.get("unit");
            used.extend(unit);
            if let Some(display) = kind.get("displayUnit") {
                assert!(units[unit.unwrap()].contains(&display), "{name}: {display}");
            }
        } else {
            assert_eq!(combination.0, "parameter");
        }
    }
    assert_eq!(units.keys().copied().collect::<BTreeSet<_>>(), used, "the units that are used");

    let structure = root.one("ModelStructure");
    let listed = |list: &str| -> Vec<usize> {
        let unknowns = structure.all(list).flat_map(|list| list.all("Unknown"));
        unknowns
            .map(|unknown| {
                let dependencies = unknown.get("dependencies").unwrap();
                let dependencies: Vec<usize> =
                    dependencies.split_whitespace().map(|number| number.parse().unwrap()).collect();
                assert!(dependencies.is_sorted() && dependencies.iter().all(|&i| 0 < i && i <= variables.len()));
                unknown.get("index").unwrap().parse().unwrap()
            })
            .collect()
    };
    let indices = |wanted: &dyn Fn(&Element) -> bool| -> Vec<usize> {
        variables.iter().enumerate().filter(|(_, v)| wanted(v)).map(|(i, _)| i + 1).collect()
    };
    assert_eq!(listed("Outputs"), indices(&|v| v.get("causality") == Some("output")));
    let derivatives = indices(&|v| v.children[0].get("derivative").is_some());
    assert_eq!(listed("Derivatives"), derivatives);
    assert_eq!(listed("InitialUnknowns"), indices(&|v| v.get("initial") == Some("calculated")));
    // Derivative i belongs to state i, and no state is missing.
    let states: Vec<usize> =
        derivatives.iter().map(|&i| variables[i - 1].children[0].get("derivative").unwrap().parse().unwrap()).collect();
    for (&state, &derivative) in states.iter().zip(&derivatives) {
        let name = variables[state - 1].get("name").unwrap();
        assert_eq!(variables[derivative - 1].get("name"), Some(format!("der({name})").as_str()));
    }
}

#[test]
fn variables_and_structure_follow_the_standard() {
    check_rules::<CartPair>();
    check_rules::<Sampler>();
    check_rules::<Fragile>();
}

#[test]
fn initial_unknowns_depend_on_the_parameters_too() {
    let root = described::<CartPair>();
    let layout = &CartPair::description().layout;
    let index = |name: &str| layout.structure_index(crate::models::reference::<CartPair>(name));
    let dependencies = |name: &str| -> BTreeSet<usize> {
        let unknowns = root.one("ModelStructure").one("InitialUnknowns");
        let number = index(name).to_string();
        let unknown = unknowns.all("Unknown").find(|u| u.get("index") == Some(&number)).unwrap();
        unknown.get("dependencies").unwrap().split(' ').map(|i| i.parse().unwrap()).collect()
    };
    // At the start, calculated parameters and accelerations may depend on all parameters, fixed and tunable.
    let springs = ["spring.stiffness.l", "spring.stiffness.r", "spring.law", "coupling.stiffness"].map(index);
    let mut all: BTreeSet<_> = springs.into();
    all.extend(["cart.mass", "damper.damping", "damper.on", "max_step"].map(index));
    assert_eq!(dependencies("spring.frequency.l"), all);
    all.extend(["cart_force.l", "ground.height"].map(index));
    all.extend(["cart_position.l", "cart_position.r", "cart_velocity.l"].map(index));
    assert_eq!(dependencies("cart_acceleration.l"), all);
    // The outputs of a discrete-time model have start values; only calculated variables are initial unknowns.
    let root = described::<Sampler>();
    assert_eq!(root.one("ModelStructure").one("InitialUnknowns").children.len(), 1);
    for unknown in root.one("ModelStructure").one("Outputs").children.iter() {
        assert_eq!(unknown.get("dependencies"), Some(""));
    }
}

#[test]
fn units_carry_their_exponents_and_display_units() {
    let root = described::<CartPair>();
    let unit = |name: &str| {
        let units = root.one("UnitDefinitions");
        let unit = units.all("Unit").find(|unit| unit.get("name") == Some(name)).unwrap();
        unit.children.iter().map(Element::text).collect::<Vec<_>>()
    };
    assert_eq!(unit("N/m"), ["BaseUnit kg=1 s=-2", "DisplayUnit factor=0.001 name=kN/m"]);
    assert_eq!(unit("1"), ["BaseUnit ", "DisplayUnit factor=100.0 name=%"]);
    // display value = factor * value: a radian per second is 180/pi degrees per second.
    assert_eq!(unit("rad/s")[1], "DisplayUnit factor=57.29577951308232 name=deg/s");
    assert_eq!(
        root.one("TypeDefinitions").children[0].text(),
        "SimpleType description=0 linear: Proportional; 2 hardening_spring: Proportional, with a cubic part, and \
         moved by the ground name=Law"
    );
    assert_eq!(root.one("TypeDefinitions").children[0].one("Integer").text(), "Integer max=2 min=0");
}

#[test]
fn numbers_are_written_so_that_they_read_back_exactly() {
    for variable in &CartPair::description().layout.variables {
        if let Kind::Real(real) = &variable.declaration.kind {
            let text = format!("{:?}", real.start);
            assert_eq!(text.parse::<f64>().unwrap().to_bits(), real.start.to_bits());
        }
    }
}

#[test]
fn the_guid_is_the_hash_of_the_description_without_it() {
    for description in [CartPair::description(), Sampler::description(), Fragile::description()] {
        let without = description.xml.replace(&description.guid, "");
        let hash = uuid::Uuid::new_v5(&uuid::Uuid::NAMESPACE_OID, without.as_bytes());
        assert_eq!(description.guid, format!("{{{hash}}}"));
        assert_eq!(description.xml.matches(&description.guid).count(), 1);
    }
    // Generating the description again gives the same GUID.
    let again = Description::of::<<CartPair as Export>::Model>(Format::FMI2, Path::new(""));
    assert_eq!(again.guid, CartPair::description().guid);
    assert_eq!(again.xml, CartPair::description().xml);
}

/// GUIDs of amplifiers with these attributes. They do not use the attribute `model`, because the version must vary.
macro_rules! guids {
    ($($version:literal, $doc:literal, ($($gain:tt)*), $unit:literal, $output:literal;)*) => {[$({
        use fmu::Info;
        use fmu::prelude::*;

        #[derive(Parameters)]
        struct Amplifier {
            #[doc = $doc]
            #[var("amplifier.gain", unit = "1", $($gain)*)]
            k: f64,
        }
        #[derive(Inputs)]
        struct U {
            /// Input
            #[var("amplifier_input", unit = $unit)]
            u: f64,
        }
        #[derive(Outputs)]
        struct Y {
            /// Output
            #[var($output, unit = $unit)]
            y: f64,
        }
        impl Discrete for Amplifier {
            const INFO: Info = Info {
                name: "Amplifier",
                description: "A",
                version: $version,
                authors: "",
                license: "",
                homepage: "",
                stop_time: 1.0,
                step_size: 0.1,
                resources: "",
            };
            type Inputs = U;
            type Outputs = Y;
            type State = ();
            type Derived = ();
            fn derived(&self) -> Result<(), String> {
                Ok(())
            }
            fn update(&self, sample: Sample<Self>) -> Y {
                Y { y: self.k * sample.inputs.u }
            }
        }
        let description = Description::of::<fmu::testing::runner::DiscreteModel<Amplifier>>(Format::FMI2, Path::new(""));
        assert!(!description.xml.contains("author=") && !description.xml.contains("license="), "{}", description.xml);
        description.guid
    }),*]};
}

#[test]
fn the_guid_changes_with_the_declaration_and_only_with_it() {
    let guids = guids! {
        "1", "Gain", (start = 1.0), "m", "amplifier_output";
        "2", "Gain", (start = 1.0), "m", "amplifier_output";
        "1", "Factor", (start = 1.0), "m", "amplifier_output";
        "1", "Gain", (start = 1.5), "m", "amplifier_output";
        "1", "Gain", (start = 1.0, tunable), "m", "amplifier_output";
        "1", "Gain", (start = 1.0, min = 0.0), "m", "amplifier_output";
        "1", "Gain", (start = 1.0, nominal = 3.0), "m", "amplifier_output";
        "1", "Gain", (start = 1.0, display = "%"), "m", "amplifier_output";
        "1", "Gain", (start = 1.0), "rad", "amplifier_output";
        "1", "Gain", (start = 1.0), "m", "amplifier_result";
    };
    assert_eq!(guids.iter().collect::<BTreeSet<_>>().len(), guids.len());
    let same = guids! { "1", "Gain", (start = 1.0), "m", "amplifier_output"; };
    assert_eq!(same[0], guids[0]);
}

mod without_derived_parameters {
    use fmu::Info;
    use fmu::prelude::*;

    #[derive(Parameters)]
    pub(super) struct Hopeless {
        /// Mass (kg)
        #[var(start = 2.0)]
        mass: f64,
    }

    impl Discrete for Hopeless {
        const INFO: Info = Info { name: "Hopeless", ..<crate::models::Sampler as Discrete>::INFO };
        type Inputs = ();
        type Outputs = ();
        type State = ();
        type Derived = ();
        fn derived(&self) -> Result<(), String> {
            Err(format!("'mass' must be below 2 kg, got {} kg", self.mass))
        }
        fn update(&self, _: Sample<Self>) {}
    }

    impl Continuous for Hopeless {
        const INFO: Info = <Self as Discrete>::INFO;
        type State<T: Scalar> = ();
        type Inputs<T: Scalar> = ();
        type Outputs<T: Scalar> = ();
        type Derived = ();
        type DiscreteState = ();
        type Crossings = [f64; 0];
        type Schedules = [fmu::__private::Schedule; 0];
        type Timers = fmu::__private::NoTimer;
        fn derived(&self) -> Result<(), String> {
            <Self as Discrete>::derived(self)
        }
        fn derivatives<T: Scalar>(&self, _: At<T, Self>) {}
        fn outputs<T: Scalar>(&self, _: At<T, Self>) {}
        fn evaluate<T: Scalar>(&self, _: At<T, Self>) -> ((), ()) {
            ((), ())
        }
    }
}

#[test]
#[should_panic = "Hopeless: the model rejects its start values: 'mass' must be below 2 kg, got 2 kg"]
fn a_continuous_model_whose_start_values_are_rejected_has_no_description() {
    // The dependencies of this model cannot be found, and an empty list of dependencies would be wrong.
    Description::of::<fmu::testing::runner::ContinuousModel<without_derived_parameters::Hopeless>>(
        Format::FMI2,
        Path::new(""),
    );
}

/// Names that a customer prescribes, and texts with line breaks.
mod dictated {
    use fmu::prelude::*;

    #[derive(Parameters)]
    pub(super) struct Dictated {
        /// Gain (1)
        #[var("ACC_Gain", start = 2.0)]
        gain: f64,
        /// Header of the log
        #[var(start = "two\nlines\tand a \"tab\"")]
        header: String,
    }

    #[derive(Inputs)]
    pub(super) struct U {
        /// Speeds (km/h)
        #[var("VehSpd [kph] <ä>", description = ["Of the\nfront", "Of the\trear"])]
        speed: [f64; 2],
    }

    #[derive(Outputs)]
    pub(super) struct Y {
        /// Request (1)
        #[var("acc.setSpeed")]
        request: f64,
    }

    /// Names as a customer dictates them
    #[fmu::model(stop_time = 1.0, step_size = 0.01)]
    impl Discrete for Dictated {
        type Inputs = U;
        type Outputs = Y;
        fn update(&self, sample: Sample<Self>) -> Y {
            Y { request: self.gain * sample.inputs.speed[0] }
        }
    }
}

/// FMI 2.0.4, section 2.2.9, and 3.0.2, section 2.4.7.5.1: a flat name is any text in one line. XML 1.0, section 3.3.3:
/// in an attribute, line breaks and tabs are kept if they are character references.
#[test]
fn any_name_and_any_text_is_described() {
    type Model = fmu::testing::runner::DiscreteModel<dictated::Dictated>;
    for format in [Format::FMI2, Format::FMI3, Format { arrays: true, ..Format::FMI3 }] {
        let xml = Description::of::<Model>(format, Path::new("")).xml;
        let start = if format.version == fmu::testing::calls::Version::Fmi2 { "start" } else { "Start value" };
        let header = format!("{start}=\"two&#10;lines&#9;and a &quot;tab&quot;\"");
        for part in ["variableNamingConvention=\"flat\"", "\"ACC_Gain\"", "\"acc.setSpeed\"", &header] {
            assert!(xml.contains(part), "{part} in\n{xml}");
        }
        if !format.arrays {
            for part in ["\"VehSpd [kph] &lt;ä&gt;[1]\"", "\"Of the&#10;front\"", "\"Of the&#9;rear\""] {
                assert!(xml.contains(part), "{part} in\n{xml}");
            }
        }
    }
    let structured =
        Description::of::<fmu::testing::runner::DiscreteModel<crate::models::Sampler>>(Format::FMI2, Path::new(""));
    assert!(structured.xml.contains("variableNamingConvention=\"structured\""));
}
