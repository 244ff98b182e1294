//! The calls of a running simulation do not allocate, and what an instance holds goes with it.
#![allow(unsafe_code, reason = "an allocator that counts can only be written with unsafe code")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use crate::models::{CartPair, Sampler, Unit, reference};

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static LIVE: Cell<i64> = const { Cell::new(0) };
}

// SAFETY: everything is passed on to the system's allocator.
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

/// How often `f` allocates.
fn allocations(f: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.get();
    f();
    ALLOCATIONS.get() - before
}

#[test]
fn stepping_setting_inputs_and_getting_outputs_do_not_allocate() {
    assert_eq!(allocations(|| drop(std::hint::black_box(vec![1]))), 1);

    let mut plant = Unit::<CartPair>::ready();
    let inputs = ["cart_force.l", "cart_force.r", "ground.height"].map(reference::<CartPair>);
    let outputs = ["cart_position.l", "distance", "cart_acceleration.r", "der(cart_velocity.l)"];
    let outputs = outputs.map(reference::<CartPair>);
    let mut values = [0.0; 4];
    let run = || {
        for k in 0..100 {
            plant.0.set_real(&inputs, &[1.0, f64::from(k), 0.0]).unwrap();
            plant.0.do_step(f64::from(k) * 0.05, 0.05).unwrap();
            plant.0.get_real(&outputs, &mut values).unwrap();
        }
    };
    assert_eq!(allocations(run), 0);

    let mut unit = Unit::<Sampler>::ready();
    let (input, output) = (reference::<Sampler>("filter_input"), reference::<Sampler>("filter_output"));
    let run = || {
        for k in 0..100 {
            unit.0.set_real(&[input], &[f64::from(k)]).unwrap();
            unit.0.do_step(f64::from(k) * 0.05, 0.05).unwrap();
            unit.0.get_real(&[output], &mut values[..1]).unwrap();
        }
    };
    assert_eq!(allocations(run), 0);
}
