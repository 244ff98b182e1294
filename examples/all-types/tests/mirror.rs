//! The outputs are copies of the inputs or the parameters.

use all_types::{AllTypes, Gear, U, Y};
use fmu::simulation::ContinuousSimulation;

#[test]
fn outputs_mirror_inputs_or_parameters() {
    let mut run = ContinuousSimulation::new(AllTypes::default()).expect("it starts");
    let mut inputs = U {
        select_parameters: false,
        real: -0.25,
        integer: i32::MIN,
        boolean: true,
        string: "ä ≤ \"b\"".to_owned(),
        gear: Gear::Reverse,
        listed_gear: Gear::Drive,
    };
    let expected = Y {
        real: -0.25,
        integer: i32::MIN,
        boolean: true,
        string: "ä ≤ \"b\"".to_owned(),
        gear: Gear::Reverse,
        listed_gear: Gear::Drive,
    };
    assert_eq!(run.outputs(&inputs), expected);
    inputs.select_parameters = true;
    let expected = Y {
        real: 1.5,
        integer: -3,
        boolean: true,
        string: "parameter".to_owned(),
        gear: Gear::Neutral,
        listed_gear: Gear::Drive,
    };
    assert_eq!(run.outputs(&inputs), expected);
    run.step(&inputs, 0.1).expect("a step");
    assert_eq!(run.outputs(&inputs), expected);
}
