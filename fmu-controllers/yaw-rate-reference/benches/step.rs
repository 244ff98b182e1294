//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<yaw_rate_reference::YawRateReference>();
}
