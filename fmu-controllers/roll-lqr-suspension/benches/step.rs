//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<roll_lqr_suspension::RollLqrSuspension>();
}
