//! Data of the vehicles: the start values of a plant and of the controllers that carry copies of its parameters.

/// Three-axle emergency rescue vehicle: Chen, Gong, Zhao, Liu, Jia, "Coordination Control of Multi-Axis Steering and
/// Active Suspension System for High-Mobility Emergency Rescue Vehicles", Mathematics 2022, 10, 3562.
///
/// Mass, axle distances and track stand in Table 6 of the paper; everything else is assumed, as the reason beside each
/// value says.
pub mod rescue_vehicle {
    /// Whole vehicle, kg (Table 6).
    pub const MASS: f64 = 36_000.0;
    /// One wheel, kg: a heavy single-tire corner, 10 % of the vehicle unsprung.
    pub const WHEEL_MASS: f64 = 600.0;
    /// Front to middle axle, m (Table 6).
    pub const FRONT_TO_MIDDLE: f64 = 2.95;
    /// Middle to rear axle, m (Table 6).
    pub const MIDDLE_TO_REAR: f64 = 1.65;
    /// Center of mass to front axle, m: equal static loads of the axles.
    pub const CG_TO_FRONT: f64 = (2.0 * FRONT_TO_MIDDLE + MIDDLE_TO_REAR) / 3.0;
    /// Track, m (Table 6).
    pub const TRACK: f64 = 2.55;
    /// Sprung mass's center of mass over the roll axis, m: about 1.75 m over ground, roll axis about 0.75 m.
    pub const CG_TO_ROLL_AXIS: f64 = 1.0;
    /// About the roll axis, kg m2: gyration radius 0.92 m and the offset of the roll axis.
    pub const ROLL_AXIS_INERTIA: f64 = 60_000.0;
    /// About the pitch axis, kg m2: gyration radius 2.0 m and the offset of the pitch axis.
    pub const PITCH_AXIS_INERTIA: f64 = 160_000.0;
    /// Whole vehicle, kg m2: gyration radius 2.3 m.
    pub const YAW_INERTIA: f64 = 190_000.0;
    /// Integral of x z dm, kg m2: small, but it couples roll and yaw.
    pub const PRODUCT_OF_INERTIA: f64 = 5_000.0;
    /// One strut, N/m: heave at 0.97 Hz, hydropneumatic.
    pub const SUSPENSION_STIFFNESS: f64 = 250_000.0;
    /// One strut, N s/m: damping ratio of heave about 0.3.
    pub const SUSPENSION_DAMPING: f64 = 25_000.0;
    /// One tire, vertical, N/m: load over 0.16 times the section height of a large tire.
    pub const TIRE_STIFFNESS: f64 = 1.0e6;
    /// One tire, N/rad: 5.1 per rad of the static load.
    pub const CORNERING_STIFFNESS: f64 = 300_000.0;
    /// Friction of tires on a dry unpaved road.
    pub const FRICTION: f64 = 0.7;
    /// Floor of the speed where it divides, m/s.
    pub const MINIMUM_SPEED: f64 = 0.5;
    /// Speed of the paper's experiments, m/s (35 km/h).
    pub const SPEED: f64 = 35.0 / 3.6;
    /// m/s2.
    pub const GRAVITY: f64 = 9.81;
}

/// Rescue vehicle with adjustable hydro-pneumatic suspension, as a half car seen from the front: Applied Sciences 2020,
/// 10, 1852 (switch control between two sliding modes).
///
/// Everything but gravity stands in Table 1 of the paper, with these corrections: the stiffnesses and the damping are
/// linear although printed per radian, the yaw inertia is printed I_r, the height h_r is that of the roll center
/// although printed as that of the center of mass, and the roll inertia is taken about the roll axis.
pub mod hydro_pneumatic_half_car {
    /// Sprung mass, kg.
    pub const BODY_MASS: f64 = 1525.0;
    /// One side, front and rear wheel together, kg.
    pub const WHEEL_MASS: f64 = 50.0;
    /// Track, m.
    pub const TRACK: f64 = 1.56;
    /// One side, N/m.
    pub const SUSPENSION_STIFFNESS: f64 = 35_000.0;
    /// One side, N s/m.
    pub const SUSPENSION_DAMPING: f64 = 980.0;
    /// One side, vertical, N/m.
    pub const TIRE_STIFFNESS: f64 = 190_000.0;
    /// Whole vehicle, kg m2.
    pub const YAW_INERTIA: f64 = 2500.0;
    /// About the roll axis, kg m2.
    pub const ROLL_AXIS_INERTIA: f64 = 460.0;
    /// Sprung mass's center of mass over the roll axis, m.
    pub const CG_TO_ROLL_AXIS: f64 = 0.45;
    /// Roll center over ground, m.
    pub const ROLL_CENTER_HEIGHT: f64 = 0.5;
    /// Center of mass to front axle, m.
    pub const CG_TO_FRONT: f64 = 1.27;
    /// Center of mass to rear axle, m.
    pub const CG_TO_REAR: f64 = 1.94;
    /// Speed of the experiments on the random road, m/s (70 km/h, Table 6; 60 km/h on the bump road).
    pub const SPEED: f64 = 70.0 / 3.6;
    /// m/s2: standard value, rounded.
    pub const GRAVITY: f64 = 9.81;
}
