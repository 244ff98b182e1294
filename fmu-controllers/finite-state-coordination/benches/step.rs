//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<finite_state_coordination::FiniteStateCoordination>();
}
