//! Systems of FMUs with connected clocks. Reference: FMI 3.0.2, sections 2.2.9 and 2.3.5; counts, times and values in
//! closed form.

use fmu_system::export::System;
use fmu_system::failure::Failure;
use fmu_system::fmus::Fmus;
use fmu_system::master::{self, Recording};
use fmu_system::plan::{Origin, Plan, Signal};
use fmu_system::resolve::{FmuFolder, Options, resolve_text};
use fmu_system::session::Session;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use tests::{cargo_fmu, successful, workspace};

/// Counts the ticks of its clock.
const SOURCE: &str = r#"
#[derive(Parameters)]
pub struct Source {
    /// Interval (s)
    #[var(start = 0.1, positive)]
    period: f64,
    /// Number of ticks from one pulse to the next (1)
    #[var(start = 1.0, positive)]
    every: f64,
}

#[derive(Outputs)]
pub struct Y {
    /// Number of ticks (1)
    #[var(clock = "tick")]
    value: f64,
    /// Ticks together with every n-th tick
    pulse: Clock,
}

/// Source of ticks
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Source {
    type Outputs = Y;

    /// Ticks periodically
    #[clock(interval_of = "period")]
    fn tick(&self, tick: Tick<Self>) {
        tick.outputs.value += 1.0;
        if tick.outputs.value % self.every == 0.0 {
            tick.outputs.pulse.fire();
        }
    }
}
"#;

/// Sum of two inputs.
const SUM: &str = r#"
#[derive(Parameters)]
pub struct Sum {}

#[derive(Inputs)]
pub struct U {
    /// First (1)
    #[var(clock = "trigger")]
    a: f64,
    /// Second (1)
    #[var(clock = "trigger")]
    b: f64,
}

#[derive(Outputs)]
pub struct Y {
    /// a + b (1)
    #[var(clock = "trigger")]
    sum: f64,
}

/// Sum
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Sum {
    type Inputs = U;
    type Outputs = Y;

    /// Adds the inputs
    #[clock(triggered)]
    fn trigger(&self, tick: Tick<Self>) {
        tick.outputs.sum = tick.inputs.a + tick.inputs.b;
    }
}
"#;

/// A function of an input that is evaluated when another FMU ticks.
const RELAY: &str = r#"
#[derive(Parameters)]
pub struct Relay {
    /// Gain (1)
    #[var(start = 2.0)]
    gain: f64,
}

#[derive(Inputs)]
pub struct U {
    /// Input (1)
    #[var(clock = "trigger")]
    input: f64,
}

#[derive(Outputs)]
pub struct Y {
    /// gain * input + 1 (1)
    #[var(clock = "trigger")]
    output: f64,
    /// Sum of the inputs (1)
    #[var(clock = "trigger")]
    sum: f64,
    /// Number of ticks
    #[var(clock = "trigger")]
    count: i32,
    /// Time of the last tick (s)
    #[var(clock = "trigger")]
    tick_time: f64,
    /// Ticks with each tick
    done: Clock,
}

/// Relay
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Relay {
    type Inputs = U;
    type Outputs = Y;

    /// Computes the output
    #[clock(triggered)]
    fn trigger(&self, tick: Tick<Self>) {
        tick.outputs.output = self.gain * tick.inputs.input + 1.0;
        tick.outputs.sum += tick.inputs.input;
        tick.outputs.count += 1;
        tick.outputs.tick_time = tick.time;
        tick.outputs.done.fire();
    }
}
"#;

/// A pulse that follows another one after a delay. Its variables belong to no clock.
const DELAY: &str = r#"
#[derive(Parameters)]
pub struct Delay {
    /// Delay (s)
    #[var(start = 0.0)]
    delay: f64,
    /// Start another pulse after each delayed one
    #[var(start = false)]
    repeat: bool,
}

#[derive(Inputs)]
pub struct U {
    /// Sampled at the delayed pulse (1)
    offset: f64,
}

#[derive(Outputs)]
pub struct Y {
    /// Value of the offset at the last delayed pulse (1)
    held: f64,
    /// Time of the last delayed pulse (s)
    pulse_time: f64,
    /// Ticks with the delayed pulse
    delayed: Clock,
}

/// Delayed pulse
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Delay {
    type Inputs = U;
    type Outputs = Y;

    /// Starts the delay
    #[clock(triggered)]
    fn pulse(&self, mut tick: Tick<Self>) {
        tick.start(DelayClock::Again, self.delay);
    }

    /// Delayed pulse
    #[clock(countdown)]
    fn again(&self, mut tick: Tick<Self>) {
        if self.repeat {
            tick.start(DelayClock::Again, self.delay);
        }
        tick.outputs.held = tick.inputs.offset;
        tick.outputs.pulse_time = tick.time;
        tick.outputs.delayed.fire();
    }
}
"#;

/// Counts how often two clocks tick together.
const MEETING: &str = r#"
#[derive(Parameters)]
pub struct Meeting;

#[derive(Outputs)]
pub struct Y {
    /// Number of events at which both clocks ticked
    #[var(clock = "second")]
    together: i32,
    /// Time of the last such event (s)
    #[var(clock = "second")]
    at: f64,
}

#[derive(DiscreteState, Clone, Default)]
pub struct X {
    first: u32,
    seen: u32,
}

/// Meeting of two clocks
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Meeting {
    type Outputs = Y;
    type State = X;

    /// First clock
    #[clock(triggered)]
    fn first(&self, tick: Tick<Self>) {
        tick.state.first = 1;
        tick.outputs.at = tick.time;
    }

    /// Second clock, after the first one at the same event
    #[clock(triggered)]
    fn second(&self, tick: Tick<Self>) {
        if tick.state.first == 1 && tick.outputs.at == tick.time {
            tick.outputs.together += 1;
        }
    }
}
"#;

/// Reads an input at its own times.
const SAMPLER: &str = r#"
#[derive(Parameters)]
pub struct Sampler;

#[derive(Inputs)]
pub struct U {
    /// Input (1)
    #[var(clock = "sample")]
    input: f64,
}

#[derive(Outputs)]
pub struct Y {
    /// Input at the last tick (1)
    #[var(clock = "sample")]
    seen: f64,
}

/// Sampler
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Sampler {
    type Inputs = U;
    type Outputs = Y;

    /// Ticks at 0, 0.1, 0.2, … s
    #[clock(interval = 1 / 10)]
    fn sample(&self, tick: Tick<Self>) {
        tick.outputs.seen = tick.inputs.input;
    }
}
"#;

/// A discrete-time model without clocks.
const GAIN: &str = r#"
#[derive(Parameters)]
pub struct Gain {
    /// Gain (1)
    #[var(start = 2.0)]
    gain: f64,
}

#[derive(Inputs)]
pub struct U {
    /// Input (1)
    u: f64,
}

#[derive(Outputs)]
pub struct Y {
    /// gain * u (1)
    y: f64,
}

/// Gain
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Gain {
    type Inputs = U;
    type Outputs = Y;
    fn update(&self, sample: Sample<Self>) -> Y {
        Y { y: self.gain * sample.inputs.u }
    }
}
"#;

/// A continuous-time model with a sampled controller.
const DRIVE: &str = r#"
#[derive(Parameters)]
pub struct Drive;

#[derive(State)]
pub struct X<T> {
    /// Position (m)
    x: T,
}

#[derive(Inputs)]
pub struct U<T> {
    /// Reference (m)
    #[var(clock = "control")]
    target: T,
}

#[derive(DiscreteState, Clone, Default)]
pub struct Held {
    speed: f64,
}

#[derive(Outputs)]
pub struct Y<T> {
    /// Speed (m/s)
    #[var(clock = "control")]
    speed: T,
}

/// Drive
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Drive {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    type DiscreteState = Held;

    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        X { x: at.discrete.speed.into() }
    }

    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        Y { speed: at.discrete.speed.into() }
    }

    /// Ticks at 0, 0.1, 0.2, … s
    #[clock(interval = 1 / 10)]
    fn control(&self, tick: Tick<Self>) {
        tick.state.speed = tick.inputs.target - tick.continuous.x;
    }
}
"#;

/// A discrete-time model without clocks, with a state.
const REGULATOR: &str = r#"
#[derive(Parameters)]
pub struct Regulator;

#[derive(Inputs)]
pub struct U {
    /// Level (m)
    level: f64,
}

#[derive(Outputs)]
pub struct Y {
    /// Rate of the level (m/s)
    rate: f64,
}

#[derive(DiscreteState, Clone, Default)]
pub struct X {
    integral: f64,
}

/// Regulator of a level
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Discrete for Regulator {
    type Inputs = U;
    type Outputs = Y;
    type State = X;
    fn update(&self, sample: Sample<Self>) -> Y {
        let error = (0.3 * sample.time).sin() - sample.inputs.level;
        sample.state.integral += 0.1 * error;
        Y { rate: 0.9 * error + sample.state.integral }
    }
}
"#;

/// The plant of the regulator.
const TANK: &str = r#"
#[derive(Parameters)]
pub struct Tank;

#[derive(Inputs)]
pub struct U<T> {
    /// Rate of the level (m/s)
    rate: T,
}

#[derive(State)]
pub struct X<T> {
    /// Level (m)
    level: T,
}

/// Tank
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Tank {
    type Inputs<T: Scalar> = U<T>;
    type State<T: Scalar> = X<T>;
    fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
        X { level: at.inputs.rate - at.state.level * 0.1 }
    }
}
"#;

/// The packed FMUs, which all tests share.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = workspace().join("target/clocked_systems");
        let models = [
            ("source", SOURCE),
            ("relay", RELAY),
            ("sum", SUM),
            ("delay", DELAY),
            ("meeting", MEETING),
            ("sampler", SAMPLER),
            ("gain", GAIN),
            ("drive", DRIVE),
        ];
        for (name, source) in models {
            pack(&folder, name, source, &["--out", "../out"]);
        }
        folder.join("out")
    })
}

fn pack(folder: &Path, name: &str, source: &str, options: &[&str]) {
    let package = folder.join(name);
    let exporter = workspace().join("crates/fmu");
    let manifest = format!(
        "[package]\nname = \"{name}\"\nversion = \"1.0.0\"\nedition = \"2024\"\n\n[workspace]\n\n\
         [lib]\ncrate-type = [\"cdylib\", \"rlib\"]\n\n[dependencies]\nfmu = {{ path = {exporter:?} }}\n"
    );
    std::fs::create_dir_all(package.join("src")).expect("a folder");
    std::fs::write(package.join("Cargo.toml"), manifest).expect("a file");
    std::fs::write(package.join("src/lib.rs"), format!("use fmu::prelude::*;\n{source}")).expect("a file");
    let mut command = Command::new(cargo_fmu());
    command.current_dir(&package).args(["pack", "--fmi", "3", "--debug"]).args(options);
    command.env("CARGO_TARGET_DIR", workspace().join("target/foreign"));
    command.env("CARGO_NET_OFFLINE", "true").env("CARGO_PROFILE_DEV_DEBUG", "none");
    successful(&mut command);
}

/// `pack --clocks`. Reference: the same system with FMUs that were packed without the option.
#[test]
fn a_regulator_that_is_packed_with_a_clock_gives_the_same_numbers() {
    let folder = workspace().join("target/packed_with_clocks");
    for (name, source) in [("regulator", REGULATOR), ("tank", TANK), ("sampler", SAMPLER)] {
        pack(&folder, name, source, &["--out", "../plain"]);
        pack(&folder, name, source, &["--out", "../clocked", "--clocks"]);
    }
    let [plain, clocked] = ["plain", "clocked"].map(|name| folder.join(name));
    let fmu = |folder: &Path, name: &str| fmu_import::fmu::Fmu::open(folder.join(name)).expect("an FMU");
    let clocks = |folder: &Path| {
        fmu(folder, "Regulator.fmu").description().clocks.iter().map(|clock| clock.name.clone()).collect::<Vec<_>>()
    };
    assert_eq!((clocks(&plain), clocks(&clocked)), (vec![], vec!["sample".to_owned()]));
    for name in ["Tank.fmu", "Sampler.fmu"] {
        let guid = |folder: &Path| fmu(folder, name).description().guid.clone();
        assert_eq!(guid(&plain), guid(&clocked), "{name} stays as it is");
    }
    for (order, step) in ORDERS.into_iter().flat_map(|order| [0.1, 0.02].map(|step| (order, step))) {
        let components = ["regulator = Regulator", "tank = Tank"];
        let text = scenario(&components, &[], [step, 5.0], order);
        let columns = [&plain, &clocked].map(|folder| {
            let found = resolve_text(Path::new("clocks.toml"), &text, &FmuFolder::new([folder]), &Options::default());
            let plan = found.unwrap_or_else(|error| panic!("{}", error.lines().join("\n")));
            let recording = execute(&plan).unwrap_or_else(|error| panic!("{error}"));
            (0..plan.columns.len()).map(|index| recording.column(index).expect("a column").to_vec()).collect::<Vec<_>>()
        });
        assert!(columns[0].len() >= 2 && columns[0].iter().flatten().any(|value| *value != 0.0));
        assert_eq!(columns[0], columns[1], "{order}, {step} s");
    }
    let mut command = Command::new(cargo_fmu());
    let checked = successful(command.args(["fmu", "check"]).arg(clocked.join("Regulator.fmu")));
    assert!(format!("{checked:?}").contains("no error, no warning"), "{checked:?}");
    // FMI 2.0 has no clocks; the message says what to do.
    let mut command = Command::new(cargo_fmu());
    let output = command.current_dir(folder.join("regulator")).args(["pack", "--clocks"]).output().expect("it starts");
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success() && message.contains("FMI 2.0 has no clocks"), "{message}");
    assert!(message.contains("Add --fmi 3."), "{message}");
}

/// A scenario from components (`name = FMU key = value; key = value`) and connections (`from -> to`).
fn scenario(components: &[&str], connections: &[&str], [step, stop]: [f64; 2], order: &str) -> String {
    let mut text = format!("title = \"Clocks\"\n[simulation]\nstop = {stop:?}\nstep = {step:?}\norder = \"{order}\"\n");
    for component in components {
        let (name, rest) = component.split_once(" = ").expect("a name");
        let (fmu, keys) = rest.split_once(' ').unwrap_or((rest, ""));
        let keys = keys.replace("; ", "\n");
        text += &format!("[[component]]\nname = \"{name}\"\nfmu = \"{fmu}\"\n{keys}\n");
    }
    for connection in connections {
        let (from, to) = connection.split_once(" -> ").expect("two ends");
        text += &format!("[[connection]]\nfrom = \"{from}\"\nto = \"{to}\"\n");
    }
    text + "[[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\nsignals = [\"*\"]\n"
}

fn resolved(text: &str) -> Result<Plan, String> {
    resolve_text(Path::new("clocks.toml"), text, &FmuFolder::new([folder()]), &Options::default())
        .map_err(|error| error.lines().join("\n"))
}

fn plan(text: &str) -> Plan {
    resolved(text).unwrap_or_else(|error| panic!("{error}"))
}

fn execute(plan: &Plan) -> Result<Recording, Failure> {
    master::execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).expect("FMUs"))
}

/// Runs a scenario. The function returns the column of a signal, whose name contains its component unless it is the
/// first one with this signal.
fn run(text: &str) -> impl Fn(&str) -> Vec<f64> + use<> {
    let plan = plan(text);
    let recording = execute(&plan).unwrap_or_else(|error| panic!("{error}"));
    move |name| {
        let position = |name: &str| plan.columns.iter().position(|column| column.name == name);
        let index = position(name).or_else(|| position(name.split_once(':')?.1));
        recording.column(index.unwrap_or_else(|| panic!("{name}"))).expect("a column").to_vec()
    }
}

/// Number of ticks at 0, period, 2 period, … before a time. Ticks at the end of a step belong to the next one.
fn ticks(period: f64, time: f64) -> f64 {
    ((time - 1e-9) / period).floor() + 1.0
}

const ORDERS: [&str; 2] = ["sequential", "jacobi"];

/// Steps as long as the interval, longer and shorter.
const STEPS: [f64; 4] = [0.1, 0.25, 0.04, 1.0];

#[test]
fn an_output_clock_and_its_data_reach_the_other_fmu_at_the_same_tick() {
    let components = ["relay = Relay", "source = Source"];
    // An output clock, a clock that ticks at its own times, and the clock of the connected variables.
    for clock in ["source:pulse -> relay:trigger", "source:tick -> relay:trigger", ""] {
        let connections = [clock, "source:value -> relay:input"];
        let connections = &connections[usize::from(clock.is_empty())..];
        for (order, step) in ORDERS.into_iter().flat_map(|order| STEPS.map(|step| (order, step))) {
            let of = run(&scenario(&components, connections, [step, 2.0], order));
            let [value, count, sum, output] = ["value", "count", "sum", "output"].map(&of);
            for row in 1..value.len() {
                let n = ticks(0.1, row as f64 * step);
                let expected = [n, n, n * (n + 1.0) / 2.0, 2.0 * n + 1.0];
                assert_eq!([value[row], count[row], sum[row], output[row]], expected, "{order}, {step} s, row {row}");
            }
            assert!((of("tick_time")[value.len() - 1] - 1.9).abs() < 1e-12);
        }
    }
    // Every third tick only: at 0.2, 0.5, 0.8, … s.
    let components = ["source = Source parameters = { every = 3.0 }", "relay = Relay"];
    let connections = ["source:pulse -> relay:trigger", "source:value -> relay:input"];
    let of = run(&scenario(&components, &connections, [0.1, 1.0], "sequential"));
    assert_eq!(of("count"), [0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0, 3.0]);
    assert_eq!(of("sum")[10], 3.0 + 6.0 + 9.0);
}

#[test]
fn a_chain_does_not_depend_on_the_order_of_the_components() {
    let mut components = ["source = Source", "first = Relay", "second = Relay", "third = Relay"];
    let connections = [
        "source:pulse -> first:trigger",
        "first:done -> second:trigger",
        "second:done -> third:trigger",
        "source:value -> first:input",
        "first:output -> second:input",
        "second:output -> third:input",
    ];
    for _ in 0..2 {
        for (order, step) in ORDERS.into_iter().flat_map(|order| STEPS.map(|step| (order, step))) {
            let of = run(&scenario(&components, &connections, [step, 1.0], order));
            let (output, count) = (of("third:output"), of("third:count"));
            for row in 1..output.len() {
                let n = ticks(0.1, row as f64 * step);
                assert_eq!((output[row], count[row]), (8.0 * n + 7.0, n), "{order}, {step} s, row {row}");
            }
        }
        components.reverse();
    }
}

/// The delayed pulse ticks at the same time, in the second iteration of the event, or between two steps. The offset,
/// which belongs to no clock, has the value of the source from the same time; the relay reads an unclocked output.
#[test]
fn a_countdown_of_another_fmu_ticks_at_the_same_time_or_later() {
    for delay in [0.0, 0.03, 0.06] {
        let delayed = format!("delay = Delay parameters = {{ delay = {delay:?} }}");
        let components = ["relay = Relay", &delayed, "source = Source"];
        // The clocks `source:pulse` and `delay:pulse` are connected by their name.
        let connections =
            ["delay:delayed -> relay:trigger", "source:value -> delay:offset", "delay:held -> relay:input"];
        for (order, step) in ORDERS.into_iter().flat_map(|order| [0.1, 0.05, 0.5].map(|step| (order, step))) {
            let of = run(&scenario(&components, &connections, [step, 1.0], order));
            let [held, count, sum, time] = ["held", "count", "sum", "tick_time"].map(&of);
            for row in 1..held.len() {
                let n = ticks(0.1, row as f64 * step - delay).max(0.0);
                let found = [held[row], count[row], sum[row]];
                assert_eq!(found, [n, n, n * (n + 1.0) / 2.0], "{delay} s, {order}, {step} s, row {row}");
                let last = if n > 0.0 { 0.1 * (n - 1.0) + delay } else { 0.0 };
                assert!((time[row] - last).abs() < 1e-12, "{delay} s, {step} s, row {row}: {} s", time[row]);
            }
        }
    }
}

/// No clock is connected: both FMUs tick at their own times, and values arrive at the same tick in any order.
#[test]
fn clocked_values_arrive_at_the_same_tick_without_connected_clocks() {
    for period in [0.1, 0.3] {
        let source = format!("source = Source parameters = {{ period = {period:?} }}");
        let mut components = [&*source, "first = Sampler", "second = Sampler"];
        for (order, step) in ORDERS.into_iter().flat_map(|order| STEPS.map(|step| (order, step))) {
            components.rotate_left(1);
            let connections = ["source:value -> first:input", "first:seen -> second:input"];
            let of = run(&scenario(&components, &connections, [step, 2.0], order));
            for seen in [of("first:seen"), of("second:seen")] {
                for (row, seen) in seen.into_iter().enumerate().skip(1) {
                    let last = 0.1 * (ticks(0.1, row as f64 * step) - 1.0);
                    let expected = (last / period + 1e-9).floor() + 1.0;
                    assert_eq!(seen, expected, "{period} s, {order}, {step} s, {components:?}, row {row}");
                }
            }
        }
    }
}

/// An FMU without clocks holds the value of a clocked output during its step. A clocked input is read at the tick:
/// there, the gain has made the steps before it, with the value from the tick before. In Jacobi order, it is one step
/// older.
#[test]
fn fmus_without_clocks_hold_and_provide_values() {
    let connections = ["source:pulse -> relay:trigger", "source:value -> gain:u", "gain:y -> relay:input"];
    let mut components = ["source = Source", "gain = Gain", "relay = Relay"];
    for order in ORDERS {
        let delay = if order == "jacobi" { 1.0 } else { 0.0 };
        for _ in 0..3 {
            components.rotate_left(1);
            let of = run(&scenario(&components, &connections, [0.1, 1.0], order));
            let sums = (0..=10).map(|n| (0..n).map(|k| 2.0 * (f64::from(k) - delay).max(0.0)).sum::<f64>());
            assert_eq!(of("sum"), sums.collect::<Vec<_>>(), "{order}, {components:?}");
        }
    }
}

/// Ticks every 1/3 s and every 1/2 s: both at 0 s, 1 s, 2 s and so on.
#[test]
fn clocks_of_two_fmus_meet_in_one_event() {
    let components = [
        "meeting = Meeting",
        "thirds = Source parameters = { period = 0.3333333333333333 }",
        "halves = Source parameters = { period = 0.5 }",
    ];
    let connections = ["thirds:tick -> meeting:first", "halves:pulse -> meeting:second"];
    for step in [0.1, 0.4, 1.0] {
        let of = run(&scenario(&components, &connections, [step, 4.0], "sequential"));
        let (together, at) = (of("together"), of("at"));
        for (row, count) in together.into_iter().enumerate().skip(1) {
            assert_eq!(count, ticks(1.0, row as f64 * step), "{step} s, row {row}");
        }
        // The second clock has ticked at 3.5 s for the last time, the first one before it.
        assert!((at[at.len() - 1] - 10.0 / 3.0).abs() < 1e-9, "{at:?}");
    }
}

/// x = y/2 + 1 and y = x/2 + 1 at the same tick: x = y = 2. With a gain of 2, the iteration diverges.
#[test]
fn loops_at_one_tick_are_solved_or_reported() {
    let connections =
        ["source:pulse -> a:trigger", "source:pulse -> b:trigger", "a:output -> b:input", "b:output -> a:input"];
    let text = |gain: &str| {
        let [a, b] = ["a", "b"].map(|name| format!("{name} = Relay parameters = {{ gain = {gain} }}"));
        scenario(&[&a, &b, "source = Source"], &connections, [0.1, 0.3], "sequential")
    };
    let of = run(&text("0.5"));
    for output in [of("a:output"), of("b:output")] {
        assert!(output[1..].iter().all(|value| (value - 2.0).abs() < 1e-12), "{output:?}");
    }
    let error = execute(&plan(&text("2.0"))).expect_err("it diverges").to_string();
    let expected = "still change after 100 evaluations: they depend on those of `";
    assert!(error.contains(expected) && error.contains("step from 0 s"), "{error}");
}

#[test]
fn a_chain_without_end_names_its_clocks() {
    let components = [
        "source = Source parameters = { every = 3.0 }",
        "delay = Delay parameters = { repeat = true }; inputs = { offset = 0.0 }",
        "relay = Relay inputs = { input = 0.0 }",
    ];
    let plan = plan(&scenario(&components, &["delay:delayed -> relay:trigger"], [0.1, 1.0], "sequential"));
    let mut session =
        Session::new(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).expect("FMUs")).expect("a session");
    (0..2).for_each(|_| session.step().expect("a step"));
    let before = session.save().expect("a state");
    let error = session.step().expect_err("it has no end").to_string();
    let expected = "event iterations at one time, in each of which these clocks tick: `delay:again`, `relay:trigger`";
    assert!(error.contains(expected), "{error}");
    // The event cannot go on, but the state before it can be restored.
    let error = session.step().expect_err("the event has failed").to_string();
    assert!(error.contains("an event has failed before"), "{error}");
    session.restore(&before).expect("it is restored");
    assert!(session.step().expect_err("it has no end").to_string().contains(expected));
}

/// The clocks of an FMU tick in both interfaces. Reference: the closed form of the sampled controller,
/// `x_(k+1) = x_k + h (target - x_k)`; between two ticks, the speed is constant, so that all solvers are exact. The
/// tolerance is that of rounding.
#[test]
fn clocks_tick_in_co_simulation_and_model_exchange() {
    let used = [
        "interface = \"co-simulation\"",
        "interface = \"model-exchange\"",
        "interface = \"model-exchange\"; solver = \"rosenbrock\"",
        "interface = \"model-exchange\"; solver = \"runge_kutta\"; max_step = 0.03",
    ];
    for (used, step) in used.into_iter().flat_map(|used| STEPS.map(|step| (used, step))) {
        let components = [&*format!("drive = Drive inputs = {{ target = 2.0 }}; {used}")];
        let of = run(&scenario(&components, &[], [step, 2.0], "sequential"));
        for (row, (x, speed)) in of("drive:x").into_iter().zip(of("drive:speed")).enumerate().skip(1) {
            let (time, count) = (row as f64 * step, ticks(0.1, row as f64 * step) as i32);
            let last = 2.0 * 0.9_f64.powi(count - 1);
            let expected = 2.0 - last + (time - 0.1 * f64::from(count - 1)) * last;
            assert!((speed - last).abs() < 1e-12, "{used}, {step} s, row {row}: {speed} {last}");
            assert!((x - expected).abs() < 1e-12, "{used}, {step} s, row {row}: {x} {expected}");
        }
    }
}

#[test]
fn a_restored_system_repeats_its_ticks() {
    let components = ["relay = Relay", "delay = Delay parameters = { delay = 0.03 }", "source = Source"];
    let connections = ["delay:delayed -> relay:trigger", "source:value -> delay:offset", "delay:held -> relay:input"];
    assert_repeats(&components, &connections);
    let drive = "drive = Drive inputs = { target = 2.0 }; interface = \"model-exchange\"";
    assert_repeats(&[drive], &[]);
}

/// The reference is the run without restoring.
fn assert_repeats(components: &[&str], connections: &[&str]) {
    let plan = plan(&scenario(components, connections, [0.04, 1.0], "sequential"));
    let fmus = Fmus::load(&plan.runs).expect("FMUs");
    let mut session = Session::new(&plan.simulation, &plan.runs[0], &fmus).expect("a session");
    (0..6).for_each(|_| session.step().expect("a step"));
    let saved = session.save().expect("a state");
    let finish = |session: &mut Session| {
        session.restore(&saved).expect("it is restored");
        while !session.is_over() {
            session.step().expect("a step");
        }
        session.bus().to_vec()
    };
    let expected = finish(&mut session);
    assert_eq!(finish(&mut session), expected);
    let recording = execute(&plan).expect("a run");
    let last = plan
        .columns
        .iter()
        .enumerate()
        .map(|(index, _)| *recording.column(index).expect("a column").last().expect("a row"));
    let found: Vec<f64> = (0..plan.columns.len()).map(|index| session.column(index).expect("a column")).collect();
    assert_eq!(last.collect::<Vec<_>>(), found);
}

#[test]
fn mistakes_in_connections_of_clocks_are_reported() {
    let components = ["source = Source", "relay = Relay inputs = { input = 0.0 }"];
    let lines = |connections: &[&str]| resolved(&scenario(&components, connections, [0.1, 1.0], "sequential"));
    for (connections, expected) in [
        (
            &["source:value -> relay:trigger"][..],
            "`source:value` is Real, but its target `relay:trigger` is a triggered input Clock",
        ),
        (&["source:pulse -> relay:input"], "`source:pulse` is an output Clock, but its target `relay:input` is Real"),
        (
            &["relay:done -> source:tick"],
            "`relay:done` is an output Clock, but its target `source:tick` is a fixed input Clock",
        ),
        (&["relay:trigger -> relay:trigger"], "`relay:trigger` is a triggered input Clock, but its target"),
        (&["source:pulse -> relay:done"], "but its target `relay:done` is an output Clock"),
        (
            &["source:pulse -> relay:trigger", "source:tick -> relay:trigger"],
            "a second connection writes `relay:trigger`",
        ),
        (&["source:puls -> relay:trigger"], "`source` has no output `puls`"),
    ] {
        let error = lines(connections).expect_err(expected);
        assert!(error.contains(expected), "{error}\n  expected {expected}");
    }
    let unconnected = lines(&[]).expect("a warning only");
    let expected = "the clock `trigger` of `relay` is triggered and never ticks: no clock is connected to it; \
                    add a [[connection]]; output clocks: `source:pulse`";
    assert!(unconnected.warnings.iter().any(|warning| warning.contains(expected)), "{:?}", unconnected.warnings);

    // Two output clocks have the name of the input clock.
    let several = ["source = Source", "other = Source", "delay = Delay inputs = { offset = 0.0 }"];
    let error = resolved(&scenario(&several, &[], [0.1, 1.0], "sequential")).expect_err("two writers");
    assert!(
        error.contains("the clock `pulse` of `delay` has several writers: `source:pulse`, `other:pulse`"),
        "{error}"
    );

    // The two inputs of a clock read outputs of two clocks.
    let several = ["source = Source", "other = Source", "sum = Sum"];
    let connections = ["source:value -> sum:a", "other:value -> sum:b"];
    let error = resolved(&scenario(&several, &connections, [0.1, 1.0], "sequential")).expect_err("two clocks");
    assert!(error.contains("the clock `trigger` of `sum` has several writers: `source:tick`, `other:tick`"), "{error}");

    // The plan lists the connection.
    let plan = lines(&["source:pulse -> relay:trigger"]).expect("it is valid");
    let is_found = plan.wiring[0].inputs.iter().any(|input| {
        let is_pulse = |from: &Signal| from.component == "source" && from.variable == "pulse";
        let is_source = matches!(&input.source, Origin::Output(from) if is_pulse(from));
        input.input.variable == "trigger" && is_source
    });
    assert!(is_found && plan.warnings.is_empty(), "{:?}", plan.warnings);
    assert_eq!(plan.runs[0].components[1].clocks[0].source, "pulse");
    let error = System::new(&plan, &plan.runs[0]).expect_err("SSP has no such connection").to_string();
    assert!(error.contains("from `source:pulse` to `relay:trigger` joins clocks"), "{error}");
}
