//! `cargo fmu linearize`: A, B, C, D of a plant at an operating point, and its modes.

use std::path::Path;

use host::description::{Causality, Initial, ModelDescription, Value, Variable};
use host::fmu::Fmu;
use host::loader::Instance;
use host::problem::suggestion;
use miette::{IntoDiagnostic, Result, WrapErr, miette};
use nalgebra::DMatrix;

use crate::inspect::locate;
use crate::output::outln;

/// Which plant, where.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Name of an FMU of this workspace (packed before), or path of any .fmu file with directional derivatives
    fmu: String,
    /// Operating point: a parameter, an input or a state, such as --set driver.speed=9.7; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Prints the matrices and modes as JSON
    #[arg(long)]
    json: bool,
}

/// A linear model x' = A x + B u, y = C x + D u around an operating point.
#[derive(Debug)]
pub(crate) struct Linear {
    /// Names of the states.
    pub(crate) states: Vec<String>,
    /// Names of the inputs.
    pub(crate) inputs: Vec<String>,
    /// Names of the outputs.
    pub(crate) outputs: Vec<String>,
    /// States by states.
    pub(crate) a: DMatrix<f64>,
    /// States by inputs.
    pub(crate) b: DMatrix<f64>,
    /// Outputs by states.
    pub(crate) c: DMatrix<f64>,
    /// Outputs by inputs.
    pub(crate) d: DMatrix<f64>,
}

/// Prints the linear model and its modes.
///
/// # Errors
/// When the FMU has no states or directional derivatives, or a value cannot be set.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let path = locate(&arguments.fmu)?;
    let settings = arguments.set.iter().map(|setting| parse(setting)).collect::<Result<Vec<_>>>()?;
    let linear = linearize(&path, &settings)?;
    let poles =
        control::riccati::eigenvalues(&linear.a).ok_or_else(|| miette!("the eigenvalues of A do not converge"))?;
    if arguments.json {
        let rows =
            |m: &DMatrix<f64>| -> Vec<Vec<f64>> { m.row_iter().map(|row| row.iter().copied().collect()).collect() };
        let poles: Vec<_> = poles.iter().map(|pole| [pole.re, pole.im]).collect();
        let json = serde_json::json!({
            "states": linear.states, "inputs": linear.inputs, "outputs": linear.outputs,
            "A": rows(&linear.a), "B": rows(&linear.b), "C": rows(&linear.c), "D": rows(&linear.d), "poles": poles,
        });
        outln!("{json:#}");
        return Ok(());
    }
    outln!("Poles of A (1/s), frequency (Hz), damping ratio");
    for pole in poles.iter().filter(|pole| pole.im >= 0.0) {
        let size = pole.norm();
        let damping = if size > 0.0 { -pole.re / size } else { 1.0 };
        let imaginary = if pole.im > 0.0 { format!(" ± {:.6}i", pole.im) } else { String::new() };
        outln!("  {:>12.6}{imaginary:<16} {:>10.5} {damping:>9.4}", pole.re, size / std::f64::consts::TAU);
    }
    print_matrix("A", &linear.a, &linear.states, &linear.states);
    print_matrix("B", &linear.b, &linear.states, &linear.inputs);
    print_matrix("C", &linear.c, &linear.outputs, &linear.states);
    print_matrix("D", &linear.d, &linear.outputs, &linear.inputs);
    Ok(())
}

fn parse(setting: &str) -> Result<(String, f64)> {
    let (name, value) = setting
        .split_once('=')
        .ok_or_else(|| miette!("--set {setting}: expected NAME=VALUE, as in driver.speed=9.7"))?;
    let value: f64 = value.trim().parse().map_err(|_| miette!("--set {setting}: '{value}' is not a number"))?;
    Ok((name.trim().to_owned(), value))
}

/// Only nonzero elements, by name: the matrices are large and sparse.
fn print_matrix(title: &str, matrix: &DMatrix<f64>, rows: &[String], columns: &[String]) {
    outln!("\n{title} ({} x {}), elements that are not 0", matrix.nrows(), matrix.ncols());
    for (i, row) in rows.iter().enumerate() {
        let elements: Vec<_> = columns
            .iter()
            .enumerate()
            .filter(|&(j, _)| matrix[(i, j)] != 0.0)
            .map(|(j, column)| format!("{:.8e} {column}", matrix[(i, j)]))
            .collect();
        if !elements.is_empty() {
            outln!("  {row}: {}", elements.join(", "));
        }
    }
}

/// Linearizes the FMU at the start values with these changes.
///
/// # Errors
/// As [`run`].
pub(crate) fn linearize(path: &Path, settings: &[(String, f64)]) -> Result<Linear> {
    let fmu = Fmu::open(path).into_diagnostic()?;
    let description = fmu.description();
    let provides = description.co_simulation.as_ref().is_some_and(|c| c.provides_directional_derivative);
    if !provides || description.derivatives.is_empty() {
        return Err(miette!(
            "{} cannot be linearized: it lists no continuous states with directional derivatives (only plants do)",
            description.model_name
        ));
    }
    let mut instance = fmu.instantiate("linearize").into_diagnostic()?;
    instance.setup_experiment(0.0, None).into_diagnostic()?;
    for (name, value) in settings {
        set(&mut instance, description, name, *value).wrap_err_with(|| format!("--set {name}={value}"))?;
    }
    instance.enter_initialization_mode().into_diagnostic()?;

    let derivatives: Vec<_> =
        description.derivatives.iter().map(|unknown| &description.variables[unknown.variable]).collect();
    let states: Vec<&Variable> = derivatives
        .iter()
        .map(|derivative| {
            derivative
                .derivative_of
                .map(|state| &description.variables[state])
                .ok_or_else(|| miette!("'{}' is listed as a derivative but does not say of what", derivative.name))
        })
        .collect::<Result<_>>()?;
    let real = |causality: Causality| -> Vec<&Variable> {
        let of = |v: &&Variable| v.causality == causality && v.base_type == host::description::BaseType::Real;
        description.variables.iter().filter(of).collect()
    };
    let (inputs, outputs) = (real(Causality::Input), real(Causality::Output));

    let unknown: Vec<_> = derivatives.iter().chain(&outputs).map(|variable| variable.reference).collect();
    let known: Vec<_> = states.iter().chain(&inputs).map(|variable| variable.reference).collect();
    let mut jacobian = DMatrix::zeros(unknown.len(), known.len());
    let mut column = vec![0.0; unknown.len()];
    for (j, &reference) in known.iter().enumerate() {
        instance.get_directional_derivative(&unknown, &[reference], &[1.0], &mut column).into_diagnostic()?;
        jacobian.column_mut(j).copy_from_slice(&column);
    }
    let names = |variables: &[&Variable]| variables.iter().map(|variable| variable.name.clone()).collect();
    let (n, m, p) = (states.len(), inputs.len(), outputs.len());
    Ok(Linear {
        states: names(&states),
        inputs: names(&inputs),
        outputs: names(&outputs),
        a: jacobian.view((0, 0), (n, n)).into_owned(),
        b: jacobian.view((0, n), (n, m)).into_owned(),
        c: jacobian.view((n, 0), (p, n)).into_owned(),
        d: jacobian.view((n, n), (p, m)).into_owned(),
    })
}

fn set(instance: &mut Instance, description: &ModelDescription, name: &str, value: f64) -> Result<()> {
    let variable = description.variable(name).ok_or_else(|| {
        let near = suggestion(name, description.variables.iter().map(|variable| variable.name.as_str()));
        let hint = near.map_or_else(String::new, |near| format!("; {near}"));
        miette!("{} has no variable '{name}'{hint}", description.model_name)
    })?;
    let is_settable = matches!(variable.causality, Causality::Parameter | Causality::Input)
        || variable.initial == Some(Initial::Exact);
    if !is_settable {
        return Err(miette!("'{name}' is neither a parameter, an input nor a state"));
    }
    let references = [variable.reference];
    let result = match &variable.start {
        Some(Value::Integer(_)) => instance.set_integer(&references, &[whole(value)?]),
        Some(Value::Boolean(_)) => instance.set_boolean(&references, &[whole(value)?]),
        Some(Value::Real(_)) => instance.set_real(&references, &[value]),
        _ => return Err(miette!("'{name}' is not a number")),
    };
    result.into_diagnostic()
}

fn whole(value: f64) -> Result<i32> {
    if value.fract() == 0.0 && value.abs() <= f64::from(i32::MAX) {
        #[expect(clippy::cast_possible_truncation, reason = "checked to be whole and in range")]
        return Ok(value as i32);
    }
    Err(miette!("{value} is not a whole number"))
}
