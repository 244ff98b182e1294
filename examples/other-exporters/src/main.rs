//! Measures FMUs of the quarter car and the bouncing ball: the time of a communication step (set the inputs, step, get
//! the outputs), compared with a Rust function, and the largest error in a run. `scripts/bench exporters` calls it.

mod bouncing_ball;
mod quarter_car;

use std::hint::black_box;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use fmu_import::description::ModelDescription;
use fmu_import::fmu::{Fmu, FmuError};

/// Communication steps per measurement.
const STEPS: usize = 200_000;
/// Number of measurements; their median is reported.
const ROUNDS: usize = 7;

/// One of the two models. A run has a communication step for each row of `inputs`.
struct Model {
    /// Communication step (s).
    step: f64,
    input_names: &'static [&'static str],
    output_names: &'static [&'static str],
    /// Inputs at the beginning of each step.
    inputs: Vec<Vec<f64>>,
    /// Exact outputs after each step.
    exact: Vec<Vec<f64>>,
    function: fn(&[Vec<f64>]),
}

impl Model {
    fn of(description: &ModelDescription) -> Option<Self> {
        let has = |name: &str| description.variables.iter().any(|variable| variable.name == name);
        let models = [quarter_car::model(), bouncing_ball::model(&["h"]), bouncing_ball::model(&["height"])];
        models.into_iter().find(|model| model.input_names.iter().chain(model.output_names).all(|name| has(name)))
    }

    fn runs(&self) -> usize {
        STEPS / self.inputs.len()
    }

    /// Time of a step of the Rust function, ns.
    fn time_function(&self) -> f64 {
        let begin = Instant::now();
        for _ in 0..self.runs() {
            (self.function)(black_box(&self.inputs));
        }
        begin.elapsed().as_secs_f64() * 1e9 / (self.runs() * self.inputs.len()) as f64
    }

    /// Runs a new instance. Returns the time to the first step and the time of all steps, s. `after` gets the outputs
    /// of each step.
    fn run(&self, fmu: &Fmu, mut after: impl FnMut(usize, &[f64])) -> Result<(f64, f64), FmuError> {
        let reference = |name: &&str| {
            let variable = fmu.description().variables.iter().find(|variable| variable.name == **name);
            variable.unwrap_or_else(|| unreachable!("the model has {name}")).reference
        };
        let inputs: Vec<_> = self.input_names.iter().map(reference).collect();
        let outputs: Vec<_> = self.output_names.iter().map(reference).collect();
        let mut y = vec![0.0; outputs.len()];
        let begin = Instant::now();
        let mut instance = fmu.instantiate("bench")?;
        instance.setup_experiment(0.0, None)?;
        instance.enter_initialization_mode()?;
        instance.exit_initialization_mode()?;
        let start = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        for (k, u) in self.inputs.iter().enumerate() {
            if !inputs.is_empty() {
                instance.set_real(&inputs, u)?;
            }
            instance.do_step(k as f64 * self.step, self.step)?;
            instance.get_real(&outputs, &mut y)?;
            after(k, &y);
        }
        Ok((start, begin.elapsed().as_secs_f64()))
    }

    /// Largest error of an output in a run, relative to the peak of this output.
    fn error(&self, fmu: &Fmu) -> Result<f64, FmuError> {
        let mut errors = vec![0.0; self.output_names.len()];
        self.run(fmu, |k, y| {
            for (error, (y, exact)) in errors.iter_mut().zip(y.iter().zip(&self.exact[k])) {
                // Unlike `max`, this does not drop a NaN.
                let now = (y - exact).abs();
                *error = if now <= *error { *error } else { now };
            }
        })?;
        let peak = |i: usize| self.exact.iter().map(|y| y[i].abs()).fold(0.0, f64::max);
        Ok(errors.iter().enumerate().map(|(i, error)| error / peak(i)).fold(0.0, |a, b| if b <= a { a } else { b }))
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn measure(path: &Path) -> Result<String, String> {
    let fmu = Fmu::open(path).map_err(|error| error.to_string())?;
    let model = Model::of(fmu.description()).ok_or("neither a quarter car nor a bouncing ball")?;
    let error = model.error(&fmu).map_err(|error| error.to_string())?;
    // The measurements alternate, so disturbances affect both equally.
    let (mut function, mut steps, mut starts) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..ROUNDS {
        function.push(model.time_function());
        let mut seconds = 0.0;
        for _ in 0..model.runs() {
            let (start, run) = model.run(&fmu, |_, y| _ = black_box(y)).map_err(|error| error.to_string())?;
            starts.push(start * 1e6);
            seconds += run;
        }
        steps.push(seconds * 1e9 / (model.runs() * model.inputs.len()) as f64);
    }
    let (step, function, start) = (median(steps), median(function), median(starts));
    Ok(format!("{step:10.1} {function:11.1} {start:9.1} {error:10.2e}  {}", path.display()))
}

fn main() -> ExitCode {
    println!("{:>10} {:>11} {:>9} {:>10}", "step, ns", "function, ns", "start, µs", "error");
    let mut code = ExitCode::SUCCESS;
    for path in std::env::args_os().skip(1) {
        match measure(Path::new(&path)) {
            Ok(line) => println!("{line}"),
            Err(error) => {
                eprintln!("error: {}: {error}", Path::new(&path).display());
                code = ExitCode::FAILURE;
            }
        }
    }
    code
}
