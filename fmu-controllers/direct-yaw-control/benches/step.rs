//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<direct_yaw_control::DirectYawControl>();
}
