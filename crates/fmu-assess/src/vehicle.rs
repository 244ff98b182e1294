//! Vehicle data that the bench needs: size, class and steering. They come from a file or from the parameters of the
//! plant.

use crate::plant::Plant;
use fmu_system::schema;
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A vehicle file: data that the FMU does not contain, and signals whose names differ from the bench's.
#[derive(Debug, Clone, Default)]
pub struct VehicleFile {
    /// Data that the FMU of the plant does not contain.
    pub vehicle: Given,
    /// The bench's name of a signal -> name of the plant's variable.
    pub signals: BTreeMap<String, String>,
    /// The bench's name of a signal -> unit of the plant's variable, which takes precedence over the declared unit.
    pub units: BTreeMap<String, String>,
    /// For each other FMU, by its name: the bench's name of a signal -> name of the FMU's variable.
    pub controllers: BTreeMap<String, BTreeMap<String, String>>,
}

/// A vehicle file of the test bench.
#[derive(Deserialize, Default, JsonSchema)]
#[serde(deny_unknown_fields, default)]
struct Written {
    /// Data that the FMU of the plant does not contain.
    vehicle: Given,
    /// Names of the plant's variables, by the bench's names of the signals. For other FMUs, a table with the name of
    /// the FMU.
    signals: BTreeMap<String, Named>,
}

/// Returns the schema of a vehicle file.
pub fn schema() -> Schema {
    schema::of_file::<Written>()
}

/// A variable, or the variables of an FMU.
#[derive(Deserialize, JsonSchema)]
#[serde(
    untagged,
    expecting = "the name of a variable, { variable = .., unit = .. }, or a table of an FMU with the names of its variables"
)]
enum Named {
    /// Name of a variable.
    Variable(String),
    WithUnit(WithUnit),
    /// Names of an FMU's variables, by the bench's names of the signals.
    OfFmu(BTreeMap<String, String>),
}

/// A variable with a unit other than the declared one, or without a declared unit.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct WithUnit {
    /// Name of the variable; by default, the name of the signal.
    variable: Option<String>,
    /// Unit.
    unit: Option<String>,
}

/// Vehicle data in a file. Missing values are derived from the plant.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Given {
    /// Class, which determines the limits that apply.
    pub class: Option<Class>,
    /// Mass, kg.
    pub mass: Option<f64>,
    /// Largest width, m.
    pub width: Option<f64>,
    /// From the reference point to the front bumper, m.
    pub front: Option<f64>,
    /// From the reference point to the rear bumper, m.
    pub rear: Option<f64>,
    /// Wheelbase, m; for more than two axles, the equivalent wheelbase.
    pub wheelbase: Option<f64>,
    /// Ratio of steering wheel angle to front wheel angle.
    pub steer_ratio: Option<f64>,
    /// Understeer gradient for the driver model, rad/(m/s2).
    pub understeer_gradient: Option<f64>,
}

/// Vehicle class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Up to 3,500 kg.
    Car,
    /// Above 3,500 kg.
    Truck,
}

/// Largest mass of a car, kg.
const HEAVIEST_CAR: f64 = 3500.0;
/// Assumed width in addition to the track, m, and assumed length beyond the first and last axle, m.
const BESIDE: f64 = 0.25;
const OVERHANG: f64 = 0.85;
/// Cornering stiffness of the rear axles divided by the stiffness of the front axle; assumed if it is unknown.
const STIFFNESS_RATIO: f64 = 3.0;

/// A value and its source.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Datum {
    /// The value, SI.
    pub value: f64,
    /// Its source.
    pub source: String,
}

/// Data of a vehicle.
#[derive(Debug, Clone, Serialize)]
pub struct Vehicle {
    /// Class, which determines the limits that apply.
    pub class: Class,
    /// Mass, kg; `None` if neither a parameter nor tire loads give it.
    pub mass: Option<Datum>,
    /// Largest width, m.
    pub width: Option<Datum>,
    /// From the reference point to the front bumper, m.
    pub front: Option<Datum>,
    /// From the reference point to the rear bumper, m.
    pub rear: Option<Datum>,
    /// Wheelbase, m; for more than two axles, the equivalent wheelbase (Winkler).
    pub wheelbase: Option<Datum>,
    /// Ratio of steering wheel angle to front wheel angle.
    pub steer_ratio: Datum,
    /// Understeer gradient for the driver model, rad/(m/s2); `None` until it is measured.
    pub understeer_gradient: Option<Datum>,
    /// Distances of the other axles behind the front axle, m.
    #[serde(skip)]
    pub axle_offsets: Vec<f64>,
}

/// Vehicle files of the library, by the name of the FMU.
const KNOWN: [(&str, &str); 4] = [
    ("EspCar", include_str!("vehicles/EspCar.toml")),
    ("RescueVehicle", include_str!("vehicles/RescueVehicle.toml")),
    ("HeavyVehicle", include_str!("vehicles/HeavyVehicle.toml")),
    ("HydroPneumaticHalfCar", include_str!("vehicles/HydroPneumaticHalfCar.toml")),
];

impl VehicleFile {
    /// Reads a vehicle file.
    ///
    /// # Errors
    /// The text is not a vehicle file. The message contains the location.
    pub fn parse(text: &str) -> Result<Self, String> {
        let Written { vehicle, signals } = toml::from_str(text).map_err(|error| error.to_string())?;
        let mut file = Self { vehicle, ..Self::default() };
        for (name, named) in signals {
            match named {
                Named::Variable(variable) => drop(file.signals.insert(name, variable)),
                Named::WithUnit(WithUnit { variable: None, unit: None }) => {
                    return Err(format!("signals.{name} has neither `variable` nor `unit`"));
                }
                Named::WithUnit(WithUnit { variable, unit }) => {
                    file.signals.extend(variable.map(|variable| (name.clone(), variable)));
                    file.units.extend(unit.map(|unit| (name, unit)));
                }
                Named::OfFmu(names) => drop(file.controllers.insert(name, names)),
            }
        }
        let Given { mass, width, front, rear, wheelbase, steer_ratio, .. } = &file.vehicle;
        let names = ["mass", "width", "front", "rear", "wheelbase", "steer_ratio"];
        for (name, value) in names.into_iter().zip([mass, width, front, rear, wheelbase, steer_ratio]) {
            if let Some(value) = value.filter(|value| !(value.is_finite() && *value > 0.0)) {
                return Err(format!("vehicle.{name} must be a positive number, got {value}"));
            }
        }
        if let Some(gradient) = file.vehicle.understeer_gradient.filter(|gradient| !gradient.is_finite()) {
            return Err(format!("vehicle.understeer_gradient must be a finite number, got {gradient}"));
        }
        Ok(file)
    }

    /// Data for a vehicle of the library; empty for any other vehicle.
    pub fn of_library(fmu: &str) -> Self {
        let text = KNOWN.iter().find(|(name, _)| *name == fmu).map(|(_, text)| *text);
        text.map_or_else(Self::default, |text| Self::parse(text).expect("the file is tested"))
    }

    /// Fills missing vehicle data from `library`.
    pub fn over(mut self, library: Self) -> Self {
        let (own, rest) = (self.vehicle, library.vehicle);
        self.vehicle = Given {
            class: own.class.or(rest.class),
            mass: own.mass.or(rest.mass),
            width: own.width.or(rest.width),
            front: own.front.or(rest.front),
            rear: own.rear.or(rest.rear),
            wheelbase: own.wheelbase.or(rest.wheelbase),
            steer_ratio: own.steer_ratio.or(rest.steer_ratio),
            understeer_gradient: own.understeer_gradient.or(rest.understeer_gradient),
        };
        self
    }
}

impl Vehicle {
    /// Combines data from a file and parameters of a plant. `mass` is the mass from the tire loads.
    pub(crate) fn new(given: &Given, plant: &Plant, mass: Option<f64>) -> Self {
        let datum = |written: Option<f64>, computed: Option<(f64, String)>| {
            let found = written.map(|value| (value, "vehicle data".to_owned())).or(computed);
            found.map(|(value, source)| Datum { value, source })
        };
        let parameter = |name: &str| plant.parameter(name);
        let axles = axles(&parameter);
        let track = parameter("geometry.track")
            .or_else(|| Some(parameter("geometry.half_track.left")? + parameter("geometry.half_track.right")?));
        let known = parameter("vehicle.mass").map(|mass| (mass, "vehicle.mass".to_owned()));
        let mass = datum(given.mass, known.or(mass.map(|mass| (mass, "tire loads".to_owned()))));
        let is_car = mass.as_ref().is_none_or(|mass| mass.value <= HEAVIEST_CAR);
        let class = given.class.unwrap_or(if is_car { Class::Car } else { Class::Truck });
        let ratio = match class {
            Class::Car => 16.0,
            Class::Truck => 20.0,
        };
        let first = axles.first().copied();
        let last = axles.last().copied();
        Self {
            class,
            mass,
            width: datum(given.width, track.map(|track| (track + BESIDE, format!("track + {BESIDE} m")))),
            front: datum(given.front, first.map(|x| (x + OVERHANG, format!("front axle + {OVERHANG} m")))),
            rear: datum(given.rear, last.map(|x| (OVERHANG - x, format!("rearmost axle + {OVERHANG} m")))),
            wheelbase: datum(given.wheelbase, wheelbase(&axles, &parameter)),
            steer_ratio: Datum {
                value: given.steer_ratio.unwrap_or(ratio),
                source: if given.steer_ratio.is_some() { "vehicle data" } else { "assumed" }.to_owned(),
            },
            understeer_gradient: datum(given.understeer_gradient, None),
            axle_offsets: axles.iter().skip(1).map(|x| axles[0] - x).collect(),
        }
    }
}

/// Positions of the axles relative to the reference point, m, from front to rear, positive forward; empty if unknown.
fn axles(parameter: &dyn Fn(&str) -> Option<f64>) -> Vec<f64> {
    let Some(front) = parameter("geometry.cg_to_front_axle") else { return Vec::new() };
    let spacing = parameter("geometry.middle_to_rear_axle");
    if let (Some(middle), Some(spacing)) = (parameter("geometry.front_to_middle_axle"), spacing) {
        return vec![front, front - middle, front - middle - spacing];
    }
    if let (Some(trunnion), Some(spacing)) = (parameter("geometry.cg_to_rear_suspension"), spacing) {
        return vec![front, -trunnion + 0.5 * spacing, -trunnion - 0.5 * spacing];
    }
    match parameter("geometry.cg_to_rear_axle") {
        Some(rear) => vec![front, -rear],
        None => Vec::new(),
    }
}

/// Wheelbase. For more than two axles, the wheelbase of an equivalent two-axle vehicle (Winkler 1998): L (1 + T^2/L^2
/// (1 + C_r/C_f)). L is the distance from the front axle to the mean position of the other axles, T the RMS distance of
/// these axles from their mean, and C the cornering stiffness.
fn wheelbase(axles: &[f64], parameter: &dyn Fn(&str) -> Option<f64>) -> Option<(f64, String)> {
    let (front, others) = axles.split_first()?;
    let count = others.len() as f64;
    let mean = others.iter().sum::<f64>() / count;
    let length = front - mean;
    if others.len() == 1 {
        return Some((length, "distance of the axles".to_owned()));
    }
    let squares = others.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / count;
    let stiffness = |axle: &str| parameter(&format!("tire.cornering_stiffness.{axle}"));
    let known = stiffness("front").zip(stiffness("middle")).zip(stiffness("rear"));
    let (ratio, source) = match known {
        Some(((front, middle), rear)) => ((middle + rear) / front, "equivalent wheelbase"),
        None => (STIFFNESS_RATIO, "equivalent wheelbase, cornering stiffness assumed"),
    };
    Some((length * (1.0 + squares / (length * length) * (1.0 + ratio)), source.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_the_library_are_read() {
        for (name, _) in KNOWN {
            let given = VehicleFile::of_library(name).vehicle;
            assert!(given.width.is_some() && given.understeer_gradient.is_some(), "{name}");
        }
        assert!(VehicleFile::of_library("Stranger").vehicle.width.is_none());
    }

    #[test]
    fn a_file_stands_above_the_data_of_the_library() {
        let file =
            "[vehicle]\nwidth = 1.7\n[signals]\n\"steer.front\" = \"delta\"\n[signals.Mine]\n\"steer.rear\" = \"d2\"\n";
        let found = VehicleFile::parse(file).unwrap().over(VehicleFile::of_library("EspCar"));
        assert_eq!((found.vehicle.width, found.vehicle.front), (Some(1.7), Some(1.95)));
        assert_eq!(found.signals, BTreeMap::from([("steer.front".to_owned(), "delta".to_owned())]));
        assert_eq!(found.controllers["Mine"], BTreeMap::from([("steer.rear".to_owned(), "d2".to_owned())]));
        let file = "[signals]\n\"vehicle.yaw_rate\" = { variable = \"r\", unit = \"deg/s\" }\n\"body.roll\" = { unit = \"deg\" }\n";
        let found = VehicleFile::parse(file).unwrap();
        assert_eq!(found.signals, BTreeMap::from([("vehicle.yaw_rate".to_owned(), "r".to_owned())]));
        assert_eq!((found.units["vehicle.yaw_rate"].as_str(), found.units["body.roll"].as_str()), ("deg/s", "deg"));
        assert!(found.controllers.is_empty());
        // A table with the key `variable` or `unit` describes a signal, not an FMU.
        let named = VehicleFile::parse("[signals]\na = { variable = \"b\" }\nc = { unit = \"deg\" }\n").unwrap();
        assert_eq!((named.signals["a"].as_str(), named.units["c"].as_str()), ("b", "deg"));
        assert!(named.controllers.is_empty());
        let empty = VehicleFile::parse("[signals]\na = {}\n").unwrap_err();
        assert_eq!(empty, "signals.a has neither `variable` nor `unit`");
        let wrong = VehicleFile::parse("[signals]\n\"steer.front\" = 1\n").unwrap_err();
        assert!(wrong.contains("the name of a variable, { variable = .., unit = .. }, or a table"), "{wrong}");
    }

    #[test]
    fn a_wrong_file_is_explained() {
        assert_eq!(
            VehicleFile::parse("[vehicle]\nwidth = -1.0").unwrap_err(),
            "vehicle.width must be a positive number, got -1"
        );
        assert!(VehicleFile::parse("[vehicle]\nlength = 1.0").unwrap_err().contains("unknown field `length`"));
    }

    /// Reference: independently computed values, to the digits given here.
    #[test]
    fn vehicles_are_derived_from_their_parameters() {
        let of = |values: &'static [(&str, f64)]| {
            move |name: &str| values.iter().find(|(of, _)| *of == name).map(|(_, value)| *value)
        };
        let rescue = of(&[
            ("geometry.cg_to_front_axle", 2.516_666_666_666_667),
            ("geometry.front_to_middle_axle", 2.95),
            ("geometry.middle_to_rear_axle", 1.65),
            ("tire.cornering_stiffness.front", 3e5),
            ("tire.cornering_stiffness.middle", 3e5),
            ("tire.cornering_stiffness.rear", 3e5),
        ]);
        let found = axles(&rescue);
        assert!((OVERHANG - found[2] - 2.933_333).abs() < 1e-6);
        assert!((wheelbase(&found, &rescue).unwrap().0 - 4.316).abs() < 5e-4);
        let heavy = of(&[
            ("geometry.cg_to_front_axle", 3.6),
            ("geometry.cg_to_rear_suspension", 1.425),
            ("geometry.middle_to_rear_axle", 1.35),
        ]);
        let found = axles(&heavy);
        assert!((OVERHANG - found[2] - 2.95).abs() < 1e-9);
        assert!((wheelbase(&found, &heavy).unwrap().0 - 5.39).abs() < 5e-3);
        let car = of(&[("geometry.cg_to_front_axle", 1.1), ("geometry.cg_to_rear_axle", 1.24)]);
        assert!((wheelbase(&axles(&car), &car).unwrap().0 - 2.34).abs() < 1e-12);
    }
}
