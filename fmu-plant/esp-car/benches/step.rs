//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<esp_car::EspCar>();
}
