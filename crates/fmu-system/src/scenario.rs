//! A scenario file: its layout, and the checks that need no FMU.

mod check;
mod layout;

pub(crate) use check::{unknown, whole_steps};
pub(crate) use layout::*;

use crate::problem::Collector;

/// Parses the text; `None` if it does not have the layout of a scenario.
pub(crate) fn parse(text: &str, problems: &mut Collector) -> Option<Scenario> {
    match toml::from_str::<Scenario>(text) {
        Ok(scenario) => Some(scenario),
        Err(error) => {
            problems.add_layout(&error);
            None
        }
    }
}
