//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<brake_and_drive_actuators::BrakeAndDriveActuators>();
}
