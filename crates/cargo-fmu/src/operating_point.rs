//! Options that define an operating point: `--set` and `--free`.

use miette::{Result, miette};

pub(crate) fn parse(setting: &str) -> Result<(String, String)> {
    let (name, value) = setting
        .split_once('=')
        .ok_or_else(|| miette!("--set {setting}: expected NAME=VALUE, as in driver.speed=9.7"))?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
}

/// Splits each text into the names of a group of inputs, which are separated by commas.
pub(crate) fn groups(free: &[String]) -> Vec<Vec<String>> {
    free.iter().map(|names| names.split(',').map(|name| name.trim().to_owned()).collect()).collect()
}
