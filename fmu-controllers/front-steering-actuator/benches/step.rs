//! Cost of a step, directly and through the C interface.

fn main() {
    bench::compare::<front_steering_actuator::FrontSteeringActuator>();
}
