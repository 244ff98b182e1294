//! Terminals of FMI 3.0. Reference: FMI 3.0.2, section 2.4.9 (members, matching rules, nested terminals, unique names),
//! and the suggested names `terminal.member` of its examples.

use std::path::Path;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::description::{Description, Format};

use crate::models::Carts;

#[derive(Parameters)]
pub(crate) struct Motor {
    /// Inertia (kg.m2)
    #[var(start = 1.0, positive)]
    inertia: f64,
}

#[derive(State)]
pub(crate) struct Spin<T> {
    /// Speed (rad/s)
    spin: T,
}

#[derive(Inputs)]
pub(crate) struct FlangeInputs<T> {
    /// Torque (N.m)
    torque: T,
}

#[derive(Inputs)]
pub(crate) struct MotorInputs<T> {
    /// Shaft
    #[var(nested, terminal = "shaft")]
    flange: FlangeInputs<T>,
    /// Current of the {} (A)
    current: Carts<T>,
}

#[derive(Outputs)]
pub(crate) struct Status<T> {
    /// Temperatures (K)
    temperature: [T; 2],
    /// Too hot
    hot: bool,
}

#[derive(Outputs)]
pub(crate) struct FlangeOutputs<T> {
    /// Speed (rad/s)
    speed: T,
    #[var(nested, terminal = "bus", rule = "bus")]
    status: Status<T>,
    #[var(nested)]
    raw: Raw<T>,
}

#[derive(Outputs)]
pub(crate) struct Raw<T> {
    /// Angle in steps (1)
    #[var("steps", fmi = 3)]
    angle: T,
}

#[derive(Outputs)]
pub(crate) struct Probes<T> {
    /// Power (W)
    power: T,
}

#[derive(Outputs)]
pub(crate) struct MotorOutputs<T> {
    #[var(nested = "axis.flange", terminal = "shaft")]
    flange: FlangeOutputs<T>,
    #[var(flatten, terminal = "probes", rule = "org.example.probes")]
    probes: Probes<T>,
}

/// Motor
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Motor {
    type State<T: Scalar> = Spin<T>;
    type Inputs<T: Scalar> = MotorInputs<T>;
    type Outputs<T: Scalar> = MotorOutputs<T>;
    fn evaluate<T: Scalar>(&self, at: At<T, Self>) -> (Spin<T>, MotorOutputs<T>) {
        let (torque, speed) = (at.inputs.flange.torque, at.state.spin);
        let status = Status { temperature: [speed, torque], hot: false };
        let flange = FlangeOutputs { speed, status, raw: Raw { angle: speed } };
        let slope = torque + at.inputs.current[0] + at.inputs.current[1];
        (Spin { spin: slope / self.inertia }, MotorOutputs { flange, probes: Probes { power: torque * speed } })
    }
}

const ARRAYS: Format = Format { arrays: true, ..Format::FMI3 };

fn terminals<E: Export>(format: Format) -> String {
    let xml = Description::of::<E::Model>(format, Path::new("")).terminals(format);
    let lines: Vec<_> = xml.lines().skip_while(|line| !line.contains("<Terminals>")).collect();
    lines.join("\n")
}

/// Inputs and outputs with the same terminal are members of one; a nested struct without one belongs to the terminal
/// around it. The members of terminals are whole variables, with `--arrays` whole arrays.
#[test]
fn nested_structs_are_terminals() {
    let member = |indent: usize, variable: &str, member: &str| {
        let space = " ".repeat(indent);
        let kind = "variableKind=\"signal\"/>";
        format!("{space}<TerminalMemberVariable variableName=\"{variable}\" memberName=\"{member}\" {kind}\n")
    };
    for (format, elements) in [(Format::FMI3, &["[1]", "[2]"][..]), (ARRAYS, &[""][..])] {
        let temperatures = elements.iter().map(|element| {
            member(8, &format!("axis.flange.status.temperature{element}"), &format!("temperature{element}"))
        });
        let expected = [
            "  <Terminals>\n".to_owned(),
            "    <Terminal name=\"l\" matchingRule=\"bus\" description=\"Signals of the element l\">\n".to_owned(),
            member(6, "current.l", "current"),
            "    </Terminal>\n".to_owned(),
            "    <Terminal name=\"r\" matchingRule=\"bus\" description=\"Signals of the element r\">\n".to_owned(),
            member(6, "current.r", "current"),
            "    </Terminal>\n".to_owned(),
            "    <Terminal name=\"shaft\" matchingRule=\"plug\" description=\"Shaft\">\n".to_owned(),
            member(6, "flange.torque", "torque"),
            member(6, "axis.flange.speed", "speed"),
            member(6, "axis.flange.raw.steps", "raw.steps"),
            "      <Terminal name=\"bus\" matchingRule=\"bus\">\n".to_owned(),
            temperatures.collect(),
            member(8, "axis.flange.status.hot", "hot"),
            "      </Terminal>\n    </Terminal>\n".to_owned(),
            "    <Terminal name=\"probes\" matchingRule=\"org.example.probes\">\n".to_owned(),
            member(6, "power", "power"),
            "    </Terminal>\n  </Terminals>\n</fmiTerminalsAndIcons>".to_owned(),
        ];
        assert_eq!(terminals::<Motor>(format), expected.concat());
    }
}
