//! Components in model exchange, which the master integrates. The references are closed forms, and numbers that
//! scipy 1.17 (DOP853 and Radau at a tolerance of 1e-13) returned for the van der Pol oscillator.
#![cfg(unix)]

#[path = "../../fmu-import/tests/support/decay.rs"]
mod decay;

mod counting;

use decay::Decay;
use fmu_import::archive::platform_of;
use fmu_import::description::FmiVersion;
use fmu_system::failure::{Failure, FailureKind};
use fmu_system::fmus::Fmus;
use fmu_system::master;
use fmu_system::plan::Plan;
use fmu_system::resolve::{FmuFolder, Options, ResolveError, resolve_text};
use fmu_system::run::Recording;
use fmu_system::session::Session;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use zip::write::{SimpleFileOptions, ZipWriter};

/// An FMU of `ode.c`: its macros, and the number of states.
struct Ode<'a> {
    name: &'a str,
    states: usize,
    macros: &'a [(&'a str, &'a str)],
}

const DEFAULTS: [(&str, &str); 10] = [
    ("START", "{1}"),
    ("F", "dx[0]=0"),
    ("NZ", "0"),
    ("Z", "(void)z"),
    ("EVENT", ""),
    ("NEXT", "HUGE_VAL"),
    ("AFTER", "0"),
    ("OVER", "0"),
    ("PARTIAL", "0"),
    ("UNDEFINED", "0"),
];

impl Ode<'_> {
    fn pack(&self, folder: &Path) {
        let &Self { name, states, macros } = self;
        let value = |key: &str| {
            macros.iter().chain(&DEFAULTS).find(|(known, _)| *known == key).map_or("x[0]", |(_, value)| value)
        };
        let library = folder.join(format!("{name}.so"));
        let mut cc = Command::new("cc");
        cc.args(["-O1", "-fPIC", "-shared", "-fvisibility=hidden", "-ffp-contract=off"]).arg(format!("-DN={states}"));
        for key in DEFAULTS.iter().map(|(key, _)| *key).chain(["Y"]) {
            cc.arg(format!("-D{key}={}", value(key)));
        }
        let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/ode.c");
        assert!(cc.arg("-o").arg(&library).args([source, "-lm"]).status().unwrap().success());
        let indicators = value("NZ");
        let has_partial = value("PARTIAL") != "0";
        let mut text = format!(
            "<fmiModelDescription fmiVersion=\"2.0\" modelName=\"{name}\" guid=\"g\" numberOfEventIndicators=\"{indicators}\">\
             <ModelExchange modelIdentifier=\"{name}\" canGetAndSetFMUstate=\"true\" \
             providesDirectionalDerivative=\"{has_partial}\"/><ModelVariables>"
        );
        let mut add = |name: &str, reference: usize, attributes: &str, kind: &str| {
            write!(
                text,
                "<ScalarVariable name=\"{name}\" valueReference=\"{reference}\" {attributes}>{kind}</ScalarVariable>"
            )
            .unwrap();
        };
        for i in 0..states {
            add(&format!("x{i}"), i, "causality=\"output\" initial=\"exact\"", "<Real start=\"1\"/>");
            add(&format!("der{i}"), 10 + i, "", &format!("<Real derivative=\"{}\"/>", 2 * i + 1));
        }
        add("u", 20, "causality=\"input\"", "<Real start=\"0\"/>");
        add("d", 21, "causality=\"input\" variability=\"discrete\"", "<Real start=\"0\"/>");
        add("y", 22, "causality=\"output\"", "<Real/>");
        add("events", 23, "causality=\"output\" variability=\"discrete\"", "<Integer/>");
        add("steps", 24, "causality=\"output\" variability=\"discrete\"", "<Integer/>");
        text += "</ModelVariables><ModelStructure><Derivatives>";
        (0..states).for_each(|i| write!(text, "<Unknown index=\"{}\"/>", 2 * i + 2).unwrap());
        text += "</Derivatives></ModelStructure></fmiModelDescription>";
        let mut zip = ZipWriter::new(File::create(folder.join(format!("{name}.fmu"))).unwrap());
        let mut file = |name: &str, content: &[u8]| {
            zip.start_file(name, SimpleFileOptions::default()).unwrap();
            zip.write_all(content).unwrap();
        };
        file("modelDescription.xml", text.as_bytes());
        let suffix = std::env::consts::DLL_SUFFIX;
        let library = std::fs::read(&library).unwrap();
        file(&format!("binaries/{}/{name}{suffix}", platform_of(FmiVersion::V2)), &library);
        zip.finish().unwrap();
    }
}

/// The plan of one component with these keys.
fn plan(folder: &TempDir, fmu: &str, [stop, step]: [f64; 2], keys: &str) -> Result<Plan, String> {
    let text = format!(
        "title = \"Test\"\n[simulation]\nstop = {stop:?}\nstep = {step:?}\n[[component]]\nname = \"own\"\nfmu = \"{fmu}\"\n\
         inputs = {{ u = 0.0, d = 0.0 }}\n{keys}\n[[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\nsignals = [\"own:*\"]\n"
    );
    resolved(folder, &text)
}

fn resolved(folder: &TempDir, text: &str) -> Result<Plan, String> {
    resolve_text(Path::new("test.toml"), text, &FmuFolder::new([folder.path()]), &Options::default())
        .map_err(|error: ResolveError| error.lines().join("\n"))
}

fn execute(plan: &Plan) -> Result<Recording, Failure> {
    master::execute(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap())
}

fn column<'r>(plan: &Plan, recording: &'r Recording, name: &str) -> &'r [f64] {
    recording.column(plan.columns.iter().position(|column| column.name == name).unwrap()).unwrap()
}

const BALL: Ode<'_> = Ode {
    name: "Ball",
    states: 2,
    macros: &[
        ("F", "dx[0]=x[1],dx[1]=-9.81"),
        ("START", "{1,0}"),
        ("NZ", "1"),
        ("Z", "z[0]=x[0]"),
        // Above the ground, so that the indicator is positive again.
        ("EVENT", "if(x[0]<=0&&x[1]<0){x[0]=1e-300,x[1]*=-0.7,i->count=t;}"),
        ("Y", "i->count"),
    ],
};

/// Ballistic flight: both methods are exact for it. Bounces accumulate at 2.5586 s.
#[test]
fn a_ball_bounces_at_the_times_of_the_closed_form() {
    let folder = TempDir::new().unwrap();
    BALL.pack(folder.path());
    for solver in ["dormand_prince", "rosenbrock"] {
        let plan = plan(&folder, "Ball", [2.0, 0.01], &format!("solver = \"{solver}\"")).unwrap();
        let recording = execute(&plan).unwrap();
        let (h, v) = (column(&plan, &recording, "x0"), column(&plan, &recording, "x1"));
        for (k, expected) in [(50, 0.138779880359517), (100, 0.225059760719034), (150, 0.0534023898335371)] {
            assert!((h[k] - expected).abs() < 1e-8, "{solver}: {k}: {} {expected}", h[k]);
        }
        assert!((v[150] + 1.91389840677764).abs() < 1e-8, "{solver}: {}", v[150]);
        let mut bounces = column(&plan, &recording, "y").to_vec();
        bounces.dedup();
        for (bounce, expected) in
            bounces[1..].iter().zip([0.451523640985731, 1.08365673836575, 1.52614990653177, 1.83589512424798])
        {
            assert!((bounce - expected).abs() < 1e-8, "{solver}: {bounce} {expected}");
        }
    }
    let plan = plan(&folder, "Ball", [3.0, 0.01], "").unwrap();
    let failure = execute(&plan).unwrap_err();
    let message = failure.to_string();
    assert!(
        message.contains("more than 10000 events between 2.55") && message.contains("event indicator 1"),
        "{message}"
    );
}

const VAN_DER_POL: Ode<'_> = Ode {
    name: "VanDerPol",
    states: 2,
    macros: &[
        ("F", "dx[0]=x[1],dx[1]=MU*(1-x[0]*x[0])*x[1]-x[0]"),
        ("START", "{2,0}"),
        ("PARTIAL", "row==0?column==1:column==0?-2*MU*x[0]*x[1]-1:MU*(1-x[0]*x[0])"),
    ],
};

/// An oscillator with this damping; without directional derivatives, the solver uses differences.
fn oscillator(folder: &TempDir, damping: &str, has_partial: bool) {
    let macros: Vec<(&str, String)> =
        VAN_DER_POL.macros.iter().map(|(key, text)| (*key, text.replace("MU", damping))).collect();
    let macros: Vec<(&str, &str)> = macros.iter().map(|(key, text)| (*key, text.as_str())).collect();
    let count = if has_partial { 3 } else { 2 };
    Ode { macros: &macros[..count], ..VAN_DER_POL }.pack(folder.path());
}

#[test]
fn the_error_of_an_oscillator_follows_the_tolerance() {
    let folder = TempDir::new().unwrap();
    oscillator(&folder, "1", false);
    let references = [(50, -0.837077450294764), (100, -2.00834078257971), (200, 2.00814976217495)];
    for (keys, accuracy) in [
        ("", 1e-4),
        ("tolerance = 1e-9", 1e-7),
        ("solver = \"rosenbrock\"\ntolerance = 1e-9", 1e-7),
        ("solver = \"runge_kutta\"\nmax_step = 1e-3", 1e-8),
    ] {
        let plan = plan(&folder, "VanDerPol", [20.0, 0.1], keys).unwrap();
        let recording = execute(&plan).unwrap();
        for (k, expected) in references {
            let found = column(&plan, &recording, "x0")[k];
            assert!((found - expected).abs() < accuracy, "{keys}: {k}: {found} {expected}");
        }
    }
}

#[test]
fn a_stiff_oscillator_is_solved_with_either_jacobian() {
    for has_partial in [true, false] {
        let folder = TempDir::new().unwrap();
        oscillator(&folder, "100", has_partial);
        for (tolerance, accuracy) in [(1e-6, 1e-4), (1e-9, 1e-6)] {
            let keys = format!("solver = \"rosenbrock\"\ntolerance = {tolerance:e}");
            let plan = plan(&folder, "VanDerPol", [100.0, 0.5], &keys).unwrap();
            let recording = execute(&plan).unwrap();
            for (k, expected) in [(100, 1.59682404097726), (200, -1.86892415988370)] {
                let found = column(&plan, &recording, "x0")[k];
                assert!((found - expected).abs() < accuracy, "{has_partial}, {tolerance}: {k}: {found} {expected}");
            }
        }
    }
}

/// x' = -3 x + u with x(0) = 0.
const LAG: Ode<'_> = Ode { name: "Lag", states: 1, macros: &[("F", "dx[0]=-3*x[0]+u"), ("START", "{0}")] };
/// y = sin 2t.
const SINE: Ode<'_> = Ode { name: "Sine", states: 1, macros: &[("Y", "sin(2*t)")] };

/// The references are the exact solutions for held and linear inputs. A held input changes in an event of each step but
/// the first, in which it is 0 as before; a line needs no event.
#[test]
fn inputs_are_held_or_linear() {
    let folder = TempDir::new().unwrap();
    LAG.pack(folder.path());
    SINE.pack(folder.path());
    let lag = "[[component]]\nname = \"lag\"\nfmu = \"Lag\"\ntolerance = 1e-12\ninputs = { d = 0.0 }\n";
    let sine = "[[component]]\nname = \"sine\"\nfmu = \"Sine\"\ninputs = { u = 0.0, d = 0.0 }\n";
    let held = (format!("{lag}{sine}"), 0.281185176165070, 100.0);
    let linear = (format!("extrapolation = \"linear\"\n{sine}{lag}"), 0.281510623067834, 1.0);
    for (components, expected, events) in [held, linear] {
        let text = format!(
            "title = \"Lag\"\n[simulation]\nstop = 1.0\nstep = 0.01\n{components}\
             [[connection]]\nfrom = \"sine:y\"\nto = \"lag:u\"\n[[case]]\nname = \"only\"\ntitle = \"Only\"\n\
             [record]\nsignals = [\"lag:x0\", \"lag:events\"]\n"
        );
        let plan = resolved(&folder, &text).unwrap();
        let recording = execute(&plan).unwrap();
        let found = column(&plan, &recording, "x0")[100];
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        assert_eq!(column(&plan, &recording, "events")[100], events);
    }
}

/// Steps are repeated from saved states, also over the bounces of the ball. Reference: the exact solution.
#[test]
fn steps_can_be_repeated_and_chosen_by_their_error() {
    let folder = TempDir::new().unwrap();
    [LAG, SINE, BALL].iter().for_each(|ode| ode.pack(folder.path()));
    for (key, accuracy) in [("error_control = { tolerance = 1e-6 }", 1e-3), ("iterate = { tolerance = 1e-9 }", 2e-2)] {
        let text = format!(
            "title = \"Lag\"\n[simulation]\nstop = 1.0\nstep = 0.05\n{key}\n\
             [[component]]\nname = \"sine\"\nfmu = \"Sine\"\ninputs = {{ u = 0.0, d = 0.0 }}\n\
             [[component]]\nname = \"lag\"\nfmu = \"Lag\"\ninputs = {{ d = 0.0 }}\n\
             [[component]]\nname = \"ball\"\nfmu = \"Ball\"\ninputs = {{ u = 0.0, d = 0.0 }}\n\
             [[connection]]\nfrom = \"sine:y\"\nto = \"lag:u\"\n[[case]]\nname = \"only\"\ntitle = \"Only\"\n\
             [record]\nsignals = [\"lag:x0\", \"ball:x0\"]\n"
        );
        let plan = resolved(&folder, &text).unwrap();
        let recording = execute(&plan).unwrap();
        let [lag, ball] = [0, 1].map(|index| recording.column(index).unwrap()[20]);
        assert!((lag - 0.281520006946697).abs() < accuracy, "{key}: {lag}");
        assert!((ball - 0.225059760719034).abs() < 1e-8, "{key}: {ball}");
    }
}

/// A step grows by 1 at 0.1 s, 0.2 s, …: the FMU rejects a time after the next event. The integral is exact.
const STAIR: Ode<'_> = Ode {
    name: "Stair",
    states: 2,
    macros: &[
        ("F", "dx[0]=0,dx[1]=x[0]"),
        ("START", "{0,0}"),
        ("EVENT", "if(t>0&&t>=i->next)x[0]+=1,i->count+=1;"),
        ("NEXT", "0.1*(i->count+1)"),
        ("Y", "i->count"),
        ("OVER", "x[0]>=5"),
    ],
};

#[test]
fn time_events_are_reached_exactly_and_may_end_the_run() {
    let folder = TempDir::new().unwrap();
    STAIR.pack(folder.path());
    // The fifth event ends the run, at the end of a step or within one.
    for (step, rows) in [(0.1, 6), (0.03, 17)] {
        let plan = plan(&folder, "Stair", [0.9, step], "").unwrap();
        let failure = execute(&plan).unwrap_err();
        assert_eq!(failure.kind, FailureKind::Terminated, "{failure}");
        let recording = failure.recorded.unwrap();
        assert_eq!(recording.time.len(), rows);
        for (k, time) in recording.time.iter().enumerate() {
            let count = (time * 10.0 + 1e-9).floor();
            let integral = 0.1 * count * (count - 1.0) / 2.0 + count * (time - 0.1 * count);
            assert_eq!(column(&plan, &recording, "x0")[k], count);
            assert!((column(&plan, &recording, "x1")[k] - integral).abs() < 1e-14, "{step}: {time}");
        }
    }
}

/// Events at the times of the rows belong to them, although 55 of 200 sums of time and step are not the next time; so do
/// those at the ends of longer and shorter steps, which have the same times because these are products with powers of 2.
#[test]
fn time_events_on_the_grid_are_in_their_rows_with_any_rate() {
    let folder = TempDir::new().unwrap();
    let macros: Vec<_> = STAIR.macros.iter().copied().filter(|(key, _)| *key != "OVER").collect();
    Ode { macros: &macros, ..STAIR }.pack(folder.path());
    for (step, keys, rows, events) in
        [(0.1, "", 1, 1), (0.05, "every = 2", 2, 1), (0.4, "substeps = 4", 1, 4), (0.2, "substeps = 3", 1, 2)]
    {
        let plan = plan(&folder, "Stair", [20.0, step], keys).unwrap();
        let recording = execute(&plan).unwrap();
        assert_eq!(recording.time.last(), Some(&20.0));
        for (k, row) in (0..recording.time.len()).step_by(rows).enumerate() {
            let count = (k * events) as f64;
            assert_eq!(column(&plan, &recording, "x0")[row], count, "{keys}: {k}");
            let integral = 0.1 * count * (count - 1.0) / 2.0;
            assert!((column(&plan, &recording, "x1")[row] - integral).abs() < 1e-10, "{keys}: {k}");
        }
    }
}

/// x' = -1 until x has fallen from 1 to 0.25. Below 0.2, nothing is defined, and long steps would end there.
#[test]
fn steps_into_an_undefined_region_are_tried_again_with_shorter_ones() {
    let folder = TempDir::new().unwrap();
    let macros = [
        ("F", "dx[0]=count>0?0:-1"),
        ("NZ", "1"),
        ("Z", "z[0]=x[0]-0.25"),
        ("EVENT", "if(x[0]<=0.25)i->count=1;"),
        ("UNDEFINED", "x[0]<0.2"),
    ];
    Ode { name: "Tank", states: 1, macros: &macros }.pack(folder.path());
    for keys in ["", "solver = \"rosenbrock\"", "solver = \"runge_kutta\"\nmax_step = 2.0"] {
        let plan = plan(&folder, "Tank", [4.0, 2.0], keys).unwrap();
        let recording = execute(&plan).unwrap();
        assert_eq!(column(&plan, &recording, "events")[2], 2.0, "{keys}");
        let x = column(&plan, &recording, "x0");
        assert!(x[1..].iter().all(|x| (x - 0.25).abs() < 1e-9), "{keys}: {x:?}");
    }
    // No step is short enough.
    Ode { name: "Dry", states: 1, macros: &[("UNDEFINED", "x[0]>0.5")] }.pack(folder.path());
    let failure = execute(&plan(&folder, "Dry", [1.0, 0.1], "solver = \"runge_kutta\"\nmax_step = 0.1").unwrap());
    let message = failure.unwrap_err().to_string();
    assert!(message.contains("`own`: fmi2GetEventIndicators returned fmi2Discard"), "{message}");
}

/// After the first steps, which save the first states and find the lengths of the solver's steps.
#[test]
fn repeating_a_step_does_not_allocate() {
    let folder = TempDir::new().unwrap();
    [LAG, SINE, BALL].iter().for_each(|ode| ode.pack(folder.path()));
    for key in
        ["iterate = {}", "error_control = { tolerance = 1e-2 }", "extrapolation = \"linear\"\nerror_control = {}"]
    {
        let text = format!(
            "title = \"Lag\"\n[simulation]\nstop = 1.0\nstep = 0.01\n{key}\n\
             [[component]]\nname = \"sine\"\nfmu = \"Sine\"\ninputs = {{ u = 0.0, d = 0.0 }}\n\
             [[component]]\nname = \"lag\"\nfmu = \"Lag\"\ninputs = {{ d = 0.0 }}\n\
             [[component]]\nname = \"ball\"\nfmu = \"Ball\"\ninputs = {{ u = 0.0, d = 0.0 }}\n\
             [[connection]]\nfrom = \"sine:y\"\nto = \"lag:u\"\n[[case]]\nname = \"only\"\ntitle = \"Only\"\n\
             [record]\nsignals = [\"lag:x0\"]\n"
        );
        let plan = resolved(&folder, &text).unwrap();
        let mut session = Session::new(&plan.simulation, &plan.runs[0], &Fmus::load(&plan.runs).unwrap()).unwrap();
        session.step().unwrap();
        let before = counting::allocations();
        (0..50).for_each(|_| session.step().unwrap());
        assert_eq!(counting::allocations(), before, "{key}");
    }
}

/// After the first step of the solver that ends after 0.1 s, the FMU asks for an event.
#[test]
fn the_fmu_may_ask_for_an_event_after_a_step() {
    let folder = TempDir::new().unwrap();
    let macros = [("AFTER", "t>0.1&&count==0"), ("EVENT", "if(t>0.1)i->count=t;"), ("Y", "i->count")];
    Ode { name: "Asking", states: 1, macros: &macros }.pack(folder.path());
    let plan = plan(&folder, "Asking", [0.4, 0.2], "solver = \"runge_kutta\"\nmax_step = 0.03").unwrap();
    let recording = execute(&plan).unwrap();
    // Steps of 0.2/7 s: the fourth ends after 0.1 s.
    assert!((column(&plan, &recording, "y")[1] - 0.2 * 4.0 / 7.0).abs() < 1e-15);
    assert_eq!(column(&plan, &recording, "events")[2], 2.0);
    assert_eq!(column(&plan, &recording, "steps")[2], 14.0);
}

/// A discrete input can be set in Event Mode only; the FMU rejects any other call.
#[test]
fn a_discrete_input_changes_in_events() {
    let folder = TempDir::new().unwrap();
    Ode { name: "Slope", states: 1, macros: &[("F", "dx[0]=d"), ("START", "{0}")] }.pack(folder.path());
    Ode { name: "Steps", states: 1, macros: &[("Y", "floor(t*4+1e-9)")] }.pack(folder.path());
    let text = "title = \"Slope\"\n[simulation]\nstop = 1.0\nstep = 0.05\n\
        [[component]]\nname = \"slope\"\nfmu = \"Slope\"\ninputs = { u = 0.0 }\n\
        [[component]]\nname = \"steps\"\nfmu = \"Steps\"\ninputs = { u = 0.0, d = 0.0 }\n\
        [[connection]]\nfrom = \"steps:y\"\nto = \"slope:d\"\n\
        [[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\nsignals = [\"slope:x0\", \"slope:events\"]\n";
    let plan = resolved(&folder, text).unwrap();
    let recording = execute(&plan).unwrap();
    assert!((column(&plan, &recording, "x0")[20] - 0.25 * (1.0 + 2.0 + 3.0)).abs() < 1e-14);
    assert_eq!(column(&plan, &recording, "events")[20], 1.0 + 3.0);
}

#[test]
fn a_restored_component_repeats_its_steps() {
    let folder = TempDir::new().unwrap();
    BALL.pack(folder.path());
    let plan = plan(&folder, "Ball", [2.0, 0.01], "").unwrap();
    let fmus = Fmus::load(&plan.runs).unwrap();
    let mut session = Session::new(&plan.simulation, &plan.runs[0], &fmus).unwrap();
    (0..30).for_each(|_| session.step().unwrap());
    let saved = session.save().unwrap();
    let mut rest = || {
        (30..200).for_each(|_| session.step().unwrap());
        let bits: Vec<u64> = session.bus().iter().map(|value| value.to_bits()).collect();
        session.restore(&saved).unwrap();
        bits
    };
    assert_eq!(rest(), rest());
}

#[test]
fn stiff_equations_need_another_solver() {
    let folder = TempDir::new().unwrap();
    Ode { name: "Stiff", states: 1, macros: &[("F", "dx[0]=-1e8*(x[0]-cos(t))")] }.pack(folder.path());
    let run = |keys| execute(&plan(&folder, "Stiff", [1.0, 1.0], keys).unwrap());
    let message = run("").unwrap_err().to_string();
    assert!(message.contains("more than 1000000 steps of the solver between 0 s and 0.0"), "{message}");
    assert!(message.contains("`solver = \"rosenbrock\"`"), "{message}");
    let plan = plan(&folder, "Stiff", [1.0, 1.0], "solver = \"rosenbrock\"").unwrap();
    let found = column(&plan, &execute(&plan).unwrap(), "x0")[1];
    assert!((found - f64::cos(1.0)).abs() < 1e-6, "{found}");
}

/// x' = -2 x, with a jump of 1 whenever x falls to 0.5. Tests both versions of FMI. The interface is selected by its key
/// or, without other interfaces, by default.
#[test]
fn both_versions_follow_the_closed_form() {
    for fmi in [FmiVersion::V2, FmiVersion::V3] {
        let folder = TempDir::new().unwrap();
        Decay::new(fmi).pack(folder.path());
        let (fmu, more) = match fmi {
            FmiVersion::V2 => ("Decay2", ""),
            FmiVersion::V3 => ("Decay3", ", flag = true, mode = \"second\""),
        };
        let text = format!(
            "title = \"Decay\"\n[simulation]\nstop = 2.0\nstep = 0.01\n[[component]]\nname = \"decay\"\n\
             fmu = \"{fmu}\"\ninterface = \"model-exchange\"\ntolerance = 1e-10\ninputs = {{ u = 0.25{more} }}\n\
             [[case]]\nname = \"only\"\ntitle = \"Only\"\n[record]\nsignals = [\"x\", \"y\", \"count\"]\n"
        );
        let plan = resolved(&folder, &text).unwrap();
        let recording = execute(&plan).unwrap();
        let (mut start, mut time, mut count) = (1.0_f64, 0.0, 0.0);
        for k in 0..=200 {
            let now = 0.01 * f64::from(k);
            while (start / 0.5).ln() / 2.0 + time <= now {
                time += (start / 0.5).ln() / 2.0;
                (start, count) = (1.5, count + 1.0);
            }
            let x = start * (-2.0 * (now - time)).exp();
            let row = k as usize;
            assert!((column(&plan, &recording, "x")[row] - x).abs() < 1e-8, "{fmi}: {now}");
            assert_eq!(column(&plan, &recording, "count")[row], count, "{fmi}: {now}");
            assert!((column(&plan, &recording, "y")[row] - x - 0.25).abs() < 1e-8);
        }
    }
}

#[test]
fn keys_that_do_not_fit_are_rejected() {
    let folder = TempDir::new().unwrap();
    LAG.pack(folder.path());
    Decay::new(FmiVersion::V2).pack(folder.path());
    for (fmu, keys, message) in [
        ("Lag", "interface = \"co-simulation\"", "Lag.fmu has no interface for co-simulation, only for model exchange"),
        ("Lag", "kind = \"discrete\"", "a component in model exchange must be continuous"),
        ("Lag", "tolerance = 0.0", "`tolerance` must be from 1e-14 to 0.1, got 0"),
        ("Lag", "max_step = 0.1", "this solver has `tolerance`, not `max_step`"),
        ("Lag", "solver = \"runge_kutta\"", "`runge_kutta` needs `max_step`, in s, from 1e-6 to 1000000"),
        ("Lag", "solver = \"runge_kutta\"\ntolerance = 1e-6", "this solver has `max_step`, not `tolerance`"),
        ("Lag", "solver = \"euler\"", "unknown word `euler`"),
        ("Decay2", "solver = \"rosenbrock\"", "Decay2.fmu is used for co-simulation"),
    ] {
        let error = plan(&folder, fmu, [1.0, 0.1], keys).unwrap_err();
        assert!(error.contains(message), "{error}");
    }
}
