//! Which FMUs of the library fit which plants by their signals: the combinations in the papers, and FMUs that can or
//! cannot be swapped between vehicles.

use fmu_system::compat::{Fit, Missing, Reason, Systems, systems};
use fmu_system::resolve::{Descriptions, FmuFolder};

fn library() -> Systems {
    let folder = FmuFolder::new([tests::folder()]);
    let found = folder.names().into_iter().map(|name| {
        let fmu = folder.find(&name).unwrap_or_else(|error| panic!("{name}: {error}"));
        (name, fmu.expect("it was listed").description)
    });
    systems(&found.collect())
}

fn fit<'a>(systems: &'a Systems, component: &str, plant: &str) -> &'a Fit {
    let place = |names: &[String], name: &str| {
        names.iter().position(|other| other == name).unwrap_or_else(|| panic!("{name} is not in {names:?}"))
    };
    &systems.fits[place(&systems.components, component)][place(&systems.plants, plant)]
}

#[test]
fn plants_are_the_vehicles() {
    // BrakeAndDriveActuators also has states, but belongs to the car; Actuator has states, but shares no signal with
    // another FMU.
    assert_eq!(library().plants, ["BicycleCar", "EspCar", "HeavyVehicle", "HydroPneumaticHalfCar", "RescueVehicle"]);
}

#[test]
fn the_systems_of_the_papers_fit() {
    let systems = library();
    let papers: [(&str, &[&str]); 4] = [
        (
            "RescueVehicle",
            &[
                "DualSlidingModeSteering",
                "IntegratedLqrSuspension",
                "RollLqrSuspension",
                "FuzzyCoordination",
                "SuspensionMixer",
            ],
        ),
        ("HydroPneumaticHalfCar", &["ComfortSlidingMode", "HandlingSlidingMode", "SuspensionSwitch"]),
        (
            "EspCar",
            &[
                "BrakeAndDriveActuators",
                "SemiActivePidSuspension",
                "AntilockBraking",
                "DirectYawControl",
                "FiniteStateCoordination",
            ],
        ),
        ("HeavyVehicle", &["YawRateReference", "ActiveFrontSteering", "AllWheelSteering", "SemiActiveFuzzySuspension"]),
    ];
    for (plant, components) in papers {
        for component in components.iter().chain(&["Driver", "PathDriver", "Road"]) {
            assert_eq!(*fit(&systems, component, plant), Fit::Fits, "{component}, {plant}");
        }
    }
}

#[test]
fn steering_laws_fit_the_other_three_axle_vehicle() {
    let systems = library();
    for component in
        ["DualSlidingModeSteering", "FuzzyCoordination", "YawRateReference", "ActiveFrontSteering", "AllWheelSteering"]
    {
        for plant in ["RescueVehicle", "HeavyVehicle"] {
            assert_eq!(*fit(&systems, component, plant), Fit::Fits, "{component}, {plant}");
        }
    }
    // The car has no second steered axle.
    assert_eq!(*fit(&systems, "AllWheelSteering", "EspCar"), Fit::Idle);
}

#[test]
fn what_does_not_fit_is_named() {
    let systems = library();
    let Fit::Lacks(missing) = fit(&systems, "SuspensionSwitch", "RescueVehicle") else {
        panic!("the half car's switch has nothing to switch on the rescue vehicle");
    };
    let half_car = Missing {
        input: "vehicle.load_transfer_estimate".to_string(),
        unit: Some("1".to_string()),
        reason: Reason::OtherPlants(vec!["HydroPneumaticHalfCar".to_string()]),
    };
    assert!(missing.contains(&half_car), "{missing:?}");
    for (law, side) in [("ComfortSlidingMode", "comfort_force.l"), ("HandlingSlidingMode", "handling_force.r")] {
        let force = missing.iter().find(|missing| missing.input == side).expect(side);
        assert_eq!(force.reason, Reason::Unsupplied(vec![law.to_string()]));
    }
    assert_eq!(missing.len(), 5);
}

/// Sensor and actuator fit no plant by name; explicit connections insert them into any signal.
#[test]
fn sensor_and_actuator_fit_no_plant_by_name() {
    let systems = library();
    for (component, input) in [("Sensor", "sensor.true_value"), ("Actuator", "actuator.command")] {
        for plant in &systems.plants {
            let missing = Missing { input: input.to_string(), unit: None, reason: Reason::Unknown };
            assert_eq!(*fit(&systems, component, plant), Fit::Lacks(vec![missing]), "{component}, {plant}");
        }
    }
}
