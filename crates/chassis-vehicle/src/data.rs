//! Vehicle data: start values for the parameters of each plant and of the controllers that have copies of them.

/// Three-axle emergency rescue vehicle: Chen, Gong, Zhao, Liu, Jia, "Coordination Control of Multi-Axis Steering and
/// Active Suspension System for High-Mobility Emergency Rescue Vehicles", Mathematics 2022, 10, 3562.
///
/// Mass, axle distances and track are from Table 6 of the paper. The other values are assumed; the comment on each
/// gives the reason.
pub mod rescue_vehicle {
    /// Mass of the whole vehicle, kg (Table 6).
    pub const MASS: f64 = 36_000.0;
    /// Mass of one wheel, kg: a heavy corner with a single tire; 10 % of the vehicle's mass is unsprung.
    pub const WHEEL_MASS: f64 = 600.0;
    /// Distance from the front to the middle axle, m (Table 6).
    pub const FRONT_TO_MIDDLE: f64 = 2.95;
    /// Distance from the middle to the rear axle, m (Table 6).
    pub const MIDDLE_TO_REAR: f64 = 1.65;
    /// Distance from the center of mass to the front axle, m: makes the static axle loads equal.
    pub const CG_TO_FRONT: f64 = (2.0 * FRONT_TO_MIDDLE + MIDDLE_TO_REAR) / 3.0;
    /// Track, m (Table 6).
    pub const TRACK: f64 = 2.55;
    /// Height of the sprung mass's center of mass above the roll axis, m: the two are about 1.75 m and 0.75 m above
    /// the ground.
    pub const CG_TO_ROLL_AXIS: f64 = 1.0;
    /// Roll inertia about the roll axis, kg m2: gyration radius 0.92 m, plus the offset from the center of mass.
    pub const ROLL_AXIS_INERTIA: f64 = 60_000.0;
    /// Pitch inertia about the pitch axis, kg m2: gyration radius 2.0 m, plus the offset from the center of mass.
    pub const PITCH_AXIS_INERTIA: f64 = 160_000.0;
    /// Yaw inertia of the whole vehicle, kg m2: gyration radius 2.3 m.
    pub const YAW_INERTIA: f64 = 190_000.0;
    /// Integral of x z dm, kg m2: a small value that couples roll and yaw.
    pub const PRODUCT_OF_INERTIA: f64 = 5_000.0;
    /// Stiffness of one strut, N/m: hydropneumatic, heave at 0.97 Hz.
    pub const SUSPENSION_STIFFNESS: f64 = 250_000.0;
    /// Damping of one strut, N s/m: damping ratio of heave about 0.3.
    pub const SUSPENSION_DAMPING: f64 = 25_000.0;
    /// Vertical stiffness of one tire, N/m: static load divided by 0.16 times the section height of a large tire.
    pub const TIRE_STIFFNESS: f64 = 1.0e6;
    /// Cornering stiffness of one tire, N/rad: 5.1 times the static load.
    pub const CORNERING_STIFFNESS: f64 = 300_000.0;
    /// Friction coefficient of the tires: dry unpaved road.
    pub const FRICTION: f64 = 0.7;
    /// Lower limit of the speed in divisions, m/s.
    pub const MINIMUM_SPEED: f64 = 0.5;
    /// Speed of the paper's experiments, m/s (35 km/h).
    pub const SPEED: f64 = 35.0 / 3.6;
    /// Gravitational acceleration, m/s2.
    pub const GRAVITY: f64 = 9.81;
}

/// Rescue vehicle with adjustable hydro-pneumatic suspension, as a half car seen from the front: Applied Sciences 2020,
/// 10, 1852 (switch control between two sliding modes).
///
/// All values except gravity are from Table 1 of the paper, with these corrections:
///
/// * The stiffnesses and the damping are per meter; the table prints them per radian.
/// * The yaw inertia is the value that the table labels I_r.
/// * The height h_r is the height of the roll center; the table calls it the height of the center of mass.
/// * The roll inertia is taken about the roll axis.
pub mod hydro_pneumatic_half_car {
    /// Sprung mass, kg.
    pub const BODY_MASS: f64 = 1525.0;
    /// Mass of the front and the rear wheel of one side together, kg.
    pub const WHEEL_MASS: f64 = 50.0;
    /// Track, m.
    pub const TRACK: f64 = 1.56;
    /// Suspension stiffness of one side, N/m.
    pub const SUSPENSION_STIFFNESS: f64 = 35_000.0;
    /// Suspension damping of one side, N s/m.
    pub const SUSPENSION_DAMPING: f64 = 980.0;
    /// Vertical tire stiffness of one side, N/m.
    pub const TIRE_STIFFNESS: f64 = 190_000.0;
    /// Yaw inertia of the whole vehicle, kg m2.
    pub const YAW_INERTIA: f64 = 2500.0;
    /// Roll inertia about the roll axis, kg m2.
    pub const ROLL_AXIS_INERTIA: f64 = 460.0;
    /// Height of the sprung mass's center of mass above the roll axis, m.
    pub const CG_TO_ROLL_AXIS: f64 = 0.45;
    /// Height of the roll center above the ground, m.
    pub const ROLL_CENTER_HEIGHT: f64 = 0.5;
    /// Distance from the center of mass to the front axle, m.
    pub const CG_TO_FRONT: f64 = 1.27;
    /// Distance from the center of mass to the rear axle, m.
    pub const CG_TO_REAR: f64 = 1.94;
    /// Speed of the experiments on the random road, m/s (70 km/h, Table 6; 60 km/h on the bump road).
    pub const SPEED: f64 = 70.0 / 3.6;
    /// Gravitational acceleration, m/s2: standard value, rounded.
    pub const GRAVITY: f64 = 9.81;
}

/// Three-axle heavy truck with a walking-beam suspension of its rear axles: Lu, Wang, Zhang, "Multiobjective
/// Synchronous Control of Heavy-Duty Vehicles Based on Longitudinal and Lateral Coupling Dynamics", 2022.
///
/// The paper prints no vehicle data. "Calibrated" values are a rounded least-squares fit to its results without
/// control: vertical, pitch and roll acceleration in the step case of Table 3, and the roll ratios in section 4.1 (77,
/// 64 and 35 %). The other values are assumed; the comment on each gives the reason.
pub mod heavy_vehicle {
    /// Sprung mass, kg: 6x4 truck of the 25 t class.
    pub const BODY_MASS: f64 = 20_000.0;
    /// Roll inertia about the body's center of mass, kg m2: calibrated.
    pub const ROLL_INERTIA: f64 = 22_000.0;
    /// Pitch inertia about the body's center of mass, kg m2: calibrated.
    pub const PITCH_INERTIA: f64 = 78_000.0;
    /// Yaw inertia of the whole vehicle, kg m2: roughly the mass times the distances from the center of mass to the
    /// front axle and to the rear suspension.
    pub const YAW_INERTIA: f64 = 100_000.0;
    /// Minus the integral of x z dm, kg m2: a small value that couples roll and yaw.
    pub const ROLL_YAW_INERTIA: f64 = 2_000.0;
    /// Mass of one wheel position of the front, middle and rear axle, kg: half of a steer axle, half of a drive axle
    /// with dual wheels.
    pub const WHEEL_MASS: [f64; 3] = [300.0, 450.0, 450.0];
    /// Mass of one walking beam, kg.
    pub const BEAM_MASS: f64 = 200.0;
    /// Pitch inertia of one walking beam about its own center of mass, kg m2.
    pub const BEAM_PITCH_INERTIA: f64 = 60.0;
    /// Damping between beam and body, N m s/rad: 7 % of critical damping at the beam's pitch frequency of 9.4 Hz.
    pub const BEAM_PITCH_DAMPING: f64 = 4_000.0;
    /// Mass of the whole vehicle, kg.
    pub const MASS: f64 = BODY_MASS + 2.0 * (WHEEL_MASS[0] + WHEEL_MASS[1] + WHEEL_MASS[2]) + 2.0 * BEAM_MASS;
    /// Distance from the center of mass to the front axle, m: wheelbase 4.35 + 1.35 m, 28 % of the load in front.
    pub const CG_TO_FRONT: f64 = 3.6;
    /// Distance from the center of mass to the trunnion between middle and rear axle, m.
    pub const CG_TO_REAR_SUSPENSION: f64 = 1.425;
    /// Distance from the middle to the rear axle, m: usual tandem spacing.
    pub const MIDDLE_TO_REAR: f64 = 1.35;
    /// Distance from the center of mass to the wheels of one side, m.
    pub const HALF_TRACK: f64 = 0.95;
    /// Height of the sprung mass's center of mass above the roll axis, m: calibrated.
    pub const CG_TO_ROLL_AXIS: f64 = 0.45;
    /// Height of the roll center above the ground, m: calibrated.
    pub const ROLL_CENTER_HEIGHT: f64 = 0.7;
    /// Height of the wheel centers above the ground, m: radius of a 12R20 tire.
    pub const WHEEL_CENTER_HEIGHT: f64 = 0.5;
    /// Stiffness of one strut, front and rear (one per side for both rear axles), N/m: calibrated.
    pub const SUSPENSION_STIFFNESS: [f64; 2] = [360_000.0, 1_700_000.0];
    /// Damping of one strut, front and rear, N s/m: calibrated.
    pub const SUSPENSION_DAMPING: [f64; 2] = [12_000.0, 12_500.0];
    /// Vertical stiffness of one wheel position, N/m: one truck tire in front, dual tires behind.
    pub const TIRE_STIFFNESS: [f64; 3] = [900_000.0, 1_800_000.0, 1_800_000.0];
    /// Number of tires at a wheel position of each axle.
    pub const TIRE_COUNT: [f64; 3] = [1.0, 2.0, 2.0];
    /// Truck-tire load divided by the load of the car tire that the magic formula was fitted to. Gives a normalized
    /// cornering stiffness of 3.9 (front) and 6.9 per rad, and a peak friction of 0.73 and 0.82.
    pub const TIRE_LOAD_SCALE: f64 = 2.4;
    /// Slope of one front wheel's tire force over the slip angle at static load, N/rad.
    pub const FRONT_CORNERING_STIFFNESS: f64 = 119_344.049_967_2;
    /// Lower limit of the speed in divisions, m/s.
    pub const MINIMUM_SPEED: f64 = 0.5;
    /// Speed of the paper's main experiments, m/s (60 km/h).
    pub const SPEED: f64 = 60.0 / 3.6;
    /// Gravitational acceleration, m/s2: standard value, rounded.
    pub const GRAVITY: f64 = 9.81;
}

/// Two-axle car with semi-active suspension, antilock brakes and yaw control: Xia, Tang, Zhao, "Coordinated control of
/// a semi-active suspension system and an electronic stability program on a finite-state basis".
///
/// Values from Table 6 of the paper are marked. The other values are assumed; the comment on each gives the reason.
pub mod esp_car {
    /// Sprung mass, kg (Table 6, the second "m").
    pub const BODY_MASS: f64 = 1200.0;
    /// Mass of one front and one rear wheel, kg (Table 6).
    pub const WHEEL_MASS: [f64; 2] = [45.0, 35.0];
    /// Mass of the whole vehicle, kg: the sum.
    pub const MASS: f64 = BODY_MASS + 2.0 * (WHEEL_MASS[0] + WHEEL_MASS[1]);
    /// Distance from the center of mass to the front axle, m (Table 6).
    pub const CG_TO_FRONT: f64 = 1.10;
    /// Distance from the center of mass to the rear axle, m (Table 6).
    pub const CG_TO_REAR: f64 = 1.24;
    /// Full track, m. Table 6 calls it the wheelbase, which is 1.10 m + 1.24 m. As a half track, it would make the car
    /// 2.7 m wide.
    pub const TRACK: f64 = 1.36;
    /// Height of the whole vehicle's center of mass above the ground, m (Table 6).
    pub const CG_HEIGHT: f64 = 0.58;
    /// Height of the sprung mass's center of mass above the roll axis, m (Table 6).
    pub const CG_TO_ROLL_AXIS: f64 = 0.14;
    /// Height of the wheel centers above the ground, m: the radius of the wheels.
    pub const WHEEL_CENTER_HEIGHT: f64 = RADIUS;
    /// Roll inertia of the sprung mass about its own center of mass, kg m2 (Table 6).
    pub const ROLL_INERTIA: f64 = 521.0;
    /// Pitch inertia of the sprung mass about its own center of mass, kg m2 (Table 6).
    pub const PITCH_INERTIA: f64 = 1218.0;
    /// Yaw inertia of the sprung mass about its own center of mass, kg m2 (Table 6).
    pub const BODY_YAW_INERTIA: f64 = 1207.0;
    /// Yaw inertia of the whole vehicle, kg m2: body and wheels about the common center of mass, rounded to two
    /// decimals.
    pub const YAW_INERTIA: f64 = 1497.64;
    /// Stiffness of one front and one rear strut, N/m (Table 6).
    pub const SUSPENSION_STIFFNESS: [f64; 2] = [19_000.0, 17_000.0];
    /// Damping of one strut, N s/m (Table 6); damping ratio of heave 0.1.
    pub const SUSPENSION_DAMPING: f64 = 560.0;
    /// Stiffness of one anti-roll bar, N m/rad (Table 6).
    pub const ANTI_ROLL_BAR: f64 = 6695.0;
    /// Vertical stiffness of one tire, N/m (Table 6, printed with a comma and as a moment).
    pub const TIRE_STIFFNESS: f64 = 138_000.0;
    /// Rolling radius, m: a wheel of 13 or 14 inches.
    pub const RADIUS: f64 = 0.29;
    /// Inertia of one wheel about its axle, kg m2: a wheel of 13 or 14 inches.
    pub const SPIN_INERTIA: f64 = 0.9;
    /// Cornering stiffness of one front and one rear tire at its load at rest, N/rad: 10.7 and 13.4 times the load,
    /// typical of cars of this size.
    pub const CORNERING_STIFFNESS: [f64; 2] = [38_000.0, 42_000.0];
    /// Slip stiffness of one front and one rear tire at its load at rest, N: 18.4 times the load.
    pub const SLIP_STIFFNESS: [f64; 2] = [65_000.0, 58_000.0];
    /// Friction of the tires: gives the braking distance in Table 7 (state 3, no control) on a flat road.
    pub const FRICTION: f64 = 0.77;
    /// Brake torque per pressure at one front and one rear wheel, m3: pistons of about 54 and 34 mm, efficiency 0.95,
    /// brake factor 0.7, effective radius 0.11 m.
    pub const BRAKE_GAIN: [f64; 2] = [1.6748e-4, 6.6396e-5];
    /// Speed of the paper's experiments, m/s (60 km/h).
    pub const SPEED: f64 = 60.0 / 3.6;
    /// Gravitational acceleration, m/s2: standard value, rounded.
    pub const GRAVITY: f64 = 9.81;
}
