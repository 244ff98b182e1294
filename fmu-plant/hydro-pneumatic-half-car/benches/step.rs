//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<hydro_pneumatic_half_car::HydroPneumaticHalfCar>();
}
