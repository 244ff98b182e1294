//! The catalogue of signals. A name has the same meaning in every FMU, so outputs and inputs of the same name connect.
//!
//! An array appends the name of its element, for example `road_height.fl`.
//!
//! The number after the display unit is the nominal value: the usual peak, rounded to 1, 2 or 5 times a power of ten.
//! It is the same for all vehicles, from 1.5 t to 36 t.

use fmu::{Definition, Range, unit};

macro_rules! signals {
    ($($name:ident, $text:literal, $unit:expr, $display:expr, $nominal:literal, $description:literal;)*) => {
        $(
            #[doc = concat!("`", $text, "`: ", $description, ".")]
            pub const $name: Definition = Definition {
                name: $text,
                unit: $unit,
                display: $display,
                nominal: Some($nominal),
                range: Range::Any,
                description: $description,
            };
        )*
        /// Every signal of the library.
        pub const ALL: &[Definition] = &[$($name),*];
    };
}

signals! {
    // Driver demands
    DRIVER_STEER, "driver.steer", unit!("rad"), Some("deg"), 0.1, "Front road-wheel angle demanded by the driver, positive to the left";
    DRIVER_THROTTLE, "driver.throttle", unit!("1"), None, 1.0, "Position of the accelerator pedal, 0 to 1";
    DRIVER_BRAKE, "driver.brake", unit!("1"), None, 1.0, "Position of the brake pedal, 0 to 1";
    DRIVER_SPEED, "driver.speed", unit!("m/s"), Some("km/h"), 20.0, "Prescribed longitudinal speed";
    DRIVER_STEERING_WHEEL, "driver.steering_wheel", unit!("rad"), Some("deg"), 1.0, "Angle of the steering wheel, positive to the left";
    // Path that the driver follows
    PATH_LATERAL_DEVIATION, "path.lateral_deviation", unit!("m"), None, 5.0, "Distance of the vehicle from the path, positive to the left of it";
    PATH_HEADING_ERROR, "path.heading_error", unit!("rad"), Some("deg"), 0.1, "Heading of the vehicle minus the heading of the path";
    PATH_DISTANCE, "path.distance", unit!("m"), None, 100.0, "Station of the vehicle along the path";
    PATH_FINISHED, "path.finished", unit!("1"), None, 1.0, "Whether the end of the maneuver was reached";
    PATH_LOST, "path.lost", unit!("1"), None, 1.0, "Whether the vehicle went too far from the path";
    // Road
    ROAD_HEIGHT, "road_height", unit!("m"), Some("mm"), 0.1, "Height of the road under the {}, upwards";
    ROAD_FRICTION, "road_friction", unit!("1"), None, 1.0, "Factor on the tire friction of the {}";
    ROAD_DISTANCE, "road.distance", unit!("m"), None, 100.0, "Distance traveled by the front axle";
    // Motion of the vehicle
    VEHICLE_SPEED, "vehicle.speed", unit!("m/s"), Some("km/h"), 20.0, "Longitudinal speed";
    VEHICLE_LATERAL_VELOCITY, "vehicle.lateral_velocity", unit!("m/s"), None, 0.5, "Lateral velocity of the reference point under the center of mass, to the left";
    VEHICLE_LONGITUDINAL_ACCELERATION, "vehicle.longitudinal_acceleration", unit!("m/s2"), None, 5.0, "Longitudinal acceleration of the reference point";
    VEHICLE_LATERAL_ACCELERATION, "vehicle.lateral_acceleration", unit!("m/s2"), None, 5.0, "Lateral acceleration of the reference point, to the left";
    VEHICLE_SIDESLIP, "vehicle.sideslip", unit!("rad"), Some("deg"), 0.1, "Sideslip angle of the reference point";
    VEHICLE_YAW, "vehicle.yaw", unit!("rad"), Some("deg"), 0.5, "Heading in the road plane, positive to the left";
    VEHICLE_YAW_RATE, "vehicle.yaw_rate", unit!("rad/s"), Some("deg/s"), 0.5, "Yaw rate, positive to the left";
    VEHICLE_YAW_ACCELERATION, "vehicle.yaw_acceleration", unit!("rad/s2"), Some("deg/s2"), 1.0, "Yaw acceleration, positive to the left";
    VEHICLE_POSITION_X, "vehicle.position_x", unit!("m"), None, 100.0, "Position in the road plane along the initial heading";
    VEHICLE_POSITION_Y, "vehicle.position_y", unit!("m"), None, 10.0, "Position in the road plane to the left of the initial heading";
    VEHICLE_LOAD_TRANSFER_RATIO, "vehicle.load_transfer_ratio", unit!("1"), None, 1.0, "Right minus left tire loads over their sum, positive in a left turn";
    VEHICLE_LOAD_TRANSFER_ESTIMATE, "vehicle.load_transfer_estimate", unit!("1"), None, 1.0, "The load transfer ratio estimated from lateral acceleration and roll";
    // Motion of the body
    BODY_HEAVE, "body.heave", unit!("m"), Some("mm"), 0.05, "Height of the sprung mass above static equilibrium";
    BODY_HEAVE_RATE, "body.heave_rate", unit!("m/s"), Some("mm/s"), 0.2, "Vertical velocity of the sprung mass";
    BODY_HEAVE_ACCELERATION, "body.heave_acceleration", unit!("m/s2"), None, 5.0, "Vertical acceleration of the sprung mass";
    BODY_ROLL, "body.roll", unit!("rad"), Some("deg"), 0.1, "Roll angle of the body, positive when it leans right";
    BODY_ROLL_RATE, "body.roll_rate", unit!("rad/s"), Some("deg/s"), 0.5, "Roll rate of the body";
    BODY_ROLL_ACCELERATION, "body.roll_acceleration", unit!("rad/s2"), Some("deg/s2"), 5.0, "Roll acceleration of the body";
    BODY_PITCH, "body.pitch", unit!("rad"), Some("deg"), 0.02, "Pitch angle of the body, positive nose down";
    BODY_PITCH_RATE, "body.pitch_rate", unit!("rad/s"), Some("deg/s"), 0.2, "Pitch rate of the body";
    BODY_PITCH_ACCELERATION, "body.pitch_acceleration", unit!("rad/s2"), Some("deg/s2"), 1.0, "Pitch acceleration of the body";
    CORNER_ACCELERATION, "corner_acceleration", unit!("m/s2"), None, 5.0, "Vertical acceleration of the body above the {}";
    // Wheels, suspension, tires
    WHEEL_HEIGHT, "wheel_height", unit!("m"), Some("mm"), 0.1, "Height of the unsprung mass above static equilibrium, {}";
    WHEEL_VELOCITY, "wheel_velocity", unit!("m/s"), Some("mm/s"), 1.0, "Vertical velocity of the unsprung mass, {}";
    WHEEL_SPEED, "wheel_speed", unit!("rad/s"), Some("rpm"), 100.0, "Speed of rotation of the {}, positive when it rolls forwards";
    BEAM_HEIGHT, "beam_height", unit!("m"), Some("mm"), 0.02, "Height of the walking beam's trunnion above static equilibrium, {}";
    BEAM_PITCH, "beam_pitch", unit!("rad"), Some("deg"), 0.02, "Pitch angle of the walking beam, positive when its front end is low, {}";
    BEAM_PITCH_RATE, "beam_pitch_rate", unit!("rad/s"), Some("deg/s"), 0.5, "Pitch rate of the walking beam, {}";
    SUSPENSION_DEFLECTION, "suspension_deflection", unit!("m"), Some("mm"), 0.1, "Body attachment height minus wheel height (compression negative), {}";
    SUSPENSION_VELOCITY, "suspension_velocity", unit!("m/s"), Some("mm/s"), 1.0, "Rate of the suspension deflection, {}";
    TIRE_DEFLECTION, "tire_deflection", unit!("m"), Some("mm"), 0.02, "Wheel height minus road height (compression negative), {}";
    TIRE_LOAD, "tire_load", unit!("N"), Some("kN"), 2e4, "Compressive force on the road, static load included, {}";
    TIRE_LATERAL_FORCE, "tire_lateral_force", unit!("N"), Some("kN"), 1e4, "Lateral tire force on the vehicle in the frame of the wheel, to the left, {}";
    TIRE_LONGITUDINAL_FORCE, "tire_longitudinal_force", unit!("N"), Some("kN"), 5e3, "Longitudinal tire force on the vehicle in the frame of the wheel, forwards, {}";
    TIRE_SLIP_ANGLE, "tire_slip_angle", unit!("rad"), Some("deg"), 0.1, "Direction of travel minus direction of the wheel, {}";
    TIRE_LONGITUDINAL_SLIP, "tire_longitudinal_slip", unit!("1"), Some("%"), 1.0, "Slip of the {}: braking negative, -1 locked";
    BRAKE_PRESSURE, "brake_pressure", unit!("MPa"), Some("bar"), 10.0, "Brake pressure of the {}";
    BRAKE_MASTER_PRESSURE, "brake.master_pressure", unit!("MPa"), Some("bar"), 10.0, "Brake pressure from the driver's pedal";
    // Commands to a plant
    STEER, "steer", unit!("rad"), Some("deg"), 0.1, "Steering angle of the {}, positive to the left";
    SUSPENSION_FORCE, "suspension_force", unit!("N"), Some("kN"), 1e4, "Actuator force of the {}, pushing the body up and the wheel down";
    BRAKE_TORQUE, "brake_torque", unit!("N.m"), Some("kN.m"), 1e3, "Brake torque on the {}, not negative; it acts against the rotation";
    DRIVE_TORQUE, "drive_torque", unit!("N.m"), Some("kN.m"), 500.0, "Drive torque on the {}, forwards positive";
    BRAKE_PRESSURE_COMMAND, "brake_pressure_command", unit!("MPa"), Some("bar"), 10.0, "Brake pressure command at the {}";
    // Between controllers
    STEER_REQUEST, "steer_request", unit!("rad"), Some("deg"), 0.2, "Steering command of the {} before angle and rate limits";
    STEER_CORRECTION, "steer_correction", unit!("rad"), Some("deg"), 0.02, "Angle that active steering of the {} adds to the driver demand";
    STEER_RATIO, "steer_ratio", unit!("1"), None, 1.0, "Steering angle of the {} divided by the driver demand";
    REFERENCE_YAW_RATE, "reference.yaw_rate", unit!("rad/s"), Some("deg/s"), 0.2, "Yaw rate that a lateral controller follows";
    REFERENCE_SIDESLIP, "reference.sideslip", unit!("rad"), Some("deg"), 0.05, "Sideslip angle that a lateral controller follows";
    SLIDING_SURFACE_SIDESLIP, "sliding_surface.sideslip", unit!("rad"), None, 0.05, "Value of the sliding surface of the sideslip angle";
    SLIDING_SURFACE_YAW_RATE, "sliding_surface.yaw_rate", unit!("rad/s"), None, 0.5, "Value of the sliding surface of the yaw rate";
    SLIDING_SURFACE_COMFORT, "sliding_surface.comfort", unit!("m/s"), None, 0.5, "Value of the sliding surface of the comfort law";
    SLIDING_SURFACE_HANDLING, "sliding_surface.handling", unit!("rad/s"), None, 1.0, "Value of the sliding surface of the handling law";
    WEIGHT_INTEGRATED, "weight.integrated", unit!("1"), None, 1.0, "Share of the integrated suspension law";
    WEIGHT_ROLL, "weight.roll", unit!("1"), None, 1.0, "Share of the roll suspension law";
    WEIGHT_STEERING, "weight.steering", unit!("1"), None, 1.0, "Multi-axle steering is on when above 0.5";
    INTEGRATED_FORCE, "integrated_force", unit!("N"), Some("kN"), 5e4, "Suspension force that the integrated law proposes for the {}";
    ROLL_FORCE, "roll_force", unit!("N"), Some("kN"), 5e4, "Suspension force that the roll law proposes for the {}";
    COMFORT_FORCE, "comfort_force", unit!("N"), Some("kN"), 1e4, "Suspension force that the comfort law proposes for the {}";
    HANDLING_FORCE, "handling_force", unit!("N"), Some("kN"), 1e4, "Suspension force that the handling law proposes for the {}";
    SWITCH_MODE, "switch.mode", unit!("1"), None, 1.0, "Selected suspension law: 0 comfort, 1 handling";
    SWITCH_BLEND, "switch.blend", unit!("1"), None, 1.0, "Share of the handling law in the suspension force";
    COORDINATION_STATE, "coordination.state", unit!("1"), None, 1.0, "Driving state: 0 not coordinated, 1 uniform, 2 accelerating, 3 braking, 4 turning, 5 turning and braking, 6 turning and accelerating";
    ENABLE_SUSPENSION, "enable.suspension", unit!("1"), None, 1.0, "Whether the suspension law is on";
    ENABLE_ANTILOCK, "enable.antilock", unit!("1"), None, 1.0, "Whether the antilock logic is on";
    ENABLE_YAW_CONTROL, "enable.yaw_control", unit!("1"), None, 1.0, "Whether the yaw control is on";
    SUSPENSION_PROPORTIONAL_GAIN, "suspension_proportional_gain", unit!("kg"), None, 100.0, "Force of the suspension law per change of the body's acceleration from sample to sample, {}";
    SUSPENSION_INTEGRAL_GAIN, "suspension_integral_gain", unit!("kg"), None, 1.0, "Force that the suspension law adds in a sample, per acceleration of the body, {}";
    SUSPENSION_DERIVATIVE_GAIN, "suspension_derivative_gain", unit!("kg"), None, 5.0, "Force of the suspension law per second difference of the body's acceleration, {}";
    TARGET_SLIP, "target_slip", unit!("1"), Some("%"), 0.2, "Braking slip that the antilock logic keeps, positive, {}";
    ANTILOCK_ACTIVE, "antilock_active", unit!("1"), None, 1.0, "Whether the antilock logic modulates the pressure of the {}";
    YAW_CONTROL_PRESSURE, "yaw_control_pressure", unit!("MPa"), Some("bar"), 10.0, "Brake pressure that yaw control adds at the {}, not negative";
    DEMAND_YAW_MOMENT, "demand.yaw_moment", unit!("N.m"), Some("kN.m"), 5e3, "Yaw moment that a controller asks for, positive to the left";
    DEMAND_HEAVE_FORCE, "demand.heave_force", unit!("N"), Some("kN"), 1e4, "Vertical force on the body demanded by a controller, before allocation to the wheels";
    DEMAND_PITCH_MOMENT, "demand.pitch_moment", unit!("N.m"), Some("kN.m"), 2e4, "Pitch moment on the body demanded by a controller, before allocation to the wheels";
    DEMAND_ROLL_MOMENT, "demand.roll_moment", unit!("N.m"), Some("kN.m"), 1e4, "Roll moment on the body demanded by a controller, before allocation to the wheels";
    FRONT_STEERING_PROPORTIONAL_GAIN, "front_steering.proportional_gain", unit!("s"), None, 0.5, "Proportional gain of active front steering after the fuzzy correction";
    FRONT_STEERING_INTEGRAL_GAIN, "front_steering.integral_gain", unit!("1"), None, 2.0, "Integral gain of active front steering after the fuzzy correction";
    FRONT_STEERING_DERIVATIVE_GAIN, "front_steering.derivative_gain", unit!("s2"), None, 0.02, "Derivative gain of active front steering after the fuzzy correction";
    ALL_WHEEL_STEERING_PROPORTIONAL_GAIN, "all_wheel_steering.proportional_gain", unit!("1/rad"), None, 10.0, "Proportional gain of all-wheel steering after the fuzzy correction";
    ALL_WHEEL_STEERING_INTEGRAL_GAIN, "all_wheel_steering.integral_gain", unit!("1/(rad.s)"), None, 20.0, "Integral gain of all-wheel steering after the fuzzy correction";
    ALL_WHEEL_STEERING_DERIVATIVE_GAIN, "all_wheel_steering.derivative_gain", unit!("s/rad"), None, 0.2, "Derivative gain of all-wheel steering after the fuzzy correction";
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
