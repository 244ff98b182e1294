//! `DcMotor`: armature circuit and rotor. The README has the equations.

use fmu::prelude::*;

/// Parameters.
#[derive(Parameters, Clone)]
pub struct DcMotor {
    /// Resistance of the armature (Ohm)
    #[var(start = 0.5, positive)]
    pub resistance: f64,
    /// Inductance of the armature (H)
    #[var(start = 0.005, positive)]
    pub inductance: f64,
    /// Torque constant and back-EMF constant (N.m/A)
    #[var(start = 0.05, min = 0.0)]
    pub constant: f64,
    /// Moment of inertia of rotor and load (kg.m2)
    #[var(start = 0.001, positive)]
    pub inertia: f64,
    /// Viscous friction (N.m.s/rad)
    #[var(start = 1e-4, min = 0.0)]
    pub friction: f64,
}

/// Inputs.
#[derive(Inputs)]
pub struct U<T> {
    /// Voltage of the armature (V)
    pub voltage: T,
    /// Torque of the load, against a positive speed (N.m)
    pub load_torque: T,
}

/// State.
#[derive(State)]
pub struct X<T> {
    /// Current in the armature (A)
    #[var(nominal = 10.0)]
    pub current: T,
    /// Speed of the rotor (rad/s)
    #[var(nominal = 100.0)]
    pub speed: T,
}

/// Outputs that are not states.
#[derive(Outputs)]
pub struct Y<T> {
    /// Electromagnetic torque (N.m)
    pub torque: T,
}

/// DC motor with armature circuit and rotor
#[fmu::model(stop_time = 2.0, step_size = 0.001)]
impl Continuous for DcMotor {
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn evaluate<T: Scalar>(&self, at: At<T, Self>) -> (X<T>, Y<T>) {
        let (x, u) = (at.state, at.inputs);
        let torque = x.current * self.constant;
        let derivatives = X {
            current: (u.voltage - x.current * self.resistance - x.speed * self.constant) / self.inductance,
            speed: (torque - x.speed * self.friction - u.load_torque) / self.inertia,
        };
        (derivatives, Y { torque })
    }
}
