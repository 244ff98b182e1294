use fmi2::prelude::*;

#[derive(Parameters, Clone)]
pub struct P {
    /// Mass of the cart
    #[par("cart.mass", unit = KG, start = 1.0)]
    pub m: f64,
}
#[derive(State, Clone)]
pub struct X<T> {
    /// Position
    #[var("cart.position", unit = M)]
    pub x: T,
}
#[derive(Inputs, Clone)]
pub struct U<T> {
    /// Speed
    #[var("cart.speed", unit = M_PER_S)]
    pub v: T,
}
#[derive(Outputs, Clone)]
pub struct Y<T> {
    /// Distance
    #[var("cart.distance", unit = M)]
    pub y: T,
}

pub struct Cart;

impl Plant for Cart {
    const INFO: Info = Info { name: "Cart", description: "A cart", version: "1", stop_time: 1.0, step_size: 0.1 };
    type Parameters = P;
    type Design = ();
    type State<T: Scalar> = X<T>;
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;

    fn design(_: &P) -> Result<(), String> {
        Ok(())
    }
    fn derivatives<T: Scalar>(_: &P, (): &(), _: &X<T>, u: &U<T>) -> X<T> {
        X { x: u.v }
    }
    fn outputs<T: Scalar>(_: &P, (): &(), x: &X<T>, _: &U<T>) -> Y<T> {
        Y { y: x.x.abs() }
    }
}

fmi2::export!(plant Cart);

fn main() {}
