//! Equations may compare values that do not have the number type of the equations. Reference: the same comparisons
//! outside of a model.

use fmu::prelude::*;
use fmu::simulation::ContinuousSimulation;

/// Law
#[derive(Enumeration, Clone, Copy, Debug, PartialEq, PartialOrd)]
enum Law {
    /// None
    Off,
    /// Linear
    Linear,
}

#[derive(Parameters)]
struct Comparing {
    /// Limit (1)
    #[var(start = 2.0)]
    limit: f64,
    /// Law
    #[var(start = Law::Linear)]
    law: Law,
    /// Order
    #[var(start = 3, min = 0, max = 5)]
    order: i32,
    /// Text
    #[var(start = "b")]
    text: String,
    /// Gains (1)
    #[var(start = [1.0, 5.0, 3.0])]
    gains: [f64; 3],
}

#[derive(Inputs)]
struct U<T> {
    /// Input (1)
    u: T,
    /// Number of an input
    number: i32,
}

#[derive(Outputs)]
struct Y<T> {
    /// Number of comparisons that hold (1)
    count: T,
}

const LEAST: i32 = 2;

/// Compares what is no number of the equations
#[fmu::model(stop_time = 1.0, step_size = 0.1)]
impl Continuous for Comparing {
    type Inputs<T: Scalar> = U<T>;
    type Outputs<T: Scalar> = Y<T>;
    fn outputs<T: Scalar>(&self, at: At<T, Self>) -> Y<T> {
        const IS_LEAST: bool = LEAST >= 2;
        let largest = self.gains.iter().copied().fold(0.0, |a, b| if b > a { b } else { a });
        let above: Vec<&f64> = self.gains.iter().filter(|gain| **gain > self.limit).collect();
        let mut count = 0;
        while count < 1 {
            count += 1;
        }
        let parsed = "3".parse::<i32>();
        let pair = (self.order, self.limit);
        let all = [
            self.limit > 1.0 && self.limit < 1e3,
            2.0 <= self.limit,
            self.limit * 2.0 >= largest - 1.0,
            self.law == Law::Linear,
            self.law > Law::Off,
            self.law != Law::Off,
            self.text == "b",
            self.text.as_str() != "a",
            self.order as usize == self.gains.len(),
            above.len() > 1,
            above.first() == Some(&&5.0),
            count == 1,
            parsed == Ok(self.order),
            pair == (3, 2.0),
            at.inputs.number >= LEAST,
            at.inputs.u.value() > 0.5,
            IS_LEAST,
            [0_u8; 3 + (LEAST > 1) as usize].len() == 4,
            self.gains[..2] == [1.0, 5.0],
            matches!(self.order, n if n > 2),
        ];
        Y { count: T::from(f64::from(all.map(i32::from).iter().sum::<i32>())) }
    }
}

#[test]
fn parameters_integers_and_texts_are_compared_as_anywhere() {
    let mut run = ContinuousSimulation::new(Comparing::default()).unwrap();
    assert_eq!(run.outputs(&U { u: 1.0, number: 2 }).count, 20.0);
    assert_eq!(run.outputs(&U { u: 0.0, number: 1 }).count, 18.0);
    let model = Comparing { limit: 0.0, law: Law::Off, order: 0, text: "a".to_owned(), gains: [0.0; 3] };
    let mut run = ContinuousSimulation::new(model).unwrap();
    // Only four comparisons still hold: those of the counter, the constant and the array length, and 0 >= 0 - 1.
    assert_eq!(run.outputs(&U { u: 0.0, number: 0 }).count, 4.0);
}
