//! Time of a communication step of every model, directly and through the C interface.

fn main() {
    bench::compare::<active_front_steering::ActiveFrontSteering>();
    bench::compare::<all_wheel_steering::AllWheelSteering>();
    bench::compare::<antilock_braking::AntilockBraking>();
    bench::compare::<comfort_sliding_mode::ComfortSlidingMode>();
    bench::compare::<direct_yaw_control::DirectYawControl>();
    bench::compare::<dual_sliding_mode_steering::DualSlidingModeSteering>();
    bench::compare::<finite_state_coordination::FiniteStateCoordination>();
    bench::compare::<front_steering_actuator::FrontSteeringActuator>();
    bench::compare::<fuzzy_coordination::FuzzyCoordination>();
    bench::compare::<handling_sliding_mode::HandlingSlidingMode>();
    bench::compare::<integrated_lqr_suspension::IntegratedLqrSuspension>();
    bench::compare::<roll_lqr_suspension::RollLqrSuspension>();
    bench::compare::<semi_active_fuzzy_suspension::SemiActiveFuzzySuspension>();
    bench::compare::<semi_active_pid_suspension::SemiActivePidSuspension>();
    bench::compare::<suspension_mixer::SuspensionMixer>();
    bench::compare::<suspension_switch::SuspensionSwitch>();
    bench::compare::<yaw_rate_reference::YawRateReference>();
    bench::compare::<actuator::Actuator>();
    bench::compare::<bicycle_car::BicycleCar>();
    bench::compare::<brake_and_drive_actuators::BrakeAndDriveActuators>();
    bench::compare::<driver::Driver>();
    bench::compare::<esp_car::EspCar>();
    bench::compare::<heavy_vehicle::HeavyVehicle>();
    bench::compare::<hydro_pneumatic_half_car::HydroPneumaticHalfCar>();
    bench::compare::<path_driver::PathDriver>();
    bench::compare::<rescue_vehicle::RescueVehicle>();
    bench::compare::<road::Road>();
    bench::compare::<sensor::Sensor>();
}
