//! `cargo fmu linearize`: A, B, C, D of a plant at an operating point, and its modes.

mod files;
pub(crate) mod model;
mod page;
mod page_data;
mod picture;

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

use fmu_import::archive::read_description;
use miette::{IntoDiagnostic, Result, miette};
use nalgebra::DMatrix;

use self::model::{LinearModel, Mode, Signal};
use crate::files::write_whole;
use crate::inspect::locate;
use crate::operating_point::{groups, parse};
use crate::output;
use crate::worker;
use crate::{errln, outln};

/// Arguments of `cargo fmu linearize`.
#[derive(clap::Args, Debug)]
pub struct Arguments {
    /// Name of a packed FMU of this workspace, or path of any .fmu file with directional derivatives or model exchange
    fmu: String,
    /// Set a parameter, an input or a state, such as driver.speed=9.7; may be repeated
    ///
    /// These values define the operating point, in the units of the FMU. A Boolean is true or false; an enumeration
    /// takes the names of its values.
    #[arg(long = "set", value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// Linearize at the steady state of this operating point, found as by `cargo fmu trim`
    #[arg(long)]
    trim: bool,
    /// Free inputs that share one unknown value, such as drive_torque.rl,drive_torque.rr; may be repeated for further
    /// values [default: all `drive_torque.*` of a plant with pedals]
    ///
    /// Only with `--trim`.
    #[arg(long, value_name = "INPUT[,INPUT…]", requires = "trim")]
    free: Vec<String>,
    /// Also write the linear model to this file, whose extension selects the format; may be repeated
    ///
    /// .json contains everything, .csv one matrix [A B; C D] with names, .mat is for MATLAB, Octave and SciPy, and
    /// .html is a page with poles and Bode plots.
    #[arg(long, value_name = "FILE")]
    out: Vec<PathBuf>,
    /// Add a Bode plot from an input to an output to the page; may be repeated [default: the first three connected
    /// pairs]
    ///
    /// Only with `--out FILE.html`.
    #[arg(long, value_name = "INPUT:OUTPUT", requires = "out")]
    bode: Vec<String>,
    /// Also print the nonzero elements of A, B, C and D
    #[arg(long)]
    matrices: bool,
    /// Print JSON instead of the table
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    workers: worker::Options,
}

impl Arguments {
    fn command(&self) -> String {
        let mut words = vec!["cargo".to_owned(), "fmu".to_owned(), "linearize".to_owned(), self.fmu.clone()];
        let mut add = |option: &str, value: &str| words.extend([option.to_owned(), value.to_owned()]);
        self.set.iter().for_each(|setting| add("--set", setting));
        self.free.iter().for_each(|inputs| add("--free", inputs));
        self.bode.iter().for_each(|pair| add("--bode", pair));
        self.out.iter().for_each(|file| add("--out", &file.display().to_string()));
        for (option, value) in self.workers.given() {
            words.extend([option.to_owned()].into_iter().chain(value));
        }
        let flags = [("--trim", self.trim), ("--matrices", self.matrices), ("--json", self.json)];
        words.extend(flags.into_iter().filter(|(_, is_given)| *is_given).map(|(flag, _)| flag.to_owned()));
        words.iter().map(|word| output::quoted(word)).collect::<Vec<_>>().join(" ")
    }
}

/// Extension of a file, which selects its format.
fn format(path: &Path) -> Result<&str> {
    let extension = path.extension().and_then(|extension| extension.to_str());
    extension
        .filter(|extension| ["json", "csv", "mat", "html"].contains(extension))
        .ok_or_else(|| miette!("--out {}: expected a name that ends in .json, .csv, .mat or .html", path.display()))
}

/// Prints the modes of the linear model, and writes files.
pub fn run(arguments: &Arguments) -> Result<()> {
    let path = locate(&arguments.fmu)?;
    let settings = arguments.set.iter().map(|setting| parse(setting)).collect::<Result<Vec<_>>>()?;
    let formats = arguments.out.iter().map(|path| format(path)).collect::<Result<Vec<_>>>()?;
    let workers = arguments.workers.settings(worker::to_terminal(), NonZeroUsize::MIN)?;
    let settings = if arguments.trim {
        let free = groups(&arguments.free);
        let steady =
            fmu_linear::worker::trim(&workers, &path, &settings, &free).map_err(|message| miette!("{message}"))?;
        steady.settings()
    } else {
        settings
    };
    let linear = fmu_linear::worker::linearize(&workers, &path, &settings).map_err(|message| miette!("{message}"))?;
    if linear.by_differences {
        errln!("note: the FMU has no directional derivatives; the matrices are computed by central differences");
    }
    let description = read_description(&path).into_diagnostic()?;
    let file = std::fs::read(&path).into_diagnostic()?;
    let model = LinearModel::new(&description, &file, &settings, linear)
        .ok_or_else(|| miette!("the eigenvalues of A do not converge"))?;
    let pairs = page::pairs(&model, &arguments.bode)?;
    for (path, format) in arguments.out.iter().zip(formats) {
        let bytes = match format {
            "json" => format!("{:#}\n", files::json(&model)).into_bytes(),
            "csv" => files::csv(&model).into_bytes(),
            "mat" => files::mat(&model),
            _ => page::page(&model, &pairs, &arguments.command())?.into_bytes(),
        };
        write_whole(path, &bytes)?;
    }
    if arguments.json {
        outln!("{:#}", files::json(&model));
        return Ok(());
    }
    print_modes(&model, arguments.trim);
    if arguments.matrices {
        print_matrix("A", "derivative of", &model.a, &model.states, &model.states);
        print_matrix("B", "derivative of", &model.b, &model.states, &model.inputs);
        print_matrix("C", "", &model.c, &model.outputs, &model.states);
        print_matrix("D", "", &model.d, &model.outputs, &model.inputs);
    } else if arguments.out.is_empty() {
        outln!("\n--matrices prints A, B, C and D; --out FILE writes them as .json, .csv or .mat, or a page as .html.");
    }
    Ok(())
}

fn print_modes(model: &LinearModel, trimmed: bool) {
    let settings: Vec<String> = model.settings.iter().map(|(name, value)| format!("{name} = {value}")).collect();
    let point = if trimmed {
        "a steady state".to_owned()
    } else if settings.is_empty() {
        "its start values".to_owned()
    } else {
        settings.join(", ")
    };
    outln!("{} at {point}", model.fmu);
    outln!("{} states, {} inputs, {} outputs", model.states.len(), model.inputs.len(), model.outputs.len());
    outln!("Stability: {}\n", model.stability());
    outln!("{:>26}  {:>14}  {:>8}  {:>13}", "Pole (1/s)", "Frequency (Hz)", "Damping", "Time const. (s)");
    for Mode { real, imaginary, frequency, damping, time_constant } in model.modes() {
        let pole = if imaginary > 0.0 { format!("{real:.5} ± {imaginary:.5}i") } else { format!("{real:.5}") };
        let text = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), |value| format!("{value:.5}"));
        outln!("{pole:>26}  {frequency:>14.5}  {:>8}  {:>15}", text(damping), text(time_constant));
    }
}

/// Prints the elements that are not 0 with their names, because the matrices are large and sparse.
fn print_matrix(title: &str, of: &str, matrix: &DMatrix<f64>, rows: &[Signal], columns: &[Signal]) {
    outln!("\n{title} ({} x {})", matrix.nrows(), matrix.ncols());
    for (i, row) in rows.iter().enumerate() {
        let elements: Vec<(usize, f64)> =
            (0..columns.len()).map(|j| (j, matrix[(i, j)])).filter(|(_, value)| *value != 0.0).collect();
        if elements.is_empty() {
            continue;
        }
        let head = format!("{of} {}", row.name);
        outln!("  {}", head.trim_start());
        for (j, value) in elements {
            outln!("    {value:>15.8e}  {}", columns[j].name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mass of 2 kg on a spring of 200 N/m with a damper of 4 N s/m, and the integral of its position: natural
    /// frequency 10 rad/s, damping ratio 0.1.
    pub(super) fn oscillator() -> LinearModel {
        let description =
            fmu_import::description::ModelDescription::parse(include_str!("../../fmu-import/tests/data/decay2.xml"))
                .unwrap();
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        // Columns: s, v, the integral of s, f. Rows: s', v', the derivative of the integral (s), the output (s).
        let rows = [[0.0, 1.0, 0.0, 0.0], [-100.0, -2.0, 0.0, 0.5], [1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]];
        let jacobian = (0..4).flat_map(|column| rows.iter().map(move |row| row[column])).collect();
        let linear = fmu_linear::linearize::Linear {
            states: names(&["s", "v", "integral"]),
            inputs: names(&["f"]),
            outputs: names(&["y"]),
            jacobian,
            by_differences: false,
        };
        LinearModel::new(&description, b"abc", &[("k".to_owned(), "200".to_owned())], linear).unwrap()
    }
    use clap::Parser;

    #[derive(Parser)]
    struct Command {
        #[command(flatten)]
        arguments: Arguments,
    }

    /// Split by POSIX rules, the command gives the original arguments, even with quotes and spaces.
    #[test]
    fn the_command_is_complete_and_quoted() {
        let given = [
            "it's my.fmu",
            "--set",
            "table.file=a b$c",
            "--set",
            "x=1",
            "--free",
            "a,b",
            "--bode",
            "u:y",
            "--out",
            "my page.html",
            "--timeout",
            "7.5",
            "--libpython",
            "lib python.so",
            "--trim",
            "--matrices",
            "--json",
        ];
        let command = Command::try_parse_from(["linearize"].iter().chain(&given)).unwrap().arguments.command();
        let expected = r#"cargo fmu linearize 'it'"'"'s my.fmu' --set 'table.file=a b$c' --set x=1 --free a,b --bode u:y --out 'my page.html' --timeout 7.5 --libpython 'lib python.so' --trim --matrices --json"#;
        assert_eq!(command, expected);
        let short = Command::try_parse_from(["linearize", "EspCar"]).unwrap().arguments.command();
        assert_eq!(short, "cargo fmu linearize EspCar");
    }
}
