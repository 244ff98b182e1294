//! Calls in a running simulation do not allocate, and an instance frees all its memory.
#![allow(unsafe_code, reason = "a global allocator requires unsafe code")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use fmu::prelude::*;

use crate::models::{CartPair, Fmu, Sampler, reference};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static LIVE: Cell<i64> = const { Cell::new(0) };
}

// SAFETY: all calls are passed on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        LIVE.set(LIVE.get() + 1);
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        LIVE.set(LIVE.get() - 1);
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: as the caller promised.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Allocations of this thread that were not freed.
pub(crate) fn live() -> i64 {
    LIVE.get()
}

/// Number of allocations in `f`.
pub(crate) fn allocations(f: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    f();
    ALLOCATIONS.get() - before
}

#[test]
fn stepping_setting_inputs_and_getting_outputs_do_not_allocate() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![1]))), 1);

    let mut carts = Fmu::<CartPair>::ready();
    let inputs = ["cart_force.l", "cart_force.r", "ground.height"].map(reference::<CartPair>);
    let outputs = ["cart_position.l", "distance", "cart_acceleration.r", "der(cart_velocity.l)"];
    let outputs = outputs.map(reference::<CartPair>);
    let mut values = [0.0; 4];
    let run = || {
        for k in 0..100 {
            carts.0.set_real(&inputs, &[1.0, f64::from(k), 0.0]).unwrap();
            carts.0.do_step(f64::from(k) * 0.05, 0.05).unwrap();
            carts.0.get_real(&outputs, &mut values).unwrap();
        }
    };
    assert_eq!(allocations(run), 0);

    let mut fmu = Fmu::<Sampler>::ready();
    let (input, output) = (reference::<Sampler>("filter_input"), reference::<Sampler>("filter_output"));
    let run = || {
        for k in 0..100 {
            fmu.0.set_real(&[input], &[f64::from(k)]).unwrap();
            fmu.0.do_step(f64::from(k) * 0.05, 0.05).unwrap();
            fmu.0.get_real(&[output], &mut values[..1]).unwrap();
        }
    };
    assert_eq!(allocations(run), 0);
}

/// Law
#[derive(Enumeration, Clone, Copy)]
enum Law {
    /// Linear
    Linear,
    /// Progressive
    Progressive,
}

#[derive(Inputs)]
struct U<T> {
    /// Forces (N)
    force: [T; 2],
    /// Count
    count: i32,
    /// Active
    on: bool,
    /// Law
    law: Law,
}

#[derive(State)]
struct X<T> {
    /// Position (m)
    #[var(start = 1.0)]
    x: T,
    /// Velocity (m/s)
    v: T,
}

#[derive(Outputs)]
struct Y<T> {
    /// Acceleration (m/s2)
    a: T,
    /// Turns
    turns: i32,
}

#[derive(DiscreteState, Clone, Default)]
struct Turns {
    count: i32,
}

macro_rules! oscillators {
    ($(#[doc = $doc:literal] $name:ident [$($solver:tt)*] { $($advance:tt)* })*) => {$(
        #[derive(Parameters)]
        struct $name;

        #[doc = $doc]
        #[fmu::model(stop_time = 1.0, step_size = 0.01 $($solver)*)]
        impl Continuous for $name {
            type Inputs<T: Scalar> = U<T>;
            type State<T: Scalar> = X<T>;
            type Outputs<T: Scalar> = Y<T>;
            type DiscreteState = Turns;
            type Crossings = [f64; 1];
            fn evaluate<T: Scalar>(&self, at: At<T, Self>) -> (X<T>, Y<T>) {
                let (&X { x, v }, u) = (at.state, at.inputs);
                let spring = match u.law {
                    Law::Linear => x,
                    Law::Progressive => x * x * x,
                };
                let a = -spring + if u.on { u.force[0] + u.force[1] * f64::from(u.count) } else { T::from(0.0) };
                (X { x: v, v: a }, Y { a, turns: at.discrete.count })
            }
            fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
                [at.state.v]
            }
            fn on_event(&self, event: Event<Self>) {
                event.discrete.count += 1;
            }
            fn next_time_event(&self, at: At<f64, Self>) -> Option<f64> {
                Some((at.time * 4.0).floor() / 4.0 + 0.25)
            }
            $($advance)*
        }
    )*};
}

oscillators! {
    /// Oscillator by the classical method
    Classical [] {}
    /// Oscillator with error control
    Controlled [, solver = DormandPrince { tolerance: 1e-8 }] {}
    /// Oscillator with an implicit method
    Implicit [, solver = Rosenbrock { tolerance: 1e-6 }] {}
    /// Oscillator in closed form without forces
    Solved [] {
        fn advance(&self, at: At<f64, Self>, step: f64) -> X<f64> {
            let (sin, cos) = step.sin_cos();
            X { x: at.state.x * cos + at.state.v * sin, v: at.state.v * cos - at.state.x * sin }
        }
    }
}

#[test]
fn no_solver_allocates_in_a_step_from_the_first_one_on() {
    fn check<E: fmu::testing::abi::Export>() {
        let mut fmu = Fmu::<E>::ready();
        let (force, acceleration) = (reference::<E>("force[1]"), reference::<E>("a"));
        let [on, count, law, turns] = ["on", "count", "law", "turns"].map(reference::<E>);
        let mut value = [0.0];
        let run = || {
            for k in 0..200 {
                fmu.0.set_real(&[force], &[f64::from(k % 3)]).unwrap();
                fmu.0.set_boolean(&[on], &[k % 2 == 0]).unwrap();
                fmu.0.set_integer(&[count, law], &[k, k % 2]).unwrap();
                fmu.0.do_step(f64::from(k) * 0.05, 0.05).unwrap();
                fmu.0.get_real(&[acceleration], &mut value).unwrap();
            }
        };
        assert_eq!(allocations(run), 0, "{}", std::any::type_name::<E>());
        // The steps contained events.
        assert!(fmu.0.get_integer(turns).unwrap() > 40);
    }
    check::<Classical>();
    check::<Controlled>();
    check::<Implicit>();
    check::<Solved>();
}
