use fmu::prelude::*;
#[derive(Parameters)]
pub struct Q;
/// Queue
impl Stateful for Q {
    type Simulation = u32;
    fn start(&self, _: &std::path::Path) -> Result<u32, String> {
        Ok(0)
    }
    fn step(&self, _: &mut u32, _: &(), _: f64, _: f64) -> Result<(), String> {
        Ok(())
    }
    fn outputs(&self, _: &u32) {}
}
fn main() {}
