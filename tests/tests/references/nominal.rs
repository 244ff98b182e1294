//! Nominal values have the order of magnitude of the signals in the reference data.

use crate::table::Table;
use fmu_import::description::{BaseType, Causality};
use std::collections::{BTreeMap, BTreeSet};
use tests::all;

/// Largest factor between a nominal value and a peak. The same value applies to vehicles from 1.2 t to 36 t, whose
/// forces differ from their geometric mean by a factor of 5; gentle and violent maneuvers add another factor of 5.
const FACTOR: f64 = 25.0;

/// Smaller peaks are not compared, because the signal is zero in the data.
const FLOOR: f64 = 1e-9;

/// Nominal values by name; the default is 1.
fn nominal_values() -> BTreeMap<String, f64> {
    let mut values = BTreeMap::new();
    for fmu in all() {
        for variable in &fmu.description.variables {
            let is_signal = matches!(variable.causality, Causality::Input | Causality::Output);
            if variable.base_type == BaseType::Real && is_signal {
                let nominal = variable.nominal.unwrap_or(1.0);
                let known = *values.entry(variable.name.clone()).or_insert(nominal);
                assert_eq!(known, nominal, "{}: another nominal value of {}", fmu.name, variable.name);
            }
        }
    }
    values
}

/// Name of a signal without the position of its wheel or axle.
fn family(name: &str) -> &str {
    const PLACES: [&str; 11] = ["fl", "fr", "ml", "mr", "rl", "rr", "l", "r", "front", "middle", "rear"];
    name.rsplit_once('.').filter(|(_, place)| PLACES.contains(place)).map_or(name, |(signal, _)| signal)
}

/// The largest magnitudes of the signals in the files for a vehicle.
fn peaks(vehicle: &str) -> BTreeMap<String, f64> {
    let mut peaks = BTreeMap::<String, f64>::new();
    let folder = tests::workspace().join("tests/references").join(vehicle);
    for entry in std::fs::read_dir(&folder).expect("reference data") {
        let path = entry.expect("reference data").path();
        let name = path.file_name().and_then(|name| name.to_str()).expect("names are UTF-8");
        let Some(name) = name.strip_suffix(".csv.gz") else { continue };
        let table = Table::read(&format!("{vehicle}/{name}"));
        for (column, name) in table.names.iter().enumerate() {
            let peak = peaks.entry(name.clone()).or_default();
            // Missing cells are NaN, which `max` ignores.
            *peak = table.rows.iter().fold(*peak, |peak, row| peak.max(row[column].abs()));
        }
    }
    peaks
}

#[test]
fn nominal_values_are_of_the_magnitude_of_the_reference_data() {
    let nominal = nominal_values();
    let mut compared = BTreeSet::new();
    let mut wrong = Vec::new();
    for vehicle in ["rescue_vehicle", "heavy_vehicle", "esp_car", "hydro_pneumatic", "driving"] {
        // The peak is the largest value of all wheels, because only one wheel moves in some files.
        let mut families = BTreeMap::<&str, f64>::new();
        let peaks = peaks(vehicle);
        for (name, peak) in peaks.iter().filter(|(name, _)| nominal.contains_key(*name)) {
            let largest = families.entry(family(name)).or_default();
            *largest = largest.max(*peak);
        }
        for (signal, peak) in families.into_iter().filter(|(_, peak)| *peak > FLOOR) {
            let member = nominal.iter().find(|(name, _)| family(name) == signal);
            let nominal = *member.expect("a signal of the FMUs").1;
            compared.insert(signal.to_owned());
            if !(nominal / FACTOR..=nominal * FACTOR).contains(&peak) {
                wrong.push(format!("{signal} = {nominal}: the peak of {vehicle} is {peak}"));
            }
        }
    }
    assert!(wrong.is_empty(), "nominal values are not within a factor {FACTOR}:\n{}", wrong.join("\n"));
    // There are no reference data for the distance of a road, for states that are not signals, and for signals of any
    // magnitude.
    let missing: BTreeSet<_> =
        nominal.keys().map(|name| family(name)).filter(|signal| !compared.contains(*signal)).collect();
    let expected =
        ["actuator.command", "actuator.value", "road.distance", "sensor.measured_value", "sensor.true_value"];
    assert_eq!(missing, BTreeSet::from(expected));
}

/// A nominal value is 1, 2 or 5 times a power of ten: it states a magnitude, not a measurement.
#[test]
fn nominal_values_are_round() {
    for (name, nominal) in nominal_values() {
        let mantissa = nominal / 10.0_f64.powf(nominal.log10().floor());
        let is_round = [1.0, 2.0, 5.0, 10.0].iter().any(|round| (mantissa - round).abs() < 1e-9);
        assert!(is_round, "{name}: {nominal}");
    }
}

/// Solvers scale the error of a state by its nominal value, which is 1 if it is not declared.
#[test]
fn every_continuous_state_has_a_nominal_value() {
    let mut states = 0;
    for fmu in all() {
        for state in fmu.states() {
            assert!(state.nominal.is_some(), "{}: the state {} has no nominal value", fmu.name, state.name);
            states += 1;
        }
    }
    // RescueVehicle alone has 23 states.
    assert!(states > 23, "{states} states in all FMUs");
}
