//! `SingleTrack`: lateral motion of a car with two wheels. The README has the equations.

use fmu::prelude::*;

/// Acceleration of gravity in m/s2.
const GRAVITY: f64 = 9.81;

/// Parameters.
#[derive(Parameters, Clone)]
pub struct SingleTrack {
    /// Speed, constant (m/s)
    #[var(start = 25.0, positive)]
    pub speed: f64,
    /// Mass (kg)
    #[var(start = 1500.0, positive)]
    pub mass: f64,
    /// Moment of inertia about the vertical axis (kg.m2)
    #[var(start = 2500.0, positive)]
    pub inertia: f64,
    /// Distance of the front axle to the center of mass (m)
    #[var(start = 1.2, positive)]
    pub front: f64,
    /// Distance of the rear axle to the center of mass (m)
    #[var(start = 1.4, positive)]
    pub rear: f64,
    /// Cornering stiffness of the front tires (N/rad)
    #[var(start = 100e3, positive)]
    pub front_stiffness: f64,
    /// Cornering stiffness of the rear tires (N/rad)
    #[var(start = 110e3, positive)]
    pub rear_stiffness: f64,
    /// Friction coefficient of the road (1)
    #[var(start = 0.8, positive)]
    pub friction: f64,
}

/// Inputs.
#[derive(Inputs)]
pub struct U<T> {
    /// Rate of the steering angle (rad/s)
    pub steer_rate: T,
}

/// State.
#[derive(State)]
pub struct X<T> {
    /// Lateral position, positive to the left (m)
    #[var(nominal = 1.0)]
    pub y: T,
    /// Heading (rad)
    #[var(nominal = 0.1)]
    pub yaw: T,
    /// Lateral velocity (m/s)
    #[var(nominal = 1.0)]
    pub lateral_velocity: T,
    /// Yaw rate (rad/s)
    #[var(nominal = 0.1)]
    pub yaw_rate: T,
    /// Steering angle of the front wheels (rad)
    #[var(nominal = 0.1)]
    pub steer: T,
}

/// Outputs that are not states.
#[derive(Outputs)]
pub struct Y<T> {
    /// Lateral acceleration (m/s2)
    pub lateral_acceleration: T,
}

impl SingleTrack {
    /// Force of an axle in N, linear for small slip angles and at most the friction coefficient times the axle load.
    fn force<T: Scalar>(&self, stiffness: f64, other_arm: f64, slip_angle: T) -> T {
        let most = self.friction * self.mass * GRAVITY * other_arm / (self.front + self.rear);
        (slip_angle * (stiffness / most)).tanh() * most
    }
}

/// Single-track model: lateral motion of a car at constant speed, with tires that saturate
#[fmu::model(stop_time = 5.0, step_size = 0.01)]
impl Continuous for SingleTrack {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn evaluate<T: Scalar>(&self, at: At<T, Self>) -> (X<T>, Y<T>) {
        let (x, u) = (at.state, at.inputs);
        let (v, r) = (x.lateral_velocity, x.yaw_rate);
        let front = self.force(self.front_stiffness, self.rear, x.steer - (v + r * self.front) / self.speed);
        let rear = self.force(self.rear_stiffness, self.front, -(v - r * self.rear) / self.speed);
        let lateral_acceleration = (front + rear) / self.mass;
        let derivatives = X {
            y: x.yaw.sin() * self.speed + x.yaw.cos() * v,
            yaw: r,
            lateral_velocity: lateral_acceleration - r * self.speed,
            yaw_rate: (front * self.front - rear * self.rear) / self.inertia,
            steer: u.steer_rate,
        };
        (derivatives, Y { lateral_acceleration })
    }
}
