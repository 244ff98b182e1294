use fmi2::prelude::*;

mod catalogue {
    use fmi2::prelude::*;
    use fmi2::{Role, Signal};

    pub const BODY_ROLL: Signal = Signal {
        name: "body.roll",
        unit: RAD,
        display: None,
        nominal: 0.1,
        role: Role::Measurement,
        description: "Roll angle",
    };
}

#[derive(Inputs, Clone)]
pub struct Inputs<T> {
    #[signal(catalogue::BODY_ROLL)]
    pub phi: T,
    #[signal(catalogue::BODY_ROL_RATE)]
    pub p: T,
}

fn main() {}
