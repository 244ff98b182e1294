//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<comfort_sliding_mode::ComfortSlidingMode>();
}
