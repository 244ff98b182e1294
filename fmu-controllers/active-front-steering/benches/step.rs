//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<active_front_steering::ActiveFrontSteering>();
}
