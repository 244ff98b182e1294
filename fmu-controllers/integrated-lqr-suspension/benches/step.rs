//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<integrated_lqr_suspension::IntegratedLqrSuspension>();
}
