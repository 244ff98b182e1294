//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<handling_sliding_mode::HandlingSlidingMode>();
}
