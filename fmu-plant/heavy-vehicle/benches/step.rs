//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<heavy_vehicle::HeavyVehicle>();
}
