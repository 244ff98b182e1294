//! `cargo fmu linearize`: A, B, C, D of a plant at an operating point, and its modes.

use miette::{Result, miette};
use nalgebra::DMatrix;

use crate::eigenvalues::eigenvalues;
use crate::inspect::locate;
use crate::output::outln;
use crate::worker;

/// Which plant, where.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Name of an FMU of this workspace (packed before), or path of any .fmu file with directional derivatives
    fmu: String,
    /// Operating point: a parameter, an input or a state, such as --set driver.speed=9.7; a Boolean is true or false, an
    /// enumeration takes its names; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Prints the matrices and modes as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    workers: worker::Options,
}

/// Prints the linear model and its modes.
///
/// # Errors
/// When the FMU has no states or directional derivatives, or a value cannot be set.
pub(crate) fn run(arguments: &Arguments) -> Result<()> {
    let path = locate(&arguments.fmu)?;
    let settings = arguments.set.iter().map(|setting| parse(setting)).collect::<Result<Vec<_>>>()?;
    let workers = arguments.workers.settings(worker::printed())?;
    let linear = fmu_import::worker::linearize(&workers, &path, &settings).map_err(|message| miette!("{message}"))?;
    let (n, m, p) = (linear.states.len(), linear.inputs.len(), linear.outputs.len());
    let jacobian = DMatrix::from_column_slice(n + p, n + m, &linear.jacobian);
    let part = |at: (usize, usize), size: (usize, usize)| jacobian.view(at, size).into_owned();
    let (a, b) = (part((0, 0), (n, n)), part((0, n), (n, m)));
    let (c, d) = (part((n, 0), (p, n)), part((n, n), (p, m)));
    let poles = eigenvalues(&a).ok_or_else(|| miette!("the eigenvalues of A do not converge"))?;
    if arguments.json {
        let rows =
            |m: &DMatrix<f64>| -> Vec<Vec<f64>> { m.row_iter().map(|row| row.iter().copied().collect()).collect() };
        let poles: Vec<_> = poles.iter().map(|pole| [pole.re, pole.im]).collect();
        let json = serde_json::json!({
            "states": linear.states, "inputs": linear.inputs, "outputs": linear.outputs,
            "A": rows(&a), "B": rows(&b), "C": rows(&c), "D": rows(&d), "poles": poles,
        });
        outln!("{json:#}");
        return Ok(());
    }
    outln!("Poles of A (1/s), frequency (Hz), damping ratio");
    for pole in poles.iter().filter(|pole| pole.im >= 0.0) {
        let size = f64::hypot(pole.re, pole.im);
        let damping = if size > 0.0 { -pole.re / size } else { 1.0 };
        let imaginary = if pole.im > 0.0 { format!(" ± {:.6}i", pole.im) } else { String::new() };
        outln!("  {:>12.6}{imaginary:<16} {:>10.5} {damping:>9.4}", pole.re, size / std::f64::consts::TAU);
    }
    print_matrix("A", &a, &linear.states, &linear.states);
    print_matrix("B", &b, &linear.states, &linear.inputs);
    print_matrix("C", &c, &linear.outputs, &linear.states);
    print_matrix("D", &d, &linear.outputs, &linear.inputs);
    Ok(())
}

fn parse(setting: &str) -> Result<(String, String)> {
    let (name, value) = setting
        .split_once('=')
        .ok_or_else(|| miette!("--set {setting}: expected NAME=VALUE, as in driver.speed=9.7"))?;
    Ok((name.trim().to_owned(), value.trim().to_owned()))
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
