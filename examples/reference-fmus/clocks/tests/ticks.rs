//! Counts of ticks. Reference: the published model in scheduled execution, with `inClock1` every second and `inClock2`
//! at 0, 1, 8 and 9 s, where `input2` is 10.

use clocks::{Clocks, U};
use fmu::simulation::ClockedSimulation;

#[test]
fn the_clocks_tick_as_often_as_those_of_the_published_model() {
    // Ticks of the three clocks and their sum, result2, output3, and true if outClock ticks at this time.
    const EXPECTED: [([i32; 4], i32, i32, bool); 10] = [
        ([1, 1, 0, 2], 10, 0, false),
        ([2, 2, 0, 4], 20, 0, false),
        ([3, 2, 0, 5], 20, 0, true),
        ([4, 2, 0, 6], 20, 0, false),
        ([5, 2, 1, 8], 20, 1000, false),
        ([6, 2, 1, 9], 20, 1000, false),
        ([7, 2, 1, 10], 20, 1000, true),
        ([8, 2, 1, 11], 20, 1000, false),
        ([9, 3, 1, 13], 30, 1000, false),
        ([10, 4, 1, 15], 40, 1000, true),
    ];
    let mut run = ClockedSimulation::new(Clocks).expect("it starts");
    let inputs = U { input2: 10 };
    for (second, expected) in EXPECTED.into_iter().enumerate() {
        // Before the tick of inClock1, which follows in the step.
        let first = [0, 1, 8, 9].contains(&second).then(|| run.trigger(&inputs, &["inClock2"]).expect("a clock"));
        let y = run.step(&inputs, 1.0).expect("it goes on");
        let ticks = [y.in_clock1_ticks, y.in_clock2_ticks, y.in_clock3_ticks, y.total_in_clock_ticks];
        let has_fired = y.out_clock.has_fired() || first.is_some_and(|y| y.out_clock.has_fired());
        assert_eq!((ticks, y.result2, y.output3, has_fired), expected, "at {second} s");
    }
}
