//! `components`: time of a component step in the master and beyond the FMU's own, in chains of 10 to 100 actuators.
//!
//! The FMU's own time is that of the same calls (set the input, step, get the output) in a loop over the instances. Both
//! alternate, and the fastest of many rounds is reported, because other processes disturb it least.

use fmu_import::fmu::Fmu;
use fmu_system::fmus::Fmus;
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use fmu_system::session::Session;
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

const FMU: &str = "Actuator";
const INPUT: &str = "actuator.command";
const OUTPUT: &str = "actuator.value";
/// Communication step in s.
const STEP: f64 = 0.001;
/// Numbers of components.
const SIZES: [usize; 4] = [10, 20, 50, 100];
const ROUNDS: usize = 40;
/// Component steps in a round.
const COMPONENT_STEPS: usize = 200_000;

/// A chain of components, of which the first has a constant input.
fn scenario(components: usize, steps: usize) -> String {
    let stop = steps as f64 * STEP;
    let mut text =
        format!("title = 'Chain'\nconnect_by_name = false\nsimulation = {{ stop = {stop}, step = {STEP} }}\n");
    for i in 0..components {
        let input = if i == 0 { format!("inputs = {{ '{INPUT}' = 1.0 }}\n") } else { String::new() };
        let _ = write!(text, "[[component]]\nname = 'c{i}'\nfmu = '{FMU}'\n{input}");
    }
    for i in 1..components {
        let _ = write!(text, "[[connection]]\nfrom = 'c{}:{OUTPUT}'\nto = 'c{i}:{INPUT}'\n", i - 1);
    }
    text + "[[case]]\nname = 'only'\ntitle = 'Only'\n[record]\nsignals = ['c0:" + OUTPUT + "']\n"
}

/// Times of a component step in ns: in the master, and the calls alone.
fn measure(components: usize) -> Result<[f64; 2], Box<dyn std::error::Error>> {
    let steps = COMPONENT_STEPS / components;
    let folder = FmuFolder::new([tests::folder()]);
    let plan = resolve_text(Path::new("chain.toml"), &scenario(components, steps), &folder, &Options::default())?;
    let fmus = Fmus::load(&plan.runs)?;
    let fmu = Fmu::open(tests::folder().join(format!("{FMU}.fmu")))?;
    let reference = |name| fmu.description().variable(name).map(|variable| [variable.reference]).ok_or(name);
    let (input, output) = (reference(INPUT)?, reference(OUTPUT)?);
    let mut session = Session::new(&plan.simulation, &plan.runs[0], &fmus)?;
    let begin = Instant::now();
    while !session.is_over() {
        session.step()?;
    }
    let master = begin.elapsed();
    black_box(session.bus());

    let mut chain = Vec::new();
    for _ in 0..components {
        let mut instance = fmu.instantiate("chain")?;
        instance.setup_experiment(0.0, Some(steps as f64 * STEP))?;
        instance.enter_initialization_mode()?;
        instance.exit_initialization_mode()?;
        chain.push(instance);
    }
    let begin = Instant::now();
    for step in 0..steps {
        let mut value = [1.0];
        for instance in &mut chain {
            instance.set_real(&input, &value)?;
            instance.do_step(step as f64 * STEP, STEP)?;
            instance.get_real(&output, &mut value)?;
        }
        black_box(value);
    }
    let alone = begin.elapsed();
    Ok([master, alone].map(|time| time.as_secs_f64() * 1e9 / (steps * components) as f64))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("| components | master, ns | FMU alone, ns | beyond the FMU, ns | master, ratio to 10 components |");
    println!("|---|---|---|---|---|");
    let mut fastest = SIZES.map(|_| [f64::INFINITY; 2]);
    for _ in 0..ROUNDS {
        for (fastest, components) in fastest.iter_mut().zip(SIZES) {
            for (fastest, time) in fastest.iter_mut().zip(measure(components)?) {
                *fastest = fastest.min(time);
            }
        }
    }
    for (components, [master, alone]) in SIZES.into_iter().zip(fastest) {
        let ratio = master / fastest[0][0];
        println!("| {components} | {master:.1} | {alone:.1} | {:.1} | {ratio:.2} |", master - alone);
    }
    Ok(())
}
