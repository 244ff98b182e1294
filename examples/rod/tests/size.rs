//! Models with 10,000 states: stack, memory, number of evaluations, and a structure that changes during a run.
#![allow(unsafe_code, reason = "an allocator that counts can only be written with unsafe code")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::PathBuf;
use std::sync::Mutex;

use fmu::prelude::*;
use fmu::testing::abi::Export;
use fmu::testing::calls::Protocol;
use fmu::testing::instance::Instance;

struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
    static EVALUATIONS: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: everything is passed on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: as the caller promised.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as the caller promised.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

macro_rules! rods {
    ($($module:ident $cells:literal $solver:expr, { $($events:tt)* };)*) => {$(
        mod $module {
            use super::*;

            pub(crate) const CELLS: usize = $cells;

            #[derive(Parameters)]
            pub(crate) struct Rod {
                /// Exchange between neighbors (1/s)
                #[var(start = 0.2, min = 0.0, tunable)]
                exchange: f64,
            }

            #[derive(State)]
            pub(crate) struct X<T> {
                /// Temperature (degC)
                #[var(start = 20.0, nominal = 20.0)]
                cell: [T; CELLS],
            }

            #[derive(Inputs)]
            pub(crate) struct U<T> {
                /// Heating (K/s)
                #[var(start = 5.0)]
                heat: T,
                /// Whether the rod is closed to a ring
                ring: bool,
            }

            /// Rod of cells that exchange heat; a ring if the exchange is large
            #[fmu::model(stop_time = 1.0, step_size = 0.1, solver = $solver)]
            impl Continuous for Rod {
                type State<T: Scalar> = X<T>;
                type Inputs<T: Scalar> = U<T>;
                fn derivatives<T: Scalar>(&self, at: At<T, Self>) -> X<T> {
                    EVALUATIONS.set(EVALUATIONS.get() + 1);
                    let x = &at.state.cell;
                    let is_ring = at.inputs.ring || self.exchange > 10.0;
                    let before = |i: usize| if i > 0 { i - 1 } else if is_ring { CELLS - 1 } else { 0 };
                    let to = |i: usize, other: usize| (x[other] - x[i]) * self.exchange;
                    let mut rates: [T; CELLS] =
                        std::array::from_fn(|i| to(i, before(i)) + to(i, (i + 1).min(CELLS - 1)));
                    rates[0] += at.inputs.heat;
                    X { cell: rates }
                }
                $($events)*
            }
        }
    )*};
}

rods! {
    runge_kutta 10_000 RungeKutta, {};
    dormand_prince 10_000 DormandPrince { tolerance: 1e-6 }, {};
    rosenbrock 10_000 Rosenbrock { tolerance: 1e-6 }, {};
    events 10_000 RungeKutta, {
        type Crossings = [f64; 1];
        fn zero_crossings(&self, at: At<f64, Self>) -> [f64; 1] {
            [at.state.cell[0] - 20.5]
        }
        fn on_event(&self, event: Event<Self>) {
            event.state.cell[1] += 1.0;
        }
    };
    short 40 Rosenbrock { tolerance: 1e-6 }, {};
}

/// An initialized instance with the given values of the parameter and the Boolean input.
fn instance<E: Export>(exchange: f64, ring: bool) -> Instance<E::Model> {
    let description = E::description();
    let ring_reference = description.layout.first.booleans as u32;
    let mut fmu = Instance::new(Protocol::CS3, description, PathBuf::new());
    fmu.enter_initialization().unwrap();
    fmu.set_real(&[0], &[exchange]).unwrap();
    fmu.set_boolean(&[ring_reference], &[ring]).unwrap();
    fmu.exit_initialization().unwrap();
    fmu
}

/// References of the first state and of the first derivative.
fn references<E: Export>() -> (u32, u32) {
    let layout = &E::description().layout;
    (layout.states.at.reals as u32, layout.derivatives.at.reals as u32)
}

/// Runs `f` on a thread whose stack is `size` KiB.
fn within(size: usize, f: impl FnOnce() + Send) {
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().stack_size(size * 1024);
        thread.spawn_scoped(scope, f).unwrap().join().unwrap();
    });
}

/// Packed FMUs need up to 255 KiB of stack for the solvers that compute with `f64` only, 480 KiB for the Rosenbrock
/// solver and 640 KiB for derivatives. This test is compiled with less optimization, so it gets 1.5 times the stack of
/// common threads (512 KiB and 1 MiB).
#[test]
fn ten_thousand_states_run_on_a_small_stack_without_allocation_in_a_step() {
    fn check<E: Export>(step: usize)
    where
        Instance<E::Model>: Send,
    {
        let fmu = Mutex::new(instance::<E>(0.2, false));
        let (state, derivative) = references::<E>();
        within(step, || {
            let mut fmu = fmu.lock().unwrap();
            fmu.do_step(0.0, 0.1).unwrap();
            let saved = fmu.snapshot().unwrap();
            let steps = |fmu: &mut Instance<_>| {
                let before = ALLOCATIONS.get();
                (1..5).for_each(|k| fmu.do_step(f64::from(k) * 0.1, 0.1).unwrap());
                assert_eq!(ALLOCATIONS.get() - before, 0);
            };
            steps(&mut fmu);
            fmu.restore(&saved).unwrap();
            steps(&mut fmu);
            fmu.get_real(&[derivative], &mut [0.0]).unwrap();
        });
        within(1536, || {
            let mut slope = [0.0];
            fmu.lock().unwrap().directional_derivative(&[derivative + 1], &[state], &[1.0], &mut slope).unwrap();
            assert_eq!(slope, [0.2]);
        });
    }
    check::<runge_kutta::Rod>(768);
    check::<events::Rod>(768);
    check::<dormand_prince::Rod>(768);
    check::<rosenbrock::Rod>(1536);
}

/// Reference: row 1 of the Jacobian contains 0.2, -0.4 and 0.2. Three groups of columns are enough for all 10,000
/// columns.
#[test]
fn an_adjoint_derivative_takes_one_evaluation_for_each_group_of_columns() {
    let mut fmu = instance::<runge_kutta::Rod>(0.2, false);
    let (state, derivative) = references::<runge_kutta::Rod>();
    let n = runge_kutta::CELLS as u32;
    let (unknown, known): (Vec<_>, Vec<_>) = ((derivative..derivative + n).collect(), (state..state + n).collect());
    let (mut seed, mut result) = (vec![0.0; unknown.len()], vec![0.0; known.len()]);
    seed[1] = 1.0;
    EVALUATIONS.set(0);
    fmu.adjoint_derivative(&unknown, &known, &seed, &mut result).unwrap();
    assert_eq!(result[..4], [0.2, -0.4, 0.2, 0.0]);
    assert!(result[4..].iter().all(|slope| *slope == 0.0));
    assert!(EVALUATIONS.get() < 10, "{}", EVALUATIONS.get());
}

/// Reference: the same steps of an instance that was a ring from the start. If the structure of the open rod were still
/// used, elements of the Jacobian would be missing.
#[test]
fn a_structure_that_changes_during_a_run_is_determined_again() {
    let layout = &short::Rod::description().layout;
    let (heat, ring) = (layout.inputs.at.reals as u32, layout.first.booleans as u32);
    let (state, _) = references::<short::Rod>();
    let all: Vec<_> = (state..state + short::CELLS as u32).collect();
    let run = |mut fmu: Instance<_>| {
        fmu.set_real(&[heat], &[100.0]).unwrap();
        (0..3).for_each(|k| fmu.do_step(f64::from(k) * 0.1, 0.1).unwrap());
        let mut x = vec![0.0; all.len()];
        fmu.get_real(&all, &mut x).unwrap();
        x
    };
    let rod = instance::<short::Rod>(2.0, false);
    let rod = run(rod);
    let mut by_input = instance::<short::Rod>(2.0, false);
    by_input.set_boolean(&[ring], &[true]).unwrap();
    let by_input = run(by_input);
    assert_eq!(by_input, run(instance::<short::Rod>(2.0, true)));
    assert_ne!(by_input, rod);
    let mut by_parameter = instance::<short::Rod>(2.0, false);
    by_parameter.set_real(&[0], &[20.0]).unwrap();
    assert_eq!(run(by_parameter), run(instance::<short::Rod>(20.0, false)));
}
