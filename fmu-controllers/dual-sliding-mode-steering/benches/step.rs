//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<dual_sliding_mode_steering::DualSlidingModeSteering>();
}
