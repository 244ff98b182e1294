//! A complete use of an FMU: every function, with rejected calls, saved states and a reset.

use crate::signals::{Excitation, run};
use crate::{Fmu, ok, rejected};
use fmu_import::description::{BaseType, Causality};

/// Communication step in s.
const STEP: f64 = 0.001;

/// Calls every function of an FMU.
///
/// # Panics
/// If the FMU rejects a valid call or accepts an invalid one.
pub fn life(fmu: &Fmu) {
    const STEPS: u32 = 40;
    let excitation = Excitation::of(fmu, 2);
    let reals = fmu.reals();
    let mut values = vec![0.0; reals.len()];
    let mut instance = fmu.started();
    drop(run(fmu, &mut instance, &excitation, 0.0, 0..STEPS, STEP));
    ok(instance.get_real(&reals, &mut values));
    // A state is saved, serialized, deserialized, restored, saved again and freed; one state is left for the FMU to
    // free with the instance.
    let saved = ok(instance.save_state());
    let bytes = ok(instance.serialize_state(&saved));
    let copy = ok(instance.deserialize_state(&bytes));
    drop(run(fmu, &mut instance, &excitation, 0.0, STEPS..2 * STEPS, STEP));
    ok(instance.restore_state(&copy));
    ok(instance.save_state_again(&saved));
    ok(instance.free_state(saved));
    // Calls are rejected with messages that are allocated on the heap.
    rejected(instance.set_real(&[reals[0]], &[f64::NAN]));
    rejected(instance.get_integer(&[u32::MAX], &mut [0]));
    rejected(instance.do_step(1e3, STEP));
    rejected(instance.deserialize_state(&bytes[1..]));
    rejected(instance.enter_initialization_mode());
    if fmu.is_plant() {
        let (unknown, known) = (fmu.references(Causality::Output), fmu.references(Causality::Input));
        let mut slopes = vec![0.0; unknown.len()];
        ok(instance.get_directional_derivative(&unknown, &known, &vec![1.0; known.len()], &mut slopes));
    }
    for variable in &fmu.description.variables {
        let reference = [variable.reference];
        match variable.base_type {
            BaseType::Integer => ok(instance.get_integer(&reference, &mut [0])),
            BaseType::Boolean => ok(instance.get_boolean(&reference, &mut [0])),
            BaseType::String => drop(ok(instance.get_string(&reference))),
            BaseType::Binary => drop(ok(instance.get_binary(&reference))),
            BaseType::Real => {}
        }
    }
    ok(instance.set_debug_logging(true, &[]));
    ok(instance.reset());
    ok(instance.enter_initialization_mode());
    ok(instance.exit_initialization_mode());
    drop(run(fmu, &mut instance, &excitation, 0.0, 0..STEPS, STEP));
    ok(instance.terminate());
    // A step with these inputs fails in most FMUs; the result does not matter here.
    let mut failing = fmu.instance_with(&vec![1.7e308; excitation.references.len()]);
    ok(failing.enter_initialization_mode());
    ok(failing.exit_initialization_mode());
    let _ = failing.do_step(0.0, STEP);
}
