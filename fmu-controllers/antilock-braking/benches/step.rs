//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<antilock_braking::AntilockBraking>();
}
