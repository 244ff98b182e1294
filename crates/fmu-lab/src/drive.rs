//! The visitor drives: steering and pedals on the page replace the signals of the driver model.

use crate::requests::{Adjustable, Display, Driving};
use fmu_system::plan::{Origin, Plan};
use std::collections::BTreeMap;

/// Acceleration at full throttle and deceleration at full braking, m/s2, for a plant with prescribed speed.
const ACCELERATION: f64 = 2.5;
const DECELERATION: f64 = 6.0;

pub(crate) type Input = (String, String);

/// A driver whose outputs the visitor replaces.
#[derive(Debug, Clone)]
pub(crate) struct Driver {
    pub(crate) component: String,
    /// The inputs that read each output of the driver.
    readers: BTreeMap<String, Vec<Input>>,
    /// Front steering angle at full lock, rad.
    largest_steer: f64,
    /// Speed of a plant with prescribed speed, m/s.
    pub(crate) speed: f64,
    /// `None` while the visitor does not drive.
    pub(crate) driving: Option<Driving>,
}

/// The signal with the prescribed speed.
pub(crate) const SPEED: &str = "driver.speed";

/// Outputs of a driver that the visitor replaces.
const SIGNALS: [&str; 4] = ["driver.steer", SPEED, "driver.throttle", "driver.brake"];

impl Driver {
    pub(crate) fn new(component: &str, plan: &Plan, largest_steer: f64, speed: f64) -> Self {
        let mut readers: BTreeMap<String, Vec<Input>> = BTreeMap::new();
        for connected in plan.wiring.iter().take(1).flat_map(|wiring| &wiring.inputs) {
            let Origin::Output(signal) = &connected.source else { continue };
            if signal.component == component && SIGNALS.contains(&signal.variable.as_str()) {
                let input = (connected.input.component.clone(), connected.input.variable.clone());
                readers.entry(signal.variable.clone()).or_default().push(input);
            }
        }
        Self { component: component.to_owned(), readers, largest_steer, speed, driving: None }
    }

    pub(crate) fn all_readers(&self) -> impl Iterator<Item = &Input> {
        self.readers.values().flatten()
    }

    pub(crate) fn readers(&self, signal: &str) -> &[Input] {
        self.readers.get(signal).map_or(&[], Vec::as_slice)
    }

    /// Values of the signals for a step of this length, s.
    pub(crate) fn step(&mut self, step: f64) -> Vec<(&'static str, f64)> {
        let Some(driving) = self.driving else { return Vec::new() };
        let change = ACCELERATION * driving.throttle - DECELERATION * driving.brake;
        // The speed stays positive, because plants with prescribed speed have equations that divide by it.
        self.speed = (self.speed + change * step).max(1.0);
        SIGNALS.into_iter().filter_map(|signal| Some((signal, self.value(signal)?))).collect()
    }

    /// The value that replaces an output; `None` while the visitor does not drive.
    pub(crate) fn value(&self, signal: &str) -> Option<f64> {
        let driving = self.driving?;
        match signal {
            "driver.steer" => Some(driving.steer * self.largest_steer),
            SPEED => Some(self.speed),
            "driver.throttle" => Some(driving.throttle),
            "driver.brake" => Some(driving.brake),
            _ => None,
        }
    }

    /// The slider for the speed; `None` if nothing reads the speed.
    pub(crate) fn slider(&self) -> Option<Adjustable> {
        self.readers.contains_key(SPEED).then(|| Adjustable {
            id: format!("{}:{SPEED}", self.component),
            title: "Speed".to_owned(),
            unit: "m/s".to_owned(),
            min: 1.0,
            max: 40.0,
            value: self.speed,
            display: Display::new("km/h", 3.6),
        })
    }
}
