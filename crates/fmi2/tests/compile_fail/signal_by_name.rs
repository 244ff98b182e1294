use fmi2::prelude::*;

#[derive(Inputs, Clone)]
pub struct Inputs<T> {
    #[signal("body.roll")]
    pub phi: T,
}

fn main() {}
