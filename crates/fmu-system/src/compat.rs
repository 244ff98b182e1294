//! Finds the FMUs whose signals fit a plant.
//!
//! A *plant* is an FMU with continuous states (the model structure lists derivatives) that writes no input of an FMU
//! with more states; an FMU that does is an actuator of the larger FMU. A *block* such as `Actuator` is not a plant
//! either: its inputs and outputs have no unit of measure, and no other FMU has a signal with the same name, so only
//! explicit connections join a block to other FMUs. All other FMUs are *components*: controllers, sources, actuators,
//! blocks.
//!
//! A signal goes from an output to an input of the same name, if base types and units of measure agree
//! ([`Variable::mismatch`]). A component *fits* a plant if
//!
//! - it is supplied: every input is written by the plant or by another component that is supplied, and
//! - it acts: an output is an input of the plant or of a supplied component that acts.
//!
//! Components may form a cycle. Outputs of other plants are not considered, because a system has one plant. An input
//! that nothing writes is missing, even if a scenario could hold it constant. Matching signals are not enough: a
//! controller may need the parameters of the new vehicle, and an output that the plant does not read has no effect.

use fmu_import::description::{Causality, ModelDescription, Variable};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::sync::Arc;

/// The fit of every component to every plant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Systems {
    /// Names of the plants, sorted.
    pub plants: Vec<String>,
    /// Names of the other FMUs, sorted.
    pub components: Vec<String>,
    /// Indexed by component, then by plant.
    pub fits: Vec<Vec<Fit>>,
}

/// Fit of a component to a plant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Fit {
    /// All inputs are written, and the component acts on the plant, directly or through other components.
    Fits,
    /// All inputs are written, but nothing that acts on the plant reads its outputs.
    Idle,
    /// Inputs that nothing writes in a system with this plant; never empty.
    Lacks(Vec<Missing>),
}

/// An input that nothing writes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Missing {
    /// Name of the input.
    pub input: String,
    /// Its unit of measure.
    pub unit: Option<String>,
    /// Reason that it is not written.
    pub reason: Reason,
}

/// Reason that an input is not written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Reason {
    /// No other FMU has an output of this name.
    Unknown,
    /// The plant or a component has an output of this name, but with another shape, type or unit.
    Mismatch {
        /// FMU that has the output.
        writer: String,
        /// Shape, type or unit of the output.
        is: String,
        /// Shape, type or unit of the input.
        expected: String,
    },
    /// Only these components write it, but they lack inputs themselves.
    Unsupplied(Vec<String>),
    /// Only these other plants write it.
    OtherPlants(Vec<String>),
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.input)?;
        if let Some(unit) = &self.unit {
            write!(f, " ({unit})")?;
        }
        match &self.reason {
            Reason::Unknown => write!(f, ": no FMU has it"),
            Reason::Mismatch { writer, is, expected } => write!(f, ": {writer} has it {is}, expected {expected}"),
            Reason::Unsupplied(components) => {
                let lack = if components.len() == 1 { "lacks" } else { "lack" };
                write!(f, ": {} would write it, but {lack} inputs too", components.join(", "))
            }
            Reason::OtherPlants(plants) => write!(f, ": only {} has it", plants.join(", ")),
        }
    }
}

type Descriptions = BTreeMap<String, Arc<ModelDescription>>;

/// Finds which FMUs fit which plants. The keys are the names that scenarios use.
pub fn systems(fmus: &Descriptions) -> Systems {
    let (plants, components): (Vec<&str>, Vec<&str>) =
        fmus.keys().map(String::as_str).partition(|name| is_plant(fmus, name));
    let columns: Vec<Vec<Fit>> = plants.iter().map(|plant| fits_of(fmus, plant, &plants, &components)).collect();
    Systems {
        fits: (0..components.len()).map(|row| columns.iter().map(|column| column[row].clone()).collect()).collect(),
        plants: plants.into_iter().map(str::to_string).collect(),
        components: components.into_iter().map(str::to_string).collect(),
    }
}

fn is_plant(fmus: &Descriptions, name: &str) -> bool {
    let states = |name: &str| fmus[name].derivatives.len();
    let is_actuator_of = |other: &String| states(other) > states(name) && writes(&fmus[name], &fmus[other]);
    states(name) > 0 && !is_block(fmus, name) && !fmus.keys().any(is_actuator_of)
}

/// Returns true if the inputs and outputs of an FMU have no units, and no other FMU has a signal of the same name.
fn is_block(fmus: &Descriptions, name: &str) -> bool {
    let is_signal = |variable: &&Variable| matches!(variable.causality, Causality::Input | Causality::Output);
    let is_elsewhere = |signal: &Variable| {
        let others = fmus.iter().filter(|(other, _)| other.as_str() != name);
        others.flat_map(|(_, other)| &other.variables).filter(is_signal).any(|other| other.name == signal.name)
    };
    fmus[name].variables.iter().filter(is_signal).all(|signal| signal.unit.is_none() && !is_elsewhere(signal))
}

fn output<'a>(writer: &'a ModelDescription, input: &Variable) -> Option<&'a Variable> {
    writer.variable(&input.name).filter(|variable| variable.causality == Causality::Output)
}

fn supplies(writer: &ModelDescription, input: &Variable) -> bool {
    output(writer, input).is_some_and(|output| output.mismatch(input).is_none())
}

fn writes(writer: &ModelDescription, reader: &ModelDescription) -> bool {
    reader.of(Causality::Input).any(|input| supplies(writer, input))
}

fn fits_of(fmus: &Descriptions, plant: &str, plants: &[&str], components: &[&str]) -> Vec<Fit> {
    // Remove components with unwritten inputs until none is left. Starting with all components keeps cycles.
    let mut supplied: BTreeSet<&str> = components.iter().copied().collect();
    let unwritten = |component: &str, supplied: &BTreeSet<&str>| -> Vec<&Variable> {
        // An FMU cannot write its own inputs: names are unique within an FMU.
        let writers = || supplied.iter().chain([&plant]);
        fmus[component]
            .of(Causality::Input)
            .filter(|input| !writers().any(|writer| supplies(&fmus[*writer], input)))
            .collect()
    };
    loop {
        let kept: BTreeSet<&str> =
            supplied.iter().copied().filter(|component| unwritten(component, &supplied).is_empty()).collect();
        if kept.len() == supplied.len() {
            break;
        }
        supplied = kept;
    }

    // Search backward from the plant.
    let mut acting: BTreeSet<&str> = BTreeSet::new();
    loop {
        let acts = |component: &&str| {
            let mut readers = acting.iter().chain([&plant]);
            readers.any(|reader| writes(&fmus[*component], &fmus[*reader]))
        };
        let grown: BTreeSet<&str> = supplied.iter().copied().filter(acts).collect();
        if grown.len() == acting.len() {
            break;
        }
        acting = grown;
    }

    let fit = |component: &&str| {
        if acting.contains(component) {
            Fit::Fits
        } else if supplied.contains(component) {
            Fit::Idle
        } else {
            let missing = unwritten(component, &supplied).into_iter();
            Fit::Lacks(missing.map(|input| missing_input(fmus, input, plant, plants, components)).collect())
        }
    };
    components.iter().map(fit).collect()
}

fn missing_input(fmus: &Descriptions, input: &Variable, plant: &str, plants: &[&str], components: &[&str]) -> Missing {
    let of = |names: &[&str], is_writer: &dyn Fn(&str) -> bool| -> Vec<String> {
        names.iter().filter(|name| is_writer(name)).map(|name| (*name).to_string()).collect()
    };
    let writers = of(components, &|name| supplies(&fmus[name], input));
    let other_plants = of(plants, &|name| name != plant && supplies(&fmus[name], input));
    let mismatch = components.iter().chain([&plant]).find_map(|name| {
        let [is, expected] = output(&fmus[*name], input)?.mismatch(input)?;
        Some(Reason::Mismatch { writer: (*name).to_string(), is, expected })
    });
    let reason = match mismatch {
        Some(mismatch) => mismatch,
        None if !writers.is_empty() => Reason::Unsupplied(writers),
        None if !other_plants.is_empty() => Reason::OtherPlants(other_plants),
        None => Reason::Unknown,
    };
    Missing { input: input.name.clone(), unit: input.unit.clone(), reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a description. Inputs and outputs are given as `name unit`, with `-` for no unit. The first `states`
    /// outputs are states.
    fn fmu(inputs: &[&str], outputs: &[&str], states: usize) -> Arc<ModelDescription> {
        let mut variables = String::new();
        let roles = inputs.iter().map(|text| (text, "input")).chain(outputs.iter().map(|text| (text, "output")));
        for (i, (text, causality)) in roles.enumerate() {
            let (name, unit) = text.split_once(' ').unwrap();
            let typed = match unit {
                "bool" => "<Boolean/>".to_string(),
                "-" => "<Real/>".to_string(),
                unit => format!("<Real unit=\"{unit}\"/>"),
            };
            variables += &format!(
                "<ScalarVariable name=\"{name}\" valueReference=\"{i}\" causality=\"{causality}\">{typed}</ScalarVariable>"
            );
        }
        let derivatives: String = (1..=states).map(|i| format!("<Unknown index=\"{}\"/>", inputs.len() + i)).collect();
        let text = format!(
            "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"m\" guid=\"g\"><CoSimulation modelIdentifier=\"m\"/>\
             <ModelVariables>{variables}</ModelVariables><ModelStructure><Derivatives>{derivatives}</Derivatives>\
             </ModelStructure></fmiModelDescription>"
        );
        Arc::new(ModelDescription::parse(&text).unwrap())
    }

    fn toys<const N: usize>(fmus: [(&str, Arc<ModelDescription>); N]) -> Systems {
        systems(&fmus.into_iter().map(|(name, fmu)| (name.to_string(), fmu)).collect())
    }

    fn fit<'a>(systems: &'a Systems, component: &str, plant: &str) -> &'a Fit {
        let row = systems.components.iter().position(|name| name == component).unwrap();
        let column = systems.plants.iter().position(|name| name == plant).unwrap();
        &systems.fits[row][column]
    }

    fn reasons(fit: &Fit) -> Vec<String> {
        match fit {
            Fit::Lacks(missing) => missing.iter().map(Missing::to_string).collect(),
            other => panic!("{other:?}"),
        }
    }

    fn car() -> Arc<ModelDescription> {
        fmu(&["steer rad", "speed m/s"], &["yaw_rate rad/s", "roll rad"], 2)
    }

    #[test]
    fn a_component_fits_if_it_is_supplied_and_acts() {
        let systems = toys([
            ("Car", car()),
            ("Driver", fmu(&[], &["demand rad", "speed m/s"], 0)),
            ("Steering", fmu(&["demand rad", "yaw_rate rad/s", "target rad/s"], &["steer rad"], 0)),
            // Acts only through another component.
            ("Target", fmu(&["demand rad"], &["target rad/s"], 0)),
            ("Display", fmu(&["roll rad"], &["needle rad"], 0)),
        ]);
        assert_eq!(systems.plants, ["Car"]);
        assert_eq!(systems.components, ["Display", "Driver", "Steering", "Target"]);
        assert_eq!(systems.fits, [[Fit::Idle], [Fit::Fits], [Fit::Fits], [Fit::Fits]]);
    }

    #[test]
    fn names_units_and_types_count() {
        let systems = toys([
            ("Car", car()),
            ("Degrees", fmu(&["yaw_rate deg/s"], &["steer rad"], 0)),
            ("Switch", fmu(&["roll bool"], &["steer rad"], 0)),
            ("Turned", fmu(&["yaw_rate rad/s"], &["steer deg"], 0)),
            ("Blind", fmu(&["pitch rad"], &["steer rad"], 0)),
        ]);
        let reasons = |component| reasons(fit(&systems, component, "Car"));
        assert_eq!(reasons("Degrees"), ["yaw_rate (deg/s): Car has it in rad/s, expected in deg/s"]);
        assert_eq!(reasons("Switch"), ["roll: Car has it Real, expected Boolean"]);
        assert_eq!(reasons("Blind"), ["pitch (rad): no FMU has it"]);
        // Its output has another unit than the input of the plant.
        assert_eq!(*fit(&systems, "Turned", "Car"), Fit::Idle);
    }

    #[test]
    fn what_a_component_lacks_is_traced_to_its_cause() {
        let systems = toys([
            ("Car", car()),
            ("Bike", fmu(&["steer rad"], &["lean rad", "roll rad"], 2)),
            ("Balance", fmu(&["lean rad"], &["wish rad"], 0)),
            ("Steering", fmu(&["wish rad", "roll rad"], &["steer rad"], 0)),
        ]);
        assert_eq!(systems.plants, ["Bike", "Car"]);
        assert_eq!(*fit(&systems, "Balance", "Bike"), Fit::Fits);
        assert_eq!(*fit(&systems, "Steering", "Bike"), Fit::Fits);
        assert_eq!(reasons(fit(&systems, "Balance", "Car")), ["lean (rad): only Bike has it"]);
        assert_eq!(
            reasons(fit(&systems, "Steering", "Car")),
            ["wish (rad): Balance would write it, but lacks inputs too"]
        );
    }

    #[test]
    fn components_may_need_each_other() {
        let systems = toys([
            ("Car", car()),
            ("Brain", fmu(&["state 1", "roll rad"], &["command 1"], 0)),
            ("Hand", fmu(&["command 1"], &["state 1", "steer rad"], 0)),
        ]);
        assert_eq!(*fit(&systems, "Brain", "Car"), Fit::Fits);
        assert_eq!(*fit(&systems, "Hand", "Car"), Fit::Fits);
    }

    #[test]
    fn an_actuator_is_no_plant() {
        // Both FMUs have states and read each other's outputs. The FMU with fewer states is an actuator of the other
        // FMU.
        let systems = toys([
            ("Car", fmu(&["torque N.m"], &["spin rad/s", "speed m/s"], 2)),
            ("Brake", fmu(&["spin rad/s", "pedal 1"], &["pressure MPa", "torque N.m"], 1)),
            ("Driver", fmu(&["speed m/s"], &["pedal 1"], 0)),
        ]);
        assert_eq!(systems.plants, ["Car"]);
        assert_eq!(systems.fits, [[Fit::Fits], [Fit::Fits]]);
    }

    #[test]
    fn a_block_without_units_and_shared_signals_is_no_plant() {
        let bare = |input: &str, output: &str| fmu(&[&format!("{input} -")], &[&format!("{output} -")], 1);
        let systems = toys([
            ("Car", car()),
            ("Actuator", bare("command", "value")),
            // This FMU has no units either, but its input has the name of a signal of `Car`, so it is not a block.
            ("Bike", bare("steer", "lean")),
        ]);
        assert_eq!(systems.plants, ["Bike", "Car"]);
        assert_eq!(reasons(fit(&systems, "Actuator", "Car")), ["command: no FMU has it"]);
    }

    #[test]
    fn without_a_plant_there_is_nothing_to_fit() {
        let systems = toys([("Driver", fmu(&[], &["pedal 1"], 0))]);
        assert_eq!((systems.plants.len(), &systems.components[..]), (0, &["Driver".to_string()][..]));
        assert_eq!(systems.fits, [[]]);
    }
}
