//! The counter is 1 at the start and grows by 1 at each second. At 9 s it is 10, which ends the simulation.

use fmu::simulation::ContinuousSimulation;
use stair::{LAST, Stair};

#[test]
fn the_counter_grows_each_second_until_the_simulation_ends() {
    for step in [0.25, 3.0, 20.0] {
        let mut run = ContinuousSimulation::new(Stair).expect("it starts");
        assert_eq!(run.outputs(&()).counter, 1);
        while !run.is_finished() {
            run.step(&(), step).expect("a step");
            // Multiples of the steps are exact.
            assert_eq!(run.outputs(&()).counter, 1 + run.time().floor() as i32);
        }
        assert_eq!((run.time(), run.outputs(&()).counter), (9.0, LAST), "steps of {step} s");
        run.step(&(), step).expect("a step that does not advance the time");
        assert_eq!((run.time(), run.outputs(&()).counter), (9.0, LAST));
    }
}
