//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<all_wheel_steering::AllWheelSteering>();
}
