//! `cargo fmu trim`: the steady state of a plant at an operating point.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use fmu_import::archive::read_description;
use fmu_import::description::{ModelDescription, Value};
use fmu_import::parameter_set::{Parameter, ParameterSet};
use fmu_linear::trim::{StateRole, SteadyState};
use fmu_math::eigenvalues;
use miette::{IntoDiagnostic, Result, miette};
use nalgebra::DMatrix;

use crate::inspect::locate;
use crate::linearize::model::zero;
use crate::operating_point::{groups, parse};
use crate::outln;
use crate::worker;

/// Arguments of `cargo fmu trim`.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// Name of a packed FMU of this workspace, or path of any .fmu file with directional derivatives
    fmu: String,
    /// Set a parameter or an input, or hold a state, such as driver.speed=20 or steer.front=0.02; may be repeated
    ///
    /// These values define the operating point, in the units of the FMU. `driver.speed` is also the speed of plants
    /// with pedals.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Free inputs that share one unknown value, such as drive_torque.rl,drive_torque.rr; may be repeated for further
    /// values [default: all `drive_torque.*` of a plant with pedals]
    #[arg(long, value_name = "INPUT[,INPUT…]")]
    free: Vec<String>,
    /// Write the start values of states, and the parameters and inputs, as an SSP 1.0 parameter set
    #[arg(long, value_name = "FILE.ssv")]
    out: Option<PathBuf>,
    /// Print JSON instead of the table
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    workers: worker::Options,
}

/// Prints the steady state, and writes a file.
pub fn run(arguments: &Arguments) -> Result<()> {
    let path = locate(&arguments.fmu)?;
    let settings = arguments.set.iter().map(|setting| parse(setting)).collect::<Result<Vec<_>>>()?;
    if let Some(out) = arguments.out.as_ref().filter(|out| out.extension().is_none_or(|extension| extension != "ssv")) {
        return Err(miette!("--out {}: the name must end in .ssv", out.display()));
    }
    let workers = arguments.workers.settings(worker::to_terminal(), NonZeroUsize::MIN)?;
    let steady = fmu_linear::worker::trim(&workers, &path, &settings, &groups(&arguments.free))
        .map_err(|message| miette!("{message}"))?;
    let description = read_description(&path).into_diagnostic()?;
    let growth = growth(&steady);
    if let Some(out) = &arguments.out {
        crate::files::write_whole(out, ssv(&steady, &description).into_diagnostic()?.as_bytes())?;
    }
    if arguments.json {
        outln!("{:#}", json(&steady, &description, growth));
    } else {
        print(&steady, &description, growth);
    }
    Ok(())
}

/// Largest real part (1/s) of the poles of the states that do not drift. It is 0 if only rounding errors make it
/// differ from 0. `None` if there are no such states, or the eigenvalues do not converge.
fn growth(steady: &SteadyState) -> Option<f64> {
    let n = steady.states.iter().filter(|state| state.role != StateRole::Drifts).count();
    let poles = eigenvalues(&DMatrix::from_column_slice(n, n, &steady.jacobian))?;
    let largest = poles.first()?.re;
    Some(if largest.abs() <= zero(&poles) { 0.0 } else { largest })
}

/// Describes the stability against small deviations.
fn stability(growth: Option<f64>) -> String {
    match growth {
        None => "unknown".to_owned(),
        Some(growth) if growth > 0.0 => format!("not stable, largest real part of a pole {growth:.4} 1/s"),
        Some(0.0) => "limit of stability, a pole is at 0".to_owned(),
        Some(growth) => format!("stable, largest real part of a pole {growth:.4} 1/s"),
    }
}

fn unit<'d>(description: &'d ModelDescription, name: &str) -> Option<&'d str> {
    description.variable(name)?.unit.as_deref().filter(|unit| *unit != "1")
}

fn json(steady: &SteadyState, description: &ModelDescription, growth: Option<f64>) -> serde_json::Value {
    let unit = |name: &str| unit(description, name);
    let states: Vec<_> = steady
        .states
        .iter()
        .map(|state| {
            serde_json::json!({"name": state.name, "value": state.value, "unit": unit(&state.name), "role": state.role})
        })
        .collect();
    let inputs: Vec<_> = steady
        .inputs
        .iter()
        .map(|(name, value)| serde_json::json!({"name": name, "value": value, "unit": unit(name)}))
        .collect();
    let starts: serde_json::Map<_, _> =
        steady.starts.iter().map(|(name, value)| (name.clone(), serde_json::json!(value))).collect();
    serde_json::json!({
        "fmu": description.model_name, "guid": description.guid, "states": states, "inputs": inputs, "starts": starts,
        "residual": steady.residual, "iterations": steady.iterations, "undetermined": steady.undetermined, "growth": growth,
    })
}

fn print(steady: &SteadyState, description: &ModelDescription, growth: Option<f64>) {
    let names = steady.states.iter().map(|state| &state.name).chain(steady.inputs.iter().map(|(name, _)| name));
    let width = names.map(|name| name.chars().count()).max().unwrap_or(0);
    let row = |name: &str, value: f64, what: &str| {
        let line =
            format!("  {name:width$}  {value:>15.8e}  {:8}  {what}", unit(description, name).unwrap_or_default());
        outln!("{}", line.trim_end());
    };
    outln!("Steady state of {}", description.model_name);
    outln!("Stability: {}", stability(growth));
    outln!("Largest derivative: {:.1e} of the nominal value per second\n", steady.residual);
    outln!("States");
    for state in &steady.states {
        let open = steady.undetermined.contains(&state.name);
        let what = match state.role {
            StateRole::Rests if open => "not determined, at its start value",
            StateRole::Rests => "",
            StateRole::Held => "held",
            StateRole::Drifts => "drifts, at its start value",
        };
        row(&state.name, state.value, what);
    }
    if !steady.inputs.is_empty() {
        outln!("\nFree inputs");
        steady.inputs.iter().for_each(|(name, value)| row(name, *value, ""));
    }
}

fn ssv(steady: &SteadyState, description: &ModelDescription) -> std::io::Result<String> {
    let parameter = |(name, value): &(String, _)| Parameter {
        name: name.clone(),
        value: Value::clone(value),
        unit: unit(description, name).map(str::to_owned),
    };
    let name = format!("steady state of {}", description.model_name);
    ParameterSet { name, parameters: steady.starts.iter().map(parameter).collect() }.to_xml(&description.units)
}
