//! The catalogue of signals: an output and an input of the same name are the same signal, in every FMU.
//!
//! A family appends the place to the name, for example `road_height.fl`.
//!
//! The number after the display unit is the nominal value: the usual peak, rounded to 1, 2 or 5 times a power of ten. It
//! is the same for all vehicles, from 1.5 t to 36 t.

use fmi2::unit::*;
use fmi2::{Role, Signal};

macro_rules! signals {
    ($($name:ident, $text:literal, $unit:expr, $display:expr, $nominal:literal, $role:ident, $description:literal;)*) => {
        $(
            #[doc = concat!("`", $text, "`: ", $description, ".")]
            pub const $name: Signal = Signal {
                name: $text,
                unit: $unit,
                display: $display,
                nominal: $nominal,
                role: Role::$role,
                description: $description,
            };
        )*
        /// Every signal of the library.
        pub const ALL: &[Signal] = &[$($name),*];
    };
}

signals! {
    // What the driver asks for
    DRIVER_STEER, "driver.steer", RAD, Some("deg"), 0.1, Driver, "Road-wheel angle of the front axle that the driver asks for, positive to the left";
    DRIVER_THROTTLE, "driver.throttle", ONE, None, 1.0, Driver, "Position of the accelerator pedal, 0 to 1";
    DRIVER_BRAKE, "driver.brake", ONE, None, 1.0, Driver, "Position of the brake pedal, 0 to 1";
    DRIVER_SPEED, "driver.speed", M_PER_S, Some("km/h"), 20.0, Driver, "Longitudinal speed that is prescribed";
    // Road
    ROAD_HEIGHT, "road_height", M, Some("mm"), 0.1, Environment, "Height of the road under the {}, upwards";
    ROAD_FRICTION, "road_friction", ONE, None, 1.0, Environment, "Factor on the tire friction of the {}";
    ROAD_DISTANCE, "road.distance", M, None, 100.0, Measurement, "Distance traveled by the front axle";
    // Motion of the vehicle
    VEHICLE_SPEED, "vehicle.speed", M_PER_S, Some("km/h"), 20.0, Measurement, "Longitudinal speed";
    VEHICLE_LATERAL_VELOCITY, "vehicle.lateral_velocity", M_PER_S, None, 0.5, Measurement, "Lateral velocity of the reference point under the center of mass, to the left";
    VEHICLE_LONGITUDINAL_ACCELERATION, "vehicle.longitudinal_acceleration", M_PER_S2, None, 5.0, Measurement, "Longitudinal acceleration of the reference point";
    VEHICLE_LATERAL_ACCELERATION, "vehicle.lateral_acceleration", M_PER_S2, None, 5.0, Measurement, "Lateral acceleration of the reference point, to the left";
    VEHICLE_SIDESLIP, "vehicle.sideslip", RAD, Some("deg"), 0.1, Measurement, "Sideslip angle of the reference point";
    VEHICLE_YAW, "vehicle.yaw", RAD, Some("deg"), 0.5, Measurement, "Heading in the road plane, positive to the left";
    VEHICLE_YAW_RATE, "vehicle.yaw_rate", RAD_PER_S, Some("deg/s"), 0.5, Measurement, "Yaw rate, positive to the left";
    VEHICLE_YAW_ACCELERATION, "vehicle.yaw_acceleration", RAD_PER_S2, Some("deg/s2"), 1.0, Measurement, "Yaw acceleration, positive to the left";
    VEHICLE_POSITION_X, "vehicle.position_x", M, None, 100.0, Measurement, "Position in the road plane along the initial heading";
    VEHICLE_POSITION_Y, "vehicle.position_y", M, None, 10.0, Measurement, "Position in the road plane to the left of the initial heading";
    VEHICLE_LOAD_TRANSFER_RATIO, "vehicle.load_transfer_ratio", ONE, None, 1.0, Measurement, "Right minus left tire loads over their sum, positive in a left turn";
    VEHICLE_LOAD_TRANSFER_ESTIMATE, "vehicle.load_transfer_estimate", ONE, None, 1.0, Measurement, "The load transfer ratio estimated from lateral acceleration and roll";
    // Motion of the body
    BODY_HEAVE, "body.heave", M, Some("mm"), 0.05, Measurement, "Height of the sprung mass above static equilibrium";
    BODY_HEAVE_RATE, "body.heave_rate", M_PER_S, Some("mm/s"), 0.2, Measurement, "Vertical velocity of the sprung mass";
    BODY_HEAVE_ACCELERATION, "body.heave_acceleration", M_PER_S2, None, 5.0, Measurement, "Vertical acceleration of the sprung mass";
    BODY_ROLL, "body.roll", RAD, Some("deg"), 0.1, Measurement, "Roll angle of the body, positive when it leans right";
    BODY_ROLL_RATE, "body.roll_rate", RAD_PER_S, Some("deg/s"), 0.5, Measurement, "Roll rate of the body";
    BODY_ROLL_ACCELERATION, "body.roll_acceleration", RAD_PER_S2, Some("deg/s2"), 5.0, Measurement, "Roll acceleration of the body";
    BODY_PITCH, "body.pitch", RAD, Some("deg"), 0.02, Measurement, "Pitch angle of the body, positive nose down";
    BODY_PITCH_RATE, "body.pitch_rate", RAD_PER_S, Some("deg/s"), 0.2, Measurement, "Pitch rate of the body";
    BODY_PITCH_ACCELERATION, "body.pitch_acceleration", RAD_PER_S2, Some("deg/s2"), 1.0, Measurement, "Pitch acceleration of the body";
    CORNER_ACCELERATION, "corner_acceleration", M_PER_S2, None, 5.0, Measurement, "Vertical acceleration of the body above the {}";
    // Wheels, suspension, tires
    WHEEL_HEIGHT, "wheel_height", M, Some("mm"), 0.1, Measurement, "Height of the unsprung mass above static equilibrium, {}";
    WHEEL_VELOCITY, "wheel_velocity", M_PER_S, Some("mm/s"), 1.0, Measurement, "Vertical velocity of the unsprung mass, {}";
    WHEEL_SPEED, "wheel_speed", RAD_PER_S, Some("rpm"), 100.0, Measurement, "Speed of rotation of the {}, positive when it rolls forwards";
    BEAM_HEIGHT, "beam_height", M, Some("mm"), 0.02, Measurement, "Height of the balance beam's trunnion above static equilibrium, {}";
    BEAM_PITCH, "beam_pitch", RAD, Some("deg"), 0.02, Measurement, "Pitch angle of the balance beam, positive when its front end is low, {}";
    BEAM_PITCH_RATE, "beam_pitch_rate", RAD_PER_S, Some("deg/s"), 0.5, Measurement, "Pitch rate of the balance beam, {}";
    SUSPENSION_DEFLECTION, "suspension_deflection", M, Some("mm"), 0.1, Measurement, "Body attachment height minus wheel height (compression negative), {}";
    SUSPENSION_VELOCITY, "suspension_velocity", M_PER_S, Some("mm/s"), 1.0, Measurement, "Rate of the suspension deflection, {}";
    TIRE_DEFLECTION, "tire_deflection", M, Some("mm"), 0.02, Measurement, "Wheel height minus road height (compression negative), {}";
    TIRE_LOAD, "tire_load", N, Some("kN"), 2e4, Measurement, "Compressive force on the road, static load included, {}";
    TIRE_LATERAL_FORCE, "tire_lateral_force", N, Some("kN"), 1e4, Measurement, "Lateral tire force on the vehicle in the frame of the wheel, to the left, {}";
    TIRE_LONGITUDINAL_FORCE, "tire_longitudinal_force", N, Some("kN"), 5e3, Measurement, "Longitudinal tire force on the vehicle in the frame of the wheel, forwards, {}";
    TIRE_SLIP_ANGLE, "tire_slip_angle", RAD, Some("deg"), 0.1, Measurement, "Direction of travel minus direction of the wheel, {}";
    TIRE_LONGITUDINAL_SLIP, "tire_longitudinal_slip", ONE, Some("%"), 1.0, Measurement, "Slip of the {}: braking negative, -1 locked";
    BRAKE_PRESSURE, "brake_pressure", MPA, Some("bar"), 10.0, Measurement, "Brake pressure of the {}";
    BRAKE_MASTER_PRESSURE, "brake.master_pressure", MPA, Some("bar"), 10.0, Measurement, "Brake pressure that the driver's pedal makes";
    // Commands to a plant
    STEER, "steer", RAD, Some("deg"), 0.1, Command, "Steering angle of the {}, positive to the left";
    SUSPENSION_FORCE, "suspension_force", N, Some("kN"), 1e4, Command, "Actuator force of the {}, pushing the body up and the wheel down";
    BRAKE_TORQUE, "brake_torque", N_M, Some("kN.m"), 1e3, Command, "Brake torque on the {}, not negative; it acts against the rotation";
    DRIVE_TORQUE, "drive_torque", N_M, Some("kN.m"), 500.0, Command, "Drive torque on the {}, forwards positive";
    BRAKE_PRESSURE_COMMAND, "brake_pressure_command", MPA, Some("bar"), 10.0, Command, "Brake pressure that is asked for at the {}";
    // Between controllers
    STEER_REQUEST, "steer_request", RAD, Some("deg"), 0.2, Internal, "Steering command of the {} before angle and rate limits";
    STEER_CORRECTION, "steer_correction", RAD, Some("deg"), 0.02, Internal, "Angle that active steering of the {} adds to what the driver asks for";
    STEER_RATIO, "steer_ratio", ONE, None, 1.0, Internal, "Steering angle of the {} over what the driver asks for";
    REFERENCE_YAW_RATE, "reference.yaw_rate", RAD_PER_S, Some("deg/s"), 0.2, Internal, "Yaw rate that a lateral controller follows";
    REFERENCE_SIDESLIP, "reference.sideslip", RAD, Some("deg"), 0.05, Internal, "Sideslip angle that a lateral controller follows";
    SLIDING_SURFACE_SIDESLIP, "sliding_surface.sideslip", RAD, None, 0.05, Internal, "Value of the sliding surface of the sideslip angle";
    SLIDING_SURFACE_YAW_RATE, "sliding_surface.yaw_rate", RAD_PER_S, None, 0.5, Internal, "Value of the sliding surface of the yaw rate";
    SLIDING_SURFACE_COMFORT, "sliding_surface.comfort", M_PER_S, None, 0.5, Internal, "Value of the sliding surface of the comfort law";
    SLIDING_SURFACE_HANDLING, "sliding_surface.handling", RAD_PER_S, None, 1.0, Internal, "Value of the sliding surface of the handling law";
    WEIGHT_INTEGRATED, "weight.integrated", ONE, None, 1.0, Internal, "Share of the integrated suspension law";
    WEIGHT_ROLL, "weight.roll", ONE, None, 1.0, Internal, "Share of the roll suspension law";
    WEIGHT_STEERING, "weight.steering", ONE, None, 1.0, Internal, "Multi-axle steering is on when above 0.5";
    INTEGRATED_FORCE, "integrated_force", N, Some("kN"), 5e4, Internal, "Suspension force that the integrated law proposes for the {}";
    ROLL_FORCE, "roll_force", N, Some("kN"), 5e4, Internal, "Suspension force that the roll law proposes for the {}";
    COMFORT_FORCE, "comfort_force", N, Some("kN"), 1e4, Internal, "Suspension force that the comfort law proposes for the {}";
    HANDLING_FORCE, "handling_force", N, Some("kN"), 1e4, Internal, "Suspension force that the handling law proposes for the {}";
    SWITCH_MODE, "switch.mode", ONE, None, 1.0, Internal, "Suspension law that is chosen: 0 comfort, 1 handling";
    SWITCH_BLEND, "switch.blend", ONE, None, 1.0, Internal, "Share of the handling law in the suspension force";
    COORDINATION_STATE, "coordination.state", ONE, None, 1.0, Internal, "Driving state: 0 not coordinated, 1 uniform, 2 accelerating, 3 braking, 4 turning, 5 turning and braking, 6 turning and accelerating";
    ENABLE_SUSPENSION, "enable.suspension", ONE, None, 1.0, Internal, "The suspension law is on when above 0.5";
    ENABLE_ANTILOCK, "enable.antilock", ONE, None, 1.0, Internal, "The antilock logic is on when above 0.5";
    ENABLE_YAW_CONTROL, "enable.yaw_control", ONE, None, 1.0, Internal, "The yaw control is on when above 0.5";
    SUSPENSION_PROPORTIONAL_GAIN, "suspension_proportional_gain", KG, None, 100.0, Internal, "Force of the suspension law per change of the body's acceleration from sample to sample, {}";
    SUSPENSION_INTEGRAL_GAIN, "suspension_integral_gain", KG, None, 1.0, Internal, "Force that the suspension law adds in a sample, per acceleration of the body, {}";
    SUSPENSION_DERIVATIVE_GAIN, "suspension_derivative_gain", KG, None, 5.0, Internal, "Force of the suspension law per second difference of the body's acceleration, {}";
    TARGET_SLIP, "target_slip", ONE, Some("%"), 0.2, Internal, "Braking slip that the antilock logic keeps, positive, {}";
    ANTILOCK_ACTIVE, "antilock_active", ONE, None, 1.0, Internal, "1 while the antilock logic modulates the pressure of the {}, else 0";
    YAW_CONTROL_PRESSURE, "yaw_control_pressure", MPA, Some("bar"), 10.0, Internal, "Brake pressure that yaw control adds at the {}, not negative";
    DEMAND_YAW_MOMENT, "demand.yaw_moment", N_M, Some("kN.m"), 5e3, Internal, "Yaw moment that a controller asks for, positive to the left";
    DEMAND_HEAVE_FORCE, "demand.heave_force", N, Some("kN"), 1e4, Internal, "Vertical force that a controller wants on the body, before it is shared out";
    DEMAND_PITCH_MOMENT, "demand.pitch_moment", N_M, Some("kN.m"), 2e4, Internal, "Pitch moment that a controller wants on the body, before it is shared out";
    DEMAND_ROLL_MOMENT, "demand.roll_moment", N_M, Some("kN.m"), 1e4, Internal, "Roll moment that a controller wants on the body, before it is shared out";
    FRONT_STEERING_PROPORTIONAL_GAIN, "front_steering.proportional_gain", S, None, 0.5, Internal, "Proportional gain of active front steering after the fuzzy correction";
    FRONT_STEERING_INTEGRAL_GAIN, "front_steering.integral_gain", ONE, None, 2.0, Internal, "Integral gain of active front steering after the fuzzy correction";
    FRONT_STEERING_DERIVATIVE_GAIN, "front_steering.derivative_gain", S2, None, 0.02, Internal, "Derivative gain of active front steering after the fuzzy correction";
    ALL_WHEEL_STEERING_PROPORTIONAL_GAIN, "all_wheel_steering.proportional_gain", PER_RAD, None, 10.0, Internal, "Proportional gain of all-wheel steering after the fuzzy correction";
    ALL_WHEEL_STEERING_INTEGRAL_GAIN, "all_wheel_steering.integral_gain", PER_RAD_S, None, 20.0, Internal, "Integral gain of all-wheel steering after the fuzzy correction";
    ALL_WHEEL_STEERING_DERIVATIVE_GAIN, "all_wheel_steering.derivative_gain", S_PER_RAD, None, 0.2, Internal, "Derivative gain of all-wheel steering after the fuzzy correction";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_display_units_exist() {
        let mut names: Vec<_> = ALL.iter().map(|signal| signal.name).collect();
        names.sort_unstable();
        assert!(names.windows(2).all(|pair| pair[0] != pair[1]));
        for signal in ALL {
            let exists = signal.display.is_none_or(|display| signal.unit.display_unit(display).is_some());
            assert!(exists, "{} cannot be displayed in {:?}", signal.name, signal.display);
        }
    }
}
