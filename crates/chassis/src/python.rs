//! The Python package `chassis_fmu`, which makes tables and pages and runs scenarios through FMPy.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use cargo_fmu::output::quoted;
use miette::{IntoDiagnostic as _, Result, WrapErr as _, miette};

/// Environment variable with the Python that has the package; the package's command sets it.
const VARIABLE: &str = "CHASSIS_PYTHON";

const HELP: &str =
    "Install the wheel of the package `chassis-fmu`, or call the command inside the repository after `scripts/setup`.";

pub(crate) struct Python {
    program: PathBuf,
}

impl Python {
    /// The Python that called this program, or the Python of the repository that this program was built in.
    pub(crate) fn find() -> Option<Self> {
        let given = std::env::var_os(VARIABLE).map(PathBuf::from);
        let program = given.or_else(|| {
            let place = if cfg!(windows) { ".venv/Scripts/python.exe" } else { ".venv/bin/python" };
            Some(root()?.join(place))
        })?;
        program.is_file().then_some(Self { program })
    }

    /// Like [`Self::find`]. If there is no Python, prints a note that no page is written.
    pub(crate) fn find_or_note() -> Option<Self> {
        let found = Self::find();
        if found.is_none() {
            cargo_fmu::errln!("note: no page is written, because pages need the Python package `chassis_fmu`. {HELP}");
        }
        found
    }

    pub(crate) fn required(purpose: &str) -> Result<Self> {
        Self::find().ok_or_else(|| miette!(help = HELP, "{purpose} needs the Python package `chassis_fmu`"))
    }

    /// Runs a module of the package with arguments, and with text on its standard input; returns the exit code.
    pub(crate) fn call(&self, module: &str, arguments: &[String], input: Option<&str>) -> Result<i32> {
        let starting = || format!("starting {}", self.program.display());
        let mut command = Command::new(&self.program);
        // PYTHONHOME is for FMUs; a virtual environment finds its packages without it.
        command.env_remove("PYTHONHOME").args(["-m", &format!("chassis_fmu.{module}")]).args(arguments);
        command.stdin(if input.is_some() { Stdio::piped() } else { Stdio::inherit() });
        let mut child = command.spawn().into_diagnostic().wrap_err_with(starting)?;
        if let (Some(text), Some(mut pipe)) = (input, child.stdin.take()) {
            // If Python ends early, it has printed the reason.
            let _ = pipe.write_all(text.as_bytes());
        }
        let status = child.wait().into_diagnostic().wrap_err_with(starting)?;
        // A process that a signal ended has no exit code.
        Ok(status.code().unwrap_or(1))
    }
}

pub(crate) const FMPY: &str = "fmpy";

/// Serves the process that started this one as a worker in Python.
pub(crate) fn serve_fmpy(board: &Path) -> std::io::Result<()> {
    let python =
        Python::find().ok_or_else(|| std::io::Error::other("there is no Python with the package `chassis_fmu`"))?;
    let mut command = Command::new(python.program);
    command.env_remove("PYTHONHOME").args(["-m", "chassis_fmu.execution"]);
    fmu_import::worker::hand_over(board, command)
}

pub(crate) fn exit(code: i32) -> ! {
    fmu_import::temporary::remove();
    std::process::exit(code)
}

/// The command line of this call, without the given flags. Paths in the repository that this program was built in are
/// relative to its top.
pub(crate) fn command_without(options: &[&str]) -> String {
    let arguments = std::env::args().skip(1).filter(|argument| !options.contains(&argument.as_str()));
    ["chassis".to_owned()].into_iter().chain(arguments.map(|argument| named(&argument))).collect::<Vec<_>>().join(" ")
}

/// An argument of a command; a path in the repository that this program was built in becomes relative to its top.
pub(crate) fn named(argument: &str) -> String {
    let here = std::env::current_dir().unwrap_or_default();
    let root = root().filter(|root| *root != here);
    let path = here.join(argument);
    let inside = root.as_ref().filter(|_| path.exists());
    quoted(&inside.map_or(argument.to_owned(), |root| path.strip_prefix(root).unwrap_or(&path).display().to_string()))
}

/// The repository that this program was built in.
pub(crate) fn root() -> Option<PathBuf> {
    let own = std::env::current_exe().ok()?;
    own.ancestors().find(|folder| folder.join("python/chassis_fmu").is_dir()).map(Path::to_path_buf)
}
