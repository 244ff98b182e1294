//! The catalogue of physical parameters. A name has the same meaning in every FMU, so one parameter set fits a plant
//! and the controllers that have copies of its parameters.

use fmu::Range::{Any, AtLeast, NonNegative, Positive};
use fmu::{Definition, unit};

macro_rules! parameters {
    ($($name:ident, $text:literal, $unit:expr, $display:expr, $range:expr, $description:literal;)*) => {$(
        #[doc = concat!("`", $text, "`: ", $description, ".")]
        pub const $name: Definition = Definition {
            name: $text,
            unit: $unit,
            display: $display,
            nominal: None,
            range: $range,
            description: $description,
        };
    )*};
}

// The limits of `AtLeast` keep the LQR controllers numerically solvable.
parameters! {
    // Masses and inertias
    VEHICLE_MASS, "vehicle.mass", unit!("kg"), None, AtLeast(1.0), "Mass of the whole vehicle";
    BODY_MASS, "body.mass", unit!("kg"), None, Positive, "Mass of the sprung mass";
    WHEEL_MASS, "wheel.mass", unit!("kg"), None, AtLeast(0.01), "Unsprung mass of one wheel";
    WHEEL_MASS_SIDE, "wheel.mass.side", unit!("kg"), None, Positive, "Unsprung mass of one side, front and rear wheel together";
    VEHICLE_YAW_INERTIA, "vehicle.yaw_inertia", unit!("kg.m2"), None, Positive, "Yaw inertia of the whole vehicle";
    BODY_ROLL_AXIS_INERTIA, "body.roll_axis_inertia", unit!("kg.m2"), None, AtLeast(1.0), "Roll inertia of the sprung mass about the roll axis";
    BODY_PITCH_AXIS_INERTIA, "body.pitch_axis_inertia", unit!("kg.m2"), None, AtLeast(1.0), "Pitch inertia of the sprung mass about the pitch axis";
    BODY_YAW_INERTIA, "body.yaw_inertia", unit!("kg.m2"), None, Positive, "Yaw inertia of the sprung mass about its own center of mass";
    WHEEL_SPIN_INERTIA, "wheel.spin_inertia", unit!("kg.m2"), None, Positive, "Inertia of one wheel about its axle";
    BODY_PRODUCT_OF_INERTIA, "body.product_of_inertia", unit!("kg.m2"), None, Any, "Integral of x z dm of the sprung mass";
    BODY_ROLL_INERTIA, "body.roll_inertia", unit!("kg.m2"), None, Positive, "Roll inertia of the sprung mass about its own center of mass";
    BODY_PITCH_INERTIA, "body.pitch_inertia", unit!("kg.m2"), None, Positive, "Pitch inertia of the sprung mass about its own center of mass";
    BODY_ROLL_YAW_INERTIA, "body.roll_yaw_inertia", unit!("kg.m2"), None, Any, "Minus the integral of x z dm of the sprung mass";
    BEAM_MASS, "beam.mass", unit!("kg"), None, Positive, "Mass of one walking beam";
    BEAM_PITCH_INERTIA, "beam.pitch_inertia", unit!("kg.m2"), None, Positive, "Pitch inertia of one walking beam about its own center of mass";
    // Geometry
    CG_TO_FRONT_AXLE, "geometry.cg_to_front_axle", unit!("m"), None, Positive, "Center of mass to front axle, along x";
    CG_TO_REAR_AXLE, "geometry.cg_to_rear_axle", unit!("m"), None, Positive, "Center of mass to rear axle, along x";
    CG_TO_REAR_SUSPENSION, "geometry.cg_to_rear_suspension", unit!("m"), None, Positive, "Center of mass to the trunnion of the walking beams, along x";
    FRONT_TO_MIDDLE_AXLE, "geometry.front_to_middle_axle", unit!("m"), None, Positive, "Front to middle axle";
    MIDDLE_TO_REAR_AXLE, "geometry.middle_to_rear_axle", unit!("m"), None, Positive, "Middle to rear axle";
    TRACK, "geometry.track", unit!("m"), None, Positive, "Distance between the left and the right wheel of an axle";
    HALF_TRACK_LEFT, "geometry.half_track.left", unit!("m"), None, Positive, "Center of mass to the left wheels, along y";
    HALF_TRACK_RIGHT, "geometry.half_track.right", unit!("m"), None, Positive, "Center of mass to the right wheels, along y";
    BODY_CG_TO_ROLL_AXIS, "geometry.body_cg_to_roll_axis", unit!("m"), None, NonNegative, "Height of the sprung mass's center of mass over the roll axis";
    ROLL_CENTER_HEIGHT, "geometry.roll_center_height", unit!("m"), None, NonNegative, "Height of the roll center over ground";
    CG_HEIGHT, "geometry.cg_height", unit!("m"), None, Positive, "Height of the whole vehicle's center of mass over ground";
    WHEEL_RADIUS, "wheel.radius", unit!("m"), None, Positive, "Rolling radius of a wheel";
    WHEEL_CENTER_HEIGHT, "geometry.wheel_center_height", unit!("m"), None, NonNegative, "Height of the wheel centers over ground";
    // Suspension and tires
    SUSPENSION_STIFFNESS, "suspension.stiffness", unit!("N/m"), Some("kN/m"), NonNegative, "Stiffness of one suspension strut";
    SUSPENSION_STIFFNESS_SIDE, "suspension.stiffness.side", unit!("N/m"), Some("kN/m"), NonNegative, "Stiffness of the suspension of one side, front and rear strut together";
    SUSPENSION_DAMPING, "suspension.damping", unit!("N.s/m"), Some("kN.s/m"), NonNegative, "Damping of one suspension strut";
    SUSPENSION_DAMPING_SIDE, "suspension.damping.side", unit!("N.s/m"), Some("kN.s/m"), NonNegative, "Damping of the suspension of one side, front and rear strut together";
    ANTI_ROLL_BAR_STIFFNESS, "anti_roll_bar.stiffness", unit!("N.m/rad"), Some("kN.m/rad"), NonNegative, "Moment of the anti-roll bar per roll angle between body and axle";
    BEAM_PITCH_DAMPING, "beam.pitch_damping", unit!("N.m.s/rad"), None, NonNegative, "Damping between one walking beam and the body, moment per pitch rate";
    TIRE_STIFFNESS, "tire.stiffness", unit!("N/m"), Some("kN/m"), AtLeast(1e3), "Vertical stiffness of one tire";
    TIRE_STIFFNESS_SIDE, "tire.stiffness.side", unit!("N/m"), Some("kN/m"), Positive, "Vertical stiffness of the tires of one side, front and rear tire together";
    TIRE_CORNERING_STIFFNESS, "tire.cornering_stiffness", unit!("N/rad"), Some("kN/rad"), Positive, "Cornering stiffness of one tire";
    AXLE_CORNERING_STIFFNESS, "axle.cornering_stiffness", unit!("N/rad"), Some("kN/rad"), Positive, "Cornering stiffness of both tires together";
    TIRE_FRICTION, "tire.friction", unit!("1"), None, NonNegative, "Friction coefficient of the tires";
    BRAKE_GAIN, "brake.gain", unit!("m3"), None, Positive, "Brake torque per pressure of one wheel";
    TIRE_FORCE_SCALE, "tire.force_scale", unit!("1"), None, NonNegative, "Factor on the lateral tire force at every slip angle";
    GRAVITY, "gravity", unit!("m/s2"), None, NonNegative, "Acceleration of free fall";
    MINIMUM_SPEED, "numerics.minimum_speed", unit!("m/s"), Some("km/h"), Positive, "Lower limit of the speed in divisions";
}
