//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<semi_active_fuzzy_suspension::SemiActiveFuzzySuspension>();
}
